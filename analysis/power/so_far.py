"""What a search knows of its answer while it is under way, and how much is ahead of it.

What is ahead hangs on where the answer lies. So the rest of the search is gone through with studies
that are only imagined: as many of them reach the goal as a curve through the simulated ones says.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from analysis.answers.intervals import proportion_ci
from analysis.power.promise import best_of
from analysis.power.search import PROBE, clear, work_of
from analysis.power.studies import Chunk, simulate

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from analysis.power.search import Answer, Trials
    from analysis.power.studies import Point

    Floats = NDArray[np.float64]
    Counted = Mapping[Point, tuple[int, int]]


_SLOPES: Final = {"half-width": 5.0, "detection": 5.0, "difference": 1.4, "false-alarms": 1.4}
"""Normal quantiles by which more studies reach a goal with e times the people, nearly."""
_BEYOND: Final = 3.0
"""Times the most people: about there lies an answer that a search does not come near."""
_MIDDLES: Final = 80
_TIMED_S: Final = 0.1
_MOST_TIMED: Final = 200
"""Studies by which the speed of a computer is measured: so long or so many."""


@dataclass(slots=True, kw_only=True)
class SoFar:
    """The numbers of people that the studies simulated so far leave.

    It only looks on: neither what is simulated nor the order of it hangs on it.
    """

    trials: Trials
    points: Sequence[Point]
    participants: tuple[int, int]
    assurance: float
    answers: Sequence[Answer] = ()
    """Those of the search, once it is over and what other designs change is simulated."""

    def words(self) -> str:
        """Say what is known so far; empty text where that is nothing yet."""
        counted, (least, most) = self.trials.counted(), self.participants
        single = least == most and len(self.points) == 1
        share = _share(*counted.get(self._at(0, least), (0, 0))) if single else ""
        if self.answers:
            best = best_of(self.answers)
            known = _up_to(most) if best is None else _people(best.participants or 0)
            return f"{share or known}, now other designs"
        if single:
            return share
        left = [self._left(counted, design) for design in range(len(self.points))]
        some = [one for one in left if one is not None]
        return _between(some, least) if some else f"so far {_up_to(most)}"

    def left(self) -> tuple[int, int] | None:
        """Return the numbers between which the answers lie, where both ends are known."""
        counted = self.trials.counted()
        found = [self._left(counted, design) for design in range(len(self.points))]
        left = [one for one in found if one is not None]
        if len(left) < len(found) or any(one.high == math.inf for one in left):
            return None
        return min(one.low for one in left), int(max(one.high for one in left))

    def _at(self, design: int, number: int) -> Point:
        return replace(self.points[design], participants=number)

    def _left(self, counted: Counted, design: int) -> _Left | None:
        """Return what is left of the numbers of a design; none if not one reaches the assurance."""
        least, most = self.participants
        low, perhaps, high = least, math.inf, math.inf
        for number in range(least, most + 1):
            reached, studies = counted.get(self._at(design, number), (0, 0))
            if studies < PROBE:
                continue
            side = clear(reached, studies, self.assurance)
            if side < 0:
                low, perhaps, high = number + 1, math.inf, math.inf
            elif side > 0:
                high = min(high, number)
            if reached >= self.assurance * studies:
                perhaps = min(perhaps, number)
        return None if low > most else _Left(low, perhaps, high)


class _Left(NamedTuple):
    """The least number not ruled out, the least that may do, and the least that is enough.

    The latter two are infinite where none is known.
    """

    low: int
    perhaps: float
    high: float


def _between(left: Sequence[_Left], least: int) -> str:
    """Say between which numbers the answers of designs lie.

    >>> _between([_Left(19, 24, 25)], 2), _between([_Left(2, 5, 8)], 2)
    ('so far 19 to 25 participants', 'so far at most 8 participants')
    >>> _between([_Left(14, 40, math.inf), _Left(9, math.inf, math.inf)], 2)
    'so far more than 8, perhaps 40 participants'
    """
    low, perhaps, high = (min(of) for of in zip(*left, strict=True))
    if math.inf in {one.high for one in left}:
        more = f"more than {low - 1}" if low > least else ""
        if perhaps == math.inf:
            return f"so far more than {_people(low - 1)}" if more else ""
        return f"so far {', '.join([more] * bool(more) + [f'perhaps {perhaps:g}'])} participants"
    high = max(one.high for one in left)
    if low == least:
        return f"so far at most {_people(high)}"
    return f"so far {_people(high)}" if low == high else f"so far {low:g} to {_people(high)}"


def _share(reached: int, studies: int) -> str:
    if not studies:
        return ""
    low, high = proportion_ci(reached, studies)
    return f"so far {reached / studies:.0%} ({low:.0%} to {high:.0%})"


def _up_to(most: int) -> str:
    return f"no number up to {_people(most)}"


def _people(number: float) -> str:
    return f"{number:g} participant{'' if number == 1 else 's'}"


@dataclass(slots=True, kw_only=True)
class Ahead:
    """How much work a search still needs, about, in the unit of `work_of`."""

    trials: Trials
    points: Sequence[Point]
    participants: tuple[int, int]
    assurance: float
    kind: str
    search: Callable[[Trials], object]
    """All of it, on other trials."""

    def work(self) -> float:
        """Return what is ahead, by what was found so far."""
        return self._of([self._middle(point) for point in self.points])

    def between(self) -> tuple[float, float]:
        """Return the least and most that it takes as a whole, by where the answer may lie."""
        least, most = self.participants
        middles = (least / _BEYOND, least, math.sqrt(least * most), most, _BEYOND * most)
        works = [self._of([middle] * len(self.points)) for middle in middles]
        return min(works), max(works)

    def _of(self, middles: Sequence[float]) -> float:
        by_design = dict(zip((_design(one) for one in self.points), middles, strict=True))

        def share(point: Point) -> float:
            middle = by_design.get(_design(point), middles[0])
            return float(self._share(np.array([middle]), point.participants)[0])

        parts: list[float] = []
        imagined = self.trials.imagined(share)
        imagined.step = parts.append
        self.search(imagined)
        return sum(parts)

    def _share(self, middles: Floats, participants: int) -> Floats:
        """Return which share reaches the goal, by how many people reach it as often as wanted."""
        from scipy.special import ndtr

        wanted = NormalDist().inv_cdf(self.assurance)
        shares: Floats = ndtr(wanted + _SLOPES[self.kind] * np.log(participants / middles))
        return np.clip(shares, 0.001, 0.999)

    def _middle(self, point: Point) -> float:
        """Return the number of people that most likely reaches the goal as often as wanted."""
        least, most = self.participants
        middles = np.geomspace(least / _BEYOND, _BEYOND * most, _MIDDLES)
        likelihood = np.zeros(_MIDDLES)
        for one, (reached, studies) in self.trials.counted().items():
            if _design(one) == _design(point):
                shares = self._share(middles, one.participants)
                likelihood += reached * np.log(shares) + (studies - reached) * np.log1p(-shares)
        return float(middles[np.argmax(likelihood)])


def _design(point: Point) -> Point:
    return replace(point, participants=1)


def slower(trials: Trials, point: Point) -> float:
    """Return how many times `work_of` a point takes here, by a few studies."""
    chunk = Chunk(plan=trials.plan, point=point, first=0, number=1, seed=trials.seed)
    simulate(chunk)  # which reads the plan
    number, took_s = 1, 0.0
    while took_s < _TIMED_S and number < _MOST_TIMED:
        number = min(_MOST_TIMED, 4 * number)
        before_s = time.process_time()
        simulate(replace(chunk, number=number))
        took_s = time.process_time() - before_s
    return took_s / work_of(point, number)
