"""Which files an analysis reads: regular ones, each under a name that tells it from the others."""

from __future__ import annotations

import os
import stat
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from analysis.reading.foreign.files import about, bids_tables, plain_tables
from analysis.reading.text import ELSEWHERE, ResultFileError, one_line
from experiment.archive.files import LinkError, person_of, refuse_link
from experiment.integrity.places import lost_sessions, refuse_given_link

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from experiment.integrity.sessions import Difference


TABLE = "trials.csv"


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
        What the file's name tells, see `analysis.reading.foreign.files.about`.
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
    lost: list[tuple[tuple[Path, Path], Difference]] = []
    for path in paths:
        if not _is_folder(path):
            _check_file(path)
            tables.append((path.parent, path))
            continue
        with _links_refused():
            refuse_given_link(path)
            gone = _lost(path)
            sessions = [folder for folder in _sessions(path) if folder not in gone]
        if not gone and not any(_holds(session / TABLE) for session in sessions):
            elsewhere = _elsewhere(path, foreign=foreign and not sessions)
            tables += [(path, table) for table in elsewhere]
            if elsewhere:
                continue
        if not sessions and not gone:
            which = "table (.csv, .tsv or .txt)" if foreign else f"sub-*/ses-*/{TABLE}"
            hint = f"; {ELSEWHERE}" if not foreign and plain_tables(path) else ""
            raise ResultFileError(path, None, f"no {which} in this folder{hint}")
        for session in sessions:
            if _holds(session / TABLE):
                with _links_refused():
                    refuse_link(session / TABLE)
                _check_file(session / TABLE)
                tables.append((path, session / TABLE))
            else:
                without.append((path, session / TABLE))
        lost += [((path, folder / TABLE), told) for folder, told in gone.items()]
    names = _names([*tables, *without, *(place for place, _ in lost)])
    return Sources(
        tables=tuple(
            InputTable(path=path, name=names[path], about=about(path)) for _, path in tables
        ),
        without=tuple(InputTable(path=path, name=names[path]) for _, path in without),
        lost=tuple((InputTable(path=path, name=names[path]), told) for (_, path), told in lost),
    )


def _elsewhere(folder: Path, *, foreign: bool) -> list[Path]:
    """List the tables of a folder that is none of ours."""
    given = folder.resolve().name.startswith(("sub-", "ses-"))
    try:
        found = bids_tables([folder] if given else _folders(folder, "sub-"))
        found = found or (plain_tables(folder) if foreign else [])
    except OSError as error:
        raise unreadable(error, folder) from None
    for table in found:
        _check_file(table)
    return found


@contextmanager
def _links_refused() -> Iterator[None]:
    try:
        yield
    except LinkError as error:
        raise ResultFileError(error.path, None, error.message) from None


def _lost(folder: Path) -> dict[Path, Difference]:
    """Find the sessions of which no file is left, though it is told of them."""
    name = folder.resolve().name
    if not name.startswith("ses-"):
        return {k: v for person in _people(folder) for k, v in lost_sessions(person).items()}
    lost = {path.name: told for path, told in lost_sessions(person_of(folder)).items()}
    return {folder: lost[name]} if name in lost else {}


def _holds(path: Path) -> bool:
    """Tell whether something is there; unlike `Path.exists`, fail where that cannot be known."""
    try:
        path.lstat()
    except FileNotFoundError:
        return False
    except OSError as error:
        raise unreadable(error, path) from None
    return True


def _names(found: list[tuple[Path, Path]]) -> dict[Path, str]:
    """Name files by their way from the folder that holds all folders that were asked for."""
    resolved = {folder: folder.resolve() for folder in {folder for folder, _ in found}}
    base = os.path.commonpath(resolved.values())
    return {
        path: one_line((resolved[folder] / path.relative_to(folder)).relative_to(base).as_posix())
        for folder, path in found
    }


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError as error:
        raise unreadable(error, path) from None


def _sessions(folder: Path) -> list[Path]:
    if folder.resolve().name.startswith("ses-"):
        return [folder]
    return [session for person in _people(folder) for session in _folders(person, "ses-")]


def _people(folder: Path) -> list[Path]:
    return [folder] if folder.resolve().name.startswith("sub-") else _folders(folder, "sub-")


def _folders(folder: Path, prefix: str) -> list[Path]:
    """List folders by name; unlike a glob, never pass over one that cannot be read."""
    try:
        found = sorted(path for path in folder.iterdir() if path.name.startswith(prefix))
        for path in found:
            if not path.is_file():
                refuse_link(path)
        return [path for path in found if path.is_dir()]
    except OSError as error:
        raise unreadable(error, folder) from None


def _check_file(path: Path) -> None:
    if not path.exists():
        raise ResultFileError(path, None, "no such file or folder")
    if not path.is_file():
        raise ResultFileError(path, None, "not a regular file")


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
    permissions. What is found wrong with a file that changes is no fault of that file.

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
        found = path.stat()
    except OSError:
        return None
    return (found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns)
