"""Thresholds in micrometres, by the displacement per volt of the driven fingertip."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.counts.table import sites_in
from analysis.task_columns import task_of
from analysis.thresholds.fit import WITH_THRESHOLD

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import TypeAlias

    from analysis.axis import Axis

    PerVolt: TypeAlias = dict[str, float]


_DIGITS: Final = 4
"""Those of displacements in trials.csv."""

_SAME: Final = 0.005
"""Ratios that differ by less are equal."""
_SITE_COLUMN: Final = re.compile("threshold_(.+)_um")


def site_columns(thresholds: pd.DataFrame) -> dict[str, str]:
    """Return the columns of thresholds in micrometres, by their sites.

    >>> site_columns(pd.DataFrame(columns=["threshold_vpp", "threshold_left_um"]))
    {'left': 'threshold_left_um'}
    """
    matches = filter(None, map(_SITE_COLUMN.fullmatch, thresholds.columns))
    return {match[1]: match[0] for match in matches}


def with_micrometres(thresholds: pd.DataFrame, trials: pd.DataFrame, axis: Axis) -> pd.DataFrame:
    """Return the thresholds of people with a column for each site, and ``displacement_basis``.

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
        Each threshold times the displacement per volt of the finger over its own actuator, at each
        site, as trials.csv has it; n/a where it has none, or more than one.

    Examples
    --------
    >>> from experiment.tasks import LEFT_RIGHT_BOTH
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": LEFT_RIGHT_BOTH.sites, "level_vpp": [100.0, 50.0], "reason": "",
    ...     "peak_left_um": [2.0, 0.1], "peak_right_um": [0.1, 0.9],
    ...     "displacement_basis": "measured"})
    >>> table = pd.DataFrame({"participant": ["1"], "condition": ["main"], "status": ["ok"],
    ...     "threshold_vpp": [60.0]})
    >>> from analysis.axis import VOLTS
    >>> list(map(str, with_micrometres(table, trials, VOLTS).iloc[0, -3:]))
    ['1.2', '1.08', 'measured']
    """
    moved = _per_volt(trials) if axis.is_vpp else {}
    names = zip(thresholds["participant"], thresholds["condition"], strict=True)
    sites = task_of(trials).sites
    return _with_columns(thresholds, sites, [moved.get(name, ({}, "")) for name in names])


def with_group_micrometres(groups: pd.DataFrame, thresholds: pd.DataFrame) -> pd.DataFrame:
    """Return the thresholds of groups with the columns of those of all people, `thresholds`."""
    people = [thresholds[thresholds["condition"].eq(name)] for name in groups["condition"]]
    sites = [*site_columns(thresholds)]
    return _with_columns(groups, sites, [group_per_volt(some) for some in people])


def _with_columns(
    thresholds: pd.DataFrame, sites: Sequence[str], per_volts: Iterable[tuple[PerVolt, str]]
) -> pd.DataFrame:
    rows = []
    for (_, row), (per_volt, basis) in zip(thresholds.iterrows(), per_volts, strict=True):
        at = row["threshold_vpp"] if row["status"] in WITH_THRESHOLD else math.nan
        um = [per_volt.get(site, math.nan) * at for site in sites]
        rounded = [float(f"{value:.{_DIGITS}g}") for value in um]
        rows.append([*rounded, math.nan if np.isnan(um).all() else basis])
    names = [*(f"threshold_{site}_um" for site in sites), "displacement_basis"]
    return thresholds.assign(**pd.DataFrame(rows, columns=names, index=thresholds.index))


def _per_volt(trials: pd.DataFrame) -> dict[tuple[object, object], tuple[PerVolt, str]]:
    """Return the displacement per volt at each site, and its basis, of each participant."""
    sites = task_of(trials).sites
    needed = {*(f"peak_{site}_um" for site in sites), "displacement_basis"}
    if trials.empty or not needed <= {*trials.columns}:
        return {}
    single = trials["reason"].eq("") & trials["kind"].astype(object).eq("single")
    rows = trials[single & trials["displacement_basis"].notna()]
    per_volt = {}
    for (participant, condition), person in rows.groupby(
        ["participant", "condition"], observed=True
    ):
        of_sites = {site: person[sites_in(person).eq(site)] for site in sites}
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
    if "displacement_basis" not in thresholds:
        return {}, ""
    moved = thresholds[thresholds["displacement_basis"].notna()]
    if len(moved) < int(thresholds["status"].isin(WITH_THRESHOLD).sum()) or moved.empty:
        return {}, ""
    ratios = {
        site: mean_of_equal(moved[column] / moved["threshold_vpp"])
        for site, column in site_columns(thresholds).items()
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
