"""Which figures an analysis has: each as PNG, SVG and PDF, with its title and caption."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING, Any, Final

from analysis.reading.columns import FORCED
from analysis.results.figures.confusion import plot_confusion
from analysis.results.figures.curves import DRAWN, blank_rates, conditions_of
from analysis.results.figures.d_prime import plot_d_prime
from analysis.results.figures.detection import (
    MAX_PAGES,
    has_residuals,
    pages_of,
    plot_detection,
    plot_participants,
)
from analysis.results.figures.drawing import DEFAULT_STYLE, Style, render
from analysis.results.figures.reaction_times import (
    MIN_ANSWERS,
    plot_reaction_times,
    timed_levels,
)
from analysis.results.figures.thresholds import plot_thresholds
from analysis.results.findings import side_estimates

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from matplotlib.figure import Figure

    from analysis.results.analysis import Analysis


FIGURES: Final = (
    "detection",
    "participants",
    "thresholds",
    "d_prime",
    "confusion",
    "reaction_times",
)
MIN_TRIALS: Final = 20
"""Of fewer trials nothing is drawn: tables show them better."""
NAMES: Final = tuple(
    f"{figure}{page}.{ending}"
    for figure in FIGURES
    for page in ("", *(f"-{n}" for n in range(2, MAX_PAGES + 1) if figure == "participants"))
    for ending in ("png", "svg", "pdf")
)
__all__ = ["FIGURES", "NAMES", "Picture", "Style", "drawings", "pictures"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """A figure, or a page of it, that is not yet drawn: `draw` takes a style.

    `figure` is its name in `FIGURES`, `name` that of its files: ``participants``,
    ``participants-2``. `caption` has at most three sentences, `alt` describes what is to be seen.
    """

    figure: str
    name: str
    title: str
    caption: str
    alt: str
    draw: Callable[..., Figure]


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A `Drawing` that was drawn."""

    figure: str
    name: str
    title: str
    caption: str
    alt: str
    png: bytes
    svg: bytes
    pdf: bytes = b""  # where the style has it


def pictures(analysis: Analysis, style: Style = DEFAULT_STYLE) -> Iterator[Picture]:
    """Draw the figures for which an analysis has data, in the order of `FIGURES`."""
    for drawing in drawings(analysis):
        png, svg, *pdf = render(partial(drawing.draw, style=style), style)
        yield Picture(
            figure=drawing.figure,
            name=drawing.name,
            title=drawing.title,
            caption=drawing.caption,
            alt=drawing.alt,
            png=png,
            svg=svg,
            pdf=pdf[0] if pdf else b"",
        )


def drawings(analysis: Analysis) -> Iterator[Drawing]:
    """Yield the figures for which an analysis has data."""
    table = analysis.sensitivity
    if analysis.levels["presented"].sum() < MIN_TRIALS:
        return
    shown = {"residuals": has_residuals(analysis), "blanks": len(blank_rates(analysis)) > 0}
    yield _drawing("detection", analysis, plot_detection, **shown)
    if analysis.participants["participant"].nunique() > 1:
        pages = pages_of(analysis)
        for number, names in enumerate(pages, start=1):
            draw = partial(plot_participants, names=names)
            same: dict[str, Any] = {"names": names, "page": number, "pages": len(pages)}
            yield _drawing("participants", analysis, draw, **same)
    if len(analysis.thresholds) > 1:
        yield _drawing("thresholds", analysis, plot_thresholds)
    if len(table) and table["level_vpp"].notna().any():
        yield _drawing("d_prime", analysis, plot_d_prime)
    if len(analysis.confusion) and not analysis.one_side:
        yield _drawing("confusion", analysis, plot_confusion)
    if len(timed_levels(analysis)):
        yield _drawing("reaction_times", analysis, plot_reaction_times, min_answers=MIN_ANSWERS)


def _drawing(
    figure: str, analysis: Analysis, plot: Callable[..., Figure], page: int = 1, **data: Any
) -> Drawing:
    people = analysis.participants["participant"].nunique()
    text = _captions()
    described = {
        "analysis": analysis,
        "people": people,
        "sides_differ": bool(side_estimates(analysis)),
        "without_function": not analysis.thresholds["status"].isin(DRAWN).all(),
        "forced": analysis.loaded.task == FORCED,
        "conditions": conditions_of(analysis),
        "page": page,
        **data,
    }
    title, caption, alt = (
        " ".join(str(getattr(text, name)(figure, described)).split())
        for name in ("title", "caption", "alt")
    )
    return Drawing(
        figure=figure,
        name=figure if page == 1 else f"{figure}-{page}",
        title=title,
        caption=caption,
        alt=alt,
        draw=partial(plot, analysis),
    )


@cache
def _captions() -> Any:
    """Return the module of the template: the macros ``title``, ``caption`` and ``alt``."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("analysis.results")
    environment = Environment(loader=loader, undefined=StrictUndefined, autoescape=False)  # noqa: S701
    return environment.get_template("captions.jinja").module
