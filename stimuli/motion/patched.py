"""Modes of a plate with patches bonded to it: by Ritz's method, with functions of their own."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from stimuli.motion.basis import (
    BENDS,
    MOST_DEGREE,
    VALUE,
    Around,
    Functions,
    free_basis,
    half_waves,
    held_basis,
    plate_energies,
    ring_m,
    sided,
)
from stimuli.motion.standing_waves import wavenumber_rad_m
from stimuli.strip.edge import CLAMPED
from stimuli.strip.patch import Laminate, laminate, layer_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.strip.strip import Strip


_DEGREE: Final = 3
"""Of a disc's functions, beside a wave's phase from its centre to its rim."""

_NODES: Final = 8
"""Nodes of an integral, beside the phase of the finest polynomial over half of it."""

_MOST_FUNCTIONS: Final = 2000
"""Functions of one symmetry, those of patches aside: a few seconds."""

_DIGITS, _MORE_DIGITS, _SMALL = 7.0, 10.0, 0.1
"""To which waves are held by the plate's polynomials: the jumps at rims leave fewer anyway. Where
half a patch is a smaller part of the width, the polynomials have to bend more sharply about it."""

_DEPENDENT: Final = 1e-7
"""Part of a function of a patch that those of the plate must not have already."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PatchedModes:
    """Modes of one symmetry of a plate with patches, with the mass 1 each.

    Attributes
    ----------
    squared, bent
        As of `Modes`. The patches have the plate's loss.
    functions : Functions
        In which the modes were sought.
    taken : ndarray of int, shape (n_taken,)
        Numbers of the functions that were taken.
    series : ndarray of float64, shape (n_taken, n_modes)
        The modes in those.
    factor : ndarray of float64, shape (n_taken, n_taken)
        Cholesky's, below the diagonal, of the plate's stiffness, springs included.
    bare_stiffness : ndarray of float64, shape (n_taken, n_taken)
        Without the patches.
    """

    squared: Real
    bent: Real
    functions: Functions
    taken: NDArray[np.intp]
    series: Real
    factor: Real
    bare_stiffness: Real

    def moved(self, at_functions: Real) -> Real:
        """Return the modes where the functions are known, or what works on them."""
        return np.asarray(at_functions[..., self.taken] @ self.series)

    def at_rest_m(self, at_points: Real, pushes: Real) -> Real:
        """Return what loads do at rest: (n_loads, n_points).

        Of the functions these are the values at the points, (n_points, n_functions), and the works
        of the loads, (n_loads, n_functions).
        """
        from scipy.linalg import cho_solve

        swung = cho_solve((self.factor, True), pushes[:, self.taken].T, check_finite=False)
        return np.asarray((at_points[:, self.taken] @ swung).T)

    def bare_at_rest_m(self, at_points: Real, pushes: Real) -> Real:
        """Return the same of the plate without its patches, in these functions."""
        from scipy.linalg import solve

        right = pushes[:, self.taken].T
        swung = solve(self.bare_stiffness, right, assume_a="pos", check_finite=False)
        return np.asarray((at_points[:, self.taken] @ swung).T)


@lru_cache(maxsize=4)
def patched_modes(
    strip: Strip, highest_hz: float, *, centred: bool, within_hz: float | None = None
) -> tuple[PatchedModes, ...]:
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
    within_hz : float, optional
        Up to which frequency they are going to be asked for: the functions for that are built
        once, and fewer of them taken for fewer modes.
    """
    within_hz = max(within_hz or 0.0, highest_hz)
    symmetries = _symmetries(strip, centred=centred)
    return tuple(_modes(strip, _built(strip, within_hz, odd), highest_hz) for odd in symmetries)


def has_room(strip: Strip, highest_hz: float) -> bool:
    """Tell whether the modes of each symmetry can be sought in as many functions as they need."""
    groups = len(_symmetries(strip, centred=False))
    most = wavenumber_rad_m(strip, highest_hz)
    lengths_m = (strip.length_m or 0.0, strip.width_m)
    digits = _digits(strip)
    n = math.prod(half_waves(most, one / 2, digits=digits) for one in lengths_m) * 4 // groups
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


class _Built(NamedTuple):
    """The functions of one symmetry, and the matrices of springs, stiffness and mass."""

    functions: Functions
    springs: Real
    stiffness: Real
    bare_stiffness: Real
    mass: Real


@lru_cache(maxsize=8)
def _built(strip: Strip, highest_hz: float, odd: tuple[bool | None, bool | None]) -> _Built:
    most = wavenumber_rad_m(strip, highest_hz)
    functions = _functions(strip, most, odd)
    matrices = _matrices(strip, functions)
    n = functions.n_global
    kept = _independent(matrices[-1], n)
    return _Built(
        dataclasses.replace(functions, kept=kept), *(_kept(one, n, kept) for one in matrices)
    )


def _modes(strip: Strip, built: _Built, highest_hz: float) -> PatchedModes:
    """Return the modes of one symmetry up to a frequency."""
    from scipy.linalg import cholesky, eigh

    most, n = wavenumber_rad_m(strip, highest_hz), len(built.mass)
    taken = built.functions.up_to(most, n)
    springs, stiffness, bare_stiffness, mass = (
        one if len(taken) == n else one[np.ix_(taken, taken)] for one in built[1:]
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
        functions=built.functions,
        taken=taken,
        series=vectors,
        factor=cholesky(stiffness, lower=True),
        bare_stiffness=bare_stiffness,
    )


def _functions(strip: Strip, most_rad_m: float, odd: tuple[bool | None, bool | None]) -> Functions:
    """Return the functions of one symmetry."""
    length_m, clamped = strip.length_m or 0.0, strip.edge is CLAMPED
    sizes_m, digits = (length_m, strip.width_m), _digits(strip)
    n_along, n_across = (half_waves(most_rad_m, size / 2, digits=digits) for size in sizes_m)
    signs = (False, True)
    along = [free_basis(n_along, length_m, odd=one) for one in signs]
    across = [held_basis(n_across, strip.width_m, clamped=clamped, odd=one) for one in signs]
    around = [
        Around(
            patch=patch,
            ring_m=ring_m(strip, patch),
            odd=(odd[0] if patch.x_m == 0 else None, odd[1]),
            degree=min(_DEGREE + math.ceil(most_rad_m * patch.half_size_m[0]), MOST_DEGREE),
        )
        for patch in strip.patches
        if odd[0] is None or patch.x_m >= 0
    ]
    return Functions(
        along=sided(odd[0], *along),
        across=sided(odd[1], *across),
        odd_x=odd[0],
        odd_y=odd[1],
        around=tuple(around),
        digits=digits,
        kept=np.zeros((0, 0)),
    )


def _digits(strip: Strip) -> float:
    is_small = any(min(one.half_size_m) < _SMALL * strip.width_m for one in strip.patches)
    return _MORE_DIGITS if is_small else _DIGITS


def _matrices(strip: Strip, functions: Functions) -> tuple[Real, Real, Real, Real]:
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
        self, functions: Functions, around: Around, bare: Laminate, whole: Laminate
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
        self._n_box, n_disc = (f(one, VALUE).shape[1] for f in (around.box, around.disc))
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
        functions, found, nodes = self._functions, [], self._nodes(self._around.ring_m)
        for axis, (series, n) in enumerate(
            zip((functions.along, functions.across), nodes, strict=True)
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
                (bends, bent), (moves, mass * _both(one, other, VALUE, VALUE)),
            ):  # fmt: skip
                matrix[rows, columns] += part
                if rows != columns:
                    matrix[columns, rows] += part.T

    def _on_disc(self, alone: tuple[Real, Real], more: tuple[Real, Real]) -> None:
        """Add integrals over a disc: of its own functions, and what it adds to all."""
        points_m, weights = self._around.area(max(self._nodes((0.0, 0.0))))
        if self._around.odd[1] is not None:  # a product of two is the same in the other half
            upper = points_m[:, 1] > self._around.patch.y_m
            points_m, weights = points_m[upper], 2 * weights[upper]
        root = np.sqrt(self._fold * weights)[:, np.newaxis]
        every = [root * self._values(points_m, orders) for orders in (*BENDS, VALUE)]
        xx, yy, xy, value = every
        own = slice(self._functions.n_global + self._n_box, len(alone[0]))
        bends = np.stack([xx + yy, xx - yy, 2 * xy]) / math.sqrt(2)
        names = ("biaxial_n_m", "opposed_n_m", "opposed_n_m")
        size, mass = len(alone[0]), ("mass_kg_m2",)
        for which, rows, kinds in ((0, bends, names), (1, value[np.newaxis], mass)):
            # no patch takes stiffness or mass away, so that its part is a product with itself
            added, bare = (
                np.sqrt([getattr(stiff, name) for name in kinds])[:, np.newaxis, np.newaxis] * rows
                for stiff in (self._added, self._bare)
            )
            more[which][:] += added.reshape(-1, size).T @ added.reshape(-1, size)
            part = bare.reshape(-1, size).T @ bare[:, :, own].reshape(-1, own.stop - own.start)
            alone[which][:, own] += part
            alone[which][own] += part.T
            alone[which][own, own] -= part[own]

    def _values(self, points_m: Real, orders: tuple[int, int]) -> Real:
        around = self._around
        parts = (self._functions.plate, around.box, around.disc)
        return np.hstack([part(points_m, orders) for part in parts])

    def _nodes(self, ring_m: tuple[float, float]) -> tuple[int, int]:
        """Return how many nodes along and across an integral over patch and ring's cells needs."""
        functions, half_size_m = self._functions, self._around.patch.half_size_m
        along, across = (
            _NODES + math.ceil(one.series.shape[1] * min(max(half_m, beyond_m) / one.half_m, 1.0))
            for one, half_m, beyond_m in zip(
                (functions.along, functions.across), half_size_m, ring_m, strict=True
            )
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
