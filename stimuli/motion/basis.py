"""Polynomials in which the modes of a plate are sought, and what bends in them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import leg2poly, leggauss, legmul, legvander
from numpy.polynomial.polynomial import polyvander

from stimuli.strip.edge import ElasticEdge

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.strip.patch import BondedPatch
    from stimuli.strip.strip import Strip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polynomials:
    """Functions of one coordinate from -1 to 1, orthonormal there, even or odd each.

    Attributes
    ----------
    series : ndarray of float64, shape (n_functions, n_degrees)
        Each function in orthonormal Legendre polynomials.
    half_m : float
        Half the length that the interval stands for; the functions are orthonormal over it.
    """

    series: Real
    half_m: float

    def values(self, place: Real, order: int = 0) -> Real:
        """Return a derivative of all functions at places from -1 to 1: (n_places, n_functions)."""
        n = self.series.shape[1]
        legendre = legvander(place, n - 1) * _norms(n)
        return np.asarray(legendre @ self._derived(order).T)

    def products(self, one: int, other: int) -> Real:
        """Return the integrals of two derivatives over the length: (n_functions, n_functions)."""
        both = self._derived(one) @ self._derived(other).T
        return np.asarray(both * self.half_m)

    def _derived(self, order: int) -> Real:
        """Return the series of a derivative."""
        series = self.series
        step = _derivative(series.shape[1])
        for _ in range(order):
            series = series @ step.T
        return np.asarray(series / self.half_m ** (order + 0.5))


def free_basis(n: int, length_m: float, *, odd: bool) -> Polynomials:
    """Return the first n even or odd polynomials: nothing holds the ends.

    >>> basis = free_basis(3, 0.2, odd=False)
    >>> bool(abs(basis.products(0, 0) - np.eye(3)).max() < 1e-12)
    True
    """
    return Polynomials(series=np.eye(2 * n)[int(odd) :: 2], half_m=length_m / 2)


def held_basis(n: int, width_m: float, *, clamped: bool, odd: bool) -> Polynomials:
    """Return n even or odd polynomials that are 0 at both edges; if clamped, their slopes too.

    >>> basis = held_basis(3, 0.025, clamped=True, odd=True)
    >>> edges = np.array([-1.0, 1.0])
    >>> bool(max(abs(basis.values(edges, order)).max() for order in (0, 1)) < 1e-6)
    True
    """
    bubble = np.array([2 / 3, 0.0, -2 / 3])  # 1 - y^2
    if clamped:
        bubble = legmul(bubble, bubble)
    degrees = 2 * n + bubble.size
    rows = np.zeros((n, degrees))
    for row in range(n):
        product = legmul(bubble, np.eye(2 * n)[2 * row + int(odd)])
        rows[row, : product.size] = product[:degrees]
    orthonormal, _ = np.linalg.qr((rows / _norms(degrees)).T)
    return Polynomials(series=np.asarray(orthonormal.T), half_m=width_m / 2)


def sided(odd: bool | None, even: Polynomials, uneven: Polynomials) -> Polynomials:  # noqa: FBT001 - none is both
    """Return the even or the odd functions, or both, the even ones first."""
    if odd is not None:
        return uneven if odd else even
    return replace(even, series=np.concatenate([even.series, uneven.series]))


def _norms(n: int) -> Real:
    """Return what makes Legendre polynomials orthonormal."""
    return np.asarray(np.sqrt(np.arange(n) + 0.5))


@lru_cache(maxsize=16)
def _derivative(n: int) -> Real:
    """Return the derivatives of orthonormal Legendre polynomials in the same: (n, n).

    P_k' is the sum of (2 j + 1) P_j over j = k - 1, k - 3, ...
    """
    row, column = np.indices((n, n))
    below = (row < column) & ((column - row) % 2 == 1)
    root = np.sqrt((2 * row + 1.0) * (2 * column + 1.0))
    return np.asarray(np.where(below, root, 0.0))


def half_waves(wavenumber_rad_m: float, half_m: float, *, digits: float = 10.0) -> int:
    """Return how many even or odd polynomials hold a wave over a length of twice half_m.

    To about so many digits.
    """
    x = wavenumber_rad_m * half_m
    return math.ceil((x + digits * (1 + 0.3 * math.cbrt(x))) / 2)


# At the rim of a patch the curvature jumps, and beyond it the plate bends sharply: polynomials of
# the whole plate would come near that as 1 / n only. So each patch has functions of its own, with a
# jump of curvature at its rim, that end smoothly a little way outside it.

_RING: Final = 2.0
"""How far beyond a patch its functions reach, in its smaller half length."""

_HUMPS: Final = 3
"""How many humps there are where functions end at the rim."""

_POWERS: Final = 2 * _HUMPS + 4
"""Powers of the longest function along a line: (1 - s^2)^2 s s^(2 n), n below the humps."""

MOST_DEGREE: Final = 9
"""Of a disc's functions."""

_LEAST_RING: Final = 0.25
"""Where an edge, an end or another patch leaves less room, they end at its rim."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Around:
    """The functions of one patch: piecewise polynomials on three by three cells about it.

    The middle cell is the patch, or the square about a disc, which has polynomials of its own
    beside them: (1 - r^2)^2 times those of a low degree, 0 outside.
    """

    patch: BondedPatch
    ring_m: tuple[float, float]
    odd: tuple[bool | None, bool | None]  # which functions along and across; none: all
    degree: int

    def box(self, points_m: Real, orders: tuple[int, int]) -> Real:
        """Return a derivative of the functions on the cells: (n_points, n_functions)."""
        along, across = (
            self.factor(axis, points_m[:, axis], order) for axis, order in enumerate(orders)
        )
        return products_of(along, across)

    def factor(self, axis: int, places_m: Real, order: int) -> Real:
        """Return a derivative of their factors along or across: (n_places, n_factors)."""
        centre_m = (self.patch.x_m, self.patch.y_m)[axis]
        half_m, ring_m = self.patch.half_size_m[axis], self.ring_m[axis]
        place = (places_m - centre_m) / half_m
        return _steps(place, ring_m / half_m, order, odd=self.odd[axis]) / half_m**order

    def disc(self, points_m: Real, orders: tuple[int, int]) -> Real:
        """Return a derivative of a disc's own functions; a rectangle has none."""
        if not self.patch.is_disc:
            return np.zeros((len(points_m), 0))
        radius_m = self.patch.half_size_m[0]
        x, y = (points_m - (self.patch.x_m, self.patch.y_m)).T / radius_m
        series = _disc_series(self.degree, self.odd, orders)
        n = math.isqrt(len(series))
        inside = x * x + y * y < 1
        of_x, of_y = (polyvander(np.where(inside, one, 0.0), n - 1) for one in (x, y))
        powers = products_of(np.asarray(of_x, dtype=np.float64), np.asarray(of_y, dtype=np.float64))
        return np.asarray(inside[:, np.newaxis] * (powers @ series)) / radius_m ** sum(orders)

    def line(self, axis: int, n_nodes: int, *, inside: bool) -> tuple[Real, Real]:
        """Return nodes and weights along or across the cells, or the patch alone."""
        centre_m = (self.patch.x_m, self.patch.y_m)[axis]
        half_m, ring_m = self.patch.half_size_m[axis], self.ring_m[axis]
        steps_m = np.array([-half_m - ring_m, -half_m, half_m, half_m + ring_m])
        ends_m = centre_m + (steps_m if ring_m and not inside else steps_m[1:3])
        nodes, weights = leggauss(n_nodes)
        halves_m = np.diff(ends_m)[:, np.newaxis] / 2
        places_m = ends_m[:-1, np.newaxis] + halves_m * (nodes + 1)
        return places_m.ravel(), (halves_m * weights).ravel()

    def area(self, n_nodes: int) -> tuple[Real, Real]:
        """Return nodes (n, 2) and weights over a disc."""
        rings, weights = disc_rings(n_nodes)
        reach_m = self.patch.half_size_m[0] * rings
        angle = math.pi / n_nodes * (np.arange(2 * n_nodes) + 0.5)  # none on the middle line
        x_m = self.patch.x_m + np.multiply.outer(reach_m, np.cos(angle))
        y_m = self.patch.y_m + np.multiply.outer(reach_m, np.sin(angle))
        share = weights * self.patch.half_size_m[0] ** 2 * math.pi / n_nodes
        return np.stack([x_m.ravel(), y_m.ravel()], axis=1), np.repeat(share, 2 * n_nodes)


def disc_rings(n_nodes: int) -> tuple[Real, Real]:
    """Return radii and weights, the integral of f(r) r from 0 to 1, with twice as many angles each.

    What is smooth over a disc has even powers of the radius only, once taken all the way round.

    >>> radii, weights = disc_rings(5)
    >>> radii.size, bool(np.isclose((weights * radii**8).sum(), 0.1))
    (3, True)
    """
    nodes, weights = leggauss((n_nodes + 1) // 2)
    return np.sqrt((nodes + 1) / 2), weights / 4


VALUE: Final = (0, 0)
BENDS: Final = ((2, 0), (0, 2), (1, 1))
"""Orders of derivatives along and across."""


@lru_cache(maxsize=64)
def _disc_series(
    degree: int, odd: tuple[bool | None, bool | None], orders: tuple[int, int]
) -> Real:
    """Return a derivative of a disc's functions, over its radius, in x^i y^j: (n_powers, n).

    There are equally many powers of x and of y, and those of y run first.
    """
    rim = {(0, 0): 1, (2, 0): -2, (0, 2): -2, (4, 0): 1, (0, 4): 1, (2, 2): 2}  # (1 - r^2)^2
    legendre, n = _legendre_powers(), degree + 5
    pairs = [
        (i, j)
        for i, j in product(range(degree + 1), range(degree + 1))
        if i + j <= degree and odd[0] != (i % 2 == 0) and odd[1] != (j % 2 == 0)
    ]
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
    """Return Legendre polynomials up to any degree of a disc's functions, in powers: (n, n)."""
    powers = np.zeros((MOST_DEGREE + 1, MOST_DEGREE + 1))
    for degree, row in enumerate(np.eye(len(powers))):
        powers[degree, : degree + 1] = leg2poly(row[: degree + 1])
    return powers


def _powers_derived(series: Real, order: int) -> Real:
    """Return a derivative of series of powers, along the first axis and as long as they are."""
    for _ in range(order):
        powers = np.arange(1.0, len(series)).reshape(-1, *(1,) * (series.ndim - 1))
        series = np.concatenate([powers * series[1:], np.zeros_like(series[:1])])
    return series


def _steps(place: Real, reach: float, order: int, *, odd: bool | None) -> Real:
    """Return functions of a place over half a patch's length: (n_places, n_functions).

    Even or odd, or both: value and slope at the rim, and a hump outside and one inside. They end
    with slope 0 at 1 + reach. Without any reach humps inside are left, which end at 1.
    """
    if odd is None:
        both = [_steps(place, reach, order, odd=one) for one in (False, True)]
        return np.concatenate(both, axis=1)
    inner, outer = _step_series(reach, order, odd)
    size = np.abs(place)
    beyond = (size - 1) / (reach or 1.0)
    sign = np.where(place < 0, -1.0, 1.0) ** (order + odd)
    inside, outside = size <= 1, (size > 1) & (beyond < 1)
    near = polyvander(np.where(inside, place, 0.0), len(inner) - 1) @ inner
    far = polyvander(np.where(outside, beyond, 0.0), len(outer) - 1) @ outer
    return np.asarray(inside[:, np.newaxis] * near + (outside * sign)[:, np.newaxis] * far)


@lru_cache(maxsize=64)
def _step_series(reach: float, order: int, odd: bool) -> tuple[Real, Real]:  # noqa: FBT001 - a key
    """Return the functions inside, and outside, in powers of the place: (n_powers, n) each."""
    s = Polynomial([0, 1])
    first = s if odd else Polynomial([1])
    hump = (1 - s**2) ** 2
    pieces = [(hump * first * s ** (2 * n), 0 * s) for n in range(1 if reach else _HUMPS)]
    if reach:
        value = s * (3 - s**2) / 2 if odd else first
        slope = (s**3 - s) / 2 if odd else (s**2 - 1) / 2
        pieces += [
            (value, (1 - s) ** 2 * (1 + 2 * s)),
            (slope, reach * s * (1 - s) ** 2),
            (0 * s, 16 * s**2 * (1 - s) ** 2),
        ]
    series = np.zeros((2, _POWERS, len(pieces)))
    for column, sides in enumerate(pieces):
        for side, one in zip(series, sides, strict=True):
            side[: len(one.coef), column] = one.coef
    inner, outer = (_powers_derived(side, order) for side in series)
    return inner, outer / (reach or 1.0) ** order


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Functions:
    """What one symmetry is made of: polynomials of the whole plate, and each patch's functions.

    Where left and right are mirror images, the patches on the right have functions for both.
    """

    along: Polynomials
    across: Polynomials
    odd_x: bool | None
    odd_y: bool | None
    around: tuple[Around, ...]
    digits: float
    kept: Real  # combinations of the patches' functions, (n_local, n_kept)

    @property
    def n_global(self) -> int:
        """How many are polynomials of the whole plate."""
        return len(self.along.series) * len(self.across.series)

    def up_to(self, most_rad_m: float, n: int) -> NDArray[np.intp]:
        """Return the numbers, of n, of the patches' functions and the plate's up to a wave's."""
        kept = []
        for one, odd in ((self.along, self.odd_x), (self.across, self.odd_y)):
            each = len(one.series) // (2 if odd is None else 1)
            wanted = half_waves(most_rad_m, one.half_m, digits=self.digits)
            kept.append(np.arange(len(one.series)) % each < wanted)
        plate = np.logical_and.outer(*kept).ravel()
        return np.flatnonzero(np.append(plate, np.ones(n - plate.size, dtype=bool)))

    def at(self, points_m: Real, *, laplacian: bool = False) -> Real:
        """Return all functions at points, or their Laplacians: (1, n_points, n_functions)."""
        orders = BENDS[:2] if laplacian else (VALUE,)
        plate = np.sum([self.plate(points_m, order) for order in orders], axis=0)
        local = np.sum([self._local(points_m, order) for order in orders], axis=0) @ self.kept
        return np.concatenate([plate, local], axis=1)[np.newaxis]

    def plate(self, points_m: Real, orders: tuple[int, int]) -> Real:
        """Return a derivative of the plate's polynomials at points."""
        along = self.along.values(points_m[:, 0] / self.along.half_m, orders[0])
        across = self.across.values(points_m[:, 1] / self.across.half_m - 1, orders[1])
        return products_of(along, across)

    def _local(self, points_m: Real, orders: tuple[int, int]) -> Real:
        """Return the same of the patches' functions, mirrored to the left."""
        if self.odd_x is not None:
            left = points_m[:, 0] < 0
            points_m = np.stack([np.abs(points_m[:, 0]), points_m[:, 1]], axis=1)
            sign = np.where(left, -1.0, 1.0) ** (orders[0] + self.odd_x)
        else:
            sign = np.ones(len(points_m))
        parts = [f(points_m, orders) for one in self.around for f in (one.box, one.disc)]
        return np.asarray(sign[:, np.newaxis] * np.concatenate(parts, axis=1))


def products_of(along: Real, across: Real) -> Real:
    """Return the products of functions along and across at the same points: (n_points, n)."""
    return np.asarray((along[:, :, np.newaxis] * across[:, np.newaxis]).reshape(len(along), -1))


def ring_m(strip: Strip, patch: BondedPatch) -> tuple[float, float]:
    """Return how far the functions of a patch reach beyond it along and across."""
    half_m = patch.half_size_m
    room_m = [
        (strip.length_m or 0.0) / 2 - abs(patch.x_m) - half_m[0],
        strip.width_m / 2 - abs(patch.y_m - strip.width_m / 2) - half_m[1],
    ]
    for other in strip.patches:
        if other is not patch:
            gaps_m = patch.gaps_m(other)
            axis = 0 if gaps_m[0] >= gaps_m[1] else 1
            room_m[axis] = min(room_m[axis], gaps_m[axis] / 2)
    reach_m = [min(_RING * min(half_m), room) for room in room_m]
    along, across = (one if one > _LEAST_RING * min(half_m) else 0.0 for one in reach_m)
    return along, across


def plate_energies(strip: Strip, along: Polynomials, across: Polynomials) -> tuple[Real, Real]:
    """Return the matrices of the plate's strain energy and of the springs'."""
    poisson, stiffness = strip.material.poisson_ratio, strip.bending_stiffness_n_m
    one_x, one_y = np.eye(along.series.shape[0]), np.eye(across.series.shape[0])
    coupled = np.kron(along.products(2, 0), across.products(0, 2))
    plate = (
        np.kron(along.products(2, 2), one_y)
        + np.kron(one_x, across.products(2, 2))
        + poisson * (coupled + coupled.T)
        + 2 * (1 - poisson) * np.kron(along.products(1, 1), across.products(1, 1))
    )
    held = strip.edge.stiffness_n if isinstance(strip.edge, ElasticEdge) else 0.0
    slopes = across.values(np.array([-1.0, 1.0]), 1)
    return stiffness * plate, np.asarray(held * np.kron(one_x, slopes.T @ slopes))
