"""What is asked of the solver for one load, and what it gives back, in units of the width."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.transform import Source

    Complex = NDArray[np.complex128]
    Exact = NDArray[np.clongdouble]
    Real = NDArray[np.float64]

_LEAST_SPREAD: Final = 12.0
"""Decay per width of the last known wave against the first: 12.2 at the least, over all edges."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Task:
    """What is asked of one load, in units of the width.

    Attributes
    ----------
    exact_k : ndarray of complex, shape (n_frequencies,)
        Bending wavenumbers times the width, not small; long double counts near a cut-off.
    exact_hold : ndarray of complex, shape (n_frequencies,)
        1 / (kappa W): 0 for clamped, infinite for simply supported edges.
    source : Source
        The load.
    distance, across : ndarray of float64, shape (n_points,)
        |x| from the load's centre and Y of each point.
    rtol : float
        Wanted relative error.
    """

    exact_k: Exact | Complex
    exact_hold: Exact | Complex
    source: Source
    distance: Real
    across: Real
    rtol: float
    k: Complex = field(init=False)
    """Bending wavenumbers in double precision."""

    hold: Complex = field(init=False)
    """1 / (kappa W) in double precision."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "k", self.exact_k.astype(np.complex128))
        object.__setattr__(self, "hold", self.exact_hold.astype(np.complex128))

    def at(self, points: NDArray[np.bool_] | NDArray[np.intp]) -> Task:
        """Return the task for some of its points."""
        return replace(self, distance=self.distance[points], across=self.across[points])

    @property
    def clearance(self) -> Real:
        """Distance along the strip from the load's end, negative beside it."""
        return self.distance - self.source.half_length - self.source.radius

    @property
    def lossless(self) -> bool:
        """Whether the field is real but for propagating waves."""
        held = self.hold[np.isfinite(self.hold)]
        return not (np.any(self.k.imag) or np.any(held.imag))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """Values with an estimate of their error, both of shape (n_frequencies, n_points)."""

    value: Complex
    error: Real


def far_clearance(rtol: float) -> float:
    """Return the distance from a load in widths beyond which the guided waves are enough.

    Examples
    --------
    >>> round(far_clearance(1e-6), 2)
    1.48
    """
    return (math.log(1 / rtol) + 4) / _LEAST_SPREAD
