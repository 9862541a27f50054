"""What `tactstrip power` promises, against what fresh studies attain.

By hand, as it takes hours, and on one thread, as the program does: ``OPENBLAS_NUM_THREADS=1 python
-m benchmarks.power FILE`` keeps what it computes in FILE, goes on from there when it is started
again, and prints a row for each of 40 plans: 1000 fresh studies of each; and then 100 of each
through the whole chain (sessions on the engine, their files, the analysis), with a pilot session of
each person where levels are placed.
"""

from __future__ import annotations

import math
import sys
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.counts.table import count_answers, count_blanks, level_table
from analysis.numbers import TOTAL
from analysis.planning.curve import Studies, plan_study
from analysis.planning.goals import Goal
from analysis.planning.levels import LevelsError, placed_levels
from analysis.planning.people import stated_people
from analysis.planning.spread import Kept, spread
from analysis.planning.studies import pilot_levels_vpp, plan_text
from analysis.reading.trials import read_trials
from analysis.thresholds.table import difference_table, group_table, thresholds_of
from analysis.thresholds.tables import tables_of
from device.clock import VirtualClock
from experiment.hardware.noise import SilentNoise
from experiment.hardware.setup import mock_device
from experiment.operator.requests import StopSignal
from experiment.perception.observer import Observer
from experiment.record.files import UNWAITED
from experiment.record.folder import SessionFolder
from experiment.session.config import SessionConfig
from experiment.session.run import run
from experiment.session.simulate import SimulatedResponder, simulate_study, simulated_responder
from experiment.study.files import with_levels
from experiment.study.physics import study_gains
from experiment.study.writing import preset_text
from experiment.trial.draw import draw_plan
from tests.plates import study_from_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from analysis.planning.result import Answer
    from experiment.perception.gains import ConditionGains
    from experiment.study.study import Study
    from experiment.trial.plan import Plan as SessionPlan


ASSURANCE: Final = 0.8
FRESH, WHOLE = 1000, 100
_WHOLE_AT_ONCE: Final = 5
_SEED: Final = 20_000
_STUDY: Final = """
[burst]
window = "hann"
[design]
levels_vpp = [38.0, 49.0, 62.0, 79.0, 100.0]
order = "balanced"
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
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A study, its goal, and the numbers of people that are tried."""

    goal: str
    spread_db: float = 2.0
    trials: int = 50
    blanks: int = 0
    false_alarms: float = 0.05
    placed: bool = False
    most: int = 24

    def study(self) -> Study:
        """Return the study."""
        words = '"left", "right", "none"' if self.blanks else '"left", "right", "both"'
        return study_from_text(
            (_STUDY + '[[condition]]\nname = "b"\n' * self.goal.startswith("difference")).format(
                trials=self.trials,
                blanks=self.blanks,
                responses=f"[{words}]",
                spread_db=self.spread_db,
                false_alarms=self.false_alarms,
            ),
            "study.toml",
        )


def plans() -> list[Plan]:
    """Return forty plans, ten of each of the four kinds of goals."""
    spreads = ((1.5, (1.25, 1.5, 2.0, 2.5, 3.0)), (2.5, (1.75, 2.0, 2.5, 3.0, 3.5)))
    return [
        *(
            Plan(
                goal=f"false-alarms={size:g}%", trials=5, blanks=blanks, false_alarms=rate, most=80
            )
            for (rate, size), blanks in product(
                ((0.01, 4.5), (0.01, 5), (0.02, 6), (0.02, 7), (0.05, 10)), (20, 40)
            )
        ),
        *(
            Plan(goal=f"detection={size}%@62V", spread_db=spread_db)
            for spread_db, sizes in ((1.5, (8, 9, 10, 12, 15)), (2.5, (10, 11, 12, 14, 16)))
            for size in sizes
        ),
        *(
            Plan(goal=f"difference={size:g}dB", trials=trials, blanks=blanks, placed=not blanks)
            for size, (trials, blanks) in product((1.25, 1.5, 2.0, 2.5, 3.0), ((80, 20), (50, 0)))
        ),
        *(
            Plan(
                goal=f"half-width={size:g}dB",
                spread_db=spread_db,
                trials=50 + 30 * (i % 2),
                placed=i > 2,
            )
            for spread_db, sizes in spreads
            for i, size in enumerate(sizes)
        ),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Whole:
    """Some studies of a plan through the whole chain, as plain values."""

    plan: Plan
    participants: int
    seed: int
    first: int


def attained(
    study: Study, goal: Goal, answer: Answer, number: int, *, seed: int, spread: Any
) -> tuple[int, int]:
    """Return in how many of so many fresh studies the goal is reached."""
    point = answer.point.at(answer.participants or 0)
    plan = plan_text(study, study_gains(study), goal)
    studies = Studies(plan=plan, seed=seed, spread=spread)
    studies.run([point], range(number))
    tally = studies.tally(point, range(number))
    return tally.reached, tally.studies


def through_the_chain(chunk: Whole) -> int:
    """Return in how many studies the goal is reached by sessions, files and analysis' tables."""
    study, goal = chunk.plan.study(), Goal.parse(chunk.plan.goal)
    difference_db = goal.size if goal.kind == "difference" else 0.0
    study = study.changed(simulation=replace(study.simulation, difference_db=difference_db))
    gains, reached = study_gains(study), 0
    sessions = placed_sessions if chunk.plan.placed else simulate_study
    for i in range(chunk.first, chunk.first + _WHOLE_AT_ONCE):
        with TemporaryDirectory() as folder:
            for _ in sessions(
                study,
                Path(folder),
                participants=chunk.participants,
                seed=chunk.seed + i,
                gains=gains,
            ):
                pass
            reached += _reached(read_trials([Path(folder)]), goal)
    return reached


def placed_sessions(
    study: Study, root: Path, *, participants: int, seed: int, gains: tuple[ConditionGains, ...]
) -> Iterator[SessionFolder]:
    """Run a pilot session of each person, place levels on it, and run the session at these."""
    design = replace(
        study.design,
        levels_vpp=pilot_levels_vpp(study, gains[0].at_fingers(study.task.sites)),
        trials_per_side=20,
        blank_trials=12 if "none" in study.design.responses else 0,
    )
    pilot, last = study.changed(design=design), study.conditions[-1].name
    for number, child in enumerate(np.random.SeedSequence(seed).spawn(participants), start=1):
        of_person, of_pilot = (int(state) for state in child.generate_state(2))
        plan = _plan(study, number, of_person, gains)
        person = simulated_responder(study, plan, VirtualClock()).observer_values
        person.pop("unmeasured")
        with TemporaryDirectory() as folder:
            plan, clock = _plan(pilot, number, of_pilot, gains), VirtualClock()
            of_trial = {trial.number: plan.gains_of(trial.condition) for trial in plan.trials}
            own_db = person["difference_db"] * (len(study.conditions) > 1)
            responder = SimulatedResponder(
                Observer(**person),
                clock,
                seed=plan.seed,
                gains=of_trial,
                shifts_db={t.number: (own_db, own_db) for t in plan.trials if t.condition == last},
            )
            _run(pilot, Path(folder), plan, responder, clock)
            levels_vpp = _levels(read_trials([Path(folder)]), study)
        at_levels = with_levels(study, levels_vpp)
        plan, clock = _plan(at_levels, number, of_person, gains), VirtualClock()
        yield _run(at_levels, root, plan, simulated_responder(at_levels, plan, clock), clock)


def _levels(pilot: pd.DataFrame, study: Study) -> dict[str, tuple[float, ...]]:
    """Place levels as `tactstrip levels` does, without the second it takes to tell their error."""
    levels_vpp = {}
    for condition, person in tables_of(pilot).conditions.items():
        levels_vpp[condition] = study.design.levels_vpp
        with suppress(LevelsError):
            levels_vpp[condition] = placed_levels(person, *study.device.highest)
    return levels_vpp


def _plan(study: Study, number: int, seed: int, gains: tuple[ConditionGains, ...]) -> SessionPlan:
    return draw_plan(
        study,
        participant=f"{number:02d}",
        session="01",
        seed=seed,
        gains=gains,
        participant_number=number,
    )


def _run(
    study: Study, root: Path, plan: SessionPlan, responder: SimulatedResponder, clock: VirtualClock
) -> SessionFolder:
    folder = SessionFolder(root, plan.participant, plan.session, disk=UNWAITED)
    run(
        folder,
        plan,
        SessionConfig(
            device=mock_device(study, clock),
            responder=responder,
            noise=SilentNoise(),
            clock=clock,
            stop=StopSignal(),
        ),
    )
    return folder


def _reached(trials: pd.DataFrame, goal: Goal) -> bool:
    """Tell by the tables of an analysis."""
    if goal.kind == "difference":
        people = tables_of(trials)
        thresholds = thresholds_of(people, seed=0)
        groups = group_table(people, thresholds)
        found = difference_table(people, thresholds, groups)
        return bool(found.loc[found["participant"].eq(TOTAL), "low_db"].iloc[0] > 0)
    first = trials[trials["condition"].eq("a")]
    if goal.kind == "half-width":
        people = tables_of(first)
        row = group_table(people, thresholds_of(people, seed=0)).iloc[0]
        half_db = 10 * math.log10(row["threshold_high_vpp"] / row["threshold_low_vpp"])
        return bool(half_db <= goal.size)
    if goal.kind == "detection":
        table = level_table(first)
        row = table[np.isclose(table["level_vpp"], goal.level_vpp or 0.0)].iloc[0]
        return bool(row["p_high"] - row["p_low"] <= 2 * goal.size)
    return bool(count_blanks(count_answers(first))["high"].iloc[-1] <= goal.size)


def row(plan: Plan, seed: int, spread: Any, *, fresh: int = FRESH, whole: int = WHOLE) -> str:
    """Return the row of a plan, with so many studies through the whole chain or without."""
    study, goal = plan.study(), Goal.parse(plan.goal)
    result = plan_study(
        stated_people(study, goal),
        goal,
        participants=(2, plan.most),
        trials_per_side=None,
        blanks=None,
        placed=plan.placed,
        assurance=ASSURANCE,
        seed=seed,
        spread=spread,
    )
    answer = result.best
    levels = "placed" if plan.placed else "fixed"
    head = f"| {plan.goal} | {plan.spread_db:g} dB | {plan.trials} | {plan.blanks} | {levels} |"
    if answer is None:
        return f"{head} none to {plan.most} | - | - | - | - |"
    number = answer.participants or 0
    people = f"{number}"
    if (answer.low, answer.high) != (number, number):
        people = f"{number} ({answer.low} to {answer.high or 'more'})"
    promised = answer.checked.share if answer.checked else math.nan
    kept = {"threshold_at_hz", "threshold_at_s", "threshold_at_cm2"}
    if goal.kind == "false-alarms":  # whose rate is what the plan states
        kept.add("false_alarm_rate")
    realistic = study_from_text(preset_text("realistic")).simulation
    keys = {key: getattr(realistic, key) for key in realistic.model_fields_set - kept}
    real = study.changed(simulation=study.simulation.changed(**keys))
    others = {"seed": _SEED + 1000 * seed, "spread": spread}
    told: list[tuple[int, int] | None] = [
        attained(study, goal, answer, fresh, **others),
        None,
        attained(real, goal, answer, fresh, **others),
    ]
    if whole:
        chunks = [
            Whole(plan=plan, participants=number, seed=_SEED + 1000 * seed, first=first)
            for first in range(0, whole, _WHOLE_AT_ONCE)
        ]
        told[1] = (
            sum(reached for _, reached in spread(through_the_chain, chunks)),
            _WHOLE_AT_ONCE * len(chunks),
        )
    shares = " | ".join("-" if one is None else share(*one) for one in told)
    return f"{head} {people} | {promised:.1%} | {shares} |"


def share(reached: int, studies: int) -> str:
    """Return a share, to a percent of few studies.

    >>> share(80, 100), share(805, 1000)
    ('80%', '80.5%')
    """
    return f"{reached / studies:.{1 if studies >= FRESH else 0}%}"


def main(path: str) -> None:
    """Print the table, first without the whole chain."""
    keeping = partial(spread, kept=Kept(Path(path), {"benchmark": "power"}))
    for whole in (0, WHOLE):
        print(
            "| goal | between people | trials a side | blanks | levels | people | promised | "
            "attained | whole chain | realistic people |"
        )
        print("|---" * 10 + "|")
        for i, plan in enumerate(plans()):
            print(row(plan, i, keeping, whole=whole), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
