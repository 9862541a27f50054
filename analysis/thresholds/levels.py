"""Levels placed on one participant's own psychometric function, from a pilot session."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr, ndtri

from analysis.axis import VOLTS
from analysis.thresholds.density import Nodes, Ruler, kinds, lapses, sigma_prior, trapezoid
from analysis.thresholds.fit import WITH_THRESHOLD, fit_many
from analysis.thresholds.grid import surfaces
from analysis.thresholds.mle import MOST_LAPSES
from analysis.thresholds.people import GuessRate, people_of
from analysis.thresholds.posterior import posterior
from analysis.thresholds.table import printed
from experiment.study.design import MIN_LEVEL_VPP

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from numpy.typing import NDArray

    from analysis.thresholds.grid import Surface
    from analysis.thresholds.people import PersonCounts
    from experiment.study.study import Study


FELT: Final = (0.15, 0.35, 0.55, 0.75, 0.95)
"""How often the placed levels are to be felt: between guesses and lapses."""

_WIDEST_DB: Final = 14.0
"""Limits of a pilot's threshold that lie farther apart place levels nearly anywhere."""
_LOWEST_MOST: Final = 0.35
_HIGHEST_LEAST: Final = 0.75
_DRAWS: Final = 200
"""Functions drawn from what the pilot tells; the expected error differs between them."""
_SESSIONS: Final = 48
"""Simulated for each drawn function; the median of means of fewer squares is too small."""
_AT_ONCE: Final = 250
_NODES: Final = Nodes(between=21, outside=6, log_sigma=11, lapse=4)
"""Medians within 0.02 dB in a quarter of the time: docs/benchmarks.md."""


class LevelsError(ValueError):
    """A pilot that cannot place levels, and why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Function:
    """A psychometric function of log10(level)."""

    threshold_vpp: float
    sigma: float
    lapse_rate: float
    guess_rate: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedError:
    """Root mean square error of a threshold, dB, over the functions that a pilot allows."""

    median_db: float
    most_db: float  # no more than this with 90 %


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """Levels for one participant in one condition, and what they are worth.

    Attributes
    ----------
    participant, condition : str
    function : Function
        The pilot's posterior medians, mean lambda.
    threshold_limits_vpp : tuple of float
        95 % limits.
    levels_vpp : tuple of float
        The placed levels, increasing, to 0.1 V.
    highest : tuple of (float, str)
        What the device reaches, Vpp, and the key that says so; no level is above it.
    felt : tuple of float
        How often each is felt by that function.
    trials : int
        Single stimuli of a session in this condition.
    error, fixed_error : ExpectedError
        Of the threshold after these trials, at the placed levels and at those of the study.
    fixed_levels_vpp : tuple of float
        The latter.
    """

    participant: str
    condition: str
    function: Function
    threshold_limits_vpp: tuple[float, float]
    levels_vpp: tuple[float, ...]
    highest: tuple[float, str]
    felt: tuple[float, ...]
    trials: int
    error: ExpectedError
    fixed_error: ExpectedError
    fixed_levels_vpp: tuple[float, ...]


def place_levels(
    trials: pd.DataFrame, participant: str, study: Study, *, seed: int = 0
) -> tuple[Placement | LevelsError, ...]:
    """Place levels on a participant's functions, one in each condition of the pilot.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`: constant or adaptive, with any number of stimuli at a level.
    participant : str
        Whose; other participants are ignored.
    study : Study
        What is to be run: its device, its number of trials, its levels to compare with.
    seed : int
        Of the simulated sessions behind the errors.

    Returns
    -------
    tuple of Placement or LevelsError
        By the conditions' names; the error of a condition that has no threshold, one that is known
        too badly, or one too close to an end of the levels that can be set.

    Raises
    ------
    LevelsError
        If there is no pilot of that participant.
    """
    people = people_of(trials[trials["participant"].eq(participant)])
    if not people.names:
        raise LevelsError(
            f"participant {participant} must have single stimuli that count; got none"
        )
    found: list[Placement | LevelsError] = []
    for i in range(len(people.names)):
        try:
            found.append(_placement(people, i, study, seed))
        except LevelsError as error:
            found.append(error)
    return tuple(found)


def _placement(people: PersonCounts, i: int, study: Study, seed: int) -> Placement:
    condition, participant = people.names[i]
    whose = f"the pilot of participant {participant} in condition {condition}"
    guess = people.guesses[i].rate
    table = (people.level_vpp[[i]], people.detected[[i]], people.presented[[i]])
    (pilot,) = pilot_functions(*table, [guess], whose)
    if isinstance(pilot, LevelsError):
        raise pilot
    function, (low, high) = pilot.function, pilot.threshold_limits_vpp
    levels_vpp = placed(function, *study.device.highest)
    design = study.design_of(condition)
    drawn = _draws(pilot.surface, pilot.ruler, guess.mean, np.random.default_rng(seed))
    error, fixed_error = (
        expected_error(drawn, levels, 2 * design.trials_per_side, seed=seed)
        for levels in (levels_vpp, design.levels_vpp)
    )
    return Placement(
        participant=participant,
        condition=condition,
        function=function,
        threshold_limits_vpp=(low, high),
        levels_vpp=levels_vpp,
        highest=study.device.highest,
        felt=tuple(float(share) for share in _felt(function, levels_vpp)),
        trials=2 * design.trials_per_side,
        error=error,
        fixed_error=fixed_error,
        fixed_levels_vpp=design.levels_vpp,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PilotFunction:
    """What a pilot tells of a person's function, as far as levels can be placed on it."""

    function: Function
    threshold_limits_vpp: tuple[float, float]
    surface: Surface
    ruler: Ruler


def pilot_functions(
    level_vpp: NDArray[np.float64],
    detected: NDArray[np.float64],
    presented: NDArray[np.float64],
    guesses: Sequence[GuessRate],
    whose: str = "the pilot",
) -> list[PilotFunction | LevelsError]:
    """Return the function of each table, (tables, levels), or why it cannot place levels."""
    x = np.log10(level_vpp)
    fits = fit_many(x, detected, presented, guesses=guesses)
    tell = [i for i, fit in enumerate(fits) if fit.status in WITH_THRESHOLD]
    rulers = [Ruler.of(x[i][presented[i] > 0], "log10") for i in tell]
    step = np.array([one.step for one in rulers])[:, None]
    some = surfaces(
        x[tell] / step,
        detected[tell],
        presented[tell],
        rulers=rulers,
        guesses=[guesses[i] for i in tell],
    )
    known = posterior(some, rulers)
    found: list[PilotFunction | LevelsError] = [
        LevelsError(
            f"{whose} cannot place levels: {fit.status} "
            f"({printed(fit, level_vpp[i][presented[i] > 0], VOLTS)}); "
            "run another one over a wider range or with more trials"
        )
        for i, fit in enumerate(fits)
    ]
    for row, i in enumerate(tell):
        low, middle, high = (10 ** (known.mu[row] * step[row])).tolist()
        width_db = 20 * math.log10(high / low)
        if width_db > _WIDEST_DB:
            found[i] = LevelsError(
                f"{whose} knows the threshold only as {low:.1f} to {high:.1f} V, {width_db:.1f} dB;"
                f" at most {_WIDEST_DB:g} dB place levels: run more trials"
            )
            continue
        function = Function(
            threshold_vpp=middle,
            sigma=float(step[row, 0] * np.exp(known.log_sigma[row, 1])),
            lapse_rate=float(known.lapse_rate[row]),
            guess_rate=guesses[i].mean,
        )
        found[i] = PilotFunction(
            function=function,
            threshold_limits_vpp=(low, high),
            surface=some[row],
            ruler=rulers[row],
        )
    return found


def _draws(
    surface: Surface, ruler: Ruler, guess_rate: float, rng: np.random.Generator
) -> list[Function]:
    """Draw functions from the posterior of a pilot, anywhere between the nodes of its grid."""
    prior = np.outer(ruler.mu_prior(surface.mu), sigma_prior(surface.log_sigma))
    cells = np.outer(trapezoid(surface.mu), trapezoid(surface.log_sigma))
    weight = surface.by_kind * prior * cells
    chosen = rng.choice(weight.size, _DRAWS, p=weight.ravel() / weight.sum())
    kind, row, column = np.unravel_index(chosen, weight.shape)
    mu, log_sigma = (
        np.interp(at + rng.uniform(-0.5, 0.5, _DRAWS), np.arange(len(axis)), axis)
        for at, axis in ((row, surface.mu), (column, surface.log_sigma))
    )
    lapse, share = lapses(0.0, MOST_LAPSES, 12)
    share = np.cumsum(kinds(lapse) * share, axis=1)
    place = (share[kind] < rng.random((_DRAWS, 1)) * share[kind, -1:]).sum(axis=1)
    return [
        Function(
            threshold_vpp=float(10 ** (mu[i] * ruler.step)),
            sigma=float(np.exp(log_sigma[i]) * ruler.step),
            lapse_rate=float(lapse[place[i]]),
            guess_rate=guess_rate,
        )
        for i in range(_DRAWS)
    ]


def placed(
    function: Function, highest_vpp: float, key: str = "device.ceiling_vpp"
) -> tuple[float, ...]:
    """Return the levels that are felt as often as `FELT` says, none above what the device reaches.

    `highest_vpp` and `key` are those of `DeviceSettings.highest`.

    Where an end cannot be reached, the others move evenly towards it: the least may be felt up to
    35 % of the time, the largest must be felt 75 %. LevelsError where the levels that can be set
    lie too much on one side of the threshold.

    >>> one = Function(threshold_vpp=100.0, sigma=0.1, lapse_rate=0.02, guess_rate=0.5)
    >>> placed(one, 200.0)
    (78.8, 91.5, 102.9, 116.8, 146.0)
    >>> placed(one, 130.0)
    (78.8, 90.4, 100.7, 112.2, 130.0)
    """
    least, most = _felt(function, (MIN_LEVEL_VPP, highest_vpp))
    low, high = max(FELT[0], float(least)), min(FELT[-1], float(most))
    if low > _LOWEST_MOST or high < _HIGHEST_LEAST:
        raise LevelsError(
            f"a threshold of {function.threshold_vpp:.1f} V lies too close to an end of the levels "
            f"that can be set, {MIN_LEVEL_VPP:g} to {highest_vpp:g} V = {key}"
        )
    share = (np.array(FELT) - FELT[0]) / (FELT[-1] - FELT[0])
    exact = math.log10(function.threshold_vpp) + function.sigma * ndtri(low + share * (high - low))
    most_vpp = math.floor(10 * highest_vpp + 1e-6) / 10  # 118.78 V are not 118.8
    levels = np.clip(np.round(10**exact, 1), MIN_LEVEL_VPP, most_vpp)
    if not (np.diff(levels) > 0).all():
        raise LevelsError(
            f"a function as steep as sigma = {function.sigma:.3g} needs levels closer than 0.1 V"
        )
    return tuple(float(level) for level in levels)


def expected_error(
    functions: Sequence[Function], levels_vpp: Sequence[float], trials: int, *, seed: int = 0
) -> ExpectedError:
    """Return the error of a threshold found with some levels, of people who may be any of these.

    The root mean square error of each, by simulation, in dB: 20 log10 of the ratio of posterior
    median and truth, whatever its status; of these the median and the 90 % point. `trials` stimuli
    are spread evenly over the levels; one level alone finds no threshold: NaN.
    """
    x = np.log10(levels_vpp)
    if np.ptp(x) == 0:
        return ExpectedError(median_db=math.nan, most_db=math.nan)
    shown = np.diff(np.round(np.linspace(0, trials, len(x) + 1)))
    p = np.repeat([_detected(one, levels_vpp) for one in functions], _SESSIONS, axis=0)
    drawn = np.random.default_rng(seed).binomial(shown.astype(np.int64), p).astype(np.float64)
    ruler = Ruler.of(x, "log10")
    rulers = [ruler] * len(p)
    guesses = [GuessRate(mean=functions[0].guess_rate)] * len(p)
    u, n = (np.broadcast_to(one, p.shape) for one in (x / ruler.step, shown))
    middle = [
        posterior(
            surfaces(u[i], drawn[i], n[i], rulers=rulers[i], guesses=guesses[i], nodes=_NODES),
            rulers[i],
        ).mu[:, 1]
        for i in (slice(first, first + _AT_ONCE) for first in range(0, len(p), _AT_ONCE))
    ]
    found = np.concatenate(middle).reshape(len(functions), -1) * ruler.step
    truth = np.log10([one.threshold_vpp for one in functions])
    errors = 20 * np.sqrt(np.square(found - truth[:, None]).mean(axis=1))
    median_db, most_db = np.quantile(errors, (0.5, 0.9))
    return ExpectedError(median_db=float(median_db), most_db=float(most_db))


def _detected(function: Function, levels_vpp: Sequence[float]) -> NDArray[np.float64]:
    rest = 1 - function.guess_rate - function.lapse_rate
    return function.guess_rate + rest * _felt(function, levels_vpp)


def _felt(function: Function, levels_vpp: Sequence[float]) -> NDArray[np.float64]:
    z = (np.log10(levels_vpp) - math.log10(function.threshold_vpp)) / function.sigma
    return np.asarray(ndtr(z))
