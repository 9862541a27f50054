"""The folders of a study: where a session's files lie, and how they come to be there."""

from __future__ import annotations

import contextlib
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from filelock import Timeout

from experiment.archive.disk import DISK, lock_on, make_folder
from experiment.archive.files import TEMPORARY, ArchiveError, check_identifier, write_atomically
from experiment.archive.history import replay
from experiment.archive.journal import (
    Journal,
    JournalError,
    JournalWriteError,
    read_journal,
)
from experiment.archive.participants import (
    NO_FACTS,
    Fact,
    check_facts,
    enter_person,
    read_people,
    refuse_withdrawn,
)
from experiment.study.read import study_from_canonical
from experiment.terms.record import trials_csv
from experiment.trial.plan import Plan, PlanError, plan_from_json

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from experiment.archive.disk import Disk
    from experiment.archive.history import History


@dataclass(frozen=True, slots=True)
class SessionFolder:
    """``ROOT/sub-<participant>/ses-<session>`` and the files in it.

    Attributes
    ----------
    root : Path
        The study's folder.
    participant, session : str
        Identifiers, 1 to 32 letters or digits.
    disk : Disk
        Where it is kept.
    facts : tuple of Fact
        What is known of the participant, for participants.tsv.
    """

    root: Path
    participant: str
    session: str
    disk: Disk = DISK
    facts: tuple[Fact, ...] = NO_FACTS

    def __post_init__(self) -> None:
        check_identifier("participant", self.participant)
        check_identifier("session", self.session)

    @property
    def path(self) -> Path:
        """The folder itself."""
        return self.root / f"sub-{self.participant}" / f"ses-{self.session}"

    @property
    def plan_path(self) -> Path:
        """The sealed plan."""
        return self.path / "plan.json"

    @property
    def journal_path(self) -> Path:
        """The journal."""
        return self.path / "journal.jsonl"

    @property
    def trials_path(self) -> Path:
        """The table of presented trials."""
        return self.path / "trials.csv"

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the session for this process alone.

        Raises
        ------
        ArchiveError
            If another process holds it.
        """
        make_folder(self.path, self.disk)
        lock = lock_on(self.path / ".lock")
        try:
            lock.acquire(blocking=False)
        except Timeout as error:
            raise ArchiveError(f"{self.path}: another process is running this session") from error
        try:
            for left_over in self.path.glob(f".*{TEMPORARY}"):
                left_over.unlink()
            yield
        finally:
            lock.release()

    def refuse_existing(self) -> None:
        """Refuse to begin a session that is there already.

        Raises
        ------
        ArchiveError
            If there is a plan or a journal, or the person withdrew.
        """
        refuse_withdrawn(self.root, self.participant)
        if self.plan_path.exists() or self.journal_path.exists():
            raise ArchiveError(
                f"{self.path}: this session exists already; nothing was changed. Go on with it by "
                "--resume, or give another --participant or --session"
            )

    def create(self, plan: Plan, header: dict[str, Any]) -> None:
        """Write header and plan of a new session and enter the participant in participants.tsv.

        The plan is written last: a session exists from the moment it has a plan.

        Raises
        ------
        ArchiveError
            If the session exists already, or a fact of the participant is not one that the study
            declares or differs from what is known.
        """
        self.refuse_existing()
        columns = study_from_canonical(plan.study).participants.columns
        check_facts(columns, self.facts)
        names = [column.name for column in columns]
        read_people(self.root).with_person(self.participant, names, self.facts)
        header_text = json.dumps(header, ensure_ascii=False, indent=1) + "\n"
        write_atomically(self.path / "header.json", header_text, disk=self.disk)
        enter_person(self.root, self.participant, columns, self.facts, disk=self.disk)
        write_atomically(self.plan_path, plan.to_json(), disk=self.disk)

    def read_plan(self) -> Plan:
        """Read and verify the plan.

        Raises
        ------
        ArchiveError
            If there is none, it belongs to another session, or the person withdrew.
        PlanError
            If it was changed after it was sealed.
        """
        refuse_withdrawn(self.root, self.participant)
        if not self.plan_path.exists():
            raise ArchiveError(f"{self.path}: there is no session to resume here")
        plan = _read_plan(self.plan_path)
        if (plan.participant, plan.session) != (self.participant, self.session):
            raise ArchiveError(
                f"{self.plan_path}: must be the plan of participant {self.participant}, session "
                f"{self.session}; got participant {plan.participant}, session {plan.session}"
            )
        return plan

    def open_journal(self, now_s: Callable[[], float]) -> Journal:
        """Open the journal for writing, at its end."""
        return Journal(self.journal_path, now_s=now_s, disk=self.disk)

    def read_history(self, plan: Plan) -> History:
        """Read the journal, none being an empty one, and return what it says.

        Raises
        ------
        JournalError
            If the journal cannot be trusted, belongs to another plan, or tells of fewer trials
            than trials.csv, which is built from it.
        """
        entries = read_journal(self.journal_path).entries if self.journal_path.exists() else ()
        try:
            history = replay(plan, entries)
        except JournalError as error:
            raise JournalError(f"{self.journal_path}: {error}") from error
        written = _rows_in(self.trials_path)
        if written > len(history.rows):
            raise JournalError(
                f"{self.journal_path}: must tell of at least the {written} trials of trials.csv; "
                f"got {len(history.rows)}; restore it from a copy: nothing was changed"
            )
        return history

    def write_trials(self) -> Path:
        """Build trials.csv anew from plan and journal, and return its path.

        Raises
        ------
        JournalWriteError
            If it cannot be written; the journal holds all of it.
        """
        history = self.read_history(self.read_plan())
        try:
            write_atomically(self.trials_path, trials_csv(history.rows), disk=self.disk)
        except OSError as error:
            raise JournalWriteError(
                f"{self.trials_path}: cannot be written ({error.strerror})"
            ) from error
        return self.trials_path


def _rows_in(table: Path) -> int:
    return max(0, table.read_bytes().count(b"\n") - 1) if table.exists() else 0


def _read_plan(path: Path) -> Plan:
    try:
        return plan_from_json(path.read_text(encoding="utf-8"))
    except (PlanError, UnicodeDecodeError) as error:
        raise PlanError(f"{path}: {error}") from error


def session_folders(root: Path) -> list[SessionFolder]:
    """List the sessions below a study's folder, by participant and session.

    Raises
    ------
    ArchiveError
        If there is none.
    """
    plans = sorted(root.glob("sub-*/ses-*/plan.json"))
    if not plans:
        raise ArchiveError(f"{root}: there is no session below this folder")
    return [
        SessionFolder(
            root,
            plan.parent.parent.name.removeprefix("sub-"),
            plan.parent.name.removeprefix("ses-"),
        )
        for plan in plans
    ]
