"""Which sessions there are below a folder: those that are there, and those that are told of only.

A session is a folder with any file of a record, or a line of sessions.tsv. So none goes unnoticed
for the loss of one file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from device.printing import shown
from experiment.record.files import (
    DISK,
    FILES,
    HEADS,
    ArchiveError,
    SymlinkError,
    locked,
    person_of,
    refuse_link,
    remove_left_overs,
    tsv,
    write_atomically,
)
from experiment.record.folder import SessionFolder

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from experiment.record.files import Disk


_HEADING: Final = "session_id\thead_sha256\tended"
_LINE: Final = re.compile(r"ses-([^\t]*)\t([0-9a-f]{64})\t([^\t]*)")
_LOCK: Final = ".sessions.lock"


Remedy: TypeAlias = Literal["export", "resume", "removal"]
"""What puts a difference right: a command of that name, or the removal of the file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Something in a record that is not as the session wrote it."""

    path: Path
    line: int | None  # counted from 1; none where a file as a whole is another one
    message: str
    remedy: Remedy | None = None

    @property
    def place(self) -> str:
        """File and line."""
        return f"{self.path}" if self.line is None else f"{self.path}:{self.line}"

    @property
    def hint(self) -> str:
        """What puts it right, where that is neither a copy nor an export."""
        hints = {
            "resume": "; where the session was killed in that moment, tactstrip run --resume puts "
            "it right",
            "removal": "; remove it",
        }
        return hints.get(self.remedy or "", "")

    def __str__(self) -> str:
        """Name file and line first, as a compiler does."""
        return f"{self.place}: {self.message}{self.hint}"


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

    HeadError where it is no such table, or tells of a session twice; SymlinkError for a link.
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
    with locked(person / _LOCK):
        remove_left_overs(person, HEADS)
        heads = read_heads(person)
        entered = heads.get(head.session)
        if entered is not None and entered.head_sha256 == head.head_sha256:
            return  # a finished session that only gets its trials.csv again ended when it ended
        heads[head.session] = head
        rows = ((f"ses-{h.session}", h.head_sha256, h.ended) for h in heads.values())
        write_atomically(person / HEADS, tsv([_HEADING.split(), *rows]), disk=disk)


_PERSON, _SESSION = "sub-", "ses-"
_IN_PLACE: Final = (_PERSON, _SESSION)


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundSessions:
    """The sessions of a study, of a person, or one.

    Attributes
    ----------
    folders : tuple of Path
        Those with a file of a record.
    lost : mapping of Path to Difference
        What sessions.tsv says of those without any, by their folders.
    links : tuple of SymlinkError
        Symbolic links where a person's or session's folder has to be: nothing there is read.
    """

    folders: tuple[Path, ...]
    lost: Mapping[Path, Difference]
    links: tuple[SymlinkError, ...]

    @property
    def sessions(self) -> tuple[SessionFolder, ...]:
        """The folders as sessions of a study; ArchiveError where a name is none of a session."""
        return tuple(map(_session, self.folders))


def _session(path: Path) -> SessionFolder:
    place = path.resolve()
    participant = place.parent.name.removeprefix(_PERSON)
    session = place.name.removeprefix(_SESSION)
    return SessionFolder(person_of(person_of(path)), participant, session)


def find_sessions(root: Path) -> FoundSessions:
    """List the sessions as `list_sessions` does; ArchiveError where there is none."""
    sessions = list_sessions(root)
    if not (sessions.folders or sessions.lost or sessions.links):
        raise ArchiveError(f"{root}: there is no session below this folder")
    return sessions


def list_sessions(root: Path) -> FoundSessions:
    """List the sessions below a study's folder, a person's, or one.

    SymlinkError where that folder is reached by a link.
    """
    refuse_given_link(root)
    kind = _kind(root)
    links: list[SymlinkError] = []
    if kind == _SESSION:
        people, folders = [person_of(root)], [root]
    else:
        people = [root] if kind == _PERSON else _real(root, _PERSON, links)
        folders = [path for person in people for path in _real(person, _SESSION, links)]
    lost: dict[Path, Difference] = {}
    for person in people:
        try:
            lost |= lost_sessions(person)
        except SymlinkError as error:
            links.append(error)
    if kind == _SESSION:
        lost = {path: lost[path] for path in lost if path.name == root.resolve().name}
    folders = [folder for folder in folders if _holds_any(folder)]
    return FoundSessions(folders=tuple(folders), lost=lost, links=tuple(links))


def _kind(root: Path) -> str:
    """Tell a person's or session's folder by its name from a study's."""
    name = root.resolve().name
    return next((prefix for prefix in _IN_PLACE if name.startswith(prefix)), "")


def refuse_given_link(root: Path) -> None:
    """Refuse to go to a person or session by a symbolic link; a study's folder may be one.

    SymlinkError where it is one.
    """
    if root.name.startswith(_IN_PLACE):
        refuse_link(root)
    elif root.is_symlink() and _kind(root):
        raise SymlinkError(root, f"is a symbolic link to {root.resolve()}; give that folder itself")
    if root.name.startswith(_SESSION):
        refuse_link(root.parent)


def _real(folder: Path, prefix: str, links: list[SymlinkError]) -> list[Path]:
    """List folders by name; links among them, which may be dead, go to the list of links."""
    folders = []
    # Unlike a glob, this never passes over a folder that cannot be read.
    for path in sorted(each for each in folder.iterdir() if each.name.startswith(prefix)):
        if path.is_symlink() and not path.is_file():
            links.append(SymlinkError(path))
        elif path.is_dir():
            folders.append(path)
    return folders


def _holds_any(folder: Path) -> bool:
    return folder.is_dir() and any(path.name in FILES for path in folder.iterdir())


def lost_sessions(person: Path) -> dict[Path, Difference]:
    """Return the folders of a person's sessions that have ended and of which no file is left.

    SymlinkError where sessions.tsv is a symbolic link.
    """
    path = person / HEADS
    try:
        heads = read_heads(person)
    except HeadError as error:  # of a session that is there, `examine` tells it
        if any(_holds_any(session) for session in person.glob(f"{_SESSION}*")):
            return {}
        return {person / _SESSION: Difference(path=path, line=error.line, message=error.message)}
    lost = {}
    for head in heads.values():
        folder = person / f"{_SESSION}{head.session}"
        if not folder.is_symlink() and not _holds_any(folder):
            what = "no file of it is left" if folder.is_dir() else "its folder is lost"
            message = f"session {head.session} ended on {head.ended}, and {what}"
            lost[folder] = Difference(path=path, line=head.line, message=message)
    return lost
