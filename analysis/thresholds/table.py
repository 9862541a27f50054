"""Thresholds of participants, of their groups, and differences of conditions, as tables."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Final

import pandas as pd

from analysis.axis import VOLTS
from analysis.counts.table import NEEDED, require_columns
from analysis.numbers import (
    TOTAL,
    counted_up,
    in_order,
)
from analysis.thresholds.difference import Difference, difference_of
from analysis.thresholds.fit import PsychometricFit, fit_many
from analysis.thresholds.group import NOT_RISING, GroupFit, group_fit
from analysis.thresholds.likeliest import deviance_p, likeliest_function
from analysis.thresholds.people import people_of, tables_and_likelihoods
from experiment.names import require_whole

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.thresholds.people import PersonCounts

    Floats = NDArray[np.float64]

_IN_LEVELS: Final = ("threshold_vpp", "threshold_low_vpp", "threshold_high_vpp")
_IN_DB: Final = ("threshold_db", "threshold_low_db", "threshold_high_db")
THRESHOLD_COLUMNS: Final = (
    "participant",
    "condition",
    "status",
    *_IN_LEVELS,
    *_IN_DB,
    "sigma",
    "lapse_rate",
    "mle_threshold_vpp",
    "mle_sigma",
    "mle_lapse_rate",
    "deviance",
    "deviance_p",
    "guess_rate",
    "guess_basis",
    "guess_posterior",
    "levels",
    "trials",
)
GROUP_COLUMNS: Final = (
    "condition",
    "participants",
    "status",
    *_IN_LEVELS,
    "spread_db",
    "spread_low_db",
    "spread_high_db",
    "new_low_vpp",
    "new_high_vpp",
    "sigma",
    "sigma_low",
    "sigma_high",
    "below",
    "above",
)
DIFFERENCE_COLUMNS: Final = (
    "condition_a",
    "condition_b",
    "participant",
    "difference_db",
    "low_db",
    "high_db",
    "spread_db",
    "spread_low_db",
    "spread_high_db",
    "status",
)
GROUP: Final = TOTAL
_NOT_BOUNDED: Final = (*[math.nan] * 6, "unknown")
_BELOW: Final = ("threshold_below_levels", "median_below_levels")
_ABOVE: Final = ("threshold_above_levels", "median_above_levels")


def threshold_table(trials: pd.DataFrame, *, seed: int, axis: Axis = VOLTS) -> pd.DataFrame:
    """Return the threshold of every participant in every condition.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.
    seed : int
        Of the bootstrap behind ``deviance_p``, 0 or more.
    axis : Axis
        What the levels are, see `analysis.axis.Axis`: by default peak-to-peak volts, the function
        normal in their logarithm.

    Returns
    -------
    pandas.DataFrame
        A row for each participant in each condition, with the columns of thresholds.csv but those
        in micrometres; docs/statistics.md, section 8, has the model. dB are re 1 Vpp.

    Raises
    ------
    ValueError
        For a table without a column that is needed, as `analysis.read_trials` gives them, and a
        seed that is no whole number of at least 0.

    Examples
    --------
    >>> import numpy as np
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": "left", "level_vpp": np.repeat([60.0, 90.0, 120.0], 30), "reason": "",
    ...     "response": ["left"] * 4 + ["none"] * 40 + ["left"] * 46, "none_offered": True})
    >>> table = threshold_table(trials, seed=1)
    >>> table["status"].tolist(), table["threshold_vpp"].round().tolist()
    (['ok'], [89.0])
    """
    require_columns(trials, NEEDED)
    require_whole("seed", seed, 0)
    return thresholds_of(people_of(trials), seed=seed, axis=axis)


def thresholds_of(people: PersonCounts, *, seed: int, axis: Axis) -> pd.DataFrame:
    """Return `threshold_table` of participants' counts."""
    if not people.names:
        return pd.DataFrame(columns=list(THRESHOLD_COLUMNS))
    tables, likelihoods = tables_and_likelihoods(people, axis)
    fits = fit_many(tables, likelihoods)
    rows = []
    for i, (condition, participant) in enumerate(people.names):
        fit, guess = fits[i], people.guesses[i]
        row: dict[str, object] = {
            "participant": participant,
            "condition": condition,
            "status": fit.status,
            **_threshold(fit, axis),
            "sigma": axis.width(fit.sigma),
            "lapse_rate": fit.lapse_rate,
            "guess_rate": guess.rate.mean,
            "guess_basis": guess.basis,
            "guess_posterior": fit.guess_rate,
            "levels": int((people.presented[i] > 0).sum()),
            "trials": int(people.presented[i].sum()),
        }
        if fit.status == "ok":
            best = likeliest_function(tables, i, likelihoods[i].node)
            row |= {
                "status": "lapse_at_bound" if best.at_max_lapse else "ok",
                "mle_threshold_vpp": axis.level(best.mu * tables.prior.step),
                "mle_sigma": axis.width(math.exp(best.log_sigma) * tables.prior.step),
                "mle_lapse_rate": best.lapse_rate,
                "deviance": best.deviance,
                "deviance_p": deviance_p(tables, i, best, likelihoods[i], seed),
            }
        rows.append(row)
    table = pd.DataFrame(rows, columns=list(THRESHOLD_COLUMNS))
    return table.sort_values(["condition", "participant"], key=in_order, ignore_index=True)


def group_table(people: PersonCounts, thresholds: pd.DataFrame, axis: Axis) -> pd.DataFrame:
    """Return the threshold of the group of each condition, in which everybody takes part.

    `thresholds` are `thresholds_of` these people, and maybe of others. ``below`` and ``above``
    count the people whose own threshold lies outside the levels.
    """
    if not people.names:
        return pd.DataFrame(columns=list(GROUP_COLUMNS))
    tables, likelihoods = tables_and_likelihoods(people, axis)
    statuses_of = thresholds.set_index(["condition", "participant"])["status"].to_dict()
    rows = []
    for condition, chosen in people.conditions().items():
        statuses = [statuses_of[people.names[i]] for i in chosen]
        fit = GroupFit(status="one_level")
        if len(chosen) > 1:
            fit = group_fit(tables.at(chosen), [likelihoods[i] for i in chosen], statuses)
        spread = (fit.spread_db, *fit.spread_limits_db)
        row: dict[str, object] = {
            "condition": condition,
            "participants": len(chosen),
            "status": fit.status if len(chosen) > 1 else "one_participant",
            **_threshold(fit, axis),
            **dict(zip(("spread_db", "spread_low_db", "spread_high_db"), spread, strict=True)),
            **dict(
                zip(
                    ("new_low_vpp", "new_high_vpp"),
                    (_finite_or_nan(end) for end in levels_of(fit.new_person_limits, axis)),
                    strict=True,
                )
            ),
            "sigma": axis.width(fit.sigma),
            "sigma_low": axis.width(fit.sigma_limits[0]),
            "sigma_high": axis.width(fit.sigma_limits[1]),
            "below": sum(status in _BELOW for status in statuses) if len(chosen) > 1 else math.nan,
            "above": sum(status in _ABOVE for status in statuses) if len(chosen) > 1 else math.nan,
        }
        rows.append(row)
    return pd.DataFrame(rows, columns=list(GROUP_COLUMNS))


def difference_table(
    people: PersonCounts, axis: Axis, thresholds: pd.DataFrame, groups: pd.DataFrame
) -> pd.DataFrame:
    """Return by how many dB thresholds differ between every two conditions.

    Where some people took part in both, these are compared, each and as a group; where nobody did,
    the groups are. Nothing is compared on a linear axis, which has no dB. The last row of a pair is
    the group's, ``all``. Where detection does not rise with level in either condition, by
    `thresholds` and `groups`, there is no difference.
    """
    each = [thresholds, groups[groups["participants"].gt(1)].assign(participant=GROUP)]
    statuses = pd.concat([table[["condition", "participant", "status"]] for table in each])
    falling = statuses[statuses["status"].isin(NOT_RISING)]
    not_rising = {*zip(falling["condition"], falling["participant"], strict=True)}
    rows: list[list[object]] = []
    if axis.is_logarithmic and len(people.conditions()) > 1:
        pairs = itertools.combinations(people.conditions().items(), 2)
        for (a, rows_a), (b, rows_b) in pairs:
            for name, *numbers in _pair(people, rows_a, rows_b, axis):
                flat = {(a, name), (b, name)} & not_rising
                rows.append([a, b, name, *(_NOT_BOUNDED if flat else numbers)])
    return pd.DataFrame(rows, columns=list(DIFFERENCE_COLUMNS))


def side_thresholds(
    trials: pd.DataFrame, axis: Axis = VOLTS, alternatives: int = 2
) -> pd.DataFrame:
    """Return the threshold of the group of each condition and side: ``side``, then `group_table`.

    The stimuli of one side are fitted alone, with answers of that side to blank trials as its false
    alarms. Of one participant the rows hold the participant's own threshold.
    """
    single = trials["kind"].astype(object).eq("single")
    frames = []
    for side in sorted({*trials.loc[single, "side"].dropna().astype(str)}):
        people = people_of(trials[~single | trials["side"].eq(side)], alternatives)
        thresholds = thresholds_of(people, seed=0, axis=axis)
        groups = group_table(people, thresholds, axis).set_index("condition")
        alone = thresholds[thresholds["condition"].map(groups["participants"]).eq(1)]
        groups.update(alone.set_index("condition")[["status", *_IN_LEVELS, "sigma"]])
        frames.append(groups.reset_index().assign(side=side))
    columns = ["condition", "side", *GROUP_COLUMNS[1:]]
    if not frames:
        return pd.DataFrame(columns=columns)
    table = pd.concat(frames, ignore_index=True)[columns]
    return table.sort_values(["condition", "side"], ignore_index=True)


def levels_of(limits: tuple[float, float], axis: Axis) -> tuple[float, float]:
    """Return limits on the axis as levels; an open one stays open."""
    low, high = limits
    return low if low == -math.inf else axis.level(low), axis.level(high)


def _threshold(fit: PsychometricFit | GroupFit, axis: Axis) -> dict[str, float]:
    """Return a threshold and its limits; an open limit is n/a in a table."""
    on_axis = (fit.threshold, *(_finite_or_nan(end) for end in fit.threshold_limits))
    in_db = [20 * value if axis.is_logarithmic else math.nan for value in on_axis]
    return {
        **dict(zip(_IN_LEVELS, map(axis.level, on_axis), strict=True)),
        **dict(zip(_IN_DB, in_db, strict=True)),
    }


def _finite_or_nan(value: float) -> float:
    return value if math.isfinite(value) else math.nan


def _pair(
    people: PersonCounts, rows_a: Sequence[int], rows_b: Sequence[int], axis: Axis
) -> list[list[object]]:
    """Return the rows of two conditions, from ``participant`` on."""
    of_a, of_b = ({people.names[i][1]: i for i in rows} for rows in (rows_a, rows_b))
    both = [name for name in of_a if name in of_b]
    if both:
        rows_a, rows_b = ([of[name] for name in both] for of in (of_a, of_b))
    tables, likelihoods = tables_and_likelihoods(people, axis)
    chosen = [likelihoods[i] for i in (*rows_a, *rows_b)]
    a, b = tables.at(rows_a), tables.at(rows_b)
    difference = difference_of(a, b, chosen, same_people=bool(both))
    rows = [
        [name, *_difference(person)] for name, person in zip(both, difference.people, strict=True)
    ]
    rows.sort(key=lambda row: counted_up(str(row[0])))
    if min(len(rows_a), len(rows_b)) == 1:
        return [*rows, [GROUP, *[math.nan] * 6, "one_participant"]]
    return [*rows, [GROUP, *_difference(difference)]]


def _difference(difference: Difference) -> list[object]:
    low, high = difference.difference_limits_db
    spread = difference.spread_db, *difference.spread_limits_db
    numbers = (difference.difference_db, low, high, *spread)
    return [*map(_finite_or_nan, numbers), difference.status]
