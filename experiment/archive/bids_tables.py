"""The tables of a BIDS data set and their sidecars: trials.csv under BIDS' names and units.

What a column is, is said once, in `experiment.rows`; here is what BIDS calls it and what
each of its words means.
"""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from experiment.archive.participants import ID_COLUMN
from experiment.rows import COLUMNS, NOT_AVAILABLE, format_value
from experiment.study.stimulus import stimulus_facts

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from experiment.rows import Column, TrialRow
    from experiment.study.dataset import Dataset, ParticipantColumn
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study


_NAMES: Final = MappingProxyType(
    {"onset_s": "onset", "kind": "trial_type", "rt_s": "response_time"}
)
"""What BIDS calls a column of trials.csv; the others keep their names."""
_FIRST: Final = ("onset", "duration", "trial_type", "response_time")
_UNITS: Final = MappingProxyType({"_s": "s", "_vpp": "V", "_um": "um"})
_ANSWERS: Final = {
    "left": "at the left finger",
    "right": "at the right finger",
    "both": "at both fingers",
}
_YES_NO: Final = MappingProxyType({"true": "it is so", "false": "it is not so"})
MEANINGS: Final[Mapping[str, Mapping[str, str]]] = MappingProxyType(
    {
        "kind": {
            "single": "a stimulus at one finger",
            "both": "a stimulus at both fingers at once",
            "blank": "no stimulus",
            "practice": "practice or warm-up; belongs to no result",
            "control": "the fingers off the plate; belongs to no level's result",
        },
        "side": _ANSWERS | {"none": "no stimulus"},
        "response": _ANSWERS
        | {
            "none": "nothing was noticed",
            "timeout": "no answer within the time that the study gives",
            "invalid": "a key without a meaning in this study",
        },
        "status": {
            "ok": "presented as planned, and counts",
            "device_error": "the device refused or failed",
            "indeterminate": "nobody can tell whether a stimulus went out",
            "aborted": "no stimulus went out",
            "voided": "a stimulus went out, the trial does not count and is presented again",
        },
        "displacement_basis": {
            "measured": "from a displacement measured at the actuator, by the lab or, on the "
            "paper's own plate, by the paper",
            "predicted": "from the layers of the actuator, or assumed equal to the other one's",
        },
        "device_kind": {
            "real": "a device with actuators",
            "emulated": "an emulator of a device: nothing moved",
            "mock": "no device at all: nothing moved",
        },
        "burst_verified": {
            "line": "on the line to the amplifier",
            "amplifier": "at the amplifier's output",
            "current": "in the actuator's current",
            "motion": "in the plate's motion",
            "false": "a monitor measured another burst than was planned, or could not measure it",
        },
    }
)
"""What the words of a column mean, by column and word."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EventColumn:
    """A column of events.tsv."""

    name: str
    description: str
    units: str | None  # for a number with one
    levels: Mapping[str, str] | None  # words and what they mean, for a column of words
    source: str | None  # the column of trials.csv; none for the duration

    @property
    def sidecar(self) -> dict[str, Any]:
        """What the sidecar says of the column."""
        facts: dict[str, Any] = {"Description": self.description}
        if self.units is not None:
            facts["Units"] = self.units
        if self.levels is not None:
            facts["Levels"] = dict(self.levels)
        return facts


def _event_column(column: Column) -> EventColumn:
    levels = _YES_NO if column.type == "bool" else MEANINGS.get(column.name)
    unit = next((unit for end, unit in _UNITS.items() if column.name.endswith(end)), None)
    missing = f"; {NOT_AVAILABLE} where there is none" if column.optional else ""
    if column.name == "onset_s":
        missing += "; from the marker recording_start, where markers were sent"
    return EventColumn(
        name=_NAMES.get(column.name, column.name),
        description=column.description[0].upper() + column.description[1:] + missing,
        units=unit,
        levels=levels,
        source=column.name,
    )


_DURATION: Final = EventColumn(
    name="duration",
    description="How long the drive of the actuators lasted; 0 without a stimulus, "
    f"{NOT_AVAILABLE} where none surely went out",
    units="s",
    levels=None,
    source=None,
)


def _in_order() -> tuple[EventColumn, ...]:
    columns = {column.name: column for column in (_DURATION, *map(_event_column, COLUMNS))}
    return (*(columns.pop(name) for name in _FIRST), *columns.values())


EVENT_COLUMNS: Final = _in_order()
"""The columns of events.tsv, in their order."""


def events_tsv(rows: Iterable[TrialRow], durations_s: Mapping[str, float]) -> str:
    r"""Write trials as the text of an events.tsv, with how long each condition's stimulus lasts.

    >>> events_tsv([], {}).split("\t")[:5]
    ['onset', 'duration', 'trial_type', 'response_time', 'schema']
    """
    lines = [[column.name for column in EVENT_COLUMNS]]
    for row in rows:
        duration_s = _duration_s(row, durations_s)
        lines.append(
            [
                format_value(getattr(row, column.source) if column.source else duration_s)
                for column in EVENT_COLUMNS
            ]
        )
    return tsv(lines)


def aligned(row: TrialRow, recording_start_s: float) -> TrialRow:
    """Return a trial with its onset counted from the marker by which recordings are aligned."""
    if row.onset_s is None:
        return row
    return replace(row, onset_s=round(row.onset_s - recording_start_s, 6))


def _duration_s(row: TrialRow, durations_s: Mapping[str, float]) -> float | None:
    if row.onset_s is None:
        return None
    return 0.0 if row.level_vpp is None else durations_s[row.condition]


def tsv(lines: Iterable[Sequence[str]]) -> str:
    r"""Write cells with tabs between them, one line a row.

    >>> tsv([("name", "size"), ("plate", '1" thick')])
    'name\tsize\nplate\t1" thick\n'
    """
    text = io.StringIO()
    csv.writer(
        text, "excel-tab", lineterminator="\n", quoting=csv.QUOTE_NONE, quotechar=None
    ).writerows(lines)
    return text.getvalue()


def json_text(contents: Mapping[str, object]) -> str:
    r"""Write a sidecar, any script as it is.

    >>> json_text({"TaskName": "días"})
    '{\n  "TaskName": "días"\n}\n'
    """
    return json.dumps(contents, ensure_ascii=False, indent=2) + "\n"


def events_sidecar(
    study: Study, *, software_version: str | None, simulated: bool
) -> dict[str, Any]:
    """List what the sidecar of an events.tsv says: the task, then every column.

    The version is that which ran the study, where it is known; a simulation was not instructed.

    >>> from experiment.study.files import paper_study
    >>> sidecar = events_sidecar(paper_study(), software_version=None, simulated=True)
    >>> sidecar["condition"]["Levels"]
    {'main': 'frequency_hz 500, cycles 1, window none'}
    """
    facts = {
        "TaskName": study.name,
        "TaskDescription": study.dataset.task_description,
        "FingerContact": None if simulated else study.contact.words,
        "Instructions": None if simulated else study.shown_texts.instructions,
        "InstitutionName": study.dataset.institution_name,
        "InstitutionAddress": study.dataset.institution_address,
    }
    columns = {column.name: column.sidecar for column in EVENT_COLUMNS}
    columns["condition"]["Levels"] = {c.name: _stimulus(c) for c in study.conditions}
    software = {"SoftwareName": "tactstrip", "SoftwareVersion": software_version}
    return {
        **_given(facts),
        "StimulusPresentation": _given(software),
        **columns,
    }


def _stimulus(condition: Condition) -> str:
    """Describe the stimulus of a condition in a line, as the header does."""
    facts = stimulus_facts(condition)
    return ", ".join(f"{key} {format_value(value)}" for key, value in facts.items())


def _given(facts: Mapping[str, object]) -> dict[str, Any]:
    return {key: value for key, value in facts.items() if value}


def dataset_description(name: str, dataset: Dataset, *, version: str) -> dict[str, Any]:
    """List what dataset_description.json says; a fact that the study does not give is not in it.

    The list of authors stands there always: an empty one says that the study names none.

    >>> from experiment.study.dataset import Dataset
    >>> list(dataset_description("A title", Dataset(license="CC0"), version="1"))
    ['Name', 'BIDSVersion', 'DatasetType', 'Authors', 'License', 'GeneratedBy']
    """
    facts = {
        "License": dataset.license,
        "Acknowledgements": dataset.acknowledgements,
        "HowToAcknowledge": dataset.how_to_acknowledge,
        "Funding": list(dataset.funding),
        "EthicsApprovals": list(dataset.ethics_approvals),
        "ReferencesAndLinks": list(dataset.references_and_links),
    }
    return {
        "Name": name,
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        "Authors": list(dataset.authors),
        **_given(facts),
        "GeneratedBy": [{"Name": "tactstrip", "Version": version}],
    }


BIDS_VERSION: Final = "1.10.0"
"""Version of BIDS that the layout follows."""


def participants_sidecar(columns: Iterable[ParticipantColumn]) -> dict[str, Any]:
    """List what participants.json says of each column.

    >>> list(participants_sidecar([]))
    ['participant_id']
    """
    described: dict[str, Any] = {ID_COLUMN: {"Description": "Participant's identifier"}}
    for column in columns:
        described[column.name] = {"Description": column.description}
        if column.levels:
            described[column.name]["Levels"] = {level: level for level in column.levels}
    return described


SESSION_COLUMNS: Final[Mapping[str, Mapping[str, object]]] = MappingProxyType(
    {
        "session_id": {"Description": "Session's identifier"},
        "finished": {
            "Description": "Whether every planned trial was answered; otherwise the session was "
            "stopped or interrupted, and what there is of it is here",
            "Levels": dict(_YES_NO),
        },
        "trials_planned": {"Description": "Trials of the plan, repeats not counted"},
        "trials_answered": {"Description": "Trials of the plan that count as answered"},
        "simulated": {
            "Description": "Whether the participant is a simulation and not a person",
            "Levels": dict(_YES_NO),
        },
        "device_kind": {
            "Description": "What drove the actuators; with a person and nothing that moves, the "
            "session was practice",
            "Levels": dict(MEANINGS["device_kind"], mixed="of some trials one, of others another"),
        },
        "head_sha256": {
            "Description": "SHA-256 that stands for the whole record of the session: its plan, its "
            "header and every event; the record itself stays where the session was run"
        },
    }
)
"""The columns of sessions.tsv and what its sidecar says of them."""
