"""The device's own logic: what happens when, what is remembered, what can never happen."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device.core.core import WATCHDOG_US, DeviceCore
from device.core.messages import (
    Arm,
    Beat,
    CodeArray,
    Disarm,
    Enable,
    Fire,
    Levels,
    Load,
    Message,
    Query,
    Stop,
    to_codes,
)
from device.core.output import Emission, OutputStage
from device.core.states import ILLEGAL, TRANSITIONS, State, Step
from device.core.tokens import Fate, Record
from device.driver import Refusal, Rejected
from device.limits import Limits

LIMITS = Limits(ceiling_vpp=200.0, least_interval_s=0.01, max_duty=0.5)
BURST_US = 2021


def sine_codes(n_samples: int = 97, peak: float = 1.0) -> CodeArray:
    samples = peak * np.sin(2 * np.pi * np.arange(n_samples) / (n_samples - 1))
    samples[-1] = 0.0
    return to_codes(samples, bits=16)


def load_message(slot: int = 0, n_samples: int = 97, peak: float = 1.0) -> Load:
    codes = sine_codes(n_samples, peak)
    return Load(slot=slot, left=codes, right=np.zeros_like(codes))


def levels(left_mvpp: int) -> Levels:
    return Levels(left_mvpp=left_mvpp, right_mvpp=left_mvpp)


def arm(token: int, *, slot: int = 0, time_to_live_us: int = 100_000) -> Arm:
    return Arm(token=token, slot=slot, time_to_live_us=time_to_live_us)


class Bench(NamedTuple):
    core: DeviceCore
    over: list[Emission]


def power_on(*, history: int = 1024, limits: Limits = LIMITS) -> Bench:
    over: list[Emission] = []
    core = DeviceCore(
        boot_id=1, limits=limits, output=OutputStage(), sink=over.append, history=history
    )
    return Bench(core, over)


def live(*, history: int = 1024, n_samples: int = 97) -> Bench:
    """A device that is live at 0 us with its last beat then, at 100 Vpp."""
    bench = power_on(history=history)
    bench.core.take(0, load_message(n_samples=n_samples))
    bench.core.take(0, levels(100_000))
    bench.core.take(0, Enable())
    return bench


def state_at(core: DeviceCore, now_us: int) -> State:
    core.advance(now_us)
    return core.state


def refusal(call: Callable[[], object]) -> Refusal:
    with pytest.raises(Rejected) as refused:
        call()
    return refused.value.code


# --- time


def test_the_watchdog_trips_half_a_second_after_the_last_beat() -> None:
    core = live().core
    core.take(300_000, Beat())
    assert state_at(core, 300_000 + WATCHDOG_US - 1) is State.LIVE
    assert state_at(core, 300_000 + WATCHDOG_US) is State.SAFE


def test_a_device_whose_output_is_off_needs_no_beat() -> None:
    core = power_on().core
    core.advance(10 * WATCHDOG_US)
    core.take(20 * WATCHDOG_US, load_message())
    assert state_at(core, 30 * WATCHDOG_US) is State.LOADED
    core.take(30 * WATCHDOG_US, Enable())
    assert state_at(core, 31 * WATCHDOG_US - 1) is State.LIVE


def test_no_beat_leads_out_of_safe() -> None:
    core = live().core
    core.take(10, Stop())
    core.take(20, Beat())
    core.advance(30)
    assert core.state is State.SAFE


@pytest.mark.parametrize(
    ("time_to_live_us", "fate"), [(400_000, Fate.EXPIRED), (600_000, Fate.ABORTED)]
)
def test_what_is_due_in_one_leap_happens_in_the_order_of_time(
    time_to_live_us: int, fate: Fate
) -> None:
    core = live().core
    core.take(0, arm(1, time_to_live_us=time_to_live_us))
    core.advance(10_000_000)
    assert core.state is State.SAFE
    assert core.take(10_000_000, Query(token=1)).fate is fate


def test_a_burst_is_handed_over_once_and_whole_when_it_is_over() -> None:
    core, over = live()
    core.take(100, arm(1))
    core.take(100, Fire(token=1))
    core.advance(100 + BURST_US - 1)
    playing = core.playing
    assert (core.state, over) == (State.FIRED, [])
    core.advance(100 + BURST_US)
    assert (core.state, core.playing) == (State.LIVE, None)
    core.take(100 + BURST_US, Stop())
    assert over == [playing]
    assert over[0].cut_us is None


def test_a_watchdog_cuts_a_long_burst_when_it_trips_not_when_it_is_noticed() -> None:
    core, over = live(n_samples=40_001)
    core.take(200_000, arm(1))
    core.take(200_000, Fire(token=1))
    core.advance(9_000_000)
    assert core.state is State.SAFE
    (cut,) = over
    assert cut.cut_us == WATCHDOG_US
    first_zero = (WATCHDOG_US - 200_000) * 48 // 1000
    assert cut.left_v[:first_zero].any()
    assert not cut.left_v[first_zero:].any()
    assert core.take(9_000_000, Query(token=1)).fate is Fate.FIRED


def test_time_that_goes_back_is_refused() -> None:
    core = live().core
    core.advance(5)
    with pytest.raises(ValueError, match="now_us must be 5 or later, got 4"):
        core.take(4, Beat())


# --- tokens


def fire_some(core: DeviceCore, tokens: range, start_us: int = 0) -> int:
    now_us = start_us
    for token in tokens:
        now_us += 50_000
        core.take(now_us, Beat())
        core.take(now_us, arm(token))
        core.take(now_us, Fire(token=token))
    now_us += 50_000
    core.take(now_us, Beat())
    return now_us


def test_a_fired_token_gives_its_record_whatever_the_device_does_since() -> None:
    core, over = live()
    core.take(0, arm(1))
    record = core.take(10, Fire(token=1))
    assert core.take(20, Fire(token=1)) == record
    assert core.take(50_000, Fire(token=1)) == record
    core.take(50_000, arm(2))
    assert core.take(50_010, Fire(token=1)) == record
    assert core.state is State.ARMED
    core.take(50_020, Stop())
    assert core.take(50_030, Fire(token=1)) == core.take(50_030, Query(token=1)) == record
    assert [emission.token for emission in over] == [1]


def test_a_late_fire_cannot_fire() -> None:
    core, over = live()
    core.take(0, arm(1, time_to_live_us=1000))
    assert refusal(lambda: core.take(1000, Fire(token=1))) is Refusal.EXPIRED
    assert core.take(1000, Query(token=1)).fate is Fate.EXPIRED
    assert refusal(lambda: core.take(1000, arm(1))) is Refusal.TOKEN_SPENT
    assert over == []


def test_the_last_microsecond_of_the_time_to_live_still_fires() -> None:
    core = live().core
    core.take(0, arm(1, time_to_live_us=1000))
    assert core.take(999, Fire(token=1)).start_us == 999


@pytest.mark.parametrize("armed_before", [True, False])
def test_a_disarmed_token_can_never_fire(*, armed_before: bool) -> None:
    core, over = live()
    if armed_before:
        core.take(0, arm(1))
    core.take(1, Disarm(token=1))
    assert core.take(2, Query(token=1)).fate is (Fate.ABORTED if armed_before else Fate.NEVER_ARMED)
    assert refusal(lambda: core.take(3, Fire(token=1))) is Refusal.ABORTED
    assert refusal(lambda: core.take(4, arm(1))) is Refusal.TOKEN_SPENT
    core.take(5, arm(2))
    assert refusal(lambda: core.take(6, Fire(token=1))) is Refusal.ABORTED
    assert (core.state, over) == (State.ARMED, [])


def test_disarming_leaves_other_tokens_and_playing_bursts_alone() -> None:
    core, over = live()
    core.take(0, arm(1))
    core.take(1, Disarm(token=7))
    record = core.take(2, Fire(token=1))
    core.take(3, Disarm(token=1))
    assert core.take(4, Query(token=1)) == record
    core.advance(50_000)
    assert [emission.cut_us for emission in over] == [None]


def test_a_forgotten_token_is_unknown_and_stays_so_when_it_is_disarmed() -> None:
    core = live(history=3).core
    now_us = fire_some(core, range(1, 6))
    assert [core.take(now_us, Query(token=token)).fate for token in (1, 2)] == [Fate.UNKNOWN] * 2
    assert [core.take(now_us, Query(token=token)).fate for token in (3, 4, 5)] == [Fate.FIRED] * 3
    assert core.take(now_us, Query(token=6)).fate is Fate.NEVER_ARMED
    core.take(now_us, Disarm(token=1))
    assert core.take(now_us, Query(token=1)).fate is Fate.UNKNOWN
    assert refusal(lambda: core.take(now_us, Fire(token=2))) is Refusal.NOT_ARMED


def test_a_forgotten_token_that_is_armed_anew_and_does_not_fire_stays_unknown() -> None:
    core = live(history=2).core
    now_us = fire_some(core, range(1, 5))
    core.take(now_us, arm(1))
    core.take(now_us, Disarm(token=1))
    assert core.take(now_us, Query(token=1)) == Record(token=1, fate=Fate.UNKNOWN)


def test_the_armed_token_is_not_forgotten_however_many_others_are_disarmed() -> None:
    core = live(history=2).core
    core.take(0, arm(1))
    for token in range(10, 20):
        core.take(0, Disarm(token=token))
    assert core.take(0, Query(token=1)).fate is Fate.ARMED
    assert core.take(0, Fire(token=1)).fate is Fate.FIRED


# --- levels and waveforms


def test_the_record_names_the_levels_that_were_set_and_zero_for_silence() -> None:
    core = live().core
    core.take(0, Levels(left_mvpp=64_123, right_mvpp=99_000))
    core.take(0, arm(1))
    assert core.take(0, Fire(token=1)).levels_mvpp == (64_123, 0)


@pytest.mark.parametrize("right", [True, False])
def test_a_weak_waveform_has_its_level_in_the_record_too(*, right: bool) -> None:
    core, weak = live().core, sine_codes(peak=0.01)
    silence = np.zeros_like(weak)
    core.take(
        0,
        Load(slot=1, left=silence, right=weak) if right else Load(slot=1, left=weak, right=silence),
    )
    core.take(0, Levels(left_mvpp=64_123, right_mvpp=99_000))
    core.take(0, arm(1, slot=1))
    assert core.take(0, Fire(token=1)).levels_mvpp == ((0, 99_000) if right else (64_123, 0))


def test_what_is_emitted_names_the_level_of_either_channel() -> None:
    core = live().core
    core.take(0, Load(slot=0, left=sine_codes(), right=sine_codes()))
    core.take(0, Levels(left_mvpp=64_123, right_mvpp=99_000))
    core.take(0, arm(1))
    assert core.take(0, Fire(token=1)).levels_mvpp == (64_123, 99_000)
    assert core.playing is not None
    assert (core.playing.level_left_vpp, core.playing.level_right_vpp) == (64.123, 99.0)


def test_a_level_no_loaded_waveform_could_use_is_refused_when_it_is_set() -> None:
    core = live().core
    assert refusal(lambda: core.take(0, levels(200_001))) is Refusal.CEILING
    core.take(0, load_message(slot=1, peak=0.5))
    core.take(0, levels(300_000))
    assert refusal(lambda: core.take(0, arm(1))) is Refusal.CEILING
    core.take(0, arm(1, slot=1))
    core.take(0, Fire(token=1))
    assert core.playing is not None
    assert 149.9 < np.ptp(core.playing.left_v) <= 150.0


def test_the_device_keeps_its_own_copy_of_what_was_loaded() -> None:
    core = power_on().core
    message = load_message()
    core.take(0, message)
    message.left[:] = 7
    core.take(0, levels(100_000))
    core.take(0, Enable())
    core.take(0, arm(1))
    core.take(0, Fire(token=1))
    assert core.playing is not None
    assert core.playing.left_v[0] == 0.0


def test_a_burst_is_computed_once_for_a_slot_at_its_levels_and_anew_after_a_load() -> None:
    core, over = live()
    fire_some(core, range(1, 3))
    core.take(200_000, load_message(peak=0.5))
    fire_some(core, range(3, 4), start_us=200_000)
    first, second, third = over
    assert first.left_v.base is second.left_v.base
    assert third.left_v.max() == pytest.approx(first.left_v.max() / 2, abs=0.01)


# --- refused means nothing changed


def picture(bench: Bench) -> list[object]:
    core = bench.core
    loaded = {slot: id(kept) for slot, kept in core._slots.items()}
    return [
        (core._state, core._levels, core._armed, core._armed_until_us, id(core._last)),
        (loaded, dict(core._tokens._records), core._tokens._dropped_up_to, core._beat_us),
        list(bench.over),
    ]


def prepared(state: State) -> Bench:
    """A device in a state, at 100 us."""
    bench = power_on()
    core = bench.core
    if state in (State.LOADED, State.LIVE, State.ARMED, State.FIRED):
        core.take(0, load_message())
        core.take(0, levels(100_000))
    if state in (State.LIVE, State.ARMED, State.FIRED):
        core.take(0, Enable())
    if state in (State.ARMED, State.FIRED):
        core.take(0, arm(1))
    if state is State.FIRED:
        core.take(100, Fire(token=1))
    if state is State.SAFE:
        core.take(0, Stop())
    core.advance(100)
    assert core.state is state
    return bench


MESSAGES: dict[Step, Callable[[DeviceCore], object]] = {
    Step.LOAD: lambda core: core.take(100, load_message()),
    Step.LEVEL: lambda core: core.take(100, levels(50_000)),
    Step.ENABLE: lambda core: core.take(100, Enable()),
    Step.ARM: lambda core: core.take(100, arm(2)),
    Step.FIRE: lambda core: core.take(100, Fire(token=1 if core.state is State.ARMED else 3)),
    Step.DISARM: lambda core: core.take(100, Disarm(token=1)),
}


@pytest.mark.parametrize("state", [state for state in State if state is not State.CLOSED])
@pytest.mark.parametrize("step", [step for step in MESSAGES if step is not Step.DISARM])
def test_a_step_follows_the_table_or_is_refused_and_changes_nothing(
    state: State, step: Step
) -> None:
    bench = prepared(state)
    before = picture(bench)
    if (state, step) in TRANSITIONS:
        MESSAGES[step](bench.core)
        assert bench.core.state is TRANSITIONS[state, step]
    else:
        assert refusal(lambda: MESSAGES[step](bench.core)) is ILLEGAL[state]
        assert picture(bench) == before


BAD_STEPS: list[tuple[State, Refusal, Callable[[DeviceCore], object]]] = [
    (State.LIVE, Refusal.EDGES_NOT_ZERO, lambda c: c.take(100, bad_load())),
    (State.LIVE, Refusal.CEILING, lambda c: c.take(100, levels(200_001))),
    (State.LIVE, Refusal.EMPTY_SLOT, lambda c: c.take(100, arm(2, slot=5))),
    (State.LIVE, Refusal.BAD_TIME_TO_LIVE, lambda c: c.take(100, arm(2, time_to_live_us=0))),
    (State.LIVE, Refusal.BAD_TOKEN, lambda c: c.take(100, Disarm(token=0))),
    (State.LIVE, Refusal.BAD_TOKEN, lambda c: c.take(100, Query(token=2**64))),
    (State.ARMED, Refusal.WRONG_TOKEN, lambda c: c.take(100, Fire(token=2))),
    (State.ARMED, Refusal.BAD_TOKEN, lambda c: c.take(100, Fire(token=-1))),
]


def test_a_message_that_asks_nothing_the_device_does_is_refused() -> None:
    core = power_on().core
    before = core.state
    assert refusal(lambda: core.take(0, Message())) is Refusal.BAD_MESSAGE
    assert core.state is before


def bad_load() -> Load:
    codes = sine_codes()
    return Load(slot=0, left=codes, right=np.roll(codes, 5))


@pytest.mark.parametrize(("state", "code", "call"), BAD_STEPS)
def test_a_refused_message_changes_nothing(
    state: State, code: Refusal, call: Callable[[DeviceCore], object]
) -> None:
    bench = prepared(state)
    before = picture(bench)
    assert refusal(lambda: call(bench.core)) is code
    assert picture(bench) == before


@settings(deadline=None, max_examples=100)
@given(since_us=st.integers(BURST_US, 20_000))
def test_a_token_refused_for_lack_of_rest_stays_armed_and_fires_after_it(since_us: int) -> None:
    bench = live()
    fire_some(bench.core, range(1, 2), start_us=-50_000)
    now_us = bench.core.now_us
    bench.core.take(now_us, arm(2))
    assert bench.core.take(now_us, Fire(token=2)).start_us == now_us
    again_us = now_us + since_us
    bench.core.take(again_us, arm(3))
    before = picture(bench)
    if since_us < BURST_US + 10_000:
        assert refusal(lambda: bench.core.take(again_us, Fire(token=3))) is Refusal.LEAST_INTERVAL
        assert picture(bench) == before
        again_us = now_us + BURST_US + 10_000
    assert bench.core.take(again_us, Fire(token=3)).start_us == again_us
