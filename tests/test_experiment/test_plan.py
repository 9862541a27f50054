"""Plans: what is drawn, what is exact, and that nobody changes a sealed one unseen."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from experiment.archive.files import ArchiveError, check_identifier
from experiment.study.read import study_from_text
from experiment.trial.draw import block_count, block_lengths, draw_plan
from experiment.trial.plan import PlanError, plan_from_json, verify

if TYPE_CHECKING:
    from experiment.trial.plan import Plan


BALANCED = '[design]\norder = "balanced"'


def draw(text: str = "", seed: int = 1) -> Plan:
    """Draw a plan of a study, the paper's if nothing else is said."""
    study = study_from_text(text, "study.toml")
    return draw_plan(study, participant="01", session="01", seed=seed)


def test_the_papers_plan_has_75_single_trials_a_side_and_5_both_finger_trials() -> None:
    plan = draw()
    assert Counter((t.kind, t.side) for t in plan.trials) == {
        ("single", "left"): 75,
        ("single", "right"): 75,
        ("both", "both"): 5,
    }
    assert {t.level_vpp for t in plan.trials} == {60.0, 95.0, 130.0, 165.0, 200.0}
    assert [t.number for t in plan.trials] == list(range(1, 156))


def test_same_seed_gives_the_same_plan_and_another_seed_another() -> None:
    assert draw("", 7) == draw("", 7)
    assert draw("", 7).trials != draw("", 8).trials
    plan = json.loads(draw("", 7).to_json())
    assert plan["seed"] == 7
    assert plan["generator"].startswith("PCG64 of numpy ")


@pytest.mark.parametrize("name", ["Jane Doe", "", "all", "COM1", "é", "x" * 33, 1])
@pytest.mark.parametrize("what", ["participant", "session"])
def test_a_name_that_no_folder_can_have_is_refused_as_by_the_archive(what: str, name: str) -> None:
    names: dict[str, Any] = {"participant": "01", "session": "01", what: name}
    with pytest.raises(PlanError) as refused:
        draw_plan(study_from_text("", "study.toml"), seed=1, **names)
    with pytest.raises(ArchiveError) as by_archive:
        check_identifier(what, name)
    assert str(refused.value) == str(by_archive.value)
    assert f"{what} must be 1 to 32 letters" in str(refused.value)


def test_warm_up_is_one_easy_trial_a_side_after_the_longest_wait() -> None:
    plan = draw("[design]\nlevels_vpp = [80, 160]\ntrials_per_side = 2\nforeperiod_s = [0.5, 2.5]")
    assert [
        (t.number, t.block, t.condition, t.kind, t.side, t.level_vpp, t.foreperiod_s)
        for t in plan.warm_up
    ] == [
        (len(plan.trials) + 1, 0, "main", "practice", "left", 160.0, 2.5),
        (len(plan.trials) + 2, 0, "main", "practice", "right", 160.0, 2.5),
    ]


@pytest.mark.slow
def test_random_levels_scatter_like_independent_draws() -> None:
    counts = [
        Counter(t.level_vpp for t in draw("", seed).trials if t.kind == "single")[60.0]
        for seed in range(200)
    ]
    mean = sum(counts) / len(counts)
    variance = sum((c - mean) ** 2 for c in counts) / (len(counts) - 1)
    assert mean == pytest.approx(30, abs=4 * (24 / 200) ** 0.5)
    assert variance == pytest.approx(24, rel=0.45)


def test_balanced_blocks_hold_every_stimulus_equally_often() -> None:
    plan = draw(BALANCED)
    blocks = {trial.block for trial in plan.trials}
    assert blocks == {1, 2, 3, 4, 5}
    for block in blocks:
        cells = Counter((t.kind, t.side, t.level_vpp) for t in plan.trials if t.block == block)
        singles = {cell: n for cell, n in cells.items() if cell[0] == "single"}
        assert set(singles.values()) == {3}
        assert len(singles) == 10
        assert sum(n for cell, n in cells.items() if cell[0] == "both") == 1


@pytest.mark.slow
def test_the_sides_of_a_balanced_order_cannot_be_guessed_from_the_last_one() -> None:
    same = total = 0
    for seed in range(100):
        sides = [t.side for t in draw(BALANCED, seed).trials if t.kind == "single"]
        same += sum(a == b for a, b in itertools.pairwise(sides))
        total += len(sides) - 1
    assert same / total == pytest.approx(0.5, abs=0.03)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    levels=st.integers(1, 6),
    repeats=st.integers(1, 6),
    both=st.integers(0, 7),
    blanks=st.integers(0, 7),
    break_every=st.integers(0, 60),
    order=st.sampled_from(["random", "balanced"]),
    seed=st.integers(0, 2**40),
)
@example(levels=2, repeats=4, both=0, blanks=0, break_every=6, order="balanced", seed=1)
def test_every_plan_has_the_asked_counts_in_blocks_no_longer_than_asked(
    levels: int, repeats: int, both: int, blanks: int, break_every: int, order: str, seed: int
) -> None:
    text = (
        f"[design]\nlevels_vpp = {[10 * (i + 1) for i in range(levels)]}\n"
        f"trials_per_side = {levels * repeats}\nboth_trials = {both}\nblank_trials = {blanks}\n"
        f'responses = ["left", "right", "both", "none"]\norder = "{order}"\n'
        f"break_every = {break_every}\n"
    )
    design = study_from_text(text, "study.toml").design
    try:
        plan = draw(text, seed)
    except PlanError as error:
        assert order == "balanced"
        assert "break_every must be 0 or at least" in str(error)  # noqa: PT017 - some draws do plan
        return
    kinds = Counter(trial.kind for trial in plan.trials)
    assert kinds["single"] == 2 * levels * repeats
    assert (kinds["both"], kinds["blank"]) == (both, blanks)
    lengths = Counter(trial.block for trial in plan.trials)
    assert len(lengths) == block_count(design)
    assert tuple(lengths[block] for block in sorted(lengths)) == block_lengths(design)
    assert max(lengths.values()) <= (break_every or len(plan.trials))
    least_s, most_s = design.foreperiod_s
    assert all(least_s <= trial.foreperiod_s <= most_s for trial in plan.trials)
    assert plan_from_json(plan.to_json()) == plan


def test_foreperiods_are_exponential_and_cut_at_both_ends() -> None:
    plan = draw("[design]\nforeperiod_s = [1.0, 3.0]\ntrials_per_side = 2000")
    waits = [trial.foreperiod_s for trial in plan.trials]
    # Mean of an exponential of scale 1 cut at 2: 1 - 2 / (e^2 - 1).
    assert sum(waits) / len(waits) == pytest.approx(1 + 1 - 2 / (2.718281828**2 - 1), abs=0.03)
    assert max(waits) > 2.8


def test_practice_stands_first_on_both_sides_at_the_highest_level() -> None:
    plan = draw("[design]\npractice_trials = 4")
    practice = plan.trials[:4]
    assert Counter(t.side for t in practice) == {"left": 2, "right": 2}
    assert {(t.kind, t.block, t.level_vpp) for t in practice} == {("practice", 0, 200.0)}


def test_blank_trials_have_no_level() -> None:
    plan = draw('[design]\nblank_trials = 3\nresponses = ["left", "right", "both", "none"]')
    blanks = [t for t in plan.trials if t.kind == "blank"]
    assert [(t.side, t.level_vpp) for t in blanks] == [("none", None)] * 3


def test_every_condition_runs_the_whole_design_in_blocks_of_its_own() -> None:
    text = (
        '[[condition]]\nname = "a"\n[[condition]]\nname = "b"\ncycles = 2\n'
        "[design]\ntrials_per_side = 5\nboth_trials = 1\nbreak_every = 6\n"
    )
    plan = draw(text)
    assert Counter(t.condition for t in plan.trials) == {"a": 11, "b": 11}
    of_block = {t.block: t.condition for t in plan.trials}
    assert len(of_block) == 4
    assert all(of_block[t.block] == t.condition for t in plan.trials)
    first = {draw(text, seed).trials[0].condition for seed in range(20)}
    assert first == {"a", "b"}


def test_a_fixed_level_of_both_finger_trials_is_kept() -> None:
    plan = draw("[design]\nboth_level = 110")
    assert {t.level_vpp for t in plan.trials if t.kind == "both"} == {110.0}


def test_a_changed_plan_is_refused() -> None:
    plan = draw()
    changed = json.loads(plan.to_json())
    changed["trials"][3]["level_vpp"] = 61.0
    with pytest.raises(PlanError, match="changed after it was sealed"):
        plan_from_json(json.dumps(changed))
    with pytest.raises(PlanError, match="sha256"):
        plan_from_json(json.dumps(json.loads(plan.to_json()) | {"sha256": None}))
    with pytest.raises(PlanError, match="sha256"):
        verify(replace(plan, seed=2))


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"schema": 3}', '{"schema": 2}', "nonsense", "[" * 100_000]
)
def test_what_is_no_plan_is_refused(text: str) -> None:
    with pytest.raises(PlanError):
        plan_from_json(text)


@pytest.mark.parametrize("seed", [-1, 1.0, True, None])
def test_a_seed_that_is_no_whole_number_is_refused(seed: int) -> None:
    with pytest.raises(PlanError, match="seed must be a whole number >= 0"):
        draw("", seed)


def test_a_plan_with_a_number_that_json_has_not_is_named_as_no_plan() -> None:
    changed = json.loads(draw().to_json())
    changed["trials"][0]["foreperiod_s"] = float("nan")
    with pytest.raises(PlanError, match="not a plan of this program: Out of range float"):
        plan_from_json(json.dumps(changed))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"kind": "catch"}, "kind must be one of .*; got 'catch'"),
        ({"side": "up"}, "side must be one of .*; got 'up'"),
        ({"level_vpp": None}, "a single trial cannot have level_vpp = None"),
        ({"kind": "blank"}, "a blank trial cannot have level_vpp = 60.0"),
        ({"kind": "control", "side": "none"}, "a control trial's side must be left or right"),
    ],
)
def test_a_trial_that_no_plan_can_hold_is_refused(change: dict[str, object], said: str) -> None:
    trial = draw().trials[0]
    with pytest.raises(PlanError, match=said):
        replace(replace(trial, level_vpp=60.0), **change)  # type: ignore[arg-type]  # as a file might


def test_a_break_before_a_balanced_block_can_end_is_refused_with_the_shortest_one() -> None:
    text = '[design]\norder = "balanced"\nlevels_vpp = [60, 100]\ntrials_per_side = 6\n'
    least = 6  # 2 sides, 2 levels, and of the 5 both-finger trials up to 2 in each of 3 blocks
    assert draw(f"{text}break_every = {least}\n").trials[-1].block == 3
    with pytest.raises(PlanError, match=f"0 or at least {least} .*; got {least - 1}"):
        draw(f"{text}break_every = {least - 1}\n")
