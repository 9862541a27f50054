"""Goals of a study, and whether the analysis of its counts reaches them.

Each goal concerns a number that `tactstrip analyze` reports: the group's threshold, the difference
of two conditions, a row of levels.csv, the last row of blank.csv (docs/power.md, section 1).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, get_args

from analysis.counts.intervals import proportion_ci
from analysis.planning.estimates import detection_limits, group_difference, group_limits

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.planning.sessions import Counts


Kind = Literal["half-width", "difference", "detection", "false-alarms"]
_EXAMPLES: Final = "half-width=2dB, difference=1dB, detection=10%@95V, false-alarms=5%"
_FORM: Final = re.compile(
    r"(?P<kind>half-width|difference|detection|false-alarms)=(?P<number>[0-9.eE+-]+)(?P<unit>dB|%|)"
    r"(?:@(?P<level>[0-9.]+)V?)?"
)
_MAX_DB: Final = 40.0
_MAX_RATE: Final = 0.5
_DB_PER_DECADE: Final = 20.0


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
        match = _FORM.fullmatch(text.strip())
        message = f"goal must be such as {_EXAMPLES}; got {text}"
        if match is None:
            raise ValueError(message)
        try:
            number = float(match["number"])
            level = None if match["level"] is None else float(match["level"])
        except ValueError:
            raise ValueError(message) from None
        kind: Kind = next(kind for kind in get_args(Kind) if kind == match["kind"])
        in_db = kind in {"half-width", "difference"}
        if (match["unit"] == "dB") != in_db or (level is not None) != (kind == "detection"):
            raise ValueError(message)
        size = number / 100 if match["unit"] == "%" else number
        max_size, unit = (_MAX_DB, " dB") if in_db else (_MAX_RATE, "")
        if not 0 < size <= max_size:
            raise ValueError(f"goal {kind} must be > 0 and <= {max_size:g}{unit}; got {size:g}")
        return cls(kind=kind, size=size, level_vpp=level)

    @property
    def text(self) -> str:
        """The goal as half a sentence."""
        percent = f"{100 * self.size:.3g} %"
        return {
            "half-width": f"the group's threshold is known within +-{self.size:g} dB",
            "difference": f"a difference of {self.size:g} dB between the conditions is detected",
            "detection": f"the detection rate at {self.level_vpp or 0:g} V is known within "
            f"+-{percent}",
            "false-alarms": f"the false-alarm rate is shown to be at most {percent}",
        }[self.kind]


class Outcome(NamedTuple):
    """Whether a study reached its goal, by which number, and whether its interval holds the truth.

    The number is the half-width (dB or probability), the difference, or the upper limit; it is
    infinite where the interval is open.
    """

    reached: bool
    number: float
    covered: bool


_NO_INTERVAL: Final = Outcome(reached=False, number=math.inf, covered=True)


def evaluate(goal: Goal, conditions: Sequence[Counts], truth: float) -> Outcome:
    """Evaluate a study by its counts in each condition.

    `truth` is the true value of what is estimated: log10 of the threshold in Vpp, dB, or a rate.
    """
    first, *others = conditions
    people = len(first.guesses)
    match goal.kind:
        case "half-width" if people > 1:
            low, high = group_limits(first)
            number = _DB_PER_DECADE * _half(low, high)
            reached = number <= goal.size
        case "difference" if people > 1:
            difference_db, (low, high) = group_difference(first, others[0])
            number, reached = difference_db if math.isfinite(difference_db) else math.inf, low > 0
        case "detection":
            low, high = detection_limits(first, goal.level_vpp or 0.0)
            number = _half(low, high)
            reached = number <= goal.size
        case "false-alarms":
            low, high = proportion_ci(int(first.false_alarms.sum()), people * first.blanks)
            number, reached = high, high <= goal.size
        case _:
            return _NO_INTERVAL
    return Outcome(reached=bool(reached), number=number, covered=not (truth < low or truth > high))


def _half(low: float, high: float) -> float:
    """Return half the width of an interval; NaN limits, which are open, count as infinite."""
    half = (high - low) / 2
    return half if math.isfinite(half) else math.inf
