"""Errors against forty digits where a field is hard to compute: cut-offs, edges, limits, losses."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import mpmath
import numpy as np

from benchmarks.hard_cases import FORCE, PLACE, Case, Sweep, strip_on, sweeps
from stimuli import CLAMPED, Scene, response
from tests.reference.exact import exact

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RTOLS: Final = (1e-6, 1e-10)
FIGURE: Final = Path(__file__).parent.parent / "docs" / "stability.png"
_ROUNDING: Final = 2.0**-53
_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """True and estimated relative error of a case, for each of RTOLS."""

    case: Case
    errors: tuple[float, ...]
    estimates: tuple[float, ...]


def measured(case: Case) -> Measured:
    """Return the errors of one case; a warning, an overflow or a NaN is an error.

    Raises
    ------
    ArithmeticError
        If the field is not finite.
    """
    truth = exact(case.strip, case.load, *case.place_m, case.frequency_hz)
    scene = Scene(strip=case.strip, loads=(case.load,), points_m=(case.place_m,))
    errors, estimates = [], []
    for rtol in RTOLS:
        with warnings.catch_warnings(), np.errstate(over="raise", divide="raise", invalid="raise"):
            warnings.simplefilter("error")
            found = response(scene, [case.frequency_hz], rtol)
        value, estimate = complex(found.displacement_m[0, 0, 0]), float(found.error_m[0, 0, 0])
        if not (np.isfinite(value) and np.isfinite(estimate)):
            raise ArithmeticError(f"{case} gives {value} with an error of {estimate}")
        size = max(abs(truth), mpmath.mpf(np.finfo(np.float64).tiny))
        errors.append(float(abs(value - truth) / size))
        estimates.append(float(estimate / size))
    return Measured(case=case, errors=tuple(errors), estimates=tuple(estimates))


def _input_error(sweep: Sweep, case: Case) -> float:
    """Return what rounding f to a double makes of the field at a cut-off: half of it over d."""
    return _ROUNDING / (2 * case.abscissa) if sweep.name == "Cut-off" else 0.0


def _summary(sweep: Sweep, found: list[Measured]) -> str:
    ratios = [
        estimate / error
        for m in found
        for error, estimate in zip(m.errors, m.estimates, strict=True)
        if error > 0
    ]
    largest = [max(m.errors[i] for m in found) for i in range(len(RTOLS))]
    first, last = sweep.cases[0].label, sweep.cases[-1].label
    return (
        f"| {sweep.name} | {first} to {last} | "
        + " | ".join(f"{error:.1e}" for error in largest)
        + f" | {min(ratios):.2g}, {np.median(ratios):.2g}, {max(ratios):.2g} |"
    )


def _figure(results: list[tuple[Sweep, list[Measured]]]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 8.4), layout="constrained")
    panels = figure.subplots(-(-len(results) // 3), 3).flatten()
    for axes, (sweep, found) in zip(panels, results, strict=False):
        _panel(axes, sweep, found)
    for axes in panels[len(results) :]:
        axes.set_axis_off()
    figure.suptitle(
        f"Relative error at rtol = {RTOLS[-1]:g}: true (filled) and estimated (line, open)"
    )
    figure.savefig(FIGURE, dpi=90)


def _panel(axes: Axes, sweep: Sweep, found: list[Measured]) -> None:
    positive = [m.case.abscissa for m in found if m.case.abscissa > 0]
    at_zero = min(positive) / 100
    curves = list(dict.fromkeys(m.case.curve for m in found))
    for curve, colour, marker in zip(curves, _COLOURS, "osD^", strict=False):
        some = [m for m in found if m.case.curve == curve]
        x = [m.case.abscissa or at_zero for m in some]
        floor = 1e-17
        true = [max(m.errors[-1], floor) for m in some]
        axes.plot(
            x, [max(m.estimates[-1], floor) for m in some], "-", color=colour, lw=1, alpha=0.7
        )
        axes.plot(
            x, [max(m.estimates[-1], floor) for m in some], marker, color=colour, mfc="white", ms=4
        )
        axes.plot(x, true, marker, color=colour, ms=5, label=curve)
    if sweep.name == "Cut-off":
        own = sorted({(m.case.abscissa, _input_error(sweep, m.case)) for m in found})
        axes.plot(*zip(*own, strict=True), "k:", label="f rounded to a double")
    axes.axhline(RTOLS[-1], color="0.6", lw=0.8)
    if len(positive) < len(found):
        axes.axvline(at_zero, color="0.85", lw=6, zorder=0)
        axes.text(at_zero, 2e-17, " 0", color="0.4")
    axes.set(yscale="log", ylim=(1e-17, 1e-3), title=sweep.name, xlabel=sweep.axis)
    axes.set(xscale="linear" if sweep.name == "Patch" else "log", ylabel="relative error")
    axes.grid(visible=True, color="0.92")
    axes.legend(fontsize=7, loc="upper right")


def _refusal() -> str:
    """Return whether a frequency is refused where a field without loss is infinite."""
    strip = strip_on(CLAMPED)
    scene = Scene(strip=strip, loads=(FORCE,), points_m=(PLACE,))
    try:
        response(scene, [strip.cutoff_hz()])
    except ValueError:
        return "refused"
    return "NOT REFUSED"


def section() -> str:
    """Measure and return the section of docs/benchmarks.md."""
    results = [(sweep, [measured(case) for case in sweep.cases]) for sweep in sweeps()]
    _figure(results)
    sizes = [len(found) for _, found in results]
    return "\n".join(
        [
            "## Stability",
            "",
            (
                "Relative error of one displacement against 62 digits and more "
                "(`tests/reference/exact.py`); a warning, overflow or NaN is an error. Unless "
                "told: the paper's plate, point force at y = 0.4 W, field at (10 mm, 0.6 W), no "
                "loss. A field below the least normal number counts as 0. Each sweep has "
                f"{min(sizes)} to {max(sizes)} values."
            ),
            "",
            (
                "| sweep | range | "
                + " | ".join(f"largest error, rtol {rtol:g}" for rtol in RTOLS)
                + " | estimate / error: least, median, greatest |"
            ),
            "|---|---|---|---|---|",
            *(_summary(sweep, found) for sweep, found in results),
            "",
            (
                "Beside a cut-off, at a detuning d, a frequency rounded to a double leaves the "
                "field uncertain by "
                f"{_ROUNDING:.1e}/(2 d) (dotted in the figure). [The solver's own "
                "error](accuracy.md#the-field-of-an-endless-strip) stays some hundred times below "
                "that where long doubles have 64 bits, but above a rtol of "
                "1e-10 from d = 1e-10 on, as the estimate says. Without loss a cut-off itself is "
                f"{_refusal()}."
            ),
            "",
            "![Relative errors](stability.png)",
            "",
        ]
    )
