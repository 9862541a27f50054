"""The figure of detection probability against level, with the functions of all conditions."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from analysis.definitions import FAR_LIMIT, TOTAL
from analysis.results.figures.composed import (
    DEVIANCE,
    beside,
    draw_panel,
    name_parts,
    of_means,
)
from analysis.results.figures.curves import (
    conditions_of,
    group_curves,
    look_of,
    start_label,
    start_words,
)
from analysis.results.figures.drawing import Sheet, key, of_people, panels, short, wrapped
from analysis.results.methods.misfit import misfit_words

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.figures.composed import Curve
    from analysis.results.tables import Analysis


_HEIGHT_IN, _ROW_IN = 5.1, 0.2
_ALONE = 2
"""Rows of a difference: one person's, and the group's, which tells nothing."""
_LETTERS = 64


def sheets(analysis: Analysis) -> list[Sheet]:
    """Return the figure; none where no level was presented."""
    if analysis.levels.empty:
        return []
    alone = analysis.participants["participant"].nunique() == 1
    people = of_people(analysis.participants["participant"])
    number = len(conditions_of(analysis))
    over = f", {number} conditions over each other" if number > 1 else ""
    data, new, of_group = "proportions with their 95 % intervals", "", ""
    if not alone:
        data = f"means of the participants with the group's 95 % interval ({FAR_LIMIT})"
        new = " and, thinner, where another person's is expected"
        of_group = (
            " The function is the group's, the mean of those of people like these: it may lie above"
            " or below the points of single people."
        )
    return [
        Sheet(
            title="Detection probability by level, and the fitted function",
            caption=f"Above, {data}, and the function with its 95 % band where the data tell one; "
            f"in the middle the threshold with its 95 % interval{new}; below, how far the data lie "
            f"from the function.{of_group}{_fit(analysis, alone=alone)}{start_words(analysis)}"
            f"{_half_way(analysis)}",
            alt=f"Detection probability from 0 to 1 against level in {analysis.axis.label}, "
            f"{people}{over}, with the fitted function, thresholds and residuals; the numbers are "
            "in the tables of detection by level and of thresholds.",
            draw=partial(draw, analysis),
        )
    ]


def _half_way(analysis: Analysis) -> str:
    """Say what a threshold is."""
    if analysis.thresholds.empty:
        return ""
    gamma = "guesses" if analysis.detected_any is None else "false alarms"
    return (
        " The threshold is the level that is felt half of the time: detected (1 + gamma - lambda)/2"
        f" of the time, half-way between {gamma} (gamma) and 1 - lambda, lambda the lapse rate."
    )


def _fit(analysis: Analysis, *, alone: bool) -> str:
    """Say whether what lies off the function below is a misfit."""
    misfit = misfit_words(analysis.thresholds).removeprefix("It ").removesuffix(".")
    if not misfit:
        return ""
    bars = "" if alone else residual_words(analysis)
    return f"{bars} Whether a participant's function fits is tested by bootstrap: it {misfit}."


def residual_words(analysis: Analysis) -> str:
    """Say how many bars of a group's residuals lie wholly off 0, and how many do by chance."""
    ends = [
        (one.residuals.low, one.residuals.high)
        for one in group_curves(analysis).values()
        if one.residuals is not None
    ]
    off = [(low > 0) | (high < 0) for low, high in ends if low is not None and high is not None]
    if not off:
        return ""
    number, of = sum(int(one.sum()) for one in off), sum(one.size for one in off)
    lie = "lies" if number == 1 else "lie"
    return (
        f" Of the {of} bars at the foot {number or 'none'} {lie} wholly off 0; in simulations of "
        "people for whom the group's function holds none of 480 did."
    )


def draw(analysis: Analysis) -> Figure:
    """Draw the data of the group, or of the only person, and the function of every condition."""
    curves = group_curves(analysis)
    told = [*_differences(analysis)]
    alone = analysis.participants["participant"].nunique() == 1
    height = _HEIGHT_IN + _ROW_IN * (2 * len(curves) + len(told))
    figure, (axes,) = panels([""], [height], analysis.mark)
    levels_vpp = analysis.levels["level_vpp"].to_numpy(dtype=np.float64)
    scale = DEVIANCE if alone else of_means(curves.values())
    if not alone:
        _draw_people(axes, analysis, [*curves])
    draw_panel(axes, [*curves.values()], levels_vpp, analysis.axis, scale)
    name_parts(axes, len(curves), scale)
    _draw_guessing(axes, analysis)
    if told:
        axes.set_title("\n".join(told), fontsize=8, loc="left", x=-0.18)
    _explain(axes, analysis, curves, alone=alone)
    key(axes, columns=1)
    return figure


def _draw_people(axes: Axes, analysis: Analysis, conditions: list[str]) -> None:
    """Draw the proportions of each person, faintly: how far people differ."""
    for place, condition in enumerate(conditions):
        rows = analysis.participants[analysis.participants["condition"].eq(condition)]
        colour, marker, _ = look_of(analysis, condition)
        axes.scatter(
            rows["level_vpp"],
            rows["p"],
            s=9,
            marker=marker,
            color=colour,
            alpha=0.35,
            linewidths=0,
            zorder=2,
            transform=beside(axes, place, len(conditions)),
        )


def _draw_guessing(axes: Axes, analysis: Analysis) -> None:
    """Mark where detection begins of who feels nothing, if that is the same of all."""
    rates = analysis.thresholds["guess_rate"].unique()
    if len(rates) == 1 and analysis.thresholds["guess_basis"].eq("forced choice").all():
        (rate,) = rates
        axes.axhline(rate, color="black", lw=0.8, ls=(0, (4, 3)), zorder=1)
        axes.annotate(
            f"guessing: 1/{1 / rate:.0f}",
            (1, rate),
            xycoords=("axes fraction", "data"),
            xytext=(-4, -3),
            textcoords="offset points",
            ha="right",
            va="top",
            fontsize=8,
        )


def _differences(analysis: Analysis) -> Iterator[str]:
    """Yield how much every two conditions differ, of the group or of who is alone in both."""
    pairs = analysis.differences.groupby(["condition_a", "condition_b"], sort=False)
    for (a, b), rows in pairs:
        group = rows["participant"].eq(TOTAL)
        row = rows[~group if group.sum() < len(rows) <= _ALONE else group].iloc[0]
        words = f"threshold, {short(str(b))} against {short(str(a))}: {row['printed']}"
        yield from wrapped(words, _LETTERS, "    ")


def _explain(axes: Axes, analysis: Analysis, curves: Mapping[str, Curve], *, alone: bool) -> None:
    """Put into the key the threshold of each condition, and what the signs are."""
    of_group = dict(zip(analysis.groups["condition"], analysis.groups["printed"], strict=True))
    people = analysis.thresholds.groupby("condition")["printed"]
    for condition, curve in curves.items():
        colour, marker, line = curve.look
        told = people.first()[condition] if people.size()[condition] == 1 else of_group[condition]
        where = f"{short(condition)}: " if len(curves) > 1 else "threshold "
        where = "" if where == "threshold " and str(told).startswith("no threshold") else where
        line = line if curve.function is not None else ""
        axes.plot(
            [],
            [],
            color=colour,
            marker=marker,
            ls=line,
            mfc="white",
            ms=5,
            label=where + str(told).split(";")[0],
        )
    marker, grey = next(iter(curves.values())).look[1], "#404040"
    words = f"proportion, 95 % interval ({analysis.ci.title()})"
    if not alone:
        words = "mean of participants, 95 % interval of the group"
    if any(len(curve.level_vpp) for curve in curves.values()):
        axes.errorbar(
            [], [], yerr=[], color=grey, marker=marker, mfc="white", ms=5, ls="", label=words
        )
    else:
        axes.plot([], [], ls="", label="no level was given to everybody:\nno mean of participants")
    if any(curve.start is not None for curve in curves.values()):
        words = start_label(analysis, of_mean=not alone)
        axes.plot([], [], color=grey, marker=marker, ls="", ms=4.2, label=words)
    if any(curve.function is not None for curve in curves.values()):
        axes.fill_between([], [], color=grey, alpha=0.25, lw=0, label="95 % band of the function")
    if alone:
        return
    number = analysis.participants["participant"].nunique()
    axes.plot(
        [],
        [],
        color=grey,
        marker=marker,
        ls="",
        ms=3,
        alpha=0.5,
        mew=0,
        label=f"each of {number} participants",
    )
    if any(curve.mark.new is not None for curve in curves.values()):
        axes.plot(
            [],
            [],
            color=grey,
            marker="|",
            lw=4.2,
            ms=5.5,
            label="threshold of the group, 95 % interval",
        )
        axes.plot(
            [],
            [],
            color=grey,
            marker="|",
            lw=1.7,
            ms=5,
            alpha=0.5,
            label="another person's threshold, 95 %",
        )
