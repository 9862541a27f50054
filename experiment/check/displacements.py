"""What the fingers get, as a check tells it: micrometres, levels, and how they are computed."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from itertools import product
from typing import TYPE_CHECKING, Any, Final

from experiment.check.edges import edge_words, other_edge, with_other_edge
from experiment.check.findings import Findings, WarningCode
from experiment.check.plate import ALIKE
from experiment.perception.gains import OWN_FINGERS, UNEQUAL_DB, significant
from experiment.study.sources import displacement_source, finger_words
from stimuli import ElasticEdge
from stimuli.strip.patch import cutoff_factor

if TYPE_CHECKING:
    from collections.abc import Iterable

    from experiment.check.check import ConditionCheck, StudyCheck
    from experiment.perception.gains import ConditionGains, FingerGains
    from experiment.study.origins import Source
    from experiment.study.study import Study
    from stimuli import Strip


def displacement_findings(
    check: StudyCheck, one: ConditionCheck, gains: ConditionGains
) -> Findings:
    """Tell what the fingers get at the highest level, and what that was computed with."""
    from experiment.study.physics import felt_of, field_strip, fingertips_of, loads_of

    strip, level_vpp = field_strip(check.study), check.study.design.highest_vpp
    of_strip = "an endless strip" if strip.length_m is None else "the plate with its free ends"
    found = Findings()
    found.tell(
        "displacement",
        f"greatest displacement within the fingertip's contact area, at any time, at "
        f"{level_vpp:g} Vpp, of {of_strip}",
        level_vpp=level_vpp,
        strip_length_m=strip.length_m,
    )
    study, columns = check.study, range(len(gains.actuators))
    work = felt_of(strip, loads_of(study), fingertips_of(study), one.condition.drive).work
    found.tell("", f"computed by {work.words}", computed_by=asdict(work))
    found.parts("actuators", [_moved(study, one, gains, column) for column in columns])
    known = gains.bases[: len(OWN_FINGERS)]
    if None in known and any(known):
        missing = OWN_FINGERS[known.index(None)]
        found.warn(
            "",
            WarningCode.ONE_SIDED_DISPLACEMENT,
            f"with none of the {missing} actuator, trials.csv has no micrometres, and",
            "simulated people have a threshold in V: docs/plate.md",
            ALIKE,
        )
    _tell_unequal(found, gains.fingers())
    found.tell("", f"{-one.masking_limit_db:g} dB at the other finger is the limit")
    moved = found.facts["actuators"]
    tell_ideal(found, (at["level_db"] for one_of in moved for at in one_of["fingers"]))
    errors = one.patch_errors
    found.note(patch_error=None if errors is None else errors.facts)
    if errors is not None:
        places = product(range(len(OWN_FINGERS)), columns)
        most_db = max(
            one.level_db(row, column) + errors.levels_db[row, column]
            for row, column in places
            if row != column
        )
        found.tell("", f"{errors.words}: {most_db:.1f} dB at most")
    _tell_loss(found, check, one)
    load = study.finger_load
    rests = load.impedance is not None and load.impedance.holds_for(one.condition.drive)
    found.note(finger_load=asdict(load) | {"applied": rests} if load.impedance else None)
    for words in finger_words(study, one.condition):
        found.tell("", words)
    if load.impedance and not rests:
        found.note_warning(WarningCode.OMITTED_FINGER_LOAD, finger_words(study, one.condition)[-1])
    return found


def _tell_unequal(found: Findings, gains: FingerGains) -> None:
    """Tell by how much the same volts move one finger more than the other."""
    more_db = None if gains.basis is None else gains.right_re_left_db
    found.note(right_re_left_db=more_db)
    if more_db is not None and abs(more_db) >= UNEQUAL_DB:
        more, less = OWN_FINGERS[:: -1 if more_db > 0 else 1]
        found.warn(
            "",
            WarningCode.UNEQUAL_SIDES,
            f"the same volts move the {more} finger {abs(more_db):.1f} dB more than the",
            f"{less}: a threshold in V is that of both sides together, between the two",
        )


def _moved(study: Study, one: ConditionCheck, gains: ConditionGains, column: int) -> Findings:
    """Tell what one actuator gives its own finger and the others."""
    level_vpp = study.design.highest_vpp

    def peak_um(finger: int) -> float | None:
        if gains.bases[column] is None:
            return None
        return significant(gains.per_vpp[finger][column] * level_vpp)

    name, basis, own_um = gains.actuators[column], gains.bases[column], peak_um(column)
    others: list[dict[str, Any]] = [
        {
            "finger": side,
            "peak_um": peak_um(row),
            "level_db": one.level_db(row, column),
            "level_source": "computed",
        }
        | _level_of(one, row, column)
        for row, side in enumerate(OWN_FINGERS)
        if row != column
    ]
    # Of an assumed loss the level is that of the worse one and the micrometres are the plan's.
    told = [
        f"{'' if (loss := _with_loss(at['level_of'])) else _micrometres(at['peak_um'])}"
        f"{at['level_db']:.1f} dB at the {at['finger']} finger{loss}"
        for at in others
    ]
    source = displacement_source(study, column)
    words = _UNKNOWN if source is None else f"um peak, {_rests_on(source, study, column)}"
    found = Findings()
    found.tell(
        f"  {name}",
        f"{'' if own_um is None else f'{own_um:.3g} '}{words}; {'; '.join(told)}",
        name=name,
        basis=basis,
        source=None if source is None else source.origin,
        source_words=None if source is None else source.words,
        own_um=own_um,
        fingers=others,
    )
    if source is None:
        found.note_warning(WarningCode.UNKNOWN_DISPLACEMENT, f"{name}: {_UNKNOWN}")
    return found


def _level_of(one: ConditionCheck, row: int, column: int) -> dict[str, Any]:
    """Tell which of the plates that were tried has the level; the micrometres are the plan's."""
    worst = one.worst(row, column)
    if worst is None:
        return {"level_of": None}
    return {"level_of": {"finger_load": worst.loaded, "loss_factor": worst.loss_factor}}


def _with_loss(level_of: dict[str, Any] | None) -> str:
    """Name the assumed loss factor that a level belongs to."""
    loss_factor = None if level_of is None else level_of["loss_factor"]
    return "" if loss_factor is None else f" (loss factor {loss_factor:g})"


_IDEAL_DB: Final = -60.0


def tell_ideal(found: Findings, levels_db: Iterable[float | None]) -> None:
    """Say, if any level is so low, that it is that of an ideal plate."""
    if any(one is not None and one < _IDEAL_DB for one in levels_db):
        limit = f"below about {_IDEAL_DB:g} dB (assumed)"
        words = f"{limit} crosstalk, bars and table may carry more: docs/explanation/limits.md"
        found.warn("", WarningCode.CROSSTALK_BELOW_MODEL, words)


_PLASTICS: Final = ("pmma", "polycarbonate")


def _rests_on(source: Source, study: Study, place: int) -> str:
    """Say what the micrometres of the burst are computed from: no burst is the sine measured."""
    actuator = study.actuators[place]
    if source.origin == "computed":
        return "predicted from its layers"
    what = "the paper's" if source.origin == "paper" else "your"
    of, alike = (f" of the {actuator.alike} one", ", assumed alike") if actuator.alike else ("", "")
    return f"computed from {what} measurement{of} at {actuator.measured_at_hz:g} Hz{alike}"


_UNKNOWN: Final = "n/a, its displacement is not stated"


_WHY: Final = {
    "simply-supported": "glue and tape hold less than clamps, soft rubber less than either",
    "clamped": "a real edge lies between the two, unless it moves up and down, as on soft rubber",
}


_NEAR_LIMIT_DB: Final = 6.0
"""A level nearer to its limit than this is pointed at: edges and loss are not known so well."""


def edge_findings(check: StudyCheck) -> Findings:
    """Tell what a plate whose cut-off is computed would be with the other ideal edge."""
    from experiment.check.check import check_study

    study, found = check.study, Findings()
    edge = other_edge(study)
    if edge is None:
        return found
    cutoff_hz = replace(study.plate, edge=edge).strip.cutoff_hz()
    facts: dict[str, Any] = {"edge": edge, "cutoff_hz": cutoff_hz}
    words = f"{edge_words(edge)} edges would give {cutoff_hz:.1f} Hz"
    other, refusal = with_other_edge(study) if check.gains else None, ""
    if other is not None:
        try:
            tried = check_study(other, levels_only=True)
            sides = ((0, 1), (1, 0))
            level_db = max(one.level_db(*pair) for one in tried.conditions for pair in sides)
            words += f" and {level_db:.1f} dB at the other finger"
            words += f", {tried.verdict}" * (tried.verdict != check.verdict)
            facts |= {"level_db": level_db, "verdict": tried.verdict}
        except ValueError as error:  # what was measured may not suit such a plate
            refusal = f"the level with them is not known: {error}"
            facts |= {"refusal": str(error)}
    found.tell("", words, other_edge=facts)
    if refusal:
        found.warn("", WarningCode.OTHER_EDGE_UNKNOWN, refusal)
    inside_db = -study.burst.masking_limit_db - facts.get("level_db", -math.inf)
    if 0 <= inside_db < _NEAR_LIMIT_DB:
        words = f"that is {inside_db:.1f} dB inside the limit; for more: tactstrip bursts"
        found.warn("", WarningCode.CROSSTALK_NEAR_LIMIT, words)
    found.warn("", WarningCode.IDEAL_EDGE, f"{_WHY[edge]}: measure it, docs/hardware.md")
    return found


def _micrometres(peak_um: float | None) -> str:
    return "" if peak_um is None else f"{peak_um:.3g} um, "


def _where(strip: Strip, same_hz: float) -> str:
    """Say that a loss is matched above the bare plate's cut-off for its patches' sake."""
    cutoff_hz = strip.cutoff_hz()
    factor = cutoff_factor(strip.material, strip.thickness_m, strip.patches)
    above = factor > 1 and math.isclose(same_hz, factor * cutoff_hz)
    return f", the cut-off of plate and patch ({cutoff_hz:.0f} Hz without)" if above else ""


_SURE: Final = 0.03
"""A displacement per volt that the assumed losses part by more is told."""


def _tell_spread(found: Findings, study: Study) -> None:
    """Tell where a measurement was made so near to a mode that the loss decides what it says."""
    from experiment.study.physics import LEAST_LOSS, MOST_LOSS, field_strip, loads_per_volt

    both = [loads_per_volt(study, field_strip(study, loss)) for loss in (LEAST_LOSS, MOST_LOSS)]
    for actuator, (least, _), (most, _) in zip(study.actuators, *both, strict=True):
        factor = max(most / least, least / most) if least and most else 1.0
        if factor > 1 + _SURE:
            at = f"{actuator.label}: measured at {actuator.measured_at_hz:g} Hz, next to the first"
            found.warn(
                "",
                WarningCode.MEASURED_NEAR_MODE,
                f"{at} mode of the plate; its",
                f"micrometres differ by a factor of {factor:.3g} between these losses:",
                "measure at a lower frequency, or state loss_factor",
            )


def _tell_loss(found: Findings, check: StudyCheck, one: ConditionCheck) -> None:
    """Tell what loss the displacements have, whose it is, and its Kelvin-Voigt time."""
    from experiment.study.physics import ASSUMED_LOSS, LEAST_LOSS, MOST_LOSS, field_strip
    from stimuli import causal

    plate, strip = check.study.plate, field_strip(check.study)
    material = strip.material
    viscous_s = causal(strip, one.condition.drive).material.viscous_time_s
    if not plate.is_loss_stated:
        found.warn(
            "",
            WarningCode.ASSUMED_LOSS,
            f"no loss is stated: the levels are the worse of loss factors {LEAST_LOSS:g} and "
            f"{MOST_LOSS:g}",
            f"(assumed); micrometres, plan and simulated people have {ASSUMED_LOSS:g} (assumed)",
        )
        _tell_spread(found, check.study)
        if plate.material in _PLASTICS:
            words = "these are of glued metal; plastics lose more: state loss_factor"
            found.warn("", WarningCode.PLASTIC_LOSS, words)
    found.note(
        loss_basis="stated" if plate.is_loss_stated else "assumed",
        loss_factors=[LEAST_LOSS, MOST_LOSS] if not plate.is_loss_stated else [plate.loss_factor],
        edge_loss=plate.edge_loss if isinstance(strip.edge, ElasticEdge) else None,
        viscous_time_s=viscous_s,
    )
    if material.loss_factor:
        same_hz = material.loss_factor / (2 * math.pi * (viscous_s - material.viscous_time_s))
        found.tell(
            "",
            f"loss factor {material.loss_factor:g} computed as the viscous time of the same loss",
        )
        found.tell(
            "", f"at {same_hz:.0f} Hz{_where(strip, same_hz)}: {viscous_s * 1e6:.3g} us in all"
        )
    if isinstance(strip.edge, ElasticEdge):
        springs = "have the plate's loss" if plate.edge_loss == "plate" else "have no loss"
        found.tell("", f"the springs of the edges {springs} (edge_loss = {plate.edge_loss})")
