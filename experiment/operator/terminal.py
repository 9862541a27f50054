"""The operator's terminal, borrowed: keys at once, what they mean, output that never blocks.

For systems with POSIX terminals only.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import select
import sys
import time
from enum import Enum, auto
from typing import TYPE_CHECKING, Any, Final

with contextlib.suppress(ImportError):  # Windows: whoever uses it refuses there, in one line
    import termios

if TYPE_CHECKING:
    from collections.abc import Callable


_AT_ONCE: Final = 1024
_REST_S: Final = 0.05
_UNFINISHED: Final = re.compile(rb"(?<!\x1b)\x1b(\[[0-?]*[ -/]*|O)?\Z")
"""What a key's control sequence may begin with; of Esc held down only the first is waited for."""
_LFLAG, _IFLAG, _CC = 3, 0, 6
_FAREWELL_S: Final = 0.2


def read_keys(keyboard: int) -> bytes:
    """Return what is typed, nothing at its end; waits for the first key, and for the rest of one.

    A key may arrive in pieces, whose first alone would be Esc: that is Esc only if nothing follows.
    """
    typed = os.read(keyboard, _AT_ONCE)
    while _UNFINISHED.search(typed) and select.select([keyboard], [], [], _REST_S)[0]:
        rest = os.read(keyboard, _AT_ONCE)
        if not rest:
            break
        typed += rest
    return typed


class BorrowedTerminal:
    """The terminal of standard input and output; every method raises `OSError` once it is gone.

    It is written to through a file description of its own, which does not block: a terminal that
    is held by Ctrl-S, or read by nobody, loses pictures and holds up nothing.
    """

    def __init__(self, keyboard: int, name: str) -> None:
        self._keyboard = keyboard
        self._screen = os.open(name, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
        self._settings: list[Any] | None = None
        self._unsent = b""

    @property
    def in_front(self) -> bool:
        """Whether this program may use it: it is not in the background of a shell."""
        try:
            return os.tcgetpgrp(self._keyboard) == os.getpgrp()
        except OSError:  # no job control on this terminal
            return True

    @property
    def busy(self) -> bool:
        """Whether something is written and not yet taken, after another try to send it."""
        self._send()
        return bool(self._unsent)

    def take(self) -> bool:
        """Have keys at once and unechoed, unless it is so; return whether that had to be set.

        Keys typed before are dropped: they were meant for something else.
        """
        try:
            settings = termios.tcgetattr(self._keyboard)
            if not settings[_LFLAG] & (termios.ICANON | termios.ECHO):
                return False
            mine = [*settings[:_CC], list(settings[_CC])]
            mine[_IFLAG] &= ~termios.IXON
            mine[_LFLAG] &= ~(termios.ICANON | termios.ECHO)
            mine[_CC][termios.VMIN], mine[_CC][termios.VTIME] = 1, 0
            self._settings = settings
            termios.tcsetattr(self._keyboard, termios.TCSANOW, mine)
            termios.tcflush(self._keyboard, termios.TCIFLUSH)
        except termios.error as error:
            raise OSError(*error.args) from error
        return True

    def give_back(self) -> None:
        """Restore the settings that it had; a terminal that is gone, or another's, is left."""
        settings, self._settings = self._settings, None
        if settings is not None and self.in_front:
            with contextlib.suppress(termios.error):
                termios.tcflush(self._keyboard, termios.TCIFLUSH)
                termios.tcsetattr(self._keyboard, termios.TCSANOW, settings)

    def read(self, within_s: float) -> bytes:
        """Return what is typed, or nothing after some time."""
        if not select.select([self._keyboard], [], [], within_s)[0]:
            return b""
        typed = read_keys(self._keyboard)
        if not typed:
            raise OSError(errno.EIO, "the terminal is gone")
        return typed

    def write(self, text: str) -> None:
        """Show text; what the terminal does not take now is sent later, see `busy`."""
        self._unsent += text.encode(sys.stdout.encoding, "replace")
        self._send()

    def flush(self) -> None:
        """Send what is written; give up after a moment."""
        until_s = time.monotonic() + _FAREWELL_S
        while self.busy and (left_s := until_s - time.monotonic()) > 0:
            select.select([], [self._screen], [], left_s)

    def _send(self) -> None:
        if self._unsent:
            with contextlib.suppress(BlockingIOError):
                self._unsent = self._unsent[os.write(self._screen, self._unsent) :]

    def close(self) -> None:
        """Close what was opened; the terminal itself stays."""
        os.close(self._screen)


def operators_terminal() -> BorrowedTerminal | None:
    """Return the terminal that this program runs on; None in a pipe, or where it cannot be used."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return None
    try:
        return BorrowedTerminal(sys.stdin.fileno(), os.ttyname(sys.stdout.fileno()))
    except OSError:
        return None


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
