"""The disk as a record needs it: whose files they are, and what has surely arrived.

Every file and folder of a study's data is made here. A file belongs to its owner and, where the
umask leaves it, to the group; others never get a right, for what it holds is a person's.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from filelock import FileLock


FILE_MODE: Final = 0o660
FOLDER_MODE: Final = 0o770
"""Less the umask, which the system takes off whatever is created."""
_NO_LOCKS: Final = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS, errno.EIO)
"""How systems say that a drive locks no files."""


class LockError(ValueError):
    """A folder in which no file can be locked: two processes would write one record."""


@dataclass(eq=False)
class Disk:
    """The disk that holds a record; what is written may be lost until it is synced.

    A simulation, which has nothing to lose, does not wait for it.
    """

    waits: bool = True

    def open(self, path: Path, *, new: bool) -> int:
        """Open a file for writing: a new one, or one that is continued or made."""
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | (os.O_EXCL if new else 0)
        return os.open(path, flags | _BINARY, FILE_MODE)

    def write(self, file: int, data: bytes) -> None:
        """Write all of the data at the file's end, however little the system takes at once."""
        while data:
            data = data[os.write(file, data) :]

    def sync(self, file: int) -> None:
        """Return when everything written to the file is on the disk."""
        if self.waits:
            os.fsync(file)

    def close(self, file: int) -> None:
        """Close a file."""
        os.close(file)

    def sync_folder(self, folder: Path) -> None:
        """Return when the names in a folder are on the disk: a file without one is lost.

        Windows cannot do this.
        """
        if not self.waits or os.name == "nt":
            return
        handle = os.open(folder, os.O_RDONLY)
        try:
            with _named(folder):
                os.fsync(handle)
        finally:
            os.close(handle)


_BINARY: int = getattr(os, "O_BINARY", 0)
DISK: Final = Disk()
UNWAITED: Final = Disk(waits=False)


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    """Give a failure the name of its file, which the system leaves out of one on an open file."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


def write_new(path: Path, data: bytes, disk: Disk) -> None:
    """Write a new file, all of it on the disk when this returns; its name is not yet."""
    file = disk.open(path, new=True)
    try:
        with _named(path):
            disk.write(file, data)
            disk.sync(file)
    finally:
        disk.close(file)


def make_folder(folder: Path, disk: Disk) -> None:
    """Make a folder and those above it, where they are not there; their names are on the disk."""
    if folder.is_dir():
        return
    make_folder(folder.parent, disk)
    try:
        folder.mkdir(FOLDER_MODE, exist_ok=True)
    except FileExistsError as error:  # "File exists" would not tell what is wrong with that
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder)) from error
    disk.sync_folder(folder.parent)


@contextlib.contextmanager
def lock_on(path: Path, timeout: float = -1) -> Iterator[FileLock]:
    """Hold the lock of a file, which is made here: by itself FileLock lets others read it.

    The mode is told nevertheless, for earlier releases of FileLock set theirs on every file. Where
    the drive locks no files, nothing is left behind: the lock by a file's mere presence, which
    FileLock would take instead, stays after a kill, and somebody would have to know to delete it.

    Raises
    ------
    filelock.Timeout
        If another process holds it for longer than the timeout, in seconds; -1 waits for ever.
    LockError
        If the drive locks no files.
    """
    from filelock import FileLock  # the help of commands that write must not wait for it

    made = not path.exists()
    path.touch(FILE_MODE)
    mode = stat.S_IMODE(path.stat().st_mode)
    lock = FileLock(path, timeout=timeout, mode=mode, fallback_to_soft=False)
    try:
        lock.acquire()
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        if made:
            path.unlink(missing_ok=True)
        raise LockError(
            f"{path.parent}: this drive does not lock files ({error.strerror}), as some network "
            "drives do not; work in a folder on a local disk and copy it afterwards: nothing was "
            "changed"
        ) from error
    try:
        yield lock
    finally:
        lock.release()
