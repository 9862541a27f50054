"""The trial engine: which step follows which event, as one table.

`step` is a pure function of state and event: it knows no clock, no port and no file. It returns
effects, which the caller performs; the caller then answers with the next event.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from experiment.study.design import EARLIEST_ANSWER_S
from experiment.tasks import LEFT_RIGHT_BOTH
from experiment.trial.events import (
    ArmStimulus,
    CloseBlock,
    CloseSession,
    Cue,
    CueInterval,
    Effect,
    EndTrial,
    Event,
    Farewell,
    Feedback,
    FireStimulus,
    Input,
    Introduce,
    Listen,
    OpenBlock,
    OpenMonitor,
    Pass,
    Phase,
    Response,
    Rest,
    SessionState,
    StartNoise,
    Wait,
    Welcome,
    ZeroOutputs,
)
from experiment.trial.plan import PRACTICE, PRACTICE_BLOCK

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from experiment.tasks.task import Task
    from experiment.trial.events import Status


Change: TypeAlias = tuple[SessionState, tuple[Effect, ...]]


class Transition(NamedTuple):
    """Where the session goes, and the status with which the current trial ends, if it ends."""

    then: Phase
    trial: Status | None = None


# A row reads aloud: "in the foreperiod, when a pause is requested, the session is paused, and the
# trial ends as aborted". A row states nothing else. `_ON_EVENT` has the changes that an event makes
# in every phase (lost noise is noted, a block is opened). `_ON_ENTRY` has the effects of entering a
# phase from anywhere (a pause offers a rest, a stop says good-bye). Neither can therefore be
# forgotten in one of the rows.
#
# From its cue on a trial ends exactly once. Every row that leads from FOREPERIOD, ARMING, FIRING,
# GAP or ANSWER to a phase that is none of them therefore names a status, and no other row does. The
# trial has one or more observation intervals: as long as another one follows, FIRING leads to GAP,
# and from there to the next foreperiod. The status
# states what the participant got: "aborted" is for a stimulus that was never requested from the
# device, "voided" for one that was presented and for a trial with a premature response,
# "device_error" for one that the device certainly did not play, and "indeterminate" for one whose
# outcome is unknown. A device that fails while it arms and one that fails while it fires therefore
# lead to different statuses. Once the burst of an interval was presented, the trial is voided if a
# later one is never requested. Every status but "ok" puts the trial at the end of its block, so
# that each planned trial is "ok" exactly once.
#
# ARMING and FIRING have no row for keys, pauses and stops: they last milliseconds, in which no
# input is read, and a stimulus on its way must have an outcome before anything else is decided.
# Lost noise has no row in FOREPERIOD and FIRING either: it is checked last before arming, and after
# the onset together with the answer. A stimulus that failed is tried again; the third failure in a
# row stops the session, because the device does not work. A trial with a premature response is also
# repeated. A participant who holds a key down, or answers the cue, would get such bursts without
# end. After the number that the study states, in a row or at one trial, the session is therefore
# paused and the operator called.
#
# A burst that a monitor measured otherwise than planned, or not at all, may have been felt, but not
# as the stimulus that the trial counts. The trial is "indeterminate", and the operator is called,
# because the next burst would fail, too. The mismatch is reported with the answer, because
# measuring takes time. It takes precedence over a premature response, but not over a pause, a stop
# or lost noise, which void the trial anyway.
#
# An event without a row cannot occur. If it does, the program is at fault, and nothing is changed.
TRANSITIONS: Mapping[tuple[Phase, Event], Transition] = {
    (Phase.READY, Event.VISIT_STARTS): Transition(Phase.WELCOME),
    (Phase.READY, Event.PART_STARTS): Transition(Phase.INTRODUCTION),
    (Phase.READY, Event.TRIAL_STARTS): Transition(Phase.FOREPERIOD),
    (Phase.READY, Event.PRACTICE_ENDS): Transition(Phase.READY),
    (Phase.READY, Event.BREAK_STARTS): Transition(Phase.BREAK),
    (Phase.READY, Event.NOISE_LOST): Transition(Phase.PAUSED),
    (Phase.READY, Event.BURST_MISMATCH): Transition(Phase.PAUSED),
    (Phase.READY, Event.PAUSE_REQUESTED): Transition(Phase.PAUSED),
    (Phase.READY, Event.NO_TRIAL_LEFT): Transition(Phase.FINISHED),
    (Phase.READY, Event.STOP_REQUESTED): Transition(Phase.STOPPED),
    (Phase.WELCOME, Event.CONTINUED): Transition(Phase.READY),
    (Phase.WELCOME, Event.STOP_REQUESTED): Transition(Phase.STOPPED),
    (Phase.INTRODUCTION, Event.CONTINUED): Transition(Phase.READY),
    (Phase.INTRODUCTION, Event.STOP_REQUESTED): Transition(Phase.STOPPED),
    (Phase.FOREPERIOD, Event.ELAPSED): Transition(Phase.ARMING),
    (Phase.FOREPERIOD, Event.PREMATURE): Transition(Phase.READY, "voided"),
    (Phase.FOREPERIOD, Event.TOO_MANY_PREMATURE): Transition(Phase.PAUSED, "voided"),
    (Phase.FOREPERIOD, Event.PREMATURE_ACCEPTED): Transition(Phase.FOREPERIOD),
    (Phase.FOREPERIOD, Event.PAUSE_REQUESTED): Transition(Phase.PAUSED, "aborted"),
    (Phase.FOREPERIOD, Event.STOP_REQUESTED): Transition(Phase.STOPPED, "aborted"),
    (Phase.ARMING, Event.ARMED): Transition(Phase.FIRING),
    (Phase.ARMING, Event.NOISE_LOST): Transition(Phase.PAUSED, "aborted"),
    (Phase.ARMING, Event.DEVICE_FAILED): Transition(Phase.STOPPED, "device_error"),
    (Phase.FIRING, Event.FIRED): Transition(Phase.ANSWER),
    (Phase.FIRING, Event.INTERVAL_FIRED): Transition(Phase.GAP),
    (Phase.FIRING, Event.NOT_FIRED): Transition(Phase.READY, "device_error"),
    (Phase.FIRING, Event.TOO_MANY_FAILURES): Transition(Phase.STOPPED, "device_error"),
    (Phase.FIRING, Event.DELIVERY_UNKNOWN): Transition(Phase.READY, "indeterminate"),
    (Phase.FIRING, Event.DEVICE_FAILED): Transition(Phase.STOPPED, "indeterminate"),
    (Phase.GAP, Event.INTERVAL_STARTS): Transition(Phase.FOREPERIOD),
    (Phase.GAP, Event.PREMATURE): Transition(Phase.READY, "voided"),
    (Phase.GAP, Event.TOO_MANY_PREMATURE): Transition(Phase.PAUSED, "voided"),
    (Phase.GAP, Event.PREMATURE_ACCEPTED): Transition(Phase.GAP),
    (Phase.GAP, Event.BURST_MISMATCH): Transition(Phase.PAUSED, "indeterminate"),
    (Phase.GAP, Event.NOISE_LOST): Transition(Phase.PAUSED, "voided"),
    (Phase.GAP, Event.PAUSE_REQUESTED): Transition(Phase.PAUSED, "voided"),
    (Phase.GAP, Event.STOP_REQUESTED): Transition(Phase.STOPPED, "voided"),
    (Phase.ANSWER, Event.RESPONSE): Transition(Phase.READY, "ok"),
    (Phase.ANSWER, Event.PREMATURE): Transition(Phase.READY, "voided"),
    (Phase.ANSWER, Event.TOO_MANY_PREMATURE): Transition(Phase.PAUSED, "voided"),
    (Phase.ANSWER, Event.PREMATURE_ACCEPTED): Transition(Phase.READY, "ok"),
    (Phase.ANSWER, Event.ELAPSED): Transition(Phase.READY, "ok"),
    (Phase.ANSWER, Event.BURST_MISMATCH): Transition(Phase.PAUSED, "indeterminate"),
    (Phase.ANSWER, Event.NOISE_LOST): Transition(Phase.PAUSED, "voided"),
    (Phase.ANSWER, Event.PAUSE_REQUESTED): Transition(Phase.PAUSED, "voided"),
    (Phase.ANSWER, Event.STOP_REQUESTED): Transition(Phase.STOPPED, "voided"),
    (Phase.BREAK, Event.CONTINUED): Transition(Phase.READY),
    (Phase.BREAK, Event.STOP_REQUESTED): Transition(Phase.STOPPED),
    (Phase.PAUSED, Event.CONTINUED): Transition(Phase.READY),
    (Phase.PAUSED, Event.STOP_REQUESTED): Transition(Phase.STOPPED),
}
"""The table of the session: in this phase, on this event, go there and end the trial so."""


def _change(**changes: Any) -> Callable[[SessionState], Change]:
    """Return a function that sets fields of the state, and does nothing else."""
    return lambda state: (replace(state, **changes), ())


def _cue(state: SessionState) -> Change:
    """Open the block where it is new, and show that a trial begins."""
    attempt = state.pending[0]
    opening = () if state.block is not None else (OpenBlock(attempt),)
    begun = replace(state, block=attempt.trial.block, premature=False, interval=1)
    return begun, (*opening, Cue(attempt))


def _cue_interval(state: SessionState) -> Change:
    interval = state.interval + 1
    return replace(state, interval=interval), (CueInterval(state.pending[0], interval),)


def _close_block(state: SessionState) -> Change:
    closing = () if state.block is None else (CloseBlock(state.block),)
    return replace(state, block=None), closing


def _count_premature(state: SessionState) -> Change:
    in_a_row = state.premature_in_a_row + 1
    return replace(state, premature=True, premature_in_a_row=in_a_row), ()


def _call_operator(state: SessionState) -> Change:
    return replace(_count_premature(state)[0], operator_needed=True), ()


def _continue(state: SessionState) -> Change:
    """Restart lost noise or a monitor; if the operator came, reset the premature responses."""
    in_a_row = 0 if state.operator_needed else state.premature_in_a_row
    noise: tuple[Effect, ...] = (StartNoise(),) if state.noise_lost else ()
    monitor: tuple[Effect, ...] = (OpenMonitor(),) if state.burst_mismatch else ()
    after = replace(state, noise_lost=False, burst_mismatch=False, operator_needed=False)
    return replace(after, premature_in_a_row=in_a_row), (*monitor, *noise)


_ON_EVENT: Mapping[Event, Callable[[SessionState], Change]] = {
    Event.VISIT_STARTS: _change(welcomed=True),
    Event.PART_STARTS: lambda state: (replace(state, part=state.pending[0].part), ()),
    Event.TRIAL_STARTS: _cue,
    Event.PRACTICE_ENDS: _close_block,
    Event.BREAK_STARTS: _close_block,
    Event.NO_TRIAL_LEFT: _close_block,
    Event.PREMATURE: _count_premature,
    Event.TOO_MANY_PREMATURE: _call_operator,
    Event.PREMATURE_ACCEPTED: _count_premature,
    Event.NOT_FIRED: lambda state: (replace(state, failures=state.failures + 1), ()),
    Event.DELIVERY_UNKNOWN: lambda state: (replace(state, failures=state.failures + 1), ()),
    Event.FIRED: _change(failures=0),
    Event.INTERVAL_FIRED: _change(failures=0),
    Event.INTERVAL_STARTS: _cue_interval,
    Event.BURST_MISMATCH: _change(burst_mismatch=True),
    Event.NOISE_LOST: _change(noise_lost=True),
    Event.CONTINUED: _continue,
}
"""What an event changes by itself; the others only lead on."""


_ON_ENTRY: Mapping[Phase, Callable[[SessionState], tuple[Effect, ...]]] = {
    Phase.READY: lambda _: (),
    Phase.WELCOME: lambda _: (Welcome(),),
    Phase.INTRODUCTION: lambda state: (Introduce(state.pending[0].part),),
    Phase.FOREPERIOD: lambda state: (Wait(state.pending[0]),),
    Phase.ARMING: lambda state: (ArmStimulus(state.pending[0]),),
    Phase.FIRING: lambda state: (FireStimulus(state.pending[0]),),
    Phase.GAP: lambda state: (Pass(state.pending[0]),),
    Phase.ANSWER: lambda state: (Listen(state.pending[0], state.response_window_s),),
    Phase.BREAK: lambda _: (Rest(paused=False),),
    Phase.PAUSED: lambda _: (Rest(paused=True),),
    Phase.FINISHED: lambda _: (CloseSession(finished=True), Farewell(finished=True)),
    Phase.STOPPED: lambda _: (CloseSession(finished=False), Farewell(finished=False)),
}
"""What is done in a phase that was just reached, however it was reached."""

_TIMEOUT = Response("timeout", None)
"""What is recorded where no answer came in its time."""


def _complete(state: SessionState, response: Response, task: Task) -> Change:
    """Record the answer; the trial is not presented again."""
    attempt, *rest = state.pending
    end = EndTrial(
        attempt=attempt,
        status="ok",
        response=response.answer,
        rt_s=response.rt_s,
        premature=state.premature,
    )
    is_correct = task.is_correct(attempt.trial.side, attempt.trial.level_vpp, response.answer)
    is_told = attempt.trial.kind == PRACTICE and is_correct is not None
    feedback = (Feedback(bool(is_correct)),) if is_told else ()
    return replace(state, pending=tuple(rest), premature_in_a_row=0), (end, *feedback)


def _repeat(state: SessionState, status: Status) -> Change:
    """End the trial with this status and put it at the end of its block, or of the warm-up."""
    attempt, *rest = state.pending
    if status == "aborted" and state.interval > 1:
        status = "voided"
    end = EndTrial(attempt=attempt, status=status, premature=state.premature)
    group = (attempt.trial.block, attempt.part)
    later = (i for i, a in enumerate(rest) if (a.trial.block, a.part) != group)
    repeated = replace(
        attempt, number=attempt.number + 1, premature=attempt.premature + state.premature
    )
    rest.insert(next(later, len(rest)), repeated)
    return replace(state, pending=tuple(rest)), (end,)


MAX_FAILURES_IN_A_ROW = 3
"""So many stimuli in a row that were not delivered are a failure of the device."""


class IllegalStepError(RuntimeError):
    """An event that the table does not know in this phase: a fault of the program."""


def step(state: SessionState, event: Input, task: Task = LEFT_RIGHT_BOTH) -> Change:
    """Return the state after an event, and what is to be done.

    Parameters
    ----------
    state : SessionState
        State of the session; it is not changed.
    event : Event or Response
        What happened; an answer is a `Response`.
    task : Task
        The task, which says whether a practice answer is correct.

    Raises
    ------
    IllegalStepError
        If the table has no row for this event in this phase.
    """
    kind = _classify(state, event)
    row = TRANSITIONS.get((state.phase, kind))
    if row is None:
        raise IllegalStepError(f"{kind.name} cannot happen in phase {state.phase}")
    after, changes = _ON_EVENT[kind](state) if kind in _ON_EVENT else (state, ())
    ended: tuple[Effect, ...] = ()
    if row.trial == "ok":
        response = event if isinstance(event, Response) else _TIMEOUT
        after, ended = _complete(after, _TIMEOUT if kind is Event.ELAPSED else response, task)
    elif row.trial is not None:
        after, ended = _repeat(after, row.trial)
    after = replace(after, phase=row.then)
    # Before anything is written or said at the end, for either may take a while, the outputs are 0.
    silence = (ZeroOutputs(),) if row.then in (Phase.FINISHED, Phase.STOPPED) else ()
    return after, (*silence, *changes, *ended, *_ON_ENTRY[row.then](after))


def next_event(state: SessionState) -> Event:
    """Return the event by which a session that is ready continues."""
    if not state.pending:
        return Event.NO_TRIAL_LEFT
    if not state.welcomed:
        return Event.VISIT_STARTS
    attempt = state.pending[0]
    if state.block is not None and attempt.trial.block != state.block:
        return Event.PRACTICE_ENDS if state.block <= PRACTICE_BLOCK else Event.BREAK_STARTS
    return Event.TRIAL_STARTS if attempt.part is state.part else Event.PART_STARTS


_LAST_FAILURE: Mapping[Input, Event] = {
    Event.NOT_FIRED: Event.TOO_MANY_FAILURES,
    Event.DELIVERY_UNKNOWN: Event.DEVICE_FAILED,
}
"""What a failure is after which the device is not tried again."""
_OF_RESPONSES = {Event.RESPONSE, *(event for event in Event if "PREMATURE" in event.name)}


def _classify_premature(state: SessionState) -> Event:
    """Return the event of a premature response, which may be one too many."""
    if state.accept_premature:
        return Event.PREMATURE_ACCEPTED
    in_a_row, at_this_trial = state.premature_in_a_row + 1, state.pending[0].premature + 1
    too_many = in_a_row >= state.max_premature or at_this_trial % state.max_premature == 0
    return Event.TOO_MANY_PREMATURE if too_many else Event.PREMATURE


def _classify(state: SessionState, event: Input) -> Event:
    """Return the table's event: a response is in time, premature or late; failures add up."""
    match event:
        case Response(_, rt_s) if rt_s is None or rt_s < EARLIEST_ANSWER_S:
            return _classify_premature(state)
        case Response(_, float(rt_s)) if rt_s > state.response_window_s:
            return Event.ELAPSED
        case Response():
            return Event.RESPONSE
        case Event.FIRED if state.interval < state.n_intervals:
            return Event.INTERVAL_FIRED
        case Event() if event in _LAST_FAILURE and state.failures + 1 >= MAX_FAILURES_IN_A_ROW:
            return _LAST_FAILURE[event]
    if event in _OF_RESPONSES:
        raise IllegalStepError(f"{event.name} must be a Response, with answer and time")
    return event
