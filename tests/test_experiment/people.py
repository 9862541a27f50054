"""Simulated participants: made from the keys of [simulation], and asked as in a session."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from device import VirtualClock
from experiment import AwaitedAnswer, ConditionGains, paper_study
from experiment.perception.gains import without_crosstalk
from experiment.perception.population import threshold_course_db
from experiment.session.simulate import SimulatedResponder

if TYPE_CHECKING:
    from experiment.perception.gains import FingerGains
    from experiment.perception.observer import Observer
    from experiment.study.simulation import Simulation


def population(**keys: Any) -> Simulation:
    """Return the simulated participants of a section [simulation] with these keys."""
    return paper_study().changed(simulation=keys).simulation


def finger_gains(
    left: tuple[float, float], right: tuple[float, float], basis: Any = "measured"
) -> FingerGains:
    """Return what the two fingers get, in micrometres per volt if the basis is known."""
    return ConditionGains(
        condition="main",
        actuators=("left", "right"),
        bases=(basis, basis),
        per_vpp=(left, right),
    ).at_fingers(("left", "right"))


def course_db(person: Observer, trials: int, seed: int) -> list[float]:
    """Return how a participant's threshold moves over a session in blocks of 150 trials."""
    blocks = [trial // 150 for trial in range(trials)]
    return list(threshold_course_db(person, blocks, np.random.default_rng((seed, 1))))


def in_session(person: Observer, trials: int, seed: int) -> SimulatedResponder:
    """Seat a participant in a session."""
    shifts_db = course_db(person, trials, seed)
    return SimulatedResponder(
        person,
        VirtualClock(),
        seed=seed,
        gains=dict.fromkeys(range(trials), without_crosstalk(2)),
        shifts_db={trial: (shift_db,) * 2 for trial, shift_db in enumerate(shifts_db)},
    )


def ask(
    responder: SimulatedResponder,
    trial: int,
    levels_vpp: tuple[float, float],
    offered: Any,
    window_s: float = 60.0,
) -> Any:
    """Present a trial at two levels and return the press."""
    question = AwaitedAnswer(
        trial=trial,
        attempt=1,
        levels_vpp=(levels_vpp,),
        onset_s=0.0,
        window_s=window_s,
        answers=offered,
    )
    return responder.ask(question)
