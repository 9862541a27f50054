"""Polynomials in which the modes of a plate are sought, and what bends in them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import legmul, legvander

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
