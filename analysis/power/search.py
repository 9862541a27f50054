"""The smallest number of people that reaches a goal often enough, over trials and blanks.

Each point is 200 studies, those near the answer 1000. All points have the same people (common
random numbers), so that neighbours differ by less than their own errors say. The number that these
studies choose passes in them by luck, too: what is told of it comes from 1000 others. One number by
itself is no choice: where it is clearly enough, fewer do.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.answers.intervals import proportion_ci
from analysis.power.studies import Chunk, Point, simulate
from analysis.workers.chunks import CHUNK_S

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    Spread = Callable[
        [Callable[[Chunk], dict[str, Any]], Iterable[Chunk]], Iterable[tuple[Chunk, Any]]
    ]


PROBE: Final = 40
"""Studies of each number of a ladder, all together: enough to rule most of them out."""
FEW: Final = 200
MANY: Final = 1000
CHECKED: Final = 2 * MANY
"""Of the answer: those from `MANY` on take no part in the search."""
FRESH: Final = 2 * FEW
"""Of one number alone that is clearly enough: those from the ones on that say so are told of it."""
_CLEAR: Final = 3.0
"""Standard errors from the assurance, from which a number of people is ruled out, or in."""
_STRIDE: Final = 1.6
"""From one number of people to the next, before the answer is between two."""
_STEP: Final = 0.05
"""From one number to the next, as a part of it, where the answer's neighbours are looked at."""
_PARTS: Final = 4
"""Into which the numbers between are cut, to be tried together."""
_GOLDEN: Final = 0.618
"""Whose multiples lie evenly between whole numbers, however many are taken."""
_STUDY_S: Final = 0.005
_PERSON_S: Final = 0.001
_PLACED_S: Final = 0.004
"""About what a study takes, each of its people, and placing levels for one: it sizes the chunks."""


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
    unplaced: float | None = None
    """Share of people on whose pilots no levels could be placed, where levels are placed."""

    @property
    def assurance(self) -> float:
        """Share of studies that reached the goal."""
        return self.reached / self.studies

    @property
    def limits(self) -> tuple[float, float]:
        """Its 95 % interval by the number of simulated studies (Wilson)."""
        return proportion_ci(self.reached, self.studies)

    def clear(self, assurance: float) -> int:
        """Tell whether more studies could change on which side of it the point lies.

        1 where it clearly reaches the assurance, -1 where it clearly does not, 0 between.
        """
        return clear(self.reached, self.studies, assurance)


def clear(reached: int, studies: int, assurance: float) -> int:
    """Tell on which side of the assurance so many of so many studies lie, as `Tried.clear` does."""
    error = math.sqrt(assurance * (1 - assurance) / studies)
    apart = reached / studies - assurance
    return 0 if abs(apart) <= _CLEAR * error else (1 if apart > 0 else -1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """The smallest number of people at one number of trials; none where the bounds hold none.

    `low` and `high` are its 95 % interval by the simulation, none where an end was not found;
    `checked` is how it does in studies that the search did not choose it by.
    """

    point: Point
    participants: int | None
    low: int | None = None
    high: int | None = None
    checked: Tried | None = None


_Study = tuple[int, float, int, int]
"""Whether it reached the goal, its number, whether it covered the truth, people without levels."""


@dataclass(slots=True, kw_only=True)
class Trials:
    """All points of a study that were tried, each with its studies in their order."""

    plan: str
    seed: int
    spread: Spread
    step: Callable[[float], object] = lambda _: None
    """Told how much more work is done, as `work_of` has it."""
    begun: Callable[[], object] = lambda: None
    """Called before each round of simulations."""
    _found: dict[Point, dict[int, _Study]] = field(default_factory=dict)

    def run(self, points: Iterable[Point], studies: int = FEW) -> list[Tried]:
        """Return each point with so many studies at least; only missing ones are simulated."""
        wanted = list(points)
        self.ask([(point, studies) for point in wanted])
        return [self.tried(point) for point in wanted]

    def ask(self, wanted: Iterable[tuple[Point, int]]) -> None:
        """Have points simulated with so many studies each at least, all of them at once."""
        self.begun()
        most: dict[Point, int] = {}
        for point, studies in wanted:
            most[point] = max(studies, most.get(point, 0))
        chunks = [one for point, studies in most.items() for one in self._missing(point, studies)]
        for chunk, result in self.spread(simulate, chunks):
            of_point = self._found.setdefault(chunk.point, {})
            unplaced = result.get("unplaced") or [0] * chunk.number
            values = zip(
                result["reached"], result["number"], result["covered"], unplaced, strict=True
            )
            for i, (reached, number, *others) in enumerate(values, start=chunk.first):
                of_point[i] = (reached, math.inf if number is None else number, *others)
            self.step(work_of(chunk.point, chunk.number))

    def tried(self, point: Point, first: int = 0) -> Tried:
        """Return what is known of a point, by its studies from the first on."""
        values = [one for study, one in self._found[point].items() if study >= first]
        reached, numbers, covered, unplaced = zip(*values, strict=True)
        people = point.participants * len(reached)
        return Tried(
            point=point,
            studies=len(reached),
            reached=sum(reached),
            median=float(np.median(numbers)),
            covered=float(np.mean(covered)),
            unplaced=sum(unplaced) / people if point.placed else None,
        )

    def counted(self) -> dict[Point, tuple[int, int]]:
        """Return how many studies of each point reached the goal so far, and of how many."""
        return {
            point: (sum(reached for reached, *_ in of_point.values()), len(of_point))
            for point, of_point in self._found.items()
        }

    def numbers(self, point: Point) -> list[float]:
        """Return the number that decided in each study of a point; an open one is infinite."""
        return [number for _, number, *_ in self._found.get(point, {}).values()]

    def all(self) -> list[Tried]:
        """Return all that was tried, in the order of the points."""
        known = [point for point, of_point in self._found.items() if of_point]
        return [self.tried(point) for point in sorted(known, key=_in_table)]

    def imagined(self, share: Callable[[Point], float]) -> Trials:
        """Return trials that know what these do and only imagine what these would simulate.

        Of the studies of a point so large a share reaches the goal as `share` says.
        """

        def evenly(_: object, chunks: Iterable[Chunk]) -> Iterator[tuple[Chunk, Any]]:
            for one in chunks:
                studies = np.arange(one.first, one.first + one.number)
                reached = (studies * _GOLDEN % 1 < share(one.point)).tolist()
                yield one, dict.fromkeys(("reached", "number", "covered"), reached)

        found = {point: dict(of_point) for point, of_point in self._found.items()}
        return Trials(plan=self.plan, seed=self.seed, spread=evenly, _found=found)

    def _missing(self, point: Point, studies: int) -> Iterator[Chunk]:
        """Cut what is missing into chunks, always at the same places: a kept one is found again."""
        known = self._found.get(point, {})
        size = max(1, round(CHUNK_S / work_of(point, 1)))
        for start, stop in pairwise((0, PROBE, FEW, FRESH, MANY, CHECKED)):
            for first in range(start, min(stop, studies), size):
                if first not in known:
                    yield Chunk(
                        plan=self.plan,
                        point=point,
                        first=first,
                        number=min(size, min(stop, studies) - first),
                        seed=self.seed,
                    )


def _in_table(point: Point) -> tuple[bool, int, int, int]:
    return point.placed, point.blanks, point.trials_per_side, point.participants


_Asked = list[tuple[Point, int]]
Search = Generator[_Asked, None, Answer]
"""Asks for points with a number of studies, goes on when they are simulated, ends with its answer.

What it asks for hangs on what it found, never on who computes it or how fast.
"""


def answers(trials: Trials, searches: Iterable[Search]) -> tuple[Answer, ...]:
    """Return the answers of searches, which are simulated together: none waits for another."""
    going = dict(enumerate(searches))
    found: dict[int, Answer] = {}
    while going:
        wanted: list[tuple[Point, int]] = []
        for i, search in [*going.items()]:
            try:
                wanted += next(search)
            except StopIteration as end:
                found[i] = end.value
                del going[i]
        trials.ask(wanted)
    return tuple(found[i] for i in sorted(found))


def smallest(trials: Trials, at: Point, participants: tuple[int, int], assurance: float) -> Search:
    """Find the smallest number of people, from one to another, that reaches the assurance.

    All else is as in the point `at`.
    """
    numbers = _Numbers(trials, at, *participants, assurance)
    plain = yield from numbers.plainly()
    if plain is not None:
        alone = plain.point.participants
        return Answer(point=at, participants=alone, low=alone, high=alone, checked=plain)
    number = yield from numbers.first()
    if number is None:
        return Answer(point=at, participants=None)
    low, high = yield from numbers.around(number)
    checked = yield from numbers.checked(number)
    if checked is None:
        return Answer(point=at, participants=None)
    number = checked.point.participants
    high = None if high is None else max(number, high)
    return Answer(point=at, participants=number, low=low, high=high, checked=checked)


@dataclass(frozen=True, slots=True)
class _Numbers:
    """Numbers of people of one design."""

    trials: Trials
    at: Point
    least: int
    most: int
    assurance: float

    def of(self, number: int) -> Tried:
        """Return what is known of a number."""
        return self.trials.tried(replace(self.at, participants=number))

    def reaches(self, number: int) -> bool:
        """Tell whether it reaches the assurance; one below the least does not."""
        return number >= self.least and self.of(number).assurance >= self.assurance

    def asked(self, numbers: Iterable[int], studies: int) -> _Asked:
        """Ask for those within the bounds."""
        inside = sorted({number for number in numbers if self.least <= number <= self.most})
        return [(replace(self.at, participants=number), studies) for number in inside]

    def plainly(self) -> Generator[_Asked, None, Tried | None]:
        """Return how one number alone does in fresh studies, where few say that it is enough.

        None where it is one of several, not enough, near the assurance, or ruled out by these: the
        search goes on.
        """
        if self.least < self.most:
            return None
        for few, all_of_them in ((PROBE, FEW), (FEW, FRESH)):
            yield self.asked([self.most], few)
            said = self.of(self.most).clear(self.assurance)
            if said < 0:
                return None
            if said > 0:
                yield self.asked([self.most], all_of_them)
                found = self.trials.tried(replace(self.at, participants=self.most), few)
                return found if found.limits[1] >= self.assurance else None
        return None

    def first(self) -> Generator[_Asked, None, int | None]:
        """Find the least number that reaches the assurance."""
        # Many workers have something to do where all of a ladder is asked for at once.
        ladder = _ladder(self.least, self.most)
        yield self.asked(ladder, PROBE)
        clear = {number: self.of(number).clear(self.assurance) for number in ladder}
        if clear[self.most] < 0:
            yield self.asked([self.most], FEW)
            return None
        failing = max((one for one in ladder if clear[one] < 0), default=self.least - 1)
        passing = min(one for one in ladder if one > failing and (clear[one] or one == self.most))
        number = yield from self.first_between(failing, passing, FEW)
        # With more studies the answer may be a neighbour.
        yield self.asked([number - 1, number], MANY)
        failing, passing = number - 1, number
        while not self.reaches(passing):
            if passing == self.most:
                return None
            failing, passing = passing, min(self.most, passing + _step(number))
            yield self.asked([passing], MANY)
        while self.reaches(failing):
            failing, passing = max(self.least - 1, failing - _step(number)), failing
            yield self.asked([failing], MANY)
        return (yield from self.first_between(failing, passing, MANY))

    def first_between(
        self, failing: int, passing: int, studies: int
    ) -> Generator[_Asked, None, int]:
        """Find the first that reaches it between one that does not and one that does."""
        while passing - failing > 1:
            gap = passing - failing
            between = sorted({failing + max(1, gap * i // _PARTS) for i in range(1, _PARTS)})
            yield self.asked(between, studies)
            passing = min([passing, *(one for one in between if self.reaches(one))])
            failing = max([failing, *(one for one in between if one < passing)])
        return passing

    def around(self, number: int) -> Generator[_Asked, None, tuple[int, int | None]]:
        """Find the interval of the answer: numbers whose own intervals hold the assurance."""
        low, high, searching = number, number, True
        while searching:
            below, above = (
                max(self.least, low - _step(number)),
                min(self.most, high + _step(number)),
            )
            ends = {below, above}
            yield self.asked(ends, FEW)
            # What a few studies rule out, or in, needs no more.
            yield self.asked((one for one in ends if not self.of(one).clear(self.assurance)), MANY)
            lower = below < low and self.of(below).limits[1] >= self.assurance
            higher = above > high and self.of(high).limits[0] < self.assurance
            low, high = below if lower else low, above if higher else high
            searching = lower or higher
        return low, high if self.of(high).limits[0] >= self.assurance else None

    def checked(self, number: int) -> Generator[_Asked, None, Tried | None]:
        """Hold a number against fresh studies, and the next where they rule it out.

        To ask that they reach the assurance, too, would choose by their luck again.
        """
        while True:
            yield self.asked([number], CHECKED)
            found = self.trials.tried(replace(self.at, participants=number), MANY)
            if found.limits[1] >= self.assurance:
                return found
            if number == self.most:
                return None
            number = min(self.most, number + _step(number))


def _step(number: int) -> int:
    return max(1, round(_STEP * number))


def _ladder(least: int, most: int) -> list[int]:
    """Return numbers of people from one to another, ever farther apart.

    >>> _ladder(2, 40)
    [2, 3, 5, 8, 13, 21, 34, 40]
    """
    ladder = [least]
    while ladder[-1] < most:
        ladder.append(min(most, max(ladder[-1] + 1, round(ladder[-1] * _STRIDE))))
    return ladder


def work_of(point: Point, studies: int) -> float:
    """Return about how much processor time studies take, on a machine like ours, in s."""
    person_s = _PERSON_S + _PLACED_S * point.placed
    return studies * (_STUDY_S + person_s * point.participants)
