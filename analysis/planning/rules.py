"""Rules of levels compared: the error of thresholds after so many trials, in simulated sessions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from device.clock import VirtualClock
from experiment.levels import Bayesian
from experiment.session.simulate import simulate_study, simulated_responder
from experiment.tasks.task import BLANK, SINGLE

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from experiment.perception.gains import ConditionGains
    from experiment.record.folder import SessionFolder
    from experiment.study.study import Study

RULES: Final = ("constant", "staircase", "bayesian")
CHECKPOINTS: Final = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
"""Trials at a site after which thresholds are compared; the last of a study are added."""


def compare_rules(
    study: Study,
    root: Path,
    *,
    participants: int,
    seed: int,
    gains: tuple[ConditionGains, ...] | None = None,
) -> pd.DataFrame:
    """Return the error of thresholds under each rule of levels, of the same simulated people.

    After each number of trials at a site, the threshold is the median of the Bayesian rule's
    posterior of all answers up to then, whatever the rule; so that only the choice of levels
    differs. The true threshold is the simulated one in volts, with its drift averaged. Sessions
    lie in a folder of each rule below `root`. The study's own rule has the study's settings.

    Columns ``rule trials thresholds rms_db bias_db``, the third the number of thresholds.
    """
    studies = {
        rule: study if rule == study.levels.rule else study.changed(levels={"rule": rule})
        for rule in RULES
    }
    rows = []
    for rule, ruled in studies.items():
        sessions = simulate_study(
            ruled, root / rule, participants=participants, seed=seed, gains=gains
        )
        rows += [(rule, *error) for folder in sessions for error in _errors_db(ruled, folder)]
    errors = pd.DataFrame(rows, columns=["rule", "trials", "error_db"])
    groups = errors.groupby(["rule", "trials"])["error_db"]
    table = pd.DataFrame(
        {
            "thresholds": groups.size(),
            "rms_db": groups.agg(lambda error_db: float(np.sqrt(np.mean(error_db**2)))),
            "bias_db": groups.mean(),
        }
    )
    return table.reindex([*RULES], level="rule").reset_index()


def _errors_db(study: Study, folder: SessionFolder) -> Iterator[tuple[int, float]]:
    """Yield the error of each site's threshold in the first condition, after so many trials."""
    plan, task = folder.read_plan(), study.task
    responder = simulated_responder(study, plan, VirtualClock())
    condition = study.conditions[0].name
    gains = plan.gains_of(condition)
    thresholds_vpp = np.array(responder.observer.thresholds(gains)) / gains.own
    rows = [
        row
        for row in folder.read_history(plan).rows
        if row.condition == condition and row.status == "ok" and not row.premature
    ]
    design = study.design_of(condition)
    checkpoints = {*CHECKPOINTS, design.trials_per_side}
    for i, site in enumerate(task.sites):
        track = Bayesian(candidates_vpp=design.levels_vpp, seed=0).start(plan.responses, task)
        shifts_db: list[float] = []
        for row in rows:
            shown = task.presentation(row.side)
            if row.kind == SINGLE and shown.site == site:
                shifts_db.append(responder.shifts_db[row.trial][i])
            elif row.kind != BLANK:
                continue
            track.update(shown, row.level_vpp, row.response or "")
            estimate = track.estimate()
            if row.kind == SINGLE and len(shifts_db) in checkpoints and estimate is not None:
                over_db = 20 * np.log10(estimate.threshold_vpp / thresholds_vpp[i])
                yield len(shifts_db), float(over_db - np.mean(shifts_db))


def format_rules(table: pd.DataFrame) -> Sequence[str]:
    """Return the table as lines, a row for each rule and a column for each number of trials."""
    errors = table.pivot_table("rms_db", "rule", "trials", sort=False)
    return [
        f"{'trials at each finger':<22}" + "".join(f"{trials:>6}" for trials in errors),
        *(
            f"{rule:<22}" + "".join(f"{error_db:6.2f}" for error_db in errors.loc[rule])
            for rule in errors.index
        ),
    ]
