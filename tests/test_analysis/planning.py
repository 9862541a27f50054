"""Studies to plan: simulated ones, and made-up ones whose share that reaches a goal is known."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.planning.curve import Studies, find_answers
from analysis.planning.goals import Goal, Outcome
from analysis.planning.sessions import Session, draw_counts
from analysis.planning.studies import Chunk, Point, plan_text, simulate
from experiment.perception.gains import ConditionGains
from experiment.study.physics import study_gains
from experiment.study.threshold import people_for_burst
from tests.plates import study_from_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from analysis.planning.result import Answer
    from experiment import Study

ALONE = ConditionGains(
    condition="main",
    actuators=("left", "right"),
    bases=("predicted", "predicted"),
    per_vpp=((1.0, 0.0), (0.0, 1.0)),
)
"""Each finger gets the vibration of its own actuator only, 1 um per volt."""
BOTH_AND_NONE = 'responses = ["left", "right", "none"]\nboth_trials = 0\nblank_trials = 20'


def study_of(design: str, people: str = "threshold_vpp = 80.0\nthreshold_sd_db = 2.0") -> Study:
    return study_from_text(f"[design]\n{design}\n[simulation]\n{people}", "study.toml")


def plan_of(study: Study, goal: str) -> str:
    return plan_text(study, (ALONE,), Goal.parse(goal))


def simulated(
    study: Study, goal: str, number: int, seed: int, first: int = 0, **point: Any
) -> list[Outcome]:
    """Simulate some studies of a design."""
    at = Point(**({"participants": 3, "trials_per_side": 75, "blanks": 0} | point))
    chunk = Chunk(plan=plan_of(study, goal), point=at, first=first, number=number, seed=seed)
    return simulate(chunk)


def stated_in(plan: str) -> dict[str, Any]:
    """Return the population of a plan."""
    values: dict[str, Any] = json.loads(json.loads(plan)["study"])["simulation"]
    return values


def search(
    share: Callable[[int], float], participants: tuple[int, int], assurance: float = 0.8
) -> Answer:
    """Find the number of participants of whose studies a share reaches the goal."""
    rng = np.random.default_rng(4)

    def spread(_: object, chunks: Iterable[Chunk]) -> Iterator[Any]:
        for chunk in reversed([*chunks]):  # in any order
            reached = rng.random(chunk.number) < share(chunk.point.participants)
            yield chunk, [Outcome(each, 0.5, covered=True) for each in reached.tolist()]

    studies = Studies(plan="", seed=1, spread=spread)
    design = Point(participants=1, trials_per_side=75, blanks=0)
    answers, best = find_answers(studies, [design], participants, assurance)
    return best or answers[0]


def drawn_counts(study: Study, people: int) -> tuple[tuple[ConditionGains, ...], Any]:
    """Return the gains, and rows of detected stimuli by condition and level, and false alarms."""
    gains, population, sessions = study_gains(study), people_for_burst(study), []
    for i in range(people):
        rng = np.random.default_rng((9, i))
        person = population.draw(140.0, rng)
        shifts_db = (0.0, person.difference_db)
        designs = (study.design, study.design)
        sessions.append(Session(person=person, designs=designs, rng=rng, shifts_db=shifts_db))
    tables = draw_counts(sessions, gains[0].at_fingers(study.task.sites), study.task)
    alarms = np.stack([counts.false_alarms for counts in tables], axis=1)
    return gains, np.hstack([*(counts.tables.detected for counts in tables), alarms])


def gains_with(um_per_vpp: float) -> ConditionGains:
    return replace(ALONE, per_vpp=((um_per_vpp, 0.0), (0.0, um_per_vpp)))
