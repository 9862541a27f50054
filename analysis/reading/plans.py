"""What lies beside a trials.csv: the plan that it must keep to, the journal that it is built of."""

from __future__ import annotations

import hashlib
import json
from collections import namedtuple
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from analysis.reading.sources import TABLE, read_regular, unreadable
from analysis.reading.text import ResultFileError
from experiment.archive.files import HEADS, JOURNAL, LinkError, refuse_links
from experiment.archive.journal import RecordSchemaError
from experiment.integrity.sessions import examine, removed_journal
from experiment.rows import ANSWERS, RESPONSES, format_value
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
_MAX_PLAN_BYTES = 50_000_000
_OF_TRIAL = ("condition", "block", "kind", "side", "level_vpp")
_Row = namedtuple(  # noqa: PYI024 (whatever the types: rows are made by the hundred thousand)
    "_Row",
    "participant session study_sha256 trial condition block kind side level_vpp response "
    "rt_s status line",
)
_NEVER_DECLARED = tuple(word for word in RESPONSES if word not in ANSWERS)


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
    found = _examined(table)
    if found.differences and not accept_altered:
        raise _refusal(found, "takes it if its rows are consistent")
    return SessionRecord(
        plan=found.plan if found.history or not found.differences else None,
        plan_file_sha256=found.plan_file_sha256,
        compared=True,
        ended=len(found.history.rows) if found.history else 0,
        measured=found.history.measured if found.history else (),
        altered=found.differences,
    )


def _refuse_links(table: Path) -> None:
    try:
        refuse_links(table.parent, table.name)
    except LinkError as error:
        raise ResultFileError(error.path, None, error.message) from None


def _examined(table: Path) -> Examined:
    try:
        return examine(table.parent, table.name)
    except (RecordSchemaError, LinkError) as error:
        line = None if isinstance(error, LinkError) else error.line
        raise ResultFileError(error.path, line, error.message) from None
    except OSError as error:
        raise unreadable(error, table) from None
    except ValueError as error:
        raise ResultFileError(table, None, str(error)) from None


def _refusal(found: Examined, does: str, *, without_table: bool = False) -> ResultFileError:
    """Say the first of the differences, what accepts it and, of one of the table, what mends it."""
    first, *others = found.differences
    more = f" (and {len(others)} more; tactstrip verify DIR names all)" if others else ""
    mended = all(one.mended_by == "export" for one in found.differences)
    if without_table and any(one.mended_by is None for one in found.differences):
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
    told : mapping of str to str
        What can be done about each that is as it was recorded.
    lost : mapping of str to tuple of str
        What is not as it was recorded in the others.
    """

    told: Mapping[str, str]
    lost: Mapping[str, tuple[str, ...]]


def left_out(sources: Sources, *, accept_altered: bool) -> LeftOut:
    """Look at the sessions without a table.

    Raises ResultFileError as `read_record`, and for a session of which no file is left, unless that
    is accepted.

    >>> from analysis.reading.sources import Sources
    >>> left_out(Sources(tables=()), accept_altered=False)
    LeftOut(told={}, lost={})
    """
    told, lost = {}, {}
    for table in sources.without:
        found = _examined(table.path)
        if found.differences and not accept_altered:
            raise _refusal(found, "leaves the session out", without_table=True)
        if found.differences:
            lost[_session(table)] = tuple(told_of(one, table.name) for one in found.differences)
        else:
            builds = "tactstrip export DIR builds it"
            told[_session(table)] = builds if found.history else "nothing was recorded in it"
    for table, difference in sources.lost:
        if not accept_altered:
            raise _not_accepted(
                difference,
                "; restore it from a copy; tactstrip analyze --accept-altered leaves "
                "the session out, with a mark",
            )
        lost[_session(table)] = (told_of(difference, table.name),)
    return LeftOut(told=told, lost=lost)


def _session(table: InputTable) -> str:
    return beside(table.name, "").removesuffix("/") or table.path.resolve().parent.name


def beside(name: str, file: str) -> str:
    """Return the name of a file beside another.

    >>> beside("sub-01/ses-01/trials.csv", "plan.json"), beside("trials.csv", "plan.json")
    ('sub-01/ses-01/plan.json', 'plan.json')
    """
    return name[: name.rfind("/") + 1] + file


def told_of(difference: Difference, name: str) -> str:
    """Return a difference as a line, its file told as that of the table is, by `name`.

    >>> from pathlib import Path
    >>> from experiment.integrity.sessions import Difference
    >>> folder = Path("results/sub-01/ses-01")
    >>> one = Difference(path=folder / "header.json", line=None, message="is missing")
    >>> told_of(one, "sub-01/ses-01/trials.csv")
    'sub-01/ses-01/header.json: is missing'
    """
    folder = beside(name, "")
    if difference.path.name == HEADS:
        folder = "".join(f"{part}/" for part in folder.split("/")[:-2])
    line = "" if difference.line is None else f":{difference.line}"
    return f"{folder}{difference.path.name}{line}: {difference.message}"


def _check_folder(plan: Plan, path: Path) -> None:
    """Refuse a plan in the folder ``sub-*/ses-*`` of another session."""
    session = path.parent.resolve()
    places = ((session.parent, "sub-", plan.participant), (session, "ses-", plan.session))
    for folder, prefix, name in places:
        if folder.name.startswith(prefix) and folder.name != prefix + name:
            message = f"the plan of {prefix}{name}, but the folder is {folder.name}"
            raise ResultFileError(path, None, message)


def told_rows(rows: pd.DataFrame) -> list[Any]:
    """Return typed rows as tuples with what `check_plan` and `progress` look at.

    >>> import pandas as pd
    >>> told_rows(pd.DataFrame([dict.fromkeys(_Row._fields, "01")]))[0].session
    '01'
    """
    return list(map(_Row._make, zip(*(rows[name].tolist() for name in _Row._fields), strict=True)))


def check_plan(told: Sequence[Any], file: str, plan: Plan) -> None:
    """Refuse the rows of one session where they contradict its plan.

    Rows come from `told_rows`; the level of a blank trial is NaN.

    Raises ResultFileError naming the first line that is of another participant, session or study,
    presents what was not planned, or has an answer that was not declared or came after the response
    window.

    >>> import pandas as pd
    >>> from types import SimpleNamespace
    >>> plan = SimpleNamespace(participant="01", session="01", trials=(), warm_up=(),
    ...     responses=("left",), response_window_s=2.0)
    >>> row = dict.fromkeys(_Row._fields, "02") | {"line": 2}
    >>> check_plan(told_rows(pd.DataFrame([row])), "trials.csv", plan)
    Traceback (most recent call last):
    analysis.reading.text.ResultFileError: trials.csv:2: column 'participant' is 02; it must be
    01 by the plan beside the table
    """
    trials = {trial.number: trial for trial in (*plan.trials, *plan.warm_up)}
    for row in told:
        for column, must in _breaches(row, trials.get(row.trial), plan):
            value = format_value(_known(getattr(row, column)))
            told = f"column '{column}' is {value}; it must be {must} by the plan beside the table"
            raise ResultFileError(file, row.line, told)


def _breaches(row: Any, trial: Trial | None, plan: Plan) -> Iterator[tuple[str, str]]:
    """Yield the columns in which a row breaks its plan, and what they must be."""
    for name in ("participant", "session", "study_sha256"):
        if getattr(row, name) != getattr(plan, name):
            yield name, getattr(plan, name)
    if trial is None:
        yield "trial", "the number of a planned trial"
    for name in _OF_TRIAL if trial else ():
        if _known(getattr(row, name)) != getattr(trial, name):
            yield name, f"{format_value(getattr(trial, name))} in trial {row.trial}"
    offered = plan.responses if trial is None else plan.answers_to(trial)
    allowed = (*offered, *_NEVER_DECLARED)
    if _known(row.response) not in {*allowed, None}:
        yield "response", f"one of {', '.join(allowed)}"
    if row.rt_s > plan.response_window_s:
        yield "rt_s", f"at most the response window, {plan.response_window_s:g},"


def _known(value: Any) -> Any:
    return None if value is None or value != value else value  # noqa: PLR0124 (NaN)


def progress(told: Sequence[Any], plan: Plan, ended: int) -> SessionProgress:
    """Count the planned trials that have a valid attempt; a journal tells how many `ended`.

    >>> from types import SimpleNamespace
    >>> trials = [SimpleNamespace(number=number) for number in (1, 2)]
    >>> plan = SimpleNamespace(participant="01", session="01", trials=trials, file_sha256="f",
    ...     study="{}", keys_set=())
    >>> told = [SimpleNamespace(trial=1, status="ok"), SimpleNamespace(trial=2, status="voided")]
    >>> progress(told, plan, 2)
    SessionProgress(participant='01', session='01', valid=1, planned=2, file_sha256='f',
    unexported=0, study='{}', keys_set=())
    """
    numbers = {trial.number for trial in plan.trials}
    return SessionProgress(
        participant=plan.participant,
        session=plan.session,
        valid=sum(row.status == "ok" and row.trial in numbers for row in told),
        planned=len(numbers),
        file_sha256=plan.file_sha256,
        unexported=max(0, ended - len(told)),
        study=plan.study,
        keys_set=plan.keys_set,
    )


def contacts(
    progress: Iterable[SessionProgress], sessions: Iterable[tuple[str, str]]
) -> dict[str, tuple[str, ...]]:
    """Tell by what is stated of force and contact of the fingers which sessions state it.

    The participants and sessions are those of the trials; without a plan nothing is stated.

    >>> contacts([], [("01", "01"), ("02", "01")])
    {'not stated': ('sub-01/ses-01', 'sub-02/ses-01')}
    """
    of_plan = {(one.participant, one.session): one.study for one in progress}
    words = {"": "not stated"}  # by the study's section: studies of a lab mostly differ elsewhere
    stated: dict[str, list[str]] = {}
    for participant, session in sessions:
        text = of_plan.get((participant, session))
        section = "" if text is None else json.dumps(json.loads(text).get("contact"))
        if text is not None and section not in words:
            words[section] = _contact(text)
        stated.setdefault(words[section], []).append(f"sub-{participant}/ses-{session}")
    return {told: tuple(which) for told, which in stated.items()}


def _contact(text: str) -> str:
    from experiment.study.base import StudyError
    from experiment.study.files import study_from_canonical

    try:
        return study_from_canonical(text).contact.summary
    except StudyError:
        return "not known, for this version cannot read the study"
