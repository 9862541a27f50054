"""What a study's other designs change: more people, trials or blanks, and other levels.

More people than were simulated are left to a rule of thumb.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import stdtrit

from analysis.power.search import FEW, PROBE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from analysis.power.goals import Goal
    from analysis.power.search import Answer, Trials, Tried

    Floats = NDArray[np.float64]


_FEWER: Final = 0.6
"""Of the people of the answer, where levers are tried: at the answer itself little is left."""
_MORE: Final = 1.5
_FEWEST: Final = 6
"""People from whom on the rule of thumb holds, nearly."""
_MOST: Final = 1000
_WITHOUT_RULE: Final = 4
"""Times as many people are asked next where there is no rule."""
_OPEN: Final = 0.9
_MANY_PEOPLE: Final = 10
"""Of so many, an interval that is nearly always open stays so, whoever takes part."""
_ABOUT: Final = 0.1
"""The least part of a number of the rule of thumb by which it may be wrong."""
_FOUND: Final = 0.1
"""A smaller share of differences found says little of their size: 2.5 % are found where is none."""


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

    @property
    def by_chance(self) -> bool:
        """Whether so many studies may differ by the gain without a cause, at about 5 %.

        Both have random numbers in common, which makes chance smaller than is reckoned here.
        """
        both = (self.before, self.after)
        shares = [(tried.reached + 1) / (tried.studies + 2) for tried in both]
        variance = sum(
            share * (1 - share) / tried.studies for share, tried in zip(shares, both, strict=True)
        )
        return abs(self.gain) <= 2 * math.sqrt(variance)


def levers(
    trials: Trials,
    answer: Answer,
    participants: tuple[int, int],
    kind: str,
    levels: int,
    *,
    in_volts: bool,
) -> tuple[Lever, ...]:
    """Return what changes of the design do to a study of fewer people, the largest gain first.

    They begin with a part of the answer's people or, where no number does, with the most. Changes
    that a `kind` of goal does not ask about are left out; `levels` is their number. Levels are
    placed `in_volts` only, as a pilot goes up to the device's highest.
    """
    least, most = participants
    number = most
    if answer.participants is not None:
        number = max(least, round(_FEWER * answer.participants))
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
    if kind in {"half-width", "difference"} and in_volts:
        told = "the study's levels" if base.placed else "levels placed for each person"
        changes[f"{told} instead"] = replace(base, placed=not base.placed)
    studies = PROBE if answer.participants is None else FEW
    before, *after = trials.run([base, *changes.values()], studies)
    found = (
        Lever(change=change, before=before, after=one)
        for change, one in zip(changes, after, strict=True)
    )
    return tuple(sorted(found, key=lambda one: -one.gain))


@dataclass(frozen=True, slots=True, kw_only=True)
class Thumb:
    """Numbers of people by a rule of thumb: about as many, from `low` to `high`; none if no rule.

    `words` say the same, or why there is none.
    """

    words: str
    participants: int | None = None
    low: int | None = None
    high: int | None = None


def thumb(trials: Trials, base: Tried, goal: Goal, assurance: float, rate: float | None) -> Thumb:
    """Return about how many people reach the goal, from what the studies of a point came to.

    An interval of the threshold narrows as t / sqrt(n), t of n - 1 degrees of freedom, one of a
    detection as 1 / sqrt(n), and how much both differ between studies as 1 / sqrt(n), too; a
    difference is found as often as a t-test finds it, nearly.
    False alarms of a `rate` are bounded by the score test's limit.
    """
    people = base.point.participants
    if people < _FEWEST and goal.kind != "false-alarms":
        return _without(f"from fewer than {_FEWEST} people", _FEWEST)
    if goal.kind == "difference":
        if base.assurance < _FOUND:
            return _without(f"where {base.assurance:.0%} of studies find the difference", people)
        enough = [_found(share, people, assurance) for share in (base.assurance, *base.limits)]
    elif goal.kind == "false-alarms":
        if rate is None or rate >= goal.size:
            return Thumb(words="")
        enough = [_bounded(rate, goal.size, base.point.blanks, assurance)] * 3
    else:
        numbers = np.array(trials.numbers(base.point))
        median, wide = np.quantile(numbers, (0.5, assurance), method="inverted_cdf").tolist()
        if not math.isfinite(max(median, wide)):
            return _open(float(np.isinf(numbers).mean()), people)
        # Few people widen a threshold's interval by t; a share's comes from another analysis.
        numbers_of, t = _numbers()
        width = (t if goal.kind == "half-width" else 1.0) / np.sqrt(numbers_of)
        known = (people, median, wide)
        enough = [_narrow(known, goal.size, width, power) for power in (0.5, 0.0, 1.0)]
    return _about(*enough, than=people, more=base.assurance < assurance, why=_WHY[goal.kind])


_WHY: Final = {
    "half-width": "an interval narrows with the square root of their number",
    "detection": "an interval narrows with the square root of their number",
    "difference": "by a normal approximation from the share that found it here",
    "false-alarms": "by a normal approximation from the rate below",
}


def _about(number: int, *others: int, than: int, more: bool, why: str) -> Thumb:
    if number > _MOST:
        return Thumb(words=f"By a rule of thumb more than {_MOST} people would be needed ({why}).")
    low = min(*others, math.floor((1 - _ABOUT) * number))
    high = min(_MOST, max(*others, math.ceil((1 + _ABOUT) * number)))
    if more:
        number, low, high = (max(one, than + 1) for one in (number, low, high))
    else:
        number, high = min(number, than), min(high, than)
        low = min(low, high)
    return Thumb(
        words=f"Rule of thumb, not simulated: about {number} participants ({why}); "
        f"try --participants {low} {high}.",
        participants=number,
        low=low,
        high=high,
    )


def _without(why: str, people: int) -> Thumb:
    least = people if people == _FEWEST else people + 1
    return Thumb(
        words=f"There is no rule of thumb {why}: "
        f"try --participants {least} {min(_MOST, _WITHOUT_RULE * people)}."
    )


def _open(share: float, people: int) -> Thumb:
    why = f"while an end of the interval is open in {share:.0%} of studies of {people} people"
    if share > _OPEN and people >= _MANY_PEOPLE:
        told = f"There is no rule of thumb {why}: other levels are needed, rather than more people."
        return Thumb(words=told)
    told = _without(why, people).words
    return Thumb(words=f"{told[:-1]}, or other levels.")


def _first(enough: NDArray[np.bool_]) -> int:
    """Return the first number of people from two on that is enough, or more than the most."""
    return 2 + int(np.argmax(enough)) if enough.any() else _MOST + 1


def _numbers() -> tuple[Floats, Floats]:
    """Return numbers of people, and the quantile of t by which their interval is wide."""
    people = np.arange(2.0, _MOST + 1, dtype=np.float64)
    t: Floats = stdtrit(people - 1, 0.975).astype(np.float64)
    return people, t


def _narrow(known: tuple[int, float, float], size: float, width: Floats, power: float) -> int:
    """Return how many have an interval of that size, by some people's median and wide one.

    The median is as `width` of the numbers of people; the wide ones approach it as that power of
    the number.
    """
    people, median, wide = known
    excess = (wide / median) ** ((people / _numbers()[0]) ** power)
    return _first(median * excess * width / width[people - 2] <= size)


def _found(share: float, people: int, assurance: float) -> int:
    """Return how many find a difference as often as wanted that some found in a share."""
    normal, (numbers, t) = NormalDist(), _numbers()
    share = min(max(share, 0.001), 0.999)
    size = (normal.inv_cdf(share) + t[people - 2]) / math.sqrt(people)
    return _first(size * np.sqrt(numbers) - t >= normal.inv_cdf(assurance))


def _bounded(rate: float, size: float, blanks: int, assurance: float) -> int:
    """Return how many people's blanks bound a rate as often as wanted."""
    normal, (numbers, _) = NormalDist(), _numbers()
    errors = normal.inv_cdf(0.975) * math.sqrt(size * (1 - size))
    errors += normal.inv_cdf(assurance) * math.sqrt(rate * (1 - rate))
    return _first(errors / np.sqrt(blanks * numbers) <= size - rate)
