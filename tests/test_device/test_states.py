"""The table of states: what a stop does, and what fires."""

from device import State
from device.core.states import ILLEGAL, TRANSITIONS, Step


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
