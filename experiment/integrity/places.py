"""Which sessions there are below a folder: those that are there, and those that are told of only.

A session is a folder with any file of a record, or a line of sessions.tsv. So none goes unnoticed
for the loss of one file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from experiment.archive.files import FILES, HEADS, ArchiveError, LinkError, person_of, refuse_link
from experiment.archive.folders import SessionFolder
from experiment.integrity.heads import HeadError, read_heads
from experiment.integrity.sessions import Difference

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


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
    links : tuple of LinkError
        Symbolic links where a person's or session's folder has to be: nothing there is read.
    """

    folders: tuple[Path, ...]
    lost: Mapping[Path, Difference]
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
    """List the sessions as `list_sessions` does; ArchiveError where there is none."""
    sessions = list_sessions(root)
    if not (sessions.folders or sessions.lost or sessions.links):
        raise ArchiveError(f"{root}: there is no session below this folder")
    return sessions


def list_sessions(root: Path) -> FoundSessions:
    """List the sessions below a study's folder, a person's, or one.

    LinkError where that folder is reached by a link.
    """
    refuse_given_link(root)
    kind = _kind(root)
    links: list[LinkError] = []
    if kind == _SESSION:
        people, folders = [person_of(root)], [root]
    else:
        people = [root] if kind == _PERSON else _real(root, _PERSON, links)
        folders = [path for person in people for path in _real(person, _SESSION, links)]
    lost: dict[Path, Difference] = {}
    for person in people:
        try:
            lost |= lost_sessions(person)
        except LinkError as error:
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
    folders = []
    # Unlike a glob, this never passes over a folder that cannot be read.
    for path in sorted(each for each in folder.iterdir() if each.name.startswith(prefix)):
        if path.is_symlink() and not path.is_file():
            links.append(LinkError(path))
        elif path.is_dir():
            folders.append(path)
    return folders


def _holds_any(folder: Path) -> bool:
    return folder.is_dir() and any(path.name in FILES for path in folder.iterdir())


def lost_sessions(person: Path) -> dict[Path, Difference]:
    """Return the folders of a person's sessions that have ended and of which no file is left.

    LinkError where sessions.tsv is a symbolic link.
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
