"""By how much d' differs between two conditions, at each level."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from analysis.definitions import LIMITS, TOTAL, counted_up

if TYPE_CHECKING:
    from numpy.typing import NDArray

BY_LEVEL_COLUMNS: Final = (
    "condition_a",
    "condition_b",
    "participant",
    "level_vpp",
    "felt_a",
    "presented_a",
    "felt_b",
    "presented_b",
    "d_prime_a",
    "d_prime_b",
    "d_prime_difference",
    "d_prime_difference_low",
    "d_prime_difference_high",
)
NEARLY_ALL: Final = 0.9
"""Where a larger share is felt in a condition, d' there hardly tells more than false alarms."""
SEVERAL: Final = 2
"""A criterion alone lets d' differ at so many levels, all one way, in few studies (section 11)."""
_TOLD: Final = ["felt", "presented", "d_prime", "d_prime_low", "d_prime_high"]


def d_prime_differences(sensitivity: pd.DataFrame) -> pd.DataFrame:
    """Return by how much d' differs between every two conditions, at each level of both.

    Of the people who have a d' in both conditions, where there are any, else of the two groups.

    Parameters
    ----------
    sensitivity
        From `sensitivity_table`.

    Returns
    -------
    pandas.DataFrame
        Columns `BY_LEVEL_COLUMNS`; the last row of a level is that of all, ``all``.
    """
    own = sensitivity[sensitivity["participant"].ne(TOTAL) & sensitivity["level_vpp"].notna()]
    rows: list[dict[str, object]] = []
    for names in itertools.combinations(sorted(own["condition"].unique()), 2):
        parts = [own[own["condition"].eq(name)] for name in names]
        both = {*parts[0]["participant"]} & {*parts[1]["participant"]}
        levels = {*parts[0]["level_vpp"]} & {*parts[1]["level_vpp"]}
        of_pair = dict(zip(("condition_a", "condition_b"), names, strict=True))
        for level in sorted(levels):
            a, b = (
                part[part["level_vpp"].eq(level)].set_index("participant")[_TOLD] for part in parts
            )
            rows += [
                of_pair | row | {"level_vpp": level} for row in _level(a, b, paired=bool(both))
            ]
    return pd.DataFrame(rows, columns=list(BY_LEVEL_COLUMNS))


def _level(a: pd.DataFrame, b: pd.DataFrame, *, paired: bool) -> list[dict[str, object]]:
    """Return the rows of a level, of each who was there in both conditions and of all."""
    if paired:
        shared = sorted(a.index.intersection(b.index), key=counted_up)
        a, b = a.loc[shared], b.loc[shared]
    ends = {"d_prime": "at", "d_prime_low": "low", "d_prime_high": "high"}
    apart = d_prime_apart(*(table.rename(columns=ends) for table in (a, b)), paired=paired)
    rows = []
    for name, of in apart.items():
        row: dict[str, object] = {"participant": name}
        for table, suffix in ((a, "a"), (b, "b")):
            some = table if name == TOTAL else table.loc[[name]]
            row |= {f"{count}_{suffix}": int(some[count].sum()) for count in ("felt", "presented")}
            row[f"d_prime_{suffix}"] = float(some["d_prime"].mean())
        rows.append(row | dict(zip(BY_LEVEL_COLUMNS[-3:], of, strict=True)))
    return rows


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelsApart:
    """At which levels d' of b is lower or higher than that of a, and where it tells little.

    `most_felt` has the larger of both shares at each of the levels of which `nearly_all` was felt.
    """

    lower: tuple[float, ...]
    higher: tuple[float, ...]
    not_apart: tuple[float, ...]
    nearly_all: tuple[float, ...]
    most_felt: tuple[float, ...]

    @property
    def number(self) -> int:
        """How many levels tell something."""
        return len(self.lower) + len(self.higher) + len(self.not_apart)


def levels_apart(rows: pd.DataFrame) -> LevelsApart | None:
    """Sort levels by how d' differs there; None where it has no interval anywhere.

    Parameters
    ----------
    rows
        Of `d_prime_differences`, one of each level.
    """
    rows = rows[rows["d_prime_difference_low"].notna()]
    if rows.empty:
        return None
    low, high = (rows[f"d_prime_difference_{end}"] for end in ("low", "high"))
    a, b = (rows[f"felt_{which}"] / rows[f"presented_{which}"] for which in "ab")
    nearly = (a > NEARLY_ALL) | (b > NEARLY_ALL)
    which = {"lower": high < 0, "higher": low > 0, "not_apart": (low <= 0) & (high >= 0)}
    told = {name: tuple(rows.loc[here & ~nearly, "level_vpp"]) for name, here in which.items()}
    most = np.maximum(a, b)[nearly]
    at = rows.loc[nearly, "level_vpp"]
    return LevelsApart(nearly_all=tuple(at), most_felt=tuple(most), **told)


def means_apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return by how much the mean of b lies above that of a, with 95 % limits by Welch's t.

    The limits are NaN where either has one value, or all of each are the same, and all where one
    has none.

    >>> apart = means_apart(np.array([0.0, 0.1, 0.05]), np.array([0.1, 0.3, 0.2, 0.2]))
    >>> [round(one, 3) for one in apart]
    [0.15, 0.021, 0.279]
    """
    from scipy.stats import t

    middle = float(b.mean() - a.mean()) if len(a) and len(b) else math.nan
    if min(len(a), len(b)) < 2 or np.ptp(a) + np.ptp(b) == 0:  # noqa: PLR2004
        return middle, math.nan, math.nan
    parts = [float(one.var(ddof=1)) / len(one) for one in (a, b)]
    free = sum(parts) ** 2 / sum(
        part**2 / (len(one) - 1) for part, one in zip(parts, (a, b), strict=True)
    )
    half = float(t.ppf(LIMITS[1], free)) * sum(parts) ** 0.5
    return middle, middle - half, middle + half


def d_prime_apart(
    a: pd.DataFrame, b: pd.DataFrame, *, paired: bool
) -> dict[str, tuple[float, float, float]]:
    """Return by how much d' of b lies above that of a, with 95 % limits, of each and of `TOTAL`.

    Of a person the distances of both limits are added in quadrature, as those of a d' are; of all
    it is the mean by Student's t, within people, or by Welch's where these are others.
    """
    from scipy.stats import t

    if a.empty or b.empty:
        return {}
    if not paired:
        return {TOTAL: means_apart(*(table["at"].dropna().to_numpy(float) for table in (a, b)))}
    one, other = (table.loc[a.index.intersection(b.index)] for table in (a, b))
    at = other["at"] - one["at"]
    if at.empty:
        return {}
    low = at - np.hypot(other["at"] - other["low"], one["high"] - one["at"])
    high = at + np.hypot(other["high"] - other["at"], one["at"] - one["low"])
    found = {
        str(name): (float(x), float(least), float(most))
        for name, x, least, most in zip(at.index, at, low, high, strict=True)
    }
    middle, variance, free = float(at.mean()), at.var() / len(at), len(at) - 1.0
    # All alike tells no spread.
    half = t.ppf(LIMITS[1], free) * variance**0.5 if free > 0 and variance > 0 else np.nan
    return found | {TOTAL: (middle, float(middle - half), float(middle + half))}
