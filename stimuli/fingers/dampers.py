"""The poles of a plate with loss on a few dampers: a low rank beside what its modes lose alone."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from stimuli.motion.oscillators import poles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real


_FREE: Final = 1e-14
"""A mode that dampers take so small a part of its frequency from is left alone by them."""

_SETTLED: Final = 1e-12
_TURNS, _MORE_TURNS = 12, 40
"""What has not settled after some turns may not swing: two poles then, which are no images."""

_ASIDE: Final = 1e-3
"""How far from where their images are those are begun with, as a part."""

_REAL: Final = 1e-9

_LOST: Final = 1e-8
"""Part of all damping that may be missing from the sum of the poles: else one was found twice."""


class Dampers(NamedTuple):
    """Loss in proportion to stiffness, tau K, and some dampers C beside it: tau K + G' C G."""

    viscous_s: float
    grips: Real  # how modes move the dampers, G: (n_dampers, n_modes)
    values: Real  # of either sign, as they take the place of what springs would lose


def turned(
    bare: Real | Dampers, beside: Real, turn: Real, dampers: Real, by_springs: Real
) -> Real | Dampers:
    """Return the loss of a plate's modes and of masses on springs and dampers, in other modes.

    `turn` has these in its columns, its last rows are the masses. `beside` is what else bends
    loses, `by_springs` what the masses' springs would lose in proportion to their stiffness.
    """
    n = len(dampers)
    if isinstance(bare, Dampers):
        return Dampers(bare.viscous_s, turn[-n:], dampers - by_springs)
    lost = beside + np.pad(bare, [(0, n), (0, n)])
    lost[-n:, -n:] += np.diag(dampers)
    return np.asarray(turn.T @ lost @ turn)


def coupled_poles(squared: Real, damping: Real | Dampers) -> tuple[Complex, Complex, Complex]:
    """Return poles, modes and drives of modes with a matrix of their loss, or with dampers."""
    if not isinstance(damping, Dampers):
        return poles(squared, damping, 1.0)
    found = damped_poles(squared, *damping)
    if found is None:
        coupled = damping.grips.T * damping.values @ damping.grips
        return poles(squared, damping.viscous_s * np.diag(squared) + coupled, 1.0)
    return found


def damped_poles(
    squared: Real, viscous_s: float, grips: Real, dampers: Real
) -> tuple[Complex, Complex, Complex] | None:
    """Return what `oscillators.poles` does, where few dampers couple modes, equation (91).

    The modes' amplitudes obey q'' + (tau K + G' C G) q' + K q = f with diagonal K and C. The poles
    s are the zeros of det[1 + s G (s^2 + tau K s + K)^-1 G' C], a matrix of as many rows as there
    are dampers. They are sought all at once (Aberth), a turn for each in as many operations as
    there are modes. None is returned where they do not settle or some are missing.

    Parameters
    ----------
    squared : ndarray of float64, shape (n_modes,)
        Squares of the angular frequencies, K.
    viscous_s : float
        Relaxation time tau.
    grips : ndarray of float64, shape (n_dampers, n_modes)
        How the modes move the dampers, G.
    dampers : ndarray of float64, shape (n_dampers,)
        C, of either sign.

    Examples
    --------
    The sum of all poles is what is lost:

    >>> grips = np.array([[0.3, 0.5, 0.2]])
    >>> found, *_ = damped_poles(np.array([1.0, 4.0, 9.0]), 0.01, grips, np.ones(1))
    >>> bool(np.isclose(2 * found.real.sum(), -0.01 * 14 - (grips**2).sum()))
    True
    """
    taken = np.abs(dampers) @ grips**2
    tied = taken > _FREE * np.sqrt(squared)
    parts = [(np.flatnonzero(~tied), *_alone(squared[~tied], viscous_s * squared[~tied]))]
    if np.any(tied):
        some = _tied(squared[tied], viscous_s, grips[:, tied], dampers)
        if some is None:
            return None
        parts.append((np.flatnonzero(tied), *some))
    found = np.concatenate([part[1] for part in parts])
    modes = np.zeros((squared.size, found.size), dtype=np.complex128)
    drives, first = np.zeros((found.size, squared.size), dtype=np.complex128), 0
    for rows, own, its_modes, its_drives in parts:
        columns = np.arange(first, first + own.size)
        modes[np.ix_(rows, columns)], drives[np.ix_(columns, rows)] = its_modes, its_drives
        first += own.size
    return found, modes, drives


def _pairs(squared: Real, damping: Real) -> tuple[Complex, Complex]:
    """Return both zeros of s^2 + damping s + squared, without cancellation."""
    half = damping / 2
    one = -half - np.sqrt(np.asarray(half**2 - squared, dtype=np.complex128))
    return np.asarray(squared / one, dtype=np.complex128), np.asarray(one, dtype=np.complex128)


def _alone(squared: Real, damping: Real) -> tuple[Complex, Complex, Complex]:
    """Return poles, modes and drives of what no damper takes anything from."""
    upper, lower = _pairs(squared, damping)
    creeping = np.flatnonzero(upper.imag == 0)
    one = np.eye(squared.size, dtype=np.complex128)
    swings = np.where(upper.imag == 0, 1, 2) / (upper - lower)
    back = 1 / (lower - upper)[creeping]
    return (
        np.append(upper, lower[creeping]),
        np.concatenate([one, one[:, creeping]], axis=1),
        np.concatenate([np.diag(swings), back[:, np.newaxis] * one[creeping]]),
    )


def _tied(
    squared: Real, viscous_s: float, grips: Real, dampers: Real
) -> tuple[Complex, Complex, Complex] | None:
    """Return poles, modes and drives of what dampers couple, if all are found."""
    lost, own = viscous_s * squared, np.asarray(dampers @ grips**2)
    bare = np.stack(_pairs(squared, lost))
    found = _zeros(bare, _pairs(squared, lost + own), _coupling(grips, dampers))
    if found is None:
        return None
    times = np.where(found.imag > 0, 2.0, 1.0)
    missing = lost.sum() + own.sum() + (times * found.real).sum()
    if not abs(missing) <= _LOST * np.abs(found).sum():
        return None
    shapes, norms = _shapes(found, bare, grips, dampers, lost)
    return found, shapes, (shapes * (times / norms)).T


def _coupling(grips: Real, dampers: Real) -> Real:
    """Return what each mode adds to G M^-1 G' C: (n_modes, n_dampers * n_dampers)."""
    n = len(dampers)
    both = (grips[:, np.newaxis] * grips * dampers[:, np.newaxis]).reshape(n * n, -1)
    return np.asarray(both.T)


def _zeros(bare: Complex, start: tuple[Complex, Complex], coupling: Real) -> Complex | None:
    """Return the zeros, of each two that are images of each other the upper one."""
    upper, lower = start
    pair = upper.imag > 0
    paired, moving = _settled(bare, upper[pair], np.zeros(0, dtype=np.complex128), coupling, _TURNS)
    if paired is None:
        return None
    stray = paired[moving]
    paired = np.delete(paired, moving)
    alone = np.concatenate([upper[~pair], stray, lower[~pair], stray.conj()])
    alone[: alone.size // 2] *= 1 + _ASIDE * 1j
    found, moving = _settled(bare, paired, alone, coupling, _MORE_TURNS)
    if found is None or moving.size:
        return None
    paired, alone = found[: paired.size], found[paired.size :]
    real = np.abs(alone.imag) <= _REAL * np.abs(alone)
    above, below = (np.sum(sign * alone[~real].imag > 0) for sign in (1, -1))
    if above != below or np.any(paired.imag <= 0):
        return None
    upper = np.where(real, alone.real, alone)[real | (alone.imag > 0)]
    return np.append(paired, upper)


def _settled(
    bare: Complex, paired: Complex, alone: Complex, coupling: Real, turns: int
) -> tuple[Complex | None, NDArray[np.intp]]:
    """Return zeros after some turns, and which have not settled; the first have images."""
    found, n = np.append(paired, alone), math.isqrt(coupling.shape[1])
    moving, middle = np.arange(found.size), bare.sum(axis=0)
    for _ in range(turns):
        if not moving.size:
            break
        s = found[moving, np.newaxis]
        product = (s - bare[0]) * (s - bare[1])
        if not np.all(product):
            return None, moving
        inverse, slope = 1 / product, 2 * s - middle
        shared, bent = inverse @ coupling, (inverse * inverse * slope) @ coupling
        matrix = np.eye(n) + (s * shared).reshape(-1, n, n)
        turned = np.linalg.solve(matrix, (shared - s * bent).reshape(-1, n, n))
        growth = np.einsum("jii->j", turned) + (inverse * slope).sum(axis=1)
        apart = s - found
        apart[np.arange(moving.size), moving] = np.inf
        images = s - found[: paired.size].conj()
        step = 1 / (growth - (1 / apart).sum(axis=1) - (1 / images).sum(axis=1))
        if not np.all(np.isfinite(step)):
            return None, moving
        found[moving] -= step
        moving = moving[np.abs(step) > _SETTLED * np.abs(found[moving])]
    return found, moving


def _shapes(
    found: Complex, bare: Complex, grips: Real, dampers: Real, lost: Real
) -> tuple[Complex, Complex]:
    """Return the modes x at poles, (n_modes, n_poles), and x' (2 s + tau K + G' C G) x of each."""
    s, n = found[:, np.newaxis], len(dampers)
    inverse = 1 / ((s - bare[0]) * (s - bare[1]))
    matrix = np.eye(n) + (s * (inverse @ _coupling(grips, dampers))).reshape(-1, n, n)
    held = np.linalg.svd(matrix)[2][:, -1].conj()
    shapes = -s * inverse * ((held * dampers) @ grips)
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    gripped = shapes @ grips.T
    norms = (shapes**2 * (2 * s + lost)).sum(axis=1) + (gripped**2 * dampers).sum(axis=1)
    return shapes.T, norms
