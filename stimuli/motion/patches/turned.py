"""Polynomials of a plate turned into its modes without patches, the fine ones of which follow."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Real


class Turn(NamedTuple):
    """Which combinations of functions the modes are, the slowest first.

    Attributes
    ----------
    kinds : tuple of ndarrays of int
        Numbers of functions that have something in common with each other only.
    vectors : tuple of ndarrays of float64
        Their combinations.
    order : ndarray of int
        Which one of all of these each mode is.
    squared : ndarray of float64
        Squares of the angular frequencies.
    """

    kinds: tuple[NDArray[np.intp], ...]
    vectors: tuple[Real, ...]
    order: NDArray[np.intp]
    squared: Real

    def rows(self, of_functions: Real) -> Real:
        """Return what is known of the functions, (..., n), of the modes."""
        both = zip(self.kinds, self.vectors, strict=True)
        parts = [of_functions[..., some] @ turned for some, turned in both]
        return np.asarray(np.concatenate(parts, axis=-1)[..., self.order])

    def both(self, matrices: Real) -> Real:
        """Return matrices of the functions, (n_kinds, n, n), of the modes."""
        return self.rows(np.swapaxes(self.rows(matrices), 1, 2))


def turned(alone: Real, kinds: Sequence[NDArray[np.intp]]) -> Turn:
    """Return the turn to the modes, of the stiffness over the mass."""
    found = [np.linalg.eigh(alone[some[:, np.newaxis], some]) for some in kinds]
    squared = np.concatenate([of_kind for of_kind, _ in found])
    order = np.argsort(squared, kind="stable")
    return Turn(tuple(kinds), tuple(vectors for _, vectors in found), order, squared[order])
