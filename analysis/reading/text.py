"""The text of a CSV file in chunks of rows: bounded in memory, each fault with file and line."""

from __future__ import annotations

import codecs
import csv
from itertools import islice
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path


_LONGEST_SHOWN = 60


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
        place = one_line(self.file) if line is None else f"{one_line(self.file)}:{line}"
        super().__init__(f"{place}: {message}")


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
    cut = value if len(value) <= _LONGEST_SHOWN else value[:_LONGEST_SHOWN] + "..."
    return repr(cut)


MAX_LINE_BYTES = 65_536
CHUNK_ROWS = 4_096

# UTF-32 first: in little-endian order its mark begins with that of UTF-16.
_OTHER_MARKS = {
    "UTF-32": (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE),
    "UTF-16": (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE),
}
_OTHER_DELIMITERS = {";": "semicolons", "\t": "tabs", "|": "vertical bars"}

Chunk = tuple[list[int], list[list[str]]]


def text_chunks(
    stream: BinaryIO, file: str, *, bom_allowed: bool = False, empty_allowed: bool = False
) -> tuple[list[str], Iterator[Chunk]]:
    r"""Read a comma-separated file as its header and chunks of at most `CHUNK_ROWS` rows of text.

    A chunk has the lines on which its rows begin, and their cells; with `empty_allowed` a header
    alone is one chunk without rows. Of the stream nothing is read beyond the first fault.

    Raises ResultFileError for an empty file, a header alone, a doubled column, another delimiter, a
    row with too few or too many fields, text that is not UTF-8, a NUL byte or a line over
    `MAX_LINE_BYTES`; for what is wrong below the header, when its chunk is asked for.

    >>> import io
    >>> header, chunks = text_chunks(io.BytesIO(b"side,rt_s\nleft,0.5\n"), "t.csv")
    >>> header, next(chunks)
    (['side', 'rt_s'], ([2], [['left', '0.5']]))
    """
    records = _records(stream, file, bom_allowed=bom_allowed)
    _, header = next(records, (0, []))
    _check_header(header, file)
    return header, _chunks(records, len(header), file, empty_allowed=empty_allowed)


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
                raise ResultFileError(file, line, _wrong_width(row, width))
        yield [line for line, _ in chunk], [row for _, row in chunk]
        chunk = list(islice(records, CHUNK_ROWS))


def _records(stream: BinaryIO, file: str, *, bom_allowed: bool) -> Iterator[tuple[int, list[str]]]:
    """Yield each record with the line on which it begins."""
    reader = csv.reader(_lines(stream, file, bom_allowed=bom_allowed), strict=True)
    begins = 1
    try:
        for row in reader:
            yield begins, row
            begins = reader.line_num + 1
    except csv.Error as error:
        message = f"not a well-formed CSV record, or a quotation mark is never closed ({error})"
        raise ResultFileError(file, begins, message) from None


def _lines(stream: BinaryIO, file: str, *, bom_allowed: bool) -> Iterator[str]:
    number = 0
    while raw := stream.readline(MAX_LINE_BYTES + 1):
        number += 1
        if number == 1:
            raw = _without_mark(raw, file, bom_allowed=bom_allowed)
        if len(raw) > MAX_LINE_BYTES:
            message = f"the line is longer than {MAX_LINE_BYTES} bytes; this is no table of trials"
            raise ResultFileError(file, number, message)
        if b"\0" in raw:
            raise ResultFileError(file, number, "a NUL byte; save the table as UTF-8 text")
        try:
            yield raw.decode()
        except UnicodeDecodeError as error:
            bad = raw[error.start]
            message = f"byte 0x{bad:02x} is not UTF-8; save the table as UTF-8 text"
            raise ResultFileError(file, number, message) from None


def _without_mark(raw: bytes, file: str, *, bom_allowed: bool) -> bytes:
    for encoding, marks in _OTHER_MARKS.items():
        if raw.startswith(marks):
            raise ResultFileError(file, 1, f"the text is {encoding}; save it as UTF-8")
    if not raw.startswith(codecs.BOM_UTF8):
        return raw
    if not bom_allowed:
        message = (
            "the file begins with a byte order mark, so a spreadsheet has rewritten it; "
            "take the original, or save it as UTF-8 without BOM"
        )
        raise ResultFileError(file, 1, message)
    return raw.removeprefix(codecs.BOM_UTF8)


def _check_header(header: list[str], file: str) -> None:
    if not header:
        raise ResultFileError(file, 1, "the file is empty, or its first line is not a header")
    joined = ",".join(header)
    likely = max(_OTHER_DELIMITERS, key=joined.count)
    if joined.count(likely) > joined.count(","):
        message = (
            f"the columns seem to be separated by {_OTHER_DELIMITERS[likely]}; only commas are read"
        )
        raise ResultFileError(file, 1, message)
    for position, name in enumerate(header):
        if name in header[:position]:
            raise ResultFileError(file, 1, f"the header names column {shown(name)} twice")


def _wrong_width(row: list[str], expected: int) -> str:
    if not row:
        return f"an empty line; each row has {expected} fields"
    return f"too {'few' if len(row) < expected else 'many'} fields: {len(row)}, not {expected}"


_NAMED = 5


def named(names: Sequence[str]) -> str:
    """List the first of some names and say how many there are besides.

    >>> named(["a", "b"]), named("abcdefg")
    ('a, b', 'a, b, c, d, e and 2 more')
    """
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
