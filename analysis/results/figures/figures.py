"""Which figures an analysis has: each as PNG, SVG and PDF, with title, caption and words for it."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from analysis.results.figures import (
    confusion,
    d_prime,
    detection,
    participants,
    reaction,
    thresholds,
)
from analysis.results.figures.drawing import written

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from analysis.results.figures.drawing import Sheet
    from analysis.results.tables import Analysis


FIGURES: Mapping[str, Callable[[Analysis], Sequence[Sheet]]] = MappingProxyType(
    {
        "detection": detection.sheets,
        "participants": participants.sheets,
        "thresholds": thresholds.sheets,
        "d_prime": d_prime.sheets,
        "confusion": confusion.sheets,
        "reaction_times": reaction.sheets,
    }
)
"""The sheets of each figure for which an analysis has data; nothing is drawn before it is asked."""
_MOST_SHEETS: Mapping[str, int] = MappingProxyType({"participants": participants.MOST_SHEETS})
"""Where it is more than one."""


def _file(figure: str, sheet: int) -> str:
    return figure if sheet == 1 else f"{figure}-{sheet}"


NAMES = tuple(
    f"{_file(figure, sheet)}.{ending}"
    for figure in FIGURES
    for sheet in range(1, _MOST_SHEETS.get(figure, 1) + 1)
    for ending in ("png", "svg", "pdf")
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A sheet of a figure that was drawn.

    `figure` is its key in `FIGURES`, `name` that of its files: ``participants``,
    ``participants-2``; `title` names it, `caption` is one sentence on its signs, and `alt` tells
    what it shows to who cannot see it.
    """

    figure: str
    name: str
    title: str
    caption: str
    alt: str
    png: bytes
    svg: bytes
    pdf: bytes = b""  # where it was asked for


def pictures(analysis: Analysis, *, pdf: bool = False) -> Iterator[Picture]:
    """Draw the figures for which an analysis has data, in the order of `FIGURES`; as `pdf`, too."""
    for figure, sheets in FIGURES.items():
        for number, sheet in enumerate(sheets(analysis), start=1):
            png, svg, *page = written(sheet.draw, pdf=pdf)
            yield Picture(
                figure=figure,
                name=_file(figure, number),
                title=sheet.title,
                caption=sheet.caption,
                alt=sheet.alt,
                png=png,
                svg=svg,
                pdf=page[0] if page else b"",
            )
