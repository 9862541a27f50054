"""The host's end of the wire: messages as frames over a line that may lose or damage any of them.

Every question is sent again until its answer comes; the device does each only once. What cannot be
known after that is said to be unknown.
"""

import zlib
from collections.abc import Callable
from threading import Event, Lock, Thread
from typing import Final, Protocol

import numpy as np

from device import wire
from device.clock import Clock, MonotonicClock, resolution_s
from device.counts import CodeArray
from device.driver import Identity, LinkError, Refusal, rejection
from device.frames import VERSION, Decoder, Frame, encode
from device.messages import Arm, Levels, Load
from device.states import State
from device.tokens import Exchange, Fate, Record
from device.wire import Answer, Begin, Commit, Kind

ANSWER_WITHIN_S: Final = 0.025
"""A question is sent again when its answer took longer than this."""

PATIENCE_S: Final = 2.0
"""A question that was not answered for so long is given up."""

BEAT_EVERY_S: Final = 0.1
"""Interval of the heartbeat."""

_STOPS: Final = 3
"""STOP is sent so often at once: a frame that is under way may spoil the first."""


class Channel(Protocol):
    """A line that carries bytes both ways.

    Every method raises `LinkError` once the line is gone.

    Examples
    --------
    >>> sorted(name for name in vars(Channel) if not name.startswith("_"))
    ['close', 'read', 'write']
    """

    def write(self, data: bytes) -> None:
        """Send bytes; from several threads."""

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, or wait for it; nothing after `timeout_s`."""

    def close(self) -> None:
        """Close the line."""


class FrameLink:
    """A `host.Link` that speaks the wire format over a channel.

    Parameters
    ----------
    connect : callable
        Opens the channel; raises `LinkError` where it cannot.
    clock : Clock
        The host's. On the machine's clock a thread keeps up the heartbeat; on any other the
        channel has to.

    Examples
    --------
    >>> from device.clock import VirtualClock
    >>> def unplugged():
    ...     raise LinkError("no such port")
    >>> FrameLink(unplugged, VirtualClock()).hello()
    Traceback (most recent call last):
    device.driver.LinkError: no such port
    """

    def __init__(self, connect: Callable[[], Channel], clock: Clock) -> None:
        self._connect = connect
        self._clock = clock
        self._channel: Channel | None = None
        self._decoder = Decoder()
        self._state = State.CLOSED
        self._stops = self._stops_heard = 0
        self._boot_id = 0
        self._sequence = 0
        self._code_type = wire.code_type(16)
        self._retries = 0
        self._lock = Lock()
        self._heart: _Heart | None = None

    @property
    def state(self) -> State:
        """The device's state with its last answer; SAFE after `stop`, CLOSED if not connected."""
        stopped = self._stops != self._stops_heard and self._state is not State.CLOSED
        return State.SAFE if stopped else self._state

    @property
    def boot_id(self) -> int:
        """The power cycle that was last heard of."""
        return self._boot_id

    def hello(self) -> Identity:
        """Connect and return who answered.

        Raises
        ------
        LinkError
            If there is no line, or nothing answers on it.
        """
        self._drop()
        self._channel = self._connect()
        self._decoder = Decoder()
        answer = self._ask(Kind.HELLO, b"")
        identity = wire.read_identity(answer, major=VERSION)
        self._code_type = wire.code_type(identity.bits)
        if isinstance(self._clock, MonotonicClock):
            self._heart = _Heart(self._beat)
        return identity

    def load(self, message: Load) -> None:
        """Send a waveform in pieces and have the device store it."""
        codes = np.concatenate((message.left, message.right)).astype(self._code_type).tobytes()
        samples = _samples(message.left)
        self._tell(Kind.BEGIN, wire.pack_begin(Begin(slot=message.slot, samples=samples)))
        for offset in range(0, len(codes), wire.LONGEST_DATA):
            piece = codes[offset : offset + wire.LONGEST_DATA]
            self._tell(Kind.DATA, wire.pack_data(offset, piece))
        commit = Commit(slot=message.slot, crc=zlib.crc32(codes))
        self._tell(Kind.COMMIT, wire.pack_commit(commit))

    def set_levels(self, message: Levels) -> None:
        """Send LEVEL."""
        self._tell(Kind.LEVEL, wire.pack_levels(message))

    def enable(self) -> None:
        """Send OUTPUT."""
        self._tell(Kind.OUTPUT)

    def arm(self, message: Arm) -> None:
        """Send ARM."""
        self._tell(Kind.ARM, wire.pack_arm(message))

    def fire(self, token: int) -> Exchange:
        """Send FIRE; without an answer DISARM and QUERY, and without that say UNKNOWN."""
        before_s = self._clock.now_s()
        try:
            return self._exchange(Kind.FIRE, token, before_s)
        except _Unanswered:
            pass
        try:
            self.disarm(token)
            return self._exchange(Kind.QUERY, token, before_s)
        except _Unanswered:
            return self._unknown(token, before_s)

    def disarm(self, token: int) -> None:
        """Send DISARM."""
        self._tell(Kind.DISARM, wire.pack_token(token))

    def query(self, token: int) -> Exchange:
        """Send QUERY and return question and answer; UNKNOWN where none came."""
        before_s = self._clock.now_s()
        try:
            return self._exchange(Kind.QUERY, token, before_s)
        except _Unanswered:
            return self._unknown(token, before_s)

    def ping(self) -> Answer:
        """Send PING and return the answer, with the device's time."""
        return self._ask(Kind.PING, wire.for_boot(self._boot_id))

    def stop(self) -> None:
        """Send STOP: from any thread, in any state, without waiting for a lock.

        Until the device has answered it the heart sends STOP again instead of beating, and no
        other question is sent.
        """
        self._stops += 1
        channel = self._channel
        if channel is not None:
            try:
                channel.write(_STOPS * self._stop_frame())
            except LinkError:
                return

    def hang_up(self) -> None:
        """Disconnect."""
        self._drop()

    def _drop(self) -> None:
        if self._heart is not None:
            self._heart.end()
            self._heart = None
        if self._channel is not None:
            self._channel.close()
            self._channel = None
        self._state = State.CLOSED

    def _beat(self) -> None:
        channel = self._channel
        if channel is None:
            return
        if self._stops != self._stops_heard:
            channel.write(self._stop_frame())
            return
        frame = Frame(kind=Kind.BEAT, sequence=0, payload=wire.for_boot(self._boot_id))
        with self._lock:
            channel.write(encode(frame))

    def _stop_frame(self) -> bytes:
        number = self._stops & 0xFFFF
        return encode(Frame(kind=Kind.STOP, sequence=number, payload=wire.for_boot(self._boot_id)))

    def _tell(self, kind: Kind, content: bytes = b"") -> None:
        """Have something done by the power cycle that said hello."""
        answer = self._ask(kind, wire.for_boot(self._boot_id, content))
        if answer.refusal is Refusal.WRONG_BOOT:
            raise LinkError("the device restarted and forgot everything: open it again")
        if answer.refusal is not None:
            raise rejection(answer.refusal, f"the device, on {kind.name}")

    def _exchange(self, kind: Kind, token: int, before_s: float) -> Exchange:
        """Ask what became of a token."""
        boot_id = self._boot_id
        answer = self._ask(kind, wire.for_boot(boot_id, wire.pack_token(token)))
        if answer.refusal is Refusal.WRONG_BOOT:
            return self._unknown(token, before_s)
        if answer.refusal is not None:
            raise rejection(answer.refusal, f"the device, on {kind.name}")
        return self._told(wire.read_record(answer.body), before_s, answer.device_us)

    def _unknown(self, token: int, before_s: float) -> Exchange:
        return self._told(Record(token=token, fate=Fate.UNKNOWN), before_s, 0)

    def _told(self, record: Record, before_s: float, device_us: int) -> Exchange:
        return Exchange(
            record=record,
            boot_id=self._boot_id,
            host_before_s=before_s,
            host_after_s=self._clock.now_s(),
            device_us=device_us,
            resolution_s=resolution_s(self._clock),
            retries=self._retries,
        )

    def _ask(self, kind: Kind, payload: bytes) -> Answer:
        """Send a question until its answer comes; also a refusal tells state and power cycle."""
        if kind is not Kind.HELLO and self._stops != self._stops_heard:
            stop = Frame(kind=Kind.STOP, sequence=self._stops & 0xFFFF, payload=b"")
            self._insist(stop)
        self._sequence = (self._sequence + 1) & 0xFFFF
        return self._insist(Frame(kind=kind, sequence=self._sequence, payload=payload))

    def _insist(self, question: Frame) -> Answer:
        channel = self._channel
        if channel is None:
            raise LinkError("the device is not connected")
        give_up_s = self._clock.now_s() + PATIENCE_S
        self._retries = -1
        while self._clock.now_s() < give_up_s:
            self._retries += 1
            with self._lock:
                channel.write(encode(question))
            answer = self._listen(channel, question)
            if answer is not None:
                return answer
        name = Kind(question.kind).name
        raise _Unanswered(f"the device did not answer {name} for {PATIENCE_S:g} s")

    def _listen(self, channel: Channel, question: Frame) -> Answer | None:
        """Return the answer to a question, or None when it is late."""
        late_s = self._clock.now_s() + ANSWER_WITHIN_S
        while (left_s := late_s - self._clock.now_s()) > 0:
            for frame in self._decoder.feed(channel.read(left_s)):
                answer = self._heard(frame)
                wanted = question.kind | wire.ANSWER, question.sequence
                if answer is not None and (frame.kind, frame.sequence) == wanted:
                    return answer
        return None

    def _heard(self, frame: Frame) -> Answer | None:
        """Learn from an answer; one to an earlier question or STOP tells nothing new."""
        stops, to_stop = self._stops, frame.kind == Kind.STOP | wire.ANSWER
        if frame.sequence != (stops & 0xFFFF if to_stop else self._sequence):
            return None
        answer = wire.read_answer(frame.payload)
        self._state, self._boot_id = answer.state, answer.boot_id
        if to_stop:
            self._stops_heard = stops
        return answer


class _Unanswered(LinkError):  # noqa: N818 - a link error by what it is, not by its name
    """A question that was never answered."""


class _Heart:
    """A thread that beats until it is told to end or the line is gone."""

    def __init__(self, beat: Callable[[], None]) -> None:
        self._beat = beat
        self._over = Event()
        self._thread = Thread(target=self._run, name="tactstrip heartbeat", daemon=True)
        self._thread.start()

    def end(self) -> None:
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(BEAT_EVERY_S):
            try:
                self._beat()
            except LinkError:
                return


def _samples(codes: CodeArray) -> int:
    return int(codes.size)
