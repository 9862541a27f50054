"""What the templates state: thresholds, differences and false alarms as numbers and short texts.

Each function selects rows of the tables of an analysis and formats their numbers; none chooses
words. A number is formatted here once, so that terminal, page and methods show the same digits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from analysis.numbers import (
    TOTAL,
    alike,
    alone,
    bounded,
    decimals,
    rounded,
    shortest,
    spread_of,
    with_limits,
)
from analysis.results.analysis import ALPHA
from analysis.thresholds.displacement import SITE_COLUMNS, group_per_volt
from analysis.thresholds.fit import BOUNDED, WITH_THRESHOLD

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import pandas as pd

    from analysis.results.analysis import Analysis


SAME_RATIO: Final = 0.005
"""Displacements per volt of both fingers that differ by less are one number."""
DB_PER_LOG10: Final = 20.0
LARGE_DB: Final = 20.0
"""A ratio of more is printed without decimals."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A threshold as it is printed.

    `value` has the limits, `short` has none; both are empty where `status` gives the reason.
    `fingertips` are the same in micrometres, by side where sides differ.
    """

    condition: str
    status: str
    value: str
    short: str
    participants: int = 1
    participant: str = ""
    side: str = ""
    kind: str = ""  # simulated, or simulated or real
    trials: int = 0
    below: int = 0
    above: int = 0
    fingertips: tuple[Mapping[str, str], ...] = ()
    basis: str = ""
    sigma: str = ""
    spread: str = ""
    next_participant: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """The difference of two conditions; an open limit is NaN.

    `participants` are those in both conditions, 0 where the groups are of other people.
    """

    a: str
    b: str
    status: str
    value: float
    low: float
    high: float
    ratio: str
    participants: int
    first: str
    row: Mapping[str, Any]

    @property
    def apart(self) -> bool:
        """Whether the interval, as it is printed, leaves out 0."""
        low, high = (-math.inf if math.isnan(self.low) else round(self.low, 1), self.high)
        return low > 0 or (math.inf if math.isnan(high) else round(high, 1)) < 0


@dataclass(frozen=True, slots=True, kw_only=True)
class FalseAlarms:
    """The rate of false alarms of all participants in a condition, with the limits of the mean."""

    condition: str
    p: float
    low: float
    high: float
    alarms: int
    presented: int


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table, each by the names of its columns."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def estimates(analysis: Analysis) -> list[Estimate]:
    """Return the threshold of each condition, of the group or of its only participant."""
    rows = []
    for group in records(analysis.groups):
        people = _people(analysis, group["condition"])
        alone_here = group["participants"] == 1
        row = records(people)[0] if alone_here else group
        rows.append((group, people, row))
    levels = [_levels(analysis, group["condition"]) for group, _, _ in rows]
    spreads = _spreads([row for *_, row in rows], levels)
    counts, kind = analysis.counts, ""
    if counts.simulated:
        kind = "simulated" if counts.simulated == counts.trials else "simulated or real"
    return [
        Estimate(
            **_threshold(row, shown, analysis, spread),
            **_fingertips(row, people, shown),
            **_group(group, shown, analysis),
            participants=int(group["participants"]),
            participant=str(row["participant"]) if group["participants"] == 1 else "",
            kind=kind,
            trials=int(people["trials"].sum()),
            sigma=sigma_text(row, analysis),
        )
        for (group, people, row), shown, spread in zip(rows, levels, spreads, strict=True)
    ]


def person_estimates(analysis: Analysis, condition: str) -> list[Estimate]:
    """Return the threshold of each participant in a condition."""
    table = analysis.participants
    here = table[table["condition"].eq(condition)]
    of_person = here.groupby("participant")["level_vpp"].apply(list).to_dict()
    rows = records(_people(analysis, condition))
    levels = [sorted(of_person[row["participant"]]) for row in rows]
    return [
        Estimate(
            **_threshold(row, shown, analysis, spread),
            participant=str(row["participant"]),
            trials=int(row["trials"]),
            sigma=sigma_text(row, analysis),
        )
        for row, shown, spread in zip(rows, levels, _spreads(rows, levels), strict=True)
    ]


def side_estimates(analysis: Analysis) -> list[dict[str, Any]]:
    """Return the thresholds of both sides of each condition in which they differ."""
    results = []
    table = analysis.side_groups
    for condition, p in analysis.side_p.items():
        if p >= ALPHA or not len(table):
            continue
        rows = records(table[table["condition"].eq(condition)])
        levels = _levels(analysis, condition)
        spreads = _spreads(rows, [levels] * len(rows))
        sides = [
            Estimate(**_threshold(row, levels, analysis, spread), side=str(row["side"]))
            for row, spread in zip(rows, spreads, strict=True)
        ]
        participants = max((int(row["participants"]) for row in rows), default=0)
        data = {"condition": condition, "p": p, "participants": participants}
        results.append({**data, "sides": sides})
    return results


def _people(analysis: Analysis, condition: str) -> pd.DataFrame:
    return analysis.thresholds[analysis.thresholds["condition"].eq(condition)]


def _levels(analysis: Analysis, condition: str) -> list[float]:
    table = analysis.levels
    return [*table.loc[table["condition"].eq(condition), "level_vpp"]]


def _ends(row: Mapping[str, Any], low: str, high: str) -> tuple[float, float]:
    """Return limits, open ones infinite."""
    ends = float(row[low]), float(row[high])
    return (
        -math.inf if math.isnan(ends[0]) else ends[0],
        math.inf if math.isnan(ends[1]) else ends[1],
    )


_LIMITS: Final = ("threshold_low_vpp", "threshold_high_vpp")


def _spreads(
    rows: Sequence[Mapping[str, Any]], levels: Sequence[Sequence[float]]
) -> list[float | None]:
    """Return by what the thresholds of a list are rounded alike; none of those without one."""
    ranges = [
        spread_of(_ends(row, *_LIMITS)[0], row["threshold_vpp"], _ends(row, *_LIMITS)[1], shown)
        for row, shown in zip(rows, levels, strict=True)
        if _has_threshold(row)
    ]
    spreads = iter(alike(ranges))
    return [next(spreads) if _has_threshold(row) else None for row in rows]


def _has_threshold(row: Mapping[str, Any]) -> bool:
    return math.isfinite(row["threshold_vpp"])


def _threshold(
    row: Mapping[str, Any], levels: Sequence[float], analysis: Analysis, spread: float | None
) -> dict[str, Any]:
    status, unit, value, short = str(row["status"]), analysis.axis.unit, "", ""
    low, high = _ends(row, *_LIMITS)
    if spread is not None:
        at = float(row["threshold_vpp"])
        value = with_limits(at, low, high, unit, levels, spread=spread)
        short = f"{rounded(at, spread)} {unit}"
    elif status in BOUNDED:
        value = short = bounded(low, high, unit, levels)
    condition = str(row["condition"])
    return {"condition": condition, "status": status, "value": value, "short": short}


def _group(group: Mapping[str, Any], levels: Sequence[float], analysis: Analysis) -> dict[str, Any]:
    """Return what is only known of a group: who lies beyond the levels, and how people differ."""
    if math.isnan(group["spread_db"]):
        return {"below": _whole(group["below"]), "above": _whole(group["above"])}
    at, low, high = (float(group[f"spread_{end}db"]) for end in ("", "low_", "high_"))
    shown = [rounded(value, high - low) for value in (at, low, high)]
    unit = "dB" if analysis.axis.is_logarithmic else analysis.axis.unit
    middle = float(group["threshold_vpp"])
    new = ""
    if math.isfinite(middle):
        ends = _ends(group, "new_low_vpp", "new_high_vpp")
        new = with_limits(middle, *ends, analysis.axis.unit, levels)
    return {
        "below": _whole(group["below"]),
        "above": _whole(group["above"]),
        "spread": f"{shown[0]} {unit} ({shown[1]} to {shown[2]})",
        "next_participant": new,
    }


def _whole(value: float) -> int:
    return 0 if math.isnan(value) else int(value)


def sigma_text(row: Mapping[str, Any], analysis: Analysis) -> str:
    """Return the width of a function in dB, on a linear axis in the levels' unit, with limits."""
    factor = DB_PER_LOG10 if analysis.axis.x_scale == "log10" else 1.0
    ends = [float(row.get(f"sigma{end}", math.nan)) * factor for end in ("", "_low", "_high")]
    if math.isnan(ends[0]):
        return ""
    unit = "dB" if analysis.axis.is_logarithmic else analysis.axis.unit
    spread = ends[2] - ends[1] if math.isfinite(ends[2] - ends[1]) else abs(ends[0])
    at, low, high = (rounded(value, spread) for value in ends)
    return f"{at} {unit}" if "nan" in (low, high) else f"{at} {unit} ({low} to {high})"


def _fingertips(
    row: Mapping[str, Any], people: pd.DataFrame, levels: Sequence[float]
) -> dict[str, Any]:
    """Return a threshold in micrometres where the displacement per volt is the same of all.

    An open limit is the end of the tested levels, as in volts. A threshold outside them has none.
    """
    if row["status"] not in WITH_THRESHOLD:
        return {}
    per_volt, basis = group_per_volt(people)
    sides = {side: um for side, um in per_volt.items() if um > 0}
    values = [*sides.values()]
    is_complete = len(sides) == len(SITE_COLUMNS)
    if is_complete and max(values) - min(values) <= SAME_RATIO * max(values):
        sides = {"": sum(values) / len(values)}
    at = float(row["threshold_vpp"])
    low, high = _ends(row, *_LIMITS)
    signs = "< " if low == -math.inf else "", "> " if high == math.inf else ""
    limits = min(levels) if signs[0] else low, max(levels) if signs[1] else high
    texts = []
    for side, um in sides.items():
        ends = [sign + alone(um * end, "").strip() for sign, end in zip(signs, limits, strict=True)]
        value = f"{alone(um * at, 'µm')} ({ends[0]} to {ends[1]})"
        texts.append({"side": side, "value": value})
    return {"fingertips": tuple(texts), "basis": basis} if texts else {}


def differences(analysis: Analysis) -> list[Difference]:
    """Return the difference of every two conditions; of one participant in both, that one's."""
    results = []
    table = analysis.differences
    for (a, b), rows in table.groupby(["condition_a", "condition_b"], sort=False):
        people, row = rows[rows["participant"].ne(TOTAL)], rows.iloc[-1]
        if row["status"] == "one_participant" and len(people) == 1:
            row = people.iloc[0]
        value, low, high = (float(row[n]) for n in ("difference_db", "low_db", "high_db"))
        has_ratio = row["status"] == "ok" and not analysis.axis.signed
        results.append(
            Difference(
                a=str(a),
                b=str(b),
                status=str(row["status"]),
                value=value,
                low=low,
                high=high,
                ratio=_ratio(value, low, high) if has_ratio else "",
                participants=len(people),
                first=_first(people, (str(a), str(b))),
                row={str(name): value for name, value in row.items()},
            )
        )
    return results


def _ratio(value_db: float, low_db: float, high_db: float) -> str:
    """Return the ratio of two levels with its limits.

    >>> _ratio(-2.7, -3.8, -1.5)
    '0.73 (0.65 to 0.84)'
    """
    number = 2 if abs(value_db) < LARGE_DB else 0
    at, low, high = (decimals(10 ** (db / 20), number) for db in (value_db, low_db, high_db))
    return f"{at} ({low} to {high})"


def _first(people: pd.DataFrame, names: tuple[str, str]) -> str:
    """Return the condition that all of several participants had first, where that is known."""
    first = {*people["first"]}
    return str(first.pop()) if len(people) > 1 and len(first) == 1 and first <= {*names} else ""


def false_alarms(analysis: Analysis) -> list[FalseAlarms]:
    """Return the rates of false alarms, of each condition where there are several."""
    if analysis.detected_any is None:
        return []
    rows = analysis.blank[analysis.blank["participant"].eq(TOTAL)]
    results = []
    for row in records(rows):
        of = "" if math.isnan(row["group_low"]) else "group_"
        results.append(
            FalseAlarms(
                condition=str(row.get("condition", "")),
                p=float(row["p"]),
                low=float(row[f"{of}low"]),
                high=float(row[f"{of}high"]),
                alarms=round(row["p"] * row["presented"]),
                presented=int(row["presented"]),
            )
        )
    return results


def left_out(analysis: Analysis, order: Iterable[str]) -> list[tuple[str, int]]:
    """Return how many trials are left out for which reason, the reasons in this order."""
    numbers = analysis.excluded.groupby("reason")["trials"].sum().to_dict()
    places = {reason: at for at, reason in enumerate(order)}
    chosen = sorted(map(str, numbers), key=lambda reason: places.get(reason, len(places)))
    return [(reason, int(numbers[reason])) for reason in chosen]


def level_range(analysis: Analysis) -> str:
    """Return the lowest and the highest level with their unit."""
    levels = analysis.levels["level_vpp"]
    ends = dict.fromkeys((shortest(levels.min()), shortest(levels.max())))
    return f"{' to '.join(ends)} {analysis.axis.unit}"
