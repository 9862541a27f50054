"""The report of `tactstrip check`: a dict that is its JSON output, and that templates print."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import permutations
from typing import TYPE_CHECKING, Any, Final

from device.drivers import MOCK, NEEDS, channel_fault
from experiment.check.check import alternative_edge, check_study, with_each_edge
from experiment.check.warnings import apply_rules, sort_warnings
from experiment.hardware.setup import device_faults, noise_faults
from experiment.perception.gains import UNEQUAL_DB
from experiment.study.design import ASSUMED_ANSWER_S
from experiment.study.physics import chosen_window
from experiment.study.stimulus import stimulus_values
from experiment.study.threshold import extrapolations, median_threshold
from experiment.tasks.task import SINGLE
from experiment.trial.draw import block_lengths
from experiment.trial.order import order_count
from stimuli import CLAMPED, SIMPLY_SUPPORTED, ElasticEdge
from stimuli.plate.patch import laminate, layer_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from device.driver import Lack
    from experiment.check.check import ConditionCheck, StudyCheck
    from experiment.check.device import DeviceCheck
    from experiment.check.warnings import Rule
    from experiment.perception.gains import ConditionGains
    from experiment.study.actuator import Actuator
    from experiment.study.equipment import DeviceSettings
    from experiment.study.study import Study

SCHEMA: Final = 2
_THICK: Final = 0.1
"""From this (k h)^2 on, the theory of thin plates is wrong by more than a few per cent."""
_MIN_MODEL_DB: Final = -60.0
"""Below this level sound, bars and table may carry more than the plate does (assumed)."""
_NEAR_CUTOFF: Final = 0.02
"""A measured cut-off that is off by more says that a size or an edge is not as stated."""
_NEAR_THRESHOLD_DB: Final = 3.0
"""Levels that end nearer to the threshold leave a part of the psychometric function untried."""
_NEAR_MODE: Final = 1.03
"""A ratio of displacements, of the assumed losses, from which on a measurement is uncertain."""
_TRIALS_PER_SITE: Final = 5
"""Times the number of sites: with fewer trials of each, information transfer is biased."""
_PLASTICS: Final = ("pmma", "polycarbonate")
_MIN_INPUT_TOLERANCE_MS: Final = 20.0
"""What two cards without a common clock need: docs/monitor.md."""
_DECISIONS: Final = (
    ("design", "levels_vpp"),
    ("device", "ceiling_vpp"),
    ("masking", "level_dbfs"),
    ("simulation", "threshold_um"),
    ("simulation", "threshold_vpp"),
)
"""Keys with defaults that a result or somebody's safety depends on."""
_MEASURED_KEYS: Final = ("measured_cutoff_hz", "measured_displacement_um", "per_unit")
_IDEAL_EDGES: Final = {"simply-supported": SIMPLY_SUPPORTED, "clamped": CLAMPED}


def report_study(
    check: StudyCheck,
    file_name: str,
    machine: Iterable[tuple[str, Lack]] = (),
    *,
    device: DeviceSettings | None = None,
    device_check: DeviceCheck | None = None,
) -> dict[str, Any]:
    """Report the check of a study.

    Parameters
    ----------
    check : StudyCheck
        The check.
    file_name : str
        The file of the study.
    machine : iterable of (str, Lack)
        What needs equipment that this computer lacks; it has no influence on the verdict.
    device : DeviceSettings, optional
        The settings in use, where they are others than the study's.
    device_check : DeviceCheck, optional
        The check of the device.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> report = report_study(check_study(paper_study(), gains=()), "study.toml")
    >>> report["verdict"], round(report["strip"]["cutoff_hz"], 6)
    ('within limits', 2900.0)
    """
    study, design = check.study, check.study.design
    device = study.device if device is None else device
    is_balanced, strip = design.condition_order == "balanced", _report_strip(check)
    simulated = simulated_participants(study, check.gains) if check.gains else None
    channels = channel_fault(device.driver, device.channels)
    faults = (*device_faults(device), *noise_faults(study, device))
    refusals = [*map(str, faults), *([channels] if channels else [])]
    missing = [
        {"need": need, "equipment": lack.what, "remedy": lack.remedy} for need, lack in machine
    ]
    rules = [
        *_condition_rules(check),
        *_plate_rules(check, strip),
        *((True, "refused_device", {"reason": reason}) for reason in refusals),
        *_device_rules(study, device),
        *_design_rules(study),
        *((True, "missing_equipment", lack) for lack in missing),
    ]
    warnings = [warning for tested in check.conditions for warning in tested.violations]
    warnings += [*apply_rules(rules), *(simulated["warnings"] if simulated else ())]
    return {
        "schema": SCHEMA,
        "file": file_name,
        "verdict": check.verdict,
        "study": _values(study, "name", "sha256"),
        "strip": strip,
        **_values(study.burst, "max_energy_above_cutoff", "masking_threshold_db"),
        "actuators": [_report_actuator(study, actuator) for actuator in study.actuators],
        "conditions": [_report_condition(check, tested) for tested in check.conditions],
        "device": device.model_dump(),
        "highest_level_vpp": study.highest_vpp,
        "full_scale_vpp": _full_scale_vpp(device),
        "run_refuses": refusals,
        "monitor": None if study.monitor.source == "none" else study.monitor.model_dump(),
        "contact": study.contact.model_dump(),
        "design": design.model_dump() | {"both_level_vpp": design.both_level_vpp},
        "task": study.task.name,
        "sites": study.task.sites,
        "intervals": study.task.n_intervals,
        "trials": check.trials,
        "stimuli": dict.fromkeys(study.task.sites, design.trials_per_side)
        | {kind: design.trials_of(kind) for kind in study.task.kinds if kind != SINGLE},
        "block_trials": block_lengths(design, study.task),
        "repeats": design.trials_per_side / len(design.levels_vpp),
        "level_rule": study.levels.rule,
        "both_fraction": design.both_trials / (check.trials - design.blank_trials),
        "condition_orders": order_count(len(study.conditions)) if is_balanced else None,
        "hands_off_trials_before": design.hands_off_trials_before * len(study.conditions),
        "hands_off_trials_after": design.hands_off_trials_after * len(study.conditions),
        **_values(check, "blocks", "duration_s"),
        "answer_s": min(ASSUMED_ANSWER_S, design.response_window_s),
        "simulated": simulated,
        "provenance": _provenance(study),
        "machine": missing,
        "warnings": sort_warnings(warnings) + (device_check.warnings if device_check else ()),
        "device_check": device_check,
    }


def _values(source: object, *names: str) -> dict[str, Any]:
    """Return attributes by their names."""
    return {name: getattr(source, name) for name in names}


def _full_scale_vpp(device: DeviceSettings) -> float | None:
    """Return the full scale of a sound card; None for a built-in driver that has none."""
    uses_full_scale = "volts_full_scale" in NEEDS.get(device.driver, ("volts_full_scale",))
    peak_v = device.volts_full_scale
    return 2 * peak_v if uses_full_scale and peak_v is not None else None


# --- plate and actuators --------------------------------------------------------------------------


def _report_strip(check: StudyCheck) -> dict[str, Any]:
    plate, strip = check.study.plate, check.study.strip
    edge, material, cutoff_hz = strip.edge, strip.material, check.cutoff_hz
    measured_hz = None if plate.edge == "measured-cutoff" else plate.measured_cutoff_hz
    ideal_hz = {name: replace(strip, edge=of).cutoff_hz() for name, of in _IDEAL_EDGES.items()}
    mass_kg_m2 = material.density_kg_m3 * strip.thickness_m
    k_squared = 2 * math.pi * cutoff_hz * math.sqrt(mass_kg_m2 / strip.bending_stiffness_n_m)
    return {
        **_values(strip, "width_m", "length_m", "thickness_m"),
        "material": plate.material,
        **_values(material, "youngs_modulus_pa", "poisson_ratio", "density_kg_m3"),
        **_values(material, "loss_factor", "viscous_time_s"),
        "cutoff_hz": cutoff_hz,
        "edge": plate.edge,
        "edge_stiffness_n": edge.stiffness_n if isinstance(edge, ElasticEdge) else None,
        "measured_cutoff_hz": plate.measured_cutoff_hz,
        "measured_above_computed": measured_hz and measured_hz / cutoff_hz - 1,
        "ideal_cutoffs_hz": ideal_hz if isinstance(edge, ElasticEdge) else None,
        "alternative_edge": _report_alternative(check),
        "thinness": k_squared * strip.thickness_m**2,  # (k h)^2 at the cut-off
    }


def _report_alternative(check: StudyCheck) -> dict[str, Any] | None:
    edge = alternative_edge(check.study)
    if edge is None:
        return None
    cutoff_hz = replace(check.study.strip, edge=_IDEAL_EDGES[edge]).cutoff_hz()
    report = {"edge": edge, "cutoff_hz": cutoff_hz, "crosstalk_db": None, "verdict": None}
    try:
        _, study = with_each_edge(check.study)
        alternative = check_study(study, None if check.gains else ())
    except ValueError as error:  # what was measured may not suit such a plate
        return report | {"refusal": str(error)}
    return report | _values(alternative, "crosstalk_db", "verdict") | {"refusal": None}


def _report_actuator(study: Study, actuator: Actuator) -> dict[str, Any]:
    measured = None if actuator.measured_displacement_um is None else "measured"
    predicted = None if actuator.piezo_d31_pm_v is None else "predicted"
    stiffness, mass = None, None
    if actuator.patch is not None:
        layer = layer_of(study.strip.material, study.strip.thickness_m)
        bare, bonded = laminate([layer]), laminate([layer, *actuator.patch.layers])
        stiffness = bonded.biaxial_n_m / bare.biaxial_n_m
        mass = bonded.mass_kg_m2 / bare.mass_kg_m2
    sizes = ("diameter_m", "length_x_m", "length_y_m", "finger_diameter_m")
    return {
        "name": actuator.label,
        **_values(actuator, "site", "shape", "x_m", "y_m", *sizes),
        "displacement": "copied" if actuator.assumed_equal_to else measured or predicted,
        **_values(actuator, "measured_displacement_um", "measured_at_vpp", "measured_at_hz"),
        **_values(actuator, "measured_as", "patch_counts"),
        "patch_stiffness_ratio": stiffness,
        "patch_mass_ratio": mass,
    }


def _plate_rules(check: StudyCheck, strip: dict[str, Any]) -> Iterator[Rule]:
    study, plate = check.study, check.study.plate
    if (alternative := strip["alternative_edge"]) is not None:
        data = {"alternative": alternative["edge"], "cutoff_hz": alternative["cutoff_hz"]}
        crosstalk_db, refusal = alternative["crosstalk_db"], alternative["refusal"]
        yield refusal is not None, "other_edge_unknown", data | {"reason": refusal}
        if crosstalk_db is not None:
            limit_db = -study.burst.masking_threshold_db
            violates = alternative["verdict"] == "violates a limit"
            code = "other_edge_violates" if violates else "ideal_edge"
            yield True, code, data | {"crosstalk_db": crosstalk_db, "limit_db": limit_db}
    deviation = strip["measured_above_computed"]
    yield (
        plate.edge != "elastic" and abs(deviation or 0.0) > _NEAR_CUTOFF,
        "cutoff_mismatch",
        {"measured_hz": plate.measured_cutoff_hz, "deviation": deviation, "edge": plate.edge},
    )
    yield strip["thinness"] > _THICK, "thick_plate", {"thinness": strip["thinness"]}
    yield plate.edge == "measured-cutoff", "ambiguous_cutoff", {}
    centred = [a.label for a in study.actuators if "y_mm" not in a.model_fields_set]
    data = {"actuators": " and ".join(centred), "y_mm": plate.width_mm / 2}
    yield bool(centred), "assumed_position", data


# --- conditions -----------------------------------------------------------------------------------


def _report_condition(check: StudyCheck, tested: ConditionCheck) -> dict[str, Any]:
    condition = tested.condition
    is_chosen = condition.max_crosstalk_db is not None
    too_loud = chosen_window(check.study, condition).louder if is_chosen else ()
    return {
        "name": condition.name,
        "verdict": tested.verdict,
        "burst": stimulus_values(condition),
        "duration_s": condition.drive.duration_s,
        **_values(tested.burst, "peak_hz", "band_hz", "energy_above_cutoff"),
        **_values(tested.burst, "staircase_energy_above_cutoff", "sample_rate_hz"),
        "largest_energy_above_cutoff": max(
            tested.burst.energy_above_cutoff, tested.burst.staircase_energy_above_cutoff
        ),
        "displacements": (
            None if tested.gains is None else _displacements(check.study, tested, tested.gains)
        ),
        "reasons": tested.reasons,
        "accept_violation": condition.accept_violation,
        "windows_too_loud": [
            _values(burst, "cycles", "window") | {"crosstalk_db": level_db}
            for burst, level_db in too_loud
        ],
    }


def _displacements(study: Study, tested: ConditionCheck, gains: ConditionGains) -> dict[str, Any]:
    """Report the peak displacements at the fingertips at the highest level, and the crosstalk."""
    from experiment.study.physics import (
        MAX_LOSS,
        MIN_LOSS,
        field_strip,
        fingertips_of,
        loads_of,
        peaks_of,
    )
    from stimuli import causal

    plate, drive, level_vpp = study.plate, tested.condition.drive, study.design.highest_vpp
    strip, load = field_strip(study), study.finger_load
    work = peaks_of(strip, loads_of(study), fingertips_of(study), drive).work
    sites, errors = tested.sites, tested.peak_errors
    fingers = gains.at_fingers(sites)

    def undriven_finger(finger: int, actuator: int) -> dict[str, Any]:
        return {
            "finger": sites[finger],
            "peak_um": tested.peak_um(finger, actuator, level_vpp),
            "crosstalk_db": tested.level_db(finger, actuator),  # the worst of the variants
            "crosstalk_error_db": tested.level_error_db(finger, actuator),
            "variants": [
                {
                    "loss_factor": variant.loss_factor,
                    "finger_load": variant.loaded,
                    "crosstalk_db": variant.gains.level_db(finger, actuator),
                }
                for variant in tested.variants
            ],
        }

    return {
        "level_vpp": level_vpp,
        "strip_length_m": strip.length_m,
        "work": list(work),
        "actuators": [
            {
                "name": name,
                "basis": gains.bases[index],
                "peak_um": tested.peak_um(index, index, level_vpp),
                **dict(
                    zip(
                        ("crosstalk_db", "crosstalk_error_db"),
                        tested.crosstalk_of(index),
                        strict=True,
                    )
                ),
                "fingers": [
                    undriven_finger(finger, index)
                    for finger in range(len(sites))
                    if finger != index
                ],
            }
            for index, name in enumerate(gains.actuators)
        ],
        "re_first_db": None if fingers.basis is None else fingers.re_first_db,
        "peak_error": None if errors is None else errors.driven,
        "loss_basis": "set" if plate.has_loss_factor else "assumed",
        "loss_factors": [plate.loss_factor] if plate.has_loss_factor else [MIN_LOSS, MAX_LOSS],
        "edge_loss": plate.edge_loss if isinstance(strip.edge, ElasticEdge) else None,
        "viscous_time_s": causal(strip, drive).material.viscous_time_s,
        "finger_load": (
            None
            if load.impedance is None
            else load.model_dump() | {"applied": load.impedance.holds_for(drive)}
        ),
    }


def _condition_rules(check: StudyCheck) -> Iterator[Rule]:
    for tested in check.conditions:
        condition = tested.condition
        data = {"condition": condition.name, "reason": condition.accept_violation}
        yield tested.verdict == "accepted", "accepted_stimulus", data
        if tested.gains is not None:
            yield from _displacement_rules(check.study, tested, tested.gains)
    if check.gains and not check.study.plate.has_loss_factor:
        yield from _loss_rules(check.study)


def _displacement_rules(
    study: Study, tested: ConditionCheck, gains: ConditionGains
) -> Iterator[Rule]:
    bases = dict(zip(gains.actuators, gains.bases, strict=True))
    unknown = " and ".join(name for name, basis in bases.items() if basis is None)
    yield bool(unknown), "unknown_displacement", {"actuators": unknown}
    has_basis = {bases[site] is not None for site in tested.sites}
    yield has_basis == {True, False}, "partial_displacement", {}
    fingers = gains.at_fingers(tested.sites)
    by_site = dict(zip(tested.sites, fingers.re_first_db, strict=True))
    smaller, larger = (pick(by_site, key=by_site.__getitem__) for pick in (min, max))
    difference_db = by_site[larger] - by_site[smaller]
    data = {"larger": larger, "smaller": smaller, "difference_db": difference_db}
    is_known = fingers.basis is not None
    yield is_known and difference_db >= UNEQUAL_DB, "unequal_sides", data
    pairs = permutations(range(len(tested.sites)), 2)
    is_below = any(tested.level_db(finger, driven) < _MIN_MODEL_DB for finger, driven in pairs)
    yield is_below, "crosstalk_below_model", {"limit_db": _MIN_MODEL_DB}
    load, drive = study.finger_load, tested.condition.drive
    if load.impedance is not None and not load.impedance.holds_for(drive):
        data = {"max_hz": load.holds_up_to_hz, "band_hz": drive.band_hz()[1]}
        yield True, "omitted_finger_load", data


def _loss_rules(study: Study) -> Iterator[Rule]:
    from experiment.study.physics import MAX_LOSS, MIN_LOSS, field_strip, loads_per_volt

    yield True, "assumed_loss", {"min_loss": MIN_LOSS, "max_loss": MAX_LOSS}
    yield study.plate.material in _PLASTICS, "plastic_loss", {"material": study.plate.material}
    both = [loads_per_volt(study, field_strip(study, loss)) for loss in (MIN_LOSS, MAX_LOSS)]
    for actuator, (low, _), (high, _) in zip(study.actuators, *both, strict=True):
        factor = max(high / low, low / high) if low and high else 1.0
        data = {"actuator": actuator.label, "frequency_hz": actuator.measured_at_hz}
        yield factor > _NEAR_MODE, "measured_near_mode", data | {"factor": factor}


# --- device, design and simulated participants ----------------------------------------------------


def _device_rules(study: Study, device: DeviceSettings) -> Iterator[Rule]:
    full_scale_vpp, ceiling_vpp, monitor = (
        _full_scale_vpp(device),
        device.ceiling_vpp,
        study.monitor,
    )
    if full_scale_vpp and not math.isclose(ceiling_vpp, full_scale_vpp, rel_tol=0.01):
        is_above = full_scale_vpp > ceiling_vpp
        code = "full_scale_above_ceiling" if is_above else "ceiling_above_full_scale"
        yield True, code, {"full_scale_vpp": full_scale_vpp, "ceiling_vpp": ceiling_vpp}
    yield device.driver == MOCK, "practice_device", {}
    yield monitor.source == "none" and bool(monitor.sound_card), "unused_monitor", {}
    tolerance_ms = monitor.onset_tolerance_ms
    yield (
        monitor.source == "input" and tolerance_ms < _MIN_INPUT_TOLERANCE_MS,
        "narrow_onset_tolerance",
        {"tolerance_ms": tolerance_ms, "start_ms": _MIN_INPUT_TOLERANCE_MS},
    )


def _design_rules(study: Study) -> Iterator[Rule]:
    yield study.contact.control in {"none", "not stated"}, "unknown_contact", {}
    yield study.masking.noise == "none", "no_masking_noise", {}
    design, reference_vpp = study.design, study.task.reference_vpp
    low_vpp, high_vpp = min(design.levels_vpp), max(design.levels_vpp)
    is_outside = reference_vpp is not None and not low_vpp <= reference_vpp <= high_vpp
    yield is_outside, "reference_outside_levels", {"reference_vpp": reference_vpp}
    may_guess = study.task.nothing in design.responses and not design.blank_trials
    yield may_guess, "no_blank_trials", {}
    needed = _TRIALS_PER_SITE * len(study.task.sites)
    is_short = study.task.is_identification and design.trials_per_side < needed
    yield is_short, "few_trials_of_site", {"trials": design.trials_per_side, "needed": needed}
    defaults = [
        f"{name}.{key}"
        for name, key in _DECISIONS
        if getattr(getattr(study, name), key) is not None
        and key not in getattr(study, name).model_fields_set
        and (name, study.masking.noise) != ("masking", "none")
    ]
    yield bool(defaults), "assumed_value", {"keys": ", ".join(defaults)}


def simulated_participants(study: Study, gains: tuple[ConditionGains, ...]) -> dict[str, Any]:
    """Report where simulated participants' thresholds lie, and what speaks against the levels."""
    thresholds = [
        median_threshold(study, of_condition.at_fingers(study.task.sites), index=index)
        for index, of_condition in enumerate(gains)
    ]
    people = study.simulation
    key = "threshold_vpp" if people.threshold_um is None else "threshold_um"
    is_set = key in people.model_fields_set
    rules: list[Rule] = [
        (not is_set and key == "threshold_vpp", "threshold_of_another_plate", {}),
    ]
    for threshold in thresholds:
        data = _values(threshold, "condition", "threshold_vpp") | {"side": threshold.levels_lie}
        is_outside = threshold.levels_lie != "around"
        if study.task.has_reference:  # levels are compared with the reference
            continue
        rules.append((is_outside, "threshold_outside_levels", data))
        low_db, high_db = threshold.levels_db
        is_near = not is_outside and min(-low_db, high_db) < _NEAR_THRESHOLD_DB
        data = {"condition": threshold.condition, "low_db": low_db, "high_db": high_db}
        rules.append((is_near, "threshold_near_end_of_levels", data))
    for extrapolation in extrapolations(study):
        values = " and ".join(f"{value:.3g}" for value in extrapolation.values)
        data = _values(extrapolation.curve, "quantity", "unit", "min", "max") | {"values": values}
        rules.append((True, "threshold_outside_curves", data))
    return {
        "thresholds": thresholds,
        "threshold_sd_db": people.threshold_sd_db,
        "is_set": is_set,
        "has_detection_rate": not (study.task.has_reference or study.levels.is_adaptive),
        "warnings": sort_warnings(apply_rules(rules)),
    }


def _provenance(study: Study) -> dict[str, Any]:
    """Report which values the file sets, and which were measured."""
    measured: list[dict[str, Any]] = []
    for name, table in study.model_dump(mode="json", by_alias=True).items():
        for index, section in enumerate(table if isinstance(table, list) else [table]):
            path = f"{name}[{index}]" if isinstance(table, list) else name
            for key in _MEASURED_KEYS:
                if section.get(key) is not None and section.get("assumed_equal_to") is None:
                    by, on = section["measured_by"], section["measured_on"]
                    measured.append({"key": f"{path}.{key}", "by": by, "on": on})
    return {"set_keys": study.keys_set, "measured": measured}
