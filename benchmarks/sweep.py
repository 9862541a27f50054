"""Sweeps of endless strips beside as many bare exponentials: times their time, and true error."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from benchmarks.field import PATCH, exponentials
from benchmarks.timing import duration
from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    Material,
    MomentDisc,
    PointForce,
    PressureRectangle,
    Scene,
    Strip,
    response,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from stimuli import IdealEdge, Load
    from stimuli.arrays import Real

RTOL: Final = 1e-6
_EXACT: Final = 1e-12
_COUNT: Final = 500
_CHECKED: Final = slice(None, None, 9)
_REPEATS: Final = 25
_LOSSES: Final = (0.0, 0.01)
_WIDTH_M: Final = 0.025
_POINTS: Final = ((0.0, 0.5), (0.8, 0.3))
"""Two receivers in widths: over the patch and 20 mm away, off the centre line."""

_SHARES: Final = {"below": (0.002, 0.95), "across": (0.002, 2.0), "above": (9.3, 20.7)}
"""Bands as parts of the first cut-off."""

GLASS: Final = Material(youngs_modulus_pa=70e9, poisson_ratio=0.22, density_kg_m3=2500.0)
STEEL: Final = Material(youngs_modulus_pa=200e9, poisson_ratio=0.29, density_kg_m3=7850.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A strip with one load and two receivers, swept over a band."""

    name: str
    scene: Scene
    frequencies_hz: Real


def _case(
    name: str,
    part: str,
    *,
    edge: IdealEdge | ElasticEdge,
    material: Material = ALUMINIUM,
    thickness_m: float = 0.0005,
    load: Load = PATCH,
) -> Iterator[Case]:
    for loss in _LOSSES:
        strip = Strip(
            width_m=_WIDTH_M,
            thickness_m=thickness_m,
            material=dataclasses.replace(material, loss_factor=loss),
            edge=edge,
        )
        low, high = _SHARES[part]
        yield Case(
            name=f"{name}, {part}",
            scene=Scene(
                strip=strip,
                loads=(load,),
                points_m=tuple((x * _WIDTH_M, y * _WIDTH_M) for x, y in _POINTS),
            ),
            frequencies_hz=np.linspace(low, high, _COUNT) * strip.cutoff_hz(),
        )


def cases() -> Iterator[Case]:
    """Yield the plate of the paper with ideal edges, and plates that no default has."""
    for part in _SHARES:
        yield from _case("supported", part, edge=SIMPLY_SUPPORTED)
    for part in _SHARES:
        yield from _case("clamped", part, edge=CLAMPED)
    spring = ElasticEdge(stiffness_n=150.0)
    off_centre = PressureRectangle(x_m=0.0, y_m=0.31 * _WIDTH_M, length_x_m=0.004, length_y_m=0.007)
    for part in ("below", "across"):
        yield from _case(
            "elastic, off-centre force",
            part,
            edge=spring,
            load=PointForce(x_m=0.0, y_m=0.3 * _WIDTH_M),
        )
        yield from _case(
            "glass, 0.7 mm, elastic, off-centre rectangle",
            part,
            edge=spring,
            material=GLASS,
            thickness_m=0.0007,
            load=off_centre,
        )
        yield from _case(
            "steel, 0.3 mm, clamped, moment disc",
            part,
            edge=CLAMPED,
            material=STEEL,
            thickness_m=0.0003,
            load=MomentDisc(x_m=0.0, y_m=0.5 * _WIDTH_M, radius_m=0.005),
        )


def best_s(*runs: Callable[[int], object]) -> list[float]:
    """Return the least processor time of each of several runs, taken in turns."""
    least = [float("inf")] * len(runs)
    for number in range(_REPEATS):
        for place, run in enumerate(runs):
            start = time.process_time()
            run(number)
            least[place] = min(least[place], time.process_time() - start)
    return least


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """Processor times of a sweep, of bare exponentials and of one frequency, and its error."""

    sweep_s: float
    bare_s: float
    single_s: float
    solved: int
    error: float
    told: float


def measured(case: Case, repeats: Callable[..., list[float]] = best_s) -> Measured:
    """Return what a case takes, how wrong it is, and how wrong it says that it is."""
    phases = np.linspace(0.1, 30.0, _COUNT * exponentials(RTOL))
    turns = 1j * np.random.default_rng(1).permutation(phases)
    single_hz = case.frequencies_hz[_COUNT // 3 : _COUNT // 3 + 1]
    bare_s, sweep_s, single_s = repeats(
        lambda _: np.exp(turns),
        lambda number: response(case.scene, case.frequencies_hz * (1 - 1e-7 * number), RTOL),
        lambda number: response(case.scene, single_hz * (1 - 1e-7 * number), RTOL),
    )
    found = response(case.scene, case.frequencies_hz, RTOL)
    some_m, told_m = found.displacement_m[_CHECKED], found.error_m[_CHECKED]
    true_m = np.concatenate(
        [
            response(case.scene, [frequency_hz], _EXACT).displacement_m
            for frequency_hz in case.frequencies_hz[_CHECKED]
        ]
    )
    size_m = np.maximum(np.abs(true_m), 1e-3 * np.max(np.abs(true_m), axis=(1, 2), keepdims=True))
    error, told = (float(np.max(e / size_m)) for e in (np.abs(some_m - true_m), told_m))
    return Measured(
        sweep_s=sweep_s,
        bare_s=bare_s,
        single_s=single_s,
        solved=found.work.frequencies_solved,
        error=error,
        told=told,
    )


def row(name: str, found: tuple[Measured, ...]) -> str:
    """Return the row of a sweep, without loss and with."""
    cells = (
        name,
        ", ".join(dict.fromkeys(str(one.solved) for one in found)),
        ", ".join(f"{1e3 * one.sweep_s:.3g}" for one in found),
        ", ".join(f"{one.sweep_s / one.bare_s:.1f}" for one in found),
    )
    return f"| {' | '.join(cells)} |"


_ALIKE: Final = {
    "supported, across": "supported, below",
    "steel, 0.3 mm, clamped, moment disc, below": "clamped, below",
    "steel, 0.3 mm, clamped, moment disc, across": "clamped, across",
    "glass, 0.7 mm, elastic, off-centre rectangle, across": "elastic, off-centre force, across",
}
"""Sweeps that have no row of their own, and those that take as long."""


def _most_alike(found: dict[str, tuple[Measured, ...]]) -> float:
    return max(
        one.sweep_s / other.sweep_s
        for name, shown in _ALIKE.items()
        for one, other in zip(found[name], found[shown], strict=True)
    )


def section() -> str:
    """Measure and return the section of docs/benchmarks.md."""
    found: dict[str, tuple[Measured, ...]] = {}
    for case in cases():
        found[case.name] = (*found.get(case.name, ()), measured(case))
    every = [one for pair in found.values() for one in pair]
    shares = "; ".join(f"{part}: {low:g} to {high:g}" for part, (low, high) in _SHARES.items())
    bare_us, single_s = [1e6 * one.bare_s for one in every], [one.single_s for one in every]
    errors, times = [one.error for one in every], [one.told / one.error for one in every]
    head = (
        f"{_COUNT} frequencies on endless strips 25 mm wide (0.5 mm aluminium and the patch of the "
        f"section above unless told), two receivers, rtol {RTOL:g}; bands in first cut-offs: "
        f"{shares}. Least processor times without loss and with a loss factor of {_LOSSES[-1]:g}, "
        f"in turns with {_COUNT * exponentials(RTOL)} bare exponentials in one `numpy.exp`, which "
        f"took {min(bare_us):.0f} to {max(bare_us):.0f} us; a single frequency took "
        f"{duration(min(single_s))} to {duration(max(single_s))}. Against single frequencies at "
        f"rtol {_EXACT:g} the errors are {min(errors):.1e} to {max(errors):.1e}, and are told as "
        f"{min(times):.2g} to {max(times):.2g} times that."
    )
    titles = ("sweep", "solved", "time, ms", "times the exponentials")
    return "\n".join(
        [
            "## Sweeps",
            "",
            head,
            "",
            f"| {' | '.join(titles)} |",
            "|" + "---|" * len(titles),
            *(row(name, pair) for name, pair in found.items() if name not in _ALIKE),
            "",
            (
                "Five times the exponentials was asked for. More is needed for a load off the "
                "centre line between springs (two symmetries, whose roots are sought at each "
                "node), and above some eleven first cut-offs of a clamped strip. Why loss and a "
                "cut-off cost no more: [decision "
                "8](decisions.md#8-one-frequency-of-a-held-strip-with-free-ends). "
                f"Steel and glass take at most {_most_alike(found):.2f} times as long as "
                "aluminium, and the supported strip across as below."
            ),
            "",
        ]
    )
