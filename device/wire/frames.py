"""The frames of the wire format: bytes to messages and back, whatever the bytes are.

    0x00  COBS( version | type | sequence | payload | CRC-32 )  0x00

docs/protocol.md is the page that host, emulator and firmware obey;
tests/test_device/golden_frames.json holds frames that any other implementation can be tested
against.
"""

from __future__ import annotations

import string
import struct
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from cobs import cobs

from device.limits import MAX_CHANNELS

if TYPE_CHECKING:
    from device.driver import Identity

VERSION: Final = 2
"""Major version of the wire format; frames of any other are dropped."""

_HEAD: Final = struct.Struct("<BBH")
_TAIL: Final = struct.Struct("<I")
_SHORTEST_BODY: Final = _HEAD.size + _TAIL.size
_DELIMITER: Final = b"\x00"


def longest_payload(channels: int) -> int:
    """Return the most bytes of a payload to or from a device with so many channels.

    A frame that claims more is noise. MEASURED has the longest answer.

    >>> longest_payload(2), longest_payload(64)
    (96, 419)
    """
    return max(96, 35 + 6 * channels)


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One message on the wire.

    Kind is one byte, the sequence number 16 bit; an answer has those of its question, the kind plus
    0x80. The payload has up to `longest_payload` bytes.
    """

    kind: int
    sequence: int
    payload: bytes

    def answered(self, payload: bytes) -> Frame:
        """Return the answer to this question."""
        return Frame(kind=self.kind | 0x80, sequence=self.sequence, payload=payload)


def encode(frame: Frame) -> bytes:
    """Return a frame's bytes, delimiters included.

    No byte but the delimiters is zero:

    >>> coded = encode(Frame(kind=2, sequence=0, payload=bytes(5)))
    >>> coded.count(0), coded[0], coded[-1]
    (2, 0, 0)
    """
    body = _HEAD.pack(VERSION, frame.kind, frame.sequence) + frame.payload
    coded: bytes = cobs.encode(body + _TAIL.pack(zlib.crc32(body)))
    return _DELIMITER + coded + _DELIMITER


class Decoder:
    """Frames out of a stream of bytes that may hold anything, for so many channels or fewer.

    A damaged frame is dropped; the next delimiter begins a new one. Never holds more than one
    frame's bytes.

    >>> decoder = Decoder()
    >>> ping = encode(Frame(kind=2, sequence=9, payload=b""))
    >>> [frame.sequence for frame in decoder.feed(b"noise" + ping + ping[:4])]
    [9]
    >>> [frame.sequence for frame in decoder.feed(ping[4:])]
    [9]
    """

    def __init__(self, channels: int = MAX_CHANNELS) -> None:
        self._longest = _SHORTEST_BODY + longest_payload(channels)
        self._longest_coded = self._longest + self._longest // 254 + 1  # what COBS makes of it
        self._piece = b""

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames that these bytes complete."""
        *pieces, rest = (self._piece + data).split(_DELIMITER)
        self._piece = rest[: self._longest_coded + 1]  # what is longer stays too long
        return [frame for frame in map(self._frame, filter(None, pieces)) if frame is not None]

    def _frame(self, coded: bytes) -> Frame | None:
        """Return what lay between two delimiters; None where it is no frame of this version."""
        if len(coded) > self._longest_coded:
            return None
        try:
            body = cobs.decode(coded)
        except cobs.DecodeError:
            return None
        if not _SHORTEST_BODY <= len(body) <= self._longest:
            return None
        content, tail = body[: -_TAIL.size], body[-_TAIL.size :]
        if _TAIL.unpack(tail)[0] != zlib.crc32(content):
            return None
        version, kind, sequence = _HEAD.unpack_from(content)
        if version != VERSION:
            return None
        return Frame(kind=kind, sequence=sequence, payload=content[_HEAD.size :])


QUESTION: Final = b"*IDN?"
"""Followed by a line feed, with or without a carriage return before it."""

MAKER: Final = "tactstrip"
"""With this the answer begins."""

_TEXT: Final = string.printable.encode("ascii")


class IdentityLine:
    r"""Answers ``*IDN?`` where it cannot be a part of a frame.

    That is where everything since the last delimiter is text: a frame has its version, which is
    not text, as the second byte after one.

    >>> from device.driver import Identity
    >>> line = IdentityLine(Identity(model="m", serial_number="1", boot_id=5,
    ...                              protocol_version="2.0", sample_rate_hz=48e3, bits=16,
    ...                              channels=2, ceiling_vpp=200.0, longest_waveform=4096,
    ...                              emulated=True))
    >>> line.feed(b"*ID"), line.feed(b"N?\r\n")
    (b'', b'tactstrip,m,1,protocol 2.0\n')
    >>> line.feed(b"\0\x20\x01\n*IDN?\n")
    b''
    """

    def __init__(self, identity: Identity) -> None:
        version = f"protocol {identity.protocol_version}"
        texts = (MAKER, identity.model, identity.serial_number, version)
        self._answer = ",".join(texts).encode("ascii", "replace") + b"\n"
        self._is_text = True
        self._line = b""

    def feed(self, data: bytes) -> bytes:
        """Take bytes from the line and return the answers to the questions in them."""
        first, *after_delimiter = data.split(b"\0")
        n_questions = self._count_questions(first)
        for octets in after_delimiter:
            self._is_text, self._line = True, b""
            n_questions += self._count_questions(octets)
        return n_questions * self._answer

    def _count_questions(self, octets: bytes) -> int:
        self._is_text = self._is_text and not octets.translate(None, _TEXT)
        if not self._is_text:
            return 0
        *lines, rest = (self._line + octets).split(b"\n")
        tail = rest[len(QUESTION) :]  # of which it matters whether there is more than space
        self._line = rest[: len(QUESTION)] + (tail.strip() or tail)[:1]
        return sum(line.rstrip() == QUESTION for line in lines)
