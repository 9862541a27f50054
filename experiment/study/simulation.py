"""The section [simulation] of study.toml: the people that a dry run draws."""

from __future__ import annotations

import math
from dataclasses import asdict, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final

from pydantic import Field

from experiment.perception.observer import FASTEST_ANSWER_S, Observer
from experiment.perception.population import draw_observer
from experiment.perception.thresholds import KnownFor
from experiment.study.base import section

if TYPE_CHECKING:
    import numpy as np

PAPER_THRESHOLD_UM: Final = 1.57
"""What 58 Vpp do above the paper's disc: half of the simulated people feel it."""
THRESHOLD_VPP: Final = 58.0
"""The same for actuators whose displacement is not known."""

_NEEDS: Final = {
    "wander_db": "wander_trials",
    "wander_trials": "wander_db",
    "masking_falloff_mm": "masking_slope",
}

CURVE_KEYS: Final = ("threshold_at_hz", "threshold_at_s", "threshold_at_cm2")


@section
class Simulation:
    """The people that a dry run simulates. Sources and limits: docs/model.md, section 4."""

    threshold_um: float | None = Field(
        default=None,
        ge=0.01,
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
    sigma_spread: float | None = Field(
        default=None, ge=0, le=2, description="between people, standard deviation of ln(sigma)"
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
        default=0.55, gt=0, le=60, description="median, to a clear stimulus"
    )
    reaction_time_spread: float = Field(
        default=0.3, ge=0, le=5, description="standard deviation of its logarithm"
    )
    reaction_time_least_s: float = Field(
        default=FASTEST_ANSWER_S, ge=0, le=10, description="no reaction is faster"
    )
    reaction_time_doubt: float = Field(
        default=2.0, ge=1, le=10, description="times as long if nothing could be felt"
    )
    threshold_at_hz: float | None = Field(
        default=None, ge=5, le=2000, description="the threshold's frequency; a burst's own differs"
    )
    threshold_at_s: float | None = Field(
        default=None,
        ge=1e-4,
        le=10,
        description="the same by duration, of a sine of that peak and energy without window",
    )
    threshold_at_cm2: float | None = Field(
        default=None, ge=1e-3, le=20, description="the same by area, that of a fingertip's contact"
    )
    finger_difference_sd_db: float | None = Field(
        default=None, ge=0, le=20, description="between people, of left threshold above right"
    )
    difference_db: float | None = Field(
        default=None, ge=-40, le=40, description="threshold of the second condition above the first"
    )
    difference_sd_db: float | None = Field(
        default=None, ge=0, le=20, description="between people, of that difference"
    )
    masking_slope: float | None = Field(
        default=None,
        ge=0,
        le=2,
        description="dB a finger's threshold rises per dB felt by the other; else the 20 dB rule",
    )
    masking_falloff_mm: float | None = Field(
        default=None,
        ge=1,
        le=1000,
        description="fingers of one hand: the slope falls to 1/e over this distance",
    )
    drift_db: float | None = Field(
        default=None, ge=-20, le=20, description="thresholds rise from the first trial to the last"
    )
    block_drift_db: float | None = Field(
        default=None, ge=-20, le=20, description="the same within each block; its break undoes it"
    )
    wander_db: float | None = Field(
        default=None, ge=0, le=20, description="standard deviation of a slow random course of them"
    )
    wander_trials: float | None = Field(
        default=None, ge=1, le=10_000, description="trials over which that is forgotten, to 1/e"
    )
    last_answer_db: float | None = Field(
        default=None,
        ge=-20,
        le=20,
        description="lower after something was felt than after none, if offered",
    )
    swapped_keys: float | None = Field(
        default=None, ge=0, le=1, description="share of people who confuse left and right"
    )

    def __post_init__(self) -> None:
        if self.threshold_um is not None and self.threshold_vpp is not None:
            raise ValueError("threshold_um and threshold_vpp exclude each other; got both")
        if self.reaction_time_s <= self.reaction_time_least_s:
            raise ValueError(
                "reaction_time_s must be a finite number > reaction_time_least_s, "
                f"{self.reaction_time_least_s:g}; got {self.reaction_time_s:g}"
            )
        for key, other in _NEEDS.items():
            if getattr(self, key) is not None and getattr(self, other) is None:
                raise ValueError(f"{other} is missing; {key} needs it")

    def check_played(self, played: list[str]) -> None:
        """Refuse threshold curves, which are those of sines, where conditions play a file."""
        used = [key for key in CURVE_KEYS if getattr(self, key) is not None]
        if used and played:
            raise ValueError(
                f"simulation.{used[0]} needs bursts, as its curve is that of sines; got a file in "
                f"condition {played[0]}"
            )

    @property
    def known_for(self) -> KnownFor:
        """What of a stimulus the threshold is known for; nothing where no curve is used."""
        return KnownFor(
            frequency_hz=self.threshold_at_hz,
            duration_s=self.threshold_at_s,
            area_cm2=self.threshold_at_cm2,
        )

    @cached_property
    def median(self) -> Observer:
        """The participant in the middle of the population, the fingers of both hands."""
        known = {one.name for one in fields(Observer)}
        keys = {key: value for key, value in asdict(self).items() if key in known}
        always = {key: value for key, value in keys.items() if value is not None}
        return Observer(**always)

    def draw(self, distance_mm: float, rng: np.random.Generator) -> Observer:
        """Draw a participant whose fingers lie some distance apart."""
        person = self.median
        if self.masking_slope is not None and self.masking_falloff_mm is not None:
            left = math.exp(-distance_mm / self.masking_falloff_mm)
            person = replace(person, masking_slope=self.masking_slope * left)
        return draw_observer(
            person,
            self.threshold_sd_db,
            rng,
            finger_difference_sd_db=self.finger_difference_sd_db or 0.0,
            swapped_keys=self.swapped_keys or 0.0,
            sigma_spread=self.sigma_spread or 0.0,
            difference_sd_db=self.difference_sd_db or 0.0,
        )
