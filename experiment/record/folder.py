"""The folders of a study: where a session's files lie, and how they come to be there."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field
from hashlib import sha256
from typing import TYPE_CHECKING

from pydantic import ValidationError

from experiment.record.entries import Header, measured_csv
from experiment.record.files import (
    DISK,
    HEADER,
    JOURNAL,
    LOCK,
    MEASURED,
    PLAN,
    RUNNING,
    TABLE,
    WITHDRAWN_FOLDER,
    ArchiveError,
    check_identifier,
    locked,
    make_folder,
    refuse_links,
    remove_left_overs,
    write_atomically,
    write_new,
)
from experiment.record.history import replay
from experiment.record.journal import Journal, JournalError, JournalWriteError, read_journal
from experiment.record.people import enter_person, next_number, read_people, refuse_withdrawn
from experiment.record.rows import trials_csv
from experiment.study.base import Fault, StudyError, first_fault
from experiment.study.files import study_from_canonical
from experiment.trial.plan import Plan, PlanError, plan_from_json

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from experiment.record.files import Disk
    from experiment.record.history import History
    from experiment.study.study import Study


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
    values : mapping of str to str
        Values of the participant, by the columns of participants.tsv.

    Raises
    ------
    ArchiveError
        If `participant` or `session` is not an identifier.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from experiment import paper_study, simulate_study
    >>> study = paper_study().changed(design={"trials_per_side": 5, "both_trials": 0},
    ...                               simulation={"threshold_vpp": 100.0})
    >>> with TemporaryDirectory() as results:
    ...     folder, = simulate_study(study, Path(results), participants=1, seed=7, gains=())
    ...     plan, header = folder.read_plan(), folder.read_header()
    >>> folder.name, len(plan.trials), header.device_kind
    ('sub-01/ses-01', 10, 'mock')
    """

    root: Path
    participant: str
    session: str
    disk: Disk = DISK
    values: Mapping[str, str] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        check_identifier("participant", self.participant)
        check_identifier("session", self.session)

    @property
    def path(self) -> Path:
        """The folder itself."""
        return self.root / f"sub-{self.participant}" / f"ses-{self.session}"

    @property
    def name(self) -> str:
        """What the session is called."""
        return f"sub-{self.participant}/ses-{self.session}"

    @property
    def plan_path(self) -> Path:
        """The sealed plan."""
        return self.path / PLAN

    @property
    def journal_path(self) -> Path:
        """The journal."""
        return self.path / JOURNAL

    @property
    def trials_path(self) -> Path:
        """The table of presented trials."""
        return self.path / TABLE

    @property
    def measured_path(self) -> Path:
        """The table of what a monitor measured, where there was one."""
        return self.path / MEASURED

    @property
    def header_path(self) -> Path:
        """What is worth knowing of the session and is not part of the plan."""
        return self.path / HEADER

    def sealed(self) -> dict[str, str]:
        """Return the checksums of header and plan as files, for the journal's first line.

        Returns
        -------
        dict of str to str
            ``header_sha256`` and ``plan_file_sha256``: the SHA-256 of each file, 64 hexadecimal
            digits.
        """
        files = {"header_sha256": self.header_path, "plan_file_sha256": self.plan_path}
        return {name: sha256(path.read_bytes()).hexdigest() for name, path in files.items()}

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the session for this process.

        Yields
        ------
        None
            The process holds the lock until the ``with`` block ends.

        Raises
        ------
        ArchiveError
            If another process holds the lock, or a file or folder of the session is a symbolic
            link.
        LockError
            If the drive does not support file locks.
        """
        refuse_links(self.path)
        made = [folder for folder in (self.path, *self.path.parents) if not folder.exists()]
        with contextlib.ExitStack() as held:
            held.callback(_remove_empty, made)
            make_folder(self.path, self.disk)
            held.enter_context(locked(self.path / LOCK, RUNNING))
            held.callback(_remove_unused_lock, made)
            remove_left_overs(self.path)
            yield

    def refuse_existing(self) -> None:
        """Refuse to begin a session that is there already, or of which something is left.

        Raises
        ------
        ArchiveError
            If there is a plan, a journal with a line or a trials.csv, one of the places is a
            symbolic link, an identifier in use differs only by case, or the person withdrew.
        """
        self._refuse_case_variant()
        refuse_withdrawn(self.root, self.participant)
        refuse_links(self.path)
        self.refuse_loss()
        if self.plan_path.exists():
            raise ArchiveError(
                f"{self.path}: this session exists already; nothing was changed. Go on with it by "
                "--resume, or give another --participant or --session"
            )

    def _refuse_case_variant(self) -> None:
        """Refuse an identifier that differs from one in use only by upper and lower case.

        Many disks treat such names as the same, so that the folder could not be copied to them.
        """
        people = {path.name for path in self.root.glob("sub-*")}
        people |= {path.stem for path in (self.root / WITHDRAWN_FOLDER).glob("sub-*.json")}
        people |= {*read_people(self.root).rows}
        sessions = {path.name for path in self.path.parent.glob("ses-*")}
        for key, name, names in (
            ("participant", f"sub-{self.participant}", people),
            ("session", f"ses-{self.session}", sessions),
        ):
            for present in sorted(names - {name}):
                if present.casefold() == name.casefold():
                    raise ArchiveError(
                        f"{key}: must differ from {present[4:]!r}, which exists, by more than "
                        f"upper and lower case (got {name[4:]!r}): nothing was changed"
                    )

    def refuse_loss(self) -> None:
        """Refuse a session of which plan or journal were lost; none at all is no loss.

        A journal is made, empty, before header and plan: either without one has lost it, while an
        empty one without a plan is of a session that never began.

        Raises
        ------
        ArchiveError
            It says what is missing, what is left and what can be done.
        """
        paths = (self.plan_path, self.journal_path, self.trials_path, self.measured_path)
        left = [path.name for path in paths if path.exists()]
        gone = [path.name for path in paths[:2] if not path.exists()]
        if left == [self.journal_path.name] and not self.journal_path.stat().st_size:
            return
        if not left and self.header_path.exists():
            left = [self.header_path.name]
        if left and gone:
            raise ArchiveError(
                f"{self.path}: {' and '.join(gone)} missing, {' and '.join(left)} left; restore "
                "from a copy what is missing and go on by --resume; without a copy the person "
                "needs another --session: nothing was changed"
            )

    def create(self, plan: Plan, header: Header) -> None:
        """Enter the participant in participants.tsv, then write the files of a new session.

        The plan is written last: a session exists from the moment it has a plan. The journal is
        there before it, so that a plan without a journal indicates a loss. Call this method while
        the session is `locked`.

        Parameters
        ----------
        plan : Plan
            The sealed plan of the session.
        header : Header
            The contents of header.json.

        Raises
        ------
        ArchiveError
            If the session exists already, or a fact of the participant is not one that the study
            declares or differs from what is known.
        JournalWriteError
            If the plan is written but cannot be synced, so that a power cut could remove it.
        """
        self.refuse_existing()
        columns = study_from_canonical(plan.study).participants.columns
        enter_person(self.root, self.participant, columns, self.values, disk=self.disk)
        if not self.journal_path.exists():
            write_new(self.journal_path, b"", self.disk)
        write_atomically(self.header_path, f"{header.model_dump_json(indent=1)}\n", disk=self.disk)
        try:
            write_atomically(self.plan_path, plan.to_json(), disk=self.disk)
        except OSError as error:
            if not self.plan_path.exists():
                raise
            raise JournalWriteError(
                f"{self.plan_path}: cannot be synced ({error.strerror})"
            ) from error

    def check_people(self, study: Study) -> None:
        """Check that this participant can be entered in participants.tsv.

        Parameters
        ----------
        study : Study
            The study, which declares the columns of the table.

        Raises
        ------
        ArchiveError
            If it is no such table or has a value that the study does not declare, with its line; if
            a fact of the participant is not one that the study declares or differs from it.
        """
        columns = study.participants.columns
        read_people(self.root, columns).with_person(self.participant, columns, self.values)

    def participant_number(self) -> int:
        """Return the participant number, which selects the order of conditions.

        Returns
        -------
        int
            The number in the plan of an earlier session of this participant. Without one, the
            position of the participant in participants.tsv, counted from 1; a participant who is
            not yet in the table comes last.

        Raises
        ------
        ArchiveError
            If participants.tsv is not a valid table.
        PlanError
            If the plan of an earlier session was changed after it was sealed.
        """
        for path in sorted(self.path.parent.glob("ses-*/plan.json")):
            if (number := _read_plan(path).participant_number) is not None:
                return number
        return next_number(self.root, self.participant)

    def read_header(self) -> Header:
        """Read header.json.

        Returns
        -------
        Header
            Computer, device, noise and versions of the first visit.

        Raises
        ------
        ArchiveError
            If the file is not the header of a session.
        """
        try:
            return Header.model_validate_json(self.header_path.read_bytes())
        except ValidationError as error:
            raise ArchiveError(f"{self.header_path}: {first_fault(error)}") from error

    def read_plan(self) -> Plan:
        """Read and verify the plan.

        Returns
        -------
        Plan
            The sealed plan of this session.

        Raises
        ------
        ArchiveError
            If there is no plan, the plan belongs to another session, a file of the session is a
            symbolic link, or the participant withdrew.
        PlanError
            If the plan was changed after it was sealed.
        """
        refuse_withdrawn(self.root, self.participant)
        refuse_links(self.path)
        if not self.plan_path.exists():
            self.refuse_loss()
            raise ArchiveError(
                f"{self.path}: there is no session to resume here; without --resume one begins"
            )
        plan = _read_plan(self.plan_path)
        if (plan.participant, plan.session) != (self.participant, self.session):
            raise ArchiveError(
                f"{self.plan_path}: must be the plan of participant {self.participant}, session "
                f"{self.session}; got participant {plan.participant}, session {plan.session}"
            )
        return plan

    def read_study(self, plan: Plan) -> Study:
        """Return the study that the plan holds.

        Parameters
        ----------
        plan : Plan
            The plan of this session.

        Returns
        -------
        Study
            The study as it was recorded.

        Raises
        ------
        StudyError
            If another version of tactstrip recorded the study, with other keys.
        """
        try:
            return study_from_canonical(plan.study)
        except StudyError as error:
            rule = (
                "was recorded by another version of tactstrip, which header.json names, and whose "
                "studies have other keys: continue and export the session with that version"
            )
            raise StudyError(self.plan_path, Fault("", rule)) from error

    def open_journal(self, now_s: Callable[[], float]) -> Journal:
        """Open the journal for writing, at its end.

        Parameters
        ----------
        now_s : callable
            Returns the time on the session's clock, in seconds.

        Returns
        -------
        Journal
            The journal, which the caller closes.

        Raises
        ------
        JournalError
            If a line of the journal is damaged, missing or repeated.
        JournalWriteError
            If the file cannot be opened for writing.
        """
        return Journal(self.journal_path, now_s=now_s, disk=self.disk)

    def read_history(self, plan: Plan) -> History:
        """Read the journal and return the history of the session.

        Parameters
        ----------
        plan : Plan
            The plan of this session.

        Returns
        -------
        History
            The presented trials and the pending ones, as `replay` returns them.

        Raises
        ------
        ArchiveError
            If the plan or the journal is missing.
        JournalError
            If the journal cannot be trusted, belongs to another plan, or holds fewer trials than
            trials.csv, which is built from it.
        """
        self.refuse_loss()
        entries = read_journal(self.journal_path).entries
        try:
            history = replay(plan, entries)
        except JournalError as error:
            raise JournalError(f"{self.journal_path}: {error}") from error
        table = self.trials_path.read_bytes() if self.trials_path.exists() else b""
        written = max(0, table.count(b"\n") - 1)
        if written > len(history.rows):
            raise JournalError(
                f"{self.journal_path}: must have at least the {written} trials of trials.csv; "
                f"got {len(history.rows)}; restore it from a copy: nothing was changed"
            )
        return history

    def tables_sha256(self, plan: Plan) -> dict[str, str]:
        """Return the checksums of the tables that the current journal gives.

        Parameters
        ----------
        plan : Plan
            The plan of this session.

        Returns
        -------
        dict of str to str
            ``trials_sha256``, and ``measured_sha256`` if a monitor measured bursts: the SHA-256 of
            each table, 64 hexadecimal digits.

        Raises
        ------
        ArchiveError, JournalError
            As `read_history` does.
        """
        tables = self._tables(plan).items()
        return {f"{path.stem}_sha256": sha256(text.encode()).hexdigest() for path, text in tables}

    def _tables(self, plan: Plan) -> dict[Path, str]:
        history = self.read_history(plan)
        tables = {self.trials_path: trials_csv(plan.task, history.rows)}
        if history.measured:
            tables[self.measured_path] = measured_csv(plan.task.sites, history.measured)
        return tables

    def write_trials(self) -> Path:
        """Write trials.csv, and measured.csv if a monitor measured bursts, from the journal.

        Returns
        -------
        Path
            Path of trials.csv.

        Raises
        ------
        ArchiveError, PlanError
            If the plan cannot be read, as `read_plan`.
        JournalError
            If the journal cannot be read, as `read_history`.
        JournalWriteError
            If a table cannot be written. The journal still holds all its data.
        """
        for path, text in self._tables(self.read_plan()).items():
            try:
                write_atomically(path, text, disk=self.disk)
            except OSError as error:
                raise JournalWriteError(f"{path}: cannot be written ({error.strerror})") from error
        return self.trials_path


def _remove_unused_lock(made: list[Path]) -> None:
    """Remove the lock, while it is held, where a session that was to begin has no other file."""
    with contextlib.suppress(OSError):  # Windows removes no open file: the folder stays
        if made and [path.name for path in made[0].iterdir()] == [LOCK]:
            (made[0] / LOCK).unlink()


def _remove_empty(made: list[Path]) -> None:
    """Remove the folders that were made for a session that did not begin."""
    with contextlib.suppress(OSError):
        for folder in made:
            folder.rmdir()


def _read_plan(path: Path) -> Plan:
    try:
        return plan_from_json(path.read_text(encoding="utf-8"))
    except (PlanError, UnicodeDecodeError) as error:
        raise PlanError(f"{path}: {error}") from error
