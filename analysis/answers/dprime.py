"""Sensitivity d' at every level, of each person and in the mean, from what was felt of blanks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.answers.counting import counted, offers_none
from analysis.definitions import LIMITS, TOTAL, in_order

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


SENSITIVITY_COLUMNS: Final = (
    "condition",
    "participant",
    "level_vpp",
    "felt",
    "presented",
    "false_alarms",
    "blanks",
    "d_prime",
    "d_prime_low",
    "d_prime_high",
    "d_prime_answered",
)
_COUNTS: Final = ("felt", "presented", "answered")
_BLANKS: Final = ("false_alarms", "blanks", "blanks_answered")
_KEY: Final = ["condition", "participant"]
_FELT: Final = ("left", "right", "both")
_ANSWERS: Final = (*_FELT, "none")


def sensitivity_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return d' of detection per condition, participant and level; the last rows `TOTAL`.

    Columns `SENSITIVITY_COLUMNS`, defined in docs/statistics.md, section 11; the level is NaN in
    the row of all levels together. Only where "none" could be answered and there were blank trials.

    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "reason": "",
    ...     "kind": ["single"] * 9 + ["blank"] * 9, "level_vpp": [60.0] * 9 + [float("nan")] * 9,
    ...     "response": ["left"] * 8 + ["none"] * 9 + ["left"], "none_offered": True})
    >>> table = sensitivity_table(trials)
    >>> table[["participant", "level_vpp", "felt", "false_alarms"]].iloc[:2].to_numpy().tolist()
    [['1', 60.0, 8, 1], ['1', nan, 8, 1]]
    >>> table["d_prime"].round(3).tolist()
    [2.073, 2.073, 2.073, 2.073]
    """
    parts = [
        _condition(str(name), part)
        for name, part in trials[trials["reason"].eq("")].groupby("condition")
        if offers_none(part)
    ]
    parts = [part for part in parts if len(part)]
    return pd.concat(parts, ignore_index=True) if parts else _columns(pd.DataFrame())


def _columns(table: pd.DataFrame) -> pd.DataFrame:
    return table.reindex(columns=list(SENSITIVITY_COLUMNS))


def _condition(condition: str, part: pd.DataFrame) -> pd.DataFrame:
    single, blank = (_marked(counted(part, kind)) for kind in ("single", "blank"))
    of_blanks = blank.groupby("participant")[list(_COUNTS)].sum()
    of_blanks.columns = pd.Index(_BLANKS)
    levels = single.groupby(["participant", "level_vpp"], as_index=False)[list(_COUNTS)].sum()
    together = levels.groupby("participant", as_index=False)[list(_COUNTS)].sum()
    rows = pd.concat([levels, together.assign(level_vpp=np.nan)], ignore_index=True)
    rows = rows.join(of_blanks, on="participant", how="inner")
    if rows.empty:
        return rows
    order = ["participant", "level_vpp"]
    rows = with_d_prime(rows.sort_values(order, key=in_order, ignore_index=True))
    groups = [_mean(level, one) for level, one in rows.groupby("level_vpp", dropna=False)]
    table = pd.concat([rows, pd.DataFrame(groups)], ignore_index=True)
    return _columns(table.assign(condition=condition))


def _marked(trials: pd.DataFrame) -> pd.DataFrame:
    """Mark which trials were felt and answered; a time-out and another key are no answers."""
    response = trials["response"].astype(object)
    return trials[["participant", "level_vpp"]].assign(
        felt=response.isin(_FELT).astype(np.int64),
        presented=1,
        answered=response.isin(_ANSWERS).astype(np.int64),
    )


def with_d_prime(rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows of counts with d', its limits, and d' of the answered trials alone."""
    counts = [rows[name].to_numpy(dtype=np.float64) for name in (*_COUNTS, *_BLANKS)]
    felt, presented, answered, false_alarms, blanks, blanks_answered = counts
    low, high = d_prime_limits(felt, presented, false_alarms, blanks)
    return rows.assign(
        d_prime=z_of(felt, presented) - z_of(false_alarms, blanks),
        d_prime_low=low,
        d_prime_high=high,
        d_prime_answered=np.where(
            (answered > 0) & (blanks_answered > 0),
            z_of(felt, answered) - z_of(false_alarms, blanks_answered),
            np.nan,
        ),
    )


def z_of(count: Floats, of: Floats) -> Floats:
    """Return the normal quantile of (k + 1/2) / (n + 1), exactly opposite for n - k.

    >>> z_of(np.array([0.0, 5.0, 9.0]), np.array([9.0, 10.0, 9.0])).round(3).tolist()
    [-1.645, 0.0, 1.645]
    """
    from scipy.special import ndtri

    fewer = np.minimum(count, of - count)
    z = ndtri((fewer + 0.5) / (of + 1))
    return np.asarray(np.where(count <= of - count, z, -z))


def d_prime_limits(
    felt: Floats, presented: Floats, false_alarms: Floats, blanks: Floats
) -> tuple[Floats, Floats]:
    """Return 95 % limits of d', from those of hits and false alarms.

    Each rate has the limits of Beta(k + 1/2, n - k + 1/2), as quantiles z; their distances from
    the values are added in quadrature (G. Y. Zou, A. Donner, Statist. Med. 27 (2008) 1693-1702).
    """
    from scipy.special import betaincinv, ndtri

    (hit, hit_low, hit_high), (false, false_low, false_high) = (
        (z_of(k, n), *(ndtri(betaincinv(k + 0.5, n - k + 0.5, end)) for end in LIMITS))
        for k, n in ((felt, presented), (false_alarms, blanks))
    )
    at = hit - false
    return (
        np.asarray(at - np.hypot(hit - hit_low, false_high - false)),
        np.asarray(at + np.hypot(hit_high - hit, false - false_low)),
    )


def _mean(level: object, rows: pd.DataFrame) -> dict[str, Any]:
    """Return the row of all: sums of the counts, means of the people's d' with limits by t.

    Where all have the same d', as of the same few counts, t knows no limits.
    """
    from scipy.special import stdtrit

    each = rows["d_prime"].to_numpy(dtype=np.float64)
    number, middle = len(each), float(each.mean())
    half = np.nan
    if number > 1 and np.ptp(each) > 0:
        half = float(stdtrit(number - 1, LIMITS[1]) * each.std(ddof=1) / np.sqrt(number))
    sums = {name: int(rows[name].sum()) for name in (*_COUNTS, *_BLANKS)}
    return {
        "participant": TOTAL,
        "level_vpp": level,
        **sums,
        "d_prime": middle,
        "d_prime_low": middle - half,
        "d_prime_high": middle + half,
        "d_prime_answered": float(rows["d_prime_answered"].mean()),
    }
