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
    from stimuli.arrays import Complex, Real


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


@dataclass(frozen=True, slots=True, eq=False)
class Crossing:
    """One branch across a strip: all that a field needs of it."""

    kernel: Complex  # of g^2 - d2/dy2 with zero ends, integrated over a span, equation (38)
    shape: Complex  # `shape` at the places
    load: Complex  # `shape_integral` over the span
    end: Complex  # `shape` at the edge
    fall: Complex  # exp(-g)


def crossing(g: Complex, across: Real, span: Span, sign: int) -> Crossing:
    """Return what `supported_kernel`, `shape` and `shape_integral` give, with shared exponentials.

    `g` are decay constants in 1 / width, broadcast with the places Y.

    Examples
    --------
    >>> g, here = np.array([1.5 + 0.5j]), np.array([-0.3])
    >>> found = crossing(g, here, Span(centre=0.1), 1)
    >>> bool(np.allclose(found.shape, shape(g, here, 1)))
    True
    """
    up, down, fall = np.exp(-g * (0.5 - across)), np.exp(-g * (0.5 + across)), np.exp(-g)
    above = np.exp(-g * (0.5 - span.high))
    below = np.exp(-g * (0.5 + span.low)) if span.centre else above
    whole: Complex | float = -np.expm1(-g * span.length) / g if span.length else 1.0
    near, far = _images(g, across, span, places=(up, down), ends=(above, below), whole=whole)
    if span.centre == 0:
        parts = (1 + sign) * (near - far)
    else:
        images = _images(g, -across, span, places=(down, up), ends=(above, below), whole=whole)
        parts = near - images[1] + sign * (images[0] - far)
    end: Complex = np.asarray(0.5 * (1 + sign * fall))
    return Crossing(
        kernel=parts / (8 * g * end),
        shape=0.5 * (up + sign * down),
        load=0.5 * (above + sign * below) * whole,
        end=end,
        fall=fall,
    )


def supported_kernel(g: Complex, across: Real, span: Span, sign: int) -> Complex:
    """Return the kernel of g^2 - d2/dy2 with zero ends, integrated over a span, equation (38).

    As for `crossing`; the kernels of the two symmetries add up to the whole.

    Examples
    --------
    The two parts add up to the closed form sinh(g y) sinh(g (1 - y0)) / (g sinh g), y <= y0:

    >>> g, here = np.array([1.5 + 0.5j]), np.array([-0.3])
    >>> both = sum(supported_kernel(g, here, Span(centre=0.1), sign) for sign in (1, -1))
    >>> closed = np.sinh(0.2 * g) * np.sinh(0.4 * g) / (g * np.sinh(g))
    >>> bool(np.allclose(both, closed, rtol=1e-14))
    True
    """
    return crossing(g, across, span, sign).kernel


def _images(
    g: Complex,
    across: Real,
    span: Span,
    *,
    places: tuple[Complex, Complex],
    ends: tuple[Complex, Complex],
    whole: Complex | float,
) -> tuple[Complex, Complex]:
    """Return the integrals of exp(-g |Y - y|) and exp(-g (1 - |Y - y|)) over the span.

    Every exponential decays: 1 - |Y - y| is the way from one of them to the one edge and from the
    other to the other edge, given as `places` for Y and as `ends` for the span.
    """
    (up, down), (above, below) = places, ends
    right = across >= span.high
    beyond = np.maximum(np.maximum(across - span.high, span.low - across), 0.0)
    near: Complex = np.exp(-g * beyond) * whole
    far: Complex = np.where(right, up * below, down * above) * whole
    inside = (across > span.low) & ~right
    if span.length and np.any(inside):
        inside = np.broadcast_to(inside, near.shape)
        place = np.broadcast_to(across, near.shape)[inside]
        slow, above, below = (np.broadcast_to(a, near.shape)[inside] for a in (g, above, below))
        left, rest = (np.expm1(-slow * w) / slow for w in (place - span.low, span.high - place))
        near[inside] = -left - rest
        far[inside] = -up[inside] * below * left - down[inside] * above * rest
    return near, far
