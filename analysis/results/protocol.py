"""How it was measured: plate, stimuli, design and device of the sealed plans."""

from __future__ import annotations

import json
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING

from analysis.results.analysis import contacts_of
from analysis.results.rendering import phrases
from analysis.results.tables import Table, make_table
from experiment.study.base import format_value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analysis.results.analysis import Analysis
    from experiment.rows import MeasuredRow
    from experiment.study.study import Study


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """The different studies of the plans, with the keys that their files set.

    `faults` are plans that cannot be read.
    """

    studies: tuple[Study, ...]
    keys_set: tuple[tuple[str, ...], ...]
    faults: tuple[str, ...]


def planned(analysis: Analysis) -> Planned:
    """Read the studies in the plans beside the tables."""
    from experiment.study.files import study_from_canonical

    studies, keys_set, faults = [], [], []
    texts = dict.fromkeys((one.study, one.keys_set) for one in analysis.loaded.progress)
    for text, keys in texts:
        try:
            studies.append(study_from_canonical(text))
        except ValueError as error:
            faults.append(str(error))
            continue
        keys_set.append(keys)
    return Planned(
        studies=tuple(studies), keys_set=tuple(keys_set), faults=tuple(dict.fromkeys(faults))
    )


def protocol_rows(analysis: Analysis, plans: Planned) -> Iterator[tuple[str, list[str]]]:
    """Yield quantities of the study with their values; several where sessions differ."""
    values: dict[str, dict[str, None]] = {}
    for study in plans.studies:
        for quantity, value in _study(study, analysis):
            values.setdefault(quantity, {})[value] = None
    yield from ((quantity, [*each]) for quantity, each in values.items())
    contacts = contacts_of(analysis)
    if not values and {*contacts} <= {"not stated"}:
        return
    several = len(contacts) > 1
    texts = [f"{text}: {', '.join(who)}" if several else text for text, who in contacts.items()]
    yield "Force and contact of the fingers", texts or ["not stated"]


def _study(study: Study, analysis: Analysis) -> Iterator[tuple[str, str]]:
    design, device = study.design, study.device
    yield "Study", study.name
    yield "Plate", format_plate(study)
    yield "Material", format_material(study)
    yield "Cut-off frequency", format_cutoff(study)
    for disc in study.actuators:
        sizes_m = (disc.diameter_m, disc.length_x_m, disc.length_y_m)
        size = " x ".join(f"{size_m * 1e3:g}" for size_m in sizes_m if size_m is not None)
        at = f"x = {disc.x_m * 1e3:g}, y = {disc.y_m * 1e3:g} mm"
        yield f"Actuator, {disc.label}", f"{disc.shape} {size} mm at {at}"
    for condition in study.conditions:
        which = f", {condition.name}" if len(study.conditions) > 1 else ""
        violation = condition.accept_violation
        accepted = f"; accepted although it violates a limit: {violation}" if violation else ""
        yield f"Stimulus{which}", f"{condition.summary}{accepted}"
    yield "Levels", f"{format_levels(study)} V peak-to-peak, {design.order}"
    yield "Trials of a session", format_trials(study)
    min_s, max_s = design.foreperiod_s
    yield "Onset", f"{min_s:g} to {max_s:g} s after the cue"
    yield "Answers", f"{', '.join(design.responses)}; within {design.response_window_s:g} s"
    yield "Masking noise", format_noise(study)
    yield "Monitor", format_monitor(study, analysis)
    driver = f"{device.driver} at {device.sample_rate_hz:g} Hz"
    yield "Device in the plan", f"{driver}, ceiling {device.ceiling_vpp:g} V peak-to-peak"


def format_monitor(study: Study, analysis: Analysis) -> str:
    """Return the monitor that measured the bursts, and in how many sessions."""
    monitor = study.monitor
    if monitor.source == "none":
        return "none"
    number = len({(row.participant, row.session) for row in _measured_rows(analysis)})
    return (
        f"source {monitor.source}, tap {monitor.tap}; in {number} of {analysis.counts.sessions} "
        "sessions"
    )


def _measured_rows(analysis: Analysis) -> list[MeasuredRow]:
    return [row for session in analysis.loaded.progress for row in session.measured]


def measured_table(analysis: Analysis) -> Table | None:
    """Return the peaks that a monitor measured beside the planned ones; None without any."""
    bursts: dict[tuple[str, str, str, float, str], list[MeasuredRow]] = {}
    for row in _measured_rows(analysis):
        for side, peak in (("left", row.planned_left), ("right", row.planned_right)):
            if peak or (side == "left" and not row.planned_right):  # of a blank one row
                key = row.condition, row.tap, side if peak else "none", peak, row.unit
                bursts.setdefault(key, []).append(row)
    if not bursts:
        return None
    header = phrases()["measured"]
    rows = [_measured(key, bursts[key]) for key in sorted(bursts)]
    return Table(
        name="measured",
        caption=header["caption"],
        header=[text for key, text in header.items() if key != "caption"],
        rows=rows,
    )


def _measured(key: tuple[str, str, str, float, str], rows: list[MeasuredRow]) -> list[str]:
    condition, tap, side, planned_peak, unit = key
    measured = [] if side == "none" else [getattr(row, f"peak_{side}") for row in rows]
    peaks = sorted(peak for peak in measured if peak is not None)
    late_ms = sorted(abs(row.late_s) * 1e3 for row in rows if row.late_s is not None)
    verified = [row.burst_verified for row in rows]
    false, unknown = verified.count("false"), verified.count(None)
    counts = len(rows), len(rows) - false - unknown, false, unknown
    return [
        *(condition, tap, side, f"{planned_peak:.4g} {unit}"),
        f"{median(peaks):.4g}" if peaks else "n/a",
        f"{peaks[0]:.4g} to {peaks[-1]:.4g}" if peaks else "n/a",
        *map(str, counts),
        str(sum(row.noted is not None for row in rows)),
        f"{median(late_ms):.3f} ms" if late_ms else "n/a",
        f"{late_ms[-1]:.3f} ms" if late_ms else "n/a",
    ]


def format_plate(study: Study) -> str:
    """Return the width, length and thickness of the plate.

    >>> from experiment import paper_study
    >>> format_plate(paper_study())
    '25 mm wide, 200 mm long, 0.5 mm thick'
    """
    strip = study.strip
    length = "endless" if strip.length_m is None else f"{strip.length_m * 1e3:g} mm long"
    return f"{strip.width_m * 1e3:g} mm wide, {length}, {strip.thickness_m * 1e3:g} mm thick"


def format_material(study: Study) -> str:
    """Return the material of the plate.

    >>> from experiment import paper_study
    >>> format_material(paper_study())
    "67 GPa, Poisson's ratio 0.346, 2700 kg/m³"
    """
    made_of = study.strip.material
    elastic = f"{made_of.youngs_modulus_pa / 1e9:g} GPa, Poisson's ratio"
    return f"{elastic} {made_of.poisson_ratio:g}, {made_of.density_kg_m3:g} kg/m³"


def format_cutoff(study: Study) -> str:
    """Return the cut-off frequency of the plate and its basis; the table of keys has the source.

    >>> from experiment import paper_study
    >>> format_cutoff(paper_study())
    '2900 Hz (measured)'
    """
    plate = study.plate
    is_measured = plate.measured_by or plate.edge == "measured-cutoff"
    basis = "measured" if is_measured else f"edges: {plate.edge}"
    return f"{study.strip.cutoff_hz():.4g} Hz ({basis})"


def format_levels(study: Study) -> str:
    """Return the levels of a study."""
    levels = {
        condition.name: ", ".join(f"{v:g}" for v in condition.design(study.design).levels_vpp)
        for condition in study.conditions
    }
    if len(set(levels.values())) == 1:
        return next(iter(levels.values()))
    return "; ".join(f"{name} {listed}" for name, listed in levels.items())


def format_trials(study: Study) -> str:
    """Return the trials of a session.

    >>> from experiment import paper_study
    >>> format_trials(paper_study())
    '75 left, 75 right, 5 of both fingers'
    """
    design = study.design
    many = {
        "left": design.trials_per_side,
        "right": design.trials_per_side,
        "of both fingers": design.both_trials,
        "blank": design.blank_trials,
    }
    trials = ", ".join(f"{number} {words}" for words, number in many.items() if number)
    each = " of each condition" if len(study.conditions) > 1 else ""
    practice = f"; {design.practice_trials} for practice" if design.practice_trials else ""
    return f"{trials}{each}{practice}"


def format_noise(study: Study) -> str:
    """Return the masking noise."""
    masking = study.masking
    if masking.noise == "none":
        return "none"
    level_dba = masking.measured_level_dba
    level = f"{level_dba:g} dB(A) at the ear" if level_dba is not None else "level not measured"
    return f"{masking.noise}, {level}"


def protocol_tables(analysis: Analysis, plans: Planned) -> Iterator[Table]:
    """Yield the protocol, and the bursts that a monitor measured."""
    rows = [[what, value] for what, values in protocol_rows(analysis, plans) for value in values]
    if rows:
        yield Table(name="protocol", caption="Protocol", header=["Quantity", "Value"], rows=rows)
    if (measured := measured_table(analysis)) is not None:
        yield measured


def source_tables(analysis: Analysis, plans: Planned) -> Iterator[Table]:
    """Yield the keys that study files set, with values and sources; and checksums."""
    rows: dict[str, dict[str, None]] = {}
    sources: dict[str, dict[str, None]] = {}
    for study, keys in zip(plans.studies, plans.keys_set, strict=True):
        values = json.loads(study.canonical)
        for path in keys:
            section, key = path.rsplit(".", 1)
            if key == "source":  # it stands beside the values that it is of
                continue
            name, _, index = section.rstrip("]").partition("[")
            table = values[name][int(index)] if index else values[name]
            rows.setdefault(path, {})[format_value(table[key])] = None
            sources.setdefault(path, {})[table.get("source") or ""] = None
    key_rows, before = [], ""
    for path, values_of in rows.items():
        source = "; ".join(sources[path])
        row = {"key": path, "value": "; ".join(values_of)}
        key_rows.append(row | {"source": "" if source == before else source})
        before = source
    if (made := make_table("keys", key_rows)) is not None:
        yield made
    yield Table(
        name="files",
        caption="Files",
        header=["File", "sha256"],
        rows=[[file.name, file.sha256] for file in analysis.loaded.inputs],
    )
