"""sessions.tsv beside a person's sessions: the hash of each journal's last line when it ended.

A journal's chain cannot be mended unseen, but it can be cut, or written anew as a whole. Then its
head is another one than was kept here. Whoever changes this file, too, is found only by a head that
was written down elsewhere.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from device.printing import shown
from experiment.archive.disk import DISK, lock_on
from experiment.archive.files import (
    HEADS,
    ArchiveError,
    person_of,
    refuse_link,
    remove_left_overs,
    tsv,
    write_atomically,
)

if TYPE_CHECKING:
    from pathlib import Path

    from experiment.archive.disk import Disk


_HEADING: Final = "session_id\thead_sha256\tended"
_LINE: Final = re.compile(r"ses-([^\t]*)\t([0-9a-f]{64})\t([^\t]*)")
_LOCK: Final = ".sessions.lock"


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


def read_heads(person: Path) -> dict[str, SessionHead]:
    """Read what is kept in a person's folder, by session; nothing where there is no file.

    HeadError where it is no such table, or tells of a session twice; LinkError for a link.
    """
    path = person / HEADS
    refuse_link(path)
    if not path.exists():
        return {}
    heading, *lines = path.read_text(encoding="utf-8", errors="replace").splitlines() or [""]
    if heading != _HEADING:
        raise HeadError(path, 1, f"the columns must be {', '.join(_HEADING.split())}")
    heads: dict[str, SessionHead] = {}
    for number, line in enumerate(lines, start=2):
        match = _LINE.fullmatch(line)
        if match is None:
            rule = "must be ses- and a session, 64 of 0-9 and a-f, and when it ended"
            raise HeadError(path, number, f"{rule}; got {shown(line)}")
        session, head_sha256, ended = match.groups()
        if session in heads:
            message = f"session {session} stands in line {heads[session].line} already"
            raise HeadError(path, number, message)
        heads[session] = SessionHead(
            session=session, head_sha256=head_sha256, ended=ended, line=number
        )
    return heads


def in_place(folder: Path) -> bool:
    """Whether it lies where sessions lie; a copy elsewhere has no head beside it."""
    return folder.resolve().name.startswith("ses-")


def kept_head(folder: Path) -> SessionHead | None:
    """Return the head that was kept of a session, if any was; raises as `read_heads`."""
    if not in_place(folder):
        return None
    return read_heads(person_of(folder)).get(folder.resolve().name.removeprefix("ses-"))


def enter_head(person: Path, head: SessionHead, *, disk: Disk = DISK) -> None:
    """Keep the head of a session; that of an earlier sitting is replaced, others stay as they are.

    HeadError where there is a file that is no such table.
    """
    with lock_on(person / _LOCK):
        remove_left_overs(person, HEADS)
        heads = read_heads(person)
        entered = heads.get(head.session)
        if entered is not None and entered.head_sha256 == head.head_sha256:
            return  # a finished session that only gets its trials.csv again ended when it ended
        heads[head.session] = head
        rows = ((f"ses-{h.session}", h.head_sha256, h.ended) for h in heads.values())
        write_atomically(person / HEADS, tsv([_HEADING.split(), *rows]), disk=disk)
