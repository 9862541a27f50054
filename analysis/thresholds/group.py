"""The threshold of a group, in which everybody takes part.

Person i has mu_i ~ N(M, tau) and log sigma_i ~ N(S, omega), with guesses and lapses integrated out
(docs/statistics.md, section 8). Nothing is sampled: the likelihood of M, tau, S and omega is two
products of matrices with the likelihood of each person on its grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from analysis.thresholds.fit import (
    BOUNDED,
    FitStatus,
    PsychometricFit,
    fit_many,
    status_of,
    within_levels,
)
from analysis.thresholds.function import SIGMA_FACTOR, SIGMA_MEDIAN, Prior, class_prior
from analysis.thresholds.likelihood import (
    POINTS,
    TINY,
    quantiles,
    range_of,
    trapezoid,
)
from analysis.thresholds.tables import checked_tables
from stimuli.threads import single_threaded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import ArrayLike, NDArray

    from analysis.axis import XScale
    from analysis.thresholds.function import FunctionName
    from analysis.thresholds.likelihood import Likelihood, Tables

    Floats = NDArray[np.float64]
    Curve = tuple[Floats, Floats]
    """Nodes, and a likelihood there: (nodes,) or (nodes, columns)."""

SPREAD_SCALE: Final = 6.0
"""Steps, of the half-normal prior of tau. Smaller ones cover too little where people differ much.
"""
DB_PER_LOG10: Final = 20.0
MIN_PEOPLE: Final = 5
"""The spread of fewer people comes mostly from its prior."""
NOT_RISING: Final = ("decreasing", "flat")
OMEGA: Final = np.array([0.15, 0.4, 0.8])
"""Three values of the standard deviation of log sigma between people suffice."""
OMEGA_SCALE: Final = 0.5
"""Of the half-normal prior of omega."""
_MIN_SPREAD: Final = 0.05
_OUTSIDE: Final = 18.0
_MAX_PASSES: Final = 12
_SETTLED: Final = 0.6
_SQRT_2PI: Final = math.sqrt(2 * math.pi)
_NAN: Final = math.nan
MIDDLE, SPREAD, LOG_WIDTH = range(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupFit:
    """The threshold of a group of people, every one of whom takes part.

    Attributes
    ----------
    status : str
        Status as in `PsychometricFit`, of the pooled table and the group's median. It is ``flat``
        or ``decreasing`` only if no participant's table rises, and ``one_level`` only if no
        participant had two levels.
    threshold : float
        Posterior median of the center of the people's thresholds, in the levels' unit; NaN if the
        status has none.
    threshold_limits : tuple of float
        95 % equal-tailed limits; an end outside the tested levels is open, -inf or inf.
    spread_db : float
        Posterior median of the standard deviation between people, in dB, or in the levels' unit on
        a linear axis. With fewer than five people it comes mostly from its prior.
    spread_limits_db : tuple of float
        Its 95 % limits.
    new_person_limits : tuple of float
        95 % prediction interval of the threshold of the next person; ends open as above.
    sigma : float
        Median width of the people's functions, in the unit of `PsychometricFit.sigma`.
    sigma_limits : tuple of float
        Its 95 % limits.
    people : tuple of PsychometricFit
        The fit of each person alone.

    Examples
    --------
    The more people differ, the wider is the interval of the next person:

    >>> import numpy as np
    >>> from analysis import fit_group
    >>> levels, presented = [60, 85, 120, 170, 240], np.full((3, 5), 30)
    >>> alike, apart = (fit_group(levels, people, presented, guess_rate=0.0) for people in (
    ...     [[2, 9, 22, 29, 30]] * 3, [[9, 22, 29, 30, 30], [2, 9, 22, 29, 30], [0, 2, 9, 22, 29]]))
    >>> bool(np.ptp(alike.new_person_limits) < np.ptp(apart.new_person_limits))
    True
    """

    status: FitStatus | Literal["one_participant"]
    threshold: float = _NAN
    threshold_limits: tuple[float, float] = (_NAN, _NAN)
    spread_db: float = _NAN
    spread_limits_db: tuple[float, float] = (_NAN, _NAN)
    new_person_limits: tuple[float, float] = (_NAN, _NAN)
    sigma: float = _NAN
    sigma_limits: tuple[float, float] = (_NAN, _NAN)
    people: tuple[PsychometricFit, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Population:
    """The posterior of what people have in common, in steps and log steps, at nodes along each.

    The parameters are the middle, the spread, and of a group S, the mean of log sigma: `MIDDLE`,
    `SPREAD` and `LOG_WIDTH` are their places.
    """

    axes: tuple[Floats, ...]
    cells: Floats

    def density(self, parameter: int) -> Floats:
        """Return the density of a parameter at its nodes."""
        return _margin(self.cells, self.axes, parameter)

    def points(self, parameter: int) -> Floats:
        """Return the points `POINTS` of a parameter."""
        return quantiles(self.density(parameter), self.axes[parameter])

    def next_person_points(self) -> Floats:
        """Return the points `POINTS` of the next person's mu, a mixture of normal distributions.

        The distribution function of each cell is mixed rather than its density, because a spread
        may be much smaller than the step between points at which a density is evaluated. A node of
        M represents all values around it.
        """
        middle, spread, log_sigma = self.axes
        weight = np.outer(trapezoid(middle), trapezoid(spread)) * (
            self.cells @ trapezoid(log_sigma)
        )
        weight /= weight.sum()
        sd = np.hypot(spread, trapezoid(middle)[:, None] / math.sqrt(12))

        def excess(mu: float, point: float) -> float:
            return float((ndtr((mu - middle[:, None]) / sd) * weight).sum()) - point

        ends = middle[0] - 5 * spread[-1], middle[-1] + 5 * spread[-1]
        return np.array([brentq(excess, *ends, args=(point,)) for point in POINTS])

    def drawn(self, number: int, rng: np.random.Generator) -> list[Floats]:
        """Draw all parameters, anywhere between the nodes."""
        weight = reduce(np.multiply.outer, map(trapezoid, self.axes))
        return draws(self.cells * weight, self.axes, number, rng)


def population_draws(
    tables: Tables, number: int, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Draw the middle and the spread of a group on the axis, and S of ln(sigma), to plan with."""
    prior = tables.prior
    middle, spread, log_sigma = posterior_of(tables).drawn(number, rng)
    return middle * prior.step, spread * prior.step, log_sigma + math.log(prior.step)


def draws(
    weight: Floats, axes: Sequence[Floats], number: int, rng: np.random.Generator
) -> list[Floats]:
    """Draw places along axes from weights at their nodes, anywhere around the nodes."""
    below = np.cumsum(weight.ravel())
    # Systematic sampling: the cells are met as often as their weights say, but for one draw.
    at = (np.arange(number) + rng.random()) / number
    chosen = np.minimum(np.searchsorted(below, rng.permutation(at) * below[-1]), weight.size - 1)
    return [
        np.interp(node + rng.uniform(-0.5, 0.5, number), np.arange(len(axis)), axis)
        for node, axis in zip(np.unravel_index(chosen, weight.shape), axes, strict=True)
    ]


def normal_weights(x: Floats, mean: Floats, spread: Floats) -> Floats:
    """Return the weights by which values at nodes x are averaged over normal distributions.

    They are exact for what is linear between the nodes and flat beyond them, however narrow the
    distribution; shape (mean, spread, x).

    >>> x = np.array([0.0, 1.0, 3.0])
    >>> weights = normal_weights(x, np.array([1.4]), np.array([1e-9]))[0]
    >>> weights.round(6).tolist(), bool(np.isclose((weights @ x)[0], 1.4))
    ([[0.0, 0.8, 0.2]], True)
    """
    # The mean of Phi over each cell, from its antiderivative. Differences of these are the
    # integrals of hat functions.
    z = (x - mean[:, None, None]) / spread[:, None]
    rising = spread[:, None] * (z * ndtr(z) + np.exp(-0.5 * z * z) / _SQRT_2PI)
    below = np.diff(rising) / np.diff(x)
    ends = np.ones((len(mean), len(spread), 1))
    return np.maximum(np.diff(below, prepend=0 * ends, append=ends), 0.0)


def normal_log_likelihoods(
    curves: Iterable[Curve], mean: Floats, spread: Floats
) -> Iterator[Floats]:
    """Yield the log likelihood of each person's value where it is N(mean, spread) over people.

    A person's value is known by its likelihood at nodes, which may have columns: parameters that
    all people have in common; (mean, spread) or (mean, spread, columns).
    """
    weights: dict[int, Floats] = {}
    for nodes, values in curves:
        if id(nodes) not in weights:
            weights[id(nodes)] = normal_weights(nodes, mean, spread)
        yield np.log(np.maximum(np.tensordot(weights[id(nodes)], values, axes=1), TINY))


def zoomed(
    cells_at: Callable[..., Floats], axes: Sequence[Floats], numbers: Sequence[int]
) -> Population:
    """Return a posterior on axes that hold what matters of it, with so many nodes.

    A coarse grid over the priors shows what matters. A grid on that is the last one, unless it
    shows that less of it matters.
    """
    cells = cells_at(*axes)
    for turn in range(_MAX_PASSES):
        margins = [_margin(cells, axes, i) for i in range(len(axes))]
        boxes = [range_of(*axis) for axis in zip(axes, margins, strict=True)]
        widths = [np.ptp(box) / np.ptp(axis) for box, axis in zip(boxes, axes, strict=True)]
        if turn and min(widths) >= _SETTLED:
            break
        median = float(quantiles(margins[MIDDLE], axes[MIDDLE], (0.5,))[0])
        axes = [np.linspace(*box, number) for box, number in zip(boxes, numbers, strict=True)]
        # The density is narrowest where the spread is small: there, and at the middle, which
        # is then almost known, but has long tails where people may differ much.
        axes[MIDDLE] = _crowded(axes[MIDDLE], median)
        axes[SPREAD] = _crowded(axes[SPREAD], boxes[SPREAD][0])
        cells = cells_at(*axes)
    return Population(axes=tuple(axes), cells=cells)


def _crowded(axis: Floats, center: float) -> Floats:
    """Return as many nodes between the same ends, the closer together the nearer to a center.

    >>> _crowded(np.array([0.0, 1.0, 2.0, 9.0, 16.0]), 8.0).round(2).tolist()
    [0.0, 5.17, 8.0, 10.83, 16.0]
    """
    low, high = center - axis[0], axis[-1] - center
    place = np.linspace(-(low ** (2 / 3)), high ** (2 / 3), len(axis))
    nodes = center + np.sign(place) * np.abs(place) ** 1.5
    return np.clip(nodes, axis[0], axis[-1])


def _margin(cells: Floats, axes: Sequence[Floats], parameter: int) -> Floats:
    for i in reversed(range(len(axes))):
        if i != parameter:
            cells = np.asarray(np.trapezoid(cells, axes[i], axis=i))
    return cells


@lru_cache(maxsize=4)
def posterior_of(tables: Tables) -> Population:
    """Return the posterior of a group; its threshold, its function and its band need it in turn."""
    return group_posterior(tables.likelihoods, tables.prior)


def group_posterior(people: Sequence[Likelihood], prior: Prior) -> Population:
    """Return the posterior of a group, in steps of the prior of all levels.

    M has the prior of a single mu.
    """
    outside = np.arange(1, 8) / 7 * _OUTSIDE
    between = np.linspace(prior.low, prior.high, 25)
    middle = np.unique(np.concatenate([prior.low - outside, between, prior.high + outside]))
    spread = _MIN_SPREAD + np.concatenate([[0.0], 0.3 * np.cumsum(1.4 ** np.arange(10))])
    half = 2.4 * math.log(SIGMA_FACTOR)
    log_sigma = math.log(SIGMA_MEDIAN * prior.scale) + np.linspace(-half, half, 11)
    of_omega = np.exp(-0.5 * (OMEGA / OMEGA_SCALE) ** 2)

    def cells_at(middle: Floats, spread: Floats, log_sigma: Floats) -> Floats:
        curves = ((person.mu, _over_sigma(person, log_sigma)) for person in people)
        log = np.asarray(sum(normal_log_likelihoods(curves, middle, spread)))
        log = log.reshape(len(middle), len(spread), len(log_sigma), len(OMEGA), -1)
        log += (1 - len(people)) * np.log(class_prior())
        cells = np.einsum("mtsoc,o->mts", np.exp(log - log.max()), of_omega)
        of_spread = np.exp(-0.5 * (spread / (SPREAD_SCALE * prior.scale)) ** 2)
        of_all = np.multiply.outer(np.outer(prior.mu(middle), of_spread), prior.sigma(log_sigma))
        return np.asarray(cells * of_all)

    return zoomed(cells_at, (middle, spread, log_sigma), (41, 21, 9))


def _over_sigma(likelihood: Likelihood, log_sigma: Floats) -> Floats:
    """Average a likelihood over N(S, omega) of log sigma: (mu, S x omega x class)."""
    weights = normal_weights(likelihood.log_sigma, log_sigma, OMEGA)
    averaged = np.tensordot(likelihood.by_class, weights, axes=(2, 2))
    return np.ascontiguousarray(averaged.transpose(1, 2, 3, 0)).reshape(len(likelihood.mu), -1)


def group_fit(tables: Tables) -> GroupFit:
    """Return the fit of a group.

    Its people's own fits decide only where their pooled table does not rise.
    """
    if not tables.several_levels().any():
        return GroupFit(status="one_level")
    prior, axis = tables.prior, tables.axis
    fitted = posterior_of(tables)
    low, middle, high = fitted.points(MIDDLE).tolist()
    status = status_of(*tables.counts(), (low, middle, high), prior)
    if status in NOT_RISING:
        alone = {fit.status for fit in fit_many(tables)}
        if not alone <= {*NOT_RISING, "one_level"}:
            # People below, between and above the levels have a threshold, if not a slope.
            status = "ok" if middle <= prior.high else "median_above_levels"
            status = status if middle >= prior.low else "median_below_levels"
    limits = within_levels(low, high, prior, axis)
    if status in BOUNDED:
        return GroupFit(status=status, threshold_limits=limits)
    if status in NOT_RISING:
        return GroupFit(status=status)
    unit = prior.step * (DB_PER_LOG10 if axis.is_logarithmic else 1)
    least, spread, most = (unit * fitted.points(SPREAD)).tolist()
    next_low, _, next_high = fitted.next_person_points().tolist()
    widths = axis.width(prior.step) * np.exp(fitted.points(LOG_WIDTH))
    sigma_low, sigma, sigma_high = widths.tolist()
    return GroupFit(
        status=status,
        threshold=axis.level(middle * prior.step),
        threshold_limits=limits,
        spread_db=spread,
        spread_limits_db=(least, most),
        new_person_limits=within_levels(min(next_low, low), max(next_high, high), prior, axis),
        sigma=sigma,
        sigma_limits=(sigma_low, sigma_high),
    )


@single_threaded
def fit_group(
    levels: ArrayLike,
    detected: ArrayLike,
    presented: ArrayLike,
    *,
    guess_rate: float | None = None,
    blanks: tuple[ArrayLike, ArrayLike] | None = None,
    x_scale: XScale = "log10",
    function: FunctionName = "normal",
) -> GroupFit:
    """Fit the threshold of a group by a hierarchical model, mu_i ~ N(M, tau), without sampling.

    Equation, priors and coverage: docs/statistics.md, section 8.

    Parameters
    ----------
    levels : array_like, shape (levels,)
        Stimulus levels of all people; above 0 on the axis ``log10``.
    detected, presented : array_like of whole numbers, shape (people, levels)
        Counts; set presented to 0 if a person has no such level.
    guess_rate : float, optional
        gamma of all people, for example 1/2 in forced choice between two sides. Give either this
        or `blanks`.
    blanks : tuple of array_like, shape (people,) each, optional
        False alarms at that side, and blank trials of each person. Beta(1, 10) is assumed for a
        person without blank trials.
    x_scale, function : str
        As for `fit_psychometric`.

    Returns
    -------
    GroupFit

    Raises
    ------
    ValueError
        For impossible counts or levels, and unless exactly one of guess_rate and blanks is given.

    Examples
    --------
    Every person counts. The third one detected everything, and lowers the group's threshold:

    >>> levels, presented = [60, 85, 120, 170, 240], np.full((3, 5), 30)
    >>> two = [[16, 19, 27, 30, 30], [15, 21, 28, 30, 30]]
    >>> both = fit_group(levels, two, presented[:2], guess_rate=0.5)
    >>> all_three = fit_group(levels, [*two, [30] * 5], presented, guess_rate=0.5)
    >>> all_three.threshold < both.threshold, all_three.people[2].status
    (True, 'threshold_below_levels')
    """
    counts = levels, detected, presented
    tables = checked_tables(*counts, guess_rate, blanks, x_scale=x_scale, function=function)
    return replace(group_fit(tables), people=fit_many(tables, likeliest=True))
