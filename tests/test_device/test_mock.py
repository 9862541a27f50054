"""The mock: each side checks for itself, and in any order of calls the log is what was emitted."""

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from device import (
    BurstDevice,
    Delivery,
    DeviceError,
    Health,
    LimitExceeded,
    Limits,
    LinkError,
    Measurement,
    MockDevice,
    Outcome,
    OutputStage,
    Refusal,
    RefusedError,
    Rejected,
    VirtualClock,
)
from device.emulate.amplifier import Adc, Amplifier
from tests.test_device.bursts import BURST, SILENCE, changed, play, ready, refusal
from tests.test_device.in_process import InProcess

LIMITS = Limits(ceiling_vpp=200.0, min_interval_s=0.01)


def live_mock(clock: VirtualClock, **options: Any) -> MockDevice:
    device = MockDevice(clock, limits=LIMITS, **options)
    ready(device, 100.0)
    return device


def test_it_says_that_it_is_emulated_and_what_it_can_do() -> None:
    stage = OutputStage(sample_rate_hz=44_100.0, bits=14)
    limits = Limits(ceiling_vpp=150.0, longest_waveform=1000)
    device = MockDevice(VirtualClock(), limits=LIMITS, device_limits=limits, output=stage)
    identity = device.open()
    assert identity.emulated
    assert (identity.sample_rate_hz, identity.bits, identity.channels) == (44_100.0, 14, 2)
    assert (identity.ceiling_vpp, identity.longest_waveform) == (150.0, 1000)


@settings(deadline=None, max_examples=50)
@given(
    now_s=st.floats(0.0, 1e5), drift_ppm=st.floats(-1000.0, 1000.0), offset_s=st.floats(0.0, 1e6)
)
def test_the_devices_clock_is_the_hosts_with_drift_and_offset(
    now_s: float, drift_ppm: float, offset_s: float
) -> None:
    clock = VirtualClock(start_s=now_s)
    device = live_mock(clock, drift_ppm=drift_ppm, offset_s=offset_s)
    clock.wait(1.0)
    felt = play(device, 1)
    wanted_s = (now_s + 1.0) * (1 + drift_ppm * 1e-6) + offset_s
    assert felt.device_us is not None
    assert felt.device_us * 1e-6 == pytest.approx(wanted_s, abs=2e-6)
    assert felt.host_before_s == felt.host_after_s == clock.now_s()
    assert felt.uncertainty_s == 0.0


@pytest.mark.parametrize(
    "call",
    [
        lambda d: d.load(0, np.stack([BURST, SILENCE])),
        lambda d: d.enable(),
        lambda d: d.set_levels([1.0, 1.0]),
        lambda d: d.arm(1, 0, time_to_live_s=0.1),
        lambda d: d.fire(1),
        lambda d: d.disarm(1),
        lambda d: d.query(1),
    ],
)
def test_nothing_is_sent_to_a_device_that_is_not_open(
    call: Callable[[BurstDevice], object],
) -> None:
    device = MockDevice(VirtualClock(), limits=LIMITS)
    assert refusal(lambda: call(device), RefusedError) is Refusal.NOT_OPEN
    device.open()
    device.close()
    assert refusal(lambda: call(device), RefusedError) is Refusal.NOT_OPEN


def test_the_hosts_ceiling_and_the_devices_hold_both() -> None:
    clock = VirtualClock()
    low = Limits(ceiling_vpp=120.0, min_interval_s=0.005)
    for limits, device_limits in ((low, LIMITS), (LIMITS, low)):
        device = MockDevice(clock, limits=limits, device_limits=device_limits)
        device.open()
        device.load(0, np.stack([BURST, BURST]))
        device.set_levels([120.0, 120.0])
        with pytest.raises(LimitExceeded):
            device.set_levels([120.001, 0.0])
    live = live_mock(clock)
    with pytest.raises(LimitExceeded):  # though its whole millivolts are within the ceiling
        live.set_levels([0.0, 200.0005])


def test_the_hosts_own_limits_hold_where_the_devices_would_let_it_pass() -> None:
    clock = VirtualClock()
    strict = Limits(ceiling_vpp=120.0, min_interval_s=1.0, longest_time_to_live_s=5.0)
    device = MockDevice(clock, limits=strict)
    device.open()
    device.load(0, np.stack([BURST, SILENCE]))
    device.load(1, np.stack([0.5 * BURST, SILENCE]))
    device.enable()
    device.set_levels([150.0, 0.0])
    assert refusal(lambda: device.arm(1, 0, time_to_live_s=5.0)) is Refusal.CEILING
    assert refusal(lambda: device.arm(1, 1, time_to_live_s=5.1)) is Refusal.BAD_TIME_TO_LIVE
    play(device, 1, 1, within_s=5.0)
    clock.wait(0.9)
    device.arm(2, 1, time_to_live_s=5.0)
    assert refusal(lambda: device.fire(2), LimitExceeded) is Refusal.LEAST_INTERVAL
    assert device.query(2).outcome is Outcome.INDETERMINATE
    clock.wait(0.2)
    assert device.fire(2).outcome is Outcome.FIRED


def test_samples_that_are_no_finite_numbers_never_leave_the_host() -> None:
    device = live_mock(VirtualClock())
    for bad in (math.nan, math.inf):
        with pytest.raises(Rejected, match="channel 1"):
            device.load(0, np.stack([changed(3, bad), SILENCE]))
    strange: Any = [["0", "1", "0"]] * 2
    with pytest.raises(ValueError, match="samples"):
        device.load(0, strange)


def test_a_power_cycle_forgets_all_and_makes_what_was_armed_indeterminate() -> None:
    clock = VirtualClock()
    device = live_mock(clock)
    old_boot_id = play(device, 1).boot_id
    clock.wait(0.1)
    device.arm(2, 0, time_to_live_s=0.1)
    device.reset()
    for told in (device.fire(2), device.query(2), device.query(1)):
        assert told.outcome is Outcome.INDETERMINATE
        assert told.boot_id != old_boot_id
    with pytest.raises(LinkError):
        device.arm(3, 0, time_to_live_s=0.1)
    assert len(device.emitted) == 1
    device.disarm(1)
    assert device.query(1).outcome is Outcome.INDETERMINATE
    device.open()
    assert device.query(1).outcome is Outcome.INDETERMINATE


def test_losing_power_cuts_the_burst_that_plays() -> None:
    clock = VirtualClock()
    device = live_mock(clock)
    play(device, 1)
    clock.wait(0.001)
    device.reset()
    (cut,) = device.emitted
    assert cut.cut_us == 1000
    assert not cut.volts[0][48:].any()


TAPS = pytest.mark.parametrize("tap", ["line", "amplifier", "current", "motion"])


def wired(amplifier: Amplifier) -> InProcess:
    """Return a device over a wire, live at 100 Vpp, with an amplifier behind it."""
    rig = InProcess(amplifier=amplifier)
    ready(rig.device, 100.0)
    return rig


@TAPS
@pytest.mark.parametrize("kind", ["wire", "mock"])
def test_a_measurement_is_the_burst_by_gain_and_delay(tap: str, kind: str) -> None:
    adc = Adc.parse(f"tap={tap},gain=0.9,delay_us=40")
    clock, rig = VirtualClock(), wired(Amplifier(adc=adc))
    device, wait = rig.device, rig.wait
    if kind == "mock":
        device, wait = live_mock(clock, adc=adc), clock.wait
    play(device, 1)
    assert refusal(lambda: device.measured(1)) is Refusal.BUSY
    wait(0.1)
    measured = device.measured(1)
    assert measured is not None
    assert abs(measured.peaks[0] - round(50.0 * 0.9 * 1000 * np.abs(BURST).max())) <= 5
    assert measured == Measurement(
        token=1,
        tap=tap,
        peaks=(measured.peaks[0], 0),
        onset_offset_us=40,
        onset_uncertainty_us=21,
        correlations=(10_000, 0),
    )
    assert device.measured(2) is None


def test_over_current_comes_at_its_time_and_is_kept_until_the_output_is_on_again() -> None:
    rig = wired(Amplifier(over_current_at_s=1.0))
    device = rig.device
    for wait_s, is_over in ((0.9, False), (0.3, True)):
        rig.wait(wait_s)
        on = Health(amplifier_enabled=not is_over, switch_closed=True, over_current=is_over)
        assert device.health() == on
    refusal(lambda: play(device, 1))
    device.enable()
    assert device.health().over_current is False
    play(device, 1)


@pytest.mark.parametrize(
    ("key", "wrong"),
    [
        ("gain", lambda: Adc(gain=-1.0)),
        ("loss", lambda: Adc(loss=1.1)),
        ("delay_us", lambda: Adc(delay_us=float("nan"))),
        ("adc", lambda: Adc.parse("gain=1,gain=2")),
        ("adc", lambda: Adc.parse("tap")),
        ("over_current_at_s", lambda: Amplifier(over_current_at_s=-1.0)),
    ],
)
def test_what_no_amplifier_or_input_can_be_is_refused(key: str, wrong: Any) -> None:
    with pytest.raises(ValueError, match=key):
        wrong()


PAIRS = [(BURST, SILENCE), (SILENCE, 0.5 * BURST), (BURST, -BURST), (SILENCE, SILENCE)]


class AnyOrder(RuleBasedStateMachine):
    """Every driver call in any order; what the calls said must agree with what came out."""

    def __init__(self) -> None:
        super().__init__()
        self.clock = VirtualClock()
        self.device = MockDevice(self.clock, limits=LIMITS, rng=np.random.default_rng(1))
        self.tokens = [1000]
        self.windows: dict[int, tuple[float, float]] = {}
        self.outcomes: dict[int, set[Outcome]] = {}
        self.reopen()

    @rule()
    def reopen(self) -> None:
        self.device.close()
        self.device.open()
        for slot, pair in enumerate(PAIRS):
            self.device.load(slot, np.stack(pair))
        self.device.enable()
        self.device.set_levels([100.0, 100.0])

    @rule(
        slot=st.integers(0, 3),
        time_to_live_s=st.sampled_from([0.001, 0.1, 2.0]),
        is_new=st.booleans(),
        plays=st.booleans(),
    )
    def arm(self, slot: int, time_to_live_s: float, *, is_new: bool, plays: bool) -> None:
        token = max(self.tokens) + is_new
        self.tokens.append(token)
        now_s = self.clock.now_s()
        with suppress(DeviceError):
            self.device.arm(token, slot, time_to_live_s=time_to_live_s)
            assert token not in self.windows
            self.windows[token] = (now_s, now_s + time_to_live_s)
            if plays:
                self.note(self.device.fire(token))

    @rule(call=st.sampled_from(["fire", "query", "disarm"]), which=st.integers(1, 3))
    def ask(self, call: str, which: int) -> None:
        token = self.tokens[-min(which, len(self.tokens))]
        with suppress(DeviceError):
            self.note(getattr(self.device, call)(token))

    def note(self, delivery: Delivery | None) -> None:
        if delivery is not None and delivery.token in self.windows:
            self.outcomes.setdefault(delivery.token, set()).add(delivery.outcome)

    @rule(
        call=st.sampled_from(
            [
                *(lambda d: d.enable(), lambda d: d.stop(), lambda d: d.silence()),
                *(lambda d: d.set_levels([200.0, 60.0]), lambda d: d.set_levels([60.0, 400.0])),
                *(lambda d: d.load(0, np.stack(PAIRS[2])), lambda d: d.load(2, np.stack(PAIRS[1]))),
            ]
        )
    )
    def order(self, call: Callable[[MockDevice], None]) -> None:
        with suppress(DeviceError):
            call(self.device)

    @rule(duration_s=st.sampled_from([0.0, 0.0005, 0.003, 0.02, 0.3, 3.0]))
    def wait(self, duration_s: float) -> None:
        self.clock.wait(duration_s)

    @precondition(lambda self: self.device.emitted)
    @rule()
    def power_cycle(self) -> None:
        self.device.reset()
        self.reopen()
        self.tokens = [max(self.tokens) + 1]

    @invariant()
    def every_burst_comes_out_once_in_its_window_within_the_ceiling_and_is_reported(self) -> None:
        emitted = [burst.token for burst in self.device.emitted]
        assert len(set(emitted)) == len(emitted)
        for burst in self.device.emitted:
            begin_s, end_s = self.windows[burst.token]
            assert begin_s - 1e-6 <= burst.start_us * 1e-6 <= end_s
            assert max(np.abs(burst.volts[0]).max(), np.abs(burst.volts[1]).max()) <= 100.0
        for token, outcomes in self.outcomes.items():
            assert (Outcome.FIRED in outcomes) <= (token in emitted)
            assert not (Outcome.NOT_FIRED in outcomes and token in emitted)


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(deadline=None, max_examples=15, stateful_step_count=40)
