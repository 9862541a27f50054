"""The check of a study as it is told: in words on a terminal, as JSON to programs."""

from __future__ import annotations

import math
import textwrap
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Final

from device.drivers import MOCK, other_channels
from experiment.apparatus.monitor import monitor_doubt, monitor_words
from experiment.apparatus.rig import asked_of, full_scale_words, lacking_of, shared_card
from experiment.check.displacements import displacement_findings, edge_findings
from experiment.check.findings import Findings, WarningCode
from experiment.study.design import part_of_both, repeats_words
from experiment.study.origins import deciding_words, instead_of_trials
from experiment.study.presentation import key_doubts, unsaid_in, untyped_of
from experiment.study.sources import (
    cutoff_source,
    displacement_source,
    measured_beside,
    others_than_the_plates,
    patch_words,
    plate_sources,
    plate_words,
    study_sources,
    words_of_the_others,
)
from experiment.study.stimulus import stimulus_facts
from experiment.study.threshold import median_threshold, people_words, unmeasured, unmeasured_words
from experiment.study.window import chosen_window, louder_words
from experiment.trial.draw import block_lengths, block_words
from experiment.trial.order import order_count
from stimuli import CLAMPED, SIMPLY_SUPPORTED, Burst

if TYPE_CHECKING:
    from experiment.check.check import ConditionCheck, StudyCheck
    from experiment.study.equipment import DeviceSettings
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study


JSON_SCHEMA: Final = 1
_FULL_SCALE: Final = {
    "warning": WarningCode.FULL_SCALE_ABOVE_CEILING,
    "note": WarningCode.CEILING_ABOVE_FULL_SCALE,
}
_VERDICTS: Final = {
    "fit": "fit: below the strip's cut-off, and at most {limit_db:g} dB at the other finger",
    "accepted": "unfit, and accepted by the study: the other finger may feel it too",
    "unfit": (
        "UNFIT: change [burst], the actuators' places or the device's sample rate, "
        "or say in accept_unfit why this stimulus is wanted"
    ),
}
_LEVELS: Final = {
    True: WarningCode.THRESHOLD_NEAR_END_OF_LEVELS,
    False: WarningCode.THRESHOLD_OUTSIDE_LEVELS,
}
_WIDTH: Final = 85
THICK: Final = 0.1
"""From this (k h)^2 on, the theory of thin plates misses by more than a few per cent."""


def check_findings(
    check: StudyCheck,
    file_name: str,
    machine: Findings | None = None,
    *,
    device: DeviceSettings | None = None,
) -> Findings:
    """Tell what the check of a study found.

    Parameters
    ----------
    check : StudyCheck
        What it found.
    file_name : str
        Where the study was read from.
    machine : Findings, optional
        What this machine lacks to run it, which has no say in the verdict.
    device : DeviceSettings, optional
        Those in use, where they are others than the study's.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> from experiment.check.check import check_study
    >>> found = check_findings(check_study(paper_study(), gains=()), "study.toml")
    >>> print(found.text.splitlines()[-1])
    verdict        fit: below the strip's cut-off, and at most -20 dB at the other finger
    >>> found.facts["verdict"], round(found.facts["strip"]["cutoff_hz"], 6)
    ('fit', 2900.0)
    """
    study = check.study
    found = Findings()
    found.note(schema=JSON_SCHEMA)
    found.tell(
        "study",
        f"{study.name} ({file_name}), sha256 {study.sha256[:12]}",
        study={"name": study.name, "sha256": study.sha256},
    )
    found.part("strip", _strip(check))
    found.note(max_energy_above_cutoff=study.burst.max_energy_above_cutoff)
    found.note(masking_limit_db=study.burst.masking_limit_db)
    found.parts("actuators", [_actuator(study, place) for place in range(len(study.actuators))])
    found.parts("conditions", [_condition(check, condition) for condition in check.conditions])
    found.space()
    device = study.device if device is None else device
    _tell_plan(found, check, device)
    _tell_people(found, check, device)
    found.tell(
        "other numbers",
        words_of_the_others(study),
        sources={one.key: one.facts for one in study_sources(study)},
    )
    others = others_than_the_plates(study)
    quiet = {"masking.level_dbfs"} if study.masking.noise == "none" else set[str]()
    deciding = deciding_words(one for one in others if one.key not in quiet)
    for line in deciding:
        found.tell("", line)
    for line in deciding[1:-1]:  # between a heading and what is said of the others
        found.note_warning(WarningCode.ASSUMED_VALUE, line.strip())
    for origin, whose in (("yours", "yours"), ("paper", "the paper's")):
        keys = ", ".join(one.key for one in others if one.origin == origin)
        for line in textwrap.wrap(f"{whose}: {keys}", _WIDTH) if keys else ():
            found.tell("", line)
    if machine is not None:
        found.take(machine)
    found.space()
    found.tell(
        "verdict",
        _VERDICTS[check.verdict].format(limit_db=-study.burst.masking_limit_db),
        verdict=check.verdict,
        warnings=found.coded,
    )
    return found


def _strip(check: StudyCheck) -> Findings:
    strip, material, basis = check.study.strip, check.study.strip.material, check.study.plate.edge
    found = Findings()
    length = "endless" if strip.length_m is None else f"{strip.length_m * 1e3:g}"
    found.tell(
        "strip",
        f"{strip.width_m * 1e3:g} x {length} x {strip.thickness_m * 1e3:g} mm; "
        f"{material.youngs_modulus_pa / 1e9:g} GPa, Poisson's ratio "
        f"{material.poisson_ratio:g}, {material.density_kg_m3:g} kg/m3",
        width_m=strip.width_m,
        length_m=strip.length_m,
        thickness_m=strip.thickness_m,
        loss_factor=material.loss_factor,
        viscous_time_s=material.viscous_time_s,
    )
    found.tell("", plate_words(check.study.plate))
    found.tell(
        "cut-off",
        f"{check.cutoff_hz:.1f} Hz, {_basis(check)}",
        cutoff_hz=check.cutoff_hz,
        edge=basis,
        edge_stiffness_n=check.edge_stiffness_n,
        cutoff_source=cutoff_source(check.study.plate, model=True).facts,
    )
    found.note(measured_cutoff_hz=check.study.plate.measured_cutoff_hz)
    off, told = measured_beside(check.study.plate) or (None, [])
    found.note(measured_above_computed=off)
    for words in told[:1]:
        found.tell("", words)
    for words in told[1:]:
        found.warn("", WarningCode.CUTOFF_MISMATCH, words)
    found.take(edge_findings(check))
    if check.edge_stiffness_n is not None:
        ends_hz = [replace(strip, edge=edge).cutoff_hz() for edge in (SIMPLY_SUPPORTED, CLAMPED)]
        found.tell("", f"simply supported edges give {ends_hz[0]:.1f} Hz, clamped {ends_hz[1]:.1f}")
    found.note(thinness=check.thinness)
    if check.thinness > THICK:
        found.warn(
            "warning",
            WarningCode.THICK_PLATE,
            f"not a thin plate: (k h)^2 = {check.thinness:.2g} at the cut-off, about the part by "
            "which it is wrong",
        )
    if basis == "measured-cutoff":
        words = "a clamped strip that is a little wider can have the same cut-off"
        found.warn("", WarningCode.AMBIGUOUS_CUTOFF, words)
    return found


def _basis(check: StudyCheck) -> str:
    plate, stiffness_n = check.study.plate, check.edge_stiffness_n
    if plate.edge == "measured-cutoff":
        return f"{cutoff_source(plate).words}; as of elastic edges of K = {stiffness_n:.2f} N"
    if stiffness_n is not None:
        return f"computed from elastic edges of K = {stiffness_n:g} N"
    return f"computed from {plate.edge.replace('simply-', 'simply ')} edges"


def _actuator(study: Study, place: int) -> Findings:
    actuator = study.actuators[place]
    sources = {one.key: one for one in plate_sources(study)}
    found = Findings()
    lengths_m = (actuator.diameter_m, actuator.length_x_m, actuator.length_y_m)
    size = " x ".join(f"{length_m * 1e3:g}" for length_m in lengths_m if length_m is not None)
    centre = f"x = {actuator.x_m * 1e3:g}, y = {actuator.y_m * 1e3:g} mm"
    found.tell(
        actuator.label,
        f"{actuator.shape} {size} mm at {centre}",
        name=actuator.label,
        side=actuator.side,
        shape=actuator.shape,
        x_m=actuator.x_m,
        y_m=actuator.y_m,
        diameter_m=actuator.diameter_m,
        length_x_m=actuator.length_x_m,
        length_y_m=actuator.length_y_m,
        finger_diameter_m=actuator.finger_diameter_m,
        patch_counts=actuator.patch_counts,
    )
    moved = displacement_source(study, place)
    words = "" if moved is None else f"; {moved.words}"
    found.tell("", f"place and size: {sources[f'actuator[{place}].x_mm'].words}{words}")
    across = sources[f"actuator[{place}].y_mm"]
    if across.origin == "assumed":
        found.warn("", WarningCode.ASSUMED_POSITION, f"y: {across.words}")
    if actuator.patch is not None:
        found.tell("", patch_words(study.strip, actuator.patch))
    return found


def _condition(check: StudyCheck, one: ConditionCheck) -> Findings:
    condition, burst = one.condition, one.burst
    found = Findings()
    found.space()
    found.tell(
        "condition",
        f"{condition.name}: {one.verdict}",
        name=condition.name,
        verdict=one.verdict,
    )
    found.tell(
        "burst",
        burst_words(condition),
        burst=stimulus_facts(condition),
        duration_s=condition.drive.duration_s,
        peak_hz=burst.peak_hz,
    )
    _tell_window(found, check.study, condition)
    lower_hz, upper_hz = burst.band_hz
    ideal = "ideal burst's" if isinstance(condition.drive, Burst) else "samples'"
    found.tell("band", f"{lower_hz:.1f} to {upper_hz:.1f} Hz at half power", band_hz=burst.band_hz)
    found.tell(
        "above cut-off",
        f"{burst.energy_above_cutoff:.2e} of the {ideal} energy, from a sound card, which smooths",
        energy_above_cutoff=burst.energy_above_cutoff,
    )
    found.tell(
        "",
        f"{burst.staircase_energy_above_cutoff:.2e} from an output that holds each sample at "
        f"{burst.sample_rate_hz:g} Hz, a staircase",
        staircase_energy_above_cutoff=burst.staircase_energy_above_cutoff,
    )
    found.tell("", f"{burst.max_energy_above_cutoff:.2e} is the limit")
    if one.gains is None:
        found.note(displacements=None)
    else:
        found.part("displacements", displacement_findings(check, one, one.gains))
    found.note(reasons=one.reasons, accept_unfit=condition.accept_unfit)
    for warning in one.warnings:
        found.warn("unfit", warning.code, warning.message)
    if one.verdict == "accepted":
        found.warn("accepted", WarningCode.ACCEPTED_STIMULUS, f"{condition.accept_unfit}")
    return found


def burst_words(condition: Condition) -> str:
    """Say what the burst of a condition is."""
    drive = condition.drive
    if not isinstance(drive, Burst):
        return f"{condition.file}, scaled to a peak of 1, {drive.duration_s * 1e3:g} ms"
    cycles = "1 cycle" if drive.cycles == 1 else f"{drive.cycles} cycles"
    window = "no window" if drive.window == "none" else f"{drive.window} window"
    return f"{cycles} of {drive.frequency_hz:g} Hz, {window}, {drive.duration_s * 1e3:g} ms"


def _tell_window(found: Findings, study: Study, condition: Condition) -> None:
    """Tell what a window that the program chose costs, and which were too loud."""
    if condition.wanted_level_db is not None:
        stated_s = condition.stated.duration_s
        extra_s = condition.drive.duration_s - stated_s
        found.tell(
            "window = auto",
            f"the shortest with {condition.wanted_level_db:g} dB at the other finger; it costs "
            f"{extra_s * 1e3:g} ms more than the {stated_s * 1e3:g} ms stated",
        )
        choice = chosen_window(study, condition)
        found.note(
            windows_too_loud=[
                {"cycles": burst.cycles, "window": burst.window, "level_db": level_db}
                for burst, level_db in choice.louder
            ]
        )
        for words in louder_words(choice):
            found.tell("", words)


def _tell_plan(found: Findings, check: StudyCheck, device: DeviceSettings) -> None:
    study, design = check.study, check.study.design
    each = f"{len(study.conditions)} conditions with " if len(study.conditions) > 1 else ""
    _tell_devices(found, study, device)
    found.tell("contact", study.contact.words, contact=asdict(study.contact))
    if study.contact.control in {"none", "not stated"}:
        message = f"contact of the fingers: {study.contact.words}"
        found.note_warning(WarningCode.UNKNOWN_CONTACT, message)
    if study.masking.noise == "none":
        found.note_warning(WarningCode.NO_MASKING_NOISE, 'masking.noise = "none"')
    stated = asdict(design) | {"both_level_vpp": design.both_level_vpp} | instead_of_trials(design)
    del stated["both_level"]  # text or a number; told as a number or null
    found.note(design=stated)
    found.tell("answers", ", ".join(design.responses))
    if unsaid := unsaid_in(study.texts, design):
        words = f"your own, {unsaid}: say it if they do not"
        found.warn("instructions", WarningCode.INCOMPLETE_INSTRUCTIONS, words, unsaid=unsaid)
    if doubts := key_doubts(study.texts, study.keys, design):
        found.warn("texts", WarningCode.UNKNOWN_KEY, "; ".join(doubts), key_doubts=doubts)
    offered = (
        *design.responses,
        *(["none"] * bool(check.audibility_trials + check.control_trials)),
    )
    if untyped := untyped_of(study.keys, offered):
        words = f"not for --responder terminal: {untyped}"
        found.warn("keys", WarningCode.UNTYPED_KEY, words, untyped_keys=untyped)
    found.tell("levels", repeats_words(design))
    some = bool(design.practice_trials)
    found.tell(
        "trials",
        f"{check.trials}: {each}{design.trials_per_side} left, {design.trials_per_side} right, "
        f"{design.both_trials} both{part_of_both(design)}, {design.blank_trials} blank; "
        f"{design.practice_trials} for practice before{', at the highest level' * some}",
        trials=check.trials,
    )
    per_condition = " (of each condition)" if len(study.conditions) > 1 else ""
    first, *others = block_words(design)
    found.tell("blocks", first + per_condition, block_trials=block_lengths(design))
    for words in others:
        found.warn("", WarningCode.SHORT_BLOCKS, words)
    if design.condition_order == "balanced":
        orders = order_count(len(study.conditions))
        found.tell("order", f"of conditions balanced over each {orders} participants in a row")
    found.note(audibility_trials=check.audibility_trials, control_trials=check.control_trials)
    if check.audibility_trials or check.control_trials:
        found.tell(
            "fingers off",
            f"{check.audibility_trials} trials before everything else"
            f"{_in_each(study, design.audibility_trials)}, is the plate heard; "
            f"{check.control_trials} at the end{_in_each(study, design.control_trials)}; "
            f"all at {design.highest_vpp:g} Vpp",
        )
    found.tell(
        "session",
        f"about {math.ceil(check.duration_s / 60)} min in {check.blocks} blocks, "
        f"breaks of {design.minimum_break_s:g} s"
        if check.blocks > 1
        else f"about {math.ceil(check.duration_s / 60)} min in one block",
        blocks=check.blocks,
        duration_s=check.duration_s,
    )
    found.tell("", "consent, instructions and longer rests come on top")


def _tell_people(found: Findings, check: StudyCheck, device: DeviceSettings) -> None:
    """Tell where the threshold of a dry run's people lies, and what of it nobody measured."""
    study, label = check.study, "simulation"
    found.note(simulated_threshold=None)
    if check.gains:
        every = [one.fingers() for one in check.gains]
        medians = [median_threshold(study, one, device, place=k) for k, one in enumerate(every)]
        volts = [one.level_vpp for one in medians]
        names = [one.name for one in study.conditions]
        found.note(simulated_threshold=medians[0].facts)
        found.note(simulated_thresholds_vpp=dict(zip(names, volts, strict=True)))
        for words in people_words(study, every, device):
            found.tell(label, words)
            label = ""
        if doubt := medians[0].source_doubt:
            found.note_warning(WarningCode.THRESHOLD_OF_ANOTHER_PLATE, doubt)
        for name, one in zip(names, medians, strict=True):
            if doubt := one.levels_doubt:
                found.note_warning(_LEVELS[one.levels_lie == "around"], f"In {name}: {doubt}")
    if words := unmeasured_words(study):
        outside = list(unmeasured(study))
        found.warn(
            label, WarningCode.THRESHOLD_OUTSIDE_CURVES, words, simulation_unmeasured=outside
        )


def _tell_devices(found: Findings, study: Study, device: DeviceSettings) -> None:
    """Tell what drives and what measures, and what a session would refuse or blame of them."""
    found.tell("device", _device_words(study, device), device=asdict(device))
    for heading, words in full_scale_words(device, study.design.highest_vpp).items():
        if heading in _FULL_SCALE:
            found.warn(heading, _FULL_SCALE[heading], words)
        else:
            found.tell(heading, words)
    refused = (
        ("", lacking_of(device)),
        ("", other_channels(device.driver, device.channels)),
        (" a person", shared_card(study, device)),
    )
    found.note(run_refuses=[why for _, why in refused if why])
    for whom, why in refused:
        if why:
            found.warn("warning", WarningCode.REFUSED_DEVICE, f"run refuses{whom}: {why}")
    found.tell("run", asked_of(device), run_asks=asked_of(device))
    if device.driver == MOCK:
        found.note_warning(WarningCode.PRACTICE_DEVICE, asked_of(device))
    if study.monitor.source != "none":
        found.tell("monitor", monitor_words(study.monitor), monitor=asdict(study.monitor))
    if doubt := monitor_doubt(study.monitor):
        unused = study.monitor.source == "none"
        code = WarningCode.UNUSED_MONITOR if unused else WarningCode.NARROW_ONSET_TOLERANCE
        found.warn("warning", code, doubt)


def _in_each(study: Study, trials: int) -> str:
    """Say how many of all conditions' trials each has."""
    conditions = len(study.conditions)
    return f" ({trials} in each of {conditions} conditions)" if trials and conditions > 1 else ""


def _device_words(study: Study, device: DeviceSettings) -> str:
    own = study.device.driver
    instead = "" if device.driver == own else f" instead of the study's {own}"
    most_vpp, key = device.highest
    reaches = "ceiling" if key == "device.ceiling_vpp" else f"{key} ="
    return (
        f"{device.driver}{instead} at {device.sample_rate_hz:g} Hz; highest level "
        f"{max(study.design.levels_vpp):g} Vpp, {reaches} {most_vpp:g} Vpp"
    )
