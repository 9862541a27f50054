"""Intervals of a proportion: one cell, and a group of participants. All are 95 % and two-sided."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from analysis.definitions import LIMITS, METHODS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


_LOWER, _UPPER = LIMITS
_NODES, _NODES_OF_ALARMS = (64, 24), (64, 48)
"""Of the mean and the spread of a group, on the part that matters."""
_MATTERS = 15.0
"""Of log posterior below the greatest."""
_FEW_ALARMS = 4.0
"""False alarms are expected to be few: the prior of their mean is Beta(1, 5)."""
_FILLED, _PASSES = 0.6, 16


@overload
def proportion_ci(detected: float, presented: float, method: str = ...) -> tuple[float, float]: ...


@overload
def proportion_ci(
    detected: ArrayLike, presented: ArrayLike, method: str = ...
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...


def proportion_ci(
    detected: ArrayLike, presented: ArrayLike, method: str = "wilson"
) -> tuple[Any, Any]:
    """Return the 95 % interval of a proportion.

    Wilson (1927) inverts the score test; Jeffreys takes the quantiles of Beta(k + 1/2, n - k + 1/2)
    with the lower limit 0 at k = 0 and the upper limit 1 at k = n (Brown, Cai & DasGupta 2001);
    Clopper & Pearson (1934) never cover less than 95 %. Formulas: docs/statistics.md, section 3.

    Parameters
    ----------
    detected : int or array_like
        Detected stimuli k, whole numbers, 0 <= k <= n.
    presented : int or array_like
        Presented stimuli n, whole numbers; broadcast against `detected`. Without a trial (n = 0)
        nothing is known: the interval is (0, 1).
    method : str
        ``wilson``, ``jeffreys`` or ``clopper-pearson``.

    Returns
    -------
    lower, upper : float or numpy.ndarray
        Limits in [0, 1]; floats where both counts are single numbers.

    Raises
    ------
    ValueError
        For counts that are not whole and finite, k > n, shapes that do not fit, another method.

    Examples
    --------
    The limits of the misses mirror those of the hits:

    >>> lower, upper = proportion_ci(24, 25)
    >>> missed_lower, missed_upper = proportion_ci(1, 25)
    >>> round(lower, 3), round(upper, 3), round(1 - missed_upper, 3)
    (0.805, 0.993, 0.805)
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    k, n = checked_counts(detected, presented)
    if method == "wilson":
        from scipy.special import ndtri

        lower, upper = _score_limits(_ratio(k, n), n, float(ndtri(_UPPER)))
    else:
        lower, upper = _beta_limits(k, n, 0.5 if method == "jeffreys" else 0.0)
    return (float(lower), float(upper)) if lower.ndim == 0 else (lower, upper)


def group_interval(
    detected: ArrayLike, presented: ArrayLike, *, false_alarms: bool = False
) -> tuple[float, float]:
    """Return the 95 % interval of a group's detection probability, participants differing.

    Of the mean m of people whose probabilities are Beta distributed with the variance v m (1 - m):
    the 2.5 % and 97.5 % points of its posterior, or the pooled proportion or the people's mean
    where these lie farther out. Before the counts are known, m and the square root of v are uniform
    from 0 to 1; of false alarms m is Beta(1, 5), and v / (m (1 - m)) the square of a half-Cauchy
    variate of scale 1 (docs/statistics.md, section 3).

    Parameters
    ----------
    detected, presented : array_like, shape (P,)
        Detected and presented stimuli of each participant; each has at least one.
    false_alarms : bool
        Whether the counts are answers to blank trials: these are expected to be few, and people not
        to be some who never answer and some who always do, as near a steep threshold.

    Returns
    -------
    lower, upper : float
        Limits in [0, 1]; NaN for a single participant, who tells nothing about others.

    Raises
    ------
    ValueError
        For what `proportion_ci` refuses, for no participant and for one without a stimulus.

    Examples
    --------
    Participants who differ tell less than the same number of trials of people who are alike:

    >>> alike = group_interval([15, 15, 15], [30, 30, 30])
    >>> different = group_interval([5, 15, 25], [30, 30, 30])
    >>> different[0] < alike[0] < 0.5 < alike[1] < different[1]
    True
    >>> k, n = [0, 1, 0, 2, 0, 1], [20] * 6
    >>> group_interval(k, n, false_alarms=True)[1] < group_interval(k, n)[1]
    True
    """
    k, n = checked_counts(detected, presented)
    if k.ndim != 1 or k.size == 0 or not np.all(n > 0):
        raise ValueError(f"presented must be a row of counts above 0, got {presented!r}")
    if k.size == 1:
        return float("nan"), float("nan")
    ends = [(0.0, math.pi / 2), (0.0, 1.0)]
    nodes = _NODES_OF_ALARMS if false_alarms else _NODES
    for _ in range(_PASSES):
        edges = [np.linspace(*end, count + 1) for end, count in zip(ends, nodes, strict=True)]
        angle, t = ((edge[1:] + edge[:-1]) / 2 for edge in edges)
        if false_alarms:
            log = _log_posterior(k, n, angle, _spread_of_rates(angle, t))
            log = log + 2 * _FEW_ALARMS * np.log(np.cos(angle))[:, None]
        else:
            log = _log_posterior(k, n, angle, t)
        near = log > log.max() - _MATTERS
        cells = [np.flatnonzero(near.any(axis=1 - i)) for i in range(2)]
        ends = [(edge[at[0]], edge[at[-1] + 1]) for edge, at in zip(edges, cells, strict=True)]
        if all(np.ptp(end) > _FILLED * np.ptp(edge) for end, edge in zip(ends, edges, strict=True)):
            break
    share = np.exp(log - log.max()).sum(axis=1)
    below = np.concatenate([[0.0], np.cumsum(share) / share.sum()])
    lower, upper = np.sin(np.interp(LIMITS, below, edges[0])) ** 2
    told = (float(k.sum() / n.sum()), math.fsum(k / n) / k.size)
    return min(float(lower), *told), max(float(upper), *told)


def _spread_of_rates(angle: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sqrt(v) at the shares t of its prior below it, for each mean.

    sqrt(v / (m (1 - m))) is about the standard deviation of people's log odds.
    """
    scale = np.sin(2 * angle)[:, None] / 2
    return np.asarray(scale * np.tan(t * np.arctan(1 / scale)))


def _log_posterior(
    k: NDArray[np.float64],
    n: NDArray[np.float64],
    angle: NDArray[np.float64],
    spread: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return it over arcsin(sqrt(m)) and what sqrt(v) comes from, but for a constant."""
    from scipy.special import betaln

    alike = 1 / spread**2 - 1
    a, b = np.sin(angle)[:, None] ** 2 * alike, np.cos(angle)[:, None] ** 2 * alike
    # Equal people count together: neither their number nor their order matters.
    cells, times = np.unique(np.stack([k, n], axis=1), axis=0, return_counts=True)
    log = np.log(np.sin(2 * angle))[:, None] - len(k) * betaln(a, b)
    for (felt, shown), often in zip(cells, times, strict=True):
        log = log + often * betaln(a + felt, b + shown - felt)
    return np.asarray(log)


def _score_limits(
    p: NDArray[np.float64], n: NDArray[np.float64], quantile: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the roots x of (p - x)^2 n = quantile^2 x (1 - x), written without cancellation.

    The product of the roots is n p^2 / (n + quantile^2), which gives the small root from the large
    one; the same at 1 - p gives the upper limit. So they are exactly 0 and 1 at p = 0 and p = 1.
    """

    def small_root(q: NDArray[np.float64]) -> NDArray[np.float64]:
        spread = quantile * np.sqrt(n * q * (1 - q) + quantile**2 / 4)
        return np.asarray(n * q**2 / (n * q + quantile**2 / 2 + spread))

    return small_root(p), np.asarray(1 - small_root(1 - p))


def _beta_limits(
    k: NDArray[np.float64], n: NDArray[np.float64], shift: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return beta quantiles: shift 1/2 is Jeffreys' prior, 0 the exact binomial tail sums."""
    from scipy.special import betaincinv

    some, missed = np.maximum(k, 1.0), np.maximum(n - k, 1.0)
    other = 1.0 - shift
    lower = np.where(k > 0, betaincinv(some + shift, n - k + other, _LOWER), 0.0)
    upper = np.where(k < n, betaincinv(k + other, missed + shift, _UPPER), 1.0)
    return lower, upper


def checked_counts(
    detected: ArrayLike, presented: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return both counts as arrays of one shape, or refuse them.

    Raises
    ------
    ValueError
        For counts that are not whole and finite, k > n, and shapes that do not fit.

    Examples
    --------
    >>> checked_counts(3, [4, 5])[0].tolist()
    [3.0, 3.0]
    """
    k, n = _whole("detected", detected), _whole("presented", presented)
    try:
        k, n = np.broadcast_arrays(k, n)
    except ValueError:
        message = f"detected must have a shape that fits presented {n.shape}, got {k.shape}"
        raise ValueError(message) from None
    if np.any(k > n):
        raise ValueError(f"detected must be at most presented, got {detected!r} of {presented!r}")
    return k, n


def _whole(name: str, values: ArrayLike) -> NDArray[np.float64]:
    numbers = np.asarray(values)
    if numbers.dtype.kind in "iuf":
        counts = numbers.astype(np.float64)
        if np.all(np.isfinite(counts)) and np.all((counts >= 0) & (counts == np.floor(counts))):
            return counts
    raise ValueError(f"{name} must be whole numbers of at least 0, got {values!r}")


def _ratio(k: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(k / np.maximum(n, 1.0))
