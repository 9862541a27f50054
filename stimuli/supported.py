"""The waves of the simply supported strip in closed form, to the last digit."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.section import outgoing_root

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.material import Material

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
) -> NDArray[np.complex128]:
    """Return the wavenumbers p of both branches in rad/m, equations (9) and (19).

    p^2 / q^2 = -(1 - r c) and -(1 + r c) with r = k^2 / q^2 without loss, c = 1 / sqrt(factor) and
    q = n pi / W. 1 - r c = (1 - r^2) / (1 + r) + r (1 - c): no cancellation at cut-off nor at
    small loss.

    Returns
    -------
    ndarray of complex128, shape (2 * len(modes),)
        By increasing imaginary part, then decreasing real part.

    Examples
    --------
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
    p: NDArray[np.complex128] = np.concatenate([q, q]) * root
    return p[np.lexsort((-p.real, p.imag))]
