"""Single keys at a terminal: by `termios` on Linux and macOS, by `msvcrt` on Windows."""

from __future__ import annotations

import contextlib
import os
import re
import select
import sys
import time
from importlib import import_module
from typing import Any, Final, Protocol, Self


class Keyboard(Protocol):
    """Keys without Enter and without an echo; a context manager that restores the terminal.

    A key is one character, or the whole control sequence that terminals send for an arrow key or
    another special key. Enter is a line feed.
    """

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def wait(self, timeout_s: float | None) -> bool:
        """Wait until a key is pressed, at most for a time; return whether one was."""

    def read(self) -> list[str]:
        """Return the keys that were pressed; EOFError if the terminal is gone."""


def open_keyboard() -> Keyboard:
    """Return the keyboard of the terminal at standard input."""
    return PosixKeyboard() if os.name == "posix" else WindowsKeyboard()


def is_in_front() -> bool:
    """Return whether this program may use its terminal, and is not in a shell's background."""
    if os.name != "posix":
        return True
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except OSError:  # a terminal without job control
        return True


_KEY: Final = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1bO.|.", re.DOTALL)
_INCOMPLETE_KEY: Final = re.compile(rb"(?<!\x1b)\x1b(\[[0-?]*[ -/]*|O)?\Z")
"""The start of a control sequence, or the Esc key; while Esc is held, only the first one counts."""
_SEQUENCE_TIMEOUT_S: Final = 0.05
_MAX_BYTES: Final = 1024


class PosixKeyboard:
    """The keyboard of a terminal on Linux and macOS."""

    def __init__(self) -> None:
        self._input = sys.stdin.fileno()

    def __enter__(self) -> Self:
        import termios
        import tty

        self._settings = termios.tcgetattr(self._input)
        tty.setcbreak(self._input, termios.TCSANOW)
        return self

    def __exit__(self, *_: object) -> None:
        import termios

        # TCSANOW, because a terminal that is held by Ctrl-S never drains.
        with contextlib.suppress(termios.error):
            termios.tcsetattr(self._input, termios.TCSANOW, self._settings)

    def wait(self, timeout_s: float | None) -> bool:
        """Wait until a key is pressed, at most for a time; return whether one was."""
        return bool(select.select([self._input], [], [], timeout_s)[0])

    def read(self) -> list[str]:
        """Return the keys that were pressed; EOFError if the terminal is gone.

        A slow line may deliver a control sequence in pieces, the first of which is that of the Esc
        key. So the rest is awaited for a moment.
        """
        typed = b""
        with contextlib.suppress(OSError):
            typed = os.read(self._input, _MAX_BYTES)
            while _INCOMPLETE_KEY.search(typed) and self.wait(_SEQUENCE_TIMEOUT_S):
                rest = os.read(self._input, _MAX_BYTES)
                typed += rest
                if not rest:
                    break
        if not typed:
            raise EOFError
        return _KEY.findall(typed.decode(errors="replace"))


_ARROWS: Final = {"H": "\x1b[A", "P": "\x1b[B", "M": "\x1b[C", "K": "\x1b[D"}
"""The control sequences of other systems, by what Windows sends after the prefix of a key."""
_PREFIXES: Final = ("\x00", "\xe0")
_POLL_INTERVAL_S: Final = 0.002


class WindowsKeyboard:
    """The keyboard of a console on Windows, which needs no settings."""

    def __init__(self) -> None:
        self._console: Any = import_module("msvcrt")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def wait(self, timeout_s: float | None) -> bool:
        """Wait until a key is pressed, at most for a time; return whether one was."""
        until_s = None if timeout_s is None else time.monotonic() + timeout_s
        while not self._console.kbhit():
            if until_s is not None and time.monotonic() >= until_s:
                return False
            time.sleep(_POLL_INTERVAL_S)
        return True

    def read(self) -> list[str]:
        """Return the keys that were pressed."""
        keys = []
        while self._console.kbhit():
            key = self._console.getwch()
            if key in _PREFIXES:
                keys.append(_ARROWS.get(self._console.getwch(), key))
            else:
                keys.append("\n" if key == "\r" else key)
        return keys
