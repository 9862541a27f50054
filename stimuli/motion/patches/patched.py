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
from stimuli.motion.patches.following import Following, bordered, following, independent
from stimuli.motion.patches.functions import Functions, functions_of, n_plate
from stimuli.motion.patches.matrices import (
    MASS,
    SPRINGS,
    STIFFNESS,
    Matrices,
    OfPatch,
    matrices,
)
from stimuli.motion.patches.turned import Turn, turned
from stimuli.motion.standing_waves import wavenumber_rad_m

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.motion.patches.around import Sides
    from stimuli.strip.strip import Strip


_MOST_FUNCTIONS: Final = 1800
"""Functions of one symmetry, those of patches aside: some seconds."""

_OF_POLYNOMIALS, _OF_WAVES, _OF_MODES = (1e-11, 0.0), (1e-9, 1e-6), (1e-9, 1e-7)
"""Part of the energy that slower functions give to those of patches, and to finer ones of the
plate, that is left to follow at rest, by what those of the plate are.

With 1e-5 of waves levels of -40 dB differed by 0.004 dB, with 1e-4 of -50 by 1 dB; with 1e-9 beside
polynomials one of -17 dB by 0.002; with 1e-6 of modes an own finger by 2e-4.
"""

_MANY: Final = 150
"""So many polynomials of several symmetries take longer to turn into modes than is saved."""

_LEAST: Final = 8.0
"""First cut-offs up to which the plate's polynomials hold waves at least."""


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
    patches : tuple of Following
        Which combinations of those are enough, for each patch.
    turn : Turn or None
        If many polynomials were taken, to modes of the plate alone instead.
    n_slow : int
        How many of the plate's functions do not follow others, the first ones.
    fine : Following or None
        What follows these and the patches' combinations.
    chosen : ndarray of int
        Numbers of those, of the patches' and of the fine ones' combinations, that are independent.
    series : ndarray of float64, shape (n_chosen, n_modes)
        The modes in those.
    factor : ndarray of float64, shape (n_chosen, n_chosen)
        Cholesky's, below the diagonal, of the plate's stiffness, springs included.
    """

    squared: Real
    bent: Real
    functions: Functions
    plate: NDArray[np.intp]
    local: tuple[NDArray[np.intp], ...]
    patches: tuple[Following, ...]
    turn: Turn | None
    n_slow: int
    fine: Following | None
    chosen: NDArray[np.intp]
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
        both = zip(self.local, self.patches, strict=True)
        parts = [one.parts(of_functions[:, some]) for some, one in both]
        kept, led, beside = (list(some) for some in zip(*parts, strict=True))
        plate = of_functions[:, self.plate]
        plate = (plate if self.turn is None else self.turn.rows(plate)) + np.sum(led, axis=0)
        taken = np.concatenate([plate[:, : self.n_slow], *kept], axis=1)
        if self.fine is not None:
            fine, pulled, more = self.fine.parts(plate[:, self.n_slow :])
            taken = np.concatenate([taken + pulled, fine], axis=1)
            beside.append(more)
        return taken[:, self.chosen], np.concatenate(beside, axis=1)


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
    of_all, turn = _turned(functions, of_all, plate)
    n_slow, left = min(functions.slower(most_rad_m), plate.size), _OF_WAVES
    if turn is not None:
        n_slow, left = int(np.searchsorted(turn.squared, highest, side="right")), _OF_MODES
    elif functions.wavenumbers_rad_m is None:
        left = _OF_POLYNOMIALS
    patches, fine, every = _led(of_all, n_slow, highest, left)
    chosen = independent(every[MASS])
    if chosen.size < len(every[MASS]):
        every = every[:, chosen[:, np.newaxis], chosen]
    squared, bent, series = _swinging(every, highest)
    return PatchedModes(
        squared=squared,
        bent=bent,
        functions=functions,
        plate=plate,
        local=tuple(start + some for start, some in zip(first[:-1], local, strict=True)),
        patches=tuple(patches),
        turn=turn,
        n_slow=n_slow,
        fine=fine,
        chosen=chosen,
        series=series,
        factor=cholesky(every[STIFFNESS], lower=True, check_finite=False),
    )


def _swinging(every: Real, highest: float) -> tuple[Real, Real, Real]:
    """Return squares of angular frequencies up to one, what is bent of them, and modes."""
    from scipy.linalg import eigh

    # divide and conquer finds all of them sooner than other ways some
    squared, vectors = eigh(every[STIFFNESS], every[MASS], driver="gvd", check_finite=False)
    n_modes = int(np.searchsorted(squared, highest, side="right"))
    squared, vectors = squared[:n_modes], vectors[:, :n_modes]
    if len(every) <= SPRINGS:
        return squared, squared, vectors
    return squared, np.diag(squared) - vectors.T @ every[SPRINGS] @ vectors, vectors


def _some(of_all: Matrices, plate: NDArray[np.intp], local: Sequence[NDArray[np.intp]]) -> Matrices:
    """Return the matrices of some functions."""
    rows: NDArray[np.intp] | slice = plate
    if np.array_equal(plate, np.arange(plate.size)):
        rows = slice(plate.size)  # no copy
    return Matrices(
        of_all.plate[:, rows][:, :, rows],
        tuple(
            OfPatch(one.crossed[:, rows][:, :, some], one.own[:, some[:, np.newaxis], some])
            for one, some in zip(of_all.patches, local, strict=True)
        ),
        None if of_all.alone is None else of_all.alone[:, rows][rows],
    )


def _turned(
    functions: Functions, of_all: Matrices, plate: NDArray[np.intp]
) -> tuple[Matrices, Turn | None]:
    """Return the matrices of the plate's modes instead of its polynomials, if these are many."""
    if of_all.alone is None or plate.size < _MANY:
        return of_all, None
    kinds = functions.kinds(plate)
    if len(kinds) == 1:
        return of_all, None
    turn = turned(of_all.alone, kinds)
    patches = tuple(
        one._replace(crossed=np.swapaxes(turn.rows(np.swapaxes(one.crossed, 1, 2)), 1, 2))
        for one in of_all.patches
    )
    return Matrices(turn.both(of_all.plate), patches), turn


def _led(
    of_all: Matrices, n_slow: int, highest: float, left: tuple[float, float]
) -> tuple[list[Following], Following | None, Real]:
    """Return what follows of the patches' functions and of the plate's, and what is left.

    That are the matrices of those of the plate that follow none and of the combinations kept.
    """
    from scipy.linalg import block_diag

    plate = of_all.plate
    patches = [following(one.own, one.crossed, plate, highest, left[0]) for one in of_all.patches]
    both = list(zip(of_all.patches, patches, strict=True))
    crossed = np.concatenate([of.crossed @ one.kept for of, one in both], axis=2)
    blocks = [one.kept.T @ of.own @ one.kept for of, one in both]
    own = np.stack([block_diag(*kind) for kind in zip(*blocks, strict=True)])
    slow = bordered(plate[:, :n_slow, :n_slow], crossed[:, :n_slow], own)
    if n_slow == plate.shape[1]:
        return patches, None, slow
    quick = plate[:, n_slow:, n_slow:]
    pulls = np.concatenate(
        [plate[:, :n_slow, n_slow:], crossed[:, n_slow:].transpose(0, 2, 1)], axis=1
    )
    fine = following(quick, pulls, slow, highest, left[1])
    fine.relieve(slow, n_slow)
    own = fine.kept.T @ quick @ fine.kept
    return patches, fine, bordered(slow, pulls @ fine.kept, own)
