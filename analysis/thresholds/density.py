"""Priors, nodes, weights, and the points of a density that is known at nodes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import roots_legendre

from analysis.definitions import LIMITS
from analysis.thresholds.mle import LOG_SIGMA, MOST_LAPSES, REACH, SIGMA_FACTOR, SIGMA_MEDIAN

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from analysis.axis import XScale
    from analysis.thresholds.people import GuessRate

    Floats = NDArray[np.float64]


QUANTILES: Final = (LIMITS[0], 0.5, LIMITS[1])
_TINY: Final = 1e-300
_RESOLVED: Final = 2.2
"""Standard deviations between nodes; sums over a normal density are then 3 % off."""
_AT_END: Final = 1e-3
"""Of the probability; with more on a last node, some lies beyond."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ruler:
    """The levels of a table, and what a step of the prior is on their axis.

    >>> Ruler.of(np.array([1.0, 2.0]), "log10").step, Ruler.of(np.array([3.0, 11.0]), "linear").step
    (0.05, 1.0)
    """

    low: float  # lowest and highest level, in steps
    high: float
    step: float  # of the prior, on the axis
    tail: float  # steps over which the prior of mu falls to 1/e outside the levels

    @classmethod
    def of(cls, x: Floats, x_scale: XScale) -> Ruler:
        """Measure levels on the axis; a linear one must have some range."""
        step, tail = (1 / 20, 3.0) if x_scale == "log10" else (float(np.ptp(x)) / 8, 2.0)
        return cls(low=float(x.min()) / step, high=float(x.max()) / step, step=step, tail=tail)

    def mu_prior(self, mu: Floats) -> Floats:
        """Return the prior density of mu, 1 between the levels."""
        outside = np.maximum(np.maximum(self.low - mu, mu - self.high), 0.0)
        return np.asarray(np.exp(-outside / self.tail))


def sigma_prior(log_sigma: Floats) -> Floats:
    """Return the prior density of log sigma, 1 at its median."""
    z = (log_sigma - math.log(SIGMA_MEDIAN)) / math.log(SIGMA_FACTOR)
    return np.asarray(np.exp(-0.5 * z * z))


def trapezoid(x: Floats) -> Floats:
    """Return the weights of the trapezoidal rule.

    >>> trapezoid(np.array([0.0, 1.0, 3.0])).tolist()
    [0.5, 1.5, 1.0]
    """
    weights = np.zeros_like(x)
    half = np.diff(x) / 2
    weights[:-1] += half
    weights[1:] += half
    return weights


def in_sigma(log_sigma: Floats) -> Floats:
    """Return the weights by which a likelihood is integrated over the prior of log sigma."""
    return trapezoid(log_sigma) * sigma_prior(log_sigma)


@cache
def legendre(points: int) -> tuple[Floats, Floats]:
    """Return the nodes of Gauss and Legendre on [0, 1] and their weights.

    >>> at, weight = legendre(3)
    >>> round(float(weight @ at**5), 12)
    0.166666666667
    """
    at, weight = roots_legendre(points)
    return (at + 1) / 2, weight / 2


def lapses(low: float, high: float, points: int) -> tuple[Floats, Floats]:
    """Return nodes of lambda and the weights of its prior, Beta(1, 10), between two bounds."""
    at, weight = legendre(points)
    lapse = low + (high - low) * at
    return lapse, weight * (1 - lapse) ** 9


@dataclass(frozen=True, slots=True, kw_only=True)
class Nodes:
    """How many points a grid has in each direction."""

    between: int = 61  # of mu between the levels
    outside: int = 16  # of mu on either side of them, ever farther apart
    log_sigma: int = 25
    lapse: int = 6
    guess: int = 12  # in a box; over the prior, as many as its blanks need


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Axes:
    """Nodes along each parameter, and the weights of those that are integrated out."""

    mu: Floats
    log_sigma: Floats
    lapse: Floats
    lapse_weight: Floats
    guess: Floats
    guess_weight: Floats  # of the angle arcsin(sqrt(gamma)), whose density comes beside


def over_prior(ruler: Ruler, rates: Floats, nodes: Nodes) -> Axes:
    """Lay axes over all that the prior allows."""
    mu, log_sigma = _mu_and_log_sigma(ruler, nodes)
    lapse, lapse_weight = lapses(0.0, MOST_LAPSES, nodes.lapse)
    return Axes(
        mu=mu,
        log_sigma=log_sigma,
        lapse=lapse,
        lapse_weight=lapse_weight,
        guess=rates,
        guess_weight=np.ones(len(rates)),
    )


@lru_cache(maxsize=64)
def _mu_and_log_sigma(ruler: Ruler, nodes: Nodes) -> tuple[Floats, Floats]:
    """Return these two axes, the same arrays for people with levels of their own on one ruler.

    What is made once for an axis, such as the weights of a hierarchy, is then made for all.
    """
    # Of one level, or of levels next to each other, the nodes lie at least as far as a step around.
    middle, half = (ruler.low + ruler.high) / 2, max((ruler.high - ruler.low) / 2, 1.0)
    between = np.linspace(middle - half, middle + half, nodes.between)
    steps = np.cumsum(_growing(nodes.outside) * REACH)
    mu = np.concatenate([between[0] - steps[::-1], between, between[-1] + steps])
    return mu, np.linspace(LOG_SIGMA[0], LOG_SIGMA[1], nodes.log_sigma)


@cache
def _growing(count: int) -> Floats:
    """Return steps that sum to 1, of which the last is twenty times the first."""
    steps = 20 ** (np.arange(count) / max(count - 1, 1))
    return np.asarray(steps / steps.sum())


def within(box: tuple[Floats, ...], guess: GuessRate, nodes: Nodes) -> Axes:
    """Lay axes over a box."""
    mu, log_sigma, rates, gammas = box
    lapse, lapse_weight = lapses(rates[0], rates[1], nodes.lapse)
    gamma, gamma_weight = np.array([guess.mean]), np.ones(1)
    if not guess.known:  # its density has no infinite value over the angle
        at, gamma_weight = legendre(nodes.guess)
        angles = np.arcsin(np.sqrt(gammas))
        gamma = np.sin(angles[0] + at * np.ptp(angles)) ** 2
    return Axes(
        mu=np.linspace(mu[0], mu[1], nodes.between),
        log_sigma=np.linspace(log_sigma[0], log_sigma[1], nodes.log_sigma),
        lapse=lapse,
        lapse_weight=lapse_weight,
        guess=gamma,
        guess_weight=gamma_weight,
    )


def kinds(lapse: Floats) -> Floats:
    """Return how much people who lapse that often are of each kind: careful to careless.

    Alone a person may be of any kind and has the prior of lambda, as shares sum to 1; the people of
    a group are of one kind, so that what all have in common is no error of each of them.

    >>> kinds(np.array([0.0, 0.05, 0.1])).tolist()
    [[1.0, 0.25, 0.0], [0.0, 0.5, 0.0], [0.0, 0.25, 1.0]]
    """
    part = lapse / MOST_LAPSES
    return np.stack([(1 - part) ** 2, 2 * part * (1 - part), part**2])


@cache
def kind_prior() -> Floats:
    """Return the prior probability of each kind."""
    lapse, weight = lapses(0.0, MOST_LAPSES, 12)
    return np.asarray(kinds(lapse) @ weight / weight.sum())


def quantiles(density: Floats, x: Floats) -> Floats:
    """Return the points of `QUANTILES`: densities (fits, nodes) at increasing x, to (fits, 3).

    Half of an even density lies on either side:

    >>> x = np.linspace(-8, 8, 41)
    >>> quantiles(np.exp(-x * x / 2)[None], x).round(2).tolist()
    [[-1.96, 0.0, 1.96]]
    """
    share = _shares(density, x)
    return np.stack([_point(density, share, x, wanted) for wanted in QUANTILES], axis=1)


def unresolved(share: Floats, angle: Floats) -> NDArray[np.bool_]:
    """Tell where probabilities of nodes, (fits, nodes), are too narrow for them or go on beyond.

    A density whose first node lies half a step from 0 is the half of an even one.
    """
    mirrored = 2 * angle[0] < angle[1]
    rows, peak = np.arange(len(share)), share.argmax(axis=1) + 1
    ends = np.full((len(share), 1), _TINY)
    padded = np.maximum(np.hstack([share[:, :1] if mirrored else ends, share, ends]), _TINY)
    before, at, after = (np.log(padded[rows, peak + step]) for step in (-1, 0, 1))
    # Of a normal density the logarithm falls to both sides by the square of a step, together.
    steep = 2 * at - before - after > _RESOLVED**2
    beyond = (share[:, -1] > _AT_END) | (~np.bool_(mirrored) & (share[:, 0] > _AT_END))
    return np.asarray(steep | beyond)


def _shares(density: Floats, x: Floats) -> Floats:
    """Return the probability below each node.

    The trapezoidal rule with the end correction of Euler and Maclaurin in every cell, slopes by
    differences; a cell whose correction would leave it nothing has no probability.
    """
    step = np.diff(x)
    slope = np.gradient(density, x, axis=1)
    pieces = step * (density[:, 1:] + density[:, :-1]) / 2
    pieces -= step**2 * np.diff(slope, axis=1) / 12
    total = np.cumsum(np.maximum(pieces, 0.0), axis=1)
    share = total / np.maximum(total[:, -1:], _TINY)
    return np.concatenate([np.zeros((len(density), 1)), share], axis=1)


def _point(density: Floats, share: Floats, x: Floats, wanted: float) -> Floats:
    rows = np.arange(len(density))
    cell = np.clip((share < wanted).sum(axis=1) - 1, 0, len(x) - 2)
    low, high = share[rows, cell], share[rows, cell + 1]
    part = np.clip((wanted - low) / np.maximum(high - low, _TINY), 0.0, 1.0)
    first, last = density[rows, cell], density[rows, cell + 1]
    # Linear within the cell: first t + (last - first) t^2 / 2 is the part of its integral.
    root = np.sqrt(first**2 + part * (last**2 - first**2))
    t = part * (first + last) / np.maximum(first + root, _TINY)
    return np.asarray(x[cell] + np.clip(t, 0.0, 1.0) * (x[cell + 1] - x[cell]))
