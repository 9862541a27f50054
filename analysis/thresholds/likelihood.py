"""Counts of participants, and the likelihoods of their psychometric functions on one grid.

A likelihood is over mu and log sigma. Thresholds of people, groups, differences and bands all start
from these. The log likelihood at all nodes is one product of matrices, counts times log
probabilities. It is accumulated over blocks of levels, so that memory does not grow with the number
of different levels. Guess and lapse rates are integrated out. Where a likelihood is too narrow for
the common nodes, its table gets nodes of its own, in a few steps from wide to narrow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.axis import VOLTS, Axis
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

    from numpy.typing import NDArray

    from analysis.thresholds.guess import GuessRate

    Floats = NDArray[np.float64]
    Ends = tuple[float, float]

POINTS: Final = (0.025, 0.5, 0.975)
TINY: Final = 1e-300
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
_MAX_GUESS_NODES: Final = 32
_GUESS_LOG_RANGE: Final = 16.0
_MAX_LEVELS: Final = 64
_BIN: Final = 0.1
"""Steps. Counts at more than `_MAX_LEVELS` levels are spread over levels that lie so far apart."""
_PEAK: Final = math.exp(-2.0)
_MIN_PEAK_NODES: Final = (5, 3)
"""Nodes of mu and of log sigma within two standard deviations of the peak."""
_MAX_SHARE: Final = 0.75
"""Of the posterior at one node of gamma or lambda."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tables:
    """What was presented to participants at each level, and what they detected: a row for each.

    Attributes
    ----------
    levels, detected, presented : ndarray of float64, shape (people, most levels of one)
        A place that is left over has 0 presented, at a level of 1.
    guesses : sequence of GuessRate
        The guess rate of each.
    names : tuple of tuple of str
        Condition and participant of each, where they have names; sorted.
    axis : Axis
        What the levels are.
    function : str
        The psychometric function.
    step : float or None
        A step of the prior on the axis, where more levels than these make it.
    """

    levels: Floats
    detected: Floats
    presented: Floats
    guesses: Sequence[GuessRate]
    names: tuple[tuple[str, str], ...] = ()
    axis: Axis = VOLTS
    function: FunctionName = "normal"
    step: float | None = None

    def __len__(self) -> int:
        return len(self.levels)

    def select(self, rows: Sequence[int]) -> Tables:
        """Return some of the tables, in steps of all."""
        chosen = list(rows)
        return replace(
            self,
            levels=self.levels[chosen],
            detected=self.detected[chosen],
            presented=self.presented[chosen],
            guesses=[self.guesses[i] for i in chosen],
            names=tuple(self.names[i] for i in chosen) if self.names else (),
            step=self.prior.step,
        )

    def at(self, rows: Sequence[int]) -> Tables:
        """Return some of the tables, in steps of all, with likelihoods that are computed once."""
        selected = self.select(rows)
        vars(selected)["likelihoods"] = [self.likelihoods[i] for i in rows]
        return selected

    @cached_property
    def conditions(self) -> dict[str, Tables]:
        """The tables of each condition, sorted by its name."""
        rows: dict[str, list[int]] = {}
        for i, (condition, _) in enumerate(self.names):
            rows.setdefault(condition, []).append(i)
        return {condition: self.at(rows[condition]) for condition in sorted(rows)}

    @cached_property
    def likelihoods(self) -> list[Likelihood]:
        """The likelihood of each table."""
        return likelihoods(self)

    @cached_property
    def x(self) -> Floats:
        """The levels on the axis."""
        return self.axis.on_axis(self.levels)

    @property
    def lapse_share(self) -> float:
        """The share of lapses that count as detected, which is that of the task."""
        return self.guesses[0].lapse_share if self.guesses else 0.0

    @property
    def tested(self) -> Floats:
        """The levels that were presented to anybody, in order."""
        return np.unique(self.levels[self.presented > 0])

    def counts(self, rows: int | slice = slice(None)) -> tuple[Floats, Floats, Floats]:
        """Return the levels of some tables in steps, with what was detected and presented there."""
        used = self.presented[rows] > 0
        u = self.x[rows][used] / self.prior.step
        return pooled(u, self.detected[rows][used], self.presented[rows][used])

    @cached_property
    def prior(self) -> Prior:
        """The prior that goes with the levels of all tables."""
        return Prior.of(self.x[self.presented > 0], self.axis, self.step)

    @cached_property
    def priors(self) -> list[Prior]:
        """The prior that goes with the levels of each table, in steps of all."""
        tables = zip(self.x, self.presented, strict=True)
        return [Prior.of(x[n > 0], self.axis, self.prior.step) for x, n in tables]

    def several_levels(self) -> NDArray[np.bool_]:
        """Return which tables have more than one level."""
        return np.array([prior.high > prior.low for prior in self.priors])


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
class Likelihood:
    """The likelihood of one table over mu and log sigma in steps, gamma and lambda integrated out.

    The others are of the posterior: the points `POINTS` of mu and of log sigma, means and variances
    of gamma and lambda, or of the rates that stand for them where lapses are either answer. `node`
    is the likeliest node of mu, log sigma and lambda at the mean guess rate.
    """

    mu: Floats
    log_sigma: Floats
    by_class: Floats  # times the prior of each of `lapse_classes`, (3, mu, log sigma)
    mu_points: Floats
    log_sigma_points: Floats
    gamma: tuple[float, float]
    lapse: tuple[float, float]
    node: Floats

    @property
    def values(self) -> Floats:
        """The likelihood of all classes together, (mu, log sigma), greatest 1."""
        return np.asarray(self.by_class.sum(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """Nodes along each parameter. Sums over gamma and lambda need their weights."""

    mu: Floats
    log_sigma: Floats
    lapse: Floats
    lapse_weight: Floats
    gamma: Floats
    gamma_weight: Floats  # of the angle arcsin(sqrt(gamma)), without its density

    @property
    def each(self) -> tuple[Floats, Floats, Floats, Floats]:
        """The nodes in the order of cells: gamma, lambda, mu and log sigma."""
        return self.gamma, self.lapse, self.mu, self.log_sigma

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of nodes of gamma, lambda, mu and log sigma."""
        return tuple(map(len, self.each))


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
    if not len(tables):
        return []
    axes = _common_axes(tables.prior, _guess_nodes(tables), nodes)
    size = max(_MAX_BLOCK // math.prod(axes.shape), 1)
    result: list[Likelihood] = []
    for start in range(0, len(tables), size):
        batch = tables.select(range(start, min(start + size, len(tables))))
        log = _log_likelihoods(batch, axes, shared=True)
        integrated, narrow = _integrated(log, axes, batch)
        for i in np.flatnonzero(narrow) if nodes is STANDARD else ():
            table = batch.select([i])
            narrow_axes, narrow_log = _narrow_axes(table, axes, log[i : i + 1])
            (integrated[i],), _ = _integrated(narrow_log, narrow_axes, table)
            # Values count as constant beyond the ends of an axis, where much of a wide prior may
            # lie.
            integrated[i].by_class[integrated[i].by_class < _FLOOR] = 0.0
        result += integrated
    return result


def cells_of(table: Tables) -> tuple[Axes, Floats, float]:
    """Return the axes of one table, its posterior at each cell, and a step of these on the axis.

    Cells are (gamma, lambda, mu, log sigma).
    """
    table = replace(table, step=None)
    axes = _common_axes(table.prior, _guess_nodes(table), STANDARD)
    log = _log_likelihoods(table, axes, shared=False)
    if _integrated(log, axes, table)[1][0]:
        axes, log = _narrow_axes(table, axes, log)
    cells = np.exp(log[0]).reshape(axes.shape)
    weights = _guess_weight(axes, table.guesses)[0], axes.lapse_weight, _prior_of(table.prior, axes)
    return axes, np.einsum("glms,g,l,ms->glms", cells, *weights), table.prior.step


def _guess_nodes(tables: Tables) -> tuple[float, ...]:
    """Return rates over which the likelihoods of all tables are summed.

    They are midpoints of equal steps of the angle arcsin(sqrt(gamma)); sums over these converge
    exponentially. A step is 1.6 standard deviations of the posterior at most, up to a number of
    nodes; beyond that a table gets nodes of its own.
    """
    fixed = {guess.mean for guess in tables.guesses if guess.beta is None}
    uncertain = {guess for guess in tables.guesses if guess.beta is not None}
    if len(fixed) == 1 and not uncertain:
        return tuple(fixed)
    total = float(tables.presented.max(initial=0.0))
    total += max((sum(guess.beta or ()) for guess in uncertain), default=1.0)
    number = min(8 * math.ceil(2 * math.sqrt(total) / 8), _MAX_GUESS_NODES)
    gamma = np.sin((np.arange(number) + 0.5) * (math.pi / 2 / number)) ** 2
    near = np.zeros(number, dtype=bool)
    for guess in uncertain:
        log = guess.log_density(gamma)
        near |= log > log.max() - _GUESS_LOG_RANGE
    return tuple(sorted({*gamma[near].tolist(), *fixed}))


@lru_cache(maxsize=8)
def _common_axes(prior: Prior, gamma: tuple[float, ...], nodes: Nodes) -> Axes:
    """Return nodes over all that the priors allow."""
    # Around one level, or levels next to each other, the nodes reach a step to either side.
    middle, half = (prior.low + prior.high) / 2, max((prior.high - prior.low) / 2, 1.0)
    between = np.linspace(middle - half, middle + half, nodes.between)
    steps = 20 ** (np.arange(nodes.outside) / max(nodes.outside - 1, 1))
    outside = REACH * np.cumsum(steps) / steps.sum()
    mu = np.concatenate([between[0] - outside[::-1], between, between[-1] + outside])
    lapses = lapse_nodes(0.0, MAX_LAPSE, nodes.lapse)
    log_sigma = np.linspace(*LOG_SIGMA, nodes.log_sigma)
    return Axes(mu, log_sigma, *lapses, np.array(gamma), np.ones(len(gamma)))


def log_probabilities(
    levels: tuple[float, ...], axes: Axes, function: FunctionName, lapse_share: float
) -> Floats:
    """Return log p and log(1 - p) at levels and nodes, (2 levels, nodes)."""
    z = (np.array(levels)[:, None, None] - axes.mu[:, None]) * np.exp(-axes.log_sigma)
    gamma, lapse = axes.gamma[:, None, None, None], axes.lapse[:, None, None]
    rest = np.maximum(1 - gamma - lapse, 0.0)
    above, below = (share[:, None, None] for share in rise(function, z))
    answered, missed = gamma + lapse_share * lapse, (1 - lapse_share) * lapse
    both = np.concatenate([answered + rest * above, missed + rest * below])
    log = np.log(np.maximum(both, TINY, out=both), out=both)
    return np.asarray(log.reshape(2 * len(levels), -1))


_cached_log_probabilities = lru_cache(maxsize=2)(log_probabilities)
"""People, groups and simulated studies use the same few levels in turn."""


def _log_likelihoods(tables: Tables, axes: Axes, *, shared: bool) -> Floats:
    """Return log likelihoods, greatest 0: (tables, gamma x lambda, mu x log sigma)."""
    counts = [binned(*tables.counts(row)) for row in range(len(tables))]
    levels = np.unique(np.concatenate([u for u, _, _ in counts]))
    k, n = np.zeros((2, len(tables), len(levels)))
    for row, (u, detected, presented) in enumerate(counts):
        index = np.searchsorted(levels, u)
        k[row, index], n[row, index] = detected, presented
    cells = math.prod(axes.shape)
    block = max(_MAX_BLOCK // (2 * cells), 1)
    cached = shared and 2 * len(levels) * cells <= _MAX_CACHED
    probabilities = _cached_log_probabilities if cached else log_probabilities
    share = tables.lapse_share
    log = np.zeros((len(tables), cells))
    for start in range(0, len(levels), block):
        some = slice(start, start + block)
        answers = np.concatenate([k[:, some], n[:, some] - k[:, some]], axis=1)
        log += answers @ probabilities(tuple(levels[some].tolist()), axes, tables.function, share)
    log -= log.max(axis=1, keepdims=True)
    return log.reshape(len(tables), len(axes.gamma) * len(axes.lapse), -1)


def _guess_weight(axes: Axes, guesses: Sequence[GuessRate]) -> Floats:
    """Return the weight of each node of gamma, (tables, gamma), greatest 1."""
    log = np.full((len(guesses), len(axes.gamma)), -np.inf)
    for row, guess in zip(log, guesses, strict=True):
        if guess.beta is None:
            row[int(np.abs(axes.gamma - guess.mean).argmin())] = 0.0
        else:
            row[:] = guess.log_density(axes.gamma)
    return np.asarray(axes.gamma_weight * np.exp(log - log.max(axis=1, keepdims=True)))


def _prior_of(prior: Prior, axes: Axes) -> Floats:
    """Return the weight of each node of mu and log sigma by the prior."""
    of_mu = trapezoid(axes.mu) * prior.mu(axes.mu)
    return np.asarray(of_mu[:, None] * trapezoid(axes.log_sigma) * prior.sigma(axes.log_sigma))


def _integrated(
    log: Floats, axes: Axes, tables: Tables
) -> tuple[list[Likelihood], NDArray[np.bool_]]:
    """Integrate gamma and lambda out, and mark likelihoods that are too narrow for the nodes."""
    number, (n_gamma, n_lapse, n_mu, n_sigma) = len(tables), axes.shape
    guess_weight = _guess_weight(axes, tables.guesses)
    cells = np.exp(log)
    weights = (
        guess_weight[:, None, :, None] * (lapse_classes(axes.lapse) * axes.lapse_weight)[:, None]
    )
    by_class = (weights.reshape(number, 3, -1) @ cells).reshape(number, 3, n_mu, n_sigma)
    by_class /= by_class.sum(axis=1).max(axis=(1, 2))[:, None, None, None]
    values = by_class.sum(axis=1)
    planes = {prior: _prior_of(prior, axes) for prior in set(tables.priors)}
    plane = np.stack([planes[prior] for prior in tables.priors])
    mu = quantiles((values * plane).sum(axis=2) / trapezoid(axes.mu), axes.mu)
    log_sigma = quantiles((values * plane).sum(axis=1) / trapezoid(axes.log_sigma), axes.log_sigma)
    shares = (cells @ plane.reshape(number, -1, 1)).reshape(number, n_gamma, n_lapse)
    shares *= guess_weight[:, :, None] * axes.lapse_weight
    shares /= shares.sum(axis=(1, 2), keepdims=True)
    of_gamma, of_lapse = shares.sum(axis=2), shares.sum(axis=1)
    gamma, lapse = _moments(of_gamma, axes.gamma), _moments(of_lapse, axes.lapse)
    at_mean = [int(np.abs(axes.gamma - guess.mean).argmin()) for guess in tables.guesses]
    likeliest = log.reshape(number, n_gamma, -1)[range(number), at_mean].argmax(axis=1)
    at_lapse, at_mu, at_sigma = np.unravel_index(likeliest, (n_lapse, n_mu, n_sigma))
    node = np.stack([axes.mu[at_mu], axes.log_sigma[at_sigma], axes.lapse[at_lapse]], axis=1)
    share = tables.lapse_share
    likelihood = [
        Likelihood(
            mu=axes.mu,
            log_sigma=axes.log_sigma,
            by_class=by_class[i],
            mu_points=mu[i],
            log_sigma_points=log_sigma[i],
            gamma=_scaled(lapse[i], share, gamma[i][0], gamma[i][1])
            if guess.beta
            else _scaled(lapse[i], share, guess.mean),
            lapse=_scaled(lapse[i], 1 - share),
            node=node[i],
        )
        for i, guess in enumerate(tables.guesses)
    ]
    is_beta = np.array([guess.beta is not None for guess in tables.guesses])
    narrow = (of_lapse.max(axis=1) > _MAX_SHARE) | is_beta & (of_gamma.max(axis=1) > _MAX_SHARE)
    for axis, min_nodes in zip((2, 1), _MIN_PEAK_NODES, strict=True):
        narrow |= (values.max(axis=axis) > _PEAK).sum(axis=1) < min_nodes
    return likelihood, np.asarray(narrow)


def _moments(shares: Floats, axis: Floats) -> list[tuple[float, float]]:
    """Return mean and variance of values along an axis, for each row of their shares."""
    mean = shares @ axis
    variance = np.maximum(shares @ axis**2 - mean**2, 0.0)
    return list(zip(mean.tolist(), variance.tolist(), strict=True))


def _scaled(
    moments: tuple[float, float], factor: float, mean: float = 0.0, variance: float = 0.0
) -> tuple[float, float]:
    """Return mean and variance of a multiple of a value, added to another value."""
    return mean + factor * moments[0], variance + factor**2 * moments[1]


def _narrow_axes(table: Tables, axes: Axes, log: Floats) -> tuple[Axes, Floats]:
    """Return axes that hold no more than what is likely of one table, and its log likelihood there.

    `log` is its log likelihood on wider axes.
    """
    limits = [(0.0, 1.0), (0.0, MAX_LAPSE), *((axis[0], axis[-1]) for axis in axes.each[2:])]
    heat, narrow = max(float(table.presented.sum()) / _FULL_HEAT_TRIALS, 1.0), True
    for _ in range(_MAX_STEPS):
        box, cut = _likely_box(table, axes, log, limits, _LOG_RANGE * heat)
        if heat == 1 and not (narrow or cut):
            break
        axes = _axes_in(box, table.guesses[0])
        log = _log_likelihoods(table, axes, shared=False)
        narrow = bool(_integrated(log, axes, table)[1][0])
        heat = max(heat / _COOLING, 1.0)
    return axes, log


def _likely_box(
    table: Tables, axes: Axes, log: Floats, limits: Sequence[Ends], log_range: float
) -> tuple[list[Ends], bool]:
    """Return the ends, along each axis, of nodes within a range of the greatest log likelihood.

    A node around belongs to them. Where such nodes reach an end that is no limit of the parameter,
    the box grows beyond it, and is marked as cut.
    """
    weight = np.maximum(_guess_weight(axes, table.guesses)[0], TINY)
    cells = log.reshape(axes.shape) + np.log(weight)[:, None, None, None]
    near = cells > cells.max() - log_range
    box, cut = [], False
    for i, (axis, ends) in enumerate(zip(axes.each, limits, strict=True)):
        at = np.flatnonzero(near.any(axis=tuple(j for j in range(4) if j != i)))
        room = _ROOM * max(float(np.ptp(axis)), TINY)
        grown = np.clip([axis[0] - room, axis[-1] + room], *ends)
        around = np.concatenate([grown[:1], axis, grown[1:]])
        low, high = around[at[0]], around[at[-1] + 2]
        cut |= bool(low < axis[0] - room / 4 or high > axis[-1] + room / 4)
        box.append((float(low), float(high)))
    return box, cut


def _axes_in(box: Sequence[Ends], guess: GuessRate) -> Axes:
    """Lay axes over a box of gamma, lambda, mu and log sigma."""
    gamma, gamma_weight = np.array([guess.mean]), np.ones(1)
    if guess.beta:
        at, gamma_weight = legendre(_NARROW.guess)
        first, last = np.arcsin(np.sqrt(box[0]))
        gamma = np.sin(first + at * (last - first)) ** 2
    mu, log_sigma = np.linspace(*box[2], _NARROW.between), np.linspace(*box[3], _NARROW.log_sigma)
    return Axes(mu, log_sigma, *lapse_nodes(*box[1], _NARROW.lapse), gamma, gamma_weight)
