"""The response of a plate over frequency, in a coarse and a fine basis.

A plate with ends follows each load at rest and by its inertia (`rest`), and beyond that each of its
modes swings. Where patches stiffen the plate, its own basis follows every load, and modes do all.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import scipy.linalg

from stimuli.plate.line import Margins
from stimuli.plate.modes import Resolution, plate_bases
from stimuli.plate.rest import rest_displacement
from stimuli.plate.waveguide import (
    endless_displacement,
    has_lossless_springs,
    stiffness_factors,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.load import Load
    from stimuli.plate.modes import Basis
    from stimuli.strip.strip import Strip

_EXCHANGE: Final = 2.5
"""Springs without loss make modes exchange their loss, up to this multiple of the highest
frequency; what faster modes exchange has no effect."""
_RESOLUTION: Final = Resolution()
_ENDLESS: Final = (Margins(3, 3), Margins(6, 6))
_SAFETY, _PART, _SCALED = 3.0, 3e-4, 2e-5
"""What the coarse basis differs by is multiplied with; to that come what both bases miss at corners
and rims, a part of each displacement, and of the upper modes, a part of the largest."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """A result with an estimate of its error, which is not below the true one.

    Attributes
    ----------
    value : ndarray
    error : ndarray of float64, same shape
    """

    value: Complex | Real
    error: Real


def estimate(coarse: Complex | Real, fine: Complex | Real, scale: Real) -> Estimate:
    """Return the fine result, with its error by what the coarse one differs.

    `scale` is the largest value of the field, which both resolutions miss a part of.
    """
    error = _SAFETY * np.abs(fine - coarse) + _PART * np.abs(fine) + _SCALED * scale
    return Estimate(value=fine, error=np.asarray(error))


def frequency_response(
    strip: Strip, loads: Sequence[Load], points_m: ArrayLike, frequencies_hz: ArrayLike
) -> Estimate:
    """Return the displacement of a strip under unit loads over frequency.

    Parameters
    ----------
    strip : Strip
    loads : sequence of Load
    points_m : array_like of float, shape (n_points, 2)
    frequencies_hz : array_like of float, shape (n_frequencies,)

    Returns
    -------
    Estimate
        Complex displacement in metres per unit load (1 N, 1 Pa, 1 N m/m) with the time factor
        exp(-i w t), of the shape (n_frequencies, n_loads, n_points).
    """
    points, at_hz = np.asarray(points_m, dtype=np.float64), np.asarray(frequencies_hz, dtype=float)
    # The field is largest near a load's centre: that sets the scale of the error.
    centres = np.array([(load.x_m, load.y_m) for load in loads])
    both = np.concatenate([points, centres])
    if strip.length_m is None:
        response = np.stack(
            [
                [endless_displacement(strip, load, both, at_hz, margin) for load in loads]
                for margin in _ENDLESS
            ]
        ).swapaxes(1, 2)
    else:
        response = _finite_response(strip, loads, both, at_hz)
    scale = np.abs(response[1]).max(axis=-1, keepdims=True)
    coarse, fine = response[..., : len(points)]
    return estimate(coarse, fine, scale)


def _finite_response(
    strip: Strip, loads: Sequence[Load], points_m: Real, frequencies_hz: Real
) -> Complex:
    """Return the displacement of a plate with ends: (2, n_frequencies, n_loads, n_points)."""
    omega = 2 * math.pi * frequencies_hz
    factors = stiffness_factors(strip, frequencies_hz)
    max_hz = max(float(frequencies_hz.max()), strip.cutoff_hz())
    n_terms = 0 if strip.patches else 2
    modes = plate_modes(strip, loads, points_m, max_hz, _RESOLUTION)
    response = np.stack(
        [sum(part.response(omega, factors, max_hz, n_terms) for part in parts) for parts in modes]
    )
    if n_terms:
        rest = rest_displacement(strip, loads, points_m, max_hz, factors)
        response += rest[:, 0] + omega[:, np.newaxis, np.newaxis] ** 2 * rest[:, 1]
    return response


def plate_modes(
    strip: Strip, loads: Sequence[Load], points_m: Real, max_hz: float, resolution: Resolution
) -> tuple[list[Modes], list[Modes]]:
    """Return the modes that loads excite, by symmetry, in the coarse and in the fine basis."""
    coarse: list[Modes] = []
    fine: list[Modes] = []
    for basis in plate_bases(strip, max_hz, resolution, loads, with_breaks=bool(strip.patches)):
        values, work = basis.values(points_m), np.stack([basis.work(load) for load in loads])
        for modes, select in zip((coarse, fine), basis.resolutions(), strict=True):
            modes.append(Modes(basis, select, values[:, select], work[:, select]))
    return coarse, fine


class Modes:
    """Modes of one symmetry in one basis, at points and under loads."""

    def __init__(self, basis: Basis, select: NDArray[np.intp], values: Real, work: Real) -> None:
        self.squared, self.shapes = basis.modes(select)
        self.matrices = [matrix[np.ix_(select, select)] for matrix in basis.matrices]
        self.values, self.work = values, work
        self.held = np.zeros(self.squared.size)
        if has_lossless_springs(basis.strip):
            self.held = np.einsum("im,im->m", self.shapes, self.matrices[1] @ self.shapes)

    def at_rest(self) -> Real:
        """Return the displacement at rest of these modes without loss: (n_loads, n_points)."""
        return (self.work @ self.shapes / self.squared) @ (self.values @ self.shapes).T

    def slow(self, max_hz: float) -> Modes:
        """Return the modes up to a frequency."""
        is_slow = self.squared <= (2 * math.pi * max_hz) ** 2
        slow = copy(self)
        slow.squared, slow.shapes, slow.held = (
            self.squared[is_slow],
            self.shapes[:, is_slow],
            self.held[is_slow],
        )
        return slow

    def response(
        self, omega: Complex | Real, factors: Complex, exchange_hz: float, n_terms: int
    ) -> Complex:
        """Return the displacement, without the first terms in powers of w^2.

        Up to a multiple of `exchange_hz` modes exchange loss where their springs have none.
        """
        squared, shapes, held = self.squared, self.shapes, self.held
        is_slow = squared <= (_EXCHANGE * 2 * math.pi * exchange_hz) ** 2
        is_slow &= bool(np.any(held)) and bool(np.any(factors.imag))
        lossy = held + (squared - held) * factors[:, np.newaxis]
        square = omega[:, np.newaxis] ** 2
        gains = (square / lossy) ** n_terms / (lossy - square)
        gains[:, is_slow] = 0.0
        received, excitation = self.values @ shapes, self.work @ shapes
        response = np.stack([(gains * row) @ received.T for row in excitation], axis=1)
        if is_slow.any():
            response += self._exchanging(shapes[:, is_slow], omega, factors, n_terms)
        return response

    def _exchanging(
        self, shapes: Real, omega: Complex | Real, factors: Complex, n_terms: int
    ) -> Complex:
        """Return the same of modes that exchange loss, as their springs have none.

        One step of inverse iteration with a lossy stiffness takes the modes near to those of the
        lossy plate, and what remains of the exchange is solved at each frequency.
        """
        stiffness, springs, mass = self.matrices
        lossy = springs + factors[factors.size // 2] * stiffness
        vectors = scipy.linalg.solve(lossy, mass @ shapes, assume_a="sym", check_finite=False)
        vectors /= np.linalg.norm(vectors, axis=0)
        held, bent, moved = (vectors.T @ matrix @ vectors for matrix in (springs, stiffness, mass))
        square = omega[:, np.newaxis, np.newaxis] ** 2
        at_rest = held + factors[:, np.newaxis, np.newaxis] * bent
        amplitudes: NDArray[Any] = np.broadcast_to(
            vectors.T @ self.work.T, (omega.size, held.shape[0], len(self.work))
        )
        for _ in range(n_terms):
            amplitudes = square * (moved @ np.linalg.solve(at_rest, amplitudes))
        amplitudes = np.linalg.solve(at_rest - square * moved, amplitudes)
        return np.asarray((self.values @ vectors @ amplitudes).swapaxes(1, 2))
