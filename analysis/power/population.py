"""The people of a study to come: what is stated of them, and where every number is from."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.codes import AnalysisWarning, WarningCode
from analysis.groups.draws import difference_spread_draws, group_draws
from analysis.groups.hierarchy import FEW, PeopleTables
from analysis.thresholds.people import as_amplitudes, as_named, people_of
from experiment.perception.answers import answer_probabilities
from experiment.study.simulation import CURVE_KEYS
from experiment.study.threshold import dry_run_difference_db, threshold_vpp

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    import pandas as pd

    from analysis.power.goals import Goal
    from analysis.reading.load import LoadedTrials
    from analysis.thresholds.people import PersonCounts
    from experiment.perception.gains import ConditionGains, FingerGains
    from experiment.study.simulation import Simulation
    from experiment.study.study import Study


ASSUMED: Final = "assumed by tactstrip"
SPREAD: Final = "threshold_sd_db"
DIFFERENCE_SPREAD: Final = "difference_sd_db"
_NODES: Final = 31
_ALWAYS: Final = (
    "threshold_um",
    "threshold_vpp",
    SPREAD,
    "sigma",
    "lapse_rate",
    "false_alarm_rate",
)
_OF_DIFFERENCE: Final = ("difference_db",)
"""Keys that the goal decides on, and the study does not."""
_OF_BLANKS: Final = (
    "lapse_rate",
    "false_alarm_rate",
    "reaction_time_s",
    "reaction_time_spread",
    "min_reaction_time_s",
    "reaction_time_slowing",
)
"""Keys that false alarms hang on: nothing is felt, so no threshold."""
_LEAST_VPP, _MOST_VPP = 0.1, 1000.0
_VOLTS: Final = re.compile(r"V(pp|\b)")
_OF_NONE: Final = ("false_alarm_rate", "last_answer_db")
"""Keys that only tell of people who may answer "none"."""
_GRUND: Final = "Grund et al. 2022, electrical pulses, docs/model.md, section 4"
_NOBODYS: Final = "assumed: no source was found"
LITERATURE: Final[dict[str, tuple[float, str]]] = {
    SPREAD: (3.0, _NOBODYS),
    "sigma": (0.1, "assumed: the middle of what the analysis expects"),
    "sigma_spread": (0.4, _NOBODYS),
    DIFFERENCE_SPREAD: (1.0, _NOBODYS),
    "false_alarm_rate": (0.06, _GRUND),
}
"""What is taken of people of whom nothing is stated, with its source."""
_WITH_NONE: Final[dict[str, tuple[float, str]]] = {
    "block_drift_db": (1.1, _GRUND),
    "wander_db": (1.4, _GRUND),
    "wander_trials": (11.0, _GRUND),
    "last_answer_db": (0.35, _GRUND),
}
"""The same where "none" can be answered: forced choice need not follow."""
_WIDEST: Final = 0.5
"""Width, log10 units, that hardly anybody has: 10 dB."""
_DRAWS: Final = 400
"""Of a pilot's posterior."""
_OMEGA: Final = 0.4
"""Of ln sigma between people: the middle one of the group's fit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """A number of the population: its key in [simulation], its value, and its source.

    `dry_run` is what a dry run of the study's file has instead, or has as well; none where it has
    no such number.
    """

    key: str
    value: float
    source: str
    dry_run: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class People:
    """Whom the simulated studies draw from.

    Attributes
    ----------
    study : Study
        With the population in its [simulation].
    file : Study
        As its file has it, of whose people a dry run is.
    whose : str
        Whose people these are, in words.
    numbers : tuple of Stated
        Those that the goal hangs on.
    draws : tuple of dict
        Keys of [simulation] that take turns from study to study; none where they are known.
    warnings : tuple of AnalysisWarning
    unit : str
        Of the levels: V, or that of a pilot.
    """

    study: Study
    file: Study
    whose: str
    numbers: tuple[Stated, ...]
    draws: tuple[dict[str, float], ...] = ()
    warnings: tuple[AnalysisWarning, ...] = ()
    unit: str = "V"

    def words(self, goal: Goal, gains: Sequence[ConditionGains]) -> str:
        """Say whose people these are, and which of their numbers a dry run of the file has not."""
        others = [
            f"{one.key} {_or_none(one.dry_run)} (here {one.value:.4g})"
            for one in self.numbers
            if one.dry_run != one.value
        ]
        copied = "; with the numbers below in [simulation] it has these" * bool(others)
        if goal.kind == "difference":
            own_db = dry_run_difference_db(self.file, gains)
            if round(abs(own_db), 1) != round(goal.size, 1):
                one, other = (condition.name for condition in self.file.conditions[:2])
                others.append(
                    f"a difference of {own_db:+.1f} dB from {one} to {other} (here {goal.size:g}, "
                    "the goal's)"
                )
        if not others:
            return f"They are {self.whose}, and a dry run of this file has the same."
        told = f"A dry run of this file has others: {', '.join(others)}{copied}."
        return f"They are {self.whose}. {told}"


def _or_none(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"


def stated_people(study: Study, goal: Goal) -> People:
    """Return the people that a study states; refuse it without what everything hangs on."""
    needed = [SPREAD] + [DIFFERENCE_SPREAD] * (goal.kind == "difference")
    keys = study.simulation.model_fields_set
    for key in needed if goal.kind != "false-alarms" else ():
        if key not in keys:
            raise ValueError(
                f"simulation.{key}: is required, {_MEANT[key]}, in dB: set it in the study, or use "
                f"--pilot DIR or --people literature{_IF_UNKNOWN[key]}"
            )
    numbers, warnings = _numbers(study, goal, study, {}), (*_wide(study),)
    return People(study=study, file=study, whose="the study's", numbers=numbers, warnings=warnings)


def _wide(study: Study) -> Iterator[AnalysisWarning]:
    """Warn of a width that is more likely one in dB, as a report on levels in dB tells it."""
    if (sigma := study.simulation.sigma) > _WIDEST:
        message = (
            f"simulation.sigma = {sigma:g} is in log10 units, {20 * sigma:g} dB: if it is the "
            f"sigma of a report whose levels are in dB, write a twentieth of it, {sigma / 20:.3g}"
        )
        yield AnalysisWarning(WarningCode.SIGMA_TOO_WIDE, message)


_IF_UNKNOWN: Final = {
    SPREAD: "; if nobody knows it, take 3, and see what 2 and 4 would need",
    DIFFERENCE_SPREAD: "",
}
_MEANT: Final = {
    SPREAD: "how much thresholds differ between people",
    DIFFERENCE_SPREAD: "how much the difference itself differs between people",
}


def literature_people(study: Study, goal: Goal) -> People:
    """Return people as the literature has them, where the study does not state them."""
    keys = study.simulation.model_fields_set
    known = LITERATURE | (_WITH_NONE if "none" in study.design.responses else {})
    taken = {key: told for key, told in known.items() if key not in keys}
    section = study.simulation.model_dump(exclude_unset=True) | {
        key: value for key, (value, _) in taken.items()
    }
    changed = study.changed(simulation=section)
    numbers = _numbers(changed, goal, study, dict(taken))
    assumed = [one.key for one in numbers if taken.get(one.key, ("", ""))[1].startswith("assumed")]
    return People(
        study=changed,
        file=study,
        whose="the literature's where the study states none",
        numbers=numbers,
        warnings=(_without_source(assumed),) if assumed else (),
    )


def _without_source(keys: Iterable[str]) -> AnalysisWarning:
    message = (
        f"of {', '.join(keys)} no source was found: the answer is no better than they are; state "
        "them in [simulation], or run a pilot"
    )
    return AnalysisWarning(WarningCode.VALUES_ASSUMED, message)


def pilot_people(study: Study, goal: Goal, loaded: LoadedTrials, where: str) -> People:
    """Return people as a pilot's group tells them: draws of its posterior take turns.

    Threshold, spread and slope are the group fit's; false alarms those of the pilot's blanks; how
    much differences differ is that of people with both conditions; the rest is what the study has.
    """
    axis, trials = loaded.axis, as_named(loaded.trials, [one.name for one in study.conditions])
    if loaded.cells is not None or axis.x_scale == "linear":
        what = "a table of counts" if loaded.cells is not None else f"{axis.unit}, {axis.x_scale}"
        raise ValueError(
            f"--pilot must hold trials, with levels on an axis log10 or dB; got {what} in {where}: "
            "else state threshold_vpp, threshold_sd_db and, for a difference, difference_sd_db "
            "under [simulation], as the report tells them (docs/power.md, 2)"
        )
    people, unit = as_amplitudes(people_of(trials, loaded.alternatives), axis)
    in_its_unit = _in_its_unit(study, unit, people, where)
    conditions = sorted({condition for condition, _ in people.names})
    name = study.conditions[0].name
    name = name if name in conditions or len(conditions) != 1 else conditions[0]
    rows = [i for i, (condition, _) in enumerate(people.names) if condition == name]
    if len(rows) < 2:  # noqa: PLR2004
        raise ValueError(
            f"--pilot must hold two people or more in condition {name}; got {len(rows)} in "
            f"{where}, with condition {', '.join(conditions)}"
        )
    of = f" in condition {name}" * (len(conditions) > 1)
    draws = _pilot_draws(people.at(rows), trials, name)
    number = dict.fromkeys(draws[0], len(rows))
    if goal.kind == "difference":
        spreads, number[DIFFERENCE_SPREAD] = _difference_spreads(study, people, where)
        for one, spread in zip(draws, spreads, strict=False):
            one[DIFFERENCE_SPREAD] = spread
    source = "pilot of {} people in {}, median of {} draws"
    told = {
        key: (
            float(np.median([one[key] for one in draws])),
            source.format(number[key], where, _DRAWS),
        )
        for key in draws[0]
    }
    section = study.simulation.model_dump(exclude_unset=True) | _KNOWN_ELSEWHERE
    changed = study.changed(simulation=section | {key: value for key, (value, _) in told.items()})
    return People(
        study=changed,
        file=study,
        whose=f"those of the pilot in {where}{of}, and else the study's",
        numbers=_numbers(changed, goal, study, told),
        draws=tuple(draws),
        warnings=(*_few(min(number.values())), *in_its_unit),
        unit=unit if in_its_unit else "V",
    )


def _in_its_unit(
    study: Study, unit: str, people: PersonCounts, where: str
) -> tuple[AnalysisWarning, ...]:
    """Say that the study's levels are taken as the pilot's are, in another unit than volts.

    Only ratios of levels count. Refuse a study whose levels are not among the pilot's.
    """
    if _VOLTS.match(unit):
        return ()
    shown = people.level_vpp[people.presented > 0]
    low, high = float(shown.min()), float(shown.max())
    levels = study.design.levels_vpp
    scale = "[scale] level_vpp in its map multiplies them, as only ratios count"
    if not _LEAST_VPP <= low <= high <= _MOST_VPP:
        span = f"{_LEAST_VPP:g} to {_MOST_VPP:g}; got {low:g} to {high:g} {unit} in {where}"
        raise ValueError(f"--pilot must have levels from {span}: {scale}")
    if max(levels) < low or min(levels) > high:
        told = f"{low:g} to {high:g} in {where}; got {min(levels):g} to {max(levels):g}: {scale}"
        raise ValueError(
            f"design.levels_vpp must be in {unit}, as the levels of --pilot, which go from {told}"
        )
    message = f"levels of {where} are read as {unit}, and so are those of the study"
    return (AnalysisWarning(WarningCode.PILOT_UNIT, message),)


_KNOWN_ELSEWHERE: Final = dict.fromkeys(("threshold_um", *CURVE_KEYS))
"""What a pilot's threshold, which is in volts and of this very burst, stands in for."""


def _difference_spreads(study: Study, people: PersonCounts, where: str) -> tuple[list[float], int]:
    """Return draws of how much differences differ, and of how many people; none if it is stated.

    What the pilot tells of it goes before what the study states, as of all else.
    """
    one, other = (condition.name for condition in study.conditions[:2])
    places = {name: i for i, name in enumerate(people.names)}
    both = [who for condition, who in people.names if condition == one and (other, who) in places]
    if len(both) < 2:  # noqa: PLR2004
        if DIFFERENCE_SPREAD in study.simulation.model_fields_set:
            return [], FEW
        raise ValueError(
            f"simulation.{DIFFERENCE_SPREAD} must be stated, {_MEANT[DIFFERENCE_SPREAD]}, in dB, "
            f"or --pilot hold two people or more in both conditions {one} and {other}; got "
            f"{len(both)} in {where}"
        )
    tables = [_tables(people.at([places[name, who] for who in both])) for name in (one, other)]
    spreads = difference_spread_draws(tables[0], tables[1], _DRAWS, np.random.default_rng(1))
    return [float(min(spread, 40)) for spread in spreads], len(both)


def _few(number: int) -> tuple[AnalysisWarning, ...]:
    if number >= FEW:
        return ()
    told = f"a pilot of {number} people tells little of how they differ: with fewer than {FEW}"
    message = f"{told} that is mostly the analysis' prior"
    return (AnalysisWarning(WarningCode.PILOT_TOO_SMALL, message),)


def _tables(people: PersonCounts) -> PeopleTables:
    return PeopleTables(
        x=np.log10(people.level_vpp),
        detected=people.detected,
        presented=people.presented,
        guesses=[one.rate for one in people.guesses],
        x_scale="log10",
    )


def _pilot_draws(people: PersonCounts, trials: pd.DataFrame, name: str) -> list[dict[str, float]]:
    rng = np.random.default_rng(0)
    middle, spread, log_sigma = group_draws(_tables(people), _DRAWS, rng)
    blank = trials[trials["kind"].eq("blank") & trials["condition"].eq(name)]
    blank = blank[blank["reason"].eq("")]
    alarms = int(blank["response"].isin(["left", "right", "both"]).sum())
    rates = rng.beta(0.5 + alarms, 0.5 + len(blank) - alarms, _DRAWS)
    return [
        {
            "threshold_vpp": float(np.clip(10 ** middle[i], _LEAST_VPP, _MOST_VPP)),
            SPREAD: float(min(20 * spread[i], 40)),
            "sigma": float(min(math.exp(log_sigma[i]), 10)),
            "sigma_spread": _OMEGA,
        }
        | ({"false_alarm_rate": float(rates[i])} if len(blank) else {})
        for i in range(_DRAWS)
    ]


def _numbers(
    study: Study, goal: Goal, file: Study, taken: dict[str, tuple[float, str]]
) -> tuple[Stated, ...]:
    """Return the numbers of [simulation] that a goal hangs on, and the source of each.

    `file` is the study as its file has it, and `taken` what was put into it.
    """
    keys = file.simulation.model_fields_set
    return tuple(
        Stated(
            key=key,
            value=float(value),
            source=taken[key][1]
            if key in taken
            else "stated in the study"
            if key in keys
            else ASSUMED,
            dry_run=getattr(file.simulation, key),
        )
        for key, value in study.simulation.model_dump().items()
        if (key in _ALWAYS or key in keys or key in taken)
        and isinstance(value, int | float)
        and _hangs_on(goal, key, study.design.responses)
    )


def _hangs_on(goal: Goal, key: str, responses: tuple[str, ...]) -> bool:
    """Tell whether a goal's answer changes with a key of [simulation], whatever its value."""
    if key in _OF_NONE and "none" not in responses:
        return False
    if goal.kind == "false-alarms":
        return key in _OF_BLANKS
    return key not in _OF_DIFFERENCE and (key != DIFFERENCE_SPREAD or goal.kind == "difference")


def truth_of(goal: Goal, population: Simulation, study: Study, gains: FingerGains) -> float:
    """Return what an analysis of endless data would find for a goal.

    log10 of the threshold, dB, or a probability, the mean over people whose thresholds differ.
    """
    if goal.kind == "half-width":
        return math.log10(threshold_vpp(population, gains))
    if goal.kind == "difference":
        return goal.size
    responses, window_s = study.design.responses, study.design.response_window_s
    median = population.median
    if goal.kind == "false-alarms":
        p = answer_probabilities([median], ([0.0], [0.0]), responses, window_s, gains=gains)[0, 0]
        return float(sum(share for one, share in zip(responses, p, strict=True) if one != "none"))
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    shift_db, level_vpp = population.threshold_sd_db * nodes, goal.level_vpp or 0.0
    felt = [
        answer_probabilities(
            [median], levels, responses, window_s, gains=gains, shift_db=(shift_db, shift_db)
        )[0, :, responses.index(side)]
        for side, levels in (("left", (level_vpp, 0.0)), ("right", (0.0, level_vpp)))
    ]
    return float(np.mean(felt, axis=0) @ weights / weights.sum())
