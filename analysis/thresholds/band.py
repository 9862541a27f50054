"""Psychometric functions as they are drawn: of people and of groups, with 95 % credible bands.

The line has the values of the tables. The band is of the function at each level by itself: between
the 2.5 % and 97.5 % points of functions drawn from the posterior. A group's function is the mean of
the functions of people of its kind. It is gamma + (1 - gamma - lambda) F((x - M) / sqrt(sigma^2 +
tau^2)), with sigma at exp(S) and the means of its people's gamma and lambda (docs/statistics.md,
section 8).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from analysis.counts.table import BAND
from analysis.numbers import LIMITS
from analysis.thresholds.function import MAX_LAPSE, FunctionName, inverse, rise
from analysis.thresholds.group import MIDDLE, MIN_PEOPLE, draws, posterior_of
from analysis.thresholds.likelihood import cells_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.thresholds.likelihood import Tables

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
        rest = 1 - self.guess_rate - self.lapse_rate
        return np.asarray(self.guess_rate + rest * self.share(x))

    def share(self, x: Floats) -> Floats:
        """Return the value between guesses, 0, and lapses, 1."""
        return rise(self.shape, np.asarray((x - self.mu) / self.sigma))[0]

    def band(self, x: Floats, quantiles: tuple[float, ...] = LIMITS) -> Floats:
        """Return quantiles of the values of drawn functions at places on the axis.

        Shape (quantiles, places).
        """
        blocks = [x[start : start + _PLACES, None] for start in range(0, len(x), _PLACES)]
        return np.concatenate(
            [np.quantile(self.at(block), quantiles, axis=1) for block in blocks], axis=1
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


def drawn_functions(
    people: Tables, number: int = _DRAWS, seed: int = 1, *, typical: bool = False
) -> Line:
    """Draw functions of one participant, or of the group of several.

    That of a group is the mean of people like these, which is wider than anyone's, or that of the
    `typical` participant, whose threshold is the group's.

    All parameters are drawn from their posterior, anywhere between the nodes of the grid.
    """
    rng, step = np.random.default_rng(seed), people.prior.step
    if len(people) == 1:
        axes, weight, step = cells_of(people)
        gamma, lapse, mu, log_sigma = draws(weight, axes.each, number, rng)
        ends = (1 - people.lapse_share) * lapse, gamma + people.lapse_share * lapse
        return Line(mu * step, np.exp(log_sigma) * step, *ends, people.function)
    middle, spread, log_sigma = posterior_of(people).drawn(number, rng)
    gamma, lapse = (
        np.clip(mean + np.sqrt(variance) * rng.standard_normal(number), 0.0, most)
        for (mean, variance), most in (
            (_mean_over_people([person.gamma for person in people.likelihoods]), 1 - MAX_LAPSE),
            (_mean_over_people([person.lapse for person in people.likelihoods]), MAX_LAPSE),
        )
    )
    width = (np.exp(log_sigma) if typical else np.hypot(np.exp(log_sigma), spread)) * step
    return Line(middle * step, width, lapse, gamma, people.function)


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


def person_function(person: Tables, line: Line) -> Function:
    """Return the function of one person, who has several levels and this line."""
    return _function(person, drawn_functions(person), line)


def group_function(people: Tables) -> Function:
    """Return the function of a group of people who have several levels."""
    drawn = drawn_functions(people)
    line = Line(
        mu=float(posterior_of(people).points(MIDDLE)[1]) * people.prior.step,
        sigma=float(np.median(drawn.sigma)),
        lapse_rate=float(np.mean([person.lapse[0] for person in people.likelihoods])),
        guess_rate=float(np.mean([person.gamma[0] for person in people.likelihoods])),
        shape=people.function,
    )
    return _function(people, drawn, line)


def group_bands(people: Tables) -> pd.DataFrame:
    """Return median and 95 % limits of the group's function at the tested levels of each condition.

    Of one person the band is that person's. Conditions with one level have none.
    """
    rows: list[tuple[object, ...]] = []
    for condition, group in people.conditions.items():
        if group.several_levels().any():
            levels = group.tested
            quantiles = 0.5, *LIMITS
            band = drawn_functions(group).band(group.axis.on_axis(levels), quantiles)
            rows += zip([condition] * len(levels), levels, *band, strict=True)
    return pd.DataFrame(rows, columns=["condition", "level_vpp", *BAND])


def _function(people: Tables, drawn: Line, line: Line) -> Function:
    axis, tested = people.axis, people.tested
    at = axis.on_axis(tested)
    between = np.linspace(at[0], at[-1], _POINTS)[1:-1]
    x = np.concatenate([at, between])
    level_vpp = np.concatenate([tested, axis.level(between)])
    order = np.argsort(x, kind="stable")
    low, high = drawn.band(x[order])
    return Function(level_vpp=level_vpp[order], low=low, high=high, line=line, axis=axis)
