"""Psychometric functions as they are drawn: of people and of groups, with 95 % credible bands.

The line has the values of the tables. The band is of the function at each level by itself: between
the 2.5 % and 97.5 % points of functions drawn from the posterior. A group's function is the mean of
the functions of people of its kind, gamma + (1 - gamma - lambda) F((x - M) / sqrt(sigma^2 +
tau^2)), with sigma at exp(S) and the means of its people's gamma and lambda (docs/statistics.md,
section 8).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from analysis.numbers import LIMITS
from analysis.thresholds.function import MAX_LAPSE, FunctionName, inverse, rise
from analysis.thresholds.group import MIDDLE, MIN_PEOPLE, Population, draws, group_posterior
from analysis.thresholds.likelihood import Likelihood, cells_of
from analysis.thresholds.people import likelihoods_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.thresholds.people import PersonCounts
    from analysis.thresholds.tables import Tables

    Floats = NDArray[np.float64]

_DRAWS: Final = 4000
_POINTS: Final = 49
# A band is taken so many places at a time: (places, draws) of all of 20 000 levels fill 2.7 GB.
_PLACES: Final = 250
_NORMAL: Final = 1.96


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """gamma + (1 - gamma - lambda) F((x - mu) / sigma), all on the axis.

    Of functions drawn from a posterior each parameter is an array.
    """

    mu: float | Floats
    sigma: float | Floats
    lapse_rate: float | Floats
    guess_rate: float | Floats
    shape: FunctionName = "normal"

    def at(self, x: Floats) -> Floats:
        """Return the value at places on the axis; of drawn functions at places (places, 1).

        >>> line = Line(mu=2.0, sigma=0.1, lapse_rate=0.02, guess_rate=0.5)
        >>> line.at(np.array([-9.0, 2.0, 9.0])).tolist()
        [0.5, 0.74, 0.98]
        """
        above, _ = rise(self.shape, np.asarray((x - self.mu) / self.sigma))
        return np.asarray(self.guess_rate + (1 - self.guess_rate - self.lapse_rate) * above)

    def band(self, x: Floats) -> Floats:
        """Return the limits of the values of drawn functions at places on the axis, (2, places)."""
        blocks = [x[start : start + _PLACES, None] for start in range(0, len(x), _PLACES)]
        return np.concatenate(
            [np.quantile(self.at(block), LIMITS, axis=1) for block in blocks], axis=1
        )

    def places(self, p: float) -> Floats:
        """Return where each function has a value; infinity where it stays above or below."""
        share = (p - self.guess_rate) / (1 - self.guess_rate - self.lapse_rate)
        inside = (share > 0) & (share < 1)
        z = inverse(self.shape, np.where(inside, share, 0.5))
        return np.where(inside, self.mu + self.sigma * z, np.where(share > 0, np.inf, -np.inf))


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


def drawn_functions(people: PersonCounts, rows: Sequence[int], axis: Axis) -> Line:
    """Draw functions of a participant, or of the group of several."""
    if len(rows) == 1:
        return person_draws(people.tables(axis), rows[0])
    return group_draws(*_group(people, rows, axis))


def person_draws(tables: Tables, row: int) -> Line:
    """Draw functions of one table."""
    axes, weight, step = cells_of(tables, row)
    gamma, lapse, mu, log_sigma = draws(weight, axes.each, _DRAWS, np.random.default_rng(1))
    return Line(mu * step, np.exp(log_sigma) * step, lapse, gamma, tables.function)


def group_draws(tables: Tables, people: Sequence[Likelihood], posterior: Population) -> Line:
    """Draw functions of a group: the mean over people like these."""
    rng, step = np.random.default_rng(1), tables.prior.step
    middle, spread, log_sigma = posterior.drawn(_DRAWS, rng)
    gamma, lapse = (
        np.clip(mean + np.sqrt(variance) * rng.standard_normal(_DRAWS), 0.0, most)
        for (mean, variance), most in (
            (_mean_over_people([person.gamma for person in people]), 1 - MAX_LAPSE),
            (_mean_over_people([person.lapse for person in people]), MAX_LAPSE),
        )
    )
    width = np.hypot(np.exp(log_sigma), spread) * step
    return Line(middle * step, width, lapse, gamma, tables.function)


def _mean_over_people(moments: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the mean of people's rates and its variance, which is of people like them.

    How far the rates of people lie apart includes how uncertain each is, but for people who happen
    to be alike. The variance is enlarged to that of a normal value with the limits of Student's t.
    """
    means, variances = np.array(moments).T
    if not variances.any() and np.ptp(means) == 0:
        return float(means[0]), 0.0
    between = float(means.var(ddof=1)) if len(means) > 1 else 0.0
    wider = float(stdtrit(max(len(means), MIN_PEOPLE) - 1, LIMITS[1])) / _NORMAL
    return float(means.mean()), max(between, float(variances.mean())) / len(means) * wider**2


def person_function(people: PersonCounts, row: int, line: Line, axis: Axis) -> Function:
    """Return the function of one person, who has several levels and this line."""
    return _function(people, [row], drawn_functions(people, [row], axis), line, axis)


def group_function(people: PersonCounts, rows: Sequence[int], axis: Axis) -> Function:
    """Return the function of the group of some of the people, who have several levels."""
    tables, some, posterior = _group(people, rows, axis)
    drawn = group_draws(tables, some, posterior)
    line = Line(
        mu=float(posterior.points(MIDDLE)[1]) * tables.prior.step,
        sigma=float(np.median(drawn.sigma)),
        lapse_rate=float(np.mean([person.lapse[0] for person in some])),
        guess_rate=float(np.mean([person.gamma[0] for person in some])),
        shape=tables.function,
    )
    return _function(people, rows, drawn, line, axis)


def group_bands(people: PersonCounts, axis: Axis) -> pd.DataFrame:
    """Return the band of the group's function of each condition at the tested levels.

    Of one person the band is the person's. Conditions with one level have none.
    """
    rows: list[tuple[object, ...]] = []
    for condition, chosen in people.conditions().items():
        tables = people.tables(axis).at(chosen)
        if not tables.several_levels().any():
            continue
        levels = np.unique(people.level_vpp[chosen][people.presented[chosen] > 0])
        low, high = drawn_functions(people, chosen, axis).band(axis.on_axis(levels))
        rows += zip([condition] * len(levels), levels, low, high, strict=True)
    return pd.DataFrame(rows, columns=["condition", "level_vpp", "p_low", "p_high"])


def _group(
    people: PersonCounts, rows: Sequence[int], axis: Axis
) -> tuple[Tables, list[Likelihood], Population]:
    tables, likelihoods = likelihoods_of(people, axis, rows)
    return tables, likelihoods, group_posterior(likelihoods, tables.prior)


def _function(
    people: PersonCounts, rows: Sequence[int], drawn: Line, line: Line, axis: Axis
) -> Function:
    chosen = list(rows)
    tested = np.unique(people.level_vpp[chosen][people.presented[chosen] > 0])
    at = axis.on_axis(tested)
    between = np.linspace(at[0], at[-1], _POINTS)[1:-1]
    x = np.concatenate([at, between])
    level_vpp = np.concatenate([tested, axis.level(between)])
    order = np.argsort(x, kind="stable")
    low, high = drawn.band(x[order])
    return Function(level_vpp=level_vpp[order], low=low, high=high, line=line, axis=axis)
