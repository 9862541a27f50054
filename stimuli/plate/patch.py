"""Patches bonded to a strip: the laminate that plate and layers are where one lies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Final

from stimuli.checks import finite, instance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stimuli.plate.material import Material


_TOUCHING: Final = 1e-9
"""Part of the width by which patches and edges may overlap: what rounding of places makes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """One isotropic layer of a bonded patch.

    Attributes
    ----------
    thickness_m : float
        Thickness, from 1 nm.
    youngs_modulus_pa, poisson_ratio : float
        In its plane.
    density_kg_m3 : float
        Mass density; 0 leaves its mass out.

    Raises
    ------
    ValueError
        If a value is not a number in its range.

    Examples
    --------
    >>> Layer(thickness_m=0.1e-3, youngs_modulus_pa=105e9, poisson_ratio=0.35).density_kg_m3
    0.0
    """

    thickness_m: float
    youngs_modulus_pa: float
    poisson_ratio: float
    density_kg_m3: float = 0.0

    def __post_init__(self) -> None:
        ranges = {
            "thickness_m": (1e-9, 1e3),
            "youngs_modulus_pa": (1e-3, 1e15),
            "poisson_ratio": (-0.999, 0.5),
            "density_kg_m3": (0.0, 1e6),
        }
        for name, (least, most) in ranges.items():
            value = finite(name, getattr(self, name), least=least, most=most)
            object.__setattr__(self, name, value)


def layer_of(material: Material, thickness_m: float) -> Layer:
    """Return a plate of some material as the layer that the others are bonded to."""
    return Layer(
        thickness_m=thickness_m,
        youngs_modulus_pa=material.youngs_modulus_pa,
        poisson_ratio=material.poisson_ratio,
        density_kg_m3=material.density_kg_m3,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BondedPatch:
    """A disc or rectangle glued to a strip, which stiffens and loads it there, equation (39).

    The layers bend with the plate as one laminate whose neutral surface lies where no force
    stretches it; the plate around holds it in part, and the glue is left out.

    Attributes
    ----------
    x_m, y_m : float
        Centre along the strip, and across it from one edge.
    length_x_m, length_y_m : float
        Lengths along and across the strip; of a disc both are its diameter.
    layers : tuple of Layer
        From the plate outwards, at least one.
    is_disc : bool
        Whether it is round.

    Raises
    ------
    ValueError
        If a value is not in its range, or a disc's lengths differ.

    Examples
    --------
    >>> ceramic = Layer(thickness_m=0.2e-3, youngs_modulus_pa=63e9, poisson_ratio=0.31)
    >>> BondedPatch(x_m=0.0, y_m=0.0125, length_x_m=0.01, length_y_m=0.02, layers=(ceramic,),
    ...             is_disc=True)
    Traceback (most recent call last):
    ValueError: length_y_m of a disc must be its length_x_m of 0.01, got 0.02
    """

    x_m: float
    y_m: float
    length_x_m: float
    length_y_m: float
    layers: tuple[Layer, ...]
    is_disc: bool = False

    def __post_init__(self) -> None:
        for name, least in (
            ("x_m", -1e3),
            ("y_m", 0.0),
            ("length_x_m", 1e-9),
            ("length_y_m", 1e-9),
        ):
            value = finite(name, getattr(self, name), least=least, most=1e3)
            object.__setattr__(self, name, value)
        instance("layers", self.layers, (tuple, list), "a tuple of layers")
        object.__setattr__(self, "layers", tuple(self.layers))
        for layer in self.layers:
            instance("layers", layer, Layer, "a tuple of layers")
        if not self.layers:
            raise ValueError(f"layers must hold at least one, got {self.layers!r}")
        instance("is_disc", self.is_disc, bool, "True or False")
        if self.is_disc and self.length_x_m != self.length_y_m:
            raise ValueError(
                f"length_y_m of a disc must be its length_x_m of {self.length_x_m!r}, "
                f"got {self.length_y_m!r}"
            )

    @property
    def half_size_m(self) -> tuple[float, float]:
        """Half of the extent along and across the strip."""
        return self.length_x_m / 2, self.length_y_m / 2

    def gaps_m(self, other: BondedPatch) -> tuple[float, float]:
        """Return how far the rectangles about two patches are apart, along and across.

        Parameters
        ----------
        other : BondedPatch
            The other one.

        Returns
        -------
        tuple of float
            In metres, along and across the strip; negative where they overlap in that direction.

        Examples
        --------
        >>> layers = (Layer(thickness_m=0.2e-3, youngs_modulus_pa=63e9, poisson_ratio=0.31),)
        >>> one, other = (BondedPatch(x_m=x, y_m=0.01, length_x_m=0.01, length_y_m=0.02,
        ...                           layers=layers) for x in (0.0, 0.03))
        >>> [round(gap_m, 9) for gap_m in one.gaps_m(other)]
        [0.02, -0.02]
        >>> one.gaps_m(other) == other.gaps_m(one)
        True
        """
        (half_x_m, half_y_m), (others_x_m, others_y_m) = self.half_size_m, other.half_size_m
        gap_x_m = abs(self.x_m - other.x_m) - half_x_m - others_x_m
        return gap_x_m, abs(self.y_m - other.y_m) - half_y_m - others_y_m


@dataclass(frozen=True, slots=True, kw_only=True)
class Laminate:
    """Bending of a plate with its layers, no force in its plane, equation (39).

    Attributes
    ----------
    biaxial_n_m : float
        Moment per curvature that is the same in both directions, D11 + D12.
    opposed_n_m : float
        Moment per curvature that is opposite in both directions, D11 - D12 = 2 D66.
    mass_kg_m2 : float
        Mass per area.
    reach_m : float
        From the neutral surface of the first bending to the middle of the outermost layer.
    """

    biaxial_n_m: float
    opposed_n_m: float
    mass_kg_m2: float
    reach_m: float


def laminate(layers: Sequence[Layer]) -> Laminate:
    """Return what layers are together, the plate first.

    A layer of the plate's own material makes a thicker plate:

    >>> plate = Layer(thickness_m=0.5e-3, youngs_modulus_pa=67e9, poisson_ratio=0.346)
    >>> round(laminate([plate, plate]).biaxial_n_m / laminate([plate]).biaxial_n_m, 9)
    8.0
    """
    middle_m = [
        sum(below.thickness_m for below in layers[:place]) + layer.thickness_m / 2
        for place, layer in enumerate(layers)
    ]

    def bending(sign: int) -> tuple[float, float]:
        stretch = [
            layer.youngs_modulus_pa * layer.thickness_m / (1 - sign * layer.poisson_ratio)
            for layer in layers
        ]
        neutral_m = sum(s * z for s, z in zip(stretch, middle_m, strict=True)) / sum(stretch)
        parts = zip(stretch, middle_m, layers, strict=True)
        stiff = sum(s * (one.thickness_m**2 / 12 + (z - neutral_m) ** 2) for s, z, one in parts)
        return stiff, neutral_m

    biaxial_n_m, neutral_m = bending(1)
    return Laminate(
        biaxial_n_m=biaxial_n_m,
        opposed_n_m=bending(-1)[0],
        mass_kg_m2=sum(layer.density_kg_m3 * layer.thickness_m for layer in layers),
        reach_m=middle_m[-1] - neutral_m,
    )


def cutoff_factor(material: Material, thickness_m: float, patches: Sequence[BondedPatch]) -> float:
    """Return how many times higher a cut-off is at most where patches cover the strip, at least 1.

    With the stiffer of the two bendings of (39); elastic edges do not stiffen, and give less.
    """
    plate = layer_of(material, thickness_m)
    bare, factor = laminate([plate]), 1.0
    for patch in patches:
        whole = laminate([plate, *patch.layers])
        stiffer = max(whole.biaxial_n_m / bare.biaxial_n_m, whole.opposed_n_m / bare.opposed_n_m)
        factor = max(factor, math.sqrt(stiffer * bare.mass_kg_m2 / whole.mass_kg_m2))
    return factor


def checked_patches(
    patches: Sequence[BondedPatch], width_m: float, length_m: float | None
) -> tuple[BondedPatch, ...]:
    """Return the patches of a strip of a width and length as a tuple, or refuse them."""
    instance("patches", patches, (tuple, list), "a tuple of patches")
    slack_m = _TOUCHING * width_m
    for patch in patches:
        instance("patches", patch, BondedPatch, "a tuple of patches")
        if length_m is None:
            raise ValueError("patches need a strip with ends: length_m must be given, got None")
        half_x_m, half_y_m = patch.half_size_m
        over_x_m = abs(patch.x_m) + half_x_m - length_m / 2
        over_y_m = abs(patch.y_m - width_m / 2) + half_y_m - width_m / 2
        if max(over_x_m, over_y_m) > slack_m:
            raise ValueError(f"patches must lie on the strip, got {patch!r}")
    for one, other in combinations(patches, 2):
        if max(one.gaps_m(other)) < -slack_m:
            raise ValueError(
                "patches must not overlap, nor the rectangles about discs, got "
                f"{one!r} and {other!r}"
            )
    return tuple(patches)
