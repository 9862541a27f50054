"""What hangs behind an emulated device: an amplifier with its switch, and what measures there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Self

import numpy as np

from device.checks import require_real
from device.core.reports import TAPS, Health, Measurement
from device.emulate.faults import parse_settings

if TYPE_CHECKING:
    from device.core.output import Emission

_PULSE_S: Final = 0.1
_MILLIVOLTS: Final = 1000
_WHOLE: Final = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Adc:
    """An input that measures what comes out.

    Parameters
    ----------
    tap : str
        Where: line, amplifier, current or motion; at the amplifier as the firmware has it.
    gain : float
        Of the peaks: mV, uA or nm for each mV at the actuator.
    delay_us : float
        From the onset to what is measured of it.
    loss : float
        Probability that nothing of a burst is seen.
    noise : float
        Effective value, in mV, uA or nm.

    Raises
    ------
    ValueError
        A field is out of range.

    Examples
    --------
    >>> Adc.parse("tap=current,gain=0.5").tap
    'current'
    >>> Adc.parse("tap=ear")
    Traceback (most recent call last):
    ValueError: adc tap must be one of line, amplifier, current, motion; got 'ear'
    """

    tap: str = "amplifier"
    gain: float = 1.0
    delay_us: float = 0.0
    loss: float = 0.0
    noise: float = 0.0

    def __post_init__(self) -> None:
        if self.tap not in TAPS[1:]:
            raise ValueError(f"adc tap must be one of {', '.join(TAPS[1:])}; got {self.tap!r}")
        require_real("gain", self.gain, minimum=0.0, maximum=1000.0)
        require_real("delay_us", self.delay_us, minimum=0.0, maximum=1e6)
        require_real("loss", self.loss, minimum=0.0, maximum=1.0)
        require_real("noise", self.noise, minimum=0.0, maximum=1e6)

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the input that a text states."""
        return cls(**parse_settings("adc", text, cls))

    def seen(self, burst: Emission, *, connected: bool, rng: np.random.Generator) -> Measurement:
        """Return what is measured of a burst: nothing, behind a switch that is open."""
        lost = rng.random() < self.loss or not (connected or self.tap == "line")
        gain, volts = 0.0 if lost else self.gain * _MILLIVOLTS, burst.volts
        seen = gain * volts + self.noise * rng.standard_normal(volts.shape)
        norms = np.linalg.norm(seen, axis=1) * np.linalg.norm(volts, axis=1)
        alike = np.divide(np.sum(seen * volts, axis=1), norms, out=0 * norms, where=norms > 0)
        peaks = np.rint(np.abs(seen).max(axis=1, initial=0.0)).astype(int)
        correlations = np.rint(_WHOLE * np.clip(alike, 0.0, 1.0)).astype(int)
        return Measurement(
            token=burst.token,
            tap=self.tap,
            peaks=tuple(peaks.tolist()),
            onset_offset_us=0 if lost else round(self.delay_us),
            onset_uncertainty_us=math.ceil(1e6 / burst.sample_rate_hz),
            correlations=tuple(correlations.tolist()),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Amplifier:
    """An amplifier with a safety switch.

    Parameters
    ----------
    switch_open : bool
        Whether its switch is open, so that nothing can be felt.
    sensed : bool
        Whether switch and over-current are wired to the device.
    over_current_at_s : float
        When it reports over-current, in seconds after the device was started; infinite for never.
    adc : Adc or None
        What measures its bursts.

    Examples
    --------
    >>> amplifier = Amplifier(over_current_at_s=2.0)
    >>> amplifier.sensed_at(1.0).over_current, amplifier.sensed_at(2.0).over_current
    (False, True)
    """

    switch_open: bool = False
    sensed: bool = True
    over_current_at_s: float = math.inf
    adc: Adc | None = None

    def __post_init__(self) -> None:
        if self.over_current_at_s != math.inf:
            require_real("over_current_at_s", self.over_current_at_s, minimum=0.0)

    def sensed_at(self, now_s: float) -> Health:
        """Return what the device senses of it at a time."""
        if not self.sensed:
            return Health()
        over = self.over_current_at_s <= now_s < self.over_current_at_s + _PULSE_S
        return Health(switch_closed=not self.switch_open, over_current=over)

    def seen(self, burst: Emission, rng: np.random.Generator) -> Measurement | None:
        """Return what is measured of a burst, or None where nothing measures."""
        if self.adc is None:
            return None
        return self.adc.seen(burst, connected=not self.switch_open, rng=rng)
