"""The part of a study's check that tells displacements: what each finger gets, in um and dB."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

from experiment.gains import OWN_FINGERS, significant

if TYPE_CHECKING:
    from experiment.gains import ConditionGains
    from experiment.study_check import ConditionCheck, StudyCheck

COLUMN: Final = 15
"""Where the values begin in the text of a check."""


def displacement_facts(check: StudyCheck, found: ConditionCheck) -> dict[str, Any] | None:
    """List the displacements of a condition at the highest level; keys carry their unit.

    Parameters
    ----------
    check : StudyCheck
        The check of the study.
    found : ConditionCheck
        That of one of its conditions.

    Examples
    --------
    >>> from experiment.study import paper_study
    >>> from experiment.study_check import check_study
    >>> check = check_study(paper_study())
    >>> left = displacement_facts(check, check.conditions[0])["actuators"][0]
    >>> left["name"], left["basis"], 5.2 < left["own_um"] < 5.6
    ('left', 'measured', True)
    """
    from experiment.plate import field_strip

    gains = found.gains
    if gains is None:
        return None
    return {
        "level_vpp": check.study.design.highest_vpp,
        "strip_length_m": field_strip(check.study).length_m,
        "viscous_time_s": viscous_time_s(check, found),
        "actuators": [
            {
                "name": name,
                "basis": gains.bases[place],
                "own_um": _peak_um(check, gains, place, place),
                "fingers": [
                    {
                        "finger": OWN_FINGERS[finger],
                        "peak_um": _peak_um(check, gains, finger, place),
                        "level_db": gains.level_db(finger, place),
                    }
                    for finger in _fingers_of(place)
                ],
            }
            for place, name in enumerate(gains.actuators)
        ],
    }


def displacement_lines(check: StudyCheck, found: ConditionCheck) -> list[str]:
    """Write the same as aligned plain text.

    Parameters
    ----------
    check : StudyCheck
        The check of the study.
    found : ConditionCheck
        That of one of its conditions.
    """
    gains = found.gains
    if gains is None:
        return []
    what = "peak of the burst over the fingertip's contact area"
    head = f"{what} at {check.study.design.highest_vpp:g} Vpp, {strip_text(check)}"
    lines = [f"{'displacement':{COLUMN}}{head}"]
    for place, name in enumerate(gains.actuators):
        own = _amount(check, gains, place, place)
        others = [
            f"{_amount(check, gains, finger, place)}{gains.level_db(finger, place):.1f} dB at the "
            f"{OWN_FINGERS[finger]} finger"
            for finger in _fingers_of(place)
        ]
        basis = gains.bases[place] or "n/a, its displacement is not stated"
        lines.append(f"{'  ' + name:{COLUMN}}{own}{basis}; {'; '.join(others)}")
    lines.append(f"{'':{COLUMN}}{-found.masking_limit_db:g} dB at the other finger is the limit")
    if check.study.strip.length_m is not None:
        what = "the free ends are left out: they send back what lies above the cut-off, which"
        lines.append(f"{'':{COLUMN}}{what}")
        lines.append(f"{'':{COLUMN}}raises the level at the other finger (docs/model.md, 9)")
    return [*lines, *loss_lines(check, found)]


def loss_lines(check: StudyCheck, found: ConditionCheck) -> list[str]:
    """Say what a constant loss factor was turned to."""
    loss_factor = check.study.strip.material.loss_factor
    if loss_factor == 0:
        return []
    time_s = viscous_time_s(check, found)
    same_hz = loss_factor / (2 * math.pi * (time_s - check.study.strip.material.viscous_time_s))
    return [
        f"{'':{COLUMN}}loss factor {loss_factor:g} computed as the viscous time of the same loss",
        f"{'':{COLUMN}}at {same_hz:.0f} Hz: {time_s * 1e6:.3g} us in all",
    ]


def viscous_time_s(check: StudyCheck, found: ConditionCheck) -> float:
    """Return the Kelvin-Voigt time that the displacements were computed with.

    Parameters
    ----------
    check : StudyCheck
        The check of the study.
    found : ConditionCheck
        That of one of its conditions.
    """
    from experiment.plate import field_strip
    from stimuli import causal

    return causal(field_strip(check.study), found.condition.burst).material.viscous_time_s


def strip_text(check: StudyCheck) -> str:
    """Say which strip the displacements were computed for."""
    from experiment.plate import field_strip

    if field_strip(check.study).length_m is None:
        return "of an endless strip"
    return "of the finite strip"


def _fingers_of(place: int) -> list[int]:
    """List the fingers that an actuator is not under, as rows of the matrix."""
    return [finger for finger in range(len(OWN_FINGERS)) if finger != place]


def _peak_um(check: StudyCheck, gains: ConditionGains, row: int, column: int) -> float | None:
    if gains.bases[column] is None:
        return None
    return significant(gains.per_vpp[row][column] * check.study.design.highest_vpp)


def _amount(check: StudyCheck, gains: ConditionGains, row: int, column: int) -> str:
    peak_um = _peak_um(check, gains, row, column)
    return "" if peak_um is None else f"{peak_um:.3g} um, "
