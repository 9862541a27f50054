"""Whether a table of counts looks as if its fitted function had made it: parametric bootstrap."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from analysis.thresholds.density import Ruler
from analysis.thresholds.mle import Tables, fit_lapsing, probabilities
from analysis.thresholds.probit import deviance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from analysis.axis import XScale
    from analysis.thresholds.fit import PsychometricFit
    from analysis.thresholds.people import GuessRate

    Floats = NDArray[np.float64]


REPLICATES = 499
"""Tables drawn for one p."""
_LOOK = 99
_ENOUGH = 10
"""After `_LOOK` tables, of which so many deviate as much, p is not small: no more are drawn."""
_ROWS = 4000
"""So many drawn tables are fitted at a time."""
_ROUNDING = 1e-5
"""Deviances that differ by less are alike; so are all of a table that any function meets."""

_GAIN = 1e-6
"""A step of the fit that gains less log likelihood moves no deviance that can be told apart."""


def deviance_p(
    x: Floats,
    detected: Floats,
    presented: Floats,
    *,
    fits: Sequence[PsychometricFit],
    guesses: Sequence[GuessRate],
    x_scale: XScale,
    seed: int,
) -> Floats:
    """Return `bootstrap_p` of the fits that have a likeliest function, NaN for others: (fits,).

    Tables and guess rates are those that `fit_many` took; fitted is the mean of a distributed rate,
    and drawn tables have one of it each.
    """
    found = np.full(len(fits), np.nan)
    some = [i for i, fit in enumerate(fits) if fit.mle_sigma > 0]
    if not some:
        return found
    step = np.array([Ruler.of(x[i][presented[i] > 0], x_scale).step for i in some])
    tables = Tables(
        u=x[some] / step[:, None],
        detected=detected[some],
        presented=presented[some],
        guess_rate=np.array([guesses[i].mean for i in some]),
    )
    likeliest = [(fits[i].mle_threshold, fits[i].mle_sigma, fits[i].mle_lapse_rate) for i in some]
    mu, sigma, lapse = np.array(likeliest).T
    best = np.stack([mu / step, np.log(sigma / step), lapse], axis=1)
    found[some] = bootstrap_p(tables, best, seed=seed, betas=[guesses[i].beta for i in some])
    return found


def bootstrap_p(
    tables: Tables,
    best: Floats,
    *,
    seed: int,
    replicates: int = REPLICATES,
    betas: Sequence[tuple[float, float] | None] | None = None,
) -> Floats:
    """Return how often a table drawn from the fitted function deviates from its own fit as much.

    p = (1 + #{D* >= D}) / (1 + drawn tables), where each is fitted anew, of a (fits, 3) `best`: mu,
    log sigma, lambda; a chi-square is not trusted near proportions of 0 and 1 (docs/statistics.md,
    section 8). Where 10 of the first 99 deviate as much, p is above 0.1 and these are all: stopping
    there makes no p smaller (J. Besag and P. Clifford, Biometrika 78 (1991) 301-304). The generator
    is seeded by the table itself and `seed`, so that neither names nor order of participants
    matter. A guess rate with a Beta distribution, of `betas`, is drawn anew for each table, while
    all are fitted with its mean: as blanks tell it the rate may be wrong, which is no misfit.

    A table that is its own fit deviates less than any that is drawn:

    >>> one = Tables(u=np.array([[0.0, 2.0, 4.0]]), detected=np.array([[16.0, 50.0, 84.0]]),
    ...              presented=np.full((1, 3), 100.0), guess_rate=np.zeros(1))
    >>> best = fit_lapsing(one, np.array([[2.0, 0.7, 0.0]]))
    >>> bool(bootstrap_p(one, best, seed=1, replicates=99)[0] > 0.9)
    True
    """
    fits = len(tables)
    p, q = probabilities(tables, best)
    rates = betas or [None] * fits
    drawn = np.stack(
        [
            _drawn(tables, best, row, beta=beta, seed=seed, replicates=replicates)
            for row, beta in enumerate(rates)
        ]
    )
    reached = deviance(tables.detected, tables.presented, p, q) - _ROUNDING
    as_much, done = np.zeros(fits), np.zeros(fits)
    going = np.arange(fits)
    for first, last in itertools.pairwise(sorted({0, min(_LOOK, replicates), replicates})):
        pieces = math.ceil(len(going) * (last - first) / _ROWS)
        for part in np.array_split(going, pieces) if pieces else ():
            again = _deviances(tables[part], best[part], drawn[part, first:last])
            as_much[part] += (again >= reached[part, None]).sum(axis=1)
        done[going] = last
        going = going[as_much[going] < _ENOUGH]
    return np.asarray((1 + as_much) / (1 + done))


def deviance_residuals(detected: Floats, presented: Floats, p: Floats) -> Floats:
    """Return the signed roots of what each proportion adds to the deviance of p.

    >>> deviance_residuals(np.array([5.0, 9.0]), np.array([10.0, 10.0]), np.array(0.5)).round(3)
    array([0.   , 2.713])
    """
    from scipy.special import rel_entr

    q = detected / presented
    parts = presented * (rel_entr(q, p) + rel_entr(1 - q, 1 - p))
    return np.asarray(np.sign(q - p) * np.sqrt(np.maximum(2 * parts, 0.0)))


def _drawn(
    tables: Tables,
    best: Floats,
    row: int,
    *,
    beta: tuple[float, float] | None,
    seed: int,
    replicates: int,
) -> NDArray[np.int64]:
    """Return counts of one table drawn again and again, shape (replicates, levels)."""
    used = tables.presented[row] > 0
    shown = tables.presented[row, used].astype(np.int64)
    own = [*tables.detected[row, used].astype(np.int64).tolist(), *shown.tolist()]
    rng = np.random.default_rng([seed, *own])
    gamma, lapse = tables.guess_rate[row], best[row, 2]
    if beta is not None:
        gamma = np.minimum(rng.beta(*beta, (replicates, 1)), 1 - lapse)
    rise = ndtr((tables.u[row, used] - best[row, 0]) * np.exp(-best[row, 1]))
    p = gamma + (1 - gamma - lapse) * rise
    drawn = np.zeros((replicates, len(used)), dtype=np.int64)
    drawn[:, used] = rng.binomial(shown, p, (replicates, len(shown)))
    return drawn


def _deviances(tables: Tables, best: Floats, drawn: NDArray[np.int64]) -> Floats:
    """Fit drawn tables, shape (fits, draws, levels), and return their deviances, (fits, draws)."""
    draws = drawn.shape[1]
    again = Tables(
        u=np.repeat(tables.u, draws, axis=0),
        detected=drawn.reshape(-1, drawn.shape[2]).astype(np.float64),
        presented=np.repeat(tables.presented, draws, axis=0),
        guess_rate=np.repeat(tables.guess_rate, draws),
    )
    likeliest = fit_lapsing(again, np.repeat(best, draws, axis=0), least_gain=_GAIN)
    p, q = probabilities(again, likeliest)
    return deviance(again.detected, again.presented, p, q).reshape(-1, draws)
