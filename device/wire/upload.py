"""A waveform on the wire: in pieces, in any order, stored only if it arrived whole."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from device.core.messages import LoadSlot, Message, check_slot
from device.driver import Refusal, rejection

if TYPE_CHECKING:
    from collections.abc import Iterator

LONGEST_DATA: Final = 32
"""Bytes of a waveform in one DATA: longer frames seldom survive a bad line."""

_SHORT_BITS: Final = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Begin(Message[None]):
    """Begin the upload of a waveform: the codes of the left channel, then those of the right.

    `samples` is the number of each channel.
    """

    slot: int
    samples: int

    def __post_init__(self) -> None:
        check_slot(self.slot)


@dataclass(frozen=True, slots=True, kw_only=True)
class Data(Message[None]):
    """Some octets of the waveform, and where they belong."""

    offset: int
    octets: bytes

    def __post_init__(self) -> None:
        if not 1 <= len(self.octets) <= LONGEST_DATA:
            raise rejection(Refusal.BAD_MESSAGE, f"{len(self.octets)} bytes of data")


@dataclass(frozen=True, slots=True, kw_only=True)
class Commit(Message[None]):
    """End an upload: store it if its bytes are all there and have this CRC-32."""

    slot: int
    crc: int


Piece: TypeAlias = Begin | Data | Commit


def pieces(message: LoadSlot, bits: int) -> Iterator[Piece]:
    """Return the messages that carry a waveform to a device with converters of `bits` bits."""
    codes = np.concatenate((message.left, message.right)).astype(_code_type(bits)).tobytes()
    yield Begin(slot=message.slot, samples=int(message.left.size))
    for offset in range(0, len(codes), LONGEST_DATA):
        yield Data(offset=offset, octets=codes[offset : offset + LONGEST_DATA])
    yield Commit(slot=message.slot, crc=zlib.crc32(codes))


@dataclass(slots=True)
class _Pending:
    slot: int
    data: bytearray
    missing: set[int]


class Uploads:
    """The device's end: pieces to a waveform, of at most `longest` samples of `bits` bits."""

    def __init__(self, *, bits: int, longest: int) -> None:
        self._type = _code_type(bits)
        self._longest = longest
        self._pending: _Pending | None = None

    def forget(self) -> None:
        """Forget the upload that is under way."""
        self._pending = None

    def take(self, piece: Piece) -> LoadSlot | None:
        """Return the waveform that a piece completes, or None; refuse what does not fit."""
        match piece:
            case Begin():
                self._begin(piece)
            case Data():
                self._add(piece)
            case Commit():
                return self._finish(piece)
        return None

    def _begin(self, begin: Begin) -> None:
        if begin.samples == 0:
            raise rejection(Refusal.WAVEFORM_EMPTY)
        if begin.samples > self._longest:
            raise rejection(Refusal.WAVEFORM_TOO_LONG, f"{begin.samples} samples")
        size = 2 * begin.samples * self._type.itemsize
        self._pending = _Pending(begin.slot, bytearray(size), set(range(0, size, LONGEST_DATA)))

    def _add(self, piece: Data) -> None:
        offset, pending = piece.offset, self._pending
        if pending is None or offset % LONGEST_DATA or offset >= len(pending.data):
            raise rejection(Refusal.BAD_UPLOAD, f"no place for bytes at {offset}")
        if len(piece.octets) != min(LONGEST_DATA, len(pending.data) - offset):
            raise rejection(Refusal.BAD_UPLOAD, f"{len(piece.octets)} bytes at {offset}")
        pending.data[offset : offset + len(piece.octets)] = piece.octets
        pending.missing.discard(offset)

    def _finish(self, commit: Commit) -> LoadSlot:
        pending, self._pending = self._pending, None
        if pending is None or pending.slot != commit.slot or pending.missing:
            raise rejection(Refusal.BAD_UPLOAD)
        if zlib.crc32(pending.data) != commit.crc:
            raise rejection(Refusal.BAD_UPLOAD, "its checksum differs")
        codes = np.frombuffer(bytes(pending.data), dtype=self._type)
        left, right = codes.astype(np.int32).reshape(2, -1)
        return LoadSlot(slot=commit.slot, left=left, right=right)


def _code_type(bits: int) -> np.dtype[np.signedinteger[Any]]:
    """Return how one code travels: 16 bit signed, or 32 where the converter has more."""
    return np.dtype("<i2" if bits <= _SHORT_BITS else "<i4")
