"""The command ``audit``: whether a published table of proportions is possible."""

from __future__ import annotations

import io
import json
import textwrap
from typing import TYPE_CHECKING, Any, Final

import click

from analysis.reading.text import ResultFileError, one_line, shown
from device.printing import echo
from experiment.commands.options.common import PATH, json_option
from experiment.exits import ANSWER_IS_NO, refusals
from experiment.templates import open_templates

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from analysis.audit import PrintedRow

LABEL_COLUMNS: Final = ("level_vpp", "level", "label")
_MAX_COUNTS_LISTED, _WIDTH = 12, 80
_OF_HEADER: Final = {"missing": "column {} is missing", "extra_forbidden": "unknown column {}"}


def read_table(path: Path) -> tuple[PrintedRow, ...]:
    r"""Read a table of printed proportions.

    The CSV file has the columns ``min mean max``, one of `LABEL_COLUMNS`, and optionally
    ``participants`` and ``n``, the number of stimuli per participant, or a range such as 20-40.

    Raises ResultFileError, with the line number, for any other file.

    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "t.csv"
    ...     _ = file.write_text("level,min,mean,max,n\n60,0.45,0.86,0.9,20-40\n")
    ...     [row] = read_table(file)
    >>> row.label, row.n, row.participants
    ('60', (20, 40), None)
    """
    from analysis.reading.sources import unreadable
    from analysis.reading.text import TextFormat, text_chunks
    from experiment.bounded import read_bounded

    try:
        content = read_bounded(path)
    except OSError as error:
        raise unreadable(error, path) from None
    table = io.BytesIO(content)
    header, chunks = text_chunks(table, str(path), form=TextFormat(), empty_allowed=True)
    rows = [row for lines, chunk in chunks for row in zip(lines, chunk, strict=True)]
    labels = [name for name in header if name in LABEL_COLUMNS]
    if len(labels) != 1:
        present = ", ".join(labels) or "none"
        message = f"one of {', '.join(LABEL_COLUMNS)} must name the rows, got {present}"
        raise ResultFileError(path, 1, message)
    if not rows:
        raise ResultFileError(path, 1, "a header and no rows below it")
    return tuple(_parse_row(path, line, header, cells) for line, cells in rows)


def _parse_row(path: Path, line: int, header: list[str], cells: Sequence[str]) -> PrintedRow:
    from pydantic import ValidationError

    from analysis.audit import PrintedRow

    names = ["label" if name in LABEL_COLUMNS else name for name in header]
    try:
        return PrintedRow.model_validate(dict(zip(names, cells, strict=True)))
    except ValidationError as error:
        fault = error.errors()[0]
        name = str(fault["loc"][0])
        if fault["type"] in _OF_HEADER:
            message = _OF_HEADER[fault["type"]].format(shown(name))
            raise ResultFileError(path, 1, message) from None
        at = names.index(name)
        message = f"column {shown(header[at])}: {fault['msg']}, got {shown(cells[at])}"
        raise ResultFileError(path, line, message.replace("Value error, ", "")) from None


def format_audit(report: dict[str, Any]) -> str:
    """Format an audit as text."""
    text = open_templates(str(__package__), {"one_line": one_line}).get_template("audit.txt.jinja")
    return text.render(report=report, max_counts=_MAX_COUNTS_LISTED)


@click.command(epilog="Example: tactstrip audit table.csv")
@click.argument("table", metavar="TABLE.csv", type=PATH)
@json_option
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
            indent = " " * (len(line) - len(line.lstrip()) + 2)
            echo(*textwrap.wrap(line, _WIDTH, subsequent_indent=indent))
    if not report["possible"]:
        click.get_current_context().exit(ANSWER_IS_NO)
