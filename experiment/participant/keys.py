"""Keys and buttons from PsychoPy and pyglet, each press read once, on the session's clock."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

from experiment.participant.window import NoScreenError
from experiment.trial.responder import Press

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock

LARGEST_JUMP_S = 1e-3
"""By how much the keyboard's clock may move against the session's without a report."""


class KeyReader:
    """Reads every key by PsychoPy's name; `drop_earlier` spares those to `keep`.

    The keyboard's times come from psychtoolbox, whose clock is the wall clock on Linux. Its offset
    from the session's clock is measured with every reading; where it moved by more than
    `LARGEST_JUMP_S` since the last one, keys are timed by when they were read, and it is reported.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        keep: tuple[str, ...],
        report: Callable[[str], object],
        buttons: ButtonReader | None = None,
    ) -> None:
        from psychopy import logging
        from psychopy.hardware.keyboard import Keyboard
        from psychtoolbox import GetSecs

        self._clock = clock
        self._keep = keep
        self._report = report
        self._buttons = buttons
        self._keyboard_s: Callable[[], float] = GetSecs
        self._zero_s: Callable[[], float] = logging.defaultClock.getLastResetTime
        self._keyboard: Any = Keyboard(backend="ptb")
        self._waiting: deque[Press] = deque()
        self._held: list[Any] = []
        self._offset_s = clock_offset_s(clock, GetSecs)

    def close(self) -> None:
        """Stop listening."""
        self._keyboard.stop()
        if self._buttons is not None:
            self._buttons.close()

    def drop_all(self) -> None:
        """Forget the presses so far."""
        self.read()
        self._waiting.clear()

    def drop_earlier(self) -> None:
        """Forget the presses so far but of the keys to be kept."""
        self.read()
        self._waiting = deque(press for press in self._waiting if press.response in self._keep)

    def next(self) -> Press | None:
        """Return the earliest press that was not yet returned."""
        self.read()
        return self._waiting.popleft() if self._waiting else None

    def read(self) -> None:
        """Take the presses from the keyboard.

        A key that was released already is found only by waiting for releases, one that is still
        down only by not doing so; a key found by both is one press.
        """
        down = self._keyboard.getKeys(waitRelease=False)
        released = self._keyboard.getKeys(waitRelease=True)
        before_s, self._offset_s = self._offset_s, clock_offset_s(self._clock, self._keyboard_s)
        jump_s = self._offset_s - before_s
        is_jump = abs(jump_s) > LARGEST_JUMP_S
        if is_jump:
            self._report(f"clock jump: the keyboard's clock moved by {-1e3 * jump_s:.1f} ms")
        now_s = self._clock.now_s()
        for press in sorted([*down, *released], key=lambda press: float(press.tDown)):
            if self._was_held(press):
                continue
            time_s = press.tDown + self._zero_s() + self._offset_s
            self._waiting.append(Press(press.name, now_s if is_jump else min(time_s, now_s)))
        if self._buttons is not None:
            self._waiting.extend(self._buttons.take())

    def _was_held(self, press: Any) -> bool:
        """Return whether this is the release of a key whose press was read before."""
        was_held = any(held is press for held in self._held)
        if was_held:
            self._held = [held for held in self._held if held is not press]
        elif press.duration is None:
            self._held.append(press)
        return was_held


def clock_offset_s(clock: Clock, now_s: Callable[[], float]) -> float:
    """Return how far a clock is ahead of another one, by the closest of three readings.

    >>> from device import VirtualClock
    >>> clock_offset_s(VirtualClock(5.0), lambda: 3.0)
    2.0
    """
    readings = []
    for _ in range(3):  # one may be interrupted
        before_s, other_s, after_s = clock.now_s(), now_s(), clock.now_s()
        readings.append((after_s - before_s, (before_s + after_s) / 2 - other_s))
    return min(readings)[1]


PREFIX = "button_"
"""How [keys] names a button: button_0 is the first of any controller."""


class ButtonReader:
    """Reads the buttons of every controller; a press is timed by when it was read.

    NoScreenError where none is plugged in.
    """

    def __init__(self, clock: Clock) -> None:
        import pyglet

        self._clock = clock
        self._loop: Any = pyglet.app.platform_event_loop
        self._pressed: list[Press] = []
        try:
            self._boxes: list[Any] = list(pyglet.input.get_joysticks())
        except OSError:  # a Linux without /dev/input
            self._boxes = []
        if not self._boxes:
            raise NoScreenError(
                "[keys] has buttons, but no game controller or button box is plugged in: plug it "
                "in before the start, or give keys"
            )
        for box in self._boxes:
            box.open()
            box.push_handlers(on_joybutton_press=self._note)

    def take(self) -> list[Press]:
        """Return the buttons that were pressed since the last call, and when."""
        self._loop.step(0.0)
        taken, self._pressed = self._pressed, []
        return taken

    def close(self) -> None:
        """Stop listening."""
        for box in self._boxes:
            box.close()

    def _note(self, _: object, button: int) -> None:
        self._pressed.append(Press(f"{PREFIX}{button}", self._clock.now_s()))
