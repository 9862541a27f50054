"""Whether a study file is the one that a session was begun with."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

from experiment.study import StudyError, parsed, read_text
from experiment.study_faults import checked_tables
from experiment.study_settle import settle

if TYPE_CHECKING:
    from pathlib import Path

    from experiment.plan import Plan

_FIRST_ACTUATORS: Final = tuple(
    {"side": side, "x_mm": x_mm, "diameter_mm": 12.8}
    for side, x_mm in (("left", -35.0), ("right", 35.0))
)
_FIRST_PEOPLE: Final = {"threshold_vpp": 58.0, "crosstalk_db": -30.0}
"""What the first version, which knew no displacements, had for an actuator or a key left out."""


def is_recorded(path: Path, plan: Plan) -> bool:
    """Tell whether a study file says what a plan's study said.

    A window that the program chose is the one of the plan, and is not chosen again. What a file
    leaves out may have been something else when an older version read it.

    Parameters
    ----------
    path : Path
        The study file.
    plan : Plan
        The session's plan.

    Raises
    ------
    StudyError
        If there is no such file or it is not a study.
    """
    tables = parsed(read_text(path), str(path))
    recorded = checked_tables(json.loads(plan.study))
    readings = [tables] if plan.gains else [tables, _as_first_read(tables)]
    try:
        found = [settle(checked_tables(one), path.parent, recorded) for one in readings]
    except ValueError as error:
        raise StudyError(f"{path}: {error}") from error
    return plan.file_sha256 in [study.sha256 for study in found]


def _as_first_read(tables: dict[str, Any]) -> dict[str, Any]:
    people = tables.get("simulation", {})
    if "threshold_um" in people:
        return tables
    return {"actuator": list(_FIRST_ACTUATORS)} | tables | {"simulation": _FIRST_PEOPLE | people}
