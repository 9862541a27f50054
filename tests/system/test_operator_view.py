"""An operator at a real terminal: a pseudo-terminal on which a session shows itself."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import pytest

from tactstrip import __file__ as front_door

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

pty = pytest.importorskip("pty", reason="pseudo-terminals are a POSIX feature")
termios = pytest.importorskip("termios", reason="pseudo-terminals are a POSIX feature")

PATIENCE_S = 60
CONTROL = re.compile(r"\x1b\[([0-9;?]*)([A-Za-z])|\r|\n|[^\x1b\r\n]+")

BESIDE = """
import json, os, signal, sys, threading, time
from experiment.operator.requests import Requests, Status, StopRequested, StopSignal, Tally
from experiment.operator.view import OperatorView

requests, stop, what, told = Requests(), StopSignal(), sys.argv[1], {}

def status(**new):
    facts = dict(phase="ready", done=11, planned=155, block=2, blocks=5, left_s=610.0,
                 noise="plays", device="ready", message="",
                 tallies={"left": Tally(presented=6, correct=5, last=("left", "both")),
                          "right": Tally(presented=5, correct=4, last=("right", "timeout"))})
    return Status(**facts | new)

def wait():
    with stop.interruptible():
        time.sleep(50)

def progress(view):
    for done in range(12, 16):
        view.show(status(done=done))
        time.sleep(0.25)
    stand(view, done=99, message="put the cup away")

def stand(view, **new):
    view.show(status(**new))
    wait()

def idle(view):
    stand(view)

def answer(view):
    stand(view, phase="answer", done=77)



def many(view):
    for done in range(1500):
        view.show(status(done=done, message="x" * 60))
        time.sleep(0.001)
    told["shown"] = done



if "own" in sys.argv:
    import fcntl, termios
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)

try:
    with stop.on_signals(), OperatorView(requests, stop) as view:
        told["threads"] = threading.active_count()
        told["rich"] = "rich" in sys.modules
        globals()[what](view)
except StopRequested:
    pass
finally:
    told |= {"asked": stop.asked, "notes": requests.notes(), "paused": requests.paused,
             "go_on": requests.take_go_on()}
    with open(sys.argv[2] + ".part", "w") as file:
        json.dump(told, file)
    os.rename(sys.argv[2] + ".part", sys.argv[2])
"""
"""A program with nothing but the view beside it; what became of it goes into a file."""


class Screen:
    """What a terminal shows of lines that are drawn, erased and drawn again."""

    def __init__(self) -> None:
        self.lines = [""]
        self._row = 0

    def feed(self, text: str) -> None:
        for match in CONTROL.finditer(text):
            command, piece = match[2], match[0]
            if command == "A":
                self._row = max(0, self._row - int(match[1] or 1))
            elif command == "K":
                self.lines[self._row] = ""
            elif piece == "\n":
                self._row += 1
                self.lines += [""] * (self._row >= len(self.lines))
            elif command is None and piece != "\r":
                self.lines[self._row] += piece

    def has(self, words: str) -> bool:
        return any(words in line for line in self.lines)


class Terminal:
    """A program on a pseudo-terminal of its own."""

    def __init__(self, *command: str) -> None:
        self.far, near = pty.openpty()
        self.near = near
        self.settings = termios.tcgetattr(near)
        self.screen, self.seen = Screen(), ""
        self.process = subprocess.Popen(
            [sys.executable, "-c", *command],
            stdin=near,
            stdout=near,
            stderr=near,
            start_new_session="own" in command,
            process_group=None if "own" in command else 0,
            env=os.environ | {"TERM": "xterm", "COLUMNS": "100"},
            cwd=Path(front_door).parent,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        for handle in {self.far, self.near} - {-1}:
            os.close(handle)

    def hang_up(self) -> None:
        for handle in (self.near, self.far):
            os.close(handle)
        self.near = self.far = -1

    def read(self, within_s: float = 0.05) -> str:
        text = ""
        while select.select([self.far], [], [], within_s)[0]:
            text += os.read(self.far, 65536).decode()
        self.screen.feed(text)
        self.seen += text
        return text

    def until(self, true: Callable[[], bool]) -> None:
        until_s = time.monotonic() + PATIENCE_S
        while not true():
            self.read()
            assert time.monotonic() < until_s, self.seen
            assert self.process.poll() is None or true(), self.seen

    def expect(self, words: str) -> None:
        self.until(lambda: self.screen.has(words))

    def type(self, keys: str) -> None:
        os.write(self.far, keys.encode())

    def ended(self) -> int:
        until_s = time.monotonic() + PATIENCE_S
        while self.process.poll() is None and time.monotonic() < until_s:
            self.read()
        self.read()
        return self.process.wait(0)

    def stop(self, first: str = "") -> None:
        """Let the operator stop the session, after other keys perhaps."""
        self.type(first + "sy")
        assert self.ended() == 0

    def given_back(self) -> bool:
        """Tell whether it has the settings and the cursor that it had."""
        shown, hidden = (self.seen.rfind(f"\x1b[?25{how}") for how in "hl")
        return termios.tcgetattr(self.near) == self.settings and shown > hidden

    @property
    def by_line(self) -> bool:
        """Whether it is as a shell has it: whole lines, echoed."""
        local = termios.tcgetattr(self.near)[3]
        return bool(local & termios.ICANON) and bool(local & termios.ECHO)


@pytest.fixture
def told_path(tmp_path: Path) -> Path:
    return tmp_path / "told.json"


def told(path: Path) -> dict[str, Any]:
    until_s = time.monotonic() + PATIENCE_S
    while not path.exists() and time.monotonic() < until_s:
        time.sleep(0.02)
    found: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return found


def beside(what: str, told_path: Path, *more: str) -> Terminal:
    return Terminal(BESIDE, what, str(told_path), *more)


@pytest.fixture
def idle(told_path: Path) -> Iterator[Terminal]:
    """A view that waits for keys."""
    with beside("idle", told_path) as terminal:
        terminal.expect("p pause")
        yield terminal


def test_the_view_shows_how_far_the_session_is_and_no_level(idle: Terminal) -> None:
    for shown in ("11 of 155", "2 of 5", "10 min", "plays", "5 of 6", "4 of 5", "timeout"):
        idle.expect(shown)
    assert "vpp" not in idle.seen.lower()


def test_a_pause_is_asked_for_by_p_and_ended_by_r(idle: Terminal, told_path: Path) -> None:
    idle.type("p")
    idle.expect("pause follows")
    idle.type("r")
    idle.until(lambda: not idle.screen.has("pause follows"))
    idle.stop()
    assert told(told_path) | {"paused": False, "go_on": True} == told(told_path)


def test_a_stop_has_to_be_confirmed_and_ends_a_wait(idle: Terminal, told_path: Path) -> None:
    for key in "ny":
        idle.expect("p pause")
        idle.type("s")
        idle.expect("y / n")
        assert idle.process.poll() is None
        idle.type(key)
    assert idle.ended() == 0
    assert told(told_path)["asked"] is True


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_the_terminal_is_given_back_by_a_signal(idle: Terminal, number: signal.Signals) -> None:
    assert not idle.by_line
    idle.process.send_signal(number)
    assert idle.ended() == 0
    assert idle.given_back()
    assert not idle.screen.has("p pause")


def test_a_terminal_that_is_closed_stops_the_session_by_its_signal(told_path: Path) -> None:
    with beside("idle", told_path, "own") as terminal:
        terminal.expect("p pause")
        terminal.hang_up()
        assert terminal.process.wait(PATIENCE_S) == 0
    assert told(told_path)["asked"] is True


@pytest.mark.parametrize("piped", ["stdin", "stdout"])
def test_in_a_pipe_it_is_silent_and_has_no_thread(told_path: Path, piped: str) -> None:
    far, near = pty.openpty()
    pipe = subprocess.PIPE
    done = subprocess.Popen(
        [sys.executable, "-c", BESIDE, "many", str(told_path)],
        stdin=pipe if piped == "stdin" else near,
        stdout=pipe if piped == "stdout" else near,
        stderr=pipe,
        cwd=Path(front_door).parent,
    )
    assert done.communicate(timeout=PATIENCE_S) in {(None, b""), (b"", b"")}
    assert not select.select([far], [], [], 0)[0]
    os.close(far)
    os.close(near)
    assert told(told_path) | {"threads": 1, "rich": False} == told(told_path)
