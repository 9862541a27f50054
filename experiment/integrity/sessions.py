"""A session's record as a whole: plan, header, journal, trials.csv and the head that was kept.

What is covered: the plan by its seal, plan and header as files by the journal's first line, each
journal line by the next one, the last by the head in sessions.tsv, trials.csv and measured.csv by
the journal.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from experiment.archive.files import HEADS, ArchiveError, refuse_link
from experiment.archive.history import replay
from experiment.archive.journal import (
    JournalError,
    JournalLineError,
    RecordSchemaError,
    read_ends,
    read_journal,
)
from experiment.integrity.heads import HeadError, in_place, kept_head, person_of
from experiment.integrity.table import table_differences
from experiment.rows import MeasuredRow, TrialRow
from experiment.trial.plan import Plan, PlanError, plan_from_json

if TYPE_CHECKING:
    from pathlib import Path

    from experiment.archive.history import History
    from experiment.archive.journal import JournalFile
    from experiment.integrity.heads import SessionHead


PLAN, HEADER, JOURNAL, TABLE = "plan.json", "header.json", "journal.jsonl", "trials.csv"
MEASURED: Final = "measured.csv"  # beside them where a monitor measured the bursts
FILES: Final = (PLAN, HEADER, JOURNAL, TABLE)
"""The files of a session that are its record."""
Mended: TypeAlias = Literal["export", "resume", "removal"]  # what puts a difference right


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Something in a record that is not as the session wrote it."""

    path: Path
    line: int | None  # counted from 1; none where a file as a whole is another one
    message: str
    mended_by: Mended | None = None

    @property
    def place(self) -> str:
        """File and line."""
        return f"{self.path}" if self.line is None else f"{self.path}:{self.line}"

    @property
    def hint(self) -> str:
        """What puts it right, where that is neither a copy nor an export."""
        return {"resume": _KILLED, "removal": "; remove it"}.get(self.mended_by or "", "")

    def __str__(self) -> str:
        """Name file and line first, as a compiler does."""
        return f"{self.place}: {self.message}{self.hint}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Examined:
    """What there is of a session's record, and what is amiss with it.

    Attributes
    ----------
    plan : Plan or None
        The plan, where there is a sealed one of this session.
    plan_file_sha256 : str
        Checksum of its bytes; empty without a file.
    history : History or None
        What the journal says, where journal and plan can be trusted.
    head_sha256 : str or None
        Hash of the journal's last line; none where it has none, or cannot be trusted.
    compared : bool
        Whether there is a journal, with which the table was compared.
    begun : bool
        Whether there is, or was, anything of it but what is made before a plan.
    ended : bool
        Whether the last line is the one whose hash was kept when a sitting ended.
    differences : tuple of Difference
        Empty where everything is as it was written.
    """

    plan: Plan | None
    plan_file_sha256: str
    history: History | None
    head_sha256: str | None
    compared: bool
    begun: bool
    ended: bool
    differences: tuple[Difference, ...]


def examine(folder: Path, table: str = TABLE) -> Examined:
    """Verify the files of a session against each other, without changing or locking them.

    Parameters
    ----------
    folder : Path
        ``sub-<participant>/ses-<session>``.
    table : str
        Name of the table in the folder. A copy under another name is compared as trials.csv is.

    Returns
    -------
    Examined
        ``plan`` and ``history``: the plan and the contents of the journal, None where a file cannot
        be trusted; ``differences``: every modification, with its file and line, empty if the
        session is as it was recorded.

    Raises
    ------
    RecordSchemaError
        If the session is of another version of this program.
    LinkError
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
    return _Examiner(folder, table).examined()


def unaltered(folder: Path, table: str = TABLE) -> Examined | None:
    """Find by checksums alone that a session is as it was recorded; None where `examine` has to.

    The head that was kept seals the journal, the journal's first line plan and header, its last one
    the table. The trials in the journal are not read, so that there is no history. Raises as
    `examine`.
    """
    refuse_links(folder, table)
    return _Examiner(folder, table).unaltered()


def refuse_links(folder: Path, table: str = TABLE) -> None:
    """Refuse a session of which a file, the folder or the person's is a symbolic link.

    LinkError for the first.
    """
    person = person_of(folder)
    if "sub-" in {person.name[:4], person.resolve().name[:4]}:
        refuse_link(person)
    for path in (folder, *(folder / name for name in (*FILES, MEASURED, table))):
        refuse_link(path)


class _Examiner:
    """One session, read once."""

    def __init__(self, folder: Path, table: str) -> None:
        self._folder = folder
        self._table_name = table
        self._found: list[Difference] = []
        self._bytes = {
            name: (folder / name).read_bytes() if (folder / name).is_file() else None
            for name in (PLAN, HEADER, MEASURED, table)
        }

    def _sha256(self, name: str) -> str:
        raw = self._bytes[name]
        return "" if raw is None else hashlib.sha256(raw).hexdigest()

    def _note(
        self, name: str, line: int | None, message: str, mended_by: Mended | None = None
    ) -> None:
        path = (person_of(self._folder) if name == HEADS else self._folder) / name
        self._found.append(Difference(path=path, line=line, message=message, mended_by=mended_by))

    def unaltered(self) -> Examined | None:
        kept, path = self._head(), self._folder / JOURNAL
        try:
            ends = read_ends(path) if path.is_file() else None
        except JournalError:
            return None
        if ends is None or kept is None or ends.head_sha256 != kept.head_sha256:
            return None
        first, last = ends.first.facts, ends.last.facts
        sealed = {
            PLAN: first.get("plan_file_sha256"),
            HEADER: first.get("header_sha256"),
            self._table_name: last.get("trials_sha256"),
            MEASURED: last.get("measured_sha256", ""),  # none where nothing was measured
        }
        if any(self._sha256(name) != sha256 for name, sha256 in sealed.items()):
            return None
        plan = self._plan(known=True)
        if plan is None or self._found or plan.sha256 != first.get("plan_sha256"):
            return None
        return self._of(plan, ended=True, begun=True, head_sha256=kept.head_sha256)

    def examined(self) -> Examined:
        journal = self._journal()
        plan = self._plan()
        opening = journal.entries[0].facts if journal and journal.entries else {}
        sound = self._seals(plan, opening)
        history = self._history(plan, journal) if plan and journal and sound else None
        kept = self._head()
        registered = self._registered(journal, kept) if journal else None
        begun = kept is not None or self._begun()
        if begun and not (self._folder / JOURNAL).is_file():
            self._journal_missing(kept)
        ended = journal is not None and 0 < len(journal.entries) == registered
        if history and history.finished and journal and journal.torn and ended:
            told = f"{len(journal.torn)} bytes follow the line that ended the session"
            self._note(JOURNAL, len(journal.entries) + 1, told)
        if history and journal:
            events = [entry.event for entry in journal.entries[:registered]]
            self._table(history, events, kept if registered else None)
        elif begun and self._bytes[self._table_name] is None:
            self._note(self._table_name, None, f"is missing, too, and cannot be built {_WITHOUT}")
        head_sha256 = journal.sha256[-1] if journal and journal.entries else None
        return self._of(plan, history, begun=begun, ended=ended, head_sha256=head_sha256)

    def _of(
        self,
        plan: Plan | None,
        history: History | None = None,
        *,
        begun: bool,
        ended: bool,
        head_sha256: str | None,
    ) -> Examined:
        return Examined(
            plan=plan,
            plan_file_sha256=self._sha256(PLAN),
            history=history,
            head_sha256=head_sha256,
            compared=(self._folder / JOURNAL).is_file(),
            begun=begun,
            ended=ended,
            differences=tuple(self._found),
        )

    def _begun(self) -> bool:
        """Tell whether a file is left of a session that began: its journal was made before them."""
        journal = self._folder / JOURNAL
        if journal.is_file() and journal.stat().st_size:
            return True
        there = {name for name, raw in self._bytes.items() if raw is not None}
        return bool(there - {HEADER} if journal.is_file() else there)

    def _journal_missing(self, kept: SessionHead | None) -> None:
        if kept is not None:
            self._found.append(_removed(self._folder, kept))
        elif not self._found:
            with_it = "the table cannot be compared with it"
            without = "nothing tells of the session's trials"
            told = without if self._bytes[self._table_name] is None else with_it
            self._note(JOURNAL, None, f"is missing: {told}")

    def _journal(self) -> JournalFile | None:
        path = self._folder / JOURNAL
        if not path.is_file():
            return None
        try:
            return read_journal(path)
        except RecordSchemaError:
            raise
        except JournalLineError as error:
            self._note(JOURNAL, error.line, error.message)
            return None

    def _plan(self, *, known: bool = False) -> Plan | None:
        raw = self._bytes[PLAN]
        if raw is None:
            if (self._folder / JOURNAL).is_file() and (self._folder / JOURNAL).stat().st_size:
                self._note(PLAN, None, "is missing")
            return None
        try:
            plan = plan_from_json(raw.decode(), known=known)
        except (PlanError, UnicodeDecodeError) as error:
            self._note(PLAN, None, str(error))
            return None
        place = self._folder.resolve()
        for prefix, must, name in (
            ("sub-", plan.participant, place.parent.name),
            ("ses-", plan.session, place.name),
        ):
            if name.startswith(prefix) and name != prefix + must:
                self._note(PLAN, None, f"is the plan of {prefix}{must}, but the folder is {name}")
        return plan

    def _seals(self, plan: Plan | None, opening: object) -> bool:
        """Compare plan and header with the journal's first line; whether it is of this plan."""
        if not isinstance(opening, dict) or not opening:
            return plan is not None
        sealed = opening.get("plan_sha256")
        own = plan is None or plan.sha256 == sealed
        if not own:
            self._note(PLAN, None, f"is sealed anew: {_other(plan and plan.sha256, sealed)}")
        for name, key in ((PLAN, "plan_file_sha256"), (HEADER, "header_sha256")):
            if self._bytes[name] is None:
                if name == HEADER:
                    self._note(HEADER, None, "is missing")
                continue
            sha256 = self._sha256(name)
            already = any(one.path.name == name for one in self._found)
            if sha256 != opening.get(key) and not already:
                told = _other(sha256, opening.get(key))
                self._note(name, None, f"is not the file that the session was begun with: {told}")
        return own

    def _history(self, plan: Plan, journal: JournalFile) -> History | None:
        try:
            return replay(plan, journal.entries)
        except JournalError as error:
            self._note(JOURNAL, None, str(error))
            return None

    def _head(self) -> SessionHead | None:
        try:
            return kept_head(self._folder)
        except HeadError as error:
            self._note(HEADS, error.line, error.message)
            return None

    def _registered(self, journal: JournalFile, kept: SessionHead | None) -> int:
        """Return how many lines the journal had when its head was kept; note where that differs."""
        entries = journal.entries
        closed = bool(entries) and entries[-1].event == "session_close"
        if kept is None:
            # A process killed between its last line and this one leaves none: only a resume, which
            # somebody asks for, may take a journal's word for its own end.
            if (
                closed
                and in_place(self._folder)
                and not any(one.path.name == HEADS for one in self._found)
            ):
                self._note(HEADS, None, _NO_HEAD, "resume")
            return 0
        if kept.head_sha256 not in journal.sha256:
            torn = "; its last line is cut short" if journal.torn else ""
            self._note(
                HEADS,
                kept.line,
                f"head_sha256 {kept.head_sha256[:12]}... is of no line of {JOURNAL}, which was "
                f"changed or cut since{torn}",
            )
            return 0
        lines = journal.sha256.index(kept.head_sha256) + 1
        if lines < len(entries) and entries[lines].event != "session_resume":
            self._note(JOURNAL, lines + 1, "was added after the session had ended")
        elif lines < len(entries) and closed:
            message = f"the last line of {JOURNAL} is another one than head_sha256 tells of"
            self._note(HEADS, kept.line, message, "resume")
        return lines

    def _table(self, history: History, told: list[str], kept: SessionHead | None) -> None:
        for name, kind, rows, event in (
            (self._table_name, TrialRow, history.rows, "trial_end"),
            (MEASURED, MeasuredRow, history.measured, "stimulus_measured"),
        ):
            raw, least = self._bytes[name], told.count(event)
            if raw is None and kept and (least or kind is TrialRow):
                self._note(name, None, _missing(kept), "export")
            if name == MEASURED and raw is not None and not rows:
                self._note(name, None, "is there, though nothing was measured", "removal")
                continue
            mended_by: Mended | None = "export" if name in {TABLE, MEASURED} else None
            for line, message in table_differences(raw, kind, rows, least=least):
                self._note(name, line, message, mended_by)


_WITHOUT = f"without {PLAN} and {JOURNAL} as they were recorded"
_NO_HEAD = "has no line of this session, whose journal has ended"
_KILLED = "; where the session was killed in that moment, tactstrip run --resume puts it right"


def _other(found: object, must: object) -> str:
    return f"sha256 {str(found)[:12]}..., line 1 of {JOURNAL} has {str(must)[:12]}..."


def _removed(folder: Path, kept: SessionHead) -> Difference:
    return Difference(path=folder / JOURNAL, line=None, message=_missing(kept))


def _missing(kept: SessionHead) -> str:
    return f"is missing; line {kept.line} of {HEADS} tells of it"


def removed_journal(folder: Path) -> tuple[Difference, ...]:
    """Tell of a journal that is missing though a head of it was kept; no other file is read."""
    try:
        kept = None if (folder / JOURNAL).is_file() else kept_head(folder)
    except ArchiveError:  # `examine` tells
        return ()
    return () if kept is None else (_removed(folder, kept),)


def refuse_altered(folder: Path) -> tuple[Difference, ...]:
    """Refuse a session whose record is not as it was written; return what a command mends.

    ArchiveError for the first difference that the journal cannot put right.
    """
    differences = examine(folder).differences
    for difference in differences:
        if difference.mended_by in {None, "removal"}:
            copy = "" if difference.mended_by else "; restore it from a copy"
            raise ArchiveError(f"{difference}{copy}: nothing was changed")
    return differences
