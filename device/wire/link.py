"""The host's end of the wire: messages as frames over a line that may lose or damage any of them.

What cannot be known after every question was sent again is said to be unknown.
"""

from __future__ import annotations

import contextlib
import secrets
import zlib
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from device.clock import Clock, MonotonicClock
from device.core.messages import (
    AskLimits,
    Disarm,
    Enable,
    Fire,
    LoadSlot,
    Message,
    Query,
)
from device.core.tokens import Exchange, Record, Reply
from device.driver import PROTOCOL_VERSION
from device.errors import DeviceError, LinkError, Refusal, Rejected, rejection
from device.printing import shown
from device.wire import protocol
from device.wire.channels import USUAL, Channel, Heart, LineSettings
from device.wire.frames import MAKER
from device.wire.protocol import AnswerPayload, Hello, Kind
from device.wire.requests import (
    RequestChannel,
    RestartedError,
    UnansweredError,
    read_answer,
)
from device.wire.upload import Begin, Commit, data_of, octets_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.core.states import State
    from device.driver import Identity

_MAX_LATE: Final = 12
"""A busy machine takes its time too: so often, at least, it is not busy once."""

_PLAIN_S: Final = 0.5
_OFF_REASONS: Final = (Refusal.WATCHDOG_STOP, Refusal.OVERLOAD_STOP, Refusal.LINE_STOP)
_FAREWELL_S: Final = 0.25


class FrameLink:
    """A `host.Link` that speaks the wire format over a channel.

    `open_channel` opens the channel or raises `LinkError`. A question is sent again after
    `answer_within_s`, which follows from the line's rate, and given up after the line's
    `response_timeout_s`. On the machine's clock a thread keeps up the heartbeat; on any other
    that is for the channel to do, by `beat`. Only `stop` may be called from more than one thread.

    >>> from device.clock import VirtualClock
    >>> def unplugged():
    ...     raise LinkError("no such port")
    >>> FrameLink(unplugged, VirtualClock()).hello()
    Traceback (most recent call last):
    device.errors.LinkError: no such port
    """

    def __init__(
        self,
        open_channel: Callable[[], Channel],
        clock: Clock,
        *,
        line: LineSettings = USUAL,
        answer_within_s: float | None = None,
    ) -> None:
        self._open_channel = open_channel
        self._clock = clock
        self._line = line
        self.requests = RequestChannel(
            clock,
            answer_within_s=answer_within_s or line.answer_within_s,
            response_timeout_s=line.response_timeout_s,
        )
        self._bits = self._channels = 0
        self._retries_before = 0
        self._heart: Heart | None = None

    @property
    def state(self) -> State:
        """The device's state with its last answer; SAFE after `stop`, CLOSED if not connected."""
        return self.requests.state

    @property
    def boot_id(self) -> int:
        """The power cycle that was last heard of."""
        return self.requests.boot_id

    def hello(self) -> Identity:
        """Connect and return who answered, or raise `LinkError`."""
        self._drop()
        self._retries_before = self.requests.retries
        self.requests.connect(self._open_channel())
        try:
            identity = self._greet()
            self._require_speed()
        except LinkError:
            self._drop()
            raise
        self._bits, self._channels = identity.bits, identity.channels
        if isinstance(self._clock, MonotonicClock):
            self._heart = Heart(self.beat)
        return identity

    def exchange(self, message: Message[Reply]) -> Exchange[Reply]:
        """Send a message until its answer comes; a token that none comes for is unknown."""
        last_stop = self.requests.last_stop
        self._retries_before = self.requests.retries
        exchange = self._send(message)
        if isinstance(message, Enable) and self.requests.last_stop != last_stop:
            self.stop()  # asked for meanwhile, by another thread: a stop has the last word
        return exchange

    def stop(self) -> None:
        """Send STOP: from any thread, in any state, without waiting for a lock."""
        self.requests.stop()

    def beat(self) -> None:
        """Send BEAT, or STOP again while one is not confirmed."""
        self.requests.beat()

    def hang_up(self) -> None:
        """Disconnect; a stop that is not confirmed yet is waited for, for a moment."""
        with contextlib.suppress(LinkError):
            self.requests.confirm_stops(_FAREWELL_S)
        self._drop()

    def _send(self, message: Message[Any]) -> Exchange[Any]:
        match message:
            case LoadSlot():
                return self._upload(message)
            case Fire():
                return self._fire(message)
            case Query():
                before_s = self._clock.now_s()
                try:
                    return self._done(message)
                except (UnansweredError, RestartedError):
                    return self._unknown(message.token, before_s)
            case _:
                return self._done(message)

    def _fire(self, message: Fire) -> Exchange[Record]:
        """Send FIRE; if it is not answered, DISARM and QUERY; else the outcome is unknown."""
        boot_id, before_s = self.boot_id, self._clock.now_s()
        query = Query(token=message.token)
        try:
            fired = self._done(message, boot_id)
        except RestartedError:
            return self._unknown(message.token, before_s)
        except UnansweredError:
            # The FIRE may still be on its way: only of a device that has answered the DISARM is
            # what it then says of the token its last word.
            try:
                self._done(Disarm(token=message.token), boot_id)
                fired = self._done(query, boot_id)
            except (UnansweredError, RestartedError, Rejected):
                return self._unknown(message.token, before_s)
        # A request that was repeated took long and gives a wide interval for the onset. The device
        # dates the onset by its own clock, so that a later exchange gives a narrower one.
        if self.requests.retries > self._retries_before:
            with contextlib.suppress(DeviceError):
                fired = min(fired, self._done(query, boot_id), key=_width_s)
        return replace(fired, not_before_s=before_s)

    def _upload(self, message: LoadSlot) -> Exchange[Any]:
        octets = octets_of(message, self._bits)
        self._done(Begin(slot=message.slot, samples=message.codes.shape[1]))
        boot_id = self.boot_id
        for piece in data_of(octets, self.requests.number & 0xFFFF):
            self._done(piece, boot_id)
        return self._done(Commit(slot=message.slot, crc=zlib.crc32(octets)))

    def _drop(self) -> None:
        if self._heart is not None:
            self._heart.end()
            self._heart = None
        self.requests.disconnect()

    def _greet(self) -> Identity:
        """Return who answered HELLO."""
        hello = Hello(nonce=secrets.randbits(64))
        try:
            answer = self.requests.ask(hello, 0, self._line.open_timeout_s)
        except UnansweredError as error:
            raise LinkError(f"{error}: {self._explain_silence()}") from error
        greeting = read_answer(lambda: protocol.GREETING.read(answer.body))
        if greeting.nonce != hello.nonce:
            raise LinkError("the answer is to another HELLO")
        return read_answer(lambda: protocol.read_identity(greeting, answer.boot_id))

    def _explain_silence(self) -> str:
        """Say what answers in plain text where no HELLO was answered."""
        text = self.requests.plain_answer(min(_PLAIN_S, 2 * self._line.open_timeout_s))
        if not text:
            return (
                f"no answer at device.baud = {self._line.baud} within device.open_timeout_s = "
                f"{self._line.open_timeout_s:g}; see docs/howto/no-answer.md"
            )
        if not text.startswith(f"{MAKER},"):
            return f"{shown(text)} answers, which is no device of tactstrip"
        return (
            f"it says {shown(text)}, and this program speaks protocol {PROTOCOL_VERSION}; see "
            "docs/howto/no-answer.md"
        )

    # A question that is sent again before its answer comes is the next one's delay: on a slow line
    # every answer is late, while on a bad line some are in time.
    def _require_speed(self) -> None:
        """Refuse a line on which no answer comes in time."""
        with contextlib.suppress(UnansweredError):
            for _ in range(_MAX_LATE):
                n_retries = self.requests.retries
                self._done(AskLimits())
                if self.requests.retries == n_retries:
                    return
        raise LinkError(
            f"the line is slower than device.baud = {self._line.baud}: no answer came within "
            f"{self._line.answer_within_s * 1e3:.0f} ms; see docs/howto/no-answer.md"
        )

    def _done(self, message: Message[Reply], boot_id: int | None = None) -> Exchange[Reply]:
        """Have a message done by one power cycle, the one last heard of, and return both."""
        before_s = self._clock.now_s()
        answer = self.requests.ask(message, self.boot_id if boot_id is None else boot_id)
        after_s = self._clock.now_s()
        self._require_done(protocol.kind_of(message), answer)
        record = self._read_report(message, answer)
        return self._exchange(record, answer.boot_id, before_s, after_s, answer.device_us)

    def _read_report(self, message: Message[Any], answer: AnswerPayload) -> Any:
        """Return what a question is answered with, None for most."""
        kind = protocol.kind_of(message)
        report = read_answer(lambda: protocol.read_report(kind, answer.body, self._channels))
        token, start_us = getattr(message, "token", None), getattr(report, "start_us", None)
        if getattr(report, "token", token) != token or (start_us or 0) > answer.device_us:
            raise LinkError(f"the device's answer to {kind.name} contradicts itself")
        return report

    def _require_done(self, kind: Kind, answer: AnswerPayload) -> None:
        if answer.refusal is None:
            return
        if answer.refusal is Refusal.WRONG_BOOT:
            raise RestartedError("the device restarted and forgot everything: open it again")
        if answer.refusal in _OFF_REASONS:
            raise rejection(answer.refusal)
        raise rejection(answer.refusal, f"the device, on {kind.name}")

    def _unknown(self, token: int, before_s: float) -> Exchange[Record]:
        return self._exchange(
            Record.unknown(token), self.boot_id, before_s, self._clock.now_s(), device_us=0
        )

    def _exchange(
        self, record: Reply, boot_id: int, before_s: float, after_s: float, device_us: int
    ) -> Exchange[Reply]:
        return Exchange(
            record=record,
            boot_id=boot_id,
            host_before_s=before_s,
            host_after_s=after_s,
            device_us=device_us,
            retries=self.requests.retries - self._retries_before,
        )


def _width_s(exchange: Exchange[Record]) -> float:
    return exchange.host_after_s - exchange.host_before_s
