"""Which figures an analysis has: each as PNG and SVG, with words for who cannot see it."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from analysis.results.figures import confusion, detection, reaction, thresholds
from analysis.results.figures.drawing import written

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from analysis.results.figures.drawing import Prepared
    from analysis.results.tables import Analysis


FIGURES: Mapping[str, Callable[[Analysis], Prepared | None]] = MappingProxyType(
    {
        "detection": detection.prepared,
        "thresholds": thresholds.prepared,
        "confusion": confusion.prepared,
        "reaction_times": reaction.prepared,
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
    for name, prepare in FIGURES.items():
        prepared = prepare(analysis)
        if prepared is not None:
            png, svg = written(prepared.draw)
            yield Picture(name=name, png=png, svg=svg, alt=prepared.alt)
