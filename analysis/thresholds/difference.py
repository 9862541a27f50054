"""By how many dB two conditions differ, per person and for the group.

The likelihood of person i's difference d_i is that of both thresholds, integrated over all places
at which they may lie; in a group, as the thresholds of the others imply. Over people d_i ~ N(D,
tau_d) (docs/statistics.md, section 8). Only likelihoods take part, not the prior of a single
threshold: two tables that have only bounds would be pulled to a difference of 0 by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from analysis.counts.intervals import checked_counts
from analysis.thresholds.function import LOG_SIGMA, REACH
from analysis.thresholds.group import (
    OMEGA,
    OMEGA_SCALE,
    SPREAD_SCALE,
    group_posterior,
    group_tables,
    guess_rates,
    normal_weights,
    population_log_likelihood,
)
from analysis.thresholds.likelihood import TINY, likelihoods, quantiles, range_of, trapezoid
from stimuli.tuned import tuned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from analysis.thresholds.function import Prior
    from analysis.thresholds.group import Curve, GroupPosterior
    from analysis.thresholds.likelihood import Likelihood, Tables

    Floats = NDArray[np.float64]

DifferenceStatus = Literal["ok", "at_least", "at_most", "unknown", "one_level"]

_SCALE_DB: Final = 12.0
"""Of the normal prior of D, which matters only where the data leave an end open."""
_MAX_DB: Final = 24.0
_OPEN: Final = math.exp(-1.92)
"""A likelihood that stays above this share of its greatest has no bound (chi-square, 95 %)."""
_SPREADS: Final = np.array([0.7, 1.4, 2.5, 4.0, 6.0, 9.0, 13.0])
"""Values of tau, in steps; smaller ones say no more of people near the ends of the levels."""
_FAR: Final = 6.0
_MUCH: Final = 3.0
_NODES: Final = 161
_LEAST: Final = 1e-7
_MIN_PEAK_NODES: Final = 3
_SIGMAS: Final = np.linspace(*LOG_SIGMA, 25)
_PASSES: Final = 3
_NAN: Final = math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """A difference of thresholds, b above a, in dB.

    Attributes
    ----------
    status : {"ok", "at_least", "at_most", "unknown", "one_level"}
        Whether both ends are bounded, only the lower, only the upper, or neither; ``one_level``
        where one level alone was tested, which has no threshold.
    difference_db : float
        20 log10(threshold b / threshold a), posterior median; NaN unless ``ok``.
    difference_limits_db : tuple of float
        95 % limits; an open end is -inf or inf.
    spread_db : float
        Standard deviation of people's differences, posterior median; NaN unless of a group of the
        same people.
    spread_limits_db : tuple of float
        Its 95 % limits.

    Notes
    -----
    Equation, priors and coverage: docs/statistics.md, section 8.

    Examples
    --------
    `ConditionDifference.people` has one of each person. 12 dB are a factor of 4:

    >>> found = Difference(status="ok", difference_db=12.04, difference_limits_db=(9.5, 14.4))
    >>> round(10 ** (found.difference_db / 20), 3)
    3.999
    """

    status: DifferenceStatus
    difference_db: float = _NAN
    difference_limits_db: tuple[float, float] = (_NAN, _NAN)
    spread_db: float = _NAN
    spread_limits_db: tuple[float, float] = (_NAN, _NAN)


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionDifference(Difference):
    """How much the threshold of condition b lies above that of condition a.

    Attributes
    ----------
    status, difference_db, difference_limits_db, spread_db, spread_limits_db
        The group's, as of `Difference`.
    people : tuple of Difference
        Each person's, where the same people took part in both conditions.

    Examples
    --------
    `compare_conditions` returns one; of the same answers in both conditions it is 0 dB:

    >>> from analysis import compare_conditions
    >>> answers = [60, 85, 120, 170], [[3, 9, 22, 29]] * 2, [[30] * 4] * 2
    >>> found = compare_conditions(*answers, *answers[1:], guess_rate=0.0)
    >>> found.status, bool(abs(found.difference_db) < 0.01)
    ('ok', True)
    """

    people: tuple[Difference, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairedPosterior:
    """The group's difference and that of each person, with the density of tau_d over its nodes."""

    group: Difference
    people: list[Difference]
    spread: Floats
    spread_density: Floats


@tuned
def compare_conditions(
    levels: ArrayLike,
    detected_a: ArrayLike,
    presented_a: ArrayLike,
    detected_b: ArrayLike,
    presented_b: ArrayLike,
    *,
    guess_rate: float | None = None,
    blanks_a: tuple[ArrayLike, ArrayLike] | None = None,
    blanks_b: tuple[ArrayLike, ArrayLike] | None = None,
    levels_b: ArrayLike | None = None,
    paired: bool = True,
) -> ConditionDifference:
    """Return by how many dB the threshold of condition b lies above that of condition a.

    Equation, priors and coverage: docs/statistics.md, section 8. The priors of the thresholds take
    no part: where tables have only bounds, so has the difference.

    Parameters
    ----------
    levels : array_like, shape (levels,)
        Stimulus levels, above 0.
    detected_a, presented_a, detected_b, presented_b : array_like of whole numbers
        Counts, shape (people, levels).
    guess_rate : float, optional
        gamma of everybody, 1/2 in forced choice of two sides; or
    blanks_a, blanks_b : tuple of array_like, shape (people,) each, optional
        False alarms of that side and blank trials of each person in either condition.
    levels_b : array_like, optional
        Levels of condition b, if they differ.
    paired : bool
        Whether a row is the same person in both conditions.

    Returns
    -------
    ConditionDifference
        The group's difference in dB with its 95 % limits, whether either end is bounded, how much
        people differ in it, and each person's difference where the same people took part.

    Raises
    ------
    ValueError
        For impossible counts or levels, unless either guess_rate or both blanks are given, and for
        paired conditions of different numbers of people.

    Examples
    --------
    With the conditions exchanged the difference changes its sign:

    >>> levels, presented = [60, 85, 120, 170, 240], np.full((2, 5), 30)
    >>> a = [[16, 19, 27, 30, 30], [15, 21, 28, 30, 30]]
    >>> b = [[15, 15, 18, 28, 30], [16, 14, 21, 29, 30]]
    >>> up, down = (compare_conditions(levels, *pair, guess_rate=0.5)
    ...             for pair in ((a, presented, b, presented), (b, presented, a, presented)))
    >>> up.difference_db > 0, bool(np.isclose(up.difference_db, -down.difference_db, atol=0.01))
    (True, True)
    """
    counts_a = checked_counts(detected_a, presented_a)
    counts_b = checked_counts(detected_b, presented_b)
    a, b = (
        group_tables(
            at, counts, guess_rates(len(np.atleast_1d(counts[0])), guess_rate, blanks), "log10"
        )
        for at, counts, blanks in (
            (levels, counts_a, blanks_a),
            (levels if levels_b is None else levels_b, counts_b, blanks_b),
        )
    )
    if paired and len(a) != len(b):
        raise ValueError(
            f"detected_a and detected_b must have a row for each person; got {len(a)} and "
            f"{len(b)}: paired=False compares different people"
        )
    return difference_of(a, b, same_people=paired)


def paired_posterior(
    people_a: Sequence[Likelihood], people_b: Sequence[Likelihood], prior: Prior
) -> PairedPosterior:
    """Return the differences of people who took part in both conditions, in steps of 1 dB."""
    alone, curves = _difference_curves(people_a, people_b, prior)
    people = [_difference(*curve) for curve in alone]
    shift = np.linspace(-_MAX_DB, _MAX_DB, 65)
    between = 0.05 + 18.0 * np.linspace(0, 1, 9) ** 1.7
    for turn in range(_PASSES):
        columns = [(nodes, values[:, None]) for nodes, values in curves]
        log = population_log_likelihood(columns, shift, between)[:, :, 0]
        cells = np.exp(log - log.max()) * np.exp(-0.5 * (between / SPREAD_SCALE) ** 2)
        of_shift = cells @ trapezoid(between)
        if not turn:
            # What everybody leaves open stays open, though the first grid be too coarse to show it.
            ends = _open_ends(of_shift)
            limits = [one.difference_limits_db for one in people]
            below = ends[0] or all(low == -math.inf for low, _ in limits)
            above = ends[1] or all(high == math.inf for _, high in limits)
        of_spread = (trapezoid(shift) * _prior(shift)) @ cells
        if turn == _PASSES - 1:
            break
        low, high = range_of(between, of_spread)
        shift = np.linspace(*range_of(shift, of_shift * _prior(shift)), 81)
        between = low + (high - low) * np.linspace(0, 1, 25) ** 1.6
    least, middle, most = quantiles(of_spread, between).tolist()
    group = replace(
        _difference(shift, of_shift, (below, above)),
        spread_db=middle,
        spread_limits_db=(least, most),
    )
    return PairedPosterior(group=group, people=people, spread=between, spread_density=of_spread)


def unpaired_difference(a: GroupPosterior, b: GroupPosterior) -> Difference:
    """Return the difference of two groups of different people, whose middles have no prior."""
    step = min(np.ptp(a.middle), np.ptp(b.middle)) / 80
    x = np.arange(min(a.middle[0], b.middle[0]), max(a.middle[-1], b.middle[-1]) + step, step)
    first, second = (
        np.interp(x, one.middle, one.middle_density, left=0.0, right=0.0) for one in (a, b)
    )
    d = (np.arange(2 * len(x) - 1) - (len(x) - 1)) * step
    return _difference(d, np.convolve(second, first[::-1]).astype(np.float64))


def difference_of(
    a: Tables, b: Tables, people: Sequence[Likelihood] | None = None, *, same_people: bool
) -> ConditionDifference:
    """Return the difference of two conditions on a logarithmic axis.

    Levels of one condition alone have no threshold, and a person's likewise.
    """
    both = a.joined(b)
    people = people or likelihoods(both)
    people_a, people_b = people[: len(a)], people[len(a) :]
    several_a, several_b = a.several_levels(), b.several_levels()
    if not (several_a.any() and several_b.any()):
        alone = [Difference(status="one_level")] * (len(a) if same_people else 0)
        return ConditionDifference(status="one_level", people=tuple(alone))
    if not same_people:
        posteriors = [
            group_posterior(some, both.prior, prior_of_middle=False)
            for some in (people_a, people_b)
        ]
        group, each = unpaired_difference(*posteriors), []
    else:
        posterior = paired_posterior(people_a, people_b, both.prior)
        group = posterior.group
        each = [
            one if several else Difference(status="one_level")
            for one, several in zip(posterior.people, several_a & several_b, strict=True)
        ]
    return ConditionDifference(
        status=group.status,
        difference_db=group.difference_db,
        difference_limits_db=group.difference_limits_db,
        spread_db=group.spread_db,
        spread_limits_db=group.spread_limits_db,
        people=tuple(each),
    )


def difference_spread_draws(a: Tables, b: Tables, number: int, rng: np.random.Generator) -> Floats:
    """Draw how much the same people's difference of two conditions differs, in dB, to plan with."""
    both = a.joined(b)
    people = likelihoods(both)
    posterior = paired_posterior(people[: len(a)], people[len(a) :], both.prior)
    nodes, density = posterior.spread, posterior.spread_density
    below = np.append(0.0, np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(nodes)))
    return np.asarray(np.interp(rng.random(number) * below[-1], below, nodes))


def _difference_curves(
    people_a: Sequence[Likelihood], people_b: Sequence[Likelihood], prior: Prior
) -> tuple[list[Curve], list[Curve]]:
    """Return each person's likelihood of d at nodes of d, alone and as one of the group."""
    of_mu = _over_mu([*people_a, *people_b], prior)
    curves_a, curves_b = of_mu[: len(people_a)], of_mu[len(people_a) :]
    pairs = list(zip(curves_a, curves_b, strict=True))
    boxes = [
        (max(low, -2 * _MAX_DB), min(high, 2 * _MAX_DB))
        for low, high in (_reach(*pair) for pair in pairs)
    ]
    shared = np.linspace(min(low for low, _ in boxes), max(high for _, high in boxes), _NODES)
    alone, of_group = [], []
    for pair, box, others in zip(pairs, boxes, _middles_of_others(pairs, prior), strict=True):
        d = shared
        curve = _correlated(*pair, d)
        if (curve[1] > 0.5).sum() < _MIN_PEAK_NODES:  # noqa: PLR2004 - half of the greatest
            curve = _correlated(*pair, np.linspace(*box, _NODES))
            d = np.linspace(*range_of(*curve, _LEAST), _NODES)
            curve = _correlated(*pair, d)
        alone.append(curve)
        of_group.append(_correlated(*pair, d, others))
    return alone, of_group


def _middles_of_others(pairs: Sequence[tuple[Curve, Curve]], prior: Prior) -> list[Curve]:
    """Return the density of each person's (mu_a + mu_b) / 2 that those of all others imply.

    It matters for people whose thresholds lie near an end of the levels or beyond.
    """
    middle = np.linspace(prior.low - REACH, prior.high + REACH, 61)
    log = []
    for a, b in pairs:
        turned = -a[0][::-1], a[1][::-1]
        twice, values = _correlated(turned, b, np.linspace(*_reach(turned, b), _NODES))
        curve = (twice / 2, values[:, None])
        log.append(population_log_likelihood([curve], middle, _SPREADS)[:, :, 0])
    total = np.sum(log, axis=0) - 0.5 * (_SPREADS / SPREAD_SCALE) ** 2
    x = np.linspace(middle[0] - _FAR, middle[-1] + _FAR, 241)
    z = (x[:, None, None] - middle[:, None]) / _SPREADS
    density = np.exp(-0.5 * z * z) / _SPREADS * trapezoid(_SPREADS)
    weights = (np.exp(total - one - (total - one).max()) for one in log)
    return [(x, np.einsum("xms,ms->x", density, weight)) for weight in weights]


def _over_mu(people: Sequence[Likelihood], prior: Prior) -> list[Curve]:
    """Return nodes of mu and the likelihood of each table there, sigma integrated out.

    log sigma has the density that the tables of all others imply, N(S, omega) as in a group:
    otherwise tables that leave sigma open would have the tails of the steepest and flattest
    functions.
    """
    mean, sd = (axis.ravel() for axis in np.meshgrid(_SIGMAS, OMEGA))
    log_prior = np.log(prior.sigma(mean)) - 0.5 * (sd / OMEGA_SCALE) ** 2
    weights = {
        id(axis): normal_weights(axis, mean, sd)
        for axis in {id(one.log_sigma): one.log_sigma for one in people}.values()
    }
    log = [
        np.log(
            np.maximum(
                weights[id(one.log_sigma)] @ ((trapezoid(one.mu) * prior.mu(one.mu)) @ one.values),
                TINY,
            )
        )
        for one in people
    ]
    total = log_prior + np.sum(log, axis=0)
    return [
        (one.mu, one.values @ (np.exp(rest - rest.max()) @ weights[id(one.log_sigma)]))
        for one, rest in zip(people, (total - own for own in log), strict=True)
    ]


def _reach(a: Curve, b: Curve) -> tuple[float, float]:
    """Return the least and greatest difference that matter."""
    (low_a, high_a), (low_b, high_b) = (range_of(*curve, _LEAST) for curve in (a, b))
    return low_b - high_a, high_b - low_a


def _correlated(a: Curve, b: Curve, d: Floats, middle: Curve | None = None) -> Curve:
    """Return the likelihood of d = mu_b - mu_a, summed over the nodes of mu_a and of mu_b.

    Where one likelihood is much narrower only its nodes count. A likelihood that stays constant at
    an end goes on for a while: two thresholds anywhere below the levels may differ by anything.
    `middle` is a density of (mu_a + mu_b) / 2, constant by default.
    """
    widths = [float(np.ptp(range_of(*curve, _OPEN))) for curve in (a, b)]
    likelihood = np.zeros(len(d))
    for i, ((mu, values), second, sign) in enumerate(((a, b, 1), (b, a, -1))):
        if widths[i] < _MUCH * widths[1 - i]:
            at = np.concatenate([[mu[0] - _FAR], mu, [mu[-1] + _FAR]])
            weights = trapezoid(at) * np.pad(values, 1, mode="edge")
            both = np.interp(at + sign * d[:, None], *second)
            if middle is not None:
                both *= np.interp(at + sign * d[:, None] / 2, *middle)
            one = both @ weights
            likelihood += one / max(float(one.max()), TINY)
    return d, likelihood / max(float(likelihood.max()), TINY)


def _prior(d: Floats) -> Floats:
    return np.asarray(np.exp(-0.5 * (d / _SCALE_DB) ** 2))


def _open_ends(likelihood: Floats) -> tuple[bool, bool]:
    """Return whether a likelihood has no bound below, and none above."""
    least = _OPEN * likelihood.max()
    return bool(likelihood[0] > least), bool(likelihood[-1] > least)


def _difference(
    d: Floats, likelihood: Floats, open_ends: tuple[bool, bool] | None = None
) -> Difference:
    below, above = open_ends or _open_ends(likelihood)
    low, middle, high = quantiles(likelihood * _prior(d), d).tolist()
    statuses: dict[tuple[bool, bool], DifferenceStatus] = {
        (False, False): "ok",
        (False, True): "at_least",
        (True, False): "at_most",
        (True, True): "unknown",
    }
    return Difference(
        status=statuses[below, above],
        difference_db=_NAN if below or above else middle,
        difference_limits_db=(-math.inf if below else low, math.inf if above else high),
    )
