"""The mock under any order of calls: what they said must agree with what came out."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from device.clock import VirtualClock
from device.driver import DeviceError, FloatArray, Outcome
from device.emulate.mock import MockDevice
from device.limits import Limits
from tests.test_device.bursts import BURST, SILENCE

LIMITS = Limits(ceiling_vpp=200.0, least_interval_s=0.01)
PAIRS = [(BURST, SILENCE), (SILENCE, 0.5 * BURST), (BURST, -BURST), (SILENCE, SILENCE)]


class AnyOrder(RuleBasedStateMachine):
    """Every driver call in any order; what the calls said must agree with what came out."""

    def __init__(self) -> None:
        super().__init__()
        self.clock = VirtualClock()
        self.device = MockDevice(self.clock, limits=LIMITS, rng=np.random.default_rng(1))
        self.fresh = 1000
        self.tokens = [1]
        self.windows: dict[int, tuple[float, float]] = {}
        self.fired: set[int] = set()
        self.not_fired: set[int] = set()
        self.make_ready()

    def make_ready(self) -> None:
        self.device.open()
        for slot, pair in enumerate(PAIRS):
            self.device.load(slot, *pair)
        self.device.enable()
        self.device.set_levels(100.0, 100.0)

    def attempt(self, call: Callable[[], object]) -> bool:
        try:
            call()
        except DeviceError:
            return False
        return True

    def next_token(self) -> int:
        self.fresh += 1
        return self.fresh

    def arm_within(self, token: int, slot: int, time_to_live_s: float) -> bool:
        self.tokens.append(token)
        now_s = self.clock.now_s()
        armed = self.attempt(lambda: self.device.arm(token, slot, time_to_live_s=time_to_live_s))
        if armed:
            assert token not in self.windows
            self.windows[token] = (now_s, now_s + time_to_live_s)
        return armed

    @rule(slot=st.integers(0, 2), pair=st.sampled_from(PAIRS))
    def load(self, slot: int, pair: tuple[FloatArray, FloatArray]) -> None:
        self.attempt(lambda: self.device.load(slot, *pair))

    @rule(left_vpp=st.floats(0.0, 220.0), right_vpp=st.sampled_from([0.0, 60.0, 200.0, 400.0]))
    def set_levels(self, left_vpp: float, right_vpp: float) -> None:
        self.attempt(lambda: self.device.set_levels(left_vpp, right_vpp))

    @rule()
    def enable(self) -> None:
        self.attempt(self.device.enable)

    @rule(data=st.data(), slot=st.integers(0, 3), time_to_live_s=st.sampled_from([0.001, 0.1, 2.0]))
    def arm(self, data: st.DataObject, slot: int, time_to_live_s: float) -> None:
        token = data.draw(st.just(self.next_token()) | st.sampled_from(self.tokens[-3:]))
        self.arm_within(token, slot, time_to_live_s)

    @rule(data=st.data())
    def fire(self, data: st.DataObject) -> None:
        token = data.draw(st.sampled_from(self.tokens[-3:]))
        self.attempt(lambda: self.note(self.device.fire(token).outcome, token))

    @rule(slot=st.integers(0, 3), rest_s=st.sampled_from([0.0005, 0.02]))
    def trial(self, slot: int, rest_s: float) -> None:
        token = self.next_token()
        self.attempt(self.device.enable)
        if self.arm_within(token, slot, 0.1):
            self.attempt(lambda: self.note(self.device.fire(token).outcome, token))
        self.clock.wait(rest_s)

    @rule(data=st.data())
    def query(self, data: st.DataObject) -> None:
        token = data.draw(st.sampled_from(self.tokens))
        self.attempt(lambda: self.note(self.device.query(token).outcome, token))

    @rule(data=st.data())
    def disarm(self, data: st.DataObject) -> None:
        token = data.draw(st.sampled_from(self.tokens))
        self.attempt(lambda: self.device.disarm(token))

    def note(self, outcome: Outcome, token: int) -> None:
        if outcome is Outcome.FIRED:
            self.fired.add(token)
        elif outcome is Outcome.NOT_FIRED and token in self.windows:
            self.not_fired.add(token)

    @rule(duration_s=st.sampled_from([0.0, 0.0005, 0.003, 0.02, 0.3, 3.0]))
    def wait(self, duration_s: float) -> None:
        self.clock.wait(duration_s)

    @rule()
    def stop(self) -> None:
        self.device.stop()

    @precondition(lambda self: self.fired)
    @rule()
    def silence(self) -> None:
        self.device.silence()

    @rule()
    def reopen(self) -> None:
        self.device.close()
        self.make_ready()

    @precondition(lambda self: self.fired)
    @rule()
    def power_cycle(self) -> None:
        self.device.reset()
        self.make_ready()
        self.tokens = [self.next_token()]

    @invariant()
    def every_burst_is_in_the_log_and_every_logged_burst_came_out(self) -> None:
        emitted = [emission.token for emission in self.device.emitted]
        assert len(set(emitted)) == len(emitted)
        assert set(emitted) == self.fired
        assert not self.not_fired & set(emitted)

    @invariant()
    def no_burst_leaves_its_window_or_passes_the_ceiling(self) -> None:
        for emission in self.device.emitted:
            begin_s, end_s = self.windows[emission.token]
            assert begin_s <= emission.start_us * 1e-6 + 1e-6
            assert emission.start_us * 1e-6 <= end_s
            for volts in (emission.left_v, emission.right_v):
                assert np.abs(volts).max() <= 100.0


TestAnyOrder = pytest.mark.slow(AnyOrder.TestCase)
TestAnyOrder.settings = settings(deadline=None, max_examples=80, stateful_step_count=40)
