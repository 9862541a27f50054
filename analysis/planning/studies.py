"""Simulated studies, in chunks that any process can compute by itself.

Person i of study s has a generator of its own, spawned from the root seed by (s, i). Designs of one
study have the same people (common random numbers), and no number depends on which process draws it,
or with which others.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.planning.goals import Goal, Outcome, evaluate
from analysis.planning.levels import LevelsError, placed_levels
from analysis.planning.people import truth_of
from analysis.planning.sessions import Session, draw_counts
from experiment.perception.gains import GAINS
from experiment.study.design import MIN_LEVEL_VPP
from experiment.study.files import study_from_canonical
from experiment.study.simulation import Simulation
from experiment.study.threshold import people_for_burst, threshold_vpp

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.thresholds.likelihood import Tables
    from experiment.perception.gains import ConditionGains, FingerGains
    from experiment.study.design import Design
    from experiment.study.study import Study


_PILOT_LEVELS: Final = 10
_PILOT_RANGE: Final = 10.0
"""A pilot's levels lie evenly on the logarithm, from the highest down to a tenth of it ..."""
_PILOT_MARGIN_DB: Final = 3.0
"""... or, if that is lower, to this far below a threshold two SD below the median."""
PILOT_PER_SITE: Final = 20
_PILOT_BLANKS: Final = 12
_STRIDE: Final = 1009
"""From the first study of a number of participants to that of the next; a prime, so that draws of
a pilot, which take turns, differ between numbers."""


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class Point:
    """A design: participants, trials of each side, blanks, whether levels are placed."""

    participants: int
    trials_per_side: int
    blanks: int
    placed: bool = False

    def at(self, participants: int) -> Point:
        """Return the design with another number of participants."""
        return replace(self, participants=participants)


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """Some studies of one design: all that a process needs, as plain values.

    `plan` is from `plan_text`.
    """

    plan: str
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
    """Return what all chunks share, as JSON; `draws` of the population take turns."""
    study = study.changed(simulation=people_for_burst(study))
    values = {"study": study.canonical, "gains": [asdict(each) for each in gains]}
    return json.dumps(values | {"goal": asdict(goal), "draws": list(draws)})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """What all studies share; populations take turns, with the truth about the goal in each."""

    study: Study
    gains: FingerGains
    goal: Goal
    populations: tuple[Simulation, ...]
    truths: tuple[float, ...]


@lru_cache(maxsize=4)
def read_plan(text: str) -> Plan:
    """Read what `plan_text` returned."""
    values = json.loads(text)
    study, goal = study_from_canonical(values["study"]), Goal(**values["goal"])
    gains = GAINS.validate_python(values["gains"][0]).at_fingers(study.task.sites)
    keys = json.loads(study.canonical)["simulation"] | {"threshold_um": None}
    populations = tuple(Simulation(**(keys | draw)) for draw in values["draws"])
    populations = populations or (study.simulation,)
    truths = tuple(truth_of(goal, population, study, gains) for population in populations)
    return Plan(study=study, gains=gains, goal=goal, populations=populations, truths=truths)


def simulate(chunk: Chunk) -> list[Outcome]:
    """Return the outcomes of the studies of a chunk."""
    plan = read_plan(chunk.plan)
    design = design_of(plan.study.design, chunk.point)
    if plan.goal.kind == "false-alarms":  # single stimuli say nothing about them
        design = design.changed(levels_vpp=design.levels_vpp[:1])
    first = chunk.first + _STRIDE * chunk.point.participants
    return [
        _simulate_study(plan, design, chunk.point, (chunk.seed, study))
        for study in range(first, first + chunk.number)
    ]


def _simulate_study(plan: Plan, design: Design, point: Point, seeds: tuple[int, int]) -> Outcome:
    seed, study = seeds
    sessions = [_session(plan, design, seed, study, i) for i in range(point.participants)]
    if point.placed:
        sessions = _place_levels(plan, sessions)
    counts = draw_counts(sessions, plan.gains, plan.study.task, plan.study.levels)
    outcome = evaluate(plan.goal, counts, plan.truths[study % len(plan.truths)])
    is_unplaced = [any(each is design for each in session.designs) for session in sessions]
    return outcome._replace(unplaced=sum(is_unplaced) if point.placed else 0)


def pilot_levels_vpp(study: Study, gains: FingerGains) -> tuple[float, ...]:
    """Return the levels of a simulated pilot, from the highest down to below most thresholds."""
    (highest_vpp, _), people = study.device.highest, study.simulation
    below_db = 2 * people.threshold_sd_db + _PILOT_MARGIN_DB
    lowest_vpp = min(
        highest_vpp / _PILOT_RANGE, threshold_vpp(people, gains) * 10 ** (-below_db / 20)
    )
    levels_vpp = np.geomspace(max(lowest_vpp, MIN_LEVEL_VPP), highest_vpp, _PILOT_LEVELS)
    rounded = np.minimum(np.round(levels_vpp, 1), highest_vpp)  # 118.78 V are not 118.8
    return tuple(rounded.tolist())


def design_of(design: Design, point: Point) -> Design:
    """Return the design of a point."""
    is_even = point.trials_per_side % len(design.levels_vpp) == 0
    return design.changed(
        trials_per_side=point.trials_per_side,
        blank_trials=point.blanks,
        order=design.order if is_even else "random",
    )


def _session(plan: Plan, design: Design, seed: int, study: int, i: int) -> Session:
    """Draw a participant, in the conditions that the goal depends on."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(study, i)))
    population = plan.populations[study % len(plan.populations)]
    person = population.draw(plan.study.site_distance_mm, rng)
    shifts_db = [0.0]
    if plan.goal.kind == "difference":  # the mean is the goal's, whatever the study states
        deviation_db = person.difference_db - population.median.difference_db
        shifts_db.append(deviation_db + plan.goal.size)
    designs = (design,) * len(shifts_db)
    return Session(person=person, designs=designs, rng=rng, shifts_db=tuple(shifts_db))


def _place_levels(plan: Plan, sessions: Sequence[Session]) -> list[Session]:
    """Place levels after a pilot, as `tactstrip levels` does; where it cannot, the study's remain.

    The pilot has 20 stimuli at each site, and 12 blanks where they can be answered, in each
    condition, which gets levels of its own.
    """
    design, task = sessions[0].designs[0], plan.study.task
    pilot = design.changed(
        levels_vpp=pilot_levels_vpp(plan.study, plan.gains),
        trials_per_side=PILOT_PER_SITE,
        blank_trials=_PILOT_BLANKS if task.nothing in design.responses else 0,
        order="balanced",
        break_every=0,
    )
    conditions = len(sessions[0].designs)
    pilots = [replace(session, designs=(pilot,) * conditions) for session in sessions]
    designs = [
        [_placed_design(plan, design, counts.tables.at([i])) for i in range(len(sessions))]
        for counts in draw_counts(pilots, plan.gains, task)
    ]
    return [
        replace(session, designs=placed)
        for session, placed in zip(sessions, zip(*designs, strict=True), strict=True)
    ]


def _placed_design(plan: Plan, design: Design, pilot: Tables) -> Design:
    try:
        levels_vpp = placed_levels(pilot, *plan.study.device.highest)
    except LevelsError:
        return design
    order = "random" if design.trials_per_side % len(levels_vpp) else plan.study.design.order
    return design.changed(levels_vpp=levels_vpp, order=order)
