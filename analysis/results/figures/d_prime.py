"""The figure of d' against level: sensitivity that a willingness to answer hardly moves."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from analysis.definitions import TOTAL
from analysis.results.figures.composed import beside
from analysis.results.figures.curves import conditions_of, look_of
from analysis.results.figures.drawing import Sheet, key, level_axis, of_people, panels, short

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.tables import Analysis


_HEIGHT_IN, _ROW_IN = 3.9, 0.18
_BEYOND, _ROOM = 2.0, 0.2


def sheets(analysis: Analysis) -> list[Sheet]:
    """Return the figure; none without blank trials, or where "none" was no answer."""
    table = analysis.sensitivity
    if table.empty:
        return []
    people = table.loc[table["participant"].ne(TOTAL), "participant"]
    bars = "the bars are 95 % intervals"
    if len({*people}) > 1:
        bars = "participants are faint, their mean has its 95 % interval"
    return [
        Sheet(
            title="Sensitivity d' by level",
            caption="d' compares what was felt at a level with what was felt of blank trials: "
            "unlike a proportion, at one level it hardly moves with the willingness to answer; "
            f"{bars}.",
            alt=f"d' against level in {analysis.axis.label}, {of_people(people)}, with 95 % "
            "intervals; the numbers are in the table of sensitivity.",
            draw=partial(draw, analysis),
        )
    ]


def draw(analysis: Analysis) -> Figure:
    """Draw the mean d' of the participants at each level, conditions over each other."""
    table = analysis.sensitivity[analysis.sensitivity["level_vpp"].notna()]
    conditions = [one for one in conditions_of(analysis) if table["condition"].eq(one).any()]
    several = len({*table["participant"]} - {TOTAL}) > 1
    figure, (axes,) = panels(
        [""], [_HEIGHT_IN + _ROW_IN * (len(conditions) + several)], analysis.mark
    )
    level_axis(axes, table["level_vpp"], analysis.axis, beyond=0.09)
    axes.axhline(0, color="#808080", lw=0.8, zorder=1)
    for place, condition in enumerate(conditions):
        rows = table[table["condition"].eq(condition)]
        _draw(axes, rows, look_of(analysis, condition), beside(axes, place, len(conditions)))
        _name(axes, analysis, condition, alone=len({*rows["participant"]} - {TOTAL}) == 1)
    if several:
        axes.scatter([], [], s=9, color="#606060", alpha=0.6, label="each participant")
    # Of two or three people the limits may be so far away that nothing else could be seen.
    low, high = table["d_prime"].min(), table["d_prime"].max()
    bars = table[table["participant"].eq(TOTAL) == several]
    least, most = (
        max(bars["d_prime_low"].fillna(low).min(), low - _BEYOND),
        min(bars["d_prime_high"].fillna(high).max(), high + _BEYOND),
    )
    axes.set_ylim(min(least, low) - _ROOM, max(most, high) + _ROOM)
    axes.set_ylabel("d' (detection)")
    key(axes, columns=1)
    return figure


def _draw(axes: Axes, rows: pd.DataFrame, look: tuple[str, str, object], aside: object) -> None:
    colour, marker, line = look
    each, mean = (rows[rows["participant"].eq(TOTAL) == of_all] for of_all in (False, True))
    several = len({*each["participant"]}) > 1
    if several:
        axes.scatter(
            each["level_vpp"],
            each["d_prime"],
            s=9,
            marker=marker,
            color=colour,
            alpha=0.35,
            linewidths=0,
            transform=aside,
            zorder=2,
        )
    told = (mean if several else each).sort_values("level_vpp")
    bars = told[np.isfinite(told["d_prime_low"])]
    axes.vlines(
        bars["level_vpp"],
        bars["d_prime_low"],
        bars["d_prime_high"],
        color=colour,
        lw=1.2,
        transform=aside,
        zorder=3,
    )
    axes.plot(
        told["level_vpp"],
        told["d_prime"],
        color=colour,
        marker=marker,
        ls=line,
        lw=1.4,
        ms=6,
        mfc="white",
        mew=1.4,
        transform=aside,
        zorder=4,
    )


def _name(axes: Axes, analysis: Analysis, condition: str, *, alone: bool) -> None:
    """Tell in the key how many false alarms a condition has."""
    colour, marker, line = look_of(analysis, condition)
    table = analysis.sensitivity
    row = table[table["condition"].eq(condition) & table["participant"].eq(TOTAL)].iloc[-1]
    who = "" if alone else "mean of participants, "
    if analysis.counts.conditions > 1:
        who = f"{short(condition)}: " + who
    told = f"{who}false alarms {row['false_alarms']:.0f} of {row['blanks']:.0f}"
    axes.plot([], [], color=colour, marker=marker, ls=line, mfc="white", ms=5, label=told)
