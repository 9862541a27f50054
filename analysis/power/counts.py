"""The counts of one simulated person in one condition, drawn without a session.

How often each stimulus gets each answer is told by the simulated participant itself
(`experiment.terms.observer`), from the gain matrix, masking and guesses; the counts are drawn from
it, and are distributed as those of a session through the engine are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from analysis.thresholds.people import GuessRate, guessing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from experiment.study.sections.design import Design
    from experiment.terms.gains import FingerGains
    from experiment.terms.observer import Observer


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """A person's table: single stimuli by level, and blanks answered left, right or both."""

    levels_vpp: tuple[float, ...]
    detected: tuple[int, ...]
    presented: tuple[int, ...]
    false_alarms: int
    blanks: int
    guess: GuessRate


@dataclass(frozen=True, slots=True, kw_only=True)
class Presented:
    """What a person is presented in one condition; levels may be the person's own."""

    levels_vpp: tuple[float, ...]
    trials_per_side: int
    blanks: int
    balanced: bool
    responses: tuple[str, ...]
    response_window_s: float

    @classmethod
    def of(cls, design: Design, *, trials_per_side: int, blanks: int) -> Presented:
        """Return what a study's design presents, with other numbers of trials."""
        return cls(
            levels_vpp=design.levels_vpp,
            trials_per_side=trials_per_side,
            blanks=blanks,
            balanced=design.order == "balanced",
            responses=design.responses,
            response_window_s=design.response_window_s,
        )


def draw_counts(
    person: Observer,
    presented: Presented,
    gains: FingerGains,
    rng: np.random.Generator,
    *,
    shift_db: float = 0.0,
) -> Counts:
    """Draw a person's counts in one condition, whose thresholds lie higher by `shift_db`."""
    levels_vpp, responses = presented.levels_vpp, presented.responses
    detected, shown = np.zeros((2, len(levels_vpp)), dtype=np.int64)
    asked = (responses, presented.response_window_s)
    shift = (shift_db, shift_db)
    for side in ("left", "right"):
        hit = [
            person.answer_probabilities(*_at(side, level_vpp), *asked, gains=gains, shift_db=shift)[
                responses.index(side)
            ]
            for level_vpp in levels_vpp
        ]
        of_side = _spread(presented, rng)
        shown += of_side
        detected += rng.binomial(of_side, np.minimum(hit, 1.0))
    sided, felt = 0, 0
    if presented.blanks:
        blank = person.answer_probabilities(0.0, 0.0, *asked, gains=gains, shift_db=shift)
        drawn = rng.multinomial(presented.blanks, [*blank, max(0.0, 1 - sum(blank))])
        answers = dict(zip(responses, drawn.tolist(), strict=False))
        sided = answers["left"] + answers["right"]
        felt = sided + answers.get("both", 0)
    guess = guessing(
        none_offered="none" in responses, sided_answers=sided / 2, blanks=presented.blanks
    )
    return Counts(
        levels_vpp=levels_vpp,
        detected=tuple(detected.tolist()),
        presented=tuple(shown.tolist()),
        false_alarms=felt,
        blanks=presented.blanks,
        guess=guess.rate,
    )


def _at(side: str, level_vpp: float) -> tuple[float, float]:
    return (level_vpp, 0.0) if side == "left" else (0.0, level_vpp)


def _spread(presented: Presented, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return how many trials of one side have each level, as the plan draws them."""
    levels = len(presented.levels_vpp)
    if presented.balanced:
        return np.full(levels, presented.trials_per_side // levels, dtype=np.int64)
    return rng.multinomial(presented.trials_per_side, np.full(levels, 1 / levels))
