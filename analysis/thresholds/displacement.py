"""Thresholds in micrometres, by the displacement per volt of the driven fingertip."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import pandas as pd

from analysis.thresholds.fit import WITH_THRESHOLD
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from typing import TypeAlias

    from analysis.axis import Axis

    PerVolt: TypeAlias = dict[str, float]


SITE_COLUMNS: Final = {site: f"threshold_{site}_um" for site in LEFT_RIGHT_BOTH.sites}
UM_COLUMNS: Final = (*SITE_COLUMNS.values(), "displacement_basis")
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
    rows = [
        _in_micrometres(row, *moved.get((row["participant"], row["condition"]), ({}, math.nan)))
        for _, row in thresholds.iterrows()
    ]
    return thresholds.assign(**pd.DataFrame(rows, columns=[*UM_COLUMNS], index=thresholds.index))


def _in_micrometres(row: pd.Series[Any], per_volt: PerVolt, basis: object) -> dict[str, object]:
    """Return the columns in micrometres of a threshold."""
    at = row["threshold_vpp"] if row["status"] in WITH_THRESHOLD else math.nan
    um = {
        column: float(f"{per_volt.get(site, math.nan) * at:.{_DIGITS}g}")
        for site, column in SITE_COLUMNS.items()
    }
    return {**um, "displacement_basis": math.nan if all(map(math.isnan, um.values())) else basis}


def _per_volt(trials: pd.DataFrame) -> dict[tuple[str, str], tuple[PerVolt, object]]:
    """Return the displacement per volt at each site, and its basis, of each participant."""
    if trials.empty or not {"peak_left_um", "displacement_basis"} <= {*trials.columns}:
        return {}
    single = trials["reason"].eq("") & trials["kind"].astype(object).eq("single")
    rows = trials[single & trials["displacement_basis"].notna()]
    per_volt = {}
    for (participant, condition), each in rows.groupby(["participant", "condition"], observed=True):
        bases = {*each["displacement_basis"].astype(object)}
        basis = bases.pop() if len(bases) == 1 else "predicted"  # the weaker one
        of_sites = {
            site: _ratio(each[each["side"].eq(site)], f"peak_{site}_um") for site in SITE_COLUMNS
        }
        per_volt[str(participant), str(condition)] = of_sites, basis
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


def group_per_volt(thresholds: pd.DataFrame) -> tuple[PerVolt, str]:
    """Return the displacement per volt of all participants, and its basis; NaN where they differ.

    `thresholds` are those of the participants, `with_micrometres`.
    """
    if not {*UM_COLUMNS} <= {*thresholds.columns}:
        return {}, ""
    moved = thresholds[thresholds["displacement_basis"].notna()]
    if len(moved) < int(thresholds["status"].isin(WITH_THRESHOLD).sum()) or moved.empty:
        return {}, ""
    per_volt = {
        site: _only((moved[column] / moved["threshold_vpp"]).dropna().tolist())
        for site, column in SITE_COLUMNS.items()
    }
    bases = {*moved["displacement_basis"]}
    return per_volt, bases.pop() if len(bases) == 1 else "predicted"


def with_group_micrometres(groups: pd.DataFrame, thresholds: pd.DataFrame) -> pd.DataFrame:
    """Return the thresholds of groups with `UM_COLUMNS`; `thresholds` are those of all people."""
    rows = [
        _in_micrometres(
            group, *group_per_volt(thresholds[thresholds["condition"].eq(group["condition"])])
        )
        for _, group in groups.iterrows()
    ]
    return groups.assign(**pd.DataFrame(rows, columns=[*UM_COLUMNS], index=groups.index))
