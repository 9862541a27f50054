"""Tables of groups: the threshold of each condition, and the difference of every two."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from analysis.axis import alike, bounded, rounded, spread_of, times, with_limits
from analysis.definitions import counted_up
from analysis.groups.group import difference_on_axis, threshold_on_axis
from analysis.groups.hierarchy import FEW, PeopleTables
from analysis.thresholds.fit import BOUNDED, WITH_THRESHOLD
from analysis.thresholds.table import WORDS, levels_of

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.groups.difference import Difference
    from analysis.groups.group import ConditionDifference, GroupFit
    from analysis.thresholds.fit import FitStatus
    from analysis.thresholds.people import PersonCounts

    Floats = NDArray[np.float64]


GROUP_COLUMNS: Final = (
    "condition",
    "participants",
    "status",
    "threshold_vpp",
    "threshold_low_vpp",
    "threshold_high_vpp",
    "spread_db",
    "spread_low_db",
    "spread_high_db",
    "new_low_vpp",
    "new_high_vpp",
    "printed",
    "below",
    "above",
)
DIFFERENCE_COLUMNS: Final = (
    "condition_a",
    "condition_b",
    "participant",
    "difference_db",
    "low_db",
    "high_db",
    "spread_db",
    "spread_low_db",
    "spread_high_db",
    "status",
    "printed",
)
GROUP: Final = "all"
_ALONE: Final = "one participant tells nothing of others"
_BELOW: Final = ("threshold_below_levels", "median_below_levels")
_ABOVE: Final = ("threshold_above_levels", "median_above_levels")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Without:
    """Groups and their differences, as the tables below have them, without some people."""

    names: tuple[str, ...]
    groups: pd.DataFrame
    differences: pd.DataFrame


def group_table(people: PersonCounts, thresholds: pd.DataFrame, axis: Axis) -> pd.DataFrame:
    """Return the threshold of the group of each condition, in which everybody takes part.

    Parameters
    ----------
    people : PersonCounts
        From `people_of`, or `people_of_counts`.
    thresholds : pandas.DataFrame
        From `thresholds_of`: theirs, and maybe those of others.
    axis : Axis
        Of the levels.

    Returns
    -------
    pandas.DataFrame
        Columns `GROUP_COLUMNS`, defined in docs/statistics.md, section 4; ``below`` and ``above``
        count the people whose own threshold lies outside the levels.
    """
    people = people.by_content()
    own = thresholds.set_index(["condition", "participant"])["status"].to_dict()
    conditions = _conditions(people)
    statuses = {name: [own[people.names[i]] for i in rows] for name, rows in conditions.items()}
    tables = {name: _tables(people, rows, axis) for name, rows in conditions.items()}
    fits = {
        name: threshold_on_axis(tables[name], statuses[name])
        for name, rows in conditions.items()
        if len(rows) > 1
    }
    told = [name for name, fit in fits.items() if fit.status in WITH_THRESHOLD]
    spreads = alike([_spread(fits[name], tables[name], axis) for name in told])
    of = dict(zip(told, spreads, strict=True))
    rows = [
        [name, *_group(tables[name], fits.get(name), statuses[name], axis, of.get(name))]
        for name in conditions
    ]
    return pd.DataFrame(rows, columns=list(GROUP_COLUMNS))


def difference_table(people: PersonCounts, axis: Axis) -> pd.DataFrame:
    """Return the difference of every two conditions in dB, per participant and for the group.

    The same people are compared where any took part in both, and others are left out there; where
    nobody did, the groups are. Nothing is compared on a linear axis, which has no dB.

    Parameters
    ----------
    people, axis
        As for `group_table`.

    Returns
    -------
    pandas.DataFrame
        Columns `DIFFERENCE_COLUMNS`; the last row of a pair is the group's, ``all``.
    """
    people = people.by_content()
    rows: list[list[object]] = []
    if axis.is_logarithmic:
        for (a, rows_a), (b, rows_b) in itertools.combinations(_conditions(people).items(), 2):
            rows += [[a, b, *row] for row in _pair(people, rows_a, rows_b, axis)]
    return pd.DataFrame(rows, columns=list(DIFFERENCE_COLUMNS))


def without_people(
    names: Collection[str], people: PersonCounts, thresholds: pd.DataFrame, axis: Axis
) -> Without | None:
    """Return groups and differences without people of these names; ``None`` without any, or all."""
    places = [i for i, (_, who) in enumerate(people.names) if who not in names]
    if not names or not places:
        return None
    others = people.at(places)
    return Without(
        names=tuple(sorted(names, key=counted_up)),
        groups=group_table(others, thresholds, axis),
        differences=difference_table(others, axis),
    )


def _conditions(people: PersonCounts) -> dict[str, list[int]]:
    """Return the rows of each condition, sorted by name."""
    names = sorted({condition for condition, _ in people.names})
    return {
        name: [i for i, (condition, _) in enumerate(people.names) if condition == name]
        for name in names
    }


def _tables(people: PersonCounts, rows: Sequence[int], axis: Axis) -> PeopleTables:
    chosen = list(rows)
    return PeopleTables(
        x=axis.on_axis(people.level_vpp[chosen]),
        detected=people.detected[chosen],
        presented=people.presented[chosen],
        guesses=[people.guesses[i].rate for i in chosen],
        x_scale=axis.fitted,
    )


def _levels_vpp(tables: PeopleTables, axis: Axis) -> list[float]:
    return [axis.level(float(x)) for x in np.unique(tables.x[tables.presented > 0])]


def _spread(fit: GroupFit, tables: PeopleTables, axis: Axis) -> float:
    """Return by what a group's threshold would be rounded, were there no other beside it."""
    low, high = levels_of(fit.threshold_limits, axis)
    return spread_of(low, axis.level(fit.threshold), high, _levels_vpp(tables, axis))


def _group(
    tables: PeopleTables,
    fit: GroupFit | None,
    statuses: Sequence[FitStatus],
    axis: Axis,
    spread: float | None,
) -> list[object]:
    """Return the values of a group, from ``participants`` on, of `GROUP_COLUMNS`."""
    number = len(tables.x)
    if fit is None:
        return [number, "one_participant", *[math.nan] * 8, _ALONE, math.nan, math.nan]
    outside = [sum(one in words for one in statuses) for words in (_BELOW, _ABOVE)]
    levels_vpp = _levels_vpp(tables, axis)
    at, new = (levels_of(limits, axis) for limits in (fit.threshold_limits, fit.new_person_limits))
    return [
        number,
        fit.status,
        *(_known(value) for value in (axis.level(fit.threshold), *at)),
        *(_known(value) for value in (fit.spread_db, *fit.spread_limits_db, *new)),
        _group_words(fit, number, levels_vpp, axis, spread),
        *outside,
    ]


def _known(value: float) -> float:
    return value if math.isfinite(value) else math.nan


def _group_words(
    fit: GroupFit, number: int, levels_vpp: Sequence[float], axis: Axis, spread: float | None
) -> str:
    low, high = levels_of(fit.threshold_limits, axis)
    if fit.status in BOUNDED:
        return bounded(low, high, axis.unit, levels_vpp)
    if fit.status not in WITH_THRESHOLD:
        return WORDS[fit.status]
    words = with_limits(axis.level(fit.threshold), low, high, axis.unit, levels_vpp, spread=spread)
    unit = "dB" if axis.is_logarithmic else axis.unit
    least, most = fit.spread_limits_db
    told = [rounded(value, most - least) for value in (fit.spread_db, least, most)]
    words += f"; between people {told[0]} {unit} ({told[1]} to {told[2]})"
    return f"{words}, mostly from its prior" if number < FEW else words


def _pair(
    people: PersonCounts, rows_a: Sequence[int], rows_b: Sequence[int], axis: Axis
) -> list[list[object]]:
    """Return the rows of two conditions, from ``participant`` on."""
    of_a, of_b = ({people.names[i][1]: i for i in rows} for rows in (rows_a, rows_b))
    both = [name for name in of_a if name in of_b]
    chosen = (
        ([of_a[name] for name in both], [of_b[name] for name in both]) if both else (rows_a, rows_b)
    )
    a, b = (_tables(people, rows, axis) for rows in chosen)
    found = difference_on_axis(a, b, same_people=bool(both))
    rows = [[name, *_difference(one, axis)] for name, one in zip(both, found.people, strict=True)]
    rows.sort(key=lambda row: counted_up(str(row[0])))
    alone = len(both) == 1 or (not both and min(len(rows_a), len(rows_b)) == 1)
    group = [*[math.nan] * 6, "one_participant", _ALONE] if alone else _difference(found, axis)
    return [*rows, [GROUP, *group]]


def _difference(one: Difference | ConditionDifference, axis: Axis) -> list[object]:
    # Of levels in dB nobody asks for the ratio of what they are the level of.
    ratio = "" if axis.signed else f", {times(one.difference_db, *one.difference_limits_db)}"
    low, high = one.difference_limits_db
    at, least, most = (round(end, 1) + 0.0 for end in (one.difference_db, low, high))  # no -0.0
    # A sign at the beginning, or after a comma, would look like a formula to a spreadsheet.
    told = f"not told apart: {at:+.1f} dB ({least:+.1f} to {most:+.1f})"
    if least > 0 or most < 0:
        near, far = sorted((abs(low), abs(high)))
        more = "lower" if most < 0 else "higher"
        told = f"{more} by {abs(one.difference_db):.1f} dB ({near:.1f} to {far:.1f})"
    return [
        one.difference_db,
        _known(low),
        _known(high),
        *(_known(value) for value in (one.spread_db, *one.spread_limits_db)),
        one.status,
        {
            "ok": f"{told}{ratio}",
            "at_least": f"at least {low:+.1f} dB (95 %)",
            "at_most": f"at most {high:+.1f} dB (95 %)",
            "unknown": "not bounded by these levels",
        }[one.status],
    ]
