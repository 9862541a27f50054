"""Tables read together are what they are alone: the same rows, the same refusals."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pandas as pd
import pytest

from analysis import ColumnMap, ResultFileError, read_trials
from analysis.reading.batch import read_batch
from analysis.reading.load import read_inputs
from analysis.reading.sources import InputTable
from experiment.terms.record import TrialRow, is_correct, trials_csv

if TYPE_CHECKING:
    from pathlib import Path

    from tests.test_analysis.conftest import Simulate

ROW = TrialRow(
    schema=1, participant="1", session="01", condition="main", block=1, trial=1, attempt=1,
    kind="single", side="left", level_vpp=60.0, response="left", rt_s=0.5, correct=True,
    status="ok", onset_s=12.25, foreperiod_s=1.5, level_left_vpp=60.0, level_right_vpp=0.0,
    peak_left_um=None, peak_right_um=None, displacement_basis=None, anticipated=False,
    noise_ok=True, simulated=False, study_sha256="ab" * 32,
)  # fmt: skip
MAPPED = "participant,side,level_vpp,"


def write(path: Path, *rows: TrialRow) -> Path:
    told = [replace(r, correct=is_correct(r.kind, r.side, r.response)) for r in rows]
    path.write_text(trials_csv(told), encoding="utf-8")
    return path


def alone(paths: list[Path], columns: ColumnMap | None = None) -> pd.DataFrame:
    return pd.concat([read_trials([path], columns) for path in paths], ignore_index=True)


@pytest.fixture
def sessions(tmp_path: Path, simulate: Simulate) -> Path:
    """A folder with a short session each of three simulated participants, each with its plan."""
    return simulate(tmp_path / "results", participants=3)


@pytest.mark.process
def test_sessions_together_are_the_sessions_alone(sessions: Path) -> None:
    people = sorted(sessions.glob("sub-*"))
    pd.testing.assert_frame_equal(
        read_trials([sessions]).drop(columns="file"), alone(people).drop(columns="file")
    )
    together, one = read_inputs([sessions]), read_inputs([people[1]])
    assert one.progress[0] == together.progress[1]


def test_a_planned_session_beside_a_bare_table_keeps_its_declared_answers(
    sessions: Path, tmp_path: Path
) -> None:
    bare = write(tmp_path / "bare.csv", replace(ROW, participant="bare"))
    trials = read_trials([sessions, bare])
    assert trials["none_offered"].isna().tolist() == trials["participant"].eq("bare").tolist()


@pytest.mark.parametrize(
    ("text", "changed"),
    [(",left,", ",top,"), ("\n02,", "\n03,"), (",single,", ",both,"), ("\n02,", "\n02,,")],
)
def test_a_fault_in_one_of_many_tables_is_told_as_it_is_alone(
    sessions: Path, text: str, changed: str
) -> None:
    for name in ("sub-02", "sub-03"):
        table = sessions / name / "ses-01" / "trials.csv"
        told = table.read_text("utf-8").replace("\n1,", "\n1@")  # the schema stands in front
        told = told.replace(text.replace("\n", "\n1@"), changed.replace("\n", "\n1@"))
        table.write_text(told.replace("\n1@", "\n1,"), encoding="utf-8")
    with pytest.raises(ResultFileError) as together:
        read_trials([sessions])
    with pytest.raises(ResultFileError) as one:
        read_trials([sessions / "sub-02"])
    assert str(together.value) == str(one.value)
    assert "sub-02" in together.value.file


def test_slow_answers_are_judged_file_by_file(tmp_path: Path) -> None:
    quick = [replace(ROW, trial=n) for n in range(1, 10)]
    fast = write(tmp_path / "fast.csv", *quick)
    slow = write(tmp_path / "slow.csv", replace(ROW, participant="2", rt_s=480.0))
    with pytest.raises(ResultFileError, match=r"slow\.csv:2: .*median of 480 s in this file"):
        read_trials([fast, slow])


def test_whether_none_was_an_answer_is_judged_file_by_file(tmp_path: Path) -> None:
    offered = write(tmp_path / "offered.csv", ROW, replace(ROW, trial=2, response="none"))
    unknown = write(tmp_path / "unknown.csv", replace(ROW, participant="2"))
    offers = read_trials([offered, unknown])["none_offered"]
    assert offers.fillna(value=False).tolist() == [True, True, False]


def test_a_felt_blank_counts_for_the_side_of_its_own_file(tmp_path: Path) -> None:
    paths = []
    for side in ("left", "right"):
        path = tmp_path / f"{side}.csv"
        path.write_text(f"{MAPPED}detected\n{side},{side},60,1\n{side},none,0,1\n")
        paths.append(path)
    trials = read_trials(paths, ColumnMap())
    assert trials["response"].tolist() == ["left", "left", "right", "right"]
    assert trials.equals(alone(paths, ColumnMap()))


def test_tables_with_columns_in_another_order_or_number_are_read_together(tmp_path: Path) -> None:
    texts = (
        f"{MAPPED}response\n1,left,60,left\n",
        "response,level_vpp,side,participant\nnone,95,right,2\n",
        f"{MAPPED}response,rt_s\n3,left,60,left,0.5\n4,left,60,timeout,2\n",
        f"{MAPPED}detected\n5,left,60,0\n",
    )
    paths = [tmp_path / f"{number}.csv" for number in range(len(texts))]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    for chosen in (paths[:3], paths):
        trials = read_trials(chosen, ColumnMap())
        pd.testing.assert_frame_equal(trials, alone(chosen, ColumnMap()))


def test_tables_are_really_read_together(tmp_path: Path) -> None:
    paths = [write(tmp_path / f"{n}.csv", replace(ROW, participant=str(n))) for n in range(3)]
    [batch] = read_batch([InputTable(path=path, name=path.name) for path in paths], None)
    assert [table.trials for table in batch.tables] == [1, 1, 1]
    assert batch.rows["file"].tolist() == [str(path) for path in paths]
    assert batch.rows["line"].tolist() == [2, 2, 2]
