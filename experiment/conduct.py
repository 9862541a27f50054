"""A session from its folder to its trials.csv: begun anew, or resumed after an interruption."""

from __future__ import annotations

import contextlib
import platform
import time
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from device.driver import Outcome
from experiment.archive import ArchiveError
from experiment.record import NOT_AVAILABLE
from experiment.safety import require_confirmed
from experiment.session import Session, delivery_facts, trial_name
from experiment.stimulus import host_limits, require_suitable, stimulus_facts
from experiment.study import study_from_canonical
from experiment.study_check import check_study

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from device.clock import Clock
    from device.driver import BurstDevice, DeviceError, Identity
    from experiment.archive import SessionFolder
    from experiment.interrupts import StopSignal
    from experiment.journal import Journal
    from experiment.plan import Plan
    from experiment.replay import History, OpenTrial
    from experiment.responder import Responder
    from experiment.safety import Confirmation
    from experiment.study import Study

LONGEST_INTERRUPTION_S = 30 * 60
"""After a longer one, plate, fingers and noise may not be what they were."""


def _tell_nobody(_: str) -> None:
    """Tell nobody: a simulation has no operator."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What a session is run with.

    Attributes
    ----------
    device : BurstDevice
        The actuators.
    responder : Responder
        The participant.
    clock : Clock
        The clock of both.
    stop : StopSignal
        Tells that the session is to be stopped.
    resume_anyway : bool
        The operator's word that a session may go on although host or device changed, or much time
        went by.
    confirmation : Confirmation or None
        The operator's word that a real device is safe; an emulator needs none.
    tell : callable
        Is given, before the first trial, each line about what the device cannot promise.
    """

    device: BurstDevice
    responder: Responder
    clock: Clock
    stop: StopSignal
    resume_anyway: bool = False
    confirmation: Confirmation | None = None
    tell: Callable[[str], object] = _tell_nobody


@dataclass(frozen=True, slots=True, kw_only=True)
class Ending:
    """How a session ended.

    Attributes
    ----------
    finished : bool
        Whether every planned trial is answered.
    failure : DeviceError or None
        What the device failed with, if it did.
    trials_path : Path
        The trials.csv.
    torn_file : Path or None
        Where a last journal line that was cut short was put.
    """

    finished: bool
    failure: DeviceError | None
    trials_path: Path
    torn_file: Path | None


def begin(folder: SessionFolder, plan: Plan, setting: Setting) -> Ending:
    """Create a session's folder and run the session.

    Raises
    ------
    ArchiveError
        If the session exists already, or another process holds it.
    NotConfirmedError, SuitabilityError
        If nobody confirmed that a real device is safe, or it cannot do what the study asks; no
        session is created then.
    DeviceError
        If the device cannot be opened; no session is created then.
    JournalWriteError
        If the record cannot be kept.
    """
    folder.refuse_existing()
    study = study_from_canonical(plan.study)
    with folder.locked(), _opened(setting, study) as identity:
        folder.create(plan, _header(study, plan, setting, identity))
        return _run(folder, study, plan, setting, identity)


def resume(folder: SessionFolder, setting: Setting) -> Ending:
    """Go on with a session that was interrupted; a finished one only gets its trials.csv again.

    Raises
    ------
    ArchiveError
        If there is no session, another process holds it, or it may not go on here and now.
    JournalError, PlanError
        If journal or plan cannot be trusted; nothing is changed then.
    NotConfirmedError, SuitabilityError
        If nobody confirmed that a real device is safe, or it cannot do what the study asks.
    DeviceError
        If the device cannot be opened.
    JournalWriteError
        If the record cannot be kept.
    """
    plan = folder.read_plan()
    study = study_from_canonical(plan.study)
    with folder.locked(), _opened(setting, study) as identity:
        return _run(folder, study, plan, setting, identity)


@contextlib.contextmanager
def _opened(setting: Setting, study: Study) -> Iterator[Identity]:
    device = setting.device
    identity = device.open()
    try:
        require_confirmed(identity, setting.confirmation)
        require_suitable(study, identity)
        for promise in device.cannot:
            setting.tell(f"Note: this device cannot {promise}.")
        yield identity
    finally:
        device.close()


def _run(
    folder: SessionFolder, study: Study, plan: Plan, setting: Setting, identity: Identity
) -> Ending:
    history = folder.read_history(plan)
    origin_s = setting.clock.now_s()
    if history.opening:
        origin_s -= history.last_t_s + max(0.0, time.time() - history.last_wall_s)
    if history.opening and not history.finished:
        _refuse_another_place(history, identity, setting)
    with folder.open_journal(lambda: setting.clock.now_s() - origin_s) as journal:
        finished, failure = history.finished, None
        if not finished:
            _enter(
                study=study,
                plan=plan,
                history=history,
                journal=journal,
                setting=setting,
                identity=identity,
            )
            session = Session(
                study=study,
                plan=plan,
                history=folder.read_history(plan),
                resumed=bool(history.opening),
                device=setting.device,
                responder=setting.responder,
                clock=setting.clock,
                origin_s=origin_s,
                journal=journal,
                stop=setting.stop,
            )
            finished = session.run()
            failure = session.failure
        return Ending(
            finished=finished,
            failure=failure,
            trials_path=folder.write_trials(),
            torn_file=journal.torn_file,
        )


def _enter(
    *,
    study: Study,
    plan: Plan,
    history: History,
    journal: Journal,
    setting: Setting,
    identity: Identity,
) -> None:
    """Note the beginning, or the resume; there, settle the trial that is still open."""
    if not history.opening:
        journal.append("session_open", _opening(plan, identity, setting), sync=True)
        return
    again = _place(identity) | {"hardware_confirmed": _confirmed(setting, identity)}
    journal.append("session_resume", again, sync=True)
    if history.open_trial is not None:
        same_boot = history.open_trial.boot_id == identity.boot_id
        _settle(history.open_trial, study, journal, setting.device, same_boot=same_boot)


def _settle(
    open_trial: OpenTrial, study: Study, journal: Journal, device: BurstDevice, *, same_boot: bool
) -> None:
    """Write the end of the trial in which the session was interrupted.

    An answer that was still written stands, unless it was anticipated and the study repeats such
    trials. A stimulus that went out is voided, one that did not is aborted; where the device cannot
    tell, or was started anew, the trial is indeterminate.
    """
    name = trial_name(open_trial.task)
    outcome = open_trial.outcome
    if outcome is None:
        device.disarm(open_trial.token)
        delivery = device.query(open_trial.token)
        if delivery.outcome is Outcome.NOT_FIRED and not same_boot:
            delivery = replace(delivery, outcome=Outcome.INDETERMINATE)
        journal.append("stimulus_confirmed", name | delivery_facts(delivery, None))
        outcome = delivery.outcome
    again = open_trial.anticipated and study.design.anticipated == "requeue"
    if outcome == Outcome.FIRED:
        status = "ok" if open_trial.response is not None and not again else "voided"
    else:
        status = "aborted" if outcome == Outcome.NOT_FIRED else "indeterminate"
    end = {"status": status, "anticipated": open_trial.anticipated}
    journal.append("trial_end", name | end, sync=True)


def _refuse_another_place(history: History, identity: Identity, setting: Setting) -> None:
    """Refuse another kind of participant; another place or time, unless the operator says so."""
    if setting.responder.simulated != history.opening["simulated"]:
        who = "a simulated participant" if history.opening["simulated"] else "a person"
        raise ArchiveError(
            f"the session was begun with {who} and can only go on so: give another --responder"
        )
    if setting.resume_anyway:
        return
    here = _place(identity)
    for what in ("host", "device", "serial_number"):
        if here[what] != history.opening[what]:
            raise ArchiveError(
                f"the session was begun with {what} {history.opening[what]!r}; got {here[what]!r}: "
                "give --resume-anyway if that makes no difference"
            )
    gap_s = time.time() - history.last_wall_s
    if gap_s > LONGEST_INTERRUPTION_S:
        raise ArchiveError(
            f"the session was interrupted {gap_s / 60:.0f} minutes ago, the most is "
            f"{LONGEST_INTERRUPTION_S / 60:.0f}: give --resume-anyway if fingers, plate and noise "
            "are as they were"
        )


def _place(identity: Identity) -> dict[str, Any]:
    return {
        "host": platform.node(),
        "device": identity.model,
        "serial_number": identity.serial_number,
        "boot_id": identity.boot_id,
    }


def _opening(plan: Plan, identity: Identity, setting: Setting) -> dict[str, Any]:
    return {
        "participant": plan.participant,
        "session": plan.session,
        "plan_sha256": plan.sha256,
        "simulated": setting.responder.simulated,
        **_place(identity),
    }


def _confirmed(setting: Setting, identity: Identity) -> dict[str, Any] | str:
    """Return the word that a real device is safe; one given for an emulator says nothing."""
    if setting.confirmation is None or identity.emulated:
        return NOT_AVAILABLE
    return setting.confirmation.facts


_UNKNOWN_YET = (
    "calibration",
    "consent_version",
    "noise_level_dba",
    "noise_sha256",
    "operator",
    "screen",
)


def _header(study: Study, plan: Plan, setting: Setting, identity: Identity) -> dict[str, Any]:
    """List what is worth knowing of a session and is not part of the plan."""
    check = check_study(study, plan.gains)
    accepted = [c.condition for c in check.conditions if c.verdict == "accepted"]
    return {
        "schema": 1,
        "begun": datetime.now(UTC).isoformat(timespec="seconds"),
        **_opening(plan, identity, setting),
        "device_identity": asdict(identity),
        "device_cannot": list(setting.device.cannot),
        "hardware_confirmed": _confirmed(setting, identity),
        "limits": asdict(host_limits(study.device)),
        "responses": plan.responses,
        "masking_noise": study.masking.noise,
        "masking_noise_played": False,
        "stimuli": {c.name: stimulus_facts(c) for c in study.conditions},
        "unfit_stimuli_accepted": {c.name: c.accept_unfit for c in accepted},
        "platform": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in ("tactstrip", "numpy")},
        **dict.fromkeys(_UNKNOWN_YET, NOT_AVAILABLE),
    }
