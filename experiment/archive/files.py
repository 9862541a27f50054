"""Files and folders put in place as a whole or not at all, and the identifiers in their names.

An export is made beside its place. A file in it lists every file of it with its checksum: only a
folder that is still what an export made is replaced, and what was added or changed since is
nobody's to delete.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Final

from experiment.archive.journal import sync_folder

if TYPE_CHECKING:
    from collections.abc import Iterator


TEMPORARY = ".tmp"
"""How the name of a file ends that is still being written."""
_TOTALS = "all"
"""What the analysis calls its rows of totals: nobody's name."""
_IDENTIFIER = re.compile(r"[A-Za-z0-9]{1,32}")


class ArchiveError(ValueError):
    """A session's folder that is there and must not be, or the other way round."""


def check_identifier(name: str, value: str) -> str:
    """Return a participant's or session's identifier.

    Raises
    ------
    ArchiveError
        Unless it consists of 1 to 32 letters a-z, A-Z and digits, and is not ``all``.
    """
    if not _IDENTIFIER.fullmatch(value) or value == _TOTALS:
        raise ArchiveError(
            f"{name} must be 1 to 32 letters (a-z, A-Z) or digits, and not {_TOTALS!r}; "
            f"got {value!r}"
        )
    return value


def write_atomically(path: Path, text: str, *, durable: bool = True) -> None:
    """Write a file so that it is either there as a whole or as it was before.

    Raises
    ------
    OSError
        If it cannot be written; the former file, if any, is unchanged then.
    """
    try:
        _write_and_replace(path, text, durable=durable)
    except OSError as error:
        error.filename = str(path)
        raise
    if durable:
        sync_folder(path.parent)


def _write_and_replace(path: Path, text: str, *, durable: bool) -> None:
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=TEMPORARY, dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


MANIFEST: Final = ".tactstrip-export.json"
SCHEMA: Final = 1


class NewFolder:
    """A folder that is being filled; it keeps the checksum of each file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._sha256: dict[str, str] = {}

    def write(self, name: str, content: bytes | str) -> None:
        """Write a file, by its path in the folder; it is on the disk when this returns."""
        data = content.encode() if isinstance(content, str) else content
        file = self._path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("xb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        self._sha256[name] = hashlib.sha256(data).hexdigest()

    def close(self) -> None:
        """Write the list of files, and wait until all their names are on the disk."""
        listed = dict(sorted(self._sha256.items()))
        self.write(MANIFEST, json.dumps({"schema": SCHEMA, "files": listed}, indent=1) + "\n")
        for place, _, _ in os.walk(self._path):
            sync_folder(Path(place))


@contextlib.contextmanager
def replaced(out: Path, source: Path) -> Iterator[NewFolder]:
    """Make a folder anew: it is there as a whole when this ends, or as it was before.

    Parameters
    ----------
    out : Path
        The folder; where it is there, an unchanged export.
    source : Path
        The study's folder that is exported.

    Raises
    ------
    ArchiveError
        If there is something at `out` that is not an unchanged export, or it lies where a person's
        data are; nothing is changed then.

    Notes
    -----
    A process killed between the two steps of the exchange leaves the former export beside `out`
    under a name of its own; the next export to `out` removes it.
    """
    refuse_target(out, source)
    out = out.resolve()  # "." has no name of its own
    new = out.with_name(f".{out.name}.tactstrip-new")
    out.parent.mkdir(parents=True, exist_ok=True)
    _delete(new)
    new.mkdir()
    try:
        folder = NewFolder(new)
        yield folder
        folder.close()
        refuse_target(out, source)
        _exchange(new, out)
    finally:
        _delete(new)


def _exchange(new: Path, out: Path) -> None:
    old = out.with_name(f".{out.name}.tactstrip-old")
    if out.exists():
        _delete(old)
        out.rename(old)
    try:
        new.rename(out)
    except OSError:
        old.rename(out)
        raise
    sync_folder(out.parent)
    _delete(old)


def _delete(folder: Path) -> None:
    if folder.exists():
        shutil.rmtree(folder)


def refuse_target(out: Path, source: Path) -> None:
    """Refuse a place that an export may not take.

    Raises
    ------
    ArchiveError
        As `replaced`.
    """
    if out.is_symlink():
        raise ArchiveError(f"{out}: must not be a symbolic link; nothing was changed")
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
    if MANIFEST not in there:
        return f"with {there[0]}, which is no export"
    listed = _listed(out / MANIFEST)
    if listed is None:
        return f"with a damaged {MANIFEST}"
    there.remove(MANIFEST)
    for name in there:
        if name not in listed:
            return f"with {name} added"
        if _sha256(out / name) != listed[name]:
            return f"with {name} changed"
    gone = sorted(set(listed) - set(there))
    return f"with {gone[0]} removed" if gone else None


def _files(folder: Path) -> Iterator[str]:
    """List everything that is no real folder, and real folders that are empty."""
    for path in folder.rglob("*"):
        if path.is_symlink() or not path.is_dir() or not any(path.iterdir()):
            yield path.relative_to(folder).as_posix()


def _listed(manifest: Path) -> dict[str, str] | None:
    try:
        contents = json.loads(manifest.read_bytes())
        if contents["schema"] == SCHEMA:
            return dict(contents["files"])
    except (ValueError, KeyError, TypeError):
        pass
    return None


def _sha256(path: Path) -> str | None:
    if path.is_symlink() or not path.is_file():
        return None
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


FOLDER: Final = "withdrawn"
