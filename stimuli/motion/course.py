"""What oscillators answer to a drive, look by look, and the peaks of what slow bursts leave."""

from __future__ import annotations

import math
from itertools import count
from typing import TYPE_CHECKING, Final, NamedTuple, TypeGuard

import numpy as np

from stimuli.drive.burst import Burst
from stimuli.drive.sampled import SampledDrive
from stimuli.drive.windows import sines
from stimuli.field.synthesis import MOST_TIME_S
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

_BESIDE: Final = 2
"""Blocks share so many looks, so that no peak is at the end of both."""

_GLANCES: Final = 64
_FAINT: Final = 1e-6
"""Part of what was found that is left out of what rings."""

_AT_ONCE: Final = 1e-6
"""Looks after which what follows at once does so where the plate has no relaxation time."""

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


class Part(NamedTuple):
    """A part of a slow burst, or what comes after it: there nothing drives the oscillators."""

    duration_s: float
    omegas: Real  # angular frequencies of its sines
    sine: Complex  # how the oscillators follow them, (n_poles, n_sines) each
    cosine: Complex
    phase: Real  # of the sines where it begins
    left: Complex  # what beside that decays freely, where it begins, (n_poles,)


def parts_of(poles: Complex, burst: Burst) -> Iterator[Part]:
    """Yield the parts of a burst as what oscillators do under them, the last without an end.

    Under a sin(omega t) an oscillator follows by A sin + B cos with A = -a p / (p^2 + omega^2) and
    B = -a omega / (p^2 + omega^2); what it does else decays as exp(p t).
    """
    state = np.zeros(poles.size, dtype=np.complex128)
    duration_s = burst.duration_s
    for one in sines(burst.window, burst.cycles):
        omegas = 2 * math.pi * np.array(one.ys) / duration_s
        driven = -np.array(one.amplitudes) / (poles[:, np.newaxis] ** 2 + omegas**2)
        sine, cosine = driven * poles[:, np.newaxis], driven * omegas
        phase = 2 * math.pi * np.array(one.ys) * one.begin
        left = state - sine @ np.sin(phase) - cosine @ np.cos(phase)
        long_s = (one.end - one.begin) * duration_s
        yield Part(long_s, omegas, sine, cosine, phase, left)
        phase = 2 * math.pi * np.array(one.ys) * one.end
        state = left * np.exp(poles * long_s) + sine @ np.sin(phase) + cosine @ np.cos(phase)
    none = np.zeros((poles.size, 0), dtype=np.complex128)
    yield Part(math.inf, none[0].real, none, none, none[0].real, state)


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
    top = np.clip(np.argmax(size, axis=-1), 1, size.shape[-1] - 2)
    before, at, after = (
        np.take_along_axis(size, (top + shift)[..., np.newaxis], axis=-1)[..., 0]
        for shift in (-1, 0, 1)
    )
    bend = np.maximum(2 * at - before - after, np.finfo(np.float64).tiny)
    inside = (at >= before) & (at >= after)
    if looks is not None:
        inside &= looks[top + 1] - looks[top - 1] == NEIGHBOURS
    return np.asarray(
        np.where(inside, at + (after - before) ** 2 / (8 * bend), np.max(size, axis=-1))
    )


class Rows(NamedTuple):
    """Displacements, each of some oscillators with weights, in groups whose largest counts."""

    weights: Complex  # (n_rows, n_poles)
    rest_m: Real  # what follows at once, (n_rows,)
    group: NDArray[np.intp]  # numbers from 0 on, (n_rows,)


def leaves_ringing(drive: Drive, reference_hz: float) -> TypeGuard[Burst]:
    """Tell whether a drive is a slow burst that is a sum of sines between its corners."""
    if not isinstance(drive, Burst):
        return False
    return is_slow(drive, reference_hz) and bool(sines(drive.window, drive.cycles))


def ringing_peaks(motion: Motion, burst: Burst, rows: Rows, *, wait_s: float) -> Real:
    """Return the largest displacement of each group under a slow burst and after it: (n_groups,).

    All follow a slow burst but for what rings after each of its corners. At any time that adds no
    more than the sum of all sizes, which decay: only what can be the largest then is looked at.
    How long after the burst is told in `peaks_of`.
    """
    look_s = 1 / (LOOKS * motion.reference_hz)
    lag_s = motion.viscous_s or _AT_ONCE * look_s
    poles = np.append(motion.oscillators.poles, -1 / lag_s)
    weights = np.concatenate([rows.weights, rows.rest_m[:, np.newaxis] / lag_s], axis=1)
    search = _Search(poles, rows._replace(weights=weights), look_s)
    *driven, after = parts_of(poles, burst)
    for part in driven:
        search.enter(part)
        for first in range(0, math.ceil(part.duration_s / look_s), BLOCK):
            search.look(math.floor(part.duration_s / look_s) + 1 - first)
    search.enter(after)
    decays, latest = bool(np.all(motion.oscillators.poles.real < 0)), 0.0
    for block in count(1):
        may_grow, grew = search.look(BLOCK)
        waited_s = block * BLOCK * look_s
        latest = waited_s if grew else latest
        if decays and not may_grow:
            break
        if waited_s > MOST_TIME_S or (not decays and waited_s >= MOST_WAITS * wait_s):
            break
        if not decays and waited_s >= wait_s and latest <= LATE * waited_s:
            break
    return search.found


class _Search:
    """The largest displacements of groups of rows, block by block of looks."""

    def __init__(self, poles: Complex, rows: Rows, look_s: float) -> None:
        self.found = np.zeros(int(rows.group.max()) + 1)
        self._rows, self._sizes, self._look_s = rows, np.abs(rows.weights), look_s
        self._turns = np.exp(np.multiply.outer(poles, look_s * np.arange(BLOCK + _BESIDE)))

    def enter(self, part: Part) -> None:
        """Begin with a part; what the rows do without ringing, less that, is found at once."""
        weights = self._rows.weights
        self._part, self._state, self._since_s = part, part.left, 0.0
        self._sine, self._cosine = (weights @ part.sine).real, (weights @ part.cosine).real
        self._steepest = np.hypot(self._sine, self._cosine) @ part.omegas
        self._ringing = self._sizes @ np.abs(part.left)
        if part.omegas.size:
            n_looks = math.floor(part.duration_s / self._look_s)
            times_s = self._look_s * np.round(np.linspace(0.0, n_looks, _GLANCES)).astype(
                np.float64
            )
            least = np.max(np.abs(self._smooth(times_s)), axis=1) - self._ringing
            np.maximum.at(self.found, self._rows.group, least)

    def _smooth(self, times_s: Real, some: NDArray[np.intp] | None = None) -> Real:
        """Return what rows do without ringing: (n_rows, n_times)."""
        angle = np.multiply.outer(self._part.omegas, times_s) + self._part.phase[:, np.newaxis]
        sine, cosine = self._sine, self._cosine
        if some is not None:
            sine, cosine = sine[some], cosine[some]
        return np.asarray(sine @ np.sin(angle) + cosine @ np.cos(angle))

    def look(self, n_left: int) -> tuple[bool, bool]:
        """Take the next block into account; tell whether anything could have grown, and did."""
        n, group = min(n_left, BLOCK + _BESIDE), self._rows.group
        span_s, grew = n * self._look_s, False
        middle = np.abs(self._smooth(np.array([self._since_s + span_s / 2]))[:, 0])
        most = middle + self._steepest * span_s / 2
        if np.any(most + self._ringing > self.found[group]):
            self._ringing = self._sizes @ np.abs(self._state)
        some = np.flatnonzero(most + self._ringing > self.found[group])
        if some.size and n > _BESIDE:
            grew = self._look_at(some, n)
        self._state = self._state * self._turns[:, BLOCK]
        self._since_s += BLOCK * self._look_s
        return bool(some.size), grew

    def _look_at(self, some: NDArray[np.intp], n: int) -> bool:
        group = self._rows.group[some]
        before = self.found[group]
        smooth = self._smooth(self._since_s + self._look_s * np.arange(n, dtype=np.float64), some)
        high = np.abs(smooth) + self._ringing[some, np.newaxis] > before[:, np.newaxis]
        looks = widened(np.any(high, axis=0))
        if not looks.size:
            return False
        counting = self._counting(some, before)
        free = self._rows.weights[np.ix_(some, counting)] * self._state[counting]
        turns = self._turns[np.ix_(counting, looks)]
        ringing = free.real @ turns.real - free.imag @ turns.imag
        np.maximum.at(self.found, group, crests(np.abs(smooth[:, looks] + ringing), looks))
        return bool(np.any(self.found[group] > before))

    def _counting(self, some: NDArray[np.intp], found: Real) -> NDArray[np.intp]:
        """Return the oscillators that count for some rows."""
        if not np.all(found > 0):
            return np.arange(self._state.size)
        part = np.max(self._sizes[some] / found[:, np.newaxis], axis=0) * np.abs(self._state)
        order = np.argsort(part)
        return np.sort(order[np.cumsum(part[order]) > _FAINT])
