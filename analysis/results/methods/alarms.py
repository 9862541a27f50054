"""What blank trials tell: how often they were answered as felt."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, Final

from analysis.answers.intervals import group_interval, proportion_ci
from analysis.axis import half_up
from analysis.codes import Statement, StatementCode
from analysis.definitions import TOTAL
from analysis.reading.foreign.columns import FORCED
from analysis.results.compared import pairs_of, totals
from analysis.results.methods.words import SPELLED, isolated
from analysis.results.rows import none_in_part

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    import pandas as pd

    from analysis.results.tables import Analysis


_ABOUT: Final = 1.05
_COVERED: Final = (
    "; in simulations of 6 and of 12 people with 20 blank trials each and mean rates of 2 to 10 %, "
    "such intervals held the mean in 94 to 99 % of studies: it lay below the lower limit in at "
    "most 6 %, and above the upper one in none of the studies of 6 people and in at most 4 % of "
    "those of 12, instead of 2.5 % each"
)
"""As docs/statistics.md has it; pasted only into a study of such people and trials."""
_SIMULATED_PEOPLE: Final = range(6, 13)
_SIMULATED_BLANKS: Final = 20
_FEW_PEOPLE: Final = 10
"""Of fewer the upper limit of their false alarms was never too low in simulations."""
_FEW_ALARMS: Final = 0.1
"""So far these simulations went."""


def alarm_sentences(analysis: Analysis) -> Iterator[Statement]:
    """Say how often blank trials were answered as felt, or why that is not told."""
    if analysis.detected_any is None:
        how = " was not an answer as far as the files tell"
        if none_in_part(analysis):
            how = " is not known to be an answer in all trials"
        elif analysis.task == FORCED:
            how = " was not an answer: forced choice, as the map says"
        text = f'false alarms are not told, for "none"{how}'
        yield Statement(StatementCode.FALSE_ALARMS_NOT_ASKED, text)
        return
    if not (rows := [*totals(analysis)]):
        some = not analysis.trials.empty and analysis.trials["kind"].eq("blank").any()
        why = "no blank trial counts" if some else "there were no blank trials"
        text = f"false alarms are not known, for {why}"
        yield Statement(StatementCode.FALSE_ALARMS_UNKNOWN, text)
    elif len(rows) > SPELLED:
        yield Statement(StatementCode.FALSE_ALARMS_IN_TABLE, "false alarms stand in the table")
    else:
        each = (f"{_share(row)} of blank trials{_where(analysis, row, ' in')}" for row in rows)
        yield Statement(StatementCode.FALSE_ALARMS, f"false alarms: {', '.join(each)}")
        if any(_alike(*two) for two in itertools.combinations(rows, 2)):
            text = (
                "equal counts have unequal intervals where participants differ more in one "
                "condition"
            )
            yield Statement(StatementCode.EQUAL_COUNTS_UNEQUAL_INTERVALS, text)


def _alike(one: pd.Series[Any], other: pd.Series[Any]) -> bool:
    """Tell whether counts are equal, of about as many trials, and intervals as printed are not."""
    counts = {round(row["p"] * row["presented"]) for row in (one, other)}
    trials = sorted(row["presented"] for row in (one, other))
    of_people = not math.isnan(one["group_low"] + other["group_low"])
    same = len(counts) == 1 and trials[1] <= _ABOUT * trials[0]
    return of_people and same and _limits(one) != _limits(other)


def _where(analysis: Analysis, row: pd.Series[Any], before: str) -> str:
    # Totals of blank trials have no condition where those of one condition count alone.
    condition = row.get("condition")
    if analysis.counts.conditions == 1 or condition is None:
        return ""
    return f"{before} condition {isolated(condition)}"


def _share(row: pd.Series[Any]) -> str:
    """Write a rate with the interval of the mean of people; of one person, with that one's."""
    return f"{_percent(row['p'])} % ({_limits(row)} %)"


def _limits(row: pd.Series[Any]) -> str:
    of = "" if math.isnan(row["group_low"]) else "group_"
    return " to ".join(_percent(row[f"{of}{end}"]) for end in ("low", "high"))


def _percent(share: float) -> str:
    return half_up(round(100 * float(share), 9), 1)  # 100 * 0.0375 need not be 3.75


def blank_rows(analysis: Analysis) -> Iterator[tuple[str, str, str]]:
    """Yield the rows of false alarms in the answer's table.

    Where conditions took turns the rate of all blank trials stands first, as that to quote.
    """
    if analysis.detected_any is None:
        return
    together = interleaved(analysis)
    if together:
        share, of = _all_blanks(analysis, together)
        yield (
            "False alarms, all",
            share,
            f"{of}; to quote, if nothing told which condition was coming",
        )
    for row in totals(analysis):
        # Counts made elsewhere do not tell the sides.
        of = f"{row['p'] * row['presented']:.0f} of {row['presented']} blank trials"
        of += _most(analysis, row)
        if not math.isnan(row["group_low"]) and row.get("condition") not in together:
            of += "; the interval to quote, wider the more people differ"
            few = analysis.participants["participant"].nunique() < _FEW_PEOPLE
            if few and row["p"] <= _FEW_ALARMS:
                of += ", its upper limit cautious, as they are few"
        yield f"False alarms{_where(analysis, row, ',')}", _share(row), of


def _most(analysis: Analysis, total: pd.Series[Any]) -> str:
    """Say whose share of blank trials is the largest; empty text where all have the same."""
    rows = analysis.blank[analysis.blank["participant"].ne(TOTAL)]
    if "condition" in rows:
        rows = rows[rows["condition"].eq(total["condition"])]
    most = rows[rows["p"].eq(rows["p"].max())]
    if len(most) == len(rows):
        return ""
    row = most.iloc[0]
    of = f"{row['p'] * row['presented']:.0f} of {row['presented']}"
    if len(most) > 1:
        return f", of a participant at most {of}"
    return f", participant {isolated(row['participant'])} the most with {of}"


def interleaved(analysis: Analysis) -> set[str]:
    """Return all conditions where every two of them were interleaved and have blanks; else none."""
    pairs = [*pairs_of(analysis.differences)]
    names = {name for one in pairs for name in (one.a, one.b)}
    told = {row["condition"] for row in totals(analysis) if "condition" in row}
    every = bool(pairs) and all(one.took_turns for one in pairs)
    return names if every and names == told else set()


def taken_together(analysis: Analysis, conditions: Collection[str]) -> str:
    """Say what a blank trial's condition means where nobody knows which is coming."""
    share, of = _all_blanks(analysis, conditions)
    return (
        "conditions were interleaved: if nothing told participants which was coming, a difference "
        "of false alarms is chance, as their blanks are the same event, and the rate in all of "
        f"them is to be quoted, {share}, {of}; if they could tell, the rates of each "
        "and their differences are"
    )


def _all_blanks(analysis: Analysis, conditions: Collection[str]) -> tuple[str, str]:
    """Return the rate of false alarms in several conditions with its interval, and its counts."""
    blank = analysis.blank[analysis.blank["condition"].isin(conditions)]
    rows = blank[blank["participant"].ne(TOTAL)]
    people = (
        rows.assign(felt=(rows["p"] * rows["presented"]).round())
        .groupby("participant")[["felt", "presented"]]
        .sum()
    )
    felt, presented = (people[name].to_numpy() for name in ("felt", "presented"))
    k, n = int(felt.sum()), int(presented.sum())
    limits = group_interval(felt, presented, false_alarms=True)
    if len(people) == 1:
        limits = proportion_ci(k, n, analysis.ci)
    ends = " to ".join(map(_percent, limits))
    return f"{_percent(k / n)} % ({ends} %)", f"{k} of {n} blank trials"


def rates_words(analysis: Analysis) -> str:
    """Say how many blank trials were answered as felt: plain counts; empty text without any."""
    rows = [*totals(analysis)] if analysis.detected_any is not None else []
    if not rows:
        return ""
    each = [
        f"{row['p'] * row['presented']:.0f} of {row['presented']} ({_percent(row['p'])} %)"
        + (f" in condition {isolated(row['condition'])}" if "condition" in row else "")
        for row in rows
    ]
    if together := interleaved(analysis):
        share, of = _all_blanks(analysis, together)
        each.append(f"all of them, as conditions were interleaved, {of}, {share}")
    return f"Blank (catch) trials were answered as if felt in {', in '.join(each)}."


def short_alarm_words(analysis: Analysis) -> str:
    """Say what false-alarm rates and their intervals are, for the short version; else nothing."""
    rows = [*totals(analysis)] if analysis.detected_any is not None else []
    if not rows:
        return ""
    told = "False-alarm rates are shares of the blank trials"
    if any(not math.isnan(row["group_low"]) for row in rows):
        told += ", with 95 % credible intervals for the population mean"
        told += _COVERED if _as_simulated(analysis) else ""
    return f"{told}."


def _as_simulated(analysis: Analysis) -> bool:
    """Tell whether there are as many people, and blank trials of each, as were simulated."""
    each = analysis.blank.loc[analysis.blank["participant"].ne(TOTAL)]
    people = each["participant"].nunique()
    if any(row["p"] > _FEW_ALARMS for row in totals(analysis)):
        return False
    return people in _SIMULATED_PEOPLE and bool(each["presented"].eq(_SIMULATED_BLANKS).all())
