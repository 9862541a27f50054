"""A simulated population: who takes part, and how thresholds move during a session."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from experiment.perception.observer import Observer


def draw_observer(
    median: Observer,
    threshold_sd_db: float,
    rng: np.random.Generator,
    *,
    finger_difference_sd_db: float = 0.0,
    sigma_spread: float = 0.0,
    difference_sd_db: float = 0.0,
    reversed_mapping_rate: float = 0.0,
) -> Observer:
    """Draw one participant of a simulated population.

    Thresholds are log-normal: the population's standard deviation is stated in dB, 20 log10.

    Parameters
    ----------
    median : Observer
        The median participant.
    threshold_sd_db : float
        Standard deviation of the thresholds between participants.
    rng : numpy.random.Generator
        Where chance comes from.
    finger_difference_sd_db : float
        Standard deviation of the difference between the two fingers.
    sigma_spread : float
        Standard deviation of ln(sigma).
    difference_sd_db : float
        Standard deviation of the difference between the first two conditions.
    reversed_mapping_rate : float
        Share of participants who confuse the keys.

    Examples
    --------
    >>> import numpy as np
    >>> from experiment.study.files import paper_study
    >>> median = paper_study().simulation.median
    >>> draw_observer(median, 0.0, np.random.default_rng(1)) == median
    True
    """
    threshold = "threshold_vpp" if median.threshold_um is None else "threshold_um"
    spreads = (threshold_sd_db, finger_difference_sd_db, sigma_spread, difference_sd_db)
    higher_db, finger_db, width, difference_db = rng.standard_normal(4) * spreads
    return replace(
        median,
        **{threshold: getattr(median, threshold) * 10.0 ** (higher_db / 20)},
        finger_difference_db=median.finger_difference_db + finger_db,
        sigma=median.sigma * math.exp(width),
        difference_db=median.difference_db + difference_db,
        reversed_mapping=rng.random() < reversed_mapping_rate,
    )


def threshold_course_db(
    observer: Observer, blocks: Sequence[int], rng: np.random.Generator
) -> list[float]:
    """Draw by how much an observer's thresholds lie higher in each trial of a session.

    `blocks` are those of the trials. Straight drifts about the middle of the session and of each
    block, and a stationary autoregressive course, correlated with itself by
    exp(-lag / wander_trials).

    >>> import numpy as np
    >>> from experiment.study.files import paper_study
    >>> person = replace(paper_study().simulation.median, drift_db=2.0, block_drift_db=1.0)
    >>> threshold_course_db(person, [1, 1, 2, 2, 2], np.random.default_rng(1))
    [-1.5, 0.0, -0.5, 0.5, 1.5]
    """
    kept = math.exp(-1.0 / observer.wander_trials)
    fresh = math.sqrt(1.0 - kept * kept)
    course_db, wander_db = [], observer.wander_db * rng.standard_normal()
    of_block = Counter(blocks)
    seen: Counter[int] = Counter()
    for trial, block in enumerate(blocks):
        if trial:
            wander_db = kept * wander_db + fresh * observer.wander_db * rng.standard_normal()
        now_db = observer.drift_db * _about_middle(trial, len(blocks))
        now_db += observer.block_drift_db * _about_middle(seen[block], of_block[block])
        course_db.append(wander_db + now_db)
        seen[block] += 1
    return course_db


def _about_middle(index: int, of: int) -> float:
    return index / (of - 1) - 0.5 if of > 1 else 0.0
