"""Plans: what is drawn, what is exact, and that nobody changes a sealed one unseen."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from click.testing import CliRunner
from hypothesis import example, given, settings
from hypothesis import strategies as st

from experiment import PlanError, draw_plan
from experiment.trial.plan import plan_from_json, verify
from tactstrip import main
from tests.plates import study_from_text
from tests.test_experiment.sessions import Sessions
from tests.test_experiment.studies import facts_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment import Plan, Study
    from tests.conftest import Run


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


def test_warm_up_is_one_easy_trial_a_side_after_the_longest_wait() -> None:
    plan = draw("[design]\nlevels_vpp = [80, 160]\ntrials_per_side = 2\nforeperiod_s = [0.5, 2.5]")
    assert [
        (t.number, t.block, t.condition, t.kind, t.side, t.level_vpp, t.foreperiod_s)
        for t in plan.warm_up
    ] == [
        (len(plan.trials) + 1, 0, "main", "practice", "left", 160.0, 2.5),
        (len(plan.trials) + 2, 0, "main", "practice", "right", 160.0, 2.5),
    ]


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
def test_every_plan_has_the_stated_counts_in_blocks_no_longer_than_stated(
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
        assert "break_every" in str(error)  # noqa: PT017 - some draws do plan
        return
    kinds = Counter(trial.kind for trial in plan.trials)
    assert kinds["single"] == 2 * levels * repeats
    assert (kinds["both"], kinds["blank"]) == (both, blanks)
    lengths = Counter(trial.block for trial in plan.trials)
    facts = facts_of(text, ())
    assert (len(lengths), facts["trials"]) == (facts["blocks"], len(plan.trials))
    assert [lengths[block] for block in sorted(lengths)] == facts["block_trials"]
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


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"kind": "catch"}, "a catch trial"),
        ({"side": "up"}, "side = 'up'"),
        ({"kind": "practice", "level_vpp": None}, "practice .*level_vpp = None"),
        ({"kind": "blank"}, "blank .*side"),
        ({"kind": "blank", "side": "none"}, "blank .*level_vpp = 60.0"),
        ({"kind": "hands_off", "side": "none"}, "hands_off .*side"),
    ],
)
def test_a_trial_that_no_plan_can_hold_is_refused(change: dict[str, object], said: str) -> None:
    plan = draw()
    trial = replace(plan.trials[0], level_vpp=60.0)
    replace(plan, trials=(trial,))
    changed = replace(trial, **change)  # type: ignore[arg-type]  # as a file might
    with pytest.raises(PlanError, match=said):
        replace(plan, trials=(changed,))


def test_practice_blank_and_both_finger_trials_have_the_levels_of_the_design() -> None:
    text = "[design]\npractice_trials = 4\nblank_trials = 3\nboth_level = 110\n"
    plan = draw(text + 'responses = ["left", "right", "both", "none"]')
    practice = plan.trials[:4]
    assert Counter(t.side for t in practice) == {"left": 2, "right": 2}
    assert {(t.kind, t.block, t.level_vpp) for t in practice} == {("practice", 0, 200.0)}
    blanks = [t for t in plan.trials if t.kind == "blank"]
    assert [(t.side, t.level_vpp) for t in blanks] == [("none", None)] * 3
    assert {t.level_vpp for t in plan.trials if t.kind == "both"} == {110.0}


def test_a_changed_plan_is_refused() -> None:
    plan = draw()
    for key, value in (("level_vpp", 61.0), ("foreperiod_s", float("nan"))):
        changed = json.loads(plan.to_json())
        changed["trials"][3][key] = value
        with pytest.raises(PlanError):
            plan_from_json(json.dumps(changed))
    for schema in (1, 5, 7):
        with pytest.raises(PlanError, match=f"schema .* 6; got {schema}"):
            plan_from_json(json.dumps(json.loads(plan.to_json()) | {"schema": schema}))
    with pytest.raises(PlanError, match="sha256"):
        plan_from_json(json.dumps(json.loads(plan.to_json()) | {"sha256": None}))
    with pytest.raises(PlanError, match="sha256"):
        verify(replace(plan, seed=2))


def test_the_check_states_what_balanced_makes_of_the_blocks() -> None:
    design = BALANCED + '\nblank_trials = 60\nresponses = ["left", "right", "both", "none"]\n'
    for break_every, lengths in ((43, {43}), (42, {14, 15})):
        facts = facts_of(f"{design}break_every = {break_every}\n", ())
        assert set(facts["block_trials"]) == lengths


# --- the order of conditions ---------------------------------------------------------------------

VOLTS = "[simulation]\nthreshold_vpp = 58.0\ncrosstalk_db = -30.0\n"
SIMULATED = ("--responder", "simulated", "--seed", "1")


def conditions(number: int) -> str:
    return "".join(f'[[condition]]\nname = "{name}"\n' for name in "abcdefghi"[:number])


@pytest.fixture
def study_of(
    make_study: Callable[[str], Study], short_study_text: str
) -> Callable[[int, str], Study]:
    """Return a study of so many conditions in some order."""

    def study_of(number: int, order: str = "balanced") -> Study:
        line = f'[design]\ncondition_order = "{order}"'
        return make_study(short_study_text.replace("[design]", line) + VOLTS + conditions(number))

    return study_of


@pytest.mark.parametrize(
    ("number", "rows"), [(1, 1), (2, 2), (3, 6), (4, 4), (5, 10), (6, 6), (7, 14), (8, 8), (9, 18)]
)
@pytest.mark.parametrize("first", [1, 5])
def test_each_condition_is_at_each_place_and_before_each_other_equally_often(
    number: int, rows: int, first: int, study_of: Callable[[int], Study]
) -> None:
    study = study_of(number)
    orders = [plan_of(study, first + row).condition_order for row in range(rows)]
    assert all(sorted(order) == list("abcdefghi"[:number]) for order in orders)
    assert len(set(orders)) == rows
    assert plan_of(study, first + rows).condition_order == orders[0]
    places = Counter((place, label) for order in orders for place, label in enumerate(order))
    assert set(places.values()) == {rows // number}
    assert len(places) == number**2
    pairs = Counter(pair for order in orders for pair in itertools.pairwise(order))
    assert len(pairs) == number * (number - 1)
    assert len(set(pairs.values())) <= 1
    assert set(pairs.values()) <= {1, 2}


def plan_of(study: Study, number: int | None, seed: int = 1) -> Plan:
    return draw_plan(study, participant="01", session="01", seed=seed, participant_number=number)


def test_a_plan_has_the_order_of_its_participants_number_and_is_sealed_with_it(
    study_of: Callable[[int], Study],
) -> None:
    study = study_of(3)
    plans = [plan_of(study, number) for number in range(1, 8)]
    orders = ["".join(plan.condition_order) for plan in plans]
    assert orders == ["abc", "bca", "cab", "cba", "acb", "bac", "abc"]
    for number, plan in enumerate(plans, start=1):
        again = plan_from_json(plan.to_json())
        assert (again, again.participant_number) == (plan, number)
        with pytest.raises(PlanError, match="sealed"):
            plan_from_json(replace(plan, participant_number=number + 1).to_json())


@pytest.fixture
def sessions(tmp_path: Path, quick_study_text: str) -> Sessions:
    line = '[design]\ncondition_order = "balanced"\n'
    text = quick_study_text.replace("[design]\n", line) + VOLTS + conditions(2)
    return Sessions(tmp_path, text)


def run_simulated(sessions: Sessions, participant: str, *more: str) -> dict[str, Any]:
    """Run a session with a simulated participant; returns number and order of its plan."""
    words = sessions.words(*SIMULATED, *more)
    words[words.index("--participant") + 1] = participant
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.stderr
    session = more[more.index("--session") + 1] if "--session" in more else "01"
    path = sessions.out / f"sub-{participant}" / f"ses-{session}" / "plan.json"
    plan = plan_from_json(path.read_text("utf-8"))
    return {"participant_number": plan.participant_number, "order": plan.condition_order}


@pytest.mark.slow
def test_a_number_is_the_place_in_the_table_and_a_person_keeps_theirs(
    sessions: Sessions, run: Run
) -> None:
    plan = run_simulated(sessions, "01")
    assert plan == {"participant_number": 1, "order": ("a", "b")}
    table = sessions.out / "participants.tsv"
    table.write_text("participant_id\nsub-00\nsub-01\n", encoding="utf-8")
    assert run_simulated(sessions, "01", "--session", "02")["participant_number"] == 1
    plan = run_simulated(sessions, "02")
    assert plan == {"participant_number": 3, "order": ("a", "b")}
    assert run("withdraw", sessions.out, "--participant", "01", typed="01\n").exit_code == 0
    assert run_simulated(sessions, "03")["participant_number"] == 4


@pytest.mark.slow
def test_a_number_may_be_given_where_it_counts_and_is_kept_on_resume(sessions: Sessions) -> None:
    number = ("--participant-number", "4")
    assert run_simulated(sessions, "01", *number)["order"] == ("b", "a")
    assert sessions.run(*SIMULATED, "--resume", *number).exit_code == 0
    refused = sessions.run(*SIMULATED, "--resume", "--participant-number", "3")
    assert (refused.exit_code, "4; got 3" in refused.stderr) == (2, True)
    sessions.write(sessions.text.replace('"balanced"', '"listed"'))
    refused = sessions.run(*SIMULATED, "--session", "02", *number)
    assert (refused.exit_code, "condition_order" in refused.stderr) == (2, True)
    assert not sessions.folder("02").path.exists()


@pytest.mark.parametrize(
    ("changed", "part"),
    [
        *(({"participant": name}, "participant.*1 to 32 ") for name in ("Jane Doe", "", "COM1", 1)),
        *(({"session": name}, "session.*1 to 32 ") for name in ("all", "é", "x" * 33)),
        *(({"seed": seed}, "seed.*at least 0") for seed in (-1, 1.0, True, None)),
        *(({"participant_number": number}, "at least 1") for number in (None, 0)),
    ],
)
def test_a_plan_that_cannot_be_drawn_is_refused(
    changed: dict[str, Any], part: str, study_of: Callable[[int], Study]
) -> None:
    keys: Any = {"participant": "01", "session": "01", "seed": 1, "participant_number": 1}
    with pytest.raises(PlanError, match=part):
        draw_plan(study_of(2), **keys | changed)


def test_a_plan_is_repeated_by_its_seed_whatever_else_changes(
    study_of: Callable[[int, str], Study],
) -> None:
    assert draw("", 7) == draw("", 7)
    assert draw("", 7).trials != draw("", 8).trials
    assert json.loads(draw("", 7).to_json())["generator"].startswith("PCG64 of numpy ")
    first, second = (plan_of(study_of(2, "balanced"), number) for number in (1, 2))
    waits_s = [[trial.foreperiod_s for trial in plan.trials] for plan in (first, second)]
    assert waits_s[0] == waits_s[1]
    assert first.condition_order == second.condition_order[::-1]
    for order in ("random", "listed"):  # in which the number counts for nothing
        study = study_of(2, order)
        assert plan_of(study, 7, 3) == plan_of(study, None, 3)
    for text in ("", "[]", "{}", '{"schema": 4}', "nonsense", "[" * 100_000):
        with pytest.raises(PlanError):
            plan_from_json(text)
