"""One analysis of checked trials: all tables, all counts, and what a reader has to be told."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from analysis.answers import counting, detection
from analysis.answers.choice import choices, confusion_table
from analysis.answers.counting import reaction_table
from analysis.answers.doubts import DRIFTING, SWAPPED
from analysis.answers.dprime import sensitivity_table
from analysis.definitions import METHODS
from analysis.groups.criterion import with_criterion
from analysis.groups.micrometres import with_micrometres
from analysis.groups.sensitivity import d_prime_differences
from analysis.groups.tables import difference_table, group_table, without_people
from analysis.reading.counts import counts_of, without_device
from analysis.reading.plans import contacts
from analysis.reading.text import ResultFileError
from analysis.results.methods.misfit import misfitting
from analysis.results.warned import doubts_of, warnings_of
from analysis.thresholds.people import people_in
from analysis.thresholds.table import thresholds_of
from experiment.names import require_whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from analysis.answers.choice import Choices
    from analysis.answers.doubts import Doubt
    from analysis.axis import Axis
    from analysis.codes import AnalysisWarning
    from analysis.groups.population import PopulationThreshold
    from analysis.groups.tables import Without
    from analysis.reading.batch import InputFile
    from analysis.reading.counts import Counts
    from analysis.reading.load import LoadedTrials
    from analysis.thresholds.people import PersonCounts
    from experiment.rows import MeasuredRow


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Analysis:
    r"""What came out of a set of trials.

    `write_analysis` returns one. Its tables have the columns of the files of the same names, where
    there is one; `analysis.definitions` says what they mean. Levels are peak-to-peak volts unless
    `axis` says otherwise.

    Attributes
    ----------
    levels, participants : pandas.DataFrame
        Detection probabilities over participants, and of each of them, at every level.
    both, blank : pandas.DataFrame
        What was answered in both-finger and in blank trials.
    excluded : pandas.DataFrame
        What does not count: columns ``participant reason trials``, the last how many.
    thresholds : pandas.DataFrame
        The threshold of every participant in every condition.
    groups : pandas.DataFrame
        The threshold of the group in every condition: the rows all of thresholds.csv, with the
        number of participants, and of those below and above the levels.
    differences : pandas.DataFrame
        By how many dB thresholds differ between conditions.
    sensitivity, d_prime_differences : pandas.DataFrame
        d' and criterion, and by how much d' differs between conditions.
    population : tuple of PopulationThreshold
        The threshold of all people of a condition as one population; empty unless asked for.
    confusion : pandas.DataFrame
        Answers by kind and side of the stimulus.
    choice : tuple of Choices
        What each participant answered, and all of them: shares, information, d'.
    reaction_times : pandas.DataFrame
        Median, 10 % and 90 % points of the times of correct answers in seconds: columns
        ``condition level_vpp side n median p10 p90``.
    trials : pandas.DataFrame
        All trials as `read_trials` returns them.
    detected_any : pandas.DataFrame or None
        Stimuli that were felt at all: columns ``condition level_vpp detected_any``; None where
        "none" could not be answered.
    hands_off : pandas.DataFrame
        Trials with the fingers off the plate, which are in none of the other tables.
    counts : Counts
        How many trials these are.
    inputs : tuple of InputFile
        The files that were read.
    warnings : tuple of AnalysisWarning
        A code and a sentence each; empty where nothing is amiss.
    ci : str
        Method of the cells' intervals.
    seed : int
        Of everything that is drawn at random: bootstrap and permutations.
    axis : Axis
        What the levels are.
    people : PersonCounts
        What everybody was shown and detected, as the thresholds are of.
    studies : tuple of (str, str)
        Canonical texts of the studies in the plans beside the tables, each once, with the sources
        of their numbers.
    measured : tuple of MeasuredRow
        What a monitor measured of the bursts, a row of measured.csv each.
    altered : mapping of str to tuple of str
        Sessions that are not as they were recorded: the path of each table, and what differs.
    lost : mapping of str to tuple of str
        Such sessions of which no table is left.
    not_compared : tuple of str
        Tables of sessions without a journal.
    contacts : mapping of str to tuple of str
        How the fingers lay on the plate, as studies state it, with the sessions of each.
    doubts : tuple of Doubt
        People who look as if they guessed or drifted, or had their sides swapped.
    task : str
        ``yes/no`` or ``forced choice`` where a map states it; else empty.
    unswapped : pandas.DataFrame or None
        `groups` without the people whose sides look swapped; ``None`` where there are none.
    fitting : Without or None
        Without the people with a function that does not fit, or a threshold that drifts; ``None``
        where there are none.
    side_told : bool
        Whether the tables tell a side; false where a map states one for all rows.
    left_out_by : str
        The keys of a map that leave out rows and, of several, how many each.

    Raises
    ------
    ValueError
        If `ci` is no method of `proportion_ci`.

    Notes
    -----
    Types of attributes that the package does not offer by name may change; what they hold is in the
    files.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from analysis import ColumnMap
    >>> from analysis.reading.load import read_inputs
    >>> from analysis.results.tables import analyse
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response\n1,left,60,left\n")
    ...     found = analyse(read_inputs([table], ColumnMap()))
    >>> found.counts.trials, found.levels["p_mean"].tolist()
    (1, [1.0])
    """

    levels: pd.DataFrame
    participants: pd.DataFrame
    both: pd.DataFrame
    blank: pd.DataFrame
    excluded: pd.DataFrame
    thresholds: pd.DataFrame
    groups: pd.DataFrame
    differences: pd.DataFrame
    sensitivity: pd.DataFrame
    d_prime_differences: pd.DataFrame
    population: tuple[PopulationThreshold, ...]
    confusion: pd.DataFrame
    choice: tuple[Choices, ...]
    reaction_times: pd.DataFrame
    trials: pd.DataFrame
    detected_any: pd.DataFrame | None
    hands_off: pd.DataFrame
    counts: Counts
    inputs: tuple[InputFile, ...]
    warnings: tuple[AnalysisWarning, ...]
    ci: str
    seed: int
    axis: Axis
    people: PersonCounts
    studies: tuple[tuple[str, tuple[str, ...]], ...] = ()  # with the keys that their files set
    measured: tuple[MeasuredRow, ...] = ()  # of the bursts that a monitor measured
    altered: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    lost: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    not_compared: tuple[str, ...] = ()
    contacts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    doubts: tuple[Doubt, ...] = ()
    task: str = ""
    unswapped: pd.DataFrame | None = None
    fitting: Without | None = None
    side_told: bool = True
    left_out_by: str = ""

    def __post_init__(self) -> None:
        if self.ci not in METHODS:
            raise ValueError(f"ci must be one of {', '.join(METHODS)}, got {self.ci!r}")

    @property
    def one_side(self) -> str:
        """The side of all stimuli and of every answer that names one; else empty."""
        table = self.confusion
        if table.empty or self.detected_any is None or table["kind"].eq("both").any():
            return ""
        sides = {*table.loc[table["kind"].eq("single"), "side"]}
        others = [name for name in ("left", "right", "both") if name not in sides]
        none = not table[others].to_numpy().any()
        return str(sides.pop()) if len(sides) == 1 and none else ""

    @property
    def one_place(self) -> str:
        """That side where only a map states it, for a table of one place: then no output does."""
        return "" if self.side_told else self.one_side

    @property
    def mark(self) -> str:
        """What every output says of the trials where they are no plain results; else empty."""
        return "; ".join(filter(None, (self._simulated, self._practice, self._altered, self._lost)))

    @property
    def _simulated(self) -> str:
        if self.counts.simulated == self.counts.trials:
            return "Simulated participants"
        return "Simulated and real participants mixed" if self.counts.simulated else ""

    @property
    def _practice(self) -> str:
        number = self.counts.without_device
        told = f"Practice without a device: {number} of {self.counts.trials} trials"
        return told if number else ""

    @property
    def _altered(self) -> str:
        number = len(self.altered)
        return (
            f"Altered after recording: {number} of {self.counts.sessions} sessions"
            if number
            else ""
        )

    @property
    def _lost(self) -> str:
        number = len(self.lost)
        some = "" if number == 1 else "s"
        return f"Lost after recording, left out: {number} session{some}" if number else ""


def analyse(
    loaded: LoadedTrials,
    *,
    ci: str = "wilson",
    seed: int = 0,
    allow_simulated: bool = False,
    population: bool = False,
) -> Analysis:
    r"""Count, tabulate and look for what a reader has to be told.

    Parameters
    ----------
    loaded : LoadedTrials
        From `analysis.reading.load.read_inputs`.
    ci : str
        Method of the cells' intervals, see `analysis.proportion_ci`.
    seed : int
        Of bootstrap and permutations.
    allow_simulated : bool
        Whether simulated and real sessions may be mixed, and people without a device be analysed.
    population : bool
        Whether to fit the participants of each condition as one population.

    Returns
    -------
    Analysis

    Raises
    ------
    ValueError
        For an unknown method, and a seed that is no whole number of at least 0.
    ResultFileError
        For simulated trials beside real ones, and trials of a person without a device.

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
    trials = loaded.trials
    if trials["simulated"].any() and not trials["simulated"].all() and not allow_simulated:
        one = trials[trials["simulated"]].iloc[0]
        message = "a simulated trial, and others are real; --allow-simulated accepts both"
        raise ResultFileError(one["file"], int(one["line"]), message)
    practice = trials[without_device(trials)]
    if len(practice) and not allow_simulated:
        one = practice.iloc[0]
        message = (
            f"a trial of a person on a device of the kind {one['device_kind']}, who felt nothing; "
            "--allow-simulated accepts it"
        )
        raise ResultFileError(one["file"], int(one["line"]), message)
    excluded = counting.excluded_table(trials)
    stated = contacts(loaded.progress, _sessions_of(trials))
    cells = detection.cells(trials) if loaded.cells is None else loaded.cells
    people, doubts = people_in(loaded, cells), tuple(doubts_of(loaded))
    fitted = thresholds_of(people, seed=seed, axis=loaded.axis)
    thresholds = with_micrometres(fitted, trials, loaded.axis) if loaded.side_told else fitted
    sensitivity = sensitivity_table(trials)
    blank, detected_any = detection.blank_table(trials, ci, loaded.blanks), _detected_any(loaded)
    told = warnings_of(loaded, excluded, stated, doubts=doubts, people=people, fits=thresholds)
    return Analysis(
        levels=detection.levels_of(cells),
        participants=detection.participants_of(cells, ci),
        both=detection.both_table(trials, ci),
        blank=blank,
        excluded=excluded,
        thresholds=thresholds,
        groups=group_table(people, thresholds, loaded.axis),
        differences=with_criterion(
            difference_table(people, loaded.axis),
            trials,
            sensitivity,
            blank=blank if detected_any is not None else None,
            numbered=loaded.numbered,
        ),
        sensitivity=sensitivity,
        d_prime_differences=d_prime_differences(sensitivity),
        population=_population(people, loaded.axis) if population else (),
        confusion=confusion_table(trials),
        choice=choices(trials, seed),
        reaction_times=reaction_table(trials),
        trials=trials,
        detected_any=detected_any,
        hands_off=counting.hands_off_table(trials),
        counts=counts_of(loaded),
        inputs=loaded.inputs,
        warnings=tuple(told),
        doubts=doubts,
        task=loaded.task,
        unswapped=_unswapped(people, thresholds, doubts, loaded.axis),
        fitting=without_people(
            misfitting(thresholds) | {one.participant for one in doubts if one.kind == DRIFTING},
            *(people, thresholds, loaded.axis),
        ),
        ci=ci,
        seed=seed,
        axis=loaded.axis,
        people=people,
        studies=tuple(dict.fromkeys((one.study, one.keys_set) for one in loaded.progress)),
        measured=tuple(row for one in loaded.progress for row in one.measured),
        altered=loaded.altered,
        lost=loaded.lost,
        not_compared=loaded.not_compared,
        contacts=stated,
        side_told=loaded.side_told,
        left_out_by=loaded.left_out_by,
    )


def _unswapped(
    people: PersonCounts, thresholds: pd.DataFrame, doubts: tuple[Doubt, ...], axis: Axis
) -> pd.DataFrame | None:
    """Fit the groups without people whose sides look swapped.

    Who looks as if guessing stays in: often it is a high threshold, without which the group's
    would be too low.
    """
    swapped = {one.participant for one in doubts if one.kind == SWAPPED}
    if not swapped:
        return None
    places = [i for i, (_, who) in enumerate(people.names) if who not in swapped]
    return group_table(people.at(places), thresholds, axis)


def _population(people: PersonCounts, axis: Axis) -> tuple[PopulationThreshold, ...]:
    from analysis.groups.population import population_thresholds  # statsmodels is slow to load

    return population_thresholds(people, axis=axis)


def _detected_any(loaded: LoadedTrials) -> pd.DataFrame | None:
    """Count what was felt at all; of a table of counts that is what was detected."""
    trials, cells = loaded.trials, loaded.cells
    if cells is not None:
        return detection.detected_any_of(cells) if cells["none_offered"].all() else None
    return detection.detected_any(trials) if counting.offers_none(trials) else None


def _sessions_of(trials: pd.DataFrame) -> list[tuple[str, str]]:
    told = trials[["participant", "session"]].drop_duplicates()
    return list(told.itertuples(index=False, name=None))
