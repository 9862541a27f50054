"""A person at a window: real windows under Xvfb, real keys by xdotool, real processes killed."""

from __future__ import annotations

import contextlib
import csv
import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from experiment import SessionFolder
from tests.plates import PAPER_PLATE
from tests.processes import require

if TYPE_CHECKING:
    from collections.abc import Iterator

LONGEST_S = 40.0
STUDY = f"""{PAPER_PLATE}
[design]
levels_vpp = [80, 160]
trials_per_side = 3
both_trials = 1
break_every = 4
practice_trials = 2
responses = ["left", "right", "both", "none"]
foreperiod_s = [0.6, 0.7]
response_window_s = 1.0
min_break_s = 1
[masking]
noise = "none"
[burst]
window = "hann"
[screen]
full_screen = false
index = 0
"""
SHORT = STUDY.replace("_side = 3", "_side = 1").replace("practice_trials = 2", "")
SHORT = SHORT.replace("[0.6, 0.7]", "[0.3, 0.4]").replace("response_window_s = 1.0", "")
TACTSTRIP = (sys.executable, "-c", "from tactstrip import main; main()", "run")
AT_A_SCREEN = (
    *("--participant", "01", "--responder", "screen", "--driver", "mock"),
    *("--practice-without-device", "--out"),
)


def missing() -> list[str]:
    """List what a participant's window lacks here."""
    tools = [tool for tool in ("Xvfb", "xdotool") if shutil.which(tool) is None]
    packages = [name for name in ("psychopy", "Xlib") if importlib.util.find_spec(name) is None]
    return tools + packages


@contextlib.contextmanager
def x_server(home: Path) -> Iterator[tuple[subprocess.Popen[bytes], dict[str, str]]]:
    """A screen of its own, and the environment of who uses it."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x720x24"]
    command += ["-nolisten", "tcp", "-noreset"]
    with subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL) as server:
        os.close(write)
        with os.fdopen(read) as told:
            number = told.readline().strip()
        environment = os.environ | {"DISPLAY": f":{number}", "HOME": str(home)}
        try:
            yield server, environment | {"OPENBLAS_NUM_THREADS": "1", "PYTHONFAULTHANDLER": "1"}
        finally:
            server.terminate()


@pytest.fixture(scope="module")
def display(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """An environment with a screen of its own and an empty home."""
    require("screen", missing())
    with x_server(tmp_path_factory.mktemp("home")) as (_, environment):
        yield environment


class Sitting:
    """A session at a window, followed by its journal; keys are pressed as a person would."""

    def __init__(self, root: Path, environment: dict[str, str]) -> None:
        self.root = root
        self.environment = environment

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

    def start(self, *more: str, study: str = "") -> None:
        """Start or resume a session, of another study if there is one."""
        if study:
            self.study.write_text(study, encoding="utf-8")
        self.seen = self.journal()
        self._process = subprocess.Popen(
            [*TACTSTRIP, self.study, *AT_A_SCREEN, self.root / "results", *more],
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def press(self, *words: str) -> None:
        """Press keys."""
        subprocess.run(["xdotool", *words], env=self.environment, check=True)

    def focus(self, name: str) -> None:
        """Give the keyboard to a window."""
        from Xlib import X, display

        server = display.Display(self.environment["DISPLAY"])
        root = server.screen().root
        found = [window for window in root.query_tree().children if window.get_wm_name() == name]
        (found[0] if found else root).set_input_focus(X.RevertToParent, X.CurrentTime)
        server.sync()
        server.close()
        time.sleep(0.05)

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
            self.press(*words)
        self.wait_for("trial_end")

    def end(self, *, pressing: bool = True) -> tuple[int, str, str]:
        """Wait for the process to end, pressing Enter meanwhile; where it hangs, tell where."""
        until_s = time.monotonic() + (LONGEST_S if pressing else 10.0)
        while self.process.poll() is None and time.monotonic() < until_s:
            if pressing:
                self.press("key", "Return")
            time.sleep(0.25)
        self.process.send_signal(signal.SIGABRT)  # with a traceback, see PYTHONFAULTHANDLER
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


def assert_complete(sitting: Sitting) -> None:
    planned = [trial.number for trial in sitting.folder.read_plan().trials]
    answered = [int(row["trial"]) for row in sitting.rows() if row["status"] == "ok"]
    assert sorted(number for number in answered if number in planned) == planned  # no warm-up


def test_a_session_records_what_was_pressed_from_welcome_to_end(sitting: Sitting) -> None:
    sitting.start("--seed", "5")
    sitting.wait_for("stimulus_commanded", going_on=True)  # practice
    sitting.focus("root")
    sitting.press("key", "Right")  # in the operator's window: no answer
    sitting.focus("tactstrip")
    sitting.press("key", "Left")
    sitting.wait_for("trial_end")
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
    assert (code, err) == (0, ""), out
    rows = [row for row in sitting.rows() if row["kind"] != "practice"]
    answers = ("left", "right", "n/a", "both", "n/a", "timeout", "right", "none", "both")
    assert [row["response"] for row in rows] == [*answers]
    assert {row["status"] for row in rows if row["response"] == "n/a"} == {"voided"}
    assert [row["status"] for row in rows].count("ok") == 7
    assert [row["premature"] for row in rows].count("true") == 1
    assert early["status"] == "voided"
    practice = [row["response"] for row in sitting.rows() if row["kind"] == "practice"]
    assert practice == ["left", "right"]
    assert_complete(sitting)


@pytest.mark.parametrize("how", ["signal", "windowkill", "windowclose"])
def test_a_stop_from_outside_is_heeded_and_the_session_completed_by_a_resume(
    sitting: Sitting, how: str
) -> None:
    sitting.start(study=SHORT)
    sitting.wait_for("stimulus_commanded", going_on=True)
    time.sleep(0.1)
    if how == "signal":
        sitting.process.send_signal(signal.SIGTERM)
    else:
        sitting.press("search", "--name", "tactstrip", how)
    code, out, err = sitting.end(pressing=False)
    if how == "signal":
        assert (code, err.count("\n"), "--resume" in err) == (4, 1, True), (out, err)
        closed = sitting.journal()[-1]
        assert (closed["event"], closed["finished"]) == ("session_close", False)
    else:  # Xlib ends a program whose window or connection is destroyed
        assert code != 0, (out, err)
    sitting.start("--resume")
    while (
        sitting.wait_for("stimulus_commanded", "session_close", going_on=True)["event"]
        != "session_close"
    ):
        time.sleep(0.12)
        sitting.press("key", "Left")
    code, out, err = sitting.end()
    assert code == 0, (out, err)
    assert_complete(sitting)


def test_every_page_is_drawn_within_its_window(display: dict[str, str], tmp_path: Path) -> None:
    import numpy as np
    from matplotlib.image import imread

    script = Path(__file__).parents[2] / "docs" / "screens" / "draw.py"
    subprocess.run([sys.executable, script, tmp_path], env=display, check=True)
    drawn = {path.relative_to(tmp_path): imread(path) for path in tmp_path.rglob("*.png")}
    assert {path.relative_to(script.parent) for path in script.parent.rglob("*.png")} <= set(drawn)
    for name, picture in drawn.items():
        inside = picture[8:-8, 8:-8, :3]
        around = np.abs(picture[..., :3] - picture[4, 4, :3]).sum(axis=2)
        around[8:-8, 8:-8] = 0.0
        assert around[:-1].max() < 0.05, f"{name}: something is cut off"
        assert np.ptp(inside) > 0.3, f"{name}: empty"
