"""What a search knows of its answer while it is under way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

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

    def _left(self, counted: Counted, design: int) -> tuple[int, int | None] | None:
        """Return from which number to which the answer of a design is; none if none reaches it.

        The latter is none while no number is known to be enough.
        """
        least, most = self.participants
        low, high = least, None
        for number in range(least, most + 1):
            reached, studies = counted.get(self._at(design, number), (0, 0))
            side = clear(reached, studies, self.assurance) if studies >= PROBE else 0
            if side < 0:
                low, high = number + 1, None
            elif side > 0 and high is None:
                high = number
        return None if low > most else (low, high)


def _between(left: Sequence[tuple[int, int | None]], least: int) -> str:
    """Say between which numbers the answers of designs lie.

    >>> _between([(19, 25)], 2), _between([(2, 8)], 2)
    ('so far 19 to 25 participants', 'so far at most 8 participants')
    >>> _between([(14, None), (9, 30)], 2)
    'so far more than 8 participants'
    """
    lows, highs = zip(*left, strict=True)
    low, high = min(lows), None if None in highs else max(highs)
    if high is None:
        return "" if low == least else f"so far more than {_people(low - 1)}"
    if low == least:
        return f"so far at most {_people(high)}"
    return f"so far {_people(high)}" if low == high else f"so far {low} to {_people(high)}"


def _share(reached: int, studies: int) -> str:
    if not studies:
        return ""
    low, high = proportion_ci(reached, studies)
    return f"so far {reached / studies:.0%} ({low:.0%} to {high:.0%})"


def _up_to(most: int) -> str:
    return f"no number up to {_people(most)}"


def _people(number: int) -> str:
    return f"{number} participant{'' if number == 1 else 's'}"
