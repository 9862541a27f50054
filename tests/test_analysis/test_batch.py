"""Tables read together are what they are alone: the same rows, the same refusals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd
import pytest

from analysis import ColumnMap, read_trials
from analysis.reading.batch import read_batch
from analysis.reading.load import read_inputs
from analysis.reading.sources import InputTable
from tests.test_analysis.shared import put, refused, row, write

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Simulate

MAPPED = "participant,side,level_vpp,"


def assert_as_alone(paths: list[Path], columns: ColumnMap | None = None) -> None:
    each = pd.concat([read_trials([path], columns) for path in paths], ignore_index=True)
    pd.testing.assert_frame_equal(read_trials(paths, columns), each)


@pytest.fixture
def sessions(tmp_path: Path, simulate: Simulate) -> Path:
    """A folder with a short session each of three simulated participants, each with its plan."""
    return simulate(tmp_path / "results", participants=3)


@pytest.mark.process
def test_sessions_together_are_the_sessions_alone(sessions: Path) -> None:
    people = sorted(sessions.glob("sub-*"))
    assert_as_alone([person / "ses-01" / "trials.csv" for person in people])
    assert read_inputs([people[1]]).progress[0] == read_inputs([sessions]).progress[1]


def test_a_plan_beside_a_bare_table_keeps_its_declared_answers(
    sessions: Path, tmp_path: Path
) -> None:
    trials = read_trials([sessions, write(tmp_path / "bare.csv", row(participant="bare"))])
    assert trials["none_offered"].isna().tolist() == trials["participant"].eq("bare").tolist()


@pytest.mark.parametrize(
    ("old", "new"),
    [(",left,", ",top,"), ("\n02,", "\n03,"), (",single,", ",both,"), ("\n02,", "\n02,,")],
)
def test_a_fault_in_one_of_many_is_told_as_it_is_alone(sessions: Path, old: str, new: str) -> None:
    for name in ("sub-02", "sub-03"):
        table = sessions / name / "ses-01" / "trials.csv"
        told = table.read_text("utf-8").replace("\n2,", "\n2@")  # the schema stands in front
        told = told.replace(old.replace("\n", "\n2@"), new.replace("\n", "\n2@"))
        table.write_text(told.replace("\n2@", "\n2,"), encoding="utf-8")
    together = refused(sessions)
    assert str(together) == str(refused(sessions / "sub-02"))
    assert "sub-02" in together.file


def test_slow_answers_are_judged_person_by_person(tmp_path: Path) -> None:
    fast = write(tmp_path / "fast.csv", *(row(n) for n in range(1, 10)))
    slow = write(tmp_path / "slow.csv", row(participant="2", rt_s=480.0))
    assert "slow.csv:2: " in str(refused(fast, slow))
    assert "median of 480 s for participant 2" in str(refused(fast, slow))


def test_whether_none_was_an_answer_is_judged_study_by_study(tmp_path: Path) -> None:
    offered = write(tmp_path / "offered.csv", row(), row(2, response="none"))
    same = write(tmp_path / "same.csv", row(participant="2"))
    other = write(tmp_path / "other.csv", row(participant="3", study_sha256="cd" * 32))
    offers = read_trials([offered, same, other])["none_offered"]
    assert offers.fillna(value=False).tolist() == [True, True, True, False]


@pytest.mark.slow
def test_a_felt_blank_counts_for_the_side_of_its_own_file(tmp_path: Path) -> None:
    paths = [
        put(tmp_path / f"{side}.csv", f"{MAPPED}detected\n{side},{side},60,1\n{side},none,0,1\n")
        for side in ("left", "right")
    ]
    assert (
        read_trials(paths, ColumnMap(task="yes/no"))["response"].tolist()
        == ["left"] * 2 + ["right"] * 2
    )
    assert_as_alone(paths, ColumnMap(task="yes/no"))


@pytest.mark.slow
def test_tables_with_columns_in_another_order_or_number_are_read_together(tmp_path: Path) -> None:
    texts = (
        f"{MAPPED}response\n1,left,60,left\n",
        "response,level_vpp,side,participant\nnone,95,right,2\n",
        f"{MAPPED}response,rt_s\n3,left,60,left,0.5\n4,left,60,timeout,2\n",
        f"{MAPPED}detected\n5,left,60,0\n",
    )
    paths = [put(tmp_path / f"{number}.csv", text) for number, text in enumerate(texts)]
    for chosen in (paths[:3], paths):
        assert_as_alone(chosen, ColumnMap(task="yes/no"))


def test_tables_are_really_read_together(tmp_path: Path) -> None:
    paths = [write(tmp_path / f"{n}.csv", row(participant=str(n))) for n in range(3)]
    [batch] = read_batch([InputTable(path=path, name=path.name) for path in paths], None)
    assert [table.trials for table in batch.tables] == [1, 1, 1]
    assert batch.rows["file"].tolist() == [str(path) for path in paths]
    assert batch.rows["line"].tolist() == [2, 2, 2]
