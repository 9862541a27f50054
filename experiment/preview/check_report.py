"""The check of a study in words for a terminal, and as JSON for programs."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, Final

from experiment.study.sections.stimulus import stimulus_facts
from experiment.terms.gains import OWN_FINGERS, significant
from stimuli import CLAMPED, SIMPLY_SUPPORTED, Burst

if TYPE_CHECKING:
    from experiment.preview.check import ConditionCheck, StudyCheck
    from experiment.study.sections.design import Design
    from experiment.study.sections.plate import Actuator
    from experiment.study.sections.stimulus import Condition
    from experiment.study.study import Study
    from experiment.terms.gains import ConditionGains


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
    >>> from experiment.study.read import paper_study
    >>> from experiment.preview.check import check_study
    >>> check = check_study(paper_study())
    >>> left = displacement_facts(check, check.conditions[0])["actuators"][0]
    >>> left["name"], left["basis"], 5.2 < left["own_um"] < 5.6
    ('left', 'measured', True)
    """
    from experiment.study.physics import field_strip

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
    from experiment.study.physics import field_strip
    from stimuli import causal

    return causal(field_strip(check.study), found.condition.burst).material.viscous_time_s


def strip_text(check: StudyCheck) -> str:
    """Say which strip the displacements were computed for."""
    from experiment.study.physics import field_strip

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


JSON_SCHEMA: Final = 1
_VERDICTS: Final = {
    "fit": "fit: below the strip's cut-off, and masked at the other finger",
    "accepted": "unfit, and accepted by the study: the other finger may feel it too",
    "unfit": (
        "UNFIT: change [burst], the actuators' places or the device's sample rate, "
        "or say in accept_unfit why this stimulus is wanted"
    ),
}
THICK: Final = 0.1
"""From this (k h)^2 on, the theory of thin plates misses by more than a few per cent."""


def check_json(check: StudyCheck) -> str:
    """Write a check as one JSON object on one line; keys carry their SI unit.

    Parameters
    ----------
    check : StudyCheck
        What the check found.

    Examples
    --------
    >>> from experiment.study.read import paper_study
    >>> from experiment.preview.check import check_study
    >>> found = json.loads(check_json(check_study(paper_study())))
    >>> found["verdict"], round(found["strip"]["cutoff_hz"], 6)
    ('fit', 2900.0)
    """
    study = check.study
    report = {
        "schema": JSON_SCHEMA,
        "verdict": check.verdict,
        "study": {"name": study.name, "sha256": study.sha256},
        "strip": _strip_facts(check),
        "max_energy_above_cutoff": study.max_energy_above_cutoff,
        "masking_limit_db": study.masking_limit_db,
        "actuators": [_actuator_facts(actuator) for actuator in study.actuators],
        "conditions": [_condition_facts(check, condition) for condition in check.conditions],
        "device": asdict(study.device),
        "design": asdict(study.design),
        "trials": check.trials,
        "blocks": check.blocks,
        "audibility_trials": check.audibility_trials,
        "control_trials": check.control_trials,
        "duration_s": check.duration_s,
    }
    return json.dumps(report, allow_nan=False)


def _strip_facts(check: StudyCheck) -> dict[str, Any]:
    strip = check.study.strip
    return {
        "width_m": strip.width_m,
        "length_m": strip.length_m,
        "thickness_m": strip.thickness_m,
        "edge": check.study.edge_basis,
        "edge_stiffness_n": check.edge_stiffness_n,
        "loss_factor": strip.material.loss_factor,
        "viscous_time_s": strip.material.viscous_time_s,
        "cutoff_hz": check.cutoff_hz,
        "thinness": check.thinness,
    }


def _actuator_facts(actuator: Actuator) -> dict[str, Any]:
    return {
        "name": actuator.label,
        "side": actuator.side,
        "shape": actuator.shape,
        "x_m": actuator.x_m,
        "y_m": actuator.y_m,
        "diameter_m": actuator.diameter_m,
        "length_x_m": actuator.length_x_m,
        "length_y_m": actuator.length_y_m,
        "finger_diameter_m": actuator.finger_diameter_m,
    }


def _condition_facts(check: StudyCheck, found: ConditionCheck) -> dict[str, Any]:
    condition = found.condition
    return {
        "name": condition.name,
        "verdict": found.verdict,
        "reasons": found.reasons,
        "accept_unfit": condition.accept_unfit,
        "burst": stimulus_facts(condition),
        "duration_s": condition.burst.duration_s,
        "peak_hz": found.burst.peak_hz,
        "band_hz": found.burst.band_hz,
        "energy_above_cutoff": found.burst.energy_above_cutoff,
        "staircase_energy_above_cutoff": found.burst.staircase_energy_above_cutoff,
        "displacements": displacement_facts(check, found),
    }


def check_text(check: StudyCheck, file_name: str) -> str:
    """Write a check as aligned plain text.

    Parameters
    ----------
    check : StudyCheck
        What the check found.
    file_name : str
        Where the study was read from.

    Examples
    --------
    >>> from experiment.study.read import paper_study
    >>> from experiment.preview.check import check_study
    >>> print(check_text(check_study(paper_study()), "study.toml").splitlines()[-1])
    verdict        fit: below the strip's cut-off, and masked at the other finger
    """
    study = check.study
    lines = [_line("study", f"{study.name} ({file_name}), sha256 {study.sha256[:12]}")]
    lines += _strip_lines(check)
    for actuator in study.actuators:
        lines.append(_line(actuator.label, _actuator_text(actuator)))
    for condition in check.conditions:
        lines += ["", *_condition_lines(condition), *displacement_lines(check, condition)]
        lines += _verdict_lines(condition)
    lines += ["", *_plan_lines(check), "", _line("verdict", _VERDICTS[check.verdict])]
    return "\n".join(lines)


def _line(name: str, text: str) -> str:
    return f"{name:{COLUMN}}{text}"


def _strip_lines(check: StudyCheck) -> list[str]:
    strip, material = check.study.strip, check.study.strip.material
    length = "endless" if strip.length_m is None else f"{strip.length_m * 1e3:g}"
    lines = [
        _line(
            "strip",
            f"{strip.width_m * 1e3:g} x {length} x {strip.thickness_m * 1e3:g} mm; "
            f"{material.youngs_modulus_pa / 1e9:g} GPa, Poisson's ratio "
            f"{material.poisson_ratio:g}, {material.density_kg_m3:g} kg/m3",
        ),
        _line("cut-off", f"{check.cutoff_hz:.1f} Hz, {_basis(check)}"),
    ]
    if check.edge_stiffness_n is not None:
        ends_hz = [replace(strip, edge=edge).cutoff_hz() for edge in (SIMPLY_SUPPORTED, CLAMPED)]
        lines.append(
            _line("", f"simply supported edges give {ends_hz[0]:.1f} Hz, clamped {ends_hz[1]:.1f}")
        )
    if check.thinness > THICK:
        lines.append(
            _line("warning", f"not a thin plate: (k h)^2 = {check.thinness:.2g} at the cut-off")
        )
    if check.study.edge_basis == "measured-cutoff":
        lines.append(_line("", "a clamped strip that is a little wider can have the same cut-off"))
    return lines


def _basis(check: StudyCheck) -> str:
    if check.study.edge_basis == "measured-cutoff":
        return f"measured; as of elastic edges of K = {check.edge_stiffness_n:.2f} N"
    if check.edge_stiffness_n is not None:
        return f"computed from elastic edges of K = {check.edge_stiffness_n:g} N"
    return f"computed from {check.study.edge_basis} edges"


def _actuator_text(actuator: Actuator) -> str:
    lengths_m = (actuator.diameter_m, actuator.length_x_m, actuator.length_y_m)
    size = " x ".join(f"{length_m * 1e3:g}" for length_m in lengths_m if length_m is not None)
    return (
        f"{actuator.shape} {size} mm at x = {actuator.x_m * 1e3:g}, y = {actuator.y_m * 1e3:g} mm"
    )


def _condition_lines(check: ConditionCheck) -> list[str]:
    found = check.burst
    lower_hz, upper_hz = found.band_hz
    ideal = "ideal burst's" if isinstance(check.condition.burst, Burst) else "samples'"
    return [
        _line("condition", f"{check.condition.name}: {check.verdict}"),
        _line("burst", _burst_text(check.condition)),
        *_auto_lines(check.condition),
        _line("band", f"{lower_hz:.1f} to {upper_hz:.1f} Hz at half power"),
        _line("above cut-off", f"{found.energy_above_cutoff:.2e} of the {ideal} energy"),
        _line(
            "",
            f"{found.staircase_energy_above_cutoff:.2e} of its staircase's at "
            f"{found.sample_rate_hz:g} Hz",
        ),
        _line("", f"{found.max_energy_above_cutoff:.2e} is the limit"),
    ]


def _burst_text(condition: Condition) -> str:
    burst = condition.burst
    if not isinstance(burst, Burst):
        return f"{condition.file}, scaled to a peak of 1, {burst.duration_s * 1e3:g} ms"
    cycles = "1 cycle" if burst.cycles == 1 else f"{burst.cycles} cycles"
    window = "no window" if burst.window == "none" else f"{burst.window} window"
    return f"{cycles} of {burst.frequency_hz:g} Hz, {window}, {burst.duration_s * 1e3:g} ms"


def _auto_lines(condition: Condition) -> list[str]:
    """Say what a window that the program chose costs."""
    auto = condition.auto
    if auto is None:
        return []
    extra_s = condition.burst.duration_s - auto.stated_s
    return [
        _line(
            "window = auto",
            f"the shortest with {auto.wanted_level_db:g} dB at the other finger; it costs "
            f"{extra_s * 1e3:g} ms more than the {auto.stated_s * 1e3:g} ms stated",
        )
    ]


def _verdict_lines(check: ConditionCheck) -> list[str]:
    lines = [_line("unfit", reason) for reason in check.reasons]
    if check.verdict == "accepted":
        lines.append(_line("accepted", f"{check.condition.accept_unfit}"))
    return lines


def _plan_lines(check: StudyCheck) -> list[str]:
    study, design = check.study, check.study.design
    each = f"{len(study.conditions)} conditions with " if len(study.conditions) > 1 else ""
    return [
        _line("device", _device_text(study)),
        _line("answers", ", ".join(design.responses)),
        _line("levels", _levels_text(design)),
        _line(
            "trials",
            f"{check.trials}: {each}{design.trials_per_side} left, {design.trials_per_side} right, "
            f"{design.both_trials} both, {design.blank_trials} blank; "
            f"{design.practice_trials} for practice before",
        ),
        *_off_plate_lines(check),
        _line(
            "session",
            f"about {math.ceil(check.duration_s / 60)} min in {check.blocks} blocks, "
            f"breaks of {design.minimum_break_s:g} s",
        ),
    ]


def _off_plate_lines(check: StudyCheck) -> list[str]:
    """Tell how many trials there are with the fingers off the plate, if any."""
    if not check.audibility_trials and not check.control_trials:
        return []
    highest_vpp = check.study.design.highest_vpp
    return [
        _line(
            "fingers off",
            f"{check.audibility_trials} trials before everything else, is the plate heard; "
            f"{check.control_trials} at the end; all at {highest_vpp:g} Vpp",
        )
    ]


def _device_text(study: Study) -> str:
    device = study.device
    return (
        f"{device.driver} at {device.sample_rate_hz:g} Hz; highest level "
        f"{max(study.design.levels_vpp):g} Vpp, ceiling {device.ceiling_vpp:g} Vpp"
    )


def _levels_text(design: Design) -> str:
    levels = " ".join(f"{level_vpp:g}" for level_vpp in design.levels_vpp)
    share = design.trials_per_side / len(design.levels_vpp)
    if design.order == "balanced":
        return f"{levels} Vpp, balanced: {share:g} of each side and level"
    spread = math.sqrt(share * (1 - 1 / len(design.levels_vpp)))
    return f"{levels} Vpp, drawn at random: {share:.3g} +- {spread:.2g} of each side and level"
