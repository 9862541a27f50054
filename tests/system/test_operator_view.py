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

pytestmark = pytest.mark.process
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

def paused(view):
    stand(view, phase="paused")

def many(view):
    for done in range(1500):
        view.show(status(done=done, message="x" * 60))
        time.sleep(0.001)
    told["shown"] = done

def fail(view):
    view.show(status())
    time.sleep(0.3)
    raise RuntimeError("a fault of the session")

def deaf(view):
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with open(sys.argv[2] + ".deaf", "w"):
        pass
    for done in range(20):
        view.show(status(done=done))
        time.sleep(0.1)
    told["shown"] = done

if "own" in sys.argv:
    import fcntl, termios
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
if "behind" in sys.argv:
    if os.fork():
        os.wait()
        os._exit(0)
    os.setpgid(0, 0)
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

SESSION = """
import sys
from pathlib import Path
from device.clock import MonotonicClock
from device.emulate.mock import DEVICE_LIMITS, MockDevice
from experiment.apparatus.noise import SilentNoise
from experiment.archive.folders import SessionFolder
from experiment.operator.requests import Requests, StopSignal
from experiment.operator.view import OperatorView
from experiment.preview.check import check_study
from experiment.session.conduct import begin
from experiment.session.setting import Setting
from experiment.study.read import read_study
from experiment.trial.draw import draw_plan
from tests.test_experiment.lab import Scripted

requests, stop, clock = Requests(), StopSignal(), MonotonicClock()

class Patient(Scripted):
    def pause(self, progress, *, paused, minimum_s):
        while not requests.take_go_on():
            clock.wait(0.02)
        return True

study = read_study(Path(sys.argv[1]))
plan = draw_plan(study, participant="01", session="01", seed=1, gains=check_study(study).gains)
folder = SessionFolder(Path(sys.argv[2]), "01", "01")
device = MockDevice(clock, limits=DEVICE_LIMITS)
with stop.on_signals(), OperatorView(requests, stop) as view:
    setting = Setting(device=device, responder=Patient(clock), noise=SilentNoise(study.masking),
                      clock=clock, stop=stop, requests=requests, display=view)
    ending = begin(folder, plan, setting)
print("finished" if ending.finished else "stopped early")
"""
"""A whole session over the mock device; nobody answers, but the operator's keys are real."""


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
            [sys.executable, "-c", *command], stdin=near, stdout=near, stderr=near,
            start_new_session="own" in command, process_group=None if "own" in command else 0,
            env=os.environ | {"TERM": "xterm", "COLUMNS": "100"},
            cwd=Path(front_door).parent,
        )  # fmt: skip

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


def test_the_view_says_where_the_session_stands(idle: Terminal) -> None:
    idle.expect("11 of 155 trials done   block 2 of 5   ready   10 min left")
    shown = ("device  ready", "noise   plays", "left    5 of 6 correct", "left both",
             "right   4 of 5 correct", "right timeout")  # fmt: skip
    for words in shown:
        assert idle.screen.has(words), idle.screen.lines
    assert "vpp" not in idle.seen.lower()


def test_each_picture_takes_the_place_of_the_last(told_path: Path) -> None:
    with beside("progress", told_path) as terminal:
        terminal.expect("put the cup away")
        assert sum("trials done" in line for line in terminal.screen.lines) == 1
        assert terminal.screen.has("99 of 155")
        assert "12 of 155" in terminal.seen


def test_nothing_is_drawn_while_an_answer_is_awaited_unless_a_key_is_typed(told_path: Path) -> None:
    with beside("answer", told_path) as terminal:
        terminal.expect("the session begins")
        terminal.read(0.5)
        assert "77 of 155" not in terminal.seen
        terminal.type("n")
        terminal.expect("77 of 155")


def test_a_pause_is_asked_for_by_p_and_ended_by_r(idle: Terminal, told_path: Path) -> None:
    idle.type("p")
    idle.expect("a pause follows this trial")
    idle.type("r")
    idle.until(lambda: not idle.screen.has("a pause follows this trial"))
    idle.stop()
    assert told(told_path) | {"paused": False, "go_on": True} == told(told_path)


def test_a_resume_is_not_kept_for_the_next_pause(idle: Terminal, told_path: Path) -> None:
    idle.type("r")
    idle.expect("nothing is paused")
    idle.stop()
    assert told(told_path)["go_on"] is False


def test_a_pause_that_another_asked_for_is_ended_by_r(told_path: Path) -> None:
    with beside("paused", told_path) as terminal:
        terminal.expect("paused")
        terminal.stop("r")
    assert told(told_path)["go_on"] is True


def test_a_note_is_written_corrected_and_kept(idle: Terminal, told_path: Path) -> None:
    idle.type("nchair mow")
    idle.expect("note: chair mow_")
    idle.type("\x7fved, späť\r")
    idle.expect("noted: chair moved, späť")
    idle.type("nnever mind\x1b")
    idle.until(lambda: not idle.screen.has("never mind"))
    idle.stop()
    assert told(told_path)["notes"] == ["chair moved, späť"]


def test_an_arrow_that_arrives_in_pieces_drops_no_note(idle: Terminal, told_path: Path) -> None:
    idle.type("nchair")
    idle.expect("note: chair_")
    for piece in ("\x1b", "[D", " moved\r"):
        idle.type(piece)
        time.sleep(0.01)
    idle.expect("noted: chair moved")
    idle.stop()
    assert told(told_path)["notes"] == ["chair moved"]


def test_a_stop_has_to_be_confirmed_and_ends_a_wait(idle: Terminal, told_path: Path) -> None:
    for key in "ny":
        idle.expect("p pause")
        idle.type("s")
        idle.expect("stop the session?   y / n")
        assert idle.process.poll() is None
        idle.type(key)
    assert idle.ended() == 0
    assert told(told_path)["asked"] is True


def test_keys_typed_before_the_view_are_not_taken_for_it(told_path: Path) -> None:
    with beside("idle", told_path) as terminal:
        terminal.type("sy\n")
        terminal.expect("p pause")
        terminal.read(0.3)
        assert terminal.process.poll() is None
        assert not terminal.screen.has("stop the session")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_the_terminal_is_given_back_by_a_signal(idle: Terminal, number: signal.Signals) -> None:
    assert not idle.by_line
    idle.process.send_signal(number)
    assert idle.ended() == 0
    assert idle.given_back()
    assert not idle.screen.has("p pause")


def test_the_terminal_is_given_back_when_the_session_fails(told_path: Path) -> None:
    with beside("fail", told_path) as terminal:
        assert terminal.ended() == 1
        assert terminal.given_back()


def test_a_suspended_program_gives_the_terminal_back(idle: Terminal, told_path: Path) -> None:
    for _ in range(3):
        idle.process.send_signal(signal.SIGTSTP)
        _, how = os.waitpid(idle.process.pid, os.WUNTRACED)
        assert os.WIFSTOPPED(how)
        idle.read()
        assert idle.given_back()
        idle.process.send_signal(signal.SIGCONT)
        idle.until(lambda: not idle.by_line)
        idle.expect("p pause")
    idle.stop("nstill here\r")
    assert idle.given_back()
    assert told(told_path)["notes"] == ["still here"]


def test_where_no_shell_could_continue_it_the_program_is_not_halted(told_path: Path) -> None:
    with beside("idle", told_path, "own") as terminal:
        terminal.expect("p pause")
        terminal.process.send_signal(signal.SIGTSTP)
        terminal.until(lambda: terminal.seen.count("\x1b[?25l") == 2)
        terminal.stop("nstill here\r")
    assert told(told_path)["notes"] == ["still here"]


def test_settings_changed_while_it_was_halted_are_those_given_back(idle: Terminal) -> None:
    idle.process.send_signal(signal.SIGSTOP)
    os.waitpid(idle.process.pid, os.WUNTRACED)
    termios.tcsetattr(idle.near, termios.TCSANOW, idle.settings)
    idle.process.send_signal(signal.SIGCONT)
    idle.until(lambda: not idle.by_line)
    idle.stop()
    assert idle.given_back()


def test_a_terminal_that_is_closed_stops_the_session_by_its_signal(told_path: Path) -> None:
    with beside("idle", told_path, "own") as terminal:
        terminal.expect("p pause")
        terminal.hang_up()
        assert terminal.process.wait(PATIENCE_S) == 0
    assert told(told_path)["asked"] is True


def test_where_that_signal_is_ignored_the_session_goes_on_without_a_view(told_path: Path) -> None:
    with beside("deaf", told_path, "own") as terminal:
        terminal.until(Path(f"{told_path}.deaf").exists)
        terminal.hang_up()
        assert terminal.process.wait(PATIENCE_S) == 0
    assert told(told_path)["shown"] == 19


def test_a_terminal_whose_output_is_held_holds_nothing_up(told_path: Path) -> None:
    with beside("many", told_path) as terminal:
        termios.tcflow(terminal.near, termios.TCOOFF)
        assert terminal.process.wait(PATIENCE_S) == 0
        assert told(told_path)["shown"] == 1499
        assert termios.tcgetattr(terminal.near) == terminal.settings
        assert not terminal.read()


def test_in_the_background_of_a_shell_there_is_neither_view_nor_halt(told_path: Path) -> None:
    with beside("many", told_path, "own", "behind") as terminal:
        assert told(told_path)["shown"] == 1499
        terminal.read()
        assert not terminal.seen


@pytest.mark.parametrize("piped", ["stdin", "stdout"])
def test_in_a_pipe_it_is_silent_and_has_no_thread(told_path: Path, piped: str) -> None:
    far, near = pty.openpty()
    pipe = subprocess.PIPE
    done = subprocess.Popen(
        [sys.executable, "-c", BESIDE, "many", str(told_path)],
        stdin=pipe if piped == "stdin" else near, stdout=pipe if piped == "stdout" else near,
        stderr=pipe, cwd=Path(front_door).parent,
    )  # fmt: skip
    assert done.communicate(timeout=PATIENCE_S) in {(None, b""), (b"", b"")}
    assert not select.select([far], [], [], 0)[0]
    os.close(far)
    os.close(near)
    assert told(told_path) | {"threads": 1, "rich": False} == told(told_path)


def test_a_whole_session_heeds_the_operators_keys(tmp_path: Path, quick_study_text: str) -> None:
    study_path = tmp_path / "study.toml"
    text = '[masking]\nnoise = "none"\n' + quick_study_text + "minimum_break_s = 0\n"
    study_path.write_text(text, encoding="utf-8")
    with Terminal(SESSION, str(study_path), str(tmp_path / "results")) as terminal:
        terminal.expect("0 of 5 trials done")
        terminal.type("p")
        terminal.expect("1 of 5 trials done   block 1 of 2   paused")
        assert terminal.screen.has("no noise")
        terminal.type("ncup moved\rr")
        terminal.expect("3 of 5 trials done   block 2 of 2   break")
        terminal.type("r")
        terminal.expect("4 of 5 trials done")
        terminal.type("sy")
        terminal.until(lambda: "stopped early" in terminal.seen)
        assert termios.tcgetattr(terminal.near) == terminal.settings
    folder = tmp_path / "results" / "sub-01" / "ses-01"
    assert (folder / "trials.csv").read_text("utf-8").count(",ok,") == 4
    journal = (folder / "journal.jsonl").read_text("utf-8")
    assert '"event":"note"' in journal
    assert "cup moved" in journal
