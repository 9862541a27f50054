"""What a study file leaves to be found when it is read: the samples of files, chosen windows.

It is found once. A plan holds what was found, so that what is played is never found anew.
"""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING

from experiment.study_build import built_study

if TYPE_CHECKING:
    from pathlib import Path

    from experiment.burst_tables import ConditionTable
    from experiment.study_tables import StudyTables
    from experiment.study_values import Study


def settle(tables: StudyTables, folder: Path | None, recorded: StudyTables | None) -> Study:
    """Find what is missing in checked tables, write it into them, and build the study.

    Parameters
    ----------
    tables : StudyTables
        Tables of a study; the conditions are filled in.
    folder : Path or None
        Where the study file lies; none where the tables are no file's.
    recorded : StudyTables or None
        Tables of the same study as a plan holds it: a window that was chosen then is the one.

    Raises
    ------
    ValueError
        If a value is out of its range, a file cannot be used, or no window does what is wanted.
    """
    for condition in tables.condition:
        if condition.file is not None and condition.samples_base64 is None and folder is not None:
            condition.samples_base64 = _samples_base64(
                folder / condition.file, tables.device.sample_rate_hz
            )
    study = built_study(tables)
    waiting = [
        (place, condition)
        for place, condition in enumerate(tables.condition)
        if condition.window == "auto" and condition.auto_window is None
    ]
    if not waiting:
        return study
    for place, condition in waiting:
        _choose_window(condition, study, place, recorded)
    return built_study(tables)


def _samples_base64(path: Path, sample_rate_hz: float) -> str:
    from experiment.click import read_click

    return base64.b64encode(read_click(path, sample_rate_hz).astype("<f8").tobytes()).decode()


def _choose_window(
    condition: ConditionTable, study: Study, place: int, recorded: StudyTables | None
) -> None:
    for before in recorded.condition if recorded is not None else ():
        stated = before.model_copy(update={"auto_cycles": None, "auto_window": None})
        if stated.model_dump() == condition.model_dump() and before.auto_window is not None:
            condition.auto_cycles, condition.auto_window = before.auto_cycles, before.auto_window
            return
    from experiment.felt_gains import chosen_burst

    burst = chosen_burst(study, study.conditions[place])
    condition.auto_cycles, condition.auto_window = burst.cycles, burst.window
