"""Which files an analysis reads: regular ones, each under a name that no other has."""

from __future__ import annotations

import os
import re
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from analysis.reading.text import ELSEWHERE, ResultFileError, one_line
from experiment.record.files import SymlinkError, refuse_link
from experiment.record.index import list_sessions
from experiment.record.journal import RecordSchemaError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from experiment.record.index import Difference


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
    tables: dict[Path, None] = {}
    missing: dict[Path, Difference | None] = {}
    for path in paths:
        with refusals(path):
            is_folder = path.is_dir()
            present, absent = _list_folder(path, foreign=foreign) if is_folder else ([path], {})
            for table in present:
                if not table.is_file():
                    fault = "not a regular file" if table.exists() else "no such file or folder"
                    raise ResultFileError(table, None, fault)
        tables |= dict.fromkeys(present)
        missing |= absent
    folders = [path if path.is_dir() else path.parent for path in paths]
    base = Path(os.path.commonpath([folder.resolve() for folder in folders]))

    def source(table: Path) -> InputTable:
        name = (table.parent.resolve() / table.name).relative_to(base).as_posix()
        lost = missing.get(table)
        return InputTable(path=table, name=one_line(name), about=read_name(table), lost=lost)

    return [*map(source, tables)], [*map(source, missing)]


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
        if table in session.iterdir():  # fails in an unreadable folder, unlike `Path.exists`
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
def refusals(path: Path) -> Iterator[None]:
    """Refuse a file that cannot be read, a symbolic link, and a session of another version."""
    try:
        yield
    except (RecordSchemaError, SymlinkError) as error:
        line = None if isinstance(error, SymlinkError) else error.line
        raise ResultFileError(error.path, line, error.message) from None
    except OSError as error:
        raise unreadable(error, path) from None
