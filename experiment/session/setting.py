"""With what and whom a session runs, and what its header and journal say of that."""

from __future__ import annotations

import platform
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from functools import lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final

from device.clock import boot
from experiment.archive.entries import HostAndDevice, VisitConditions
from experiment.check.check import check_study
from experiment.hardware.monitor import monitor_facts
from experiment.hardware.safety import device_kind
from experiment.hardware.setup import host_limits, line_settings, read_health, read_limits
from experiment.names import is_line
from experiment.operator.requests import Requests
from experiment.rows import HANDS_OFF, NOT_AVAILABLE
from experiment.study.key_names import UNTYPED
from experiment.study.stimulus import stimulus_values

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from device.clock import Clock
    from device.driver import BurstDevice, Identity
    from device.errors import DeviceError
    from device.monitor.measured import Monitor
<<<<<<< HEAD
    from experiment.hardware.noise import NoisePlayer
    from experiment.hardware.setup import Confirmation
=======
    from experiment.hardware.noise import NoiseFacts, NoisePlayer
    from experiment.hardware.safety import Confirmation
>>>>>>> fe83712a (Set hardware up, confirm it and judge its suitability in a module each)
    from experiment.operator.requests import Status, StopSignal
    from experiment.session.markers import LslMarkers
    from experiment.study.study import Study
    from experiment.trial.plan import Plan
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


def header(study: Study, plan: Plan, setting: Setting, identity: Identity) -> dict[str, Any]:
    """Return the contents of header.json: what is worth knowing and is not part of the plan.

    A value that is not known, or does not apply, is ``n/a``.
    """
    is_simulated = setting.responder_name == "simulated"
    contents = {
        "schema": 1,
        "begun": datetime.now(UTC).isoformat(timespec="seconds"),
        "participant": plan.participant,
        "session": plan.session,
        "plan_sha256": plan.sha256,
        "simulated": setting.responder.simulated,
        **visit_conditions(study, plan, setting, identity).model_dump(),
        "consent_version": study.about.consent_version or None,
        "screen": study.screen.model_dump() if setting.responder_name == "screen" else None,
        "texts": None if is_simulated else study.texts.model_dump(by_alias=True),
        "device_identity": asdict(identity),
        "device_line": asdict(line_settings(study.device)),
        "device_cannot": list(setting.device.cannot),
        "markers": setting.markers and setting.markers.description,
        "monitor": monitor_facts(setting.monitor),
        "limits": asdict(host_limits(study.device)),
        "responses": plan.responses,
        "participant_number": plan.participant_number,
        "condition_order": plan.condition_order,
        "stimuli": {c.name: stimulus_values(c) for c in study.conditions},
        "accepted_violations": _accepted_violations(study, has_gains=bool(plan.gains)),
        "platform": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in ("tactstrip", "numpy")},
        "contact": study.contact.model_dump() | {"summary": study.contact.summary},
    }
    return {key: NOT_AVAILABLE if value is None else value for key, value in contents.items()}


def drawn_observer(responder: Responder) -> dict[str, Any] | None:
    """Return what was drawn for a simulated participant; None for anybody else.

    An installed simulated responder has no such values.
    """
    observer = getattr(responder, "observer_facts", None) if responder.simulated else None
    return observer if isinstance(observer, dict) else None


def host_and_device(identity: Identity) -> HostAndDevice:
    """Return the computer and the device of a visit."""
    return HostAndDevice(
        host=platform.node(),
        host_boot=boot(),
        device=identity.model,
        device_kind=device_kind(identity),
        serial_number=identity.serial_number,
        boot_id=identity.boot_id,
    )


def visit_conditions(
    study: Study, plan: Plan, setting: Setting, identity: Identity
) -> VisitConditions:
    """Return everything about a visit that can differ from the visit before."""
    limits, health = read_limits(setting.device), read_health(setting.device)
    # An emulator needs no confirmation, so that one that was given is not recorded.
    confirmation = None if identity.emulated else setting.confirmation
    noise = setting.noise.facts
    return VisitConditions(
        **host_and_device(identity).model_dump(),
        operator=setting.operator,
        responder=setting.responder_name,
        responder_distribution=setting.responder_from,
        driver_distribution=setting.driver_from,
        response_mapping=_response_mapping(setting.responder_name, study, plan),
        device_limits=None if limits is None else asdict(limits),
        device_health=None if health is None else asdict(health),
        hardware_confirmed=None if confirmation is None else asdict(confirmation),
        masking_noise=noise.noise,
        masking_noise_played=noise.played,
        noise_level_dba=noise.measured_level_dba,
        noise_max_level_dba=noise.max_level_dba,
        noise_sha256=noise.sha256,
        noise_sample_rate_hz=noise.sample_rate_hz,
        noise_loop_s=noise.loop_s,
        noise_sound_card=noise.sound_card,
    )


def _response_mapping(responder: str, study: Study, plan: Plan) -> dict[str, list[str]] | None:
    """Return the keys of pause and continue, and of every answer accepted in some trial.

    The keys of an installed responder are not known.
    """
    if responder not in {"screen", "terminal"}:
        return None
    untyped = UNTYPED if responder == "terminal" else frozenset()
    hands_off = any(trial.kind == HANDS_OFF for trial in plan.trials)
    accepted = study.task.offered(plan.responses, hands_off=hands_off)
    return {
        meaning: [name for name in names if name not in untyped]
        for meaning, names in study.keys.meanings.items()
        if meaning in accepted or meaning not in study.task.answer_names
    }


# The gains in a plan are those of one loss factor, without an uncertainty: what was accepted for
# the largest loss, or for unknown patches, shows only if everything is computed. That is done once
# for a study, which may have a hundred simulated sessions, and only if it states a reason.
@lru_cache(maxsize=1)
def _accepted_violations(study: Study, *, has_gains: bool) -> dict[str, str | None]:
    """Return the study's reason for each condition whose burst violates a limit."""
    if all(condition.accept_violation is None for condition in study.conditions):
        return {}
    check = check_study(study) if has_gains else check_study(study, ())
    accepted = (c.condition for c in check.conditions if c.verdict == "accepted")
    return {condition.name: condition.accept_violation for condition in accepted}


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
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
        Tells that the session is to be stopped.
    resume_anyway : bool
        The operator's word that a session may go on although host or device changed, or much time
        went by.
    confirmation : Confirmation or None
        The operator's word that a real device is safe; an emulator needs none.
    practice : bool
        The operator's word that a person tries it out on a device that moves nothing.
    report : callable
        Is given, before the first trial, each line about what the device cannot promise.
    requests : Requests
        What the operator asks for while it runs.
    show : callable
        Is given each new status for the operator; it returns at once and touches no disk.
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
    >>> setting = Setting(device=mock_device(study, clock), clock=clock, stop=StopSignal(),
    ...                   responder=simulated_responder(study, plan, clock),
    ...                   noise=SilentNoise(study.masking))
    >>> setting.resume_anyway, setting.practice, setting.monitor
    (False, False, None)
    """

    device: BurstDevice
    responder: Responder
    noise: NoisePlayer
    clock: Clock
    stop: StopSignal
    resume_anyway: bool = False
    confirmation: Confirmation | None = None
    practice: bool = False
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
class Ending:
    """How a session ended.

    Attributes
    ----------
    finished : bool
        Whether every planned trial is done.
    unanswered : int
        The planned trials that are done and had no answer in their time.
    failure : DeviceError or None
        What the device failed with, if it did.
    trials_path : Path
        The trials.csv.
    torn_file : Path or None
        Where a last journal line that was cut short was put.
    head_sha256 : str
        The hash of the journal's last line.
    """

    finished: bool
    unanswered: int
    failure: DeviceError | None
    trials_path: Path
    torn_file: Path | None
    head_sha256: str
