"""The command ``audit``: a printed table read from CSV, and whether it can be true."""

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
from experiment.terms.exits import ANSWER_IS_NO, refusals

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analysis.audit.rows import Audit, ReadingVerdict, RowAudit


LABELS = ("level_vpp", "level", "label")
NEEDED = ("min", "mean", "max")
OPTIONAL = ("n", "participants")
_COUNT = re.compile(r"[0-9]{1,9}", re.ASCII)
_RANGE = re.compile(r"([0-9]{1,9})(?:-([0-9]{1,9}))?", re.ASCII)
_LONGEST_LABEL, _MOST_LISTED, _MOST_BYTES = 64, 12, 1_000_000
_UNKNOWN = ("", "n/a")


def read_table(path: Path) -> tuple[PrintedRow, ...]:
    r"""Read a table of printed proportions.

    A CSV file with the columns `NEEDED`, one of `LABELS`, and `OPTIONAL` ones: ``n`` stimuli of
    each participant, a number or a range such as 20-40.

    Raises ResultFileError for anything that is no such table, with its line.

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
        raw = read_regular(path, _MOST_BYTES)
    except OSError as error:
        raise unreadable(error, path) from None
    except ValueError as error:
        raise ResultFileError(path, None, str(error)) from None
    header, chunks = text_chunks(io.BytesIO(raw), name, form=TextFormat(), empty_allowed=True)
    rows = [
        (line, dict(zip(header, cells, strict=True)))
        for lines, some in chunks
        for line, cells in zip(lines, some, strict=True)
    ]
    label = _check_columns(header, name)
    if not rows:
        raise ResultFileError(path, 1, "a header and no rows below it")
    return tuple(_row(line, cells, label, name) for line, cells in rows)


def _check_columns(columns: list[str], file: str) -> str:
    """Refuse other columns, and return the one that names the rows."""
    known = (*LABELS, *NEEDED, *OPTIONAL)
    for column in columns:
        if column not in known:
            message = f"unknown column {shown(column)}; known are {', '.join(known)}"
            raise ResultFileError(file, 1, message)
    missing = [name for name in NEEDED if name not in columns]
    if missing:
        raise ResultFileError(file, 1, f"no column {', '.join(missing)}")
    labels = [name for name in LABELS if name in columns]
    if len(labels) != 1:
        told = ", ".join(labels) or "none"
        raise ResultFileError(file, 1, f"one of {', '.join(LABELS)} must name the rows, got {told}")
    return labels[0]


def _row(line: int, cells: dict[str, str], label: str, file: str) -> PrintedRow:
    if not 1 <= len(cells[label]) <= _LONGEST_LABEL:
        message = f"column '{label}' must have 1 to {_LONGEST_LABEL} characters"
        raise ResultFileError(file, line, f"{message}, got {shown(cells[label])}")
    try:
        least, mean, largest = (Printed(text=cells[name].strip()) for name in NEEDED)
        return PrintedRow(
            label=cells[label],
            least=least,
            mean=mean,
            largest=largest,
            trials=_trials(cells.get("n", "").strip()),
            participants=_participants(cells.get("participants", "").strip()),
        )
    except ValueError as error:
        raise ResultFileError(file, line, str(error)) from None


def _trials(text: str) -> tuple[int, int] | None:
    if text in _UNKNOWN:
        return None
    found = _RANGE.fullmatch(text)
    if found is None:
        raise ValueError(f"n must be a number or a range such as 20-40, got {shown(text)}")
    return int(found[1]), int(found[2] or found[1])


def _participants(text: str) -> int | None:
    if text in _UNKNOWN:
        return None
    if not _COUNT.fullmatch(text):
        raise ValueError(f"participants must be a whole number, got {shown(text)}")
    return int(text)


def audit_lines(found: Audit) -> Iterator[str]:
    """Tell an audit in words, a line at a time."""
    yield (
        f"{len(found.rows)} rows; {found.decimals} decimals, of which zeros at the end may have "
        "been dropped. Means are taken as unweighted over participants."
    )
    for row in found.rows:
        yield from _row_lines(row)
    if found.exchange_fits:
        yield f"Some order of the means fits all rows ({', '.join(found.exchange_fits)})."
    else:
        yield "No order of the means fits all rows."
    impossible = [one_line(row.row.label) for row in found.rows if not row.possible]
    told = ", ".join(impossible) if impossible else "none"
    yield f"Impossible under every reading: {told}."


def _row_lines(found: RowAudit) -> Iterator[str]:
    row = found.row
    numbers = f"{row.least.text}, {row.mean.text}, {row.largest.text}"
    state = "possible" if found.possible else "impossible"
    yield f"{one_line(row.label)}: least, mean, largest {numbers}: {state}"
    for verdict in found.verdicts:
        yield f"  {verdict.reading}: {'; '.join(verdict.reasons) or 'possible'}"
        if verdict.reasons:
            fitting = ", ".join(verdict.fitting_means) or "none"
            yield f"    means of this table that would fit: {fitting}"
        yield from _trials_lines(verdict)
    if not found.possible and found.possible_as_shown:
        how = " or ".join(found.possible_as_shown)
        yield f"  possible only if no zeros were dropped and each number was {how} to what it shows"


def _trials_lines(verdict: ReadingVerdict) -> Iterator[str]:
    told = {"least": verdict.least_trials, "largest": verdict.largest_trials}
    for name, numbers in told.items():
        if numbers and len(numbers) <= _MOST_LISTED:
            yield f"    the {name} value needs n = {', '.join(map(str, numbers))}"


def audit_json(found: Audit) -> str:
    """Write an audit as one JSON object: what was found of the table, then of each of its rows."""
    rows = [
        {
            "label": one.row.label,
            "min": one.row.least.text,
            "mean": one.row.mean.text,
            "max": one.row.largest.text,
            "n": one.row.trials,
            "participants": one.row.participants,
            "possible": one.possible,
            "possible_as_shown": one.possible_as_shown,
            "readings": [asdict(v) | {"possible": v.possible} for v in one.verdicts],
        }
        for one in found.rows
    ]
    told = {
        "schema": 1,
        "possible": found.possible,
        "decimals": found.decimals,
        "readings": list(READINGS),
        "exchange_fits": found.exchange_fits,
        "rows": rows,
    }
    return json.dumps(told, allow_nan=False)


_WIDTH = 80


def _fitting(line: str) -> str:
    """Break a line for 80 columns, and write in ASCII what the terminal cannot."""
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

    found = audit_rows(read_table(table))
    if as_json:
        click.echo(audit_json(found))
    else:
        for line in audit_lines(found):
            click.echo(_fitting(line))
    if not found.possible:
        click.get_current_context().exit(ANSWER_IS_NO)
