"""Thresholds in micrometres: what the plan tells of the own finger's displacement per volt."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import pandas as pd

from analysis.axis import alone
from analysis.thresholds.fit import WITH_THRESHOLD
from experiment.perception.gains import UNEQUAL_DB

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analysis.axis import Axis


UM_COLUMNS: Final = ("threshold_left_um", "threshold_right_um", "displacement_basis")
_SIDES: Final = ("left", "right")
_DIGITS: Final = 4
"""Those of displacements in trials.csv."""

_SAME: Final = 0.005
"""Ratios that differ by less are equal."""


def with_micrometres(thresholds: pd.DataFrame, trials: pd.DataFrame, axis: Axis) -> pd.DataFrame:
    """Return the thresholds of people with `UM_COLUMNS`.

    Parameters
    ----------
    thresholds : pandas.DataFrame
        From `analysis.thresholds.table.thresholds_of`.
    trials : pandas.DataFrame
        From `analysis.read_trials`.
    axis : Axis
        Of the levels; of others than volts there are no micrometres.

    Returns
    -------
    pandas.DataFrame
        Each threshold times the displacement per volt of the left and of the right finger over its
        own actuator, as trials.csv has it; n/a where it has none, or more than one.

    Examples
    --------
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": ["left", "right"], "level_vpp": [100.0, 50.0], "reason": "",
    ...     "peak_left_um": [2.0, 0.1], "peak_right_um": [0.1, 0.9],
    ...     "displacement_basis": "measured"})
    >>> table = pd.DataFrame({"participant": ["1"], "condition": ["main"], "status": ["ok"],
    ...     "threshold_vpp": [60.0]})
    >>> from analysis.axis import VOLTS
    >>> with_micrometres(table, trials, VOLTS)[[*UM_COLUMNS]].to_numpy().tolist()
    [[1.2, 1.08, 'measured']]
    """
    moved = _per_volt(trials) if axis.is_vpp else {}
    rows: list[dict[str, object]] = []
    for _, row in thresholds.iterrows():
        left, right, basis = moved.get((row["participant"], row["condition"]), _UNKNOWN)
        at = row["threshold_vpp"] if row["status"] in WITH_THRESHOLD else math.nan
        told = (_um(left * at), _um(right * at), basis if math.isfinite(at) else math.nan)
        rows.append(dict(zip(UM_COLUMNS, told, strict=True)))
    return thresholds.assign(**pd.DataFrame(rows, columns=[*UM_COLUMNS], index=thresholds.index))


def _um(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


_UNKNOWN: Final = (math.nan, math.nan, math.nan)


def _per_volt(trials: pd.DataFrame) -> dict[tuple[str, str], tuple[float, float, Any]]:
    """Return by participant and condition what the left and right finger get, and on what basis."""
    if trials.empty or not {"peak_left_um", "displacement_basis"} <= {*trials.columns}:
        return {}
    single = trials["reason"].eq("") & trials["kind"].astype(object).eq("single")
    known = trials[single & trials["displacement_basis"].notna()]
    found = {}
    for (participant, condition), own in known.groupby(["participant", "condition"], observed=True):
        left, right = (_ratio(own[own["side"].eq(side)], f"peak_{side}_um") for side in _SIDES)
        bases = {*own["displacement_basis"].astype(object)}
        basis = bases.pop() if len(bases) == 1 else "predicted"  # the weaker one
        if not math.isnan(left) or not math.isnan(right):
            found[str(participant), str(condition)] = left, right, basis
    return found


def _ratio(trials: pd.DataFrame, column: str) -> float:
    """Return the micrometres per volt of some trials if there is one such number."""
    ratios = (trials[column] / trials["level_vpp"]).dropna()
    return _only(ratios.tolist())


def _only(values: list[float]) -> float:
    """Return what equal numbers are; NaN where they are none or differ.

    >>> _only([0.02, 0.02]), _only([0.02, 0.03]), _only([])
    (0.02, nan, nan)
    """
    if not values or not max(values) - min(values) <= _SAME * max(values):
        return math.nan
    return sum(values) / len(values)


def group_per_volt(thresholds: pd.DataFrame) -> tuple[float, float, str]:
    """Return what the fingers of all people get per volt, and its basis; NaN where they differ.

    `thresholds` are theirs, `with_micrometres`.
    """
    if not {*UM_COLUMNS} <= {*thresholds.columns}:
        return math.nan, math.nan, ""
    told = thresholds[thresholds["displacement_basis"].notna()]
    if len(told) < int(thresholds["status"].isin(WITH_THRESHOLD).sum()) or told.empty:
        return math.nan, math.nan, ""
    left, right = (
        _only((told[name] / told["threshold_vpp"]).dropna().tolist()) for name in UM_COLUMNS[:2]
    )
    bases = {*told["displacement_basis"]}
    return left, right, bases.pop() if len(bases) == 1 else "predicted"


def with_group_micrometres(groups: pd.DataFrame, thresholds: pd.DataFrame) -> pd.DataFrame:
    """Return the thresholds of groups with `UM_COLUMNS`; `thresholds` are those of all people."""
    rows: list[dict[str, object]] = []
    for _, group in groups.iterrows():
        own = thresholds[thresholds["condition"].eq(group["condition"])]
        left, right, basis = group_per_volt(own)
        at = group["threshold_vpp"] if group["status"] in WITH_THRESHOLD else math.nan
        um = [_um(left * at), _um(right * at)]
        told = (*um, math.nan if all(map(math.isnan, um)) else basis)
        rows.append(dict(zip(UM_COLUMNS, told, strict=True)))
    return groups.assign(**pd.DataFrame(rows, columns=[*UM_COLUMNS], index=groups.index))


def in_micrometres(row: pd.Series[Any], thresholds: pd.DataFrame) -> str:
    """Say what a threshold comes to at the fingers, measured or predicted; or nothing.

    `row` is the threshold of the group, or of a person, `thresholds` those of all in it.
    """
    left, right, basis = group_per_volt(thresholds)
    told = _sides(left, right, lambda one: alone(one * float(row["threshold_vpp"]), "um"))
    if not told or row["status"] not in WITH_THRESHOLD:
        return ""
    verb = "these volts give the fingers" if _apart(left, right) else "at the fingers"
    return f"; {verb} {told}, by the {basis} displacement per volt"


def micrometres_row(
    row: pd.Series[Any], thresholds: pd.DataFrame, where: str
) -> Iterator[tuple[str, str, str]]:
    """Yield the same as a row of the answer's table; an open limit is said to be one."""
    left, right, basis = group_per_volt(thresholds)
    at, low, high = (float(row[f"threshold_{name}vpp"]) for name in ("", "low_", "high_"))

    def words(one: float) -> str:
        every = [alone(one * end, "um") if math.isfinite(end) else "open" for end in (low, high)]
        low_um, high_um = (end.removesuffix(" um") for end in every)
        return f"{alone(one * at, 'um')} ({low_um} to {high_um})"

    told = _sides(left, right, words) if row["status"] in WITH_THRESHOLD else ""
    if told:
        name = (
            "What these volts give the fingers"
            if _apart(left, right)
            else "The same at the fingers"
        )
        yield f"{name}{where}", told, f"{basis} displacement per volt"


def unequal_sides(trials: pd.DataFrame, axis: Axis) -> Iterator[str]:
    """Say where the same volts move one finger more than the other.

    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": ["left", "right"], "level_vpp": 100.0, "reason": "",
    ...     "peak_left_um": [1.0, 0.1], "peak_right_um": [0.1, 1.5],
    ...     "displacement_basis": "measured"})
    >>> from analysis.axis import VOLTS
    >>> print(*unequal_sides(trials, VOLTS))
    the same volts move the right finger 3.5 dB more than the left: a threshold in volts is that \
of both sides together, between those of the two, and its psychometric function is flatter
    """
    moved = [*(_per_volt(trials) if axis.is_vpp else {}).values()]
    apart_db = [20 * math.log10(right / left) for left, right, _ in moved if _apart(left, right)]
    for more, less, sign in ((*_SIDES, -1), (*_SIDES[::-1], 1)):
        own_db = [one for one in apart_db if sign * one >= UNEQUAL_DB]
        if own_db:
            some = " (not of all people and conditions)" * (len(own_db) < len(moved))
            yield (
                f"the same volts move the {more} finger {max(map(abs, own_db)):.1f} dB more than "
                f"the {less}{some}: a threshold in volts is that of both sides together, between "
                "those of the two, and its psychometric function is flatter"
            )


def _apart(left: float, right: float) -> bool:
    """Tell whether both sides are known, and differ."""
    return left > 0 and right > 0 and math.isnan(_only([left, right]))


def _sides(left: float, right: float, words: Callable[[float], str]) -> str:
    """Say of both sides what is the same of both; otherwise of each that is known."""
    if not math.isnan(both := _only([left, right])):
        return words(both)
    known = [(side, one) for side, one in zip(_SIDES, (left, right), strict=True) if one > 0]
    return " and ".join(f"{words(one)} {side}" for side, one in known)
