"""Counts of simulated participants, drawn without their sessions.

The probability of each response to each stimulus is known in closed form
(`experiment.perception.answers`) from the gain matrix, masking and guesses. Where thresholds do not
move, the counts are drawn at once; where they drift or depend on the last answer, trial by trial
in the order of a plan. Either way they are distributed as those of sessions through the engine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from analysis.thresholds.guess import guess_rate_of
from analysis.thresholds.likelihood import Tables
from experiment.perception.answers import answer_probabilities
from experiment.perception.population import threshold_course_db
from experiment.trial.draw import shuffled_blocks

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from experiment.perception.gains import FingerGains
    from experiment.perception.observer import Observer
    from experiment.study.design import Design
    from experiment.tasks.task import Task

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Counts:
    """Counts of participants in one condition, a row for each."""

    tables: Tables
    """Detected single stimuli by level."""
    false_alarms: Integers
    blanks: int


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


def draw_counts(sessions: Sequence[Session], gains: FingerGains, task: Task) -> list[Counts]:
    """Draw the counts of all sessions, one table for each condition."""
    person = sessions[0].person
    moves = (person.drift_db, person.block_drift_db, person.wander_db, person.last_answer_db)
    draw = _draw_by_trial if any(moves) else _draw_at_once
    return [
        _counts(sessions, condition, task, drawn)
        for condition, drawn in enumerate(draw(sessions, gains, task))
    ]


def _draw_at_once(
    sessions: Sequence[Session], gains: FingerGains, task: Task
) -> Iterator[tuple[Integers, Integers, Integers]]:
    """Yield detected and presented stimuli by level, and responses to blanks, by condition.

    The last response is none in time.
    """
    responses, silent = sessions[0].designs[0].responses, np.zeros((len(sessions), 1))
    singles = [shown for shown in task.presentations if len(shown.sites) == 1]
    for condition, design in enumerate(sessions[0].designs):
        levels = _levels_vpp(sessions, condition)
        shift_db = np.array([[session.shifts_db[condition]] for session in sessions])
        hits = np.empty((len(sessions), len(singles), levels.shape[1]))
        for side, single in enumerate(singles):
            driven = [levels if site in single.sites else silent for site in task.sites]
            p = _probabilities(sessions, driven, gains, shift_db)
            hits[:, side] = np.nan_to_num(p[..., responses.index(single.correct)]).clip(max=1.0)
        blank = _probabilities(sessions, [silent] * len(task.sites), gains, shift_db)[:, 0]
        presented, detected = np.zeros((2, *hits.shape), dtype=np.int64)
        answers = np.zeros((len(sessions), len(responses) + 1), dtype=np.int64)
        for row, session in enumerate(sessions):
            for side in range(len(singles)):
                shown = _trials_per_level(session.designs[condition], session.rng)
                presented[row, side, : len(shown)] = shown
                detected[row, side] = session.rng.binomial(presented[row, side], hits[row, side])
            if design.blank_trials:
                p = np.append(blank[row], max(0.0, 1 - blank[row].sum()))
                answers[row] = session.rng.multinomial(design.blank_trials, p)
        yield detected.sum(axis=1), presented.sum(axis=1), answers


def _levels_vpp(sessions: Sequence[Session], condition: int) -> Floats:
    """Return the levels of each session, padded with NaN where others have more."""
    levels = [session.designs[condition].levels_vpp for session in sessions]
    padded = np.full((len(levels), max(map(len, levels))), np.nan)
    for row, levels_vpp in zip(padded, levels, strict=True):
        row[: len(levels_vpp)] = levels_vpp
    return padded


def _probabilities(
    sessions: Sequence[Session], levels_vpp: Sequence[Floats], gains: FingerGains, db: Floats
) -> Floats:
    design, (left_vpp, right_vpp) = sessions[0].designs[0], levels_vpp
    return answer_probabilities(
        [session.person for session in sessions],
        (left_vpp, right_vpp),
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
    sessions: Sequence[Session],
    condition: int,
    task: Task,
    drawn: tuple[Integers, Integers, Integers],
) -> Counts:
    """Return the table of a condition."""
    detected, presented, answers = drawn
    design = sessions[0].designs[condition]
    named = {answer.name: len(answer.sites) for answer in task.answers}
    sites = np.array([*map(named.__getitem__, design.responses), 0])
    guesses = [
        guess_rate_of(
            none_offered=task.nothing in design.responses,
            sided_answers=number / len(task.sites),
            blanks=design.blank_trials,
        )
        for number in answers[:, sites == 1].sum(axis=1).tolist()
    ]
    tables = Tables(
        levels=np.nan_to_num(_levels_vpp(sessions, condition), nan=1.0),
        detected=detected.astype(np.float64),
        presented=presented.astype(np.float64),
        guesses=guesses,
    )
    alarms = answers[:, sites > 0].sum(axis=1)
    return Counts(tables=tables, false_alarms=alarms, blanks=design.blank_trials)


class _Course(NamedTuple):
    """The trials of a session in their order, over all of its conditions."""

    condition: Any
    presentation: Any
    level_vpp: Any
    shift_db: Any
    chance: Any


def _course(session: Session, task: Task) -> _Course:
    rng, names = session.rng, task.presentation_names
    order = rng.permutation(len(session.designs)).tolist()
    blocks = [(c, block) for c in order for block in shuffled_blocks(session.designs[c], rng)]
    trials = [
        (condition, block, names.index(side), level_vpp or 0.0)
        for block, (condition, stimuli) in enumerate(blocks)
        for _, side, level_vpp in stimuli
    ]
    condition, block_of, presentation, level_vpp = zip(*trials, strict=True)
    shift_db = np.array(session.shifts_db)[list(condition)]
    shift_db = shift_db + threshold_course_db(session.person, block_of, rng)
    return _Course(condition, presentation, level_vpp, shift_db, rng.random(len(trials)))


def _draw_by_trial(
    sessions: Sequence[Session], gains: FingerGains, task: Task
) -> Iterator[tuple[Integers, Integers, Integers]]:
    """Yield what `_draw_at_once` yields."""
    courses = (_course(session, task) for session in sessions)
    course = _Course(*map(np.array, zip(*courses, strict=True)))
    responses, last_answer_db = sessions[0].designs[0].responses, sessions[0].person.last_answer_db
    sites = np.array([[site in shown.sites for site in task.sites] for shown in task.presentations])
    driven = [course.level_vpp * is_driven[course.presentation] for is_driven in sites.T]
    # The answers that would follow no answer in time, the answer "none", and any other answer.
    after_db = (0.0, last_answer_db / 2, -last_answer_db / 2)
    if task.nothing not in responses:
        after_db = (0.0, 0.0, 0.0)
    answers = np.stack(
        [
            (
                _probabilities(sessions, driven, gains, course.shift_db + db).cumsum(axis=2)
                <= course.chance[..., None]
            ).sum(axis=2)
            for db in after_db
        ]
    )
    after = np.array([1 if name == task.nothing else 2 for name in responses] + [0])
    rows, state = np.arange(len(sessions)), np.zeros(len(sessions), dtype=np.int64)
    answer = np.empty_like(answers[0])
    for trial in range(answer.shape[1]):
        answer[:, trial] = answers[state, rows, trial]
        state = after[answer[:, trial]]
    index = {name: i for i, name in enumerate(responses)}
    correct = np.array([index.get(shown.correct, -1) for shown in task.presentations])
    is_hit = answer == correct[course.presentation]
    number_of_sites = sites.sum(axis=1)[course.presentation]
    for c in range(len(sessions[0].designs)):
        is_single = (course.condition == c) & (number_of_sites == 1)
        is_blank = (course.condition == c) & (number_of_sites == 0)
        at_level = course.level_vpp[..., None] == _levels_vpp(sessions, c)[:, None]
        presented = at_level & is_single[..., None]
        detected = presented & is_hit[..., None]
        answers = (answer[..., None] == np.arange(len(responses) + 1)) & is_blank[..., None]
        yield detected.sum(axis=1), presented.sum(axis=1), answers.sum(axis=1)
