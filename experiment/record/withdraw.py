"""The withdrawal of a person: their data are removed, and what still holds them is searched for.

The order of a removal is such that an interruption at any point leaves either everything, or a
record that the removal has begun, and the removal can be run again:

1. the withdrawal record is written, ``removed`` being false; from here on the identifier is
   refused,
2. the person's folder is moved, in one step, to where nothing reads it,
3. the row in participants.tsv goes,
4. the moved folder is deleted,
5. the record says ``removed``.
"""

from __future__ import annotations

import contextlib
import csv
import io
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from experiment.bounded import read_bounded
from experiment.record.files import (
    DISK,
    HEADER,
    JOURNAL,
    LEVELS_SUFFIX,
    LOCK,
    PLAN,
    RUNNING,
    WITHDRAWN_FOLDER,
    ArchiveError,
    check_identifier,
    delete_folder,
    locked,
    refuse_link,
)
from experiment.record.manifest import NAME, read_manifest
from experiment.record.people import (
    FILE_NAME,
    ID_COLUMN,
    WithdrawalRecord,
    read_people,
    read_withdrawal,
    remove_person,
    withdrawal_path,
    write_withdrawal,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from experiment.record.files import Disk


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """What a study's folder holds of a person.

    Attributes
    ----------
    root : Path
        The study's folder.
    participant : str
        The identifier.
    sessions : tuple of str
        Names of the folders in the person's folder.
    n_files : int
        Number of files in it.
    in_table : bool
        Whether participants.tsv has a row for the person.
    withdrawal : WithdrawalRecord or None
        The record of an earlier withdrawal.
    """

    root: Path
    participant: str
    sessions: tuple[str, ...]
    n_files: int
    in_table: bool
    withdrawal: WithdrawalRecord | None

    @property
    def folder(self) -> Path:
        """The person's folder."""
        return self.root / f"sub-{self.participant}"

    @property
    def removal_folder(self) -> Path:
        """Where the folder is moved before it is deleted."""
        return self.root / WITHDRAWN_FOLDER / f"sub-{self.participant}.removing"

    @property
    def is_removed(self) -> bool:
        """Whether the person was removed, and nothing came back."""
        is_done = self.withdrawal is not None and self.withdrawal.removed
        is_left = self.in_table or self.folder.exists() or self.removal_folder.exists()
        return is_done and not is_left

    @property
    def removed_paths(self) -> tuple[Path, ...]:
        """What needs no search: what is removed, and what is written about it."""
        record = withdrawal_path(self.root, self.participant)
        return (self.folder, self.removal_folder, record, self.root / FILE_NAME)


def find_person(root: Path, participant: str) -> Person:
    """Return what a study's folder holds of a person.

    Raises
    ------
    ArchiveError
        If it holds nothing, or if one of the paths is a symbolic link or the person's folder holds
        one: what it points to would stay.

    Examples
    --------
    >>> from pathlib import Path
    >>> find_person(Path("."), "../07")
    Traceback (most recent call last):
    experiment.record.files.ArchiveError: participant: must be 1 to 32 letters (a-z, A-Z) ...
    """
    check_identifier("participant", participant)
    if not root.is_dir():
        raise ArchiveError(f"{root}: there is no such folder")
    for path in (root / FILE_NAME, root / WITHDRAWN_FOLDER, withdrawal_path(root, participant)):
        refuse_link(path)
    folder = root / f"sub-{participant}"
    # On some systems, asking for ``sub-a`` finds ``sub-A``.
    exists = folder.name in {path.name for path in root.iterdir()}
    n_files = _count_files(folder) if exists else 0
    sessions = sorted(path.name for path in folder.iterdir() if path.is_dir()) if exists else ()
    person = Person(
        root=root,
        participant=participant,
        n_files=n_files,
        sessions=tuple(sessions),
        in_table=folder.name in read_people(root).rows,
        withdrawal=read_withdrawal(root, participant),
    )
    refuse_link(person.removal_folder)
    if not exists and not person.in_table and person.withdrawal is None:
        raise ArchiveError(f"{root}: there is no participant {participant} here")
    return person


def _count_files(folder: Path) -> int:
    """Count the files of a person's folder and refuse links among them."""
    refuse_link(folder)
    if not folder.is_dir():
        raise ArchiveError(f"{folder}: must be a folder; nothing was changed")
    count = 0
    for parent, folders, files in os.walk(folder, onerror=_raise):
        for name in (*folders, *files):
            refuse_link(folder / parent / name)
        count += len(files)
    return count


def _raise(error: OSError) -> None:
    raise error


@contextlib.contextmanager
def locked_sessions(person: Person) -> Iterator[contextlib.ExitStack]:
    """Lock all sessions of a person, so that none runs.

    Yields
    ------
    ExitStack
        The locks, for `remove`.

    Raises
    ------
    ArchiveError
        If a session is being run.
    """
    with contextlib.ExitStack() as locks:
        for name in person.sessions:
            locks.enter_context(locked(person.folder / name / LOCK, RUNNING))
        yield locks


def remove(person: Person, locks: contextlib.ExitStack, *, today: str, disk: Disk = DISK) -> None:
    """Remove a person whose sessions are locked; an interrupted withdrawal keeps its day.

    Parameters
    ----------
    person : Person
        The person, from `find_person`.
    locks : ExitStack
        The locks, from `locked_sessions`.
    today : str
        The day, as YYYY-MM-DD in UTC.
    disk : Disk
        Where the record is kept.

    Raises
    ------
    ArchiveError
        If something changed since `find_person`; nothing is changed then.
    """
    if find_person(person.root, person.participant).sessions != person.sessions:
        raise ArchiveError(f"{person.folder}: it changed meanwhile; nothing was changed")
    day = person.withdrawal.withdrawn if person.withdrawal else today
    record = WithdrawalRecord(participant=person.participant, withdrawn=day, removed=False)
    # First the record, on the disk: data that vanish without one look like data that were lost.
    write_withdrawal(person.root, record, disk=disk)
    delete_folder(person.removal_folder)
    if person.folder.exists():
        if os.name == "nt":  # which moves no folder with an open file in it
            locks.close()
        # One rename, since deleting file by file would leave, if stopped, half a session that reads
        # like a whole one. A power cut must not bring the folder back once its files are gone.
        person.folder.rename(person.removal_folder)
        disk.sync_folder(person.root)
    remove_person(person.root, person.participant, disk=disk)
    delete_folder(person.removal_folder)
    # The record lies in the folder that the files went from: one sync is for both.
    write_withdrawal(person.root, record.model_copy(update={"removed": True}), disk=disk)


@dataclass(frozen=True, slots=True, order=True)
class PersonalData:
    """A folder or a file that still holds data of a person."""

    path: Path
    what: str
    """``BIDS data set``, ``analysis``, ``sessions``, ``levels`` or ``table``."""


@dataclass(frozen=True, slots=True)
class SearchResult:
    """What a search for a person's data gave.

    Attributes
    ----------
    hits : tuple of PersonalData
        What holds data of the person, by path.
    not_searched : tuple of Path
        Links, damaged manifests, and what could not be read: somebody has to look into them.
    """

    hits: tuple[PersonalData, ...]
    not_searched: tuple[Path, ...]


def search(
    folders: Iterable[Path], participant: str, leave_out: Iterable[Path] = ()
) -> SearchResult:
    """Look for data of a person: exports, analyses, sessions, levels and tables, also renamed.

    Exports and analyses are known by their manifests, sessions by header, plan and journal, tables
    by their column of participants. Files of other programs are not searched: a search that must
    find a name in any file finds too much in some and nothing in others.

    Parameters
    ----------
    folders : iterable of Path
        Where to look, with everything below; links are not followed.
    participant : str
        The person's identifier.
    leave_out : iterable of Path
        Files and folders that need no search.

    Examples
    --------
    >>> import tempfile
    >>> from experiment.record.manifest import Manifest
    >>> with tempfile.TemporaryDirectory() as name:
    ...     manifest = Manifest(what="analysis", participants=("07", "08"))
    ...     _ = (Path(name) / NAME).write_text(manifest.text())
    ...     [len(search([Path(name)], who).hits) for who in ("07", "7", "analysis")]
    [1, 0, 0]
    """
    searcher = _Searcher(participant, {path.resolve() for path in leave_out})
    for top in folders:
        for folder, names, files in os.walk(top.resolve(), onerror=searcher.miss):
            searcher.search_folder(Path(folder), names, files)
    whole = {hit.path for hit in searcher.hits if hit.what in {"analysis", "sessions"}}
    hits = [hit for hit in searcher.hits if hit.what != "table" or hit.path.parent not in whole]
    return SearchResult(tuple(sorted(hits)), tuple(sorted(searcher.missed)))


class _Searcher:
    """One search: the hits so far, and what could not be searched."""

    def __init__(self, participant: str, excluded: set[Path]) -> None:
        self._participant = participant
        self._excluded = excluded
        text = re.escape(participant.encode())
        self._in_json = re.compile(rb'"participant"\s*:\s*"%b"' % text)
        self._in_toml = re.compile(rb'^participant\s*=\s*["\']%b["\']' % text, re.MULTILINE)
        self._in_text = re.compile(rb"\b(sub-)?%b\b" % text)
        self._listed: set[Path] = set()  # files of exports and their folders, by the manifests
        self.hits: set[PersonalData] = set()
        self.missed: set[Path] = set()

    def miss(self, error: OSError) -> None:
        """Note a folder that cannot be read."""
        self.missed.add(Path(error.filename))

    def search_folder(self, folder: Path, names: list[str], files: list[str]) -> None:
        """Search the files of a folder, and keep the names of the folders to go into."""
        paths = {folder / name for name in (*names, *files)} - self._excluded
        links = {path for path in paths if path.is_symlink()}
        self.missed |= links
        for path in sorted(paths.intersection(folder / name for name in files) - links):
            if path in self._listed:
                continue
            try:
                what = self._what_holds_person(path)
            except (OSError, ValueError, csv.Error):
                self.missed.add(path)
                continue
            if what is not None:
                is_file = what in {"levels", "table"}
                self.hits.add(PersonalData(path if is_file else folder, what))
        names[:] = [n for n in names if folder / n in paths - links and self._enters(folder / n)]

    def _enters(self, folder: Path) -> bool:
        """Return whether to search a folder; that of the person is named as a whole.

        An export is named as a whole, too, but somebody may have put other things into it.
        """
        is_persons = folder.name == f"sub-{self._participant}" and folder not in self._listed
        if is_persons:
            self.hits.add(PersonalData(folder, "sessions"))
        return not is_persons

    def _what_holds_person(self, path: Path) -> str | None:
        """Return what a file shows to hold data of the person; None if it shows nothing.

        Raises OSError if the file cannot be read or is too large, ValueError for a manifest that is
        none.
        """
        if path.name == NAME:
            manifest = read_manifest(path.parent)
            if manifest is None:
                return None
            for name in map(Path, manifest.files):
                self._listed |= {path.parent / each for each in (name, *name.parents)}
            return manifest.what if self._participant in manifest.participants else None
        if path.name in {HEADER, PLAN, JOURNAL}:
            raw = read_bounded(path, MAX_SEARCHED_BYTES)
            return "sessions" if self._in_json.search(raw) else None
        if path.suffix in _TABLE_SEPARATORS and path.is_file():
            raw = read_bounded(path, MAX_SEARCHED_BYTES)
            return "table" if self._is_in_table(raw, _TABLE_SEPARATORS[path.suffix]) else None
        if path.suffix == LEVELS_SUFFIX and path.is_file():
            raw = read_bounded(path, MAX_SEARCHED_BYTES)
            return "levels" if b"levels_vpp" in raw and self._in_toml.search(raw) else None
        return None

    def _is_in_table(self, raw: bytes, separator: str) -> bool:
        if not self._in_text.search(raw):
            return False
        text = io.TextIOWrapper(io.BytesIO(raw), encoding="utf-8-sig", errors="replace", newline="")
        rows = csv.reader(text, delimiter=separator)
        heading = next(rows, [])
        columns = [i for i, name in enumerate(heading) if name in {"participant", ID_COLUMN}]
        names = {self._participant, f"sub-{self._participant}"}
        return any(row[i] in names for row in rows for i in columns if i < len(row))


_TABLE_SEPARATORS: Final = {".csv": ",", ".tsv": "\t"}
MAX_SEARCHED_BYTES: Final = 100_000_000
"""A larger file is reported as not searched."""
