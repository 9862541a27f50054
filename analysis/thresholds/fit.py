"""Psychometric functions fitted to counts: a threshold, a bound, or the reason for neither."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from scipy.special import ndtr

from analysis.thresholds.function import MAX_LAPSE
from analysis.thresholds.likeliest import likeliest_function, overlaps, trend
from analysis.thresholds.tables import checked_tables

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from analysis.axis import Axis, XScale
    from analysis.thresholds.function import FunctionName, Prior
    from analysis.thresholds.guess import GuessRate
    from analysis.thresholds.likelihood import Tables

    Floats = NDArray[np.float64]

FitStatus = Literal[
    "ok",
    "one_level",
    "threshold_below_levels",
    "threshold_above_levels",
    "decreasing",
    "flat",
    "separated",
    "median_below_levels",
    "median_above_levels",
    "lapse_at_bound",
]
WITH_FUNCTION: Final = ("ok", "lapse_at_bound")
"""Statuses that determine a whole function: complete separation leaves its slope open."""
WITH_THRESHOLD: Final = (*WITH_FUNCTION, "separated")
"""Statuses of a table that has a threshold."""
BELOW: Final = ("threshold_below_levels", "median_below_levels")
ABOVE: Final = ("threshold_above_levels", "median_above_levels")
BOUNDED: Final = (*BELOW, *ABOVE)
"""Statuses of a table that has only a bound of the threshold."""
_MAX_TREND_P: Final = 0.05
_MARGIN: Final = 0.1
"""Steps, 0.1 dB. A limit that lies closer to the end of the levels counts as just inside."""
_ROUNDING: Final = 1e-9
_NAN: Final = math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class PsychometricFit:
    """A psychometric function fitted to one table of counts.

    Attributes
    ----------
    status : str
        With a threshold: ``ok``, ``lapse_at_bound``, ``separated``. With a bound as one of the
        limits: ``threshold_below_levels``, ``threshold_above_levels``, ``median_below_levels``,
        ``median_above_levels``. With neither: ``one_level``, ``decreasing``, ``flat``. Numbers that
        the table does not determine are NaN. What each means: docs/statistics.md, section 8.
    threshold : float
        Level at which F is 1/2, posterior median, in the levels' unit.
    threshold_limits : tuple of float
        95 % equal-tailed limits; outside the tested levels an end is open, -inf or inf.
    sigma : float
        Posterior median of the width: log10 units, or the levels' unit on other axes. NaN where
        detection rises in one step (``separated``), which leaves sigma to its prior.
    lapse_rate, guess_rate : float
        Posterior means; a guess rate that is known stays as it is.
    mle_threshold, mle_sigma, mle_lapse_rate : float
        The likeliest values, sigma and lambda within their priors' bounds; NaN where ``separated``.
    deviance : float
        Of the likeliest function.

    Examples
    --------
    `fit_psychometric` returns one. Where everything was detected it has only a bound:

    >>> fit = fit_psychometric([60, 200], [30, 30], [30, 30], guess_rate=0.5)
    >>> fit.status, fit.threshold, fit.threshold_limits[0]
    ('threshold_below_levels', nan, -inf)
    """

    status: FitStatus
    threshold: float = _NAN
    threshold_limits: tuple[float, float] = (_NAN, _NAN)
    sigma: float = _NAN
    lapse_rate: float = _NAN
    guess_rate: float = _NAN
    mle_threshold: float = _NAN
    mle_sigma: float = _NAN
    mle_lapse_rate: float = _NAN
    deviance: float = _NAN


def fit_psychometric(
    levels: ArrayLike,
    detected: ArrayLike,
    presented: ArrayLike,
    *,
    guess_rate: float | GuessRate,
    x_scale: XScale = "log10",
    function: FunctionName = "normal",
) -> PsychometricFit:
    """Fit p = gamma + (1 - gamma - lambda) F((x - mu)/sigma) to one table of counts.

    Priors, method and coverage: docs/statistics.md, section 8.

    Parameters
    ----------
    levels : array_like, shape (levels,)
        Stimulus levels; above 0 on the axis ``log10``.
    detected, presented : array_like, shape (levels,)
        Counts. Levels without a stimulus have no effect; equal levels are pooled.
    guess_rate : float or GuessRate
        gamma: 1/2 where a participant has to guess one of two sides. 0 is only right where a
        participant without a sensation never reports one.
    x_scale : str
        ``log10``, ``dB`` for 20 log10 of such levels, or ``linear``.
    function : str
        F: ``normal``, ``logistic``, ``weibull`` or ``gumbel``, all with F(0) = 1/2 and the same
        slope there. A Weibull function of the level, which needs ``log10`` or ``dB``, is a Gumbel
        function of its logarithm.

    Returns
    -------
    PsychometricFit

    Raises
    ------
    ValueError
        For impossible counts, levels not above 0 on the axis ``log10``, another axis or function.

    Examples
    --------
    >>> levels, presented = [50, 71, 100, 141, 200], [50] * 5
    >>> fit = fit_psychometric(levels, [1, 7, 26, 48, 50], presented, guess_rate=0.0)
    >>> fit.status, fit.threshold_limits[0] < 100 < fit.threshold_limits[1]
    ('ok', True)
    """
    one_table = np.asarray(detected)[None], np.asarray(presented)[None]
    tables = checked_tables(levels, *one_table, guess_rate, x_scale=x_scale, function=function)
    (fit,) = fit_many(tables, likeliest=True)
    return fit


def fit_many(tables: Tables, *, likeliest: bool = False) -> tuple[PsychometricFit, ...]:
    """Fit many tables.

    The likeliest functions take longest, and are left out by default.
    """
    fits, axis = [], tables.axis
    for row, likelihood in enumerate(tables.likelihoods):
        prior, mu = tables.priors[row], likelihood.mu_points.tolist()
        status = status_of(*tables.counts(row), mu, prior)
        numbers: dict[str, Any] = {}
        if status in BOUNDED or status in WITH_THRESHOLD:
            numbers["threshold_limits"] = within_levels(mu[0], mu[2], prior, axis)
        if status in WITH_THRESHOLD:
            sigma = axis.width(prior.step * math.exp(likelihood.log_sigma_points[1]))
            numbers |= {
                "threshold": axis.level(mu[1] * prior.step),
                "sigma": _NAN if status == "separated" else sigma,
                "lapse_rate": likelihood.lapse[0],
                "guess_rate": likelihood.gamma[0],
            }
        if likeliest and status == "ok":
            numbers |= likeliest_function(tables, row, likelihood.node)
            is_at_bound = numbers["mle_lapse_rate"] >= MAX_LAPSE - _ROUNDING
            status = "lapse_at_bound" if is_at_bound else "ok"
        fits.append(PsychometricFit(status=status, **numbers))
    return tuple(fits)


def within_levels(low: float, high: float, prior: Prior, axis: Axis) -> tuple[float, float]:
    """Return limits in the levels' unit: outside the levels they are open, or no closer than these.

    An upper limit below the levels states that the threshold lies there. For people whose threshold
    is exactly the lowest level, it lies below in 3 % of sessions, and more than 0.1 dB below in
    2 %. A limit within that distance is therefore given as just inside the levels. The same holds
    at the highest level.

    >>> from analysis.axis import Axis
    >>> from analysis.thresholds.function import Prior
    >>> to = Prior(low=0.0, high=10.0, step=0.5, tail=3.0), Axis(x_scale="linear")
    >>> within_levels(-2.0, 4.0, *to), within_levels(11.0, 12.0, *to)
    ((-inf, 2.0), (5.0, inf))
    """
    margin = _MARGIN * prior.scale
    high = high if high <= prior.low - margin else max(high, prior.low + margin)
    low = low if low >= prior.high + margin else min(low, prior.high - margin)
    return (
        -math.inf if low < prior.low else axis.level(min(low, prior.high) * prior.step),
        math.inf if high > prior.high else axis.level(max(high, prior.low) * prior.step),
    )


def status_of(x: Floats, k: Floats, n: Floats, mu: Sequence[float], prior: Prior) -> FitStatus:
    """Return the status of one table, or of many people's counts pooled: the first line that holds.

    `mu` are the limits and the median of the threshold. A table that does not rise is "flat". The
    exception is a table that is almost certainly the upper end of a function that rises below its
    levels; then the threshold lies there. There is no such exception at the lower end, because
    answers at chance may have other reasons than levels that are too low.
    """
    z = trend(x, k, n)
    falling, flat = float(ndtr(z)) < _MAX_TREND_P, float(ndtr(-z)) >= _MAX_TREND_P
    rows: tuple[tuple[bool, FitStatus], ...] = (
        (len(x) == 1, "one_level"),
        (bool((k == n).all()), "threshold_below_levels"),
        (bool((k == 0).all()), "threshold_above_levels"),
        (falling, "decreasing"),
        (flat and mu[2] < prior.low, "threshold_below_levels"),
        (flat, "flat"),
        (mu[1] < prior.low, "median_below_levels"),
        (mu[1] > prior.high, "median_above_levels"),
        (not overlaps(x, k, n), "separated"),
        (True, "ok"),
    )
    return next(status for holds, status in rows if holds)
