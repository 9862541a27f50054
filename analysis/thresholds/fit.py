"""Psychometric functions fitted to counts: a threshold, or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal, get_args

import numpy as np
from scipy.special import ndtr

from analysis.axis import LARGEST, XScale
from analysis.thresholds.likelihood import Tables, at_upper_lapse, probabilities, scale
from analysis.thresholds.people import GuessRate
from analysis.thresholds.posterior import posterior
from analysis.thresholds.probit import Lines, deviance, fit_lines, increasing_exists
from stimuli.checks import whole

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from analysis.thresholds.posterior import Nodes, Posterior

    Floats = NDArray[np.float64]


FitStatus = Literal[
    "ok",
    "one_level",
    "threshold_below_levels",
    "threshold_above_levels",
    "decreasing",
    "flat",
    "separated",
    "lapse_at_bound",
]
WITH_THRESHOLD: Final = ("ok", "lapse_at_bound")
"""Statuses of a table that tells a threshold."""

_SLOPE_P: Final = 0.05
_SURELY: Final = 0.975
_LEVEL: Final = 1e-12
"""A rise of the normal quantile over all levels that is no more is rounding."""
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
        A word of `FitStatus`; where it is not in `WITH_THRESHOLD` the numbers below are NaN.
    threshold : float
        Level felt half of the time, posterior median, in the levels' unit.
    threshold_limits : tuple of float
        95 % equal-tailed limits.
    sigma : float
        Posterior median of the width: log10 units, or the levels' unit on a linear axis.
    lapse_rate : float
        Posterior mean.
    mle_threshold, mle_sigma, mle_lapse_rate : float
        The likeliest values, sigma and lambda within their priors' bounds.
    deviance : float
        At these.
    """

    status: FitStatus
    threshold: float = _NAN
    threshold_limits: tuple[float, float] = (_NAN, _NAN)
    sigma: float = _NAN
    lapse_rate: float = _NAN
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
    >>> fit_psychometric([60, 200], [30, 30], [30, 30], guess_rate=0.5).status
    'threshold_below_levels'
    """
    x, k, n = _table(levels_vpp, detected, presented, name="levels_vpp")
    if x_scale not in get_args(XScale):
        raise ValueError(f"x_scale must be one of log10, linear; got {x_scale!r}")
    if x_scale == "log10" and (x <= 0).any():
        raise ValueError(
            f"levels_vpp must be above 0 on the axis log10; got {x[x <= 0].tolist()}: use "
            'x_scale="linear"'
        )
    axis = np.log10(x) if x_scale == "log10" else x
    guess = guess_rate if isinstance(guess_rate, GuessRate) else GuessRate(mean=guess_rate)
    fit = fit_many(axis[None], k[None], n[None], guesses=(guess,))[0]
    return _in_volts(fit) if x_scale == "log10" else fit


def _in_volts(fit: PsychometricFit) -> PsychometricFit:
    low, high = fit.threshold_limits
    return replace(
        fit,
        threshold=10.0**fit.threshold,
        threshold_limits=(10.0**low, 10.0**high),
        mle_threshold=10.0**fit.mle_threshold,
    )


def fit_many(
    x: Floats,
    detected: Floats,
    presented: Floats,
    *,
    guesses: Sequence[GuessRate],
    nodes: Nodes | None = None,
    jobs: int = 1,
) -> tuple[PsychometricFit, ...]:
    """Fit many tables as one array job, or as several beside each other, on the axis of x.

    Tables are (fits, levels), with counts that are checked; where presented is 0 the level is not
    used. Each has its guess rate. By default the posterior's grid is as fine as each table needs.
    `jobs` processes, at least 1, else a ValueError, are worth it for thousands of tables.
    """
    whole("jobs", jobs, least=1, most=1024)
    if jobs > 1:
        return _spread(x, detected, presented, guesses=guesses, nodes=nodes, jobs=jobs)
    shown = np.asarray(presented, dtype=np.float64)
    scaled = scale(x, shown)
    many = [int(place) for place in np.flatnonzero(scaled.width > 0)]
    fits = [PsychometricFit(status="one_level")] * len(shown)
    if not many:
        return tuple(fits)
    tables = Tables(
        u=scaled.u[many],
        detected=np.asarray(detected, dtype=np.float64)[many],
        presented=shown[many],
        guess_rate=np.array([guesses[place].mean for place in many]),
    )
    known = posterior(tables, [guesses[place] for place in many], nodes)
    statuses = _statuses(tables, known)
    p, q = probabilities(tables, known.best)
    misfit = deviance(tables.detected, tables.presented, p, q)
    for row, place in enumerate(many):
        if statuses[row] in WITH_THRESHOLD:
            fit = _fit(known, row, low=float(scaled.low[place]), width=float(scaled.width[place]))
            fits[place] = replace(fit, status=statuses[row], deviance=float(misfit[row]))
        else:
            fits[place] = PsychometricFit(status=statuses[row])
    return tuple(fits)


def _spread(
    x: Floats,
    detected: Floats,
    presented: Floats,
    *,
    guesses: Sequence[GuessRate],
    nodes: Nodes | None,
    jobs: int,
) -> tuple[PsychometricFit, ...]:
    from joblib import Parallel, delayed

    parts = [part for part in np.array_split(np.arange(len(x)), jobs) if len(part)]
    fitted = Parallel(n_jobs=jobs)(
        delayed(fit_many)(
            x[part],
            detected[part],
            presented[part],
            guesses=[guesses[i] for i in part],
            nodes=nodes,
        )
        for part in parts
    )
    return tuple(fit for part in fitted for fit in part)


def _fit(known: Posterior, row: int, *, low: float, width: float) -> PsychometricFit:
    at, best = low + width * known.mu[row], known.best[row]
    return PsychometricFit(
        status="ok",
        threshold=float(at[1]),
        threshold_limits=(float(at[0]), float(at[2])),
        sigma=float(width * np.exp(known.log_sigma[row, 1])),
        lapse_rate=float(known.lapse_rate[row]),
        mle_threshold=float(low + width * best[0]),
        mle_sigma=float(width * np.exp(best[1])),
        mle_lapse_rate=float(best[2]),
    )


def _statuses(tables: Tables, known: Posterior) -> list[FitStatus]:
    """Decide the status of each table: the first line that holds.

    A table that does not rise says "flat", unless it can hardly be but the upper end of a function
    that rises below its levels: then the threshold lies there. At the lower end there is no such
    line: answers at chance may have other reasons than levels that are too low.
    """
    k, n = tables.detected, tables.presented
    lines = fit_lines(tables.u, k, n)
    p_rise, p_fall = _slope_p(lines)
    below, above = known.mu[:, 1] < 0, known.mu[:, 1] > 1
    rows: list[tuple[NDArray[np.bool_], FitStatus]] = [
        ((k == n).all(axis=1), "threshold_below_levels"),
        ((k == 0).all(axis=1), "threshold_above_levels"),
        (p_fall < _SLOPE_P, "decreasing"),
        ((p_rise >= _SLOPE_P) & (known.below > _SURELY), "threshold_below_levels"),
        (p_rise >= _SLOPE_P, "flat"),
        (~increasing_exists(tables.u, k, n), "separated"),
        (below, "threshold_below_levels"),
        (above, "threshold_above_levels"),
        (at_upper_lapse(known.best), "lapse_at_bound"),
        (np.ones(len(tables), dtype=bool), "ok"),
    ]
    chosen = np.argmax([holds for holds, _ in rows], axis=0)
    return [rows[i][1] for i in chosen]


def _slope_p(lines: Lines) -> tuple[Floats, Floats]:
    """Return the one-sided p of a rise and of a fall, by the likelihood ratio of the slope."""
    root = np.sqrt(np.maximum(lines.flat_deviance - lines.deviance, 0.0))
    root = np.where(lines.slope < 0, -root, root)
    return np.asarray(ndtr(-root)), np.asarray(ndtr(root))


def _table(
    x: ArrayLike, detected: ArrayLike, presented: ArrayLike, name: str = "x"
) -> tuple[Floats, Floats, Floats]:
    """Check one table, drop levels without a stimulus, pool equal ones, and sort it."""
    from analysis.answers.intervals import checked_counts
    from analysis.definitions import MOST_PRESENTED

    k, n = checked_counts(detected, presented)
    given = np.asarray(x)
    if given.size and given.dtype.kind not in "iuf":
        raise ValueError(f"{name} must be finite numbers; got {x!r}")
    levels = given.astype(np.float64)
    if levels.ndim != 1 or levels.shape != k.shape or k.shape != n.shape:
        raise ValueError(
            f"{name}, detected and presented must be lists of one length; got the shapes "
            f"{levels.shape}, {k.shape}, {n.shape}"
        )
    if not (np.abs(levels) <= LARGEST).all():
        wrong = levels[~(np.abs(levels) <= LARGEST)].tolist()
        raise ValueError(f"{name} must be finite and at most {LARGEST:g}; got {wrong}")
    if (n > MOST_PRESENTED).any():
        raise ValueError(f"presented must be at most {MOST_PRESENTED:.0e}; got {n.max():g}")
    if not (n > 0).any():
        raise ValueError("presented must hold at least one stimulus; got none")
    at, place = np.unique(levels[n > 0], return_inverse=True)
    felt, shown = np.zeros(len(at)), np.zeros(len(at))
    np.add.at(felt, place, k[n > 0])
    np.add.at(shown, place, n[n > 0])
    return at, felt, shown
