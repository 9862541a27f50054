"""Sessions as a BIDS data set (Brain Imaging Data Structure, behaviour without imaging).

`experiment.record.rows` describes each column; bids.toml says what its words mean.
"""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

from experiment.names import NOT_AVAILABLE
from experiment.record.files import FILES, SESSIONS_TABLE, ArchiveError, locked, tsv
from experiment.record.journal import read_journal
from experiment.record.manifest import Manifest, replace_folder
from experiment.record.people import FILE_NAME, ID_COLUMN, People, read_people
from experiment.record.rows import cells_of, columns_of, format_value
from experiment.study.stimulus import stimulus_values
from experiment.templates import open_templates

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from experiment.record.folder import SessionFolder
    from experiment.record.manifest import FolderWriter
    from experiment.record.rows import Column, TrialRow
    from experiment.study.dataset import ParticipantColumn
    from experiment.study.study import Study
    from experiment.tasks.task import Task
    from experiment.trial.plan import Plan


_FIRST: Final = {
    "onset": "onset_s",
    "duration": None,
    "trial_type": "kind",
    "response_time": "rt_s",
}
_UNITS: Final = {"_s": "s", "_vpp": "V", "_um": "um"}


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedSession:
    """What the tables of a data set say of a session."""

    participant: str
    session: str
    begun: str  # as its header has it
    study: Study
    finished: bool  # whether every planned trial is answered
    planned: int  # trials of its plan
    answered: int
    simulated: bool | None  # none for a session without a first line
    head_sha256: str | None  # of the journal's last line
    device_kind: str | None  # "mixed" where there were several; none without a trial
    is_practice: bool  # whether a person was presented with a device that moves nothing

    @property
    def name(self) -> str:
        """What the session is called."""
        return f"sub-{self.participant}/ses-{self.session}"

    @property
    def progress(self) -> str:
        """Its name, and how much there is of it."""
        return f"{self.name} ({self.answered} of {self.planned} trials answered)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Export:
    """What an export holds."""

    sessions: tuple[ExportedSession, ...]
    left_out: tuple[str, ...]  # columns of participants.tsv that no study declares

    @property
    def simulated(self) -> list[ExportedSession]:
        """The sessions without a person."""
        return [session for session in self.sessions if session.simulated]

    @property
    def practice(self) -> list[ExportedSession]:
        """The sessions of a person on a device that moves nothing."""
        return [session for session in self.sessions if session.is_practice]

    @property
    def last(self) -> ExportedSession:
        """The session that was begun last: its study describes the data set."""
        return max(self.sessions, key=lambda session: session.begun)


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
    participants = tuple(sorted({folder.participant for folder in folders}))
    about = Manifest(what="BIDS data set", participants=participants)
    busy = "another process is exporting it"
    with locked(root / ".export.lock", busy), replace_folder(out, root, about) as new:
        sessions = tuple(
            _write_session(new, folder, plan, with_sources=with_sourcedata)
            for folder, plan in zip(folders, plans, strict=True)
        )
        columns = {c.name: c for s in sessions for c in s.study.participants.columns}
        people = read_people(root, columns.values())
        left_out = tuple(name for name in people.heading if name not in {ID_COLUMN, *columns})
        export = Export(sessions=sessions, left_out=left_out)
        for session in () if allow_simulated else export.practice:
            raise ArchiveError(
                f"{root / session.name}: a person on a device of the kind "
                f"{session.device_kind}, who felt nothing; --allow-simulated exports it, "
                "with a mark: nothing was written"
            )
        for participant in participants if with_sourcedata else ():
            file = root / f"sub-{participant}" / SESSIONS_TABLE
            if file.is_file():
                new.write(f"sourcedata/sub-{participant}/{SESSIONS_TABLE}", file.read_bytes())
        _write_people(new, participants, people, tuple(columns.values()))
        _write_sessions(new, sessions)
        _write_description(new, export)
        return export


def _write_session(
    new: FolderWriter, folder: SessionFolder, plan: Plan, *, with_sources: bool
) -> ExportedSession:
    with folder.locked():
        study = folder.read_study(plan)
        history = folder.read_history(plan)
        header = folder.read_header()
        for pattern in (*FILES, "journal.torn-*") if with_sources else ():
            for source in sorted(folder.path.glob(pattern)):
                new.write(f"sourcedata/{folder.name}/{source.name}", source.read_bytes())
        head_sha256 = read_journal(folder.journal_path).head_sha256 if history.opening else None
    if history.opening is not None and history.opening.device_kind == "rehearsal":
        raise ArchiveError(f"{folder.path}: is a rehearsal: nothing was written")
    simulated = history.opening.simulated if history.opening else None
    kinds = sorted({row.device_kind or NOT_AVAILABLE for row in history.rows})
    session = ExportedSession(
        participant=folder.participant,
        session=folder.session,
        begun=header.begun,
        study=study,
        finished=history.finished,
        planned=len(plan.trials),
        answered=len(plan.trials) - len(history.pending),
        simulated=simulated,
        head_sha256=head_sha256,
        device_kind="mixed" if len(kinds) > 1 else next(iter(kinds), None),
        is_practice=simulated is False and not {*kinds} <= {"real", NOT_AVAILABLE},
    )
    label = re.sub("[^A-Za-z0-9]", "", study.name)
    if not label:
        raise ArchiveError(
            f"study.name must have a letter or digit for a BIDS data set; got {study.name!r}"
        )
    file = f"{folder.name}/beh/sub-{folder.participant}_ses-{folder.session}_task-{label}_events"
    new.write(f"{file}.tsv", tsv(_event_cells(study, history.rows, history.recording_start_s)))
    sidecar = _events_sidecar(study, header.versions["tactstrip"], simulated=bool(simulated))
    new.write(f"{file}.json", _json(sidecar))
    return session


def _json(contents: Mapping[str, object]) -> str:
    return json.dumps(contents, ensure_ascii=False, indent=2) + "\n"


def event_columns(task: Task) -> dict[str, str | None]:
    """Return the columns of events.tsv in their order, and the column of trials.csv of each."""
    names = (column.name for column in columns_of(task))
    return _FIRST | {name: name for name in names if name not in _FIRST.values()}


def _event_cells(
    study: Study, rows: Iterable[TrialRow], recording_start_s: float
) -> Iterator[Sequence[str]]:
    """Yield the rows of an events.tsv.

    Onsets are counted from the marker by which recordings are aligned. A blank trial lasts 0 s.
    """
    conditions = {condition.name: condition for condition in study.conditions}
    columns, names = event_columns(study.task), [c.name for c in columns_of(study.task)]
    yield tuple(columns)
    for row in rows:
        onset_s, *earlier_s = (
            None if at_s is None else round(at_s - recording_start_s, 6)
            for at_s in (row.onset_s, *row.earlier_onsets_s)
        )
        aligned, duration_s = replace(row, onset_s=onset_s, earlier_onsets_s=tuple(earlier_s)), None
        if onset_s is not None:
            n_sites = len(study.task.presentation(row.side).sites)
            duration_s = conditions[row.condition].duration_s(n_sites) if n_sites else 0.0
        values = dict(zip(names, cells_of(aligned), strict=True))
        yield [
            format_value(duration_s if source is None else values[source])
            for source in columns.values()
        ]


def _events_sidecar(study: Study, software_version: str, *, simulated: bool) -> dict[str, Any]:
    """Describe the task, then every column; a simulation was not instructed."""
    sidecar: dict[str, Any] = {
        "TaskName": study.name,
        "TaskDescription": study.dataset.task_description,
        "FingerContact": None if simulated else study.contact.summary,
        "Instructions": None if simulated else study.texts.instructions,
        "Task": _given(
            {
                "Kind": study.task.name,
                "Intervals": study.task.n_intervals,
                "GapBetweenIntervals": study.task_choice.gap_s,
                "ReferenceLevel": study.task.reference_vpp,
                "LevelRule": study.levels.rule,
            }
        ),
        "InstitutionName": study.dataset.institution_name,
        "InstitutionAddress": study.dataset.institution_address,
        "StimulusPresentation": {
            "SoftwareName": "tactstrip",
            "SoftwareVersion": software_version,
        },
    }
    columns = {column.name: column for column in columns_of(study.task)}
    for name, source in event_columns(study.task).items():
        sidecar[name] = _described(columns[source], study.task) if source else _tables()["duration"]
    sidecar["condition"]["Levels"] = {
        condition.name: ", ".join(
            f"{key} {format_value(value)}" for key, value in stimulus_values(condition).items()
        )
        for condition in study.conditions
    }
    return _given(sidecar)


def _described(column: Column, task: Task) -> dict[str, Any]:
    """Return what the sidecar says of a column of trials.csv."""
    description = column.description[0].upper() + column.description[1:]
    if column.optional:
        description += f"; {NOT_AVAILABLE} where there is none"
    if column.name.startswith("onset_") and column.type == "float":
        description += "; from the marker recording_start, where markers were sent"
    units = next((unit for end, unit in _UNITS.items() if column.name.endswith(end)), None)
    return _given({"Description": description, "Units": units, "Levels": _levels(column, task)})


def _levels(column: Column, task: Task) -> dict[str, str]:
    """Return what the words in a column mean: those of the task, and those of any task."""
    of_task = {
        "kind": task.kinds,
        "side": {p.name: p.meaning for p in task.presentations},
        "response": {answer.name: answer.meaning for answer in task.answers},
    }
    name = "bool" if column.type == "bool" else column.name
    return {**of_task.get(name, {}), **_tables()["levels"].get(name, {})}


@cache
def _tables() -> dict[str, Any]:
    return tomllib.loads(files(__package__).joinpath("bids.toml").read_text("utf-8"))


def _given(members: Mapping[str, object]) -> dict[str, Any]:
    return {key: value for key, value in members.items() if value}


def _write_people(
    new: FolderWriter,
    participants: Iterable[str],
    people: People,
    columns: Sequence[ParticipantColumn],
) -> None:
    heading = (ID_COLUMN, *(column.name for column in columns))
    names = [f"sub-{participant}" for participant in participants]
    rows = {name: people.rows.get(name, {ID_COLUMN: name}) for name in names}
    sidecar = {ID_COLUMN: {"Description": "Participant's identifier"}}
    for column in columns:
        levels = {level: level for level in column.levels}
        sidecar[column.name] = _given({"Description": column.description, "Levels": levels})
    new.write(FILE_NAME, People(heading, rows).text())
    new.write("participants.json", _json(sidecar))


def _write_sessions(new: FolderWriter, sessions: Sequence[ExportedSession]) -> None:
    """Write the table of the sessions of each participant."""
    columns = _tables()["sessions"]
    rows: dict[str, list[list[str]]] = {}
    for session in sessions:
        values = (
            *(f"ses-{session.session}", session.finished, session.planned, session.answered),
            *(session.simulated, session.device_kind, session.head_sha256),
        )
        rows.setdefault(session.participant, []).append([*map(format_value, values)])
    for participant, cells in rows.items():
        file = f"sub-{participant}/sub-{participant}_sessions"
        new.write(f"{file}.tsv", tsv([[*columns], *cells]))
        new.write(f"{file}.json", _json(columns))


def _write_description(new: FolderWriter, export: Export) -> None:
    """Write dataset_description.json, without what the study does not give, and README."""
    study = export.last.study
    name = study.dataset.name or study.name
    if export.simulated:
        share = "" if len(export.simulated) == len(export.sessions) else "partly "
        name = f"{name} ({share}simulated)"
    if export.practice:
        name = f"{name} (practice without a device)"
    of_task = {"institution_name", "institution_address", "task_description"}
    given = study.dataset.model_dump(exclude={"name", "authors", *of_task})
    description = {
        "Name": name,
        "BIDSVersion": "1.10.0",  # whose layout the data set follows
        "DatasetType": "raw",
        "Authors": study.dataset.authors,  # also none, which says that the study names none
        # The keys of BIDS are those of the study file in camel case.
        **_given({key.title().replace("_", ""): value for key, value in given.items()}),
        "GeneratedBy": [{"Name": "tactstrip", "Version": version("tactstrip")}],
    }
    new.write("dataset_description.json", _json(description))
    readme = open_templates(str(__package__), {}).get_template("README.jinja")
    new.write(
        "README",
        readme.render(name=name, export=export, task=study.task, question=study.texts.prompt),
    )
