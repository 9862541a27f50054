"""A study: all sections of a study file, the rules between them, and its canonical text."""

from __future__ import annotations

import hashlib
import json
import math
from datetime import date, time
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any, Final, Self

from pydantic import Field, ValidationInfo, field_validator

from experiment.study.actuator import (
    Actuator,
    FingerLoad,
    complete_actuators,
    distance_rules,
    sites_of,
)
from experiment.study.base import (
    Fault,
    Section,
    StudyError,
    obey,
    rules_below,
)
from experiment.study.dataset import About, Dataset, Participants
from experiment.study.design import ASSUMED_ANSWER_S, Design
from experiment.study.equipment import Contact, DeviceSettings, Masking, MonitorSettings
from experiment.study.levels import LevelChoice
from experiment.study.plate import Plate
from experiment.study.presentation import Keys, Screen, Texts
from experiment.study.simulation import CURVE_KEYS, Simulation
from experiment.study.stimulus import Condition, SharedStimulus, complete_conditions
from experiment.study.task import TaskChoice
from experiment.tasks import SITES

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from experiment.study.base import Rule
    from experiment.tasks.task import Task
    from stimuli import Strip


class Study(Section):
    """Everything that is fixed before the first participant comes.

    `read_study`, `paper_study` and `study_from_text` make one. Its attributes are the sections of a
    study file, each an immutable model; ``model_fields_set`` of a section has the keys that the
    file sets. Sections other than ``[strip]`` and ``[[actuator]]`` can be omitted.

    Attributes
    ----------
    about : About
        Section ``[study]``: the study's name, and the consent of its participants.
    task_choice : TaskChoice
        Section ``[task]``: what the participant is asked; the property `task` is the task.
    plate : Plate
        Section ``[strip]``: the plate; the property `strip` has its physics.
    actuators : tuple of Actuator
        Tables ``[[actuator]]``: one for each site of the task, then those that no session drives.
    finger_load : FingerLoad
        Mechanical impedance of the fingertips.
    burst : SharedStimulus
        What drives the actuators, unless a condition says otherwise.
    conditions : tuple of Condition
        Tables ``[[condition]]``: stimuli, each of which runs the whole design; at least one.
    design : Design
        What is presented, how often, and what may be answered.
    levels : LevelChoice
        Whether levels are drawn before the session or chosen during it.
    device : DeviceSettings
        What drives the actuators, and its limits.
    monitor : MonitorSettings
        What measures each burst.
    masking : Masking
        The masking noise.
    contact : Contact
        How the fingers rest on the plate.
    screen, keys, texts : Screen, Keys, Texts
        The participant's window, keys and texts.
    participants, dataset : Participants, Dataset
        Columns of participants.tsv, and what an exported data set says about itself.
    simulation : Simulation
        The population of simulated participants.

    Raises
    ------
    StudyError
        From the functions that make one: a value out of its range, or two that contradict each
        other.

    Examples
    --------
    Its checksum identifies a study, whatever comments its file has:

    >>> from experiment import paper_study
    >>> study = paper_study()
    >>> study.changed(design={"levels_vpp": [60, 95]}).sha256 == study.sha256
    False
    >>> study.changed().sha256 == study.sha256
    True
    """

    # A section whose defaults depend on another must follow it: pydantic validates in this order.
    about: About = Field(default_factory=About, alias="study")
    task_choice: TaskChoice = Field(default=TaskChoice(), alias="task")
    plate: Plate = Field(alias="strip")
    actuators: tuple[Actuator, ...] = Field(alias="actuator")
    finger_load: FingerLoad = FingerLoad()
    burst: SharedStimulus = SharedStimulus()
    conditions: tuple[Condition, ...] = Field(
        default=(Condition(),), alias="condition", validate_default=True
    )
    design: Design = Field(default=Design(), validate_default=True)
    levels: LevelChoice = LevelChoice()
    device: DeviceSettings = Field(default=DeviceSettings(), validate_default=True)
    monitor: MonitorSettings = Field(default=MonitorSettings(), validate_default=True)
    masking: Masking = Masking()
    contact: Contact = Contact()
    screen: Screen = Screen()
    keys: Keys = Field(default_factory=Keys, validate_default=True)
    texts: Texts = Field(default=Texts(), validate_default=True)
    participants: Participants = Participants()
    dataset: Dataset = Dataset()
    simulation: Simulation = Field(default=Simulation(), validate_default=True)

    @classmethod
    def from_tables(cls, tables: Mapping[str, Any], source: object = "study") -> Self:
        """Return the study of the tables of a TOML file; StudyError has every fault.

        Tables are validated as JSON, where lists are tuples and whole numbers are numbers, so that
        a study file and the study in a plan are read by the same rules.

        Parameters
        ----------
        tables : mapping
            Sections by their names in a study file.
        source : object
            Name of the file, for messages.

        Returns
        -------
        Study

        Raises
        ------
        StudyError
            A value violates a rule.
        """
        try:
            return cls.from_json(json.dumps(_json_values(tables)), source)
        except RecursionError as error:
            raise StudyError(str(source), Fault("", "is nested too deeply")) from error

    @field_validator("actuators", "conditions", "design", "keys", "texts", "simulation")
    @classmethod
    def _complete(cls, section: Any, info: ValidationInfo) -> Any:
        """Fill in what depends on the task or on a section above, unless that has faults."""
        above = info.data
        choice = above.get("task_choice")
        task = choice and choice.task_at(sites_of(above.get("actuators", ())) or SITES)
        match info.field_name:
            case _ if choice is None:  # it has faults of its own
                pass
            case "actuators" if "plate" in above:
                return complete_actuators(section, above["plate"].width_mm, choice)
            case "conditions" if "burst" in above:
                return complete_conditions(section, above["burst"])
            case "design" | "keys":
                return section.with_answers(task)
            case "texts" if "design" in above:
                return section.with_task(task, above["design"])
            case "simulation" if "actuators" in above:
                driven = (each for each in above["actuators"] if each.site is not None)
                return section.with_threshold([actuator.basis for actuator in driven])
        return section

    @field_validator("device", "monitor")
    @classmethod
    def _connect(cls, section: Any, info: ValidationInfo) -> Any:
        """Take the first outputs and inputs for the sites, unless the file names them."""
        key = "channels" if info.field_name == "device" else "inputs"
        sites = sites_of(info.data.get("actuators", ()))
        first = tuple(range(1, len(sites) + 1))
        return section.completed(**{key: getattr(section, key) or first})

    def rules(self) -> Iterator[Rule]:
        """Yield the rules between sections.

        Yields
        ------
        tuple
            Whether a key violates a rule, the key, the rule, and the value.
        """
        device, foreperiod_s = self.device, self.design.foreperiod_s[0]
        for index, actuator in enumerate(self.actuators):
            plate_rules = actuator.plate_rules(self.strip, self.highest_vpp)
            yield from rules_below(plate_rules, actuator, f"actuator[{index}]")
        yield from distance_rules(self.actuators)
        has_load, is_endless = self.finger_load.impedance is not None, self.strip.length_m is None
        rule = "must be a number with [finger_load]"
        yield has_load and is_endless, "strip.length_mm", rule, "endless"
        if has_load and not is_endless:
            for index, actuator in enumerate(self.driven):
                finger_rules = actuator.finger_rules(self.strip)
                yield from rules_below(finger_rules, actuator, f"actuator[{index}]")
        has_file = any(condition.file is not None for condition in self.conditions)
        rule = "must be left out where a condition plays a file: the curves are those of sines"
        for key in CURVE_KEYS:
            excess = has_file and getattr(self.simulation, key) is not None
            yield excess, f"simulation.{key}", rule, None
        yield from self._device_rules(device)
        designs = {each.name: each.design(self.design) for each in self.conditions}
        yield from self.levels.design_rules(designs)
        rule = f'must be "constant" with task.kind = "{self.task.name}"'
        is_chosen = self.levels.is_adaptive and self.task.has_reference
        yield is_chosen, "levels.rule", rule, self.levels.rule
        for index, condition in enumerate(self.conditions):
            if condition.file is not None and not condition.is_complete:
                continue
            is_other = condition.sample_rate_hz not in {None, device.sample_rate_hz}
            rule = f"must be device.sample_rate_hz = {device.sample_rate_hz:g}"
            yield is_other, f"condition[{index}].sample_rate_hz", rule, condition.sample_rate_hz
            duration_s = condition.duration_s(self.task.n_sites_at_once)
            window_s = self.design.response_window_s
            name = "cycles" if condition.file is None else "file"
            rule = f"must be shorter: the burst takes {duration_s:.10g} s, longer than "
            rule += f"design.response_window_s = {window_s:g}"
            key, value = self.stimulus_key(condition, name), getattr(condition, name)
            yield duration_s > window_s, key, rule, value
            yield from self._asynchrony_rules(condition)
            drive, rate_hz = condition.drive, device.sample_rate_hz
            yield from self.monitor.drive_rules(drive, rate_hz, foreperiod_s)

    def _asynchrony_rules(self, condition: Condition) -> Iterator[Rule]:
        """Yield the rules of an asynchrony: a task that has it, no monitor, which knows of none."""
        key, value = self.stimulus_key(condition, "asynchrony_ms"), condition.asynchrony_ms
        rule = f'must be 0 with task.kind = "{self.task.name}", which drives one site at a time'
        yield bool(value) and self.task.n_sites_at_once < 2, key, rule, value  # noqa: PLR2004
        rule = 'must be 0 with a monitor, which compares simultaneous bursts (source = "none")'
        yield bool(value) and self.monitor.source != "none", key, rule, value

    def _device_rules(self, device: DeviceSettings) -> Iterator[Rule]:
        """Yield the rules that a device reaches every level, and has the monitor's source."""
        high_vpp, limit = device.highest
        rule = f"must be at most {limit} = {high_vpp:.12g}"
        both_vpp = self.design.both_level_vpp or 0.0
        yield both_vpp > high_vpp, "design.both_level", rule, both_vpp
        reference_vpp = self.task_choice.reference_vpp or 0.0
        yield reference_vpp > high_vpp, "task.reference_vpp", rule, reference_vpp
        for index, condition in enumerate(self.conditions):
            section = "design" if condition.levels_vpp is None else f"condition[{index}]"
            levels_vpp = condition.levels_vpp or self.design.levels_vpp
            n_within = sum(level_vpp <= high_vpp for level_vpp in levels_vpp)  # they increase
            key, first_vpp = f"{section}.levels_vpp[{n_within}]", levels_vpp[n_within:][:1]
            yield first_vpp != (), key, rule, first_vpp and first_vpp[0]
        yield from self.monitor.driver_rules(device.driver)
        sites = self.task.sites
        for section, values, names in (
            ("device", device, ("channels",)),
            ("monitor", self.monitor, ("inputs", "per_unit", "per_volt", "delay_ms")),
        ):
            for name in names:
                of_sites = getattr(values, name)
                is_other = of_sites is not None and len(of_sites) != len(sites)
                rule = f"must have a value for each site: {', '.join(sites)}"
                yield is_other, f"{section}.{name}", rule, of_sites and list(of_sites)

    def check_device(self, device: DeviceSettings) -> None:
        """Refuse a device in place of the study's that does not reach its levels or monitor it.

        Parameters
        ----------
        device : DeviceSettings
            The device, with its ceiling and, if it has one, its full scale.

        Raises
        ------
        StudyError
            If a level is too high for it, or it does not have the monitor's source.
        """
        obey(self._device_rules(device), source=f"study {self.name}")

    def refused(self, *faults: Fault) -> StudyError:
        """Return the error of a study that is valid but cannot be computed or played.

        Parameters
        ----------
        *faults : Fault
            What is wrong.

        Returns
        -------
        StudyError
        """
        return StudyError(f"study {self.name}", *faults)

    def design_of(self, condition: str) -> Design:
        """Return the design of a condition, with its levels if some were chosen for it.

        Parameters
        ----------
        condition : str
            Its name.

        Returns
        -------
        Design
        """
        designs = (each.design(self.design) for each in self.conditions if each.name == condition)
        return next(designs, self.design)

    @property
    def task(self) -> Task:
        """The task of the participant."""
        return self.task_choice.task_at(sites_of(self.actuators))

    @property
    def driven(self) -> tuple[Actuator, ...]:
        """The actuators under the fingers, in the order of the task's sites."""
        return tuple(actuator for actuator in self.actuators if actuator.site is not None)

    @property
    def site_distance_mm(self) -> float:
        """The smallest distance between two driven actuators; infinite with one."""
        places_mm = [(actuator.x_mm, 1e3 * actuator.y_m) for actuator in self.driven]
        return min((math.dist(*pair) for pair in combinations(places_mm, 2)), default=math.inf)

    def stimulus_key(self, condition: Condition, key: str) -> str:
        """Return where the file has a key of a condition's stimulus: there, or in [burst].

        Parameters
        ----------
        condition : Condition
            The condition.
        key : str
            A key that [burst] has, too.

        Returns
        -------
        str
        """
        is_set = key in condition.model_fields_set
        return f"condition[{self.conditions.index(condition)}].{key}" if is_set else f"burst.{key}"

    @property
    def trial_s(self) -> float:
        """The expected length of a trial, in seconds."""
        design, n_intervals = self.design, self.task.n_intervals
        gaps_s = (n_intervals - 1) * (self.task_choice.gap_s or 0.0)
        answer_s = min(ASSUMED_ANSWER_S, design.response_window_s)
        return n_intervals * sum(design.foreperiod_s) / 2 + gaps_s + answer_s

    @property
    def highest_vpp(self) -> float:
        """The highest level that is ever presented."""
        reference_vpp = self.task_choice.reference_vpp or 0.0
        return max(reference_vpp, *(c.design(self.design).highest_vpp for c in self.conditions))

    @property
    def name(self) -> str:
        """Its name."""
        return self.about.name

    @property
    def strip(self) -> Strip:
        """The plate of the physics."""
        return self.plate.strip

    @cached_property
    def canonical(self) -> str:
        """The complete study as JSON text with sorted keys, defaults filled in."""
        tables = self.model_dump(mode="json", by_alias=True)
        return json.dumps(tables, sort_keys=True, separators=(",", ":"), ensure_ascii=False)

    @cached_property
    def sha256(self) -> str:
        """Checksum of the canonical text."""
        return hashlib.sha256(self.canonical.encode()).hexdigest()

    @property
    def keys_set(self) -> tuple[str, ...]:
        """The keys that the file sets, with their sections, such as ``strip.width_mm``."""
        keys = []
        for name, field in type(self).model_fields.items():
            value, section = getattr(self, name), field.alias or name
            tables = {section: value}
            if isinstance(value, tuple):
                tables = {f"{section}[{index}]": table for index, table in enumerate(value)}
            keys += [f"{path}.{key}" for path, table in tables.items() for key in table.keys_set]
        return tuple(keys)

    def changed(self, **sections: Any) -> Self:
        """Return the study with other sections, validated.

        Parameters
        ----------
        **sections : sections, or dict of their keys
            By their names in a file, such as ``design``; a dict leaves other keys at their default.

        Returns
        -------
        Study

        Raises
        ------
        StudyError
            If a value is out of its range, or two contradict each other.
        """
        try:
            return super().changed(**{key: _immutable(value) for key, value in sections.items()})
        except StudyError as error:
            raise self.refused(*error.faults) from error


def section_models() -> dict[str, type[Section]]:
    """Return the models of the sections by their names in a file."""
    kinds: dict[str, Any] = {f.alias or n: f.annotation for n, f in Study.model_fields.items()}
    return {name: getattr(kind, "__args__", (kind,))[0] for name, kind in kinds.items()}


def _immutable(value: Any) -> Any:
    """Return a value with tuples in place of lists."""
    if isinstance(value, dict):
        return {key: _immutable(item) for key, item in value.items()}
    return tuple(map(_immutable, value)) if isinstance(value, list | tuple) else value


_MAX_BITS: Final = 1024
"""More bits than any number that a key can have; Python writes no number of thousands of digits."""


def _json_values(value: Any, key: str = "") -> Any:
    """Return what JSON has no type for as text: the day of a measurement; else as a table."""
    match value:
        case dict():
            return {name: _json_values(item, name) for name, item in value.items()}
        case list():
            return [_json_values(item) for item in value]
        case int() if value.bit_length() > _MAX_BITS:
            return {"a number": "of more than 300 digits"}
        case date() | time():
            return str(value) if key == "measured_on" else {type(value).__name__: str(value)}
    return value
