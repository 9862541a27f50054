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
    from stimuli.motion.basis import Polynomials
    from stimuli.motion.patches.around import Around
    from stimuli.motion.patches.functions import Functions
    from stimuli.strip.strip import Strip

    Pairs = tuple[NDArray[np.intp], NDArray[np.intp]]

_NODES: Final = 4
"""Nodes of an integral, beside the phase of the finest polynomial over half of it."""

_LEAST: Final = 15
"""At least so many over a disc: products of its own functions have up to 28 degrees."""

_MANY: Final = 4
"""Of so many times more pairs of factors than are asked for only those are summed."""

_PLATE, _BOX = 0, 1
"""Functions of the whole plate, and those on the cells about a patch."""

_ORDERS: Final = ((0, 0), (1, 1), (2, 2), (0, 2), (2, 0))
"""Derivatives of two functions along, and across, whose products count."""


STIFFNESS, MASS, SPRINGS = range(3)
"""Stiffness with that of springs along the edges, mass, and springs, if these have no loss: what is
kept of all pairs of functions, in this order."""


class OfPatch(NamedTuple):
    """Of the functions of one patch, which have nothing in common with those of another.

    `crossed` are those of the plate with them, (n_kinds, n_plate, n), `own` (n_kinds, n, n).
    """

    crossed: Real
    own: Real


class Matrices(NamedTuple):
    """Of the functions of the plate with each other, (n_kinds, n_plate, n_plate), and of patches'.

    >>> STIFFNESS, MASS, SPRINGS
    (0, 1, 2)
    """

    plate: Real
    patches: tuple[OfPatch, ...]
    alone: Real | None = None  # stiffness over mass without patches, of polynomials


def matrices(strip: Strip, functions: Functions) -> Matrices:
    """Return the matrices of a plate with patches."""
    layer = layer_of(strip.material, strip.thickness_m)
    plate, bare = _alone(strip, functions), laminate([layer])
    alone = None if functions.alike else plate[STIFFNESS] / bare.mass_kg_m2
    blocks = [_Block(functions, one, plate) for one in functions.around]
    for block, one in zip(blocks, functions.around, strict=True):
        block.add_plate(bare)
        if isinstance(strip.edge, ElasticEdge):
            block.add_springs(strip.edge.stiffness_n)
        block.add_patch(bare, laminate([layer, *one.patch.layers]))
    of_patches = tuple(OfPatch(block.crossed, block.own) for block in blocks)
    return Matrices(plate, of_patches, alone)


def _alone(strip: Strip, functions: Functions) -> Real:
    """Return the matrices of a plate without patches."""
    apart = isinstance(strip.edge, ElasticEdge) and strip.edge.lossless
    n = functions.n_plate
    if not functions.alike:
        return _of_kind(strip, functions.along, functions.across, functions.pairs, apart=apart)
    found = np.zeros((3 if apart else 2, n, n))
    for some in functions.alike:
        along, across = functions.along.part(some), functions.across.part(some)
        every = np.arange(some.size), np.arange(some.size)
        rows = some[:, np.newaxis]
        found[:, rows, some] = _of_kind(strip, along, across, every, apart=apart)
    return found


def _of_kind(
    strip: Strip, along: Polynomials, across: Polynomials, pairs: Pairs, *, apart: bool
) -> Real:
    """Return the matrices of some functions of a plate, with springs apart or not."""
    bare = laminate([layer_of(strip.material, strip.thickness_m)])
    terms = {orders: (along.products(*orders), across.products(*orders)) for orders in _ORDERS}
    found = [_both(_bending(terms, bare), pairs, pairs)]
    found.append(bare.mass_kg_m2 * _both([terms[VALUE]], pairs, pairs))
    if isinstance(strip.edge, ElasticEdge):
        slopes = across.values(np.array([-1.0, 1.0]), 1)
        held = strip.edge.stiffness_n * terms[VALUE][0], slopes.T @ slopes
        springs = _both([held], pairs, pairs)
        found[STIFFNESS] += springs
        if apart:
            found.append(springs)
    return np.stack(found)


class _Block:
    """What belongs to one patch: of its functions, and what it adds to those of the plate."""

    def __init__(self, functions: Functions, around: Around, plate: Real) -> None:
        self._functions, self._around, self._plate = functions, around, plate
        # the patch on the right stands for its image on the left as well
        self._fold = 2.0 if functions.odd[0] is not None and around.patch.x_m > 0 else 1.0
        self._pairs = functions.pairs, around.pairs
        self._n_box = len(around.pairs[0])
        n = self._n_box + around.n_disc
        self.crossed, self.own = (np.zeros((len(plate), rows, n)) for rows in (plate.shape[1], n))

    def add_plate(self, bare: Laminate) -> None:
        """Add what the plate alone gives to the functions of the patch."""
        self._on_lines(bare, [(_PLATE, _BOX), (_BOX, _BOX)])
        if self._around.patch.is_disc:
            n, n_box = self._plate.shape[1], self._n_box
            for kind, rows in zip((STIFFNESS, MASS), self._over_disc(bare), strict=True):
                part = rows.T @ rows[:, n + n_box :]
                self.crossed[kind, :, n_box:] += part[:n]
                self.own[kind, :n_box, n_box:] += part[n : n + n_box]
                self.own[kind, n_box:, :n_box] += part[n : n + n_box].T
                self.own[kind, n_box:, n_box:] += part[n + n_box :]

    def add_patch(self, bare: Laminate, whole: Laminate) -> None:
        """Add what the patch adds to all functions: it takes no stiffness or mass away."""
        added = Laminate(
            biaxial_n_m=max(whole.biaxial_n_m - bare.biaxial_n_m, 0.0),
            opposed_n_m=max(whole.opposed_n_m - bare.opposed_n_m, 0.0),
            mass_kg_m2=whole.mass_kg_m2 - bare.mass_kg_m2,
            reach_m=whole.reach_m,
        )
        if not self._around.patch.is_disc:
            pairs = [(_PLATE, _PLATE), (_PLATE, _BOX), (_BOX, _BOX)]
            self._on_lines(added, pairs, inside=True)
            return
        n = self._plate.shape[1]
        for kind, rows in zip((STIFFNESS, MASS), self._over_disc(added), strict=True):
            part = rows.T @ rows
            self._plate[kind] += part[:n, :n]
            self.crossed[kind] += part[:n, n:]
            self.own[kind] += part[n:, n:]

    def add_springs(self, held_n: float) -> None:
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
            for kind in (STIFFNESS, SPRINGS)[: len(self.own) - 1]:
                self._of(kind, one, _BOX)[...] += found

    def _of(self, kind: int, one: int, other: int) -> Real:
        """Return the place of one kind of functions with another."""
        if other == _PLATE:
            return np.asarray(self._plate[kind])
        matrix = self.crossed if one == _PLATE else self.own[:, : self._n_box]
        return np.asarray(matrix[kind, :, : self._n_box])

    def _n_nodes(self, axis: int, reach_m: float | None = None) -> int:
        """Return how many nodes along an axis an integral over half a patch or a ring needs."""
        one = (self._functions.along, self._functions.across)[axis]
        part = min((reach_m or self._around.reach_m(axis)) / one.half_m, 1.0)
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
        self, stiff: Laminate, pairs: Sequence[tuple[int, int]], *, inside: bool = False
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
            bends = [(self._fold * x, y) for x, y in _bending(terms, stiff)]
            moves = [(self._fold * stiff.mass_kg_m2 * terms[VALUE][0], terms[VALUE][1])]
            self._of(STIFFNESS, one, other)[...] += self._both(bends, one, other)
            self._of(MASS, one, other)[...] += self._both(moves, one, other)

    def _both(self, terms: Sequence[tuple[Real, Real]], one: int, other: int) -> Real:
        return _both(terms, self._pairs[one], self._pairs[other])

    @cached_property
    def _on_disc(self) -> tuple[Real, Real]:
        """Sum and difference of curvatures, and twist, over a disc, and values: times weights."""
        around = self._around
        radius_m = around.patch.half_size_m[0]
        n_nodes = max(_LEAST, *(self._n_nodes(axis, radius_m) for axis in (0, 1)))
        points_m, weights = around.area(n_nodes)
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
