"""The device's end of the wire: frames in, frames out, around a core; without I/O.

What an emulator or a firmware has to do, and nothing else: docs/protocol.md.
"""

import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from device import wire
from device.core import DeviceCore
from device.counts import check_slot
from device.driver import Identity, Refusal, Rejected, rejection
from device.frames import MINOR, Decoder, Frame, encode
from device.messages import Load
from device.wire import Answer, Kind

if TYPE_CHECKING:
    from collections.abc import Callable

_HALF_TURN: Final = 0x8000


@dataclass(slots=True)
class _Upload:
    slot: int
    data: bytearray
    missing: set[int]


class Endpoint:
    """A core behind the wire format.

    Parameters
    ----------
    core : DeviceCore
        The device.
    identity : Identity
        What it says of itself; its boot id is the core's.

    Examples
    --------
    >>> from device.limits import Limits
    >>> from device.output import OutputStage
    >>> core = DeviceCore(boot_id=5, limits=Limits(ceiling_vpp=200.0), output=OutputStage(),
    ...                   sink=print)
    >>> identity = Identity(model="m", serial_number="1", boot_id=5, protocol_version="1.0",
    ...                     sample_rate_hz=48e3, bits=16, channels=2, ceiling_vpp=200.0,
    ...                     longest_waveform=4096, emulated=True)
    >>> endpoint = Endpoint(core, identity)
    >>> ping = encode(Frame(kind=Kind.PING, sequence=1, payload=wire.for_boot(5)))
    >>> answer, = Decoder().feed(endpoint.receive(10, ping))
    >>> wire.read_answer(answer.payload).state.value
    'idle'
    """

    def __init__(self, core: DeviceCore, identity: Identity) -> None:
        self.core = core
        self._identity = identity
        self._decoder = Decoder()
        self._last_question: Frame | None = None
        self._last_answer = b""
        self._upload: _Upload | None = None
        self._actions: dict[int, Callable[[int, bytes], bytes | None]] = {
            Kind.PING: lambda now_us, _: core.advance(now_us),
            Kind.BEGIN: self._begin,
            Kind.DATA: self._data,
            Kind.COMMIT: self._commit,
            Kind.LEVEL: lambda now_us, said: core.set_levels(now_us, wire.read_levels(said)),
            Kind.OUTPUT: lambda now_us, _: core.enable(now_us),
            Kind.ARM: lambda now_us, said: core.arm(now_us, wire.read_arm(said)),
            Kind.DISARM: lambda now_us, said: core.disarm(now_us, wire.read_token(said)),
            Kind.FIRE: lambda now_us, said: wire.pack_record(
                core.fire(now_us, wire.read_token(said))
            ),
            Kind.QUERY: lambda now_us, said: wire.pack_record(
                core.query(now_us, wire.read_token(said))
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
            Frames, or nothing.
        """
        return b"".join(self._respond(now_us, frame) for frame in self._decoder.feed(data))

    def hang_up(self, now_us: int) -> None:
        """Notice that the line is gone: the outputs go to zero."""
        self.core.stop(now_us)
        self._decoder = Decoder()
        self._upload = None

    def _respond(self, now_us: int, frame: Frame) -> bytes:
        if frame.kind == Kind.BEAT:
            self._beat(now_us, frame)
            return b""
        if frame.kind == Kind.STOP:
            self.core.stop(now_us)
            return encode(frame.answered(self._answer(None).packed()))
        if frame == self._last_question:
            return self._last_answer
        if frame.kind != Kind.HELLO and not self._is_newer(frame):
            return encode(frame.answered(self._answer(Refusal.STALE).packed()))
        answer = self._perform(now_us, frame)
        self._last_question = frame
        self._last_answer = encode(frame.answered(answer.packed()))
        return self._last_answer

    def _is_newer(self, frame: Frame) -> bool:
        if self._last_question is None:
            return True
        ahead = (frame.sequence - self._last_question.sequence) & 0xFFFF
        return 0 < ahead < _HALF_TURN

    def _beat(self, now_us: int, frame: Frame) -> None:
        try:
            boot_id, _ = wire.split_boot(frame.payload)
        except Rejected:
            return
        if boot_id == self.core.boot_id:
            self.core.beat(now_us)

    def _perform(self, now_us: int, frame: Frame) -> Answer:
        """Do what a question asks, or say why not."""
        try:
            if frame.kind == Kind.HELLO:
                self.core.advance(now_us)
                return self._answer(None, wire.pack_identity(self._identity, minor=MINOR))
            boot_id, content = wire.split_boot(frame.payload)
            if boot_id != self.core.boot_id:
                raise rejection(Refusal.WRONG_BOOT)
            if frame.kind not in self._actions:
                raise rejection(Refusal.BAD_MESSAGE, f"type {frame.kind:#04x}")
            return self._answer(None, self._actions[frame.kind](now_us, content) or b"")
        except Rejected as refused:
            self.core.advance(now_us)
            return self._answer(refused.code)

    def _answer(self, refusal: Refusal | None, body: bytes = b"") -> Answer:
        return Answer(
            refusal=refusal,
            state=self.core.state,
            boot_id=self.core.boot_id,
            device_us=self.core.now_us,
            body=body,
        )

    def _begin(self, now_us: int, content: bytes) -> None:
        self.core.advance(now_us)
        begin = wire.read_begin(content)
        slot = check_slot(begin.slot)
        if not 1 <= begin.samples <= self._identity.longest_waveform:
            raise rejection(Refusal.WAVEFORM_TOO_LONG, f"{begin.samples} samples")
        size = 2 * begin.samples * wire.code_type(self._identity.bits).itemsize
        self._upload = _Upload(slot, bytearray(size), set(range(0, size, wire.LONGEST_DATA)))

    def _data(self, now_us: int, content: bytes) -> None:
        self.core.advance(now_us)
        offset, piece = wire.read_data(content)
        upload = self._upload
        if upload is None or offset % wire.LONGEST_DATA or offset >= len(upload.data):
            raise rejection(Refusal.BAD_UPLOAD, f"no place for bytes at {offset}")
        if len(piece) != min(wire.LONGEST_DATA, len(upload.data) - offset):
            raise rejection(Refusal.BAD_UPLOAD, f"{len(piece)} bytes at {offset}")
        upload.data[offset : offset + len(piece)] = piece
        upload.missing.discard(offset)

    def _commit(self, now_us: int, content: bytes) -> None:
        self.core.advance(now_us)
        commit = wire.read_commit(content)
        upload, self._upload = self._upload, None
        if upload is None or upload.slot != commit.slot or upload.missing:
            raise rejection(Refusal.BAD_UPLOAD)
        if zlib.crc32(upload.data) != commit.crc:
            raise rejection(Refusal.BAD_UPLOAD, "its checksum differs")
        codes = np.frombuffer(bytes(upload.data), dtype=wire.code_type(self._identity.bits))
        left, right = codes.astype(np.int32).reshape(2, -1)
        self.core.load(now_us, Load(slot=commit.slot, left=left, right=right))
