"""How far points of a scene move: the largest displacement over time, and its error."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from stimuli.errors import TooManyModesError
from stimuli.field.synthesis import MOST_TIME_S
from stimuli.motion.course import BLOCK, LATE, MOST_WAITS, Course, crests, widened
from stimuli.motion.patches.around import sliver_doubt
from stimuli.motion.ringing.parts import leaves_ringing
from stimuli.motion.ringing.search import UNSOUGHT, ringing_peaks

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.drive.burst import Burst
    from stimuli.drive.sampled import Drive
    from stimuli.motion.motion import Motion
    from stimuli.strip.strip import Strip


_FAINT: Final = 1e-5
"""Part of what was found that is left out of what swings freely."""

_FEWER: Final = 0.8
_SHORTEST: Final = 2
_CHECKED: Final = 3
"""The error is estimated at every so many points, and when the peak is. With every seventh the
peak at a finger on the paper's plate was missed by 0.07 dB, as it stood where few of them moved."""

_DOUBTS: Final = 2
_NEAR: Final = 0.5
"""Only where those move by this part of their largest value all points are looked at."""

_PATCHED: Final = 0.03
"""Part of the own finger's displacement that has to be known where patches count."""

_SLOWLY, _LEFT, _QUIET = 1.2, 2e-3, 3e-5
"""What fewer functions change is multiplied with; to that come what both sizes miss at corners and
rims, a part of each displacement, and what they miss of the upper modes, a part of the largest. Of
189 plates all were known as well as that; see docs/accuracy.md."""

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
    around_m : ndarray of float64, same shape
        What of it comes round an endless strip that repeats itself.
    """

    peak_m: Real
    error_m: Real
    around_m: Real


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
    unsought = 0.0
    if leaves_ringing(drive, motion.reference_hz):
        unsought = UNSOUGHT
        found, doubted = _ringing(motion, groups, drive, wait_s, with_error=with_error)
    else:
        found, doubted = _swinging(motion, groups, drive, wait_s, with_error=with_error)
    if not with_error:
        none_m = np.zeros_like(found)
        return Peaks(peak_m=found, error_m=none_m, around_m=none_m)
    apart = np.abs(doubted[1:] - doubted[0]).reshape(2, 2, *found.shape)
    inertia_m, around_m = apart.max(axis=1)
    error_m = inertia_m + around_m + INTERPOLATED * found + unsought * np.max(found, axis=0)
    if motion.coarser:
        half, octave = (
            np.abs(
                peaks_of(coarse(), groups, drive, wait_s=wait_s, with_error=False).peak_m - found
            )
            for coarse in motion.coarser
        )
        error_m = error_m + np.maximum(_SHIFTED[0] * half, _SHIFTED[1] * octave)
    return Peaks(peak_m=found, error_m=error_m, around_m=around_m)


def _swinging(
    motion: Motion,
    groups: Sequence[NDArray[np.intp]],
    drive: Drive,
    wait_s: float,
    *,
    with_error: bool,
) -> tuple[Real, Real]:
    """Return the largest displacements, and of the checked points those with what is doubted."""
    watched = _Watched(motion, groups, with_error=with_error)
    decays = bool(np.all(motion.oscillators.poles.real < 0))
    latest = 0.0
    for stretch in _course(motion, drive, wait_s, watched):
        waited = stretch.waited
        latest = waited if watched.look(stretch) else latest
        over = waited * wait_s > MOST_TIME_S
        if waited > 0 and decays and (over or not watched.may_grow(stretch)):
            break
        if not decays and waited >= 1 and (latest <= LATE * waited or waited >= MOST_WAITS):
            break
    return watched.found, watched.doubted


def _ringing(
    motion: Motion,
    groups: Sequence[NDArray[np.intp]],
    drive: Burst,
    wait_s: float,
    *,
    with_error: bool,
) -> tuple[Real, Real]:
    """Return the same under a slow burst."""
    found = ringing_peaks(motion, drive, groups, wait_s=wait_s, with_error=with_error)
    none = [found[1]] * (1 + 2 * _DOUBTS - len(found[1:])) if with_error else []
    return found[0], np.concatenate([found[1:], *[one[np.newaxis] for one in none]])


def _near(size: Real, found: float) -> NDArray[np.intp]:
    """Return the numbers of looks that may hold the peak, and those beside them.

    `size` are the largest values over some of the points, `found` what these had before.
    """
    return widened(size >= _NEAR * max(float(np.max(size)), found))


class PatchesUnknownError(ValueError):
    """What a load does to a plate with patches is not known well enough.

    >>> error = PatchesUnknownError(0, 0.0301)
    >>> error.load, error.relative_error, error.max_relative_error
    (0, 0.0301, 0.03)
    """

    max_relative_error = _PATCHED

    def __init__(self, load: int, relative_error: float) -> None:
        percent = math.ceil(1000 * relative_error) / 10
        super().__init__(
            f"loads[{load}]: the displacement with patches has an error of up to {percent:g} %, "
            f"above the limit of {100 * _PATCHED:g} %"
        )
        self.load, self.relative_error = load, relative_error


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
        raise TooManyModesError(strip.length_m)
    first = peaks_of(sizes[0], groups, drive, wait_s=wait_s, with_error=False)
    last = peaks_of(sizes[-1], groups, drive, wait_s=wait_s)
    changed_m, largest_m = np.abs(last.peak_m - first.peak_m), np.max(last.peak_m, axis=0)
    error_m = last.error_m + _SLOWLY * changed_m + _LEFT * last.peak_m + _QUIET * largest_m
    error_m += sliver_doubt(strip) * np.where(last.peak_m < largest_m, last.peak_m, 0.0)
    # what is not known of the finger that moves most is known of no other one
    most, columns = np.argmax(last.peak_m, axis=0), np.arange(last.peak_m.shape[1])
    part = error_m[most, columns] / last.peak_m[most, columns]
    error_m = np.maximum(error_m, part * last.peak_m)
    known = np.max(error_m, axis=0) / np.max(last.peak_m, axis=0)
    # of equal ones the first, whatever the rounding
    load = int(np.argmax(known >= (1 - 1e-6) * np.max(known)))
    if not known[load] <= _PATCHED:
        raise PatchesUnknownError(load, float(known[load]))
    return Peaks(peak_m=last.peak_m, error_m=error_m, around_m=last.around_m)


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


def doubts_of(motion: Motion, load: int, points: NDArray[np.intp]) -> list[tuple[Complex, Real]]:
    """Return what may have to be added at some points, as weights and what follows at once.

    First the inertia of the upper modes, more than that of all which are left out, then what
    comes round after half the length of an endless strip.
    """
    oscillators, none = motion.oscillators, np.zeros(len(points))
    weights = oscillators.weights(load)[points]
    late = weights * motion.late
    doubts = [(late, (late / oscillators.poles).sum(axis=1).real)]
    if motion.turned is not None:
        doubts.append((weights * motion.turned, none))
    return doubts


class _Stretch(NamedTuple):
    """Looks at the oscillators, equally far apart: all of them, or what is left of some."""

    waited: float  # how long after the drive it ends, in units of the wait
    columns: Real  # their real and imaginary parts, and what the rest follows
    last: Complex  # what the oscillators are at the last look
    some: NDArray[np.intp] | None = None  # numbers of those that count still
    state: Complex | None = None  # what these are at the first look; the columns are their turns

    def moved(self, weights: Complex, rest_m: Real, at: NDArray[np.intp] | None = None) -> Real:
        """Return displacements with such weights, at all looks or some: (n_points, n_looks)."""
        parts = [weights.real, -weights.imag, rest_m[:, np.newaxis]]
        if self.state is not None:
            left = weights[:, self.some] * self.state
            parts = [left.real, -left.imag]
        columns = self.columns if at is None else self.columns[:, at]
        return np.asarray(np.concatenate(parts, axis=1) @ columns)


class _Watched:
    """The largest displacements of groups of points, for each load, and with what is doubted."""

    def __init__(
        self, motion: Motion, groups: Sequence[NDArray[np.intp]], *, with_error: bool
    ) -> None:
        loads = range(motion.oscillators.rest_m.shape[0])
        rest_m = motion.oscillators.rest_m
        self.found, self._first = np.zeros((2, len(groups), len(loads)))
        # the checked points' alone; with each of two doubts added; with each taken off
        self.doubted = np.zeros((5, *self.found.shape))
        self._pairs = [(line, load) for line in range(len(groups)) for load in loads]
        weights = [motion.oscillators.weights(load) for load in loads]
        self._whole = [
            (weights[load][groups[line]], rest_m[load][groups[line]]) for line, load in self._pairs
        ]
        self._sizes = [np.abs(one) for one, _ in self._whole]
        self._rows = []
        for line, load in self._pairs:
            checked = groups[line][::_CHECKED]
            rows = [(weights[load][checked], rest_m[load][checked])]
            rows += doubts_of(motion, load, checked) if with_error else []
            self._rows.append(rows)
        self._open = list(range(len(self._pairs)))

    def look(self, stretch: _Stretch) -> bool:
        """Take a stretch into account, and tell whether anything grew."""
        grown = False
        rows = [row for pair in self._open for row in self._rows[pair]]
        both = (np.concatenate(one) for one in zip(*rows, strict=True))
        ends = np.cumsum([len(rest) for _, rest in rows])[:-1]
        found = iter(np.split(stretch.moved(*both), ends))
        for pair in self._open:
            place = self._pairs[pair]
            moved_m, *doubts = (next(found) for _ in self._rows[pair])
            at = _near(np.max(np.abs(moved_m), axis=0), self._first[place])
            self._first[place] = max(self._first[place], np.max(np.abs(moved_m)))
            if at.size:
                most = np.max(crests(np.abs(stretch.moved(*self._whole[pair], at)), at))
                grown = grown or most > self.found[place]
                self.found[place] = max(self.found[place], most)
            if doubts:
                self._doubt(place, moved_m, doubts)
        return bool(grown)

    def _doubt(self, place: tuple[int, int], moved_m: Real, doubts: Sequence[Real]) -> None:
        every = [*doubts, *[np.zeros_like(moved_m)] * (_DOUBTS - len(doubts))]
        sums = [moved_m, *(moved_m + sign * one for one in every for sign in (1, -1))]
        largest = [np.max(np.abs(one)) for one in sums]
        self.doubted[:, *place] = np.maximum(self.doubted[:, *place], largest)

    def may_grow(self, stretch: _Stretch) -> bool:
        """Tell whether all oscillators together could still give a larger value than was found."""
        last = np.abs(stretch.last)
        self._open = [
            pair
            for pair in self._open
            if np.max(self._sizes[pair] @ last) > self.found[self._pairs[pair]]
        ]
        return bool(self._open)

    def counting(self, state: Complex, some: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return which of some oscillators count, with what they are at the beginning of looks."""
        size = np.abs(state[some])
        parts = [
            np.max(self._sizes[pair][:, some], axis=0) * size / self.found[self._pairs[pair]]
            for pair in self._open
            if self.found[self._pairs[pair]] > 0
        ]
        if not parts:
            return some
        part = np.max(parts, axis=0)
        order = np.argsort(part)
        return np.sort(some[order[np.cumsum(part[order]) > _FAINT]])


def _course(motion: Motion, drive: Drive, wait_s: float, watched: _Watched) -> Iterator[_Stretch]:
    """Yield stretches of looks at all oscillators while they are driven, and then at those left.

    A stretch begins with the last two looks of the one before, so that a largest value between
    them is not missed.
    """
    course = Course(motion, drive)
    poles = motion.oscillators.poles
    seen, followed_by = np.zeros((poles.size, 0), dtype=np.complex128), np.zeros(0)
    for answers, late in course.looks():
        seen, followed_by = np.append(seen[:, -2:], answers, 1), np.append(followed_by[-2:], late)
        yield _stretch(0.0, seen, followed_by)
    n_looks = min(BLOCK, max(_SHORTEST, math.ceil(wait_s / (_SHORTEST * course.look_s))))
    turns = np.exp(np.multiply.outer(poles, course.look_s * np.arange(n_looks + 2)))
    part = n_looks * course.look_s / wait_s
    seen = np.append(seen[:, -2:], seen[:, -1:] * turns[:, 1:-1], axis=1)
    yield _stretch(part, seen, np.append(followed_by[-2:], np.zeros(n_looks)))
    state, some, columns = seen[:, -2], np.arange(poles.size), np.zeros((0, 0))
    for block in count(2):
        left = watched.counting(state, some)
        if not columns.size or left.size < _FEWER * some.size:
            some = left
            columns = np.concatenate([turns[some].real, turns[some].imag])
        last = np.zeros_like(state)
        last[some] = state[some] * turns[some, -1]
        yield _Stretch(block * part, columns, last, some, state[some])
        state = state * turns[:, n_looks]


def _stretch(waited: float, answers: Complex, late: Real) -> _Stretch:
    columns = np.concatenate([answers.real, answers.imag, late[np.newaxis]])
    return _Stretch(waited, columns, answers[:, -1])
