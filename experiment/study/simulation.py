"""The section [simulation] of a study file: the population of simulated participants."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from experiment.perception.observer import FASTEST_ANSWER_S, Observer
from experiment.perception.population import draw_observer
from experiment.perception.thresholds import VALID_RANGES, ReferenceVibration
from experiment.study.base import Line, Section, obey

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np

    from experiment.study.base import Rule

PAPER_THRESHOLD_UM: Final = 1.57
"""Peak displacement that 58 Vpp cause above the paper's disc: the median threshold."""
THRESHOLD_VPP: Final = 58.0
"""The same for actuators whose displacement is unknown."""
CURVE_KEYS: Final = ("threshold_at_hz", "threshold_at_s", "threshold_at_cm2")
_SPREADS: Final = {
    *("finger_difference_sd_db", "sigma_spread", "difference_sd_db", "reversed_mapping_rate")
}
"""How participants differ, apart from their thresholds."""

_Fraction = Annotated[float, Field(ge=0, le=1)]
_Shift = Annotated[float, Field(ge=-20, le=20)]
_Spread = Annotated[float, Field(ge=0, le=20)]


class Simulation(Section):
    """The population of simulated participants.

    Sources and limits: docs/explanation/simulated-people.md.
    """

    threshold_um: Annotated[float, Field(ge=0.01, le=1000)] | None = None
    """median threshold: peak displacement that is detected half of the time"""
    threshold_vpp: Annotated[float, Field(ge=0.1, le=1000)] | None = None
    """in place of threshold_um: the median threshold as a level"""
    threshold_sd_db: Annotated[float, Field(ge=0, le=40)] = 1.5
    """standard deviation of thresholds between participants, 20 log10"""
    sigma: Annotated[float, Field(gt=0, le=10)] = 0.1
    """width of the psychometric function, log10 units"""
    sigma_spread: Annotated[float, Field(ge=0, le=2)] | None = None
    """standard deviation of ln(sigma) between participants"""
    lapse_rate: _Fraction = 0.03
    """lapse rate: answers at random, whatever was presented"""
    false_alarm_rate: _Fraction = 0.05
    """probability of a guess where nothing was detected and none is on offer"""
    side_bias: _Fraction = 0.5
    """probability of the first site in a guess between two"""
    guess_both: _Fraction = 0.0
    """probability of both in a guess"""
    crosstalk_db: Annotated[float, Field(ge=-200, le=0)] | None = None
    """crosstalk in place of the computed one, dB re the driven finger"""
    reaction_time_s: Annotated[float, Field(gt=0, le=60)] = 0.55
    """median reaction time to a clear stimulus"""
    reaction_time_spread: Annotated[float, Field(ge=0, le=5)] = 0.3
    """standard deviation of its logarithm"""
    min_reaction_time_s: Annotated[float, Field(ge=0, le=10)] = FASTEST_ANSWER_S
    """shortest reaction time"""
    reaction_time_slowing: Annotated[float, Field(ge=1, le=10)] = 2.0
    """factor on the reaction time if nothing could be detected"""
    threshold_at_hz: Annotated[float, Field(ge=5, le=2000)] | None = None
    """frequency for which the threshold holds; published curves give it for others"""
    threshold_at_s: Annotated[float, Field(ge=1e-4, le=10)] | None = None
    """the same by duration, of a sine without window of equal peak and energy"""
    threshold_at_cm2: Annotated[float, Field(ge=1e-3, le=20)] | None = None
    """the same by area of contact"""
    finger_difference_sd_db: _Spread | None = None
    """standard deviation between participants of the first site's threshold re the second's"""
    difference_db: Annotated[float, Field(ge=-40, le=40)] | None = None
    """threshold of the second condition re the first"""
    difference_sd_db: _Spread | None = None
    """standard deviation of that difference between participants"""
    masking_slope: Annotated[float, Field(ge=0, le=2)] | None = None
    """rise of a finger's threshold, dB per dB above threshold at the other; else the 20 dB rule"""
    masking_falloff_mm: Annotated[float, Field(ge=1, le=1000)] | None = None
    """distance over which that slope falls to 1/e, for two fingers of one hand"""
    drift_db: _Shift | None = None
    """rise of thresholds from the first trial to the last"""
    block_drift_db: _Shift | None = None
    """rise of thresholds within each block"""
    wander_db: _Spread | None = None
    """standard deviation of slow random fluctuations of the threshold"""
    wander_trials: Annotated[float, Field(ge=1, le=10_000)] | None = None
    """number of trials over which their autocorrelation falls to 1/e"""
    last_answer_db: _Shift | None = None
    """fall of the threshold after a detected stimulus, if none is on offer"""
    reversed_mapping_rate: _Fraction | None = None
    """fraction of participants with a reversed response mapping"""
    source: Line | None = None
    """where these values are from"""

    def rules(self) -> Iterator[Rule]:
        """Yield the rules of keys that exclude or need each other."""
        excess = self.threshold_um is not None and self.threshold_vpp is not None
        yield excess, "threshold_vpp", "excludes threshold_um; give one of the two"
        low_s = self.min_reaction_time_s
        rule = f"must be above min_reaction_time_s, {low_s:g}"
        yield self.reaction_time_s <= low_s, "reaction_time_s", rule
        is_odd = (self.wander_db is None) != (self.wander_trials is None)
        yield is_odd, "wander_db", "must be given with wander_trials, and only then", None
        lack = self.masking_falloff_mm is not None and self.masking_slope is None
        yield lack, "masking_slope", "is required with masking_falloff_mm"

    def with_threshold(self, bases: Sequence[object]) -> Simulation:
        """Return the population with a median threshold, in the unit that the actuators allow.

        That is um where every driven actuator has a basis for its displacement.
        """
        has_displacements = None not in bases
        excess = self.threshold_um is not None and not has_displacements
        rule = "needs displacement or layers of each driven actuator; else give threshold_vpp"
        obey([(excess, "threshold_um", rule)], self)
        if self.threshold_um is not None or self.threshold_vpp is not None:
            return self
        if has_displacements:
            return self.completed(threshold_um=PAPER_THRESHOLD_UM)
        return self.completed(threshold_vpp=THRESHOLD_VPP)

    @property
    def reference_vibration(self) -> ReferenceVibration:
        """The stimulus for which the threshold is known; nothing where no curve is used."""
        return ReferenceVibration(
            **{name: getattr(self, curve.key) for name, curve in VALID_RANGES.items()}
        )

    @cached_property
    def median(self) -> Observer:
        """The median participant, with the fingers of both hands."""
        names = {field.name for field in fields(Observer)}
        return Observer(**self.model_dump(include=names, exclude_none=True))

    def draw(self, distance_mm: float, rng: np.random.Generator) -> Observer:
        """Draw a participant whose fingers are some distance apart."""
        median = self.median
        if self.masking_slope is not None and self.masking_falloff_mm is not None:
            falloff = math.exp(-distance_mm / self.masking_falloff_mm)
            median = replace(median, masking_slope=self.masking_slope * falloff)
        spreads = self.model_dump(include=_SPREADS, exclude_none=True)
        return draw_observer(median, self.threshold_sd_db, rng, **spreads)
