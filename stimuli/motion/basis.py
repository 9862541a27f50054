"""Polynomials in which the modes of a plate are sought, and what bends in them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre, leggauss, legmul, legvander
from numpy.polynomial.polynomial import polyder, polyval2d

from stimuli.strip.edge import ElasticEdge

if TYPE_CHECKING:
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


def _norms(n: int) -> Real:
    """Return what makes Legendre polynomials orthonormal."""
    return np.asarray(np.sqrt(np.arange(n) + 0.5))


def _derivative(n: int) -> Real:
    """Return the derivatives of orthonormal Legendre polynomials in the same: (n, n).

    P_k' is the sum of (2 j + 1) P_j over j = k - 1, k - 3, ...
    """
    row, column = np.indices((n, n))
    below = (row < column) & ((column - row) % 2 == 1)
    root = np.sqrt((2 * row + 1.0) * (2 * column + 1.0))
    return np.asarray(np.where(below, root, 0.0))


def half_waves(wavenumber_rad_m: float, half_m: float) -> int:
    """Return how many even or odd polynomials hold a wave over a length of twice half_m."""
    x = wavenumber_rad_m * half_m
    return math.ceil((x + 10 + 3 * math.cbrt(x)) / 2)


# At the rim of a patch the curvature jumps, and beyond it the plate bends sharply: polynomials of
# the whole plate would come near that as 1 / n only. So each patch has functions of its own, with a
# jump of curvature at its rim, that end smoothly a little way outside it.

_RING: Final = 2.0
"""How far beyond a patch its functions reach, in its smaller half length."""

_HUMPS: Final = 3
"""How many humps there are where functions end at the rim."""

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
        inside = x * x + y * y < 1
        columns = [
            np.where(inside, polyval2d(x, y, series), 0.0) / radius_m ** sum(orders)
            for series in _disc_series(self.degree, self.odd, orders)
        ]
        return np.stack(columns, axis=1)

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
        nodes, weights = leggauss(n_nodes)
        reach_m = self.patch.half_size_m[0] * (nodes + 1) / 2
        angle = math.pi / n_nodes * np.arange(2 * n_nodes)
        x_m = self.patch.x_m + np.multiply.outer(reach_m, np.cos(angle))
        y_m = self.patch.y_m + np.multiply.outer(reach_m, np.sin(angle))
        share = weights * reach_m * self.patch.half_size_m[0] / 2 * math.pi / n_nodes
        return np.stack([x_m.ravel(), y_m.ravel()], axis=1), np.repeat(share, 2 * n_nodes)


@lru_cache(maxsize=64)
def _disc_series(
    degree: int, odd: tuple[bool | None, bool | None], orders: tuple[int, int]
) -> tuple[Real, ...]:
    """Return the coefficients of a derivative of a disc's functions, over its radius."""
    rim = np.zeros((5, 5))  # (1 - x^2 - y^2)^2
    rim[0, 0], rim[2, 0], rim[0, 2], rim[4, 0], rim[0, 4], rim[2, 2] = 1, -2, -2, 1, 1, 2
    found = []
    for i, j in product(range(degree + 1), range(degree + 1)):
        if i + j > degree or odd[0] == (i % 2 == 0) or odd[1] == (j % 2 == 0):
            continue
        shape = np.multiply.outer(*(_legendre(n).coef for n in (i, j)))
        series = np.zeros((5 + i, 5 + j))
        for (row, column), value in np.ndenumerate(shape):
            series[row : row + 5, column : column + 5] += value * rim
        for axis, order in enumerate(orders):
            series = np.asarray(polyder(series, order, axis=axis), dtype=np.float64)
        found.append(series)
    return tuple(found)


def _legendre(degree: int) -> Polynomial:
    return Legendre.basis(degree).convert(kind=Polynomial)


def _steps(place: Real, reach: float, order: int, *, odd: bool | None) -> Real:
    """Return functions of a place over half a patch's length: (n_places, n_functions).

    Even or odd, or both: value and slope at the rim, and a hump outside and one inside. They end
    with slope 0 at 1 + reach. Without any reach humps inside are left, which end at 1.
    """
    if odd is None:
        both = [_steps(place, reach, order, odd=one) for one in (False, True)]
        return np.concatenate(both, axis=1)
    size = np.abs(place)
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
    beyond = (size - 1) / (reach or 1.0)
    sign = np.where(place < 0, -1.0, 1.0) ** (order + odd)
    inside, outside = size <= 1, (size > 1) & (beyond < 1)
    columns = [
        np.where(inside, _derived(inner, order)(place), 0.0)
        + np.where(outside, sign * _derived(outer, order)(beyond) / (reach or 1.0) ** order, 0.0)
        for inner, outer in pieces
    ]
    return np.stack(columns, axis=1)


def _derived(one: Polynomial, order: int) -> Polynomial:
    return one.deriv(order) if order else one


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
