"""The data and fitted functions that figures show, of a group or of a participant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.special import ndtr

from analysis.thresholds.band import Line, group_function, person_function
from analysis.thresholds.likeliest import deviance_residuals

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from analysis.results.analysis import Analysis
    from analysis.thresholds.band import Function

    Floats = NDArray[np.float64]

DRAWN = ("ok", "lapse_at_bound")
"""Statuses that determine a whole function: complete separation leaves its slope open."""
OF_BLANKS = ("blanks", "few blanks")
"""Bases of guess rates that come from blank trials."""
BELOW = ("threshold_below_levels", "median_below_levels")
ABOVE = ("threshold_above_levels", "median_above_levels")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """What a panel shows of one condition."""

    level_vpp: Floats
    p: Floats
    threshold_vpp: float  # NaN where there is none
    guess_rate: float  # mean of the rates that blank trials give; NaN without blank trials
    function: Function | None = None
    low: Floats | None = None  # binomial limits of a participant's proportions
    high: Floats | None = None


def conditions_of(analysis: Analysis) -> list[str]:
    """Return the conditions in the order in which they are drawn."""
    return sorted({*analysis.levels["condition"]})


def stimulus(kind: str, side: str) -> str:
    """Name a stimulus.

    >>> stimulus("single", "left"), stimulus("both", "both"), stimulus("blank", "none")
    ('left', 'both', 'blank')
    """
    return side if kind == "single" else kind


def by_threshold(analysis: Analysis) -> list[str]:
    """Return the participants by mean threshold; those without one stand last."""
    table = analysis.thresholds
    at = table["threshold_vpp"].astype(float)
    at = at.mask(table["status"].isin(BELOW), analysis.levels["level_vpp"].min())
    at = at.mask(table["status"].isin(ABOVE), analysis.levels["level_vpp"].max())
    places: Floats = np.asarray(at, dtype=np.float64)
    at = pd.Series(analysis.axis.on_axis(places), index=table["participant"])
    return [*at.groupby(level=0, sort=False).mean().sort_values(kind="stable").index]


def blank_rates(analysis: Analysis) -> pd.DataFrame:
    """Return the thresholds whose guess rate comes from blank trials."""
    return analysis.thresholds[analysis.thresholds["guess_basis"].isin(OF_BLANKS)]


def person_curves(analysis: Analysis, participant: str) -> dict[str, Curve]:
    """Return what a panel shows of a participant, by condition."""
    curves = {}
    for index, (condition, name) in enumerate(analysis.people.names):
        if name != participant:
            continue
        row = _row_of(analysis.thresholds, condition, participant)
        cells = _cells_of(analysis, condition, participant)
        function = None
        if row["status"] in DRAWN:
            line = _line(row, analysis)
            function = person_function(analysis.people, index, line, analysis.axis)
        curves[condition] = Curve(
            level_vpp=_floats(cells, "level_vpp"),
            p=_floats(cells, "p"),
            low=_floats(cells, "low"),
            high=_floats(cells, "high"),
            threshold_vpp=float(row["threshold_vpp"]),
            guess_rate=float(row["guess_rate"]) if row["guess_basis"] in OF_BLANKS else np.nan,
            function=function,
        )
    return {name: curves[name] for name in sorted(curves)}


@lru_cache(maxsize=1)  # the figure and the table of its functions ask in turn
def group_curves(analysis: Analysis) -> dict[str, Curve]:
    """Return what a panel shows of the group, by condition; of one participant, the participant's.

    The data are means at the levels at which everybody was tested: means of the same people.
    """
    curves = {}
    for condition in conditions_of(analysis):
        people = [i for i, (name, _) in enumerate(analysis.people.names) if name == condition]
        if len(people) == 1:
            only = analysis.people.names[people[0]][1]
            curves[condition] = person_curves(analysis, only)[condition]
            continue
        row = analysis.groups[analysis.groups["condition"].eq(condition)].iloc[0]
        cells = shared_levels(analysis, condition)
        rates = blank_rates(analysis)
        function = None
        if row["status"] in (*DRAWN, "separated"):
            function = group_function(analysis.people, people, analysis.axis)
        curves[condition] = Curve(
            level_vpp=_floats(cells, "level_vpp"),
            p=_floats(cells, "p_mean"),
            threshold_vpp=float(row["threshold_vpp"]),
            guess_rate=float(rates.loc[rates["condition"].eq(condition), "guess_rate"].mean()),
            function=function,
        )
    return curves


def function_table(analysis: Analysis) -> pd.DataFrame:
    """Return the functions that the figure of detection shows, with their bands, point by point."""
    names = "condition", "level_vpp", "function", "function_low", "function_high"
    rows = [
        (condition, *point)
        for condition, curve in group_curves(analysis).items()
        if (drawn := curve.function) is not None
        for point in zip(
            drawn.level_vpp, drawn.at(drawn.level_vpp), drawn.low, drawn.high, strict=True
        )
    ]
    return pd.DataFrame(rows, columns=list(names))


def residual_table(analysis: Analysis) -> pd.DataFrame:
    """Return the cells of participants who have a function, with their deviance ``residual``."""
    fitted = analysis.thresholds[analysis.thresholds["status"].isin(DRAWN)]
    cells = analysis.participants.merge(fitted, on=["participant", "condition"])
    level, guess, lapse, mu, sigma, detected, presented = (
        _floats(cells, name)
        for name in (
            "level_vpp",
            "guess_posterior",
            "lapse_rate",
            "threshold_vpp",
            "sigma",
            "detected",
            "presented",
        )
    )
    z = (analysis.axis.on_axis(level) - analysis.axis.on_axis(mu)) / sigma
    expected = guess + (1 - guess - lapse) * ndtr(z * analysis.axis.width(1.0))
    return cells.assign(residual=deviance_residuals(detected, presented, expected))


def shared_levels(analysis: Analysis, condition: str) -> pd.DataFrame:
    """Return the levels that everybody was tested at."""
    levels = analysis.levels[analysis.levels["condition"].eq(condition)]
    people = analysis.participants[analysis.participants["condition"].eq(condition)]
    tested = people.groupby("level_vpp")["participant"].nunique()
    everywhere = tested.index[tested.eq(people["participant"].nunique())]
    return levels[levels["level_vpp"].isin(everywhere)].sort_values("level_vpp")


def _line(row: pd.Series[Any], analysis: Analysis) -> Line:
    """Return the function of a row of thresholds."""
    return Line(
        mu=float(analysis.axis.on_axis(row["threshold_vpp"])),
        sigma=float(row["sigma"]) / analysis.axis.width(1.0),
        lapse_rate=float(row["lapse_rate"]),
        guess_rate=float(row["guess_posterior"]),
    )


def _row_of(table: pd.DataFrame, condition: str, participant: str) -> pd.Series[Any]:
    return table[table["condition"].eq(condition) & table["participant"].eq(participant)].iloc[0]


def _cells_of(analysis: Analysis, condition: str, participant: str) -> pd.DataFrame:
    table = analysis.participants
    rows = table["condition"].eq(condition) & table["participant"].eq(participant)
    return table[rows].sort_values("level_vpp")


def _floats(table: pd.DataFrame, name: str) -> Floats:
    return table[name].to_numpy(dtype=np.float64)
