"""Result files to one checked table of trials; every fault with file and line."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from analysis.axis import Axis, axis_of
from analysis.batch import InputFile, batches, read_batch
from analysis.checks import check_together
from analysis.count_columns import count_columns
from analysis.counted import read_counted
from analysis.errors import ResultFileError, one_line
from analysis.plans import PLAN
from analysis.rows import UNNUMBERED, no_rows
from analysis.sources import find_sources, unchanged

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from contextlib import AbstractContextManager

    from analysis.batch import Table
    from analysis.columns import ColumnMap
    from analysis.plans import Progress
    from analysis.sources import Source


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loaded:
    """Checked trials and the files they come from.

    Attributes
    ----------
    trials : pandas.DataFrame
        As `read_trials` returns them.
    paths : tuple of Path
        The tables that were read.
    inputs : tuple of InputFile
        These, their plans and the map, in the order of their names.
    without_table : tuple of str
        Session folders that hold no trials.csv.
    progress : tuple of Progress
        Of each session that has a plan, how far it came.
    axis : Axis
        What the levels are.
    cells : pandas.DataFrame or None
        Of a table of counts, what `analysis.counted.read_counted` returns; there are no trials
        then.
    """

    trials: pd.DataFrame
    paths: tuple[Path, ...]
    inputs: tuple[InputFile, ...]
    without_table: tuple[str, ...]
    progress: tuple[Progress, ...]
    axis: Axis
    cells: pd.DataFrame | None = None


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
        One row per trial. The columns of `experiment.record.COLUMNS`: text for identifiers,
        categoricals for words, int64, float64 (NaN where there is no value), bool, nullable boolean
        for ``correct`` and ``noise_ok``. ``level_vpp`` is NaN where there is no stimulus. Then
        ``file`` and ``line``, where the row stands, and ``none_offered``, whether "none" could be
        answered: by the plan beside the file; without one true where the table says yes or no, or
        has this answer in the same condition; else unknown.

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
    analysis.errors.ResultFileError: nowhere.csv: no such file or folder
    """
    if columns is not None and columns.table:
        raise ValueError("columns must be a map of trials, got one with [table]")
    return read_inputs(paths, columns).trials


def read_inputs(
    paths: Sequence[str | Path],
    columns: ColumnMap | None = None,
    *,
    watched: Callable[[Sequence[Source]], AbstractContextManager[Iterable[Source]]] = nullcontext,
) -> Loaded:
    """Read result files as `read_trials` does, and tell which files these were.

    Parameters
    ----------
    paths, columns
        As `read_trials`.
    watched : callable
        Takes the tables that are to be read, and is asked for one after the other, for a progress
        bar.

    Raises
    ------
    ResultFileError
        As `read_trials`, and for a table or a plan that changes while the others are read.
    """
    sources, without_table = find_sources([Path(path) for path in paths])
    files = [path for one in sources for path in (one.path, one.path.with_name(PLAN))]
    counts = count_columns(columns.table) if columns else None
    if columns and counts:
        with unchanged(files), watched(sources) as asked:
            cells, inputs = read_counted(asked, columns, counts)
        return Loaded(
            trials=no_rows(),
            paths=tuple(source.path for source in sources),
            inputs=_inputs(inputs, columns),
            without_table=without_table,
            progress=(),
            axis=axis_of(columns.axis),
            cells=cells,
        )
    with unchanged(files), watched(sources) as asked:
        read = [one for batch in batches(asked) for one in read_batch(batch, columns)]
    tables = [table for one in read for table in one.tables]
    _check_copies(tables)
    if not any(table.trials for table in tables):
        raise ResultFileError(tables[0].path, 1, "no session here has a trial yet")
    told = [one.rows for one in read if not one.rows.empty]
    trials = _numbered(pd.concat(told, ignore_index=True))
    check_together(trials)
    inputs = [file for table in tables for file in (table.file, table.plan) if file is not None]
    return Loaded(
        trials=trials,
        paths=tuple(source.path for source in sources),
        inputs=_inputs(inputs, columns),
        without_table=without_table,
        progress=tuple(table.progress for table in tables if table.progress is not None),
        axis=Axis() if columns is None else axis_of(columns.axis),
    )


def _inputs(files: Iterable[InputFile], columns: ColumnMap | None) -> tuple[InputFile, ...]:
    """List what was read, the map included, in the order of names."""
    if columns is None or not columns.sha256:
        return tuple(sorted(files))
    return tuple(sorted([*files, InputFile(name=one_line(columns.name), sha256=columns.sha256)]))


def _check_copies(tables: Sequence[Table]) -> None:
    first: dict[str, Path] = {}
    for table in tables:
        if not table.trials:  # sessions that were stopped before their first trial are all alike
            continue
        sha256 = table.file.sha256
        if sha256 in first:
            message = f"the same contents as {one_line(str(first[sha256]))}"
            raise ResultFileError(table.path, None, message)
        first[sha256] = table.path


def _numbered(trials: pd.DataFrame) -> pd.DataFrame:
    """Give trials without a number a running one, within participant and session."""
    bare = trials["trial"].eq(UNNUMBERED)
    running = trials[bare].groupby(["participant", "session"]).cumcount() + 1
    trials.loc[bare, "trial"] = running
    return trials
