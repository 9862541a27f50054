"""What oscillators answer to a drive, look by look."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.drive.sampled import SampledDrive
from stimuli.motion.motion import is_slow
from stimuli.motion.oscillators import followed, step_weights

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.drive.sampled import Drive
    from stimuli.motion.motion import Motion


_STEPS: Final = 128
"""Steps of the drive in a period of the reference frequency: between them it is a straight line."""

LOOKS: Final = 32
"""Looks at the displacement in such a period: with a parabola about the largest they hold the peak
to 0.05 dB, ripples of the next wave included."""

_CHUNK: Final = 1 << 20
"""Answers, of an oscillator at a look each, that are computed at once."""

_FEWEST: Final = 256

BLOCK: Final = 256
"""Looks at what swings freely that are computed at once."""

LATE: Final = 0.75
MOST_WAITS: Final = 8.0
NEIGHBOURS: Final = 2
"""A peak has so many looks beside it."""


class Course:
    """A drive in fine steps, and what the oscillators answer while it lasts.

    Beside them runs what the rest follows: the drive, late by the plate's relaxation time as all
    that bends slowly is. Left out, that microsecond costs a quiet finger a per cent.
    """

    def __init__(self, motion: Motion, drive: Drive) -> None:
        self._viscous_s = motion.viscous_s
        lag = [-1 / self._viscous_s] if self._viscous_s else []
        self._poles = np.append(motion.oscillators.poles, lag)
        # a slow drive is straight enough from look to look
        steps = LOOKS if is_slow(drive, motion.reference_hz) else _STEPS
        self._samples, self._step_s, self._held = _played(drive, steps * motion.reference_hz)
        self._every = max(1, round(1 / (LOOKS * motion.reference_hz * self._step_s)))
        self._samples = np.append(self._samples, np.zeros(-(self._samples.size - 1) % self._every))

    @property
    def look_s(self) -> float:
        """Time between two looks."""
        return self._every * self._step_s

    def looks(self) -> Iterator[tuple[Complex, Real]]:
        """Yield answers and what the rest follows at all looks, some at a time."""
        for first, found in self._stretches(self._every):
            shared = 0 if first == 0 else 1
            samples = self._samples[first :: self._every][: found.shape[1]]
            yield self._split(found[:, shared:], samples[shared:])

    def at(self, times_s: Real) -> Iterator[tuple[Complex, Real, NDArray[np.intp]]]:
        """Yield answers, what the rest follows, and which of the times these are."""
        place = times_s / self._step_s
        early = np.flatnonzero(place < 0)
        still = np.zeros((self._poles.size, early.size), dtype=np.complex128)
        yield *self._split(still, np.zeros(early.size)), early
        end = still[:, :0]
        for first, found in self._stretches(1):
            top = first + found.shape[1] - 1
            which = np.flatnonzero((place >= first) & (place < top))
            step = np.floor(place[which]).astype(np.intp)
            part, before = place[which] - step, self._samples[step]
            rise = 0.0 if self._held else (self._samples[step + 1] - before) * part
            turn = np.multiply.outer(self._poles, part * self._step_s)
            whole, late = step_weights(turn)
            driven = part * self._step_s * (whole * before + late * rise)
            answers = np.exp(turn) * found[:, step - first] + driven
            yield *self._split(answers, before + rise), which
            end = found[:, -1:]
        after = np.flatnonzero(place >= self._samples.size - 1)
        since_s = times_s[after] - (self._samples.size - 1) * self._step_s
        free = end * np.exp(np.multiply.outer(self._poles, since_s))
        yield *self._split(free, np.zeros(after.size)), after

    def _split(self, found: Complex, samples: Real) -> tuple[Complex, Real]:
        if not self._viscous_s:
            return found, samples
        return found[:-1], found[-1].real / self._viscous_s

    def _stretches(self, every: int) -> Iterator[tuple[int, Complex]]:
        """Yield the number of the first step and answers every so many; the ends are shared."""
        start = np.zeros(self._poles.size, dtype=np.complex128)
        length = every * max(_FEWEST, _CHUNK // self._poles.size)
        for first in range(0, self._samples.size - 1, length):
            some = self._samples[first : first + length + 1]
            found = followed(self._poles, some, self._step_s, start, held=self._held, every=every)
            start = found[:, -1]
            yield first, found


def _played(drive: Drive, least_rate_hz: float) -> tuple[Real, float, bool]:
    """Return a drive in fine steps up to its end, the step, and whether each is held."""
    if not isinstance(drive, SampledDrive):
        return np.append(drive.samples(least_rate_hz), 0.0), 1 / least_rate_hz, False
    fine = math.ceil(least_rate_hz / drive.sample_rate_hz)
    values = np.array(drive.values)
    if drive.held:
        samples = np.append(np.repeat(values, fine), 0.0)
    else:
        places = np.arange((values.size - 1) * fine + 1) / fine
        samples = np.interp(places, np.arange(values.size), values)
    return samples, 1 / (fine * drive.sample_rate_hz), drive.held


def widened(near: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the numbers of looks that are near a peak, and of those beside them."""
    if not np.any(near):
        return np.flatnonzero(near)
    wide = near.copy()
    wide[1:] |= near[:-1]
    wide[:-1] |= near[1:]
    return np.flatnonzero(wide if wide.sum() > NEIGHBOURS else np.ones_like(wide))


def crests(size: Real, looks: NDArray[np.intp] | None = None) -> Real:
    """Return the largest values along the last axis, each by a parabola about it.

    `looks` are the numbers of the looks where they are not all of them: a parabola goes through
    neighbours only.
    """
    lines = size.reshape(-1, size.shape[-1])
    top = np.minimum(np.maximum(np.argmax(lines, axis=-1), 1), size.shape[-1] - 2)
    every = np.arange(len(lines))
    before, at, after = (lines[every, top + shift] for shift in (-1, 0, 1))
    bend = np.maximum(2 * at - before - after, np.finfo(np.float64).tiny)
    inside = (at >= before) & (at >= after)
    if looks is not None:
        inside &= looks[top + 1] - looks[top - 1] == NEIGHBOURS
    found = np.where(inside, at + (after - before) ** 2 / (8 * bend), np.max(lines, axis=-1))
    return np.asarray(found.reshape(size.shape[:-1]))
