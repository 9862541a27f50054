"""What a study says of its equipment: what drives the actuators, and what hides their sound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from experiment.terms.checks import is_line, require_word
from stimuli.checks import finite

DriverName = Literal["mock", "serial", "generator", "audio"]
Noise = Literal["pink", "none"]

MAX_MASKING_LEVEL_DBA = 80.0
"""Loudest masking noise, dB(A) re 20 uPa, that a person may hear for the length of a session."""
MAX_LEVEL_DBFS = -18.0
"""Louder noise would be clipped: its peaks lie up to 16 dB above its effective value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceSettings:
    """What drives the actuators, and what it may do.

    Attributes
    ----------
    driver : str
        Name of the driver.
    sample_rate_hz : float
        Rate at which the device puts samples out.
    ceiling_vpp : float
        Highest level it may ever put out.
    least_interval_s : float
        Shortest rest from the end of a burst to the onset of the next.
    port : str or None
        Where a real device is: a port, a URL, or the name of a sound card.
    amplifier_gain : float or None
        Volts at the actuator per volt of a generator.
    volts_full_scale : float or None
        Volts at the actuator, to both sides, for a sound card's largest sample.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    driver: DriverName
    sample_rate_hz: float
    ceiling_vpp: float
    least_interval_s: float
    port: str | None = None
    amplifier_gain: float | None = None
    volts_full_scale: float | None = None

    def __post_init__(self) -> None:
        require_word("driver", self.driver, get_args(DriverName))
        finite("sample_rate_hz", self.sample_rate_hz, least=1_000, most=10_000_000)
        finite("ceiling_vpp", self.ceiling_vpp, above=0, most=1_000)
        finite("least_interval_s", self.least_interval_s, above=0, most=60)
        if self.port is not None and not is_line(self.port):
            raise ValueError(f"port must be a name in one line of text; got {self.port!r}")
        if self.amplifier_gain is not None:
            finite("amplifier_gain", self.amplifier_gain, above=0, most=100_000)
        if self.volts_full_scale is not None:
            finite("volts_full_scale", self.volts_full_scale, above=0, most=1_000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Masking:
    """The noise that hides the sound of the actuators.

    Attributes
    ----------
    noise : str
        ``pink`` or ``none``.
    max_level_dba : float
        Loudest level at the ear, dB(A) re 20 uPa.
    measured_level_dba : float or None
        What was measured at the ear with these settings; none where nobody did.
    level_dbfs : float
        Effective value of the samples, dB re the peak of a full-scale sine.
    sound_card : str
        Which sound card plays it; empty for the system's default one.
    loop_s : float
        Length of the loop.
    sample_rate_hz : float
        Rate of its samples.

    Raises
    ------
    ValueError
        If the noise is unknown, may be or was measured to be louder than 80 dB(A) or its own
        greatest level, or a value is out of its range.

    Examples
    --------
    >>> Masking(noise="pink", max_level_dba=85.0)
    Traceback (most recent call last):
    ValueError: max_level_dba must be a finite number >= 0 and <= 80, got 85.0
    """

    noise: Noise
    max_level_dba: float
    measured_level_dba: float | None = None
    level_dbfs: float = -30.0
    sound_card: str = ""
    loop_s: float = 30.0
    sample_rate_hz: float = 48_000.0

    def __post_init__(self) -> None:
        require_word("noise", self.noise, get_args(Noise))
        finite("max_level_dba", self.max_level_dba, least=0, most=MAX_MASKING_LEVEL_DBA)
        if self.measured_level_dba is not None:
            finite("measured_level_dba", self.measured_level_dba, least=0, most=self.max_level_dba)
        finite("level_dbfs", self.level_dbfs, least=-90, most=MAX_LEVEL_DBFS)
        if self.sound_card and not is_line(self.sound_card):
            raise ValueError(
                f"sound_card must be a name in one line of text; got {self.sound_card!r}"
            )
        finite("loop_s", self.loop_s, least=1, most=600)
        finite("sample_rate_hz", self.sample_rate_hz, least=16_000, most=192_000)
