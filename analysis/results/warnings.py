"""What the reader of a result should look at: each warning as its code and its data."""

from __future__ import annotations

import math
from itertools import chain, permutations
from typing import TYPE_CHECKING, Any, Final

import pandas as pd

from analysis.codes import AnalysisWarning, WarningCode
from analysis.counts import table
from analysis.counts.checks import AT_CHANCE, DRIFT, REVERSED
from analysis.numbers import TOTAL
from analysis.reading.trials import NEVER_ANSWERED
from analysis.results.findings import ALPHA, records, sides_that_differ
from analysis.results.rendering import warning
from analysis.thresholds.displacement import SITE_COLUMNS
from analysis.thresholds.fit import WITH_THRESHOLD
from experiment.perception.gains import UNEQUAL_DB
from experiment.rows import HANDS_OFF, NOT_AVAILABLE, PRACTICE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analysis.results.analysis import Analysis

    Rows = Sequence[Mapping[str, Any]]


MISFIT_P: Final = 0.01
"""A function whose bootstrap has a smaller p does not fit.

Every such function is named, with the number that chance would bring: a correction for the number
of functions would hide a bad fit among many participants.
"""
MIN_MANY_LAPSES, MIN_FUNCTIONS = 0.2, 5
"""The share of lapse rates at their limit, of at least so many functions, that is warned of."""
# Left out as planned, or presented again: nothing to warn of.
_EXPECTED: Final = (PRACTICE, HANDS_OFF, "voided")
# A participant who broke off has fewer than nine tenths of the trials that at least three others
# have; where more than a quarter of the participants have fewer, it may be a design.
_NEARLY_ALL, _MIN_ALIKE, _MAX_SHARE = 0.9, 3, 0.25
_CHECKS: Final = {
    REVERSED: WarningCode.RESPONSES_REVERSED,
    AT_CHANCE: WarningCode.GUESSING,
    DRIFT: WarningCode.THRESHOLD_DRIFTS,
}
_SESSION: Final = ["participant", "session"]


def find_warnings(analysis: Analysis) -> Iterator[AnalysisWarning]:
    """Yield the warnings about an analysis, those of the data before those of the results."""
    yield from analysis.loaded.changed
    for code, rows in chain(
        _about_sessions(analysis),
        _about_trials(analysis),
        _about_origins(analysis),
        _about_answers(analysis),
    ):
        yield from (warning(code, **row) for row in rows)
    for check in analysis.checks:
        data = {"participant": check.participant, "condition": check.condition}
        yield AnalysisWarning(_CHECKS[check.kind], str(check), data)
    for code, rows in chain(
        _about_functions(analysis), _about_sides(analysis), _about_conditions(analysis)
    ):
        yield from (warning(code, **row) for row in rows)


def _about_sessions(analysis: Analysis) -> Iterator[tuple[WarningCode, Rows]]:
    """Yield which sessions lack trials."""
    loaded = analysis.loaded
    remedies = loaded.without_table.items()
    yield (
        WarningCode.SESSION_WITHOUT_TABLE,
        [{"folder": folder, "remedy": remedy} for folder, remedy in remedies],
    )
    for session in loaded.progress:
        names = {"participant": session.participant, "session": session.session}
        counts = {"valid": session.valid, "planned": session.planned}
        is_short, is_late = session.valid < session.planned, session.unexported > 0
        yield WarningCode.PLANNED_TRIALS_MISSING, [names | counts] * is_short
        yield WarningCode.TRIALS_NOT_EXPORTED, [names | {"number": session.unexported}] * is_late
    trials = loaded.trials[loaded.trials["kind"].isin(table.COUNTED_KINDS)]
    trials = trials.astype({"condition": str, "participant": str, "session": str})
    planned = [(session.participant, session.session) for session in loaded.progress]
    trials = trials[~pd.MultiIndex.from_frame(trials[_SESSION]).isin(planned)]
    is_valid = trials["status"].eq("ok").groupby([trials[n] for n in (*_SESSION, "trial")]).any()
    missing = is_valid[~is_valid].groupby(level=_SESSION).size()
    yield WarningCode.VALID_ATTEMPT_MISSING, records(missing.reset_index(name="number"))
    numbers = trials.groupby(["condition", *_SESSION]).size()
    for condition, per_session in numbers.groupby(level="condition"):
        usual = int(per_session.mode().max())
        alike = int(per_session.eq(usual).sum())
        fewer = per_session[per_session.lt(_NEARLY_ALL * usual)].groupby("participant").min()
        is_odd = 0 < len(fewer) <= _MAX_SHARE * len(per_session) and alike >= _MIN_ALIKE
        data: dict[str, Any] = {"trials": fewer.to_dict(), "condition": _name(condition, analysis)}
        data |= {"usual": usual, "alike": alike, "sessions": len(per_session)}
        yield WarningCode.FEWER_TRIALS_THAN_OTHERS, [data] * is_odd


def _name(condition: object, analysis: Analysis) -> str:
    """Return the name of a condition where there are several."""
    return str(condition) if analysis.counts.conditions > 1 else ""


def _about_trials(analysis: Analysis) -> Iterator[tuple[WarningCode, Rows]]:
    """Yield what is left out, and whose trials and which stimuli none count."""
    rows = analysis.excluded[~analysis.excluded["reason"].isin(_EXPECTED)]
    reasons = {"reasons": rows.groupby("reason")["trials"].sum().to_dict()}
    number = int(rows["trials"].sum())
    yield WarningCode.TRIALS_LEFT_OUT, [reasons | {"number": number}] * (number > 0)
    names = table.uncounted(analysis.trials)
    yield WarningCode.PARTICIPANT_NOT_COUNTED, [{"participants": names}] * bool(names)
    yield WarningCode.SINGLE_STIMULI_MISSING, [{}] * (analysis.counts.single == 0)


def _about_origins(analysis: Analysis) -> Iterator[tuple[WarningCode, Rows]]:
    """Yield which sessions are modified, lost, or not of the same kind as the others."""
    loaded, counts = analysis.loaded, analysis.counts
    of_plan = {(one.participant, one.session): one.file_sha256 for one in loaded.progress}
    hashes = analysis.trials[[*_SESSION, "study_sha256"]].drop_duplicates()
    # Levels placed for a participant make no other study, by its plan.
    studies = {
        of_plan.get((participant, session), study)
        for participant, session, study in hashes.itertuples(index=False)
        if study != NOT_AVAILABLE
    }
    yield WarningCode.SEVERAL_STUDIES, [{"number": len(studies)}] * (len(studies) > 1)
    modified = [{"difference": text} for texts in loaded.altered.values() for text in texts]
    yield WarningCode.SESSION_MODIFIED, modified
    lost = [
        {"session": session, "difference": text}
        for session, texts in loaded.lost.items()
        for text in texts
    ]
    yield WarningCode.SESSION_LOST, lost
    is_mixed = 0 < counts.simulated < counts.trials
    for code, number, is_shown in (
        (WarningCode.PRACTICE_WITHOUT_DEVICE, counts.without_device, counts.without_device > 0),
        (WarningCode.SIMULATED_AND_REAL, counts.simulated, is_mixed),
    ):
        yield code, [{"number": number, "trials": counts.trials}] * is_shown
    contacts = analysis.contacts
    yield WarningCode.CONTACT_DIFFERS, [{"contacts": contacts}] * (len(contacts) > 1)


def _about_answers(analysis: Analysis) -> Iterator[tuple[WarningCode, Rows]]:
    """Yield who never answered, and where the answer "none" was not offered."""
    trials = analysis.trials
    silent = trials[trials["reason"].eq(NEVER_ANSWERED)].astype({"condition": object})
    groups = silent.groupby(["participant", "condition"], observed=True).size()
    rows = records(groups.reset_index(name="number"))
    names = [row | {"condition": _name(row["condition"], analysis)} for row in rows]
    yield WarningCode.ANSWERS_MISSING, names
    counted = trials[trials["reason"].eq("")]
    offered = counted["none_offered"].fillna(value=False)
    is_partly = offered.any() and not offered.all()
    numbers = {"number": int(offered.sum()), "trials": len(offered)}
    yield WarningCode.NONE_OFFERED_IN_PART, [numbers] * bool(is_partly)
    is_certain = not offered[counted["kind"].eq("blank")].all()
    yield WarningCode.BLANKS_WITHOUT_NONE, [{}] * is_certain


def _about_functions(analysis: Analysis) -> Iterator[tuple[WarningCode, Rows]]:
    """Yield functions that do not fit, that rise in one step, and many lapses."""
    thresholds = analysis.thresholds
    fitted = thresholds[thresholds["status"].isin(WITH_THRESHOLD)]
    tested = thresholds["deviance_p"].count()
    steep, at_bound = (fitted[fitted["status"].eq(n)] for n in ("separated", "lapse_at_bound"))
    if len(fitted) < MIN_FUNCTIONS or len(at_bound) < MIN_MANY_LAPSES * len(fitted):
        at_bound = at_bound[:0]
    numbers = {"tested": tested, "limit": MISFIT_P, "expected": MISFIT_P * tested}
    for code, rows, more in (
        (WarningCode.FUNCTION_MISFIT, misfits_of(thresholds), numbers),
        (WarningCode.FUNCTIONS_STEEP, steep, {"fitted": len(fitted)}),
        (WarningCode.LAPSES_AT_BOUND, at_bound, {"fitted": len(fitted)}),
    ):
        functions = [
            {
                "participant": row["participant"],
                "condition": _name(row["condition"], analysis),
                "p": None if math.isnan(row["deviance_p"]) else row["deviance_p"],
            }
            for row in records(rows)
        ]
        yield code, [{"functions": functions} | more] * bool(functions)


def misfits_of(thresholds: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of functions that do not fit, the worst first."""
    rows = thresholds[thresholds["deviance_p"].lt(MISFIT_P)]
    return rows.sort_values(["deviance_p", "participant"])


def _about_sides(analysis: Analysis) -> Iterator[tuple[WarningCode, Rows]]:
    """Yield where sides differ in detection, or in displacement per volt."""
    names = [
        row | {"condition": _name(row["condition"], analysis)}
        for row in sides_that_differ(analysis)
    ]
    yield WarningCode.SIDES_DIFFER, names
    columns = analysis.thresholds.reindex(columns=[*SITE_COLUMNS.values()]).astype(float)
    for more, less in permutations(SITE_COLUMNS, 2):
        ratios = (columns[SITE_COLUMNS[more]] / columns[SITE_COLUMNS[less]]).dropna()
        apart_db = [20 * math.log10(ratio) for ratio in ratios]
        larger = [db for db in apart_db if db >= UNEQUAL_DB]
        data = {"more": more, "less": less, "db": max(larger, default=0.0)}
        every = {"every": len(larger) == len(apart_db)}
        yield WarningCode.SIDES_UNEQUAL, [data | every] * bool(larger)


def _about_conditions(analysis: Analysis) -> Iterator[tuple[WarningCode, Rows]]:
    """Yield the conditions that cannot be compared without a second thought."""
    for (a, b), pair in analysis.differences.groupby(["condition_a", "condition_b"], sort=False):
        people, total = pair[pair["participant"].ne(TOTAL)], pair.iloc[-1]
        names, p = {"a": a, "b": b}, total["false_alarm_p"]
        rates = [
            total[f"false_alarms_{name}"] / (total[f"blanks_{name}"] or math.nan) for name in "ab"
        ]
        tested = {"p": p, "lower": a if rates[0] < rates[1] else b, "same_people": len(people) > 0}
        yield WarningCode.FALSE_ALARMS_DIFFER, [names | tested] * bool(p < ALPHA)
        first = {*people["first"]}
        is_alike = len(people) > 1 and len(first) == 1 and first <= {a, b}
        data = {"first": next(iter(first), ""), "participants": len(people)}
        yield WarningCode.CONDITION_ALWAYS_FIRST, [names | data] * is_alike
