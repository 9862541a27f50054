"""Which files an analysis reads: regular ones, each under a name that tells it from the others."""

from __future__ import annotations

import os
import re
import stat
from contextlib import contextmanager
from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True, kw_only=True)
class InputTable:
    """A table to read, or the place of one that is missing.

    Attributes
    ----------
    path : Path
        The file, as the caller named it or its folder.
    name : str
        Printable, relative to the folder that holds everything that was given: the same wherever
        that lies.
    about : mapping of str to str
        What the file's name tells, see `read_name`.
    lost : Difference or None
        What tells of the session, where no file of it is left.
    """

    path: Path
    name: str
    about: Mapping[str, str]
    lost: Difference | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Sources:
    """The tables to read, and the places of those that sessions lack."""

    tables: tuple[InputTable, ...]
    missing: tuple[InputTable, ...] = ()


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
    listed: list[tuple[Path, Path]] = []
    missing: dict[Path, Difference | None] = {}
    for path in paths:
        tables: list[Path] = [path]
        absent: dict[Path, Difference | None] = {}
        try:
            if path.is_dir():
                tables, absent = _list_folder(path, foreign=foreign)
            for table in tables:
                if not table.is_file():
                    fault = "not a regular file" if table.exists() else "no such file or folder"
                    raise ResultFileError(table, None, fault)
        except LinkError as error:
            raise ResultFileError(error.path, None, error.message) from None
        except OSError as error:
            raise unreadable(error, path) from None
        folder = path if path.is_dir() else path.parent
        listed += [(folder, table) for table in (*tables, *absent)]
        missing |= absent
    resolved = {folder: folder.resolve() for folder, _ in listed}
    base = os.path.commonpath(resolved.values())
    sources = [
        InputTable(
            path=table,
            name=one_line(
                (resolved[folder] / table.relative_to(folder)).relative_to(base).as_posix()
            ),
            about=read_name(table),
            lost=missing.get(table),
        )
        for folder, table in listed
    ]
    return Sources(
        tables=tuple(source for source in sources if source.path not in missing),
        missing=tuple(source for source in sources if source.path in missing),
    )


def _list_folder(
    folder: Path, *, foreign: bool
) -> tuple[list[Path], dict[Path, Difference | None]]:
    """Return the tables of a folder, and those that sessions lack, with what tells of lost ones."""
    refuse_given_link(folder)
    name = folder.resolve().name
    people = [folder] if name.startswith(("sub-", "ses-")) else _list_folders(folder, "sub-")
    if name.startswith("ses-"):
        heads = lost_sessions(person_of(folder)).items()
        sessions, lost = [folder], [(folder, why) for path, why in heads if path.name == name]
    else:
        sessions = [session for person in people for session in _list_folders(person, "ses-")]
        lost = [each for person in people for each in lost_sessions(person).items()]
    tables = [session / TABLE for session in sessions]
    absent: dict[Path, Difference | None] = {t: None for t in tables if not _is_there(t)}
    absent |= {session / TABLE: why for session, why in lost}
    tables = [table for table in tables if table not in absent]
    for table in tables:
        refuse_link(table)
    if tables or lost:
        return tables, absent
    below = (path for person in people for path in person.rglob("*.tsv"))
    others = sorted(p for p in below if _BIDS_TABLE.fullmatch(p.name) and _is_visible(p))
    plain = _list_plain_tables(folder) if not others and not sessions else []
    if others or (foreign and plain):
        return others or plain, {}
    if sessions:
        return [], absent
    which = "table (.csv, .tsv or .txt)" if foreign else f"sub-*/ses-*/{TABLE}"
    hint = f"; {ELSEWHERE}" if plain else ""
    raise ResultFileError(folder, None, f"no {which} in this folder{hint}")


def _list_folders(folder: Path, prefix: str) -> list[Path]:
    """Return folders by name; unlike a glob, never pass over one that cannot be read."""
    paths = sorted(path for path in folder.iterdir() if path.name.startswith(prefix))
    for path in paths:
        if not path.is_file():
            refuse_link(path)
    return [path for path in paths if path.is_dir()]


def _list_plain_tables(folder: Path) -> list[Path]:
    files = sorted(path for path in folder.iterdir() if _is_visible(path))
    tables = ([path for path in files if path.suffix.lower() in ends] for ends in _ENDINGS)
    return next(filter(None, tables), [])


def _is_visible(path: Path) -> bool:
    return not path.name.startswith(".")  # as a spreadsheet's lock and macOS's copies do


def _is_there(path: Path) -> bool:
    """Return whether something is there; unlike `Path.exists`, fail where nobody can know."""
    try:
        path.lstat()
    except FileNotFoundError:
        return False
    return True


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
    finally:
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
