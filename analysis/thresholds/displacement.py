"""Thresholds in micrometres, by the displacement per volt of the driven fingertip."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.counts.table import sites_in
from analysis.thresholds.fit import WITH_THRESHOLD
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from collections.abc import Iterable
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
    ...     "side": LEFT_RIGHT_BOTH.sites, "level_vpp": [100.0, 50.0], "reason": "",
    ...     "peak_left_um": [2.0, 0.1], "peak_right_um": [0.1, 0.9],
    ...     "displacement_basis": "measured"})
    >>> table = pd.DataFrame({"participant": ["1"], "condition": ["main"], "status": ["ok"],
    ...     "threshold_vpp": [60.0]})
    >>> from analysis.axis import VOLTS
    >>> with_micrometres(table, trials, VOLTS)[[*UM_COLUMNS]].to_numpy().tolist()
    [[1.2, 1.08, 'measured']]
    """
    moved = _per_volt(trials) if axis.is_vpp else {}
    names = zip(thresholds["participant"], thresholds["condition"], strict=True)
    return _with_columns(thresholds, [moved.get(name, ({}, "")) for name in names])


def with_group_micrometres(groups: pd.DataFrame, thresholds: pd.DataFrame) -> pd.DataFrame:
    """Return the thresholds of groups with `UM_COLUMNS`; `thresholds` are those of all people."""
    people = [thresholds[thresholds["condition"].eq(name)] for name in groups["condition"]]
    return _with_columns(groups, [group_per_volt(some) for some in people])


def _with_columns(
    thresholds: pd.DataFrame, per_volts: Iterable[tuple[PerVolt, str]]
) -> pd.DataFrame:
    rows = []
    for (_, row), (per_volt, basis) in zip(thresholds.iterrows(), per_volts, strict=True):
        at = row["threshold_vpp"] if row["status"] in WITH_THRESHOLD else math.nan
        um = [per_volt.get(site, math.nan) * at for site in SITE_COLUMNS]
        rounded = [float(f"{value:.{_DIGITS}g}") for value in um]
        rows.append([*rounded, math.nan if np.isnan(um).all() else basis])
    return thresholds.assign(**pd.DataFrame(rows, columns=[*UM_COLUMNS], index=thresholds.index))


def _per_volt(trials: pd.DataFrame) -> dict[tuple[object, object], tuple[PerVolt, str]]:
    """Return the displacement per volt at each site, and its basis, of each participant."""
    if trials.empty or not {"peak_left_um", "displacement_basis"} <= {*trials.columns}:
        return {}
    single = trials["reason"].eq("") & trials["kind"].astype(object).eq("single")
    rows = trials[single & trials["displacement_basis"].notna()]
    per_volt = {}
    for (participant, condition), person in rows.groupby(
        ["participant", "condition"], observed=True
    ):
        of_sites = {site: person[sites_in(person).eq(site)] for site in SITE_COLUMNS}
        ratios = {
            site: mean_of_equal(some[f"peak_{site}_um"] / some["level_vpp"])
            for site, some in of_sites.items()
        }
        per_volt[participant, condition] = ratios, _weakest(person["displacement_basis"])
    return per_volt


def group_per_volt(thresholds: pd.DataFrame) -> tuple[PerVolt, str]:
    """Return the displacement per volt of all participants, and its basis; NaN where they differ.

    `thresholds` are those of the participants, `with_micrometres`.
    """
    if not {*UM_COLUMNS} <= {*thresholds.columns}:
        return {}, ""
    moved = thresholds[thresholds["displacement_basis"].notna()]
    if len(moved) < int(thresholds["status"].isin(WITH_THRESHOLD).sum()) or moved.empty:
        return {}, ""
    ratios = {
        site: mean_of_equal(moved[column] / moved["threshold_vpp"])
        for site, column in SITE_COLUMNS.items()
    }
    return ratios, _weakest(moved["displacement_basis"])


def mean_of_equal(values: pd.Series[float]) -> float:
    """Return the mean of equal numbers; NaN where there is none, or they differ.

    >>> mean_of_equal(pd.Series([0.02, 0.02])), mean_of_equal(pd.Series([0.02, 0.03]))
    (0.02, nan)
    """
    numbers = values.dropna().tolist()
    if not numbers or max(numbers) - min(numbers) > _SAME * max(numbers):
        return math.nan
    return sum(numbers) / len(numbers)


def _weakest(bases: pd.Series[Any]) -> str:
    different = {*bases.astype(object)}
    return str(different.pop()) if len(different) == 1 else "predicted"
