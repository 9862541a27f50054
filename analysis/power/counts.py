"""The counts of simulated people, drawn without their sessions.

How often each stimulus gets each answer is told in closed form
(`experiment.perception.answers`), from
the gain matrix, masking and guesses. Where thresholds stay as they are the counts are drawn at
once; where they drift or hang on the last answer, trial by trial in the order of a plan. Either way
they are distributed as those of sessions through the engine.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.thresholds.people import GuessRate, guessing
from experiment.perception.answers import answer_probabilities
from experiment.perception.population import threshold_course_db
from experiment.trial.draw import shuffled_blocks

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from experiment.perception.gains import FingerGains
    from experiment.perception.observer import Observer
    from experiment.study.design import Design

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Session:
    """A simulated person, the design of their session, and the generator of its chances."""

    person: Observer
    design: Design
    rng: np.random.Generator
    shifts_db: tuple[float, ...] = (0.0,)
    """By how much the thresholds lie higher in each condition."""
    own: tuple[Design, ...] = ()
    """The design of each condition, where they have levels of their own."""

    def design_in(self, condition: int) -> Design:
        """Return the design of a condition."""
        return self.own[condition] if self.own else self.design


def draw_counts(sessions: Sequence[Session], gains: FingerGains) -> list[list[Counts]]:
    """Draw the counts of each session in each condition.

    The designs may have levels of their own, also in each condition, and are alike in all else.
    """
    one = sessions[0].person
    if any((one.drift_db, one.block_drift_db, one.wander_db, one.last_answer_db)):
        return _by_trial(sessions, gains)
    return _at_once(sessions, gains)


def _at_once(sessions: Sequence[Session], gains: FingerGains) -> list[list[Counts]]:
    silent, responses = np.zeros((len(sessions), 1)), sessions[0].design.responses
    places = [responses.index(side) for side in _SIDES]
    found: list[list[Counts]] = [[] for _ in sessions]
    for place, shift_db in enumerate(zip(*(one.shifts_db for one in sessions), strict=True)):
        levels_vpp = _levels_vpp([one.design_in(place) for one in sessions])
        left, right, blank = (
            _probabilities(sessions, levels, gains, np.array(shift_db)[:, None])
            for levels in ((levels_vpp, silent), (silent, levels_vpp), (silent, silent))
        )
        hits = np.minimum(np.stack([left[..., places[0]], right[..., places[1]]], axis=1), 1.0)
        for row, one in enumerate(sessions):
            found[row].append(_drawn(one.design_in(place), hits[row], blank[row, 0], one.rng))
    return found


def _levels_vpp(designs: Sequence[Design]) -> Floats:
    found = np.zeros((len(designs), max(len(one.levels_vpp) for one in designs)))
    for row, one in zip(found, designs, strict=True):
        row[: len(one.levels_vpp)] = one.levels_vpp
    return found


def _probabilities(
    sessions: Sequence[Session], levels_vpp: tuple[Floats, Floats], gains: FingerGains, db: Floats
) -> Floats:
    design = sessions[0].design
    return answer_probabilities(
        [one.person for one in sessions],
        levels_vpp,
        design.responses,
        design.response_window_s,
        gains=gains,
        shift_db=(db, db),
    )


def _drawn(design: Design, hits: Floats, blank: Floats, rng: np.random.Generator) -> Counts:
    """Draw a condition's counts by how often levels of each side are hit, and blanks answered."""
    levels = len(design.levels_vpp)
    detected, presented = np.zeros((2, levels), dtype=np.int64)
    for p in hits:
        of_side = _spread(design, rng)
        presented += of_side
        detected += rng.binomial(of_side, p[:levels])
    answered = Counter[str | None]()
    if design.blank_trials:
        number = rng.multinomial(design.blank_trials, [*blank, max(0.0, 1 - blank.sum())]).tolist()
        answered.update(dict(zip((*design.responses, None), number, strict=True)))
    return _counts(design, detected.tolist(), presented.tolist(), answered)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Course:
    """The trials of a session in their order, over all of its conditions."""

    condition: Integers
    left_vpp: Floats
    right_vpp: Floats
    level: Integers  # place of a single stimulus' level, -1 of all others
    blank: NDArray[np.bool_]
    shift_db: Floats
    chance: Floats


def _course(session: Session) -> _Course:
    rng = session.rng
    place_of = [
        {level_vpp: i for i, level_vpp in enumerate(session.design_in(condition).levels_vpp)}
        for condition in range(len(session.shifts_db))
    ]
    order = rng.permutation(len(session.shifts_db)).tolist()
    blocks = [
        (place, block)
        for place in order
        for block in shuffled_blocks(session.design_in(place), rng)
    ]
    trials = [
        (place, number, *stimulus)
        for number, (place, block) in enumerate(blocks)
        for stimulus in block
    ]
    condition, block_of, kind, side, level_vpp = zip(*trials, strict=True)
    told_vpp = np.array([one or 0.0 for one in level_vpp])
    is_side = {one: np.array(side) == one for one in _SIDES}
    both = np.array(kind) == "both"
    shift_db = np.array(session.shifts_db)[list(condition)]
    return _Course(
        condition=np.array(condition),
        left_vpp=told_vpp * (is_side["left"] | both),
        right_vpp=told_vpp * (is_side["right"] | both),
        level=np.array(
            [
                place_of[place][one] if of == "single" and one is not None else -1
                for place, of, one in zip(condition, kind, level_vpp, strict=True)
            ]
        ),
        blank=np.array(kind) == "blank",
        shift_db=shift_db + threshold_course_db(session.person, block_of, rng),
        chance=rng.random(len(trials)),
    )


def _by_trial(sessions: Sequence[Session], gains: FingerGains) -> list[list[Counts]]:
    courses = [_course(one) for one in sessions]
    left_vpp, right_vpp, shift_db, chance = (
        np.array([getattr(one, name) for one in courses])
        for name in ("left_vpp", "right_vpp", "shift_db", "chance")
    )
    responses = sessions[0].design.responses
    half_db = sessions[0].person.last_answer_db / 2 if "none" in responses else 0.0
    # What would be answered after nothing, after "none", and after any other answer.
    answers = [
        (
            np.cumsum(
                _probabilities(sessions, (left_vpp, right_vpp), gains, shift_db + after_db), axis=2
            )
            <= chance[..., None]
        ).sum(axis=2)
        for after_db in ((0.0, half_db, -half_db) if half_db else (0.0,))
    ]
    answer = answers[0]
    if half_db:
        after = np.full(len(responses) + 1, 2)  # by the answer's place, the last of them too late
        after[responses.index("none")], after[-1] = 1, 0
        rows, state = np.arange(len(sessions)), np.zeros(len(sessions), dtype=np.int64)
        every = np.stack(answers)
        for trial in range(answer.shape[1]):
            answer[:, trial] = every[state, rows, trial]
            state = after[answer[:, trial]]
    return [_counted(*one, responses) for one in zip(sessions, courses, answer, strict=True)]


def _counted(
    session: Session, course: _Course, answer: Integers, responses: Sequence[str]
) -> list[Counts]:
    sided = np.where(course.left_vpp > 0, responses.index("left"), responses.index("right"))
    found = []
    for condition in range(len(session.shifts_db)):
        design = session.design_in(condition)
        single = (course.condition == condition) & (course.level >= 0)
        presented, detected = (
            np.bincount(course.level[which], minlength=len(design.levels_vpp))
            for which in (single, single & (answer == sided))
        )
        blank = answer[(course.condition == condition) & course.blank]
        words = Counter(
            dict(
                zip(
                    (*responses, None),
                    np.bincount(blank, minlength=len(responses) + 1).tolist(),
                    strict=True,
                )
            )
        )
        found.append(_counts(design, detected.tolist(), presented.tolist(), words))
    return found


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


def _spread(design: Design, rng: np.random.Generator) -> Integers:
    """Return how many trials of one side have each level, as the plan draws them."""
    levels = len(design.levels_vpp)
    if design.order == "balanced":
        return np.full(levels, design.trials_per_side // levels, dtype=np.int64)
    return rng.multinomial(design.trials_per_side, np.full(levels, 1 / levels))
