"""Functions of one symmetry of a plate with patches: those of the whole plate and of each patch."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.motion.basis import Polynomials, free_basis, half_waves, held_basis, sided
from stimuli.motion.patches.around import SLOPES, VALUE, Around, Sides, rings_of
from stimuli.strip.edge import CLAMPED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.strip.strip import Strip

_DIGITS: Final = 2.3
"""To which waves are held by the plate's polynomials: what is fine is near the patches, which have
functions of their own."""

_HELD: Final = 2.0
"""Waves of the plate without patches are enough up to so many times the highest frequency."""

_DEGREE: Final = 3
"""Of a disc's functions, beside a wave's phase from its centre to its rim."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Functions:
    """What one symmetry is made of: functions of the whole plate, and each patch's functions.

    The former are products of polynomials, or of waves that are sums of these. Where left
    and right are mirror images, the patches on the right have functions for both.

    Attributes
    ----------
    along, across : Polynomials
        Factors of those of the whole plate.
    odd : Symmetry
    pairs : two ndarrays of int, shape (n_plate,)
        Numbers of the factors of each: together no finer than the finest along or across.
    around : tuple of Around
    wavenumbers_rad_m : ndarray of float64, shape (n_plate,), or None
        Of waves as fast in a plate without edges, the slowest first; none of polynomials.
    alike : tuple of ndarrays of int
        Numbers of waves that are odd or even alike: the plate alone has nothing in common of two
        that are not. None of polynomials.
    """

    along: Polynomials
    across: Polynomials
    odd: Sides
    pairs: tuple[NDArray[np.intp], NDArray[np.intp]]
    around: tuple[Around, ...]
    wavenumbers_rad_m: Real | None = None
    alike: tuple[NDArray[np.intp], ...] = ()

    @property
    def n_plate(self) -> int:
        """How many are functions of the whole plate."""
        return len(self.pairs[0])

    def slower(self, most_rad_m: float) -> int:
        """Return how many of the waves are no faster than one; all polynomials."""
        if self.wavenumbers_rad_m is None:
            return self.n_plate
        return int(np.searchsorted(self.wavenumbers_rad_m, most_rad_m, side="right"))

    def fewer(self, most_rad_m: float) -> tuple[NDArray[np.intp], list[NDArray[np.intp]]]:
        """Return the numbers of fewer functions of the plate, up to a wave's, and of each patch."""
        if self.wavenumbers_rad_m is None:
            within = _within(self.along, self.across, self.odd, most_rad_m)[self.pairs]
            plate = np.flatnonzero(within)
        else:
            plate = np.arange(self.slower(math.sqrt(_HELD) * most_rad_m))
        return plate, [np.flatnonzero(one.is_coarse) for one in self.around]

    def kinds(self, plate: NDArray[np.intp]) -> list[NDArray[np.intp]]:
        """Return places among some polynomials of those that are odd or even alike."""
        kind = np.zeros(plate.size, dtype=int)
        for one, sign, numbers in zip((self.along, self.across), self.odd, self.pairs, strict=True):
            kind = 2 * kind + (sign is None) * (2 * numbers[plate] >= len(one.series))
        return [np.flatnonzero(kind == number) for number in np.unique(kind)]

    def at(self, points_m: Real) -> Real:
        """Return all functions at points: (n_points, n_functions)."""
        (found,) = self._all(points_m, (VALUE,))
        return found

    def slopes(self, points_m: Real, along: Real, across: Real) -> Real:
        """Return their slopes at points, in directions whose parts are given: (n_points, n)."""
        in_x, in_y = self._all(points_m, SLOPES)
        return np.asarray(along[:, np.newaxis] * in_x + across[:, np.newaxis] * in_y)

    def plate(self, points_m: Real, every: Sequence[tuple[int, int]]) -> list[Real]:
        """Return derivatives of the plate's functions at points."""
        found = []
        for axis, one in enumerate((self.along, self.across)):
            orders = sorted({order[axis] for order in every})
            # points on rings share places
            places_m, rows = np.unique(points_m[:, axis], return_inverse=True)
            values = one.jet(places_m / one.half_m - axis, orders)
            found.append({n: value[rows] for n, value in zip(orders, values, strict=True)})
        along, across = found
        if self.wavenumbers_rad_m is not None:
            return [along[x] * across[y] for x, y in every]
        i, j = self.pairs
        return [along[x][:, i] * across[y][:, j] for x, y in every]

    def halves(self, axis: int) -> list[Polynomials]:
        """Return the polynomials along or across, even and odd ones apart if there are both."""
        one = (self.along, self.across)[axis]
        if self.odd[axis] is not None:
            return [one]
        middle = len(one.series) // 2
        return [one.part(slice(middle)), one.part(slice(middle, None))]

    def _all(self, points_m: Real, every: Sequence[tuple[int, int]]) -> list[Real]:
        plate, local = self.plate(points_m, every), self._local(points_m, every)
        return [np.concatenate(both, axis=1) for both in zip(plate, local, strict=True)]

    def _local(self, points_m: Real, every: Sequence[tuple[int, int]]) -> list[Real]:
        """Return the same of the patches' functions, mirrored to the left."""
        left = points_m[:, 0] < 0
        if self.odd[0] is not None:
            points_m = np.stack([np.abs(points_m[:, 0]), points_m[:, 1]], axis=1)
        parts = [one.at(points_m, every) for one in self.around]
        found = [np.concatenate(one, axis=1) for one in zip(*parts, strict=True)]
        if self.odd[0] is not None:
            for orders, values in zip(every, found, strict=True):
                values[left] *= (-1.0) ** (orders[0] + self.odd[0])
        return found


def functions_of(strip: Strip, most_rad_m: float, odd: Sides) -> Functions:
    """Return the functions of one symmetry that hold waves up to a wavenumber."""
    length_m, width_m, clamped = strip.length_m or 0.0, strip.width_m, strip.edge is CLAMPED
    n_along, n_across = (_enough(most_rad_m, size_m / 2) for size_m in (length_m, width_m))
    signs = (False, True)
    along = sided(odd[0], *(free_basis(n_along, length_m, odd=one) for one in signs))
    across = sided(
        odd[1], *(held_basis(n_across, width_m, clamped=clamped, odd=one) for one in signs)
    )
    around = [
        Around(
            patch=patch,
            rings=rings_of(strip, patch),
            odd=(odd[0] if patch.x_m == 0 else None, odd[1]),
            degree=_DEGREE + math.ceil(most_rad_m * patch.half_size_m[0]),
        )
        for patch in strip.patches
        if odd[0] is None or patch.x_m >= 0
    ]
    i, j = np.nonzero(_within(along, across, odd, most_rad_m))
    return Functions(along=along, across=across, odd=odd, pairs=(i, j), around=tuple(around))


def highest_held_hz(highest_hz: float) -> float:
    """Return up to where waves of the plate are taken for modes with patches up to there."""
    return _HELD * highest_hz


def n_plate(strip: Strip, most_rad_m: float) -> float:
    """Return about how many polynomials of the whole plate hold waves up to a wavenumber."""
    lengths_m = (strip.length_m or 0.0, strip.width_m)
    return math.pi * math.prod(_enough(most_rad_m, one / 2) for one in lengths_m)


def _enough(most_rad_m: float, half_m: float) -> int:
    return half_waves(most_rad_m, half_m, digits=_DIGITS)


def _within(
    along: Polynomials, across: Polynomials, odd: Sides, most_rad_m: float
) -> NDArray[np.bool_]:
    """Return which products of factors along and across are no finer than a wave."""
    parts = []
    for one, sign in zip((along, across), odd, strict=True):
        each = len(one.series) // (2 if sign is None else 1)
        number = np.arange(len(one.series)) % each
        parts.append((number / _enough(most_rad_m, one.half_m)) ** 2)
    return np.asarray(np.add.outer(*parts) < 1)
