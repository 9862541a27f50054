"""What a search knows of its answer while it is under way."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from analysis.answers.intervals import proportion_ci
from analysis.power.promise import best_of
from analysis.power.search import PROBE, clear

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analysis.power.search import Answer, Trials
    from analysis.power.studies import Point

    Counted = Mapping[Point, tuple[int, int]]


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
