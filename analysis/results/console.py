"""What the terminal says of an analysis, readable in 80 columns and in a pipe."""

from __future__ import annotations

import io
import math
import textwrap
from typing import TYPE_CHECKING, Any, TextIO

from analysis.definitions import FAR_LIMIT, POPULATION, TOTAL
from analysis.results.answer import ANSWER_HEAD, answer
from analysis.results.methods.task import one_side_words
from analysis.results.methods.words import plain
from analysis.results.rows import (
    TERMINAL,
    both_cells,
    count_rows,
    forced_choice,
    hands_off_totals,
    level_rows,
    not_compared_words,
    population_spread,
    population_text,
)
from device.printing import escaped

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import pandas as pd

    from analysis.results.tables import Analysis


_WIDTH = 80
_FEW = 10
_LEGEND = (
    "k/n: single stimuli answered with their own side / presented. P: participants. min, mean, "
    f"max: over participants' k/n. group 95 %: {FAR_LIMIT}. both, other: answered both, "
    "the other side. late: time-outs. p_ans: k / answered."
)
_LEGEND_ONE = (
    "k/n: stimuli that were felt / presented. P: participants. min, mean, max: over participants' "
    f"k/n. group 95 %: {FAR_LIMIT}. late: time-outs. p_ans: k / answered."
)
_LEGEND_ANY = " any: answered left, right or both."


def print_analysis(analysis: Analysis, file: TextIO | None) -> None:
    r"""Print the answer, the table of levels, what was left out, and warnings.

    Parameters
    ----------
    analysis : Analysis
        What came out.
    file : text file or None
        Where to print; ``None``, which `sys.stdout` is where it was closed, prints nothing. What
        its encoding does not have is written as an escape.

    Raises
    ------
    OSError, ValueError
        As the file does where it cannot be written to, or is closed.

    Examples
    --------
    >>> import io
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from analysis import ColumnMap
    >>> from analysis.reading.load import read_inputs
    >>> from analysis.results.tables import analyse
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
    if analysis.mark:
        _say(file, f"{analysis.mark}.")
    told = answer(analysis)
    for statement in told.statements:
        _say(file, plain(statement))
    print(file=file)
    print(_printable(_in_columns(told.rows), file), file=file)
    print(file=file)
    if analysis.not_compared:
        _say(file, f"{not_compared_words(analysis.not_compared)}.")
    *kinds, left_out = (" ".join(row) for row in count_rows(analysis, TERMINAL))
    _say(file, f"Counted: {', '.join(kinds)}; {left_out}.")
    _print_levels(analysis, file)
    for line in (
        *_both_lines(analysis),
        *_hands_off_lines(analysis.hands_off),
        *_population_lines(analysis),
        *_excluded_lines(analysis.excluded),
    ):
        _say(file, line)
    for warning in analysis.warnings:
        _say(file, f"warning: {warning}")


def _say(file: TextIO, text: str) -> None:
    print(textwrap.fill(_printable(text, file), _WIDTH, subsequent_indent="  "), file=file)


def _printable(text: str, file: TextIO) -> str:
    encoding = file.encoding or "utf-8"
    lines = "\n".join(map(escaped, text.split("\n")))
    return lines.encode(encoding, "backslashreplace").decode(encoding)


def _in_columns(rows: Iterable[Iterable[str]]) -> str:
    """Lay the rows of the answer out in columns, the words in them wrapped."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(*ANSWER_HEAD, box=None, padding=(0, 2, 0, 0), header_style="")
    for row in rows:
        table.add_row(*(Text(escaped(plain(cell)), overflow="fold") for cell in row))
    laid = io.StringIO()
    # The same in a pipe as on a terminal, whatever that says of itself.
    Console(file=laid, width=_WIDTH, color_system=None, legacy_windows=False, _environ={}).print(
        table
    )
    return "\n".join(line.rstrip() for line in laid.getvalue().splitlines())


def _print_levels(analysis: Analysis, file: TextIO) -> None:
    levels = level_rows(analysis, TERMINAL)
    for condition, rows in levels.of_condition.items():
        print(file=file)
        if analysis.counts.conditions > 1:
            _say(file, f"Condition {condition}")
        _print_table(levels.header, rows, file)
    if len(analysis.levels):
        forced = analysis.detected_any is None
        if analysis.one_side:
            _say(file, _LEGEND_ONE)
            if not analysis.one_place:
                _say(file, f"{one_side_words(analysis.one_side)}.")
        else:
            _say(file, _LEGEND + ("" if forced else _LEGEND_ANY))
        if forced:
            _say(file, forced_choice(analysis, "k/n"))


def _print_table(header: list[str], rows: list[list[str]], file: TextIO) -> None:
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    for row in (header, *rows):
        cells = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        print(" ".join(cells), file=file)


def _both_lines(analysis: Analysis) -> Iterator[str]:
    table = analysis.both
    for _, row in table[table["participant"].eq(TOTAL)].iterrows():
        noticed, p, own, group, left, right = both_cells(row, TERMINAL)
        limits = f"group 95 % {group}"
        if math.isnan(row["group_low"]):
            limits = f"95 % {analysis.ci.title()} {own}"
        yield (
            f"Both-finger trials{_where(row)}: {noticed} answered both, {p}, {limits}; left only "
            f"{left}, right only {right}."
        )


def _hands_off_lines(table: pd.DataFrame) -> Iterator[str]:
    for row, (part, own, told) in hands_off_totals(table, TERMINAL):
        yield (
            f"Fingers off the plate, {part}{_where(row)}: {own} "
            f"answered with the driven side, {told} left, right or both."
        )


def _population_lines(analysis: Analysis) -> Iterator[str]:
    for one in analysis.population:
        where = f" in condition {one.condition}" if analysis.counts.conditions > 1 else ""
        told = f"not fitted ({one.reason})"
        if not one.reason:
            spread = population_spread(one, analysis.axis)
            told = f"{population_text(one, analysis.axis)}, between people {spread} (SD)"
        yield f"Threshold of the population{where}: {told}."
    if not all(one.reason for one in analysis.population):
        yield POPULATION


def _where(row: pd.Series[Any]) -> str:
    return f" in condition {row['condition']}" if "condition" in row.index else ""


def _excluded_lines(excluded: pd.DataFrame) -> Iterator[str]:
    """Tell of few participants whose trials are left out; the report has a table of them."""
    for reason, rows in excluded.groupby("reason"):
        if len(rows) <= _FEW:
            pairs = zip(rows["participant"], rows["trials"], strict=True)
            each = ", ".join(f"{name} {number}" for name, number in pairs)
            count = rows["trials"].sum()
            yield f"Left out, {reason}: {count} trial{'' if count == 1 else 's'} ({each})."
