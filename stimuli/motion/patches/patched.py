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
from stimuli.motion.patches.following import Following, following
from stimuli.motion.patches.functions import Functions, functions_of, n_plate
from stimuli.motion.patches.matrices import (
    MASS,
    OVERLAP,
    SPRINGS,
    STIFFNESS,
    Matrices,
    OfPatch,
    matrices,
)
from stimuli.motion.standing_waves import wavenumber_rad_m

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    plate : ndarray of int
        Numbers of the functions of the plate that were taken.
    local : tuple of ndarrays of int
        The same of each patch, among all functions.
    following : tuple of Following
        Which combinations of those are enough, for each patch.
    kept : ndarray of float64, shape (n_local, n_kept)
        Combinations of these that the functions of the plate are not already.
    series : ndarray of float64, shape (n_plate + n_kept, n_modes)
        The modes in those.
    factor : ndarray of float64, shape (n_plate + n_kept, n_plate + n_kept)
        Cholesky's, below the diagonal, of the plate's stiffness, springs included.
    """

    squared: Real
    bent: Real
    functions: Functions
    plate: NDArray[np.intp]
    local: tuple[NDArray[np.intp], ...]
    following: tuple[Following, ...]
    kept: Real
    series: Real
    factor: Real

    def answers(self, at_points: Real, pushes: Real) -> tuple[Real, Real, Real]:
        """Return the modes at points and under loads, and what the loads do at rest.

        Of the functions these are the values at the points, (n_points, n_functions), and the works
        of the loads, (n_loads, n_functions); returned are (n_points, n_modes), (n_loads, n_modes)
        and (n_loads, n_points).
        """
        from scipy.linalg import cho_solve

        moved, beside = self._taken(at_points)
        pushed, pushed_beside = self._taken(pushes)
        rest = cho_solve((self.factor, True), pushed.T, check_finite=False).T @ moved.T
        rest += pushed_beside @ beside.T
        return moved @ self.series, pushed @ self.series, np.asarray(rest)

    def _taken(self, of_functions: Real) -> tuple[Real, Real]:
        """Return what works on the functions of the modes, and on those that are not kept."""
        parts = [
            one.parts(of_functions[:, some])
            for some, one in zip(self.local, self.following, strict=True)
        ]
        kept, led, beside = zip(*parts, strict=True)
        plate = of_functions[:, self.plate] + np.sum(led, axis=0)
        local = np.concatenate(kept, axis=1) @ self.kept
        return np.concatenate([plate, local], axis=1), np.concatenate(beside, axis=1)


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
    most_rad_m = wavenumber_rad_m(strip, highest_hz)
    fewer = highest_hz < within_hz
    return tuple(_modes(*one, highest_hz, most_rad_m, fewer=fewer) for one in built)


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
    functions: Functions, of_all: Matrices, highest_hz: float, most_rad_m: float, *, fewer: bool
) -> PatchedModes:
    """Return the modes of one symmetry up to a frequency, in all functions or in fewer."""
    from scipy.linalg import cholesky

    highest = (2 * math.pi * highest_hz) ** 2
    plate = np.arange(functions.n_plate)
    local = [np.arange(len(one.own[0])) for one in of_all.patches]
    first = functions.n_plate + np.cumsum([0, *map(len, local)])
    if fewer:
        plate, local = functions.fewer(most_rad_m)
        of_all = _some(of_all, plate, local)
    swings = np.diagonal(of_all.plate, axis1=1, axis2=2)
    squared = swings[STIFFNESS] / swings[MASS]
    led = [following(one.own, one.crossed, squared, highest) for one in of_all.patches]
    every, kept = _together(of_all, led)
    fine = np.zeros(every.shape[1], dtype=bool)
    if functions.wavenumbers_rad_m is not None:
        fine[: plate.size] = functions.wavenumbers_rad_m[plate] > most_rad_m
    squared, bent, series = _swinging(every, fine, highest)
    return PatchedModes(
        squared=squared,
        bent=bent,
        functions=functions,
        plate=plate,
        local=tuple(start + some for start, some in zip(first[:-1], local, strict=True)),
        following=tuple(led),
        kept=kept,
        series=series,
        factor=cholesky(every[STIFFNESS], lower=True, check_finite=False),
    )


def _swinging(every: Real, fine: NDArray[np.bool_], highest: float) -> tuple[Real, Real, Real]:
    """Return squares of frequencies, what is bent of them, and modes in all functions.

    What is fine follows the rest.
    """
    from scipy.linalg import eigh

    if np.any(fine):
        swung, led = np.flatnonzero(~fine), np.flatnonzero(fine)
        n = swung.size
        slow, crossed, own = (
            every[:, rows[:, np.newaxis], columns]
            for rows, columns in ((swung, swung), (swung, led), (led, led))
        )
        swings = np.diagonal(slow, axis1=1, axis2=2)
        one = following(own, crossed, swings[STIFFNESS] / swings[MASS], highest)
        small = np.empty((len(every), *2 * (n + one.kept.shape[1],)))
        small[:, :n, :n], small[:, :n, n:] = slow, crossed @ one.kept
        small[:, n:, :n] = small[:, :n, n:].transpose(0, 2, 1)
        small[:, n:, n:] = one.kept.T @ own @ one.kept
    else:
        small = every
    # divide and conquer finds all of them sooner than other ways some
    squared, vectors = eigh(small[STIFFNESS], small[MASS], driver="gvd", check_finite=False)
    n_modes = int(np.searchsorted(squared, highest, side="right"))
    squared, vectors = squared[:n_modes], vectors[:, :n_modes]
    bent = np.diag(squared)
    if len(small) > SPRINGS:
        bent -= vectors.T @ small[SPRINGS] @ vectors
    series = vectors
    if np.any(fine):
        series = np.empty((fine.size, n_modes))
        series[swung], series[led] = vectors[:n], one.kept @ vectors[n:]
    return squared, bent, series


def _some(of_all: Matrices, plate: NDArray[np.intp], local: Sequence[NDArray[np.intp]]) -> Matrices:
    """Return the matrices of some functions."""
    return Matrices(
        of_all.plate[:, plate[:, np.newaxis], plate],
        tuple(
            OfPatch(
                one.crossed[:, plate[:, np.newaxis], some], one.own[:, some[:, np.newaxis], some]
            )
            for one, some in zip(of_all.patches, local, strict=True)
        ),
    )


def _together(of_all: Matrices, led: Sequence[Following]) -> tuple[Real, Real]:
    """Return the matrices of the plate's functions and of what is kept of the patches'.

    And of which combinations of those they are: they are independent of the plate's.
    """
    from scipy.linalg import block_diag

    both = list(zip(of_all.patches, led, strict=True))
    crossed = np.concatenate([of.crossed @ one.kept for of, one in both], axis=2)
    blocks = [one.kept.T @ of.own @ one.kept for of, one in both]
    own = np.stack([block_diag(*kind) for kind in zip(*blocks, strict=True)])
    kept = _independent(of_all.plate[OVERLAP], crossed[OVERLAP], own[OVERLAP])
    n_plate, size = crossed.shape[1], crossed.shape[1] + kept.shape[1]
    every = np.empty((len(own), size, size))
    every[:, :n_plate, :n_plate], every[:, :n_plate, n_plate:] = of_all.plate, crossed @ kept
    every[:, n_plate:, :n_plate] = every[:, :n_plate, n_plate:].transpose(0, 2, 1)
    every[:, n_plate:, n_plate:] = kept.T @ own @ kept
    return every, kept


def _independent(plate: Real, crossed: Real, own: Real) -> Real:
    """Return combinations of functions of patches without those that the plate's nearly are."""
    from scipy.linalg import cholesky, solve_triangular

    root = cholesky(plate, lower=True, check_finite=False)
    crossed = solve_triangular(root, crossed, lower=True, check_finite=False)
    scale = 1 / np.sqrt(np.diag(own))
    share, vectors = np.linalg.eigh(scale[:, np.newaxis] * (own - crossed.T @ crossed) * scale)
    kept = share > _DEPENDENT
    return np.asarray(scale[:, np.newaxis] * vectors[:, kept] / np.sqrt(share[kept]))
