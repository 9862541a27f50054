"""The figure of reaction times against level, of each side."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from analysis.results.figures.curves import look_of
from analysis.results.figures.drawing import (
    COLOURS,
    GROUP,
    Sheet,
    in_words,
    key,
    level_axis,
    panels,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.tables import Analysis


_HEIGHT_IN = 4.1
_SIDES = {"left": (GROUP, "o", -4.0), "right": (COLOURS[3], "s", 4.0)}
_OTHER = ("black", "D", 0.0)


def sheets(analysis: Analysis) -> list[Sheet]:
    """Return the figure; none where there are no reaction times."""
    if not analysis.reaction_times["n"].gt(0).any():
        return []
    shown = (
        "Median reaction time in seconds of correct answers against level, with 10 % and 90 % "
        "points"
    )
    by_side = not analysis.one_place
    at = "level and side" if by_side else "level"
    return [
        Sheet(
            title="Reaction times",
            caption=f"Median time of correct answers at each {at}; "
            "the bars reach from the 10 % to the 90 % point.",
            alt=in_words(
                analysis,
                f"{shown}, for each side" if by_side else shown,
                "numbers are in the table of reaction times",
            ),
            draw=partial(draw, analysis),
        )
    ]


def draw(analysis: Analysis) -> Figure:
    """Draw the median reaction time of each side with its 10 % and 90 % points."""
    timed = analysis.reaction_times[analysis.reaction_times["n"].gt(0)]
    groups = [(str(name), rows) for name, rows in timed.groupby("condition")]
    figure, axes = panels([n for n, _ in groups], [_HEIGHT_IN] * len(groups), analysis.mark)
    longest_s = float(timed["p90"].max())
    for panel, (condition, rows) in zip(axes, groups, strict=True):
        _draw(panel, rows, analysis, condition)
        panel.set_ylim(0, 1.08 * longest_s or 1.0)
    return figure


def _draw(axes: Axes, rows: pd.DataFrame, analysis: Analysis, condition: str) -> None:
    level_axis(axes, rows["level_vpp"], analysis.axis)
    for side, one in rows.groupby("side", observed=True):
        colour, marker, shift_pt = _SIDES.get(str(side), _OTHER)
        name = f"{side}: "
        if analysis.one_place:  # the condition's look, as in the other figures
            name, shift_pt, (colour, marker, _) = "", 0.0, look_of(analysis, condition)
        _draw_side(axes, one, name, (colour, marker, shift_pt))
    axes.set_ylabel("Reaction time of correct answers (s)")
    key(axes, columns=1)


def _draw_side(axes: Axes, one: pd.DataFrame, name: str, look: tuple[str, str, float]) -> None:
    """Draw one side a little beside the level, so that two sides do not cover each other."""
    from matplotlib.transforms import ScaledTranslation

    colour, marker, shift_pt = look
    some = one["n"][one["n"].gt(0)]
    number = " to ".join(dict.fromkeys(f"{n}" for n in (some.min(), some.max())))
    figure = axes.get_figure(root=True)
    assert figure is not None
    aside = axes.transData + ScaledTranslation(shift_pt / 72, 0, figure.dpi_scale_trans)
    axes.vlines(one["level_vpp"], one["p10"], one["p90"], color=colour, lw=1.4, transform=aside)
    for column in ("p10", "p90"):
        axes.plot(
            one["level_vpp"], one[column], color=colour, marker="_", ls="", ms=6, transform=aside
        )
    axes.plot(
        one["level_vpp"],
        one["median"],
        color=colour,
        marker=marker,
        ms=5,
        lw=1.2,
        transform=aside,
        label=f"{name}median, 10–90 % of {number} answers a level",
    )
