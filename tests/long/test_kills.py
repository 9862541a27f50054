"""Sessions killed before changes of the disk, and at random times at real ends of the program."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from click.testing import CliRunner

from experiment import examine
from tactstrip import main
from tests.long.test_fuzz import rounds
from tests.processes import require
from tests.system.test_links import over, require_true
from tests.system.test_terminal import ENTER, GO_ON, LATER_S, LEFT, run
from tests.system.test_window import SHORT, Sitting, missing, x_server
from tests.test_experiment.sessions import COMMAND, Sessions

if TYPE_CHECKING:
    from collections.abc import Callable


CHANGES = ((os, ("write", "fsync", "unlink", "rmdir", "mkdir")), (Path, ("replace", "rename")))


WINDOW = SHORT.replace("_side = 1", "_side = 4")
"""More trials than a resume presents again for a warm-up."""


class Watched:
    """A session that is killed, again and again: what its record held must stay in it."""

    def __init__(self, sessions: Sessions) -> None:
        self._sessions = sessions
        self._answers: dict[tuple[str, str], object] = {}
        self.kills = 0

    def killed(self) -> list[str]:
        """Look at what a kill left; return the option with which it goes on."""
        self.kills += 1
        folder = self._sessions.folder()
        if folder.journal_path.exists():
            for line in self._sessions.lines("response"):
                name = str(line["trial"]), str(line["attempt"])
                assert self._answers.setdefault(name, line["response"])
        if not folder.plan_path.exists():
            return []
        amiss = examine(folder.path).differences
        assert {one.remedy for one in amiss} <= {"resume"}, amiss
        return ["--resume"]

    def ended(self) -> None:
        """Look at a session that came to its end after all."""
        told = CliRunner().invoke(main, ["verify", str(self._sessions.out)])
        assert told.exit_code == 0, told.output
        rows = {(row["trial"], row["attempt"]): row for row in self._sessions.rows()}
        assert len(rows) == len(self._sessions.rows())
        ok = Counter(int(trial) for (trial, _), row in rows.items() if row["status"] == "ok")
        planned = [trial.number for trial in self._sessions.folder().read_plan().trials]
        assert [ok[number] for number in planned] == [1] * len(planned)
        assert {name: rows[name]["response"] for name in self._answers} == self._answers
        armed = {
            line["token"]: (str(line["trial"]), str(line["attempt"]), line["interval"])
            for line in self._sessions.lines("trial_armed")
        }
        assert len(armed) == len({*armed.values()})
        assert sorted({(trial, attempt) for trial, attempt, _ in armed.values()}) == sorted(rows)


def killed(step: int, arguments: list[str]) -> bool:
    """Run a command in a copy of this process, killed before its n-th change of the disk."""
    pid = os.fork()
    if pid:
        status = os.waitpid(pid, 0)[1]
        assert os.WIFSIGNALED(status) or os.waitstatus_to_exitcode(status) == 0, arguments
        return os.WIFSIGNALED(status)
    left = step

    def counted(change: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            nonlocal left
            left -= 1
            if left == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return change(*args, **kwargs)

        return call

    for owner, names in CHANGES:
        for name in names:
            setattr(owner, name, counted(getattr(owner, name)))
    os._exit(CliRunner().invoke(main, arguments).exit_code)


TWO_INTERVALS = """
[task]
kind = "2ifc"
gap_s = 0.1
[levels]
rule = "bayesian"
"""


@pytest.mark.parametrize("more_text", ["", TWO_INTERVALS], ids=["left-right-both", "2ifc-bayesian"])
def test_a_session_killed_thousands_of_times_loses_and_doubles_nothing(
    tmp_path: Path, quick_study_text: str, more_text: str
) -> None:
    text = quick_study_text
    if more_text:
        text = text.replace("both_trials = 1\n", "") + more_text
    kills = number = 0
    while kills < rounds(1000):
        number += 1
        rng = np.random.default_rng(number)
        sessions = Sessions(tmp_path / f"{number}", text)
        watched = Watched(sessions)
        more = ["--seed", str(rng.integers(2**31))]
        run = ["--responder", "simulated"]
        while killed(int(rng.integers(1, 40)), sessions.words(*run, *more)):
            more = watched.killed() or more
        watched.ended()
        kills += watched.kills
    print(f"{kills} kills in {number} sessions")


def kill_at_random(sessions: Sessions, rng: np.random.Generator, *options: str) -> int:
    """Start a session and kill it at random times until it ends; return the number of kills."""
    watched, more = Watched(sessions), ["--seed", str(rng.integers(2**31))]
    while True:
        with run(sessions, *options, *more) as terminal:
            until_s = np.inf  # counted from the first line, for a busy machine starts slowly
            while terminal.process.poll() is None and time.monotonic() < until_s:
                if terminal.read(time.monotonic() + 0.05) and until_s == np.inf:
                    until_s = time.monotonic() + float(rng.uniform(0.0, 4.0))
                if terminal.take(GO_ON):
                    terminal.press(ENTER)
                if terminal.take(b" ?"):
                    time.sleep(LATER_S)
                    terminal.press(LEFT)
            has_ended = terminal.process.poll() == 0
            assert terminal.process.poll() in {None, 0}, terminal.shown
        if has_ended:
            break
        more = watched.killed() or more
    watched.ended()
    return watched.kills


def test_a_session_at_a_terminal_killed_at_random_times_loses_and_doubles_nothing(
    tmp_path: Path, quick_study_text: str
) -> None:
    kills = number = 0
    while kills < rounds(200):
        number += 1
        sessions = Sessions(tmp_path / f"{number}", quick_study_text)
        rng = np.random.default_rng(number)
        kills += kill_at_random(sessions, rng)
    print(f"{kills} kills in {number} sessions at a terminal")


def test_a_session_over_a_serial_line_killed_at_random_times_is_what_the_emulator_did(
    tmp_path: Path, quick_study_text: str
) -> None:
    kills = number = 0
    while kills < rounds(200):
        number += 1
        sessions = Sessions(tmp_path / f"{number}", quick_study_text)
        truth = tmp_path / f"{number}.jsonl"
        command = [*COMMAND, "emulate", "--pty", "--truth", str(truth)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as emulator:
            try:
                assert emulator.stdout is not None
                options = over("serial", emulator.stdout.readline().strip())
                rng = np.random.default_rng(number)
                kills += kill_at_random(sessions, rng, *options)
            finally:
                emulator.kill()
        require_true(sessions, truth)
    print(f"{kills} kills in {number} sessions over a serial line")


def kill_at_a_window(sitting: Sitting, more: list[str], rng: np.random.Generator) -> bool:
    """Run a session at a window, killed at a random time after its first line, unless it ended.

    The time is counted from a random line, for a busy machine may take minutes to open a window.
    """
    n_lines = n_before = len(sitting.journal())
    sitting.start(*more)
    n_until, after_s = n_before + rng.integers(1, 40), float(rng.uniform(0.0, 1.0))
    until_s = np.inf
    while sitting.process.poll() is None and time.monotonic() < until_s:
        lines = sitting.journal()
        if until_s == np.inf and len(lines) >= n_until:
            until_s = time.monotonic() + after_s
        if len(lines) > n_lines and lines[-1]["event"] == "stimulus_commanded":
            n_lines = len(lines)
            time.sleep(LATER_S)
            sitting.press("key", "Left")
        elif not lines or lines[-1]["event"] != "trial_armed":
            sitting.press("key", "Return")
        time.sleep(0.05)
    has_ended = sitting.process.poll() is not None
    sitting.process.kill()
    _, errors = sitting.process.communicate()
    assert not has_ended or sitting.process.returncode == 0, errors
    return has_ended


def test_a_session_at_a_window_killed_at_random_times_loses_and_doubles_nothing(
    tmp_path: Path,
) -> None:
    require("screen", missing())
    kills = number = 0
    with x_server(tmp_path) as (_, environment):
        while kills < rounds(30):
            number += 1
            sessions, rng = Sessions(tmp_path / f"{number}", WINDOW), np.random.default_rng(number)
            sitting, watched = Sitting(sessions.out.parent, environment), Watched(sessions)
            sessions.write(WINDOW)
            more = ["--seed", str(rng.integers(2**31))]
            while not kill_at_a_window(sitting, more, rng):
                more = watched.killed() or more
            watched.ended()
            kills += watched.kills
    print(f"{kills} kills in {number} sessions at a window")
