"""Stiffness and mass of a plate with patches, in the functions of one symmetry."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from stimuli.motion.patches.around import BENDS, VALUE
from stimuli.strip.edge import ElasticEdge
from stimuli.strip.patch import Laminate, laminate, layer_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.motion.patches.around import Around
    from stimuli.motion.patches.functions import Functions
    from stimuli.strip.strip import Strip

    Pairs = tuple[NDArray[np.intp], NDArray[np.intp]]

_NODES: Final = 4
"""Nodes of an integral, beside the phase of the finest polynomial over half of it."""

_MANY: Final = 4
"""Of so many times more pairs of factors than are asked for only those are summed."""

_PLATE, _BOX = 0, 1
"""Functions of the whole plate, and those on the cells about a patch."""

_ORDERS: Final = ((0, 0), (1, 1), (2, 2), (0, 2), (2, 0))
"""Derivatives of two functions along, and across, whose products count."""


class Matrices(NamedTuple):
    """Of all functions: springs along the edges, if any, stiffness with these, mass.

    `overlap` are the integrals over the plate of all functions with all.
    """

    springs: Real | None
    stiffness: Real
    mass: Real
    overlap: Real


def matrices(strip: Strip, functions: Functions) -> Matrices:
    """Return the matrices of a plate with patches."""
    plate = layer_of(strip.material, strip.thickness_m)
    bare, n = laminate([plate]), functions.n_plate
    blocks, size = [], n
    for one in functions.around:
        blocks.append(_Block(functions, one, size))
        size = blocks[-1].end
    stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
    own, held = alone(strip, functions)
    stiffness[:n, :n] = own
    mass[:n, :n] = bare.mass_kg_m2 * _overlap(functions)
    for block in blocks:
        block.add_plate(stiffness, mass, bare)
    mass[n:, :n] = mass[:n, n:].T
    overlap = mass / bare.mass_kg_m2
    for block, one in zip(blocks, functions.around, strict=True):
        block.add_patch(stiffness, mass, bare, laminate([plate, *one.patch.layers]))
    springs = None
    if isinstance(strip.edge, ElasticEdge):
        springs = np.zeros((size, size))
        springs[:n, :n] = held
        for block in blocks:
            block.add_springs(springs, strip.edge.stiffness_n)
        springs[n:, :n] = springs[:n, n:].T
        stiffness += springs
    for matrix in (stiffness, mass):
        matrix[n:, :n] = matrix[:n, n:].T
    return Matrices(springs=springs, stiffness=stiffness, mass=mass, overlap=overlap)


def alone(strip: Strip, functions: Functions) -> tuple[Real, Real | float]:
    """Return the stiffness of a plate without patches, and that of springs along its edges."""
    bare = laminate([layer_of(strip.material, strip.thickness_m)])
    along, across = functions.along, functions.across
    pairs = functions.pairs
    held: Real | float = 0.0
    if isinstance(strip.edge, ElasticEdge):
        slopes = across.values(np.array([-1.0, 1.0]), 1)
        springs = strip.edge.stiffness_n * along.products(*VALUE), slopes.T @ slopes
        held = _both([springs], pairs, pairs)
    terms = {orders: (along.products(*orders), across.products(*orders)) for orders in _ORDERS}
    if functions.wavenumbers_rad_m is None:
        terms[VALUE] = np.eye(len(along.series)), np.eye(len(across.series))  # but for rounding
    return _both(_bending(terms, bare), pairs, pairs), held


def _overlap(functions: Functions) -> Real:
    """Return the integrals of the plate's functions with each other; polynomials: orthonormal."""
    if functions.wavenumbers_rad_m is None:
        return np.eye(functions.n_plate)
    terms = [(functions.along.products(*VALUE), functions.across.products(*VALUE))]
    return _both(terms, functions.pairs, functions.pairs)


class _Block:
    """What belongs to one patch, whose functions have numbers from `first` on.

    What functions of the plate have with those of a patch is added above the diagonal only.
    """

    def __init__(self, functions: Functions, around: Around, first: int) -> None:
        self._functions, self._around = functions, around
        # the patch on the right stands for its image on the left as well
        self._fold = 2.0 if functions.odd[0] is not None and around.patch.x_m > 0 else 1.0
        box = slice(first, first + len(around.pairs[0]))
        self._rows = slice(0, functions.n_plate), box
        self._pairs = functions.pairs, around.pairs
        self.end = box.stop + around.n_disc

    def add_plate(self, stiffness: Real, mass: Real, bare: Laminate) -> None:
        """Add what the plate alone gives to the functions of the patch."""
        self._on_lines(stiffness, mass, bare, [(_PLATE, _BOX), (_BOX, _BOX)])
        if not self._around.patch.is_disc:
            return
        plate, box = self._rows
        own, n_other = slice(box.stop, self.end), plate.stop + box.stop - box.start
        for matrix, rows in zip((stiffness, mass), self._over_disc(bare), strict=True):
            part = rows.T @ rows[:, n_other:]
            matrix[plate, own] += part[: plate.stop]
            matrix[box, own] += part[plate.stop : n_other]
            matrix[own, box] += part[plate.stop : n_other].T
            matrix[own, own] += part[n_other:]

    def add_patch(self, stiffness: Real, mass: Real, bare: Laminate, whole: Laminate) -> None:
        """Add what the patch adds to all functions: it takes no stiffness or mass away."""
        added = Laminate(
            biaxial_n_m=max(whole.biaxial_n_m - bare.biaxial_n_m, 0.0),
            opposed_n_m=max(whole.opposed_n_m - bare.opposed_n_m, 0.0),
            mass_kg_m2=whole.mass_kg_m2 - bare.mass_kg_m2,
            reach_m=whole.reach_m,
        )
        if not self._around.patch.is_disc:
            pairs = [(_PLATE, _PLATE), (_PLATE, _BOX), (_BOX, _BOX)]
            self._on_lines(stiffness, mass, added, pairs, inside=True)
            return
        plate, box = self._rows
        mine = slice(box.start, self.end)
        for matrix, rows in zip((stiffness, mass), self._over_disc(added), strict=True):
            part = rows.T @ rows
            matrix[plate, plate] += part[: plate.stop, : plate.stop]
            matrix[plate, mine] += part[: plate.stop, plate.stop :]
            matrix[mine, mine] += part[plate.stop :, plate.stop :]

    def add_springs(self, springs: Real, held_n: float) -> None:
        """Add what springs along the edges hold of functions that turn there."""
        rings, width_m = self._around.rings[1], 2 * self._functions.across.half_m
        edges_m = [y_m for y_m, ring in zip((0.0, width_m), rings, strict=True) if ring.free]
        if not edges_m:
            return
        places_m, weights = self._around.line(0, self._n_nodes(0), inside=False)
        (along,) = self._factors(0, places_m, weights, (0,))
        (slopes,) = self._factors(1, np.array(edges_m), np.ones(len(edges_m)), (1,))
        for one in (_PLATE, _BOX):
            along_both = self._fold * held_n * along[one].T @ along[_BOX]
            terms = [(along_both, slopes[one].T @ slopes[_BOX])]
            found = self._both(terms, one, _BOX)
            springs[self._rows[one], self._rows[_BOX]] += found

    def _n_nodes(self, axis: int) -> int:
        """Return how many nodes along an axis an integral over the patch or a ring needs."""
        one = (self._functions.along, self._functions.across)[axis]
        part = min(self._around.reach_m(axis) / one.half_m, 1.0)
        n_degrees: int = one.series.shape[1]
        return _NODES + math.ceil(n_degrees * part)

    def _factors(
        self, axis: int, places_m: Real, weights: Real, orders: Sequence[int]
    ) -> list[tuple[Real, Real]]:
        """Return derivatives of the factors of the plate's functions and of those on the cells.

        Times roots of weights: what is summed of two is their integral.
        """
        root = np.sqrt(weights)[:, np.newaxis]
        series = (self._functions.along, self._functions.across)[axis]
        of_plate = series.jet(places_m / series.half_m - axis, orders)
        return [
            (root * one, root * other)
            for one, other in zip(
                of_plate, self._around.factors(axis, places_m, orders), strict=True
            )
        ]

    def _on_lines(
        self,
        stiffness: Real,
        mass: Real,
        stiff: Laminate,
        pairs: Sequence[tuple[int, int]],
        *,
        inside: bool = False,
    ) -> None:
        """Add integrals over the cells, or a rectangle, of functions that are products of two."""
        found = []
        for axis in (0, 1):
            line = self._around.line(axis, self._n_nodes(axis), inside=inside)
            found.append(self._factors(axis, *line, range(3)))
        along, across = found
        for one, other in pairs:
            terms = {
                (i, j): (along[i][one].T @ along[j][other], across[i][one].T @ across[j][other])
                for i, j in _ORDERS
            }
            rows, columns = self._rows[one], self._rows[other]
            bends = [(self._fold * x, y) for x, y in _bending(terms, stiff)]
            moves = [(self._fold * stiff.mass_kg_m2 * terms[VALUE][0], terms[VALUE][1])]
            stiffness[rows, columns] += self._both(bends, one, other)
            mass[rows, columns] += self._both(moves, one, other)

    def _both(self, terms: Sequence[tuple[Real, Real]], one: int, other: int) -> Real:
        return _both(terms, self._pairs[one], self._pairs[other])

    @cached_property
    def _on_disc(self) -> tuple[Real, Real]:
        """Sum and difference of curvatures, and twist, over a disc, and values: times weights."""
        around = self._around
        points_m, weights = around.area(max(self._n_nodes(0), self._n_nodes(1)))
        if around.odd[1] is not None:  # a product of two is the same in the other half
            upper = points_m[:, 1] > around.patch.y_m
            points_m, weights = points_m[upper], 2 * weights[upper]
        root = np.sqrt(self._fold * weights)[:, np.newaxis]
        every = (*BENDS, VALUE)
        parts = self._functions.plate(points_m, every), around.at(points_m, every)
        xx, yy, xy, value = (root * np.concatenate(one, axis=1) for one in zip(*parts, strict=True))
        return np.stack([xx + yy, xx - yy, 2 * xy]) / math.sqrt(2), value

    def _over_disc(self, stiff: Laminate) -> tuple[Real, Real]:
        """Return rows whose products are the integrals over a disc, of bending and of mass."""
        bends, value = self._on_disc
        stiffness_n_m = np.array([stiff.biaxial_n_m, stiff.opposed_n_m, stiff.opposed_n_m])
        rows = np.sqrt(stiffness_n_m)[:, np.newaxis, np.newaxis] * bends
        return rows.reshape(-1, rows.shape[2]), math.sqrt(stiff.mass_kg_m2) * value


def _bending(
    terms: dict[tuple[int, int], tuple[Real, Real]], stiff: Laminate
) -> list[tuple[Real, Real]]:
    """Return the terms of the bending energy, each a factor along and one across."""
    alike = (stiff.biaxial_n_m + stiff.opposed_n_m) / 2
    mixed = (stiff.biaxial_n_m - stiff.opposed_n_m) / 2
    weights = {(2, 2): alike, (0, 0): alike, (2, 0): mixed, (0, 2): mixed}
    bent = [(weight * terms[i, j][0], terms[2 - i, 2 - j][1]) for (i, j), weight in weights.items()]
    return [*bent, (2 * stiff.opposed_n_m * terms[1, 1][0], terms[1, 1][1])]


def _both(terms: Sequence[tuple[Real, Real]], one: Pairs, other: Pairs) -> Real:
    """Return sums of products of integrals along and across, for pairs of factors."""
    (n_along, m_along), (n_across, m_across) = (term.shape for term in terms[0])
    if n_along * n_across * m_along * m_across > _MANY * len(one[0]) * len(other[0]):
        along, across = (np.ix_(one[axis], other[axis]) for axis in (0, 1))
        found = terms[0][0][along] * terms[0][1][across]
        for term in terms[1:]:
            found += term[0][along] * term[1][across]
        return np.asarray(found)
    x, y = (np.stack([term[axis] for term in terms]) for axis in (0, 1))
    every = np.tensordot(x, y, axes=(0, 0)).transpose(0, 2, 1, 3)
    rows, columns = (
        pairs[0] * n + pairs[1] for pairs, n in zip((one, other), y.shape[1:], strict=True)
    )
    n_rows = x.shape[1] * y.shape[1]
    return np.asarray(every.reshape(n_rows, -1)[np.ix_(rows, columns)])
