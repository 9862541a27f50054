"""The people of a study: participants.tsv, and the records of those who withdrew.

participants.tsv has an identifier for each person and the columns that the study declares.
"""

from __future__ import annotations

import contextlib
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from device.printing import shown
from experiment.names import NOT_AVAILABLE, is_line
from experiment.record.files import (
    DISK,
    WITHDRAWN_FOLDER,
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


class WithdrawalRecord(BaseModel):
    """What stays of a person who withdrew.

    It holds the identifier, by which the person's data are found in backups and copies and which is
    not given again, and the day; nothing else of the person.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    version: Literal[1] = Field(default=1, alias="schema")
    """Version of the file."""
    participant: str
    """Identifier of the person."""
    withdrawn: str = Field(pattern=r"^\d{4}-\d{2}-\d{2}$")
    """Day, as YYYY-MM-DD in UTC."""
    removed: bool
    """Whether everything is removed; false from the first step of the removal to the last."""


def withdrawal_path(root: Path, participant: str) -> Path:
    """Return the path of a person's withdrawal record in a study's folder.

    >>> from pathlib import Path
    >>> withdrawal_path(Path("results"), "07").as_posix()
    'results/withdrawn/sub-07.json'
    """
    return root / WITHDRAWN_FOLDER / f"sub-{participant}.json"


def read_withdrawal(root: Path, participant: str) -> WithdrawalRecord | None:
    """Read a person's withdrawal record; None if there is none.

    Raises
    ------
    ArchiveError
        If the file is no withdrawal record of this person.
    """
    path = withdrawal_path(root, participant)
    if not path.exists():
        return None
    with contextlib.suppress(ValidationError):
        record = WithdrawalRecord.model_validate_json(path.read_bytes())
        if record.participant == participant and "version" in record.model_fields_set:
            return record
    raise ArchiveError(
        f"{path}: must have schema 1, participant {participant}, withdrawn (YYYY-MM-DD) and "
        "removed (true or false)"
    )


def write_withdrawal(root: Path, record: WithdrawalRecord, *, disk: Disk = DISK) -> None:
    """Write a withdrawal record; it is on the disk when this returns."""
    path = withdrawal_path(root, record.participant)
    make_folder(path.parent, disk)
    remove_left_overs(path.parent, path.name)
    write_atomically(path, record.model_dump_json(by_alias=True, indent=1) + "\n", disk=disk)


def refuse_withdrawn(root: Path, participant: str) -> None:
    """Raise ArchiveError if a person withdrew, or the removal of their data was interrupted."""
    record = read_withdrawal(root, participant)
    if record is not None:
        remedy = "the removal was interrupted: run tactstrip withdraw again"
        if record.removed:
            remedy = "give another --participant: this one is not given again"
        raise ArchiveError(f"participant {participant} withdrew on {record.withdrawn}; {remedy}")


ID_COLUMN: Final = "participant_id"
FILE_NAME: Final = "participants.tsv"
_LOCK = ".participants.lock"
_PERSON = re.compile(r"sub-[A-Za-z0-9]{1,32}")
_MAX_CHARACTERS = 200
_FORMULA = ("=", "+", "-", "@")


def parse_participant_values(
    columns: Sequence[ParticipantColumn], given: Iterable[str]
) -> dict[str, str]:
    """Return the values of one person by their columns, from the texts of a command line.

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
    >>> parse_participant_values([hand], ["hand=l"])
    {'hand': 'l'}
    >>> parse_participant_values([hand], ["hand=both"])
    Traceback (most recent call last):
    experiment.record.files.ArchiveError: fact hand must be one of l, r, n/a; got 'both'
    """
    values: dict[str, str] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals:
            raise ArchiveError(f"a fact must be given as NAME=VALUE; got {shown(text)}")
        if name in values:
            raise ArchiveError(f"fact {name} must be given once; got it twice")
        values[name] = value
    check_participant_values(columns, values)
    return values


def check_participant_values(
    columns: Sequence[ParticipantColumn], values: Mapping[str, str]
) -> None:
    """Raise ArchiveError for a column that the study does not declare or a value it refuses."""
    declared = {column.name: column for column in columns}
    for name, value in values.items():
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
    elif not is_line(value) or len(value) > _MAX_CHARACTERS or value != value.strip():
        rule = f"must be 1 to {_MAX_CHARACTERS} characters in one line, without blanks at its ends"
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
        self, participant: str, columns: Sequence[ParticipantColumn], values: Mapping[str, str]
    ) -> People:
        """Return the table with this person and these columns; what is not given is ``n/a``.

        ArchiveError if a column is not declared, or a value differs from the one in the table.
        """
        check_participant_values(columns, values)
        name = f"sub-{participant}"
        cells = {ID_COLUMN: name, **self.rows.get(name, {})}
        for column, value in values.items():
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
        """Return the table in the format of the file."""
        rows = ([row.get(c, NOT_AVAILABLE) for c in self.heading] for row in self.rows.values())
        return tsv((self.heading, *rows))


def read_people(root: Path, columns: Iterable[ParticipantColumn] = ()) -> People:
    """Read participants.tsv; without the file, a table without rows.

    Raises
    ------
    ArchiveError
        If the file is no such table, or has a value that one of the columns refuses; with the line.
    """
    path = root / FILE_NAME
    refuse_link(path)
    if not path.exists():
        return People()
    try:
        lines = path.read_text(encoding="utf-8-sig").split("\n")
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
    """Return the number of a person: their position in participants.tsv, counted from 1.

    A person who is not yet in the table comes last. People who withdrew count, so that each number
    is used once.
    """
    names = [*read_people(root).rows]
    name = f"sub-{participant}"
    index = names.index(name) if name in names else len(names)
    records = {path.stem for path in (root / WITHDRAWN_FOLDER).glob("sub-*.json")}
    return index + len(records - {*names, name}) + 1


def enter_person(
    root: Path,
    participant: str,
    columns: Sequence[ParticipantColumn],
    values: Mapping[str, str],
    *,
    disk: Disk = DISK,
) -> None:
    """Enter a person with their values in participants.tsv; written only if something is new.

    Raises
    ------
    ArchiveError
        As `People.with_person`, or if the person withdrew.
    """
    with locked(root / _LOCK):
        refuse_withdrawn(root, participant)
        before = read_people(root)
        after = before.with_person(participant, columns, values)
        if after != before:
            write_atomically(root / FILE_NAME, after.text(), disk=disk)


def remove_person(root: Path, participant: str, *, disk: Disk = DISK) -> None:
    """Remove a person's row from participants.tsv, and tables that were left half written.

    Raises
    ------
    ArchiveError
        If participants.tsv is not a valid table.
    """
    with locked(root / _LOCK):
        remove_left_overs(root, FILE_NAME)
        before = read_people(root)
        if f"sub-{participant}" in before.rows:
            write_atomically(root / FILE_NAME, before.without(participant).text(), disk=disk)
