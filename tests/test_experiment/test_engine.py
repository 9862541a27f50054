"""The trial engine: every row of its table, and what no sequence of events can break."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiment.study.sections.design import EARLIEST_ANSWER_S
from experiment.terms.responder import SessionPart
from experiment.trial.engine import MOST_FAILURES, TRANSITIONS, IllegalStepError, step, upcoming
from experiment.trial.events import (
    Armed,
    ArmStimulus,
    BreakDue,
    CloseBlock,
    CloseSession,
    Continued,
    Cue,
    DeviceFailed,
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
    Task,
    TrialDue,
    Wait,
    ZeroOutputs,
)
from experiment.trial.plan import Trial

if TYPE_CHECKING:
    from collections.abc import Iterable

    from experiment.trial.events import Effect


def trial(number: int, block: int = 1, kind: str = "single", side: str = "left") -> Trial:
    level_vpp = None if kind == "blank" else 100.0
    return Trial(
        number=number,
        block=block,
        condition="main",
        kind=kind,
        side=side,
        level_vpp=level_vpp,
        foreperiod_s=1.0,
    )


def ready(*trials: Trial, keep_anticipated: bool = False, greeted: bool = True) -> SessionState:
    return SessionState(
        pending=tuple(Task(t, 1) for t in trials),
        keep_anticipated=keep_anticipated,
        response_window_s=3.0,
        greeted=greeted,
    )


def follow(state: SessionState, events: Iterable[Event]) -> tuple[SessionState, list[Effect]]:
    effects: list[Effect] = []
    for event in events:
        state, new = step(state, event)
        effects += new
    return state, effects


FELT = (TrialDue(), Elapsed(), Armed(), Fired())


def test_a_trial_goes_from_cue_to_answer_and_ends_ok() -> None:
    state, effects = follow(ready(trial(1)), [*FELT, Key("left", 0.5)])
    task = Task(trial(1), 1)
    assert effects == [
        OpenBlock(task),
        Cue(task),
        Wait(task),
        ArmStimulus(task),
        Fire(task),
        Listen(task, 3.0),
        EndTrial(task=task, status="ok", response="left", rt_s=0.5),
    ]
    assert state.pending == ()
    assert upcoming(state) == NothingLeft()


def test_no_answer_in_time_is_an_ok_trial_with_a_timeout() -> None:
    _, effects = follow(ready(trial(1)), [*FELT, Elapsed()])
    assert effects[-1] == EndTrial(task=Task(trial(1), 1), status="ok", response="timeout")


def test_a_practice_answer_is_told_right_or_wrong() -> None:
    practice = trial(1, block=0, kind="practice", side="right")
    for answer, right in (("right", True), ("left", False)):
        _, effects = follow(ready(practice), [*FELT, Key(answer, 0.5)])
        assert effects[-1] == Feedback(right)


@pytest.mark.parametrize(
    ("events", "status"),
    [
        ([TrialDue(), Key("left", None)], "voided"),
        ([TrialDue(), PauseAsked()], "aborted"),
        ([*FELT, Key("left", EARLIEST_ANSWER_S - 1e-6)], "voided"),
        ([*FELT, Key("left", -0.2)], "voided"),
        ([*FELT, PauseAsked()], "voided"),
        ([TrialDue(), Elapsed(), NoiseLost()], "aborted"),
        ([*FELT, NoiseLost()], "voided"),
        ([*FELT, StopAsked()], "voided"),
        ([TrialDue(), StopAsked()], "aborted"),
        ([TrialDue(), Elapsed(), DeviceFailed()], "device_error"),
        ([TrialDue(), Elapsed(), Armed(), NotFired()], "device_error"),
        ([TrialDue(), Elapsed(), Armed(), FiredPerhaps()], "indeterminate"),
        ([TrialDue(), Elapsed(), Armed(), DeviceFailed()], "indeterminate"),
    ],
)
def test_a_trial_without_a_valid_answer_is_recorded_and_put_at_the_end_of_its_block(
    events: list[Event], status: str
) -> None:
    state, effects = follow(ready(trial(1), trial(2), trial(3, block=2)), events)
    ends = [effect for effect in effects if isinstance(effect, EndTrial)]
    assert [end.status for end in ends] == [status]
    assert [(t.trial.number, t.attempt) for t in state.pending] == [(2, 1), (1, 2), (3, 1)]


def test_an_answer_at_the_earliest_moment_counts() -> None:
    _, effects = follow(ready(trial(1)), [*FELT, Key("left", EARLIEST_ANSWER_S)])
    assert isinstance(effects[-1], EndTrial)
    assert effects[-1].status == "ok"


def test_an_answer_after_the_window_is_a_timeout() -> None:
    _, effects = follow(ready(trial(1)), [*FELT, Key("left", 3.01)])
    assert effects[-1] == EndTrial(task=Task(trial(1), 1), status="ok", response="timeout")


def test_practice_goes_over_into_the_first_block_without_a_break() -> None:
    practice = trial(1, block=0, kind="practice")
    state, _ = follow(ready(practice, trial(2)), [*FELT, Key("left", 0.5)])
    assert upcoming(state) == PracticeOver()
    state, effects = follow(state, [PracticeOver(), TrialDue()])
    assert effects[:2] == [CloseBlock(0), OpenBlock(Task(trial(2), 1))]


def test_a_study_may_keep_an_anticipated_trial_and_flag_it() -> None:
    state = ready(trial(1), keep_anticipated=True)
    early = [TrialDue(), Key("left", None), Elapsed(), Armed(), Fired(), Key("right", 0.6)]
    _, effects = follow(state, early)
    assert effects[-1] == EndTrial(
        task=Task(trial(1), 1), status="ok", response="right", rt_s=0.6, anticipated=True
    )
    _, effects = follow(state, [*FELT, Key("left", 0.05)])
    assert effects[-1] == EndTrial(
        task=Task(trial(1), 1), status="ok", response="left", rt_s=0.05, anticipated=True
    )


def test_an_early_key_does_not_mark_the_next_trial() -> None:
    events = [TrialDue(), Key("left", None), *FELT, Key("left", 0.5)]
    _, effects = follow(ready(trial(1), trial(2)), events)
    ends = [effect for effect in effects if isinstance(effect, EndTrial)]
    assert [end.anticipated for end in ends] == [True, False]


def test_a_break_stands_between_two_blocks() -> None:
    state, _ = follow(ready(trial(1), trial(2, block=2)), [*FELT, Key("left", 0.5)])
    assert upcoming(state) == BreakDue()
    state, effects = follow(state, [BreakDue(), Continued(), TrialDue()])
    task = Task(trial(2, block=2), 1)
    assert effects == [CloseBlock(1), Rest(paused=False), OpenBlock(task), Cue(task), Wait(task)]


def test_a_pause_returns_to_the_same_block() -> None:
    state, effects = follow(ready(trial(1), trial(2)), [TrialDue(), PauseAsked(), Continued()])
    assert effects[-1] == Rest(paused=True)
    assert (state.phase, state.block) == (Phase.READY, 1)


def test_the_outputs_are_put_to_zero_before_a_session_is_closed() -> None:
    for events in (
        [*FELT, Key("left", 0.5), NothingLeft()],
        [StopAsked()],
        [*FELT, StopAsked()],
        [TrialDue(), PauseAsked(), StopAsked()],
        [TrialDue(), Elapsed(), Armed(), DeviceFailed()],
    ):
        state, effects = follow(ready(trial(1)), events)
        assert state.phase in {Phase.FINISHED, Phase.STOPPED}
        finished = state.phase is Phase.FINISHED
        assert effects[-2:] == [CloseSession(finished), Farewell(finished)]
        assert ZeroOutputs in [type(effect) for effect in effects]


@pytest.mark.parametrize(
    ("failed", "status"), [(NotFired(), "device_error"), (FiredPerhaps(), "indeterminate")]
)
def test_stimuli_that_fail_again_and_again_stop_the_session(failed: Event, status: str) -> None:
    state = ready(trial(1))
    effects: list[Effect] = []
    for _ in range(MOST_FAILURES):
        assert state.phase is Phase.READY
        state, new = follow(state, [TrialDue(), Elapsed(), Armed(), failed])
        effects += new
    assert state.phase is Phase.STOPPED
    statuses = [effect.status for effect in effects if isinstance(effect, EndTrial)]
    assert statuses == [status] * MOST_FAILURES


def test_a_stimulus_that_went_out_forgives_earlier_failures() -> None:
    failed = [TrialDue(), Elapsed(), Armed(), NotFired()]
    state, _ = follow(ready(trial(1), trial(2)), [*failed, *failed, *FELT])
    assert state.failures == 0


CONTINUED = {
    Phase.WELCOME: Continued(),
    Phase.INTRODUCTION: Continued(),
    Phase.FOREPERIOD: Elapsed(),
    Phase.ARMING: Armed(),
    Phase.FIRING: Fired(),
    Phase.ANSWER: Key("left", 0.5),
    Phase.BREAK: Continued(),
    Phase.PAUSED: Continued(),
}


def go_on_to_the_end(state: SessionState) -> list[Effect]:
    effects: list[Effect] = []
    while state.phase is not Phase.FINISHED:
        event = upcoming(state) if state.phase is Phase.READY else CONTINUED[state.phase]
        state, new = step(state, event)
        effects += new
    return effects


def test_a_sitting_begins_with_a_welcome_and_every_part_with_its_introduction() -> None:
    state = ready(
        trial(1, block=-1, kind="control"),
        trial(2, block=0, kind="practice"),
        trial(3),
        trial(4),
        trial(5, block=2),
        trial(6, block=3, kind="control"),
        greeted=False,
    )
    effects = go_on_to_the_end(state)
    assert [e for e in effects if isinstance(e, Greet | Introduce | Rest | Farewell)] == [
        Greet(),
        Introduce(SessionPart.AUDIBILITY),
        Introduce(SessionPart.PRACTICE),
        Introduce(SessionPart.MAIN),
        Rest(paused=False),
        Rest(paused=False),
        Introduce(SessionPart.CONTROL),
        Farewell(finished=True),
    ]


def test_a_warm_up_trial_that_comes_again_comes_before_the_practice() -> None:
    warm_up = Task(trial(9, block=0, kind="practice"), 1, warm_up=True)
    state = ready(trial(1, block=0, kind="practice"), trial(2))
    state = replace(state, pending=(warm_up, *state.pending), greeted=False)
    state, _ = follow(state, [SittingDue(), Continued(), PartDue(), Continued()])
    assert state.part is SessionPart.WARM_UP
    state, _ = follow(state, [*FELT, Key("left", 0.05)])
    assert [task.trial.number for task in state.pending] == [9, 1, 2]
    assert state.pending[0] == replace(warm_up, attempt=2)
    assert upcoming(state) == TrialDue()
    state, _ = follow(state, [*FELT, Key("left", 0.5)])
    assert upcoming(state) == PartDue()


def test_nobody_is_welcomed_where_nothing_is_left() -> None:
    effects = go_on_to_the_end(ready(greeted=False))
    assert not any(isinstance(effect, Greet | Introduce) for effect in effects)


@pytest.mark.parametrize("before", [[SittingDue()], [SittingDue(), Continued(), PartDue()]])
def test_a_session_may_be_stopped_before_its_first_trial(before: list[Event]) -> None:
    state, effects = follow(ready(trial(1), greeted=False), [*before, StopAsked()])
    assert state.phase is Phase.STOPPED
    assert effects[-2:] == [CloseSession(finished=False), Farewell(finished=False)]


@pytest.mark.parametrize(
    "events",
    [[TrialDue(), Elapsed(), NoiseLost()], [*FELT, NoiseLost()], [NoiseLost()]],
    ids=["before arming", "in the answer", "between trials"],
)
def test_lost_noise_pauses_until_it_was_started_again(events: list[Event]) -> None:
    state, effects = follow(ready(trial(1)), events)
    assert (state.phase, effects[-1]) == (Phase.PAUSED, Rest(paused=True))
    state, effects = follow(state, [Continued()])
    assert (state.phase, effects) == (Phase.READY, [StartNoise()])
    state, effects = follow(state, [NoiseLost()])
    assert (state.phase, effects) == (Phase.PAUSED, [Rest(paused=True)])
    state, _ = follow(state, [Continued()])
    state, effects = follow(state, [PauseAsked(), Continued()])
    assert effects == [Rest(paused=True)]


EVENTS = [
    SittingDue(),
    PartDue(),
    TrialDue(),
    PracticeOver(),
    BreakDue(),
    NothingLeft(),
    Elapsed(),
    Key("left", 0.5),
    Key("left", None),
    Armed(),
    Fired(),
    NotFired(),
    FiredPerhaps(),
    DeviceFailed(),
    NoiseLost(),
    PauseAsked(),
    Continued(),
    StopAsked(),
]


@pytest.mark.parametrize("phase", list(Phase))
@pytest.mark.parametrize("event", EVENTS, ids=lambda event: type(event).__name__)
def test_an_event_outside_the_table_is_refused_and_changes_nothing(
    phase: Phase, event: Event
) -> None:
    state = SessionState(
        pending=(Task(trial(1), 1),),
        keep_anticipated=True,
        response_window_s=3.0,
        phase=phase,
        block=1,
    )
    before = repr(state)
    known = {kind.__name__ for at, kind in TRANSITIONS if at is phase}
    name = type(event).__name__
    if name == "Key" and event.rt_s is None:  # type: ignore[attr-defined] # a Key, as the line says
        name = "EarlyKeyKept"
    if name in known:
        step(state, event)
    else:
        with pytest.raises(IllegalStepError, match=phase.value):
            step(state, event)
    assert repr(state) == before


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.data())
def test_whatever_happens_every_trial_ends_and_ok_comes_once_for_each(data: st.DataObject) -> None:
    state = ready(*(trial(n, block=1 + n // 4) for n in range(1, 9)), greeted=False)
    ends: list[EndTrial] = []
    cued = 0
    for _ in range(400):
        if state.phase in {Phase.FINISHED, Phase.STOPPED}:
            break
        if state.phase is Phase.READY:
            asked = data.draw(st.sampled_from([None, None, None, PauseAsked(), NoiseLost()]))
            event = asked or upcoming(state)
        else:
            known = {kind for at, kind in TRANSITIONS if at is state.phase}
            event = data.draw(st.sampled_from([e for e in EVENTS if type(e) in known]))
        state, effects = step(state, event)
        ends += [effect for effect in effects if isinstance(effect, EndTrial)]
        cued += sum(isinstance(effect, Cue) for effect in effects)
    assert len(ends) in {cued, cued - 1}
    assert len({(end.task.trial.number, end.task.attempt) for end in ends}) == len(ends)
    done = [end.task.trial.number for end in ends if end.status == "ok"]
    left = [task.trial.number for task in state.pending]
    assert sorted(done + left) == list(range(1, 9))
