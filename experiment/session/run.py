"""The life cycle of a session: it begins or resumes, runs, and finishes with its tables."""

from __future__ import annotations

import contextlib
import secrets
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Final

from device.clock import MonotonicClock, elapsed_s, machine_time
from device.drivers import guarded_device
from experiment.check.check import require_fit
from experiment.hardware.noise import noise_player
from experiment.hardware.safety import Purpose, confirmed_now, require_confirmed, require_device
from experiment.hardware.setup import read_limits
from experiment.hardware.suitability import require_suitable
from experiment.operator.requests import StopSignal
from experiment.record.entries import NoteTaken, SessionOpened, SessionResumed
from experiment.record.files import SESSIONS_TABLE, ArchiveError
from experiment.record.folder import SessionFolder
from experiment.record.index import SessionSeal, read_seals, write_seal
from experiment.record.journal import JournalWriteError
from experiment.record.verify import refuse_modified
from experiment.session.config import SessionConfig, SessionResult, require_operator
from experiment.session.header import (
    drawn_observer,
    header,
    host_and_device,
    visit_conditions,
)
from experiment.session.markers import LslMarkers, await_recorder
from experiment.session.participant import require_responder
from experiment.session.resolve import resolve_interrupted_trial
from experiment.session.session import Session
from experiment.study.base import Fault
from experiment.trial.draw import draw_plan

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from device.clock import Clock
    from device.driver import BurstDevice, Identity
    from device.errors import DeviceError
    from experiment.record.history import History
    from experiment.record.journal import Journal
    from experiment.study.files import Levels
    from experiment.study.study import Study
    from experiment.trial.plan import Plan
    from experiment.trial.responder import Responder


def run_session(
    study: Study,
    participant: str,
    device: BurstDevice,
    responder: Responder,
    *,
    session: str = "01",
    out: Path | str = "results",
    clock: Clock | None = None,
    seed: int | None = None,
    participant_number: int | None = None,
    resuming: bool = False,
    resume_anyway: bool = False,
    hardware_confirmed: bool = False,
    practice_without_device: bool = False,
    rehearse: bool = False,
    operator: str | None = None,
    levels_vpp: Levels | None = None,
    lsl: bool = False,
    report: Callable[[str], object] = print,
) -> SessionResult:
    r"""Run one session with your device and responder, or resume it.

    Parameters
    ----------
    study : Study
        The study; a resumed session keeps the study that it began with.
    participant, session : str
        1 to 32 letters or digits each.
    device : BurstDevice
        Not yet open, made with `clock`.
    responder : Responder
        Who answers, on the same clock.
    out : Path or str
        The study's folder of results.
    clock : Clock, optional
        The machine's monotonic one by default.
    seed : int, optional
        Seed of the plan; random by default.
    participant_number : int, optional
        Number that selects a balanced order of conditions; by default the participant's row in
        participants.tsv.
    resuming : bool
        Resume a session that was interrupted.
    resume_anyway : bool
        Resume it also on another host or device, or after more than 30 minutes.
    hardware_confirmed : bool
        Your confirmation of the conditions in docs/hardware.md; a real device needs it.
    practice_without_device : bool
        A person tries the session out on an emulated device: no noise is played, and practice
        gives no feedback. Analyses accept such a session only with `allow_simulated`.
    rehearse : bool
        Rehearse on an emulated device with everything that plays, such as noise. No analysis
        accepts such a session.
    operator : str, optional
        Who runs the session, for its header.
    levels_vpp : tuple of float, or dict of them by the conditions' names, optional
        Levels of this participant, in place of the study's, when a session begins.
    lsl : bool
        Send markers over the Lab Streaming Layer, after at most 10 s of waiting for a recorder.
    report : callable
        Receives each line that the operator has to know.

    Returns
    -------
    SessionResult
        ``finished``: whether every trial is done; ``trials_path``: the trials.csv; ``failure``:
        the failure of the device that ended the session, or None.

    Raises
    ------
    ValueError
        If a stimulus violates a limit, the session exists already, or the device does not suit
        the study, lacks a method, or moves nothing in front of a person. No session begins then.
    ResponderError
        If the responder lacks a method, or fails.
    DeviceError
        If the device cannot be opened.

    Notes
    -----
    A Ctrl-C ends the program as a kill does: nothing is lost, and you can resume the session.

    Examples
    --------
    >>> import tempfile
    >>> from device import DriverSettings, Limits, VirtualClock, make_device
    >>> from experiment.study.files import paper_study
    >>> study = paper_study().changed(
    ...     design={"trials_per_side": 2, "both_trials": 0}, burst={"window": "hann"},
    ...     masking={"noise": "none"})
    >>> from experiment import Press, Responder
    >>> class Left(Responder):
    ...     simulated = True
    ...     def begin(self, progress): return True
    ...     def introduce(self, part, progress): return True
    ...     def cue(self, progress): pass
    ...     def wait(self, until_s): clock.wait(until_s - clock.now_s())
    ...     def ask(self, question):
    ...         clock.wait(0.5)
    ...         return Press(question.answers[0], clock.now_s())
    ...     def feedback(self, *, correct): pass
    ...     def pause(self, progress, *, paused, minimum_s): return True
    ...     def end(self, progress, *, finished): pass
    >>> clock = VirtualClock()
    >>> settings = DriverSettings(limits=Limits(ceiling_vpp=200.0, min_interval_s=0.05))
    >>> device = make_device("mock", settings, clock)
    >>> with tempfile.TemporaryDirectory() as out:
    ...     result = run_session(study, "01", device, Left(), out=out, clock=clock, seed=1)
    >>> result.finished
    True
    """
    clock = MonotonicClock() if clock is None else clock
    require_responder(responder)
    require_operator(operator)
    purpose = chosen_purpose(practice=practice_without_device, rehearse=rehearse)
    driver_from, device = type(device).__module__, guarded_device(device)
    folder = SessionFolder(Path(out), participant, session)
    resuming = resuming or resume_anyway
    if resuming:
        plan = folder.read_plan()
        study = folder.read_study(plan)
    else:
        plan = plan_session(
            folder, study, seed=seed, participant_number=participant_number, levels_vpp=levels_vpp
        )
    markers = LslMarkers(clock, participant=participant, session=session) if lsl else None
    if markers is not None:
        await_recorder(markers, report, asking=False)
    config = SessionConfig(
        device=device,
        responder=responder,
        noise=noise_player(
            study.masking, clock, is_silent=not purpose.plays_noise(simulated=responder.simulated)
        ),
        clock=clock,
        stop=StopSignal(),
        resume=resuming,
        resume_anyway=resume_anyway,
        purpose=purpose,
        confirmation=confirmed_now("run_session") if hardware_confirmed else None,
        responder_name=type(responder).__name__,
        operator=operator,
        responder_from=type(responder).__module__,
        driver_from=driver_from,
        report=report,
        markers=markers,
    )
    return run(folder, plan, config)


def plan_session(
    folder: SessionFolder,
    study: Study,
    *,
    driver: str | None = None,
    seed: int | None = None,
    participant_number: int | None = None,
    levels_vpp: Levels | None = None,
) -> Plan:
    """Check a study and draw the plan of a new session; nothing is written.

    Raises
    ------
    ArchiveError
        If the session exists already.
    StudyError, PlanError
        If a stimulus violates a limit, or no plan can be drawn.
    """
    folder.refuse_existing()
    gains = require_fit(study, driver=driver).gains
    order = study.design.condition_order
    if order == "balanced" and participant_number is None:
        participant_number = folder.participant_number()
    elif order != "balanced" and participant_number is not None:
        rule = f'needs design.condition_order = "balanced", not "{order}"'
        raise study.refused(Fault("--participant-number", rule, participant_number))
    return draw_plan(
        study,
        participant=folder.participant,
        session=folder.session,
        seed=secrets.randbits(32) if seed is None else seed,
        levels_vpp=levels_vpp,
        gains=gains,
        participant_number=participant_number,
    )


def run(folder: SessionFolder, plan: Plan, config: SessionConfig) -> SessionResult:
    r"""Begin a session and run it, or resume it if `config.resume`.

    A resumed session first asks the device about the stimulus of the interrupted trial, and
    resolves that trial. The trial is repeated unless its answer was recorded and counts. Completed
    trials do not change. For a finished session, only its tables are written again.

    Parameters
    ----------
    folder : SessionFolder
        Folder of the session; a new session must not exist yet.
    plan : Plan
        Plan of the session, which contains the study.
    config : SessionConfig
        Device, responder and all other equipment of the session.

    Returns
    -------
    SessionResult
        Whether every planned trial is done, the failure of the device if it failed, the path of
        trials.csv, and the hash of the journal's last line.

    Raises
    ------
    ResponderError
        If the responder lacks a method, or fails.
    ArchiveError
        If another process holds the session, or if a new session exists already. Unless
        `config.resume_anyway`, also if an interrupted session was begun with another kind of
        participant, on another host or device, or more than half an hour ago.
    JournalError, PlanError
        If the journal or the plan cannot be trusted; nothing is changed then.
    ValueError
        If the device does not suit the purpose or the study, or was not confirmed to be safe.
    DeviceError, NoiseError
        If the device cannot be opened, or the noise not be played.
    JournalWriteError
        If the record cannot be written.

    Examples
    --------
    A simulated participant on the mock device, with the virtual clock of a dry run. Resuming the
    finished session does nothing more:

    >>> from dataclasses import replace
    >>> from tempfile import TemporaryDirectory
    >>> from device import VirtualClock
    >>> from experiment import paper_study
    >>> from experiment.hardware.noise import SilentNoise
    >>> from experiment.hardware.setup import mock_device
    >>> from experiment.session.simulate import simulated_responder
    >>> study = paper_study().changed(design={"trials_per_side": 5, "both_trials": 0},
    ...                               simulation={"threshold_vpp": 100.0})
    >>> plan, clock = draw_plan(study, participant="01", session="01", seed=1), VirtualClock()
    >>> config = SessionConfig(device=mock_device(study, clock), clock=clock, stop=StopSignal(),
    ...                        responder=simulated_responder(study, plan, clock),
    ...                        noise=SilentNoise())
    >>> with TemporaryDirectory() as results:
    ...     folder = SessionFolder(Path(results), "01", "01")
    ...     result = run(folder, plan, config)
    ...     result.finished, result.trials_path.read_text().count("\n") - 1
    ...     run(folder, plan, replace(config, resume=True)).head_sha256 == result.head_sha256
    (True, 10)
    True
    """
    require_responder(config.responder)
    study = folder.read_study(plan)
    if config.resume:
        folder.refuse_loss()
        folder.check_people(study)
        result = finish(folder, plan, config.report)
        if result is not None:
            return result
    else:
        _refuse_existing(folder)
        folder.check_people(study)
    with folder.locked(), _opened(config, study) as identity:
        if config.resume:
            _refuse_resume(folder, plan, identity, config)
        config.noise.start()
        if not config.resume:
            folder.create(plan, header(study, plan, config, identity))
        return _run(folder, study, plan, config, identity)


def finish(
    folder: SessionFolder, plan: Plan, report: Callable[[str], object]
) -> SessionResult | None:
    """Write the tables and the final hash of a session whose trials are done; None of any other.

    It may have been killed before they were written. Neither device nor participant is needed.
    Raises as `run`.
    """
    with folder.locked():
        history = folder.read_history(plan)
        if not history.finished:
            return None
        _refuse_modified(folder, report)
        with folder.open_journal(lambda: history.last_t_s) as journal:
            return _finish(folder, plan, journal, finished=True, failure=None)


def chosen_purpose(*, practice: bool, rehearse: bool) -> Purpose:
    """Return the purpose of a session by its options; ValueError if they exclude each other."""
    if practice and rehearse:
        raise ValueError("--practice-without-device and --rehearse exclude each other")
    if rehearse:
        return Purpose.REHEARSAL
    return Purpose.PRACTICE if practice else Purpose.DATA


def _refuse_existing(folder: SessionFolder) -> None:
    """Refuse to begin a session that exists, or whose final hash is all that is left of it."""
    folder.refuse_existing()
    for seal in read_seals(folder.path.parent).values():
        if seal.session == folder.session:
            raise ArchiveError(
                f"{folder.path.parent / SESSIONS_TABLE}:{seal.line}: this session ended on "
                f"{seal.ended}, yet {folder.path} is lost; restore it from a copy, or give another "
                "--session: nothing was changed"
            )


def _refuse_resume(
    folder: SessionFolder, plan: Plan, identity: Identity, config: SessionConfig
) -> None:
    """Refuse to resume a session whose record was modified, or under other conditions."""
    history = folder.read_history(plan)
    _refuse_modified(folder, config.report)
    if history.opening is None:
        config.report("Note: its journal is empty, so the session begins at its first trial.")
    else:
        _refuse_other_conditions(history, history.opening, identity, config)


MAX_INTERRUPTION_S: Final = 30 * 60
"""After a longer interruption, the plate, the fingers and the noise may have changed."""
CLOCK_BROKEN: Final = (
    "the computer was restarted, so the duration of the interruption is unknown: onsets from here "
    "on have onset_clock {} in trials.csv and cannot be compared with earlier onsets"
)
"""Note in the journal when the session's clock was broken."""


def interruption_s(history: History) -> float | None:
    """Return for how long a session was interrupted; None if that is unknown."""
    return elapsed_s(history.last, machine_time())


def _refuse_other_conditions(
    history: History, opening: SessionOpened, identity: Identity, config: SessionConfig
) -> None:
    """Refuse another kind of participant, and another device or hour unless the operator agrees."""
    if config.responder.simulated != opening.simulated:
        who = "a simulated participant" if opening.simulated else "a person"
        raise ArchiveError(f"the session was begun with {who}: give another --responder")
    is_rehearsal = config.purpose is Purpose.REHEARSAL
    if is_rehearsal != (opening.device_kind == "rehearsal"):
        rule = "data: omit --rehearse" if is_rehearsal else "a rehearsal: give --rehearse"
        raise ArchiveError(f"the session was begun as {rule}")
    if config.resume_anyway:
        return
    here = host_and_device(identity, config.purpose)
    for what in ("host", "device", "serial_number"):
        then, now = getattr(opening, what), getattr(here, what)
        if then != now:
            raise ArchiveError(
                f"the session was begun with {what} {then!r}; got {now!r}: "
                "give --resume-anyway if that makes no difference"
            )
    gap_s = interruption_s(history)
    if gap_s is None or gap_s > MAX_INTERRUPTION_S:
        minutes = (gap_s or machine_time().wall_s - history.last.wall_s) / 60
        source = "" if gap_s else " by the calendar clock, as the computer was restarted"
        raise ArchiveError(
            f"the session was interrupted for {minutes:.0f} minutes{source}, and at most "
            f"{MAX_INTERRUPTION_S / 60:.0f} are allowed: give --resume-anyway if fingers, plate "
            "and noise have not changed"
        )


def _refuse_modified(folder: SessionFolder, report: Callable[[str], object]) -> None:
    """Refuse a modified record; report what a resume rebuilds, because it cannot be seen later."""
    for difference in refuse_modified(folder.path):
        report(f"Note: {difference.location}: {difference.message}; it is rebuilt.")


@contextlib.contextmanager
def _opened(config: SessionConfig, study: Study) -> Iterator[Identity]:
    """Open device and monitor, and refuse a device that does not suit the session.

    At the end both are closed, and the noise, which the caller starts, is stopped.
    """
    device, monitor = config.device, config.monitor
    with contextlib.ExitStack() as opened:
        identity = device.open()
        opened.callback(device.close)
        is_real, simulated = not identity.emulated, config.responder.simulated
        require_device(is_real=is_real, simulated=simulated, purpose=config.purpose)
        require_confirmed(identity, config.confirmation)
        require_suitable(study, identity, read_limits(device))
        for promise in device.cannot:
            config.report(f"Note: this device cannot {promise}.")
        if monitor is not None:
            opened.callback(monitor.close)
            monitor.open()
            config.report(
                f"Note: the monitor, at the tap {monitor.tap}, never sees {monitor.unseen}."
            )
        opened.callback(config.noise.stop)
        yield identity


def _run(
    folder: SessionFolder, study: Study, plan: Plan, config: SessionConfig, identity: Identity
) -> SessionResult:
    """Journal the begin or the resume, resolve an interrupted trial, and run the rest."""
    history = folder.read_history(plan)
    resumed = history.opening is not None
    gap_s = interruption_s(history) if resumed else 0.0
    clock_goes_on = gap_s is not None
    # No clock continues over a restart of the computer. The time between is not guessed; the lines
    # only keep their order.
    origin_s = config.clock.now_s() - history.last_t_s - (gap_s or 0.0)
    with folder.open_journal(lambda: config.clock.now_s() - origin_s) as journal:
        if resumed:
            conditions = visit_conditions(config, identity).model_dump()
            resumption = SessionResumed(
                session_clock="goes on" if clock_goes_on else "broken", **conditions
            )
            journal.append(resumption, sync=True)
        else:
            sealed = folder.sealed()
            opening = SessionOpened(
                participant=plan.participant,
                session=plan.session,
                plan_sha256=plan.sha256,
                simulated=config.responder.simulated,
                observer=drawn_observer(config.responder),
                **host_and_device(identity, config.purpose).model_dump(),
                header_sha256=sealed["header_sha256"],
                plan_file_sha256=sealed["plan_file_sha256"],
            )
            journal.append(opening, sync=True)
        if not clock_goes_on:
            text = CLOCK_BROKEN.format(history.onset_clock + 1)
            journal.append(NoteTaken(text=text), sync=True)
            config.report(f"Note: {text}.")
        if history.interrupted is not None:
            resolve_interrupted_trial(history.interrupted, study, journal, config.device, identity)
        session = Session(config, study, plan, folder, journal, resumed=resumed, origin_s=origin_s)
        finished = session.run()
        return _finish(folder, plan, journal, finished=finished, failure=session.stimulus.failure)


def _finish(
    folder: SessionFolder,
    plan: Plan,
    journal: Journal,
    *,
    finished: bool,
    failure: DeviceError | None,
) -> SessionResult:
    """Write the tables, then the final hash: where it is recorded, the tables exist."""
    answered = [row for row in folder.read_history(plan).rows if row.status == "ok"]
    planned = {trial.number for trial in plan.trials}  # without those of a warm-up
    trials_path = folder.write_trials()
    now = datetime.now(UTC).isoformat(timespec="seconds")
    seal = SessionSeal(session=folder.session, head_sha256=journal.head_sha256, ended=now)
    try:
        write_seal(folder.path.parent, seal, disk=folder.disk)
    except OSError as error:
        raise JournalWriteError(
            f"{folder.path.parent / SESSIONS_TABLE}: cannot be written ({error.strerror})"
        ) from error
    return SessionResult(
        finished=finished,
        unanswered=sum(row.response == "timeout" and row.trial in planned for row in answered),
        failure=failure,
        trials_path=trials_path,
        torn_file=journal.torn_file,
        head_sha256=journal.head_sha256,
    )
