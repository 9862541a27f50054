"""A person at a real terminal: keys typed into a pseudo-terminal, seen from outside."""

from __future__ import annotations

import contextlib
import os
import re
import select
import shlex
import shutil
import signal
import subprocess
import sys
import time
from itertools import pairwise
from typing import TYPE_CHECKING, Self

import pytest
from click.testing import CliRunner

from experiment.operator.terminal import KEY
from experiment.study.sections.presentation import KEY_NAMES, TYPED
from tactstrip import main
from tests.test_experiment.sessions import COMMAND, Sessions

if TYPE_CHECKING:
    from pathlib import Path

pty = pytest.importorskip("pty", reason="pseudo-terminals are a POSIX feature")

pytestmark = pytest.mark.process
LEFT, RIGHT, DOWN, ESCAPE, ENTER = b"\x1b[D", b"\x1b[C", b"\x1b[B", b"\x1b", b"\n"
PATIENCE_S = 60
LATER_S = 0.2
"""A person takes longer to answer than what counts as anticipated."""
OFF_PLATE = 'audibility_trials = 2\n[texts]\ncontrol = "Hände weg"\n'
NO_UTF_8 = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.fixture
def sessions(tmp_path: Path, quick_study_text: str) -> Sessions:
    patient = quick_study_text + "response_window_s = 30\nminimum_break_s = 0\n"
    return Sessions(tmp_path, '[masking]\nnoise = "none"\n' + patient)


class Terminal:
    """`tactstrip run` in a process of its own, with a pseudo-terminal for a keyboard."""

    def __init__(self, sessions: Sessions, *more: str, env: dict[str, str] | None = None) -> None:
        self._keyboard, inner = pty.openpty()
        self.process = subprocess.Popen(
            [*COMMAND, *sessions.words(*more)],
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

    def press(self, key: bytes) -> None:
        os.write(self._keyboard, key)

    def go_on(self, text: bytes, key: bytes = ENTER) -> None:
        """Press a key when a text is shown."""
        self.expect(text)
        self.press(key)

    def begin(self, parts: int = 1) -> None:
        """Go on from the instructions, and from the first parts."""
        for _ in range(1 + parts):
            self.go_on(b"Enter goes on")

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


def test_what_is_pressed_is_what_is_recorded(sessions: Sessions) -> None:
    with Terminal(sessions, "--seed", "1") as terminal:
        terminal.begin()
        terminal.answer(LEFT, RIGHT, DOWN)
        terminal.go_on(b"Break: 3 of 5 trials are done.")
        terminal.answer(LEFT, RIGHT)
        assert terminal.ended() == 0, terminal.shown
    recorded = sessions.rows()
    assert [row["response"] for row in recorded] == ["left", "right", "both", "left", "right"]
    assert {(row["simulated"], row["device_kind"]) for row in recorded} == {("false", "mock")}
    told = subprocess.run(
        [*COMMAND, "analyze", sessions.out], capture_output=True, text=True, check=False
    )
    assert (told.returncode, "--allow-simulated" in told.stderr) == (2, True)
    assert terminal.shown.endswith(
        f"tactstrip analyze {sessions.out} --allow-simulated\r\n".encode()
    )
    assert all(0 < float(row["rt_s"]) < 30 for row in recorded)
    # a line is broken between words, not by the terminal
    began = terminal.shown.partition(b"seed 1\r\n")[2].split(b"\r\n")
    assert max(len(line) for line in began[:8]) <= 80
    # no level is shown; a folder's name or the last hash of the journal may hold any three digits
    shown = terminal.shown.replace(str(sessions.study.parent).encode(), b"")
    assert b"160" not in re.sub(rb"[0-9a-f]{64}", b"", shown)


def test_somebody_alone_who_presses_too_early_cannot_go_on_by_themselves(
    sessions: Sessions,
) -> None:
    sessions.write(sessions.text.replace("[0.01, 0.02]", "[5, 5.5]"))
    with Terminal(sessions, "--seed", "1") as terminal:
        terminal.begin()
        for _ in range(3):
            terminal.go_on(b"trial 1 of 5  ...", LEFT)
            terminal.expect(b" (too early)\r\n")  # what follows is on a line of its own
        for _ in range(5):
            terminal.press(ENTER)
        assert terminal.ended() == 4
        assert b"--resume.\r\n" in terminal.shown
        assert b"Paused" not in terminal.shown
    assert [row["status"] for row in sessions.rows()] == ["voided"] * 3


@pytest.mark.parametrize("key", [b" ", LEFT, ENTER, b"  \r" + LEFT])
def test_a_key_that_is_held_down_never_gets_past_the_operator(
    sessions: Sessions, key: bytes
) -> None:
    """A key that is no answer is ignored for ever; one that is, Space too, stops the session."""
    text = sessions.text.replace("[0.01, 0.02]", "[0.3, 0.4]").replace("both_trials = 1\n", "")
    offered = '[design]\nboth_trials = 0\nresponses = ["left", "right", "none"]'
    text = text.replace("[design]", offered).replace("window_s = 30", "window_s = 1")
    sessions.write(text)
    with Terminal(sessions, "--seed", "1") as terminal:
        terminal.begin()
        until_s = time.monotonic() + PATIENCE_S
        while terminal.process.poll() is None and time.monotonic() < until_s:
            with contextlib.suppress(OSError):  # the terminal is gone with its process
                terminal.press(key)
            terminal.read(time.monotonic() + 0.05)
        ended = terminal.ended()
    rows = sessions.rows()
    if key == ENTER:
        assert ended == 0
        assert {row["response"] for row in rows} == {"timeout"}
    else:
        assert ended == 4
        assert len(rows) == 3
    assert b"Paused" not in terminal.shown


def test_the_keys_are_those_of_the_study(sessions: Sessions) -> None:
    keys = '[keys]\nleft = ["f", "num_1"]\nright = ["j"]\nboth = ["f5"]\nnone = ["b"]\n'
    sessions.write(sessions.text + keys + 'pause = ["f10", "lalt"]\ngo_on = ["space"]\n')
    with Terminal(sessions, "--seed", "1") as terminal:
        terminal.expect(b"In a trial f10 pauses; in a pause, or on a page as this, it stops.")
        terminal.go_on(b"space goes on, f10 stops the session.", b" ")
        terminal.expect(b"left   f or 1\r\n  right  j\r\n  both   f5\r\n")
        terminal.press(b" ")
        terminal.answer(b"f", b"b", b"J", b"\x1b[15~")
        terminal.go_on(b"Break: 3 of 5 trials are done.", b"\r")
        terminal.expect(b"goes on")
        terminal.press(b" ")
        terminal.answer(b"1", b"\x1b[21~")
        terminal.go_on(b"Paused: 4 of 5", b"\x1b[21~")
        assert terminal.ended() == 4, terminal.shown
    assert [row["response"] for row in sessions.rows() if row["status"] == "ok"] == [
        *("left", "right", "both", "left")
    ]
    (note,) = [str(entry.facts["text"]) for entry in sessions.entries("note")]
    assert sessions.header()["response_mapping"] == {
        "left": ["f", "num_1"], "right": ["j"], "both": ["f5"], "pause": ["f10"],
        "go_on": ["space"],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ('pause = ["lalt"]', "keys.pause = ['lalt']"),
        ('left = ["button_4", "rctrl"]', "keys.left = ['button_4', 'rctrl']"),
        ('left = ["4"]\nright = ["num_4"]', "keys.right: num_4"),
    ],
)
def test_keys_that_a_terminal_cannot_type_are_refused_before_anything_begins(
    sessions: Sessions, keys: str, said: str
) -> None:
    sessions.write(f"{sessions.text}\n[keys]\n{keys}\n")
    with Terminal(sessions, "--seed", "1") as terminal:
        assert terminal.ended() == 2
    last = terminal.shown.decode().splitlines()[-1]
    assert last.startswith(f"error: {said}"), terminal.shown
    assert "use --responder screen" in last
    assert not sessions.out.exists()
    checked = CliRunner().invoke(main, ["check", str(sessions.study)])
    assert f"not for --responder terminal: {said}" in " ".join(checked.stdout.split())


def test_every_key_that_a_study_may_name_is_typed_or_known_not_to_be() -> None:
    modifiers = {f"{side}{key}" for side in "lr" for key in ("alt", "ctrl", "option", "shift")}
    others = {"lcommand", "rcommand", "lwindows", "rwindows", "menu", "pause"}
    untold = {f"f{number}" for number in range(13, 20)} | {f"button_{i}" for i in range(32)}
    assert {*TYPED} == KEY_NAMES - modifiers - others - untold
    assert all(KEY.fullmatch(sign) for signs in TYPED.values() for sign in signs)


def test_without_a_recorder_the_operator_says_that_it_goes_on(sessions: Sessions) -> None:
    pytest.importorskip("pylsl")
    asked = b"Waiting until somebody records the LSL stream tactstrip"
    with Terminal(sessions, "--lsl") as terminal:
        terminal.expect(asked)
        terminal.expect(b"Enter goes on without.")
        terminal.process.send_signal(signal.SIGINT)
        assert terminal.ended() != 0
    assert not sessions.out.exists()
    with Terminal(sessions, "--lsl") as terminal:
        terminal.go_on(asked)
        terminal.expect(b"Note: nobody records the LSL stream tactstrip.")
        terminal.go_on(b"Enter goes on, Esc", ESCAPE)
        assert terminal.ended() == 4, terminal.shown
    assert not sessions.entries("marker")


WALL_CLOCK = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
int clock_gettime(clockid_t which, struct timespec *now)
{
    static int (*ours)(clockid_t, struct timespec *);
    if (!ours) ours = (int (*)(clockid_t, struct timespec *)) dlsym(RTLD_NEXT, "clock_gettime");
    int failed = ours(which, now);
    FILE *file = which == CLOCK_REALTIME ? fopen(getenv("SET_BY"), "r") : NULL;
    long set_by_s = 0;
    if (file) { if (fscanf(file, "%ld", &set_by_s) != 1) set_by_s = 0; fclose(file); }
    now->tv_sec += set_by_s;
    return failed;
}
"""
"""A wall clock of one's own, set by as many seconds as a file says."""


@pytest.mark.skipif(shutil.which("cc") is None or sys.platform != "linux", reason="no C compiler")
@pytest.mark.parametrize("step_s", [1200, -1200], ids=["forward", "back"])
def test_setting_the_wall_clock_in_a_session_and_between_two_sittings_moves_nothing(
    sessions: Sessions, tmp_path: Path, step_s: int
) -> None:
    source, library, set_by = (tmp_path / name for name in ("wall.c", "wall.so", "set_by"))
    source.write_text(WALL_CLOCK, encoding="utf-8")
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    env = {"LD_PRELOAD": str(library), "SET_BY": str(set_by)}
    with Terminal(sessions, "--seed", "1", env=env) as terminal:
        terminal.begin()
        terminal.answer(LEFT)
        terminal.expect(b" ?")
        set_by.write_text(str(step_s))  # while an answer is awaited
        time.sleep(LATER_S)
        terminal.press(RIGHT)
        terminal.expect(b" ?")
    set_by.write_text(str(3 * step_s))  # 40 minutes in between, by the calendar
    with Terminal(sessions, "--resume", env=env) as terminal:
        terminal.begin()
        terminal.answer(LEFT, RIGHT)
        terminal.go_on(b"Enter goes on")
        terminal.answer(LEFT)
        terminal.go_on(b"Break")
        terminal.answer(LEFT)
        set_by.write_text("0")
        terminal.answer(LEFT)
        assert terminal.ended() == 0, terminal.shown
    entries = sessions.entries()
    walls_s = [later.wall_s - entry.wall_s for entry, later in pairwise(entries)]
    jumps = [round(wall_s / 60) for wall_s in walls_s if abs(wall_s) > 600]
    assert jumps == [step_s / 60, 2 * step_s / 60, -3 * step_s / 60]
    assert all(entry.t_s <= later.t_s for entry, later in pairwise(entries))
    offsets_s = [entry.up_s - entry.t_s for entry in entries]
    assert max(offsets_s) - min(offsets_s) < 0.01
    rows = sessions.rows()
    onsets_s = [float(row["onset_s"]) for row in rows if row["onset_s"] != "n/a"]
    assert onsets_s == sorted(onsets_s)
    assert onsets_s[-1] < PATIENCE_S
    assert {row["onset_clock"] for row in rows} == {"1"}
    assert all(LATER_S / 2 < float(row["rt_s"]) < 10 for row in rows if row["rt_s"] != "n/a")
    (resumed,) = sessions.entries("session_resume")
    assert resumed.facts["session_clock"] == "goes on"
    assert not sessions.entries("note")


def test_fingers_leave_the_plate_and_come_back_when_it_is_said(sessions: Sessions) -> None:
    """What is counted apart is told by its name, and the trials of the task from 1."""
    sessions.write(sessions.text + "control_trials = 2\npractice_trials = 1\n" + OFF_PLATE)
    with Terminal(sessions, "--seed", "1") as terminal:
        terminal.go_on(b"Enter goes on")
        terminal.expect(b"take both hands off the plate")
        terminal.expect(b"Did you notice anything, and where?")
        terminal.go_on(b"none   space")
        terminal.answer(b" ", b" ")
        terminal.expect(b"Lay one finger of each hand")
        terminal.go_on(b"both   down arrow\r\nEnter goes on")
        terminal.answer(ESCAPE)
        terminal.go_on(b"Paused: 0 of 1 practice trials are done.")
        terminal.answer(LEFT)
        terminal.go_on(b"both   down arrow\r\nEnter goes on")
        terminal.answer(LEFT, LEFT, LEFT)
        terminal.go_on(b"Break: 3 of 5 trials are done.")
        terminal.answer(LEFT, LEFT)
        terminal.go_on(b"Break: 5 of 5 trials are done.")
        terminal.go_on("Hände weg".encode(), ESCAPE)
        assert terminal.ended() == 4, terminal.shown
    off, main = [b"hands off 1 of 2", b"hands off 2 of 2"], [b"trial %d of 5"] * 5
    assert re.findall(rb"\n(\S[^\r]*?)  \.\.\. ", terminal.shown) == [
        *(*off, b"practice 1 of 1", b"practice 1 of 1"),
        *(one % n for n, one in enumerate(main, start=1)),
    ]
    with Terminal(sessions, "--resume") as terminal:
        terminal.go_on(b"Enter goes on")
        terminal.go_on("Hände weg".encode())
        terminal.answer(b" ", LEFT)
        assert terminal.ended() == 0, terminal.shown
    recorded = sessions.rows()
    control = [row["response"] for row in recorded if row["kind"] == "control"]
    assert control == ["none", "none", "none", "left"]
    assert all(row["status"] == "ok" for row in recorded if row["kind"] != "practice")


def test_escape_pauses_and_escape_again_stops_until_a_resume(sessions: Sessions) -> None:
    with Terminal(sessions, "--seed", "1") as terminal:
        terminal.begin()
        terminal.answer(LEFT, ESCAPE)
        terminal.go_on(b"Paused: 1 of 5")
        terminal.answer(LEFT, ESCAPE)
        terminal.go_on(b"Paused: 2 of 5", ESCAPE)
        assert terminal.ended() == 4, terminal.shown
    assert f"tactstrip analyze {sessions.out} --allow-simulated\r\nstopped early, ".encode() in (
        terminal.shown
    )
    line = terminal.shown.decode().partition("; go on with ")[2]
    assert sorted(shlex.split(line)) == sorted(["tactstrip", *sessions.words("--resume")])
    assert b"error" not in terminal.shown
    with Terminal(sessions, "--resume") as terminal:
        terminal.begin()
        terminal.expect(b"warm-up  ... ?")
        time.sleep(LATER_S)
        terminal.press(LEFT)
        terminal.answer(RIGHT)
        terminal.expect(b"right")
        terminal.go_on(b"Enter goes on")
        terminal.answer(LEFT)
        terminal.go_on(b"Break")
        terminal.answer(LEFT, LEFT)
        assert terminal.ended() == 0, terminal.shown
    statuses = [row["status"] for row in sessions.rows() if row["kind"] != "practice"]
    assert (statuses.count("ok"), statuses.count("voided")) == (5, 2)


def test_a_try_out_that_is_stopped_before_its_first_trial_has_nothing_to_analyze(
    sessions: Sessions,
) -> None:
    with Terminal(sessions, "--seed", "1") as terminal:
        terminal.go_on(b"Enter goes on", ESCAPE)
        assert terminal.ended() == 4, terminal.shown
    assert b"stopped early" in terminal.shown
    assert b"tactstrip analyze" not in terminal.shown


@pytest.mark.parametrize("packets", [(LEFT * 30,), (ESCAPE, b"[D"), (b"\x1b[", b"D")])
def test_an_arrow_that_arrives_in_pieces_is_no_escape(
    sessions: Sessions, packets: tuple[bytes, ...]
) -> None:
    with Terminal(sessions, "--seed", "1") as terminal:
        terminal.expect(b"Enter goes on, Esc stops the session.")
        for packet in packets:
            terminal.press(packet)
            time.sleep(0.01)
        terminal.press(ENTER)
        terminal.begin(parts=0)
        terminal.expect(b" ?")
        time.sleep(LATER_S)
        for packet in packets:
            terminal.press(packet)
            time.sleep(0.01)
        terminal.expect(b" left")
        terminal.answer(ESCAPE)
        terminal.go_on(b"Paused: 1 of 5", ESCAPE)
        assert terminal.ended() == 4, terminal.shown
    assert [row["response"] for row in sessions.rows() if row["status"] == "ok"] == ["left"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, None])
def test_a_signal_or_a_closed_terminal_stops_the_session_safely_while_an_answer_is_awaited(
    sessions: Sessions, number: signal.Signals | None
) -> None:
    with Terminal(sessions, "--seed", "1") as terminal:
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


def test_a_key_that_is_no_answer_is_said_to_be_none_and_the_next_one_counts(
    sessions: Sessions,
) -> None:
    with Terminal(sessions, "--seed", "1") as terminal:
        terminal.begin()
        terminal.answer(b"\x1b[15~")
        terminal.expect(rb"(key '\x1b[15~' is no answer here) ?")
        terminal.press(b"x")
        terminal.expect(b"(x is no answer here) ?")
        terminal.press(b" ")
        terminal.expect(b"(none is no answer here) ?")
        terminal.press(RIGHT)
        terminal.expect(b" right")
        terminal.answer(LEFT, LEFT)
        terminal.go_on(b"Break", ESCAPE)
        assert terminal.ended() == 4
    assert [row["response"] for row in sessions.rows()] == ["right", "left", "left"]
    notes = [str(entry.facts["text"]) for entry in sessions.entries("note")]
    assert [note.split(" was")[0].split(": ", 1)[1] for note in notes] == [
        *(r"key '\x1b[15~'", "x", "none")
    ]


def test_without_a_terminal_it_says_what_to_use_instead(sessions: Sessions) -> None:
    done = subprocess.run(
        [*COMMAND, *sessions.words()],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "--responder simulated" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not sessions.out.exists()


@pytest.mark.parametrize("env", [{"PYTHONIOENCODING": "ascii"}, NO_UTF_8])
def test_texts_that_the_terminal_cannot_show_are_refused_before_anything_begins(
    sessions: Sessions, env: dict[str, str]
) -> None:
    sessions.write(sessions.text + "control_trials = 2\n" + OFF_PLATE)
    with Terminal(sessions, "--seed", "1", env=env) as terminal:
        assert terminal.ended() == 2
    assert re.search(
        rb"seed 1\r\nerror: texts\.control cannot be shown on this terminal, whose encoding is "
        rb"[\w.-]+; got '\\xe4' in 'H\\xe4nde weg': use a terminal of UTF-8, or [^\n]*\r\n\Z",
        terminal.shown,
    ), terminal.shown
    assert not sessions.out.exists()


@pytest.mark.parametrize(
    ("env", "encoding"), [({"PYTHONIOENCODING": "latin-1"}, "latin-1"), ({"LC_ALL": "C"}, "utf-8")]
)
def test_texts_are_shown_in_the_encoding_of_the_terminal(
    sessions: Sessions, env: dict[str, str], encoding: str
) -> None:
    sessions.write(sessions.text + OFF_PLATE.replace("control =", "audibility ="))
    with Terminal(sessions, "--seed", "1", env=env) as terminal:
        terminal.go_on(b"Enter goes on")
        terminal.go_on("Hände weg".encode(encoding), ESCAPE)
        assert terminal.ended() == 4, terminal.shown


def test_texts_that_the_terminal_never_shows_are_no_reason_to_refuse(sessions: Sessions) -> None:
    sessions.write(sessions.text + OFF_PLATE.replace("audibility_trials = 2\n", ""))
    with Terminal(sessions, "--seed", "1", env=NO_UTF_8) as terminal:
        terminal.begin()
        terminal.answer(LEFT, ESCAPE)
        terminal.press(ESCAPE)
        assert terminal.ended() == 4, terminal.shown


def test_at_a_terminal_the_mock_needs_the_word_that_it_is_practice(sessions: Sessions) -> None:
    sessions.practice = False
    with Terminal(sessions) as terminal:
        assert terminal.ended() == 2, terminal.shown
    assert b"--practice-without-device" in terminal.shown
    assert not sessions.out.exists()
