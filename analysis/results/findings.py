"""Thresholds, differences and false alarms as rows: numbers of the tables, and their short texts.

Tables, the answer and the methods take these rows. A number is formatted here once, so that
terminal, page and methods show the same digits.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import pandas as pd

from analysis.numbers import (
    TOTAL,
    alike,
    bounded,
    decimals,
    rounded,
    shortest,
    spread_of,
    with_limits,
)
from analysis.results.rendering import phrases, sentence
from analysis.thresholds.displacement import group_per_volt, mean_of_equal
from analysis.thresholds.fit import BOUNDED, WITH_THRESHOLD

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analysis.axis import Axis
    from analysis.results.analysis import Analysis


ALPHA: Final = 0.05
"""Sides, and false alarms of two conditions, differ where their exact test has a smaller p."""
DB_PER_LOG10: Final = 20.0
LARGE_DB: Final = 20.0
"""A ratio of more is printed without decimals."""
_OPEN: Final = {"low": -math.inf, "high": math.inf}


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table, each by the names of its columns."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def with_texts(
    table: pd.DataFrame, measured: pd.DataFrame, analysis: Analysis
) -> list[dict[str, Any]]:
    """Return the rows of a table of thresholds with their texts, all rounded alike.

    ``value`` has the limits and ``short`` has none; without a threshold both have a bound or the
    reason. ``slope`` is sigma. ``difference_threshold`` and ``re_reference`` are empty unless
    stimuli were compared with a reference. `measured` has the levels of each condition, or
    participant there.
    """
    axis = analysis.axis
    key = [name for name in ("condition", "participant") if name in measured]
    rows = records(
        table.join(measured.groupby(key)["level_vpp"].agg(list).rename("tested"), on=key)
    )
    spreads = []
    for row in rows:
        row["at"] = at = float(row["threshold_vpp"])
        row["low"], row["high"] = low, high = _limits(row, "threshold_{}_vpp")
        spreads.append(spread_of(low, at, high, row["tested"]) if math.isfinite(at) else math.nan)
    for row, spread in zip(rows, alike(spreads), strict=True):
        at, limits = row["at"], (row["low"], row["high"])
        value = short = analysis.label(phrases()["status"].get(row["status"], ""))
        if math.isfinite(at):
            value = with_limits(at, *limits, axis.unit, row["tested"], spread=spread)
            short = f"{rounded(at, spread)} {axis.unit}"
        elif row["status"] in BOUNDED:
            value = short = bounded(*limits, axis.unit, row["tested"])
        row |= {
            "value": value,
            "short": short,
            "slope": _slope(row, axis),
            **_beside_reference(row),
        }
    return rows


def _beside_reference(row: Mapping[str, Any]) -> dict[str, str]:
    """Return the texts of a comparison with a reference, empty without one."""
    texts = {"difference_threshold": "", "re_reference": ""}
    if "reference_vpp" in row:
        texts["difference_threshold"] = sentence("answer.jinja", "difference_threshold_db", r=row)
        texts["re_reference"] = sentence("answer.jinja", "db_re_reference", r=row)
    return texts


def _limits(row: Mapping[str, Any], name: str) -> tuple[float, float]:
    """Return the limits of a value, open ones infinite."""
    low, high = (
        infinite if math.isnan(row[name.format(end)]) else float(row[name.format(end)])
        for end, infinite in _OPEN.items()
    )
    return low, high


def _slope(row: Mapping[str, Any], axis: Axis) -> str:
    """Return the width of a function in dB, on a linear axis in the levels' unit, with limits."""
    factor = DB_PER_LOG10 if axis.x_scale == "log10" else 1.0
    return _in_db(
        [row.get(f"sigma{end}", math.nan) * factor for end in ("", "_low", "_high")], axis
    )


def _in_db(values: list[float], axis: Axis) -> str:
    """Return a value with its limits, rounded by their distance; without limits by itself."""
    at, low, high = values
    if math.isnan(at):
        return ""
    unit = "dB" if axis.is_logarithmic else axis.unit
    is_open = not math.isfinite(high - low)
    texts = [rounded(value, abs(at) if is_open else high - low) for value in values]
    return f"{texts[0]} {unit}" if is_open else f"{texts[0]} {unit} ({texts[1]} to {texts[2]})"


def estimates(analysis: Analysis) -> list[dict[str, Any]]:
    """Return the threshold of each condition, of the group or of its only participant.

    The texts of `with_texts`, then ``um`` and ``basis``, the same at the fingertip, and ``spread``
    and ``next_participant`` of a group.
    """
    people, axis = analysis.thresholds, analysis.axis
    groups = analysis.groups.set_index("condition")
    alone_here = people["condition"].map(groups["participants"]).eq(1)
    groups.update(people[alone_here].set_index("condition").filter([*groups]))
    rows = with_texts(groups.reset_index(), analysis.levels, analysis)
    for row in rows:
        row["spread"] = _in_db([row[f"spread_{end}db"] for end in ("", "low_", "high_")], axis)
        row["next_participant"] = ""
        if math.isfinite(row["at"]) and not math.isnan(row["spread_db"]):
            limits = _limits(row, "new_{}_vpp")
            row["next_participant"] = with_limits(row["at"], *limits, axis.unit, row["tested"])
        row["um"], row["basis"] = _fingertips(row, people[people["condition"].eq(row["condition"])])
    return rows


def _fingertips(row: Mapping[str, Any], people: pd.DataFrame) -> tuple[str, str]:
    """Return a threshold in micrometres, by side where they differ, and the basis of it.

    Empty unless the displacement per volt is the same of all. A threshold outside the tested levels
    has none.
    """
    per_volt, basis = group_per_volt(people) if row["status"] in WITH_THRESHOLD else ({}, "")
    sides = {f"{side} ": um for side, um in per_volt.items() if um > 0}
    common = mean_of_equal(pd.Series(sides))
    if len(sides) == len(per_volt) and not math.isnan(common):
        sides = {"": common}
    texts = []
    for side, um in sides.items():
        at, low, high = (um * end for end in (row["at"], row["low"], row["high"]))
        tested_um = [float(f"{um * level:.3g}") for level in row["tested"]]
        text = with_limits(at, low, high, "µm", tested_um, spread=at / 10)
        texts.append(f"{side}{text}")
    return ", ".join(texts), basis if texts else ""


def sides_that_differ(analysis: Analysis) -> list[dict[str, Any]]:
    """Return the conditions in which sides differ: ``condition``, ``p`` of the test, ``sites``."""
    return [
        {"condition": name, "p": p, "sites": analysis.task.sites}
        for name, p in analysis.side_p.items()
        if p < ALPHA
    ]


def side_estimates(analysis: Analysis) -> list[dict[str, Any]]:
    """Return the threshold of each side with its texts, of the conditions in which sides differ."""
    return [
        row
        for _, rows in analysis.side_groups.groupby("condition", sort=False)
        for row in with_texts(rows, analysis.levels, analysis)
    ]


def differences(analysis: Analysis) -> list[dict[str, Any]]:
    """Return the difference of every two conditions; of one participant in both, that one's.

    Each row of the table has in addition ``people``, the number of participants in both conditions,
    ``bounded``, the number of those of whose difference no more than a limit is known, ``apart``,
    whether the printed interval leaves out 0, and the texts ``ratio`` and ``value``.
    """
    results = []
    table = analysis.differences
    for _, pair in table.groupby(["condition_a", "condition_b"], sort=False):
        people, row = pair[pair["participant"].ne(TOTAL)], pair.iloc[-1]
        if row["status"] == "one_participant" and len(people) == 1:
            row = people.iloc[0]
        result = {str(name): value for name, value in row.items()} | {"people": len(people)}
        result["bounded"] = int(people["status"].isin(["at_least", "at_most", "unknown"]).sum())
        low, high = (round(end, 1) for end in _limits(result, "{}_db"))
        has_ratio = row["status"] == "ok" and not analysis.axis.signed
        result |= {"apart": low > 0 or high < 0, "ratio": _ratio(result) if has_ratio else ""}
        results.append(result | {"value": sentence("answer.jinja", "db", d=result)})
    return results


def _ratio(row: Mapping[str, float]) -> str:
    """Return the ratio of two levels with its limits.

    >>> _ratio({"difference_db": -2.7, "low_db": -3.8, "high_db": -1.5})
    '0.73 (0.65 to 0.84)'
    """
    values_db = [row[name] for name in ("difference_db", "low_db", "high_db")]
    number = 2 if abs(values_db[0]) < LARGE_DB else 0
    at, low, high = (decimals(10 ** (value_db / 20), number) for value_db in values_db)
    return f"{at} ({low} to {high})"


def shares(table: pd.DataFrame) -> pd.DataFrame:
    """Return counts of blank or both-finger trials, with the limits of the mean of participants."""
    limits = {end: table[f"group_{end}"].fillna(table[end]) for end in ("low", "high")}
    return table.assign(**limits)


def false_alarms(analysis: Analysis) -> list[dict[str, Any]]:
    """Return the rates of false alarms, of each condition where there are several."""
    if analysis.detected_any is None:
        return []
    return records(shares(analysis.blank[analysis.blank["participant"].eq(TOTAL)]))


def left_out(analysis: Analysis) -> list[dict[str, Any]]:
    """Return how many trials are left out: ``text`` of the reason, and ``number``."""
    names = phrases()["reasons"]
    numbers = analysis.excluded.groupby("reason")["trials"].sum()
    order = sorted(numbers.index, key=[*names].index)
    return [{"text": names[reason], "number": int(numbers[reason])} for reason in order]


def level_range(analysis: Analysis) -> str:
    """Return the lowest and the highest level with their unit."""
    levels = analysis.levels["level_vpp"]
    ends = dict.fromkeys((shortest(levels.min()), shortest(levels.max())))
    return f"{' to '.join(ends)} {analysis.axis.unit}"
