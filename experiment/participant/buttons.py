"""Buttons of game controllers and USB button boxes, by pyglet, each read once.

Tried with a stand-in for a controller, not with one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from experiment.participant.window import NoScreenError

if TYPE_CHECKING:
    from device.clock import Clock

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
        self._pressed: list[tuple[str, float]] = []
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

    def take(self) -> list[tuple[str, float]]:
        """Return the buttons that were pressed since the last call, and when."""
        self._loop.step(0.0)
        taken, self._pressed = self._pressed, []
        return taken

    def close(self) -> None:
        """Stop listening."""
        for box in self._boxes:
            box.close()

    def _note(self, _: object, button: int) -> None:
        self._pressed.append((f"{PREFIX}{button}", self._clock.now_s()))
