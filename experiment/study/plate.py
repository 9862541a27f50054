"""The section [strip] of a study file: the plate."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field

from experiment.study.base import (
    Day,
    Line,
    Section,
    all_or_none,
    obey,
    obeying,
    zero_or_at_least,
)
from stimuli import (
    CLAMPED,
    MATERIALS,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    IdealEdge,
    Material,
    Strip,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.study.base import Rule

EdgeBasis = Literal["simply-supported", "clamped", "elastic", "measured-cutoff"]

# Ranges admit every plate on which two fingers can lie, and exclude most values in another unit:
# metres for millimetres, pascals for gigapascals, g/cm3. Two fingertips need 20 mm; a foil is
# 0.02 mm thick; balsa has 100 kg/m3 and osmium 22 600; diamond has 1200 GPa.
_is_material = obeying(MATERIALS.__contains__, f"must be one of {', '.join(MATERIALS)}")
MaterialName = Annotated[str, _is_material, Field(json_schema_extra={"enum": list(MATERIALS)})]
Modulus = Annotated[float, Field(ge=1e-3, le=1500)]
Density = Annotated[float, Field(ge=30, le=25_000)]
_CONSTANTS: Final = ("youngs_modulus_gpa", "poisson_ratio", "density_kg_m3")


class Plate(Section):
    """The plate, held along its two long edges."""

    width_mm: Annotated[float, Field(ge=2, le=1000)]
    """width between the held edges"""
    length_mm: Annotated[float, Field(ge=20, le=10_000)] | Literal["endless"]
    """length along the held edges, or "endless" """
    thickness_mm: Annotated[float, Field(ge=0.02, le=50)]
    """thickness of the bare plate"""
    material: MaterialName | None = None
    """name of the material, in place of the next three keys"""
    youngs_modulus_gpa: Modulus | None = None
    """Young's modulus"""
    poisson_ratio: Annotated[float, Field(ge=-0.999, lt=0.5)] | None = None
    """Poisson's ratio"""
    density_kg_m3: Density | None = None
    """density"""
    loss_factor: Annotated[float, Field(ge=0, lt=0.5), zero_or_at_least(1e-4)] = 0.0
    """constant (hysteretic) loss factor; 0 if unknown"""
    viscous_time_us: Annotated[float, Field(ge=0, le=100), zero_or_at_least(0.01)] = 0.0
    """Kelvin-Voigt loss, added to the other; 0 if unknown"""
    edge: EdgeBasis
    """support of the long edges; measured-cutoff: elastic edges that give the measured cut-off"""
    edge_stiffness_n: Annotated[float, Field(ge=1e-3, le=1e7)] | None = None
    """rotational stiffness of elastic edges, N m per rad and m of edge"""
    edge_loss: Literal["none", "plate"] = "none"
    """loss of elastic edges: none, or that of the plate"""
    measured_cutoff_hz: Annotated[float, Field(ge=20, le=200_000)] | None = None
    """measured first cut-off frequency; with another edge, only for comparison"""
    measured_by: Line | None = None
    """who measured the cut-off frequency"""
    measured_on: Day | None = None
    """day of the measurement, such as 2026-05-04"""
    source: Line | None = None
    """where these values are from"""

    def rules(self) -> Iterator[Rule]:
        """Yield the rules of sizes, material, edges and measurement."""
        is_thick = self.thickness_mm > self.width_mm / 2
        yield is_thick, "thickness_mm", "must be at most half of width_mm"
        has_material, has_modulus = self.material is not None, self.youngs_modulus_gpa is not None
        excess = has_material and has_modulus
        yield excess, "youngs_modulus_gpa", "excludes material; give one of the two"
        yield from all_or_none(self, _CONSTANTS)
        lack = not has_material and not has_modulus
        yield lack, "material", f"is required, or else {', '.join(_CONSTANTS)}"
        is_odd = (self.edge == "elastic") != (self.edge_stiffness_n is not None)
        rule = 'must be given with edge = "elastic", and only then'
        yield is_odd, "edge_stiffness_n", rule, None
        has_cutoff = self.measured_cutoff_hz is not None
        lack = self.edge == "measured-cutoff" and not has_cutoff
        yield lack, "measured_cutoff_hz", 'is required with edge = "measured-cutoff"'
        is_ideal = self.edge in {"simply-supported", "clamped"}
        rule = 'must be "none" unless the edges are elastic'
        yield self.edge_loss == "plate" and is_ideal, "edge_loss", rule
        lack = not has_cutoff and bool(self.measured_by or self.measured_on)
        yield lack, "measured_cutoff_hz", "is required with measured_by and measured_on"
        # refused where no edge gives this plate the measured cut-off frequency
        self.strip  # noqa: B018

    @property
    def has_loss_factor(self) -> bool:
        """Whether the study states the loss; a plate without ends may have none."""
        return self.length_mm == "endless" or self.loss_factor > 0 or self.viscous_time_us > 0

    @cached_property
    def strip(self) -> Strip:
        """The strip of the physics."""
        edge: IdealEdge | ElasticEdge = CLAMPED if self.edge == "clamped" else SIMPLY_SUPPORTED
        if self.edge_stiffness_n is not None:
            is_lossless = self.edge_loss == "none"
            edge = ElasticEdge(stiffness_n=self.edge_stiffness_n, lossless=is_lossless)
        if self.material is not None:
            material = MATERIALS[self.material].material
        else:
            modulus_gpa, poisson_ratio, density_kg_m3 = (getattr(self, key) for key in _CONSTANTS)
            material = Material(
                youngs_modulus_pa=modulus_gpa * 1e9,
                poisson_ratio=poisson_ratio,
                density_kg_m3=density_kg_m3,
            )
        loss_factor, viscous_time_s = self.loss_factor, self.viscous_time_us / 1e6
        strip = Strip(
            width_m=self.width_mm / 1e3,
            length_m=None if isinstance(self.length_mm, str) else self.length_mm / 1e3,
            thickness_m=self.thickness_mm / 1e3,
            material=replace(material, loss_factor=loss_factor, viscous_time_s=viscous_time_s),
            edge=edge,
        )
        if self.edge != "measured-cutoff" or self.measured_cutoff_hz is None:
            return strip
        low_hz, high_hz = (
            replace(strip, edge=edge).cutoff_hz() for edge in (SIMPLY_SUPPORTED, CLAMPED)
        )
        rule = (
            f"must be between {low_hz:.6g} Hz (simply supported edges) and {high_hz:.6g} Hz "
            "(clamped edges) for this width, thickness and material"
        )
        is_outside = not low_hz < self.measured_cutoff_hz < high_hz
        obey([(is_outside, "measured_cutoff_hz", rule)], self)
        strip = strip.with_cutoff(self.measured_cutoff_hz)
        if isinstance(strip.edge, ElasticEdge):
            strip = replace(strip, edge=replace(strip.edge, lossless=self.edge_loss == "none"))
        return strip
