"""The answers to each stimulus, as shares in a grid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.results.figures.curves import stimulus
from analysis.results.figures.drawing import (
    DEFAULT_STYLE,
    em_mm,
    name_axes,
    new_region,
    short,
    text_em,
)
from experiment.rows import RESPONSES

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.analysis import Analysis
    from analysis.results.figures.drawing import Style


_DARK: Final = 0.62
"""From this share on a cell is so dark that its letters are white."""
_COLOURS: Final = "Blues"  # from white to dark blue: lightness alone orders it, for every eye
_ROW_EM: Final = 2.9


def plot_confusion(
    analysis: Analysis, ax: Axes | None = None, *, style: Style = DEFAULT_STYLE
) -> Figure:
    r"""Draw which answers were given to each stimulus: percentages and counts, by condition.

    Answers that nobody gave are left out.

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
    >>> from analysis import ColumnMap, analyse, plot_confusion, read_inputs
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response,rt_s\n" + (
    ...         "1,left,60,none,0.6\n1,left,60,left,0.5\n1,left,90,left,0.4\n"
    ...         "1,left,40,none,0.7\n1,none,0,none,0.6\n") * 9)
    ...     result = analyse(read_inputs([table], ColumnMap()))
    >>> plot_confusion(result).axes[0].get_xlabel()
    'Answer (%)'
    """
    table = analysis.confusion
    answers = [name for name in RESPONSES if table[name].any()]
    groups = {str(name): rows for name, rows in table.groupby("condition")}
    with style.applied(ax):
        names = {
            condition: [
                f"{stimulus(str(row.kind), str(row.side))}\nn = {row.presented}"
                for row in rows.itertuples()
            ]
            for condition, rows in groups.items()
        }
        left_em = max(text_em(name) for each in names.values() for name in each) + 0.8
        # Labels of rows stand at each panel: their numbers of trials differ.
        wide_em = style.width_mm / em_mm()
        title_em = max(text_em(short(name)) for name in groups) if len(groups) > 1 else 0.0
        panel_em = wide_em / 2 - left_em
        has_room = max(4 * len(answers) - 6, title_em + 2.0) < panel_em
        columns = min(len(groups), 2) if has_room else 1
        rows_of_panels = -(-len(groups) // columns)
        top_em = 1.7 if len(groups) > 1 else 0.4
        rows_em = _ROW_EM * max(map(len, names.values()))
        region = new_region(
            style,
            em_mm() * (rows_of_panels * (rows_em + 3.6) - 0.6 + top_em),
            (left_em + 1.6, 3.2, 0.4, top_em),
            ax=ax,
            note=analysis.mark,
        )
        gap_em = (left_em + 0.4, 3.6)
        panels = region.split(rows_of_panels, columns, gap_em)
        for panel, (condition, rows) in zip(panels, groups.items(), strict=False):
            _draw(panel, rows, answers, names[condition])
            if len(groups) > 1:
                panel.set_title(short(condition), fontsize="small")
        for index, panel in enumerate(panels):
            panel.set_visible(index < len(groups))
            name_axes(
                panel,
                "Answer (%)" if index // columns == rows_of_panels - 1 else "",
                "Stimulus" if index % columns == 0 else "",
                left_em - 0.6,
            )
    return region.figure


def _draw(axes: Axes, rows: pd.DataFrame, answers: list[str], names: list[str]) -> None:
    counts = rows[answers].to_numpy(dtype=np.int64)
    shares = counts / rows["presented"].to_numpy(dtype=np.int64)[:, None]
    edges_x, edges_y = np.arange(len(answers) + 1) - 0.5, np.arange(len(rows) + 1) - 0.5
    axes.pcolormesh(
        edges_x, edges_y, shares, cmap=_COLOURS, vmin=0, vmax=1, edgecolors="white", lw=0.8
    )
    for y, x in np.ndindex(counts.shape):
        axes.text(
            x,
            y,
            f"{percent(shares[y, x])}\n{counts[y, x]}",
            fontsize="small",
            color="white" if shares[y, x] > _DARK else "black",
            ha="center",
            va="center",
            linespacing=1.15,
        )
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xticks(range(len(answers)), answers)
    axes.set_yticks(range(len(rows)), names)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def percent(share: float) -> str:
    """Write a share in percent; one that is small but not 0 is not written as 0.

    >>> percent(0.002), percent(0.0), percent(0.254)
    ('<1', '0', '25')
    """
    return "<1" if 0 < share < 0.005 else f"{100 * share:.0f}"  # noqa: PLR2004
