"""Lines of SCPI over a channel: commands, questions, blocks, the error queue; waveforms, volts."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_DOWN, ROUND_UP, Decimal
from typing import TYPE_CHECKING, Final

import numpy as np

from device.core.messages import full_scale
from device.errors import LinkError, SettingError

if TYPE_CHECKING:
    from device.clock import Clock
    from device.limits import CodeArray
    from device.scpi.dialects import Dialect
    from device.wire.channels import Channel

RESPONSE_TIMEOUT_S: Final = 5.0
"""How long an instrument may take to answer."""

_TOLERANCE: Final = 1e-3
_MAX_ERRORS: Final = 32
_IDENTITY: Final = "*IDN?"
_QUERY_ERROR: Final = "-4"


def block(data: bytes) -> bytes:
    r"""Return data as a block of definite length (IEEE 488.2, 7.7.6): any byte may be in it.

    >>> block(b"a\nb")
    b'#13a\nb'
    """
    size = str(len(data))
    return f"#{len(size)}{size}".encode() + data


def matches(required: str, got: str) -> bool:
    """Return whether an answer is the required one: numbers within 0.1 %, text in any case.

    >>> matches("9.9E+37", "+9.90000000000000E+37"), matches("T1", '"T1"'), matches("50", "+51")
    (True, True, False)
    """
    try:
        number, answered = float(required), float(got)
    except ValueError:
        return required.strip('"').upper() == got.strip('"').upper()
    return abs(answered - number) <= _TOLERANCE * abs(number)


class ScpiLine:
    r"""An instrument at the other end of a channel; nothing that was sent is ever sent again.

    A question that was not answered within `response_timeout_s` is given up.

    >>> from device.clock import VirtualClock
    >>> class Echo:
    ...     def write(self, data: bytes) -> None: print(data)
    ...     def read(self, timeout_s: float) -> bytes: return b"1\n"
    ...     def close(self) -> None: pass
    >>> ScpiLine(Echo(), VirtualClock()).ask("*OPC?")
    b'*OPC?\n'
    '1'
    """

    def __init__(
        self, channel: Channel, clock: Clock, *, response_timeout_s: float = RESPONSE_TIMEOUT_S
    ) -> None:
        self._channel = channel
        self._clock = clock
        self._response_timeout_s = response_timeout_s
        self._heard = self._unsent = b""
        self._identity = ""
        self._out_of_step = self._overtook = False

    def identify(self) -> str:
        """Return the instrument's answer to ``*IDN?``, whatever was on the line before."""
        while self._channel.read(0.0):
            pass
        self._heard = b""
        self.say("")
        self._identity = self.ask(_IDENTITY)
        return self._identity

    def say(self, *commands: str) -> None:
        """Send commands, one line each, together with the next question.

        In one piece: a socket holds a second small one back until the first is acknowledged.
        """
        self._unsent += "".join(f"{command}\n" for command in commands).encode()

    def say_block(self, command: str, data: bytes) -> None:
        """Send a command that ends with a block, together with the next question."""
        self._unsent += command.encode() + block(data) + b"\n"

    def ask(self, question: str, *, after: tuple[str, ...] = (), within_s: float = 0.0) -> str:
        """Return the answer to a question that is sent behind some commands, in one piece.

        Patience comes on top of `within_s`, the time that the commands may take. Where no answer
        comes, a `LinkError`, the next question finds out first whether the line is still in step.
        """
        if self._out_of_step:
            self._fall_into_step()
        self.say(*after, question)
        self._send()
        return self._listen(question, self._response_timeout_s + within_s)

    def check_errors(self, question: str) -> None:
        """Ask for errors until the instrument says 0.

        That an answer was overtaken by a question is no error where it was given up before.
        """
        errors: list[str] = []
        for _ in range(_MAX_ERRORS):
            answer = self.ask(question)
            if matches("0", answer.split(",")[0]):
                break
            if not (self._overtook and answer.startswith(_QUERY_ERROR)):
                errors.append(answer)
        self._overtook = False
        if errors:
            raise SettingError(f"the generator reports {'; '.join(errors)}")

    def _fall_into_step(self) -> None:
        """Drop answers that came too late, up to the instrument's name."""
        self._overtook = True
        self._channel.write(f"{_IDENTITY}\n".encode())
        while self._listen(_IDENTITY, self._response_timeout_s) != self._identity:
            self._out_of_step = True

    def _send(self) -> None:
        unsent, self._unsent = self._unsent, b""
        self._channel.write(unsent)

    def _listen(self, question: str, within_s: float) -> str:
        until_s = self._clock.now_s() + within_s
        self._out_of_step = True
        while b"\n" not in self._heard:
            left_s = until_s - self._clock.now_s()
            if left_s <= 0.0:
                raise LinkError(f"no answer to {question} within {within_s:g} s")
            self._heard += self._channel.read(left_s)
        line, _, self._heard = self._heard.partition(b"\n")
        self._out_of_step = False
        return line.decode("ascii", errors="replace").strip()


BITS: Final = 16
"""Resolution of a waveform's codes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wave:
    """A waveform as a generator stores it, and the peak that it had before it was stretched.

    The peak is from 0 to 1, and 0 for silence.
    """

    data: bytes
    peak: float


def encode(codes: CodeArray, dialect: Dialect) -> Wave:
    """Return a waveform as a dialect's generator stores it, stretched to the converter's range.

    >>> from device.scpi.dialects import KEYSIGHT
    >>> wave = encode(np.array([0, 16383, -16383, 0]), KEYSIGHT)
    >>> wave.peak, np.frombuffer(wave.data, "<i2").tolist()
    (0.49998..., [0, 32767, -32767, 0, 0, 0, 0, 0])
    """
    largest = int(np.abs(codes).max(initial=0))
    stretched = np.zeros(max(codes.size, dialect.shortest_waveform), dtype="<i2")
    if largest:
        stretched[: codes.size] = np.trunc(codes * (full_scale(BITS) / largest))
    return Wave(data=stretched.tobytes(), peak=largest / full_scale(BITS))


def decimals(volts: float, digits: int, *, up: bool = False) -> str:
    """Return volts with so many digits after the point, rounded toward zero or away from it.

    >>> decimals(200 / 27.5, 7), decimals(200 / 27.5, 7, up=True)
    ('7.2727272', '7.2727273')
    """
    rounding = ROUND_UP if up else ROUND_DOWN
    return str(Decimal(volts).quantize(Decimal(1).scaleb(-digits), rounding=rounding))
