"""What the frames carry: which message has which type, and how it lies in bytes.

docs/protocol.md lists the same layouts for implementations in other languages. All numbers are
little endian and unsigned.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final, NamedTuple

from device.core.messages import (
    Arm,
    AskHealth,
    AskLimits,
    AskMeasured,
    Beat,
    Disarm,
    Enable,
    Fire,
    Levels,
    Message,
    Ping,
    Query,
    Stop,
    to_millivolts,
)
from device.core.reports import TAPS, UNITS, DeviceLimits, Entropy, Health, Measurement
from device.core.states import State
from device.core.tokens import Fate, Record
from device.driver import Identity
from device.errors import Refusal, rejection
from device.wire.forms import LONG_TEXT, REST, TEXT, TIME, U8, U16, U32, U64, Form, Layout
from device.wire.frames import MINOR, VERSION
from device.wire.upload import Begin, Commit, Data

ANSWER: Final = 0x80
"""What an answer's type has more than its question's."""


class Kind(IntEnum):
    """Types of questions; BEAT alone has no answer."""

    HELLO = 0x01
    PING = 0x02
    LIMITS = 0x03
    HEALTH = 0x04
    BEGIN = 0x10
    DATA = 0x11
    COMMIT = 0x12
    LEVEL = 0x20
    OUTPUT = 0x21
    ARM = 0x22
    DISARM = 0x23
    FIRE = 0x24
    QUERY = 0x25
    MEASURED = 0x26
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

REFUSALS: Final = (None, *Refusal)
"""Refusals by their number on the wire; 0 is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """A record as the wire carries it: an onset of 0 where nothing fired."""

    token: int
    fate: Fate
    onset_us: int
    left_mvpp: int
    right_mvpp: int

    @classmethod
    def of(cls, record: Record) -> Told:
        """Return what the device sends."""
        left_mvpp, right_mvpp = record.levels_mvpp
        return cls(
            token=record.token,
            fate=record.fate,
            onset_us=record.start_us or 0,
            left_mvpp=left_mvpp,
            right_mvpp=right_mvpp,
        )

    @property
    def record(self) -> Record:
        """What the host makes of it."""
        return Record(
            token=self.token,
            fate=self.fate,
            start_us=self.onset_us if self.fate is Fate.FIRED else None,
            levels_mvpp=(self.left_mvpp, self.right_mvpp),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Greeting:
    """An identity as the wire carries it, with the nonce of the HELLO that it answers."""

    nonce: int
    minor: int
    emulated: int
    bits: int
    channels: int
    sample_rate_mhz: int
    ceiling_mvpp: int
    longest_waveform: int
    model: bytes
    serial_number: bytes

    @classmethod
    def of(cls, identity: Identity, *, nonce: int) -> Greeting:
        """Return what the device sends; names are cut to 16 bytes."""
        return cls(
            nonce=nonce,
            minor=MINOR,
            emulated=int(identity.emulated),
            bits=identity.bits,
            channels=identity.channels,
            sample_rate_mhz=round(identity.sample_rate_hz * 1000),
            ceiling_mvpp=to_millivolts(identity.ceiling_vpp),
            longest_waveform=identity.longest_waveform,
            model=identity.model.encode()[:16],
            serial_number=identity.serial_number.encode()[:16],
        )

    def identity(self, boot_id: int) -> Identity:
        """Return what the host makes of it, or refuse with BAD_MESSAGE what is no identity."""
        try:
            return Identity(
                model=self.model.rstrip(b"\x00").decode("ascii"),
                serial_number=self.serial_number.rstrip(b"\x00").decode("ascii"),
                boot_id=boot_id,
                protocol_version=f"{VERSION}.{self.minor}",
                sample_rate_hz=self.sample_rate_mhz / 1000,
                bits=self.bits,
                channels=self.channels,
                ceiling_vpp=self.ceiling_mvpp / 1000,
                longest_waveform=self.longest_waveform,
                emulated=bool(self.emulated),
            )
        except ValueError as error:
            raise rejection(Refusal.BAD_MESSAGE, str(error)) from error


@dataclass(frozen=True, slots=True, kw_only=True)
class Hello(Message[Greeting]):
    """Begin a connection, by a number that no other one has."""

    nonce: int


class MessageLayout(NamedTuple):
    """The layout of a message, and that of its answer after the head, if anything follows it."""

    message: Layout[Any]
    answer: Layout[Any] | None = None


GREETING: Final = Layout(
    Greeting,
    nonce=U64,
    minor=U8,
    emulated=U8,
    bits=U8,
    channels=U8,
    sample_rate_mhz=U32,
    ceiling_mvpp=U32,
    longest_waveform=U32,
    model=TEXT,
    serial_number=TEXT,
)
TOLD: Final = Layout(
    Told, token=U64, fate=Form("B", FATES), onset_us=TIME, left_mvpp=U32, right_mvpp=U32
)

LIMITS: Final = Layout(
    DeviceLimits,
    slots=U8,
    memory_samples=U32,
    least_interval_us=U32,
    max_duty_ppm=U32,
    dc_tolerance_ppm=U32,
    longest_time_to_live_us=U32,
    data_window=U8,
    entropy=Form("B", tuple(Entropy)),
    firmware=LONG_TEXT,
)
HEALTH: Final = Layout(Health.of_bits, reported_bits=U8, set_bits=U8)
MEASURED: Final = Layout(
    Measurement,
    token=U64,
    tap=Form("B", TAPS),
    unit=Form("B", UNITS),
    left=U32,
    right=U32,
    onset_offset_us=U32,
    onset_uncertainty_us=U32,
    correlation_left=U16,
    correlation_right=U16,
)

# This table is the wire: host and device pack and read by its rows and by nothing else, so that a
# new message is a row here, a value in core/messages.py, and a line in docs/protocol.md. A row may
# be added in a minor version; none may change, since a device in the field cannot be asked which
# layout it meant.
TABLE: Final = {
    Kind.HELLO: MessageLayout(Layout(Hello, nonce=U64), GREETING),
    Kind.PING: MessageLayout(Layout(Ping)),
    Kind.LIMITS: MessageLayout(Layout(AskLimits), LIMITS),
    Kind.HEALTH: MessageLayout(Layout(AskHealth), HEALTH),
    Kind.BEGIN: MessageLayout(Layout(Begin, slot=U8, samples=U32)),
    Kind.DATA: MessageLayout(Layout(Data, upload=U16, offset=U32, octets=REST)),
    Kind.COMMIT: MessageLayout(Layout(Commit, slot=U8, crc=U32)),
    Kind.LEVEL: MessageLayout(Layout(Levels, left_mvpp=U32, right_mvpp=U32)),
    Kind.OUTPUT: MessageLayout(Layout(Enable)),
    Kind.ARM: MessageLayout(Layout(Arm, token=U64, slot=U8, time_to_live_us=U32)),
    Kind.DISARM: MessageLayout(Layout(Disarm, token=U64)),
    Kind.FIRE: MessageLayout(Layout(Fire, token=U64), TOLD),
    Kind.QUERY: MessageLayout(Layout(Query, token=U64), TOLD),
    Kind.MEASURED: MessageLayout(Layout(AskMeasured, token=U64), MEASURED),
    Kind.STOP: MessageLayout(Layout(Stop)),
    Kind.BEAT: MessageLayout(Layout(Beat)),
}
"""Every type of question with the layouts of its message and its answer.

Before the message of every question but HELLO comes a boot id (`QuestionPayload`), before what an
answer tells its head (`AnswerPayload`). A `LoadSlot` has no row: upload.py sends it in pieces.
"""

_KINDS: Final = {row.message.of: kind for kind, row in TABLE.items()}


def kind_of(message: Message[Any]) -> Kind:
    """Return the type of a message.

    >>> kind_of(Enable()).name
    'OUTPUT'
    """
    return _KINDS[type(message)]


@dataclass(frozen=True, slots=True, kw_only=True)
class QuestionPayload:
    """Any question but HELLO: the power cycle it is meant for, and the bytes of its message."""

    boot_id: int
    content: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerPayload:
    """Any answer: its head, and the bytes of what is told after it.

    The head says why the question was refused, if it was, in which state the device is now, its
    power cycle and its clock.
    """

    refusal: Refusal | None
    state: State
    boot_id: int
    device_us: int
    body: bytes = b""


QUESTION: Final = Layout(QuestionPayload, boot_id=U64, content=REST)
HEAD: Final = Layout(
    AnswerPayload,
    refusal=Form("B", REFUSALS),
    state=Form("B", STATES),
    boot_id=U64,
    device_us=TIME,
    body=REST,
)


def payload(message: Message[Any], boot_id: int) -> bytes:
    """Return the payload of a message that is meant for one power cycle; HELLO is for any."""
    kind = kind_of(message)
    content = TABLE[kind].message.pack(message)
    if kind is Kind.HELLO:
        return content
    return QUESTION.pack(QuestionPayload(boot_id=boot_id, content=content))


def told(kind: int, reply: Any) -> bytes:
    """Return the bytes of what a question of a type is answered with, after the head."""
    layout = TABLE[Kind(kind)].answer
    if layout is None:
        return b""
    return layout.pack(Told.of(reply) if isinstance(reply, Record) else reply)


def understood(kind: int, body: bytes) -> Any:
    """Return what an answer tells, or refuse with BAD_MESSAGE; None where it tells nothing."""
    layout = TABLE[Kind(kind)].answer
    if layout is None:
        return None
    said = layout.read(body)
    return said.record if isinstance(said, Told) else said


def read(kind: int, content: bytes) -> Message[Any]:
    """Return the message of a type, or refuse with BAD_MESSAGE what is none."""
    if kind not in TABLE:
        raise rejection(Refusal.BAD_MESSAGE, f"type {kind:#04x}")
    message: Message[Any] = TABLE[Kind(kind)].message.read(content)
    return message
