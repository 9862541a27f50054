"""Modes of a plate held along its long edges, its ends free: by Rayleigh's and Ritz's method."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from stimuli.motion.basis import Polynomials, free_basis, half_waves, held_basis
from stimuli.strip.edge import CLAMPED, ElasticEdge

if TYPE_CHECKING:
    from stimuli.arrays import Real
    from stimuli.strip.strip import Strip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modes:
    """Modes of one symmetry, with the mass 1 each.

    Attributes
    ----------
    squared : ndarray of float64, shape (n_modes,)
        Squares of their angular frequencies without loss.
    bent : ndarray of float64, shape (n_modes, n_modes)
        What of them the plate's own stiffness gives, without springs along the edges: it has loss
        where those may have none.
    along, across : Polynomials
        Functions along and across the strip.
    series : ndarray of float64, shape (n_along, n_across, n_modes)
        The modes in products of those.
    """

    squared: Real
    bent: Real
    along: Polynomials
    across: Polynomials
    series: Real

    def at(self, points_m: Real, *, laplacian: bool = False) -> Real:
        """Return the modes at points (n_points, 2), or their Laplacians: (1, n_points, n_modes)."""
        if laplacian:
            return (self._at(points_m, 2, 0) + self._at(points_m, 0, 2))[np.newaxis]
        return self._at(points_m, 0, 0)[np.newaxis]

    def _at(self, points_m: Real, order_x: int, order_y: int) -> Real:
        along = self.along.values(points_m[:, 0] / self.along.half_m, order_x)
        across = self.across.values(points_m[:, 1] / self.across.half_m - 1, order_y)
        half = np.tensordot(along, self.series, axes=1)  # (n_points, n_across, n_modes)
        return np.asarray(np.einsum("pj,pjm->pm", across, half))


def wavenumber_rad_m(strip: Strip, frequency_hz: float) -> float:
    """Return that of a bending wave in a plate without edges."""
    mass = strip.material.density_kg_m3 * strip.thickness_m
    return math.sqrt(2 * math.pi * frequency_hz * math.sqrt(mass / strip.bending_stiffness_n_m))


def n_functions(strip: Strip, highest_hz: float) -> int:
    """Return in how many functions the modes of each symmetry are sought."""
    most = wavenumber_rad_m(strip, highest_hz)
    across = half_waves(most, strip.width_m / 2)
    return across if strip.length_m is None else across * half_waves(most, strip.length_m / 2)


def plate_modes(strip: Strip, highest_hz: float, *, centred: bool) -> list[Modes]:
    """Return the modes of a finite plate up to a frequency, a group for each symmetry.

    Parameters
    ----------
    strip : Strip
        The plate; its loss does not count here.
    highest_hz : float
        How far.
    centred : bool
        Whether only modes that are even across the strip are asked for.
    """
    from scipy.linalg import eigh

    length_m = strip.length_m or 0.0
    mass = strip.material.density_kg_m3 * strip.thickness_m
    most = wavenumber_rad_m(strip, highest_hz)
    n_along, n_across = half_waves(most, length_m / 2), half_waves(most, strip.width_m / 2)
    found = []
    for odd_x, odd_y in product((False, True), (False,) if centred else (False, True)):
        along = free_basis(n_along, length_m, odd=odd_x)
        across = held_basis(n_across, strip.width_m, clamped=strip.edge is CLAMPED, odd=odd_y)
        plate, springs = _stiffnesses(strip, along, across)
        squared, vectors = eigh(
            (plate + springs) / mass,
            subset_by_value=(-math.inf, (2 * math.pi * highest_hz) ** 2),
            overwrite_a=True,
            check_finite=False,
        )
        found.append(
            Modes(
                squared=squared,
                bent=vectors.T @ plate @ vectors / mass,
                along=along,
                across=across,
                series=(vectors / math.sqrt(mass)).reshape(n_along, n_across, -1),
            )
        )
    return found


def _stiffnesses(strip: Strip, along: Polynomials, across: Polynomials) -> tuple[Real, Real]:
    """Return the matrices of the plate's strain energy and of the springs', per mass."""
    poisson, stiffness = strip.material.poisson_ratio, strip.bending_stiffness_n_m
    one_x, one_y = np.eye(along.series.shape[0]), np.eye(across.series.shape[0])
    coupled = np.kron(along.products(2, 0), across.products(0, 2))
    plate = (
        np.kron(along.products(2, 2), one_y)
        + np.kron(one_x, across.products(2, 2))
        + poisson * (coupled + coupled.T)
        + 2 * (1 - poisson) * np.kron(along.products(1, 1), across.products(1, 1))
    )
    held = strip.edge.stiffness_n if isinstance(strip.edge, ElasticEdge) else 0.0
    slopes = across.values(np.array([-1.0, 1.0]), 1)
    return stiffness * plate, np.asarray(held * np.kron(one_x, slopes.T @ slopes))
