"""The figure of detection probability against level."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from analysis.results.figures.drawing import (
    COLOURS,
    GROUP,
    MANY,
    MARKERS,
    Sheet,
    in_words,
    interval,
    key,
    level_axis,
    of_people,
    panels,
    short,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.tables import Analysis


_HEIGHT_IN = 4.4


def sheets(analysis: Analysis) -> list[Sheet]:
    """Return the figure; none where no level was presented."""
    if analysis.levels.empty:
        return []
    people = of_people(analysis.participants["participant"])
    shown = f"Detection probability from 0 to 1 against level in {analysis.axis.label}, {people}"
    return [
        Sheet(
            title="Detection probability by level",
            caption="Each participant is a thin line; the thick one is their mean, with the "
            "group's 95 % interval, where everybody was tested at a level.",
            alt=in_words(analysis, shown, "numbers are in the table of detection by level"),
            draw=partial(draw, analysis),
        )
    ]


def draw(analysis: Analysis) -> Figure:
    """Draw detection probability against level.

    Each participant is a thin line. Where everybody was tested at a level, the unweighted mean
    stands on a thick line with the group interval; a single participant has the interval of each
    cell. One panel per condition.
    """
    conditions = list(analysis.levels["condition"].unique())
    figure, axes = panels(conditions, [_HEIGHT_IN] * len(conditions), analysis.mark)
    for panel, condition in zip(axes, conditions, strict=True):
        _draw(panel, analysis, condition)
    return figure


def _draw(axes: Axes, analysis: Analysis, condition: str) -> None:
    levels = analysis.levels[analysis.levels["condition"].eq(condition)]
    people = analysis.participants[analysis.participants["condition"].eq(condition)]
    everybody = sorted(analysis.participants["participant"].unique())
    few = len(everybody) <= len(COLOURS)
    if few:
        _draw_few(axes, people, everybody)
    else:
        _draw_many(axes, people)
    if len(people["participant"].unique()) == 1:
        limits = people[["level_vpp", "low", "high"]]
        interval(axes, limits, f"95 % interval ({analysis.ci.title()})", colour="black", zorder=2)
    else:
        _draw_group(axes, _shared(levels, people), few=few)
    if analysis.detected_any is None:  # who feels nothing guesses a side
        axes.axhline(0.5, color="black", lw=0.8, ls=(0, (4, 3)), zorder=1)
        axes.annotate(
            "guessing left or right: 1/2", (1, 0.5), xycoords=("axes fraction", "data"),
            xytext=(-4, -3), textcoords="offset points", ha="right", va="top", fontsize=8,
        )  # fmt: skip
    level_axis(axes, levels["level_vpp"], analysis.axis)
    axes.set_ylim(-0.03, 1.03)
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1])
    axes.set_ylabel("Detection probability\n(detected / presented)")
    key(axes, columns=2)


def _draw_few(axes: Axes, people: pd.DataFrame, everybody: list[str]) -> None:
    """Draw each participant in a colour and a marker that are the same in every panel."""
    for name, colour, marker in zip(everybody, COLOURS, MARKERS, strict=False):
        one = people[people["participant"].eq(name)]
        if len(one):
            axes.plot(
                one["level_vpp"], one["p"], color=colour, marker=marker, lw=1.0, ms=4, zorder=3,
                label=f"participant {short(name)}",
            )  # fmt: skip


def _draw_many(axes: Axes, people: pd.DataFrame) -> None:
    label: str | None = f"each of {people['participant'].nunique()} participants"
    for _, one in people.groupby("participant"):
        axes.plot(
            one["level_vpp"], one["p"], color=MANY, marker="o", lw=0.8, ms=2, alpha=0.6, zorder=2,
            label=label,
        )  # fmt: skip
        label = None


def _shared(levels: pd.DataFrame, people: pd.DataFrame) -> pd.DataFrame:
    """Keep the levels that everybody was tested at: only these means are of the same people."""
    tested = people.groupby("level_vpp")["participant"].nunique()
    everywhere = tested.index[tested.eq(people["participant"].nunique())]
    return levels[levels["level_vpp"].isin(everywhere)]


def _draw_group(axes: Axes, levels: pd.DataFrame, *, few: bool) -> None:
    if levels.empty:
        axes.plot([], [], ls="", label="no level was given to everybody:\nno mean of participants")
        return
    zorder = 2 if few else 4
    limits = levels[["level_vpp", "group_low", "group_high"]]
    interval(axes, limits, "", colour=GROUP, zorder=zorder)
    axes.plot(
        levels["level_vpp"], levels["p_mean"], color=GROUP, lw=2.6, marker="o",
        ms=9 if few else 5, mfc="white", mew=2, zorder=zorder,
        label="mean of participants,\n95 % interval of the group",
    )  # fmt: skip
