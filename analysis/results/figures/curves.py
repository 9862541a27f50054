"""What a panel of functions shows of a group or a person: data, function, threshold, residuals."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from analysis.definitions import LIMITS
from analysis.groups.functions import Line, group_function, person_function
from analysis.results.figures.composed import (
    ABOVE,
    BELOW,
    LOOKS,
    Curve,
    Mark,
    Residuals,
)
from analysis.results.methods.task import is_yes_no
from analysis.thresholds.goodness import deviance_residuals

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from analysis.results.tables import Analysis

    Floats = NDArray[np.float64]


DRAWN = ("ok", "lapse_at_bound")
"""Statuses of tables that tell a whole function; where it rises in one step, its slope is open."""
OF_BLANKS = ("blanks", "few blanks")
"""Bases of guess rates that blank trials tell."""


def conditions_of(analysis: Analysis) -> list[str]:
    """Return the conditions in the order in which they are drawn."""
    return sorted({*analysis.levels["condition"]})


def look_of(analysis: Analysis, condition: str) -> tuple[str, str, Any]:
    """Return colour, marker and line of a condition, in every figure the same."""
    return LOOKS[conditions_of(analysis).index(condition) % len(LOOKS)]


def person_curves(analysis: Analysis, participant: str) -> dict[str, Curve]:
    """Return what a panel shows of a person in each condition they took part in."""
    rows = {
        condition: i
        for i, (condition, name) in enumerate(analysis.people.names)
        if name == participant
    }
    told = analysis.thresholds[analysis.thresholds["participant"].eq(participant)]
    data = analysis.participants[analysis.participants["participant"].eq(participant)]
    curves = {}
    for condition in (one for one in conditions_of(analysis) if one in rows):
        row = told[told["condition"].eq(condition)].iloc[0]
        cells = data[data["condition"].eq(condition)].sort_values("level_vpp")
        levels_vpp, p, low, high, detected, presented = (
            cells[name].to_numpy(dtype=np.float64)
            for name in ("level_vpp", "p", "low", "high", "detected", "presented")
        )
        function = residuals = None
        if row["status"] in DRAWN:
            line = Line(
                mu=float(analysis.axis.on_axis(row["threshold_vpp"])),
                sigma=float(row["sigma"]) / analysis.axis.width(1.0),
                lapse_rate=float(row["lapse_rate"]),
                guess_rate=float(row["guess_posterior"]),
            )
            function = person_function(analysis.people, rows[condition], line, analysis.axis)
            value = deviance_residuals(detected, presented, function.at(levels_vpp))
            residuals = Residuals(level_vpp=levels_vpp, value=value)
        curves[condition] = Curve(
            look=look_of(analysis, condition),
            level_vpp=levels_vpp,
            p=p,
            low=low,
            high=high,
            size=_sizes(presented),
            mark=_mark(row),
            start=start_of(analysis, rows[condition]),
            function=function,
            residuals=residuals,
        )
    return curves


def start_of(analysis: Analysis, person: int) -> tuple[float, float, float] | None:
    """Return the guess rate as it was counted, and its 95 % interval; none without blank trials.

    The interval is that of the Beta distribution in the fit, docs/statistics.md, section 8.
    """
    guess = analysis.people.guesses[person]
    if guess.basis not in OF_BLANKS or guess.rate.beta is None:
        return None
    from scipy.special import betaincinv

    low, high = betaincinv(*guess.rate.beta, LIMITS)
    rate = (guess.rate.beta[0] - 0.5) / (sum(guess.rate.beta) - 1)  # of Beta(a + 1/2, b - a + 1/2)
    return rate, min(float(low), rate), max(float(high), rate)


def _mean_start(analysis: Analysis, people: list[int]) -> tuple[float, float, float] | None:
    """Return the mean of the guess rates, without limits; none if blank trials tell not all."""
    each = [start_of(analysis, person) for person in people]
    told = [start[0] for start in each if start is not None]
    return (float(np.mean(told)), np.nan, np.nan) if told and len(told) == len(each) else None


@lru_cache(maxsize=1)  # the figure, its caption and the table of its functions ask in turn
def group_curves(analysis: Analysis) -> dict[str, Curve]:
    """Return what a panel shows of the group in each condition; of one person, the person's.

    The data are the means of the participants at the levels that everybody was tested at.
    """
    curves = {}
    for condition in conditions_of(analysis):
        row = analysis.groups[analysis.groups["condition"].eq(condition)].iloc[0]
        people = [i for i, (name, _) in enumerate(analysis.people.names) if name == condition]
        if len(people) == 1:
            only = analysis.people.names[people[0]][1]
            curves[condition] = person_curves(analysis, only)[condition]
            if len({name for _, name in analysis.people.names}) > 1:
                curves[condition] = _of_means(curves[condition])  # others there are of means
            continue
        cells = shared_levels(analysis, condition)
        levels_vpp, p, low, high, presented = (
            cells[name].to_numpy(dtype=np.float64)
            for name in ("level_vpp", "p_mean", "group_low", "group_high", "presented")
        )
        function = None
        if row["status"] in (*DRAWN, "separated"):
            function = group_function(analysis.people, people, analysis.axis)
        curves[condition] = _of_means(
            Curve(
                look=look_of(analysis, condition),
                level_vpp=levels_vpp,
                p=p,
                low=low,
                high=high,
                size=_sizes(presented),
                mark=_mark(row),
                start=_mean_start(analysis, people),
                function=function,
            )
        )
    return curves


def function_table(analysis: Analysis) -> pd.DataFrame:
    """Return the functions that the figure of detection shows, with their bands, point by point."""
    names = "condition", "level_vpp", "function", "function_low", "function_high"
    rows = [
        (condition, *point)
        for condition, curve in group_curves(analysis).items()
        if (one := curve.function) is not None
        for point in zip(one.level_vpp, one.at(one.level_vpp), one.low, one.high, strict=True)
    ]
    return pd.DataFrame(rows, columns=list(names))


def _of_means(curve: Curve) -> Curve:
    """Return a curve with the residuals of means: data less function, with the data's limits."""
    if curve.function is None:
        return curve
    at = curve.function.at(curve.level_vpp)
    residuals = Residuals(
        level_vpp=curve.level_vpp, value=curve.p - at, low=curve.low - at, high=curve.high - at
    )
    return replace(curve, residuals=residuals)


def shared_levels(analysis: Analysis, condition: str) -> pd.DataFrame:
    """Return the levels that everybody was tested at: only these means are of the same people."""
    levels = analysis.levels[analysis.levels["condition"].eq(condition)]
    people = analysis.participants[analysis.participants["condition"].eq(condition)]
    tested = people.groupby("level_vpp")["participant"].nunique()
    everywhere = tested.index[tested.eq(people["participant"].nunique())]
    return levels[levels["level_vpp"].isin(everywhere)].sort_values("level_vpp")


def _sizes(presented: Floats) -> Floats:
    """Return the size of a marker, whose area is as the number of stimuli."""
    return np.asarray(np.sqrt(presented / presented.max())) if presented.size else presented


def _mark(row: pd.Series[Any]) -> Mark:
    at, low, high, new_low, new_high = (
        float(row.get(name, np.nan))
        for name in (
            "threshold_vpp",
            "threshold_low_vpp",
            "threshold_high_vpp",
            "new_low_vpp",
            "new_high_vpp",
        )
    )
    status = str(row["status"])
    if status in (*BELOW, *ABOVE) or np.isfinite(at):  # what a table calls n/a is an open limit
        low, high = (-np.inf if np.isnan(low) else low), (np.inf if np.isnan(high) else high)
    new = None
    if "new_low_vpp" in row.index and np.isfinite(at):
        new = (
            -np.inf if np.isnan(new_low) else new_low,
            np.inf if np.isnan(new_high) else new_high,
        )
    return Mark(at=at, low=low, high=high, status=status, new=new)


def blanks_tell(analysis: Analysis) -> bool:
    """Tell whether some guess rate is of blank trials."""
    return bool(analysis.thresholds["guess_basis"].isin(OF_BLANKS).any())


def start_label(analysis: Analysis, *, of_mean: bool = False) -> str:
    """Return what the key of a figure says of guess rates."""
    mean = "mean " if of_mean else ""
    if is_yes_no(analysis) or analysis.one_side:
        return f"left edge: {mean}false-alarm rate, as counted"
    return f"left edge: half of the {mean}share of blanks\nanswered left or right, as counted"


def start_words(analysis: Analysis) -> str:
    """Say where a function starts that has its false alarms of blank trials."""
    if not blanks_tell(analysis):
        return ""
    told = "half of the share of blank trials that were answered left or right"
    if is_yes_no(analysis) or analysis.one_side:
        told = "the share of blank trials that were answered as felt"
    return (
        f" The filled sign at the left edge is {told}, as counted. A function starts at the "
        "posterior mean of the guess rate: blank trials and weak levels tell it, and a prior worth "
        "half an answer, so that it need not begin at the sign or at the points of the weakest "
        "levels. Likewise it may end below the points of the strongest, by the lapse rate, which "
        "few of their trials tell."
    )
