"""A person at a window: real windows under Xvfb, real keys by xdotool, real processes killed."""

from __future__ import annotations

import csv
import importlib.util
import json
import os
import shutil
import signal
import statistics
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest

from experiment.archive import SessionFolder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

REQUIRED = os.environ.get("TACTSTRIP_SCREEN") == "required"
LONGEST_S = 40.0
STUDY = """
[design]
levels_vpp = [80, 160]
trials_per_side = 3
both_trials = 1
break_every = 4
practice_trials = 2
responses = ["left", "right", "both", "none"]
foreperiod_s = [0.6, 0.7]
response_window_s = 1.0
minimum_break_s = 1

[masking]
noise = "none"

[burst]
window = "hann"
"""
WINDOW = """
[screen]
full_screen = false
"""


def missing() -> str | None:
    """Say what a participant's window lacks here."""
    tools = [tool for tool in ("Xvfb", "xdotool") if shutil.which(tool) is None]
    packages = [name for name in ("psychopy", "Xlib") if importlib.util.find_spec(name) is None]
    return f"not installed: {', '.join(tools + packages)}" if tools or packages else None


@pytest.fixture(scope="module")
def display(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """An environment with a screen of its own and an empty home."""
    if reason := missing():
        assert not REQUIRED, reason
        pytest.skip(reason)
    home = tmp_path_factory.mktemp("home")
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x720x24", "-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL) as server:
        os.close(write)
        with os.fdopen(read) as told:
            number = told.readline().strip()
        yield os.environ | {"DISPLAY": f":{number}", "HOME": str(home), "OPENBLAS_NUM_THREADS": "1"}
        server.terminate()


class Sitting:
    """A session at a window, followed by its journal; keys are pressed as a person would."""

    def __init__(self, root: Path, environment: dict[str, str]) -> None:
        self.root = root
        self.environment = environment
        self.presses_wall_s: list[float] = []
        self.seen: list[dict[str, object]] = []
        self._process: subprocess.Popen[str] | None = None
        self.study = root / "study.toml"
        self.study.write_text(STUDY, encoding="utf-8")

    @property
    def folder(self) -> SessionFolder:
        return SessionFolder(self.root / "results", "01", "01")

    @property
    def process(self) -> subprocess.Popen[str]:
        assert self._process is not None
        return self._process

    def start(self, *more: str) -> None:
        self.seen = self.journal()
        self._process = subprocess.Popen(
            [sys.executable, "-c", "from tactstrip import main; main()", "run", str(self.study), "--participant", "01",
             "--responder", "screen", "--driver", "mock", "--out", str(self.root / "results"),
             *more],
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )  # fmt: skip

    def press(self, *words: str) -> float:
        """Press keys; return when, on the wall clock."""
        now_s = time.time()
        subprocess.run(["xdotool", *words], env=self.environment, check=True)
        return now_s

    def journal(self) -> list[dict[str, object]]:
        path = self.folder.journal_path
        if not path.exists():
            return []
        whole = path.read_bytes().rpartition(b"\n")[0]
        return [json.loads(line) for line in whole.splitlines()]

    def wait_for(self, *events: str, going_on: bool = False) -> dict[str, object]:
        """Return the next of some events, pressing Enter meanwhile where asked to."""
        until_s, next_press_s = time.monotonic() + LONGEST_S, 0.0
        while time.monotonic() < until_s:
            entries = self.journal()
            while len(self.seen) < len(entries):
                self.seen.append(entries[len(self.seen)])
                if self.seen[-1]["event"] in events:
                    return self.seen[-1]
            if self.process.poll() is not None:
                break
            if going_on and time.monotonic() > next_press_s:
                self.press("key", "Return")
                next_press_s = time.monotonic() + 0.25
            time.sleep(0.005)
        self.process.kill()
        pytest.fail(f"none of {events} came; {self.process.communicate()}")

    def answer(self, *words: str, after_s: float = 0.25) -> None:
        """Go on until the next stimulus, press some time after it, and wait for the trial's end."""
        self.wait_for("stimulus_commanded", going_on=True)
        time.sleep(after_s)
        if words:
            self.presses_wall_s.append(self.press(*words))
        self.wait_for("trial_end")

    def end(self) -> tuple[int, str, str]:
        """Press Enter until the process ends."""
        until_s = time.monotonic() + LONGEST_S
        while self.process.poll() is None and time.monotonic() < until_s:
            self.press("key", "Return")
            time.sleep(0.25)
        self.process.kill()
        out, err = self.process.communicate()
        return self.process.returncode, out, err

    def rows(self) -> list[dict[str, str]]:
        with (self.folder.path / "trials.csv").open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))


@pytest.fixture
def sitting(display: dict[str, str], tmp_path: Path) -> Iterator[Sitting]:
    sitting = Sitting(tmp_path, display)
    yield sitting
    if sitting._process is not None and sitting.process.poll() is None:
        sitting.process.kill()
        sitting.process.communicate()


def assert_stopped_at_zero(sitting: Sitting, ended: tuple[int, str, str]) -> None:
    code, out, err = ended
    assert code == 4, (out, err)
    assert "--resume" in err
    assert len(err.splitlines()) == 1
    entries = sitting.journal()
    assert entries[-1]["event"] == "session_close"
    assert entries[-1]["finished"] is False


def assert_complete(sitting: Sitting) -> None:
    planned = [trial.number for trial in sitting.folder.read_plan().trials]
    answered = [int(row["trial"]) for row in sitting.rows() if row["status"] == "ok"]
    assert sorted(number for number in answered if number in planned) == planned  # no warm-up


def test_a_session_records_what_was_pressed_from_welcome_to_end(
    sitting: Sitting, capsys: pytest.CaptureFixture[str]
) -> None:
    sitting.start("--seed", "5")
    sitting.answer("key", "Left")  # practice
    sitting.answer("key", "Right")
    sitting.answer("key", "Left")
    sitting.answer("keydown", "Right")
    time.sleep(0.2)
    sitting.press("keyup", "Right")  # in the foreperiod of the next trial: no new press
    time.sleep(0.1)
    sitting.press("key", "Down")  # before the onset
    early = sitting.wait_for("trial_end")
    sitting.answer("key", "Down")
    sitting.wait_for("stimulus_commanded")  # the early one again
    time.sleep(0.2)
    sitting.press("key", "Escape")
    sitting.wait_for("pause")
    time.sleep(0.5)
    assert sitting.journal()[-1]["event"] == "pause", "a pause lasts until somebody goes on"
    sitting.answer()  # after Enter, the same once more: no press
    sitting.wait_for("break")
    sitting.press("key", "Return")  # too soon
    sitting.answer("key", "--delay", "0", "Right")  # shorter than a frame
    sitting.answer("key", "space")
    sitting.answer("key", "Down")
    code, out, err = sitting.end()
    assert code == 0, (out, err)
    assert err == ""
    rows = [row for row in sitting.rows() if row["kind"] != "practice"]
    assert [(row["response"], row["status"]) for row in rows] == [
        ("left", "ok"), ("right", "ok"), ("n/a", "voided"), ("both", "ok"), ("n/a", "voided"),
        ("timeout", "ok"), ("right", "ok"), ("none", "ok"), ("both", "ok"),
    ]  # fmt: skip
    assert [row["anticipated"] for row in rows].count("true") == 1
    assert early["status"] == "voided"
    practice = [row["response"] for row in sitting.rows() if row["kind"] == "practice"]
    assert practice == ["left", "right"]
    assert_complete(sitting)
    with capsys.disabled():
        print(f"\n{timing(sitting)}")


def timing(sitting: Sitting) -> str:
    """Compare reaction times with when xdotool was started."""
    beside_ms = []
    presses = iter(sitting.presses_wall_s)
    onset_wall_s = 0.0
    for entry in sitting.journal():
        if entry["event"] == "stimulus_confirmed" and entry["onset_s"] is not None:
            wall_s, t_s, onset_s = (float(str(entry[k])) for k in ("wall_s", "t_s", "onset_s"))
            onset_wall_s = wall_s - t_s + onset_s
        if entry["event"] == "response" and entry["rt_s"] is not None:
            pressed_s = next(presses) - onset_wall_s
            beside_ms.append(1e3 * (float(str(entry["rt_s"])) - pressed_s))
    return (
        f"reaction time after the start of xdotool: {min(beside_ms):.1f} to {max(beside_ms):.1f} ms, "
        f"median {statistics.median(beside_ms):.1f} ms, {len(beside_ms)} presses"
    )


def test_escape_twice_stops_and_resume_completes(sitting: Sitting) -> None:
    sitting.start()
    sitting.answer("key", "Left")
    sitting.wait_for("stimulus_commanded", going_on=True)
    sitting.press("key", "Escape")
    sitting.wait_for("pause")
    sitting.press("key", "Escape")
    assert_stopped_at_zero(sitting, sitting.end())
    complete_after_resume(sitting)


def complete_after_resume(sitting: Sitting) -> None:
    sitting.start("--resume")
    answer_to_the_end(sitting)
    code, out, err = sitting.end()
    assert code == 0, (out, err)
    assert_complete(sitting)


def answer_to_the_end(sitting: Sitting) -> None:
    while True:
        entry = sitting.wait_for("stimulus_commanded", "session_close", going_on=True)
        if entry["event"] == "session_close":
            return
        time.sleep(0.12)
        sitting.press("key", "Left")


def terminate(sitting: Sitting) -> None:
    sitting.process.send_signal(signal.SIGTERM)


def close_window(sitting: Sitting) -> None:
    """Ask the window to close, as its frame does."""
    from Xlib import X, display
    from Xlib.protocol.event import ClientMessage

    server = display.Display(sitting.environment["DISPLAY"])
    protocols = server.intern_atom("WM_PROTOCOLS")
    for window in server.screen().root.query_tree().children:
        if window.get_wm_name() == "tactstrip":
            data = (32, [server.intern_atom("WM_DELETE_WINDOW"), X.CurrentTime, 0, 0, 0])
            message = ClientMessage(window=window, client_type=protocols, data=data)
            window.send_event(message)
    server.close()


@pytest.mark.parametrize("stop", [terminate, close_window])
@pytest.mark.parametrize("when", ["welcome", "foreperiod", "answer", "pause"])
def test_a_stop_from_outside_is_heeded_in_every_wait(
    sitting: Sitting, stop: Callable[[Sitting], None], when: str
) -> None:
    sitting.start()
    if when == "welcome":
        sitting.wait_for("session_open")
        time.sleep(1.0)
    else:
        sitting.answer("key", "Left")
    if when == "foreperiod":
        time.sleep(1.2)  # after the feedback
    if when in {"answer", "pause"}:
        sitting.wait_for("stimulus_commanded")
        time.sleep(0.1)
    if when == "pause":
        sitting.press("key", "Escape")
        sitting.wait_for("pause")
        time.sleep(0.1)
    stop(sitting)
    sitting.process.wait(timeout=10)
    assert_stopped_at_zero(sitting, sitting.end())


def test_a_session_killed_ten_times_is_complete_in_the_end(sitting: Sitting) -> None:
    places = ["session_open", "block_start", "trial_armed", "stimulus_commanded",
              "stimulus_confirmed", "response", "trial_end", "block_end", "break",
              "stimulus_commanded"]  # fmt: skip
    for place in places:
        sitting.start(*(["--resume"] if sitting.seen else []))
        while True:
            entry = sitting.wait_for(
                place, "stimulus_commanded", "session_close", "session_resume", going_on=True
            )
            if entry["event"] == place or (place, entry["event"]) == (
                "session_open",
                "session_resume",
            ):
                break
            assert entry["event"] != "session_close", f"{place} came too late"
            if entry["event"] == "stimulus_commanded":
                time.sleep(0.12)
                sitting.press("key", "Left")
        sitting.process.kill()
        sitting.process.communicate()
        assert sitting.process.returncode == -signal.SIGKILL
    complete_after_resume(sitting)
    rows = sitting.rows()
    assert {row["status"] for row in rows} <= {"ok", "voided", "aborted", "indeterminate"}
