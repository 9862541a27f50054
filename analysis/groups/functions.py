"""Psychometric functions as they are drawn: of people and of groups, with 95 % credible bands.

The line is the function of the values that are told; the band is of the function at each level by
itself, 95 % of its posterior. A group's function is the mean of the functions of people of its
kind, gamma + (1 - gamma - lambda) Phi((x - M) / sqrt(sigma^2 + tau^2)), with sigma at exp(S) and
the means of its people's gamma and lambda (docs/statistics.md, section 8).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr, xlogy

from analysis.groups.group import PeopleTables
from analysis.groups.hierarchy import hierarchy
from analysis.thresholds.density import Ruler, legendre, sigma_prior, trapezoid
from analysis.thresholds.mle import LOG_SIGMA, MOST_LAPSES, REACH
from analysis.thresholds.people import MOST_GUESSES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.thresholds.people import GuessRate, PersonCounts

    Floats = NDArray[np.float64]


_POINTS: Final = 49
_FINER: Final = (31, 25)
"""Nodes of tau and S: with fewer, lines would have corners that can be seen."""
_MATTERS: Final = 1e-3
"""Of the greatest weight: what has less moves no line that can be seen."""
_BINS: Final = 4000
_FIRST, _NEXT = (41, 13, 4, 12), (25, 11, 9, 12)
"""Nodes of mu, log sigma, lambda and gamma: of all that the prior allows, and of what matters."""
_PASSES: Final = 16
_SETTLED: Final = 0.6
_ROOM: Final = 0.1
_AT_ONCE: Final = 400.0
"""So many stimuli do not make a peak that falls between the nodes."""
_COOLING: Final = 16.0
_LIMITS: Final = (0.025, 0.975)


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
    ruler = Ruler.of(x, axis.x_scale)
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
        x_scale=axis.x_scale,
    )
    used = tables.presented > 0
    ruler = Ruler.of(tables.x[used], axis.x_scale)
    each = tables.surfaces(ruler)
    found = hierarchy(each, ruler)
    spread_at, between = _finer(found.spread, _FINER[0])
    log_sigma_at, along = _finer(found.log_sigma, _FINER[1])
    cells = np.einsum("ut,mts,vs->muv", between, found.cells, along, optimize=True)
    weight = cells * np.multiply.outer(
        np.outer(trapezoid(found.middle), trapezoid(spread_at)), trapezoid(log_sigma_at)
    )
    near = weight > _MATTERS * weight.max()
    middle, spread, log_sigma = (
        one[near] for one in np.meshgrid(found.middle, spread_at, log_sigma_at, indexing="ij")
    )
    width = np.hypot(np.exp(log_sigma), spread)
    gamma = math.fsum(one.mean for one in tables.guesses) / len(each)
    lapse = math.fsum(one.lapse_rate for one in each) / len(each)
    drawn_at, level_vpp = _places(people.level_vpp[chosen][used], axis)
    z = (drawn_at[:, None] / ruler.step - middle) / width
    low, high = _limits(gamma + (1 - gamma - lapse) * ndtr(z), weight[near])
    line = Line(
        mu=float(found.of_middle()[1]) * ruler.step,
        sigma=_median(width, weight[near]) * ruler.step,
        lapse_rate=lapse,
        guess_rate=gamma,
    )
    return Function(level_vpp=level_vpp, low=low, high=high, line=line, axis=axis)


def _median(values: Floats, weight: Floats) -> float:
    order = np.argsort(values)
    below = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(below, below[-1] / 2)])


def _finer(nodes: Floats, count: int) -> tuple[Floats, Floats]:
    """Return more nodes, and the weights by which values are interpolated there: (more, nodes)."""
    at = np.linspace(nodes[0], nodes[-1], count)
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

    On a grid of all four parameters, laid anew over the part that matters until that fills it. Of
    very many stimuli a part of their log likelihood comes first, so that no peak falls between two
    nodes.
    """
    ends = np.array([[ruler.low - REACH, ruler.high + REACH], LOG_SIGMA, [0.0, MOST_LAPSES],
                     [0.0, MOST_GUESSES]])  # fmt: skip
    limits, nodes = ends.copy(), _FIRST
    heat = max(float(table[2].sum()) / _AT_ONCE, 1.0)
    for _ in range(_PASSES):
        grid = _Grid.within(ends, nodes, guess)
        axes, joint = grid.axes, grid.posterior(table, ruler, heat)
        shrunk = False
        for i, axis in enumerate(axes):
            margin = joint.sum(axis=tuple(j for j in range(4) if j != i))
            near = np.flatnonzero(margin > _MATTERS * margin.max())
            room = _ROOM * np.ptp(ends[i])
            outer = np.clip(ends[i] + [-room, room], *limits[i])
            padded = np.concatenate([outer[:1], axis, outer[1:]])
            box = padded[[near[0], near[-1] + 2]]
            shrunk |= bool(len(axis) > 1 and np.ptp(box) < _SETTLED * np.ptp(ends[i]))
            ends[i] = box
        if heat == 1 and not shrunk:
            break
        nodes, heat = _NEXT, max(heat / _COOLING, 1.0)
    near_all = joint > _MATTERS * joint.max()
    mu, log_sigma, lapse, gamma = (
        axis[where] for axis, where in zip(axes, np.nonzero(near_all), strict=True)
    )
    felt = ndtr((at[:, None] - mu) * np.exp(-log_sigma))
    return _limits(gamma + (1 - gamma - lapse) * felt, joint[near_all])


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """Nodes of mu, log sigma, lambda and gamma, and the weights of the last two."""

    axes: tuple[Floats, Floats, Floats, Floats]
    lapse_weight: Floats
    guess_weight: Floats

    @classmethod
    def within(cls, ends: Floats, nodes: tuple[int, int, int, int], guess: GuessRate) -> _Grid:
        """Lay nodes between ends."""
        mu, log_sigma = (np.linspace(ends[i, 0], ends[i, 1], nodes[i]) for i in (0, 1))
        at, part = legendre(nodes[2])
        lapse = ends[2, 0] + np.ptp(ends[2]) * at
        gamma, share = _guesses(guess, ends[3], nodes[3])
        return cls((mu, log_sigma, lapse, gamma), part * (1 - lapse) ** 9, share)

    def posterior(self, table: tuple[Floats, Floats, Floats], ruler: Ruler, heat: float) -> Floats:
        """Return the weight of each cell, with a part of the log likelihood."""
        u, k, n = table
        mu, log_sigma, lapse, gamma = self.axes
        z = (u[:, None, None] - mu[:, None]) * np.exp(-log_sigma)
        up, down = (ndtr(sign * z)[..., None, None] for sign in (1, -1))
        rest = 1 - gamma - lapse[:, None]
        log = np.zeros((len(mu), len(log_sigma), len(lapse), len(gamma)))
        for felt, missed, a, b in zip(up, down, k, n - k, strict=True):
            log += xlogy(a, gamma + rest * felt) + xlogy(b, lapse[:, None] + rest * missed)
        joint = np.exp((log - log.max()) / heat)
        joint *= np.outer(ruler.mu_prior(mu), sigma_prior(log_sigma))[..., None, None]
        joint *= self.lapse_weight[:, None] * self.guess_weight
        return np.asarray(joint)


def _guesses(guess: GuessRate, ends: Floats, points: int) -> tuple[Floats, Floats]:
    """Return points and relative weights of a Beta distributed rate between two ends.

    By Gauss and Legendre in the angle arcsin(sqrt(gamma)), where no density is infinite.
    """
    if guess.known:
        return np.array([guess.mean]), np.ones(1)
    at, weight = legendre(points)
    first, last = np.arcsin(np.sqrt(ends))
    sine = np.sin(first + at * (last - first)) ** 2
    log = guess.log_density(sine)
    return np.asarray(sine), np.asarray(weight * np.exp(log - log.max()))


def _limits(p: Floats, weight: Floats) -> Floats:
    """Return the points of `_LIMITS` of p, (places, cells), weighted: (3, places).

    >>> _limits(np.linspace(0, 1, 101)[None], np.ones(101)).round(2).ravel().tolist()
    [0.02, 0.98]
    """
    places = len(p)
    bins = np.minimum((p * _BINS).astype(np.int64), _BINS - 1)
    flat = (bins + _BINS * np.arange(places)[:, None]).ravel()
    held = np.bincount(flat, np.broadcast_to(weight, p.shape).ravel(), places * _BINS)
    below = np.cumsum(held.reshape(places, _BINS), axis=1)
    below = np.concatenate([np.zeros((places, 1)), below / below[:, -1:]], axis=1)
    found = np.empty((len(_LIMITS), places))
    for row, wanted in enumerate(_LIMITS):
        after = (below < wanted).sum(axis=1)  # the first edge at which as much lies below
        every = np.arange(places)
        first, last = below[every, after - 1], below[every, after]
        found[row] = (after - 1 + (wanted - first) / (last - first)) / _BINS
    return found
