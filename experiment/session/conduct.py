"""A session from its folder to its trials.csv: begun anew, or resumed after an interruption."""

from __future__ import annotations

import contextlib
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from device.clock import elapsed_s, machine_time
from experiment.archive.entries import NoteTaken, SessionOpened, SessionResumed
from experiment.archive.files import HEADS, ArchiveError
from experiment.archive.journal import JournalWriteError
from experiment.hardware.safety import device_kind, require_confirmed, require_device
from experiment.hardware.setup import read_limits
from experiment.hardware.suitability import require_suitable
from experiment.integrity.heads import SessionHead, enter_head, read_heads
from experiment.integrity.sessions import refuse_altered
from experiment.session.attendance import require_responder
from experiment.session.resolve import resolve_interrupted_trial
from experiment.session.session import Session
from experiment.session.setting import (
    Ending,
    Setting,
    drawn_observer,
    header,
    host_and_device,
    visit_conditions,
)
from experiment.study.files import study_from_canonical

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from device.driver import Identity
    from device.errors import DeviceError
    from experiment.archive.folders import SessionFolder
    from experiment.archive.history import History
    from experiment.archive.journal import Journal
    from experiment.study.study import Study
    from experiment.trial.plan import Plan


LONGEST_INTERRUPTION_S = 30 * 60
"""After a longer one, plate, fingers and noise may not be what they were."""
CLOCK_BROKEN = (
    "the computer was started anew, so that nobody can tell how long the session was interrupted: "
    "onsets from here on have onset_clock {} in trials.csv, they cannot be compared with earlier "
    "ones"
)
"""What is noted where the session's clock does not go on."""


def interruption_s(history: History) -> float | None:
    """Return for how long a session was interrupted; None where nobody can tell."""
    return elapsed_s(history.last, machine_time())


def refuse_another_place(
    history: History, opening: SessionOpened, identity: Identity, setting: Setting
) -> None:
    """Refuse another kind of participant; another place or time, unless the operator says so."""
    if setting.responder.simulated != opening.simulated:
        who = "a simulated participant" if opening.simulated else "a person"
        raise ArchiveError(
            f"the session was begun with {who} and can only go on so: give another --responder"
        )
    if setting.resume_anyway:
        return
    here = host_and_device(identity)
    for what in ("host", "device", "serial_number"):
        then, now = getattr(opening, what), getattr(here, what)
        if then != now:
            raise ArchiveError(
                f"the session was begun with {what} {then!r}; got {now!r}: "
                "give --resume-anyway if that makes no difference"
            )
    gap_s = interruption_s(history)
    if gap_s is None or gap_s > LONGEST_INTERRUPTION_S:
        minutes = (gap_s or machine_time().wall_s - history.last.wall_s) / 60
        source = "" if gap_s else " by the calendar clock, as the computer was started anew"
        raise ArchiveError(
            f"the session was interrupted for {minutes:.0f} minutes{source}; the most is "
            f"{LONGEST_INTERRUPTION_S / 60:.0f}: give --resume-anyway if fingers, plate and noise "
            "are as they were"
        )


def begin(folder: SessionFolder, plan: Plan, setting: Setting) -> Ending:
    r"""Create a session's folder and run the session.

    `run_session` is easier: it makes plan and setting, and checks the stimuli against the plate.

    Parameters
    ----------
    folder : SessionFolder
        Where the session is kept; it must not exist yet.
    plan : Plan
        The session's trials, with the study in it.
    setting : Setting
        Device, responder and what else it is run with.

    Returns
    -------
    Ending
        Whether every planned trial is done, what the device failed with if it did, where trials.csv
        is, and the hash of the journal's last line.

    Raises
    ------
    ResponderError
        If the responder lacks a method, or fails.
    ArchiveError
        If the session exists already, or another process holds it.
    NoDeviceError
        If a person would sit before a device that moves nothing, and it is not to be practice.
    NotConfirmedError, SuitabilityError
        If nobody confirmed that a real device is safe, or it cannot do what the study asks; no
        session is created then.
    DeviceError, NoiseError
        If the device cannot be opened, or the noise not be played; no session is created then.
    JournalWriteError
        If the record cannot be kept.

    Examples
    --------
    A simulated person on the mock device, with the clock that a dry run has:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from device import VirtualClock
    >>> from experiment import draw_plan, paper_study
    >>> from experiment.hardware.noise import SilentNoise
    >>> from experiment.hardware.setup import mock_device
    >>> from experiment.archive.folders import SessionFolder
    >>> from experiment.operator.requests import StopSignal
    >>> from experiment.session.setting import Setting
    >>> from experiment.session.simulate import simulated_responder
    >>> study = paper_study().changed(design={"trials_per_side": 5, "both_trials": 0},
    ...                               simulation={"threshold_vpp": 100.0})
    >>> plan, clock = draw_plan(study, participant="01", session="01", seed=1), VirtualClock()
    >>> setting = Setting(device=mock_device(study, clock), clock=clock, stop=StopSignal(),
    ...                   responder=simulated_responder(study, plan, clock),
    ...                   noise=SilentNoise(study.masking))
    >>> with TemporaryDirectory() as results:
    ...     ending = begin(SessionFolder(Path(results), "01", "01"), plan, setting)
    ...     ending.finished, ending.trials_path.read_text().count("\n") - 1
    (True, 10)
    """
    require_responder(setting.responder)
    folder.refuse_existing()
    for head in read_heads(folder.path.parent).values():
        if head.session == folder.session:
            raise ArchiveError(
                f"{folder.path.parent / HEADS}:{head.line}: this session ended on {head.ended}, "
                f"yet {folder.path} is lost; restore it from a copy, or give another --session: "
                "nothing was changed"
            )
    study = study_from_canonical(plan.study)
    folder.check_people(study)
    with folder.locked(), _opened(setting, study) as identity:
        setting.noise.start()
        folder.create(plan, header(study, plan, setting, identity))
        return _run(folder, study, plan, setting, identity)


def resume(folder: SessionFolder, setting: Setting) -> Ending:
    """Go on with a session that was interrupted; a finished one only gets its trials.csv again.

    The trial in which it was interrupted is resolved by what the device knows of it. It is repeated
    unless its answer was written already and counts. Done trials stay as they are.

    Parameters
    ----------
    folder : SessionFolder
        Where the session is kept; plan, study and levels are those that it was begun with.
    setting : Setting
        Device, responder and what else it is run with: the same kind of participant, on the same
        host and device and within half an hour, unless `Setting.resume_anyway`.

    Returns
    -------
    Ending
        As of `begin`.

    Raises
    ------
    ResponderError
        If the responder lacks a method, or fails.
    ArchiveError
        If there is no session, another process holds it, or it may not go on here and now.
    JournalError, PlanError
        If journal or plan cannot be trusted; nothing is changed then.
    NoDeviceError
        If a person would sit before a device that moves nothing, and it is not to be practice.
    NotConfirmedError, SuitabilityError
        If nobody confirmed that a real device is safe, or it cannot do what the study asks.
    DeviceError, NoiseError
        If the device cannot be opened, or the noise not be played.
    JournalWriteError
        If the record cannot be kept.

    Examples
    --------
    Of a session that has come to its end nothing is done again:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from device import VirtualClock
    >>> from experiment import paper_study, simulate_study
    >>> from experiment.hardware.noise import SilentNoise
    >>> from experiment.hardware.setup import mock_device
    >>> from experiment.operator.requests import StopSignal
    >>> from experiment.session.setting import Setting
    >>> from experiment.session.simulate import simulated_responder
    >>> study = paper_study().changed(design={"trials_per_side": 5, "both_trials": 0},
    ...                               simulation={"threshold_vpp": 100.0})
    >>> clock = VirtualClock()
    >>> with TemporaryDirectory() as results:
    ...     folder, = simulate_study(study, Path(results), participants=1, seed=1, gains=())
    ...     before = folder.journal_path.read_bytes()
    ...     setting = Setting(device=mock_device(study, clock), clock=clock, stop=StopSignal(),
    ...                       responder=simulated_responder(study, folder.read_plan(), clock),
    ...                       noise=SilentNoise(study.masking))
    ...     resume(folder, setting).finished, folder.journal_path.read_bytes() == before
    (True, True)
    """
    require_responder(setting.responder)
    plan = folder.read_plan()
    folder.refuse_loss()
    study = folder.read_study(plan)
    folder.check_people(study)
    ending = completed(folder, plan, setting.report)
    if ending is not None:
        return ending
    with folder.locked(), _opened(setting, study) as identity:
        history = folder.read_history(plan)
        _refuse_altered(folder, setting.report)
        if history.opening is not None:
            refuse_another_place(history, history.opening, identity, setting)
        else:
            setting.report("Note: its journal is empty, so the session begins at its first trial.")
        setting.noise.start()
        return _run(folder, study, plan, setting, identity)


def completed(folder: SessionFolder, plan: Plan, report: Callable[[str], object]) -> Ending | None:
    """Write table and head of a session that has come to its end; None of any other.

    It may have been killed before they were written. Neither device nor participant is needed.
    Raises as `resume`.
    """
    with folder.locked():
        history = folder.read_history(plan)
        if not history.finished:
            return None
        _refuse_altered(folder, report)
        with folder.open_journal(lambda: history.last_t_s) as journal:
            return _end(folder, plan, journal, finished=True, failure=None)


def _refuse_altered(folder: SessionFolder, report: Callable[[str], object]) -> None:
    """Refuse a record that was changed; tell what a resume puts right, for it is not seen later."""
    differences = refuse_altered(folder.path)
    for difference in differences:
        if difference.mended_by == "export" and difference.line is not None:
            raise ArchiveError(
                f"{difference}; tactstrip export DIR builds it anew from the journal: nothing was "
                "changed"
            )
    for difference in differences:
        report(f"Note: {difference.place}: {difference.message}; it is written anew.")


@contextlib.contextmanager
def _opened(setting: Setting, study: Study) -> Iterator[Identity]:
    """Open device and monitor, and refuse what the session cannot be run with.

    At the end both are closed, and the noise, which the caller starts, is stopped.
    """
    device, monitor = setting.device, setting.monitor
    with contextlib.ExitStack() as opened:
        identity = device.open()
        opened.callback(device.close)
        kind, simulated = device_kind(identity), setting.responder.simulated
        require_device(kind, simulated=simulated, practice=setting.practice)
        require_confirmed(identity, setting.confirmation)
        require_suitable(study, identity, read_limits(device))
        for promise in device.cannot:
            setting.report(f"Note: this device cannot {promise}.")
        if monitor is not None:
            opened.callback(monitor.close)
            monitor.open()
            setting.report(
                f"Note: the monitor, at the tap {monitor.tap}, never sees {monitor.unseen}."
            )
        opened.callback(setting.noise.stop)
        yield identity


def _run(
    folder: SessionFolder, study: Study, plan: Plan, setting: Setting, identity: Identity
) -> Ending:
    """Note the beginning, or the resume; there, resolve the interrupted trial. Run the rest."""
    history = folder.read_history(plan)
    resumed = history.opening is not None
    gap_s = interruption_s(history) if resumed else 0.0
    clock_goes_on = gap_s is not None
    # Over a new start of the computer no clock goes on: the time between is not guessed at, the
    # lines only stay in their order.
    origin_s = setting.clock.now_s() - history.last_t_s - (gap_s or 0.0)
    with folder.open_journal(lambda: setting.clock.now_s() - origin_s) as journal:
        if resumed:
            conditions = visit_conditions(study, plan, setting, identity).model_dump()
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
                simulated=setting.responder.simulated,
                observer=drawn_observer(setting.responder),
                **host_and_device(identity).model_dump(),
                header_sha256=sealed["header_sha256"],
                plan_file_sha256=sealed["plan_file_sha256"],
            )
            journal.append(opening, sync=True)
        if not clock_goes_on:
            text = CLOCK_BROKEN.format(history.onset_clock + 1)
            journal.append(NoteTaken(text=text), sync=True)
            setting.report(f"Note: {text}.")
        if history.interrupted is not None:
            resolve_interrupted_trial(history.interrupted, study, journal, setting.device, identity)
        session = Session(setting, study, plan, folder, journal, resumed=resumed, origin_s=origin_s)
        finished = session.run()
        return _end(folder, plan, journal, finished=finished, failure=session.stimulus.failure)


def _end(
    folder: SessionFolder,
    plan: Plan,
    journal: Journal,
    *,
    finished: bool,
    failure: DeviceError | None,
) -> Ending:
    """Write the tables, then the final hash: who finds it may expect the tables, too."""
    answered = [row for row in folder.read_history(plan).rows if row.status == "ok"]
    planned = {trial.number for trial in plan.trials}  # without those of a warm-up
    trials_path = folder.write_trials()
    now = datetime.now(UTC).isoformat(timespec="seconds")
    head = SessionHead(session=folder.session, head_sha256=journal.head_sha256, ended=now)
    try:
        enter_head(folder.path.parent, head, disk=folder.disk)
    except OSError as error:
        raise JournalWriteError(
            f"{folder.path.parent / HEADS}: cannot be written ({error.strerror})"
        ) from error
    return Ending(
        finished=finished,
        unanswered=sum(row.response == "timeout" and row.trial in planned for row in answered),
        failure=failure,
        trials_path=trials_path,
        torn_file=journal.torn_file,
        head_sha256=journal.head_sha256,
    )
