"""The population of simulated studies, and the source of each of its parameters.

Parameters are stated in [simulation] of the study, estimated from a pilot, or taken from the
literature where the study states none.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.codes import AnalysisWarning, WarningCode
from analysis.planning.estimates import draw_difference_spread, draw_group
from analysis.thresholds.group import MIN_PEOPLE as FEW
from analysis.thresholds.people import as_amplitudes, as_named, people_of
from experiment.perception.answers import answer_probabilities
from experiment.study.simulation import CURVE_KEYS
from experiment.study.threshold import threshold_vpp
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from analysis.planning.goals import Goal
    from analysis.reading.trials import LoadedTrials
    from analysis.thresholds.people import PersonCounts
    from experiment.perception.gains import FingerGains
    from experiment.study.simulation import Simulation
    from experiment.study.study import Study

SPREAD: Final = "threshold_sd_db"
DIFFERENCE_SPREAD: Final = "difference_sd_db"
_FROM_STUDY: Final = "stated in the study"
_DEFAULT: Final = "default of tactstrip"
_PAPER_VPP: Final = "that of the paper's plate, which may not be yours"
_NO_SOURCE: Final = "assumed without a source"
_GRUND: Final = "Grund et al. 2022, electrical pulses (docs/model.md, section 4)"
_LITERATURE: Final[dict[str, tuple[float, str]]] = {
    SPREAD: (3.0, _NO_SOURCE),
    "sigma": (0.1, _NO_SOURCE),
    "sigma_spread": (0.4, _NO_SOURCE),
    DIFFERENCE_SPREAD: (1.0, _NO_SOURCE),
    "false_alarm_rate": (0.06, _GRUND),
}
_LITERATURE_WITH_NONE: Final[dict[str, tuple[float, str]]] = {
    "block_drift_db": (1.1, _GRUND),
    "wander_db": (1.4, _GRUND),
    "wander_trials": (11.0, _GRUND),
    "last_answer_db": (0.35, _GRUND),
}
"""The same where "none" can be answered: forced choice need not follow."""
_ALWAYS_LISTED: Final = (
    "threshold_um",
    "threshold_vpp",
    SPREAD,
    "sigma",
    "lapse_rate",
    "false_alarm_rate",
)
_DECIDED_BY_GOAL: Final = "difference_db"
_FALSE_ALARM_KEYS: Final = (
    "lapse_rate",
    "false_alarm_rate",
    "reaction_time_s",
    "reaction_time_spread",
    "min_reaction_time_s",
    "reaction_time_slowing",
)
"""Keys that false alarms depend on; no threshold does, as nothing is presented."""
_NONE_KEYS: Final = ("false_alarm_rate", "last_answer_db")
"""Keys that matter only where participants may answer "none"."""
_MIN_VPP, _MAX_VPP = 0.1, 1000.0
_VOLTS: Final = re.compile(r"V(pp|\b)")
_MAX_SIGMA: Final = 0.5
"""Log10 units, 10 dB: hardly anybody has a wider function."""
_MAX_SPREAD_DB: Final = 20.0
_DRAWS: Final = 400
_SIGMA_SPREAD: Final = 0.4
"""SD of ln sigma between people: the middle one of the group's fit."""
_NODES: Final = 31


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A parameter of the population: its key in [simulation], its value, and its source."""

    key: str
    value: float
    source: str

    @property
    def text(self) -> str:
        """The parameter as it would stand in the study."""
        return f"{self.key} = {self.value:.4g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class People:
    """The population that simulated studies draw participants from.

    `study` has it in [simulation]; `parameters` are those that the goal depends on; `draws` are
    values that take turns from study to study, as a pilot leaves them open; `unit` is that of the
    levels.
    """

    study: Study
    parameters: tuple[Parameter, ...]
    draws: tuple[dict[str, float], ...] = ()
    warnings: tuple[AnalysisWarning, ...] = ()
    unit: str = "V"


def stated_people(study: Study, goal: Goal) -> People:
    """Return the population that a study states; it must state how much people differ."""
    required = {SPREAD: "thresholds"} if goal.kind != "false-alarms" else {}
    if goal.kind == "difference":
        required[DIFFERENCE_SPREAD] = "differences between the conditions"
    for key, quantity in required.items():
        if key not in study.simulation.model_fields_set:
            raise ValueError(
                f"simulation.{key}: is required, the standard deviation of {quantity} between "
                "people in dB: set it in the study, or use --pilot DIR or --people literature"
            )
    return People(
        study=study,
        parameters=_parameters(study, goal, study, {}),
        warnings=_sigma_warnings(study),
    )


def literature_people(study: Study, goal: Goal) -> People:
    """Return the stated population, completed by the literature or by assumptions."""
    values = dict(_LITERATURE)
    if "none" in study.design.responses:
        values |= _LITERATURE_WITH_NONE
    taken = {k: v for k, v in values.items() if k not in study.simulation.model_fields_set}
    changed = _with_population(study, {key: value for key, (value, _) in taken.items()})
    parameters = _parameters(changed, goal, study, taken)
    assumed = [parameter.key for parameter in parameters if parameter.source == _NO_SOURCE]
    warnings = _sigma_warnings(study)
    if assumed:
        message = f"set {', '.join(assumed)} in [simulation], or use --pilot: they have no source"
        warnings = (*warnings, AnalysisWarning(WarningCode.VALUES_ASSUMED, message))
    return People(study=changed, parameters=parameters, warnings=warnings)


def _with_population(study: Study, values: dict[str, float]) -> Study:
    return study.changed(simulation=study.simulation.model_dump(exclude_unset=True) | values)


def _sigma_warnings(study: Study) -> tuple[AnalysisWarning, ...]:
    """Warn of a width that is more likely one in dB, as reports on levels in dB have it."""
    if (sigma := study.simulation.sigma) <= _MAX_SIGMA:
        return ()
    message = (
        f"simulation.sigma = {sigma:g} is in log10 units, {20 * sigma:g} dB: if it comes from a "
        f"report on levels in dB, write a twentieth of it, {sigma / 20:.3g}"
    )
    return (AnalysisWarning(WarningCode.SIGMA_TOO_WIDE, message),)


def pilot_people(study: Study, goal: Goal, loaded: LoadedTrials, folder: str) -> People:
    """Return the population that a pilot shows: draws of its posterior take turns.

    Threshold, spread and slope come from the fit of its group, false alarms from its blanks, the
    spread of differences from people with both conditions; the rest is stated in the study.
    """
    axis, trials = loaded.axis, as_named(loaded.trials, [c.name for c in study.conditions])
    if loaded.cells is not None or axis.x_scale == "linear":
        what = "a table of counts" if loaded.cells is not None else f"{axis.unit}, {axis.x_scale}"
        raise ValueError(
            f"--pilot must hold trials, with levels on an axis log10 or dB; got {what} in "
            f"{folder}: otherwise set threshold_vpp, threshold_sd_db and, for a difference, "
            "difference_sd_db in [simulation] (docs/power.md, 2)"
        )
    people, unit = as_amplitudes(people_of(trials, loaded.alternatives), axis)
    unit_warnings = _check_unit(study, unit, people, folder)
    conditions = sorted({condition for condition, _ in people.names})
    name = study.conditions[0].name
    name = name if name in conditions or len(conditions) != 1 else conditions[0]
    rows = [i for i, (condition, _) in enumerate(people.names) if condition == name]
    if len(rows) < 2:  # noqa: PLR2004
        raise ValueError(
            f"--pilot must hold two people or more in condition {name}; got {len(rows)} in "
            f"{folder}, with condition {', '.join(conditions)}"
        )
    draws = _pilot_draws(people.at(rows), trials, name)
    numbers = dict.fromkeys(draws[0], len(rows))
    if goal.kind == "difference":
        spreads, numbers[DIFFERENCE_SPREAD] = _difference_spreads(study, people, folder)
        for draw, spread_db in zip(draws, spreads, strict=False):
            draw[DIFFERENCE_SPREAD] = spread_db
    taken = {
        key: (
            float(np.median([draw[key] for draw in draws])),
            f"pilot of {numbers[key]} people in {folder}, median of {_DRAWS} draws",
        )
        for key in draws[0]
    }
    # A pilot's threshold is that of this very burst, in volts.
    medians = dict.fromkeys(("threshold_um", *CURVE_KEYS)) | {k: v for k, (v, _) in taken.items()}
    changed = _with_population(study, medians)  # type: ignore[arg-type] # None removes a key
    warnings = unit_warnings
    if (number := min(numbers.values())) < FEW:
        message = (
            f"a pilot of {number} people says little about how much people differ: with fewer than "
            f"{FEW} the spread comes mostly from the prior"
        )
        warnings = (AnalysisWarning(WarningCode.PILOT_TOO_SMALL, message), *warnings)
    return People(
        study=changed,
        parameters=_parameters(changed, goal, study, taken),
        draws=tuple(draws),
        warnings=warnings,
        unit=unit if unit_warnings else "V",
    )


def _check_unit(
    study: Study, unit: str, people: PersonCounts, folder: str
) -> tuple[AnalysisWarning, ...]:
    """Warn where levels have another unit than volts; reject levels that cannot be compared.

    Only ratios of levels count, so the study's levels are read in the unit of the pilot.
    """
    if _VOLTS.match(unit):
        return ()
    tested = people.level_vpp[people.presented > 0]
    low, high = float(tested.min()), float(tested.max())
    levels = study.design.levels_vpp
    hint = "[scale] level_vpp in its map multiplies them, as only ratios count"
    if not _MIN_VPP <= low <= high <= _MAX_VPP:
        raise ValueError(
            f"--pilot must have levels from {_MIN_VPP:g} to {_MAX_VPP:g}; got {low:g} to {high:g} "
            f"{unit} in {folder}: {hint}"
        )
    if max(levels) < low or min(levels) > high:
        raise ValueError(
            f"design.levels_vpp must be in {unit}, as the levels of --pilot, {low:g} to {high:g} "
            f"in {folder}; got {min(levels):g} to {max(levels):g}: {hint}"
        )
    message = f"levels of {folder} are read as {unit}, and so are those of the study"
    return (AnalysisWarning(WarningCode.PILOT_UNIT, message),)


def _difference_spreads(study: Study, people: PersonCounts, folder: str) -> tuple[list[float], int]:
    """Return draws of the SD of differences, and the number of people; none if it is stated."""
    a, b = (condition.name for condition in study.conditions[:2])
    rows = {name: i for i, name in enumerate(people.names)}
    both = [who for condition, who in people.names if condition == a and (b, who) in rows]
    if len(both) < 2:  # noqa: PLR2004
        if DIFFERENCE_SPREAD in study.simulation.model_fields_set:
            return [], FEW
        raise ValueError(
            f"simulation.{DIFFERENCE_SPREAD}: is required, or --pilot must hold two people or more "
            f"in both conditions {a} and {b}; got {len(both)} in {folder}"
        )
    of_a, of_b = (people.at([rows[name, who] for who in both]) for name in (a, b))
    spreads = draw_difference_spread(of_a, of_b, _DRAWS)
    return np.minimum(spreads, _MAX_SPREAD_DB).tolist(), len(both)


def _pilot_draws(people: PersonCounts, trials: pd.DataFrame, name: str) -> list[dict[str, float]]:
    rng = np.random.default_rng(0)
    middle, spread, log_sigma = draw_group(people, _DRAWS, rng)
    blank = trials[
        trials["kind"].eq("blank") & trials["condition"].eq(name) & trials["reason"].eq("")
    ]
    alarms = int(blank["response"].isin(LEFT_RIGHT_BOTH.named_answers).sum())
    rates = rng.beta(0.5 + alarms, 0.5 + len(blank) - alarms, _DRAWS)
    columns = {
        "threshold_vpp": np.clip(10**middle, _MIN_VPP, _MAX_VPP),
        SPREAD: np.minimum(20 * spread, _MAX_SPREAD_DB),
        "sigma": np.minimum(np.exp(log_sigma), 10),
        "sigma_spread": np.full(_DRAWS, _SIGMA_SPREAD),
    }
    if len(blank):
        columns["false_alarm_rate"] = rates
    return [{key: float(values[i]) for key, values in columns.items()} for i in range(_DRAWS)]


def _parameters(
    study: Study, goal: Goal, original: Study, taken: dict[str, tuple[float, str]]
) -> tuple[Parameter, ...]:
    """Return the parameters that a goal depends on; `taken` are those that `original` lacks."""
    given = original.simulation.model_fields_set - taken.keys()
    defaults = {"threshold_vpp": _PAPER_VPP} | {key: source for key, (_, source) in taken.items()}
    return tuple(
        Parameter(
            key=key,
            value=float(value),
            source=_FROM_STUDY if key in given else defaults.get(key, _DEFAULT),
        )
        for key, value in study.simulation.model_dump().items()
        if (key in _ALWAYS_LISTED or key in given or key in taken)
        and isinstance(value, int | float)
        and _matters(goal, key, study.design.responses)
    )


def _matters(goal: Goal, key: str, responses: tuple[str, ...]) -> bool:
    """Return whether the answer to a goal depends on a key of [simulation]."""
    if key in _NONE_KEYS and "none" not in responses:
        return False
    if goal.kind == "false-alarms":
        return key in _FALSE_ALARM_KEYS
    return key != _DECIDED_BY_GOAL and (key != DIFFERENCE_SPREAD or goal.kind == "difference")


def truth_of(goal: Goal, population: Simulation, study: Study, gains: FingerGains) -> float:
    """Return what an analysis of endless data would find for a goal.

    log10 of the threshold, dB, or a probability, the mean over people whose thresholds differ.
    """
    if goal.kind == "half-width":
        return math.log10(threshold_vpp(population, gains))
    if goal.kind == "difference":
        return goal.size
    responses = study.design.responses

    def probabilities(levels: tuple[float, float], db: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(
            answer_probabilities(
                [population.median],
                levels,
                responses,
                study.design.response_window_s,
                gains=gains,
                shift_db=(db, db),
            )[0]
        )

    if goal.kind == "false-alarms":
        (shares,) = probabilities((0.0, 0.0), np.zeros(1))
        return float(sum(p for name, p in zip(responses, shares, strict=True) if name != "none"))
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    shifts_db, level_vpp = population.threshold_sd_db * nodes, goal.level_vpp or 0.0
    left = probabilities((level_vpp, 0.0), shifts_db)[:, responses.index("left")]
    right = probabilities((0.0, level_vpp), shifts_db)[:, responses.index("right")]
    return float((left + right) / 2 @ weights / weights.sum())
