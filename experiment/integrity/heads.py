"""sessions.tsv beside a person's sessions: the hash of each journal's last line when it ended.

A journal's chain cannot be mended unseen, but it can be cut, or written anew as a whole. Then its
head is another one than was kept here. Whoever changes this file, too, is found only by a head that
was written down elsewhere.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from experiment.archive.disk import DISK, lock_on
from experiment.archive.files import HEADS, TEMPORARY, ArchiveError, refuse_link, write_atomically

if TYPE_CHECKING:
    from pathlib import Path

    from experiment.archive.disk import Disk


COLUMNS: Final = ("session_id", "head_sha256", "ended")
_LOCK: Final = ".sessions.lock"
_SHA256 = re.compile(r"[0-9a-f]{64}")


class HeadError(ArchiveError):
    """A sessions.tsv that is none; with the line."""

    def __init__(self, path: Path, line: int, message: str) -> None:
        super().__init__(f"{path}:{line}: {message}")
        self.path, self.line, self.message = path, line, message


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionHead:
    """The hash of the last line of a journal, when a sitting of its session came to its end."""

    session: str
    head_sha256: str
    ended: str  # in UTC
    line: int = 0  # in the file

    def text(self) -> str:
        """Write it as a line of the file."""
        return "\t".join((f"ses-{self.session}", self.head_sha256, self.ended)) + "\n"


def person_of(folder: Path) -> Path:
    """Return the folder of a session's person, of "." too, which names no other folder.

    >>> from pathlib import Path
    >>> person_of(Path("sub-01/ses-01")).as_posix(), person_of(Path()).as_posix()
    ('sub-01', '..')
    """
    return folder / ".." if folder.name in {"", ".."} else folder.parent


def read_heads(person: Path) -> tuple[SessionHead, ...]:
    """Read what is kept in a person's folder; nothing where there is no file.

    HeadError where it is no such table, or tells of a session twice; LinkError for a link.
    """
    path = person / HEADS
    refuse_link(path)
    if not path.exists():
        return ()
    heading, *lines = path.read_text(encoding="utf-8", errors="replace").splitlines() or [""]
    if tuple(heading.split("\t")) != COLUMNS:
        raise HeadError(path, 1, f"the columns must be {', '.join(COLUMNS)}")
    heads = [_head(path, number, line) for number, line in enumerate(lines, start=2)]
    first: dict[str, int] = {}
    for head in heads:
        if head.session in first:
            told = f"session {head.session} stands in line {first[head.session]} already"
            raise HeadError(path, head.line, told)
        first[head.session] = head.line
    return tuple(heads)


def _head(path: Path, number: int, line: str) -> SessionHead:
    cells = line.split("\t")
    if len(cells) != len(COLUMNS) or not cells[0].startswith("ses-"):
        raise HeadError(path, number, f"must be {', '.join(COLUMNS)} of a session; got {line!r}")
    session, head_sha256, ended = cells
    if not _SHA256.fullmatch(head_sha256):
        raise HeadError(
            path, number, f"head_sha256 must be 64 of 0-9 and a-f; got {head_sha256[:70]!r}"
        )
    return SessionHead(
        session=session.removeprefix("ses-"), head_sha256=head_sha256, ended=ended, line=number
    )


def in_place(folder: Path) -> bool:
    """Whether it lies where sessions lie; a copy elsewhere has no head beside it."""
    return folder.resolve().name.startswith("ses-")


def kept_head(folder: Path) -> SessionHead | None:
    """Return the head that was kept of a session, if any was; raises as `read_heads`."""
    name = folder.resolve().name
    if not name.startswith("ses-"):
        return None
    heads = read_heads(person_of(folder))
    return next((head for head in heads if f"ses-{head.session}" == name), None)


def enter_head(person: Path, head: SessionHead, *, disk: Disk = DISK) -> None:
    """Keep the head of a session; that of an earlier sitting is replaced, others stay as they are.

    HeadError where there is a file that is no such table.
    """
    with lock_on(person / _LOCK):
        for left_over in person.glob(f".{HEADS}.*{TEMPORARY}"):
            left_over.unlink()
        there = {one.session: one for one in read_heads(person)}
        known = there.get(head.session)
        if known is not None and known.head_sha256 == head.head_sha256:
            return  # a finished session that only gets its trials.csv again ended when it ended
        lines = [one.text() for one in (there | {head.session: head}).values()]
        heading = "\t".join(COLUMNS) + "\n"
        write_atomically(person / HEADS, heading + "".join(lines), disk=disk)
