"""The operator's panel: whole messages, the key that continues, commands by line."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from experiment.operator import view
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


def test_lines_are_commands() -> None:
    requests, stop = Requests(), StopSignal()
    panel = view.OperatorView(requests, stop)
    panel.show(status("foreperiod"))
    panel.obey("r")
    assert not requests.take_continue()  # nothing waits
    panel.obey("P")
    panel.obey(" r ")
    assert (requests.paused, requests.take_continue()) == (False, True)
    panel.obey("p")
    for line in ("", "n", "n  ", "x", "resume", "s please", "n chair moved", "n " + "x" * 600):
        panel.obey(line)
    assert requests.paused
    assert requests.notes() == ("chair moved", "x" * view.MAX_NOTE_CHARACTERS)
    stops = [stop.asked]
    panel.obey("s")
    assert [*stops, stop.asked] == [False, True]
