"""The folders of a study: where a session's files lie, and how they come to be there."""

from __future__ import annotations

import contextlib
import json
import os
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from filelock import FileLock, Timeout

from experiment.journal import (
    Journal,
    JournalError,
    JournalWriteError,
    read_journal,
    sync_folder,
)
from experiment.plan import Plan, PlanError, plan_from_json
from experiment.record import NOT_AVAILABLE, trials_csv
from experiment.replay import replay

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from experiment.replay import History

_TEMPORARY = ".tmp"
_TOTALS = "all"
"""What the analysis calls its rows of totals: nobody's name."""
_IDENTIFIER = re.compile(r"[A-Za-z0-9]{1,32}")


class ArchiveError(ValueError):
    """A session's folder that is there and must not be, or the other way round."""


def check_identifier(name: str, value: str) -> str:
    """Return a participant's or session's identifier.

    Raises
    ------
    ArchiveError
        Unless it consists of 1 to 32 letters a-z, A-Z and digits, and is not ``all``.
    """
    if not _IDENTIFIER.fullmatch(value) or value == _TOTALS:
        raise ArchiveError(
            f"{name} must be 1 to 32 letters (a-z, A-Z) or digits, and not {_TOTALS!r}; "
            f"got {value!r}"
        )
    return value


def write_atomically(path: Path, text: str, *, durable: bool = True) -> None:
    """Write a file so that it is either there as a whole or as it was before.

    Raises
    ------
    OSError
        If it cannot be written; the former file, if any, is unchanged then.
    """
    try:
        _write_and_replace(path, text, durable=durable)
    except OSError as error:
        error.filename = str(path)
        raise
    if durable:
        sync_folder(path.parent)


def _write_and_replace(path: Path, text: str, *, durable: bool) -> None:
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=_TEMPORARY, dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


@dataclass(frozen=True, slots=True)
class SessionFolder:
    """``ROOT/sub-<participant>/ses-<session>`` and the files in it.

    Attributes
    ----------
    root : Path
        The study's folder.
    participant, session : str
        Identifiers, 1 to 32 letters or digits.
    durable : bool
        Whether files are on the disk when a method returns; a simulation has nothing to lose.
    """

    root: Path
    participant: str
    session: str
    durable: bool = True

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
        self.path.mkdir(parents=True, exist_ok=True)
        lock = FileLock(self.path / ".lock")
        try:
            lock.acquire(blocking=False)
        except Timeout as error:
            raise ArchiveError(f"{self.path}: another process is running this session") from error
        try:
            for left_over in self.path.glob(f".*{_TEMPORARY}"):
                left_over.unlink()
            yield
        finally:
            lock.release()

    def refuse_existing(self) -> None:
        """Refuse to begin a session that is there already.

        Raises
        ------
        ArchiveError
            If there is a plan or a journal.
        """
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
            If the session exists already.
        """
        self.refuse_existing()
        _read_participants(self.root)
        header_text = json.dumps(header, ensure_ascii=False, indent=1) + "\n"
        write_atomically(self.path / "header.json", header_text, durable=self.durable)
        _enter_participant(self.root, self.participant, durable=self.durable)
        write_atomically(self.plan_path, plan.to_json(), durable=self.durable)
        if self.durable:
            sync_folder(self.path.parent)
            sync_folder(self.root)

    def read_plan(self) -> Plan:
        """Read and verify the plan.

        Raises
        ------
        ArchiveError
            If there is none, or it belongs to another session.
        PlanError
            If it was changed after it was sealed.
        """
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
        return Journal(self.journal_path, now_s=now_s, durable=self.durable)

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
            write_atomically(self.trials_path, trials_csv(history.rows), durable=self.durable)
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


def _read_participants(root: Path) -> list[list[str]]:
    """Return the cells of participants.tsv, at least its heading."""
    path = root / "participants.tsv"
    if not path.exists():
        return [["participant_id"]]
    try:
        table = [line.split("\t") for line in path.read_text(encoding="utf-8").splitlines()]
    except UnicodeDecodeError as error:
        raise ArchiveError(f"{path}: must be UTF-8; got {error}") from error
    if not table or table[0][0] != "participant_id":
        raise ArchiveError(f"{path}:1: the first column must be participant_id")
    return table


def _enter_participant(root: Path, participant: str, *, durable: bool) -> None:
    with FileLock(root / ".participants.lock"):
        table = _read_participants(root)
        name = f"sub-{participant}"
        if name in (row[0] for row in table):
            return
        table.append([name, *[NOT_AVAILABLE] * (len(table[0]) - 1)])
        text = "".join("\t".join(row) + "\n" for row in table)
        write_atomically(root / "participants.tsv", text, durable=durable)


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
