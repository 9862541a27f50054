"""A keyboard and a button box as PsychoPy and pyglet have them, without either."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any

from device import VirtualClock
from experiment.participant.keys import ButtonReader

if TYPE_CHECKING:
    import pytest

WALL_S = 1_000_000.0
"""How far the keyboard's clock is ahead of the session's."""
ZERO_S = 999_000.0
"""PsychoPy's own zero on the keyboard's clock."""


@dataclass(slots=True, eq=False)
class Press:
    """A key as PsychoPy keeps it; on release it is listed again, with a duration."""

    name: str
    tDown: float  # noqa: N815 - PsychoPy's name of it
    duration: float | None = None


@dataclass(slots=True)
class Keyboard:
    """What PsychoPy's keyboard does where it reads by psychtoolbox."""

    ahead_s: float = WALL_S
    presses: list[Press] = field(default_factory=list)
    stopped: bool = False
    clock: VirtualClock = field(default_factory=lambda: VirtualClock(5.0))

    def stop(self) -> None:
        self.stopped = True

    def down(self, name: str, *, ago_s: float = 0.0) -> Press:
        press = Press(name, self.clock.now_s() - ago_s + self.ahead_s - ZERO_S)
        self.presses.append(press)
        return press

    def up(self, press: Press) -> None:
        press.duration = 0.1
        self.presses.append(press)

    def getKeys(self, *, waitRelease: bool) -> list[Press]:  # noqa: N802, N803 - PsychoPy's names
        matching = [press for press in self.presses if (press.duration is not None) is waitRelease]
        self.presses = [press for press in self.presses if press not in matching]
        return list(dict.fromkeys(matching))


@dataclass(slots=True)
class Box:
    """A controller as pyglet has one: its presses come while its event loop takes a step."""

    handlers: dict[str, Any] = field(default_factory=dict)
    coming: list[int] = field(default_factory=list)
    opened: bool = False

    def open(self) -> None:
        self.opened = True

    def push_handlers(self, **handlers: Any) -> None:
        self.handlers |= handlers

    def close(self) -> None:
        self.opened = False

    def step(self, timeout: float) -> None:
        assert timeout == 0.0
        for button in self.coming if self.opened else []:
            self.handlers["on_joybutton_press"](self, button)
        self.coming = []


def installed_keyboard(monkeypatch: pytest.MonkeyPatch) -> Keyboard:
    """Put a keyboard in the place of PsychoPy's."""
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


def installed_box(monkeypatch: pytest.MonkeyPatch) -> Box:
    """Put a button box in the place of pyglet's controllers."""
    box = Box()
    pyglet = ModuleType("pyglet")
    vars(pyglet)["app"] = SimpleNamespace(platform_event_loop=box)
    vars(pyglet)["input"] = SimpleNamespace(get_joysticks=lambda: [box])
    monkeypatch.setitem(sys.modules, "pyglet", pyglet)
    return box


def button_reader(keyboard: Keyboard) -> ButtonReader:
    """Read the buttons of the box on the clock of the keyboard."""
    return ButtonReader(keyboard.clock)
