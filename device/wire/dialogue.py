"""Questions and answers over a line that may lose or damage any of them; stops and beats between.

Every question is sent again until its answer comes; the device does each only once. Where none
comes, or too late, a line says what the operator can do about it.
"""

from __future__ import annotations

import contextlib
import math
import secrets
from itertools import count
from threading import Lock
from typing import TYPE_CHECKING, Any, Final, TypeVar

from device.clock import Clock, ClockSync, Sample
from device.core.messages import Beat, Enable, Message, Stop
from device.core.states import State
from device.errors import LinkError, Refusal, Rejected, rejection
from device.wire import codec
from device.wire.codec import AnswerPayload, Hello, Kind
from device.wire.frames import MAKER, MINOR, QUESTION, VERSION, Decoder, Frame, encode

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.wire.channels import Channel

_STOPS: Final = 3
"""STOP is sent so often at once: a frame that is under way may spoil the first."""

_BEATS: Final = 2
"""BEAT is sent so often at once, for the same reason."""

_STALE_AT_MOST: Final = 8

BITS_PER_BYTE: Final = 10
"""On a serial line: a start bit, eight of data, a stop bit."""

LONGEST_ROUND: Final = 104
"""Bytes of HELLO and its answer: the longest that a line carries for one question."""

_LONG_ROUND: Final = 103
"""Bytes of LIMITS and its answer."""

_SHORT_ROUND: Final = 48
"""Bytes of PING and its answer."""

_LEAST_WORDS: Final = 4
"""Fewer characters may be noise."""

_RATES: Final = (
    *(1200, 2400, 4800, 9600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600),
    *(1_000_000, 2_000_000, 3_000_000, 4_000_000),
)

_Read = TypeVar("_Read")


class UnansweredError(LinkError):
    """A question that was never answered."""


class RestartedError(LinkError):
    """A question that was meant for a power cycle that is over."""


def framed(message: Message[Any], number: int, boot_id: int) -> Frame:
    """Return the frame of a message for one power cycle."""
    return Frame(
        kind=codec.kind_of(message),
        sequence=number & 0xFFFF,
        payload=codec.payload(message, boot_id),
    )


def understood(read: Callable[[], _Read]) -> _Read:
    """Read an answer; what cannot be read is no refusal, and tells nothing of what was done."""
    try:
        return read()
    except Rejected as error:
        raise LinkError(f"an answer that cannot be read, {error}") from error


class Dialogue:
    """A host's questions to the device on a channel, once there is one.

    Only `stop` may be called from more than one thread.
    """

    def __init__(self, clock: Clock, *, answer_within_s: float, response_timeout_s: float) -> None:
        self._clock = clock
        self._answer_within_s = answer_within_s
        self._response_timeout_s = response_timeout_s
        self._channel: Channel | None = None
        self._writing = Lock()
        self._state = State.CLOSED
        self._numbers = count(secrets.randbits(16))
        self._asked = 0
        self._retries = 0
        self._stops: set[int] = set()
        self._last_stop = -1
        self._boot_id = 0
        self._begin_anew()

    def _begin_anew(self) -> None:
        """Forget what was half read, and the device's clock."""
        self._decoder = Decoder()
        self._device_us = 0
        self._fastest_s = math.inf
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
            beat = _BEATS * encode(framed(Beat(), 0, self._boot_id))
        with self._writing:
            channel.write(beat)

    def _stop_frame(self, number: int) -> bytes:
        return encode(self._stop_question(number))

    def _stop_question(self, number: int) -> Frame:
        return framed(Stop(), number, self._boot_id)

    def _ask(
        self, message: Message[Any], boot_id: int, response_timeout_s: float | None = None
    ) -> AnswerPayload:
        """Send a question until its answer comes; also a refusal tells state and power cycle.

        A stop from another thread may overtake a question, which the device does not do then. It
        is asked anew, except to switch on what was just stopped.
        """
        retries = 0
        for _ in range(_STALE_AT_MOST):
            if not isinstance(message, Hello):
                self._confirm_stops(self._response_timeout_s)
            self._asked = next(self._numbers)
            question = framed(message, self._asked, boot_id)
            answer = self._insist(question, response_timeout_s or self._response_timeout_s)
            self._retries = retries = retries + self._retries
            if answer.refusal is not Refusal.STALE:
                return answer
            if isinstance(message, Enable):
                raise rejection(Refusal.SAFE_STATE, "a stop came meanwhile")
        raise LinkError("the device takes every question for an old one: open it again")

    def _confirm_stops(self, response_timeout_s: float) -> None:
        while stops := tuple(self._stops):
            self._insist(self._stop_question(max(stops)), response_timeout_s)

    def _insist(self, question: Frame, response_timeout_s: float) -> AnswerPayload:
        began_s = self._clock.now_s()
        self._retries = -1
        while self._clock.now_s() < began_s + response_timeout_s:
            self._retries += 1
            self._write(encode(question))
            answer = self._listen(question, self._answer_within_s)
            if answer is not None:
                if self._retries == 0:
                    self._fastest_s = min(self._fastest_s, self._clock.now_s() - began_s)
                if question.kind != Kind.STOP:
                    self._learn_clock(answer, began_s)
                return answer
        raise self._unanswered(Kind(question.kind), response_timeout_s)

    def _unanswered(self, kind: Kind, response_timeout_s: float) -> UnansweredError:
        """Return the error of a question that was asked for so long, with what may be behind it."""
        told = f"the device did not answer {kind.name} for {response_timeout_s:g} s"
        never_in_time = self._answer_within_s < self._fastest_s < math.inf
        return UnansweredError(f"{told}: {self._why_late()}" if never_in_time else told)

    def _why_late(self) -> str:
        """Tell of a line on which no answer has come in time yet."""
        return f"no answer came within {self._answer_within_s * 1e3:.0f} ms"

    @property
    def _open(self) -> Channel:
        if self._channel is None:
            raise LinkError("the device is not connected")
        return self._channel

    def _write(self, data: bytes) -> None:
        with self._writing:
            self._open.write(data)

    def _learn_clock(self, answer: AnswerPayload, began_s: float) -> None:
        after_s, device_s = self._clock.now_s(), answer.device_us / 1e6
        self.clock_sync.hear(Sample(before_s=began_s, after_s=after_s, device_s=device_s))

    def _listen(self, question: Frame, within_s: float) -> AnswerPayload | None:
        """Return the answer to a question, or None when it is late."""
        wanted = question.answered(b"")
        answer = None
        late_s = self._clock.now_s() + within_s
        while answer is None and (left_s := late_s - self._clock.now_s()) > 0:
            for frame in self._heard(left_s):
                if (frame.kind, frame.sequence) == (wanted.kind, wanted.sequence):
                    answer = self._learn(frame)
        return answer

    def _heard(self, within_s: float) -> list[Frame]:
        """Return the frames that arrive next; what stops they answer is noted."""
        frames = self._decoder.feed(self._open.read(within_s))
        for frame in frames:
            if frame.kind == Kind.STOP | codec.ANSWER:
                self._hear_stopped(frame)
        return frames

    def _hear_stopped(self, frame: Frame) -> None:
        """Note that a stop was obeyed, and with it every one before."""
        stops = tuple(self._stops)
        obeyed = [number for number in stops if number & 0xFFFF == frame.sequence]
        if obeyed:
            self._learn(frame)
            self._stops.difference_update(number for number in stops if number <= max(obeyed))

    def _learn(self, frame: Frame) -> AnswerPayload:
        """Read an answer; one that was overtaken tells nothing of the state."""
        answer = understood(lambda: codec.HEAD.read(frame.payload))
        if answer.boot_id != self._boot_id or answer.device_us >= self._device_us:
            self._state, self._boot_id = answer.state, answer.boot_id
            self._device_us = answer.device_us
        return answer


def plain_answer(channel: Channel, clock: Clock, within_s: float) -> str:
    """Ask in plain text who is there and return what is said, "" where nothing can be read."""
    channel.write(b"\0" + QUESTION + b"\n")
    until_s, said = clock.now_s() + within_s, b""
    while (left_s := until_s - clock.now_s()) > 0 and not _is_said(said):
        said += channel.read(left_s)
    lines = (line.rsplit(b"\0", 1)[-1].strip() for line in said.split(b"\n"))
    words = [line.decode() for line in lines if line.isascii() and len(line) >= _LEAST_WORDS]
    words = [line for line in words if line.isprintable()]
    return next((line for line in words if line.startswith(MAKER)), "".join(words[:1]))


def _is_said(said: bytes) -> bool:
    return said.endswith(b"\n") and MAKER.encode() in said


def speaks_our_version(answer: str) -> bool:
    """Tell whether it is a device of ours and of our protocol that said this in plain text.

    >>> speaks_our_version("tactstrip,lab,7,protocol 2.7")
    True
    """
    version = answer.rpartition(",protocol ")[2]
    return answer.startswith(f"{MAKER},") and version.partition(".")[0] == str(VERSION)


def why_silent(answer: str, *, open_timeout_s: float, baud: int, greets: bool = False) -> str:
    """Tell what a device that answered no HELLO lacks, by what it says in plain text.

    `greets` tells that it answers HELLO by now.

    >>> why_silent("tactstrip,lab,7,protocol 1.0", open_timeout_s=2.0, baud=115_200)
    'it speaks protocol 1.0 and this program 2.0; put firmware of protocol 2 on it'
    >>> why_silent("tactstrip,lab,7,protocol 3.7", open_timeout_s=2.0, baud=115_200)
    'it speaks protocol 3.7 and this program 2.0; use a newer tactstrip, which speaks 3, or put
    firmware of protocol 2 on it'
    """
    maker, _, rest = answer.partition(",")
    if maker != MAKER:
        other = f"{answer[:80]!r} answers, which is no device of tactstrip" if answer else ""
        return other or (
            "is it switched on? Where it starts anew whenever its port is opened, let "
            f"device.open_timeout_s be more than {open_timeout_s:g}, or device.dtr be false; "
            f"where its rate is another than {baud}, give device.baud"
        )
    version = rest.rpartition("protocol ")[2]
    if greets:
        return (
            f"it answers now, so that it took longer to start; let device.open_timeout_s be more "
            f"than {open_timeout_s:g}"
        )
    if speaks_our_version(answer):
        return (
            f"it says that it speaks protocol {version}, and answers text but no frames: its "
            "firmware does not speak it, or the line does not carry every byte (it needs 8 bits, "
            "no parity and no flow control)"
        )
    major = version.partition(".")[0]
    newer = major.isdecimal() and int(major) > VERSION
    host = f"use a newer tactstrip, which speaks {major}, or " if newer else ""
    return (
        f"it speaks protocol {version} and this program {VERSION}.{MINOR}; {host}put firmware of "
        f"protocol {VERSION} on it"
    )


def too_slow(
    took_s: float, within_s: float, baud: int, *, short_s: float | None = None, lossy: bool = False
) -> str:
    """Tell why a line is too slow for `baud`, by how long a LIMITS and a PING take on it.

    The difference of the two is that of their bytes, and tells rate from delay. Where no PING is
    known, all is taken for the rate's.

    >>> too_slow(0.108, 0.025, 115_200)
    'the line is too slow: a question and its answer took 108 ms, at device.baud = 115200 25 ms are
    allowed; that is a line of about 9600 baud: give device.baud = 9600, or let both ends have 57600
    or more'
    >>> too_slow(0.026, 0.025, 115_200, short_s=0.021)
    'the line is too late: a question and its answer took 26 ms, at device.baud = 115200 25 ms are
    allowed; 17 ms of it are a delay that no other rate mends: let a USB adapter pass bytes on at
    once (its latency timer 1 ms, on Linux setserial PORT low_latency), or let no network be in
    between'
    """
    byte_s = took_s / _LONG_ROUND
    if short_s is not None:
        byte_s = min(byte_s, max(0.0, took_s - short_s) / (_LONG_ROUND - _SHORT_ROUND))
    carried_s = _LONG_ROUND * byte_s
    took = (
        f"a question and its answer took {took_s * 1e3:.0f} ms, at device.baud = {baud} "
        f"{within_s * 1e3:.0f} ms are allowed"
    )
    loses = " and loses bytes" if lossy else ""
    if carried_s < 0.9 * within_s:
        return (
            f"the line is too late{loses}: {took}; {(took_s - carried_s) * 1e3:.0f} ms of it are a "
            "delay that no other rate mends: let a USB adapter pass bytes on at once (its latency "
            "timer 1 ms, on Linux setserial PORT low_latency), or let no network be in between"
        )
    is_about = min(_RATES, key=lambda rate: abs(math.log(rate * byte_s / BITS_PER_BYTE)))
    enough = next(
        (rate for rate in _RATES if LONGEST_ROUND * BITS_PER_BYTE / rate < 0.8 * within_s),
        _RATES[-1],
    )
    return (
        f"the line is too slow{loses}: {took}; that is a line of about {is_about} baud: give "
        f"device.baud = {is_about}, or let both ends have {enough} or more"
    )
