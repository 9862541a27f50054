"""The text of a table in chunks of rows: bounded in memory, each fault with its file and line."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, islice, product
from typing import TYPE_CHECKING, BinaryIO, Final

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path


_MAX_SHOWN, _MAX_NAMED = 60, 5


class ResultFileError(ValueError):
    """A file of results, or what belongs to it, cannot be read as what it claims to be.

    Parameters
    ----------
    file : str or Path
        The file or folder as the caller named it.
    line : int or None
        Line of the fault, the header is line 1; ``None`` where the fault has no line.
    message : str
        One sentence: column, value, and what is allowed.

    Examples
    --------
    >>> str(ResultFileError("trials.csv", 7, "column 'side' holds 'top'"))
    "trials.csv:7: column 'side' holds 'top'"
    """

    def __init__(self, file: str | Path, line: int | None, message: str) -> None:
        self.file = str(file)
        self.line = line
        self.message = one_line(message)
        location = one_line(self.file) if line is None else f"{one_line(self.file)}:{line}"
        super().__init__(f"{location}: {self.message}")


def one_line(text: str) -> str:
    r"""Return a text as one printable line, control characters escaped.

    >>> one_line("a.csv"), one_line("a\nb.csv")
    ('a.csv', 'a\\nb.csv')
    """
    return text if text.isprintable() else repr(text)[1:-1]


def shown(value: str) -> str:
    """Quote a cell for a message, cut short where it is long.

    >>> shown("top"), len(shown("x" * 10_000)) < 80
    ("'top'", True)
    """
    cut = value if len(value) <= _MAX_SHOWN else value[:_MAX_SHOWN] + "..."
    return repr(cut)


MAX_LINE = 65_536
CHUNK_ROWS = 4_096
SEPARATORS: Final = ",;\t|"
"""What may separate the columns of an external table; between quoted names, a space may, too."""
ELSEWHERE: Final = "an external table needs --columns MAP.toml, which tactstrip columns proposes"
TWICE: Final = " (twice)"
"""Appended to a name that a heading has more than once, which is therefore ambiguous."""
NUMBER: Final = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?", re.ASCII)
_QUOTED: Final = re.compile(r'"[^"]*"')
_SPACED: Final = re.compile(rf"{_QUOTED.pattern}( {_QUOTED.pattern})+")
_HEADING_LINES: Final = 16
# UTF-32 first: in little-endian order its mark begins with that of UTF-16.
_MARKS: Final = {
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
    codecs.BOM_UTF8: "UTF-8-sig",
}
_ESCAPED = re.compile("[\udc80-\udcff]")

Chunk = tuple[list[int], list[list[str]]]
"""The lines on which rows begin, and their cells."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TextFormat:
    """How an external table is written; what is empty text is seen in the file."""

    delimiter: str = ""  # one of `SEPARATORS` or a space
    encoding: str = ""  # as Python names it; else by the byte order mark, or UTF-8


def text_chunks(
    stream: BinaryIO, file: str, *, form: TextFormat | None = None, empty_allowed: bool = False
) -> tuple[list[str], Iterator[Chunk]]:
    r"""Read a table as its header and chunks of at most `CHUNK_ROWS` rows of text.

    Without a `form` it must be as this program writes it: commas, UTF-8. With one, lines without a
    value are passed over. Names that stand twice have `TWICE` behind them. A chunk has the lines
    on which its rows begin, and their cells; with `empty_allowed` a header alone is one chunk
    without rows. Of the stream nothing is read beyond the first fault.

    Raises ResultFileError for an empty file, a header alone, a row with too few or too many fields,
    text of another encoding, a NUL or a line over `MAX_LINE` characters; for what is wrong below
    the header, when its chunk is read.

    >>> header, chunks = text_chunks(io.BytesIO(b"side,rt_s\nleft,0.5\n"), "t.csv")
    >>> header, next(chunks)
    (['side', 'rt_s'], ([2], [['left', '0.5']]))
    """
    records = _records(_lines(stream, file, form), file, form)
    _, header = next(records, (1, []))
    if not any(header):
        message = "the file is empty, or its first line is not a header"
        raise ResultFileError(file, 1, message)
    if form and all(NUMBER.fullmatch(name) for name in header if name):
        message = "the first line looks like numbers, not like a heading; add a line with names"
        raise ResultFileError(file, 1, message)
    if form and (first := next(records, None)):
        records = chain([first], records)
        if len(first[1]) == len(header) + 1 and first[1][0] == "1":
            header = ["", *header]  # R writes row names, which count the rows, without a heading
    counts = Counter(header)
    header = [f"{name}{TWICE}" if name and counts[name] > 1 else name for name in header]
    return header, _chunks(records, len(header), file, empty_allowed=empty_allowed)


def _chunks(
    records: Iterator[tuple[int, list[str]]], width: int, file: str, *, empty_allowed: bool
) -> Iterator[Chunk]:
    chunk = list(islice(records, CHUNK_ROWS))
    if not (chunk or empty_allowed):
        raise ResultFileError(file, 1, "a header and no trials below it")
    while chunk or empty_allowed:
        for line, row in chunk:
            if len(row) != width:
                message = f"the heading has {width} fields, this row {len(row)}"
                raise ResultFileError(file, line, message)
        yield [line for line, _ in chunk], [row for _, row in chunk]
        chunk, empty_allowed = list(islice(records, CHUNK_ROWS)), False


def _records(
    lines: Iterator[str], file: str, form: TextFormat | None
) -> Iterator[tuple[int, list[str]]]:
    """Yield each record with the line on which it begins."""
    start = list(islice(lines, _HEADING_LINES if form else 1))
    delimiter = ","
    if form:
        delimiter = form.delimiter or _choose_delimiter(start, file)
    reader = csv.reader(chain(start, lines), strict=True, delimiter=delimiter)
    begins = 1
    try:
        for row in reader:
            if form is None or begins == 1 or any(row):
                yield begins, row
            begins = reader.line_num + 1
    except csv.Error as error:
        message = f"not a well-formed CSV record, or a quotation mark is never closed ({error})"
        raise ResultFileError(file, begins, message) from None


def _choose_delimiter(start: list[str], file: str) -> str:
    """Return the delimiter under which the heading and the first rows have equally many fields.

    A heading alone does not decide: a name or a comment may contain another delimiter. Of several
    such delimiters, the one with most fields is returned. Without any, the table is refused if its
    rows agree with a later line that has more names, for that is the heading. Otherwise its first
    line decides, and the first row that does not fit is refused in its turn.
    """
    heading = start[0].rstrip() if start else ""
    if _SPACED.fullmatch(heading):
        return " "
    widths = {sign: _count_fields(start, sign) for sign in SEPARATORS}
    likely = [sign for sign in SEPARATORS if widths[sign] == max(widths.values())]
    if len(likely) == 1:
        return likely[0]
    if any(widths.values()):
        could = " or ".join(map(repr, likely))
        message = f"the columns may be separated by {could}; [file] delimiter of a map says which"
        raise ResultFileError(file, 1, message)
    width = 1 + max(map(heading.count, SEPARATORS))
    for above, sign in product(range(1, len(start) - 1), SEPARATORS):
        names = start[above].strip().split(sign)
        are_names = all(name and not NUMBER.fullmatch(name) for name in names)
        if width < len(names) == _count_fields(start[above:], sign) and are_names:
            message = f"the heading seems to be line {above + 1}; delete the lines above it"
            raise ResultFileError(file, 1, message)
    return max(SEPARATORS, key=_QUOTED.sub("", heading).count)


def _count_fields(start: list[str], delimiter: str) -> int:
    """Return how many fields the heading and all rows have; 0 if they differ or have only one.

    Tables of R may have one field more in each row: the number of the row, without a heading.
    """
    try:
        rows = list(csv.reader(start, delimiter=delimiter))
    except csv.Error:
        return 0
    is_cut = len(start) == _HEADING_LINES and sum(line.count('"') for line in start) % 2
    heading, *rows = [row for row in rows[: -1 if is_cut else None] if any(row)] or [[]]
    width = len(heading)
    has_row_names = bool(rows) and len(rows[0]) == width + 1 and rows[0][0] == "1"
    agree = {len(row) for row in rows} == {width + has_row_names}
    return width if agree and width > 1 else 0


def _lines(stream: BinaryIO, file: str, form: TextFormat | None) -> Iterator[str]:
    encoding = (form.encoding if form else "") or _find_encoding(stream, file, form)
    # Bytes that are no text become single signs, so that they are refused with their line:
    # otherwise all that was read ahead would fail at once.
    newline = "\n" if form is None else ""
    text = io.TextIOWrapper(stream, encoding, errors="surrogateescape", newline=newline)
    remedy = "save the table as UTF-8 text"
    if form:
        remedy += ", or state [file] encoding in the map (tactstrip columns proposes it)"
    number = 0
    try:
        while line := text.readline(MAX_LINE + 1):
            number += 1
            if len(line) > MAX_LINE:
                message = f"the line is longer than {MAX_LINE} signs; this is no table of trials"
                raise ResultFileError(file, number, message)
            if "\0" in line:
                raise ResultFileError(file, number, f"a NUL byte, as of UTF-16; {remedy}")
            if not line.isascii() and (bad := _ESCAPED.search(line)):
                message = f"byte 0x{ord(bad[0]) - 0xDC00:02x} is not {encoding}; {remedy}"
                raise ResultFileError(file, number, message)
            yield line
    except UnicodeError as error:
        message = f"is not text in {encoding} ({error.args[-1]}); {remedy}"
        raise ResultFileError(file, number + 1, message) from None
    finally:
        with suppress(ValueError):  # who opened the stream closes it, or has closed it already
            text.detach()


def _find_encoding(stream: BinaryIO, file: str, form: TextFormat | None) -> str:
    """Return the encoding that a byte order mark shows; UTF-8 without one."""
    start = stream.read(4)
    stream.seek(0)
    if start == b"PK\x03\x04":
        raise ResultFileError(file, None, "a workbook (.xlsx) or packed file; save it as CSV")
    encoding = next((_MARKS[mark] for mark in _MARKS if start.startswith(mark)), "UTF-8")
    if form is None and encoding not in {"UTF-8", "UTF-8-sig"}:
        message = (
            f"the file begins with a byte order mark ({encoding}), which tactstrip does not write: "
            f"take the original, or save it as UTF-8; {ELSEWHERE}"
        )
        raise ResultFileError(file, 1, message)
    return encoding


def named(names: Sequence[str]) -> str:
    """List the first of some names and say how many there are besides.

    >>> named(["a", "b"]), named("abcdefg")
    ('a, b', 'a, b, c, d, e and 2 more')
    """
    more = f" and {len(names) - _MAX_NAMED} more" if len(names) > _MAX_NAMED else ""
    return ", ".join(name[:_MAX_SHOWN] for name in names[:_MAX_NAMED]) + more
