"""Detection probabilities: levels, participants, both-finger and blank trials."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from analysis.answers.counting import NEEDED, counted, offers_none, require_columns
from analysis.answers.intervals import group_interval, proportion_ci
from analysis.definitions import TOTAL, in_order

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


LEVEL_COLUMNS = (
    "condition",
    "level_vpp",
    "detected",
    "presented",
    "p_min",
    "p_mean",
    "p_max",
    "p_pooled",
    "group_low",
    "group_high",
    "over_report",
    "mislocalised",
    "timeouts",
    "p_answered",
)

_FELT = ("left", "right", "both")
_BOTH = (
    "participant",
    "noticed",
    "presented",
    "p",
    "low",
    "high",
    "group_low",
    "group_high",
    "left_only",
    "right_only",
)
_BLANK = ("participant", *_FELT, "presented", "p", "low", "high", "group_low", "group_high")


def cells(trials: pd.DataFrame) -> pd.DataFrame:
    """Count the answers of each participant at each level of each condition.

    Columns ``condition level_vpp participant detected presented over_report mislocalised timeouts
    invalid``: the common shape of trials and of tables of counts.

    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": "left", "level_vpp": 60.0, "response": ["left", "both"], "reason": ""})
    >>> cells(trials)[["detected", "presented", "over_report"]].to_numpy().tolist()
    [[1, 2, 1]]
    """
    single = counted(trials, "single")
    side, response = single["side"].astype(object), single["response"].astype(object)
    counts = {
        "detected": response.eq(side),
        "presented": response.notna(),
        "over_report": response.eq("both"),
        "mislocalised": response.isin(["left", "right"]) & response.ne(side),
        "timeouts": response.eq("timeout"),
        "invalid": response.eq("invalid"),
    }
    key = ["condition", "level_vpp", "participant"]
    marked = single[key].assign(**{name: hit.astype(np.int64) for name, hit in counts.items()})
    return marked.groupby(key, as_index=False).sum()


def participants_of(counts: pd.DataFrame, ci: str = "wilson") -> pd.DataFrame:
    """Return the detection probability of every participant at every level.

    Columns ``participant condition level_vpp detected presented p low high``, of counts from
    `cells` or from a table of counts; `ci` is a method of `proportion_ci`.

    >>> counts = {"participant": ["1"], "condition": "main", "level_vpp": 60.0, "detected": 10**9,
    ...     "presented": 2 * 10**9}
    >>> participants_of(pd.DataFrame(counts))["p"].tolist()
    [0.5]
    """
    key = ["participant", "condition", "level_vpp"]
    ordered = counts.sort_values(key, key=in_order)
    return _with_interval(ordered[[*key, "detected", "presented"]], "detected", ci)


def _with_interval(table: pd.DataFrame, detected: str, ci: str) -> pd.DataFrame:
    k, n = table[detected].to_numpy(), table["presented"].to_numpy()
    low, high = proportion_ci(k, n, ci)
    return table.assign(p=k / n, low=low, high=high).reset_index(drop=True)


def level_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the detection probability over participants, one row per condition and level.

    A single stimulus is detected where the answer names its side and nothing else. ``none``,
    time-outs and invalid keys are not detected and stay in the number of presented stimuli.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.

    Returns
    -------
    pandas.DataFrame
        Columns ``condition level_vpp detected presented p_min p_mean p_max p_pooled group_low
        group_high over_report mislocalised timeouts p_answered``, defined in docs/statistics.md,
        section 4; levels in peak-to-peak volts. ``group_low`` and ``group_high`` are NaN for a
        single participant, ``p_answered`` where nobody answered.

    Raises
    ------
    ValueError
        For a table without a column that is needed, as `analysis.read_trials` gives them.

    Examples
    --------
    >>> trials = pd.DataFrame({"participant": ["1", "1"], "condition": "main", "kind": "single",
    ...     "side": "left", "level_vpp": 60.0, "response": ["left", "both"], "reason": ""})
    >>> level_table(trials)[["detected", "presented", "over_report", "p_mean"]].to_numpy().tolist()
    [[1.0, 2.0, 1.0, 0.5]]
    """
    require_columns(trials, NEEDED)
    return levels_of(cells(trials))


def levels_of(counts: pd.DataFrame) -> pd.DataFrame:
    """Return `level_table` of counts, from `cells` or from a table of counts.

    ``over_report``, ``mislocalised``, ``timeouts`` and ``p_answered`` are NaN where the counts do
    not tell them.
    """
    groups = counts.groupby(["condition", "level_vpp"])
    rows = [[*key, *_level_row(level)] for key, level in groups]
    return pd.DataFrame(rows, columns=list(LEVEL_COLUMNS))


def _level_row(level: pd.DataFrame) -> list[float]:
    """Return the values of one level, from ``detected`` on, of `LEVEL_COLUMNS`."""
    k, n = level["detected"].to_numpy(), level["presented"].to_numpy()
    each = [Fraction(int(a), int(b)) for a, b in zip(k, n, strict=True)]
    # Exact fractions: neither the order of participants nor rounding can move the mean.
    spread = (float(min(each)), float(sum(each) / len(each)), float(max(each)))
    check_order(*spread)
    detected, presented = int(k.sum()), int(n.sum())
    answered = presented - level["timeouts"].sum(skipna=False) - level["invalid"].sum(skipna=False)
    others = [level[name].sum(skipna=False) for name in ("over_report", "mislocalised", "timeouts")]
    p_answered = detected / answered if answered else float("nan")
    pooled = detected / presented
    return [detected, presented, *spread, pooled, *group_interval(k, n), *others, p_answered]


def check_order(p_min: float, p_mean: float, p_max: float) -> None:
    """Stop where a mean lies outside its own values: then this program is wrong.

    >>> check_order(0.9, 0.87, 1.0)
    Traceback (most recent call last):
    RuntimeError: internal error: mean 0.87 outside [0.9, 1.0]
    """
    if not p_min <= p_mean <= p_max:
        raise RuntimeError(f"internal error: mean {p_mean} outside [{p_min}, {p_max}]")


def detected_any(trials: pd.DataFrame) -> pd.DataFrame:
    """Count single stimuli that were felt at all: answered left, right or both.

    Columns ``condition level_vpp detected_any``, the rows of `level_table`. A forced choice is
    refused: there every answer is one of the three.

    >>> trials = pd.DataFrame({"condition": "main", "kind": "single", "level_vpp": 60.0,
    ...     "response": ["left", "none"], "reason": "", "none_offered": True})
    >>> detected_any(trials).to_numpy().tolist()
    [['main', 60.0, 1]]
    """
    if not offers_none(trials):
        raise ValueError('trials must offer "none" as an answer, got a forced choice')
    single = counted(trials, "single")
    felt = single["response"].isin(_FELT).astype(np.int64)
    marked = single[["condition", "level_vpp"]].assign(detected_any=felt)
    return marked.groupby(["condition", "level_vpp"], as_index=False).sum()


def detected_any_of(counts: pd.DataFrame) -> pd.DataFrame:
    """Return `detected_any` of a table of counts, where what was detected was felt."""
    key = ["condition", "level_vpp"]
    felt = counts[[*key, "detected"]].rename(columns={"detected": "detected_any"})
    return felt.groupby(key, as_index=False).sum()


def both_table(trials: pd.DataFrame, ci: str = "wilson") -> pd.DataFrame:
    """Count both-finger trials; such a trial is noticed only by the answer ``both``.

    Columns ``participant noticed presented p low high group_low group_high left_only right_only``,
    the last row `TOTAL`: there ``low`` and ``high`` ignore that participants differ, and
    ``group_low`` and ``group_high`` are `group_interval`, NaN in other rows. With more than one
    condition among the trials that count, a column ``condition`` stands in front and each has its
    last row.

    >>> trials = pd.DataFrame({"participant": ["1", "2"], "condition": "main", "kind": "both",
    ...     "response": ["both", "left"], "reason": ""})
    >>> both_table(trials)[["participant", "noticed", "presented"]].to_numpy().tolist()
    [['1', 1, 1], ['2', 0, 1], ['all', 1, 2]]
    """
    answers = {"noticed": ("both",), "left_only": ("left",), "right_only": ("right",)}
    table = _with_interval(_answer_counts(trials, "both", answers), "noticed", ci)
    return _leading(trials, _with_group(table, "noticed"), _BOTH)


def blank_table(
    trials: pd.DataFrame, ci: str = "wilson", blanks: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Count blank trials; left, right or both answered there is a false alarm.

    Columns ``participant left right both presented p low high group_low group_high``, p for any of
    the three; the rest as in `both_table`. `blanks` are those of a table of counts, see
    `analysis.reading.foreign.counts.Counted`, which do not tell which side was answered.

    >>> blanks = {"condition": "main", "participant": ["1", "2"], "felt": [3, 1], "presented": 20}
    >>> table = blank_table(pd.DataFrame(), blanks=pd.DataFrame(blanks))
    >>> table[["participant", "presented", "p"]].to_numpy().tolist()
    [['1', 20, 0.15], ['2', 20, 0.05], ['all', 40, 0.1]]
    """
    if blanks is not None:
        return _blank_of(blanks, ci)
    counts = _answer_counts(trials, "blank", {answer: (answer,) for answer in _FELT})
    counts["felt"] = counts[list(_FELT)].sum(axis="columns")
    table = _with_group(_with_interval(counts, "felt", ci), "felt", false_alarms=True)
    return _leading(trials, table, _BLANK)


def _blank_of(blanks: pd.DataFrame, ci: str) -> pd.DataFrame:
    people = blanks[["condition", "participant", "felt", "presented"]]
    with_ends = _with_interval(_with_totals(people), "felt", ci)
    table = _with_group(with_ends, "felt", false_alarms=True)
    table = table.assign(**dict.fromkeys(_FELT, np.nan))
    several = len({*blanks["condition"]}) > 1
    return table[["condition", *_BLANK] if several else [*_BLANK]]


def _with_group(table: pd.DataFrame, hits: str, *, false_alarms: bool = False) -> pd.DataFrame:
    """Give the total of each condition the interval of the mean of people."""
    total = table["participant"].eq(TOTAL)
    limits = np.full((len(table), 2), np.nan)
    for at in np.flatnonzero(total):
        same = table["condition"].eq(table["condition"].iloc[at])
        people = table[same & ~total & table["presented"].gt(0)]
        if len(people):
            counts = people[hits].to_numpy(), people["presented"].to_numpy()
            limits[at] = group_interval(*counts, false_alarms=false_alarms)
    return table.assign(group_low=limits[:, 0], group_high=limits[:, 1])


def _answer_counts(
    trials: pd.DataFrame, kind: str, answers: Mapping[str, tuple[str, ...]]
) -> pd.DataFrame:
    """Count answers per condition and participant, and the total of each condition below them."""
    chosen = counted(trials, kind)
    counts = {name: chosen["response"].isin(words) for name, words in answers.items()}
    marked = chosen[["condition", "participant"]].assign(
        presented=1, **{name: hit.astype(np.int64) for name, hit in counts.items()}
    )
    people = marked.groupby(["condition", "participant"], as_index=False).sum()
    return _with_totals(people.sort_values(["condition", "participant"], key=in_order))


def _with_totals(people: pd.DataFrame) -> pd.DataFrame:
    """Put the total of each condition below its participants."""
    totals = people.drop(columns="participant").groupby("condition", as_index=False).sum()
    both = pd.concat([people, totals.assign(participant=TOTAL)])
    return both.sort_values("condition", kind="stable").reset_index(drop=True)


def _leading(trials: pd.DataFrame, table: pd.DataFrame, order: Iterable[Any]) -> pd.DataFrame:
    conditions = trials.loc[trials["reason"].eq(""), "condition"].nunique()
    return table[["condition", *order] if conditions > 1 else list(order)]
