"""The host's end of the wire: messages as frames over a line that may lose or damage any of them.

Every question is sent again until its answer comes; the device does each only once. What cannot be
known after that is said to be unknown.
"""

from __future__ import annotations

import contextlib
import math
import secrets
import zlib
from itertools import count
from typing import TYPE_CHECKING, Any, Final

from device.clock import Clock, MonotonicClock, Sample, resolution_s
from device.core.messages import (
    AskLimits,
    Disarm,
    Enable,
    Fire,
    Levels,
    LoadSlot,
    Message,
    Ping,
    Query,
)
from device.core.states import State
from device.core.tokens import Exchange, Fate, Record, Reply
from device.errors import LinkError, Refusal, Rejected, rejection
from device.wire import codec
from device.wire.channels import USUAL, Channel, Heart, LineSettings
from device.wire.codec import AnswerPayload, Hello, Kind
from device.wire.dialogue import (
    Dialogue,
    RestartedError,
    UnansweredError,
    framed,
    plain_answer,
    speaks_our_version,
    too_slow,
    understood,
    why_silent,
)
from device.wire.frames import Decoder, encode
from device.wire.upload import Begin, Commit, Window, data_of, octets_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.driver import Identity

_AHEAD_S: Final = 0.1
"""So much of the line's time may DATA take that are under way."""

_LONGEST_DATA_FRAME: Final = 57
_TRIES: Final = 12
"""A busy machine takes its time too: so often, at least, it is not busy once."""

_LOST_TRIES: Final = 6
_TRY_FOR: Final = 10
"""In times that an answer may take."""

_QUIET_S: Final = 1.0
"""An answer takes less on any line."""

_DRAIN_S: Final = 30.0
"""A line of 1200 baud needs 25 s."""

_PLAIN_S: Final = 1.0
_PLAIN_TRIES: Final = 4
_FAREWELL_S: Final = 0.25


class FrameLink(Dialogue):
    """A `host.Link` that speaks the wire format over a channel.

    `connect` opens the channel or raises `LinkError`. A question is sent again after
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
        connect: Callable[[], Channel],
        clock: Clock,
        *,
        line: LineSettings = USUAL,
        answer_within_s: float | None = None,
    ) -> None:
        super().__init__(
            clock,
            answer_within_s=answer_within_s or line.answer_within_s,
            response_timeout_s=line.response_timeout_s,
        )
        self._connect = connect
        self._line = line
        self._data_numbers = count(secrets.randbits(16))
        self._window = 1
        self._bits = 16
        self._ceiling_vpp = 0.0
        self._levels_vpp = 0.0, 0.0
        self._heart: Heart | None = None
        self._short_s: float | None = None
        self._resolution_s = resolution_s(clock)

    def hello(self) -> Identity:
        """Connect and return who answered, or raise `LinkError`."""
        self._drop()
        self._channel = self._connect()
        try:
            identity = self._greet()
            self._window = self._fitting(self._done(AskLimits()).record.data_window)
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
            return self._upload(message)
        if isinstance(message, Fire):
            return self._fire(message)
        if isinstance(message, Query):
            before_s = self._clock.now_s()
            try:
                return self._done(message)
            except (UnansweredError, RestartedError):
                return self._unknown(message.token, before_s)
        return self._done(message)

    def _fire(self, message: Fire) -> Exchange[Record]:
        """Send FIRE; without an answer DISARM and QUERY, and without that say UNKNOWN."""
        boot_id, before_s = self._boot_id, self._clock.now_s()
        try:
            return self._done(message, boot_id, before_s)
        except RestartedError:
            return self._unknown(message.token, before_s)
        except UnansweredError:
            retries = self._retries
        # The FIRE may still be on its way: only of a device that has answered the DISARM is what
        # it then says of the token its last word.
        try:
            self._done(Disarm(token=message.token), boot_id)
            return self._done(Query(token=message.token), boot_id, before_s, retries=retries)
        except (UnansweredError, RestartedError, Rejected):
            return self._unknown(message.token, before_s, retries=retries)

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
        """Return who answered HELLO."""
        self._begin_anew()
        hello = Hello(nonce=secrets.randbits(64))
        began_s = self._clock.now_s()
        try:
            answer = self._ask(hello, 0, self._line.open_timeout_s)
        except UnansweredError as silence:
            raise LinkError(f"{silence}: {self._why_silent()}") from silence
        took_s = self._clock.now_s() - began_s
        if took_s > self._line.answer_within_s:
            self._drain(took_s)
            self._require_speed(answer.boot_id, took_s)
        greeting = understood(lambda: codec.GREETING.read(answer.body))
        if greeting.nonce != hello.nonce:
            raise LinkError("the answer is to another HELLO")
        return understood(lambda: greeting.identity(answer.boot_id))

    def _why_silent(self) -> str:
        line = self._line
        each_s, answer = min(_PLAIN_S, 2 * line.open_timeout_s) / _PLAIN_TRIES, ""
        for _ in range(_PLAIN_TRIES):
            answer = answer or plain_answer(self._open, self._clock, each_s)
        greets = False
        if speaks_our_version(answer):
            with contextlib.suppress(UnansweredError):
                self._ask(Hello(nonce=secrets.randbits(64)), 0, _PLAIN_TRIES * each_s)
                greets = True
        return why_silent(answer, open_timeout_s=line.open_timeout_s, baud=line.baud, greets=greets)

    def _drain(self, took_s: float) -> None:
        """Wait until the answers to a HELLO that was sent again are all off a slow line."""
        quiet_s = min(took_s, _QUIET_S)
        until_s = self._clock.now_s() + min(_DRAIN_S, (self._retries + 1) * quiet_s)
        while self._clock.now_s() < until_s and self._open.read(quiet_s):
            pass
        self._decoder = Decoder()

    def _require_speed(self, boot_id: int, hello_s: float) -> None:
        """Refuse a line on which no answer comes in time, however often it is tried.

        Each try is a question of its own, sent once: so that what is late can be told from what
        was lost, and from the answers to what was sent again. A line that loses much is not
        refused; what was seen of it is told where it fails later.
        """
        within_s = self._line.answer_within_s
        wait_s = min(self._response_timeout_s, max(_TRY_FOR * within_s, 2 * hello_s))
        took_s = self._tried(AskLimits(), boot_id, wait_s)
        self._fastest_s = min(took_s, default=math.inf)
        if self._fastest_s <= within_s or not took_s:
            return
        short_s = self._tried(Ping(), boot_id, wait_s)
        self._short_s = min(short_s, default=None)
        if len(took_s) == _TRIES:
            raise LinkError(too_slow(min(took_s), within_s, self._line.baud, short_s=self._short_s))

    def _tried(self, message: Message[Any], boot_id: int, wait_s: float) -> list[float]:
        """Return how long the answers to a question took; of LIMITS one in time is enough."""
        took_s: list[float] = []
        n_lost, is_enough = 0, isinstance(message, AskLimits)
        while len(took_s) < _TRIES and n_lost < _LOST_TRIES:
            question = framed(message, next(self._numbers), boot_id)
            began_s = self._clock.now_s()
            self._write(encode(question))
            if self._listen(question, wait_s) is None:
                n_lost += 1
                continue
            took_s.append(self._clock.now_s() - began_s)
            if is_enough and took_s[-1] <= self._line.answer_within_s:
                break
        return took_s

    def _why_late(self) -> str:
        line, took_s = self._line, self._fastest_s
        return too_slow(took_s, line.answer_within_s, line.baud, short_s=self._short_s, lossy=True)

    def _fitting(self, window: int) -> int:
        """Return how many DATA may be under way, lest a beat or a stop has to wait for them."""
        return max(1, min(window, int(_AHEAD_S * self._line.baud / 10 / _LONGEST_DATA_FRAME)))

    def _upload(self, message: LoadSlot) -> Exchange[Any]:
        octets = octets_of(message, self._bits)
        self._done(Begin(slot=message.slot, samples=int(message.left.size)))
        upload, boot_id = self._asked & 0xFFFF, self._boot_id
        numbered = ((next(self._data_numbers) & 0xFFFF, piece) for piece in data_of(octets, upload))
        pieces = ((number, encode(framed(one, number, boot_id))) for number, one in numbered)
        self._send_all(Window(pieces, size=self._window, late_s=self._answer_within_s))
        return self._done(Commit(slot=message.slot, crc=zlib.crc32(octets)))

    def _send_all(self, window: Window) -> None:
        """Send DATA until each is answered."""
        heard_s = self._clock.now_s()
        while (due := window.due(self._clock.now_s())) or not window.is_over:
            self._confirm_stops(self._response_timeout_s)
            if due:
                self._write(b"".join(due))
            late_s = window.late_at_s - self._clock.now_s()
            for frame in self._heard(max(late_s, 0.0)):
                is_data = frame.kind == Kind.DATA | codec.ANSWER
                if is_data and window.answered(frame.sequence, self._clock.now_s()):
                    heard_s = self._clock.now_s()
                    self._require_done(Kind.DATA, self._learn(frame))
            if self._clock.now_s() > heard_s + self._response_timeout_s:
                raise self._unanswered(Kind.DATA, self._response_timeout_s)

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
        self._require_done(codec.kind_of(message), answer, message)
        record = self._record(message, answer)
        if isinstance(record, Record):
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
        """Return what a question is answered with, None for most."""
        kind = codec.kind_of(message)
        record = understood(lambda: codec.understood(kind, answer.body))
        token, start_us = getattr(message, "token", None), getattr(record, "start_us", None)
        if getattr(record, "token", token) != token or (start_us or 0) > answer.device_us:
            raise LinkError(f"the device's answer to {kind.name} contradicts itself")
        return record

    def _require_done(
        self, kind: Kind, answer: AnswerPayload, message: Message[Any] | None = None
    ) -> None:
        if answer.refusal is None:
            return
        if answer.refusal is Refusal.WRONG_BOOT:
            raise RestartedError("the device restarted and forgot everything: open it again")
        detail = f"the device, on {kind.name}"
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
