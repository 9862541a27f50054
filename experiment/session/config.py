"""What a session runs with, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from experiment.hardware.safety import Purpose
from experiment.names import is_line
from experiment.operator.requests import Requests

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from device.clock import Clock
    from device.driver import BurstDevice
    from device.errors import DeviceError
    from device.monitor.measured import Monitor
    from experiment.hardware.noise import NoisePlayer
    from experiment.hardware.safety import Confirmation
    from experiment.operator.requests import Status, StopSignal
    from experiment.session.markers import LslMarkers
    from experiment.trial.responder import Responder


MAX_NAME_CHARACTERS: Final = 100


def require_operator(name: str | None) -> None:
    """Raise ValueError unless the operator's name, if one is given, is a short line of text.

    Examples
    --------
    >>> require_operator(" ")
    Traceback (most recent call last):
    ValueError: operator must be a name in one line of text, of at most 100 characters; got ' '
    """
    if name is not None and not (is_line(name) and len(name) <= MAX_NAME_CHARACTERS):
        raise ValueError(
            "operator must be a name in one line of text, of at most "
            f"{MAX_NAME_CHARACTERS} characters; got {name!r}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionConfig:
    """What a session is run with.

    Attributes
    ----------
    device : BurstDevice
        The actuators.
    responder : Responder
        The participant.
    noise : NoisePlayer
        The masking noise; it is started before the session, and stopped after it.
    clock : Clock
        The clock of device and participant.
    stop : StopSignal
        Requests that the session stops.
    resume, resume_anyway : bool
        Whether the session is resumed; ``resume_anyway`` also on another host or device, or after
        more than half an hour.
    purpose : Purpose
        What the session is held for: data need a real device if the participant is a person.
    confirmation : Confirmation or None
        The operator's confirmation that a real device is safe; an emulator needs none.
    report : callable
        Receives each line that the operator has to know.
    requests : Requests
        What the operator requests while the session runs.
    show : callable
        Receives each new status for the operator; it must return at once and touch no disk.
    responder_name : str
        A word of `RESPONDERS`, or the name of an installed responder, for the record.
    operator : str or None
        The operator's name or sign.
    responder_from, driver_from : str or None
        The distributions, with versions, of an installed responder and driver.
    markers : LslMarkers or None
        Where markers for other recordings go.
    monitor : Monitor or None
        What measures every burst; without one nothing is verified.

    Examples
    --------
    >>> from device import VirtualClock
    >>> from experiment import draw_plan, paper_study
    >>> from experiment.hardware.noise import SilentNoise
    >>> from experiment.hardware.setup import mock_device
    >>> from experiment.operator.requests import StopSignal
    >>> from experiment.session.simulate import simulated_responder
    >>> study, clock = paper_study(), VirtualClock()
    >>> plan = draw_plan(study, participant="01", session="01", seed=1)
    >>> config = SessionConfig(device=mock_device(study, clock), clock=clock, stop=StopSignal(),
    ...                        responder=simulated_responder(study, plan, clock),
    ...                        noise=SilentNoise())
    >>> config.resume, config.purpose.value, config.monitor
    (False, 'data', None)
    """

    device: BurstDevice
    responder: Responder
    noise: NoisePlayer
    clock: Clock
    stop: StopSignal
    resume: bool = False
    resume_anyway: bool = False
    purpose: Purpose = Purpose.DATA
    confirmation: Confirmation | None = None
    report: Callable[[str], object] = lambda _: None
    requests: Requests = field(default_factory=Requests)
    show: Callable[[Status], object] = lambda _: None
    responder_name: str = "simulated"
    operator: str | None = None
    responder_from: str | None = None
    driver_from: str | None = None
    markers: LslMarkers | None = None
    monitor: Monitor | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionResult:
    """How a visit to a session ended.

    Attributes
    ----------
    finished : bool
        Whether every planned trial is done.
    unanswered : int
        Number of planned trials that are done, without an answer in time.
    failure : DeviceError or None
        The failure of the device that ended the visit.
    trials_path : Path
        The trials.csv.
    torn_file : Path or None
        Where an incomplete last line of the journal was moved.
    head_sha256 : str
        The hash of the journal's last line.
    """

    finished: bool
    unanswered: int
    failure: DeviceError | None
    trials_path: Path
    torn_file: Path | None
    head_sha256: str
