"""What stands beside a difference of thresholds: false alarms, d', and which condition came first.

Where "none" can be answered, a threshold moves with the willingness to say "felt"; d' at one level
hardly does.
"""

from __future__ import annotations

import math
from collections import defaultdict
from itertools import groupby
from operator import itemgetter
from statistics import median
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.answers.counting import COUNTED_KINDS
from analysis.answers.dprime import d_prime_limits, z_of
from analysis.definitions import LIMITS, TOTAL
from analysis.groups.sensitivity import d_prime_apart, means_apart

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


BESIDE_COLUMNS: Final = (
    "first",
    "false_alarms_a",
    "blanks_a",
    "false_alarms_b",
    "blanks_b",
    "false_alarm_difference",
    "false_alarm_difference_low",
    "false_alarm_difference_high",
    "d_prime_a",
    "d_prime_b",
    "d_prime_difference",
    "d_prime_difference_low",
    "d_prime_difference_high",
)
_ALARMS_APART: Final = BESIDE_COLUMNS[5:8]
_MOST_EXACT: Final = 10_000
"""Of more false alarms the test is that of the normal distribution."""
MIXED: Final = "interleaved"
"""What came first where trials of both conditions take turns."""
ALTERNATED: Final = "alternated"
"""The same of blocks: half of the runs of either condition are `_BLOCK` trials or longer."""
_BLOCK: Final = 4


def with_criterion(
    differences: pd.DataFrame,
    trials: pd.DataFrame,
    sensitivity: pd.DataFrame,
    *,
    blank: pd.DataFrame | None = None,
    numbered: bool = True,
) -> pd.DataFrame:
    """Return differences with `BESIDE_COLUMNS`, of the same people.

    d' is of the levels that were presented in both conditions; in a row `TOTAL` the mean of the
    participants. It is NaN where `sensitivity`, from `sensitivity_table`, has none. By how much
    false alarms differ is told in the rows `TOTAL`, of the table `blank` from `blank_table`. The
    order within a block is not known of trials that are not `numbered`.
    """
    if differences.empty:
        return differences.assign(**{name: [] for name in BESIDE_COLUMNS})
    places = _places(trials, numbered=numbered)
    rows = []
    for (a, b), pair in differences.groupby(["condition_a", "condition_b"], sort=False):
        people = [name for name in pair["participant"] if name != TOTAL]
        order = {name: _first(places, name, (str(a), str(b)), numbered=numbered) for name in people}
        each = _beside(sensitivity, (str(a), str(b)), people)
        for name in pair["participant"]:
            told = each.get(name, {})
            first = _count(order.values()) if name == TOTAL else order[name]
            rows.append({"first": first} | told)
        rows[-1] |= _alarms_apart(blank, str(a), str(b), paired=bool(people))
    beside = pd.DataFrame(rows, columns=list(BESIDE_COLUMNS), index=differences.index)
    return pd.concat([differences, beside], axis="columns")


def _places(trials: pd.DataFrame, *, numbered: bool) -> dict[tuple[str, str], set[Any]]:
    """Return the places (session, block, trial) of each participant's conditions."""
    if trials.empty:
        return {}
    shown = trials[trials["kind"].isin(COUNTED_KINDS) & trials["reason"].eq("")]
    key = ["session", "block", *(["trial"] if numbered else [])]
    pairs = zip(*(shown[name] for name in key), strict=True)
    places: dict[tuple[str, str], set[Any]] = defaultdict(set)
    for person, condition, place in zip(
        shown["participant"], shown["condition"], pairs, strict=True
    ):
        places[person, condition].add(place)
    return places


def _first(
    held: dict[tuple[str, str], set[Any]], name: str, pair: tuple[str, str], *, numbered: bool
) -> str | None:
    """Return the condition that ended before the other began; None where that is not known."""
    a, b = (held.get((name, condition)) for condition in pair)
    if a is None or b is None:
        return None
    if max(a) < min(b) or max(b) < min(a):
        return pair[0] if max(a) < min(b) else pair[1]
    if not numbered:
        return ALTERNATED if a.isdisjoint(b) else None
    runs: list[list[int]] = [[], []]
    for of_b, places in groupby(
        sorted([*((at, 0) for at in a), *((at, 1) for at in b)]), itemgetter(1)
    ):
        runs[of_b].append(len([*places]))
    return ALTERNATED if min(median(each) for each in runs) >= _BLOCK else MIXED


def _count(firsts: Iterable[str | None]) -> str | None:
    """Say how often each condition came first.

    >>> _count(["covered", "bare", "bare", None])
    'bare 2, covered 1'
    """
    known = [one for one in firsts if one is not None]
    return ", ".join(f"{one} {known.count(one)}" for one in sorted(set(known))) or None


def _beside(
    sensitivity: pd.DataFrame, pair: tuple[str, str], people: list[str]
) -> dict[str, dict[str, float]]:
    """Return false alarms and d' in both conditions, of each of the people and of all."""
    table = sensitivity[sensitivity["participant"].ne(TOTAL) & sensitivity["level_vpp"].notna()]
    parts = [table[table["condition"].eq(condition)] for condition in pair]
    if people:
        parts = [part[part["participant"].isin(people)] for part in parts]
        keys = [[*zip(part["participant"], part["level_vpp"], strict=True)] for part in parts]
        parts = [
            part[np.array([key in other for key in own], dtype=bool)]
            for part, own, other in zip(parts, keys, ({*keys[1]}, {*keys[0]}), strict=True)
        ]
    else:
        levels = {*parts[0]["level_vpp"]} & {*parts[1]["level_vpp"]}
        parts = [part[part["level_vpp"].isin(levels)] for part in parts]
    found: dict[str, dict[str, float]] = {}
    own: list[pd.DataFrame] = []
    for part, suffix in zip(parts, "ab", strict=True):
        each = part.groupby("participant", as_index=False).agg(
            {"felt": "sum", "presented": "sum", "false_alarms": "first", "blanks": "first"}
        )
        felt, presented, false_alarms, blanks = (
            each[name].to_numpy(dtype=np.float64)
            for name in ("felt", "presented", "false_alarms", "blanks")
        )
        d_prime = z_of(felt, presented) - z_of(false_alarms, blanks)
        low, high = d_prime_limits(felt, presented, false_alarms, blanks)
        own.append(
            pd.DataFrame({"at": d_prime, "low": low, "high": high}, index=each["participant"])
        )
        names = [*each["participant"], TOTAL] if len(each) else []
        columns = (
            [*false_alarms, false_alarms.sum()],
            [*blanks, blanks.sum()],
            [*d_prime, d_prime.mean() if len(each) else np.nan],
        )
        for name, *values in zip(names, *columns, strict=False):
            told = zip(("false_alarms", "blanks", "d_prime"), values, strict=True)
            found.setdefault(name, {}).update({f"{key}_{suffix}": value for key, value in told})
    for name, of in d_prime_apart(*own, paired=bool(people)).items():
        found[name].update(zip(BESIDE_COLUMNS[-3:], of, strict=True))
    return found


def _alarms_apart(blank: pd.DataFrame | None, a: str, b: str, *, paired: bool) -> dict[str, float]:
    """Return by how much false alarms differ: within people, or else between groups of them."""
    if blank is None or not {a, b} <= {*blank.get("condition", ())}:
        return {}
    people, alarms, presented = alarms_of(blank, a, b)
    if people or paired:
        found = rates_apart(alarms, presented) if people else ()
        return dict(zip(_ALARMS_APART, found, strict=False))
    rows = blank[blank["participant"].ne(TOTAL) & blank["presented"].gt(0)]
    shares = (rows.loc[rows["condition"].eq(name), "p"].to_numpy(float) for name in (a, b))
    return dict(zip(_ALARMS_APART, means_apart(*shares), strict=True))


def alarms_of(
    blank: pd.DataFrame, a: str, b: str
) -> tuple[list[str], list[tuple[int, ...]], list[tuple[int, ...]]]:
    """Return who is in both conditions; false alarms and blanks in each of theirs, or of totals."""
    rows = blank.assign(alarms=(blank["p"] * blank["presented"]).round())
    both = [
        rows[rows["condition"].eq(name)].set_index("participant")[["alarms", "presented"]]
        for name in (a, b)
    ]
    people = [name for name in both[0].index if name != TOTAL and name in both[1].index]
    alarms, presented = (
        [tuple(int(table.loc[name, of]) for table in both) for name in people or [TOTAL]]
        for of in ("alarms", "presented")
    )
    return people, alarms, presented


def rates_apart(
    alarms: Sequence[Sequence[int]], blanks: Sequence[Sequence[int]]
) -> tuple[float, float, float]:
    """Return by how much false alarms are more frequent in the second condition, with limits.

    The mean over participants of the difference of their shares, with 95 % limits by Student's t:
    NaN where there is one, or where all differ by the same.

    >>> apart = rates_apart([(1, 3), (2, 2), (0, 1)], [(20, 20)] * 3)
    >>> [round(one, 3) for one in apart]
    [0.05, -0.074, 0.174]
    """
    from scipy.stats import t

    shares = np.array(alarms) / np.array(blanks)
    differences = shares[:, 1] - shares[:, 0]
    middle, number = float(differences.mean()), len(differences)
    if number < 2 or np.ptp(differences) == 0:  # noqa: PLR2004
        return middle, math.nan, math.nan
    half = float(t.ppf(LIMITS[1], number - 1) * differences.std(ddof=1)) / number**0.5
    return middle, middle - half, middle + half


def same_rates_p(alarms: Sequence[Sequence[int]], blanks: Sequence[Sequence[int]]) -> float:
    """Test whether false alarms are equally frequent in two conditions, two-sided.

    Exact, within participants: given a participant's false alarms in both conditions together, how
    many of them are in the first is hypergeometric where both are equally frequent; these are
    summed over participants (Fisher's test of one participant). p is the probability of all sums
    that are no likelier than the one seen.

    Parameters
    ----------
    alarms, blanks : sequence of sequence of int
        False alarms and blank trials of each participant, in either condition.

    Examples
    --------
    >>> round(same_rates_p([(1, 9)], [(10, 10)]), 5)
    0.00109
    >>> same_rates_p([(2, 2), (0, 0)], [(20, 20), (20, 20)])
    1.0
    """
    from scipy.stats import hypergeom, norm

    together = [sum(one) for one in alarms]
    seen = sum(first for first, _ in alarms)
    given = [(a + b, told, a) for told, (a, b) in zip(together, blanks, strict=True)]
    if sum(together) > _MOST_EXACT:
        chances = [hypergeom(*one) for one in given]
        mean, variance = (sum(float(getattr(x, of)()) for x in chances) for of in ("mean", "var"))
        far = max(abs(seen - mean) - 0.5, 0.0)  # corrected for continuity
        return float(2 * norm.sf(far / variance**0.5)) if variance else 1.0
    density, least = np.ones(1), 0
    for of, told, a in given:
        low, high = max(0, told - (of - a)), min(told, a)
        density = np.convolve(density, hypergeom.pmf(np.arange(low, high + 1), of, told, a))
        least += low
    rare = density <= density[seen - least] * (1 + 1e-7)
    return min(float(density[rare].sum()), 1.0)
