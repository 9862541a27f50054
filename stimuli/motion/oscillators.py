"""A plate as oscillators: each follows its drive exactly, and what is left out follows at once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real

_UNCOUPLED: Final = 1e-9
"""Loss that two modes exchange, as a part of what they have, below which each is alone."""


def poles(squared: Real, bent: Real, viscous_s: float) -> tuple[Complex, Complex, Complex]:
    """Return the poles of modes with loss, and how they move the modes and are driven by them.

    Parameters
    ----------
    squared : ndarray of float64, shape (n_modes,)
        Squares of the modes' angular frequencies.
    bent : ndarray of float64, shape (n_modes,) or (n_modes, n_modes)
        The stiffness that has loss: q'' + tau bent q' + squared q = f.
    viscous_s : float
        Relaxation time tau.

    Returns
    -------
    poles : ndarray of complex128, shape (n_poles,)
        One of each pair, Im >= 0.
    modes, drives : ndarray of complex128, shapes (n_modes, n_poles) and (n_poles, n_modes)
        The modes are Re(modes @ z), where z' = poles z + drives @ f.

    Examples
    --------
    An oscillator that is pushed once swings as sin(omega t) / omega:

    >>> found, modes, drives = poles(np.array([4.0]), np.array([4.0]), 0.0)
    >>> time_s = 0.3
    >>> bool(np.isclose((modes * np.exp(found * time_s) * drives).real, np.sin(2 * 0.3) / 2))
    True
    """
    one_each = np.eye(squared.size)
    found, modes, drives = swung(squared, bent, viscous_s, (one_each, one_each))
    return found, modes, drives.T


def swung(
    squared: Real,
    bent: Real,
    viscous_s: float,
    rows: tuple[Real, Real],
    *,
    coupled_hz: float = math.inf,
) -> tuple[Complex, Complex, Complex]:
    """Return the poles, and how they move points and are driven by loads, as `poles` would tell.

    `rows` are the modes at points and under loads, (..., n_modes) each. A mode that exchanges no
    loss is one pole: no matrix of all modes is made for it. What modes that swing above
    `coupled_hz` exchange with others is left out.
    """
    parts, (moved, pushed) = _parts(squared, bent, viscous_s, coupled_hz), rows
    return (
        np.concatenate([part.poles for part in parts]),
        np.concatenate([part.moving(moved) for part in parts], axis=-1, dtype=np.complex128),
        np.concatenate([part.driven(pushed) for part in parts], axis=-1, dtype=np.complex128),
    )


class _Part(NamedTuple):
    """Modes that exchange loss among each other, or all that exchange none."""

    some: NDArray[np.intp]  # numbers of its modes
    poles: Complex
    modes: Complex | None  # as `poles` returns them; none where each mode is a pole
    drives: Complex  # then one of each: (n_poles,)

    def moving(self, rows: Real) -> Real | Complex:
        """Return how the poles move what all modes move as rows tell: (..., n_poles)."""
        return rows[..., self.some] if self.modes is None else rows[..., self.some] @ self.modes

    def driven(self, rows: Real) -> Complex:
        """Return how what drives all modes as rows tell drives the poles: (..., n_poles)."""
        own = rows[..., self.some]
        return np.asarray(own * self.drives if self.modes is None else own @ self.drives.T)


def _parts(squared: Real, bent: Real, viscous_s: float, coupled_hz: float) -> list[_Part]:
    alone = bent if bent.ndim == 1 else np.diag(bent)
    half = viscous_s * alone / 2
    swings = half**2 < squared
    lone, exchange = swings, np.zeros((0, 0), dtype=bool)
    if bent.ndim > 1:
        own = np.sqrt(np.maximum(alone, 0.0))
        exchange = np.abs(bent - np.diag(alone)) > _UNCOUPLED * np.multiply.outer(own, own)
        above = swings & (squared > (2 * math.pi * coupled_hz) ** 2)
        exchange[above] = exchange[:, above] = False
        lone = swings & ~np.any(exchange, axis=0)
    swing = 1j * np.sqrt(squared[lone] - half[lone] ** 2)
    parts = [_Part(np.flatnonzero(lone), swing - half[lone], None, 1 / swing)]
    others = np.flatnonzero(~lone)
    if others.size:
        damping = viscous_s * (np.diag(bent) if bent.ndim == 1 else bent)
        coupled = _connected(exchange, others) if bent.ndim > 1 else [*others[:, np.newaxis]]
        parts += [
            _Part(some, *_exchanging(squared[some], damping[np.ix_(some, some)]))
            for some in coupled
        ]
    return parts


def _connected(exchange: NDArray[np.bool_], some: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Return which of some modes are coupled with each other: even and odd ones are not."""
    left, found = some, []
    while left.size:
        group, size = left[:1], 0
        while group.size > size:
            size = group.size
            group = np.union1d(group, np.flatnonzero(exchange[group].any(axis=0)))
        found.append(group)
        left = np.setdiff1d(left, group)
    return found


def _exchanging(squared: Real, damping: Real) -> tuple[Complex, Complex, Complex]:
    """Return the poles of modes that exchange what they lose, and the rest as `poles` does."""
    n = squared.size
    matrix = np.zeros((2 * n, 2 * n))
    matrix[:n, n:] = np.eye(n)
    matrix[n:, :n] = -np.diag(squared)
    matrix[n:, n:] = -damping
    values, vectors = np.linalg.eig(matrix)
    inverse = np.linalg.inv(vectors)
    upper = values.imag >= 0
    pairs = np.where(values[upper].imag > 0, 2.0, 1.0)
    return values[upper], vectors[:n, upper], pairs[:, np.newaxis] * inverse[upper, n:]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Oscillators:
    """What points of a plate do under loads.

    Attributes
    ----------
    poles : ndarray of complex128, shape (n_poles,)
        Angular frequencies with their decay, 1/s.
    at_points : ndarray of complex128, shape (n_copies, n_points, n_poles)
        How each oscillator moves each point.
    of_loads : ndarray of complex128, shape (n_copies, n_loads, n_poles)
        How each unit load drives each oscillator.
    rest_m : ndarray of float64, shape (n_loads, n_points)
        What follows a load at once: all that has its modes above those kept.
    """

    poles: Complex
    at_points: Complex
    of_loads: Complex
    rest_m: Real

    def weights(self, load: int) -> Complex:
        """Return what a load makes of every oscillator at every point: (n_points, n_poles)."""
        return np.asarray(np.einsum("cpj,cj->pj", self.at_points, self.of_loads[:, load]))


def followed(
    poles: Complex, samples: Real, step_s: float, start: Complex, *, held: bool, every: int = 1
) -> Complex:
    """Return z of z' = poles z + s at every so many samples of a drive s, (81).

    That is (n_poles, n_samples // every + 1) values; samples - 1 is a multiple of `every`. At the
    first sample z is `start`. Between samples the drive is a straight line or, if held, what the
    last sample was.
    """
    whole, part = step_weights(poles * step_s)
    now, before = (np.zeros_like(whole), whole) if held else (part, whole - part)
    # what each sample from one value to the next adds to that
    turned = np.exp(np.multiply.outer(poles * step_s, np.arange(every, -1, -1)))
    each = now[:, np.newaxis] * turned
    each[:, 0] = 0.0
    each[:, :-1] += before[:, np.newaxis] * turned[:, 1:]
    n_values = (samples.size - 1) // every
    places = every * np.arange(n_values)[np.newaxis] + np.arange(every + 1)[:, np.newaxis]
    # A value after the other would take a turn of Python each. All blocks of values are run
    # through at the same time instead, and then each gets what the one before it left.
    length = math.isqrt(n_values + 1) + 1
    n_blocks = -(-(n_values + 1) // length)
    found = np.zeros((poles.size, n_blocks * length), dtype=np.complex128)
    found[:, 1 : n_values + 1] = (step_s * each) @ samples[places]
    found[:, 0] = start
    blocks = found.reshape(-1, n_blocks, length)
    turns = np.exp(np.multiply.outer(poles * (every * step_s), np.arange(1, length + 1)))
    for place in range(1, length):
        blocks[:, :, place] += turns[:, :1] * blocks[:, :, place - 1]
    for block in range(1, n_blocks):
        blocks[:, block] += turns * blocks[:, block - 1, -1:]
    return found[:, : n_values + 1]


def step_weights(turn: Complex) -> tuple[Complex, Complex]:
    """Return the integrals over a step of exp(turn (1 - t)) and of exp(turn (1 - t)) t.

    >>> whole, late = step_weights(np.array([1e-3j]))
    >>> bool(np.isclose(whole[0], 1.0, atol=1e-3)), bool(np.isclose(late[0], 0.5, atol=1e-3))
    (True, True)
    """
    safe = np.where(turn == 0, 1.0, turn)
    whole = np.where(turn == 0, 1.0, np.expm1(turn) / safe)
    return whole, np.where(turn == 0, 0.5, (whole - 1) / safe)


def moved(weights: Complex, rest_m: Real, answers: Complex, drive: Real) -> Real:
    """Return the displacement of points: (n_points, n_samples).

    Parameters
    ----------
    weights : ndarray of complex128, shape (n_points, n_poles)
    rest_m : ndarray of float64, shape (n_points,)
    answers : ndarray of complex128, shape (n_poles, n_samples)
    drive : ndarray of float64, shape (n_samples,)
    """
    both = np.concatenate([weights.real, -weights.imag, rest_m[:, np.newaxis]], axis=1)
    return np.asarray(both @ np.concatenate([answers.real, answers.imag, drive[np.newaxis]]))
