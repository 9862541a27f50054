"""Key presses from PsychoPy, each read once and timed on the session's clock."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from experiment.participant.buttons import ButtonReader


LARGEST_JUMP_S = 1e-3
"""By how much the keyboard's clock may move against the session's without being told."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """A key that went down: PsychoPy's name of it, and when on the session's clock."""

    key: str
    time_s: float


class KeyReader:
    """Reads every key of every keyboard; `drop_earlier` spares those to `keep`.

    The keyboard's times come from psychtoolbox, whose clock is the wall clock on Linux. Its offset
    from the session's clock is measured with every reading; where it moved by more than
    `LARGEST_JUMP_S` since the last one, strokes are timed by when they were read, and it is told.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        keep: tuple[str, ...],
        tell: Callable[[str], object],
        buttons: ButtonReader | None = None,
    ) -> None:
        from psychopy import logging
        from psychopy.hardware.keyboard import Keyboard
        from psychtoolbox import GetSecs

        self._clock = clock
        self._keep = keep
        self._tell = tell
        self._buttons = buttons
        self._keyboard_s: Callable[[], float] = GetSecs
        self._zero_s: Callable[[], float] = logging.defaultClock.getLastResetTime
        self._keyboard: Any = Keyboard(backend="ptb")
        self._waiting: deque[Stroke] = deque()
        self._held: list[Any] = []
        self._offset_s = self._measured_offset_s()

    def close(self) -> None:
        """Stop listening."""
        self._keyboard.stop()
        if self._buttons is not None:
            self._buttons.close()

    def drop_all(self) -> None:
        """Forget the strokes so far."""
        self.read()
        self._waiting.clear()

    def drop_earlier(self) -> None:
        """Forget the strokes so far but of the keys to be kept."""
        self.read()
        self._waiting = deque(stroke for stroke in self._waiting if stroke.key in self._keep)

    def next(self) -> Stroke | None:
        """Return the earliest stroke that was not yet returned."""
        self.read()
        return self._waiting.popleft() if self._waiting else None

    def read(self) -> None:
        """Take the strokes from the keyboard.

        A key that was released already is found only by waiting for releases, one that is still
        down only by not doing so; a key found by both is one stroke.
        """
        presses = [
            press
            for released in (False, True)
            for press in self._keyboard.getKeys(waitRelease=released)
        ]
        jumped = self._jumped()
        now_s = self._clock.now_s()
        for press in sorted(presses, key=lambda press: float(press.tDown)):
            if self._was_held(press):
                continue
            time_s = press.tDown + self._zero_s() + self._offset_s
            self._waiting.append(Stroke(press.name, now_s if jumped else min(time_s, now_s)))
        if self._buttons is not None:
            self._waiting.extend(Stroke(*press) for press in self._buttons.take())

    def _was_held(self, press: Any) -> bool:
        """Tell whether this is the release of a key whose stroke was read before."""
        known = any(held is press for held in self._held)
        if known:
            self._held = [held for held in self._held if held is not press]
        elif press.duration is None:
            self._held.append(press)
        return known

    def _jumped(self) -> bool:
        """Measure the offset of the clocks anew; tell if it is another one."""
        before_s, self._offset_s = self._offset_s, self._measured_offset_s()
        jump_s = self._offset_s - before_s
        if abs(jump_s) <= LARGEST_JUMP_S:
            return False
        self._tell(f"clock jump: the keyboard's clock moved by {-1e3 * jump_s:.1f} ms")
        return True

    def _measured_offset_s(self) -> float:
        """Read the keyboard's clock between two readings of the session's, the closest of three."""
        readings = []
        for _ in range(3):
            before_s = self._clock.now_s()
            keyboard_s = self._keyboard_s()
            after_s = self._clock.now_s()
            readings.append((after_s - before_s, (before_s + after_s) / 2 - keyboard_s))
        return min(readings)[1]
