"""By how many dB two conditions differ, per person and for the group.

The likelihood of person i's difference d_i is that of both thresholds, integrated over all places
at which they may lie; in a group, as the thresholds of the others imply. Over people d_i ~ N(D,
tau_d) (docs/statistics.md, section 8). Only likelihoods take part, not the prior of a single
threshold: two tables that have only bounds would be pulled to a difference of 0 by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from analysis.thresholds.function import LOG_SIGMA, REACH
from analysis.thresholds.group import (
    MIDDLE,
    OMEGA,
    OMEGA_SCALE,
    SPREAD,
    SPREAD_SCALE,
    group_posterior,
    normal_log_likelihoods,
    normal_weights,
    zoomed,
)
from analysis.thresholds.likelihood import TINY, quantiles, range_of, trapezoid
from analysis.thresholds.tables import checked_tables
from stimuli.threads import single_threaded

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from analysis.thresholds.function import Prior
    from analysis.thresholds.group import Curve, Population
    from analysis.thresholds.likelihood import Likelihood, Tables

    Floats = NDArray[np.float64]

DifferenceStatus = Literal["ok", "at_least", "at_most", "unknown", "one_level", "one_participant"]

_SCALE_DB: Final = 12.0
"""Of the normal prior of D, which matters only where the data leave an end open."""
_COARSE: Final = np.linspace(-24.0, 24.0, 65), 0.05 + 18.0 * np.linspace(0, 1, 9) ** 1.7
"""Nodes of D and of tau_d over their priors."""
_STATUSES: Final[dict[tuple[bool, bool], DifferenceStatus]] = {
    (False, False): "ok",
    (False, True): "at_least",
    (True, False): "at_most",
    (True, True): "unknown",
}
"""By whether the lower end is open, and the upper one."""
_OPEN: Final = math.exp(-1.92)
"""A likelihood that stays above this share of its greatest has no bound (chi-square, 95 %)."""
_SPREADS: Final = np.array([0.7, 1.4, 2.5, 4.0, 6.0, 9.0, 13.0])
"""Values of tau, in steps; smaller ones say no more of people near the ends of the levels."""
_FAR: Final = 6.0
_MUCH: Final = 3.0
_NODES: Final = 161
_LEAST: Final = 1e-7
_LOG_SIGMAS: Final = np.linspace(*LOG_SIGMA, 25)
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


@single_threaded
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
    a = checked_tables(levels, detected_a, presented_a, guess_rate, blanks_a)
    levels_b = levels if levels_b is None else levels_b
    b = checked_tables(levels_b, detected_b, presented_b, guess_rate, blanks_b)
    if paired and len(a) != len(b):
        raise ValueError(
            f"detected_a and detected_b must have a row for each person; got {len(a)} and "
            f"{len(b)}: paired=False compares different people"
        )
    return difference_of(a, b, same_people=paired)


def difference_of(a: Tables, b: Tables, *, same_people: bool) -> ConditionDifference:
    """Return the difference of two conditions on a logarithmic axis.

    The status is ``one_level`` if a condition has only one level for every person. That of a person
    is ``one_level`` if they had only one level in either condition.
    """
    several_a, several_b = a.several_levels(), b.several_levels()
    one_level = Difference(status="one_level")
    if not (several_a.any() and several_b.any()):
        alone = (one_level,) * (len(a) if same_people else 0)
        return ConditionDifference(status="one_level", people=alone)
    prior = joint_prior(a, b)
    if not same_people:
        return unpaired_difference(a.likelihoods, b.likelihoods, prior)
    difference = paired_difference(a.likelihoods, b.likelihoods, prior)
    each = zip(difference.people, several_a & several_b, strict=True)
    people = tuple(person if several else one_level for person, several in each)
    return replace(difference, people=people)


def joint_prior(a: Tables, b: Tables) -> Prior:
    """Return the prior that goes with the levels of both conditions."""
    low, high = min(a.prior.low, b.prior.low), max(a.prior.high, b.prior.high)
    return replace(a.prior, low=low, high=high)


def unpaired_difference(
    people_a: Sequence[Likelihood], people_b: Sequence[Likelihood], prior: Prior
) -> ConditionDifference:
    """Return the difference of two groups of different people, whose middles have no prior."""
    curves = []
    for people in (people_a, people_b):
        posterior = group_posterior(people, prior)
        middle = posterior.axes[MIDDLE]
        likelihood = posterior.density(MIDDLE) / prior.mu(middle)
        likelihood[[0, -1]] = 0.0
        curves.append((middle, likelihood))
    ((d, likelihood),) = _differences([(curves[0], curves[1])])
    ends = _open_ends(likelihood)
    return ConditionDifference(**_difference(d, likelihood * _prior(d), ends))


def paired_difference(
    people_a: Sequence[Likelihood], people_b: Sequence[Likelihood], prior: Prior
) -> ConditionDifference:
    """Return the difference of people who took part in both conditions, of the group and of each.

    What everybody leaves open stays open in the group.
    """
    alone, curves = _difference_curves(people_a, people_b, prior)
    ends = [_open_ends(likelihood) for _, likelihood in alone]
    people = [
        Difference(**_difference(d, likelihood * _prior(d), open_ends))
        for (d, likelihood), open_ends in zip(alone, ends, strict=True)
    ]
    shift, spread = _COARSE
    of_shift = _paired_cells(curves, shift, spread) @ trapezoid(spread) / _prior(shift)
    everybody = np.logical_or(_open_ends(of_shift), np.all(ends, axis=0))
    posterior = paired_posterior(curves)
    low, middle, high = posterior.points(SPREAD).tolist()
    return ConditionDifference(
        **_difference(posterior.axes[MIDDLE], posterior.density(MIDDLE), everybody),
        spread_db=middle,
        spread_limits_db=(low, high),
        people=tuple(people),
    )


def paired_posterior(curves: Sequence[Curve]) -> Population:
    """Return the posterior of the group's difference and its spread, in steps of 1 dB."""
    return zoomed(partial(_paired_cells, curves), _COARSE, (81, 25))


def _paired_cells(curves: Sequence[Curve], shift: Floats, spread: Floats) -> Floats:
    log = np.asarray(sum(normal_log_likelihoods(curves, shift, spread)))
    log = log - log.max() - 0.5 * (spread / SPREAD_SCALE) ** 2
    return np.asarray(np.exp(log) * _prior(shift)[:, None])


def difference_spread_draws(a: Tables, b: Tables, number: int, rng: np.random.Generator) -> Floats:
    """Draw how much the same people's difference of two conditions differs, in dB, to plan with."""
    _, curves = _difference_curves(a.likelihoods, b.likelihoods, joint_prior(a, b))
    return paired_posterior(curves).drawn(number, rng)[SPREAD]


def _difference_curves(
    people_a: Sequence[Likelihood], people_b: Sequence[Likelihood], prior: Prior
) -> tuple[list[Curve], list[Curve]]:
    """Return each person's likelihood of d, alone and as a member of the group.

    The density of log sigma is the one that the tables of all others imply, N(S, omega) as in a
    group. Otherwise tables that leave sigma open would have the tails of the steepest and flattest
    functions. For a member of the group, the density of mu_a + mu_b is chosen in the same way. This
    matters for people whose thresholds lie near an end of the levels or outside.
    """
    people = [*people_a, *people_b]
    of_width = [
        (person.log_sigma, (trapezoid(person.mu) * prior.mu(person.mu)) @ person.values)
        for person in people
    ]
    log_prior = np.log(prior.sigma(_LOG_SIGMAS))[:, None] - 0.5 * (OMEGA / OMEGA_SCALE) ** 2
    implied = _implied_by_others(of_width, _LOG_SIGMAS, OMEGA, log_prior)
    of_mu = []
    for person, normals in zip(people, implied, strict=True):
        weights = normal_weights(person.log_sigma, _LOG_SIGMAS, OMEGA)
        of_mu.append((person.mu, person.values @ np.tensordot(normals, weights)))
    pairs = list(zip(of_mu[: len(people_a)], of_mu[len(people_a) :], strict=True))
    mirrored = [((-mu[::-1], values[::-1]), b) for (mu, values), b in pairs]
    mean = 2 * np.linspace(prior.low - REACH, prior.high + REACH, 61)
    log_prior = np.log(trapezoid(_SPREADS)) - 0.5 * (_SPREADS / SPREAD_SCALE) ** 2
    implied = _implied_by_others(_differences(mirrored), mean, 2 * _SPREADS, log_prior)
    x = np.linspace(mean[0] - 2 * _FAR, mean[-1] + 2 * _FAR, 241)
    # The weights of the outermost nodes hold all that lies beyond them.
    density = (normal_weights(x, mean, 2 * _SPREADS) / trapezoid(x))[:, :, 1:-1]
    sums = [(x[1:-1], np.asarray(np.tensordot(normals, density))) for normals in implied]
    return _differences(pairs), _differences(pairs, sums)


def _implied_by_others(
    curves: Sequence[Curve], mean: Floats, spread: Floats, log_prior: Floats
) -> list[Floats]:
    """Return, for each person, how likely all others make normal distributions: (mean, spread)."""
    logs = list(normal_log_likelihoods(curves, mean, spread))
    rest = [log_prior + sum(logs) - log for log in logs]
    return [np.exp(log - log.max()) for log in rest]


def _differences(
    pairs: Sequence[tuple[Curve, Curve]], of_sums: Sequence[Curve] = ()
) -> list[Curve]:
    """Return the likelihoods of mu_b - mu_a, at the same nodes of all but those much narrower."""
    reaches = []
    for a, b in pairs:
        (low_a, high_a), (low_b, high_b) = range_of(*a, _LEAST), range_of(*b, _LEAST)
        reaches.append((low_b - high_a, high_b - low_a))
    shared = np.linspace(np.min(reaches), np.max(reaches), _NODES)
    curves = []
    for i, ((a, b), reach) in enumerate(zip(pairs, reaches, strict=True)):
        is_narrow = _MUCH * (reach[1] - reach[0]) < np.ptp(shared)
        d = np.linspace(*reach, _NODES) if is_narrow else shared
        curves.append((d, _correlated(a, b, d, of_sums[i] if of_sums else None)))
    return curves


def _correlated(a: Curve, b: Curve, d: Floats, of_sum: Curve | None = None) -> Floats:
    """Return the likelihood of d = mu_b - mu_a, summed over the nodes of mu_a and those of mu_b.

    Where one likelihood is much narrower only its nodes count. A likelihood that stays constant at
    an end goes on for a while: two thresholds anywhere below the levels may differ by anything.
    `of_sum` is a density of mu_a + mu_b, constant by default.
    """
    widths = [float(np.ptp(range_of(*curve, _OPEN))) for curve in (a, b)]
    likelihood = np.zeros(len(d))
    for i, (curve, second, shift) in enumerate(((a, b, d[:, None]), (b, a, -d[:, None]))):
        if widths[i] < _MUCH * widths[1 - i]:
            at = np.concatenate([[curve[0][0] - _FAR], curve[0], [curve[0][-1] + _FAR]])
            values = np.interp(at, *curve) * np.interp(at + shift, *second)
            if of_sum is not None:
                values *= np.interp(2 * at + shift, *of_sum)
            summed = np.trapezoid(values, at, axis=1)
            likelihood += summed / max(float(summed.max()), TINY)
    return likelihood / max(float(likelihood.max()), TINY)


def _prior(d: Floats) -> Floats:
    return np.asarray(np.exp(-0.5 * (d / _SCALE_DB) ** 2))


def _open_ends(likelihood: Floats) -> tuple[bool, bool]:
    """Return whether a likelihood has no bound below, and none above."""
    least = _OPEN * likelihood.max()
    return bool(likelihood[0] > least), bool(likelihood[-1] > least)


def _difference(d: Floats, density: Floats, open_ends: Iterable[bool]) -> dict[str, Any]:
    """Return status, median and limits of a difference."""
    below, above = map(bool, open_ends)
    low, middle, high = quantiles(density, d).tolist()
    return {
        "status": _STATUSES[below, above],
        "difference_db": _NAN if below or above else middle,
        "difference_limits_db": (-math.inf if below else low, math.inf if above else high),
    }
