"""The tables [strip] and [[actuator]] of study.toml: the plate and what moves it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, ClassVar, Final, Literal, Self, get_args

from pydantic import Field, model_validator

from experiment.study.sections.table import Above0, Table
from experiment.terms.checks import require_word
from stimuli.checks import finite

if TYPE_CHECKING:
    from stimuli import MeasuredDisplacement, PiezoLayers, Strip


Side = Literal["left", "right", "other"]
SIDES: Final[tuple[str, ...]] = get_args(Side)
Shape = Literal["disc", "rectangle", "motor"]

_NAME = re.compile(r"[A-Za-z0-9_-]{1,32}")
_ROUNDING_M = 1e-12
"""A patch as wide as the strip ends on its edges, but for the rounding of the sums."""
_MOST_FINGER_M = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuator:
    """A patch or a motor under the strip and the finger above it.

    Attributes
    ----------
    side : str
        ``left`` or ``right``, as the participant sees it; ``other`` is under neither finger.
    shape : str
        ``disc`` or ``rectangle``, a bonded patch, or ``motor``, which pushes over its contact.
    x_m : float
        Place of its centre along the strip, from the middle, positive to the right.
    y_m : float
        Place of its centre across the strip, from one edge.
    diameter_m : float or None
        Diameter of a disc, else none.
    length_x_m, length_y_m : float or None
        Sides of a rectangle or of a motor's contact along and across the strip, else none.
    name : str or None
        1 to 32 letters, digits, ``_`` or ``-``, where the side is ``other``; else none.
    finger_diameter_m : float
        Contact of the fingertip above it, up to 50 mm.
    basis : MeasuredDisplacement, PiezoLayers or None
        What is known of its displacement per volt.

    Raises
    ------
    ValueError
        If a word is unknown, a number is not finite, or the sizes are not those of the shape.

    Examples
    --------
    >>> Actuator(side="left", shape="disc", x_m=-0.25, y_m=0.5, diameter_m=0.5).span_x_m
    (-0.5, 0.0)
    """

    side: Side
    shape: Shape
    x_m: float
    y_m: float
    diameter_m: float | None = None
    length_x_m: float | None = None
    length_y_m: float | None = None
    name: str | None = None
    finger_diameter_m: float = 0.01
    basis: MeasuredDisplacement | PiezoLayers | None = None

    def __post_init__(self) -> None:
        require_word("side", self.side, SIDES)
        require_word("shape", self.shape, get_args(Shape))
        finite("x_m", self.x_m)
        finite("y_m", self.y_m)
        self._check_name()
        finite("finger_diameter_m", self.finger_diameter_m, above=0, most=_MOST_FINGER_M)
        rectangle_m = {"length_x_m": self.length_x_m, "length_y_m": self.length_y_m}
        disc_m = {"diameter_m": self.diameter_m}
        own_m, others_m = (disc_m, rectangle_m) if self.shape == "disc" else (rectangle_m, disc_m)
        for name, length_m in others_m.items():
            if length_m is not None:
                raise ValueError(f"{name} is no size of a {self.shape}; got {length_m!r}")
        for name, length_m in own_m.items():
            _require_size(name, length_m, self.shape)

    def _check_name(self) -> None:
        if (self.name is not None) != (self.side == "other"):
            raise ValueError(
                f"name must be given where side is other, and only there; got {self.name!r} where "
                f"side is {self.side}"
            )
        if self.name is not None and (not _NAME.fullmatch(self.name) or self.name in SIDES):
            raise ValueError(
                "name must be 1 to 32 of the characters A-Z a-z 0-9 _ - and no side; "
                f"got {self.name!r}"
            )

    @property
    def label(self) -> str:
        """What it is called: its side, or its name."""
        return self.name or self.side

    @property
    def span_x_m(self) -> tuple[float, float]:
        """Where the patch begins and ends along the strip."""
        return _span_m(self.x_m, self.diameter_m or self.length_x_m)

    @property
    def span_y_m(self) -> tuple[float, float]:
        """Where the patch begins and ends across the strip."""
        return _span_m(self.y_m, self.diameter_m or self.length_y_m)


def _require_size(name: str, length_m: float | None, shape: str) -> None:
    if length_m is None:
        raise ValueError(f"{name} is missing; a {shape} needs it")
    finite(name, length_m, above=0)


def _span_m(centre_m: float, length_m: float | None) -> tuple[float, float]:
    half_m = (length_m or 0.0) / 2
    return centre_m - half_m, centre_m + half_m


def check_actuators(actuators: tuple[Actuator, ...], strip: Strip) -> None:
    """Refuse patches that reach over the strip's edge or over each other.

    Parameters
    ----------
    actuators : tuple of Actuator
        Left, right, and any number of others.
    strip : Strip
        The strip that they lie on.

    Raises
    ------
    ValueError
        If one reaches over an edge or an end, the rectangles around two overlap, the left does not
        end before the right begins, a side is missing, or two others have the same name.
    """
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

EdgeBasis = Literal["simply-supported", "clamped", "elastic", "measured-cutoff"]
