"""Reaction times of correct answers to single stimuli."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.counting import counted

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
