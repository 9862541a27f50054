"""With what and whom a session runs, and what its header and journal say of that."""

from __future__ import annotations

import platform
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from functools import lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final

from device.clock import boot
from device.driver import Outcome
from experiment.apparatus.monitor import monitor_facts
from experiment.apparatus.rig import device_kind, line_settings
from experiment.apparatus.slots import host_limits, told_health, told_limits
from experiment.archive.history import BROKEN
from experiment.check.check import check_study
from experiment.names import is_line
from experiment.operator.requests import Requests
from experiment.rows import ANSWERS, NOT_AVAILABLE
from experiment.session.markers import Markers, NoMarkers
from experiment.study.presentation import UNTYPED
from experiment.study.stimulus import stimulus_facts

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from device.clock import Clock
    from device.core.reports import DeviceLimits, Health
    from device.driver import BurstDevice, Delivery, Identity
    from device.errors import DeviceError
    from device.monitor.measured import Monitor
    from experiment.apparatus.noise import NoiseFacts, NoisePlayer
    from experiment.apparatus.rig import Confirmation
    from experiment.check.check import StudyCheck
    from experiment.operator.requests import Display, Status, StopSignal
    from experiment.study.study import Study
    from experiment.trial.events import Task
    from experiment.trial.plan import Plan
    from experiment.trial.responder import Responder


def trial_name(task: Task) -> dict[str, object]:
    """List how the journal names an attempt at a trial."""
    return {"trial": task.trial.number, "attempt": task.attempt}


def delivery_facts(delivery: Delivery, onset_s: float | None) -> dict[str, object]:
    """List what the journal keeps of a delivery; onset and levels only if it surely went out."""
    fired = delivery.outcome is Outcome.FIRED
    return {
        "outcome": delivery.outcome.value,
        "token": delivery.token,
        "boot_id": delivery.boot_id,
        "device_us": delivery.device_us,
        "onset_s": onset_s if fired else None,
        "uncertainty_s": delivery.uncertainty_s,
        "retries": delivery.retries,
        "level_left_vpp": delivery.level_left_vpp if fired else None,
        "level_right_vpp": delivery.level_right_vpp if fired else None,
    }


def fault_facts(error: DeviceError) -> dict[str, object]:
    """List what the journal keeps of a device's fault."""
    return {"error": type(error).__name__, "message": str(error)}


LONGEST_NAME: Final = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Sitting:
    """Who answers in a sitting, and who watches over it.

    Attributes
    ----------
    responder : str
        A word of `RESPONDERS`, or the name of an installed one.
    operator : str or None
        The operator's name or sign, where it was given.
    responder_from, driver_from : str or None
        Which distributions they are of, and their versions, where they are a lab's own.

    Raises
    ------
    ValueError
        If the operator's name is no short line of text.

    Examples
    --------
    >>> Sitting(operator=" ")
    Traceback (most recent call last):
    ValueError: operator must be a name in one line of text, of at most 100 characters; got ' '
    """

    responder: str = "simulated"
    operator: str | None = None
    responder_from: str | None = None
    driver_from: str | None = None

    def __post_init__(self) -> None:
        name = self.operator
        if name is not None and not (is_line(name) and len(name) <= LONGEST_NAME):
            raise ValueError(
                "operator must be a name in one line of text, of at most "
                f"{LONGEST_NAME} characters; got {name!r}"
            )

    def facts(self, study: Study, plan: Plan) -> dict[str, Any]:
        """List what may be another one whenever a session goes on: people and keys."""
        return {
            "operator": NOT_AVAILABLE if self.operator is None else self.operator,
            "responder": self.responder,
            "responder_distribution": _or_not(self.responder_from),
            "driver_distribution": _or_not(self.driver_from),
            "response_mapping": _mapping(self.responder, study, plan) or NOT_AVAILABLE,
        }

    def header(self, study: Study, plan: Plan) -> dict[str, Any]:
        """List what a header keeps: the sitting, the consent form, what was shown."""
        screen, nobody = self.responder == "screen", self.responder == "simulated"
        return {
            **self.facts(study, plan),
            "consent_version": study.about.consent_version or NOT_AVAILABLE,
            "screen": asdict(study.screen) if screen else NOT_AVAILABLE,
            "texts": NOT_AVAILABLE if nobody else asdict(study.shown_texts),
        }


def _mapping(responder: str, study: Study, plan: Plan) -> dict[str, list[str]]:
    """Return the keys of every answer that is accepted in some trial, and of the wishes.

    None of a responder whose keys are its own business.
    """
    from experiment.trial.plan import CONTROL

    if responder not in {"screen", "terminal"}:
        return {}
    untyped = UNTYPED if responder == "terminal" else frozenset()
    keys = {
        meaning: [name for name in names if name not in untyped]
        for meaning, names in asdict(study.keys).items()
    }
    accepted = {*plan.responses}
    if any(trial.kind == CONTROL for trial in plan.trials):
        accepted.add("none")
    return {
        meaning: names
        for meaning, names in keys.items()
        if meaning not in ANSWERS or meaning in accepted
    }


def header(study: Study, plan: Plan, setting: Setting, identity: Identity) -> dict[str, Any]:
    """List what is worth knowing of a session and is not part of the plan."""
    return {
        "schema": 1,
        "begun": datetime.now(UTC).isoformat(timespec="seconds"),
        **opening(plan, identity, setting),
        **setting.sitting.header(study, plan),
        "device_identity": asdict(identity),
        **_of_device(setting.device),
        "device_line": asdict(line_settings(study.device)),
        "device_cannot": list(setting.device.cannot),
        "markers": _or_not(setting.markers.words),
        "monitor": monitor_facts(setting.monitor),
        "hardware_confirmed": _confirmed(setting, identity),
        "limits": asdict(host_limits(study.device)),
        "responses": plan.responses,
        "participant_number": _or_not(plan.participant_number),
        "condition_order": plan.condition_order,
        **noise_facts(setting.noise.facts),
        "stimuli": {c.name: stimulus_facts(c) for c in study.conditions},
        "unfit_stimuli_accepted": dict(
            _accepted(study) if plan.gains else _reasons(check_study(study, ()))
        ),
        "platform": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in ("tactstrip", "numpy")},
        "contact": asdict(study.contact) | {"words": study.contact.words},
    }


# A plan's gains are of one loss and have no doubt: what was accepted for the worst loss, or for
# what is not known of patches, shows only where all is computed. Once a study, which may have a
# hundred simulated sessions, and not at all where no reason is stated.
@lru_cache(maxsize=1)
def _accepted(study: Study) -> tuple[tuple[str, str], ...]:
    """List the conditions whose unfit stimuli a study accepts, each with its reason."""
    if all(condition.accept_unfit is None for condition in study.conditions):
        return ()
    return _reasons(check_study(study))


def _reasons(check: StudyCheck) -> tuple[tuple[str, str], ...]:
    accepted = [c.condition for c in check.conditions if c.verdict == "accepted"]
    return tuple((one.name, one.accept_unfit or "") for one in accepted)


def opening(plan: Plan, identity: Identity, setting: Setting) -> dict[str, Any]:
    """List what a session's first journal line says."""
    return {
        "participant": plan.participant,
        "session": plan.session,
        "plan_sha256": plan.sha256,
        "simulated": setting.responder.simulated,
        **_simulated_person(setting.responder),
        **place(identity),
    }


def _simulated_person(responder: Responder) -> dict[str, Any]:
    """Tell whom our own simulation drew; a lab's own says nothing of whom it simulates."""
    facts = getattr(responder, "observer_facts", None)
    return {"observer": facts} if responder.simulated and isinstance(facts, dict) else {}


def resuming(
    study: Study, plan: Plan, identity: Identity, setting: Setting, *, clock_goes_on: bool
) -> dict[str, Any]:
    """List what the first journal line of a later sitting says."""
    return {
        **place(identity),
        "session_clock": "goes on" if clock_goes_on else BROKEN,
        **setting.sitting.facts(study, plan),
        **_of_device(setting.device),
        "hardware_confirmed": _confirmed(setting, identity),
        **noise_facts(setting.noise.facts),
    }


def _of_device(device: BurstDevice) -> dict[str, Any]:
    """List what the device says of itself, which new firmware may have changed since."""
    return {
        "device_limits": _facts(told_limits(device)),
        "device_health": _facts(told_health(device)),
    }


def place(identity: Identity) -> dict[str, Any]:
    """List on which host and device a session goes on."""
    return {
        "host": platform.node(),
        "host_boot": boot() or NOT_AVAILABLE,
        "device": identity.model,
        "device_kind": device_kind(identity),
        "serial_number": identity.serial_number,
        "boot_id": identity.boot_id,
    }


def noise_facts(facts: NoiseFacts) -> dict[str, Any]:
    """List what is kept of the masking noise; what is not known, or does not apply, is ``n/a``.

    Examples
    --------
    >>> from experiment.apparatus.noise import NoiseFacts
    >>> kept = noise_facts(NoiseFacts(noise="none", played=False))
    >>> kept["masking_noise_played"], kept["noise_level_dba"]
    (False, 'n/a')
    """
    return {
        "masking_noise": facts.noise,
        "masking_noise_played": facts.played,
        "noise_level_dba": _or_not(facts.measured_level_dba),
        "noise_max_level_dba": _or_not(facts.max_level_dba),
        "noise_sha256": _or_not(facts.sha256),
        "noise_sample_rate_hz": _or_not(facts.sample_rate_hz),
        "noise_loop_s": _or_not(facts.loop_s),
        "noise_sound_card": _or_not(facts.sound_card),
    }


def _facts(told: DeviceLimits | Health | None) -> dict[str, Any] | str:
    return NOT_AVAILABLE if told is None else asdict(told)


def _or_not(value: float | str | None) -> float | str:
    return NOT_AVAILABLE if value is None else value


def _confirmed(setting: Setting, identity: Identity) -> dict[str, Any] | str:
    """Return the word that a real device is safe; one given for an emulator says nothing."""
    if setting.confirmation is None or identity.emulated:
        return NOT_AVAILABLE
    return setting.confirmation.facts


def _tell_nobody(_: str) -> None:
    """Tell nobody: a simulation has no operator."""


class NobodyLooks:
    """The display of a session that no operator looks at."""

    def show(self, status: Status) -> None:
        """Show nothing."""


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
    tell : callable
        Is given, before the first trial, each line about what the device cannot promise.
    requests : Requests
        What the operator asks for while it runs.
    display : Display
        Is shown how it stands.
    sitting : Sitting
        Who answers and who operates, for the record.
    markers : Markers
        Where markers for other recordings go.
    monitor : Monitor or None
        What measures every burst; without one nothing is verified.

    Examples
    --------
    >>> from device import VirtualClock
    >>> from experiment import draw_plan, paper_study
    >>> from experiment.apparatus.noise import SilentNoise
    >>> from experiment.apparatus.rig import mock_device
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
    tell: Callable[[str], object] = _tell_nobody
    requests: Requests = field(default_factory=Requests)
    display: Display = field(default_factory=NobodyLooks)
    sitting: Sitting = field(default_factory=Sitting)
    markers: Markers = field(default_factory=NoMarkers)
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
