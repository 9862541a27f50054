"""One session: the engine's effects carried out on device, participant, noise and journal."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Final

from device.driver import Outcome
from device.errors import DeviceError
from experiment.session.attendance import Attendance
from experiment.session.markers import RECORDING_START, UNHEARD, response_marker, stimulus_marker
from experiment.session.outputs import BurstWatch, NoiseWatch, StimulusOut, measured_facts
from experiment.session.setting import delivery_facts, trial_name
from experiment.session.standing import Standing
from experiment.trial import events
from experiment.trial.engine import step, upcoming
from experiment.trial.events import Event
from experiment.trial.plan import CONTROL
from experiment.trial.responder import AwaitedAnswer

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from experiment.archive.history import History
    from experiment.archive.journal import Journal
    from experiment.session.setting import Setting
    from experiment.study.study import Study
    from experiment.trial.events import Happening
    from experiment.trial.plan import Plan


_SHOWN_BEFORE = (events.Greet, events.Introduce, events.Cue, events.Rest, events.Farewell)
"""What takes a while: the operator is told first. From the cue's end to the answer nobody is."""


TOO_EARLY: Final = (
    "the participant pressed too early too often: say that an answer comes after the vibration, "
    "then go on"
)
"""What the operator is told who is called; where nobody attends, going on is a resume."""


class Session:
    """A session in progress: the device is opened, the noise started, the journal open.

    `resumed`: after an interruption a person who had answered with the fingers on gets the warm-up
    trials. `origin_s` is the clock's reading at the session's beginning. `tables_sha256` tells the
    checksums of the tables that are built of the journal so far.
    """

    def __init__(
        self,
        setting: Setting,
        study: Study,
        plan: Plan,
        history: History,
        journal: Journal,
        *,
        tables_sha256: Callable[[], dict[str, str]],
        resumed: bool,
        origin_s: float,
    ) -> None:
        self._study = study
        self._device = setting.device
        self._responder = setting.responder
        self._participant = Attendance(setting, responses=plan.responses)
        self._clock = setting.clock
        self._origin_s = origin_s
        self._journal = journal
        self._tables_sha256 = tables_sha256
        self._requests = setting.requests
        self._display = setting.display
        self._stop = setting.stop
        self._tell = setting.tell
        self._markers = setting.markers
        self._marked = self._markers.words is None
        self._due_s = 0.0
        self._watch = BurstWatch(setting.monitor, study, setting.device)
        self._emission = StimulusOut(
            setting, study, journal, last_token=history.last_token, watch=self._watch
        )
        self._noise = NoiseWatch(setting.noise, journal)
        self._standing = Standing(plan, study.design, history)
        self._judges = setting.responder.simulated or not setting.practice
        again = resumed and not self._responder.simulated and _got_used_to_it(history)
        self._state = events.SessionState(
            pending=history.due(warm_up=again),
            keep_anticipated=study.design.anticipated == "keep",
            most_anticipated=study.design.most_anticipated,
            response_window_s=study.design.response_window_s,
        )
        self._perform: Mapping[type[events.Effect], Callable[..., Happening | None]] = {
            events.Greet: self._greet,
            events.Introduce: self._introduce,
            events.OpenBlock: self._open_block,
            events.CloseBlock: self._close_block,
            events.Cue: self._cue,
            events.Wait: self._wait,
            events.ArmStimulus: self._arm,
            events.FireStimulus: self._fire,
            events.Listen: self._listen,
            events.EndTrial: self._end_trial,
            events.Feedback: self._feedback,
            events.Rest: self._rest,
            events.OpenMonitor: self._open_monitor,
            events.StartNoise: self._start_noise,
            events.ZeroOutputs: self._zero_outputs,
            events.CloseSession: self._close,
            events.Farewell: self._farewell,
        }

    @property
    def failure(self) -> DeviceError | None:
        """What the device failed with, if it did."""
        return self._emission.failure

    def run(self) -> bool:
        """Run to the end, or until the session is stopped; return whether it is complete.

        JournalWriteError where the record cannot be kept; the outputs are at zero then.
        """
        try:
            # A device that fails while it loads a condition has no row in the table: no token
            # exists yet, so that only the fault is written, and the trial is one that was never
            # cued. Whatever ends the loop, a full disk and a fault of the program included, the
            # outputs are at zero afterwards.
            event = self._look_around()
            while self._state.phase not in (events.Phase.FINISHED, events.Phase.STOPPED):
                event = self._step(event)
        except DeviceError as error:
            self._emission.fail(error)
            self._show()
        finally:
            self._device.stop()
        return self._state.phase is events.Phase.FINISHED

    def _mark_start(self, time_s: float | None = None) -> None:
        """Send the first marker of a sitting; by its time the record is aligned to others.

        A recorder hears nothing of what was sent before it was connected, so that it is not sent
        before the start key, nor to nobody; before a marker for a past time it has that time.
        """
        if self._marked or not self._state.greeted or not self._markers.heard():
            return
        self._marked = True
        at_s = self._clock.now_s() if time_s is None else time_s
        self._markers.send(RECORDING_START, at_s)
        told = {"marker": RECORDING_START, "at_s": round(at_s - self._origin_s, 6)}
        self._journal.append("marker", told, sync=True)

    def _mark_trial(self, end: events.EndTrial) -> None:
        """Send the markers of a trial whose stimulus surely went out."""
        delivery, onset_s = self._emission.delivery, self._emission.onset_s
        if delivery is None or delivery.outcome is not Outcome.FIRED:
            return
        felt_s = self._watch.onset_s(or_told_s=onset_s)
        self._mark_start(min(onset_s, felt_s))
        self._markers.send(stimulus_marker(end.task, delivery), felt_s)
        if end.response is not None and end.rt_s is not None:
            self._markers.send(response_marker(end.task, end.response), onset_s + end.rt_s)

    def _step(self, event: Happening) -> Happening:
        self._state, effects = step(self._state, event)
        answer = None
        for effect in effects:
            if isinstance(effect, _SHOWN_BEFORE):
                self._requests.take_go_on()  # one that was asked for before is none for this wait
                self._show()
            answer = self._perform[type(effect)](effect) or answer
        return self._look_around() if answer is None else answer

    def _look_around(self) -> Happening:
        """Between two trials: note what is new, show how it stands, heed the operator."""
        if self._state.phase is events.Phase.READY:
            self._note()
            self._mark_start()
            self._show()
        # A session with no trial left is finished even if a stop was asked for: as stopped it would
        # be resumed for nothing. A stop comes before a pause, which would wait for somebody to go
        # on.
        event = upcoming(self._state)
        if event is Event.NOTHING_LEFT:
            return event
        if self._stop.asked:
            return Event.STOP_ASKED
        return Event.PAUSE_ASKED if self._requests.paused else event

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
            message=self._trouble(),
        )
        self._display.show(status)

    def _trouble(self) -> str:
        """Say what the operator has to know, the worst first."""
        if self.failure is not None:
            return str(self.failure)
        called = TOO_EARLY if self._state.called else ""
        unheard = "" if self._markers.words is None or self._markers.heard() else UNHEARD
        worse = called or self._noise.trouble or self._watch.trouble
        return worse or self._participant.ignored or unheard

    def _greet(self, _: events.Greet) -> Happening:
        return self._participant.greet(self._standing.progress(self._state))

    def _introduce(self, effect: events.Introduce) -> Happening:
        return self._participant.introduce(effect.part, self._standing.progress(self._state))

    def _open_block(self, effect: events.OpenBlock) -> None:
        trial = effect.task.trial
        facts = {"block": trial.block, "condition": trial.condition}
        self._journal.append("block_start", facts)

    def _close_block(self, effect: events.CloseBlock) -> None:
        self._journal.append("block_end", {"block": effect.block})

    def _cue(self, effect: events.Cue) -> None:
        trial = effect.task.trial
        self._noise.begin_trial()
        self._standing.trial_begins(self._clock.now_s())
        rested_s = self._emission.prepare(trial)
        self._participant.cue(self._standing.progress(self._state))
        # The foreperiod runs from the end of the cue, for loading a condition may take a while. The
        # device may need longer: its rest after the stimulus before is kept whatever was drawn.
        self._due_s = max(self._clock.now_s() + trial.foreperiod_s, rested_s)

    def _wait(self, effect: events.Wait) -> Happening:
        return self._participant.wait(effect.task, self._due_s)

    def _arm(self, effect: events.ArmStimulus) -> Happening:
        return Event.NOISE_LOST if self._noise.lost() else self._emission.arm(effect.task)

    def _fire(self, _: events.FireStimulus) -> Happening:
        """Emit the stimulus; nothing touches the disk from here to the answer."""
        event = self._emission.fire()
        if event is Event.FIRED:
            self._noise.hear_onset()
        return event

    def _listen(self, effect: events.Listen) -> Happening:
        delivery = self._emission.delivery
        assert delivery is not None
        question = AwaitedAnswer(
            trial=effect.task.trial.number,
            attempt=effect.task.attempt,
            level_left_vpp=delivery.level_left_vpp,
            level_right_vpp=delivery.level_right_vpp,
            onset_s=self._emission.onset_s,
            window_s=effect.window_s,
            answers=self._participant.answers(effect.task),
        )
        # The noise is asked for when the answer is in, for nothing may be done while it is awaited.
        # Lost noise voids any answer; only a stop outranks it, or the session would go on in a
        # pause.
        event = self._participant.ask(effect.task, question)
        lost = self._noise.lost()
        self._watch.measure(delivery)
        if event is Event.STOP_ASKED:
            return event
        if lost:
            return Event.NOISE_LOST
        refused = self._watch.refused and event is not Event.PAUSE_ASKED
        return Event.NOT_VERIFIED if refused else event

    def _end_trial(self, effect: events.EndTrial) -> None:
        # What became of the stimulus and of the answer is written only here, with one sync at the
        # end: from the onset to the answer nothing may touch the disk. If these lines are lost, the
        # token that lies on the disk since before the onset is enough for the device to tell
        # whether it played.
        name = trial_name(effect.task)
        how = {"anticipated": effect.anticipated, "noise_ok": self._noise.ok}
        if self._emission.delivery is not None:
            onset_s = round(self._emission.onset_s - self._origin_s, 6)
            facts = delivery_facts(self._emission.delivery, onset_s)
            self._journal.append("stimulus_confirmed", name | facts)
            self._watch.measure(self._emission.delivery)
        measured, planned = self._watch.measured, self._watch.planned
        if measured is not None and planned is not None:
            facts = measured_facts(measured, planned, self._origin_s)
            self._journal.append("stimulus_measured", name | facts)
        if effect.response is not None:
            answer = {"response": effect.response, "rt_s": effect.rt_s}
            self._journal.append("response", name | answer | how)
        self._journal.append("trial_end", name | {"status": effect.status} | how, sync=True)
        self._mark_trial(effect)
        self._standing.trial_ends(effect, self._clock.now_s())

    def _feedback(self, effect: events.Feedback) -> None:
        if self._judges:  # where nothing moved no answer of a person is right or wrong
            self._participant.feedback(correct=effect.correct)

    def _rest(self, effect: events.Rest) -> Happening:
        self._note()
        why = TOO_EARLY if self._state.called else ""
        if self._state.unverified and not why:
            why = self._watch.trouble
        called = {"operator_called": why} if why else None
        self._journal.append("pause" if effect.paused else "break", called, sync=True)
        if called and self._requests.attended:
            self._requests.pause()  # the participant, whom it does not concern, does not end it
        elif called:  # nobody could tell whether the operator goes on or the participant
            on = "" if why.endswith("go on") else "; go on"
            self._tell(f"Stopped: {why}{on} with --resume.")
            return Event.STOP_ASKED
        minimum_s = 0.0 if effect.paused else self._study.design.minimum_break_s
        progress = self._standing.progress(self._state)
        event = self._participant.rest(progress, paused=effect.paused, minimum_s=minimum_s)
        if effect.paused:
            self._requests.go_on()
        return event

    def _open_monitor(self, _: events.OpenMonitor) -> Happening | None:
        return None if self._watch.open_again() else Event.NOT_VERIFIED

    def _start_noise(self, _: events.StartNoise) -> Happening | None:
        return None if self._noise.start_again() else Event.NOISE_LOST

    def _zero_outputs(self, _: events.ZeroOutputs) -> None:
        self._device.stop()

    def _close(self, effect: events.CloseSession) -> None:
        self._note()
        told: dict[str, object] = {"finished": effect.finished}
        # With them the last line seals the tables, too: who reads all need not build them anew. But
        # a session has ended whatever lies there: who writes the tables next says what is wrong.
        with contextlib.suppress(ValueError, OSError):
            told |= self._tables_sha256()
        self._journal.append("session_close", told, sync=True)

    def _farewell(self, effect: events.Farewell) -> None:
        self._noise.stop()
        self._participant.leave(self._standing.progress(self._state), finished=effect.finished)


def _got_used_to_it(history: History) -> bool:
    """Tell whether a person had answered with the fingers on, and is not to practise anyway."""
    answered = any(row.kind != CONTROL and row.status == "ok" for row in history.rows)
    return answered and all(task.trial.kind != "practice" for task in history.pending)
