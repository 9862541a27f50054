"""The sections [[actuator]] and [finger_load]: what moves the plate, and the fingertips on it."""

from __future__ import annotations

import math
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field

from experiment.names import NAME, NAME_RULE
from experiment.study.base import (
    Day,
    Line,
    Section,
    all_or_none,
    is_distinct,
    obey,
    obeying,
    refusal,
    zero_or_at_least,
)
from experiment.study.plate import Density, Modulus
from stimuli import (
    BondedPatch,
    ForceRectangle,
    Impedance,
    MeasuredDisplacement,
    MomentDisc,
    MomentRectangle,
    PiezoLayers,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from experiment.study.base import Rule
    from experiment.study.task import TaskChoice
    from stimuli import Load, Strip

Shape = Literal["disc", "rectangle", "motor"]

# Piezo discs begin at some millimetres, the contacts of motors at tenths, layers at films of 5 um.
_Layer = Annotated[float, Field(ge=0.005, le=20)]
_LayerRatio = Annotated[float, Field(ge=-0.999, le=0.5)]
_Length = Annotated[float, Field(ge=0.2, le=1000)]
_Constant = Annotated[
    float, Field(ge=-5000, le=5000), zero_or_at_least(0.5), obeying(bool, "must not be 0")
]
_Position = Annotated[float, Field(ge=-5000, le=5000)]

MEASURED_KEYS: Final = ("measured_displacement_um", "measured_at_vpp", "measured_at_hz")
_LAYER_KEYS: Final = ("thickness_mm", "youngs_modulus_gpa", "poisson_ratio")
SIZE_KEYS: Final = ("diameter_mm", "length_x_mm", "length_y_mm")
_ROUNDING_MM: Final = 1e-9
"""A patch as wide as the strip ends on its edges, but for the rounding of the sums."""
_REACH_M: Final = 1.0
"""Two fingers farther apart cannot rest on a plate comfortably; its field would take minutes."""
_MIN_UM_PER_VPP: Final = 1e-4
"""Less stays below a tenth of a micrometre, the least that anybody feels, at 1000 Vpp."""


def _in_metres(key: str) -> Any:
    """Return a property with the value of a key in metres; none where it is omitted."""
    return property(lambda self: None if (mm := getattr(self, key)) is None else mm / 1e3)


class Actuator(Section):
    """A patch or a motor under the strip, and the finger above it."""

    site: Line | None = None
    """site of the finger above it, such as left; without a site, no session drives it"""
    name: str | None = None
    """name of an actuator without a site"""
    shape: Shape = "disc"
    """shape of the patch, or motor with the size of its contact"""
    x_mm: _Position
    """centre along the strip, from its middle, positive to the right"""
    y_mm: _Position | None = None
    """centre across the strip, from one edge; by default the middle"""
    diameter_mm: Annotated[float, Field(ge=0.5, le=1000)] | None = None
    """diameter of a disc: of the electrode on the ceramic, not of the metal"""
    length_x_mm: _Length | None = None
    """length along the strip of a rectangle or motor"""
    length_y_mm: _Length | None = None
    """length across the strip of a rectangle or motor"""
    finger_diameter_mm: Annotated[float, Field(ge=1, le=50)] = 10.0
    """diameter of the fingertip's contact area above it"""
    measured_displacement_um: Annotated[float, Field(ge=1e-4, le=5000)] | None = None
    """displacement measured at its centre, without a finger on the plate"""
    measured_as: Literal["peak", "peak-to-peak"] = "peak"
    """whether the measured displacement is an amplitude or peak-to-peak"""
    measured_at_vpp: Annotated[float, Field(ge=1e-3, le=1000)] | None = None
    """level of the sine or burst it was measured with"""
    measured_at_hz: Annotated[float, Field(ge=1, le=1e5)] | None = None
    """its frequency, well below the cut-off"""
    measured_by: Line | None = None
    """who measured it"""
    measured_on: Day | None = None
    """day of the measurement"""
    assumed_equal_to: Line | None = None
    """in place of a measurement: the site of an equal actuator that was measured"""
    piezo_thickness_mm: _Layer | None = None
    """thickness of the piezo layer; from layers, displacements are predicted to a factor of two"""
    piezo_youngs_modulus_gpa: Modulus | None = None
    """Young's modulus of the piezo, 1 / s11E"""
    piezo_poisson_ratio: _LayerRatio | None = None
    """Poisson's ratio of the piezo, -s12E / s11E"""
    piezo_d31_pm_v: _Constant | None = None
    """piezoelectric constant d31, strain in the plane per field"""
    carrier_thickness_mm: _Layer | None = None
    """thickness of a metal layer between piezo and plate, if any"""
    carrier_youngs_modulus_gpa: Modulus | None = None
    """Young's modulus of that metal"""
    carrier_poisson_ratio: _LayerRatio | None = None
    """Poisson's ratio of that metal"""
    patch_counts: bool = False
    """whether the layers stiffen and load the plate, which must have ends"""
    piezo_density_kg_m3: Density | None = None
    """density of the piezo, with patch_counts"""
    carrier_density_kg_m3: Density | None = None
    """density of that metal, with patch_counts"""
    source: Line | None = None
    """where these values are from"""

    def rules(self) -> Iterator[Rule]:
        """Yield the rules of its name, size, measurement and layers."""
        rule = "or name must be given, a site if the session drives the actuator"
        yield (self.site is None) == (self.name is None), "site", rule, self.site
        for key in ("site", "name"):
            text = getattr(self, key)
            yield text is not None and not NAME.fullmatch(text), key, NAME_RULE
        for key in SIZE_KEYS:
            is_needed = (key == "diameter_mm") == (self.shape == "disc")
            rule = (
                f'{"is required" if is_needed else "must be left out"} with shape = "{self.shape}"'
            )
            yield (getattr(self, key) is not None) != is_needed, key, rule, None
        yield from all_or_none(self, MEASURED_KEYS)
        is_measured = self.measured_displacement_um is not None
        lack = not is_measured and bool(self.measured_by or self.measured_on)
        yield lack, MEASURED_KEYS[0], "is required with measured_by and measured_on"
        is_own = self.assumed_equal_to is not None and self.assumed_equal_to == self.site
        yield is_own, "assumed_equal_to", "must be another site"
        has_d31 = self.piezo_d31_pm_v is not None
        excess = has_d31 and (is_measured or self.assumed_equal_to is not None)
        rule = "must be left out where the displacement is measured"
        yield excess, "piezo_d31_pm_v", rule, None
        for layer in ("piezo", "carrier"):
            density, keys = f"{layer}_density_kg_m3", [f"{layer}_{key}" for key in _LAYER_KEYS]
            excess = getattr(self, density) is not None and not self.patch_counts
            yield excess, density, "must be left out unless patch_counts = true", None
            yield from all_or_none(self, [*keys, density] if self.patch_counts else keys)
        has_piezo = self.piezo_thickness_mm is not None
        excess = self.shape == "motor" and (has_piezo or self.patch_counts)
        yield excess, "shape", "must be disc or rectangle with layers"
        for key in ("patch_counts", "piezo_d31_pm_v", "carrier_thickness_mm"):
            lack = bool(getattr(self, key)) and not has_piezo
            yield lack, "piezo_thickness_mm", f"is required with {key}"
        lack = has_piezo and not has_d31 and not self.patch_counts
        yield lack, "piezo_d31_pm_v", "is required with piezo_thickness_mm"

    @property
    def label(self) -> str:
        """Its site, or its name."""
        return self.site or self.name or ""

    x_m = _in_metres("x_mm")
    """Centre along the strip, from its middle, positive to the right."""
    y_m = _in_metres("y_mm")
    """Centre across the strip, from one edge; a study fills it in."""
    diameter_m = _in_metres("diameter_mm")
    """Diameter of a disc, else none."""
    length_x_m = _in_metres("length_x_mm")
    """Length along the strip of a rectangle or of a motor's contact, else none."""
    length_y_m = _in_metres("length_y_mm")
    """Length across the strip of a rectangle or of a motor's contact, else none."""
    finger_diameter_m = _in_metres("finger_diameter_mm")
    """Diameter of the fingertip's contact area."""

    @property
    def size_m(self) -> tuple[float, float]:
        """Length along and across the strip."""
        return self.diameter_m or self.length_x_m, self.diameter_m or self.length_y_m

    @property
    def span_x_m(self) -> tuple[float, float]:
        """Where the patch begins and ends along the strip."""
        return self.x_m - self.size_m[0] / 2, self.x_m + self.size_m[0] / 2

    @property
    def span_y_m(self) -> tuple[float, float]:
        """Where the patch begins and ends across the strip."""
        return self.y_m - self.size_m[1] / 2, self.y_m + self.size_m[1] / 2

    @property
    def load(self) -> Load:
        """The load of the physics: a bonded patch of 1 N m per metre, or a motor of 1 N."""
        if self.diameter_m is not None:
            return MomentDisc(x_m=self.x_m, y_m=self.y_m, radius_m=self.diameter_m / 2)
        shape = ForceRectangle if self.shape == "motor" else MomentRectangle
        length_x_m, length_y_m = self.size_m
        return shape(x_m=self.x_m, y_m=self.y_m, length_x_m=length_x_m, length_y_m=length_y_m)

    @property
    def basis(self) -> MeasuredDisplacement | PiezoLayers | None:
        """What its displacement per volt is computed from, if anything."""
        if self.measured_displacement_um is not None:
            displacement_um, level_vpp, frequency_hz = (getattr(self, k) for k in MEASURED_KEYS)
            amplitude_um = displacement_um / (2 if self.measured_as == "peak-to-peak" else 1)
            return MeasuredDisplacement(
                displacement_m=amplitude_um / 1e6, level_vpp=level_vpp, frequency_hz=frequency_hz
            )
        if self.piezo_d31_pm_v is None:
            return None
        return self._layers(d31_m_v=self.piezo_d31_pm_v / 1e12)

    @property
    def patch(self) -> BondedPatch | None:
        """The patch that stiffens and loads the plate, if it counts."""
        if not self.patch_counts:
            return None
        return BondedPatch(
            x_m=self.x_m,
            y_m=self.y_m,
            length_x_m=self.size_m[0],
            length_y_m=self.size_m[1],
            layers=self._layers(d31_m_v=1e-6).layers,  # no layer's stiffness depends on its strain
            is_disc=self.shape == "disc",
        )

    def _layers(self, d31_m_v: float) -> PiezoLayers:
        values: dict[str, Any] = {"d31_m_v": d31_m_v}
        for layer, prefix in (("piezo", ""), ("carrier", "carrier_")):
            if getattr(self, f"{layer}_thickness_mm") is not None:
                thickness_mm, modulus_gpa, ratio, density_kg_m3 = (
                    getattr(self, f"{layer}_{key}") for key in (*_LAYER_KEYS, "density_kg_m3")
                )
                values[f"{prefix}thickness_m"] = thickness_mm / 1e3
                values[f"{prefix}youngs_modulus_pa"] = modulus_gpa * 1e9
                values[f"{prefix}poisson_ratio"] = ratio
                values[f"{prefix}density_kg_m3"] = density_kg_m3 or 0.0
        return PiezoLayers(**values)

    def equality_rules(self, reference: Actuator | None) -> Iterator[Rule]:
        """Yield the rules of an actuator that is assumed equal to another, which was measured."""
        is_usable = reference and not reference.assumed_equal_to and reference.measured_at_hz
        rule = "must be the site of an actuator that was measured"
        yield not is_usable, "assumed_equal_to", rule
        for size in ("shape", *SIZE_KEYS):
            value, rule = getattr(self, size), f"needs actuators of the same {size}"
            yield value != getattr(reference, size), "assumed_equal_to", rule, value
        bases = None if reference is None else reference.basis, None
        rule = "excludes a measurement of its own; give one of the two"
        yield self.basis not in bases, "assumed_equal_to", rule, None

    def plate_rules(self, strip: Strip, highest_vpp: float) -> Iterator[Rule]:
        """Yield the rules that it lies on the strip, and that its displacement is plausible."""
        rule = "needs a number as strip.length_mm"
        yield self.patch_counts and strip.length_m is None, "patch_counts", rule, None
        end_m = (strip.length_m or math.inf) / 2
        for key, size_m, low_m, high_m in (
            ("y_mm", self.size_m[1], 0.0, strip.width_m),
            ("x_mm", self.size_m[0], -end_m, end_m),
        ):
            size_key = "diameter_mm" if self.shape == "disc" else f"length_{key}"
            rule = f"must be at most {1e3 * (high_m - low_m):.6g} to lie on the strip"
            fits = size_m <= high_m - low_m
            yield not fits, size_key, rule
            low_mm, high_mm = 1e3 * (low_m + size_m / 2), 1e3 * (high_m - size_m / 2)
            rule = f"must be from {low_mm:.6g} to {high_mm:.6g} to lie on the strip"
            is_on = low_mm - _ROUNDING_MM <= getattr(self, key) <= high_mm + _ROUNDING_MM
            yield fits and not is_on, key, rule
        level_vpp = self.measured_at_vpp or 0.0  # without a measurement, limits and value are 0
        low_um = _MIN_UM_PER_VPP * level_vpp
        high_um = 1e6 * strip.thickness_m / highest_vpp * level_vpp
        rule = (
            f"must be from {low_um:.6g} to {high_um:.6g} at {level_vpp:g} Vpp, so that it can be "
            f"felt and stays within the plate's thickness at the highest level, {highest_vpp:g} Vpp"
        )
        is_plausible = low_um <= (self.measured_displacement_um or 0.0) <= high_um
        yield not is_plausible, MEASURED_KEYS[0], rule

    def finger_rules(self, strip: Strip) -> Iterator[Rule]:
        """Yield the rule that the loaded fingertip above it rests on the plate."""
        end_m = (strip.length_m or 0.0) / 2
        room_mm = 2e3 * min(end_m - abs(self.x_m), self.y_m, strip.width_m - self.y_m)
        rule = f"must be at most {room_mm:.6g} with [finger_load], so that the fingertip rests on"
        is_beside = self.finger_diameter_mm > room_mm + _ROUNDING_MM
        yield is_beside, "finger_diameter_mm", f"{rule} the strip"


class FingerLoad(Section):
    """Mechanical impedance of each fingertip: mass, stiffness, damping. Set all keys, or none.

    No values are built in: they must hold for pressing, not for shear, and for the participants'
    force.
    """

    # What moves with a fingertip weighs tenths of a gram, with the whole finger some grams;
    # hundreds to thousands of N/m hold it, and about 1 N s/m damps it.
    mass_g: Annotated[float, Field(ge=0.01, le=10)] | None = None
    """mass that moves with the plate"""
    stiffness_n_m: Annotated[float, Field(ge=0, le=1e5), zero_or_at_least(10)] | None = None
    """stiffness between that mass and the bone"""
    damping_n_s_m: Annotated[float, Field(ge=0, le=100), zero_or_at_least(0.01)] | None = None
    """damping in parallel with that stiffness"""
    holds_up_to_hz: Annotated[float, Field(ge=20, le=20_000)] | None = None
    """highest frequency of these values; a burst whose band is above has no finger load"""
    source: Line | None = None
    """where these values are from"""

    def rules(self) -> Iterator[Rule]:
        """Yield the rule that all keys are given, or none."""
        return all_or_none(self, type(self).model_fields)

    @cached_property
    def impedance(self) -> Impedance | None:
        """The impedance of the physics, if it is given."""
        if self.mass_g is None:
            return None
        values = self.model_dump(include={"stiffness_n_m", "damping_n_s_m", "holds_up_to_hz"})
        return Impedance(mass_kg=self.mass_g / 1e3, **values)


def complete_actuators(
    actuators: tuple[Actuator, ...], width_mm: float, choice: TaskChoice
) -> tuple[Actuator, ...]:
    """Fill in the middle of the strip and equal measurements; sort by site and position.

    An actuator that is assumed equal to another has the same displacement per volt.
    """
    names = [actuator.label for actuator in actuators]
    obey([(not is_distinct(names), "", "must have distinct sites and names", names)])
    by_site = {actuator.site: actuator for actuator in actuators}
    complete = []
    for index, actuator in enumerate(actuators):
        values: dict[str, Any] = {} if actuator.y_mm is not None else {"y_mm": width_mm / 2}
        if actuator.assumed_equal_to is not None:
            reference = by_site.get(actuator.assumed_equal_to)
            obey(actuator.equality_rules(reference), actuator, f"[{index}]")
            values |= {key: getattr(reference, key) for key in (*MEASURED_KEYS, "measured_as")}
        complete.append(actuator.completed(**values) if values else actuator)
    complete.sort(key=lambda each: (each.site is None, each.x_m, each.y_m))
    sites = sites_of(complete)
    obey([(not sites, "", "must have a site, at least one of them", names)])
    try:
        task_sites = choice.task_at(sites).sites
    except ValueError as error:
        raise refusal("", str(error), sites) from error
    rule = f"must be one of {', '.join(task_sites)}"
    for index, actuator in enumerate(actuators):
        is_unknown = actuator.site not in {*task_sites, None}
        obey([(is_unknown, "site", rule)], actuator, f"[{index}]")
    rule = f'must be given once for each site of task.kind = "{choice.kind}": '
    is_other = sorted(sites) != sorted(task_sites)
    obey([(is_other, "", rule + ", ".join(task_sites), sites)])
    order = (*task_sites, None)
    return tuple(sorted(complete, key=lambda each: order.index(each.site)))


def sites_of(actuators: Iterable[Actuator]) -> tuple[str, ...]:
    """Return the sites of the driven actuators, in their order."""
    return tuple(actuator.site for actuator in actuators if actuator.site is not None)


def distance_rules(actuators: tuple[Actuator, ...]) -> Iterator[Rule]:
    """Yield the rules that sites lie in their order, and patches not over each other."""
    n_sites = len(sites_of(actuators))
    for index in range(1, n_sites):
        before, actuator, key = actuators[index - 1], actuators[index], f"actuator[{index}].x_mm"
        rule = f"must be at least {before.x_mm:g}, right of the {before.label} actuator"
        yield actuator.x_m < before.x_m, key, rule, actuator.x_mm
    first, last = actuators[0], actuators[n_sites - 1]
    rule = f"must be at most {1e3 * _REACH_M:g} mm from the {first.label} actuator"
    yield last.x_m - first.x_m > _REACH_M, f"actuator[{n_sites - 1}].x_mm", rule, last.x_mm
    for (i, first), (j, second) in combinations(enumerate(actuators), 2):
        reach_x_m, reach_y_m = np.add(first.size_m, second.size_m) / 2 - 1e-3 * _ROUNDING_MM
        is_near = abs(first.x_m - second.x_m) < reach_x_m
        is_over = is_near and abs(first.y_m - second.y_m) < reach_y_m
        rule = f"must not overlap with actuator[{i}], at x_mm = {first.x_mm:g}"
        yield bool(is_over), f"actuator[{j}].x_mm", rule, second.x_mm
