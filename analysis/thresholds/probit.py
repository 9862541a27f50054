"""Two-parameter probit fits, many at once: whether one exists, and where it is.

Every function takes tables of counts as arrays (fits, levels); an unused place of a table has
``presented`` 0. Equations: docs/statistics.md, section 8.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import log_ndtr, ndtr, ndtri, xlogy

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


_MOST_STEPS = 200
_ENOUGH = 1e-14
_STEEPEST = 1e3
_MOST_HALVINGS = 30
_ROUNDING = 1e-12
_LOG_2PI = float(np.log(2 * np.pi))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lines:
    """Straight lines through the normal quantiles of tables: p = Phi(intercept + slope x), (fits,).

    The likeliest, whichever way it runs; where it is a step, the slope is infinite, the intercept
    NaN and the deviance its limit, 0.
    """

    intercept: Floats
    slope: Floats
    deviance: Floats
    flat_deviance: Floats  # of the level line through the pooled proportion


def increasing_exists(x: Floats, detected: Floats, presented: Floats) -> NDArray[np.bool_]:
    """Tell whether the tables overlap: something felt at a lower level than something missed.

    Only then has an increasing probit line a likeliest value; otherwise it is a step (statistics of
    separation: A. Albert and J. A. Anderson, Biometrika 71 (1984) 1-10). (fits, levels) in any
    order.

    >>> x, n = np.array([[1.0, 2.0, 3.0]]), np.array([[9.0, 9.0, 9.0]])
    >>> [bool(increasing_exists(x, np.array([k]), n)[0]) for k in ([0, 4, 9], [1, 4, 9], [9, 9, 9])]
    [False, True, False]
    """
    lowest_felt = np.where(detected > 0, x, np.inf).min(axis=1)
    highest_missed = np.where(detected < presented, x, -np.inf).max(axis=1)
    return np.asarray(lowest_felt < highest_missed)


def fit_lines(x: Floats, detected: Floats, presented: Floats) -> Lines:
    """Return the likeliest probit line of each table by Fisher's scoring.

    Levels (fits, levels) lie between 0 and 1 where rounding is to stay small.

    Two levels are met exactly:

    >>> x, n = np.array([[0.0, 1.0]]), np.array([[100.0, 100.0]])
    >>> lines = fit_lines(x, np.array([[16.0, 84.0]]), n)
    >>> ndtr([lines.intercept[0], lines.intercept[0] + lines.slope[0]]).round(12).tolist()
    [0.16, 0.84]
    """
    rising = increasing_exists(x, detected, presented)
    falling = increasing_exists(-x, detected, presented)
    exists = rising & falling
    line = np.full((len(x), 2), np.nan)
    if exists.any():
        line[exists] = _scored(x[exists], detected[exists], presented[exists])
    with np.errstate(invalid="ignore"):
        p = ndtr(line[:, :1] + line[:, 1:] * x)
        q = ndtr(-(line[:, :1] + line[:, 1:] * x))
    total = presented.sum(axis=1, keepdims=True)
    pooled = detected.sum(axis=1, keepdims=True) / np.maximum(total, 1)
    reached = deviance(detected, presented, p, q)
    return Lines(
        intercept=line[:, 0],
        slope=np.where(exists, line[:, 1], np.where(rising, -np.inf, np.inf)),
        deviance=np.where(exists, reached, 0.0),
        flat_deviance=deviance(detected, presented, pooled, 1 - pooled),
    )


def deviance(detected: Floats, presented: Floats, p: Floats, q: Floats) -> Floats:
    """Return 2 sum [k log(k / n p) + (n - k) log((n - k) / n q)] of each table, (..., levels).

    p and q are the probabilities of a detection and of a miss: given both, neither loses digits
    near 1.

    >>> k, n = np.array([[3.0, 0.0]]), np.array([[10.0, 0.0]])
    >>> deviance(k, n, k / 10, 1 - k / 10).round(12).tolist()
    [0.0]
    """
    missed = presented - detected
    with np.errstate(divide="ignore", invalid="ignore"):
        felt = np.where(detected > 0, xlogy(detected, detected / (presented * p)), 0.0)
        lost = np.where(missed > 0, xlogy(missed, missed / (presented * q)), 0.0)
    return np.asarray(np.maximum(2 * (felt + lost).sum(axis=-1), 0.0))


def _scored(x: Floats, detected: Floats, presented: Floats) -> Floats:
    """Return intercept and slope, shape (fits, 2), where the likelihood has its one maximum."""
    start = ndtri((detected.sum(axis=1) + 0.5) / (presented.sum(axis=1) + 1))
    line = np.stack([start, np.zeros(len(x))], axis=1)
    value = _log_likelihood(line, x, detected, presented)
    active = np.arange(len(x))
    for _ in range(_MOST_STEPS):
        data = (x[active], detected[active], presented[active])
        old = line[active]
        new, reached = _halved(_step(old, *data), old, value[active], data)
        moved = np.abs(new - old).max(axis=1) > _ENOUGH * (1 + np.abs(new).max(axis=1))
        line[active], value[active] = new, reached
        active = active[moved]
        if not len(active):
            break
    return line


def _step(line: Floats, x: Floats, detected: Floats, presented: Floats) -> Floats:
    """Return the step of Fisher's scoring: information^-1 times score."""
    z = line[:, :1] + line[:, 1:] * x
    log_density = -0.5 * z * z - 0.5 * _LOG_2PI
    felt, lost = np.exp(log_density - log_ndtr(z)), np.exp(log_density - log_ndtr(-z))
    score = detected * felt - (presented - detected) * lost
    weight = presented * felt * lost
    a, b, c = weight.sum(axis=1), (weight * x).sum(axis=1), (weight * x * x).sum(axis=1)
    u, v = score.sum(axis=1), (score * x).sum(axis=1)
    determinant = a * c - b * b
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.stack([c * u - b * v, a * v - b * u], axis=1) / determinant[:, None]
    return np.where(np.isfinite(step), np.clip(step, -_STEEPEST, _STEEPEST), 0.0)


def _halved(
    step: Floats, old: Floats, best: Floats, data: tuple[Floats, Floats, Floats]
) -> tuple[Floats, Floats]:
    """Go a step, or so small a part of it that the likelihood does not fall."""
    new = old + step
    reached = _log_likelihood(new, *data)
    for _ in range(_MOST_HALVINGS):
        worse = reached < best - _ROUNDING * np.abs(best)
        if not worse.any():
            break
        step = np.where(worse[:, None], step / 2, step)
        new = old + step
        reached = _log_likelihood(new, *data)
    return new, reached


def _log_likelihood(line: Floats, x: Floats, detected: Floats, presented: Floats) -> Floats:
    z = line[:, :1] + line[:, 1:] * x
    return np.asarray((detected * log_ndtr(z) + (presented - detected) * log_ndtr(-z)).sum(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scaled:
    """Levels of many tables, scaled."""

    u: Floats  # from 0 to 1, (fits, levels); where nothing was presented, 0
    low: Floats  # each table's lowest level, and beside it its range: (fits,)
    width: Floats


def scale(x: Floats, presented: Floats) -> Scaled:
    """Scale the levels at which something was presented to run from 0 to 1.

    Examples
    --------
    >>> scale(np.array([[5.0, 7.0, 9.0]]), np.array([[1.0, 1.0, 0.0]])).u.tolist()
    [[0.0, 1.0, 0.0]]
    """
    lowest = np.where(presented > 0, x, np.inf).min(axis=1)
    at = np.where(presented > 0, x, lowest[:, None])
    width = np.ptp(at, axis=1)
    u = (at - lowest[:, None]) / np.where(width > 0, width, 1.0)[:, None]
    return Scaled(u=u, low=lowest, width=width)


def slope_p(lines: Lines) -> tuple[Floats, Floats]:
    """Return the one-sided p of a rise and of a fall, by the likelihood ratio of the slope."""
    root = np.sqrt(np.maximum(lines.flat_deviance - lines.deviance, 0.0))
    root = np.where(lines.slope < 0, -root, root)
    return np.asarray(ndtr(-root)), np.asarray(ndtr(root))
