"""What was made of sessions, and of whom: every export and analysis has a manifest that says so.

By these, by folders of sessions and by files of levels, a withdrawal tells what still holds a
person. Files of other origin are nobody's to guess about: a search that must find a name in any
file finds too much in some and nothing in others, and its silence reads as "nowhere".
"""

from __future__ import annotations

import json
import os
import re
import tomllib
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


NAME: Final = ".tactstrip.json"
SCHEMA: Final = 1
LEVELS_SUFFIX: Final = ".toml"
"""How the name of a file of placed levels ends: by it, a withdrawal finds them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """What a folder is, whose data are in it, and, where it is replaced as a whole, its files.

    Attributes
    ----------
    what : str
        ``BIDS data set`` or ``analysis``.
    participants : tuple of str
        Everybody of whom it holds something.
    files : mapping of str to str
        The checksum of each file, by its path in the folder.
    """

    what: str
    participants: tuple[str, ...]
    files: Mapping[str, str] = field(default_factory=dict)

    def text(self) -> str:
        """Write it as it stands in its file."""
        return json.dumps({"schema": SCHEMA} | asdict(self), ensure_ascii=False, indent=1) + "\n"


def read_manifest(folder: Path) -> Manifest | None:
    """Read the manifest of a folder; none if it has none.

    ValueError where it is damaged, however, or of another schema.
    """
    path = folder / NAME
    if not path.is_file():
        return None
    try:
        return _manifest_of(json.loads(path.read_bytes()))
    except (ValueError, RecursionError) as error:  # the latter of brackets without end
        raise ValueError(f"{path}: not a manifest: {error}") from error


def _manifest_of(contents: Any) -> Manifest:
    match contents:
        case {"schema": schema} if schema != SCHEMA:
            raise ValueError(f"schema must be {SCHEMA}; got {schema!r}")
        case {"schema": _, "what": str(what), "participants": [*people], "files": dict(files)} if (
            all(isinstance(text, str) for text in (*people, *files.values()))
        ):
            return Manifest(what=what, participants=tuple(people), files=files)
    raise ValueError("must have schema, what, participants (a list of texts) and files")


@dataclass(frozen=True, slots=True, order=True)
class Holding:
    """Something that holds a person."""

    path: Path  # a folder or a file
    what: str  # "BIDS data set", "analysis", "sessions" or "levels"


@dataclass(frozen=True, slots=True)
class Search:
    """What a search found.

    Attributes
    ----------
    holdings : tuple of Holding
        What holds the person, by path.
    not_searched : tuple of Path
        Links, damaged manifests, and what could not be read: somebody has to look into them.
    """

    holdings: tuple[Holding, ...]
    not_searched: tuple[Path, ...]


_PERSON: Final = re.compile(r"sub-[A-Za-z0-9]+")


def search(folders: Iterable[Path], participant: str, leave_out: Iterable[Path] = ()) -> Search:
    """Look for what was made of a person's sessions; links are not followed.

    Parameters
    ----------
    folders : iterable of Path
        Where to look, with everything below.
    participant : str
        The person's identifier.
    leave_out : iterable of Path
        Folders that are known already.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as name:
    ...     manifest = Manifest(what="analysis", participants=("07", "08"))
    ...     _ = (Path(name) / NAME).write_text(manifest.text())
    ...     [len(search([Path(name)], who).holdings) for who in ("07", "7", "analysis")]
    [1, 0, 0]
    """
    seeker = _Seeker(participant, {path.resolve() for path in leave_out})
    for folder in folders:
        seeker.walk(folder.resolve())
    return Search(tuple(sorted(seeker.found)), tuple(sorted(seeker.missed)))


class _Seeker:
    """One search: what was found and what could not be searched."""

    def __init__(self, participant: str, known: set[Path]) -> None:
        self._participant = participant
        self._known = known
        self._listed: set[Path] = set()  # by the manifests of exports: files and their folders
        self.found: set[Holding] = set()
        self.missed: set[Path] = set()

    def walk(self, top: Path) -> None:
        for place, folders, files in os.walk(top, onerror=self._unreadable):
            here = Path(place)
            links = (here / name for name in (*folders, *files))
            self.missed |= {path for path in links if path.is_symlink()} - self._known
            if NAME in files:
                self._look_at_manifest(here)
            folders[:] = [name for name in folders if self._enter(here / name)]
            for name in files:
                self._look_at_levels(here / name)

    def _unreadable(self, error: OSError) -> None:
        self.missed.add(Path(error.filename))

    def _enter(self, folder: Path) -> bool:
        """Note a copy of the person's sessions; other people's folders need no search."""
        if folder in self._known or folder.is_symlink() or self._is_listed(folder):
            return False
        if folder.name == f"sub-{self._participant}":
            self.found.add(Holding(folder, "sessions"))
        return not _PERSON.fullmatch(folder.name)

    def _is_listed(self, folder: Path) -> bool:
        """Tell whether a manifest above, which named whose they are, lists all that is in a folder.

        What was put into an export since, an analysis for one, may be of anybody.
        """
        paths = (
            Path(place, name)
            for place, folders, files in os.walk(folder, onerror=self._unreadable)
            for name in (*folders, *files)
        )
        return folder in self._listed and all(
            path in self._listed and not path.is_symlink() for path in paths
        )

    def _look_at_manifest(self, folder: Path) -> None:
        """Note a folder whose manifest names the person, and what is listed there."""
        try:
            manifest = read_manifest(folder)
        except (ValueError, OSError):
            self.missed.add(folder / NAME)
            return
        if manifest is None:
            return
        if self._participant in manifest.participants:
            self.found.add(Holding(folder, manifest.what))
        for name in map(Path, manifest.files):
            self._listed |= {folder / path for path in (name, *name.parents)}

    def _look_at_levels(self, path: Path) -> None:
        """Note a file of levels that were placed for the person, as `levels` writes it."""
        if path.suffix != LEVELS_SUFFIX or path.is_symlink():
            return
        try:
            table = tomllib.loads(path.read_text(encoding="utf-8"))
        except (ValueError, RecursionError):  # `levels` did not write it
            return
        except OSError:
            self.missed.add(path)
            return
        if table.get("participant") == self._participant and "levels_vpp" in table:
            self.found.add(Holding(path, "levels"))
