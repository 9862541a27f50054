"""The likeliest psychometric function with guesses and lapses, of many tables at once.

Levels are in steps of the prior (`analysis.thresholds.density.Ruler`). Parameters are mu, log sigma
and lambda, bounded where the prior's grid ends; tables are arrays (fits, levels), unused places
have ``presented`` 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr, xlogy

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


SIGMA_MEDIAN: Final = 2.0
SIGMA_FACTOR: Final = 2.5
REACH: Final = 24.0
"""So far outside the levels a threshold is looked for."""
MOST_LAPSES: Final = 0.1
LOG_SIGMA: Final = (
    math.log(SIGMA_MEDIAN) - 3.2 * math.log(SIGMA_FACTOR),
    math.log(SIGMA_MEDIAN) + 3.2 * math.log(SIGMA_FACTOR),
)
"""Between these log sigma is looked for: 99.9 % of its prior."""
_MOST_STEPS: Final = 200
_ENOUGH: Final = 1e-12
_SQRT_2PI: Final = float(np.sqrt(2 * np.pi))
_AT_BOUND: Final = 1e-9
_ROUNDING: Final = 1e-15
_EASIER: Final = 10.0
_HARDER: Final = 4.0
_LEAST_DAMPING: Final = 1e-8
_SOLVABLE: Final = 1e-12
_METRIC: Final = np.array([1.0, 1.0, 400.0])
"""A step of 1/20 in lambda counts as much as one of sigma in mu."""
_LEAST: Final = 1e-100
"""Probabilities below count as this; what is divided by two of them stays finite."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tables:
    """Counts at scaled levels, many tables at once: (fits, levels)."""

    u: Floats  # levels, in steps of the prior
    detected: Floats
    presented: Floats
    guess_rate: Floats  # gamma, the probability of a detection of what is not felt: (fits,)

    def __getitem__(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Tables:
        return Tables(
            u=self.u[which],
            detected=self.detected[which],
            presented=self.presented[which],
            guess_rate=self.guess_rate[which],
        )

    def bounds(self) -> tuple[Floats, Floats]:
        """Return the least and greatest mu, log sigma and lambda, (fits, 3) each."""
        used = self.presented > 0
        lowest = np.where(used, self.u, np.inf).min(axis=1) - REACH
        highest = np.where(used, self.u, -np.inf).max(axis=1) + REACH
        ones = np.ones(len(self))
        return (
            np.stack([lowest, LOG_SIGMA[0] * ones, 0.0 * ones], axis=1),
            np.stack([highest, LOG_SIGMA[1] * ones, MOST_LAPSES * ones], axis=1),
        )

    def __len__(self) -> int:
        return len(self.u)


def probabilities(tables: Tables, parameters: Floats) -> tuple[Floats, Floats]:
    """Return the probabilities of a detection and of a miss; neither loses digits near 0.

    p = gamma + (1 - gamma - lambda) Phi(z), 1 - p = lambda + (1 - gamma - lambda) Phi(-z), both
    (fits, levels), of parameters mu, log sigma and lambda, (fits, 3).

    >>> one = np.ones((1, 1))
    >>> tables = Tables(u=0 * one, detected=one, presented=one, guess_rate=np.array([0.5]))
    >>> p, q = probabilities(tables, np.array([[0.0, 0.0, 0.0]]))
    >>> float(p[0, 0]), float(q[0, 0])
    (0.75, 0.25)
    """
    mu, log_sigma, lapse = (parameters[:, i, None] for i in range(3))
    z = (tables.u - mu) * np.exp(-log_sigma)
    guess = tables.guess_rate[:, None]
    rest = 1 - guess - lapse
    return guess + rest * ndtr(z), lapse + rest * ndtr(-z)


def log_likelihood(tables: Tables, parameters: Floats) -> Floats:
    """Return sum k log p + (n - k) log(1 - p) of each table, shape (fits,)."""
    p, q = probabilities(tables, parameters)
    missed = tables.presented - tables.detected
    return np.asarray((xlogy(tables.detected, p) + xlogy(missed, q)).sum(axis=1))


def fit_lapsing(tables: Tables, start: Floats, *, least_gain: float = 0.0) -> Floats:
    """Return the likeliest mu, log sigma and lambda within their bounds: (fits, 3), as `start`.

    Newton's steps, Fisher's scoring where the likelihood is not concave, damped where a step would
    go downhill (Levenberg and Marquardt); a parameter at a bound that the likelihood wants to leave
    stays there. It begins at `start`, near the greatest of several maxima, and ends with a step
    that gains no more than `least_gain` of log likelihood.
    """
    # Thousands of drawn tables are fitted at once, which a general optimiser takes one by one; each
    # keeps a damping of its own. Steps are of sigma, not of its logarithm: where detection nearly
    # rises in one step, likely functions lie along a line of mu and sigma.
    lower, upper = (_with(np.exp, ends) for ends in tables.bounds())
    at = np.clip(_with(np.exp, start), lower, upper)
    value, damping = log_likelihood(tables, _with(np.log, at)), np.ones(len(tables))
    active = np.arange(len(tables))
    for _ in range(_MOST_STEPS):
        part, here, best = tables[active], at[active], value[active]
        ends = (lower[active], upper[active])
        new = np.clip(here + _free_step(part, here, damping[active], ends), *ends)
        reached = log_likelihood(part, _with(np.log, new))
        better = reached >= best - _ROUNDING * np.abs(best)
        moving = (np.abs(new - here) > _ENOUGH).any(axis=1)
        going = moving & ~(better & (reached - best <= least_gain) & (least_gain > 0))
        at[active[better]], value[active[better]] = new[better], reached[better]
        damping[active] *= np.where(better, 1 / _EASIER, _HARDER)
        damping[active] = np.maximum(damping[active], _LEAST_DAMPING)
        active = active[going]
        if not len(active):
            break
    return _with(np.log, at)


def likeliest(tables: Tables, starts: Floats, *, least_gain: float = 0.0) -> Floats:
    """Return the likeliest of what is found from several starts, (fits, starts, 3): (fits, 3)."""
    found = [
        fit_lapsing(tables, starts[:, i], least_gain=least_gain) for i in range(starts.shape[1])
    ]
    values = np.array([log_likelihood(tables, one) for one in found])
    return np.asarray(np.array(found)[values.argmax(axis=0), np.arange(len(tables))])


def _with(function: np.ufunc, parameters: Floats) -> Floats:
    """Return parameters with a function of the second."""
    return np.stack([parameters[:, 0], function(parameters[:, 1]), parameters[:, 2]], axis=1)


def at_upper_lapse(parameters: Floats) -> NDArray[np.bool_]:
    """Tell where lambda stands at its upper bound, shape (fits,)."""
    return np.asarray(parameters[:, 2] >= MOST_LAPSES - _AT_BOUND)


def _free_step(tables: Tables, at: Floats, damping: Floats, ends: tuple[Floats, Floats]) -> Floats:
    """Return (information + damping)^-1 times score, over the parameters that are free to move."""
    score, observed, expected = _score(tables, at)
    lower, upper = ends
    stuck = ((at <= lower) & (score < 0)) | ((at >= upper) & (score > 0))
    size = np.einsum("fii->fi", expected)
    damped = (damping[:, None] * _METRIC + _SOLVABLE * size)[:, :, None] * np.eye(3)
    for _ in range(2):
        step = _solve(score, observed + damped, expected + damped, stuck)
        leaving = ((at <= lower) & (step < 0)) | ((at >= upper) & (step > 0))
        if not (leaving & ~stuck).any():
            break
        stuck |= leaving
    step[:, :2] *= at[:, 1, None]
    return step


def _solve(score: Floats, observed: Floats, expected: Floats, stuck: NDArray[np.bool_]) -> Floats:
    free = ~stuck
    moving = free[:, :, None] & free[:, None, :]
    matrix = np.where(moving, observed, np.eye(3))
    concave = _definite(matrix)[:, None, None]
    matrix = np.where(concave | ~moving, matrix, expected)
    return np.asarray(np.linalg.solve(matrix, np.where(free, score, 0.0)[:, :, None])[:, :, 0])


def _definite(matrix: Floats) -> NDArray[np.bool_]:
    """Tell which symmetric matrices are positive definite, by their leading minors: (fits,)."""
    two = matrix[:, 0, 0] * matrix[:, 1, 1] > matrix[:, 0, 1] ** 2
    return np.asarray((matrix[:, 0, 0] > 0) & two & (np.linalg.det(matrix) > 0))


def _score(tables: Tables, at: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the score, (fits, 3), and observed and expected information, (fits, 3, 3).

    Of mu and sigma in units of sigma, and lambda.
    """
    mu, sigma, lapse = (at[:, i, None] for i in range(3))
    z = (tables.u - mu) / sigma
    felt, density = ndtr(z), np.exp(-0.5 * z * z) / _SQRT_2PI
    guess = tables.guess_rate[:, None]
    rest = 1 - guess - lapse
    p = np.maximum(guess + rest * felt, _LEAST)
    q = np.maximum(lapse + rest * ndtr(-z), _LEAST)
    hits, misses = tables.detected / p, (tables.presented - tables.detected) / q
    slopes = np.stack([-rest * density, -rest * density * z, -felt], axis=1)
    score = (slopes * (hits - misses)[:, None]).sum(axis=2)
    across = slopes.transpose(0, 2, 1)
    expected = (slopes * (tables.presented / (p * q))[:, None]) @ across
    observed = (slopes * (hits / p + misses / q)[:, None]) @ across
    # Less the second derivatives of p.
    push = (hits - misses) * density
    one, first, second, third = ((push * z**power).sum(axis=1) for power in range(4))
    rest = rest[:, 0]
    bent = [
        [-rest * first, rest * (one - second), one],
        [rest * (one - second), rest * (2 * first - third), first],
        [one, first, 0 * one],
    ]
    return score, observed - np.moveaxis(np.array(bent), 2, 0), expected
