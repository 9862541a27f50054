"""What a study's other designs change: more people, trials or blanks, and other levels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from analysis.power.search import FEW, PROBE

if TYPE_CHECKING:
    from analysis.power.search import Answer, Trials, Tried


_FEWER: Final = 0.6
"""Of the people of the answer, where levers are tried: at the answer itself little is left."""
_MORE: Final = 1.5


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
) -> tuple[Lever, ...]:
    """Return what changes of the design do to a study of fewer people, the largest gain first.

    They begin with a part of the answer's people or, where no number does, with the most.
    Changes that a `kind` of goal does not ask about are left out; `levels` is their number.
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
    if kind in {"half-width", "difference"}:
        told = "the study's levels" if base.placed else "levels placed for each person"
        changes[f"{told} instead"] = replace(base, placed=not base.placed)
    studies = PROBE if answer.participants is None else FEW
    before, *after = trials.run([base, *changes.values()], studies)
    found = (
        Lever(change=change, before=before, after=one)
        for change, one in zip(changes, after, strict=True)
    )
    return tuple(sorted(found, key=lambda one: -one.gain))
