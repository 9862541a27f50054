"""The poles of a plate with loss on a few ties: a low rank beside what its modes do alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from stimuli.motion.oscillators import swung

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real


_FREE: Final = 1e-14
"""A mode that dampers take so small a part of its frequency from is left alone by them."""

_SETTLED: Final = 1e-9
"""A step of a smaller part is the last: what it leaves is of its square."""

_TURNS, _MORE_TURNS = 12, 40
"""What has not settled after some turns may not swing: two poles then, which are no images."""

_ASIDE: Final = 1e-3
"""How far from where their images are those are begun with, as a part."""

_REAL: Final = 1e-9

_LOST: Final = 1e-8
"""Part of all damping that may be missing from the sum of the poles: else one was found twice."""


class Ties(NamedTuple):
    """What couples modes: springs k C and dampers c C between them, G' (k + c d/dt) C G."""

    grips: Real  # how modes move the ties, G: (n_ties, n_modes)
    values: Real  # C, of either sign, as dampers take the place of what springs would lose
    weights: tuple[float, float] = (0.0, 1.0)  # k, c: dampers alone

    @property
    def each(self) -> Real:
        """What they give to each mode alone, but for the weights: (n_modes,)."""
        return np.asarray(self.values @ self.grips**2)

    @property
    def every(self) -> Real:
        """What they give to all modes, but for the weights: (n_modes, n_modes)."""
        return np.asarray(self.grips.T * self.values @ self.grips)

    def of(self, some: NDArray[np.bool_]) -> Ties:
        """Return the same of some modes."""
        return self._replace(grips=self.grips[:, some])


class Lossy(NamedTuple):
    """What modes lose alone, and what ties them: (n_modes,)."""

    lost: Real
    ties: Ties


def coupled_poles(
    squared: Real, damping: Real | Lossy, rows: tuple[Real, Real]
) -> tuple[Complex, Complex, Complex]:
    """Return poles of modes with a matrix of their loss, or with ties, and what they move.

    `rows` are the modes at points and under loads, (n, n_modes) each; what is returned of them is
    how the poles move the points, and how the loads drive the poles: (n, n_poles) each.
    """
    if not isinstance(damping, Lossy):
        return swung(squared, damping, 1.0, rows)
    lost, ties = damping
    found = tied_poles(squared, lost, ties, rows)
    if found is None:
        springs, dampers = ties.weights
        stiff, turn = np.linalg.eigh(np.diag(squared) + springs * ties.every)
        every = turn.T @ (np.diag(lost) + dampers * ties.every) @ turn
        return swung(stiff, every, 1.0, (rows[0] @ turn, rows[1] @ turn))
    return found


def tied_poles(
    squared: Real, lost: Real, ties: Ties, rows: tuple[Real, Real]
) -> tuple[Complex, Complex, Complex] | None:
    """Return what `oscillators.poles` does, where few ties couple modes, equation (91).

    The modes' amplitudes obey q'' + (L + c G' C G) q' + (K + k G' C G) q = f with diagonal K, L and
    C. The poles s are the zeros of det[1 + (k + c s) G (s^2 + L s + K)^-1 G' C], a matrix of as
    many rows as there are ties. They are sought all at once (Aberth), a turn for each in as many
    operations as there are modes. None is returned where they do not settle or some are missing.

    Parameters
    ----------
    squared : ndarray of float64, shape (n_modes,)
        Squares of the angular frequencies without ties, K.
    lost : ndarray of float64, shape (n_modes,)
        What each mode loses without ties, L.
    ties : Ties
        What couples the modes.
    rows : tuple of two ndarray of float64, shapes (n_points, n_modes) and (n_loads, n_modes)
        The modes at points and under loads.

    Examples
    --------
    The sum of all poles is what is lost:

    >>> squared, ties = np.array([1.0, 4.0, 9.0]), Ties(np.array([[0.3, 0.5, 0.2]]), np.ones(1))
    >>> found, *_ = tied_poles(squared, 0.01 * squared, ties, (np.eye(3), np.eye(3)))
    >>> bool(np.isclose(2 * found.real.sum(), -0.01 * 14 - ties.each.sum()))
    True
    """
    springs, dampers = ties.weights
    grips, one, other, angle = _apart(squared, ties.grips)
    moved, pushed = (_with_turned(some, one, other, angle) for some in rows)
    ties, size = ties._replace(grips=grips), np.sqrt(squared)
    taken = np.abs(ties.values) @ grips**2
    tied = (springs / np.maximum(size, 1.0) + dampers) * taken > _FREE * size
    parts = [_alone(squared[~tied], lost[~tied], (moved[:, ~tied], pushed[:, ~tied]))]
    if np.any(tied):
        some = _tied(squared[tied], lost[tied], ties.of(tied), (moved[:, tied], pushed[:, tied]))
        if some is None:
            return None
        parts.append(some)
    found, moving, driven = (np.concatenate(each, axis=-1) for each in zip(*parts, strict=True))
    return found, moving, driven


def _apart(squared: Real, grips: Real) -> tuple[Real, NDArray[np.intp], NDArray[np.intp], Real]:
    """Return grips with each two modes that are equally fast turned, which these are, how far.

    Cosine and sine of an endless strip are so. What takes one leaves the other alone then, or both
    are taken apart.
    """
    order = np.argsort(squared, kind="stable")
    same = np.flatnonzero(np.diff(squared[order]) == 0)
    one, other = order[same], order[same + 1]
    first, second = grips[:, one], grips[:, other]
    angle = np.arctan2(2 * (first * second).sum(axis=0), (first**2 - second**2).sum(axis=0)) / 2
    return _with_turned(grips, one, other, angle), one, other, angle


def _with_turned(rows: Real, one: NDArray[np.intp], other: NDArray[np.intp], angle: Real) -> Real:
    """Return rows of modes of which some are turned into others."""
    turned, cos, sin = rows.copy(), np.cos(angle), np.sin(angle)
    turned[:, one] = cos * rows[:, one] + sin * rows[:, other]
    turned[:, other] = cos * rows[:, other] - sin * rows[:, one]
    return turned


def _pairs(squared: Real, damping: Real) -> tuple[Complex, Complex]:
    """Return both zeros of s^2 + damping s + squared, without cancellation."""
    half = damping / 2
    one = -half - np.sqrt(np.asarray(half**2 - squared, dtype=np.complex128))
    return np.asarray(squared / one, dtype=np.complex128), np.asarray(one, dtype=np.complex128)


def _alone(
    squared: Real, damping: Real, rows: tuple[Real, Real]
) -> tuple[Complex, Complex, Complex]:
    """Return poles of what no damper takes anything from, and what they move."""
    upper, lower = _pairs(squared, damping)
    creeping = upper.imag == 0
    moved, pushed = rows
    swings = np.where(creeping, 1, 2) / (upper - lower)
    back = 1 / (lower - upper)[creeping]
    return (
        np.append(upper, lower[creeping]),
        np.concatenate([moved, moved[:, creeping]], axis=1).astype(np.complex128),
        np.concatenate([pushed * swings, pushed[:, creeping] * back], axis=1),
    )


def _tied(
    squared: Real, lost: Real, ties: Ties, rows: tuple[Real, Real]
) -> tuple[Complex, Complex, Complex] | None:
    """Return poles of what ties couple, and what they move, if all are found."""
    springs, dampers = ties.weights
    bare, near, own = np.stack(_pairs(squared, lost)), squared, lost + dampers * ties.each
    if springs:
        near, turn = np.linalg.eigh(np.diag(squared) + springs * ties.every)
        own = lost @ turn**2 + dampers * ties._replace(grips=ties.grips @ turn).each
    found = _zeros(bare, _pairs(near, own), ties)
    if found is None:
        return None
    times = np.where(found.imag > 0, 2.0, 1.0)
    missing = lost.sum() + dampers * ties.each.sum() + (times * found.real).sum()
    if not abs(missing) <= _LOST * np.abs(found).sum():
        return None
    shapes, norms = _shapes(found, bare, ties, lost)
    moved, pushed = rows
    return found, moved @ shapes, pushed @ shapes * (times / norms)


def _coupling(ties: Ties) -> Real:
    """Return what each mode adds to G M^-1 G' C: (n_modes, n_ties * n_ties)."""
    grips, n = ties.grips, len(ties.values)
    both = (grips[:, np.newaxis] * grips * ties.values[:, np.newaxis]).reshape(n * n, -1)
    return np.asarray(both.T)


def _zeros(bare: Complex, start: tuple[Complex, Complex], ties: Ties) -> Complex | None:
    """Return the zeros, of each two that are images of each other the upper one."""
    upper, lower = start
    pair = upper.imag > 0
    paired, moving = _settled(bare, upper[pair], np.zeros(0, dtype=np.complex128), ties, _TURNS)
    if paired is None:
        return None
    stray = paired[moving]
    paired = np.delete(paired, moving)
    alone = np.concatenate([upper[~pair], stray, lower[~pair], stray.conj()])
    if not alone.size:
        return paired if np.all(paired.imag > 0) else None
    alone[: alone.size // 2] *= 1 + _ASIDE * 1j
    found, moving = _settled(bare, paired, alone, ties, _MORE_TURNS)
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
    bare: Complex, paired: Complex, alone: Complex, ties: Ties, turns: int
) -> tuple[Complex | None, NDArray[np.intp]]:
    """Return zeros after some turns, and which have not settled; the first have images."""
    found, n, coupling = np.append(paired, alone), len(ties.values), _coupling(ties)
    springs, dampers = ties.weights
    moving, middle = np.arange(found.size), bare.sum(axis=0)
    for _ in range(turns):
        if not moving.size:
            break
        s = found[moving, np.newaxis]
        product = (s - bare[0]) * (s - bare[1])
        if not np.all(product):
            return None, moving
        inverse = 1 / product
        sloped = inverse * (2 * s - middle)
        shared, bent = inverse @ coupling, (inverse * sloped) @ coupling
        weight = springs + dampers * s
        matrix = np.eye(n) + (weight * shared).reshape(-1, n, n)
        turned = np.linalg.solve(matrix, (dampers * shared - weight * bent).reshape(-1, n, n))
        growth = np.einsum("jii->j", turned) + sloped.sum(axis=1)
        step = 1 / (growth - _drawn(found, moving, paired.size))
        if not np.all(np.isfinite(step)):
            return None, moving
        found[moving] -= step
        moving = moving[np.abs(step) > _SETTLED * np.abs(found[moving])]
    return found, moving


def _drawn(found: Complex, moving: NDArray[np.intp], n_paired: int) -> Complex:
    """Return the sum of 1 / (s - z) over all other zeros z, and over images of the first ones.

    A zero and its image are one fraction, as quotients of complex numbers are slow.
    """
    s = found[moving, np.newaxis]
    apart, images = s - found, s - found[:n_paired].conj()
    own = np.arange(moving.size), moving
    apart[own] = 1.0
    alone = 1 / apart[:, n_paired:]
    apart = apart[:, :n_paired]
    both = (apart + images) / (apart * images)
    return np.asarray(both.sum(axis=1) + alone.sum(axis=1) - 1)


def _shapes(found: Complex, bare: Complex, ties: Ties, lost: Real) -> tuple[Complex, Complex]:
    """Return the modes x at poles, (n_modes, n_poles), and x' (2 s + L + c G' C G) x of each."""
    s, n, (springs, dampers) = found[:, np.newaxis], len(ties.values), ties.weights
    inverse = 1 / ((s - bare[0]) * (s - bare[1]))
    weight = springs + dampers * s
    matrix = np.eye(n) + (weight * (inverse @ _coupling(ties))).reshape(-1, n, n)
    held = np.linalg.svd(matrix)[2][:, -1].conj()
    shapes = -weight * inverse * ((held * ties.values) @ ties.grips)
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    gripped = shapes @ ties.grips.T
    norms = (shapes**2 * (2 * s + lost)).sum(axis=1)
    norms += dampers * (gripped**2 * ties.values).sum(axis=1)
    return shapes.T, norms
