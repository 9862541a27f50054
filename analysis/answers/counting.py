"""Which trials count, which are left out and why; control trials; reaction times."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.definitions import TOTAL
from experiment.terms.record import COLUMNS, NOT_AVAILABLE
from experiment.trial.plan import AUDIBILITY_BLOCK, CONTROL

COUNTED_KINDS = ("single", "both", "blank")
REASONS = (
    "practice", "control", "device_error", "indeterminate", "aborted", "voided", "anticipated",
    "unmasked",
)  # fmt: skip


def reasons(trials: pd.DataFrame) -> pd.Series[str]:
    """Tell why each trial is left out of all counts.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.

    Returns
    -------
    pandas.Series
        The first of `REASONS` that holds; empty text where the trial counts.

    Examples
    --------
    >>> trial = {"kind": ["single"], "status": ["ok"], "anticipated": [True], "noise_ok": [None]}
    >>> reasons(pd.DataFrame(trial))[0]
    'anticipated'
    """
    kind = trials["kind"].astype(object)
    reason = kind.where(kind.isin(["practice", "control"]), faults(trials))
    return pd.Series(reason, index=trials.index, dtype=object)


def faults(trials: pd.DataFrame) -> pd.Series[str]:
    """Tell why each trial does not count, whatever its kind.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.

    Returns
    -------
    pandas.Series
        One of `REASONS`, from ``device_error`` on; empty text where nothing is amiss.

    Examples
    --------
    >>> trial = {"status": ["ok", "voided"], "anticipated": False, "noise_ok": [False, None]}
    >>> faults(pd.DataFrame(trial)).tolist()
    ['unmasked', 'voided']
    """
    status = trials["status"].astype(object)
    unmasked = trials["noise_ok"].astype("boolean").eq(other=False).fillna(value=False)
    tests = [status.ne("ok"), trials["anticipated"], unmasked]
    reason = np.select(
        [np.asarray(test, dtype=bool) for test in tests],
        [np.asarray(name, dtype=object) for name in (status, "anticipated", "unmasked")],
        default="",
    )
    return pd.Series(reason, index=trials.index, dtype=object)


def excluded_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Count what is left out, by participant and reason.

    Returns
    -------
    pandas.DataFrame
        Columns ``participant reason trials``.

    Raises
    ------
    RuntimeError
        Where a trial would be neither counted nor listed.

    Examples
    --------
    >>> trials = pd.DataFrame({"participant": "1", "kind": ["single", "practice"], "status": "ok",
    ...     "anticipated": False, "noise_ok": None})
    >>> excluded_table(trials).to_numpy().tolist()
    [['1', 'practice', 1]]
    """
    why = reasons(trials)
    left_out = pd.DataFrame({"participant": trials["participant"], "reason": why})[why.ne("")]
    table = left_out.groupby(["participant", "reason"]).size().reset_index(name="trials")
    number = sum(len(counted(trials, kind)) for kind in COUNTED_KINDS)
    if number + int(table["trials"].sum()) != len(trials):
        told = f"{number} counted and {table['trials'].sum()} left out"
        message = f"internal error: {told} of {len(trials)} trials, some are neither or both"
        raise RuntimeError(message)
    return table


def clean_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return every trial with whether it counts and, if not, why.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.

    Returns
    -------
    pandas.DataFrame
        The columns of `experiment.terms.record.COLUMNS`, then ``counted`` and ``reason`` (``n/a``
        where the trial counts), ordered by participant, session, trial and attempt.
    """
    why = reasons(trials)
    table = trials[[column.name for column in COLUMNS]].assign(
        counted=why.eq(""), reason=why.mask(why.eq(""), NOT_AVAILABLE)
    )
    return table.sort_values(["participant", "session", "trial", "attempt"], ignore_index=True)


def counted(trials: pd.DataFrame, kind: str) -> pd.DataFrame:
    """Return the trials of a kind that count.

    >>> len(counted(pd.DataFrame({"kind": ["single", "both"], "status": "ok",
    ...     "anticipated": False, "noise_ok": [True, False]}), "both"))
    0
    """
    return trials[reasons(trials).eq("") & trials["kind"].astype(object).eq(kind)]


def offers_none(trials: pd.DataFrame) -> bool:
    """Tell whether "none" could be answered in every trial that counts.

    >>> offers_none(pd.DataFrame({"none_offered": [True, None], "kind": "single", "status": "ok",
    ...     "anticipated": False, "noise_ok": None}))
    False
    """
    offered = trials.loc[reasons(trials).eq(""), "none_offered"].astype("boolean")
    return bool(offered.fillna(value=False).all())


AUDIBILITY = "audibility"
_ANSWERS = {
    "left": "left",
    "right": "right",
    "both": "both",
    "none": "none",
    "timeouts": "timeout",
    "invalid": "invalid",
}
_KEY = ["condition", "part", "side"]
CONTROL_COLUMNS = ("participant", "part", "side", *_ANSWERS, "presented")


def control_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Count the answers to control trials; none of them is in any other table.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.

    Returns
    -------
    pandas.DataFrame
        Columns `COLUMNS`: for each participant, then for `TOTAL`, a row for each part (`AUDIBILITY`
        at the beginning, ``control`` at the end) and side of the plate that was driven. With more
        than one condition among them, a column ``condition`` stands in front and each has its
        totals below its rows. Empty without such trials.

    Examples
    --------
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "block": [-1, 2, 2],
    ...     "kind": ["control", "control", "single"], "side": "left", "status": "ok",
    ...     "response": ["none", "left", "left"], "anticipated": False, "noise_ok": True})
    >>> control_table(trials)[["participant", "part", "left", "none"]].to_numpy().tolist()
    [['1', 'audibility', 0, 1], ['1', 'control', 1, 0], ['all', 'audibility', 0, 1],
    ['all', 'control', 1, 0]]
    """
    chosen = trials[trials["kind"].astype(object).eq(CONTROL) & faults(trials).eq("")]
    response = chosen["response"].astype(object)
    marked = pd.DataFrame(
        {
            "participant": chosen["participant"],
            "condition": chosen["condition"],
            "part": np.where(chosen["block"].eq(AUDIBILITY_BLOCK), AUDIBILITY, CONTROL),
            "side": chosen["side"].astype(object),
            **{name: response.eq(word).astype(np.int64) for name, word in _ANSWERS.items()},
            "presented": 1,
        }
    )
    people = marked.groupby(["participant", *_KEY], as_index=False).sum()
    totals = people.drop(columns="participant").groupby(_KEY, as_index=False).sum()
    table = pd.concat([people, totals.assign(participant=TOTAL)])
    table = table.sort_values("condition", kind="stable").reset_index(drop=True)
    several = len(set(chosen["condition"])) > 1
    return table[["condition", *CONTROL_COLUMNS] if several else list(CONTROL_COLUMNS)]


REACTION_COLUMNS = ("condition", "level_vpp", "side", "n", "median", "p10", "p90")
_QUANTILES = (0.5, 0.1, 0.9)


def reaction_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the median, 10 % and 90 % points of the reaction time by level and side.

    Only correct answers to single stimuli that have a time: of a wrong answer nobody knows what it
    answered, and a time-out has none. Percentiles interpolate linearly between the sorted times.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.

    Returns
    -------
    pandas.DataFrame
        Columns `REACTION_COLUMNS`: times in seconds, ``n`` how many there are. One row per
        condition, level and side with a stimulus that counts; NaN where ``n`` is 0.

    Examples
    --------
    >>> trials = pd.DataFrame({"condition": "main", "kind": "single", "side": "left",
    ...     "level_vpp": 60.0, "response": ["left", "left", "right"], "rt_s": [0.4, 0.6, 9.0],
    ...     "status": "ok", "anticipated": False, "noise_ok": None})
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
