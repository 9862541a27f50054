"""A waveform on the wire: in pieces, in any order, stored only if it arrived whole."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from device.core.messages import LoadSlot, Message
from device.errors import Refusal, rejection
from device.limits import check_memory, check_slot

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from device.limits import Limits

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
    codes = np.concatenate((message.left, message.right)).astype(_code_type(bits))
    return codes.tobytes()


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
    """The device's end: pieces to a waveform of codes of `bits` bits, within the limits.

    `held_beside` returns how many samples are held in all slots but one.
    """

    def __init__(
        self, *, bits: int, limits: Limits, held_beside: Callable[[int], int] = lambda _: 0
    ) -> None:
        self._type = _code_type(bits)
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
        size = 2 * begin.samples * self._type.itemsize
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
        left, right = codes.astype(np.int32).reshape(2, -1)
        return LoadSlot(slot=commit.slot, left=left, right=right)


def _code_type(bits: int) -> np.dtype[np.signedinteger[Any]]:
    """Return how one code travels: 16 bit signed, or 32 where the converter has more."""
    return np.dtype("<i2" if bits <= _SHORT_BITS else "<i4")


# A line keeps the order, most of the time: an answer says that what was last sent before its piece
# was first sent, and is not answered, was lost. The answer to a piece that was sent twice may be to
# the first: of what was sent between it tells nothing. Only where nothing comes back at all a clock
# decides, and then for one piece alone, lest a busy machine is taken for a bad line.
class Window:
    """The pieces that are unanswered at a time, `size` at most, each by its number.

    >>> window = Window({7: b"a", 8: b"b", 9: b"c"}.items(), size=2, late_s=0.025)
    >>> window.due(0.0), window.answered(8, 0.01), window.due(0.01)
    ([b'a', b'b'], True, [b'a', b'c'])
    >>> window.due(0.02), window.due(0.04), window.answered(8, 0.04), window.is_over
    ([], [b'a'], False, False)
    """

    def __init__(self, pieces: Iterable[tuple[int, bytes]], *, size: int, late_s: float) -> None:
        self._pieces: Iterator[tuple[int, bytes]] = iter(pieces)
        self._size = size
        self._late_s = late_s
        self._sent: dict[int, _Sent] = {}
        self._lost: list[int] = []
        self._n_sent = 0
        self._moved_s = 0.0

    @property
    def is_over(self) -> bool:
        """Whether all that was sent is answered."""
        return not self._sent

    @property
    def late_at_s(self) -> float:
        """When a piece is due again, if nothing is answered until then."""
        return self._moved_s + self._late_s

    def due(self, now_s: float) -> list[bytes]:
        """Return what is to be sent now, and take it as sent."""
        if self._sent and not self._lost and now_s >= self.late_at_s:
            self._lost = [min(self._sent, key=lambda number: self._sent[number].last)]
        going = [self._sent[number] for number in self._lost]
        self._lost = []
        for number, piece in islice(self._pieces, self._size - len(self._sent)):
            self._sent[number] = sent = _Sent(piece)
            going.append(sent)
        for sent in going:
            sent.go(self._n_sent)
            self._n_sent += 1
        if going:
            self._moved_s = now_s
        return [sent.piece for sent in going]

    def answered(self, number: int, now_s: float) -> bool:
        """Note an answer; tell whether it was waited for."""
        one = self._sent.pop(number, None)
        if one is None:
            return False
        self._lost = [
            other
            for other, sent in self._sent.items()
            if sent.last < one.first or other in self._lost
        ]
        self._moved_s = now_s
        return True


@dataclass(slots=True)
class _Sent:
    """A piece that is under way, and as which of all it was sent first and last."""

    piece: bytes
    first: int = -1
    last: int = -1

    def go(self, order: int) -> None:
        self.first = order if self.first < 0 else self.first
        self.last = order
