"""The curve of a promise: how often the goal is reached by the number of people."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Final

from analysis.results.figures.drawing import COLOURS, GROUP, MARKERS, panels, written

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.power.promise import Promise
    from analysis.power.search import Tried


_HEIGHT_IN: Final = 3.4
_TITLE_CHARACTERS: Final = 48


def write_figure(promise: Promise, path: Path) -> None:
    """Write the curve as PNG or SVG, by the name of the file."""
    png, svg = written(lambda: _draw(promise))
    path.write_bytes(png if path.suffix == ".png" else svg)


def _draw(promise: Promise) -> Figure:
    from matplotlib.ticker import MaxNLocator

    figure, (axes,) = panels([promise.study], [_HEIGHT_IN])
    designs: dict[str, list[Tried]] = {}
    for one in promise.tried:
        point = one.point
        told = f"{point.trials_per_side} a side"
        told += f", {point.blanks} blanks" if point.blanks else ""
        designs.setdefault(f"{told}, levels placed" if point.placed else told, []).append(one)
    colours = (GROUP, *COLOURS)
    for place, (told, points) in enumerate(designs.items()):
        _curve(axes, points, told, colours[place % len(colours)], MARKERS[place % len(MARKERS)])
    axes.axhline(promise.assurance, color="#555555", lw=0.8, ls="--")
    axes.set_xlabel("Participants")
    axes.set_ylabel("Studies that reach the goal")
    axes.set_ylim(0, 1.03)
    axes.set_title(fill(promise.goal.words, _TITLE_CHARACTERS), fontsize=9)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    people = [one.point.participants for one in promise.tried]
    if max(people) - min(people) <= 1:
        axes.set_xlim(min(people) - 2, max(people) + 2)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(fontsize=8, frameon=False, loc="best")
    return figure


def _curve(axes: Axes, points: list[Tried], told: str, colour: str, marker: str) -> None:
    x = [one.point.participants for one in points]
    y = [one.assurance for one in points]
    bars = [
        [value - one.limits[0] for one, value in zip(points, y, strict=True)],
        [one.limits[1] - value for one, value in zip(points, y, strict=True)],
    ]
    axes.errorbar(x, y, yerr=bars, color=colour, marker=marker, ms=4, lw=1, capsize=2, label=told)
