"""The sections [strip] and [[actuator]] of study.toml: the plate and what moves it."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, get_args

from pydantic import Field, model_validator
from pydantic_core import ArgsKwargs

from experiment.study.sections.table import file_keys, refuse_incomplete, section
from experiment.terms.checks import NAME, NAME_RULE
from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    IdealEdge,
    Material,
    MeasuredDisplacement,
    PiezoLayers,
    Strip,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

Side = Literal["left", "right", "other"]
SIDES: Final[tuple[str, ...]] = get_args(Side)
Shape = Literal["disc", "rectangle", "motor"]
EdgeBasis = Literal["simply-supported", "clamped", "elastic", "measured-cutoff"]

PAPER_CUTOFF_HZ: Final = 2900.0
"""First cut-off measured on the paper's plate (figure 4)."""

_ROUNDING_M = 1e-12
"""A patch as wide as the strip ends on its edges, but for the rounding of the sums."""

# The widest ranges that the physics computes with, in the units of the file; see `stimuli`.
_Length = Annotated[float, Field(gt=1e-6, le=1e6)]
_Layer = Annotated[float, Field(gt=1e-6, le=100)]
_Modulus = Annotated[float, Field(ge=1e-12, le=1e6)]
_LayerRatio = Annotated[float, Field(ge=-0.999, le=0.5)]


@section
class Plate:
    """The plate, held along its two long edges."""

    width_mm: _Length = Field(default=25.0, description="between the held edges")
    length_mm: _Length | Literal["endless"] = Field(default=200.0, description='or "endless"')
    thickness_mm: _Length = 0.5
    youngs_modulus_gpa: _Modulus = Field(default=67.0, description="aluminium")
    poisson_ratio: float = Field(default=0.346, ge=-0.999, lt=0.5)
    density_kg_m3: float = Field(default=2700.0, ge=1e-3, le=1e6)
    loss_factor: float = Field(
        default=0.0, ge=0, le=1e3, description="constant (hysteretic) loss; 0: not known"
    )
    viscous_time_us: float = Field(
        default=0.0, ge=0, le=1e9, description="Kelvin-Voigt loss; both add"
    )
    edge_loss: Literal["none", "plate"] = Field(
        default="none", description="of an elastic edge: none, or the plate's"
    )
    edge: EdgeBasis = "measured-cutoff"
    measured_cutoff_hz: float | None = Field(
        default=None, gt=0, description="first cut-off as measured; with edge = measured-cutoff"
    )
    edge_stiffness_n: float | None = Field(
        default=None, gt=0, description="N m per rad per m of edge; with edge = elastic"
    )

    @model_validator(mode="before")
    @classmethod
    def _know_the_papers_plate(cls, given: Any) -> Any:
        """Fill in the measured cut-off of the one plate whose cut-off is known."""
        if not isinstance(given, ArgsKwargs):
            return given
        keys = dict(given.kwargs or {})
        fields = file_keys(cls)
        if keys.get("measured_cutoff_hz") is None and all(
            keys.get(key, fields[key].default) == fields[key].default for key in _OF_THE_CUTOFF
        ):
            keys["measured_cutoff_hz"] = PAPER_CUTOFF_HZ
        return ArgsKwargs((), keys)

    def __post_init__(self) -> None:
        keys = {"measured-cutoff": "measured_cutoff_hz", "elastic": "edge_stiffness_n"}
        for edge, key in keys.items():
            given = getattr(self, key)
            if self.edge == edge and given is None:
                raise ValueError(f"{key} is missing; edge = {edge} needs it")
            if self.edge != edge and given is not None:
                raise ValueError(f"{key} is for edge = {edge} only; got edge = {self.edge}")
        self.strip  # noqa: B018 - not every plate can have every cut-off

    @property
    def is_loss_stated(self) -> bool:
        """Whether the study says what loss the plate has; without ends it may have none."""
        return self.length_mm == "endless" or self.loss_factor > 0 or self.viscous_time_us > 0

    @cached_property
    def strip(self) -> Strip:
        """The strip as the physics has it."""
        strip = Strip(
            width_m=self.width_mm / 1e3,
            length_m=None if self.length_mm == "endless" else self.length_mm / 1e3,
            thickness_m=self.thickness_mm / 1e3,
            material=Material(
                youngs_modulus_pa=self.youngs_modulus_gpa * 1e9,
                poisson_ratio=self.poisson_ratio,
                density_kg_m3=self.density_kg_m3,
                loss_factor=self.loss_factor,
                viscous_time_s=self.viscous_time_us / 1e6,
            ),
            edge=self._edge(),
        )
        if self.measured_cutoff_hz is None:
            return strip
        try:
            strip = strip.with_cutoff(self.measured_cutoff_hz)
        except ValueError as error:
            # the physics calls it frequency_hz, its first word; the file's key is another
            told = str(error).split(" ", maxsplit=1)[-1]
            raise ValueError(f"measured_cutoff_hz {told}") from error
        if isinstance(strip.edge, ElasticEdge):
            strip = replace(strip, edge=replace(strip.edge, lossless=self.edge_loss == "none"))
        return strip

    def _edge(self) -> IdealEdge | ElasticEdge:
        if self.edge_stiffness_n is not None:
            return ElasticEdge(stiffness_n=self.edge_stiffness_n, lossless=self.edge_loss == "none")
        return SIMPLY_SUPPORTED if self.edge == "simply-supported" else CLAMPED


_OF_THE_CUTOFF: Final = (
    "width_mm",
    "thickness_mm",
    "youngs_modulus_gpa",
    "poisson_ratio",
    "density_kg_m3",
    "edge",
    "edge_stiffness_n",
)
"""What a plate must have from the paper's for its cut-off to be the one that the paper measured."""

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


@section
class Actuator:
    """A patch or a motor under the strip, and the finger above it.

    One is left, one is right; those that are never driven in a session are other.
    """

    side: Side = Field(description="as the participant sees it")
    name: str | None = Field(default=None, description="of one whose side is other")
    shape: Shape = Field(default="disc", description="motor: over its contact")
    x_mm: float = Field(description="centre along the strip, from its middle, right positive")
    y_mm: float = Field(description="centre across, from one edge; default the middle")
    diameter_mm: float | None = Field(default=None, gt=0, description="of a disc")
    length_x_mm: float | None = Field(
        default=None, gt=0, description="of a rectangle or motor, along the strip"
    )
    length_y_mm: float | None = Field(
        default=None, gt=0, description="of a rectangle or motor, across the strip"
    )
    finger_diameter_mm: float = Field(
        default=10.0, gt=0, le=50, description="contact of the fingertip above it"
    )
    measured_displacement_um: float | None = Field(
        default=None, gt=0, le=1e6, description="amplitude at its centre, as measured"
    )
    measured_at_vpp: float | None = Field(
        default=None, gt=0, le=1e5, description="... with a sine of this level"
    )
    measured_at_hz: float | None = Field(
        default=None, gt=0, le=1e6, description="... and of this frequency"
    )
    piezo_thickness_mm: _Layer | None = Field(
        default=None, description="or its layers: displacements are predicted"
    )
    piezo_youngs_modulus_gpa: _Modulus | None = Field(default=None, description="1 / s11E")
    piezo_poisson_ratio: _LayerRatio | None = Field(default=None, description="-s12E / s11E")
    piezo_d31_pm_v: float | None = Field(
        default=None, ge=-1e6, le=1e6, description="strain per field in its plane"
    )
    carrier_thickness_mm: float | None = Field(
        default=None, gt=0, le=100, description="metal between piezo and plate, if any"
    )
    carrier_youngs_modulus_gpa: _Modulus | None = None
    carrier_poisson_ratio: _LayerRatio | None = None

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
                f"name must be given where side is other, and only there; got {self.name!r} where "
                f"side is {self.side}"
            )
        if self.name is not None and (not NAME.fullmatch(self.name) or self.name in SIDES):
            raise ValueError(f"name must be {NAME_RULE} and no side; got {self.name!r}")

    def _check_basis(self) -> None:
        """Refuse half a basis, two, or one that the shape cannot have."""
        basis = refuse_incomplete(self, MEASURED_KEYS, PIEZO_KEYS)
        carrier = refuse_incomplete(self, CARRIER_KEYS)
        if carrier is not None and basis != PIEZO_KEYS[0]:
            raise ValueError(f"{PIEZO_KEYS[0]} is missing; {carrier} needs it")
        if self.shape == "motor" and basis == PIEZO_KEYS[0]:
            raise ValueError(f"{basis} is for patches only; got shape = motor")
        if self.piezo_d31_pm_v == 0:
            raise ValueError("piezo_d31_pm_v must not be 0; got 0")

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
            return MeasuredDisplacement(
                displacement_m=displacement_um / 1e6, level_vpp=level_vpp, frequency_hz=frequency_hz
            )
        if self.piezo_thickness_mm is None:
            return None
        thickness_mm, modulus_gpa, poisson_ratio, d31_pm_v = self._given(PIEZO_KEYS)
        layers = PiezoLayers(
            thickness_m=thickness_mm / 1e3,
            youngs_modulus_pa=modulus_gpa * 1e9,
            poisson_ratio=poisson_ratio,
            d31_m_v=d31_pm_v / 1e12,
        )
        if self.carrier_thickness_mm is None:
            return layers
        carrier_mm, carrier_gpa, carrier_ratio = self._given(CARRIER_KEYS)
        return replace(
            layers,
            carrier_thickness_m=carrier_mm / 1e3,
            carrier_youngs_modulus_pa=carrier_gpa * 1e9,
            carrier_poisson_ratio=carrier_ratio,
        )

    def _given(self, keys: Iterable[str]) -> list[float]:
        return [getattr(self, key) for key in keys]


def _span_m(centre_m: float, length_m: float | None) -> tuple[float, float]:
    half_m = (length_m or 0.0) / 2
    return centre_m - half_m, centre_m + half_m


def check_actuators(actuators: tuple[Actuator, ...], strip: Strip) -> None:
    """Refuse a missing side, patches over an edge of the strip, and patches over each other."""
    sides = [actuator.side for actuator in actuators]
    if sides[:2] != ["left", "right"] or set(sides[2:]) - {"other"}:
        raise ValueError(
            "actuator sides must be left and right, each once, and other for more; "
            f"got {', '.join(sides)}"
        )
    names = [actuator.name for actuator in actuators[2:]]
    if len(set(names)) != len(names):
        raise ValueError(f"actuator names must be distinct; got {', '.join(map(str, names))}")
    left, right, *_ = actuators
    for actuator in actuators:
        _check_span(actuator, "y_m", actuator.span_y_m, (0.0, strip.width_m))
        if strip.length_m is not None:
            limits_m = (-strip.length_m / 2, strip.length_m / 2)
            _check_span(actuator, "x_m", actuator.span_x_m, limits_m)
    if left.span_x_m[1] > right.span_x_m[0]:
        raise ValueError(
            "the left actuator must end, along the strip, before the right one begins at "
            f"{_mm(right.span_x_m[0])}; got an end at {_mm(left.span_x_m[1])}"
        )
    for one, two in combinations(actuators, 2):
        if _overlap(one.span_x_m, two.span_x_m) and _overlap(one.span_y_m, two.span_y_m):
            raise ValueError(
                f"the actuators {one.label} and {two.label} must not overlap; got centres at "
                f"x = {_mm(one.x_m)} and {_mm(two.x_m)}"
            )


def _overlap(one_m: tuple[float, float], two_m: tuple[float, float]) -> bool:
    """Tell whether two spans have more than an end in common."""
    return min(one_m[1], two_m[1]) - max(one_m[0], two_m[0]) > _ROUNDING_M


def _check_span(
    actuator: Actuator, axis: str, span_m: tuple[float, float], limits_m: tuple[float, float]
) -> None:
    if span_m[0] < limits_m[0] - _ROUNDING_M or span_m[1] > limits_m[1] + _ROUNDING_M:
        raise ValueError(
            f"the {actuator.label} actuator must lie on the strip, which goes from "
            f"{axis[0]} = {_mm(limits_m[0])} to {_mm(limits_m[1])}; "
            f"got a {actuator.shape} from {_mm(span_m[0])} to {_mm(span_m[1])}"
        )


def _mm(length_m: float) -> str:
    return f"{length_m * 1e3:.6g} mm"


def paper_actuators() -> list[dict[str, Any]]:
    """Return the paper's discs: 2.6 um of amplitude at 100 Vpp and 300 Hz (section III-B)."""
    return [
        {
            "side": side,
            "x_mm": x_mm,
            "diameter_mm": 12.8,
            "measured_displacement_um": 2.6,
            "measured_at_vpp": 100.0,
            "measured_at_hz": 300.0,
        }
        for side, x_mm in (("left", -35.0), ("right", 35.0))
    ]
