"""What the reader of a result should look at: each warning as its code and its data."""

from __future__ import annotations

import math
from collections import Counter
from itertools import chain, permutations
from typing import TYPE_CHECKING, Any, Final

import pandas as pd

from analysis.codes import WarningCode
from analysis.counts import table
from analysis.numbers import TOTAL
from analysis.reading.trials import NEVER_ANSWERED
from analysis.results.findings import ALPHA, records, sides_that_differ
from analysis.results.rendering import warning
from analysis.thresholds.displacement import site_columns
from analysis.thresholds.fit import WITH_THRESHOLD
from experiment.names import NOT_AVAILABLE
from experiment.perception.gains import UNEQUAL_DB
from experiment.trial.plan import HANDS_OFF, PRACTICE

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import TypeAlias

    from analysis.codes import AnalysisWarning
    from analysis.results.analysis import Analysis

    Check: TypeAlias = tuple[bool, WarningCode, dict[str, Any]]
    """Whether there is reason to warn, and of what: the code of the warning and its data."""


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
_SESSION: Final = ["participant", "session"]


def find_warnings(analysis: Analysis) -> Iterator[AnalysisWarning]:
    """Yield what the reader of a result should look at, in the order of `WarningCode`."""
    checks = chain(
        ((True, *each) for each in (*analysis.loaded.warnings, *analysis.checks)),
        _check_sessions(analysis),
        _check_trials(analysis),
        _check_origins(analysis),
        _check_answers(analysis),
        _check_functions(analysis),
        _check_sides(analysis),
        _check_conditions(analysis),
    )
    scoring = analysis.scoring
    warnings = [warning(code, scoring, **data) for is_found, code, data in checks if is_found]
    order = [*WarningCode]
    yield from sorted(warnings, key=lambda each: order.index(each.code))


def _check_sessions(analysis: Analysis) -> Iterator[Check]:
    """Check whether sessions lack trials."""
    loaded = analysis.loaded
    for folder, remedy in loaded.without_table.items():
        yield True, WarningCode.SESSION_WITHOUT_TABLE, {"folder": folder, "remedy": remedy}
    for session in loaded.progress:
        names = {"participant": session.plan.participant, "session": session.plan.session}
        is_short = session.valid < session.planned
        counts = {"valid": session.valid, "planned": session.planned}
        yield is_short, WarningCode.PLANNED_TRIALS_MISSING, names | counts
        counts = {"number": session.unexported}
        yield session.unexported > 0, WarningCode.TRIALS_NOT_EXPORTED, names | counts
    trials = loaded.trials[loaded.trials["kind"].isin(table.COUNTED_KINDS)]
    trials = trials.astype({"condition": str, "participant": str, "session": str})
    planned = [(each.plan.participant, each.plan.session) for each in loaded.progress]
    trials = trials[~pd.MultiIndex.from_frame(trials[_SESSION]).isin(planned)]
    is_valid = trials["status"].eq("ok").groupby([trials[n] for n in (*_SESSION, "trial")]).any()
    missing = is_valid[~is_valid].groupby(level=_SESSION).size()
    for row in records(missing.reset_index(name="number")):
        yield True, WarningCode.VALID_ATTEMPT_MISSING, row
    numbers = trials.groupby(["condition", *_SESSION]).size()
    for condition, per_session in numbers.groupby(level="condition"):
        usual = int(per_session.mode().max())
        alike = int(per_session.eq(usual).sum())
        fewer = per_session[per_session.lt(_NEARLY_ALL * usual)].groupby("participant").min()
        is_odd = 0 < len(fewer) <= _MAX_SHARE * len(per_session) and alike >= _MIN_ALIKE
        data = {
            "trials": fewer.to_dict(),
            "condition": _name(condition, analysis),
            "usual": usual,
            "alike": alike,
            "sessions": len(per_session),
        }
        yield is_odd, WarningCode.FEWER_TRIALS_THAN_OTHERS, data


def _name(condition: object, analysis: Analysis) -> str:
    """Return the name of a condition where there are several."""
    return str(condition) if analysis.counts.conditions > 1 else ""


def _check_trials(analysis: Analysis) -> Iterator[Check]:
    """Check what is left out, and whether trials of everybody and single stimuli count."""
    rows = analysis.excluded[~analysis.excluded["reason"].isin(_EXPECTED)]
    reasons = rows.groupby("reason")["trials"].sum().to_dict()
    data = {"number": int(rows["trials"].sum()), "reasons": reasons}
    yield len(rows) > 0, WarningCode.TRIALS_LEFT_OUT, data
    names = table.uncounted(analysis.trials)
    yield bool(names), WarningCode.PARTICIPANT_NOT_COUNTED, {"participants": names}
    yield analysis.counts.single == 0, WarningCode.SINGLE_STIMULI_MISSING, {}


def _check_origins(analysis: Analysis) -> Iterator[Check]:
    """Check whether sessions are modified, lost, or not of the same kind as the others."""
    loaded, counts = analysis.loaded, analysis.counts
    plans = [session.plan for session in loaded.progress]
    of_plan = {(plan.participant, plan.session): plan.file_sha256 for plan in plans}
    hashes = analysis.trials[[*_SESSION, "study_sha256"]].drop_duplicates()
    # Levels placed for a participant make no other study, by its plan.
    studies = {
        of_plan.get((participant, session), study)
        for participant, session, study in hashes.itertuples(index=False)
        if study != NOT_AVAILABLE
    }
    yield len(studies) > 1, WarningCode.SEVERAL_STUDIES, {"number": len(studies)}
    for text in chain.from_iterable(loaded.altered.values()):
        yield True, WarningCode.SESSION_MODIFIED, {"difference": text}
    for session, texts in loaded.lost.items():
        for text in texts:
            yield True, WarningCode.SESSION_LOST, {"session": session, "difference": text}
    numbers = {"number": counts.without_device, "trials": counts.trials}
    yield counts.without_device > 0, WarningCode.PRACTICE_WITHOUT_DEVICE, numbers
    is_mixed = 0 < counts.simulated < counts.trials
    numbers = {"number": counts.simulated, "trials": counts.trials}
    yield is_mixed, WarningCode.SIMULATED_AND_REAL, numbers
    kinds = [sorted({rule.kind for rule in plan.level_rules.values()}) for plan in plans]
    rules = Counter(kind for each in kinds for kind in each)
    constant = sum(not each for each in kinds)
    yield bool(rules), WarningCode.LEVELS_CHOSEN, {"rules": dict(rules), "constant": constant}
    contacts = analysis.contacts
    yield len(contacts) > 1, WarningCode.CONTACT_DIFFERS, {"contacts": contacts}


def _check_answers(analysis: Analysis) -> Iterator[Check]:
    """Check whether everybody answered, and could answer "none"."""
    trials = analysis.trials
    silent = trials[trials["reason"].eq(NEVER_ANSWERED)].astype({"condition": object})
    number = silent.groupby(["participant", "condition"], observed=True).size()
    for row in records(number.reset_index(name="number")):
        names = {"condition": _name(row["condition"], analysis)}
        yield True, WarningCode.ANSWERS_MISSING, row | names
    counted = trials[trials["reason"].eq("")]
    offered = counted["none_offered"].fillna(value=False).astype(bool)
    numbers = {"number": int(offered.sum()), "trials": len(offered)}
    yield 0 < offered.sum() < len(offered), WarningCode.NONE_OFFERED_IN_PART, numbers
    yield not offered[counted["kind"].eq("blank")].all(), WarningCode.BLANKS_WITHOUT_NONE, {}


def _check_functions(analysis: Analysis) -> Iterator[Check]:
    """Check whether functions do not fit or rise in one step, and whether lapses are many."""
    thresholds = analysis.thresholds
    fitted = thresholds[thresholds["status"].isin(WITH_THRESHOLD)]
    tested = thresholds["deviance_p"].count()
    misfits = misfits_of(thresholds)
    steep, at_bound = (fitted[fitted["status"].eq(n)] for n in ("separated", "lapse_at_bound"))
    are_many = len(fitted) >= MIN_FUNCTIONS and len(at_bound) >= MIN_MANY_LAPSES * len(fitted)
    numbers = {"tested": tested, "limit": MISFIT_P, "expected": MISFIT_P * tested}
    of_fitted = {"fitted": len(fitted)}
    for is_found, code, rows, data in (
        (len(misfits) > 0, WarningCode.FUNCTION_MISFIT, misfits, numbers),
        (len(steep) > 0, WarningCode.FUNCTIONS_STEEP, steep, of_fitted),
        (are_many, WarningCode.LAPSES_AT_BOUND, at_bound, of_fitted),
    ):
        functions = [
            {
                "participant": row["participant"],
                "condition": _name(row["condition"], analysis),
                "p": None if math.isnan(row["deviance_p"]) else row["deviance_p"],
            }
            for row in records(rows)
        ]
        yield is_found, code, {"functions": functions, **data}


def misfits_of(thresholds: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of functions that do not fit, the worst first."""
    rows = thresholds[thresholds["deviance_p"].lt(MISFIT_P)]
    return rows.sort_values(["deviance_p", "participant"])


def _check_sides(analysis: Analysis) -> Iterator[Check]:
    """Check whether sides differ in detection, or in displacement per volt."""
    for row in sides_that_differ(analysis):
        names = {"condition": _name(row["condition"], analysis)}
        yield True, WarningCode.SIDES_DIFFER, row | names
    columns = site_columns(analysis.thresholds)
    thresholds_um = analysis.thresholds[[*columns.values()]].astype(float)
    for more, less in permutations(columns, 2):
        ratios = (thresholds_um[columns[more]] / thresholds_um[columns[less]]).dropna()
        apart_db = ratios.map(lambda ratio: 20 * math.log10(ratio))
        larger = apart_db[apart_db.ge(UNEQUAL_DB)]
        data = {"more": more, "less": less, "db": larger.max()}
        data["every"] = len(larger) == len(apart_db)
        yield len(larger) > 0, WarningCode.SIDES_UNEQUAL, data


def _check_conditions(analysis: Analysis) -> Iterator[Check]:
    """Check whether conditions can be compared without a second thought."""
    for (a, b), pair in analysis.differences.groupby(["condition_a", "condition_b"], sort=False):
        people, total = pair[pair["participant"].ne(TOTAL)], pair.iloc[-1]
        names, p = {"a": a, "b": b}, total["false_alarm_p"]
        rates = [
            total[f"false_alarms_{name}"] / (total[f"blanks_{name}"] or math.nan) for name in "ab"
        ]
        tested = {"p": p, "lower": a if rates[0] < rates[1] else b, "same_people": len(people) > 0}
        yield p < ALPHA, WarningCode.FALSE_ALARMS_DIFFER, names | tested
        first = {*people["first"]}
        is_alike = len(people) > 1 and len(first) == 1 and first <= {a, b}
        data = {"first": next(iter(first), ""), "participants": len(people)}
        yield is_alike, WarningCode.CONDITION_ALWAYS_FIRST, names | data
