"""Whether and why a trial counts: told once, when tables are read, as columns of the trials."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiment.rows import HANDS_OFF, PRACTICE

_NEVER_COUNTED = (PRACTICE, HANDS_OFF)
NEVER_ANSWERED = "never_answered"
"""Reason of a participant's trials in a condition where every one that would count timed out."""


def with_reasons(trials: pd.DataFrame) -> pd.DataFrame:
    """Return trials with the columns ``reason`` and ``fault``.

    ``reason`` is why a trial is left out of all counts, the first that holds of: its kind
    (``practice``, ``hands_off``), a status other than ``ok``, ``premature``, ``unmasked``,
    ``unverified``; empty text where it counts. ``fault`` is the same whatever the kind: hands-off
    trials are counted by themselves, and those with a fault not even there.

    >>> trials = with_reasons(pd.DataFrame({"kind": ["single", "single", "hands_off"],
    ...     "status": ["ok", "ok", "voided"], "premature": [True, False, False],
    ...     "noise_ok": [None, False, True], "burst_verified": [None, "false", "line"]}))
    >>> trials[["reason", "fault"]].to_numpy().T.tolist()
    [['premature', 'unmasked', 'hands_off'], ['premature', 'unmasked', 'voided']]
    """
    status, kind = trials["status"].astype(object), trials["kind"].astype(object)
    # Noise of which nobody knows whether it played is no reason: most tables do not tell.
    unmasked = trials["noise_ok"].astype("boolean").eq(other=False).fillna(value=False)
    unverified = trials["burst_verified"].astype(object).eq("false")  # as for noise
    tests = [status.ne("ok"), trials["premature"], unmasked, unverified]
    fault = np.select(
        [np.asarray(test, dtype=bool) for test in tests],
        [
            np.asarray(name, dtype=object)
            for name in (status, "premature", "unmasked", "unverified")
        ],
        default="",
    )
    reason = kind.where(kind.isin(_NEVER_COUNTED), fault)
    told = {"reason": reason, "fault": fault}
    return trials.assign(
        **{name: pd.Series(text, index=trials.index, dtype=object) for name, text in told.items()}
    )


def without_silence(trials: pd.DataFrame) -> pd.DataFrame:
    """Return trials `with_reasons`, those of a silent participant in a condition left out, too.

    A time-out among answers is a stimulus that was not detected. Without a single answer it may as
    well be a dead keyboard, which tells nothing of a threshold.

    >>> trials = without_silence(pd.DataFrame({"participant": list("aabb"), "condition": "main",
    ...     "response": ["left", *["timeout"] * 3], "reason": ["", "", "", "voided"]}))
    >>> trials["reason"].tolist()
    ['', '', 'never_answered', 'voided']
    """
    counts = trials["reason"].eq("")
    answered = counts & trials["response"].astype(object).ne("timeout")
    key = [trials[name].astype(object) for name in ("participant", "condition")]
    silent = counts & ~answered.groupby(key).transform("any")
    return trials.assign(reason=trials["reason"].mask(silent, NEVER_ANSWERED))
