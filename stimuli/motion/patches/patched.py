"""Modes of a plate with patches bonded to it: by Ritz's method, with functions of their own."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.motion.patches.alone import in_waves
from stimuli.motion.patches.functions import Functions, functions_of, n_plate
from stimuli.motion.patches.matrices import Matrices, matrices
from stimuli.motion.standing_waves import wavenumber_rad_m

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.motion.patches.around import Sides
    from stimuli.strip.strip import Strip


_MOST_FUNCTIONS: Final = 1800
"""Functions of one symmetry, those of patches aside: some seconds."""

_LEAST: Final = 8.0
"""First cut-offs up to which the plate's polynomials hold waves at least."""

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
    plate, local : ndarrays of int
        Numbers of the functions that were taken, of the plate and of patches.
    kept : ndarray of float64, shape (n_local, n_kept)
        Combinations of the latter that are independent.
    series : ndarray of float64, shape (n_plate + n_kept, n_modes)
        The modes in those.
    factor : ndarray of float64, shape (n_plate + n_kept, n_plate + n_kept)
        Cholesky's, below the diagonal, of the plate's stiffness, springs included.
    """

    squared: Real
    bent: Real
    functions: Functions
    plate: NDArray[np.intp]
    local: NDArray[np.intp]
    kept: Real
    series: Real
    factor: Real

    def moved(self, at_functions: Real) -> Real:
        """Return the modes where the functions are known, or what works on them."""
        return np.asarray(self._taken(at_functions) @ self.series)

    def at_rest_m(self, at_points: Real, pushes: Real) -> Real:
        """Return what loads do at rest: (n_loads, n_points).

        Of the functions these are the values at the points, (n_points, n_functions), and the works
        of the loads, (n_loads, n_functions).
        """
        from scipy.linalg import cho_solve

        pushed = self._taken(pushes).T
        swung = cho_solve((self.factor, True), pushed, check_finite=False)
        return np.asarray((self._taken(at_points) @ swung).T)

    def _taken(self, of_functions: Real) -> Real:
        local = of_functions[..., self.local] @ self.kept
        return np.concatenate([of_functions[..., self.plate], local], axis=-1)


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
        once, and fewer of them taken for fewer modes, of the patches' too.
    """
    groups = tuple(_symmetries(strip, centred=centred))
    return _patched_modes(strip, highest_hz, groups, max(within_hz or 0.0, highest_hz))


@lru_cache(maxsize=4)
def _patched_modes(
    strip: Strip, highest_hz: float, groups: tuple[Sides, ...], within_hz: float
) -> tuple[PatchedModes, ...]:
    built = [_built(strip, within_hz, odd) for odd in groups]
    fewer_rad_m = wavenumber_rad_m(strip, highest_hz) if highest_hz < within_hz else None
    return tuple(_modes(*one, highest_hz, fewer_rad_m) for one in built)


def has_room(strip: Strip, highest_hz: float) -> bool:
    """Tell whether the modes of each symmetry can be sought in as many functions as they need."""
    groups = len(_symmetries(strip, centred=False))
    return n_plate(strip, wavenumber_rad_m(strip, highest_hz)) <= groups * _MOST_FUNCTIONS


def _symmetries(strip: Strip, *, centred: bool) -> list[Sides]:
    """Return the groups of modes, odd or even or both along and across."""
    patches = set(strip.patches)
    mirrored = {dataclasses.replace(patch, x_m=-patch.x_m) for patch in patches} == patches
    in_the_middle = all(patch.y_m == strip.width_m / 2 for patch in patches)
    along = (False, True) if mirrored else (None,)
    across: tuple[bool | None, ...] = (None,)
    if in_the_middle:
        across = (False,) if centred else (False, True)
    return list(product(along, across))


@lru_cache(maxsize=8)
def _built(strip: Strip, highest_hz: float, odd: Sides) -> tuple[Functions, Matrices]:
    least_hz = _LEAST * strip.cutoff_hz()
    functions = functions_of(strip, wavenumber_rad_m(strip, max(highest_hz, least_hz)), odd)
    functions = in_waves(strip, functions, highest_hz)
    return functions, matrices(strip, functions)


def _modes(
    functions: Functions, of_all: Matrices, highest_hz: float, fewer_rad_m: float | None
) -> PatchedModes:
    """Return the modes of one symmetry up to a frequency, in all functions or in fewer."""
    from scipy.linalg import cholesky, eigh

    plate, local = np.split(np.arange(len(of_all.mass)), [functions.n_plate])
    if fewer_rad_m is not None:
        plate, local = functions.fewer(fewer_rad_m)
        of_all = _some(of_all, plate, local)
    kept = _independent(of_all.overlap, plate.size)
    stiffness, mass = (_kept(one, plate.size, kept) for one in (of_all.stiffness, of_all.mass))
    factor = cholesky(stiffness, lower=True, check_finite=False)
    squared, vectors = eigh(
        stiffness.T,  # as LAPACK has its columns
        mass.T,
        subset_by_value=(-math.inf, (2 * math.pi * highest_hz) ** 2),
        overwrite_a=True,
        overwrite_b=True,
        check_finite=False,
    )
    bent = np.diag(squared)
    if of_all.springs is not None:
        bent -= vectors.T @ _kept(of_all.springs, plate.size, kept) @ vectors
    return PatchedModes(
        squared=squared,
        bent=bent,
        functions=functions,
        plate=plate,
        local=local,
        kept=kept,
        series=vectors,
        factor=factor,
    )


def _some(of_all: Matrices, plate: NDArray[np.intp], local: NDArray[np.intp]) -> Matrices:
    """Return the matrices of some functions."""
    every = np.append(plate, local)
    both = np.ix_(every, every)
    return Matrices(
        springs=None if of_all.springs is None else of_all.springs[both],
        stiffness=of_all.stiffness[both],
        mass=of_all.mass[both],
        overlap=of_all.overlap[both],
    )


def _independent(overlap: Real, n_plate: int) -> Real:
    """Return combinations of functions of patches without those that the plate's nearly are."""
    from scipy.linalg import cholesky, solve_triangular

    crossed, own = overlap[:n_plate, n_plate:], overlap[n_plate:, n_plate:]
    root = cholesky(overlap[:n_plate, :n_plate], lower=True, check_finite=False)
    crossed = solve_triangular(root, crossed, lower=True, check_finite=False)
    scale = 1 / np.sqrt(np.diag(own))
    share, vectors = np.linalg.eigh(scale[:, np.newaxis] * (own - crossed.T @ crossed) * scale)
    kept = share > _DEPENDENT
    return np.asarray(scale[:, np.newaxis] * vectors[:, kept] / np.sqrt(share[kept]))


def _kept(matrix: Real, n_plate: int, kept: Real) -> Real:
    """Return a matrix of all functions as one of the plate's and the combinations kept."""
    size = n_plate + kept.shape[1]
    found = np.empty((size, size))
    found[:n_plate, :n_plate] = matrix[:n_plate, :n_plate]
    found[:n_plate, n_plate:] = matrix[:n_plate, n_plate:] @ kept
    found[n_plate:, :n_plate] = found[:n_plate, n_plate:].T
    found[n_plate:, n_plate:] = kept.T @ matrix[n_plate:, n_plate:] @ kept
    return found
