"""Likelihoods of psychometric functions over mu and log sigma: one grid for many tables.

Thresholds of people, groups, differences and bands all start from these. The log likelihood at all
nodes is one product of matrices, counts times log probabilities. It is accumulated over blocks of
levels, so that memory does not grow with the number of different levels. Guess and lapse rates are
integrated out. Where a likelihood is too narrow for the common nodes, its table gets nodes of its
own, in a few steps from wide to narrow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Final, get_args

import numpy as np

from analysis.axis import LARGEST, XScale
from analysis.thresholds.function import (
    LOG_SIGMA,
    MAX_LAPSE,
    REACH,
    FunctionName,
    Prior,
    lapse_classes,
    lapse_nodes,
    legendre,
    rise,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from analysis.thresholds.guess import GuessRate

    Floats = NDArray[np.float64]
    Ends = tuple[float, float]

POINTS: Final = (0.025, 0.5, 0.975)
TINY: Final = 1e-300
MAX_PRESENTED: Final = 10**12
_LOG_RANGE: Final = 15.0
"""Nodes whose log likelihood lies farther below the greatest contribute nothing."""
_FULL_HEAT_TRIALS: Final = 400.0
"""Trials up to which some node of the common grid lies near the peak. The likelihood of more trials
is first flattened by their ratio to this number, then `_COOLING` times less at each step."""
_COOLING: Final = 16.0
_MAX_STEPS: Final = 40
_MAX_BLOCK: Final = 4_000_000
"""Numbers in one block of log likelihoods or log probabilities, 32 MB."""
_MAX_CACHED: Final = 2_000_000
_MAX_LEVELS: Final = 64
_BIN: Final = 0.1
"""Steps. Counts at more than `_MAX_LEVELS` levels are spread over levels that lie so far apart."""
_MAX_GUESS_NODES: Final = 32
_GUESS_LOG_RANGE: Final = 16.0
_PEAK: Final = math.exp(-2.0)
_MIN_PEAK_NODES: Final = (5, 3)
"""Nodes of mu and of log sigma within two standard deviations of the peak."""
_MAX_SHARE: Final = 0.75
"""Of the posterior at one node of gamma or lambda."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nodes:
    """How many nodes a grid has in each direction."""

    between: int = 61  # of mu between the levels
    outside: int = 14  # of mu on either side of them, ever farther apart
    log_sigma: int = 25
    lapse: int = 6
    guess: int = 12  # in a narrow box; over the whole prior as many as the blank trials require


STANDARD: Final = Nodes()
_NARROW: Final = Nodes(outside=0, lapse=10)
_FLOOR: Final = 1e-6
_ROOM: Final = 0.25
"""Of its length, by which an axis grows at an end where the likelihood goes on."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tables:
    """Counts at levels on the axis, (tables, levels); an unused place has 0 presented."""

    x: Floats
    detected: Floats
    presented: Floats
    guesses: Sequence[GuessRate]
    x_scale: XScale = "log10"
    function: FunctionName = "normal"
    step: float | None = None
    """A step of the prior on the axis, where more levels than these make it."""

    def __len__(self) -> int:
        return len(self.x)

    def at(self, rows: Sequence[int]) -> Tables:
        """Return some of the tables."""
        chosen = list(rows)
        x, k, n = (values[chosen] for values in self.counts)
        guesses, step = [self.guesses[i] for i in chosen], self.prior.step
        return replace(self, x=x, detected=k, presented=n, guesses=guesses, step=step)

    def joined(self, more: Tables) -> Tables:
        """Return these and more tables, on one axis."""
        width = max(self.x.shape[1], more.x.shape[1])
        x, k, n = (
            np.concatenate([np.pad(table, ((0, 0), (0, width - table.shape[1]))) for table in pair])
            for pair in zip(self.counts, more.counts, strict=True)
        )
        return replace(self, x=x, detected=k, presented=n, guesses=[*self.guesses, *more.guesses])

    @property
    def counts(self) -> tuple[Floats, Floats, Floats]:
        """Levels, detected and presented."""
        return self.x, self.detected, self.presented

    @property
    def prior(self) -> Prior:
        """The prior that goes with the levels of all tables."""
        return Prior.of(self.x[self.presented > 0], self.x_scale, self.step)

    def priors(self) -> list[Prior]:
        """Return the prior that goes with the levels of each table, in steps of all."""
        used, step = self.presented > 0, self.prior.step
        ends = np.stack(
            [
                np.where(used, self.x, np.inf).min(axis=1),
                np.where(used, self.x, -np.inf).max(axis=1),
            ],
            axis=1,
        )
        by_ends = {
            key: Prior.of(np.array(key), self.x_scale, step) for key in set(map(tuple, ends))
        }
        return [by_ends[tuple(key)] for key in ends]

    def several_levels(self) -> NDArray[np.bool_]:
        """Return which tables have more than one level."""
        used = self.presented > 0
        low = np.where(used, self.x, np.inf).min(axis=1)
        return np.asarray(np.where(used, self.x, -np.inf).max(axis=1) > low)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Likelihood:
    """The likelihood of one table over mu and log sigma in steps, gamma and lambda integrated out.

    `gamma` and `lapse` are posterior means and variances. `node` is the likeliest node of mu, log
    sigma and lambda at the mean guess rate.
    """

    mu: Floats
    log_sigma: Floats
    by_class: Floats  # times the prior of each of `lapse_classes`, (3, mu, log sigma)
    gamma: tuple[float, float]
    lapse: tuple[float, float]
    node: tuple[float, float, float]

    @property
    def values(self) -> Floats:
        """The likelihood of all classes together, (mu, log sigma), greatest 1."""
        return np.asarray(self.by_class.sum(axis=0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Axes:
    """Nodes along each parameter. Sums over gamma and lambda need their weights."""

    mu: Floats
    log_sigma: Floats
    lapse: Floats
    lapse_weight: Floats
    gamma: Floats
    gamma_weight: Floats  # of the angle arcsin(sqrt(gamma)); its density comes beside

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Numbers of nodes of gamma, lambda, mu and log sigma."""
        return len(self.gamma), len(self.lapse), len(self.mu), len(self.log_sigma)


def trapezoid(axis: Floats) -> Floats:
    """Return the weights of the trapezoidal rule.

    >>> trapezoid(np.array([0.0, 1.0, 3.0])).tolist()
    [0.5, 1.5, 1.0]
    """
    half = np.diff(axis) / 2
    return np.asarray(np.append(half, 0.0) + np.append(0.0, half))


def quantiles(density: Floats, axis: Floats, points: Sequence[float] = POINTS) -> Floats:
    """Return quantiles of densities, (..., nodes), that are log-linear between the nodes.

    >>> x = np.linspace(-8, 8, 41)
    >>> quantiles(np.exp(-x * x / 2), x).round(2).tolist()
    [-1.96, 0.0, 1.96]
    """
    rows = np.atleast_2d(density)
    rows = np.maximum(rows / np.maximum(rows.max(axis=1, keepdims=True), TINY), TINY)
    log = np.log(rows)
    ratio = np.diff(log, axis=1)
    ratio = np.where(np.abs(ratio) < 1e-9, 1e-9, ratio)  # noqa: PLR2004 - nearly a rectangle
    mass = np.diff(axis) * rows[:, :-1] * np.expm1(ratio) / ratio
    below = np.concatenate([np.zeros((len(rows), 1)), np.cumsum(mass, axis=1)], axis=1)
    wanted = below[:, -1:] * np.asarray(points)
    cell = (below[:, None, 1:-1] <= wanted[:, :, None]).sum(axis=2)
    before, inside, steep = (
        np.take_along_axis(values, cell, axis=1) for values in (below, mass, ratio)
    )
    share = np.clip((wanted - before) / np.maximum(inside, TINY), 0.0, 1.0)
    at = axis[cell] + np.diff(axis)[cell] * np.log1p(share * np.expm1(steep)) / steep
    return np.asarray(at.reshape((*np.shape(density)[:-1], len(points))))


def range_of(axis: Floats, margin: Floats, least: float = 1e-5) -> tuple[float, float]:
    """Return the ends of what is at least a share of the greatest, with a node around."""
    near = np.flatnonzero(margin > least * margin.max())
    return float(axis[max(near[0] - 1, 0)]), float(axis[min(near[-1] + 1, len(axis) - 1)])


def likelihoods(tables: Tables, nodes: Nodes = STANDARD) -> list[Likelihood]:
    """Return the likelihood of each table, in steps of the prior of all tables."""
    every = tables.priors()
    axes = _common_axes(tables.prior, _guess_nodes(tables), nodes)
    size = max(_MAX_BLOCK // math.prod(axes.shape), 1)
    result: list[Likelihood] = []
    for start in range(0, len(tables), size):
        rows = range(start, min(start + size, len(tables)))
        counts = [_binned_counts(tables, i) for i in rows]
        levels, k, n = _side_by_side(counts)
        log = _log_likelihoods(levels, k, n, axes, tables.function, shared=True)
        guesses = [tables.guesses[i] for i in rows]
        priors = every[start : start + size]
        batch, narrow = _integrated(log, axes, guesses, priors)
        if nodes is STANDARD:
            for i in np.flatnonzero(narrow):
                narrow_axes, likelihood = _narrow_axes(tables, rows[i], axes, log[i])
                batch[i] = _integrated(likelihood, narrow_axes, [guesses[i]], [priors[i]])[0][0]
                # Values count as constant beyond the ends of an axis, where much of a wide prior
                # may lie.
                batch[i].by_class[batch[i].by_class < _FLOOR] = 0.0
        result += batch
    return result


def posteriors(people: Sequence[Likelihood], priors: Sequence[Prior]) -> tuple[Floats, Floats]:
    """Return the points `POINTS` of mu and of log sigma of many tables, (tables, 3) each."""
    mu, log_sigma = np.empty((2, len(people), len(POINTS)))
    together: dict[object, list[int]] = {}
    for row, (likelihood, prior) in enumerate(zip(people, priors, strict=True)):
        together.setdefault((id(likelihood.mu), prior), []).append(row)
    for rows in together.values():
        axes, prior = people[rows[0]], priors[rows[0]]
        values = np.stack([people[row].values for row in rows])
        of_mu, of_sigma = prior.mu(axes.mu), prior.sigma(axes.log_sigma)
        mu[rows] = quantiles((values @ (trapezoid(axes.log_sigma) * of_sigma)) * of_mu, axes.mu)
        log_sigma[rows] = quantiles(
            ((trapezoid(axes.mu) * of_mu) @ values) * of_sigma, axes.log_sigma
        )
    return mu, log_sigma


def cells_of(tables: Tables, row: int) -> tuple[Axes, Floats, float]:
    """Return the axes of one table, its posterior at each cell, and a step of these on the axis.

    Cells are (gamma, lambda, mu, log sigma).
    """
    table = replace(tables.at([row]), step=None)
    prior, axes = table.prior, _common_axes(table.prior, _guess_nodes(table), STANDARD)
    counts = _side_by_side([_binned_counts(table, 0)])
    log = _log_likelihoods(*counts, axes, table.function, shared=False)
    if _integrated(log, axes, table.guesses, [prior])[1][0]:
        axes, log = _narrow_axes(table, 0, axes, log[0])
    weight = _guess_weight(axes, table.guesses)[0]
    weights = (
        weight,
        axes.lapse_weight,
        trapezoid(axes.mu) * prior.mu(axes.mu),
        trapezoid(axes.log_sigma) * prior.sigma(axes.log_sigma),
    )
    cells = np.exp(log[0].reshape(axes.shape))
    return axes, np.einsum("glms,g,l,m,s->glms", cells, *weights), prior.step


def checked_levels(levels: NDArray[np.generic], x_scale: XScale, name: str = "levels") -> Floats:
    """Return levels on the axis; raise a ValueError unless they can lie there."""
    if levels.size and levels.dtype.kind not in "iuf":
        raise ValueError(f"{name} must be finite numbers; got {levels.tolist()!r}")
    x = levels.astype(np.float64)
    if not (np.abs(x) <= LARGEST).all():
        wrong = x[~(np.abs(x) <= LARGEST)].tolist()
        raise ValueError(f"{name} must be finite and at most {LARGEST:g}; got {wrong}")
    if x_scale not in get_args(XScale):
        raise ValueError(f"x_scale must be one of log10, linear; got {x_scale!r}")
    if x_scale == "log10" and (x <= 0).any():
        raise ValueError(
            f"{name} must be above 0 on the axis log10; got {x[x <= 0].tolist()}: use "
            'x_scale="linear"'
        )
    return np.log10(x) if x_scale == "log10" else x


def checked_table(
    levels: ArrayLike, detected: ArrayLike, presented: ArrayLike, name: str = "levels"
) -> tuple[Floats, Floats, Floats]:
    """Check one table, drop levels without a stimulus, pool equal ones, and sort it."""
    from analysis.counts.intervals import checked_counts

    k, n = checked_counts(detected, presented)
    x = checked_levels(np.asarray(levels), "linear", name)
    if x.ndim != 1 or x.shape != k.shape or k.shape != n.shape:
        raise ValueError(
            f"{name}, detected and presented must be lists of one length; got the shapes "
            f"{x.shape}, {k.shape}, {n.shape}"
        )
    if (n > MAX_PRESENTED).any():
        raise ValueError(f"presented must be at most {MAX_PRESENTED:.0e}; got {n.max():g}")
    if not (n > 0).any():
        raise ValueError("presented must hold at least one stimulus; got none")
    return pooled(x[n > 0], k[n > 0], n[n > 0])


def pooled(x: Floats, detected: Floats, presented: Floats) -> tuple[Floats, Floats, Floats]:
    """Return different levels in order, with the sums of their counts."""
    if (np.diff(x) > 0).all():
        return x, detected, presented
    at, index = np.unique(x, return_inverse=True)
    k, n = (
        np.bincount(index.ravel(), count, len(at)).astype(np.float64)
        for count in (detected, presented)
    )
    return at, k, n


def binned(u: Floats, k: Floats, n: Floats) -> tuple[Floats, Floats, Floats]:
    """Spread counts at many levels over few, each over its two neighbours, and pool equal levels.

    Log likelihoods are thereby interpolated between levels that lie 0.1 dB apart.
    """
    u, k, n = pooled(u, k, n)
    if len(u) <= _MAX_LEVELS:
        return u, k, n
    below = np.floor(u / _BIN)
    share = u / _BIN - below
    return pooled(
        np.concatenate([below, below + 1]) * _BIN,
        np.concatenate([k * (1 - share), k * share]),
        np.concatenate([n * (1 - share), n * share]),
    )


def _binned_counts(tables: Tables, row: int) -> tuple[Floats, Floats, Floats]:
    """Return the levels of a table in steps, and its counts there."""
    used = tables.presented[row] > 0
    u = tables.x[row, used] / tables.prior.step
    return binned(u, tables.detected[row, used], tables.presented[row, used])


def _side_by_side(
    counts: Sequence[tuple[Floats, Floats, Floats]],
) -> tuple[Floats, Floats, Floats]:
    """Return all levels of some tables, and their detected and presented, (tables, levels)."""
    levels = np.unique(np.concatenate([u for u, _, _ in counts]))
    k, n = np.zeros((2, len(counts), len(levels)))
    for row, (u, detected, presented) in enumerate(counts):
        index = np.searchsorted(levels, u)
        k[row, index], n[row, index] = detected, presented
    return levels, k, n


def _guess_nodes(tables: Tables) -> tuple[float, ...]:
    """Return rates over which the likelihoods of all tables are summed.

    They are midpoints of equal steps of the angle arcsin(sqrt(gamma)); sums over these converge
    exponentially. A step is 1.6 standard deviations of the posterior at most, up to a number of
    nodes; beyond that a table gets nodes of its own.
    """
    if all(guess.beta is None for guess in tables.guesses):
        rates = {guess.mean for guess in tables.guesses}
        if len(rates) == 1:
            return tuple(rates)
    trials = float(tables.presented.max(initial=0.0))
    total = trials + max(sum(guess.beta or (0.5, 0.5)) for guess in tables.guesses)
    number = min(8 * math.ceil(2 * math.sqrt(total) / 8), _MAX_GUESS_NODES)
    gamma = np.sin((np.arange(number) + 0.5) * (math.pi / 2 / number)) ** 2
    near = np.zeros(number, dtype=bool)
    for beta in {guess.beta for guess in tables.guesses if guess.beta is not None}:
        log = np.asarray((beta[0] - 0.5) * np.log(gamma) + (beta[1] - 0.5) * np.log1p(-gamma))
        near |= log > log.max() - _GUESS_LOG_RANGE
    known_rates = {guess.mean for guess in tables.guesses if guess.beta is None}
    return tuple(sorted({*gamma[near].tolist(), *known_rates}))


@lru_cache(maxsize=8)
def _common_axes(prior: Prior, gamma: tuple[float, ...], nodes: Nodes) -> Axes:
    """Return nodes over all that the priors allow."""
    # Around one level, or levels next to each other, the nodes reach a step to either side.
    middle, half = (prior.low + prior.high) / 2, max((prior.high - prior.low) / 2, 1.0)
    between = np.linspace(middle - half, middle + half, nodes.between)
    steps = 20 ** (np.arange(nodes.outside) / max(nodes.outside - 1, 1))
    outside = REACH * np.cumsum(steps) / steps.sum()
    lapse, lapse_weight = lapse_nodes(0.0, MAX_LAPSE, nodes.lapse)
    return Axes(
        mu=np.concatenate([between[0] - outside[::-1], between, between[-1] + outside]),
        log_sigma=np.linspace(*LOG_SIGMA, nodes.log_sigma),
        lapse=lapse,
        lapse_weight=lapse_weight,
        gamma=np.array(gamma),
        gamma_weight=np.ones(len(gamma)),
    )


def log_probabilities(levels: tuple[float, ...], axes: Axes, function: FunctionName) -> Floats:
    """Return log p and log(1 - p) at levels and nodes, (2 levels, nodes)."""
    z = (np.array(levels)[:, None, None] - axes.mu[:, None]) * np.exp(-axes.log_sigma)
    gamma, lapse = axes.gamma[:, None, None, None], axes.lapse[:, None, None]
    rest = np.maximum(1 - gamma - lapse, 0.0)
    both = np.empty((2, len(levels), *axes.shape))
    for values, floor, share in zip(both, (gamma, lapse), rise(function, z), strict=True):
        np.multiply(rest, share[:, None, None], out=values)
        np.add(values, floor, out=values)
    np.log(np.maximum(both, TINY, out=both), out=both)
    return both.reshape(2 * len(levels), -1)


_cached_log_probabilities = lru_cache(maxsize=2)(log_probabilities)
"""People, groups and simulated studies use the same few levels in turn."""


def _log_likelihoods(
    levels: Floats, k: Floats, n: Floats, axes: Axes, function: FunctionName, *, shared: bool
) -> Floats:
    """Return log likelihoods, greatest 0: (tables, gamma x lambda, mu x log sigma)."""
    cells = math.prod(axes.shape)
    block = max(_MAX_BLOCK // (2 * cells), 1)
    cached = shared and 2 * len(levels) * cells <= _MAX_CACHED
    probabilities = _cached_log_probabilities if cached else log_probabilities
    log = np.zeros((len(k), cells))
    for start in range(0, len(levels), block):
        some = slice(start, start + block)
        counts = np.concatenate([k[:, some], n[:, some] - k[:, some]], axis=1)
        log += counts @ probabilities(tuple(levels[some].tolist()), axes, function)
    log -= log.max(axis=1, keepdims=True)
    return log.reshape(len(k), len(axes.gamma) * len(axes.lapse), -1)


def _guess_weight(axes: Axes, guesses: Sequence[GuessRate]) -> Floats:
    """Return the weight of each node of gamma, (tables, gamma), greatest 1."""
    log = np.full((len(guesses), len(axes.gamma)), -np.inf)
    for row, guess in zip(log, guesses, strict=True):
        if guess.beta is None:
            row[int(np.abs(axes.gamma - guess.mean).argmin())] = 0.0
        else:
            row[:] = guess.log_density(axes.gamma)
    return np.asarray(axes.gamma_weight * np.exp(log - log.max(axis=1, keepdims=True)))


def _integrated(
    log: Floats, axes: Axes, guesses: Sequence[GuessRate], priors: Sequence[Prior]
) -> tuple[list[Likelihood], NDArray[np.bool_]]:
    """Integrate gamma and lambda out, and mark likelihoods that are too narrow for the nodes."""
    tables, (n_gamma, n_lapse, n_mu, n_sigma) = len(log), axes.shape
    weight = _guess_weight(axes, guesses)
    weights = (weight[:, :, None] * axes.lapse_weight).reshape(tables, 1, -1)
    likeliest = np.array([int(np.abs(axes.gamma - guess.mean).argmin()) for guess in guesses])
    by_gamma = log.reshape(tables, n_gamma, -1)
    best = by_gamma[np.arange(tables), likeliest].argmax(axis=1)
    cells = np.exp(log)
    classes = lapse_classes(axes.lapse)[:, None] * weights.reshape(tables, 1, n_gamma, n_lapse)
    by_class = (classes.reshape(tables, 3, -1) @ cells).reshape(tables, 3, n_mu, n_sigma)
    by_class /= by_class.sum(axis=1).max(axis=(1, 2))[:, None, None, None]
    values = by_class.sum(axis=1)
    mu, sigma = trapezoid(axes.mu), trapezoid(axes.log_sigma)
    of_prior = {
        prior: np.outer(mu * prior.mu(axes.mu), sigma * prior.sigma(axes.log_sigma)).ravel()
        for prior in set(priors)
    }
    shares = cells @ np.stack([of_prior[prior] for prior in priors])[:, :, None]
    shares = (shares[:, :, 0] * weights[:, 0]).reshape(tables, n_gamma, n_lapse)
    shares /= shares.sum(axis=(1, 2), keepdims=True)
    moments = [
        np.stack([share @ axis, np.maximum(share @ axis**2 - (share @ axis) ** 2, 0.0)], axis=1)
        for share, axis in ((shares.sum(axis=2), axes.gamma), (shares.sum(axis=1), axes.lapse))
    ]
    index = np.unravel_index(best, (n_lapse, n_mu, n_sigma))
    node = np.stack([axes.mu[index[1]], axes.log_sigma[index[2]], axes.lapse[index[0]]], axis=1)
    likelihood = [
        Likelihood(
            mu=axes.mu,
            log_sigma=axes.log_sigma,
            by_class=by_class[i],
            gamma=tuple(moments[0][i].tolist()) if guess.beta else (guess.mean, 0.0),
            lapse=tuple(moments[1][i].tolist()),
            node=tuple(node[i].tolist()),
        )
        for i, guess in enumerate(guesses)
    ]
    narrow = shares.sum(axis=1).max(axis=1) > _MAX_SHARE
    beta = np.array([guess.beta is not None for guess in guesses])
    narrow |= beta & (shares.sum(axis=2).max(axis=1) > _MAX_SHARE)
    for axis, least in zip((2, 1), _MIN_PEAK_NODES, strict=True):
        narrow |= (values.max(axis=axis) > _PEAK).sum(axis=1) < least
    return likelihood, np.asarray(narrow)


def _narrow_axes(tables: Tables, row: int, axes: Axes, log: Floats) -> tuple[Axes, Floats]:
    """Return axes that hold no more than what is likely of a table, and its log likelihood there.

    `log` is its log likelihood on wider axes.
    """
    levels, k, n = _side_by_side([_binned_counts(tables, row)])
    guess, prior, function = tables.guesses[row], tables.priors()[row], tables.function
    limits = ((0.0, 1.0), (0.0, MAX_LAPSE), _ends(axes.mu), _ends(axes.log_sigma))
    heat, narrow, log = max(float(n.sum()) / _FULL_HEAT_TRIALS, 1.0), True, log[None]
    for _ in range(_MAX_STEPS):
        box, cut = _likely_box(axes, log[0], guess, limits, _LOG_RANGE * heat)
        if heat == 1 and not (narrow or cut):
            break
        axes = _axes_in(box, guess)
        log = _log_likelihoods(levels, k, n, axes, function, shared=False)
        narrow = bool(_integrated(log, axes, [guess], [prior])[1][0])
        heat = max(heat / _COOLING, 1.0)
    return axes, log


def _likely_box(
    axes: Axes, log: Floats, guess: GuessRate, limits: Sequence[Ends], log_range: float
) -> tuple[list[Ends], bool]:
    """Return the ends, along each axis, of nodes within a range of the greatest log likelihood.

    A node around belongs to them. Where such nodes reach an end that is no limit of the parameter,
    the box grows beyond it, and is marked as cut.
    """
    weight = np.maximum(_guess_weight(axes, [guess])[0], TINY)
    cells = log.reshape(axes.shape) + np.log(weight)[:, None, None, None]
    near = cells > cells.max() - log_range
    box, cut = [], False
    every = (axes.gamma, axes.lapse, axes.mu, axes.log_sigma)
    for i, (axis, (least, most)) in enumerate(zip(every, limits, strict=True)):
        if len(axis) == 1:
            box.append(_ends(axis))
            continue
        at = np.flatnonzero(near.any(axis=tuple(j for j in range(4) if j != i)))
        room = max(float(np.ptp(axis)), TINY) * _ROOM
        low, high = (float(axis[max(at[0] - 1, 0)]), float(axis[min(at[-1] + 1, len(axis) - 1)]))
        if at[0] == 0:
            low, cut = max(axis[0] - room, least), cut or axis[0] - room / 4 > least
        if at[-1] == len(axis) - 1:
            high, cut = min(axis[-1] + room, most), cut or axis[-1] + room / 4 < most
        box.append((float(low), float(high)))
    return box, cut


def _axes_in(box: Sequence[Ends], guess: GuessRate) -> Axes:
    """Lay axes over a box of gamma, lambda, mu and log sigma."""
    lapse, lapse_weight = lapse_nodes(*box[1], _NARROW.lapse)
    gamma, gamma_weight = np.array([guess.mean]), np.ones(1)
    if guess.beta:
        at, gamma_weight = legendre(_NARROW.guess)
        first, last = np.arcsin(np.sqrt(box[0]))
        gamma = np.sin(first + at * (last - first)) ** 2
    return Axes(
        mu=np.linspace(*box[2], _NARROW.between),
        log_sigma=np.linspace(*box[3], _NARROW.log_sigma),
        lapse=lapse,
        lapse_weight=lapse_weight,
        gamma=gamma,
        gamma_weight=gamma_weight,
    )


def _ends(axis: Floats) -> Ends:
    return float(axis[0]), float(axis[-1])
