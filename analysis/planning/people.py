"""The population of simulated studies, and the source of each of its parameters.

Parameters are stated in [simulation] of the study, estimated from a pilot, or taken from the
literature where the study states none.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.axis import VOLTS
from analysis.codes import AnalysisWarning, WarningCode
from analysis.counts.table import counted, felt_answers
from analysis.task_columns import task_of
from analysis.thresholds.difference import difference_spread_draws
from analysis.thresholds.group import MIN_PEOPLE, population_draws
from analysis.thresholds.tables import tables_of
from experiment.perception.answers import answer_probabilities
from experiment.study.simulation import CURVE_KEYS
from experiment.study.threshold import threshold_vpp
from experiment.tasks.task import BLANK, SINGLE

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    import pandas as pd
    from numpy.typing import NDArray

    from analysis.planning.goals import Goal
    from analysis.reading.trials import LoadedTrials
    from analysis.thresholds.likelihood import Tables
    from experiment.perception.gains import FingerGains
    from experiment.study.simulation import Simulation
    from experiment.study.study import Study

    Floats = NDArray[np.float64]

SPREAD: Final = "threshold_sd_db"
DIFFERENCE_SPREAD: Final = "difference_sd_db"
_FROM_STUDY: Final = "stated in the study"
_DEFAULT: Final = "default of tactstrip"
_PAPER_VPP: Final = "that of the paper's plate, which may not be yours"
_NO_SOURCE: Final = "assumed without a source"
_GRUND: Final = "Grund et al. 2022, electrical pulses (docs/explanation/simulated-people.md)"
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
    *("threshold_um", "threshold_vpp", SPREAD, "sigma", "lapse_rate", "false_alarm_rate"),
)
_DECIDED_BY_GOAL: Final = "difference_db"
_FALSE_ALARM_KEYS: Final = (
    *("lapse_rate", "false_alarm_rate", "reaction_time_s", "reaction_time_spread"),
    *("min_reaction_time_s", "reaction_time_slowing"),
)
"""Keys that false alarms depend on; no threshold does, as nothing is presented."""
_NONE_KEYS: Final = ("false_alarm_rate", "last_answer_db")
"""Keys that matter only where participants may answer "none"."""
_MIN_VPP, _MAX_VPP = 0.1, 1000.0
_VOLTS: Final = re.compile(r"V(pp|\b)")
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
    return _people(study, goal, {})


def literature_people(study: Study, goal: Goal) -> People:
    """Return the stated population, completed by the literature or by assumptions."""
    values = dict(_LITERATURE)
    if study.task.nothing in study.design.responses:
        values |= _LITERATURE_WITH_NONE
    return _people(study, goal, values)


def _people(study: Study, goal: Goal, values: dict[str, tuple[float, str]]) -> People:
    """Return the stated population, completed by values with their sources."""
    set_keys = study.simulation.model_fields_set
    missing = {key: value for key, value in values.items() if key not in set_keys}
    completed = _with_population(study, {key: value for key, (value, _) in missing.items()})
    parameters = _parameters(completed, goal, set_keys, missing)
    warnings: tuple[AnalysisWarning, ...] = ()
    if assumed := [each.key for each in parameters if each.source == _NO_SOURCE]:
        message = f"set {', '.join(assumed)} in [simulation], or use --pilot: they have no source"
        warnings = (AnalysisWarning(WarningCode.VALUES_ASSUMED, message),)
    return People(study=completed, parameters=parameters, warnings=warnings)


def _with_population(study: Study, values: Mapping[str, float | None]) -> Study:
    return study.changed(simulation=study.simulation.model_dump(exclude_unset=True) | {**values})


def pilot_people(study: Study, goal: Goal, loaded: LoadedTrials, folder: str) -> People:
    """Return the population that a pilot shows: draws of its posterior take turns.

    Threshold, spread and slope come from the fit of its group, false alarms from its blanks, the
    spread of differences from people with both conditions; the rest is stated in the study.
    """
    axis, trials = loaded.axis, loaded.trials
    if loaded.cells is not None or axis.x_scale == "linear":
        what = "a table of counts" if loaded.cells is not None else f"{axis.unit}, {axis.x_scale}"
        raise ValueError(
            f"--pilot must hold trials, with levels on an axis log10 or dB; got {what} in "
            f"{folder}: otherwise set threshold_vpp, threshold_sd_db and, for a difference, "
            "difference_sd_db in [simulation] (docs/power.md, 2)"
        )
    people, unit = tables_of(trials, axis=axis, alternatives=loaded.alternatives), axis.unit
    if axis.x_scale == "dB":  # the study's levels are amplitudes
        people = replace(people, levels=100 * 10 ** (people.levels / 20), axis=VOLTS)
        unit = f"% of 0 {unit}"
    warnings = _check_unit(study, unit, people, folder)
    conditions, name = people.conditions, study.conditions[0].name
    name = name if name in conditions or len(conditions) != 1 else next(iter(conditions))
    number = len(conditions.get(name, ()))
    if number < 2:  # noqa: PLR2004
        raise ValueError(
            f"--pilot must hold two people or more in condition {name}; got {number} in "
            f"{folder}, with condition {', '.join(conditions)}"
        )
    draws = _pilot_draws(conditions[name], counted(trials, BLANK), name)
    numbers = dict.fromkeys(draws, number)
    if goal.kind == "difference":
        pairs = _pairs(study, people)
        if len(pairs[0]) >= 2:  # noqa: PLR2004 - one person has no spread
            a, b = map(people.at, pairs)
            spreads_db = difference_spread_draws(a, b, _DRAWS, np.random.default_rng(1))
            draws[DIFFERENCE_SPREAD] = np.minimum(spreads_db, _MAX_SPREAD_DB)
            numbers[DIFFERENCE_SPREAD] = len(pairs[0])
        elif DIFFERENCE_SPREAD not in study.simulation.model_fields_set:
            raise ValueError(
                f"simulation.{DIFFERENCE_SPREAD}: is required, or --pilot must hold two people or "
                f"more in both of the first two conditions; got {len(pairs[0])} in {folder}"
            )
    taken = {
        key: (
            float(np.median(values)),
            f"pilot of {numbers[key]} people in {folder}, median of {_DRAWS} draws",
        )
        for key, values in draws.items()
    }
    # A pilot's threshold is that of this very burst, in volts.
    medians = dict.fromkeys(("threshold_um", *CURVE_KEYS)) | {k: v for k, (v, _) in taken.items()}
    completed = _with_population(study, medians)
    if (number := min(numbers.values())) < MIN_PEOPLE:
        message = (
            f"a pilot of {number} people says little about how much people differ: with fewer than "
            f"{MIN_PEOPLE} the spread comes mostly from the prior"
        )
        warnings.insert(0, AnalysisWarning(WarningCode.PILOT_TOO_SMALL, message))
    return People(
        study=completed,
        parameters=_parameters(completed, goal, study.simulation.model_fields_set, taken),
        draws=tuple(
            dict(zip(draws, values, strict=True))
            for values in np.column_stack(list(draws.values())).tolist()
        ),
        warnings=tuple(warnings),
        unit="V" if _VOLTS.match(unit) else unit,
    )


def _check_unit(study: Study, unit: str, people: Tables, folder: str) -> list[AnalysisWarning]:
    """Warn where levels have another unit than volts; reject levels that cannot be compared.

    Only ratios of levels count, so the study's levels are read in the unit of the pilot.
    """
    if _VOLTS.match(unit):
        return []
    levels, (low, high) = study.design.levels_vpp, people.tested[[0, -1]].tolist()
    is_apart = max(levels) < low or min(levels) > high
    if is_apart or low < _MIN_VPP or high > _MAX_VPP:
        raise ValueError(
            f"--pilot must have levels from {_MIN_VPP:g} to {_MAX_VPP:g}, in the unit of "
            f"design.levels_vpp, {min(levels):g} to {max(levels):g}; got {low:g} to {high:g} "
            f"{unit} in {folder}: [scale] level_vpp in its map multiplies them, as only ratios "
            "count"
        )
    message = f"levels of {folder} are read as {unit}, and so are those of the study"
    return [AnalysisWarning(WarningCode.PILOT_UNIT, message)]


def _pairs(study: Study, people: Tables) -> tuple[list[int], list[int]]:
    """Return the rows of people with both of the first two conditions, one list for each."""
    a, b = (condition.name for condition in study.conditions[:2])
    row_of = {name: row for row, name in enumerate(people.names)}
    both = [who for condition, who in people.names if condition == a and (b, who) in row_of]
    return [row_of[a, who] for who in both], [row_of[b, who] for who in both]


def _pilot_draws(people: Tables, blanks: pd.DataFrame, name: str) -> dict[str, Floats]:
    """Return draws of each parameter from the posterior of a pilot's condition."""
    rng = np.random.default_rng(0)
    middle, spread, log_sigma = population_draws(people, _DRAWS, rng)
    answers = blanks.loc[blanks["condition"].eq(name), "response"]
    alarms = int(answers.isin(felt_answers(task_of(blanks))).sum())
    rates = rng.beta(0.5 + alarms, 0.5 + len(answers) - alarms, _DRAWS)
    draws = {
        "threshold_vpp": np.clip(10**middle, _MIN_VPP, _MAX_VPP),
        SPREAD: np.minimum(20 * spread, _MAX_SPREAD_DB),
        "sigma": np.minimum(np.exp(log_sigma), 10),
        "sigma_spread": np.full(_DRAWS, _SIGMA_SPREAD),
    }
    return draws | ({"false_alarm_rate": rates} if len(answers) else {})


def _parameters(
    study: Study, goal: Goal, set_keys: Collection[str], taken: Mapping[str, tuple[float, str]]
) -> tuple[Parameter, ...]:
    """Return the parameters that a goal depends on; the study sets the others or has defaults."""
    sources = {"threshold_vpp": _PAPER_VPP} | dict.fromkeys(set_keys, _FROM_STUDY)
    sources |= {key: source for key, (_, source) in taken.items()}
    return tuple(
        Parameter(key=key, value=float(value), source=sources.get(key, _DEFAULT))
        for key, value in study.simulation.model_dump().items()
        if (key in _ALWAYS_LISTED or key in set_keys or key in taken)
        and isinstance(value, int | float)
        and _matters(goal, key, study)
    )


def _matters(goal: Goal, key: str, study: Study) -> bool:
    """Return whether the answer to a goal depends on a key of [simulation]."""
    if key in _NONE_KEYS and study.task.nothing not in study.design.responses:
        return False
    if goal.kind == "false-alarms":
        return key in _FALSE_ALARM_KEYS
    return key != _DECIDED_BY_GOAL and (key != DIFFERENCE_SPREAD or goal.kind == "difference")


def truth_of(goal: Goal, population: Simulation, study: Study, gains: FingerGains) -> float:
    """Return what an analysis of endless data would find for a goal.

    The threshold in Vpp, dB, or a probability, the mean over people whose thresholds differ.
    """
    if goal.kind == "half-width":
        return threshold_vpp(population, gains)
    if goal.kind == "difference":
        return goal.size
    task, responses, level_vpp = study.task, study.design.responses, goal.level_vpp or 0.0
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    shifts_db = population.threshold_sd_db * nodes
    kind = BLANK if goal.kind == "false-alarms" else SINGLE
    means = []
    for shown in task.of_kind(kind):
        shares = answer_probabilities(
            [population.median],
            task.levels_vpp(shown.name, level_vpp),
            responses,
            study.design.response_window_s,
            gains=gains,
            shift_db=(shifts_db,),
            task=task,
        )[0]
        is_counted = [task.is_detected(shown.name, response) for response in responses]
        means.append(shares[:, is_counted].sum(axis=1) @ weights / weights.sum())
    return float(np.mean(means))
