"""Likelihoods of psychometric functions over threshold and width, one grid for everything.

Single thresholds, groups and differences of conditions all start here. Lengths along the axis are
in steps of its prior: 1 dB where levels are logarithmic, 1/8 of the range where they are linear.
Prior (docs/statistics.md, section 8): mu uniform between the levels, falling outside as exp(-d/t);
sigma log-normal; lambda Beta(1, 10) on [0, 0.1]; gamma a number, or Beta.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr

from analysis.thresholds.density import (
    Axes,
    Nodes,
    Ruler,
    in_sigma,
    kinds,
    over_prior,
    quantiles,
    trapezoid,
    unresolved,
    within,
)
from analysis.thresholds.mle import (
    LOG_SIGMA,
    MOST_LAPSES,
    Tables,
    fit_lapsing,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from analysis.thresholds.people import GuessRate

    Floats = NDArray[np.float64]


_TINY: Final = 1e-300
_MATTERS: Final = 15.0
"""Of log likelihood below the greatest: what is less likely counts for nothing."""
_CHUNK_CELLS: Final = 400_000
_LEVELS: Final = 5  # that a table counts as having, where each has one stimulus
_ZOOMS: Final = 40
_AT_ONCE: Final = 400.0
"""Of more stimuli no node need lie near what is likely: at first only a part of their likelihood
counts, `_COOLING` times as much at each turn."""
_COOLING: Final = 16.0
_SETTLED: Final = 0.7
_ROOM: Final = 0.1
_CLOSE: Final = 0.1
"""Steps of the prior; so far the points of a grid and of half of it may lie apart."""
_SEEN: Final = 0.1
"""Of the greatest likelihood, that half of the nodes must see."""
_ALONE: Final = 0.75
"""A single node of lambda with more of the posterior does not tell its shape."""


STARTS: Final = 3
"""Nodes near which the likeliest function is looked for."""


STANDARD: Final = Nodes()
"""Limits within 0.03 dB; docs/benchmarks.md has error against time."""
_ZOOMED: Final = Nodes(outside=0)
_FINEST: Final = Nodes(between=121, outside=0, log_sigma=49, lapse=12)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """The likelihood of one table over mu and log sigma, greatest 1; flat beyond the ends of mu.

    Guesses and lapses are integrated out; mu is in steps of the prior.
    """

    mu: Floats
    log_sigma: Floats
    by_kind: Floats  # times the prior of each of `kinds`: (kinds, mu, log sigma)
    lapse_rate: float  # posterior mean, as that of the guess rate
    guess_rate: float
    guess_variance: float  # of its posterior
    lapse_by_kind: Floats  # mean and variance of lambda if this person is of each kind, (2, kinds)
    starts: Floats  # likeliest nodes: mu, log sigma and lambda, (STARTS, 3)

    @property
    def values(self) -> Floats:
        """The likelihood of a person of whom no kind is known, shape (mu, log sigma)."""
        return np.asarray(self.by_kind.sum(axis=0))

    def over_mu(self) -> Floats:
        """Return the likelihood of mu, sigma integrated out with its prior."""
        return np.asarray(self.values @ in_sigma(self.log_sigma))


def surfaces(
    u: Floats,
    detected: Floats,
    presented: Floats,
    *,
    rulers: Sequence[Ruler],
    guesses: Sequence[GuessRate],
    nodes: Nodes = STANDARD,
) -> list[Surface]:
    """Return the likelihood of every table; (fits, levels), levels in steps of the prior.

    Tables with the same levels share one grid: counts times logarithms of probabilities is one
    product of matrices. Where the likelihood is too narrow for it, a table gets grids of its own,
    ever narrower.
    """
    found: dict[int, Surface] = {}
    for part, batch in _batches((u, detected, presented), rulers, guesses, nodes):
        some, doubtful = batch.surfaces()
        for i, row in enumerate(part):
            again = doubtful[i] and nodes is STANDARD
            found[int(row)] = _zoomed(batch, i)[1] if again else some[i]
    return [found[i] for i in range(len(u))]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rates:
    """The likelihood of one table, and what it tells of guesses and lapses at each mu and sigma.

    `sums` are over the nodes of gamma and lambda, with r = 1 - gamma - lambda: of the likelihood,
    and of it times gamma, r, gamma^2, gamma r and r^2; shape (6, mu, log sigma).
    """

    mu: Floats
    log_sigma: Floats
    sums: Floats


def rates_of(table: tuple[Floats, Floats, Floats], *, ruler: Ruler, guess: GuessRate) -> Rates:
    """Return them of levels in steps of the prior, detected and presented, shape (levels,) each."""
    ((_, batch),) = _batches([one[None] for one in table], [ruler], [guess], STANDARD)
    if batch.surfaces()[1][0]:
        batch, _ = _zoomed(batch, 0)
    axes = batch.axes
    gamma, lapse = (np.ravel(one) for one in np.meshgrid(axes.guess, axes.lapse, indexing="ij"))
    rest, weight = 1 - gamma - lapse, np.outer(batch.guess_weight[0], axes.lapse_weight).ravel()
    factors = [np.ones_like(rest), gamma, rest, gamma**2, gamma * rest, rest**2]
    sums = (np.stack(factors) * weight) @ np.exp(batch.log[0])
    return Rates(
        mu=axes.mu,
        log_sigma=axes.log_sigma,
        sums=sums.reshape(len(factors), len(axes.mu), len(axes.log_sigma)),
    )


def _batches(
    tables: Sequence[Floats], rulers: Sequence[Ruler], guesses: Sequence[GuessRate], nodes: Nodes
) -> Iterator[tuple[NDArray[np.intp], _Batch]]:
    """Yield tables that have their grid in common, by their rows."""
    u, detected, presented = tables
    for (levels, ruler, rates), rows in _alike(u, presented, rulers, guesses).items():
        used = presented[rows[0]] > 0
        laid_out = _laid_out(levels, ruler, rates, nodes)
        pieces = min(len(rows), -(-len(rows) * laid_out[1].shape[1] // _CHUNK_CELLS))
        for part in np.array_split(rows, pieces):
            counts = detected[np.ix_(part, used)], presented[np.ix_(part, used)]
            asked = _Asked(levels, ruler, [guesses[row] for row in part])
            yield part, _Batch.of(asked, counts, laid_out)


def _alike(
    u: Floats, presented: Floats, rulers: Sequence[Ruler], guesses: Sequence[GuessRate]
) -> dict[tuple[tuple[float, ...], Ruler, tuple[float, ...]], list[int]]:
    """Find the rows of tables that have levels, ruler and nodes of the guess rate in common."""
    groups: dict[tuple[tuple[float, ...], Ruler, tuple[float, ...]], list[int]] = {}
    for i in range(len(u)):
        n = presented[i, presented[i] > 0]
        # About so many stimuli tell as much of guesses as so many blanks: those of a level.
        rates = guesses[i].nodes(max(n.max(initial=0.0), n.sum() / _LEVELS))
        groups.setdefault((tuple(u[i, presented[i] > 0].tolist()), rulers[i], rates), []).append(i)
    return groups


@lru_cache(maxsize=6)
def _laid_out(
    u: tuple[float, ...], ruler: Ruler, rates: tuple[float, ...], nodes: Nodes
) -> tuple[Axes, Floats]:
    """Return the grid of levels: people, groups and conditions of a study ask for it in turn."""
    axes = over_prior(ruler, np.array(rates), nodes)
    return axes, _logarithms(np.array(u), axes)


def _zoomed(batch: _Batch, i: int) -> tuple[_Batch, Surface]:
    """Return one table on axes that hold no more than what matters, and its likelihood there.

    The part that matters, with a node around, is laid out anew until it fills its axes.
    """
    guess = batch.asked.guesses[i]
    asked = replace(batch.asked, guesses=[guess])
    k, n = batch.k[i : i + 1], batch.n[i : i + 1]
    # No node of a grid that is too coarse need lie near the likeliest point.
    likeliest = fit_lapsing(
        Tables(u=np.array([asked.u]), detected=k, presented=n, guess_rate=np.array([guess.mean])),
        batch.starts(i)[:1],
    )[0]
    one = replace(batch, log=batch.log[i : i + 1], guess_weight=batch.guess_weight[i : i + 1])
    ends: tuple[Floats, ...] = ()
    heat = max(float(n.sum()) / _AT_ONCE, 1.0)
    for _ in range(_ZOOMS):
        box = _around(_box(one, _MATTERS * heat), likeliest, one.axes)
        settled = (
            bool(ends)
            and heat == 1
            and not any(
                np.ptp(new) < _SETTLED * np.ptp(old) for new, old in zip(box, ends, strict=True)
            )
        )
        ends, heat = box, max(heat / _COOLING, 1.0)
        axes = within(box, guess, _FINEST if settled else _ZOOMED)
        one = _Batch.of(asked, (k, n), (axes, _logarithms(np.array(asked.u), axes)))
        (surface,), doubtful = one.surfaces()
        if settled or (heat == 1 and not doubtful[0]):
            break
    return one, surface


def _box(one: _Batch, matters: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the ends of what matters to a table in mu, log sigma, lambda and gamma."""
    every = (one.axes.guess, one.axes.lapse, one.axes.mu, one.axes.log_sigma)
    # Beta's own density counts: a guess rate may be told by the blanks more than by the table.
    weight = np.maximum(one.guess_weight[0] / one.guess_weight.max(), _TINY)
    cells = one.log.reshape([len(axis) for axis in every]) + np.log(weight)[:, None, None, None]
    near = cells > cells.max() - matters
    limits = ((0.0, 1.0), (0.0, MOST_LAPSES), *((axis[0], axis[-1]) for axis in every[2:]))
    ends = []
    for i, (axis, limit) in enumerate(zip(every, limits, strict=True)):
        where = np.flatnonzero(near.any(axis=tuple(j for j in range(4) if j != i)))
        padded = np.concatenate([limit[:1], axis, limit[1:]])
        ends.append(padded[[where[0], where[-1] + 2]])
    return ends[2], ends[3], ends[1], ends[0]


def _around(
    box: tuple[Floats, Floats, Floats, Floats], point: Floats, axes: Axes
) -> tuple[Floats, Floats, Floats, Floats]:
    """Let a box in mu, log sigma and lambda hold a point, with some of its own width around."""
    held = []
    for (low, high), at, limits in zip(
        box, point, ((axes.mu[0], axes.mu[-1]), LOG_SIGMA, (0.0, MOST_LAPSES)), strict=False
    ):
        room = _ROOM * (high - low)
        held.append(
            np.array([max(min(low, at - room), limits[0]), min(max(high, at + room), limits[1])])
        )
    return held[0], held[1], held[2], box[3]


def _logarithms(u: Floats, axes: Axes) -> Floats:
    """Return log p and log(1 - p) at every level and node, shape (2 levels, nodes).

    p = gamma + (1 - gamma - lambda) Phi(z), 1 - p = lambda + (1 - gamma - lambda) Phi(-z).
    """
    z = (u[:, None, None] - axes.mu[:, None]) * np.exp(-axes.log_sigma)
    gamma, lapse = axes.guess[:, None, None, None], axes.lapse[:, None, None]
    rest = 1 - gamma - lapse
    both = np.empty((2, len(u), *np.broadcast_shapes(rest.shape, z.shape[1:])))
    for i, (least, at) in enumerate(((gamma, z), (lapse, -z))):
        np.multiply(rest, ndtr(at)[:, None, None], out=both[i])
        both[i] += least
    both[:, :, rest[:, :, 0, 0] < 0] = 0.0
    values: NDArray[np.float64] = np.log(np.maximum(both, _TINY, out=both), out=both).reshape(
        2 * len(u), -1
    )
    return values


@dataclass(frozen=True, slots=True)
class _Asked:
    """What tables have in common, levels and ruler, and the guess rate of each."""

    u: tuple[float, ...]
    ruler: Ruler
    guesses: Sequence[GuessRate]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Batch:
    """Tables on common axes, and their log likelihood, greatest 0.

    Shape (fits, gamma x lambda, mu x log sigma).
    """

    asked: _Asked
    k: Floats
    n: Floats
    axes: Axes
    log: Floats
    guess_weight: Floats  # (fits, gamma)

    @classmethod
    def of(
        cls, asked: _Asked, counts: tuple[Floats, Floats], laid_out: tuple[Axes, Floats]
    ) -> _Batch:
        """Evaluate counts, detected and presented: log likelihood is counts times logarithms."""
        (k, n), (axes, tables) = counts, laid_out
        log = np.concatenate([k, n - k], axis=1) @ tables
        log -= log.max(axis=1, keepdims=True)
        log = log.reshape(len(k), len(axes.guess) * len(axes.lapse), -1)
        density = np.array([one.log_density(axes.guess) for one in asked.guesses])
        weight = axes.guess_weight * np.exp(density - density.max(axis=1, keepdims=True))
        return cls(asked=asked, k=k, n=n, axes=axes, log=log, guess_weight=weight)

    def starts(self, i: int) -> Floats:
        """Return a table's likeliest nodes: mu, log sigma, lambda, the likeliest first.

        At its mean guess rate, as at another one another function may be by far the likeliest: with
        one high enough to account for weak levels, a step above them. One of each third of sigma,
        as steep and flat functions may be likely and those between not.
        """
        axes = self.axes
        near = int(np.abs(axes.guess - self.asked.guesses[i].mean).argmin())
        shape = [len(one) for one in (axes.guess, axes.lapse, axes.mu, axes.log_sigma)]
        thirds = np.array_split(self.log[i].reshape(shape)[near], STARTS, axis=2)
        firsts = np.cumsum([0, *(one.shape[2] for one in thirds)])
        found = []
        for third, first in zip(thirds, firsts, strict=False):
            lapse, mu, sigma = np.unravel_index(int(third.argmax()), third.shape)
            node = (axes.mu[mu], axes.log_sigma[first + sigma], axes.lapse[lapse])
            found.append((float(third.max()), node))
        found.sort(key=lambda one: -one[0])
        return np.array([node for _, node in found])

    def surfaces(self) -> tuple[list[Surface], NDArray[np.bool_]]:
        """Return each table's likelihood over mu and log sigma, and whether it is too narrow."""
        axes = self.axes
        cells = np.exp(self.log)
        of_kind = kinds(axes.lapse) * axes.lapse_weight
        weight = self.guess_weight[:, None, :, None] * of_kind[:, None]
        weight = weight.reshape(len(cells), len(of_kind), -1)
        shape = (len(cells), len(of_kind), len(axes.mu), len(axes.log_sigma))
        by_kind = (weight @ cells).reshape(shape)
        values = by_kind.sum(axis=1)
        mu = trapezoid(axes.mu) * self.asked.ruler.mu_prior(axes.mu)
        sigma = in_sigma(axes.log_sigma)
        each = weight * (cells @ np.outer(mu, sigma).ravel())[:, None]
        of_lapse = each.reshape(*each.shape[:2], len(axes.guess), -1).sum(axis=2)
        of_lapse /= of_lapse.sum(axis=2, keepdims=True)
        mean, square = (of_lapse @ one for one in (axes.lapse, axes.lapse**2))
        lapse_by_kind = np.stack([mean, np.maximum(square - mean**2, 0.0)], axis=1)
        shares = each.sum(axis=1)
        shares /= shares.sum(axis=1, keepdims=True)
        shares = shares.reshape(-1, len(axes.guess), len(axes.lapse))
        lapse_rate, of_guess = shares.sum(axis=1) @ axes.lapse, shares.sum(axis=2)
        guess_rate, square = of_guess @ axes.guess, of_guess @ axes.guess**2
        top = values.max(axis=(1, 2), keepdims=True)
        by_kind /= top[:, None]
        found = [
            Surface(
                mu=axes.mu,
                log_sigma=axes.log_sigma,
                by_kind=one,
                lapse_rate=float(lapse_rate[i]),
                guess_rate=float(guess_rate[i]),
                guess_variance=max(float(square[i] - guess_rate[i] ** 2), 0.0),
                lapse_by_kind=lapse_by_kind[i],
                starts=self.starts(i),
            )
            for i, one in enumerate(by_kind)
        ]
        return found, self._doubtful(values / top, shares)

    def _doubtful(self, values: Floats, shares: Floats) -> NDArray[np.bool_]:
        """Tell where half of the nodes tell something else, or one node has nearly everything."""
        axes = self.axes
        full, half = (
            quantiles(
                (values[:, ::every, ::every] @ in_sigma(axes.log_sigma[::every]))
                * self.asked.ruler.mu_prior(axes.mu[::every]),
                axes.mu[::every],
            )
            for every in (1, 2)
        )
        alone = shares.sum(axis=1).max(axis=1) > _ALONE
        if len(axes.guess) > 1:
            alone |= unresolved(shares.sum(axis=2), np.arcsin(np.sqrt(axes.guess)))
        # What lies outside the levels is never printed.
        low, high = self.asked.ruler.low, self.asked.ruler.high
        apart = np.abs(np.clip(full, low, high) - np.clip(half, low, high)).max(axis=1)
        missed = values[:, ::2, ::2].max(axis=(1, 2)) < _SEEN
        return np.asarray((apart > _CLOSE) | missed | alone)
