"""The dispersion equation of a strip with any edges, and where two of its roots coalesce.

In the units of `stimuli.strip.waves`; equations (31), (33) and (35) of docs/model.md.
"""

from __future__ import annotations

import cmath
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from stimuli.strip.waves import Section, cross_waves, ratio, scaled_sinc

if TYPE_CHECKING:
    from stimuli.arrays import Complex, Real


_SMALL: Final = 1e-4
_STEPS: Final = 15
_SETTLED: Final = 1e-13


def dispersion(section: Section, x: Complex) -> tuple[Complex, Complex]:
    """Return the dispersion function and its derivative in x = -(p W / 2)^2, (31) and (33).

    It is an entire function of x whose roots are the waves of the strip, and it has no others. Both
    are times exp(i (a + b)) / (1 + c), which keeps them from overflow.

    On simple supports the roots are (n pi / 2)^2 - z and (n pi / 2)^2 + z:

    >>> supported = Section(bending=1.0, compliance=math.inf, symmetric=True)
    >>> value, _ = dispersion(supported, np.array([math.pi**2 / 4 - 1, math.pi**2 / 4 + 1, 5.0]))
    >>> (abs(value) < 1e-15).tolist()
    [True, True, False]
    """
    return relation(x, section.bending, section.weights, symmetric=section.symmetric)


def relation(x: Any, bending: Any, weights: tuple[Any, Any], *, symmetric: bool) -> tuple[Any, Any]:
    """Return what `dispersion` does, for arrays of bendings and weights (slack and grip).

    In the precision of the arguments: beside a cut-off those are long doubles.
    """
    slack, grip = weights
    waves = cross_waves(x, bending)
    a, b, apart = waves.a, waves.b, waves.apart
    sinc_a, sinc_b, sinc_s, sinc_d = scaled_sinc(np.stack([a, b, waves.total, waves.difference]))
    turn_a, turn_b = np.exp(2j * np.stack([a, b]))
    cos_a, cos_b = (turn_a + 1) / 2, (turn_b + 1) / 2  # times exp(i a) and exp(i b)
    sinc_d = turn_b * sinc_d
    every = bool(apart.all())
    twist = (sinc_d - sinc_s) / np.where(apart, 2 * a * b, 1)
    if not every:
        near = ratio(sinc_a * cos_b - sinc_b * cos_a, np.where(apart, 1, waves.gap))
        twist = np.where(apart, twist, near)
    if symmetric:
        value = slack * cos_a * cos_b + grip * (sinc_s + sinc_d) / 2
        bend = grip * (twist - sinc_a * sinc_b)
        return value, (bend - slack * (sinc_a * cos_b + cos_a * sinc_b)) / 2
    slope_a, slope_b = _sinc_slope(a, cos_a, sinc_a), _sinc_slope(b, cos_b, sinc_b)
    steep = (sinc_a - cos_a) * cos_b - a * a * twist
    twist_slope = steep / np.where(apart, 2 * (a * b) ** 2, 1)
    if not every:
        near = ratio(slope_a * cos_b - slope_b * cos_a, np.where(apart, 1, waves.gap))
        twist_slope = np.where(apart, twist_slope, near)
    value = slack * sinc_a * sinc_b + grip * twist
    return value, slack * (slope_a * sinc_b + sinc_a * slope_b) + grip * twist_slope


def _sinc_slope(root: Complex, cosine: Complex, sinc: Complex) -> Complex:
    """Return the derivative of sin(t) / t by t^2."""
    square = root * root
    small = abs(square) < _SMALL
    if not small.any():
        return (cosine - sinc) / (2 * square)
    near = -sinc / 6 * (1 + square / 15)
    return np.where(small, near, (cosine - sinc) / (2 * np.where(small, 1, square)))


def exceptional_bending(compliance: float) -> float:
    """Return z where the two slowest symmetric waves coalesce, equation (35).

    Without loss, c = 2 D / (K W) from 0. Simply supported edges have z = 0, the limit of soft ones.

    Examples
    --------
    It grows as the square root of the stiffness of a soft edge:

    >>> round(exceptional_bending(1e8) / exceptional_bending(1e10), 6)
    10.0
    """
    if math.isinf(compliance):
        return 0.0
    # the first mode alone, with the others as two constants
    z = math.sqrt(math.pi**2 / 2 / (compliance + 0.21727))
    y = 0.0131 * z**2 / (2 * compliance + 0.43454)
    for _ in range(_STEPS):
        step = 1e-6 * z
        here = _coalescence(compliance, y, z)
        by_y = (_coalescence(compliance, y + step, z) - here) / step
        by_z = (_coalescence(compliance, y, z + step) - here) / step
        change = np.linalg.solve(np.column_stack([by_y, by_z]), here)
        y, z = y - float(change[0]), z - float(change[1])
        if abs(change[1]) <= _SETTLED * z:
            break
    return z


def _coalescence(compliance: float, y: float, z: float) -> Real:
    """Return dispersion function and slope at x = (pi / 2)^2 + y, exact for small y and z too."""
    slack, grip = compliance / (1 + compliance), 1 / (1 + compliance)
    x, q = math.pi**2 / 4 + y, math.pi / 2
    a, b = cmath.sqrt(x + z), cmath.sqrt(x - z)
    cos_a, cos_b = -cmath.sin((y + z) / (a + q)), -cmath.sin((y - z) / (b + q))
    sinc_a, sinc_b, sinc_s, sinc_d = (
        cmath.sin(t) / t if t else 1.0 for t in (a, b, a + b, 2 * z / (a + b))
    )
    value = slack * cos_a * cos_b + grip * (sinc_s + sinc_d) / 2
    twist = (sinc_a * cos_b - sinc_b * cos_a) / (2 * z)
    slope = grip * (twist - sinc_a * sinc_b) - slack * (sinc_a * cos_b + cos_a * sinc_b)
    return np.array([value.real, slope.real / 2])
