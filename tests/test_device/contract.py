"""One contract for every device: whatever passes these tests can stand behind a session.

The device's ceiling and the study's are 200 Vpp, the least interval is 10 ms, the largest duty a
half. Where time is real, no test waits for more than a few seconds, and what has to happen in time
has seconds to happen. Where nobody can read the bursts, the device's own answers stand for them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest

from device import LimitExceeded, Outcome, Refusal, RefusedError, Rejected
from device.core.converter import ConverterDevice
from device.core.host import HostDriver
from tests.test_device import bursts
from tests.test_device.bursts import BURST, SILENCE, changed, refusal
from tests.test_device.rigs import FreshTokens, Rig

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from device import BurstDevice, Delivery
    from tests.test_device.rigs import Rigs

SLOW = {("audio", "test_the_same_token_again_gives_the_same_record_and_no_other_burst")}
"""Each sample of an hour is played."""
WAITS = "fire returns when the burst is over"
HOSTED = {
    "test_no_burst_is_armed_while_one_plays": WAITS,
    "test_a_stop_cuts_the_burst_and_only_enable_undoes_it": WAITS,
    "test_without_a_heartbeat_the_output_goes_to_zero_within_half_a_second": "it has no watchdog",
}
"""Which part of the contract a device whose core is in the host cannot keep, and why."""
STOOD_STILL = pytest.StashKey["Callable[[], bool]"]()
"""Of a test: whether the machine had no time for host or device."""
LONG, SHORT = 4, 5
"""Slots of a long and a short burst."""


def load_long(rig: Rig, slot: int = LONG) -> None:
    """Load a burst that is long enough to do something while it plays: to the left."""
    n_periods = round(rig.long_s * rig.rate_hz / 96)
    if n_periods * 96 + 1 > rig.longest:
        pytest.skip("the device holds no burst that is long enough")
    samples = np.append(np.tile(BURST[:-1], n_periods), 0.0)
    rig.device.load(slot, np.stack([samples, 0 * samples]))


def play(rig: Rig, token: int, slot: int = 0) -> Delivery:
    return bursts.play(rig.device, token, slot, within_s=rig.time_to_live_s)


READY: dict[str, Callable[[Rig], object]] = {
    "idle": lambda rig: None,
    "loaded": lambda rig: rig.device.load(0, np.stack([BURST, SILENCE])),
    "live": lambda rig: rig.device.enable(),
    "armed": lambda rig: rig.device.arm(1, 0, time_to_live_s=rig.time_to_live_s),
    "playing": lambda rig: rig.device.fire(1),
}


STATES: dict[str, tuple[str, Refusal]] = {
    "idle": ("load levels", Refusal.NOTHING_LOADED),
    "loaded": ("load levels enable", Refusal.NOT_ENABLED),
    "live": ("load levels enable arm", Refusal.NOT_ARMED),
    "armed": ("fire", Refusal.ALREADY_ARMED),
    "playing": ("", Refusal.BUSY),
    "safe": ("load levels enable", Refusal.SAFE_STATE),
}
"""What is legal in each state, and why the rest is not."""


STEPS: dict[str, Callable[[BurstDevice], object]] = {
    "load": lambda device: device.load(0, np.stack([BURST, SILENCE])),
    "levels": lambda device: device.set_levels([10.0, 10.0]),
    "enable": lambda device: device.enable(),
    "arm": lambda device: device.arm(2, 0, time_to_live_s=0.1),
    "fire": lambda device: device.fire(1),
}


def bring(rig: Rig, state: str) -> None:
    for name, prepare in READY.items():
        prepare(rig)
        if (name, state) == ("loaded", "playing"):
            load_long(rig, slot=0)
        if name == state or (state, name) == ("safe", "live"):
            break
    if state == "safe":
        rig.device.stop()


BAD_STEPS: list[tuple[Refusal, Callable[[BurstDevice], object]]] = [
    (Refusal.BAD_SLOT, lambda d: d.load(255, np.stack([BURST, SILENCE]))),
    (Refusal.WAVEFORM_EMPTY, lambda d: d.load(0, np.stack([BURST[:0], BURST[:0]]))),
    (Refusal.WAVEFORM_TOO_LONG, lambda d: d.load(0, np.stack([np.zeros(65537), np.zeros(65537)]))),
    (Refusal.WRONG_CHANNELS, lambda d: d.load(0, np.stack([BURST]))),
    (Refusal.WRONG_CHANNELS, lambda d: d.load(0, np.stack([BURST, SILENCE, SILENCE]))),
    (Refusal.WRONG_CHANNELS, lambda d: d.set_levels([10.0])),
    (Refusal.WRONG_CHANNELS, lambda d: d.set_levels([10.0, 10.0, 10.0])),
    (Refusal.OUT_OF_RANGE, lambda d: d.load(0, np.stack([SILENCE, changed(20, 1.01)]))),
    (Refusal.EDGES_NOT_ZERO, lambda d: d.load(0, np.stack([changed(0, 0.01), SILENCE]))),
    (Refusal.EDGES_NOT_ZERO, lambda d: d.load(0, np.stack([SILENCE, changed(-1, -0.01)]))),
    (Refusal.DC, lambda d: d.load(0, np.stack([np.abs(BURST), SILENCE]))),
    (Refusal.BAD_LEVEL, lambda d: d.set_levels([-1.0, 10.0])),
    (Refusal.BAD_LEVEL, lambda d: d.set_levels([10.0, float("nan")])),
    (Refusal.CEILING, lambda d: d.set_levels([200.001, 0.0])),
    (Refusal.CEILING, lambda d: d.set_levels([0.0, 200.001])),
    (Refusal.BAD_TOKEN, lambda d: d.arm(0, 0, time_to_live_s=0.1)),
    (Refusal.BAD_TOKEN, lambda d: d.arm(2**64, 0, time_to_live_s=0.1)),
    (Refusal.BAD_SLOT, lambda d: d.arm(9, -1, time_to_live_s=0.1)),
    (Refusal.EMPTY_SLOT, lambda d: d.arm(9, 7, time_to_live_s=0.1)),
    (Refusal.BAD_TIME_TO_LIVE, lambda d: d.arm(9, 0, time_to_live_s=0.0)),
    (Refusal.BAD_TIME_TO_LIVE, lambda d: d.arm(9, 0, time_to_live_s=10.1)),
    (Refusal.TOKEN_SPENT, lambda d: d.arm(1, 0, time_to_live_s=0.1)),
    (Refusal.NOT_ARMED, lambda d: d.fire(9)),
    (Refusal.BAD_TOKEN, lambda d: d.disarm(0)),
    (Refusal.BAD_TOKEN, lambda d: d.query(-1)),
]


def onset_us(felt: Delivery) -> int:
    assert felt.device_us is not None
    return felt.device_us


class DeviceContract:
    """The tests; a subclass lists the implementations they run on."""

    @staticmethod
    def implementations(config: pytest.Config) -> Rigs:
        """Return what makes each implementation, by name."""
        raise NotImplementedError

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        """Run every test on every implementation."""
        test = metafunc.function.__name__
        metafunc.parametrize(
            "implementation",
            [
                pytest.param(name, marks=pytest.mark.slow if (name, test) in SLOW else ())
                for name in self.implementations(metafunc.config)
            ],
        )

    @pytest.fixture
    def rig(self, implementation: str, request: pytest.FixtureRequest) -> Iterator[Rig]:
        made = self.implementations(request.config)[implementation](request)
        if isinstance(made.device, ConverterDevice):
            playing = WAITS if "playing" in request.node.name else None
            if reason := HOSTED.get(request.function.__name__, playing):
                pytest.skip(reason)
        request.node.stash[STOOD_STILL] = made.stood_still
        identity = made.device.open()
        longest = min(made.longest, identity.longest_waveform)
        yield replace(made, rate_hz=identity.sample_rate_hz, longest=longest)
        made.device.close()
        if isinstance(made.device, FreshTokens):
            longest_s = made.device.longest_load / identity.sample_rate_hz
            made.clock.wait(2.0 * longest_s + 0.1)

    @pytest.fixture
    def live(self, rig: Rig) -> Rig:
        """Live at 100 Vpp; slot 0 plays left, 1 right, 2 both, 3 nothing."""
        for slot, pair in enumerate([(1, 0), (0, 1), (1, 1), (0, 0)]):
            rig.device.load(slot, np.stack([each * BURST for each in pair]))
        rig.device.enable()
        rig.device.set_levels([100.0, 100.0])
        return rig

    @pytest.mark.parametrize(
        ("slot", "levels_vpp"), [(0, (100, 0)), (1, (0, 100)), (2, (100, 100)), (3, (0, 0))]
    )
    def test_a_burst_or_a_blank_comes_out_where_when_and_as_loud_as_it_was_asked_for(
        self, live: Rig, slot: int, levels_vpp: tuple[float, float]
    ) -> None:
        before_s = live.clock.now_s()
        felt = play(live, 1, slot)
        assert before_s <= felt.host_before_s <= felt.host_after_s <= live.clock.now_s()
        assert felt.uncertainty_s >= (felt.host_after_s - felt.host_before_s) / 2
        assert felt.outcome is Outcome.FIRED
        assert felt.levels_vpp == levels_vpp
        for emission in live.came_out(1):
            assert (felt.token, felt.device_us) == (emission.token, emission.start_us)
            for volts, level_vpp in zip(emission.volts, levels_vpp, strict=True):
                assert np.abs(volts - BURST * level_vpp / 2).max() < 0.01
                assert np.abs(volts).max() <= level_vpp / 2

    @pytest.mark.parametrize("state", STATES)
    @pytest.mark.parametrize("step", STEPS)
    def test_each_state_takes_its_own_steps_and_refuses_the_rest_with_its_reason(
        self, rig: Rig, implementation: str, state: str, step: str
    ) -> None:
        if implementation == "--device-url" and state in {"idle", "loaded"}:
            pytest.skip("a device comes into this state only when it is switched on")
        bring(rig, state)
        legal, reason = STATES[state]
        if step in legal.split():
            STEPS[step](rig.device)
        elif (state, step) != ("playing", "fire"):
            assert refusal(lambda: STEPS[step](rig.device)) is reason

    @pytest.mark.parametrize(("code", "call"), BAD_STEPS)
    def test_a_refused_step_says_why_and_changes_nothing(
        self, live: Rig, code: Refusal, call: Callable[[BurstDevice], object]
    ) -> None:
        first = play(live, 1)
        live.clock.wait(0.1)
        assert refusal(lambda: call(live.device)) is code
        assert live.device.query(1).device_us == first.device_us
        play(live, 2)
        for one, two in pairwise(live.came_out(1, 2)):
            assert np.array_equal(one.volts, two.volts)

    def test_the_ceiling_holds_for_the_product_of_peak_and_level_and_is_itself_played(
        self, live: Rig
    ) -> None:
        live.device.load(5, np.stack([0.5 * BURST, SILENCE]))
        live.device.set_levels([400.0, 200.0])
        assert refusal(lambda: play(live, 1), LimitExceeded) is Refusal.CEILING
        assert play(live, 1, slot=5).levels_vpp[0] == 400.0
        live.clock.wait(0.1)
        live.device.set_levels([200.0, 200.0])
        assert play(live, 2, slot=2).levels_vpp[1] == 200.0
        for half, whole in pairwise(live.came_out(1, 2)):
            assert np.ptp(half.volts[0]) <= 200.0 == np.ptp(whole.volts[1])

    def test_the_same_token_again_gives_the_same_record_and_no_other_burst(self, live: Rig) -> None:
        felt = play(live, 1)
        for wait_s in (0.0, 0.001, 0.5, live.idle_s):
            live.clock.wait(wait_s)
            again = live.device.fire(1)
            assert again.outcome is Outcome.FIRED
            assert (again.device_us, again.levels_vpp[0]) == (felt.device_us, felt.levels_vpp[0])
            live.device.disarm(1)
            assert live.device.query(1).device_us == felt.device_us
        assert play(live, 2).outcome is Outcome.FIRED  # however long its live host was idle
        live.came_out(1, 2)

    def test_a_late_fire_cannot_fire(self, live: Rig) -> None:
        live.device.arm(1, 0, time_to_live_s=0.2)
        live.clock.wait(0.21)
        for _ in range(2):
            assert refusal(lambda: live.device.fire(1)) is Refusal.EXPIRED
        assert live.device.query(1).outcome is Outcome.NOT_FIRED
        live.came_out()

    def test_an_armed_token_has_no_outcome_yet_and_no_other_fires_in_its_place(
        self, live: Rig
    ) -> None:
        live.device.arm(1, 0, time_to_live_s=live.time_to_live_s)
        assert live.device.query(1).outcome is Outcome.INDETERMINATE
        assert refusal(lambda: live.device.fire(2)) is Refusal.WRONG_TOKEN
        assert live.device.fire(1).outcome is Outcome.FIRED

    @pytest.mark.parametrize("armed_before", [True, False])
    def test_a_disarmed_token_is_not_fired_for_good(self, live: Rig, *, armed_before: bool) -> None:
        if armed_before:
            live.device.arm(1, 0, time_to_live_s=live.time_to_live_s)
        live.device.disarm(1)
        assert live.device.query(1).outcome is Outcome.NOT_FIRED
        refusal(lambda: live.device.fire(1))
        assert refusal(lambda: live.device.arm(1, 0, time_to_live_s=0.2)) is Refusal.TOKEN_SPENT
        live.came_out()

    def test_no_burst_is_armed_while_one_plays(self, live: Rig) -> None:
        load_long(live)
        play(live, 1, LONG)
        assert refusal(lambda: live.device.arm(2, 0, time_to_live_s=0.1)) is Refusal.BUSY

    @pytest.mark.parametrize(
        ("slot", "code"), [(SHORT, Refusal.LEAST_INTERVAL), (LONG, Refusal.DUTY)]
    )
    def test_a_burst_too_soon_is_refused_and_stays_armed(
        self, live: Rig, slot: int, code: Refusal
    ) -> None:
        load_long(live)
        live.device.load(SHORT, np.stack([BURST[::8], SILENCE[::8]]))
        short_s = BURST[::8].size / live.rate_hz
        rest_s, least_s = short_s + 0.001, short_s + 0.01
        if slot == LONG:
            rest_s, least_s = 1.3 * live.long_s, 2 * live.long_s
        first = play(live, 1, slot)
        live.clock.wait(max(0.0, first.host_after_s + rest_s - live.clock.now_s()))
        live.device.arm(2, slot, time_to_live_s=10.0)
        codes = []
        try:
            second = live.device.fire(2)
        except RefusedError as error:
            codes = [error.code]
            live.clock.wait(least_s - rest_s + 0.005)
            second = live.device.fire(2)
        assert codes == [code] or (live.in_real_time and not codes)
        assert second.outcome is Outcome.FIRED
        assert onset_us(second) - onset_us(first) >= (least_s - 1e-3) * 1e6

    def test_without_a_heartbeat_the_output_goes_to_zero_within_half_a_second(
        self, live: Rig
    ) -> None:
        load_long(live)
        play(live, 1, LONG)
        live.clock.wait(0.25)
        live.silence()
        live.clock.wait(0.75 if live.in_real_time else 0.5)
        for cut in live.came_out(1):
            assert cut.cut_us is not None
            after_s = (cut.cut_us - cut.start_us) * 1e-6
            assert 0.3 < after_s < live.long_s
            assert live.in_real_time or 0.5 < after_s <= 0.75 + 1e-4
            assert not cut.volts[0][math.ceil(after_s * live.rate_hz) :].any()
        with pytest.raises(Rejected, match="received nothing for 500 ms") as refused:
            live.device.arm(2, 0, time_to_live_s=0.1)
        assert refused.value.code is Refusal.WATCHDOG_STOP
        live.device.stop()  # hides no earlier reason
        assert refusal(lambda: live.device.arm(2, 0, time_to_live_s=0.1)) is Refusal.WATCHDOG_STOP

    def test_a_stop_cuts_the_burst_and_only_enable_undoes_it(self, live: Rig) -> None:
        load_long(live)
        play(live, 1, LONG)
        live.clock.wait(0.5)
        live.device.stop()
        for cut in live.came_out(1):
            assert cut.cut_us is not None
            after_s = (cut.cut_us - cut.start_us) * 1e-6
            assert 0.5 - 1e-3 < after_s < live.long_s
            assert live.in_real_time or after_s < 0.5 + 1e-3
            first_zero = math.ceil(after_s * live.rate_hz)
            assert not cut.volts[0][first_zero:].any()
            assert cut.volts[0][: first_zero - 10].any()
        assert refusal(lambda: live.device.arm(2, 0, time_to_live_s=0.1)) is Refusal.SAFE_STATE
        live.clock.wait(2.0 * live.long_s)
        live.device.enable()
        assert play(live, 2).outcome is Outcome.FIRED

    def test_an_over_current_switches_the_outputs_off_until_they_are_enabled(
        self, live: Rig
    ) -> None:
        if live.overload is None:
            pytest.skip("nothing reports an over-current here")
        live.device.arm(1, 0, time_to_live_s=live.time_to_live_s)
        live.overload()
        live.clock.wait(0.3)
        assert refusal(lambda: live.device.fire(1)) is Refusal.OVERLOAD_STOP
        assert live.device.query(1).outcome is Outcome.NOT_FIRED
        live.device.stop()  # hides no earlier reason
        assert refusal(lambda: live.device.arm(2, 0, time_to_live_s=0.1)) is Refusal.OVERLOAD_STOP
        live.device.enable()
        assert play(live, 2).outcome is Outcome.FIRED
        live.came_out(2)

    def test_a_line_that_is_cut_switches_the_outputs_off(self, live: Rig) -> None:
        if live.cut_line is None:
            pytest.skip("it has no line, or one that is to be pulled by hand")
        live.device.arm(1, 0, time_to_live_s=live.time_to_live_s)
        live.cut_line()
        live.clock.wait(0.2)
        live.device.open()
        live.device.load(0, np.stack([BURST, SILENCE]))
        assert refusal(lambda: live.device.arm(2, 0, time_to_live_s=0.1)) is Refusal.LINE_STOP
        assert live.device.query(1).outcome is Outcome.NOT_FIRED
        live.device.enable()
        assert play(live, 2).outcome is Outcome.FIRED
        live.came_out(2)

    def test_a_stop_aborts_what_is_armed(self, live: Rig) -> None:
        live.device.arm(1, 0, time_to_live_s=10.0)
        live.device.stop()
        assert refusal(lambda: live.device.fire(1)) is Refusal.SAFE_STATE
        assert live.device.query(1).outcome is Outcome.NOT_FIRED
        live.device.enable()
        assert refusal(lambda: live.device.fire(1)) is Refusal.ABORTED
        live.came_out()

    @pytest.mark.parametrize("state", STATES)
    def test_stops_are_welcome_in_every_state_any_number_of_times(
        self, rig: Rig, state: str
    ) -> None:
        bring(rig, state)
        for _ in range(2):
            rig.device.stop()
            rig.device.stop()
            rig.device.close()
        rig.device.open()
        assert refusal(lambda: rig.device.arm(5, 0, time_to_live_s=0.1)) is Refusal.SAFE_STATE
        rig.device.load(0, np.stack([BURST, SILENCE]))
        rig.device.enable()
        rig.clock.wait(2.0 * rig.long_s + 0.1 if state == "playing" else 0.1)
        assert play(rig, 5).outcome is Outcome.FIRED

    def test_a_device_says_what_it_is_ready_to_do_and_keeps_to_it(self, rig: Rig) -> None:
        if not isinstance(rig.device, HostDriver):
            pytest.skip("a driver of a lab's own, or a bare core, tells its limits to nobody")
        told = rig.device.limits()
        assert (told.slots >= 4, told.memory_samples >= 4 * BURST.size) == (True, True)
        assert 1 <= told.max_duty_ppm <= 500_000
        assert 1 <= told.dc_tolerance_ppm <= 10_000
        if told.slots <= 255:
            waveforms = np.stack([BURST, SILENCE])
            assert refusal(lambda: rig.device.load(told.slots, waveforms)) is Refusal.BAD_SLOT
        assert told == rig.device.limits()

    def test_the_amplifier_is_on_with_the_output_and_nothing_is_made_up_of_it(
        self, live: Rig
    ) -> None:
        if not isinstance(live.device, HostDriver):
            pytest.skip("a driver of a lab's own, or a bare core, is asked for no health")
        on = live.device.health()
        live.device.stop()
        off = live.device.health()
        assert (on.amplifier_enabled, off.amplifier_enabled) in {(True, False), (None, None)}
        assert on.switch_closed in {True, None}
        assert on.over_current in {False, None}

    def test_of_a_burst_that_never_was_nothing_was_measured(self, live: Rig) -> None:
        if not isinstance(live.device, HostDriver):
            pytest.skip("a driver of a lab's own, or a bare core, measures nothing")
        play(live, 1)
        live.clock.wait(0.1)
        assert live.device.measured(999) is None
        found = live.device.measured(1)
        assert found is None or found.tap in {"line", "amplifier", "current", "motion"}
