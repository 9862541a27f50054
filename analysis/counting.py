"""Which trials count, which are left out and why; whether "none" could be answered."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiment.record import COLUMNS, NOT_AVAILABLE

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
        The columns of `experiment.record.COLUMNS`, then ``counted`` and ``reason`` (``n/a`` where
        the trial counts), ordered by participant, session, trial and attempt.
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
