"""The host's end of the wire: messages as frames over a line that may lose or damage any of them.

Every question is sent again until its answer comes; the device does each only once. What cannot be
known after that is said to be unknown.
"""

from __future__ import annotations

import contextlib
import secrets
from itertools import count
from threading import Lock
from typing import TYPE_CHECKING, Any, Final, TypeVar

from device.clock import Clock, ClockSync, MonotonicClock, Sample, resolution_s
from device.core.messages import (
    Beat,
    Disarm,
    Enable,
    Fire,
    Levels,
    LoadSlot,
    Message,
    Query,
    Stop,
)
from device.core.states import State
from device.core.tokens import Exchange, Fate, Record, Reply
from device.driver import Identity, LinkError, Refusal, Rejected, rejection
from device.wire import codec
from device.wire.channels import Channel, Heart
from device.wire.codec import AnswerPayload, Hello, Kind
from device.wire.frames import Decoder, Frame, encode
from device.wire.upload import pieces

if TYPE_CHECKING:
    from collections.abc import Callable

ANSWER_WITHIN_S: Final = 0.025
"""A question is sent again when its answer took longer than this."""

PATIENCE_S: Final = 2.0
"""A question that was not answered for so long is given up."""

_STOPS: Final = 3
"""STOP is sent so often at once: a frame that is under way may spoil the first."""

_BEATS: Final = 2
"""BEAT is sent so often at once, for the same reason."""

_FAREWELL_S: Final = 0.25
_STALE_AT_MOST: Final = 8

_Read = TypeVar("_Read")


class FrameLink:
    """A `host.Link` that speaks the wire format over a channel.

    `connect` opens the channel or raises `LinkError`. A question is sent again after
    `answer_within_s` and given up after `patience_s`. On the machine's clock a thread keeps up the
    heartbeat; on any other that is for the channel to do, by `beat`. Only `stop` may be called from
    more than one thread.

    >>> from device.clock import VirtualClock
    >>> def unplugged():
    ...     raise LinkError("no such port")
    >>> FrameLink(unplugged, VirtualClock()).hello()
    Traceback (most recent call last):
    device.driver.LinkError: no such port
    """

    def __init__(
        self,
        connect: Callable[[], Channel],
        clock: Clock,
        *,
        answer_within_s: float = ANSWER_WITHIN_S,
        patience_s: float = PATIENCE_S,
    ) -> None:
        self._connect = connect
        self._clock = clock
        self._answer_within_s = answer_within_s
        self._patience_s = patience_s
        self._channel: Channel | None = None
        self._decoder = Decoder()
        self._state = State.CLOSED
        self._boot_id = self._device_us = 0
        self._numbers = count(secrets.randbits(16))
        self._stops: set[int] = set()
        self._last_stop = -1
        self._bits = 16
        self._ceiling_vpp = 0.0
        self._levels_vpp = 0.0, 0.0
        self._retries = 0
        self._writing = Lock()
        self._heart: Heart | None = None
        self._resolution_s = resolution_s(clock)
        self.clock_sync = ClockSync()

    @property
    def state(self) -> State:
        """The device's state with its last answer; SAFE after `stop`, CLOSED if not connected."""
        stopped = self._stops and self._state is not State.CLOSED
        return State.SAFE if stopped else self._state

    @property
    def boot_id(self) -> int:
        """The power cycle that was last heard of."""
        return self._boot_id

    def hello(self) -> Identity:
        """Connect and return who answered, or raise `LinkError`."""
        self._drop()
        self._channel = self._connect()
        try:
            identity = self._greet()
        except LinkError:
            self._drop()
            raise
        self._bits = identity.bits
        self._ceiling_vpp = identity.ceiling_vpp
        if isinstance(self._clock, MonotonicClock):
            self._heart = Heart(self.beat)
        return identity

    def exchange(self, message: Message[Reply]) -> Exchange[Reply]:
        """Send a message until its answer comes; of a token that none comes for, say UNKNOWN."""
        last_stop = self._last_stop
        told = self._sent(message)
        if isinstance(message, Levels):
            self._levels_vpp = message.vpp
        if isinstance(message, Enable) and self._last_stop != last_stop:
            self.stop()  # asked for meanwhile, by another thread: a stop has the last word
        return told

    def _sent(self, message: Message[Any]) -> Exchange[Any]:
        if isinstance(message, LoadSlot):
            *begun, commit = pieces(message, self._bits)
            for piece in begun:
                self._done(piece)
            return self._done(commit)
        if isinstance(message, Fire):
            return self._fire(message)
        if isinstance(message, Query):
            before_s = self._clock.now_s()
            try:
                return self._done(message)
            except (_Unanswered, _Restarted):
                return self._unknown(message.token, before_s)
        return self._done(message)

    def _fire(self, message: Fire) -> Exchange[Record]:
        """Send FIRE; without an answer DISARM and QUERY, and without that say UNKNOWN."""
        boot_id, before_s = self._boot_id, self._clock.now_s()
        try:
            return self._done(message, boot_id, before_s)
        except _Restarted:
            return self._unknown(message.token, before_s)
        except _Unanswered:
            retries = self._retries
        # The FIRE may still be on its way: only of a device that has answered the DISARM is what
        # it then says of the token its last word.
        try:
            self._done(Disarm(token=message.token), boot_id)
            return self._done(Query(token=message.token), boot_id, before_s, retries=retries)
        except (_Unanswered, _Restarted, Rejected):
            return self._unknown(message.token, before_s, retries=retries)

    def stop(self) -> None:
        """Send STOP: from any thread, in any state, without waiting for a lock.

        Until the device has answered it the heart sends STOP again instead of beating, and no
        question is sent before it.
        """
        number = next(self._numbers)
        self._stops.add(number)
        self._last_stop = number
        channel = self._channel
        if channel is not None:
            with contextlib.suppress(LinkError):
                channel.write(_STOPS * self._stop_frame(number))

    def beat(self) -> None:
        """Send BEAT, or STOP again while one is not confirmed; never waits for an answer."""
        channel = self._channel
        if channel is None:
            return
        stops = tuple(self._stops)
        if stops:
            beat = self._stop_frame(max(stops))
        else:
            beat = _BEATS * encode(_framed(Beat(), 0, self._boot_id))
        with self._writing:
            channel.write(beat)

    def hang_up(self) -> None:
        """Disconnect; a stop that is not confirmed yet is waited for, for a moment."""
        if self._channel is not None:
            with contextlib.suppress(LinkError):
                self._confirm_stops(_FAREWELL_S)
        self._drop()

    def _drop(self) -> None:
        if self._heart is not None:
            self._heart.end()
            self._heart = None
        channel, self._channel = self._channel, None
        if channel is not None:
            channel.close()
        self._state = State.CLOSED

    def _greet(self) -> Identity:
        self._decoder = Decoder()
        self._device_us = 0
        self.clock_sync = ClockSync()
        hello = Hello(nonce=secrets.randbits(64))
        answer = self._ask(hello, 0)
        greeting = _understood(lambda: codec.GREETING.read(answer.body))
        if greeting.nonce != hello.nonce:
            raise LinkError("the answer is to another HELLO")
        return _understood(lambda: greeting.identity(answer.boot_id))

    def _stop_frame(self, number: int) -> bytes:
        return encode(self._stop_question(number))

    def _stop_question(self, number: int) -> Frame:
        return _framed(Stop(), number, self._boot_id)

    def _done(
        self,
        message: Message[Reply],
        boot_id: int | None = None,
        before_s: float | None = None,
        *,
        retries: int = 0,
    ) -> Exchange[Reply]:
        """Have a message done by one power cycle, the one last heard of, and return both."""
        before_s = self._clock.now_s() if before_s is None else before_s
        answer = self._ask(message, self._boot_id if boot_id is None else boot_id)
        after_s, retries = self._clock.now_s(), retries + self._retries
        self._require_done(message, answer)
        record = self._record(message, answer)
        if record is not None:
            sample = Sample(before_s=before_s, after_s=after_s, device_s=answer.device_us / 1e6)
            before_s, after_s = self.clock_sync.narrowed(sample)
        return Exchange(
            record=record,
            boot_id=answer.boot_id,
            host_before_s=before_s,
            host_after_s=after_s,
            device_us=answer.device_us,
            resolution_s=self._resolution_s,
            retries=retries,
        )

    def _record(self, message: Message[Any], answer: AnswerPayload) -> Any:
        """Return the record that a FIRE or QUERY is answered with, None for anything else."""
        if not isinstance(message, Fire | Query):
            return None
        record = _understood(lambda: codec.TOLD.read(answer.body)).record
        if record.token != message.token or (record.start_us or 0) > answer.device_us:
            name = codec.kind_of(message).name
            raise LinkError(f"the device's answer to {name} contradicts itself")
        return record

    def _require_done(self, message: Message[Any], answer: AnswerPayload) -> None:
        if answer.refusal is None:
            return
        if answer.refusal is Refusal.WRONG_BOOT:
            raise _Restarted("the device restarted and forgot everything: open it again")
        detail = f"the device, on {codec.kind_of(message).name}"
        if answer.refusal is Refusal.CEILING:
            left_vpp, right_vpp = message.vpp if isinstance(message, Levels) else self._levels_vpp
            ceiling = f"its ceiling {self._ceiling_vpp:g} Vpp"
            detail += f": {left_vpp:g} and {right_vpp:g} Vpp, {ceiling}"
        raise rejection(answer.refusal, detail)

    def _unknown(self, token: int, before_s: float, *, retries: int = 0) -> Exchange[Record]:
        return Exchange(
            record=Record(token=token, fate=Fate.UNKNOWN),
            boot_id=self._boot_id,
            host_before_s=before_s,
            host_after_s=self._clock.now_s(),
            device_us=0,
            resolution_s=self._resolution_s,
            retries=retries + self._retries,
        )

    def _ask(self, message: Message[Any], boot_id: int) -> AnswerPayload:
        """Send a question until its answer comes; also a refusal tells state and power cycle.

        A stop from another thread may overtake a question, which the device does not do then. It
        is asked anew, except to switch on what was just stopped.
        """
        retries = 0
        for _ in range(_STALE_AT_MOST):
            if not isinstance(message, Hello):
                self._confirm_stops(self._patience_s)
            question = _framed(message, next(self._numbers), boot_id)
            answer = self._insist(question, self._patience_s)
            self._retries = retries = retries + self._retries
            if answer.refusal is not Refusal.STALE:
                return answer
            if isinstance(message, Enable):
                raise rejection(Refusal.SAFE_STATE, "a stop came meanwhile")
        raise LinkError("the device takes every question for an old one: open it again")

    def _confirm_stops(self, patience_s: float) -> None:
        while stops := tuple(self._stops):
            self._insist(self._stop_question(max(stops)), patience_s)

    def _insist(self, question: Frame, patience_s: float) -> AnswerPayload:
        channel = self._channel
        if channel is None:
            raise LinkError("the device is not connected")
        began_s = self._clock.now_s()
        self._retries = -1
        while self._clock.now_s() < began_s + patience_s:
            self._retries += 1
            with self._writing:
                channel.write(encode(question))
            answer = self._listen(channel, question)
            if answer is not None:
                if question.kind != Kind.STOP:
                    self._learn_clock(answer, began_s)
                return answer
        name = Kind(question.kind).name
        raise _Unanswered(f"the device did not answer {name} for {patience_s:g} s")

    def _learn_clock(self, answer: AnswerPayload, began_s: float) -> None:
        after_s, device_s = self._clock.now_s(), answer.device_us / 1e6
        self.clock_sync.hear(Sample(before_s=began_s, after_s=after_s, device_s=device_s))

    def _listen(self, channel: Channel, question: Frame) -> AnswerPayload | None:
        """Return the answer to a question, or None when it is late."""
        wanted = question.answered(b"")
        answer = None
        late_s = self._clock.now_s() + self._answer_within_s
        while answer is None and (left_s := late_s - self._clock.now_s()) > 0:
            for frame in self._decoder.feed(channel.read(left_s)):
                if (frame.kind, frame.sequence) == (wanted.kind, wanted.sequence):
                    answer = self._learn(frame)
                if frame.kind == Kind.STOP | codec.ANSWER:
                    self._hear_stopped(frame)
        return answer

    def _hear_stopped(self, frame: Frame) -> None:
        """Note that a stop was obeyed, and with it every one before."""
        stops = tuple(self._stops)
        obeyed = [number for number in stops if number & 0xFFFF == frame.sequence]
        if obeyed:
            self._learn(frame)
            self._stops.difference_update(number for number in stops if number <= max(obeyed))

    def _learn(self, frame: Frame) -> AnswerPayload:
        """Read an answer; one that was overtaken tells nothing of the state."""
        answer = _understood(lambda: codec.HEAD.read(frame.payload))
        if answer.boot_id != self._boot_id or answer.device_us >= self._device_us:
            self._state, self._boot_id = answer.state, answer.boot_id
            self._device_us = answer.device_us
        return answer


class _Unanswered(LinkError):  # noqa: N818 - a link error by what it is, not by its name
    """A question that was never answered."""


class _Restarted(LinkError):  # noqa: N818 - the same
    """A question that was meant for a power cycle that is over."""


def _framed(message: Message[Any], number: int, boot_id: int) -> Frame:
    return Frame(
        kind=codec.kind_of(message),
        sequence=number & 0xFFFF,
        payload=codec.payload(message, boot_id),
    )


def _understood(read: Callable[[], _Read]) -> _Read:
    """Read an answer; what cannot be read is no refusal, and tells nothing of what was done."""
    try:
        return read()
    except Rejected as error:
        raise LinkError(f"an answer that cannot be read, {error}") from error
