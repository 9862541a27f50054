"""The threshold of a group, in which everybody takes part.

Person i has mu_i ~ N(M, tau) and log sigma_i ~ N(S, omega), with guesses and lapses integrated out
(docs/statistics.md, section 8). Nothing is sampled: the likelihood of M, tau, S and omega is two
products of matrices with the likelihood of each person on its grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr

from analysis.counts.intervals import checked_counts
from analysis.thresholds.fit import (
    BOUNDED,
    FitStatus,
    PsychometricFit,
    check_function,
    fit_many,
    in_levels,
    status_of,
    with_likeliest,
    within_levels,
)
from analysis.thresholds.function import SIGMA_FACTOR, SIGMA_MEDIAN, Prior, class_prior
from analysis.thresholds.guess import GuessRate
from analysis.thresholds.likelihood import (
    POINTS,
    TINY,
    Tables,
    checked_levels,
    likelihoods,
    quantiles,
    range_of,
    trapezoid,
)
from stimuli.tuned import tuned

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from analysis.axis import XScale
    from analysis.thresholds.function import FunctionName
    from analysis.thresholds.likelihood import Likelihood

    Floats = NDArray[np.float64]
    Curve = tuple[Floats, Floats]
    """Nodes, and a likelihood there: (nodes, columns)."""

SPREAD_SCALE: Final = 6.0
"""Steps, of the half-normal prior of tau. Smaller ones cover too little where people differ much.
"""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupFit:
    """The threshold of a group of people, every one of whom takes part.

    Attributes
    ----------
    status : str
        As of `PsychometricFit`, of the pooled table and the group's median; ``flat`` and
        ``decreasing`` only where nobody's table rises, ``one_level`` where nobody had two levels.
    threshold : float
        Middle of the people's thresholds, posterior median, in the levels' unit; NaN where the
        status has none.
    threshold_limits : tuple of float
        95 % equal-tailed limits; outside the tested levels an end is open, -inf or inf.
    spread_db : float
        Standard deviation between people, posterior median: dB, or the levels' unit on a linear
        axis. Of fewer than five people it comes mostly from its prior.
    spread_limits_db : tuple of float
        Its 95 % limits.
    new_person_limits : tuple of float
        95 % prediction interval of the threshold of the next person; ends open as above.
    sigma : float
        Median width of the people's functions, in the unit of `PsychometricFit.sigma`.
    sigma_limits : tuple of float
        Its 95 % limits.
    people : tuple of PsychometricFit
        Each person alone.

    Examples
    --------
    `fit_group` returns one. The more people differ, the wider is the interval of the next person:

    >>> import numpy as np
    >>> from analysis import fit_group
    >>> levels, presented = [60, 85, 120, 170, 240], np.full((3, 5), 30)
    >>> alike, apart = (fit_group(levels, people, presented, guess_rate=0.0) for people in (
    ...     [[2, 9, 22, 29, 30]] * 3, [[9, 22, 29, 30, 30], [2, 9, 22, 29, 30], [0, 2, 9, 22, 29]]))
    >>> bool(np.ptp(alike.new_person_limits) < np.ptp(apart.new_person_limits))
    True
    """

    status: FitStatus
    threshold: float = _NAN
    threshold_limits: tuple[float, float] = (_NAN, _NAN)
    spread_db: float = _NAN
    spread_limits_db: tuple[float, float] = (_NAN, _NAN)
    new_person_limits: tuple[float, float] = (_NAN, _NAN)
    sigma: float = _NAN
    sigma_limits: tuple[float, float] = (_NAN, _NAN)
    people: tuple[PsychometricFit, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GroupPosterior:
    """The posterior of the middle M, the spread tau and S, in steps and log steps."""

    middle: Floats
    spread: Floats
    log_sigma: Floats
    cells: Floats  # (middle, spread, log sigma), priors included

    @property
    def middle_density(self) -> Floats:
        """The density of M at its nodes."""
        return self._plane() @ trapezoid(self.spread)

    def middle_points(self) -> Floats:
        """Return the points `POINTS` of M."""
        return quantiles(self.middle_density, self.middle)

    def spread_points(self) -> Floats:
        """Return the points `POINTS` of tau."""
        return quantiles(trapezoid(self.middle) @ self._plane(), self.spread)

    def log_sigma_points(self) -> Floats:
        """Return the points `POINTS` of S."""
        weights = trapezoid(self.middle), trapezoid(self.spread)
        return quantiles(np.einsum("mts,m,t->s", self.cells, *weights), self.log_sigma)

    def next_person_points(self) -> Floats:
        """Return the points `POINTS` of the next person's mu: normal distributions, mixed.

        The distribution function of each cell is mixed rather than its density, as a spread may be
        much smaller than any step between places at which a density were taken. A node of M stands
        for all values around it.
        """
        weight = np.outer(trapezoid(self.middle), trapezoid(self.spread)) * self._plane()
        around = trapezoid(self.middle)[:, None] / math.sqrt(12)
        sd = np.hypot(self.spread, around)
        reach = 5 * self.spread[-1]
        mu = np.linspace(self.middle[0] - reach, self.middle[-1] + reach, 401)
        weight = (weight / weight.sum()).ravel()
        z = (mu[:, None, None] - self.middle[:, None]) / sd
        below = ndtr(z.reshape(len(mu), -1)) @ weight
        return np.interp(POINTS, below, mu)

    def drawn(self, number: int, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
        """Draw M, tau and S, anywhere between the nodes."""
        axes = (self.middle, self.spread, self.log_sigma)
        weight = self.cells * np.einsum("i,j,k->ijk", *(trapezoid(axis) for axis in axes))
        middle, spread, log_sigma = draws(weight, axes, number, rng)
        return middle, spread, log_sigma

    def _plane(self) -> Floats:
        return self.cells @ trapezoid(self.log_sigma)


def population_draws(
    tables: Tables, number: int, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Draw the middle and the spread of a group on the axis, and S of ln(sigma), to plan with."""
    prior = tables.prior
    middle, spread, log_sigma = group_posterior(likelihoods(tables), prior).drawn(number, rng)
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
        np.interp(place + rng.uniform(-0.5, 0.5, number), np.arange(len(axis)), axis)
        for place, axis in zip(np.unravel_index(chosen, weight.shape), axes, strict=True)
    ]


def normal_weights(x: Floats, mean: Floats, sd: Floats) -> Floats:
    """Return the weights by which values at nodes x are averaged over normal distributions.

    They are exact for what is linear between the nodes and flat beyond them, however narrow the
    distribution; shape (mean, x), for as many standard deviations as means.

    >>> x = np.array([0.0, 1.0, 3.0])
    >>> weights = normal_weights(x, np.array([1.4]), np.array([1e-9]))
    >>> weights.round(6).tolist(), bool(np.isclose((weights @ x)[0], 1.4))
    ([[0.0, 0.8, 0.2]], True)
    """
    # The mean of Phi over each cell, from its antiderivative. Differences of these are the
    # integrals of hat functions.
    z = (x - mean[:, None]) / sd[:, None]
    rising = sd[:, None] * (z * ndtr(z) + np.exp(-0.5 * z * z) / _SQRT_2PI)
    below = np.diff(rising, axis=1) / np.diff(x)
    ends = np.ones((len(mean), 1))
    return np.maximum(np.diff(below, axis=1, prepend=0 * ends, append=ends), 0.0)


def population_log_likelihood(curves: Iterable[Curve], mean: Floats, spread: Floats) -> Floats:
    """Return the log likelihood of values that are N(mean, spread) over people.

    A person's value is known by a likelihood with columns, which are parameters that all people
    have in common: (mean, spread, columns).
    """
    at, sd = (axis.ravel() for axis in np.meshgrid(mean, spread, indexing="ij"))
    weights: dict[int, tuple[Floats, Floats]] = {}
    total: Floats = np.zeros(1)
    for nodes, values in curves:
        if id(nodes) not in weights:
            weights[id(nodes)] = nodes, normal_weights(nodes, at, sd)
        total = total + np.log(np.maximum(weights[id(nodes)][1] @ values, TINY))
    return total.reshape(len(mean), len(spread), -1)


def group_posterior(
    people: Sequence[Likelihood], prior: Prior, *, prior_of_middle: bool = True
) -> GroupPosterior:
    """Return the posterior of a group, in steps of the prior of all levels.

    M has the prior of a single mu, or none: a difference of two groups is not to be pulled to 0.
    """
    outside = np.arange(1, 8) / 7 * _OUTSIDE
    between = np.linspace(prior.low, prior.high, 25)
    middle = np.unique(np.concatenate([prior.low - outside, between, prior.high + outside]))
    spread = _MIN_SPREAD + np.concatenate([[0.0], 0.3 * np.cumsum(1.4 ** np.arange(10))])
    half = 2.4 * math.log(SIGMA_FACTOR)
    log_sigma = math.log(SIGMA_MEDIAN * prior.scale) + np.linspace(-half, half, 11)
    # A coarse grid over the priors shows what matters. A grid on that is the last one, unless it
    # shows that less of it matters.
    for turn in range(_MAX_PASSES):
        curves = [(one.mu, _over_sigma(one, log_sigma)) for one in people]
        total = population_log_likelihood(curves, middle, spread)
        total = total.reshape(len(middle), len(spread), len(log_sigma), len(OMEGA), -1)
        total += (1 - len(people)) * np.log(class_prior())
        of_omega = np.exp(-0.5 * (OMEGA / OMEGA_SCALE) ** 2)
        cells = np.einsum("mtsoc,o->mts", np.exp(total - total.max()), of_omega)
        cells *= np.exp(-0.5 * (spread / (SPREAD_SCALE * prior.scale)) ** 2)[:, None] * prior.sigma(
            log_sigma
        )
        if prior_of_middle:
            cells *= prior.mu(middle)[:, None, None]
        in_middle, in_spread = trapezoid(middle), trapezoid(spread)
        plane = cells @ trapezoid(log_sigma)
        margins = (
            (middle, plane @ in_spread, 41),
            (spread, in_middle @ plane, 21),
            (log_sigma, np.einsum("mts,m,t->s", cells, in_middle, in_spread), 9),
        )
        boxes = [range_of(axis, margin) for axis, margin, _ in margins]
        if turn and all(
            np.ptp(box) >= _SETTLED * np.ptp(axis)
            for box, (axis, _, _) in zip(boxes, margins, strict=True)
        ):
            break
        middle, spread, log_sigma = (
            np.linspace(*box, count) for box, (_, _, count) in zip(boxes, margins, strict=True)
        )
        # The density of a small spread is the narrowest.
        spread = spread[0] + (spread - spread[0]) ** 1.5 / np.sqrt(np.ptp(spread))
    return GroupPosterior(middle=middle, spread=spread, log_sigma=log_sigma, cells=cells)


def _over_sigma(likelihood: Likelihood, log_sigma: Floats) -> Floats:
    """Average a likelihood over N(S, omega) of log sigma: (mu, S x omega x class)."""
    mean, sd = (axis.ravel() for axis in np.meshgrid(log_sigma, OMEGA, indexing="ij"))
    averaged = likelihood.by_class @ normal_weights(likelihood.log_sigma, mean, sd).T
    return np.ascontiguousarray(averaged.transpose(1, 2, 0)).reshape(len(likelihood.mu), -1)


def group_fit(
    tables: Tables,
    people: Sequence[Likelihood],
    statuses: Sequence[FitStatus] | None = None,
    posterior: GroupPosterior | None = None,
) -> GroupFit:
    """Return the fit of a group on the axis.

    The statuses of its people's own fits decide only where their pooled table does not rise.
    """
    if not tables.several_levels().any():
        return GroupFit(status="one_level")
    prior, used = tables.prior, tables.presented > 0
    fitted = posterior or group_posterior(people, prior)
    low, middle, high = fitted.middle_points().tolist()
    counts = (tables.x[used], tables.detected[used], tables.presented[used])
    status = status_of(*counts, (low, middle, high), prior)
    if status in NOT_RISING:
        alone = statuses or [fit.status for fit in fit_many(tables, people)]
        if not all(one in (*NOT_RISING, "one_level") for one in alone):
            # People below, between and above the levels have a threshold, if not a slope.
            status = "ok" if middle <= prior.high else "median_above_levels"
            status = status if middle >= prior.low else "median_below_levels"
    limits = within_levels(low, high, prior)
    if status in BOUNDED:
        return GroupFit(status=status, threshold_limits=limits)
    if status in NOT_RISING:
        return GroupFit(status=status)
    unit = prior.step * (20 if tables.x_scale == "log10" else 1)
    least, spread, most = (unit * fitted.spread_points()).tolist()
    next_low, _, next_high = fitted.next_person_points().tolist()
    sigma_low, sigma, sigma_high = (prior.step * np.exp(fitted.log_sigma_points())).tolist()
    return GroupFit(
        status=status,
        threshold=middle * prior.step,
        threshold_limits=limits,
        spread_db=spread,
        spread_limits_db=(least, most),
        new_person_limits=within_levels(min(next_low, low), max(next_high, high), prior),
        sigma=sigma,
        sigma_limits=(sigma_low, sigma_high),
    )


@tuned
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
    """Fit the threshold of a group: mu_i ~ N(M, tau), hierarchical, without sampling.

    Equation, priors and coverage: docs/statistics.md, section 8.

    Parameters
    ----------
    levels : array_like, shape (levels,)
        Stimulus levels of all people; above 0 on the axis ``log10``.
    detected, presented : array_like of whole numbers, shape (people, levels)
        Counts; presented 0 where a person has no such level.
    guess_rate : float, optional
        gamma of everybody, 1/2 in forced choice of two sides; or
    blanks : tuple of array_like, shape (people,) each, optional
        False alarms of that side and blank trials of each person; Beta(1, 10) is assumed of who had
        none. Exactly one of the two.
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
    Nobody is left out: the third person detected everything, and lowers the group's threshold.

    >>> levels, presented = [60, 85, 120, 170, 240], np.full((3, 5), 30)
    >>> two = [[16, 19, 27, 30, 30], [15, 21, 28, 30, 30]]
    >>> both = fit_group(levels, two, presented[:2], guess_rate=0.5)
    >>> all_three = fit_group(levels, [*two, [30] * 5], presented, guess_rate=0.5)
    >>> all_three.threshold < both.threshold, all_three.people[2].status
    (True, 'threshold_below_levels')
    """
    counts = checked_counts(detected, presented)
    guesses = guess_rates(len(np.atleast_1d(counts[0])), guess_rate, blanks)
    tables = group_tables(levels, counts, guesses, x_scale, function)
    people = likelihoods(tables)
    fits = with_likeliest(fit_many(tables, people), tables, people)
    fit = group_fit(tables, people, [one.status for one in fits])
    if x_scale == "linear":
        return replace(fit, people=fits)
    return replace(
        fit,
        threshold=10.0**fit.threshold,
        threshold_limits=_raised(fit.threshold_limits),
        new_person_limits=_raised(fit.new_person_limits),
        people=tuple(in_levels(one) for one in fits),
    )


def _raised(limits: tuple[float, float]) -> tuple[float, float]:
    return limits[0] if limits[0] == -math.inf else 10.0 ** limits[0], 10.0 ** limits[1]


def group_tables(
    levels: ArrayLike,
    counts: tuple[Floats, Floats],
    guesses: Sequence[GuessRate],
    x_scale: XScale,
    function: FunctionName = "normal",
) -> Tables:
    """Check the counts of people and lay them on the axis."""
    k, n = counts
    x = np.asarray(levels)
    if x.ndim != 1 or k.shape != n.shape or k.shape != (len(k), x.size):
        raise ValueError(
            "detected and presented must have the shape (people, levels); got "
            f"{k.shape} and {n.shape} for {x.size} levels"
        )
    if not (n > 0).any(axis=1).all():
        raise ValueError("presented must hold at least one stimulus of each person; got none")
    check_function(function, x_scale)
    return Tables(
        x=np.broadcast_to(checked_levels(x, x_scale), k.shape),
        detected=k,
        presented=n,
        guesses=guesses,
        x_scale=x_scale,
        function=function,
    )


def guess_rates(
    people: int, guess_rate: float | None, blanks: tuple[ArrayLike, ArrayLike] | None
) -> list[GuessRate]:
    """Return the guess rate of each person, known or after blank trials."""
    if guess_rate is not None and blanks is None:
        return [GuessRate(mean=guess_rate)] * people
    if blanks is None or guess_rate is not None:
        raise ValueError("exactly one of guess_rate and blanks must be given")
    answered, shown = checked_counts(*blanks)
    if answered.shape != (people,) or shown.shape != (people,):
        raise ValueError(
            f"blanks must be two lists of {people}, a number for each person; got the shapes "
            f"{answered.shape} and {shown.shape}"
        )
    return [
        GuessRate.after_blanks(answered=float(a), blanks=int(b))
        for a, b in zip(answered, shown, strict=True)
    ]
