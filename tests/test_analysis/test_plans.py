"""The plan beside a trials.csv: its seal, its folder, what the table must keep to, what is left."""

from __future__ import annotations

import csv
import json
import shutil
from typing import TYPE_CHECKING, Any

import pytest

from analysis import ColumnMap, analyse, read_inputs, read_trials
from tests.test_analysis.shared import refused

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Simulate

FIRST, SECOND = "sub-01/ses-01", "sub-02/ses-01"


@pytest.fixture
def results(tmp_path: Path, two_sessions: Path) -> Path:
    """Two short sessions, to be changed; with a journal, any change would be named by that."""
    copy = shutil.copytree(two_sessions, tmp_path / "results")
    for journal in copy.glob("sub-*/ses-*/journal.jsonl"):
        journal.unlink()
        (journal.parent.parent / "sessions.tsv").unlink()
    return copy


@pytest.fixture
def table(results: Path) -> Path:
    return results / FIRST / "trials.csv"


@pytest.fixture
def cut_off(tmp_path: Path, two_sessions: Path) -> Path:
    """The table of a session that was killed, with two trials in it, and a whole session."""
    session = shutil.copytree(two_sessions, tmp_path / "cut off") / FIRST
    keep(session / "trials.csv", 3)
    (session.parent / "sessions.tsv").unlink()
    return session / "trials.csv"


def keep_trials(journal: Path, number: int) -> None:
    """Cut a journal behind the end of so many trials."""
    lines = journal.read_bytes().splitlines()
    ends = [n for n, line in enumerate(lines, 1) if b'"event":"trial_end"' in line]
    keep(journal, ends[number - 1])


@pytest.fixture
def plan(results: Path) -> dict[str, Any]:
    contents: dict[str, Any] = json.loads((results / FIRST / "plan.json").read_bytes())
    return contents


def change(table: Path, line: int, **cells: object) -> None:
    """Write other values into the cells of one line; a line below the last one is added."""
    rows = list(csv.reader(table.read_text(encoding="utf-8").splitlines()))
    rows += [rows[-1].copy() for _ in range(line - len(rows))]
    for column, value in cells.items():
        rows[line - 1][rows[0].index(column)] = "n/a" if value is None else str(value)
    table.write_text("".join(",".join(row) + "\n" for row in rows), encoding="utf-8")


def keep(table: Path, lines: int) -> None:
    kept = table.read_bytes().splitlines(keepends=True)[:lines]
    table.write_bytes(b"".join(kept))


def warnings_of(path: Path) -> tuple[str, ...]:
    return (*map(str, analyse(read_inputs([path])).warnings),)


def assert_warned(path: Path, *valid: int) -> None:
    """Assert that sessions lack trials, that nothing else is warned of, and how many they have."""
    warnings = warnings_of(path)
    assert len(warnings) == len(valid)
    assert all(f" {number} of 5 " in text for number, text in zip(valid, warnings, strict=True))


def test_a_complete_session_keeps_to_its_plan(results: Path) -> None:
    assert warnings_of(results) == ()
    assert read_trials([results])["none_offered"].tolist() == [False] * 10
    names = [file.name for file in read_inputs([results / "sub-01"]).inputs]
    assert names == ["ses-01/plan.json", "ses-01/trials.csv"]


def test_the_plan_tells_whether_none_was_offered_to_blanks_too(
    tmp_path: Path, simulate: Simulate
) -> None:
    blank = 'responses = ["left", "right", "both", "none"]\nblank_trials = 2\n'
    trials = read_trials([simulate(tmp_path, blank)])
    assert trials["none_offered"].all()
    assert trials["level_vpp"].isna().sum() == 2


def test_a_session_that_was_stopped_early_is_a_warning(cut_off: Path) -> None:
    keep_trials(cut_off.with_name("journal.jsonl"), 2)
    assert_warned(cut_off.parents[2], 2)


def test_a_table_that_lags_behind_its_journal_is_a_warning(cut_off: Path) -> None:
    keep_trials(cut_off.with_name("journal.jsonl"), 5)
    short, behind = warnings_of(cut_off.parents[2])
    assert " 2 of 5 " in short
    assert " 3 " in behind
    assert "tactstrip export" in behind


def test_a_session_without_a_trial_is_a_warning_where_others_have_some(results: Path) -> None:
    keep(results / FIRST / "trials.csv", 1)
    assert_warned(results, 0)
    keep(results / SECOND / "trials.csv", 1)
    refused(results)


def test_warm_up_may_be_repeated_and_is_not_missed(
    results: Path, table: Path, plan: dict[str, Any]
) -> None:
    first = plan["warm_up"][0]
    cells = {name: first[name] for name in ("kind", "side", "block", "level_vpp")}
    cells |= {"trial": first["number"], "response": first["side"], "correct": "true", "rt_s": 0.5}
    for line in (7, 8):
        change(table, line, **cells, attempt=line - 6)
        assert len(read_trials([table])) == line - 1
    assert warnings_of(results) == ()


def test_slow_answers_within_the_studys_window_are_no_milliseconds(
    tmp_path: Path, simulate: Simulate
) -> None:
    table = simulate(tmp_path, "response_window_s = 30.0\n") / FIRST / "trials.csv"
    table.with_name("journal.jsonl").unlink()
    (table.parents[1] / "sessions.tsv").unlink()
    for line in range(2, 7):
        change(table, line, rt_s=20.0, response="left", correct=None)
    assert read_trials([table])["rt_s"].tolist() == [20.0] * 5
    table.with_name("plan.json").unlink()
    assert '[units] rt_s = "ms"' in str(refused(table))


def test_a_planned_trial_without_a_valid_attempt_is_told_once(results: Path, table: Path) -> None:
    change(table, 4, status="voided")
    assert_warned(results, 4)


@pytest.mark.parametrize(
    ("column", "text"),
    [
        ("participant", "02"),
        ("session", "02"),
        ("trial", "99"),
        ("condition", "bare"),
        ("block", "9"),
        ("level_vpp", "81"),
    ],
)
def test_a_row_not_planned_is_refused(table: Path, column: str, text: str) -> None:
    row = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))[1]
    due = "the number of a planned trial" if column == "trial" else row[column].removesuffix(".0")
    change(table, 3, **{column: text})
    error = refused(table)
    assert (error.file, error.line) == (str(table), 3)
    assert f"column '{column}' is {text}; it must be {due} by the plan" in str(error)


def test_another_kind_or_side_than_planned_is_refused(table: Path) -> None:
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    line, side = next((n, row["side"]) for n, row in enumerate(rows, 2) if row["kind"] == "single")
    change(table, line, kind="hands_off")
    error = str(refused(table))
    assert all(part in error for part in ("'kind'", "hands_off", "single"))
    other = {"left": "right", "right": "left"}[side]
    change(table, line, kind="single", side=other, correct=None)
    error = str(refused(table))
    assert all(part in error for part in ("'side'", other, side))


def test_an_answer_is_one_that_the_plan_declares_a_time_out_or_invalid(table: Path) -> None:
    for line, word in ((3, "timeout"), (4, "invalid")):
        change(table, line, response=word, correct="false", rt_s=None)
    assert len(read_trials([table])) == 5
    change(table, 3, response="none", correct=None)
    assert refused(table).line == 3


def test_an_answer_after_the_plans_window_is_refused(table: Path, plan: dict[str, Any]) -> None:
    change(table, 3, response="left", correct=None, rt_s=plan["response_window_s"])
    assert len(read_trials([table])) == 5
    change(table, 3, rt_s=plan["response_window_s"] + 0.25)
    error = refused(table)
    assert error.line == 3
    assert f"{plan['response_window_s']:g}" in str(error)


def test_the_plan_of_another_session_is_refused(results: Path) -> None:
    plan = shutil.copy(results / SECOND / "plan.json", results / FIRST)
    error = refused(results)
    assert (error.file, error.line) == (str(plan), None)
    assert all(name in str(error) for name in ("sub-02", "sub-01"))


@pytest.mark.parametrize("name", ["sub-99/ses-01", "sub-01/ses-02"])
def test_a_session_under_another_name_is_refused(results: Path, name: str) -> None:
    (results / name).parent.mkdir(exist_ok=True)
    (results / FIRST).rename(results / name)
    assert "plan.json" in refused(results).file


def test_a_session_may_lie_in_a_folder_of_any_other_name(results: Path) -> None:
    moved = (results / FIRST).rename(results / "backup")
    assert len(read_trials([moved / "trials.csv"])) == 5


@pytest.mark.parametrize(
    "changed",
    [
        *({"response_window_s": 9.0}, {"participant": "03"}, {"responses": ["left"]}),
        *(b"{\n oops", b"[1]", b"{}", b"\xff", b"[" * 100_000),
    ],
)
def test_a_plan_changed_after_its_seal_is_refused(results: Path, changed: Any) -> None:
    plan = results / FIRST / "plan.json"
    if isinstance(changed, dict):
        changed = json.dumps(json.loads(plan.read_bytes()) | changed).encode()
    plan.write_bytes(changed)
    error = refused(results)
    assert error.file == str(plan)


def test_a_plan_beside_a_table_of_another_name_is_not_its_plan(table: Path) -> None:
    change(table, 3, level_vpp=81)
    assert len(read_trials([shutil.copy(table, table.with_name("other.csv"))])) == 5
    assert refused(table, columns=ColumnMap()).line == 3
