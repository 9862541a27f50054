"""Reaction times of correct answers against level, by side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from analysis.results.figures.axes import figure_of
from analysis.results.figures.curves import looks_of
from analysis.results.figures.drawing import (
    DEFAULT_STYLE,
    Look,
    YAxis,
    draw_points,
    handle,
    level_panels,
)
from analysis.results.rendering import short

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.analysis import Analysis
    from analysis.results.figures.drawing import Style


MIN_ANSWERS: Final = 5
"""Fewer answers have no 10 % and 90 % points."""
_SIDE_LOOKS: Final = (Look("black", "<"), Look("#8A8A8A", ">"))


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
    looks = looks_of(analysis)
    conditions = [name for name in looks if table["condition"].eq(name).any()]
    sides = sorted({*table["side"].astype(str)})
    # With one side the look is that of the condition, as in the other figures.
    side_looks = dict(zip(sides, _SIDE_LOOKS, strict=False)) if len(sides) > 1 else {}
    with style.applied(ax):
        panels, _ = level_panels(
            analysis,
            style,
            ax,
            table["level_vpp"],
            YAxis("Reaction time (s)", table[["p10", "p90"]]),
            titles=[*map(short, conditions)] if len(conditions) > 1 else [""],
            columns=min(len(conditions), 2),
            handles=[handle(look, side, ls="", mfc=None) for side, look in side_looks.items()],
        )
        for panel, condition in zip(panels, conditions, strict=True):
            for number, side in enumerate(sides):
                rows = table[table["condition"].eq(condition) & table["side"].eq(side)]
                draw_points(
                    panel,
                    rows["level_vpp"],
                    rows["median"],
                    side_looks.get(side, looks[condition]),
                    bars=(rows["p10"], rows["p90"]),
                    shift_pt=5.0 * (number - (len(sides) - 1) / 2),
                    filled=True,
                )
    return figure_of(panels[0])
