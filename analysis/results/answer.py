"""What an analysis answers: three statements and a table, for page, terminal and summary.

Nothing is computed here: a sentence says what a row of a table has, and never more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from analysis.answers.counting import uncounted
from analysis.answers.doubts import GUESSING, SWAPPED
from analysis.axis import alike, rounded, spread_of, with_limits
from analysis.codes import Statement, StatementCode
from analysis.definitions import LAPSES_MANY, LAPSES_OFTEN
from analysis.groups.hierarchy import FEW
from analysis.groups.micrometres import in_micrometres, micrometres_row
from analysis.reading.reasons import NEVER_ANSWERED
from analysis.results.compared import compared, difference_rows, fitting_words, without_words
from analysis.results.methods.alarms import alarm_sentences, blank_rows
from analysis.results.methods.criterion import criterion_sentences, settled
from analysis.results.methods.left_out import left_out_rows, left_out_words, unread_words
from analysis.results.methods.misfit import at_bound_often, lapses_words, steep_words
from analysis.results.methods.task import hit_words
from analysis.results.methods.words import SPELLED, and_words, isolated, number_of
from analysis.results.rows import population_text
from analysis.thresholds.fit import WITH_THRESHOLD

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from analysis.results.tables import Analysis


ANSWER_HEAD: Final = ("What", "Value (95 % interval)", "From")
_DOUBTS: Final = {
    SWAPPED: (StatementCode.RESPONSES_REVERSED, "sides look swapped"),
    GUESSING: (StatementCode.GUESSING, "answers cannot be told from guesses"),
}
_MEDIAN: Final = "(posterior median, 95 % interval "


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What a study asked, answered.

    Attributes
    ----------
    sentences : tuple of tuple of Statement
        Those of the three statements: the threshold; how conditions compare, with the false alarms;
        what was left out.
    rows : tuple of tuple of str
        The same as a table under `ANSWER_HEAD`.

    Names of participants and conditions are `isolated`; `plain` takes the signs for that away.
    """

    sentences: tuple[tuple[Statement, ...], ...]
    rows: tuple[tuple[str, str, str], ...]

    @property
    def statements(self) -> tuple[str, ...]:
        """The three statements."""
        return tuple(" ".join(map(str, sentences)) for sentences in self.sentences)

    @property
    def codes(self) -> tuple[tuple[StatementCode, ...], ...]:
        """What each sentence of the statements is about."""
        return tuple(tuple(one.code for one in sentences) for sentences in self.sentences)


def answer(analysis: Analysis) -> Answer:
    """Answer from the tables of an analysis."""
    second = [*compared(analysis), *criterion_sentences(analysis), *alarm_sentences(analysis)]
    return Answer(
        sentences=((*_thresholds(analysis),), (*second,), (*_left_out(analysis),)),
        rows=(
            *_threshold_rows(analysis),
            *_population_rows(analysis),
            *difference_rows(
                analysis, settled=settled(analysis), either_side=bool(hit_words(analysis))
            ),
            *blank_rows(analysis),
            *_spread_rows(analysis),
            *left_out_rows(analysis),
        ),
    )


def _where(analysis: Analysis, condition: object, before: str = " in") -> str:
    # Totals of blank trials have no condition where those of one condition count alone.
    if analysis.counts.conditions == 1 or condition is None:
        return ""
    return f"{before} condition {isolated(condition)}"


def _people(analysis: Analysis, number: int) -> str:
    return number_of(number, f"{_kind(analysis)}participant")


def _kind(analysis: Analysis) -> str:
    if not analysis.counts.simulated:
        return ""
    all_are = analysis.counts.simulated == analysis.counts.trials
    return "simulated " if all_are else "simulated or real "


def _one(analysis: Analysis, condition: str) -> pd.Series[Any]:
    """Return the threshold of a condition's only participant."""
    return _people_in(analysis, condition).iloc[0]


def _people_in(analysis: Analysis, *conditions: str) -> pd.DataFrame:
    """Return the thresholds of the people in some conditions."""
    return analysis.thresholds[analysis.thresholds["condition"].isin(conditions)]


def _session(analysis: Analysis, participant: str, condition: str) -> str:
    trials = analysis.trials
    own = trials[trials["participant"].eq(participant) & trials["condition"].eq(condition)]
    number = own["session"].nunique()
    return f"these {number} sessions" if number > 1 else "this session"


def _predicate(row: pd.Series[Any], in_db: str = "") -> str:
    """Say a threshold as it is printed, with what its interval is, and how wide that is `in_db`.

    >>> import pandas as pd
    >>> rows = [("ok", "71.1 V (< 60 to 88.2)"), ("median_below_levels", "at most 68.2 V (95 %)"),
    ...     ("threshold_above_levels", "> 200 V"), ("flat", "no threshold: it does not rise")]
    >>> for status, printed in rows:
    ...     print(_predicate(pd.Series({"status": status, "printed": printed})))
    is 71.1 V (posterior median, 95 % interval below 60 to 88.2)
    is at most 68.2 V (end of the 95 % interval)
    is above the highest level, 200 V (97.5 % sure)
    cannot be told: it does not rise
    """
    printed = _threshold_words(row)
    if row["status"] in WITH_THRESHOLD:
        told = printed.replace("(", _MEDIAN, 1).replace("< ", "below ").replace("> ", "above ")
        told = told.replace(")", f", {in_db})", 1) if in_db else told
        return f"is {told}"
    for sign, words in (("< ", "below the lowest"), ("> ", "above the highest")):
        if printed.startswith(sign):
            return f"is {words} level, {printed.removeprefix(sign)} (97.5 % sure)"
    if printed.startswith("no threshold: "):
        return f"cannot be told: {printed.removeprefix('no threshold: ')}"
    return f"is {printed}".replace("(95 %)", "(end of the 95 % interval)")


def _threshold_words(row: pd.Series[Any]) -> str:
    """Return a threshold as printed; how people differ stands in a row of its own."""
    return str(row["printed"]).partition("; between people")[0]


def _in_db(analysis: Analysis, group: pd.Series[Any]) -> str:
    """Say how wide the interval of a group's threshold is, as a goal of `power` does."""
    if group["status"] not in WITH_THRESHOLD:
        return ""
    ends = (float(group[f"threshold_{name}_vpp"]) for name in ("low", "high"))
    width = analysis.axis.half_width(*ends)
    return width and f"half-width {width}"


def _thresholds(analysis: Analysis) -> Iterator[Statement]:
    groups = analysis.groups
    if groups.empty:
        text = "there is no threshold, for no trial with a single stimulus counts"
        yield Statement(StatementCode.THRESHOLD_MISSING, text)
    elif len(groups) > SPELLED:
        text = f"the thresholds of {len(groups)} conditions stand in the table"
        yield Statement(StatementCode.THRESHOLDS_IN_TABLE, text)
    told_of: tuple[str, set[str]] = "", set()
    seen: set[str] = set()
    for _, group in groups.iterrows() if len(groups) <= SPELLED else ():
        condition, number = str(group["condition"]), int(group["participants"])
        alone = number == 1
        row = _one(analysis, condition) if alone else group
        names = _names(analysis, condition)
        other = told_of[0] and not alone and not names & seen
        who = f"{'another' if other else 'the'} group of {_people(analysis, number)}"
        if alone:
            who = f"{_kind(analysis)}participant {isolated(row['participant'])}"
        subject = "it" if (who, names) == told_of else f"the threshold of {who}"
        when = f" in {_session(analysis, row['participant'], condition)}" if alone else ""
        width = "" if alone else _in_db(analysis, group)
        told = (
            f"{_predicate(row, width)}{when}{in_micrometres(row, _people_in(analysis, condition))}"
        )
        text = f"{_where(analysis, condition, 'in')} {subject} {told}".lstrip()
        yield Statement(StatementCode.THRESHOLD, text)
        told_of = who, names
        seen |= names
    yield from _silent(analysis)
    yield from _doubted(analysis)
    yield from _remarks(analysis)


def _silent(analysis: Analysis) -> Iterator[Statement]:
    """Name the conditions without a threshold, for nobody answered there."""
    trials, told = analysis.trials, {*analysis.groups["condition"]}
    silent = trials.loc[trials["reason"].eq(NEVER_ANSWERED), "condition"].unique()
    without = [str(name) for name in sorted({*silent} - told)] if told else []
    if without:
        which = "conditions" if len(without) > 1 else "condition"
        text = f"there is no threshold in {which} {and_words(without)}, where nobody answered"
        yield Statement(StatementCode.CONDITION_NEVER_ANSWERED, text)


def _names(analysis: Analysis, condition: str) -> set[str]:
    table = analysis.thresholds
    return {*table.loc[table["condition"].eq(condition), "participant"]}


def _doubted(analysis: Analysis) -> Iterator[Statement]:
    """Name those in a threshold whose answers a warning doubts."""
    for _, group in analysis.groups.iterrows():
        condition = str(group["condition"])
        here = _names(analysis, condition)
        for kind, (code, words) in _DOUBTS.items():
            names = [
                one.participant
                for one in analysis.doubts
                if one.kind == kind and one.participant in here and one.condition in ("", condition)
            ]
            if not names or not _is_told(analysis, group):
                continue
            count = "counts" if len(names) == 1 else "count"
            who = f"participant{'s' * (len(names) > 1)} {and_words(names)}"
            if len(names) > SPELLED:
                who = f"{len(names)} participants"
            where = _where(analysis, condition)
            text = f"{who} {count}{where}, though their {words} (see the warnings)"
            yield Statement(code, text)
            told = _unswapped(analysis, condition) if kind == SWAPPED else None
            if told is not None:
                them = who if len(names) <= SPELLED else "them"
                said = _predicate(told, _in_db(analysis, told))
                text = f"without {them} the threshold of the group{where} {said}"
                yield Statement(StatementCode.THRESHOLD_WITHOUT_REVERSED, text)


def _unswapped(analysis: Analysis, condition: str) -> pd.Series[Any] | None:
    """Return the group of a condition without people whose sides look swapped, if there is one."""
    table = analysis.unswapped
    if table is None:
        return None
    rows = table[table["condition"].eq(condition) & table["participants"].gt(1)]
    return None if rows.empty else rows.iloc[0]


def _is_told(analysis: Analysis, group: pd.Series[Any]) -> bool:
    """Whether a threshold of the group, or of who is alone in it, or a bound of it is told."""
    row = _one(analysis, str(group["condition"])) if group["participants"] == 1 else group
    return not all(math.isnan(row[f"threshold_{name}vpp"]) for name in ("", "low_", "high_"))


def _remarks(analysis: Analysis) -> Iterator[Statement]:
    """Say what the thresholds that were told rest on."""
    told = [group for _, group in analysis.groups.iterrows() if _is_told(analysis, group)]
    conditions = [group["condition"] for group in told]
    people = _people_in(analysis, *conditions)
    if people["guess_basis"].eq("assumed").any():
        text = "thresholds rest on an assumed guess rate, for want of blank trials"
        yield Statement(StatementCode.GUESS_RATE_ASSUMED, text)
    if any(group["participants"] == 1 for group in told):
        text = "a participant's interval is for that session, another day may bring another"
        yield Statement(StatementCode.ONE_SESSION, text)
    spread = [group for group in told if not math.isnan(group["spread_db"])]
    few = [str(group["condition"]) for group in spread if group["participants"] < FEW]
    if few:
        which = "conditions" if len(few) > 1 else "condition"
        where = f" in {which} {and_words(few)}" if len(few) < len(analysis.groups) else ""
        text = (
            f"with fewer than five participants{where} it is mostly the prior that says how much "
            "people differ"
        )
        yield Statement(StatementCode.FEW_PARTICIPANTS, text)


def _threshold_rows(analysis: Analysis) -> Iterator[tuple[str, str, str]]:
    given = "one stimulus" if analysis.counts.both else "a stimulus"
    for _, group in analysis.groups.iterrows():
        condition, number = str(group["condition"]), int(group["participants"])
        people, where = _people_in(analysis, condition), _where(analysis, condition, ",")
        row, name, of = group, "Threshold of the group", _people(analysis, number)
        if number == 1:
            row = _one(analysis, condition)
            name = f"Threshold of participant {isolated(row['participant'])}"
            of = _session(analysis, row["participant"], condition)
        elif number > 1:
            of += _beyond(people)
        trials = number_of(int(people["trials"].sum()), "trial")
        yield f"{name}{where}", _threshold_words(row), f"{of}, {trials} with {given}"
        yield from micrometres_row(row, people, where)
        without = _unswapped(analysis, condition)
        if number > 1 and without is not None and without["participants"] < number:
            name = f"The same without swapped sides{where}"
            yield name, _threshold_words(without), _people(analysis, int(without["participants"]))
        yield from _fitting_row(analysis, condition, number)
        if number == 1 and isinstance(row["varied_printed"], str):
            name = f"The same if answers vary 2.8 times{where}"
            yield name, row["varied_printed"], "a sensitivity, not from these data"


def _beyond(people: pd.DataFrame) -> str:
    """Say how many people's own thresholds lie beyond the levels; empty text if none does.

    >>> import pandas as pd
    >>> print(_beyond(pd.DataFrame({"status": ["ok", "median_above_levels", "flat"]})))
    , 1 of them above the levels
    """
    told = [
        f"{number} of them {side} the levels"
        for side in ("above", "below")
        if (number := int(people["status"].str.endswith(f"_{side}_levels").sum()))
    ]
    return f", {' and '.join(told)}" if told else ""


def _fitting_row(analysis: Analysis, condition: str, number: int) -> Iterator[tuple[str, str, str]]:
    """Yield the group's threshold without misfits and drifts, if there are any."""
    table = None if analysis.fitting is None else analysis.fitting.groups
    if table is None or analysis.fitting is None:
        return
    for _, row in table[table["condition"].eq(condition)].iterrows():
        if 1 < (left := int(row["participants"])) < number:
            name = f"The same {without_words(analysis.fitting)}{_where(analysis, condition, ',')}"
            yield (
                name,
                _threshold_words(row),
                f"{_people(analysis, left)} {fitting_words(analysis)}",
            )


def _population_rows(analysis: Analysis) -> Iterator[tuple[str, str, str]]:
    """Yield the threshold by the other model that was asked for, or that there is none, and why."""
    for one in analysis.population:
        name = f"Threshold of the population{_where(analysis, one.condition, ',')}"
        told = population_text(one, analysis.axis)
        yield name, told or "not fitted", one.reason or "another model, a logistic one"


def _spread_rows(analysis: Analysis) -> Iterator[tuple[str, str, str]]:
    told = analysis.groups[analysis.groups["spread_db"].astype(float).notna()]
    new = [_new_person(group, analysis) for _, group in told.iterrows()]
    spreads = alike([spread_of(low, at, high, levels) for at, low, high, levels in new])
    for one, spread, (_, group) in zip(new, spreads, told.iterrows(), strict=True):
        where = _where(analysis, group["condition"], ",")
        number = int(group["participants"])
        of = "mostly its prior" if number < FEW else _people(analysis, number)
        yield f"Spread of participants (SD){where}", _spread(group, analysis), of
        at, low, high, levels = one
        words = with_limits(at, low, high, analysis.axis.unit, levels, spread=spread)
        yield f"Another participant's threshold{where}", words, "group and spread"


def _spread(group: pd.Series[Any], analysis: Analysis) -> str:
    at, low, high = (float(group[f"spread_{name}db"]) for name in ("", "low_", "high_"))
    told = [rounded(value, high - low) for value in (at, low, high)]
    unit = "dB" if analysis.axis.is_logarithmic else analysis.axis.unit
    return f"{told[0]} {unit} ({told[1]} to {told[2]})"


def _new_person(
    group: pd.Series[Any], analysis: Analysis
) -> tuple[float, float, float, list[float]]:
    """Return the group's threshold, between what another person's is expected, and the levels."""
    of_levels = analysis.levels
    levels = of_levels.loc[of_levels["condition"].eq(group["condition"]), "level_vpp"].tolist()
    at, low, high = (float(group[f"{name}_vpp"]) for name in ("threshold", "new_low", "new_high"))
    ends = -math.inf if math.isnan(low) else low, math.inf if math.isnan(high) else high
    return at, *ends, levels


def _left_out(analysis: Analysis) -> Iterator[Statement]:
    trials = analysis.trials
    yield Statement(StatementCode.LEFT_OUT, left_out_words(analysis))
    if unread := unread_words(analysis):
        yield Statement(StatementCode.LEFT_OUT_BY_MAP, f"the map leaves out {unread} more")
    without = uncounted(trials) if len(trials) else []
    if without:
        names = ", ".join(map(isolated, without))
        text = f"nothing counts of {number_of(len(without), 'participant')}: {names}"
        yield Statement(StatementCode.PARTICIPANTS_NOT_COUNTED, text)
    if analysis.lost:
        text = f"{number_of(len(analysis.lost), 'session')}, lost after recording, took no part"
        yield Statement(StatementCode.SESSIONS_LOST, text)
    if steep := steep_words(analysis.thresholds):
        yield Statement(StatementCode.FUNCTIONS_STEEP, steep)
    if lapses := lapses_words(analysis.thresholds):
        many = at_bound_often(analysis.thresholds)
        text = f"{lapses}, {LAPSES_MANY if many else LAPSES_OFTEN}"
        yield Statement(StatementCode.LAPSES_AT_BOUND, text)
    if analysis.warnings:
        text = f"see {number_of(len(analysis.warnings), 'warning')} below"
        yield Statement(StatementCode.WARNINGS, text)
