"""The section [simulation] of study.toml: the people that a dry run draws."""

from __future__ import annotations

from dataclasses import asdict
from functools import cached_property
from typing import Final

from pydantic import Field

from experiment.study.sections.table import section
from experiment.terms.observer import FASTEST_ANSWER_S, Observer

PAPER_THRESHOLD_UM: Final = 1.57
"""What 58 Vpp do above the paper's disc: half of the simulated people feel it."""
THRESHOLD_VPP: Final = 58.0
"""The same for actuators whose displacement is not known."""


@section
class Simulation:
    """The people that a dry run simulates."""

    threshold_um: float | None = Field(
        default=None,
        ge=1e-3,
        le=1000,
        description="displacement felt half of the time; median of the people",
    )
    threshold_vpp: float | None = Field(
        default=None,
        ge=0.1,
        le=1000,
        description="or the level that is, where displacements are unknown",
    )
    threshold_sd_db: float = Field(
        default=1.5, ge=0, le=40, description="between people, of 20 log10(threshold)"
    )
    sigma: float = Field(
        default=0.1, gt=0, le=10, description="width of the psychometric function, log10 units"
    )
    lapse_rate: float = Field(
        default=0.03, ge=0, le=1, description="answers at random, whatever was felt"
    )
    false_alarm_rate: float = Field(
        default=0.05, ge=0, le=1, description="felt nothing, may say none, but guesses"
    )
    side_bias: float = Field(
        default=0.5, ge=0, le=1, description="left, in a guess between left and right"
    )
    guess_both: float = Field(default=0.0, ge=0, le=1, description="both, in a guess")
    crosstalk_db: float | None = Field(
        default=None,
        ge=-200,
        le=0,
        description="another level at the other finger than the computed one",
    )
    reaction_time_s: float = Field(
        default=0.55, gt=FASTEST_ANSWER_S, le=60, description="median, to a clear stimulus"
    )
    reaction_time_spread: float = Field(
        default=0.3, ge=0, le=5, description="standard deviation of its logarithm"
    )

    def __post_init__(self) -> None:
        if self.threshold_um is not None and self.threshold_vpp is not None:
            raise ValueError("threshold_um and threshold_vpp exclude each other; got both")

    @cached_property
    def median(self) -> Observer:
        """The participant in the middle of the population."""
        keys = asdict(self)
        del keys["threshold_sd_db"]
        return Observer(**keys)
