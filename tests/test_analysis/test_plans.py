"""The plan beside a trials.csv: its seal, its folder, what the table must keep to, what is left."""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
from typing import TYPE_CHECKING

import pandas as pd
import pytest

from analysis import ColumnMap, ResultFileError, read_trials
from analysis.reading.checks import check_rows
from analysis.reading.load import read_inputs
from analysis.reading.rows import own_rows
from analysis.reading.text import text_chunks
from analysis.results.tables import analyse
from device.clock import VirtualClock
from experiment.apparatus.noise import SilentNoise
from experiment.apparatus.rig import mock_device
from experiment.archive.disk import UNWAITED
from experiment.archive.folders import SessionFolder
from experiment.operator.requests import StopSignal
from experiment.session.conduct import begin
from experiment.session.setting import Setting
from experiment.session.simulate import simulated_responder
from experiment.study.read import study_from_canonical
from experiment.terms.record import format_value
from experiment.trial.draw import draw_plan

if TYPE_CHECKING:
    from pathlib import Path

    from tests.test_analysis.conftest import Simulate

FIRST = "sub-01/ses-01"
SECOND = "sub-02/ses-01"


@pytest.fixture
def results(tmp_path: Path, two_sessions: Path) -> Path:
    """Two short sessions, to be changed."""
    return shutil.copytree(two_sessions, tmp_path / "results")


def change(table: Path, line: int, column: str, text: str) -> None:
    """Write another text into one cell of a table."""
    rows = list(csv.reader(table.read_text(encoding="utf-8").splitlines()))
    rows[line - 1][rows[0].index(column)] = text
    table.write_text("".join(",".join(row) + "\n" for row in rows), encoding="utf-8")


def refused(path: Path) -> ResultFileError:
    with pytest.raises(ResultFileError) as caught:
        read_trials([path])
    assert "\n" not in str(caught.value)
    return caught.value


def warnings_of(path: Path) -> tuple[str, ...]:
    return analyse(read_inputs([path])).warnings


def test_a_complete_session_keeps_to_its_plan(results: Path) -> None:
    assert warnings_of(results) == ()
    assert read_trials([results])["none_offered"].tolist() == [False] * 10


def test_plans_are_listed_among_the_inputs(results: Path) -> None:
    names = [file.name for file in read_inputs([results / "sub-01"]).inputs]
    assert names == ["ses-01/plan.json", "ses-01/trials.csv"]


def test_the_plan_tells_whether_none_was_offered_and_blank_trials_have_no_level(
    tmp_path: Path, simulate: Simulate
) -> None:
    blank = 'responses = ["left", "right", "both", "none"]\nblank_trials = 2\n'
    trials = read_trials([simulate(tmp_path, blank)])
    assert trials["none_offered"].all()
    assert trials["level_vpp"].isna().sum() == 2


def test_a_session_that_was_stopped_early_is_a_warning(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    lines = table.read_text(encoding="utf-8").splitlines(keepends=True)
    table.write_text("".join(lines[:3]), encoding="utf-8")
    journal = results / FIRST / "journal.jsonl"
    entries = journal.read_bytes().splitlines(keepends=True)
    ends = [n for n, line in enumerate(entries) if b'"event":"trial_end"' in line]
    journal.write_bytes(b"".join(entries[: ends[1] + 1]))
    told = "participant 01, session 01: 2 of 5 planned trials have a valid attempt"
    assert warnings_of(results) == (told,)


def test_a_table_that_lags_behind_its_journal_is_a_warning(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    lines = table.read_text(encoding="utf-8").splitlines(keepends=True)
    table.write_text("".join(lines[:3]), encoding="utf-8")
    short, behind = warnings_of(results)
    assert short.endswith("2 of 5 planned trials have a valid attempt")
    assert "its journal tells of 3 more trials than its trials.csv; tactstrip export" in behind


def test_a_session_stopped_before_its_first_trial_is_a_warning(results: Path) -> None:
    for session in (FIRST, SECOND):
        table = results / session / "trials.csv"
        table.write_text(table.read_text("utf-8").splitlines()[0] + "\n", encoding="utf-8")
        (results / session / "journal.jsonl").unlink()
    with pytest.raises(ResultFileError, match="no session here has a trial yet"):
        read_trials([results])


def test_one_session_without_a_trial_does_not_stop_the_others(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    table.write_text(table.read_text("utf-8").splitlines()[0] + "\n", encoding="utf-8")
    (results / FIRST / "journal.jsonl").unlink()
    told = "participant 01, session 01: 0 of 5 planned trials have a valid attempt"
    assert warnings_of(results) == (told,)


def test_warm_up_may_be_repeated_and_a_planned_trial_may_not(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    plan = SessionFolder(results, "01", "01").read_plan()
    lines = table.read_text(encoding="utf-8").splitlines(keepends=True)
    table.write_text("".join([*lines, lines[-1], lines[-1]]), encoding="utf-8")
    warm_up = plan.warm_up[0]
    cells = {name: getattr(warm_up, name) for name in ("kind", "side", "block", "level_vpp")}
    cells |= {"trial": warm_up.number, "response": warm_up.side, "correct": True, "rt_s": 0.5}
    for line, attempt in ((7, 1), (8, 2)):
        for column, value in (cells | {"attempt": attempt}).items():
            change(table, line, column, format_value(value))
    assert len(read_trials([table])) == 7


def test_placed_levels_make_no_other_study(results: Path, tmp_path: Path) -> None:
    study = study_from_canonical(SessionFolder(results, "01", "01").read_plan().study)
    folder = SessionFolder(results, "placed", "01", disk=UNWAITED)
    plan = draw_plan(
        study,
        participant="placed",
        session="01",
        seed=5,
        levels_vpp=(70.0, 150.0),
        gains=SessionFolder(results, "01", "01").read_plan().gains,
    )
    clock = VirtualClock()
    setting = Setting(
        device=mock_device(study, clock),
        responder=simulated_responder(study, plan, clock),
        noise=SilentNoise(study.masking),
        clock=clock,
        stop=StopSignal(),
    )
    assert begin(folder, plan, setting).finished
    assert warnings_of(results) == ()


def test_slow_answers_within_the_studys_window_are_no_milliseconds(results: Path) -> None:
    text = (results / FIRST / "trials.csv").read_text("utf-8")
    header, chunks = text_chunks(io.BytesIO(text.encode()), "t.csv")
    lines, cells = next(chunks)
    rows = own_rows(pd.DataFrame(cells, columns=header, index=lines, dtype=object), "t.csv")
    slow = rows.assign(rt_s=20.0)
    check_rows(slow, planned=frozenset({"t.csv"}))
    with pytest.raises(ResultFileError, match="milliseconds"):
        check_rows(slow)


def test_a_planned_trial_without_a_valid_attempt_is_told_once(results: Path) -> None:
    change(results / FIRST / "trials.csv", 4, "status", "voided")
    told = "participant 01, session 01: 4 of 5 planned trials have a valid attempt"
    assert warnings_of(results) == (told,)


def test_the_warm_up_is_planned_but_not_missed(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    plan = SessionFolder(results, "01", "01").read_plan()
    warm_up = plan.warm_up[0]
    lines = table.read_text(encoding="utf-8").splitlines(keepends=True)
    table.write_text("".join([*lines, lines[-1]]), encoding="utf-8")
    cells = {name: getattr(warm_up, name) for name in ("kind", "side", "block", "level_vpp")}
    cells |= {"trial": warm_up.number, "response": warm_up.side, "correct": True, "rt_s": 0.5}
    for column, value in cells.items():
        change(table, 7, column, format_value(value))
    assert len(read_trials([table])) == 6
    assert warnings_of(results) == ()


@pytest.mark.parametrize(
    ("column", "text", "must"),
    [
        ("participant", "02", "01"),
        ("session", "02", "01"),
        ("trial", "99", "the number of a planned trial"),
        ("condition", "bare", "main in trial 2"),
        ("block", "9", "1 in trial 2"),
        ("level_vpp", "81", " in trial 2"),
    ],
)
def test_a_row_that_was_not_planned_is_refused(
    results: Path, column: str, text: str, must: str
) -> None:
    table = results / FIRST / "trials.csv"
    change(table, 3, column, text)
    error = refused(table)
    assert (error.file, error.line) == (str(table), 3)
    assert f"column '{column}' is {text}; it must be " in str(error)
    assert f"{must} by the plan beside the table" in str(error)


def test_another_kind_or_side_than_planned_is_refused(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    lines = table.read_text(encoding="utf-8").splitlines()
    line = next(n for n, text in enumerate(lines, 1) if ",single," in text)
    planned = csv.DictReader(lines)
    side = list(planned)[line - 2]["side"]
    change(table, line, "kind", "control")
    assert "column 'kind' is control; it must be single in trial" in str(refused(table))
    other = {"left": "right", "right": "left"}[side]
    change(table, line, "kind", "single")
    change(table, line, "side", other)
    change(table, line, "correct", "n/a")
    assert f"column 'side' is {other}; it must be {side} in trial" in str(refused(table))


def test_an_answer_that_the_plan_does_not_declare_is_refused(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    change(table, 3, "response", "none")
    change(table, 3, "correct", "n/a")
    assert "it must be one of left, right, both, timeout, invalid by" in str(refused(table))


def test_time_outs_and_invalid_keys_need_no_declaration(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    for line, word in ((3, "timeout"), (4, "invalid")):
        change(table, line, "response", word)
        change(table, line, "correct", "false")
        change(table, line, "rt_s", "n/a")
    assert len(read_trials([table])) == 5


def test_an_answer_after_the_plans_window_is_refused(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    window_s = SessionFolder(results, "01", "01").read_plan().response_window_s
    change(table, 3, "response", "left")
    change(table, 3, "correct", "n/a")
    change(table, 3, "rt_s", f"{window_s:g}")
    assert len(read_trials([table])) == 5
    change(table, 3, "rt_s", f"{window_s + 0.25:g}")
    error = refused(table)
    assert error.line == 3
    assert f"at most the response window, {window_s:g}, by" in str(error)


def test_the_plan_of_another_session_is_refused(results: Path) -> None:
    plan = results / FIRST / "plan.json"
    plan.write_bytes((results / "sub-02" / "ses-01" / "plan.json").read_bytes())
    error = refused(results)
    assert (error.file, error.line) == (str(plan), None)
    assert "the plan of sub-02, but the folder is sub-01" in str(error)


@pytest.mark.parametrize("name", ["sub-99/ses-01", "sub-01/ses-02"])
def test_a_session_under_another_name_is_refused(results: Path, name: str) -> None:
    (results / name).parent.mkdir(exist_ok=True)
    (results / FIRST).rename(results / name)
    assert "but the folder is" in str(refused(results))


def test_a_session_may_lie_in_a_folder_of_any_other_name(results: Path) -> None:
    (results / FIRST).rename(results / "backup")
    assert len(read_trials([results / "backup" / "trials.csv"])) == 5


@pytest.mark.parametrize(
    ("key", "value"), [("response_window_s", 9.0), ("participant", "03"), ("responses", ["left"])]
)
def test_a_plan_that_was_changed_after_it_was_sealed_is_refused(
    results: Path, key: str, value: object
) -> None:
    plan = results / FIRST / "plan.json"
    contents = json.loads(plan.read_text(encoding="utf-8")) | {key: value}
    plan.write_text(json.dumps(contents), encoding="utf-8")
    error = refused(results)
    assert error.file == str(plan)
    assert "not a sealed plan: " in str(error)


@pytest.mark.parametrize("raw", [b"{\n oops", b"[1]", b"{}", b"\xff", b"[" * 100_000])
def test_a_broken_plan_is_refused(results: Path, raw: bytes) -> None:
    (results / FIRST / "plan.json").write_bytes(raw)
    assert "plan.json: not a sealed plan: " in str(refused(results))


def test_a_plan_that_is_no_regular_file_is_refused(results: Path) -> None:
    plan = results / FIRST / "plan.json"
    plan.unlink()
    os.mkfifo(plan)
    assert "plan.json: not a sealed plan: not a regular file" in str(refused(results))
    plan.unlink()
    for target in ("nowhere", "plan.json"):
        plan.symlink_to(plan.with_name(target))
        assert "plan.json: cannot be read: " in str(refused(results))
        plan.unlink()


def test_a_plan_beside_a_table_of_another_name_is_not_its_plan(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    copy = table.with_name("other.csv")
    copy.write_bytes(table.read_bytes())
    change(copy, 3, "level_vpp", "81")
    assert len(read_trials([copy])) == 5


def test_a_map_does_not_lift_the_seal(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    change(table, 3, "level_vpp", "81")
    with pytest.raises(ResultFileError, match="by the plan beside the table"):
        read_trials([results], ColumnMap())


def test_a_table_torn_in_its_last_cell_is_refused(results: Path) -> None:
    table = results / FIRST / "trials.csv"
    lines = table.read_bytes().splitlines(keepends=True)
    table.write_bytes(b"".join(lines[:5])[:-9])
    error = refused(results)
    assert error.line == 5
    assert "column 'study_sha256' is" in str(error)
