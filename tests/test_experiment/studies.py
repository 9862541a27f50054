"""Studies as text, and what the check of one says to programs."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiment import ConditionGains, check_study
from experiment.check.plate import PlatePreview
from experiment.check.report import report_json
from experiment.check.study_report import report_study
from experiment.study.files import study_from_canonical
from experiment.trial.plan import plan_from_json
from tests.plates import study_from_text

if TYPE_CHECKING:
    from experiment import Plan, Study


CASES = Path(__file__).with_name("cases")
KNOWN = ConditionGains(
    condition="main",
    actuators=("left", "right"),
    bases=("measured", "measured"),
    per_vpp=((0.009, 0.0001), (0.0001, 0.009)),
)
"""What an actuator does at either finger, um per V: a check with it takes no time."""


def discs(left: str = "", right: str | None = None, *, x_mm: float = 35, mm: float = 12.8) -> str:
    """Return two actuators with their keys; the right one has those of the left by default."""
    return "".join(
        f'[[actuator]]\nsite = "{side}"\nx_mm = {x}\ndiameter_mm = {mm}\n{keys}'
        for side, x, keys in (
            ("left", -x_mm, left),
            ("right", x_mm, left if right is None else right),
        )
    )


def measured(um: float = 2.6, hz: float = 300, vpp: float = 100) -> str:
    """Return the keys of a displacement that was measured."""
    return f"measured_displacement_um = {um}\nmeasured_at_vpp = {vpp}\nmeasured_at_hz = {hz}\n"


def cases(name: str) -> list[tuple[str, str]]:
    """Read a table of cases: what is given, and behind the mark what comes of it."""
    rows = (CASES / f"{name}.txt").read_text("utf-8").splitlines()
    split = [row.partition(" ## ") for row in rows if " ## " in row]
    return [(given.replace(r"\n", "\n"), expected) for given, _, expected in split]


@cache
def facts_of(
    text: str, gains: tuple[ConditionGains, ...] | None = None, driver: str | None = None
) -> dict[str, Any]:
    """Check the study of a text, once; with gains given it takes no time."""
    study = study_from_text(text, "study.toml")
    device = study.device if driver is None else study.device.changed(driver=driver)
    report = report_study(check_study(study, gains=gains), "study.toml", device=device)
    facts: dict[str, Any] = json.loads(report_json(report))
    return facts


def codes_of(facts: dict[str, Any]) -> list[str]:
    """Return the codes of a check's warnings."""
    return [warning["code"] for warning in facts["warnings"]]


def message_of(facts: dict[str, Any], code: str) -> str:
    """Return the message of the only warning with a code."""
    (message,) = [one["message"] for one in facts["warnings"] if one["code"] == code]
    return str(message)


def plate(text: str = "") -> PlatePreview:
    """Return the plate of a study as `tactstrip field` shows it."""
    return PlatePreview(study_from_text(text, "s.toml"))


def recorded(study: Study) -> Study:
    """Return a study as a plan holds it, read again."""
    return study_from_canonical(study.canonical)


def recorded_plan(text: str) -> Plan:
    """Return a plan from the text of its file, if that is as it was sealed."""
    return plan_from_json(text)
