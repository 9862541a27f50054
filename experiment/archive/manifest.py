"""What was made of sessions, and of whom: every export and analysis has a manifest that says so.

By these, by folders of sessions and by files of levels, a withdrawal tells what still holds a
person. Files of other origin are nobody's to guess about: a search that must find a name in any
file finds too much in some and nothing in others, and its silence reads as "nowhere".
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

from experiment.bounded import parse_toml, read_bounded

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


NAME: Final = ".tactstrip.json"
SCHEMA: Final = 1
MAX_LEVELS_BYTES: Final = 100_000
"""No file of levels is larger."""
_MAX_MANIFEST_BYTES: Final = 10_000_000
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
        contents = json.loads(read_bounded(path, _MAX_MANIFEST_BYTES))
    except (ValueError, RecursionError) as error:  # the latter of brackets without end
        raise ValueError(f"{path}: not a manifest: {error}") from error
    match contents:
        case {"schema": 1, "what": str(what), "participants": [*people], "files": dict(files)} if (
            all(isinstance(text, str) for text in (*people, *files.values()))
        ):
            return Manifest(what=what, participants=tuple(people), files=files)
    rule = "must have schema 1, what, participants (a list of texts) and files"
    raise ValueError(f"{path}: not a manifest: {rule}")


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
    search = _Search(participant, {path.resolve() for path in leave_out})
    for top in folders:
        for place, names, files in os.walk(top.resolve(), onerror=search.miss):
            search.look_at(Path(place), names, files)
    return Search(tuple(sorted(search.holdings)), tuple(sorted(search.missed)))


class _Search:
    """One search: what holds the person, and what could not be searched."""

    def __init__(self, participant: str, excluded: set[Path]) -> None:
        self._participant = participant
        self._excluded = excluded
        self._listed: set[Path] = set()  # by the manifests of exports: files and their folders
        self.holdings: set[Holding] = set()
        self.missed: set[Path] = set()

    def miss(self, error: OSError) -> None:
        self.missed.add(Path(error.filename))

    def look_at(self, here: Path, names: list[str], files: list[str]) -> None:
        """Look at a folder, and keep of the names of folders in it those to look into."""
        links = {here / name for name in (*names, *files) if (here / name).is_symlink()}
        self.missed |= links - self._excluded
        for path in sorted({here / name for name in files} - links):
            try:
                self._look_at_file(path)
            except OSError:
                self.missed.add(path)
        names[:] = [name for name in names if self._enters(here / name)]

    def _look_at_file(self, path: Path) -> None:
        """Note a folder whose manifest names the person, or levels that were placed for them."""
        if path.name == NAME:
            try:
                manifest = read_manifest(path.parent)
            except ValueError:
                self.missed.add(path)
                return
            if manifest and self._participant in manifest.participants:
                self.holdings.add(Holding(path.parent, manifest.what))
            for name in map(Path, manifest.files if manifest else ()):
                self._listed |= {path.parent / part for part in (name, *name.parents)}
        elif path.suffix == LEVELS_SUFFIX:
            with contextlib.suppress(ValueError, RecursionError):  # `levels` did not write it
                table = parse_toml(read_bounded(path, MAX_LEVELS_BYTES).decode("utf-8"))
                if table.get("participant") == self._participant and "levels_vpp" in table:
                    self.holdings.add(Holding(path, "levels"))

    def _enters(self, folder: Path) -> bool:
        """Note a copy of the person's sessions; other people's folders need no search.

        An export is named as a whole; in its folders may be what somebody put there since.
        """
        if folder in self._excluded or folder.is_symlink():
            return False
        if folder in self._listed or not _PERSON.fullmatch(folder.name):
            return True
        if folder.name == f"sub-{self._participant}":
            self.holdings.add(Holding(folder, "sessions"))
        return False
