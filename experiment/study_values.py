"""A study as everybody but the file's reader sees it: frozen values in SI units.

A file is read by `experiment.study`; the ranges are checked here, whoever builds the values.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

from experiment.actuator import Actuator, check_actuators
from experiment.checks import is_line, require_word
from experiment.dataset import Dataset, ParticipantColumn
from experiment.equipment import DeviceSettings, Masking
from experiment.presentation import Keys, Screen, Texts
from stimuli.checks import finite

if TYPE_CHECKING:
    from experiment.design import Design
    from experiment.observer import Observer
    from stimuli import Burst, SampledDrive, Strip

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

EdgeBasis = Literal["simply-supported", "clamped", "elastic", "measured-cutoff"]

_NAME = re.compile(r"[A-Za-z0-9_-]{1,32}")
_NAME_RULE = "1 to 32 of the characters A-Z a-z 0-9 _ -"


class StudyError(ValueError):
    """A study file, or a file of levels, that cannot be used; the message is one line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AutoWindow:
    """What ``window = "auto"`` was asked for, where a condition's burst is what it came to.

    Attributes
    ----------
    wanted_level_db : float
        Level wanted at the other finger, dB re that at the actuator's own.
    stated_s : float
        How long the burst would last as the file states it, without a window.

    Raises
    ------
    ValueError
        If the level is not from -200 to -1 dB.
    """

    wanted_level_db: float
    stated_s: float

    def __post_init__(self) -> None:
        finite("wanted_level_db", self.wanted_level_db, least=-200, most=-1)
        finite("stated_s", self.stated_s, above=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One stimulus that the whole design is run with.

    Attributes
    ----------
    name : str
        1 to 32 letters, digits, ``_`` or ``-``.
    burst : Burst or SampledDrive
        The drive, at unit amplitude.
    accept_unfit : str or None
        Why a burst that does not fit the strip is wanted all the same; none where it is not.
    auto : AutoWindow or None
        Why it is this burst, where the program chose it.
    file : str or None
        Where a sampled drive was read from, as the study names it.

    Raises
    ------
    ValueError
        If the name or the reason is no such text.

    Examples
    --------
    >>> from stimuli import Burst
    >>> Condition(name="a/b", burst=Burst(frequency_hz=500.0, cycles=1, window="none"))
    Traceback (most recent call last):
    ValueError: name must be 1 to 32 of the characters A-Z a-z 0-9 _ -; got 'a/b'
    """

    name: str
    burst: Burst | SampledDrive
    accept_unfit: str | None = None
    auto: AutoWindow | None = None
    file: str | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not _NAME.fullmatch(self.name):
            raise ValueError(f"name must be {_NAME_RULE}; got {self.name!r}")
        reason = self.accept_unfit
        if reason is not None and not is_line(reason):
            raise ValueError(f"accept_unfit must be a reason in one line of text; got {reason!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """The population that simulated participants are drawn from; see `experiment.observer`.

    Attributes
    ----------
    median : Observer
        The participant in the middle of the population.
    threshold_sd_db : float
        Standard deviation of 20 log10(threshold) between participants; they are alike otherwise.
    """

    median: Observer
    threshold_sd_db: float

    def __post_init__(self) -> None:
        finite("threshold_sd_db", self.threshold_sd_db, least=0, most=40)


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
        if not isinstance(self.name, str) or not _NAME.fullmatch(self.name):
            raise ValueError(f"study.name must be {_NAME_RULE}; got {self.name!r}")
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
