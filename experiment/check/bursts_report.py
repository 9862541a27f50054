"""The comparison of bursts as it is told: a table on a terminal, JSON to programs."""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from experiment.check.bursts import by_length, known_for
from experiment.check.displacements import tell_ideal
from experiment.check.edges import edge_words
from experiment.check.findings import Findings
from experiment.perception.gains import OWN_FINGERS
from experiment.study.physics import LEAST_LOSS, MOST_LOSS
from experiment.study.threshold import median_threshold, vibrations_of

if TYPE_CHECKING:
    from experiment.check.bursts import BurstAtEdge, BurstComparison, ComparedBurst
    from experiment.study.stimulus import SharedStimulus
    from stimuli import Burst


JSON_SCHEMA: Final = 1
_UNKNOWN: Final = "n/a"
_MOST_CYCLES: Final = 200
ROOM: Final = 4
"""How many times the threshold the ceiling should be: levels reach from half of it to twice it."""


def bursts_findings(found: BurstComparison, file_name: str) -> Findings:
    """Tell which bursts are fit for the plate of a study, and which of them is the shortest.

    Parameters
    ----------
    found : BurstComparison
        What was found.
    file_name : str
        Where the study was read from.
    """
    study, told = found.study, Findings()
    told.note(schema=JSON_SCHEMA)
    told.tell(
        "study",
        f"{study.name} ({file_name}), sha256 {study.sha256[:12]}",
        study={"name": study.name, "sha256": study.sha256},
    )
    _tell_edges(told, found)
    _tell_columns(told, found)
    told.space()
    columns = _columns(found)
    for line in zip(*columns, strict=True):
        told.lines.append("  ".join(line).rstrip())
    told.note(bursts=[_facts(found, row) for row in found.rows])
    _tell_refusals(told, found)
    told.space()
    _tell_best(told, found, file_name)
    return told


def _edges(found: BurstComparison) -> list[str]:
    other = [] if found.other is None else [found.other.plate.edge]
    return [found.study.plate.edge, *other]


def _tell_edges(told: Findings, found: BurstComparison) -> None:
    study = found.study
    tried = [study] if found.other is None else [study, found.other]
    words = [f"{edge_words(one.plate.edge)}, {one.strip.cutoff_hz():.1f} Hz" for one in tried]
    facts = [{"edge": one.plate.edge, "cutoff_hz": one.strip.cutoff_hz()} for one in tried]
    told.tell("cut-off", words[0], edges=facts)
    if found.other is not None:
        told.tell("", f"{words[1]}: the other ideal edge; a real one lies between the two,")
        told.tell("", "unless it moves up and down, as on soft rubber: docs/plate.md")
    else:
        known = "stiffness is stated" if study.plate.edge == "elastic" else "cut-off was measured"
        told.tell("", f"no other edge is tried: its {known}")


def _tell_columns(told: Findings, found: BurstComparison) -> None:
    study = found.study
    where = "as in [burst]" if _has_own_window(found) else f"where [burst] has {found.own_window}"
    told.tell("window", f"{found.window}, {where}", window=found.window)
    if len(study.conditions) > 1:
        marked = {name for row in found.rows for name in found.has(row)}
        for words, has in (("marked (*)", True), ("not among these bursts", False)):
            names = [one.name for one in study.conditions if (one.name in marked) is has]
            if names:
                told.tell("", f"{words}: {_conditions(names)}")
    limits = study.burst.max_energy_above_cutoff, study.burst.masking_limit_db
    told.tell(
        "above",
        "part of the energy above the cut-off, the greater of burst and staircase; limit "
        f"{limits[0]:.1e}",
        max_energy_above_cutoff=limits[0],
    )
    told.tell("", "staircase: of outputs that hold each sample; sound cards smooth it")
    told.tell(
        "other",
        f"level at the other finger in dB re the own one, the worse side; limit {-limits[1]:g}",
        masking_limit_db=limits[1],
    )
    tell_ideal(told, (one.level_db for row in found.rows for one in (row.stated, row.other) if one))
    if not study.plate.is_loss_stated:
        told.tell("", f"the worse of loss factors {LEAST_LOSS:g} and {MOST_LOSS:g} (assumed)")
    level_vpp = study.design.highest_vpp
    told.note(level_vpp=level_vpp)
    if _knows_um(found):
        told.tell("um", f"greatest of the own finger at {level_vpp:g} Vpp, with the study's edges")
    else:
        told.tell("", "micrometres: measured, or predicted from the discs' layers, docs/plate.md")
    gains = next(
        (row.stated.found.gains for row in found.rows if row.stated.found is not None), None
    )
    if gains is not None and study.simulation.known_for.stated:
        people = median_threshold(study, gains.fingers())
        whose = "as the study states" if people.whose == "yours" else "assumed"
        told.tell(
            "V",
            f"the median person's threshold, {whose}: {people.known:g} {people.unit}"
            f"{people.known_for};",
        )
        told.tell("", f"of each burst by published curves{_beyond(found)}")
    if any(row.threshold_db is not None for row in found.rows):
        own = _named(study.burst)
        told.tell("felt", f"threshold in volts, dB re {own}; the lower, the more easily it is felt")
        told.tell("", f"estimated by published curves of sines{_beyond(found)}; docs/model.md, 4")


def _has_own_window(found: BurstComparison) -> bool:
    return found.window == found.study.burst.window


def _beyond(found: BurstComparison) -> str:
    """Say that curves were not measured for some of the bursts."""
    every = [one for row in found.rows for one in vibrations_of(found.study, row.burst)]
    beyond = known_for(found.study).unmeasured(*every)
    return ", some beyond what was measured" if beyond else ""


def _knows_um(found: BurstComparison) -> bool:
    return any(um is not None for row in found.rows for um in row.own_um)


def _columns(found: BurstComparison) -> list[list[str]]:
    """Return the columns of the table, each as wide as its widest cell, two headings first."""
    rows, edges = found.rows, _edges(found)
    every = [
        ["", "Hz", *(_marked(found, row) for row in rows)],
        ["", "cycles", *(f"{row.burst.cycles}" for row in rows)],
        ["", "ms", *(f"{1e3 * row.burst.duration_s:.3g}" for row in rows)],
    ]
    for place, edge in enumerate(edges):
        ends = [row.stated if place == 0 else row.other for row in rows]
        every.append([edge_words(edge), _pair("above", "other"), *(_at(one) for one in ends)])
    if _knows_um(found):
        every.append(["", "um", *(_um(row.own_um) for row in rows)])
    if any(row.threshold_vpp is not None for row in rows):
        every.append(["", "V", *(_number(row.threshold_vpp) for row in rows)])
    if any(row.threshold_db is not None for row in rows):
        every.append(["", "felt", *(_decibels(row.threshold_db) for row in rows)])
    words = [_fit_words(edges, row) for row in rows]
    every.append(["", "fit with" if edges[1:] else "fit", *words])
    widths = [max(map(len, column)) for column in every]
    return [[cell.rjust(wide) for cell in one] for one, wide in zip(every, widths, strict=True)]


def _marked(found: BurstComparison, row: ComparedBurst) -> str:
    return f"{'*' * bool(found.has(row))}{row.burst.frequency_hz:g}"


def _conditions(names: list[str]) -> str:
    return f"condition{'s' * (len(names) > 1)} {', '.join(names)}"


def _pair(energy: str, level: str) -> str:
    return f"{energy:>7}  {level:>6}"


def _at(end: BurstAtEdge | None) -> str:
    if end is None or end.energy_above_cutoff is None or end.level_db is None:
        return _pair(_UNKNOWN, _UNKNOWN)
    return _pair(f"{end.energy_above_cutoff:.1e}", f"{end.level_db:.1f}")


def _um(own_um: tuple[float | None, float | None]) -> str:
    """Write what both fingers get, once where it is the same."""
    return "/".join(dict.fromkeys(_number(um) for um in own_um))


def _number(value: float | None) -> str:
    return _UNKNOWN if value is None else f"{value:.3g}"


def _decibels(level_db: float | None) -> str:
    return _UNKNOWN if level_db is None else f"{round(level_db, 1) + 0.0:.1f}"


def _fit_words(edges: list[str], row: ComparedBurst) -> str:
    """Say with which edges a burst is fit."""
    ends = [row.stated, *([] if row.other is None else [row.other])]
    fit = [edge_words(edge) for edge, end in zip(edges, ends, strict=True) if end.is_fit]
    if not edges[1:]:
        return "yes" if fit else "no"
    return ("both" if fit[1:] else fit[0]) if fit else "none"


def _facts(found: BurstComparison, row: ComparedBurst) -> dict[str, Any]:
    ends = [row.stated, *([] if row.other is None else [row.other])]
    return {
        "frequency_hz": row.burst.frequency_hz,
        "cycles": row.burst.cycles,
        "duration_s": row.burst.duration_s,
        "is_of_study": bool(found.has(row)),
        "edges": [
            {"edge": edge} | _end_facts(end) for edge, end in zip(_edges(found), ends, strict=True)
        ],
        "own_um": dict(zip(OWN_FINGERS, row.own_um, strict=True)),
        "threshold_vpp": row.threshold_vpp,
        "threshold_db": row.threshold_db,
        "fit": row.is_fit_with_all,
    }


def _end_facts(end: BurstAtEdge) -> dict[str, Any]:
    if end.found is None:
        return {"verdict": "refused", "reasons": [end.refusal]}
    burst = end.found.burst
    return {
        "energy_above_cutoff": burst.energy_above_cutoff,
        "staircase_energy_above_cutoff": burst.staircase_energy_above_cutoff,
        "level_db": end.level_db,
        "verdict": end.found.verdict,
        "reasons": list(end.found.reasons),
    }


def _tell_refusals(told: Findings, found: BurstComparison) -> None:
    """Say once why bursts have no numbers."""
    ends = [end for row in found.rows for end in (row.stated, row.other) if end is not None]
    for refusal in dict.fromkeys(end.refusal for end in ends if end.refusal):
        told.tell(_UNKNOWN, refusal)


def _named(burst: Burst | SharedStimulus) -> str:
    cycles = "1 cycle" if burst.cycles == 1 else f"{burst.cycles} cycles"
    return f"{cycles} of {burst.frequency_hz:g} Hz"


def _tell_quietest(told: Findings, alike: list[ComparedBurst]) -> ComparedBurst:
    """Name the burst that is weakest at the other finger, of those that are as fit."""
    levels_db = [
        max(
            end.level_db
            for end in ((row.stated, row.other) if row.is_fit_with_all else (row.stated,))
            if end is not None and end.level_db is not None
        )
        for row in alike
    ]
    level_db, row = min(zip(levels_db, alike, strict=True), key=lambda one: one[0])
    where = " with the worse edges" if row.is_fit_with_all and row.other is not None else ""
    told.tell(
        "quietest",
        f"{_named(row.burst)}: {level_db:.1f} dB at the other finger{where}",
        quietest=_values(row.burst) | {"level_db": level_db},
    )
    return row


def _tell_most_felt(
    told: Findings, found: BurstComparison, alike: list[ComparedBurst]
) -> ComparedBurst | None:
    """Name the burst of the lowest threshold, of those that are as fit as the best."""
    in_volts = [(row.threshold_vpp, row) for row in alike if row.threshold_vpp is not None]
    in_db = [(row.threshold_db, row) for row in alike if row.threshold_db is not None]
    told.note(most_felt=None)
    if not (felt := in_volts or in_db):
        return None
    least, row = min(felt, key=lambda one: one[0])
    own = f"{least:.1f} dB re {_named(found.study.burst)}" if in_db else ""
    told.tell(
        "most felt",
        f"{_named(row.burst)}, {f'from {least:.3g} V' if in_volts else f'at {own}'}",
        most_felt=_values(row.burst),
    )
    return row


def _tell_with_room(
    told: Findings, found: BurstComparison, alike: list[ComparedBurst]
) -> ComparedBurst | None:
    """Name the shortest burst that is felt far below what no level may exceed."""
    told.note(with_room=None)
    if not any(row.threshold_vpp is not None for row in alike):
        needed = "simulation.threshold_um" if _knows_um(found) else "micrometres"
        told.tell("with room", f"not known: thresholds in V need {needed}, docs/plate.md")
        return None
    highest_vpp, key = found.study.device.highest
    most_vpp = highest_vpp / ROOM
    words = f"a quarter of {key}, {most_vpp:.3g} V"
    some = [row for row in alike if (row.threshold_vpp or highest_vpp) <= most_vpp]
    other = _with_room(found, alike, most_vpp)
    if not some:
        would = f"about {_named(other)} would be, by --cycles" if other else ""
        told.tell(
            "with room",
            f"none of these is felt below {words}: {would or 'nor would longer ones be'}",
        )
        return None
    row = min(some, key=lambda one: by_length(one.burst))
    told.tell(
        "with room",
        f"{_named(row.burst)}: the shortest of these felt below {words},",
        with_room=_values(row.burst),
    )
    told.tell("", "a factor of two for levels above the threshold, and one for its estimate")
    if other and by_length(other) < by_length(row.burst):
        told.tell("", f"about {_named(other)} would be, too: --cycles {other.cycles}")
    return row


def _with_room(found: BurstComparison, alike: list[ComparedBurst], most_vpp: float) -> Burst | None:
    """Return about how short a burst would do, of the frequency that is felt most easily."""
    told = [row for row in alike if row.threshold_vpp is not None]
    row = min(told, key=lambda one: one.threshold_vpp or 0.0)

    def shift_db(burst: Burst) -> float:
        return sum(map(known_for(found.study).shift_db, vibrations_of(found.study, burst))) / 2

    wanted_db = 20 * math.log10(most_vpp / (row.threshold_vpp or most_vpp)) + shift_db(row.burst)
    listed = [one for one in found.rows if one.burst.frequency_hz == row.burst.frequency_hz]
    unfit = [one.burst.cycles for one in listed if one not in alike]
    cycles = range(max(unfit, default=0) + 1, _MOST_CYCLES)
    place = bisect_left(
        cycles, -wanted_db, key=lambda number: -shift_db(replace(row.burst, cycles=number))
    )
    return replace(row.burst, cycles=cycles[place]) if place < len(cycles) else None


def _values(burst: Burst) -> dict[str, float]:
    """Return the lines of ``[burst]`` in which the compared bursts differ."""
    return {"frequency_hz": burst.frequency_hz, "cycles": burst.cycles}


def _tell_best(told: Findings, found: BurstComparison, file_name: str) -> None:
    """Name the best bursts with the lines of the study file that make one of them the study's."""
    best, edges = found.best, _edges(found)
    told.note(best=None, quietest=None, most_felt=None, with_room=None)
    if best is None:
        low_hz = min(edge.strip.cutoff_hz() for edge in (found.study, found.other) if edge)
        tried = ",".join(f"{float(f'{low_hz / part:.2g}'):g}" for part in (8, 4, 3, 2))
        told.tell("shortest", f"none of these is fit: try --frequency-hz {tried}, more --cycles,")
        told.tell("", "another window, or actuators further apart")
        return
    stated = edge_words(edges[0])
    if not edges[1:]:
        fit = "fit"
    elif best.is_fit_with_all:
        fit = "fit with both edges"
    else:
        fit = f"fit with {stated} edges; none is fit with both"
    told.tell(
        "shortest",
        f"{_named(best.burst)}: {fit}",
        best=_values(best.burst) | {"fit": best.is_fit_with_all},
    )
    if not best.is_fit_with_all:
        told.tell("", "measure the cut-off before it is used, docs/hardware.md")
    alike = [row for row in found.rows if row.stated.is_fit]
    alike = [row for row in alike if row.is_fit_with_all == best.is_fit_with_all]
    chosen = {"shortest": best, "quietest": _tell_quietest(told, alike)}
    if felt := _tell_most_felt(told, found, alike):
        chosen["most felt"] = felt
    if room := _tell_with_room(told, found, alike):
        chosen["burst with room"] = room
    _tell_lines(told, found, chosen, file_name)


def _tell_lines(
    told: Findings, found: BurstComparison, chosen: dict[str, ComparedBurst], file_name: str
) -> None:
    """Say which of the bursts named are the study's, and give the lines of the others."""
    several, others = len(found.study.conditions) > 1, dict[str, list[str]]()
    for name, row in chosen.items():
        if conditions := found.has(row):
            whose = f"{_conditions(conditions)} of {file_name}" if several else file_name
            told.tell("", f"the {name} (*) is that of {whose}")
        else:
            lines = "\n".join(f"{key} = {value:g}" for key, value in _values(row.burst).items())
            if not _has_own_window(found):
                lines += f'\nwindow = "{found.window}"'
            others.setdefault(lines, []).append(name)
    if others:
        where = "[burst] or a [[condition]]" if several else "[burst]"
        own = found.study.burst.window
        gone = {None: ", without file", "auto": ", without wanted_level_db"}.get(own, "")
        told.tell("", f"for another burst write its lines into {where} of {file_name}{gone}:")
    for lines, names in others.items():
        told.space()
        told.lines += [f"# {', '.join(names)}", *lines.splitlines()]
