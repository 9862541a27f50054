"""The figure of a power curve."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Final

from analysis.results.figures.drawing import (
    COLOURS,
    DEFAULT_STYLE,
    GROUP,
    MARKERS,
    new_region,
    render,
)

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from analysis.planning.result import PowerResult

_HEIGHT_MM: Final = 75.0
_TITLE_CHARACTERS: Final = 48


def write_figure(result: PowerResult, path: Path) -> None:
    """Write the power curve as PNG or SVG, by the name of the file."""
    png, svg = render(lambda: _draw(result))
    path.write_bytes(png if path.suffix == ".png" else svg)


def _draw(result: PowerResult) -> Figure:
    from matplotlib.ticker import MaxNLocator

    region = new_region(DEFAULT_STYLE, _HEIGHT_MM, (4.6, 3.4, 0.8, 3.0))
    axes = region.axes()
    colours = (GROUP, *COLOURS)
    for i, answer in enumerate(result.answers):
        point, y = answer.point, [tally.share for tally in answer.tried]
        blanks = f", {point.blanks} blank trials" if point.blanks else ""
        axes.errorbar(
            [tally.point.participants for tally in answer.tried],
            y,
            yerr=[
                [tally.share - tally.low for tally in answer.tried],
                [tally.high - tally.share for tally in answer.tried],
            ],
            color=colours[i % len(colours)],
            marker=MARKERS[i % len(MARKERS)],
            ms=4,
            lw=1,
            capsize=2,
            label=f"{point.trials_per_side} trials per side{blanks}",
        )
    axes.axhline(result.assurance, color="#555555", lw=0.8, ls="--")
    axes.set_xlabel("Participants")
    axes.set_ylabel("Studies that reach the goal")
    axes.set_ylim(0, 1.03)
    axes.set_title(fill(result.goal.text, _TITLE_CHARACTERS), fontsize=9)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(fontsize=8, frameon=False, loc="best")
    return region.figure
