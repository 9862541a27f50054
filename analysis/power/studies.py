"""Simulated studies, in chunks that any process can work through by itself.

Person i of study s has a generator of its own, spawned from the root seed by (s, i): a study of
more people has the people of a smaller one (common random numbers), and no number depends on which
process draws it, or with which others.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.power.counts import Session, draw_counts
from analysis.power.goals import Goal, judged
from analysis.power.population import truth_of
from analysis.thresholds.levels import LevelsError, pilot_functions, placed
from experiment.perception.gains import gains_from_json
from experiment.study.design import MIN_LEVEL_VPP
from experiment.study.files import study_from_canonical
from experiment.study.simulation import Simulation
from experiment.study.threshold import people_for_burst, threshold_vpp

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.thresholds.levels import PilotFunction
    from experiment.perception.gains import ConditionGains, FingerGains
    from experiment.study.design import Design
    from experiment.study.study import Study


_PILOT_LEVELS: Final = 10
_PILOT_RANGE: Final = 10.0
"""A pilot's levels lie evenly on the logarithm, from the highest down to this part of it."""
_PILOT_BELOW_DB: Final = 3.0
"""They reach so far below the threshold of nearly everybody, two SD below the median, at least."""
_PILOT_PER_SIDE: Final = 20
PILOT_STIMULI: Final = 2 * _PILOT_PER_SIDE
_PILOT_BLANKS: Final = 12


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class Point:
    """A design that is tried: people, trials of each side, blanks, whether levels are placed."""

    participants: int
    trials_per_side: int
    blanks: int
    placed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """Some studies of one point: all that a process needs to know, as plain values."""

    plan: str
    """From `plan_text`."""
    point: Point
    first: int
    number: int
    seed: int


def plan_text(
    study: Study,
    gains: Sequence[ConditionGains],
    goal: Goal,
    draws: Sequence[dict[str, float]] = (),
) -> str:
    """Return what all chunks of a search share, as JSON.

    `draws` are keys of [simulation] that take turns: what a pilot leaves open of the people.
    """
    study = study.changed(simulation=people_for_burst(study))
    return json.dumps(
        {
            "study": study.canonical,
            "gains": [asdict(one) for one in gains],
            "goal": asdict(goal),
            "draws": list(draws),
        }
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Plan:
    study: Study
    gains: FingerGains
    goal: Goal
    populations: tuple[Simulation, ...]
    truths: tuple[float, ...]


@lru_cache(maxsize=4)
def _read(plan: str) -> _Plan:
    told = json.loads(plan)
    study, goal = study_from_canonical(told["study"]), Goal(**told["goal"])
    gains = gains_from_json(told["gains"][0]).fingers()
    keys = json.loads(study.canonical)["simulation"]
    populations: tuple[Simulation, ...] = (study.simulation,)
    if told["draws"]:
        keys |= {"threshold_um": None}
        populations = tuple(Simulation(**(keys | draw)) for draw in told["draws"])
    return _Plan(
        study=study,
        gains=gains,
        goal=goal,
        populations=populations,
        truths=tuple(truth_of(goal, one, study, gains) for one in populations),
    )


def simulate(chunk: Chunk) -> dict[str, Any]:
    """Return whether each study of a chunk reached its goal, its number, and its coverage."""
    plan = _read(chunk.plan)
    design = design_of(plan.study.design, chunk.point)
    if plan.goal.kind == "false-alarms":  # single stimuli tell nothing of them
        design = design.changed(levels_vpp=design.levels_vpp[:1])
    studies = range(chunk.first, chunk.first + chunk.number)
    number = chunk.point.participants
    sessions = [
        _session(plan, design, chunk.seed, study, i) for study in studies for i in range(number)
    ]
    if chunk.point.placed:
        sessions = _with_placed_levels(plan, sessions)
    counts = draw_counts(sessions, plan.gains)
    outcomes = [
        judged(
            plan.goal,
            list(zip(*counts[place * number : (place + 1) * number], strict=True)),
            plan.truths[study % len(plan.truths)],
        )
        for place, study in enumerate(studies)
    ]
    told = {
        "reached": [int(one.reached) for one in outcomes],
        "number": [one.number if math.isfinite(one.number) else None for one in outcomes],
        "covered": [int(one.covered) for one in outcomes],
    }
    if chunk.point.placed:  # people whose pilots placed no levels
        own = [any(one is design for one in session.own) for session in sessions]
        told["unplaced"] = [
            sum(own[place * number : (place + 1) * number]) for place in range(chunk.number)
        ]
    return told


def pilot_levels_vpp(study: Study, gains: FingerGains) -> tuple[float, ...]:
    """Return the levels of a simulated pilot, from the highest down to below most thresholds."""
    (highest_vpp, _), people = study.device.highest, study.simulation
    below_db = 2 * people.threshold_sd_db + _PILOT_BELOW_DB
    least_vpp = min(
        highest_vpp / _PILOT_RANGE, threshold_vpp(people, gains) * 10 ** (-below_db / 20)
    )
    levels_vpp = np.geomspace(max(least_vpp, MIN_LEVEL_VPP), highest_vpp, _PILOT_LEVELS)
    found = np.minimum(np.round(levels_vpp, 1), highest_vpp)  # 118.78 V are not 118.8
    return tuple(found.tolist())


def design_of(design: Design, point: Point) -> Design:
    """Return the design of a point."""
    levels = len(design.levels_vpp)
    return design.changed(
        trials_per_side=point.trials_per_side,
        blank_trials=point.blanks,
        order="random" if point.trials_per_side % levels else design.order,
    )


def _session(plan: _Plan, design: Design, root: int, study: int, i: int) -> Session:
    """Draw a person, in the conditions that the goal asks about."""
    rng = np.random.default_rng(np.random.SeedSequence(root, spawn_key=(study, i)))
    left, right = plan.study.actuators[:2]
    apart_mm = math.hypot(left.x_mm - right.x_mm, (left.y_m - right.y_m) * 1e3)
    population = plan.populations[study % len(plan.populations)]
    person = population.draw(apart_mm, rng)
    shifts_db = [0.0]
    if plan.goal.kind == "difference":  # the mean is the goal's, the study states the rest
        own_db = person.difference_db - population.median.difference_db
        shifts_db.append(own_db + plan.goal.size)
    return Session(person=person, design=design, rng=rng, shifts_db=tuple(shifts_db))


def _with_placed_levels(plan: _Plan, sessions: Sequence[Session]) -> list[Session]:
    """Place levels after a pilot session, as `tactstrip levels` does; where it cannot, the study's.

    The pilot has 40 stimuli, and 12 blanks where they can be answered, in each condition, which
    gets levels of its own.
    """
    design = sessions[0].design
    pilot = design.changed(
        levels_vpp=pilot_levels_vpp(plan.study, plan.gains),
        trials_per_side=_PILOT_PER_SIDE,
        blank_trials=_PILOT_BLANKS if "none" in design.responses else 0,
        order="balanced",
        break_every=0,
    )
    pilots = draw_counts([replace(one, design=pilot) for one in sessions], plan.gains)
    every = [counts for of_person in pilots for counts in of_person]
    levels, detected, shown = (
        np.array([getattr(counts, name) for counts in every], dtype=np.float64)
        for name in ("levels_vpp", "detected", "presented")
    )
    found = pilot_functions(levels, detected, shown, [counts.guess for counts in every])
    designs = [_placed(plan, design, one) for one in found]
    number = len(sessions[0].shifts_db)
    return [
        replace(one, own=tuple(designs[place * number : (place + 1) * number]))
        for place, one in enumerate(sessions)
    ]


def _placed(plan: _Plan, design: Design, pilot: PilotFunction | LevelsError) -> Design:
    if isinstance(pilot, LevelsError):
        return design
    try:
        found = placed(pilot.function, *plan.study.device.highest)
    except LevelsError:
        return design
    order = "random" if design.trials_per_side % len(found) else plan.study.design.order
    return design.changed(levels_vpp=found, order=order)
