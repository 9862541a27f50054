"""The sections [[actuator]] of study.toml: what moves the plate, and what is known of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, get_args

from pydantic import Field, model_validator
from pydantic_core import ArgsKwargs

from experiment.names import NAME, NAME_RULE
from experiment.study.base import (
    Table,
    filled,
    is_left_as_it_was,
    refuse_below,
    refuse_incomplete,
    section,
)
from experiment.study.plate import (
    PAPER_CUTOFF_HZ,
    PAPER_LENGTH_MM,
    PAPER_SIZES,
    Day,
    Density,
    Line,
    Modulus,
    Plate,
    dated,
    refuse_orphans,
)
from stimuli import BondedPatch, MeasuredDisplacement, PiezoLayers

if TYPE_CHECKING:
    from collections.abc import Iterable

Side = Literal["left", "right", "other"]
SIDES: Final[tuple[str, ...]] = get_args(Side)
Shape = Literal["disc", "rectangle", "motor"]

# Discs of piezo begin at some millimetres, contacts of motors at tenths, layers at films of 5 um.
_Layer = Annotated[float, Field(ge=0.005, le=20)]
_Micrometres = Annotated[float, Field(ge=1e-4, le=5000)]
_Diameter = Annotated[float, Field(ge=0.5, le=1000)]
_Side = Annotated[float, Field(ge=0.2, le=1000)]
_Place = Annotated[float, Field(ge=-5000, le=5000)]
_LayerRatio = Annotated[float, Field(ge=-0.999, le=0.5)]

_LEAST_D31_PM_V: Final = 0.5
"""Quartz has about 2, films of polymer 20, ceramics 100 to 300."""

LEAST_FINGER_MM: Final = 1.0
_ALIKE: Final = {"as-left": "left", "as-right": "right"}

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
PATCH_KEYS: Final = (*PIEZO_KEYS[:-1], "piezo_density_kg_m3")
"""What a patch has to have to stiffen and load the plate; and a carrier, if there is one:"""

CARRIER_PATCH_KEYS: Final = (*CARRIER_KEYS, "carrier_density_kg_m3")
_SIZES: Final[dict[Shape, tuple[str, ...]]] = {
    "disc": ("diameter_mm",),
    "rectangle": ("length_x_mm", "length_y_mm"),
    "motor": ("length_x_mm", "length_y_mm"),
}


@section
class Actuator:
    """A patch or a motor under the strip, and the finger above it.

    One is left, one is right; those that are never driven in a session are other.
    """

    side: Side = Field(description="as the participant sees it")
    name: str | None = Field(default=None, description="of one whose side is other")
    shape: Shape = Field(default="disc", description="motor: over its contact")
    x_mm: _Place = Field(description="centre along the strip, from its middle, right positive")
    y_mm: _Place = Field(description="centre across, from one edge; default the middle")
    diameter_mm: _Diameter | None = Field(
        default=None, description="of a disc: of its ceramic's electrode, not the metal"
    )
    length_x_mm: _Side | None = Field(
        default=None, description="of a rectangle or motor, along the strip"
    )
    length_y_mm: _Side | None = Field(
        default=None, description="of a rectangle or motor, across the strip"
    )
    finger_diameter_mm: float = Field(
        default=10.0, ge=LEAST_FINGER_MM, le=50, description="contact of the fingertip above it"
    )
    measured_displacement_um: _Micrometres | None = Field(
        default=None, description="at its centre, as measured, no finger on the plate"
    )
    measured_as: Literal["peak", "peak-to-peak", "as-left", "as-right"] | None = Field(
        default=None,
        description="peak is the amplitude, and assumed without it; as-left or as-right: not "
        "measured, assumed equal to the like actuator there",
    )
    measured_at_vpp: float | None = Field(
        default=None, ge=1e-3, le=1000, description="... with a sine or burst of this level"
    )
    measured_at_hz: float | None = Field(
        default=None, ge=1, le=1e5, description="... and this frequency, well below the cut-off"
    )
    measured_by: Line | None = Field(default=None, description="... by whom")
    measured_on: Day | None = Field(default=None, description="... and when")
    piezo_thickness_mm: _Layer | None = Field(
        default=None, description="or its layers: displacements are predicted"
    )
    piezo_youngs_modulus_gpa: Modulus | None = Field(default=None, description="1 / s11E")
    piezo_poisson_ratio: _LayerRatio | None = Field(default=None, description="-s12E / s11E")
    piezo_d31_pm_v: float | None = Field(
        default=None, ge=-5000, le=5000, description="strain per field in its plane"
    )
    carrier_thickness_mm: _Layer | None = Field(
        default=None, description="metal between piezo and plate, if any"
    )
    carrier_youngs_modulus_gpa: Modulus | None = Field(default=None, description="of that metal")
    carrier_poisson_ratio: _LayerRatio | None = Field(default=None, description="of that metal")
    patch_counts: bool = Field(
        default=False, description="its layers stiffen and load the plate, which must have ends"
    )
    piezo_density_kg_m3: Density | None = Field(default=None, description="with patch_counts")
    carrier_density_kg_m3: Density | None = Field(default=None, description="with patch_counts")

    @model_validator(mode="before")
    @classmethod
    def _date(cls, given: Any) -> Any:
        return ArgsKwargs((), dated(given.kwargs)) if isinstance(given, ArgsKwargs) else given

    def __post_init__(self) -> None:
        self._check_name()
        for key in ("diameter_mm", "length_x_mm", "length_y_mm"):
            given = getattr(self, key) is not None
            if given and key not in _SIZES[self.shape]:
                shapes = " or ".join(shape for shape, keys in _SIZES.items() if key in keys)
                raise ValueError(f"{key} is for shape = {shapes} only; got shape = {self.shape}")
            if not given and key in _SIZES[self.shape]:
                raise ValueError(f"{key} is missing; got shape = {self.shape}")
        self._check_basis()

    def _check_name(self) -> None:
        if (self.name is not None) != (self.side == "other"):
            raise ValueError(
                f"name must be given where side is other, and only there; got "
                f"{self.name or 'none'} where side is {self.side}"
            )
        if self.name is not None and (not NAME.fullmatch(self.name) or self.name in SIDES):
            raise ValueError(f"name must be {NAME_RULE} and no side; got {self.name!r}")

    def _check_basis(self) -> None:
        """Refuse half a basis, two, or one that the shape cannot have."""
        self._check_patch()
        piezo = tuple(sorted(PIEZO_KEYS)) if self.patch_counts else PIEZO_KEYS  # d31, its only one
        as_patch = self.patch_counts and self.piezo_d31_pm_v is None
        basis = refuse_incomplete(self, MEASURED_KEYS, *([] if as_patch else [piezo]))
        refuse_orphans(self, MEASURED_KEYS[0])
        if self.measured_as is not None and self.measured_displacement_um is None:
            raise ValueError(f"{MEASURED_KEYS[0]} is missing; measured_as needs it")
        carrier = refuse_incomplete(self, CARRIER_KEYS)
        if carrier is not None and self.piezo_thickness_mm is None:
            raise ValueError(f"{PIEZO_KEYS[0]} is missing; {carrier} needs it")
        if self.shape == "motor" and basis == PIEZO_KEYS[0]:
            raise ValueError(f"{basis} is for patches only; got shape = motor")
        if self.piezo_d31_pm_v == 0:
            raise ValueError("piezo_d31_pm_v must not be 0; got 0")
        refuse_below(self, "piezo_d31_pm_v", _LEAST_D31_PM_V, "or its negative")

    def _check_patch(self) -> None:
        """Refuse a patch that counts without its layers, and what only such a patch has."""
        densities = (PATCH_KEYS[-1], CARRIER_PATCH_KEYS[-1])
        if not self.patch_counts:
            given = [key for key in densities if getattr(self, key) is not None]
            if given:
                raise ValueError(f"patch_counts = true is missing; {given[0]} needs it")
            return
        if self.shape == "motor":
            raise ValueError("patch_counts is for patches only; got shape = motor")
        missing = [key for key in PATCH_KEYS if getattr(self, key) is None]
        if missing:
            raise ValueError(f"{missing[0]} is missing; patch_counts needs it")
        refuse_incomplete(self, CARRIER_PATCH_KEYS)

    @property
    def is_the_papers(self) -> bool:
        """Whether it is a disc of the paper, where it was, with what the paper measured of it."""
        return (
            self.measured_by is None
            and self.measured_as in {None, "peak"}
            and any(
                all(getattr(self, key) == value for key, value in disc.items())
                for disc in paper_actuators()
            )
        )

    @property
    def alike(self) -> str | None:
        """The side of the actuator whose displacement is assumed of it, which was not measured."""
        return _ALIKE.get(self.measured_as or "")

    @property
    def label(self) -> str:
        """What it is called: its side, or its name."""
        return self.name or self.side

    @property
    def x_m(self) -> float:
        """Place of its centre along the strip, from the middle, positive to the right."""
        return self.x_mm / 1e3

    @property
    def y_m(self) -> float:
        """Place of its centre across the strip, from one edge."""
        return self.y_mm / 1e3

    @property
    def diameter_m(self) -> float | None:
        """Diameter of a disc, else none."""
        return None if self.diameter_mm is None else self.diameter_mm / 1e3

    @property
    def length_x_m(self) -> float | None:
        """Side of a rectangle or of a motor's contact along the strip, else none."""
        return None if self.length_x_mm is None else self.length_x_mm / 1e3

    @property
    def length_y_m(self) -> float | None:
        """Side of a rectangle or of a motor's contact across the strip, else none."""
        return None if self.length_y_mm is None else self.length_y_mm / 1e3

    @property
    def finger_diameter_m(self) -> float:
        """Contact of the fingertip above it."""
        return self.finger_diameter_mm / 1e3

    @property
    def span_x_m(self) -> tuple[float, float]:
        """Where the patch begins and ends along the strip."""
        return _span_m(self.x_m, self.diameter_m or self.length_x_m)

    @property
    def span_y_m(self) -> tuple[float, float]:
        """Where the patch begins and ends across the strip."""
        return _span_m(self.y_m, self.diameter_m or self.length_y_m)

    @cached_property
    def basis(self) -> MeasuredDisplacement | PiezoLayers | None:
        """What is known of its displacement per volt."""
        if self.measured_displacement_um is not None:
            displacement_um, level_vpp, frequency_hz = self._given(MEASURED_KEYS)
            amplitude_um = displacement_um / (2 if self.measured_as == "peak-to-peak" else 1)
            return MeasuredDisplacement(
                displacement_m=amplitude_um / 1e6, level_vpp=level_vpp, frequency_hz=frequency_hz
            )
        if self.piezo_d31_pm_v is None:
            return None
        return replace(self._layers, d31_m_v=self.piezo_d31_pm_v / 1e12)

    @property
    def patch(self) -> BondedPatch | None:
        """What stiffens and loads the plate, if it counts."""
        if not self.patch_counts:
            return None
        return BondedPatch(
            x_m=self.x_m,
            y_m=self.y_m,
            length_x_m=self.diameter_m or self.length_x_m or 0.0,
            length_y_m=self.diameter_m or self.length_y_m or 0.0,
            layers=self._layers.layers,
            is_disc=self.shape == "disc",
        )

    @property
    def _layers(self) -> PiezoLayers:
        """The layers, with a piezo that strains by 1 m/m in a field of 1 MV/m."""
        thickness_mm, modulus_gpa, poisson_ratio = self._given(PIEZO_KEYS[:-1])
        layers = PiezoLayers(
            thickness_m=thickness_mm / 1e3,
            youngs_modulus_pa=modulus_gpa * 1e9,
            poisson_ratio=poisson_ratio,
            d31_m_v=1e-6,
            density_kg_m3=self.piezo_density_kg_m3 or 0.0,
        )
        if self.carrier_thickness_mm is None:
            return layers
        carrier_mm, carrier_gpa, carrier_ratio = self._given(CARRIER_KEYS)
        return replace(
            layers,
            carrier_thickness_m=carrier_mm / 1e3,
            carrier_youngs_modulus_pa=carrier_gpa * 1e9,
            carrier_poisson_ratio=carrier_ratio,
            carrier_density_kg_m3=self.carrier_density_kg_m3 or 0.0,
        )

    def _given(self, keys: Iterable[str]) -> list[float]:
        return [getattr(self, key) for key in keys]


def _span_m(centre_m: float, length_m: float | None) -> tuple[float, float]:
    half_m = (length_m or 0.0) / 2
    return centre_m - half_m, centre_m + half_m


def displacements_are_known(actuators: tuple[Actuator, ...]) -> bool:
    """Tell whether the two actuators under the fingers have a basis each."""
    return all(one.basis is not None for one in actuators if one.side != "other")


_PAPER_MEASURED: Final = dict(zip(MEASURED_KEYS, (2.6, 100.0, 300.0), strict=True))
"""Amplitude of the paper's discs (section III-B), on its own plate."""


def paper_actuators(*, measured: bool = True) -> list[dict[str, Any]]:
    """Return the paper's discs; where they are measured with 2.6 um at 100 Vpp and 300 Hz."""
    return [
        Table(
            {"side": side, "x_mm": x_mm, "diameter_mm": 12.8}
            | (_PAPER_MEASURED if measured else {})
        )
        for side, x_mm in (("left", -35.0), ("right", 35.0))
    ]


def filled_in(tables: list[Any], width_mm: float) -> list[Any]:
    """Put every actuator that is nowhere else across the middle; fill in what is assumed alike."""
    if not all(isinstance(table, dict) for table in tables):
        return tables
    of_side, found = {one.get("side"): one for one in tables}, []
    for table in tables:
        own = {"y_mm": width_mm / 2} if table.get("y_mm") is None else {}
        other = of_side.get(_ALIKE.get(str(table.get("measured_as")), ""), {})
        keys = {key: other.get(key) for key in MEASURED_KEYS if table.get(key) is None}
        um = keys.get(MEASURED_KEYS[0])
        if other.get("measured_as") == "peak-to-peak" and isinstance(um, int | float):
            keys[MEASURED_KEYS[0]] = um / 2
        found.append(filled(table, **own, **(keys if other else {})) if own or other else table)
    return found


def _check_alike(actuators: tuple[Actuator, ...]) -> None:
    """Refuse a displacement that is assumed of another actuator than one measured and like it."""
    for place, one in enumerate(actuators):
        if one.alike is None:
            continue
        other = next(two for two in actuators if two.side == one.alike)
        named = f"actuator[{place}].measured_as = {one.measured_as}"
        if other.alike is not None:
            raise ValueError(f"{named} needs what was measured of the {one.alike} actuator itself")
        sizes = ("shape", *_SIZES["disc"], *_SIZES["rectangle"])
        if any(getattr(one, key) != getattr(other, key) for key in sizes):
            raise ValueError(f"{named} needs actuators of the same shape and size")
        if one.basis != other.basis or one.measured_by or one.measured_on:
            raise ValueError(
                f"{named}: leave out {', '.join(MEASURED_KEYS)}, measured_by and measured_on, "
                f"which are the {one.alike} actuator's"
            )


def check_measured(plate: Plate, actuators: tuple[Actuator, ...]) -> None:
    """Ask for what was measured on this plate where the paper's numbers are on another one."""
    _check_alike(actuators)
    if plate.is_as_measured:
        return
    sizes = " and ".join(f"{key} = {mm:g}" for key, mm in PAPER_SIZES.items())
    own = f"is the paper's, of its own plate of {sizes}, of aluminium"
    if plate.is_the_papers:
        own = (
            f"is the paper's, of its own plate of length_mm = {PAPER_LENGTH_MM:g} and "
            f"measured_cutoff_hz = {PAPER_CUTOFF_HZ:g}"
        )
    elif _is_nobodys(plate, "measured_cutoff_hz"):
        raise ValueError(
            f"strip.measured_cutoff_hz = {PAPER_CUTOFF_HZ:g} {own}: leave it out with edge = "
            "clamped or simply-supported, or state yours with measured_by"
        )
    for place, actuator in enumerate(actuators):
        papers = plate.is_the_papers and actuator.is_the_papers
        if papers or (actuator.alike is None and _is_nobodys(actuator, MEASURED_KEYS[0])):
            raise ValueError(
                f"actuator[{place}].{MEASURED_KEYS[0]} {own}: leave {', '.join(MEASURED_KEYS)} "
                "out, or state yours with measured_by"
            )


def _is_nobodys(measured: Plate | Actuator, key: str) -> bool:
    """Tell whether a measured value is the paper's that `tactstrip init` wrote, and no lab's."""
    is_given = getattr(measured, key) is not None
    return is_given and measured.measured_by is None and is_left_as_it_was(measured, key)
