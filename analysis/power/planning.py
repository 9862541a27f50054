"""From a study and a goal to a promise: what is tried, in which order."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.power.levers import levers, thumb
from analysis.power.population import truth_of
from analysis.power.promise import Promise
from analysis.power.search import PROBE, Answer, Trials, answers, smallest
from analysis.power.so_far import Ahead, SoFar, slower
from analysis.power.studies import Point, pilot_levels_vpp, plan_text
from analysis.workers.crew import StoppedError
from experiment.study.physics import study_gains
from experiment.study.threshold import people_for_burst

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analysis.power.goals import Goal
    from analysis.power.levers import Lever
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
    step: Callable[[float, float, Callable[[], str]], object],
    stopped: Callable[[Promise], object] = lambda _: None,
) -> Promise:
    """Return how many people, from one number to another, reach a goal as often as is asked for.

    Before the search starts `predicted` is told about how much processor time it takes, in s, the
    least and the most by where the answer may lie; `step` then how much more work is done and
    about how much is ahead, with what tells the answer that is known so far, in words. `stopped`
    is given what is known where Ctrl-C, or the loss of all workers, ends it.
    """
    study, in_volts = people.study, people.unit == "V"
    if placed and not in_volts:
        raise ValueError(
            "--levels placed needs levels in V, as pilots go up to the device's highest; got "
            f"{people.unit}: leave it out"
        )
    points = _points(study, goal, trials_per_side, blanks, placed=placed)
    gains = study_gains(study)
    plan = plan_text(study, gains, goal, people.draws)
    trials = Trials(plan=plan, seed=seed, spread=spread)
    so_far = SoFar(trials=trials, points=points, participants=participants, assurance=assurance)
    levels = LEVELS_PLACED if placed else len(study.design.levels_vpp)
    asks_blanks = goal.kind == "false-alarms"
    fingers = gains[0].fingers()
    own = truth_of(goal, study.simulation, study, fingers) if asks_blanks else None

    def searched(by: Trials) -> tuple[Answer, ...]:
        return answers(by, [smallest(by, point, participants, assurance) for point in points])

    def changed(by: Trials, found: Sequence[Answer]) -> tuple[Lever, ...]:
        first = next((one for one in found if one.participants is not None), found[0])
        if first.participants is not None and participants[0] == participants[1]:
            return ()  # one number was asked about, and is enough
        return levers(by, first, participants, goal.kind, levels, in_volts=in_volts)

    def promise(changes: Sequence[Lever] = (), partial: str = "") -> Promise:
        found = Promise(
            study=study.name,
            goal=goal,
            assurance=assurance,
            participants=participants,
            answers=tuple(so_far.answers),
            tried=tuple(trials.all()),
            levers=tuple(changes),
            people=people,
            of_people=people.words(goal, gains),
            false_alarms=own,
            pilot_vpp=pilot_levels_vpp(study.changed(simulation=people_for_burst(study)), fingers),
            seed=seed,
            plan_sha256=hashlib.sha256(plan.encode()).hexdigest(),
            partial=partial,
            left=so_far.left() if partial else None,
        )
        base = found.base(PROBE)
        return replace(found, thumb=thumb(trials, base, goal, assurance, own)) if base else found

    ahead = Ahead(
        trials=trials,
        points=points,
        participants=participants,
        assurance=assurance,
        kind=goal.kind,
        search=lambda by: changed(by, searched(by)),
    )
    middle = replace(points[0], participants=round(math.sqrt(math.prod(participants))))
    speed = slower(trials, middle)
    least, most = ahead.between()
    predicted(least * speed, most * speed)
    left = most

    def begun() -> None:
        nonlocal left
        left = ahead.work()

    def done(part: float) -> None:
        nonlocal left
        left = max(0.0, left - part)
        step(part, left, so_far.words)

    trials.begun, trials.step = begun, done
    try:
        so_far.answers = searched(trials)
        # What is ahead is now what other designs take, by the answers that were found.
        ahead.search = lambda by: changed(by, so_far.answers)
        return promise(changed(trials, so_far.answers))
    except (KeyboardInterrupt, StoppedError):
        stopped(promise(partial=so_far.words() or "nothing is ruled out yet"))
        raise


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
            "goal false-alarms needs design.blank_trials > 0, or --blanks MIN MAX; got 0"
        )
    if goal.kind in {"half-width", "difference"} and len(design.levels_vpp) == 1 and not placed:
        raise ValueError(f"goal {goal.kind} needs two levels or more in design.levels_vpp; got 1")
