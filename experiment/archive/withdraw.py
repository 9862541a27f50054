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
from dataclasses import dataclass
from typing import TYPE_CHECKING

from experiment.archive.disk import DISK
from experiment.archive.files import (
    FOLDER,
    LOCK,
    RUNNING,
    ArchiveError,
    check_identifier,
    delete_folder,
    locked,
    refuse_link,
)
from experiment.archive.participants import (
    FILE_NAME,
    Tombstone,
    read_people,
    read_tombstone,
    remove_person,
    tombstone_path,
    write_tombstone,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from experiment.archive.disk import Disk


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
    experiment.archive.files.ArchiveError: participant: must be 1 to 32 letters (a-z, A-Z) ...
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
