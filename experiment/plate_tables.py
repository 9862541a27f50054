"""The tables [strip] and [[actuator]] of study.toml: the plate and what moves it."""

from __future__ import annotations

from typing import ClassVar, Final, Literal, Self

from pydantic import Field, model_validator

from experiment.actuator import Shape, Side
from experiment.study_values import EdgeBasis
from experiment.table import Above0, Table

PAPER_CUTOFF_HZ: Final = 2900.0
"""First cut-off measured on the paper's plate (figure 4)."""


class StripTable(Table):
    """The plate, held along its two long edges."""

    later: ClassVar[tuple[str, ...]] = ("loss_factor", "viscous_time_us")

    width_mm: Above0 = Field(25.0, description="between the held edges")
    length_mm: Above0 | Literal["endless"] = Field(200.0, description='or "endless"')
    thickness_mm: Above0 = Field(0.5)
    youngs_modulus_gpa: Above0 = Field(67.0, description="aluminium")
    poisson_ratio: float = Field(0.346)
    density_kg_m3: Above0 = Field(2700.0)
    loss_factor: float = Field(0.0, description="constant (hysteretic) loss")
    viscous_time_us: float = Field(0.0, description="Kelvin-Voigt loss; both add")
    edge: EdgeBasis = Field("measured-cutoff")
    measured_cutoff_hz: Above0 | None = Field(
        None, description="first cut-off as measured; with edge = measured-cutoff"
    )
    edge_stiffness_n: Above0 | None = Field(
        None, description="N m per rad per m of edge; with edge = elastic"
    )

    @model_validator(mode="after")
    def _edge_has_its_key(self) -> Self:
        """Ask for the one key of the edge; only the paper's plate has a known cut-off."""
        keys = {"measured-cutoff": "measured_cutoff_hz", "elastic": "edge_stiffness_n"}
        if self.edge == "measured-cutoff" and self.measured_cutoff_hz is None and self._is_paper():
            self.measured_cutoff_hz = PAPER_CUTOFF_HZ
        for edge, key in keys.items():
            given = getattr(self, key)
            if self.edge == edge and given is None:
                raise ValueError(f"{key} is missing; edge = {edge} needs it")
            if self.edge != edge and given is not None:
                raise ValueError(f"{key} is for edge = {edge} only; got edge = {self.edge}")
        return self

    def _is_paper(self) -> bool:
        """Tell whether what the cut-off depends on was left out or repeats the paper's value."""
        fields = type(self).model_fields
        given = self.model_fields_set - {"length_mm", *self.later}
        return all(getattr(self, key) == fields[key].default for key in given)


MEASURED_KEYS: Final = ("measured_displacement_um", "measured_at_vpp", "measured_at_hz")
PIEZO_KEYS: Final = (
    "piezo_thickness_mm",
    "piezo_youngs_modulus_gpa",
    "piezo_poisson_ratio",
    "piezo_d31_pm_v",
)
CARRIER_KEYS: Final = (
    "carrier_thickness_mm",
    "carrier_youngs_modulus_gpa",
    "carrier_poisson_ratio",
)
_SIZES: Final[dict[Shape, tuple[str, ...]]] = {
    "disc": ("diameter_mm",),
    "rectangle": ("length_x_mm", "length_y_mm"),
    "motor": ("length_x_mm", "length_y_mm"),
}


class ActuatorTable(Table):
    """A patch or a motor under the strip, and the finger above it.

    One is left, one is right; those that are never driven in a session are other.
    """

    later: ClassVar[tuple[str, ...]] = (
        "name",
        "finger_diameter_mm",
        *MEASURED_KEYS,
        *PIEZO_KEYS,
        *CARRIER_KEYS,
    )

    side: Side = Field(description="as the participant sees it")
    name: str | None = Field(None, description="of one whose side is other")
    shape: Shape = Field("disc", description="motor: over its contact")
    x_mm: float = Field(description="centre along the strip, from its middle, right positive")
    y_mm: float | None = Field(None, description="centre across, from one edge; default the middle")
    diameter_mm: Above0 | None = Field(None, description="of a disc")
    length_x_mm: Above0 | None = Field(None, description="of a rectangle or motor, along the strip")
    length_y_mm: Above0 | None = Field(
        None, description="of a rectangle or motor, across the strip"
    )
    finger_diameter_mm: Above0 = Field(10.0, description="contact of the fingertip above it")
    measured_displacement_um: Above0 | None = Field(
        None, description="amplitude at its centre, as measured"
    )
    measured_at_vpp: Above0 | None = Field(None, description="... with a sine of this level")
    measured_at_hz: Above0 | None = Field(None, description="... and of this frequency")
    piezo_thickness_mm: Above0 | None = Field(
        None, description="or its layers: displacements are predicted"
    )
    piezo_youngs_modulus_gpa: Above0 | None = Field(None, description="1 / s11E")
    piezo_poisson_ratio: float | None = Field(None, description="-s12E / s11E")
    piezo_d31_pm_v: float | None = Field(None, description="strain per field in its plane")
    carrier_thickness_mm: Above0 | None = Field(
        None, description="metal between piezo and plate, if any"
    )
    carrier_youngs_modulus_gpa: Above0 | None = None
    carrier_poisson_ratio: float | None = None

    @model_validator(mode="after")
    def _shape_has_its_sizes(self) -> Self:
        for key in ("diameter_mm", "length_x_mm", "length_y_mm"):
            given = getattr(self, key) is not None
            if given and key not in _SIZES[self.shape]:
                shapes = " or ".join(shape for shape, keys in _SIZES.items() if key in keys)
                raise ValueError(f"{key} is for shape = {shapes} only; got shape = {self.shape}")
            if not given and key in _SIZES[self.shape]:
                raise ValueError(f"{key} is missing; got shape = {self.shape}")
        return self

    @model_validator(mode="after")
    def _displacement_has_one_basis(self) -> Self:
        basis = self._refuse_incomplete(MEASURED_KEYS, PIEZO_KEYS)
        carrier = self._refuse_incomplete(CARRIER_KEYS)
        if carrier is not None and basis != PIEZO_KEYS[0]:
            raise ValueError(f"{PIEZO_KEYS[0]} is missing; {carrier} needs it")
        if self.shape == "motor" and basis == PIEZO_KEYS[0]:
            raise ValueError(f"{basis} is for patches only; got shape = motor")
        return self

    @property
    def has_basis(self) -> bool:
        """Whether its displacement is measured or can be predicted."""
        return self.measured_displacement_um is not None or self.piezo_thickness_mm is not None


def paper_actuators() -> tuple[ActuatorTable, ...]:
    """Return the paper's discs: 2.6 um of amplitude at 100 Vpp and 300 Hz (section III-B)."""
    left, right = (
        ActuatorTable(
            side=side,
            x_mm=x_mm,
            diameter_mm=12.8,
            measured_displacement_um=2.6,
            measured_at_vpp=100.0,
            measured_at_hz=300.0,
        )
        for side, x_mm in _PAPER_PLACES_MM
    )
    return left, right


_PAPER_PLACES_MM: Final[tuple[tuple[Side, float], ...]] = (("left", -35.0), ("right", 35.0))
