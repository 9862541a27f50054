"""The smallest number of people that reaches a goal often enough, over trials and blanks.

Each point is 200 studies, those near the answer 1000. All points have the same people (common
random numbers), so that neighbours differ by less than their own errors say.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.answers.intervals import proportion_ci
from analysis.power.studies import Chunk, Point, simulate
from analysis.workers import CHUNK_S

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    Spread = Callable[
        [Callable[[Chunk], dict[str, Any]], Iterable[Chunk]], Iterable[tuple[Chunk, Any]]
    ]


FEW: Final = 200
MANY: Final = 1000
_STRIDE: Final = 1.6
"""From one number of people to the next, before the answer is between two."""
_STUDY_S: Final = 0.008
_PERSON_S: Final = 0.0012
"""About what a study takes, and each of its people: it only sizes the chunks."""
_TIMED: Final = 3
_FEWER: Final = 0.6
"""Of the people of the answer, where levers are tried: at the answer itself little is left."""
_MORE: Final = 1.5


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

    point: Point
    participants: int | None
    low: int | None = None
    high: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Lever:
    """What a change of the design does: the same people, a share of them more that reach it."""

    change: str
    before: Tried
    after: Tried

    @property
    def gain(self) -> float:
        """More of the studies that reach the goal."""
        return self.after.assurance - self.before.assurance


@dataclass(slots=True, kw_only=True)
class Trials:
    """All points of a study that were tried, each with its studies in their order."""

    plan: str
    seed: int
    spread: Spread
    step: Callable[[float], object] = lambda _: None
    """Told how much more work is done, as `work_of` has it."""
    _found: dict[Point, dict[int, tuple[int, float, int]]] = field(default_factory=dict)

    def run(self, points: Iterable[Point], studies: int = FEW) -> list[Tried]:
        """Return each point with so many studies at least; only missing ones are simulated."""
        wanted = list(points)
        distinct = dict.fromkeys(wanted)
        chunks = [one for point in distinct for one in self._missing(point, studies)]
        for chunk, result in self.spread(simulate, chunks):
            of_point = self._found.setdefault(chunk.point, {})
            values = zip(result["reached"], result["number"], result["covered"], strict=True)
            for i, (reached, number, covered) in enumerate(values, start=chunk.first):
                of_point[i] = (reached, math.inf if number is None else number, covered)
            self.step(work_of(chunk.point, chunk.number))
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
        return [self.tried(point) for point in sorted(self._found, key=_in_table)]

    def _missing(self, point: Point, studies: int) -> Iterator[Chunk]:
        """Cut what is missing into chunks, always at the same places: a kept one is found again."""
        known = self._found.get(point, {})
        size = max(1, round(CHUNK_S / work_of(point, 1)))
        for start, stop in ((0, FEW), (FEW, MANY)):
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


def smallest(trials: Trials, at: Point, participants: tuple[int, int], assurance: float) -> Answer:
    """Find the smallest number of people, from one to another, that reaches the assurance.

    All else is as in the point `at`.
    """
    least, most = participants

    def share(number: int, studies: int = FEW) -> Tried:
        return trials.run([replace(at, participants=number)], studies)[0]

    number = _first_guess(share, participants, assurance)
    # With more studies the answer may be a neighbour.
    while share(number).limits[1] >= assurance > share(number, MANY).assurance and number < most:
        number += 1
    while number > least and share(number - 1, MANY).assurance >= assurance:
        number -= 1
    if share(number).assurance < assurance:
        return Answer(point=at, participants=None)
    # Its interval: numbers whose own intervals hold the assurance.
    step = max(1, round(0.06 * number))
    low, high = number, number
    while low > least and share(max(least, low - step), MANY).limits[1] >= assurance:
        low = max(least, low - step)
    while share(high, MANY).limits[0] < assurance and high < most:
        high = min(most, high + step)
    known = share(high, MANY).limits[0] >= assurance
    return Answer(point=at, participants=number, low=low, high=high if known else None)


def _first_guess(
    share: Callable[[int], Tried], participants: tuple[int, int], assurance: float
) -> int:
    """Return the least number by few studies of each; the most where none of them reaches it."""
    failing, passing = participants[0] - 1, participants[0]
    while share(passing).assurance < assurance:
        if passing == participants[1]:
            return passing
        failing = passing
        passing = min(participants[1], max(passing + 1, round(passing * _STRIDE)))
    while passing - failing > 1:
        middle = (passing + failing) // 2
        if share(middle).assurance < assurance:
            failing = middle
        else:
            passing = middle
    return passing


def levers(
    trials: Trials,
    answer: Answer,
    participants: tuple[int, int],
    kind: str,
    levels: int,
) -> tuple[Lever, ...]:
    """Return what changes of the design do to a study of fewer people, the largest gain first.

    Changes that a `kind` of goal does not ask about are left out; `levels` is their number.
    """
    least, most = participants
    number = max(least, round(_FEWER * (answer.participants or most)))
    base = replace(answer.point, participants=number)
    more = math.ceil(_MORE * number)
    changes = {f"{more} people instead of {number}": replace(base, participants=more)}
    if kind != "false-alarms":
        longer = levels * math.ceil(_MORE * base.trials_per_side / levels)
        changes[f"{longer} trials of each side instead of {base.trials_per_side}"] = replace(
            base, trials_per_side=longer
        )
    if base.blanks and kind != "detection":
        changes[f"{2 * base.blanks} blanks instead of {base.blanks}"] = replace(
            base, blanks=2 * base.blanks
        )
    if kind in {"half-width", "difference"}:
        told = "the study's levels" if base.placed else "levels placed for each person"
        changes[f"{told} instead"] = replace(base, placed=not base.placed)
    before, *after = trials.run([base, *changes.values()])
    found = (
        Lever(change=change, before=before, after=one)
        for change, one in zip(changes, after, strict=True)
    )
    return tuple(sorted(found, key=lambda one: -one.gain))


def most_work(at: Iterable[Point], participants: tuple[int, int]) -> float:
    """Return what a search takes at most, in the unit of `work_of`."""
    least, most = participants
    ladder = [least]
    while ladder[-1] < most:
        ladder.append(min(most, max(ladder[-1] + 1, round(ladder[-1] * _STRIDE))))
    few = ladder + [most] * math.ceil(math.log2(max(2, most - ladder[-2] if ladder[1:] else 2)))
    return sum(
        sum(work_of(replace(point, participants=number), FEW) for number in few)
        + 4 * work_of(replace(point, participants=most), MANY - FEW)
        for point in at
    )


def work_of(point: Point, studies: int) -> float:
    """Return about how much processor time studies take, on a machine like ours, in s."""
    return studies * (_STUDY_S + _PERSON_S * point.participants)


def slower(trials: Trials, point: Point) -> float:
    """Return how many times `work_of` a point takes here, by a few studies."""
    chunk = Chunk(plan=trials.plan, point=point, first=0, number=1, seed=trials.seed)
    simulate(chunk)  # which reads the plan
    before_s = time.process_time()
    simulate(replace(chunk, number=_TIMED))
    return (time.process_time() - before_s) / work_of(point, _TIMED)
