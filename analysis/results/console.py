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
MAX_RUNS: Final = 3
"""More runs of numbers are not listed."""
_LABEL: Final = 19
_MAX_NAME: Final = {1: 20, 2: 14}
"""Letters of a condition's name, and of each of a pair's."""
_ALL_KINDS: Final = ("difference", "side", "threshold")
_LAYOUTS: Final[tuple[tuple[Sequence[str], Sequence[str] | None], ...]] = (
    ((), None),
    (_ALL_KINDS[:1], None),
    (_ALL_KINDS[:1], ("side",)),
    (_ALL_KINDS[:2], ("side",)),
    (_ALL_KINDS, ("side",)),
    (_ALL_KINDS, ()),
)
"""Kinds of rows that are brief, and those whose long lines are not cut (None: no line is cut).

The first layout that fits is taken: thresholds of sides and conditions are given up last.
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
        rows = [*answer(analysis, brief), *more]
        lines = [*(mark if whole is None else mark[:1]), *_layout(rows, whole)]
        if len(lines) <= room:
            break
    lines += [*_warning_lines(analysis, remarks, MAX_LINES - len(lines) - len(last)), *last]
    if details:
        for table in detail_tables(analysis):
            lines += ["", *_table_lines(table)]
        texts = [*(each.message for each in analysis.warnings), *remarks]
        lines += ["", *_full_warnings(texts)] if texts else []
    for line in lines:
        print(_printable(line.rstrip(), file), file=file)


def _layout(rows: Iterable[AnswerRow], whole: Sequence[str] | None = None) -> list[str]:
    """Lay out labels, names and texts in columns; long lines are wrapped.

    Where `whole` is not None, lines of other kinds are cut.
    """
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
        if whole is not None and row.kind not in whole:
            lines.append(_cut(line))
        else:
            lines += textwrap.wrap(line, WIDTH, subsequent_indent=indent, break_on_hyphens=False)
        before = row.kind
    return lines


_SHORT: Final = 12
_SAME_COLUMN: Final = ("threshold", "micrometres", "side")


def _names(row: AnswerRow) -> str:
    """Return the name of a condition, or of a pair, cut to its width."""
    most = _MAX_NAME.get(len(row.names), 0)
    half = most // 2  # names often differ at their ends
    cut = [
        name if len(name) <= most else f"{name[: most - half - 1]}…{name[-half:]}"
        for name in row.names
    ]
    return " - ".join(cut)


def _cut(line: str) -> str:
    return line if len(line) <= WIDTH else f"{line[: WIDTH - 1]}…"


def _warning_lines(analysis: Analysis, remarks: Sequence[str], room: int) -> list[str]:
    """Return the warnings, a line for each code with the numbers that they have in the report.

    Where the lines do not fit, the last of the analysis are counted: the report has them.
    """
    groups: dict[str, list[int]] = {}
    for number, each in enumerate(analysis.warnings, start=1):
        groups.setdefault(each.code.text, []).append(number)
    texts = [f"{_runs(numbers)}  {text}" for text, numbers in groups.items()]
    number = len(analysis.warnings)
    added = [f"{n}  {escaped(text)}" for n, text in enumerate(remarks, start=number + 1)]
    if (shown := max(room - len(added), 1)) < len(texts):
        rest = sum(len(numbers) for numbers in [*groups.values()][shown - 1 :])
        texts = [*texts[: shown - 1], f"{rest}{' more' * (shown > 1)}, see the report"]
    label = phrases()["answer"]["warnings"]
    rows = [*texts, *added] or ["none"]
    if len(rows) > room:
        rows = [*rows[: room - 1], f"{len(rows) - room + 1} more, see tactstrip check"]
    indent = " " * (_LABEL + 5)
    lines = [f"{'' if n else label:<{_LABEL}}  {text}" for n, text in enumerate(rows)]
    wrapped = [
        each for line in lines for each in textwrap.wrap(line, WIDTH, subsequent_indent=indent)
    ]
    return wrapped if len(wrapped) <= room else [_cut(line) for line in lines]


def _runs(numbers: Sequence[int]) -> str:
    """Return ascending numbers by runs; of many runs the first and the last number.

    >>> _runs([3]), _runs([2, 3, 4]), _runs([1, 3, 4]), _runs([1, 3, 5, 7])
    ('3', '2-4', '1, 3-4', '1 ... 7')
    """
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1][1:] = [number]
        else:
            runs.append([number])
    if len(runs) > MAX_RUNS:
        return f"{numbers[0]} ... {numbers[-1]}"
    return ", ".join("-".join(map(str, run)) for run in runs)


def _full_warnings(texts: Sequence[str]) -> list[str]:
    lines: list[str] = []
    for number, message in enumerate(texts, start=1):
        text = escaped(f"Warning {number}: {message}")
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
