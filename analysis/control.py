"""Control trials, with the fingers off the plate: what was answered there, apart from all else."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.counting import faults
from analysis.detection import TOTAL
from experiment.plan import AUDIBILITY_BLOCK, CONTROL

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
COLUMNS = ("participant", "part", "side", *_ANSWERS, "presented")


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
    return table[["condition", *COLUMNS] if several else list(COLUMNS)]
