"""Combinations of fine functions that slower ones move: few of them do what all do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from stimuli.motion.patches.matrices import MASS, STIFFNESS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Real

_LEFT: Final = 1e-11
"""Part of the energy that slower functions give to finer ones, and that is left out."""

_DEPENDENT: Final = 1e-12
"""Part of the stiffness of a function that all others must not have already."""


class Following(NamedTuple):
    """Functions that follow others, at once but for a few combinations.

    Attributes
    ----------
    some : ndarray of int, shape (n_some,)
        Numbers of those that are independent of each other.
    root : ndarray of float64, shape (n_some, n_some)
        Cholesky's factor of their stiffness.
    pulled : ndarray of float64, shape (n_some, n_leading)
        Its inverse times the stiffness that they have with those that they follow.
    spanned : ndarray of float64, shape (n_some, n_kept)
        The root's transpose times the combinations: orthonormal.
    kept : ndarray of float64, shape (n, n_kept)
        The combinations.
    """

    some: NDArray[np.intp]
    root: Real
    pulled: Real
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


def following(own: Real, crossed: Real, squared: Real, highest: float) -> Following:
    """Return what of some functions follows others: what these move at rest, and by their inertia.

    Parameters
    ----------
    own : ndarray of float64, shape (n_kinds, n, n)
        Matrices of those that follow.
    crossed : ndarray of float64, shape (n_kinds, n_leading, n)
        And with those that they follow.
    squared : ndarray of float64, shape (n_leading,)
        Squares of the angular frequencies of these, each by itself: the faster it is, the less of
        it is in what swings slowly.
    highest : float
        Square of the highest angular frequency that is asked for.
    """
    from scipy.linalg import solve_triangular

    scale = 1 / np.sqrt(np.diag(own[STIFFNESS]))
    some, root = _spanning(scale[:, np.newaxis] * own[STIFFNESS] * scale, _DEPENDENT)
    root = root[some] / scale[some, np.newaxis]
    pulls = np.concatenate([crossed[STIFFNESS], crossed[MASS]]).T[some]
    pulled = solve_triangular(root, pulls, lower=True, check_finite=False)
    n = squared.size
    weighed = pulled / np.tile(squared, 2)
    weighed[:, n:] *= highest
    given = weighed @ weighed.T
    _, spanned = _spanning(given, _LEFT * np.trace(given))
    spanned, _ = np.linalg.qr(spanned)
    kept = np.zeros((len(scale), spanned.shape[1]))
    kept[some] = solve_triangular(root, spanned, lower=True, trans="T", check_finite=False)
    return Following(some, root, pulled[:, :n], np.asarray(spanned), kept)


def _spanning(matrix: Real, left: float) -> tuple[NDArray[np.intp], Real]:
    """Return numbers of rows, and columns whose products with themselves give a positive matrix.

    But for what is left on its diagonal. Those rows, in that order, are a lower triangle.
    """
    from scipy.linalg.lapack import dpstrf

    factor, order, rank, _ = dpstrf(matrix, tol=left, lower=1)
    columns = np.empty((len(matrix), rank))
    columns[order - 1] = np.tril(factor)[:, :rank]
    return order[:rank] - 1, columns
