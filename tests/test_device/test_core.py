"""The device's own logic: what happens when, what is remembered, what can never happen."""

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device import Emission, Health, Limits, Measurement, OutputStage, Refusal, State
from device.core.states import ILLEGAL, TRANSITIONS, Step
from tests.test_device.bench import BURST_US, Bench, fate_name

if TYPE_CHECKING:
    from collections.abc import Callable

WATCHDOG_US = 500_000


def test_the_watchdog_trips_half_a_second_after_the_last_beat_and_no_beat_leads_back() -> None:
    bench = Bench().live()
    bench.take(300_000, "BEAT")
    assert bench.state_at(300_000 + WATCHDOG_US - 1) is State.LIVE
    assert bench.state_at(300_000 + WATCHDOG_US) is State.SAFE
    bench.take(300_000 + WATCHDOG_US, "BEAT")
    assert bench.state_at(300_001 + WATCHDOG_US) is State.SAFE


def test_a_device_whose_output_is_off_needs_no_beat() -> None:
    bench = Bench()
    bench.core.advance(10 * WATCHDOG_US)
    bench.load(20 * WATCHDOG_US)
    assert bench.state_at(30 * WATCHDOG_US) is State.LOADED
    bench.take(30 * WATCHDOG_US, "OUTPUT")
    assert bench.state_at(31 * WATCHDOG_US - 1) is State.LIVE


@pytest.mark.parametrize(("time_to_live_us", "fate"), [(400_000, "expired"), (600_000, "aborted")])
def test_what_is_due_in_one_leap_happens_in_the_order_of_time(
    time_to_live_us: int, fate: str
) -> None:
    bench = Bench().live()
    bench.arm(0, 1, time_to_live_us=time_to_live_us)
    assert bench.state_at(10_000_000) is State.SAFE
    assert bench.fate(1) == fate


def test_a_burst_is_handed_over_once_and_whole_when_it_is_over() -> None:
    bench = Bench().live()
    bench.arm(100, 1)
    bench.fire(100, 1)
    assert bench.state_at(100 + BURST_US - 1) is State.FIRED
    playing = bench.core.playing
    assert bench.over == []
    assert bench.state_at(100 + BURST_US) is State.LIVE
    assert bench.core.playing is None
    bench.take(100 + BURST_US, "STOP")
    assert bench.over == [playing]
    assert bench.over[0].cut_us is None


def test_a_fired_token_gives_its_record_whatever_the_device_does_since() -> None:
    bench = Bench().live()
    bench.arm(0, 1)
    record = bench.fire(10, 1)
    assert bench.fire(20, 1) == bench.fire(50_000, 1) == record
    bench.take(50_000, "DISARM", token=1)
    bench.arm(50_000, 2)
    assert bench.fire(50_010, 1) == record
    assert bench.core.state is State.ARMED
    bench.take(50_020, "STOP")
    assert bench.fire(50_030, 1) == bench.take(50_030, "QUERY", token=1) == record
    assert [(burst.token, burst.cut_us) for burst in bench.over] == [(1, None)]


def test_a_late_fire_cannot_fire_but_one_in_the_last_microsecond_can() -> None:
    bench = Bench().live()
    bench.arm(0, 1, time_to_live_us=1000)
    assert bench.refused(1000, "FIRE", token=1) is Refusal.EXPIRED
    assert bench.fate(1) == "expired"
    again = {"token": 1, "slot": 0, "time_to_live_us": 9}
    assert bench.refused(1000, "ARM", **again) is Refusal.TOKEN_SPENT
    assert bench.over == []
    bench.arm(1000, 2, time_to_live_us=1000)
    assert bench.fire(1999, 2).start_us == 1999


@pytest.mark.parametrize("armed_before", [True, False])
def test_a_disarmed_token_can_never_fire_and_leaves_others_alone(*, armed_before: bool) -> None:
    bench = Bench().live()
    if armed_before:
        bench.arm(0, 1)
    bench.take(1, "DISARM", token=1)
    assert bench.fate(1) == ("aborted" if armed_before else "never_armed")
    assert bench.refused(3, "FIRE", token=1) is Refusal.ABORTED
    again = {"token": 1, "slot": 0, "time_to_live_us": 9}
    assert bench.refused(4, "ARM", **again) is Refusal.TOKEN_SPENT
    bench.arm(5, 2)
    bench.take(6, "DISARM", token=7)
    assert bench.refused(6, "FIRE", token=1) is Refusal.ABORTED
    assert (bench.core.state, bench.over) == (State.ARMED, [])


def test_a_forgotten_token_is_unknown_and_stays_so_when_it_is_armed_or_disarmed() -> None:
    bench = Bench(history=3).live()
    now_us = bench.play(range(1, 6))
    unsure, sure = ["unknown"] * 2, ["fired"] * 3
    assert [bench.fate(token) for token in range(1, 7)] == [*unsure, *sure, "never_armed"]
    bench.take(now_us, "DISARM", token=1)
    assert bench.fate(1) == "unknown"
    assert bench.refused(now_us, "FIRE", token=2) is Refusal.NOT_ARMED
    bench.arm(now_us, 2)
    bench.take(now_us, "DISARM", token=2)
    assert bench.fate(2) == "unknown"


def test_the_armed_token_is_not_forgotten_however_many_others_are_disarmed() -> None:
    bench = Bench(history=2).live()
    bench.arm(0, 1)
    for token in range(10, 20):
        bench.take(0, "DISARM", token=token)
    assert bench.fate(1) == "armed"
    assert fate_name(bench.fire(0, 1)) == "fired"


@pytest.mark.parametrize("peaks", [(1, 0), (0.01, 0), (0, 0.01), (1, 1)])
def test_record_and_burst_have_the_levels_that_were_set_and_zero_for_silence(
    peaks: tuple[float, float],
) -> None:
    bench = Bench().live()
    bench.load(0, 1, left=peaks[0], right=peaks[1])
    bench.levels(0, 64_123, 99_000)
    bench.arm(0, 1, slot=1)
    levels_mvpp = 64_123 if peaks[0] else 0, 99_000 if peaks[1] else 0
    record = bench.fire(0, 1)
    assert record.levels_mvpp == levels_mvpp
    burst = bench.core.playing
    assert burst is not None
    assert burst.levels_vpp == (levels_mvpp[0] / 1000, levels_mvpp[1] / 1000)


@pytest.mark.parametrize("n_settings", [300, pytest.param(5000, marks=pytest.mark.slow)])
def test_a_device_plays_what_is_exactly_within_its_ceiling_and_refuses_the_rest(
    n_settings: int,
) -> None:
    rng, n_played = np.random.default_rng(21), 0
    for _ in range(n_settings):
        ceiling_mvpp = int(rng.integers(1, 400_001))
        ceiling_vpp = ceiling_mvpp / 1000
        peak = float(rng.choice([1.0, 0.5, rng.uniform(0.001, 1.0)]))
        level_mvpp = max(0, round(ceiling_vpp / peak * 1000) + int(rng.integers(-1, 2)))
        limits = Limits(ceiling_vpp=ceiling_vpp, min_interval_s=0.0)
        bench = Bench(limits=limits, output=OutputStage(rail_v=1000.0))
        bench.load(0, n=5, left=peak)
        bench.take(0, "OUTPUT")
        code = Fraction(int(peak * 32767), 32767)
        above = code * Fraction(level_mvpp, 1000) > Fraction(ceiling_mvpp, 1000)
        if above:
            codes = {bench.refused(1, "LEVEL", levels_mvpp=(level_mvpp, 0))}
            assert codes == {Refusal.CEILING}
        else:
            bench.levels(1, level_mvpp, 0)
        bench.arm(1, 1)
        bench.fire(2, 1)
        bench.take(2_000_000, "STOP")
        (burst,) = bench.over
        assert np.ptp(burst.volts[0]) <= (0.0 if above else ceiling_vpp)
        n_played += not above
    assert 0.1 * n_settings < n_played < 0.9 * n_settings


def test_the_device_keeps_its_own_copy_of_what_was_loaded() -> None:
    bench = Bench()
    codes = np.array([[0, 9, -9, 0]] * 2, dtype=np.int32)
    bench.take(0, "LOAD", slot=0, codes=codes)
    codes[:] = 7
    bench.levels(0, 100_000)
    bench.take(0, "OUTPUT")
    bench.arm(0, 1)
    bench.fire(0, 1)
    assert bench.core.playing is not None
    assert not bench.core.playing.volts[:, 0].any()


def prepared(state: State) -> Bench:
    """Return a device in a state, at 100 us."""
    bench = Bench()
    n_steps = {State.LOADED: 2, State.LIVE: 3, State.ARMED: 4, State.FIRED: 5}.get(state, 0)
    if n_steps:
        bench.load(0)
        bench.levels(0, 100_000)
    if n_steps > 2:
        bench.take(0, "OUTPUT")
    if n_steps > 3:
        bench.arm(0, 1)
    if n_steps > 4:
        bench.fire(100, 1)
    if state is State.SAFE:
        bench.take(0, "STOP")
    assert bench.state_at(100) is state
    return bench


STEPS: dict[Step, tuple[str, dict[str, object]]] = {
    Step.LOAD: ("LOAD", {"slot": 0, "codes": np.zeros((2, 4), int)}),
    Step.LEVEL: ("LEVEL", {"levels_mvpp": (50_000, 0)}),
    Step.ENABLE: ("OUTPUT", {}),
    Step.ARM: ("ARM", {"token": 2, "slot": 0, "time_to_live_us": 9}),
    Step.FIRE: ("FIRE", {"token": 3}),
}


@pytest.mark.parametrize("state", [state for state in State if state is not State.CLOSED])
@pytest.mark.parametrize("step", STEPS)
def test_a_step_follows_the_table_or_is_refused_and_changes_nothing(
    state: State, step: Step
) -> None:
    bench, (name, fields) = prepared(state), STEPS[step]
    if (state, step) == (State.ARMED, Step.FIRE):
        fields = {"token": 1}
    if (state, step) in TRANSITIONS:
        bench.take(100, name, **fields)
        assert bench.core.state is TRANSITIONS[state, step]
    else:
        assert bench.refused(100, name, **fields) is ILLEGAL[state]
        assert bench.future() == prepared(state).future()


@settings(deadline=None, max_examples=100)
@given(since_us=st.integers(BURST_US, 20_000))
def test_a_token_refused_for_lack_of_rest_stays_armed_and_fires_after_it(since_us: int) -> None:
    bench = Bench().live()
    bench.arm(0, 2)
    assert bench.fire(0, 2).start_us == 0
    bench.arm(since_us, 3)
    if since_us < BURST_US + 10_000:
        assert bench.refused(since_us, "FIRE", token=3) is Refusal.LEAST_INTERVAL
        since_us = BURST_US + 10_000
    assert bench.fire(since_us, 3).start_us == since_us


SAFE = Health(switch_closed=True, over_current=False)


@pytest.mark.parametrize(("closed", "refuses"), [(True, False), (None, False), (False, True)])
def test_only_a_switch_that_is_known_to_be_open_keeps_a_burst_back(
    *, closed: bool | None, refuses: bool
) -> None:
    bench = Bench().live()
    bench.core.sense(1, Health(switch_closed=closed, over_current=False))
    if not refuses:
        bench.arm(2, 1)
        bench.fire(3, 1)
        return
    arm = {"token": 1, "slot": 0, "time_to_live_us": 99_000}
    assert bench.refused(2, "ARM", **arm) is Refusal.AMPLIFIER_OFF
    bench.core.sense(3, SAFE)
    bench.take(4, "ARM", **arm)
    for at_us, refused in ((5, True), (7, False)):
        bench.core.sense(at_us, Health(switch_closed=not refused, over_current=False))
        if refused:
            assert bench.refused(at_us + 1, "FIRE", token=1) is Refusal.AMPLIFIER_OFF
    bench.fire(8, 1)
    bench.core.sense(9, Health(switch_closed=False, over_current=False))
    assert fate_name(bench.fire(10, 1)) == "fired"
    assert bench.state_at(10_000) is State.LIVE
    assert [burst.cut_us for burst in bench.over] == [None]


@pytest.mark.parametrize("state", [State.IDLE, State.LIVE, State.ARMED, State.FIRED, State.SAFE])
def test_over_current_stops_whatever_is_done_and_is_kept_until_enable(state: State) -> None:
    bench = prepared(state)
    bench.core.sense(500, Health(switch_closed=True, over_current=True))
    assert (bench.core.state, bench.core.health.over_current) == (State.SAFE, True)
    assert [burst.cut_us for burst in bench.over] == ([500] if state is State.FIRED else [])
    for at_us, is_over in ((700, True), (900, False)):
        bench.core.sense(at_us - 50, SAFE)
        health = bench.take(at_us, "HEALTH")
        assert (health.over_current, health.amplifier_enabled) == (is_over, not is_over)
        bench.take(at_us, "OUTPUT")


def test_a_measurement_is_that_of_the_last_burst_once_it_is_over() -> None:
    def measure(burst: Emission) -> Measurement:
        return Measurement(token=burst.token, tap="line", peaks=burst.volts.shape)

    def measured(at_us: int, token: int) -> tuple[str, tuple[int, ...]]:
        answer = bench.take(at_us, "MEASURED", token=token)
        return answer.tap, answer.peaks

    bench = Bench(measure=measure).live()
    bench.arm(0, 1)
    bench.fire(0, 1)
    assert bench.refused(1, "MEASURED", token=1) is Refusal.BUSY
    assert measured(1, 2) == ("", ())
    assert measured(BURST_US, 1) == ("line", (2, 97))
    bench.arm(100_000, 2)
    assert measured(100_000, 1) == ("line", (2, 97))
    bench.fire(100_000, 2)
    bench.take(100_100, "STOP")
    assert [measured(200_000, token) for token in (1, 2)] == [("", ())] * 2


def test_why_the_outputs_went_off_is_the_reason_of_what_is_refused_until_they_are_on_again() -> (
    None
):
    stops: dict[Refusal, Callable[[Bench], object]] = {
        Refusal.SAFE_STATE: lambda bench: bench.take(bench.now_us, "STOP"),
        Refusal.WATCHDOG_STOP: lambda bench: bench.core.advance(bench.now_us + 500_000),
        Refusal.OVERLOAD_STOP: lambda bench: bench.core.sense(
            bench.now_us, Health(over_current=True)
        ),
        Refusal.LINE_STOP: lambda bench: bench.core.lose_line(bench.now_us),
    }
    bench = Bench().live()
    for reason, stop in stops.items():
        stop(bench)
        for later in (stop, *stops.values()):
            later(bench)
            assert bench.refused(bench.now_us, "ARM", token=1, slot=0, time_to_live_us=9) is reason
        bench.take(bench.now_us, "OUTPUT")
