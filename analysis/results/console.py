"""What the terminal says of an analysis, readable in 80 columns and in a pipe."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any, TextIO

from analysis.definitions import TOTAL
from analysis.results.rows import (
    TERMINAL,
    blank_cells,
    both_cells,
    control_totals,
    count_rows,
    forced_choice,
    left_out_rows,
    level_rows,
    not_compared_words,
    population_text,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from analysis.results.tables import Analysis


_WIDTH = 80
_FEW = 10
_LEGEND = (
    "k/n: single stimuli answered with their own side / presented. P: participants. min, mean, "
    "max: over participants' k/n. group 95 %: interval of the group. both, other: answered both, "
    "the other side. late: time-outs. p ans: k / answered."
)
_LEGEND_ANY = " any: answered left, right or both."


def print_analysis(analysis: Analysis, file: TextIO | None) -> None:
    """Print tables, what was left out, and warnings.

    Parameters
    ----------
    analysis : Analysis
        What came out.
    file : text file or None
        Where to print; ``None``, which `sys.stdout` is where it was closed, prints nothing.
    """
    if file is None:
        return
    counts = analysis.counts
    if analysis.mark:
        _say(file, f"{analysis.mark}.")
    _say(
        file,
        f"Trials {counts.trials}, participants {counts.participants}, sessions {counts.sessions}.",
    )
    *kinds, left_out = (" ".join(row) for row in count_rows(counts, TERMINAL))
    if analysis.not_compared:
        _say(file, f"{not_compared_words(analysis.not_compared)}.")
    _say(file, f"Counted: {', '.join(kinds)}; {left_out}.")
    levels = level_rows(analysis, TERMINAL)
    for condition, rows in levels.of_condition.items():
        print(file=file)
        if counts.conditions > 1:
            _say(file, f"Condition {condition}")
        _print_table(levels.header, rows, file)
    if len(analysis.levels):
        forced = analysis.detected_any is None
        _say(file, _LEGEND + ("" if forced else _LEGEND_ANY))
        if forced:
            _say(file, forced_choice("k/n"))
    for line in (
        *_total_lines(analysis),
        *_control_lines(analysis.control),
        *_threshold_lines(analysis),
        *_difference_lines(analysis),
        *_population_lines(analysis),
        *_excluded_lines(analysis.excluded),
    ):
        _say(file, line)
    for warning in analysis.warnings:
        _say(file, f"warning: {warning}")


def _say(file: TextIO, text: str) -> None:
    encoding = file.encoding or "utf-8"
    printable = text.encode(encoding, "backslashreplace").decode(encoding)
    print(textwrap.fill(printable, _WIDTH, subsequent_indent="  "), file=file)


def _print_table(header: list[str], rows: list[list[str]], file: TextIO) -> None:
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    for row in (header, *rows):
        cells = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        print(" ".join(cells), file=file)


def _total_lines(analysis: Analysis) -> Iterator[str]:
    if analysis.counts.unread:
        yield f"Rows that the map leaves out: {analysis.counts.unread}."
    for row in _last_rows(analysis.both):
        noticed, p, limits, left, right = both_cells(row, TERMINAL)
        yield (
            f"Both-finger trials{_where(row)}: {noticed} answered both, "
            f"{_total(p, limits, analysis.ci)}; left only {left}, right only {right}."
        )
    for row in _last_rows(analysis.blank):
        _, left, right, both, p, limits = blank_cells(row, TERMINAL)
        felt = TERMINAL.share(round(row["p"] * row["presented"]), row["presented"])
        yield (
            f"Blank trials{_where(row)}: {felt} false alarms, {_total(p, limits, analysis.ci)}; "
            f"left {left}, right {right}, both {both}."
        )


def _control_lines(table: pd.DataFrame) -> Iterator[str]:
    for row, (part, own, told) in control_totals(table, TERMINAL):
        yield (
            f"Fingers off the plate, {part}{_where(row)}: {own} "
            f"answered with the driven side, {told} left, right or both."
        )


def _threshold_lines(analysis: Analysis) -> Iterator[str]:
    for _, group in analysis.groups.iterrows():
        people = analysis.thresholds[analysis.thresholds["condition"].eq(group["condition"])]
        told = [str(group["printed"])] if len(people) > 1 else []
        if len(people) <= _FEW:
            each = zip(people["participant"], people["printed"], strict=True)
            told.append(", ".join(f"{name} {printed}" for name, printed in each))
        where = f" in condition {group['condition']}" if analysis.counts.conditions > 1 else ""
        yield f"Threshold{where}: {'; '.join(told)}."


def _difference_lines(analysis: Analysis) -> Iterator[str]:
    table = analysis.differences
    for _, row in table[table["participant"].eq(TOTAL)].iterrows():
        a, b = row["condition_a"], row["condition_b"]
        yield f"Threshold in condition {b} against {a}: {row['printed']}."


def _population_lines(analysis: Analysis) -> Iterator[str]:
    for one in analysis.population:
        where = f" in condition {one.condition}" if analysis.counts.conditions > 1 else ""
        told = one.reason or population_text(one, analysis.axis.unit)
        yield f"Threshold of the population{where}: {told}."


def _total(p: str, limits: str, ci: str) -> str:
    return f"{p}, 95 % {ci.title()} {limits} (ignores participants)"


def _last_rows(table: pd.DataFrame) -> Iterator[pd.Series[Any]]:
    """Yield the total, of each condition where there are several."""
    by_condition = "condition" in table.columns
    last = table.drop_duplicates("condition", keep="last") if by_condition else table.tail(1)
    return (row for _, row in last.iterrows())


def _where(row: pd.Series[Any]) -> str:
    return f" in condition {row['condition']}" if "condition" in row.index else ""


def _excluded_lines(excluded: pd.DataFrame) -> Iterator[str]:
    for reason, trials, people in left_out_rows(excluded):
        each = ", ".join(f"{name} {number}" for name, number in people)
        yield f"Left out, {reason}: {trials} trials ({each})."
