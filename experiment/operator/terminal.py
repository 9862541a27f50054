"""The operator's terminal, borrowed: keys at once, output that never blocks, all given back.

For systems with POSIX terminals only.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import sys
import termios
import time
from typing import Any, Final

_AT_ONCE: Final = 1024
_LFLAG, _IFLAG, _CC = 3, 0, 6
_FAREWELL_S: Final = 0.2


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
        typed = os.read(self._keyboard, _AT_ONCE)
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
