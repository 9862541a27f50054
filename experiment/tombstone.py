"""What stays of a person who withdrew: that it was so, and when."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Final

from experiment.keeping import TEMPORARY, ArchiveError, check_identifier, write_atomically

if TYPE_CHECKING:
    from pathlib import Path

SCHEMA: Final = 1
FOLDER: Final = "withdrawn"
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tombstone:
    """The mark that a person withdrew.

    It holds the identifier, which is what tells the person in backups and copies from the others
    and keeps it from being given again; the day; and nothing else of the person.

    Attributes
    ----------
    participant : str
        The identifier.
    withdrawn : str
        The day, as YYYY-MM-DD in UTC.
    removed : bool
        Whether everything is removed; false from the first step to the last.

    Raises
    ------
    ArchiveError
        If a value is no identifier or no day.

    Examples
    --------
    >>> Tombstone(participant="07", withdrawn="yesterday", removed=True)
    Traceback (most recent call last):
    experiment.keeping.ArchiveError: withdrawn must be a day YYYY-MM-DD; got 'yesterday'
    """

    participant: str
    withdrawn: str
    removed: bool

    def __post_init__(self) -> None:
        check_identifier("participant", self.participant)
        if not isinstance(self.withdrawn, str) or not _DATE.fullmatch(self.withdrawn):
            raise ArchiveError(f"withdrawn must be a day YYYY-MM-DD; got {self.withdrawn!r}")
        if not isinstance(self.removed, bool):
            raise ArchiveError(f"removed must be true or false; got {self.removed!r}")


def tombstone_path(root: Path, participant: str) -> Path:
    """Return where a person's tombstone stands.

    >>> from pathlib import Path
    >>> tombstone_path(Path("results"), "07").as_posix()
    'results/withdrawn/sub-07.json'
    """
    return root / FOLDER / f"sub-{participant}.json"


def read_tombstone(root: Path, participant: str) -> Tombstone | None:
    """Read a person's tombstone; none if there is none.

    Raises
    ------
    ArchiveError
        If the file is no tombstone of this person.
    """
    path = tombstone_path(root, participant)
    if not path.exists():
        return None
    try:
        contents = json.loads(path.read_bytes())
        if contents.pop("schema") != SCHEMA or contents["participant"] != participant:
            raise ArchiveError("another schema or another person")
        return Tombstone(**contents)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ArchiveError(
            f"{path}: not the tombstone of participant {participant}: {error}"
        ) from error


def write_tombstone(root: Path, tombstone: Tombstone) -> None:
    """Write a tombstone; it is on the disk when this returns."""
    path = tombstone_path(root, tombstone.participant)
    path.parent.mkdir(exist_ok=True)
    for left_over in path.parent.glob(f".{path.name}.*{TEMPORARY}"):
        left_over.unlink()
    text = json.dumps({"schema": SCHEMA} | asdict(tombstone), indent=1) + "\n"
    write_atomically(path, text)


def refuse_withdrawn(root: Path, participant: str) -> None:
    """Refuse an identifier whose person withdrew.

    Raises
    ------
    ArchiveError
        If there is a tombstone.
    """
    tombstone = read_tombstone(root, participant)
    if tombstone is not None:
        raise ArchiveError(
            f"participant {participant} withdrew on {tombstone.withdrawn}; "
            + ("give another --participant: this one is not given again" if tombstone.removed
               else "the removal was interrupted: run tactstrip withdraw again")
        )  # fmt: skip
