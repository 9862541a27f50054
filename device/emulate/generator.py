"""A generator without hardware: the Keysight dialect over a line, and a truth file.

It answers what `device.scpi.dialects` says to Keysight's 33500 and 33600 Series, keeps the settings
that matter, has their error queue, and writes down what really came out. Nothing stops it when its
host is gone: neither would the real one.
"""

from __future__ import annotations

import time
from collections import deque
from typing import IO, TYPE_CHECKING, Final

import numpy as np

from device.clock import MonotonicClock
from device.core.output import Emission
from device.emulate.emulator import TICK_S, Truth, burst_entries
from device.emulate.faults import FaultyLine
from device.emulate.instrument import (
    BAD_BLOCK,
    BAD_VALUE,
    IGNORED,
    NO_HEADER,
    OVERFLOW,
    ChannelState,
    Reader,
    ScpiError,
    Unit,
    header_pattern,
)
from device.scpi.dialects import EMULATED, INFINITE_OHM, KEYSIGHT

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.emulate.faults import Faults
    from device.emulate.lines import Line


IDENTITY: Final = f"Keysight Technologies,33512B,{EMULATED},tactstrip"
"""Its answer to ``*IDN?``."""

_QUEUE: Final = 20


def _number(text: str) -> float:
    try:
        return float(INFINITE_OHM if text.upper() in {"INF", "INFINITY"} else text)
    except ValueError:
        raise ScpiError(BAD_VALUE) from None


def _switch(text: str) -> bool:
    if text.upper() not in {"ON", "OFF", "1", "0"}:
        raise ScpiError(BAD_VALUE)
    return text.upper() in {"ON", "1"}


def _word(text: str) -> str:
    if not text:
        raise ScpiError(BAD_VALUE)
    return text.strip('"').upper()


def _shown(value: object) -> str:
    """Return a setting as an answer."""
    if isinstance(value, bool):
        return str(int(value))
    return f"{value:+.14E}" if isinstance(value, float) else str(value)


_SETTINGS: Final = tuple(
    (header_pattern(header), attribute, read)
    for header, attribute, read in (
        ("OUTPut#:LOAD", "load", _number),
        ("OUTPut#[:STATe]", "on", _switch),
        ("[SOURce#:]VOLTage[:LEVel][:IMMediate][:AMPLitude]", "volts", _number),
        ("[SOURce#:]VOLTage:OFFSet", "offset", _number),
        ("[SOURce#:]VOLTage:LIMit:HIGH", "high", _number),
        ("[SOURce#:]VOLTage:LIMit:LOW", "low", _number),
        ("[SOURce#:]VOLTage:LIMit:STATe", "limited", _switch),
        ("[SOURce#:]VOLTage:RANGe:AUTO", "autorange", _switch),
        ("[SOURce#:]VOLTage:UNIT", "unit", _word),
        ("[SOURce#:]FUNCtion", "function", _word),
        ("[SOURce#:]FUNCtion:ARBitrary", "arb", _word),
        ("[SOURce#:]FUNCtion:ARBitrary:SRATe", "rate", _number),
        ("[SOURce#:]FUNCtion:ARBitrary:FILTer", "filter", _word),
        ("[SOURce#:]BURSt:MODE", "burst_mode", _word),
        ("[SOURce#:]BURSt:NCYCles", "cycles", _number),
        ("[SOURce#:]BURSt:PHASe", "phase", _number),
        ("[SOURce#:]BURSt:STATe", "burst", _switch),
        ("TRIGger#:SOURce", "trigger", _word),
    )
)
"""Headers, the attribute of `ChannelState` behind each, and how its argument is read."""
_STORE: Final = header_pattern("[SOURce#:]DATA:ARBitrary:DAC")
_CLEAR: Final = header_pattern("[SOURce#:]DATA:VOLatile:CLEar")
_ORDER: Final = header_pattern("FORMat:BORDer")
_ERROR: Final = header_pattern("SYSTem:ERRor[:NEXT]")


class EmulatedGenerator:
    r"""The generator itself, without a line: bytes in, bytes out, at times that it is given.

    `sink` gets each `Emission`; its token is the number of the trigger, counted from 1.

    >>> generator = EmulatedGenerator(print)
    >>> generator.receive(0, b"OUTP1:LOAD INF;:OUTP1:LOAD?\n")
    b'+9.90000000000000E+37\n'
    >>> generator.receive(0, b"OUTP1:LAOD 50\nSYST:ERR?\nSYST:ERR?\n").decode().split()
    ['-113,"Undefined', 'header"', '+0,"No', 'error"']
    """

    def __init__(self, sink: Callable[[Emission], None]) -> None:
        self._sink = sink
        self._reader = Reader()
        self._errors: deque[str] = deque()
        self._reset()
        self._triggers = 0
        self._playing: Emission | None = None
        self._completes: int | None = None

    @property
    def outputs_on(self) -> tuple[bool, ...]:
        """Which outputs are on."""
        return tuple(output.on for output in self._outputs)

    def receive(self, now_us: int, data: bytes) -> bytes:
        """Take bytes at a time in microseconds and return what is answered by then."""
        answers = [self.due(now_us)]
        for unit in self._reader.feed(data):
            try:
                answers.append(self._do(now_us, unit))
            except ScpiError as error:
                self._fail(str(error))
        return b"".join([*answers, self.due(now_us)])

    def hang_up(self) -> None:
        """Lose the host: half a line and answers that are due go with it, outputs stay on."""
        self._reader = Reader()
        self._completes = None

    def due(self, now_us: int) -> bytes:
        """Return what is answered because a burst is over by now."""
        if self._playing is not None and now_us >= self._ends_us(self._playing):
            self._finish(self._playing)
        if self._playing is None and self._completes is not None:
            count, self._completes = self._completes, None
            return count * b"1\n"
        return b""

    def _reset(self) -> None:
        self._outputs = tuple(ChannelState() for _ in range(KEYSIGHT.channels))
        self._byte_order = "NORM"

    @staticmethod
    def _ends_us(burst: Emission) -> int:
        return burst.start_us + burst.duration_us

    def _finish(self, burst: Emission) -> None:
        self._playing = None
        self._sink(burst)

    def _fail(self, error: str) -> None:
        if len(self._errors) < _QUEUE:
            self._errors.append(error)
        else:
            self._errors[-1] = OVERFLOW

    def _do(self, now_us: int, unit: Unit) -> bytes:
        header = unit.header.upper()
        if header == "*OPC?":
            self._completes = (self._completes or 0) + 1
            return b""
        if header == "*IDN?":
            return f"{IDENTITY}\n".encode()
        if header.endswith("?"):
            return f"{self._answer(header[:-1])}\n".encode()
        self._obey(now_us, header, unit)
        return b""

    def _answer(self, header: str) -> str:
        if _ERROR.fullmatch(header):
            return self._errors.popleft() if self._errors else '+0,"No error"'
        output, attribute, _ = self._find(header)
        shown = _shown(getattr(output, attribute))
        return f'"{shown}"' if attribute == "arb" else shown

    def _obey(self, now_us: int, header: str, unit: Unit) -> None:
        if header == "*TRG":
            self._play(now_us)
        elif header in {"ABOR", "ABORT"}:
            self._cut(now_us)
        elif header == "*RST":
            self._cut(now_us)
            self._reset()
        elif header == "*CLS":
            self._errors.clear()
        elif _ORDER.fullmatch(header):
            self._byte_order = _word(unit.argument)[:4]
        elif match := _CLEAR.fullmatch(header):
            self._output(match.group(1)).clear()
        elif match := _STORE.fullmatch(header):
            if unit.data is None:
                raise ScpiError(BAD_BLOCK)
            name = unit.argument.rstrip(", ").upper()
            self._output(match.group(1)).store(name, unit.data)
        else:
            self._set(now_us, header, unit.argument)

    def _set(self, now_us: int, header: str, argument: str) -> None:
        output, attribute, read = self._find(header)
        value = read(argument)
        if attribute == "on" and not value:
            self._cut(now_us)
        special = getattr(output, f"set_{attribute}", None)
        if special is None:
            setattr(output, attribute, value)
        else:
            special(value)

    def _find(self, header: str) -> tuple[ChannelState, str, Callable[[str], object]]:
        for pattern, attribute, read in _SETTINGS:
            if match := pattern.fullmatch(header):
                return self._output(match.group(1)), attribute, read
        raise ScpiError(NO_HEADER)

    def _output(self, channel: str | None) -> ChannelState:
        return self._outputs[int(channel or 1) - 1]

    def _play(self, now_us: int) -> None:
        """Play one cycle on every channel that waits for the bus."""
        waiting = [output.waits() for output in self._outputs]
        if self._playing is not None or not any(waiting):
            raise ScpiError(IGNORED)
        self._triggers += 1
        rows = [
            output.play(byte_order=self._byte_order) if waits else np.zeros(0)
            for output, waits in zip(self._outputs, waiting, strict=True)
        ]
        longest = max(row.size for row in rows)
        self._playing = Emission(
            token=self._triggers,
            start_us=now_us,
            volts=np.stack([np.pad(row, (0, longest - row.size)) for row in rows]),
            levels_vpp=tuple(
                output.volts * output.doubling if row.any() else 0.0
                for output, row in zip(self._outputs, rows, strict=True)
            ),
            sample_rate_hz=self._outputs[0].rate,
        )

    def _cut(self, now_us: int) -> None:
        if self._playing is not None:
            self._finish(self._playing.cut(now_us))


class GeneratorEmulator:
    """The emulated generator between a line and a truth file.

    A generator knows no tokens: a burst has a ``number``, and ``wall_s``, the calendar's
    clock at its onset. In a journal of the same machine it belongs to the one attempt that was
    armed before and ended after.

    The truth file has volts at the actuators, behind an amplifier of this gain.
    """

    def __init__(
        self, line: Line, truth: IO[str], *, amplifier_gain: float, faults: Faults
    ) -> None:
        self._line = FaultyLine(line, faults, MonotonicClock(), on_reset=self._restart)
        self._truth = Truth(truth)
        self._gain = amplifier_gain
        self._began_s = time.monotonic()
        self._generator = EmulatedGenerator(self._note_burst)
        self._was = self._generator.outputs_on

    def run(self) -> None:
        """Serve until an exception, such as KeyboardInterrupt."""
        try:
            while True:
                self.turn()
        finally:
            self._line.close()

    def turn(self) -> None:
        """Do what is due, for one tick."""
        data = self._line.read(TICK_S)
        if data is None:
            self._generator.hang_up()
        answers = self._generator.receive(self._now_us(), data or b"")
        if answers:
            self._line.write(answers)
        if self._generator.outputs_on != self._was:
            self._was = self._generator.outputs_on
            event = "on" if any(self._was) else "off"
            self._truth.note(self._now_us() / 1e6, event, cause="host")

    def _restart(self) -> None:
        """Switch the generator off and on: it forgets everything, its outputs are off."""
        self._generator.hang_up()
        self._generator.receive(self._now_us(), b"*RST\n*CLS\n")
        self._line.drop()

    def _now_us(self) -> int:
        return int((time.monotonic() - self._began_s) * 1e6)

    def _note_burst(self, burst: Emission) -> None:
        ago_s = (self._now_us() - burst.start_us) / 1e6
        self._truth.note(
            burst.start_us / 1e6,
            "burst",
            token=None,
            number=burst.token,
            wall_s=round(time.time() - ago_s, 6),
            cut=burst.cut_us is not None,
            **burst_entries(burst, gain=self._gain),
        )
