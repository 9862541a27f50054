"""Which files an analysis reads: regular ones, each under a name that tells it from the others."""

from __future__ import annotations

import os
import re
import stat
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from analysis.reading.text import ELSEWHERE, ResultFileError, one_line
from experiment.archive.files import LinkError, person_of, refuse_link
from experiment.integrity.places import lost_sessions, refuse_given_link

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from experiment.integrity.sessions import Difference


TABLE = "trials.csv"
FILE: Final = "file-"
"""The column that has the name of a file without its ending."""
STANDS_FOR: Final = {"participant": "sub-", "session": "ses-", "block": "run-"}
"""Which of our columns the name of a BIDS file has, where the table has not."""
_BIDS_TABLE: Final = re.compile(r".+_(beh|events)\.tsv")
_ENTITY: Final = re.compile(r"([A-Za-z]+)-([A-Za-z0-9+]+)")
_ENDINGS: Final = ((".csv", ".tsv"), (".txt",))
"""Endings of tables; the last only where there is none of the first: most .txt are no tables."""


def read_name(path: Path) -> dict[str, str]:
    """Return what the name of a file says: the entities of BIDS, and ``file-``, all of it.

    >>> from pathlib import Path
    >>> read_name(Path("sub-07_task-felt_run-2_beh.tsv"))
    {'file-': 'sub-07_task-felt_run-2_beh', 'sub-': '07', 'task-': 'felt', 'run-': '2'}
    """
    named = path.stem.split("_") if path.name.startswith("sub-") else ()
    entities = (_ENTITY.fullmatch(entity) for entity in named)
    return {FILE: path.stem} | {f"{entity[1]}-": entity[2] for entity in entities if entity}


def bids_tables(people: list[Path]) -> list[Path]:
    """Return the tables of behaviour and events below folders ``sub-*``, by name."""
    below = (path for folder in people for path in folder.rglob("*.tsv"))
    return sorted(p for p in below if _BIDS_TABLE.fullmatch(p.name) and _is_visible(p))


def plain_tables(folder: Path) -> list[Path]:
    """Return the tables in a folder that is no data set, by name."""
    files = sorted(path for path in folder.iterdir() if _is_visible(path))
    tables = ([path for path in files if path.suffix.lower() in ends] for ends in _ENDINGS)
    return next(filter(None, tables), [])


def _is_visible(path: Path) -> bool:
    return not path.name.startswith(".")  # as a spreadsheet's lock and macOS's copies do


@dataclass(frozen=True, slots=True, kw_only=True)
class InputTable:
    """A table to read.

    Attributes
    ----------
    path : Path
        The file, as the caller named it or its folder.
    name : str
        Printable, relative to the one folder that was asked for, or to the folder that holds
        everything that was asked for: the same wherever that lies.
    about : mapping of str to str
        What the file's name tells, see `read_name`.
    """

    path: Path
    name: str
    about: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sources:
    """What there is to read.

    Attributes
    ----------
    tables : tuple of InputTable
        The tables.
    without : tuple of InputTable
        Where the trials.csv would be of session folders that have none.
    lost : tuple of tuple of InputTable and Difference
        The same of sessions of which no file is left, and what tells of them.
    """

    tables: tuple[InputTable, ...]
    without: tuple[InputTable, ...] = ()
    lost: tuple[tuple[InputTable, Difference], ...] = ()


def find_sources(paths: list[Path], *, foreign: bool = False) -> Sources:
    """List the tables to read, and the sessions without one.

    Of a folder in which no session has a trials.csv, those of a BIDS data set are listed or, where
    tables are `foreign` ones with a map, all in the folder itself.

    Raises ValueError without a path, ResultFileError for a path that is no regular file or cannot
    be read, for a folder without a session, and for a symbolic link to a session.

    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for name in ("a", "b"):
    ...         (Path(folder) / name).mkdir()
    ...         (Path(folder) / name / "t.csv").touch()
    ...     [s.name for s in find_sources(sorted(Path(folder).glob("*/t.csv"))).tables]
    ['a/t.csv', 'b/t.csv']
    """
    if not paths:
        raise ValueError("paths must name at least one file or folder, got none")
    tables: list[tuple[Path, Path]] = []
    without: list[tuple[Path, Path]] = []
    lost: list[tuple[Path, Path, Difference]] = []
    for path in paths:
        with _faults_named(path):
            if not path.is_dir():
                tables.append((path.parent, _checked(path)))
                continue
            refuse_given_link(path)
            gone = _lost(path)
            sessions = [folder / TABLE for folder in _sessions(path) if folder not in gone]
            complete = [table for table in sessions if _exists(table)]
            elsewhere = []
            if not gone and not complete:
                elsewhere = _elsewhere(path, foreign=foreign and not sessions)
            if not sessions and not gone and not elsewhere:
                which = "table (.csv, .tsv or .txt)" if foreign else f"sub-*/ses-*/{TABLE}"
                hint = f"; {ELSEWHERE}" if not foreign and plain_tables(path) else ""
                raise ResultFileError(path, None, f"no {which} in this folder{hint}")
            for table in complete:
                refuse_link(table)
            tables += [(path, _checked(table)) for table in (*elsewhere, *complete)]
            if not elsewhere:
                without += [(path, table) for table in sessions if table not in complete]
                lost += [(path, folder / TABLE, why) for folder, why in gone.items()]
    names = _names([*tables, *without, *((folder, path) for folder, path, _ in lost)])
    return Sources(
        tables=tuple(InputTable(path=p, name=names[p], about=read_name(p)) for _, p in tables),
        without=tuple(InputTable(path=path, name=names[path]) for _, path in without),
        lost=tuple((InputTable(path=path, name=names[path]), why) for _, path, why in lost),
    )


@contextmanager
def _faults_named(path: Path) -> Iterator[None]:
    try:
        yield
    except LinkError as error:
        raise ResultFileError(error.path, None, error.message) from None
    except OSError as error:
        raise unreadable(error, path) from None


def _elsewhere(folder: Path, *, foreign: bool) -> list[Path]:
    """Return the tables of a folder that is none of ours."""
    given = folder.resolve().name.startswith(("sub-", "ses-"))
    tables = bids_tables([folder] if given else _folders(folder, "sub-"))
    return tables or (plain_tables(folder) if foreign else [])


def _lost(folder: Path) -> dict[Path, Difference]:
    """Return the sessions of which no file is left, though the record names them."""
    name = folder.resolve().name
    if not name.startswith("ses-"):
        return {k: v for person in _people(folder) for k, v in lost_sessions(person).items()}
    lost = {path.name: why for path, why in lost_sessions(person_of(folder)).items()}
    return {folder: lost[name]} if name in lost else {}


def _exists(path: Path) -> bool:
    """Return whether something is there; unlike `Path.exists`, fail where nobody can know."""
    try:
        path.lstat()
    except FileNotFoundError:
        return False
    return True


def _names(files: list[tuple[Path, Path]]) -> dict[Path, str]:
    """Name files by their way from the folder that holds all folders that were given."""
    resolved = {folder: folder.resolve() for folder in {folder for folder, _ in files}}
    base = os.path.commonpath(resolved.values())
    return {
        path: one_line((resolved[folder] / path.relative_to(folder)).relative_to(base).as_posix())
        for folder, path in files
    }


def _sessions(folder: Path) -> list[Path]:
    if folder.resolve().name.startswith("ses-"):
        return [folder]
    return [session for person in _people(folder) for session in _folders(person, "ses-")]


def _people(folder: Path) -> list[Path]:
    return [folder] if folder.resolve().name.startswith("sub-") else _folders(folder, "sub-")


def _folders(folder: Path, prefix: str) -> list[Path]:
    """Return folders by name; unlike a glob, never pass over one that cannot be read."""
    folders = sorted(path for path in folder.iterdir() if path.name.startswith(prefix))
    for path in folders:
        if not path.is_file():
            refuse_link(path)
    return [path for path in folders if path.is_dir()]


def _checked(path: Path) -> Path:
    if not path.exists():
        raise ResultFileError(path, None, "no such file or folder")
    if not path.is_file():
        raise ResultFileError(path, None, "not a regular file")
    return path


def unreadable(error: OSError, path: Path) -> ResultFileError:
    """Say which file the system refused, and why.

    >>> from pathlib import Path
    >>> str(unreadable(PermissionError(13, "Permission denied"), Path("t.csv")))
    't.csv: cannot be read: Permission denied'
    """
    return ResultFileError(error.filename or path, None, f"cannot be read: {error.strerror}")


def read_regular(path: Path, most_bytes: int) -> bytes:
    """Read a small file as a whole; a pipe, which might never end, is refused.

    Raises ValueError for anything but a regular file, and for one with more than `most_bytes`,
    OSError where it cannot be read.

    >>> from pathlib import Path
    >>> read_regular(Path("/"), 10)
    Traceback (most recent call last):
    ValueError: not a regular file
    """
    if not stat.S_ISREG(path.stat().st_mode):
        raise ValueError("not a regular file")
    with path.open("rb") as stream:
        raw = stream.read(most_bytes + 1)
    if len(raw) > most_bytes:
        raise ValueError(f"it has at most {most_bytes} bytes, got more")
    return raw


@contextmanager
def unchanged(paths: Iterable[Path]) -> Iterator[None]:
    """Refuse what is read within, where one of the files is another one afterwards.

    A file that is there only before or only after is another one, too; so is one with other
    permissions. A fault of a file that changes is no fault of that file.

    Raises ResultFileError for the first file with another size, time of change or place on the
    disk.

    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder, unchanged([Path(folder) / "t.csv"]):
    ...     _ = (Path(folder) / "t.csv").write_text("new")
    Traceback (most recent call last):
    analysis.reading.text.ResultFileError: ...t.csv: changed while it was read; ...
    """
    before = [(path, _stamp(path)) for path in paths]
    try:
        yield
    except (ResultFileError, OSError):
        _refuse_changed(before)
        raise
    _refuse_changed(before)


def _refuse_changed(before: list[tuple[Path, tuple[int, ...] | None]]) -> None:
    for path, stamp in before:
        if _stamp(path) != stamp:
            message = "changed while it was read; analyze it when nothing writes there any more"
            raise ResultFileError(path, None, message) from None


def _stamp(path: Path) -> tuple[int, ...] | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)
