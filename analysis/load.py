"""Result files to one checked table of trials; every fault with file and line."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from analysis.checks import check_rows, check_together
from analysis.errors import ResultFileError, one_line
from analysis.plans import PLAN, check_plan, progress, read_plan
from analysis.rows import UNNUMBERED, mapped_rows, own_rows, with_responses
from analysis.sources import TABLE, find_sources, unreadable
from analysis.textfile import text_chunks
from analysis.unchanged import HashedFile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.columns import ColumnMap
    from analysis.plans import Progress
    from analysis.sources import Source


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class InputFile:
    """A file that was read.

    Attributes
    ----------
    name : str
        As `analysis.sources.Source.name`.
    sha256 : str
        Checksum of its bytes.
    """

    name: str
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loaded:
    """Checked trials and the files they come from.

    Attributes
    ----------
    trials : pandas.DataFrame
        As `read_trials` returns them.
    inputs : tuple of InputFile
        In the order of their names.
    without_table : tuple of str
        Session folders that hold no trials.csv.
    progress : tuple of Progress
        Of each session that has a plan, how far it came.
    """

    trials: pd.DataFrame
    inputs: tuple[InputFile, ...]
    without_table: tuple[str, ...]
    progress: tuple[Progress, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Read:
    """One table, and the plan beside it where there is one."""

    rows: pd.DataFrame
    table: InputFile
    plan: InputFile | None = None
    progress: Progress | None = None


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

    Examples
    --------
    >>> read_trials(["nowhere.csv"])
    Traceback (most recent call last):
    analysis.errors.ResultFileError: nowhere.csv: no such file or folder
    """
    return read_inputs(paths, columns).trials


def read_inputs(paths: Sequence[str | Path], columns: ColumnMap | None = None) -> Loaded:
    """Read result files as `read_trials` does, and tell which files these were.

    Raises
    ------
    ResultFileError
        As `read_trials`.
    """
    sources, without_table = find_sources([Path(path) for path in paths])
    read = [_read_source(source, columns) for source in sources]
    _check_copies(sources, read)
    inputs = [file for one in read for file in (one.table, one.plan) if file is not None]
    if columns is not None and columns.sha256:
        inputs.append(InputFile(name=one_line(columns.name), sha256=columns.sha256))
    told = [one.rows for one in read if not one.rows.empty]
    if not told:
        raise ResultFileError(sources[0].path, 1, "no session here has a trial yet")
    trials = _numbered(pd.concat(told, ignore_index=True))
    check_together(trials)
    return Loaded(
        trials=trials,
        inputs=tuple(sorted(inputs)),
        without_table=without_table,
        progress=tuple(one.progress for one in read if one.progress is not None),
    )


def _read_source(source: Source, columns: ColumnMap | None) -> _Read:
    file = str(source.path)
    sealed = read_plan(source.path)
    try:
        rows, sha256 = _read_rows(source.path, columns, empty_allowed=sealed is not None)
    except OSError as error:
        raise unreadable(error, source.path) from None
    check_rows(rows, file, planned=sealed is not None)
    rows.loc[rows["side"].eq("none"), "level_vpp"] = float("nan")
    # As objects: a file's name need not be text that can be encoded.
    rows.insert(len(rows.columns) - 2, "file", pd.Series(file, index=rows.index, dtype=object))
    table = InputFile(name=source.name, sha256=sha256)
    if sealed is None:
        return _Read(rows=rows, table=table)
    plan, plan_sha256 = sealed
    check_plan(rows, file, plan)
    rows["none_offered"] = pd.array(["none" in plan.responses] * len(rows), dtype="boolean")
    return _Read(
        rows=rows,
        table=table,
        plan=InputFile(name=source.name.removesuffix(TABLE) + PLAN, sha256=plan_sha256),
        progress=progress(rows, plan, source.path),
    )


def _check_copies(sources: Sequence[Source], read: Sequence[_Read]) -> None:
    first: dict[str, Path] = {}
    for source, one in zip(sources, read, strict=True):
        if one.rows.empty:  # sessions that were stopped before their first trial are all alike
            continue
        if one.table.sha256 in first:
            message = f"the same contents as {one_line(str(first[one.table.sha256]))}"
            raise ResultFileError(source.path, None, message)
        first[one.table.sha256] = source.path


def _read_rows(
    path: Path, columns: ColumnMap | None, *, empty_allowed: bool
) -> tuple[pd.DataFrame, str]:
    """Read the rows of one file and the checksum of its bytes."""
    file = str(path)
    with HashedFile(path) as raw, io.BufferedReader(raw) as stream:
        chunks = [
            own_rows(text, file) if columns is None else mapped_rows(text, file, columns)
            for text in text_chunks(
                stream, file, bom_allowed=columns is not None, empty_allowed=empty_allowed
            )
        ]
        sha256 = raw.unchanged_sha256()
    return with_responses(pd.concat(chunks, ignore_index=True), file), sha256


def _numbered(trials: pd.DataFrame) -> pd.DataFrame:
    """Give trials without a number a running one, within participant and session."""
    bare = trials["trial"].eq(UNNUMBERED)
    running = trials[bare].groupby(["participant", "session"]).cumcount() + 1
    trials.loc[bare, "trial"] = running
    return trials
