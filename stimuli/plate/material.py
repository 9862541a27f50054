"""The material of a strip, with its loss."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from stimuli.checks import finite


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """An isotropic, homogeneous material of a thin plate.

    Attributes
    ----------
    youngs_modulus_pa : float
        Young's modulus E without loss.
    poisson_ratio : float
        Poisson's ratio nu, below 0.5.
    density_kg_m3 : float
        Mass density rho.
    loss_factor : float
        Constant (hysteretic) loss factor eta.
    viscous_time_s : float
        Relaxation time tau of a Kelvin-Voigt loss.

    Raises
    ------
    ValueError
        If a value is not a finite number in its range.

    Examples
    --------
    The loss of a Kelvin-Voigt material grows with frequency, a constant one does not:

    >>> rubber = Material(youngs_modulus_pa=5e6, poisson_ratio=0.49, density_kg_m3=1100,
    ...                   loss_factor=0.1, viscous_time_s=1e-5)
    >>> rubber.stiffness_factor(0.0)
    (1-0.1j)
    >>> rubber.stiffness_factor(1000.0).imag < rubber.stiffness_factor(500.0).imag
    True
    """

    youngs_modulus_pa: float
    poisson_ratio: float
    density_kg_m3: float
    loss_factor: float = 0.0
    viscous_time_s: float = 0.0

    def __post_init__(self) -> None:
        ranges = {
            "youngs_modulus_pa": (1e-3, 1e15),
            "poisson_ratio": (-0.999, math.inf),
            "density_kg_m3": (1e-3, 1e6),
            "loss_factor": (0.0, 1e3),
            "viscous_time_s": (0.0, 1e3),
        }
        for name, (least, most) in ranges.items():
            below = 0.5 if name == "poisson_ratio" else math.inf
            value = finite(name, getattr(self, name), least=least, most=most, below=below)
            object.__setattr__(self, name, value)

    def stiffness_factor(self, frequency_hz: float) -> complex:
        """Return what the loss multiplies the bending stiffness with, equation (15).

        Parameters
        ----------
        frequency_hz : float
            Frequency, at least 0.

        Returns
        -------
        complex
            1 - i (eta + omega tau), for the time factor exp(-i omega t).

        Raises
        ------
        ValueError
            If the frequency is negative or not finite.

        Examples
        --------
        >>> ALUMINIUM.stiffness_factor(500.0)
        (1+0j)
        """
        frequency_hz = finite("frequency_hz", frequency_hz, least=0.0)
        loss = self.loss_factor + 2 * math.pi * frequency_hz * self.viscous_time_s
        return complex(1.0, -loss) if loss else complex(1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Handbook:
    """A material by its name, without loss, and where its values are from.

    Attributes
    ----------
    material : Material
        Its values.
    source : str
        The standards, data sheets and books that have them.
    """

    material: Material
    source: str


def _handbook(
    modulus_gpa: float, poisson_ratio: float, density_kg_m3: float, source: str
) -> Handbook:
    material = Material(
        youngs_modulus_pa=modulus_gpa * 1e9,
        poisson_ratio=poisson_ratio,
        density_kg_m3=density_kg_m3,
    )
    return Handbook(material=material, source=source)


# Typical values: alloys differ by some per cent, plastics by more and with the frequency, so what
# was measured on a plate is better than any of them. Each was looked up where its words say; what
# was found nowhere is called unchecked. Loss depends on how a plate is held, and is in none.
MATERIALS: Final[dict[str, Handbook]] = {
    "aluminium": _handbook(
        68.9, 0.33, 2700, "6061-T6, Aluminum Association's typical values; other alloys to 73 GPa"
    ),
    "steel": _handbook(210, 0.3, 7850, "structural steel, EN 1993-1-1; density EN 1991-1-1"),
    "stainless": _handbook(
        200,
        0.3,
        7900,
        "1.4301, EN 10088-1, MakeItFrom; hard-rolled 301 has 180 to 193 GPa (Elgiloy); Poisson's "
        "ratio Lai et al., Continuum Mechanics, table 5.2",
    ),
    "brass": _handbook(
        110,
        0.34,
        8530,
        "70Cu-30Zn (C26000), makers give 110 to 117 GPa; density Olin Brass, Poisson's ratio AZoM",
    ),
    "copper": _handbook(
        117,
        0.33,
        8920,
        "C11000, Hussey Copper, Poisson's ratio from its moduli; density copper.org",
    ),
    "titanium": _handbook(
        105, 0.34, 4510, "grade 2, Superior Tube; Poisson's ratio ASM; alloys to 114 GPa"
    ),
    "glass": _handbook(
        70, 0.2, 2500, "soda-lime, EN 572-1; Pilkington ATS-129 has 72 GPa and 0.23"
    ),
    "borosilicate": _handbook(64, 0.2, 2230, "glass, BOROFLOAT 33, SCHOTT's mechanical properties"),
    "pmma": _handbook(
        3.3, 0.37, 1190, "sheet makers, ISO 527 (Politem XT), Poisson's ratio unchecked"
    ),
    "polycarbonate": _handbook(
        2.4, 0.38, 1200, "Makrolon UV data sheet, ISO 527; Poisson's ratio Trident Plastics"
    ),
}
"""Materials by their names, for a plate of which nothing else was measured.

Each has its values as `material`, a `Material` without loss, and says as `source` where they are
from. Moduli are in pascals.

>>> from stimuli import MATERIALS
>>> MATERIALS["steel"].material.density_kg_m3
7850.0
"""

ALUMINIUM: Final = Material(youngs_modulus_pa=67e9, poisson_ratio=0.346, density_kg_m3=2700.0)
"""The paper's aluminium, without loss.

Source: paper, section II-B, whose MPa and kg/m2 are misprints of GPa and kg/m3 (docs/model.md).
That of handbooks is in `MATERIALS`.

>>> from stimuli import ALUMINIUM, MATERIALS
>>> ALUMINIUM.youngs_modulus_pa < MATERIALS["aluminium"].material.youngs_modulus_pa
True
"""
