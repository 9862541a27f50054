"""The tables [burst] and [[condition]] of study.toml: what drives the actuators."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from experiment.study.sections.table import Table
from experiment.terms.checks import CONDITION_NAME, NAME_RULE, is_line
from stimuli import Burst
from stimuli.checks import finite
from stimuli.drive.windows import Window

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from experiment.study.sections.equipment import DeviceSettings
    from stimuli import SampledDrive


WindowName = Literal["none", "hann", "tukey", "gaussian", "auto"]
"""A window, or that the program is to choose one."""

SINE_KEYS: Final = ("frequency_hz", "cycles", "window")
STIMULUS_KEYS: Final = (*SINE_KEYS, "wanted_level_db", "file")


class BurstTable(Table):
    """What drives the actuators: a sine burst, or a sampled click from a file."""

    later: ClassVar[tuple[str, ...]] = ("wanted_level_db", "file", "masking_limit_db")

    frequency_hz: float | None = Field(500.0)
    cycles: int | None = Field(1)
    window: WindowName | None = Field("none", description="auto: see below")
    wanted_level_db: float | None = Field(
        None, description="window = auto is the shortest with this at the other finger"
    )
    file: str | None = Field(
        None, description="a .wav or .csv instead of frequency_hz, cycles, window"
    )
    max_energy_above_cutoff: float = Field(
        0.01, description="largest fraction of its energy above the strip's cut-off"
    )
    masking_limit_db: float = Field(
        20.0, description="least drop of level from the own to the other finger"
    )
    accept_unfit: str | None = Field(
        None, description="why an unfit burst is wanted all the same; recorded"
    )

    @model_validator(mode="after")
    def _is_sine_or_file(self) -> Self:
        if self.file is not None:
            for key in SINE_KEYS:
                if key in self.model_fields_set and getattr(self, key) is not None:
                    raise ValueError(f"{key} and file exclude each other; got both")
                setattr(self, key, None)
        _require_wanted_level(self.window, self.wanted_level_db)
        return self


def _require_wanted_level(window: str | None, wanted_level_db: float | None) -> None:
    if window == "auto" and wanted_level_db is None:
        raise ValueError("wanted_level_db is missing; window = auto needs it")
    if window != "auto" and wanted_level_db is not None:
        raise ValueError("wanted_level_db is for window = auto only; got another window")


class ConditionTable(Table):
    """A stimulus that runs the whole design; what it leaves out is taken from [burst].

    The last three keys are what `window = "auto"` and `file` come to. They are filled in when a
    study file is read, and never again: a plan holds the stimulus that is really played.
    """

    later: ClassVar[tuple[str, ...]] = (
        "wanted_level_db",
        "file",
        "auto_cycles",
        "auto_window",
        "samples_base64",
    )

    name: str = Field(description="1 to 32 of A-Z a-z 0-9 _ -")
    frequency_hz: float | None = None
    cycles: int | None = None
    window: WindowName | None = None
    wanted_level_db: float | None = None
    file: str | None = None
    accept_unfit: str | None = None
    auto_cycles: int | None = None
    auto_window: Window | None = None
    samples_base64: str | None = None

    @model_validator(mode="after")
    def _is_sine_or_file(self) -> Self:
        given = [key for key in (*SINE_KEYS, "wanted_level_db") if getattr(self, key) is not None]
        if self.file is not None and given:
            raise ValueError(f"{given[0]} and file exclude each other; got both")
        return self

    def filled(self, burst: BurstTable) -> ConditionTable:
        """Return the condition with nothing left out.

        The reason for an unfit burst is taken over with the whole burst only: it is no reason for
        another one.
        """
        own = {
            key: value
            for key in (*STIMULUS_KEYS, "accept_unfit")
            if (value := getattr(self, key)) is not None
        }
        stimulus = {key: getattr(burst, key) for key in STIMULUS_KEYS}
        if "file" in own:
            stimulus = dict.fromkeys(STIMULUS_KEYS)
        elif own.keys() & set(SINE_KEYS) and burst.file is not None:
            stimulus = {"cycles": 1, "window": "none"}
        if own.get("window", "auto") != "auto":
            stimulus["wanted_level_db"] = None
        found = {
            key: getattr(self, key)
            for key in ("auto_cycles", "auto_window", "samples_base64")
            if getattr(self, key) is not None
        }
        reason = None if own else burst.accept_unfit
        filled = ConditionTable(
            **{"name": self.name, "accept_unfit": reason} | stimulus | own | found
        )
        if filled.file is None and filled.frequency_hz is None:
            raise ValueError("frequency_hz is missing; [burst] has a file instead")
        if filled.window != "auto" and (filled.auto_cycles or filled.auto_window):
            raise ValueError("auto_cycles and auto_window are for window = auto only")
        _require_wanted_level(filled.window, filled.wanted_level_db)
        return filled


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
        if not isinstance(self.name, str) or not CONDITION_NAME.fullmatch(self.name):
            raise ValueError(f"name must be {NAME_RULE}; got {self.name!r}")
        reason = self.accept_unfit
        if reason is not None and not is_line(reason):
            raise ValueError(f"accept_unfit must be a reason in one line of text; got {reason!r}")


def drive_samples(condition: Condition, settings: DeviceSettings) -> NDArray[np.float64]:
    """Return a condition's burst as the device plays it, shape (n,), with a peak of exactly 1.

    A level of V volts peak-to-peak then peaks at V / 2, whatever the window and the sample rate.
    Where the rate is no whole multiple of the burst's frequency the other half-wave stays a little
    lower: by at most 0.6 % from 32 samples a cycle on, 0.15 % from 64.

    Parameters
    ----------
    condition : Condition
        The condition, with its burst.
    settings : DeviceSettings
        The study's device settings, with the sample rate.
    """
    samples = condition.burst.samples(settings.sample_rate_hz)
    scaled: NDArray[np.float64] = samples / unscaled_peak(condition, settings)
    return scaled


def unscaled_peak(condition: Condition, settings: DeviceSettings) -> float:
    """Return the greatest absolute value of a condition's samples before they are scaled.

    Parameters
    ----------
    condition : Condition
        The condition, with its burst.
    settings : DeviceSettings
        The study's device settings, with the sample rate.
    """
    return float(np.max(np.abs(condition.burst.samples(settings.sample_rate_hz))))


def stimulus_facts(condition: Condition) -> dict[str, Any]:
    """List what is played in a condition, for people and programs; keys carry their SI unit.

    Parameters
    ----------
    condition : Condition
        The condition, with its burst.

    Examples
    --------
    >>> from experiment.study.read import paper_study
    >>> stimulus_facts(paper_study().conditions[0])
    {'frequency_hz': 500.0, 'cycles': 1, 'window': 'none'}
    """
    burst = condition.burst
    if isinstance(burst, Burst):
        auto = condition.auto
        return asdict(burst) | ({} if auto is None else {"wanted_level_db": auto.wanted_level_db})
    samples = burst.samples(burst.sample_rate_hz)
    return {
        "file": condition.file,
        "sample_rate_hz": burst.sample_rate_hz,
        "samples": int(samples.size),
    }
