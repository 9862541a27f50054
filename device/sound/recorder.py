"""What the inputs of a sound card hear: the last seconds of them, frame by frame, and when."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

if TYPE_CHECKING:
    from device.clock import Clock
    from device.sound.player import Frames

KEPT_S: Final = 5.0
"""So long a record is; a part that is to be looked at is held, whatever comes after it."""
_MARK_EVERY_S: Final = 0.025
_MARKS: Final = 120
"""Three seconds of them: a sound system's word of its latency jumps by a buffer, and may stay so
for a while."""
_OUTSIDE: Final = 0.025
"""Of the marks on either side: 95 % of them say how far their word is to be trusted."""
_MAX_DELAY_S: Final = 1.0
"""A sound system that reports a longer one is wrong."""
_SETTLED_S: Final = 1.0
_ABOVE_LATENCY_S: Final = 0.1
"""A sound server that has just begun reports half a second, and is wrong."""


class InputTiming(Protocol):
    """What PortAudio reports to a callback of time, in seconds of its own clock."""

    currentTime: float  # noqa: N815 - PortAudio's name
    inputBufferAdcTime: float  # noqa: N815 - PortAudio's name


class InputStatus(Protocol):
    """What PortAudio reports to a callback of trouble: frames were lost, or put in as zeros."""

    input_overflow: bool
    input_underflow: bool


class Recorder:
    """The callback of an input stream: some of its channels, in a ring.

    It takes no lock and waits for nothing. Frames are counted from the opening of the stream;
    `first` is the first that is there without a gap up to the last, `frames - 1`. `opened` counts
    the streams, `latency_s` is what PortAudio states of this one's inputs.

    >>> from types import SimpleNamespace
    >>> from device.clock import VirtualClock
    >>> recorder = Recorder(VirtualClock(), 48e3)
    >>> recorder.take(np.array([[1, 2], [3, 4]], dtype=np.int16),
    ...               SimpleNamespace(currentTime=1.0, inputBufferAdcTime=0.9),
    ...               SimpleNamespace(input_overflow=False, input_underflow=False))
    >>> recorder.frames, recorder.frames_between(0, 2).tolist()
    (2, [[1, 2], [3, 4]])
    """

    def __init__(
        self, clock: Clock, sample_rate_hz: float, *, channels: tuple[int, ...] = (1, 2)
    ) -> None:
        self.sample_rate_hz = sample_rate_hz
        self.channels = channels
        self._clock = clock
        self._columns = [channel - 1 for channel in channels]
        self._size = round(KEPT_S * sample_rate_hz)
        self._apart = _MARK_EVERY_S * sample_rate_hz
        self._ring = np.zeros((self._size, len(channels)), dtype=np.int16)
        self.opened = 0
        self.restart()

    def restart(self) -> None:
        """Count the frames from zero, for a stream that is opened."""
        self.opened += 1
        self.latency_s = 0.0
        self.frames = self.first = 0
        self.gaps = self._whole_from = 0
        self._held_from: int | None = None
        self._marks: tuple[tuple[int, float, float], ...] = ()

    @property
    def settled(self) -> bool:
        """Whether a second has come without a gap, at times that can be meant."""
        return not self.unsettled

    @property
    def unsettled(self) -> str:
        """Why it is not settled; empty if it is."""
        last = self.frames - _SETTLED_S * self.sample_rate_hz
        if self._whole_from > last:
            return f"{self.frames} frames came, with {self.gaps} gaps"
        delays_s = (delay_s for first, _, delay_s in self._marks if first >= last)
        max_delay_s = max(delays_s, default=0.0)
        if max_delay_s <= self.latency_s + _ABOVE_LATENCY_S:
            return ""
        return (
            f"the sound system states a latency of {max_delay_s:.3g} s, more than "
            f"{_ABOVE_LATENCY_S:g} s above PortAudio's {self.latency_s:.3g} s"
        )

    def hold(self, first: int) -> None:
        """Keep the frames from this one on, as many as fit in, until the next call."""
        self._held_from = first

    def release(self) -> None:
        """Take what comes, over what was held."""
        if self._held_from is not None and self.frames > self._held_from + self._size:
            self.first = self.frames
        self._held_from = None

    def take(self, heard: Frames, timing: InputTiming, status: InputStatus) -> None:
        """Keep one buffer, shape (n, channels of the stream)."""
        count = len(heard)
        delay_s = timing.currentTime - timing.inputBufferAdcTime
        if not 0 < delay_s < _MAX_DELAY_S:
            delay_s = count / self.sample_rate_hz
        if not self._marks or self.frames >= self._marks[-1][0] + self._apart:
            mark = self.frames, self._clock.now_s() - delay_s, delay_s
            self._marks = (*self._marks[1 - _MARKS :], mark)
        if status.input_overflow or status.input_underflow:
            self.gaps += 1
            self._whole_from = self.frames + count
        held = self._held_from
        room = count if held is None else max(0, min(count, held + self._size - self.frames))
        if room:
            places = np.arange(self.frames, self.frames + room) % self._size
            self._ring[places] = heard[:room, self._columns]
        self.frames += count
        if held is None:
            self.first = max(self.first, self.frames - self._size)

    def frames_between(self, first: int, last: int) -> Frames:
        """Return frames from `first` up to `last`, which is not among them; what is there."""
        low = self.first if self._held_from is None else self._held_from
        high = self.frames if self._held_from is None else self._held_from + self._size
        places = np.arange(max(first, low), min(last, high, self.frames)) % self._size
        taken: Frames = self._ring[places]
        return taken

    def time_of(self, frame: float) -> tuple[float, float]:
        """Return when a frame was recorded on the host's clock, and the 95 % half-width.

        The half-width is the variation of the input latency that the sound system states, which
        includes the drift of the two clocks, plus that latency itself, which is not measured.
        """
        times_s = [at_s + (frame - first) / self.sample_rate_hz for first, at_s, _ in self._marks]
        if not times_s:
            return self._clock.now_s(), _MAX_DELAY_S
        low, middle, high = np.quantile(times_s, (_OUTSIDE, 0.5, 1 - _OUTSIDE))
        return float(middle), float(max(middle - low, high - middle)) + self.latency_s
