"""The counts of one simulated person, drawn without a session.

How often each stimulus gets each answer is told by the simulated participant itself
(`experiment.terms.observer`), from the gain matrix, masking and guesses. Where thresholds stay as
they are the counts are drawn at once; where they drift or hang on the last answer, trial by trial
in the order of a plan. Either way they are distributed as those of a session through the engine.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.thresholds.people import GuessRate, guessing
from experiment.terms.people import threshold_course_db
from experiment.trial.draw import shuffled_blocks

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from experiment.study.sections.design import Design
    from experiment.terms.gains import FingerGains
    from experiment.terms.observer import Observer


_SIDES: Final = ("left", "right")


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """A person's table: single stimuli by level, and blanks answered left, right or both."""

    levels_vpp: tuple[float, ...]
    detected: tuple[int, ...]
    presented: tuple[int, ...]
    false_alarms: int
    blanks: int
    guess: GuessRate


def draw_counts(
    person: Observer,
    design: Design,
    gains: FingerGains,
    rng: np.random.Generator,
    *,
    shifts_db: Sequence[float] = (0.0,),
) -> list[Counts]:
    """Draw a person's counts in conditions whose thresholds lie higher by `shifts_db`."""
    if any((person.drift_db, person.block_drift_db, person.wander_db, person.last_answer_db)):
        return _by_trial(person, design, gains, rng, shifts_db)
    return [_at_once(person, design, gains, rng, shift_db) for shift_db in shifts_db]


def _at_once(
    person: Observer,
    design: Design,
    gains: FingerGains,
    rng: np.random.Generator,
    shift_db: float,
) -> Counts:
    levels_vpp, responses = design.levels_vpp, design.responses
    shift = (shift_db, shift_db)

    def answers(left_vpp: float, right_vpp: float) -> tuple[float, ...]:
        return person.answer_probabilities(
            left_vpp, right_vpp, responses, design.response_window_s, gains=gains, shift_db=shift
        )

    detected, presented = np.zeros((2, len(levels_vpp)), dtype=np.int64)
    for side in _SIDES:
        place = responses.index(side)
        hit = [answers(*_at(side, level_vpp))[place] for level_vpp in levels_vpp]
        of_side = _spread(design, rng)
        presented += of_side
        detected += rng.binomial(of_side, np.minimum(hit, 1.0))
    blank = Counter[str | None]()
    if design.blank_trials:
        p = answers(0.0, 0.0)
        drawn = rng.multinomial(design.blank_trials, [*p, max(0.0, 1 - sum(p))]).tolist()
        blank.update(dict(zip((*responses, None), drawn, strict=True)))
    return _counts(design, detected.tolist(), presented.tolist(), blank)


def _by_trial(
    person: Observer,
    design: Design,
    gains: FingerGains,
    rng: np.random.Generator,
    shifts_db: Sequence[float],
) -> list[Counts]:
    order = rng.permutation(len(shifts_db)).tolist()
    blocks = [(place, block) for place in order for block in shuffled_blocks(design, rng)]
    number = [i for i, (_, block) in enumerate(blocks) for _ in block]
    course_db = iter(threshold_course_db(person, number, rng))
    chance = iter(rng.random(len(number)).tolist())
    responses, none_offered = design.responses, "none" in design.responses
    place_of = {level_vpp: i for i, level_vpp in enumerate(design.levels_vpp)}
    found = [([0] * len(place_of), [0] * len(place_of), Counter[str | None]()) for _ in shifts_db]
    half_db, last_db = person.last_answer_db / 2, 0.0
    for place, block in blocks:
        detected, presented, blank = found[place]
        for kind, side, level_vpp in block:
            now_db = shifts_db[place] + next(course_db) + last_db
            levels = (level_vpp or 0.0,) * 2 if kind == "both" else _at(side, level_vpp or 0.0)
            p = person.answer_probabilities(
                *levels, responses, design.response_window_s, gains=gains, shift_db=(now_db, now_db)
            )
            answer = _chosen(responses, p, next(chance))
            if none_offered:
                last_db = {None: 0.0, "none": half_db}.get(answer, -half_db)
            if kind == "single":
                assert level_vpp is not None
                presented[place_of[level_vpp]] += 1
                detected[place_of[level_vpp]] += answer == side
            elif kind == "blank":
                blank[answer] += 1
    return [_counts(design, *one) for one in found]


def _chosen(responses: Sequence[str], p: Iterable[float], chance: float) -> str | None:
    for response, share in zip(responses, p, strict=True):
        chance -= share
        if chance < 0:
            return response
    return None


def _counts(
    design: Design, detected: Sequence[int], presented: Sequence[int], blank: Counter[str | None]
) -> Counts:
    sided = blank["left"] + blank["right"]
    guess = guessing(
        none_offered="none" in design.responses,
        sided_answers=sided / len(_SIDES),
        blanks=design.blank_trials,
    )
    return Counts(
        levels_vpp=design.levels_vpp,
        detected=tuple(detected),
        presented=tuple(presented),
        false_alarms=sided + blank["both"],
        blanks=design.blank_trials,
        guess=guess.rate,
    )


def _at(side: str, level_vpp: float) -> tuple[float, float]:
    return (level_vpp, 0.0) if side == "left" else (0.0, level_vpp)


def _spread(design: Design, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return how many trials of one side have each level, as the plan draws them."""
    levels = len(design.levels_vpp)
    if design.order == "balanced":
        return np.full(levels, design.trials_per_side // levels, dtype=np.int64)
    return rng.multinomial(design.trials_per_side, np.full(levels, 1 / levels))
