"""Reading trials.csv: what is read, and every refusal with its file and line."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis import ColumnMap, ResultFileError, read_trials
from analysis.reading.load import read_inputs
from analysis.reading.text import CHUNK_ROWS
from experiment.terms.record import COLUMNS, TrialRow, is_correct, trials_csv

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from analysis.reading.sources import InputTable

BASE = TrialRow(
    schema=1,
    participant="007",
    session="01",
    condition="main",
    block=1,
    trial=1,
    attempt=1,
    kind="single",
    side="left",
    level_vpp=60.0,
    response="left",
    rt_s=0.5,
    correct=True,
    status="ok",
    onset_s=12.25,
    foreperiod_s=1.5,
    level_left_vpp=60.0,
    level_right_vpp=0.0,
    peak_left_um=None,
    peak_right_um=None,
    displacement_basis=None,
    anticipated=False,
    noise_ok=True,
    simulated=False,
    study_sha256="ab" * 32,
)


def row(trial: int = 1, **changes: Any) -> TrialRow:
    made = replace(BASE, trial=trial, **changes)
    if "correct" in changes:
        return made
    return replace(made, correct=is_correct(made.kind, made.side, made.response))


def write(path: Path, *rows: TrialRow) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(trials_csv(rows), encoding="utf-8")
    return path


def write_cell(path: Path, column: str, text: str) -> Path:
    """Write two trials, the second with one cell as given."""
    names = [c.name for c in COLUMNS]
    lines = trials_csv([row(1), row(2)]).splitlines()
    cells = lines[2].split(",")
    cells[names.index(column)] = text
    path.write_text("\n".join([*lines[:2], ",".join(cells)]) + "\n", encoding="utf-8")
    return path


def refused(*paths: Path) -> ResultFileError:
    with pytest.raises(ResultFileError) as caught:
        read_trials(paths)
    assert "\n" not in str(caught.value)
    return caught.value


def test_every_column_comes_back_as_it_was_recorded(tmp_path: Path) -> None:
    blank = row(2, kind="blank", side="none", level_vpp=None, response="none", noise_ok=None)
    trials = read_trials([write(tmp_path / "trials.csv", row(1), blank)])
    told = ["file", "line", "none_offered", "reason", "fault"]
    assert list(trials.columns) == [c.name for c in COLUMNS] + told
    for column in COLUMNS:
        for read, written in zip(trials[column.name], (row(1), blank), strict=True):
            expected = getattr(written, column.name)
            assert pd.isna(read) if expected is None else read == expected, column.name
    assert trials["line"].tolist() == [2, 3]


def test_dtypes_are_the_documented_ones(tmp_path: Path) -> None:
    trials = read_trials([write(tmp_path / "trials.csv", row(1))])
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


def test_identifiers_stay_text(tmp_path: Path) -> None:
    trials = read_trials([write(tmp_path / "trials.csv", row(1))])
    assert trials[["participant", "session"]].to_numpy().tolist() == [["007", "01"]]


def test_the_order_of_columns_is_free(tmp_path: Path) -> None:
    table = pd.DataFrame([line.split(",") for line in trials_csv([row(1), row(2)]).splitlines()])
    turned = table.iloc[:, ::-1].to_csv(index=False, header=False)
    (tmp_path / "turned.csv").write_text(turned, encoding="utf-8")
    straight = read_trials([write(tmp_path / "trials.csv", row(1), row(2))])
    mixed = read_trials([tmp_path / "turned.csv"])
    pd.testing.assert_frame_equal(mixed.drop(columns="file"), straight.drop(columns="file"))


def test_windows_line_ends_change_nothing(tmp_path: Path) -> None:
    path = tmp_path / "trials.csv"
    path.write_bytes(trials_csv([row(1), row(2)]).replace("\n", "\r\n").encode())
    assert read_trials([path])["line"].tolist() == [2, 3]


def test_more_rows_than_one_chunk_keep_their_lines(tmp_path: Path) -> None:
    number = CHUNK_ROWS + 3
    path = write(tmp_path / "trials.csv", *(row(i) for i in range(1, number + 1)))
    trials = read_trials([path])
    assert trials["line"].tolist() == list(range(2, number + 2))
    bad = replace(row(number + 1), rt_s=-1.0)
    error = refused(write(path, *(row(i) for i in range(1, number + 1)), bad))
    assert error.line == number + 2


def test_a_folder_means_its_sessions_and_nothing_else(tmp_path: Path) -> None:
    write(tmp_path / "sub-1" / "ses-01" / "trials.csv", row(1, participant="1"))
    write(tmp_path / "sub-2" / "ses-01" / "trials.csv", row(1, participant="2"))
    write(tmp_path / "sub-2" / "ses-02" / "trials.csv", row(1, participant="2", session="02"))
    write(tmp_path / "analysis" / "sub-9" / "ses-01" / "trials.csv", row(1))
    write(tmp_path / "sub-2" / "ses-02" / "analysis" / "trials.csv", row(1))
    write(tmp_path / "trials.csv", row(1))
    assert read_trials([tmp_path])["participant"].tolist() == ["1", "2", "2"]
    assert len(read_trials([tmp_path / "sub-2"])) == 2
    assert len(read_trials([tmp_path / "sub-2" / "ses-02"])) == 1
    names = [file.name for file in read_inputs([tmp_path]).inputs]
    assert names == [f"sub-{s}/trials.csv" for s in ("1/ses-01", "2/ses-01", "2/ses-02")]


def test_a_session_without_a_table_is_told(tmp_path: Path) -> None:
    write(tmp_path / "sub-1" / "ses-01" / "trials.csv", row(1))
    (tmp_path / "sub-1" / "ses-02").mkdir()
    assert read_inputs([tmp_path]).without_table == ("sub-1/ses-02",)


@pytest.mark.parametrize(
    ("column", "text", "allowed"),
    [
        ("side", "top", "left, right, both or none"),
        ("kind", "null", "single, both, blank, practice or control"),
        ("response", "Left", "left, right, both, none, timeout, invalid or n/a"),
        ("status", "fine", "ok, device_error, indeterminate, aborted or voided"),
        ("displacement_basis", "guess", "measured, predicted or n/a"),
        ("schema", "2", "allowed: 1"),
        ("participant", "n/a", "printable text of 1 to 64 characters"),
        ("participant", "a\x1bb", "printable text of 1 to 64 characters"),
        ("participant", "a" * 65, "printable text of 1 to 64 characters"),
        ("condition", "a" * 3000, "printable text of 1 to 64 characters"),
        ("condition", "", "column 'condition' is empty"),
        ("trial", "0", "a whole number of at least 1"),
        ("trial", "1.5", "a whole number of at least 1"),
        ("trial", "99999999999999999999", "a whole number"),
        ("block", "-2", "a whole number of at least -1"),
        ("block", "-1", "0 or more in any but a control trial"),
        ("level_vpp", "-60", "a number above 0, in a blank trial 0 or n/a"),
        ("level_vpp", "nan", "a number above 0"),
        ("level_vpp", "inf", "a number above 0"),
        ("level_vpp", "1e400", "a number above 0"),
        ("level_vpp", "60 V", "a number above 0"),
        ("level_vpp", "6_0", "a number above 0"),
        ("level_vpp", "٦٠", "a number above 0"),
        ("rt_s", "-0.1", "a finite number of at least 0 or n/a"),
        ("rt_s", "", "column 'rt_s' is empty"),
        ("rt_s", "NaN", "a finite number"),
        ("onset_s", "-inf", "a finite number or n/a"),
        ("foreperiod_s", "n/a", "a finite number of at least 0"),
        ("anticipated", "True", "true or false"),
        ("anticipated", "n/a", "true or false"),
        ("noise_ok", "1", "true, false or n/a"),
        ("correct", "yes", "true, false or n/a"),
    ],
)
def test_a_cell_that_is_not_allowed_is_named(
    tmp_path: Path, column: str, text: str, allowed: str
) -> None:
    path = write_cell(tmp_path / "trials.csv", column, text)
    error = refused(path)
    assert (error.file, error.line) == (str(path), 3)
    assert str(error).startswith(f"{path}:3: column '{column}' ")
    assert allowed in str(error)


@pytest.mark.parametrize(
    ("changes", "column"),
    [
        ({"kind": "single", "side": "both"}, "side"),
        ({"kind": "single", "side": "none", "level_vpp": None}, "side"),
        ({"kind": "both", "side": "left"}, "side"),
        ({"kind": "blank", "side": "left"}, "side"),
        ({"level_vpp": None}, "level_vpp"),
        ({"level_vpp": 0.0}, "level_vpp"),
        ({"kind": "practice", "level_vpp": None}, "level_vpp"),
        ({"kind": "blank", "side": "none"}, "level_vpp"),
        ({"response": None, "rt_s": None}, "response"),
        ({"response": None, "status": "aborted"}, "rt_s"),
        ({"response": "timeout"}, "rt_s"),
        ({"correct": False}, "correct"),
        ({"response": "both", "correct": True}, "correct"),
        ({"response": None, "rt_s": None, "status": "aborted", "correct": False}, "correct"),
    ],
)
def test_a_row_that_contradicts_itself_is_refused(
    tmp_path: Path, changes: dict[str, Any], column: str
) -> None:
    error = refused(write(tmp_path / "trials.csv", row(1), row(2, **changes), row(3)))
    assert error.line == 3
    assert f"column '{column}' is " in str(error)
    assert "it must be" in str(error)


def test_marks_of_direction_in_a_name_are_spelled_out(tmp_path: Path) -> None:
    path = write_cell(tmp_path / "trials.csv", "participant", "\u202eab\u200f")
    assert "<U+202E>ab<U+200F>" in read_trials([path])["participant"].tolist()


def test_the_first_line_that_is_wrong_is_the_one_named(tmp_path: Path) -> None:
    rows = [row(1), row(2, correct=False), row(3, level_vpp=None), row(4, kind="both")]
    assert refused(write(tmp_path / "trials.csv", *rows)).line == 3


def test_a_blank_trial_has_no_level_however_it_is_written(tmp_path: Path) -> None:
    blank: dict[str, Any] = {"kind": "blank", "side": "none", "response": "none"}
    rows = [row(1, level_vpp=None, **blank), row(2, level_vpp=0.0, **blank)]
    assert read_trials([write(tmp_path / "trials.csv", *rows)])["level_vpp"].isna().all()


def test_a_missing_verdict_is_filled_in(tmp_path: Path) -> None:
    path = write(tmp_path / "trials.csv", row(1, correct=None), row(2, side="right", correct=None))
    assert read_trials([path])["correct"].tolist() == [True, False]


def test_milliseconds_are_noticed(tmp_path: Path) -> None:
    error = refused(write(tmp_path / "trials.csv", row(1), row(2, rt_s=612.0), row(3, rt_s=590.0)))
    assert error.line == 3
    assert "median of 590 s in this file, allowed at most 10 s" in str(error)
    assert '[units] rt_s = "ms"' in str(error)


def test_a_trial_told_twice_is_refused(tmp_path: Path) -> None:
    error = refused(write(tmp_path / "trials.csv", row(1), row(2), row(1)))
    assert error.line == 4
    assert str(error).endswith(f"attempt as {tmp_path / 'trials.csv'}:2")


def test_a_trial_told_in_two_files_is_refused(tmp_path: Path) -> None:
    first, second = write(tmp_path / "a.csv", row(1)), write(tmp_path / "b.csv", row(2), row(1))
    error = refused(first, second)
    assert (error.file, error.line) == (str(second), 3)
    assert f"{first}:2" in str(error)


def test_two_valid_attempts_of_one_trial_are_refused(tmp_path: Path) -> None:
    voided = row(1, status="voided")
    assert len(read_trials([write(tmp_path / "trials.csv", voided, row(1, attempt=2))])) == 2
    error = refused(write(tmp_path / "trials.csv", row(1), row(1, attempt=2)))
    assert error.line == 3
    assert "status ok" in str(error)


HEADER, LINE = trials_csv([BASE]).splitlines(keepends=True)


def without(column: str) -> str:
    position = [c.name for c in COLUMNS].index(column)
    lines = [line.split(",") for line in (HEADER, LINE)]
    return "".join(",".join(c[:position] + c[position + 1 :]) for c in lines)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LINE, "the header names column '1' twice"),
        (without("rt_s"), "no column rt_s; a table made elsewhere needs --columns MAP.toml"),
        (f"colour,{HEADER}red,{LINE}", "unknown column 'colour'"),
        (f"side,{HEADER}left,{LINE}", "the header names column 'side' twice"),
        (f"\ufeff{HEADER}{LINE}", "UTF-8 without BOM"),
        ((HEADER + LINE).replace(",", ";"), "separated by semicolons"),
    ],
)
def test_another_header_is_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "trials.csv"
    path.write_text(text, encoding="utf-8")
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
    assert "no such file or folder" in str(refused(tmp_path / "none.csv"))
    assert "no sub-*/ses-*/trials.csv" in str(refused(tmp_path))
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    assert str(tmp_path / "loop") in str(refused(tmp_path / "loop"))
    assert "cannot be read" in str(refused(tmp_path / ("x" * 300)))
    with pytest.raises(ValueError, match="paths must name at least one"):
        read_trials([])


def test_a_folder_that_cannot_be_read_is_never_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "sub-1" / "ses-01" / "trials.csv", row(1))
    (tmp_path / "sub-2").mkdir()
    list_folder = type(tmp_path).iterdir

    def locked(folder: Path) -> Iterator[Path]:
        if folder.name == "sub-2":
            raise PermissionError(13, "Permission denied", str(folder))
        return list_folder(folder)

    monkeypatch.setattr(type(tmp_path), "iterdir", locked)
    assert str(refused(tmp_path)) == f"{tmp_path / 'sub-2'}: cannot be read: Permission denied"


@pytest.mark.slow
@settings(
    deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.integers(0, 500), st.binary(min_size=1, max_size=3), st.booleans())
def test_a_damaged_file_is_read_or_refused_with_its_line(
    tmp_path: Path, position: int, damage: bytes, insert: Any
) -> None:
    raw = (HEADER + LINE + LINE.replace("main,1,1,", "main,1,2,")).encode()
    place = len(HEADER) + position % (2 * len(LINE))
    path = tmp_path / "trials.csv"
    path.write_bytes(raw[:place] + damage + raw[place if insert else place + len(damage) :])
    try:
        outcome = len(read_trials([path]))
    except ResultFileError as error:
        outcome = -(error.line or 0)
    assert outcome in {1, 2, -1, -2, -3, -4}


def test_the_same_file_named_twice_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "sub-1" / "ses-01" / "trials.csv", row(1))
    (tmp_path / "other.csv").symlink_to(path)
    assert "the same contents as" in str(refused(path, path))
    assert "the same contents as" in str(refused(tmp_path, path))
    assert "the same contents as" in str(refused(path, tmp_path / "other.csv"))


@pytest.mark.parametrize("columns", [None, ColumnMap()])
def test_a_copy_of_a_table_is_refused(tmp_path: Path, columns: ColumnMap | None) -> None:
    first, copy = write(tmp_path / "a.csv", row(1)), tmp_path / "b.csv"
    copy.write_bytes(first.read_bytes())
    with pytest.raises(ResultFileError, match="the same contents as") as caught:
        read_trials([first, copy], columns)
    assert caught.value.file == str(copy)


def test_a_copy_that_numbers_no_trials_does_not_double_the_data(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("participant,side,level_vpp,response\n1,left,60,left\n")
    with pytest.raises(ResultFileError, match="the same contents as"):
        read_trials([tmp_path / "a.csv", tmp_path / "b.csv"], ColumnMap())


def test_the_names_of_inputs_tell_the_files_apart(tmp_path: Path) -> None:
    for number in ("1", "2"):
        table = tmp_path / f"sub-{number}" / "ses-01" / "trials.csv"
        write(table, row(1, participant=number))
    (tmp_path / "sub-1" / "ses-02").mkdir()
    loaded = read_inputs([tmp_path / "sub-1", tmp_path / "sub-2"])
    names = [f"sub-{number}/ses-01/trials.csv" for number in ("1", "2")]
    assert [file.name for file in loaded.inputs] == names
    assert loaded.without_table == ("sub-1/ses-02",)
    tables = [tmp_path / name for name in names]
    assert [file.name for file in read_inputs(tables).inputs] == names


def test_a_folder_whose_only_session_was_killed_names_the_remedy(tmp_path: Path) -> None:
    (tmp_path / "sub-1" / "ses-01").mkdir(parents=True)
    assert "tactstrip export DIR builds it" in str(refused(tmp_path))


def test_a_participant_with_the_name_of_the_total_is_refused(tmp_path: Path) -> None:
    error = refused(write(tmp_path / "trials.csv", row(1), row(2, participant="all")))
    assert error.line == 3
    assert "column 'participant' is all; it must be another name" in str(error)


def test_a_name_with_a_line_end_stays_on_one_line(tmp_path: Path) -> None:
    assert "a\\nb.csv" in str(refused(tmp_path / "a\nb.csv"))


@pytest.mark.parametrize("fault", [False, True])
@pytest.mark.parametrize("name", ["trials.csv", "plan.json"])
def test_a_file_that_changes_while_others_are_read_is_refused(
    tmp_path: Path, name: str, *, fault: bool
) -> None:
    for person in ("1", "2"):
        write(tmp_path / f"sub-{person}" / "ses-01" / "trials.csv", row(1, participant=person))
    changing = tmp_path / "sub-1" / "ses-01" / name
    if fault:
        write_cell(tmp_path / "sub-2" / "ses-01" / "trials.csv", "side", "top")

    @contextmanager
    def watched(sources: Sequence[InputTable]) -> Iterator[Iterator[InputTable]]:
        def ask() -> Iterator[InputTable]:
            yield from sources
            with changing.open("a", encoding="utf-8") as file:
                file.write("\n")

        yield ask()

    with pytest.raises(ResultFileError) as caught:
        read_inputs([tmp_path], watched=watched)
    words = "changed while it was read; analyze it when nothing writes there any more"
    assert str(caught.value) == f"{changing}: {words}"


def test_a_table_that_is_a_dead_link_is_never_passed_over(tmp_path: Path) -> None:
    write(tmp_path / "sub-1" / "ses-01" / "trials.csv", row(1))
    (tmp_path / "sub-2" / "ses-01").mkdir(parents=True)
    (tmp_path / "sub-2" / "ses-01" / "trials.csv").symlink_to(tmp_path / "gone.csv")
    message = f"{tmp_path / 'sub-2' / 'ses-01' / 'trials.csv'}: no such file or folder"
    assert str(refused(tmp_path)) == message


def test_a_session_that_cannot_be_entered_is_never_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "sub-1" / "ses-01" / "trials.csv", row(1))
    locked = tmp_path / "sub-2" / "ses-01"
    locked.mkdir(parents=True)
    enter = type(tmp_path).lstat

    def refuse(path: Path) -> os.stat_result:
        if path.parent == locked:
            raise PermissionError(13, "Permission denied", str(path))
        return enter(path)

    monkeypatch.setattr(type(tmp_path), "lstat", refuse)
    assert str(refused(tmp_path)) == f"{locked / 'trials.csv'}: cannot be read: Permission denied"
