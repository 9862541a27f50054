"""The shapes across the strip that belong to its waves, equation (36) of docs/model.md."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.checks import finite_array
from stimuli.strip.dispersion import dispersion
from stimuli.strip.waves import Section, cross_waves, scaled_sinc

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from stimuli.arrays import Complex, Real


TOLERANCE: Final = 1e-6
"""How far a square may lie from a root, as a fraction of |x| + |z|."""

_NODES: Final = 16
_PANEL_RAD: Final = 4.0
"""Phase of the two waves across a panel of the quadrature: 16 nodes leave 1e-15."""


def folded(y_m: ArrayLike, width_m: float, *, symmetric: bool) -> tuple[Real, Real]:
    """Return the distances from the nearer edge in half widths, and the signs of that half.

    ValueError where a place is no number from 0 to the width.

    >>> from_edge, sign = folded([0.0, 0.5, 2.0], 2.0, symmetric=False)
    >>> from_edge.tolist(), sign.tolist()
    ([0.0, 0.5, 0.0], [1.0, 1.0, -1.0])
    """
    y = finite_array("y_m", y_m)
    if np.any((y < 0) | (y > width_m)):
        raise ValueError(f"y_m must lie from 0 to the width {width_m:g} m, got {y_m!r}")
    other = width_m - y
    sign = np.where((y > other) & (not symmetric), -1.0, 1.0)
    return np.minimum(y, other) / width_m * 2, sign


def is_wave(section: Section, x: complex) -> bool:
    """Return whether the strip has a wave of this decay squared, to `TOLERANCE`.

    The dispersion function at x is then small against its values on a circle around it, also
    where two roots coalesce.

    Examples
    --------
    >>> clamped = Section(bending=0.0, compliance=0.0, symmetric=True)
    >>> is_wave(clamped, 3.1696173 + 4.7404752j), is_wave(clamped, 3.17 + 4.75j)
    (True, False)
    """
    radius = TOLERANCE * (abs(x) + abs(section.bending))
    circle = x + radius * np.exp(1j * math.pi / 4 * np.arange(8))
    value, _ = dispersion(section, np.append(circle, x))
    return bool(2 * abs(value[-1]) < np.max(abs(value[:-1])))


def wave_shape(section: Section, x: complex, from_edge: Real) -> Complex:
    """Return the shape of a wave on the half of the strip at y = 0.

    x is a root of `dispersion`, places are counted in half widths from the edge (0) to the centre
    line (1). The shape is exactly 0 at the edge, has a mean of |U|^2 of 1/2 over the strip, and
    slope + curvature (per half width) at this edge real and positive.

    Examples
    --------
    The simply supported strip has sines:

    >>> supported = Section(bending=1.0, compliance=math.inf, symmetric=True)
    >>> wave_shape(supported, math.pi**2 / 4 - 1, np.array([0.0, 1.0])).real.round(12)
    array([0., 1.])
    """
    count = 1 + int(math.sqrt(abs(x) + abs(section.bending)) / _PANEL_RAD)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    places = (np.arange(count)[:, np.newaxis] + (nodes + 1) / 2) / count
    power = np.sum(abs(_shape(section, x, places)) ** 2 * weights) / (2 * count)
    free = Section(bending=section.bending, compliance=math.inf, symmetric=section.symmetric)
    fixed = Section(bending=section.bending, compliance=0.0, symmetric=section.symmetric)
    at = np.array([complex(x)])
    rise = complex((dispersion(fixed, at)[0] - dispersion(free, at)[0])[0])
    phase = rise.conjugate() / abs(rise)
    shape: Complex = phase / math.sqrt(2 * power) * _shape(section, x, from_edge)
    if not any(complex(part).imag for part in (x, section.bending, section.compliance)):
        shape = shape.real.astype(np.complex128)
    return shape


def _shape(section: Section, x: complex, from_edge: Real) -> Complex:
    """Return the shape times exp(i (a + b)), without cancellation and without overflow."""
    waves = cross_waves(np.array([complex(x)]), section.bending)
    near, far = from_edge / 2, 1 - from_edge / 2
    if not section.symmetric and not waves.apart[0]:
        a, b, inner = waves.a, waves.b, 1 - from_edge
        first = scaled_sinc(a * inner) * np.exp(1j * a * from_edge) * scaled_sinc(b)
        second = scaled_sinc(b * inner) * np.exp(1j * b * from_edge) * scaled_sinc(a)
        shape: Complex = inner * (first - second) / waves.gap
        return shape.reshape(from_edge.shape)
    s, d, turn = waves.total, waves.difference, 2j * waves.b
    first = scaled_sinc(s * far) * scaled_sinc(d * near) * np.exp(turn * near)
    second = scaled_sinc(s * near) * scaled_sinc(d * far) * np.exp(turn * far)
    both = first + second if section.symmetric else (second - first) / (waves.a * waves.b)
    shape = near * far * both
    return shape.reshape(from_edge.shape)
