"""The messages to a device, in the whole numbers it counts in.

Slots, 64-bit tokens, millivolts peak-to-peak, microseconds and converter codes. Fields are checked
with the refusals of the device, so that a message that exists is well formed wherever it was made;
whether it is allowed is for limits and states to say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from device.checks import is_real, is_whole
from device.driver import LARGEST_TOKEN, FloatArray, Refusal, rejection

CodeArray: TypeAlias = NDArray[np.int32]

SLOTS = 8
"""Number of waveform slots, 0 to 7."""

_LARGEST_LEVEL_MVPP = 2**32 - 1
_GRID_TOLERANCE_MVPP = 1e-6


def check_slot(slot: int) -> int:
    """Return a slot's number as a plain integer, or refuse it.

    Raises
    ------
    Rejected
        With code BAD_SLOT: not an integer from 0 to 7.

    Examples
    --------
    >>> check_slot(7)
    7
    """
    if not is_whole(slot) or not 0 <= slot < SLOTS:
        raise rejection(Refusal.BAD_SLOT, f"0 to {SLOTS - 1}, got {slot!r}")
    return int(slot)


def check_token(token: int) -> int:
    """Return a token as a plain integer, or refuse it.

    Raises
    ------
    Rejected
        With code BAD_TOKEN: not an integer from 1 to 2**64 - 1.

    Examples
    --------
    >>> check_token(2**64 - 1) == 2**64 - 1
    True
    """
    if not is_whole(token) or not 1 <= token <= LARGEST_TOKEN:
        raise rejection(Refusal.BAD_TOKEN, f"got {token!r}")
    return int(token)


def check_millivolts(level_mvpp: int) -> int:
    """Return a level in millivolts as a plain integer, or refuse it.

    Raises
    ------
    Rejected
        With code BAD_LEVEL: not an integer from 0 to 2**32 - 1.

    Examples
    --------
    >>> check_millivolts(200_000)
    200000
    """
    if not is_whole(level_mvpp) or not 0 <= level_mvpp <= _LARGEST_LEVEL_MVPP:
        raise rejection(Refusal.BAD_LEVEL, f"got {level_mvpp!r} mV")
    return int(level_mvpp)


def to_millivolts(level_vpp: float) -> int:
    """Return a level on the grid of whole millivolts that the device counts in.

    Rounded toward zero; a level within 1e-6 mV of the grid is taken to lie on it, so that 64.1 V,
    which no float represents, is 64100 mV.

    Parameters
    ----------
    level_vpp : float
        In peak-to-peak volts.

    Returns
    -------
    int
        In peak-to-peak millivolts.

    Raises
    ------
    Rejected
        With code BAD_LEVEL: not a finite number, negative, or beyond 32 bit.

    Examples
    --------
    >>> to_millivolts(64.1), to_millivolts(199.9999)
    (64100, 199999)
    """
    if not is_real(level_vpp) or not 0.0 <= level_vpp <= _LARGEST_LEVEL_MVPP / 1000:
        raise rejection(Refusal.BAD_LEVEL, f"got {level_vpp!r} V")
    return check_millivolts(math.floor(level_vpp * 1000 + _GRID_TOLERANCE_MVPP))


def to_microseconds(time_to_live_s: float) -> int:
    """Return a time to live in whole microseconds.

    Raises
    ------
    Rejected
        With code BAD_TIME_TO_LIVE: not a finite number.

    Examples
    --------
    >>> to_microseconds(0.5)
    500000
    """
    if not is_real(time_to_live_s):
        raise rejection(Refusal.BAD_TIME_TO_LIVE, f"got {time_to_live_s!r}")
    return round(time_to_live_s * 1e6)


def as_waveform(name: str, samples: ArrayLike) -> FloatArray:
    """Return samples as float64, or refuse what is no row of real numbers.

    Parameters
    ----------
    name : str
        The argument, for the message.
    samples : array_like, shape (n,)
        Dimensionless.

    Raises
    ------
    ValueError
        Not one-dimensional, or neither integers nor real floats.

    Examples
    --------
    >>> as_waveform("left", [0, 1, -1, 0]).dtype.name
    'float64'
    >>> as_waveform("left", [True, False])
    Traceback (most recent call last):
    ValueError: left must be a one-dimensional array of real numbers, got bool, shape (2,)
    """
    given = np.asarray(samples)
    if given.ndim != 1 or given.dtype.kind not in "iuf":
        raise ValueError(
            f"{name} must be a one-dimensional array of real numbers, "
            f"got {given.dtype.name}, shape {given.shape}"
        )
    return given.astype(np.float64, copy=False)


def to_codes(waveform: FloatArray, bits: int) -> CodeArray:
    """Return the converter codes of a normalised waveform, rounded toward zero.

    Full scale is 2**(bits - 1) - 1 to both sides, so that codes are symmetric about zero and no
    code stands for more than its sample.

    Parameters
    ----------
    waveform : ndarray, shape (n,)
        Samples in [-1, 1].
    bits : int
        Of the converter.

    Returns
    -------
    ndarray of int32, shape (n,)
        Codes from -full scale to full scale.

    Examples
    --------
    >>> to_codes(np.array([0.0, 1.0, -1.0, 0.5]), bits=16).tolist()
    [0, 32767, -32767, 16383]
    """
    return np.trunc(waveform * full_scale(bits)).astype(np.int32)


def full_scale(bits: int) -> int:
    """Return the largest code of a converter with `bits` bits.

    Examples
    --------
    >>> full_scale(16)
    32767
    """
    return int(2 ** (bits - 1) - 1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Load:
    """Store the codes of both channels in a slot.

    Parameters
    ----------
    slot : int
        0 to 7.
    left, right : ndarray of int32, shape (n,)
        Converter codes.

    Raises
    ------
    Rejected
        With code BAD_SLOT.

    Examples
    --------
    >>> import numpy as np
    >>> silence = np.zeros(4, dtype=np.int32)
    >>> Load(slot=8, left=silence, right=silence)
    Traceback (most recent call last):
    device.driver.Rejected: there is no such slot: 0 to 7, got 8
    """

    slot: int
    left: CodeArray
    right: CodeArray

    def __post_init__(self) -> None:
        check_slot(self.slot)


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """Set the levels of both channels.

    Parameters
    ----------
    left_mvpp, right_mvpp : int
        Peak-to-peak millivolts at the actuator.

    Raises
    ------
    Rejected
        With code BAD_LEVEL.

    Examples
    --------
    >>> Levels(left_mvpp=130_000, right_mvpp=0).vpp
    (130.0, 0.0)
    """

    left_mvpp: int
    right_mvpp: int

    def __post_init__(self) -> None:
        check_millivolts(self.left_mvpp)
        check_millivolts(self.right_mvpp)

    @property
    def vpp(self) -> tuple[float, float]:
        """Left and right level in peak-to-peak volts."""
        return self.left_mvpp / 1000, self.right_mvpp / 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """Allow a token to play a slot for a while.

    Parameters
    ----------
    token : int
        1 to 2**64 - 1.
    slot : int
        0 to 7.
    time_to_live_us : int
        Microseconds from the device's receipt.

    Raises
    ------
    Rejected
        With code BAD_TOKEN or BAD_SLOT.

    Examples
    --------
    >>> Arm(token=0, slot=0, time_to_live_us=1000)
    Traceback (most recent call last):
    device.driver.Rejected: a token must be an integer from 1 to 2**64 - 1: got 0
    """

    token: int
    slot: int
    time_to_live_us: int

    def __post_init__(self) -> None:
        check_token(self.token)
        check_slot(self.slot)
