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

from filelock import Timeout

from experiment.archive import manifest
from experiment.archive.disk import DISK, FOLDER_MODE, lock_on, make_folder, write_new
from experiment.names import require_identifier

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from experiment.archive.disk import Disk
    from experiment.archive.manifest import Manifest


TEMPORARY = ".tmp"
"""How the name of a file ends that is still being written."""
FOLDER: Final = "withdrawn"
"""Where a study's folder keeps what says that people withdrew."""
PLAN, HEADER, JOURNAL, TABLE = "plan.json", "header.json", "journal.jsonl", "trials.csv"
MEASURED: Final = "measured.csv"
FILES: Final = (PLAN, HEADER, JOURNAL, TABLE, MEASURED)
"""The files that are the record of a session; the last one where a monitor measured the bursts."""
LOCK: Final = ".lock"
"""The file of a session that is locked while it is run, read or removed."""
RUNNING: Final = "another process is running this session; nothing was changed"
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
    ArchiveError session: must be 1 to 32 letters (a-z, A-Z) or digits, ... (got 'ses-01')
    """


_LINK: Final = (
    "must not be a symbolic link, for what it points to lies elsewhere; put the file or folder "
    "itself there: nothing was changed"
)


class LinkError(ArchiveError):
    """A symbolic link where a session's own folder or file has to be."""

    def __init__(self, path: Path, message: str = _LINK) -> None:
        super().__init__(f"{path}: {message}")
        self.path, self.message = path, message


def check_identifier(name: str, value: str) -> None:
    """Refuse what cannot be a participant's or session's identifier, by an ArchiveError."""
    try:
        require_identifier(name, value)
    except ValueError as error:
        raise ArchiveError(str(error)) from None


def refuse_link(path: Path) -> None:
    """Refuse a symbolic link: what is written or removed there would be another place's.

    LinkError where it is one.
    """
    if path.is_symlink():
        raise LinkError(path)


def person_of(folder: Path) -> Path:
    """Return the folder of a session's person, of "." too, which names no other folder.

    >>> from pathlib import Path
    >>> person_of(Path("sub-01/ses-01")).as_posix(), person_of(Path()).as_posix()
    ('sub-01', '..')
    """
    return folder / ".." if folder.name in {"", ".."} else folder.parent


def refuse_links(session: Path, table: str = TABLE) -> None:
    """Refuse a session of which a file, the folder or the person's is a symbolic link.

    LinkError for the first.
    """
    person = person_of(session)
    if "sub-" in {person.name[:4], person.resolve().name[:4]}:
        refuse_link(person)
    for path in (session, *(session / name for name in (*FILES, LOCK, table))):
        refuse_link(path)


def tsv(rows: Iterable[Iterable[str]]) -> str:
    """Write cells with tabs between them, one line a row."""
    return "".join("\t".join(row) + "\n" for row in rows)


def remove_left_overs(folder: Path, name: str = "") -> None:
    """Remove what processes left that were killed while they wrote a file, or any, of a folder."""
    for path in folder.glob(f".{name}*{TEMPORARY}"):
        path.unlink()


def write_atomically(path: Path, text: str, *, disk: Disk = DISK) -> None:
    """Write a file so that it is either there as a whole or as it was before.

    Raises
    ------
    OSError
        If it cannot be written; the former file, if any, is unchanged then.
    """
    # The content is on the disk before the name, or the name could come to hold nothing.
    new = path.with_name(f".{path.name}.{secrets.token_hex(4)}{TEMPORARY}")
    try:
        write_new(new, text.encode(), disk)
        new.replace(path)
        disk.sync_folder(path.parent)
    except BaseException as error:
        new.unlink(missing_ok=True)
        if isinstance(error, OSError):
            error.filename = str(path)
        raise


@contextlib.contextmanager
def locked(path: Path, busy: str) -> Iterator[None]:
    """Hold the lock of a file; ArchiveError, which says what is `busy`, where another one does."""
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(lock_on(path, timeout=0))
        except Timeout as error:
            raise ArchiveError(f"{path.parent}: {busy}") from error
        yield


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
        folder.write(manifest.NAME, replace(about, files=listed).text())
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
    there = {name: _sha256(out / name) for name in _files(out)}
    if not there:
        return
    try:
        made = manifest.read_manifest(out)
    except ValueError as error:
        raise ArchiveError(f"{error}; give another folder: nothing was changed") from error
    there.pop(manifest.NAME, None)
    listed = made.files if made else {}
    names = sorted({*there, *listed})
    changed = [name for name in names if there.get(name, "") != listed.get(name, "")]
    if changed or not made:
        raise ArchiveError(
            f"{out}: must be a new or empty folder, or an export that nobody changed; "
            f"{changed[0] if changed else manifest.NAME} was added, changed or removed; give "
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
