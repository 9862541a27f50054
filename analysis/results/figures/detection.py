"""The figure of detection probability against level."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from analysis.results.figures.drawing import (
    COLOURS,
    GROUP,
    MANY,
    MARKERS,
    Prepared,
    each_condition,
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

    from analysis.axis import Axis
    from analysis.results.tables import Analysis


_HEIGHT_IN = 4.4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectionData:
    """What the figure shows."""

    levels: pd.DataFrame  # `level_table`, at least one row
    participants: pd.DataFrame  # `participants_of`
    forced_choice: bool  # "none" could not be answered, so that who feels nothing guesses a side
    ci: str  # name of the cells' interval
    axis: Axis
    note: str = ""  # for the title, such as that participants are simulated; may be empty


def prepared(analysis: Analysis) -> Prepared | None:
    """Return the figure of an analysis that has a level."""
    if analysis.levels.empty:
        return None
    data = DetectionData(
        levels=analysis.levels,
        participants=analysis.participants,
        forced_choice=analysis.detected_any is None,
        ci=analysis.ci,
        axis=analysis.axis,
        note=analysis.simulated,
    )
    people = of_people(analysis.participants["participant"].nunique())
    alt = (
        f"Detection probability from 0 to 1 against level in {analysis.axis.label}, {people}"
        f"{each_condition(analysis)}; the numbers are in the table of detection by level."
    )
    return Prepared(draw=lambda: draw(data), alt=alt)


def draw(data: DetectionData) -> Figure:
    """Draw detection probability against level.

    Each participant is a thin line. Where everybody was tested at a level, the unweighted mean
    stands on a thick line with the group interval; a single participant has the interval of each
    cell. One panel per condition.
    """
    conditions = list(data.levels["condition"].unique())
    figure, axes = panels(conditions, [_HEIGHT_IN] * len(conditions), data.note)
    for panel, condition in zip(axes, conditions, strict=True):
        _draw(panel, data, condition)
    return figure


def _draw(axes: Axes, data: DetectionData, condition: str) -> None:
    levels = data.levels[data.levels["condition"].eq(condition)]
    people = data.participants[data.participants["condition"].eq(condition)]
    everybody = sorted(data.participants["participant"].unique())
    few = len(everybody) <= len(COLOURS)
    if few:
        _draw_few(axes, people, everybody)
    else:
        _draw_many(axes, people)
    if len(people["participant"].unique()) == 1:
        limits = people[["level_vpp", "low", "high"]]
        interval(axes, limits, f"95 % interval ({data.ci.title()})", colour="black", zorder=2)
    else:
        _draw_group(axes, _shared(levels, people), few=few)
    if data.forced_choice:
        axes.axhline(0.5, color="black", lw=0.8, ls=(0, (4, 3)), zorder=1)
        axes.annotate(
            "guessing left or right: 1/2", (1, 0.5), xycoords=("axes fraction", "data"),
            xytext=(-4, -3), textcoords="offset points", ha="right", va="top", fontsize=8,
        )  # fmt: skip
    level_axis(axes, levels["level_vpp"], data.axis)
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
