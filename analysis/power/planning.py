"""From a study and a goal to a promise: what is tried, in which order."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from analysis.power.population import require_spread, stated_people
from analysis.power.promise import Promise
from analysis.power.search import Trials, smallest
from analysis.power.studies import Chunk, Point, gains_text
from experiment.study.physics import study_gains

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analysis.power.goals import Goal
    from analysis.power.search import Spread
    from experiment.study.study import Study


def one_after_another(
    function: Callable[[Chunk], dict[str, Any]], chunks: list[Chunk]
) -> Iterator[tuple[Chunk, dict[str, Any]]]:
    """Work through chunks in this process."""
    for chunk in chunks:
        yield chunk, function(chunk)


def plan_study(
    study: Study,
    goal: Goal,
    *,
    participants: tuple[int, int],
    assurance: float,
    seed: int,
    spread: Spread = one_after_another,
) -> Promise:
    """Return how many people, from one number to another, reach a goal as often as is asked for."""
    require_spread(study)
    require_goal(study, goal)
    trials = Trials(
        study=study.canonical,
        gains=gains_text(study_gains(study)),
        goal=json.dumps(asdict(goal)),
        seed=seed,
        spread=spread,
    )
    design = study.design

    def at(number: int) -> Point:
        return Point(
            participants=number,
            trials_per_side=design.trials_per_side,
            blanks=design.blank_trials,
        )

    answer = smallest(trials, at, participants, assurance)
    return Promise(
        study=study.name,
        goal=goal,
        assurance=assurance,
        participants=participants,
        answers=(answer,),
        tried=tuple(trials.all()),
        people=stated_people(study),
        seed=seed,
    )


def require_goal(study: Study, goal: Goal) -> None:
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
    if goal.kind == "false-alarms" and not design.blank_trials:
        raise ValueError("goal false-alarms needs design.blank_trials > 0; got 0")
    if goal.kind == "half-width" and len(design.levels_vpp) == 1:
        raise ValueError("goal half-width needs two levels or more in design.levels_vpp; got 1")
