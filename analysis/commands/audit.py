"""The command ``audit``: whether a published table of proportions is possible."""

from __future__ import annotations

import io
import json
import re
import sys
import textwrap
from pathlib import Path
from typing import Any

import click

from analysis.audit import Printed, PrintedRow
from analysis.reading.text import ResultFileError, one_line, shown
from device.printing import echo
from experiment.exits import ANSWER_IS_NO, refusals
from experiment.templates import open_templates

LABEL_COLUMNS = ("level_vpp", "level", "label")
REQUIRED_COLUMNS = ("min", "mean", "max")
OPTIONAL_COLUMNS = ("n", "participants")
_COUNT = re.compile(r"[0-9]{1,9}", re.ASCII)
_RANGE = re.compile(r"([0-9]{1,9})(?:-([0-9]{1,9}))?", re.ASCII)
_MAX_LABEL_CHARACTERS, _MAX_COUNTS_LISTED, _MAX_BYTES = 64, 12, 1_000_000
_MISSING = ("", "n/a")


def read_table(path: Path) -> tuple[PrintedRow, ...]:
    r"""Read a table of printed proportions.

    The CSV file has the columns `REQUIRED_COLUMNS`, one of `LABEL_COLUMNS`, and optionally those of
    `OPTIONAL_COLUMNS`: ``n`` is the number of stimuli per participant, or a range such as 20-40.

    Raises ResultFileError, with the line number, for any other file.

    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "t.csv"
    ...     _ = file.write_text("level,min,mean,max,n\n60,0.45,0.86,0.9,20-40\n")
    ...     [row] = read_table(file)
    >>> row.label, row.trials, row.participants
    ('60', (20, 40), None)
    """
    from analysis.reading.sources import read_regular, unreadable
    from analysis.reading.text import TextFormat, text_chunks

    name = str(path)
    try:
        content = read_regular(path, _MAX_BYTES)
    except OSError as error:
        raise unreadable(error, path) from None
    except ValueError as error:
        raise ResultFileError(path, None, str(error)) from None
    header, chunks = text_chunks(io.BytesIO(content), name, form=TextFormat(), empty_allowed=True)
    rows = [
        (line, dict(zip(header, cells, strict=True)))
        for lines, chunk in chunks
        for line, cells in zip(lines, chunk, strict=True)
    ]
    label = _check_columns(header, name)
    if not rows:
        raise ResultFileError(path, 1, "a header and no rows below it")
    return tuple(_parse_row(line, cells, label, name) for line, cells in rows)


def _check_columns(columns: list[str], file: str) -> str:
    """Return the column that names the rows; reject unknown and missing columns."""
    allowed = (*LABEL_COLUMNS, *REQUIRED_COLUMNS, *OPTIONAL_COLUMNS)
    for column in columns:
        if column not in allowed:
            message = f"unknown column {shown(column)}; known are {', '.join(allowed)}"
            raise ResultFileError(file, 1, message)
    missing = [name for name in REQUIRED_COLUMNS if name not in columns]
    if missing:
        raise ResultFileError(file, 1, f"no column {', '.join(missing)}")
    labels = [name for name in LABEL_COLUMNS if name in columns]
    if len(labels) != 1:
        present = ", ".join(labels) or "none"
        message = f"one of {', '.join(LABEL_COLUMNS)} must name the rows, got {present}"
        raise ResultFileError(file, 1, message)
    return labels[0]


def _parse_row(line: int, cells: dict[str, str], label: str, file: str) -> PrintedRow:
    if not 1 <= len(cells[label]) <= _MAX_LABEL_CHARACTERS:
        message = f"column '{label}' must have 1 to {_MAX_LABEL_CHARACTERS} characters"
        raise ResultFileError(file, line, f"{message}, got {shown(cells[label])}")
    try:
        minimum, mean, maximum = (Printed(text=cells[name].strip()) for name in REQUIRED_COLUMNS)
        return PrintedRow(
            label=cells[label],
            least=minimum,
            mean=mean,
            largest=maximum,
            trials=_parse_trials(cells.get("n", "").strip()),
            participants=_parse_participants(cells.get("participants", "").strip()),
        )
    except ValueError as error:
        raise ResultFileError(file, line, str(error)) from None


def _parse_trials(text: str) -> tuple[int, int] | None:
    if text in _MISSING:
        return None
    match = _RANGE.fullmatch(text)
    if match is None:
        raise ValueError(f"n must be a number or a range such as 20-40, got {shown(text)}")
    return int(match[1]), int(match[2] or match[1])


def _parse_participants(text: str) -> int | None:
    if text in _MISSING:
        return None
    if not _COUNT.fullmatch(text):
        raise ValueError(f"participants must be a whole number, got {shown(text)}")
    return int(text)


def format_audit(report: dict[str, Any]) -> str:
    """Format an audit as text."""
    text = open_templates(str(__package__), {"one_line": one_line}).get_template("audit.txt.jinja")
    return text.render(report=report, max_counts=_MAX_COUNTS_LISTED)


_WIDTH = 80


def _wrap_line(line: str) -> str:
    """Wrap a line at 80 columns, and escape characters that the terminal cannot print."""
    indent = " " * (len(line) - len(line.lstrip()) + 2)
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    printable = line.encode(encoding, "backslashreplace").decode(encoding)
    return textwrap.fill(printable, _WIDTH, subsequent_indent=indent)


@click.command(epilog="Example: tactstrip audit table.csv")
@click.argument("table", metavar="TABLE.csv", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of text.")
@refusals
def audit(table: Path, *, as_json: bool) -> None:
    """Check whether a published table of proportions is arithmetically possible.

    The columns min, mean and max hold the proportions over participants as printed; level_vpp,
    level or label names the row. Optional columns are participants and n, the number of stimuli per
    participant (such as 30 or 20-40). The exit code is 1 if a row is impossible both with rounding
    and with truncation.
    """
    from analysis.audit import audit_rows

    report = audit_rows(read_table(table))
    if as_json:
        echo(json.dumps(report, allow_nan=False))
    else:
        for line in format_audit(report).split("\n"):
            echo(*_wrap_line(line).split("\n"))
    if not report["possible"]:
        click.get_current_context().exit(ANSWER_IS_NO)
