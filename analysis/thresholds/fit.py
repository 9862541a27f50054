"""Psychometric functions fitted to counts: a threshold, or the reason why there is none."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal, get_args

import numpy as np

from analysis.axis import LARGEST, XScale
from analysis.thresholds.density import Ruler
from analysis.thresholds.grid import surfaces
from analysis.thresholds.mle import Tables, at_upper_lapse, likeliest, probabilities
from analysis.thresholds.people import GuessRate
from analysis.thresholds.posterior import posterior, within_levels
from analysis.thresholds.probit import deviance, fit_lines, increasing_exists, scale, slope_p

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from analysis.thresholds.posterior import Posterior

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
"""Statuses of a table that tells a threshold."""
BOUNDED: Final = (
    "threshold_below_levels",
    "threshold_above_levels",
    "median_below_levels",
    "median_above_levels",
)
"""Statuses of a table that tells only a bound of the threshold."""

_SLOPE_P: Final = 0.05
_GAIN: Final = 1e-13
"""Of log likelihood; a step that gains less moves no digit that is told."""
_LEVEL: Final = 1e-12
"""A rise of the normal quantile over all levels that is no more is rounding."""
_AT_ONCE: Final = 250
"""Tables whose likelihoods are held in memory together, 60 kB each."""
_NAN: Final = float("nan")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbitFit:
    """The likeliest p = Phi((x - mu)/sigma), mu and sigma in the units of x."""

    mu: float
    sigma: float
    deviance: float  # twice the log likelihood that the table's own proportions have more


@dataclass(frozen=True, slots=True, kw_only=True)
class PsychometricFit:
    """What a table of counts tells of a psychometric function.

    Attributes
    ----------
    status : str
        With a threshold: ``ok``, ``lapse_at_bound``, ``separated``. With a bound as one of the
        limits: ``threshold_below_levels``, ``threshold_above_levels``, ``median_below_levels``,
        ``median_above_levels``. With neither: ``one_level``, ``decreasing``, ``flat``. What is not
        known is NaN. What each means: docs/statistics.md, section 8.
    threshold : float
        Level felt half of the time, posterior median, in the levels' unit.
    threshold_limits : tuple of float
        95 % equal-tailed limits; outside the tested levels an end is open, -inf or inf.
    sigma : float
        Posterior median of the width: log10 units, or the levels' unit on a linear axis. NaN where
        detection rises in one step (``separated``): the prior alone would tell it.
    lapse_rate, guess_rate : float
        Posterior means; a guess rate that is known is that.
    mle_threshold, mle_sigma, mle_lapse_rate : float
        The likeliest values, sigma and lambda within their priors' bounds; NaN where ``separated``.
    deviance : float
        At these.

    Examples
    --------
    `fit_psychometric` gives one. Where everything was felt it knows only a bound:

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


def probit_mle(x: ArrayLike, detected: ArrayLike, presented: ArrayLike) -> ProbitFit:
    """Return the likeliest increasing probit function without guesses and lapses.

    Equation and method: docs/statistics.md, section 8.

    Parameters
    ----------
    x : array_like, shape (levels,)
        Levels, on the axis on which the function is normal; in any order.
    detected, presented : array_like, shape (levels,)
        Counts. Levels without a stimulus count for nothing.

    Returns
    -------
    ProbitFit
        ``mu`` and ``sigma`` in the units of x, and the ``deviance``.

    Raises
    ------
    ValueError
        For impossible counts, and where no increasing function is the likeliest: one level, tables
        without overlap, tables that do not rise.

    Examples
    --------
    Two levels are met exactly, wherever the axis begins:

    >>> fit = probit_mle([1e6, 1e6 + 2], [16, 84], [100, 100])
    >>> round(fit.mu - 1e6, 9), round(fit.deviance, 9)
    (1.0, 0.0)
    >>> probit_mle([1, 2, 3], [0, 0, 9], [9, 9, 9])
    Traceback (most recent call last):
    ValueError: detected must overlap (something felt below a level at which something was missed)
    for a likeliest probit function to exist; got 0/9 0/9 9/9
    """
    levels, k, n = _table(x, detected, presented)
    counts = " ".join(f"{a:g}/{b:g}" for a, b in zip(k, n, strict=True))
    scaled = scale(levels[None, :], n[None])
    if scaled.width[0] == 0:
        raise ValueError(f"x must hold at least two levels with stimuli; got {levels.tolist()}")
    if not increasing_exists(scaled.u, k[None], n[None])[0]:
        raise ValueError(
            "detected must overlap (something felt below a level at which something was missed) "
            f"for a likeliest probit function to exist; got {counts}"
        )
    lines = fit_lines(scaled.u, k[None], n[None])
    slope = float(lines.slope[0])
    if not slope > _LEVEL:
        raise ValueError(f"detected must rise with x; got {counts}")
    return ProbitFit(
        mu=float(scaled.low[0] - scaled.width[0] * lines.intercept[0] / slope),
        sigma=float(scaled.width[0] / slope),
        deviance=float(lines.deviance[0]),
    )


def fit_psychometric(
    levels_vpp: ArrayLike,
    detected: ArrayLike,
    presented: ArrayLike,
    *,
    guess_rate: float | GuessRate,
    x_scale: XScale = "log10",
) -> PsychometricFit:
    """Fit p = gamma + (1 - gamma - lambda) Phi((x - mu)/sigma) to one table of counts.

    Priors, method and coverage: docs/statistics.md, section 8.

    Parameters
    ----------
    levels_vpp : array_like, shape (levels,)
        Drive levels; above 0 on the axis ``log10``.
    detected, presented : array_like, shape (levels,)
        Counts. Levels without a stimulus count for nothing; equal levels are pooled.
    guess_rate : float or GuessRate
        gamma: 0 where a person who feels nothing says so, 1/2 where a side has to be guessed.
    x_scale : str
        ``log10`` or ``linear``.

    Returns
    -------
    PsychometricFit

    Raises
    ------
    ValueError
        For impossible counts, levels not above 0 on the axis ``log10``, or another axis.

    Examples
    --------
    >>> levels_vpp, presented = [50, 71, 100, 141, 200], [50] * 5
    >>> fit = fit_psychometric(levels_vpp, [1, 7, 26, 48, 50], presented, guess_rate=0.0)
    >>> fit.status, fit.threshold_limits[0] < 100 < fit.threshold_limits[1]
    ('ok', True)
    """
    x, k, n = _table(levels_vpp, detected, presented, name="levels_vpp")
    axis = checked_levels("levels_vpp", x, x_scale)
    guess = guess_rate if isinstance(guess_rate, GuessRate) else GuessRate(mean=guess_rate)
    fit = fit_many(axis[None], k[None], n[None], guesses=(guess,), x_scale=x_scale)[0]
    return in_volts(fit) if x_scale == "log10" else fit


def checked_levels(name: str, levels: NDArray[np.generic], x_scale: XScale) -> Floats:
    """Return levels on the axis; a ValueError unless they can lie there."""
    if levels.size and levels.dtype.kind not in "iuf":
        raise ValueError(f"{name} must be finite numbers; got {levels.tolist()!r}")
    x = levels.astype(np.float64)
    if not (np.abs(x) <= LARGEST).all():
        wrong = x[~(np.abs(x) <= LARGEST)].tolist()
        raise ValueError(f"{name} must be finite and at most {LARGEST:g}; got {wrong}")
    if x_scale not in get_args(XScale):
        raise ValueError(f"x_scale must be one of log10, linear; got {x_scale!r}")
    if x_scale == "log10" and (x <= 0).any():
        raise ValueError(
            f"{name} must be above 0 on the axis log10; got {x[x <= 0].tolist()}: use "
            'x_scale="linear"'
        )
    return np.log10(x) if x_scale == "log10" else x


def in_volts(fit: PsychometricFit) -> PsychometricFit:
    """Return a fit on the axis log10 as one in the levels' unit."""
    low, high = fit.threshold_limits
    return replace(
        fit,
        threshold=10.0**fit.threshold,
        threshold_limits=(low if low == -math.inf else 10.0**low, 10.0**high),
        mle_threshold=10.0**fit.mle_threshold,
    )


def fit_many(
    x: Floats,
    detected: Floats,
    presented: Floats,
    *,
    guesses: Sequence[GuessRate],
    x_scale: XScale = "log10",
) -> tuple[PsychometricFit, ...]:
    """Fit many tables as one array job, on the axis of x.

    Tables are (fits, levels), with counts that are checked; where presented is 0 the level is not
    used. Each has its guess rate.
    """
    if len(x) > _AT_ONCE:
        parts = [slice(i, i + _AT_ONCE) for i in range(0, len(x), _AT_ONCE)]
        some = (
            fit_many(x[i], detected[i], presented[i], guesses=guesses[i], x_scale=x_scale)
            for i in parts
        )
        return tuple(itertools.chain.from_iterable(some))
    shown = np.asarray(presented, dtype=np.float64)
    many = [i for i, row in enumerate(shown) if np.ptp(x[i][row > 0]) > 0]
    fits = [PsychometricFit(status="one_level")] * len(shown)
    if not many:
        return tuple(fits)
    rulers = [Ruler.of(x[i][shown[i] > 0], x_scale) for i in many]
    step = np.array([one.step for one in rulers])
    tables = Tables(
        u=x[many] / step[:, None],
        detected=np.asarray(detected, dtype=np.float64)[many],
        presented=shown[many],
        guess_rate=np.array([guesses[i].mean for i in many]),
    )
    counts = (tables.u, tables.detected, tables.presented)
    found = surfaces(*counts, rulers=rulers, guesses=[guesses[i] for i in many])
    known = posterior(found, rulers)
    words = _statuses(tables, known.mu, rulers)
    best, misfit = np.full((len(many), 3), _NAN), np.full(len(many), _NAN)
    # Others tell no likeliest function, and theirs are the slowest to find.
    likely = np.flatnonzero([word == "ok" for word in words])
    if len(likely):
        part = tables[likely]
        best[likely] = likeliest(part, known.starts[likely], least_gain=_GAIN)
        misfit[likely] = deviance(part.detected, part.presented, *probabilities(part, best[likely]))
        for row in likely[at_upper_lapse(best[likely])]:
            words[row] = "lapse_at_bound"
    for row, i in enumerate(many):
        found_best = (*best[row].tolist(), float(misfit[row]))
        fits[i] = _fit(known, found_best, row, rulers[row], words[row])
    return tuple(fits)


def _fit(
    known: Posterior,
    best: tuple[float, float, float, float],
    row: int,
    ruler: Ruler,
    status: FitStatus,
) -> PsychometricFit:
    """Lay one table's posterior on its axis, as far as its status lets it be told.

    With its likeliest mu, log sigma and lambda and their deviance.
    """
    low, middle, high = known.mu[row].tolist()
    limits = within_levels(low, high, ruler)
    if status in BOUNDED:
        return PsychometricFit(status=status, threshold_limits=limits)
    if status not in WITH_THRESHOLD:
        return PsychometricFit(status=status)
    mu, log_sigma, lapse_rate, misfit = best
    steep = status == "separated"
    return PsychometricFit(
        status=status,
        threshold=middle * ruler.step,
        threshold_limits=limits,
        sigma=_NAN if steep else ruler.step * math.exp(known.log_sigma[row, 1]),
        lapse_rate=float(known.lapse_rate[row]),
        guess_rate=float(known.guess_rate[row]),
        mle_threshold=ruler.step * mu,
        mle_sigma=ruler.step * math.exp(log_sigma),
        mle_lapse_rate=lapse_rate,
        deviance=misfit,
    )


def status_of(
    x: Floats, detected: Floats, presented: Floats, mu: tuple[float, float, float], ruler: Ruler
) -> FitStatus:
    """Return the status of many people's tables pooled, with the limits and median of their mu."""
    levels, place = np.unique(x[presented > 0], return_inverse=True)
    if len(levels) == 1:
        return "one_level"
    k, n = np.zeros(len(levels)), np.zeros(len(levels))
    np.add.at(k, place, detected[presented > 0])
    np.add.at(n, place, presented[presented > 0])
    pooled = Tables(
        u=levels[None] / ruler.step, detected=k[None], presented=n[None], guess_rate=np.zeros(1)
    )
    return _statuses(pooled, np.array([mu]), [ruler])[0]


def _statuses(tables: Tables, mu: Floats, rulers: Sequence[Ruler]) -> list[FitStatus]:
    """Decide the status of each table, whose mu has limits and median (fits, 3): the first line.

    That of lapses at their bound is decided later, among those that are "ok".

    A table that does not rise says "flat", unless it can hardly be but the upper end of a function
    that rises below its levels: then the threshold lies there. At the lower end there is no such
    line: answers at chance may have other reasons than levels that are too low.
    """
    k, n = tables.detected, tables.presented
    p_rise, p_fall = slope_p(fit_lines(scale(tables.u, n).u, k, n))
    low, high = np.array([[one.low, one.high] for one in rulers]).T
    rows: list[tuple[NDArray[np.bool_], FitStatus]] = [
        ((k == n).all(axis=1), "threshold_below_levels"),
        ((k == 0).all(axis=1), "threshold_above_levels"),
        (p_fall < _SLOPE_P, "decreasing"),
        ((p_rise >= _SLOPE_P) & (mu[:, 2] < low), "threshold_below_levels"),
        (p_rise >= _SLOPE_P, "flat"),
        (mu[:, 1] < low, "median_below_levels"),
        (mu[:, 1] > high, "median_above_levels"),
        (~increasing_exists(tables.u, k, n), "separated"),
        (np.ones(len(tables), dtype=bool), "ok"),
    ]
    chosen = np.argmax([holds for holds, _ in rows], axis=0)
    return [rows[i][1] for i in chosen]


def _table(
    x: ArrayLike, detected: ArrayLike, presented: ArrayLike, name: str = "x"
) -> tuple[Floats, Floats, Floats]:
    """Check one table, drop levels without a stimulus, pool equal ones, and sort it."""
    from analysis.answers.intervals import checked_counts
    from analysis.definitions import MOST_PRESENTED

    k, n = checked_counts(detected, presented)
    levels = checked_levels(name, np.asarray(x), "linear")
    if levels.ndim != 1 or levels.shape != k.shape or k.shape != n.shape:
        raise ValueError(
            f"{name}, detected and presented must be lists of one length; got the shapes "
            f"{levels.shape}, {k.shape}, {n.shape}"
        )
    if (n > MOST_PRESENTED).any():
        raise ValueError(f"presented must be at most {MOST_PRESENTED:.0e}; got {n.max():g}")
    if not (n > 0).any():
        raise ValueError("presented must hold at least one stimulus; got none")
    at, place = np.unique(levels[n > 0], return_inverse=True)
    felt, shown = np.zeros(len(at)), np.zeros(len(at))
    np.add.at(felt, place, k[n > 0])
    np.add.at(shown, place, n[n > 0])
    return at, felt, shown
