"""The device's end of the wire: frames in, frames out, around a core; without I/O.

What an emulator or a firmware has to do, and nothing else: docs/protocol.md.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any, Final

from device.core.messages import Beat, Message, Stop
from device.core.states import State
from device.errors import Refusal, Rejected, rejection
from device.wire import protocol
from device.wire.frames import Decoder, Frame, IdentityLine, encode
from device.wire.protocol import AnswerPayload, Kind
from device.wire.upload import Begin, Commit, Data, Uploads

if TYPE_CHECKING:
    from device.core.core import DeviceCore
    from device.driver import Identity

_HALF_TURN: Final = 0x8000
_GREETINGS: Final = 16


class Endpoint:
    r"""A core behind the wire format.

    Parameters
    ----------
    core : DeviceCore
        The device.
    identity : Identity
        What it says of itself; its boot id is the core's.

    Examples
    --------
    >>> from device.limits import Limits
    >>> from device.core.output import OutputStage
    >>> from device.core.core import DeviceCore
    >>> from device.driver import Identity
    >>> from device.core.messages import Ping
    >>> core = DeviceCore(boot_id=5, limits=Limits(ceiling_vpp=200.0), output=OutputStage(),
    ...                   sink=print)
    >>> identity = Identity(model="m", serial_number="1", boot_id=5, protocol_version="2.0",
    ...                     sample_rate_hz=48e3, bits=16, channels=2, ceiling_vpp=200.0,
    ...                     longest_waveform=4096, emulated=True)
    >>> endpoint = Endpoint(core, identity)
    >>> ping = Frame(kind=Kind.PING, sequence=1, payload=protocol.pack_question(Ping(), 5))
    >>> answer, = Decoder().feed(endpoint.receive(10, encode(ping)))
    >>> protocol.HEAD.read(answer.payload).state.value
    'idle'
    >>> endpoint.receive(20, b"*IDN?\n")
    b'tactstrip,m,1,protocol 2.0\n'
    """

    def __init__(self, core: DeviceCore, identity: Identity) -> None:
        self.core = core
        self._identity = identity
        self._decoder = Decoder(identity.channels)
        self._text = IdentityLine(identity)
        self._greetings: deque[int] = deque(maxlen=_GREETINGS)
        self._newest: int | None = None
        self._last_question: Frame | None = None
        self._last_answer = b""
        self._uploads = Uploads(core.output, core.limits, core.held_beside)

    def receive(self, now_us: int, data: bytes) -> bytes:
        """Take whatever arrived at a device time and return the bytes to send back.

        Frames, the line that answers ``*IDN?``, or nothing.
        """
        frames = self._decoder.feed(data)
        questions = [frame for frame in frames if frame.kind < protocol.ANSWER]
        answers = [self._respond(now_us, question) for question in questions]
        return b"".join(answers) + self._text.feed(data)

    def hang_up(self, now_us: int) -> None:
        """Notice that the line is gone: the outputs go to zero."""
        self.core.lose_line(now_us)
        self._decoder = Decoder(self._identity.channels)
        self._text = IdentityLine(self._identity)
        self._uploads.forget()

    def _respond(self, now_us: int, frame: Frame) -> bytes:
        if frame.kind == Kind.BEAT:
            if self._is_meant(frame, Beat()):
                self.core.take(now_us, Beat())
            return b""
        if frame.kind == Kind.STOP:
            return self._stop(now_us, frame)
        if frame.kind in (Kind.HELLO, Kind.DATA):  # which obey no order
            perform = self._greet if frame.kind == Kind.HELLO else self._perform
            return _coded(frame, perform(now_us, frame))
        if frame == self._last_question:
            return self._last_answer
        if not self._is_newer(frame):
            self.core.advance(now_us)
            return _coded(frame, self._answer(Refusal.STALE))
        answer = self._perform(now_us, frame)
        coded = _coded(frame, answer)
        if answer.refusal is not Refusal.WRONG_BOOT:
            self._newest, self._last_question, self._last_answer = frame.sequence, frame, coded
        return coded

    def _is_meant(self, frame: Frame, message: Message[None]) -> bool:
        return frame.payload == protocol.pack_question(message, self.core.boot_id)

    def _is_newer(self, frame: Frame) -> bool:
        if self._newest is None:
            return True
        return 0 < (frame.sequence - self._newest) & 0xFFFF < _HALF_TURN

    def _stop(self, now_us: int, frame: Frame) -> bytes:
        """Stop at the request of any host; no earlier request undoes it, however late it comes."""
        self.core.take(now_us, Stop())
        if self._is_newer(frame) and self._is_meant(frame, Stop()):
            self._newest = frame.sequence
        return _coded(frame, self._answer(None))

    def _greet(self, now_us: int, frame: Frame) -> AnswerPayload:
        """Begin a connection; a HELLO that came before only gets its answer again."""
        self.core.advance(now_us)
        try:
            nonce = protocol.TABLE[Kind.HELLO].message.read(frame.payload).nonce
        except Rejected as refused:
            return self._answer(refused.code)
        if nonce not in self._greetings:
            if self.core.state is not State.IDLE:
                self.core.take(now_us, Stop())
            self._greetings.append(nonce)
            self._newest, self._last_question = frame.sequence, None
            self._uploads.forget()
        elif nonce != self._greetings[-1]:
            return self._answer(Refusal.STALE)
        return self._answer(None, protocol.pack_greeting(nonce, self._identity))

    def _perform(self, now_us: int, frame: Frame) -> AnswerPayload:
        """Do what a question asks, or say why not."""
        self.core.advance(now_us)
        try:
            question = protocol.QUESTION.read(frame.payload)
            if question.boot_id != self.core.boot_id:
                raise rejection(Refusal.WRONG_BOOT)
            return self._done(now_us, frame, protocol.read_message(frame.kind, question.content))
        except Rejected as refused:
            return self._answer(refused.code)

    def _done(self, now_us: int, frame: Frame, message: Message[Any]) -> AnswerPayload:
        reply = None
        match message:
            case Begin():
                self._uploads.begin(message, frame.sequence)
            case Data():
                self._uploads.add(message)
            case Commit():
                self.core.take(now_us, self._uploads.finish(message))
            case _:
                reply = self.core.take(now_us, message)
        return self._answer(None, protocol.pack_report(frame.kind, reply, self._identity.channels))

    def _answer(self, refusal: Refusal | None, body: bytes = b"") -> AnswerPayload:
        return AnswerPayload(
            refusal=refusal,
            state=self.core.state,
            boot_id=self.core.boot_id,
            device_us=self.core.now_us,
            body=body,
        )


def _coded(question: Frame, answer: AnswerPayload) -> bytes:
    return encode(question.answered(protocol.HEAD.pack(answer)))
