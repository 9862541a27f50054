"""Run time against error of the plate, beside finite elements of two packages."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from benchmarks.tables import csv_table
from benchmarks.timing import duration, processor_s
from stimuli import (
    ALUMINIUM,
    CLAMPED,
    Burst,
    Fingertip,
    MomentRectangle,
    Scene,
    Strip,
    causal,
    displacement_map,
    fingertip_peaks,
    response,
)
from stimuli.plate.response import ACCURACIES, solve_scene
from stimuli.plate.transient import clear_receptances
from tests.reference.plate_fem import direct, in_modes, modal, model

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from stimuli import Estimate
    from stimuli.arrays import Complex, Real

FIGURE: Final = Path(__file__).parent.parent / "docs" / "benchmarks" / "field.png"
MESHES_M: Final = (6e-3, 4e-3, 3e-3, 2e-3)
FINEST_M: Final = 1e-3
N_MODES: Final = 120
N_FREQUENCIES: Final = 500
REPEATS: Final = 3
STEPS_HZ: Final = 200e3
SPAN_S: Final = 0.02

_WIDTH_M: Final = 0.025
_PLATE: Final = Strip(
    width_m=_WIDTH_M,
    thickness_m=0.0005,
    material=dataclasses.replace(ALUMINIUM, loss_factor=0.01),
    edge=CLAMPED,
    length_m=0.2,
)
_SQUARES: Final = tuple(
    MomentRectangle(x_m=x_m, y_m=_WIDTH_M / 2, length_x_m=0.012, length_y_m=0.012)
    for x_m in (-0.035, 0.035)
)
_CENTRES_M: Final = tuple((square.x_m, square.y_m) for square in _SQUARES)
_BURST: Final = Burst(frequency_hz=500.0, cycles=1, window="none")


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One method at one setting.

    Attributes
    ----------
    problem, method, setting : str
    seconds : float
        Processor time from the scene to the result.
    error : float
        Largest one, beside our finer accuracy, in parts of the largest value.
    told : float
        What we tell of it; NaN of finite elements, which tell none.
    """

    problem: str
    method: str
    setting: str
    seconds: float
    error: float
    told: float = np.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """Something to solve by us, and by finite elements of a size.

    `truth` is our finer accuracy, or finer elements where we have none.
    """

    name: str
    ours: Callable[[], Estimate[Any]]
    elements: Callable[[float], Complex | Real]
    truth: Callable[[], Complex | Real]

    def runs(self, meshes_m: Sequence[float]) -> Iterator[Run]:
        """Yield our run and those of finite elements."""
        estimate, truth = self.ours(), self.truth()
        scale = float(np.abs(truth).max())

        def error(value: Complex | Real) -> float:
            return float(np.abs(value - truth).max()) / scale

        yield Run(
            problem=self.name,
            method="tactstrip",
            setting="default",
            seconds=processor_s(self.ours, REPEATS),
            error=error(estimate.value),
            told=float(estimate.error.max()) / scale,
        )
        for size_m in meshes_m:
            yield Run(
                problem=self.name,
                method="scikit-fem",
                setting=f"{size_m * 1e3:g} mm",
                seconds=processor_s(partial(self.elements, size_m), 1),
                error=error(self.elements(size_m)),
            )


def frequency_response() -> Problem:
    """Return the response to one square at the centres of both, over 500 frequencies."""
    frequencies_hz = np.linspace(4.0, 6000.0, N_FREQUENCIES)
    scene = Scene(strip=_PLATE, loads=_SQUARES[:1], points_m=_CENTRES_M)

    def elements(size_m: float) -> Complex:
        plate = model(_PLATE, _SQUARES[0], _CENTRES_M, size_m)
        return modal(N_MODES, plate, frequencies_hz)[:, np.newaxis]

    return Problem(
        name=f"{N_FREQUENCIES} frequencies",
        ours=partial(response, scene, frequencies_hz),
        elements=elements,
        truth=lambda: solve_scene(scene, frequencies_hz, ACCURACIES[1])[0].value,
    )


def gain_matrix() -> Problem:
    """Return the peak displacements at two fingertips, here points, of one cycle of 500 Hz."""
    fingertips = [Fingertip(x_m=x_m, y_m=y_m, radius_m=0.0) for x_m, y_m in _CENTRES_M]
    viscous_s = causal(_PLATE, _BURST).material.viscous_time_s
    step_s = 1 / STEPS_HZ
    times_s = step_s * np.arange(round(SPAN_S * STEPS_HZ))

    def elements(size_m: float) -> Real:
        samples = _BURST.at(times_s)
        peaks = [
            np.abs(
                in_modes(
                    N_MODES, model(_PLATE, square, _CENTRES_M, size_m), samples, step_s, viscous_s
                )
            ).max(axis=1)
            for square in _SQUARES
        ]
        return np.stack(peaks, axis=1)

    def ours() -> Estimate[Real]:
        clear_receptances()  # a second call would find the first one's modes
        return fingertip_peaks(_PLATE, _SQUARES, fingertips, _BURST)

    return Problem(
        name="gain matrix",
        ours=ours,
        elements=elements,
        truth=partial(elements, FINEST_M),
    )


def field_map() -> Problem:
    """Return the displacement on 101 x 21 points at 500 Hz."""
    x_m, y_m = np.linspace(-0.1, 0.1, 101), np.linspace(0.0, _WIDTH_M, 21)
    points_m = [(x, y) for x in x_m.tolist() for y in y_m.tolist()]

    def elements(size_m: float) -> Complex:
        values = direct(model(_PLATE, _SQUARES[0], points_m, size_m), np.array([500.0]))
        return values.reshape(1, x_m.size, y_m.size)

    def ours() -> Estimate[Complex]:
        return displacement_map(_PLATE, _SQUARES[:1], 500.0, x_m=x_m, y_m=y_m)

    def truth() -> Complex:
        scene = Scene(strip=_PLATE, loads=_SQUARES[:1], points_m=tuple(points_m))
        value = solve_scene(scene, np.array([500.0]), ACCURACIES[1])[0].value
        return value.reshape(1, x_m.size, y_m.size)

    return Problem(name="field map", ours=ours, elements=elements, truth=truth)


_STYLES: Final = (("tactstrip", "#0072B2", "o"), ("scikit-fem", "#D55E00", "s--"))


def _figure(runs: Sequence[Run]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.5, 3.4), layout="constrained")
    names = list(dict.fromkeys(run.problem for run in runs))
    for axes, name in zip(figure.subplots(1, len(names), sharey=True), names, strict=True):
        for method, colour, style in (
            ("tactstrip", "#0072B2", "o"),
            ("scikit-fem", "#D55E00", "s--"),
        ):
            some = [run for run in runs if (run.problem, run.method) == (name, method)]
            seconds, errors = [run.seconds for run in some], [run.error for run in some]
            axes.plot(seconds, errors, style, color=colour, label=method)
        axes.set(xscale="log", yscale="log", title=name, xlabel="processor time (s)")
        axes.grid(visible=True, color="0.9")
    figure.axes[0].set_ylabel("largest error / largest value")
    figure.axes[0].legend(frameon=False)
    figure.savefig(FIGURE, dpi=100)


def speedup(runs: Sequence[Run]) -> float:
    """Return how many times as long finite elements take at our error.

    Between meshes their time is that of a line in logarithms; where none is as exact, the finest.
    """
    ours, others = runs[0], sorted(runs[1:], key=lambda run: run.error)
    log_errors, log_seconds = np.log([(run.error, run.seconds) for run in others]).T
    return float(np.exp(np.interp(np.log(ours.error), log_errors, log_seconds)) / ours.seconds)


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    by_problem = [
        list(problem.runs(MESHES_M))
        for problem in (frequency_response(), gain_matrix(), field_map())
    ]
    runs = [run for some in by_problem for run in some]
    _figure(runs)
    rows: list[dict[str, object]] = [
        {
            "problem": run.problem,
            "method": run.method,
            "setting": run.setting,
            "processor time": duration(run.seconds),
            "error": f"{run.error:.1e}",
            "estimate": "" if np.isnan(run.told) else f"{run.told:.1e}",
        }
        for run in runs
    ]
    gains = ", ".join(f"{speedup(some):.0f} ({some[0].problem})" for some in by_problem)
    return "\n".join(
        [
            "## Plate",
            "",
            "A clamped plate of 200 x 25 x 0.5 mm, loss factor 0.01, two squares of 12 mm at x =",
            f"-35 and 35 mm: {N_FREQUENCIES} frequencies from 4 to 6000 Hz at two points, the",
            "peaks at two points of one cycle of 500 Hz, and the field at 500 Hz on 101 x 21",
            f"points. Finite elements: Bogner, Fox and Schmit; {N_MODES} modes, in the map a",
            "direct solution. Errors are in parts of the largest value, against our finer accuracy",
            f"(the peaks: against elements of {FINEST_M * 1e3:g} mm); processor times go from the",
            "scene to the result.",
            "",
            "![Error against time](field.png)",
            "",
            csv_table("plate", rows),
            "",
            f"At our error finite elements take at least this many times as long: {gains}.",
            "",
        ]
    )
