"""What the rows of a file must have in common sense: one rule a line, the first breach is named."""

from __future__ import annotations

import math
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.definitions import TOTAL
from analysis.reading.foreign.files import FILE
from analysis.reading.foreign.form import toml_entry
from analysis.reading.rows import expected_correct
from analysis.reading.text import ResultFileError, one_line
from experiment.rows import HANDS_OFF, NOT_AVAILABLE, format_value

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


MIN_MEDIAN_RT_S, MAX_MEDIAN_RT_S = 0.01, 10.0
LEAST_PERSON_RT_S = 0.05
"""No person's median is below it; between these limits and 1000 times theirs nothing is told."""
MIN_LEVEL_VPP, MOST_LEVEL_VPP = 1e-6, 1e6
KEY = ["participant", "session", "trial", "attempt"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rule:
    """A column, what it must be, the rows that break this, and how messages call the column."""

    column: str
    must: str
    broken: pd.Series[bool]
    label: str = ""


def check_rows(rows: pd.DataFrame, *, signed: bool = False) -> None:
    """Refuse rows that contradict themselves; with `signed` a level may have any sign.

    Raises ResultFileError naming the first line of the first file in which a rule is broken.

    >>> from analysis.reading.foreign.columns import ColumnMap
    >>> from analysis.reading.rows import mapped_rows
    >>> text = pd.DataFrame({"participant": "1", "side": "left", "level_vpp": ["60", "0"],
    ...     "kind": "single", "response": "left"}, index=[2, 3])
    >>> check_rows(mapped_rows(text, "t.csv", ColumnMap()))
    Traceback (most recent call last):
    analysis.reading.text.ResultFileError: t.csv:3: column 'level_vpp' is 0; it must be a number
    from 1e-06 to 1e+06 where there is a stimulus
    """
    rules = [participant_rule(rows), *_stimulus_rules(rows, signed=signed), *_answer_rules(rows)]
    refuse_broken(rows, rules)


def refuse_broken(rows: pd.DataFrame, rules: Iterable[Rule]) -> None:
    """Refuse the first row that breaks a rule, by the first rule that it breaks.

    >>> refuse_broken(pd.DataFrame(), [])
    """
    broken = [(int(np.argmax(rule.broken.to_numpy())), rule) for rule in rules if rule.broken.any()]
    if broken:
        row, rule = min(broken, key=itemgetter(0))
        raise ResultFileError(rows["file"].iloc[row], *_fault(rows, row, rule))


def participant_rule(rows: pd.DataFrame) -> Rule:
    """Return the rule for names.

    >>> participant_rule(pd.DataFrame({"participant": ["all", "1"]})).broken.tolist()
    [True, False]
    """
    return Rule(
        column="participant",
        must="another name, for this is the name of the total's row",
        broken=rows["participant"].eq(TOTAL),
    )


_NO_LEVEL: Final = (
    '; blanks without a level: in the map [values.level_vpp] "" = "{}", or what stands there for ""'
)


def _stimulus_rules(rows: pd.DataFrame, *, signed: bool) -> Iterator[Rule]:
    kind, side, level = rows["kind"], rows["side"], rows["level_vpp"]
    for name, sides in (("single", ("left", "right")), ("both", ("both",)), ("blank", ("none",))):
        yield Rule(
            column="side",
            must=f"{' or '.join(sides)} in a {name} trial",
            broken=kind.eq(name) & ~side.isin(sides),
        )
    yield Rule(
        column="block",
        must="0 or more in any but a hands-off trial",
        broken=kind.ne(HANDS_OFF) & rows["block"].lt(0),
    )
    blank = side.eq("none")
    yield level_rule(level, ~blank, signed=signed)
    yield Rule(
        column="level_vpp",
        must="0 or n/a where there is no stimulus",
        broken=blank & level.notna() & level.ne(0),
    )


def level_rule(level: pd.Series[float], stimulus: pd.Series[bool], *, signed: bool) -> Rule:
    """Return the rule for levels where there is a stimulus.

    >>> level_rule(pd.Series([-5.0]), pd.Series([True]), signed=True).broken.tolist()
    [False]
    """
    least, most = (-math.inf, math.inf) if signed else (MIN_LEVEL_VPP, MOST_LEVEL_VPP)
    bounds = "" if signed else f" from {least:g} to {most:g}"
    # Of a table whose blanks have no level, and no side that says so.
    blank = _NO_LEVEL.format("-inf" if signed else "0") if (stimulus & level.isna()).any() else ""
    return Rule(
        column="level_vpp",
        must=f"a number{bounds} where there is a stimulus{blank}",
        broken=stimulus & ~level.between(least, most),
    )


def _answer_rules(rows: pd.DataFrame) -> Iterator[Rule]:
    response = rows["response"]
    yield Rule(
        column="response",
        must="an answer, timeout or invalid where the status is ok",
        broken=rows["status"].eq("ok") & response.isna(),
    )
    yield Rule(
        column="rt_s",
        must="n/a where there was no answer",
        broken=rows["rt_s"].notna() & (response.isna() | response.eq("timeout")),
    )
    yield Rule(
        column="correct",
        must="what kind, side and response say",
        broken=rows["correct"].notna()
        & rows["correct"].ne(expected_correct(rows)).fillna(value=True),
    )


def _fault(rows: pd.DataFrame, row: int, rule: Rule) -> tuple[int, str]:
    """Return the line of a row that breaks a rule, and the message."""
    value = rows[rule.column].iloc[row]
    shown = NOT_AVAILABLE if pd.isna(value) else format_value(_plain(value))
    message = f"column '{rule.label or rule.column}' is {shown}; it must be {rule.must}"
    return int(rows["line"].iloc[row]), message


def _plain(value: Any) -> object:
    """Return a numpy scalar as the Python value it is."""
    return value.item() if isinstance(value, np.generic) else value


def in_seconds(
    trials: pd.DataFrame, *, planned: frozenset[str] = frozenset(), unit: str | None = None
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Find the participants whose reaction times are in another unit than those of the others.

    Beside the files in `planned` a plan tells how long an answer was waited for. Elsewhere nobody's
    median is above `MAX_MEDIAN_RT_S`, or below `MIN_MEDIAN_RT_S`: with a `unit` stated for the
    column, ``s`` by itself and ``None`` where no map could state it, the times of those who have
    such a one are taken for milliseconds, or for seconds, if those of others are not and the median
    then is one of people.

    Returns the trials, and a sentence of each participant whose times were changed. Raises
    ResultFileError for a median that this does not explain.

    >>> trials = pd.DataFrame({"participant": ["1", "2"], "rt_s": [0.6, 650.0], "file": "t.csv",
    ...     "line": [2, 3]})
    >>> trials, told = in_seconds(trials, unit="s")
    >>> trials["rt_s"].tolist(), told
    ([0.6, 0.65], ('participant 2: reaction times are taken for milliseconds (median 650 s)',))
    """
    free = ~trials["file"].isin(planned) if planned else trials["file"].notna()
    medians_s = trials[free].groupby("participant")["rt_s"].median().dropna()
    odd = ~medians_s.between(MIN_MEDIAN_RT_S if unit else 0, MAX_MEDIAN_RT_S)
    told = []
    for person, median_s in medians_s[odd].items():
        factor, other = (1e-3, "milliseconds") if median_s > 1 else (1e3, "seconds")
        at = free & trials["participant"].eq(str(person))
        right = LEAST_PERSON_RT_S <= median_s * factor <= MAX_MEDIAN_RT_S
        if unit is None or odd.all() or not right:
            _refuse_median(trials[at], str(person), median_s, unit)
        trials.loc[at, "rt_s"] *= factor
        told.append(
            f"participant {person}: reaction times are taken for {other} (median {median_s:g} s)"
        )
    return trials, tuple(told)


def _refuse_median(rows: pd.DataFrame, person: str, median_s: float, unit: str | None) -> None:
    row = rows[rows["rt_s"].ge(median_s)].iloc[0]
    stated = unit not in (None, "s")
    hint = (
        f"the map has {unit}; without it these are seconds"
        if stated
        else 'if these are milliseconds, a map says [units] rt_s = "ms"'
    )
    message = (
        f"column 'rt_s' has a median of {median_s:g} s for participant {person}, allowed "
        f"{MIN_MEDIAN_RT_S:g} to {MAX_MEDIAN_RT_S:g} s; {hint}"
    )
    raise ResultFileError(row["file"], int(row["line"]), message)


_LEAST_BLANKS, _MOST_FALSE = 10, 0.5


def right_for_felt(trials: pd.DataFrame) -> Iterator[str]:
    """Say that more than half of the blanks are felt, as right answers to them would seem to be.

    >>> trials = pd.DataFrame({"kind": ["blank"] * 10, "reason": "",
    ...     "response": ["left"] * 9 + ["none"]})
    >>> next(right_for_felt(trials)).partition(":")[0]
    'in 90% of 10 blank trials something was felt'
    """
    blank = trials[trials["reason"].eq("") & trials["kind"].astype(object).eq("blank")]
    felt = blank["response"].astype(object).isin(["left", "right", "both"])
    if len(felt) >= _LEAST_BLANKS and float(felt.mean()) > _MOST_FALSE:
        yield (
            f"in {felt.mean():.0%} of {len(felt)} blank trials something was felt: if that is a "
            "column of right and wrong answers, it has 1 for a blank that was rightly not felt; "
            "[columns] detected must be what was answered"
        )


_NUMBERED_ANEW: Final = (
    '; where trials are numbered anew in each block, the map needs [columns] trial = "" (their '
    "order is taken); session is for another day"
)
_BEGUN_ANEW: Final = (
    "; where one of these files is of a run that was broken off and begun anew, leave it out, "
    "such as [rows.skip] {}; where both count, the map needs [columns] session = "
    '"file-", or participant = "file-" where the files are of two people, or, where they are parts '
    'of one session, trial = "" (the order of rows is taken)'
)


def check_together(trials: pd.DataFrame, *, foreign: bool = False) -> None:
    """Refuse trials of one or several files that are told twice, with what would help.

    Of `foreign` tables that is what their map can say.

    Raises ResultFileError where participant, session, trial and attempt repeat, or where two
    attempts of one trial both have the status ok; practice may be repeated, as warm-up after every
    resume.

    >>> twice = pd.DataFrame({"participant": "1", "session": "01", "trial": 5, "attempt": [1, 2],
    ...     "kind": "single", "status": "ok", "file": "t.csv", "line": [6, 9]})
    >>> check_together(twice.assign(status=["voided", "ok"]))
    >>> check_together(twice)
    Traceback (most recent call last):
    analysis.reading.text.ResultFileError: t.csv:9: participant 1, session 01, trial 5: status ok,
    although another attempt of this trial has it at t.csv:6
    """
    refuse_repeat(
        trials, KEY, "the same participant, session, trial and attempt as", foreign=foreign
    )
    valid = trials[trials["status"].eq("ok") & trials["kind"].ne("practice")]
    refuse_repeat(valid, KEY[:-1], "status ok, although another attempt of this trial has it at")


def refuse_repeat(
    trials: pd.DataFrame, key: list[str], what: str, *, foreign: bool = False
) -> None:
    """Refuse the first row that has the key of an earlier one.

    >>> refuse_repeat(pd.DataFrame({"trial": [1, 2]}), ["trial"], "the same trial as")
    """
    repeated = trials.duplicated(key)
    if not repeated.any():
        return
    second = trials[repeated].iloc[0]
    same = trials[key].eq(second[key]).all(axis="columns")
    first = trials[same].iloc[0]
    told = ", ".join(f"{name} {second[name]}" for name in key)
    hint = _NUMBERED_ANEW if foreign else ""
    if foreign and first["file"] != second["file"]:
        session = trials[KEY[:2]].eq(second[KEY[:2]]).all(axis="columns")
        rows = trials.loc[session, "file"].astype(str).value_counts()
        shorter = Path(min(map(str, (first["file"], second["file"])), key=lambda one: rows[one]))
        hint = _BEGUN_ANEW.format(toml_entry(FILE, shorter.stem))
    message = f"{told}: {what} {one_line(first['file'])}:{first['line']}{hint}"
    raise ResultFileError(second["file"], int(second["line"]), message)
