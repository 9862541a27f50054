"""One analysis of checked trials: the tables of a study, and the warnings about them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import pandas as pd

from analysis.counts import table
from analysis.counts.checks import check_answers, check_drift, sides_differ
from analysis.counts.information import information_table
from analysis.counts.sensitivity import d_prime_differences, sensitivity_table, with_criterion
from analysis.numbers import METHODS
from analysis.reading.columns import FORCED, YES_NO
from analysis.reading.session import contacts
from analysis.reading.text import ResultFileError
from analysis.reading.trials import counts_of, without_device
from analysis.results.findings import ALPHA
from analysis.results.protocol import read_studies
from analysis.results.rendering import sentence, words_of
from analysis.results.warnings import find_warnings
from analysis.thresholds.band import group_bands
from analysis.thresholds.discrimination import (
    with_difference_thresholds,
    with_group_difference_thresholds,
)
from analysis.thresholds.displacement import with_micrometres
from analysis.thresholds.table import (
    difference_table,
    group_table,
    side_thresholds,
    thresholds_of,
)
from analysis.thresholds.tables import tables_in
from experiment.names import require_whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analysis.axis import Axis
    from analysis.codes import AnalysisWarning
    from analysis.counts.checks import FailedCheck
    from analysis.reading.trials import Counts, LoadedTrials
    from analysis.results.protocol import Planned
    from analysis.thresholds.likelihood import Tables
    from experiment.tasks.task import Scoring, Task


@dataclass(frozen=True, kw_only=True, eq=False)
class Analysis:
    r"""The tables of a study.

    `write_analysis` returns one. Its tables have the columns of the files of the same names, where
    there is one; columns.json defines them. Levels are peak-to-peak volts unless `axis` says
    otherwise.

    Attributes
    ----------
    loaded : LoadedTrials
        The trials, with the files that they come from.
    people : Tables
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
    information : pandas.DataFrame
        The information transfer of an identification, in bits; empty for other tasks.
    reaction_times : pandas.DataFrame
        Median, 10 % and 90 % points of the times of correct answers in seconds: columns
        ``condition level_vpp side n median p10 p90``.
    detected_any : pandas.DataFrame or None
        Stimuli that were detected at either side: columns ``condition level_vpp detected_any``;
        None where "none" could not be answered.
    side_p : mapping of str to float
        The p of equal detection on both sides, by condition.
    checks : tuple
        The checks of answers that failed.
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
    people: Tables
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
    information: pd.DataFrame
    reaction_times: pd.DataFrame
    detected_any: pd.DataFrame | None
    side_p: Mapping[str, float] = field(default_factory=dict)
    checks: tuple[FailedCheck, ...] = ()
    ci: str = METHODS[0]
    seed: int = 0

    def __post_init__(self) -> None:
        if self.ci not in METHODS:
            raise ValueError(f"ci must be one of {', '.join(METHODS)}, got {self.ci!r}")

    @cached_property
    def warnings(self) -> tuple[AnalysisWarning, ...]:
        """What the reader of a result should look at."""
        return tuple(find_warnings(self))

    @cached_property
    def plans(self) -> Planned:
        """The studies in the plans of the sessions."""
        return read_studies(self.loaded.progress)

    @property
    def contacts(self) -> Mapping[str, tuple[str, ...]]:
        """How the fingers lay on the plate, as studies state it, with the sessions of each."""
        pairs = self.trials[["participant", "session"]].drop_duplicates()
        return contacts(self.loaded.progress, [*pairs.itertuples(index=False, name=None)])

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
        elsewhere = [name for name in self.task.named_answers if name not in sides]
        is_alone = len(sides) == 1 and not table[elsewhere].to_numpy().any()
        return str(sides.pop()) if is_alone else ""

    @property
    def one_place(self) -> str:
        """That side where only a map states it, for a table of one place: then no output does."""
        return "" if self.loaded.side_told else self.one_side

    @property
    def has_sites(self) -> bool:
        """Whether answers are known: not of a forced choice known as right and wrong only."""
        return self.loaded.side_told or self.loaded.task != FORCED

    @property
    def task(self) -> Task:
        """The task whose words the tables have."""
        return self.loaded.session_task

    @property
    def is_yes_no(self) -> bool:
        """Whether participants only said if they detected a stimulus, by map or answers."""
        if self.loaded.task == FORCED or self.detected_any is None:
            return False
        sides = self.levels[["over_report", "mislocalised"]].fillna(0).to_numpy()
        return bool(self.one_side) or (self.loaded.task == YES_NO and not sides.any())

    @property
    def scoring(self) -> Scoring:
        """How trials are scored; a table of another program may be one of a forced choice."""
        is_forced = self.loaded.task == FORCED and self.task.scoring == "localisation"
        return "forced-choice" if is_forced else self.task.scoring

    @property
    def words(self) -> Mapping[str, Any]:
        """What thresholds and detections are called in the task."""
        return words_of(self.scoring)

    def label(self, text: str) -> str:
        """Return a caption, a heading or a label in the words of the task.

        Parameters
        ----------
        text : str
            As it is of a task in which stimuli are detected.

        Returns
        -------
        str
        """
        return str(self.words["labels"].get(text, text))

    @property
    def mark(self) -> str:
        """A remark in every output where trials are no plain results; else empty."""
        return sentence("warnings.jinja", "mark", counts=self.counts, loaded=self.loaded)


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
    people = tables_in(loaded, cells)
    thresholds = thresholds_of(people, seed=seed)
    if loaded.side_told:
        thresholds = with_micrometres(thresholds, trials, axis)
    groups = group_table(people, thresholds)
    if (reference_vpp := loaded.session_task.reference_vpp) is not None:
        thresholds = with_difference_thresholds(thresholds, people, reference_vpp)
        groups = with_group_difference_thresholds(groups, reference_vpp)
    sensitivity = sensitivity_table(counts)
    detected_any = table.count_detected_any(cells)
    side_p: dict[str, float] = {}
    if loaded.side_told and loaded.cells is None:
        tests = sides_differ(counts)
        side_p = dict(zip(tests["condition"], tests["p"], strict=True))
    differs = trials["condition"].astype(object).map(side_p).lt(ALPHA)
    task = loaded.session_task
    by_answer = (
        table.count_correct(counts, task.reference_vpp) if loaded.cells is None else loaded.cells
    )
    false_alarms = table.count_false_alarms(counts) if loaded.blanks is None else loaded.blanks
    checks = (
        *check_answers(by_answer, false_alarms, loaded.alternatives or len(task.correct_answers)),
        *(check_drift(trials, axis) if loaded.numbered else ()),
    )
    return Analysis(
        loaded=loaded,
        people=people,
        counts=counts_of(loaded),
        levels=table.summarize_levels(cells, group_bands(people)),
        participants=table.summarize_participants(cells, ci),
        both=table.count_both(counts, ci),
        blank=table.count_blanks(counts, ci, loaded.blanks),
        hands_off=table.hands_off_table(trials),
        excluded=table.excluded_table(trials),
        thresholds=thresholds,
        groups=groups,
        differences=with_criterion(
            difference_table(people, thresholds, groups),
            trials,
            sensitivity,
            false_alarms.head(0) if detected_any is None else false_alarms,
            numbered=loaded.numbered,
        ),
        sides=table.summarize_sides(counts) if side_p else pd.DataFrame(),
        side_groups=side_thresholds(trials[differs], axis, loaded.alternatives),
        sensitivity=sensitivity,
        d_prime_differences=d_prime_differences(sensitivity),
        confusion=table.count_confusions(counts),
        information=(
            information_table(counts, seed=seed) if task.is_identification else pd.DataFrame()
        ),
        reaction_times=table.reaction_table(trials),
        detected_any=detected_any,
        side_p=side_p,
        checks=checks,
        ci=ci,
        seed=seed,
    )


def _require_real(trials: pd.DataFrame) -> None:
    """Refuse to mix simulated and real trials, and people on a device that moves nothing."""
    is_simulated = trials["simulated"]
    for message, is_refused in (
        ("a simulated trial, and others are real", is_simulated & (not is_simulated.all())),
        ("a trial of a person on a device that moves nothing", without_device(trials)),
    ):
        for file, line in trials.loc[is_refused, ["file", "line"]].head(1).to_numpy():
            raise ResultFileError(file, int(line), f"{message}; --allow-simulated accepts it")
