"""participants.tsv: an id for each person, and the facts that the study declares; nothing else.

Of a person who withdrew a tombstone stays: that it was so, and when.
"""

from __future__ import annotations

import contextlib
import json
import re
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Final

from device.printing import shown
from experiment.names import NOT_AVAILABLE, is_line
from experiment.record.files import (
    DISK,
    FOLDER,
    ArchiveError,
    locked,
    make_folder,
    refuse_link,
    remove_left_overs,
    tsv,
    write_atomically,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from experiment.record.files import Disk
    from experiment.study.dataset import ParticipantColumn


SCHEMA: Final = 1

_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tombstone:
    """The mark that a person withdrew.

    It holds the identifier, which is what tells the person in backups and copies from the others
    and keeps it from being given again; the day; and nothing else of the person.
    """

    participant: str
    withdrawn: str  # the day, as YYYY-MM-DD in UTC
    removed: bool  # whether everything is removed; false from the first step to the last


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
    with contextlib.suppress(ValueError, RecursionError):
        match json.loads(path.read_bytes()):
            case {
                "schema": 1,
                "participant": str(name),
                "withdrawn": str(day),
                "removed": bool(removed),
            } if name == participant and _DATE.fullmatch(day):
                return Tombstone(participant=name, withdrawn=day, removed=removed)
    raise ArchiveError(
        f"{path}: must have schema 1, participant {participant}, withdrawn (YYYY-MM-DD) and "
        "removed (true or false)"
    )


def write_tombstone(root: Path, tombstone: Tombstone, *, disk: Disk = DISK) -> None:
    """Write a tombstone; it is on the disk when this returns."""
    path = tombstone_path(root, tombstone.participant)
    make_folder(path.parent, disk)
    remove_left_overs(path.parent, path.name)
    text = json.dumps({"schema": SCHEMA} | asdict(tombstone), indent=1) + "\n"
    write_atomically(path, text, disk=disk)


def refuse_withdrawn(root: Path, participant: str) -> None:
    """Refuse an identifier whose person withdrew.

    ArchiveError where there is a tombstone.
    """
    tombstone = read_tombstone(root, participant)
    if tombstone is not None:
        remedy = "the removal was interrupted: run tactstrip withdraw again"
        if tombstone.removed:
            remedy = "give another --participant: this one is not given again"
        raise ArchiveError(f"participant {participant} withdrew on {tombstone.withdrawn}; {remedy}")


ID_COLUMN: Final = "participant_id"
FILE_NAME: Final = "participants.tsv"
_LOCK = ".participants.lock"
_PERSON = re.compile(r"sub-[A-Za-z0-9]{1,32}")
_LONGEST = 200
_FORMULA = ("=", "+", "-", "@")


def participant_facts(columns: Sequence[ParticipantColumn], given: Iterable[str]) -> dict[str, str]:
    """Read the facts of one person by their columns, as a command line gives them.

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
    >>> hand = ParticipantColumn(name="hand", description="preferred", levels=("l", "r"))
    >>> participant_facts([hand], ["hand=l"])
    {'hand': 'l'}
    >>> participant_facts([hand], ["hand=both"])
    Traceback (most recent call last):
    experiment.record.files.ArchiveError: fact hand must be one of l, r, n/a; got 'both'
    """
    facts: dict[str, str] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals:
            raise ArchiveError(f"a fact must be given as NAME=VALUE; got {shown(text)}")
        if name in facts:
            raise ArchiveError(f"fact {name} must be given once; got it twice")
        facts[name] = value
    check_facts(columns, facts)
    return facts


def check_facts(columns: Sequence[ParticipantColumn], facts: Mapping[str, str]) -> None:
    """Refuse a fact that the study does not declare, or whose value it does not know.

    ArchiveError as `participant_facts`.
    """
    declared = {column.name: column for column in columns}
    for name, value in facts.items():
        if name not in declared:
            raise ArchiveError(
                f"{name}: unknown key; the study declares "
                f"{', '.join(declared) or 'none'} ([participants])"
            )
        _check_value(declared[name], value)


def _check_value(column: ParticipantColumn, value: str) -> None:
    if value == NOT_AVAILABLE:
        return
    if column.levels and value not in column.levels:
        rule = f"must be one of {', '.join(column.levels)}, {NOT_AVAILABLE}"
    elif value.startswith(_FORMULA):
        rule = f"must not begin with {' '.join(_FORMULA)}, which begin a formula in a spreadsheet"
    elif not is_line(value) or len(value) > _LONGEST or value != value.strip():
        rule = f"must be 1 to {_LONGEST} characters in one line, without blanks at its ends"
    else:
        return
    raise ArchiveError(f"fact {column.name} {rule}; got {shown(value)}")


@dataclass(frozen=True, slots=True)
class People:
    r"""The table participants.tsv.

    >>> from experiment.study.dataset import ParticipantColumn
    >>> columns = [ParticipantColumn(name=name, description=name) for name in ("hand", "age")]
    >>> people = People().with_person("01", columns, {"hand": "l"})
    >>> people.text(), people.without("01").text()
    ('participant_id\thand\tage\nsub-01\tl\tn/a\n', 'participant_id\thand\tage\n')
    """

    heading: tuple[str, ...] = (ID_COLUMN,)  # `participant_id` first
    rows: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # by id, cells by column

    def with_person(
        self, participant: str, columns: Sequence[ParticipantColumn], facts: Mapping[str, str]
    ) -> People:
        """Return the table with this person and these columns; what is not given is ``n/a``.

        ArchiveError where a fact is not declared, or differs from what is there already.
        """
        check_facts(columns, facts)
        name = f"sub-{participant}"
        cells = {ID_COLUMN: name, **self.rows.get(name, {})}
        for column, value in facts.items():
            present = cells.get(column, NOT_AVAILABLE)
            if present == NOT_AVAILABLE:
                cells[column] = value
            elif value not in (present, NOT_AVAILABLE):
                raise ArchiveError(
                    f"fact {column} of participant {participant} must be {present!r}, as "
                    f"{FILE_NAME} has it; got {shown(value)}: correct the table if that is wrong"
                )
        heading = tuple(dict.fromkeys((*self.heading, *(column.name for column in columns))))
        return People(heading, {**self.rows, name: cells})

    def without(self, participant: str) -> People:
        """Return the table without this person."""
        rows = {name: row for name, row in self.rows.items() if name != f"sub-{participant}"}
        return People(self.heading, rows)

    def text(self) -> str:
        """Write the table as it stands in the file."""
        rows = ([row.get(c, NOT_AVAILABLE) for c in self.heading] for row in self.rows.values())
        return tsv((self.heading, *rows))


def read_people(root: Path, columns: Iterable[ParticipantColumn] = ()) -> People:
    """Read participants.tsv; where there is none, its bare heading.

    ArchiveError, with file and line, where it is no such table or has a value that one of the
    columns does not know.
    """
    path = root / FILE_NAME
    refuse_link(path)
    if not path.exists():
        return People()
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except UnicodeDecodeError as error:
        raise ArchiveError(f"{path}: must be UTF-8; got {error}") from error
    heading, *rows = [tuple(line.rstrip("\r").split("\t")) for line in lines]
    if heading[0] != ID_COLUMN:
        raise ArchiveError(
            f"{path}:1: the first column must be {ID_COLUMN}; got {shown(heading[0])}"
        )
    if len(set(heading)) != len(heading):
        raise ArchiveError(f"{path}:1: columns must have distinct names; got {', '.join(heading)}")
    declared = {column.name: column for column in columns}
    people: dict[str, dict[str, str]] = {}
    for number, row in enumerate(rows, start=2):
        if row == ("",):
            continue
        try:
            _check_row(heading, row, declared)
            if row[0] in people:
                raise ArchiveError(f"{row[0]} must stand once; an earlier line has it, too")
        except ArchiveError as error:
            raise ArchiveError(f"{path}:{number}: {error}; correct the table") from error
        people[row[0]] = dict(zip(heading, row, strict=True))
    return People(heading, people)


def _check_row(
    heading: tuple[str, ...], row: tuple[str, ...], declared: Mapping[str, ParticipantColumn]
) -> None:
    if len(row) != len(heading):
        raise ArchiveError(f"must have {len(heading)} cells; got {len(row)}")
    if not _PERSON.fullmatch(row[0]):
        raise ArchiveError(
            f"{ID_COLUMN} must be sub- and 1 to 32 letters or digits; got {shown(row[0])}"
        )
    for name, value in zip(heading, row, strict=True):
        if name in declared:
            _check_value(declared[name], value)


def next_number(root: Path, participant: str) -> int:
    """Return the number of a person by their place in participants.tsv, counted from 1.

    Who is not in it yet comes last. Each person who withdrew counts for one, so that the number of
    a person who is entered at the end is nobody else's.
    """
    names = [*read_people(root).rows]
    name = f"sub-{participant}"
    place = names.index(name) if name in names else len(names)
    gone = {path.stem for path in (root / FOLDER).glob("sub-*.json")} - {*names, name}
    return place + len(gone) + 1


def enter_person(
    root: Path,
    participant: str,
    columns: Sequence[ParticipantColumn],
    facts: Mapping[str, str],
    *,
    disk: Disk = DISK,
) -> None:
    """Enter a person and what is known of them; nothing is written where nothing is new.

    ArchiveError as `People.with_person`, or where the person was withdrawn.
    """
    with locked(root / _LOCK):
        refuse_withdrawn(root, participant)
        before = read_people(root)
        after = before.with_person(participant, columns, facts)
        if after != before:
            write_atomically(root / FILE_NAME, after.text(), disk=disk)


def remove_person(root: Path, participant: str, *, disk: Disk = DISK) -> None:
    """Remove a person's row, also from a table that was left half written.

    ArchiveError where participants.tsv is no such table.
    """
    with locked(root / _LOCK):
        remove_left_overs(root, FILE_NAME)
        before = read_people(root)
        if f"sub-{participant}" in before.rows:
            write_atomically(root / FILE_NAME, before.without(participant).text(), disk=disk)
