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

from experiment.journal import Journal, read_journal, sync_folder
from experiment.plan import Plan, PlanError, plan_from_json
from experiment.record import trials_csv
from experiment.replay import replay

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_IDENTIFIER = re.compile(r"[A-Za-z0-9]{1,32}")


class ArchiveError(ValueError):
    """A session's folder that is there and must not be, or the other way round."""


def check_identifier(name: str, value: str) -> str:
    """Return a participant's or session's identifier.

    Raises
    ------
    ArchiveError
        Unless it consists of 1 to 32 letters a-z, A-Z and digits.
    """
    if not _IDENTIFIER.fullmatch(value):
        raise ArchiveError(f"{name} must be 1 to 32 letters (a-z, A-Z) or digits; got {value!r}")
    return value


def write_atomically(path: Path, text: str, *, durable: bool = True) -> None:
    """Write a file so that it is either there as a whole or as it was before.

    Raises
    ------
    OSError
        If it cannot be written; the former file, if any, is unchanged then.
    """
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
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
    if durable:
        sync_folder(path.parent)


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
        header_text = json.dumps(header, ensure_ascii=False, indent=1) + "\n"
        write_atomically(self.path / "header.json", header_text, durable=self.durable)
        _enter_participant(self.root, self.participant, durable=self.durable)
        write_atomically(self.plan_path, plan.to_json(), durable=self.durable)

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

    def write_trials(self) -> Path:
        """Build trials.csv anew from plan and journal, and return its path."""
        history = replay(self.read_plan(), read_journal(self.journal_path).entries)
        path = self.path / "trials.csv"
        write_atomically(path, trials_csv(history.rows), durable=self.durable)
        return path


def _read_plan(path: Path) -> Plan:
    try:
        return plan_from_json(path.read_text(encoding="utf-8"))
    except (PlanError, UnicodeDecodeError) as error:
        raise PlanError(f"{path}: {error}") from error


def _enter_participant(root: Path, participant: str, *, durable: bool) -> None:
    path = root / "participants.tsv"
    with FileLock(root / ".participants.lock"):
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        lines = lines or ["participant_id"]
        name = f"sub-{participant}"
        if name not in (line.split("\t")[0] for line in lines):
            write_atomically(path, "\n".join([*lines, name]) + "\n", durable=durable)


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
