"""Reaction times of correct answers against level, by side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from analysis.results.figures.curves import conditions_of
from analysis.results.figures.drawing import (
    DEFAULT_STYLE,
    add_shared_legend,
    alike_labels,
    aside,
    em_mm,
    label_outer,
    level_axis,
    level_label,
    look,
    new_region,
    round_ticks,
    short,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Transform

    from analysis.results.analysis import Analysis
    from analysis.results.figures.drawing import Style


MIN_ANSWERS: Final = 5
"""Fewer answers have no 10 % and 90 % points."""
_SIDE_LOOKS: Final = (("black", "<"), ("#8A8A8A", ">"))


def timed_levels(analysis: Analysis) -> pd.DataFrame:
    """Return the reaction times that are drawn: those of at least `MIN_ANSWERS` answers."""
    return analysis.reaction_times[analysis.reaction_times["n"].ge(MIN_ANSWERS)]


def plot_reaction_times(
    analysis: Analysis, ax: Axes | None = None, *, style: Style = DEFAULT_STYLE
) -> Figure:
    r"""Draw the median reaction time of correct answers, with the 10 % and 90 % points, by side.

    Parameters
    ----------
    analysis : Analysis
        From `write_analysis` or `analyse`.
    ax : matplotlib.axes.Axes, optional
        Which the panels replace; a new figure by default.
    style : Style
        Width and style sheet of a new figure.

    Returns
    -------
    matplotlib.figure.Figure
        The figure that was drawn into.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from analysis import ColumnMap, analyse, plot_reaction_times, read_inputs
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response,rt_s\n" + (
    ...         "1,left,60,none,0.6\n1,left,60,left,0.5\n1,left,90,left,0.4\n"
    ...         "1,left,40,none,0.7\n1,none,0,none,0.6\n") * 9)
    ...     result = analyse(read_inputs([table], ColumnMap()))
    >>> len(plot_reaction_times(result).axes)
    1
    """
    table = timed_levels(analysis)
    conditions = [one for one in conditions_of(analysis) if table["condition"].eq(one).any()]
    sides = sorted({*table["side"].astype(str)})
    with style.applied(ax):
        from matplotlib.lines import Line2D

        columns = min(len(conditions), 2)
        rows = -(-len(conditions) // columns)
        handles = [
            Line2D([], [], color=colour, marker=marker, ls="", label=side)
            for side, (colour, marker) in zip(sides, _SIDE_LOOKS, strict=False)
            if len(sides) > 1
        ]
        top_em = 0.6 + 1.3 * (len(conditions) > 1) + 1.4 * bool(handles)
        panel_mm = style.width_mm * (0.52 if columns > 1 else 0.62)
        height_mm = rows * panel_mm + em_mm() * (3.4 + top_em + 2.4 * (rows - 1))
        region = new_region(style, height_mm, (3.8, 3.4, 0.8, top_em), ax=ax, note=analysis.mark)
        panels = region.split(rows, columns, (1.2, 2.4), sharex=True, sharey=True)
        low, high = float(table["p10"].min()), float(table["p90"].max())
        margin = 0.06 * (high - low) or 0.1
        for index, (panel, condition) in enumerate(zip(panels, conditions, strict=False)):
            level_axis(panel, table["level_vpp"], analysis.axis)
            for number, side in enumerate(sides):
                chosen = table["condition"].eq(condition) & table["side"].eq(side)
                # With one side the look is that of the condition, as in the other figures.
                symbols = _SIDE_LOOKS[number % 2] if len(sides) > 1 else look(index)[:2]
                beside = aside(panel, number, len(sides), 5.0)
                _draw(panel, table[chosen], symbols, beside)
            if len(conditions) > 1:
                panel.set_title(short(condition), fontsize="small")
        panels[0].set_ylim(low - margin, high + margin)
        ticks = round_ticks(low, high, log=False)
        panels[0].set_yticks(ticks, alike_labels(ticks))
        labels = level_label(analysis.axis), "Reaction time (s)"
        label_outer(panels, len(conditions), columns, labels)
        add_shared_legend(region, handles)
    return region.figure


def _draw(axes: Axes, rows: pd.DataFrame, symbols: tuple[str, str], beside: Transform) -> None:
    colour, marker = symbols
    axes.vlines(rows["level_vpp"], rows["p10"], rows["p90"], color=colour, transform=beside)
    axes.plot(
        rows["level_vpp"], rows["median"], color=colour, marker=marker, ls="", transform=beside
    )
