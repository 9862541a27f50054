"""Run time against error of the field, beside finite elements and bare exponentials."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from benchmarks import plates
from benchmarks.timing import duration, median_s
from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    MomentRectangle,
    Scene,
    Strip,
    displacement,
)
from tests.reference.plate_fem import MODES, direct, modal, model

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from stimuli import IdealEdge
    from stimuli.arrays import Complex, Real
    from tests.reference.plate_fem import Model

    _Method = Callable[[Model, Real], Complex]

FIGURE: Final = Path(__file__).parent.parent / "docs" / "field.png"
RTOLS: Final = tuple(10.0**-n for n in range(2, 13))
MESHES_M: Final = (6e-3, 4e-3, 3e-3, 2e-3)
_EXACT: Final = f"rtol {RTOLS[-1]:.0e}"
COUNTS: Final = (1, 500)
_BAND_HZ: Final = (4.0, 1500.0)
_REPEATS: Final = 7
_DIRECT: Final = 5
"""Frequencies at which the direct finite elements are solved; 500 take 100 times as long."""

_WIDTH_M: Final = 0.025
PATCH: Final = MomentRectangle(x_m=0.0, y_m=_WIDTH_M / 2, length_x_m=0.005, length_y_m=0.015)
_POINTS_M: Final = ((0.0, _WIDTH_M / 2), (0.02, 0.0075))
_PLATE: Final = Strip(
    width_m=_WIDTH_M,
    thickness_m=0.0005,
    material=dataclasses.replace(ALUMINIUM, loss_factor=0.01),
    edge=SIMPLY_SUPPORTED,
    length_m=0.2,
)
_EDGES: Final = ((SIMPLY_SUPPORTED, "supported"), (CLAMPED, "clamped"))
_KNOWN_M: Final = {
    # At 500 Hz: two independent methods, 10 to 12 digits
    "supported": (
        -2.3061331585288091e-05 - 2.3781071148572299e-07j,
        -1.9807964221232675e-06 - 2.2596465628158454e-08j,
    ),
    "clamped": (
        -1.2992007832579903e-05 - 1.3071655531382476e-07j,
        2.9940554851240411e-07 + 2.9637063653468444e-09j,
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One method at one setting."""

    method: str
    setting: str
    seconds: float
    error: float
    prepared_s: float = 0.0


def scene(edge: IdealEdge) -> Scene:
    """Return the plate with one patch and two receivers."""
    strip = dataclasses.replace(_PLATE, edge=edge)
    return Scene(strip=strip, loads=(PATCH,), points_m=_POINTS_M)


def frequencies(count: int, repeat: int = 0) -> Real:
    """Return frequencies that no other repeat asks; one is near 500 Hz."""
    fresh = 1 - 1e-5 * repeat
    return np.array([500.0 * fresh]) if count == 1 else np.linspace(*_BAND_HZ, count) * fresh


def error_of(value: Complex, true: Complex) -> float:
    """Return the largest relative error over all frequencies and receivers."""
    return float(np.max(np.abs(value / true - 1)))


def ours(edge: IdealEdge, count: int) -> Iterator[Run]:
    """Yield our runs, from the coarsest to the most exact one."""
    place = scene(edge)
    true = displacement(place, frequencies(count), RTOLS[-1])

    def run(rtol: float) -> Run:
        return Run(
            method="ours",
            setting=f"rtol {rtol:.0e}",
            seconds=median_s(lambda n: displacement(place, frequencies(count, n), rtol), _REPEATS),
            error=error_of(displacement(place, frequencies(count), rtol), true),
        )

    yield from map(run, RTOLS)


def finite_elements(edge: IdealEdge, meshes_m: tuple[float, ...]) -> Iterator[tuple[int, Run]]:
    """Yield finite-element runs; the time holds assembly, factors, modes and frequencies."""
    place = scene(edge)
    for size_m in meshes_m:
        assembly = partial(model, place.strip, PATCH, _POINTS_M, size_m)
        plate = assembly()
        prepared_s = median_s(_once(assembly), 2)
        for count in COUNTS:
            asked = frequencies(count)
            true = displacement(place, asked, RTOLS[-1])[:, 0]
            some = np.unique(np.linspace(0, count - 1, _DIRECT).astype(int))
            methods: tuple[tuple[str, _Method, NDArray[np.int_]], ...] = (
                ("direct", direct, some),
                *((f"{n} modes", partial(modal, n), np.arange(count)) for n in MODES),
            )
            for name, method, rows in methods:
                solution = partial(method, plate, asked[rows])
                seconds = median_s(_once(solution), 2)
                run = Run(
                    method=f"finite elements, {name}",
                    setting=f"{size_m * 1e3:g} mm",
                    seconds=prepared_s + seconds * count / rows.size,
                    error=error_of(solution(), true[rows]),
                    prepared_s=prepared_s,
                )
                yield count, run


def _once(run: Callable[[], object]) -> Callable[[int], object]:
    return lambda _: run()


def exponentials(rtol: float) -> int:
    """Return how many exponentials the series on simple supports needs for each frequency.

    Both branches, at each receiver all odd n until exp(-n pi d / W) falls to rtol; d is the
    distance along the strip between receiver and nearest end of the patch.
    """
    half = PATCH.half_size_m[0]
    ways = [abs(abs(x) - half) / _WIDTH_M for x, _ in _POINTS_M]
    return 2 * sum(math.ceil((math.log(1 / rtol) / (math.pi * way) + 1) / 2) for way in ways)


def _bare_s(count: int, rtol: float) -> float:
    """Return the time of so many exponentials of so many frequencies in one call."""
    each = exponentials(rtol)
    decay = np.linspace(0.1, 30, each) * (1 + 0.01j)

    def arguments(repeat: int) -> Complex:
        return np.asarray(-decay * (1 + 1e-4 * frequencies(count, repeat)[:, np.newaxis]))

    ready = [arguments(repeat) for repeat in range(4 * _REPEATS + 1)]
    return median_s(lambda repeat: np.exp(ready[repeat]), 4 * _REPEATS)


def _proof() -> Iterator[str]:
    for edge, name in _EDGES:
        found = displacement(scene(edge), [500.0], RTOLS[-1])[0, 0]
        errors = " and ".join(
            f"{abs(u / known - 1):.1e}" for u, known in zip(found, _KNOWN_M[name], strict=True)
        )
        yield f"{errors} ({name})"


def _ratios(name: str, count: int, runs: list[Run]) -> str:
    at_six = next(run for run in runs if run.setting == "rtol 1e-06")
    rivals = [run for run in runs if run.method != "ours" and run.error <= 1e-3]
    bare = at_six.seconds / _bare_s(count, 1e-6)
    row = f"| {name} | {count} | {duration(at_six.seconds)} | {bare:.3g} | "
    if rivals:
        best = min(rivals, key=lambda run: run.seconds)
        solved_s = min(run.seconds - run.prepared_s for run in rivals)
        row += (
            f"{duration(best.seconds)} ({best.method.split(', ')[1]}, {best.setting}) | "
            f"{best.seconds / at_six.seconds:.3g} | {solved_s / at_six.seconds:.3g} | "
        )
    else:
        row += "none | | | "
    return row.rstrip()


def _figure(results: list[tuple[str, int, list[Run]]]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 7), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True).flatten()
    for axes, (name, count, runs) in zip(panels, results, strict=True):
        styles = (
            ("ours", "#0072B2", "o-"),
            ("direct", "#D55E00", "s--"),
            ("modes", "#009E73", "^:"),
        )
        for key, colour, style in styles:
            some = [run for run in runs if run.method.endswith(key) and run.setting != _EXACT]
            label = "this library" if key == "ours" else some[0].method
            times, errors = [run.seconds for run in some], [run.error for run in some]
            axes.plot(times, errors, style, color=colour, label=label)
        asked = "1 frequency" if count == 1 else f"{count} frequencies"
        axes.set(xscale="log", yscale="log", title=f"{name}, {asked}")
        axes.set(xlabel="time (s)", ylabel="largest relative error")
        axes.grid(visible=True, color="0.9")
        axes.axhline(1e-3, color="0.6", lw=0.8)
        if axes is panels[0]:
            axes.legend(fontsize=8)
    figure.savefig(FIGURE, dpi=100)


def _growth(counts: tuple[int, ...], run: Callable[[int, int], object]) -> tuple[str, str, str]:
    """Return the times of the first and last count, and the exponent fitted to the upper half."""
    times = [median_s(partial(run, n), 3) for n in counts]
    upper = slice(min(len(counts) // 2, len(counts) - 2), None)
    slope = np.polyfit(np.log(counts[upper]), np.log(times[upper]), 1)[0]
    return duration(times[0]), duration(times[-1]), f"{slope:.2f}"


def growth(most: int = 5000) -> Iterator[str]:
    """Yield how the time grows with points, loads, and frequencies below cut-off."""
    strip = dataclasses.replace(_PLATE, edge=CLAMPED, length_m=None)
    generator = np.random.default_rng(1)
    x, y = generator.uniform(-0.08, 0.08, 1000), generator.uniform(0.001, 0.024, 1000)
    points = tuple(zip(x.tolist(), y.tolist(), strict=True))
    patches = tuple(
        dataclasses.replace(PATCH, x_m=float(at_m)) for at_m in generator.uniform(-0.05, 0.05, 16)
    )

    def at_points(n: int, repeat: int) -> object:
        asked = Scene(strip=strip, loads=(PATCH,), points_m=points[:n])
        return displacement(asked, frequencies(1, repeat))

    def with_loads(n: int, repeat: int) -> object:
        asked = Scene(strip=strip, loads=patches[:n], points_m=points[:50])
        return displacement(asked, frequencies(1, repeat))

    def over(n: int, repeat: int) -> object:
        asked = Scene(strip=strip, loads=(PATCH,), points_m=_POINTS_M)
        return displacement(asked, np.linspace(100.0, 1500.0 - repeat, n))

    for name, counts, run in (
        ("1 point", (1, 10, 100, 200, 500, 1000), at_points),
        ("1 load at 50 points", (1, 2, 4, 8, 16), with_loads),
        ("1 frequency below cut-off", (1, 10, 50, 500, 5000), over),
    ):
        some = tuple(n for n in counts if n <= most)
        first, last, slope = _growth(some, run)
        yield f"from {first} for {name} to {last} for {some[-1]} ({slope})"


def section() -> str:
    """Measure and return the section of docs/benchmarks.md."""
    results = []
    for edge, name in _EDGES:
        rivals = list(finite_elements(edge, MESHES_M))
        for count in COUNTS:
            others = [run for asked, run in rivals if asked == count]
            results.append((name, count, [*ours(edge, count), *others]))
    _figure(results)
    return "\n".join(
        [
            "## Field",
            "",
            (
                "A plate of 200 x 25 x 0.5 mm, free short ends, loss factor 0.01, a moment patch "
                "of 5 x 15 mm in its middle, two receivers; 500 Hz, or 500 frequencies from "
                f"{_BAND_HZ[0]:g} to {_BAND_HZ[1]:g} Hz. Errors are the largest relative to each "
                "value, against our own at rtol "
                f"{RTOLS[-1]:g}, which at 500 Hz differs from independently computed values by "
                f"{', '.join(_proof())}. Times are medians from the scene to the result. Finite "
                "elements: scikit-fem, Bogner-Fox-Schmit rectangles, solved at each frequency "
                f"(timed at {_DIRECT} of the 500) or by {' or '.join(map(str, MODES))} modes with "
                "the static rest."
            ),
            "",
            "![Error against time](field.png)",
            "",
            (
                "| edges | frequencies | ours at 1e-6 | in bare exponentials | best finite-element "
                "run within 1e-3 | times ours | the same, assembly given |"
            ),
            "|---|---|---|---|---|---|---|",
            *(_ratios(*result) for result in results),
            "",
            (
                "Bare exponentials are those of the series on simple supports at 1e-6, "
                f"{exponentials(1e-6)} a frequency, in one `numpy.exp`."
            ),
            "",
            *plates.table(),
            (
                "How the time grows (endless, clamped, rtol 1e-6; in brackets the exponent of the "
                f"upper half): {', '.join(growth())}."
            ),
            "",
        ]
    )
