"""A session from Python, with a device and a responder of one's own."""

from __future__ import annotations

import secrets
from pathlib import Path
from typing import TYPE_CHECKING

from device.clock import MonotonicClock
from device.drivers import whole_device
from experiment.archive.folders import SessionFolder
from experiment.check.check import require_fit
from experiment.hardware.noise import noise_player
from experiment.hardware.safety import confirmed_now
from experiment.operator.requests import StopSignal
from experiment.session.attendance import require_responder
from experiment.session.conduct import begin, resume
from experiment.session.markers import LslMarkers, await_recorder
from experiment.session.setting import Setting, require_operator
from experiment.trial.draw import draw_plan

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.driver import BurstDevice
    from experiment.session.setting import Ending
    from experiment.study.files import Levels
    from experiment.study.study import Study
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
    operator: str | None = None,
    levels_vpp: Levels | None = None,
    lsl: bool = False,
    report: Callable[[str], object] = print,
) -> Ending:
    r"""Run one session with a device and a responder of one's own, or go on with it.

    Parameters
    ----------
    study : Study
        The study; of a session that goes on, its plan counts.
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
        Of the plan; random by default.
    participant_number : int, optional
        For a balanced order of conditions; by default the place in participants.tsv.
    resuming : bool
        Go on with a session that was interrupted.
    resume_anyway : bool
        The same on another host or device, or after more than 30 minutes.
    hardware_confirmed : bool
        Your word that what docs/hardware.md lists is so; a real device is refused without it.
    practice_without_device : bool
        Your word that a person only tries it out where the device says that it is emulated: no
        noise is played, and practice gives no feedback. Analyses refuse such a
        session unless they are told otherwise.
    operator : str, optional
        Who runs the session, for its header.
    levels_vpp : tuple of float, or dict of them by the conditions' names, optional
        Placed for this participant, instead of the study's, when a session begins.
    lsl : bool
        Send markers over the Lab Streaming Layer; a recorder is waited for, at most 10 s.
    report : callable
        Receives each line that the operator has to know.

    Returns
    -------
    Ending
        ``finished``: whether every trial is done; ``trials_path``: the trials.csv; ``failure``:
        what the device failed with, or None.

    Raises
    ------
    ValueError
        If the study's stimuli are unfit for its plate, the session exists already, the device
        cannot do what the study asks, lacks a method, or moves nothing before a person; no session
        is begun then.
    ResponderError
        If the responder lacks a method, or fails.
    DeviceError
        If the device cannot be opened.

    Notes
    -----
    A Ctrl-C ends the program as a kill does: nothing is lost, and `resuming` goes on.

    Examples
    --------
    >>> import tempfile
    >>> from device import DriverSettings, Limits, VirtualClock, make_device
    >>> from experiment.study.files import paper_study
    >>> study = paper_study().changed(
    ...     design={"trials_per_side": 2, "both_trials": 0}, burst={"window": "hann"},
    ...     masking={"noise": "none"})
    >>> class Left:
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
    >>> from experiment import Press
    >>> clock = VirtualClock()
    >>> settings = DriverSettings(limits=Limits(ceiling_vpp=200.0, min_interval_s=0.05))
    >>> device = make_device("mock", settings, clock)
    >>> with tempfile.TemporaryDirectory() as out:
    ...     ending = run_session(study, "01", device, Left(), out=out, clock=clock, seed=1)
    >>> ending.finished
    True
    """
    clock = MonotonicClock() if clock is None else clock
    require_responder(responder)
    require_operator(operator)
    driver_from, device = type(device).__module__, whole_device(device)
    folder = SessionFolder(Path(out), participant, session)
    resuming = resuming or resume_anyway
    if resuming:
        plan = folder.read_plan()
        study = folder.read_study(plan)
    else:
        folder.refuse_existing()
        gains = require_fit(study).gains
        if participant_number is None and study.design.condition_order == "balanced":
            participant_number = folder.participant_number()
        plan = draw_plan(
            study,
            participant=participant,
            session=session,
            seed=secrets.randbits(32) if seed is None else seed,
            levels_vpp=levels_vpp,
            gains=gains,
            participant_number=participant_number,
        )
        if plan.participant_number and (shared := folder.number_shared(plan.participant_number)):
            report(f"Note: {shared}.")
    markers = LslMarkers(clock, participant=participant, session=session) if lsl else None
    if markers is not None:
        await_recorder(markers, report, asking=False)
    setting = Setting(
        device=device,
        responder=responder,
        noise=noise_player(
            study.masking, clock, simulated=responder.simulated or practice_without_device
        ),
        clock=clock,
        stop=StopSignal(),
        resume_anyway=resume_anyway,
        confirmation=confirmed_now("run_session") if hardware_confirmed else None,
        practice=practice_without_device,
        responder_name=type(responder).__name__,
        operator=operator,
        responder_from=type(responder).__module__,
        driver_from=driver_from,
        report=report,
        markers=markers,
    )
    return resume(folder, setting) if resuming else begin(folder, plan, setting)
