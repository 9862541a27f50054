"""What the frames carry: which message has which type, and how it lies in bytes.

docs/protocol.md lists the same layouts for implementations in other languages. All numbers are
little endian and unsigned.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from itertools import islice
from typing import TYPE_CHECKING, Any, Final, Generic, NamedTuple, TypeVar

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
)
from device.core.reports import TAPS, DeviceLimits, Entropy, Health, Measurement
from device.core.states import State
from device.core.tokens import Fate, Record
from device.driver import Identity, Outcome
from device.errors import Refusal, rejection
from device.wire.frames import VERSION
from device.wire.upload import Begin, Commit, Data

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_Value = TypeVar("_Value")

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

FATES: Final[dict[str, Fate]] = {
    "unknown": (Outcome.INDETERMINATE, None),
    "never_armed": (Outcome.NOT_FIRED, Refusal.NOT_ARMED),
    "armed": (Outcome.INDETERMINATE, Refusal.ALREADY_ARMED),
    "fired": (Outcome.FIRED, None),
    "expired": (Outcome.NOT_FIRED, Refusal.EXPIRED),
    "aborted": (Outcome.NOT_FIRED, Refusal.ABORTED),
}
"""Fates of a token in the order of their numbers on the wire: outcome and reason of its record."""

REFUSALS: Final = (None, *Refusal)
"""Refusals by their number on the wire; 0 is none."""


def _unchanged(value: Any) -> Any:
    return value


class Field(NamedTuple):
    """How one field travels.

    Attributes
    ----------
    code : str
        Its code in `struct`.
    pack : callable
        Returns what travels for a value.
    read : callable
        Returns the value; IndexError if there is none.
    is_repeated : bool
        Whether it travels as several numbers, as many as the other repeated fields.
    """

    code: str
    pack: Callable[[Any], Any] = _unchanged
    read: Callable[[Any], Any] = _unchanged
    is_repeated: bool = False

    def value(self, name: str, number: Any) -> Any:
        """Return the value that a number encodes, or refuse it with BAD_MESSAGE."""
        try:
            return self.read(number)
        except IndexError:
            raise rejection(Refusal.BAD_MESSAGE, f"{name} {number}") from None


def _choice(values: Sequence[Any], code: str = "B") -> Field:
    """Return a field that has one of some values, which travels by its index."""
    return Field(code, values.index, values.__getitem__)


def _text(code: str) -> Field:
    """Return a field of ASCII text, filled up with zeros."""

    def read(octets: bytes) -> str:
        if not octets.isascii():
            raise IndexError
        return octets.rstrip(b"\x00").decode()

    return Field(code, lambda text: text.encode("ascii", "replace"), read)


U8: Final = Field("B")
U16: Final = Field("H")
U32: Final = Field("I")
U64: Final = Field("Q")
FLAG: Final = _choice((False, True))
TIME: Final = _choice(range(2**63), "Q")
ONSET: Final = TIME._replace(pack=lambda start_us: start_us or 0)
"""An onset in microseconds; 0 where nothing fired."""
MILLI: Final = Field(
    "I", lambda value: math.floor(value * 1000 + 1e-6), lambda number: number / 1000
)
"""A number that travels in thousandths, rounded down but for how floats are written."""
MINOR: Final = Field("B", lambda text: int(text.partition(".")[2]), lambda n: f"{VERSION}.{n}")
"""A protocol version, of which the minor number travels."""
TEXT: Final = _text("16s")
LONG_TEXT: Final = _text("32s")
REST: Final = Field("B", read=bytes, is_repeated=True)
"""All remaining bytes; a layout with this field has no other repeated field."""
EACH_U16: Final = Field("H", read=tuple, is_repeated=True)
EACH_U32: Final = Field("I", read=tuple, is_repeated=True)
"""A number for each channel."""


class Layout(Generic[_Value]):
    r"""How the fields of one kind of value follow each other in bytes.

    Parameters
    ----------
    make : callable
        Makes the value from its fields, by name.
    fields : Field
        Name and form of each field, in their order on the wire.

    Examples
    --------
    >>> arm = Layout(Arm, token=U64, slot=U8, time_to_live_us=U32)
    >>> arm.pack(Arm(token=258, slot=7, time_to_live_us=1))
    b'\x02\x01\x00\x00\x00\x00\x00\x00\x07\x01\x00\x00\x00'
    >>> arm.read(arm.pack(Arm(token=258, slot=7, time_to_live_us=1))).slot
    7
    """

    def __init__(self, make: Callable[..., _Value], **fields: Field) -> None:
        self.make = make
        self._fields = fields
        self._struct = cache(self._struct_of)
        self.size = self._struct(0).size
        self.size_of_each = self._struct(1).size - self.size

    def _struct_of(self, n_repeated: int) -> struct.Struct:
        codes = (f"{n_repeated if f.is_repeated else ''}{f.code}" for f in self._fields.values())
        return struct.Struct("<" + "".join(codes))

    def pack(self, value: _Value, channels: int = 0) -> bytes:
        """Return the bytes of a value; where a repeated field is empty, zeros for each channel."""
        numbers: list[Any] = []
        for name, field in self._fields.items():
            number = field.pack(getattr(value, name))
            if field.is_repeated:
                number = number or (0,) * channels
                channels = len(number)
            numbers += number if field.is_repeated else (number,)
        return self._struct(channels).pack(*numbers)

    def read(self, content: bytes) -> _Value:
        """Return the value of some bytes.

        Bytes of another length and numbers that stand for nothing are refused with BAD_MESSAGE,
        and what the value itself refuses with its own code.
        """
        n_repeated = max(0, len(content) - self.size) // (self.size_of_each or 1)
        expected = self.size + n_repeated * self.size_of_each
        if len(content) != expected:
            raise rejection(Refusal.BAD_MESSAGE, f"{expected} bytes expected, got {len(content)}")
        numbers = iter(self._struct(n_repeated).unpack(content))
        values = {}
        for name, field in self._fields.items():
            number = islice(numbers, n_repeated) if field.is_repeated else next(numbers)
            values[name] = field.value(name, number)
        return self.make(**values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Greeting:
    """The nonce of a HELLO, and the bytes of the identity that answers it."""

    nonce: int
    identity: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Hello(Message[Greeting]):
    """Begin a connection, by a number that no other one has."""

    nonce: int


class MessageLayout(NamedTuple):
    """The layout of a message, and that of its answer after the head, if anything follows it."""

    message: Layout[Any]
    answer: Layout[Any] | None = None


IDENTITY: Final = Layout[Any](
    dict,
    protocol_version=MINOR,
    emulated=FLAG,
    bits=U8,
    channels=U8,
    sample_rate_hz=MILLI,
    ceiling_vpp=MILLI,
    longest_waveform=U32,
    model=TEXT,
    serial_number=TEXT,
)
"""An `Identity` without its boot id, which the header of the answer holds."""
GREETING: Final = Layout(Greeting, nonce=U64, identity=REST)


def _read_record(*, token: int, fate: Fate, start_us: int, levels_mvpp: tuple[int, ...]) -> Record:
    outcome, reason = fate
    if outcome is Outcome.FIRED:
        return Record(token=token, outcome=outcome, start_us=start_us, levels_mvpp=levels_mvpp)
    return Record(token=token, outcome=outcome, reason=reason)


RECORD: Final = Layout(
    _read_record,
    token=U64,
    fate=_choice(tuple(FATES.values())),
    start_us=ONSET,
    levels_mvpp=EACH_U32,
)
LIMITS: Final = Layout(
    DeviceLimits,
    slots=U8,
    memory_samples=U32,
    least_interval_us=U32,
    max_duty_ppm=U32,
    dc_tolerance_ppm=U32,
    longest_time_to_live_us=U32,
    entropy=_choice(tuple(Entropy)),
    firmware=LONG_TEXT,
)
HEALTH: Final = Layout(Health.of_bits, reported_bits=U8, set_bits=U8)
MEASURED: Final = Layout(
    Measurement,
    token=U64,
    tap=_choice(TAPS),
    peaks=EACH_U32,
    onset_offset_us=U32,
    onset_uncertainty_us=U32,
    correlations=EACH_U16,
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
    Kind.LEVEL: MessageLayout(Layout(Levels, levels_mvpp=EACH_U32)),
    Kind.OUTPUT: MessageLayout(Layout(Enable)),
    Kind.ARM: MessageLayout(Layout(Arm, token=U64, slot=U8, time_to_live_us=U32)),
    Kind.DISARM: MessageLayout(Layout(Disarm, token=U64)),
    Kind.FIRE: MessageLayout(Layout(Fire, token=U64), RECORD),
    Kind.QUERY: MessageLayout(Layout(Query, token=U64), RECORD),
    Kind.MEASURED: MessageLayout(Layout(AskMeasured, token=U64), MEASURED),
    Kind.STOP: MessageLayout(Layout(Stop)),
    Kind.BEAT: MessageLayout(Layout(Beat)),
}
"""Every type of question with the layouts of its message and its answer.

Before the message of every question but HELLO comes a boot id (`QuestionPayload`), before what an
answer's report its head (`AnswerPayload`). A `LoadSlot` has no row: upload.py sends it in pieces.
"""

_KINDS: Final = {row.message.make: kind for kind, row in TABLE.items()}


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
    """Any answer: its head, and the bytes of its report after it.

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
    refusal=_choice(REFUSALS),
    state=_choice(STATES),
    boot_id=U64,
    device_us=TIME,
    body=REST,
)


def pack_question(message: Message[Any], boot_id: int) -> bytes:
    """Return the payload of a message that is meant for one power cycle; HELLO is for any."""
    kind = kind_of(message)
    content = TABLE[kind].message.pack(message)
    if kind is Kind.HELLO:
        return content
    return QUESTION.pack(QuestionPayload(boot_id=boot_id, content=content))


def read_message(kind: int, content: bytes) -> Message[Any]:
    """Return the message of a type, or refuse with BAD_MESSAGE what is none."""
    if kind not in TABLE:
        raise rejection(Refusal.BAD_MESSAGE, f"type {kind:#04x}")
    message: Message[Any] = TABLE[Kind(kind)].message.read(content)
    return message


def pack_report(kind: int, report: Any, channels: int) -> bytes:
    """Return the bytes of what a device of so many channels answers, after the head."""
    layout = TABLE[Kind(kind)].answer
    return b"" if layout is None else layout.pack(report, channels)


def read_report(kind: int, body: bytes, channels: int) -> Any:
    """Return what a device of so many channels reports; None where its answer reports nothing.

    What is no such report is refused with BAD_MESSAGE.
    """
    layout = TABLE[Kind(kind)].answer
    if layout is not None and len(body) != layout.size + channels * layout.size_of_each:
        raise rejection(Refusal.BAD_MESSAGE, f"{len(body)} bytes")
    return None if layout is None else layout.read(body)


def pack_greeting(nonce: int, identity: Identity) -> bytes:
    """Return the answer to a HELLO, after the head; names are cut to 16 bytes."""
    return GREETING.pack(Greeting(nonce=nonce, identity=IDENTITY.pack(identity)))


def read_identity(greeting: Greeting, boot_id: int) -> Identity:
    """Return who answered a HELLO, or refuse with BAD_MESSAGE what is no identity."""
    try:
        return Identity(boot_id=boot_id, **IDENTITY.read(greeting.identity))
    except ValueError as error:
        raise rejection(Refusal.BAD_MESSAGE, str(error)) from error
