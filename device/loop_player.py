"""What feeds a sound card with a loop that is faded in and out, and what it notices meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from device.player import Counter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from device.clock import Clock
    from device.player import Frames, Status, Timing

_MARK_EVERY_S: Final = 0.5
_MARKS_KEPT: Final = 21


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """How many frames the sound card had taken when it came for more.

    Attributes
    ----------
    at_s : float
        Host time of the call.
    frames : int
        Taken since the stream was opened, those of this call included.
    """

    at_s: float
    frames: int


class LoopPlayer(Counter):
    """The callback of an output stream that repeats a loop on both channels.

    It takes no lock and waits for nothing: other threads read whole objects. It begins with a
    fade-in, and `fade_out` ends it; the gain goes like a squared sine between 0 and 1.

    Parameters
    ----------
    loop : ndarray of int16, shape (n,)
        The samples.
    clock : Clock
        The host's.
    fade_in, fade_out : int
        Frames from silence to full level, and back.

    Attributes
    ----------
    last : Mark or None
        The last call.
    marks : tuple of Mark
        Calls of the last ten seconds, every half second; the oldest first.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from device.clock import VirtualClock
    >>> player = LoopPlayer(np.array([100, -100, 50], dtype=np.int16), VirtualClock(),
    ...                     fade_in=2, fade_out=2)
    >>> out = np.zeros((7, 2), dtype=np.int16)
    >>> player(out, 7, SimpleNamespace(), SimpleNamespace(output_underflow=False))
    >>> out[:, 0].tolist(), player.full
    ([50, -100, 50, 100, -100, 50, 100], True)
    """

    def __init__(
        self, loop: NDArray[np.int16], clock: Clock, *, fade_in: int, fade_out: int
    ) -> None:
        super().__init__()
        self._loop = loop
        self._clock = clock
        self._at = 0
        self._opened = 0.0
        self._step = 1 / fade_in
        self._fade_out = fade_out
        self.last: Mark | None = None
        self.marks: tuple[Mark, ...] = ()

    @property
    def full(self) -> bool:
        """Whether the sound card has got all of the fade-in."""
        return self._opened == 1

    @property
    def silent(self) -> bool:
        """Whether the sound card has got all of the fade-out, or nothing yet."""
        return self._opened == 0

    def fade_out(self) -> None:
        """Begin to fall silent with the next buffer."""
        self._step = -1 / self._fade_out

    def __call__(self, out: Frames, count: int, timing: Timing, status: Status) -> None:
        """Fill one buffer, shape (count, 2)."""
        self.count(count, status)
        out[:] = self._next(count)[:, np.newaxis]
        self.last = Mark(at_s=self._clock.now_s(), frames=self.frames)
        if not self.marks or self.last.at_s >= self.marks[-1].at_s + _MARK_EVERY_S:
            self.marks = (*self.marks[1 - _MARKS_KEPT :], self.last)

    def _next(self, count: int) -> NDArray[np.int16]:
        step = self._step
        piece: NDArray[np.int16] = self._loop.take(
            np.arange(self._at, self._at + count), mode="wrap"
        )
        self._at = (self._at + count) % len(self._loop)
        if self._opened == 1 and step > 0:
            return piece
        opened = np.clip(self._opened + step * np.arange(1, count + 1), 0, 1)
        self._opened = float(opened[-1])
        faded: NDArray[np.int16] = np.rint(piece * np.sin(np.pi / 2 * opened) ** 2).astype(np.int16)
        return faded
