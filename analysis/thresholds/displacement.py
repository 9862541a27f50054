"""Thresholds in micrometres, by the displacement per volt of the driven fingertip."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import pandas as pd

from analysis.thresholds.fit import WITH_THRESHOLD

if TYPE_CHECKING:
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
        values = (_um(left * at), _um(right * at), basis if math.isfinite(at) else math.nan)
        rows.append(dict(zip(UM_COLUMNS, values, strict=True)))
    return thresholds.assign(**pd.DataFrame(rows, columns=[*UM_COLUMNS], index=thresholds.index))


def _um(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


_UNKNOWN: Final = (math.nan, math.nan, math.nan)


def _per_volt(trials: pd.DataFrame) -> dict[tuple[str, str], tuple[float, float, Any]]:
    """Return the displacement per volt left and right, and its basis, of each participant."""
    if trials.empty or not {"peak_left_um", "displacement_basis"} <= {*trials.columns}:
        return {}
    single = trials["reason"].eq("") & trials["kind"].astype(object).eq("single")
    rows = trials[single & trials["displacement_basis"].notna()]
    per_volt = {}
    for (participant, condition), each in rows.groupby(["participant", "condition"], observed=True):
        left, right = (_ratio(each[each["side"].eq(side)], f"peak_{side}_um") for side in _SIDES)
        bases = {*each["displacement_basis"].astype(object)}
        basis = bases.pop() if len(bases) == 1 else "predicted"  # the weaker one
        if not math.isnan(left) or not math.isnan(right):
            per_volt[str(participant), str(condition)] = left, right, basis
    return per_volt


def _ratio(trials: pd.DataFrame, column: str) -> float:
    """Return the micrometres per volt of some trials if there is one such number."""
    ratios = (trials[column] / trials["level_vpp"]).dropna()
    return _only(ratios.tolist())


def _only(values: list[float]) -> float:
    """Return the mean of equal numbers; NaN where there is none, or they differ.

    >>> _only([0.02, 0.02]), _only([0.02, 0.03]), _only([])
    (0.02, nan, nan)
    """
    if not values or not max(values) - min(values) <= _SAME * max(values):
        return math.nan
    return sum(values) / len(values)


def group_per_volt(thresholds: pd.DataFrame) -> tuple[float, float, str]:
    """Return the displacement per volt of all participants, and its basis; NaN where they differ.

    `thresholds` are those of the participants, `with_micrometres`.
    """
    if not {*UM_COLUMNS} <= {*thresholds.columns}:
        return math.nan, math.nan, ""
    moved = thresholds[thresholds["displacement_basis"].notna()]
    if len(moved) < int(thresholds["status"].isin(WITH_THRESHOLD).sum()) or moved.empty:
        return math.nan, math.nan, ""
    left, right = (
        _only((moved[name] / moved["threshold_vpp"]).dropna().tolist()) for name in UM_COLUMNS[:2]
    )
    bases = {*moved["displacement_basis"]}
    return left, right, bases.pop() if len(bases) == 1 else "predicted"


def with_group_micrometres(groups: pd.DataFrame, thresholds: pd.DataFrame) -> pd.DataFrame:
    """Return the thresholds of groups with `UM_COLUMNS`; `thresholds` are those of all people."""
    rows: list[dict[str, object]] = []
    for _, group in groups.iterrows():
        people = thresholds[thresholds["condition"].eq(group["condition"])]
        left, right, basis = group_per_volt(people)
        at = group["threshold_vpp"] if group["status"] in WITH_THRESHOLD else math.nan
        um = [_um(left * at), _um(right * at)]
        values = (*um, math.nan if all(map(math.isnan, um)) else basis)
        rows.append(dict(zip(UM_COLUMNS, values, strict=True)))
    return groups.assign(**pd.DataFrame(rows, columns=[*UM_COLUMNS], index=groups.index))
