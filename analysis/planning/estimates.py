"""What planning takes from the analysis: a group for goals and pilots, one person for levels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.counts.intervals import group_interval, proportion_ci
from analysis.thresholds.difference import difference_of, difference_spread_draws
from analysis.thresholds.fit import WITH_THRESHOLD, fit_many
from analysis.thresholds.group import draws, group_fit, population_draws
from analysis.thresholds.guess import GuessRate
from analysis.thresholds.likelihood import Nodes, Tables, cells_of, likelihoods, posteriors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from analysis.planning.sessions import Counts
    from analysis.thresholds.people import PersonCounts

    Floats = NDArray[np.float64]

_NODES: Final = Nodes(between=21, outside=6, log_sigma=11, lapse=4)
"""Medians within 0.02 dB in a quarter of the time: docs/benchmarks.md."""


def group_limits(counts: Counts) -> tuple[float, float]:
    """Return the 95 % limits of a group's threshold, log10 of Vpp; infinite where open."""
    tables = _tables(counts)
    return group_fit(tables, likelihoods(tables)).threshold_limits


def group_difference(a: Counts, b: Counts) -> tuple[float, tuple[float, float]]:
    """Return by how many dB the same people's threshold is higher in b than in a, with limits."""
    difference = difference_of(_tables(a), _tables(b), same_people=True)
    return difference.difference_db, difference.difference_limits_db


def detection_limits(counts: Counts, level_vpp: float) -> tuple[float, float]:
    """Return the 95 % limits of the detection rate at a level, of one participant or a group."""
    is_level = counts.level_vpp == level_vpp
    n = (counts.presented * is_level).sum(axis=1).astype(int)
    k = (counts.detected * is_level).sum(axis=1).astype(int)[n > 0]
    if not n.any():
        return math.nan, math.nan
    return (
        proportion_ci(int(k[0]), int(n[n > 0][0])) if len(n) == 1 else group_interval(k, n[n > 0])
    )


def draw_group(
    people: PersonCounts, number: int, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Draw mean and SD of a group's log10 thresholds and the mean of ln(sigma), by its pilot."""
    return population_draws(_person_tables(people), number, rng)


def draw_difference_spread(a: PersonCounts, b: PersonCounts, number: int) -> Floats:
    """Draw the SD between people, in dB, of the difference between two conditions."""
    rng = np.random.default_rng(1)
    return difference_spread_draws(_person_tables(a), _person_tables(b), number, rng)


def _person_tables(people: PersonCounts) -> Tables:
    return Tables(
        x=np.log10(people.level_vpp),
        detected=people.detected,
        presented=people.presented,
        guesses=[guessing.rate for guessing in people.guesses],
        x_scale="log10",
    )


def _tables(counts: Counts) -> Tables:
    return Tables(
        x=np.log10(counts.level_vpp),
        detected=counts.detected,
        presented=counts.presented,
        guesses=counts.guesses,
        x_scale="log10",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Function:
    """A psychometric function of log10(level)."""

    threshold_vpp: float
    sigma: float
    lapse_rate: float
    guess_rate: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PersonFit:
    """A participant's function: its posterior, or only a status where there is no threshold."""

    status: str
    guess_rate: float
    threshold_limits_vpp: tuple[float, float] = (0.0, math.inf)
    function: Function | None = None
    tables: Tables | None = None
    row: int = 0

    def draw(self, number: int, rng: np.random.Generator) -> list[Function]:
        """Draw functions from the posterior, anywhere between the nodes of its grid."""
        assert self.tables is not None  # as there is a threshold
        axes, weight, step = cells_of(self.tables, self.row)
        drawn = draws(weight.sum(axis=0), (axes.lapse, axes.mu, axes.log_sigma), number, rng)
        return [
            Function(
                threshold_vpp=float(10 ** (mu * step)),
                sigma=float(np.exp(log_sigma) * step),
                lapse_rate=float(lapse),
                guess_rate=self.guess_rate,
            )
            for lapse, mu, log_sigma in zip(*drawn, strict=True)
        ]


def fit_people(
    level_vpp: Floats, detected: Floats, presented: Floats, guesses: Sequence[GuessRate]
) -> list[PersonFit]:
    """Fit the function of each row of counts, (participants, levels)."""
    tables = Tables(x=np.log10(level_vpp), detected=detected, presented=presented, guesses=guesses)
    people = likelihoods(tables)
    mu, log_sigma = posteriors(people, tables.priors())
    step = tables.prior.step
    fits = []
    for row, fit in enumerate(fit_many(tables, people)):
        guess_rate = guesses[row].mean
        if fit.status not in WITH_THRESHOLD:
            fits.append(PersonFit(status=fit.status, guess_rate=guess_rate))
            continue
        low, median, high = (10 ** (mu[row] * step)).tolist()
        function = Function(
            threshold_vpp=median,
            sigma=float(step * np.exp(log_sigma[row, 1])),
            lapse_rate=people[row].lapse[0],
            guess_rate=guess_rate,
        )
        fits.append(
            PersonFit(
                status=fit.status,
                guess_rate=guess_rate,
                threshold_limits_vpp=(low, high),
                function=function,
                tables=tables,
                row=row,
            )
        )
    return fits


def threshold_medians(x: Floats, detected: Floats, presented: Floats, guess_rate: float) -> Floats:
    """Return the posterior median of log10(threshold) of each row of counts at the same levels."""
    tables = Tables(
        x=np.broadcast_to(x, detected.shape),
        detected=detected,
        presented=np.broadcast_to(presented, detected.shape),
        guesses=[GuessRate(mean=guess_rate)] * len(detected),
    )
    priors = [tables.prior] * len(tables)
    return posteriors(likelihoods(tables, _NODES), priors)[0][:, 1] * tables.prior.step
