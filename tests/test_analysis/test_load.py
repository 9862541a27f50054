"""Reading trials.csv: what is read, and every refusal with its file and line."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis import ColumnMap, ResultFileError, read_trials
from analysis.reading.load import read_inputs
from analysis.reading.text import CHUNK_ROWS
from experiment.terms.record import COLUMNS, TrialRow, table_csv
from tests.test_analysis.shared import LEAST, put, refused, row, write

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from analysis.reading.sources import InputTable

HEADER, LINE = table_csv(TrialRow, [row()]).splitlines(keepends=True)
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
    cells = table_csv(TrialRow, [row(2)]).splitlines()[1].split(",")
    cells[NAMES.index(column)] = text
    return put(path, HEADER + LINE + ",".join(cells) + "\n")


def test_every_column_comes_back_as_it_was_recorded(tmp_path: Path) -> None:
    blank = row(2, kind="blank", side="none", level_vpp=None, response="none", noise_ok=None)
    trials = read(tmp_path, row(), blank)
    assert list(trials.columns) == [*NAMES, "file", "line", "none_offered", "reason", "fault"]
    for name in NAMES:
        for found, written in zip(trials[name], (row(), blank), strict=True):
            expected = getattr(written, name)
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
    table = pd.DataFrame(
        [line.split(",") for line in table_csv(TrialRow, [row(), row(2)]).splitlines()]
    )
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


@pytest.mark.parametrize(
    ("column", "text", "words"),
    [
        ("side", "top", "left, right, both or none"),
        ("kind", "null", "single, both, blank, practice or control"),
        ("response", "Left", "left, right, both, none, timeout, invalid or n/a"),
        ("status", "fine", "ok, device_error, indeterminate, aborted or voided"),
        ("displacement_basis", "guess", "measured, predicted or n/a"),
        ("schema", "1", "allowed: 2"),
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
def test_a_cell_that_cannot_be_is_named(tmp_path: Path, column: str, text: str, words: str) -> None:
    path = write_cell(tmp_path / "trials.csv", column, text)
    error = refused(path)
    assert (error.file, error.line) == (str(path), 3)
    assert str(error).startswith(f"{path}:3: column '{column}' ")
    assert words in str(error)


def test_a_table_of_another_version_is_refused_by_its_schema(tmp_path: Path) -> None:
    header, line = table_csv(TrialRow, [row()]).splitlines()
    old = [",".join(cells.split(",")[:-2]) for cells in (header, line)]
    path = put(tmp_path / "trials.csv", f"{old[0]}\n1{old[1][1:]}\n")
    assert str(refused(path)).startswith(f"{path}:2: schema must be 2; got 1")


@pytest.mark.parametrize(
    ("changes", "column", "must"),
    [
        ({"participant": "all"}, "participant", "another name"),
        ({"kind": "single", "side": "both"}, "side", "left or right in a"),
        (
            {"kind": "single", "side": "none", "level_vpp": None},
            "side",
            "left or right in a",
        ),
        ({"kind": "both", "side": "left"}, "side", "both in a both"),
        ({"kind": "blank", "side": "left"}, "side", "none in a blank"),
        ({"level_vpp": None}, "level_vpp", "a number"),
        ({"level_vpp": 0.0}, "level_vpp", "a number"),
        ({"kind": "practice", "level_vpp": None}, "level_vpp", "a number"),
        ({"kind": "blank", "side": "none"}, "level_vpp", "0 or n/a"),
        ({"response": None, "rt_s": None}, "response", "an answer, timeout or invalid"),
        ({"response": None, "status": "aborted"}, "rt_s", "n/a where there was no answer"),
        ({"response": "timeout"}, "rt_s", "n/a where there was no answer"),
        ({"correct": False}, "correct", "what kind, side and response say"),
        ({"response": "both", "correct": True}, "correct", "what kind, side and response say"),
        (
            {"response": None, "rt_s": None, "status": "aborted", "correct": False},
            "correct",
            "what kind, side and response say",
        ),
    ],
)
def test_contradictions_are_refused(tmp_path: Path, changes: Any, column: str, must: str) -> None:
    error = refusal(tmp_path, row(), row(2, **changes), row(3))
    assert error.line == 3
    assert f"column '{column}' is " in str(error)
    assert f"it must be {must}" in str(error)


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
    assert "median of 590 s for participant 007, allowed 0.01 to 10 s" in str(error)
    assert '[units] rt_s = "ms"' in str(error)


def test_a_trial_told_twice_is_refused(tmp_path: Path) -> None:
    error = refusal(tmp_path, row(), row(2), row())
    assert error.line == 4
    assert str(error).endswith(f"attempt as {tmp_path / 'trials.csv'}:2")
    first, second = write(tmp_path / "a.csv", row()), write(tmp_path / "b.csv", row(2), row())
    error = refused(first, second)
    assert (error.file, error.line) == (str(second), 3)
    assert f"{first}:2" in str(error)


def test_two_valid_attempts_of_one_trial_are_refused(tmp_path: Path) -> None:
    assert len(read(tmp_path, row(status="voided"), row(attempt=2))) == 2
    error = refusal(tmp_path, row(), row(attempt=2))
    assert error.line == 3
    assert "status ok" in str(error)


def without(column: str) -> str:
    table = pd.DataFrame([line.rstrip("\n").split(",") for line in (HEADER, LINE)])
    return table.drop(columns=NAMES.index(column)).to_csv(index=False, header=False)


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
    assert "no such file or folder" in str(refused(tmp_path / "none.csv"))
    assert "a\\nb.csv" in str(refused(tmp_path / "a\nb.csv"))
    assert "no sub-*/ses-*/trials.csv" in str(refused(tmp_path))
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    assert str(tmp_path / "loop") in str(refused(tmp_path / "loop"))
    assert "cannot be read" in str(refused(tmp_path / ("x" * 300)))
    (tmp_path / "sub-1" / "ses-01").mkdir(parents=True)
    assert "no session in this folder has a trials.csv; nothing was" in str(refused(tmp_path))
    with pytest.raises(ValueError, match="paths must name at least one"):
        read_trials([])


@pytest.mark.parametrize(
    ("method", "place"), [("iterdir", "sub-2"), ("lstat", "sub-2/ses-01/trials.csv")]
)
def test_what_cannot_be_entered_is_never_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str, place: str
) -> None:
    session(tmp_path, "1")
    (tmp_path / "sub-2" / "ses-01").mkdir(parents=True)
    locked, look = tmp_path / place, getattr(type(tmp_path), method)

    def refuse(path: Path) -> Iterator[Path] | os.stat_result:
        if path == locked:
            raise PermissionError(13, "Permission denied", str(path))
        found: Iterator[Path] | os.stat_result = look(path)
        return found

    monkeypatch.setattr(type(tmp_path), method, refuse)
    assert str(refused(tmp_path)) == f"{locked}: cannot be read: Permission denied"


def test_a_table_that_is_a_dead_link_is_never_passed_over(tmp_path: Path) -> None:
    link = session(tmp_path, "2")
    link.unlink()
    link.symlink_to(tmp_path / "gone.csv")
    session(tmp_path, "1")
    assert str(refused(tmp_path)).startswith(f"{link}: must not be a symbolic link")


@pytest.mark.slow
@settings(
    deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.integers(0, 500), st.binary(min_size=1, max_size=3), st.booleans())
def test_damage_is_read_or_refused_with_its_line(
    tmp_path: Path, at: int, damage: bytes, insert: Any
) -> None:
    raw = (HEADER + LINE + LINE.replace("main,1,1,", "main,1,2,")).encode()
    place = len(HEADER) + at % (2 * len(LINE))
    path = tmp_path / "trials.csv"
    path.write_bytes(raw[:place] + damage + raw[place if insert else place + len(damage) :])
    try:
        outcome = len(read_trials([path]))
    except ResultFileError as error:
        outcome = -(error.line or 0)
    assert outcome in {1, 2, -1, -2, -3, -4}


def test_the_same_file_named_twice_is_refused(tmp_path: Path) -> None:
    path = session(tmp_path, "1")
    (tmp_path / "other.csv").symlink_to(path)
    for paths in ((path, path), (tmp_path, path), (path, tmp_path / "other.csv")):
        assert "the same contents as" in str(refused(*paths))


@pytest.mark.parametrize(
    ("text", "columns"),
    [(HEADER + LINE, None), (LEAST + "1,left,60,left\n", ColumnMap())],
    ids=["own", "a table that numbers no trials"],
)
def test_a_copy_of_a_table_is_refused(tmp_path: Path, text: str, columns: ColumnMap | None) -> None:
    paths = [put(tmp_path / name, text) for name in ("a.csv", "b.csv")]
    error = refused(*paths, columns=columns)
    assert error.file == str(paths[1])
    assert "the same contents as" in str(error)


def test_the_names_of_inputs_tell_the_files_apart(tmp_path: Path) -> None:
    tables = [session(tmp_path, "1"), session(tmp_path, "2")]
    (tmp_path / "sub-1" / "ses-02").mkdir()
    found = read_inputs([tmp_path / "sub-1", tmp_path / "sub-2"])
    names = [f"sub-{number}/ses-01/trials.csv" for number in ("1", "2")]
    assert [file.name for file in found.inputs] == names
    assert found.without_table == {"sub-1/ses-02": "nothing was recorded in it"}
    assert [file.name for file in read_inputs(tables).inputs] == names


@pytest.mark.parametrize("fault", [False, True])
@pytest.mark.parametrize("name", ["trials.csv", "plan.json"])
def test_a_file_that_changes_meanwhile_is_refused(
    tmp_path: Path, name: str, *, fault: bool
) -> None:
    changing, other = session(tmp_path, "1").with_name(name), session(tmp_path, "2")
    if fault:
        write_cell(other, "side", "top")

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
