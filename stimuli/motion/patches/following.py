"""Combinations of fine functions that slower ones move: few of them do what all do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from stimuli.motion.patches.matrices import MASS, STIFFNESS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Real

_STIFF: Final = 1e-12
"""Part of the stiffness of a function that all others must not have already."""

_HEAVY: Final = 1e-9
"""The same of its mass, as those of patches and of the plate are sought in together."""


class Following(NamedTuple):
    """Functions that follow others, at once but for a few combinations.

    Attributes
    ----------
    some : ndarray of int, shape (n_some,)
        Numbers of those that are independent of each other.
    root : ndarray of float64, shape (n_some, n_some)
        Cholesky's factor of their stiffness.
    pulled, carried : ndarrays of float64, shape (n_some, n_leading)
        Its inverse times the stiffness and the mass that they have with those that they follow.
    spanned : ndarray of float64, shape (n_some, n_kept)
        The root's transpose times the combinations: orthonormal.
    kept : ndarray of float64, shape (n, n_kept)
        The combinations.
    """

    some: NDArray[np.intp]
    root: Real
    pulled: Real
    carried: Real
    spanned: Real
    kept: Real

    def parts(self, of_functions: Real) -> tuple[Real, Real, Real]:
        """Return what works on functions in parts, whether values at points or works of loads.

        On the combinations, (n_rows, n_kept); on those that are followed, by all else that
        follows, (n_rows, n_leading); and on this itself, (n_rows, n_some), two of which give what
        one does to the other at rest.
        """
        from scipy.linalg import solve_triangular

        beside = solve_triangular(
            self.root, of_functions[:, self.some].T, lower=True, check_finite=False
        ).T
        kept = beside @ self.spanned
        beside = beside - kept @ self.spanned.T
        return kept, -beside @ self.pulled, beside

    def relieve(self, leading: Real, n: int) -> None:
        """Have the first ones of those that are followed move all else that follows at rest.

        That is little, so that its own inertia, which is of second order, is left out.
        """
        first = self.pulled[:, :n]
        beside = (first - self.spanned @ (self.spanned.T @ first)).T
        stiff, carried = beside @ self.pulled, beside @ self.carried
        leading[STIFFNESS, :n] -= stiff
        leading[STIFFNESS, n:, :n] -= stiff[:, n:].T
        leading[MASS, :n] -= carried
        leading[MASS, :, :n] -= carried.T


def following(own: Real, crossed: Real, leading: Real, highest: float, left: float) -> Following:
    """Return what of some functions follows others: what these move at rest, and by their inertia.

    Parameters
    ----------
    own : ndarray of float64, shape (n_kinds, n, n)
        Matrices of those that follow.
    crossed : ndarray of float64, shape (n_kinds, n_leading, n)
        And with those that they follow.
    leading : ndarray of float64, shape (n_kinds, n_leading, n_leading)
        And of these: the faster one is by itself, the less of it is in what swings slowly.
    highest : float
        Square of the highest angular frequency that is asked for.
    left : float
        Part of the energy that is given to them, of which no combination is kept.
    """
    from scipy.linalg import solve_triangular

    scale = 1 / np.sqrt(np.diag(own[STIFFNESS]))
    some, root = _spanning(scale[:, np.newaxis] * own[STIFFNESS] * scale, _STIFF)
    root = root[some] / scale[some, np.newaxis]
    pulls = np.concatenate([crossed[STIFFNESS], crossed[MASS]]).T[some]
    pulled = solve_triangular(root, pulls, lower=True, check_finite=False)
    stiffness, mass = (np.diagonal(leading[kind]) for kind in (STIFFNESS, MASS))
    weighed, n = pulled * np.tile(np.sqrt(mass) / stiffness, 2), stiffness.size
    weighed[:, n:] *= highest
    given = weighed @ weighed.T
    _, spanned = _spanning(given, left * np.trace(given))
    spanned, _ = np.linalg.qr(spanned)
    kept = np.zeros((len(scale), spanned.shape[1]))
    kept[some] = solve_triangular(root, spanned, lower=True, trans="T", check_finite=False)
    return Following(some, root, pulled[:, :n], pulled[:, n:], np.asarray(spanned), kept)


def independent(mass: Real) -> NDArray[np.intp]:
    """Return numbers of functions that others do not make up.

    >>> independent(np.array([[2.0, 0.0, 2.0], [0.0, 1.0, 0.0], [2.0, 0.0, 2.0]])).size
    2
    """
    scale = 1 / np.sqrt(np.diag(mass))
    some, _ = _spanning(scale[:, np.newaxis] * mass * scale, _HEAVY)
    return np.sort(some)


def bordered(first: Real, crossed: Real, last: Real) -> Real:
    """Return matrices of two groups of functions, of theirs and of what they have in common."""
    n = first.shape[1]
    size = n + last.shape[1]
    found = np.empty((len(first), size, size))
    found[:, :n, :n], found[:, :n, n:], found[:, n:, n:] = first, crossed, last
    found[:, n:, :n] = crossed.transpose(0, 2, 1)
    return found


def _spanning(matrix: Real, left: float) -> tuple[NDArray[np.intp], Real]:
    """Return numbers of rows, and columns whose products with themselves give a positive matrix.

    But for what is left on its diagonal. Those rows, in that order, are a lower triangle.
    """
    from scipy.linalg.lapack import dpstrf

    factor, order, rank, _ = dpstrf(matrix, tol=left, lower=1)
    columns = np.empty((len(matrix), rank))
    columns[order - 1] = np.tril(factor)[:, :rank]
    return order[:rank] - 1, columns
