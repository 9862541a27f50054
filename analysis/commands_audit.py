"""The command ``audit``: whether a published table can be true."""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path

import click

from experiment.exits import ANSWER_IS_NO, refusals

_WIDTH = 80


def _fitting(line: str) -> str:
    """Break a line for 80 columns, and write in ASCII what the terminal cannot."""
    indent = " " * (len(line) - len(line.lstrip()) + 2)
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    printable = line.encode(encoding, "backslashreplace").decode(encoding)
    return textwrap.fill(printable, _WIDTH, subsequent_indent=indent)


@click.command()
@click.argument("table", metavar="TABLE.csv", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead.")
@refusals
def audit(table: Path, *, as_json: bool) -> None:
    """Tell which rows of a printed table of proportions are impossible.

    Columns: level_vpp, level or label; min, mean and max over participants as printed; if known n,
    stimuli of each participant (30, or 20-40), and participants. Exit 1 if a row is impossible
    whether its numbers were rounded or truncated.
    """
    from analysis.audit import audit as audit_rows
    from analysis.audit_table import audit_json, audit_lines, read_table

    found = audit_rows(read_table(table))
    if as_json:
        click.echo(audit_json(found))
    else:
        for line in audit_lines(found):
            click.echo(_fitting(line))
    if not found.possible:
        click.get_current_context().exit(ANSWER_IS_NO)
