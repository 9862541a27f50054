"""Sessions of tactstrip: trials.csv, the plan it must keep to, the journal it is built from."""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Final

from analysis.reading.cells import text_frame
from analysis.reading.sources import TABLE, refusals
from analysis.reading.text import (
    ELSEWHERE,
    ResultFileError,
    TextFormat,
    one_line,
    shown,
    text_chunks,
)
from experiment.bounded import read_bounded
from experiment.names import OTHER_VERSION
from experiment.record.files import JOURNAL, PLAN, SESSIONS_TABLE
from experiment.record.rows import SCHEMA, columns_of
from experiment.record.verify import examine

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    import pandas as pd

    from analysis.reading.sources import InputTable
    from experiment.record.entries import MeasuredRow
    from experiment.record.index import Difference
    from experiment.tasks.task import Task
    from experiment.trial.plan import Plan


_MAX_TABLE_BYTES: Final = 500_000_000
_BESIDE_PLAN: Final = "tactstrip reads a table of other sites only next to its plan.json"
_EXPORTED_SUFFIX: Final = ".tsv"
_EXPORTED: Final = TextFormat(delimiter="\t")
"""How `tactstrip export --bids` writes events."""


def read_own_texts(
    raw: bytes, table: Path, task: Task, *, empty_allowed: bool
) -> Iterator[pd.DataFrame]:
    """Yield the rows of a trials.csv, or of an exported events.tsv, as text, by their lines.

    The columns are those of the task. Raises ResultFileError as `text_chunks`, for a table of
    another version, and for an unknown or missing column.
    """
    file = str(table)
    form = _EXPORTED if table.suffix == _EXPORTED_SUFFIX else None
    header, chunks = text_chunks(io.BytesIO(raw), file, form=form, empty_allowed=empty_allowed)
    for lines, cells in chunks:
        texts = text_frame(header, lines, cells)
        if form:
            from experiment.record.bids import event_columns

            columns = event_columns(task)
            if {*header} == {*columns}:
                sources = {name: ours for name, ours in columns.items() if ours}
                texts = texts[[*sources]].rename(columns=sources)
        yield _own_columns(texts, file, [column.name for column in columns_of(task)])


def _own_columns(texts: pd.DataFrame, file: str, expected: list[str]) -> pd.DataFrame:
    names = [str(name) for name in texts.columns]
    unknown = [f"unknown column {shown(name)}" for name in names if name not in expected]
    missing = [name for name in expected if name not in names]
    if not (unknown or missing):
        return texts if names == expected else texts[expected]
    schema = "".join(texts["schema"].head(1)) if "schema" in texts else ""
    if schema.isdecimal() and int(schema) != SCHEMA:
        message = f"schema must be {SCHEMA}; got {shown(schema)}: {OTHER_VERSION}"
        raise ResultFileError(file, 2, message)
    fault = [*unknown, f"no column {', '.join(missing)}"][0]
    hint = _BESIDE_PLAN if {"schema", "study_sha256"} <= {*names} else ELSEWHERE
    raise ResultFileError(file, 1, f"{fault}; {hint}")


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class InputFile:
    """A file that was read: its name as `InputTable.name`, and the checksum of its bytes."""

    name: str
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionProgress:
    """How far a session came."""

    plan: Plan  # without its trials, which fill the memory
    planned: int  # trials of the plan, without the warm-up after a resume
    valid: int = 0  # of these, those with a valid attempt
    unexported: int  # trials in the journal that the table lacks
    measured: tuple[MeasuredRow, ...] = field(repr=False)  # by a monitor


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SessionRecord:
    """A table, and what is known of its session.

    Attributes
    ----------
    inputs : tuple of InputFile
        The table, and its plan if there is one that can be trusted.
    progress : SessionProgress or None
        How far the session came in that plan, without the rows of the table.
    compared : bool
        Whether the table was compared with a journal.
    altered : tuple of str
        Differences from the recorded session, a line each. They are empty unless modified sessions
        are accepted. The exception is a removed journal: its table is always read, and marked.
    """

    inputs: tuple[InputFile, ...]
    progress: SessionProgress | None
    compared: bool
    altered: tuple[str, ...]


def read_record(
    table: InputTable, *, accept_altered: bool
) -> tuple[SessionRecord, bytes, Plan | None]:
    """Read a table and the files of its session.

    Also returns the contents of the table, and the plan by which its rows are to be checked. A
    table is read once, so that the analysis uses the bytes that were compared and checksummed.

    A journal is replayed by its plan, so that a table that equals it agrees with the plan already.
    A table of another name in the folder of a journal counts as a copy of trials.csv, and is
    compared like it.

    Raises ResultFileError for a session of another version of this program, and for the first
    difference from the recorded session unless modified sessions are accepted.
    """
    path = table.path
    if path.is_symlink() and (target := path.resolve()).with_name(JOURNAL).is_file():
        message = f"is a symbolic link to {target}, whose journal lies there; give that file itself"
        raise ResultFileError(path, None, message)
    examined = None
    altered: Sequence[Difference] = ()
    with refusals(path):
        if path.name == TABLE or path.with_name(JOURNAL).exists():
            examined = examine(path.parent, path.name)
            altered = examined.differences
            of_journal = set() if examined.has_journal else {JOURNAL, SESSIONS_TABLE}
            compared = [d for d in altered if d.path.name not in of_journal]
            if not accept_altered:
                _refuse_differences(compared, "takes it if its rows are consistent")
            # Without a journal nothing but sessions.tsv shows that there was one.
            altered = altered if examined.seal else compared
        raw = examined.files[path.name] if examined else None
        if raw is None:
            raw = read_bounded(path, _MAX_TABLE_BYTES)
    inputs = [InputFile(name=table.name, sha256=hashlib.sha256(raw).hexdigest())]
    progress = plan = None
    if examined and examined.plan and (examined.history or not examined.has_journal):
        history, plan = examined.history, examined.plan
        name = PurePosixPath(table.name).with_name(PLAN).as_posix()
        inputs.append(InputFile(name=name, sha256=examined.plan_file_sha256))
        progress = SessionProgress(
            plan=replace(plan, trials=(), warm_up=(), gains=()),
            planned=len(plan.trials),
            unexported=len(history.rows) if history else 0,
            measured=history.measured if history else (),
        )
    is_compared = examined is not None and examined.has_journal
    record = SessionRecord(
        inputs=tuple(inputs),
        progress=progress,
        compared=is_compared,
        altered=tuple(_format_difference(each, table) for each in altered),
    )
    return record, raw, None if is_compared else plan


def _refuse_differences(differences: Sequence[Difference], action: str) -> None:
    """Refuse the first difference; name the option that accepts all, and the remedy."""
    if not differences:
        return
    first, *others = differences
    more = f" (and {len(others)} more; tactstrip verify DIR names all)" if others else ""
    remedy = {each.remedy for each in differences}
    restore = "; restore it from a copy" * (None in remedy)
    export = ", tactstrip export DIR rebuilds it from the journal" * (remedy == {"export"})
    accept = f"tactstrip analyze --accept-altered {action}, with a mark{export}"
    message = f"{first.message}{first.hint}{more}{restore}; {accept}"
    raise ResultFileError(first.path, first.line, message)


def read_missing(
    tables: Iterable[InputTable], *, accept_altered: bool
) -> tuple[dict[str, str], dict[str, tuple[str, ...]]]:
    """Look at the sessions that lack their table.

    Returns, by the names of sessions, what can be done about each that is as it was recorded, and
    what is not as it was recorded in the others.

    Raises ResultFileError as `read_record`, and for a session of which no file is left, unless that
    is accepted.

    >>> read_missing([], accept_altered=False)
    ({}, {})
    """
    without_table: dict[str, str] = {}
    lost: dict[str, tuple[str, ...]] = {}
    for table in tables:
        session = one_line("/".join(table.path.resolve().parts[-3:-1]))
        differences: tuple[Difference, ...] = (table.lost,) if table.lost else ()
        remedy = "nothing was recorded in it"
        if not table.lost:
            with refusals(table.path):
                examined = examine(table.path.parent, table.path.name)
            differences = examined.differences
            remedy = "tactstrip export DIR builds it" if examined.history else remedy
        if not accept_altered:
            _refuse_differences(differences, "leaves the session out")
        if differences:
            lost[session] = tuple(_format_difference(each, table) for each in differences)
        else:
            without_table[session] = remedy
    return without_table, lost


def _format_difference(difference: Difference, table: InputTable) -> str:
    """Return a difference as a line, its file named as the table is."""
    folder = PurePosixPath(table.name).parent
    file = (
        folder.parent if difference.path.name == SESSIONS_TABLE else folder
    ) / difference.path.name
    line = "" if difference.line is None else f":{difference.line}"
    return f"{file}{line}: {difference.message}"


def contacts(
    progress: Iterable[SessionProgress], sessions: Iterable[tuple[str, str]]
) -> dict[str, tuple[str, ...]]:
    """Return the sessions by what their study states about force and contact of the fingers.

    The participants and sessions are those of the trials; without a plan nothing is stated.

    >>> contacts([], [("01", "01"), ("02", "01")])
    {'not stated': ('sub-01/ses-01', 'sub-02/ses-01')}
    """
    from experiment.study.equipment import Contact

    plans = [session.plan for session in progress]
    sections = {(p.participant, p.session): json.loads(p.study).get("contact") for p in plans}
    sessions_of: dict[str, tuple[str, ...]] = {}
    for participant, session in sessions:
        section = sections.get((participant, session)) or {}
        summary = Contact.model_construct(**section).summary
        name = f"sub-{participant}/ses-{session}"
        sessions_of[summary] = (*sessions_of.get(summary, ()), name)
    return sessions_of
