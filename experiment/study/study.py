"""A study as everybody but the file's reader sees it: frozen values in SI units.

A file is read by `experiment.study.read`; the ranges are checked here, whoever builds the values.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, get_args

from experiment.study.sections.dataset import Dataset, ParticipantColumn
from experiment.study.sections.equipment import DeviceSettings, Masking
from experiment.study.sections.plate import Actuator, EdgeBasis, check_actuators
from experiment.study.sections.presentation import Keys, Screen, Texts
from experiment.study.sections.simulation import Simulation
from experiment.study.sections.stimulus import AutoWindow, Condition
from experiment.terms.checks import CONDITION_NAME, NAME_RULE, is_line, require_word
from stimuli.checks import finite

if TYPE_CHECKING:
    from experiment.study.sections.design import Design
    from stimuli import Strip


__all__ = [
    "AutoWindow",
    "Condition",
    "Dataset",
    "DeviceSettings",
    "EdgeBasis",
    "Keys",
    "Masking",
    "ParticipantColumn",
    "Screen",
    "Simulation",
    "Study",
    "StudyError",
    "Texts",
]


class StudyError(ValueError):
    """A study file, or a file of levels, that cannot be used; the message is one line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """Everything that is fixed before the first participant comes.

    Attributes
    ----------
    name : str
        1 to 32 letters, digits, ``_`` or ``-``.
    strip : Strip
        The plate.
    edge_basis : str
        How its edges were stated: a word of `EdgeBasis`.
    actuators : tuple of Actuator
        Left and right, under the two fingers; then the others, which no session drives.
    conditions : tuple of Condition
        At least one; each runs the whole design.
    design : Design
    device : DeviceSettings
    masking : Masking
    simulation : Simulation
    max_energy_above_cutoff : float
        Largest fraction of a burst's energy above the strip's first cut-off.
    masking_limit_db : float
        By how much the level at the other finger must lie below that at the actuator's own.
    canonical : str
        The complete study as JSON text with sorted keys, defaults filled in.
    sha256 : str
        Checksum of ``canonical``.
    screen : Screen
        The participant's window.
    keys : Keys
        The keys that answer.
    texts : Texts
        What the participant reads.
    consent_version : str or None
        Which version of the consent form the participants sign.
    participant_columns : tuple of ParticipantColumn
        What participants.tsv has beside the identifier.
    dataset : Dataset
        What a published data set says of itself.

    Raises
    ------
    ValueError
        If two parts do not go together: patches off the strip, levels above the device's ceiling,
        bursts sooner than it allows, conditions or columns of the same name.
    """

    name: str
    strip: Strip
    edge_basis: EdgeBasis
    actuators: tuple[Actuator, ...]
    conditions: tuple[Condition, ...]
    design: Design
    device: DeviceSettings
    masking: Masking
    simulation: Simulation
    max_energy_above_cutoff: float
    masking_limit_db: float
    canonical: str
    sha256: str
    screen: Screen
    keys: Keys
    texts: Texts
    consent_version: str | None
    participant_columns: tuple[ParticipantColumn, ...]
    dataset: Dataset

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not CONDITION_NAME.fullmatch(self.name):
            raise ValueError(f"study.name must be {NAME_RULE}; got {self.name!r}")
        if self.consent_version is not None and not is_line(self.consent_version):
            raise ValueError(
                "study.consent_version must be a name in one line of text; "
                f"got {self.consent_version!r}"
            )
        require_word("strip.edge", self.edge_basis, get_args(EdgeBasis))
        limit = self.max_energy_above_cutoff
        finite("burst.max_energy_above_cutoff", limit, above=0, most=1)
        finite("burst.masking_limit_db", self.masking_limit_db, least=0, most=200)
        check_actuators(self.actuators, self.strip)
        names = [condition.name for condition in self.conditions]
        if not names or len(set(names)) != len(names):
            raise ValueError(f"condition names must be distinct, at least one; got {names}")
        columns = [column.name for column in self.participant_columns]
        if len(set(columns)) != len(columns):
            raise ValueError(f"participants.columns must have distinct names; got {columns}")
        _check_levels(self.design, self.device)
        _check_durations(self.design, self.conditions)


def _check_levels(design: Design, device: DeviceSettings) -> None:
    ceiling = f"device.ceiling_vpp = {device.ceiling_vpp:g}"
    named = {f"levels_vpp[{i}]": level_vpp for i, level_vpp in enumerate(design.levels_vpp)}
    named["both_level"] = design.both_level_vpp or 0.0
    for name, level_vpp in named.items():
        if level_vpp > device.ceiling_vpp:
            raise ValueError(f"design.{name} must be at most {ceiling}; got {level_vpp:g}")


def _check_durations(design: Design, conditions: tuple[Condition, ...]) -> None:
    window = f"design.response_window_s = {design.response_window_s:g}"
    for condition in conditions:
        duration_s = condition.burst.duration_s
        if duration_s > design.response_window_s:
            raise ValueError(
                f"condition {condition.name}: the burst must last at most {window}; "
                f"got {duration_s:g} s"
            )
