"""What the likelihoods of psychometric functions and the prior tell together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from analysis.thresholds.density import quantiles, trapezoid
from analysis.thresholds.grid import Ruler, Surface, sigma_prior

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Posterior:
    """What is known of many psychometric functions, in steps of the prior."""

    mu: Floats  # at the points of `density.QUANTILES`, as log_sigma: (fits, 3)
    log_sigma: Floats
    lapse_rate: Floats  # mean: (fits,)
    best: Floats  # likeliest node of the grid, mu, log sigma and lambda: (fits, 3)


def posterior(found: Sequence[Surface], rulers: Sequence[Ruler]) -> Posterior:
    """Return the posterior of every table, from its likelihood."""
    fits = len(found)
    mu, log_sigma = np.empty((fits, 3)), np.empty((fits, 3))
    for rows in _on_common_axes(found, rulers):
        first, ruler = found[rows[0]], rulers[rows[0]]
        values = np.stack([found[row].values for row in rows])
        in_sigma = sigma_prior(first.log_sigma)
        of_mu = (values @ (trapezoid(first.log_sigma) * in_sigma)) * ruler.mu_prior(first.mu)
        in_mu = trapezoid(first.mu) * ruler.mu_prior(first.mu)
        mu[rows] = quantiles(of_mu, first.mu)
        log_sigma[rows] = quantiles((in_mu @ values) * in_sigma, first.log_sigma)
    return Posterior(
        mu=mu,
        log_sigma=log_sigma,
        lapse_rate=np.array([one.lapse_rate for one in found]),
        best=np.array([one.best for one in found]),
    )


def _on_common_axes(found: Sequence[Surface], rulers: Sequence[Ruler]) -> list[list[int]]:
    groups: dict[object, list[int]] = {}
    for i, (one, ruler) in enumerate(zip(found, rulers, strict=True)):
        groups.setdefault((id(one.mu), ruler), []).append(i)
    return list(groups.values())
