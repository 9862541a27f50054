"""A plate on two supports by sines across and Legendre polynomials along: a second method.

It shares no function with the product. Stiffness, damping and mass are matrices of one set of
smooth functions, so pressures should be wide. Fingertips add to the matrices what they add to the
energies; the motion over time follows from the exponential of a matrix, which is exact for straight
lines between samples.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.signal
from numpy.polynomial import legendre

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stimuli import Fingertip, PressureRectangle, SampledDrive, Strip
    from stimuli.arrays import Complex, Real

N_ACROSS, N_ALONG = 11, 22
ANGLES = 2 * math.pi * np.arange(24) / 24


class SupportedPlate:
    """A plate with two simply supported edges and two free ends, and fingertips on it."""

    def __init__(self, strip: Strip, fingertips: Sequence[Fingertip] = ()) -> None:
        assert strip.length_m
        self.strip, self.length_m, material = strip, strip.length_m, strip.material
        points_m, weights = self._nodes(0.0, strip.width_m / 2, strip.length_m, strip.width_m)
        w, xx, yy, xy = (
            self._functions(points_m, *orders) for orders in ((0, 0), (2, 0), (0, 2), (1, 1))
        )
        nu = material.poisson_ratio
        parts = ((1 + nu) / 2, xx + yy), ((1 - nu) / 2, xx - yy), (2 * (1 - nu), xy)
        bending = np.sum([factor * (part.T * weights) @ part for factor, part in parts], axis=0)
        self.stiffness = strip.bending_stiffness_n_m * bending
        self.mass = material.density_kg_m3 * strip.thickness_m * (w.T * weights) @ w
        self.damping = material.viscous_time_s * self.stiffness
        for tip in fingertips:
            if tip.impedance:
                mean = self._mean(tip)
                together = np.outer(mean, mean)
                self.stiffness += tip.impedance.stiffness_n_m * together
                self.damping += tip.impedance.damping_n_s_m * together
                self.mass += tip.impedance.mass_kg * together

    def response(self, load: PressureRectangle, points_m: Any, frequency_hz: float) -> Complex:
        """Return the displacement under a tone: (n_points,)."""
        omega = 2 * math.pi * frequency_hz
        dynamic = self.stiffness - 1j * omega * self.damping - omega**2 * self.mass
        return np.asarray(self._functions(points_m) @ np.linalg.solve(dynamic, self._work(load)))

    def history(
        self, load: PressureRectangle, drive: SampledDrive, points_m: Any, n_times: int
    ) -> Real:
        """Return the displacement at the samples of a drive and after: (n_times, n_points)."""
        n = len(self.mass)
        back, rate = (np.linalg.solve(self.mass, part) for part in (self.stiffness, self.damping))
        system = np.block([[np.zeros((n, n)), np.eye(n)], [-back, -rate]])
        forced = np.concatenate([np.zeros(n), np.linalg.solve(self.mass, self._work(load))])
        observed = np.hstack([self._functions(points_m), np.zeros((len(points_m), n))])
        signal = np.pad(drive.values, (0, n_times - len(drive.values)))
        times_s = np.arange(n_times) / drive.sample_rate_hz
        matrices = (system, forced[:, np.newaxis], observed, np.zeros((len(points_m), 1)))
        return np.asarray(
            scipy.signal.lsim(matrices, signal, times_s, interp=not drive.held)[1]
        ).reshape(n_times, -1)

    def _functions(self, points_m: Any, along: int = 0, across: int = 0) -> Real:
        """Return derivatives of all functions: (n_points, n_functions)."""
        x_m, y_m = np.asarray(points_m, dtype=np.float64).T
        scale = 2 / self.length_m
        coefficients = legendre.legder(np.eye(N_ALONG), along, scale, axis=0)
        polynomials = legendre.legvander(scale * x_m, len(coefficients) - 1) @ coefficients
        q = math.pi * np.arange(1, N_ACROSS + 1) / self.strip.width_m
        sines = q**across * np.sin(np.outer(y_m, q) + across * math.pi / 2)
        products = sines[:, :, np.newaxis] * polynomials[:, np.newaxis]
        return np.asarray(products.reshape(len(x_m), -1))

    def _nodes(self, x_m: float, y_m: float, along_m: float, across_m: float) -> tuple[Real, Real]:
        """Return nodes and weights of Gauss over a rectangle."""
        (x, along), (y, across) = (_gauss(n) for n in (N_ALONG + 2, 2 * N_ACROSS + 8))
        places = np.meshgrid(x_m + along_m / 2 * x, y_m + across_m / 2 * y, indexing="ij")
        weights = along_m * across_m / 4 * np.outer(along, across)
        return np.stack(places, axis=-1).reshape(-1, 2), np.asarray(weights.ravel())

    def _work(self, load: PressureRectangle) -> Real:
        """Return the work of a unit pressure on all functions."""
        points_m, weights = self._nodes(load.x_m, load.y_m, load.length_x_m, load.length_y_m)
        return np.asarray(weights @ self._functions(points_m))

    def _mean(self, tip: Fingertip) -> Real:
        """Return the means of all functions over a contact area."""
        nodes, weights = _gauss(8)
        radii_m = tip.radius_m * np.sqrt((nodes + 1) / 2)
        places_m = [np.outer(radii_m, wave(ANGLES)).ravel() for wave in (np.cos, np.sin)]
        points_m = np.array([tip.x_m, tip.y_m]) + np.stack(places_m, axis=1)
        return np.asarray(np.repeat(weights / 2, 24) / 24 @ self._functions(points_m))


def _gauss(n: int) -> tuple[Real, Real]:
    nodes, weights = legendre.leggauss(n)
    return np.asarray(nodes, np.float64), np.asarray(weights, np.float64)
