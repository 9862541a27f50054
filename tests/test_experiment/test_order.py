"""The order of conditions, balanced over participants."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner

from experiment.archive.folders import SessionFolder
from experiment.archive.participants import Tombstone, enter_person, remove_person, write_tombstone
from experiment.session.simulate import simulate_study
from experiment.trial.draw import draw_plan
from experiment.trial.order import balanced_order, order_count
from experiment.trial.plan import PlanError, plan_from_json
from tactstrip import main
from tests.test_experiment.sessions import Sessions

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.study.study import Study
    from experiment.trial.plan import Plan

NAMES = "abcdefgh"
VOLTS = "[simulation]\nthreshold_vpp = 58.0\ncrosstalk_db = -30.0\n"
SIMULATED = ("--responder", "simulated", "--seed", "1")


def conditions(number: int) -> str:
    return "".join(f'[[condition]]\nname = "{name}"\n' for name in NAMES[:number])


@pytest.fixture
def study_of(
    make_study: Callable[[str], Study], short_study_text: str
) -> Callable[[int, str], Study]:
    """Return a study of so many conditions in some order."""

    def study_of(number: int, order: str = "balanced") -> Study:
        line = f'[design]\ncondition_order = "{order}"'
        return make_study(short_study_text.replace("[design]", line) + VOLTS + conditions(number))

    return study_of


@pytest.mark.parametrize("number", range(1, 10))
@pytest.mark.parametrize("first", [1, 5])
def test_each_condition_is_at_each_place_and_before_each_other_equally_often(
    number: int, first: int
) -> None:
    rows = order_count(number)
    orders = [balanced_order(number, first + row) for row in range(rows)]
    assert all(sorted(order) == list(range(number)) for order in orders)
    assert len(set(orders)) == rows
    places = Counter((place, label) for order in orders for place, label in enumerate(order))
    assert set(places.values()) == {rows // number}
    assert len(places) == number**2
    pairs = Counter(pair for order in orders for pair in pairwise(order))
    assert len(pairs) == number * (number - 1)
    assert set(pairs.values()) <= {1, 2}
    assert len(set(pairs.values())) <= 1


def test_an_even_number_of_conditions_needs_as_many_participants_an_odd_one_twice_as_many() -> None:
    assert [order_count(number) for number in range(1, 9)] == [1, 2, 6, 4, 10, 6, 14, 8]


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
        with pytest.raises(PlanError, match="changed after it was sealed"):
            plan_from_json(replace(plan, participant_number=number + 1).to_json())


def test_the_number_changes_the_order_and_no_draw(study_of: Callable[[int], Study]) -> None:
    one, two = (plan_of(study_of(2), number) for number in (1, 2))
    waits_s = [[trial.foreperiod_s for trial in plan.trials] for plan in (one, two)]
    assert waits_s[0] == waits_s[1]
    assert one.condition_order == two.condition_order[::-1]


@pytest.mark.parametrize("order", ["random", "listed"])
def test_without_a_balanced_order_the_number_says_nothing(
    study_of: Callable[[int, str], Study], order: str
) -> None:
    study = study_of(2, order)
    for seed in range(5):
        assert plan_of(study, 7, seed) == plan_of(study, None, seed)
    assert "participant_number" not in plan_of(study, 7).to_json()


@pytest.mark.parametrize("number", [None, 0])
def test_a_balanced_order_needs_a_number(
    study_of: Callable[[int], Study], number: int | None
) -> None:
    with pytest.raises(PlanError, match=r"whole number >= 1 where design\.condition_order"):
        plan_of(study_of(2), number)


def test_simulated_participants_are_balanced(
    tmp_path: Path, study_of: Callable[[int], Study]
) -> None:
    folders = simulate_study(study_of(2), tmp_path, participants=4, seed=1, gains=())
    orders = ["".join(folder.read_plan().condition_order) for folder in folders]
    assert orders == ["ab", "ba", "ab", "ba"]


def test_a_number_is_the_place_in_the_table_and_of_nobody_who_withdrew(tmp_path: Path) -> None:
    def number(participant: str) -> int:
        return SessionFolder(tmp_path, participant, "01").participant_number()

    assert number("A") == 1
    for person in "ABC":
        enter_person(tmp_path, person, [], ())
    assert [number(person) for person in "ABCD"] == [1, 2, 3, 4]
    write_tombstone(tmp_path, Tombstone(participant="B", withdrawn="2026-01-02", removed=False))
    assert number("D") == 4
    remove_person(tmp_path, "B")
    assert number("D") == 4
    enter_person(tmp_path, "D", [], ())
    assert [number(person) for person in "DE"] == [4, 5]


@pytest.fixture
def sessions(tmp_path: Path, quick_study_text: str) -> Sessions:
    line = '[design]\ncondition_order = "balanced"\n'
    text = quick_study_text.replace("[design]\n", line) + VOLTS + conditions(2)
    return Sessions(tmp_path, text)


@pytest.mark.slow
def test_a_run_tells_and_seals_the_order_and_a_person_keeps_their_number(
    sessions: Sessions,
) -> None:
    told = sessions.run(*SIMULATED).stdout
    assert "participant number 1: conditions in the order a, b" in told
    header = sessions.header()
    assert (header["participant_number"], header["condition_order"]) == (1, ["a", "b"])
    enter_person(sessions.out, "00", [], ())
    table = sessions.out / "participants.tsv"
    table.write_text("participant_id\nsub-00\nsub-01\n", encoding="utf-8")
    assert "participant number 1:" in sessions.run(*SIMULATED, "--session", "02").stdout
    last = sessions.run(*SIMULATED, "--participant", "02")
    assert "participant number 3: conditions in the order a, b" in last.stdout


@pytest.mark.slow
def test_a_number_that_somebody_else_has_is_told(sessions: Sessions) -> None:
    number = ("--participant-number", "12")
    first = sessions.run(*SIMULATED, *number)
    assert "Note:" not in first.stdout
    assert "Note:" not in sessions.run(*SIMULATED, "--session", "02").stdout
    for given in ("12", "1", "2"):
        words = sessions.words(*SIMULATED, "--participant-number", given)
        words[words.index("--participant") + 1] = f"P{given}"
        done = CliRunner().invoke(main, words)
        assert done.exit_code == 0, done.stderr
        told = "Note: participant number 12 is that of participant 01, too."
        assert (told in done.stdout) == (given == "12")


@pytest.mark.slow
def test_a_number_may_be_given_where_it_counts_and_is_kept_on_resume(sessions: Sessions) -> None:
    number = ("--participant-number", "4")
    assert "participant number 4: conditions in the order b, a" in (
        sessions.run(*SIMULATED, *number).stdout
    )
    assert sessions.run(*SIMULATED, "--resume", *number).exit_code == 0
    refused = sessions.run(*SIMULATED, "--resume", "--participant-number", "3")
    assert (refused.exit_code, "must be that of the session, 4; got 3" in refused.stderr) == (
        2,
        True,
    )
    sessions.write(sessions.text.replace('"balanced"', '"listed"'))
    refused = sessions.run(*SIMULATED, "--session", "02", *number)
    assert refused.exit_code == 2
    assert "needs condition_order = \"balanced\" in [design]; got 'listed'" in refused.stderr
    assert not sessions.folder("02").path.exists()
