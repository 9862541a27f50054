"""One analysis of checked trials: the tables of a study, and the warnings about them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import permutations
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.codes import AnalysisWarning, WarningCode
from analysis.counts import table
from analysis.counts.checks import (
    AT_CHANCE,
    DRIFT,
    REVERSED,
    check_counts,
    check_trials,
    sides_differ,
)
from analysis.counts.sensitivity import d_prime_differences, sensitivity_table, with_criterion
from analysis.numbers import METHODS, TOTAL
from analysis.reading.columns import FORCED, YES_NO
from analysis.reading.session import contacts
from analysis.reading.text import ResultFileError
from analysis.reading.trials import NEVER_ANSWERED, counts_of, without_device
from analysis.results.rendering import warning
from analysis.thresholds.band import group_bands
from analysis.thresholds.displacement import SITE_COLUMNS, with_micrometres
from analysis.thresholds.fit import WITH_THRESHOLD
from analysis.thresholds.people import people_in
from analysis.thresholds.table import (
    difference_table,
    group_table,
    side_thresholds,
    thresholds_of,
)
from experiment.names import require_whole
from experiment.perception.gains import UNEQUAL_DB
from experiment.rows import HANDS_OFF, PRACTICE
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analysis.axis import Axis
    from analysis.counts.checks import AnswerCheck
    from analysis.reading.trials import Counts, LoadedTrials
    from analysis.thresholds.people import PersonCounts


ALPHA: Final = 0.05
"""Sides, and false alarms of two conditions, differ where their exact test has a smaller p."""
MISFIT_P: Final = 0.01
"""A function whose bootstrap has a smaller p does not fit.

Every such function is named, with the number that chance would bring: a correction for the number
of functions would hide a bad fit among many participants.
"""
MIN_MANY_LAPSES, MIN_FUNCTIONS = 0.2, 5
"""The share of lapse rates at their limit, of at least so many functions, that is warned of."""
# Left out as planned, or presented again: nothing to warn of.
_EXPECTED: Final = (PRACTICE, HANDS_OFF, "voided")
_NO_STUDY: Final = "n/a"
# A participant who broke off has fewer than nine tenths of the trials that at least three others
# have; where more than a quarter of the participants have fewer, it may be a design.
_NEARLY_ALL, _MIN_ALIKE, _MAX_SHARE = 0.9, 3, 0.25
_CHECKS: Final = {
    REVERSED: WarningCode.RESPONSES_REVERSED,
    AT_CHANCE: WarningCode.GUESSING,
    DRIFT: WarningCode.THRESHOLD_DRIFTS,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Analysis:
    r"""The tables of a study.

    `write_analysis` returns one. Its tables have the columns of the files of the same names, where
    there is one; columns.json defines them. Levels are peak-to-peak volts unless `axis` says
    otherwise.

    Attributes
    ----------
    loaded : LoadedTrials
        The trials, with the files that they come from.
    people : PersonCounts
        The counts of each participant to which the functions were fitted.
    counts : Counts
        How many trials these are.
    levels, participants : pandas.DataFrame
        Detection probabilities over participants, and of each of them, at every level.
    both, blank : pandas.DataFrame
        The answers to both-finger and to blank trials.
    hands_off : pandas.DataFrame
        Trials with the fingers off the plate, which are in none of the other tables.
    excluded : pandas.DataFrame
        Trials that do not count: columns ``participant reason trials``, the last their number.
    thresholds, groups, differences : pandas.DataFrame
        The threshold of every participant, of the group, and their difference between conditions.
    sides, side_groups : pandas.DataFrame
        Detection by side and level, and the threshold of the group for each side, of the
        conditions in which sides differ beyond chance.
    sensitivity, d_prime_differences : pandas.DataFrame
        d' and criterion c, and by how much d' differs between conditions.
    confusion : pandas.DataFrame
        Answers by kind and side of the stimulus.
    reaction_times : pandas.DataFrame
        Median, 10 % and 90 % points of the times of correct answers in seconds: columns
        ``condition level_vpp side n median p10 p90``.
    detected_any : pandas.DataFrame or None
        Stimuli that were detected at either side: columns ``condition level_vpp detected_any``;
        None where "none" could not be answered.
    side_p : mapping of str to float
        The p of equal detection on both sides, by condition.
    checks : tuple
        The participants whose answers failed a check.
    warnings : tuple of AnalysisWarning
        Empty if there is no reason to warn.
    ci : str
        The method of the intervals of proportions.
    seed : int
        The seed of the bootstrap.

    Raises
    ------
    ValueError
        If `ci` is no method of `proportion_ci`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from analysis import ColumnMap, analyse, read_inputs
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response\n1,left,60,left\n")
    ...     analysis = analyse(read_inputs([table], ColumnMap()))
    >>> analysis.counts.trials, analysis.levels["p_mean"].tolist()
    (1, [1.0])
    """

    loaded: LoadedTrials
    people: PersonCounts
    counts: Counts
    levels: pd.DataFrame
    participants: pd.DataFrame
    both: pd.DataFrame
    blank: pd.DataFrame
    hands_off: pd.DataFrame
    excluded: pd.DataFrame
    thresholds: pd.DataFrame
    groups: pd.DataFrame
    differences: pd.DataFrame
    sides: pd.DataFrame
    side_groups: pd.DataFrame
    sensitivity: pd.DataFrame
    d_prime_differences: pd.DataFrame
    confusion: pd.DataFrame
    reaction_times: pd.DataFrame
    detected_any: pd.DataFrame | None
    side_p: Mapping[str, float] = field(default_factory=dict)
    checks: tuple[AnswerCheck, ...] = ()
    warnings: tuple[AnalysisWarning, ...] = ()
    ci: str = METHODS[0]
    seed: int = 0

    def __post_init__(self) -> None:
        if self.ci not in METHODS:
            raise ValueError(f"ci must be one of {', '.join(METHODS)}, got {self.ci!r}")

    @property
    def trials(self) -> pd.DataFrame:
        """All trials as `read_trials` returns them."""
        return self.loaded.trials

    @property
    def axis(self) -> Axis:
        """The axis of the levels."""
        return self.loaded.axis

    @property
    def one_side(self) -> str:
        """The side of all stimuli and of every answer that names one; else empty."""
        table = self.confusion
        if table.empty or self.detected_any is None or table["kind"].eq("both").any():
            return ""
        sides = {*table.loc[table["kind"].eq("single"), "side"]}
        elsewhere = [name for name in LEFT_RIGHT_BOTH.named_answers if name not in sides]
        is_alone = len(sides) == 1 and not table[elsewhere].to_numpy().any()
        return str(sides.pop()) if is_alone else ""

    @property
    def one_place(self) -> str:
        """That side where only a map states it, for a table of one place: then no output does."""
        return "" if self.loaded.side_told else self.one_side

    @property
    def is_yes_no(self) -> bool:
        """Whether participants only said if they detected a stimulus, by map or answers."""
        if self.loaded.task == FORCED or self.detected_any is None:
            return False
        sides = self.levels[["over_report", "mislocalised"]].fillna(0).to_numpy()
        return bool(self.one_side) or (self.loaded.task == YES_NO and not sides.any())

    @property
    def mark(self) -> str:
        """A remark in every output where trials are no plain results; else empty."""
        counts, loaded = self.counts, self.loaded
        simulated = "Simulated participants" if counts.simulated == counts.trials else ""
        if counts.simulated and not simulated:
            simulated = "Simulated and real participants mixed"
        number = counts.without_device
        practice = f"Practice without a device: {number} of {counts.trials} trials"
        modified = f"Modified after recording: {len(loaded.altered)} of {counts.sessions} sessions"
        lost = f"Lost after recording, left out: {len(loaded.lost)} session"
        lost += "s" * (len(loaded.lost) > 1)
        marks = simulated, practice * bool(number), modified * bool(loaded.altered)
        return "; ".join(filter(None, (*marks, lost * bool(loaded.lost))))


def analyse(
    loaded: LoadedTrials,
    *,
    ci: str = "wilson",
    seed: int = 0,
    allow_simulated: bool = False,
) -> Analysis:
    r"""Count answers, fit thresholds and check the data.

    Parameters
    ----------
    loaded : LoadedTrials
        From `analysis.read_inputs`.
    ci : str
        The method of the intervals of proportions, see `analysis.proportion_ci`.
    seed : int
        The seed of the bootstrap.
    allow_simulated : bool
        Whether to accept simulated together with real sessions, and people without a device.

    Returns
    -------
    Analysis

    Raises
    ------
    ValueError
        If the method is unknown, or the seed is not a whole number of at least 0.
    ResultFileError
        If simulated and real trials are mixed, or a person had no device.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from analysis import ColumnMap, analyse, read_inputs
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response\n1,left,60,left\n")
    ...     analysis = analyse(read_inputs([table], ColumnMap()))
    >>> analysis.counts.trials, [warning.code for warning in analysis.warnings]
    (1, [])
    """
    require_whole("seed", seed, 0)
    trials, axis = loaded.trials, loaded.axis
    if not allow_simulated:
        _require_real(trials)
    counts = table.count_answers(trials)
    cells = table.count_levels(counts) if loaded.cells is None else loaded.cells
    people = people_in(loaded, cells)
    thresholds = thresholds_of(people, seed=seed, axis=axis)
    if loaded.side_told:
        thresholds = with_micrometres(thresholds, trials, axis)
    groups = group_table(people, thresholds, axis)
    sensitivity = sensitivity_table(counts)
    blank = table.count_blanks(counts, ci, loaded.blanks)
    detected_any = table.count_detected_any(cells)
    has_sides = loaded.side_told and loaded.cells is None
    side_p: dict[str, float] = {}
    if has_sides:
        tests = sides_differ(counts)
        side_p = dict(zip(tests["condition"], tests["p"], strict=True))
    differing = [name for name, p in side_p.items() if p < ALPHA]
    side_groups = pd.DataFrame()
    if differing:
        side_groups = side_thresholds(
            trials[trials["condition"].isin(differing)], axis, loaded.alternatives
        )
    checks = (
        check_trials(trials, counts, axis, loaded.alternatives)
        if loaded.cells is None
        else check_counts(loaded.cells, loaded.blanks, loaded.alternatives)
    )
    tables: dict[str, Any] = {
        "loaded": loaded,
        "people": people,
        "counts": counts_of(loaded),
        "levels": table.summarize_levels(cells, group_bands(people, axis)),
        "participants": table.summarize_participants(cells, ci),
        "both": table.count_both(counts, ci),
        "blank": blank,
        "hands_off": table.hands_off_table(trials),
        "excluded": table.excluded_table(trials),
        "thresholds": thresholds,
        "groups": groups,
        "differences": with_criterion(
            difference_table(people, axis, thresholds, groups),
            trials,
            sensitivity,
            blank=None if detected_any is None else blank,
            numbered=loaded.numbered,
        ),
        "sides": table.summarize_sides(counts) if side_p else pd.DataFrame(),
        "side_groups": side_groups,
        "sensitivity": sensitivity,
        "d_prime_differences": d_prime_differences(sensitivity),
        "confusion": table.count_confusions(counts),
        "reaction_times": table.reaction_table(trials),
        "detected_any": detected_any,
        "side_p": side_p,
        "checks": tuple(checks),
        "ci": ci,
        "seed": seed,
    }
    return Analysis(**tables, warnings=(*_warnings(Analysis(**tables)),))


def _require_real(trials: pd.DataFrame) -> None:
    """Refuse simulated trials beside real ones, and people on a device that moves nothing."""
    simulated = trials["simulated"]
    if simulated.any() and not simulated.all():
        trial = trials[simulated].iloc[0]
        message = "a simulated trial, and others are real; --allow-simulated accepts both"
        raise ResultFileError(trial["file"], int(trial["line"]), message)
    practice = trials[without_device(trials)]
    if len(practice):
        trial = practice.iloc[0]
        message = (
            f"a trial of a person on a device of the kind {trial['device_kind']}, which moves "
            "nothing; --allow-simulated accepts it"
        )
        raise ResultFileError(trial["file"], int(trial["line"]), message)


def _warnings(analysis: Analysis) -> Iterator[AnalysisWarning]:
    """Yield a warning for everything that the reader of a result should look at."""
    loaded, trials = analysis.loaded, analysis.trials
    counted = trials[trials["reason"].eq("")]
    yield from _incomplete(loaded)
    left_out = analysis.excluded[~analysis.excluded["reason"].isin(_EXPECTED)]
    if len(left_out):
        reasons = left_out.groupby("reason")["trials"].sum().to_dict()
        number = int(left_out["trials"].sum())
        yield warning(WarningCode.TRIALS_LEFT_OUT, number=number, reasons=reasons)
    if names := table.uncounted(trials):
        yield warning(WarningCode.PARTICIPANT_NOT_COUNTED, participants=names)
    if loaded.cells is None and not counted["kind"].eq("single").any():
        yield warning(WarningCode.SINGLE_STIMULI_MISSING)
    yield from loaded.changed
    yield from _origins(analysis)
    yield from _about_answers(analysis, counted)
    yield from (
        AnalysisWarning(
            _CHECKS[check.kind],
            str(check),
            {"participant": check.participant, "condition": check.condition},
        )
        for check in analysis.checks
    )
    yield from _about_functions(analysis.thresholds)
    yield from _about_sides(analysis)
    yield from _about_conditions(analysis)


def _incomplete(loaded: LoadedTrials) -> Iterator[AnalysisWarning]:
    for folder, remedy in loaded.without_table.items():
        yield warning(WarningCode.SESSION_WITHOUT_TABLE, folder=folder, remedy=remedy)
    for session in loaded.progress:
        who = {"participant": session.participant, "session": session.session}
        if session.valid < session.planned:
            counts = {"valid": session.valid, "planned": session.planned}
            yield warning(WarningCode.PLANNED_TRIALS_MISSING, **who, **counts)
        if session.unexported > 0:
            yield warning(WarningCode.TRIALS_NOT_EXPORTED, **who, number=session.unexported)
    planned = {(session.participant, session.session) for session in loaded.progress}
    trials = loaded.trials[loaded.trials["kind"].isin(table.COUNTED_KINDS)]
    key = ["participant", "session", "trial"]
    valid = trials[key].assign(ok=trials["status"].eq("ok")).groupby(key, as_index=False).any()
    missing = valid[~valid["ok"]].groupby(key[:2]).size()
    for row in missing.reset_index(name="number").itertuples():
        if (row.participant, row.session) not in planned:
            names = {"participant": row.participant, "session": row.session}
            yield warning(WarningCode.VALID_ATTEMPT_MISSING, **names, number=row.number)
    is_planned = pd.MultiIndex.from_frame(trials[key[:2]].astype(str)).isin([*planned])
    each = ["condition", "participant", "session"]
    numbers = trials[~is_planned].astype({"condition": str}).groupby(each).size()
    several = len({*trials["condition"]}) > 1
    for condition, per_session in numbers.groupby(level="condition"):
        usual = int(per_session.mode().max())
        alike = int(per_session.eq(usual).sum())
        fewer = per_session[per_session.lt(_NEARLY_ALL * usual)].groupby("participant").min()
        if 0 < len(fewer) <= _MAX_SHARE * len(per_session) and alike >= _MIN_ALIKE:
            yield warning(
                WarningCode.FEWER_TRIALS_THAN_OTHERS,
                trials=fewer.to_dict(),
                condition=condition if several else "",
                usual=usual,
                alike=alike,
                sessions=len(per_session),
            )


def _origins(analysis: Analysis) -> Iterator[AnalysisWarning]:
    """Warn of sessions that are modified, lost, or not of the same kind as the others."""
    loaded, trials = analysis.loaded, analysis.trials
    key = ["participant", "session"]
    of_plan = {(one.participant, one.session): one.file_sha256 for one in loaded.progress}
    hashes = trials.loc[trials["study_sha256"].ne(_NO_STUDY), [*key, "study_sha256"]]
    rows = hashes.drop_duplicates().itertuples(index=False)
    # Levels placed for a participant make no other study, by its plan.
    studies = len({of_plan.get((row[0], row[1]), row[2]) for row in rows})
    if studies > 1:
        yield warning(WarningCode.SEVERAL_STUDIES, number=studies)
    for differences in loaded.altered.values():
        for difference in differences:
            yield warning(WarningCode.SESSION_MODIFIED, difference=difference)
    for session, differences in loaded.lost.items():
        for difference in differences:
            yield warning(WarningCode.SESSION_LOST, session=session, difference=difference)
    counts = analysis.counts
    if counts.without_device:
        numbers = {"number": counts.without_device, "trials": counts.trials}
        yield warning(WarningCode.PRACTICE_WITHOUT_DEVICE, **numbers)
    if 0 < counts.simulated < counts.trials:
        numbers = {"number": counts.simulated, "trials": counts.trials}
        yield warning(WarningCode.SIMULATED_AND_REAL, **numbers)
    contact = contacts_of(analysis)
    if len(contact) > 1:
        yield warning(WarningCode.CONTACT_DIFFERS, contacts=contact)


def contacts_of(analysis: Analysis) -> Mapping[str, tuple[str, ...]]:
    """Return how the fingers lay on the plate, as studies state it, with the sessions of each."""
    pairs = analysis.trials[["participant", "session"]].drop_duplicates()
    return contacts(analysis.loaded.progress, [*pairs.itertuples(index=False, name=None)])


def _about_answers(analysis: Analysis, counted: pd.DataFrame) -> Iterator[AnalysisWarning]:
    trials, key = analysis.trials, ["participant", "condition"]
    silent = trials.loc[trials["reason"].eq(NEVER_ANSWERED), key].astype(object)
    several = len({*trials["condition"]}) > 1
    for row in silent.groupby(key).size().reset_index(name="number").itertuples():
        data = {"participant": row.participant, "condition": row.condition if several else ""}
        yield warning(WarningCode.ANSWERS_MISSING, **data, number=row.number)
    offered = counted["none_offered"].fillna(value=False)
    if offered.any() and not offered.all():
        numbers = {"number": int(offered.sum()), "trials": len(offered)}
        yield warning(WarningCode.NONE_OFFERED_IN_PART, **numbers)
    if not offered[counted["kind"].eq("blank")].all():
        yield warning(WarningCode.BLANKS_WITHOUT_NONE)


def _about_functions(thresholds: pd.DataFrame) -> Iterator[AnalysisWarning]:
    """Warn of functions that do not fit, that rise in one step, and of many lapses."""
    tested = thresholds["deviance_p"].dropna()
    misfits = misfits_of(thresholds)
    several = len({*thresholds["condition"]}) > 1

    def named(rows: pd.DataFrame) -> list[dict[str, object]]:
        return [
            {
                "participant": row.participant,
                "condition": row.condition if several else "",
                "p": None if np.isnan(p) else p,
            }
            for row, p in zip(rows.itertuples(), rows["deviance_p"].to_numpy(float), strict=True)
        ]

    if len(misfits):
        numbers = {"tested": len(tested), "limit": MISFIT_P, "expected": MISFIT_P * len(tested)}
        yield warning(WarningCode.FUNCTION_MISFIT, functions=named(misfits), **numbers)
    fitted = thresholds[thresholds["status"].isin(WITH_THRESHOLD)]
    steep = fitted[fitted["status"].eq("separated")]
    if len(steep):
        yield warning(WarningCode.FUNCTIONS_STEEP, functions=named(steep), fitted=len(fitted))
    at_bound = fitted[fitted["status"].eq("lapse_at_bound")]
    if len(fitted) >= MIN_FUNCTIONS and len(at_bound) >= MIN_MANY_LAPSES * len(fitted):
        yield warning(WarningCode.LAPSES_AT_BOUND, functions=named(at_bound), fitted=len(fitted))


def misfits_of(thresholds: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of functions that do not fit, the worst first."""
    rows = thresholds[thresholds["deviance_p"].lt(MISFIT_P)]
    return rows.sort_values(["deviance_p", "participant"])


def _about_sides(analysis: Analysis) -> Iterator[AnalysisWarning]:
    several = analysis.counts.conditions > 1
    for condition, p in analysis.side_p.items():
        if p < ALPHA:
            yield warning(WarningCode.SIDES_DIFFER, condition=condition if several else "", p=p)
    table = analysis.thresholds
    if not {*SITE_COLUMNS.values()} <= {*table.columns}:
        return
    for more, less in permutations(SITE_COLUMNS, 2):
        ratios = (table[SITE_COLUMNS[more]] / table[SITE_COLUMNS[less]]).astype(float).dropna()
        apart_db = [20 * math.log10(ratio) for ratio in ratios]
        larger = [db for db in apart_db if db >= UNEQUAL_DB]
        if larger:
            data = {"more": more, "less": less, "db": max(larger)}
            every = len(larger) == len(apart_db)
            yield warning(WarningCode.SIDES_UNEQUAL, **data, every=every)


def _about_conditions(analysis: Analysis) -> Iterator[AnalysisWarning]:
    """Warn of conditions that cannot be compared without a second thought."""
    rows = analysis.differences
    for row in rows[rows["participant"].eq(TOTAL)].to_dict("records"):
        names = {"a": row["condition_a"], "b": row["condition_b"]}
        people = rows[
            rows["condition_a"].eq(names["a"])
            & rows["condition_b"].eq(names["b"])
            & rows["participant"].ne(TOTAL)
        ]
        if row["false_alarm_p"] < ALPHA:
            rates = (
                {name: row[f"false_alarms_{name}"] / row[f"blanks_{name}"] for name in ("a", "b")}
                if row["blanks_a"] and row["blanks_b"]
                else {}
            )
            lower = "a" if rates and rates["a"] < rates["b"] else "b"
            yield warning(
                WarningCode.FALSE_ALARMS_DIFFER,
                **names,
                p=row["false_alarm_p"],
                lower=names[lower],
                same_people=len(people) > 0,
            )
        first = {*people["first"]}
        if len(people) > 1 and len(first) == 1 and first <= {*names.values()}:
            data = {"first": first.pop(), "participants": len(people)}
            yield warning(WarningCode.CONDITION_ALWAYS_FIRST, **names, **data)
