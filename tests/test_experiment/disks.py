"""Disks that lose what was not synced, or that are full, and what is written to them."""

from __future__ import annotations

import errno
import os
from typing import TYPE_CHECKING, Any

from experiment.record.files import Disk, write_atomically
from experiment.record.manifest import Manifest, replace_folder
from experiment.record.withdraw import find_person, locked_sessions, remove

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    import pytest


class LossyDisk(Disk):
    """A disk that loses everything after the last sync: names and contents, each by itself.

    It works on real files. What has arrived is what a file held, or which names a folder had, when
    it was synced last; a file or folder without a synced name is not found after a power cut.
    """

    def __init__(self) -> None:
        super().__init__(waits=False)
        self._open: dict[int, Path] = {}
        self._contents: dict[int, bytes] = {}
        self._names: dict[int, dict[str, int]] = {}
        self.opened = 0
        self.closed = 0

    def open(self, path: Path, *, new: bool) -> int:
        made = not path.exists()
        file = super().open(path, new=new)
        if made:  # an inode may have been another file's
            self._contents.pop(os.fstat(file).st_ino, None)
        self._open[file] = path
        self.opened += 1
        return file

    def write(self, file: int, data: bytes) -> None:
        super().write(file, data)

    def sync(self, file: int) -> None:
        self._contents[os.fstat(file).st_ino] = self._open[file].read_bytes()

    def close(self, file: int) -> None:
        del self._open[file]
        super().close(file)
        self.closed += 1

    def sync_folder(self, folder: Path) -> None:
        self._names[folder.stat().st_ino] = {
            path.name: path.stat().st_ino for path in folder.iterdir()
        }

    def holds(self, folder: Path) -> dict[str, bytes]:
        """Return what is found below a folder after a power cut: the files, with what they hold."""
        return dict(self._found(folder.stat().st_ino, ""))

    def _found(self, inode: int, prefix: str) -> Iterator[tuple[str, bytes]]:
        for name, inner in self._names.get(inode, {}).items():
            if inner in self._names:
                yield from self._found(inner, f"{prefix}{name}/")
            else:
                yield f"{prefix}{name}", self._contents.get(inner, b"")

    def knows(self, folder: Path) -> None:
        """Take all that is there for safe."""
        for place, _, files in os.walk(folder):
            here = folder / place
            self.sync_folder(here)
            for name in files:
                self._contents[(here / name).stat().st_ino] = (here / name).read_bytes()


class FullDisk:
    """Lets every operation that needs room fail from the n-th on.

    It stands below the program, at the system's calls. What is written when it is full is cut short
    first, as systems do.
    """

    def __init__(self, patch: pytest.MonkeyPatch, *, full_at: int) -> None:
        self._full_at = full_at
        self.done = 0
        for name in ("open", "write", "fsync", "mkdir", "replace"):
            patch.setattr(os, name, self._limited(name, getattr(os, name)))

    @property
    def full(self) -> bool:
        return self.done >= self._full_at

    def _limited(self, name: str, system: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            if name == "open" and not args[1] & os.O_CREAT:
                return system(*args, **kwargs)
            self.done += 1
            if self.full:
                if name == "write" and self.done == self._full_at and len(args[1]) > 1:
                    system(args[0], args[1][: len(args[1]) // 2])
                path = args[0] if name in {"open", "mkdir"} else None
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path)
            return system(*args, **kwargs)

        return call


def write_file(path: Path, text: str, disk: Disk) -> None:
    """Write a file of a study."""
    write_atomically(path, text, disk=disk)


def write_export(folder: Path, study: Path, text: str, disk: LossyDisk) -> None:
    """Write an export of two files, in place of the one that is there."""
    about = Manifest(what="BIDS data set", participants=("01",))
    with replace_folder(folder, study, about, disk) as new:
        new.write("README", text)
        new.write("sub-01/beh/events.tsv", text)


def withdraw(results: Path, disk: LossyDisk) -> None:
    """Remove participant 01."""
    person = find_person(results, "01")
    with locked_sessions(person) as locks:
        remove(person, locks, today="2026-01-02", disk=disk)
