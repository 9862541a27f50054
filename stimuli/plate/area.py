"""What lies on a plate (a load, a patch, a fingertip) as integrals over its area.

An area is cut into slices across the strip, each a chord with its half length. Of a disc the places
along are those of a sine, x = R sin(t), so that chords are smooth in t and Gauss's rule converges
fast.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple, Protocol

import numpy as np
from numpy.polynomial import legendre

from stimuli.plate.line import gauss_rule

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from stimuli.arrays import Real
    from stimuli.load import Load
    from stimuli.plate.line import Line

_MARGIN: Final = 6
"""Gauss nodes beyond the interior functions of a cell."""
_ROUNDING: Final = 1e-9


class Area(Protocol):
    """A disc, a rectangle or a point on a plate."""

    @property
    def x_m(self) -> float:
        """Centre along the strip."""

    @property
    def y_m(self) -> float:
        """Centre across the strip."""

    @property
    def half_size_m(self) -> tuple[float, float]:
        """Half of the extent along and across."""

    @property
    def is_disc(self) -> bool:
        """Whether it is round."""


class Slices(NamedTuple):
    """Places along an area, their weights, and half of the chord at each."""

    x_m: Real
    weights_m: Real
    half_chord_m: Real


def slice_area(
    area: Area, n_nodes: int, kinks_m: ArrayLike = (), span: tuple[float, float] = (-1.0, 1.0)
) -> Slices:
    """Return Gauss slices of an area between two places along, in halves of its extent.

    Where functions have kinks along the strip the rule begins again.

    Examples
    --------
    >>> from stimuli import PressureDisc
    >>> x_m, weights_m, half_chord_m = slice_area(PressureDisc(x_m=0, y_m=2, radius_m=1), 8)
    >>> float((2 * half_chord_m @ weights_m / math.pi).round(9))
    1.0
    """
    half_m = area.half_size_m[0]
    if not half_m:
        return Slices(np.array([area.x_m]), np.ones(1), np.zeros(1))
    inner = (np.asarray(kinks_m, dtype=np.float64) - area.x_m) / half_m
    inner = inner[(inner > span[0] + _ROUNDING) & (inner < span[1] - _ROUNDING)]
    ends = np.unique([*span, *inner])
    ends = np.arcsin(ends) if area.is_disc else ends
    nodes, weights = gauss_rule(n_nodes)
    widths = np.diff(ends)[:, np.newaxis]
    local = (ends[:-1, np.newaxis] + widths * (nodes + 1) / 2).ravel()
    weights_m = half_m * (widths * weights / 2).ravel()
    if not area.is_disc:
        return Slices(
            area.x_m + half_m * local, weights_m, np.full(local.size, area.half_size_m[1])
        )
    chord = np.cos(local)
    return Slices(area.x_m + half_m * np.sin(local), weights_m * chord, area.half_size_m[1] * chord)


def area_nodes(area: Area, along: Line, across: Line) -> tuple[Real, Real]:
    """Return points (n, 2) and weights over an area, exact for products of two functions."""
    half_x_m = area.half_size_m[0]
    n_x = _MARGIN + along.max_interior(area.x_m - half_x_m, area.x_m + half_x_m)
    if area.is_disc:
        n_x += _MARGIN + max(across.interior)
    slices = slice_area(area, n_x, along.kinks_m)
    y_m, weights_m = _chord_nodes(area, slices, across)
    x_m = np.broadcast_to(slices.x_m[:, np.newaxis], y_m.shape)
    weights = slices.weights_m[:, np.newaxis] * weights_m
    return np.stack([x_m.ravel(), y_m.ravel()], axis=1), weights.ravel()


def _chord_nodes(area: Area, slices: Slices, across: Line) -> tuple[Real, Real]:
    """Return places and weights on each chord: (n_slices, n_nodes) each.

    Of an area in the middle of a line with even functions only one half is taken, twice.
    """
    half_m, half_y_m = slices.half_chord_m, area.half_size_m[1]
    if not half_y_m:
        return np.full((1, 1), area.y_m), np.ones((1, 1))
    middle_m = across.breaks_m[-1]
    is_halved = across.parity > 0 and abs(area.y_m - middle_m) < _ROUNDING * middle_m
    kinks_m = across.kinks_m - area.y_m
    inner = kinks_m[(np.abs(kinks_m) < half_y_m) & ((kinks_m < 0) | (not is_halved))]
    edges_m = np.stack(
        [
            -half_m,
            *(np.clip(kink_m, -half_m, half_m) for kink_m in inner),
            half_m * (not is_halved),
        ],
        axis=1,
    )
    nodes, weights = gauss_rule(
        _MARGIN + across.max_interior(area.y_m - half_y_m, area.y_m + half_y_m)
    )
    width_m = np.diff(edges_m, axis=1)[:, :, np.newaxis]
    places_m = area.y_m + edges_m[:, :-1, np.newaxis] + width_m * (nodes + 1) / 2
    weights_m = (2 if is_halved else 1) * width_m * weights / 2
    return places_m.reshape(half_m.size, -1), weights_m.reshape(half_m.size, -1)


def load_work(load: Load, along: Line, across: Line) -> Real:
    """Return the work of a unit load on all products of functions: (n_along, n_across).

    A force works on the displacement, a pressure on its integral over the area, and the moment of a
    bonded patch on the integral of the Laplacian, equation (31).
    """
    slices = slice_area(load, _slice_nodes(load, along, across), along.kinks_m)
    integral, slope = _chord_integrals(load, slices, across)
    values, curvatures = (
        derivative * slices.weights_m[:, np.newaxis]
        for derivative in along.derivatives(slices.x_m, (0, 2))
    )
    if load.is_moment:
        return np.asarray(values.T @ slope + curvatures.T @ integral)
    return np.asarray(values.T @ integral / load.area_m2)


def remaining_work(load: Load, along: Line, across: Line) -> tuple[Real, Real]:
    """Return the work at rest of what `local_field` leaves of a load, and integrals of that field.

    Both have the shape (n_along, n_across).
    """
    if not _is_moment_disc(load):
        return load_work(load, along, across), np.zeros((along.size, across.size))
    slices = slice_area(load, _slice_nodes(load, along, across), along.kinks_m)
    (values,) = along.derivatives(slices.x_m, (0,))
    values *= slices.weights_m[:, np.newaxis]
    force, _, local = chord_work(load, slices, across)
    return np.asarray(values.T @ force), np.asarray(values.T @ local)


def _slice_nodes(load: Load, along: Line, across: Line) -> int:
    half_m = load.half_size_m[0]
    n_nodes = _MARGIN + along.max_interior(load.x_m - half_m, load.x_m + half_m)
    return n_nodes + (_MARGIN + max(across.interior) if load.is_disc else 0)


class ChordWork(NamedTuple):
    """Work of a load on functions across, by slices: (n_slices, n_functions) each.

    On Y(y) exp(i p x) it is force - p^2 curvature + k^4 inertia, k the wavenumber of the plate.
    """

    force: Real
    curvature: Real
    inertia: Real


def chord_work(load: Load, slices: Slices, across: Line) -> ChordWork:
    """Return the work of what `local_field` leaves of a unit load, by slices."""
    if _is_moment_disc(load):
        y_m, weights_m = _chord_nodes(load, slices, across)
        x_m = np.broadcast_to(slices.x_m[:, np.newaxis], y_m.shape)
        s = _radius_squared(load, x_m, y_m)
        (values,) = across.derivatives(y_m.ravel(), (0,))
        values = values.reshape(*y_m.shape, -1)
        pressure = (48 * s - 24) / load.half_size_m[0] ** 2
        force, inertia = (
            np.einsum("sn,snf->sf", weights_m * density, values)
            for density in (pressure, _bump(load, s))
        )
        return ChordWork(force, np.zeros_like(force), inertia)
    integral, slope = _chord_integrals(load, slices, across)
    none = np.zeros_like(integral)
    if load.is_moment:
        return ChordWork(slope, integral, none)
    return ChordWork(integral / load.area_m2, none, none)


def local_field(load: Load, points_m: Real) -> Real:
    """Return D times the part of a load's field that is known in closed form, at points (n, 2).

    A moment disc makes the Laplacian of the displacement jump at its rim, which no sum of smooth
    functions follows well. R^2 (q^2 / 8 + q^3 / 12) with q = 1 - r^2 / R^2, and 0 outside of the
    disc, has that jump and a continuous normal derivative of the Laplacian. The rest is the field
    of a pressure, (48 r^2 / R^2 - 24) / R^2, and of the inertia of this part, equation (35). Other
    loads have no such part.
    """
    if not _is_moment_disc(load):
        return np.zeros(len(points_m))
    x_m, y_m = points_m.T
    return _bump(load, np.minimum(_radius_squared(load, x_m, y_m), 1.0))


def _is_moment_disc(load: Load) -> bool:
    return load.is_moment and load.is_disc


def _radius_squared(load: Load, x_m: Real, y_m: Real) -> Real:
    """Return the distances from a disc's centre, squared, in radii."""
    return ((x_m - load.x_m) ** 2 + (y_m - load.y_m) ** 2) / load.half_size_m[0] ** 2


def _bump(load: Load, s: Real) -> Real:
    q = 1 - s
    return load.half_size_m[0] ** 2 * (q**2 / 8 + q**3 / 12)


def _chord_integrals(load: Load, slices: Slices, across: Line) -> tuple[Real, Real]:
    """Return integrals over chords of the functions across, and differences of their slopes.

    Of a point the first are its values.
    """
    if not slices.half_chord_m.any():
        values = across.derivatives([load.y_m], (0,))[0]
        return values, np.zeros_like(values)
    rims_m = np.concatenate([load.y_m + slices.half_chord_m, load.y_m - slices.half_chord_m])
    integral, slope = across.derivatives(rims_m, (-1, 1))
    n = slices.x_m.size
    return integral[:n] - integral[n:], slope[:n] - slope[n:]


@dataclass(frozen=True, slots=True)
class Rim:
    """Functions of one disc: (1 - r^2)^2 times polynomials inside, 0 outside, equation (40).

    They have a continuous slope and a jump of the curvature at the rim of the disc, as the plate
    has where a disc stiffens it. Products of piecewise polynomials can only follow that jump
    slowly.

    Attributes
    ----------
    x_m, y_m, radius_m : float
        The disc.
    powers : ndarray of int, shape (2, n_functions)
        Degrees of Legendre polynomials along and across, those of the coarse basis first.
    n_coarse : int
        How many functions that has.
    """

    x_m: float
    y_m: float
    radius_m: float
    powers: NDArray[np.intp]
    n_coarse: int

    is_disc: ClassVar[bool] = True

    @property
    def half_size_m(self) -> tuple[float, float]:
        """Half of the extent along and across."""
        return self.radius_m, self.radius_m

    def derivatives(self, points_m: Real, orders: Sequence[tuple[int, int]]) -> list[Real]:
        """Return derivatives at points, (n_points, n_functions), by orders along and across."""
        u, v = (points_m - (self.x_m, self.y_m)).T / self.radius_m
        q = np.maximum(1 - u * u - v * v, 0.0)
        is_inside = q > 0
        bump = {
            (0, 0): q * q,
            (1, 0): -4 * u * q,
            (0, 1): -4 * v * q,
            (1, 1): 8 * u * v * is_inside,
            (2, 0): 8 * u * u * is_inside - 4 * q,
            (0, 2): 8 * v * v * is_inside - 4 * q,
        }
        i, j = self.powers
        n = int(self.powers.max()) + 1
        along, across = _legendre_derivatives(u, n), _legendre_derivatives(v, n)
        results = []
        for a, b in orders:
            value = sum(
                math.comb(a, c)
                * math.comb(b, d)
                * bump[c, d][:, np.newaxis]
                * along[a - c][:, i]
                * across[b - d][:, j]
                for c in range(a + 1)
                for d in range(b + 1)
            )
            results.append(np.asarray(value / self.radius_m ** (a + b)))
        return results


def make_rim(area: Area, degrees: tuple[int, int], parities: tuple[int, int] = (0, 0)) -> Rim:
    """Return the rim functions of a disc up to a degree of the coarse and one of the fine basis.

    A parity of 1 or -1 keeps only functions that are even or odd along, or across.
    """
    coarse, fine = degrees
    powers = sorted(
        (
            (i, j)
            for i in range(fine + 1)
            for j in range(fine + 1 - i)
            if all(
                not parity or (-1) ** degree == parity
                for degree, parity in zip((i, j), parities, strict=True)
            )
        ),
        key=lambda pair: sum(pair) > coarse,
    )
    n_coarse = sum(i + j <= coarse for i, j in powers)
    return Rim(area.x_m, area.y_m, area.half_size_m[0], np.array(powers).T, n_coarse)


def _legendre_derivatives(x: Real, n: int) -> list[Real]:
    """Return n Legendre polynomials at places, their first and second derivatives."""
    results = [np.asarray(legendre.legvander(x, n - 1), dtype=np.float64)]
    for _ in range(2):
        lower, derivative = results[-1], np.zeros_like(results[0])
        for k in range(1, n):
            derivative[:, k] = (2 * k - 1) * lower[:, k - 1]
            if k > 1:
                derivative[:, k] += derivative[:, k - 2]
        results.append(derivative)
    return results
