"""What `tactstrip power` promises, against what fresh studies attain.

By hand, as it takes hours, and on one thread, as the program does: ``OPENBLAS_NUM_THREADS=1 python
-m benchmarks.power [PLANS [FRESH [WHOLE]]]`` prints a row for each plan; by default 40 plans, 1000
fresh studies each, and 100 through the whole chain (sessions on the engine, their files, the
analysis) of every eighth.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.answers.detection import blank_table, level_table
from analysis.answers.intervals import proportion_ci
from analysis.axis import VOLTS
from analysis.groups.tables import GROUP, difference_table, group_table
from analysis.power.goals import Goal
from analysis.power.planning import plan_study
from analysis.power.population import stated_people
from analysis.power.search import Trials
from analysis.power.studies import design_of, plan_text
from analysis.reading.load import read_trials
from analysis.thresholds.people import people_of
from analysis.thresholds.table import thresholds_of
from analysis.workers.chunks import spread
from experiment.commands.init import _REALISTIC
from experiment.session.simulate import simulate_study
from experiment.study.physics import study_gains
from experiment.study.read import study_from_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from analysis.power.search import Answer
    from experiment.study.study import Study


ASSURANCE: Final = 0.8
PLANS, FRESH, WHOLE, EVERY = 40, 1000, 100, 8
_SEED: Final = 20_000
_STUDY: Final = """
[burst]
window = "hann"
[design]
levels_vpp = [49.0, 57.0, 64.0, 73.0, 91.0]
trials_per_side = {trials}
both_trials = 0
blank_trials = {blanks}
responses = {responses}
break_every = 0
[simulation]
threshold_vpp = 62.0
threshold_sd_db = {spread_db}
difference_sd_db = 1.0
false_alarm_rate = {false_alarms}
[[condition]]
name = "a"
[[condition]]
name = "b"
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A study, its goal, and the numbers of people that are tried."""

    goal: str
    spread_db: float
    trials: int
    blanks: int = 0
    false_alarms: float = 0.05
    most: int = 24

    def study(self) -> Study:
        """Return the study."""
        words = '"left", "right", "none"' if self.blanks else '"left", "right", "both"'
        return study_from_text(
            _STUDY.format(
                trials=self.trials,
                blanks=self.blanks,
                responses=f"[{words}]",
                spread_db=self.spread_db,
                false_alarms=self.false_alarms,
            ),
            "study.toml",
        )


def plans() -> Iterator[Plan]:
    """Yield forty plans, the four kinds of goals in turn."""
    sizes = product((1.5, 2.5), (0, 30))
    for size, (spread_db, trials) in product((0, 1, 2, 3, 4), sizes):
        yield Plan(
            goal=f"half-width={(1.5, 2.0, 2.5, 3.0, 3.5)[size]:g}dB",
            spread_db=spread_db, trials=50 + trials,
        )  # fmt: skip
        if size % 2:
            yield Plan(goal=f"difference={1.5 + 0.5 * size:g}dB", spread_db=spread_db,
                       trials=50 + trials, blanks=20)  # fmt: skip
        elif trials:
            yield Plan(goal=f"detection={8 + 2 * size}%@64V", spread_db=spread_db, trials=50)
        else:
            yield Plan(goal=f"false-alarms={4 + size}%", spread_db=spread_db, trials=1,
                       blanks=20, false_alarms=0.01)  # fmt: skip


def attained(study: Study, goal: Goal, answer: Answer, number: int) -> tuple[int, int]:
    """Return in how many of so many fresh studies the goal is reached."""
    point = replace(answer.point, participants=answer.participants or 0)
    plan = plan_text(study, study_gains(study), goal)
    trials = Trials(plan=plan, seed=_SEED, spread=spread)
    (found,) = trials.run([point], number)
    return found.reached, found.studies


def through_the_chain(study: Study, goal: Goal, answer: Answer, number: int) -> tuple[int, int]:
    """Return the same of studies by sessions, files and the analysis' tables."""
    design = design_of(study.design, answer.point)
    difference_db = goal.size if goal.kind == "difference" else 0.0
    simulation = replace(study.simulation, difference_db=difference_db)
    study = study.changed(design=design, simulation=simulation)
    gains, reached = study_gains(study), 0
    for i in range(number):
        with TemporaryDirectory() as folder:
            people = answer.participants or 0
            for _ in simulate_study(
                study, Path(folder), participants=people, seed=_SEED + i, gains=gains
            ):
                pass
            reached += _reached(read_trials([Path(folder)]), goal)
    return reached, number


def _reached(trials: pd.DataFrame, goal: Goal) -> bool:
    """Tell by the tables of an analysis."""
    if goal.kind == "difference":
        found = difference_table(people_of(trials), VOLTS)
        return bool(found.loc[found["participant"].eq(GROUP), "low_db"].iloc[0] > 0)
    first = trials[trials["condition"].eq("a")]
    if goal.kind == "half-width":
        people = people_of(first)
        row = group_table(people, thresholds_of(people, seed=0, axis=VOLTS), VOLTS).iloc[0]
        half_db = 10 * math.log10(row["threshold_high_vpp"] / row["threshold_low_vpp"])
        return bool(half_db <= goal.size)
    if goal.kind == "detection":
        table = level_table(first)
        row = table[np.isclose(table["level_vpp"], goal.level_vpp or 0.0)].iloc[0]
        return bool(row["group_high"] - row["group_low"] <= 2 * goal.size)
    return bool(blank_table(first)["high"].iloc[-1] <= goal.size)


def rows(chosen: list[Plan], fresh: int = FRESH, whole: int = WHOLE) -> Iterator[str]:
    """Yield a row for each plan."""
    for i, plan in enumerate(chosen):
        study, goal = plan.study(), Goal.parse(plan.goal)
        promise = plan_study(
            stated_people(study, goal), goal, participants=(2, plan.most), trials_per_side=None,
            blanks=None, placed=False, assurance=ASSURANCE, seed=i, spread=spread,
            predicted=lambda *_: None, step=lambda _: None,
        )  # fmt: skip
        answer = promise.best
        head = f"| {plan.goal} | {plan.spread_db:g} dB | {plan.trials} | {plan.blanks} |"
        if answer is None:
            yield f"{head} none to {plan.most} | - | - | - | - |"
            continue
        people = f"{answer.participants} ({answer.low} to {answer.high or 'more'})"
        point = replace(answer.point, participants=answer.participants or 0)
        promised = next(one.assurance for one in promise.tried if one.point == point)
        chain = through_the_chain(study, goal, answer, whole) if whole and i % EVERY == 0 else None
        keys = {key: value for key, value in _REALISTIC.items() if not key.startswith("threshold")}
        simulation = replace(study.simulation, **keys)
        real = attained(study.changed(simulation=simulation), goal, answer, fresh)
        told = [attained(study, goal, answer, fresh), chain, real]
        shares = " | ".join("-" if one is None else share(*one) for one in told)
        yield f"{head} {people} | {promised:.1%} | {shares} |"


def share(reached: int, studies: int) -> str:
    """Return a share with its 95 % interval.

    >>> share(80, 100)
    '80.0% (71.1% to 86.7%)'
    """
    low, high = proportion_ci(reached, studies)
    return f"{reached / studies:.1%} ({low:.1%} to {high:.1%})"


def main(numbers: list[str]) -> None:
    """Print the table."""
    print("| goal | between people | trials a side | blanks | people | promised | attained | "
          "whole chain | realistic people |")  # fmt: skip
    print("|---" * 9 + "|")
    count, *others = [*map(int, numbers)] or [PLANS]
    for row in rows([*plans()][:count], *others):
        print(row, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
