"""What a monitor saw of a burst, beside what was planned, and whether the two agree.

A tap tells where along the way from converter to finger it was looked, and so what stays unseen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Final, Protocol

from device.checks import require_positive, require_real
from device.limits import CHANNELS
from device.monitor.matching import Template

if TYPE_CHECKING:
    from device.driver import Delivery, FloatArray
    from device.monitor.matching import Found


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
    DELAYED = "delay changed"  # since the burst before: noted, as each is within its tolerance


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

    def __post_init__(self) -> None:
        require_real("peak", self.peak, least=0.01, most=0.5)
        require_real("onset_s", self.onset_s, least=1e-5, most=0.1)
        require_real("correlation", self.correlation, least=0.5, most=0.9999)
        require_real("silence", self.silence, least=0.01, most=0.5)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Planned:
    """What is to be seen at the tap.

    Attributes
    ----------
    shape : array
        Of the burst, shape (n,), its peak 1.
    sample_rate_hz : float
        Of the shape.
    left, right : float
        Peaks at the tap, in its unit; 0 for a channel that is to stay silent.
    burst : tuple of float
        Peaks, left and right, of a burst of this level, were it on both: what is silence is
        measured by them.
    """

    shape: FloatArray
    sample_rate_hz: float
    left: float
    right: float
    burst: tuple[float, float]

    def __post_init__(self) -> None:
        require_positive("sample_rate_hz", self.sample_rate_hz)
        for name, peak, full in zip(CHANNELS, self.peaks, self.burst, strict=True):
            require_positive("burst", full)
            if peak not in (0, full):
                raise ValueError(f"{name} must be 0 or that of the burst, {full}; got {peak}")

    @property
    def peaks(self) -> tuple[float, float]:
        """Peaks, left and right."""
        return self.left, self.right

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
        Of the burst.
    tap : Tap
        Where.
    source : str
        By what, in a few words.
    peak_left, peak_right : float or None
        In the tap's unit; None where nothing was measured.
    onset_s, onset_uncertainty_s : float or None
        When it came out on the host's clock, and by how much that is known with 95 %; None where
        no burst was found.
    late_s : float or None
        How much later it came out than planned.
    correlation_left, correlation_right : float or None
        With the planned shape; None of a silent channel.
    noise_left, noise_right : float or None
        Effective value of the noise, in the tap's unit.
    faults : tuple of Fault
        In which ways it was another one than planned, so that the trial does not count.
    noted : tuple of Fault
        The same, where the tap does not tell enough for that.
    unmeasured : str
        Why nothing can be said; empty where something can.
    blank : bool
        No channel was to sound: silence tells nothing of the way to the finger.
    """

    token: int
    tap: Tap
    source: str
    peak_left: float | None = None
    peak_right: float | None = None
    onset_s: float | None = None
    onset_uncertainty_s: float | None = None
    late_s: float | None = None
    correlation_left: float | None = None
    correlation_right: float | None = None
    noise_left: float | None = None
    noise_right: float | None = None
    faults: tuple[Fault, ...] = ()
    noted: tuple[Fault, ...] = ()
    unmeasured: str = ""
    blank: bool = False

    @property
    def verified(self) -> str | None:
        """Return the tap's word, or ``false`` where it was another burst or was not measured.

        None where nothing was to be heard, and nothing was: a dead line would tell the same.

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


LEAST_SNR_DB: Final = 10.0
"""Ratio of a burst's effective value to the noise's; below it nothing is told."""
_SURE: Final = 3.5
"""Standard deviations: by so much the threshold lies inside of a tolerance, so that noise lets
nothing pass that is beyond it; and by as much again outside of what a good burst is taken for."""
_SURE_OF_TOP: Final = 4.5
"""The same of a flat top, which no threshold keeps clear of noise: a top may be two samples."""
_FLAT: Final = (0.5, 1.0, 1.0)
"""Parts of the peak's tolerance: of all tops; of one sign's, which a slow drift moves, too."""
_FOUND: Final = 6.0
"""Standard deviations: what is above them is no noise, wherever in a record it is looked for."""
_AGAIN_BY_MOTION: Final = 0.7
"""A plate rings: only what is as strong as this part of a burst, and clear of it, is a second."""


def judge(
    planned: Planned,
    found: tuple[Found, Found],
    *,
    tap: Tap,
    tolerances: Tolerances,
    late_s: tuple[float, float],
    sample_rate_hz: float,
) -> tuple[tuple[Fault, ...], str]:
    """Return in which ways a burst was another one, and why it cannot be told; empty if not.

    `late_s` are left's and right's. An overloaded input is a fault however strong the noise is.
    """
    rms, sized = Template(planned.shape).rms, tap is not Tap.MOTION
    faults = [Fault.CLIPPED] if any(one.overloaded for one in found) else []
    for peak, full, one in zip(planned.peaks, planned.burst, found, strict=True):
        snr_db = 20 * math.log10(full * rms / one.noise_rms)
        finest = tolerances if peak and sized else None
        why = _too_noisy(snr_db, one, full, finest=finest, silence=tolerances.silence)
        if why:
            return tuple(faults), why
    heard = [
        (one.amplitude if peak else max(one.largest, one.loudest * sized)) / full
        for peak, full, one in zip(planned.peaks, planned.burst, found, strict=True)
    ]
    faults += _of_channels(planned, found, heard, tolerances, tap)
    faults += _again(planned, found, tap, tolerances)
    if not {Fault.SILENT, Fault.SWAPPED} & {*faults}:
        faults += _of_onset(planned, found, tolerances, late_s, sample_rate_hz)
    return tuple(dict.fromkeys(faults)), ""


def void(faults: tuple[Fault, ...], tap: Tap) -> tuple[Fault, ...]:
    """Return the faults for which a trial does not count.

    Motion depends on the fingers' force: voiding a trial for its size would select trials by what
    the participant did.

    >>> void((Fault.WEAK, Fault.SILENT), Tap.MOTION)
    (<Fault.SILENT: 'silent'>,)
    """
    return tuple(one for one in faults if tap is not Tap.MOTION or one in _VOID_BY_MOTION)


def _too_noisy(
    snr_db: float, one: Found, full: float, *, finest: Tolerances | None, silence: float
) -> str:
    """Say why no tolerance is kept apart from noise; `finest`: of a burst's size and shape."""
    if snr_db < LEAST_SNR_DB:
        return f"the noise is only {snr_db:.1f} dB below the burst; {LEAST_SNR_DB:g} are needed"
    sd = one.amplitude_sd / full
    needed = sd * _FOUND / silence
    if finest is not None:
        needed = max(needed, sd * 2 * _SURE / finest.peak)
        if one.amplitude >= silence * full:  # energies grow with the square of the noise
            apart = 2 * _SURE * one.correlation_sd / (1 - finest.correlation)
            needed = max(needed, math.sqrt(apart))
    if needed <= 1:
        return ""
    least_db = snr_db + 20 * math.log10(needed)
    told = f"the noise is {snr_db:.1f} dB below the burst; for these tolerances {least_db:.1f}"
    return f"{told} are needed"


def _no_silence(one: Found, full: float, silence: float) -> float:
    """Return the part of a burst from which a channel was not silent, whatever noise took off."""
    return max(silence - _SURE * one.amplitude_sd / full, _FOUND * one.amplitude_sd / full)


def _of_channels(
    planned: Planned,
    found: tuple[Found, Found],
    heard: list[float],
    tolerances: Tolerances,
    tap: Tap,
) -> list[Fault]:
    faults: list[Fault] = []
    sides = list(zip(planned.peaks, planned.burst, found, heard, strict=True))
    stray = [part for peak, _, _, part in sides if not peak]
    if len(stray) == 1:  # where both play the same, or none does, nobody can tell them apart
        wanted = next(part for peak, _, _, part in sides if peak)
        least = stray[0] / 2 if tap is Tap.MOTION else tolerances.silence
        if wanted < least and stray[0] >= tolerances.silence:
            return [Fault.SWAPPED]
    for peak, full, one, part in sides:
        if not peak:
            if part >= _no_silence(one, full, tolerances.silence):
                faults.append(Fault.STRAY)
        elif part < tolerances.silence:
            faults.append(Fault.SILENT)
        else:
            faults += _of_size(part, one, full, tolerances)
    return faults


def _of_size(part: float, one: Found, full: float, tolerances: Tolerances) -> list[Fault]:
    faults = []
    margin = tolerances.peak - _SURE * one.amplitude_sd / full
    if part < 1 - margin:
        faults.append(Fault.WEAK)
    if part > 1 + margin:
        faults.append(Fault.STRONG)
    for (top, sd), share in zip(one.tops, _FLAT, strict=False):  # a shape may have one sign
        flat = max(share * tolerances.peak * one.amplitude, _SURE_OF_TOP * sd)
        faults += [Fault.CLIPPED] * (one.amplitude - top > flat)
    if one.inverted or one.correlation < tolerances.correlation + _SURE * one.correlation_sd:
        faults.append(Fault.DISTORTED)
    return faults


def _again(
    planned: Planned, found: tuple[Found, Found], tap: Tap, tolerances: Tolerances
) -> list[Fault]:
    frames = len(planned.shape)
    for peak, full, one in zip(planned.peaks, planned.burst, found, strict=True):
        if tap is Tap.MOTION:
            loud = max(_AGAIN_BY_MOTION * one.amplitude, tolerances.silence * full)
            again = one.second > loud and abs(one.second_at) > frames - 2  # both ends are 0
        else:
            least = _no_silence(one, full, tolerances.silence) * full
            again = max(one.second, one.beside) > least
        if peak and again:
            return [Fault.DOUBLED]
    return []


def _of_onset(
    planned: Planned,
    found: tuple[Found, Found],
    tolerances: Tolerances,
    late_s: tuple[float, float],
    sample_rate_hz: float,
) -> list[Fault]:
    faults = []
    for peak, one, late in zip(planned.peaks, found, late_s, strict=True):
        margin_s = max(tolerances.onset_s - one.onset_uncertainty / sample_rate_hz, 0.0)
        if peak and abs(late) > margin_s:
            faults.append(Fault.LATE if late > 0 else Fault.EARLY)
    return faults
