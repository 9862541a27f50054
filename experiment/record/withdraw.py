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
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from experiment.bounded import parse_toml, read_bounded
from experiment.record.files import (
    DISK,
    FOLDER,
    LOCK,
    RUNNING,
    ArchiveError,
    check_identifier,
    delete_folder,
    locked,
    refuse_link,
)
from experiment.record.manifest import NAME, read_manifest
from experiment.record.people import (
    FILE_NAME,
    Tombstone,
    read_people,
    read_tombstone,
    remove_person,
    tombstone_path,
    write_tombstone,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from experiment.record.files import Disk

MAX_LEVELS_BYTES: Final = 100_000
"""No file of levels is larger."""
LEVELS_SUFFIX: Final = ".toml"
"""How the name of a file of placed levels ends: by it, a withdrawal finds them."""


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
    def removed_paths(self) -> tuple[Path, ...]:
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
    experiment.record.files.ArchiveError: participant: must be 1 to 32 letters (a-z, A-Z) ...
    """
    check_identifier("participant", participant)
    if not root.is_dir():
        raise ArchiveError(f"{root}: there is no such folder")
    for path in (root / FILE_NAME, root / FOLDER, tombstone_path(root, participant)):
        refuse_link(path)
    folder = root / f"sub-{participant}"
    # On some systems, asking for ``sub-a`` finds ``sub-A``.
    is_there = folder.name in {path.name for path in root.iterdir()}
    person = Person(
        root=root,
        participant=participant,
        files=_count_files(folder) if is_there else 0,
        sessions=_folders_in(folder) if is_there else (),
        in_table=folder.name in read_people(root).rows,
        tombstone=read_tombstone(root, participant),
    )
    refuse_link(person.grave)
    if not is_there and not person.in_table and person.tombstone is None:
        raise ArchiveError(f"{root}: there is no participant {participant} here")
    return person


def _folders_in(folder: Path) -> tuple[str, ...]:
    return tuple(sorted(path.name for path in folder.iterdir() if path.is_dir()))


def _count_files(folder: Path) -> int:
    """Count the files of a person's folder and refuse links among them."""
    refuse_link(folder)
    if not folder.is_dir():
        raise ArchiveError(f"{folder}: must be a folder; nothing was changed")
    count = 0
    for place, folders, files in os.walk(folder, onerror=_raise):
        for name in (*folders, *files):
            refuse_link(folder / place / name)
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
            locks.enter_context(locked(person.folder / name / LOCK, RUNNING))
        yield locks


def remove(person: Person, locks: contextlib.ExitStack, *, today: str, disk: Disk = DISK) -> None:
    """Remove a person whose sessions are held; a withdrawal that was interrupted keeps its day.

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
    delete_folder(person.grave)
    if person.folder.exists():
        if os.name == "nt":  # which moves no folder with an open file in it
            locks.close()
        # One rename, since deleting file by file would leave, if stopped, half a session that reads
        # like a whole one. A power cut must not bring the folder back once its files are gone.
        person.folder.rename(person.grave)
        disk.sync_folder(person.root)
    remove_person(person.root, person.participant, disk=disk)
    delete_folder(person.grave)
    # The last mark lies in the folder that the files went from: one sync is for both.
    done = Tombstone(participant=person.participant, withdrawn=day, removed=True)
    write_tombstone(person.root, done, disk=disk)


@dataclass(frozen=True, slots=True, order=True)
class Holding:
    """Something that holds a person."""

    path: Path  # a folder or a file
    what: str  # "BIDS data set", "analysis", "sessions" or "levels"


@dataclass(frozen=True, slots=True)
class Search:
    """What a search found.

    Attributes
    ----------
    holdings : tuple of Holding
        What holds the person, by path.
    not_searched : tuple of Path
        Links, damaged manifests, and what could not be read: somebody has to look into them.
    """

    holdings: tuple[Holding, ...]
    not_searched: tuple[Path, ...]


_PERSON: Final = re.compile(r"sub-[A-Za-z0-9]+")


def search(folders: Iterable[Path], participant: str, leave_out: Iterable[Path] = ()) -> Search:
    """Look for what was made of a person's sessions; links are not followed.

    Parameters
    ----------
    folders : iterable of Path
        Where to look, with everything below.
    participant : str
        The person's identifier.
    leave_out : iterable of Path
        Folders that are known already.

    Examples
    --------
    >>> import tempfile
    >>> from experiment.record.manifest import Manifest
    >>> with tempfile.TemporaryDirectory() as name:
    ...     manifest = Manifest(what="analysis", participants=("07", "08"))
    ...     _ = (Path(name) / NAME).write_text(manifest.text())
    ...     [len(search([Path(name)], who).holdings) for who in ("07", "7", "analysis")]
    [1, 0, 0]
    """
    search = _Search(participant, {path.resolve() for path in leave_out})
    for top in folders:
        for place, names, files in os.walk(top.resolve(), onerror=search.miss):
            search.look_at(Path(place), names, files)
    return Search(tuple(sorted(search.holdings)), tuple(sorted(search.missed)))


class _Search:
    """One search: what holds the person, and what could not be searched."""

    def __init__(self, participant: str, excluded: set[Path]) -> None:
        self._participant = participant
        self._excluded = excluded
        self._listed: set[Path] = set()  # by the manifests of exports: files and their folders
        self.holdings: set[Holding] = set()
        self.missed: set[Path] = set()

    def miss(self, error: OSError) -> None:
        self.missed.add(Path(error.filename))

    def look_at(self, here: Path, names: list[str], files: list[str]) -> None:
        """Look at a folder, and keep of the names of folders in it those to look into."""
        links = {here / name for name in (*names, *files) if (here / name).is_symlink()}
        self.missed |= links - self._excluded
        for path in sorted({here / name for name in files} - links):
            try:
                self._look_at_file(path)
            except OSError:
                self.missed.add(path)
        names[:] = [name for name in names if self._enters(here / name)]

    def _look_at_file(self, path: Path) -> None:
        """Note a folder whose manifest names the person, or levels that were placed for them."""
        if path.name == NAME:
            try:
                manifest = read_manifest(path.parent)
            except ValueError:
                self.missed.add(path)
                return
            if manifest and self._participant in manifest.participants:
                self.holdings.add(Holding(path.parent, manifest.what))
            for name in map(Path, manifest.files if manifest else ()):
                self._listed |= {path.parent / part for part in (name, *name.parents)}
        elif path.suffix == LEVELS_SUFFIX:
            with contextlib.suppress(ValueError, RecursionError):  # `levels` did not write it
                table = parse_toml(read_bounded(path, MAX_LEVELS_BYTES).decode("utf-8"))
                if table.get("participant") == self._participant and "levels_vpp" in table:
                    self.holdings.add(Holding(path, "levels"))

    def _enters(self, folder: Path) -> bool:
        """Note a copy of the person's sessions; other people's folders need no search.

        An export is named as a whole; in its folders may be what somebody put there since.
        """
        if folder in self._excluded or folder.is_symlink():
            return False
        if folder in self._listed or not _PERSON.fullmatch(folder.name):
            return True
        if folder.name == f"sub-{self._participant}":
            self.holdings.add(Holding(folder, "sessions"))
        return False
