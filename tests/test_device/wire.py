"""Messages and frames by the names that docs/protocol.md gives them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from device.core.messages import LoadSlot
from device.errors import Refusal, Rejected
from device.wire import protocol
from device.wire.frames import Decoder, Frame, encode
from device.wire.protocol import Kind
from device.wire.requests import framed
from device.wire.upload import data_of, octets_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from device.core.messages import Message
    from device.limits import CodeArray
    from device.wire.endpoint import Endpoint


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """An answer: the type of its question, its number, and what its head states."""

    kind: str
    number: int
    refusal: Refusal | None
    state: str
    device_us: int


def message(name: str, **values: Any) -> Message[Any]:
    """Return a message by the name of its type; LOAD stores two rows of codes in a slot."""
    return (
        LoadSlot(**values) if name == "LOAD" else protocol.TABLE[Kind[name]].message.make(**values)
    )


def fields_of(name: str) -> list[str]:
    """Return the names of a message's fields."""
    message_type: Any = protocol.TABLE[Kind[name]].message.make
    return [field.name for field in fields(message_type)]


def question(name: str, number: int, *, boot_id: int, **values: Any) -> bytes:
    """Return the bytes of a question."""
    return encode(framed(message(name, **values), number, boot_id))


def upload_of(codes: CodeArray, number: int) -> tuple[bytes, Iterator[Any]]:
    """Return the octets of a waveform of 16 bits, and the DATA that BEGIN `number` takes."""
    octets = octets_of(LoadSlot(slot=0, codes=codes), 16)
    return octets, data_of(octets, number)


def kinds(octets: bytes) -> list[str]:
    """Return the types of the frames in these bytes; those of answers begin with "answer to"."""
    return [kind_name(frame.kind) for frame in Decoder().feed(octets)]


def kind_name(kind: int) -> str:
    """Return the name of a type."""
    prefix = "answer to " if kind & protocol.ANSWER else ""
    names = {int(known): known.name for known in Kind}
    return prefix + names.get(kind & ~protocol.ANSWER, "unknown")


def answers(octets: bytes) -> list[Answer]:
    """Return the answers in these bytes."""
    return [
        Answer(
            kind=kind_name(frame.kind).removeprefix("answer to "),
            number=frame.sequence,
            refusal=(head := protocol.HEAD.read(frame.payload)).refusal,
            state=head.state.value,
            device_us=head.device_us,
        )
        for frame in Decoder().feed(octets)
    ]


def ask(device: Endpoint, number: int, name: str, **values: Any) -> Answer:
    """Ask a device a question at 1 us."""
    boot_id = device.core.boot_id
    (answer,) = answers(device.receive(1, question(name, number, boot_id=boot_id, **values)))
    return answer


def packed_again(octets: bytes) -> bytes:
    """Return a question's bytes as this program packs what it reads of it; b"" if that is none."""
    (frame,) = Decoder().feed(octets)
    try:
        if frame.kind == Kind.HELLO:
            meant, content = 0, frame.payload
        else:
            asked = protocol.QUESTION.read(frame.payload)
            meant, content = asked.boot_id, asked.content
        return encode(framed(protocol.read_message(frame.kind, content), frame.sequence, meant))
    except Rejected:
        return b""


def answer_otherwise(octets: bytes, name: str, payload: Callable[[bytes], bytes | None]) -> bytes:
    """Return answers with another payload in those to one type of question; None loses them."""
    changed = b""
    for frame in Decoder().feed(octets):
        is_it = frame.kind == Kind[name] | protocol.ANSWER
        said = payload(frame.payload) if is_it else frame.payload
        if said is not None:
            changed += encode(Frame(kind=frame.kind, sequence=frame.sequence, payload=said))
    return changed
