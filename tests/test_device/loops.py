"""A line from outputs back to inputs, and what may happen to a burst on it."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from device.monitor.measured import Fault, Planned
from tests.test_device.bursts import BURST

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.driver import FloatArray
    from device.sound.player import Frames

FULL_SCALE_V: Final = 125.0
"""What a sound card puts out at full scale."""
LEVEL_VPP: Final = 100.0
DELAY: Final = 240.0
SIDES: Final = {"left": (0, 1, 0), "right": (1, 0, 1), "both": (2, 1, 1), "none": (3, 0, 0)}
"""Slot, and which channels sound."""


def planned(side: str) -> Planned:
    """Return what is planned of a burst of `LEVEL_VPP`."""
    peak = LEVEL_VPP / 2
    peaks = tuple(peak * sounds for sounds in SIDES[side][1:])
    return Planned(shape=BURST, sample_rate_hz=48e3, peaks=peaks, burst=(peak, peak))


class Line:
    """A line for some channels.

    Delays in frames, one for each; `noise` is the effective value of what is added, of full scale.
    `path` gets what was put in so far, shape (n, channels) of full scale, the latest last, and
    returns what is led on.
    """

    _TAPS: Final = 32
    _KEPT: Final = 4096
    _PIECE: Final = 512

    def __init__(self, *, seed: int, channels: int = 2) -> None:
        self.delays = [DELAY] * channels
        self.noise = 0.0
        self.path: Callable[[FloatArray], FloatArray] = lambda past: past
        self._rng = np.random.default_rng(seed)
        self._past = np.zeros((self._KEPT, channels))

    def put(self, out: Frames) -> None:
        """Put frames in."""
        self._past = np.concatenate((self._past[len(out) :], out / 32768.0))

    def heard(self, count: int, *, ahead: int = 0) -> Frames:
        """Return the last frames that come out; `ahead` of those that were put in."""
        heard = self.noise * self._rng.normal(size=(count, len(self.delays)))
        if self._past.any():
            path = self.path(self._past)
            for i, delay in enumerate(self.delays):
                heard[:, i] += self._later(path[:, i], delay - ahead, count)
        codes: Frames = np.clip(np.rint(heard * 32768), -32768, 32767).astype(np.int16)
        return codes

    def through(self, out: Frames) -> Frames:
        """Put frames in, and return as many that come out."""
        led: Frames = np.empty_like(out)
        for first in range(0, len(out), self._PIECE):
            piece = out[first : first + self._PIECE]
            self.put(piece)
            led[first : first + len(piece)] = self.heard(len(piece))
        return led

    def _later(self, past: FloatArray, delay: float, count: int) -> FloatArray:
        """Return the last of `past` as they arrive later, by an interpolation of 32 values."""
        whole = int(delay)
        taps = _taps(self._TAPS, delay - whole)
        last = self._KEPT - whole + self._TAPS // 2
        stretch = past[last - count - self._TAPS + 1 : last]
        return np.asarray(np.convolve(stretch, taps, "valid"), dtype=np.float64)


@lru_cache
def _taps(count: int, delay: float) -> FloatArray:
    at = np.arange(count) - count / 2 - delay
    return np.array(np.sinc(at) * np.cos(np.pi * at / (count + 2)) ** 2, dtype=np.float64)


def clipped(past: FloatArray) -> FloatArray:
    most = 0.75 * LEVEL_VPP / 2 / FULL_SCALE_V
    return np.clip(past, -most, most)


def again(frames: int, gain: float = 0.5) -> Callable[[FloatArray], FloatArray]:
    return lambda past: past + gain * np.roll(past, frames, axis=0)


def scaled(gain: float) -> Callable[[FloatArray], FloatArray]:
    return lambda past: gain * past


def lost(past: FloatArray) -> FloatArray:
    """Lose 20 frames out of the middle of a burst."""
    sounding = np.flatnonzero(past.any(axis=1))
    if len(sounding):
        past = past.copy()
        past[sounding[0] + 20 : sounding[0] + 40] = 0
    return past


FAULTS: Final[dict[str, tuple[Callable[[FloatArray], FloatArray], set[Fault]]]] = {
    "silence": (scaled(0.0), {Fault.SILENT}),
    "swap": (lambda past: past[:, ::-1], {Fault.SWAPPED}),
    "on both": (lambda past: past + past[:, ::-1], {Fault.STRAY}),
    "too weak": (scaled(0.89), {Fault.WEAK}),
    "too strong": (scaled(1.11), {Fault.STRONG}),
    "clipped": (clipped, {Fault.CLIPPED, Fault.WEAK}),
    "again at once": (again(97), {Fault.DOUBLED}),
    "again later": (again(2000), {Fault.DOUBLED}),
    "again on top": (again(30), set(Fault)),
    "frames lost": (lost, {Fault.WEAK, Fault.DISTORTED}),
    "inverted": (scaled(-1.0), set(Fault)),
}
"""What happens on the line, and what may be told of it."""


def clean_gain(noise_db: float, tolerance: float = 0.1) -> float:
    """Return by how much a burst of one cycle at 48 kHz may differ and still never be blamed.

    A tolerance is kept at 3.5 standard deviations of the noise; 4.5 more are no chance in 10 000.
    """
    sd = 10 ** (-noise_db / 20) * np.sqrt(0.5 / 48)
    return float(min(0.03, tolerance - (3.5 + 4.5) * 1.03 * sd))
