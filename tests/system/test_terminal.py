"""A participant, or an operator, at a real terminal: keys typed into a pseudo-terminal."""

from __future__ import annotations

import json
import os
import re
import select
import shlex
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Self

import pytest

from tests.test_experiment.sessions import COMMAND, Sessions

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pty = pytest.importorskip("pty", reason="pseudo-terminals are a POSIX feature")
termios = pytest.importorskip("termios", reason="pseudo-terminals are a POSIX feature")

LEFT, RIGHT, DOWN, ESCAPE, ENTER = b"\x1b[D", b"\x1b[C", b"\x1b[B", b"\x1b", b"\n"
PATIENCE_S = 60
LATER_S = 0.2
"""A person takes longer to answer than what counts as premature."""
GO_ON = b"Press Enter to continue"
NO_UTF_8 = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.fixture
def sessions(tmp_path: Path, quick_study_text: str) -> Sessions:
    patient = quick_study_text + "response_window_s = 30\nmin_break_s = 0\n"
    return Sessions(tmp_path, '[masking]\nnoise = "none"\n' + patient)


class Terminal:
    """A process of its own, with a pseudo-terminal for a keyboard."""

    def __init__(self, command: list[str], env: dict[str, str] | None = None) -> None:
        self._keyboard, inner = pty.openpty()
        self.process = subprocess.Popen(
            command,
            stdin=inner,
            stdout=inner,
            stderr=inner,
            start_new_session=True,
            env=os.environ | (env or {}),
        )
        os.close(inner)
        self._seen = b""
        self.shown = b""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self.close()

    def close(self) -> None:
        if self._keyboard >= 0:
            os.close(self._keyboard)
        self._keyboard = -1

    def read(self, until_s: float) -> bool:
        ready, _, _ = select.select([self._keyboard], [], [], max(0.0, until_s - time.monotonic()))
        if not ready:
            return False
        try:
            new = os.read(self._keyboard, 4096)
        except OSError:  # Linux ends a pseudo-terminal so
            return False
        self._seen += new
        self.shown += new
        return bool(new)

    def expect(self, text: bytes) -> None:
        until_s = time.monotonic() + PATIENCE_S
        while text not in self._seen:
            assert self.read(until_s), (text, self.shown)
        self._seen = self._seen[self._seen.index(text) + len(text) :]

    def take(self, text: bytes) -> bool:
        """Return whether a text was shown since the last call; what came before it is dropped."""
        is_shown = text in self._seen
        if is_shown:
            self._seen = self._seen[self._seen.index(text) + len(text) :]
        return is_shown

    def press(self, key: bytes) -> None:
        os.write(self._keyboard, key)

    def go_on(self, text: bytes, key: bytes = ENTER) -> None:
        """Press a key when a text is shown."""
        self.expect(text)
        self.press(key)

    def begin(self, parts: int = 1) -> None:
        """Go on from the instructions, and from the first parts."""
        for _ in range(1 + parts):
            self.go_on(GO_ON)

    def answer(self, *keys: bytes) -> None:
        for key in keys:
            self.expect(b" ?")
            time.sleep(LATER_S)
            self.press(key)

    def ended(self) -> int:
        until_s = time.monotonic() + PATIENCE_S
        while self.read(until_s):
            pass
        return self.process.wait(PATIENCE_S)


def run(sessions: Sessions, *more: str, env: dict[str, str] | None = None) -> Terminal:
    """Start `tactstrip run` on a terminal."""
    return Terminal([*COMMAND, *sessions.words(*more)], env)


def test_what_is_pressed_is_what_is_recorded(sessions: Sessions) -> None:
    with run(sessions, "--seed", "1") as terminal:
        terminal.begin()
        terminal.answer(b"\x1b[15~", LEFT)  # F5 is no answer here
        terminal.answer(RIGHT, DOWN)
        terminal.go_on(b"3 of 5")
        terminal.answer(LEFT, RIGHT)
        assert terminal.ended() == 0, terminal.shown
    recorded = sessions.rows()
    assert [row["response"] for row in recorded] == ["left", "right", "both", "left", "right"]
    assert {(row["simulated"], row["device_kind"]) for row in recorded} == {("false", "mock")}
    assert len(sessions.entries("note")) == 1
    assert all(0 < float(row["rt_s"]) < 30 for row in recorded)
    # no level is shown; a folder's name or the last hash of the journal may hold any three digits
    shown = terminal.shown.replace(str(sessions.study.parent).encode(), b"")
    assert b"160" not in re.sub(rb"[0-9a-f]{64}", b"", shown)


def test_somebody_alone_who_presses_too_early_cannot_go_on_by_themselves(
    sessions: Sessions,
) -> None:
    sessions.write(sessions.text.replace("[0.01, 0.02]", "[5, 5.5]"))
    with run(sessions, "--seed", "1") as terminal:
        terminal.begin()
        for _ in range(3):
            terminal.go_on(b"1 of 5  ...", LEFT)
            terminal.expect(b"\r\n")
        for _ in range(5):
            terminal.press(ENTER)
        assert terminal.ended() == 4

    assert [row["status"] for row in sessions.rows()] == ["voided"] * 3


def test_escape_pauses_and_escape_again_stops_until_a_resume(sessions: Sessions) -> None:
    with run(sessions, "--seed", "1") as terminal:
        terminal.begin()
        terminal.answer(LEFT, ESCAPE)
        terminal.go_on(b"1 of 5")
        terminal.answer(LEFT, ESCAPE)
        terminal.go_on(b"2 of 5", ESCAPE)
        assert terminal.ended() == 4, terminal.shown
    command = terminal.shown.decode().rpartition("tactstrip run")[2].partition("\n")[0]
    assert sorted(shlex.split(command)) == sorted(sessions.words("--resume")[1:])
    with run(sessions, "--resume") as terminal:
        terminal.begin()
        terminal.answer(LEFT, RIGHT)
        terminal.go_on(GO_ON)
        terminal.answer(LEFT)
        terminal.go_on(b"3 of 5")
        terminal.answer(LEFT, LEFT)
        assert terminal.ended() == 0, terminal.shown
    statuses = [row["status"] for row in sessions.rows() if row["kind"] != "practice"]
    assert (statuses.count("ok"), statuses.count("voided")) == (5, 2)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, None])
def test_a_signal_or_a_closed_terminal_stops_the_session_safely_while_an_answer_is_awaited(
    sessions: Sessions, number: signal.Signals | None
) -> None:
    with run(sessions, "--seed", "1") as terminal:
        terminal.begin()
        terminal.answer(LEFT)
        terminal.expect(b" ?")
        if number is None:
            terminal.close()
            assert terminal.process.wait(PATIENCE_S) == 4
        else:
            terminal.process.send_signal(number)
            assert terminal.ended() == 4, terminal.shown
    assert [row["status"] for row in sessions.rows()] == ["ok", "voided"]


@pytest.mark.parametrize("env", [NO_UTF_8, {}])
def test_without_a_terminal_that_shows_the_texts_nothing_begins(
    sessions: Sessions, env: dict[str, str]
) -> None:
    sessions.write(
        sessions.text + 'hands_off_trials_after = 2\n[texts]\nhands_off_after = "Hände weg"\n'
    )
    if env:
        with run(sessions, "--seed", "1", env=env) as terminal:
            assert terminal.ended() == 2
        assert b"texts.hands_off_after" in terminal.shown
    else:
        command, nothing = [*COMMAND, *sessions.words()], subprocess.DEVNULL
        assert subprocess.run(command, stdin=nothing, check=False).returncode == 2
    assert not sessions.out.exists()


BESIDE = """
import fcntl, json, os, sys, termios, threading, time
from experiment.operator.requests import Requests, Status, StopRequested, StopSignal, Tally
from experiment.operator.view import OperatorView

requests, stop, shown = Requests(), StopSignal(), 0
if os.isatty(0):
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
tallies = {"left": Tally(presented=6, correct=5, last=("left", "both")),
           "right": Tally(presented=5, correct=4, last=("right", "timeout"))}
facts = {}
try:
    with stop.on_signals(), OperatorView(requests, stop) as view:
        facts |= {"threads": threading.active_count(), "rich": "rich" in sys.modules}
        view.show(Status(phase=sys.argv[2], done=11, planned=155, block=2, blocks=5, left_s=610.0,
                         noise="plays", device="ready", message="", tallies=tallies))
        if os.isatty(0):
            os.write(2, b"ALSA lib pcm.c: underrun\\n")
            view.print("Note: the monitor is blind.")
        with stop.interruptible():
            time.sleep(float(sys.argv[3]))
except StopRequested:
    pass
finally:
    facts |= {"asked": stop.is_requested, "notes": requests.notes(), "paused": requests.paused,
              "continue": requests.take_continue()}
    with open(sys.argv[1], "w") as file:
        json.dump(facts, file)
"""
"""A program with nothing but the operator's view beside it; what became of it goes into a file."""


class View(Terminal):
    """An operator's view on a pseudo-terminal."""

    def __init__(self, folder: Path, phase: str = "ready") -> None:
        self._facts = folder / "facts.json"
        command = [sys.executable, "-c", BESIDE, str(self._facts), phase, "50"]
        super().__init__(command, env={"TERM": "xterm", "COLUMNS": "100"})
        self.settings = termios.tcgetattr(self._keyboard)

    def facts(self) -> dict[str, object]:
        facts: dict[str, object] = json.loads(self._facts.read_text("utf-8"))
        return facts

    def is_unchanged(self) -> bool:
        """Return whether the terminal has the settings and the cursor that it had."""
        shown, hidden = (self.shown.rfind(b"\x1b[?25" + how) for how in (b"h", b"l"))
        return termios.tcgetattr(self._keyboard) == self.settings and shown >= hidden


@pytest.fixture
def view(tmp_path: Path) -> Iterator[View]:
    with View(tmp_path) as view:
        view.expect(b"right timeout")
        view.expect(b"s stop")
        yield view


def test_the_view_shows_how_far_the_session_is_and_no_level(view: View) -> None:
    for shown in (b"11 of 155", b"2 of 5", b"10 min", b"plays", b"5 of 6", b"4 of 5", b"timeout"):
        assert shown in view.shown
    assert b"vpp" not in view.shown.lower()


def test_keys_are_commands_and_lines_of_libraries_stand_below_the_panel(view: View) -> None:
    view.press(b"n")
    view.expect(b"Esc discards")
    view.press("chair moved, späť\n".encode())
    view.expect(b"Noted")
    view.press(b"p")
    view.expect(b"pause follows")
    view.press(b"r")
    assert b"ALSA" not in view.shown
    view.press(b"s")
    assert view.ended() == 0
    facts = view.facts()
    assert facts["notes"] == ["chair moved, späť"]
    assert (facts["asked"], facts["paused"], facts["continue"]) == (True, False, True)
    assert view.is_unchanged()
    *_, panel, below, end = re.sub(r"\x1b\[[?\d]*[a-zA-Z]", "", view.shown.decode()).split("\r\n")
    assert (panel.rpartition("\r")[2][:5], below, end) == ("right", "ALSA lib pcm.c: underrun", "")
    assert b"Note: the monitor is blind.\r\n" in view.shown


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, None])
def test_the_terminal_is_as_it_was_after_a_signal_or_closed(
    view: View, number: signal.Signals | None
) -> None:
    if number is None:
        view.close()
        assert view.process.wait(PATIENCE_S) == 0
    else:
        view.process.send_signal(number)
        assert view.ended() == 0
        assert view.is_unchanged()
    assert view.facts()["asked"] is True


def test_nothing_is_drawn_while_an_answer_is_awaited_and_in_a_pipe_there_is_no_thread(
    tmp_path: Path,
) -> None:
    with View(tmp_path, "answer") as view:
        view.read(time.monotonic() + 1.5)
        assert b"11 of 155" not in view.shown
    done = subprocess.run(
        [sys.executable, "-c", BESIDE, str(tmp_path / "facts.json"), "ready", "0"],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=True,
    )
    assert (done.stdout, done.stderr) == (b"", b"")
    assert view.facts() | {"threads": 1, "rich": False} == view.facts()
