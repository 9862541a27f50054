"""The command ``audit``: whether a published table of proportions is possible."""

from __future__ import annotations

import io
import json
import re
import sys
import textwrap
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from analysis.audit.printed import Printed
from analysis.audit.rows import READINGS, PrintedRow
from analysis.reading.text import ResultFileError, one_line, shown
from device.printing import echo
from experiment.exits import ANSWER_IS_NO, refusals

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analysis.audit.rows import Audit, ReadingVerdict, RowAudit


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


def format_audit(report: Audit) -> Iterator[str]:
    """Format an audit as lines of text."""
    yield (
        f"{len(report.rows)} rows; {report.decimals} decimals, of which zeros at the end may have "
        "been dropped. Means are taken as unweighted over participants."
    )
    for row in report.rows:
        yield from _format_row(row)
    if report.exchange_fits:
        yield f"Some order of the means fits all rows ({', '.join(report.exchange_fits)})."
    else:
        yield "No order of the means fits all rows."
    impossible = [one_line(row.row.label) for row in report.rows if not row.possible]
    labels = ", ".join(impossible) if impossible else "none"
    yield f"Impossible under every reading: {labels}."


def _format_row(audited: RowAudit) -> Iterator[str]:
    row = audited.row
    numbers = f"{row.least.text}, {row.mean.text}, {row.largest.text}"
    state = "possible" if audited.possible else "impossible"
    yield f"{one_line(row.label)}: least, mean, largest {numbers}: {state}"
    for verdict in audited.verdicts:
        yield f"  {verdict.reading}: {'; '.join(verdict.reasons) or 'possible'}"
        if verdict.reasons:
            fitting = ", ".join(verdict.fitting_means) or "none"
            yield f"    means of this table that would fit: {fitting}"
        yield from _format_trials(verdict)
    if not audited.possible and audited.possible_as_shown:
        readings = " or ".join(audited.possible_as_shown)
        yield (
            f"  possible only if no zeros were dropped and each number was {readings} to what it "
            "shows"
        )


def _format_trials(verdict: ReadingVerdict) -> Iterator[str]:
    counts = {"least": verdict.least_trials, "largest": verdict.largest_trials}
    for name, trials in counts.items():
        if trials and len(trials) <= _MAX_COUNTS_LISTED:
            yield f"    the {name} value needs n = {', '.join(map(str, trials))}"


def audit_json(report: Audit) -> str:
    """Format an audit as one JSON object: results for the table, then for each row."""
    rows = [
        {
            "label": audited.row.label,
            "min": audited.row.least.text,
            "mean": audited.row.mean.text,
            "max": audited.row.largest.text,
            "n": audited.row.trials,
            "participants": audited.row.participants,
            "possible": audited.possible,
            "possible_as_shown": audited.possible_as_shown,
            "readings": [asdict(v) | {"possible": v.possible} for v in audited.verdicts],
        }
        for audited in report.rows
    ]
    summary = {
        "schema": 1,
        "possible": report.possible,
        "decimals": report.decimals,
        "readings": list(READINGS),
        "exchange_fits": report.exchange_fits,
        "rows": rows,
    }
    return json.dumps(summary, allow_nan=False)


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
    from analysis.audit.rows import audit as audit_rows

    report = audit_rows(read_table(table))
    if as_json:
        echo(*audit_json(report).split("\n"))
    else:
        for line in format_audit(report):
            echo(*_wrap_line(line).split("\n"))
    if not report.possible:
        click.get_current_context().exit(ANSWER_IS_NO)
