"""Files and folders put in place as a whole or not at all, and the identifiers in their names.

An export is made beside its place. A file in it lists every file of it with its checksum: only a
folder that is still what an export made is replaced, and what was added or changed since is
nobody's to delete.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from experiment.archive import manifest
from experiment.archive.disk import DISK, FOLDER_MODE, make_folder, write_new
from experiment.names import require_identifier

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.archive.disk import Disk
    from experiment.archive.manifest import Manifest


TEMPORARY = ".tmp"
"""How the name of a file ends that is still being written."""
HEADS: Final = "sessions.tsv"
"""What a person's folder has beside the sessions: the hash of each one's last journal line."""


class ArchiveError(ValueError):
    """A session folder or another file of the archive that cannot be used.

    The message is one line and names the file or the value. Errors that concern symbolic links are
    of the subclass `LinkError`.

    Examples
    --------
    >>> from experiment import SessionFolder
    >>> try:
    ...     SessionFolder(Path("results"), "01", "ses-01")
    ... except ValueError as error:
    ...     print(type(error).__name__, error)
    ArchiveError session must be 1 to 32 letters (a-z, A-Z) or digits, ...; got 'ses-01'
    """


class LinkError(ArchiveError):
    """A symbolic link where a session's own folder or file has to be."""

    def __init__(self, path: Path, message: str) -> None:
        super().__init__(f"{path}: {message}")
        self.path, self.message = path, message


def check_identifier(name: str, value: str) -> str:
    """Return a participant's or session's identifier.

    ArchiveError where `require_identifier` refuses it.
    """
    try:
        require_identifier(name, value)
    except ValueError as error:
        raise ArchiveError(str(error)) from None
    return value


def refuse_link(path: Path) -> None:
    """Refuse a symbolic link: what is written or removed there would be another place's.

    LinkError where it is one.
    """
    if path.is_symlink():
        raise LinkError(
            path,
            "must not be a symbolic link, for what it points to lies elsewhere; put the file or "
            "folder itself there: nothing was changed",
        )


def write_atomically(path: Path, text: str, *, disk: Disk = DISK) -> None:
    """Write a file so that it is either there as a whole or as it was before.

    Raises
    ------
    OSError
        If it cannot be written; the former file, if any, is unchanged then.
    """
    try:
        _write_and_replace(path, text.encode(), disk)
    except OSError as error:
        error.filename = str(path)
        raise


def _write_and_replace(path: Path, data: bytes, disk: Disk) -> None:
    """Write beside the file and rename; content first, or the name could come to hold nothing."""
    new = path.with_name(f".{path.name}.{secrets.token_hex(4)}{TEMPORARY}")
    try:
        write_new(new, data, disk)
        new.replace(path)
    except BaseException:
        new.unlink(missing_ok=True)
        raise
    disk.sync_folder(path.parent)


class NewFolder:
    """A folder that is being filled; it keeps the checksum of each file for its manifest."""

    def __init__(self, path: Path, manifest: Manifest, disk: Disk) -> None:
        self._path = path
        self._manifest = manifest
        self._disk = disk
        self._sha256: dict[str, str] = {}

    def write(self, name: str, content: bytes | str) -> None:
        """Write a file, by its path in the folder; it is on the disk when this returns."""
        data = content.encode() if isinstance(content, str) else content
        file = self._path / name
        make_folder(file.parent, self._disk)
        write_new(file, data, self._disk)
        self._sha256[name] = hashlib.sha256(data).hexdigest()

    def close(self) -> None:
        """Write the manifest, and wait until the names of all files are on the disk."""
        listed = dict(sorted(self._sha256.items()))
        self.write(manifest.NAME, replace(self._manifest, files=listed).text())
        for place, _, _ in os.walk(self._path):
            self._disk.sync_folder(Path(place))


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
        folder = NewFolder(new, about, disk)
        yield folder
        folder.close()
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


def delete_folder(folder: Path) -> None:
    """Delete a folder with all in it, where it is there."""
    if folder.exists():
        shutil.rmtree(folder)


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
    found = _first_change(out)
    if found is not None:
        raise ArchiveError(
            f"{out}: must be a new or empty folder, or an export that nobody changed; got one "
            f"{found}; give another folder: nothing was changed"
        )


def _first_change(out: Path) -> str | None:
    """Say in what a folder differs from what an export made; none for an empty folder."""
    there = sorted(_files(out))
    if not there:
        return None
    if manifest.NAME not in there:
        return f"with {there[0]}, which is no export"
    try:
        made = manifest.read_manifest(out)
    except ValueError:
        made = None
    if made is None:
        return f"with a damaged {manifest.NAME}"
    there.remove(manifest.NAME)
    for name in there:
        if name not in made.files:
            return f"with {name} added"
        if _sha256(out / name) != made.files[name]:
            return f"with {name} changed"
    gone = sorted(set(made.files) - set(there))
    return f"with {gone[0]} removed" if gone else None


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


FOLDER: Final = "withdrawn"
