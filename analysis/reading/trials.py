"""Result files to one checked table, of trials or of counts; every fault with file and line."""

from __future__ import annotations

import math
import re
from collections import Counter
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import chain, groupby
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, cast

import numpy as np
import pandas as pd

from analysis.codes import WarningCode
from analysis.numbers import TOTAL
from analysis.reading.cells import CellReader, read_columns, refuse_first
from analysis.reading.columns import COUNTED_COLUMNS, FORCED, YES_NO, ColumnMap
from analysis.reading.foreign import (
    MAX_CONDITIONS,
    MAX_PRESENTED,
    NO_STIMULUS,
    UNNUMBERED,
    RowFilter,
    UnusedColumns,
    read_external,
    read_texts,
    sum_counts,
    with_responses,
)
from analysis.reading.session import (
    InputFile,
    read_missing,
    read_own_texts,
    read_record,
)
from analysis.reading.sources import FILE, TABLE, find_sources
from analysis.reading.text import ResultFileError, named, one_line, shown
from analysis.task_columns import with_task
from experiment.names import NOT_AVAILABLE
from experiment.record.rows import COLUMNS, columns_of, format_value
from experiment.tasks import LEFT_RIGHT_BOTH, TASKS, make_task
from experiment.tasks.task import BLANK, BOTH, SINGLE
from experiment.trial.plan import HANDS_OFF, PRACTICE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from contextlib import AbstractContextManager

    from analysis.axis import Axis
    from analysis.reading.session import SessionProgress, SessionRecord
    from analysis.reading.sources import InputTable
    from experiment.tasks.task import Scoring, Task
    from experiment.trial.plan import Plan


MAX_PARTICIPANTS: Final = 1_000
MAX_LEVELS: Final = 50_000
_LIMITS: Final = {
    "condition": (MAX_CONDITIONS, "conditions"),
    "participant": (MAX_PARTICIPANTS, "participants"),
    "level_vpp": (MAX_LEVELS, "levels"),
}
MIN_LEVEL_VPP, MAX_LEVEL_VPP = 1e-6, 1e6
MIN_MEDIAN_RT_S, MAX_MEDIAN_RT_S = 0.01, 10.0
COMPARISON: Final = "comparison"
"""What no column map has: two stimuli are compared, one of them the reference."""
_BATCH_ROWS: Final = 8_192
_BY_PLAN: Final = "by the plan of the session"
_WORDS: Final = ("side", "response")
"""The columns whose words are those of the task."""
_TASK_OF_SCORING: Final[Mapping[Scoring, str]] = {
    "yes-no": YES_NO,
    "forced-choice": FORCED,
    "discrimination": COMPARISON,
    "identification": FORCED,
}
"""What a column map would call a task that is scored so."""
_KEY: Final = ["participant", "session", "trial", "attempt"]
_NEVER_COUNTED: Final = (PRACTICE, HANDS_OFF)
_OF_TRIAL: Final = ("condition", "block", "kind", "side", "level_vpp")
_OF_PLAN: Final = ("participant", "session", "study_sha256", "response_window_s")
_DECIMAL: Final = re.compile(r"\d+(\.0*)?", re.ASCII)
_MIN_SAME_TRIALS: Final = 10
_MIN_BLANKS, _MAX_FALSE_ALARMS = 10, 0.5
_REPEATED: Final = (
    '; if each block numbers its trials from 1, set [columns] trial = "" in the column map; '
    f'if each file is a session, set session = "{FILE}"; if each file is a participant, '
    f'participant = "{FILE}"; [rows.skip] {FILE} leaves out a run that was restarted'
)
UNANSWERED: Final = "unanswered"
"""Reason of a trial without an answer in a choice between intervals or sites."""
NEVER_ANSWERED: Final = "never_answered"
"""Reason of a participant's trials in a condition where every one that would count timed out."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadedTrials:
    r"""Checked trials and the files they come from.

    Attributes
    ----------
    trials : pandas.DataFrame
        The trials, as `read_trials` returns them.
    paths : tuple of Path
        The tables that were read.
    inputs : tuple of InputFile
        The tables, their plans and the map, in the order of their names.
    without_table : mapping of str to str
        Session folders that hold no trials.csv, and the remedy for each.
    progress : tuple of SessionProgress
        The progress of each session that has a plan.
    axis : Axis
        Quantity, unit and scale of the levels.
    altered : mapping of str to tuple of str
        Differences of a session from its record, a line each, by the path of its table.
    lost : mapping of str to tuple of str
        Sessions that the record or other files name, but that have no table: the reasons.
    not_compared : tuple of str
        Names of the tables that were not compared with a journal, because there is none.
    alternatives : int or None
        Alternatives of a forced choice, as a map states them; None if the task of the sessions
        defines them.
    task : str
        The task that the map states, as `ColumnMap.task`, or its equivalent for sessions.
    session_task : Task
        The task of the sessions; external tables are translated into left-right-both.
    cells : pandas.DataFrame or None
        Cells of a table of counts, as `analysis.reading.foreign.sum_counts` returns them; such a
        table has no trials.
    blanks : pandas.DataFrame or None
        Cells of its blank presentations.
    warnings : tuple of tuple
        The code and the data of each warning that the map may misread an external table.
    left_out : int
        Rows that a map leaves out.
    left_out_files : int
        Files that a map leaves out by their names; their rows are not counted.
    left_out_by : str
        The keys of the map that leave out rows; if there are several, with the rows of each.
    numbered : bool
        Whether the tables number their trials; the order of rows is not the order of trials.
    side_told : bool
        Whether the tables have a side; false if a map states one for all rows.

    Examples
    --------
    `read_inputs` returns one:

    >>> from tempfile import TemporaryDirectory
    >>> from analysis import ColumnMap, read_inputs
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response\n1,left,60,left\n")
    ...     loaded = read_inputs([table], ColumnMap())
    >>> loaded.trials["level_vpp"].tolist(), loaded.numbered, loaded.alternatives
    ([60.0], False, 2)
    >>> loaded.session_task.name
    'left-right-both'
    """

    trials: pd.DataFrame
    paths: tuple[Path, ...]
    inputs: tuple[InputFile, ...]
    without_table: Mapping[str, str]
    progress: tuple[SessionProgress, ...]
    axis: Axis
    altered: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    lost: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    not_compared: tuple[str, ...] = ()
    alternatives: int | None = 2
    task: str = ""
    session_task: Task = LEFT_RIGHT_BOTH
    cells: pd.DataFrame | None = None
    blanks: pd.DataFrame | None = None
    warnings: tuple[tuple[WarningCode, dict[str, object]], ...] = ()
    left_out: int = 0
    left_out_files: int = 0
    left_out_by: str = ""
    numbered: bool = True
    side_told: bool = True


def read_trials(paths: Sequence[str | Path], columns: ColumnMap | None = None) -> pd.DataFrame:
    """Read result files into one table of trials.

    Parameters
    ----------
    paths : sequence of str or Path
        CSV files or folders. In a folder, all ``sub-*/ses-*/trials.csv`` are read; in a ``sub-*``
        or ``ses-*`` folder, those below it. Nothing else in a folder is read.
    columns : ColumnMap, optional
        Names of the columns in external tables.

    Returns
    -------
    pandas.DataFrame
        One row per trial. It has the columns of `experiment.COLUMNS`: text for identifiers,
        categoricals for words, int64, float64 (NaN for a missing value), bool, and nullable boolean
        for ``correct`` and ``noise_ok``. ``level_vpp`` is NaN if there is no stimulus. Further
        columns:

        - ``file`` and ``line``: the position of the row.
        - ``task`` and ``sites``: the name of the task, and its sites separated by slashes.
        - ``none_offered``: whether "none" could be answered, by the plan of the session. Without a
          plan it is true if the map states yes or no, or if a participant gave this answer in the
          same condition of the same study; else unknown.
        - ``reason``: why the trial does not count; empty if it counts.
        - ``fault``: a fault of the trial, whatever its kind.

    Raises
    ------
    ResultFileError
        If a file is not a well-formed table of trials.
    ValueError
        If the map has a section ``[table]``, because counts are not trials.

    Examples
    --------
    >>> read_trials(["nowhere.csv"])
    Traceback (most recent call last):
    analysis.reading.text.ResultFileError: nowhere.csv: no such file or folder
    """
    if columns is not None and columns.table:
        raise ValueError("columns must be a map of trials, got one with [table]")
    return read_inputs(paths, columns).trials


def read_inputs(
    paths: Sequence[str | Path],
    columns: ColumnMap | None = None,
    *,
    watched: Callable[
        [Sequence[InputTable]], AbstractContextManager[Iterable[InputTable]]
    ] = nullcontext,
    accept_altered: bool = False,
) -> LoadedTrials:
    r"""Read result files as `read_trials` does, with the names of these files.

    Parameters
    ----------
    paths, columns
        As `read_trials`.
    watched : callable
        Takes the tables that are to be read and returns them one after the other, for a progress
        bar.
    accept_altered : bool
        Whether sessions are read that are not as they were recorded.

    Returns
    -------
    LoadedTrials

    Raises
    ------
    ResultFileError
        As `read_trials`.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from analysis import ColumnMap, read_inputs
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response\n1,left,60,left\n")
    ...     loaded = read_inputs([table], ColumnMap())
    >>> len(loaded.trials), [file.name for file in loaded.inputs]
    (1, ['table.csv'])
    """
    sources, missing = find_sources([Path(path) for path in paths], foreign=columns is not None)
    without_table, lost = read_missing(missing, accept_altered=accept_altered)
    reader = _Reader(columns, accept_altered=accept_altered)
    tables = [source for source in sources if reader.filter.reads(source.about)]
    with watched(tables) as watched_tables:
        rows = reader.read(watched_tables)
    reader.filter.refuse_unmet(str(paths[0]))
    left_out = reader.filter.left_out.total()
    left_out_by = reader.filter.format_keys() if left_out else ""
    if rows.empty:
        message = "no session here has a trial yet"
        if sources and not tables:
            message = f"all files are left out by {reader.filter.format_keys()}"
        elif not tables:
            reason = next(iter([*without_table.values(), *sum(lost.values(), ())]))
            message = f"no session in this folder has a {TABLE}; {reason}"
        elif left_out_by:
            message = f"all {left_out} rows are left out by {left_out_by}"
        raise ResultFileError(tables[0].path if tables else paths[0], None, message)
    with_rows = {*rows["file"]}
    records = reader.records
    _refuse_copies({file: record for file, record in records.items() if file in with_rows})
    cells, blanks = None, None
    if columns and columns.table:
        cells, blanks = _check_counts(rows, columns, reader.unused)
        if cells.empty:
            raise ResultFileError(tables[0].path, None, "nothing was presented in any row")
        trials = no_rows()
    else:
        trials = _check_trials(rows, columns, records, reader.task)
    inputs = [file for record in records.values() for file in record.inputs]
    if columns and columns.sha256:
        inputs.append(InputFile(name=one_line(columns.name), sha256=columns.sha256))
    checked = trials if cells is None else rows
    column_map = columns or ColumnMap()
    return LoadedTrials(
        trials=trials,
        paths=tuple(table.path for table in tables),
        inputs=tuple(sorted(inputs)),
        without_table=without_table,
        progress=_count_rows(trials, records),
        axis=column_map.axis,
        altered={file: record.altered for file, record in records.items() if record.altered},
        lost=lost,
        not_compared=tuple(
            record.inputs[0].name
            for file, record in records.items()
            if file in with_rows and not (record.compared or columns)
        ),
        alternatives=column_map.alternatives if columns else None,
        task=column_map.task or _TASK_OF_SCORING.get(reader.task.scoring, ""),
        session_task=reader.task,
        cells=cells,
        blanks=blanks,
        warnings=tuple(_find_warnings(checked, columns, reader.unused)) if columns else (),
        left_out=left_out,
        left_out_files=len(sources) - len(tables),
        left_out_by=left_out_by,
        numbered=cells is not None or bool(rows["trial"].ne(UNNUMBERED).all()),
        side_told=cells is not None or not _has_one_site(trials, column_map),
    )


def _has_one_site(trials: pd.DataFrame, columns: ColumnMap) -> bool:
    """Return whether the table has one site, and which one is the map's own choice."""
    if "side" in columns.constant:
        return True
    sites = {*columns.values.get("side", {}).values()} - {NO_STIMULUS}  # noqa: PD011 (of a map)
    is_only = {*trials["side"].astype(object)} <= {*sites, NO_STIMULUS}
    return len(sites) == 1 and "response" not in columns.columns and is_only


class _Reader:
    """Tables read one after the other, typed in batches that bound the memory.

    A call of pandas costs as much for many rows as for one, so that those of small tables are typed
    together.
    """

    def __init__(self, columns: ColumnMap | None, *, accept_altered: bool) -> None:
        self.columns = columns
        self.accept_altered = accept_altered
        self.filter = RowFilter((columns or ColumnMap()).rows.filters())
        self.unused = UnusedColumns()
        self.records: dict[str, SessionRecord] = {}
        self.plans: dict[str, Plan] = {}
        self.task = LEFT_RIGHT_BOTH
        self._first = ""

    def read(self, tables: Iterable[InputTable]) -> pd.DataFrame:
        """Return the typed rows of all tables."""
        n_rows = 0

        def batch_of(texts: pd.DataFrame) -> tuple[object, ...]:
            nonlocal n_rows
            n_rows += len(texts)
            return n_rows // _BATCH_ROWS, *texts.columns

        batches = groupby(self._read_texts(tables), batch_of)
        frames = [self._type(pd.concat(texts, ignore_index=True)) for _, texts in batches]
        return pd.concat(frames or [no_rows()], ignore_index=True)

    def _read_texts(self, tables: Iterable[InputTable]) -> Iterator[pd.DataFrame]:
        """Yield rows of text under our names, with the file and the line of each."""
        for table in tables:
            file = str(table.path)
            record, raw, plan = read_record(table, accept_altered=self.accept_altered)
            if not self.columns:
                self._require_same_task(file, record)
            self.records[file] = record
            if plan:
                self.plans[file] = plan
            if self.columns:
                chunks = read_texts(raw, table, self.columns, self.filter, self.unused)
            else:
                empty_allowed = record.progress is not None
                chunks = read_own_texts(raw, table.path, self.task, empty_allowed=empty_allowed)
            for texts in chunks:
                # As objects: a file's name need not be text that can be encoded.
                files = np.full(len(texts), file, dtype=object)
                yield texts.assign(file=files, line=texts.index.astype(np.int64))

    def _type(self, texts: pd.DataFrame) -> pd.DataFrame:
        if self.columns is None:
            _refuse_words(texts, self.task)
            rows = with_task(read_columns(texts, _readers(self.task)), self.task)
        else:
            rows = read_external(texts, self.columns)
        files = rows["file"].unique()
        plans = {file: self.plans[file] for file in files if file in self.plans}
        if plans and "trial" in rows:
            _refuse_broken(rows, _plan_rules(rows, plans), self.columns)
        for file in files[:-1]:  # the next batch may begin with more rows of the last file
            self.plans.pop(file, None)
        return rows

    def _require_same_task(self, file: str, record: SessionRecord) -> None:
        """Refuse a session of another task, or with another reference, than those before it.

        A table without its plan has the words of left-right-both.
        """
        task = record.progress.plan.task if record.progress else LEFT_RIGHT_BOTH
        without_plan = "" if record.progress else " (without a plan.json)"
        first, name = self.task, self._first
        self.task, self._first = task, self._first or file
        if name and _name_task(task) != _name_task(first):
            message = (
                f"the task is {_name_task(task)}{without_plan}, that of {one_line(name)} is "
                f"{_name_task(first)}; analyze sessions of different tasks one by one"
            )
            raise ResultFileError(file, None, message)


def _name_task(task: Task) -> str:
    of_reference = f" with a reference of {task.reference_vpp or 0.0:g} Vpp" * task.has_reference
    return f"{task.name} at {', '.join(task.sites)}{of_reference}"


def _readers(task: Task) -> tuple[CellReader, ...]:
    return tuple(CellReader(column=column, label=column.name) for column in columns_of(task))


def _refuse_words(texts: pd.DataFrame, task: Task) -> None:
    """Refuse the first word of another task, because only a plan states the task of a table."""
    tasks = [make_task(name) for name in TASKS]
    for name in _WORDS:
        words, *others = (
            {word for column in columns_of(each) if column.name == name for word in column.choices}
            for each in (task, *tasks)
        )
        is_foreign = texts[name].isin(set().union(*others) - words)
        message = (
            f"column '{name}' holds {_first_cell(texts[name], is_foreign)}, a word of another task "
            f"than {task.name}; tactstrip reads a table of another task only next to its plan.json"
        )
        refuse_first(texts, is_foreign, message)


def _refuse_copies(records: Mapping[str, SessionRecord]) -> None:
    first: dict[str, str] = {}
    for file, record in records.items():
        before = first.setdefault(record.inputs[0].sha256, file)
        if before != file:
            raise ResultFileError(file, None, f"the same contents as {one_line(before)}")


def _count_rows(
    trials: pd.DataFrame, records: Mapping[str, SessionRecord]
) -> tuple[SessionProgress, ...]:
    """Return how far sessions came: planned trials are numbered from 1 on, and warm-up after."""
    sessions = {file: record.progress for file, record in records.items() if record.progress}
    planned = trials["file"].map({file: each.planned for file, each in sessions.items()})
    is_valid = trials["status"].eq("ok") & trials["trial"].le(planned)
    rows, valid = Counter(trials["file"]), Counter(trials.loc[is_valid, "file"])
    return tuple(
        replace(each, valid=valid[file], unexported=max(0, each.unexported - rows[file]))
        for file, each in sessions.items()
    )


def no_rows() -> pd.DataFrame:
    """Return a table of trials without a trial.

    >>> len(no_rows()), no_rows()["level_vpp"].dtype
    (0, dtype('float64'))
    """
    texts = pd.DataFrame(columns=[*(column.name for column in COLUMNS), "file", "line"])
    rows = read_columns(texts.astype({"line": np.int64}), _readers(LEFT_RIGHT_BOTH))
    rows = _with_verdicts(rows, LEFT_RIGHT_BOTH)
    return with_reasons(rows.assign(none_offered=pd.array([], dtype="boolean")))


def _check_trials(
    rows: pd.DataFrame,
    columns: ColumnMap | None,
    records: Mapping[str, SessionRecord],
    task: Task,
) -> pd.DataFrame:
    """Return rows as numbered trials with all columns; refuse those that break a rule."""
    column_map = columns or ColumnMap()
    rows = _with_numbers(with_responses(rows, column_map))
    rows = _with_verdicts(rows, task)
    stimulus = has_stimulus(rows, task)
    plans = {file: record.progress.plan for file, record in records.items() if record.progress}
    offers_none = {file: plan.task.nothing in plan.responses for file, plan in plans.items()}
    rules = chain(
        _name_rules(rows),
        _trial_rules(rows, column_map, task),
        _level_rules(rows["level_vpp"], stimulus, column_map),
        _time_rules(rows[~rows["file"].isin(offers_none)], column_map),
        _repeat_rules(rows),
    )
    _refuse_broken(rows, rules, columns)
    by_plan = rows["file"].map(offers_none).astype("boolean")
    rows["none_offered"] = offered_to_all(rows, by_plan, task=column_map.task)
    rows["level_vpp"] = rows["level_vpp"].where(stimulus)
    return without_unanswered(without_silence(with_reasons(rows)), task)


def _with_numbers(rows: pd.DataFrame) -> pd.DataFrame:
    """Give trials without a number a running one, within participant and session.

    Numbers of a session that count from 0, as those of PsychoPy do, count from 1 then.
    """
    sessions = rows.groupby(["participant", "session"])["trial"]
    numbers = rows["trial"].mask(rows["trial"].eq(UNNUMBERED), sessions.cumcount() + 1)
    if numbers.eq(0).any():
        numbers += sessions.transform("min").eq(0)
    return rows.assign(trial=numbers)


def has_stimulus(rows: pd.DataFrame, task: Task) -> pd.Series[bool]:
    """Return whether the trial of each row has a stimulus.

    >>> has_stimulus(pd.DataFrame({"side": ["right", "none"]}), LEFT_RIGHT_BOTH).tolist()
    [True, False]
    """
    silent = [shown.name for shown in task.presentations if not shown.sites]
    return ~rows["side"].isin(silent)


def _with_verdicts(rows: pd.DataFrame, task: Task) -> pd.DataFrame:
    """Fill in ``correct``; return the columns of trials.csv, the position of rows, and the task."""
    rows["correct"] = rows["correct"].astype("boolean").fillna(expected_correct(rows, task))
    rows = rows[[*(column.name for column in columns_of(task)), "file", "line"]]
    return with_task(rows, task)


def expected_correct(rows: pd.DataFrame, task: Task = LEFT_RIGHT_BOTH) -> pd.Series[Any]:
    """Return for each row whether its response is correct, as the task defines it.

    Unknown without an answer, and where the level equals the reference.

    >>> expected_correct(pd.DataFrame({"kind": ["both"], "side": ["both"], "response": ["right"]}))
    0    False
    dtype: boolean
    """
    response, sides = rows["response"].astype(object), rows["side"].astype(object)
    is_correct = response.eq(sides.map({each.name: each.correct for each in task.presentations}))
    unknown = response.isna()
    if (reference_vpp := task.reference_vpp) is not None:
        below = sides.map({each.name: each.correct_below for each in task.presentations})
        is_correct = is_correct.mask(rows["level_vpp"].lt(reference_vpp), response.eq(below))
        unknown |= rows["level_vpp"].eq(reference_vpp)
    return is_correct.astype("boolean").mask(unknown)


def offered_to_all(
    trials: pd.DataFrame, by_plan: pd.Series[Any], *, task: str = ""
) -> pd.Series[Any]:
    """Return for each row whether "none" was an answer, as far as plan, map or answers say.

    "none" was an answer for everybody in a condition of a study if anybody gave it there: who never
    felt nothing, or never said so, had the same keys. External tables name no study, and are one.
    What a plan says of its own session stays. Hands-off trials say nothing: "none" is always an
    answer there.

    >>> trials = pd.DataFrame({"condition": ["a", "a", "b"], "study_sha256": "n/a",
    ...     "response": ["none", "right", "right"], "kind": "single"})
    >>> offered_to_all(trials, pd.Series([None] * 3, dtype="boolean")).tolist()
    [True, True, <NA>]
    """
    if task:
        return by_plan.fillna(task == YES_NO)
    is_none = trials["response"].eq(str(LEFT_RIGHT_BOTH.nothing)) & trials["kind"].ne(HANDS_OFF)
    is_offered = by_plan.fillna(is_none.astype("boolean"))
    anybody = is_offered.groupby([trials["condition"], trials["study_sha256"]]).transform("any")
    return by_plan.mask(by_plan.isna() & anybody, other=True)


class _Rule(NamedTuple):
    """A column, what it must be, the rows that break this, and what of a map may mend it."""

    column: str
    must: str
    broken: pd.Series[bool]
    remedy: str = ""


def _refuse_broken(rows: pd.DataFrame, rules: Iterable[_Rule], columns: ColumnMap | None) -> None:
    """Refuse the first row that breaks a rule, by the first rule that it breaks."""
    broken = [(cast("int", rule.broken.idxmax()), rule) for rule in rules if rule.broken.any()]
    if not broken:
        return
    row, rule = min(broken, key=itemgetter(0))
    label = (columns or ColumnMap()).label(rule.column)
    cell = _first_cell(rows[rule.column], rule.broken)
    message = f"column '{label}' is {cell}; it must be {rule.must}{rule.remedy if columns else ''}"
    raise ResultFileError(rows["file"][row], int(rows["line"][row]), message)


def _first_cell(values: pd.Series[Any], broken: pd.Series[bool]) -> str:
    """Return the value in the first row that breaks a rule, if there is one."""
    if not broken.any():
        return ""
    value = values.astype(object)[cast("int", broken.idxmax())]  # plain values of Python
    return NOT_AVAILABLE if pd.isna(value) else format_value(value)


def _plan_rules(rows: pd.DataFrame, plans: Mapping[str, Plan]) -> Iterator[_Rule]:
    """Yield the rules by which a plan checks each row of a table that has no journal."""
    task = next(iter(plans.values())).task
    of_trial, of_plan = attrgetter("number", *_OF_TRIAL), attrgetter(*_OF_PLAN)
    trials = [
        (
            *(file, *of_trial(trial), *of_plan(plan)),
            *(", ".join(plan.answers_to(trial)), plan.is_chosen(trial)),
        )
        for file, plan in plans.items()
        for trial in (*plan.trials, *plan.warm_up)
    ]
    key = ["file", "trial"]
    names = [*key, *_OF_TRIAL, *_OF_PLAN, "response", "is_chosen"]
    planned = rows[key].join(pd.DataFrame(trials, columns=names).set_index(key), on=key)
    is_planned = planned["kind"].notna()
    unplanned = rows["file"].isin(plans) & ~is_planned
    yield _Rule("trial", f"the number of a planned trial {_BY_PLAN}", unplanned)
    rows = rows.assign(level_vpp=rows["level_vpp"].where(has_stimulus(rows, task)))
    for name in (*_OF_TRIAL, "participant", "session", "study_sha256"):
        value, due = rows[name].astype(object), planned[name]
        differs = is_planned & value.ne(due) & ~(value.isna() & due.isna())
        if name == "level_vpp":  # the plan has no level that a rule chooses
            differs &= ~planned["is_chosen"].fillna(value=False).astype(bool)
        yield _Rule(name, f"{_first_cell(due, differs)} {_BY_PLAN}", differs)
    if "response" in rows:
        pairs = zip(rows["response"].astype(object), planned["response"], strict=True)
        undeclared = is_planned & np.array(
            [r in task.answer_names and r not in str(due).split(", ") for r, due in pairs]
        )
        must = f"{_first_cell(planned['response'], undeclared)}, timeout or invalid {_BY_PLAN}"
        yield _Rule("response", must, undeclared)
    late = rows["rt_s"].gt(planned["response_window_s"])
    window = _first_cell(planned["response_window_s"], late)
    yield _Rule("rt_s", f"at most the response window, {window}, {_BY_PLAN}", late)


def _name_rules(rows: pd.DataFrame) -> Iterator[_Rule]:
    """Yield the most values of columns, and that no participant has the name of the totals."""
    for name, (maximum, plural) in _LIMITS.items():
        codes, _ = pd.factorize(rows[name])  # counted in the order of the rows
        is_beyond = pd.Series(codes >= maximum, index=rows.index)
        yield _Rule(name, f"one of at most {maximum} {plural}", is_beyond)
    must = "another name, for this is the name of the total's row"
    yield _Rule("participant", must, rows["participant"].eq(TOTAL))


def _trial_rules(rows: pd.DataFrame, columns: ColumnMap, task: Task) -> Iterator[_Rule]:
    kind, side, response = rows["kind"], rows["side"], rows["response"]
    for name in task.kinds:
        sides = [presentation.name for presentation in task.of_kind(name)]
        must = f"{' or '.join(sides)} in a {name} trial"
        yield _Rule("side", must, kind.eq(name) & ~side.isin(sides))
    negative = kind.ne(HANDS_OFF) & rows["block"].lt(0)
    rehearsed = rows["device_kind"].eq("rehearsal").fillna(value=False)
    yield _Rule("device_kind", "of another session: no rehearsal is analyzed", rehearsed)
    yield _Rule("block", "0 or more in any but a hands-off trial", negative)
    missing = rows["status"].eq("ok") & response.isna()
    yield _Rule("response", "an answer, timeout or invalid where the status is ok", missing)
    timed = rows["rt_s"].notna() & (response.isna() | response.eq("timeout"))
    yield _Rule("rt_s", "n/a where there was no answer", timed)
    wrong = rows["correct"].ne(expected_correct(rows, task)).fillna(value=True)
    yield _Rule("correct", "what kind, side and response say", rows["correct"].notna() & wrong)
    has_responses = not columns.task or "response" in columns.named()
    if has_responses and "side" in columns.constant:
        # One site for all stimuli, where answers name several: each of the others would be a miss.
        site = columns.constant["side"]
        is_named = response.isin(LEFT_RIGHT_BOTH.sites)
        names = sorted({*response[is_named].astype(object)})
        remedy = (
            ", because [constant] side gives all stimuli this site, but answers name "
            f"{' and '.join(names)}; name the column of the site in [columns] side or, if "
            "participants only answered felt or not felt, map detected instead of response"
        )
        yield _Rule("response", site, is_named & response.ne(site) & (len(names) > 1), remedy)


def _level_rules(
    level: pd.Series[float], stimulus: pd.Series[bool], columns: ColumnMap
) -> Iterator[_Rule]:
    smallest, largest, bounds = MIN_LEVEL_VPP, MAX_LEVEL_VPP, " from 1e-06 to 1e+06"
    if columns.axis.signed:
        smallest, largest, bounds = -math.inf, math.inf, ""
    remedy = (
        '; a map makes blanks of empty cells by [values.level_vpp] "" = '
        f'"{"-inf" if columns.axis.signed else 0}", and micrometres of metres by [scale] '
        'level_vpp = 1e6, [axis] unit = "um"'
    )
    must = f"a number{bounds} where there is a stimulus"
    yield _Rule("level_vpp", must, stimulus & ~level.between(smallest, largest), remedy)
    silent = ~stimulus & level.notna() & level.ne(0)
    yield _Rule("level_vpp", "0 or n/a where there is no stimulus", silent)


def _time_rules(trials: pd.DataFrame, columns: ColumnMap) -> Iterator[_Rule]:
    """Yield that medians are in seconds; a plan has a closer rule, its response window."""
    median_s = trials.groupby("participant")["rt_s"].transform("median").round(6)
    odd = ~median_s.between(MIN_MEDIAN_RT_S, MAX_MEDIAN_RT_S) & trials["rt_s"].ge(median_s)
    unit = columns.units.get("rt_s", "s")
    must = (
        f"in seconds; participant {_first_cell(trials['participant'], odd)} has a median of "
        f"{_first_cell(median_s, odd)} s, allowed {MIN_MEDIAN_RT_S:g} to {MAX_MEDIAN_RT_S:g} s; "
        f'these are read as {unit}, and milliseconds where a map says [units] rt_s = "ms"'
    )
    yield _Rule("rt_s", must, odd)


def _repeat_rules(trials: pd.DataFrame) -> Iterator[_Rule]:
    """Yield that no trial occurs twice, except practice, which is warm-up after every resume."""
    must = "another than for the same participant, session and attempt"
    yield _repeat_rule("trial", must, trials, _KEY, _REPEATED)
    valid = trials[trials["status"].eq("ok") & trials["kind"].ne(PRACTICE)]
    must = "the only one of its trial with status ok"
    yield _repeat_rule("attempt", must, valid, _KEY[:-1], _REPEATED)


def _repeat_rule(column: str, must: str, rows: pd.DataFrame, key: list[str], remedy: str) -> _Rule:
    """Return the rule that no two rows have the same values of key; the first is named."""
    repeated = rows.duplicated(key)
    if repeated.any():
        groups = rows.groupby(key, dropna=False, observed=True)[["file", "line"]]
        file, line = groups.transform("first")[repeated].iloc[0]
        must = f"{must}; the first is {one_line(file)}:{line}"
    return _Rule(column, must, repeated, remedy)


def _check_counts(
    rows: pd.DataFrame, columns: ColumnMap, unused: UnusedColumns
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the cells and the blanks of a table of counts; refuse rows that break a rule."""
    presented, single = rows["presented"], rows["kind"].eq("single")
    is_above = rows["detected"].gt(presented)
    number = f"{_first_cell(presented, is_above)} in column {shown(columns.label('presented'))}"
    key = [name for name in COUNTED_COLUMNS if name in rows]
    aside = unused.varying()
    # Rows of one cell are blocks, which are summed, if nothing distinguishes them.
    distinct = rows if aside else rows.drop_duplicates(["file", *key])
    column = [*aside, FILE][0]
    remedy = (
        f'; if {column} holds conditions, the map needs [table] group = ["{column}"], if it holds '
        f'people, [columns] participant = "{column}", and if it numbers blocks, '
        f'session = "{column}"'
    )
    rules = [
        *_name_rules(rows),
        _Rule("kind", "single or blank", ~rows["kind"].isin(["single", "blank"])),
        *_level_rules(rows["level_vpp"], single, columns),
        _Rule("detected", f"at most what was presented, {number}", is_above),
        _Rule("presented", f"at most {MAX_PRESENTED:.0e}", presented.gt(MAX_PRESENTED)),
        _repeat_rule("level_vpp", "counted once", distinct, key, remedy),
    ]
    if "side" in rows:
        must = f"{' or '.join(LEFT_RIGHT_BOTH.sites)}, for single stimuli are counted"
        rules.append(_Rule("side", must, single & ~rows["side"].isin(LEFT_RIGHT_BOTH.sites)))
    _refuse_broken(rows, rules, columns)
    return sum_counts(rows, columns)


def _find_warnings(
    rows: pd.DataFrame, columns: ColumnMap, unused: UnusedColumns
) -> Iterator[tuple[WarningCode, dict[str, object]]]:
    """Yield what an external table may mean otherwise than its map has it."""
    if columns.columns.get("condition") != "" and (names := unused.names()):
        yield WarningCode.CONDITIONS_POOLED, {"columns": named(names)}
    for column in ("participant", "condition"):
        spellings = pd.Series(rows[column].astype(str).unique())
        groups = spellings.groupby(spellings.map(_spelling), sort=False)
        if alike := [" and ".join(map(repr, group)) for _, group in groups if len(group) > 1]:
            yield WarningCode.NAMES_ALIKE, {"column": column, "names": named(alike)}
    if columns.table:
        return
    content = rows[["trial", "side", "level_vpp", "response", "rt_s"]]
    hashes = pd.util.hash_pandas_object(content, index=False)
    first: dict[bytes, str] = {}
    for file, of_file in hashes.groupby(rows["file"], sort=False):
        name = one_line(Path(str(file)).name)
        before = first.setdefault(of_file.to_numpy().tobytes(), name)
        if before != name and of_file.nunique() >= _MIN_SAME_TRIALS:
            data = {"first": before, "second": name, "trials": len(of_file)}
            yield WarningCode.SAME_TRIALS_TWICE, data
    blank = rows[rows["reason"].eq("") & rows["kind"].eq("blank")]
    detected = blank["response"].isin(LEFT_RIGHT_BOTH.named_answers)
    if len(blank) >= _MIN_BLANKS and detected.mean() > _MAX_FALSE_ALARMS:
        data = {"share": float(detected.mean()), "blanks": len(blank)}
        yield WarningCode.BLANKS_MOSTLY_DETECTED, data


def _spelling(name: str) -> str:
    """Return a name without blanks, capitals, leading zeros and a decimal part of zeros."""
    text = name.strip().casefold()
    return str(int(text.partition(".")[0])) if _DECIMAL.fullmatch(text) else text


def with_reasons(trials: pd.DataFrame) -> pd.DataFrame:
    """Return trials with the columns ``reason`` and ``fault``.

    ``reason`` is why a trial is left out of all counts, the first that holds of: its kind
    (``practice``, ``hands_off``), a status other than ``ok``, ``premature``, ``unmasked``,
    ``unverified``; empty text where it counts. ``fault`` is the same whatever the kind: hands-off
    trials are counted by themselves, and those with a fault not even there.

    >>> trials = with_reasons(pd.DataFrame({"kind": ["single", "single", "hands_off"],
    ...     "status": ["ok", "ok", "voided"], "premature": [True, False, False],
    ...     "noise_ok": [None, False, True], "burst_verified": [None, "false", "line"]}))
    >>> trials[["reason", "fault"]].to_numpy().T.tolist()
    [['premature', 'unmasked', 'hands_off'], ['premature', 'unmasked', 'voided']]
    """
    kind, status = trials["kind"].astype(object), trials["status"].astype(object)
    fault = status.where(status.ne("ok"), "")
    # What is not known, be it of noise or of the burst, is no fault: most tables do not say.
    for name, holds in {
        "premature": trials["premature"].astype(bool),
        "unmasked": trials["noise_ok"].astype("boolean").eq(other=False).fillna(value=False),
        "unverified": trials["burst_verified"].astype(object).eq("false"),
    }.items():
        fault = fault.mask(fault.eq("") & holds.astype(bool), name)
    return trials.assign(reason=kind.where(kind.isin(_NEVER_COUNTED), fault), fault=fault)


def without_silence(trials: pd.DataFrame) -> pd.DataFrame:
    """Return trials `with_reasons`, those of a silent participant in a condition left out, too.

    A time-out among answers is a stimulus that was not detected. Without a single answer it may as
    well be a dead keyboard, which says nothing of a threshold.

    >>> trials = without_silence(pd.DataFrame({"participant": list("aabb"), "condition": "main",
    ...     "response": ["right", *["timeout"] * 3], "reason": ["", "", "", "voided"]}))
    >>> trials["reason"].tolist()
    ['', '', 'never_answered', 'voided']
    """
    counts = trials["reason"].eq("")
    answered = counts & trials["response"].astype(object).ne("timeout")
    key = [trials[name].astype(object) for name in ("participant", "condition")]
    silent = counts & ~answered.groupby(key).transform("any")
    return trials.assign(reason=trials["reason"].mask(silent, NEVER_ANSWERED))


def without_unanswered(trials: pd.DataFrame, task: Task) -> pd.DataFrame:
    """Return trials with those left out that have no answer, in a choice of intervals or sites.

    There, who does not answer has chosen nothing: counted as wrong, or as weaker, they would raise
    the threshold with every time-out.

    >>> trials = pd.DataFrame({"response": ["first", "timeout"], "reason": ""})
    >>> without_unanswered(trials, make_task("2ifc"))["reason"].tolist()
    ['', 'unanswered']
    """
    is_choice = task.scoring in {"forced-choice", "discrimination", "identification"}
    is_open = trials["reason"].eq("") & ~trials["response"].astype(object).isin(task.answer_names)
    return trials.assign(reason=trials["reason"].mask(is_open & is_choice, UNANSWERED))


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """How many of what; every trial is in exactly one of single, both, blank and left_out.

    Attributes
    ----------
    trials : int
        All trials that were read.
    single, both, blank : int
        Trials of this kind that count.
    left_out : int
        Trials that do not count.
    timeouts, invalid : int
        Trials that count, without an answer in time or with another key.
    participants, sessions, conditions : int
        Different ones among all trials read; a session belongs to a participant.
    simulated : int
        Trials of simulated participants.
    without_device : int
        Trials of people on a mock device or an emulator.
    unread, unread_files : int
        Rows and files that a map leaves out.
    """

    trials: int
    single: int
    both: int
    blank: int
    left_out: int
    timeouts: int
    invalid: int
    participants: int
    sessions: int
    conditions: int
    simulated: int
    without_device: int
    unread: int
    unread_files: int


def counts_of(loaded: LoadedTrials) -> Counts:
    """Count trials, or what a table of counts presented, each participant a session."""
    trials, cells, blanks = loaded.trials, loaded.cells, loaded.blanks
    counted = trials[trials["reason"].eq("")]
    numbers = {kind: int(counted["kind"].eq(kind).sum()) for kind in (SINGLE, BOTH, BLANK)}
    total = len(trials)
    people = trials[["participant", "session"]]
    if cells is not None:
        numbers["single"] = int(cells["presented"].sum())
        numbers["blank"] = 0 if blanks is None else int(blanks["presented"].sum())
        total, people = sum(numbers.values()), cells[["participant"]]
    return Counts(
        **numbers,
        trials=total,
        left_out=len(trials) - len(counted),
        timeouts=int(counted["response"].eq("timeout").sum()),
        invalid=int(counted["response"].eq("invalid").sum()),
        participants=people["participant"].nunique(),
        sessions=len(people.drop_duplicates()),
        conditions=(trials if cells is None else cells)["condition"].nunique(),
        simulated=int(trials["simulated"].sum()),
        without_device=int(without_device(trials).sum()),
        unread=loaded.left_out,
        unread_files=loaded.left_out_files,
    )


def without_device(trials: pd.DataFrame) -> pd.Series[bool]:
    """Return which trials are of a person whose device moves nothing.

    >>> kinds = {"simulated": [False, False, True], "device_kind": ["mock", None, "mock"]}
    >>> without_device(pd.DataFrame(kinds)).tolist()
    [True, False, False]
    """
    return ~trials["simulated"].astype(bool) & trials["device_kind"].isin(["mock", "emulated"])
