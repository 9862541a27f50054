"""The section [finger_load] of study.toml: what the fingertips oppose to the plate."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Final

from pydantic import Field

from experiment.study.sections.actuator import LEAST_FINGER_MM
from experiment.study.sections.plate import Line
from experiment.study.sections.table import refuse_below, refuse_incomplete, section
from experiment.terms.checks import inward
from stimuli import Impedance

if TYPE_CHECKING:
    from experiment.study.sections.actuator import Actuator
    from stimuli import Strip


# What moves with a fingertip weighs tenths of a gram, with the whole finger some grams; it is held
# by hundreds to thousands of N/m and damped by about 1 N s/m. Ranges are wide about that, but not
# so wide that kilograms, N/mm and kilohertz pass.
_LEAST_STATED: Final = {"stiffness_n_m": 10.0, "damping_n_s_m": 0.01}
FINGER_KEYS: Final = ("mass_g", "stiffness_n_m", "damping_n_s_m", "holds_up_to_hz", "source")

ROUNDING_M: Final = 1e-12
"""A patch as wide as the strip ends on its edges, but for the rounding of the sums."""


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
        if one.finger_diameter_m / 2 <= room_m + ROUNDING_M:
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
