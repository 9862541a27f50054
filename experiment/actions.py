"""What the engine's table does in its rows: state and event to state and effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

from experiment.record import is_correct
from experiment.steps import (
    Arm,
    CloseBlock,
    CloseSession,
    Cue,
    EarlyKeyKept,
    Effect,
    EndTrial,
    Event,
    Farewell,
    Feedback,
    Fire,
    Greet,
    Introduce,
    Key,
    Listen,
    OpenBlock,
    Rest,
    StartNoise,
    State,
    Wait,
    ZeroOutputs,
)

Change: TypeAlias = tuple[State, tuple[Effect, ...]]
Action: TypeAlias = Callable[[State, Event], Change]


def welcome(state: State, _: Event) -> Change:
    """Welcome the participant, once in a sitting."""
    return replace(state, greeted=True), (Greet(),)


def introduce(state: State, _: Event) -> Change:
    """Tell what the next part asks for."""
    part = state.pending[0].part
    return replace(state, part=part), (Introduce(part),)


def cue_and_wait(state: State, _: Event) -> Change:
    """Open the block where it is new, show the cue, let the foreperiod pass."""
    task = state.pending[0]
    opening = () if state.block is not None else (OpenBlock(task),)
    state = replace(state, block=task.trial.block, anticipated=False)
    return state, (*opening, Cue(task), Wait(task))


def flag_and_wait_on(state: State, _: Event) -> Change:
    """Remember the early key and let the rest of the foreperiod pass."""
    return replace(state, anticipated=True), (Wait(state.pending[0]),)


def arm(state: State, _: Event) -> Change:
    """Arm the device."""
    return state, (Arm(state.pending[0]),)


def fire(state: State, _: Event) -> Change:
    """Emit the stimulus."""
    return state, (Fire(state.pending[0]),)


def listen(state: State, _: Event) -> Change:
    """Wait for the answer."""
    return replace(state, failures=0), (Listen(state.pending[0], state.response_window_s),)


def take_answer(state: State, event: Event) -> Change:
    """Record the answer; the trial is done."""
    assert isinstance(event, Key | EarlyKeyKept)
    return _done(state, event.response, event.rt_s)


def take_early_answer(state: State, event: Event) -> Change:
    """Record the answer as anticipated; the trial is done."""
    return take_answer(replace(state, anticipated=True), event)


def take_timeout(state: State, _: Event) -> Change:
    """Record that no answer came; the trial is done."""
    return _done(state, "timeout", None)


def void_as_anticipated(state: State, _: Event) -> Change:
    """Record the trial as void and present it again later."""
    return _again(replace(state, anticipated=True), "voided")


def report_error(state: State, _: Event) -> Change:
    """Record that the stimulus did not go out and present it again later."""
    return _again(replace(state, failures=state.failures + 1), "device_error")


def report_indeterminate(state: State, _: Event) -> Change:
    """Record that nobody knows whether it went out and present it again later."""
    return _again(replace(state, failures=state.failures + 1), "indeterminate")


def abort_and_pause(state: State, _: Event) -> Change:
    """Give the trial up before its stimulus, and pause."""
    state, effects = _again(state, "aborted")
    return state, (*effects, Rest(paused=True))


def void_and_pause(state: State, _: Event) -> Change:
    """Give up a trial that was felt, and pause."""
    state, effects = _again(state, "voided")
    return state, (*effects, Rest(paused=True))


def pause_between_trials(state: State, _: Event) -> Change:
    """Pause while no trial is on."""
    return state, (Rest(paused=True),)


def abort_for_noise(state: State, event: Event) -> Change:
    """Give the trial up before its stimulus, and pause until the noise plays again."""
    return abort_and_pause(replace(state, noise_lost=True), event)


def void_for_noise(state: State, event: Event) -> Change:
    """Give up a trial that may have been heard, and pause until the noise plays again."""
    return void_and_pause(replace(state, noise_lost=True), event)


def pause_for_noise(state: State, event: Event) -> Change:
    """Pause until the noise plays again."""
    return pause_between_trials(replace(state, noise_lost=True), event)


def abort_and_stop(state: State, _: Event) -> Change:
    """Give the trial up before its stimulus, and stop."""
    return _give_up(state, "aborted")


def void_and_stop(state: State, _: Event) -> Change:
    """Give up a trial that was felt, and stop."""
    return _give_up(state, "voided")


def report_error_and_stop(state: State, _: Event) -> Change:
    """Record that the stimulus did not go out, and stop."""
    return _give_up(state, "device_error")


def report_indeterminate_and_stop(state: State, _: Event) -> Change:
    """Record that nobody knows whether it went out, and stop."""
    return _give_up(state, "indeterminate")


def close_block(state: State, _: Event) -> Change:
    """Close the block and go straight on."""
    assert state.block is not None
    return replace(state, block=None), (CloseBlock(state.block),)


def close_block_and_rest(state: State, _: Event) -> Change:
    """Close the block and offer a break."""
    state, effects = close_block(state, _)
    return state, (*effects, Rest(paused=False))


def close_block_and_session(state: State, _: Event) -> Change:
    """Close block and session; every trial is answered."""
    closing = () if state.block is None else (CloseBlock(state.block),)
    return state, (*closing, ZeroOutputs(), *_leave(finished=True))


def stop_between_trials(state: State, _: Event) -> Change:
    """Put the outputs to zero and leave; the session can be resumed."""
    return state, (ZeroOutputs(), *_leave(finished=False))


def go_on(state: State, _: Event) -> Change:
    """Return to the trials."""
    return state, ()


def go_on_with_noise(state: State, _: Event) -> Change:
    """Return to the trials; noise that was lost is started again first."""
    return replace(state, noise_lost=False), (StartNoise(),) if state.noise_lost else ()


def _done(state: State, response: str, rt_s: float | None) -> Change:
    task = state.pending[0]
    end = EndTrial(
        task=task, status="ok", response=response, rt_s=rt_s, anticipated=state.anticipated
    )
    correct = is_correct(task.trial.kind, task.trial.side, response)
    told = (Feedback(bool(correct)),) if task.trial.kind == "practice" else ()
    return replace(state, pending=state.pending[1:]), (end, *told)


def _again(state: State, status: str) -> Change:
    """End the trial with this status and put it at the end of its block, or of the warm-up."""
    task, *rest = state.pending
    end = EndTrial(task=task, status=status, anticipated=state.anticipated)
    here = (task.trial.block, task.part)
    others = (i for i, t in enumerate(rest) if (t.trial.block, t.part) != here)
    rest.insert(next(others, len(rest)), replace(task, attempt=task.attempt + 1))
    return replace(state, pending=tuple(rest)), (end,)


def _give_up(state: State, status: str) -> Change:
    state, effects = _again(state, status)
    return state, (ZeroOutputs(), *effects, *_leave(finished=False))


def _leave(*, finished: bool) -> tuple[Effect, ...]:
    return CloseSession(finished), Farewell(finished)
