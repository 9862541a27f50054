"""How far points of a scene move: the largest displacement over time, and its error."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.drive.sampled import SampledDrive
from stimuli.field.synthesis import MOST_TIME_S
from stimuli.motion.motion import is_slow
from stimuli.motion.oscillators import followed, moved, step_weights

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.drive.sampled import Drive
    from stimuli.motion.motion import Motion
    from stimuli.strip.strip import Strip


_STEPS: Final = 128
"""Steps of the drive in a period of the reference frequency: between them it is a straight line."""

LOOKS: Final = 32
"""Looks at the displacement in such a period: with a parabola about the largest they hold the peak
to 0.05 dB, ripples of the next wave included."""

_CHUNK: Final = 1 << 12
"""Looks that are computed at once."""

_PARTS: Final = 2
_LATE: Final = 0.75
_MOST_WAITS: Final = 8.0
_CHECKED: Final = 7
"""The error is estimated at every so many points, and when the peak is."""

_NEAR, _NEIGHBOURS = 0.5, 2
"""Only where those move by this part of their largest value all points are looked at; a peak has
so many looks beside it."""

_PATCHED: Final = 0.03
"""Part of the own finger's displacement that has to be known where patches count."""

TOO_MANY_FOR_PATCHES: Final = "the plate has too many modes for its patches"
"""How a refusal begins, for who says it in other words."""

_SLOWLY: Final = 3.0
"""What more functions changed is multiplied with: as many again would still change some of it."""

_SLOWEST: Final = 0.1
"""Slowest wave that is waited for, as a part of 2 pi / W times 2 sqrt(D / (rho h))."""

_SHIFTED: Final = 3.0, 0.5
"""What peaks change by without the upper half octave, and without the octave, is multiplied with:
one of the two may vanish by chance. Over 48 cases the sum of doubts was above 1.3 errors."""

INTERPOLATED: Final = 2e-4
"""Part of a displacement that straight lines between the steps of a drive may cost."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Peaks:
    """The largest displacements.

    Attributes
    ----------
    peak_m : ndarray of float64, shape (n_groups, n_loads)
        Largest absolute value over a group of points and over time.
    error_m : ndarray of float64, same shape
        Estimate of its error.
    """

    peak_m: Real
    error_m: Real


def peaks_of(
    motion: Motion,
    groups: Sequence[NDArray[np.intp]],
    drive: Drive,
    *,
    wait_s: float,
    with_error: bool = True,
) -> Peaks:
    """Return the largest displacements of groups of points under a drive.

    Parameters
    ----------
    motion : Motion
        The scene as oscillators.
    groups : sequence of ndarray of int
        Numbers of the points of each group.
    drive : Drive
        What each load is driven with, by itself.
    wait_s : float
        How long after the drive is looked at least. Where there is loss, it goes on as long as all
        oscillators together could give a larger value than was found; without loss, where that
        is forever, up to eight times as long if the largest value comes late.
    with_error : bool
        Whether the error is asked for; else it is left 0.
    """
    oscillators = motion.oscillators
    checked = [group[::_CHECKED] for group in groups]
    doubtful = checked if with_error else []
    rows = [LoadedRow(motion, load, doubtful) for load in range(oscillators.rest_m.shape[0])]
    decays = bool(np.all(oscillators.poles.real < 0))
    found = np.zeros((len(groups), len(rows)))
    # the checked points' alone; with each of two doubts added; with each taken off
    doubted = np.zeros((5, *found.shape))
    latest = 0.0
    for waited, answers, samples in _course(motion, drive, wait_s):
        before = found.copy()
        for column, row in enumerate(rows):
            for line, (group, some) in enumerate(zip(groups, checked, strict=True)):
                moved_m = moved(row.weights[some], row.rest_m[some], answers, samples)
                at = _near(np.max(np.abs(moved_m), axis=0), found[line, column])
                if at.size:
                    whole_m = moved(
                        row.weights[group], row.rest_m[group], answers[:, at], samples[at]
                    )
                    largest_m = np.max(crests(np.abs(whole_m)))
                    found[line, column] = max(found[line, column], largest_m)
                if not with_error:
                    continue
                doubts = row.doubts(line, answers, samples)
                signed = [sign * doubt for sign in (1, -1) for doubt in doubts]
                sums = [moved_m, *(moved_m + doubt for doubt in signed)]
                largest = [np.max(np.abs(one)) for one in sums]
                doubted[:, line, column] = np.maximum(doubted[:, line, column], largest)
        latest = waited if np.any(found > before) else latest
        last = np.abs(answers[:, -1])
        left_m = [[np.max(np.abs(row.weights[group]) @ last) for row in rows] for group in groups]
        if waited > 0 and decays and (np.all(left_m <= found) or waited * wait_s > MOST_TIME_S):
            break
        if not decays and waited >= 1 and (latest <= _LATE * waited or waited >= _MOST_WAITS):
            break
    if not with_error:
        return Peaks(peak_m=found, error_m=np.zeros_like(found))
    apart = np.abs(doubted[1:] - doubted[0]).reshape(2, 2, *found.shape)
    error_m = apart.max(axis=0).sum(axis=0) + INTERPOLATED * found
    if motion.coarser:
        half, octave = (
            np.abs(peaks_of(coarse, groups, drive, wait_s=wait_s, with_error=False).peak_m - found)
            for coarse in motion.coarser
        )
        error_m = error_m + np.maximum(_SHIFTED[0] * half, _SHIFTED[1] * octave)
    return Peaks(peak_m=found, error_m=error_m)


def _near(size: Real, found: float) -> NDArray[np.intp]:
    """Return the numbers of looks that may hold the peak, and those beside them.

    `size` are the largest values over some of the points, `found` what was found before.
    """
    near = size >= _NEAR * max(float(np.max(size)), found)
    if not np.any(near):
        return np.flatnonzero(near)
    wide = near.copy()
    wide[1:] |= near[:-1]
    wide[:-1] |= near[1:]
    return np.flatnonzero(wide if wide.sum() > _NEIGHBOURS else np.ones_like(wide))


class PatchesUnknownError(ValueError):
    """What a load does to a plate with patches is not known well enough.

    >>> PatchesUnknownError(0, 0.0301).words
    'is known to 3.1% only, 3% is the most'
    """

    def __init__(self, load: int, part: float) -> None:
        self.load = load
        self.words = (
            f"is known to {math.ceil(1000 * part) / 10:g}% only, {_PATCHED:.0%} is the most"
        )
        super().__init__(f"loads[{load}]: the displacement with patches {self.words}")


def patched_peaks(
    strip: Strip,
    found: Iterable[Motion],
    groups: Sequence[NDArray[np.intp]],
    drive: Drive,
    *,
    wait_s: float,
) -> Peaks:
    """Return the same of a plate with patches, which only its modes know: in two sizes, (84).

    ValueError where the plate has too many modes, or its displacement is not known well enough.
    """
    sizes = list(found)
    if not sizes:
        raise ValueError(f"{TOO_MANY_FOR_PATCHES} to be counted, got length_m = {strip.length_m!r}")
    last = first = peaks_of(sizes[-1], groups, drive, wait_s=wait_s)
    if len(sizes) > 1:
        first = peaks_of(sizes[0], groups, drive, wait_s=wait_s, with_error=False)
    error_m = last.error_m + _SLOWLY * np.abs(last.peak_m - first.peak_m)
    # what is not known of the finger that moves most is known of no other one
    most, columns = np.argmax(last.peak_m, axis=0), np.arange(last.peak_m.shape[1])
    part = error_m[most, columns] / last.peak_m[most, columns]
    error_m = np.maximum(error_m, part * last.peak_m)
    known = np.max(error_m, axis=0) / np.max(last.peak_m, axis=0)
    # of equal ones the first, whatever the rounding
    load = int(np.argmax(known >= (1 - 1e-6) * np.max(known)))
    if not known[load] <= _PATCHED:
        raise PatchesUnknownError(load, float(known[load]))
    return Peaks(peak_m=last.peak_m, error_m=error_m)


def wait_of(strip: Strip, far_m: float) -> float:
    """Return how long after the drive the slow waves just above a cut-off may bring the peak.

    They spread like heat: the longest waves have come when 2 sqrt(D / (rho h)) t is the square
    of the distance. Far away the faster ones count. On a plate with ends the way over an end is
    the longer one.
    """
    material = strip.material
    spread = math.sqrt(strip.bending_stiffness_n_m / (material.density_kg_m3 * strip.thickness_m))
    far_m += strip.length_m or 0.0
    slowest_m_s = _SLOWEST * 4 * math.pi * spread / strip.width_m
    return min(far_m**2 / (2 * spread), far_m / slowest_m_s) + 1 / strip.cutoff_hz()


class LoadedRow:
    """What the oscillators do for one load, and what is uncertain of it."""

    def __init__(self, motion: Motion, load: int, checked: Sequence[NDArray[np.intp]]) -> None:
        self._late, self._turned = motion.late, motion.turned
        unsure_m = motion.unsure()[load] if motion.unsure is not None and checked else None
        self._unsure_m = [None if unsure_m is None else unsure_m[group] for group in checked]
        self.weights = motion.oscillators.weights(load)
        self.rest_m = motion.oscillators.rest_m[load]
        self._some = [self.weights[group] for group in checked]
        late = motion.oscillators.poles[self._late]
        self._at_once = [(some[:, self._late] / late).sum(axis=1).real for some in self._some]

    def doubts(self, line: int, answers: Complex, samples: Real) -> tuple[Real, Real]:
        """Return what may have to be added at the checked points of a group.

        First the inertia of the upper modes, more than that of all which are left out, then what
        comes round after half the length of an endless strip, or what is unsure at rest.
        """
        some, late = self._some[line], self._late
        inertia = moved(some[:, late], self._at_once[line], answers[late], samples)
        around = np.zeros_like(inertia)
        if self._turned is not None:
            around = moved(some * self._turned, np.zeros(len(some)), answers, samples)
        unsure_m = self._unsure_m[line]
        if unsure_m is not None:
            around = np.multiply.outer(unsure_m, samples)
        return inertia, around


def _course(motion: Motion, drive: Drive, wait_s: float) -> Iterator[tuple[float, Complex, Real]]:
    """Yield the answers of all oscillators and what the rest follows, stretch of time by stretch.

    With them comes how long after the drive the stretch ends, in units of `wait_s`. The looks at
    them are equally far apart, and a stretch begins with the last two of the one before, so that
    a largest value between them is not missed.
    """
    course = Course(motion, drive)
    poles = motion.oscillators.poles
    seen, followed_by = np.zeros((poles.size, 0), dtype=np.complex128), np.zeros(0)
    for answers, late in course.looks():
        seen, followed_by = np.append(seen[:, -2:], answers, 1), np.append(followed_by[-2:], late)
        yield 0.0, seen, followed_by
    n_looks = max(2, math.ceil(wait_s / (_PARTS * course.look_s)))
    turns = np.exp(np.multiply.outer(poles, course.look_s * np.arange(1, n_looks + 1)))
    for part in count(1):
        seen = np.append(seen[:, -2:], seen[:, -1:] * turns, axis=1)
        followed_by = np.append(followed_by[-2:], np.zeros(n_looks))
        yield part * n_looks * course.look_s / wait_s, seen, followed_by


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
        for first, found in self._stretches():
            shared = 0 if first == 0 else self._every
            some = slice(shared, None, self._every)
            yield self._split(found[:, some], self._samples[first : first + found.shape[1]][some])

    def at(self, times_s: Real) -> Iterator[tuple[Complex, Real, NDArray[np.intp]]]:
        """Yield answers, what the rest follows, and which of the times these are."""
        place = times_s / self._step_s
        early = np.flatnonzero(place < 0)
        still = np.zeros((self._poles.size, early.size), dtype=np.complex128)
        yield *self._split(still, np.zeros(early.size)), early
        end = still[:, :0]
        for first, found in self._stretches():
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

    def _stretches(self) -> Iterator[tuple[int, Complex]]:
        """Yield the number of the first step and all answers; the ends are shared."""
        start = np.zeros(self._poles.size, dtype=np.complex128)
        length = self._every * _CHUNK
        for first in range(0, self._samples.size - 1, length):
            some = self._samples[first : first + length + 1]
            found = followed(self._poles, some, self._step_s, start, held=self._held)
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


def crests(size: Real) -> Real:
    """Return the largest values along the last axis, each by a parabola about it."""
    top = np.clip(np.argmax(size, axis=-1), 1, size.shape[-1] - 2)
    before, at, after = (
        np.take_along_axis(size, (top + shift)[..., np.newaxis], axis=-1)[..., 0]
        for shift in (-1, 0, 1)
    )
    bend = np.maximum(2 * at - before - after, np.finfo(np.float64).tiny)
    inside = (at >= before) & (at >= after)
    return np.asarray(
        np.where(inside, at + (after - before) ** 2 / (8 * bend), np.max(size, axis=-1))
    )
