"""The field of a load in an endless strip, Fourier-transformed along it, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.transverse import Span, crossing, shape, shape_integral

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Complex = NDArray[np.complex128]
    Real = NDArray[np.float64]

_END: Final = np.array(0.5)


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
) -> Complex:
    """Return D U^ of one symmetry along the complex s plane, equations (39) to (42).

    Parameters
    ----------
    s : ndarray of complex128
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
    ndarray of complex128
        The transform in units of the width, all arguments broadcast.
    """
    k2 = k * k
    g1, g2 = np.sqrt(s * s - k2), np.sqrt(s * s + k2)
    one, two = source.branch_weights(k)
    (kernel1, shape1), (kernel2, shape2) = (
        crossing(g, across, source.span, sign) for g in (g1, g2)
    )
    value: Complex = one * kernel1 - two * kernel2
    if not np.all(np.isinf(hold)):
        end1, end2 = shape(g1, _END, sign), shape(g2, _END, sign)
        psi = shape2 / end2 - shape1 / end1
        load = two * shape_integral(g2, source.span, sign) / end2
        load -= one * shape_integral(g1, source.span, sign) / end1
        grip = 2 * k2 / (g1 + g2) - sign * (g2 * np.exp(-g2) / end2 - g1 * np.exp(-g1) / end1)
        value -= psi * load / (2 * (2 * k2 * hold + grip))
    return value / (2 * k2)
