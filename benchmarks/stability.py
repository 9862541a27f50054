"""Errors against forty digits where a field is hard to compute: cut-offs, edges, limits, losses."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from benchmarks.hard_cases import sweeps
from benchmarks.tables import csv_table
from stimuli import Scene, response
from stimuli.errors import PlateError
from tests.reference.exact import exact

if TYPE_CHECKING:
    from collections.abc import Iterator

    from benchmarks.hard_cases import Case, Sweep

STEP: Final = 3
"""Every so many cases are taken: forty digits take seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Error:
    """The error of one value in parts of the largest displacement near the load.

    Attributes
    ----------
    true, told : float
        NaN where the frequency is refused.
    """

    true: float
    told: float


def measured(case: Case) -> Error:
    """Return the error of one case; a warning, an overflow or a NaN raises."""
    centre_m = (case.load.x_m, case.load.y_m)
    scene = Scene(strip=case.strip, loads=(case.load,), points_m=(case.place_m, centre_m))
    with warnings.catch_warnings(), np.errstate(over="raise", divide="raise", invalid="raise"):
        warnings.simplefilter("error")
        try:
            found = response(scene, [case.frequency_hz])
        except PlateError:
            return Error(true=np.nan, told=np.nan)
    if not (np.isfinite(found.value).all() and np.isfinite(found.error).all()):
        raise ArithmeticError(f"{case} gives {found}")
    truth = complex(exact(case.strip, case.load, *case.place_m, case.frequency_hz))
    largest = float(np.abs(found.value).max())
    value, told = complex(found.value[0, 0, 0]), float(found.error[0, 0, 0])
    return Error(true=abs(value - truth) / largest, told=told / largest)


def rows() -> Iterator[dict[str, object]]:
    """Yield one row for each sweep."""
    for sweep in sweeps():
        yield _row(sweep, [measured(case) for case in sweep.cases[::STEP]])


def _row(sweep: Sweep, errors: list[Error]) -> dict[str, object]:
    true, told = (np.array([getattr(error, name) for error in errors]) for name in ("true", "told"))
    is_known = np.isfinite(true)
    return {
        "sweep": sweep.name,
        "from": sweep.cases[0].label,
        "to": sweep.cases[-1].label,
        "values": len(errors),
        "refused": int((~is_known).sum()),
        "median error": f"{np.median(true[is_known]):.1e}",
        "largest error": f"{true[is_known].max():.1e}",
        "largest error / estimate": f"{(true / told)[is_known].max():.2g}",
    }


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    return "\n".join(
        [
            "## Stability",
            "",
            "Errors of one displacement against 62 digits and more (`tests/reference/exact.py`),",
            "in parts of the displacement at the load's centre; warnings, overflows and NaN are",
            "errors.",
            "By default: the paper's plate without loss, a point force at y = 0.4 W, the field at",
            "(10 mm, 0.6 W). At a cut-off the answer is refused.",
            "",
            csv_table("stability", list(rows())),
            "",
        ]
    )
