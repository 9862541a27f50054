"""The figures of a power curve, and of the errors under rules of levels."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.results.figures.axes import figure_of
from analysis.results.figures.drawing import DEFAULT_STYLE, LOOKS, lay_out, render

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure

    from analysis.planning.result import PowerResult

_HEIGHT: Final = 0.65
_TITLE_CHARACTERS: Final = 48


def write_figure(result: PowerResult, path: Path) -> None:
    """Write the power curve as PNG or SVG, by the name of the file."""
    path.write_bytes(render(lambda: _draw(result))["png" if path.suffix == ".png" else "svg"])


def write_rules(errors: pd.DataFrame, path: Path) -> None:
    """Write the errors of `analysis.planning.rules.compare_rules` as PNG."""
    path.write_bytes(render(lambda: _draw_rules(errors))["png"])


def _draw_rules(errors: pd.DataFrame) -> Figure:
    height_em = DEFAULT_STYLE.width_em * _HEIGHT
    labels = "Trials at each finger", "Error of the threshold (dB rms)"
    (axes,) = lay_out(DEFAULT_STYLE, rows_em=[height_em], labels=labels)
    for look, (rule, rows) in zip(LOOKS, errors.groupby("rule", sort=False), strict=False):
        line = {"color": look.colour, "marker": look.marker, "ls": look.line}
        axes.plot(rows["trials"], rows["rms_db"], **line, ms=4, lw=1, label=rule)
    ticks = errors["trials"].unique()
    axes.set(xscale="log", xticks=ticks, xticklabels=[str(number) for number in ticks])
    axes.minorticks_off()
    axes.set_ylim(bottom=0)
    axes.legend(loc="best", borderaxespad=0.8)
    return figure_of(axes)


def _draw(result: PowerResult) -> Figure:
    from matplotlib.ticker import MaxNLocator

    title = fill(result.goal_text, _TITLE_CHARACTERS)
    labels = "Participants", "Studies that reach the goal"
    height_em = DEFAULT_STYLE.width_em * _HEIGHT
    (axes,) = lay_out(
        DEFAULT_STYLE, rows_em=[height_em], titles=[title], labels=labels, tick_em=2.2
    )
    for i, answer in enumerate(result.answers):
        look = LOOKS[i % len(LOOKS)]
        blanks = f", {answer.point.blanks} blank trials" if answer.point.blanks else ""
        limits = [(t.share - t.low, t.high - t.share) for t in answer.tried]
        axes.errorbar(
            [tally.point.participants for tally in answer.tried],
            [tally.share for tally in answer.tried],
            yerr=np.transpose(limits),
            color=look.colour,
            marker=look.marker,
            ms=4,
            lw=1,
            capsize=2,
            label=f"{answer.point.trials_per_side} trials per side{blanks}",
        )
    axes.axhline(result.assurance, color="#555555", lw=0.8, ls="--")
    axes.set_ylim(0, 1.03)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(loc="best", borderaxespad=0.8)
    return figure_of(axes)
