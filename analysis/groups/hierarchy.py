"""The threshold of a group, in which everybody takes part.

Person i: mu_i ~ N(M, tau), log sigma_i ~ N(S, omega), all of one kind of lapses; guesses and lapses
integrated out (docs/statistics.md, section 8). Nothing is drawn: each value of the hyperparameters
is two products of matrices with each person's likelihood on its grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr

from analysis.thresholds.density import Ruler, kind_prior, quantiles, sigma_prior, trapezoid
from analysis.thresholds.fit import fit_many
from analysis.thresholds.grid import surfaces
from analysis.thresholds.mle import SIGMA_FACTOR, SIGMA_MEDIAN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from analysis.axis import XScale
    from analysis.thresholds.fit import PsychometricFit
    from analysis.thresholds.grid import Surface
    from analysis.thresholds.people import GuessRate

    Floats = NDArray[np.float64]


SPREAD: Final = 6.0
"""Half-normal prior of tau, steps; smaller ones cover too little where people differ much."""
FEW: Final = 5
"""Of fewer people the spread comes mostly from its prior."""
_LEAST_SPREAD: Final = 0.05
OMEGA: Final = np.array([0.15, 0.4, 0.8])
"""log sigma of people varies by this; half-normal prior of 0.5. Three values are enough."""
OMEGA_SPREAD: Final = 0.5
_OUTSIDE: Final = 18.0
_TINY: Final = 1e-300
_MATTERS: Final = 1e-5
"""Of the greatest density; what is less likely is left out of the next grid."""
_PASSES: Final = 12
_SETTLED: Final = 0.6
_SQRT_2PI: Final = math.sqrt(2 * math.pi)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeopleTables:
    """Counts of people on the axis, (people, levels), and their guess rates."""

    x: Floats
    detected: Floats
    presented: Floats
    guesses: Sequence[GuessRate]
    x_scale: XScale

    def ruler(self) -> Ruler | None:
        """Measure the levels of all; one level of a linear axis measures nothing."""
        used = self.x[self.presented > 0]
        return Ruler.of(used, self.x_scale) if self.x_scale == "log10" or np.ptp(used) else None

    def ruler_with(self, other: PeopleTables) -> Ruler:
        """Return the ruler of these and other tables, on a logarithmic axis."""
        return Ruler.of(np.concatenate([o.x[o.presented > 0] for o in (self, other)]), "log10")

    def surfaces(self, ruler: Ruler) -> list[Surface]:
        """Return the likelihood of each person on a common ruler."""
        counts = (self.x / ruler.step, self.detected, self.presented)
        rulers = [ruler] * len(self.x)
        return surfaces(*counts, rulers=rulers, guesses=self.guesses)

    def fits(self) -> tuple[PsychometricFit, ...]:
        """Fit each person by themselves."""
        counts = (self.x, self.detected, self.presented)
        return fit_many(*counts, guesses=self.guesses, x_scale=self.x_scale)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hierarchy:
    """The posterior of the middle M and the spread tau of a group, in steps of the prior."""

    middle: Floats
    spread: Floats
    density: Floats  # (middle, spread), priors included
    log_sigma: Floats  # S
    cells: Floats  # (middle, spread, log_sigma): the density before S is integrated out
    of_kind: Floats  # how probable it is that all people are of each of `density.kinds`

    def of_middle(self) -> Floats:
        """Return the points of `density.QUANTILES` of M."""
        return np.asarray(quantiles((self.density @ trapezoid(self.spread))[None], self.middle)[0])

    def of_spread(self) -> Floats:
        """Return the points of `density.QUANTILES` of tau."""
        return np.asarray(quantiles((trapezoid(self.middle) @ self.density)[None], self.spread)[0])

    def of_a_new_person(self) -> Floats:
        """Return the points of `density.QUANTILES` of the next person's mu."""
        weight = np.outer(trapezoid(self.middle), trapezoid(self.spread)) * self.density
        reach = 5 * self.spread[-1]
        mu = np.linspace(self.middle[0] - reach, self.middle[-1] + reach, 161)
        z = (mu[:, None, None] - self.middle[:, None]) / self.spread
        normal = np.exp(-0.5 * z * z) / self.spread
        return np.asarray(quantiles((normal * weight).sum(axis=(1, 2))[None], mu)[0])

    def drawn(self, number: int, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
        """Draw M, tau and S, anywhere between the nodes."""
        axes = (self.middle, self.spread, self.log_sigma)
        weight = self.cells * np.einsum("i,j,k->ijk", *(trapezoid(axis) for axis in axes))
        chosen = rng.choice(weight.size, number, p=weight.ravel() / weight.sum())
        middle, spread, log_sigma = (
            np.interp(at + rng.uniform(-0.5, 0.5, number), np.arange(len(axis)), axis)
            for at, axis in zip(np.unravel_index(chosen, weight.shape), axes, strict=True)
        )
        return middle, spread, log_sigma


def normal_weights(x: Floats, middle: Floats, spread: Floats) -> Floats:
    """Return the weights by which values at nodes x are averaged over normal distributions.

    Exact for what is linear between the nodes and flat beyond them, however narrow the
    distribution; shape (middle, x), for as many spreads as middles.

    >>> x = np.array([0.0, 1.0, 3.0])
    >>> weights = normal_weights(x, np.array([1.4]), np.array([1e-9]))
    >>> weights.round(6).tolist(), bool(np.isclose((weights @ x)[0], 1.4))
    ([[0.0, 0.8, 0.2]], True)
    """
    # The mean of Phi over each cell, from its antiderivative; its differences are the integrals of
    # hat functions.
    z = (x - middle[:, None]) / spread[:, None]
    rising = spread[:, None] * (z * ndtr(z) + np.exp(-0.5 * z * z) / _SQRT_2PI)
    below = np.diff(rising, axis=1) / np.diff(x)
    ends = np.ones((len(middle), 1))
    return np.maximum(np.diff(below, axis=1, prepend=0 * ends, append=ends), 0.0)


def hierarchy(found: Sequence[Surface], ruler: Ruler, *, prior_of_middle: bool = True) -> Hierarchy:
    """Return the posterior of a group from its people's likelihoods, on the ruler of all levels.

    M has the prior of a single mu, or none: a difference of two groups is not to be pulled to 0.
    """
    outside = np.arange(1, 8) / 7 * _OUTSIDE
    between = np.linspace(ruler.low, ruler.high, 25)
    middle = np.unique(np.concatenate([ruler.low - outside, between, ruler.high + outside]))
    spread = _LEAST_SPREAD + np.concatenate([[0.0], 0.3 * np.cumsum(1.4 ** np.arange(10))])
    half = 2.4 * math.log(SIGMA_FACTOR)
    log_sigma = math.log(SIGMA_MEDIAN) + np.linspace(-half, half, 7)
    # A coarse grid over the priors finds what matters; a grid on that is the last one, unless it
    # shows that less of it matters.
    for turn in range(_PASSES):
        total = _log_likelihood(found, middle, spread, log_sigma)
        of_spread = np.exp(-0.5 * (spread / SPREAD) ** 2)
        of_omega = np.exp(-0.5 * (OMEGA / OMEGA_SPREAD) ** 2)
        prior = of_spread[:, None] * sigma_prior(log_sigma)
        if prior_of_middle:
            prior = prior * ruler.mu_prior(middle)[:, None, None]
        by_kind = (np.exp(total - total.max()) @ of_omega) * prior
        cells = by_kind.sum(axis=0)
        in_middle, in_spread = trapezoid(middle), trapezoid(spread)
        in_sigma = trapezoid(log_sigma)
        density = cells @ in_sigma
        margins = (
            (middle, density @ in_spread, 41),
            (spread, in_middle @ density, 21),
            (log_sigma, np.einsum("mts,m,t->s", cells, in_middle, in_spread), 7),
        )
        boxes = [matters(axis, margin) for axis, margin, _ in margins]
        if turn and not any(
            np.ptp(box) < _SETTLED * np.ptp(axis)
            for box, (axis, _, _) in zip(boxes, margins, strict=True)
        ):
            break
        middle, spread, log_sigma = (
            np.linspace(*box, count) for box, (_, _, count) in zip(boxes, margins, strict=True)
        )
        # The density of a small spread is the narrowest.
        spread = spread[0] + (spread - spread[0]) ** 1.5 / np.sqrt(np.ptp(spread))
    of_kind = np.einsum("kmts,m,t,s->k", by_kind, in_middle, in_spread, in_sigma)
    return Hierarchy(
        middle=middle,
        spread=spread,
        density=density,
        log_sigma=log_sigma,
        cells=cells,
        of_kind=of_kind / of_kind.sum(),
    )


def _log_likelihood(
    found: Sequence[Surface], middle: Floats, spread: Floats, log_sigma: Floats
) -> Floats:
    """Return the log likelihood of the hyperparameters, shape (kind, middle, spread, S, omega).

    With the prior of the kinds.
    """
    of_mu, of_sigma = (
        [np.ravel(one) for one in np.meshgrid(*axes, indexing="ij")]
        for axes in ((middle, spread), (log_sigma, OMEGA))
    )
    weights: dict[int, Floats] = {}
    prior = np.repeat(kind_prior(), len(of_sigma[0]))
    total = np.tile((1 - len(found)) * np.log(prior), (len(of_mu[0]), 1))
    # Fresh memory for each of a thousand people would take as long as their sums.
    person = np.empty_like(total)
    for one in found:
        for axis, (at, width) in ((one.mu, of_mu), (one.log_sigma, of_sigma)):
            if id(axis) not in weights:
                weights[id(axis)] = normal_weights(axis, at, width)
        # Over sigma first: that leaves the least to do for each of the many values of mu.
        half = (one.by_kind @ weights[id(one.log_sigma)].T).transpose(1, 0, 2)
        np.matmul(weights[id(one.mu)], half.reshape(len(one.mu), -1), out=person)
        total += np.log(np.maximum(person, _TINY, out=person), out=person)
    shape = (len(middle), len(spread), -1, len(log_sigma), len(OMEGA))
    return np.ascontiguousarray(np.moveaxis(total.reshape(shape), 2, 0))


def matters(axis: Floats, margin: Floats, least: float = _MATTERS) -> tuple[float, float]:
    """Return the ends of what matters, with a node around."""
    near = np.flatnonzero(margin > least * margin.max())
    return float(axis[max(near[0] - 1, 0)]), float(axis[min(near[-1] + 1, len(axis) - 1)])
