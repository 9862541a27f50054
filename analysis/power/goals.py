"""What a study is to reach, and whether the analysis of its counts says that it did.

Each goal asks what `tactstrip analyze` prints: the group's threshold, the difference of two
conditions, a row of levels.csv, the last row of blank.csv (docs/power.md, section 1).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, get_args

import numpy as np

from analysis.answers.intervals import group_interval, proportion_ci
from analysis.groups.group import difference_on_axis, threshold_on_axis
from analysis.groups.hierarchy import PeopleTables

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.power.counts import Counts


Kind = Literal["half-width", "difference", "detection", "false-alarms"]
_EXAMPLES: Final = "half-width=1dB, difference=1dB, detection=10%@95V, false-alarms=5%"
_FORM: Final = re.compile(
    r"(?P<kind>[a-z-]+)=(?P<number>[0-9.eE+-]+)(?P<unit>dB|%|)"
    r"(?:@(?P<level>[0-9.]+)V?)?"
)
_MOST_DB: Final = 40.0
_DB_PER_DECADE: Final = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A goal: its kind, how small or large, and of a detection the level.

    Attributes
    ----------
    kind : str
        ``half-width`` of the interval of the group's threshold, at most `size` dB; ``difference``
        of `size` dB between the first two conditions, found with its sign; ``detection`` at one
        level known within +- `size`; ``false-alarms`` of all blanks bounded at the rate `size`.
    size : float
        dB, or a probability.
    level_vpp : float or None
        Of a detection.
    """

    kind: Kind
    size: float
    level_vpp: float | None = None

    @classmethod
    def parse(cls, text: str) -> Goal:
        """Read a goal as the command line has it.

        >>> Goal.parse("half-width=1dB"), Goal.parse("detection=10%@95V").size
        (Goal(kind='half-width', size=1.0, level_vpp=None), 0.1)
        """
        found = _FORM.fullmatch(text.strip())
        kinds = get_args(Kind)
        refused = f"goal must be such as {_EXAMPLES}; got {text}"
        if found is None or found["kind"] not in kinds:
            raise ValueError(refused)
        try:
            number = float(found["number"])
            level = None if found["level"] is None else float(found["level"])
        except ValueError:
            raise ValueError(refused) from None
        kind: Kind = next(one for one in kinds if one == found["kind"])
        in_db = kind in {"half-width", "difference"}
        if (found["unit"] == "dB") != in_db or (level is not None) != (kind == "detection"):
            raise ValueError(refused)
        size = number / 100 if found["unit"] == "%" else number
        most = _MOST_DB if in_db else 0.5
        if not 0 < size <= most:
            unit = " dB" if in_db else ""
            unsigned = ", without a sign: either is found alike" * (
                kind == "difference" and size < 0
            )
            raise ValueError(
                f"goal {kind} must be > 0 and at most {most:g}{unit}{unsigned}; got {size:g}"
            )
        return cls(kind=kind, size=size, level_vpp=level)

    @property
    def words(self) -> str:
        """Say what is to be reached."""
        return {
            "half-width": f"the group's threshold known within +-{self.size:g} dB (95 %)",
            "difference": f"a difference of {self.size:g} dB between two conditions found (95 %)",
            "detection": f"detection at {self.level_vpp or 0:g} V known within "
            f"+-{100 * self.size:.3g} % (95 %)",
            "false-alarms": f"false alarms bounded at {100 * self.size:.3g} % (95 %)",
        }[self.kind]


class Outcome(NamedTuple):
    """What a study reached: whether its goal, the number that decided, whether truth was covered.

    The number is the half-width (dB or probability), the difference found, or the upper limit; an
    open one is infinite.
    """

    reached: bool
    number: float
    covered: bool


def judged(goal: Goal, people: Sequence[Sequence[Counts]], truth: float) -> Outcome:
    """Return what a study reached: `people` of each condition, and the `truth` of its population.

    The truth is that of the number that is asked for: log10 of the threshold in Vpp, dB, a
    probability.
    """
    return _JUDGES[goal.kind](goal, people, truth)


def _half_width(goal: Goal, people: Sequence[Sequence[Counts]], truth: float) -> Outcome:
    if len(people[0]) == 1:
        return Outcome(reached=False, number=math.inf, covered=True)
    low, high = threshold_on_axis(_tables(people[0])).threshold_limits
    half_db = _DB_PER_DECADE * (high - low) / 2
    if not math.isfinite(half_db):
        half_db = math.inf
    return Outcome(
        reached=half_db <= goal.size,
        number=half_db,
        covered=not (truth < low or truth > high),
    )


def _difference(_: Goal, people: Sequence[Sequence[Counts]], truth: float) -> Outcome:
    if len(people[0]) == 1:
        return Outcome(reached=False, number=math.inf, covered=True)
    found = difference_on_axis(_tables(people[0]), _tables(people[1]), same_people=True)
    low, high = found.difference_limits_db
    number = found.difference_db if math.isfinite(found.difference_db) else math.inf
    return Outcome(reached=low > 0, number=number, covered=low <= truth <= high)


def _detection(goal: Goal, people: Sequence[Sequence[Counts]], truth: float) -> Outcome:
    cells = [
        (one.detected[i], one.presented[i])
        for one in people[0]
        for i in np.flatnonzero(np.asarray(one.levels_vpp) == goal.level_vpp)
        if one.presented[i]
    ]
    if not cells:
        return Outcome(reached=False, number=math.inf, covered=True)
    detected, presented = zip(*cells, strict=True)
    low, high = (
        proportion_ci(detected[0], presented[0])
        if len(people[0]) == 1
        else group_interval(detected, presented)
    )
    half = (high - low) / 2 if math.isfinite(high - low) else math.inf
    return Outcome(reached=half <= goal.size, number=half, covered=low <= truth <= high)


def _false_alarms(goal: Goal, people: Sequence[Sequence[Counts]], truth: float) -> Outcome:
    answered = sum(one.false_alarms for one in people[0])
    low, high = proportion_ci(answered, sum(one.blanks for one in people[0]))
    return Outcome(reached=high <= goal.size, number=high, covered=low <= truth <= high)


_JUDGES: Final = {
    "half-width": _half_width,
    "difference": _difference,
    "detection": _detection,
    "false-alarms": _false_alarms,
}


def _tables(people: Sequence[Counts]) -> PeopleTables:
    shape = (len(people), max(len(one.levels_vpp) for one in people))
    levels_vpp, detected, presented = np.ones(shape), np.zeros(shape), np.zeros(shape)
    for row, one in enumerate(people):
        used = slice(len(one.levels_vpp))
        levels_vpp[row, used] = one.levels_vpp
        detected[row, used], presented[row, used] = one.detected, one.presented
    return PeopleTables(
        x=np.log10(levels_vpp),
        detected=detected,
        presented=presented,
        guesses=[one.guess for one in people],
        x_scale="log10",
    )
