"""What simulated participants answer: the probability of every answer, and draws from it.

The psychometric function, masking between fingers, lapses and reaction times are here; which
answer follows from what was detected is the task's (`experiment.tasks`). Equations (28) to
(30) of docs/model.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr

from experiment.tasks import LEFT_RIGHT_BOTH
from experiment.tasks.task import Guessing, Sensation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from experiment.perception.gains import FingerGains
    from experiment.perception.observer import Observer
    from experiment.tasks.task import Task

    Floats = NDArray[np.float64]


MASKING_DB: Final = 20.0
"""Level difference, 20 log10 of the amplitudes' ratio, from which the weaker finger feels nothing.

Source: paper, section V, after Kim et al. 2012.
"""
_MASKING_RATIO: Final = 10.0 ** (MASKING_DB / 20)
_ROUNDING: Final = 1.0 + 1e-12
"""Amplitudes that differ by `MASKING_DB` but for the rounding of a product count as doing so."""


def answer_probabilities(
    people: Sequence[Observer],
    levels_vpp: Sequence[Sequence[ArrayLike]],
    responses: tuple[str, ...],
    response_window_s: float,
    *,
    gains: FingerGains,
    shift_db: Sequence[ArrayLike] = (0.0,),
    task: Task = LEFT_RIGHT_BOTH,
) -> Floats:
    """Return how often each response is given; what is left to 1 is too late.

    Levels of the actuator at each site, for each interval, and shifts of the thresholds at each
    site, or of all, are (stimuli,) or (people, stimuli), the result (people, stimuli, responses).
    The people are of one population: whether masking, cross-talk and thresholds are stated in dB or
    um is that of all.

    >>> from experiment.study.files import paper_study
    >>> from experiment.perception.gains import without_crosstalk
    >>> from dataclasses import replace
    >>> person = replace(paper_study().simulation.median, threshold_um=None, threshold_vpp=60.0)
    >>> p = answer_probabilities([person], [([60.0], [0.0])], LEFT_RIGHT_BOTH.sites, 9.0,
    ...                          gains=without_crosstalk(2))
    >>> p.round(2).tolist()
    [[[0.74, 0.26]]]
    """
    intervals, clarity = _sense_intervals(people, levels_vpp, gains, shift_db)
    answers = _decide(people, intervals, responses, task)
    median_s, least_s, spread = _reaction(people, clarity)
    with np.errstate(divide="ignore", invalid="ignore"):
        late = np.log(np.maximum(response_window_s - least_s, 0.0) / median_s)
        # Without a spread everybody takes the median.
        in_time = np.where(spread > 0, ndtr(late / spread), late >= 0)
    return np.stack([in_time * answers[name] for name in responses], axis=-1)


def draw_answers(
    people: Sequence[Observer],
    levels_vpp: Sequence[Sequence[ArrayLike]],
    responses: tuple[str, ...],
    response_window_s: float,
    rng: np.random.Generator,
    *,
    gains: FingerGains,
    shift_db: Sequence[ArrayLike] = (0.0,),
    task: Task = LEFT_RIGHT_BOTH,
) -> tuple[NDArray[np.int64], Floats]:
    """Draw the answers to trials, as `answer_probabilities` has them.

    Returns the position of each answer in `responses`, their number where no answer came in time,
    and the reaction times in seconds; both (people, stimuli). The reaction time depends on how
    clearly a stimulus is felt, and not on which answer it gets.
    """
    intervals, clarity = _sense_intervals(people, levels_vpp, gains, shift_db)
    median_s, least_s, spread = _reaction(people, clarity)
    rt_s = least_s + median_s * np.exp(spread * rng.standard_normal(median_s.shape))
    p = _decide(people, intervals, responses, task)
    below = np.cumsum([p[name] for name in responses[:-1]], axis=0)
    answers = (below <= rng.random(median_s.shape)).sum(axis=0)
    return np.where(rt_s > response_window_s, len(responses), answers), rt_s


def _of(people: Sequence[Observer], name: str) -> Floats:
    """Return a number of each of the people, shape (people, 1)."""
    return np.array([[getattr(person, name)] for person in people], dtype=np.float64)


def _sense_intervals(
    people: Sequence[Observer],
    levels_vpp: Sequence[Sequence[ArrayLike]],
    gains: FingerGains,
    shift_db: Sequence[ArrayLike],
) -> tuple[list[Sensation], Floats]:
    """Return the sensation in each interval, and how clear the clearest one is.

    That is the greatest probability of detection, before one finger masks the other.
    """
    felt = [_sense(people, levels, gains, shift_db) for levels in levels_vpp]
    return [sensation for sensation, _ in felt], np.max([clarity for _, clarity in felt], axis=0)


def _sense(
    people: Sequence[Observer],
    levels_vpp: Sequence[ArrayLike],
    gains: FingerGains,
    shift_db: Sequence[ArrayLike],
) -> tuple[Sensation, Floats]:
    if people[0].crosstalk_db is not None:
        gains = gains.with_crosstalk(people[0].crosstalk_db)
    # the first axis is that of the fingers
    arrays = [np.asarray(vpp, dtype=np.float64) for vpp in levels_vpp]
    amplitudes = np.array(
        [
            np.atleast_2d(sum(gain * vpp for gain, vpp in zip(row, arrays, strict=True)))
            for row in gains.per_vpp
        ]
    )
    thresholds = np.array([person.thresholds(gains) for person in people]).T[..., None]
    shifts_db = np.stack(np.broadcast_arrays(*map(np.atleast_2d, shift_db)))
    with np.errstate(divide="ignore"):
        over = np.log10(amplitudes / thresholds) - shifts_db / 20
    has_slope = people[0].masking_slope is not None
    if has_slope:
        over = over - _of(people, "masking_slope") * np.maximum(_strongest_other(over), 0.0)
    strengths = over / _of(people, "sigma")
    detected = np.asarray(ndtr(strengths))
    clarity = detected.max(axis=0)
    if not has_slope:
        detected = detected * (
            amplitudes * _MASKING_RATIO > _strongest_other(amplitudes) * _ROUNDING
        )
    return Sensation([*detected], [*amplitudes], [*strengths]), clarity


def _strongest_other(values: Floats) -> Floats:
    """Return the largest value of all other fingers, for each finger; -1 where there is none."""
    return np.array(
        [np.delete(values, i, axis=0).max(axis=0, initial=-1.0) for i in range(len(values))]
    )


def _decide(
    people: Sequence[Observer],
    intervals: Sequence[Sensation],
    responses: tuple[str, ...],
    task: Task,
) -> dict[str, Floats]:
    """Return how often each response is given, however late."""
    names = ("false_alarm_rate", "side_bias", "guess_both")
    guessing = Guessing(*(_of(people, name) for name in names))
    answers = task.decide(intervals, responses, guessing)
    lapse = _of(people, "lapse_rate")
    answers = {name: lapse / len(responses) + (1 - lapse) * p for name, p in answers.items()}
    if any(person.reversed_mapping for person in people):
        is_reversed = _of(people, "reversed_mapping") > 0
        answers = {
            name: np.where(is_reversed, answers[task.reversed_mapping.get(name, name)], p)
            for name, p in answers.items()
        }
    return answers


def _reaction(people: Sequence[Observer], clarity: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the shifted log-normal of reaction times: median past the shift, shift and spread.

    It takes longer the less could be felt.
    """
    median_s, min_s = _of(people, "reaction_time_s"), _of(people, "min_reaction_time_s")
    spread, slowing = _of(people, "reaction_time_spread"), _of(people, "reaction_time_slowing")
    return (median_s - min_s) * (slowing - (slowing - 1) * clarity), min_s, spread
