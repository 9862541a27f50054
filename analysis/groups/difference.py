"""How much two conditions differ, per person and for the group.

Person i has mu_a = m_i - d_i / 2 and mu_b = m_i + d_i / 2 with m_i ~ N(M, tau), d_i ~ N(D, tau_d)
(docs/statistics.md, section 8). Only likelihoods take part, not the prior of a single threshold:
two tables that tell only bounds would be pulled to a difference of 0 by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from analysis.groups.hierarchy import OMEGA, OMEGA_SPREAD, SPREAD, matters, normal_weights
from analysis.thresholds.density import quantiles, sigma_prior, trapezoid
from analysis.thresholds.mle import LOG_SIGMA, REACH

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from analysis.groups.hierarchy import Hierarchy
    from analysis.thresholds.density import Ruler
    from analysis.thresholds.grid import Surface

    Floats = NDArray[np.float64]


DifferenceStatus = Literal["ok", "at_least", "at_most", "unknown"]

_DIFFERENCE_SPREAD: Final = 6.0
"""Half-normal prior of tau_d, dB."""
_PRIOR: Final = 12.0
"""Normal prior of D, dB: it decides only where the data leave an end open, which is then told."""
_FARTHEST: Final = 24.0
_OPEN: Final = math.exp(-1.92)
"""A likelihood that stays above this part of its greatest bounds nothing (chi-square, 95 %)."""
_NODES: Final = (49, 101)
_SKETCH: Final = (49, 73)
"""Of m and d, on which people's likelihoods are laid; and first, to see where they lie."""
_EVENLY: Final = 0.5
"""Of the nodes, to those spread where people are likely."""
_HALF: Final = 0.5
_ENOUGH: Final = 3
"""Nodes above half of the greatest likelihood: fewer do not tell its shape."""
_SEEN: Final = 1e-7
_SIGMAS: Final = LOG_SIGMA[0] + np.linspace(0, 1, 25) * (LOG_SIGMA[1] - LOG_SIGMA[0])
_TINY: Final = 1e-300
_PASSES: Final = 3
_SPREAD_NODES: Final = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """A difference of thresholds, b above a, in dB.

    Attributes
    ----------
    status : {"ok", "at_least", "at_most", "unknown"}
        Whether both ends are bounded, only the lower, only the upper, or none.
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
    difference_db: float
    difference_limits_db: tuple[float, float]
    spread_db: float = math.nan
    spread_limits_db: tuple[float, float] = (math.nan, math.nan)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Pair:
    """The likelihood of a person's m and d, shape (m, d)."""

    m: Floats
    d: Floats
    values: Floats


def paired_difference(
    found_a: Sequence[Surface], found_b: Sequence[Surface], ruler: Ruler
) -> tuple[Difference, list[Difference]]:
    """Return the difference of a group, and of each of its people, who took part in both."""
    group, people, _ = _paired(found_a, found_b, ruler)
    return group, people


def drawn_spreads(
    found: tuple[Sequence[Surface], Sequence[Surface]],
    ruler: Ruler,
    number: int,
    rng: np.random.Generator,
) -> Floats:
    """Draw tau_d of the same people's surfaces in two conditions from its posterior, in dB."""
    _, _, (nodes, density) = _paired(*found, ruler)
    steps = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(nodes))])
    return np.asarray(np.interp(rng.random(number) * steps[-1], steps, nodes))


def _paired(
    found_a: Sequence[Surface], found_b: Sequence[Surface], ruler: Ruler
) -> tuple[Difference, list[Difference], tuple[Floats, Floats]]:
    """Return the group's difference, that of each person, and the density of tau_d."""
    pairs = _pairs(found_a, found_b, ruler)
    people = [_told(one.d, trapezoid(one.m) @ one.values) for one in pairs]
    group, spread = _of_group(pairs, ruler, people)
    return group, people, spread


def unpaired_difference(a: Hierarchy, b: Hierarchy) -> Difference:
    """Return the difference of two groups of different people, whose middles have no prior."""
    step = min(np.ptp(a.middle), np.ptp(b.middle)) / 80
    low, high = min(a.middle[0], b.middle[0]), max(a.middle[-1], b.middle[-1])
    x = np.arange(low, high + step, step)
    first, second = (
        np.interp(x, one.middle, one.density @ trapezoid(one.spread), left=0.0, right=0.0)
        for one in (a, b)
    )
    d = (np.arange(2 * len(x) - 1) - (len(x) - 1)) * step
    return _told(d, np.convolve(second, first[::-1]).astype(np.float64))


def _pairs(found_a: Sequence[Surface], found_b: Sequence[Surface], ruler: Ruler) -> list[_Pair]:
    """Lay the likelihoods of both thresholds of each person over their middle and difference."""
    # Weights are made once for axes that people share; who is too narrow for them has others.
    of_mu = _over_mu([*found_a, *found_b], ruler)
    every = list(zip(of_mu[: len(found_a)], of_mu[len(found_a) :], strict=True))
    sketches = [
        _laid(
            *one,
            *(
                np.linspace(ends[0], ends[1], n)
                for ends, n in zip(_box(*one), _SKETCH, strict=True)
            ),
        )
        for one in every
    ]
    shared = [
        _where_likely([(getattr(one, name), one.values.max(axis=1 - i)) for one in sketches], n)
        for i, (name, n) in enumerate(zip("md", _NODES, strict=True))
    ]
    found = []
    for one, sketch in zip(every, sketches, strict=True):
        pair = _laid(*one, *shared)
        narrow = any(
            (pair.values.max(axis=axis) > _HALF * pair.values.max()).sum() < _ENOUGH
            for axis in (0, 1)
        )
        own = (
            [
                _where_likely([(axis, sketch.values.max(axis=1 - i))], n)
                for i, (axis, n) in enumerate(zip((sketch.m, sketch.d), _NODES, strict=True))
            ]
            if narrow
            else []
        )
        found.append(_laid(*one, *own) if narrow else pair)
    return found


def _over_mu(found: Sequence[Surface], ruler: Ruler) -> list[tuple[Floats, Floats]]:
    """Return nodes of mu and the likelihood of each table there, sigma integrated out.

    log sigma has the density that the other tables tell, of N(S, omega) as in a group: the tails of
    mu are those of people who are too steep or too flat for the others.
    """
    middle, width = (np.ravel(one) for one in np.meshgrid(_SIGMAS, OMEGA))
    prior = np.log(sigma_prior(middle)) - 0.5 * (width / OMEGA_SPREAD) ** 2
    axes = {id(one.log_sigma): one.log_sigma for one in found}
    weights = {key: normal_weights(axis, middle, width) for key, axis in axes.items()}
    values = [one.values for one in found]
    told = []
    for one, value in zip(found, values, strict=True):
        of_sigma = (trapezoid(one.mu) * ruler.mu_prior(one.mu)) @ value
        told.append(np.log(np.maximum(weights[id(one.log_sigma)] @ of_sigma, _TINY)))
    total = prior + np.sum(told, axis=0)
    others = [np.exp(total - own - (total - own).max()) for own in told]
    return [
        (one.mu, value @ (other @ weights[id(one.log_sigma)]))
        for one, value, other in zip(found, values, others, strict=True)
    ]


def _box(a: tuple[Floats, Floats], b: tuple[Floats, Floats]) -> Floats:
    """Return the least and greatest m that matter, and d: (2, 2)."""
    (low_a, high_a), (low_b, high_b) = (matters(*one, least=_SEEN) for one in (a, b))
    farthest = 2 * _FARTHEST
    return np.array(
        [
            [(low_a + low_b) / 2, (high_a + high_b) / 2],
            [max(low_b - high_a, -farthest), min(high_b - low_a, farthest)],
        ]
    )


def _where_likely(margins: Sequence[tuple[Floats, Floats]], count: int) -> Floats:
    """Return nodes between the ends of densities that are closer where these are."""
    low = min(float(axis[0]) for axis, _ in margins)
    high = max(float(axis[-1]) for axis, _ in margins)
    x = np.linspace(low, high, 8 * count)
    close = np.full(len(x), _EVENLY / (high - low))
    for axis, margin in margins:
        density = np.interp(x, axis, margin, left=0.0, right=0.0)
        close += density / max(float(trapezoid(x) @ density), _TINY) / len(margins)
    share = np.concatenate([[0.0], np.cumsum((close[1:] + close[:-1]) / 2)])
    return np.interp(np.linspace(0, share[-1], count), share, x)


def _laid(a: tuple[Floats, Floats], b: tuple[Floats, Floats], m: Floats, d: Floats) -> _Pair:
    half = d / 2
    values = np.interp(m[:, None] - half, *a)
    values *= np.interp(m[:, None] + half, *b)
    return _Pair(m=m, d=d, values=values / max(values.max(), _TINY))


def _of_group(
    pairs: Sequence[_Pair], ruler: Ruler, people: Sequence[Difference]
) -> tuple[Difference, tuple[Floats, Floats]]:
    """Return the group's difference, and the density of tau_d over its nodes."""
    middle = np.linspace(ruler.low - REACH, ruler.high + REACH, 17)
    spread = 0.1 + 14.0 * np.linspace(0, 1, 5) ** 1.7
    shift = np.linspace(-_FARTHEST, _FARTHEST, 33)
    between = 0.05 + 18.0 * np.linspace(0, 1, 8) ** 1.7
    for turn in range(_PASSES):
        axes = (middle, spread, shift, between)
        cells = _likelihood(pairs, *axes)
        cells *= np.exp(-0.5 * (spread / SPREAD) ** 2)[:, None, None]
        cells *= np.exp(-0.5 * (between / _DIFFERENCE_SPREAD) ** 2)
        of_shift = _margin(cells, axes, 2)
        if not turn:
            # What everybody leaves open stays so, though the first grid be too coarse to show it.
            below, above = _open(of_shift)
            ends = [one.difference_limits_db for one in people]
            open_ends = (
                below or all(low == -math.inf for low, _ in ends),
                above or all(high == math.inf for _, high in ends),
            )
        if turn == _PASSES - 1:
            break
        cells *= _prior(shift)[:, None]
        boxes = [matters(axis, _margin(cells, axes, i)) for i, axis in enumerate(axes)]
        last = turn == _PASSES - 2
        counts = ((9, 1), (5, 1.4), (49 if last else 21, 1), (12 if last else 8, 1.6))
        middle, spread, shift, between = (
            low + (high - low) * np.linspace(0, 1, n) ** power
            for (low, high), (n, power) in zip(boxes, counts, strict=True)
        )
    cells *= _prior(shift)[:, None]
    nodes, density = _finer(_margin(cells, axes, 3), between)
    low_db, middle_db, high_db = quantiles(density[None], nodes)[0]
    difference = replace(
        _told(shift, of_shift, open_ends),
        spread_db=float(middle_db),
        spread_limits_db=(float(low_db), float(high_db)),
    )
    return difference, (nodes, density)


def _finer(density: Floats, x: Floats) -> tuple[Floats, Floats]:
    """Return nodes and a density there that is known at a dozen nodes only.

    A curve through its logarithms tells limits better than lines between its values.
    """
    from scipy.interpolate import CubicSpline

    nodes = np.linspace(x[0], x[-1], _SPREAD_NODES)
    curve = CubicSpline(x, np.log(np.maximum(density, _TINY)))
    return nodes, np.exp(curve(nodes))


def _margin(cells: Floats, axes: Sequence[Floats], kept: int) -> Floats:
    """Return the integral over all axes but one."""
    for i in reversed(range(len(axes))):
        if i != kept:
            cells = np.asarray(np.tensordot(cells, trapezoid(axes[i]), (i, 0)), dtype=np.float64)
    return cells


def _likelihood(
    pairs: Sequence[_Pair], middle: Floats, spread: Floats, shift: Floats, between: Floats
) -> Floats:
    """Return the likelihood of M, tau, D and tau_d, greatest 1."""
    of_m, of_d = (
        [np.ravel(one) for one in np.meshgrid(*axes, indexing="ij")]
        for axes in ((middle, spread), (shift, between))
    )
    weights: dict[int, Floats] = {}
    total = np.zeros((len(of_m[0]), len(of_d[0])))
    for one in pairs:
        for axis, (at, width) in ((one.m, of_m), (one.d, of_d)):
            if id(axis) not in weights:
                weights[id(axis)] = normal_weights(axis, at, width)
        person = weights[id(one.m)] @ one.values @ weights[id(one.d)].T
        total += np.log(np.maximum(person, _TINY))
    shape = (len(middle), len(spread), len(shift), len(between))
    return np.asarray(np.exp(total - total.max())).reshape(shape)


def _prior(d: Floats) -> Floats:
    return np.asarray(np.exp(-0.5 * (d / _PRIOR) ** 2))


def _open(likelihood: Floats) -> tuple[bool, bool]:
    """Tell whether a likelihood bounds nothing below, and above."""
    least = _OPEN * likelihood.max()
    return bool(likelihood[0] > least), bool(likelihood[-1] > least)


def _told(d: Floats, likelihood: Floats, open_ends: tuple[bool, bool] | None = None) -> Difference:
    below, above = open_ends or _open(likelihood)
    low, middle, high = quantiles((likelihood * _prior(d))[None], d)[0]
    words: dict[tuple[bool, bool], DifferenceStatus] = {
        (False, False): "ok",
        (False, True): "at_least",
        (True, False): "at_most",
        (True, True): "unknown",
    }
    return Difference(
        status=words[below, above],
        difference_db=math.nan if below or above else float(middle),
        difference_limits_db=(
            -math.inf if below else float(low),
            math.inf if above else float(high),
        ),
    )
