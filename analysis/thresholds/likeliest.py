"""The likeliest psychometric function of a table."""

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
from analysis.thresholds.likelihood import TINY
from analysis.thresholds.tables import checked_tables

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from analysis.thresholds.likelihood import Tables

    Floats = NDArray[np.float64]

_MIN_RISE: Final = 1e-12
_MIN_GAIN: Final = 1e-20
"""Of the log likelihood of a trial, at which the likeliest function is found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbitFit:
    """The likeliest p = Phi((x - mu)/sigma), mu and sigma in the units of x."""

    mu: float
    sigma: float
    deviance: float  # twice the log likelihood ratio of the observed proportions to the fit


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

    one_table = np.asarray(detected)[None], np.asarray(presented)[None]
    tables = checked_tables(x, *one_table, guess_rate=0.0, x_scale="linear", name="x")
    (levels, k, n), step = tables.counts(), tables.prior.step
    counts = " ".join(f"{a:g}/{b:g}" for a, b in zip(k, n, strict=True))
    if len(levels) == 1:
        raise ValueError(f"x must hold at least two levels with stimuli; got {levels * step}")
    if not overlaps(levels, k, n):
        raise ValueError(
            "detected must overlap (a stimulus detected at a lower level than one missed) for a "
            f"likeliest probit function to exist; got {counts}"
        )
    if not overlaps(-levels, k, n):
        raise ValueError(f"detected must rise with x; got {counts}")
    u = levels - levels[0]
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
    intercept, rise_per_step = (float(value) for value in fit.params)
    if not rise_per_step > _MIN_RISE:
        raise ValueError(f"detected must rise with x; got {counts}")
    p, q = rise("normal", intercept + rise_per_step * u)
    return ProbitFit(
        mu=(float(levels[0]) - intercept / rise_per_step) * step,
        sigma=step / rise_per_step,
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
    """Return 2 sum [k log(k / n p) + (n - k) log((n - k) / n q)] over the last axis; q = 1 - p."""
    k, n = np.asarray(detected, dtype=np.float64), presented
    parts = rel_entr(k, n * p) + rel_entr(n - k, n * q)
    return np.asarray(np.maximum(2 * parts.sum(axis=-1), 0.0))


def deviance_residuals(detected: Floats, presented: Floats, p: Floats) -> Floats:
    """Return the signed roots of what each proportion adds to the deviance of p.

    >>> deviance_residuals(np.array([5.0, 9.0]), np.array([10.0, 10.0]), np.array(0.5)).round(3)
    array([0.   , 2.713])
    """
    q = detected / presented
    parts = presented * (rel_entr(q, p) + rel_entr(1 - q, 1 - p))
    return np.asarray(np.sign(q - p) * np.sqrt(np.maximum(2 * parts, 0.0)))


def likeliest_function(tables: Tables, row: int, node: Floats) -> dict[str, float]:
    """Return the likeliest function of a table at its mean guess rate, found from a likely node.

    It has the names of attributes of `PsychometricFit`. sigma and lambda lie within their bounds.
    """
    from scipy.optimize import minimize

    u, k, n = tables.counts(row)
    gamma, misses, total = tables.guesses[row].mean, n - k, n.sum()
    share = tables.lapse_share

    def cost(values: Floats) -> tuple[float, Floats]:
        mu, log_sigma, lapse = values
        z = (u - mu) / math.exp(log_sigma)
        above, _ = rise(tables.function, z)
        p, q = probabilities_at(tables.function, z, gamma, lapse, share)
        push = k / p - misses / q
        steep = (1 - gamma - lapse) * slope(tables.function, z) * push
        gradient = [steep.sum() / math.exp(log_sigma), (steep * z).sum(), (above - share) @ push]
        value = float((xlogy(k, p) + xlogy(misses, q)).sum())
        return -value / total, np.array(gradient) / total

    bounds = ((float(u[0]) - REACH, float(u[-1]) + REACH), LOG_SIGMA, (0.0, MAX_LAPSE))
    best = minimize(
        cost,
        node,
        jac=True,
        bounds=bounds,
        method="SLSQP",
        options={"ftol": _MIN_GAIN, "maxiter": 500},
    )
    mu, log_sigma, lapse = best.x.tolist()
    z = (u - mu) * math.exp(-log_sigma)
    p, q = probabilities_at(tables.function, z, gamma, lapse, share)
    axis, step = tables.axis, tables.prior.step
    return {
        "mle_threshold": axis.level(mu * step),
        "mle_sigma": axis.width(math.exp(log_sigma) * step),
        "mle_lapse_rate": lapse,
        "deviance": float(deviance(k, n, p, q)),
    }


def probabilities_at(
    function: FunctionName, z: Floats, gamma: float, lapse: float | Floats, lapse_share: float
) -> tuple[Floats, Floats]:
    """Return p and 1 - p, neither of them 0."""
    above, below = rise(function, z)
    rest = 1 - gamma - lapse
    p, q = gamma + lapse_share * lapse + rest * above, (1 - lapse_share) * lapse + rest * below
    return np.maximum(p, TINY), np.maximum(q, TINY)
