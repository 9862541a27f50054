"""What a participant's and an operator's keys do to a screen, without a window."""

from __future__ import annotations

import pytest

from experiment import Press, SessionPart
from experiment.operator.requests import StopRequested
from tests.test_experiment.room import PROGRESS, Room, question

END_S = 30.0
ESCAPE = "escape"


@pytest.fixture
def room() -> Room:
    return Room()


def test_every_key_of_an_answer_gives_it_and_others_their_names(room: Room) -> None:
    # which of them count is for the session to judge
    meanings = {
        "a": "left",
        "right": "right",
        "space": "none",
        "q": "key q",
        "return": "key return",
    }
    for at_s, (key, meaning) in enumerate(meanings.items()):
        room.keys((key, at_s))
        assert room.responder.ask(question(at_s)) == Press(meaning, at_s)


def test_a_press_before_the_onset_comes_early_and_none_is_no_answer_after_the_window(
    room: Room,
) -> None:
    room.keys(("left", 0.1))
    assert room.responder.wait(0.5) == Press("left", 0.1)
    room.keys(("right", 0.45))
    assert room.responder.ask(question(onset_s=0.5)) == Press("right", 0.45)
    assert room.responder.ask(question(onset_s=0.5)) is None
    assert room.clock.now_s() == pytest.approx(2.5, abs=0.02)


def test_a_cue_drops_keys_but_not_a_wish_for_a_pause(room: Room) -> None:
    room.keys(("left", 0.1), ("escape", 0.2))
    room.clock.wait(0.3)
    room.responder.cue(PROGRESS)
    assert room.responder.wait(1.0) == Press(ESCAPE, 0.2)


def test_escape_makes_a_pause_of_a_break_and_another_one_stops(room: Room) -> None:
    room.keys(("return", 0.4))
    assert room.pause(paused=True)
    room.keys(("escape", 0.5))
    assert not room.pause(paused=True)
    room.keys(("escape", 0.6), ("return", 1.0))
    assert room.pause(paused=False, minimum_s=30.0)
    room.keys(("escape", 2.0), ("escape", 3.0))
    assert not room.pause(paused=False, minimum_s=30.0)


def test_a_break_lasts_its_least_time_and_counts_it_down(room: Room) -> None:
    room.keys(("return", 1.0), ("left", 2.0), ("return", 4.0))
    assert room.pause(paused=False, minimum_s=3.0)
    assert room.clock.now_s() == pytest.approx(4.0, abs=0.05)
    assert room.stage.shown == ["rest 3", "rest 2", "rest 1", "rest 0"]


def test_pages_are_read_one_after_the_other(room: Room) -> None:
    room.keys(("return", 1.0), ("left", 1.5), ("return", 2.0))
    assert room.responder.begin(PROGRESS)
    assert room.stage.shown == ["welcome", "instructions"]
    room.keys(("escape", 3.0), ("return", 4.0), ("return", 5.0))
    assert room.responder.introduce(SessionPart.HANDS_OFF_AFTER, PROGRESS)
    assert room.stage.shown[2:] == ["hands_off_after", "pause+", "hands_off_after"]
    room.keys(("escape", 6.0), ("escape", 7.0))
    assert not room.responder.introduce(SessionPart.MAIN, PROGRESS)


def test_the_fingers_are_laid_on_the_plate_when_a_part_first_needs_them(room: Room) -> None:
    parts = ("hands_off_before", "practice", "main", "hands_off_after", "main")
    for at_s, part in enumerate(parts):
        room.keys(("return", at_s + 0.2), ("return", at_s + 0.7))
        assert room.responder.introduce(SessionPart(part), PROGRESS)
        room.clock.wait(at_s + 1 - room.clock.now_s())
        room.keyboard.drop_all()
    assert room.stage.shown == [
        *(
            "hands_off_before",
            "placement",
            "practice",
            "main",
            "hands_off_after",
            "placement",
            "main",
        )
    ]
    room.keys(*[("return", 6.0 + place) for place in range(4)])
    assert room.responder.begin(PROGRESS)  # after a resume nobody knows where they are
    assert room.responder.introduce(SessionPart.MAIN, PROGRESS)
    assert room.stage.shown[-2:] == ["placement", "main"]


@pytest.mark.parametrize("close", [False, True])
def test_a_stop_or_a_closed_window_ends_every_wait(room: Room, *, close: bool) -> None:
    waits = (
        lambda: room.responder.begin(PROGRESS),
        lambda: room.responder.wait(100.0),
        lambda: room.responder.ask(question(window_s=100.0)),
        lambda: room.pause(paused=True),
        lambda: room.pause(paused=False, minimum_s=100.0),
    )
    for wait in waits:
        room.stop.is_requested, room.stage.closed = not close, close
        with pytest.raises(StopRequested):
            wait()
        assert room.stop.is_requested


def test_the_last_page_waits_for_a_key_but_not_for_ever(room: Room) -> None:
    room.responder.feedback(correct=False)
    assert room.clock.now_s() == pytest.approx(0.8)
    room.keys(("return", 2.0))
    room.responder.end(PROGRESS, finished=True)
    assert room.clock.now_s() == pytest.approx(2.0, abs=0.05)
    room.responder.end(PROGRESS, finished=True)
    assert room.clock.now_s() == pytest.approx(2.0 + END_S, abs=0.05)
    room.responder.end(PROGRESS, finished=False)
    assert room.stage.shown == ["incorrect", "end", "end", "stopped"]
