"""Keys as PsychoPy hands them out: each heard once, timed on the session's clock."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from types import ModuleType, SimpleNamespace

import pytest

from device import VirtualClock
from experiment.participant.keys import KeyReader, Stroke

WALL_S = 1_000_000.0
"""How far the keyboard's clock is ahead of the session's."""
ZERO_S = 999_000.0
"""PsychoPy's own zero on the keyboard's clock."""


@dataclass(slots=True, eq=False)
class Press:
    """A key as PsychoPy keeps it; on release it is found again, with a duration."""

    name: str
    tDown: float  # noqa: N815 - PsychoPy's name of it
    duration: float | None = None


@dataclass(slots=True)
class Keyboard:
    """What PsychoPy's keyboard does where it reads by psychtoolbox."""

    ahead_s: float = WALL_S
    found: list[Press] = field(default_factory=list)
    stopped: bool = False
    clock: VirtualClock = field(default_factory=lambda: VirtualClock(5.0))

    def stop(self) -> None:
        self.stopped = True

    def down(self, name: str, *, ago_s: float = 0.0) -> Press:
        press = Press(name, self.clock.now_s() - ago_s + self.ahead_s - ZERO_S)
        self.found.append(press)
        return press

    def up(self, press: Press) -> None:
        press.duration = 0.1
        self.found.append(press)

    def getKeys(self, *, waitRelease: bool) -> list[Press]:  # noqa: N802, N803 - PsychoPy's names
        wanted = [press for press in self.found if (press.duration is not None) is waitRelease]
        self.found = [press for press in self.found if press not in wanted]
        return list(dict.fromkeys(wanted))


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Keyboard:
    keyboard = Keyboard()
    modules = {
        "psychopy": SimpleNamespace(
            logging=SimpleNamespace(defaultClock=SimpleNamespace(getLastResetTime=lambda: ZERO_S))
        ),
        "psychopy.hardware": SimpleNamespace(),
        "psychopy.hardware.keyboard": SimpleNamespace(Keyboard=lambda backend: keyboard),
        "psychtoolbox": SimpleNamespace(GetSecs=lambda: keyboard.clock.now_s() + keyboard.ahead_s),
    }
    for name, contents in modules.items():
        module = ModuleType(name)
        vars(module).update(vars(contents))
        monkeypatch.setitem(sys.modules, name, module)
    return keyboard


@pytest.fixture
def told() -> list[str]:
    return []


@pytest.fixture
def reader(keyboard: Keyboard, told: list[str]) -> KeyReader:
    return KeyReader(keyboard.clock, keep=("escape",), tell=told.append)


def heard(reader: KeyReader) -> tuple[str, float]:
    stroke = reader.next()
    assert stroke is not None
    return stroke.key, round(stroke.time_s, 9)


def test_a_key_is_timed_on_the_sessions_clock(keyboard: Keyboard, reader: KeyReader) -> None:
    keyboard.down("left", ago_s=0.25)
    assert heard(reader) == ("left", 4.75)
    keyboard.up(keyboard.down("left"))  # a tap that ended before it was read
    assert reader.next() == Stroke("left", 5.0)
    assert reader.next() is None


def test_only_a_wish_for_a_pause_outlives_the_trial(keyboard: Keyboard, reader: KeyReader) -> None:
    keyboard.down("left")
    keyboard.down("escape")
    reader.drop_earlier()
    assert heard(reader)[0] == "escape"
    keyboard.down("escape")
    reader.drop_all()
    assert reader.next() is None


@pytest.mark.parametrize("jump_s", [-3600.0, 0.0015, 60.0])
def test_a_jump_of_the_clock_is_told_and_does_not_move_a_key(
    keyboard: Keyboard, reader: KeyReader, told: list[str], jump_s: float
) -> None:
    held = keyboard.down("right")
    assert reader.next() is not None
    keyboard.down("left", ago_s=0.002)
    keyboard.ahead_s += jump_s
    assert reader.next() == Stroke("left", 5.0)  # when it was read
    assert [f"{1e3 * jump_s:.1f} ms" in message for message in told] == [True]
    keyboard.up(held)
    assert reader.next() is None
    keyboard.ahead_s += 0.0005  # a smaller step is no jump
    keyboard.down("left", ago_s=0.002)
    assert heard(reader) == ("left", 4.998)
    assert len(told) == 1
