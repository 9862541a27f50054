"""The tables [burst] and [[condition]] of study.toml: what drives the actuators."""

from __future__ import annotations

from typing import ClassVar, Final, Literal, Self

from pydantic import Field, model_validator

from experiment.table import Table
from stimuli.windows import Window

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
