"""How an instrument reads SCPI, blocks of any byte included, and what one of its channels keeps."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from device.driver import FloatArray

_FULL_SCALE: Final = 32767
_MIN_SAMPLES: Final = 8
_MEMORY: Final = 1_000_000
_MAX_V: Final = 10.0
_MIN_VPP: Final = 0.001
_MATCHED_OHM: Final = 50.0


class ScpiError(Exception):
    """An entry for the error queue."""


NO_HEADER: Final = '-113,"Undefined header"'
OUT_OF_RANGE: Final = '-222,"Data out of range"'
CONFLICT: Final = '-221,"Settings conflict"'
BAD_VALUE: Final = '-224,"Illegal parameter value"'
BAD_BLOCK: Final = '-161,"Invalid block data"'
IGNORED: Final = '-211,"Trigger ignored"'
OVERFLOW: Final = '-350,"Error queue overflow"'
NO_ARB: Final = '+785,"Specified arb waveform does not exist"'
ARB_EXISTS: Final = '+786,"Specified arb waveform already exists"'


@dataclass(slots=True, kw_only=True)
class ChannelState:
    """The settings of one channel, as they are after ``*RST``.

    Volts are those on the display. Unless `load` is infinite, an open circuit gets twice as many.
    """

    load: float = _MATCHED_OHM
    volts: float = 0.1
    offset: float = 0.0
    high: float = _MAX_V / 2
    low: float = -_MAX_V / 2
    limited: bool = False
    autorange: bool = True
    function: str = "SIN"
    arb: str = "EXP_RISE"
    rate: float = 40e3
    filter: str = "NORM"
    burst: bool = False
    burst_mode: str = "TRIG"
    cycles: float = 1.0
    phase: float = 0.0
    trigger: str = "IMM"
    unit: str = "VPP"
    on: bool = False
    memory: dict[str, bytes] = field(default_factory=dict)

    @property
    def doubling(self) -> float:
        """Volts into an open circuit per volt on the display."""
        return 1.0 if self.load > 1e9 else 2.0  # noqa: PLR2004 - any infinite load

    def set_load(self, ohm: float) -> None:
        """Set the load that is connected: the display changes, the terminals do not."""
        if self.limited:
            raise ScpiError(CONFLICT)
        before = self.doubling
        self.load = ohm
        for name in ("volts", "offset", "high", "low"):
            setattr(self, name, getattr(self, name) * before / self.doubling)

    def set_volts(self, volts: float) -> None:
        """Set the amplitude, clipped to what limits and hardware allow."""
        max_vpp = 2 * _MAX_V / self.doubling
        if self.limited:
            max_vpp = min(max_vpp, 2 * (self.high - self.offset), 2 * (self.offset - self.low))
        self.volts = min(max(volts, 2 * _MIN_VPP / self.doubling), max_vpp)
        if self.volts != volts:
            raise ScpiError(OUT_OF_RANGE)

    def set_limited(self, limited: bool) -> None:  # noqa: FBT001 - called through the table
        """Switch the voltage limits; refused while the amplitude is beyond them."""
        span = self.offset - self.volts / 2, self.offset + self.volts / 2
        if limited and (span[0] < self.low or span[1] > self.high):
            raise ScpiError(CONFLICT)
        self.limited = limited

    def set_arb(self, name: str) -> None:
        """Select a stored waveform."""
        if name.upper() not in self.memory:
            raise ScpiError(NO_ARB)
        self.arb = name.upper()

    def clear(self) -> None:
        """Forget the stored waveforms."""
        self.memory.clear()
        self.arb = "EXP_RISE"

    def store(self, name: str, data: bytes) -> None:
        """Store a waveform under a new name."""
        if len(data) % 2 or len(data) < 2 * _MIN_SAMPLES:
            raise ScpiError(BAD_BLOCK)
        if name in self.memory:
            raise ScpiError(ARB_EXISTS)
        if sum(map(len, self.memory.values())) + len(data) > 2 * _MEMORY:
            raise ScpiError(OUT_OF_RANGE)
        self.memory[name] = data

    def waits(self) -> bool:
        """Return whether a trigger from the bus plays a burst."""
        return self.burst and self.trigger == "BUS" and self.function == "ARB"

    def play(self, *, byte_order: str) -> FloatArray:
        """Return the volts into an open circuit of one cycle, zero if the output is off."""
        stored = self.memory.get(self.arb, b"")
        codes = np.frombuffer(stored, dtype="<i2" if byte_order == "SWAP" else ">i2")
        amplitude_v = self.volts * self.doubling / 2 if self.on else 0.0
        return codes / _FULL_SCALE * amplitude_v


_LONGEST: Final = 2**22
_SIZES: Final = b"|".join(rb"%d[0-9]{%d}" % (n_digits, n_digits) for n_digits in range(1, 10))
_BLOCK: Final = re.compile(rb"#(?:%b)" % _SIZES)
"""The header of a block: the number of digits of its size, then its size."""
_TEXT: Final = re.compile(rb"""(?:"[^"\n]*"?|[^;\n"#]|(?!%b)#)*""" % _BLOCK.pattern)
"""A unit up to a block or its end; neither a block nor an end is in quotes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """One command or question.

    The header has no leading colon; that of a question ends in ``?``. If there is a block, `data`
    is its content, and the argument is the text before it.
    """

    header: str
    argument: str
    data: bytes | None = None


class Reader:
    r"""Cuts a stream of bytes into units.

    Every unit names its whole path; units of one line are parted by semicolons.

    >>> reader = Reader()
    >>> reader.feed(b"SOUR1:VOLT 2;:DATA:ARB:DAC a,#12\n")
    []
    >>> for unit in reader.feed(b"\n\n"): print(unit)
    Unit(header='SOUR1:VOLT', argument='2', data=None)
    Unit(header='DATA:ARB:DAC', argument='a,', data=b'\n\n')
    """

    def __init__(self) -> None:
        self._waiting = b""

    def feed(self, data: bytes) -> list[Unit]:
        """Return the units of every line that is complete; none, and all dropped, if too long."""
        self._waiting += data
        units: list[Unit] = []
        while (line := self._line()) is not None:
            units += line
        if len(self._waiting) > _LONGEST:
            self._waiting = b""
        return units

    def _line(self) -> list[Unit] | None:
        """Take the next line from what waits; None while it is incomplete."""
        waiting, units, begin = self._waiting, list[Unit](), 0
        while True:
            at, content = _end_of_text(waiting, begin), None
            text = waiting[begin:at]
            while block := _BLOCK.match(waiting, at):
                text, at = waiting[begin:at], block.end() + int(block[0][2:])
                content = waiting[block.end() : at]
                at = _end_of_text(waiting, at)
            if at >= len(waiting):
                return None
            units += _unit(text, content)
            begin = at + 1
            if waiting[at:begin] == b"\n":
                self._waiting = waiting[begin:]
                return units


def _end_of_text(waiting: bytes, at: int) -> int:
    match = _TEXT.match(waiting, at)
    return at if match is None else match.end()


def _unit(text: bytes, content: bytes | None) -> list[Unit]:
    header, _, argument = text.decode("ascii", errors="replace").strip().partition(" ")
    if not header:
        return []
    return [Unit(header=header.removeprefix(":"), argument=argument.strip(), data=content)]


def header_pattern(notation: str) -> re.Pattern[str]:
    """Return what matches a header in the notation of programming guides, long or short.

    Capitals are the short form, ``#`` is a channel, 1 if it is left out, and brackets enclose what
    may be left out.

    >>> pattern = header_pattern("[SOURce#:]VOLTage[:LEVel]")
    >>> [bool(pattern.fullmatch(text)) for text in ("SOUR2:VOLT", "voltage:level", "SOUR:VOL")]
    [True, True, False]
    >>> pattern.fullmatch("SOURCE2:VOLT").group(1)
    '2'
    """
    text = notation.replace("[", "(?:").replace("]", ")?").replace("*", r"\*")

    def both(word: re.Match[str]) -> str:
        short = word.group(1)
        return f"(?:{short}{word.group(2).upper()}|{short})" if word.group(2) else short

    text = re.sub(r"([A-Z]+)([a-z]*)", both, text)
    return re.compile(text.replace("#", "([12])?"), re.IGNORECASE)
