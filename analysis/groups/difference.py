"""How much two conditions differ, per person and for the group.

Person i has mu_a = m_i - d_i / 2 and mu_b = m_i + d_i / 2 with m_i ~ N(M, tau), d_i ~ N(D, tau_d)
(docs/statistics.md, section 8). Only likelihoods take part, not the prior of a single threshold:
two tables that tell only bounds would be pulled to a difference of 0 by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from analysis.groups.hierarchy import SPREAD, matters, normal_weights
from analysis.thresholds.density import quantiles, trapezoid
from analysis.thresholds.mle import REACH

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from analysis.groups.hierarchy import Hierarchy
    from analysis.thresholds.grid import Ruler, Surface

    Floats = NDArray[np.float64]


DifferenceStatus = Literal["ok", "at_least", "at_most", "unknown"]

_DIFFERENCE_SPREAD: Final = 6.0
"""Half-normal prior of tau_d, dB."""
_PRIOR: Final = 12.0
"""Normal prior of D, dB: it decides only where the data leave an end open, which is then told."""
_FARTHEST: Final = 24.0
_OPEN: Final = math.exp(-1.92)
"""A likelihood that stays above this part of its greatest bounds nothing (chi-square, 95 %)."""
_NODES: Final = (81, 121)
_HALF: Final = 0.5
_ENOUGH: Final = 3
"""Nodes above half of the greatest likelihood: fewer do not tell its shape."""
_SEEN: Final = 1e-7
_TINY: Final = 1e-300
_PASSES: Final = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """A difference of thresholds, b above a, in dB.

    Attributes
    ----------
    status : str
        ``ok``; ``at_least`` or ``at_most`` where only one end is bounded; ``unknown``.
    difference_db : float
        20 log10(threshold b / threshold a), posterior median; NaN unless ``ok``.
    difference_limits_db : tuple of float
        95 % limits; an open end is -inf or inf.
    """

    status: DifferenceStatus
    difference_db: float
    difference_limits_db: tuple[float, float]


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
    pairs = _pairs(found_a, found_b)
    people = [_told(one.d, trapezoid(one.m) @ one.values) for one in pairs]
    return _of_group(pairs, ruler, people), people


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
    return _told(d, np.convolve(second, first[::-1]))


def _pairs(found_a: Sequence[Surface], found_b: Sequence[Surface]) -> list[_Pair]:
    """Lay the likelihoods of both thresholds of each person over their middle and difference."""
    # Weights are made once for axes that people share; who is too narrow for them has others.
    boxes = np.array([_box(a, b) for a, b in zip(found_a, found_b, strict=True)])
    shared = _axes(boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0))
    found = []
    for a, b, (low, high) in zip(found_a, found_b, boxes, strict=True):
        pair = _laid(a, b, *shared)
        narrow = any(
            (pair.values.max(axis=axis) > _HALF * pair.values.max()).sum() < _ENOUGH
            for axis in (0, 1)
        )
        found.append(_laid(a, b, *_axes(low, high)) if narrow else pair)
    return found


def _box(a: Surface, b: Surface) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the least m and d that matter, and the greatest."""
    ends = []
    for one in (a, b):
        values = one.over_mu()
        near = np.flatnonzero(values > _SEEN * values.max())
        ends.append((one.mu[max(near[0] - 1, 0)], one.mu[min(near[-1] + 1, len(one.mu) - 1)]))
    (low_a, high_a), (low_b, high_b) = ends
    farthest = 2 * _FARTHEST
    return (
        ((low_a + low_b) / 2, max(low_b - high_a, -farthest)),
        ((high_a + high_b) / 2, min(high_b - low_a, farthest)),
    )


def _axes(low: Floats, high: Floats) -> tuple[Floats, Floats]:
    return np.linspace(low[0], high[0], _NODES[0]), np.linspace(low[1], high[1], _NODES[1])


def _laid(a: Surface, b: Surface, m: Floats, d: Floats) -> _Pair:
    half = d / 2
    values = np.interp(m[:, None] - half, a.mu, a.over_mu())
    values *= np.interp(m[:, None] + half, b.mu, b.over_mu())
    return _Pair(m=m, d=d, values=values / max(values.max(), _TINY))


def _of_group(pairs: Sequence[_Pair], ruler: Ruler, people: Sequence[Difference]) -> Difference:
    middle = np.linspace(ruler.low - REACH, ruler.high + REACH, 17)
    spread = 0.1 + 14.0 * np.linspace(0, 1, 5) ** 1.7
    shift = np.linspace(-_FARTHEST, _FARTHEST, 33)
    between = 0.05 + 10.0 * np.linspace(0, 1, 6) ** 1.7
    for turn in range(_PASSES):
        cells = _likelihood(pairs, middle, spread, shift, between)
        cells *= np.exp(-0.5 * (spread / SPREAD) ** 2)[:, None, None]
        cells *= np.exp(-0.5 * (between / _DIFFERENCE_SPREAD) ** 2)
        weights = [trapezoid(axis) for axis in (middle, spread, shift, between)]
        of_shift = np.einsum("mtds,m,t,s->d", cells, *weights[:2], weights[3], optimize=True)
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
        axes = (middle, spread, shift, between)
        boxes = [
            matters(axis, np.einsum("mtds,m,t,d,s->" + name, cells, *others, optimize=True))
            for name, axis, others in (
                (name, axis, [np.ones(len(w)) if i == j else w for j, w in enumerate(weights)])
                for i, (name, axis) in enumerate(zip("mtds", axes, strict=True))
            )
        ]
        last = turn == _PASSES - 2
        grow = [np.linspace(0, 1, n) ** power
                for n, power in ((13, 1), (6, 1.4), (31 if last else 21, 1), (8, 1.4))]  # fmt: skip
        middle, spread, shift, between = (
            low + (high - low) * one for (low, high), one in zip(boxes, grow, strict=True)
        )
    return _told(shift, of_shift, open_ends)


def _likelihood(
    pairs: Sequence[_Pair], middle: Floats, spread: Floats, shift: Floats, between: Floats
) -> Floats:
    """Return the likelihood of M, tau, D and tau_d, greatest 1."""
    of_m, of_d = ([np.ravel(one) for one in np.meshgrid(*axes, indexing="ij")]
                  for axes in ((middle, spread), (shift, between)))  # fmt: skip
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
