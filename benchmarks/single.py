"""One frequency at two receivers: processor time and true error, beside bare exponentials."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from benchmarks.sweep import GLASS, RTOL, STEEL, best_s
from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    MomentDisc,
    MomentRectangle,
    Scene,
    Strip,
    response,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from stimuli import IdealEdge, Material

_EXACT: Final = 1e-11
_EXPONENTIALS: Final = 27_000
_PARTS: Final = (0.2, 1.02, 2.6)
"""Frequencies as parts of the first cut-off."""

_LENGTH_M: Final = 0.2
_ACTUATORS: Final[dict[str, tuple[tuple[float, float], ...]]] = {
    "1 disc on the centre line": ((-0.035, 0.5),),
    "1 disc beside it": ((-0.035, 0.3),),
    "2 discs beside it": ((-0.035, 0.3), (0.035, 0.6)),
    "4 rectangles, 3 beside it": ((-0.06, 0.3), (-0.02, 0.42), (0.02, 0.65), (0.06, 0.5)),
}
"""Places in metres along the strip and in widths across it."""
_BETWEEN: Final = "2 discs beside it"
"""What has no column: it takes a time between those of one disc and of four rectangles."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A plate with its actuators and two receivers, at frequencies below, near, above cut-off."""

    plate: str
    actuators: str
    scene: Scene


def _plates() -> Iterator[tuple[str, Strip]]:
    spring = ElasticEdge(stiffness_n=150.0)
    edges: tuple[tuple[str, IdealEdge | ElasticEdge, Material, float, float, float], ...] = (
        ("simply supported", SIMPLY_SUPPORTED, ALUMINIUM, 25e-3, 5e-4, 0.01),
        ("clamped", CLAMPED, ALUMINIUM, 25e-3, 5e-4, 0.01),
        ("spring", spring, ALUMINIUM, 25e-3, 5e-4, 0.01),
        ("steel 30 x 0.3 mm, clamped", CLAMPED, STEEL, 30e-3, 3e-4, 0.005),
        ("glass 22 x 0.7 mm, spring", spring, GLASS, 22e-3, 7e-4, 0.02),
    )
    for name, edge, material, width_m, thickness_m, loss in edges:
        for length_m in (None, _LENGTH_M):
            yield (
                f"{name}, {'endless' if length_m is None else f'{length_m * 1e3:g} mm'}",
                Strip(
                    width_m=width_m,
                    thickness_m=thickness_m,
                    material=dataclasses.replace(material, loss_factor=loss),
                    edge=edge,
                    length_m=length_m,
                ),
            )


def cases() -> Iterator[Case]:
    """Yield plates that end and that do not, with actuators on and beside the centre line."""
    for plate, strip in _plates():
        width_m = strip.width_m
        for actuators, places in _ACTUATORS.items():
            kind: Callable[..., Any] = MomentDisc
            size = {"radius_m": 0.2 * width_m}
            if "rectangles" in actuators:
                kind, size = MomentRectangle, {"length_x_m": 0.005, "length_y_m": 0.4 * width_m}
            first_m, last = places[0][0], places[-1][1]
            yield Case(
                plate=plate,
                actuators=actuators,
                scene=Scene(
                    strip=strip,
                    loads=tuple(kind(x_m=x_m, y_m=y * width_m, **size) for x_m, y in places),
                    points_m=(
                        (first_m, places[0][1] * width_m),
                        (first_m + 0.07, last * width_m),
                    ),
                ),
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """Processor times of each frequency and of bare exponentials, and the greatest errors."""

    seconds: tuple[float, ...]
    bare_s: float
    error: float
    told: float


def measured(case: Case, repeats: Callable[..., list[float]] = best_s) -> Measured:
    """Return what a case takes, how wrong it is, and how wrong it says that it is."""
    asked_hz = [part * case.scene.strip.cutoff_hz() for part in _PARTS]
    turns = 1j * np.random.default_rng(1).permutation(np.linspace(0.1, 30.0, _EXPONENTIALS))

    def at(frequency_hz: float) -> Callable[[int], object]:
        def run(number: int) -> object:
            fresh = dataclasses.replace(case.scene)
            return response(fresh, [frequency_hz * (1 - 1e-6 * number)], RTOL)

        return run

    bare_s, *seconds = repeats(lambda _: np.exp(turns), *map(at, asked_hz))
    error = told = 0.0
    for frequency_hz in asked_hz:
        found = response(case.scene, [frequency_hz], RTOL)
        true_m = response(case.scene, [frequency_hz], _EXACT).displacement_m
        size_m = np.maximum(np.abs(true_m), 1e-3 * np.max(np.abs(true_m)))
        error = max(error, float(np.max(np.abs(found.displacement_m - true_m) / size_m)))
        told = max(told, float(np.max(found.error_m / size_m)))
    return Measured(seconds=tuple(seconds), bare_s=bare_s, error=error, told=told)


_ALIKE: Final = {
    "steel 30 x 0.3 mm, clamped, endless": "clamped, endless",
    "glass 22 x 0.7 mm, spring, endless": "spring, endless",
    "glass 22 x 0.7 mm, spring, 200 mm": "spring, 200 mm",
}
"""Plates that have no row of their own, and those of aluminium that take as long."""


def _most_alike(found: dict[str, list[Measured]]) -> float:
    return max(
        one_s / other_s
        for name, shown in _ALIKE.items()
        for one, other in zip(found[name], found[shown], strict=True)
        for one_s, other_s in zip(one.seconds, other.seconds, strict=True)
    )


def section() -> str:
    """Measure and return the section of docs/benchmarks.md."""
    found: dict[str, list[Measured]] = {}
    for case in cases():
        found.setdefault(case.plate, []).append(measured(case))
    every = [one for row in found.values() for one in row]
    bare_us = [1e6 * one.bare_s for one in every]
    errors, times = [one.error for one in every], [one.told / one.error for one in every]
    *first, last = (f"{part:g}" for part in _PARTS)
    shown = [i for i, actuators in enumerate(_ACTUATORS) if actuators != _BETWEEN]
    titles = ("plate", *(tuple(_ACTUATORS)[i] for i in shown))
    rows = (
        (plate, *(", ".join(f"{1e3 * s:.3g}" for s in some[i].seconds) for i in shown))
        for plate, some in found.items()
        if plate not in _ALIKE
    )
    return "\n".join(
        [
            "## One frequency",
            "",
            (
                "A frequency not asked before, a new scene, two receivers, rtol "
                f"{RTOL:g}. Least processor times in ms at {', '.join(first)} and {last} first "
                f"cut-offs; {_EXPONENTIALS} bare exponentials in one `numpy.exp` took "
                f" {min(bare_us):.0f} to {max(bare_us):.0f} us. Against rtol "
                f"{_EXACT:g} the errors are {min(errors):.1e} to {max(errors):.1e}, and are told "
                f"as {min(times):.2g} to {max(times):.2g} times that, "
                f"{max(one.told for one in every):.1e} at most."
            ),
            "",
            f"| {' | '.join(titles)} |",
            "|" + "---|" * len(titles),
            *(f"| {' | '.join(cells)} |" for cells in rows),
            "",
            (
                "1.5 ms was asked for. Why loads beside the centre line take longer, more of them "
                "add little, and held edges with free ends take longer: [decision "
                "8](decisions.md#8-one-frequency-of-a-held-strip-with-free-ends). "
                f"Endless steel and glass take at most {_most_alike(found):.2f} times as long as "
                "aluminium."
            ),
            "",
        ]
    )
