"""Which trials count, which are left out and why; hands-off trials; reaction times."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from analysis.definitions import TOTAL, in_order
from experiment.rows import COLUMNS, HANDS_OFF, NOT_AVAILABLE
from experiment.trial.plan import HANDS_OFF_BLOCK

if TYPE_CHECKING:
    from collections.abc import Iterable

COUNTED_KINDS = ("single", "both", "blank")
NEEDED = ("participant", "condition", "kind", "side", "level_vpp", "response", "reason")
"""Columns of trials that a count of answers takes."""


def require_columns(trials: pd.DataFrame, names: Iterable[str]) -> None:
    """Refuse a table of trials that lacks a column.

    >>> require_columns(pd.DataFrame({"kind": ["single"]}), ("kind", "reason"))
    Traceback (most recent call last):
    ValueError: trials must be a table that analysis.read_trials returned; got one without reason
    """
    missing = [name for name in names if name not in trials]
    if missing:
        raise ValueError(
            "trials must be a table that analysis.read_trials returned; got one without "
            f"{', '.join(missing)}"
        )


def excluded_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Count what is left out, in columns ``participant reason trials``.

    A trial that would be neither counted nor listed is a RuntimeError: then this program is wrong.

    >>> trials = pd.DataFrame({"participant": "1", "kind": "single", "reason": ["", "voided"]})
    >>> excluded_table(trials).to_numpy().tolist()
    [['1', 'voided', 1]]
    """
    left_out = trials.loc[trials["reason"].ne(""), ["participant", "reason"]]
    table = left_out.groupby(["participant", "reason"]).size().reset_index(name="trials")
    table = table.sort_values(["participant", "reason"], key=in_order, ignore_index=True)
    number = sum(len(counted(trials, kind)) for kind in COUNTED_KINDS)
    if number + int(table["trials"].sum()) != len(trials):
        told = f"{number} counted and {table['trials'].sum()} left out"
        message = f"internal error: {told} of {len(trials)} trials, some are neither or both"
        raise RuntimeError(message)
    return table


def clean_table(trials: pd.DataFrame, *, more: Iterable[str] = ()) -> pd.DataFrame:
    """Return every trial with whether it counts (``counted``) and, if not, why (``reason``).

    In front stand the columns of `experiment.rows.COLUMNS`; rows are ordered by
    participant, session, trial and attempt. Columns that `more` names come last.
    """
    counts = trials["reason"].eq("")
    table = trials[[column.name for column in COLUMNS]].assign(
        counted=counts, reason=trials["reason"].mask(counts, NOT_AVAILABLE)
    )
    table = table.assign(**{name: trials[name] for name in more})
    place = ["participant", "session", "trial", "attempt"]
    return table.sort_values(place, key=in_order, ignore_index=True)


def counted(trials: pd.DataFrame, kind: str) -> pd.DataFrame:
    """Return the trials of a kind that count.

    >>> trials = pd.DataFrame({"kind": ["single", "single", "both"], "reason": ["", "voided", ""]})
    >>> len(counted(trials, "single"))
    1
    """
    return trials[trials["reason"].eq("") & trials["kind"].eq(kind)]


def uncounted(trials: pd.DataFrame) -> list[str]:
    """Return the participants of whom no trial counts.

    >>> trials = pd.DataFrame({"participant": ["1", "2", "1"], "reason": ["", "voided", "voided"]})
    >>> uncounted(trials)
    ['2']
    """
    counted_here = trials.loc[trials["reason"].eq(""), "participant"].unique()
    return sorted({*trials["participant"].unique()} - {*counted_here})


def offers_none(trials: pd.DataFrame) -> bool:
    """Tell whether "none" could be answered in every trial that counts.

    >>> offers_none(pd.DataFrame({"none_offered": [True, None], "reason": ""}))
    False
    """
    offered = trials.loc[trials["reason"].eq(""), "none_offered"].astype("boolean")
    return bool(offered.fillna(value=False).all())


BEFORE, AFTER = "before", "after"
"""Hands-off trials before practice, and those after the task."""
_ANSWERS = {
    "left": "left",
    "right": "right",
    "both": "both",
    "none": "none",
    "timeouts": "timeout",
    "invalid": "invalid",
}
_KEY = ["condition", "part", "side"]
HANDS_OFF_COLUMNS = ("participant", "part", "side", *_ANSWERS, "presented")


def hands_off_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Count the answers to hands-off trials; none of them is in any other table.

    Columns `HANDS_OFF_COLUMNS`: for each participant, then for `TOTAL`, a row for each part
    (`BEFORE` practice, `AFTER` the task) and side of the plate that was driven.
    With several conditions a column ``condition`` stands in front, each with its own totals.

    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "block": [-1, 2],
    ...     "kind": "hands_off", "side": "left", "response": ["none", "left"], "fault": ""})
    >>> hands_off_table(trials)[["participant", "part", "left", "none"]].to_numpy().tolist()
    [['1', 'before', 0, 1], ['1', 'after', 1, 0], ['all', 'before', 0, 1], ['all', 'after', 1, 0]]
    """
    chosen = trials[trials["kind"].astype(object).eq(HANDS_OFF) & trials["fault"].eq("")]
    response = chosen["response"].astype(object)
    marked = pd.DataFrame(
        {
            "participant": chosen["participant"],
            "condition": chosen["condition"],
            "part": pd.Categorical(
                np.where(chosen["block"].eq(HANDS_OFF_BLOCK), BEFORE, AFTER), [BEFORE, AFTER]
            ),
            "side": chosen["side"].astype(object),
            **{name: response.eq(word).astype(np.int64) for name, word in _ANSWERS.items()},
            "presented": 1,
        }
    )
    people = marked.groupby(["participant", *_KEY], as_index=False, observed=True).sum()
    people = people.sort_values(["participant", *_KEY], key=in_order)
    totals = people.drop(columns="participant").groupby(_KEY, as_index=False, observed=True).sum()
    table = pd.concat([people, totals.assign(participant=TOTAL)])
    table = table.astype({"part": object})
    table = table.sort_values("condition", kind="stable").reset_index(drop=True)
    several = len(set(chosen["condition"])) > 1
    return table[["condition", *HANDS_OFF_COLUMNS] if several else list(HANDS_OFF_COLUMNS)]


REACTION_COLUMNS = ("condition", "level_vpp", "side", "n", "median", "p10", "p90")
_QUANTILES = (0.5, 0.1, 0.9)


def reaction_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the median, 10 % and 90 % points of the reaction time by level and side, in seconds.

    Only correct answers to single stimuli that have a time: of a wrong answer nobody knows what it
    answered, and a time-out has none. Percentiles interpolate linearly between the sorted times;
    they are NaN where ``n`` is 0.

    >>> trials = pd.DataFrame({"condition": "main", "kind": "single", "side": "left",
    ...     "level_vpp": 60.0, "response": ["left", "left", "right"], "rt_s": [0.4, 0.6, 9.0],
    ...     "reason": ""})
    >>> reaction_table(trials)[["n", "median"]].to_numpy().tolist()
    [[2.0, 0.5]]
    """
    single = counted(trials, "single")
    side, response = single["side"].astype(object), single["response"].astype(object)
    times_s = single["rt_s"].astype(float).where(response.eq(side))
    key = ["condition", "level_vpp", "side"]
    marked = single[key[:2]].assign(side=side, rt_s=times_s)
    rows = [
        [*group, *_summary(cell["rt_s"].dropna().to_numpy())] for group, cell in marked.groupby(key)
    ]
    return pd.DataFrame(rows, columns=list(REACTION_COLUMNS))


def _summary(times_s: np.ndarray[tuple[int], np.dtype[np.float64]]) -> list[float]:
    if not times_s.size:
        return [0, *[float("nan")] * len(_QUANTILES)]
    return [times_s.size, *np.quantile(times_s, _QUANTILES).tolist()]
