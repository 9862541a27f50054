"""Sessions of tactstrip: trials.csv, the plan it must keep to, the journal it is built from."""

from __future__ import annotations

import hashlib
import json
from collections import namedtuple
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from analysis.reading.sources import TABLE, read_regular, unreadable
from analysis.reading.text import ELSEWHERE, ResultFileError, shown
from experiment.archive.files import HEADS, JOURNAL, LinkError, refuse_links
from experiment.archive.journal import RecordSchemaError
from experiment.integrity.sessions import examine, removed_journal
from experiment.rows import (
    ANSWERS,
    COLUMNS,
    OTHER_VERSION,
    RESPONSES,
    SCHEMA,
    format_value,
)
from experiment.trial.plan import plan_from_json

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    import pandas as pd

    from analysis.reading.sources import InputTable, Sources
    from experiment.integrity.sessions import Difference, Examined
    from experiment.rows import MeasuredRow
    from experiment.trial.plan import Plan, Trial


PLAN = "plan.json"
NAMES = tuple(column.name for column in COLUMNS)
_MAX_PLAN_BYTES = 50_000_000
_OF_TRIAL = ("condition", "block", "kind", "side", "level_vpp")
_Row = namedtuple(  # noqa: PYI024 (whatever the types: rows are made by the hundred thousand)
    "_Row",
    "participant session study_sha256 trial condition block kind side level_vpp response "
    "rt_s status line",
)
_NEVER_DECLARED = tuple(word for word in RESPONSES if word not in ANSWERS)


EXPORTED_SUFFIX = ".tsv"


def own_columns(texts: dict[str, list[str]], file: str) -> dict[str, list[str]]:
    """Return the columns of a trials.csv, or of an events.tsv that was exported from one.

    Raises ResultFileError for a table of another version, and for an unknown or missing column.

    >>> own_columns({"colour": ["red"]}, "t.csv")
    Traceback (most recent call last):
    analysis.reading.text.ResultFileError: t.csv:1: unknown column 'colour'; an external table ...
    """
    if file.endswith(EXPORTED_SUFFIX):
        from experiment.archive.bids import EVENT_COLUMNS  # with all of a study's sections

        if {*texts} == {*EVENT_COLUMNS}:
            texts = {ours: texts[name] for name, ours in EVENT_COLUMNS.items() if ours}
    schema = "".join(texts.get("schema", ())[:1])
    if {*texts} != {*NAMES} and schema.isdecimal() and int(schema) != SCHEMA:
        message = f"schema must be {SCHEMA}; got {shown(schema)}: {OTHER_VERSION}"
        raise ResultFileError(file, 2, message)
    for name in texts:
        if name not in NAMES:
            raise ResultFileError(file, 1, f"unknown column {shown(name)}; {ELSEWHERE}")
    if missing := [name for name in NAMES if name not in texts]:
        raise ResultFileError(file, 1, f"no column {', '.join(missing)}; {ELSEWHERE}")
    return {name: texts[name] for name in NAMES}


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionProgress:
    """How far a session came."""

    participant: str
    session: str
    valid: int  # planned trials with a valid attempt
    planned: int  # trials of the plan, without the warm-up after a resume
    file_sha256: str  # of the study as its file states it, before levels were placed
    unexported: int  # trials of which the journal beside the table tells, and the table does not
    study: str  # the canonical text that the plan holds
    keys_set: tuple[str, ...]  # keys that the study file sets
    measured: tuple[MeasuredRow, ...] = field(default=(), repr=False)  # by a monitor


def read_plan(table: Path) -> tuple[Plan, str] | None:
    """Read the plan beside a trials.csv and the checksum of its bytes, where there is one.

    Beside a table of another name no plan is looked for.

    Raises ResultFileError for a plan that cannot be read, was changed after it was sealed, or
    belongs to another session than its folder.

    >>> from pathlib import Path
    >>> read_plan(Path("table.csv")) is None
    True
    """
    path = table.with_name(PLAN)
    if table.name != TABLE or not (path.exists() or path.is_symlink()):
        return None
    try:
        raw = read_regular(path, _MAX_PLAN_BYTES)
        plan = plan_from_json(raw.decode())
    except OSError as error:
        raise unreadable(error, path) from None
    except (ValueError, RecursionError) as error:
        raise ResultFileError(path, None, f"not a sealed plan: {error}") from None
    _check_folder(plan, path)
    return plan, hashlib.sha256(raw).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SessionRecord:
    """What lies beside a table.

    Attributes
    ----------
    plan : Plan or None
        The plan, where there is one that can be trusted.
    plan_file_sha256 : str
        Checksum of its file.
    compared : bool
        Whether there is a journal, so that the table was compared with it.
    ended : int
        How many trials it tells of, where they may be others than those of the table.
    measured : tuple of MeasuredRow
        What it tells that a monitor measured.
    altered : tuple of Difference
        Where the session is not as it was recorded. Empty unless that is accepted, but for a
        journal that was removed: a table without one is taken, and marked.
    """

    plan: Plan | None = None
    plan_file_sha256: str = ""
    compared: bool = False
    ended: int = 0
    measured: tuple[MeasuredRow, ...] = ()
    altered: tuple[Difference, ...] = ()


def read_record(table: Path, *, accept_altered: bool) -> SessionRecord:
    """Read what lies beside a table; of a session that was altered no plan is read if in doubt.

    A table of another name beside a journal is taken for a copy, and compared like trials.csv.

    Raises ResultFileError as `read_plan`; for a session of another version of this program; and for
    the first difference from what was recorded, unless that is accepted.

    >>> from pathlib import Path
    >>> read_record(Path("table.csv"), accept_altered=False).compared
    False
    """
    journal = table.with_name(JOURNAL)
    meant = table.resolve()
    if table.is_symlink() and meant.with_name(JOURNAL).is_file():
        message = f"is a symbolic link to {meant}, whose journal lies there; give that file itself"
        raise ResultFileError(table, None, message)
    if not journal.is_file():
        if table.name == TABLE or journal.is_symlink():
            _refuse_links(table)
        removed = removed_journal(table.parent) if table.name == TABLE else ()
        plan, sha256 = read_plan(table) or (None, "")
        return SessionRecord(plan=plan, plan_file_sha256=sha256, altered=removed)
    record = _examine(table)
    if record.differences and not accept_altered:
        raise _refusal(record, "takes it if its rows are consistent")
    return SessionRecord(
        plan=record.plan if record.history or not record.differences else None,
        plan_file_sha256=record.plan_file_sha256,
        compared=True,
        ended=len(record.history.rows) if record.history else 0,
        measured=record.history.measured if record.history else (),
        altered=record.differences,
    )


def _refuse_links(table: Path) -> None:
    try:
        refuse_links(table.parent, table.name)
    except LinkError as error:
        raise ResultFileError(error.path, None, error.message) from None


def _examine(table: Path) -> Examined:
    try:
        return examine(table.parent, table.name)
    except (RecordSchemaError, LinkError) as error:
        line = None if isinstance(error, LinkError) else error.line
        raise ResultFileError(error.path, line, error.message) from None
    except OSError as error:
        raise unreadable(error, table) from None
    except ValueError as error:
        raise ResultFileError(table, None, str(error)) from None


def _refusal(record: Examined, does: str, *, without_table: bool = False) -> ResultFileError:
    """Say the first of the differences, what accepts it and, of one of the table, what mends it."""
    first, *rest = record.differences
    more = f" (and {len(rest)} more; tactstrip verify DIR names all)" if rest else ""
    mended = all(difference.mended_by == "export" for difference in record.differences)
    if without_table and any(difference.mended_by is None for difference in record.differences):
        more += f"; no {TABLE} can be built of it: restore it from a copy"
    return _not_accepted(
        first,
        f"{more}; tactstrip analyze --accept-altered {does}, with a mark"
        + (", tactstrip export DIR builds it anew from the journal" if mended else ""),
    )


def _not_accepted(first: Difference, what: str) -> ResultFileError:
    return ResultFileError(first.path, first.line, f"{first.message}{first.hint}{what}")


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """Sessions of which there is no table, by their names.

    Attributes
    ----------
    without_table : mapping of str to str
        What can be done about each that is as it was recorded.
    lost : mapping of str to tuple of str
        What is not as it was recorded in the others.
    """

    without_table: Mapping[str, str]
    lost: Mapping[str, tuple[str, ...]]


def left_out(sources: Sources, *, accept_altered: bool) -> LeftOut:
    """Look at the sessions without a table.

    Raises ResultFileError as `read_record`, and for a session of which no file is left, unless that
    is accepted.

    >>> from analysis.reading.sources import Sources
    >>> left_out(Sources(tables=()), accept_altered=False)
    LeftOut(without_table={}, lost={})
    """
    without, lost = {}, {}
    for table in sources.without:
        record = _examine(table.path)
        if record.differences and not accept_altered:
            raise _refusal(record, "leaves the session out", without_table=True)
        if record.differences:
            lost[_session(table)] = tuple(
                format_difference(difference, table.name) for difference in record.differences
            )
        else:
            builds = "tactstrip export DIR builds it"
            without[_session(table)] = builds if record.history else "nothing was recorded in it"
    for table, difference in sources.lost:
        if not accept_altered:
            raise _not_accepted(
                difference,
                "; restore it from a copy; tactstrip analyze --accept-altered leaves "
                "the session out, with a mark",
            )
        lost[_session(table)] = (format_difference(difference, table.name),)
    return LeftOut(without_table=without, lost=lost)


def _session(table: InputTable) -> str:
    return beside(table.name, "").removesuffix("/") or table.path.resolve().parent.name


def beside(name: str, file: str) -> str:
    """Return the name of a file beside another.

    >>> beside("sub-01/ses-01/trials.csv", "plan.json"), beside("trials.csv", "plan.json")
    ('sub-01/ses-01/plan.json', 'plan.json')
    """
    return name[: name.rfind("/") + 1] + file


def format_difference(difference: Difference, name: str) -> str:
    """Return a difference as a line, its file named as the table is, by `name`.

    >>> from pathlib import Path
    >>> from experiment.integrity.sessions import Difference
    >>> folder = Path("results/sub-01/ses-01")
    >>> difference = Difference(path=folder / "header.json", line=None, message="is missing")
    >>> format_difference(difference, "sub-01/ses-01/trials.csv")
    'sub-01/ses-01/header.json: is missing'
    """
    folder = beside(name, "")
    if difference.path.name == HEADS:
        folder = "".join(f"{name}/" for name in folder.split("/")[:-2])
    line = "" if difference.line is None else f":{difference.line}"
    return f"{folder}{difference.path.name}{line}: {difference.message}"


def _check_folder(plan: Plan, path: Path) -> None:
    """Refuse a plan in the folder ``sub-*/ses-*`` of another session."""
    session = path.parent.resolve()
    folders = ((session.parent, "sub-", plan.participant), (session, "ses-", plan.session))
    for folder, prefix, name in folders:
        if folder.name.startswith(prefix) and folder.name != prefix + name:
            message = f"the plan of {prefix}{name}, but the folder is {folder.name}"
            raise ResultFileError(path, None, message)


def plan_rows(rows: pd.DataFrame) -> list[Any]:
    """Return typed rows as tuples with what `check_plan` and `progress` look at.

    >>> import pandas as pd
    >>> plan_rows(pd.DataFrame([dict.fromkeys(_Row._fields, "01")]))[0].session
    '01'
    """
    return list(map(_Row._make, zip(*(rows[name].tolist() for name in _Row._fields), strict=True)))


def check_plan(rows: Sequence[Any], file: str, plan: Plan) -> None:
    """Refuse the rows of one session where they contradict its plan.

    Rows come from `plan_rows`; the level of a blank trial is NaN.

    Raises ResultFileError naming the first line that is of another participant, session or study,
    presents what was not planned, or has an answer that was not declared or came after the response
    window.

    >>> import pandas as pd
    >>> from types import SimpleNamespace
    >>> plan = SimpleNamespace(participant="01", session="01", trials=(), warm_up=(),
    ...     responses=("left",), response_window_s=2.0)
    >>> row = dict.fromkeys(_Row._fields, "02") | {"line": 2}
    >>> check_plan(plan_rows(pd.DataFrame([row])), "trials.csv", plan)
    Traceback (most recent call last):
    analysis.reading.text.ResultFileError: trials.csv:2: column 'participant' is 02; it must be
    01 by the plan beside the table
    """
    trials = {trial.number: trial for trial in (*plan.trials, *plan.warm_up)}
    for row in rows:
        for column, must in _breaches(row, trials.get(row.trial), plan):
            value = format_value(_value(getattr(row, column)))
            fault = f"column '{column}' is {value}; it must be {must} by the plan beside the table"
            raise ResultFileError(file, row.line, fault)


def _breaches(row: Any, trial: Trial | None, plan: Plan) -> Iterator[tuple[str, str]]:
    """Yield the columns in which a row breaks its plan, and what they must be."""
    for name in ("participant", "session", "study_sha256"):
        if getattr(row, name) != getattr(plan, name):
            yield name, getattr(plan, name)
    if trial is None:
        yield "trial", "the number of a planned trial"
    for name in _OF_TRIAL if trial else ():
        if _value(getattr(row, name)) != getattr(trial, name):
            yield name, f"{format_value(getattr(trial, name))} in trial {row.trial}"
    offered = plan.responses if trial is None else plan.answers_to(trial)
    allowed = (*offered, *_NEVER_DECLARED)
    if _value(row.response) not in {*allowed, None}:
        yield "response", f"one of {', '.join(allowed)}"
    if row.rt_s > plan.response_window_s:
        yield "rt_s", f"at most the response window, {plan.response_window_s:g},"


def _value(value: Any) -> Any:
    return None if value is None or value != value else value  # noqa: PLR0124 (NaN)


def progress(rows: Sequence[Any], plan: Plan, ended: int) -> SessionProgress:
    """Count the planned trials that have a valid attempt; a journal tells how many `ended`.

    >>> from types import SimpleNamespace
    >>> trials = [SimpleNamespace(number=number) for number in (1, 2)]
    >>> plan = SimpleNamespace(participant="01", session="01", trials=trials, file_sha256="f",
    ...     study="{}", keys_set=())
    >>> rows = [SimpleNamespace(trial=1, status="ok"), SimpleNamespace(trial=2, status="voided")]
    >>> progress(rows, plan, 2)
    SessionProgress(participant='01', session='01', valid=1, planned=2, file_sha256='f',
    unexported=0, study='{}', keys_set=())
    """
    numbers = {trial.number for trial in plan.trials}
    return SessionProgress(
        participant=plan.participant,
        session=plan.session,
        valid=sum(row.status == "ok" and row.trial in numbers for row in rows),
        planned=len(numbers),
        file_sha256=plan.file_sha256,
        unexported=max(0, ended - len(rows)),
        study=plan.study,
        keys_set=plan.keys_set,
    )


def contacts(
    progress: Iterable[SessionProgress], sessions: Iterable[tuple[str, str]]
) -> dict[str, tuple[str, ...]]:
    """Return the sessions by what their study states about force and contact of the fingers.

    The participants and sessions are those of the trials; without a plan nothing is stated.

    >>> contacts([], [("01", "01"), ("02", "01")])
    {'not stated': ('sub-01/ses-01', 'sub-02/ses-01')}
    """
    studies = {(session.participant, session.session): session.study for session in progress}
    summaries = {"": "not stated"}  # by the study's section: a lab's studies differ elsewhere
    sessions_of: dict[str, list[str]] = {}
    for participant, session in sessions:
        text = studies.get((participant, session))
        section = "" if text is None else json.dumps(json.loads(text).get("contact"))
        if text is not None and section not in summaries:
            summaries[section] = _contact(text)
        sessions_of.setdefault(summaries[section], []).append(f"sub-{participant}/ses-{session}")
    return {summary: tuple(names) for summary, names in sessions_of.items()}


def _contact(text: str) -> str:
    from experiment.study.base import StudyError
    from experiment.study.files import study_from_canonical

    try:
        return study_from_canonical(text).contact.summary
    except StudyError:
        return "not known, for this version cannot read the study"
