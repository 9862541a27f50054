"""Psychometric functions fitted to counts: a threshold, a bound, or the reason for neither."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal

from scipy.special import ndtr

from analysis.thresholds.guess import GuessRate
from analysis.thresholds.likeliest import likeliest_function, overlaps, trend
from analysis.thresholds.likelihood import (
    Tables,
    checked_levels,
    checked_table,
    likelihoods,
    pooled,
    posteriors,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from analysis.axis import XScale
    from analysis.thresholds.function import FunctionName, Prior
    from analysis.thresholds.likelihood import Likelihood

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
WITH_THRESHOLD: Final = ("ok", "lapse_at_bound", "separated")
"""Statuses of a table that has a threshold."""
BOUNDED: Final = (
    "threshold_below_levels",
    "threshold_above_levels",
    "median_below_levels",
    "median_above_levels",
)
"""Statuses of a table that has only a bound of the threshold."""
_MAX_TREND_P: Final = 0.05
_MARGIN: Final = 0.1
"""Steps, 0.1 dB. A limit that lies closer to the end of the levels counts as just inside."""
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
        Posterior median of the width: log10 units, or the levels' unit on a linear axis. NaN where
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
        ``log10`` or ``linear``.
    function : str
        F: ``normal``, ``logistic``, ``weibull`` or ``gumbel``, all with F(0) = 1/2 and the same
        slope there. A Weibull function of the level, which needs ``log10``, is a Gumbel function of
        its logarithm.

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
    x, k, n = checked_table(levels, detected, presented)
    guess = guess_rate if isinstance(guess_rate, GuessRate) else GuessRate(mean=guess_rate)
    check_function(function, x_scale)
    tables = Tables(
        x=checked_levels(x, x_scale)[None],
        detected=k[None],
        presented=n[None],
        guesses=[guess],
        x_scale=x_scale,
        function=function,
    )
    people = likelihoods(tables)
    (fit,) = with_likeliest(fit_many(tables, people), tables, people)
    return in_levels(fit) if x_scale == "log10" else fit


def check_function(function: str, x_scale: str) -> None:
    """Raise a ValueError for another function, and for a Weibull function of a linear axis."""
    if function not in ("normal", "logistic", "weibull", "gumbel"):
        raise ValueError(
            f"function must be one of normal, logistic, weibull, gumbel; got {function!r}"
        )
    if function == "weibull" and x_scale == "linear":
        raise ValueError('function="weibull" needs x_scale="log10"; on a linear axis use "gumbel"')


def in_levels(fit: PsychometricFit) -> PsychometricFit:
    """Return a fit on the axis log10 in the levels' unit."""
    low, high = fit.threshold_limits
    return replace(
        fit,
        threshold=10.0**fit.threshold,
        threshold_limits=(low if low == -math.inf else 10.0**low, 10.0**high),
        mle_threshold=10.0**fit.mle_threshold,
    )


def fit_many(
    tables: Tables, people: Sequence[Likelihood] | None = None
) -> tuple[PsychometricFit, ...]:
    """Fit many tables, on their axis; `people` are their likelihoods if these are known.

    The likeliest functions, which take longest, are left to `with_likeliest`.
    """
    people = people or likelihoods(tables)
    priors = tables.priors()
    mu, log_sigma = posteriors(people, priors)
    step = tables.prior.step
    fits = []
    for row, (likelihood, prior, at) in enumerate(zip(people, priors, mu.tolist(), strict=True)):
        used = tables.presented[row] > 0
        counts = (tables.x[row, used], tables.detected[row, used], tables.presented[row, used])
        status = status_of(*counts, at, prior)
        limits = within_levels(at[0], at[2], prior)
        if status in BOUNDED:
            fits.append(PsychometricFit(status=status, threshold_limits=limits))
        elif status not in WITH_THRESHOLD:
            fits.append(PsychometricFit(status=status))
        else:
            sigma = step * math.exp(log_sigma[row, 1])
            fits.append(
                PsychometricFit(
                    status=status,
                    threshold=at[1] * step,
                    threshold_limits=limits,
                    sigma=_NAN if status == "separated" else sigma,
                    lapse_rate=likelihood.lapse[0],
                    guess_rate=likelihood.gamma[0],
                )
            )
    return tuple(fits)


def with_likeliest(
    fits: Sequence[PsychometricFit], tables: Tables, people: Sequence[Likelihood]
) -> tuple[PsychometricFit, ...]:
    """Return fits with their likeliest functions, where these have a slope."""
    step, result = tables.prior.step, []
    for row, (fit, likelihood) in enumerate(zip(fits, people, strict=True)):
        if fit.status != "ok":
            result.append(fit)
            continue
        best = likeliest_function(tables, row, likelihood.node)
        result.append(
            replace(
                fit,
                status="lapse_at_bound" if best.at_max_lapse else "ok",
                mle_threshold=best.mu * step,
                mle_sigma=step * math.exp(best.log_sigma),
                mle_lapse_rate=best.lapse_rate,
                deviance=best.deviance,
            )
        )
    return tuple(result)


def within_levels(low: float, high: float, prior: Prior) -> tuple[float, float]:
    """Return limits on the axis: outside the levels they are open, or no closer than the levels.

    An upper limit below the levels states that the threshold lies there. Of people exactly at the
    lowest level it does so in 3 % of sessions, and 0.1 dB below in 2 %. A closer one is therefore
    given as just inside, and likewise at the highest level.

    >>> from analysis.thresholds.function import Prior
    >>> prior = Prior(low=0.0, high=10.0, step=0.5, tail=3.0)
    >>> within_levels(-2.0, 4.0, prior), within_levels(11.0, 12.0, prior)
    ((-inf, 2.0), (5.0, inf))
    """
    margin = _MARGIN * prior.scale
    high = high if high <= prior.low - margin else max(high, prior.low + margin)
    low = low if low >= prior.high + margin else min(low, prior.high - margin)
    return (
        -math.inf if low < prior.low else min(low, prior.high) * prior.step,
        math.inf if high > prior.high else max(high, prior.low) * prior.step,
    )


def status_of(
    x: Floats, detected: Floats, presented: Floats, mu: Sequence[float], prior: Prior
) -> FitStatus:
    """Return the status of one table, or of many people's counts pooled: the first line that holds.

    `mu` are the limits and the median of the threshold. A table that does not rise is "flat",
    unless it can hardly be but the upper end of a function that rises below its levels: then the
    threshold lies there. At the lower end there is no such line, as answers at chance may have
    other reasons than levels that are too low.
    """
    x, k, n = pooled(x, detected, presented)
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
