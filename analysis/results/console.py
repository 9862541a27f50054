"""What the terminal says of an analysis, readable in 80 columns and in a pipe."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Any, TextIO

from analysis.answers.counting import AUDIBILITY
from analysis.axis import Axis, shortest, with_limits
from analysis.definitions import TOTAL
from experiment.trial.plan import CONTROL

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from analysis.results.tables import Analysis


_WIDTH = 80
_FEW = 10
_HEADER = (
    "V p-p",
    "k/n",
    "P",
    "min",
    "mean",
    "max",
    "group 95 %",
    "both",
    "other",
    "late",
    "p ans",
)
_LEGEND = (
    "k/n: single stimuli answered with their own side / presented. P: participants. min, mean, "
    "max: over participants' k/n. group 95 %: interval of the group. both, other: answered both, "
    "the other side. late: time-outs. p ans: k / answered."
)
_LEGEND_ANY = " any: answered left, right or both."
_FORCED = (
    'The answer "none" was not offered, as far as the files tell: who felt nothing guessed, so '
    "k/n starts near 1/2, not at 0."
)


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
    if analysis.simulated:
        _say(file, f"{analysis.simulated}.")
    _say(
        file,
        f"Trials {counts.trials}, participants {counts.participants}, sessions {counts.sessions}.",
    )
    _say(
        file,
        f"Counted: single {counts.single}, both {counts.both}, blank {counts.blank}; "
        f"left out {counts.left_out}.",
    )
    for condition, rows in _level_rows(analysis):
        print(file=file)
        if counts.conditions > 1:
            _say(file, f"Condition {condition}")
        _print_table(_header(analysis), rows, file)
    if len(analysis.levels):
        forced = analysis.detected_any is None
        _say(file, _LEGEND + ("" if forced else _LEGEND_ANY))
        if forced:
            _say(file, _FORCED)
    for line in (
        *_total_lines(analysis),
        *_control_lines(analysis.control),
        *_threshold_lines(analysis),
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


def _header(analysis: Analysis) -> list[str]:
    unit = "V p-p" if analysis.axis.unit == Axis().unit else analysis.axis.unit
    names = [unit, *_HEADER[1:]]
    return names if analysis.detected_any is None else [*names, "any"]


def _level_rows(analysis: Analysis) -> Iterator[tuple[str, list[list[str]]]]:
    """Yield each condition with its rows of the printed table."""
    table = analysis.levels
    people = analysis.participants.groupby(["condition", "level_vpp"]).size()
    table = table.assign(people=people.to_numpy())
    if analysis.detected_any is not None:
        table = table.assign(any=analysis.detected_any["detected_any"])
    for condition, levels in table.groupby("condition"):
        rows = [_level_row(row) for _, row in levels.iterrows()]
        yield str(condition), rows


def _level_row(row: pd.Series[Any]) -> list[str]:
    cells = [
        shortest(row["level_vpp"]),
        f"{row['detected']}/{row['presented']}",
        str(row["people"]),
        *(_p(row[name]) for name in ("p_min", "p_mean", "p_max")),
        _interval(row["group_low"], row["group_high"]),
        *(_count(row[name]) for name in ("over_report", "mislocalised", "timeouts")),
        _p(row["p_answered"]),
    ]
    return [*cells, str(row["any"])] if "any" in row.index else cells


def _p(value: float) -> str:
    return "n/a" if math.isnan(value) else f"{value:.3f}"


def _count(number: float) -> str:
    return "n/a" if math.isnan(number) else f"{number:.0f}"


def _interval(low: float, high: float) -> str:
    return "n/a" if math.isnan(low) else f"{low:.3f}-{high:.3f}"


def _print_table(header: list[str], rows: list[list[str]], file: TextIO) -> None:
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    for row in (header, *rows):
        cells = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        print(" ".join(cells), file=file)


def _total_lines(analysis: Analysis) -> Iterator[str]:
    for row in _last_rows(analysis.both):
        yield (
            f"Both-finger trials{_where(row)}: {row['noticed']}/{row['presented']} answered both, "
            f"{_total(row, analysis.ci)}; left only {row['left_only']}, right only "
            f"{row['right_only']}."
        )
    for row in _last_rows(analysis.blank):
        yield (
            f"Blank trials{_where(row)}: {row['left'] + row['right'] + row['both']}/"
            f"{row['presented']} false alarms, {_total(row, analysis.ci)}; left {row['left']}, "
            f"right {row['right']}, both {row['both']}."
        )


def _control_lines(table: pd.DataFrame) -> Iterator[str]:
    """Tell what was answered with the fingers off the plate, by part, both sides together."""
    key = [name for name in ("condition", "part") if name in table.columns]
    for _, rows in table[table["participant"].eq(TOTAL)].groupby(key):
        row = rows.iloc[0]
        presented = int(rows["presented"].sum())
        own = sum(int(counts[counts["side"]]) for _, counts in rows.iterrows())
        told = int(rows[["left", "right", "both"]].to_numpy().sum())
        yield (
            f"Fingers off the plate, {_PARTS[row['part']]}{_where(row)}: {own}/{presented} "
            f"answered with the driven side, {told}/{presented} left, right or both."
        )


_PARTS = {AUDIBILITY: "audibility check", CONTROL: "control"}


def _threshold_lines(analysis: Analysis) -> Iterator[str]:
    for _, group in analysis.groups.iterrows():
        people = analysis.thresholds[analysis.thresholds["condition"].eq(group["condition"])]
        each = ""
        if len(people) <= _FEW:
            told = zip(people["participant"], people["printed"], strict=True)
            each = "; " + ", ".join(f"{name} {printed}" for name, printed in told)
        where = f" in condition {group['condition']}" if analysis.counts.conditions > 1 else ""
        yield f"Threshold{where}: {group['printed']}{each}."


def _population_lines(analysis: Analysis) -> Iterator[str]:
    for one in analysis.population:
        where = f" in condition {one.condition}" if analysis.counts.conditions > 1 else ""
        low, high = one.threshold_limits_vpp
        told = one.reason or with_limits(one.threshold_vpp, low, high, analysis.axis.unit)
        yield f"Threshold of the population{where}: {told}."


def _total(row: pd.Series[Any], ci: str) -> str:
    limits = _interval(row["low"], row["high"])
    return f"{_p(row['p'])}, 95 % {ci.title()} {limits} (ignores participants)"


def _last_rows(table: pd.DataFrame) -> Iterator[pd.Series[Any]]:
    """Yield the total, of each condition where there are several."""
    by_condition = "condition" in table.columns
    last = table.drop_duplicates("condition", keep="last") if by_condition else table.tail(1)
    return (row for _, row in last.iterrows())


def _where(row: pd.Series[Any]) -> str:
    return f" in condition {row['condition']}" if "condition" in row.index else ""


def _excluded_lines(excluded: pd.DataFrame) -> Iterator[str]:
    for reason, rows in excluded.groupby("reason"):
        each = ", ".join(
            f"{p} {n}" for p, n in zip(rows["participant"], rows["trials"], strict=True)
        )
        yield f"Left out, {reason}: {rows['trials'].sum()} trials ({each})."
