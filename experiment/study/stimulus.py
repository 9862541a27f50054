"""The sections [burst] and [[condition]] of a study file: what drives the actuators."""

from __future__ import annotations

import base64
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Final, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from experiment.study.base import (
    Line,
    Name,
    Section,
    all_or_none,
    is_distinct,
    obey,
    refusal,
)
from experiment.study.design import Level
from stimuli import Burst, SampledDrive
from stimuli.drive.windows import Window

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from experiment.study.base import Rule
    from experiment.study.design import Design
    from experiment.study.equipment import DeviceSettings


WindowName = Literal["none", "hann", "tukey", "gaussian", "auto"]
_Cycles = Annotated[int, Field(ge=1, le=1_000_000)]
_SINE: Final = {"frequency_hz": 500.0, "cycles": 1, "window": "none"}
"""The paper's burst."""
STIMULUS_KEYS: Final = (*_SINE, "max_crosstalk_db", "file")


class Stimulus(Section):
    """What drives the actuators: a sine burst, or a sampled click from a file."""

    frequency_hz: Annotated[float, Field(ge=5, le=100_000)] | None = None
    """frequency of the sine; by default 500"""
    cycles: _Cycles | None = None
    """number of cycles; by default 1"""
    window: WindowName | None = None
    """window of the burst; auto: the shortest that keeps max_crosstalk_db; by default none"""
    max_crosstalk_db: Annotated[float, Field(ge=-200, le=-1)] | None = None
    """highest crosstalk that window = "auto" may leave, dB re the driven finger"""
    file: Line | None = None
    """.wav or .csv file with a click, in place of frequency_hz, cycles and window"""
    asynchrony_ms: Annotated[float, Field(ge=0, le=500)] | None = None
    """from the onset at one site to that at the next, where several are driven; by default 0"""
    accept_violation: Line | None = None
    """reason why a stimulus that violates a limit is used nevertheless; recorded"""

    def rules(self) -> Iterator[Rule]:
        """Yield the rules of keys that exclude or need each other."""
        for key in (*_SINE, "max_crosstalk_db"):
            excess = self.file is not None and getattr(self, key) is not None
            yield excess, key, "excludes file; give one of the two"
        is_odd = (self.window == "auto") != (self.max_crosstalk_db is not None)
        rule = 'must be given with window = "auto", and only then'
        yield is_odd, "max_crosstalk_db", rule, None

    @property
    def sine(self) -> Burst:
        """The burst of the file, without a window if one is to be chosen."""
        assert self.frequency_hz is not None
        assert self.cycles is not None
        window = self.window
        if window is None or window == "auto":
            window = "none"
        return Burst(frequency_hz=self.frequency_hz, cycles=self.cycles, window=window)


class SharedStimulus(Stimulus):
    """What drives the actuators, unless a condition says otherwise."""

    max_energy_above_cutoff: Annotated[float, Field(gt=0, lt=1)] = 0.01
    """largest fraction of the energy that may lie above the cut-off frequency"""
    masking_threshold_db: Annotated[float, Field(ge=1, le=120)] = 20.0
    """level by which the undriven finger must receive less than the driven finger"""
    source: Line | None = None
    """where these values are from"""

    @model_validator(mode="after")
    def _complete(self) -> Self:
        defaults = {"asynchrony_ms": 0.0} | (_SINE if self.file is None else {})
        missing = {key: value for key, value in defaults.items() if getattr(self, key) is None}
        self.__dict__.update(missing)
        return self


class Condition(Stimulus):
    """A stimulus that runs the whole design; what a file omits is taken from [burst]."""

    # A plan has more keys: the window that was chosen, the samples of the file, and the levels that
    # were chosen for a participant. They are filled in when a study file is read, and never again,
    # so that a plan holds the stimulus that is really played.
    name: Name = "main"
    """name of the condition"""
    auto_cycles: _Cycles | None = None
    """cycles of the chosen window"""
    auto_window: Window | None = None
    """the chosen window"""
    samples_base64: str | None = None
    """samples of the file, 64-bit floating point"""
    sample_rate_hz: Annotated[float, Field(ge=1e-3, le=1e9)] | None = None
    """sample rate of these samples"""
    levels_vpp: tuple[Level, ...] | None = None
    """levels chosen for a participant, in place of those of the design"""

    def rules(self) -> Iterator[Rule]:
        """Yield the rules of what is determined when a study file is read."""
        excess = self.window != "auto" and bool(self.auto_cycles or self.auto_window)
        yield excess, "auto_window", 'is for window = "auto" only', None
        yield from all_or_none(self, ("samples_base64", "sample_rate_hz"))
        if self.samples_base64 is not None:
            try:
                self.drive  # noqa: B018 - refused if the text holds no samples
            except ValueError as error:
                raise refusal("samples_base64", f"must hold samples: {error}") from error

    def with_burst(self, burst: SharedStimulus, path: str = "") -> Condition:
        """Return the condition with what it omits taken from [burst], checked.

        The reason for a stimulus that violates a limit is taken only with the whole burst.
        """
        given = self.model_fields_set & {*STIMULUS_KEYS, "accept_violation"}
        values = {key: getattr(burst, key) for key in STIMULUS_KEYS}
        if "file" in given and self.file is not None:
            values = dict.fromkeys(STIMULUS_KEYS)
        elif given & set(_SINE) and burst.file is not None:
            values = {"frequency_hz": None, "cycles": 1, "window": "none", "file": None}
        if self.window not in {None, "auto"}:
            values["max_crosstalk_db"] = None
        if not given:
            values["accept_violation"] = burst.accept_violation
        if "asynchrony_ms" not in self.model_fields_set:
            values["asynchrony_ms"] = burst.asynchrony_ms
        complete = self.completed(**{key: values[key] for key in values.keys() - given})
        if any(getattr(self, key) != getattr(complete, key) for key in STIMULUS_KEYS):
            complete = complete.completed(**dict.fromkeys(PLANNED_KEYS - {"levels_vpp"}))
        lack = complete.file is None and complete.frequency_hz is None
        rule = "is required, as [burst] has a file"
        obey([*Stimulus.rules(complete), (lack, "frequency_hz", rule)], complete, path)
        return complete

    @property
    def is_complete(self) -> bool:
        """Whether its file was read and its window chosen, if it has any."""
        if self.file is not None:
            return self.samples_base64 is not None
        return self.window != "auto" or self.auto_window is not None

    @cached_property
    def drive(self) -> Burst | SampledDrive:
        """What is played, at unit amplitude; without a window until one is chosen."""
        if self.samples_base64 is not None and self.sample_rate_hz is not None:
            data = base64.b64decode(self.samples_base64, validate=True)
            samples = np.frombuffer(data, dtype="<f8").astype(np.float64)
            return SampledDrive(samples=samples, sample_rate_hz=self.sample_rate_hz)
        if self.auto_cycles is None or self.auto_window is None:
            return self.sine
        return replace(self.sine, cycles=self.auto_cycles, window=self.auto_window)

    @property
    def asynchrony_s(self) -> float:
        """The time between the onsets at two sites of a burst."""
        return (self.asynchrony_ms or 0.0) / 1e3

    def duration_s(self, n_sites: int) -> float:
        """Return how long a burst at so many sites takes, from its first onset."""
        return self.drive.duration_s + self.asynchrony_s * max(n_sites - 1, 0)

    def design(self, design: Design) -> Design:
        """Return a design with the levels that were chosen for this condition, if any were."""
        return design if self.levels_vpp is None else design.changed(levels_vpp=self.levels_vpp)


PLANNED_KEYS: Final = {*Condition.model_fields} - {*Stimulus.model_fields, "name"}
"""Keys of a condition that are determined when a study file is read; only a plan has them."""


def complete_conditions(
    conditions: tuple[Condition, ...], burst: SharedStimulus
) -> tuple[Condition, ...]:
    """Return conditions of distinct names, with what they omit taken from [burst]."""
    names = [condition.name for condition in conditions]
    is_valid = bool(names) and is_distinct(names)
    obey([(not is_valid, "", "must have distinct names, at least one", names)])
    return tuple(each.with_burst(burst, f"[{index}]") for index, each in enumerate(conditions))


def drive_samples(condition: Condition, settings: DeviceSettings) -> NDArray[np.float64]:
    """Return a condition's drive as the device plays it, shape (n,), with a peak of exactly 1.

    A level of V volts peak-to-peak then peaks at V / 2, whatever the window and the sample rate.
    Where the rate is no whole multiple of the burst's frequency the other half-wave stays a little
    lower: by at most 0.6 % from 32 samples a cycle on, 0.15 % from 64.
    """
    samples = condition.drive.samples(settings.sample_rate_hz)
    scaled: NDArray[np.float64] = samples / unscaled_peak(condition, settings)
    return scaled


def channel_samples(
    condition: Condition, settings: DeviceSettings, driven: Sequence[bool]
) -> NDArray[np.float64]:
    """Return what each channel plays, shape (n_channels, n): the drive where it is driven.

    Each driven channel begins `Condition.asynchrony_s` after the one before.
    """
    burst = drive_samples(condition, settings)
    lag = round(condition.asynchrony_s * settings.sample_rate_hz)
    length = burst.size + lag * max(sum(driven) - 1, 0)
    channels = np.zeros((len(driven), length))
    for order, channel in enumerate(np.flatnonzero(driven)):
        channels[channel, order * lag : order * lag + burst.size] = burst
    return channels


def unscaled_peak(condition: Condition, settings: DeviceSettings) -> float:
    """Return the largest absolute value of a condition's samples before they are scaled."""
    return float(np.max(np.abs(condition.drive.samples(settings.sample_rate_hz))))


def stimulus_values(condition: Condition) -> dict[str, float | int | str | None]:
    """Return what describes the stimulus of a condition; keys carry their SI unit.

    >>> from experiment import paper_study
    >>> stimulus_values(paper_study().conditions[0])
    {'frequency_hz': 500.0, 'cycles': 1, 'window': 'none'}
    """
    drive = condition.drive
    between = {"asynchrony_s": condition.asynchrony_s} if condition.asynchrony_s else {}
    if isinstance(drive, SampledDrive):
        return {
            "file": condition.file,
            "sample_rate_hz": drive.sample_rate_hz,
            "samples": int(drive.samples(drive.sample_rate_hz).size),
            **between,
        }
    values: dict[str, float | int | str | None] = {key: getattr(drive, key) for key in _SINE}
    if condition.max_crosstalk_db is not None:
        values["max_crosstalk_db"] = condition.max_crosstalk_db
    return values | between
