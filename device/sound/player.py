"""What feeds a sound card: a burst or a faded loop, else zeros; and what it noticed meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from device.clock import Clock

Frames: TypeAlias = NDArray[np.int16]


class Timing(Protocol):
    """What PortAudio reports to a callback of time, in seconds of its own clock."""

    currentTime: float  # noqa: N815 - PortAudio's name
    outputBufferDacTime: float  # noqa: N815 - PortAudio's name


class StreamStatus(Protocol):
    """What PortAudio reports to a callback of trouble."""

    output_underflow: bool


@dataclass(slots=True, kw_only=True, eq=False)
class SoundBurst:
    """A burst on its way to the sound card.

    Attributes
    ----------
    frames : ndarray of int16, shape (n, n_channels)
        What is to be played.
    taken : int
        Number of frames that the card has taken.
    first : int
        Frame of the stream at which the burst begins.
    began_s, ended_s : float
        Host times at which the card took the first frame and the last.
    latency_s : float
        Longest time to its output that PortAudio reported, buffer included.
    callbacks_after : int
        How often the card came for more after the last frame.
    clean : bool
        Whether the card has not reported that it ran out of frames.
    cut : bool
        Whether a stop came in between.
    """

    frames: Frames
    taken: int = 0
    first: int = 0
    began_s: float = 0.0
    ended_s: float = 0.0
    latency_s: float = 0.0
    callbacks_after: int = 0
    clean: bool = True
    cut: bool = False

    @property
    def is_complete(self) -> bool:
        """Whether every frame was taken."""
        return self.taken == len(self.frames)

    def is_settled(self, now_s: float) -> bool:
        """Return whether nothing more will be known: it was cut, or it must have come out."""
        heard = now_s >= self.ended_s + self.latency_s and self.callbacks_after > 0
        return self.cut or (self.is_complete and heard)


class Counter:
    """What every callback of an output stream counts."""

    def __init__(self) -> None:
        self.frames = 0
        self.underruns = 0

    def count(self, count: int, status: StreamStatus) -> None:
        """Note one buffer of `count` frames."""
        self.frames += count
        if status.output_underflow:
            self.underruns += 1


class Player(Counter):
    """The callback of an output stream.

    It takes no lock and waits for nothing: it and the threads that call it exchange whole objects.

    >>> from types import SimpleNamespace
    >>> from device.clock import VirtualClock
    >>> player = Player(VirtualClock(), 48e3)
    >>> player.mute(on=False)
    >>> burst = player.play(np.array([[5, 0], [-5, 0]], dtype=np.int16), 0.01)
    >>> out = np.ones((3, 2), dtype=np.int16)
    >>> player(out, 3, SimpleNamespace(currentTime=1.0, outputBufferDacTime=1.02),
    ...        SimpleNamespace(output_underflow=False))
    >>> out[:, 0].tolist(), out[:, 1].tolist(), burst.is_complete, player.frames
    ([5, -5, 0], [0, 0, 0], True, 3)
    """

    def __init__(self, clock: Clock, sample_rate_hz: float) -> None:
        super().__init__()
        self._clock = clock
        self._rate_hz = sample_rate_hz
        self._burst: SoundBurst | None = None
        self._muted = True

    def mute(self, *, on: bool) -> None:
        """Play zeros from the next buffer on instead of any burst; or play bursts again."""
        self._muted = on

    def play(self, frames: Frames, latency_s: float) -> SoundBurst:
        """Begin to play with the next buffer, by a stream of this latency in seconds."""
        burst = SoundBurst(frames=frames, latency_s=latency_s)
        self._burst = burst
        return burst

    def forget(self) -> None:
        """Play no burst any more."""
        self._burst = None

    def __call__(self, out: Frames, count: int, timing: Timing, status: StreamStatus) -> None:
        """Fill one buffer, shape (count, n_channels)."""
        out.fill(0)
        burst = self._burst
        self.count(count, status)
        if burst is None:
            return
        if status.output_underflow and burst.taken:
            burst.clean = False
        if burst.is_complete:
            burst.callbacks_after += 1
        elif self._muted:
            burst.cut = True
        elif not burst.cut:
            self._fill(out, count, timing, burst)

    def _fill(self, out: Frames, count: int, timing: Timing, burst: SoundBurst) -> None:
        now_s = self._clock.now_s()
        if not burst.taken:
            burst.began_s = now_s
            burst.first = self.frames - count
        latency_s = timing.outputBufferDacTime - timing.currentTime + count / self._rate_hz
        burst.latency_s = max(burst.latency_s, latency_s)
        piece = burst.frames[burst.taken : burst.taken + count]
        out[: len(piece)] = piece
        burst.ended_s = now_s
        burst.taken += len(piece)


_MARK_EVERY_S: Final = 0.5
_MARKS_KEPT: Final = 21


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """How many frames the sound card had taken when it came for more.

    `frames` counts from the opening of the stream, those of this call included.
    """

    at_s: float
    frames: int


class LoopPlayer(Counter):
    """The callback of an output stream that repeats a loop on every channel.

    It takes no lock and waits for nothing: other threads read whole objects. It begins with a
    fade-in, and `fade_out` ends it; the gain goes like a squared sine between 0 and 1.

    `marks` are the calls of the last ten seconds, every half second, the oldest first.

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

    def __call__(self, out: Frames, count: int, timing: Timing, status: StreamStatus) -> None:
        """Fill one buffer, shape (count, n_channels)."""
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
