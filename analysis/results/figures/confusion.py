"""The figure of answers to each stimulus: shares in a grid, with counts and intervals."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.answers.intervals import proportion_ci
from analysis.results.figures.drawing import Sheet, in_words, panels
from experiment.rows import RESPONSES

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.tables import Analysis


_ROW_IN = 0.62
_AROUND_IN = 1.5
_DARK = 0.62
_LEAST_SHOWN = 0.005
_COLOURS: Final = "Blues"  # from white to dark blue: lightness alone orders it, for every eye


def sheets(analysis: Analysis) -> list[Sheet]:
    """Return the figure; none where there are no answers, or of one side only."""
    if analysis.confusion.empty or analysis.one_side:
        return []
    shown = "Grid of stimuli and answers with the share of each answer"
    return [
        Sheet(
            title="Answers to each stimulus",
            caption="In each cell: the answer's share of the stimulus's trials, its count, and the "
            "share's 95 % interval, which ignores that participants differ.",
            alt=in_words(analysis, shown, "counts are in the table of answers"),
            draw=partial(draw, analysis),
        )
    ]


def draw(analysis: Analysis) -> Figure:
    """Draw a grid of stimuli and answers; each cell has its share, count and 95 % interval."""
    groups = [(str(name), rows) for name, rows in analysis.confusion.groupby("condition")]
    heights = [_AROUND_IN + _ROW_IN * len(rows) for _, rows in groups]
    figure, axes = panels([name for name, _ in groups], heights, analysis.mark)
    for panel, (_, rows) in zip(axes, groups, strict=True):
        _draw(panel, rows, analysis.ci)
    axes[-1].annotate(
        f"In each cell: share of the row, count, 95 % interval ({analysis.ci.title()})\n"
        "of the share, which ignores that participants differ.",
        (0.5, 0),
        xytext=(0, -40),
        xycoords="axes fraction",
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize=8,
    )
    return figure


def stimulus(kind: str, side: str) -> str:
    """Name a stimulus.

    >>> stimulus("single", "left"), stimulus("both", "both"), stimulus("blank", "none")
    ('left', 'both', 'blank')
    """
    return side if kind == "single" else kind


def _percent(share: float) -> str:
    """Write a share as a whole percentage; none is written 0 that is not.

    >>> _percent(0.002), _percent(0.0), _percent(0.254)
    ('<1', '0', '25')
    """
    return "<1" if 0 < share < _LEAST_SHOWN else f"{100 * share:.0f}"


def _draw(axes: Axes, rows: pd.DataFrame, ci: str) -> None:
    counts = rows[list(RESPONSES)].to_numpy(dtype=np.int64)
    presented = np.broadcast_to(rows["presented"].to_numpy(dtype=np.int64)[:, None], counts.shape)
    shares = counts / presented
    low, high = proportion_ci(counts, presented, ci)
    axes.imshow(shares, cmap=_COLOURS, vmin=0, vmax=1, aspect="auto")
    for place in np.ndindex(counts.shape):
        y, x = place
        dark = shares[place] > _DARK
        colour = "white" if dark else "black"
        # Words within the grid need not be measured to lay the figure out.
        axes.text(
            x,
            y - 0.24,
            f"{100 * shares[place]:.0f} %",
            fontsize=9,
            color=colour,
            ha="center",
            va="center",
            weight="bold",
            in_layout=False,
        )
        limits = "–".join(_percent(float(limit[place])) for limit in (low, high))
        axes.text(
            x,
            y + 0.18,
            f"{counts[place]}\n{limits} %",
            fontsize=7,
            color=colour,
            ha="center",
            va="center",
            linespacing=1.1,
            in_layout=False,
        )
    names = [
        f"{stimulus(str(row.kind), str(row.side))}\nn = {row.presented}"
        for row in rows.itertuples()
    ]
    axes.set_yticks(range(len(rows)), names, fontsize=8)
    axes.set_xticks(range(len(RESPONSES)), list(RESPONSES), fontsize=8)
    axes.set_xticks(np.arange(len(RESPONSES) - 1) + 0.5, minor=True)
    axes.set_yticks(np.arange(len(rows) - 1) + 0.5, minor=True)
    axes.grid(which="minor", color="white", lw=1.5)
    axes.tick_params(which="both", length=0)
    axes.spines[:].set_visible(False)
    axes.set_xlabel("Answer (% of the stimulus's trials)")
    axes.set_ylabel("Stimulus (n trials)")
