"""Psychometric functions as they are drawn: of people and of groups, with 95 % credible bands.

The line is the function of the values that are told; the band is of the function at each level by
itself, 95 % of its posterior. A group's function is the mean of the functions of people of its
kind, gamma + (1 - gamma - lambda) Phi((x - M) / sqrt(sigma^2 + tau^2)), with sigma at exp(S), the
mean of its people's gamma, and that of their lambda by the kind of lapses that all have in common
(docs/statistics.md, section 8).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr, stdtrit

from analysis.definitions import LIMITS
from analysis.groups.hierarchy import FEW, PeopleTables, hierarchy, matters
from analysis.thresholds.density import Ruler, sigma_prior, trapezoid
from analysis.thresholds.grid import rates_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.thresholds.grid import Surface
    from analysis.thresholds.people import GuessRate, PersonCounts

    Floats = NDArray[np.float64]


_POINTS: Final = 49
_OF_GROUP, _OF_PERSON = (121, 15), (49, 21)
"""Nodes of M and S, and of mu and log sigma: with fewer, lines have corners that can be seen."""
_MATTERS: Final = 1e-3
"""Of the greatest weight: what has less moves no line that can be seen."""
_BINS: Final = 4000
_THREE: Final = ((-math.sqrt(3), 1 / 6), (0.0, 2 / 3), (math.sqrt(3), 1 / 6))
"""Points that stand for a distribution, in standard deviations, and their shares."""
_FAR: Final = 1.96
_AT_LIMITS: Final = ((-_FAR, 0.5 / _FAR**2), (0.0, 1 - 1 / _FAR**2), (_FAR, 0.5 / _FAR**2))
"""The same of a mean, nearly normal: the outer ones are at its 95 % limits."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Function:
    """A psychometric function between the lowest and the highest tested level.

    `low` and `high` are 95 % limits of its value at each of `level_vpp`.
    """

    level_vpp: Floats
    low: Floats
    high: Floats
    line: Line
    axis: Axis

    def at(self, level_vpp: Floats) -> Floats:
        """Return its value at levels."""
        return self.line.at(self.axis.on_axis(level_vpp))


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """gamma + (1 - gamma - lambda) Phi((x - mu) / sigma), all on the axis."""

    mu: float
    sigma: float
    lapse_rate: float
    guess_rate: float

    def at(self, x: Floats) -> Floats:
        """Return the value at places on the axis.

        >>> line = Line(mu=2.0, sigma=0.1, lapse_rate=0.02, guess_rate=0.5)
        >>> line.at(np.array([-9.0, 2.0, 9.0])).tolist()
        [0.5, 0.74, 0.98]
        """
        felt = ndtr((x - self.mu) / self.sigma)
        return np.asarray(self.guess_rate + (1 - self.guess_rate - self.lapse_rate) * felt)


def person_function(people: PersonCounts, row: int, line: Line, axis: Axis) -> Function:
    """Return the function of one of the people, who has several levels; its line is told."""
    used = people.presented[row] > 0
    x = axis.on_axis(people.level_vpp[row, used])
    ruler = Ruler.of(x, axis.fitted)
    table = (x / ruler.step, people.detected[row, used], people.presented[row, used])
    at, level_vpp = _places(people.level_vpp[row, used], axis)
    low, high = _of_person(table, ruler, people.guesses[row].rate, at / ruler.step)
    return Function(level_vpp=level_vpp, low=low, high=high, line=line, axis=axis)


def group_function(people: PersonCounts, rows: Sequence[int], axis: Axis) -> Function:
    """Return the function of the group of some of the people; they have several levels."""
    chosen = list(rows)
    tables = PeopleTables(
        x=axis.on_axis(people.level_vpp[chosen]),
        detected=people.detected[chosen],
        presented=people.presented[chosen],
        guesses=[people.guesses[i].rate for i in chosen],
        x_scale=axis.fitted,
    )
    used = tables.presented > 0
    ruler = Ruler.of(tables.x[used], axis.fitted)
    each = tables.surfaces(ruler)
    found = hierarchy(each, ruler)
    middle_at, up = _finer(found.middle, found.middle[[0, -1]], _OF_GROUP[0])
    log_sigma_at, along = _finer(found.log_sigma, found.log_sigma[[0, -1]], _OF_GROUP[1])
    cells = np.einsum("um,mts,vs->utv", up, found.cells, along, optimize=True)
    weight = cells * np.multiply.outer(
        np.outer(trapezoid(middle_at), trapezoid(found.spread)), trapezoid(log_sigma_at)
    )
    near = weight > _MATTERS * weight.max()
    middle, spread, log_sigma = (
        one[near] for one in np.meshgrid(middle_at, found.spread, log_sigma_at, indexing="ij")
    )
    width = np.hypot(np.exp(log_sigma), spread)
    gamma, of_gamma = _mean_guess(each)
    # What all have in common tells more of lapses than each person's few strong stimuli.
    lapses, variances = np.mean([one.lapse_by_kind for one in each], axis=0)
    lapse = float(found.of_kind @ lapses)
    drawn_at, level_vpp = _places(people.level_vpp[chosen][used], axis)
    z = (drawn_at[:, None] / ruler.step - middle) / width
    felt, values, shares = ndtr(z), [], []
    for mean, of_lapse, of_kind in zip(lapses, variances / len(each), found.of_kind, strict=True):
        if of_kind <= _MATTERS:
            continue
        middle_p = gamma + (1 - gamma - mean) * felt
        spread_p = np.sqrt(of_gamma * (1 - felt) ** 2 + of_lapse * felt**2)
        for at, share in _AT_LIMITS:
            values.append(np.clip(middle_p + at * spread_p, 0.0, 1.0))
            shares.append(of_kind * share * weight[near])
    low, high = _limits(np.concatenate(values, axis=1), np.concatenate(shares))
    line = Line(
        mu=float(found.of_middle()[1]) * ruler.step,
        sigma=_median(width, weight[near]) * ruler.step,
        lapse_rate=lapse,
        guess_rate=gamma,
    )
    return Function(level_vpp=level_vpp, low=low, high=high, line=line, axis=axis)


def _mean_guess(each: Sequence[Surface]) -> tuple[float, float]:
    """Return the mean guess rate of people and its variance, which is of people like them.

    How far their own lie apart has what is not known of each in it, but for people who happen to
    be alike. The variance is enlarged to that of a normal value with the limits of Student's t.
    """
    rates = np.array([one.guess_rate for one in each])
    own = float(np.mean([one.guess_variance for one in each]))
    between = float(rates.var(ddof=1)) if len(rates) > 1 else 0.0
    wider = float(stdtrit(max(len(rates), FEW) - 1, LIMITS[1])) / _FAR
    return float(rates.mean()), max(between, own) / len(rates) * wider**2


def _median(values: Floats, weight: Floats) -> float:
    order = np.argsort(values)
    below = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(below, below[-1] / 2)])


def _finer(nodes: Floats, ends: Sequence[float] | Floats, count: int) -> tuple[Floats, Floats]:
    """Return more nodes, and the weights by which values are interpolated there: (more, nodes)."""
    at = np.linspace(ends[0], ends[1], count)
    return at, np.stack([np.interp(at, nodes, one) for one in np.eye(len(nodes))], axis=1)


def _places(levels_vpp: Floats, axis: Axis) -> tuple[Floats, Floats]:
    """Return where a function is drawn, on the axis and as levels: the tested ones and between."""
    tested = np.unique(levels_vpp)
    at = axis.on_axis(tested)
    between = np.linspace(at[0], at[-1], _POINTS)[1:-1]
    x = np.concatenate([at, between])
    level_vpp = np.concatenate([tested, [axis.level(float(one)) for one in between]])
    order = np.argsort(x, kind="stable")
    return x[order], level_vpp[order]


def _of_person(
    table: tuple[Floats, Floats, Floats], ruler: Ruler, guess: GuessRate, at: Floats
) -> Floats:
    """Return the limits of a person's function; levels and places in steps.

    At each mu and sigma its value has a mean and a variance, from those of gamma and lambda there;
    three points stand for its distribution.
    """
    found = rates_of(table, ruler=ruler, guess=guess)
    likely = found.sums[0]
    mu_ends, sigma_ends = (
        matters(axis, likely.max(axis=1 - i), _MATTERS)
        for i, axis in enumerate((found.mu, found.log_sigma))
    )
    mu_at, up = _finer(found.mu, mu_ends, _OF_PERSON[0])
    log_sigma_at, along = _finer(found.log_sigma, sigma_ends, _OF_PERSON[1])
    sums = up @ found.sums @ along.T
    weight = sums[0] * np.outer(ruler.mu_prior(mu_at), sigma_prior(log_sigma_at))
    near = weight > _MATTERS * weight.max()
    mu, log_sigma = (one[near] for one in np.meshgrid(mu_at, log_sigma_at, indexing="ij"))
    gamma, rest, of_gamma, mixed, of_rest = sums[1:, near] / sums[0, near]
    felt = ndtr((at[:, None] - mu) * np.exp(-log_sigma))
    mean = gamma + rest * felt
    variance = of_gamma + (2 * mixed + of_rest * felt) * felt - mean**2
    spread = np.sqrt(np.maximum(variance, 0.0))
    points = [mean + at * spread for at, _ in _THREE]
    shares = np.concatenate([share * weight[near] for _, share in _THREE])
    return _limits(np.clip(np.concatenate(points, axis=1), 0.0, 1.0), shares)


def _limits(p: Floats, weight: Floats) -> Floats:
    """Return the points of `LIMITS` of p, (places, cells), weighted: (3, places).

    >>> _limits(np.linspace(0, 1, 101)[None], np.ones(101)).round(2).ravel().tolist()
    [0.02, 0.98]
    """
    places = len(p)
    bins = np.minimum((p * _BINS).astype(np.int64), _BINS - 1)
    flat = (bins + _BINS * np.arange(places)[:, None]).ravel()
    held = np.bincount(flat, np.broadcast_to(weight, p.shape).ravel(), places * _BINS)
    below = np.cumsum(held.reshape(places, _BINS), axis=1)
    below = np.concatenate([np.zeros((places, 1)), below / below[:, -1:]], axis=1)
    found = np.empty((len(LIMITS), places))
    for row, wanted in enumerate(LIMITS):
        after = (below < wanted).sum(axis=1)  # the first edge at which as much lies below
        every = np.arange(places)
        first, last = below[every, after - 1], below[every, after]
        found[row] = (after - 1 + (wanted - first) / (last - first)) / _BINS
    return found
