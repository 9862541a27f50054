"""How well the likeliest psychometric function of a table fits: a bootstrap of its deviance."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.thresholds.function import MAX_LAPSE, rise
from analysis.thresholds.likeliest import deviance, probabilities_at
from analysis.thresholds.likelihood import Axes, binned, log_probabilities, range_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from analysis.thresholds.fit import PsychometricFit
    from analysis.thresholds.likelihood import Tables

    Floats = NDArray[np.float64]

REPLICATES: Final = 499
"""Tables drawn for one p."""
_FIRST_REPLICATES: Final = 99
_MIN_AS_DEVIANT: Final = 10
"""No more tables are drawn once so many of the first deviate as much: p is above 0.1 then."""
_ROUNDING: Final = 1e-5
"""Deviances that differ by less are equal."""
_REFIT_NODES: Final = (41, 21, 6)
"""Of mu, log sigma and lambda, within four standard deviations of the likeliest function."""
_REFIT_RANGE: Final = 4.0
_BLOCK: Final = 500_000
"""Numbers in one block of drawn counts."""


def deviance_p(fit: PsychometricFit, tables: Tables, row: int, seed: int) -> float:
    """Return how often a table drawn from its likeliest function deviates as much from a refit.

    Of a fit without a likeliest function p is NaN. p = (1 + #{D* >= D}) / (1 + drawn tables). The
    table and every drawn one are refitted to the nearest node of one grid around
    the likeliest function. Where ten of the first 99 deviate as much, p is above 0.1 and these are
    all; stopping there makes no p smaller (J. Besag and P. Clifford, Biometrika 78 (1991) 301-304).
    The generator is seeded by `seed` and the counts, so that neither names nor order of
    participants matter. A guess rate with a Beta distribution is drawn for each table, while all
    are fitted with its mean: a rate that blank trials left uncertain is no misfit.
    """
    if math.isnan(fit.deviance):
        return math.nan
    u, k, n = tables.counts(row)
    guess, likelihood, best_lapse = tables.guesses[row], tables.likelihoods[row], fit.mle_lapse_rate
    least, share = math.exp(-(_REFIT_RANGE**2) / 2), tables.lapse_share
    half = _REFIT_RANGE * math.sqrt(likelihood.lapse[1]) / (1 - share)
    ranges = (
        range_of(likelihood.mu, likelihood.values.max(axis=1), least),
        range_of(likelihood.log_sigma, likelihood.values.max(axis=0), least),
        (max(best_lapse - half, 0.0), min(best_lapse + half, MAX_LAPSE)),
    )
    mu, log_sigma, lapse = (
        np.linspace(*ends, nodes) for ends, nodes in zip(ranges, _REFIT_NODES, strict=True)
    )
    axes = Axes(mu, log_sigma, lapse, np.ones_like(lapse), np.array([guess.mean]), np.ones(1))
    lapse, mu, sigma = (
        axis.ravel() for axis in np.meshgrid(lapse, mu, np.exp(log_sigma), indexing="ij")
    )
    log = log_probabilities(tuple(binned(u, k, n)[0].tolist()), axes, tables.function, share)

    def refitted(counts: Floats) -> Floats:
        """Return the deviance of each table from its refit."""
        answers = [binned(u, detected, n)[1:] for detected in counts]
        spread = np.array([[*hits, *(presented - hits)] for hits, presented in answers])
        node = (spread @ log).argmax(axis=1)[:, None]
        z = (u - mu[node]) / sigma[node]
        p, q = probabilities_at(tables.function, z, guess.mean, lapse[node], share)
        return deviance(counts, n, p, q)

    rng = np.random.default_rng([seed, *k.astype(np.int64).tolist(), *n.astype(np.int64).tolist()])
    axis, step = tables.axis, tables.prior.step
    z = (u * step - axis.on_axis(fit.mle_threshold)) * axis.width(1.0) / fit.mle_sigma
    above, _ = rise(tables.function, z)
    observed = float(refitted(k[None])[0]) - _ROUNDING
    as_deviant = drawn = 0
    while drawn < _FIRST_REPLICATES or (drawn < REPLICATES and as_deviant < _MIN_AS_DEVIANT):
        total = _FIRST_REPLICATES if drawn < _FIRST_REPLICATES else REPLICATES
        size = min(max(_BLOCK // len(u), 1), total - drawn)
        rates = np.full((size, 1), guess.mean)
        if guess.beta is not None:
            rates = np.minimum(rng.beta(*guess.beta, (size, 1)), 1 - best_lapse)
        p = rates + share * best_lapse + (1 - rates - best_lapse) * above
        counts = rng.binomial(n.astype(np.int64), np.clip(p, 0.0, 1.0)).astype(np.float64)
        as_deviant += int((refitted(counts) >= observed).sum())
        drawn += size
    return (1 + as_deviant) / (1 + drawn)
