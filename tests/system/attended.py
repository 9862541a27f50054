"""A bash command on a pseudo-terminal, keys pressed at it, and what it shows."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import time
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from pathlib import Path

KEYS: Final = {
    "enter": b"\n",
    "escape": b"\x1b",
    "space": b" ",
    "left": b"\x1b[D",
    "right": b"\x1b[C",
    "down": b"\x1b[B",
    "up": b"\x1b[A",
}
PATIENCE_S: Final = 60
LATER_S: Final = 0.3
"""A person takes longer to answer than what counts as anticipated."""
_SIGN: Final = re.compile(r"\x1b\[([0-9;?]*)([A-Za-z])|(.)", re.DOTALL)
_ITS_OWN: Final = 'exec 0<>"$1" 1>&0 2>&0 && exec bash --norc --noprofile -ic "$2"'
"""The first terminal that a session's leader opens is its own: the bash that follows has jobs."""


class PageError(AssertionError):
    """What a page shows is not what happens; says where."""


def shown(raw: str) -> list[str]:
    """Return the lines that a terminal shows, without colours and empty lines at the end."""
    lines, row, column = [""], 0, 0
    for token in _SIGN.finditer(raw):
        count, code, sign = token.groups()
        if sign == "\n":
            row, column = row + 1, 0
            lines += [""] * (row == len(lines))
        elif sign == "\r":
            column = 0
        elif code == "A":
            row -= int(count or 1)
        elif code == "K":
            lines[row] = "" if count == "2" else lines[row][:column]
        elif sign and sign >= " ":
            lines[row] = lines[row][:column].ljust(column) + sign + lines[row][column + 1 :]
            column += 1
    return "\n".join(line.rstrip() for line in lines).rstrip("\n").split("\n")


class Terminal:
    """A bash command on a pseudo-terminal, and somebody who presses keys."""

    def __init__(self, command: str, folder: Path, environment: dict[str, str]) -> None:
        self._keyboard, inner = os.openpty()
        script = f"stty cols 80 rows 40\n{command}\n(exit $?)"
        self._process = subprocess.Popen(
            ["bash", "-c", _ITS_OWN, "page", os.ttyname(inner), script],
            stdin=inner,
            stdout=inner,
            stderr=inner,
            cwd=folder,
            env={**environment, "TERM": "xterm"},
            start_new_session=True,
        )
        os.close(inner)
        self._raw = b""
        self._seen = 0

    def press(self, keys: str) -> None:
        """Wait for texts, and press the keys that follow them."""
        for item in keys.split(";"):
            text, _, names = item.rpartition(">")
            for name in names.split() or [""]:
                self._wait_for(text.strip().encode())
                if name:
                    time.sleep(LATER_S)
                    os.write(self._keyboard, KEYS.get(name, name.encode()))

    def ended(self) -> tuple[str, int]:
        """Wait for the end; return what was shown and the exit code."""
        until_s = time.monotonic() + PATIENCE_S
        while self._read(until_s):
            pass
        if time.monotonic() >= until_s:
            raise PageError(f"it did not end; shown so far:\n{self._told()}")
        return self._told(), self._process.wait(PATIENCE_S)

    def close(self) -> None:
        """End all that runs on the terminal."""
        os.close(self._keyboard)  # hangs up
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def _told(self) -> str:
        return self._raw.decode(errors="replace")

    def _wait_for(self, text: bytes) -> None:
        until_s = time.monotonic() + PATIENCE_S
        while (at := self._raw.find(text, self._seen)) < 0:
            if not self._read(until_s):
                raise PageError(f"{text.decode()!r} never appeared; shown:\n{self._told()}")
        self._seen = at + len(text)

    def _read(self, until_s: float) -> bool:
        wait_s = max(0.0, until_s - time.monotonic())
        if not select.select([self._keyboard], [], [], wait_s)[0]:
            return False
        try:
            new = os.read(self._keyboard, 4096)
        except OSError:  # Linux ends a pseudo-terminal so
            return False
        self._raw += new
        return bool(new)
