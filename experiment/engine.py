"""The trial engine: which step follows which event, as one table.

`step` is a pure function of state and event: it knows no clock, no port and no file. What is to be
done it returns as effects; whoever performs them answers with the next event.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from experiment.actions import (
    abort_and_pause,
    abort_and_stop,
    abort_for_noise,
    arm,
    close_block,
    close_block_and_rest,
    close_block_and_session,
    cue_and_wait,
    fire,
    flag_and_wait_on,
    go_on,
    go_on_with_noise,
    introduce,
    listen,
    pause_between_trials,
    pause_for_noise,
    report_error,
    report_error_and_stop,
    report_indeterminate,
    report_indeterminate_and_stop,
    stop_between_trials,
    take_answer,
    take_early_answer,
    take_timeout,
    void_and_pause,
    void_and_stop,
    void_as_anticipated,
    void_for_noise,
    welcome,
)
from experiment.plan import PRACTICE_BLOCK
from experiment.steps import (
    Armed,
    BreakDue,
    Continued,
    DeviceFailed,
    EarlyKey,
    EarlyKeyKept,
    Elapsed,
    Event,
    Fired,
    FiredPerhaps,
    Key,
    NoiseLost,
    NotFired,
    NotFiredAgain,
    NothingLeft,
    PartDue,
    PauseAsked,
    Phase,
    PracticeOver,
    SittingDue,
    State,
    StopAsked,
    TrialDue,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from experiment.actions import Action, Change

TRANSITIONS: Mapping[tuple[Phase, type[Event]], tuple[Phase, Action]] = {
    (Phase.READY, SittingDue): (Phase.WELCOME, welcome),
    (Phase.READY, PartDue): (Phase.INTRODUCTION, introduce),
    (Phase.READY, TrialDue): (Phase.FOREPERIOD, cue_and_wait),
    (Phase.READY, PracticeOver): (Phase.READY, close_block),
    (Phase.READY, BreakDue): (Phase.BREAK, close_block_and_rest),
    (Phase.READY, NoiseLost): (Phase.PAUSED, pause_for_noise),
    (Phase.READY, PauseAsked): (Phase.PAUSED, pause_between_trials),
    (Phase.READY, NothingLeft): (Phase.FINISHED, close_block_and_session),
    (Phase.READY, StopAsked): (Phase.STOPPED, stop_between_trials),
    (Phase.WELCOME, Continued): (Phase.READY, go_on),
    (Phase.WELCOME, StopAsked): (Phase.STOPPED, stop_between_trials),
    (Phase.INTRODUCTION, Continued): (Phase.READY, go_on),
    (Phase.INTRODUCTION, StopAsked): (Phase.STOPPED, stop_between_trials),
    (Phase.FOREPERIOD, Elapsed): (Phase.ARMING, arm),
    (Phase.FOREPERIOD, EarlyKey): (Phase.READY, void_as_anticipated),
    (Phase.FOREPERIOD, EarlyKeyKept): (Phase.FOREPERIOD, flag_and_wait_on),
    (Phase.FOREPERIOD, PauseAsked): (Phase.PAUSED, abort_and_pause),
    (Phase.FOREPERIOD, StopAsked): (Phase.STOPPED, abort_and_stop),
    (Phase.ARMING, Armed): (Phase.FIRING, fire),
    (Phase.ARMING, NoiseLost): (Phase.PAUSED, abort_for_noise),
    (Phase.ARMING, DeviceFailed): (Phase.STOPPED, report_error_and_stop),
    (Phase.FIRING, Fired): (Phase.ANSWER, listen),
    (Phase.FIRING, NotFired): (Phase.READY, report_error),
    (Phase.FIRING, NotFiredAgain): (Phase.STOPPED, report_error_and_stop),
    (Phase.FIRING, FiredPerhaps): (Phase.READY, report_indeterminate),
    (Phase.FIRING, DeviceFailed): (Phase.STOPPED, report_indeterminate_and_stop),
    (Phase.ANSWER, Key): (Phase.READY, take_answer),
    (Phase.ANSWER, EarlyKey): (Phase.READY, void_as_anticipated),
    (Phase.ANSWER, EarlyKeyKept): (Phase.READY, take_early_answer),
    (Phase.ANSWER, Elapsed): (Phase.READY, take_timeout),
    (Phase.ANSWER, NoiseLost): (Phase.PAUSED, void_for_noise),
    (Phase.ANSWER, PauseAsked): (Phase.PAUSED, void_and_pause),
    (Phase.ANSWER, StopAsked): (Phase.STOPPED, void_and_stop),
    (Phase.BREAK, Continued): (Phase.READY, go_on),
    (Phase.BREAK, StopAsked): (Phase.STOPPED, stop_between_trials),
    (Phase.PAUSED, Continued): (Phase.READY, go_on_with_noise),
    (Phase.PAUSED, StopAsked): (Phase.STOPPED, stop_between_trials),
}
"""The table of the session: in this phase, on this event, go there and do that."""

EARLIEST_ANSWER_S = 0.1
"""A key within this time of the onset cannot be an answer to it."""

MOST_FAILURES = 3
"""So many stimuli in a row that were not delivered are a failure of the device."""


class IllegalStepError(RuntimeError):
    """An event that the table does not know in this phase: a fault of the program."""


def step(state: State, event: Event) -> Change:
    """Return the state after an event, and what is to be done.

    Parameters
    ----------
    state : State
        Where the session stands; it is not changed.
    event : Event
        What happened.

    Raises
    ------
    IllegalStepError
        If the table has no row for this event in this phase.
    """
    event = _refine(state, event)
    row = TRANSITIONS.get((state.phase, type(event)))
    if row is None:
        raise IllegalStepError(f"{type(event).__name__} cannot happen in phase {state.phase}")
    phase, action = row
    after, effects = action(state, event)
    return replace(after, phase=phase), effects


def upcoming(state: State) -> Event:
    """Return the event by which a session that is ready goes on."""
    if not state.pending:
        return NothingLeft()
    if not state.greeted:
        return SittingDue()
    task = state.pending[0]
    if state.block is not None and task.trial.block != state.block:
        return PracticeOver() if state.block <= PRACTICE_BLOCK else BreakDue()
    return TrialDue() if task.part is state.part else PartDue()


def _refine(state: State, event: Event) -> Event:
    """Call a key too early or too late, and a failure that repeats itself, by their names."""
    match event:
        case Key(response, rt_s) if rt_s is None or rt_s < EARLIEST_ANSWER_S:
            return EarlyKeyKept(response, rt_s) if state.keep_anticipated else EarlyKey()
        case Key(_, float(rt_s)) if rt_s > state.response_window_s:
            return Elapsed()
        case NotFired() if state.failures + 1 >= MOST_FAILURES:
            return NotFiredAgain()
        case FiredPerhaps() if state.failures + 1 >= MOST_FAILURES:
            return DeviceFailed()
    return event
