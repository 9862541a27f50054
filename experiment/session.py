"""One session: the engine's effects carried out on device, participant, noise and journal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from device.driver import DeviceError
from experiment import steps
from experiment.attendance import Attendance
from experiment.emission import Emission
from experiment.engine import step, upcoming
from experiment.entries import delivery_facts, trial_name
from experiment.noise_watch import NoiseWatch
from experiment.responder import Question
from experiment.standing import Standing

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from device.clock import Clock
    from device.driver import BurstDevice
    from experiment.interrupts import StopSignal
    from experiment.journal import Journal
    from experiment.noise_player import NoisePlayer
    from experiment.operator import Monitor, Requests
    from experiment.plan import Plan
    from experiment.replay import History
    from experiment.responder import Responder
    from experiment.study import Study

_SHOWN_BEFORE = (steps.Greet, steps.Introduce, steps.Cue, steps.Rest, steps.Farewell)
"""What takes a while: the operator is told first. From the cue's end to the answer nobody is."""


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
    noise : NoisePlayer
        The masking noise, started.
    clock : Clock
        The clock of device and responder.
    origin_s : float
        The clock's reading at the session's beginning.
    journal : Journal
        The session's journal, opened.
    requests : Requests
        What the operator asks for.
    monitor : Monitor
        What the operator is shown.
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
        noise: NoisePlayer,
        clock: Clock,
        origin_s: float,
        journal: Journal,
        requests: Requests,
        monitor: Monitor,
        stop: StopSignal,
    ) -> None:
        self._study = study
        self._device = device
        self._responder = responder
        self._participant = Attendance(responder, stop, responses=plan.responses)
        self._clock = clock
        self._origin_s = origin_s
        self._journal = journal
        self._requests = requests
        self._monitor = monitor
        self._stop = stop
        self._due_s = 0.0
        self._emission = Emission(study=study, device=device, clock=clock, journal=journal)
        self._noise = NoiseWatch(noise, journal)
        self._standing = Standing(plan, study.design, history)
        again = resumed and not responder.simulated
        self._state = steps.State(
            pending=history.due(warm_up=again),
            keep_anticipated=study.design.anticipated == "keep",
            response_window_s=study.design.response_window_s,
        )
        self._perform: Mapping[type[steps.Effect], Callable[..., steps.Event | None]] = {
            steps.Greet: self._greet,
            steps.Introduce: self._introduce,
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
            steps.StartNoise: self._start_noise,
            steps.ZeroOutputs: self._zero_outputs,
            steps.CloseSession: self._close,
            steps.Farewell: self._farewell,
        }

    @property
    def failure(self) -> DeviceError | None:
        """What the device failed with, if it did."""
        return self._emission.failure

    def run(self) -> bool:
        """Run to the end, or until the session is stopped; return whether it is complete.

        Raises
        ------
        JournalWriteError
            If the record cannot be kept; the outputs are at zero then.
        """
        try:
            event = self._look_around()
            while self._state.phase not in (steps.Phase.FINISHED, steps.Phase.STOPPED):
                event = self._step(event)
        except DeviceError as error:
            self._emission.fail(error)
            self._show()
        finally:
            self._device.stop()
        return self._state.phase is steps.Phase.FINISHED

    def _step(self, event: steps.Event) -> steps.Event:
        self._state, effects = step(self._state, event)
        answer = None
        for effect in effects:
            if isinstance(effect, _SHOWN_BEFORE):
                self._requests.take_go_on()  # one that was asked for before is none for this wait
                self._show()
            answer = self._perform[type(effect)](effect) or answer
        return self._look_around() if answer is None else answer

    def _look_around(self) -> steps.Event:
        """Between two trials: note what is new, show how it stands, heed the operator."""
        if self._state.phase is steps.Phase.READY:
            self._note()
            self._show()
        event = upcoming(self._state)
        if isinstance(event, steps.NothingLeft):
            return event
        if self._stop.asked:
            return steps.StopAsked()
        return steps.PauseAsked() if self._requests.paused else event

    def _note(self) -> None:
        """Journal the operator's notes, and the noise where it changed."""
        for text in self._requests.notes():
            self._journal.append("note", {"text": text}, sync=True)
        self._noise.note()

    def _show(self) -> None:
        failures = self._state.failures
        device = f"{failures} stimuli in a row not delivered" if failures else "ok"
        if self.failure is not None:
            device = "failed"
        status = self._standing.status(
            self._state,
            noise=self._noise.words(),
            device=device,
            message=self._noise.trouble if self.failure is None else str(self.failure),
        )
        self._monitor.show(status)

    def _greet(self, _: steps.Greet) -> steps.Event:
        return self._participant.greet(self._standing.progress(self._state))

    def _introduce(self, effect: steps.Introduce) -> steps.Event:
        return self._participant.introduce(effect.part, self._standing.progress(self._state))

    def _open_block(self, effect: steps.OpenBlock) -> None:
        trial = effect.task.trial
        facts = {"block": trial.block, "condition": trial.condition}
        self._journal.append("block_start", facts)

    def _close_block(self, effect: steps.CloseBlock) -> None:
        self._journal.append("block_end", {"block": effect.block})

    def _cue(self, effect: steps.Cue) -> None:
        trial = effect.task.trial
        self._noise.begin_trial()
        self._standing.trial_begins(self._clock.now_s())
        rested_s = self._emission.prepare(trial)
        self._responder.cue(self._standing.progress(self._state))
        self._due_s = max(self._clock.now_s() + trial.foreperiod_s, rested_s)

    def _wait(self, effect: steps.Wait) -> steps.Event:
        return self._participant.wait(effect.task, self._due_s)

    def _arm(self, effect: steps.Arm) -> steps.Event:
        return steps.NoiseLost() if self._noise.lost() else self._emission.arm(effect.task)

    def _fire(self, _: steps.Fire) -> steps.Event:
        """Emit the stimulus; nothing touches the disk from here to the answer."""
        event = self._emission.fire()
        if isinstance(event, steps.Fired):
            self._noise.hear_onset()
        return event

    def _listen(self, effect: steps.Listen) -> steps.Event:
        delivery = self._emission.delivery
        assert delivery is not None
        question = Question(
            trial=effect.task.trial.number,
            attempt=effect.task.attempt,
            level_left_vpp=delivery.level_left_vpp,
            level_right_vpp=delivery.level_right_vpp,
            onset_s=self._emission.onset_s,
            window_s=effect.window_s,
        )
        event = self._participant.ask(effect.task, question)
        lost = self._noise.lost()
        return steps.NoiseLost() if lost and not isinstance(event, steps.StopAsked) else event

    def _end_trial(self, effect: steps.EndTrial) -> None:
        name = trial_name(effect.task)
        how = {"anticipated": effect.anticipated, "noise_ok": self._noise.ok}
        if self._emission.delivery is not None:
            onset_s = round(self._emission.onset_s - self._origin_s, 6)
            facts = delivery_facts(self._emission.delivery, onset_s)
            self._journal.append("stimulus_confirmed", name | facts)
        if effect.response is not None:
            answer = {"response": effect.response, "rt_s": effect.rt_s}
            self._journal.append("response", name | answer | how)
        self._journal.append("trial_end", name | {"status": effect.status} | how, sync=True)
        self._standing.trial_ends(effect, self._clock.now_s())

    def _feedback(self, effect: steps.Feedback) -> None:
        self._responder.feedback(correct=effect.correct)

    def _rest(self, effect: steps.Rest) -> steps.Event:
        self._note()
        self._journal.append("pause" if effect.paused else "break", sync=True)
        minimum_s = 0.0 if effect.paused else self._study.design.minimum_break_s
        progress = self._standing.progress(self._state)
        event = self._participant.rest(progress, paused=effect.paused, minimum_s=minimum_s)
        if effect.paused:
            self._requests.go_on()
        return event

    def _start_noise(self, _: steps.StartNoise) -> steps.Event | None:
        return None if self._noise.start_again() else steps.NoiseLost()

    def _zero_outputs(self, _: steps.ZeroOutputs) -> None:
        self._device.stop()

    def _close(self, effect: steps.CloseSession) -> None:
        self._note()
        self._journal.append("session_close", {"finished": effect.finished}, sync=True)

    def _farewell(self, effect: steps.Farewell) -> None:
        self._noise.stop()
        self._participant.leave(self._standing.progress(self._state), finished=effect.finished)
