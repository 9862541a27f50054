"""Who the simulated people of a study are, and what its stimuli ask of their threshold curves."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING

from experiment.study.origins import YOURS, stated
from experiment.study.sections.simulation import CURVE_KEYS, Simulation
from experiment.study.study import UnusableStudyError
from experiment.terms.curves import Vibration
from stimuli import Burst

if TYPE_CHECKING:
    from experiment.study.study import Study
    from experiment.terms.gains import FingerGains


def threshold_vpp(population: Simulation, gains: FingerGains) -> float:
    """Return the level that the median person feels half of the time, in the middle of fingers."""
    if population.threshold_vpp is not None:
        return population.threshold_vpp
    assert population.threshold_um is not None  # one of the two is given
    return population.threshold_um / math.sqrt(gains.left[0] * gains.right[1])


def people_words(study: Study, gains: FingerGains) -> tuple[str, ...]:
    """Say where simulated people's thresholds lie, who says so, and what it makes of the levels.

    `gains` are those of the first condition.

    >>> from experiment.study.read import study_from_text
    >>> from experiment.terms.gains import OWN_FINGER_ONLY
    >>> text = "simulation = { threshold_vpp = 70 }"
    >>> print(*people_words(study_from_text(text, "study.toml"), OWN_FINGER_ONLY))
    As the study states: median threshold 70 V, SD between people 1.5 dB.
    """
    people, levels, condition = study.simulation, study.design.levels_vpp, study.conditions[0].name
    key = "threshold_vpp" if people.threshold_um is None else "threshold_um"
    own = stated(people, key, by_value=False)
    whose = "As the study states" if own == YOURS else "Assumed"
    shifts_db = [people.known_for.shift_db(one) for one in vibrations(study).get(condition, ())]
    shift = 10 ** (sum(shifts_db) / 2 / 20)
    median_vpp = threshold_vpp(people, gains) * shift
    told, unit = (people.threshold_um, "um") if people.threshold_um else (median_vpp / shift, "V")
    parts = [f"{told * shift:.3g} um"] if unit == "um" else []
    parts += [f"{told:g} {unit}{people.known_for.words}"] if shifts_db else []
    known = f" ({'; '.join(parts)})" if parts else ""
    where = f" in condition {condition}" if len(study.conditions) > 1 else ""
    spread = f"SD between people {people.threshold_sd_db:g} dB"
    words = f"{whose}: median threshold {median_vpp:.3g} V{known}{where}, {spread}."
    below, above = min(levels) < median_vpp, max(levels) > median_vpp
    if below and above:
        return (words,)
    side = "above" if above else "below"
    return words, f"All levels lie {side} that: expect an open interval, or only a bound."


def people_for_burst(study: Study) -> Simulation:
    """Return the people with their threshold for the first condition's burst, which has no curve.

    UnusableStudyError where fingers of two sizes have two thresholds.

    >>> from experiment.study.read import study_from_text
    >>> text = "simulation = { threshold_vpp = 70, threshold_at_hz = 250 }"
    >>> people = people_for_burst(study_from_text(text, "study.toml"))
    >>> people.threshold_vpp > 70, people.threshold_at_hz  # the paper's burst has 500 Hz
    (True, None)
    """
    people = study.simulation
    both = vibrations(study).get(study.conditions[0].name, ())
    if not both:
        return people
    left_db, right_db = (people.known_for.shift_db(one) for one in both)
    if not math.isclose(left_db, right_db, abs_tol=1e-9):
        raise UnusableStudyError(
            study.name,
            "simulation.threshold_at_cm2 must be left out where finger_diameter_mm of the left and "
            "the right actuator differ; got one that gives them "
            f"thresholds {abs(left_db - right_db):.2g} dB apart",
        )
    name = "threshold_vpp" if people.threshold_um is None else "threshold_um"
    known: float = getattr(people, name)
    shifted = {name: known * 10 ** (left_db / 20)}
    return Simulation(**(asdict(people) | dict.fromkeys(CURVE_KEYS) | shifted))


def vibrations(study: Study) -> dict[str, tuple[Vibration, Vibration]]:
    """Return what left and right finger get in each condition; nothing where no curve is used.

    >>> from experiment.study.read import paper_study
    >>> vibrations(paper_study())
    {}
    """
    if not study.simulation.known_for.stated:
        return {}
    found = {}
    for condition in study.conditions:
        burst = condition.drive
        if not isinstance(burst, Burst):  # which a study refuses
            continue
        left, right = (
            Vibration(
                frequency_hz=burst.frequency_hz,
                duration_s=burst.cycles / burst.frequency_hz,
                area_cm2=math.pi * (100 * one.finger_diameter_m) ** 2 / 4,
            )
            for one in study.actuators[:2]
        )
        found[condition.name] = left, right
    return found


def unmeasured(study: Study) -> tuple[str, ...]:
    """Say where the curves that a study uses were not measured, each thing once."""
    known = study.simulation.known_for
    told = (
        words
        for both in vibrations(study).values()
        for one in both
        for words in known.unmeasured(one)
    )
    return tuple(dict.fromkeys(told))
