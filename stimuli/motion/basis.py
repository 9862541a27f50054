"""Polynomials in which the modes of a plate are sought, and what bends in them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import leggauss, legmul, legvander

if TYPE_CHECKING:
    from stimuli.arrays import Real


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


def disc_rings(n_nodes: int) -> tuple[Real, Real]:
    """Return radii and weights, the integral of f(r) r from 0 to 1, with twice as many angles each.

    What is smooth over a disc has even powers of the radius only, once taken all the way round.

    >>> radii, weights = disc_rings(5)
    >>> radii.size, bool(np.isclose((weights * radii**8).sum(), 0.1))
    (3, True)
    """
    nodes, weights = leggauss((n_nodes + 1) // 2)
    return np.sqrt((nodes + 1) / 2), weights / 4


def products_of(along: Real, across: Real) -> Real:
    """Return the products of functions along and across at the same points: (n_points, n)."""
    return np.asarray((along[:, :, np.newaxis] * across[:, np.newaxis]).reshape(len(along), -1))
