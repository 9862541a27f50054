"""Polynomials in which the modes of a plate are sought, and what bends in them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

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
    degrees : ndarray of int, shape (n_functions,), or None
        Numbers of the Legendre polynomials that they are, unless they are sums of several.
    """

    series: Real
    half_m: float
    degrees: NDArray[np.intp] | None = None

    def values(self, place: Real, order: int = 0) -> Real:
        """Return a derivative of all functions at places from -1 to 1: (n_places, n_functions)."""
        (found,) = self.jet(place, (order,))
        return found

    def jet(self, place: Real, orders: Sequence[int]) -> list[Real]:
        """Return several derivatives of all functions at places: (n_places, n_functions) each."""
        n = self.series.shape[1]
        legendre = np.asarray(legvander(place, n - 1)) * (_norms(n) / math.sqrt(self.half_m))
        derived, one = _derivatives(self, max(orders)), self.degrees
        found = []
        for order in orders:
            if order == 0 and one is not None:
                found.append(legendre[:, one])
                continue
            parts = [legendre[:, parity::2] @ part.T for parity, part in derived[order].items()]
            found.append(sum(parts[1:], parts[0]) / self.half_m**order)
        return found

    def products(self, one: int, other: int) -> Real:
        """Return the integrals of two derivatives over the length: (n_functions, n_functions).

        Of at most second order each.
        """
        derived = _derivatives(self, max(one, other))
        both = [(part, derived[other].get(parity)) for parity, part in derived[one].items()]
        parts = [left @ right.T for left, right in both if right is not None]
        found = sum(parts[1:], parts[0]) if parts else np.zeros(2 * (len(self.series),))
        found /= self.half_m ** (one + other)
        return found

    def part(self, some: slice | NDArray[np.intp]) -> Polynomials:
        """Return some of the functions."""
        degrees = None if self.degrees is None else self.degrees[some]
        return replace(self, series=self.series[some], degrees=degrees)

    def combined(self, vectors: Real) -> Polynomials:
        """Return combinations of the functions: (n_functions, n_combinations)."""
        return replace(self, series=vectors.T @ self.series, degrees=None)


def free_basis(n: int, length_m: float, *, odd: bool) -> Polynomials:
    """Return the first n even or odd polynomials: nothing holds the ends.

    >>> basis = free_basis(3, 0.2, odd=False)
    >>> bool(abs(basis.products(0, 0) - np.eye(3)).max() < 1e-12)
    True
    """
    degrees = np.arange(int(odd), 2 * n, 2)
    return Polynomials(series=np.eye(2 * n)[degrees], half_m=length_m / 2, degrees=degrees)


@lru_cache(maxsize=16)
def held_basis(n: int, width_m: float, *, clamped: bool, odd: bool) -> Polynomials:
    """Return n even or odd polynomials that are 0 at both edges; if clamped, their slopes too.

    >>> basis = held_basis(3, 0.025, clamped=True, odd=True)
    >>> edges = np.array([-1.0, 1.0])
    >>> bool(max(abs(basis.values(edges, order)).max() for order in (0, 1)) < 1e-6)
    True
    """
    degrees = 2 * n + (5 if clamped else 3)
    lower = np.arange(degrees - 1.0)
    by_y = np.zeros((degrees, degrees))  # y times a polynomial, in unnormed ones
    by_y[np.arange(degrees - 1), np.arange(1, degrees)] = (lower + 1) / (2 * lower + 1)
    by_y[np.arange(1, degrees), np.arange(degrees - 1)] = (lower + 1) / (2 * lower + 3)
    rows = np.eye(degrees)[int(odd) : 2 * n : 2]
    for _ in range(2 if clamped else 1):
        rows = rows - rows @ by_y @ by_y  # times 1 - y^2
    orthonormal, _ = np.linalg.qr((rows / _norms(degrees)).T)
    return Polynomials(series=np.asarray(orthonormal.T), half_m=width_m / 2)


def sided(odd: bool | None, even: Polynomials, uneven: Polynomials) -> Polynomials:  # noqa: FBT001 - none is both
    """Return the even or the odd functions, or both, the even ones first."""
    if odd is not None:
        return uneven if odd else even
    return joined([even, uneven])


def joined(parts: Sequence[Polynomials]) -> Polynomials:
    """Return the functions of several parts of equal degree, one part after the other."""
    degrees = [one.degrees for one in parts if one.degrees is not None]
    return replace(
        parts[0],
        series=np.concatenate([one.series for one in parts]),
        degrees=np.concatenate(degrees) if len(degrees) == len(parts) else None,
    )


def _norms(n: int) -> Real:
    """Return what makes Legendre polynomials orthonormal."""
    return np.asarray(np.sqrt(np.arange(n) + 0.5))


@lru_cache(maxsize=16)
def _derivatives(functions: Polynomials, order: int) -> list[dict[int, Real]]:
    """Return functions and their derivatives over a half length of 1, in orthonormal polynomials.

    Even (0) and odd ones (1) of these apart, where there are any. P_k' is the sum of (2 j + 1) P_j
    over j = k - 1, k - 3, ...
    """
    halves = {parity: functions.series[:, parity::2] for parity in (0, 1)}
    found = [{parity: half for parity, half in halves.items() if np.any(half)} or halves]
    norms = _norms(functions.series.shape[1])
    for _ in range(order):
        below = {}
        for parity, part in found[-1].items():
            weighed = (part * norms[parity::2])[:, ::-1]
            above = np.cumsum(weighed, axis=1, out=weighed)[:, ::-1][:, 1 - parity :]
            derived = np.zeros((len(part), halves[1 - parity].shape[1]))
            n = above.shape[1]
            np.multiply(above, 2 * norms[1 - parity :: 2][:n], out=derived[:, :n])
            below[1 - parity] = derived
        found.append(below)
    return found


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
    both = along[:, :, np.newaxis] * across[:, np.newaxis]
    return np.asarray(both.reshape(len(along), along.shape[1] * across.shape[1]))
