"""From a study and a goal to a promise: what is tried, in which order."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.power.levers import levers
from analysis.power.population import truth_of
from analysis.power.promise import Promise
from analysis.power.search import Trials, answers, most_work, slower, smallest
from analysis.power.so_far import SoFar
from analysis.power.studies import Point, pilot_levels_vpp, plan_text
from experiment.study.physics import study_gains
from experiment.study.simulated import people_for_burst

if TYPE_CHECKING:
    from collections.abc import Callable

    from analysis.power.goals import Goal
    from analysis.power.population import People
    from analysis.power.search import Spread
    from experiment.study.study import Study


LEVELS_PLACED: Final = 5
_RUNGS: Final = 4
"""Numbers of trials, or of blanks, between the least and the most that are asked for."""


def plan_study(
    people: People,
    goal: Goal,
    *,
    participants: tuple[int, int],
    trials_per_side: tuple[int, int] | None,
    blanks: tuple[int, int] | None,
    placed: bool,
    assurance: float,
    seed: int,
    spread: Spread,
    predicted: Callable[[float, float], object],
    step: Callable[[float, Callable[[], str]], object],
) -> Promise:
    """Return how many people, from one number to another, reach a goal as often as is asked for.

    Before the search starts `predicted` is told the processor time that it takes at most, in s,
    and its amount of work; `step` then how much of this is done, with what tells the answer that
    is known so far, in words.
    """
    study = people.study
    points = _points(study, goal, trials_per_side, blanks, placed=placed)
    gains = study_gains(study)
    plan = plan_text(study, gains, goal, people.draws)
    trials = Trials(plan=plan, seed=seed, spread=spread)
    so_far = SoFar(trials=trials, points=points, participants=participants, assurance=assurance)
    trials.step = lambda part: step(part, so_far.words)
    work = most_work(points, participants)
    predicted(work * slower(trials, replace(points[0], participants=participants[1])), work)
    found = answers(trials, [smallest(trials, point, participants, assurance) for point in points])
    so_far.answers = found
    levels = LEVELS_PLACED if placed else len(study.design.levels_vpp)
    first = next((one for one in found if one.participants is not None), found[0])
    changes = levers(trials, first, participants, goal.kind, levels)
    asks_blanks = goal.kind == "false-alarms"
    fingers = gains[0].fingers()
    own = truth_of(goal, study.simulation, study, fingers) if asks_blanks else None
    return Promise(
        study=study.name,
        goal=goal,
        assurance=assurance,
        participants=participants,
        answers=found,
        tried=tuple(trials.all()),
        levers=changes,
        people=people,
        false_alarms=own,
        pilot_vpp=pilot_levels_vpp(study.changed(simulation=people_for_burst(study)), fingers),
        seed=seed,
        plan_sha256=hashlib.sha256(plan.encode()).hexdigest(),
    )


def _points(
    study: Study,
    goal: Goal,
    trials_per_side: tuple[int, int] | None,
    blanks: tuple[int, int] | None,
    *,
    placed: bool,
) -> list[Point]:
    """Return the designs that are tried, but for the number of people."""
    design = study.design
    levels = LEVELS_PLACED if placed else len(design.levels_vpp)
    whole = levels if design.order == "balanced" or trials_per_side else 1
    most_blanks = design.blank_trials if blanks is None else blanks[1]
    if most_blanks and "none" not in design.responses:
        raise ValueError("--blanks needs the answer none in design.responses; got a forced choice")
    require_goal(study, goal, most_blanks, placed=placed)
    return [
        Point(participants=1, trials_per_side=trials, blanks=blank, placed=placed)
        for trials in _ladder(trials_per_side or (design.trials_per_side,) * 2, whole)
        for blank in _ladder(blanks or (design.blank_trials,) * 2, 1)
    ]


def _ladder(ends: tuple[int, int], whole: int) -> list[int]:
    """Return numbers from one to another, evenly on the logarithm, multiples of some number.

    >>> _ladder((75, 75), 5), _ladder((10, 80), 5), _ladder((0, 0), 1)
    ([75], [10, 20, 40, 80], [0])
    """
    least, most = ends
    if least == most:
        return [whole * -(-least // whole)]
    rungs = np.geomspace(max(least, 1), most, _RUNGS)
    return sorted({whole * max(1, round(rung / whole)) for rung in rungs.tolist()})


def require_goal(study: Study, goal: Goal, blanks: int, *, placed: bool) -> None:
    """Refuse a goal that the study's design cannot have."""
    design = study.design
    if goal.kind == "difference" and len(study.conditions) == 1:
        raise ValueError(
            "goal difference needs two conditions, [[condition]] twice in the study; got "
            f"{study.conditions[0].name} alone"
        )
    if goal.kind == "detection" and goal.level_vpp not in design.levels_vpp:
        levels = " ".join(f"{level:g}" for level in design.levels_vpp)
        raise ValueError(
            f"goal detection must be at one of design.levels_vpp, {levels} V; got "
            f"{goal.level_vpp:g} V"
        )
    if goal.kind == "detection" and placed:
        raise ValueError("goal detection needs --levels fixed: placed ones differ between people")
    if goal.kind == "false-alarms" and not blanks:
        raise ValueError(
            "goal false-alarms needs design.blank_trials > 0, or --blanks LEAST MOST; got 0"
        )
    if goal.kind in {"half-width", "difference"} and len(design.levels_vpp) == 1 and not placed:
        raise ValueError(f"goal {goal.kind} needs two levels or more in design.levels_vpp; got 1")
