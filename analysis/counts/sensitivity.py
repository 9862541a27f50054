"""Sensitivity d' and criterion c, of participants, by level, and of two conditions.

d' = z(H) - z(F) and c = -(z(H) + z(F)) / 2, where H is the rate of single stimuli that were felt,
F that of blank trials, and both have the log-linear correction (k + 1/2) / (n + 1) (M. J. Hautus,
Behav. Res. Methods 27 (1995) 46-51).
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from analysis.counts.checks import condition_order
from analysis.counts.intervals import equal_rates_p, mean_difference, mean_limits
from analysis.counts.table import PERSON, sum_outcomes
from analysis.numbers import LIMITS, TOTAL, in_order
from experiment.tasks.task import BLANK, SINGLE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]


_ENDS: Final = ("", "_low", "_high")
_MEASURES: Final = ("d_prime", "criterion")
_RATES: Final = ("felt", "presented", "false_alarms", "blanks")
_WITH_LIMITS: Final = tuple(f"{name}{end}" for name in _MEASURES for end in _ENDS)
SENSITIVITY_COLUMNS: Final = (
    *("condition", "participant", "level_vpp"),
    *(*_RATES, *_WITH_LIMITS, "d_prime_answered"),
)
_DIFFERENCE: Final = tuple(f"d_prime_difference{end}" for end in _ENDS)
BY_LEVEL_COLUMNS: Final = (
    *("condition_a", "condition_b", "participant", "level_vpp"),
    *("felt_a", "presented_a", "felt_b", "presented_b", "d_prime_a", "d_prime_b", *_DIFFERENCE),
)
_FALSE_ALARMS: Final = (*(f"false_alarm_difference{end}" for end in _ENDS), "false_alarm_p")
BESIDE_COLUMNS: Final = (
    *("first", "false_alarms_a", "blanks_a", "false_alarms_b", "blanks_b"),
    *(*_FALSE_ALARMS, "d_prime_a", "d_prime_b", *_DIFFERENCE),
)


def z_of(count: ArrayLike, of: ArrayLike) -> Floats:
    """Return the normal quantile of (k + 1/2) / (n + 1), exactly opposite for n - k.

    >>> z_of([0, 5, 9], [9, 10, 9]).round(3).tolist()
    [-1.645, 0.0, 1.645]
    """
    from scipy.special import ndtri

    k, n = (np.asarray(counts, dtype=np.float64) for counts in (count, of))
    z = ndtri((np.minimum(k, n - k) + 0.5) / (n + 1))
    return np.asarray(np.where(k <= n - k, z, -z))


def with_sensitivity(rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows of ``felt presented false_alarms blanks`` with d', c and their 95 % limits.

    Each rate has the limits of Beta(k + 1/2, n - k + 1/2), as quantiles z; their distances from
    the values are added in quadrature (G. Y. Zou, A. Donner, Statist. Med. 27 (2008) 1693-1702).

    >>> rows = with_sensitivity(pd.DataFrame([[9, 10, 1, 10]], columns=[*_RATES]))
    >>> rows[["d_prime", "criterion"]].round(3).to_numpy().tolist()
    [[2.194, 0.0]]
    """
    from scipy.special import betaincinv, ndtri

    counts = [rows[name].to_numpy(dtype=np.float64) for name in _RATES]
    (hit, hit_low, hit_high), (false, false_low, false_high) = (
        (z_of(k, n), *(ndtri(betaincinv(k + 0.5, n - k + 0.5, end)) for end in LIMITS))
        for k, n in (counts[:2], counts[2:])
    )
    below, above = (hit - hit_low, false - false_low), (hit_high - hit, false_high - false)
    d_prime, criterion = hit - false, 0.0 - (hit + false) / 2
    return rows.assign(
        d_prime=d_prime,
        d_prime_low=d_prime - np.hypot(below[0], above[1]),
        d_prime_high=d_prime + np.hypot(above[0], below[1]),
        criterion=criterion,
        criterion_low=criterion - np.hypot(*above) / 2,
        criterion_high=criterion + np.hypot(*below) / 2,
    )


def sensitivity_table(counts: pd.DataFrame) -> pd.DataFrame:
    """Return d' and c per condition, participant and level; the last rows are `TOTAL`.

    Columns `SENSITIVITY_COLUMNS`, by the formulas of docs/statistics.md, section 11; the level is
    NaN in the row of all levels together. Only where ``none`` could be answered and there were
    blanks. The rows `TOTAL` have sums of the counts, and means with limits by Student's t.
    """
    single = sum_outcomes(counts, SINGLE, [*PERSON, "level_vpp"])
    together = sum_outcomes(counts, SINGLE, PERSON).assign(level_vpp=np.nan)
    offered = counts.groupby("condition")["none_offered"].transform("all")
    names = {"detected_any": "false_alarms", "presented": "blanks", "answered": "blanks_answered"}
    blanks = sum_outcomes(counts[offered], BLANK, PERSON)[[*PERSON, *names]].rename(columns=names)
    rows = pd.concat([single, together], ignore_index=True).merge(blanks, on=PERSON)
    rows = rows.rename(columns={"detected_any": "felt"})
    if rows.empty:
        return rows.reindex(columns=[*SENSITIVITY_COLUMNS])
    rows = with_sensitivity(rows)
    answered = z_of(rows["felt"], rows["answered"])
    answered = answered - z_of(rows["false_alarms"], rows["blanks_answered"])
    has_answers = rows["answered"].gt(0) & rows["blanks_answered"].gt(0)
    rows["d_prime_answered"] = np.where(has_answers, answered, np.nan)
    key = [rows["condition"], rows["level_vpp"]]
    groups = rows.groupby(key, dropna=False)
    totals = groups[[*_RATES]].sum().assign(d_prime_answered=groups["d_prime_answered"].mean())
    for name in _MEASURES:
        totals[[f"{name}{end}" for end in _ENDS]] = mean_limits(rows[name], key).to_numpy()
    rows = pd.concat([rows, totals.reset_index().assign(participant=TOTAL)])
    rows = rows.sort_values([*PERSON, "level_vpp"], key=in_order, ignore_index=True)
    return rows[[*SENSITIVITY_COLUMNS]]


def d_prime_differences(sensitivity: pd.DataFrame) -> pd.DataFrame:
    """Return by how much d' differs between every two conditions, at each level of both.

    Of the participants with a d' in both conditions, where there are any, else of the two groups.
    Columns `BY_LEVEL_COLUMNS`, of `sensitivity_table`; the last row of a level is `TOTAL`.
    """
    people = _of_people(sensitivity)
    tables = [pd.DataFrame()]
    for a, b in itertools.combinations(sorted(people["condition"].unique()), 2):
        pair = [people[people["condition"].eq(name)] for name in (a, b)]
        paired = bool({*pair[0]["participant"]} & {*pair[1]["participant"]})
        rows = _compare(*_shared(*pair, paired=paired), paired=paired)
        rows = rows.sort_values(["level_vpp", "participant"], key=in_order)
        tables.append(rows.assign(condition_a=a, condition_b=b))
    return pd.concat(tables, ignore_index=True).reindex(columns=[*BY_LEVEL_COLUMNS])


def _of_people(sensitivity: pd.DataFrame) -> pd.DataFrame:
    return sensitivity[sensitivity["participant"].ne(TOTAL) & sensitivity["level_vpp"].notna()]


def _shared(a: pd.DataFrame, b: pd.DataFrame, *, paired: bool) -> list[pd.DataFrame]:
    """Return the rows of levels in both, and of participants in both where these are `paired`."""
    key = ["participant", "level_vpp"] if paired else ["level_vpp"]
    return [rows.merge(of[key].drop_duplicates(), on=key) for rows, of in ((a, b), (b, a))]


def _compare(a: pd.DataFrame, b: pd.DataFrame, *, paired: bool) -> pd.DataFrame:
    """Compare d' of two conditions at every level of both, of participants and of `TOTAL`.

    Of a participant the distances of both limits are added in quadrature; of all the limits are by
    Student's t within participants, or by Welch's t where these differ.
    """
    sums = dict.fromkeys(_RATES, "sum") | {"d_prime": "mean"}
    total_a, total_b = (rows.groupby("level_vpp").agg(sums) for rows in (a, b))
    total = total_a.add_suffix("_a").join(total_b.add_suffix("_b"))
    if not paired:
        groups = [dict([*rows.groupby("level_vpp")["d_prime"]]) for rows in (a, b)]
        welch = [
            mean_difference(*(group[level].to_numpy() for group in groups))[:3]
            for level in total.index
        ]
        total[[*_DIFFERENCE]] = np.reshape(welch, (-1, 3))
        return total.reset_index().assign(participant=TOTAL)
    rows = a.merge(b, on=["participant", "level_vpp"], suffixes=("_a", "_b"))
    (at_a, low_a, high_a), (at_b, low_b, high_b) = (
        [rows[f"d_prime{end}_{which}"] for end in _ENDS] for which in "ab"
    )
    difference = at_b - at_a
    low = difference - np.hypot(at_b - low_b, high_a - at_a)
    high = difference + np.hypot(high_b - at_b, at_a - low_a)
    rows = rows.assign(**dict(zip(_DIFFERENCE, (difference, low, high), strict=True)))
    total[[*_DIFFERENCE]] = mean_limits(difference, [rows["level_vpp"]]).to_numpy()
    return pd.concat([rows, total.reset_index().assign(participant=TOTAL)])


def with_criterion(
    differences: pd.DataFrame,
    trials: pd.DataFrame,
    sensitivity: pd.DataFrame,
    blanks: pd.DataFrame,
    *,
    numbered: bool = True,
) -> pd.DataFrame:
    """Return differences of thresholds with `BESIDE_COLUMNS`, of the same participants.

    ``first`` is the condition that came first, by `condition_order`; in rows `TOTAL`, how many
    participants had which first. d' is of the levels that were presented in both conditions, NaN
    where `sensitivity`, from `sensitivity_table`, has none. The rows `TOTAL` have the means, and
    the difference of false alarms with its test, of `blanks` from `count_false_alarms`.
    """
    table, order = _of_people(sensitivity), condition_order(trials, numbered=numbered)
    sums = {"felt": "sum", "presented": "sum", "false_alarms": "first", "blanks": "first"}
    beside = [pd.DataFrame()]
    for names, pair in differences.groupby(["condition_a", "condition_b"], sort=False):
        a, b = map(str, names)
        people = [name for name in pair["participant"] if name != TOTAL]
        rows = table[table["participant"].isin(people)] if people else table
        at_levels = (rows[rows["condition"].eq(name)] for name in (a, b))
        together = [
            with_sensitivity(rows.groupby("participant", as_index=False).agg(sums)).assign(
                level_vpp=0
            )
            for rows in _shared(*at_levels, paired=bool(people))
        ]
        rows = _compare(*together, paired=bool(people)).set_index("participant")
        rows = rows.reindex(pair["participant"])
        of_pair = order[order["condition_a"].eq(a) & order["condition_b"].eq(b)]
        first = dict(zip(of_pair["participant"], of_pair["first"], strict=True))
        numbers = Counter(filter(None, map(first.get, people))).items()
        first[TOTAL] = ", ".join(f"{name} {number}" for name, number in sorted(numbers)) or None
        rows["first"] = [first.get(name) for name in rows.index]
        of_blanks = (blanks[blanks["condition"].eq(name)] for name in (a, b))
        alarms = _compare_false_alarms(*of_blanks, paired=bool(people))
        is_total = rows.index.to_numpy() == TOTAL
        rows[[*_FALSE_ALARMS]] = np.where(is_total[:, None], alarms, np.nan)
        beside.append(rows)
    columns = pd.concat(beside).reindex(columns=[*BESIDE_COLUMNS]).set_axis(differences.index)
    return pd.concat([differences, columns], axis="columns")


def _compare_false_alarms(a: pd.DataFrame, b: pd.DataFrame, *, paired: bool) -> Sequence[float]:
    """Return by how much false alarms differ between two conditions, with limits and p of the test.

    Within participants the test is the exact Cochran-Mantel-Haenszel test, and the limits are by
    Student's t; of different participants both are by Welch's t.
    """
    both = a.merge(b, on="participant", suffixes=("_a", "_b"))
    if paired and both.empty:
        return [math.nan] * len(_FALSE_ALARMS)
    if both.empty:
        return mean_difference(*((rows["felt"] / rows["presented"]).to_numpy() for rows in (a, b)))
    difference = both["felt_b"] / both["presented_b"] - both["felt_a"] / both["presented_a"]
    limits = mean_limits(difference, [pd.Series(0, both.index)]).iloc[0]
    p = equal_rates_p(both[["felt_a", "felt_b"]], both[["presented_a", "presented_b"]])
    return [*limits, p]
