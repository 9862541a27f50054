"""The sessions of a study: those that lie in its folder, and those that sessions.tsv lists.

``sessions.tsv`` lies in the folder of a person. For each session that ended, it keeps the hash of
the journal's last line, which depends on the whole journal. The chain of hashes reveals a changed
line. If the journal is cut or rewritten as a whole, its last hash differs from the one that was
kept. If sessions.tsv is changed, too, only a hash that was written down elsewhere reveals it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from device.printing import shown
from experiment.record.files import (
    DISK,
    FILES,
    SESSIONS_TABLE,
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


_PERSON, _SESSION = "sub-", "ses-"
_COLUMNS: Final = ("session_id", "head_sha256", "ended")
_LINE: Final = re.compile(r"ses-([^\t]*)\t([0-9a-f]{64})\t([^\t]*)")
_LOCK: Final = ".sessions.lock"

Remedy: TypeAlias = Literal["export", "resume", "removal"]
"""What puts a difference right: a command of that name, or the removal of the file."""
_HINTS: Final = {
    "resume": "; where the session was killed in that moment, tactstrip run --resume puts it right",
    "removal": "; remove it",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Something in a record that is not as the session wrote it.

    Attributes
    ----------
    path : Path
        The file.
    line : int or None
        The line, counted from 1; None if the file as a whole differs.
    message : str
        How it differs.
    remedy : str or None
        What puts it right; None if only a copy from a backup can.
    """

    path: Path
    line: int | None
    message: str
    remedy: Remedy | None = None

    @property
    def location(self) -> str:
        """File and line."""
        return f"{self.path}" if self.line is None else f"{self.path}:{self.line}"

    @property
    def hint(self) -> str:
        """What puts it right, if that is neither a copy from a backup nor an export."""
        return _HINTS.get(self.remedy or "", "")

    def __str__(self) -> str:
        """Return location, message and hint, the location first as in a compiler's messages."""
        return f"{self.location}: {self.message}{self.hint}"


class SessionIndexError(ArchiveError):
    """A sessions.tsv that is not valid, with the line."""

    def __init__(self, path: Path, line: int, message: str) -> None:
        super().__init__(f"{path}:{line}: {message}")
        self.path, self.line, self.message = path, line, message


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSeal:
    """The line of sessions.tsv of one session.

    Attributes
    ----------
    session : str
        Identifier of the session.
    head_sha256 : str
        Hash of the journal's last line when the latest visit ended.
    ended : str
        When that was, in UTC.
    line : int
        Number of the line in the file.
    """

    session: str
    head_sha256: str
    ended: str
    line: int = 0


def read_seals(person: Path) -> dict[str, SessionSeal]:
    """Read the sessions.tsv in a person's folder; an empty result if there is no file.

    Parameters
    ----------
    person : Path
        ``sub-<participant>``.

    Returns
    -------
    dict of str to SessionSeal
        By the session's identifier.

    Raises
    ------
    SessionIndexError
        If the file is no such table, or has a session twice.
    SymlinkError
        If the file is a symbolic link.
    """
    path = person / SESSIONS_TABLE
    refuse_link(path)
    if not path.exists():
        return {}
    heading, *lines = path.read_text(encoding="utf-8", errors="replace").splitlines() or [""]
    if heading != "\t".join(_COLUMNS):
        raise SessionIndexError(path, 1, f"the columns must be {', '.join(_COLUMNS)}")
    seals: dict[str, SessionSeal] = {}
    for number, line in enumerate(lines, start=2):
        match = _LINE.fullmatch(line)
        if match is None:
            rule = "must be ses- and a session, 64 of 0-9 and a-f, and when it ended"
            raise SessionIndexError(path, number, f"{rule}; got {shown(line)}")
        session, head_sha256, ended = match.groups()
        if session in seals:
            message = f"session {session} stands in line {seals[session].line} already"
            raise SessionIndexError(path, number, message)
        seals[session] = SessionSeal(
            session=session, head_sha256=head_sha256, ended=ended, line=number
        )
    return seals


def is_named_session(folder: Path) -> bool:
    """Return whether a folder is named as a session; a copy of another name has no seal."""
    return folder.resolve().name.startswith(_SESSION)


def find_seal(folder: Path) -> SessionSeal | None:
    """Return the seal of a session's folder; None if it has none. Raises as `read_seals`."""
    if not is_named_session(folder):
        return None
    return read_seals(person_of(folder)).get(folder.resolve().name.removeprefix(_SESSION))


def write_seal(person: Path, seal: SessionSeal, *, disk: Disk = DISK) -> None:
    """Write the seal of a session into sessions.tsv; that of an earlier visit is replaced.

    Parameters
    ----------
    person : Path
        ``sub-<participant>``.
    seal : SessionSeal
        The seal. If its hash is in the file already, nothing is written, so that the time stays.
    disk : Disk
        Where the record is kept.

    Raises
    ------
    SessionIndexError
        If the file is no such table.
    """
    with locked(person / _LOCK):
        remove_left_overs(person, SESSIONS_TABLE)
        seals = read_seals(person)
        present = seals.get(seal.session)
        if present is not None and present.head_sha256 == seal.head_sha256:
            return
        seals[seal.session] = seal
        rows = ((f"{_SESSION}{s.session}", s.head_sha256, s.ended) for s in seals.values())
        write_atomically(person / SESSIONS_TABLE, tsv([_COLUMNS, *rows]), disk=disk)


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionIndex:
    """The sessions of a study, of a person, or one.

    Attributes
    ----------
    folders : tuple of Path
        Folders with at least one file of a record, so that the loss of one file hides no session.
    lost : mapping of Path to Difference
        Sessions of which only a line of sessions.tsv is left, by the folder that is missing.
    links : tuple of SymlinkError
        Symbolic links in place of a person's or session's folder: nothing there is read.
    """

    folders: tuple[Path, ...]
    lost: Mapping[Path, Difference]
    links: tuple[SymlinkError, ...]

    @property
    def sessions(self) -> tuple[SessionFolder, ...]:
        """The folders as sessions of a study; ArchiveError if a name is none of a session."""
        return tuple(map(_session_folder, self.folders))


def _session_folder(folder: Path) -> SessionFolder:
    path = folder.resolve()
    return SessionFolder(
        person_of(person_of(folder)),
        path.parent.name.removeprefix(_PERSON),
        path.name.removeprefix(_SESSION),
    )


def find_sessions(root: Path) -> SessionIndex:
    """List the sessions as `list_sessions` does; ArchiveError if there is none."""
    index = list_sessions(root)
    if not (index.folders or index.lost or index.links):
        raise ArchiveError(f"{root}: there is no session below this folder")
    return index


def list_sessions(root: Path) -> SessionIndex:
    """List the sessions below a folder.

    Parameters
    ----------
    root : Path
        Folder of a study, of a person (``sub-...``) or of a session (``ses-...``).

    Raises
    ------
    SymlinkError
        If a person's or session's folder is given by a link; a study's folder may be one.
    """
    name = root.resolve().name
    prefix = next((each for each in (_PERSON, _SESSION) if name.startswith(each)), "")
    _refuse_given_link(root, prefix)
    links: list[SymlinkError] = []
    if prefix == _SESSION:
        people, folders = [person_of(root)], [root]
    else:
        people = [root] if prefix == _PERSON else _list_folders(root, _PERSON, links)
        folders = [path for person in people for path in _list_folders(person, _SESSION, links)]
    lost: dict[Path, Difference] = {}
    for person in people:
        try:
            lost |= _lost_sessions(person)
        except SymlinkError as error:
            links.append(error)
    if prefix == _SESSION:
        lost = {path: lost[path] for path in lost if path.name == name}
    folders = [folder for folder in folders if _holds_record(folder)]
    return SessionIndex(folders=tuple(folders), lost=lost, links=tuple(links))


def _refuse_given_link(root: Path, prefix: str) -> None:
    if root.name.startswith((_PERSON, _SESSION)):
        refuse_link(root)
    elif root.is_symlink() and prefix:
        raise SymlinkError(root, f"is a symbolic link to {root.resolve()}; give that folder itself")
    if root.name.startswith(_SESSION):
        refuse_link(root.parent)


def _list_folders(folder: Path, prefix: str, links: list[SymlinkError]) -> list[Path]:
    """List folders by name; links among them, which may be dead, are added to `links`."""
    folders = []
    # Unlike a glob, this never passes over a folder that cannot be read.
    for path in sorted(each for each in folder.iterdir() if each.name.startswith(prefix)):
        if path.is_symlink() and not path.is_file():
            links.append(SymlinkError(path))
        elif path.is_dir():
            folders.append(path)
    return folders


def _holds_record(folder: Path) -> bool:
    return folder.is_dir() and any(path.name in FILES for path in folder.iterdir())


def _lost_sessions(person: Path) -> dict[Path, Difference]:
    """Return the sessions of a person that have ended and of which no file is left."""
    path = person / SESSIONS_TABLE
    try:
        seals = read_seals(person)
    except SessionIndexError as error:  # a session that is there reports it when it is verified
        if any(_holds_record(session) for session in person.glob(f"{_SESSION}*")):
            return {}
        return {person / _SESSION: Difference(path=path, line=error.line, message=error.message)}
    lost = {}
    for seal in seals.values():
        folder = person / f"{_SESSION}{seal.session}"
        if not folder.is_symlink() and not _holds_record(folder):
            missing = "no file of it is left" if folder.is_dir() else "its folder is lost"
            message = f"session {seal.session} ended on {seal.ended}, and {missing}"
            lost[folder] = Difference(path=path, line=seal.line, message=message)
    return lost
