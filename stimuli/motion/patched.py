"""Modes of a plate with patches bonded to it: by Ritz's method, with functions of their own."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.motion.basis import (
    Around,
    Polynomials,
    free_basis,
    half_waves,
    held_basis,
    plate_energies,
    products_of,
    ring_m,
)
from stimuli.motion.standing_waves import wavenumber_rad_m
from stimuli.strip.edge import CLAMPED
from stimuli.strip.patch import Laminate, laminate, layer_of

if TYPE_CHECKING:
    from stimuli.arrays import Real
    from stimuli.strip.strip import Strip


_DEGREE, _MOST_DEGREE = 3, 9
"""Of a disc's functions, beside a wave's phase from its centre to its rim; and at most."""

_NODES: Final = 8
"""Nodes of an integral, beside the phase of the finest polynomial over half of it."""

_MOST_FUNCTIONS: Final = 3000
"""Functions of one symmetry, those of patches aside: some ten seconds."""

_DEPENDENT: Final = 1e-7
"""Part of a function of a patch that those of the plate must not have already."""


_VALUE: Final = (0, 0)
_BENDS: Final = ((2, 0), (0, 2), (1, 1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PatchedModes:
    """Modes of one symmetry of a plate with patches, with the mass 1 each.

    Attributes
    ----------
    squared, bent
        As of `Modes`. The patches have the plate's loss.
    functions : _Functions
        In which the modes were sought.
    series : ndarray of float64, shape (n_functions, n_modes)
        The modes in those.
    stiffness, bare_stiffness : ndarray of float64, shape (n_functions, n_functions)
        Of the plate with its patches and without, springs included.
    """

    squared: Real
    bent: Real
    functions: _Functions
    series: Real
    stiffness: Real
    bare_stiffness: Real

    def at(self, points_m: Real, *, laplacian: bool = False) -> Real:
        """Return the modes at points (n_points, 2), or their Laplacians: (1, n_points, n_modes)."""
        return np.asarray(self.functions.at(points_m, laplacian=laplacian) @ self.series)

    def at_rest_m(self, points_m: Real, pushes: Real) -> tuple[Real, Real]:
        """Return what loads at rest do, with the patches and without: (n_loads, n_points) each.

        `pushes`, (n_loads, n_functions), are the loads' works on the functions.
        """
        from scipy.linalg import solve

        (at_points,) = self.functions.at(points_m)
        some = (self.stiffness, self.bare_stiffness)
        first, second = (
            (at_points @ solve(one, pushes.T, assume_a="pos", check_finite=False)).T for one in some
        )
        return first, second


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Functions:
    """What one symmetry is made of: polynomials of the whole plate, and each patch's functions.

    Where left and right are mirror images, the patches on the right have functions for both.
    """

    along: Polynomials
    across: Polynomials
    odd_x: bool | None
    around: tuple[Around, ...]
    kept: Real  # combinations of the patches' functions, (n_local, n_kept)

    @property
    def n_global(self) -> int:
        """How many are polynomials of the whole plate."""
        return len(self.along.series) * len(self.across.series)

    def at(self, points_m: Real, *, laplacian: bool = False) -> Real:
        """Return all functions at points, or their Laplacians: (1, n_points, n_functions)."""
        orders = _BENDS[:2] if laplacian else (_VALUE,)
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


@lru_cache(maxsize=4)
def patched_modes(strip: Strip, highest_hz: float, *, centred: bool) -> tuple[PatchedModes, ...]:
    """Return the modes of a finite plate with patches up to a frequency, equation (84).

    Parameters
    ----------
    strip : Strip
        The plate and its patches; its loss does not count here.
    highest_hz : float
        How far.
    centred : bool
        Whether only modes that are even across the strip are asked for; they are a group of
        their own only where all patches are centred across.
    """
    return tuple(_group(strip, highest_hz, odd) for odd in _symmetries(strip, centred=centred))


def has_room(strip: Strip, highest_hz: float) -> bool:
    """Tell whether the modes of each symmetry can be sought in as many functions as they need."""
    groups = len(_symmetries(strip, centred=False))
    most = wavenumber_rad_m(strip, highest_hz)
    lengths_m = (strip.length_m or 0.0, strip.width_m)
    n = math.prod(half_waves(most, length_m / 2) for length_m in lengths_m) * 4 // groups
    return n <= _MOST_FUNCTIONS


def _symmetries(strip: Strip, *, centred: bool) -> list[tuple[bool | None, bool | None]]:
    """Return the groups of modes, odd or even or both along and across."""
    patches = set(strip.patches)
    mirrored = {dataclasses.replace(patch, x_m=-patch.x_m) for patch in patches} == patches
    in_the_middle = all(patch.y_m == strip.width_m / 2 for patch in patches)
    along = (False, True) if mirrored else (None,)
    across: tuple[bool | None, ...] = (None,)
    if in_the_middle:
        across = (False,) if centred else (False, True)
    return list(product(along, across))


def _group(strip: Strip, highest_hz: float, odd: tuple[bool | None, bool | None]) -> PatchedModes:
    """Return the modes of one symmetry."""
    from scipy.linalg import eigh

    most = wavenumber_rad_m(strip, highest_hz)
    functions = _functions(strip, most, odd)
    springs, stiffness, bare_stiffness, mass = _matrices(strip, functions)
    n = functions.n_global
    kept = _independent(mass, n)
    springs, stiffness, bare_stiffness, mass = (
        _kept(one, n, kept) for one in (springs, stiffness, bare_stiffness, mass)
    )
    squared, vectors = eigh(
        stiffness,
        mass,
        subset_by_value=(-math.inf, (2 * math.pi * highest_hz) ** 2),
        check_finite=False,
    )
    return PatchedModes(
        squared=squared,
        bent=vectors.T @ (stiffness - springs) @ vectors,
        functions=dataclasses.replace(functions, kept=kept),
        series=vectors,
        stiffness=stiffness,
        bare_stiffness=bare_stiffness,
    )


def _functions(strip: Strip, most_rad_m: float, odd: tuple[bool | None, bool | None]) -> _Functions:
    """Return the functions of one symmetry."""
    length_m, clamped = strip.length_m or 0.0, strip.edge is CLAMPED
    n_along, n_across = (half_waves(most_rad_m, size / 2) for size in (length_m, strip.width_m))
    signs = (False, True)
    along = [free_basis(n_along, length_m, odd=one) for one in signs]
    across = [held_basis(n_across, strip.width_m, clamped=clamped, odd=one) for one in signs]
    around = []
    for patch in strip.patches:
        if odd[0] is not None and patch.x_m < 0:
            continue
        degree = _DEGREE + math.ceil(most_rad_m * patch.half_size_m[0])
        around.append(
            Around(
                patch=patch,
                ring_m=ring_m(strip, patch),
                odd=(odd[0] if patch.x_m == 0 else None, odd[1]),
                degree=min(degree, _MOST_DEGREE),
            )
        )
    return _Functions(
        along=_sided(odd[0], *along),
        across=_sided(odd[1], *across),
        odd_x=odd[0],
        around=tuple(around),
        kept=np.zeros((0, 0)),
    )


def _sided(odd: bool | None, even: Polynomials, uneven: Polynomials) -> Polynomials:  # noqa: FBT001 - none is both
    """Return the even or the odd functions, or both, the even ones first."""
    if odd is not None:
        return uneven if odd else even
    return dataclasses.replace(even, series=np.concatenate([even.series, uneven.series]))


def _matrices(strip: Strip, functions: _Functions) -> tuple[Real, Real, Real, Real]:
    """Return the matrices of springs, of plate and springs with and without patches, and mass."""
    plate = layer_of(strip.material, strip.thickness_m)
    bare = laminate([plate])
    sheet, held = plate_energies(strip, functions.along, functions.across)
    n = functions.n_global
    blocks = [
        _Block(functions, one, bare, laminate([plate, *one.patch.layers]))
        for one in functions.around
    ]
    size = n + sum(block.n_local for block in blocks)
    springs, bare_stiffness, added, mass = (np.zeros((size, size)) for _ in range(4))
    springs[:n, :n], bare_stiffness[:n, :n] = held, sheet + held
    mass[:n, :n] = bare.mass_kg_m2 * np.eye(n)
    first = n
    for block in blocks:
        mine = np.r_[0:n, first : first + block.n_local]
        first += block.n_local
        bends, moves, more_bends, more_moves = block.products()
        bare_stiffness[np.ix_(mine, mine)] += bends
        added[np.ix_(mine, mine)] += more_bends
        mass[np.ix_(mine, mine)] += moves + more_moves
    return springs, bare_stiffness + added, bare_stiffness, mass


class _Block:
    """What a patch adds to the matrices of the plate's functions and its own."""

    def __init__(
        self, functions: _Functions, around: Around, bare: Laminate, whole: Laminate
    ) -> None:
        self._functions, self._around, self._bare = functions, around, bare
        self._added = Laminate(
            biaxial_n_m=max(whole.biaxial_n_m - bare.biaxial_n_m, 0.0),
            opposed_n_m=max(whole.opposed_n_m - bare.opposed_n_m, 0.0),
            mass_kg_m2=whole.mass_kg_m2 - bare.mass_kg_m2,
            reach_m=whole.reach_m,
        )
        # the patch on the right stands for its image on the left as well
        self._fold = 2.0 if functions.odd_x is not None and around.patch.x_m > 0 else 1.0
        one = np.array([[around.patch.x_m, around.patch.y_m]])
        self._n_box, n_disc = (f(one, _VALUE).shape[1] for f in (around.box, around.disc))
        self.n_local = self._n_box + n_disc

    def products(self) -> tuple[Real, Real, Real, Real]:
        """Return bending and mass of the plate alone, of its own functions; and what is added."""
        first = self._functions.n_global
        size = first + self.n_local
        bends, moves, more_bends, more_moves = (np.zeros((size, size)) for _ in range(4))
        plate, box = slice(0, first), slice(first, first + self._n_box)
        pairs = [(plate, box, 0, 1), (box, box, 1, 1)]
        self._on_lines(bends, moves, pairs, self._bare, inside=False)
        if self._around.patch.is_disc:
            self._on_disc((bends, moves), (more_bends, more_moves))
        else:
            pairs.append((plate, plate, 0, 0))
            self._on_lines(more_bends, more_moves, pairs, self._added, inside=True)
        return bends, moves, more_bends, more_moves

    def _on_lines(
        self,
        bends: Real,
        moves: Real,
        pairs: list[tuple[slice, slice, int, int]],
        stiff: Laminate,
        *,
        inside: bool,
    ) -> None:
        """Add integrals over the cells, or a rectangle, of functions that are products of two."""
        functions, found = self._functions, []
        for axis, (series, n) in enumerate(
            zip((functions.along, functions.across), self._nodes(), strict=True)
        ):
            places_m, weights = self._around.line(axis, n, inside=inside)
            place, orders = places_m / series.half_m - axis, range(3)
            root = np.sqrt(weights)[:, np.newaxis]
            plate = [root * series.values(place, order) for order in orders]
            box = [root * self._around.factor(axis, places_m, order) for order in orders]
            found.append((plate, box))
        along, across = found
        alike = self._fold * (stiff.biaxial_n_m + stiff.opposed_n_m) / 2
        mixed = self._fold * (stiff.biaxial_n_m - stiff.opposed_n_m) / 2
        twisting, mass = 2 * self._fold * stiff.opposed_n_m, self._fold * stiff.mass_kg_m2
        for rows, columns, i, j in pairs:
            one, other = (along[i], across[i]), (along[j], across[j])
            bent = alike * (_both(one, other, (2, 0), (2, 0)) + _both(one, other, (0, 2), (0, 2)))
            bent += mixed * (_both(one, other, (2, 0), (0, 2)) + _both(one, other, (0, 2), (2, 0)))
            bent += twisting * _both(one, other, (1, 1), (1, 1))
            for matrix, part in (
                (bends, bent), (moves, mass * _both(one, other, _VALUE, _VALUE)),
            ):  # fmt: skip
                matrix[rows, columns] += part
                if rows != columns:
                    matrix[columns, rows] += part.T

    def _on_disc(self, alone: tuple[Real, Real], more: tuple[Real, Real]) -> None:
        """Add integrals over a disc: of its own functions, and what it adds to all."""
        points_m, weights = self._around.area(max(self._nodes()))
        root = np.sqrt(self._fold * weights)[:, np.newaxis]
        every = [root * self._values(points_m, orders) for orders in (*_BENDS, _VALUE)]
        xx, yy, xy, value = every
        own = slice(self._functions.n_global + self._n_box, len(alone[0]))
        kinds = (
            ("biaxial_n_m", xx + yy, 0.5),
            ("opposed_n_m", xx - yy, 0.5),
            ("opposed_n_m", xy, 2.0),
        )
        terms = [(0, name, rows, share) for name, rows, share in kinds]
        for which, name, rows, share in (*terms, (1, "mass_kg_m2", value, 1.0)):
            squared = rows.T @ rows
            more[which][:] += share * getattr(self._added, name) * squared
            part = share * getattr(self._bare, name) * squared[:, own]
            alone[which][:, own] += part
            alone[which][own] += part.T
            alone[which][own, own] -= part[own]

    def _values(self, points_m: Real, orders: tuple[int, int]) -> Real:
        around = self._around
        parts = (self._functions.plate, around.box, around.disc)
        return np.concatenate([part(points_m, orders) for part in parts], axis=1)

    def _nodes(self) -> tuple[int, int]:
        """Return how many nodes along and across an integral over a cell needs."""
        functions, sizes_m = (
            self._functions,
            zip(self._around.patch.half_size_m, self._around.ring_m, strict=True),
        )
        along, across = (
            _NODES + math.ceil(one.series.shape[1] * min(max(size_m) / one.half_m, 1.0))
            for one, size_m in zip((functions.along, functions.across), sizes_m, strict=True)
        )
        return along, across


def _both(
    one: tuple[list[Real], list[Real]],
    other: tuple[list[Real], list[Real]],
    orders: tuple[int, int],
    others: tuple[int, int],
) -> Real:
    """Return the integrals of derivatives of products, each a factor along and one across."""
    along, across = (
        one[axis][orders[axis]].T @ other[axis][others[axis]] for axis in range(len(orders))
    )
    return np.asarray(np.kron(along, across), dtype=np.float64)


def _independent(mass: Real, n_global: int) -> Real:
    """Return combinations of functions without those of patches that the plate's nearly have."""
    from scipy.linalg import solve

    whole, crossed = mass[:n_global, :n_global], mass[:n_global, n_global:]
    left = mass[n_global:, n_global:] - crossed.T @ solve(whole, crossed, assume_a="pos")
    scale = 1 / np.sqrt(np.diag(mass)[n_global:])
    share, vectors = np.linalg.eigh(scale[:, np.newaxis] * left * scale)
    kept = share > _DEPENDENT
    return np.asarray(scale[:, np.newaxis] * vectors[:, kept] / np.sqrt(share[kept]))


def _kept(matrix: Real, n_global: int, kept: Real) -> Real:
    """Return a matrix of all functions as one of the plate's and the combinations kept."""
    crossed, own = matrix[:n_global, n_global:] @ kept, kept.T @ matrix[n_global:, n_global:] @ kept
    return np.block([[matrix[:n_global, :n_global], crossed], [crossed.T, own]])
