"""Checks of the answers: response mapping reversed, at chance, drift; sides; order of conditions.

Each check is a test, a limit of its p and the code of a warning, whose data are the numbers of the
message. The tests are exact where they decide on a participant, so that few are named without a
reason; docs/benchmarks.md has how often. No check leaves out or changes an answer.
"""

from __future__ import annotations

import itertools
import math
import warnings
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import pandas as pd

from analysis.codes import WarningCode
from analysis.counts.intervals import equal_rates_p, hypergeometric_tails
from analysis.counts.table import (
    COUNTED_KINDS,
    PERSON,
    count_sites,
    counted,
)
from analysis.task_columns import task_of
from experiment.tasks.task import SINGLE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from analysis.axis import Axis

    Floats = NDArray[np.float64]


REVERSED_P: Final = 1e-3
CHANCE_P: Final = 0.05
DRIFT_P: Final = 1e-3
MIN_STIMULI: Final = 20
"""With fewer stimuli, no participant is reported to be at chance."""
MIN_DRIFT_STEPS: Final = 3.0
"""The smallest drift within a session that is reported, in dB; eighths of the range on a linear
axis."""
MIN_CHANGE: Final = 0.25
"""The same of the detected share from the first half of a session to the second."""
MIN_PEOPLE: Final = 3
"""Participants whose differences between sides are compared with how much they vary."""


class FailedCheck(NamedTuple):
    """A check that failed: the code of its warning, and the data of the message."""

    code: WarningCode
    data: Mapping[str, Any]


_GUESSING: Final = (
    *("participant", "condition", "detected", "named", "several", "tested"),
    *("detected_any", "presented", "false_alarms", "blanks", "p"),
)
_REVERSED: Final = ("participant", "detected", "named", "several", "p")
_SESSION: Final = ["participant", "session"]
_STRATA: Final = [*_SESSION, "condition", "level_vpp", "side"]
_SUMS: Final = (
    *("presented", "detected", "detected_any", "named", "forced"),
    *("at_first", "named_at_first", "named_first", "detected_at_first"),
)


def check_answers(
    cells: pd.DataFrame, blanks: pd.DataFrame, alternatives: int = 2
) -> Iterator[FailedCheck]:
    """Yield the participants whose response mapping is reversed, or who are at chance.

    The mapping is reversed where fewer answers name the stimulated side than by chance, over all
    conditions. At chance in a condition is who is no better than by guessing, neither at all levels
    together nor at one of them with Bonferroni's correction.

    Parameters
    ----------
    cells : pandas.DataFrame
        From `count_correct`, or a table of counts, which has no sides.
    blanks : pandas.DataFrame
        From `count_false_alarms`.
    alternatives : int
        Of a forced choice.

    Examples
    --------
    >>> cells = pd.DataFrame({"participant": "7", "condition": "main", "level_vpp": [60.0, 90.0],
    ...     "detected": [1, 2], "presented": 30, "none_offered": False})
    >>> blanks = pd.DataFrame(columns=["condition", "participant", "felt", "presented"])
    >>> [(str(code), data["participant"]) for code, data in check_answers(cells, blanks)]
    [('responses_reversed', '7')]
    """
    forced = cells["presented"].mask(cells["none_offered"].astype(bool), 0)
    if "side" not in cells:
        wrong = (cells["presented"] - cells["detected"]).where(forced > 0, 0)
        cells = cells.assign(side="", mislocalised=wrong, detected_any=cells["detected"])
    at_first = cells["side"].eq(cells["side"].min())
    named = cells["detected"] + cells["mislocalised"]
    table = cells.assign(
        forced=forced,
        named=named,
        at_first=cells["presented"] * at_first,
        named_at_first=named * at_first,
        named_first=cells["detected"].where(at_first, cells["mislocalised"]),
        detected_at_first=cells["detected"] * at_first,
    )
    people, conditions, levels = (
        _with_tails(table.groupby(key, as_index=False)[[*_SUMS]].sum(), alternatives)
        for key in (["participant"], PERSON, [*PERSON, "level_vpp"])
    )
    is_reversed = people[people["tested"] & people["p_below"].lt(REVERSED_P)]
    yield from _failed(
        WarningCode.RESPONSES_REVERSED,
        is_reversed.rename(columns={"p_below": "p"})[[*_REVERSED]],
    )
    conditions, levels = (_with_chance_p(rows, blanks) for rows in (conditions, levels))
    by_level = levels.groupby(PERSON)["p"].agg(["min", "size"])
    corrected = by_level["min"].fillna(1.0) * by_level["size"]
    conditions = conditions.join(corrected.rename("p_level"), on=PERSON)
    at_chance = conditions[
        conditions["presented"].ge(MIN_STIMULI)
        & conditions[["p", "p_level"]].ge(CHANCE_P).all(axis=1)
        & ~conditions["participant"].isin(is_reversed["participant"])
    ]
    if len({*cells["condition"]}) == 1:
        at_chance = at_chance.assign(condition="")
    yield from _failed(WarningCode.GUESSING, at_chance[[*_GUESSING]])


def _failed(code: WarningCode, rows: Any) -> Iterator[FailedCheck]:
    """Yield a check that failed for each row, whose columns are the data."""
    for data in rows.to_dict("records"):
        yield FailedCheck(code, data)


def _with_tails(rows: pd.DataFrame, alternatives: int) -> pd.DataFrame:
    """Return rows with P(at most) and P(at least) as many correct answers by guessing.

    With ``several`` correct answers out of two, how often each is given is given, so that a
    participant who prefers one is not taken for one who reverses them (Fisher's exact test, one
    tail each). Else only a forced choice can be ``tested``, where a guess is correct once in so
    many alternatives.
    """
    from scipy.stats import binom

    several = rows["at_first"].gt(0) & rows["at_first"].lt(rows["presented"])
    several &= alternatives == 2  # noqa: PLR2004
    margins = ("detected_at_first", "named", "named_at_first", "named_first")
    below, above = hypergeometric_tails(*(rows[name].to_numpy(float) for name in margins))
    guesses = binom(rows["named"], 1 / alternatives)
    return rows.assign(
        several=several,
        tested=several | rows["forced"].eq(rows["presented"]),
        p_below=np.where(several, below, guesses.cdf(rows["detected"])),
        p_above=np.where(several, above, guesses.sf(rows["detected"] - 1)),
    )


def _with_chance_p(rows: pd.DataFrame, blanks: pd.DataFrame) -> pd.DataFrame:
    """Return rows with p of answers as good by guessing, by their sites and against blanks."""
    names = {"felt": "false_alarms", "presented": "blanks"}
    rows = rows.join(blanks.set_index(PERSON)[[*names]].rename(columns=names), on=PERSON)
    rows[[*names.values()]] = rows[[*names.values()]].fillna(0).astype(np.int64)
    hits, stimuli, false_alarms, number = (
        rows[name].to_numpy(float)
        for name in ("detected_any", "presented", "false_alarms", "blanks")
    )
    _, above = hypergeometric_tails(hits, stimuli + number, stimuli, hits + false_alarms)
    tests = pd.DataFrame({"sites": rows["p_above"].where(rows["tested"]), "blanks": above})
    tests["blanks"] = tests["blanks"].where(number > 0)
    return rows.assign(p=(tests.min(axis=1) * tests.notna().sum(axis=1)).clip(upper=1.0))


def check_drift(trials: pd.DataFrame, axis: Axis) -> Iterator[FailedCheck]:
    """Yield the sessions in which the threshold drifts.

    Those with `drift_p` below `DRIFT_P` and a `drift_steps` of at least `MIN_DRIFT_STEPS`; where
    that cannot be estimated, the share that is detected changes by `MIN_CHANGE`.

    >>> from analysis.axis import VOLTS
    >>> trials = pd.DataFrame({"participant": "7", "session": "01", "condition": "main",
    ...     "trial": range(40), "kind": "single", "side": "right", "level_vpp": 60.0, "reason": "",
    ...     "response": ["right"] * 20 + ["none"] * 20})
    >>> [data["detected"] for _, data in check_drift(trials, VOLTS)]
    [[20, 0]]
    """
    single = counted(trials, SINGLE).astype({**dict.fromkeys(_STRATA, object), "level_vpp": float})
    correct = single["side"].map({p.name: p.correct for p in task_of(trials).of_kind(SINGLE)})
    single = single.assign(hit=single["response"].astype(object).eq(correct).astype(float))
    p_values = drift_p(single).rename("p").reset_index()
    for session in p_values[p_values["p"].lt(DRIFT_P)].to_dict("records"):
        is_here = (single[_SESSION] == [session[name] for name in _SESSION]).all(axis=1)
        rows = single[is_here].sort_values("trial")
        groups = rows.groupby("condition")["hit"]
        is_late = groups.cumcount().ge(groups.transform("size") / 2)
        halves = rows.groupby(is_late)["hit"].agg(["sum", "size", "mean"])
        # A step is a dB, or an eighth of the range of a linear axis.
        step = 1 / 20 if axis.is_logarithmic else float(np.ptp(rows["level_vpp"])) / 8 or 1.0
        steps = drift_steps(rows, axis.on_axis(rows["level_vpp"].to_numpy(float)) / step)
        change = abs(halves["mean"].diff().iloc[-1])
        if abs(steps) < MIN_DRIFT_STEPS or (math.isnan(steps) and change < MIN_CHANGE):
            continue
        data = {str(name): value for name, value in session.items()}
        data["detected"], data["presented"] = (
            halves[n].astype(int).tolist() for n in ("sum", "size")
        )
        data["drift"] = (
            None if math.isnan(steps) else steps * (1.0 if axis.is_logarithmic else step)
        )
        data["unit"] = "dB" if axis.is_logarithmic else axis.unit
        yield FailedCheck(WarningCode.THRESHOLD_DRIFTS, data)


def drift_p(single: pd.DataFrame) -> pd.Series[float]:
    """Return the two-sided p of a trend over each session, by participant and session.

    Mantel's score test (J. Am. Stat. Assoc. 58 (1963) 690-700) of ``hit`` against the rank of the
    trial, stratified by condition, level and side: no function of the level is assumed, and one
    pass takes all sessions.

    >>> rows = pd.DataFrame({"participant": "1", "session": "01", "condition": "main",
    ...     "level_vpp": 60.0, "side": "right", "trial": range(40),
    ...     "hit": [True] * 20 + [False] * 20})
    >>> drift_p(rows).round(7).tolist()
    [1e-07]
    """
    from scipy.stats import norm

    rank = single.groupby(_SESSION)["trial"].rank()
    table = single[_STRATA].assign(hit=single["hit"].astype(float), time=rank)
    groups = table.groupby(_STRATA)
    hit, time = (table[name] - groups[name].transform("mean") for name in ("hit", "time"))
    products = table[_STRATA].assign(n=1, score=hit * time, hits=hit**2, times=time**2)
    sums = products.groupby(_STRATA).sum()
    sums = sums[sums["n"] > 1]
    sums["variance"] = sums["hits"] * sums["times"] / (sums["n"] - 1)
    of_session = sums.groupby(_SESSION)[["score", "variance"]].sum()
    of_session = of_session[of_session["variance"] > 0]
    z = of_session["score"] / np.sqrt(of_session["variance"])
    return pd.Series(2 * norm.sf(z.abs()), index=z.index)


def drift_steps(rows: pd.DataFrame, level: Floats) -> float:
    """Return by how many steps of the level the threshold rises in the longest condition.

    By the probit regression of ``hit`` on level and time, with an intercept for each condition and
    side, the threshold moves by -b_time / b_level. NaN for one level, and where level and time
    separate hits from misses.
    """
    from statsmodels.genmod import families
    from statsmodels.genmod.generalized_linear_model import GLM

    strata = rows.groupby(["condition", "side"])
    mixed = strata["hit"].transform("nunique") > 1
    order = rows["trial"].rank()
    time = (order - order.min()) / max(np.ptp(order), 1.0) - 0.5
    spans = time.groupby(rows["condition"]).agg(np.ptp)
    strata_columns = pd.get_dummies(strata.ngroup()[mixed], dtype=float).to_numpy()
    design = np.column_stack([(level - level.mean())[mixed], time[mixed], strata_columns])
    if not mixed.any() or np.linalg.matrix_rank(design) < design.shape[1]:
        return math.nan
    family = families.Binomial(families.links.Probit())
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of separation, and of a fit that does not converge
        try:
            fit = GLM(rows["hit"][mixed].to_numpy(), design, family=family).fit()
        except (Warning, np.linalg.LinAlgError):
            return math.nan
    slope, trend = fit.params[:2]
    return float(-trend / slope * spans.max()) if slope > 0 else math.nan


def sides_differ(counts: pd.DataFrame) -> pd.DataFrame:
    """Test whether single stimuli are detected equally often at all sides.

    Columns ``condition p``. p is the smallest of all pairs of sides, times their number. That of a
    pair is the larger of two: of the exact Cochran-Mantel-Haenszel test, stratified by participant
    and level, and, with `MIN_PEOPLE` participants or more, of Student's t test of their mean
    differences. The first alone would find a difference wherever participants differ, though some
    are more sensitive at one side and some at the other. In a forced choice a preference of one
    answer looks the same as a more sensitive side.

    >>> from analysis.counts.table import count_answers
    >>> from experiment.tasks import LEFT_RIGHT_BOTH
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": np.repeat(LEFT_RIGHT_BOTH.sites, 9), "level_vpp": 60.0, "reason": "",
    ...     "response": np.repeat([LEFT_RIGHT_BOTH.sites[0], "none"], 9), "none_offered": True})
    >>> sides_differ(count_answers(trials))["p"].round(5).tolist()
    [4e-05]
    """
    from statsmodels.stats.weightstats import DescrStatsW

    rows = []
    for condition, cells in count_sites(counts).groupby("condition"):
        for a, b in itertools.combinations(task_of(counts).sites, 2):
            at_a, at_b = (cells[cells["side"].eq(name)] for name in (a, b))
            both = at_a.merge(at_b, on=["participant", "level_vpp"], suffixes=("_a", "_b"))
            if both.empty:
                continue
            hits, shown = (
                both[[f"{name}_a", f"{name}_b"]].to_numpy() for name in ("detected", "presented")
            )
            p = equal_rates_p(hits, shown)
            share = pd.Series(np.diff(hits / shown)[:, 0]).groupby(both["participant"]).mean()
            # Differences that are all the same have no t.
            if len(share) >= MIN_PEOPLE and share.std() > 0:
                p = max(p, DescrStatsW(share).ttest_mean()[1])
            rows.append([condition, p])
    groups = pd.DataFrame(rows, columns=["condition", "p"]).groupby("condition")["p"]
    return (groups.min() * groups.size()).clip(upper=1.0).reset_index()


INTERLEAVED, ALTERNATED = "interleaved", "alternated"
"""Names in place of that of a condition, if conditions alternate by trials, or by blocks."""
_MIN_BLOCK: Final = 4
"""Conditions alternate by blocks where at least half of the runs are as long."""


def condition_order(trials: pd.DataFrame, *, numbered: bool = True) -> pd.DataFrame:
    """Return which of two conditions came first, for each participant in both.

    Columns ``participant condition_a condition_b first``. ``first`` is the condition that ended
    before the other began, `INTERLEAVED`, `ALTERNATED`, or None where the table does not show it:
    sessions count by their number, and trials by block and trial number where these run on over
    conditions. Unless trials are `numbered`, only blocks count. The order of rows never counts.

    >>> trials = pd.DataFrame({"participant": "1", "session": "01", "block": 1, "kind": "single",
    ...     "trial": [1, 2, 3, 4], "condition": ["b", "b", "a", "a"], "reason": ""})
    >>> condition_order(trials)["first"].tolist()
    ['b']
    >>> condition_order(trials.assign(trial=[1, 2, 1, 2]))["first"].tolist()
    [None]
    """
    key = ["session", "block", *(["trial"] if numbered else [])]
    shown = trials[trials["reason"].eq("") & trials["kind"].isin(COUNTED_KINDS)]
    shown = shown[["participant", "condition", *key]].astype(
        dict.fromkeys([*PERSON, "session"], str)
    )
    shown = shown.drop_duplicates()
    rows = [
        [participant, a, b, _first(person[person["condition"].isin([a, b])], key)]
        for participant, person in shown.groupby("participant")
        for a, b in itertools.combinations(sorted(person["condition"].unique()), 2)
    ]
    return pd.DataFrame(rows, columns=["participant", "condition_a", "condition_b", "first"])


def _first(pair: pd.DataFrame, key: list[str]) -> str | None:
    sessions = pair["session"]
    if pair.duplicated(key).any() or not (len({*sessions}) == 1 or sessions.str.isdigit().all()):
        return None
    condition = pair.assign(session=sessions.str.zfill(32)).sort_values(key)["condition"]
    runs = condition.ne(condition.shift()).cumsum()
    if runs.iloc[-1] == 2:  # noqa: PLR2004 (each condition is one run)
        return str(condition.iloc[0])
    lengths = condition.groupby(runs).agg(["size", "first"]).groupby("first")["size"].median()
    return ALTERNATED if "trial" not in key or lengths.min() >= _MIN_BLOCK else INTERLEAVED
