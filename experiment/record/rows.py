"""The columns of trials.csv: what session, export and analysis share.

Each row describes one presented trial. A value that does not exist, or is not known yet, is written
``n/a``.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias, get_args

from experiment.names import NOT_AVAILABLE, DeviceKind
from experiment.perception.gains import BASES
from experiment.study.equipment import TapName
from experiment.tasks import LEFT_RIGHT_BOTH
from experiment.trial.events import Status
from experiment.trial.plan import HANDS_OFF, PRACTICE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from experiment.tasks.task import Task


SCHEMA = 3
KINDS = (*LEFT_RIGHT_BOTH.kinds, PRACTICE, HANDS_OFF)
SIDES = LEFT_RIGHT_BOTH.presentation_names
ANSWERS = LEFT_RIGHT_BOTH.answer_names
NO_ANSWERS = ("timeout", "invalid")
RESPONSES = (*ANSWERS, *NO_ANSWERS)
TAPS = get_args(TapName)
Verified: TypeAlias = TapName | Literal["false"]
"""The tap at which a monitor measured a burst as planned; ``false`` where it did not."""
VERIFIED = (*TAPS, "false")


@dataclass(frozen=True, slots=True)
class Column:
    """What a column of trials.csv holds.

    Attributes
    ----------
    name : str
        The heading, with the unit as suffix.
    type : str
        ``int``, ``float``, ``bool`` (written ``true`` / ``false``) or ``str``.
    optional : bool
        Whether ``n/a`` is a legal value.
    choices : tuple of str
        The legal words; empty where any text is legal.
    description : str
        One sentence for people.
    """

    name: str
    type: str
    optional: bool
    choices: tuple[str, ...]
    description: str


def _column(description: str, *choices: str, name: str = "", each: str = "") -> Any:
    """Return a field that is a column, or one for each site or interval, as its texts say."""
    return field(
        metadata={"name": name, "each": each, "description": description, "choices": choices}
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Presented:
    """The presentation and the trial of a row: the first columns of both tables."""

    schema: int = _column("version of this table's layout")
    participant: str = _column("participant's identifier")
    session: str = _column("session's identifier")
    condition: str = _column("condition's name in the study file")
    block: int = _column("block, counted from 1; 0 is practice, -1 the hands-off trials before it")
    trial: int = _column("trial of the plan, counted from 1")
    attempt: int = _column("1, or more where a trial had to be presented again")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialRow(Presented):
    """One presented trial, one row of trials.csv.

    Its fields are the columns of `COLUMNS`, in their order, each with its unit as suffix; a tuple
    has a column for each site of the task, or for each interval. None is ``n/a`` in the table.

    Examples
    --------
    >>> from dataclasses import fields
    >>> from experiment import COLUMNS
    >>> names = {each.name for each in fields(TrialRow)}
    >>> [column.name for column in COLUMNS if column.name not in names]
    ['level_left_vpp', 'level_right_vpp', 'peak_left_um', 'peak_right_um']
    """

    kind: str = _column("what sort of trial it is", *KINDS)
    side: str = _column("where the stimulus was", *SIDES)
    level_vpp: float | None = _column("planned level, peak-to-peak volts at the actuator")
    response: str | None = _column("what was answered", *RESPONSES)
    rt_s: float | None = _column("time from the onset to the answer, seconds")
    correct: bool | None = _column("whether the answer names the stimulus")
    status: str = _column("ok, or why the trial does not count", *get_args(Status))
    earlier_onsets_s: tuple[float | None, ...] = _column(
        "onset of the stimulus in interval {each} on the session's clock, seconds",
        name="onset_{each}_s",
        each="earlier interval",
    )
    onset_s: float | None = _column(
        "onset of the stimulus on the session's clock, seconds; of several intervals, of the last"
    )
    foreperiod_s: float = _column("planned wait between cue and stimulus, seconds")
    site_levels_vpp: tuple[float | None, ...] = _column(
        "level the device set on the {each} channel, volts", name="level_{each}_vpp", each="site"
    )
    site_peaks_um: tuple[float | None, ...] = _column(
        "greatest displacement under the {each} finger, micrometres",
        name="peak_{each}_um",
        each="site",
    )
    displacement_basis: str | None = _column("where the displacements come from", *BASES)
    premature: bool = _column("a response came before the onset or within 100 ms of it")
    noise_ok: bool | None = _column("whether the masking noise played from the onset to the answer")
    simulated: bool = _column("whether the participant is a simulation")
    device_kind: str | None = _column(
        "what drove the actuators, if anything did", *get_args(DeviceKind)
    )
    burst_verified: str | None = _column("where a monitor measured the burst as planned", *VERIFIED)
    onset_clock: int = _column(
        "1, and 1 more after each restart of the computer: onsets with different numbers are on "
        "different clocks"
    )
    study_sha256: str = _column("checksum of the study that was run")


def columns_of(task: Task) -> tuple[Column, ...]:
    """Return the columns of trials.csv at the sites and intervals of a task, with its words."""
    words = {
        "kind": (*task.kinds, PRACTICE, HANDS_OFF),
        "side": task.presentation_names,
        "response": (*task.answer_names, *NO_ANSWERS),
    }
    members = {"": ("",), "site": task.sites, "earlier interval": range(1, task.n_intervals)}
    columns = []
    for attribute in fields(TrialRow):
        kind = str(attribute.type).removeprefix("tuple[").removesuffix(", ...]")
        values = attribute.metadata
        columns += [
            Column(
                name=(values["name"] or attribute.name).format(each=each),
                type=kind.removesuffix(" | None"),
                optional=kind.endswith(" | None"),
                choices=words.get(attribute.name, values["choices"]),
                description=values["description"].format(each=each),
            )
            for each in members[values["each"]]
        ]
    return tuple(columns)


COLUMNS: Final = columns_of(LEFT_RIGHT_BOTH)
"""The columns of trials.csv, in their order, as the task left-right-both has them.

The columns of another task have its sites, and its words in ``kind``, ``side`` and ``response``.

Units are the suffixes of the names. ``optional`` states whether a value may be ``n/a``, and
``choices`` lists the words that are allowed.

>>> from experiment import COLUMNS
>>> [column.name for column in COLUMNS if column.type == "bool"]
['correct', 'premature', 'noise_ok', 'simulated']
"""


_ATTRIBUTES: Final = tuple(each.name for each in fields(TrialRow))


def cells_of(row: Presented, attributes: Sequence[str] = _ATTRIBUTES) -> list[Any]:
    """Return the values of a row's attributes, those of a tuple one after the other."""
    values = attrgetter(*attributes)(row)
    return [cell for value in values for cell in (value if type(value) is tuple else (value,))]


def trials_csv(task: Task, rows: Iterable[TrialRow]) -> str:
    """Write rows as the text of trials.csv."""
    return table_csv([column.name for column in columns_of(task)], _ATTRIBUTES, rows)


def format_value(value: object) -> str:
    """Return one value in the format of trials.csv; numbers keep their shortest exact form.

    >>> [format_value(v) for v in (None, True, 60.0, 0.25, "ok")]
    ['n/a', 'true', '60', '0.25', 'ok']
    """
    if isinstance(value, float):  # most are
        return repr(int(value)) if value.is_integer() else repr(value)
    if value is None or value == []:
        return NOT_AVAILABLE
    if isinstance(value, list):
        return "/".join(value)
    return str(value).lower() if isinstance(value, bool) else str(value)


def table_csv(headings: Sequence[str], attributes: Sequence[str], rows: Iterable[Presented]) -> str:
    """Write rows as the text of a table: commas, LF line ends, the headings first.

    `attributes` are those of a row; one that is a tuple has a heading for each of its members.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(headings)
    writer.writerows(
        [cell if type(cell) is str else format_value(cell) for cell in cells_of(row, attributes)]
        for row in rows
    )
    return text.getvalue()
