"""The sections [burst] and [[condition]] of study.toml: what drives the actuators."""

from __future__ import annotations

import base64
import binascii
from dataclasses import asdict, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import ArgsKwargs

from experiment.names import NAME, NAME_RULE, in_mind, inward, is_line
from experiment.study.base import filled, limits_of, refuse_incomplete, section
from experiment.study.design import Level
from stimuli import Burst, SampledDrive
from stimuli.drive.windows import Window

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from experiment.study.design import Design
    from experiment.study.equipment import DeviceSettings


WindowName = Literal["none", "hann", "tukey", "gaussian", "auto"]
"""A window, or that the program is to choose one."""

SINE_KEYS: Final = ("frequency_hz", "cycles", "window")
STIMULUS_KEYS: Final = (*SINE_KEYS, "wanted_level_db", "file")


@section
class Stimulus:
    """What drives the actuators: a sine burst, or a sampled click from a file."""

    frequency_hz: float | None = Field(default=500.0, ge=5, le=100_000, description="of the sine")
    cycles: int | None = Field(default=1, ge=1, le=1_000_000, description="of the sine, whole ones")
    window: WindowName | None = Field(default="none", description="auto: chosen by the next key")
    wanted_level_db: float | None = Field(
        default=None,
        ge=-200,
        le=-1,
        description="window = auto is the shortest with this at the other finger",
    )
    file: str | None = Field(
        default=None, description="a .wav or .csv instead of frequency_hz, cycles, window"
    )
    accept_unfit: str | None = Field(
        default=None, description="why an unfit burst is wanted all the same; recorded"
    )

    @model_validator(mode="before")
    @classmethod
    def _take_a_file_for_the_sine(cls, given: Any) -> Any:
        """Leave the sine's keys empty where a file is given instead."""
        keys = dict(given.kwargs or {}) if isinstance(given, ArgsKwargs) else {}
        if keys.get("file") is None:
            return given
        for key in (*SINE_KEYS, "wanted_level_db"):
            if keys.get(key) is not None:
                raise ValueError(f"{key} and file exclude each other; got both")
        return ArgsKwargs((), keys | dict.fromkeys(SINE_KEYS))

    def __post_init__(self) -> None:
        if self.window == "auto" and self.wanted_level_db is None:
            raise ValueError("wanted_level_db is missing; window = auto needs it")
        if self.window != "auto" and self.wanted_level_db is not None:
            raise ValueError("wanted_level_db is for window = auto only; got another window")
        if self.file is None:
            self.stated  # noqa: B018 - refused without all of its keys
        reason = self.accept_unfit
        if reason is not None and not is_line(reason):
            raise ValueError(f"accept_unfit must be a reason in one line of text; got {reason!r}")

    @property
    def stated(self) -> Burst:
        """The burst as the file states it; without a window where one is to be chosen."""
        if self.frequency_hz is None or self.cycles is None or self.window is None:
            missing = next(key for key in SINE_KEYS if getattr(self, key) is None)
            raise ValueError(f"{missing} is missing")
        window = "none" if self.window == "auto" else self.window
        return Burst(frequency_hz=self.frequency_hz, cycles=self.cycles, window=window)


@section
class SharedStimulus(Stimulus):
    """What drives the actuators: a sine burst, or a sampled click from a file."""

    max_energy_above_cutoff: float = Field(
        default=0.01,
        gt=0,
        lt=1,
        description="largest fraction of its energy above the strip's cut-off",
    )
    masking_limit_db: float = Field(
        default=20.0,
        ge=1,
        le=120,
        description="least drop of level from the own to the other finger",
    )


@section
class Condition(Stimulus):
    """A stimulus that runs the whole design; what a file leaves out of it is taken from [burst].

    A plan has more keys: what `window = "auto"` and `file` come to is filled in when a study file
    is read, and never again, so that a plan holds the stimulus that is really played; levels are
    filled in when they are placed for a person.
    """

    name: str = Field(description="1 to 32 of A-Z a-z 0-9 _ -")
    auto_cycles: int | None = Field(
        default=None, ge=1, le=1_000_000, description="of the window that was chosen"
    )
    auto_window: Window | None = Field(default=None, description="which was chosen")
    samples_base64: str | None = Field(
        default=None, description="of the click in the file, 64-bit floating point"
    )
    sample_rate_hz: float | None = Field(
        default=None, ge=1e-3, le=1e9, description="of the click's samples"
    )
    levels_vpp: tuple[Level, ...] | None = Field(
        default=None, strict=False, description="placed for a person, in place of the design's"
    )

    def __post_init__(self) -> None:
        if not NAME.fullmatch(self.name):
            raise ValueError(f"name must be {NAME_RULE}; got {self.name!r}")
        if self.file is None and self.frequency_hz is None:
            raise ValueError("frequency_hz is missing; [burst] has a file instead")
        if self.window != "auto" and (self.auto_cycles or self.auto_window):
            raise ValueError("auto_cycles and auto_window are for window = auto only")
        refuse_incomplete(self, ("samples_base64", "sample_rate_hz"))
        super().__post_init__()
        if self.is_found:
            self.drive  # noqa: B018 - refused where the samples are none

    @property
    def is_found(self) -> bool:
        """Whether its file was read, its window chosen, where it has any."""
        if self.file is not None:
            return self.samples_base64 is not None
        return self.window != "auto" or self.auto_window is not None

    @cached_property
    def drive(self) -> Burst | SampledDrive:
        """What is played, at unit amplitude; as stated until a window is chosen."""
        if self.file is not None:
            return self._sampled()
        if self.auto_cycles is None or self.auto_window is None:
            return self.stated
        return replace(self.stated, cycles=self.auto_cycles, window=self.auto_window)

    def own(self, design: Design) -> Design:
        """Return a design with the levels that were placed for this condition, if any were."""
        return design if self.levels_vpp is None else replace(design, levels_vpp=self.levels_vpp)

    def _sampled(self) -> SampledDrive:
        if self.samples_base64 is None or self.sample_rate_hz is None:
            raise ValueError(f"file was not read; got {self.file!r}")
        try:
            data = base64.b64decode(self.samples_base64, validate=True)
            samples = np.frombuffer(data, dtype="<f8")
        except (binascii.Error, ValueError) as error:
            raise ValueError(f"samples_base64 must hold samples; got {error}") from error
        return SampledDrive(samples=samples.astype(np.float64), sample_rate_hz=self.sample_rate_hz)


def recorded(table: Any) -> dict[str, Any]:
    """Return a table of several, such as a condition, without levels where none were placed."""
    keys = asdict(table)
    return {key: value for key, value in keys.items() if key != "levels_vpp" or value is not None}


def levels_words(design: Design, conditions: Sequence[Condition]) -> str:
    """Return the levels of a study in words, those of each condition where they differ."""
    each = {
        one.name: ", ".join(f"{level_vpp:g}" for level_vpp in one.own(design).levels_vpp)
        for one in conditions
    }
    if len(set(each.values())) == 1:
        return next(iter(each.values()))
    return "; ".join(f"{name} {levels}" for name, levels in each.items())


def check_levels(design: Design, conditions: Sequence[Condition], device: DeviceSettings) -> None:
    """Refuse levels above what a device reaches."""
    ceiling_vpp, key = device.highest
    named = {"design.both_level": design.both_level_vpp or 0.0}
    for place, one in enumerate(conditions):
        path = "design" if one.levels_vpp is None else f"condition[{place}]"
        levels_vpp = one.own(design).levels_vpp
        named |= {f"{path}.levels_vpp[{i}]": level for i, level in enumerate(levels_vpp)}
    higher = replace(limits_of(type(device), "ceiling_vpp"), ge=max(named.values()))
    for name, level_vpp in named.items():
        if level_vpp > ceiling_vpp:
            most = inward(ceiling_vpp, least=False, digits=12)
            raise ValueError(
                f"{name} must be at most {key} = {most}; got {level_vpp:.12g}"
                f"{in_mind(key.removeprefix('device.'), ceiling_vpp, higher.hold)}"
            )


def completed(table: dict[str, Any], burst: SharedStimulus) -> dict[str, Any]:
    """Return the table of a condition with what it leaves out taken from [burst].

    The reason for an unfit burst is taken over with the whole burst only: it is no reason for
    another one.
    """
    given = {key: value for key, value in table.items() if value is not None}
    own = given.keys() & {*STIMULUS_KEYS, "accept_unfit"}
    taken: dict[str, Any] = {key: getattr(burst, key) for key in STIMULUS_KEYS}
    if "file" in own:
        taken = dict.fromkeys(STIMULUS_KEYS)
    elif own & set(SINE_KEYS) and burst.file is not None:
        taken = {"frequency_hz": None, "cycles": 1, "window": "none"}
    if given.get("window", "auto") != "auto":
        taken["wanted_level_db"] = None
    taken = {"accept_unfit": None if own else burst.accept_unfit} | taken
    return filled(table, **{key: taken[key] for key in taken.keys() - given.keys()})


def drive_samples(condition: Condition, settings: DeviceSettings) -> NDArray[np.float64]:
    """Return a condition's drive as the device plays it, shape (n,), with a peak of exactly 1.

    A level of V volts peak-to-peak then peaks at V / 2, whatever the window and the sample rate.
    Where the rate is no whole multiple of the burst's frequency the other half-wave stays a little
    lower: by at most 0.6 % from 32 samples a cycle on, 0.15 % from 64.

    Parameters
    ----------
    condition : Condition
        The condition.
    settings : DeviceSettings
        The study's device settings, with the sample rate.
    """
    samples = condition.drive.samples(settings.sample_rate_hz)
    scaled: NDArray[np.float64] = samples / unscaled_peak(condition, settings)
    return scaled


def unscaled_peak(condition: Condition, settings: DeviceSettings) -> float:
    """Return the greatest absolute value of a condition's samples before they are scaled.

    Parameters
    ----------
    condition : Condition
        The condition.
    settings : DeviceSettings
        The study's device settings, with the sample rate.
    """
    return float(np.max(np.abs(condition.drive.samples(settings.sample_rate_hz))))


def stimulus_facts(condition: Condition) -> dict[str, Any]:
    """List what is played in a condition, for people and programs; keys carry their SI unit.

    Parameters
    ----------
    condition : Condition
        The condition.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> stimulus_facts(paper_study().conditions[0])
    {'frequency_hz': 500.0, 'cycles': 1, 'window': 'none'}
    """
    drive = condition.drive
    if isinstance(drive, Burst):
        wanted_level_db = condition.wanted_level_db
        return asdict(drive) | (
            {} if wanted_level_db is None else {"wanted_level_db": wanted_level_db}
        )
    samples = drive.samples(drive.sample_rate_hz)
    return {
        "file": condition.file,
        "sample_rate_hz": drive.sample_rate_hz,
        "samples": int(samples.size),
    }
