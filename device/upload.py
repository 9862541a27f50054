"""How a waveform travels: begun, in pieces in any order, and stored only if it arrived whole."""

import struct
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from device.driver import Refusal, rejection
from device.wire import unpack

LONGEST_DATA: Final = 32
"""Bytes of a waveform in one DATA: longer frames seldom survive a bad line."""

_SHORT_BITS: Final = 16
_BEGIN: Final = struct.Struct("<BI")
_OFFSET: Final = struct.Struct("<I")
_COMMIT: Final = struct.Struct("<BI")


@dataclass(frozen=True, slots=True, kw_only=True)
class Begin:
    """Begin the upload of a waveform: the codes of the left channel, then those of the right.

    Parameters
    ----------
    slot : int
        0 to 7.
    samples : int
        Of each channel.
    """

    slot: int
    samples: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Commit:
    """End an upload: store it if its bytes are all there and have this CRC-32."""

    slot: int
    crc: int


def pack_begin(message: Begin) -> bytes:
    """Return the content of BEGIN."""
    return _BEGIN.pack(message.slot, message.samples)


def read_begin(content: bytes) -> Begin:
    """Return a BEGIN.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.
    """
    slot, samples = unpack(_BEGIN, content)
    return Begin(slot=slot, samples=samples)


def pack_data(offset: int, piece: bytes) -> bytes:
    """Return the content of DATA."""
    return _OFFSET.pack(offset) + piece


def read_data(content: bytes) -> tuple[int, bytes]:
    """Return the offset in bytes and the bytes of a DATA.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.
    """
    (offset,) = unpack(_OFFSET, content[: _OFFSET.size])
    piece = content[_OFFSET.size :]
    if not 1 <= len(piece) <= LONGEST_DATA:
        raise rejection(Refusal.BAD_MESSAGE, f"{len(piece)} bytes of data")
    return offset, piece


def pack_commit(message: Commit) -> bytes:
    """Return the content of COMMIT."""
    return _COMMIT.pack(message.slot, message.crc)


def read_commit(content: bytes) -> Commit:
    """Return a COMMIT.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.
    """
    slot, crc = unpack(_COMMIT, content)
    return Commit(slot=slot, crc=crc)


def code_type(bits: int) -> np.dtype[np.signedinteger[Any]]:
    """Return how one code of a waveform travels: 16 bit, or 32 where the converter has more.

    Examples
    --------
    >>> code_type(16).str, code_type(24).str
    ('<i2', '<i4')
    """
    return np.dtype("<i2" if bits <= _SHORT_BITS else "<i4")
