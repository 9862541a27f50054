"""What the frames carry: every message of the wire format as a value, packed and unpacked.

docs/protocol.md lists the same layouts for implementations in other languages. All numbers are
little endian and unsigned unless said otherwise. A waveform travels in pieces, in any order, and is
stored only if it arrived whole.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final

import numpy as np

from device.core.messages import Arm, Levels
from device.core.states import State
from device.core.tokens import Fate, Record
from device.driver import Identity, Refusal, rejection

ANSWER: Final = 0x80
"""What an answer's type has more than its question's."""


class Kind(IntEnum):
    """Types of questions; BEAT alone has no answer.

    Examples
    --------
    >>> Kind(0x24).name
    'FIRE'
    """

    HELLO = 0x01
    PING = 0x02
    BEGIN = 0x10
    DATA = 0x11
    COMMIT = 0x12
    LEVEL = 0x20
    OUTPUT = 0x21
    ARM = 0x22
    DISARM = 0x23
    FIRE = 0x24
    QUERY = 0x25
    STOP = 0x30
    BEAT = 0x31


STATES: Final = (State.IDLE, State.LOADED, State.LIVE, State.ARMED, State.FIRED, State.SAFE)
"""States by their number on the wire."""

FATES: Final = (
    Fate.UNKNOWN,
    Fate.NEVER_ARMED,
    Fate.ARMED,
    Fate.FIRED,
    Fate.EXPIRED,
    Fate.ABORTED,
)
"""Fates by their number on the wire."""

_REFUSALS: Final = {int(refusal): refusal for refusal in Refusal}
_BOOT: Final = struct.Struct("<Q")
_TOKEN: Final = struct.Struct("<Q")
_ARM: Final = struct.Struct("<QBI")
_LEVELS: Final = struct.Struct("<II")
_ANSWER: Final = struct.Struct("<BBQQ")
_RECORD: Final = struct.Struct("<QBQII")
_NONCE: Final = struct.Struct("<Q")
_IDENTITY: Final = struct.Struct("<QBBBBIII16s16s")
_LATEST_US: Final = 2**63 - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What every answer begins with, and the rest of it.

    Parameters
    ----------
    refusal : Refusal or None
        Why the question was refused; none if it was done.
    state : State
        The device's state now.
    boot_id : int
        Its power cycle.
    device_us : int
        Its clock.
    body : bytes
        A record, an identity, or nothing.

    Examples
    --------
    >>> answer = Answer(refusal=Refusal.BUSY, state=State.FIRED, boot_id=5, device_us=9, body=b"")
    >>> read_answer(answer.packed()) == answer
    True
    """

    refusal: Refusal | None
    state: State
    boot_id: int
    device_us: int
    body: bytes = b""

    def packed(self) -> bytes:
        """Return the payload."""
        number = 0 if self.refusal is None else int(self.refusal)
        state = STATES.index(self.state)
        return _ANSWER.pack(number, state, self.boot_id, self.device_us) + self.body


def read_answer(payload: bytes) -> Answer:
    """Return an answer from a payload.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.
    """
    number, state, boot_id, device_us = unpack(_ANSWER, payload[: _ANSWER.size])
    if state >= len(STATES) or (number and number not in _REFUSALS) or device_us > _LATEST_US:
        detail = f"status {number}, state {state}, time {device_us}"
        raise rejection(Refusal.BAD_MESSAGE, detail)
    return Answer(
        refusal=_REFUSALS.get(number),
        state=STATES[state],
        boot_id=boot_id,
        device_us=device_us,
        body=payload[_ANSWER.size :],
    )


def for_boot(boot_id: int, content: bytes = b"") -> bytes:
    """Return the payload of a question that is meant for one power cycle.

    Examples
    --------
    >>> split_boot(for_boot(7, b"abc"))
    (7, b'abc')
    """
    return _BOOT.pack(boot_id) + content


def split_boot(payload: bytes) -> tuple[int, bytes]:
    """Return the power cycle that a question is meant for, and the rest of its payload.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.
    """
    (boot_id,) = unpack(_BOOT, payload[: _BOOT.size])
    return boot_id, payload[_BOOT.size :]


def read_nothing(content: bytes) -> None:
    """Refuse a content where there must be none.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.

    Examples
    --------
    >>> read_nothing(b"")
    """
    if content:
        raise rejection(Refusal.BAD_MESSAGE, f"nothing is expected, got {len(content)} bytes")


def pack_hello(nonce: int) -> bytes:
    """Return the payload of HELLO: a number that no other connection has."""
    return _NONCE.pack(nonce)


def read_hello(payload: bytes) -> int:
    """Return the nonce of a HELLO.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.

    Examples
    --------
    >>> read_hello(pack_hello(12))
    12
    """
    (nonce,) = unpack(_NONCE, payload)
    return int(nonce)


def pack_token(token: int) -> bytes:
    """Return the content of DISARM, FIRE and QUERY."""
    return _TOKEN.pack(token)


def read_token(content: bytes) -> int:
    """Return the token of DISARM, FIRE or QUERY.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.
    """
    (token,) = unpack(_TOKEN, content)
    return int(token)


def pack_arm(message: Arm) -> bytes:
    """Return the content of ARM."""
    return _ARM.pack(message.token, message.slot, message.time_to_live_us)


def read_arm(content: bytes) -> Arm:
    """Return an ARM.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE, or what `Arm` refuses.

    Examples
    --------
    >>> message = Arm(token=2**64 - 1, slot=7, time_to_live_us=500_000)
    >>> read_arm(pack_arm(message)) == message
    True
    """
    token, slot, time_to_live_us = unpack(_ARM, content)
    return Arm(token=token, slot=slot, time_to_live_us=time_to_live_us)


def pack_levels(message: Levels) -> bytes:
    """Return the content of LEVEL."""
    return _LEVELS.pack(message.left_mvpp, message.right_mvpp)


def read_levels(content: bytes) -> Levels:
    """Return a LEVEL.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.
    """
    left_mvpp, right_mvpp = unpack(_LEVELS, content)
    return Levels(left_mvpp=left_mvpp, right_mvpp=right_mvpp)


def pack_record(record: Record) -> bytes:
    """Return the body of the answer to FIRE and QUERY."""
    start_us = 0 if record.start_us is None else record.start_us
    return _RECORD.pack(record.token, FATES.index(record.fate), start_us, *record.levels_mvpp)


def read_record(body: bytes) -> Record:
    """Return the record of an answer to FIRE or QUERY.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.

    Examples
    --------
    >>> record = Record(token=3, fate=Fate.FIRED, start_us=12, levels_mvpp=(130_000, 0))
    >>> read_record(pack_record(record)) == record
    True
    """
    token, fate, start_us, left_mvpp, right_mvpp = unpack(_RECORD, body)
    if fate >= len(FATES) or start_us > _LATEST_US:
        raise rejection(Refusal.BAD_MESSAGE, f"fate {fate}, onset {start_us}")
    fired = FATES[fate] is Fate.FIRED
    return Record(
        token=token,
        fate=FATES[fate],
        start_us=start_us if fired else None,
        levels_mvpp=(left_mvpp, right_mvpp),
    )


def pack_identity(identity: Identity, *, nonce: int, minor: int) -> bytes:
    """Return the body of the answer to HELLO, its nonce in it; names are cut to 16 bytes."""
    return _IDENTITY.pack(
        nonce,
        minor,
        int(identity.emulated),
        identity.bits,
        identity.channels,
        round(identity.sample_rate_hz * 1000),
        round(identity.ceiling_vpp * 1000),
        identity.longest_waveform,
        identity.model.encode()[:16],
        identity.serial_number.encode()[:16],
    )


def read_identity(answer: Answer, *, nonce: int, major: int) -> Identity:
    """Return who answered the HELLO with a nonce.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.
    """
    echoed, minor, emulated, bits, channels, rate_mhz, ceiling_mvpp, longest, model, serial = (
        unpack(_IDENTITY, answer.body)
    )
    if echoed != nonce:
        raise rejection(Refusal.BAD_MESSAGE, "the answer is to another HELLO")
    try:
        return Identity(
            model=model.rstrip(b"\x00").decode("ascii"),
            serial_number=serial.rstrip(b"\x00").decode("ascii"),
            boot_id=answer.boot_id,
            protocol_version=f"{major}.{minor}",
            sample_rate_hz=rate_mhz / 1000,
            bits=bits,
            channels=channels,
            ceiling_vpp=ceiling_mvpp / 1000,
            longest_waveform=longest,
            emulated=bool(emulated),
        )
    except ValueError as error:
        raise rejection(Refusal.BAD_MESSAGE, str(error)) from error


def unpack(layout: struct.Struct, content: bytes) -> tuple[Any, ...]:
    r"""Return the numbers of a layout that is exactly as long as the content.

    Raises
    ------
    Rejected
        With code BAD_MESSAGE.

    Examples
    --------
    >>> unpack(struct.Struct("<BH"), b"\x05\x00\x01")
    (5, 256)
    """
    if len(content) != layout.size:
        raise rejection(
            Refusal.BAD_MESSAGE, f"{layout.size} bytes are expected, got {len(content)}"
        )
    return layout.unpack(content)


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
