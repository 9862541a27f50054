"""Result files to one checked table, of trials or of counts; every fault with file and line."""

from __future__ import annotations

import gc
import hashlib
import math
import re
from collections import Counter
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, cast

import numpy as np
import pandas as pd

from analysis.axis import Axis
from analysis.codes import AnalysisWarning, WarningCode, with_code
from analysis.numbers import TOTAL
from analysis.reading.cells import CellReader, read_columns
from analysis.reading.columns import YES_NO, toml_entry
from analysis.reading.foreign import (
    MAX_CONDITIONS,
    MAX_PRESENTED,
    NO_STIMULUS,
    UNNUMBERED,
    RowFilter,
    UnusedColumns,
    read_count_rows,
    read_external,
    read_texts,
    refuse_repeated_counts,
    sum_counts,
    with_responses,
)
from analysis.reading.session import (
    EXPORTED_SUFFIX,
    PLAN,
    beside,
    check_plan,
    format_difference,
    left_out,
    own_columns,
    plan_rows,
    progress,
    read_record,
)
from analysis.reading.sources import FILE, TABLE, find_sources, unchanged, unreadable
from analysis.reading.text import ResultFileError, TextFormat, named, one_line, shown, text_chunks
from experiment.rows import (
    COLUMNS,
    HANDS_OFF,
    NOT_AVAILABLE,
    PRACTICE,
    RESPONSES,
    SCHEMA,
    SIDES,
    format_value,
)
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from contextlib import AbstractContextManager

    from analysis.reading.columns import ColumnMap, Table
    from analysis.reading.session import SessionProgress, SessionRecord
    from analysis.reading.sources import InputTable


MAX_PARTICIPANTS: Final = 1_000
MAX_LEVELS: Final = 50_000
_LIMITS: Final = {
    "condition": (MAX_CONDITIONS, "conditions"),
    "participant": (MAX_PARTICIPANTS, "participants"),
    "level_vpp": (MAX_LEVELS, "levels"),
}
MIN_LEVEL_VPP, MAX_LEVEL_VPP = 1e-6, 1e6
MIN_MEDIAN_RT_S, MAX_MEDIAN_RT_S = 0.01, 10.0
_NO_TOTAL: Final = "another name, for this is the name of the total's row"
_BATCH_ROWS: Final = 8_192
_EXPORTED: Final = TextFormat(delimiter="\t", quoted=False)
"""How `tactstrip export --bids` writes events."""
_READERS: Final = tuple(CellReader(column=column, label=column.name) for column in COLUMNS)
_KEY: Final = ["participant", "session", "trial", "attempt"]
_NEVER_COUNTED: Final = (PRACTICE, HANDS_OFF)
_NO_ANSWERS: Final = ("timeout", "invalid")
NEVER_ANSWERED: Final = "never_answered"
"""Reason of a participant's trials in a condition where every one that would count timed out."""


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class InputFile:
    """A file that was read: its name as `InputTable.name`, and the checksum of its bytes."""

    name: str
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadedTrials:
    r"""Checked trials and the files they come from.

    Attributes
    ----------
    trials : pandas.DataFrame
        As `read_trials` returns them.
    paths : tuple of Path
        The tables that were read.
    inputs : tuple of InputFile
        These, their plans and the map, in the order of their names.
    without_table : mapping of str to str
        Session folders that hold no trials.csv, and what can be done.
    progress : tuple of SessionProgress
        Of each session that has a plan, how far it came.
    axis : Axis
        What the levels are.
    altered : mapping of str to tuple of str
        By the path of its table, where a session is not as it was recorded, a line each.
    lost : mapping of str to tuple of str
        Sessions of which no table is left, though the record or other files name them: why.
    not_compared : tuple of str
        Names of the tables that have no journal beside them.
    alternatives : int
        Of a forced choice.
    task : str
        What the map states, as `ColumnMap.task`.
    cells : pandas.DataFrame or None
        Of a table of counts, its cells as `analysis.reading.foreign.sum_counts` gives them; there
        are no trials then.
    blanks : pandas.DataFrame or None
        The same of its blank presentations.
    changed : tuple of AnalysisWarning
        What an external table may mean otherwise than its map has it.
    left_out : int
        Rows that a map leaves out.
    left_out_files : int
        Files that a map leaves out by their names; their rows are not counted.
    left_out_by : str
        The keys of the map that leave out rows and, of several, how many each.
    numbered : bool
        Whether the tables number their trials, or else the order of their rows does.
    side_told : bool
        Whether the tables have a side; false where a map states one for all rows.

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
    alternatives: int = 2
    task: str = ""
    cells: pd.DataFrame | None = None
    blanks: pd.DataFrame | None = None
    changed: tuple[AnalysisWarning, ...] = ()
    left_out: int = 0
    left_out_files: int = 0
    left_out_by: str = ""
    numbered: bool = True
    side_told: bool = True


def read_trials(paths: Sequence[str | Path], columns: ColumnMap | None = None) -> pd.DataFrame:
    """Read result files as one table of trials, or refuse them.

    Parameters
    ----------
    paths : sequence of str or Path
        CSV files, or folders: of a folder all its ``sub-*/ses-*/trials.csv`` are read, of a
        ``sub-*`` or ``ses-*`` folder what lies below it. Nothing else in a folder is read.
    columns : ColumnMap, optional
        What the columns are called in external tables.

    Returns
    -------
    pandas.DataFrame
        One row per trial. The columns of `experiment.COLUMNS`: text for identifiers, categoricals
        for words, int64, float64 (NaN where there is no value), bool, nullable boolean for
        ``correct`` and ``noise_ok``. ``level_vpp`` is NaN where there is no stimulus. Then ``file``
        and ``line``, where the row stands, and ``none_offered``, whether "none" could be answered:
        by the plan beside the file; without one true where the map says yes or no, or anybody gave
        this answer in the same condition of the same study; else unknown. ``reason``, why the trial
        does not count, is empty text where it does; ``fault`` is what is amiss with it whatever its
        kind.

    Raises
    ------
    ResultFileError
        For everything that is not a well-formed table of trials; nothing is returned then.
    ValueError
        For a map with a section ``[table]``: counts are no trials.

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
        As `read_trials`, and for a table or a plan that changes while the others are read.

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
    sources = find_sources([Path(path) for path in paths], foreign=columns is not None)
    reading = _Reading(columns, accept_altered=accept_altered)
    tables = [source for source in sources.tables if reading.rows.reads(source.about)]
    if sources.tables and not tables:
        reading.rows.refuse_unmet(str(paths[0]))
        message = f"all files are left out by {reading.rows.format_keys()}"
        raise ResultFileError(paths[0], None, message)
    if not tables:
        missing = left_out(sources, accept_altered=accept_altered)
        why = [*missing.without_table.values(), *sum(missing.lost.values(), ())]
        message = f"no session in this folder has a {TABLE}; {why[0]}"
        raise ResultFileError(paths[0], None, message)
    files = [path for table in tables for path in (table.path, table.path.with_name(PLAN))]
    with unchanged(files), watched(tables) as watched_tables, no_search_for_circles():
        rows = reading.read(watched_tables)
    reading.rows.refuse_unmet(str(paths[0]))
    _refuse_copies(reading.tables)
    _refuse_nothing(reading)
    missing = left_out(sources, accept_altered=accept_altered)
    loaded = LoadedTrials(
        trials=rows,
        paths=tuple(table.path for table in tables),
        inputs=_input_files(reading.tables, columns),
        without_table=missing.without_table,
        lost=missing.lost,
        progress=tuple(table.progress for table in reading.tables if table.progress),
        axis=Axis() if columns is None else columns.axis,
        alternatives=2 if columns is None else columns.alternatives,
        task="" if columns is None else columns.task,
        altered={str(table.path): table.altered for table in reading.tables if table.altered},
        left_out=reading.left_out.total(),
        left_out_files=len(sources.tables) - len(tables),
        left_out_by=reading.rows.format_keys(reading.left_out) if reading.left_out else "",
        changed=tuple(
            with_code(WarningCode.CONDITIONS_POOLED, reading.unused.message())
            if columns and columns.columns.get("condition") != ""
            else ()
        ),
    )
    return (
        _with_counts(loaded, rows, columns, reading.unused.varying())
        if columns and columns.table
        else _with_trials(loaded, rows, columns, reading.tables)
    )


def _with_counts(
    loaded: LoadedTrials, rows: pd.DataFrame, columns: ColumnMap, aside: Sequence[str]
) -> LoadedTrials:
    refuse_repeated_counts(rows, aside)
    cells, blanks = sum_counts(rows, columns)
    if cells.empty:
        by = f"; {loaded.left_out} are left out by {loaded.left_out_by}" if loaded.left_out else ""
        raise ResultFileError(loaded.paths[0], None, f"nothing was presented in any row{by}")
    spellings = with_code(WarningCode.NAMES_ALIKE, _names_alike(rows))
    return replace(
        loaded,
        trials=with_reasons(no_rows()),
        cells=cells,
        blanks=blanks,
        changed=(*loaded.changed, *spellings),
    )


def _with_trials(
    loaded: LoadedTrials,
    rows: pd.DataFrame,
    columns: ColumnMap | None,
    tables: Sequence[ReadTable],
) -> LoadedTrials:
    numbered = bool(rows["trial"].ne(UNNUMBERED).all()) or _rows_in_order(rows, columns)
    trials = _with_numbers(rows)
    trials["none_offered"] = offered_to_all(trials)
    planned = frozenset(str(table.path) for table in tables if table.plan)
    _check_reaction_times(trials, planned, columns)
    trials = without_silence(with_reasons(trials))
    _refuse_repeats(trials, external=columns is not None)
    changed = loaded.changed
    not_compared: tuple[str, ...] = ()
    side_told = True
    if columns is None:
        not_compared = tuple(t.file.name for t in tables if t.trials and not t.compared)
    else:
        changed = (
            *changed,
            *with_code(WarningCode.NAMES_ALIKE, _names_alike(trials)),
            *with_code(WarningCode.SAME_TRIALS_TWICE, _same_trials_twice(trials)),
            *with_code(WarningCode.BLANKS_MOSTLY_DETECTED, _mostly_felt_blanks(trials)),
        )
        _refuse_lost_sites(trials, columns)
        side_told = not _has_one_site(columns, {*trials["side"].astype(object)})
    return replace(
        loaded,
        trials=trials,
        changed=changed,
        numbered=numbered,
        not_compared=not_compared,
        side_told=side_told,
    )


def _has_one_site(columns: ColumnMap, sides: set[str]) -> bool:
    """Return whether the table has one site, and which one is the map's own choice."""
    if "side" in columns.constant:
        return True
    sites = {*columns.values.get("side", {}).values()} - {NO_STIMULUS}  # noqa: PD011 (of a map)
    return len(sites) == 1 and "response" not in columns.columns and sides <= {*sites, NO_STIMULUS}


def _refuse_lost_sites(trials: pd.DataFrame, columns: ColumnMap) -> None:
    """Refuse one site for all stimuli where answers name several: each would be a miss."""
    if columns.task and "response" not in columns.named():
        return  # the answers are made of yes and no, or of right and wrong
    answers = {*trials["response"].dropna().astype(object)} & {*LEFT_RIGHT_BOTH.sites}
    if "side" in columns.constant and len(answers) > 1:
        message = (
            f'[constant] side = "{columns.constant["side"]}" gives all stimuli one site, but '
            f"answers name {' and '.join(sorted(answers))}; name the column of the site in "
            "[columns] side or, if only felt or not was asked, map detected instead of response"
        )
        raise ResultFileError(columns.name or trials["file"].iloc[0], None, message)


@contextmanager
def no_search_for_circles() -> Iterator[None]:
    """Keep Python from looking for circular garbage, an eighth of the time of many sessions.

    What is read is millions of plain values, none of which points back at another; tables made of
    them have no circles either, and those of a few figures can wait.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadTable:
    """One table that was read, besides its rows."""

    path: Path
    trials: int  # its rows
    file: InputFile
    plan: InputFile | None = None  # the plan beside it, where there is one
    progress: SessionProgress | None = None  # how far that plan came
    compared: bool = False  # with the journal beside it
    altered: tuple[str, ...] = ()  # where the session is not as it was recorded


@dataclass(slots=True)
class _Pending:
    """Rows of text that are typed together: a call of pandas costs as much for one as for all."""

    texts: dict[str, list[str]] = field(default_factory=dict)
    files: list[str] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)

    def add(self, texts: Mapping[str, list[str]], file: str, lines: list[int]) -> None:
        for name, column in texts.items():
            self.texts.setdefault(name, []).extend(column)
        self.files += [file] * len(lines)
        self.lines += lines


class _Reading:
    """Tables read one after the other, typed and checked in batches that bound the memory."""

    def __init__(self, columns: ColumnMap | None, *, accept_altered: bool) -> None:
        from analysis.reading.columns import Rows

        self.columns = columns
        self.accept_altered = accept_altered
        self.rows = RowFilter(columns.rows if columns else Rows())
        self.unused = UnusedColumns()
        self.tables: list[ReadTable] = []
        self.left_out: Counter[str] = Counter()
        self._values: dict[str, set[Any]] = {name: set() for name in _LIMITS}

    def read(self, sources: Iterable[InputTable]) -> pd.DataFrame:
        """Return the checked rows of all tables."""
        frames = [no_rows()] if not (self.columns and self.columns.table) else []
        batch: list[tuple[InputTable, SessionRecord, int]] = []
        typed: list[pd.DataFrame] = []
        pending = _Pending()
        rows = 0
        for source in sources:
            record = read_record(source.path, accept_altered=self.accept_altered)
            number = 0
            try:
                for texts, lines in self._texts(source, record):
                    if pending.texts and pending.texts.keys() != texts.keys():
                        typed.append(self._type(pending))
                        pending = _Pending()
                    pending.add(texts, str(source.path), lines)
                    number += len(lines)
                    if len(pending.lines) >= _BATCH_ROWS:
                        typed.append(self._type(pending))
                        pending = _Pending()
            except OSError as error:
                raise unreadable(error, source.path) from None
            batch.append((source, record, number))
            rows += number
            if rows >= _BATCH_ROWS:
                frames.append(self._check([*typed, self._type(pending)], batch))
                batch, typed, pending, rows = [], [], _Pending(), 0
        if batch:
            frames.append(self._check([*typed, self._type(pending)], batch))
        return pd.concat([f for f in frames if len(f)] or frames[:1], ignore_index=True)

    def _texts(
        self, source: InputTable, record: SessionRecord
    ) -> Iterator[tuple[dict[str, list[str]], list[int]]]:
        if self.columns is not None:
            for texts, lines, left in read_texts(source, self.columns, self.rows, self.unused):
                self.left_out += left
                yield texts, lines
            return
        file = str(source.path)
        with source.path.open("rb") as stream:
            form = _EXPORTED if source.path.suffix == EXPORTED_SUFFIX else None
            planned = record.plan is not None
            header, chunks = text_chunks(stream, file, form=form, empty_allowed=planned)
            for lines, rows in chunks:
                cells = map(list, zip(*rows, strict=True)) if rows else [[] for _ in header]
                recorded: dict[str, list[str]] = dict(zip(header, cells, strict=True))
                if record.altered and record.compared and planned:
                    # the journal knows the version, whatever the cells of the table say
                    recorded["schema"] = [str(SCHEMA)] * len(lines)
                yield own_columns(recorded, file), lines

    def _type(self, pending: _Pending) -> pd.DataFrame:
        if not pending.lines:
            return pd.DataFrame()
        arguments = pending.files, pending.lines
        if self.columns is None:
            rows = read_columns(pending.texts, _READERS, *arguments)
        elif self.columns.table:
            rows = read_count_rows(pending.texts, self.columns, *arguments)
        else:
            rows = read_external(pending.texts, self.columns, *arguments)
        for name, (largest, plural) in _LIMITS.items():
            values = self._values[name]
            values.update(rows[name].dropna().unique())
            if len(values) > largest:
                label = self.columns.label(name) if self.columns else name
                # Rows below may have further values: nothing is read beyond the fault.
                message = (
                    f"{label} has more than {len(values) - 1} values; at most {largest} {plural} "
                    "are allowed"
                )
                raise ResultFileError(pending.files[-1], None, message)
        return rows

    def _check(
        self, typed: list[pd.DataFrame], batch: list[tuple[InputTable, SessionRecord, int]]
    ) -> pd.DataFrame:
        """Check the rows of whole tables, each against its plan where there is one."""
        rows = pd.concat([f for f in typed if len(f)] or [no_rows()], ignore_index=True)
        columns = self.columns
        if columns and columns.table:
            if len(rows) and "presented" in rows:
                _refuse_broken(rows, _count_rules(rows, columns), columns)
            self.tables += [_read_table(*table) for table in batch]
            return rows
        rows = _with_verdicts(with_responses(rows, columns) if columns else rows, columns)
        _refuse_broken(rows, _trial_rules(rows, columns), columns)
        rows.loc[rows["side"].eq(NO_STIMULUS), "level_vpp"] = float("nan")
        of_plans = plan_rows(rows) if any(record.plan for _, record, _ in batch) else []
        offered = rows["none_offered"].array.copy()
        ends = np.cumsum([0, *(number for _, _, number in batch)]).tolist()
        for (source, record, number), (first, end) in zip(batch, pairwise(ends), strict=True):
            if record.plan:
                offered[first:end] = LEFT_RIGHT_BOTH.nothing in record.plan.responses
            self.tables.append(_read_table(source, record, number, of_plans[first:end]))
        rows["none_offered"] = offered
        return rows


def _read_table(
    source: InputTable, record: SessionRecord, number: int, rows: Sequence[Any] = ()
) -> ReadTable:
    """Check the rows of a table against its plan, where there is one that is not in doubt."""
    plan = record.plan
    if plan and not (record.compared and record.altered):
        check_plan(rows, str(source.path), plan)
    plan_file = InputFile(name=beside(source.name, PLAN), sha256=record.plan_file_sha256)
    return ReadTable(
        path=source.path,
        trials=number,
        file=InputFile(name=source.name, sha256=_sha256(source.path)),
        plan=plan_file if plan else None,
        progress=replace(progress(rows, plan, record.ended), measured=record.measured)
        if plan
        else None,
        compared=record.compared,
        altered=tuple(format_difference(change, source.name) for change in record.altered),
    )


def _sha256(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise unreadable(error, path) from None


def _input_files(tables: Iterable[ReadTable], columns: ColumnMap | None) -> tuple[InputFile, ...]:
    """Return what was read, the map included, in the order of names."""
    files = [file for table in tables for file in (table.file, table.plan) if file is not None]
    if columns is not None and columns.sha256:
        files.append(InputFile(name=one_line(columns.name), sha256=columns.sha256))
    return tuple(sorted(files))


def _refuse_nothing(reading: _Reading) -> None:
    """Refuse tables of which no row is left."""
    if not any(table.trials for table in reading.tables):
        unread = reading.left_out.total()
        empty = f"all {unread} rows are left out by {reading.rows.format_keys()}"
        message = empty if unread else "no session here has a trial yet"
        raise ResultFileError(reading.tables[0].path, 1, message)


def _refuse_copies(tables: Sequence[ReadTable]) -> None:
    first: dict[str, Path] = {}
    for table in tables:
        if not table.trials:  # sessions that were stopped before their first trial are all alike
            continue
        before = first.setdefault(table.file.sha256, table.path)
        if before is not table.path:
            message = f"the same contents as {one_line(str(before))}"
            raise ResultFileError(table.path, None, message)


def no_rows() -> pd.DataFrame:
    """Return a table of trials without a trial.

    >>> len(no_rows()), no_rows()["level_vpp"].dtype
    (0, dtype('float64'))
    """
    texts: dict[str, list[str]] = {column.name: [] for column in COLUMNS}
    return _with_verdicts(read_columns(texts, _READERS, [], []), None)


def _with_verdicts(rows: pd.DataFrame, columns: ColumnMap | None) -> pd.DataFrame:
    """Fill in ``correct``, and ``none_offered`` as far as the rows themselves say.

    Hands-off trials say nothing of the latter: "none" is always an answer there.
    """
    rows["correct"] = rows["correct"].astype("boolean").fillna(expected_correct(rows))
    none = rows["response"].eq(LEFT_RIGHT_BOTH.nothing) & rows["kind"].ne(HANDS_OFF)
    rows["none_offered"] = (
        pd.array([columns.task == YES_NO] * len(rows), dtype="boolean")
        if columns and columns.task
        else none.astype("boolean").mask(~none)
    )
    return rows[[*(column.name for column in COLUMNS), "file", "line", "none_offered"]]


def expected_correct(rows: pd.DataFrame) -> pd.Series[Any]:
    """Return for each row whether its response names its stimulus, as the task defines it.

    >>> expected_correct(pd.DataFrame({"kind": ["both"], "side": ["both"], "response": ["left"]}))
    0    False
    dtype: boolean
    """
    table = [[LEFT_RIGHT_BOTH.is_correct(s, r) for r in (*RESPONSES, None)] for s in SIDES]
    choices = {"side": SIDES, "response": RESPONSES}
    codes = [pd.Categorical(rows[name], categories=list(c)).codes for name, c in choices.items()]
    answers = pd.array(np.array(table, dtype=object)[tuple(codes)], dtype="boolean")
    return pd.Series(answers, index=rows.index)


def offered_to_all(trials: pd.DataFrame) -> pd.Series[Any]:
    """Return ``none_offered`` with what the answers of others say where it is missing.

    "none" was an answer for everybody in a condition of a study if anybody gave it there: who never
    felt nothing, or never said so, had the same keys. External tables name no study, and are one.
    What a plan says of its own session stays.

    >>> trials = pd.DataFrame({"condition": ["a", "a", "b"], "study_sha256": "n/a",
    ...     "none_offered": pd.array([True, None, None], dtype="boolean")})
    >>> offered_to_all(trials).tolist()
    [True, True, <NA>]
    """
    offered = trials["none_offered"].astype("boolean")
    unknown = offered.isna()
    yes = offered.fillna(value=False)
    anybody = yes.groupby([trials["condition"], trials["study_sha256"]]).transform("any")
    return offered.mask(unknown & anybody, other=True)


class _Rule(NamedTuple):
    """A column, what it must be, the rows that break this, and a remedy that is certain."""

    column: str
    must: str
    broken: pd.Series[bool]
    remedy: str = ""
    label: str = ""


def _refuse_broken(rows: pd.DataFrame, rules: Iterable[_Rule], columns: ColumnMap | None) -> None:
    """Refuse the first row that breaks a rule, by the first rule that it breaks."""
    broken = [(int(np.argmax(rule.broken.to_numpy())), rule) for rule in rules if rule.broken.any()]
    if not broken:
        return
    row, rule = min(broken, key=itemgetter(0))
    value = rows[rule.column].iloc[row]
    plain = value.item() if isinstance(value, np.generic) else value
    text = NOT_AVAILABLE if pd.isna(value) else format_value(plain)
    label = rule.label or (columns.label(rule.column) if columns else rule.column)
    message = f"column '{label}' is {text}; it must be {rule.must}{rule.remedy}"
    raise ResultFileError(rows["file"].iloc[row], int(rows["line"].iloc[row]), message)


def _trial_rules(rows: pd.DataFrame, columns: ColumnMap | None) -> Iterator[_Rule]:
    kind, side, response = rows["kind"], rows["side"], rows["response"]
    yield _Rule("participant", _NO_TOTAL, rows["participant"].eq(TOTAL))
    for name in LEFT_RIGHT_BOTH.kinds:
        sides = [presentation.name for presentation in LEFT_RIGHT_BOTH.of_kind(name)]
        must = f"{' or '.join(sides)} in a {name} trial"
        yield _Rule("side", must, kind.eq(name) & ~side.isin(sides))
    negative = kind.ne(HANDS_OFF) & rows["block"].lt(0)
    yield _Rule("block", "0 or more in any but a hands-off trial", negative)
    yield from _level_rules(rows["level_vpp"], side.ne(NO_STIMULUS), columns)
    missing = rows["status"].eq("ok") & response.isna()
    yield _Rule("response", "an answer, timeout or invalid where the status is ok", missing)
    timed = rows["rt_s"].notna() & (response.isna() | response.eq("timeout"))
    yield _Rule("rt_s", "n/a where there was no answer", timed)
    wrong = rows["correct"].ne(expected_correct(rows)).fillna(value=True)
    yield _Rule("correct", "what kind, side and response say", rows["correct"].notna() & wrong)


def _count_rules(rows: pd.DataFrame, columns: ColumnMap) -> Iterator[_Rule]:
    kind, presented = rows["kind"], rows["presented"]
    single = kind.eq("single")
    yield _Rule("participant", _NO_TOTAL, rows["participant"].eq(TOTAL))
    yield _Rule("kind", "single or blank", ~kind.isin(["single", "blank"]))
    yield from _level_rules(rows["level_vpp"], single, columns)
    if "side" in rows:
        must = f"{' or '.join(LEFT_RIGHT_BOTH.sites)}, for single stimuli are counted"
        yield _Rule("side", must, single & ~rows["side"].isin(LEFT_RIGHT_BOTH.sites))
    table = cast("Table", columns.table)
    total = table.presented or table.missed
    over = rows["detected"].gt(presented)
    of = presented[over].iloc[0] if over.any() else ""
    must = f"at most what was presented, {of} in column {shown(total)}"
    yield _Rule("detected", must, over, label=table.detected)
    many = presented.gt(MAX_PRESENTED)
    yield _Rule("presented", f"at most {MAX_PRESENTED:.0e}", many, label=total)


def _level_rules(
    level: pd.Series[float], stimulus: pd.Series[bool], columns: ColumnMap | None
) -> Iterator[_Rule]:
    signed = columns is not None and columns.axis.signed
    smallest, largest = (-math.inf, math.inf) if signed else (MIN_LEVEL_VPP, MAX_LEVEL_VPP)
    bounds = "" if signed else f" from {smallest:g} to {largest:g}"
    remedy = ""
    if (stimulus & level.isna()).any():  # a table whose blanks have no level, and no side
        entry = f'[values.level_vpp] "" = "{"-inf" if signed else "0"}"'
        remedy = f'; blanks without a level: in the map {entry}, or what stands there for ""'
    elif columns and (stimulus & level.between(0, smallest, "neither")).any():
        remedy = '; a map brings metres to micrometres: [scale] level_vpp = 1e6, [axis] unit = "um"'
    out = stimulus & ~level.between(smallest, largest)
    yield _Rule("level_vpp", f"a number{bounds} where there is a stimulus", out, remedy)
    silent = ~stimulus & level.notna() & level.ne(0)
    yield _Rule("level_vpp", "0 or n/a where there is no stimulus", silent)


def _check_reaction_times(
    trials: pd.DataFrame, planned: frozenset[str], columns: ColumnMap | None
) -> None:
    """Refuse a median that is none of seconds; beside a plan, its response window says more."""
    free = trials[~trials["file"].isin(planned)]
    medians_s = free.groupby("participant", sort=False)["rt_s"].median().dropna()
    odd = medians_s[~medians_s.between(MIN_MEDIAN_RT_S if columns else 0, MAX_MEDIAN_RT_S)]
    if odd.empty:
        return
    participant, median_s = str(odd.index[0]), odd.iloc[0]
    row = free[free["participant"].eq(participant) & free["rt_s"].ge(median_s)].iloc[0]
    unit = columns.units.get("rt_s", "s") if columns else "s"
    remedy = 'if these are milliseconds, a map says [units] rt_s = "ms"'
    if unit != "s":
        remedy = f"the map has {unit}; without it these are seconds"
    message = (
        f"column 'rt_s' has a median of {median_s:g} s for participant {participant}, allowed "
        f"{MIN_MEDIAN_RT_S:g} to {MAX_MEDIAN_RT_S:g} s; {remedy}"
    )
    raise ResultFileError(row["file"], int(row["line"]), message)


def _rows_in_order(trials: pd.DataFrame, columns: ColumnMap | None) -> bool:
    """Return whether a map takes the order of rows, none of which is that of files."""
    if columns is None or columns.columns.get("trial") != "":
        return False
    return bool(trials.groupby(["participant", "session"])["file"].nunique().eq(1).all())


def _with_numbers(trials: pd.DataFrame) -> pd.DataFrame:
    """Give trials without a number a running one, within participant and session.

    Numbers of a session that count from 0, as those of PsychoPy do, count from 1 then.
    """
    key = ["participant", "session"]
    bare = trials["trial"].eq(UNNUMBERED)
    trials.loc[bare, "trial"] = trials[bare].groupby(key).cumcount() + 1
    if trials["trial"].eq(0).any():
        trials["trial"] += trials.groupby(key)["trial"].transform("min").eq(0)
    return trials


def _refuse_repeats(trials: pd.DataFrame, *, external: bool) -> None:
    """Refuse a trial that stands twice; practice may be repeated, as warm-up after every resume."""
    _refuse_repeat(trials, _KEY, "the same participant, session, trial and attempt as", external)
    valid = trials[trials["status"].eq("ok") & trials["kind"].ne(PRACTICE)]
    message = "status ok, although another attempt of this trial has it at"
    _refuse_repeat(valid, _KEY[:-1], message, external=False)


def _refuse_repeat(trials: pd.DataFrame, key: list[str], what: str, external: bool) -> None:  # noqa: FBT001
    repeated = trials.duplicated(key)
    if not repeated.any():
        return
    second = trials[repeated].iloc[0]
    first = trials[trials[key].eq(second[key]).all(axis="columns")].iloc[0]
    remedy = ""
    if external:
        remedy = (
            '; where trials are numbered anew in each block, the map needs [columns] trial = "" '
            "(their order is taken); session is for another day"
        )
    if external and first["file"] != second["file"]:
        session = trials[_KEY[:2]].eq(second[_KEY[:2]]).all(axis="columns")
        rows = trials.loc[session, "file"].astype(str).value_counts()
        shorter = Path(min((str(first["file"]), str(second["file"])), key=lambda file: rows[file]))
        remedy = (
            "; if a run was broken off and begun anew, leave out its file, such as "
            f"[rows.skip] {toml_entry(FILE, shorter.stem)}; if both files count, the map needs "
            f'[columns] session = "{FILE}", or participant = "{FILE}" where they are of two people'
        )
    trial = ", ".join(f"{name} {second[name]}" for name in key)
    message = f"{trial}: {what} {one_line(first['file'])}:{first['line']}{remedy}"
    raise ResultFileError(second["file"], int(second["line"]), message)


_DECIMAL: Final = re.compile(r"\d+(\.0*)?", re.ASCII)


def _spelling(name: str) -> str:
    """Return a name without blanks, capitals, leading zeros and a decimal part of zeros."""
    text = name.strip().casefold()
    return str(int(text.partition(".")[0])) if _DECIMAL.fullmatch(text) else text


def _names_alike(rows: pd.DataFrame) -> Iterator[str]:
    """Say which names of participants and of conditions differ in their spelling only."""
    for column in ("participant", "condition"):
        spellings: dict[str, list[str]] = {}
        for name in dict.fromkeys(rows[column].astype(str)):
            spellings.setdefault(_spelling(name), []).append(name)
        alike = [" and ".join(map(repr, names)) for names in spellings.values() if len(names) > 1]
        if alike:
            yield (
                f"{column}: {named(alike)} may be the same; [values.{column}] in the map gives "
                "them one name"
            )


_MIN_SAME_TRIALS: Final = 10


def _same_trials_twice(trials: pd.DataFrame) -> Iterator[str]:
    """Say which files hold the same stimuli, answers and times: one may have been saved again."""
    content = trials[["trial", "side", "level_vpp", "response", "rt_s"]]
    hashes = pd.util.hash_pandas_object(content, index=False).to_numpy()
    first: dict[bytes, str] = {}
    for file, rows in trials.groupby("file", sort=False).indices.items():
        if len({*hashes[rows].tolist()}) < _MIN_SAME_TRIALS:
            continue
        name = one_line(Path(str(file)).name)
        before = first.setdefault(hashes[rows].tobytes(), name)
        if before != name:
            yield f"{before} and {name} hold the same {len(rows)} trials: one may be a copy"


_MIN_BLANKS, _MAX_FALSE = 10, 0.5


def _mostly_felt_blanks(trials: pd.DataFrame) -> Iterator[str]:
    """Say that more than half of the blanks are felt, as right answers to them would seem to be."""
    blank = trials[trials["reason"].eq("") & trials["kind"].astype(object).eq("blank")]
    answers = [name for name in LEFT_RIGHT_BOTH.answer_names if name != LEFT_RIGHT_BOTH.nothing]
    hits = blank["response"].astype(object).isin(answers)
    if len(hits) >= _MIN_BLANKS and float(hits.mean()) > _MAX_FALSE:
        yield (
            f"in {hits.mean():.0%} of {len(hits)} blank trials something was felt: if that is "
            "a column of right and wrong answers, it has 1 for a blank that was rightly not felt; "
            "[columns] detected must be what was answered"
        )


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
    status, kind = trials["status"].astype(object), trials["kind"].astype(object)
    # Noise of which nobody knows whether it played is no reason: most tables do not say.
    unmasked = trials["noise_ok"].astype("boolean").eq(other=False).fillna(value=False)
    unverified = trials["burst_verified"].astype(object).eq("false")  # as for noise
    tests = [status.ne("ok"), trials["premature"], unmasked, unverified]
    names = (status, "premature", "unmasked", "unverified")
    fault = np.select(
        [np.asarray(test, dtype=bool) for test in tests],
        [np.asarray(name, dtype=object) for name in names],
        default="",
    )
    reason = kind.where(kind.isin(_NEVER_COUNTED), fault)
    return trials.assign(
        reason=pd.Series(reason, index=trials.index, dtype=object),
        fault=pd.Series(fault, index=trials.index, dtype=object),
    )


def without_silence(trials: pd.DataFrame) -> pd.DataFrame:
    """Return trials `with_reasons`, those of a silent participant in a condition left out, too.

    A time-out among answers is a stimulus that was not detected. Without a single answer it may as
    well be a dead keyboard, which says nothing of a threshold.

    >>> trials = without_silence(pd.DataFrame({"participant": list("aabb"), "condition": "main",
    ...     "response": ["left", *["timeout"] * 3], "reason": ["", "", "", "voided"]}))
    >>> trials["reason"].tolist()
    ['', '', 'never_answered', 'voided']
    """
    counts = trials["reason"].eq("")
    answered = counts & trials["response"].astype(object).ne("timeout")
    key = [trials[name].astype(object) for name in ("participant", "condition")]
    silent = counts & ~answered.groupby(key).transform("any")
    return trials.assign(reason=trials["reason"].mask(silent, NEVER_ANSWERED))


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
    unread: int = 0
    unread_files: int = 0


def counts_of(loaded: LoadedTrials) -> Counts:
    """Count trials, or what a table of counts presented, each participant a session."""
    trials, cells = loaded.trials, loaded.cells
    numbers = dict.fromkeys(Counts.__dataclass_fields__, 0)
    numbers |= {"unread": loaded.left_out, "unread_files": loaded.left_out_files}
    if cells is not None:
        single, people = int(cells["presented"].sum()), cells["participant"].nunique()
        blank = 0 if loaded.blanks is None else int(loaded.blanks["presented"].sum())
        numbers |= {"trials": single + blank, "single": single, "blank": blank}
        numbers |= {"participants": people, "sessions": people}
        return Counts(**numbers | {"conditions": cells["condition"].nunique()})
    counted = trials[trials["reason"].eq("")]
    for column, names in (("kind", LEFT_RIGHT_BOTH.kinds), ("response", _NO_ANSWERS)):
        values = counted[column].astype(object)
        numbers |= {name: int(values.eq(name).sum()) for name in names}
    return Counts(
        **{name: number for name, number in numbers.items() if name != "timeout"}
        | {"trials": len(trials), "left_out": len(trials) - len(counted)}
        | {"timeouts": numbers["timeout"], "conditions": trials["condition"].nunique()}
        | {"participants": trials["participant"].nunique()}
        | {"sessions": len(trials[["participant", "session"]].drop_duplicates())}
        | {"simulated": int(trials["simulated"].sum())}
        | {"without_device": int(without_device(trials).sum())}
    )


def without_device(trials: pd.DataFrame) -> pd.Series[bool]:
    """Return which trials are of a person whose device moves nothing.

    >>> kinds = {"simulated": [False, False, True], "device_kind": ["mock", None, "mock"]}
    >>> without_device(pd.DataFrame(kinds)).tolist()
    [True, False, False]
    """
    return ~trials["simulated"].astype(bool) & trials["device_kind"].isin(["mock", "emulated"])
