"""The likelihood of a psychometric function with guesses and lapses, and where it is greatest.

The levels of each table are scaled so that they run from 0 to 1. Parameters are mu, log sigma and
lambda, bounded as their prior is (docs/statistics.md, section 8); tables are arrays (fits, levels),
unused places have ``presented`` 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr, xlogy

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

LOWER: Final = (-1.0, float(np.log(0.02)), 0.0)
UPPER: Final = (1.5, 0.0, 0.1)
"""Bounds of mu, log sigma and lambda on the scaled levels."""

_MOST_STEPS: Final = 200
_ENOUGH: Final = 1e-12
_SQRT_2PI: Final = float(np.sqrt(2 * np.pi))
_AT_BOUND: Final = 1e-9
_ROUNDING: Final = 1e-15
_LEAST: Final = 1e-100
"""Probabilities below count as this; what is divided by two of them stays finite."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tables:
    """Counts at scaled levels, many tables at once.

    Attributes
    ----------
    u : ndarray of float64, shape (fits, levels)
        Levels, scaled to run from 0 to 1.
    detected, presented : ndarray of float64, shape (fits, levels)
        Counts.
    guess_rate : ndarray of float64, shape (fits,)
        gamma, the probability of a detection of what is not felt.
    """

    u: Floats
    detected: Floats
    presented: Floats
    guess_rate: Floats

    def __getitem__(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Tables:
        return Tables(
            u=self.u[which],
            detected=self.detected[which],
            presented=self.presented[which],
            guess_rate=self.guess_rate[which],
        )

    def __len__(self) -> int:
        return len(self.u)


def probabilities(tables: Tables, parameters: Floats) -> tuple[Floats, Floats]:
    """Return the probabilities of a detection and of a miss; neither loses digits near 0.

    p = gamma + (1 - gamma - lambda) Phi(z), 1 - p = lambda + (1 - gamma - lambda) Phi(-z).

    Parameters
    ----------
    tables : Tables
    parameters : ndarray of float64, shape (fits, 3)
        mu, log sigma and lambda.

    Returns
    -------
    p, q : ndarray of float64, shape (fits, levels)

    Examples
    --------
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
    """Return the likeliest mu, log sigma and lambda within their bounds.

    Fisher's scoring; a parameter at a bound that the likelihood wants to leave stays there.

    Parameters
    ----------
    tables : Tables
    start : ndarray of float64, shape (fits, 3)
        Where to begin: near the greatest value, where there may be several maxima.
    least_gain : float
        Of log likelihood; a step that gains no more is the last one.

    Returns
    -------
    ndarray of float64, shape (fits, 3)
    """
    lower, upper = np.array(LOWER), np.array(UPPER)
    at = np.clip(start, lower, upper)
    value = log_likelihood(tables, at)
    active = np.arange(len(tables))
    for _ in range(_MOST_STEPS):
        part = tables[active]
        step = _free_step(part, at[active])
        new, reached = _uphill(part, at[active], value[active], step)
        moving = (np.abs(new - at[active]) > _ENOUGH).any(axis=1)
        going = moving & ((reached - value[active] > least_gain) | (least_gain == 0.0))
        at[active], value[active] = new, reached
        active = active[going]
        if not len(active):
            break
    return at


def at_upper_lapse(parameters: Floats) -> NDArray[np.bool_]:
    """Tell where lambda stands at its upper bound, shape (fits,)."""
    return np.asarray(parameters[:, 2] >= UPPER[2] - _AT_BOUND)


def _free_step(tables: Tables, at: Floats) -> Floats:
    """Return information^-1 times score, over the parameters that are free to move."""
    score, information = _score(tables, at)
    lower, upper = np.array(LOWER), np.array(UPPER)
    stuck = ((at <= lower) & (score < 0)) | ((at >= upper) & (score > 0))
    for _ in range(2):
        step = _solve(score, information, stuck)
        leaving = ((at <= lower) & (step < 0)) | ((at >= upper) & (step > 0))
        if not (leaving & ~stuck).any():
            break
        stuck |= leaving
    return step


def _solve(score: Floats, information: Floats, stuck: NDArray[np.bool_]) -> Floats:
    free = ~stuck
    matrix = information * (free[:, :, None] & free[:, None, :])
    size = np.einsum("fii->fi", matrix)
    # A little of the diagonal keeps directions that the data do not tell about from running away.
    ridge = np.where(stuck, 1.0, 1e-10 * size + 1e-10 * size.max(axis=1, keepdims=True) + 1e-300)
    matrix = matrix + ridge[:, :, None] * np.eye(3)
    return np.asarray(np.linalg.solve(matrix, np.where(free, score, 0.0)[:, :, None])[:, :, 0])


def _score(tables: Tables, at: Floats) -> tuple[Floats, Floats]:
    """Return the score, shape (fits, 3), and Fisher's information, shape (fits, 3, 3)."""
    mu, log_sigma, lapse = (at[:, i, None] for i in range(3))
    z = (tables.u - mu) * np.exp(-log_sigma)
    felt, density = ndtr(z), np.exp(-0.5 * z * z) / _SQRT_2PI
    guess = tables.guess_rate[:, None]
    rest = 1 - guess - lapse
    p = np.maximum(guess + rest * felt, _LEAST)
    q = np.maximum(lapse + rest * ndtr(-z), _LEAST)
    slopes = np.stack([-rest * density * np.exp(-log_sigma), -rest * density * z, -felt], axis=1)
    missed = tables.presented - tables.detected
    score = (slopes * (tables.detected / p - missed / q)[:, None, :]).sum(axis=2)
    weight = tables.presented / (p * q)
    return score, np.einsum("fil,fjl,fl->fij", slopes, slopes, weight)


def _uphill(tables: Tables, at: Floats, value: Floats, step: Floats) -> tuple[Floats, Floats]:
    """Go a step, or the largest part of it, halved again and again, that is uphill."""
    lower, upper = np.array(LOWER), np.array(UPPER)
    new = np.clip(at + step, lower, upper)
    reached = log_likelihood(tables, new)
    for _ in range(40):
        worse = ~(reached >= value - _ROUNDING * np.abs(value))
        if not worse.any():
            break
        step = np.where(worse[:, None], step / 2, step)
        new = np.clip(at + step, lower, upper)
        reached = log_likelihood(tables, new)
    return np.where(worse[:, None], at, new), np.where(worse, value, reached)
