"""Verify a session: its plan, header, journal and tables against each other and sessions.tsv.

What is covered: the plan by its seal, plan and header as files by the journal's first line, each
journal line by the next one, the last by its hash in sessions.tsv, trials.csv and measured.csv by
the journal.
"""

from __future__ import annotations

import contextlib
import hashlib
from itertools import zip_longest
from typing import TYPE_CHECKING, Final

from experiment.record.entries import SessionOpened, measured_csv
from experiment.record.files import (
    HEADER,
    JOURNAL,
    MEASURED,
    PLAN,
    SESSIONS_TABLE,
    TABLE,
    ArchiveError,
    person_of,
    refuse_links,
)
from experiment.record.history import replay
from experiment.record.index import Difference, SessionIndexError, find_seal, is_named_session
from experiment.record.journal import (
    JournalError,
    JournalLineError,
    RecordSchemaError,
    read_journal,
)
from experiment.record.rows import trials_csv
from experiment.trial.plan import Plan, PlanError, plan_from_json

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from experiment.record.history import History
    from experiment.record.index import Remedy, SessionSeal
    from experiment.record.journal import JournalFile


def examine(folder: Path, table: str = TABLE) -> Verification:
    """Verify the files of a session against each other, without changing or locking them.

    Parameters
    ----------
    folder : Path
        ``sub-<participant>/ses-<session>``.
    table : str
        Name of the table in the folder. A copy under another name is compared as trials.csv is.

    Returns
    -------
    Verification
        ``plan`` and ``history``: the plan and the contents of the journal, None where a file cannot
        be trusted; ``differences``: every modification, with its file and line, empty if the
        session is as it was recorded.

    Raises
    ------
    RecordSchemaError
        If the session is of another version of this program.
    SymlinkError
        If a file, the folder or the person's is a symbolic link.
    OSError
        If a file cannot be read.

    Examples
    --------
    A cell that was edited in trials.csv differs from the journal:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from experiment import paper_study, simulate_study
    >>> study = paper_study().changed(design={"trials_per_side": 5, "both_trials": 0},
    ...                               simulation={"threshold_vpp": 100.0})
    >>> with TemporaryDirectory() as results:
    ...     session, = simulate_study(study, Path(results), participants=1, seed=7, gains=())
    ...     recorded = examine(session.path).differences
    ...     table = session.trials_path.read_bytes().replace(b",left,", b",right,", 1)
    ...     _ = session.trials_path.write_bytes(table)
    ...     modified = examine(session.path).differences
    >>> recorded, [(difference.path.name, difference.line) for difference in modified]
    ((), [('trials.csv', 2)])
    """
    refuse_links(folder, table)
    return Verification(folder, table)


class Verification:
    """What there is of a session's record, and what is amiss with it.

    Attributes
    ----------
    folder : Path
        The session's folder.
    table : str
        Name of its table.
    files : dict of str to bytes or None
        What plan, header and tables hold, by name.
    journal : JournalFile or None
        The journal, where each of its lines is as it was written.
    plan : Plan or None
        The plan, where there is a sealed one of this session.
    plan_file_sha256 : str
        Checksum of its bytes; empty without a file.
    seal : SessionSeal or None
        The line of sessions.tsv of the session.
    history : History or None
        What the journal says, where journal and plan can be trusted.
    differences : tuple of Difference
        Empty where everything is as it was written.
    """

    def __init__(self, folder: Path, table: str) -> None:
        self.folder, self.table = folder, table
        self.files = {
            name: (folder / name).read_bytes() if (folder / name).is_file() else None
            for name in (PLAN, HEADER, MEASURED, table)
        }
        self.journal: JournalFile | None = None
        self.plan: Plan | None = None
        self.seal: SessionSeal | None = None
        self.history: History | None = None
        self.errors: list[Difference] = []
        path, plan = folder / JOURNAL, self.files[PLAN]
        self.plan_file_sha256 = "" if plan is None else _sha256(plan)
        self.has_journal = path.is_file()
        self.has_lines = self.has_journal and path.stat().st_size > 0
        with self._noting_errors(JOURNAL):
            self.journal = read_journal(path) if self.has_journal else None
        with self._noting_errors(PLAN):
            self.plan = None if plan is None else plan_from_json(plan.decode())
        with self._noting_errors(SESSIONS_TABLE):
            self.seal = find_seal(folder)
        entries = self.journal.entries if self.journal else ()
        self.events = [entry.event for entry in entries]
        first = entries[0].line if entries else None
        self.opening = first if isinstance(first, SessionOpened) else None
        with self._noting_errors(JOURNAL):
            if self.journal and self.plan and self.has_sealed_plan:
                self.history = replay(self.plan, entries)
        self.differences = (*self.errors, *(d for check in _CHECKS for d in check(self)))

    @contextlib.contextmanager
    def _noting_errors(self, name: str) -> Iterator[None]:
        try:
            yield
        except RecordSchemaError:
            raise
        except (JournalLineError, SessionIndexError) as error:
            self.errors.append(self.difference(name, error.line, error.message))
        except (JournalError, PlanError, UnicodeDecodeError) as error:
            self.errors.append(self.difference(name, None, str(error)))

    def difference(
        self, name: str, line: int | None, message: str, remedy: Remedy | None = None
    ) -> Difference:
        """Return a difference in a file of the session, or in sessions.tsv."""
        folder = person_of(self.folder) if name == SESSIONS_TABLE else self.folder
        return Difference(path=folder / name, line=line, message=message, remedy=remedy)

    @property
    def has_sealed_plan(self) -> bool:
        """Whether the plan is the one that the journal's first line names, if there is a line."""
        if self.opening is None:
            return True
        return self.plan is not None and self.plan.sha256 == self.opening.plan_sha256

    @property
    def head_sha256(self) -> str | None:
        """Hash of the journal's last line; none where it has none, or cannot be trusted."""
        return self.journal.sha256[-1] if self.journal and self.journal.sha256 else None

    @property
    def ended(self) -> bool:
        """Whether the last line is the one whose hash was kept when a visit ended."""
        return 0 < len(self.events) == self.n_sealed

    @property
    def begun(self) -> bool:
        """Whether anything is left of a session that began: its journal was made first."""
        left = {name for name, raw in self.files.items() if raw is not None}
        started = left - {HEADER} if self.has_journal else left
        return self.seal is not None or self.has_lines or bool(started)

    @property
    def n_sealed(self) -> int:
        """How many lines the journal had when its hash was kept; 0 where no line has that hash."""
        if self.journal is None or self.seal is None:
            return 0
        hashes = [None, *self.journal.sha256]
        return hashes.index(self.seal.head_sha256) if self.seal.head_sha256 in hashes else 0


def _check_plan(record: Verification) -> Iterator[Difference]:
    if record.files[PLAN] is None and record.has_lines:
        yield record.difference(PLAN, None, "is missing")
    if record.plan is None:
        return
    path = record.folder.resolve()
    person, session = f"sub-{record.plan.participant}", f"ses-{record.plan.session}"
    for folder, name in ((path.parent, person), (path, session)):
        if folder.name.startswith(name[:4]) and folder.name != name:
            message = f"is the plan of {name}, but the folder is {folder.name}"
            yield record.difference(PLAN, None, message)


def _check_files(record: Verification) -> Iterator[Difference]:
    """Compare plan and header with the checksums in the journal's first line."""
    opening = record.opening
    if opening is None:
        return
    seals: list[tuple[str, str, str]] = []
    if record.plan and record.has_sealed_plan:
        seals.append((PLAN, record.plan_file_sha256, opening.plan_file_sha256))
    elif record.plan:
        seals.append((PLAN, record.plan.sha256, opening.plan_sha256))
    header = record.files[HEADER]
    if header is None:
        yield record.difference(HEADER, None, "is missing")
    else:
        seals.append((HEADER, _sha256(header), opening.header_sha256))
    for name, actual, sealed in seals:
        if actual != sealed:
            message = (
                f"is not the one that the session began with: sha256 {actual[:12]}..., line 1 of "
                f"{JOURNAL} has {sealed[:12]}..."
            )
            yield record.difference(name, None, message)


def _check_journal(record: Verification) -> Iterator[Difference]:
    if record.begun and not record.has_journal:
        message = "is missing: no table can be compared with it"
        message = _missing(record.seal) if record.seal else message
        yield record.difference(JOURNAL, None, message)
    torn = record.journal.torn if record.journal else b""
    if torn and record.history and record.history.finished and record.ended:
        message = f"{len(torn)} bytes follow the line that ended the session"
        yield record.difference(JOURNAL, len(record.events) + 1, message)


def _check_seal(record: Verification) -> Iterator[Difference]:
    """Compare the journal with the hash of its last line that was kept in sessions.tsv."""
    journal, seal, n_sealed = record.journal, record.seal, record.n_sealed
    if journal is None:
        return
    later = record.events[n_sealed:]
    closed = record.events[-1:] == ["session_close"]
    if seal is None:
        # A process killed between its last line and this one leaves none: only a resume, which
        # somebody asks for, may take a journal's word for its own end.
        unreadable = {error.path.name for error in record.errors}
        if closed and is_named_session(record.folder) and SESSIONS_TABLE not in unreadable:
            yield record.difference(SESSIONS_TABLE, None, _NO_SEAL, "resume")
    elif not n_sealed:
        torn = "; its last line is cut short" if journal.torn else ""
        message = (
            f"head_sha256 {seal.head_sha256[:12]}... is of no line of {JOURNAL}, which was "
            f"changed or cut since{torn}"
        )
        yield record.difference(SESSIONS_TABLE, seal.line, message)
    elif later and later[0] != "session_resume":
        yield record.difference(JOURNAL, n_sealed + 1, "was added after the session had ended")
    elif later and closed:
        message = f"head_sha256 is not the hash of the last line of {JOURNAL}"
        yield record.difference(SESSIONS_TABLE, seal.line, message, "resume")


def _check_tables(record: Verification) -> Iterator[Difference]:
    """Compare the tables with those that the journal gives.

    A session that was cut off wrote its tables before: the rows of the lines that are sealed have
    to be there, and those that are there have to be the first ones.
    """
    history = record.history
    if history is None:
        if record.begun and record.files[record.table] is None:
            yield record.difference(record.table, None, f"is missing, too, {_WITHOUT}")
        return
    assert record.plan is not None  # by which the journal was replayed
    sealed = record.events[: record.n_sealed]
    trials = trials_csv(record.plan.task, history.rows)
    measured = measured_csv(record.plan.task.sites, history.measured)
    for name, text, rows, event in (
        (record.table, trials, history.rows, "trial_end"),
        (MEASURED, measured, history.measured, "stimulus_measured"),
    ):
        actual, recorded = record.files[name], text.encode()
        n_rows = sealed.count(event)
        if actual is None:
            if record.seal and sealed and (n_rows or name != MEASURED):
                yield record.difference(name, None, _missing(record.seal), "export")
        elif name == MEASURED and not rows:
            message = "is there, though nothing was measured"
            yield record.difference(name, None, message, "removal")
        elif difference := first_difference(actual, recorded, min_rows=n_rows):
            remedy: Remedy | None = "export" if name in {TABLE, MEASURED} else None
            yield record.difference(name, *difference, remedy)


def first_difference(actual: bytes, recorded: bytes, *, min_rows: int) -> tuple[int, str] | None:
    r"""Return the first line in which a table differs, and how; at least so many rows are due.

    >>> first_difference(b"trial,side\n1,left\n", b"trial,side\n1,both\n", min_rows=1)
    (2, "column 'side' is 'left'; by the journal it is 'both'")
    >>> first_difference(b"trial,side\n", b"trial,side\n1,both\n", min_rows=0)
    """
    is_beginning = actual.endswith(b"\n") and recorded.startswith(actual)
    if actual == recorded or (is_beginning and actual.count(b"\n") > min_rows):
        return None
    lines = enumerate(zip_longest(actual.split(b"\n"), recorded.split(b"\n")), 1)
    number, (line, expected) = next((n, pair) for n, pair in lines if pair[0] != pair[1])
    names, cells, expected_cells = (
        (raw or b"").decode(errors="backslashreplace").split(",")
        for raw in (recorded.split(b"\n")[0], line, expected)
    )
    if number > 1 and len(cells) == len(names) == len(expected_cells):
        name, cell, expected_cell = next(
            row for row in zip(names, cells, expected_cells, strict=True) if row[1] != row[2]
        )
        return number, f"column '{name}' is {cell!r}; by the journal it is {expected_cell!r}"
    return number, "is not the line that the journal gives"


_CHECKS: Final = (_check_plan, _check_files, _check_journal, _check_seal, _check_tables)


_WITHOUT = f"and cannot be built without {PLAN} and {JOURNAL} as they were recorded"
_NO_SEAL = "has no line of this session, whose journal has ended"


def _sha256(raw: bytes) -> str:
    return hashlib.sha256(raw).hexdigest()


def _missing(seal: SessionSeal) -> str:
    return f"is missing; line {seal.line} of {SESSIONS_TABLE} tells of it"


def refuse_modified(folder: Path, *, rebuilds_tables: bool = False) -> tuple[Difference, ...]:
    """Refuse a session whose record is not as it was written; return what a command mends.

    ArchiveError for the first difference that the journal cannot put right, and for an edited table
    unless the command rebuilds it on purpose: what was edited cannot be seen later.
    """
    differences = examine(folder).differences
    for difference in differences:
        is_edited = difference.remedy == "export" and difference.line is not None
        if difference.remedy is None:
            hint = "; restore it from a copy"
        elif is_edited and not rebuilds_tables:
            hint = "; tactstrip export DIR rebuilds it from the journal"
        elif difference.remedy == "removal":
            hint = ""
        else:
            continue
        raise ArchiveError(f"{difference}{hint}: nothing was changed")
    return differences
