"""The likeliest psychometric function of a table, and how well it fits."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import rel_entr, xlogy

from analysis.thresholds.function import (
    LOG_SIGMA,
    MAX_LAPSE,
    REACH,
    FunctionName,
    rise,
    slope,
)
from analysis.thresholds.likelihood import (
    TINY,
    Axes,
    binned,
    checked_table,
    log_probabilities,
    pooled,
    range_of,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.optimize import OptimizeResult

    from analysis.thresholds.likelihood import Likelihood, Tables

    Floats = NDArray[np.float64]

REPLICATES: Final = 499
"""Tables drawn for one p."""
_FIRST_REPLICATES: Final = 99
_MIN_AS_DEVIANT: Final = 10
"""No more tables are drawn once so many of the first deviate as much: p is above 0.1 then."""
_ROUNDING: Final = 1e-5
"""Deviances that differ by less are equal."""
_MIN_RISE: Final = 1e-12
_LAPSE_SCALE: Final = 20.0
"""A step of 1/20 in lambda changes a likelihood about as much as one of sigma in mu."""
_MIN_GRADIENT: Final = 1e-11
"""Of the log likelihood of a trial."""
_REFIT_NODES: Final = (41, 21, 6)
"""Of mu, log sigma and lambda, within four standard deviations of the likeliest function."""
_REFIT_RANGE: Final = 4.0
_BLOCK: Final = 500_000
"""Numbers in one block of drawn counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbitFit:
    """The likeliest p = Phi((x - mu)/sigma), mu and sigma in the units of x."""

    mu: float
    sigma: float
    deviance: float  # twice the log likelihood ratio of the observed proportions to the fit


@dataclass(frozen=True, slots=True, kw_only=True)
class LikeliestFunction:
    """The likeliest function at the mean guess rate, in steps; sigma and lambda within bounds."""

    mu: float
    log_sigma: float
    lapse_rate: float
    deviance: float

    @property
    def at_max_lapse(self) -> bool:
        """Whether lambda lies at its upper bound."""
        return self.lapse_rate >= MAX_LAPSE - 1e-9


def probit_mle(x: ArrayLike, detected: ArrayLike, presented: ArrayLike) -> ProbitFit:
    """Return the likeliest increasing probit function without guesses and lapses.

    statsmodels fits it as a generalised linear model.

    Parameters
    ----------
    x : array_like, shape (levels,)
        Levels, on the axis on which the function is normal; in any order.
    detected, presented : array_like, shape (levels,)
        Counts. Levels without a stimulus have no effect.

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
    ValueError: detected must overlap (a stimulus detected at a lower level than one missed) for a
    likeliest probit function to exist; got 0/9 0/9 9/9
    """
    from statsmodels.genmod.families import Binomial
    from statsmodels.genmod.families.links import Probit
    from statsmodels.genmod.generalized_linear_model import GLM
    from statsmodels.tools.sm_exceptions import PerfectSeparationWarning

    levels, k, n = checked_table(x, detected, presented, name="x")
    counts = " ".join(f"{a:g}/{b:g}" for a, b in zip(k, n, strict=True))
    if len(levels) == 1:
        raise ValueError(f"x must hold at least two levels with stimuli; got {levels.tolist()}")
    if not overlaps(levels, k, n):
        raise ValueError(
            "detected must overlap (a stimulus detected at a lower level than one missed) for a "
            f"likeliest probit function to exist; got {counts}"
        )
    if not overlaps(-levels, k, n):
        raise ValueError(f"detected must rise with x; got {counts}")
    width = float(np.ptp(levels))
    u = (levels - levels[0]) / width
    model = GLM(
        np.column_stack([k, n - k]),
        np.column_stack([np.ones_like(u), u]),
        family=Binomial(Probit()),
    )
    # Two levels, and tables that a function meets exactly, leave the scale of the residuals open,
    # which is not used.
    with np.errstate(divide="ignore", invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", PerfectSeparationWarning)
        fit = model.fit(maxiter=200, tol=1e-15, tol_criterion="params")
    intercept, rise_per_width = (float(value) for value in fit.params)
    if not rise_per_width > _MIN_RISE:
        raise ValueError(f"detected must rise with x; got {counts}")
    p, q = rise("normal", intercept + rise_per_width * u)
    return ProbitFit(
        mu=float(levels[0]) - width * intercept / rise_per_width,
        sigma=width / rise_per_width,
        deviance=float(deviance(k, n, p, q)),
    )


def overlaps(x: Floats, detected: Floats, presented: Floats) -> bool:
    """Return whether a stimulus was detected at a lower level than one that was missed.

    Only then does the likeliest increasing function have a finite slope (A. Albert and J. A.
    Anderson, Biometrika 71 (1984) 1-10).

    >>> x, n = np.array([1.0, 2.0, 3.0]), np.array([9.0, 9.0, 9.0])
    >>> [overlaps(x, np.array(k), n) for k in ([0, 4, 9], [1, 4, 9], [9, 9, 9])]
    [False, True, False]
    """
    lowest_hit = np.where(detected > 0, x, np.inf).min()
    highest_miss = np.where(detected < presented, x, -np.inf).max()
    return bool(lowest_hit < highest_miss)


def trend(x: Floats, detected: Floats, presented: Floats) -> float:
    """Return the score statistic of a rise of detection with level, standard normal without one.

    >>> x, n = np.array([1.0, 2.0]), np.array([50.0, 50.0])
    >>> round(trend(x, np.array([20.0, 30.0]), n), 6)  # the z test of two proportions
    2.0
    """
    total, hits = presented.sum(), detected.sum()
    p = hits / total
    centred = x - presented @ x / total
    variance = p * (1 - p) * (presented @ centred**2)
    return float(centred @ (detected - presented * p) / math.sqrt(variance)) if variance else 0.0


def deviance(detected: Floats, presented: Floats, p: Floats, q: Floats) -> Floats:
    """Return 2 sum [k log(k / n p) + (n - k) log((n - k) / n q)] over the last axis."""
    k, n = np.asarray(detected, dtype=np.float64), presented
    parts = rel_entr(k, n * np.maximum(p, TINY)) + rel_entr(n - k, n * np.maximum(q, TINY))
    return np.asarray(np.maximum(2 * parts.sum(axis=-1), 0.0))


def deviance_residuals(detected: Floats, presented: Floats, p: Floats) -> Floats:
    """Return the signed roots of what each proportion adds to the deviance of p.

    >>> deviance_residuals(np.array([5.0, 9.0]), np.array([10.0, 10.0]), np.array(0.5)).round(3)
    array([0.   , 2.713])
    """
    q = detected / presented
    parts = presented * (rel_entr(q, p) + rel_entr(1 - q, 1 - p))
    return np.asarray(np.sign(q - p) * np.sqrt(np.maximum(2 * parts, 0.0)))


def likeliest_function(
    tables: Tables, row: int, node: tuple[float, float, float]
) -> LikeliestFunction:
    """Return the likeliest function of a table at its mean guess rate, from a likely node."""
    from scipy.optimize import minimize

    u, k, n, gamma = _table_of(tables, row)
    misses, total = n - k, n.sum()

    def cost(values: Floats) -> tuple[float, Floats]:
        sigma, lapse = math.exp(values[1]), values[2] / _LAPSE_SCALE
        z = (u - values[0]) / sigma
        above, below = rise(tables.function, z)
        rest = 1 - gamma - lapse
        p, q = np.maximum(gamma + rest * above, TINY), np.maximum(lapse + rest * below, TINY)
        push = k / p - misses / q
        steep = rest * slope(tables.function, z) * push
        gradient = [steep.sum() / sigma, (steep * z).sum(), above @ push / _LAPSE_SCALE]
        value = float((xlogy(k, p) + xlogy(misses, q)).sum())
        return -value / total, np.array(gradient) / total

    bounds = (
        (float(u[0]) - REACH, float(u[-1]) + REACH),
        LOG_SIGMA,
        (0.0, MAX_LAPSE * _LAPSE_SCALE),
    )
    start = np.array([node[0], node[1], node[2] * _LAPSE_SCALE])
    best: OptimizeResult = minimize(
        cost,
        start,
        jac=True,
        bounds=bounds,
        method="L-BFGS-B",
        options={"ftol": 0.0, "gtol": _MIN_GRADIENT, "maxiter": 500},
    )
    mu, log_sigma, lapse = best.x.tolist()
    lapse /= _LAPSE_SCALE
    p, q = _probabilities(tables.function, (u - mu) * math.exp(-log_sigma), gamma, lapse)
    misfit = float(deviance(k, n, p, q))
    return LikeliestFunction(mu=mu, log_sigma=log_sigma, lapse_rate=lapse, deviance=misfit)


def deviance_p(
    tables: Tables, row: int, best: LikeliestFunction, likelihood: Likelihood, seed: int
) -> float:
    """Return how often a table drawn from its likeliest function deviates as much from a refit.

    p = (1 + #{D* >= D}) / (1 + drawn tables). The table and every drawn one are refitted to the
    nearest node of one grid around the likeliest function. Where ten of the first 99 deviate as
    much, p is above 0.1 and these are all; stopping there makes no p smaller (J. Besag and P.
    Clifford, Biometrika 78 (1991) 301-304). The generator is seeded by `seed` and the counts, so
    that neither names nor order of participants matter. A guess rate with a Beta distribution is
    drawn for each table, while all are fitted with its mean: a rate that blank trials left
    uncertain is no misfit.
    """
    u, k, n, gamma = _table_of(tables, row)
    axes = _refit_axes(likelihood, best, gamma)
    log = log_probabilities(tuple(binned(u, k, n)[0].tolist()), axes, tables.function)
    mu, sigma, lapse = (
        axis.ravel()
        for axis in np.meshgrid(axes.mu, np.exp(axes.log_sigma), axes.lapse, indexing="ij")
    )
    log = log.reshape(-1, len(axes.lapse), len(axes.mu), len(axes.log_sigma))
    log = np.moveaxis(log, 1, 3).reshape(len(log), -1)

    def refitted(counts: Floats) -> Floats:
        spread = np.stack([np.concatenate(_hits_and_misses(u, weight, n)) for weight in counts])
        node = (spread @ log).argmax(axis=1)[:, None]
        z = (u - mu[node]) / sigma[node]
        return deviance(counts, n, *_probabilities(tables.function, z, gamma, lapse[node]))

    rng = np.random.default_rng([seed, *k.astype(np.int64).tolist(), *n.astype(np.int64).tolist()])
    above, _ = rise(tables.function, (u - best.mu) * math.exp(-best.log_sigma))
    beta = tables.guesses[row].beta
    observed = float(refitted(k[None])[0]) - _ROUNDING
    as_deviant = drawn = 0
    for total in (_FIRST_REPLICATES, REPLICATES):
        while drawn < total:
            size = min(max(_BLOCK // len(u), 1), total - drawn)
            rates = np.full((size, 1), gamma)
            if beta is not None:
                rates = np.minimum(rng.beta(*beta, (size, 1)), 1 - best.lapse_rate)
            p = rates + (1 - rates - best.lapse_rate) * above
            counts = rng.binomial(n.astype(np.int64), np.clip(p, 0.0, 1.0)).astype(np.float64)
            as_deviant += int((refitted(counts) >= observed).sum())
            drawn += size
        if as_deviant >= _MIN_AS_DEVIANT:
            break
    return (1 + as_deviant) / (1 + drawn)


def _refit_axes(likelihood: Likelihood, best: LikeliestFunction, gamma: float) -> Axes:
    least = math.exp(-(_REFIT_RANGE**2) / 2)
    lapse, half = best.lapse_rate, _REFIT_RANGE * math.sqrt(likelihood.lapse[1])
    ranges = (
        range_of(likelihood.mu, likelihood.values.max(axis=1), least),
        range_of(likelihood.log_sigma, likelihood.values.max(axis=0), least),
        (max(lapse - half, 0.0), min(lapse + half, MAX_LAPSE)),
    )
    mu, log_sigma, lapses = (
        np.linspace(*ends, nodes) for ends, nodes in zip(ranges, _REFIT_NODES, strict=True)
    )
    weight = np.ones(1)
    return Axes(
        mu=mu,
        log_sigma=log_sigma,
        lapse=lapses,
        lapse_weight=np.ones_like(lapses),
        gamma=gamma * weight,
        gamma_weight=weight,
    )


def _hits_and_misses(u: Floats, detected: Floats, presented: Floats) -> tuple[Floats, Floats]:
    _, k, n = binned(u, detected, presented)
    return k, n - k


def _table_of(tables: Tables, row: int) -> tuple[Floats, Floats, Floats, float]:
    """Return levels in steps, counts and the mean guess rate of one table."""
    used = tables.presented[row] > 0
    u = tables.x[row, used] / tables.prior.step
    return *pooled(u, tables.detected[row, used], tables.presented[row, used]), tables.guesses[
        row
    ].mean


def _probabilities(
    function: FunctionName, z: Floats, gamma: float, lapse: float | Floats
) -> tuple[Floats, Floats]:
    above, below = rise(function, z)
    rest = 1 - gamma - lapse
    return gamma + rest * above, lapse + rest * below
