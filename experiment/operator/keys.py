"""What the keys of a terminal mean to the operator: pause, resume, note, stop."""

from __future__ import annotations

import re
from enum import Enum, auto
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Callable


LONGEST_NOTE: Final = 500
"""Further characters of a note are dropped."""

HINTS: Final = "p pause   r resume   n note   s stop"

_ESCAPE: Final = "\x1b"
_ENTER: Final = ("\r", "\n")
_RUB_OUT: Final = ("\x7f", "\b")
KEY: Final = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1bO.|.", re.DOTALL)
"""A key: a control sequence as a whole, or one character."""


class _Mode(Enum):
    COMMAND = auto()
    NOTE = auto()
    STOP = auto()


class OperatorKeys:
    """Reads an operator's keys; p pauses, r resumes, n takes a note, s stops after a y.

    `go_on` returns whether there was anything to resume; `notice` says what the last key did.

    Examples
    --------
    >>> notes = []
    >>> keys = OperatorKeys(pause=print, go_on=lambda: False, stop=print, note=notes.append)
    >>> keys.type("nchair mo"); keys.prompt
    'note: chair mo_   Enter keeps it, Esc drops it'
    >>> keys.type("ved" + chr(10)); notes
    ['chair moved']
    """

    def __init__(
        self,
        *,
        pause: Callable[[], None],
        go_on: Callable[[], bool],
        stop: Callable[[], None],
        note: Callable[[str], None],
    ) -> None:
        self._pause = pause
        self._go_on = go_on
        self._stop = stop
        self._keep = note
        self._mode = _Mode.COMMAND
        self._typed = ""
        self.notice = ""

    @property
    def prompt(self) -> str:
        """What can be typed now, or what is being typed."""
        match self._mode:
            case _Mode.NOTE:
                return f"note: {self._typed}_   Enter keeps it, Esc drops it"
            case _Mode.STOP:
                return "stop the session?   y / n"
        return HINTS

    def type(self, text: str) -> None:
        """Take characters as they were typed; keys without a meaning are passed over."""
        meaning = {
            _Mode.COMMAND: self._command,
            _Mode.NOTE: self._write,
            _Mode.STOP: self._confirm,
        }
        for key in KEY.findall(text):
            meaning[self._mode](key)

    def _command(self, key: str) -> None:
        match key.lower():
            case "p":
                self._pause()
                self.notice = ""
            case "r":
                self.notice = "" if self._go_on() else "nothing is paused"
            case "n":
                self._mode, self._typed, self.notice = _Mode.NOTE, "", ""
            case "s":
                self._mode, self.notice = _Mode.STOP, ""

    def _write(self, key: str) -> None:
        if key in _ENTER:
            self._mode = _Mode.COMMAND
            text = self._typed.strip()
            if text:
                self._keep(text)
                self.notice = f"noted: {text}"
        elif key == _ESCAPE:
            self._mode = _Mode.COMMAND
        elif key in _RUB_OUT:
            self._typed = self._typed[:-1]
        elif key.isprintable() and len(self._typed) < LONGEST_NOTE:
            self._typed += key

    def _confirm(self, key: str) -> None:
        self._mode = _Mode.COMMAND
        if key.lower() == "y":
            self.notice = "stopping ..."
            self._stop()
