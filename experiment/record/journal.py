"""The journal of a session: append-only lines in a chain of hashes, on disk when it matters.

One line is one event: ``{"crc":"<8 hex digits>","schema":5,"seq":n,"prev":"<64 hex digits>",
"event":...,...}``. The checksum is the CRC-32 of the line without its ``crc`` member: of the bytes
``{"schema":...}``. ``prev`` is the SHA-256 of the line before without its line end, so that the
hash of the last line, the final hash, depends on the whole journal. The checksum names the line in
which a disk fault or a mistake changed something; no change can keep the final hash.

A line is synced before anything that a later line cannot undo: a stimulus that is armed under a
token, the end of a trial, a wait for a person. A sync includes all lines before it, so that the
others need none of their own. Between FIRE and the answer nothing is written, because a slow disk
would lengthen the reaction time.
"""

from __future__ import annotations

import hashlib
import os
import re
import time
import zlib
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any, Final, Self

from pydantic import ValidationError
from pydantic_core import from_json, to_json

from device.clock import uptime_s
from experiment.names import OTHER_VERSION
from experiment.record.entries import LINES, Entry
from experiment.record.files import DISK, write_new
from experiment.study.base import first_fault

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.record.entries import Line
    from experiment.record.files import Disk


SCHEMA: Final = 5
"""Version of the lines; a journal of another version is refused."""
ROOT = "0" * 64
"""What the first line has for the hash of the line before."""
_LINE = re.compile(rb'\{"crc":"([0-9a-f]{8})",')
_BRACE = zlib.crc32(b"{")
"""The checksum is of this and of what follows its own member."""


class JournalError(ValueError):
    """A journal that cannot be trusted.

    The message is one line. Where a single line of the journal is at fault, the message begins with
    the file and the number of that line.

    Examples
    --------
    The checksum of a line does not match after a character has changed:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from experiment.record.entries import NoteTaken
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "journal.jsonl"
    ...     with Journal(path, now_s=lambda: 1.5) as journal:
    ...         journal.append(NoteTaken(text="pause"))
    ...     _ = path.write_bytes(path.read_bytes().replace(b"pause", b"cause"))
    ...     try:
    ...         _ = read_journal(path)
    ...     except ValueError as error:
    ...         message = str(error)
    >>> message
    '...journal.jsonl:1: this line is damaged (its checksum does not match); restore the file ...'
    """


class JournalLineError(JournalError):
    """A line that is not as it was written."""

    hint = "; restore the file from a copy: nothing was changed"

    def __init__(self, path: Path, line: int, message: str) -> None:
        super().__init__(f"{path}:{line}: {message}{self.hint}")
        self.path, self.line, self.message = path, line, message


class RecordSchemaError(JournalLineError):
    """A journal, or a trials.csv, of another version of this program."""

    hint = ""


class JournalWriteError(JournalError):
    """A journal or a file built from it that cannot be written.

    The lines that the journal already holds are safe. The session cannot continue until the cause,
    such as a full disk, is removed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     try:
    ...         Journal(Path(folder) / "missing" / "journal.jsonl", now_s=lambda: 0.0)
    ...     except JournalError as error:
    ...         name = type(error).__name__
    >>> name
    'JournalWriteError'
    """

    @property
    def errno(self) -> int | None:
        """The error number of the failed write."""
        return self.__cause__.errno if isinstance(self.__cause__, OSError) else None


@dataclass(frozen=True, slots=True)
class JournalFile:
    """A journal as it was found: its entries, and the bytes of a last line that was cut short."""

    entries: tuple[Entry, ...]
    sha256: tuple[str, ...]  # of each line
    torn: bytes

    @property
    def head_sha256(self) -> str:
        """Hash of the last line, which depends on all lines."""
        return self.sha256[-1] if self.sha256 else ROOT


def read_journal(path: Path) -> JournalFile:
    """Read and verify a journal.

    Parameters
    ----------
    path : Path
        The journal of a session, ``journal.jsonl``.

    Returns
    -------
    JournalFile
        ``entries``: an `Entry` for each complete line; ``sha256``: the hash of each line;
        ``torn``: the bytes of a last line that was cut short, empty if there is none.

    Raises
    ------
    JournalError
        If a complete line is damaged, missing or repeated, or has the schema of another version of
        this program. The message names the file and the line.
    OSError
        If the file cannot be read.

    Examples
    --------
    A last line without its line end is not an entry:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from experiment.record.entries import BreakStarted
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "journal.jsonl"
    ...     with Journal(path, now_s=lambda: 1.5) as journal:
    ...         journal.append(BreakStarted())
    ...     _ = path.write_bytes(path.read_bytes() + b'{"crc":"01')
    ...     file = read_journal(path)
    >>> [entry.event for entry in file.entries], file.torn
    (['break'], b'{"crc":"01')
    """
    lines = path.read_bytes().split(b"\n")
    torn = lines.pop()
    sha256 = tuple(hashlib.sha256(line).hexdigest() for line in lines)
    entries = tuple(
        _parse(path, number, line, previous)
        for number, (line, previous) in enumerate(zip(lines, (ROOT, *sha256), strict=False), 1)
    )
    return JournalFile(entries, sha256, torn)


def _parse(path: Path, number: int, line: bytes, previous: str) -> Entry:
    match = _LINE.match(line)
    body = line[match.end() :] if match else b""
    if match is None or body[-1:] != b"}" or zlib.crc32(body, _BRACE) != int(match[1], 16):
        damaged = "this line is damaged (its checksum does not match)"
        raise JournalLineError(path, number, damaged)
    try:
        members = from_json(b"{" + body, allow_inf_nan=False)
        _check_chain(path, number, members, previous)
        times = {name: float(members.pop(name)) for name in ("t_s", "wall_s", "up_s")}
        return Entry(LINES.validate_python(members), **times)
    except ValidationError as error:
        raise JournalLineError(path, number, first_fault(error)) from error
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, JournalError):
            raise
        raise JournalLineError(path, number, f"this line is none of a journal: {error}") from error


_CHAIN: Final = (
    ("schema", RecordSchemaError, OTHER_VERSION),
    ("seq", JournalLineError, "a line is missing or repeated"),
    ("prev", JournalLineError, "lines up to here were changed or removed"),
)


def _check_chain(path: Path, number: int, members: dict[str, Any], previous: str) -> None:
    """Take the members of the chain out of a line, and refuse a line that breaks the chain."""
    actual = (members.pop("schema", None), members.pop("seq", None), members.pop("prev", None))
    expected = (SCHEMA, number, previous)
    if actual == expected:
        return
    for (name, error, meaning), got, value in zip(_CHAIN, actual, expected, strict=True):
        if got != value:
            rule = f"{name} must be {value!s:.12}; got {got!s:.12}: {meaning}"
            raise error(path, number, rule)


class Journal:
    """A journal open for writing.

    Parameters
    ----------
    path : Path
        The file; it is created if it does not exist, and continued if it does.
    now_s : callable
        Returns the time on the session's clock.
    disk : Disk
        Disk that holds the file.
    wall_s : callable
        Returns the calendar time in seconds since 1970.
    up_s : callable
        Returns the seconds since the host was started.

    Raises
    ------
    JournalError
        If the present content of the file cannot be trusted; nothing is changed then.

    Notes
    -----
    A last line that was cut short is moved to a file ``journal.torn-N`` in the same folder.
    ``head_sha256`` is the hash of the last line.

    Examples
    --------
    Each line holds the hash of the line before it, so that the hash of the last line verifies all:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from experiment.record.entries import BlockEnded, BlockStarted
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "journal.jsonl"
    ...     with Journal(path, now_s=lambda: 1.5) as journal:
    ...         journal.append(BlockStarted(block=1, condition="main"))
    ...         journal.append(BlockEnded(block=1), sync=True)
    ...     file = read_journal(path)
    >>> [(entry.event, entry.t_s) for entry in file.entries]
    [('block_start', 1.5), ('block_end', 1.5)]
    >>> file.head_sha256 == journal.head_sha256
    True
    """

    def __init__(
        self,
        path: Path,
        *,
        now_s: Callable[[], float],
        disk: Disk = DISK,
        wall_s: Callable[[], float] = time.time,
        up_s: Callable[[], float] = uptime_s,
    ) -> None:
        self._path = path
        self._now_s = now_s
        self._wall_s = wall_s
        self._up_s = up_s
        self._disk = disk
        self._broken = False
        self._seq = 0
        self.head_sha256 = ROOT
        self.torn_file: Path | None = None
        try:
            if path.exists():
                journal = read_journal(path)
                self._seq = len(journal.entries)
                self.head_sha256 = journal.head_sha256
                if journal.torn:
                    self.torn_file = self._set_aside(journal)
            self._file = disk.open(path, new=False)
            disk.sync_folder(path.parent)
        except OSError as error:
            raise self._write_error(error) from error

    def _set_aside(self, journal: JournalFile) -> Path:
        asides = (self._path.with_name(f"journal.torn-{number}") for number in count(1))
        aside = next(path for path in asides if not path.exists())
        write_new(aside, journal.torn, self._disk)
        # The torn line goes only when its copy has a name on the disk: at no moment is it nowhere.
        self._disk.sync_folder(self._path.parent)
        os.truncate(self._path, self._path.stat().st_size - len(journal.torn))
        return aside

    def append(self, line: Line, *, sync: bool = False) -> None:
        """Write one line at the end of the journal.

        Parameters
        ----------
        line : Line
            What happened.
        sync : bool
            Whether the method returns only when this line and all lines before it are on the disk.

        Raises
        ------
        JournalWriteError
            If the line cannot be written. The journal then accepts no further line.
        """
        if self._broken:
            raise JournalWriteError(f"{self._path}: not written after an earlier failure")
        body = to_json(
            {
                "schema": SCHEMA,
                "seq": self._seq + 1,
                "prev": self.head_sha256,
                "event": line.event,
                "t_s": round(self._now_s(), 6),
                "wall_s": round(self._wall_s(), 3),
                "up_s": round(self._up_s(), 6),
                **vars(line),
            }
        )
        raw = b'{"crc":"%08x",%b' % (zlib.crc32(body), body[1:])
        try:
            self._disk.write(self._file, raw + b"\n")
            if sync:
                self._disk.sync(self._file)
        except OSError as error:
            self._broken = True
            raise self._write_error(error) from error
        self._seq += 1
        self.head_sha256 = hashlib.sha256(raw).hexdigest()

    def _write_error(self, error: OSError) -> JournalWriteError:
        return JournalWriteError(f"{self._path}: cannot be written ({error.strerror})")

    def close(self) -> None:
        """Close the file."""
        self._disk.close(self._file)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
