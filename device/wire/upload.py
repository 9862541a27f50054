"""A waveform on the wire: in pieces, in any order, stored only if it arrived whole."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from device.core.messages import LoadSlot, Message
from device.errors import Refusal, rejection
from device.limits import check_memory, check_slot

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from device.core.output import OutputStage
    from device.limits import Limits

LONGEST_DATA: Final = 32
"""Bytes of a waveform in one DATA: longer frames seldom survive a bad line."""

_SHORT_BITS: Final = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Begin(Message[None]):
    """Begin the upload of a waveform: the codes of the first channel, then of the next.

    `samples` is the number of each channel.
    """

    slot: int
    samples: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Data(Message[None]):
    """Some octets of the waveform, where they belong, and the number of the upload's BEGIN."""

    upload: int
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


def octets_of(message: LoadSlot, bits: int) -> bytes:
    """Return the bytes that carry a waveform to a device with converters of `bits` bits."""
    return message.codes.astype(_code_type(bits)).tobytes()


def data_of(octets: bytes, upload: int) -> Iterator[Data]:
    """Return a waveform's bytes in pieces, for the upload that a BEGIN of this number began."""
    for offset in range(0, len(octets), LONGEST_DATA):
        yield Data(upload=upload, offset=offset, octets=octets[offset : offset + LONGEST_DATA])


@dataclass(slots=True)
class _Pending:
    upload: int
    slot: int
    data: bytearray
    missing: set[int]


class Uploads:
    """The device's end: pieces to codes for the converters of a device, within its limits.

    `held_beside` returns how many samples are held in all slots but one.
    """

    def __init__(
        self, output: OutputStage, limits: Limits, held_beside: Callable[[int], int]
    ) -> None:
        self._channels = output.channels
        self._type = _code_type(output.bits)
        self._limits = limits
        self._held_beside = held_beside
        self._pending: _Pending | None = None

    def forget(self) -> None:
        """Forget the upload that is under way."""
        self._pending = None

    def begin(self, begin: Begin, number: int) -> None:
        """Begin an upload by the number of its BEGIN, or refuse and leave the one before."""
        check_slot(begin.slot, self._limits)
        if begin.samples == 0:
            raise rejection(Refusal.WAVEFORM_EMPTY)
        if begin.samples > self._limits.longest_waveform:
            raise rejection(Refusal.WAVEFORM_TOO_LONG, f"{begin.samples} samples")
        check_memory(self._held_beside(begin.slot), begin.samples, self._limits)
        size = self._channels * begin.samples * self._type.itemsize
        missing = set(range(0, size, LONGEST_DATA))
        self._pending = _Pending(number, begin.slot, bytearray(size), missing)

    def add(self, piece: Data) -> None:
        """Take some bytes, any number of times and in any order, or refuse what has no place."""
        offset, pending = piece.offset, self._pending
        if pending is None or piece.upload != pending.upload:
            raise rejection(Refusal.BAD_UPLOAD, "they are of another upload")
        if offset % LONGEST_DATA or offset >= len(pending.data):
            raise rejection(Refusal.BAD_UPLOAD, f"no place for bytes at {offset}")
        if len(piece.octets) != min(LONGEST_DATA, len(pending.data) - offset):
            raise rejection(Refusal.BAD_UPLOAD, f"{len(piece.octets)} bytes at {offset}")
        pending.data[offset : offset + len(piece.octets)] = piece.octets
        pending.missing.discard(offset)

    def finish(self, commit: Commit) -> LoadSlot:
        """End the upload and return its waveform, or refuse what is not whole."""
        check_slot(commit.slot, self._limits)
        pending, self._pending = self._pending, None
        if pending is None or pending.slot != commit.slot or pending.missing:
            raise rejection(Refusal.BAD_UPLOAD)
        if zlib.crc32(pending.data) != commit.crc:
            raise rejection(Refusal.BAD_UPLOAD, "its checksum differs")
        codes = np.frombuffer(bytes(pending.data), dtype=self._type)
        return LoadSlot(slot=commit.slot, codes=codes.reshape(self._channels, -1))


def _code_type(bits: int) -> np.dtype[np.signedinteger[Any]]:
    """Return how one code travels: 16 bit signed, or 32 where the converter has more."""
    return np.dtype("<i2" if bits <= _SHORT_BITS else "<i4")
