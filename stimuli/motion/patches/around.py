"""Functions of one patch: with a jump of curvature at its rim, and a little way about it.

Polynomials of the whole plate would come near what a patch bends as 1 / n only. Its functions end
smoothly outside; where they end at an edge or end of the plate, they move there as the plate may.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss

from stimuli.motion.basis import disc_rings, products_of
from stimuli.strip.edge import CLAMPED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.strip.patch import BondedPatch
    from stimuli.strip.strip import Strip


_RING, _WIDTHS = (2.0, 6.0), (0.3, 0.6)
"""How far beyond a patch its functions reach: at least the first of its smaller half lengths and
of widths, and the second of both, whichever is less. With 0.3 widths levels beside discs a quarter
as wide as the plate were wrong by up to 0.4 dB; 0.6 would be too far for the smallest."""

_LEAST_RING: Final = 0.002
"""Where an edge, an end or another patch leaves less room, in half lengths, they end at its rim."""

_SLIVER, _DOUBT = 0.02, 0.03
"""What is narrower beside a patch, as a part of the width, turns sharply, which few functions do:
of 24 plates levels at the other finger were wrong by up to 0.27 dB."""

_HUMPS, _MORE_HUMPS = 2, 5
"""Humps inside and outside: one leaves 0.6 % of the displacement over a disc. More are needed where
functions end at the rim on both sides."""

_FINEST: Final = 3
"""Products of a hump along and one across: with the second of both, nothing more is found."""

_POWERS: Final = 2 * _MORE_HUMPS + 4
"""Powers of the longest function along a line: (1 - s^2)^2 times a polynomial."""

_MOST_DEGREE: Final = 9
"""Of a disc's functions."""

_RIM: Final = 1 + 1e-7
"""Where a half or a ring ends: a patch may lie on an edge but for rounding."""

VALUE: Final = (0, 0)
SLOPES: Final = ((1, 0), (0, 1))
BENDS: Final = ((2, 0), (0, 2), (1, 1))
"""Orders of derivatives along and across."""

Sides = tuple[bool | None, bool | None]
"""Odd or even along and across; none: both."""


class Ring(NamedTuple):
    """How far functions reach beyond a rim, and what is free where they end.

    Nothing inside the plate and at a clamped edge, the slope at another edge, at an end of the
    plate the displacement, too: `free` is 0, 1 or 2.
    """

    reach: float
    free: int


Rings = tuple[tuple[Ring, Ring], tuple[Ring, Ring]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Around:
    """The functions of one patch: piecewise polynomials on up to three by three cells about it.

    The middle cell is the patch, or the square about a disc, which has polynomials of its own
    beside them: (1 - r^2)^2 times those of a low degree, 0 outside.

    Attributes
    ----------
    patch : BondedPatch
    rings : two pairs of Ring
        Their reach in m, to the left and right, and towards either edge.
    odd : two of bool or None
        Which functions along and across; none: all.
    degree : int
        Of a disc's polynomials, at most 9.
    """

    patch: BondedPatch
    rings: Rings
    odd: Sides
    degree: int

    @property
    def pairs(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Numbers of the factors along and across of the functions on the cells."""
        return _pairs(self.rings, self.odd)

    @property
    def is_coarse(self) -> NDArray[np.bool_]:
        """Which of all its functions are enough for an estimate of what the others add."""
        along, across = _levels(self.rings, self.odd)
        coarse = np.maximum(along[self.pairs[0]], across[self.pairs[1]]) < _HUMPS
        return np.append(coarse, np.ones(self.n_disc, dtype=bool))

    @property
    def n_disc(self) -> int:
        """How many functions a disc has of its own."""
        return len(_disc_pairs(self._disc_degree, self.odd)) if self.patch.is_disc else 0

    def reach_m(self, axis: int) -> float:
        """Return the longest half or ring along an axis."""
        return max(self.patch.half_size_m[axis], *(ring.reach for ring in self.rings[axis]))

    def at(self, points_m: Real, every: Sequence[tuple[int, int]]) -> list[Real]:
        """Return derivatives of the functions on the cells and of a disc's own at points.

        (n_points, n_functions) each.
        """
        axes = [sorted({orders[axis] for orders in every}) for axis in (0, 1)]
        along, across = (
            dict(zip(orders, self.factors(axis, points_m[:, axis], orders), strict=True))
            for axis, orders in enumerate(axes)
        )
        i, j = self.pairs
        boxes = [along[x][:, i] * across[y][:, j] for x, y in every]
        if not self.patch.is_disc:
            return boxes
        discs = self._disc(points_m, every)
        return [np.concatenate(both, axis=1) for both in zip(boxes, discs, strict=True)]

    def factors(self, axis: int, places_m: Real, orders: Sequence[int]) -> list[Real]:
        """Return derivatives of the factors along or across: (n_places, n_factors) each."""
        centre_m = (self.patch.x_m, self.patch.y_m)[axis]
        half_m = self.patch.half_size_m[axis]
        rings = [Ring(one.reach / half_m, one.free) for one in self.rings[axis]]
        place = (places_m - centre_m) / half_m
        found = _steps(place, rings, orders, odd=self.odd[axis])
        return [one / half_m**order for one, order in zip(found, orders, strict=True)]

    @property
    def _disc_degree(self) -> int:
        return min(self.degree, _MOST_DEGREE)

    def _disc(self, points_m: Real, every: Sequence[tuple[int, int]]) -> list[Real]:
        """Return derivatives of a disc's own functions."""
        radius_m = self.patch.half_size_m[0]
        x, y = (points_m - (self.patch.x_m, self.patch.y_m)).T / radius_m
        inside = np.flatnonzero(x * x + y * y < 1)
        n = self._disc_degree + 5
        powers = products_of(_powers(x[inside], n), _powers(y[inside], n))
        found = []
        for orders in every:
            series = _disc_series(self._disc_degree, self.odd, orders)
            values = np.zeros((len(points_m), series.shape[1]))
            values[inside] = powers @ series / radius_m ** sum(orders)
            found.append(values)
        return found

    def line(self, axis: int, n_nodes: int, *, inside: bool) -> tuple[Real, Real]:
        """Return nodes and weights along or across the cells, or the patch alone."""
        centre_m, half_m = (self.patch.x_m, self.patch.y_m)[axis], self.patch.half_size_m[axis]
        low, high = (0.0 if inside else ring.reach for ring in self.rings[axis])
        ends_m = centre_m + np.unique([-half_m - low, -half_m, half_m, half_m + high])
        nodes, weights = leggauss(n_nodes)
        halves_m = np.diff(ends_m)[:, np.newaxis] / 2
        places_m = ends_m[:-1, np.newaxis] + halves_m * (nodes + 1)
        return places_m.ravel(), (halves_m * weights).ravel()

    def area(self, n_nodes: int) -> tuple[Real, Real]:
        """Return nodes (n, 2) and weights over a disc."""
        rings, weights = disc_rings(n_nodes)
        reach_m = self.patch.half_size_m[0] * rings
        angle = math.pi / n_nodes * (np.arange(n_nodes) + 0.5)  # none on the middle line
        both = np.array([[1.0], [1.0]]), np.array([[1.0], [-1.0]])
        x_m, y_m = (
            centre_m + reach_m[:, np.newaxis] * (sign * wave(angle)).ravel()
            for centre_m, sign, wave in zip(
                (self.patch.x_m, self.patch.y_m), both, (np.cos, np.sin), strict=True
            )
        )
        share = weights * self.patch.half_size_m[0] ** 2 * math.pi / n_nodes
        return np.stack([x_m.ravel(), y_m.ravel()], axis=1), np.repeat(share, 2 * n_nodes)


@lru_cache(maxsize=32)
def _pairs(rings: Rings, odd: Sides) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    along, across = np.nonzero(np.add.outer(*_levels(rings, odd)) <= _FINEST)
    return along, across


def _levels(rings: Rings, odd: Sides) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return how fine each factor along and across is: 0, or the number of a hump."""
    along, across = (
        np.array(_fineness(of_axis, odd=one)) for of_axis, one in zip(rings, odd, strict=True)
    )
    return along, across


def rings_of(strip: Strip, patch: BondedPatch) -> Rings:
    """Return how far the functions of a patch reach beyond it, along and across on both sides."""
    half_m, end_m = patch.half_size_m, (strip.length_m or 0.0) / 2
    small_m, (near_m, wide_m) = min(half_m), (strip.width_m * one for one in _WIDTHS)
    most_m = max(_RING[0] * small_m, near_m, min(_RING[1] * small_m, wide_m))
    held = 0 if strip.edge is CLAMPED else 1
    low_m, high_m = (patch.x_m + end_m, patch.y_m), (end_m - patch.x_m, strip.width_m - patch.y_m)
    rings = [
        [Ring(side[axis] - half_m[axis], free) for side in (low_m, high_m)]
        for axis, free in ((0, 2), (1, held))
    ]
    for other in strip.patches:
        if other is not patch:
            gaps_m = patch.gaps_m(other)
            axis = 0 if gaps_m[0] >= gaps_m[1] else 1
            side = int((other.x_m, other.y_m)[axis] > (patch.x_m, patch.y_m)[axis])
            rings[axis][side] = min(rings[axis][side], Ring(gaps_m[axis] / 2, 0))
    least_m, touching_m = _LEAST_RING * small_m, (_RIM - 1) * small_m
    (left, right), (near, far) = (
        [
            Ring(most_m, 0)
            if ring.reach > most_m
            else ring
            if ring.reach > least_m
            # a patch on an edge moves as that may, one just beside it not
            else Ring(0.0, ring.free if ring.reach <= touching_m else 0)
            for ring in sides
        ]
        for sides in rings
    )
    return (left, right), (near, far)


def sliver_doubt(strip: Strip) -> float:
    """Return what part of it is not known of other fingers as a patch nearly touches an edge."""
    gaps = (
        (side_m - patch.half_size_m[1]) / strip.width_m
        for patch in strip.patches
        for side_m in (patch.y_m, strip.width_m - patch.y_m)
    )
    return _DOUBT if any(_RIM - 1 < gap < _SLIVER for gap in gaps) else 0.0


def _n_humps(rings: Sequence[Ring]) -> int:
    return _HUMPS if any(ring.reach for ring in rings) else _MORE_HUMPS


def _fineness(rings: Sequence[Ring], *, odd: bool | None) -> list[int]:
    """Return how fine the functions of `_steps` are."""
    numbers = [n for n in range(2 * _n_humps(rings)) if odd is None or n % 2 == odd]
    levels = [min(n // 2 + 1, _HUMPS) for n in numbers]
    for ring in rings if odd is None else rings[1:]:
        levels += [0] * (2 + ring.free) + [*range(1, _HUMPS + 1)] if ring.reach else [0] * ring.free
    return levels


def _steps(
    place: Real, rings: Sequence[Ring], orders: Sequence[int], *, odd: bool | None
) -> list[Real]:
    """Return functions of a place over half a patch's length: (n_places, n_functions) each.

    Humps inside, and on each side the value and slope at the rim, what is free where the ring ends,
    and humps outside; of two equal sides even or odd sums.
    """
    inside = _powers_where(place, np.abs(place) <= _RIM)
    signs = (-1.0) ** np.arange(_POWERS)[:, np.newaxis]
    beyond = []
    for sign, ring in zip((-1, 1), rings, strict=True):
        reach = ring.reach or 1.0
        out = (sign * place - 1) / reach
        there = (sign * place > _RIM) & (out <= _RIM)
        beyond.append(_powers_where(out, there) if ring.reach else None)
    found = []
    for order in orders:
        humps = inside @ _hump_series(_n_humps(rings), order, odd)
        sides = []
        for sign, ring, outside in zip((-1, 1), rings, beyond, strict=True):
            inner, outer = _side_series(ring.reach > 0, ring.free, order)
            # what is right of a rim on the right is left of one on the left
            side = inside @ (signs * inner if sign < 0 else inner)
            if outside is not None:
                scale = np.full(outer.shape[1], ring.reach**-order)
                scale[1] *= ring.reach  # the slope at the rim is 1 on both sides
                side = side + outside @ (outer * scale)
            sides.append(sign**order * side)
        left, right = sides
        both = [left, right] if odd is None else [right - left if odd else right + left]
        found.append(np.concatenate([humps, *both], axis=1))
    return found


def _powers(place: Real, n: int) -> Real:
    """Return powers of places from 0 on: (n_places, n)."""
    found = np.empty((place.size, n))
    found[:, 0] = 1.0
    for power in range(1, n):
        np.multiply(found[:, power - 1], place, out=found[:, power])
    return found


def _powers_where(place: Real, there: NDArray[np.bool_]) -> Real:
    """Return powers of some places, 0 of the others."""
    found = np.zeros((place.size, _POWERS))
    found[there] = _powers(place[there], _POWERS)
    return found


@lru_cache(maxsize=64)
def _hump_series(n_humps: int, order: int, odd: bool | None) -> Real:  # noqa: FBT001 - a key
    """Return functions that end at the rim with slope 0, in powers of the place."""
    wanted = [n for n in range(2 * n_humps) if odd is None or n % 2 == odd]
    rim = np.array([1.0, 0.0, -2.0, 0.0, 1.0])  # (1 - s^2)^2
    return _series([np.convolve(rim, _legendre_powers()[n, : n + 1]) for n in wanted], order)


_VALUE: Final = np.array([0.5, 0.75, 0.0, -0.25])  # (1 + s)^2 (2 - s) / 4
_SLOPE: Final = np.array([-0.25, -0.25, 0.25, 0.25])  # (1 + s)^2 (s - 1) / 4


@lru_cache(maxsize=64)
def _side_series(has_ring: bool, free: int, order: int) -> tuple[Real, Real]:  # noqa: FBT001 - a key
    """Return the functions of a side inside, and outside, in powers of the place there.

    The place outside goes from 0 to 1.
    """
    none = np.zeros(1)
    pieces = [(_SLOPE, none), (_VALUE, none)][:free]
    if has_ring:
        ends = [np.array([0.0, 0.0, -1.0, 1.0]), np.array([0.0, 0.0, 3.0, -2.0])][:free]
        humps = [np.array([0.0, 0.0, 16.0, -32.0, 16.0])]  # 16 s^2 (1 - s)^2, times 2 s - 1
        humps += [np.convolve(humps[-1], [-1.0, 2.0]) for _ in range(_HUMPS - 1)]
        starts = np.array([1.0, 0.0, -3.0, 2.0]), np.array([0.0, 1.0, -2.0, 1.0])
        pieces = [(_VALUE, starts[0]), (_SLOPE, starts[1])]
        pieces += [(none, one) for one in (*ends, *humps)]
    inner, outer = (_series([piece[part] for piece in pieces], order) for part in (0, 1))
    return inner, outer


def _series(functions: Sequence[Real], order: int) -> Real:
    """Return a derivative of polynomials in powers: (n_powers, n)."""
    series = np.zeros((_POWERS, len(functions)))
    for column, one in enumerate(functions):
        series[: len(one), column] = one
    return _powers_derived(series, order)


@lru_cache(maxsize=16)
def _disc_pairs(degree: int, odd: Sides) -> list[tuple[int, int]]:
    """Return the degrees along and across of a disc's functions."""
    return [
        (i, j)
        for i, j in product(range(degree + 1), range(degree + 1))
        if i + j <= degree and odd[0] != (i % 2 == 0) and odd[1] != (j % 2 == 0)
    ]


@lru_cache(maxsize=64)
def _disc_series(degree: int, odd: Sides, orders: tuple[int, int]) -> Real:
    """Return a derivative of a disc's functions, over its radius, in x^i y^j: (n_powers, n).

    There are equally many powers of x and of y, and those of y run first.
    """
    rim = {(0, 0): 1, (2, 0): -2, (0, 2): -2, (4, 0): 1, (0, 4): 1, (2, 2): 2}  # (1 - r^2)^2
    legendre, n = _legendre_powers(), degree + 5
    pairs = _disc_pairs(degree, odd)
    series = np.zeros((n, n, len(pairs)))
    for place, (i, j) in enumerate(pairs):
        shape = np.multiply.outer(legendre[i, : i + 1], legendre[j, : j + 1])
        for (row, column), value in rim.items():
            series[row : row + i + 1, column : column + j + 1, place] += value * shape
    series = _powers_derived(series, orders[0])
    across = _powers_derived(series.transpose(1, 0, 2), orders[1])
    return np.ascontiguousarray(across.transpose(1, 0, 2)).reshape(n * n, -1)


@lru_cache(maxsize=1)
def _legendre_powers() -> Real:
    """Return Legendre polynomials up to any degree of these functions, in powers: (n, n)."""
    powers = np.eye(_POWERS)
    for degree in range(1, _POWERS - 1):
        after = (2 * degree + 1) * np.append(0.0, powers[degree, :-1]) - degree * powers[degree - 1]
        powers[degree + 1] = after / (degree + 1)
    return powers


def _powers_derived(series: Real, order: int) -> Real:
    """Return a derivative of series of powers, along the first axis and as long as they are."""
    for _ in range(order):
        powers = np.arange(1.0, len(series)).reshape(-1, *(1,) * (series.ndim - 1))
        series = np.concatenate([powers * series[1:], np.zeros_like(series[:1])])
    return series
