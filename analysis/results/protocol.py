"""How it was measured: what the sealed plans say of plate, stimuli, design and device.

With it what a page is made of, sections and tables.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Final

from analysis.results.summary import versions
from experiment.study.base import format_value

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analysis.results.tables import Analysis
    from experiment.rows import MeasuredRow
    from experiment.study.study import Study


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of texts; the first cell names its row, `texts` are the headers of words."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    texts: Sequence[str] = ()
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of the page under its heading."""

    title: str
    texts: Sequence[str] = ()
    tables: Sequence[Table] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """What the plans hold.

    Attributes
    ----------
    studies : tuple of Study
        Those that differ, in their order; a study with levels placed for a participant is another.
    keys_set : tuple of tuple of str
        The keys that the file of each sets.
    remarks : tuple of str
        What a plan does not hold, or why it is not told.
    """

    studies: tuple[Study, ...]
    keys_set: tuple[tuple[str, ...], ...]
    remarks: tuple[str, ...]


def planned(analysis: Analysis) -> Planned:
    """Read the studies in the plans beside the tables."""
    from experiment.study.files import study_from_canonical

    studies, keys_set, remarks = [], [], []
    for text, keys in analysis.studies:
        try:
            studies.append(study_from_canonical(text))
        except ValueError as error:
            remarks.append(f"The study of a plan cannot be read: {error}")
            continue
        keys_set.append(keys)
    if not studies:
        remarks.append("The tables do not describe apparatus and stimuli.")
    return Planned(
        studies=tuple(studies), keys_set=tuple(keys_set), remarks=tuple(dict.fromkeys(remarks))
    )


def protocol_rows(analysis: Analysis, plans: Planned) -> Iterator[tuple[str, list[str]]]:
    """Yield what was measured with, and its words; several where sessions differ, none unknown."""
    told: dict[str, dict[str, None]] = {}
    for study in plans.studies:
        for what, words in _study(study, analysis):
            told.setdefault(what, {})[words] = None
    yield from ((what, [*words]) for what, words in told.items())
    if not told and {*analysis.contacts} <= {"not stated"}:
        return
    yield "Analysis by", [f"tactstrip {versions()['tactstrip']}"]
    contacts = analysis.contacts
    several = len(contacts) > 1
    told_of = [f"{w}: {', '.join(who)}" if several else w for w, who in contacts.items()]
    yield "Force and contact of the fingers", told_of or ["not stated"]


def _study(study: Study, analysis: Analysis) -> Iterator[tuple[str, str]]:
    design, device = study.design, study.device
    yield "Study", study.name
    yield "Plate", plate_size(study)
    yield "Material", material_words(study)
    yield "Cut-off frequency", cutoff_words(study)
    for one in study.actuators:
        sizes_m = (one.diameter_m, one.length_x_m, one.length_y_m)
        size = " x ".join(f"{size_m * 1e3:g}" for size_m in sizes_m if size_m is not None)
        at = f"x = {one.x_m * 1e3:g}, y = {one.y_m * 1e3:g} mm"
        yield f"Actuator, {one.label}", f"{one.shape} {size} mm at {at}"
    for condition in study.conditions:
        which = f", {condition.name}" if len(study.conditions) > 1 else ""
        unfit = condition.accept_violation
        accepted = f"; accepted though it violates a limit: {unfit}" if unfit else ""
        yield f"Stimulus{which}", f"{condition.summary}{accepted}"
    yield "Levels", f"{levels_words(study)} V peak-to-peak, {design.order}"
    yield "Trials of a session", trials_words(study)
    least_s, most_s = design.foreperiod_s
    yield "Onset", f"{least_s:g} to {most_s:g} s after the cue"
    yield "Answers", f"{', '.join(design.responses)}; within {design.response_window_s:g} s"
    yield "Masking noise", noise_words(study)
    yield "Monitor", monitored(study, analysis)
    driver = f"{device.driver} at {device.sample_rate_hz:g} Hz"
    yield "Device in the plan", f"{driver}, ceiling {device.ceiling_vpp:g} V peak-to-peak"


def monitored(study: Study, analysis: Analysis) -> str:
    """Say what measured the bursts, and in how many sessions."""
    monitor = study.monitor
    if monitor.source == "none":
        return "none"
    number = len({(row.participant, row.session) for row in analysis.measured})
    return (
        f"source {monitor.source}, tap {monitor.tap}; in {number} of {analysis.counts.sessions} "
        "sessions"
    )


def measured_rows(analysis: Analysis) -> list[list[str]]:
    """Return a heading, and what a monitor measured beside what was planned; nothing without."""
    found: dict[tuple[str, str, str, float, str], list[MeasuredRow]] = {}
    for row in analysis.measured:
        for side, peak in (("left", row.planned_left), ("right", row.planned_right)):
            if peak or (side == "left" and not row.planned_right):  # of a blank one row
                key = row.condition, row.tap, side if peak else "none", peak, row.unit
                found.setdefault(key, []).append(row)
    if not found:
        return []
    head = [
        "Condition",
        "Tap",
        "Channel",
        "Planned peak",
        "Measured (median)",
        "Least to most",
        "Bursts",
        "Verified",
        "False",
        "n/a",
        "Noted",
        "Off by (median)",
        "At most",
    ]
    return [head, *(_measured(key, found[key]) for key in sorted(found))]


def _measured(key: tuple[str, str, str, float, str], rows: list[MeasuredRow]) -> list[str]:
    condition, tap, side, planned_peak, unit = key
    told = [] if side == "none" else [getattr(row, f"peak_{side}") for row in rows]
    peaks = sorted(peak for peak in told if peak is not None)
    late_ms = sorted(abs(row.late_s) * 1e3 for row in rows if row.late_s is not None)
    verified = [row.burst_verified for row in rows]
    false, not_told = verified.count("false"), verified.count(None)
    counts = len(rows), len(rows) - false - not_told, false, not_told
    return [
        *(condition, tap, side, f"{planned_peak:.4g} {unit}"),
        f"{median(peaks):.4g}" if peaks else "n/a",
        f"{peaks[0]:.4g} to {peaks[-1]:.4g}" if peaks else "n/a",
        *map(str, counts),
        str(sum(row.noted is not None for row in rows)),
        f"{median(late_ms):.3f} ms" if late_ms else "n/a",
        f"{late_ms[-1]:.3f} ms" if late_ms else "n/a",
    ]


def plate_size(study: Study) -> str:
    """Return width, length and thickness in words.

    >>> from experiment import paper_study
    >>> plate_size(paper_study())
    '25 mm wide, 200 mm long, 0.5 mm thick'
    """
    strip = study.strip
    length = "endless" if strip.length_m is None else f"{strip.length_m * 1e3:g} mm long"
    return f"{strip.width_m * 1e3:g} mm wide, {length}, {strip.thickness_m * 1e3:g} mm thick"


def material_words(study: Study) -> str:
    """Return what a plate is made of.

    >>> from experiment import paper_study
    >>> material_words(paper_study())
    "67 GPa, Poisson's ratio 0.346, 2700 kg/m3"
    """
    made_of = study.strip.material
    elastic = f"{made_of.youngs_modulus_pa / 1e9:g} GPa, Poisson's ratio"
    return f"{elastic} {made_of.poisson_ratio:g}, {made_of.density_kg_m3:g} kg/m3"


def cutoff_words(study: Study) -> str:
    """Return a plate's first cut-off, and where it is from.

    >>> from experiment import paper_study
    >>> cutoff_words(paper_study())
    '2900 Hz (Ben Dhiab and Hudin: section II-B; figure 4 for the cut-off frequency)'
    """
    plate = study.plate
    source = plate.measured_by or plate.source or f"edges: {plate.edge}"
    return f"{study.strip.cutoff_hz():.4g} Hz ({source})"


def levels_words(study: Study) -> str:
    """Return the levels of a study in words."""
    levels = {
        condition.name: ", ".join(f"{v:g}" for v in condition.design(study.design).levels_vpp)
        for condition in study.conditions
    }
    if len(set(levels.values())) == 1:
        return next(iter(levels.values()))
    return "; ".join(f"{name} {listed}" for name, listed in levels.items())


def trials_words(study: Study) -> str:
    """Say which trials a session has.

    >>> from experiment import paper_study
    >>> trials_words(paper_study())
    '75 left, 75 right, 5 of both fingers'
    """
    design = study.design
    many = {
        "left": design.trials_per_side,
        "right": design.trials_per_side,
        "of both fingers": design.both_trials,
        "blank": design.blank_trials,
    }
    told = ", ".join(f"{number} {words}" for words, number in many.items() if number)
    each = " of each condition" if len(study.conditions) > 1 else ""
    practice = f"; {design.practice_trials} for practice" if design.practice_trials else ""
    return f"{told}{each}{practice}"


def noise_words(study: Study) -> str:
    """Say what noise masks the sound of the actuators."""
    masking = study.masking
    if masking.noise == "none":
        return "none"
    level_dba = masking.measured_level_dba
    level = f"{level_dba:g} dB(A) at the ear" if level_dba is not None else "level not measured"
    return f"{masking.noise}, {level}"


IN_METHODS: Final = {
    told.__name__: told
    for told in (plate_size, material_words, cutoff_words, levels_words, trials_words, noise_words)
}
"""What the paragraph of methods says of a study."""


def number_tables(plans: Planned) -> Iterator[tuple[str, list[list[str]]]]:
    """Yield a caption, and rows of the keys that study files set, their values and sources."""
    rows: dict[str, dict[str, None]] = {}
    sources: dict[str, dict[str, None]] = {}
    for study, keys in zip(plans.studies, plans.keys_set, strict=True):
        values = json.loads(study.canonical)
        for path in keys:
            section, key = path.rsplit(".", 1)
            name, _, index = section.rstrip("]").partition("[")
            table = values[name][int(index)] if index else values[name]
            rows.setdefault(path, {})[format_value(table[key])] = None
            sources.setdefault(path, {})[table.get("source") or "study file"] = None
    if rows:
        caption = "Keys that the study file sets; the others have their defaults"
        yield caption, [[path, "; ".join(rows[path]), "; ".join(sources[path])] for path in rows]


def protocol_section(analysis: Analysis, plans: Planned) -> Section:
    """Return how it was measured, for the page."""
    rows = [[what, one] for what, words in protocol_rows(analysis, plans) for one in words]
    head = ["What", "As planned" if plans.studies else "As told"]
    table = [Table(caption="Protocol", header=head, rows=rows, texts=head[1:])] if rows else []
    told = measured_rows(analysis)
    more = [Table(caption="Bursts measured", header=told[0], rows=told[1:])] if told else []
    return Section(title="How it was measured", texts=plans.remarks, tables=[*table, *more])


def folded_tables(analysis: Analysis, plans: Planned) -> Iterator[Table]:
    """Yield what stands folded at a page's end: sources of numbers, checksums, versions."""
    header = ["Number, by its key in study.toml", "Value", "Source"]
    for caption, rows in number_tables(plans):
        yield Table(caption=caption, header=header, rows=rows, texts=header)
    yield Table(
        caption="Files that were read",
        header=["File", "sha256"],
        rows=[[one.name, one.sha256] for one in analysis.inputs],
        texts=["sha256"],
    )
    told = [[name, number] for name, number in versions().items()]
    yield Table(caption="Versions", header=["Package", "Version"], rows=told, texts=["Version"])
