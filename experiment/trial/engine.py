"""The trial engine: which step follows which event, as one table.

`step` is a pure function of state and event: it knows no clock, no port and no file. What is to be
done it returns as effects; whoever performs them answers with the next event.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from experiment.rows import is_correct
from experiment.study.design import EARLIEST_ANSWER_S
from experiment.trial.events import (
    ArmStimulus,
    CloseBlock,
    CloseSession,
    Cue,
    Effect,
    EndTrial,
    Event,
    Farewell,
    Feedback,
    FireStimulus,
    Greet,
    Happening,
    Introduce,
    Key,
    Listen,
    OpenBlock,
    OpenMonitor,
    Phase,
    Rest,
    SessionState,
    StartNoise,
    Wait,
    ZeroOutputs,
)
from experiment.trial.plan import PRACTICE_BLOCK

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


Change: TypeAlias = tuple[SessionState, tuple[Effect, ...]]


class Transition(NamedTuple):
    """Where the session goes, and the status with which the current trial ends, if it ends."""

    then: Phase
    trial: str | None = None


# A row reads aloud: "in the foreperiod, when a pause is asked for, the session is paused, and the
# trial ends as aborted". That is all that may stand here. What an event changes wherever it comes
# (a lost noise is remembered, a block is opened) is `_HEED`; what is done on arrival, however a
# phase was reached (a pause offers a rest, a stop says good-bye), is `_ARRIVE`: so neither can be
# forgotten in one row and done in another.
#
# From its cue on a trial ends exactly once. Every row that leads from FOREPERIOD, ARMING, FIRING or
# ANSWER to a phase that is none of them therefore names a status, and no other row does. The status
# says what the participant got, never what would be convenient: "aborted" is for a stimulus that
# was never asked of the device, "voided" for one that was felt and for a trial in which a key came
# too early, "device_error" for one that the device surely did not play, "indeterminate" wherever
# nobody can tell. Hence a device that fails while it arms and one that fails while it fires differ.
# All but "ok" put the trial at the end of its block, so that "ok" comes once for each planned one.
#
# ARMING and FIRING have no row for keys, pauses and stops: they last milliseconds, in which nobody
# is listened to, and a stimulus on its way must have an outcome before anything else is decided.
# Lost noise has no row in FOREPERIOD and FIRING either: it is asked for last thing before arming,
# and after the onset together with the answer. A stimulus that failed is tried again; the third in
# a row stops the session, for then the device does not do its work. A trial in which a key came too
# early is tried again, too, and by itself it would be for ever: somebody who holds a key down, or
# answers the cue, would be given burst after burst that counts for nothing. After as many as the
# study says, in a row or at one trial, the session is therefore paused and the operator called.
#
# A burst that a monitor measured otherwise than planned, or not at all, was perhaps felt, but not
# as what it is to be counted for: "indeterminate", and the operator is called, for the next one
# would be no better. It is told with the answer, for measuring takes time, and it outranks a key
# too early, not a pause, a stop or lost noise: there the trial is void anyway.
#
# What has no row cannot happen. If it does, the program is at fault, and nothing is changed.
TRANSITIONS: Mapping[tuple[Phase, Event], Transition] = {
    (Phase.READY, Event.SITTING_DUE): Transition(Phase.WELCOME),
    (Phase.READY, Event.PART_DUE): Transition(Phase.INTRODUCTION),
    (Phase.READY, Event.TRIAL_DUE): Transition(Phase.FOREPERIOD),
    (Phase.READY, Event.PRACTICE_OVER): Transition(Phase.READY),
    (Phase.READY, Event.BREAK_DUE): Transition(Phase.BREAK),
    (Phase.READY, Event.NOISE_LOST): Transition(Phase.PAUSED),
    (Phase.READY, Event.NOT_VERIFIED): Transition(Phase.PAUSED),
    (Phase.READY, Event.PAUSE_ASKED): Transition(Phase.PAUSED),
    (Phase.READY, Event.NOTHING_LEFT): Transition(Phase.FINISHED),
    (Phase.READY, Event.STOP_ASKED): Transition(Phase.STOPPED),
    (Phase.WELCOME, Event.CONTINUED): Transition(Phase.READY),
    (Phase.WELCOME, Event.STOP_ASKED): Transition(Phase.STOPPED),
    (Phase.INTRODUCTION, Event.CONTINUED): Transition(Phase.READY),
    (Phase.INTRODUCTION, Event.STOP_ASKED): Transition(Phase.STOPPED),
    (Phase.FOREPERIOD, Event.ELAPSED): Transition(Phase.ARMING),
    (Phase.FOREPERIOD, Event.EARLY_KEY): Transition(Phase.READY, "voided"),
    (Phase.FOREPERIOD, Event.EARLY_KEY_AGAIN): Transition(Phase.PAUSED, "voided"),
    (Phase.FOREPERIOD, Event.EARLY_KEY_KEPT): Transition(Phase.FOREPERIOD),
    (Phase.FOREPERIOD, Event.PAUSE_ASKED): Transition(Phase.PAUSED, "aborted"),
    (Phase.FOREPERIOD, Event.STOP_ASKED): Transition(Phase.STOPPED, "aborted"),
    (Phase.ARMING, Event.ARMED): Transition(Phase.FIRING),
    (Phase.ARMING, Event.NOISE_LOST): Transition(Phase.PAUSED, "aborted"),
    (Phase.ARMING, Event.DEVICE_FAILED): Transition(Phase.STOPPED, "device_error"),
    (Phase.FIRING, Event.FIRED): Transition(Phase.ANSWER),
    (Phase.FIRING, Event.NOT_FIRED): Transition(Phase.READY, "device_error"),
    (Phase.FIRING, Event.NOT_FIRED_AGAIN): Transition(Phase.STOPPED, "device_error"),
    (Phase.FIRING, Event.FIRED_PERHAPS): Transition(Phase.READY, "indeterminate"),
    (Phase.FIRING, Event.DEVICE_FAILED): Transition(Phase.STOPPED, "indeterminate"),
    (Phase.ANSWER, Event.KEY): Transition(Phase.READY, "ok"),
    (Phase.ANSWER, Event.EARLY_KEY): Transition(Phase.READY, "voided"),
    (Phase.ANSWER, Event.EARLY_KEY_AGAIN): Transition(Phase.PAUSED, "voided"),
    (Phase.ANSWER, Event.EARLY_KEY_KEPT): Transition(Phase.READY, "ok"),
    (Phase.ANSWER, Event.ELAPSED): Transition(Phase.READY, "ok"),
    (Phase.ANSWER, Event.NOT_VERIFIED): Transition(Phase.PAUSED, "indeterminate"),
    (Phase.ANSWER, Event.NOISE_LOST): Transition(Phase.PAUSED, "voided"),
    (Phase.ANSWER, Event.PAUSE_ASKED): Transition(Phase.PAUSED, "voided"),
    (Phase.ANSWER, Event.STOP_ASKED): Transition(Phase.STOPPED, "voided"),
    (Phase.BREAK, Event.CONTINUED): Transition(Phase.READY),
    (Phase.BREAK, Event.STOP_ASKED): Transition(Phase.STOPPED),
    (Phase.PAUSED, Event.CONTINUED): Transition(Phase.READY),
    (Phase.PAUSED, Event.STOP_ASKED): Transition(Phase.STOPPED),
}
"""The table of the session: in this phase, on this event, go there and end the trial so."""


def _greeted(state: SessionState) -> Change:
    return replace(state, greeted=True), ()


def _next_part(state: SessionState) -> Change:
    return replace(state, part=state.pending[0].part), ()


def _cue(state: SessionState) -> Change:
    """Open the block where it is new, and show that a trial begins."""
    task = state.pending[0]
    opening = () if state.block is not None else (OpenBlock(task),)
    return replace(state, block=task.trial.block, anticipated=False), (*opening, Cue(task))


def _close_block(state: SessionState) -> Change:
    closing = () if state.block is None else (CloseBlock(state.block),)
    return replace(state, block=None), closing


def _too_early(state: SessionState) -> Change:
    return replace(state, anticipated=True, early=state.early + 1), ()


def _too_early_again(state: SessionState) -> Change:
    return replace(_too_early(state)[0], called=True), ()


def _not_delivered(state: SessionState) -> Change:
    return replace(state, failures=state.failures + 1), ()


def _delivered(state: SessionState) -> Change:
    return replace(state, failures=0), ()


def _noise_lost(state: SessionState) -> Change:
    return replace(state, noise_lost=True), ()


def _not_verified(state: SessionState) -> Change:
    return replace(state, unverified=True), ()


def _go_on(state: SessionState) -> Change:
    """Start what was lost anew; so begins a participant whom the operator spoke to."""
    early = 0 if state.called else state.early
    noise: tuple[Effect, ...] = (StartNoise(),) if state.noise_lost else ()
    monitor: tuple[Effect, ...] = (OpenMonitor(),) if state.unverified else ()
    after = replace(state, noise_lost=False, unverified=False, called=False, early=early)
    return after, (*monitor, *noise)


_HEED: Mapping[Event, Callable[[SessionState], Change]] = {
    Event.SITTING_DUE: _greeted,
    Event.PART_DUE: _next_part,
    Event.TRIAL_DUE: _cue,
    Event.PRACTICE_OVER: _close_block,
    Event.BREAK_DUE: _close_block,
    Event.NOTHING_LEFT: _close_block,
    Event.EARLY_KEY: _too_early,
    Event.EARLY_KEY_AGAIN: _too_early_again,
    Event.EARLY_KEY_KEPT: _too_early,
    Event.NOT_FIRED: _not_delivered,
    Event.FIRED_PERHAPS: _not_delivered,
    Event.FIRED: _delivered,
    Event.NOT_VERIFIED: _not_verified,
    Event.NOISE_LOST: _noise_lost,
    Event.CONTINUED: _go_on,
}
"""What an event changes by itself; the others only lead on."""


_ARRIVE: Mapping[Phase, Callable[[SessionState], tuple[Effect, ...]]] = {
    Phase.READY: lambda _: (),
    Phase.WELCOME: lambda _: (Greet(),),
    Phase.INTRODUCTION: lambda state: (Introduce(state.pending[0].part),),
    Phase.FOREPERIOD: lambda state: (Wait(state.pending[0]),),
    Phase.ARMING: lambda state: (ArmStimulus(state.pending[0]),),
    Phase.FIRING: lambda state: (FireStimulus(state.pending[0]),),
    Phase.ANSWER: lambda state: (Listen(state.pending[0], state.response_window_s),),
    Phase.BREAK: lambda _: (Rest(paused=False),),
    Phase.PAUSED: lambda _: (Rest(paused=True),),
    Phase.FINISHED: lambda _: (CloseSession(finished=True), Farewell(finished=True)),
    Phase.STOPPED: lambda _: (CloseSession(finished=False), Farewell(finished=False)),
}
"""What is done in a phase that was just reached, however it was reached."""

_TIMEOUT = Key("timeout", None)
"""What is recorded where no answer came in its time."""


def _done(state: SessionState, answer: Key) -> Change:
    """Record the answer; the trial is not presented again."""
    task, *rest = state.pending
    end = EndTrial(
        task=task,
        status="ok",
        response=answer.response,
        rt_s=answer.rt_s,
        anticipated=state.anticipated,
    )
    correct = is_correct(task.trial.kind, task.trial.side, answer.response)
    told = (Feedback(bool(correct)),) if task.trial.kind == "practice" else ()
    return replace(state, pending=tuple(rest), early=0), (end, *told)


def _again(state: SessionState, status: str) -> Change:
    """End the trial with this status and put it at the end of its block, or of the warm-up."""
    task, *rest = state.pending
    end = EndTrial(task=task, status=status, anticipated=state.anticipated)
    here = (task.trial.block, task.part)
    others = (i for i, t in enumerate(rest) if (t.trial.block, t.part) != here)
    again = replace(task, attempt=task.attempt + 1, early=task.early + state.anticipated)
    rest.insert(next(others, len(rest)), again)
    return replace(state, pending=tuple(rest)), (end,)


MOST_FAILURES = 3
"""So many stimuli in a row that were not delivered are a failure of the device."""


class IllegalStepError(RuntimeError):
    """An event that the table does not know in this phase: a fault of the program."""


def step(state: SessionState, happened: Happening) -> Change:
    """Return the state after an event, and what is to be done.

    Parameters
    ----------
    state : SessionState
        Where the session stands; it is not changed.
    happened : Event or Key
        What happened; a key press is a `Key`.

    Raises
    ------
    IllegalStepError
        If the table has no row for this event in this phase.
    """
    event = _word(state, happened)
    row = TRANSITIONS.get((state.phase, event))
    if row is None:
        raise IllegalStepError(f"{event.name} cannot happen in phase {state.phase}")
    after, heeded = _HEED[event](state) if event in _HEED else (state, ())
    ended: tuple[Effect, ...] = ()
    if row.trial == "ok":
        late = event is Event.ELAPSED
        after, ended = _done(
            after, happened if isinstance(happened, Key) and not late else _TIMEOUT
        )
    elif row.trial is not None:
        after, ended = _again(after, row.trial)
    after = replace(after, phase=row.then)
    # Before anything is written or said at the end, for either may take a while, the outputs are 0.
    silence = (ZeroOutputs(),) if row.then in (Phase.FINISHED, Phase.STOPPED) else ()
    return after, (*silence, *heeded, *ended, *_ARRIVE[row.then](after))


def upcoming(state: SessionState) -> Event:
    """Return the event by which a session that is ready goes on."""
    if not state.pending:
        return Event.NOTHING_LEFT
    if not state.greeted:
        return Event.SITTING_DUE
    task = state.pending[0]
    if state.block is not None and task.trial.block != state.block:
        return Event.PRACTICE_OVER if state.block <= PRACTICE_BLOCK else Event.BREAK_DUE
    return Event.TRIAL_DUE if task.part is state.part else Event.PART_DUE


_KEYS = (Event.KEY, Event.EARLY_KEY, Event.EARLY_KEY_AGAIN, Event.EARLY_KEY_KEPT)


def _early_key(state: SessionState) -> Event:
    """Return the table's word for a key too early, which may be one too often."""
    if state.keep_anticipated:
        return Event.EARLY_KEY_KEPT
    in_a_row, at_this_trial = state.early + 1, state.pending[0].early + 1
    again = in_a_row >= state.most_anticipated or at_this_trial % state.most_anticipated == 0
    return Event.EARLY_KEY_AGAIN if again else Event.EARLY_KEY


def _word(state: SessionState, happened: Happening) -> Event:
    """Return the table's word: a key is in time, too early or too late; failures add up."""
    match happened:
        case Key(_, rt_s) if rt_s is None or rt_s < EARLIEST_ANSWER_S:
            return _early_key(state)
        case Key(_, float(rt_s)) if rt_s > state.response_window_s:
            return Event.ELAPSED
        case Key():
            return Event.KEY
        case Event.NOT_FIRED if state.failures + 1 >= MOST_FAILURES:
            return Event.NOT_FIRED_AGAIN
        case Event.FIRED_PERHAPS if state.failures + 1 >= MOST_FAILURES:
            return Event.DEVICE_FAILED
    if happened in _KEYS:
        raise IllegalStepError(f"{happened.name} must be told as a Key, with response and time")
    return happened
