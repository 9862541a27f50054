"""Where a person's data still are: exports, analyses and other files that name them.

A file is taken to hold a person if its name or its contents have ``sub-<id>``, if it says
``participant`` with that id, or if it is a table with the id in its column of participants.
"""

from __future__ import annotations

import csv
import mmap
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from experiment.participants import ID_COLUMN

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

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
