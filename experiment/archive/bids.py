"""Sessions as a BIDS data set (Brain Imaging Data Structure, behaviour without imaging)."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from filelock import Timeout

from experiment.archive.bids_tables import (
    SESSION_COLUMNS,
    aligned,
    dataset_description,
    events_sidecar,
    events_tsv,
    json_text,
    participants_sidecar,
    tsv,
)
from experiment.archive.disk import lock_on
from experiment.archive.files import HEADS, ArchiveError, replaced
from experiment.archive.journal import read_journal
from experiment.archive.manifest import Manifest
from experiment.archive.participants import (
    FILE_NAME,
    ID_COLUMN,
    Fact,
    check_facts,
    read_people,
)
from experiment.rows import NOT_AVAILABLE, format_value

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from experiment.archive.files import NewFolder
    from experiment.archive.folders import SessionFolder
    from experiment.archive.participants import People
    from experiment.study.dataset import ParticipantColumn
    from experiment.study.study import Study
    from experiment.trial.plan import Plan


_SOURCES = (
    "plan.json",
    "header.json",
    "journal.jsonl",
    "journal.torn-*",
    "trials.csv",
    "measured.csv",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedSession:
    """What is known of an exported session."""

    participant: str
    session: str
    begun: str  # as its header has it
    study: Study
    finished: bool  # whether every planned trial is answered
    planned: int  # trials of its plan
    answered: int
    simulated: bool | None  # none for a session without a first line
    head_sha256: str | None  # of the journal's last line
    device_kinds: tuple[str, ...]  # of its sittings that presented a trial, by name

    @property
    def practice(self) -> bool:
        """Whether a person was presented with a device that moves nothing."""
        return self.simulated is False and not {*self.device_kinds} <= {"real", NOT_AVAILABLE}

    @property
    def device_kind(self) -> str | None:
        """The one kind of device, or that there were several; none without a trial."""
        return "mixed" if len(self.device_kinds) > 1 else next(iter(self.device_kinds), None)

    @property
    def name(self) -> str:
        """What the session is called."""
        return f"sub-{self.participant}/ses-{self.session}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Export:
    """What an export holds."""

    sessions: tuple[ExportedSession, ...]
    left_out: tuple[str, ...]  # columns of participants.tsv that no study declares

    @property
    def unfinished(self) -> tuple[ExportedSession, ...]:
        """The sessions that were stopped or interrupted."""
        return tuple(session for session in self.sessions if not session.finished)

    @property
    def simulated(self) -> tuple[ExportedSession, ...]:
        """The sessions without a person."""
        return tuple(session for session in self.sessions if session.simulated)

    @property
    def practice(self) -> tuple[ExportedSession, ...]:
        """The sessions of a person on a device that moves nothing."""
        return tuple(session for session in self.sessions if session.practice)

    @property
    def last(self) -> ExportedSession:
        """The session that was begun last: its study describes the data set."""
        return max(self.sessions, key=lambda session: session.begun)

    @property
    def descriptions(self) -> int:
        """How many different descriptions of the data set the sessions' studies give."""
        return len({session.study.dataset for session in self.sessions})


def export_bids(
    folders: Sequence[SessionFolder],
    out: Path,
    *,
    with_sourcedata: bool = False,
    allow_simulated: bool = False,
) -> Export:
    """Write sessions of a study's folder as a BIDS data set.

    Parameters
    ----------
    folders : sequence of SessionFolder
        The sessions, of one study's folder.
    out : Path
        The data set's folder: new, empty, or an unchanged export, which is replaced as a whole.
    with_sourcedata : bool
        Whether plans, headers and journals go with it; they name host and operator.
    allow_simulated : bool
        Whether sessions of people on a device that moves nothing are exported, with a mark.

    Raises
    ------
    ArchiveError
        If there is no session, one is being run, or belongs to a person whose withdrawal has begun;
        if a person had a device that moves nothing, unless that is allowed; if participants.tsv has
        a value that no study declares; if `out` may not be replaced.
        Nothing is changed then.
    JournalError, PlanError, StudyError
        If a session's record cannot be trusted; nothing is changed then.
    """
    if not folders:
        raise ArchiveError("there is no session to export that began")
    root = folders[0].root
    plans = [folder.read_plan() for folder in folders]  # all, before a lock or anything is made
    people = tuple(sorted({folder.participant for folder in folders}))
    about = Manifest(what="BIDS data set", participants=people)
    try:
        with lock_on(root / ".export.lock", timeout=0), replaced(out, root, about) as new:
            sessions = tuple(
                _write_session(new, folder, plan, with_sources=with_sourcedata)
                for folder, plan in zip(folders, plans, strict=True)
            )
            for session in sessions:
                if session.practice and not allow_simulated:
                    raise ArchiveError(
                        f"{root / session.name}: a person on a device of the kind "
                        f"{session.device_kind}, who felt nothing; --allow-simulated exports it, "
                        "with a mark: nothing was written"
                    )
            for person in people if with_sourcedata else ():
                file = root / f"sub-{person}" / HEADS
                if file.is_file():
                    new.write(f"sourcedata/sub-{person}/{HEADS}", file.read_bytes())
            return _write_about(new, sessions, read_people(root))
    except Timeout as error:
        raise ArchiveError(f"{root}: another process is exporting it") from error


def _write_session(
    new: NewFolder, folder: SessionFolder, plan: Plan, *, with_sources: bool
) -> ExportedSession:
    with folder.locked():
        study = folder.read_study(plan)
        history = folder.read_history(plan)
        header = _read_header(folder)
        if with_sources:
            _copy_sources(new, folder)
    session = ExportedSession(
        participant=folder.participant,
        session=folder.session,
        begun=str(header.get("begun", "")),
        study=study,
        finished=history.finished,
        planned=len(plan.trials),
        answered=len(plan.trials) - len(history.pending),
        simulated=history.opening.get("simulated"),
        device_kinds=tuple(sorted({row.device_kind or NOT_AVAILABLE for row in history.rows})),
        head_sha256=read_journal(folder.journal_path).head_sha256 if history.opening else None,
    )
    durations_s = {c.name: float(c.drive.duration_s) for c in study.conditions}
    sidecar = events_sidecar(
        study,
        software_version=header.get("versions", {}).get("tactstrip"),
        simulated=bool(session.simulated),
    )
    file = f"{session.name}/beh/sub-{folder.participant}_ses-{folder.session}_task-{_label(study)}"
    rows = [aligned(row, history.recording_start_s) for row in history.rows]
    new.write(f"{file}_events.tsv", events_tsv(rows, durations_s))
    new.write(f"{file}_events.json", json_text(sidecar))
    return session


def _label(study: Study) -> str:
    """Return the task's label: the letters and digits of the study's name."""
    label = re.sub("[^A-Za-z0-9]", "", study.name)
    if not label:
        raise ArchiveError(
            f"study.name must have a letter or digit for a BIDS data set; got {study.name!r}"
        )
    return label


def _read_header(folder: SessionFolder) -> dict[str, Any]:
    path = folder.path / "header.json"
    try:
        header = json.loads(path.read_bytes())
    except ValueError as error:
        raise ArchiveError(f"{path}: must be JSON; got {error}") from error
    if not isinstance(header, dict):
        raise ArchiveError(f"{path}: must be a JSON object; got {type(header).__name__}")
    return header


def _copy_sources(new: NewFolder, folder: SessionFolder) -> None:
    place = f"sourcedata/sub-{folder.participant}/ses-{folder.session}"
    for pattern in _SOURCES:
        for file in sorted(folder.path.glob(pattern)):
            new.write(f"{place}/{file.name}", file.read_bytes())


def _write_about(new: NewFolder, sessions: tuple[ExportedSession, ...], people: People) -> Export:
    """Write what is said of the whole data set and of each participant."""
    columns = {c.name: c for session in sessions for c in session.study.participants.columns}
    named = {ID_COLUMN, *columns}
    export = Export(
        sessions=sessions, left_out=tuple(name for name in people.heading if name not in named)
    )
    _write_people(new, export, people, tuple(columns.values()))
    for participant in sorted({session.participant for session in sessions}):
        of_one = [session for session in sessions if session.participant == participant]
        file = f"sub-{participant}/sub-{participant}_sessions"
        new.write(f"{file}.tsv", tsv([tuple(SESSION_COLUMNS), *map(_session_cells, of_one)]))
        new.write(f"{file}.json", json_text(dict(SESSION_COLUMNS)))
    name = export.last.study.dataset.name or export.last.study.name
    if export.simulated:
        part = "" if len(export.simulated) == len(sessions) else "partly "
        name = f"{name} ({part}simulated)"
    if export.practice:
        name = f"{name} (practice without a device)"
    description = dataset_description(name, export.last.study.dataset, version=version("tactstrip"))
    new.write("dataset_description.json", json_text(description))
    new.write("README", _readme(export, name))
    return export


def _session_cells(session: ExportedSession) -> tuple[str, ...]:
    facts = (
        *(session.finished, session.planned, session.answered),
        *(session.simulated, session.device_kind, session.head_sha256),
    )
    return (f"ses-{session.session}", *map(format_value, facts))


def _write_people(
    new: NewFolder, export: Export, people: People, columns: tuple[ParticipantColumn, ...]
) -> None:
    lines = [(ID_COLUMN, *(column.name for column in columns))]
    for participant in sorted({session.participant for session in export.sessions}):
        facts = [Fact(c.name, people.value_of(participant, c.name)) for c in columns]
        try:
            check_facts(columns, facts)
        except ArchiveError as error:
            raise ArchiveError(f"{FILE_NAME}, participant {participant}: {error}") from error
        lines.append((f"sub-{participant}", *(fact.value for fact in facts)))
    new.write(FILE_NAME, tsv(lines))
    new.write("participants.json", json_text(participants_sidecar(columns)))


_ABOUT = """
Vibrotactile detection on a strip plate: a short vibration at the left finger, the right finger or
both, and the participant says where it was felt. One row of an events.tsv is one presented trial;
the .json beside it describes every column. Onsets are seconds on the session's clock, which begins
with the session and runs on through interruptions; where onset_clock rises the computer was started
anew, and onsets before and after cannot be compared.

Results count the trials with status ok, anticipated false, and neither noise_ok nor burst_verified
false; practice and control trials are apart. A trial that had to be presented again has a higher
attempt.

sub-*/sub-*_sessions.tsv says which sessions are complete and which are simulations.
"""


def _readme(export: Export, name: str) -> str:
    paragraphs = [name, _ABOUT.strip()]
    if export.simulated:
        which = ", ".join(session.name for session in export.simulated)
        paragraphs.append(f"SIMULATED, without a person: {which}")
        paragraphs.append(
            "Nobody laid a finger on a plate or was instructed in these: the .json beside their "
            "events have neither FingerContact nor Instructions."
        )
    if export.practice:
        which = ", ".join(session.name for session in export.practice)
        paragraphs.append(f"PRACTICE, a person on a device that moves nothing: {which}")
    if export.unfinished:
        which = ", ".join(describe(session) for session in export.unfinished)
        paragraphs.append(f"Not finished: {which}")
    return "\n\n".join(paragraphs) + "\n"


def describe(session: ExportedSession) -> str:
    """Say how much there is of a session."""
    return f"{session.name} ({session.answered} of {session.planned} trials answered)"
