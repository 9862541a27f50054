"""Counts of simulated participants, drawn without their sessions.

The probability of each response to each stimulus is known in closed form
(`experiment.perception.answers`) from the gain matrix, masking and guesses. Responses are drawn
trial by trial in the order of a plan, because thresholds may drift, and thresholds and levels may
depend on the answers before. The counts are distributed as those of sessions through the engine.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from analysis.counts.table import felt_answers
from analysis.thresholds.guess import chances_of, forced_guess_rate, guess_rate_of
from analysis.thresholds.likelihood import Tables
from experiment.levels import Tracks
from experiment.perception.answers import answer_probabilities
from experiment.perception.population import threshold_course_db
from experiment.study.levels import LevelChoice
from experiment.tasks.task import BLANK, SINGLE
from experiment.trial.draw import shuffled_blocks

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from experiment.perception.gains import FingerGains
    from experiment.perception.observer import Observer
    from experiment.study.design import Design
    from experiment.tasks.task import Task

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

CONSTANT_LEVELS: Final = LevelChoice()


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


class _Course(NamedTuple):
    """The trials of sessions in their order, over all conditions: each (sessions, trials)."""

    condition: Any
    presentation: Any
    level_vpp: Any
    shift_db: Any
    chance: Any


def draw_counts(
    sessions: Sequence[Session],
    gains: FingerGains,
    task: Task,
    levels: LevelChoice = CONSTANT_LEVELS,
) -> list[Counts]:
    """Draw the counts of all sessions, one table for each condition."""
    courses = (_course(session, task) for session in sessions)
    course = _Course(*map(np.array, zip(*courses, strict=True)))
    draw = partial(_draw_answers, sessions, course, gains, task)
    if levels.is_adaptive:
        answers = _draw_one_by_one(sessions, course, task, levels, draw)
    else:
        answers = _draw_together(sessions, task, draw)
    conditions = range(len(sessions[0].designs))
    return [_counts(sessions, condition, course, answers, task) for condition in conditions]


def _course(session: Session, task: Task) -> _Course:
    rng, names = session.rng, task.presentation_names
    order = rng.permutation(len(session.designs)).tolist()
    blocks = [(c, block) for c in order for block in shuffled_blocks(session.designs[c], task, rng)]
    trials = [
        (condition, block, names.index(side), level_vpp or 0.0)
        for block, (condition, stimuli) in enumerate(blocks)
        for _, side, level_vpp in stimuli
    ]
    condition, block_of, presentation, level_vpp = zip(*trials, strict=True)
    shift_db = np.array(session.shifts_db)[list(condition)]
    shift_db = shift_db + threshold_course_db(session.person, block_of, rng)
    return _Course(condition, presentation, level_vpp, shift_db, rng.random(len(trials)))


def _draw_answers(
    sessions: Sequence[Session],
    course: _Course,
    gains: FingerGains,
    task: Task,
    *,
    shift_db: Floats | float,
    trials: slice = slice(None),
) -> Integers:
    """Draw answers to trials with shifted thresholds: positions in the responses.

    The position after the last response means that there was no answer in time.
    """
    design = sessions[0].designs[0]
    # (presentations, intervals, sites) of a level of 0 V and of 1 V
    at_0_vpp, at_1_vpp = (
        np.array([task.levels_vpp(name, vpp) for name in task.presentation_names])
        for vpp in (0.0, 1.0)
    )
    presentation = course.presentation[:, trials]
    offset_vpp = np.moveaxis(at_0_vpp[presentation], (-2, -1), (0, 1))
    slope = np.moveaxis((at_1_vpp - at_0_vpp)[presentation], (-2, -1), (0, 1))
    p = answer_probabilities(
        [session.person for session in sessions],
        [*(offset_vpp + slope * course.level_vpp[:, trials])],
        design.responses,
        design.response_window_s,
        gains=gains,
        shift_db=(course.shift_db[:, trials] + shift_db,),
        task=task,
    )
    return np.asarray((p.cumsum(axis=2) <= course.chance[:, trials, None]).sum(axis=2))


def _shifts_after(session: Session, task: Task) -> Floats:
    """Return the shift of the threshold after each response, and after no answer in time."""
    responses, half_db = session.designs[0].responses, session.person.last_answer_db / 2
    if task.nothing not in responses:
        half_db = 0.0
    return np.array([half_db if name == task.nothing else -half_db for name in responses] + [0.0])


def _draw_together(
    sessions: Sequence[Session], task: Task, draw: Callable[..., Integers]
) -> Integers:
    """Draw the answers to trials whose levels are known beforehand."""
    after_db = _shifts_after(sessions[0], task)
    shifts_db, state_after = np.unique(after_db, return_inverse=True)
    answers: Integers = np.stack([draw(shift_db=db) for db in shifts_db])
    rows = np.arange(len(sessions))
    state = np.full(len(sessions), state_after[-1])
    drawn: Integers = np.empty_like(answers[0])
    for trial in range(drawn.shape[1]):
        drawn[:, trial] = answers[state, rows, trial]
        state = state_after[drawn[:, trial]]
    return drawn


def _draw_one_by_one(
    sessions: Sequence[Session],
    course: _Course,
    task: Task,
    levels: LevelChoice,
    draw: Callable[..., Integers],
) -> Integers:
    """Draw the answers to trials whose levels a rule chooses, and put the levels in the course."""
    responses, sides = sessions[0].designs[0].responses, task.presentation_names
    tracks = [
        [Tracks(levels.rule_for(d.levels_vpp, seed), responses, task) for d in session.designs]
        for seed, session in enumerate(sessions)
    ]
    chosen = [presentation.kind == SINGLE for presentation in task.presentations]
    after_db = _shifts_after(sessions[0], task)
    drawn: Integers = np.empty(course.chance.shape, dtype=np.int64)
    shift_db = np.zeros((len(sessions), 1))
    for trial in range(drawn.shape[1]):
        presented = course.presentation[:, trial].tolist()
        current = [
            of_condition[condition]
            for of_condition, condition in zip(tracks, course.condition[:, trial], strict=True)
        ]
        for row, (track, shown) in enumerate(zip(current, presented, strict=True)):
            if chosen[shown]:
                course.level_vpp[row, trial] = track.choose(sides[shown], trial).level_vpp
        answers = draw(shift_db=shift_db, trials=slice(trial, trial + 1))
        drawn[:, trial] = answers[:, 0]
        for row, (track, shown) in enumerate(zip(current, presented, strict=True)):
            if (answer := answers[row, 0]) < len(responses):
                track.update(sides[shown], course.level_vpp[row, trial], responses[answer])
        shift_db = after_db[answers]
    return drawn


def _counts(
    sessions: Sequence[Session], condition: int, course: _Course, answers: Integers, task: Task
) -> Counts:
    """Count the answers of each session in a condition."""
    design = sessions[0].designs[condition]
    position = {name: i for i, name in enumerate(design.responses)}
    correct = np.array([position.get(shown.correct, -1) for shown in task.presentations])
    kind = np.array([shown.kind for shown in task.presentations])[course.presentation]
    is_here = course.condition == condition
    levels = [session.designs[condition].levels_vpp for session in sessions]
    levels_vpp = np.ones(
        (len(levels), max(map(len, levels)))
    )  # of 0 stimuli where others have more
    for row, session_levels in zip(levels_vpp, levels, strict=True):
        row[: len(session_levels)] = session_levels
    at_level = course.level_vpp[..., None] == levels_vpp[:, None]
    presented = at_level & (is_here & (kind == SINGLE))[..., None]
    detected = presented & (answers == correct[course.presentation])[..., None]
    chances, felt = chances_of(task), felt_answers(task)
    # The last answer is none in time.
    is_felt = np.array([*(name in felt for name in design.responses), False])[answers]
    chance = np.array([*map(chances.__getitem__, design.responses), 0.0])[answers]
    is_blank = is_here & (kind == BLANK)
    chance_hits = (is_blank * chance).sum(axis=1)
    guesses = [
        guess_rate_of(
            none_offered=task.nothing in design.responses,
            sided_answers=number,
            blanks=design.blank_trials,
            forced=forced_guess_rate(task),
        )
        for number in chance_hits.tolist()
    ]
    tables = Tables(
        levels=np.nan_to_num(levels_vpp, nan=1.0),
        detected=detected.sum(axis=1).astype(np.float64),
        presented=presented.sum(axis=1).astype(np.float64),
        guesses=guesses,
    )
    alarms = (is_blank & is_felt).sum(axis=1)
    return Counts(tables=tables, false_alarms=alarms, blanks=design.blank_trials)
