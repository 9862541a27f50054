"""Checks of the answers: response mapping reversed, at chance, drift; sides; order of conditions.

The tests are exact where they decide on a participant, so that few are named without a reason;
docs/benchmarks.md has how often. No check leaves out or turns around an answer.
"""

from __future__ import annotations

import itertools
import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.counts.intervals import equal_rates_p, hypergeometric_tails
from analysis.counts.table import (
    BLANK,
    COUNTED_KINDS,
    SINGLE,
    TASK,
    count_levels,
    counted,
    sum_outcomes,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from analysis.axis import Axis

    Floats = NDArray[np.float64]


REVERSED: Final = "reversed"
AT_CHANCE: Final = "at_chance"
DRIFT: Final = "drift"

REVERSED_P: Final = 1e-3
CHANCE_P: Final = 0.05
BELOW_CHANCE_P: Final = 0.01
MIN_STIMULI: Final = 20
"""With fewer stimuli nobody is said to be at chance."""
DRIFT_P: Final = 1e-3
MIN_DRIFT_DB: Final = 3.0
"""The smallest drift within a session that is reported; eighths of the range on a linear axis."""
MIN_CHANGE: Final = 0.25
"""The same of the detected share from the first half of a session to the second."""

_PERSON: Final = ["condition", "participant"]
_SINGLES: Final = TASK.of_kind(SINGLE)
_CORRECT: Final = {shown.name: shown.correct for shown in _SINGLES}


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerCheck:
    """A participant whose answers need a look: the check that failed, and its numbers.

    `kind` is `REVERSED` over all conditions, `AT_CHANCE` in one condition, or `DRIFT` in a session.
    """

    kind: str
    message: str
    participant: str
    condition: str = ""
    session: str = ""
    p: float = float("nan")

    def __str__(self) -> str:
        return self.message


def check_trials(
    trials: pd.DataFrame, counts: pd.DataFrame, axis: Axis, alternatives: int = 2
) -> Iterator[AnswerCheck]:
    """Yield the participants whose answers need a look.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.
    counts : pandas.DataFrame
        Of `count_answers`.
    axis : Axis
        Of the levels.
    alternatives : int
        Of a forced choice.

    Examples
    --------
    >>> from analysis.axis import VOLTS
    >>> from analysis.counts.table import count_answers
    >>> trials = pd.DataFrame({"participant": "7", "condition": "main", "session": "01",
    ...     "trial": range(40), "kind": "single", "side": ["left", "right"] * 20,
    ...     "level_vpp": 60.0, "response": ["right", "left"] * 20, "reason": "",
    ...     "none_offered": False})
    >>> print(*check_trials(trials, count_answers(trials), VOLTS))
    participant 7: 0 of 40 answers name the stimulated side, fewer than by chance (p = 7e-12); the
    keys or the actuators may be reversed. No answer was changed.
    """
    single = counts[counts["kind"].eq(SINGLE)]
    if single.empty:
        return
    key, first = [*_PERSON, "level_vpp"], _SINGLES[0]
    at_first, named_first = single["side"].eq(first.name), single["response"].eq(first.correct)
    named = single["response"].isin([shown.correct for shown in _SINGLES])
    marks = {
        "at_first": at_first,
        "named_at_first": at_first & named,
        "named_first": named_first,
        "right_at_first": at_first & named_first,
    }
    by_site = single[key].assign(**{name: hit * single["n"] for name, hit in marks.items()})
    table = count_levels(counts).merge(by_site.groupby(key, as_index=False).sum(), on=key)
    table = table.assign(
        named=table["detected"] + table["mislocalised"],
        felt=table["detected_any"],
        forced=~table["none_offered"],
    )
    blanks = sum_outcomes(counts, BLANK, _PERSON).rename(columns={"detected_any": "felt"})
    yield from _check_chance(table, blanks, alternatives)
    yield from check_drift(trials, axis)


def check_counts(
    cells: pd.DataFrame, blanks: pd.DataFrame | None, alternatives: int
) -> Iterator[AnswerCheck]:
    """Check a table of counts, which has no sides and no order of trials.

    >>> cells = pd.DataFrame({"participant": "7", "condition": "main", "level_vpp": [60.0, 90.0],
    ...     "detected": [1, 2], "presented": 30, "none_offered": False})
    >>> [(check.kind, check.participant) for check in check_counts(cells, None, 2)]
    [('reversed', '7')]
    """
    detected, presented = cells["detected"], cells["presented"]
    forced = ~cells["none_offered"].astype(bool)
    named = presented.where(forced, detected)
    table = cells.assign(
        forced=forced,
        felt=detected,
        named=named,
        at_first=presented,
        named_at_first=named,
        named_first=detected,
        right_at_first=detected,
    )
    none = pd.DataFrame(columns=[*_PERSON, "felt", "presented"])
    yield from _check_chance(table, none if blanks is None else blanks, alternatives)


_SUMS: Final = (
    *("presented", "detected", "felt", "named"),
    *("at_first", "named_at_first", "named_first", "right_at_first"),
)


def _check_chance(
    table: pd.DataFrame, blanks: pd.DataFrame, alternatives: int
) -> Iterator[AnswerCheck]:
    """Yield whose response mapping is reversed, and who is at chance at every level.

    At chance is who is not better than by guessing at all levels together, nor at one of them with
    Bonferroni's correction.
    """
    sums = dict.fromkeys(_SUMS, "sum") | {"forced": "min"}
    people = table.groupby("participant", sort=False).agg(sums)
    people = people.join(_chance_tails(people, alternatives))
    is_reversed = people[people["tested"] & people["p_below"].lt(REVERSED_P)]
    for name, row in is_reversed.iterrows():
        message = (
            f"participant {name}: {_count_right(row)}, fewer than by chance (p = "
            f"{format_p(row['p_below'])}); the keys or the actuators may be reversed. "
            "No answer was changed."
        )
        yield AnswerCheck(kind=REVERSED, message=message, participant=str(name), p=row["p_below"])
    columns = {"felt": "blanks_felt", "presented": "blanks"}
    of_blanks = blanks[[*_PERSON, *columns]].rename(columns=columns)
    together = table.groupby(_PERSON, as_index=False).agg(sums)
    levels, together = (
        _with_chance_p(rows.merge(of_blanks, on=_PERSON, how="left"), alternatives)
        for rows in (table, together)
    )
    by_level = levels.groupby(_PERSON)["p"].agg(["min", "size"])
    corrected = by_level["min"].fillna(1.0) * by_level["size"]
    together = together.join(corrected.rename("p_level"), on=_PERSON)
    at_chance = (
        together["presented"].ge(MIN_STIMULI)
        & together["p"].ge(CHANCE_P)
        & together["p_level"].ge(CHANCE_P)
        & ~together["participant"].isin(is_reversed.index)
    )
    several = len({*together["condition"]}) > 1
    for _, row in together[at_chance].iterrows():
        where = f", condition {row['condition']}" if several else ""
        yield AnswerCheck(
            kind=AT_CHANCE,
            message=f"participant {row['participant']}{where}: {_describe_chance(row)}",
            participant=str(row["participant"]),
            condition=str(row["condition"]),
            p=float(row["p"]),
        )


def _chance_tails(rows: pd.DataFrame, alternatives: int) -> pd.DataFrame:
    """Return P(at most) and P(at least) as many right answers by guessing, and if they test.

    With stimuli at several sites, how often a site is answered is given, so that a participant who
    prefers one is not taken for one who reverses them (Fisher's exact test, one tail each). At one
    site only a forced choice can be tested, where a guess is right once in so many alternatives.
    """
    from scipy.special import bdtr, bdtrc

    several = rows["at_first"].gt(0) & rows["at_first"].lt(rows["presented"])
    right, of = rows["detected"].to_numpy(np.float64), rows["named"].to_numpy(np.int64)
    counts = [rows[n] for n in ("right_at_first", "named", "named_at_first", "named_first")]
    below, above = hypergeometric_tails(*(column.to_numpy(np.float64) for column in counts))
    chance = 1 / alternatives
    tested = several | rows["forced"].astype(bool)
    return pd.DataFrame(
        {
            "p_below": np.where(several, below, bdtr(right, of, chance)),
            "p_above": np.where(several, above, bdtrc(right - 1, of, chance)),
            "tested": tested,
            "several": several,
        },
        index=rows.index,
    )


def _with_chance_p(rows: pd.DataFrame, alternatives: int) -> pd.DataFrame:
    """Return rows with p of answers as good by guessing, by their sites and against blanks."""
    rows = rows.join(_chance_tails(rows, alternatives))
    hits, false_alarms, presented, blanks = (
        rows[name].fillna(0).to_numpy(np.float64)
        for name in ("felt", "blanks_felt", "presented", "blanks")
    )
    _, above = hypergeometric_tails(hits, presented + blanks, presented, hits + false_alarms)
    tests = pd.DataFrame(
        {"sites": rows["p_above"].where(rows["tested"]), "blanks": above}, index=rows.index
    )
    tests["blanks"] = tests["blanks"].where(blanks > 0)
    p = (tests.min(axis=1) * tests.notna().sum(axis=1)).clip(upper=1.0)
    return rows.assign(p=p)


def _count_right(row: pd.Series[Any]) -> str:
    name = "name the stimulated side" if row["several"] else "are right"
    return f"{row['detected']:.0f} of {row['named']:.0f} answers {name}"


def _describe_chance(row: pd.Series[Any]) -> str:
    numbers = []
    if row["tested"]:
        numbers.append(_count_right(row))
        if row["p_below"] < BELOW_CHANCE_P:
            numbers.append(f"fewer than by chance, p = {format_p(row['p_below'])}")
    if row["blanks"] > 0:
        numbers.append(
            f"{row['felt']:.0f} of {row['presented']:.0f} single stimuli and "
            f"{row['blanks_felt']:.0f} of {row['blanks']:.0f} blanks were felt"
        )
    return f"answers do not differ from guesses at any level ({'; '.join(numbers)})"


def format_p(value: float) -> str:
    """Format a small probability.

    >>> format_p(0.00012), format_p(0.0)
    ('1e-4', '0')
    """
    return f"{value:.0e}".replace("e-0", "e-") if value else "0"


def check_drift(trials: pd.DataFrame, axis: Axis) -> Iterator[AnswerCheck]:
    """Yield the sessions in which the threshold drifts.

    Those with `drift_p` below `DRIFT_P` and a `drift_size` of at least `MIN_DRIFT_DB`; where that
    cannot be estimated, the share that is detected changes by `MIN_CHANGE`.
    """
    single = counted(trials, SINGLE).astype({"session": object, "participant": object})
    single = single.assign(hit=single["response"].eq(single["side"].map(_CORRECT).astype(object)))
    p = drift_p(single).rename("p").reset_index()
    for _, session in p[p["p"] < DRIFT_P].iterrows():
        names = ["participant", "session"]
        rows = single[(single[names] == session[names]).all(axis=1)].sort_values("trial")
        groups = rows.groupby("condition", observed=True)["hit"]
        is_early = groups.cumcount() < groups.transform("size") / 2
        (first, of_first), (second, of_second) = (
            (int(rows.loc[half, "hit"].sum()), int(half.sum())) for half in (is_early, ~is_early)
        )
        drift = drift_size(rows, axis)
        change = abs(second / of_second - first / of_first)
        if abs(drift) < MIN_DRIFT_DB or (np.isnan(drift) and change < MIN_CHANGE):
            continue
        message = (
            f"participant {session['participant']}, session {session['session']}: {first} of "
            f"{of_first} single stimuli were detected in the first half, {second} of {of_second} "
            f"in the second (p = {format_p(session['p'])})"
        )
        if np.isfinite(drift):
            unit = "dB" if axis.is_logarithmic else axis.unit
            size = abs(drift) * (1.0 if axis.is_logarithmic else _step(rows, axis))
            message += f"; the threshold {'rises' if drift > 0 else 'falls'} by {size:.3g} {unit}"
        person = {name: str(session[name]) for name in names}
        yield AnswerCheck(kind=DRIFT, message=message, p=float(session["p"]), **person)


def drift_p(single: pd.DataFrame) -> pd.Series[float]:
    """Return the two-sided p of a trend over each session, by participant and session.

    Mantel's score test (J. Am. Stat. Assoc. 58 (1963) 690-700) of ``hit`` against the rank of the
    trial, stratified by condition, level and side: no function of the level is assumed, and one
    pass takes all sessions.

    >>> rows = pd.DataFrame({"participant": "1", "session": "01", "condition": "main",
    ...     "level_vpp": 60.0, "side": "left", "trial": range(40),
    ...     "hit": [True] * 20 + [False] * 20})
    >>> drift_p(rows).round(7).tolist()
    [1e-07]
    """
    from scipy.special import erfc

    session = ["participant", "session"]
    order = single.groupby(session, observed=True)["trial"].rank()
    hit = single["hit"].astype(float)
    table = single[[*session, "condition", "level_vpp", "side"]].assign(
        n=1.0, t=order, y=hit, tt=order**2, ty=order * hit
    )
    key = [*session, "condition", "level_vpp", "side"]
    sums = table.groupby(key, observed=True).sum()
    sums = sums[sums["n"] > 1]
    share = sums["y"] / sums["n"]
    scatter = sums["tt"] - sums["t"] ** 2 / sums["n"]
    scores = pd.DataFrame(
        {
            "score": sums["ty"] - sums["t"] * share,
            "variance": scatter * share * (1 - share) * sums["n"] / (sums["n"] - 1),
        }
    )
    of_session = scores.groupby(level=session, observed=True).sum()
    of_session = of_session[of_session["variance"] > 0]
    z = of_session["score"] / np.sqrt(of_session["variance"])
    return pd.Series(erfc(z.abs() / np.sqrt(2)), index=z.index)


def _step(rows: pd.DataFrame, axis: Axis) -> float:
    """Return the length of a dB on the axis, or of an eighth of a linear one's range."""
    if axis.is_logarithmic:
        return 1 / 20
    return float(np.ptp(rows["level_vpp"].to_numpy(float))) / 8 or 1.0


def drift_size(rows: pd.DataFrame, axis: Axis) -> float:
    """Return by how many dB the threshold rises over the longest condition of a session.

    By the probit regression of ``hit`` on level and time, with an intercept for each condition and
    side, the threshold moves by -b_time / b_level; on a linear axis in eighths of its range. NaN
    for one level, and where level and time separate hits from misses.
    """
    from statsmodels.genmod import families
    from statsmodels.genmod.generalized_linear_model import GLM

    strata = rows.groupby(["condition", "side"], observed=True)
    mixed = strata["hit"].transform("nunique") > 1
    order = rows["trial"].rank()
    time = (order - order.min()) / max(np.ptp(order), 1.0) - 0.5
    spans = time.groupby(rows["condition"].astype(str)).agg(np.ptp)
    level = axis.on_axis(rows["level_vpp"].to_numpy(float)) / _step(rows, axis)
    design = pd.get_dummies(strata.ngroup()[mixed], dtype=float).to_numpy()
    design = np.column_stack([(level - level.mean())[mixed], time[mixed], design])
    if not mixed.any() or np.linalg.matrix_rank(design) < design.shape[1]:
        return float("nan")
    family = families.Binomial(families.links.Probit())
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of separation, and of a fit that does not converge
        try:
            fit = GLM(rows.loc[mixed, "hit"].astype(float).to_numpy(), design, family=family).fit()
        except (Warning, np.linalg.LinAlgError):
            return float("nan")
    slope, trend = fit.params[:2]
    return float(-trend / slope * spans.max()) if slope > 0 else float("nan")


_MIN_PEOPLE: Final = 3
"""Participants whose differences between sides are compared with how much they vary."""


def sides_differ(counts: pd.DataFrame) -> pd.DataFrame:
    """Test whether single stimuli are detected equally often at every two sides.

    Columns ``condition side_a side_b p none_offered``, a row for each condition and pair of sides.
    p is the larger of two: of the exact Cochran-Mantel-Haenszel test, stratified by participant and
    level, and, with `_MIN_PEOPLE` participants or more, of Student's t test of their mean
    differences. The first alone would find a difference wherever participants differ, though some
    are more sensitive at one side and some at the other. In a forced choice (``none_offered``
    false) a preference of one answer looks the same as a more sensitive side.

    >>> from analysis.counts.table import count_answers
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": ["left"] * 9 + ["right"] * 9, "level_vpp": 60.0, "reason": "",
    ...     "response": ["left"] * 9 + ["none"] * 9, "none_offered": True})
    >>> sides_differ(count_answers(trials))["p"].round(5).tolist()
    [4e-05]
    """
    cells = count_levels(counts, "side")
    rows = []
    for condition, group in cells.groupby("condition"):
        for a, b in itertools.combinations(_SINGLES, 2):
            pair = [group[group["side"].eq(shown.name)] for shown in (a, b)]
            both = pair[0].merge(pair[1], on=["participant", "level_vpp"], suffixes=("_a", "_b"))
            if len(both):
                hits, shown = (both[[f"{n}_a", f"{n}_b"]] for n in ("detected", "presented"))
                offered = bool(group["none_offered"].all())
                p = max(equal_rates_p(hits, shown), _equal_means_p(both))
                rows.append([condition, a.name, b.name, p, offered])
    return pd.DataFrame(rows, columns=["condition", "side_a", "side_b", "p", "none_offered"])


def _equal_means_p(both: pd.DataFrame) -> float:
    """Return p of Student's t test that participants differ by 0 on average between two sides.

    0 where the test cannot tell: of few participants, and of differences that are all the same.
    """
    from scipy.special import stdtr

    difference = both["detected_b"] / both["presented_b"] - both["detected_a"] / both["presented_a"]
    each = difference.groupby(both["participant"]).mean()
    error = float(each.std()) / math.sqrt(len(each))
    if len(each) < _MIN_PEOPLE or not error > 0:
        return 0.0
    return float(2 * stdtr(len(each) - 1, -abs(each.mean()) / error))


INTERLEAVED, ALTERNATED = "interleaved", "alternated"
"""What stands for a condition where trials, or else blocks, of both conditions take turns."""
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
    columns = ["participant", "condition_a", "condition_b", "first"]
    shown = trials[trials["reason"].eq("") & trials["kind"].isin(COUNTED_KINDS)]
    key = ["session", "block", *(["trial"] if numbered else [])]
    shown = shown[["participant", "condition", *key]].astype({"session": object})
    shown = shown.drop_duplicates().sort_values(key)
    rows = []
    for participant, person in shown.groupby("participant", observed=True):
        conditions = {str(name): rows for name, rows in person.groupby("condition", observed=True)}
        for a, b in itertools.combinations(sorted(conditions), 2):
            pair = pd.concat([conditions[name] for name in (a, b)]).sort_values(key)
            rows.append([participant, a, b, _first(pair, key, numbered=numbered)])
    return pd.DataFrame(rows, columns=columns)


def _first(pair: pd.DataFrame, key: list[str], *, numbered: bool) -> str | None:
    sessions = pair["session"].astype(str)
    if pair.duplicated(key).any() or not (len({*sessions}) == 1 or sessions.str.isdigit().all()):
        return None
    order = pair.assign(session=sessions.where(~sessions.str.isdigit(), sessions.str.zfill(20)))
    condition = order.sort_values(key)["condition"].astype(str)
    runs = condition.ne(condition.shift()).cumsum()
    if runs.iloc[-1] == 2:  # noqa: PLR2004 (each condition is one run)
        return str(condition.iloc[0])
    if not numbered:
        return ALTERNATED
    lengths = condition.groupby(runs).agg(["size", "first"]).groupby("first")["size"].median()
    return ALTERNATED if lengths.min() >= _MIN_BLOCK else INTERLEAVED
