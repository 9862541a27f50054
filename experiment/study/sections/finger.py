"""The section [finger_load] of study.toml: what the fingertips oppose to the plate."""

from __future__ import annotations

from functools import cached_property
from typing import Final

from pydantic import Field

from experiment.study.sections.plate import Line
from experiment.study.sections.table import refuse_below, refuse_incomplete, section
from stimuli import Impedance

# What moves with a fingertip weighs tenths of a gram, with the whole finger some grams; it is held
# by hundreds to thousands of N/m and damped by about 1 N s/m. Ranges are wide about that, but not
# so wide that kilograms, N/mm and kilohertz pass.
_LEAST_STATED: Final = {"stiffness_n_m": 10.0, "damping_n_s_m": 0.01}
FINGER_KEYS: Final = ("mass_g", "stiffness_n_m", "damping_n_s_m", "holds_up_to_hz", "source")


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
