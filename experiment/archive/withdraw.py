"""A person's withdrawal: their folders and their row go, a tombstone stays.

The order is such that an interruption at any point leaves either everything, or a tombstone that
says that the removal has begun, and the removal can be run again:

1. the tombstone is written, ``removed`` being false; from here on the identifier is refused,
2. the person's folder is moved, in one step, to where nothing reads it,
3. the row in participants.tsv goes,
4. the moved folder is deleted,
5. the tombstone says ``removed``.
"""

from __future__ import annotations

import contextlib
import csv
import mmap
import os
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from filelock import Timeout

from experiment.archive.disk import DISK, lock_on
from experiment.archive.files import FOLDER, ArchiveError, check_identifier
from experiment.archive.participants import (
    FILE_NAME,
    ID_COLUMN,
    Tombstone,
    read_people,
    read_tombstone,
    remove_person,
    tombstone_path,
    write_tombstone,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from experiment.archive.disk import Disk


_PERSON: Final = re.compile(r"sub-[A-Za-z0-9]+")
_TABLES: Final = {".csv": ",", ".tsv": "\t"}
_PACKED: Final = {".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".zst", ".7z", ".rar"}
_WHOLES: Final = {"dataset_description.json": "BIDS data set", "summary.json": "analysis"}
"""What a folder is that has such a file."""


@dataclass(frozen=True, slots=True, order=True)
class Holding:
    """Something that holds a person.

    Attributes
    ----------
    path : Path
        A folder or a file.
    what : str
        ``BIDS data set``, ``analysis``, ``folder`` or ``file``.
    """

    path: Path
    what: str


@dataclass(frozen=True, slots=True)
class Search:
    """What a search found.

    Attributes
    ----------
    holdings : tuple of Holding
        What holds the person, by path.
    not_searched : tuple of Path
        Links, packed files, and what could not be read: somebody has to look into them.
    """

    holdings: tuple[Holding, ...]
    not_searched: tuple[Path, ...]


def search(folders: Iterable[Path], participant: str, leave_out: Iterable[Path] = ()) -> Search:
    r"""Look for a person in folders and everything below them; links are not followed.

    Parameters
    ----------
    folders : iterable of Path
        Where to look.
    participant : str
        The person's identifier.
    leave_out : iterable of Path
        Files and folders that are known already.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as name:
    ...     copy = Path(name) / "copy.csv"
    ...     _ = copy.write_text("participant,side\n07,left\n")
    ...     [len(search([Path(name)], who).holdings) for who in ("07", "7", "left")]
    [1, 0, 0]
    """
    seeker = _Seeker(participant, {path.resolve() for path in leave_out})
    for folder in folders:
        seeker.walk(folder.resolve())
    return Search(tuple(sorted(seeker.found)), tuple(sorted(seeker.missed)))


class _Seeker:
    """One search: what was found and what could not be searched."""

    def __init__(self, participant: str, leave_out: set[Path]) -> None:
        self._id = participant
        self._name = f"sub-{participant}"
        self._leave_out = leave_out
        said = rf'participant"?\s*[:=]\s*"{participant}"'
        self._said = re.compile(
            rf"(?<![A-Za-z0-9])sub-{participant}(?![A-Za-z0-9])|{said}".encode()
        )
        self.found: set[Holding] = set()
        self.missed: set[Path] = set()

    def walk(self, top: Path) -> None:
        for place, folders, files in os.walk(top, onerror=self._unreadable):
            here = Path(place)
            for name in tuple(folders):
                if not self._enter(here / name, top):
                    folders.remove(name)
            for name in files:
                self._look(here / name, top)

    def _unreadable(self, error: OSError) -> None:
        self.missed.add(Path(error.filename))

    def _enter(self, folder: Path, top: Path) -> bool:
        """Tell whether a folder is to be searched; other people's folders are not."""
        if folder in self._leave_out:
            return False
        if folder.is_symlink():
            self.missed.add(folder)
            return False
        if folder.name == self._name:
            self._note(folder, top, "folder")
            return False
        return not _PERSON.fullmatch(folder.name)

    def _look(self, file: Path, top: Path) -> None:
        if file in self._leave_out:
            return
        if self._said.search(os.fsencode(file.name)):
            self._note(file, top, "file")
        elif file.is_symlink() or file.suffix.lower() in _PACKED:
            self.missed.add(file)
        else:
            try:
                if file.is_file() and self._holds(file):
                    self._note(file, top, "file")
            except OSError:
                self.missed.add(file)

    def _holds(self, file: Path) -> bool:
        if not file.stat().st_size:
            return False
        with (
            file.open("rb") as stream,
            mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as all_,
        ):
            if self._said.search(all_):
                return True
        delimiter = _TABLES.get(file.suffix.lower())
        return delimiter is not None and self._id in _participants(file, delimiter)

    def _note(self, path: Path, top: Path, what: str) -> None:
        """Note the data set or the analysis that something lies in, or the thing itself."""
        for folder in path.parents:
            for name, whole in _WHOLES.items():
                if (folder / name).is_file():
                    self.found.add(Holding(folder, whole))
                    return
            if folder == top:
                break
        self.found.add(Holding(path, what))


def _participants(table: Path, delimiter: str) -> Iterator[str]:
    """Return the cells of a table's column of participants, if it has one."""
    with table.open(encoding="utf-8", errors="replace", newline="") as stream:
        rows = csv.reader(stream, delimiter=delimiter)
        try:
            heading = next(rows, [])
            places = [i for i, name in enumerate(heading) if name in (ID_COLUMN, "participant")]
            for row in rows:
                yield from (row[i] for i in places if i < len(row))
        except csv.Error:
            return


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
    files : int
        How many files there are in it.
    in_table : bool
        Whether participants.tsv has a row for the person.
    tombstone : Tombstone or None
        The mark of an earlier withdrawal.
    """

    root: Path
    participant: str
    sessions: tuple[str, ...]
    files: int
    in_table: bool
    tombstone: Tombstone | None

    @property
    def folder(self) -> Path:
        """The person's folder."""
        return self.root / f"sub-{self.participant}"

    @property
    def grave(self) -> Path:
        """Where the folder is moved before it is deleted."""
        return self.root / FOLDER / f"sub-{self.participant}.removing"

    @property
    def gone(self) -> bool:
        """Whether the person was removed, and nothing came back."""
        done = self.tombstone is not None and self.tombstone.removed
        there = self.in_table or self.folder.exists() or self.grave.exists()
        return done and not there

    @property
    def known(self) -> tuple[Path, ...]:
        """What needs no search: what is removed, and what is written about it."""
        tombstone = tombstone_path(self.root, self.participant)
        return (self.folder, self.grave, tombstone, self.root / FILE_NAME)


def look_up(root: Path, participant: str) -> Person:
    """Tell what there is of a person.

    Raises
    ------
    ArchiveError
        If nothing is there, if one of the places is a symbolic link, or the person's folder holds
        one: what it points to would stay.

    Examples
    --------
    >>> from pathlib import Path
    >>> look_up(Path("."), "../07")
    Traceback (most recent call last):
    experiment.archive.files.ArchiveError: participant must be 1 to 32 letters (a-z, A-Z) ...
    """
    check_identifier("participant", participant)
    if not root.is_dir():
        raise ArchiveError(f"{root}: there is no such folder")
    for path in (root / FILE_NAME, root / FOLDER, tombstone_path(root, participant)):
        _refuse_link(path)
    folder = root / f"sub-{participant}"
    there = folder.name in _names(root)
    person = Person(
        root=root,
        participant=participant,
        sessions=_names(folder) if there and _real_folder(folder) else (),
        files=_count_files(folder) if there else 0,
        in_table=read_people(root).row_of(participant) is not None,
        tombstone=read_tombstone(root, participant),
    )
    if person.grave.exists():
        _real_folder(person.grave)
    if not there and not person.in_table and person.tombstone is None:
        raise ArchiveError(f"{root}: there is no participant {participant} here")
    return person


def _names(folder: Path) -> tuple[str, ...]:
    """List what is in a folder: on some systems, asking for ``sub-a`` finds ``sub-A``."""
    return tuple(sorted(path.name for path in folder.iterdir()))


def _real_folder(folder: Path) -> bool:
    _refuse_link(folder)
    if not folder.is_dir():
        raise ArchiveError(f"{folder}: must be a folder; nothing was changed")
    return True


def _refuse_link(path: Path) -> None:
    if path.is_symlink():
        raise ArchiveError(
            f"{path}: must not be a symbolic link, whose target would stay; nothing was changed"
        )


def _count_files(folder: Path) -> int:
    """Count the files of a folder and refuse links among them."""
    count = 0
    for place, folders, files in os.walk(folder, onerror=_raise):
        for name in (*folders, *files):
            _refuse_link(folder / place / name)
        count += len(files)
    return count


def _raise(error: OSError) -> None:
    raise error


@contextlib.contextmanager
def held(person: Person) -> Iterator[contextlib.ExitStack]:
    """Hold all sessions of a person, so that none runs; yields what holds them.

    Raises
    ------
    ArchiveError
        If a session is being run.
    """
    with contextlib.ExitStack() as locks:
        for name in person.sessions:
            if not (person.folder / name).is_dir():
                continue
            try:
                locks.enter_context(lock_on(person.folder / name / ".lock", timeout=0))
            except Timeout as error:
                raise ArchiveError(
                    f"{person.folder / name}: another process is running this session; "
                    "nothing was changed"
                ) from error
        yield locks


def remove(
    person: Person, locks: contextlib.ExitStack, *, today: str, disk: Disk = DISK
) -> Tombstone:
    """Remove a person whose sessions are held.

    Parameters
    ----------
    person : Person
        What `look_up` found.
    locks : ExitStack
        What `held` yielded.
    today : str
        The day, as YYYY-MM-DD in UTC.
    disk : Disk
        Where it is kept.

    Returns
    -------
    Tombstone
        What stays. A withdrawal that was interrupted keeps its first day.

    Raises
    ------
    ArchiveError
        If something changed since `look_up`; nothing is changed then.
    """
    again = look_up(person.root, person.participant)
    if again.sessions != person.sessions:
        raise ArchiveError(f"{person.folder}: it changed meanwhile; nothing was changed")
    day = person.tombstone.withdrawn if person.tombstone else today
    begun = Tombstone(participant=person.participant, withdrawn=day, removed=False)
    # First the mark, on the disk: data that vanish without one look like data that were lost.
    write_tombstone(person.root, begun, disk=disk)
    _delete(person.grave)
    if person.folder.exists():
        if os.name == "nt":  # which moves no folder with an open file in it
            locks.close()
        # One rename, since deleting file by file would leave, if stopped, half a session that reads
        # like a whole one. A power cut must not bring the folder back once its files are gone.
        person.folder.rename(person.grave)
        disk.sync_folder(person.root)
    remove_person(person.root, person.participant, disk=disk)
    _delete(person.grave)
    # The last mark lies in the folder that the files went from: one sync is for both.
    done = Tombstone(participant=person.participant, withdrawn=day, removed=True)
    write_tombstone(person.root, done, disk=disk)
    return done


def _delete(folder: Path) -> None:
    if folder.exists():
        shutil.rmtree(folder)
