"""Result files to one checked table of trials; every fault with file and line."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from analysis.checks import Declared, check_rows, check_together
from analysis.errors import ResultFileError, one_line
from analysis.rows import UNNUMBERED, mapped_rows, own_rows, with_responses
from analysis.textfile import text_chunks

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.columns import ColumnMap

TABLE = "trials.csv"
PLAN = "plan.json"
_MAX_PLAN_BYTES = 50_000_000


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class InputFile:
    """A file that was read.

    Attributes
    ----------
    name : str
        Relative to the folder that was asked for, so that it is the same wherever that lies.
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
    """

    trials: pd.DataFrame
    inputs: tuple[InputFile, ...]
    without_table: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Source:
    path: Path
    name: str


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
        answered: by the plan beside the file, else true where any file without a plan has this
        answer, else unknown.

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
    sources, without_table = _sources([Path(path) for path in paths])
    read = [_read_source(source, columns) for source in sources]
    inputs = [file for _, files in read for file in files]
    if columns is not None and columns.sha256:
        inputs.append(InputFile(name=columns.name, sha256=columns.sha256))
    trials = _numbered(pd.concat([table for table, _ in read], ignore_index=True))
    check_together(trials)
    said_none = trials.loc[trials["none_offered"].isna(), "response"].eq("none").any()
    if said_none:
        trials["none_offered"] = trials["none_offered"].fillna(value=True)
    return Loaded(trials=trials, inputs=tuple(sorted(inputs)), without_table=without_table)


def _sources(paths: list[Path]) -> tuple[list[_Source], tuple[str, ...]]:
    """List the files to read and the session folders without one."""
    if not paths:
        raise ValueError("paths must name at least one file or folder, got none")
    sources: list[_Source] = []
    without: list[str] = []
    for path in paths:
        if not _is_folder(path):
            sources.append(_Source(path=path, name=path.name))
            continue
        told = {folder: (folder / TABLE).exists() for folder in _sessions(path)}
        found = [folder for folder, has_table in told.items() if has_table]
        if not found:
            raise ResultFileError(path, None, f"no sub-*/ses-*/{TABLE} in this folder")
        sources += [
            _Source(path=f / TABLE, name=(f / TABLE).relative_to(path).as_posix()) for f in found
        ]
        without += [f.relative_to(path).as_posix() for f in told if not told[f]]
    _check_sources(sources)
    return sources, tuple(without)


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError as error:
        raise _unreadable(error, path) from None


def _sessions(folder: Path) -> list[Path]:
    own_name = folder.resolve().name
    if own_name.startswith("ses-"):
        return [folder]
    people = [folder] if own_name.startswith("sub-") else _folders(folder, "sub-")
    return [session for person in people for session in _folders(person, "ses-")]


def _folders(folder: Path, prefix: str) -> list[Path]:
    """List folders by name; unlike a glob, never pass over one that cannot be read."""
    try:
        return sorted(f for f in folder.iterdir() if f.name.startswith(prefix) and f.is_dir())
    except OSError as error:
        raise _unreadable(error, folder) from None


def _unreadable(error: OSError, path: Path) -> ResultFileError:
    return ResultFileError(error.filename or path, None, f"cannot be read: {error.strerror}")


def _check_sources(sources: list[_Source]) -> None:
    seen: dict[tuple[int, int], Path] = {}
    for source in sources:
        if not source.path.exists():
            raise ResultFileError(source.path, None, "no such file or folder")
        if not source.path.is_file():
            raise ResultFileError(source.path, None, "not a regular file")
        status = source.path.stat()
        first = seen.setdefault((status.st_dev, status.st_ino), source.path)
        if first is not source.path:
            message = f"the same file as {one_line(str(first))}"
            raise ResultFileError(source.path, None, message)


def _read_source(
    source: _Source, columns: ColumnMap | None
) -> tuple[pd.DataFrame, list[InputFile]]:
    file = str(source.path)
    try:
        declared, inputs = _read_plan(source)
        rows, sha256 = _read_rows(source.path, columns)
    except OSError as error:
        raise _unreadable(error, source.path) from None
    check_rows(rows, file, declared)
    rows.loc[rows["side"].eq("none"), "level_vpp"] = float("nan")
    rows.insert(len(rows.columns) - 1, "file", file)
    offered = None if declared is None else "none" in declared.responses
    rows["none_offered"] = pd.array([offered] * len(rows), dtype="boolean")
    return rows, [*inputs, InputFile(name=source.name, sha256=sha256)]


def _read_rows(path: Path, columns: ColumnMap | None) -> tuple[pd.DataFrame, str]:
    """Read the rows of one file and the checksum of its bytes, these after the rows are sound."""
    file = str(path)
    with path.open("rb") as stream:
        chunks = [
            own_rows(text, file) if columns is None else mapped_rows(text, file, columns)
            for text in text_chunks(stream, file, bom_allowed=columns is not None)
        ]
        stream.seek(0)
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    return with_responses(pd.concat(chunks, ignore_index=True), file), sha256


def _read_plan(source: _Source) -> tuple[Declared | None, list[InputFile]]:
    """Read what the plan beside a trials.csv declares, where there is one."""
    path = source.path.with_name(PLAN)
    if source.path.name != TABLE or not path.exists():
        return None, []
    with path.open("rb") as stream:
        raw = stream.read(_MAX_PLAN_BYTES + 1)
    try:
        declared = _declared(raw)
    except json.JSONDecodeError as error:
        raise ResultFileError(path, error.lineno, f"not JSON: {error.msg}") from None
    except (ValueError, OverflowError, RecursionError) as error:
        raise ResultFileError(path, None, f"not a plan: {error}") from None
    name = source.name.removesuffix(TABLE) + PLAN
    return declared, [InputFile(name=name, sha256=hashlib.sha256(raw).hexdigest())]


def _declared(raw: bytes) -> Declared:
    if len(raw) > _MAX_PLAN_BYTES:
        raise ValueError(f"it has more than {_MAX_PLAN_BYTES} bytes")
    match json.loads(raw.decode()):
        case {"responses": [*words], "response_window_s": int() | float() as window_s} if all(
            isinstance(word, str) for word in words
        ) and not isinstance(window_s, bool):
            return Declared(responses=tuple(words), response_window_s=float(window_s))
    raise ValueError("it must have responses, a list of words, and response_window_s, a number")


def _numbered(trials: pd.DataFrame) -> pd.DataFrame:
    """Give trials without a number a running one, within participant and session."""
    bare = trials["trial"].eq(UNNUMBERED)
    running = trials[bare].groupby(["participant", "session"]).cumcount() + 1
    trials.loc[bare, "trial"] = running
    return trials
