"""Which figures an analysis has: each as PNG and SVG, with words for who cannot see it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from analysis.results.figures.drawing import written

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from matplotlib.figure import Figure

    from analysis.results.tables import Analysis


FIGURES = ("detection", "thresholds", "confusion", "reaction_times")
NAMES = tuple(f"{name}.{ending}" for name in FIGURES for ending in ("png", "svg"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure that was drawn.

    Attributes
    ----------
    name : str
        One of `FIGURES`; the files have it.
    png, svg : bytes
        The same on every run.
    alt : str
        What it shows, and where the numbers are.
    """

    name: str
    png: bytes
    svg: bytes
    alt: str


def pictures(analysis: Analysis) -> Iterator[Picture]:
    """Draw the figures for which an analysis has data.

    Parameters
    ----------
    analysis : Analysis
        What came out.

    Yields
    ------
    Picture
        In the order of `FIGURES`.
    """
    drawn = (_detection, _thresholds, _confusion, _reaction_times)
    for name, prepare in zip(FIGURES, drawn, strict=True):
        prepared = prepare(analysis)
        if prepared is not None:
            draw, alt = prepared
            png, svg = written(draw)
            yield Picture(name=name, png=png, svg=svg, alt=alt)


def _detection(analysis: Analysis) -> tuple[Callable[[], Figure], str] | None:
    from analysis.results.figures.detection import DetectionData, draw

    if analysis.levels.empty:
        return None
    data = DetectionData(
        levels=analysis.levels,
        participants=analysis.participants,
        forced_choice=analysis.detected_any is None,
        ci=analysis.ci,
        axis=analysis.axis,
        note=analysis.simulated,
    )
    people = analysis.participants["participant"].nunique()
    alt = (
        f"Detection probability from 0 to 1 against level in {analysis.axis.label}, {_of(people)}"
        f"{_each(analysis)}; the numbers are in the table of detection by level."
    )
    return (lambda: draw(data)), alt


def _thresholds(analysis: Analysis) -> tuple[Callable[[], Figure], str] | None:
    from analysis.results.figures.thresholds import ThresholdData, draw

    if analysis.thresholds.empty:
        return None
    data = ThresholdData(
        thresholds=analysis.thresholds,
        groups=analysis.groups,
        participants=analysis.participants,
        axis=analysis.axis,
        note=analysis.simulated,
    )
    people = analysis.thresholds["participant"].nunique()
    alt = (
        f"Thresholds in {analysis.axis.label} with 95 % intervals, {_of(people)}"
        f"{_each(analysis)}; the numbers are in the tables of thresholds."
    )
    return (lambda: draw(data)), alt


def _confusion(analysis: Analysis) -> tuple[Callable[[], Figure], str] | None:
    from analysis.results.figures.confusion import ConfusionData, draw

    if analysis.confusion.empty:
        return None
    data = ConfusionData(confusion=analysis.confusion, ci=analysis.ci, note=analysis.simulated)
    alt = (
        f"Grid of stimuli and answers with the share of each answer{_each(analysis)}; the counts "
        "are in the table of answers."
    )
    return (lambda: draw(data)), alt


def _reaction_times(analysis: Analysis) -> tuple[Callable[[], Figure], str] | None:
    from analysis.results.figures.reaction import ReactionData, draw

    if not analysis.reaction_times["n"].gt(0).any():
        return None
    data = ReactionData(
        reaction=analysis.reaction_times, axis=analysis.axis, note=analysis.simulated
    )
    alt = (
        "Median reaction time in seconds of correct answers against level, with 10 % and 90 % "
        f"points, for each side{_each(analysis)}; the numbers are in the table of reaction times."
    )
    return (lambda: draw(data)), alt


def _of(people: int) -> str:
    return "of one participant" if people == 1 else f"of {people} participants"


def _each(analysis: Analysis) -> str:
    number = analysis.levels["condition"].nunique()
    return f", one panel for each of {number} conditions" if number > 1 else ""
