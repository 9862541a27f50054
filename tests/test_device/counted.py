"""Frames that carry their number through a sound server, so that what it tears is known."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.processes import NullSink

LOST: Final = -1
"""What is no frame of the outputs: the server put silence in."""
FIRST_EIGHT: Final = (
    "front-left,front-right,rear-left,rear-right,front-center,lfe,side-left,side-right"
)
"""As ALSA has them; what follows is aux0, aux1, ...: any other map, and the server would mix."""


def channel_map(channels: int) -> str:
    return ",".join([*FIRST_EIGHT.split(","), *(f"aux{i}" for i in range(24))][:channels])


@contextmanager
def wide_sink(null_sink: NullSink, channels: int) -> Iterator[None]:
    """Have a null sink of so many channels, and make it the system's default."""
    words = f"sink_name=wide rate=48000 format=s16le channels={channels}".split()
    words.append(f"channel_map={channel_map(channels)}")
    number = null_sink.control("load-module", "module-null-sink", *words)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PULSE_SINK", "wide")
        patch.setenv("PULSE_SOURCE", "wide.monitor")
        try:
            yield
        finally:
            null_sink.control("unload-module", number)


class Torn(NamedTuple):
    """From this frame of the inputs on they lag by so many frames behind the outputs."""

    frame: int
    lag: int


class FrameCount:
    """Two channels with the number of each frame of the outputs, and what the inputs hear of it."""

    def __init__(self) -> None:
        self.torn = [Torn(0, LOST)]
        self._heard = 0

    @staticmethod
    def put(out: Any, first: int) -> None:
        """Fill two channels, shape (n, 2), of frames from `first` on."""
        numbers = np.arange(first + 1, first + len(out) + 1)
        out[:, 0], out[:, 1] = numbers & 0x7FFF, numbers >> 15

    def note(self, heard: Any, first: int) -> None:
        """Read two channels of the inputs, from their frame `first` on."""
        told = heard[:, 0] + (heard[:, 1].astype(np.int64) << 15)
        frames = np.arange(first, first + len(heard))
        lag = np.where(told > 0, frames + 1 - told, LOST)
        for i in np.flatnonzero(np.diff(lag, prepend=self.torn[-1].lag)):
            self.torn.append(Torn(int(frames[i]), int(lag[i])))
        self._heard = first + len(heard)

    def steady_for(self) -> int:
        """Return how many frames came without a tear until now; 0 while none is heard."""
        return 0 if self.torn[-1].lag == LOST else self._heard - self.torn[-1].frame

    def numbers(self, first: int, last: int) -> Any:
        """Return which frames of the outputs these of the inputs are; LOST is none."""
        numbers = np.full(last - first, LOST)
        ends = [one.frame for one in self.torn[1:]] + [self._heard]
        for (frame, lag), end in zip(self.torn, ends, strict=True):
            begin, until = max(frame, first), min(end, last)
            if begin < until and lag != LOST:
                numbers[begin - first : until - first] = np.arange(begin, until) - lag
        return numbers

    def lag_of(self, first: int, count: int) -> int | None:
        """Return by how much these frames of the outputs are heard later; None: not as a whole."""
        end = self._heard
        for frame, lag in reversed(self.torn):
            if lag != LOST and frame <= first + lag and first + count + lag <= end:
                return lag
            end = frame
        return None
