"""The answers to each stimulus, as shares in a grid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.counts.table import responses_of
from analysis.results.figures.axes import figure_of, text_em
from analysis.results.figures.drawing import DEFAULT_STYLE, lay_out
from analysis.results.rendering import short

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.analysis import Analysis
    from analysis.results.figures.drawing import Style


_DARK: Final = 0.62
"""From this share on a cell is so dark that its letters are white."""
_COLOURS: Final = "Blues"  # from white to dark blue: lightness alone orders it, for every eye
_IN_CELL: Final[Any] = {"fontsize": "small", "ha": "center", "va": "center", "linespacing": 1.15}
_ROW_EM: Final = 2.9


def plot_confusion(
    analysis: Analysis, ax: Axes | None = None, *, style: Style = DEFAULT_STYLE
) -> Figure:
    r"""Draw which answers were given to each stimulus: percentages and counts, by condition.

    Answers that no participant gave are left out.

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
    answers = [name for name in responses_of(analysis.task) if table[name].any()]
    stimuli = table["side"].astype(str).where(table["kind"].eq("single"), table["kind"].astype(str))
    names = stimuli + "\nn = " + table["presented"].astype(str)
    groups = {str(name): rows for name, rows in table.groupby("condition")}
    titles = [short(name) if len(groups) > 1 else "" for name in groups]
    with style.applied(ax):
        # Each panel has labels of its rows, as the numbers of trials differ.
        tick_em = max(map(text_em, names)) + 0.4
        numbers_em = len(answers) * text_em(str(table[answers].to_numpy().max()))
        panel_em = max(text_em(" ".join(answers)), numbers_em, *map(text_em, titles))
        has_room = panel_em < style.width_em / 2 - tick_em - 2.0
        columns = min(len(groups), 2) if has_room else 1
        is_crowded = text_em(" ".join(answers)) > style.width_em - tick_em - 2.0
        rows_em = _ROW_EM * max(map(len, groups.values()))
        panels = lay_out(
            style,
            ax,
            rows_em=[rows_em] * -(-len(groups) // columns),
            columns=(1,) * columns,
            titles=titles,
            labels=("Answer (%)", "Stimulus"),
            tick_em=tick_em,
            gap_em=(tick_em + 0.8, 3.0),
            note=analysis.mark,
        )
        for panel, rows in zip(panels, groups.values(), strict=True):
            counts = rows[answers].to_numpy(dtype=np.int64)
            shares = counts / rows["presented"].to_numpy(dtype=np.int64)[:, None]
            edges = (np.arange(size + 1) - 0.5 for size in reversed(counts.shape))
            panel.pcolormesh(
                *edges, shares, cmap=_COLOURS, vmin=0, vmax=1, edgecolors="white", lw=0.8
            )
            for y, x in np.ndindex(counts.shape):
                text = f"{percent(shares[y, x])}\n{counts[y, x]}"
                colour = "white" if shares[y, x] > _DARK else "black"
                panel.text(x, y, text, color=colour, **_IN_CELL)
            panel.set_ylim(len(rows) - 0.5, -0.5)
            panel.set_xticks(range(len(answers)), answers, rotation=90 if is_crowded else 0)
            panel.set_yticks(range(len(rows)), names[rows.index])
            panel.tick_params(length=0)
            panel.spines[:].set_visible(False)
    return figure_of(panels[0])


def percent(share: float) -> str:
    """Write a share in percent; one that is small but not 0 is not written as 0.

    >>> percent(0.002), percent(0.0), percent(0.254)
    ('<1', '0', '25')
    """
    return "<1" if 0 < share < 0.005 else f"{100 * share:.0f}"  # noqa: PLR2004
