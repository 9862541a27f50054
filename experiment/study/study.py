"""A study: the sections of study.toml together, what must agree between them, and its one text."""

from __future__ import annotations

import hashlib
import json
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator
from pydantic_core import ArgsKwargs, PydanticCustomError

from experiment.names import in_mind
from experiment.study.actuator import (
    MEASURED_KEYS,
    SIDES,
    Actuator,
    check_measured,
    displacements_are_known,
    filled_in,
    paper_actuators,
)
from experiment.study.base import (
    ASKED_FOR,
    FromTable,
    KeyRange,
    file_keys,
    filled,
    limits_of,
    section,
)
from experiment.study.dataset import About, Dataset, Participants
from experiment.study.design import Design
from experiment.study.equipment import Contact, DeviceSettings, Masking, MonitorSettings
from experiment.study.finger import FingerLoad, check_fingers, check_places
from experiment.study.plate import Plate, is_as_measured, is_papers_plate
from experiment.study.presentation import Keys, Screen, Texts, instructions_of
from experiment.study.simulation import PAPER_THRESHOLD_UM, THRESHOLD_VPP, Simulation
from experiment.study.stimulus import (
    Condition,
    SharedStimulus,
    check_levels,
    completed,
    recorded,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from stimuli import Strip


LEAST_UM_PER_VPP: Final = 1e-4
"""Less stays below a tenth of a micrometre, the least that is felt, at all levels to 1000 Vpp."""


class StudyError(ValueError):
    """A study file, or a file of levels, that cannot be used; the message is one line.

    Examples
    --------
    >>> from experiment import read_study
    >>> read_study("nowhere.toml")
    Traceback (most recent call last):
    experiment.study.study.StudyError: nowhere.toml: No such file or directory
    """


class UnusableStudyError(StudyError):
    """A study that was read but cannot be computed or played, told by its name.

    >>> UnusableStudyError("paper", "no device plays it").of_file("study.toml")
    StudyError('study.toml: no device plays it')
    """

    def __init__(self, name: str, what: str) -> None:
        super().__init__(f"study {name}: {what}")
        self.what = what

    def of_file(self, path: Path | str) -> StudyError:
        """Return the same, told by the file of the study."""
        return StudyError(f"{path}: {self.what}")


@contextmanager
def told_by_file(path: Path | str | None) -> Iterator[None]:
    """Begin with its file what is refused of a study, where it is from one."""
    try:
        yield
    except UnusableStudyError as error:
        if path is None:
            raise
        raise error.of_file(path) from error


def _one_condition() -> list[dict[str, Any]]:
    return [{"name": "main"}]


# A section that is left to be filled in from another one stands below it: pydantic checks the
# fields in their order, and each sees those above it. The order is also that of `tactstrip init`.
@section
class Study:
    """Everything that is fixed before the first participant comes.

    `read_study` and `paper_study` make one. Its attributes are the sections of a study file;
    `tactstrip init` writes one with every key, its unit and what it means. Nothing is left out of
    it but a file that was not read yet and a window that was not chosen yet.

    The constructor has a parameter for each attribute, of the same name but where it is told.

    Attributes
    ----------
    about : About
        Parameter ``study``, section ``[study]``: its name, and what its participants agree to.
    plate : Plate
        Parameter ``strip``, section ``[strip]``: the plate; the property `strip` has its physics.
    actuators : tuple of Actuator
        Parameter ``actuator``, tables ``[[actuator]]``: left and right, under the two fingers,
        then the others, which no session drives.
    finger_load : FingerLoad
        What the two fingertips oppose to the plate.
    burst : SharedStimulus
        What drives the actuators, unless a condition says otherwise.
    conditions : tuple of Condition
        Parameter ``condition``, tables ``[[condition]]``: stimuli, each of which runs the whole
        design; at least one.
    design : Design
        What is presented, how often, and what may be answered.
    device : DeviceSettings
        What drives the actuators, and what it may do.
    monitor : MonitorSettings
        What measures each burst beside the device.
    masking : Masking
        The noise in the headphones that hides the sound of the actuators.
    contact : Contact
        How the fingers lay on the plate.
    screen, keys, texts : Screen, Keys, Texts
        The participant's window, the keys of each answer, and what is read.
    participants, dataset : Participants, Dataset
        What participants.tsv has beside the identifier, and what an exported data set says.
    simulation : Simulation
        The people that a dry run simulates.

    Raises
    ------
    ValueError
        If a value is out of its range, or two do not go together: patches off the strip, levels
        above the device's ceiling, bursts longer than the time for an answer, conditions of the
        same name.

    Examples
    --------
    Its checksum tells one study from another, whatever else its file says:

    >>> from experiment import paper_study
    >>> study = paper_study()
    >>> study.changed(design={"levels_vpp": (60.0, 95.0)}).sha256 == study.sha256
    False
    >>> study.changed().sha256 == study.sha256
    True
    """

    about: FromTable[About] = Field(default_factory=About, alias="study")
    plate: FromTable[Plate] = Field(default_factory=Plate, alias="strip")
    actuators: tuple[FromTable[Actuator], ...] = Field(
        default_factory=paper_actuators, alias="actuator", strict=False, validate_default=True
    )
    finger_load: FromTable[FingerLoad] = Field(default_factory=FingerLoad)
    burst: FromTable[SharedStimulus] = Field(default_factory=SharedStimulus)
    conditions: tuple[FromTable[Condition], ...] = Field(
        default_factory=_one_condition, alias="condition", strict=False, validate_default=True
    )
    design: FromTable[Design] = Field(default_factory=Design)
    device: FromTable[DeviceSettings] = Field(default_factory=DeviceSettings)
    monitor: FromTable[MonitorSettings] = Field(default_factory=MonitorSettings)
    masking: FromTable[Masking] = Field(default_factory=Masking)
    contact: FromTable[Contact] = Field(default_factory=Contact)
    screen: FromTable[Screen] = Field(default_factory=Screen)
    keys: FromTable[Keys] = Field(default_factory=Keys)
    texts: FromTable[Texts] = Field(default_factory=Texts)
    participants: FromTable[Participants] = Field(default_factory=Participants)
    dataset: FromTable[Dataset] = Field(default_factory=Dataset)
    simulation: FromTable[Simulation] = Field(default_factory=dict, validate_default=True)

    @model_validator(mode="before")
    @classmethod
    def _ask_for_actuators(cls, given: Any) -> Any:
        """Fill in the discs of the paper's plate; mark those that another one does not state."""
        if not isinstance(given, ArgsKwargs):
            return given
        keys = dict(given.kwargs or {})
        plate = keys.get("strip", {})
        stated = vars(plate) if isinstance(plate, Plate) else plate
        if "actuator" not in keys and isinstance(stated, dict):
            papers = paper_actuators(measured=is_as_measured(stated))
            keys["actuator"] = papers if is_papers_plate(stated) else None
        return ArgsKwargs((), keys)

    @field_validator("actuators", mode="before")
    @classmethod
    def _put_on_the_centre_line(cls, tables: Any, info: ValidationInfo) -> Any:
        """Fill in where every actuator is across the strip, and what is assumed alike of two."""
        if tables is None:
            raise PydanticCustomError(
                ASKED_FOR,
                "[[actuator]] is missing, one with side = left and one with side = right, as the "
                "paper's belong to its plate",
            )
        if not isinstance(tables, list):
            return tables
        plate = info.data.get("plate", Plate())
        return filled_in(tables, plate.width_mm)

    @field_validator("actuators", mode="after")
    @classmethod
    def _sort(cls, actuators: tuple[Actuator, ...]) -> tuple[Actuator, ...]:
        return tuple(sorted(actuators, key=lambda one: (SIDES.index(one.side), one.x_mm, one.y_mm)))

    @field_validator("conditions", mode="before")
    @classmethod
    def _take_from_the_burst(cls, tables: Any, info: ValidationInfo) -> Any:
        if not isinstance(tables, list):
            return tables
        if "burst" not in info.data:
            return ()  # the fault is that of [burst], none of theirs
        return [
            completed(table, info.data["burst"]) if isinstance(table, dict) else table
            for table in tables
        ]

    @field_validator("simulation", mode="before")
    @classmethod
    def _give_a_threshold(cls, table: Any, info: ValidationInfo) -> Any:
        """Put in the threshold that was left out, in the unit that the actuators allow."""
        if not isinstance(table, dict) or any(
            table.get(key) is not None for key in ("threshold_um", "threshold_vpp")
        ):
            return table
        if displacements_are_known(info.data.get("actuators", ())):
            return filled(table, threshold_um=PAPER_THRESHOLD_UM)
        return filled(table, threshold_vpp=THRESHOLD_VPP)

    def __post_init__(self) -> None:
        check_places(self.actuators, self.strip)
        check_measured(self.plate, self.actuators)
        names = [condition.name for condition in self.conditions]
        if not names or len(set(names)) != len(names):
            raise ValueError(f"condition names must be distinct, at least one; got {names}")
        self._check_displacements()
        if self.simulation.threshold_um is not None and not displacements_are_known(self.actuators):
            raise ValueError(
                "simulation.threshold_um needs the displacement or the layers of the left and the "
                'right actuator (such as measured_as = "as-left", docs/plate.md); else give '
                "threshold_vpp"
            )
        self.simulation.check_played([one.name for one in self.conditions if one.file is not None])
        if self.finger_load.impedance is not None:
            check_fingers(self.actuators[:2], self.strip)
        self.check_levels(self.device)
        self._check_drives()
        self.monitor.check_beside(self.device.driver, self.design.foreperiod_s[0])
        self.texts.check_answers(self.design.responses)

    def _check_displacements(self) -> None:
        """Refuse micrometres per volt that no finger could feel, or that no plate could bear."""
        highest_vpp, thickness_um = self.highest_vpp, 1e3 * self.plate.thickness_mm
        for place, actuator in enumerate(self.actuators):
            um, at_vpp = actuator.measured_displacement_um, actuator.measured_at_vpp
            if um is None or at_vpp is None:
                continue
            path, per_vpp = f"actuator[{place}].{MEASURED_KEYS[0]}", thickness_um / highest_vpp
            limits = KeyRange(ge=LEAST_UM_PER_VPP * at_vpp, le=per_vpp * at_vpp)
            own = limits_of(Actuator, MEASURED_KEYS[1])
            least_vpp, most_vpp = max(um / per_vpp, own.ge or 0.0), um / LEAST_UM_PER_VPP
            levels = KeyRange(ge=least_vpp, le=min(most_vpp, own.le or most_vpp))
            if not limits.hold(um):
                raise ValueError(
                    f"{path} must be {limits.words(whole=False)} at {at_vpp:g} Vpp, so that it "
                    f"is felt at some level and within the plate's thickness at {highest_vpp:g} "
                    f"Vpp; got {um:g}{in_mind(path, um, limits.hold)}"
                    f"{in_mind(MEASURED_KEYS[1], at_vpp, levels.hold)}"
                )

    def check_levels(self, device: DeviceSettings) -> None:
        """Refuse levels above what a device reaches, be it the study's or one instead of it.

        Parameters
        ----------
        device : DeviceSettings
            The device, with its ceiling and, where it has one, its full scale.

        Raises
        ------
        ValueError
            If some level is too high for it.
        """
        check_levels(self.design, self.conditions, device)

    def _check_drives(self) -> None:
        window_s, rate_hz = self.design.response_window_s, self.device.sample_rate_hz
        least_s = self.design.foreperiod_s[0]
        for place, condition in enumerate(self.conditions):
            if condition.file is not None and not condition.is_found:
                continue
            if condition.sample_rate_hz not in {None, rate_hz}:
                raise ValueError(
                    f"condition[{place}].sample_rate_hz must be device.sample_rate_hz = "
                    f"{rate_hz:g}; got {condition.sample_rate_hz:g}"
                )
            if condition.drive.duration_s > window_s:
                raise ValueError(
                    f"condition {condition.name}: the burst must last at most "
                    f"design.response_window_s = {window_s:.10g}; "
                    f"got {condition.drive.duration_s:.10g} s"
                )
            self.monitor.check_drive(condition.name, condition.drive, rate_hz, least_s)

    def design_of(self, condition: str) -> Design:
        """Return the design of a condition, with its own levels where some were placed for it.

        Parameters
        ----------
        condition : str
            Its name.

        Returns
        -------
        Design
        """
        own = (one.own(self.design) for one in self.conditions if one.name == condition)
        return next(own, self.design)

    @property
    def highest_vpp(self) -> float:
        """The highest level that is ever presented."""
        return max(one.own(self.design).highest_vpp for one in self.conditions)

    @property
    def name(self) -> str:
        """What it is called."""
        return self.about.name

    @property
    def shown_texts(self) -> Texts:
        """What a person reads, with the instructions that fit the design where none are given."""
        instructions = self.texts.instructions or instructions_of(self.design)
        return replace(self.texts, instructions=instructions)

    @property
    def strip(self) -> Strip:
        """The plate as the physics has it."""
        return self.plate.strip

    @cached_property
    def canonical(self) -> str:
        """The complete study as JSON text with sorted keys, defaults filled in."""
        tables = {
            name: [recorded(one) for one in table] if isinstance(table, tuple) else asdict(table)
            for name, table in self.sections().items()
        }
        return json.dumps(tables, sort_keys=True, separators=(",", ":"), ensure_ascii=False)

    @cached_property
    def sha256(self) -> str:
        """Checksum of the canonical text."""
        return hashlib.sha256(self.canonical.encode()).hexdigest()

    def sections(self) -> dict[str, Any]:
        """Return the sections by their names in a file, in the order of `tactstrip init`.

        Returns
        -------
        dict of str
            To each name its section; of actuators and conditions a tuple.
        """
        names = zip(file_keys(type(self)), self.__dataclass_fields__, strict=True)
        return {in_file: getattr(self, name) for in_file, name in names}

    def changed(self, **sections: Any) -> Self:
        """Return the study with other sections, checked anew.

        Parameters
        ----------
        **sections : sections, or dict of their keys
            By their names in a file, such as ``design``; a dict leaves other keys at their default.

        Returns
        -------
        Study

        Raises
        ------
        ValueError
            As for the study itself.
        """
        return type(self)(**self.sections() | sections)
