"""What a trial costs beside the participant's time: engine alone, and a whole simulated session."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from experiment.draw import draw_plan
from experiment.engine import step, upcoming
from experiment.felt_gains import study_gains
from experiment.simulate import simulate_study
from experiment.steps import Armed, Continued, Elapsed, Fired, Key, Phase, State, Task
from experiment.study import paper_study

if TYPE_CHECKING:
    from experiment.gains import ConditionGains
    from experiment.plan import Plan

REPEATS = 20


def _engine_s(plan: Plan) -> float:
    """Return the time per trial of the engine alone, from the cue to the answer."""
    answers = {
        Phase.WELCOME: Continued(),
        Phase.INTRODUCTION: Continued(),
        Phase.FOREPERIOD: Elapsed(),
        Phase.ARMING: Armed(),
        Phase.FIRING: Fired(),
        Phase.ANSWER: Key("left", 0.5),
        Phase.BREAK: Continued(),
    }
    state = State(
        pending=tuple(Task(trial, 1) for trial in plan.trials),
        keep_anticipated=False,
        response_window_s=plan.response_window_s,
    )
    start = time.perf_counter()
    while state.phase is not Phase.FINISHED:
        event = upcoming(state) if state.phase is Phase.READY else answers[state.phase]
        state, _ = step(state, event)
    return (time.perf_counter() - start) / len(plan.trials)


def _session_s(trials: int, gains: tuple[ConditionGains, ...]) -> float:
    """Return the time per trial of a simulated session with journal and mock device, no fsync."""
    with tempfile.TemporaryDirectory() as name:
        start = time.perf_counter()
        for _ in simulate_study(paper_study(), Path(name), participants=1, seed=1, gains=gains):
            pass
        return (time.perf_counter() - start) / trials


def section() -> str:
    """Measure and return the section of docs/benchmarks.md."""
    plan = draw_plan(paper_study(), participant="01", session="01", seed=1)
    trials = len(plan.trials)
    engine_s = median(_engine_s(plan) for _ in range(REPEATS))
    gains = study_gains(paper_study())
    session_s = median(_session_s(trials, gains) for _ in range(REPEATS))
    return "\n".join(
        [
            "## Trial",
            "",
            (
                f"Median of {REPEATS} sessions of the paper's {trials} trials, per trial, "
                "without fsync."
            ),
            "",
            "| what | time |",
            "|---|---|",
            f"| trial engine alone | {engine_s * 1e6:.0f} us |",
            (
                "| whole simulated session: plan, engine, mock device, observer, journal, "
                f"trials.csv | {session_s * 1e6:.0f} us |"
            ),
            "",
        ]
    )
