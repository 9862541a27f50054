"""Thresholds of participants, of their groups, and differences of conditions, as tables."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import pandas as pd

from analysis.axis import VOLTS
from analysis.counts.table import NEEDED, require_columns, sites_in
from analysis.numbers import TOTAL, counted_up, in_order
from analysis.thresholds.difference import Difference, difference_of
from analysis.thresholds.fit import ABOVE, BELOW, fit_many
from analysis.thresholds.group import DB_PER_LOG10, NOT_RISING, GroupFit, group_fit
from analysis.thresholds.misfit import deviance_p
from analysis.thresholds.tables import tables_of
from experiment.names import require_whole

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analysis.axis import Axis
    from analysis.thresholds.fit import PsychometricFit
    from analysis.thresholds.likelihood import Tables


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
    >>> from experiment.tasks import LEFT_RIGHT_BOTH
    >>> (left, _), nothing = LEFT_RIGHT_BOTH.sites, LEFT_RIGHT_BOTH.nothing
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": left, "level_vpp": np.repeat([60.0, 90.0, 120.0], 30), "reason": "",
    ...     "response": [left] * 4 + [nothing] * 40 + [left] * 46, "none_offered": True})
    >>> table = threshold_table(trials, seed=1)
    >>> table["status"].tolist(), table["threshold_vpp"].round().tolist()
    (['ok'], [89.0])
    """
    require_columns(trials, NEEDED)
    require_whole("seed", seed, 0)
    return thresholds_of(tables_of(trials, axis=axis), seed=seed)


def thresholds_of(people: Tables, *, seed: int) -> pd.DataFrame:
    """Return `threshold_table` of participants' counts."""
    fits = fit_many(people, likeliest=True)
    table = _frame(
        {
            "participant": [name for _, name in people.names],
            "condition": [condition for condition, _ in people.names],
            "status": [fit.status for fit in fits],
            **_threshold_columns(fits, people.axis),
            "sigma": [fit.sigma for fit in fits],
            "lapse_rate": [fit.lapse_rate for fit in fits],
            "mle_threshold_vpp": [fit.mle_threshold for fit in fits],
            "mle_sigma": [fit.mle_sigma for fit in fits],
            "mle_lapse_rate": [fit.mle_lapse_rate for fit in fits],
            "deviance": [fit.deviance for fit in fits],
            "deviance_p": [deviance_p(fit, people, row, seed) for row, fit in enumerate(fits)],
            "guess_rate": [guess.mean for guess in people.guesses],
            "guess_basis": [guess.basis for guess in people.guesses],
            "guess_posterior": [fit.guess_rate for fit in fits],
            "levels": (people.presented > 0).sum(axis=1),
            "trials": people.presented.sum(axis=1).astype(int),
        }
    )
    return table.sort_values(["condition", "participant"], key=in_order, ignore_index=True)


def group_table(people: Tables, thresholds: pd.DataFrame) -> pd.DataFrame:
    """Return the threshold of the group of each condition, in which everybody takes part.

    `thresholds` are `thresholds_of` these people. ``below`` and ``above`` count those of them that
    lie outside the levels.
    """
    conditions = people.conditions
    groups = [
        group_fit(group) if len(group) > 1 else GroupFit(status="one_participant")
        for group in conditions.values()
    ]
    outside = {
        name: thresholds["status"].isin(statuses).groupby(thresholds["condition"]).sum()
        for name, statuses in (("below", BELOW), ("above", ABOVE))
    }
    return _frame(
        {
            "condition": list(conditions),
            "participants": [len(group) for group in conditions.values()],
            "status": [group.status for group in groups],
            **_threshold_columns(groups, people.axis),
            "spread_db": [group.spread_db for group in groups],
            "spread_low_db": [group.spread_limits_db[0] for group in groups],
            "spread_high_db": [group.spread_limits_db[1] for group in groups],
            "new_low_vpp": [_finite(group.new_person_limits[0]) for group in groups],
            "new_high_vpp": [_finite(group.new_person_limits[1]) for group in groups],
            "sigma": [group.sigma for group in groups],
            "sigma_low": [group.sigma_limits[0] for group in groups],
            "sigma_high": [group.sigma_limits[1] for group in groups],
            **{
                name: [numbers[c] if len(some) > 1 else math.nan for c, some in conditions.items()]
                for name, numbers in outside.items()
            },
        }
    )


def difference_table(
    people: Tables, thresholds: pd.DataFrame, groups: pd.DataFrame
) -> pd.DataFrame:
    """Return by how many dB thresholds differ between every two conditions.

    If some people took part in both, they are compared, each alone and as a group; else the two
    groups are compared. Nothing is compared on a linear axis, which has no dB. The last row of a
    pair is that of the group, ``all``. There is no difference if detection does not rise with level
    in either condition, by `thresholds` and `groups`.
    """
    each = [thresholds, groups[groups["participants"].gt(1)].assign(participant=TOTAL)]
    statuses = pd.concat([table[["condition", "participant", "status"]] for table in each])
    falling = statuses[statuses["status"].isin(NOT_RISING)]
    not_rising = {*zip(falling["condition"], falling["participant"], strict=True)}
    pairs: list[tuple[str, str, str]] = []
    differences: list[Difference] = []
    conditions = people.conditions.items() if people.axis.is_logarithmic else ()
    for (a, people_a), (b, people_b) in itertools.combinations(conditions, 2):
        for name, difference in _compare(people_a, people_b):
            is_flat = bool({(a, name), (b, name)} & not_rising)
            pairs.append((a, b, name))
            differences.append(Difference(status="unknown") if is_flat else difference)
    limits = [difference.difference_limits_db for difference in differences]
    return _frame(
        {
            "condition_a": [a for a, _, _ in pairs],
            "condition_b": [b for _, b, _ in pairs],
            "participant": [name for _, _, name in pairs],
            "difference_db": [difference.difference_db for difference in differences],
            "low_db": [_finite(low) for low, _ in limits],
            "high_db": [_finite(high) for _, high in limits],
            "spread_db": [difference.spread_db for difference in differences],
            "spread_low_db": [difference.spread_limits_db[0] for difference in differences],
            "spread_high_db": [difference.spread_limits_db[1] for difference in differences],
            "status": [difference.status for difference in differences],
        }
    )


def side_thresholds(
    trials: pd.DataFrame, axis: Axis = VOLTS, alternatives: int | None = None
) -> pd.DataFrame:
    """Return the threshold of the group of each condition and side: ``side``, then `group_table`.

    The stimuli of one side are fitted alone, with answers of that side to blank trials as its false
    alarms. Of one participant the rows hold the participant's own threshold.
    """
    single = trials["kind"].astype(object).eq("single")
    frames = []
    sites = sites_in(trials)
    for side in sorted({*sites[single].dropna().astype(str)}):
        rows = trials[~single | sites.eq(side)]
        people = tables_of(rows, axis=axis, alternatives=alternatives)
        thresholds = thresholds_of(people, seed=0)
        groups = group_table(people, thresholds).set_index("condition")
        alone = thresholds[thresholds["condition"].map(groups["participants"]).eq(1)]
        groups.update(alone.set_index("condition").filter([*groups]))
        groups.insert(0, "side", side)
        frames.append(groups.reset_index())
    if not frames:
        return pd.DataFrame(columns=["condition", "side"])
    table = pd.concat(frames, ignore_index=True)
    return table.sort_values(["condition", "side"], ignore_index=True)


def _threshold_columns(
    fits: Sequence[PsychometricFit] | Sequence[GroupFit], axis: Axis
) -> dict[str, list[float]]:
    """Return thresholds and their limits, in levels and in dB; an open limit is n/a."""
    levels = {
        "threshold": [fit.threshold for fit in fits],
        "threshold_low": [_finite(fit.threshold_limits[0]) for fit in fits],
        "threshold_high": [_finite(fit.threshold_limits[1]) for fit in fits],
    }
    db = DB_PER_LOG10 if axis.is_logarithmic else math.nan
    return {
        **{f"{name}_vpp": column for name, column in levels.items()},
        **{f"{n}_db": [db * axis.on_axis(x) for x in column] for n, column in levels.items()},
    }


def _frame(columns: dict[str, Any]) -> pd.DataFrame:
    # Columns without a row would be numbers, and those of names be joined with no other names.
    return pd.DataFrame(columns, dtype=None if any(map(len, columns.values())) else object)


def _finite(value: float) -> float:
    return value if math.isfinite(value) else math.nan


def _compare(a: Tables, b: Tables) -> Iterator[tuple[str, Difference]]:
    """Yield the difference of each participant of two conditions, and last that of the group."""
    of_a, of_b = ({name: i for i, (_, name) in enumerate(each.names)} for each in (a, b))
    both = [name for name in of_a if name in of_b]
    if both:
        a, b = a.at([of_a[name] for name in both]), b.at([of_b[name] for name in both])
    group = difference_of(a, b, same_people=bool(both))
    each = zip(both, group.people, strict=True)
    yield from sorted(each, key=lambda person: counted_up(person[0]))
    is_one = min(len(a), len(b)) == 1
    yield TOTAL, Difference(status="one_participant") if is_one else group
