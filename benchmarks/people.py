"""Counts of simulated people who are not binomial, from closed form: no engine, no session."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter
from scipy.special import ndtr

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]


def overdispersed_counts(
    rng: np.random.Generator, p: ArrayLike, presented: int, factor: float
) -> Floats:
    """Draw detections with the mean of a binomial and `factor` times its variance.

    Beta-binomial: each cell has a probability of its own, Beta distributed about p with the
    correlation (factor - 1) / (presented - 1) between answers.

    >>> rng = np.random.default_rng(1)
    >>> k = overdispersed_counts(rng, np.full(100_000, 0.3), 30, 2.0)
    >>> round(float(k.mean()) / 30, 2), round(float(k.var()) / (30 * 0.3 * 0.7), 1)
    (0.3, 2.0)
    """
    p = np.asarray(p, dtype=float)
    if factor == 1:
        return np.asarray(rng.binomial(presented, p), dtype=float)
    rho = (factor - 1) / (presented - 1)
    inside = np.clip(p, 1e-12, 1 - 1e-12)
    own = rng.beta(inside * (1 - rho) / rho, (1 - inside) * (1 - rho) / rho)
    return np.asarray(rng.binomial(presented, own), dtype=float)


def wander(rng: np.random.Generator, shape: tuple[int, int], trials_to_fade: float) -> Floats:
    """Draw a stationary autoregressive course over trials for each person, variance 1.

    It is correlated with itself by exp(-lag / trials_to_fade); shape (people, trials).

    >>> w = wander(np.random.default_rng(1), (2000, 50), 20.0)
    >>> round(float(np.mean(w[:, 20:] * w[:, :-20])), 1), round(float(w.var()), 1)
    (0.4, 1.0)
    """
    kept = math.exp(-1 / trials_to_fade)
    steps = rng.standard_normal(shape)
    steps[:, 1:] *= math.sqrt(1 - kept**2)
    return np.asarray(lfilter([1.0], [1.0, -kept], steps, axis=1))


def wandering_counts(
    rng: np.random.Generator,
    x: ArrayLike,
    presented: int,
    *,
    mu: ArrayLike,
    sigma: ArrayLike,
    guess_rate: float,
    lapse_rate: float,
    wander_db: float,
    trials_to_fade: float,
    drift_db: float = 0.0,
) -> Floats:
    """Draw detections of people whose thresholds wander or drift within a session.

    Parameters
    ----------
    rng : numpy.random.Generator
        Where chance comes from.
    x : array_like, shape (levels,)
        log10 of the levels.
    presented : int
        Stimuli at each level, in random order.
    mu, sigma : array_like, shape (people,) or ()
        Of each person's psychometric function, log10 units.
    guess_rate, lapse_rate : float
        Of everybody.
    wander_db, trials_to_fade : float
        Standard deviation of a threshold about its own mean, and over how many trials it is
        forgotten.
    drift_db : float
        Rise from the first trial to the last, half of it on either side of mu.

    Returns
    -------
    ndarray of float64, shape (people, levels)
    """
    x = np.asarray(x, dtype=float)
    mu, sigma = np.broadcast_arrays(np.atleast_1d(mu), np.atleast_1d(sigma))
    people, trials = len(mu), len(x) * presented
    order = rng.permuted(np.tile(np.repeat(np.arange(len(x)), presented), (people, 1)), axis=1)
    shift_db = wander_db * wander(rng, (people, trials), trials_to_fade)
    shift_db += drift_db * np.linspace(-0.5, 0.5, trials)
    z = (x[order] - mu[:, None] - shift_db / 20) / sigma[:, None]
    detected = rng.random(z.shape) < guess_rate + (1 - guess_rate - lapse_rate) * ndtr(z)
    return np.stack([(detected & (order == level)).sum(axis=1) for level in range(len(x))], 1) + 0.0
