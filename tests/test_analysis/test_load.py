"""Reading trials.csv, alone and together: what is read, refusals with their file and line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

from analysis import ColumnMap, ResultFileError, read_inputs, read_trials
from analysis.reading.text import CHUNK_ROWS
from experiment import COLUMNS, TrialRow
from experiment.record.rows import cells_of
from tests.test_analysis.shared import LEAST, cases, put, refused, row, table_of, write

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Simulate

HEADER, LINE = table_of(row()).splitlines(keepends=True)
NAMES = [column.name for column in COLUMNS]


def read(folder: Path, *rows: TrialRow) -> pd.DataFrame:
    return read_trials([write(folder / "trials.csv", *rows)])


def refusal(folder: Path, *rows: TrialRow) -> ResultFileError:
    return refused(write(folder / "trials.csv", *rows))


def session(folder: Path, person: str, number: str = "01", **changes: Any) -> Path:
    """Write a session of one trial."""
    path = folder / f"sub-{person}" / f"ses-{number}" / "trials.csv"
    return write(path, row(participant=person, session=number, **changes))


def write_cell(path: Path, column: str, text: str) -> Path:
    """Write two trials, the second with one cell as given."""
    cells = table_of(row(2)).splitlines()[1].split(",")
    cells[NAMES.index(column)] = text
    return put(path, HEADER + LINE + ",".join(cells) + "\n")


def test_every_column_comes_back_as_it_was_recorded(tmp_path: Path) -> None:
    blank = row(2, kind="blank", side="none", level_vpp=None, response="none", noise_ok=None)
    trials = read(tmp_path, row(), blank)
    more = ["file", "line", "task", "sites", "none_offered", "reason", "fault"]
    assert list(trials.columns) == [*NAMES, *more]
    for name in NAMES:
        for found, written in zip(trials[name], (row(), blank), strict=True):
            expected = dict(zip(NAMES, cells_of(written), strict=True))[name]
            assert pd.isna(found) if expected is None else found == expected, name
    assert trials["line"].tolist() == [2, 3]


def test_dtypes_are_the_documented_ones(tmp_path: Path) -> None:
    trials = read(tmp_path, row())
    for column in COLUMNS:
        dtype = trials[column.name].dtype
        if column.choices:
            assert isinstance(dtype, pd.CategoricalDtype)
            assert list(dtype.categories) == list(column.choices)
        elif column.type == "str":
            assert pd.api.types.is_string_dtype(dtype)
        elif column.type == "bool" and column.optional:
            assert dtype == "boolean"
        else:
            expected = {"int": np.int64, "float": np.float64, "bool": np.bool_}[column.type]
            assert dtype == expected


def test_neither_the_order_of_columns_nor_windows_line_ends_matter(tmp_path: Path) -> None:
    straight = read(tmp_path, row(), row(2))
    table = pd.DataFrame([line.split(",") for line in table_of(row(), row(2)).splitlines()])
    turned = table.iloc[:, ::-1].to_csv(index=False, header=False, lineterminator="\r\n")
    (tmp_path / "trials.csv").write_bytes(turned.encode())
    pd.testing.assert_frame_equal(read_trials([tmp_path / "trials.csv"]), straight)


@pytest.mark.slow
def test_more_rows_than_one_chunk_keep_their_lines(tmp_path: Path) -> None:
    rows = [row(number) for number in range(1, CHUNK_ROWS + 4)]
    assert read(tmp_path, *rows)["line"].tolist() == list(range(2, CHUNK_ROWS + 5))
    assert refusal(tmp_path, *rows, row(CHUNK_ROWS + 4, rt_s=-1.0)).line == CHUNK_ROWS + 5


def test_a_folder_means_its_sessions_and_nothing_else(tmp_path: Path) -> None:
    for person, number in (("1", "01"), ("2", "01"), ("2", "02")):
        session(tmp_path, person, number)
    session(tmp_path / "analysis", "9")
    write(tmp_path / "sub-2" / "ses-02" / "analysis" / "trials.csv", row())
    write(tmp_path / "trials.csv", row())
    assert read_trials([tmp_path])["participant"].tolist() == ["1", "2", "2"]
    assert len(read_trials([tmp_path / "sub-2"])) == 2
    assert len(read_trials([tmp_path / "sub-2" / "ses-02"])) == 1
    names = [file.name for file in read_inputs([tmp_path]).inputs]
    assert names == [f"sub-{s}/trials.csv" for s in ("1/ses-01", "2/ses-01", "2/ses-02")]


CELLS = {
    "side": ["top"],
    "kind": ["null"],
    "response": ["Left"],
    "status": ["fine"],
    "displacement_basis": ["guess"],
    "schema": ["1"],
    "participant": ["n/a", "a\x1bb", "a" * 65],
    "condition": ["a" * 3000, ""],
    "trial": ["0", "1.5", "99999999999999999999"],
    "block": ["-2", "-1"],
    "level_vpp": ["-60", "nan", "inf", "1e400", "60 V", "6_0", "٦٠"],
    "rt_s": ["-0.1", "", "NaN"],
    "onset_s": ["-inf"],
    "foreperiod_s": ["n/a"],
    "premature": ["True", "n/a"],
    "noise_ok": ["1"],
    "correct": ["yes"],
}


@pytest.mark.parametrize(
    ("column", "text"), [(column, text) for column, texts in CELLS.items() for text in texts]
)
def test_a_cell_that_cannot_be_is_named(tmp_path: Path, column: str, text: str) -> None:
    path = write_cell(tmp_path / "trials.csv", column, text)
    error = refused(path)
    assert (error.file, error.line) == (str(path), 3)
    assert f"'{column}'" in str(error)


def test_a_table_of_another_version_is_refused_by_its_schema(tmp_path: Path) -> None:
    header, line = table_of(row()).splitlines()
    old = [",".join(cells.split(",")[:-2]) for cells in (header, line)]
    path = put(tmp_path / "trials.csv", f"{old[0]}\n1{old[1][1:]}\n")
    assert refused(path).line == 2
    assert "schema" in str(refused(path))


@pytest.mark.parametrize(("changes", "column"), cases("contradictions"))
def test_contradictions_are_refused(tmp_path: Path, changes: Any, column: str) -> None:
    error = refusal(tmp_path, row(), row(2, **changes), row(3))
    assert error.line == 3
    assert f"'{column}'" in str(error)


def test_marks_of_direction_in_a_name_are_spelled_out(tmp_path: Path) -> None:
    path = write_cell(tmp_path / "trials.csv", "participant", "\u202eab\u200f")
    assert "<U+202E>ab<U+200F>" in read_trials([path])["participant"].tolist()


@pytest.mark.slow
def test_the_first_line_that_is_wrong_is_the_one_named(tmp_path: Path) -> None:
    rows = [row(), row(2, correct=False), row(3, level_vpp=None), row(4, kind="both")]
    assert refusal(tmp_path, *rows).line == 3


def test_a_blank_trial_has_no_level_however_it_is_written(tmp_path: Path) -> None:
    blank: dict[str, Any] = {"kind": "blank", "side": "none", "response": "none"}
    rows = [row(1, level_vpp=None, **blank), row(2, level_vpp=0.0, **blank)]
    assert read(tmp_path, *rows)["level_vpp"].isna().all()


def test_a_missing_verdict_is_filled_in(tmp_path: Path) -> None:
    trials = read(tmp_path, row(correct=None), row(2, side="right", correct=None))
    assert trials["correct"].tolist() == [True, False]


def test_milliseconds_are_noticed(tmp_path: Path) -> None:
    error = refusal(tmp_path, row(), row(2, rt_s=612.0), row(3, rt_s=590.0))
    assert error.line == 3
    assert all(part in str(error) for part in ("590", "007", "0.01", "10 s", '[units] rt_s = "ms"'))


def test_a_trial_told_twice_is_refused(tmp_path: Path) -> None:
    error = refusal(tmp_path, row(), row(2), row())
    assert error.line == 4
    assert str(error).endswith(f"{tmp_path / 'trials.csv'}:2")
    first, second = write(tmp_path / "a.csv", row()), write(tmp_path / "b.csv", row(2), row())
    error = refused(first, second)
    assert (error.file, error.line) == (str(second), 3)
    assert f"{first}:2" in str(error)


def test_two_valid_attempts_of_one_trial_are_refused(tmp_path: Path) -> None:
    assert len(read(tmp_path, row(status="voided"), row(attempt=2))) == 2
    error = refusal(tmp_path, row(), row(attempt=2))
    assert error.line == 3
    assert "status ok" in str(error)


@pytest.mark.parametrize(("text", "words"), cases("headers"))
def test_another_header_is_refused(tmp_path: Path, text: str, words: str) -> None:
    path = put(tmp_path / "trials.csv", text)
    error = refused(path)
    assert (error.file, error.line) == (str(path), 1)
    assert words in str(error)


def test_an_endless_line_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "trials.csv"
    with path.open("wb") as file:
        file.write(HEADER.encode() + b"x")
        file.truncate(8_000_000_000)  # sparse: takes no room on the disk
    assert refused(path).line == 2


def test_paths_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for name in ("none.csv", "loop", "x" * 300, "."):
        assert str(tmp_path / name) in str(refused(tmp_path / name))
    assert "a\\nb.csv" in str(refused(tmp_path / "a\nb.csv"))
    (tmp_path / "sub-1" / "ses-01").mkdir(parents=True)
    refused(tmp_path)
    with pytest.raises(ValueError, match="paths"):
        read_trials([])


@pytest.mark.parametrize(
    ("text", "columns"),
    [(HEADER + LINE, None), (LEAST + "1,left,60,left\n", ColumnMap())],
    ids=["own", "a table that numbers no trials"],
)
def test_a_copy_of_a_table_is_refused(tmp_path: Path, text: str, columns: ColumnMap | None) -> None:
    paths = [put(tmp_path / name, text) for name in ("a.csv", "b.csv")]
    error = refused(*paths, columns=columns)
    assert error.file == str(paths[1])
    assert str(paths[0]) in str(error)


def test_the_names_of_inputs_tell_the_files_apart(tmp_path: Path) -> None:
    tables = [session(tmp_path, "1"), session(tmp_path, "2")]
    put(tmp_path / "sub-1" / "ses-02" / "journal.jsonl", "")
    found = read_inputs([tmp_path / "sub-1", tmp_path / "sub-2"])
    names = [f"sub-{number}/ses-01/trials.csv" for number in ("1", "2")]
    assert [file.name for file in found.inputs] == names
    assert [*found.without_table] == ["sub-1/ses-02"]
    assert [file.name for file in read_inputs(tables).inputs] == names


def assert_as_alone(paths: list[Path], columns: ColumnMap | None = None) -> None:
    each = pd.concat([read_trials([path], columns) for path in paths], ignore_index=True)
    pd.testing.assert_frame_equal(read_trials(paths, columns), each)


@pytest.fixture
def sessions(tmp_path: Path, simulate: Simulate) -> Path:
    """A folder with a short session each of three simulated participants, each with its plan."""
    return simulate(tmp_path / "results", participants=3)


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
        text = table.read_text("utf-8").replace("\n3,", "\n3@")  # the schema stands in front
        text = text.replace(old.replace("\n", "\n3@"), new.replace("\n", "\n3@"))
        table.write_text(text.replace("\n3@", "\n3,"), encoding="utf-8")
    together = refused(sessions)
    assert str(together) == str(refused(sessions / "sub-02"))
    assert "sub-02" in together.file


def test_slow_answers_are_judged_person_by_person(tmp_path: Path) -> None:
    fast = write(tmp_path / "fast.csv", *(row(n) for n in range(1, 10)))
    slow = write(tmp_path / "slow.csv", row(participant="2", rt_s=480.0))
    error = refused(fast, slow)
    assert (error.file, error.line) == (str(slow), 2)
    assert "480" in str(error)
