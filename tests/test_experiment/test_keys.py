"""Keys as PsychoPy reports them: each is read once and timed on the session's clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from experiment import Press
from experiment.participant.keys import KeyReader
from tests.test_experiment.keyboard import button_reader, installed_box, installed_keyboard

if TYPE_CHECKING:
    from tests.test_experiment.keyboard import Box, Keyboard


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Keyboard:
    return installed_keyboard(monkeypatch)


@pytest.fixture
def box(monkeypatch: pytest.MonkeyPatch) -> Box:
    return installed_box(monkeypatch)


@pytest.fixture
def events() -> list[str]:
    return []


@pytest.fixture
def reader(keyboard: Keyboard, events: list[str]) -> KeyReader:
    return KeyReader(keyboard.clock, keep=("escape",), report=events.append)


def heard(reader: KeyReader) -> tuple[str, float]:
    press = reader.next()
    assert press is not None
    return press.response, round(press.time_s, 9)


def test_a_key_is_timed_on_the_sessions_clock(keyboard: Keyboard, reader: KeyReader) -> None:
    keyboard.down("left", ago_s=0.25)
    assert heard(reader) == ("left", 4.75)


def test_a_tap_that_ended_before_it_was_read_is_heard_once(
    keyboard: Keyboard, reader: KeyReader
) -> None:
    keyboard.up(keyboard.down("left"))
    assert reader.next() == Press("left", 5.0)
    assert reader.next() is None


def test_the_release_of_a_key_is_no_stroke(keyboard: Keyboard, reader: KeyReader) -> None:
    press = keyboard.down("right")
    assert reader.next() is not None
    keyboard.clock.wait(2.0)
    keyboard.up(press)
    assert reader.next() is None
    keyboard.down("right")
    assert reader.next() == Press("right", 7.0)


def test_of_two_keys_the_earlier_comes_first(keyboard: Keyboard, reader: KeyReader) -> None:
    keyboard.down("right", ago_s=0.001)
    keyboard.up(keyboard.down("left", ago_s=0.002))
    assert [heard(reader)[0], heard(reader)[0]] == ["left", "right"]


def test_only_a_pause_key_outlives_the_trial(keyboard: Keyboard, reader: KeyReader) -> None:
    keyboard.down("left")
    keyboard.down("escape")
    reader.drop_earlier()
    assert heard(reader)[0] == "escape"
    keyboard.down("escape")
    reader.drop_all()
    assert reader.next() is None


@pytest.mark.parametrize("jump_s", [-3600.0, 0.0015, 60.0])
def test_a_jump_of_the_clock_is_noted_and_does_not_move_a_key(
    keyboard: Keyboard, reader: KeyReader, events: list[str], jump_s: float
) -> None:
    held = keyboard.down("right")
    assert reader.next() is not None
    keyboard.down("left", ago_s=0.002)
    keyboard.ahead_s += jump_s
    assert reader.next() == Press("left", 5.0)  # when it was read
    assert [f"{1e3 * jump_s:.1f} ms" in event for event in events] == [True]
    keyboard.up(held)
    assert reader.next() is None
    keyboard.down("left", ago_s=0.002)
    assert heard(reader) == ("left", 4.998)
    assert len(events) == 1


def test_a_smaller_step_is_no_jump(
    keyboard: Keyboard, reader: KeyReader, events: list[str]
) -> None:
    keyboard.ahead_s += 0.0005
    keyboard.down("left", ago_s=0.002)
    assert heard(reader) == ("left", 4.998)
    assert events == []


def test_a_button_is_a_key_timed_by_when_it_was_read(keyboard: Keyboard, box: Box) -> None:
    buttons = button_reader(keyboard)
    reader = KeyReader(keyboard.clock, keep=("button_7",), report=print, buttons=buttons)
    keyboard.down("left", ago_s=0.003)
    box.coming = [3]
    assert heard(reader) == ("left", 4.997)
    assert heard(reader) == ("button_3", 5.0)
    assert reader.next() is None
    box.coming = [2, 7]
    reader.drop_earlier()
    assert heard(reader) == ("button_7", 5.0)
    assert box.opened
    reader.close()
    assert keyboard.stopped
    assert not box.opened
