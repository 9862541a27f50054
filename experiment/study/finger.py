"""The section [finger_load] of study.toml, and where on the plate fingers and actuators may lie."""

from __future__ import annotations

import math
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Final

from pydantic import Field

from experiment.names import in_metres, inward
from experiment.study.actuator import LEAST_FINGER_MM
from experiment.study.base import refuse_below, refuse_incomplete, section
from experiment.study.plate import Line
from stimuli import Impedance

if TYPE_CHECKING:
    from experiment.study.actuator import Actuator
    from stimuli import Strip


# What moves with a fingertip weighs tenths of a gram, with the whole finger some grams; it is held
# by hundreds to thousands of N/m and damped by about 1 N s/m. Ranges are wide about that, but not
# so wide that kilograms, N/mm and kilohertz pass.
_LEAST_STATED: Final = {"stiffness_n_m": 10.0, "damping_n_s_m": 0.01}
FINGER_KEYS: Final = ("mass_g", "stiffness_n_m", "damping_n_s_m", "holds_up_to_hz", "source")

_ROUNDING_M: Final = 1e-12
"""A patch as wide as the strip ends on its edges, but for the rounding of the sums."""

_REACH_M: Final = 1.0
"""Two fingers farther apart are not laid on a plate at ease; its field would take minutes."""


@section
class FingerLoad:
    """What the two fingertips oppose to the plate: a mass, a spring and a damper each.

    Nothing, unless all keys are given. No values are built in: they have to hold for pressing, not
    for shear, and for the force with which people press.
    """

    mass_g: float | None = Field(
        default=None, ge=0.01, le=10, description="that goes with the plate"
    )
    stiffness_n_m: float | None = Field(
        default=None, ge=0, le=1e5, description="between it and the bone"
    )
    damping_n_s_m: float | None = Field(default=None, ge=0, le=100, description="beside it")
    holds_up_to_hz: float | None = Field(
        default=None,
        ge=20,
        le=20_000,
        description="a burst whose band reaches above has no finger load",
    )
    source: Line | None = Field(default=None, description="where these values are from")

    def __post_init__(self) -> None:
        refuse_incomplete(self, FINGER_KEYS)
        for key, least in _LEAST_STATED.items():
            refuse_below(self, key, least, "or 0 for none")

    @cached_property
    def impedance(self) -> Impedance | None:
        """The same as the physics has it; none where it is not stated."""
        stated = (self.mass_g, self.stiffness_n_m, self.damping_n_s_m, self.holds_up_to_hz)
        if None in stated:
            return None
        mass_g, stiffness_n_m, damping_n_s_m, holds_up_to_hz = (one or 0.0 for one in stated)
        return Impedance(
            mass_kg=mass_g / 1e3,
            stiffness_n_m=stiffness_n_m,
            damping_n_s_m=damping_n_s_m,
            holds_up_to_hz=holds_up_to_hz,
        )


def check_fingers(actuators: tuple[Actuator, ...], strip: Strip) -> None:
    """Refuse fingers that press on a plate without ends, or beside the plate."""
    if strip.length_m is None:
        raise ValueError(
            "strip.length_mm must be a number where [finger_load] is given, as its fingers "
            'couple the modes of a plate with ends; got "endless"'
        )
    for one in actuators:
        room_m = min(strip.length_m / 2 - abs(one.x_m), one.y_m, strip.width_m - one.y_m)
        if one.finger_diameter_m / 2 <= room_m + _ROUNDING_M:
            continue
        most, width = inward(2e3 * room_m, least=False), f"finger_diameter_mm of the {one.label}"
        if float(most) < LEAST_FINGER_MM:
            raise ValueError(
                f"the {one.label} actuator must lie {LEAST_FINGER_MM / 2:g} mm from edges and ends "
                "where [finger_load] is given, so that a fingertip rests on the strip; got "
                f"{1e3 * room_m:.6g} mm"
            )
        raise ValueError(
            f"{width} actuator must be at most {most} where [finger_load] is given, so that the "
            f"fingertip rests on the strip; got {one.finger_diameter_mm:.12g}"
        )


def check_places(actuators: tuple[Actuator, ...], strip: Strip) -> None:
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
    end_m = math.inf if strip.length_m is None else strip.length_m / 2
    along_m = -end_m, end_m
    for actuator in actuators:
        _check_patch(actuator, strip)
        _check_span(actuator, "y_m", actuator.span_y_m, (0.0, strip.width_m))
        _check_span(actuator, "x_m", actuator.span_x_m, along_m)
    for one, two in combinations(actuators, 2):
        if (one.x_m, one.y_m) == (two.x_m, two.y_m):
            raise ValueError(
                f"the actuators {one.label} and {two.label} are in one place, x_mm = "
                f"{one.x_mm:g} and y_mm = {one.y_mm:g}; give each its own x_mm"
            )
    if left.span_x_m[1] > right.span_x_m[0]:
        both = [(one.x_m, (one.span_x_m[1] - one.span_x_m[0]) / 2) for one in (left, right)]
        raise ValueError(
            "the left actuator must end, along the strip, before the right one begins at "
            f"{_mm(right.span_x_m[0])}; got an end at {_mm(left.span_x_m[1])}"
            f"{in_metres('x_mm', both, along_m)}"
        )
    if right.x_m - left.x_m > _REACH_M:
        raise ValueError(
            f"the left and right actuators must be at most {_mm(_REACH_M)} apart along the strip, "
            f"within one person's reach; got {_mm(right.x_m - left.x_m)}"
        )
    for one, two in combinations(actuators, 2):
        if _overlap(one.span_x_m, two.span_x_m) and _overlap(one.span_y_m, two.span_y_m):
            raise ValueError(
                f"the actuators {one.label} and {two.label} must not overlap; got centres at "
                f"x = {_mm(one.x_m)} and {_mm(two.x_m)}"
            )


def _check_patch(actuator: Actuator, strip: Strip) -> None:
    """Refuse a patch that counts on a plate without ends, of which no modes are sought."""
    if actuator.patch_counts and strip.length_m is None:
        raise ValueError(
            f"the {actuator.label} actuator's patch_counts needs a plate with ends: "
            'strip.length_mm must be a number; got "endless"'
        )


def _overlap(one_m: tuple[float, float], two_m: tuple[float, float]) -> bool:
    """Tell whether two spans have more than an end in common."""
    return min(one_m[1], two_m[1]) - max(one_m[0], two_m[0]) > _ROUNDING_M


def _check_span(
    actuator: Actuator, axis: str, span_m: tuple[float, float], limits_m: tuple[float, float]
) -> None:
    if _is_within(span_m, limits_m):
        return
    key, half_m = f"{axis[0]}_mm", (span_m[1] - span_m[0]) / 2
    least, most = (
        inward(1e3 * (limit_m + sign * half_m), least=sign > 0)
        for limit_m, sign in zip(limits_m, (1, -1), strict=True)
    )
    fits = f"{key} from {least} to {most} is" if float(least) <= float(most) else f"no {key} is"
    raise ValueError(
        f"the {actuator.label} actuator must lie on the strip, which goes from "
        f"{axis[0]} = {_mm(limits_m[0])} to {_mm(limits_m[1])}; "
        f"got a {actuator.shape} from {_mm(span_m[0])} to {_mm(span_m[1])}: {fits} on it"
        f"{in_metres(key, [(getattr(actuator, axis), half_m)], limits_m)}"
    )


def _is_within(span_m: tuple[float, float], limits_m: tuple[float, float]) -> bool:
    return span_m[0] >= limits_m[0] - _ROUNDING_M and span_m[1] <= limits_m[1] + _ROUNDING_M


def _mm(length_m: float) -> str:
    return f"{length_m * 1e3:.6g} mm"
