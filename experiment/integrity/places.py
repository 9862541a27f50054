"""Which sessions there are below a folder: those that are there, and those that are told of only.

A session is a folder with any file of a record, or a line of sessions.tsv. So none goes unnoticed
for the loss of one file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from experiment.archive.files import HEADS, ArchiveError, LinkError, refuse_link
from experiment.archive.folders import SessionFolder
from experiment.integrity.heads import HeadError, person_of, read_heads
from experiment.integrity.sessions import FILES, MEASURED, Difference

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


_PERSON, _SESSION = "sub-", "ses-"
_IN_PLACE: Final = (_PERSON, _SESSION)


@dataclass(frozen=True, slots=True, kw_only=True)
class LostSession:
    """A session that has ended, by sessions.tsv, and of which no file is left."""

    folder: Path
    difference: Difference


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundSessions:
    """The sessions of a study, of a person, or one.

    Attributes
    ----------
    folders : tuple of Path
        Those with a file of a record.
    lost : tuple of LostSession
        Those without any.
    links : tuple of LinkError
        Symbolic links where a person's or session's folder has to be: nothing there is read.
    """

    folders: tuple[Path, ...]
    lost: tuple[LostSession, ...]
    links: tuple[LinkError, ...]

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
    """List the sessions below a study's folder, a person's, or one.

    ArchiveError where there is none; LinkError where a person or session is reached by a link.
    """
    refuse_given_link(root)
    kind = _kind(root)
    links: list[LinkError] = []
    if kind == _SESSION:
        people, folders = [person_of(root)], [root]
    else:
        people = [root] if kind == _PERSON else _real(root, _PERSON, links)
        folders = [path for person in people for path in _real(person, _SESSION, links)]
    lost: list[LostSession] = []
    for person in people:
        try:
            lost += lost_sessions(person)
        except LinkError as error:
            links.append(error)
    if kind == _SESSION:
        lost = [one for one in lost if one.folder.name == root.resolve().name]
    folders = [folder for folder in folders if _holds_any(folder)]
    if not folders and not lost and not links:
        raise ArchiveError(f"{root}: there is no session below this folder")
    return FoundSessions(folders=tuple(folders), lost=tuple(lost), links=tuple(links))


def _kind(root: Path) -> str:
    """Tell a person's or session's folder by its name from a study's."""
    name = root.resolve().name
    return next((prefix for prefix in _IN_PLACE if name.startswith(prefix)), "")


def refuse_given_link(root: Path) -> None:
    """Refuse to go to a person or session by a symbolic link; a study's folder may be one.

    LinkError where it is one.
    """
    if root.name.startswith(_IN_PLACE):
        refuse_link(root)
    elif root.is_symlink() and _kind(root):
        raise LinkError(root, f"is a symbolic link to {root.resolve()}; give that folder itself")
    if root.name.startswith(_SESSION):
        refuse_link(root.parent)


def _real(folder: Path, prefix: str, links: list[LinkError]) -> list[Path]:
    """List folders by name; links among them, which may be dead, go to the list of links."""
    found = []
    for path in sorted(folder.glob(f"{prefix}*")):
        try:
            refuse_link(path)
        except LinkError as error:
            if not path.is_file():
                links.append(error)
        else:
            if path.is_dir():
                found.append(path)
    return found


def _holds_any(folder: Path) -> bool:
    return any(
        (folder / file).exists() or (folder / file).is_symlink() for file in (*FILES, MEASURED)
    )


def lost_sessions(person: Path) -> Iterator[LostSession]:
    """Yield the sessions of a person that have ended and of which no file is left.

    LinkError where sessions.tsv is a symbolic link.
    """
    try:
        heads = read_heads(person)
    except HeadError as error:  # of a session that is there, `examine` tells it
        if not any(_holds_any(path) for path in person.glob(f"{_SESSION}*")):
            bad = Difference(path=person / HEADS, line=error.line, message=error.message)
            yield LostSession(folder=person / _SESSION, difference=bad)
        return
    for head in heads:
        folder = person / f"{_SESSION}{head.session}"
        if folder.is_symlink() or _holds_any(folder):
            continue
        what = "no file of it is left" if folder.is_dir() else "its folder is lost"
        told = f"session {head.session} ended on {head.ended}, and {what}"
        yield LostSession(
            folder=folder,
            difference=Difference(path=person / HEADS, line=head.line, message=told),
        )
