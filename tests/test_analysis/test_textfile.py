"""The text of a CSV file: chunks with their lines, and every malformed byte with its line."""

from __future__ import annotations

import contextlib
import io
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis import ResultFileError
from analysis.reading.text import CHUNK_ROWS, MAX_LINE, SEPARATORS, Chunk, TextFormat, text_chunks
from tests.test_analysis.shared import draft

if TYPE_CHECKING:
    from pathlib import Path

BROKEN: list[tuple[bytes, int, str]] = [
    (b"", 1, r"t\.csv"),
    (b"\n", 1, r"t\.csv"),
    (b"a,b\n", 1, r"t\.csv"),
    ("a,b\n".encode("utf-8-sig"), 1, "header"),
    ("a,b\n1,2\n".encode("utf-16"), 1, "UTF-16"),
    ("a,b\n1,2\n".encode("utf-16-be"), 1, "NUL"),
    ("\ufeffa,b\n1,2\n".encode("utf-16-be"), 1, "UTF-16"),
    ("a,b\n1,2\n".encode("utf-32"), 1, "UTF-32"),
    ("\ufeffa,b\n1,2\n".encode("utf-32-be"), 1, "UTF-32"),
    (b"a,b\n1,2\n3,\xe9\n", 3, "0xe9"),
    (b"a,b\n1,2\n3,\xf0\x9f\n", 3, "0xf0"),
    (b"a,b\n1,2\n\0,4\n", 3, "NUL"),
    (b"a,b\n1,2\n3\n", 3, "the heading has 2 fields, this row 1"),
    (b"a,b\n1,2\n3,4,5\n", 3, "the heading has 2 fields, this row 3"),
    (b"a,b\n1,2\n\n3,4\n", 3, "the heading has 2 fields, this row 0"),
    (b'a,b\n1,2\n"3,4\n5,6\n', 3, r"t\.csv"),
    (b'a,b\n1,2\n"3"x,4\n', 3, r"t\.csv"),
    (b"a,b\r1,2\r", 1, r"t\.csv"),
    (b"a,b\n1,2\n" + b"x" * (MAX_LINE + 1), 3, "65536"),
    (b'a,b\n1,"' + b"x\n" * 200_000, 2, r"t\.csv"),
]


def read(stream: io.BytesIO, form: TextFormat | None = None) -> list[Chunk]:
    _, chunks = text_chunks(stream, "t.csv", form=form)
    return list(chunks)


@pytest.mark.parametrize(("raw", "line", "message"), BROKEN, ids=range(len(BROKEN)))
def test_a_malformed_file_is_refused_with_its_line(raw: bytes, line: int, message: str) -> None:
    with pytest.raises(ResultFileError, match=message) as caught:
        read(io.BytesIO(raw))
    assert (caught.value.file, caught.value.line) == ("t.csv", line)
    assert "\n" not in str(caught.value)


def test_nothing_is_read_beyond_the_fault() -> None:
    stream = io.BytesIO(b"a,b\n" + b"x" * 10_000_000)
    with pytest.raises(ResultFileError, match="65536"):
        read(stream)
    assert stream.tell() < 2 * MAX_LINE


def test_a_byte_order_mark_of_utf_8_is_no_part_of_the_heading() -> None:
    header, chunks = text_chunks(io.BytesIO("a,b\n1,2\n".encode("utf-8-sig")), "t.csv")
    assert (header, list(chunks)) == (["a", "b"], [([2], [["1", "2"]])])


def test_rows_keep_the_line_on_which_they_begin() -> None:
    [(lines, rows)] = read(io.BytesIO(b'a,b\n1,"x\ny"\n2,z\n'))
    assert (lines, rows) == ([2, 4], [["1", "x\ny"], ["2", "z"]])
    [(_, rows)] = read(io.BytesIO(b"a,b\n1,2"))  # a last line without an end
    assert rows == [["1", "2"]]


def test_chunks_are_bounded_and_together_are_the_file() -> None:
    number = 2 * CHUNK_ROWS + 1
    raw = b"a,b\n" + b"1,2\n" * number
    sizes = [len(rows) for _, rows in read(io.BytesIO(raw))]
    assert sizes == [CHUNK_ROWS, CHUNK_ROWS, 1]


@pytest.mark.parametrize(
    "raw",
    [
        b"a;b\n1;2\n",
        b"a\tb\r\n1\t2\r\n",
        b"a|b\r1|2\r",
        b'"a;x";b\n1;2\n'.replace(b"a;x", b"a"),
        b"a,b\n,\n\n1,2\n,\n\n",
        "a;b\n1;2\n".encode("utf-8-sig"),
        "a,b\r\n1,2\r\n".encode("utf-16"),
        "a\tb\n1\t2\n".encode("utf-32"),
    ],
)
def test_a_table_made_elsewhere_says_by_itself_how_it_is_written(raw: bytes) -> None:
    header, chunks = text_chunks(io.BytesIO(raw), "t.csv", form=TextFormat())
    assert (header, [row for _, rows in chunks for row in rows]) == (["a", "b"], [["1", "2"]])


def test_a_heading_that_could_be_read_in_two_ways_is_refused() -> None:
    with pytest.raises(ResultFileError, match=r"\[file\] delimiter"):
        read(io.BytesIO(b"a,b;c\n1,2;3\n"), TextFormat())
    [(_, rows)] = read(io.BytesIO(b"a,b;c\n1,2;3\n"), TextFormat(delimiter=";"))
    assert rows == [["1,2", "3"]]


@pytest.mark.parametrize(
    ("heading", "row", "names"),
    [
        ("person,level,notes", "a,1,ok; calm", ["person", "level", "notes"]),
        ("person,level,notes", "a;x,1,", ["person", "level", "notes"]),
        ("person,level,notes", "a,1,;;;;;;;;", ["person", "level", "notes"]),
        ("person;id,level,felt", "a;1,2,0", ["person;id", "level", "felt"]),
        ("level (x,y);felt;rt", "1;0;0,5", ["level (x,y)", "felt", "rt"]),
        ("level, V;felt;rt", "1;0;5", ["level, V", "felt", "rt"]),
        ('person,"the, notes"', 'a,"two\nlines; here"', ["person", "the, notes"]),
        ("person,level,notes", "1,a,1,ok; calm", ["", "person", "level", "notes"]),
    ],
)
@pytest.mark.parametrize("number", [1, 9, 40])
def test_the_delimiter_gives_heading_and_rows_the_same_number_of_fields(
    heading: str, row: str, names: list[str], number: int
) -> None:
    raw = "\n".join([heading, *[row] * number, ""]).encode()
    header, chunks = text_chunks(io.BytesIO(raw), "t.csv", form=TextFormat())
    assert header == names
    assert sum(len(rows) for _, rows in chunks) == number


def test_a_broken_row_is_refused_with_its_line_whatever_signs_are_in_cells() -> None:
    raw = b"person,level,notes\n" + b"a,1,ok; calm\n" * 3 + b"a;b\n" + b"a,1,ok; calm\n" * 9
    with pytest.raises(ResultFileError, match="the heading has 3 fields, this row 1") as caught:
        read(io.BytesIO(raw), TextFormat())
    assert caught.value.line == 5


@pytest.mark.parametrize("encoding", ["utf_16_le", "utf_16_be"])
def test_utf_16_without_a_mark_is_refused_and_proposed(tmp_path: Path, encoding: str) -> None:
    raw = "person,level,felt\na,1,1\na,2,0\n".encode(encoding)
    with pytest.raises(ResultFileError, match=r"t\.csv:1: a NUL byte.*\[file\] encoding"):
        read(io.BytesIO(raw), TextFormat())
    table = tmp_path / "t.csv"
    table.write_bytes(raw)
    assert draft(table).map["file"]["encoding"] == encoding


def test_a_table_in_an_encoding_of_two_bytes_is_proposed_as_it_reads(tmp_path: Path) -> None:
    words = "被験者,試行,回答\n" + "太郎,1,はい\n花子,2,いいえ\n" * 20
    table = tmp_path / "t.csv"
    table.write_bytes(words.encode("shift_jis"))
    made = draft(table)
    assert made.fill_in[1] == "encoding"
    assert '"cp932" reads 被験者,試行,回答' in made.text
    assert "cp1252" not in made.text


def test_an_encoding_is_stated_or_refused_with_its_line() -> None:
    raw = "a,b\n1,2\né,4\n".encode("cp1252")
    with pytest.raises(ResultFileError, match=r"t\.csv:3: .*0xe9"):
        read(io.BytesIO(raw), TextFormat())
    [(_, rows)] = read(io.BytesIO(raw), TextFormat(encoding="cp1252"))
    assert rows == [["1", "2"], ["é", "4"]]
    with pytest.raises(ResultFileError, match="utf-16"):
        read(io.BytesIO(raw + b"x"), TextFormat(encoding="utf-16"))


@pytest.mark.slow
@settings(deadline=None, max_examples=150)
@given(
    raw=st.binary(max_size=200),
    form=st.none()
    | st.builds(
        TextFormat,
        delimiter=st.sampled_from(["", " ", *SEPARATORS]),
        encoding=st.sampled_from(["", "utf-16", "utf-32", "cp1252", "utf-7"]),
    ),
)
def test_any_bytes_are_a_table_or_a_refusal(raw: bytes, form: TextFormat | None) -> None:
    with contextlib.suppress(ResultFileError):
        for lines, rows in read(io.BytesIO(raw), form):
            assert len(lines) == len(rows)
            assert all(isinstance(cell, str) for row in rows for cell in row)
