"""Trials with the fingers off the plate: planned beside the others, never instead of them."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device.clock import VirtualClock
from experiment.archive.history import replay
from experiment.preview.check import check_study
from experiment.preview.check_report import check_findings
from experiment.session.simulate import simulated_responder
from experiment.study.read import paper_study, study_from_text
from experiment.terms.responder import AwaitedAnswer
from experiment.trial.draw import draw_plan
from experiment.trial.events import Task
from experiment.trial.plan import AUDIBILITY_BLOCK, PRACTICE_BLOCK, PlanError, Trial, plan_from_json

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.study.study import Study
    from experiment.trial.plan import Plan
    from tests.conftest import Run

RELATIVE = """
[[actuator]]
side = "left"
x_mm = -35
diameter_mm = 12.8
[[actuator]]
side = "right"
x_mm = 35
diameter_mm = 12.8
"""
HANN = '[burst]\nwindow = "hann"\n'
OFF_PLATE = "audibility_trials = 6\ncontrol_trials = 10\n"
SIXTEEN = f"[design]\n{OFF_PLATE}"
TWO_CONDITIONS = (
    '[[condition]]\nname = "a"\n[[condition]]\nname = "b"\ncycles = 2\n'
    '[design]\npractice_trials = 3\norder = "balanced"\nblank_trials = 7\n'
    'responses = ["left", "right", "both", "none"]\n'
)


def draw(study: str | Study, seed: int = 1) -> Plan:
    if isinstance(study, str):
        study = study_from_text(study, "s.toml")
    return draw_plan(study, participant="01", session="01", seed=seed)


def digest(plan: Plan) -> str:
    words = (
        f"{t.number} {t.block} {t.condition} {t.kind} {t.side} {t.level_vpp} {t.foreperiod_s}"
        for t in (*plan.trials, *plan.warm_up)
    )
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]


def control_of(plan: Plan) -> list[Trial]:
    return [t for t in plan.trials if t.kind == "control"]


def others(plan: Plan) -> list[Trial]:
    return [replace(t, number=0) for t in plan.trials if t.kind != "control"]


def test_plans_of_studies_without_such_trials_are_those_of_before() -> None:
    # as drawn by the version that knew no control trials
    assert digest(draw(paper_study(), 7)) == "d358cfaf7d463dc0"
    assert digest(draw(TWO_CONDITIONS, 2**70)) == "5e87e8f6fa29f135"


def test_such_trials_leave_all_others_as_they_are_with_the_same_seed() -> None:
    without = draw(TWO_CONDITIONS)
    with_them = draw(TWO_CONDITIONS + OFF_PLATE)
    assert others(with_them) == others(without)
    assert [t.condition for t in with_them.warm_up] == [t.condition for t in without.warm_up]


@settings(max_examples=30, deadline=None)
@given(
    audibility=st.integers(0, 8).map(lambda n: 2 * n),
    control=st.integers(0, 8).map(lambda n: 2 * n),
    practice=st.integers(0, 3),
    seed=st.integers(0, 2**40),
)
def test_both_sides_come_equally_often_at_the_highest_level_in_blocks_of_their_own(
    audibility: int, control: int, practice: int, seed: int
) -> None:
    plan = draw(
        f"[design]\naudibility_trials = {audibility}\ncontrol_trials = {control}\n"
        f"practice_trials = {practice}\ntrials_per_side = 10\nbreak_every = 8\n",
        seed,
    )
    off = control_of(plan)
    last = max(t.block for t in plan.trials if t.kind != "control") + 1
    assert Counter((t.block, t.side) for t in off) == Counter(
        {
            (block, side): trials // 2
            for block, trials in ((AUDIBILITY_BLOCK, audibility), (last, control))
            for side in ("left", "right")
            if trials
        }
    )
    assert {t.level_vpp for t in off} <= {200.0}
    blocks = [t.block for t in plan.trials]
    assert blocks == sorted(blocks)
    assert [t.number for t in plan.trials] == list(range(1, len(plan.trials) + 1))
    assert {t.block for t in plan.trials if t.kind == "practice"} <= {PRACTICE_BLOCK}
    assert plan_from_json(plan.to_json()) == plan


def test_the_sides_are_shuffled_and_another_seed_gives_another_order() -> None:
    plans = [draw(SIXTEEN, seed) for seed in range(20)]
    assert len({tuple(t.side for t in control_of(plan)) for plan in plans}) > 15
    assert draw(SIXTEEN, 3) == plans[3]


def test_every_condition_is_checked_one_after_the_other_in_the_sessions_order() -> None:
    plan = draw(TWO_CONDITIONS + OFF_PLATE)
    order = list(dict.fromkeys(t.condition for t in plan.trials if t.kind == "single"))
    for block, trials in ((AUDIBILITY_BLOCK, 6), (plan.trials[-1].block, 10)):
        conditions = [t.condition for t in plan.trials if t.block == block]
        assert conditions == [name for name in order for _ in range(trials)]


def test_the_highest_level_may_be_that_of_both_fingers() -> None:
    plan = draw(f"{SIXTEEN}levels_vpp = [50, 60]\nboth_level = 90\n")
    assert {t.level_vpp for t in control_of(plan)} == {90.0}


def test_none_is_accepted_with_the_fingers_off_even_where_it_is_not_offered() -> None:
    plan = draw(SIXTEEN)
    control = control_of(plan)[0]
    single = next(t for t in plan.trials if t.kind == "single")
    assert plan.answers_to(single) == ("left", "right", "both")
    assert plan.answers_to(control) == ("left", "right", "both", "none")
    offered = draw(TWO_CONDITIONS)
    assert offered.answers_to(control) == offered.answers_to(single) == offered.responses


@pytest.mark.parametrize(
    ("block", "kind", "side", "said"),
    [
        (AUDIBILITY_BLOCK, "single", "left", "single"),
        (-2, "control", "left", "control"),
        (-2, "single", "left", "single"),
        (1, "control", "both", "'both'"),
    ],
)
def test_an_impossible_block_is_refused(block: int, kind: str, side: str, said: str) -> None:
    trial = draw(SIXTEEN).trials[0]
    with pytest.raises(PlanError, match=said):
        replace(trial, block=block, kind=kind, side=side)


def test_whoever_resumes_begins_with_the_audibility_check() -> None:
    plan = draw(f"{SIXTEEN}practice_trials = 2\n")
    pending = [task.trial for task in replay(plan, ()).pending]
    assert pending == list(plan.trials)
    assert [t.kind for t in pending[:8]] == ["control"] * 6 + ["practice"] * 2


@pytest.mark.slow
def test_the_check_counts_them_apart_and_their_time(
    tmp_path: Path, make_study: Callable[[str], Study], run: Run
) -> None:
    text = HANN + SIXTEEN
    before, check = check_study(make_study(HANN)), check_study(make_study(text))
    assert (check.trials, check.blocks) == (before.trials, before.blocks)
    assert (check.audibility_trials, check.control_trials) == (6, 10)
    # 16 trials of 1.4 s until the stimulus and 1 s for the answer, one more break of 15 s
    assert check.duration_s - before.duration_s == pytest.approx(16 * 2.4 + 15)
    assert "fingers off" not in check_findings(before, "s.toml").text
    report = json.loads(check_findings(check, "s.toml").json)
    assert (report["audibility_trials"], report["control_trials"]) == (6, 10)
    study = tmp_path / "study.toml"
    study.write_text(text)
    done = run("check", study)
    assert done.exit_code == 0
    told = done.stdout
    (line,) = [line for line in told.splitlines() if line.startswith("fingers off")]
    assert line.endswith(
        "6 trials before everything else, is the plate heard; 10 at the end; all at 200 Vpp"
    )
    assert "about 9 min in 5 blocks" in told


def test_trials_with_the_fingers_off_are_told_for_each_of_two_conditions(
    make_study: Callable[[str], Study],
) -> None:
    study = make_study(TWO_CONDITIONS + "audibility_trials = 6\n")
    told = check_findings(check_study(study, gains=()), "s.toml").text
    assert (
        "\nfingers off    12"
    ) in told


def test_a_simulated_participant_feels_nothing_with_the_fingers_off(
    make_study: Callable[[str], Study],
) -> None:
    study = make_study(
        f"{RELATIVE}[design]\n{OFF_PLATE}"
        "[simulation]\nthreshold_vpp = 58\nfalse_alarm_rate = 0\nlapse_rate = 0\n"
    )
    plan = draw(study)
    clock = VirtualClock()
    responder = simulated_responder(study, plan, clock)
    answers = set()
    for trial in plan.trials:
        left_vpp, right_vpp = (200.0 if trial.side == side else 0.0 for side in ("left", "right"))
        question = AwaitedAnswer(
            trial=trial.number,
            attempt=1,
            level_left_vpp=left_vpp,
            level_right_vpp=right_vpp,
            onset_s=clock.now_s(),
            window_s=100.0,
            answers=Task(trial, 1).part.answers(plan.responses),
        )
        press = responder.ask(question)
        assert press is not None
        answers.add((trial.kind, trial.side, press.response))
    felt = {answer for answer in answers if answer[0] != "both"}
    assert felt == {
        ("control", "left", "none"),
        ("control", "right", "none"),
        ("single", "left", "left"),
        ("single", "right", "right"),
    }
