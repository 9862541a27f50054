"""The lines of a journal, each a strict model, which together define the record.

Writer, reader, verification and the JSON Schema use these models. `Line.event` names the model of a
line; the order below is roughly the order of a session. A member that is not known, or does not
apply, is ``null``.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, NamedTuple, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from device.driver import Outcome
from experiment.names import DeviceKind
from experiment.record.rows import Presented, Verified, table_csv
from experiment.study.equipment import TapName
from experiment.trial.events import Status

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from device.driver import Delivery
    from experiment.trial.events import Attempt


_Value = TypeVar("_Value")
_BySite = Annotated[tuple[_Value, ...], Field(strict=False)]
"""A value for each site of the study; a list in the journal."""


class Line(BaseModel):
    """One event in a journal, without its time.

    Every line of a session is an instance of one of the subclasses; `event` names the subclass.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )

    event: str
    """Name of the event."""


class _AttemptLine(Line):
    """A line about one attempt at one trial."""

    trial: int
    """Number of the trial in the plan, counted from 1."""
    attempt: int
    """1, or more where the trial is presented again."""


class _BurstLine(_AttemptLine):
    """A line about the burst in one interval of an attempt."""

    interval: int = 1
    """Observation interval, counted from 1."""


class HostAndDevice(BaseModel):
    """Computer and device of a visit."""

    model_config = Line.model_config

    host: str
    """Name of the computer."""
    host_boot: str | None
    """Identifier of the computer's boot, where the system gives one."""
    device: str
    """Model of the device."""
    device_kind: DeviceKind
    """Whether actuators can move."""
    serial_number: str
    """Serial number of the device."""
    boot_id: int
    """Random number of the device's power cycle: tokens hold within one."""


class VisitConditions(HostAndDevice):
    """Everything about a visit that can differ from the visit before; the plan has the rest."""

    operator: str | None
    """Name or sign of the operator."""
    responder: str
    """Name of the responder, such as ``screen``."""
    responder_distribution: str | None
    """Package and version of an installed responder."""
    driver_distribution: str | None
    """Package and version of an installed driver."""
    device_limits: dict[str, Any] | None
    """Limits as the device reports them."""
    device_health: dict[str, Any] | None
    """Supply, temperature and switch as the device reports them."""
    hardware_confirmed: dict[str, Any] | None
    """Who confirmed the safety conditions of a real device, when and how."""
    masking_noise_played: bool
    """Whether the noise is played."""
    noise_sha256: str | None
    """Checksum of the samples of the noise."""


class Header(VisitConditions):
    """header.json: everything about the first visit that the plan does not hold."""

    participant: str
    """Identifier of the participant."""
    session: str
    """Identifier of the session."""
    begun: str
    """Date and time of the beginning, UTC."""
    plan_sha256: str
    """Seal of the plan."""
    simulated: bool
    """Whether the participant is a simulation."""
    consent_version: str | None
    """Version of the consent form."""
    device_identity: dict[str, Any]
    """What the device says of itself."""
    device_cannot: list[str]
    """What the device cannot guarantee."""
    monitor: dict[str, str] | None
    """Source, tap and unit of the monitor, and what it never sees."""
    markers: str | None
    """Stream of the markers for other recordings."""
    platform: str
    """Operating system."""
    versions: dict[str, str]
    """Versions of Python, tactstrip and numpy."""


class SessionOpened(Line, HostAndDevice):
    """The session begins."""

    event: Literal["session_open"] = "session_open"
    participant: str
    """Identifier of the participant."""
    session: str
    """Identifier of the session."""
    plan_sha256: str
    """Seal of the plan."""
    simulated: bool
    """Whether the participant is a simulation."""
    observer: dict[str, Any] | None = None
    """What was drawn for a simulated participant."""
    header_sha256: str
    """Checksum of header.json."""
    plan_file_sha256: str
    """Checksum of plan.json as a file."""


class SessionResumed(Line, VisitConditions):
    """The session continues after an interruption."""

    event: Literal["session_resume"] = "session_resume"
    session_clock: Literal["goes on", "broken"]
    """``broken`` if the duration of the interruption is unknown."""


class MarkerSent(Line):
    """Other recordings received a marker, by which they are aligned to this session."""

    event: Literal["marker"] = "marker"
    marker: str
    """Text of the marker."""
    at_s: float
    """Time of the marker on the session's clock."""


class BlockStarted(Line):
    """A block begins."""

    event: Literal["block_start"] = "block_start"
    block: int
    """Number of the block; 0 is practice, -1 the hands-off trials before it."""
    condition: str
    """Name of the block's condition."""


class LevelChosen(_AttemptLine):
    """A rule chose the level of a trial. It reaches the disk together with `TrialArmed`."""

    event: Literal["level_chosen"] = "level_chosen"
    rule: str
    """Kind of the rule, such as ``bayesian``."""
    level_vpp: float
    """Level, peak-to-peak volts."""
    entropy_bits: float | None
    """Expected entropy of the threshold after the answer; null for a rule that does not use it."""


class TrialArmed(_BurstLine):
    """The device is about to be armed. This line is on the disk before the device knows the token.

    After a crash, the token is what the device is asked about.
    """

    event: Literal["trial_armed"] = "trial_armed"
    token: int
    """Token under which the device may present the stimulus once."""


class StimulusCommanded(Line):
    """The command to present the stimulus is about to be sent to the device."""

    event: Literal["stimulus_commanded"] = "stimulus_commanded"
    token: int
    """Token of the stimulus."""


class StimulusConfirmed(_BurstLine):
    """What the device reports about a stimulus."""

    event: Literal["stimulus_confirmed"] = "stimulus_confirmed"
    outcome: Annotated[Outcome, Field(strict=False)]
    """Whether the stimulus was presented."""
    token: int
    """Token of the stimulus."""
    boot_id: int
    """Power cycle of the device that answered."""
    device_us: int | None
    """Onset on the device's clock, microseconds."""
    uncertainty_s: float
    """Uncertainty of the onset."""
    retries: int
    """How often the question was sent again."""
    onset_s: float | None
    """Onset on the session's clock; known only of a stimulus that was presented."""
    levels_vpp: _BySite[float] | None
    """Level at each site, peak-to-peak volts; known only of a presented stimulus."""

    @classmethod
    def from_delivery(
        cls, attempt: Attempt, interval: int, delivery: Delivery, onset_s: float | None
    ) -> Self:
        """Return the line for a delivery; onset and levels only if it was surely presented."""
        fired = delivery.outcome is Outcome.FIRED
        return cls(
            trial=attempt.trial.number,
            attempt=attempt.number,
            interval=interval,
            outcome=delivery.outcome,
            token=delivery.token,
            boot_id=delivery.boot_id,
            device_us=delivery.device_us,
            uncertainty_s=delivery.uncertainty_s,
            retries=delivery.retries,
            onset_s=onset_s if fired else None,
            levels_vpp=delivery.levels_vpp if fired else None,
        )


class StimulusMeasured(_BurstLine):
    """What a monitor measured of the burst."""

    event: Literal["stimulus_measured"] = "stimulus_measured"
    token: int
    """Token of the stimulus."""
    tap: TapName
    """Where it was measured."""
    source: str
    """By what it was measured."""
    unit: Literal["V", "A", "um"]
    """Unit of peaks and noise."""
    burst_verified: Verified | None
    """The tap if the burst was as planned, ``false`` if not, null for a silent blank."""
    faults: list[str]
    """How the burst differs from the plan."""
    noted: list[str]
    """How it may differ, where the tap shows too little to void a trial."""
    unmeasured: str | None
    """Why it could not be measured."""
    planned: _BySite[float]
    """Planned peak at the tap of each site."""
    peaks: _BySite[float | None]
    """Measured peak at the tap of each site."""
    onset_s: float | None
    """Measured onset on the session's clock."""
    onset_uncertainty_s: float | None
    """Half-width of the 95 % interval of the onset."""
    late_s: float | None
    """Delay of the onset against the plan."""
    correlations: _BySite[float | None]
    """Correlation with the planned burst at each site."""
    noise: _BySite[float | None]
    """Effective value of the noise at each site."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredRow(Presented):
    """What a monitor measured of one trial's burst, one row of measured.csv."""

    side: str
    level_vpp: float | None
    measured: StimulusMeasured


_ELSEWHERE: Final = {"event", "trial", "attempt", "token", "interval"}
_BY_SITE: Final = {
    "planned": "planned",
    "peaks": "peak",
    "correlations": "correlation",
    "noise": "noise",
}
MEASURED_COLUMNS: Final[Mapping[str, str]] = {
    **{each.name: each.name for each in fields(MeasuredRow) if each.name != "measured"},
    **{
        f"{_BY_SITE[name]}_{{site}}" if name in _BY_SITE else name: f"measured.{name}"
        for name in StimulusMeasured.model_fields
        if name not in _ELSEWHERE
    },
    "interval": "measured.interval",
}
"""The columns of measured.csv, and the attribute of a `MeasuredRow` in each of them.

A name with ``{site}`` gives one column for each site.
"""


def measured_csv(sites: tuple[str, ...], rows: Iterable[MeasuredRow]) -> str:
    """Write measured.csv of a study with these sites.

    >>> measured_csv(("a", "b"), []).split(",")[16:20]
    ['planned_a', 'planned_b', 'peak_a', 'peak_b']
    """
    of_columns = ([name.format(site=site) for site in sites] for name in MEASURED_COLUMNS)
    headings = [*dict.fromkeys(name for names in of_columns for name in names)]
    return table_csv(headings, [*MEASURED_COLUMNS.values()], rows)


class ResponseGiven(_AttemptLine):
    """The participant answered, or did not within the response window."""

    event: Literal["response"] = "response"
    response: str
    """The answer, ``timeout`` or ``invalid``."""
    rt_s: float | None
    """Time from the onset to the answer."""
    premature: bool
    """Whether a response came before the onset or within 100 ms of it."""
    noise_ok: bool | None
    """Whether the masking noise played from the onset to the answer."""


class TrialEnded(_AttemptLine):
    """The trial is over. This line is on the disk before the next trial begins."""

    event: Literal["trial_end"] = "trial_end"
    status: Status
    """``ok``, or why the trial does not count."""
    premature: bool
    """Whether a response came before the onset or within 100 ms of it."""
    noise_ok: bool | None
    """Whether the masking noise played from the onset to the answer."""


class BlockEnded(Line):
    """A block is over."""

    event: Literal["block_end"] = "block_end"
    block: int
    """Number of the block."""


class BreakStarted(Line):
    """The participant rests."""

    event: Literal["break"] = "break"


class PauseStarted(Line):
    """The session pauses until the operator continues it."""

    event: Literal["pause"] = "pause"
    operator_called: str | None = None
    """Why the operator is called; null if the operator or the participant asked for the pause."""


class NoiseChanged(Line):
    """The masking noise stopped, started again, or had gaps."""

    event: Literal["noise_status"] = "noise_status"
    ok: bool | None
    """Whether it plays; null where none is to be played."""
    text: str
    """What is wrong, or that it plays."""
    frames: int | None = None
    """Frames that the sound card took so far."""
    underruns: int | None = None
    """How often the sound card had to wait so far."""


class DeviceFailed(Line):
    """The device or its connection failed."""

    event: Literal["fault"] = "fault"
    error: str
    """Kind of the error."""
    message: str
    """Message of the error."""


class NoteTaken(Line):
    """A note of the operator or of the program."""

    event: Literal["note"] = "note"
    text: str
    """The note."""


class SessionClosed(Line):
    """The visit ends."""

    event: Literal["session_close"] = "session_close"
    finished: bool
    """Whether every planned trial is answered; if not, the session can be resumed."""
    trials_sha256: str | None = None
    """Checksum of trials.csv, where it can be built."""
    measured_sha256: str | None = None
    """Checksum of measured.csv, where a monitor measured bursts."""


JournalLine = Annotated[
    SessionOpened
    | SessionResumed
    | MarkerSent
    | BlockStarted
    | LevelChosen
    | TrialArmed
    | StimulusCommanded
    | StimulusConfirmed
    | StimulusMeasured
    | ResponseGiven
    | TrialEnded
    | BlockEnded
    | BreakStarted
    | PauseStarted
    | NoiseChanged
    | DeviceFailed
    | NoteTaken
    | SessionClosed,
    Field(discriminator="event"),
]
"""Any line of a journal; `event` names its model."""

LINES: Final[TypeAdapter[JournalLine]] = TypeAdapter(JournalLine)
"""Validates the members of a line. ``LINES.json_schema()`` is the JSON Schema of all events.

>>> LINES.validate_python({"event": "block_end", "block": 2})
BlockEnded(event='block_end', block=2)
>>> len(LINES.json_schema()["oneOf"])
18
"""

AnyLine = TypeVar("AnyLine", bound=Line)


class Entry(NamedTuple):
    """One line of a journal with its times.

    Attributes
    ----------
    line : Line
        What the line says: an instance of a subclass of `Line`.
    t_s : float
        Time on the session's clock, in seconds.
    wall_s : float
        Calendar time of the host, in seconds since 1970. The host can adjust this clock during a
        session.
    up_s : float
        Time since the host was started, in seconds.

    Examples
    --------
    >>> entry = Entry(BlockStarted(block=1, condition="main"), t_s=12.5, wall_s=1.8e9, up_s=9.5)
    >>> entry.event, entry.t_s, entry.line.block
    ('block_start', 12.5, 1)
    """

    line: JournalLine
    t_s: float
    wall_s: float
    up_s: float

    @property
    def event(self) -> str:
        """Name of the event."""
        return self.line.event


def lines_of(entries: Iterable[Entry], kind: type[AnyLine]) -> list[AnyLine]:
    """Return the lines of one kind, in their order.

    Parameters
    ----------
    entries : iterable of Entry
        Entries of a journal.
    kind : type
        A subclass of `Line`.

    Examples
    --------
    >>> lines_of([Entry(BreakStarted(), 1.0, 1.8e9, 2.0)], BreakStarted)
    [BreakStarted(event='break')]
    """
    return [entry.line for entry in entries if isinstance(entry.line, kind)]
