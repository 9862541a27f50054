"""What was answered, counted once: one tidy frame of counts, and the tables that follow from it."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from analysis.counts.intervals import group_interval, mean_limits, proportion_ci
from analysis.numbers import TOTAL, in_order
from analysis.task_columns import task_of, with_task
from experiment.names import NOT_AVAILABLE
from experiment.record.rows import NO_ANSWERS, columns_of
from experiment.tasks import make_task
from experiment.tasks.task import BLANK, BOTH, SINGLE
from experiment.trial.plan import HANDS_OFF, HANDS_OFF_BLOCK

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from experiment.tasks.task import Task


COUNTED_KINDS: Final = (SINGLE, BOTH, BLANK)

_KEY: Final = ["condition", "participant", "kind", "side", "level_vpp", "response", "none_offered"]
NEEDED: Final = (*_KEY, "reason")
"""Columns of trials that `count_answers` needs."""
PERSON: Final = ["condition", "participant"]
_LEVEL: Final = ["condition", "level_vpp"]

BAND: Final = ("p_function", "p_low", "p_high")
"""The group's function at a level, with its 95 % limits."""
LEVEL_COLUMNS: Final = (
    *(*_LEVEL, "detected", "presented", "p_min", "p_mean", "p_max", "p_pooled", *BAND),
    *("over_report", "mislocalised", "timeouts", "p_answered"),
)
SIDE_COLUMNS: Final = (
    *("condition", "side", "level_vpp", "detected", "presented", "p_min", "p_mean", "p_max"),
)
_WITH_INTERVALS: Final = ("presented", "p", "low", "high", "group_low", "group_high")


def responses_of(task: Task) -> tuple[str, ...]:
    """Return the words of the column ``response``, those without an answer last."""
    return (*task.answer_names, *NO_ANSWERS)


def felt_answers(task: Task) -> tuple[str, ...]:
    """Return the answers that something was felt; to a blank trial each is a false alarm."""
    return tuple(name for name in task.answer_names if name != task.nothing)


def sites_in(rows: pd.DataFrame) -> pd.Series[str]:
    """Return the site whose threshold each single trial measures; of another, what it presents.

    >>> rows = pd.DataFrame({"side": ["left_1", "right_2"]})
    >>> sites_in(with_task(rows, make_task("2ifc"))).tolist()
    ['left', 'right']
    """
    sites = {shown.name: shown.site or shown.name for shown in task_of(rows).presentations}
    return rows["side"].astype(object).map(sites)


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


def counted(trials: pd.DataFrame, kind: str) -> pd.DataFrame:
    """Return the trials of a kind that count."""
    return trials[trials["reason"].eq("") & trials["kind"].eq(kind)]


def uncounted(trials: pd.DataFrame) -> list[str]:
    """Return the participants of whom no trial counts.

    >>> trials = pd.DataFrame({"participant": ["1", "2", "1"], "reason": ["", "voided", "voided"]})
    >>> uncounted(trials)
    ['2']
    """
    return sorted({*trials["participant"]} - {*trials.loc[trials["reason"].eq(""), "participant"]})


def count_answers(trials: pd.DataFrame) -> pd.DataFrame:
    """Count each answer to each stimulus, of the trials that count.

    Columns ``condition participant kind side level_vpp response none_offered n`` and those of
    `with_task`, sorted. All tables below are sums of these rows.

    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": "left", "level_vpp": 60.0, "response": ["left", "both", "left"], "reason": "",
    ...     "none_offered": True})
    >>> count_answers(trials)[["response", "n"]].to_numpy().tolist()
    [['both', 1], ['left', 2]]
    """
    require_columns(trials, NEEDED)
    chosen = trials[trials["reason"].eq("") & trials["kind"].isin(COUNTED_KINDS)]
    types = dict.fromkeys(_KEY, object) | {"level_vpp": float}
    # If it is unknown whether "none" could be answered, it counts as not offered.
    offered = chosen["none_offered"].astype("boolean").fillna(value=False).astype(bool)
    keys = chosen[_KEY].astype(types).assign(none_offered=offered)
    task = task_of(trials)
    for name, choices in (("side", task.presentation_names), ("response", responses_of(task))):
        if not keys[name].isin(choices).all():
            raise ValueError(f"{name} must be one of {', '.join(choices)} where a trial counts")
    counts = keys.groupby(_KEY, dropna=False).size().reset_index(name="n")
    return with_task(counts, task)


@cache
def _outcomes(name: str, at_sites: tuple[str, ...]) -> pd.DataFrame:
    """Return what each response is to each presentation, as the task of this name defines it."""
    task = make_task(name, sites=at_sites)
    sites = {answer.name: {*answer.sites} for answer in task.answers}
    felt = felt_answers(task)
    rows = {
        (shown.name, response): {
            "presented": True,
            "detected": response == shown.correct,
            "detected_any": response in felt,
            "answered": response in sites,
            "over_report": sites.get(response, set()) > {*shown.sites},
            "mislocalised": bool(sites.get(response)) and not sites[response] & {*shown.sites},
            "timeouts": response == "timeout",
            "invalid": response == "invalid",
        }
        for shown in task.presentations
        for response in responses_of(task)
    }
    table = pd.DataFrame.from_dict(rows, orient="index")
    return table.rename_axis(["side", "response"]).astype(np.int64)


def sum_outcomes(counts: pd.DataFrame, kind: str, key: Sequence[str]) -> pd.DataFrame:
    """Return how often each outcome occurred in trials of a kind, by the columns of `key`.

    Columns ``presented detected detected_any answered over_report mislocalised timeouts invalid``.

    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": "left", "level_vpp": 60.0, "response": ["left", "both", "timeout"],
    ...     "reason": "", "none_offered": True})
    >>> sums = sum_outcomes(count_answers(trials), "single", ["condition"])
    >>> sums[["presented", "detected", "detected_any", "answered"]].to_numpy().tolist()
    [[3, 1, 2, 2]]
    """
    rows = counts[counts["kind"].eq(kind)].reset_index(drop=True)
    pairs = pd.MultiIndex.from_frame(rows[["side", "response"]])
    task = task_of(counts)
    of_pairs = _outcomes(task.name, task.sites).loc[pairs].reset_index(drop=True)
    outcomes = of_pairs.mul(rows["n"], axis=0)
    return pd.concat([rows[[*key]], outcomes], axis=1).groupby([*key], as_index=False).sum()


def _count_responses(rows: pd.DataFrame, key: Sequence[str]) -> pd.DataFrame:
    """Return how often each response was given, and to how many stimuli, by columns of `key`."""
    table = rows.pivot_table("n", key, "response", aggfunc="sum", fill_value=0)
    table = table.reindex(columns=[*responses_of(task_of(rows))], fill_value=0).astype(np.int64)
    return table.assign(presented=table.sum(axis=1)).rename_axis(columns=None).reset_index()


def _with_total(rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows and the same rows of a participant `TOTAL`, which no participant is called."""
    return pd.concat([rows, rows.assign(participant=TOTAL)])


def count_false_alarms(counts: pd.DataFrame) -> pd.DataFrame:
    """Count blank trials in which something was ``felt``, by condition and participant."""
    return sum_outcomes(counts, BLANK, PERSON).rename(columns={"detected_any": "felt"})


def count_levels(counts: pd.DataFrame, *more: str) -> pd.DataFrame:
    """Count the answers of each participant at each level of each condition.

    Columns ``condition level_vpp participant``, those that `more` names, the outcomes of
    `sum_outcomes` and ``none_offered``: the common shape of trials and of tables of counts.
    """
    key = [*_LEVEL, "participant", *more]
    rows = counts[counts["kind"].eq(SINGLE)]
    offered = rows.groupby(key)["none_offered"].all()
    return sum_outcomes(counts, SINGLE, key).assign(none_offered=offered.to_numpy(dtype=bool))


def count_sites(counts: pd.DataFrame) -> pd.DataFrame:
    """Return `count_levels` by the site of the stimulus, in a column ``side``."""
    counts = counts.assign(site=sites_in(counts))
    return count_levels(counts, "site").rename(columns={"site": "side"})


def count_correct(counts: pd.DataFrame, reference_vpp: float | None = None) -> pd.DataFrame:
    """Return `count_levels` by the correct answer, in a column ``side``.

    ``detected`` are correct answers then, and ``mislocalised`` those that would be correct to
    another single stimulus. In a comparison with a reference, the correct answer depends on the
    level, and trials at the reference have none.
    """
    singles = task_of(counts).of_kind(SINGLE)
    rows = counts[counts["kind"].eq(SINGLE)]
    correct = rows["side"].map({shown.name: shown.correct for shown in singles})
    if reference_vpp is not None:
        rows = rows[rows["level_vpp"].ne(reference_vpp)]
        below = rows["side"].map({shown.name: shown.correct_below for shown in singles})
        correct = correct[rows.index].mask(rows["level_vpp"].lt(reference_vpp), below)
    # One presentation with this correct answer represents those at all sites.
    alike = {shown.correct: shown.name for shown in reversed(singles)}
    rows = rows.assign(side=correct.map(alike), answer=correct)
    is_wrong = rows["response"].isin([*alike]) & rows["response"].ne(rows["answer"])
    cells = count_levels(rows, "side")
    key = [*_LEVEL, "participant", "side"]
    wrong = rows["n"].where(is_wrong, 0).groupby([rows[name] for name in key]).sum()
    return cells.assign(mislocalised=wrong.to_numpy())


def summarize_participants(cells: pd.DataFrame, ci: str = "wilson") -> pd.DataFrame:
    """Return the detection probability of every participant at every level.

    Columns ``participant condition level_vpp detected presented p low high``, of `count_levels` or
    of a table of counts; `ci` is a method of `proportion_ci`.

    >>> cells = {"participant": ["1"], "condition": "main", "level_vpp": 60.0, "detected": 10**9,
    ...     "presented": 2 * 10**9}
    >>> summarize_participants(pd.DataFrame(cells))["p"].tolist()
    [0.5]
    """
    key = ["participant", "condition", "level_vpp"]
    table = cells.sort_values(key, key=in_order)[[*key, "detected", "presented"]]
    return _with_interval(table.reset_index(drop=True), "detected", ci)


def _with_interval(table: pd.DataFrame, hits: str, ci: str) -> pd.DataFrame:
    k, n = table[hits].to_numpy(), table["presented"].to_numpy()
    low, high = proportion_ci(k, n, ci)
    return table.assign(p=k / n, low=low, high=high)


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
        Columns ``condition level_vpp detected presented p_min p_mean p_max p_pooled p_function
        p_low p_high over_report mislocalised timeouts p_answered``, defined in columns.json of an
        analysis; levels in peak-to-peak volts. ``p_function`` is NaN here; ``p_low`` and ``p_high``
        are 95 % limits of ``p_mean`` by Student's t, NaN for a single participant; ``p_answered``
        is NaN at levels without an answer.

    Raises
    ------
    ValueError
        For a table without a column that is needed, as `analysis.read_trials` gives them.

    Examples
    --------
    >>> trials = pd.DataFrame({"participant": ["1", "1"], "condition": "main", "kind": "single",
    ...     "side": "left", "level_vpp": 60.0, "response": ["left", "both"], "reason": "",
    ...     "none_offered": True})
    >>> level_table(trials)[["detected", "presented", "over_report", "p_mean"]].to_numpy().tolist()
    [[1.0, 2.0, 1.0, 0.5]]
    """
    return summarize_levels(count_levels(count_answers(trials)))


def summarize_levels(cells: pd.DataFrame, bands: pd.DataFrame | None = None) -> pd.DataFrame:
    """Return `level_table` of `count_levels` or of a table of counts.

    ``p_function``, ``p_low`` and ``p_high`` are those of `bands` (the group's function with its
    95 % band) where it has them. Counts of errors are NaN where a table of
    counts has none.
    """
    limits, table = _summary(cells, _LEVEL)
    errors = ["over_report", "mislocalised", "timeouts", "invalid"]
    groups = cells.groupby(_LEVEL)[errors]
    table[errors] = groups.sum().where(groups.count().eq(groups.size(), axis=0))
    answered = table["presented"] - table["timeouts"] - table["invalid"]
    table["p_answered"] = (table["detected"] / answered).where(answered > 0)
    table["p_pooled"] = table["detected"] / table["presented"]
    table["p_function"] = math.nan
    table["p_low"], table["p_high"] = (limits[end].clip(0.0, 1.0) for end in ("low", "high"))
    if bands is not None:
        table.update(bands.set_index(_LEVEL)[[*BAND]])
    return table.reset_index()[[*LEVEL_COLUMNS]]


def summarize_sides(counts: pd.DataFrame) -> pd.DataFrame:
    """Return the detection probability at each side: columns `SIDE_COLUMNS`."""
    _, table = _summary(count_sites(counts), ["condition", "side", "level_vpp"])
    return table.reset_index()[[*SIDE_COLUMNS]]


def _summary(cells: pd.DataFrame, key: list[str]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return t limits, and sums and participants' proportions, of each group of cells."""
    p = (cells["detected"] / cells["presented"]).rename("p").astype(float)
    limits = mean_limits(p, [cells[name] for name in key])
    groups = p.groupby([cells[name] for name in key])
    table = cells.groupby(key)[["detected", "presented"]].sum()
    return limits, table.assign(p_min=groups.min(), p_mean=limits["mean"], p_max=groups.max())


def count_detected_any(cells: pd.DataFrame) -> pd.DataFrame | None:
    """Count single stimuli that were felt at all, wherever: columns ``condition level_vpp`` too.

    None unless ``none`` was always offered. In a table of counts these are the detected ones.

    >>> cells = pd.DataFrame({"condition": "main", "level_vpp": [60.0], "detected": 3,
    ...     "none_offered": True})
    >>> count_detected_any(cells).to_numpy().tolist()
    [['main', 60.0, 3]]
    """
    if not cells["none_offered"].all():
        return None
    detected = cells["detected_any" if "detected_any" in cells else "detected"]
    groups = cells.assign(detected_any=detected).groupby(_LEVEL, as_index=False)
    return groups[["detected_any"]].sum()


def count_both(counts: pd.DataFrame, ci: str = "wilson") -> pd.DataFrame:
    """Count trials with a stimulus at every site, noticed only by the answer that names them all.

    Columns are ``participant noticed presented p low high group_low group_high``, and a column
    ``_only`` for each site. The last row is `TOTAL`: its ``low`` and ``high`` ignore that
    participants differ, and its ``group_low`` and ``group_high`` are `group_interval`, NaN in other
    rows. If the trials that count have more than one condition, the first column is ``condition``,
    and each condition has such a last row.

    >>> trials = pd.DataFrame({"participant": ["1", "2"], "condition": "main", "kind": "both",
    ...     "side": "both", "level_vpp": 60.0, "response": ["both", "left"], "reason": "",
    ...     "none_offered": True})
    >>> both = count_both(count_answers(trials))
    >>> both[["participant", "noticed", "presented"]].to_numpy().tolist()
    [['1', 1, 1], ['2', 0, 1], ['all', 1, 2]]
    """
    only = {site: f"{site}_only" for site in task_of(counts).sites}
    people = _count_people(counts, BOTH).rename(columns={"detected": "noticed"} | only)
    table = _with_intervals(people, "noticed", ci)
    return _select(table, ["participant", "noticed", *_WITH_INTERVALS, *only.values()], counts)


def count_blanks(
    counts: pd.DataFrame, ci: str = "wilson", blanks: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Count blank trials; any answer but that nothing was felt is a false alarm.

    Columns ``participant``, a column for each such answer, ``presented p low high group_low
    group_high``; the rest as in `count_both`. `blanks` are those of a table of counts, see
    `analysis.reading.foreign.sum_counts`, which do not have the answers.

    >>> blanks = {"condition": "main", "participant": ["1", "2"], "felt": [3, 1], "presented": 20}
    >>> table = count_blanks(pd.DataFrame(), blanks=pd.DataFrame(blanks))
    >>> table[["participant", "presented", "p"]].to_numpy().tolist()
    [['1', 20, 0.15], ['2', 20, 0.05], ['all', 40, 0.1]]
    """
    if blanks is None:
        people, trials = _count_people(counts, BLANK), counts
        people = people.rename(columns={"detected_any": "felt"})
    else:
        people, trials = _with_total(blanks).groupby(PERSON, as_index=False).sum(), blanks
    table = _with_intervals(people, "felt", ci, false_alarms=True)
    return _select(table, ["participant", *felt_answers(task_of(counts)), *_WITH_INTERVALS], trials)


def _count_people(counts: pd.DataFrame, kind: str) -> pd.DataFrame:
    """Count outcomes and responses to trials of a kind, of each participant and of all."""
    rows = _with_total(counts[counts["kind"].eq(kind)])
    return sum_outcomes(rows, kind, PERSON).merge(
        _count_responses(rows, PERSON), on=[*PERSON, "presented"]
    )


def _with_intervals(
    people: pd.DataFrame, hits: str, ci: str, *, false_alarms: bool = False
) -> pd.DataFrame:
    """Return people and `TOTAL` of each condition with their intervals, in their order."""
    table = _with_interval(people.sort_values(PERSON, key=in_order, ignore_index=True), hits, ci)
    table[["group_low", "group_high"]] = math.nan
    is_total = table["participant"].eq(TOTAL)
    for condition, group in table[~is_total].groupby("condition"):
        limits = group_interval(group[hits], group["presented"], false_alarms=false_alarms)
        row = is_total & table["condition"].eq(condition)
        table.loc[row, ["group_low", "group_high"]] = limits
    return table


def _select(table: pd.DataFrame, columns: list[str], trials: pd.DataFrame) -> pd.DataFrame:
    """Return some columns, with the condition in front if there are trials of several."""
    several = len({*trials["condition"]}) > 1
    return table.reindex(columns=["condition", *columns] if several else columns)


def count_confusions(counts: pd.DataFrame) -> pd.DataFrame:
    """Count the answers to each stimulus, over levels and participants.

    Columns ``condition kind side``, one for each response, ``presented``; one row per condition and
    stimulus that was presented.
    """
    table = _count_responses(counts, ["condition", "kind", "side"])
    order = task_of(counts).presentation_names
    table["side"] = pd.Categorical(table["side"], order)  # in the order of the task
    table = table.sort_values(["condition", "side"], ignore_index=True)
    return table.astype({"side": object})


def excluded_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Count what is left out, in columns ``participant reason trials``.

    >>> trials = pd.DataFrame({"participant": "1", "kind": "single", "reason": ["", "voided"]})
    >>> excluded_table(trials).to_numpy().tolist()
    [['1', 'voided', 1]]
    """
    left_out = trials[trials["reason"].ne("")]
    key = ["participant", "reason"]
    table = left_out.groupby(key).size().reset_index(name="trials")
    return table.sort_values(key, key=in_order, ignore_index=True)


def clean_table(trials: pd.DataFrame, *, more: Iterable[str] = ()) -> pd.DataFrame:
    """Return every trial with whether it counts (``counted``) and, if not, why (``reason``).

    In front stand the columns of `experiment.record.rows.columns_of`; rows are ordered by
    participant, session, trial and attempt. Columns that `more` names come last.
    """
    counts = trials["reason"].eq("")
    table = trials[[column.name for column in columns_of(task_of(trials))]].assign(
        counted=counts,
        reason=trials["reason"].mask(counts, NOT_AVAILABLE),
        **{name: trials[name] for name in more},
    )
    order = ["participant", "session", "trial", "attempt"]
    return table.sort_values(order, key=in_order, ignore_index=True)


BEFORE, AFTER = "before", "after"
"""Hands-off trials before practice, and those after the task."""


def hands_off_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Count the answers to hands-off trials; none of them is in any other table.

    Columns are ``participant part side``, one for each response, and ``presented``. Each
    participant, then `TOTAL`, has a row for each part (`BEFORE` practice, `AFTER` the task) and for
    each driven side of the plate. If there are several conditions, the first column is
    ``condition``, and each condition has its own totals.

    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "block": [-1, 2],
    ...     "kind": "hands_off", "side": "left", "response": ["none", "left"], "fault": ""})
    >>> hands_off_table(trials)[["participant", "part", "left", "none"]].to_numpy().tolist()
    [['1', 'before', 0, 1], ['1', 'after', 1, 0], ['all', 'before', 0, 1], ['all', 'after', 1, 0]]
    """
    rows = trials[trials["kind"].eq(HANDS_OFF) & trials["fault"].eq("")]
    task = task_of(trials)
    rows = rows[["condition", "participant", "side", "response", "block"]].astype(object)
    is_before = rows["block"].eq(HANDS_OFF_BLOCK)
    rows = with_task(rows.assign(part=np.where(is_before, BEFORE, AFTER), n=1), task)
    key = [*PERSON, "part", "side"]
    table = _count_responses(_with_total(rows), key)
    table = table.rename(columns={"timeout": "timeouts"}).sort_values(
        key, key=in_order, ascending=[True, True, False, True], ignore_index=True
    )
    return _select(table, [*key[1:], *table.columns[len(key) :]], rows)


def is_correct(rows: pd.DataFrame) -> pd.Series[bool]:
    """Return which answers are correct; in a comparison with a reference, as the table states."""
    task = task_of(rows)
    if task.has_reference:
        return rows["correct"].astype("boolean").fillna(value=False).astype(bool)
    correct = {shown.name: shown.correct for shown in task.presentations}
    return rows["response"].astype(object).eq(rows["side"].astype(object).map(correct))


def reaction_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the median, 10 % and 90 % points of the reaction time by level and side, in seconds.

    Columns ``condition level_vpp side n median p10 p90``. Only correct answers to single stimuli
    with a time count; percentiles interpolate linearly and are NaN where ``n`` is 0.

    >>> trials = pd.DataFrame({"condition": "main", "kind": "single", "side": "left",
    ...     "level_vpp": 60.0, "response": ["left", "left", "right"], "rt_s": [0.4, 0.6, 9.0],
    ...     "reason": ""})
    >>> reaction_table(trials)[["n", "median"]].to_numpy().tolist()
    [[2.0, 0.5]]
    """
    single = counted(trials, SINGLE).astype({"condition": object, "side": object})
    times_s = single["rt_s"].astype(float).where(is_correct(single))
    sites = sites_in(single).rename("side")
    groups = times_s.groupby([*(single[name] for name in _LEVEL), sites])
    points = {"median": 0.5, "p10": 0.1, "p90": 0.9}
    columns = {"n": groups.count(), **{n: groups.quantile(q) for n, q in points.items()}}
    return pd.DataFrame(columns).reset_index()
