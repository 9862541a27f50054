"""The largest displacement of points under a slow burst and after it, where anything rings."""

from __future__ import annotations

import math
from itertools import chain, count
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.field.synthesis import MOST_TIME_S
from stimuli.motion.course import BLOCK, LATE, LOOKS, MOST_WAITS, crests, widened
from stimuli.motion.ringing.parts import parts_of
from stimuli.motion.ringing.patterns import watched_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.drive.burst import Burst
    from stimuli.motion.motion import Motion
    from stimuli.motion.ringing.parts import Part
    from stimuli.motion.ringing.patterns import Watched


_BESIDE: Final = 2
"""Blocks share so many looks, so that no peak is at the end of both."""

_GLANCES: Final = 64
_AT_ONCE: Final = 64
"""Blocks whose bounds are computed at once."""

_FAINT: Final = 1e-6
"""Part of what was found that is left out of what rings."""

_HIGH: Final = 0.8
"""Where a look is lower than this part of the highest one, no crest beside it is the highest."""

_SOON: Final = 1e-6
"""Looks after which what follows at once does so where the plate has no relaxation time."""

UNSOUGHT: Final = 3e-7
"""What moves by less than this part of what its load moves most is not looked at: 130 dB below."""


def ringing_peaks(
    motion: Motion,
    burst: Burst,
    groups: Sequence[NDArray[np.intp]],
    *,
    wait_s: float,
    with_error: bool,
) -> Real:
    """Return the largest displacements under a slow burst and after it.

    All follow a slow burst but for what rings after each of its corners. At any time that adds no
    more than the sum of all sizes, which decay: only what can be the largest then is looked at.
    How long after the burst is told in `peaks_of`. What is less than `UNSOUGHT` may be less still.

    Returns
    -------
    ndarray of float64, shape (n, n_groups, n_loads)
        First those of the groups. With the error, fewer points' follow, as they are and with what
        is doubted.
    """
    look_s = 1 / (LOOKS * motion.reference_hz)
    lag_s = motion.viscous_s or _SOON * look_s
    poles = np.append(motion.oscillators.poles, -1 / lag_s)
    watched = watched_of(motion, groups, lag_s, with_error=with_error)
    search = _Search(poles, watched, look_s)
    *driven, after = parts_of(poles, burst)
    for part in driven:
        search.enter(part)
        for _ in search.blocks():
            pass
    search.enter(after)
    decays, latest = bool(np.all(motion.oscillators.poles.real < 0)), 0.0
    for block, (may_grow, grew) in enumerate(search.blocks(), 1):
        waited_s = block * BLOCK * look_s
        latest = waited_s if grew else latest
        if decays and not may_grow:
            break
        if waited_s > MOST_TIME_S or (not decays and waited_s >= MOST_WAITS * wait_s):
            break
        if not decays and waited_s >= wait_s and latest <= LATE * waited_s:
            break
    found = search.told().reshape(len(groups), len(watched) // len(groups), -1)
    return np.moveaxis(found, -1, 0)


class _Search:
    """The largest displacements of watched points, block by block of looks: (n_watched, n)."""

    def __init__(self, poles: Complex, watched: list[Watched], look_s: float) -> None:
        self._watched, self._poles, self._look_s = watched, poles, look_s
        self._loads = np.array([one.load for one in watched])
        self._sizes = np.stack([one.sizes for one in watched])
        self._found = np.zeros(self._sizes.shape[:2])
        self._seen = np.zeros_like(self._found)
        self._reaches = [np.max(np.abs(one.rows), axis=0) for one in watched]
        turns = np.exp(np.multiply.outer(poles, look_s * np.arange(BLOCK + _BESIDE)))
        self._turns = np.stack([turns.real, turns.imag])

    def enter(self, part: Part) -> None:
        """Begin with a part; what points do without ringing, less that, is found at once."""
        self._part = part
        self._driven = [
            [((f.strengths @ part.sine).real, (f.strengths @ part.cosine).real) for f in one.fields]
            for one in self._watched
        ]
        self._smooth = [
            [one.versions(some) for some in zip(*driven, strict=True)]
            for one, driven in zip(self._watched, self._driven, strict=True)
        ]
        if part.omegas.size:
            n_looks = math.floor(part.duration_s / self._look_s)
            places = np.round(np.linspace(0.0, n_looks, _GLANCES)).astype(np.float64)
            smooth = self._largest_smooth(self._look_s * places)
            self._seen = np.maximum(self._seen, np.max(smooth, axis=-1))
            least = smooth - self._ringing(self._look_s * places)
            self._found = np.maximum(self._found, np.max(least, axis=-1))

    def told(self) -> Real:
        """Return what was found, or of what was not looked at what it does without ringing."""
        return np.asarray(np.maximum(self._found, np.minimum(self._seen, self._wanted())))

    def blocks(self) -> Iterator[tuple[bool, bool]]:
        """Take block after block into account; tell if anything could have grown, and if it did."""
        n_looks, span_s = self._part.duration_s / self._look_s, BLOCK * self._look_s
        half_s = self._look_s * (BLOCK + _BESIDE) / 2
        for first in count(0, _AT_ONCE):
            n_blocks = math.ceil(min(_AT_ONCE, n_looks / BLOCK - first))
            if n_blocks <= 0:
                return
            begins_s = span_s * np.arange(first, first + n_blocks, dtype=np.float64)
            most = self._ringing(begins_s)
            if self._part.omegas.size:
                most = most + self._largest_smooth(begins_s + half_s, half_s)
            for block, begin_s in enumerate(begins_s):
                may_grow = most[..., block] > self._wanted()
                n = math.floor(min(BLOCK + _BESIDE, n_looks + 1 - BLOCK * (first + block)))
                looked = n > _BESIDE and bool(np.any(may_grow))
                yield bool(np.any(may_grow)), looked and self._look_at(may_grow, begin_s, n)

    def _wanted(self) -> Real:
        """Return which displacements are not looked at."""
        largest = np.zeros(int(self._loads.max()) + 1)
        np.maximum.at(largest, self._loads, np.max(self._found, axis=1))
        unsought = UNSOUGHT * largest[self._loads, np.newaxis]
        return np.asarray(np.maximum(self._found, unsought))

    def _ringing(self, times_s: Real) -> Real:
        """Return bounds of what rings at some times: (n_watched, n_versions, n_times)."""
        decayed = np.exp(np.multiply.outer(self._poles.real, times_s))
        return np.asarray((self._sizes * np.abs(self._part.left)) @ decayed)

    def _waves(self, times_s: Real) -> tuple[Real, Real]:
        """Return sines and cosines of the burst: (n_sines, n_times)."""
        angle = np.multiply.outer(self._part.omegas, times_s) + self._part.phase[:, np.newaxis]
        return np.sin(angle), np.cos(angle)

    def _largest_smooth(self, times_s: Real, within_s: float = 0.0) -> Real:
        """Return how far points may move without ringing so near to some times, likewise."""
        omegas, (sin, cos) = self._part.omegas, self._waves(times_s)
        found = []
        pairs = (zip(*both, strict=True) for both in self._smooth)
        for s, c in chain.from_iterable(pairs):
            size = np.abs(s @ sin + c @ cos)
            if within_s:
                size += within_s * np.abs((s * omegas) @ cos - (c * omegas) @ sin)
                size += (within_s**2 / 2 * np.hypot(s, c) @ omegas**2)[:, np.newaxis]
            found.append(np.max(size, axis=0))
        return np.stack(found).reshape(*self._found.shape, -1)

    def _look_at(self, may_grow: NDArray[np.bool_], begin_s: float, n: int) -> bool:
        """Look at a block that begins at a time, and tell whether anything grew."""
        before, wanted = self._found.copy(), self._wanted()
        state = self._part.left * np.exp(self._poles * begin_s)
        counts = self._counting(may_grow, wanted, np.abs(state))
        waves = self._waves(begin_s + self._look_s * np.arange(n, dtype=np.float64))
        for one in np.flatnonzero(np.any(may_grow, axis=1)).tolist():
            shapes = self._moved(one, state, counts, waves)
            reach = self._reaches[one] @ sum(np.abs(some) for some in shapes)
            looks = widened(reach > np.min(wanted[one][may_grow[one]]))
            if looks.size:
                versions = self._watched[one].versions([some[:, looks] for some in shapes])
                most = [_highest(np.abs(some), looks) for some in versions]
                self._found[one] = np.maximum(self._found[one], most)
        return bool(np.any(self._found > before))

    def _moved(
        self, one: int, state: Complex, counts: NDArray[np.bool_], waves: tuple[Real, Real]
    ) -> list[Real]:
        """Return the shapes of the fields of one that is watched: (n_shapes, n_looks) each."""
        n, found = waves[0].shape[1], []
        for field, (sine, cosine) in zip(self._watched[one].fields, self._driven[one], strict=True):
            left = field.some[counts[field.some]]
            free = field.strengths[:, left] * state[left]
            shapes = free.real @ self._turns[0, left, :n] - free.imag @ self._turns[1, left, :n]
            if self._part.omegas.size:
                shapes += sine @ waves[0] + cosine @ waves[1]
            found.append(shapes)
        return found

    def _counting(self, may_grow: NDArray[np.bool_], wanted: Real, size: Real) -> NDArray[np.bool_]:
        """Tell which oscillators count for some of what is watched."""
        if not np.all(wanted[may_grow] > 0):
            return np.ones(size.size, dtype=bool)
        part = np.max(self._sizes[may_grow] / wanted[may_grow][:, np.newaxis], axis=0) * size
        order = np.argsort(part)
        counts = np.zeros(size.size, dtype=bool)
        counts[order[np.cumsum(part[order]) > _FAINT]] = True
        return counts


def _highest(size: Real, looks: NDArray[np.intp]) -> float:
    """Return the highest crest of some points."""
    high = np.max(size, axis=1)
    return float(np.max(crests(size[high >= _HIGH * np.max(high)], looks)))
