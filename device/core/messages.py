"""The messages to a device as values, in the whole numbers it counts in.

Slots, 64-bit tokens, millivolts peak-to-peak, microseconds and converter codes. Fields are checked
with the refusals of the device, so that a message that exists is well formed wherever it was made;
whether it is allowed is for limits and states to say. How it lies on a wire is the table in
wire/protocol.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic

import numpy as np

from device.checks import is_real, is_whole
from device.core.reports import DeviceLimits, Health, Measurement
from device.core.tokens import Record, Reply
from device.driver import LARGEST_TOKEN
from device.errors import Refusal, rejection

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from device.limits import CodeArray

_LARGEST_SLOT = 255
_LARGEST_LEVEL_MVPP = 2**32 - 1
_GRID_TOLERANCE_MVPP = 1e-6


def check_slot(slot: int) -> int:
    """Return a slot's number, 0 to 255, as a plain integer, or refuse it with BAD_SLOT.

    Devices have fewer, see `device.limits.check_slot`.
    """
    if not is_whole(slot) or not 0 <= slot <= _LARGEST_SLOT:
        raise rejection(Refusal.BAD_SLOT, f"0 to {_LARGEST_SLOT}, got {slot!r}")
    return int(slot)


def check_token(token: int) -> int:
    """Return a token, 1 to 2**64 - 1, as a plain integer, or refuse it with BAD_TOKEN."""
    if not is_whole(token) or not 1 <= token <= LARGEST_TOKEN:
        raise rejection(Refusal.BAD_TOKEN, f"got {token!r}")
    return int(token)


def check_millivolts(level_mvpp: int) -> int:
    """Return a level, 0 to 2**32 - 1 mV, as a plain integer, or refuse it with BAD_LEVEL."""
    if not is_whole(level_mvpp) or not 0 <= level_mvpp <= _LARGEST_LEVEL_MVPP:
        raise rejection(Refusal.BAD_LEVEL, f"got {level_mvpp!r} mV")
    return int(level_mvpp)


def to_millivolts(level_vpp: float, *, up: bool = False) -> int:
    """Return a level in whole millivolts, rounded toward zero, or refuse it with BAD_LEVEL.

    `up` rounds away from zero, for what is held against a ceiling. A level within 1e-6 mV of the
    grid is taken to lie on it: no float represents 64.1 V.

    >>> to_millivolts(64.1), to_millivolts(199.9999), to_millivolts(199.9999, up=True)
    (64100, 199999, 200000)
    """
    if not is_real(level_vpp) or not 0.0 <= level_vpp <= _LARGEST_LEVEL_MVPP / 1000:
        raise rejection(Refusal.BAD_LEVEL, f"got {level_vpp!r} V")
    level_mvpp = level_vpp * 1000
    if up:
        return check_millivolts(math.ceil(level_mvpp - _GRID_TOLERANCE_MVPP))
    return check_millivolts(math.floor(level_mvpp + _GRID_TOLERANCE_MVPP))


def to_microseconds(time_to_live_s: float) -> int:
    """Return a time to live in whole microseconds, or refuse it with BAD_TIME_TO_LIVE."""
    if not is_real(time_to_live_s):
        raise rejection(Refusal.BAD_TIME_TO_LIVE, f"got {time_to_live_s!r}")
    return round(time_to_live_s * 1e6)


def to_codes(samples: ArrayLike, bits: int) -> CodeArray:
    """Return the converter codes of samples in [-1, 1], a row for each channel.

    Codes are rounded toward zero, so that none exceeds its sample. Full scale is 2**(bits - 1) - 1
    in both directions, which makes the codes symmetric about zero. Samples that have no code are
    refused with NOT_FINITE or OUT_OF_RANGE; anything but a table of real numbers is a ValueError.

    >>> to_codes([[0.0, 1.0, -1.0, 0.5]], bits=16).tolist()
    [[0, 32767, -32767, 16383]]
    >>> to_codes([True, False], bits=16)
    Traceback (most recent call last):
    ValueError: samples must be real numbers, a row for each channel; got bool, shape (2,)
    """
    waveforms = np.asarray(samples)
    if waveforms.ndim != 2 or waveforms.dtype.kind not in "iuf":  # noqa: PLR2004 - rows, columns
        raise ValueError(
            f"samples must be real numbers, a row for each channel; got {waveforms.dtype.name}, "
            f"shape {waveforms.shape}"
        )
    peaks = np.abs(waveforms).max(axis=1, initial=0.0)
    for channel, peak in enumerate(peaks.tolist(), start=1):
        if not math.isfinite(peak):
            raise rejection(Refusal.NOT_FINITE, f"channel {channel}")
        if peak > 1.0:
            raise rejection(Refusal.OUT_OF_RANGE, f"channel {channel} reaches {peak:g}")
    codes: CodeArray = np.trunc(waveforms * full_scale(bits)).astype(np.int32)
    return codes


def full_scale(bits: int) -> int:
    """Return the largest code of a converter with `bits` bits."""
    return int(2 ** (bits - 1) - 1)


class Message(Generic[Reply]):
    """What a host says to a device; the type in brackets is what it is answered with."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Ping(Message[None]):
    """Ask for nothing but an answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AskLimits(Message[DeviceLimits]):
    """Ask what the device is ready to do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AskHealth(Message[Health]):
    """Ask whether the amplifier can drive."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadSlot(Message[None]):
    """Store codes, shape (n_channels, n_samples), in a slot."""

    slot: int
    codes: CodeArray

    def __post_init__(self) -> None:
        check_slot(self.slot)


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels(Message[None]):
    """Set the level of each channel, in peak-to-peak millivolts at the actuator.

    >>> Levels(levels_mvpp=(130_000, 0)).vpp
    (130.0, 0.0)
    """

    levels_mvpp: tuple[int, ...]

    def __post_init__(self) -> None:
        for level_mvpp in self.levels_mvpp:
            check_millivolts(level_mvpp)

    @property
    def vpp(self) -> tuple[float, ...]:
        """The levels in peak-to-peak volts."""
        return tuple(level_mvpp / 1000 for level_mvpp in self.levels_mvpp)


@dataclass(frozen=True, slots=True, kw_only=True)
class Enable(Message[None]):
    """Switch the output on: the only way out of a stop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm(Message[None]):
    """Allow a token to play a slot, for some microseconds from the device's receipt.

    >>> Arm(token=0, slot=0, time_to_live_us=1000)
    Traceback (most recent call last):
    device.errors.Rejected: a token must be an integer from 1 to 2**64 - 1: got 0
    """

    token: int
    slot: int
    time_to_live_us: int

    def __post_init__(self) -> None:
        check_token(self.token)
        check_slot(self.slot)


@dataclass(frozen=True, slots=True, kw_only=True)
class _OfToken(Message[Reply]):
    token: int

    def __post_init__(self) -> None:
        check_token(self.token)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fire(_OfToken[Record]):
    """Play the armed slot; a token that has fired gives its record and no other burst."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disarm(_OfToken[None]):
    """Make sure that a token cannot fire from now on, whether it is armed or never was."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Query(_OfToken[Record]):
    """Ask what became of a token."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AskMeasured(_OfToken[Measurement]):
    """Ask what the device measured of a token's burst."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop(Message[None]):
    """Bring the outputs to zero: legal in every state."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Beat(Message[None]):
    """Let the device hear that its host is alive."""
