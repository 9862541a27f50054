"""The data and fitted functions that figures show, of a group or of a participant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from analysis.results.figures.drawing import LOOKS
from analysis.thresholds.band import Line, group_function, person_function
from analysis.thresholds.fit import ABOVE, BELOW, WITH_FUNCTION, WITH_THRESHOLD
from analysis.thresholds.likeliest import deviance_residuals

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.results.analysis import Analysis
    from analysis.results.figures.drawing import Look
    from analysis.thresholds.band import Function
    from analysis.thresholds.likelihood import Tables

    Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """What a panel shows of one condition."""

    level_vpp: Floats
    p: Floats
    threshold_vpp: float  # NaN where there is none
    guess_rate: float  # mean of the rates that blank trials give; NaN without blank trials
    limits: tuple[Floats, Floats]  # binomial, of a participant's proportions
    function: Function | None


def looks_of(analysis: Analysis) -> dict[str, Look]:
    """Return the conditions in the order in which they are drawn, and how."""
    conditions = sorted({*analysis.levels["condition"]})
    return {name: LOOKS[index % len(LOOKS)] for index, name in enumerate(conditions)}


def by_threshold(analysis: Analysis) -> list[str]:
    """Return the participants by mean threshold; those without one stand last."""
    table, levels = analysis.thresholds, analysis.levels["level_vpp"]
    at = table["threshold_vpp"].astype(float)
    at = at.mask(table["status"].isin(BELOW), levels.min())
    at = at.mask(table["status"].isin(ABOVE), levels.max())
    x = analysis.axis.on_axis(np.asarray(at, dtype=np.float64))
    places = pd.Series(x, index=table["participant"])
    return [*places.groupby(level=0, sort=False).mean().sort_values(kind="stable").index]


def blank_rates(analysis: Analysis) -> pd.DataFrame:
    """Return the share of each participant's blanks that a stimulus would have been detected by.

    Columns ``condition participant rate``; without blank trials no rows.
    """
    people = analysis.people
    rows = [
        (*name, guess.share_of_blanks)
        for name, guess in zip(people.names, people.guesses, strict=True)
        if guess.basis in {"blanks", "few blanks"}
    ]
    return pd.DataFrame(rows, columns=["condition", "participant", "rate"])


def person_curves(analysis: Analysis, participant: str) -> dict[str, Curve]:
    """Return what a panel shows of a participant, by condition."""
    people = analysis.people
    rows = {condition: i for i, (condition, name) in enumerate(people.names) if name == participant}
    return {name: _curve(analysis, name, people.at([rows[name]])) for name in sorted(rows)}


@lru_cache(maxsize=1)  # the figure and the table of its functions ask in turn
def group_curves(analysis: Analysis) -> dict[str, Curve]:
    """Return what a panel shows of the group, by condition; of one participant, the participant's.

    The data are means at the levels at which everybody was tested: means of the same people.
    """
    conditions = analysis.people.conditions
    return {name: _curve(analysis, name, people) for name, people in conditions.items()}


def _curve(analysis: Analysis, condition: str, people: Tables) -> Curve:
    """Return what a panel shows of some participants."""
    names = [name for _, name in people.names]
    cells, rates, fits = (
        table[table["condition"].eq(condition) & table["participant"].isin(names)]
        for table in (analysis.participants, blank_rates(analysis), analysis.thresholds)
    )
    by_level = cells.groupby("level_vpp")
    means = by_level[["p", "low", "high"]].mean()[by_level.size().eq(len(people))]
    function = None
    if len(people) > 1:
        fits = analysis.groups[analysis.groups["condition"].eq(condition)]
        if fits["status"].isin(WITH_THRESHOLD).all():
            function = group_function(people)
    elif fits["status"].isin(WITH_FUNCTION).all():
        function = person_function(people, _line(fits.iloc[0], people.axis))
    return Curve(
        level_vpp=means.index.to_numpy(dtype=np.float64),
        p=_floats(means, "p"),
        limits=(_floats(means, "low"), _floats(means, "high")),
        threshold_vpp=float(fits["threshold_vpp"].iloc[0]),
        guess_rate=float(rates["rate"].mean()),
        function=function,
    )


def function_table(analysis: Analysis) -> pd.DataFrame:
    """Return the functions that the figure of detection shows, with their bands, point by point."""
    names = ("condition", "level_vpp", "function", "function_low", "function_high")
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
    fitted = analysis.thresholds[analysis.thresholds["status"].isin(WITH_FUNCTION)]
    cells = analysis.participants.merge(fitted, on=["participant", "condition"])
    level = analysis.axis.on_axis(_floats(cells, "level_vpp"))
    expected = _line(cells, analysis.axis).at(level)
    counts = _floats(cells, "detected"), _floats(cells, "presented")
    return cells.assign(residual=deviance_residuals(*counts, expected))


def _line(rows: Any, axis: Axis) -> Line:
    """Return the function of a row of thresholds, or the functions of several."""
    at, sigma, lapse_rate, guess_rate = (
        np.asarray(rows[name], dtype=np.float64)
        for name in ("threshold_vpp", "sigma", "lapse_rate", "guess_posterior")
    )
    values: dict[str, Any] = {"mu": axis.on_axis(at), "sigma": sigma / axis.width(1.0)}
    values |= {"lapse_rate": lapse_rate, "guess_rate": guess_rate}
    return Line(**values)


def _floats(table: pd.DataFrame, name: str) -> Floats:
    return table[name].to_numpy(dtype=np.float64)
