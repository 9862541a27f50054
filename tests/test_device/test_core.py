"""The device's own logic: what happens when, what is remembered, what can never happen."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device.core.core import WATCHDOG_US, DeviceCore
from device.core.messages import (
    Arm,
    AskHealth,
    AskLimits,
    AskMeasured,
    Beat,
    CodeArray,
    Disarm,
    Enable,
    Fire,
    Levels,
    LoadSlot,
    Message,
    Query,
    Stop,
    to_codes,
)
from device.core.output import Emission, OutputStage
from device.core.reports import Health, Measurement
from device.core.states import ILLEGAL, TRANSITIONS, State, Step
from device.core.tokens import Fate, Record
from device.errors import Refusal, Rejected
from device.limits import Limits
from tests.test_device.bursts import refusal, sine

LIMITS = Limits(ceiling_vpp=200.0, least_interval_s=0.01, max_duty=0.5)
BURST_US = 2021


def sine_codes(n_samples: int = 97, peak: float = 1.0) -> CodeArray:
    return to_codes(sine(n_samples, peak=peak), bits=16)


def load_message(slot: int = 0, n_samples: int = 97, peak: float = 1.0) -> LoadSlot:
    codes = sine_codes(n_samples, peak)
    return LoadSlot(slot=slot, left=codes, right=np.zeros_like(codes))


def levels(left_mvpp: int) -> Levels:
    return Levels(left_mvpp=left_mvpp, right_mvpp=left_mvpp)


def arm(token: int, *, slot: int = 0, time_to_live_us: int = 100_000) -> Arm:
    return Arm(token=token, slot=slot, time_to_live_us=time_to_live_us)


TRIAL: tuple[Message[Any], ...] = (levels(100_000), Enable(), arm(1), Fire(token=1))
"""From a loaded waveform to its burst."""


class Bench(NamedTuple):
    core: DeviceCore
    over: list[Emission]


def power_on(*, history: int = 1024) -> Bench:
    over: list[Emission] = []
    output = OutputStage()
    core = DeviceCore(boot_id=1, limits=LIMITS, output=output, sink=over.append, history=history)
    return Bench(core, over)


def live(*, history: int = 1024, n_samples: int = 97) -> Bench:
    """A device that is live at 0 us with its last beat then, at 100 Vpp."""
    bench = power_on(history=history)
    for message in (load_message(n_samples=n_samples), levels(100_000), Enable()):
        bench.core.take(0, message)
    return bench


def state_at(core: DeviceCore, now_us: int) -> State:
    core.advance(now_us)
    return core.state


def fate(core: DeviceCore, token: int) -> Fate:
    return core.take(core.now_us, Query(token=token)).fate


def refused(core: DeviceCore, now_us: int, message: Message[Any]) -> Refusal:
    return refusal(lambda: core.take(now_us, message), Rejected)


def test_the_watchdog_trips_half_a_second_after_the_last_beat_and_no_beat_leads_back() -> None:
    core = live().core
    core.take(300_000, Beat())
    assert state_at(core, 300_000 + WATCHDOG_US - 1) is State.LIVE
    assert state_at(core, 300_000 + WATCHDOG_US) is State.SAFE
    core.take(300_000 + WATCHDOG_US, Beat())
    assert state_at(core, 300_001 + WATCHDOG_US) is State.SAFE


def test_a_device_whose_output_is_off_needs_no_beat() -> None:
    core = power_on().core
    core.advance(10 * WATCHDOG_US)
    core.take(20 * WATCHDOG_US, load_message())
    assert state_at(core, 30 * WATCHDOG_US) is State.LOADED
    core.take(30 * WATCHDOG_US, Enable())
    assert state_at(core, 31 * WATCHDOG_US - 1) is State.LIVE


@pytest.mark.parametrize(
    ("time_to_live_us", "became"), [(400_000, Fate.EXPIRED), (600_000, Fate.ABORTED)]
)
def test_what_is_due_in_one_leap_happens_in_the_order_of_time(
    time_to_live_us: int, became: Fate
) -> None:
    core = live().core
    core.take(0, arm(1, time_to_live_us=time_to_live_us))
    assert state_at(core, 10_000_000) is State.SAFE
    assert fate(core, 1) is became


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
    assert state_at(core, 9_000_000) is State.SAFE
    (cut,) = over
    assert cut.cut_us == WATCHDOG_US
    first_zero = (WATCHDOG_US - 200_000) * 48 // 1000
    assert cut.left_v[:first_zero].any()
    assert not cut.left_v[first_zero:].any()
    assert fate(core, 1) is Fate.FIRED


def test_time_that_goes_back_is_refused() -> None:
    core = live().core
    core.advance(5)
    with pytest.raises(ValueError, match="now_us must be 5 or later, got 4"):
        core.take(4, Beat())


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


def test_a_late_fire_cannot_fire_but_one_in_the_last_microsecond_can() -> None:
    core, over = live()
    core.take(0, arm(1, time_to_live_us=1000))
    assert refused(core, 1000, Fire(token=1)) is Refusal.EXPIRED
    assert fate(core, 1) is Fate.EXPIRED
    assert refused(core, 1000, arm(1)) is Refusal.TOKEN_SPENT
    assert over == []
    core.take(1000, arm(2, time_to_live_us=1000))
    assert core.take(1999, Fire(token=2)).start_us == 1999


@pytest.mark.parametrize("armed_before", [True, False])
def test_a_disarmed_token_can_never_fire(*, armed_before: bool) -> None:
    core, over = live()
    if armed_before:
        core.take(0, arm(1))
    core.take(1, Disarm(token=1))
    assert fate(core, 1) is (Fate.ABORTED if armed_before else Fate.NEVER_ARMED)
    assert refused(core, 3, Fire(token=1)) is Refusal.ABORTED
    assert refused(core, 4, arm(1)) is Refusal.TOKEN_SPENT
    core.take(5, arm(2))
    assert refused(core, 6, Fire(token=1)) is Refusal.ABORTED
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
    unsure, sure = [Fate.UNKNOWN] * 2, [Fate.FIRED] * 3
    assert [fate(core, token) for token in range(1, 7)] == [*unsure, *sure, Fate.NEVER_ARMED]
    core.take(now_us, Disarm(token=1))
    assert fate(core, 1) is Fate.UNKNOWN
    assert refused(core, now_us, Fire(token=2)) is Refusal.NOT_ARMED


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
    assert fate(core, 1) is Fate.ARMED
    assert core.take(0, Fire(token=1)).fate is Fate.FIRED


@pytest.mark.parametrize("peaks", [(1, 0), (0.01, 0), (0, 0.01), (1, 1)])
def test_record_and_burst_name_the_levels_that_were_set_and_zero_for_silence(
    peaks: tuple[float, float],
) -> None:
    core = live().core
    left, right = (sine_codes(peak=peak) for peak in peaks)
    core.take(0, LoadSlot(slot=1, left=left, right=right))
    core.take(0, Levels(left_mvpp=64_123, right_mvpp=99_000))
    core.take(0, arm(1, slot=1))
    told = 64_123 if peaks[0] else 0, 99_000 if peaks[1] else 0
    assert core.take(0, Fire(token=1)).levels_mvpp == told
    assert core.playing is not None
    burst_vpp = core.playing.level_left_vpp, core.playing.level_right_vpp
    assert burst_vpp == (told[0] / 1000, told[1] / 1000)


def test_a_level_no_loaded_waveform_could_use_is_refused_when_it_is_set() -> None:
    core = live().core
    assert refused(core, 0, levels(200_001)) is Refusal.CEILING
    core.take(0, load_message(slot=1, peak=0.5))
    core.take(0, levels(300_000))
    assert refused(core, 0, arm(1)) is Refusal.CEILING
    core.take(0, arm(1, slot=1))
    core.take(0, Fire(token=1))
    assert core.playing is not None
    assert 149.9 < np.ptp(core.playing.left_v) <= 150.0


def test_the_device_keeps_its_own_copy_of_what_was_loaded() -> None:
    core = power_on().core
    message = load_message()
    core.take(0, message)
    message.left[:] = 7
    for later in TRIAL:
        core.take(0, later)
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
    way = {State.LOADED: 1, State.LIVE: 2, State.ARMED: 3, State.FIRED: 4}
    if state in way:
        core.take(0, load_message())
    for message in TRIAL[: way.get(state, 0)]:
        core.take(100 if isinstance(message, Fire) else 0, message)
    if state is State.SAFE:
        core.take(0, Stop())
    assert state_at(core, 100) is state
    return bench


MESSAGES: dict[Step, Callable[[DeviceCore], Message[Any]]] = {
    Step.LOAD: lambda core: load_message(),
    Step.LEVEL: lambda core: levels(50_000),
    Step.ENABLE: lambda core: Enable(),
    Step.ARM: lambda core: arm(2),
    Step.FIRE: lambda core: Fire(token=1 if core.state is State.ARMED else 3),
}


@pytest.mark.parametrize("state", [state for state in State if state is not State.CLOSED])
@pytest.mark.parametrize("step", MESSAGES)
def test_a_step_follows_the_table_or_is_refused_and_changes_nothing(
    state: State, step: Step
) -> None:
    bench = prepared(state)
    before, message = picture(bench), MESSAGES[step](bench.core)
    if (state, step) in TRANSITIONS:
        bench.core.take(100, message)
        assert bench.core.state is TRANSITIONS[state, step]
    else:
        assert refused(bench.core, 100, message) is ILLEGAL[state]
        assert picture(bench) == before


def bad_load() -> LoadSlot:
    codes = sine_codes()
    return LoadSlot(slot=0, left=codes, right=np.roll(codes, 5))


BAD_STEPS: list[tuple[State, Refusal, Callable[[], Message[Any]]]] = [
    (State.LIVE, Refusal.EDGES_NOT_ZERO, bad_load),
    (State.LIVE, Refusal.CEILING, lambda: levels(200_001)),
    (State.LIVE, Refusal.EMPTY_SLOT, lambda: arm(2, slot=5)),
    (State.LIVE, Refusal.BAD_TIME_TO_LIVE, lambda: arm(2, time_to_live_us=0)),
    (State.LIVE, Refusal.BAD_TOKEN, lambda: Disarm(token=0)),
    (State.LIVE, Refusal.BAD_TOKEN, lambda: Query(token=2**64)),
    (State.ARMED, Refusal.WRONG_TOKEN, lambda: Fire(token=2)),
    (State.ARMED, Refusal.BAD_TOKEN, lambda: Fire(token=-1)),
    (State.IDLE, Refusal.BAD_MESSAGE, Message),
]


@pytest.mark.parametrize(("state", "code", "message"), BAD_STEPS)
def test_a_refused_message_changes_nothing(
    state: State, code: Refusal, message: Callable[[], Message[Any]]
) -> None:
    bench = prepared(state)
    before = picture(bench)
    assert refusal(lambda: bench.core.take(100, message())) is code
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
        assert refused(bench.core, again_us, Fire(token=3)) is Refusal.LEAST_INTERVAL
        assert picture(bench) == before
        again_us = now_us + BURST_US + 10_000
    assert bench.core.take(again_us, Fire(token=3)).start_us == again_us


def sensed(*, closed: bool | None = True, over: bool | None = False) -> Health:
    return Health(switch_closed=closed, over_current=over)


@pytest.mark.parametrize(("closed", "refuses"), [(True, False), (None, False), (False, True)])
def test_only_a_switch_that_is_known_to_be_open_keeps_a_burst_back(
    *, closed: bool | None, refuses: bool
) -> None:
    core, over = live()
    core.sense(1, sensed(closed=closed))
    if not refuses:
        core.take(2, arm(1))
        core.take(3, Fire(token=1))
        return
    assert refused(core, 2, arm(1)) is Refusal.AMPLIFIER_OFF
    core.sense(3, sensed())
    core.take(4, arm(1))
    core.sense(5, sensed(closed=False))
    assert refused(core, 6, Fire(token=1)) is Refusal.AMPLIFIER_OFF
    core.sense(7, sensed())
    core.take(8, Fire(token=1))
    core.sense(9, sensed(closed=False))
    assert core.take(10, Fire(token=1)).fate is Fate.FIRED
    assert state_at(core, 10_000) is State.LIVE
    assert [burst.cut_us for burst in over] == [None]


@pytest.mark.parametrize("state", ["idle", "live", "armed", "fired", "safe"])
def test_over_current_stops_whatever_is_done_and_is_kept_until_enable(state: str) -> None:
    core, over = power_on() if state == "idle" else live()
    if state in {"armed", "fired"}:
        core.take(0, arm(1))
    if state == "fired":
        core.take(0, Fire(token=1))
    if state == "safe":
        core.take(0, Stop())
    core.sense(500, sensed(over=True))
    assert (core.state, core.health.over_current) == (State.SAFE, True)
    assert [burst.cut_us for burst in over] == ([500] if state == "fired" else [])
    core.sense(600, sensed())
    told = core.take(700, AskHealth())
    assert (told.over_current, told.amplifier_enabled) == (True, False)
    core.take(800, Enable())
    core.sense(850, sensed())
    told = core.take(900, AskHealth())
    assert (told.over_current, told.amplifier_enabled) == (False, True)


def test_health_is_as_it_was_told_last() -> None:
    core = power_on().core
    assert core.health == Health(amplifier_enabled=False)
    for report in (sensed(), sensed(closed=None), sensed(over=None), sensed(closed=False)):
        core.sense(0, report)
        assert core.health == replace(report, amplifier_enabled=False)


def test_what_was_measured_is_told_of_the_last_burst_once_it_is_over() -> None:
    def measure(burst: Emission) -> Measurement:
        return Measurement(token=burst.token, tap="line", unit="mV", left=len(burst.left_v))

    core = DeviceCore(
        boot_id=1, limits=LIMITS, output=OutputStage(), sink=lambda _: None, measure=measure
    )
    for message in (load_message(), *TRIAL):
        core.take(0, message)
    assert refused(core, 1, AskMeasured(token=1)) is Refusal.BUSY
    assert core.take(1, AskMeasured(token=2)).tap == ""
    assert core.take(BURST_US, AskMeasured(token=1)).left == 97
    core.take(100_000, arm(2))
    assert core.take(100_000, AskMeasured(token=1)).left == 97
    core.take(100_000, Fire(token=2))
    core.take(100_100, Stop())
    assert [core.take(200_000, AskMeasured(token=token)).tap for token in (1, 2)] == [""] * 2


def test_all_slots_together_hold_so_many_samples_and_the_one_replaced_is_free() -> None:
    limits = Limits(ceiling_vpp=200.0, slots=3, memory_samples=200)
    core = DeviceCore(boot_id=1, limits=limits, output=OutputStage(), sink=lambda _: None)
    core.take(0, load_message(0, 97))
    core.take(0, load_message(2, 97))
    assert refused(core, 0, load_message(1, 9)) is Refusal.MEMORY_FULL
    assert refused(core, 0, load_message(3, 3)) is Refusal.BAD_SLOT
    core.take(0, load_message(0, 103))
    assert refused(core, 0, load_message(0, 104)) is Refusal.MEMORY_FULL


def test_a_device_tells_the_limits_that_it_keeps() -> None:
    told = power_on().core.take(0, AskLimits())
    assert told.applied(Limits(ceiling_vpp=200.0)) == LIMITS
    assert told.data_window == 8
