"""Sensitivity d' and criterion c, of participants, by level, and of two conditions.

d' = z(H) - z(F) and c = -(z(H) + z(F)) / 2, where H is the rate of single stimuli that were felt,
F that of blank trials, and both have the log-linear correction (k + 1/2) / (n + 1) (M. J. Hautus,
Behav. Res. Methods 27 (1995) 46-51).
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from analysis.counts.checks import condition_order
from analysis.counts.intervals import equal_rates_p, mean_difference, mean_limits
from analysis.counts.table import BLANK, SINGLE, sum_outcomes
from analysis.numbers import LIMITS, TOTAL, in_order

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]


_MEASURES: Final = ("d_prime", "criterion")
_WITH_LIMITS: Final = tuple(f"{name}{end}" for name in _MEASURES for end in ("", "_low", "_high"))
SENSITIVITY_COLUMNS: Final = (
    *("condition", "participant", "level_vpp", "felt", "presented", "false_alarms", "blanks"),
    *(*_WITH_LIMITS, "d_prime_answered"),
)
_RATES: Final = ("felt", "presented", "false_alarms", "blanks")
_PERSON: Final = ["condition", "participant"]
_CONDITIONS: Final = ["condition_a", "condition_b"]


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


def _count_felt(counts: pd.DataFrame, kind: str, key: list[str]) -> pd.DataFrame:
    return sum_outcomes(counts, kind, key).rename(columns={"detected_any": "felt"})


def _blanks(counts: pd.DataFrame) -> pd.DataFrame:
    """Return false alarms and blank trials of each participant, of conditions with ``none``."""
    offered = counts.groupby("condition")["none_offered"].transform("all")
    names = {"felt": "false_alarms", "presented": "blanks", "answered": "blanks_answered"}
    blanks = _count_felt(counts[offered], BLANK, _PERSON).rename(columns=names)
    return blanks[[*_PERSON, *names.values()]]


def sensitivity_table(counts: pd.DataFrame) -> pd.DataFrame:
    """Return d' and c per condition, participant and level; the last rows are `TOTAL`.

    Columns `SENSITIVITY_COLUMNS`, by the formulas of docs/statistics.md, section 11; the level is
    NaN in the row of all levels together. Only where ``none`` could be answered and there were
    blanks. The rows `TOTAL` have sums of the counts, and means with limits by Student's t.
    """
    single = _count_felt(counts, SINGLE, [*_PERSON, "level_vpp"])
    together = _count_felt(counts, SINGLE, _PERSON).assign(level_vpp=np.nan)
    rows = pd.concat([single, together], ignore_index=True).merge(_blanks(counts), on=_PERSON)
    if rows.empty:
        return rows.reindex(columns=[*SENSITIVITY_COLUMNS])
    rows = with_sensitivity(rows)
    answered = z_of(rows["felt"], rows["answered"])
    answered = answered - z_of(rows["false_alarms"], rows["blanks_answered"])
    has_answers = rows["answered"].gt(0) & rows["blanks_answered"].gt(0)
    rows["d_prime_answered"] = np.where(has_answers, answered, np.nan)
    totals = _totals(rows, ["condition", "level_vpp"], ["d_prime_answered"])
    return _in_order(pd.concat([rows, totals]))[[*SENSITIVITY_COLUMNS]]


def _totals(rows: pd.DataFrame, key: list[str], means: Iterable[str] = ()) -> pd.DataFrame:
    """Return the rows `TOTAL`: sums of counts, means of d' and c with limits by Student's t."""
    groups = rows.groupby(key, dropna=False)
    measures = [*_WITH_LIMITS, *means]
    sums = groups.sum(numeric_only=True).drop(columns=measures, errors="ignore")
    keys = [rows[name] for name in key]
    for name in _MEASURES:
        limits = mean_limits(rows[name], keys)
        columns = {"mean": name, "low": f"{name}_low", "high": f"{name}_high"}
        sums = sums.join(limits.rename(columns=columns))
    return sums.join(groups[[*means]].mean()).reset_index().assign(participant=TOTAL)


def _in_order(rows: pd.DataFrame) -> pd.DataFrame:
    """Sort by condition, participant and level, with the rows `TOTAL` last in a condition."""
    key = ["condition", "total", "participant", *(["level_vpp"] if "level_vpp" in rows else [])]
    rows = rows.assign(total=rows["participant"].eq(TOTAL))
    return rows.sort_values(key, key=in_order, ignore_index=True)


BY_LEVEL_COLUMNS: Final = (
    *("condition_a", "condition_b", "participant", "level_vpp"),
    *(f"{name}_{which}" for which in "ab" for name in ("felt", "presented")),
    *("d_prime_a", "d_prime_b"),
    *(f"d_prime_difference{end}" for end in ("", "_low", "_high")),
)
BESIDE_COLUMNS: Final = (
    *("first", "false_alarms_a", "blanks_a", "false_alarms_b", "blanks_b"),
    *(f"false_alarm_difference{end}" for end in ("", "_low", "_high")),
    *("false_alarm_p", "d_prime_a", "d_prime_b"),
    *BY_LEVEL_COLUMNS[-3:],
)


def d_prime_differences(sensitivity: pd.DataFrame) -> pd.DataFrame:
    """Return by how much d' differs between every two conditions, at each level of both.

    Of the participants with a d' in both conditions, where there are any, else of the two groups.
    Columns `BY_LEVEL_COLUMNS`, of `sensitivity_table`; the last row of a level is `TOTAL`.
    """
    people = _of_people(sensitivity)
    tables = []
    for a, b in itertools.combinations(sorted(people["condition"].unique()), 2):
        pair = [people[people["condition"].eq(name)] for name in (a, b)]
        shared = {*pair[0]["participant"]} & {*pair[1]["participant"]}
        rows = _compare(*pair, paired=bool(shared)).assign(condition_a=a, condition_b=b)
        key = ["level_vpp", "total", "participant"]
        rows = rows.assign(total=rows["participant"].eq(TOTAL)).sort_values(key, key=in_order)
        tables.append(rows)
    table = pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
    return table.reindex(columns=[*BY_LEVEL_COLUMNS])


def _of_people(sensitivity: pd.DataFrame) -> pd.DataFrame:
    return sensitivity[sensitivity["participant"].ne(TOTAL) & sensitivity["level_vpp"].notna()]


def _shared(a: pd.DataFrame, b: pd.DataFrame, *, paired: bool) -> list[pd.DataFrame]:
    """Return the rows of levels in both, and of participants in both where these are `paired`."""
    key = ["participant", "level_vpp"] if paired else ["level_vpp"]
    return [
        a.merge(b[key].drop_duplicates(), on=key),
        b.merge(a[key].drop_duplicates(), on=key),
    ]


def _compare(a: pd.DataFrame, b: pd.DataFrame, *, paired: bool) -> pd.DataFrame:
    """Compare d' of two conditions at every level of both, of participants and of `TOTAL`.

    Of a participant the distances of both limits are added in quadrature; of all the limits are by
    Student's t within participants, or by Welch's t where these differ.
    """
    key, name = ["participant", "level_vpp"], "d_prime_difference"
    a, b = _shared(a, b, paired=paired)
    columns = [*key, *_RATES, "d_prime", "d_prime_low", "d_prime_high"]
    rows = a[columns].merge(b[columns], on=key, suffixes=("_a", "_b"))
    if paired:
        (at_a, low_a, high_a), (at_b, low_b, high_b) = (
            [rows[f"d_prime{end}_{which}"] for end in ("", "_low", "_high")] for which in "ab"
        )
        difference = at_b - at_a
        rows[name] = difference
        rows[f"{name}_low"] = difference - np.hypot(at_b - low_b, high_a - at_a)
        rows[f"{name}_high"] = difference + np.hypot(high_b - at_b, at_a - low_a)
        limits = mean_limits(difference, [rows["level_vpp"]])
    else:
        each_a, each_b = (dict([*table.groupby("level_vpp")["d_prime"]]) for table in (a, b))
        welch = {
            level: mean_difference(each_a[level].to_numpy(), each_b[level].to_numpy())
            for level in each_a
        }
        limits = pd.DataFrame.from_dict(welch, "index", columns=["mean", "low", "high", "p"])
    means = dict.fromkeys(_RATES, "sum") | {"d_prime": "mean"}
    sums = [table.groupby("level_vpp").agg(means) for table in (a, b)]
    ends = {"mean": name, "low": f"{name}_low", "high": f"{name}_high"}
    total = sums[0].add_suffix("_a").join([sums[1].add_suffix("_b"), limits[[*ends]]])
    total = total.rename(columns=ends).rename_axis("level_vpp").reset_index()
    return pd.concat([*([rows] if len(rows) else []), total.assign(participant=TOTAL)])


def with_criterion(
    differences: pd.DataFrame,
    trials: pd.DataFrame,
    sensitivity: pd.DataFrame,
    *,
    blank: pd.DataFrame | None = None,
    numbered: bool = True,
) -> pd.DataFrame:
    """Return differences of thresholds with `BESIDE_COLUMNS`, of the same participants.

    ``first`` is the condition that came first, by `condition_order`. d' is of the levels that were
    presented in both conditions, NaN where `sensitivity`, from `sensitivity_table`, has none. The
    rows `TOTAL` have the means, and the difference of false alarms with its test, of the table
    `blank` from `count_blanks`.
    """
    if differences.empty:
        return differences.assign(**{name: [] for name in BESIDE_COLUMNS})
    order = condition_order(trials, numbered=numbered).set_index(["participant", *_CONDITIONS])
    rows = []
    for (a, b), pair in differences.groupby(_CONDITIONS, sort=False):
        people = [name for name in pair["participant"] if name != TOTAL]
        beside = _beside(sensitivity, (str(a), str(b)), people).set_index("participant")
        first = {name: order["first"].get((name, str(a), str(b))) for name in people}
        for name in pair["participant"]:
            row = beside.loc[name].to_dict() if name in beside.index else {}
            row["first"] = _count_first(first.values()) if name == TOTAL else first[name]
            if name == TOTAL and blank is not None:
                row |= _compare_false_alarms(blank, (str(a), str(b)), paired=bool(people))
            rows.append(row)
    table = pd.DataFrame(rows, index=differences.index).reindex(columns=[*BESIDE_COLUMNS])
    return pd.concat([differences, table], axis="columns")


def _count_first(firsts: Iterable[str | None]) -> str | None:
    """Return how often each condition came first.

    >>> _count_first(["covered", "bare", "bare", None])
    'bare 2, covered 1'
    """
    names = [name for name in firsts if name is not None]
    return ", ".join(f"{name} {names.count(name)}" for name in sorted({*names})) or None


def _beside(sensitivity: pd.DataFrame, pair: tuple[str, str], people: list[str]) -> pd.DataFrame:
    """Compare false alarms and d' of two conditions, over the levels of both together."""
    table = _of_people(sensitivity)
    if people:
        table = table[table["participant"].isin(people)]
    a, b = (table[table["condition"].eq(condition)] for condition in pair)
    sums = {"felt": "sum", "presented": "sum", "false_alarms": "first", "blanks": "first"}
    together = [
        with_sensitivity(rows.groupby("participant", as_index=False).agg(sums)).assign(level_vpp=0)
        for rows in _shared(a, b, paired=bool(people))
    ]
    return _compare(together[0], together[1], paired=bool(people))


def _compare_false_alarms(
    blank: pd.DataFrame, pair: tuple[str, str], *, paired: bool
) -> dict[str, float]:
    """Return by how much false alarms differ between two conditions, and p of the one test.

    Within participants the test is the exact Cochran-Mantel-Haenszel test, and the limits are by
    Student's t; of different participants both are by Welch's t.
    """
    names = BESIDE_COLUMNS[5:9]
    if not {*pair} <= {*blank.get("condition", ())}:
        return {}
    rows = blank[blank["participant"].ne(TOTAL) & blank["presented"].gt(0)]
    rows = rows.assign(alarms=(rows["p"] * rows["presented"]).round())
    a, b = (rows[rows["condition"].eq(name)] for name in pair)
    both = a.merge(b, on="participant", suffixes=("_a", "_b"))
    if len(both):
        p = equal_rates_p(both[["alarms_a", "alarms_b"]], both[["presented_a", "presented_b"]])
        difference = both["p_b"] - both["p_a"]
        limits = mean_limits(difference, [pd.Series(0, both.index)]).iloc[0]
        return dict(zip(names, (*limits, p), strict=True))
    if paired:
        return {}
    return dict(zip(names, mean_difference(a["p"].to_numpy(), b["p"].to_numpy()), strict=True))
