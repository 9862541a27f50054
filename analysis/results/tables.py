"""Tables for terminal and page: rows of text, with captions and headings of tables.toml."""

from __future__ import annotations

import math
import tomllib
from dataclasses import asdict, dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from analysis.numbers import TOTAL, counted_up, decimals, p_value, percent, shortest, signed
from analysis.results.findings import (
    differences,
    estimates,
    person_estimates,
    records,
    side_estimates,
)
from analysis.results.rendering import phrases, read_text
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    import pandas as pd

    from analysis.results.analysis import Analysis


Row = dict[str, str]
EMPTY: Final = ("", "n/a")
MIN_BOOTSTRAP_P: Final = 0.002
"""The smallest p that 499 drawn tables can show."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of texts; the first cell names its row."""

    name: str
    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


@cache
def _layouts() -> Mapping[str, Any]:
    return tomllib.loads(read_text("tables.toml"))


def make_table(name: str, rows: Iterable[Row], where: str = "") -> Table | None:
    """Lay out rows in the columns of tables.toml that have a value; None without any row."""
    cells, layout = [*rows], _layouts()[name]
    if not cells:
        return None
    keys = [key for key in layout["columns"] if any(row.get(key, "") not in EMPTY for row in cells)]
    return Table(
        name=name,
        caption=f"{layout['caption']}{f', {where}' if where else ''}",
        header=[layout["columns"][key] for key in keys],
        rows=[[row.get(key, "") for key in keys] for row in cells],
        note=layout.get("note", ""),
    )


def by_condition(analysis: Analysis, name: str, table: pd.DataFrame, rows: Any) -> Iterator[Table]:
    """Yield a table for each condition; `rows` makes them of the rows of that condition."""
    if table.empty:
        return
    for condition, each in table.groupby("condition"):
        where = str(condition) if analysis.counts.conditions > 1 else ""
        made = make_table(name, rows(str(condition), each), where)
        if made is not None:
            yield made


def group_tables(analysis: Analysis) -> Iterator[Table]:
    """Yield the thresholds of groups, of both sides where they differ, and the differences."""
    conditions = analysis.counts.conditions > 1
    rows = [
        {
            "condition": each.condition if conditions else "",
            "participants": each.participant or str(each.participants),
            "threshold": each.value or phrases()["status"].get(each.status, ""),
            "um": ", ".join(f"{one['side']} {one['value']}".strip() for one in each.fingertips),
            "sigma": each.sigma,
            "spread": each.spread,
            "next": each.next_participant,
            "below": _or_empty(each.below),
            "above": _or_empty(each.above),
        }
        for each in estimates(analysis)
    ]
    sides = [
        {
            "condition": each["condition"] if conditions else "",
            "side": side.side,
            "threshold": side.value or phrases()["status"].get(side.status, ""),
        }
        for each in side_estimates(analysis)
        for side in each["sides"]
    ]
    tables = (
        make_table("group", rows),
        make_table("side_group", sides),
        make_table("differences", _difference_rows(analysis)),
    )
    yield from filter(None, tables)


def _or_empty(number: float) -> str:
    return str(int(number)) if number else ""


def _difference_rows(analysis: Analysis) -> Iterator[Row]:
    for pair in differences(analysis):
        row = pair.row
        low, high = (decimals(value, 1) for value in (pair.low, pair.high))
        text = f"{signed(pair.value)} dB" if math.isfinite(pair.value) else "n/a"
        points = [
            row.get(f"false_alarm_difference{end}", math.nan) for end in ("", "_low", "_high")
        ]
        shown = [signed(100 * value) for value in points if math.isfinite(value)]
        of_points = len(shown) == 3  # noqa: PLR2004 (the difference and its limits)
        d_prime = [row.get(f"d_prime_difference{end}", math.nan) for end in ("", "_low", "_high")]
        yield {
            "pair": f"{pair.b} - {pair.a}",
            "participant": "" if row["participant"] == TOTAL else str(row["participant"]),
            "difference": "none: one level only"
            if pair.status == "one_level"
            else f"{text} ({_open(low)} to {_open(high)})",
            "ratio": pair.ratio,
            "first": row["first"] if isinstance(row["first"], str) else "",
            "alarms": f"{shown[0]} points ({shown[1]} to {shown[2]})" if of_points else "",
            "alarms_p": "" if math.isnan(row["false_alarm_p"]) else p_value(row["false_alarm_p"]),
            "d_prime": _with_limits(d_prime),
        }


def _open(text: str) -> str:
    return "open" if text == "n/a" else text


def _with_limits(values: Sequence[float], number: int = 2) -> str:
    """Return a value, with its limits where it has some."""
    at, low, high = (decimals(value, number) for value in values)
    return at if low == "n/a" else f"{at} ({low} to {high})"


def people_tables(analysis: Analysis) -> Iterator[Table]:
    """Yield the thresholds of participants, with d' and criterion over all levels."""
    table = analysis.sensitivity
    overall = table[table["level_vpp"].isna()] if len(table) else table
    of_person = {(row["condition"], row["participant"]): row for row in records(overall)}

    def rows(condition: str, each: pd.DataFrame) -> Iterator[Row]:
        shown = person_estimates(analysis, condition)
        for row, estimate in zip(records(each), shown, strict=True):
            sensitivity = of_person.get((condition, row["participant"]), {})
            p = row["deviance_p"]
            yield {
                "participant": estimate.participant,
                "threshold": estimate.value or phrases()["status"][estimate.status],
                "sigma": estimate.sigma,
                "lapse": decimals(row["lapse_rate"], 3),
                "guess": decimals(row["guess_rate"], 3),
                "d_prime": decimals(sensitivity.get("d_prime"), 2),
                "criterion": decimals(sensitivity.get("criterion"), 2),
                "misfit": "<= " * (p <= MIN_BOOTSTRAP_P) + decimals(p, 3),
                "status": phrases()["status_of_fit"][estimate.status],
                "trials": str(row["trials"]),
            }

    yield from by_condition(analysis, "people", analysis.thresholds, rows)


def level_tables(analysis: Analysis) -> Iterator[Table]:
    """Yield detection by level, and by side where a table has both."""
    people = analysis.participants.groupby(["condition", "level_vpp"]).size()
    late = analysis.levels["timeouts"].gt(0).any() or analysis.counts.invalid
    any_side = analysis.detected_any
    unit = analysis.axis.unit

    def rows(condition: str, each: pd.DataFrame) -> Iterator[Row]:
        for at, row in zip(each.index, records(each), strict=True):
            detected_any = "" if any_side is None else str(any_side["detected_any"].iloc[at])
            detected = f"{row['detected']}/{row['presented']}"
            several = int(people[condition, row["level_vpp"]])
            yield {
                "level": f"{shortest(row['level_vpp'])} {unit}",
                "detected": detected,
                "participants": str(several) if several > 1 else "",
                "min": decimals(row["p_min"], 3) if several > 1 else "",
                "mean": decimals(row["p_mean"], 3),
                "max": decimals(row["p_max"], 3) if several > 1 else "",
                "band": _limits(row["p_low"], row["p_high"]),
                "both": _count(row["over_report"]),
                "other": _count(row["mislocalised"]),
                "late": _count(row["timeouts"]),
                "answered": decimals(row["p_answered"], 3) if late else "",
                "any": detected_any if detected_any != str(row["detected"]) else "",
            }

    yield from by_condition(analysis, "levels", analysis.levels, rows)


def _count(number: float) -> str:
    return "" if math.isnan(number) or not number else str(int(number))


def _limits(low: float, high: float) -> str:
    return "n/a" if math.isnan(low) else f"{decimals(low, 3)} to {decimals(high, 3)}"


def side_tables(analysis: Analysis) -> Iterator[Table]:
    """Yield detection by side and level, where stimuli were at both sides."""

    def rows(_: str, each: pd.DataFrame) -> Iterator[Row]:
        for row in records(each.sort_values(["level_vpp", "side"])):
            yield {
                "level": f"{shortest(row['level_vpp'])} {analysis.axis.unit}",
                "side": str(row["side"]),
                "detected": f"{row['detected']}/{row['presented']}",
                "min": decimals(row["p_min"], 3),
                "mean": decimals(row["p_mean"], 3),
                "max": decimals(row["p_max"], 3),
            }

    yield from by_condition(analysis, "sides", analysis.sides, rows)


def answer_tables(analysis: Analysis) -> Iterator[Table]:
    """Yield the answers to each stimulus, and those of each participant."""
    site, side = analysis.one_place, analysis.one_side
    named = {site: "felt", "none": "not_felt"} if site else {}
    hidden = {*LEFT_RIGHT_BOTH.named_answers} - {side} if side else set()
    answers = LEFT_RIGHT_BOTH.answer_names
    columns = (*answers, "timeout", "invalid")

    def rows(_: str, each: pd.DataFrame) -> Iterator[Row]:
        for row in records(each):
            shown = row["kind"] if row["kind"] != "single" or site else row["side"]
            yield {
                "stimulus": "stimulus" if site and row["kind"] == "single" else str(shown),
                "presented": str(row["presented"]),
                **{
                    named.get(name, name): str(row[name])
                    for name in columns
                    if name not in hidden and (name in answers or row[name])
                },
            }

    yield from by_condition(analysis, "answers", analysis.confusion, rows)
    if len(analysis.trials):
        made = make_table("each", _each_participant(analysis))
        if made is not None:
            yield made


def _each_participant(analysis: Analysis) -> list[Row]:
    """Return what no warning is based on: false alarms, side preference and reaction times."""
    counted = analysis.trials[analysis.trials["reason"].eq("")].astype({"response": object})
    several = analysis.counts.conditions > 1
    rows = []
    for (who, condition), each in counted.groupby(["participant", "condition"], observed=True):
        single, blank = (each[each["kind"].eq(kind)] for kind in ("single", "blank"))
        side, response = single["side"].astype(str), single["response"].astype(str)
        elsewhere = (response.isin(LEFT_RIGHT_BOTH.sites) & response.ne(side)).sum()
        alarms = blank["response"].isin(LEFT_RIGHT_BOTH.named_answers).sum()
        said = [str(each["response"].eq(site).sum()) for site in LEFT_RIGHT_BOTH.sites]
        row = {
            "participant": f"{who}, {condition}" if several else str(who),
            "trials": str(len(each)),
            "late": _count(int(each["response"].eq("timeout").sum())),
            "time": decimals(float(single.loc[response.eq(side), "rt_s"].median()), 3),
        }
        if analysis.detected_any is not None and len(blank):
            row["alarms"] = f"{alarms}/{len(blank)}"
        if not analysis.one_side:
            row |= {"other": f"{elsewhere}/{len(single)}", "said": " : ".join(said)}
        rows.append(row)
    return sorted(rows, key=lambda row: counted_up(row["participant"]))


def blank_tables(analysis: Analysis) -> Iterator[Table]:
    """Yield blank and both-finger trials, and those with the hands off the plate.

    Of several participants only the totals are shown; blank.csv and both.csv have each.
    """
    side = analysis.one_side
    several = analysis.counts.participants > 1
    blank = [
        {
            "participant": _who(row),
            "presented": str(int(row["presented"])),
            **({} if side else {n: decimals(row[n], 0) for n in LEFT_RIGHT_BOTH.named_answers}),
            "p": f"{percent(row['p'])} %",
            "interval": _percents(row),
        }
        for row in records(analysis.blank)
        if row["participant"] == TOTAL or not several
    ]
    both = [
        {
            "participant": _who(row),
            "noticed": f"{row['noticed']}/{row['presented']}",
            "p": f"{percent(row['p'])} %",
            "interval": _percents(row),
            "left_only": _count(row["left_only"]),
            "right_only": _count(row["right_only"]),
        }
        for row in records(analysis.both)
        if row["participant"] == TOTAL or not several
    ]
    hands_off = [
        {name: str(value) for name, value in row.items()}
        | {"participant": _who(row), "part": phrases()["parts"][row["part"]]}
        for row in records(analysis.hands_off)
    ]
    named = (("blank", blank), ("both", both), ("hands_off", hands_off))
    yield from filter(None, (make_table(name, rows) for name, rows in named))


def _percents(row: Mapping[str, Any]) -> str:
    """Return the limits of a share, of the mean of participants in a row of all of them."""
    group = math.isfinite(row.get("group_low", math.nan)) and row["participant"] == TOTAL
    ends = [row[f"{'group_' if group else ''}{end}"] for end in ("low", "high")]
    return f"{percent(ends[0])} to {percent(ends[1])} %"


def _who(row: Mapping[str, Any]) -> str:
    """Name a participant, and the condition where there are several."""
    return f"{row['participant']}{', ' + row['condition'] if 'condition' in row else ''}"


def sensitivity_tables(analysis: Analysis) -> Iterator[Table]:
    """Yield d' and criterion of all participants by level, and differences of d'."""
    table = analysis.sensitivity
    unit = analysis.axis.unit

    def rows(_: str, each: pd.DataFrame) -> Iterator[Row]:
        for row in records(each):
            level = row["level_vpp"]
            yield {
                "level": "all" if math.isnan(level) else f"{shortest(level)} {unit}",
                "felt": f"{row['felt']:.0f}/{row['presented']:.0f}",
                "alarms": f"{row['false_alarms']:.0f}/{row['blanks']:.0f}",
                "d_prime": _with_limits([row[f"d_prime{end}"] for end in ("", "_low", "_high")]),
                "criterion": decimals(row["criterion"], 2),
            }

    yield from by_condition(analysis, "sensitivity", table[table["participant"].eq(TOTAL)], rows)
    apart = analysis.d_prime_differences
    apart = apart[apart["participant"].eq(TOTAL)]
    for (a, b), each in apart.groupby(["condition_a", "condition_b"]):
        cells = [
            {
                "level": f"{shortest(row['level_vpp'])} {unit}",
                "a": decimals(row["d_prime_a"], 2),
                "b": decimals(row["d_prime_b"], 2),
                "difference": _with_limits(
                    [row[f"d_prime_difference{end}"] for end in ("", "_low", "_high")]
                ),
            }
            for row in records(each)
        ]
        made = make_table("d_prime_differences", cells, f"a = {a}, b = {b}")
        if made is not None:
            yield made


def time_tables(analysis: Analysis) -> Iterator[Table]:
    """Yield the reaction times of correct answers."""
    table = analysis.reaction_times

    def rows(_: str, each: pd.DataFrame) -> Iterator[Row]:
        for row in records(each):
            yield {
                "level": f"{shortest(row['level_vpp'])} {analysis.axis.unit}",
                "side": "" if analysis.one_place else str(row["side"]),
                "n": str(int(row["n"])),
                **{name: decimals(row[name], 3) for name in ("median", "p10", "p90")},
            }

    if table["n"].gt(0).any():
        yield from by_condition(analysis, "reaction_times", table, rows)


def count_tables(analysis: Analysis) -> Iterator[Table]:
    """Yield how many trials were read, and which were left out."""
    names, seldom = phrases()["counts"], ("simulated", "without_device", "unread", "unread_files")
    counts = asdict(analysis.counts)
    rows = [
        {"what": text, "number": str(counts[name])}
        for name, text in names.items()
        if counts[name] or name not in (*seldom, "both", "timeouts", "invalid")
    ]
    reasons = phrases()["reasons"]
    excluded = [
        {
            "participant": str(row["participant"]),
            "reason": reasons.get(row["reason"], row["reason"]),
            "trials": str(row["trials"]),
        }
        for row in records(analysis.excluded)
    ]
    tables = make_table("counts", rows), make_table("excluded", excluded)
    yield from filter(None, tables)


def detail_tables(analysis: Analysis) -> Iterator[Table]:
    """Yield the tables that the terminal prints on request."""
    for tables in (
        group_tables,
        people_tables,
        level_tables,
        side_tables,
        answer_tables,
        blank_tables,
        sensitivity_tables,
        time_tables,
        count_tables,
    ):
        yield from tables(analysis)
