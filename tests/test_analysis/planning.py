"""Studies to plan: real ones that are simulated, and made-up ones that reach a goal so often."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.power.counts import Session, draw_counts
from analysis.power.goals import Goal
from analysis.power.levers import thumb
from analysis.power.planning import plan_study
from analysis.power.population import stated_people
from analysis.power.search import Trials, Tried, answers, smallest
from analysis.power.studies import Chunk, Point, pilot_levels_vpp, plan_text, simulate
from experiment.perception.gains import OWN_FINGER_ONLY, ConditionGains
from experiment.study.physics import study_gains
from experiment.study.threshold import people_for_burst
from tests.plates import study_from_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from analysis.power.levers import Thumb
    from analysis.power.promise import Promise
    from analysis.power.search import Answer
    from experiment import Study

ALONE = ConditionGains(
    condition="main",
    actuators=("left", "right"),
    bases=(None, None),
    per_vpp=((1.0, 0.0), (0.0, 1.0)),
)
"""Each finger gets its own actuator's vibration only."""
BOTH_AND_NONE = 'responses = ["left", "right", "none"]\nboth_trials = 0\nblank_trials = 20'


def study_of(design: str, people: str = "threshold_vpp = 80.0\nthreshold_sd_db = 2.0") -> Study:
    return study_from_text(f"[design]\n{design}\n[simulation]\n{people}", "study.toml")


def goal_of(text: str) -> Goal:
    return Goal.parse(text)


def simulated(study: Study, goal: str, number: int, seed: int, first: int = 0, **point: Any) -> Any:
    """Simulate some studies of a design: lists of what each reaches."""
    at = Point(**({"participants": 3, "trials_per_side": 75, "blanks": 0} | point))
    plan = plan_text(study, (ALONE,), Goal.parse(goal))
    return simulate(Chunk(plan=plan, point=at, first=first, number=number, seed=seed))


def planned(study: Study, goal: str) -> dict[str, Any]:
    """Return the study that is simulated for a goal."""
    plan: dict[str, Any] = json.loads(plan_text(study, (ALONE,), Goal.parse(goal)))
    contents: dict[str, Any] = json.loads(plan["study"])
    return contents


def pilot_levels(study: Study) -> tuple[float, ...]:
    return pilot_levels_vpp(study, OWN_FINGER_ONLY)


def made_up(
    reached: Callable[[int, int, int], Iterable[Any]],
    number: Callable[[int, int, int], Iterable[float | None]] | None = None,
) -> Trials:
    """Trials whose studies reach the goal by (participants, first study, how many studies)."""

    def spread(_: object, chunks: Iterable[Chunk]) -> Iterator[Any]:
        for chunk in reversed([*chunks]):  # in any order
            asked = (chunk.point.participants, chunk.first, chunk.number)
            hits = [int(hit) for hit in reached(*asked)]
            values = [0.5 if hit else 2.0 for hit in hits] if number is None else [*number(*asked)]
            yield chunk, {"reached": hits, "number": values, "covered": hits}

    return Trials(plan="", seed=1, spread=spread)


def evenly(share: Callable[[int], float]) -> Trials:
    """Trials of which so large a share reaches the goal, by the number of people."""

    def reached(people: int, first: int, number: int) -> Iterable[bool]:
        return (study * 0.618 % 1 < share(people) for study in range(first, first + number))

    return made_up(reached)


def search(trials: Trials, participants: tuple[int, int], assurance: float = 0.8) -> Answer:
    """Search the smallest number of participants between two."""
    at = Point(participants=1, trials_per_side=75, blanks=0)
    (found,) = answers(trials, [smallest(trials, at, participants, assurance)])
    return found


def rule_of_thumb(
    trials: Trials, people: int, studies: int, goal: str, rate: float | None = None, **tried: Any
) -> Thumb:
    """Return the rule of thumb from so many studies with so many people."""
    at = Point(participants=people, trials_per_side=75, blanks=20)
    if tried:
        base = Tried(point=at, studies=studies, covered=0.95, **tried)
    else:
        (base,) = trials.run([at], studies)
    return thumb(trials, base, Goal.parse(goal), 0.8, rate)


def promised(
    share: Callable[[int], float],
    participants: tuple[int, int],
    step: Callable[[float, float, Callable[[], str]], object] = lambda *_: None,
    goal: str = "false-alarms=9%",
) -> Promise:
    """Plan where so large a share of the studies of a number of people reaches the goal."""
    study = study_of(BOTH_AND_NONE, "sigma = 0.2\nthreshold_sd_db = 2.0")
    return plan_study(
        stated_people(study, Goal.parse(goal)),
        Goal.parse(goal),
        participants=participants,
        trials_per_side=None,
        blanks=None,
        placed=False,
        assurance=0.8,
        seed=1,
        spread=evenly(share).spread,
        predicted=lambda *_: None,
        step=step,
    )


def within_error(share: float, exact: float, studies: int) -> bool:
    return abs(share - exact) < 4 * math.sqrt(exact * (1 - exact) / studies)


def gains_of(**um_per_vpp: float) -> list[ConditionGains]:
    """Return gains by condition: micrometres of each finger by its own actuator."""
    basis = ("predicted", "predicted")
    return [
        replace(ALONE, condition=name, bases=basis, per_vpp=((um, 0.0), (0.0, um)))
        for name, um in um_per_vpp.items()
    ]


def drawn_counts(study: Study, people: int) -> tuple[tuple[ConditionGains, ...], Any]:
    """Return the gains, and rows of detected stimuli by condition and level, and false alarms."""
    gains, population, sessions = study_gains(study), people_for_burst(study), []
    for i in range(people):
        rng = np.random.default_rng((9, i))
        person = population.draw(140.0, rng)
        shifts_db = (0.0, person.difference_db)
        sessions.append(Session(person=person, design=study.design, rng=rng, shifts_db=shifts_db))
    drawn = draw_counts(sessions, gains[0].fingers())
    detected = [[count for counts in both for count in counts.detected] for both in drawn]
    alarms = [[counts.false_alarms for counts in both] for both in drawn]
    return gains, np.hstack([detected, alarms])
