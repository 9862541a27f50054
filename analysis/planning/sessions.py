"""Counts of simulated participants, drawn without their sessions.

The probability of each response to each stimulus is known in closed form
(`experiment.perception.answers`) from the gain matrix, masking and guesses. Where thresholds do not
move, the counts are drawn at once; where they drift or depend on the last answer, trial by trial
in the order of a plan. Either way they are distributed as those of sessions through the engine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.thresholds.guess import GuessRate, guessing
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

SIDES: Final = ("left", "right")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Counts:
    """Counts of participants in one condition, a row for each; levels left over are 0 of 0 at 1."""

    level_vpp: Floats
    detected: Floats
    presented: Floats
    false_alarms: Integers
    blanks: int
    guesses: list[GuessRate]

    def rows(self, first: int, number: int) -> Counts:
        """Return the counts of some participants."""
        rows = slice(first, first + number)
        return Counts(
            level_vpp=self.level_vpp[rows],
            detected=self.detected[rows],
            presented=self.presented[rows],
            false_alarms=self.false_alarms[rows],
            blanks=self.blanks,
            guesses=self.guesses[rows],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Session:
    """A simulated participant, the design of each condition, and the generator of chances.

    The designs may differ in their levels only; `shifts_db` is by how much the thresholds lie
    higher in each condition.
    """

    person: Observer
    designs: tuple[Design, ...]
    rng: np.random.Generator
    shifts_db: tuple[float, ...] = (0.0,)


def draw_counts(sessions: Sequence[Session], gains: FingerGains) -> list[Counts]:
    """Draw the counts of all sessions, one table for each condition."""
    person = sessions[0].person
    if any((person.drift_db, person.block_drift_db, person.wander_db, person.last_answer_db)):
        return _draw_by_trial(sessions, gains)
    return _draw_at_once(sessions, gains)


def _draw_at_once(sessions: Sequence[Session], gains: FingerGains) -> list[Counts]:
    responses, silent = sessions[0].designs[0].responses, np.zeros((len(sessions), 1))
    tables = []
    for condition, design in enumerate(sessions[0].designs):
        levels = _levels_vpp(sessions, condition)
        shift_db = np.array([[session.shifts_db[condition]] for session in sessions])
        left, right, blank = (
            _probabilities(sessions, levels_vpp, gains, shift_db)
            for levels_vpp in ((levels, silent), (silent, levels), (silent, silent))
        )
        hits = np.stack(
            [left[..., responses.index("left")], right[..., responses.index("right")]], axis=1
        )
        hits = np.minimum(hits, 1.0)
        presented = np.zeros(hits.shape, dtype=np.int64)
        detected = np.zeros(hits.shape, dtype=np.int64)
        answers = np.zeros((len(sessions), len(responses) + 1), dtype=np.int64)
        for row, session in enumerate(sessions):
            own_design, rng = session.designs[condition], session.rng
            for side in range(len(SIDES)):
                shown = _trials_per_level(own_design, rng)
                presented[row, side, : len(shown)] = shown
                detected[row, side] = rng.binomial(presented[row, side], hits[row, side])
            if design.blank_trials:
                p = blank[row, 0]
                answers[row] = rng.multinomial(design.blank_trials, [*p, max(0.0, 1 - p.sum())])
        tables.append(_counts(levels, detected.sum(axis=1), presented.sum(axis=1), answers, design))
    return tables


def _levels_vpp(sessions: Sequence[Session], condition: int) -> Floats:
    levels = [session.designs[condition].levels_vpp for session in sessions]
    stacked = np.ones((len(levels), max(map(len, levels))))
    for row, levels_vpp in zip(stacked, levels, strict=True):
        row[: len(levels_vpp)] = levels_vpp
    return stacked


def _probabilities(
    sessions: Sequence[Session], levels_vpp: tuple[Floats, Floats], gains: FingerGains, db: Floats
) -> Floats:
    design = sessions[0].designs[0]
    return answer_probabilities(
        [session.person for session in sessions],
        levels_vpp,
        design.responses,
        design.response_window_s,
        gains=gains,
        shift_db=(db, db),
    )


def _trials_per_level(design: Design, rng: np.random.Generator) -> Integers:
    """Return how many trials of one side have each level, as the plan draws them."""
    levels = len(design.levels_vpp)
    if design.order == "balanced":
        return np.full(levels, design.trials_per_side // levels, dtype=np.int64)
    return rng.multinomial(design.trials_per_side, np.full(levels, 1 / levels))


def _counts(
    levels: Floats, detected: Integers, presented: Integers, answers: Integers, design: Design
) -> Counts:
    """Return the table of a condition; `answers` counts the responses to blanks, late ones last."""
    places = [design.responses.index(side) for side in SIDES]
    sided = answers[:, places].sum(axis=1)
    alarms = sided.copy()
    if "both" in design.responses:
        alarms += answers[:, design.responses.index("both")]
    return Counts(
        level_vpp=levels,
        detected=detected.astype(np.float64),
        presented=presented.astype(np.float64),
        false_alarms=alarms,
        blanks=design.blank_trials,
        guesses=[
            guessing(
                none_offered="none" in design.responses,
                sided_answers=number / len(SIDES),
                blanks=design.blank_trials,
            ).rate
            for number in sided.tolist()
        ],
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Course:
    """The trials of a session in their order, over all of its conditions."""

    condition: Integers
    left_vpp: Floats
    right_vpp: Floats
    level: Integers  # index of a single stimulus' level, -1 of all others
    is_blank: NDArray[np.bool_]
    shift_db: Floats
    chance: Floats


def _course(session: Session) -> _Course:
    rng = session.rng
    indices = [
        {level_vpp: i for i, level_vpp in enumerate(design.levels_vpp)}
        for design in session.designs
    ]
    order = rng.permutation(len(session.designs)).tolist()
    blocks = [(c, block) for c in order for block in shuffled_blocks(session.designs[c], rng)]
    trials = [
        (c, number, *stimulus) for number, (c, block) in enumerate(blocks) for stimulus in block
    ]
    condition, block_of, kind, side, level_vpp = zip(*trials, strict=True)
    volts = np.array([level or 0.0 for level in level_vpp])
    kinds, sides = np.array(kind), np.array(side)
    level = [
        indices[c][v] if of == "single" and v is not None else -1
        for c, of, v in zip(condition, kind, level_vpp, strict=True)
    ]
    shift_db = np.array(session.shifts_db)[list(condition)]
    return _Course(
        condition=np.array(condition),
        left_vpp=volts * ((sides == "left") | (kinds == "both")),
        right_vpp=volts * ((sides == "right") | (kinds == "both")),
        level=np.array(level),
        is_blank=kinds == "blank",
        shift_db=shift_db + threshold_course_db(session.person, block_of, rng),
        chance=rng.random(len(trials)),
    )


def _draw_by_trial(sessions: Sequence[Session], gains: FingerGains) -> list[Counts]:
    courses = [_course(session) for session in sessions]
    condition, left_vpp, right_vpp, level, is_blank, shift_db, chance = (
        np.array([getattr(course, name) for course in courses]) for name in _Course.__slots__
    )
    responses = sessions[0].designs[0].responses
    half_db = sessions[0].person.last_answer_db / 2 if "none" in responses else 0.0
    # The answers that would follow no answer, "none", and any other answer.
    shifts_db = (0.0, half_db, -half_db) if half_db else (0.0,)
    answers = np.stack(
        [
            (
                _probabilities(sessions, (left_vpp, right_vpp), gains, shift_db + after_db).cumsum(
                    axis=2
                )
                <= chance[..., None]
            ).sum(axis=2)
            for after_db in shifts_db
        ]
    )
    answer = answers[0]
    if half_db:
        after = np.full(len(responses) + 1, 2)  # by the answer; the last one is a late answer
        after[responses.index("none")], after[-1] = 1, 0
        rows, state = np.arange(len(sessions)), np.zeros(len(sessions), dtype=np.int64)
        for trial in range(answer.shape[1]):
            answer[:, trial] = answers[state, rows, trial]
            state = after[answer[:, trial]]
    is_hit = answer == np.where(left_vpp > 0, responses.index("left"), responses.index("right"))
    tables = []
    for c, design in enumerate(sessions[0].designs):
        levels = _levels_vpp(sessions, c)
        is_single = (condition == c) & (level >= 0)
        width = levels.shape[1]
        tables.append(
            _counts(
                levels,
                _tally(level, is_single & is_hit, width),
                _tally(level, is_single, width),
                _tally(answer, (condition == c) & is_blank, len(responses) + 1),
                design,
            )
        )
    return tables


def _tally(values: Integers, chosen: NDArray[np.bool_], width: int) -> Integers:
    """Count how often each value from 0 stands in the chosen cells of each row."""
    counts = np.zeros((len(values), width), dtype=np.int64)
    rows, columns = np.nonzero(chosen)
    np.add.at(counts, (rows, values[rows, columns]), 1)
    return counts
