"""A population of participants as one model: logistic, with a random intercept for everybody."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.axis import VOLTS
from analysis.definitions import LIMITS
from analysis.thresholds.probit import increasing_exists

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.thresholds.people import Guessing, PersonCounts

    Floats = NDArray[np.float64]


_MOST_GUESSES: Final = 0.03
"""A guess rate that moves a threshold by less than 0.2 dB where the model has none."""
_MOST_TRIALS: Final = 1_000_000
_STEPS: Final = 1000
_STILL_TO_GAIN: Final = 1e-3
"""Of log posterior, twice."""
_NAN: Final = float("nan")


@dataclass(frozen=True, slots=True, kw_only=True)
class PopulationThreshold:
    """The threshold of a population in one condition, or why there is none.

    Attributes
    ----------
    condition : str
    participants : int
        How many it rests on.
    threshold_vpp : float
        Level felt half of the time by the typical person; NaN where there is a reason.
    threshold_limits_vpp : tuple of float
        95 % limits for other people, by Student's t with one degree of freedom less than people.
    between_sd : float
        Standard deviation of the participants' thresholds on the axis: log10 units, or volts.
    reason : str
        Why there is no threshold; else empty.
    """

    condition: str
    participants: int
    threshold_vpp: float = _NAN
    threshold_limits_vpp: tuple[float, float] = (_NAN, _NAN)
    between_sd: float = _NAN
    reason: str = ""


def population_thresholds(
    people: PersonCounts, *, axis: Axis = VOLTS
) -> tuple[PopulationThreshold, ...]:
    """Fit the population of each condition, if one can be fitted.

    logit p = a + b x + u, with u normal for each participant (docs/statistics.md, section 8). It
    has neither guesses nor lapses, so that it is refused where answers may be guesses.

    Parameters
    ----------
    people : PersonCounts
        From `people_of`, or `people_of_counts`.
    axis : Axis
        Of the levels.

    Returns
    -------
    tuple of PopulationThreshold
        In the order of the conditions' names.

    Examples
    --------
    >>> import pandas as pd
    >>> from analysis.thresholds.people import people_of
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": "left", "level_vpp": [60.0, 60.0, 90.0], "reason": "",
    ...     "response": ["left", "both", "left"], "none_offered": True})
    >>> population_thresholds(people_of(trials))[0].reason
    'one participant tells nothing of others'
    """
    people = people.by_content()
    conditions = sorted({condition for condition, _ in people.names})
    return tuple(_population(people, condition, axis) for condition in conditions)


def _population(people: PersonCounts, condition: str, axis: Axis) -> PopulationThreshold:
    rows = [i for i, (name, _) in enumerate(people.names) if name == condition]
    person, column = np.nonzero(people.presented[rows] > 0)
    cells = (np.array(rows)[person], column)
    x = axis.on_axis(people.level_vpp[cells])
    detected, presented = people.detected[cells], people.presented[cells]
    reason = _reason(x, detected, presented, [people.guesses[i] for i in rows])
    fitted = None if reason else _fit(x, detected, presented, person)
    if fitted is None:
        return PopulationThreshold(
            condition=condition,
            participants=len(rows),
            reason=reason or "the model did not converge",
        )
    middle, error, between = fitted
    from scipy.special import stdtrit

    half = float(stdtrit(len(rows) - 1, LIMITS[1])) * error
    low, at, high = (axis.level(x) for x in (middle - half, middle, middle + half))
    return PopulationThreshold(
        condition=condition,
        participants=len(rows),
        threshold_vpp=at,
        threshold_limits_vpp=(low, high),
        between_sd=between,
    )


def _reason(x: Floats, detected: Floats, presented: Floats, guesses: Sequence[Guessing]) -> str:
    """Say why there is no such model, or nothing."""
    if len(guesses) == 1:
        return "one participant tells nothing of others"
    rate = _guess_rate(guesses)
    if rate > _MOST_GUESSES:
        return (
            f"the model has no guesses, and the guess rate is {rate:.2g}, above {_MOST_GUESSES:g}"
        )
    if np.ptp(x) == 0:
        return "one level only"
    if presented.sum() > _MOST_TRIALS:
        return f"the model takes each trial by itself, and there are more than {_MOST_TRIALS:_}"
    if not increasing_exists(x[None], detected[None], presented[None])[0]:
        return "nothing is missed above a level at which something is felt"
    return ""


def _guess_rate(guesses: Sequence[Guessing]) -> float:
    """Return the rate at which blank trials of all were answered with one side, or 1/2.

    What is only assumed of guesses, for want of blank trials, says nothing against the model.
    """
    forced = [one.rate.mean for one in guesses if one.rate.beta is None]
    after = [one.rate.beta for one in guesses if one.rate.beta and one.basis != "assumed"]
    answered, blanks = sum(a - 0.5 for a, _ in after), sum(a + b - 1 for a, b in after)
    return max([*forced, answered / blanks if blanks else 0.0])


def _fit(
    x: Floats, detected: Floats, presented: Floats, person: NDArray[np.intp]
) -> tuple[float, float, float] | None:
    """Return the threshold, its standard error and the spread of thresholds, on the axis."""
    from scipy.sparse import csr_matrix
    from statsmodels.genmod.bayes_mixed_glm import BinomialBayesMixedGLM
    from statsmodels.tools.sm_exceptions import ConvergenceWarning

    center, width = float(x.mean()), float(x.std())
    counts = np.stack([detected, presented - detected], axis=1).astype(np.int64).ravel()
    felt = np.repeat(np.tile([1.0, 0.0], len(x)), counts)
    cell = np.repeat(np.repeat(np.arange(len(x)), 2), counts)
    design = np.column_stack([np.ones(len(cell)), (x[cell] - center) / width])
    persons = int(person.max()) + 1
    member = csr_matrix(
        (np.ones(len(cell)), (np.arange(len(cell)), person[cell])), shape=(len(cell), persons)
    )
    model = BinomialBayesMixedGLM(
        felt, design, member, np.zeros(persons, dtype=int), vcp_p=1.0, fe_p=10.0
    )
    # Its own start is drawn from the global generator: no two runs would be the same.
    start = np.concatenate([[0.0, 1.0], np.ones(1), np.zeros(persons)])
    vars(model)["_get_start"] = lambda *_: start
    with warnings.catch_warnings():
        # It judges by its own goal, which rounding may keep it from; what counts is asked below.
        warnings.filterwarnings("ignore", "Laplace fitting did not converge", ConvergenceWarning)
        result = model.fit_map(minim_opts={"maxiter": _STEPS})
    a, b = (float(value) for value in result.fe_mean)
    covariance = np.asarray(result.cov_params())
    left = np.asarray(result.optim_retvals.jac)
    # Rounding may end the search before its own goal: what could still be gained decides.
    if not 0 <= float(left @ covariance @ left) < _STILL_TO_GAIN or not b > 0:
        return None
    covariance = covariance[:2, :2]
    gradient = np.array([-1.0, a / b]) / b
    error = math.sqrt(float(gradient @ covariance @ gradient))
    between = math.exp(float(result.vcp_mean[0])) / b
    values = (center - width * a / b, width * error, width * between)
    return values if all(math.isfinite(value) for value in values) else None
