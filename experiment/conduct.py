"""A session from its folder to its trials.csv: begun anew, or resumed after an interruption."""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from experiment.header import header, opening, resuming
from experiment.operator import Requests
from experiment.resumption import refuse_another_place, settle
from experiment.safety import require_confirmed
from experiment.session import Session
from experiment.sitting import Sitting
from experiment.stimulus import require_suitable
from experiment.study import study_from_canonical

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from device.clock import Clock
    from device.driver import BurstDevice, DeviceError, Identity
    from experiment.archive import SessionFolder
    from experiment.interrupts import StopSignal
    from experiment.journal import Journal
    from experiment.noise_player import NoisePlayer
    from experiment.operator import Monitor, Status
    from experiment.plan import Plan
    from experiment.replay import History
    from experiment.responder import Responder
    from experiment.safety import Confirmation
    from experiment.study import Study


def _tell_nobody(_: str) -> None:
    """Tell nobody: a simulation has no operator."""


class NobodyLooks:
    """The monitor of a session that no operator looks at."""

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
    tell : callable
        Is given, before the first trial, each line about what the device cannot promise.
    requests : Requests
        What the operator asks for while it runs.
    monitor : Monitor
        Is shown how it stands.
    sitting : Sitting
        Who answers and who operates, for the record.
    """

    device: BurstDevice
    responder: Responder
    noise: NoisePlayer
    clock: Clock
    stop: StopSignal
    resume_anyway: bool = False
    confirmation: Confirmation | None = None
    tell: Callable[[str], object] = _tell_nobody
    requests: Requests = field(default_factory=Requests)
    monitor: Monitor = field(default_factory=NobodyLooks)
    sitting: Sitting = field(default_factory=Sitting)


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
    DeviceError, NoiseError
        If the device cannot be opened, or the noise not be played; no session is created then.
    JournalWriteError
        If the record cannot be kept.
    """
    folder.refuse_existing()
    study = study_from_canonical(plan.study)
    with folder.locked(), _opened(setting, study) as identity, _playing(setting.noise):
        folder.create(plan, header(study, plan, setting, identity))
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
    DeviceError, NoiseError
        If the device cannot be opened, or the noise not be played.
    JournalWriteError
        If the record cannot be kept.
    """
    plan = folder.read_plan()
    study = study_from_canonical(plan.study)
    with folder.locked(), _opened(setting, study) as identity:
        history = folder.read_history(plan)
        if history.finished:
            return _run(folder, study, plan, setting, identity)
        if history.opening:
            refuse_another_place(history, identity, setting)
        with _playing(setting.noise):
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


@contextlib.contextmanager
def _playing(noise: NoisePlayer) -> Iterator[None]:
    try:
        noise.start()
        yield
    finally:
        noise.stop()


def _run(
    folder: SessionFolder, study: Study, plan: Plan, setting: Setting, identity: Identity
) -> Ending:
    history = folder.read_history(plan)
    origin_s = setting.clock.now_s()
    if history.opening:
        origin_s -= history.last_t_s + max(0.0, time.time() - history.last_wall_s)
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
                noise=setting.noise,
                clock=setting.clock,
                origin_s=origin_s,
                journal=journal,
                requests=setting.requests,
                monitor=setting.monitor,
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
        journal.append("session_open", opening(plan, identity, setting), sync=True)
        return
    journal.append("session_resume", resuming(study, plan, identity, setting), sync=True)
    if history.open_trial is not None:
        same_boot = history.open_trial.boot_id == identity.boot_id
        settle(history.open_trial, study, journal, setting.device, same_boot=same_boot)
