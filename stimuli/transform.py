"""The field of a load in an endless strip, Fourier-transformed along it, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stimuli.transverse import Span, crossing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Complex = NDArray[np.complex128]
    Real = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A load in units of the width, at x = 0.

    Attributes
    ----------
    span : Span
        Where it acts across the strip; a disc is a point at its centre, equation (44).
    half_length : float
        Half of its length along the strip, 0 for a point and a disc.
    radius : float
        Radius of a disc, else 0.
    moment : bool
        Whether it is a moment patch, else a force or pressure.
    """

    span: Span
    half_length: float = 0.0
    radius: float = 0.0
    moment: bool = False

    def branch_weights(self, k: Complex) -> tuple[Complex, Complex]:
        """Return what the load makes of plane waves of either branch, equations (42) and (44)."""
        one, two = disc_weights(k, self.radius) if self.radius else (1 + 0 * k, 1 + 0 * k)
        return (-k * k * one, k * k * two) if self.moment else (one, two)

    def along(self, s: Complex, distance: Real) -> Complex:
        """Return the load's factor for waves exp(i s |x|) at a distance from its centre, (43)."""
        c = self.half_length
        if c == 0:
            return np.exp(1j * s * distance)
        turn = 1j * s
        value: Complex = np.exp(turn * np.maximum(distance - c, 0.0)) * np.expm1(2 * c * turn)
        inside = np.flatnonzero(distance < c)
        if inside.size:
            ways = c - distance[inside], c + distance[inside]
            some = np.broadcast_to(turn, value.shape)[..., inside]
            value[..., inside] = np.expm1(some * ways[0]) + np.expm1(some * ways[1])
        return value / turn


def disc_weights(k: Complex, radius: float) -> tuple[Complex, Complex]:
    """Return the integrals of plane waves of both branches over a disc, equation (44).

    Examples
    --------
    Long waves see the area only:

    >>> weights = disc_weights(np.array([1e-6 + 0j]), 0.5)
    >>> bool(np.allclose(weights, np.pi / 4))
    True
    """
    from scipy.special import iv, jv

    return 2 * np.pi * radius * jv(1, k * radius) / k, 2 * np.pi * radius * iv(1, k * radius) / k


def transformed(
    s: Complex, k: Complex, hold: Complex, *, source: Source, across: Real, sign: int
) -> tuple[Complex, Real]:
    """Return D U^ of one symmetry along the complex s plane, equations (39) to (42).

    Parameters
    ----------
    s : ndarray of complex128, shape (..., n_s, n_places or 1)
        Wavenumbers along the strip times the width, none of them a pole.
    k : ndarray of complex128
        Bending wavenumber times the width; not small, (39) cancels as k^-2.
    hold : ndarray of complex128
        1 / (kappa W): 0 for clamped, infinite for simply supported edges.
    source : Source
        The load; only its span, its radius and its kind are used.
    across : ndarray of float64
        Places Y.
    sign : int
        +1 for the symmetric part, -1 for the antisymmetric one.

    Returns
    -------
    value : ndarray of complex128
        The transform in units of the width, all arguments broadcast.
    terms : ndarray of float64
        Amount of the terms whose sum it is, for every fourth s: what rounding counts.
    """
    k2 = k * k
    g1, g2 = np.sqrt(s * s - k2), np.sqrt(s * s + k2)
    one, two = source.branch_weights(k)
    first, second = (crossing(g, across, source.span, sign) for g in (g1, g2))
    part1, part2 = one * first.kernel, two * second.kernel
    value: Complex = part1 - part2
    terms: Real = np.abs(part1[..., ::4, :]) + np.abs(part2[..., ::4, :])
    if not np.all(np.isinf(hold)):
        psi1, psi2 = first.shape / first.end, second.shape / second.end
        load1, load2 = one * first.load / first.end, two * second.load / second.end
        grip1, grip2 = g1 * first.fall / first.end, g2 * second.fall / second.end
        grip = 2 * (2 * k2 * hold + 2 * k2 / (g1 + g2) - sign * (grip2 - grip1))
        psi, load = psi2 - psi1, (load2 - load1) / grip
        value -= psi * load
        lost = np.abs(load1 / grip) + np.abs(load) * (np.abs(grip1 / grip))
        terms += (np.abs(psi1 * load) + np.abs(psi) * lost)[..., ::4, :]
    return value / (2 * k2), terms / np.abs(2 * k2)
