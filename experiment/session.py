"""One session: the engine's effects carried out on device, participant, clock and journal."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from device.driver import DeviceError, Outcome, RefusedError
from experiment import steps
from experiment.engine import step, upcoming
from experiment.interrupts import StopRequested
from experiment.responder import ESCAPE, Press, Progress, Question
from experiment.stimulus import SLOTS, load_condition, onset_interval_s

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.driver import BurstDevice, Delivery
    from experiment.interrupts import StopSignal
    from experiment.journal import Journal
    from experiment.plan import Plan
    from experiment.replay import History
    from experiment.responder import Responder
    from experiment.study import Study

ARM_TO_FIRE_S = 1.0
"""How long the device may hold a stimulus ready; later it cannot be fired any more."""


class Session:
    """A session in progress.

    Parameters
    ----------
    study : Study
        The study.
    plan : Plan
        Its sealed plan.
    history : History
        What the journal says already; empty for a new session.
    resumed : bool
        Whether it goes on after an interruption: a person gets the warm-up trials then.
    device : BurstDevice
        The actuators, opened.
    responder : Responder
        The participant.
    clock : Clock
        The clock of device and responder.
    origin_s : float
        The clock's reading at the session's beginning.
    journal : Journal
        The session's journal, opened.
    stop : StopSignal
        Tells that the session is to be stopped.
    """

    def __init__(
        self,
        *,
        study: Study,
        plan: Plan,
        history: History,
        resumed: bool,
        device: BurstDevice,
        responder: Responder,
        clock: Clock,
        origin_s: float,
        journal: Journal,
        stop: StopSignal,
    ) -> None:
        self._study = study
        self._plan = plan
        self._device = device
        self._responder = responder
        self._clock = clock
        self._origin_s = origin_s
        self._journal = journal
        self._stop = stop
        self._conditions = {condition.name: condition for condition in study.conditions}
        self._loaded: str | None = None
        self._due_s = 0.0
        self._interval_s = 0.0
        self._rested_s = clock.now_s()
        self._token = 0
        self._delivery: Delivery | None = None
        self._onset_s = 0.0
        self.failure: DeviceError | None = None
        warm_up = history.warm_up if resumed and not responder.simulated else ()
        pending = (*warm_up, *history.pending) if history.pending else ()
        self._state = steps.State(
            pending=pending,
            keep_anticipated=study.design.anticipated == "keep",
            response_window_s=study.design.response_window_s,
        )
        self._perform: dict[type[steps.Effect], Callable[..., steps.Event | None]] = {
            steps.OpenBlock: self._open_block,
            steps.CloseBlock: self._close_block,
            steps.Cue: self._cue,
            steps.Wait: self._wait,
            steps.Arm: self._arm,
            steps.Fire: self._fire,
            steps.Listen: self._listen,
            steps.EndTrial: self._end_trial,
            steps.Feedback: self._feedback,
            steps.Rest: self._rest,
            steps.ZeroOutputs: self._zero_outputs,
            steps.CloseSession: self._close,
        }

    def run(self) -> bool:
        """Run to the end, or until the session is stopped; return whether it is complete.

        Raises
        ------
        JournalWriteError
            If the record cannot be kept; the outputs are at zero then.
        """
        try:
            event = upcoming(self._state)
            while self._state.phase not in (steps.Phase.FINISHED, steps.Phase.STOPPED):
                event = self._step(event)
        except DeviceError as error:
            self._device_failed(error)
        finally:
            self._device.stop()
        return self._state.phase is steps.Phase.FINISHED

    def _step(self, event: steps.Event) -> steps.Event:
        self._state, effects = step(self._state, event)
        answer = None
        for effect in effects:
            answer = self._perform[type(effect)](effect) or answer
        if answer is not None:
            return answer
        if self._stop.asked and self._state.phase is steps.Phase.READY:
            return steps.StopAsked()
        return upcoming(self._state)

    def _progress(self) -> Progress:
        pending = self._state.pending
        left = sum(task.trial.number <= len(self._plan.trials) for task in pending)
        return Progress(
            done=len(self._plan.trials) - left,
            planned=len(self._plan.trials),
            practice=bool(pending) and pending[0].trial.kind == "practice",
        )

    def _open_block(self, effect: steps.OpenBlock) -> None:
        trial = effect.task.trial
        facts = {"block": trial.block, "condition": trial.condition}
        self._journal.append("block_start", facts)

    def _close_block(self, effect: steps.CloseBlock) -> None:
        self._journal.append("block_end", {"block": effect.block})

    def _load(self, condition_name: str) -> None:
        """Load a condition's waveforms, unless the device has them."""
        if condition_name == self._loaded:
            return
        condition = self._conditions[condition_name]
        load_condition(self._device, condition, self._study.device)
        self._device.enable()
        self._loaded = condition_name
        self._interval_s = onset_interval_s(condition, self._study.device)
        self._rested_s = max(self._rested_s, self._clock.now_s() + self._interval_s)

    def _cue(self, effect: steps.Cue) -> None:
        self._load(effect.task.trial.condition)
        self._responder.cue(self._progress())
        due_s = self._clock.now_s() + effect.task.trial.foreperiod_s
        self._due_s = max(due_s, self._rested_s)
        self._delivery = None

    def _wait(self, _: steps.Wait) -> steps.Event:
        try:
            with self._stop.interruptible():
                press = self._responder.wait(self._due_s)
        except StopRequested:
            return steps.StopAsked()
        return self._event_of(press, onset_s=None)

    def _arm(self, effect: steps.Arm) -> steps.Event:
        trial = effect.task.trial
        level_vpp = trial.level_vpp or min(self._study.design.levels_vpp)
        self._token = max(self._token + 1, time.time_ns())
        self._journal.append(
            "trial_armed", trial_name(effect.task) | {"token": self._token}, sync=True
        )
        try:
            self._device.set_levels(level_vpp, level_vpp)
            self._device.arm(self._token, SLOTS[trial.side], time_to_live_s=ARM_TO_FIRE_S)
        except DeviceError as error:
            return self._device_failed(error)
        self._journal.append("stimulus_commanded", {"token": self._token})
        return steps.Armed()

    def _fire(self, _: steps.Fire) -> steps.Event:
        """Emit the stimulus; nothing touches the disk from here to the answer."""
        self._rested_s = self._clock.now_s() + self._interval_s
        try:
            self._delivery = self._device.fire(self._token)
        except RefusedError as error:
            self._note_fault(error)
            return steps.NotFired()
        except DeviceError as error:
            return self._device_failed(error)
        before_s, after_s = self._delivery.host_before_s, self._delivery.host_after_s
        self._onset_s = (before_s + after_s) / 2
        return _EVENT_OF[self._delivery.outcome]

    def _listen(self, effect: steps.Listen) -> steps.Event:
        assert self._delivery is not None
        question = Question(
            trial=effect.task.trial.number,
            attempt=effect.task.attempt,
            level_left_vpp=self._delivery.level_left_vpp,
            level_right_vpp=self._delivery.level_right_vpp,
            onset_s=self._onset_s,
            window_s=effect.window_s,
        )
        try:
            with self._stop.interruptible():
                press = self._responder.ask(question)
        except StopRequested:
            return steps.StopAsked()
        return self._event_of(press, onset_s=self._onset_s)

    def _event_of(self, press: Press | None, *, onset_s: float | None) -> steps.Event:
        if press is None:
            return steps.Elapsed()
        if press.response == ESCAPE:
            return steps.PauseAsked()
        offered = press.response in self._plan.responses
        rt_s = None if onset_s is None else round(press.time_s - onset_s, 6)
        return steps.Key(press.response if offered else "invalid", rt_s)

    def _end_trial(self, effect: steps.EndTrial) -> None:
        name = trial_name(effect.task)
        early = {"anticipated": effect.anticipated}
        if self._delivery is not None:
            onset_s = round(self._onset_s - self._origin_s, 6)
            facts = delivery_facts(self._delivery, onset_s)
            self._journal.append("stimulus_confirmed", name | facts)
        if effect.response is not None:
            answer = {"response": effect.response, "rt_s": effect.rt_s}
            self._journal.append("response", name | answer | early)
        self._journal.append("trial_end", name | {"status": effect.status} | early, sync=True)

    def _feedback(self, effect: steps.Feedback) -> None:
        self._responder.feedback(correct=effect.correct)

    def _rest(self, effect: steps.Rest) -> steps.Event:
        self._journal.append("pause" if effect.paused else "break", sync=True)
        minimum_s = 0.0 if effect.paused else self._study.design.minimum_break_s
        try:
            with self._stop.interruptible():
                go_on = self._responder.pause(
                    self._progress(), paused=effect.paused, minimum_s=minimum_s
                )
        except StopRequested:
            return steps.StopAsked()
        return steps.Continued() if go_on else steps.StopAsked()

    def _zero_outputs(self, _: steps.ZeroOutputs) -> None:
        self._device.stop()

    def _close(self, effect: steps.CloseSession) -> None:
        self._journal.append("session_close", {"finished": effect.finished}, sync=True)

    def _device_failed(self, error: DeviceError) -> steps.Event:
        self.failure = error
        self._note_fault(error)
        return steps.DeviceFailed()

    def _note_fault(self, error: DeviceError) -> None:
        facts = {"error": type(error).__name__, "message": str(error)}
        self._journal.append("fault", facts, sync=True)


_EVENT_OF: dict[Outcome, steps.Event] = {
    Outcome.FIRED: steps.Fired(),
    Outcome.NOT_FIRED: steps.NotFired(),
    Outcome.INDETERMINATE: steps.FiredPerhaps(),
}


def trial_name(task: steps.Task) -> dict[str, object]:
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
