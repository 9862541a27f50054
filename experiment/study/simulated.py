"""What the threshold curves of simulated people are asked for by a study's stimuli."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from experiment.terms.curves import Vibration
from stimuli import Burst

if TYPE_CHECKING:
    from experiment.study.study import Study


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
