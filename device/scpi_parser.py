"""From bytes to SCPI commands, as an instrument reads them; blocks may hold any byte."""

import re
from dataclasses import dataclass
from typing import Final

_LONGEST: Final = 2**22
_DIGITS: Final = b"0123456789"


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """One command or question.

    Parameters
    ----------
    header : str
        What is to be done, without the colon it may begin with; a question ends in ``?``.
    argument : str
        The rest; of a block only what stands before it.
    data : bytes or None
        The content of its block, if there is one.
    """

    header: str
    argument: str
    data: bytes | None = None


class Reader:
    r"""Cuts a stream of bytes into units.

    Every unit names its whole path; units of one line are parted by semicolons.

    Examples
    --------
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
        units, begin, at, quoted = [], 0, 0, False
        content: bytes | None = None
        head = b""
        while at < len(self._waiting):
            sign = self._waiting[at : at + 1]
            if sign == b"#" and not quoted:
                span = self._block(at)
                if span is None:
                    return None
                if span[1] > span[0]:
                    head, content = self._waiting[begin:at], self._waiting[span[0] : span[1]]
                    at = span[1]
                    continue
            quoted ^= sign == b'"'
            if sign == b"\n" or (sign == b";" and not quoted):
                text = head if content is not None else self._waiting[begin:at]
                units += _unit(text, content)
                begin, content = at + 1, None
                if sign == b"\n":
                    self._waiting = self._waiting[begin:]
                    return units
            at += 1
        return None

    def _block(self, at: int) -> tuple[int, int] | None:
        """Return where the content of a block begins and ends; None while it is incomplete."""
        count = self._waiting[at + 1 : at + 2]
        if not count:
            return None
        if count not in _DIGITS or count == b"0":
            return at, at
        begin = at + 2 + int(count)
        size = self._waiting[at + 2 : begin]
        if not size.isdigit() and len(size) == int(count):
            return at, at
        if len(size) < int(count) or len(self._waiting) <= begin + int(size):
            return None
        return begin, begin + int(size)


def _unit(text: bytes, content: bytes | None) -> list[Unit]:
    words = text.decode("ascii", errors="replace").strip().split(maxsplit=1)
    if not words:
        return []
    argument = words[1].strip() if len(words) > 1 else ""
    return [Unit(header=words[0].removeprefix(":"), argument=argument, data=content)]


def header_pattern(notation: str) -> re.Pattern[str]:
    """Return what matches a header in the notation of programming guides, long or short.

    Parameters
    ----------
    notation : str
        Capitals are the short form, ``#`` is a channel, 1 if it is left out, and brackets enclose
        what may be left out.

    Examples
    --------
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
