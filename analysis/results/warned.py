"""What a reader of an analysis is warned of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import pandas as pd

from analysis.answers import counting
from analysis.answers.doubts import DRIFTING, GUESSING, SWAPPED, doubtful, doubtful_counts
from analysis.codes import AnalysisWarning, WarningCode, with_code
from analysis.groups.micrometres import unequal_sides
from analysis.reading.counts import without_device
from analysis.reading.reasons import NEVER_ANSWERED
from analysis.reading.text import named
from analysis.results.methods.misfit import misfits
from analysis.results.methods.words import SPELLED
from experiment.rows import HANDS_OFF, PRACTICE

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from analysis.answers.doubts import Doubt
    from analysis.reading.load import LoadedTrials
    from analysis.thresholds.people import PersonCounts


# Left out as planned, or presented again: nothing to warn of.
_EXPECTED = (PRACTICE, HANDS_OFF, "voided")
_NO_STUDY = "n/a"
_NEARLY: Final = 0.9
_SEVERAL: Final = 3
_FEW_OF_ALL: Final = 0.25
_DOUBTS: Final = {
    SWAPPED: WarningCode.RESPONSES_REVERSED,
    GUESSING: WarningCode.GUESSING,
    DRIFTING: WarningCode.THRESHOLD_DRIFTS,
}


def warnings_of(
    loaded: LoadedTrials,
    excluded: pd.DataFrame,
    stated: Mapping[str, tuple[str, ...]],
    *,
    doubts: Iterable[Doubt],
    people: PersonCounts,
    fits: pd.DataFrame,
) -> Iterator[AnalysisWarning]:
    """Yield a warning for everything about trials that a reader has to be told.

    `excluded` is what is left out, `stated` how the fingers lay, in words and by session,
    `doubts` are `doubts_of` the same, and `fits` the thresholds that were fitted to `people`.
    """
    trials = loaded.trials
    counted = trials[trials["reason"].eq("")]
    yield from _incomplete(loaded)
    lost = excluded[~excluded["reason"].isin(_EXPECTED)].groupby("reason")["trials"].sum()
    if len(lost):
        told = ", ".join(f"{reason} {number}" for reason, number in lost.items())
        are = "trial is" if lost.sum() == 1 else "trials are"
        message = f"{lost.sum()} {are} left out: {told}"
        yield AnalysisWarning(WarningCode.TRIALS_LEFT_OUT, message)
    if empty := counting.uncounted(trials):
        message = f"no trial counts of participant {', '.join(empty)}"
        yield AnalysisWarning(WarningCode.PARTICIPANT_NOT_COUNTED, message)
    if loaded.cells is None and not counted["kind"].eq("single").any():
        message = "no trial with a single stimulus counts, so there is no level to report"
        yield AnalysisWarning(WarningCode.SINGLE_STIMULI_MISSING, message)
    yield from loaded.changed
    yield from _origins(loaded)
    if len(stated) > 1:
        contacts = "; ".join(f"{words} ({named(which)})" for words, which in stated.items())
        message = f"force and contact of the fingers are not the same in all sessions: {contacts}"
        yield AnalysisWarning(WarningCode.CONTACT_DIFFERS, message)
    yield from with_code(WarningCode.ANSWERS_MISSING, _silent(trials))
    yield from _about_none(counted)
    yield from (AnalysisWarning(_DOUBTS[one.kind], one.words) for one in doubts)
    yield from with_code(WarningCode.FUNCTION_MISFIT, misfits(fits, people, loaded.axis))
    if loaded.side_told:
        yield from with_code(WarningCode.SIDES_UNEQUAL, unequal_sides(trials, loaded.axis))


def _origins(loaded: LoadedTrials) -> Iterator[AnalysisWarning]:
    """Warn of sessions that are modified, lost, or not of the same kind as the others."""
    trials = loaded.trials
    studies = _studies(loaded)
    if studies > 1:
        message = f"the trials come from {studies} different studies (study_sha256)"
        yield AnalysisWarning(WarningCode.SEVERAL_STUDIES, message)
    for differences in loaded.altered.values():
        altered = (f"altered after recording: {one}" for one in differences)
        yield from with_code(WarningCode.SESSION_MODIFIED, altered)
    for session, differences in loaded.lost.items():
        left_out = (f"session {session} is left out: {one}" for one in differences)
        yield from with_code(WarningCode.SESSION_LOST, left_out)
    if without := without_device(trials).sum():
        message = f"{without} of {len(trials)} trials are of people on a mock device or an emulator"
        yield AnalysisWarning(WarningCode.PRACTICE_WITHOUT_DEVICE, message)
    if 0 < (made := trials["simulated"].sum()) < len(trials):
        message = f"{made} of {len(trials)} trials are simulated, the others real"
        yield AnalysisWarning(WarningCode.SIMULATED_AND_REAL, message)


def doubts_of(loaded: LoadedTrials) -> Iterator[Doubt]:
    """Yield who a reader should look at."""
    if loaded.cells is None:
        return doubtful(loaded.trials, loaded.axis, loaded.alternatives)
    return doubtful_counts(loaded.cells, loaded.blanks, loaded.alternatives)


def _studies(loaded: LoadedTrials) -> int:
    """Count the studies; levels placed for a participant make no other one, by its plan."""
    trials, key = loaded.trials, ["participant", "session"]
    of_plan = {(one.participant, one.session): one.file_sha256 for one in loaded.progress}
    known = trials.loc[trials["study_sha256"].ne(_NO_STUDY), [*key, "study_sha256"]]
    told = known.drop_duplicates().itertuples(index=False)
    return len({of_plan.get((row[0], row[1]), row[2]) for row in told})


def _incomplete(loaded: LoadedTrials) -> Iterator[AnalysisWarning]:
    for folder, told in loaded.without_table.items():
        message = f"session {folder} has no trials.csv; {told}"
        yield AnalysisWarning(WarningCode.SESSION_WITHOUT_TABLE, message)
    for one in loaded.progress:
        if one.valid < one.planned:
            where = _session(one.participant, one.session)
            message = f"{where}: {one.valid} of {one.planned} planned trials have a valid attempt"
            yield AnalysisWarning(WarningCode.PLANNED_TRIALS_MISSING, message)
        if one.unexported > 0:
            where = _session(one.participant, one.session)
            message = (
                f"{where}: its journal tells of {one.unexported} more trials than its trials.csv; "
                "tactstrip export DIR builds that anew"
            )
            yield AnalysisWarning(WarningCode.TRIALS_NOT_EXPORTED, message)
    planned = {(one.participant, one.session) for one in loaded.progress}
    trials = loaded.trials[loaded.trials["kind"].isin(counting.COUNTED_KINDS)]
    key = ["participant", "session", "trial"]
    valid = trials[key].assign(ok=trials["status"].eq("ok")).groupby(key, as_index=False).any()
    people = valid[~valid["ok"]].groupby(key[:2]).size().reset_index(name="missing")
    for row in people.itertuples():
        if (row.participant, row.session) not in planned:
            where = _session(row.participant, row.session)
            message = f"{where}: trials without a valid attempt: {row.missing}"
            yield AnalysisWarning(WarningCode.VALID_ATTEMPT_MISSING, message)
    yield from with_code(WarningCode.FEWER_TRIALS_THAN_OTHERS, _broken_off(trials, planned))


def _broken_off(trials: pd.DataFrame, planned: Collection[tuple[str, str]]) -> Iterator[str]:
    """Name who has fewer trials of a condition than most, where no plan tells how many there are.

    Those are a quarter at most, and have less than nine tenths of what several others have in each
    session: of more it may be a design.
    """
    key = ["participant", "session"]
    known = pd.MultiIndex.from_frame(trials[key].astype(str)).isin([*planned])
    each = ["condition", "participant", "session"]
    number = trials[~known].astype({"condition": str}).groupby(each).size()
    for condition, own in number.groupby(level="condition"):
        usual = int(own.mode().max())
        same = int(own.eq(usual).sum())
        fewer = own[own.lt(_NEARLY * usual)].groupby("participant").min()
        if fewer.empty or len(fewer) > _FEW_OF_ALL * len(own) or same < _SEVERAL:
            continue
        where = f" in condition {condition}" if len({*trials["condition"]}) > 1 else ""
        if len(fewer) > SPELLED:
            yield (
                f"{len(fewer)} participants have fewer than {usual} trials{where}, which {same} of "
                f"{len(own)} have: were sessions broken off?"
            )
            continue
        for who, few in fewer.items():
            yield (
                f"participant {who} has {few} trials{where}, {same} of {len(own)} have {usual}: "
                "was a session broken off?"
            )


def _session(participant: object, session: object) -> str:
    return f"participant {participant}, session {session}"


def _silent(trials: pd.DataFrame) -> Iterator[str]:
    key = ["participant", "condition"]
    silent = trials.loc[trials["reason"].eq(NEVER_ANSWERED), key].astype(object)
    several = len({*trials["condition"]}) > 1
    for row in silent.groupby(key).size().reset_index(name="number").itertuples():
        where = f" in condition {row.condition}" if several else ""
        yield (
            f"participant {row.participant} gave no answer{where}: {row.number} of {row.number} "
            "trials timed out, and none of them counts: a dead keyboard, or the task misunderstood?"
        )


def _about_none(counted: pd.DataFrame) -> Iterator[AnalysisWarning]:
    offered = counted["none_offered"].fillna(value=False)
    if offered.any() and not offered.all():
        message = (
            f'"none" is known to be an answer in {offered.sum()} of {len(offered)} trials only'
        )
        yield AnalysisWarning(WarningCode.NONE_OFFERED_IN_PART, message)
    if not offered[counted["kind"].eq("blank")].all():
        message = 'blank trials without "none" as an answer: a false alarm is nearly certain there'
        yield AnalysisWarning(WarningCode.BLANKS_WITHOUT_NONE, message)
