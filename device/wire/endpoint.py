"""The device's end of the wire: frames in, frames out, around a core; without I/O.

What an emulator or a firmware has to do, and nothing else: docs/protocol.md.
"""

from __future__ import annotations

import zlib
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from device.core.messages import Load, check_slot
from device.core.states import State
from device.driver import Identity, Refusal, Rejected, rejection
from device.wire import codec
from device.wire.codec import Answer, Kind
from device.wire.frames import MINOR, Decoder, Frame, IdentityLine, encode

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.core.core import DeviceCore


_HALF_TURN: Final = 0x8000
_GREETINGS: Final = 16


@dataclass(slots=True)
class _Upload:
    slot: int
    data: bytearray
    missing: set[int]


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
    >>> core = DeviceCore(boot_id=5, limits=Limits(ceiling_vpp=200.0), output=OutputStage(),
    ...                   sink=print)
    >>> identity = Identity(model="m", serial_number="1", boot_id=5, protocol_version="1.0",
    ...                     sample_rate_hz=48e3, bits=16, channels=2, ceiling_vpp=200.0,
    ...                     longest_waveform=4096, emulated=True)
    >>> endpoint = Endpoint(core, identity)
    >>> ping = encode(Frame(kind=Kind.PING, sequence=1, payload=codec.for_boot(5)))
    >>> answer, = Decoder().feed(endpoint.receive(10, ping))
    >>> codec.read_answer(answer.payload).state.value
    'idle'
    >>> endpoint.receive(20, b"*IDN?\n")
    b'tactstrip,m,1,protocol 1.0\n'
    """

    def __init__(self, core: DeviceCore, identity: Identity) -> None:
        self.core = core
        self._identity = identity
        self._decoder = Decoder()
        self._text = IdentityLine(identity)
        self._greetings: deque[int] = deque(maxlen=_GREETINGS)
        self._newest: int | None = None
        self._last_question: Frame | None = None
        self._last_answer = b""
        self._upload: _Upload | None = None
        self._actions: dict[int, Callable[[int, bytes], bytes | None]] = {
            Kind.PING: self._ping,
            Kind.BEGIN: self._begin,
            Kind.DATA: self._data,
            Kind.COMMIT: self._commit,
            Kind.LEVEL: lambda now_us, said: core.set_levels(now_us, codec.read_levels(said)),
            Kind.OUTPUT: self._enable,
            Kind.ARM: lambda now_us, said: core.arm(now_us, codec.read_arm(said)),
            Kind.DISARM: lambda now_us, said: core.disarm(now_us, codec.read_token(said)),
            Kind.FIRE: lambda now_us, said: codec.pack_record(
                core.fire(now_us, codec.read_token(said))
            ),
            Kind.QUERY: lambda now_us, said: codec.pack_record(
                core.query(now_us, codec.read_token(said))
            ),
        }

    def receive(self, now_us: int, data: bytes) -> bytes:
        """Take bytes from the line and return the bytes to send back.

        Parameters
        ----------
        now_us : int
            The device's time.
        data : bytes
            Whatever arrived.

        Returns
        -------
        bytes
            Frames, the line that answers ``*IDN?``, or nothing.
        """
        frames = self._decoder.feed(data)
        questions = [frame for frame in frames if frame.kind < codec.ANSWER]
        answers = [self._respond(now_us, question) for question in questions]
        return b"".join(answers) + self._text.feed(data)

    def hang_up(self, now_us: int) -> None:
        """Notice that the line is gone: the outputs go to zero."""
        self.core.stop(now_us)
        self._decoder = Decoder()
        self._text = IdentityLine(self._identity)
        self._upload = None

    def _respond(self, now_us: int, frame: Frame) -> bytes:
        if frame.kind == Kind.BEAT:
            self._beat(now_us, frame)
            return b""
        if frame.kind == Kind.STOP:
            return self._stop(now_us, frame)
        if frame.kind == Kind.HELLO:
            return encode(frame.answered(self._greet(now_us, frame).packed()))
        if frame == self._last_question:
            return self._last_answer
        if not self._is_newer(frame):
            self.core.advance(now_us)
            return encode(frame.answered(self._answer(Refusal.STALE).packed()))
        answer = self._perform(now_us, frame)
        coded = encode(frame.answered(answer.packed()))
        if answer.refusal is not Refusal.WRONG_BOOT:
            self._newest, self._last_question, self._last_answer = frame.sequence, frame, coded
        return coded

    def _is_newer(self, frame: Frame) -> bool:
        if self._newest is None:
            return True
        return 0 < (frame.sequence - self._newest) & 0xFFFF < _HALF_TURN

    def _stop(self, now_us: int, frame: Frame) -> bytes:
        """Stop, whoever asks; no question from before may undo it, however late it comes."""
        self.core.stop(now_us)
        if self._is_newer(frame) and frame.payload == codec.for_boot(self.core.boot_id):
            self._newest = frame.sequence
        return encode(frame.answered(self._answer(None).packed()))

    def _beat(self, now_us: int, frame: Frame) -> None:
        if frame.payload == codec.for_boot(self.core.boot_id):
            self.core.beat(now_us)

    def _greet(self, now_us: int, frame: Frame) -> Answer:
        """Begin a connection; a HELLO that came before only gets its answer again."""
        self.core.advance(now_us)
        try:
            nonce = codec.read_hello(frame.payload)
        except Rejected as refused:
            return self._answer(refused.code)
        if nonce not in self._greetings:
            if self.core.state is not State.IDLE:
                self.core.stop(now_us)
            self._greetings.append(nonce)
            self._newest, self._last_question, self._upload = frame.sequence, None, None
        elif nonce != self._greetings[-1]:
            return self._answer(Refusal.STALE)
        return self._answer(None, codec.pack_identity(self._identity, nonce=nonce, minor=MINOR))

    def _perform(self, now_us: int, frame: Frame) -> Answer:
        """Do what a question asks, or say why not."""
        self.core.advance(now_us)
        try:
            boot_id, content = codec.split_boot(frame.payload)
            if boot_id != self.core.boot_id:
                raise rejection(Refusal.WRONG_BOOT)
            if frame.kind not in self._actions:
                raise rejection(Refusal.BAD_MESSAGE, f"type {frame.kind:#04x}")
            return self._answer(None, self._actions[frame.kind](now_us, content) or b"")
        except Rejected as refused:
            return self._answer(refused.code)

    def _answer(self, refusal: Refusal | None, body: bytes = b"") -> Answer:
        return Answer(
            refusal=refusal,
            state=self.core.state,
            boot_id=self.core.boot_id,
            device_us=self.core.now_us,
            body=body,
        )

    def _ping(self, now_us: int, content: bytes) -> None:
        codec.read_nothing(content)

    def _enable(self, now_us: int, content: bytes) -> None:
        codec.read_nothing(content)
        self.core.enable(now_us)

    def _begin(self, now_us: int, content: bytes) -> None:
        begin = codec.read_begin(content)
        slot = check_slot(begin.slot)
        if begin.samples == 0:
            raise rejection(Refusal.WAVEFORM_EMPTY)
        if begin.samples > self._identity.longest_waveform:
            raise rejection(Refusal.WAVEFORM_TOO_LONG, f"{begin.samples} samples")
        size = 2 * begin.samples * codec.code_type(self._identity.bits).itemsize
        self._upload = _Upload(slot, bytearray(size), set(range(0, size, codec.LONGEST_DATA)))

    def _data(self, now_us: int, content: bytes) -> None:
        offset, piece = codec.read_data(content)
        pending = self._upload
        if pending is None or offset % codec.LONGEST_DATA or offset >= len(pending.data):
            raise rejection(Refusal.BAD_UPLOAD, f"no place for bytes at {offset}")
        if len(piece) != min(codec.LONGEST_DATA, len(pending.data) - offset):
            raise rejection(Refusal.BAD_UPLOAD, f"{len(piece)} bytes at {offset}")
        pending.data[offset : offset + len(piece)] = piece
        pending.missing.discard(offset)

    def _commit(self, now_us: int, content: bytes) -> None:
        commit = codec.read_commit(content)
        pending, self._upload = self._upload, None
        if pending is None or pending.slot != commit.slot or pending.missing:
            raise rejection(Refusal.BAD_UPLOAD)
        if zlib.crc32(pending.data) != commit.crc:
            raise rejection(Refusal.BAD_UPLOAD, "its checksum differs")
        codes = np.frombuffer(bytes(pending.data), dtype=codec.code_type(self._identity.bits))
        left, right = codes.astype(np.int32).reshape(2, -1)
        self.core.load(now_us, Load(slot=commit.slot, left=left, right=right))
