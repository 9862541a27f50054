"""The smallest number of people that reaches a goal often enough, over numbers of trials.

Each point is 200 studies, those near the answer 1000. All points have the same people (common
random numbers), so that neighbours differ by less than their own errors say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.answers.intervals import proportion_ci
from analysis.power.studies import Chunk, Point, simulate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    Spread = Callable[[Callable[[Chunk], dict[str, Any]], list[Chunk]], Iterable[tuple[Chunk, Any]]]


FEW: Final = 200
MANY: Final = 1000
_STRIDE: Final = 1.6
"""From one number of people to the next, before the answer is between two."""
_CHUNK_S: Final = 2.0
_STUDY_S: Final = 0.008
_PERSON_S: Final = 0.0012
"""About what a study takes, and each of its people: it only sizes the chunks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """A point that was tried: how many of its studies reached the goal, and how they came out."""

    point: Point
    studies: int
    reached: int
    median: float
    """Of the number that decided, infinite where half of the studies leave it open."""
    covered: float
    """Share of the studies whose interval covered the truth."""

    @property
    def assurance(self) -> float:
        """Share of studies that reached the goal."""
        return self.reached / self.studies

    @property
    def limits(self) -> tuple[float, float]:
        """Its 95 % interval by the number of simulated studies (Wilson)."""
        return proportion_ci(self.reached, self.studies)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """The smallest number of people at one number of trials; none where the bounds hold none.

    `low` and `high` are its 95 % interval by the simulation, none where an end was not found.
    """

    trials_per_side: int
    participants: int | None
    low: int | None = None
    high: int | None = None


@dataclass(slots=True, kw_only=True)
class Trials:
    """All points of a study that were tried, each with its studies in their order."""

    study: str
    gains: str
    goal: str
    seed: int
    spread: Spread
    _found: dict[Point, dict[int, tuple[int, float, int]]] = field(default_factory=dict)

    def run(self, points: Iterable[Point], studies: int) -> list[Tried]:
        """Return each point with so many studies at least; only missing ones are simulated."""
        wanted = list(points)
        chunks = [
            chunk for point in dict.fromkeys(wanted) for chunk in self._missing(point, studies)
        ]
        for chunk, result in self.spread(simulate, chunks):
            of_point = self._found.setdefault(chunk.point, {})
            values = zip(result["reached"], result["number"], result["covered"], strict=True)
            for i, (reached, number, covered) in enumerate(values, start=chunk.first):
                of_point[i] = (reached, math.inf if number is None else number, covered)
        return [self.tried(point) for point in wanted]

    def tried(self, point: Point) -> Tried:
        """Return what is known of a point."""
        values = self._found[point].values()
        reached, numbers, covered = zip(*values, strict=True)
        return Tried(
            point=point,
            studies=len(reached),
            reached=sum(reached),
            median=float(np.median(numbers)),
            covered=float(np.mean(covered)),
        )

    def all(self) -> list[Tried]:
        """Return all that was tried, in the order of the points."""
        return [self.tried(point) for point in sorted(self._found)]

    def _missing(self, point: Point, studies: int) -> Iterator[Chunk]:
        """Cut what is missing into chunks, always at the same places: a kept one is found again."""
        known = self._found.get(point, {})
        size = max(1, round(_CHUNK_S / (_STUDY_S + _PERSON_S * point.participants)))
        for start, stop in ((0, FEW), (FEW, MANY)):
            for first in range(start, min(stop, studies), size):
                if first not in known:
                    yield Chunk(
                        study=self.study,
                        gains=self.gains,
                        goal=self.goal,
                        point=point,
                        first=first,
                        number=min(size, min(stop, studies) - first),
                        seed=self.seed,
                    )


def smallest(
    trials: Trials, at: Callable[[int], Point], participants: tuple[int, int], assurance: float
) -> Answer:
    """Find the smallest number of people, from one to another, that reaches the assurance.

    `at` makes a point of a number of people.
    """
    least, most = participants

    def share(number: int, studies: int = FEW) -> float:
        return trials.run([at(number)], studies)[0].assurance

    failing, passing = least - 1, least
    while share(passing) < assurance:
        failing = passing
        if passing == most:
            if trials.tried(at(most)).limits[1] < assurance:
                return Answer(trials_per_side=at(most).trials_per_side, participants=None)
            break
        passing = min(most, max(passing + 1, round(passing * _STRIDE)))
    else:
        while passing - failing > 1:
            middle = (passing + failing) // 2
            if share(middle) < assurance:
                failing = middle
            else:
                passing = middle
    # With more studies the answer may be a neighbour.
    number = passing
    while number < most and share(number, MANY) < assurance:
        number += 1
    while number > least and share(number - 1, MANY) >= assurance:
        number -= 1
    trials_per_side = at(number).trials_per_side
    if share(number, MANY) < assurance:
        return Answer(trials_per_side=trials_per_side, participants=None)
    low, high = _ends(trials, at, number, participants, assurance)
    return Answer(trials_per_side=trials_per_side, participants=number, low=low, high=high)


def _ends(
    trials: Trials,
    at: Callable[[int], Point],
    number: int,
    participants: tuple[int, int],
    assurance: float,
) -> tuple[int, int | None]:
    """Return the interval of the smallest number: where the points' own intervals hold it."""
    least, most = participants
    step = max(1, round(0.06 * number))
    low = number
    while low > least and trials.run([at(max(least, low - step))], MANY)[0].limits[1] >= assurance:
        low = max(least, low - step)
    high = number
    while trials.run([at(high)], MANY)[0].limits[0] < assurance:
        if high == most:
            return low, None
        high = min(most, high + step)
    return low, high
