"""Across the strip: even and odd exponentials, the supported strip's kernel, loads in y.

Lengths are in widths, Y = y / W - 1/2 runs from -1/2 to 1/2. All exponents are scaled so that
nothing overflows; g has a real part >= 0. `sign` is +1 for what is symmetric about the centre
line and -1 for what is antisymmetric.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Complex = NDArray[np.complex128]
    Real = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Where a load acts across the strip, in widths from the centre line: a point or a length.

    Examples
    --------
    >>> Span(centre=0.1, length=0.2).high
    0.2
    """

    centre: float
    length: float = 0.0

    @property
    def low(self) -> float:
        """Lower end, not beyond the edge."""
        return max(self.centre - self.length / 2, -0.5)

    @property
    def high(self) -> float:
        """Upper end, not beyond the edge."""
        return min(self.centre + self.length / 2, 0.5)


def shape(g: Complex, across: Real, sign: int) -> Complex:
    """Return exp(-g/2) cosh(g Y) (sign +1) or exp(-g/2) sinh(g Y) (sign -1).

    Examples
    --------
    >>> g = np.array([2.0 + 0j])
    >>> bool(np.allclose(shape(g, np.array([0.3]), 1), np.exp(-1) * np.cosh(0.6)))
    True
    """
    value: Complex = 0.5 * (np.exp(-g * (0.5 - across)) + sign * np.exp(-g * (0.5 + across)))
    return value


def shape_integral(g: Complex, span: Span, sign: int) -> Complex:
    """Return `shape` integrated over a span, or its value at a point.

    Examples
    --------
    >>> g = np.array([1e-9 + 0j])
    >>> bool(np.allclose(shape_integral(g, Span(centre=0.05, length=0.5), 1), 0.5))
    True
    """
    ends = np.asarray(0.5 * np.exp(-g * (0.5 - span.high)), dtype=np.complex128)
    ends = ends + 0.5 * sign * np.exp(-g * (0.5 + span.low))
    if span.length:
        ends = ends * (-np.expm1(-g * span.length) / g)
    return ends


def supported_kernel(g: Complex, across: Real, span: Span, sign: int) -> Complex:
    """Return the kernel of g^2 - d2/dy2 with zero ends, integrated over a span, equation (38).

    Parameters
    ----------
    g : ndarray of complex128
        Decay constants, in 1 / width.
    across : ndarray of float64
        Places Y, to be broadcast with `g`.
    span : Span
        Where the load acts.
    sign : int
        Symmetry of the part that is wanted; the two parts add up to the kernel.

    Returns
    -------
    ndarray of complex128

    Examples
    --------
    The two parts add up to the closed form sinh(g y) sinh(g (1 - y0)) / (g sinh g), y <= y0:

    >>> g, here = np.array([1.5 + 0.5j]), np.array([-0.3])
    >>> both = sum(supported_kernel(g, here, Span(centre=0.1), sign) for sign in (1, -1))
    >>> closed = np.sinh(0.2 * g) * np.sinh(0.4 * g) / (g * np.sinh(g))
    >>> bool(np.allclose(both, closed, rtol=1e-14))
    True
    """
    if span.length == 0:
        apart, mirrored = np.abs(across - span.low), np.abs(across + span.low)
        parts = np.exp(-g * apart) + sign * np.exp(-g * mirrored)
        parts -= np.exp(-g * (1 - mirrored)) + sign * np.exp(-g * (1 - apart))
    else:
        apart_near, apart_far = _both(g, across - span.high, span.length)
        mirrored_near, mirrored_far = _both(g, across + span.low, span.length)
        parts = apart_near + sign * mirrored_near - mirrored_far - sign * apart_far
    value: Complex = parts / (4 * g * (1 + sign * np.exp(-g)))
    return value


def _both(g: Complex, start: Real, length: float) -> tuple[Complex, Complex]:
    """Return the integrals of exp(-g |u|) and exp(-g (1 - |u|)) from start to start + length."""
    end = start + length
    right = np.where(start > 0, length, np.maximum(end, 0.0))
    left = np.where(end < 0, length, np.maximum(-start, 0.0))
    rise_right, rise_left = (-np.expm1(-g * part) / g for part in (right, left))
    near = np.exp(-g * np.maximum(start, 0.0)) * rise_right
    near += np.exp(-g * np.maximum(-end, 0.0)) * rise_left
    far = np.exp(-g * (1 - np.maximum(end, 0.0))) * rise_right
    far += np.exp(-g * (1 - np.maximum(-start, 0.0))) * rise_left
    return near, far
