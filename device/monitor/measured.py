"""What a monitor measured of a burst, compared with the planned burst.

A tap is the point between converter and finger at which a burst is measured. The monitor cannot see
anything behind it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Final, Protocol

if TYPE_CHECKING:
    from device.driver import Delivery, FloatArray


class Tap(StrEnum):
    """Where a monitor looks.

    >>> Tap("line").unit, Tap("motion").unit
    ('V', 'um')
    """

    LINE = "line"
    AMPLIFIER = "amplifier"
    CURRENT = "current"
    MOTION = "motion"

    @property
    def unit(self) -> str:
        """Unit of what is measured there."""
        return {Tap.CURRENT: "A", Tap.MOTION: "um"}.get(self, "V")

    @property
    def unseen(self) -> str:
        """What is never seen there, to be read after "it never sees"."""
        return _UNSEEN[self]


_UNSEEN: Final = {
    Tap.LINE: "the amplifier: with its switch open, or without supply, every burst is still seen",
    Tap.AMPLIFIER: "a cracked or loosened disc: the voltage is the same",
    Tap.CURRENT: "a disc that came off the plate, but for a small change of current",
    Tap.MOTION: "whether it was as strong as planned: motion depends on the fingers' force, so "
    "that its size is only noted",
}


class Fault(StrEnum):
    """In which way a burst was another one than planned."""

    SILENT = "silent"
    SWAPPED = "swapped"
    STRAY = "stray"  # on a channel that was to stay silent
    DOUBLED = "doubled"
    CLIPPED = "clipped"
    WEAK = "too weak"
    STRONG = "too strong"
    DISTORTED = "distorted"
    EARLY = "early"
    LATE = "late"
    AMPLIFIER_OFF = "amplifier off"


_VOID_BY_MOTION: Final = frozenset(
    {Fault.SILENT, Fault.SWAPPED, Fault.DOUBLED, Fault.AMPLIFIER_OFF}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """By how much a burst may differ from the planned one.

    Attributes
    ----------
    peak : float
        Part of the planned peak.
    onset_s : float
        Seconds.
    correlation : float
        Least, with the planned shape.
    silence : float
        Part of the burst's peak below which a channel is silent.
    """

    peak: float = 0.1
    onset_s: float = 1e-3
    correlation: float = 0.95
    silence: float = 0.2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Planned:
    """What is to be seen at the tap.

    Attributes
    ----------
    shape : array
        Of the burst, shape (n,), its peak 1.
    sample_rate_hz : float
        Of the shape.
    peaks : tuple of float
        Of each channel at the tap, in its unit; 0 for a channel that is to stay silent.
    burst : tuple of float
        Peak of each channel, were a burst of this level on all of them: what is silence is measured
        by them.
    """

    shape: FloatArray
    sample_rate_hz: float
    peaks: tuple[float, ...]
    burst: tuple[float, ...]

    @property
    def blank(self) -> bool:
        """Whether no channel is to sound."""
        return not any(self.peaks)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What was measured of one burst.

    Attributes
    ----------
    token : int
        Token of the burst.
    tap : Tap
        Where it was measured.
    source : str
        What measured it, in a few words.
    peaks : tuple of float or None
        Peak of each channel, in the tap's unit; None if nothing was measured.
    onset_s, onset_uncertainty_s : float or None
        Onset on the host's clock, and the half-width of its 95 % interval; None if the record holds
        no burst.
    late_s : float or None
        Delay of the onset from the planned one.
    correlations : tuple of float or None
        Correlation of each channel with the planned shape, None for a silent channel; None if
        nothing was measured.
    noise : tuple of float or None
        Root mean square of each channel's noise, in the tap's unit.
    faults : tuple of Fault
        Differences from the planned burst that void the trial.
    noted : tuple of Fault
        Differences that are only noted, because the tap shows too little to void the trial.
    unmeasured : str
        Why the burst could not be judged; empty if it could.
    blank : bool
        No channel was planned to sound, so that silence does not verify the path to the finger.
    """

    token: int
    tap: Tap
    source: str
    peaks: tuple[float, ...] | None = None
    onset_s: float | None = None
    onset_uncertainty_s: float | None = None
    late_s: float | None = None
    correlations: tuple[float | None, ...] | None = None
    noise: tuple[float, ...] | None = None
    faults: tuple[Fault, ...] = ()
    noted: tuple[Fault, ...] = ()
    unmeasured: str = ""
    blank: bool = False

    @property
    def verified(self) -> str | None:
        """Return the name of the tap, or ``false`` if the burst differs or was not measured.

        A blank in which nothing was heard gives None, because a dead line would be as silent.

        >>> Measured(token=1, tap=Tap.LINE, source="test").verified
        'line'
        >>> Measured(token=1, tap=Tap.LINE, source="test", faults=(Fault.SILENT,)).verified
        'false'
        """
        if self.faults or self.unmeasured:
            return "false"
        return None if self.blank else self.tap.value

    @property
    def text(self) -> str:
        """Say it to the operator."""
        if self.faults:
            return f"the burst was {', '.join(self.faults)}"
        return f"the burst was not measured: {self.unmeasured}" if self.unmeasured else "verified"


class Monitor(Protocol):
    """Measures what comes out, burst by burst."""

    @property
    def tap(self) -> Tap:
        """Where it looks."""

    @property
    def source(self) -> str:
        """By what it looks, in a few words."""

    @property
    def unseen(self) -> str:
        """What it never sees."""

    def open(self) -> None:
        """Begin to listen; `LinkError` where that cannot be. Once more after a loss."""

    def begin(self, token: int, planned: Planned) -> None:
        """Note that a burst is about to be fired; what was heard until now holds none."""

    def end(self, delivery: Delivery) -> Measured:
        """Return what came out since, up to now at least; touches no disk."""

    def close(self) -> None:
        """Listen no more."""


def void(faults: tuple[Fault, ...], tap: Tap) -> tuple[Fault, ...]:
    """Return the faults for which a trial does not count.

    Motion depends on the fingers' force: voiding a trial for its size would select trials by what
    the participant did.

    >>> void((Fault.WEAK, Fault.SILENT), Tap.MOTION)
    (<Fault.SILENT: 'silent'>,)
    """
    return tuple(fault for fault in faults if tap is not Tap.MOTION or fault in _VOID_BY_MOTION)
