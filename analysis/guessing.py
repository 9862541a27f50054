"""The guess rate: how often a stimulus that is not felt is still answered with its side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stimuli.checks import finite

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class GuessRate:
    """A guess rate that is known, or Beta distributed after blank trials.

    Attributes
    ----------
    mean : float
        The rate, or its mean.
    beta : tuple of float or None
        Both parameters of its Beta distribution; ``None`` where the rate is known.

    Raises
    ------
    ValueError
        If the rate is not from 0 to 0.9, or a parameter not above 0.

    Examples
    --------
    >>> GuessRate.after_blanks(answered=3, blanks=60).mean
    0.05737704918032787
    >>> at, weight = GuessRate.after_blanks(answered=3, blanks=60).nodes(5)
    >>> round(float(at @ weight), 12)
    0.05737704918
    """

    mean: float
    beta: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        finite("guess_rate", self.mean, least=0, most=0.9)
        for value in self.beta or ():
            finite("guess_rate.beta", value, above=0)

    @property
    def known(self) -> bool:
        """Whether it is a number rather than a distribution."""
        return self.beta is None

    @classmethod
    def after_blanks(cls, *, answered: float, blanks: int) -> GuessRate:
        """Return what blank trials tell, Beta(1/2 + answered, 1/2 + blanks - answered)."""
        a, b = 0.5 + answered, 0.5 + blanks - answered
        return cls(mean=a / (a + b), beta=(a, b))

    def nodes(self, points: int) -> tuple[Floats, Floats]:
        """Return points and weights that integrate over it, by Gauss and Jacobi.

        Parameters
        ----------
        points : int
            How many; a known rate is all of them.

        Returns
        -------
        at, weight : ndarray of float64, shape (points,)
            The weights sum to 1.
        """
        if self.beta is None:
            return np.full(points, self.mean), np.full(points, 1 / points)
        return _gauss_jacobi(*self.beta, points)


def _gauss_jacobi(a: float, b: float, points: int) -> tuple[Floats, Floats]:
    """Return points and weights by which Beta(a, b) is integrated over.

    From the recurrence of the Jacobi polynomials (G. H. Golub and J. H. Welsch, Math. Comp. 23
    (1969) 221-230), whose weights sum to 1 by themselves: no power of a large number is taken.
    """
    k = np.arange(1, points)
    s = 2.0 * k + a + b - 2
    middle = np.concatenate([[(a - b) / (a + b)], (a - b) * (a + b - 2) / (s * (s + 2))])
    first = np.where(k == 1, 1.0, (k + a + b - 2) / (s - 1))
    beside = np.sqrt(4 * k * (k + a - 1) * (k + b - 1) * first / (s * s * (s + 1)))
    at, vectors = np.linalg.eigh(np.diag(middle) + np.diag(beside, 1) + np.diag(beside, -1))
    return (at + 1) / 2, vectors[0] ** 2
