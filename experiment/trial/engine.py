"""The trial engine: which step follows which event, as one table.

`step` is a pure function of state and event: it knows no clock, no port and no file. What is to be
done it returns as effects; whoever performs them answers with the next event.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

from experiment.study.sections.design import EARLIEST_ANSWER_S
from experiment.terms.record import is_correct
from experiment.trial.events import (
    Armed,
    ArmStimulus,
    BreakDue,
    CloseBlock,
    CloseSession,
    Continued,
    Cue,
    DeviceFailed,
    EarlyKey,
    EarlyKeyKept,
    Effect,
    Elapsed,
    EndTrial,
    Event,
    Farewell,
    Feedback,
    Fire,
    Fired,
    FiredPerhaps,
    Greet,
    Introduce,
    Key,
    Listen,
    NoiseLost,
    NotFired,
    NotFiredAgain,
    NothingLeft,
    OpenBlock,
    PartDue,
    PauseAsked,
    Phase,
    PracticeOver,
    Rest,
    SessionState,
    SittingDue,
    StartNoise,
    StopAsked,
    TrialDue,
    Wait,
    ZeroOutputs,
)
from experiment.trial.plan import PRACTICE_BLOCK

if TYPE_CHECKING:
    from collections.abc import Mapping


Change: TypeAlias = tuple[SessionState, tuple[Effect, ...]]
Action: TypeAlias = Callable[[SessionState, Event], Change]


def welcome(state: SessionState, _: Event) -> Change:
    """Welcome the participant, once in a sitting."""
    return replace(state, greeted=True), (Greet(),)


def introduce(state: SessionState, _: Event) -> Change:
    """Tell what the next part asks for."""
    part = state.pending[0].part
    return replace(state, part=part), (Introduce(part),)


def cue_and_wait(state: SessionState, _: Event) -> Change:
    """Open the block where it is new, show the cue, let the foreperiod pass."""
    task = state.pending[0]
    opening = () if state.block is not None else (OpenBlock(task),)
    state = replace(state, block=task.trial.block, anticipated=False)
    return state, (*opening, Cue(task), Wait(task))


def flag_and_wait_on(state: SessionState, _: Event) -> Change:
    """Remember the early key and let the rest of the foreperiod pass."""
    return replace(state, anticipated=True), (Wait(state.pending[0]),)


def arm(state: SessionState, _: Event) -> Change:
    """Arm the device."""
    return state, (ArmStimulus(state.pending[0]),)


def fire(state: SessionState, _: Event) -> Change:
    """Emit the stimulus."""
    return state, (Fire(state.pending[0]),)


def listen(state: SessionState, _: Event) -> Change:
    """Wait for the answer."""
    return replace(state, failures=0), (Listen(state.pending[0], state.response_window_s),)


def take_answer(state: SessionState, event: Event) -> Change:
    """Record the answer; the trial is done."""
    assert isinstance(event, Key | EarlyKeyKept)
    return _done(state, event.response, event.rt_s)


def take_early_answer(state: SessionState, event: Event) -> Change:
    """Record the answer as anticipated; the trial is done."""
    return take_answer(replace(state, anticipated=True), event)


def take_timeout(state: SessionState, _: Event) -> Change:
    """Record that no answer came; the trial is done."""
    return _done(state, "timeout", None)


def void_as_anticipated(state: SessionState, _: Event) -> Change:
    """Record the trial as void and present it again later."""
    return _again(replace(state, anticipated=True), "voided")


def report_error(state: SessionState, _: Event) -> Change:
    """Record that the stimulus did not go out and present it again later."""
    return _again(replace(state, failures=state.failures + 1), "device_error")


def report_indeterminate(state: SessionState, _: Event) -> Change:
    """Record that nobody knows whether it went out and present it again later."""
    return _again(replace(state, failures=state.failures + 1), "indeterminate")


def abort_and_pause(state: SessionState, _: Event) -> Change:
    """Give the trial up before its stimulus, and pause."""
    state, effects = _again(state, "aborted")
    return state, (*effects, Rest(paused=True))


def void_and_pause(state: SessionState, _: Event) -> Change:
    """Give up a trial that was felt, and pause."""
    state, effects = _again(state, "voided")
    return state, (*effects, Rest(paused=True))


def pause_between_trials(state: SessionState, _: Event) -> Change:
    """Pause while no trial is on."""
    return state, (Rest(paused=True),)


def abort_for_noise(state: SessionState, event: Event) -> Change:
    """Give the trial up before its stimulus, and pause until the noise plays again."""
    return abort_and_pause(replace(state, noise_lost=True), event)


def void_for_noise(state: SessionState, event: Event) -> Change:
    """Give up a trial that may have been heard, and pause until the noise plays again."""
    return void_and_pause(replace(state, noise_lost=True), event)


def pause_for_noise(state: SessionState, event: Event) -> Change:
    """Pause until the noise plays again."""
    return pause_between_trials(replace(state, noise_lost=True), event)


def abort_and_stop(state: SessionState, _: Event) -> Change:
    """Give the trial up before its stimulus, and stop."""
    return _give_up(state, "aborted")


def void_and_stop(state: SessionState, _: Event) -> Change:
    """Give up a trial that was felt, and stop."""
    return _give_up(state, "voided")


def report_error_and_stop(state: SessionState, _: Event) -> Change:
    """Record that the stimulus did not go out, and stop."""
    return _give_up(state, "device_error")


def report_indeterminate_and_stop(state: SessionState, _: Event) -> Change:
    """Record that nobody knows whether it went out, and stop."""
    return _give_up(state, "indeterminate")


def close_block(state: SessionState, _: Event) -> Change:
    """Close the block and go straight on."""
    assert state.block is not None
    return replace(state, block=None), (CloseBlock(state.block),)


def close_block_and_rest(state: SessionState, _: Event) -> Change:
    """Close the block and offer a break."""
    state, effects = close_block(state, _)
    return state, (*effects, Rest(paused=False))


def close_block_and_session(state: SessionState, _: Event) -> Change:
    """Close block and session; every trial is answered."""
    closing = () if state.block is None else (CloseBlock(state.block),)
    return state, (*closing, ZeroOutputs(), *_leave(finished=True))


def stop_between_trials(state: SessionState, _: Event) -> Change:
    """Put the outputs to zero and leave; the session can be resumed."""
    return state, (ZeroOutputs(), *_leave(finished=False))


def go_on(state: SessionState, _: Event) -> Change:
    """Return to the trials."""
    return state, ()


def go_on_with_noise(state: SessionState, _: Event) -> Change:
    """Return to the trials; noise that was lost is started again first."""
    return replace(state, noise_lost=False), (StartNoise(),) if state.noise_lost else ()


def _done(state: SessionState, response: str, rt_s: float | None) -> Change:
    task = state.pending[0]
    end = EndTrial(
        task=task, status="ok", response=response, rt_s=rt_s, anticipated=state.anticipated
    )
    correct = is_correct(task.trial.kind, task.trial.side, response)
    told = (Feedback(bool(correct)),) if task.trial.kind == "practice" else ()
    return replace(state, pending=state.pending[1:]), (end, *told)


def _again(state: SessionState, status: str) -> Change:
    """End the trial with this status and put it at the end of its block, or of the warm-up."""
    task, *rest = state.pending
    end = EndTrial(task=task, status=status, anticipated=state.anticipated)
    here = (task.trial.block, task.part)
    others = (i for i, t in enumerate(rest) if (t.trial.block, t.part) != here)
    rest.insert(next(others, len(rest)), replace(task, attempt=task.attempt + 1))
    return replace(state, pending=tuple(rest)), (end,)


def _give_up(state: SessionState, status: str) -> Change:
    state, effects = _again(state, status)
    return state, (ZeroOutputs(), *effects, *_leave(finished=False))


def _leave(*, finished: bool) -> tuple[Effect, ...]:
    return CloseSession(finished), Farewell(finished)


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

MOST_FAILURES = 3
"""So many stimuli in a row that were not delivered are a failure of the device."""


class IllegalStepError(RuntimeError):
    """An event that the table does not know in this phase: a fault of the program."""


def step(state: SessionState, event: Event) -> Change:
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


def upcoming(state: SessionState) -> Event:
    """Return the event by which a session that is ready goes on."""
    if not state.pending:
        return NothingLeft()
    if not state.greeted:
        return SittingDue()
    task = state.pending[0]
    if state.block is not None and task.trial.block != state.block:
        return PracticeOver() if state.block <= PRACTICE_BLOCK else BreakDue()
    return TrialDue() if task.part is state.part else PartDue()


def _refine(state: SessionState, event: Event) -> Event:
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
