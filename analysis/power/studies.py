"""Simulated studies, in chunks that any process can work through by itself.

Person i of study s has a generator of its own, spawned from the root seed by (s, i): a study of
more people has the people of a smaller one (common random numbers), and no number depends on which
process draws it, or with which others.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.power.counts import Presented, draw_counts
from analysis.power.goals import Goal, judged
from analysis.power.population import threshold_vpp
from experiment.study.read import study_from_canonical
from experiment.terms.gains import gains_from_json

if TYPE_CHECKING:
    from analysis.power.counts import Counts
    from experiment.study.study import Study
    from experiment.terms.gains import ConditionGains, FingerGains


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

    study: str
    """Canonical JSON."""
    gains: str
    """Its gain matrices, JSON."""
    goal: str
    """JSON of `Goal`."""
    point: Point
    first: int
    number: int
    seed: int


def gains_text(gains: tuple[ConditionGains, ...]) -> str:
    """Return gain matrices as `Chunk` has them."""
    return json.dumps([asdict(one) for one in gains])


def simulate(chunk: Chunk) -> dict[str, Any]:
    """Return whether each study of a chunk reached its goal, its number, and its coverage."""
    study, gains = _read(chunk.study, chunk.gains)
    goal = Goal(**json.loads(chunk.goal))
    outcomes = [
        _outcome(study, gains, goal, chunk.point, (chunk.seed, number))
        for number in range(chunk.first, chunk.first + chunk.number)
    ]
    return {
        "reached": [int(one.reached) for one in outcomes],
        "number": [one.number if math.isfinite(one.number) else None for one in outcomes],
        "covered": [int(one.covered) for one in outcomes],
    }


@lru_cache(maxsize=4)
def _read(study: str, gains: str) -> tuple[Study, tuple[FingerGains, ...]]:
    matrices = tuple(gains_from_json(one).fingers() for one in json.loads(gains))
    return study_from_canonical(study), matrices


def _outcome(
    study: Study,
    gains: tuple[FingerGains, ...],
    goal: Goal,
    point: Point,
    seeds: tuple[int, int],
) -> Any:
    people = [_person(study, gains, goal, point, (*seeds, i)) for i in range(point.participants)]
    by_condition = list(zip(*people, strict=True))
    return judged(goal, by_condition, _truth(study, gains[0], goal))


def _person(
    study: Study,
    gains: tuple[FingerGains, ...],
    goal: Goal,
    point: Point,
    seeds: tuple[int, int, int],
) -> list[Counts]:
    """Draw a person and their counts, in the conditions that the goal asks about."""
    root, number, i = seeds
    rng = np.random.default_rng(np.random.SeedSequence(root, spawn_key=(number, i)))
    left, right = study.actuators[:2]
    apart_mm = math.hypot(left.x_mm - right.x_mm, (left.y_m - right.y_m) * 1e3)
    person = study.simulation.draw(apart_mm, rng)
    shown = Presented.of(study.design, trials_per_side=point.trials_per_side, blanks=point.blanks)
    return [
        draw_counts(person, shown, gains[0], rng, shift_db=shift_db)
        for shift_db in ((0.0, goal.size) if goal.kind == "difference" else (0.0,))
    ]


def _truth(study: Study, gains: FingerGains, goal: Goal) -> float:
    if goal.kind == "half-width":
        return math.log10(threshold_vpp(study.simulation.median, gains))
    if goal.kind == "difference":
        return goal.size
    return math.nan
