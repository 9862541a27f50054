"""The answer on a terminal: at most 12 lines of 80 columns; the tables on request."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Final, TextIO

from analysis.results.answer import AnswerRow, answer
from analysis.results.rendering import plain, short
from analysis.results.tables import make_tables, result_rows
from device.printing import echo, escaped

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.results.analysis import Analysis
    from analysis.results.tables import Table


WIDTH: Final = 80
MAX_LINES: Final = 12
_LABEL: Final = 19
_NAME: Final = 12
"""The column of names, which may be longer."""
_MAX_NAME: Final = {1: 20, 2: 14}
"""Letters of a condition's name, and of each of a pair's."""
_BRIEF: Final = ("difference", "side", "threshold")
_LAYOUTS: Final = (((), ()), (_BRIEF[:1], ("side",)), (_BRIEF, ("side",)), (_BRIEF, ()))
"""Kinds of rows that are brief, and those whose long lines are not cut then.

The first layout that fits is taken: thresholds of sides are given up last.
"""
_MAX_WARNINGS: Final = 2
"""Lines that are kept free for warnings."""


def print_analysis(
    analysis: Analysis,
    file: TextIO | None,
    *,
    details: bool = False,
    report: str = "",
    more: Sequence[AnswerRow] = (),
    remarks: Sequence[str] = (),
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
    remarks : sequence of str
        Further warnings, which the report does not have; they are numbered after its own.

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
    last = _layout([AnswerRow(kind="report", text=report)] if report else [])
    needed = len(_warning_lines(analysis, remarks, MAX_LINES))
    room = MAX_LINES - len(last) - min(needed, _MAX_WARNINGS)
    for brief, whole in _LAYOUTS:
        rows = _layout([*answer(analysis, brief), *more], whole if brief else None)
        lines = [*(mark[:1] if brief else mark), *rows]
        if len(lines) <= room:
            break
    lines += [*_warning_lines(analysis, remarks, MAX_LINES - len(lines) - len(last)), *last]
    if details:
        for name, frame in result_rows(analysis).items():
            for table in make_tables(name, frame, analysis):
                lines += ["", *_table_lines(table)]
        messages = [*(warning.message for warning in analysis.warnings), *remarks]
        lines += [""] * bool(messages)
        for number, message in enumerate(messages, start=1):
            lines += _wrap(escaped(f"Warning {number}: {message}"), "  ")
    echo(*map(str.rstrip, lines), file=file)


def _layout(rows: Sequence[AnswerRow], whole: Sequence[str] | None = None) -> list[str]:
    """Lay out labels, names and texts in columns; long lines are wrapped.

    Where `whole` is not None, lines of other kinds are cut.
    """
    names = [
        " - ".join(short(name, _MAX_NAME[len(row.names)]) for name in row.names) for row in rows
    ]
    column = min(max(map(len, names), default=0), _NAME)
    lines, before = [], ""
    for row, name in zip(rows, names, strict=True):
        text = f"{name:<{column}}  {row.text}" if name else row.text
        label = "" if row.kind == before else row.label
        line = f"{label:<{_LABEL}}  {escaped(plain(text))}"
        lines += _wrap(line, " " * (_LABEL + 2), cut=whole is not None and row.kind not in whole)
        before = row.kind
    return lines


def _wrap(line: str, indent: str, *, cut: bool = False) -> list[str]:
    """Break a long line at words, or cut it."""
    if cut:
        return [line if len(line) <= WIDTH else f"{line[: WIDTH - 1]}…"]
    return textwrap.wrap(line, WIDTH, subsequent_indent=indent, break_on_hyphens=False)


def _warning_lines(analysis: Analysis, remarks: Sequence[str], room: int) -> list[str]:
    """Return the warnings, a line for each code with the numbers that they have in the report."""
    numbers: dict[str, list[int]] = {}
    texts = [*(analysis.label(warning.code.text) for warning in analysis.warnings), *remarks]
    for number, text in enumerate(texts, start=1):
        numbers.setdefault(text, []).append(number)
    rows = [
        AnswerRow(
            kind="warnings", names=("-".join(dict.fromkeys(map(str, (of[0], of[-1])))),), text=text
        )
        for text, of in numbers.items()
    ]
    if len(rows) > room:
        hidden = sum(map(len, [*numbers.values()][room - 1 :]))
        more = AnswerRow(kind="warnings", text=f"{hidden} more, listed with --details")
        rows = [*rows[: room - 1], more]
    rows = rows or [AnswerRow(kind="warnings", text="none")]
    lines = _layout(rows)
    return lines if len(lines) <= room else _layout(rows, whole=())


def _table_lines(table: Table) -> list[str]:
    """Lay out a table in columns: the first to the left, the others to the right."""
    rows = [[escaped(plain(str(cell))) for cell in row] for row in (table.header, *table.rows)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    cells = ([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])] for row in rows)
    return [escaped(plain(table.caption)), *map("  ".join, cells)]
