"""participants.tsv: an id for each person, and the facts that the study declares; nothing else.

Of a person who withdrew a tombstone stays: that it was so, and when.
"""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Final

from experiment.archive.disk import DISK, lock_on, make_folder
from experiment.archive.files import (
    FOLDER,
    TEMPORARY,
    ArchiveError,
    check_identifier,
    refuse_link,
    write_atomically,
)
from experiment.names import is_line, unknown_key
from experiment.rows import NOT_AVAILABLE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from experiment.archive.disk import Disk
    from experiment.study.dataset import ParticipantColumn


SCHEMA: Final = 1

_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tombstone:
    """The mark that a person withdrew; ArchiveError where it names no identifier or no day.

    It holds the identifier, which is what tells the person in backups and copies from the others
    and keeps it from being given again; the day; and nothing else of the person.

    >>> Tombstone(participant="07", withdrawn="yesterday", removed=True)
    Traceback (most recent call last):
    experiment.archive.files.ArchiveError: withdrawn must be a day YYYY-MM-DD; got 'yesterday'
    """

    participant: str
    withdrawn: str  # the day, as YYYY-MM-DD in UTC
    removed: bool  # whether everything is removed; false from the first step to the last

    def __post_init__(self) -> None:
        check_identifier("participant", self.participant)
        if not _DATE.fullmatch(str(self.withdrawn)):
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

    ArchiveError where the file is no tombstone of this person.
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


def write_tombstone(root: Path, tombstone: Tombstone, *, disk: Disk = DISK) -> None:
    """Write a tombstone; it is on the disk when this returns."""
    path = tombstone_path(root, tombstone.participant)
    make_folder(path.parent, disk)
    for left_over in path.parent.glob(f".{path.name}.*{TEMPORARY}"):
        left_over.unlink()
    text = json.dumps({"schema": SCHEMA} | asdict(tombstone), indent=1) + "\n"
    write_atomically(path, text, disk=disk)


def refuse_withdrawn(root: Path, participant: str) -> None:
    """Refuse an identifier whose person withdrew.

    ArchiveError where there is a tombstone.
    """
    tombstone = read_tombstone(root, participant)
    if tombstone is not None:
        raise ArchiveError(
            f"participant {participant} withdrew on {tombstone.withdrawn}; "
            + (
                "give another --participant: this one is not given again"
                if tombstone.removed
                else "the removal was interrupted: run tactstrip withdraw again"
            )
        )


ID_COLUMN: Final = "participant_id"
FILE_NAME: Final = "participants.tsv"
_LOCK = ".participants.lock"
_PERSON = re.compile(r"sub-[A-Za-z0-9]{1,32}")
_LONGEST = 200


@dataclass(frozen=True, slots=True)
class Fact:
    """What is known of a person under one column's name."""

    name: str
    value: str


NO_FACTS: Final[tuple[Fact, ...]] = ()


def participant_facts(
    columns: Sequence[ParticipantColumn], given: Iterable[str]
) -> tuple[Fact, ...]:
    """Read the facts of one person, as a command line gives them.

    Parameters
    ----------
    columns : sequence of ParticipantColumn
        The columns that the study declares.
    given : iterable of str
        Texts ``NAME=VALUE``; the value may be ``n/a``.

    Raises
    ------
    ArchiveError
        For a column that the study does not declare or that is given twice, and for a value that is
        none of the column's levels or not one short line of text.

    Examples
    --------
    >>> from experiment.study.dataset import ParticipantColumn
    >>> hand = ParticipantColumn(name="hand", description="preferred", levels=("left", "right"))
    >>> participant_facts([hand], ["hand=left"])
    (Fact(name='hand', value='left'),)
    >>> participant_facts([hand], ["hand=both"])
    Traceback (most recent call last):
    experiment.archive.files.ArchiveError: fact hand must be one of left, right, n/a; got 'both'
    """
    facts: dict[str, Fact] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals:
            raise ArchiveError(f"a fact must be given as NAME=VALUE; got {text!r}")
        if name in facts:
            raise ArchiveError(f"fact {name} must be given once; got it twice")
        facts[name] = Fact(name, value)
    check_facts(columns, tuple(facts.values()))
    return tuple(facts.values())


def check_facts(columns: Sequence[ParticipantColumn], facts: Iterable[Fact]) -> None:
    """Refuse a fact that the study does not declare, or whose value it does not know.

    ArchiveError as `participant_facts`.
    """
    declared = {column.name: column for column in columns}
    for fact in facts:
        if fact.name not in declared:
            known = ", ".join(declared) or "none"
            raise ArchiveError(
                f"{unknown_key(fact.name, declared)}; the study declares {known} ([participants])"
            )
        _check_value(declared[fact.name], fact.value)


def _check_value(column: ParticipantColumn, value: str) -> None:
    if value == NOT_AVAILABLE:
        return
    if column.levels and value not in column.levels:
        raise ArchiveError(
            f"fact {column.name} must be one of {', '.join(column.levels)}, {NOT_AVAILABLE}; "
            f"got {value!r}"
        )
    if not is_line(value) or len(value) > _LONGEST or value != value.strip():
        raise ArchiveError(
            f"fact {column.name} must be 1 to {_LONGEST} characters in one line, without blanks at "
            f"its ends; got {value[:_LONGEST]!r}"
        )


@dataclass(frozen=True, slots=True)
class People:
    """The table participants.tsv.

    >>> people = People().with_person("01", ("hand", "age"), [Fact("hand", "left")])
    >>> people.rows, people.without("01").rows
    ((('sub-01', 'left', 'n/a'),), ())
    """

    heading: tuple[str, ...] = (ID_COLUMN,)  # `participant_id` first
    rows: tuple[tuple[str, ...], ...] = ()  # one a person, each as long as the heading

    def row_of(self, participant: str) -> tuple[str, ...] | None:
        """Return the row of a person, if there is one."""
        return next((row for row in self.rows if row[0] == f"sub-{participant}"), None)

    def value_of(self, participant: str, column: str) -> str:
        """Return one cell; ``n/a`` where the row or the column is not there."""
        row = self.row_of(participant)
        if row is None or column not in self.heading:
            return NOT_AVAILABLE
        return row[self.heading.index(column)]

    def with_person(
        self, participant: str, columns: Iterable[str], facts: Iterable[Fact]
    ) -> People:
        """Return the table with this person and these columns; what is not given is ``n/a``.

        ArchiveError where a fact differs from what is there already.
        """
        heading = (*self.heading, *(name for name in columns if name not in self.heading))
        more = (NOT_AVAILABLE,) * (len(heading) - len(self.heading))
        rows = [row + more for row in self.rows]
        if self.row_of(participant) is None:
            rows.append((f"sub-{participant}", *(NOT_AVAILABLE,) * (len(heading) - 1)))
        whole = People(heading, tuple(rows))
        for fact in facts:
            whole = whole._with_fact(participant, fact)
        return whole

    def _with_fact(self, participant: str, fact: Fact) -> People:
        there = self.value_of(participant, fact.name)
        if fact.value in (there, NOT_AVAILABLE):
            return self
        if there != NOT_AVAILABLE:
            raise ArchiveError(
                f"fact {fact.name} of participant {participant} must be {there!r}, as "
                f"{FILE_NAME} has it; got {fact.value!r}: correct the table where that is wrong"
            )
        place, name = self.heading.index(fact.name), f"sub-{participant}"
        rows = tuple(
            (*row[:place], fact.value, *row[place + 1 :]) if row[0] == name else row
            for row in self.rows
        )
        return replace(self, rows=rows)

    def without(self, participant: str) -> People:
        """Return the table without this person."""
        return replace(self, rows=tuple(row for row in self.rows if row[0] != f"sub-{participant}"))

    def text(self) -> str:
        """Write the table as it stands in the file."""
        return "".join("\t".join(row) + "\n" for row in (self.heading, *self.rows))


def read_people(root: Path) -> People:
    """Read participants.tsv; where there is none, its bare heading.

    ArchiveError where it is no such table, with file and line.
    """
    path = root / FILE_NAME
    refuse_link(path)
    if not path.exists():
        return People()
    heading, rows = _table(path)
    if heading[0] != ID_COLUMN:
        raise ArchiveError(f"{path}:1: the first column must be {ID_COLUMN}; got {heading[0]!r}")
    if len(set(heading)) != len(heading):
        raise ArchiveError(f"{path}:1: columns must have distinct names; got {', '.join(heading)}")
    lines: dict[str, int] = {}
    for number, row in rows:
        if len(row) != len(heading):
            raise ArchiveError(f"{path}:{number}: must have {len(heading)} cells; got {len(row)}")
        if not _PERSON.fullmatch(row[0]):
            raise ArchiveError(
                f"{path}:{number}: {ID_COLUMN} must be sub- and 1 to 32 letters or digits; "
                f"got {row[0]!r}"
            )
        if row[0] in lines:
            raise ArchiveError(
                f"{path}:{number}: {row[0]} must stand once; it stands in line {lines[row[0]]}, too"
            )
        lines[row[0]] = number
    return People(heading, tuple(row for _, row in rows))


def _table(path: Path) -> tuple[tuple[str, ...], list[tuple[int, tuple[str, ...]]]]:
    """Read heading and rows, with their lines' numbers; empty lines are none."""
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except UnicodeDecodeError as error:
        raise ArchiveError(f"{path}: must be UTF-8; got {error}") from error
    heading, *rows = [tuple(line.rstrip("\r").split("\t")) for line in lines]
    return heading, [(number, row) for number, row in enumerate(rows, start=2) if row != ("",)]


def check_people(root: Path, columns: Sequence[ParticipantColumn]) -> None:
    """Refuse a participants.tsv that could not be continued, or exported, later on.

    ArchiveError, with file and line, where it is no such table or has a value that a declared
    column does not know.
    """
    people, path = read_people(root), root / FILE_NAME
    places = {
        column: people.heading.index(column.name)
        for column in columns
        if column.name in people.heading
    }
    for number, row in _table(path)[1] if places else ():
        for column, place in places.items():
            try:
                _check_value(column, row[place])
            except ArchiveError as error:
                raise ArchiveError(f"{path}:{number}: {error}; correct the table") from error


def next_number(root: Path, participant: str) -> int:
    """Return the number of a person by their place in participants.tsv, counted from 1.

    Who is not in it yet comes last. Each person who withdrew counts for one, so that the number of
    a person who is entered at the end is nobody else's.
    """
    names = [row[0] for row in read_people(root).rows]
    name = f"sub-{participant}"
    place = names.index(name) if name in names else len(names)
    gone = {path.stem for path in (root / FOLDER).glob("sub-*.json")} - {*names, name}
    return place + len(gone) + 1


def enter_person(
    root: Path,
    participant: str,
    columns: Iterable[ParticipantColumn],
    facts: Iterable[Fact],
    *,
    disk: Disk = DISK,
) -> None:
    """Enter a person and what is known of them; nothing is written where nothing is new.

    ArchiveError where a fact differs from what is there already, or the person was withdrawn.
    """
    names = [column.name for column in columns]
    with lock_on(root / _LOCK):
        refuse_withdrawn(root, participant)
        before = read_people(root)
        after = before.with_person(participant, names, facts)
        if after != before:
            write_atomically(root / FILE_NAME, after.text(), disk=disk)


def remove_person(root: Path, participant: str, *, disk: Disk = DISK) -> None:
    """Remove a person's row, also from a table that was left half written.

    ArchiveError where participants.tsv is no such table.
    """
    with lock_on(root / _LOCK):
        for left_over in root.glob(f".{FILE_NAME}.*{TEMPORARY}"):
            left_over.unlink()
        before = read_people(root)
        if before.row_of(participant) is not None:
            write_atomically(root / FILE_NAME, before.without(participant).text(), disk=disk)
