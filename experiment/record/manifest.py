"""Folders of results that are replaced as a whole, and the manifest in each.

Every export and every analysis has a manifest that names the participants in its data, by which
`withdraw` finds the data of a person. An export is written next to its target and then moved into
place as a whole. Its manifest has the checksum of every file. Only an unchanged export is replaced,
so that files which a user added or changed are never deleted.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from experiment.bounded import read_bounded
from experiment.record.files import (
    DISK,
    FOLDER_MODE,
    WITHDRAWN_FOLDER,
    ArchiveError,
    delete_folder,
    make_folder,
    refuse_link,
    write_new,
)
from experiment.study.base import first_fault

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.record.files import Disk


NAME: Final = ".tactstrip.json"
_MAX_BYTES: Final = 10_000_000


class Manifest(BaseModel):
    """What a folder of results is, and whose data are in it."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    version: Literal[1] = Field(default=1, alias="schema")
    """Version of the file."""
    what: str
    """``BIDS data set`` or ``analysis``."""
    participants: tuple[str, ...]
    """Everybody of whom the folder holds data."""
    files: dict[str, str] = {}
    """Checksum of each file, by its path in the folder, where the folder is replaced as a whole."""

    def text(self) -> str:
        """Return the contents of the file."""
        return self.model_dump_json(by_alias=True, indent=1) + "\n"


def read_manifest(folder: Path) -> Manifest | None:
    """Read the manifest of a folder; None if it has none.

    Raises
    ------
    ValueError
        If it is damaged, or of another schema.
    """
    path = folder / NAME
    if not path.is_file():
        return None
    try:
        manifest = Manifest.model_validate_json(read_bounded(path, _MAX_BYTES))
    except ValidationError as error:
        raise ValueError(f"{path}: not a manifest: {first_fault(error)}") from error
    if "version" not in manifest.model_fields_set:
        raise ValueError(f"{path}: not a manifest: schema must be 1")
    return manifest


class FolderWriter:
    """A folder that is being filled; `sha256` has the checksum of each file for its manifest."""

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
def replace_folder(
    out: Path, source: Path, about: Manifest, disk: Disk = DISK
) -> Iterator[FolderWriter]:
    """Replace a folder as a whole: in the end it is complete, or unchanged.

    A process that is killed during the exchange leaves the former folder next to `out`, under
    another name; the next call for `out` removes it.

    Parameters
    ----------
    out : Path
        The folder: new, empty, or an unchanged export.
    source : Path
        The folder of the study, whose data must not be replaced.
    about : Manifest
        Description of the folder; the checksums of its files are added.
    disk : Disk
        Disk that holds the folder.

    Yields
    ------
    FolderWriter
        Writer of the files.

    Raises
    ------
    ArchiveError
        If `out` is anything else, or lies among the data of the study; nothing is changed then.
    """
    refuse_target(out, source)
    out = out.resolve()  # "." has no name of its own
    new = out.with_name(f".{out.name}.tactstrip-new")
    make_folder(out.parent, disk)
    delete_folder(new)
    new.mkdir(FOLDER_MODE)
    try:
        folder = FolderWriter(new, disk)
        yield folder
        files = dict(sorted(folder.sha256.items()))
        folder.write(NAME, about.model_copy(update={"files": files}).text())
        for parent, _, _ in os.walk(new):
            disk.sync_folder(Path(parent))
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
    """Raise ArchiveError for a folder that must not be replaced, see `replace_folder`."""
    refuse_link(out)
    target, study = out.resolve(), source.resolve()
    parts = target.relative_to(study).parts if target.is_relative_to(study) else None
    if parts == () or (parts and (parts[0].startswith("sub-") or parts[0] == WITHDRAWN_FOLDER)):
        raise ArchiveError(f"{out}: must not lie among the data that are exported")
    if not out.exists():
        return
    if not out.is_dir():
        raise ArchiveError(f"{out}: must be a folder; nothing was changed")
    present = {name: _sha256(out / name) for name in _files(out)}
    if not present:
        return
    try:
        manifest = read_manifest(out)
    except ValueError as error:
        raise ArchiveError(f"{error}; give another folder: nothing was changed") from error
    present.pop(NAME, None)
    listed = manifest.files if manifest else {}
    names = sorted({*present, *listed})
    changed = [name for name in names if present.get(name, "") != listed.get(name, "")]
    if changed or not manifest:
        raise ArchiveError(
            f"{out}: must be a new or empty folder, or an unchanged export; "
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
