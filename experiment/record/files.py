"""Files of a record: whose they are, what has surely arrived on the disk, and how they are locked.

Every file and folder of a study's data is made here. A file belongs to its owner and, where the
umask leaves it, to the group; others never get a right, because it holds data of a person.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import shutil
import stat
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from experiment.names import require_identifier

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path


TEMPORARY = ".tmp"
"""Ending of the name of a file that is still being written."""
WITHDRAWN_FOLDER: Final = "withdrawn"
"""The folder of a study's withdrawal records."""
PLAN, HEADER, JOURNAL, TABLE = "plan.json", "header.json", "journal.jsonl", "trials.csv"
MEASURED: Final = "measured.csv"
FILES: Final = (PLAN, HEADER, JOURNAL, TABLE, MEASURED)
"""The files of a session's record; the last one only if a monitor measured the bursts."""
LEVELS_SUFFIX: Final = ".toml"
"""How the name of a file of placed levels ends: by it, a withdrawal finds them."""
LOCK: Final = ".lock"
"""The file of a session that is locked while it is run, read or removed."""
RUNNING: Final = "another process is running this session; nothing was changed"
SESSIONS_TABLE: Final = "sessions.tsv"
"""The table of a person's sessions, with the hash of the last journal line of each."""


class ArchiveError(ValueError):
    """A folder or file of a record that cannot be used.

    The message is one line and names the file or the value. Errors that concern symbolic links are
    of the subclass `SymlinkError`.

    Examples
    --------
    >>> from pathlib import Path
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


class SymlinkError(ArchiveError):
    """A symbolic link in place of a folder or file of a record."""

    def __init__(self, path: Path, message: str = _LINK) -> None:
        super().__init__(f"{path}: {message}")
        self.path, self.message = path, message


def check_identifier(name: str, value: str) -> None:
    """Raise ArchiveError if a value cannot be the identifier of a participant or session."""
    try:
        require_identifier(name, value)
    except ValueError as error:
        raise ArchiveError(str(error)) from None


def refuse_link(path: Path) -> None:
    """Raise SymlinkError for a symbolic link: its target lies elsewhere and must not change."""
    if path.is_symlink():
        raise SymlinkError(path)


def person_of(folder: Path) -> Path:
    """Return the folder of a session's person, also for "." and "..", which have no parent's name.

    >>> from pathlib import Path
    >>> person_of(Path("sub-01/ses-01")).as_posix(), person_of(Path()).as_posix()
    ('sub-01', '..')
    """
    return folder / ".." if folder.name in {"", ".."} else folder.parent


def refuse_links(session: Path, table: str = TABLE) -> None:
    """Raise SymlinkError if a session's file or folder, or the person's, is a symbolic link."""
    person = person_of(session)
    if "sub-" in {person.name[:4], person.resolve().name[:4]}:
        refuse_link(person)
    for path in (session, *(session / name for name in (*FILES, LOCK, table))):
        refuse_link(path)


def tsv(rows: Iterable[Iterable[str]]) -> str:
    """Return rows of cells as the text of a table with tabs between the cells."""
    return "".join("\t".join(row) + "\n" for row in rows)


FILE_MODE: Final = 0o660
FOLDER_MODE: Final = 0o770
"""Less the umask, which the system takes off whatever is created."""
_NO_LOCKS: Final = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS, errno.EIO)
"""How systems say that a drive locks no files."""


class LockError(ValueError):
    """A folder in which files cannot be locked, so that two processes could write one record."""


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
    """Add the name of the file to an OSError, which lacks it for a file that is open."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


def write_new(path: Path, data: bytes, disk: Disk) -> None:
    """Write a new file. Its contents are on the disk when this returns; its name may not be."""
    file = disk.open(path, new=True)
    try:
        with _named(path):
            disk.write(file, data)
            disk.sync(file)
    finally:
        disk.close(file)


def make_folder(folder: Path, disk: Disk) -> None:
    """Create a folder and its parents if they do not exist; their names are on the disk."""
    if folder.is_dir():
        return
    make_folder(folder.parent, disk)
    try:
        folder.mkdir(FOLDER_MODE, exist_ok=True)
    except FileExistsError as error:  # "File exists" would not state what is wrong
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder)) from error
    disk.sync_folder(folder.parent)


def remove_left_overs(folder: Path, name: str = "") -> None:
    """Remove what processes left in a folder that were killed while they wrote the file `name`."""
    for path in folder.glob(f".{name}*{TEMPORARY}"):
        path.unlink()


def write_atomically(path: Path, content: bytes | str, *, disk: Disk = DISK) -> None:
    """Replace a file so that, after a crash, it is complete: the former file or the new one.

    Raises
    ------
    OSError
        If it cannot be written; the former file, if any, is unchanged then.
    """
    # The content is on the disk before the name, or the name could come to hold nothing.
    new = path.with_name(f".{path.name}.{secrets.token_hex(4)}{TEMPORARY}")
    try:
        data = content.encode() if isinstance(content, str) else content
        write_new(new, data, disk)
        new.replace(path)
        disk.sync_folder(path.parent)
    except BaseException as error:
        new.unlink(missing_ok=True)
        if isinstance(error, OSError):
            error.filename = str(path)
        raise


def delete_folder(folder: Path) -> None:
    """Delete a folder with its contents, if it exists."""
    if folder.exists():
        shutil.rmtree(folder)


@contextlib.contextmanager
def locked(path: Path, busy: str | None = None) -> Iterator[None]:
    """Hold the lock of a file, which is created with the rights of a record.

    Where the drive locks no files, nothing is left behind: the lock by a file's mere presence,
    which FileLock would take instead, stays after a kill, and somebody would have to know to
    delete it.

    Parameters
    ----------
    path : Path
        The file.
    busy : str, optional
        Message if another process holds the lock. Without it, the function waits for the lock.

    Raises
    ------
    ArchiveError
        If another process holds the lock and `busy` is given.
    LockError
        If the drive locks no files.
    """
    from filelock import FileLock, Timeout  # the help of commands that write must not wait for it

    is_new = not path.exists()
    path.touch(FILE_MODE)
    # Earlier releases of FileLock set their own mode on every file.
    mode = stat.S_IMODE(path.stat().st_mode)
    lock = FileLock(path, timeout=-1 if busy is None else 0, mode=mode, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout as error:
        raise ArchiveError(f"{path.parent}: {busy}") from error
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        if is_new:
            path.unlink(missing_ok=True)
        raise LockError(
            f"{path.parent}: this drive does not lock files ({error.strerror}), as some network "
            "drives do not; work in a folder on a local disk and copy it afterwards: nothing was "
            "changed"
        ) from error
    try:
        yield
    finally:
        lock.release()
