"""Trials with the fingers off the plate: planned beside the others, never instead of them."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiment import draw_plan, read_study, replay
from experiment.trial.plan import HANDS_OFF_BLOCK, PRACTICE_BLOCK, Trial, plan_from_json
from tests.plates import on_paper_plate

if TYPE_CHECKING:
    from experiment import Plan
    from tests.conftest import Rows, Run, Simulate

HANN = '[burst]\nwindow = "hann"\n'
OFF_PLATE = "hands_off_trials_before = 6\nhands_off_trials_after = 10\n"
SIXTEEN = f"[design]\n{OFF_PLATE}"
TWO_CONDITIONS = (
    '[[condition]]\nname = "a"\n[[condition]]\nname = "b"\ncycles = 2\n'
    '[design]\npractice_trials = 3\norder = "balanced"\nblank_trials = 7\n'
    'responses = ["left", "right", "both", "none"]\n'
)


def draw(text: str, seed: int = 1) -> Plan:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "s.toml"
        path.write_text(on_paper_plate(text), encoding="utf-8")
        return draw_plan(read_study(path), participant="01", session="01", seed=seed)


def digest(plan: Plan) -> str:
    words = (
        f"{t.number} {t.block} {t.condition} {t.kind} {t.side} {t.level_vpp} {t.foreperiod_s}"
        for t in (*plan.trials, *plan.warm_up)
    )
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]


def hands_off_of(plan: Plan) -> list[Trial]:
    return [t for t in plan.trials if t.kind == "hands_off"]


def others(plan: Plan) -> list[Trial]:
    return [replace(t, number=0) for t in plan.trials if t.kind != "hands_off"]


def test_plans_of_studies_without_such_trials_are_those_of_before() -> None:
    # as drawn by the version without hands-off trials
    assert digest(draw("", 7)) == "d358cfaf7d463dc0"
    assert digest(draw(TWO_CONDITIONS, 2**70)) == "5e87e8f6fa29f135"


def test_such_trials_leave_all_others_as_they_are_with_the_same_seed() -> None:
    without = draw(TWO_CONDITIONS)
    with_them = draw(TWO_CONDITIONS + OFF_PLATE)
    assert others(with_them) == others(without)
    assert [t.condition for t in with_them.warm_up] == [t.condition for t in without.warm_up]


@settings(max_examples=15, deadline=None)
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
        f"[design]\nhands_off_trials_before = {audibility}\nhands_off_trials_after = {control}\n"
        f"practice_trials = {practice}\ntrials_per_side = 10\nbreak_every = 8\n",
        seed,
    )
    off = hands_off_of(plan)
    last = max(t.block for t in plan.trials if t.kind != "hands_off") + 1
    assert Counter((t.block, t.side) for t in off) == Counter(
        {
            (block, side): trials // 2
            for block, trials in ((HANDS_OFF_BLOCK, audibility), (last, control))
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


def test_none_is_accepted_with_the_fingers_off_even_where_it_is_not_offered() -> None:
    plan = draw(SIXTEEN)
    hands_off = hands_off_of(plan)[0]
    single = next(t for t in plan.trials if t.kind == "single")
    assert plan.answers_to(single) == ("left", "right", "both")
    assert plan.answers_to(hands_off) == ("left", "right", "both", "none")
    offered = draw(TWO_CONDITIONS)
    assert offered.answers_to(hands_off) == offered.answers_to(single) == offered.responses


@pytest.mark.parametrize(
    ("block", "kind", "side", "named"),
    [
        (HANDS_OFF_BLOCK, "single", "left", "single .*-1"),
        (-2, "hands_off", "left", "hands_off .*-2"),
        (-2, "single", "left", "single .*-2"),
        (1, "hands_off", "both", "side .*both"),
    ],
)
def test_an_impossible_block_is_refused(block: int, kind: str, side: str, named: str) -> None:
    plan = draw(SIXTEEN)
    trial = replace(plan.trials[0], block=block, kind=kind, side=side)
    with pytest.raises(ValueError, match=named):
        replace(plan, trials=(trial,))


def test_whoever_resumes_begins_with_the_hands_off_trials() -> None:
    plan = draw(f"{SIXTEEN}practice_trials = 2\nlevels_vpp = [50, 60]\nboth_level = 90\n")
    pending = [attempt.trial for attempt in replay(plan, ()).pending]
    assert pending == list(plan.trials)
    assert [t.kind for t in pending[:8]] == ["hands_off"] * 6 + ["practice"] * 2
    assert {t.level_vpp for t in hands_off_of(plan)} == {90.0}  # the highest of all


@pytest.mark.slow
def test_the_check_counts_them_apart_and_their_time(tmp_path: Path, run: Run) -> None:
    reports = []
    for text in (HANN, HANN + SIXTEEN):
        (tmp_path / "study.toml").write_text(on_paper_plate(text))
        reports.append(json.loads(run("check", tmp_path / "study.toml", "--json").stdout))
    before, report = reports
    assert (before["hands_off_trials_before"], before["hands_off_trials_after"]) == (0, 0)
    assert (report["hands_off_trials_before"], report["hands_off_trials_after"]) == (6, 10)
    assert (report["trials"], report["blocks"]) == (before["trials"], before["blocks"])
    # 16 trials of 1.4 s until the stimulus and 1 s for the answer, one more break of 15 s
    assert report["duration_s"] - before["duration_s"] == pytest.approx(16 * 2.4 + 15)


def test_a_simulated_participant_feels_nothing_with_the_fingers_off(
    tmp_path: Path, simulate: Simulate, rows_of: Rows
) -> None:
    sure = "[simulation]\nthreshold_vpp = 58\nfalse_alarm_rate = 0\nlapse_rate = 0\n"
    results = simulate(tmp_path / "results", study=f"{HANN}[design]\n{OFF_PLATE}{sure}")
    answers = {(row["kind"], row["side"], row["response"]) for row in rows_of(results)}
    assert {answer for answer in answers if answer[0] == "hands_off"} == {
        ("hands_off", "left", "none"),
        ("hands_off", "right", "none"),
    }
    assert ("single", "left", "left") in answers
