"""Functions of one coordinate: piecewise polynomials with a continuous slope, orthonormal.

They are the basis of all that a plate does. Across a strip they give its guided waves, and products
of functions along and across give the modes of a plate with ends. A line is divided into cells by
breaks, at which only the second derivative may jump: there a load begins or ends. In each cell
there are four cubics, which carry value and slope at both of its ends, and interior functions whose
second derivatives are Legendre polynomials, so that bending energies are nearly diagonal.

A fine basis begins with all functions of a coarse one. What a matrix of the fine basis holds in its
first rows and columns is therefore the matrix of the coarse one, and an error estimate needs no
second assembly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.polynomial import legendre, polynomial

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from stimuli.arrays import Real


class LineEnd(NamedTuple):
    """Whether functions may have a value, and a slope, at an end of a line."""

    has_value: bool
    has_slope: bool


FREE: Final = LineEnd(has_value=True, has_slope=True)
SUPPORTED: Final = LineEnd(has_value=False, has_slope=True)
CLAMPED_END: Final = LineEnd(has_value=False, has_slope=False)
EVEN: Final = LineEnd(has_value=True, has_slope=False)
"""The middle of a symmetric line of which one half is computed, for even functions."""
ODD: Final = LineEnd(has_value=False, has_slope=True)


class Margins(NamedTuple):
    """Interior functions of a cell beyond one for each half wavelength, coarse and fine.

    Short cells get fewer: polynomials converge faster there.
    """

    coarse: float
    fine: float


gauss_rule = cache(legendre.leggauss)
"""Nodes and weights of Gauss's rule on (-1, 1), by their number."""

_CUBICS: Final = np.array([[2, -3, 0, 1], [1, -1, -1, 1], [2, 3, 0, -1], [-1, -1, 1, 1]]) / 4
"""Value 1 and slope 1 at the lower end of (-1, 1), and at the upper, by rising powers."""
_ROUNDING: Final = 1e-6
_GAUSS_MARGIN: Final = 4
"""Gauss nodes beyond the interior functions, which make products of two functions exact."""


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """Orthonormal functions on cells between breaks.

    Attributes
    ----------
    breaks_m : ndarray of float64, shape (n_cells + 1,)
        Ends of the cells.
    interior : tuple of int
        Numbers of interior functions of each cell.
    coefficients : ndarray of float64, shape (n_local, n_functions)
        The functions in terms of cubics and interior functions.
    n_coarse : int
        How many of them, the first ones, make up the coarse basis.
    parity : int
        1 or -1 where the cells are the lower half of a line and the functions are even or odd about
        the last break, which are then known on both halves; 0 where the cells are the whole line.
    """

    breaks_m: Real
    interior: tuple[int, ...]
    coefficients: Real
    n_coarse: int
    parity: int

    @property
    def size(self) -> int:
        """Number of functions."""
        return int(self.coefficients.shape[1])

    @property
    def kinks_m(self) -> Real:
        """All places where second derivatives may jump, and the ends, on both halves."""
        if not self.parity:
            return self.breaks_m
        return np.unique(np.append(self.breaks_m, 2 * self.breaks_m[-1] - self.breaks_m))

    def max_interior(self, low_m: float, high_m: float) -> int:
        """Return the greatest number of interior functions of a cell between two places."""
        interior = (*self.interior, *(self.interior[::-1] if self.parity else ()))
        first, last = _cells_between(self.kinks_m, low_m, high_m)
        return max(interior[first : last + 1])

    def local(self, low_m: float, high_m: float) -> tuple[Line, Real]:
        """Return the cubics and interior functions of the cells that a part of the line overlaps.

        The second are all functions of the line there in terms of them, of the shape (n_local,
        n_functions).
        """
        breaks_m, n_ends = self.breaks_m, 2 * self.breaks_m.size
        first, last = _cells_between(breaks_m, low_m, high_m)
        interior = n_ends + np.cumsum([0, *self.interior])
        rows = [
            *range(2 * first, 2 * last + 4),
            *range(int(interior[first]), int(interior[last + 1])),
        ]
        functions = np.eye(len(self.coefficients))[:, rows]
        local = Line(breaks_m, self.interior, functions, len(rows), self.parity)
        return local, self.coefficients[rows]

    def integration_nodes(self) -> tuple[Real, Real]:
        """Return Gauss nodes, and weights that count both halves, exact for products of two."""
        nodes, weights = [], []
        copies = 2 if self.parity else 1
        for low_m, high_m, n in zip(self.breaks_m, self.breaks_m[1:], self.interior, strict=False):
            local, weight = gauss_rule(n + _GAUSS_MARGIN)
            nodes.append((low_m + high_m + (high_m - low_m) * local) / 2)
            weights.append(copies * (high_m - low_m) / 2 * weight)
        return np.concatenate(nodes), np.concatenate(weights)

    def products(self, *orders: tuple[int, int]) -> list[Real]:
        """Return the integrals of products of derivatives, by their two orders.

        Each has the shape (n_functions, n_functions), in powers of metres.
        """
        nodes_m, weights = self.integration_nodes()
        values = self.derivatives(nodes_m, (0, 1, 2))
        return [(values[i] * weights[:, np.newaxis]).T @ values[j] for i, j in orders]

    def derivatives(self, x_m: ArrayLike, orders: Sequence[int]) -> list[Real]:
        """Return derivatives of all functions at places on the line.

        Parameters
        ----------
        x_m : array_like of float, shape (n_places,)
            Places on either half of the line.
        orders : sequence of int
            0 is the function, 1 its slope, 2 its curvature, -1 its integral from the lower end.

        Returns
        -------
        list of ndarray of float64, shape (n_places, n_functions)
            One for each order.
        """
        places_m, middle_m = np.asarray(x_m, dtype=np.float64), float(self.breaks_m[-1])
        is_mirrored = (places_m > middle_m) if self.parity else np.zeros(places_m.shape, dtype=bool)
        lower_m = np.where(is_mirrored, 2 * middle_m - places_m, places_m)
        derivatives = self._lower_half(lower_m, orders)
        for order, values in zip(orders, derivatives, strict=True):
            if order >= 0:
                values[is_mirrored] *= self.parity * (-1) ** order
            elif self.parity > 0:
                # The integral goes on beyond the middle; that of an odd function comes back.
                whole = self._lower_half(np.array([middle_m]), (-1,))[0]
                values[is_mirrored] = 2 * whole - values[is_mirrored]
        return derivatives

    def _lower_half(self, x_m: Real, orders: Sequence[int]) -> list[Real]:
        breaks_m, n_ends = self.breaks_m, 2 * self.breaks_m.size
        cell = np.clip(np.searchsorted(breaks_m, x_m, side="right") - 1, 0, breaks_m.size - 2)
        half_m = np.diff(breaks_m)[cell] / 2
        local = (x_m - breaks_m[cell]) / half_m - 1
        most = max(self.interior)
        powers = np.asarray(legendre.legvander(local, most + 5), dtype=np.float64)
        first = n_ends + np.cumsum([0, *self.interior])
        rows = np.arange(x_m.size)
        results = []
        for order in orders:
            scale = half_m ** -float(order)
            raw = np.zeros((x_m.size, len(self.coefficients)))
            cubics = polynomial.polyval(local, _cubics(order))
            for column, values in enumerate(cubics):
                # Slopes are per metre, so that a cubic that carries one has its cell's half length.
                raw[rows, 2 * cell + column] = values * scale * half_m ** (column % 2)
            interior = _interior(powers, most, order) * scale[:, np.newaxis]
            for number, n in enumerate(self.interior):
                here = np.flatnonzero(cell == number)
                raw[here, first[number] : first[number + 1]] = interior[here, :n]
                if order == -1:
                    raw[cell > number] += self._cell_integrals(number, int(first[number]))
            results.append(raw @ self.coefficients)
        return results

    def _cell_integrals(self, cell: int, first: int) -> Real:
        """Return the integrals of all cubics and interior functions over one cell."""
        integrals = np.zeros(len(self.coefficients))
        half_m = (self.breaks_m[cell + 1] - self.breaks_m[cell]) / 2
        integrals[2 * cell : 2 * cell + 4] = half_m, half_m**2 / 3, half_m, -(half_m**2) / 3
        if self.interior[cell]:
            integrals[first] = half_m * math.sqrt(2.5) * 2 / 15
        return integrals


def make_line(
    breaks_m: ArrayLike,
    max_wavenumbers_rad_m: tuple[float, float],
    ends: tuple[LineEnd, LineEnd],
    margins: Margins,
    parity: int = 0,
) -> Line:
    """Return functions that follow waves up to a wavenumber.

    Parameters
    ----------
    breaks_m : array_like of float, shape (n_cells + 1,)
        Ends of the cells, increasing.
    max_wavenumbers_rad_m : tuple of float
        Largest wavenumbers of the waves that the coarse and the fine basis follow.
    ends : tuple of LineEnd
        What functions may have at the lower and at the upper end.
    margins : Margins
        How many functions there are beyond those that the waves need.
    parity : int
        1 or -1 if the upper end is the middle of a symmetric line, with `EVEN` or `ODD` there.

    Returns
    -------
    Line

    Examples
    --------
    A beam with both ends clamped has the first eigenvalue 4.730040745; the basis is orthonormal:

    >>> beam = make_line([0.0, 1.0], (4.73, 4.73), (CLAMPED_END, CLAMPED_END), Margins(4, 6))
    >>> mass, bending = beam.products((0, 0), (2, 2))
    >>> bool(np.allclose(mass, np.eye(beam.size), atol=1e-13))
    True
    >>> float((np.linalg.eigvalsh(bending)[0] ** 0.25).round(9))
    4.730040745
    """
    breaks = np.asarray(breaks_m, dtype=np.float64)
    coarse, fine = (
        _n_interior(wavenumber_rad_m * np.diff(breaks) / math.pi, margin)
        for wavenumber_rad_m, margin in zip(max_wavenumbers_rad_m, margins, strict=True)
    )
    n_ends = 2 * breaks.size
    is_free = np.ones(n_ends, dtype=bool)
    is_free[:2], is_free[-2:] = ends
    is_coarse = np.concatenate([np.arange(n) < few for n, few in zip(fine, coarse, strict=True)])
    # The coarse functions first: of an orthonormal basis made in this order they are the first.
    order = np.concatenate(
        [
            np.flatnonzero(is_free),
            n_ends + np.flatnonzero(is_coarse),
            n_ends + np.flatnonzero(~is_coarse),
        ]
    )
    raw = np.eye(n_ends + int(fine.sum()))[:, order]
    n_coarse = int(is_free.sum() + is_coarse.sum())
    line = Line(breaks, tuple(fine.tolist()), raw, n_coarse, parity)
    nodes_m, weights = line.integration_nodes()
    values = np.sqrt(weights)[:, np.newaxis] * line.derivatives(nodes_m, (0,))[0]
    # Columns of one size first: those of slopes are small as cells are.
    scale = np.linalg.norm(values, axis=0)
    triangle = np.linalg.qr(values / scale, mode="r")
    coefficients = raw / scale @ np.linalg.inv(triangle)
    return Line(breaks, line.interior, coefficients, n_coarse, parity)


def count_functions(
    breaks_m: Real, max_wavenumber_rad_m: float, ends: tuple[LineEnd, LineEnd], margin: float
) -> int:
    """Return how many functions `make_line` makes, which takes far longer for many.

    >>> count_functions(np.array([0.0, 1.0]), 4.73, (CLAMPED_END, CLAMPED_END), 6)
    8
    """
    interior = _n_interior(max_wavenumber_rad_m * np.diff(breaks_m) / math.pi, margin)
    return int(interior.sum()) + 2 * (breaks_m.size - 2) + sum(ends[0]) + sum(ends[1])


def place_breaks(
    places_m: Iterable[float], low_m: float, high_m: float, *, min_cell_m: float, max_cell_m: float
) -> Real:
    """Return breaks from one end of a line to the other, at places but in cells of these lengths.

    A place that would make a shorter cell gets no break; longer cells are divided evenly.

    Examples
    --------
    >>> place_breaks([0.25, 0.251, 0.99], 0.0, 1.0, min_cell_m=0.02, max_cell_m=0.5).tolist()
    [0.0, 0.25, 0.625, 1.0]
    """
    ends_m = [low_m]
    for place_m in sorted(places_m):
        if place_m - ends_m[-1] > min_cell_m and high_m - place_m > min_cell_m:
            ends_m.append(place_m)
    breaks: list[float] = []
    for start_m, end_m in zip(ends_m, [*ends_m[1:], high_m], strict=True):
        n_cells = max(1, math.ceil((end_m - start_m) / max_cell_m - 1e-9))
        breaks += [start_m + (end_m - start_m) * i / n_cells for i in range(n_cells)]
    return np.array([*breaks, high_m])


def _cells_between(breaks_m: Real, low_m: float, high_m: float) -> tuple[int, int]:
    """Return the first and the last cell that a part of a line overlaps, not those it touches."""
    rounding_m = _ROUNDING * (high_m - low_m)
    begin = np.searchsorted(breaks_m, low_m + rounding_m, side="right") - 1
    end = np.searchsorted(breaks_m, high_m - rounding_m, side="left") - 1
    first = int(np.clip(begin, 0, breaks_m.size - 2))
    return first, int(np.clip(end, first, breaks_m.size - 2))


def _n_interior(half_waves: Real, margin: float) -> NDArray[np.int64]:
    return np.ceil(half_waves + margin * np.minimum(1.0, 0.5 + half_waves / 2)).astype(np.int64)


@cache
def _cubics(order: int) -> Real:
    """Return the cubics, or their derivative or integral from -1, by rising powers in columns."""
    if order == -1:
        return np.asarray(polynomial.polyint(_CUBICS, lbnd=-1, axis=1).T, dtype=np.float64)
    return np.asarray(polynomial.polyder(_CUBICS, order, axis=1).T, dtype=np.float64)


def _interior(powers: Real, n: int, order: int) -> Real:
    """Return n interior functions, or derivatives of them, from Legendre polynomials at places.

    The second derivative of number j is sqrt(k + 1/2) P_k with k = j + 2; value and slope vanish at
    both ends, as P_k is orthogonal to all straight lines. The other orders follow from the integral
    of P_k from -1, (P_(k+1) - P_(k-1)) / (2 k + 1).
    """
    k = np.arange(2, n + 2)
    scale = np.sqrt(k + 0.5)
    if order == 2:  # noqa: PLR2004 - the curvature
        return np.asarray(scale * powers[:, k])

    def integral(degree: NDArray[np.int64]) -> Real:
        below = np.where(degree > 0, powers[:, np.abs(degree - 1)], -1.0)
        return np.asarray((powers[:, degree + 1] - below) / (2 * degree + 1))

    if order == 1:
        return np.asarray(scale * integral(k))
    upper, same, lower = (
        (integral(degree) for degree in (k + 2, k, k - 2))
        if order == -1
        else (powers[:, degree] for degree in (k + 2, k, k - 2))
    )
    a, b = (2 * k + 1) * (2 * k + 3), (2 * k - 1) * (2 * k + 1)
    return np.asarray(scale * (upper / a - same * (1 / a + 1 / b) + lower / b))
