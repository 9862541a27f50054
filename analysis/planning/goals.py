"""Goals of a study, and whether the analysis of its counts reaches them.

Each goal concerns a number that `tactstrip analyze` reports: the group's threshold, the difference
of two conditions, a row of levels.csv, the last row of blank.csv (docs/power.md, section 1).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, cast

import numpy as np

from analysis.counts.intervals import group_interval, proportion_ci
from analysis.thresholds.difference import difference_of
from analysis.thresholds.group import DB_PER_LOG10, group_fit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analysis.planning.sessions import Counts
    from analysis.thresholds.likelihood import Tables
    from experiment.tasks.task import Scoring


Kind = Literal["half-width", "difference", "detection", "false-alarms"]
_EXAMPLES: Final = "half-width=2dB, difference=1dB, detection=10%@95V, false-alarms=5%"
_NUMBER: Final = r"(-?[0-9]*\.?[0-9]+)"
_FORMS: Final = {
    "half-width": f"{_NUMBER}dB",
    "difference": f"{_NUMBER}dB",
    "detection": f"{_NUMBER}%?@{_NUMBER}V?",
    "false-alarms": f"{_NUMBER}%?",
}
_WORDS: Final[Mapping[Scoring, tuple[str, str]]] = {
    "forced-choice": ("threshold", "rate of correct answers"),
    "identification": ("threshold", "rate of correct answers"),
}
"""What a threshold and a detection rate are called where trials are scored so."""
_MAX_DB: Final = 40.0
_MAX_RATE: Final = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A goal: its kind, its size in dB or as a probability, and the level of a detection.

    ``half-width`` of the interval of the group's threshold, at most `size` dB; ``difference`` of
    `size` dB between the first two conditions, detected with its sign; ``detection`` at one level
    known within +- `size`; ``false-alarms`` to all blanks bounded at the rate `size`.
    """

    kind: Kind
    size: float
    level_vpp: float | None = None

    @classmethod
    def parse(cls, text: str) -> Goal:
        """Read a goal of the command line.

        >>> Goal.parse("half-width=1dB"), Goal.parse("detection=10%@95V").size
        (Goal(kind='half-width', size=1.0, level_vpp=None), 0.1)
        """
        kind, _, value = text.strip().partition("=")
        match = re.fullmatch(_FORMS.get(kind, "(?!)"), value)
        if match is None:
            raise ValueError(f"goal must be such as {_EXAMPLES}; got {text}")
        size, *level = map(float, match.groups())
        size = size / 100 if "%" in value else size
        max_size, unit = (_MAX_DB, " dB") if "dB" in value else (_MAX_RATE, "")
        if not 0 < size <= max_size:
            raise ValueError(f"goal {kind} must be > 0 and <= {max_size:g}{unit}; got {size:g}")
        return cls(kind=cast("Kind", kind), size=size, level_vpp=level[0] if level else None)

    def text(self, scoring: Scoring = "localisation") -> str:
        """Return the goal as half a sentence, in the words of a task's scoring."""
        percent = f"{100 * self.size:.3g} %"
        threshold, rate = _WORDS.get(scoring, ("threshold", "detection rate"))
        return {
            "half-width": f"the group's {threshold} is known within +-{self.size:g} dB",
            "difference": f"a difference of {self.size:g} dB between the conditions is detected",
            "detection": f"the {rate} at {self.level_vpp or 0:g} V is known within +-{percent}",
            "false-alarms": f"the false-alarm rate is shown to be at most {percent}",
        }[self.kind]


class Outcome(NamedTuple):
    """Whether a study reached its goal, by which number, and whether its interval holds the truth.

    The number is the half-width (dB or probability), the difference, or the upper limit; it is
    infinite where the interval is open. `unplaced` participants have the study's levels, because
    their pilot placed none.
    """

    reached: bool
    number: float
    covered: bool
    unplaced: int = 0


def evaluate(goal: Goal, conditions: Sequence[Counts], truth: float) -> Outcome:
    """Evaluate a study by its counts in each condition.

    `truth` is the true value of what is estimated: the threshold in Vpp, dB, or a rate.
    One participant has neither the threshold nor the difference of a group.
    """
    first, *others = conditions
    tables, people = first.tables, len(first.tables)
    match goal.kind:
        case "half-width" if people > 1:
            low, high = group_fit(tables).threshold_limits
            is_bounded = math.isfinite(high - low)
            number = DB_PER_LOG10 * math.log10(high / low) / 2 if is_bounded else math.inf
            reached = number <= goal.size
        case "difference" if people > 1:
            difference = difference_of(tables, others[0].tables, same_people=True)
            low, high = difference.difference_limits_db
            number, reached = difference.difference_db, low > 0
        case "detection":
            low, high = _detection_limits(tables, goal.level_vpp or 1.0)
            number = (high - low) / 2
            reached = number <= goal.size
        case "false-alarms":
            low, high = proportion_ci(int(first.false_alarms.sum()), people * first.blanks)
            number, reached = high, high <= goal.size
        case _:
            return Outcome(reached=False, number=math.inf, covered=True)
    number = number if math.isfinite(number) else math.inf
    return Outcome(bool(reached), number, covered=not (truth < low or truth > high))


def _detection_limits(tables: Tables, level_vpp: float) -> tuple[float, float]:
    """Return the 95 % limits of the detection rate at a level, of one participant or a group."""
    at_level = np.isclose(tables.levels, level_vpp)
    k, n = ((counts * at_level).sum(axis=1) for counts in (tables.detected, tables.presented))
    k, n = k[n > 0], n[n > 0]
    if not len(n):
        return math.nan, math.nan
    return group_interval(k, n) if len(tables) > 1 else proportion_ci(float(k[0]), float(n[0]))
