"""The text of a table in chunks of rows: bounded in memory, each fault with its file and line."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, islice
from typing import TYPE_CHECKING, BinaryIO, Final

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path


_MAX_SHOWN = 60


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
DELIMITERS: Final[Mapping[str, str]] = {
    ",": "commas",
    ";": "semicolons",
    "\t": "tabs",
    "|": "vertical bars",
    " ": "spaces",
}
"""What may stand between the columns of an external table."""
ELSEWHERE: Final = "an external table needs --columns MAP.toml, which tactstrip columns proposes"
TWICE: Final = " (twice)"
"""What a name has behind it that a heading has more than once: nobody can tell which is meant."""
SEPARATORS = ",;\t|"
"""Those of them that a heading shows; spaces stand in names, too."""
NUMBER: Final = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?", re.ASCII)
_SPACED: Final = re.compile(r'"[^"]*"( "[^"]*")+')
_HEADING_LINES: Final = 16
_MIN_ROWS_BELOW_HEADING: Final = 3
# UTF-32 first: in little-endian order its mark begins with that of UTF-16.
_MARKS: Final = (
    ("UTF-32", codecs.BOM_UTF32_LE),
    ("UTF-32", codecs.BOM_UTF32_BE),
    ("UTF-16", codecs.BOM_UTF16_LE),
    ("UTF-16", codecs.BOM_UTF16_BE),
    ("UTF-8-sig", codecs.BOM_UTF8),
)
_PACKED = b"PK\x03\x04"
_ESCAPED = re.compile("[\udc80-\udcff]")
_SAVE: Final = "save the table as UTF-8 text"

Chunk = tuple[list[int], list[list[str]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class TextFormat:
    """How an external table is written; what is empty text is seen in the file."""

    delimiter: str = ""  # one of `DELIMITERS`
    encoding: str = ""  # as Python names it; else by the byte order mark, or UTF-8
    quoted: bool = True  # cells may stand in quotation marks


def text_chunks(
    stream: BinaryIO, file: str, *, form: TextFormat | None = None, empty_allowed: bool = False
) -> tuple[list[str], Iterator[Chunk]]:
    r"""Read a table as its header and chunks of at most `CHUNK_ROWS` rows of text.

    Without a `form` it must be as this program writes it: commas, UTF-8 without a mark. With one,
    lines without a value are passed over, columns may be without a name, and names that stand twice
    have `TWICE` behind them. A chunk has the lines on which its rows begin, and their cells; with
    `empty_allowed` a header alone is one chunk without rows. Of the stream nothing is read beyond
    the first fault.

    Raises ResultFileError for an empty file, a header alone, a doubled column, another delimiter, a
    row with too few or too many fields, text of another encoding, a NUL or a line over `MAX_LINE`
    characters; for what is wrong below the header, when its chunk is asked for.

    >>> header, chunks = text_chunks(io.BytesIO(b"side,rt_s\nleft,0.5\n"), "t.csv")
    >>> header, next(chunks)
    (['side', 'rt_s'], ([2], [['left', '0.5']]))
    """
    records = _records(stream, file, form)
    _, header = next(records, (0, []))
    if fault := _header_fault(header, form):
        raise ResultFileError(file, 1, fault)
    if form and (first := next(records, None)):
        records = chain([first], records)
        if len(first[1]) == len(header) + 1 and first[1][0] == "1":
            header = ["", *header]  # R writes row names, which count the rows, without a heading
    counts = Counter(header)
    header = [f"{name}{TWICE}" if name and counts[name] > 1 else name for name in header]
    return header, _chunks(records, len(header), file, empty_allowed=empty_allowed)


def _header_fault(header: list[str], form: TextFormat | None) -> str:
    """Return what is wrong with a header; empty text if it is accepted."""
    if not any(header):
        return "the file is empty, or its first line is not a header"
    if header[0].lower().startswith("sep="):
        return "this line names Excel's separator, no columns: delete it"
    if form:
        is_data = all(NUMBER.fullmatch(name) for name in header if name)
        numbers = "the first line looks like numbers, not like a heading; add a line with names"
        return numbers if is_data else ""
    likely = max(SEPARATORS, key=",".join(header).count)
    if likely != ",":
        seem = f"the columns seem to be separated by {DELIMITERS[likely]}"
        return f"{seem}; only commas are read; {ELSEWHERE}"
    name, number = Counter(header).most_common(1)[0]
    return f"the header names column {shown(name)} twice" if number > 1 else ""


def _chunks(
    records: Iterator[tuple[int, list[str]]], width: int, file: str, *, empty_allowed: bool
) -> Iterator[Chunk]:
    chunk = list(islice(records, CHUNK_ROWS))
    if not chunk:
        if not empty_allowed:
            raise ResultFileError(file, 1, "a header and no trials below it")
        yield [], []
    while chunk:
        for line, row in chunk:
            if len(row) != width:
                which = "few" if len(row) < width else "many"
                message = f"too {which} fields: {len(row)}, not {width}"
                empty = f"an empty line; each row has {width} fields"
                raise ResultFileError(file, line, message if row else empty)
        yield [line for line, _ in chunk], [row for _, row in chunk]
        chunk = list(islice(records, CHUNK_ROWS))


def _records(
    stream: BinaryIO, file: str, form: TextFormat | None
) -> Iterator[tuple[int, list[str]]]:
    """Yield each record with the line on which it begins."""
    lines = _lines(stream, file, form)
    start = list(islice(lines, _HEADING_LINES if form else 1))
    reader = csv.reader(
        chain(start, lines),
        strict=True,
        delimiter=_choose_delimiter(start, file, form) if form else ",",
        quoting=csv.QUOTE_MINIMAL if form is None or form.quoted else csv.QUOTE_NONE,
    )
    begins = 1
    try:
        for row in reader:
            if form is None or begins == 1 or any(row):
                yield begins, row
            begins = reader.line_num + 1
    except csv.Error as error:
        message = f"not a well-formed CSV record, or a quotation mark is never closed ({error})"
        raise ResultFileError(file, begins, message) from None


def _choose_delimiter(start: list[str], file: str, form: TextFormat) -> str:
    """Return the delimiter under which the heading and the first rows have equally many fields.

    A heading alone does not decide: a name or a comment may contain another delimiter. Of several
    such delimiters, the one with most fields is returned. Without any, the heading decides, unless
    the rows agree with a later line that has more fields.
    """
    heading = start[0] if start else ""
    if form.delimiter and not form.quoted:
        return form.delimiter
    if not form.delimiter and _SPACED.fullmatch(heading.rstrip("\r\n")):
        return " "
    signs = form.delimiter or SEPARATORS
    fields = {sign: _count_fields(start, sign) for sign in signs}
    if not any(fields.values()):
        _refuse_lines_above_heading(start, file, signs)
        return max(signs, key=re.sub('"[^"]*"', "", heading).count)
    likely = [sign for sign in signs if fields[sign] == max(fields.values())]
    if len(likely) > 1:
        could = " or ".join(DELIMITERS[sign] for sign in likely)
        message = f"the columns may be separated by {could}; [file] delimiter of a map says which"
        raise ResultFileError(file, 1, message)
    return likely[0]


def _refuse_lines_above_heading(start: list[str], file: str, signs: str) -> None:
    """Refuse a table whose rows agree with a later line that has more fields than the first."""
    if any(line.count('"') % 2 for line in start):
        return  # cells of several lines
    first_width = 1 + max((line.count(sign) for line in start[:1] for sign in signs), default=0)
    for above in range(1, len(start) - _MIN_ROWS_BELOW_HEADING):
        for sign in signs:
            names = start[above].strip().split(sign)
            if not first_width < len(names) == _count_fields(start[above:], sign):
                continue
            if not any(not name or NUMBER.fullmatch(name) for name in names):
                message = f"the heading seems to be line {above + 1}; delete the lines above it"
                raise ResultFileError(file, 1, message)


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
    # Bytes that are no text become single signs, so that they are refused with their line:
    # otherwise all that was read ahead would fail at once.
    text = io.TextIOWrapper(
        stream,
        _find_encoding(stream, file, form),
        errors="surrogateescape",
        newline="\n" if form is None else "",
    )
    state = ", or state [file] encoding in the map (tactstrip columns proposes it)" if form else ""
    number = 0
    try:
        while line := text.readline(MAX_LINE + 1):
            number += 1
            if len(line) > MAX_LINE:
                message = f"the line is longer than {MAX_LINE} signs; this is no table of trials"
                raise ResultFileError(file, number, message)
            if "\0" in line:
                raise ResultFileError(file, number, f"a NUL byte; {_SAVE}")
            if not line.isascii() and (bad := _ESCAPED.search(line)):
                message = f"byte 0x{ord(bad[0]) - 0xDC00:02x} is not UTF-8; {_SAVE}{state}"
                raise ResultFileError(file, number, message)
            yield line
    except UnicodeError as error:
        message = f"is not text in {text.encoding} ({error.args[-1]}); {_SAVE}"
        raise ResultFileError(file, number + 1, message) from None
    finally:
        with suppress(ValueError):  # who opened the stream may have closed it
            text.detach()


def _find_encoding(stream: BinaryIO, file: str, form: TextFormat | None) -> str:
    """Return the encoding that the map states or the byte order mark shows; UTF-8 without both."""
    if form and form.encoding:
        return form.encoding
    start = stream.read(4)
    stream.seek(-len(start), io.SEEK_CUR)
    if start.startswith(_PACKED):
        raise ResultFileError(file, None, "a workbook (.xlsx) or packed file; save it as CSV")
    marked = next((encoding for encoding, mark in _MARKS if start.startswith(mark)), "")
    if not marked and (unmarked := guess_unmarked_utf_16(start)):
        message = "a NUL byte; the text is probably UTF-16 without a byte order mark"
        state = f'state [file] encoding = "{unmarked}" in the map, or ' if form else ""
        raise ResultFileError(file, 1, f"{message}; {state}{_SAVE}")
    if form or not marked:
        return marked or "UTF-8"
    message = f"the text is {marked}; save it as UTF-8"
    if marked == "UTF-8-sig":
        message = (
            "the file begins with a byte order mark: if tactstrip wrote it, a spreadsheet has "
            f"rewritten it: take the original, or save it as UTF-8 without BOM; {ELSEWHERE}"
        )
    raise ResultFileError(file, 1, message)


def guess_unmarked_utf_16(start: bytes) -> str:
    """Return the byte order of UTF-16 that a text without a mark seems to have, else empty text.

    >>> guess_unmarked_utf_16("a,b".encode("utf-16-le")), guess_unmarked_utf_16(b"a,b")
    ('utf-16-le', '')
    """
    first, second = bool(start[:1].strip(b"\0")), bool(start[1:2].strip(b"\0"))
    if len(start) < 2 or first == second:  # noqa: PLR2004 (bytes of a sign)
        return ""
    return "utf-16-le" if first else "utf-16-be"


_MAX_NAMED = 5


def named(names: Sequence[str]) -> str:
    """List the first of some names and say how many there are besides.

    >>> named(["a", "b"]), named("abcdefg")
    ('a, b', 'a, b, c, d, e and 2 more')
    """
    more = f" and {len(names) - _MAX_NAMED} more" if len(names) > _MAX_NAMED else ""
    return ", ".join(name[:_MAX_SHOWN] for name in names[:_MAX_NAMED]) + more
