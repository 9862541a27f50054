"""One session: the engine's effects carried out on device, participant, noise and journal."""

from __future__ import annotations

import contextlib
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from device.driver import Outcome
from device.errors import DeviceError
from experiment.hardware.safety import Purpose
from experiment.record.entries import (
    BlockEnded,
    BlockStarted,
    BreakStarted,
    MarkerSent,
    NoteTaken,
    PauseStarted,
    ResponseGiven,
    SessionClosed,
    StimulusConfirmed,
    TrialEnded,
)
from experiment.session.levels import LevelTracks
from experiment.session.markers import RECORDING_START, UNHEARD, response_marker, stimulus_marker
from experiment.session.participant import GuardedResponder
from experiment.session.progress import SessionProgress
from experiment.session.stimulus import StimulusDelivery
from experiment.session.watch import BurstMonitor, NoiseMonitor
from experiment.trial import events
from experiment.trial.engine import next_event, step
from experiment.trial.events import Event
from experiment.trial.plan import HANDS_OFF, PRACTICE
from experiment.trial.responder import AwaitedAnswer

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from experiment.record.folder import SessionFolder
    from experiment.record.history import History
    from experiment.record.journal import Journal
    from experiment.session.config import SessionConfig
    from experiment.study.study import Study
    from experiment.trial.events import Attempt, Input
    from experiment.trial.plan import Plan, Trial
    from experiment.trial.responder import Progress


_SHOWN_BEFORE = (events.Welcome, events.Introduce, events.Cue, events.Rest, events.Farewell)
"""Before these longer steps the operator's status is updated, and not from cue to answer."""


TOO_MANY_PREMATURE: Final = (
    "Too many premature responses: remind the participant to answer after the vibration"
)
"""The message with which the operator is called."""


class Session:
    """A session in progress: the device is opened, the noise started, the journal open.

    `resumed`: after an interruption a person who had answered with the fingers on gets the warm-up
    trials. `origin_s` is the clock's reading at the session's beginning. `stimulus` holds what the
    device failed with, if it did.
    """

    def __init__(
        self,
        config: SessionConfig,
        study: Study,
        plan: Plan,
        folder: SessionFolder,
        journal: Journal,
        *,
        resumed: bool,
        origin_s: float,
    ) -> None:
        history = folder.read_history(plan)
        self._config = config
        self._study = study
        self._plan = plan
        self._responder = config.responder
        self._participant = GuardedResponder(config, plan)
        self._clock = config.clock
        self._origin_s = origin_s
        self._journal = journal
        self._tables_sha256 = partial(folder.tables_sha256, plan)
        self._requests = config.requests
        self._markers = config.markers
        self._marked = False
        self._due_markers: list[tuple[str, float]] = []
        self._gap_end_s = 0.0
        self.stimulus = StimulusDelivery(config, study, journal, last_token=history.last_token)
        self._bursts = BurstMonitor(config, study)
        self._noise = NoiseMonitor(config.noise, journal)
        self._counts = SessionProgress(plan, study, history)
        self._levels = LevelTracks(plan, history)
        # In practice without a device nothing moves, so that no answer of a person is right.
        is_practice = config.purpose is Purpose.PRACTICE
        self._gives_feedback = config.responder.simulated or not is_practice
        warm_up = resumed and not self._responder.simulated and _needs_warm_up(history)
        self._state = events.SessionState(
            pending=history.due(warm_up=warm_up),
            accept_premature=study.design.premature_responses == "accept",
            max_premature=study.design.max_premature,
            response_window_s=study.design.response_window_s,
            n_intervals=plan.task.n_intervals,
        )
        attend = self._participant.attend
        self._perform: Mapping[type[events.Effect], Callable[[Any], Input | None]] = {
            events.Welcome: lambda _: attend(self._responder.begin, self._progress()),
            events.Introduce: lambda effect: attend(
                self._responder.introduce, effect.part, self._progress()
            ),
            events.OpenBlock: lambda effect: journal.append(
                BlockStarted(
                    block=effect.attempt.trial.block, condition=effect.attempt.trial.condition
                )
            ),
            events.CloseBlock: lambda effect: journal.append(BlockEnded(block=effect.block)),
            events.Cue: self._cue,
            events.CueInterval: self._cue_interval,
            events.Pass: self._pass_gap,
            events.Wait: lambda effect: self._participant.wait(effect.attempt, self._due_s),
            events.ArmStimulus: self._arm,
            events.FireStimulus: self._fire,
            events.Listen: self._listen,
            events.EndTrial: self._end_trial,
            events.Feedback: lambda effect: (
                self._participant.feedback(correct=effect.correct) if self._gives_feedback else None
            ),
            events.Rest: self._rest,
            events.OpenMonitor: lambda _: self._bursts.reopen(),
            events.StartNoise: lambda _: self._noise.start_again(),
            events.ZeroOutputs: lambda _: self._config.device.stop(),
            events.CloseSession: self._close,
            events.Farewell: self._farewell,
        }

    def run(self) -> bool:
        """Run to the end, or until the session is stopped; return whether it is complete.

        JournalWriteError where the record cannot be kept; the outputs are at zero then.
        """
        try:
            # A device that fails while it loads a condition has no row in the table: no token
            # exists yet, so that only the fault is written, and the trial is one that was never
            # cued. Whatever ends the loop, a full disk and a fault of the program included, the
            # outputs are at zero afterwards.
            event = self._next_event()
            while self._state.phase not in (events.Phase.FINISHED, events.Phase.STOPPED):
                event = self._step(event)
        except DeviceError as error:
            self.stimulus.fail(error)
            self._show()
        finally:
            self._config.device.stop()
        return self._state.phase is events.Phase.FINISHED

    def _mark_start(self, at_s: float) -> None:
        """Send the first marker of a visit, by whose time the record is aligned to others.

        A recorder misses markers from before its connection. The marker is therefore sent after the
        start key, and only while a recorder is connected. If a marker for an earlier time follows,
        it has that time.
        """
        markers = self._markers
        if markers is None or self._marked or not (self._state.welcomed and markers.heard()):
            return
        self._marked = True
        markers.send(RECORDING_START, at_s)
        line = MarkerSent(marker=RECORDING_START, at_s=round(at_s - self._origin_s, 6))
        self._journal.append(line, sync=True)

    def _mark_trial(self, end: events.EndTrial) -> None:
        """Send the markers of the bursts that surely went out, and that of the answer."""
        markers, self._due_markers = self._due_markers, []
        if self._markers is None or not markers:
            return
        if end.response is not None and end.rt_s is not None:
            answered_s = self.stimulus.onset_s + end.rt_s
            markers.append((response_marker(end.attempt, end.response), answered_s))
        self._mark_start(min(markers[0][1], self.stimulus.onset_s))
        for marker, at_s in markers:
            self._markers.send(marker, at_s)

    def _step(self, event: Input) -> Input:
        self._state, effects = step(self._state, event, self._plan.task)
        answer = None
        for effect in effects:
            if isinstance(effect, _SHOWN_BEFORE):
                self._requests.take_continue()  # an earlier request does not end this wait
                self._show()
            answer = self._perform[type(effect)](effect) or answer
        return self._next_event() if answer is None else answer

    def _next_event(self) -> Input:
        """Write notes and update the display between two trials; return the next event."""
        if self._state.phase is events.Phase.READY:
            self._note()
            self._mark_start(self._clock.now_s())
            self._show()
        # A session with no trial left is finished even if a stop was requested, because there would
        # be nothing to resume. A stop comes before a pause, which would wait to be continued.
        event = next_event(self._state)
        if event is Event.NO_TRIAL_LEFT:
            return event
        if self._config.stop.is_requested:
            return Event.STOP_REQUESTED
        if self._requests.paused:
            return Event.PAUSE_REQUESTED
        if event is Event.TRIAL_STARTS:
            self._state = self._levels.choose(self._state)
        return event

    def _note(self) -> None:
        """Journal the operator's notes, and the noise where it changed."""
        for text in self._requests.notes():
            self._journal.append(NoteTaken(text=text), sync=True)
        self._noise.note()

    def _show(self) -> None:
        state, failure = self._state, self.stimulus.failure
        device = f"{state.failures} stimuli in a row not delivered" if state.failures else "ok"
        is_unheard = self._markers is not None and not self._markers.heard()
        messages = (  # the worst first
            "" if failure is None else str(failure),
            TOO_MANY_PREMATURE if state.operator_needed else "",
            self._noise.trouble,
            self._bursts.trouble,
            self._participant.ignored,
            UNHEARD if is_unheard else "",
        )
        status = self._counts.status(
            state,
            noise=self._config.noise.health().message,
            device=device if failure is None else "failed",
            message=next(filter(None, messages), ""),
            estimates=self._levels.describe(),
        )
        self._config.show(status)

    def _progress(self) -> Progress:
        return self._counts.progress(self._state)

    def _cue(self, effect: events.Cue) -> None:
        trial = effect.attempt.trial
        self._noise.ok = None  # nothing was heard in this trial yet
        self._bursts.clear()
        self._counts.trial_begins(self._clock.now_s())
        self.stimulus.prepare(trial)
        self._participant.cue(self._progress())
        if self._state.n_intervals > 1:
            self._participant.interval(1)
        self._begin_foreperiod(trial)

    def _begin_foreperiod(self, trial: Trial) -> None:
        # The foreperiod runs from the end of the cue, for loading a condition may take a while. The
        # device may need longer: its rest after the stimulus before is kept whatever was drawn.
        self._due_s = max(self._clock.now_s() + trial.foreperiod_s, self.stimulus.rested_s)

    def _pass_gap(self, effect: events.Pass) -> Input:
        event = self._participant.wait(effect.attempt, self._gap_end_s)
        self._bursts.measure(self.stimulus.delivery)
        if event is Event.STOP_REQUESTED:
            return event
        if self._noise.lost():
            return Event.NOISE_LOST
        if self._bursts.is_repeated and event is not Event.PAUSE_REQUESTED:
            return Event.BURST_MISMATCH
        return Event.INTERVAL_STARTS if event is Event.ELAPSED else event

    def _cue_interval(self, effect: events.CueInterval) -> None:
        # on the disk with the next token
        self._record_burst(effect.attempt, effect.interval - 1)
        self.stimulus.delivery = None
        self._bursts.clear()
        self._participant.interval(effect.interval)
        self._begin_foreperiod(effect.attempt.trial)

    def _arm(self, effect: events.ArmStimulus) -> Input:
        if self._noise.lost():
            return Event.NOISE_LOST
        attempt, interval = effect.attempt, self._state.interval
        chosen = self._levels.line(attempt) if interval == 1 else None
        event = self.stimulus.arm(attempt, interval, chosen)
        if event is Event.ARMED:
            stimulus = self.stimulus
            self._bursts.expect(attempt.trial.condition, stimulus.sites, stimulus.level_vpp)
        return event

    def _fire(self, _: events.FireStimulus) -> Input:
        """Emit the stimulus; nothing touches the disk from here to the answer."""
        self._bursts.begin(self.stimulus.token)
        event = self.stimulus.fire()
        if event is Event.FIRED:
            self._noise.hear_onset()
            if self._state.interval < self._state.n_intervals:
                self._gap_end_s = self._clock.now_s() + (self._study.task_choice.gap_s or 0.0)
                self._participant.interval(None)
        return event

    def _listen(self, effect: events.Listen) -> Input:
        delivery = self.stimulus.delivery
        assert delivery is not None
        question = AwaitedAnswer(
            trial=effect.attempt.trial.number,
            attempt=effect.attempt.number,
            levels_vpp=tuple(each.levels_vpp for each in self.stimulus.deliveries),
            onset_s=self.stimulus.onset_s,
            window_s=effect.window_s,
            answers=self._plan.answers_to(effect.attempt.trial),
        )
        # The noise is checked after the answer, because nothing may run while an answer is awaited.
        # Lost noise voids any answer. Only a stop takes precedence, else the session would continue
        # in a pause.
        event = self._participant.ask(effect.attempt, question)
        lost = self._noise.lost()
        self._bursts.measure(delivery)
        if event is Event.STOP_REQUESTED:
            return event
        if lost:
            return Event.NOISE_LOST
        refused = self._bursts.is_repeated and event is not Event.PAUSE_REQUESTED
        return Event.BURST_MISMATCH if refused else event

    def _end_trial(self, effect: events.EndTrial) -> None:
        # What became of the stimulus and of the answer is written only here, with one sync at the
        # end: from the onset to the answer nothing may touch the disk. If these lines are lost, the
        # token, which is on the disk before the onset, suffices to ask the device whether it
        # played.
        attempt, noise_ok = effect.attempt, self._noise.ok
        name: dict[str, Any] = {"trial": attempt.trial.number, "attempt": attempt.number}
        self._record_burst(attempt, self._state.interval)
        if effect.response is not None:
            response = ResponseGiven(
                **name,
                response=effect.response,
                rt_s=effect.rt_s,
                premature=effect.premature,
                noise_ok=noise_ok,
            )
            self._journal.append(response)
        end = TrialEnded(
            **name, status=effect.status, premature=effect.premature, noise_ok=noise_ok
        )
        self._journal.append(end, sync=True)
        self._mark_trial(effect)
        self._levels.trial_ends(effect)
        self._counts.trial_ends(effect, self._clock.now_s())

    def _record_burst(self, attempt: Attempt, interval: int) -> None:
        """Journal what became of the burst of an interval, and keep its marker."""
        delivery, onset_s = self.stimulus.delivery, self.stimulus.onset_s
        if delivery is None:
            return
        at_s = round(onset_s - self._origin_s, 6)
        self._journal.append(StimulusConfirmed.from_delivery(attempt, interval, delivery, at_s))
        self._bursts.measure(delivery)
        measurement, measured = (
            self._bursts.line(attempt, interval, self._origin_s),
            self._bursts.measured,
        )
        if measurement is not None:
            self._journal.append(measurement)
        if delivery.outcome is Outcome.FIRED:
            measured_s = None if measured is None or measured.faults else measured.onset_s
            at_s = onset_s if measured_s is None else measured_s
            self._due_markers.append((stimulus_marker(attempt, interval, delivery), at_s))

    def _rest(self, effect: events.Rest) -> Input:
        self._note()
        mismatch = self._bursts.trouble if self._state.burst_mismatch else ""
        why = TOO_MANY_PREMATURE if self._state.operator_needed else mismatch
        line = PauseStarted(operator_called=why or None) if effect.paused else BreakStarted()
        self._journal.append(line, sync=True)
        if why and self._requests.attended:
            self._requests.pause()  # the participant, whom it does not concern, does not end it
        elif why:  # the participant must not continue in place of the operator
            self._config.report(f"Stopped. {why}. Continue with --resume.")
            return Event.STOP_REQUESTED
        minimum_s = 0.0 if effect.paused else self._study.design.min_break_s
        event = self._participant.attend(
            self._responder.pause, self._progress(), paused=effect.paused, minimum_s=minimum_s
        )
        if effect.paused:
            self._requests.request_continue()
        return event

    def _close(self, effect: events.CloseSession) -> None:
        self._note()
        sha256: dict[str, Any] = {}
        # With these hashes the last line seals the tables, too, so that a reader need not rebuild
        # them. A session has ended even if a table cannot be read; writing the tables reports that.
        with contextlib.suppress(ValueError, OSError):
            sha256 = self._tables_sha256()
        self._journal.append(SessionClosed(finished=effect.finished, **sha256), sync=True)

    def _farewell(self, effect: events.Farewell) -> None:
        self._config.noise.stop()
        # A stop from outside leaves no time for it.
        self._participant.attend(self._responder.end, self._progress(), finished=effect.finished)


def _needs_warm_up(history: History) -> bool:
    """Return whether a person had answered with the hands on, and is not to practise anyway."""
    answered = any(row.kind != HANDS_OFF and row.status == "ok" for row in history.rows)
    return answered and all(attempt.trial.kind != PRACTICE for attempt in history.pending)
