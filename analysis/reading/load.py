"""Result files to one checked table, of trials or of counts; every fault with file and line."""

from __future__ import annotations

import gc
from collections import Counter
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from analysis.axis import Axis, axis_of
from analysis.codes import AnalysisWarning, WarningCode, with_code
from analysis.reading.batch import InputFile, batches, read_batch
from analysis.reading.checks import check_together, in_seconds, right_for_felt
from analysis.reading.drafted.conditions import (
    has_one_place,
    pooled,
    refuse_blank_levels,
    refuse_lost_sides,
)
from analysis.reading.foreign.counts import read_counted
from analysis.reading.foreign.files import begun_anew, both_files
from analysis.reading.foreign.form import RowFilter
from analysis.reading.foreign.table import count_columns
from analysis.reading.plans import PLAN, left_out
from analysis.reading.reasons import with_reasons, without_silence
from analysis.reading.rows import UNNUMBERED, no_rows, offered_to_all
from analysis.reading.sources import TABLE, find_sources, unchanged
from analysis.reading.text import ResultFileError, one_line

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from contextlib import AbstractContextManager

    from analysis.reading.batch import ReadTable
    from analysis.reading.foreign.columns import ColumnMap
    from analysis.reading.plans import SessionProgress
    from analysis.reading.sources import InputTable


_NOTHING_YET = "no session here has a trial yet"


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
        Sessions of which no table is left, though it is told of them or other files are: why.
    not_compared : tuple of str
        Names of the tables that have no journal beside them.
    alternatives : int
        Of a forced choice.
    task : str
        What the map states, as `ColumnMap.task`.
    cells : pandas.DataFrame or None
        Of a table of counts, its cells as `analysis.reading.foreign.counts.Counted` has them; there
        are no trials then.
    blanks : pandas.DataFrame or None
        The same of its blank presentations.
    changed : tuple of AnalysisWarning
        What was read otherwise than it stands in a table made elsewhere, or was not read though it
        may tell conditions apart.
    left_out : int
        Rows that a map leaves out.
    left_out_files : int
        Files that a map leaves out by what their names tell; their rows are not counted.
    left_out_by : str
        The keys of the map that leave out rows and, of several, how many each.
    numbered : bool
        Whether the tables number their trials, or else the order of their rows does.
    side_told : bool
        Whether the tables tell a side; false where a map states one for all rows.

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
        What the columns are called in tables made elsewhere.

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
    r"""Read result files as `read_trials` does, and tell which files these were.

    Parameters
    ----------
    paths, columns
        As `read_trials`.
    watched : callable
        Takes the tables that are to be read, and is asked for one after the other, for a progress
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
    found = find_sources([Path(path) for path in paths], foreign=columns is not None)
    sources = found.tables
    kept = RowFilter() if columns is None else columns.filter
    if columns is not None and sources:
        sources = tuple([one for one in sources if kept.reads(one.about)])
        if not sources:
            kept.refuse_unmet(str(paths[0]))
            raise ResultFileError(paths[0], None, f"all files are left out by {kept.told()}")
    unread_files = len(found.tables) - len(sources)
    if not sources:
        without = left_out(found, accept_altered=accept_altered)
        why = [*without.told.values(), *(one for lines in without.lost.values() for one in lines)]
        message = f"no session in this folder has a {TABLE}; {why[0]}"
        raise ResultFileError(paths[0], None, message)
    if columns is not None:
        refuse_blank_levels(columns, str(paths[0]))
    files = [path for one in sources for path in (one.path, one.path.with_name(PLAN))]
    counts = count_columns(columns.table) if columns else None
    if columns and counts:
        with unchanged(files), watched(sources) as asked:
            counted = read_counted(asked, columns, counts, kept)
        without = left_out(found, accept_altered=accept_altered)
        return LoadedTrials(
            trials=with_reasons(no_rows()),
            paths=tuple(source.path for source in sources),
            inputs=_inputs(counted.inputs, columns),
            without_table=without.told,
            lost=without.lost,
            progress=(),
            axis=axis_of(columns.axis),
            alternatives=columns.alternatives,
            task=columns.task,
            cells=counted.cells,
            blanks=counted.blanks,
            left_out=counted.left_out.total(),
            left_out_files=unread_files,
            left_out_by=kept.told(counted.left_out) if counted.left_out else "",
        )
    with unchanged(files), watched(sources) as asked, no_search_for_circles():
        read = [
            one
            for batch in batches(asked)
            for one in read_batch(batch, columns, kept=kept, accept_altered=accept_altered)
        ]
    kept.refuse_unmet(str(paths[0]))
    if columns:
        refuse_lost_sides(sources, columns)
    without = left_out(found, accept_altered=accept_altered)
    tables = [table for one in read for table in one.tables]
    _check_copies(tables)
    by = sum((table.left_out for table in tables), Counter[str]())
    unread = by.total()
    if not any(table.trials for table in tables):
        empty = f"all {unread} rows are left out by {kept.told()}" if unread else _NOTHING_YET
        raise ResultFileError(tables[0].path, 1, empty)
    told = [one.rows for one in read if not one.rows.empty]
    trials = pd.concat(told, ignore_index=True)
    numbered = bool(trials["trial"].ne(UNNUMBERED).all()) or _rows_in_order(trials, columns)
    trials = _numbered(trials)
    trials["none_offered"] = offered_to_all(trials)
    planned = frozenset(str(table.path) for table in tables if table.plan)
    unit = None if columns is None else columns.units.get("rt_s", "s")
    trials, rescaled = in_seconds(trials, planned=planned, unit=unit)
    changed = (*with_code(WarningCode.REACTION_TIMES_RESCALED, rescaled),)
    trials = without_silence(with_reasons(trials))
    check_together(trials, foreign=columns is not None)
    inputs = [file for table in tables for file in (table.file, table.plan) if file is not None]
    return LoadedTrials(
        trials=trials,
        paths=tuple(source.path for source in sources),
        inputs=_inputs(inputs, columns),
        without_table=without.told,
        lost=without.lost,
        progress=tuple(table.progress for table in tables if table.progress is not None),
        axis=Axis() if columns is None else axis_of(columns.axis),
        alternatives=2 if columns is None else columns.alternatives,
        task="" if columns is None else columns.task,
        altered={str(table.path): table.altered for table in tables if table.altered},
        not_compared=_not_compared(tables) if columns is None else (),
        changed=(*changed, *_remarks(trials, sources, columns)) if columns else changed,
        left_out=unread,
        left_out_files=unread_files,
        left_out_by=kept.told(by) if unread else "",
        numbered=numbered,
        side_told=columns is None or not has_one_place(columns, {*trials["side"]}),
    )


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


def _not_compared(tables: Iterable[ReadTable]) -> tuple[str, ...]:
    return tuple(table.file.name for table in tables if table.trials and not table.compared)


def _inputs(files: Iterable[InputFile], columns: ColumnMap | None) -> tuple[InputFile, ...]:
    """List what was read, the map included, in the order of names."""
    if columns is None or not columns.sha256:
        return tuple(sorted(files))
    return tuple(sorted([*files, InputFile(name=one_line(columns.name), sha256=columns.sha256)]))


def _check_copies(tables: Sequence[ReadTable]) -> None:
    first: dict[str, Path] = {}
    for table in tables:
        if not table.trials:  # sessions that were stopped before their first trial are all alike
            continue
        sha256 = table.file.sha256
        if sha256 in first:
            message = f"the same contents as {one_line(str(first[sha256]))}"
            raise ResultFileError(table.path, None, message)
        first[sha256] = table.path


def _remarks(
    trials: pd.DataFrame, sources: Sequence[InputTable], columns: ColumnMap
) -> Iterator[AnalysisWarning]:
    """Say what of tables made elsewhere may be meant otherwise than their map has it."""
    yield from with_code(WarningCode.CONDITIONS_POOLED, pooled(sources, columns))
    yield from with_code(WarningCode.SESSION_IN_SEVERAL_FILES, _in_several_files(trials))
    yield from with_code(WarningCode.BLANKS_MOSTLY_DETECTED, right_for_felt(trials))


def _rows_in_order(trials: pd.DataFrame, columns: ColumnMap | None) -> bool:
    """Tell whether a map takes the order of rows, none of which is that of files."""
    if columns is None or columns.columns.get("trial") != "":
        return False
    return bool(trials.groupby(["participant", "session"])["file"].nunique().eq(1).all())


def _in_several_files(trials: pd.DataFrame) -> Iterator[str]:
    """Say whose session is in several files, where most are in one: a run begun anew, perhaps."""
    sessions = zip(trials["participant"].astype(str), trials["session"].astype(str), strict=True)
    files = (Path(name).stem for name in trials["file"].astype(str))
    again = begun_anew(zip(sessions, files, strict=True))
    if again:
        yield (
            f"one session is in several files, {both_files(again)}: if a run was broken off and "
            "begun anew, [rows.skip] file- leaves its file out; sessions of their own are told "
            'apart by session = "file-"'
        )


def _numbered(trials: pd.DataFrame) -> pd.DataFrame:
    """Give trials without a number a running one, within participant and session.

    Numbers of a session that count from 0, as those of PsychoPy do, count from 1 then.
    """
    key = ["participant", "session"]
    bare = trials["trial"].eq(UNNUMBERED)
    trials.loc[bare, "trial"] = trials[bare].groupby(key).cumcount() + 1
    if trials["trial"].eq(0).any():
        trials["trial"] += trials.groupby(key)["trial"].transform("min").eq(0)
    return trials
