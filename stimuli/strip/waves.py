"""What the waves of a strip are made of: two waves across it, equation (30) of docs/model.md.

Lengths are in units of half the width, so that a wavenumber p along the strip stands for itself
times W / 2. x = -p^2 is its decay squared, z = k^2 the bending of the plate, and the edges have
the compliance c = 2 / (kappa W), which is 2 D / (K W).
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.strip.material import Material


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """What the dispersion equation knows of a strip at one frequency, without dimension.

    >>> Section(bending=1.0, compliance=3.0, symmetric=True).weights
    (0.75, 0.25)
    """

    bending: complex  # z = (k W / 2)^2, real without loss
    compliance: complex  # c = 2 / (kappa W) of the edges: 0 clamped, infinite simply supported
    symmetric: bool  # about the centre line, or antisymmetric

    @property
    def weights(self) -> tuple[complex, complex]:
        """Slack c / (1 + c) and grip 1 / (1 + c): what the free and the fixed slope count."""
        if cmath.isinf(self.compliance):
            return 1.0, 0.0
        return self.compliance / (1 + self.compliance), 1 / (1 + self.compliance)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CrossWaves:
    """The two waves across the strip, equation (30): Im a >= Im b >= 0."""

    a: Complex  # which of a and b has the square x + z is left open
    b: Complex
    total: Complex  # s = a + b and d = a - b, the smaller of them as 2 z over the larger
    difference: Complex
    gap: Complex  # s d = a^2 - b^2, which is 2 z or -2 z

    @property
    def apart(self) -> NDArray[np.bool_]:
        """Where a and b are far enough from 0 to be divided by: 2 |a b| > |z|."""
        wide: NDArray[np.bool_] = 4 * abs(self.a * self.b) > abs(self.gap)
        return wide


def cross_waves(x: Complex, bending: complex) -> CrossWaves:
    """Return the waves across the strip of given decays, equation (30).

    Examples
    --------
    No digit is lost where the two waves differ by little:

    >>> waves = cross_waves(np.array([4.0 + 0j]), 1e-20)
    >>> complex(waves.total[0]), complex(waves.difference[0])
    ((4+0j), (5e-21+0j))
    """
    first, second = outgoing_root(np.stack([x + bending, x - bending]))
    swap = first.imag < second.imag
    a, b = np.where(swap, second, first), np.where(swap, first, second)
    gap = np.where(swap, -2 * bending, 2 * bending)
    total, difference = a + b, a - b
    plain = abs(total) >= abs(difference)
    larger = np.where(plain, total, difference)
    smaller = ratio(gap, larger)
    return CrossWaves(
        a=a,
        b=b,
        total=np.where(plain, larger, smaller),
        difference=np.where(plain, smaller, larger),
        gap=gap,
    )


def outgoing_root(square: Complex) -> Complex:
    """Return the root with Im > 0, or Im = 0 and Re > 0, whatever the sign of a zero.

    Examples
    --------
    >>> outgoing_root(np.array([complex(-4.0, -0.0), 4.0]))
    array([0.+2.j, 2.+0.j])
    """
    root: Complex = np.sqrt(square)  # Re >= 0
    return np.where(root.imag < 0, -root, root) + 0j


def scaled_sinc(angle: Complex) -> Complex:
    """Return exp(i t) sin(t) / t, bounded for Im t >= 0.

    Examples
    --------
    >>> scaled_sinc(np.array([0j, 1e5j])).real.tolist()
    [1.0, 5e-06]
    """
    return ratio(np.expm1(2j * angle), 2j * angle, 1.0)


def ratio(top: Complex | float, bottom: Complex, limit: Real | float = 0.0) -> Complex:
    """Return a quotient, and its limit where the denominator is 0.

    Examples
    --------
    >>> ratio(np.array([1j, 1j]), np.array([2.0, 0.0])).tolist()
    [0.5j, 0j]
    """
    zero = bottom == 0
    if not zero.any():
        return np.asarray(top / bottom)
    return np.where(zero, limit, top / np.where(zero, 1, bottom))


_PI_SQUARED: Final = Fraction("9.86960440108935861883449099987615113531369940724079")


def supported_cutoff_hz(material: Material, width_m: float, thickness_m: float) -> float:
    """Return f_1 of the simply supported strip, equation (14).

    Examples
    --------
    >>> from stimuli import ALUMINIUM
    >>> round(supported_cutoff_hz(ALUMINIUM, 0.025, 0.0005), 6)
    1926.031369
    """
    relief = (1 - material.poisson_ratio) * (1 + material.poisson_ratio)
    speed_m_s = math.sqrt(material.youngs_modulus_pa / (material.density_kg_m3 * relief))
    return math.pi / (4 * math.sqrt(3)) * thickness_m / width_m**2 * speed_m_s


def squared_frequency_ratio(
    material: Material, width_m: float, thickness_m: float, frequency_hz: float
) -> Fraction:
    """Return (f / f_1)^2 of the simply supported strip, exact but for pi, equation (14).

    Examples
    --------
    >>> from stimuli import ALUMINIUM
    >>> round(float(squared_frequency_ratio(ALUMINIUM, 0.025, 0.0005, 1926.03136910769)), 12)
    1.0
    """
    nu = Fraction(material.poisson_ratio)
    inertia = Fraction(material.density_kg_m3) * (1 - nu * nu)
    size = Fraction(width_m) ** 4 / Fraction(thickness_m) ** 2
    stiffness = Fraction(material.youngs_modulus_pa)
    return 48 * Fraction(frequency_hz) ** 2 * size * inertia / (_PI_SQUARED * stiffness)


def supported_wavenumbers(
    material: Material, width_m: float, thickness_m: float, frequency_hz: float, modes: range
) -> Complex:
    """Return p of both branches in rad/m, by Im p, then falling Re p: equations (9) and (19).

    p^2 / q^2 = -(1 - r c) and -(1 + r c) with r = k^2 / q^2 without loss, c = 1 / sqrt(factor) and
    q = n pi / W. 1 - r c = (1 - r^2) / (1 + r) + r (1 - c): no cancellation at cut-off nor at small
    loss.

    >>> from stimuli import ALUMINIUM
    >>> supported_wavenumbers(ALUMINIUM, math.pi, 0.001, 0.0, range(1, 3)).round(12)
    array([0.+1.j, 0.+1.j, 0.+2.j, 0.+2.j])
    """
    squared = squared_frequency_ratio(material, width_m, thickness_m, frequency_hz)
    detuning = np.array([float(1 - squared / mode**4) for mode in modes])
    number = np.array(modes, dtype=np.float64)
    r = math.sqrt(squared) / number**2
    factor = material.stiffness_factor(frequency_hz)
    c = factor**-0.5
    deficit = complex(0.0, factor.imag) / factor / (1 + c)
    root = outgoing_root(-np.concatenate([detuning / (1 + r) + r * deficit, 1 + r * c]))
    q = math.pi / width_m * number
    p: Complex = np.concatenate([q, q]) * root
    values: Complex = p[np.lexsort((-p.real, p.imag))]
    return values
