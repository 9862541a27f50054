"""Whether a table of counts looks as if its fitted function had made it: parametric bootstrap."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analysis.likelihood import Tables, fit_lapsing, probabilities
from analysis.probit import deviance
from analysis.psychometric import WITH_THRESHOLD, scale

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from analysis.guessing import GuessRate
    from analysis.psychometric import PsychometricFit

    Floats = NDArray[np.float64]

REPLICATES = 499
"""Tables drawn for one p."""

_GAIN = 1e-6
"""A step of the fit that gains less log likelihood moves no deviance that can be told apart."""


def deviance_p(
    x: Floats,
    detected: Floats,
    presented: Floats,
    *,
    fits: Sequence[PsychometricFit],
    guesses: Sequence[GuessRate],
    seed: int,
) -> Floats:
    """Return `bootstrap_p` of the fits that have a threshold, NaN for the others.

    Parameters
    ----------
    x, detected, presented : ndarray of float64, shape (fits, levels)
        As `psychometric.fit_many` took them.
    fits : sequence of PsychometricFit
        What it returned.
    guesses : sequence of GuessRate
        With which; a distributed rate counts as its mean.
    seed : int
        Of all draws.

    Returns
    -------
    ndarray of float64, shape (fits,)
    """
    found = np.full(len(fits), np.nan)
    some = [i for i, fit in enumerate(fits) if fit.status in WITH_THRESHOLD]
    if not some:
        return found
    scaled = scale(x[some], presented[some])
    tables = Tables(
        u=scaled.u,
        detected=detected[some],
        presented=presented[some],
        guess_rate=np.array([guesses[i].mean for i in some]),
    )
    likeliest = [(fits[i].mle_threshold, fits[i].mle_sigma, fits[i].mle_lapse_rate) for i in some]
    mu, sigma, lapse = np.array(likeliest).T
    best = np.stack([(mu - scaled.low) / scaled.width, np.log(sigma / scaled.width), lapse], axis=1)
    found[some] = bootstrap_p(tables, best, seed=seed)
    return found


def bootstrap_p(tables: Tables, best: Floats, *, seed: int, replicates: int = REPLICATES) -> Floats:
    """Return how often a table drawn from the fitted function deviates from its own fit as much.

    p = (1 + #{D* >= D}) / (1 + replicates), where each drawn table is fitted anew; a chi-square is
    not trusted near proportions of 0 and 1 (docs/statistics.md, section 8). The generator is seeded
    by the table itself and `seed`, so that neither names nor order of participants matter.

    Parameters
    ----------
    tables : Tables
    best : ndarray of float64, shape (fits, 3)
        Likeliest mu, log sigma and lambda, by which the tables are drawn.
    seed : int
        Of all draws.
    replicates : int
        Drawn tables for each.

    Returns
    -------
    ndarray of float64, shape (fits,)

    Examples
    --------
    A table that is its own fit deviates less than any that is drawn:

    >>> one = Tables(u=np.array([[0.0, 0.5, 1.0]]), detected=np.array([[16.0, 50.0, 84.0]]),
    ...              presented=np.full((1, 3), 100.0), guess_rate=np.zeros(1))
    >>> best = fit_lapsing(one, np.array([[0.5, -0.7, 0.0]]))
    >>> bool(bootstrap_p(one, best, seed=1, replicates=99)[0] > 0.9)
    True
    """
    values = [
        _one(tables[slice(i, i + 1)], best[i : i + 1], seed, replicates) for i in range(len(tables))
    ]
    return np.array(values)


def _one(table: Tables, best: Floats, seed: int, replicates: int) -> float:
    p, q = probabilities(table, best)
    counts = np.concatenate([table.detected[0], table.presented[0]]).astype(np.int64)
    rng = np.random.default_rng([seed, *counts.tolist()])
    drawn = rng.binomial(table.presented[0].astype(np.int64), p[0], (replicates, p.shape[1]))
    again = Tables(
        u=np.repeat(table.u, replicates, axis=0),
        detected=drawn.astype(np.float64),
        presented=np.repeat(table.presented, replicates, axis=0),
        guess_rate=np.repeat(table.guess_rate, replicates),
    )
    start = np.repeat(best, replicates, axis=0)
    refitted = probabilities(again, fit_lapsing(again, start, least_gain=_GAIN))
    reached = deviance(table.detected, table.presented, p, q)[0]
    deviances = deviance(again.detected, again.presented, *refitted)
    as_much = int((deviances >= reached * (1 - 1e-9)).sum())
    return (1 + as_much) / (1 + replicates)
