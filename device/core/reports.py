"""What a device reports: its limits, the health of its amplifier, and its measurements.

All numbers are whole, as they are transmitted; None is a value that the device does not know.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Final, Self

if TYPE_CHECKING:
    from device.limits import Limits

PPM: Final = 1_000_000
"""Ratios travel in millionths."""


class Entropy(StrEnum):
    """Where a boot id comes from: two power cycles must never be taken for one."""

    NONE = "a counter, not random"
    SYSTEM = "the operating system"
    HARDWARE = "a hardware generator"
    GIVEN = "given when it was started"


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceLimits:
    """Limits of a device, other than the ceiling and the waveforms, which its identity states.

    Attributes
    ----------
    slots : int
        Number of waveform slots, counted from 0.
    memory_samples : int
        Samples of one channel that all slots together hold.
    least_interval_us : int
        Rest from the end of one burst to the onset of the next.
    max_duty_ppm : int
        Largest ratio of a burst's duration to the time from its onset to the next, in millionths.
    dc_tolerance_ppm : int
        Largest ratio of |sum| to sum|.| of a waveform, in millionths.
    longest_time_to_live_us : int
        Of an armed token.
    entropy : Entropy
        Where its boot id comes from.
    firmware : str
        Its name and version; 32 ASCII characters at most.
    """

    slots: int
    memory_samples: int
    least_interval_us: int
    max_duty_ppm: int
    dc_tolerance_ppm: int
    longest_time_to_live_us: int
    entropy: Entropy = Entropy.SYSTEM
    firmware: str = ""

    @classmethod
    def of(cls, limits: Limits, about: About) -> Self:
        """Return the report of a device that has these limits.

        >>> from device.limits import Limits
        >>> DeviceLimits.of(Limits(ceiling_vpp=200.0), About()).max_duty_ppm
        500000
        """
        of_about = asdict(about)
        names = [field.name for field in fields(cls) if field.name not in of_about]
        return cls(**{name: getattr(limits, name) for name in names}, **of_about)

    def applied(self, limits: Limits) -> Limits:
        """Return limits as they are with those of this device in their place."""
        return replace(
            limits,
            slots=self.slots,
            memory_samples=self.memory_samples,
            min_interval_s=self.least_interval_us / 1e6,
            max_duty=self.max_duty_ppm / PPM,
            dc_tolerance=self.dc_tolerance_ppm / PPM,
            longest_time_to_live_s=self.longest_time_to_live_us / 1e6,
        )

    def __str__(self) -> str:
        """Summarize in one line the limits that a study may reach."""
        return (
            f"{self.firmware or 'no firmware named'}, {self.slots} slots of "
            f"{self.memory_samples} samples together, rest {self.least_interval_us / 1e3:g} ms, "
            f"duty {self.max_duty_ppm / 1e4:g} %, DC {self.dc_tolerance_ppm / 1e4:g} %, "
            f"boot id from {self.entropy}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class About:
    """What a device says of itself that no limit is."""

    firmware: str = "tactstrip core"
    entropy: Entropy = Entropy.SYSTEM


OURS: Final = About()
"""What a core in Python says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """Whether the amplifier can drive; None where a device does not know.

    Attributes
    ----------
    amplifier_enabled : bool or None
        Whether the amplifier is switched on.
    switch_closed : bool or None
        Whether the safety switch is closed.
    over_current : bool or None
        Whether the amplifier has reported over-current since the output was enabled.

    Examples
    --------
    >>> print(Health(amplifier_enabled=True, switch_closed=False))
    amplifier enabled, safety switch open, over-current not known
    """

    amplifier_enabled: bool | None = None
    switch_closed: bool | None = None
    over_current: bool | None = None

    @classmethod
    def of_bits(cls, *, reported_bits: int, set_bits: int) -> Self:
        """Return the health that two bytes encode; other bits than those below are ignored.

        Parameters
        ----------
        reported_bits : int
            Bits that the device reports: 0 amplifier, 1 switch, 2 over-current.
        set_bits : int
            Values of these bits.

        Returns
        -------
        Health
            None for each bit that the device does not report.

        Examples
        --------
        >>> Health.of_bits(reported_bits=6, set_bits=2).reported_bits
        6
        """
        states = [bool(set_bits >> bit & 1) for bit in range(3)]
        enabled, closed, over = (
            state if reported_bits >> bit & 1 else None for bit, state in enumerate(states)
        )
        return cls(amplifier_enabled=enabled, switch_closed=closed, over_current=over)

    @property
    def reported_bits(self) -> int:
        """Bits of what the device reports: 0 amplifier, 1 switch, 2 over-current."""
        return sum((state is not None) << bit for bit, state in enumerate(self._states))

    @property
    def set_bits(self) -> int:
        """Bits of what is so."""
        return sum(bool(state) << bit for bit, state in enumerate(self._states))

    @property
    def _states(self) -> tuple[bool | None, ...]:
        return self.amplifier_enabled, self.switch_closed, self.over_current

    def __str__(self) -> str:
        """Return it in one line."""
        texts = (
            ("amplifier", "disabled", "enabled"),
            ("safety switch", "open", "closed"),
            ("over-current", "none", "reported"),
        )
        return ", ".join(
            f"{item} {'not known' if state is None else yes if state else no}"
            for (item, no, yes), state in zip(texts, self._states, strict=True)
        )


TAPS: Final = ("", "line", "amplifier", "current", "motion")
"""Where a burst may be measured, by its number on the wire; what lies behind is never seen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """What a device measured of the burst of a token; where it did, at a tap.

    Attributes
    ----------
    token : int
        That fired it.
    tap : str
        Where: a word of `TAPS`, empty where it was not measured.
    peaks : tuple of int
        Peak magnitude of each channel, in mV; of a current in uA, of motion in nm.
    onset_offset_us, onset_uncertainty_us : int
        From the onset that the device reported to the one that it measured.
    correlations : tuple of int
        Of each channel with what was to be played, in 1e-4; 0 where it was to be silent.

    Examples
    --------
    >>> Measurement(token=7, tap="amplifier", peaks=(49_900, 0), correlations=(9_990, 0)).peaks[0]
    49900
    """

    token: int
    tap: str = ""
    peaks: tuple[int, ...] = ()
    onset_offset_us: int = 0
    onset_uncertainty_us: int = 0
    correlations: tuple[int, ...] = ()
