"""The section [strip] of study.toml: the plate, and which of them is the paper's."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from functools import cached_property
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import ArgsKwargs, PydanticCustomError

from experiment.names import inward, is_line, require_known
from experiment.study.base import (
    ASKED_FOR,
    limits_of,
    refuse_below,
    section,
)
from stimuli import (
    ALUMINIUM,
    CLAMPED,
    MATERIALS,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    IdealEdge,
    Material,
    Strip,
)

_MaterialName = Literal[
    "aluminium",
    "steel",
    "stainless",
    "brass",
    "copper",
    "titanium",
    "glass",
    "borosilicate",
    "pmma",
    "polycarbonate",
]
EdgeBasis = Literal["simply-supported", "clamped", "elastic", "measured-cutoff"]

# What the paper states belongs to its plate: 25 x 0.5 mm of its aluminium. A study whose plate has
# that width, that thickness and no other material has the paper's material and discs where it
# states none, whatever its loss and its edges, and its length; the first cut-off only with edges
# that are not said to be others, and what its discs do only with its length and its first cut-off,
# as they were measured. Of any other plate nothing is known but what its study says.
PAPER_CUTOFF_HZ: Final = 2900.0
"""First cut-off measured on the paper's plate (figure 4)."""

PAPER_LENGTH_MM: Final = 200.0
PAPER_SIZES: Final = {"width_mm": 25.0, "thickness_mm": 0.5}
_PAPER_MATERIAL: Final = {
    "youngs_modulus_gpa": ALUMINIUM.youngs_modulus_pa / 1e9,
    "poisson_ratio": ALUMINIUM.poisson_ratio,
    "density_kg_m3": ALUMINIUM.density_kg_m3,
}


def is_papers_plate(keys: dict[str, Any]) -> bool:
    """Tell whether the keys of [strip] are those of the paper's plate; what is no number may be."""
    papers = PAPER_SIZES | _PAPER_MATERIAL
    return keys.get("material") is None and all(
        keys.get(key, papers[key]) == papers[key]
        for key in papers
        if isinstance(keys.get(key), int | float)
    )


def is_as_measured(keys: dict[str, Any]) -> bool:
    """Tell whether these are the keys of the paper's plate as its discs were measured on it."""
    as_measured: dict[str, tuple[Any, ...]] = {
        "edge": ("measured-cutoff",),
        "length_mm": (PAPER_LENGTH_MM, "endless"),  # the same plate, its ends left out
        "measured_cutoff_hz": (PAPER_CUTOFF_HZ, None),
    }
    return is_papers_plate(keys) and all(
        keys.get(key, values[0]) in values for key, values in as_measured.items()
    )


def _is_a_plate(thickness: float, width: float) -> bool:
    return thickness <= width / 2


def one_line(text: str) -> str:
    """Return a text, or refuse it where it is more than a line or nothing to read."""
    if not is_line(text):
        raise ValueError(f"must be text in one line; got {text!r}")
    return text


_EARTH_AHEAD: Final = timedelta(hours=14)


def day(text: str) -> str:
    """Return a day as year-month-day, or refuse it where it is none or still to come.

    It is today as soon as it is anywhere, so that a study is read alike in all time zones.
    """
    try:
        given = date.fromisoformat(text)
    except ValueError:
        given = None
    today = (datetime.now(UTC) + _EARTH_AHEAD).date()
    if given is None or given.isoformat() != text or given > today:
        raise ValueError(
            f"must be a day as year-month-day, such as 2026-05-04, and none to come; got {text!r}"
        )
    return text


def dated(keys: dict[str, Any] | None) -> dict[str, Any]:
    """Return keys with a day as text: TOML has a type for it, JSON has none."""
    found = dict(keys or {})
    if isinstance(found.get("measured_on"), date):
        found["measured_on"] = found["measured_on"].isoformat()
    return found


def refuse_orphans(values: object, measured: str) -> None:
    """Refuse to be told by whom and when nothing was measured."""
    for key in ("measured_by", "measured_on"):
        if getattr(values, key) is not None and getattr(values, measured) is None:
            raise ValueError(f"{measured} is missing; {key} needs it")


# Ranges hold every plate on which two fingers can lie, and are so narrow that a number in another
# unit falls out: metres for millimetres, pascals or megapascals for gigapascals, g/cm3, kilohertz,
# per cent. Two fingertips need 20 mm; a foil is 0.02 mm thick, balsa weighs 100 kg/m3, osmium
# 22 600, and diamond has 1200 GPa. Bare metal loses 1e-4 of its energy, what damps best about half.
Line = Annotated[str, AfterValidator(one_line)]
Day = Annotated[str, AfterValidator(day)]
Modulus = Annotated[float, Field(ge=1e-3, le=1500)]
Density = Annotated[float, Field(ge=30, le=25_000)]
_WITH_SPRINGS: Final = ("elastic", "measured-cutoff")
_LEAST_LOSS: Final = {"loss_factor": 1e-4, "viscous_time_us": 0.01}
"""Less would be a slip that counts as a stated loss; at 1 kHz both are about the same."""


@section
class Plate:
    """The plate, held along its two long edges."""

    width_mm: float = Field(default=25.0, ge=2, le=1000, description="between the held edges")
    length_mm: Annotated[float, Field(ge=20, le=10_000)] | Literal["endless"] | None = Field(
        default=None, description='or "endless"; of the paper\'s plate 200'
    )
    thickness_mm: float = Field(default=0.5, ge=0.02, le=50, description="of the bare plate")
    material: _MaterialName | None = Field(
        default=None, description="a name, or in its place the next three keys"
    )
    youngs_modulus_gpa: Modulus | None = Field(
        default=None, description="of another material: write all three, and no line material"
    )
    poisson_ratio: float | None = Field(
        default=None, ge=-0.999, lt=0.5, description="of that material"
    )
    density_kg_m3: Density | None = Field(default=None, description="of that material")
    loss_factor: float = Field(
        default=0.0, ge=0, lt=0.5, description="constant (hysteretic) loss; 0: not known"
    )
    viscous_time_us: float = Field(
        default=0.0, ge=0, le=100, description="Kelvin-Voigt loss; both add"
    )
    edge_loss: Literal["none", "plate"] = Field(
        default="none", description="of an elastic edge: none, or the plate's"
    )
    edge: EdgeBasis = Field(default="measured-cutoff", description="how the long edges are held")
    measured_cutoff_hz: float | None = Field(
        default=None,
        ge=20,
        le=200_000,
        description="first cut-off; with another edge a record to compare",
    )
    measured_by: Line | None = Field(default=None, description="who measured the cut-off")
    measured_on: Day | None = Field(default=None, description="and when, such as 2026-05-04")
    edge_stiffness_n: float | None = Field(
        default=None,
        ge=1e-3,
        le=1e7,
        description="N m per rad per m of edge; with edge = elastic",
    )

    @model_validator(mode="before")
    @classmethod
    def _know_the_papers_plate(cls, given: Any) -> Any:
        """Fill in material and measured cut-off of the one plate whose are known."""
        if not isinstance(given, ArgsKwargs):
            return given
        keys = dated(given.kwargs)
        if isinstance(keys.get("material"), str):
            require_known("material", keys["material"], MATERIALS)
        if is_papers_plate(keys):
            for key, value in (_PAPER_MATERIAL | {"length_mm": PAPER_LENGTH_MM}).items():
                keys[key] = value if keys.get(key) is None else keys[key]
            edge = keys.get("edge", "measured-cutoff")
            if edge == "measured-cutoff" and keys.get("measured_cutoff_hz") is None:
                keys["measured_cutoff_hz"] = PAPER_CUTOFF_HZ
        return ArgsKwargs((), keys)

    def __post_init__(self) -> None:
        self._check_material()
        if not _is_a_plate(self.thickness_mm, self.width_mm):
            raise ValueError(
                f"thickness_mm must be at most half of width_mm = {self.width_mm:g}, or it is no "
                f"plate; got {self.thickness_mm:g}: are the two swapped?"
            )
        for key, least in _LEAST_LOSS.items():
            refuse_below(self, key, least, "or 0 where it is not known")
        if self.edge == "elastic" and self.edge_stiffness_n is None:
            raise ValueError("edge_stiffness_n is missing; edge = elastic needs it")
        if self.edge != "elastic" and self.edge_stiffness_n is not None:
            raise ValueError(f"edge_stiffness_n is for edge = elastic only; got edge = {self.edge}")
        if self.edge_loss == "plate" and self.edge not in _WITH_SPRINGS:
            raise ValueError(
                f"edge_loss is for edge = {' or '.join(_WITH_SPRINGS)} only, whose springs can "
                f"have a loss; got edge_loss = plate with edge = {self.edge}"
            )
        refuse_orphans(self, "measured_cutoff_hz")
        self.strip  # noqa: B018 - not every plate can have every cut-off

    def _check_material(self) -> None:
        """Refuse two statements of the material, and ask for what the plate is not known by."""
        stated = [key for key in _PAPER_MATERIAL if getattr(self, key) is not None]
        if self.material is not None and stated:
            raise ValueError(f"material and {stated[0]} exclude each other; got both")
        missing = []
        if self.material is None and not stated:
            *some, last = _PAPER_MATERIAL
            missing = [f"material (or {', '.join(some)} and {last})"]
        elif self.material is None:
            missing = [key for key in _PAPER_MATERIAL if key not in stated]
        if self.edge == "measured-cutoff" and self.measured_cutoff_hz is None:
            missing.append("measured_cutoff_hz (or another edge)")
        if self.length_mm is None:
            missing.append('length_mm (or "endless")')
        if missing:
            told = ", ".join(missing)
            raise PydanticCustomError(
                ASKED_FOR, f"strip needs {told}, as it is not the paper's plate"
            )

    @property
    def is_the_papers(self) -> bool:
        """Whether width, thickness and material are those of the paper's plate."""
        return is_papers_plate(vars(self))

    @property
    def is_as_measured(self) -> bool:
        """Whether it has the length and the cut-off, too, with which the paper measured it."""
        return is_as_measured(vars(self))

    @property
    def is_loss_stated(self) -> bool:
        """Whether the study says what loss the plate has; without ends it may have none."""
        return self.length_mm == "endless" or self.loss_factor > 0 or self.viscous_time_us > 0

    @cached_property
    def strip(self) -> Strip:
        """The strip as the physics has it."""
        strip = Strip(
            width_m=self.width_mm / 1e3,
            length_m=self.length_mm / 1e3 if isinstance(self.length_mm, float | int) else None,
            thickness_m=self.thickness_mm / 1e3,
            material=self._material(),
            edge=self._edge(),
        )
        if self.edge != "measured-cutoff" or self.measured_cutoff_hz is None:
            return strip
        self._check_cutoff(strip, self.measured_cutoff_hz)
        strip = strip.with_cutoff(self.measured_cutoff_hz)
        if isinstance(strip.edge, ElasticEdge):
            strip = replace(strip, edge=replace(strip.edge, lossless=self.edge_loss == "none"))
        return strip

    def _material(self) -> Material:
        losses = {"loss_factor": self.loss_factor, "viscous_time_s": self.viscous_time_us / 1e6}
        if self.material is not None:
            return replace(MATERIALS[self.material].material, **losses)
        stated: list[float] = [getattr(self, key) for key in _PAPER_MATERIAL]
        modulus_gpa, poisson_ratio, density_kg_m3 = stated
        return Material(
            youngs_modulus_pa=modulus_gpa * 1e9,
            poisson_ratio=poisson_ratio,
            density_kg_m3=density_kg_m3,
            **losses,
        )

    def _edge(self) -> IdealEdge | ElasticEdge:
        if self.edge_stiffness_n is not None:
            return ElasticEdge(stiffness_n=self.edge_stiffness_n, lossless=self.edge_loss == "none")
        return SIMPLY_SUPPORTED if self.edge == "simply-supported" else CLAMPED

    def _check_cutoff(self, strip: Strip, cutoff_hz: float) -> None:
        """Refuse a cut-off that no edge gives this plate, and say which plate has it."""
        ends = (("simply supported", SIMPLY_SUPPORTED), ("clamped", CLAMPED))
        found = [(name, replace(strip, edge=edge).cutoff_hz()) for name, edge in ends]
        (_, least_hz), (_, most_hz) = found
        if least_hz < cutoff_hz < most_hz:
            return
        too_high = cutoff_hz >= most_hz
        name, end_hz = found[too_high]
        soft = "" if too_high else "; if the edges move, as on soft rubber, state that width"
        raise ValueError(
            f"measured_cutoff_hz must lie above {inward(least_hz, least=True)} Hz (simply "
            f"supported) and below {inward(most_hz, least=False)} Hz (clamped); got "
            f"{cutoff_hz:.10g}: {name}, {cutoff_hz:.6g} Hz "
            f"{self._sizes_within(cutoff_hz / end_hz, thicker=too_high)}{soft}"
        )

    def fitting(self, cutoff_hz: float, wanted_hz: float) -> str:
        """Say which thickness or width turns one cut-off of these edges into another one.

        Cut-offs go as thickness over width squared, whatever ideal edges the plate has.
        """
        sizes = dict(zip(("thickness", "width"), self._sizes(wanted_hz / cutoff_hz), strict=True))
        texts = {size: f"{mm:.3g}" for size, mm in sizes.items()}
        return self._told_fit({size: mm for size, mm in texts.items() if self._may_be(size, mm)})

    def _sizes_within(self, ratio: float, *, thicker: bool) -> str:
        """Say the same of a cut-off that must stay beyond another: rounded to that side."""
        sizes = dict(zip(("thickness", "width"), self._sizes(ratio), strict=True))
        told = {}
        for size, mm in sizes.items():
            upward = thicker == (size == "thickness")
            # not quite at the limit, which itself is refused
            text = inward(mm * (1 + (1e-9 if upward else -1e-9)), least=upward, digits=3)
            if self._may_be(size, text):
                told[size] = text
        return self._told_fit(told)

    def _may_be(self, size: str, mm: str) -> bool:
        """Tell whether the plate may have another thickness or width, as it would be written."""
        limits = limits_of(type(self), f"{size}_mm")
        sizes_now = {"thickness": self.thickness_mm, "width": self.width_mm}
        return limits.hold(float(mm)) and _is_a_plate(**(sizes_now | {size: float(mm)}))

    def _sizes(self, ratio: float) -> tuple[float, float]:
        """Return the thickness and the width, in mm, that multiply cut-offs by a ratio."""
        return self.thickness_mm * ratio, self.width_mm / ratio**0.5

    def _told_fit(self, sizes: dict[str, str]) -> str:
        fits = " or ".join(f"{float(text):g} mm of {size}" for size, text in sizes.items())
        return (
            f"fits {fits or 'no plate near it'}; you have {self.thickness_mm:g} mm and "
            f"{self.width_mm:g} mm"
        )
