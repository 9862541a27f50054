"""Levels for one participant, chosen on the psychometric function of a pilot session."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from scipy.special import ndtri

from analysis.thresholds.band import Line, drawn_functions
from analysis.thresholds.fit import WITH_THRESHOLD, fit_many
from analysis.thresholds.guess import GuessRate
from analysis.thresholds.likelihood import Nodes, Tables, likelihoods
from analysis.thresholds.tables import tables_of
from experiment.study.design import MIN_LEVEL_VPP

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from numpy.typing import NDArray

    from experiment.study.design import Design
    from experiment.study.study import Study

    Floats = NDArray[np.float64]

TARGETS: Final = (0.15, 0.35, 0.55, 0.75, 0.95)
"""How often the chosen levels should be detected, between guesses and lapses."""
_MAX_WIDTH_DB: Final = 14.0
"""Limits of a pilot's threshold that lie farther apart place levels nearly anywhere."""
_MAX_LOWEST: Final = 0.35
_MIN_HIGHEST: Final = 0.75
_DRAWS: Final = 200
"""Functions drawn from the pilot's posterior; the expected error differs between them."""
_SESSIONS: Final = 48
"""Simulated for each drawn function; the median of means of fewer squares is too small."""
_NODES: Final = Nodes(between=21, outside=6, log_sigma=11, lapse=4)
"""Medians within 0.02 dB in a quarter of the time: docs/benchmarks.md."""


class LevelsError(ValueError):
    """A pilot that cannot place levels, and why."""


class ExpectedError(NamedTuple):
    """Root mean square error of a threshold, dB: the median and the 90 % point over functions."""

    median_db: float
    p90_db: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """Levels for one participant in one condition, and the error of a threshold that they give.

    `highest` is the largest level that the device allows and the key that says so; `threshold_vpp`
    are the lower limit, the median and the upper limit of the pilot's threshold. The errors are
    those after the single stimuli of a session of the design, at these levels and at those of the
    design.
    """

    participant: str
    condition: str
    design: Design
    highest: tuple[float, str]
    threshold_vpp: tuple[float, float, float]
    function: Line
    levels_vpp: tuple[float, ...]
    error: ExpectedError
    design_error: ExpectedError

    @property
    def shares(self) -> list[float]:
        """How often each level should be detected, between guesses and lapses."""
        shares: list[float] = self.function.share(np.log10(self.levels_vpp)).tolist()
        return shares


def place_levels(
    trials: pd.DataFrame, participant: str, study: Study, *, seed: int = 0
) -> dict[str, Placement | LevelsError]:
    """Place levels on a participant's functions, by the condition of the pilot.

    `trials` is from `analysis.read_trials`; `study` is what is to be run: its device, number of
    trials, and levels to compare with. A condition without a usable threshold has its error.
    LevelsError is raised if there is no pilot of the participant.
    """
    people = tables_of(trials[trials["participant"].eq(participant)])
    if not len(people):
        raise LevelsError(
            f"participant {participant} must have single stimuli that count; got none"
        )
    results: dict[str, Placement | LevelsError] = {}
    for condition, pilot in people.conditions.items():
        try:
            levels_vpp = placed_levels(pilot, *study.device.highest)
        except LevelsError as reason:
            results[condition] = LevelsError(
                f"the pilot of participant {participant} in condition {condition}: {reason}"
            )
            continue
        design, function = study.design_of(condition), function_of(pilot)
        functions = replace(
            drawn_functions(pilot, _DRAWS, seed=seed), guess_rate=function.guess_rate
        )
        error, design_error = (
            expected_error(functions, levels, 2 * design.trials_per_side, seed=seed)
            for levels in (levels_vpp, design.levels_vpp)
        )
        results[condition] = Placement(
            participant=participant,
            condition=condition,
            design=design,
            highest=study.device.highest,
            threshold_vpp=_threshold_vpp(pilot),
            function=function,
            levels_vpp=levels_vpp,
            error=error,
            design_error=design_error,
        )
    return results


def function_of(pilot: Tables) -> Line:
    """Return the function of one table of levels in volts, whatever the status of its fit."""
    (likelihood,), (guess,), step = pilot.likelihoods, pilot.guesses, pilot.prior.step
    return Line(
        mu=float(likelihood.mu_points[1]) * step,
        sigma=math.exp(likelihood.log_sigma_points[1]) * step,
        lapse_rate=likelihood.lapse[0],
        guess_rate=guess.mean,
    )


def _threshold_vpp(pilot: Tables) -> tuple[float, float, float]:
    """Return the lower limit, the median and the upper limit of the threshold, open or not."""
    low, median, high = 10 ** (pilot.likelihoods[0].mu_points * pilot.prior.step)
    return float(low), float(median), float(high)


def placed_levels(
    pilot: Tables, highest_vpp: float, key: str = "device.ceiling_vpp"
) -> tuple[float, ...]:
    """Return the levels for one pilot; LevelsError where its threshold is unknown or vague."""
    (fit,) = fit_many(pilot)
    if fit.status not in WITH_THRESHOLD:
        raise LevelsError(
            f"it cannot place levels: {fit.status} (levels {pilot.tested[0]:g} V to "
            f"{pilot.tested[-1]:g} V); run another one over a wider range or with more trials"
        )
    low, _, high = _threshold_vpp(pilot)
    width_db = 20 * math.log10(high / low)
    if width_db > _MAX_WIDTH_DB:
        raise LevelsError(
            f"it knows the threshold only as {low:.1f} to {high:.1f} V, {width_db:.1f} dB; at "
            f"most {_MAX_WIDTH_DB:g} dB place levels: run more trials"
        )
    return levels_on(function_of(pilot), highest_vpp, key)


def levels_on(
    function: Line, highest_vpp: float, key: str = "device.ceiling_vpp"
) -> tuple[float, ...]:
    """Return the levels detected as often as `TARGETS` says, none above what the device reaches.

    Where an end cannot be reached, the others move evenly towards it: the lowest may be detected
    up to 35 % of the time, the highest must be detected 75 %. LevelsError where the levels that
    can be set lie too much on one side of the threshold.

    >>> function = Line(mu=2.0, sigma=0.1, lapse_rate=0.02, guess_rate=0.5)
    >>> levels_on(function, 200.0)
    (78.8, 91.5, 102.9, 116.8, 146.0)
    >>> levels_on(function, 130.0)
    (78.8, 90.4, 100.7, 112.2, 130.0)
    """
    at_lowest, at_highest = function.share(np.log10([MIN_LEVEL_VPP, highest_vpp])).tolist()
    low, high = max(TARGETS[0], at_lowest), min(TARGETS[-1], at_highest)
    if low > _MAX_LOWEST or high < _MIN_HIGHEST:
        raise LevelsError(
            f"a threshold of {10**function.mu:.1f} V lies too close to an end of the levels "
            f"that can be set, {MIN_LEVEL_VPP:g} to {highest_vpp:g} V = {key}"
        )
    share = (np.array(TARGETS) - TARGETS[0]) / (TARGETS[-1] - TARGETS[0])
    exact = function.mu + function.sigma * ndtri(low + share * (high - low))
    max_vpp = math.floor(10 * highest_vpp + 1e-6) / 10  # 118.78 V are not 118.8
    levels = np.clip(np.round(10**exact, 1), MIN_LEVEL_VPP, max_vpp)
    if not (np.diff(levels) > 0).all():
        raise LevelsError(
            f"a function as steep as sigma = {function.sigma:.3g} needs levels closer than 0.1 V"
        )
    return tuple(levels.tolist())


def expected_error(
    functions: Line, levels_vpp: Sequence[float], trials: int, *, seed: int = 0
) -> ExpectedError:
    """Return the error of a threshold measured at some levels, whichever function is the true one.

    The root mean square error for each of many drawn functions with one guess rate, by simulation,
    in dB: 20 log10 of the ratio of posterior median and truth, whatever its status. `trials`
    stimuli are spread evenly over the levels; one level alone gives no threshold: NaN.
    """
    x = np.log10(levels_vpp)
    if np.ptp(x) == 0:
        return ExpectedError(math.nan, math.nan)
    presented = np.diff(np.round(np.linspace(0, trials, len(x) + 1)))
    p = functions.at(x[:, None]).T.repeat(_SESSIONS, axis=0)
    detected = np.random.default_rng(seed).binomial(presented.astype(np.int64), p).astype(float)
    tables = Tables(
        levels=np.broadcast_to(levels_vpp, detected.shape),
        detected=detected,
        presented=np.broadcast_to(presented, detected.shape),
        guesses=[GuessRate(mean=float(functions.guess_rate))] * len(detected),
    )
    people = likelihoods(tables, _NODES)
    medians = np.array([person.mu_points[1] for person in people]) * tables.prior.step
    deviations = medians.reshape(-1, _SESSIONS) - np.reshape(functions.mu, (-1, 1))
    errors = 20 * np.sqrt(np.square(deviations).mean(axis=1))
    return ExpectedError(*np.quantile(errors, (0.5, 0.9)).tolist())
