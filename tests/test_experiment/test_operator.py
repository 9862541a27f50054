"""The operator's panel and the terminal's keys: whole messages, commands, notes."""

from __future__ import annotations

import io
import os
import sys
from collections import deque
from types import ModuleType

import pytest
from rich.console import Console

from experiment.operator import keyboard, view
from experiment.operator.requests import Requests, Status, StopSignal, Tally

LONG = "the monitor measured " + "much more than " * 30 + "it should"


def drawn(status: Status, width: int = 80) -> str:
    file = io.StringIO()
    console = Console(file=file, width=width, color_system=None)
    for line in view.status_lines(status, is_pause_requested=False):
        console.print(line)
    return file.getvalue()


def status(phase: str, message: str = "") -> Status:
    return Status(
        phase=phase,
        done=11,
        planned=155,
        block=2,
        blocks=5,
        left_s=610.0,
        noise="plays",
        device="ok",
        message=message,
        tallies={"left": Tally(presented=6, correct=5, last=("left",))},
    )


@pytest.mark.parametrize("width", [40, 80, 100])
def test_a_message_is_shown_whole_and_a_pause_names_the_key(width: int) -> None:
    text = " ".join(drawn(status("paused", LONG), width).split())
    assert LONG in text
    assert view.RESUME_HINT in text
    assert view.RESUME_HINT not in drawn(status("foreperiod", LONG), width)


def test_control_characters_of_a_message_move_no_cursor() -> None:
    assert "\x1b" not in drawn(status("paused", "a\x1b[2Kb\rc"))


def test_keys_are_commands_and_a_note_is_typed_until_enter() -> None:
    requests, stop = Requests(), StopSignal()
    panel = view.OperatorView(requests, stop)

    def type_keys(*keys: str) -> None:
        for key in keys:
            panel.press(key)

    panel.show(status("foreperiod"))
    type_keys("r")
    assert not requests.take_continue()  # nothing waits
    type_keys("P", "r")
    assert (requests.paused, requests.take_continue()) == (False, True)
    type_keys("p", "\x1b[A", "\n", "x", "\x1b")
    type_keys("n", *"chair  mowed", *"\x7f" * 3, *"ved, späť", "\x1b[D", "\t", "\n")
    type_keys("n", "\n", "n", *"slip", "\x1b", "n", *"x" * 600, "\n")
    assert requests.paused
    assert requests.notes() == ("chair  moved, späť", "x" * view.MAX_NOTE_CHARACTERS)
    stops = [stop.is_requested]
    type_keys("s")
    assert [*stops, stop.is_requested] == [False, True]


def test_a_console_of_windows_gives_the_keys_that_other_terminals_give(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    typed = deque("p\r\xe0H\x00Kä")
    console = ModuleType("msvcrt")
    vars(console).update(kbhit=lambda: bool(typed), getwch=typed.popleft)
    monkeypatch.setitem(sys.modules, "msvcrt", console)
    with keyboard.WindowsKeyboard() as keys:
        assert keys.wait(None)
        assert keys.read() == ["p", "\n", "\x1b[A", "\x1b[D", "ä"]
        assert not keys.wait(0.01)


@pytest.mark.parametrize(
    ("pieces", "keys"),
    [
        ([b"\x1b[", b"D"], ["\x1b[D"]),
        ([b"\x1b"], ["\x1b"]),
        ([b"\x1b\x1bx"], ["\x1b", "\x1b", "x"]),
        ([b"\x1b[15~", b"a"], ["\x1b[15~", "a"]),
        (["ä\n".encode()], ["ä", "\n"]),
    ],
)
def test_a_key_in_pieces_is_one_key(pieces: list[bytes], keys: list[str]) -> None:
    pty = pytest.importorskip("pty", reason="pseudo-terminals are a POSIX feature")
    outside, inside = pty.openpty()
    arriving = deque(pieces)

    class SlowLine(keyboard.PosixKeyboard):
        """A keyboard whose next piece arrives while it is awaited."""

        def wait(self, timeout_s: float | None) -> bool:
            if not arriving:
                return super().wait(timeout_s)
            os.write(outside, arriving.popleft())
            return super().wait(None)

    with os.fdopen(inside, "rb", buffering=0) as terminal, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdin", terminal)
        read: list[str] = []
        with SlowLine() as board:
            while len(read) < len(keys):
                assert board.wait(5.0)
                read += board.read()
    os.close(outside)
    assert read == keys
