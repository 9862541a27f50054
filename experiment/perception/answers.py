"""How often simulated people give each answer: `Observer.answer` in closed form, as arrays."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from experiment.perception.observer import MASKING_RATIO, ROUNDING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from experiment.perception.gains import FingerGains
    from experiment.perception.observer import Observer

    Floats = NDArray[np.float64]


def answer_probabilities(
    people: Sequence[Observer],
    levels_vpp: tuple[ArrayLike, ArrayLike],
    responses: tuple[str, ...],
    response_window_s: float,
    *,
    gains: FingerGains,
    shift_db: tuple[ArrayLike, ArrayLike] = (0.0, 0.0),
) -> Floats:
    """Return how often each response is given; what is left to 1 is too late.

    Levels of the left and of the right actuator and shifts of the two fingers' thresholds are
    (stimuli,) or (people, stimuli), the result (people, stimuli, responses). The people are of one
    population: whether masking, cross-talk and thresholds are stated in dB or um is that of all.

    >>> from experiment.study.files import paper_study
    >>> from experiment.perception.gains import OWN_FINGER_ONLY
    >>> from dataclasses import replace
    >>> one = replace(paper_study().simulation.median, threshold_um=None, threshold_vpp=60.0)
    >>> p = answer_probabilities([one], ([60.0], [0.0]), ("left", "right"), 9.0,
    ...                          gains=OWN_FINGER_ONLY)
    >>> p.round(2).tolist()
    [[[0.74, 0.26]]]
    """
    if people[0].crosstalk_db is not None:
        gains = gains.with_crosstalk(people[0].crosstalk_db)
    left_vpp, right_vpp = (np.asarray(one, dtype=np.float64) for one in levels_vpp)
    amplitudes = (
        gains.left[0] * left_vpp + gains.left[1] * right_vpp,
        gains.right[0] * left_vpp + gains.right[1] * right_vpp,
    )
    chances = _felt(people, amplitudes, gains, shift_db)
    heard = chances
    if people[0].masking_slope is None:
        left, right = amplitudes
        heard = (
            chances[0] * (left * MASKING_RATIO > right * ROUNDING),
            chances[1] * (right * MASKING_RATIO > left * ROUNDING),
        )
    found = _answers(people, amplitudes, heard, responses)
    in_time = _in_time(people, np.maximum(*chances), response_window_s)
    return np.stack([in_time * found[one] for one in responses], axis=-1)


def _of(people: Sequence[Observer], name: str) -> Floats:
    """Return a number of each of the people, shape (people, 1)."""
    return np.array([[getattr(one, name)] for one in people], dtype=np.float64)


def _felt(
    people: Sequence[Observer],
    amplitudes: tuple[Floats, Floats],
    gains: FingerGains,
    shift_db: tuple[ArrayLike, ArrayLike],
) -> tuple[Floats, Floats]:
    """Return how often the left and the right finger would feel its amplitude alone."""
    of_gains = [one.thresholds(gains) for one in people]
    strengths = [
        amplitude / (np.array([[one[finger]] for one in of_gains]) * 10 ** (np.asarray(db) / 20))
        for finger, (amplitude, db) in enumerate(zip(amplitudes, shift_db, strict=True))
    ]
    with np.errstate(divide="ignore"):
        left, right = (np.log10(one) for one in strengths)
    if people[0].masking_slope is not None:
        slope = _of(people, "masking_slope")
        left, right = left - slope * np.maximum(right, 0), right - slope * np.maximum(left, 0)
    sigma = _of(people, "sigma")
    return np.asarray(ndtr(left / sigma)), np.asarray(ndtr(right / sigma))


def _answers(
    people: Sequence[Observer],
    amplitudes: tuple[Floats, Floats],
    heard: tuple[Floats, Floats],
    responses: tuple[str, ...],
) -> dict[str, Floats]:
    """Return how often each response is given by people whose fingers feel that often."""
    lapse, false_alarm, bias, both = (
        _of(people, name) for name in ("lapse_rate", "false_alarm_rate", "side_bias", "guess_both")
    )
    found = {one: np.full(heard[0].shape, lapse / len(responses)) for one in responses}
    left, right = (np.broadcast_to(one, heard[0].shape) for one in amplitudes)
    for felt_left, felt_right in product((True, False), repeat=2):
        share = (1 - lapse) * (heard[0] if felt_left else 1 - heard[0])
        share = share * (heard[1] if felt_right else 1 - heard[1])
        if felt_left and felt_right:
            if "both" in responses:
                found["both"] += share
                continue
            found["left"] += share * (left > right)
            found["right"] += share * (left < right)
            share = share * (left == right)
        elif felt_left or felt_right:
            found["left" if felt_left else "right"] += share
            continue
        elif "none" in responses:
            found["none"] += share * (1 - false_alarm)
            share = share * false_alarm
        if "both" in responses:
            found["both"] += share * both
            share = share * (1 - both)
        found["left"] += share * bias
        found["right"] += share * (1 - bias)
    if any(one.swapped for one in people):
        swapped = _of(people, "swapped") > 0
        left, right = found["left"], found["right"]
        found["left"], found["right"] = (
            np.where(swapped, right, left),
            np.where(swapped, left, right),
        )
    return found


def _in_time(people: Sequence[Observer], clarity: Floats, response_window_s: float) -> Floats:
    """Return how often the reaction ends within the window."""
    median_s, spread, least_s, doubt = (
        _of(people, f"reaction_time_{name}") for name in ("s", "spread", "least_s", "doubt")
    )
    left_s = np.maximum(response_window_s - least_s, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        late = np.log(left_s / ((median_s - least_s) * (doubt - (doubt - 1) * clarity)))
        # Without a spread everybody takes the median.
        return np.asarray(np.where(spread > 0, ndtr(late / spread), late >= 0))
