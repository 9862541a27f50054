"""Levels placed on one participant's own psychometric function, from a pilot session."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr, ndtri

from analysis.axis import VOLTS
from analysis.thresholds.fit import WITH_THRESHOLD, fit_many
from analysis.thresholds.grid import Ruler, surfaces
from analysis.thresholds.people import GuessRate, people_of
from analysis.thresholds.posterior import posterior
from analysis.thresholds.table import printed
from experiment.study.sections.design import LEAST_LEVEL_VPP

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from numpy.typing import NDArray

    from analysis.thresholds.people import PersonCounts
    from experiment.study.study import Study


FELT: Final = (0.15, 0.35, 0.55, 0.75, 0.95)
"""How often the placed levels are to be felt: between guesses and lapses."""

_WIDEST_DB: Final = 14.0
"""Limits of a pilot's threshold that lie farther apart place levels nearly anywhere."""
_LOWEST_MOST: Final = 0.35
_HIGHEST_LEAST: Final = 0.75
_STUDIES: Final = 400
"""Simulated participants; the error has a standard error of 3.5 %."""


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
class Placement:
    """Levels for one participant, and what they are worth.

    Attributes
    ----------
    participant : str
    function : Function
        The pilot's posterior medians, mean lambda.
    threshold_limits_vpp : tuple of float
        95 % limits.
    levels_vpp : tuple of float
        The placed levels, increasing, to 0.1 V.
    felt : tuple of float
        How often each is felt by that function.
    trials : int
        Single stimuli of a session.
    error_db, fixed_error_db : float
        Expected root mean square error of the threshold after these trials, at the placed levels
        and at those of the study.
    fixed_levels_vpp : tuple of float
        The latter.
    """

    participant: str
    function: Function
    threshold_limits_vpp: tuple[float, float]
    levels_vpp: tuple[float, ...]
    felt: tuple[float, ...]
    trials: int
    error_db: float
    fixed_error_db: float
    fixed_levels_vpp: tuple[float, ...]


def place_levels(
    trials: pd.DataFrame, participant: str, study: Study, *, seed: int = 0
) -> Placement:
    """Place levels on a participant's function.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.
    participant : str
        Whose; other participants are ignored.
    study : Study
        What is to be run: its ceiling, its number of trials, its levels to compare with.
    seed : int
        Of the simulated sessions behind the errors.

    Returns
    -------
    Placement

    Raises
    ------
    LevelsError
        If there is no pilot of that participant, or it has several conditions, no threshold, one
        that is known too badly, or one too close to an end of the levels that can be set.
    """
    people = people_of(trials[trials["participant"].eq(participant)])
    if len(people.names) != 1:
        told = ", ".join(condition for condition, _ in people.names) or "none"
        raise LevelsError(
            f"participant {participant} must have single stimuli that count in one condition; "
            f"got conditions: {told}"
        )
    guess = people.guesses[0].rate
    x = np.log10(people.level_vpp)
    fit = fit_many(x, people.detected, people.presented, guesses=[guess])[0]
    if fit.status not in WITH_THRESHOLD:
        words = printed(fit, people.level_vpp[0], VOLTS)
        raise LevelsError(
            f"the pilot of participant {participant} cannot place levels: {fit.status} ({words}); "
            "run another one over a wider range or with more trials"
        )
    function, limits_vpp = _known(people, guess)
    width_db = 20 * math.log10(limits_vpp[1] / limits_vpp[0])
    if width_db > _WIDEST_DB:
        raise LevelsError(
            f"the pilot of participant {participant} knows the threshold only as "
            f"{limits_vpp[0]:.1f} to {limits_vpp[1]:.1f} V, {width_db:.1f} dB; at most "
            f"{_WIDEST_DB:g} dB place levels: run more trials"
        )
    levels_vpp = placed(function, study.device.ceiling_vpp)
    design = study.design
    return Placement(
        participant=participant,
        function=function,
        threshold_limits_vpp=limits_vpp,
        levels_vpp=levels_vpp,
        felt=tuple(float(share) for share in _felt(function, levels_vpp)),
        trials=2 * design.trials_per_side,
        error_db=expected_error_db(function, levels_vpp, 2 * design.trials_per_side, seed=seed),
        fixed_error_db=expected_error_db(
            function, design.levels_vpp, 2 * design.trials_per_side, seed=seed
        ),
        fixed_levels_vpp=design.levels_vpp,
    )


def _known(people: PersonCounts, guess: GuessRate) -> tuple[Function, tuple[float, float]]:
    """Return the function at the posterior medians, and the threshold's limits."""
    x = np.log10(people.level_vpp)
    ruler = Ruler.of(x[people.presented > 0], "log10")
    counts = (x / ruler.step, people.detected, people.presented)
    known = posterior(surfaces(*counts, rulers=[ruler], guesses=[guess]), [ruler])
    low, middle, high = 10 ** (known.mu[0] * ruler.step)
    function = Function(
        threshold_vpp=float(middle),
        sigma=float(ruler.step * np.exp(known.log_sigma[0, 1])),
        lapse_rate=float(known.lapse_rate[0]),
        guess_rate=guess.mean,
    )
    return function, (float(low), float(high))


def placed(function: Function, ceiling_vpp: float) -> tuple[float, ...]:
    """Return the levels that are felt as often as `FELT` says, none above the ceiling.

    Where an end cannot be reached, the others move evenly towards it: the least may be felt up to
    35 % of the time, the largest must be felt 75 %. LevelsError where the levels that can be set
    lie too much on one side of the threshold.

    >>> one = Function(threshold_vpp=100.0, sigma=0.1, lapse_rate=0.02, guess_rate=0.5)
    >>> placed(one, 200.0)
    (78.8, 91.5, 102.9, 116.8, 146.0)
    >>> placed(one, 130.0)
    (78.8, 90.4, 100.7, 112.2, 130.0)
    """
    least, most = _felt(function, (LEAST_LEVEL_VPP, ceiling_vpp))
    low, high = max(FELT[0], float(least)), min(FELT[-1], float(most))
    if low > _LOWEST_MOST or high < _HIGHEST_LEAST:
        raise LevelsError(
            f"a threshold of {function.threshold_vpp:.1f} V lies too close to an end of the levels "
            f"that can be set, {LEAST_LEVEL_VPP:g} to {ceiling_vpp:g} V"
        )
    share = (np.array(FELT) - FELT[0]) / (FELT[-1] - FELT[0])
    exact = math.log10(function.threshold_vpp) + function.sigma * ndtri(low + share * (high - low))
    levels = np.clip(np.round(10**exact, 1), LEAST_LEVEL_VPP, ceiling_vpp)
    if not (np.diff(levels) > 0).all():
        raise LevelsError(
            f"a function as steep as sigma = {function.sigma:.3g} needs levels closer than 0.1 V"
        )
    return tuple(float(level) for level in levels)


def expected_error_db(
    function: Function, levels_vpp: Sequence[float], trials: int, *, seed: int = 0
) -> float:
    """Return the root mean square error of a threshold found with some levels, by simulation.

    In dB: 20 log10 of the ratio of posterior median and truth, whatever its status. `trials`
    stimuli are spread evenly over the levels; one level alone finds no threshold: NaN.
    """
    x = np.log10(levels_vpp)
    if np.ptp(x) == 0:
        return math.nan
    shown = np.diff(np.round(np.linspace(0, trials, len(x) + 1))).astype(np.int64)
    p = function.guess_rate + (1 - function.guess_rate - function.lapse_rate) * _felt(
        function, levels_vpp
    )
    drawn = np.random.default_rng(seed).binomial(shown, p, (_STUDIES, len(x)))
    ruler = Ruler.of(x, "log10")
    counts = (drawn.astype(np.float64), np.broadcast_to(shown.astype(np.float64), drawn.shape))
    rulers, guesses = [ruler] * _STUDIES, [GuessRate(mean=function.guess_rate)] * _STUDIES
    u = np.broadcast_to(x / ruler.step, drawn.shape)
    known = posterior(surfaces(u, *counts, rulers=rulers, guesses=guesses), rulers)
    errors = known.mu[:, 1] * ruler.step - math.log10(function.threshold_vpp)
    return 20 * math.sqrt(float(np.square(errors).mean()))


def _felt(function: Function, levels_vpp: Sequence[float]) -> NDArray[np.float64]:
    z = (np.log10(levels_vpp) - math.log10(function.threshold_vpp)) / function.sigma
    return np.asarray(ndtr(z))
