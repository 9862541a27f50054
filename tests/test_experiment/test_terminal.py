"""A person at a real terminal: keys typed into a pseudo-terminal, seen from outside."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Self

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.test_experiment.conftest import Rows

pty = pytest.importorskip("pty", reason="pseudo-terminals are a POSIX feature")

LEFT, RIGHT, DOWN, ESCAPE, ENTER = b"\x1b[D", b"\x1b[C", b"\x1b[B", b"\x1b", b"\n"
PATIENCE_S = 60
LATER_S = 0.2
"""A person takes longer to answer than what counts as anticipated."""


@pytest.fixture
def study_path(tmp_path: Path, quick_study_text: str) -> Path:
    path = tmp_path / "study.toml"
    patient = quick_study_text + "response_window_s = 30\nminimum_break_s = 0\n"
    path.write_text('[masking]\nnoise = "none"\n' + patient, encoding="utf-8")
    return path


class Terminal:
    """`tactstrip run` in a process of its own, with a pseudo-terminal for a keyboard."""

    def __init__(self, study_path: Path, *more: str, env: dict[str, str] | None = None) -> None:
        self._keyboard, inner = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-c", "from tactstrip import main; main()", "run", str(study_path),
             "--participant", "01", "--out", str(study_path.parent / "results"), *more],
            stdin=inner, stdout=inner, stderr=inner, start_new_session=True,
            env=os.environ | (env or {}),
        )  # fmt: skip
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

    def _read(self, until_s: float) -> bool:
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
            assert self._read(until_s), (text, self.shown)
        self._seen = self._seen[self._seen.index(text) + len(text) :]

    def press(self, key: bytes) -> None:
        os.write(self._keyboard, key)

    def answer(self, *keys: bytes) -> None:
        for key in keys:
            self.expect(b" ?")
            time.sleep(LATER_S)
            self.press(key)

    def ended(self) -> int:
        until_s = time.monotonic() + PATIENCE_S
        while self._read(until_s):
            pass
        return self.process.wait(PATIENCE_S)


@pytest.mark.process
def test_what_is_pressed_is_what_is_recorded(study_path: Path, rows_of: Rows) -> None:
    with Terminal(study_path, "--seed", "1") as terminal:
        terminal.answer(LEFT, RIGHT, DOWN)
        terminal.expect(b"Break: 3 of 5 trials are done.")
        terminal.press(ENTER)
        terminal.answer(b"l", b"x")
        assert terminal.ended() == 0, terminal.shown
    recorded = rows_of(study_path.parent / "results")
    assert [row["response"] for row in recorded] == ["left", "right", "both", "left", "invalid"]
    assert {row["simulated"] for row in recorded} == {"false"}
    assert all(0 < float(row["rt_s"]) < 30 for row in recorded)
    folder = str(study_path.parent).encode()
    assert b"160" not in terminal.shown.replace(folder, b"")


@pytest.mark.process
def test_fingers_leave_the_plate_and_come_back_when_it_is_said(
    study_path: Path, rows_of: Rows
) -> None:
    off_plate = 'audibility_trials = 2\ncontrol_trials = 2\n[texts]\ncontrol = "Hände weg"\n'
    study_path.write_text(study_path.read_text(encoding="utf-8") + off_plate, encoding="utf-8")
    with Terminal(study_path, "--seed", "1") as terminal:
        terminal.expect(b"take both hands off the plate")
        terminal.expect(b"none   space or n")
        terminal.press(ENTER)
        terminal.answer(b" ", b"n")
        terminal.expect(b"Lay one finger on each actuator.")
        terminal.press(ENTER)
        terminal.answer(LEFT, LEFT, LEFT)
        terminal.expect(b"Break")
        terminal.press(ENTER)
        terminal.answer(LEFT, LEFT)
        terminal.expect(b"Break")
        terminal.press(ENTER)
        terminal.expect("Hände weg".encode())
        terminal.press(ESCAPE)
        assert terminal.ended() == 4, terminal.shown
    with Terminal(study_path, "--resume") as terminal:
        terminal.expect("Hände weg".encode())
        terminal.press(ENTER)
        terminal.answer(b" ", LEFT)
        assert terminal.ended() == 0, terminal.shown
    recorded = rows_of(study_path.parent / "results")
    control = [row["response"] for row in recorded if row["kind"] == "control"]
    assert control == ["none", "none", "none", "left"]
    assert all(row["status"] == "ok" for row in recorded)


@pytest.mark.process
def test_escape_pauses_and_escape_again_stops_and_the_session_is_resumed(
    study_path: Path,
    rows_of: Rows,
) -> None:
    with Terminal(study_path, "--seed", "1") as terminal:
        terminal.answer(LEFT, ESCAPE)
        terminal.expect(b"Paused: 1 of 5")
        terminal.press(ENTER)
        terminal.answer(LEFT, ESCAPE)
        terminal.expect(b"Paused: 2 of 5")
        terminal.press(ESCAPE)
        assert terminal.ended() == 4, terminal.shown
    assert b"--resume" in terminal.shown
    with Terminal(study_path, "--resume") as terminal:
        terminal.answer(LEFT, RIGHT)
        assert b"practice" in terminal.shown
        terminal.expect(b"right - right")
        terminal.answer(LEFT)
        terminal.expect(b"Break")
        terminal.press(ENTER)
        terminal.answer(LEFT, LEFT)
        assert terminal.ended() == 0, terminal.shown
    statuses = [
        row["status"] for row in rows_of(study_path.parent / "results") if row["kind"] != "practice"
    ]
    assert statuses.count("ok") == 5
    assert statuses.count("voided") == 2


@pytest.mark.process
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_while_an_answer_is_awaited_stops_the_session_safely(
    study_path: Path,
    number: signal.Signals,
    rows_of: Rows,
) -> None:
    with Terminal(study_path, "--seed", "1") as terminal:
        terminal.answer(LEFT)
        terminal.expect(b" ?")
        terminal.process.send_signal(number)
        assert terminal.ended() == 4, terminal.shown
    assert [row["status"] for row in rows_of(study_path.parent / "results")] == ["ok", "voided"]


@pytest.mark.process
def test_a_terminal_that_is_closed_stops_the_session_safely(
    study_path: Path, rows_of: Rows
) -> None:
    with Terminal(study_path, "--seed", "1") as terminal:
        terminal.answer(LEFT)
        terminal.expect(b" ?")
        terminal.close()
        assert terminal.process.wait(PATIENCE_S) == 4
    assert [row["status"] for row in rows_of(study_path.parent / "results")] == ["ok", "voided"]


@pytest.mark.process
def test_a_function_key_is_one_invalid_answer(study_path: Path, rows_of: Rows) -> None:
    with Terminal(study_path, "--seed", "1") as terminal:
        terminal.answer(b"\x1b[15~", b"\x1b[1;5D", LEFT)
        terminal.expect(b"Break")
        terminal.press(ESCAPE)
        assert terminal.ended() == 4
    assert [row["response"] for row in rows_of(study_path.parent / "results")] == [
        "invalid",
        "invalid",
        "left",
    ]


@pytest.mark.process
def test_without_a_terminal_it_says_what_to_use_instead(study_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "from tactstrip import main; main()", "run", str(study_path),
         "--participant", "01", "--out", str(study_path.parent / "results")],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "--responder simulated" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (study_path.parent / "results").exists()


OFF_PLATE = 'audibility_trials = 2\n[texts]\ncontrol = "Hände weg"\n'
NO_UTF_8 = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.mark.process
@pytest.mark.parametrize("env", [{"PYTHONIOENCODING": "ascii"}, NO_UTF_8])
def test_texts_that_the_terminal_cannot_show_are_refused_before_anything_begins(
    study_path: Path, env: dict[str, str]
) -> None:
    study_path.write_text(study_path.read_text("utf-8") + OFF_PLATE, encoding="utf-8")
    with Terminal(study_path, "--seed", "1", env=env) as terminal:
        assert terminal.ended() == 2
    assert re.fullmatch(
        rb"seed 1\r\nerror: texts\.control cannot be shown on this terminal, whose encoding is "
        rb"[\w.-]+; got '\\xe4' in 'H\\xe4nde weg': use a terminal of UTF-8, or [^\n]*\r\n",
        terminal.shown,
    ), terminal.shown
    assert not (study_path.parent / "results").exists()


@pytest.mark.process
@pytest.mark.parametrize(
    ("env", "encoding"), [({"PYTHONIOENCODING": "latin-1"}, "latin-1"), ({"LC_ALL": "C"}, "utf-8")]
)
def test_texts_are_shown_in_the_encoding_of_the_terminal(
    study_path: Path, env: dict[str, str], encoding: str
) -> None:
    text = OFF_PLATE.replace("control =", "audibility =")
    study_path.write_text(study_path.read_text("utf-8") + text, encoding="utf-8")
    with Terminal(study_path, "--seed", "1", env=env) as terminal:
        terminal.expect("Hände weg".encode(encoding))
        terminal.press(ESCAPE)
        assert terminal.ended() == 4, terminal.shown


@pytest.mark.process
def test_texts_that_the_terminal_never_shows_are_no_reason_to_refuse(study_path: Path) -> None:
    text = OFF_PLATE.replace("audibility_trials = 2", "audibility_trials = 0")
    study_path.write_text(study_path.read_text("utf-8") + text, encoding="utf-8")
    with Terminal(study_path, "--seed", "1", env=NO_UTF_8) as terminal:
        terminal.answer(LEFT, ESCAPE)
        terminal.press(ESCAPE)
        assert terminal.ended() == 4, terminal.shown
