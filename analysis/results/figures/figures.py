"""Which figures an analysis has: each as PNG and SVG, with words for who cannot see it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from analysis.results.figures import confusion, detection, reaction, thresholds
from analysis.results.figures.drawing import written

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from matplotlib.figure import Figure

    from analysis.results.tables import Analysis


class Drawing(NamedTuple):
    """How a figure is drawn, and what it shows in words; none where there is nothing to draw."""

    alt: Callable[[Analysis], str]
    draw: Callable[[Analysis], Figure]


FIGURES: Mapping[str, Drawing] = MappingProxyType(
    {
        "detection": Drawing(detection.alt, detection.draw),
        "thresholds": Drawing(thresholds.alt, thresholds.draw),
        "confusion": Drawing(confusion.alt, confusion.draw),
        "reaction_times": Drawing(reaction.alt, reaction.draw),
    }
)
NAMES = tuple(f"{name}.{ending}" for name in FIGURES for ending in ("png", "svg"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure that was drawn: the name of its files, and what it shows in words (`alt`)."""

    name: str
    png: bytes
    svg: bytes
    alt: str


def pictures(analysis: Analysis) -> Iterator[Picture]:
    """Draw the figures for which an analysis has data, in the order of `FIGURES`."""
    for name, drawing in FIGURES.items():
        alt = drawing.alt(analysis)
        if alt:
            png, svg = written(partial(drawing.draw, analysis))
            yield Picture(name=name, png=png, svg=svg, alt=alt)
