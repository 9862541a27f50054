"""The posterior of a psychometric function on a grid that finds the place where it matters.

Prior on the scaled levels (docs/statistics.md, section 8): mu uniform on [-1, 1.5], log sigma
uniform on [log 0.02, 0], lambda Beta(1, 10) on [0, 0.1], gamma given or Beta.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr, roots_legendre

from analysis.thresholds.likelihood import LOWER, UPPER, Tables, fit_lapsing

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from analysis.thresholds.people import GuessRate

    Floats = NDArray[np.float64]


QUANTILES: Final = (0.025, 0.5, 0.975)


@dataclass(frozen=True, slots=True, kw_only=True)
class Nodes:
    """How many points a grid has; of mu and log sigma one more than a multiple of four."""

    mu: int = 41
    log_sigma: int = 25
    lapse: int = 7
    guess: int = 5

    @property
    def cells(self) -> int:
        """Nodes of mu and log sigma together."""
        return self.mu * self.log_sigma

    def finer(self, times: int) -> Nodes:
        """Return nodes with so many times smaller steps in mu and log sigma."""
        return replace(
            self, mu=times * (self.mu - 1) + 1, log_sigma=times * (self.log_sigma - 1) + 1
        )


STANDARD: Final = Nodes()
"""Limits within about 1e-3 of the levels' range; docs/benchmarks.md has error against time."""

_COARSE: Final = Nodes(mu=33, log_sigma=17, lapse=5, guess=1)
_REACH: Final = 20.0
_SURER: Final = 3
"""So many times more points of lambda where the data narrow it down."""
_ZOOMS: Final = 30
_STILL_SHRINKING: Final = 0.6
_WHOLE: Final = 0.9
_DENSE: Final = 32
_CHUNK_CELLS: Final = 400_000
_CLOSE: Final = 3e-3
"""Of the levels' range; so far the points of two grids may lie apart."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Posterior:
    """What is known of many psychometric functions, on their scaled levels."""

    mu: Floats  # at the points of `QUANTILES`, as log_sigma: (fits, 3)
    log_sigma: Floats
    lapse_rate: Floats  # mean: (fits,)
    below: Floats  # probability that mu lies below the lowest level, or above the highest: (fits,)
    above: Floats
    best: Floats  # likeliest mu, log sigma and lambda: (fits, 3)


def posterior(
    tables: Tables, guesses: Sequence[GuessRate], nodes: Nodes | None = None
) -> Posterior:
    """Return the posterior of every table; its levels differ, and it has at least one stimulus.

    By default the last grid is `STANDARD`, and twice as fine once and again where every second node
    alone tells something else.
    """
    fits, levels = len(tables), max(1, tables.u.shape[1])
    # A grid over the whole prior would need thousands of nodes where many trials make the posterior
    # narrow: the box is sought first. Whether the grid in it is fine enough is asked of itself, by
    # leaving out every other node; only the tables whose points move are laid out anew, finer.
    box, best = np.empty((fits, 3, 2)), np.empty((fits, 3))
    for part in _parts(np.arange(fits), _COARSE.cells * levels * _COARSE.lapse // 2):
        box[part], best[part] = _zoom(tables[part])
    found = _Points(mu=np.empty((fits, 3)), log_sigma=np.empty((fits, 3)), rest=np.empty((fits, 4)))
    going = np.arange(fits)
    fineness = [nodes] if nodes else [STANDARD.finer(times) for times in (1, 2, 4)]
    for grid in fineness:
        for part in _parts(going, grid.cells * levels):
            own = [guesses[i] for i in part]
            found[part] = _integrated(tables[part], own, _with_best(box[part], best[part]), grid)
        going = going[found.rest[going, 3] > _CLOSE]
    return Posterior(
        mu=found.mu,
        log_sigma=found.log_sigma,
        lapse_rate=found.rest[:, 0],
        below=found.rest[:, 1],
        above=found.rest[:, 2],
        best=best,
    )


def _parts(rows: NDArray[np.intp], cells: int) -> list[NDArray[np.intp]]:
    """Split rows, each of so many cells, into pieces that fit the cache."""
    pieces = -(-len(rows) * cells // _CHUNK_CELLS)
    return list(np.array_split(rows, min(pieces, len(rows)))) if len(rows) else []


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Points:
    """The points of `QUANTILES`; then mean lambda, what lies below and above, and the doubt."""

    mu: Floats
    log_sigma: Floats
    rest: Floats

    def __setitem__(self, rows: NDArray[np.intp], values: _Points) -> None:
        self.mu[rows], self.log_sigma[rows] = values.mu, values.log_sigma
        self.rest[rows] = values.rest


def _integrated(tables: Tables, guesses: Sequence[GuessRate], box: Floats, nodes: Nodes) -> _Points:
    axes = [_axis(box[:, i], n) for i, n in enumerate((nodes.mu, nodes.log_sigma))]
    spots = list(_nuisance(box[:, 2], guesses, nodes))
    shape = _shape(tables, *axes)
    values = [_cells(tables, shape, spot.lapse, spot.guess) for spot in spots]
    top = np.max([one.max(axis=(1, 2)) for one in values], axis=0)[:, None, None]
    density = np.zeros((len(tables), nodes.mu, nodes.log_sigma))
    with_lapse = np.zeros_like(density)
    for one, spot in zip(values, spots, strict=True):
        part = np.exp(one - top) * spot.weight
        density += part
        with_lapse += part * spot.lapse
    in_mu, in_sigma = _simpson(nodes.mu), _simpson(nodes.log_sigma)
    mu, below, above = _points(density @ in_sigma, box[:, 0])
    half = density[:, ::2, ::2] @ _simpson(nodes.log_sigma // 2 + 1)
    empty = half.max(axis=1) == 0
    other = _points(np.where(empty[:, None], 1.0, half), box[:, 0])[0]
    doubt = np.where(empty, np.inf, np.abs(other - mu).max(axis=1))
    lapse_rate = (with_lapse @ in_sigma) @ in_mu / ((density @ in_sigma) @ in_mu)
    return _Points(
        mu=mu,
        log_sigma=_points(in_mu @ density, box[:, 1])[0],
        rest=np.stack([lapse_rate, below, above, doubt], axis=1),
    )


def _zoom(tables: Tables) -> tuple[Floats, Floats]:
    """Return the box, shape (fits, 3, 2), outside which nothing matters, and the likeliest point.

    A coarse grid is laid over the prior, then over the part of it that matters with a cell around,
    and so on until that part fills the grid.
    """
    fits = len(tables)
    prior = np.stack([LOWER, UPPER], axis=1)
    box, start = np.broadcast_to(prior, (fits, 3, 2)).copy(), np.zeros((fits, 3))
    active = np.arange(fits)
    points = (_COARSE.mu, _COARSE.log_sigma, _COARSE.lapse)
    for _ in range(_ZOOMS):
        part = tables[active]
        axes = [_axis(box[active, i], n) for i, n in enumerate(points)]
        shape = _shape(part, axes[0], axes[1])
        guess = part.guess_rate[:, None, None]
        lapses = axes[2].T[:, :, None, None]
        value = np.stack([_cells(part, shape, lapse, guess) for lapse in lapses], axis=3)
        start[active] = _top(value, axes)
        near = value > value.max(axis=(1, 2, 3), keepdims=True) - _REACH
        others = ((2, 3), (1, 3), (1, 2))
        new = [_span(near.any(axis=o), axis) for o, axis in zip(others, axes, strict=True)]
        shrunk = np.ptp(new, axis=2).T / np.ptp(box[active], axis=2)
        box[active] = np.stack(new, axis=1)
        active = active[shrunk.min(axis=1) < _STILL_SHRINKING]
        if not len(active):
            break
    return box, fit_lapsing(tables, start)


def _top(values: Floats, axes: Sequence[Floats]) -> Floats:
    """Return mu, log sigma and lambda of each grid's best node."""
    fits = np.arange(len(values))
    places = np.unravel_index(values.reshape(len(values), -1).argmax(axis=1), values.shape[1:])
    return np.stack([axis[fits, i] for axis, i in zip(axes, places, strict=True)], axis=1)


def _span(near: NDArray[np.bool_], axis: Floats) -> Floats:
    """Return the ends of what is near on an axis, with a cell on either side, shape (fits, 2)."""
    fits, last = np.arange(len(near)), near.shape[1] - 1
    first = np.maximum(near.argmax(axis=1) - 1, 0)
    end = np.minimum(last - near[:, ::-1].argmax(axis=1) + 1, last)
    return np.stack([axis[fits, first], axis[fits, end]], axis=1)


def _with_best(box: Floats, best: Floats) -> Floats:
    """Let a box hold the likeliest point with room around it."""
    room = 0.1 * np.ptp(box, axis=2)
    low = np.maximum(np.minimum(box[:, :, 0], best - room), np.array(LOWER))
    high = np.minimum(np.maximum(box[:, :, 1], best + room), np.array(UPPER))
    return np.stack([low, high], axis=2)


def _axis(ends: Floats, points: int) -> Floats:
    return np.asarray(ends[:, :1] + np.linspace(0.0, 1.0, points) * np.ptp(ends, axis=1)[:, None])


def _shape(tables: Tables, mu: Floats, log_sigma: Floats) -> tuple[Floats, Floats]:
    """Return Phi(z) and Phi(-z) over levels and grid, shape (levels, fits, mu, log sigma)."""
    u = tables.u.T[:, :, None, None]
    z = (u - mu[None, :, :, None]) * np.exp(-log_sigma)[None, :, None, :]
    return ndtr(z), ndtr(-z)


def _cells(tables: Tables, shape: tuple[Floats, Floats], lapse: Floats, guess: Floats) -> Floats:
    """Return the log likelihood over the grid; lambda and gamma have the shape (fits, 1, 1)."""
    missed = tables.presented - tables.detected
    rest = 1 - guess - lapse
    tiny = np.finfo(np.float64).tiny
    total = np.zeros(shape[0].shape[1:])
    for level, (felt, unfelt) in enumerate(zip(*shape, strict=True)):
        k, m = tables.detected[:, level, None, None], missed[:, level, None, None]
        if k.any():
            total += k * np.log(np.maximum(guess + rest * felt, tiny))
        if m.any():
            total += m * np.log(np.maximum(lapse + rest * unfelt, tiny))
    return total


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Spot:
    """A pair of lambda and gamma with its weight, each of shape (fits, 1, 1)."""

    lapse: Floats
    guess: Floats
    weight: Floats


def _nuisance(lapse_ends: Floats, guesses: Sequence[GuessRate], nodes: Nodes) -> Iterator[_Spot]:
    """Return what lambda and gamma are integrated over: by Gauss and Legendre, Gauss and Jacobi."""
    whole = np.ptp(lapse_ends, axis=1).min() > _WHOLE * UPPER[2]
    at, weight = roots_legendre(nodes.lapse if whole else _SURER * nodes.lapse)
    points = nodes.guess if any(not one.known for one in guesses) else 1
    table = [one.nodes(points) for one in guesses]
    gamma, share = (np.array([one[i] for one in table]) for i in (0, 1))
    for place, part in zip((at + 1) / 2, weight, strict=True):
        lapse = lapse_ends[:, 0] + place * np.ptp(lapse_ends, axis=1)
        for i in range(points):
            mass = part * (1 - lapse) ** 9 * share[:, i]
            columns = [one[:, None, None] for one in (lapse, gamma[:, i], mass)]
            yield _Spot(lapse=columns[0], guess=columns[1], weight=columns[2])


@cache
def _simpson(points: int) -> Floats:
    weights = np.full(points, 2.0)
    weights[1::2] = 4.0
    weights[0] = weights[-1] = 1.0
    return weights / (3 * (points - 1))


@cache
def _curvature(points: int) -> Floats:
    """Return what turns values at equal steps of 1 into the curvatures of their spline.

    Cubic, its third derivative continuous at the second node and the last but one. Importing
    scipy.interpolate for it would take longer than most analyses.
    """
    left, right = np.zeros((points, points)), np.zeros((points, points))
    for row in range(1, points - 1):
        left[row, row - 1 : row + 2] = 1.0, 4.0, 1.0
        right[row, row - 1 : row + 2] = 6.0, -12.0, 6.0
    left[0, :3] = left[-1, -3:] = 1.0, -2.0, 1.0
    return np.asarray(np.linalg.solve(left, right).T)


def _integral(density: Floats) -> Floats:
    """Return the integral of each row's spline up to every `_DENSE`-th part of a step."""
    # One row at a time: a product of matrices may round a row differently in another place.
    bent = (density[:, None, :] @ _curvature(density.shape[1]))[:, 0]
    t = np.arange(1, _DENSE + 1) / _DENSE
    half, whole = t**2 / 2, t - t**2 / 2
    falling, rising = (1 - (1 - t) ** 4) / 24 - whole / 6, t**4 / 24 - half / 6
    first, last = density[:, :-1, None], density[:, 1:, None]
    pieces = whole * first + half * last + falling * bent[:, :-1, None] + rising * bent[:, 1:, None]
    pieces[:, 1:] += np.cumsum(pieces[:, :-1, -1], axis=1)[:, :, None]
    return np.concatenate([np.zeros((len(density), 1)), pieces.reshape(len(density), -1)], axis=1)


def _points(density: Floats, ends: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the points of `QUANTILES`, and the probability below 0 and above 1."""
    dense = np.linspace(0.0, 1.0, _DENSE * (density.shape[1] - 1) + 1)
    share = np.maximum.accumulate(_integral(density), axis=1)
    share /= share[:, -1:]
    width = np.ptp(ends, axis=1)
    at = np.array([np.interp(QUANTILES, one, dense) for one in share])
    rows = list(zip(share, ends[:, 0], width, strict=True))
    below = np.array([np.interp(-low / w, dense, one) for one, low, w in rows])
    upto = np.array([np.interp((1 - low) / w, dense, one) for one, low, w in rows])
    return ends[:, :1] + at * width[:, None], below, 1 - upto
