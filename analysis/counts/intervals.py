"""95 % intervals of a proportion and of a mean, and the test that two rates are equal."""

from __future__ import annotations

import math
import reprlib
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.numbers import LIMITS, METHODS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]

_STATSMODELS_NAMES: Final = {"wilson": "wilson", "jeffreys": "jeffreys", "clopper-pearson": "beta"}
_LOG_RANGE: Final = 15.0
"""Log posterior below its maximum that the grid of a group covers."""
_NODES, _MAX_GRIDS = (64, 48), 16
_MAX_EXACT: Final = 10_000
"""Successes of which the exact test is computed; of more, the asymptotic test is as good."""


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
        the interval is (0, 1).
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
    from statsmodels.stats.proportion import proportion_confint

    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    k, n = checked_counts(detected, presented)
    name = _STATSMODELS_NAMES[method]
    lower, upper = proportion_confint(k, np.maximum(n, 1), alpha=0.05, method=name)
    # The limits are exactly 0 and 1 at the ends, and there without a trial, too.
    lower, upper = np.where(k > 0, lower, 0.0), np.where(k < n, upper, 1.0)
    return (float(lower), float(upper)) if lower.ndim == 0 else (lower, upper)


def group_interval(
    detected: ArrayLike, presented: ArrayLike, *, false_alarms: bool = False
) -> tuple[float, float]:
    """Return the 95 % interval of a group's mean probability, where participants differ.

    Participants' probabilities are Beta distributed with the mean m and the variance v m (1 - m).
    The interval has the 2.5 % and 97.5 % points of the posterior of m, or the pooled proportion or
    the participants' mean where these lie farther out. Before the counts are known, m and the
    square root of v are uniform from 0 to 1; of false alarms m is Beta(1, 5), and
    v / (m (1 - m)) the square of a half-Cauchy variate of scale 1 (docs/statistics.md, section 3).

    Parameters
    ----------
    detected, presented : array_like, shape (P,)
        Detected and presented stimuli of each participant; each has at least one.
    false_alarms : bool
        Whether the counts are answers to blank trials, which are expected to be few.

    Returns
    -------
    lower, upper : float
        Limits in [0, 1]; NaN for a single participant.

    Raises
    ------
    ValueError
        For what `proportion_ci` refuses, for no participant and for one without a stimulus.

    Examples
    --------
    Participants who differ yield a wider interval than as many trials of participants who do not:

    >>> alike = group_interval([15, 15, 15], [30, 30, 30])
    >>> different = group_interval([5, 15, 25], [30, 30, 30])
    >>> different[0] < alike[0] < 0.5 < alike[1] < different[1]
    True
    """
    from scipy.special import betaln

    k, n = checked_counts(detected, presented)
    if k.ndim != 1 or k.size == 0 or not np.all(n > 0):
        raise ValueError(f"presented must be a row of counts above 0, got {presented!r}")
    if k.size == 1:
        return math.nan, math.nan
    # Equal participants count together, so that neither their number nor their order matters.
    tables, times = np.unique(np.stack([k, n], axis=1), axis=0, return_counts=True)
    # The axes are arcsin(sqrt(m)) and the share of the prior of the spread below a value. The grid
    # is laid again over the region that matters until it fills most of the grid.
    ends = [(0.0, math.pi / 2), (0.0, 1.0)]
    for _ in range(_MAX_GRIDS):
        edges = [np.linspace(*end, nodes + 1) for end, nodes in zip(ends, _NODES, strict=True)]
        angle, share = np.ix_(*((edge[1:] + edge[:-1]) / 2 for edge in edges))
        log, spread = np.log(np.sin(2 * angle)), share
        if false_alarms:
            scale = np.sin(2 * angle) / 2
            spread = scale * np.tan(share * np.arctan(1 / scale))
            log = log + 8 * np.log(np.cos(angle))  # (1 - m)^4 of Beta(1, 5)
        size = 1 / spread**2 - 1
        a, b = np.sin(angle) ** 2 * size, np.cos(angle) ** 2 * size
        log = log - len(k) * betaln(a, b)
        for (hits, trials), often in zip(tables, times, strict=True):
            log = log + often * betaln(a + hits, b + trials - hits)
        near = log > log.max() - _LOG_RANGE
        cells = [np.flatnonzero(near.any(axis=1 - axis)) for axis in range(2)]
        ends = [(edge[at[0]], edge[at[-1] + 1]) for edge, at in zip(edges, cells, strict=True)]
        if all(np.ptp(end) > 0.6 * np.ptp(edge) for end, edge in zip(ends, edges, strict=True)):
            break
    density = np.exp(log - log.max()).sum(axis=1)
    below = np.concatenate([[0.0], np.cumsum(density) / density.sum()])
    lower, upper = np.sin(np.interp(LIMITS, below, edges[0])) ** 2
    means = (float(k.sum() / n.sum()), math.fsum(k / n) / k.size)
    return min(float(lower), *means), max(float(upper), *means)


def mean_limits(values: pd.Series[float], by: Sequence[pd.Series[Any]]) -> pd.DataFrame:
    """Return the mean of each group of values with 95 % limits by Student's t.

    Columns ``mean low high``. The limits are NaN for a single value, and where all are equal.

    >>> limits = mean_limits(pd.Series([1.0, 2.0, 3.0]), [pd.Series(["a", "a", "a"])])
    >>> limits.round(3).to_numpy().tolist()
    [[2.0, -0.484, 4.484]]
    """
    from scipy.special import stdtrit

    ordered = values.sort_values()  # in an order that does not depend on names
    groups = ordered.groupby([key.reindex(ordered.index) for key in by], dropna=False)
    table = groups.agg(["mean", "sem", "count", "min", "max"])
    mean = table["mean"].clip(table["min"], table["max"])
    half = stdtrit(table["count"] - 1.0, LIMITS[1]) * table["sem"]
    half = half.where(table["max"] > table["min"])
    return pd.DataFrame({"mean": mean, "low": mean - half, "high": mean + half})


def mean_difference(a: Floats, b: Floats) -> tuple[float, float, float, float]:
    """Return the mean of `b` less that of `a`, its 95 % limits and p by Welch's t test.

    Limits and p are NaN where a group has one value, or all values of each are equal.

    >>> apart = mean_difference(np.array([0.0, 0.1, 0.05]), np.array([0.1, 0.3, 0.2, 0.2]))
    >>> [round(value, 3) for value in apart]
    [0.15, 0.021, 0.279, 0.031]
    """
    if not (len(a) and len(b)):
        return math.nan, math.nan, math.nan, math.nan
    difference = float(b.mean() - a.mean())
    if min(len(a), len(b)) == 1 or np.ptp(a) + np.ptp(b) == 0:
        return difference, math.nan, math.nan, math.nan
    from statsmodels.stats.weightstats import CompareMeans, DescrStatsW

    compared = CompareMeans(DescrStatsW(b), DescrStatsW(a))
    low, high = compared.tconfint_diff(usevar="unequal")
    return difference, float(low), float(high), float(compared.ttest_ind(usevar="unequal")[1])


def equal_rates_p(successes: ArrayLike, trials: ArrayLike) -> float:
    """Return the two-sided p of the hypothesis that two rates are equal within every stratum.

    The exact Cochran-Mantel-Haenszel test. Given the successes of both in a stratum, those of the
    first are hypergeometric; p is the probability of all sums over strata that are no likelier than
    the observed one. With one stratum it is Fisher's exact test. Above 10 000 successes the
    asymptotic test with continuity correction takes its place.

    Parameters
    ----------
    successes, trials : array_like of int, shape (strata, 2)

    Examples
    --------
    >>> round(equal_rates_p([(1, 9)], [(10, 10)]), 5)
    0.00109
    >>> equal_rates_p([(2, 2), (0, 0)], [(20, 20), (20, 20)])
    1.0
    """
    from scipy.stats import hypergeom

    k, n = (np.asarray(table, dtype=np.int64).reshape(-1, 2) for table in (successes, trials))
    informative = (n > 0).all(axis=1) & (k.sum(axis=1) > 0) & (k.sum(axis=1) < n.sum(axis=1))
    k, n = k[informative], n[informative]
    if not len(k):
        return 1.0
    if k.sum() > _MAX_EXACT:
        from statsmodels.stats.contingency_tables import StratifiedTable

        tables = np.stack([k, n - k], axis=1).transpose(1, 2, 0)
        return float(StratifiedTable(tables.astype(float)).test_null_odds(correction=True).pvalue)
    # The distribution of the sum over strata is the convolution of theirs.
    density: NDArray[Any] = np.ones(1)
    lowest = 0
    for (first, second), (of_first, of_second) in zip(k.tolist(), n.tolist(), strict=True):
        of_both = first + second
        low, high = max(0, of_both - of_second), min(of_both, of_first)
        stratum = hypergeom(of_first + of_second, of_both, of_first)
        density, lowest = np.convolve(density, stratum.pmf(np.arange(low, high + 1))), lowest + low
    unlikely = density <= density[k[:, 0].sum() - lowest] * (1 + 1e-7)
    return min(float(density[unlikely].sum()), 1.0)


def hypergeometric_tails(
    count: Floats, total: Floats, row: Floats, column: Floats
) -> tuple[Floats, Floats]:
    """Return P(at most) and P(at least) as many in a cell of 2 x 2 tables, their margins given.

    `row` and `column` are the margins of the cell. One-tailed p of Fisher's exact test; of large
    tables those of the normal distribution with continuity correction.

    >>> below, above = hypergeometric_tails(*np.array([[0.0], [10.0], [5.0], [5.0]]))
    >>> below.round(6).tolist(), above.tolist()
    ([0.003968], [1.0])
    """
    from scipy.special import ndtr
    from scipy.stats import hypergeom

    with np.errstate(divide="ignore", invalid="ignore"):
        mean = column * (row / total)
        spread = np.sqrt(mean * (1 - row / total) * ((total - column) / (total - 1)))
        below, above = ndtr((count + 0.5 - mean) / spread), ndtr((mean - count + 0.5) / spread)
    exact = (np.minimum(row, column) <= _MAX_EXACT) | (spread == 0)
    tables = [margin[exact] for margin in (total, row, column)]
    below[exact] = hypergeom.cdf(count[exact], *tables)
    above[exact] = hypergeom.sf(count[exact] - 1, *tables)
    return np.minimum(below, 1.0), np.minimum(above, 1.0)


def checked_counts(detected: ArrayLike, presented: ArrayLike) -> tuple[Floats, Floats]:
    """Return both counts as arrays of one shape.

    Raises
    ------
    ValueError
        For counts that are not whole and finite, k > n, and shapes that do not fit.

    Examples
    --------
    >>> checked_counts(3, [4, 5])[0].tolist()
    [3.0, 3.0]
    """
    counts = []
    for name, values in (("detected", detected), ("presented", presented)):
        numbers = np.asarray(values)
        if numbers.dtype.kind in "iuf":
            is_count = np.isfinite(numbers) & (numbers >= 0) & (numbers == np.floor(numbers))
        else:
            is_count = np.zeros(numbers.shape, dtype=bool)
        if not is_count.all():
            wrong = reprlib.repr(numbers[~is_count].tolist())
            raise ValueError(f"{name} must be whole numbers of at least 0, got {wrong}")
        counts.append(numbers.astype(np.float64))
    k, n = (array.copy() for array in np.broadcast_arrays(*counts))
    if np.any(k > n):
        more, less = (reprlib.repr(counts[k > n].tolist()) for counts in (k, n))
        raise ValueError(f"detected must be at most presented, got {more} of {less}")
    return k, n
