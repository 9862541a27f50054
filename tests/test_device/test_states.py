"""The table of states: what a stop does, what fires, what the host may hold back."""

import pytest

from device import State, StateError
from device.core.states import ILLEGAL, SPONTANEOUS, TRANSITIONS, Step, require_legal
from tests.test_device.bursts import refusal


def test_a_stop_leads_from_every_state_to_safe_which_only_enable_leaves() -> None:
    device_states = set(State) - {State.CLOSED}
    assert all(TRANSITIONS[state, Step.STOP] is State.SAFE for state in device_states)
    ways_out = {
        step for step in Step if TRANSITIONS.get((State.SAFE, step)) not in (None, State.SAFE)
    }
    assert ways_out == {Step.ENABLE}


def test_nothing_fires_that_is_not_armed_and_nothing_arms_that_is_not_live() -> None:
    assert [state for state, step in TRANSITIONS if step is Step.FIRE] == [State.ARMED]
    assert [state for state, step in TRANSITIONS if step is Step.ARM] == [State.LIVE]
    into = {step for (_, step), after in TRANSITIONS.items() if after is State.FIRED}
    assert into == {Step.FIRE}


def test_every_state_has_one_reason_for_what_is_illegal_in_it() -> None:
    assert set(ILLEGAL) == set(State)
    assert len(set(ILLEGAL.values())) == len(State)


@pytest.mark.parametrize("known", list(State))
@pytest.mark.parametrize("step", [step for step in Step if step not in (*SPONTANEOUS, Step.STOP)])
def test_the_host_holds_back_just_what_the_device_could_not_accept(
    known: State, step: Step
) -> None:
    reachable = {known} | {TRANSITIONS.get((known, event), known) for event in SPONTANEOUS}
    if any((state, step) in TRANSITIONS for state in reachable):
        require_legal(known, step)
    else:
        reason = ILLEGAL[State.LIVE if known is State.FIRED else known]
        assert refusal(lambda: require_legal(known, step), StateError) is reason
