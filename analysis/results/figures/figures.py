"""Which figures an analysis has: each as PNG, SVG and PDF, with its title and caption."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from analysis.reading.columns import FORCED
from analysis.results.figures.confusion import plot_confusion
from analysis.results.figures.curves import blank_rates, looks_of
from analysis.results.figures.d_prime import plot_d_prime
from analysis.results.figures.detection import (
    MAX_PAGES,
    has_residuals,
    pages_of,
    plot_detection,
    plot_participants,
)
from analysis.results.figures.drawing import DEFAULT_STYLE, Style, render
from analysis.results.figures.reaction_times import MIN_ANSWERS, plot_reaction_times, timed_levels
from analysis.results.figures.thresholds import plot_thresholds
from analysis.results.figures.tracks import plot_tracks, tracks_of
from analysis.results.findings import side_estimates
from analysis.results.rendering import sentence
from analysis.thresholds.fit import WITH_FUNCTION

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from matplotlib.figure import Figure

    from analysis.results.analysis import Analysis


FIGURES: Final[Mapping[str, tuple[Callable[..., Figure], Callable[[Analysis], bool]]]] = {
    "detection": (plot_detection, lambda _: True),
    "participants": (plot_participants, lambda it: it.participants["participant"].nunique() > 1),
    "tracks": (plot_tracks, lambda it: len(tracks_of(it)) > 0),
    "thresholds": (plot_thresholds, lambda it: len(it.thresholds) > 1),
    "d_prime": (plot_d_prime, lambda it: bool(it.sensitivity["level_vpp"].notna().any())),
    "confusion": (
        plot_confusion,
        lambda it: len(it.confusion) > 0 and it.has_sites and not it.one_side,
    ),
    "reaction_times": (plot_reaction_times, lambda it: len(timed_levels(it)) > 0),
}
"""What draws each figure, and whether an analysis has data for it, in the order of the report."""
PAGED: Final = ("participants", "tracks")
"""Figures with a panel for each participant, on as many pages as are needed."""
MIN_TRIALS: Final = 20
"""Of fewer trials nothing is drawn: tables show them better."""
NAMES: Final = tuple(
    f"{figure}{page}.{ending}"
    for figure in FIGURES
    for page in ("", *(f"-{n}" for n in range(2, MAX_PAGES + 1) if figure in PAGED))
    for ending in ("png", "svg", "pdf")
)
__all__ = ["FIGURES", "NAMES", "Picture", "Style", "drawings", "pictures"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure, or a page of it.

    `figure` is its name in `FIGURES`, `name` that of its files: ``participants``,
    ``participants-2``. `caption` has at most three sentences, `alt` describes what is to be seen.
    `draw` takes a style. `files` are empty until it is drawn: png, svg and, if the style says so,
    pdf.
    """

    figure: str
    name: str
    title: str
    caption: str
    alt: str
    draw: Callable[..., Figure] = field(compare=False)
    files: Mapping[str, bytes] = field(default_factory=dict)


def pictures(analysis: Analysis, style: Style = DEFAULT_STYLE) -> Iterator[Picture]:
    """Draw the figures for which an analysis has data, in the order of `FIGURES`."""
    for picture in drawings(analysis):
        yield replace(picture, files=render(partial(picture.draw, style=style), style))


def drawings(analysis: Analysis) -> Iterator[Picture]:
    """Yield the figures for which an analysis has data, not yet drawn."""
    if analysis.levels["presented"].sum() < MIN_TRIALS:
        return
    data: dict[str, Any] = {
        "analysis": analysis,
        "people": analysis.participants["participant"].nunique(),
        "sides_differ": bool(side_estimates(analysis)),
        "without_function": not analysis.thresholds["status"].isin(WITH_FUNCTION).all(),
        "forced": analysis.loaded.task == FORCED,
        "conditions": [*looks_of(analysis)],
        "residuals": has_residuals(analysis),
        "blanks": len(blank_rates(analysis)) > 0,
        "min_answers": MIN_ANSWERS,
    }
    for figure, (plot, has_data) in FIGURES.items():
        if not has_data(analysis):
            continue
        pages = pages_of(analysis) if figure in PAGED else [[]]
        for page, names in enumerate(pages, start=1):
            it = {**data, "names": names, "page": page, "pages": len(pages)}
            texts: dict[str, Any] = {
                text: sentence("captions.jinja", text, analysis.scoring, figure=figure, it=it)
                for text in ("title", "caption", "alt")
            }
            name = figure if page == 1 else f"{figure}-{page}"
            draw = partial(plot, analysis, **({"names": names} if names else {}))
            yield Picture(figure=figure, name=name, draw=draw, **texts)
