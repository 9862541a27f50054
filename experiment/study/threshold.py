"""Thresholds of a study's simulated participants, and what its stimuli take from their curves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain
from statistics import NormalDist, fmean, geometric_mean
from typing import TYPE_CHECKING, Literal

from experiment.perception.thresholds import Vibration
from experiment.study.base import Fault
from experiment.study.simulation import CURVE_KEYS, Simulation
from stimuli import Burst

if TYPE_CHECKING:
    from experiment.perception.gains import FingerGains
    from experiment.perception.thresholds import Extrapolation
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study


def threshold_vpp(population: Simulation, gains: FingerGains) -> float:
    """Return the level that the median person feels half of the time, in the middle of fingers."""
    if population.threshold_vpp is not None:
        return population.threshold_vpp
    assert population.threshold_um is not None  # one of the two is given
    return population.threshold_um / _um_per_vpp(gains)


def _um_per_vpp(gains: FingerGains) -> float:
    return geometric_mean(gains.own)


@dataclass(frozen=True, slots=True, kw_only=True)
class MedianThreshold:
    """What the median simulated participant detects half of the time in one condition.

    Attributes
    ----------
    condition : str
        The condition.
    threshold_vpp, threshold_um : float, float or None
        The threshold of its burst, the geometric mean of the fingers; None where no displacement is
        known.
    finger_vpp : dict of float
        The level at which the finger at each site gets that displacement.
    reference_value, reference_unit : float, str
        The threshold in the study, in V or um.
    reference : dict of str
        Frequency, duration and area that it holds for; empty if it is that of the burst.
    levels_lie : str
        Where the study's levels lie: on both sides of the threshold, or all on one.
    levels_db : tuple of float
        The lowest and the highest level, dB re the threshold.
    levels_below : int
        Number of levels below the threshold.
    detected : float
        Share of single stimuli that this participant detects.
    """

    condition: str
    threshold_vpp: float
    threshold_um: float | None
    finger_vpp: dict[str, float]
    reference_value: float
    reference_unit: Literal["V", "um"]
    reference: dict[str, float]
    levels_lie: Literal["around", "below", "above"]
    levels_db: tuple[float, float]
    levels_below: int
    detected: float


def median_threshold(study: Study, gains: FingerGains, *, index: int = 0) -> MedianThreshold:
    """Return where simulated participants' thresholds lie in the condition with this index.

    `gains` are those of that condition.
    """
    people, condition = study.simulation, study.conditions[index]
    is_level = people.threshold_vpp is not None
    value = people.threshold_vpp if is_level else people.threshold_um
    assert value is not None  # one of the two is given
    shift_db = _curve_shift_db(study, condition) + (people.difference_db or 0.0) * (index == 1)
    level_vpp = threshold_vpp(people, gains) * 10 ** (shift_db / 20)
    levels_vpp = study.design.levels_vpp
    low_db, high_db = (20 * math.log10(f(levels_vpp) / level_vpp) for f in (min, max))
    below = sum(level < level_vpp for level in levels_vpp)
    curve = NormalDist(math.log10(level_vpp), people.sigma)
    return MedianThreshold(
        condition=condition.name,
        threshold_vpp=level_vpp,
        threshold_um=None if gains.basis is None else level_vpp * _um_per_vpp(gains),
        finger_vpp={
            site: level_vpp * _um_per_vpp(gains) / gain
            for site, gain in zip(study.task.sites, gains.own, strict=True)
        },
        reference_value=value,
        reference_unit="V" if is_level else "um",
        reference=people.reference_vibration.values,
        levels_lie="below" if high_db <= 0 else "around" if below else "above",
        levels_db=(low_db, high_db),
        levels_below=below,
        detected=fmean(curve.cdf(math.log10(level)) for level in levels_vpp),
    )


def people_for_burst(study: Study) -> Simulation:
    """Return the people with their threshold for the first condition's burst, which has no curve.

    StudyError where fingers of different sizes have different thresholds.

    >>> from experiment.study.files import paper_study
    >>> simulation = {"threshold_vpp": 70, "threshold_at_hz": 250}
    >>> people = people_for_burst(paper_study().changed(simulation=simulation))
    >>> people.threshold_vpp > 70, people.threshold_at_hz  # the paper's burst has 500 Hz
    (True, None)
    """
    people = study.simulation
    fingers = vibrations(study).get(study.conditions[0].name, ())
    if not fingers:
        return people
    shifts_db = [people.reference_vibration.shift_db(vibration) for vibration in fingers]
    if not math.isclose(min(shifts_db), max(shifts_db), abs_tol=1e-9):
        rule = "must be left out where finger_diameter_mm of the driven actuators differ"
        raise study.refused(Fault("simulation.threshold_at_cm2", rule, people.threshold_at_cm2))
    name = "threshold_vpp" if people.threshold_um is None else "threshold_um"
    shifted = {name: getattr(people, name) * 10 ** (shifts_db[0] / 20)}
    return people.completed(**dict.fromkeys(CURVE_KEYS), **shifted)


def vibrations(study: Study) -> dict[str, tuple[Vibration, ...]]:
    """Return what the finger at each site gets in each condition that has a sine burst.

    >>> from experiment.study.files import paper_study
    >>> [fingers[0].frequency_hz for fingers in vibrations(paper_study()).values()]
    [500.0]
    """
    bursts = ((each.name, each.drive) for each in study.conditions)
    return {name: vibrations_of(study, burst) for name, burst in bursts if isinstance(burst, Burst)}


def _curve_shift_db(study: Study, condition: Condition) -> float:
    """Return by how much the curves raise the threshold, the mean of all fingers."""
    shift_db, fingers = study.simulation.reference_vibration.shift_db, vibrations(study)
    return fmean(map(shift_db, fingers[condition.name])) if condition.name in fingers else 0.0


def vibrations_of(study: Study, burst: Burst) -> tuple[Vibration, ...]:
    """Return what the finger at each site of a study gets of a burst."""
    return tuple(
        Vibration(
            frequency_hz=burst.frequency_hz,
            duration_s=burst.energy_duration_s,
            area_cm2=math.pi * (100 * actuator.finger_diameter_m) ** 2 / 4,
        )
        for actuator in study.driven
    )


def extrapolations(study: Study) -> tuple[Extrapolation, ...]:
    """Return where the curves that a study uses were not measured, each curve once."""
    every = chain.from_iterable(vibrations(study).values())
    return study.simulation.reference_vibration.extrapolations(*every)
