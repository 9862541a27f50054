"""What was made of sessions, and of whom: every export and analysis has a manifest that says so.

By these, by folders of sessions and by files of levels, a withdrawal tells what still holds a
person. Files of other origin are nobody's to guess about: a search that must find a name in any
file finds too much in some and nothing in others, and its silence reads as "nowhere".
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from experiment.bounded import read_bounded
from experiment.record.files import (
    DISK,
    FOLDER,
    FOLDER_MODE,
    ArchiveError,
    delete_folder,
    make_folder,
    refuse_link,
    write_new,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from experiment.record.files import Disk


NAME: Final = ".tactstrip.json"
SCHEMA: Final = 1
_MAX_MANIFEST_BYTES: Final = 10_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """What a folder is, whose data are in it, and, where it is replaced as a whole, its files.

    Attributes
    ----------
    what : str
        ``BIDS data set`` or ``analysis``.
    participants : tuple of str
        Everybody of whom it holds something.
    files : mapping of str to str
        The checksum of each file, by its path in the folder.
    """

    what: str
    participants: tuple[str, ...]
    files: Mapping[str, str] = field(default_factory=dict)

    def text(self) -> str:
        """Write it as it stands in its file."""
        return json.dumps({"schema": SCHEMA} | asdict(self), ensure_ascii=False, indent=1) + "\n"


def read_manifest(folder: Path) -> Manifest | None:
    """Read the manifest of a folder; none if it has none.

    ValueError where it is damaged, however, or of another schema.
    """
    path = folder / NAME
    if not path.is_file():
        return None
    try:
        contents = json.loads(read_bounded(path, _MAX_MANIFEST_BYTES))
    except (ValueError, RecursionError) as error:  # the latter of brackets without end
        raise ValueError(f"{path}: not a manifest: {error}") from error
    match contents:
        case {"schema": 1, "what": str(what), "participants": [*people], "files": dict(files)} if (
            all(isinstance(text, str) for text in (*people, *files.values()))
        ):
            return Manifest(what=what, participants=tuple(people), files=files)
    rule = "must have schema 1, what, participants (a list of texts) and files"
    raise ValueError(f"{path}: not a manifest: {rule}")


class NewFolder:
    """A folder that is being filled; it keeps the checksum of each file for its manifest."""

    def __init__(self, path: Path, disk: Disk) -> None:
        self._path = path
        self._disk = disk
        self.sha256: dict[str, str] = {}

    def write(self, name: str, content: bytes | str) -> None:
        """Write a file, by its path in the folder; it is on the disk when this returns."""
        data = content.encode() if isinstance(content, str) else content
        file = self._path / name
        make_folder(file.parent, self._disk)
        write_new(file, data, self._disk)
        self.sha256[name] = hashlib.sha256(data).hexdigest()


@contextlib.contextmanager
def replaced(out: Path, source: Path, about: Manifest, disk: Disk = DISK) -> Iterator[NewFolder]:
    """Make a folder anew: it is there as a whole when this ends, or as it was before.

    ArchiveError, and nothing changed, where `out` is anything but an unchanged export, or lies
    where a person's data are. A process killed within the exchange leaves the former export beside
    `out` under a name of its own; the next export to `out` removes it.
    """
    refuse_target(out, source)
    out = out.resolve()  # "." has no name of its own
    new = out.with_name(f".{out.name}.tactstrip-new")
    make_folder(out.parent, disk)
    delete_folder(new)
    new.mkdir(FOLDER_MODE)
    try:
        folder = NewFolder(new, disk)
        yield folder
        listed = dict(sorted(folder.sha256.items()))
        folder.write(NAME, replace(about, files=listed).text())
        for place, _, _ in os.walk(new):
            disk.sync_folder(Path(place))
        refuse_target(out, source)
        _exchange(new, out, disk)
    finally:
        delete_folder(new)


def _exchange(new: Path, out: Path, disk: Disk) -> None:
    old = out.with_name(f".{out.name}.tactstrip-old")
    if out.exists():
        delete_folder(old)
        out.rename(old)
    try:
        new.rename(out)
    except OSError:
        old.rename(out)
        raise
    disk.sync_folder(out.parent)
    delete_folder(old)


def refuse_target(out: Path, source: Path) -> None:
    """Refuse a place that an export may not take.

    ArchiveError as `replaced`.
    """
    refuse_link(out)
    place, home = out.resolve(), source.resolve()
    inside = place.relative_to(home).parts if place.is_relative_to(home) else None
    if inside == () or (inside and (inside[0].startswith("sub-") or inside[0] == FOLDER)):
        raise ArchiveError(f"{out}: must not lie among the data that are exported")
    if not out.exists():
        return
    if not out.is_dir():
        raise ArchiveError(f"{out}: must be a folder; nothing was changed")
    there = {name: _sha256(out / name) for name in _files(out)}
    if not there:
        return
    try:
        made = read_manifest(out)
    except ValueError as error:
        raise ArchiveError(f"{error}; give another folder: nothing was changed") from error
    there.pop(NAME, None)
    listed = made.files if made else {}
    names = sorted({*there, *listed})
    changed = [name for name in names if there.get(name, "") != listed.get(name, "")]
    if changed or not made:
        raise ArchiveError(
            f"{out}: must be a new or empty folder, or an export that nobody changed; "
            f"{changed[0] if changed else NAME} was added, changed or removed; give "
            "another folder: nothing was changed"
        )


def _files(folder: Path) -> Iterator[str]:
    """List everything that is no real folder, and real folders that are empty."""
    for path in folder.rglob("*"):
        if path.is_symlink() or not path.is_dir() or not any(path.iterdir()):
            yield path.relative_to(folder).as_posix()


def _sha256(path: Path) -> str | None:
    if path.is_symlink() or not path.is_file():
        return None
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
