"""Modes of a plate with ends, and what it does at rest, by the method of Rayleigh and Ritz.

The displacement is sought in products of functions along the plate, whose ends are free, and across
it, between held edges. Where round patches stiffen the plate, functions of their own follow the
jump of curvature at their rims. Stiffness and mass then are matrices, and modes their eigenvectors.

Symmetric problems fall apart: functions even or odd along and across are solved by themselves, and
those that no load excites are left out. The coarse basis, from which errors are estimated, is a
part of the fine one, and its matrices are parts of the same matrices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from stimuli.errors import PlateError, Rule
from stimuli.plate.area import area_nodes, load_work, make_rim, remaining_work
from stimuli.plate.line import (
    EVEN,
    FREE,
    ODD,
    Margins,
    count_functions,
    make_line,
    place_breaks,
)
from stimuli.plate.patch import laminate, layer_of
from stimuli.plate.waveguide import (
    edge_end,
    edge_slopes,
    has_lossless_springs,
    plate_wavenumber,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from stimuli.arrays import Real
    from stimuli.load import Load
    from stimuli.plate.area import Rim
    from stimuli.plate.line import Line
    from stimuli.plate.patch import BondedPatch, Laminate
    from stimuli.plate.strip import Strip

_MIN_CELL, _MAX_CELL = 0.02, 8.0
"""Of the width. Long cells hold many waves; beyond some tens polynomials lose digits."""
_NEAR_EDGE, _SMALL = 0.04, 0.25
"""Of the width: a disc that lies so near to an edge, or is so small, gets breaks across."""
_UNFOLDED: Final = 1.6
"""How many times the margin a single cell over the whole width needs."""
_ENDS: Final = 2
_MAX_FUNCTIONS: Final = 4000
"""Of one symmetry: more take half a minute and a gigabyte."""
_ROUNDING: Final = 1e-9
_MIN_INVERSE: Final = 1e-12
"""Rim functions are nearly combinations of others in the mass matrix. Of the inverse problem, mass
over stiffness, they are eigenvectors near 0, which are very fast modes that follow at rest."""


Selection = NDArray[np.intp] | slice
"""Which functions of a basis."""


class Resolution(NamedTuple):
    """How fine a plate is solved: in a coarse and a fine basis.

    Functions follow waves up to `multiples` of the highest frequency asked for; `margins` are the
    functions beyond those, and `rim_degrees` the degrees of polynomials in a rim.
    """

    multiples: tuple[float, float] = (3.0, 5.0)
    margins: Margins = Margins(2.0, 3.0)
    rim_degrees: tuple[int, int] = (3, 4)


@dataclass(frozen=True, eq=False)
class Basis:
    """Functions of one symmetry on a plate: products of those along and across, and of rims."""

    strip: Strip
    along: Line
    across: Line
    rims: tuple[Rim, ...]

    @cached_property
    def is_coarse(self) -> NDArray[np.bool_]:
        """Which functions make up the coarse basis."""
        lines = (np.arange(line.size) < line.n_coarse for line in (self.along, self.across))
        products = np.logical_and.outer(*lines).ravel()
        rims = (np.arange(rim.powers.shape[1]) < rim.n_coarse for rim in self.rims)
        return np.concatenate([products, *rims])

    def resolutions(self) -> tuple[Selection, Selection]:
        """Return which functions make up the coarse and the fine basis."""
        return np.flatnonzero(self.is_coarse), slice(None)

    @cached_property
    def _laminate(self) -> Laminate:
        return laminate([layer_of(self.strip.material, self.strip.thickness_m)])

    @property
    def areal_kg_m2(self) -> float:
        """Mass per area outside patches."""
        return self._laminate.mass_kg_m2

    @cached_property
    def matrices(self) -> tuple[Real, Real]:
        """Stiffness with that of the edge springs, and mass, equation (36)."""
        strip, along, across = self.strip, self.along, self.across
        rigidity, nu = strip.bending_stiffness_n_m, strip.material.poisson_ratio
        xx, x1, xm = along.products((2, 2), (1, 1), (2, 0))
        yy, y1, ym = across.products((2, 2), (1, 1), (0, 2))
        slopes = edge_slopes(strip, across)
        size, shape = self.is_coarse.size, (along.size, across.size)
        n = math.prod(shape)
        stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
        bending = stiffness[:n, :n].reshape(*shape, *shape)
        for x, y in ((nu * xm, ym), (nu * xm.T, ym.T), (2 * (1 - nu) * x1, y1)):
            bending += np.multiply.outer(rigidity * x, y).transpose(0, 2, 1, 3)
        # Functions are orthonormal: what bends in one direction alone is on diagonals.
        np.einsum("ayaz->ayz", bending)[...] += rigidity * yy + slopes.T @ slopes
        np.einsum("ayby->aby", bending)[...] += rigidity * xx[:, :, np.newaxis]
        np.fill_diagonal(mass[:n, :n], self.areal_kg_m2)
        for rim in self.rims:
            self._add(rim, self._laminate, stiffness, mass, only_rim=True)
        for patch in strip.patches:
            whole = laminate([layer_of(strip.material, strip.thickness_m), *patch.layers])
            bare = self._laminate
            added = replace(
                whole,
                **{
                    name: max(getattr(whole, name) - getattr(bare, name), 0.0)
                    for name in ("biaxial_n_m", "opposed_n_m", "mass_kg_m2")
                },
            )
            self._add(patch, added, stiffness, mass)
        return stiffness, mass

    @cached_property
    def edge_slopes(self) -> Real:
        """Rows whose squares are the stiffness of the edge springs: (n_rows, n_functions)."""
        slopes = np.kron(np.eye(self.along.size), edge_slopes(self.strip, self.across))
        n_rims = self.is_coarse.size - slopes.shape[1]
        return np.asarray(np.pad(slopes, ((0, 0), (0, n_rims))))

    def _add(
        self,
        area: BondedPatch | Rim,
        added: Laminate,
        stiffness: Real,
        mass: Real,
        *,
        only_rim: bool = False,
    ) -> None:
        """Add bending stiffness and mass of an area.

        Those of products with each other are left out if only those of rims are required.
        """
        if self.along.parity and area.x_m > _MIN_CELL * self.strip.width_m:
            return  # its mirror image stands for both
        points_m, weights = area_nodes(area, self.along, self.across)
        copies = 2 if self.along.parity and area.x_m < 0 else 1
        root = np.sqrt(copies * weights)[:, np.newaxis]
        # On a small area the many functions along are combinations of few.
        half_m = area.half_size_m[0]
        along, parts = self.along.local(area.x_m - half_m, area.x_m + half_m)
        local = replace(self, along=along)
        xx, yy, xy, value = (
            root * derivative
            for derivative in local.derivatives(points_m, ((2, 0), (0, 2), (1, 1), (0, 0)))
        )
        rows = np.concatenate(
            [
                math.sqrt(added.biaxial_n_m / 2) * (xx + yy),
                math.sqrt(added.opposed_n_m / 2) * (xx - yy),
                math.sqrt(2 * added.opposed_n_m) * xy,
            ]
        )
        n_across = self.across.size
        n_local, n = along.size * n_across, self.along.size * n_across
        for matrix, half in ((stiffness, rows), (mass, math.sqrt(added.mass_kg_m2) * value)):
            product = half.T @ half
            if not only_rim:
                inner = product[:n_local, :n_local].reshape(n_local, along.size, n_across)
                right = np.einsum("imz,mb->ibz", inner, parts, optimize=True)
                whole = parts.T @ right.reshape(along.size, -1)
                np.add(matrix[:n, :n], whole.reshape(n, n), out=matrix[:n, :n])
            mixed = parts.T @ product[:n_local, n_local:].reshape(along.size, -1)
            np.add(matrix[:n, n:], mixed.reshape(n, -1), out=matrix[:n, n:])
            np.add(matrix[n:, n:], product[n_local:, n_local:], out=matrix[n:, n:])
            matrix[n:, :n] = matrix[:n, n:].T

    def derivatives(self, points_m: Real, orders: Sequence[tuple[int, int]]) -> list[Real]:
        """Return derivatives of all functions at points: (n_points, n_functions), by orders."""
        along, across = self.by_axis(points_m, orders)
        products = [
            (along[i][:, :, np.newaxis] * across[j][:, np.newaxis]).reshape(len(points_m), -1)
            for i, j in orders
        ]
        if not self.rims:
            return products
        rims = [self._rim_derivatives(rim, points_m, orders) for rim in self.rims]
        return [np.concatenate(parts, axis=1) for parts in zip(products, *rims, strict=True)]

    def by_axis(
        self, points_m: Real, orders: Sequence[tuple[int, int]]
    ) -> tuple[dict[int, Real], ...]:
        """Return derivatives of the functions along, and of those across, at points, by order."""
        results = []
        for axis, line in enumerate((self.along, self.across)):
            own_orders = sorted({pair[axis] for pair in orders})
            places_m, back = np.unique(points_m[:, axis], return_inverse=True)
            values = line.derivatives(places_m, own_orders)
            results.append(dict(zip(own_orders, (value[back] for value in values), strict=True)))
        return tuple(results)

    def _rim_derivatives(
        self, rim: Rim, points_m: Real, orders: Sequence[tuple[int, int]]
    ) -> list[Real]:
        if not self.along.parity or not rim.x_m:
            return rim.derivatives(points_m, orders)
        is_mirrored = points_m[:, 0] > 0
        folded_m = np.stack([-np.abs(points_m[:, 0]), points_m[:, 1]], axis=1)
        results = rim.derivatives(folded_m, orders)
        for (order, _), values in zip(orders, results, strict=True):
            values[is_mirrored] *= self.along.parity * (-1) ** order
        return results

    def values(self, points_m: Real) -> Real:
        """Return all functions at points: (n_points, n_functions)."""
        return self.derivatives(points_m, ((0, 0),))[0]

    def work(self, load: Load) -> Real:
        """Return the work of a unit load on all functions."""
        return np.concatenate([load_work(load, self.along, self.across).ravel(), *self._rims(load)])

    def remaining_work(self, load: Load) -> tuple[Real, Real]:
        """Return the work at rest of what `local_field` leaves of a unit load.

        The second is the integral of that field. Rims follow a load without its help.
        """
        if self.rims:
            return self.work(load), np.zeros(self.is_coarse.size)
        force, local = remaining_work(load, self.along, self.across)
        return force.ravel(), local.ravel()

    def _rims(self, load: Load) -> Iterable[Real]:
        if not self.rims:
            return
        points_m, weights = area_nodes(load, self.along, self.across)
        for rim in self.rims:
            if load.is_moment:
                xx, yy = self._rim_derivatives(rim, points_m, ((2, 0), (0, 2)))
                yield weights @ (xx + yy)
            else:
                (value,) = self._rim_derivatives(rim, points_m, ((0, 0),))
                yield weights @ value / load.area_m2

    def modes(self, select: Selection, max_hz: float = math.inf) -> tuple[Real, Real]:
        """Return squares of angular frequencies, rising, and shapes of unit mass.

        Those of the plate without loss up to a frequency, in some of the functions.
        """
        stiffness, mass = self.selected(select)
        max_square = (2 * math.pi * max_hz) ** 2
        if not self.rims and not self.strip.patches:
            squared, shapes = _eigenvectors(stiffness / self.areal_kg_m2, None, (0.0, max_square))
            return squared, shapes / math.sqrt(self.areal_kg_m2)
        inverse, shapes = _eigenvectors(mass, stiffness, (1 / max_square, math.inf))
        inverse = np.maximum(inverse, _MIN_INVERSE * inverse.max(initial=0.0))
        return 1 / inverse[::-1], (shapes / np.sqrt(inverse))[:, ::-1]

    def held(self, select: Selection, shapes: Real) -> Real:
        """Return what springs without loss add to the squares of modes: (n_modes,)."""
        if not has_lossless_springs(self.strip):
            return np.zeros(shapes.shape[1])
        return np.asarray(((self.edge_slopes[:, select] @ shapes) ** 2).sum(axis=0))

    def at_rest(self, select: Selection, work: Real) -> Real:
        """Return amplitudes of some of the functions at rest: (n_loads, n_functions)."""
        stiffness, _ = self.selected(select)
        solved = scipy.linalg.solve(stiffness, work.T, assume_a="pos", check_finite=False)
        return np.asarray(solved.T)

    def selected(self, select: Selection) -> tuple[Real, Real]:
        """Return stiffness and mass of some of the functions."""
        stiffness, mass = (matrix[select][:, select] for matrix in self.matrices)
        return stiffness, mass


def _eigenvectors(
    matrix: Real, norm: Real | None, bounds: tuple[float, float]
) -> tuple[Real, Real]:
    """Return eigenvalues in (low, high], rising, and eigenvectors."""
    options: dict[str, Any] = {"subset_by_value": bounds}
    if bounds == (0.0, math.inf):  # divide and conquer is the fastest for all of them
        options = {"driver": "evd" if norm is None else "gvd"}
    values, vectors = scipy.linalg.eigh(matrix, norm, check_finite=False, **options)
    return values, vectors


def plate_bases(
    strip: Strip,
    max_hz: float,
    resolution: Resolution,
    sources: Sequence[Load],
    followed: Sequence[Load] = (),
) -> list[Basis]:
    """Return bases of all symmetries that loads excite.

    Parameters
    ----------
    strip : Strip
        A plate with ends.
    max_hz : float
        Highest frequency of interest.
    resolution : Resolution
    sources : sequence of Load
        What excites the plate.
    followed : sequence of Load
        Those of them where curvatures may jump as the load begins and ends.
    """
    width_m, middle_m = strip.width_m, strip.width_m / 2
    half_length_m = float(strip.length_m or math.inf) / 2
    bent = [*(load for load in followed if load.is_moment), *strip.patches]
    images = {replace(patch, x_m=-patch.x_m) for patch in strip.patches}
    discs = [patch for patch in strip.patches if patch.is_disc]
    folds_along = images == set(strip.patches) and not _images_overlap(discs)
    folds_across = all(abs(area.y_m - middle_m) < _ROUNDING * width_m for area in bent)
    x_ends_m = [
        area.x_m + side * area.half_size_m[0]
        for area in (*followed, *strip.patches)
        for side in (-1, 1)
    ]
    y_ends_m = [load.y_m for load in followed if not load.half_size_m[0]]
    y_ends_m += [
        area.y_m + side * area.half_size_m[1]
        for area in bent
        for side in (-1, 1)
        if _needs_breaks_across(area, width_m)
    ]
    coarse, fine = resolution.multiples
    wavenumbers = plate_wavenumber(strip, coarse * max_hz), plate_wavenumber(strip, fine * max_hz)
    is_even_along = all(abs(load.x_m) < _ROUNDING * width_m for load in sources)
    is_even_across = all(abs(load.y_m - middle_m) < _ROUNDING * width_m for load in sources)
    x_parities = ((1,) if is_even_along else (1, -1)) if folds_along else (0,)
    y_parities = ((1,) if is_even_across else (1, -1)) if folds_across else (0,)
    if folds_along:
        x_ends_m = [-abs(x_m) for x_m in x_ends_m]
    if folds_across:
        y_ends_m = [min(y_m, width_m - y_m) for y_m in y_ends_m]
    cells = {"min_cell_m": _MIN_CELL * width_m, "max_cell_m": _MAX_CELL * width_m}
    x_breaks_m = place_breaks(
        x_ends_m, -half_length_m, 0.0 if folds_along else half_length_m, **cells
    )
    y_breaks_m = place_breaks(y_ends_m, 0.0, middle_m if folds_across else width_m, **cells)
    is_one_cell = not folds_across and y_breaks_m.size == _ENDS
    widening = _UNFOLDED if is_one_cell else 1.0
    margins = Margins(*(widening * margin for margin in resolution.margins))
    edge = edge_end(strip)
    middle = {1: EVEN, -1: ODD}
    if folds_along:
        discs = [patch for patch in discs if patch.x_m <= _ROUNDING * width_m]
    bases = []
    for x_parity, y_parity in product(x_parities, y_parities):
        x_ends, y_ends = (FREE, middle.get(x_parity, FREE)), (edge, middle.get(y_parity, edge))
        n_functions = count_functions(
            x_breaks_m, wavenumbers[1], x_ends, resolution.margins[1]
        ) * count_functions(y_breaks_m, wavenumbers[1], y_ends, margins[1])
        if n_functions > _MAX_FUNCTIONS:
            data = {"n_functions": n_functions, "max_functions": _MAX_FUNCTIONS}
            raise PlateError(Rule.TOO_MANY_FUNCTIONS, **data)
        along = make_line(x_breaks_m, wavenumbers, x_ends, resolution.margins, x_parity)
        across = make_line(y_breaks_m, wavenumbers, y_ends, margins, y_parity)
        parities = [
            (x_parity if abs(disc.x_m) <= _ROUNDING * width_m else 0, y_parity) for disc in discs
        ]
        rims = (
            make_rim(disc, resolution.rim_degrees, pair)
            for disc, pair in zip(discs, parities, strict=True)
        )
        bases.append(Basis(strip, along, across, tuple(rims)))
    return bases


def _images_overlap(discs: Sequence[BondedPatch]) -> bool:
    """Return whether a disc overlaps the mirror image of another one, or of itself."""
    for disc in discs:
        for image in discs:
            apart_m = abs(abs(disc.x_m) - abs(image.x_m)) if disc != image else 2 * abs(disc.x_m)
            if _ROUNDING < apart_m < disc.half_size_m[0] + image.half_size_m[0]:
                return True
    return False


def _needs_breaks_across(area: Load | BondedPatch, width_m: float) -> bool:
    half_m = area.half_size_m[1]
    room_m = min(area.y_m, width_m - area.y_m) - half_m
    return not area.is_disc or room_m < _NEAR_EDGE * width_m or half_m < _SMALL * width_m
