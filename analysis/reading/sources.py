"""Which files an analysis reads: regular ones, each under a name that tells it from the others."""

from __future__ import annotations

import os
import re
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from analysis.reading.text import ELSEWHERE, ResultFileError, one_line
from experiment.archive.files import LinkError, refuse_link
from experiment.integrity.places import list_sessions

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from experiment.integrity.sessions import Difference


TABLE = "trials.csv"
FILE: Final = "file-"
"""The column that has the name of a file without its ending."""
STANDS_FOR: Final = {"participant": "sub-", "session": "ses-", "block": "run-"}
"""Which of our columns the name of a BIDS file has, where the table has not."""
_BIDS_TABLE: Final = re.compile(r"[^.].*_(beh|events)\.tsv")
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
    """A table to read, or the path of one that its session lacks.

    Attributes
    ----------
    path : Path
        The file, as the caller named it or its folder.
    name : str
        Printable, relative to the folder that holds everything that was given: the same wherever
        that lies.
    about : mapping of str to str
        What the file's name says, see `read_name`.
    lost : Difference or None
        What sessions.tsv says of the session, where no file of it is left.
    """

    path: Path
    name: str
    about: Mapping[str, str]
    lost: Difference | None = None


def find_sources(
    paths: list[Path], *, foreign: bool = False
) -> tuple[list[InputTable], list[InputTable]]:
    """Return the tables to read, and those that sessions lack.

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
    ...     tables, missing = find_sources(sorted(Path(folder).glob("*/t.csv")))
    >>> [table.name for table in tables], missing
    (['a/t.csv', 'b/t.csv'], [])
    """
    if not paths:
        raise ValueError("paths must name at least one file or folder, got none")
    folders: dict[Path, Path] = {}  # by table, where it was looked for
    missing: dict[Path, Difference | None] = {}
    for path in paths:
        try:
            is_folder = path.is_dir()
            tables, absent = _list_folder(path, foreign=foreign) if is_folder else ([path], {})
            for table in tables:
                if not table.is_file():
                    fault = "not a regular file" if table.exists() else "no such file or folder"
                    raise ResultFileError(table, None, fault)
        except LinkError as error:
            raise ResultFileError(error.path, None, error.message) from None
        except OSError as error:
            raise unreadable(error, path) from None
        folders |= dict.fromkeys((*tables, *absent), path if is_folder else path.parent)
        missing |= absent
    resolved = {folder: folder.resolve() for folder in folders.values()}
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
        for table, folder in folders.items()
    ]
    present = [source for source in sources if source.path not in missing]
    return present, [source for source in sources if source.path in missing]


def _list_folder(
    folder: Path, *, foreign: bool
) -> tuple[list[Path], dict[Path, Difference | None]]:
    """Return the tables of a folder, and those that sessions lack, with the loss of a session."""
    sessions = list_sessions(folder)
    for link in sessions.links:
        raise link
    tables: list[Path] = []
    absent: dict[Path, Difference | None] = {}
    for session in sessions.folders:
        table = session / TABLE
        refuse_link(table)
        if table in session.iterdir():  # fails where nobody can know, unlike `Path.exists`
            tables.append(table)
        else:
            absent[table] = None
    absent |= {session / TABLE: why for session, why in sessions.lost.items()}
    if tables or absent:
        return tables, absent
    is_person = folder.resolve().name.startswith(("sub-", "ses-"))
    people = [folder] if is_person else folder.glob("sub-*")
    events = sorted(
        path
        for person in people
        for path in person.rglob("*.tsv")
        if _BIDS_TABLE.fullmatch(path.name)
    )
    # Names that begin with a point are a spreadsheet's locks and macOS's copies.
    files = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    by_ending = ([file for file in files if file.suffix.lower() in ends] for ends in _ENDINGS)
    plain = next(filter(None, by_ending), [])
    if events or (foreign and plain):
        return events or plain, {}
    which = "table (.csv, .tsv or .txt)" if foreign else f"sub-*/ses-*/{TABLE}"
    hint = f"; {ELSEWHERE}" if plain else ""
    raise ResultFileError(folder, None, f"no {which} in this folder{hint}")


def unreadable(error: OSError, path: Path) -> ResultFileError:
    """Say which file the system refused, and why.

    >>> from pathlib import Path
    >>> str(unreadable(PermissionError(13, "Permission denied"), Path("t.csv")))
    't.csv: cannot be read: Permission denied'
    """
    return ResultFileError(error.filename or path, None, f"cannot be read: {error.strerror}")


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
    before = {path: _stamp(path) for path in paths}
    try:
        yield
    finally:
        for path, stamp in before.items():
            if _stamp(path) != stamp:
                message = "changed while it was read; analyze it when nothing writes there any more"
                raise ResultFileError(path, None, message) from None


def _stamp(path: Path) -> tuple[int, ...] | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)
