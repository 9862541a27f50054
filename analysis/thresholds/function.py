"""Psychometric functions p = gamma + (1 - gamma - lambda) F((x - mu) / sigma), and their priors.

Every F is 1/2 at 0 and as steep there as the cumulative normal distribution, so that mu, sigma and
their priors mean the same for all of them. Priors (docs/statistics.md, section 8) are stated in
steps: 1 dB where levels are logarithmic, 1/8 of the tested range where they are linear. mu is
uniform between the levels and falls exponentially outside, sigma is log-normal, and lambda is
Beta(1, 10) on [0, 0.1].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from scipy.special import expit, logit, ndtr, ndtri, roots_legendre

from analysis.axis import VOLTS, Axis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

FunctionName = Literal["normal", "logistic", "weibull", "gumbel"]
SIGMA_MEDIAN: Final = 2.0
SIGMA_FACTOR: Final = 2.5
LOG_SIGMA: Final = (
    math.log(SIGMA_MEDIAN) - 3.2 * math.log(SIGMA_FACTOR),
    math.log(SIGMA_MEDIAN) + 3.2 * math.log(SIGMA_FACTOR),
)
"""99.9 % of the prior of log sigma lie between these."""
MAX_LAPSE: Final = 0.1
REACH: Final = 24.0
"""Steps outside the levels within which a threshold may lie."""
_SLOPE: Final = 1 / math.sqrt(2 * math.pi)
_LN_2: Final = math.log(2)
_MAX_EXPONENT: Final = 700.0


def rise(function: FunctionName, z: Floats) -> tuple[Floats, Floats]:
    """Return F(z) and 1 - F(z); neither loses digits near 0.

    A Weibull function of the level is a Gumbel function of its logarithm:

    >>> [round(float(rise(name, np.array(1.0))[0]), 3) for name in ("normal", "logistic", "gumbel")]
    [0.841, 0.831, 0.888]
    """
    if function == "normal":
        return ndtr(z), ndtr(-z)
    if function == "logistic":
        return expit(4 * _SLOPE * z), expit(-4 * _SLOPE * z)
    hazard = _LN_2 * np.exp(np.minimum(2 * _SLOPE / _LN_2 * z, _MAX_EXPONENT))
    return -np.expm1(-hazard), np.exp(-hazard)


def slope(function: FunctionName, z: Floats) -> Floats:
    """Return the derivative of F at z."""
    if function == "normal":
        return np.asarray(_SLOPE * np.exp(-0.5 * z * z))
    if function == "logistic":
        return np.asarray(4 * _SLOPE * np.multiply(*rise(function, z)))
    exponent = np.minimum(2 * _SLOPE / _LN_2 * z, _MAX_EXPONENT)
    return np.asarray(2 * _SLOPE * np.exp(exponent - _LN_2 * np.exp(exponent)))


def inverse(function: FunctionName, share: Floats) -> Floats:
    """Return z with F(z) = share, for shares between 0 and 1.

    >>> z = np.array([-1.0, 0.0, 2.0])
    >>> inverse("weibull", rise("weibull", z)[0]).round(12).tolist()
    [-1.0, 0.0, 2.0]
    """
    if function == "normal":
        return np.asarray(ndtri(share))
    if function == "logistic":
        return np.asarray(logit(share) / (4 * _SLOPE))
    return np.asarray(np.log(-np.log1p(-share) / _LN_2) * _LN_2 / (2 * _SLOPE))


@dataclass(frozen=True, slots=True, kw_only=True)
class Prior:
    """The prior of mu and sigma, both in steps.

    `low` and `high` are the lowest and the highest level in steps, `step` a step on the axis.
    `scale` differs from 1 where the levels of all people make the steps, but the levels of one
    person make the prior.
    """

    low: float
    high: float
    step: float
    tail: float  # steps over which the density of mu falls to 1/e outside the levels
    scale: float = 1.0

    @classmethod
    def of(cls, x: Floats, axis: Axis = VOLTS, step: float | None = None) -> Prior:
        """Return the prior that goes with tested levels, which are places on the axis.

        >>> Prior.of(np.array([1.0, 2.0])).step
        0.05
        >>> Prior.of(np.array([3.0, 11.0]), Axis(x_scale="linear")).step
        1.0
        """
        natural, tail = (1 / 20, 3.0) if axis.is_logarithmic else (float(np.ptp(x)) / 8, 2.0)
        step = step or natural or 1.0
        return cls(
            low=float(x.min()) / step,
            high=float(x.max()) / step,
            step=step,
            tail=tail,
            scale=(natural / step) or 1.0,
        )

    def mu(self, mu: Floats) -> Floats:
        """Return the density of mu, 1 between the levels."""
        outside = np.maximum(np.maximum(self.low - mu, mu - self.high), 0.0)
        return np.asarray(np.exp(-outside / (self.tail * self.scale)))

    def sigma(self, log_sigma: Floats) -> Floats:
        """Return the density of log sigma, 1 at its median."""
        z = (log_sigma - math.log(SIGMA_MEDIAN * self.scale)) / math.log(SIGMA_FACTOR)
        return np.asarray(np.exp(-0.5 * z * z))


@cache
def legendre(nodes: int) -> tuple[Floats, Floats]:
    """Return the nodes and weights of Gauss and Legendre on [0, 1]."""
    at, weight = roots_legendre(nodes)
    return (at + 1) / 2, weight / 2


def lapse_nodes(low: float, high: float, nodes: int) -> tuple[Floats, Floats]:
    """Return nodes of lambda between two bounds, and their weights with its prior."""
    at, weight = legendre(nodes)
    lapse = low + (high - low) * at
    return lapse, weight * (1 - lapse) ** 9


def lapse_classes(lapse: Floats) -> Floats:
    """Return how much lambda belongs to each of three classes, careful to careless.

    One person may be of any class, and has the prior of lambda, as the shares sum to 1. All people
    of a group are of the same class: how careless they are in common is no error that averages out.

    >>> lapse_classes(np.array([0.0, 0.05, 0.1])).tolist()
    [[1.0, 0.25, 0.0], [0.0, 0.5, 0.0], [0.0, 0.25, 1.0]]
    """
    share = lapse / MAX_LAPSE
    return np.stack([(1 - share) ** 2, 2 * share * (1 - share), share**2])


@cache
def class_prior() -> Floats:
    """Return the prior probability of each class."""
    lapse, weight = lapse_nodes(0.0, MAX_LAPSE, 12)
    return np.asarray(lapse_classes(lapse) @ weight / weight.sum())
