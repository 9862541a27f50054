"""A session from its folder to its trials.csv: begun anew, or resumed after an interruption."""

from __future__ import annotations

import contextlib
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from device.clock import elapsed_s, machine_time
from experiment.apparatus.rig import device_kind, require_confirmed, require_device
from experiment.apparatus.slots import require_suitable, told_limits
from experiment.archive.files import HEADS, ArchiveError
from experiment.archive.journal import JournalWriteError
from experiment.integrity.heads import SessionHead, enter_head, read_heads
from experiment.integrity.sessions import refuse_altered
from experiment.session.attendance import require_responder
from experiment.session.session import Session
from experiment.session.setting import Ending, Setting, header, opening, place, resuming
from experiment.session.settled import settle_open_trial
from experiment.study.files import study_from_canonical

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from device.driver import Identity
    from device.errors import DeviceError
    from experiment.apparatus.noise import NoisePlayer
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


def refuse_another_place(history: History, identity: Identity, setting: Setting) -> None:
    """Refuse another kind of participant; another place or time, unless the operator says so."""
    if setting.responder.simulated != history.opening["simulated"]:
        who = "a simulated participant" if history.opening["simulated"] else "a person"
        raise ArchiveError(
            f"the session was begun with {who} and can only go on so: give another --responder"
        )
    if setting.resume_anyway:
        return
    here = place(identity)
    for what in ("host", "device", "serial_number"):
        if here[what] != history.opening[what]:
            raise ArchiveError(
                f"the session was begun with {what} {history.opening[what]!r}; got {here[what]!r}: "
                "give --resume-anyway if that makes no difference"
            )
    gap_s = interruption_s(history)
    if gap_s is None:
        by_calendar_s = machine_time().wall_s - history.last.wall_s
        raise ArchiveError(
            "the computer was started anew, or its calendar clock was set, so that nothing tells "
            f"for sure how long the session was interrupted: {by_calendar_s / 60:.0f} minutes by "
            "the calendar. Give --resume-anyway if it was at most "
            f"{LONGEST_INTERRUPTION_S / 60:.0f} and fingers, plate and noise are as they were; "
            "onsets are on another clock then"
        )
    if gap_s > LONGEST_INTERRUPTION_S:
        raise ArchiveError(
            f"the session was interrupted {gap_s / 60:.0f} minutes ago, the most is "
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
    >>> from experiment.apparatus.noise import SilentNoise
    >>> from experiment.apparatus.rig import mock_device
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
    _refuse_kept(folder)
    study = study_from_canonical(plan.study)
    folder.check_people(study)
    with folder.locked(), _opened(setting, study) as identity, _playing(setting.noise):
        folder.create(plan, header(study, plan, setting, identity))
        return _run(folder, study, plan, setting, identity)


def _refuse_kept(folder: SessionFolder) -> None:
    """Refuse to begin a session anew that has ended once, by the head that was kept of it."""
    for head in read_heads(folder.path.parent):
        if head.session == folder.session:
            raise ArchiveError(
                f"{folder.path.parent / HEADS}:{head.line}: this session ended on {head.ended}, "
                f"yet {folder.path} is lost; restore it from a copy, or give another --session: "
                "nothing was changed"
            )


def resume(folder: SessionFolder, setting: Setting) -> Ending:
    """Go on with a session that was interrupted; a finished one only gets its trials.csv again.

    The trial in which it was interrupted is settled by what the device knows of it. It is repeated
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
    >>> from experiment.apparatus.noise import SilentNoise
    >>> from experiment.apparatus.rig import mock_device
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
    ending = completed(folder, plan, setting.tell)
    if ending is not None:
        return ending
    with folder.locked(), _opened(setting, study) as identity:
        history = folder.read_history(plan)
        _refuse_altered(folder, setting.tell)
        if history.opening:
            refuse_another_place(history, identity, setting)
        else:
            setting.tell("Note: its journal is empty, so the session begins at its first trial.")
        with _playing(setting.noise):
            return _run(folder, study, plan, setting, identity)


def completed(folder: SessionFolder, plan: Plan, tell: Callable[[str], object]) -> Ending | None:
    """Write table and head of a session that has come to its end; None of any other.

    It may have been killed before they were written. Neither device nor participant is needed.
    Raises as `resume`.
    """
    with folder.locked():
        history = folder.read_history(plan)
        if not history.finished:
            return None
        _refuse_altered(folder, tell)
        with folder.open_journal(lambda: history.last_t_s) as journal:
            return _ending(folder, plan, journal, finished=True, failure=None)


def _refuse_altered(folder: SessionFolder, tell: Callable[[str], object]) -> None:
    """Refuse a record that was changed; tell what a resume puts right, for it is not seen later."""
    differences = refuse_altered(folder.path)
    for difference in differences:
        if difference.mended_by == "export" and difference.line is not None:
            raise ArchiveError(
                f"{difference}; tactstrip export DIR builds it anew from the journal: nothing was "
                "changed"
            )
    for difference in differences:
        tell(f"Note: {difference.place}: {difference.message}; it is written anew.")


@contextlib.contextmanager
def _opened(setting: Setting, study: Study) -> Iterator[Identity]:
    device = setting.device
    identity = device.open()
    try:
        require_device(
            device_kind(identity),
            simulated=setting.responder.simulated,
            practice=setting.practice,
        )
        require_confirmed(identity, setting.confirmation)
        require_suitable(study, identity, told_limits(device))
        for promise in device.cannot:
            setting.tell(f"Note: this device cannot {promise}.")
        if setting.monitor is not None:
            setting.monitor.open()
            tap, unseen = setting.monitor.tap, setting.monitor.unseen
            setting.tell(f"Note: the monitor, at the tap {tap}, never sees {unseen}.")
        yield identity
    finally:
        if setting.monitor is not None:
            setting.monitor.close()
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
    gap_s = interruption_s(history) if history.opening else 0.0
    if history.opening:
        # Over a new start of the computer no clock goes on: the time between is not guessed at, the
        # lines only stay in their order.
        origin_s -= history.last_t_s + (gap_s or 0.0)
    with folder.open_journal(lambda: setting.clock.now_s() - origin_s) as journal:
        _enter(
            folder,
            study,
            plan,
            history,
            journal,
            setting=setting,
            identity=identity,
            clock_goes_on=gap_s is not None,
        )
        session = Session(
            setting,
            study,
            plan,
            folder.read_history(plan),
            journal,
            tables_sha256=lambda: folder.tables_sha256(plan),
            resumed=bool(history.opening),
            origin_s=origin_s,
        )
        finished = session.run()
        return _ending(folder, plan, journal, finished=finished, failure=session.failure)


def _ending(
    folder: SessionFolder,
    plan: Plan,
    journal: Journal,
    *,
    finished: bool,
    failure: DeviceError | None,
) -> Ending:
    done = [row for row in folder.read_history(plan).rows if row.status == "ok"]
    planned = {trial.number for trial in plan.trials}  # without those of a warm-up
    return Ending(
        finished=finished,
        unanswered=sum(row.response == "timeout" and row.trial in planned for row in done),
        failure=failure,
        trials_path=folder.write_trials(),
        torn_file=journal.torn_file,
        head_sha256=_keep_head(folder, journal),
    )


def _keep_head(folder: SessionFolder, journal: Journal) -> str:
    """Keep the head, last of all: who finds it may expect the table, too."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    head = SessionHead(session=folder.session, head_sha256=journal.head_sha256, ended=now)
    try:
        enter_head(folder.path.parent, head, disk=folder.disk)
    except OSError as error:
        raise JournalWriteError(
            f"{folder.path.parent / HEADS}: cannot be written ({error.strerror})"
        ) from error
    return journal.head_sha256


def _enter(
    folder: SessionFolder,
    study: Study,
    plan: Plan,
    history: History,
    journal: Journal,
    *,
    setting: Setting,
    identity: Identity,
    clock_goes_on: bool,
) -> None:
    """Note the beginning, or the resume; there, settle the trial that is still open."""
    if not history.opening:
        told = opening(plan, identity, setting) | folder.sealed()
        journal.append("session_open", told, sync=True)
        return
    told = resuming(study, plan, identity, setting, clock_goes_on=clock_goes_on)
    journal.append("session_resume", told, sync=True)
    if not clock_goes_on:
        text = CLOCK_BROKEN.format(history.onset_clock + 1)
        journal.append("note", {"text": text}, sync=True)
        setting.tell(f"Note: {text}.")
    if history.open_trial is not None:
        same_boot = history.open_trial.boot_id == identity.boot_id
        settle_open_trial(history.open_trial, study, journal, setting.device, same_boot=same_boot)
