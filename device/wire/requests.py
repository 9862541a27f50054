"""Questions and answers over a line that may lose or damage any of them; stops and beats between.

Every question is sent again until its answer comes; the device does each only once.
"""

from __future__ import annotations

import contextlib
import secrets
from itertools import count
from threading import Lock
from typing import TYPE_CHECKING, Any, Final, TypeVar

from device.core.messages import Beat, Enable, Message, Stop
from device.core.states import State
from device.errors import LinkError, Refusal, Rejected, rejection
from device.wire import protocol
from device.wire.frames import MAKER, QUESTION, Decoder, Frame, encode
from device.wire.protocol import AnswerPayload, Hello, Kind

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.wire.channels import Channel

_STOPS: Final = 3
"""STOP is sent so often at once: a frame that is under way may spoil the first."""

_BEATS: Final = 2
"""BEAT is sent so often at once, for the same reason."""

_MAX_STALE: Final = 8

_MIN_TEXT: Final = 4
"""Fewer characters may be noise."""

_Read = TypeVar("_Read")


class UnansweredError(LinkError):
    """A question that was never answered."""


class RestartedError(LinkError):
    """A question that was meant for a power cycle that is over."""


def framed(message: Message[Any], number: int, boot_id: int) -> Frame:
    """Return the frame of a message for one power cycle."""
    return Frame(
        kind=protocol.kind_of(message),
        sequence=number & 0xFFFF,
        payload=protocol.pack_question(message, boot_id),
    )


def read_answer(read: Callable[[], _Read]) -> _Read:
    """Read an answer; one that cannot be read is no refusal, and says nothing of what was done."""
    try:
        return read()
    except Rejected as error:
        raise LinkError(f"an answer that cannot be read, {error}") from error


class RequestChannel:
    """A host's questions to the device on a channel, once it is connected.

    Only `stop` and `beat` may be called from more than one thread.

    Attributes
    ----------
    boot_id : int
        The power cycle that was last heard of.
    number : int
        Of the last question.
    last_stop : int
        Number of the last STOP; -1 before the first.
    retries : int
        How many questions were sent again so far.
    """

    def __init__(self, clock: Clock, *, answer_within_s: float, response_timeout_s: float) -> None:
        self._clock = clock
        self._answer_within_s = answer_within_s
        self._response_timeout_s = response_timeout_s
        self._channel: Channel | None = None
        self._writing = Lock()
        self._state = State.CLOSED
        self._numbers = count(secrets.randbits(16))
        self._stops: set[int] = set()
        self._decoder = Decoder()
        self._device_us = 0
        self.boot_id = self.number = self.retries = 0
        self.last_stop = -1

    @property
    def state(self) -> State:
        """The device's state with its last answer; SAFE after `stop`, CLOSED if not connected."""
        stopped = self._stops and self._state is not State.CLOSED
        return State.SAFE if stopped else self._state

    def connect(self, channel: Channel) -> None:
        """Ask on this channel from now on; what was half read, and the device's time, go."""
        self._channel = channel
        self._decoder = Decoder()
        self._device_us = 0

    def disconnect(self) -> None:
        """Close the channel."""
        channel, self._channel = self._channel, None
        if channel is not None:
            channel.close()
        self._state = State.CLOSED

    def stop(self) -> None:
        """Send STOP: from any thread, in any state, without waiting for a lock.

        Until the device has answered it the heart sends STOP again instead of beating, and no
        question is sent before it.
        """
        number = next(self._numbers)
        self._stops.add(number)
        self.last_stop = number
        channel = self._channel
        if channel is not None:
            with contextlib.suppress(LinkError):
                channel.write(_STOPS * encode(self._stop_question(number)))

    def beat(self) -> None:
        """Send BEAT, or STOP again while one is not confirmed; never waits for an answer."""
        channel = self._channel
        if channel is None:
            return
        stops = tuple(self._stops)
        if stops:
            data = encode(self._stop_question(max(stops)))
        else:
            data = _BEATS * encode(framed(Beat(), 0, self.boot_id))
        with self._writing:
            channel.write(data)

    def confirm_stops(self, response_timeout_s: float | None = None) -> None:
        """Wait until the device has answered every STOP."""
        while stops := tuple(self._stops):
            self._send_until_answered(self._stop_question(max(stops)), response_timeout_s)

    def ask(
        self, message: Message[Any], boot_id: int, response_timeout_s: float | None = None
    ) -> AnswerPayload:
        """Send a question until its answer comes; also a refusal reports state and power cycle.

        If a stop from another thread overtakes a question, the device does not act on the question.
        The question is then repeated, unless it would switch on what was just stopped.
        """
        for _ in range(_MAX_STALE):
            if not isinstance(message, Hello):
                self.confirm_stops()
            self.number = next(self._numbers)
            question = framed(message, self.number, boot_id)
            answer = self._send_until_answered(question, response_timeout_s)
            if answer.refusal is not Refusal.STALE:
                return answer
            if isinstance(message, Enable):
                raise rejection(Refusal.SAFE_STATE, "a stop came meanwhile")
        raise LinkError("the device takes every question for an old one: open it again")

    def plain_answer(self, within_s: float) -> str:
        """Ask in plain text who is there; see `plain_answer`."""
        return plain_answer(self._open_channel, self._clock, within_s)

    def _stop_question(self, number: int) -> Frame:
        return framed(Stop(), number, self.boot_id)

    def _send_until_answered(
        self, question: Frame, response_timeout_s: float | None
    ) -> AnswerPayload:
        timeout_s = response_timeout_s or self._response_timeout_s
        began_s = self._clock.now_s()
        is_first = True
        while is_first or self._clock.now_s() < began_s + timeout_s:
            self.retries += not is_first
            is_first = False
            self._write(encode(question))
            answer = self._listen(question, self._answer_within_s)
            if answer is not None:
                return answer
        raise _unanswered(Kind(question.kind), timeout_s)

    @property
    def _open_channel(self) -> Channel:
        if self._channel is None:
            raise LinkError("the device is not connected")
        return self._channel

    def _write(self, data: bytes) -> None:
        with self._writing:
            self._open_channel.write(data)

    def _listen(self, question: Frame, within_s: float) -> AnswerPayload | None:
        """Return the answer to a question, or None when it is late."""
        expected = question.answered(b"")
        answer = None
        late_s = self._clock.now_s() + within_s
        while answer is None and (wait_s := late_s - self._clock.now_s()) > 0:
            for frame in self._read_frames(wait_s):
                if (frame.kind, frame.sequence) == (expected.kind, expected.sequence):
                    answer = self._accept(frame)
        return answer

    def _read_frames(self, within_s: float) -> list[Frame]:
        """Return the frames that arrive next; what stops they answer is noted."""
        frames = self._decoder.feed(self._open_channel.read(within_s))
        for frame in frames:
            if frame.kind == Kind.STOP | protocol.ANSWER:
                self._on_stopped(frame)
        return frames

    def _on_stopped(self, frame: Frame) -> None:
        """Note that a stop was obeyed, and with it every one before."""
        stops = tuple(self._stops)
        obeyed = [number for number in stops if number & 0xFFFF == frame.sequence]
        if obeyed:
            self._accept(frame)
            self._stops.difference_update(number for number in stops if number <= max(obeyed))

    def _accept(self, frame: Frame) -> AnswerPayload:
        """Read an answer; one that was overtaken says nothing of the state."""
        answer = read_answer(lambda: protocol.HEAD.read(frame.payload))
        if answer.boot_id != self.boot_id or answer.device_us >= self._device_us:
            self._state, self.boot_id = answer.state, answer.boot_id
            self._device_us = answer.device_us
        return answer


def _unanswered(kind: Kind, timeout_s: float) -> UnansweredError:
    return UnansweredError(f"the device did not answer {kind.name} for {timeout_s:g} s")


def plain_answer(channel: Channel, clock: Clock, within_s: float) -> str:
    """Ask in plain text who is there and return the answer; "" where none can be read."""
    channel.write(b"\0" + QUESTION + b"\n")
    until_s, received = clock.now_s() + within_s, b""
    while (left_s := until_s - clock.now_s()) > 0 and not _is_whole(received):
        received += channel.read(left_s)
    lines = (line.rsplit(b"\0", 1)[-1].strip() for line in received.split(b"\n"))
    texts = [line.decode() for line in lines if line.isascii() and len(line) >= _MIN_TEXT]
    texts = [text for text in texts if text.isprintable()]
    return next((text for text in texts if text.startswith(MAKER)), "".join(texts[:1]))


def _is_whole(received: bytes) -> bool:
    return received.endswith(b"\n") and MAKER.encode() in received
