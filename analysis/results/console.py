"""The answer on a terminal: at most 12 lines of 80 columns; the tables on request."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Final, TextIO

from analysis.results.answer import AnswerRow, answer
from analysis.results.rendering import phrases, plain
from analysis.results.tables import detail_tables
from device.printing import escaped

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analysis.results.analysis import Analysis
    from analysis.results.tables import Table


WIDTH: Final = 80
MAX_LINES: Final = 12
_LABEL: Final = 19
_MAX_NAME: Final = {1: 20, 2: 14}
"""Letters of a condition's name, and of each of a pair's."""


def print_analysis(
    analysis: Analysis,
    file: TextIO | None,
    *,
    details: bool = False,
    report: str = "",
    more: Sequence[AnswerRow] = (),
) -> None:
    r"""Print the answer in at most 12 lines of 80 columns.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    file : text file or None
        Where to print; None, which `sys.stdout` is where it was closed, prints nothing. Characters
        that its encoding lacks are written as escapes.
    details : bool
        Whether to print the tables below the answer.
    report : str
        The path of the report; empty where none was written.
    more : sequence of AnswerRow
        Rows to put below those of the analysis.

    Raises
    ------
    OSError, ValueError
        If the file cannot be written to, or is closed.

    Examples
    --------
    >>> import io
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from analysis import ColumnMap, analyse, read_inputs
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response\n1,left,60,left\n")
    ...     analysis = analyse(read_inputs([table], ColumnMap()))
    >>> printed = io.StringIO()
    >>> print_analysis(analysis, printed)
    >>> max(map(len, printed.getvalue().splitlines())) <= 80
    True
    """
    if file is None:
        return
    mark = textwrap.wrap(f"{analysis.mark}.", WIDTH) if analysis.mark else []
    rows = [*answer(analysis), *more]
    last = _layout([AnswerRow(kind="report", text=report)] if report else [])
    lines = [*mark, *_layout(rows)]
    if len(lines) + len(last) >= MAX_LINES:
        lines = [*mark[:1], *_layout(rows, cut=True)]
    lines += [*_warning_lines(analysis, MAX_LINES - len(lines) - len(last)), *last]
    if details:
        for table in detail_tables(analysis):
            lines += ["", *_table_lines(table)]
        lines += ["", *_full_warnings(analysis)] if analysis.warnings else []
    for line in lines:
        print(_printable(line.rstrip(), file), file=file)


def _layout(rows: Iterable[AnswerRow], *, cut: bool = False) -> list[str]:
    """Lay out labels, names and texts in columns; long texts go on below, or are cut."""
    rows = list(rows)
    names = [_names(row) for row in rows]
    column = max((len(name) for name in names), default=0) if len(rows) > 1 else 0
    lines, before = [], ""
    for row, name in zip(rows, names, strict=True):
        label = "" if row.kind == before else row.label
        width = column if row.kind in _SAME_COLUMN or name else 0
        text = f"{name:<{min(width, max(len(name), _SHORT))}}  {row.text}" if name else row.text
        indent = " " * (_LABEL + 2)
        line = f"{label:<{_LABEL}}  {escaped(plain(text))}"
        if cut and len(line) > WIDTH:
            lines.append(f"{line[: WIDTH - 1]}…")
        else:
            lines += textwrap.wrap(line, WIDTH, subsequent_indent=indent, break_on_hyphens=False)
        before = row.kind
    return lines


_SHORT: Final = 12
_SAME_COLUMN: Final = ("threshold", "micrometres", "side")


def _names(row: AnswerRow) -> str:
    """Return the name of a condition, or of a pair, cut to its width."""
    most = _MAX_NAME.get(len(row.names), 0)
    cut = [name if len(name) <= most else f"{name[: most - 1]}…" for name in row.names]
    return " - ".join(cut)


def _warning_lines(analysis: Analysis, room: int) -> list[str]:
    """Return the warnings by number, or how many there are where they do not fit."""
    label = phrases()["answer"]["warnings"]
    if not analysis.warnings:
        return _layout([AnswerRow(kind="warnings", text="none")])
    texts = [f"{n}  {each.code.text}" for n, each in enumerate(analysis.warnings, start=1)]
    lines = [f"{label if n == 0 else '':<{_LABEL}}  {text}" for n, text in enumerate(texts)]
    if len(lines) <= room:
        return lines
    shown = max(room - 1, 0)
    more = (
        f"{len(texts) - shown} more, see the report" if shown else f"{len(texts)}, see the report"
    )
    return [*lines[:shown], f"{'' if shown else label:<{_LABEL}}  {more}"]


def _full_warnings(analysis: Analysis) -> list[str]:
    lines: list[str] = []
    for number, each in enumerate(analysis.warnings, start=1):
        text = escaped(f"Warning {number}: {each.message}")
        lines += textwrap.wrap(text, WIDTH, subsequent_indent="  ")
    return lines


def _table_lines(table: Table) -> list[str]:
    """Lay out a table in columns: the first to the left, the others to the right."""
    rows = [[escaped(plain(str(cell))) for cell in row] for row in (table.header, *table.rows)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [escaped(plain(table.caption))]
    for row in rows:
        first, *others = (
            cell.ljust(width) if n == 0 else cell.rjust(width)
            for n, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        lines.append("  ".join([first, *others]))
    return lines


def _printable(text: str, file: TextIO) -> str:
    encoding = file.encoding or "utf-8"
    return text.encode(encoding, "backslashreplace").decode(encoding)
