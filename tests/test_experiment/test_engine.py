"""The trial engine: every row of its table, and what no sequence of events can break."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiment import SessionPart
from experiment.trial.events import (
    ArmStimulus,
    Attempt,
    CloseSession,
    Cue,
    EndTrial,
    Event,
    Farewell,
    Feedback,
    FireStimulus,
    Introduce,
    Listen,
    OpenBlock,
    Phase,
    Response,
    Rest,
    SessionState,
    StartNoise,
    Wait,
    Welcome,
    ZeroOutputs,
)
from tests.test_experiment.steps import (
    due,
    follow,
    legal_events,
    ready,
    require_refused,
    row_of,
    trial,
)

if TYPE_CHECKING:
    from experiment.trial.events import Effect, Input


EARLIEST_ANSWER_S = 0.1
MOST_FAILURES = 3
"""So many stimuli in a row that were not delivered stop the session."""
ARMED: tuple[Input, ...] = (Event.TRIAL_STARTS, Event.ELAPSED, Event.ARMED)
FELT = (*ARMED, Event.FIRED)
GREETED: tuple[Input, ...] = (Event.VISIT_STARTS, Event.CONTINUED, Event.PART_STARTS)
ATTEMPT = Attempt(trial(1), 1)


def ok(response: str, rt_s: float | None = None, *, premature: bool = False) -> EndTrial:
    """The first trial, done."""
    return EndTrial(attempt=ATTEMPT, status="ok", response=response, rt_s=rt_s, premature=premature)


def test_the_first_trial_that_is_due_goes_from_cue_to_answer_and_ends_ok() -> None:
    state, effects = follow(ready(trial(1), trial(2), trial(3)), [*FELT, Response("left", 0.5)])
    before = [OpenBlock(ATTEMPT), Cue(ATTEMPT), Wait(ATTEMPT), ArmStimulus(ATTEMPT)]
    assert effects == [*before, FireStimulus(ATTEMPT), Listen(ATTEMPT, 3.0), ok("left", 0.5)]
    assert [attempt.trial.number for attempt in state.pending] == [2, 3]


@pytest.mark.parametrize("late", [Event.ELAPSED, Response("left", 3.01)])
def test_no_answer_in_time_is_an_ok_trial_with_a_timeout(late: Input) -> None:
    state, effects = follow(ready(trial(1)), [*FELT, late])
    assert effects[-1] == ok("timeout")
    assert due(state) == Event.NO_TRIAL_LEFT


def test_a_practice_answer_is_told_right_or_wrong() -> None:
    practice = trial(1, block=0, kind="practice", side="right")
    for answer, right in (("right", True), ("left", False)):
        _, effects = follow(ready(practice), [*FELT, Response(answer, 0.5)])
        assert effects[-1] == Feedback(right)


@pytest.mark.parametrize(
    ("events", "status"),
    [
        ([Event.TRIAL_STARTS, Response("left", None)], "voided"),
        ([Event.TRIAL_STARTS, Event.PAUSE_REQUESTED], "aborted"),
        ([*FELT, Response("left", EARLIEST_ANSWER_S - 1e-6)], "voided"),
        ([*FELT, Response("left", -0.2)], "voided"),
        ([*FELT, Event.PAUSE_REQUESTED], "voided"),
        ([Event.TRIAL_STARTS, Event.ELAPSED, Event.NOISE_LOST], "aborted"),
        ([*FELT, Event.NOISE_LOST], "voided"),
        ([*FELT, Event.STOP_REQUESTED], "voided"),
        ([Event.TRIAL_STARTS, Event.STOP_REQUESTED], "aborted"),
        ([Event.TRIAL_STARTS, Event.ELAPSED, Event.DEVICE_FAILED], "device_error"),
        ([*ARMED, Event.NOT_FIRED], "device_error"),
        ([*ARMED, Event.DELIVERY_UNKNOWN], "indeterminate"),
        ([*ARMED, Event.DEVICE_FAILED], "indeterminate"),
    ],
)
def test_a_trial_without_a_valid_answer_is_recorded_and_put_at_the_end_of_its_block(
    events: list[Input], status: str
) -> None:
    state, effects = follow(ready(trial(1), trial(2), trial(3, block=2)), events)
    ends = [effect for effect in effects if isinstance(effect, EndTrial)]
    assert [end.status for end in ends] == [status]
    assert [(t.trial.number, t.number) for t in state.pending] == [(2, 1), (1, 2), (3, 1)]


@pytest.mark.parametrize("rt_s", [EARLIEST_ANSWER_S, 3.0])
def test_an_answer_at_the_earliest_and_at_the_last_moment_counts(rt_s: float) -> None:
    _, effects = follow(ready(trial(1)), [*FELT, Response("left", rt_s)])
    assert effects[-1] == ok("left", rt_s)


def test_a_study_may_keep_an_premature_trial_and_flag_it() -> None:
    state = ready(trial(1), accept_premature=True)
    _, effects = follow(state, [FELT[0], Response("left", None), *FELT[1:], Response("right", 0.6)])
    assert effects[-1] == ok("right", 0.6, premature=True)
    _, effects = follow(state, [*FELT, Response("left", 0.05)])
    assert effects[-1] == ok("left", 0.05, premature=True)


EARLY: dict[str, tuple[Input, ...]] = {
    "in the foreperiod": (Event.TRIAL_STARTS, Response("left", None)),
    "after the onset": (*FELT, Response("left", 0.05)),
}
ANSWERED: tuple[Input, ...] = (*FELT, Response("left", 0.5))


@pytest.mark.parametrize("early", EARLY.values(), ids=EARLY)
def test_keys_too_early_in_a_row_pause_for_the_operator_whatever_the_trials(
    early: tuple[Input, ...],
) -> None:
    state = ready(*(trial(n) for n in range(1, 9)))
    for _ in range(2):
        for _ in range(2):
            state, _ = follow(state, early)
            assert (state.phase, state.operator_needed) == (Phase.READY, False)
        state, effects = follow(state, early)
        assert (state.phase, state.operator_needed, effects[-1]) == (
            Phase.PAUSED,
            True,
            Rest(paused=True),
        )
        assert [e.status for e in effects if isinstance(e, EndTrial)] == ["voided"]
        state, _ = follow(state, [Event.CONTINUED])
        assert (state.phase, state.operator_needed) == (Phase.READY, False)


def test_an_answer_in_its_time_forgives_keys_too_early() -> None:
    state = ready(*(trial(n) for n in range(1, 20)))
    for _ in range(5):
        for events in (*EARLY.values(), ANSWERED):
            state, _ = follow(state, events)
            assert not state.operator_needed


def test_the_outputs_are_put_to_zero_before_a_session_is_closed() -> None:
    ways: list[list[Input]] = [
        [*FELT, Response("left", 0.5), Event.NO_TRIAL_LEFT],
        [Event.STOP_REQUESTED],
        [*FELT, Event.STOP_REQUESTED],
        [Event.TRIAL_STARTS, Event.PAUSE_REQUESTED, Event.STOP_REQUESTED],
        [*ARMED, Event.DEVICE_FAILED],
    ]
    for events in ways:
        state, effects = follow(ready(trial(1)), events)
        assert state.phase in {Phase.FINISHED, Phase.STOPPED}
        finished = state.phase is Phase.FINISHED
        assert effects[-2:] == [CloseSession(finished), Farewell(finished)]
        assert ZeroOutputs in [type(effect) for effect in effects]


@pytest.mark.parametrize(
    ("failed", "status"),
    [(Event.NOT_FIRED, "device_error"), (Event.DELIVERY_UNKNOWN, "indeterminate")],
)
def test_stimuli_that_fail_again_and_again_stop_the_session(failed: Event, status: str) -> None:
    state = ready(trial(1))
    effects: list[Effect] = []
    for _ in range(MOST_FAILURES):
        assert state.phase is Phase.READY
        state, new = follow(state, [*ARMED, failed])
        effects += new
    assert state.phase is Phase.STOPPED
    statuses = [effect.status for effect in effects if isinstance(effect, EndTrial)]
    assert statuses == [status] * MOST_FAILURES


CONTINUED: dict[Phase, Input] = {
    Phase.WELCOME: Event.CONTINUED,
    Phase.INTRODUCTION: Event.CONTINUED,
    Phase.FOREPERIOD: Event.ELAPSED,
    Phase.ARMING: Event.ARMED,
    Phase.FIRING: Event.FIRED,
    Phase.ANSWER: Response("left", 0.5),
    Phase.BREAK: Event.CONTINUED,
    Phase.PAUSED: Event.CONTINUED,
}


def go_on_to_the_end(state: SessionState) -> list[Effect]:
    effects: list[Effect] = []
    while state.phase is not Phase.FINISHED:
        event = due(state) if state.phase is Phase.READY else CONTINUED[state.phase]
        state, new = follow(state, [event])
        effects += new
    return effects


def test_a_sitting_begins_with_a_welcome_and_every_part_with_its_introduction() -> None:
    state = ready(
        trial(1, block=-1, kind="hands_off"),
        trial(2, block=0, kind="practice"),
        trial(3),
        trial(4),
        trial(5, block=2),
        trial(6, block=3, kind="hands_off"),
        welcomed=False,
    )
    effects = go_on_to_the_end(state)
    assert [e for e in effects if isinstance(e, Welcome | Introduce | Rest | Farewell)] == [
        Welcome(),
        Introduce(SessionPart.HANDS_OFF_BEFORE),
        Introduce(SessionPart.PRACTICE),
        Introduce(SessionPart.MAIN),
        Rest(paused=False),
        Rest(paused=False),
        Introduce(SessionPart.HANDS_OFF_AFTER),
        Farewell(finished=True),
    ]


@pytest.mark.parametrize(
    "events",
    [
        [Event.TRIAL_STARTS, Event.ELAPSED, Event.NOISE_LOST],
        [*FELT, Event.NOISE_LOST],
        [Event.NOISE_LOST],
    ],
    ids=["before arming", "in the answer", "between trials"],
)
def test_lost_noise_pauses_until_it_was_started_again(events: list[Input]) -> None:
    state, effects = follow(ready(trial(1)), events)
    assert (state.phase, effects[-1]) == (Phase.PAUSED, Rest(paused=True))
    state, effects = follow(state, [Event.CONTINUED])
    assert (state.phase, effects) == (Phase.READY, [StartNoise()])
    state, effects = follow(state, [Event.NOISE_LOST])
    assert (state.phase, effects) == (Phase.PAUSED, [Rest(paused=True)])
    state, _ = follow(state, [Event.CONTINUED])
    state, effects = follow(state, [Event.PAUSE_REQUESTED, Event.CONTINUED])
    assert effects == [Rest(paused=True)]


KEYS = (Event.RESPONSE, Event.PREMATURE, Event.TOO_MANY_PREMATURE, Event.PREMATURE_ACCEPTED)
EVENTS: list[Input] = [e for e in Event if e not in {*KEYS, Event.TOO_MANY_FAILURES}]
EVENTS += [Response("left", 0.5), Response("left", None)]


@pytest.mark.parametrize("phase", list(Phase))
@pytest.mark.parametrize("event", EVENTS, ids=str)
def test_an_event_outside_the_table_is_refused_and_changes_nothing(
    phase: Phase, event: Input
) -> None:
    state = SessionState(
        pending=(ATTEMPT,),
        accept_premature=True,
        max_premature=3,
        response_window_s=3.0,
        phase=phase,
        block=1,
    )
    if row_of(event, early=Event.PREMATURE_ACCEPTED) in legal_events(phase):
        before = repr(state)
        follow(state, [event])
        assert repr(state) == before
    else:
        require_refused(state, event)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.data())
def test_whatever_happens_every_trial_ends_and_ok_comes_once_for_each(data: st.DataObject) -> None:
    state = ready(*(trial(n, block=1 + n // 4) for n in range(1, 9)), welcomed=False)
    ends: list[EndTrial] = []
    cued = 0
    event: Input
    for _ in range(400):
        if state.phase in {Phase.FINISHED, Phase.STOPPED}:
            break
        if state.phase is Phase.READY:
            proper = due(state)
            event = data.draw(
                st.sampled_from([proper] * 3 + [Event.PAUSE_REQUESTED, Event.NOISE_LOST])
            )
        else:
            legal = legal_events(state.phase)
            event = data.draw(st.sampled_from([e for e in EVENTS if row_of(e) in legal]))
        state, effects = follow(state, [event])
        ends += [effect for effect in effects if isinstance(effect, EndTrial)]
        cued += sum(isinstance(effect, Cue) for effect in effects)
    assert len(ends) in {cued, cued - 1}
    assert len({(end.attempt.trial.number, end.attempt.number) for end in ends}) == len(ends)
    done = [end.attempt.trial.number for end in ends if end.status == "ok"]
    left = [attempt.trial.number for attempt in state.pending]
    assert sorted(done + left) == list(range(1, 9))
