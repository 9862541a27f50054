"""One contract for every device: whatever passes these tests can stand behind a session.

Each test runs on every implementation that `IMPLEMENTATIONS` lists. The device's ceiling and the
study's are 200 Vpp, the least interval is 10 ms, the largest duty one half.
"""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count

import numpy as np
import pytest

from device.clock import Clock, VirtualClock
from device.core import DeviceCore
from device.counts import to_codes, to_microseconds, to_millivolts
from device.driver import (
    BurstDevice,
    Delivery,
    FloatArray,
    Identity,
    LimitExceeded,
    Outcome,
    Refusal,
    RefusedError,
)
from device.limits import Limits
from device.messages import Arm, Levels, Load
from device.mock import MockDevice
from device.output import Emission, OutputStage
from device.tokens import Exchange, Record, delivery

LIMITS = Limits(ceiling_vpp=200.0, least_interval_s=0.01, max_duty=0.5)
BEAT_US = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """An implementation with what a test needs around it."""

    device: BurstDevice
    clock: Clock
    silence: Callable[[], None]
    emitted: Callable[[], tuple[Emission, ...]]


class BareCore:
    """A core behind the protocol with nothing checked on the way."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._over: list[Emission] = []
        self._stopped = threading.Event()
        self._beat_us = 0
        self._beating = True
        self._core = DeviceCore(
            boot_id=1, limits=LIMITS, output=OutputStage(), sink=self._over.append
        )

    def silence(self) -> None:
        self._now_us()
        self._beating = False

    def emitted(self) -> tuple[Emission, ...]:
        self._now_us()
        playing = self._core.playing
        return (*self._over, playing) if playing else tuple(self._over)

    def _now_us(self) -> int:
        now_us = round(self._clock.now_s() * 1e6)
        while self._beating and self._beat_us + BEAT_US <= now_us:
            self._beat_us += BEAT_US
            self._core.beat(self._beat_us)
        if self._stopped.is_set():
            self._stopped.clear()
            self._core.stop(now_us)
        self._core.advance(now_us)
        return now_us

    def open(self) -> Identity:
        return Identity(
            model="core",
            serial_number="core",
            boot_id=1,
            protocol_version="1.0",
            sample_rate_hz=48_000.0,
            bits=16,
            channels=2,
            ceiling_vpp=LIMITS.ceiling_vpp,
            longest_waveform=LIMITS.longest_waveform,
            emulated=True,
        )

    def load(self, slot: int, left: FloatArray, right: FloatArray) -> None:
        codes = to_codes(left, 16), to_codes(right, 16)
        self._core.load(self._now_us(), Load(slot=slot, left=codes[0], right=codes[1]))

    def enable(self) -> None:
        self._core.enable(self._now_us())

    def set_levels(self, left_vpp: float, right_vpp: float) -> None:
        left_mvpp, right_mvpp = to_millivolts(left_vpp), to_millivolts(right_vpp)
        message = Levels(left_mvpp=left_mvpp, right_mvpp=right_mvpp)
        self._core.set_levels(self._now_us(), message)

    def arm(self, token: int, slot: int, *, time_to_live_s: float) -> None:
        time_to_live_us = to_microseconds(time_to_live_s)
        message = Arm(token=token, slot=slot, time_to_live_us=time_to_live_us)
        self._core.arm(self._now_us(), message)

    def fire(self, token: int) -> Delivery:
        return self._deliver(self._core.fire(self._now_us(), token))

    def disarm(self, token: int) -> None:
        self._core.disarm(self._now_us(), token)

    def query(self, token: int) -> Delivery:
        return self._deliver(self._core.query(self._now_us(), token))

    def stop(self) -> None:
        self._stopped.set()

    def close(self) -> None:
        self.stop()
        self._now_us()

    def _deliver(self, record: Record) -> Delivery:
        now_s = self._clock.now_s()
        return delivery(
            Exchange(
                record=record,
                boot_id=1,
                host_before_s=now_s,
                host_after_s=now_s,
                device_us=self._core.now_us,
                resolution_s=0.0,
                retries=0,
            )
        )


def core_rig() -> Rig:
    clock = VirtualClock()
    bare = BareCore(clock)
    return Rig(device=bare, clock=clock, silence=bare.silence, emitted=bare.emitted)


def mock_rig() -> Rig:
    clock = VirtualClock(start_s=3.0)
    mock = MockDevice(clock, limits=LIMITS, device_limits=LIMITS, drift_ppm=40.0, offset_s=17.0)
    return Rig(device=mock, clock=clock, silence=mock.silence, emitted=lambda: mock.emitted)


IMPLEMENTATIONS = {"core": core_rig, "mock": mock_rig}


@pytest.fixture(params=list(IMPLEMENTATIONS))
def rig(request: pytest.FixtureRequest) -> Rig:
    made = IMPLEMENTATIONS[request.param]()
    made.device.open()
    return made


BURST = np.sin(2 * np.pi * np.arange(97) / 96)
BURST[-1] = 0.0
LONG = np.tile(BURST[:-1], 500)
LONG = np.append(LONG, 0.0)
SILENCE = np.zeros_like(BURST)


@pytest.fixture
def live(rig: Rig) -> Rig:
    """Live at 100 Vpp; slot 0 plays left, 1 right, 2 both, 3 nothing, 4 a second of left."""
    for slot, pair in enumerate([(1, 0), (0, 1), (1, 1), (0, 0)]):
        rig.device.load(slot, pair[0] * BURST, pair[1] * BURST)
    rig.device.load(4, LONG, 0 * LONG)
    rig.device.enable()
    rig.device.set_levels(100.0, 100.0)
    return rig


def code_of(call: Callable[[], object]) -> Refusal:
    with pytest.raises(RefusedError) as refused:
        call()
    return refused.value.code


def play(rig: Rig, token: int, slot: int = 0) -> Delivery:
    rig.device.arm(token, slot, time_to_live_s=0.1)
    return rig.device.fire(token)


# --- the way of a trial


@pytest.mark.parametrize(("slot", "levels_vpp"), [(0, (100, 0)), (1, (0, 100)), (2, (100, 100))])
def test_a_burst_comes_out_where_and_as_loud_as_it_was_asked_for(
    live: Rig, slot: int, levels_vpp: tuple[float, float]
) -> None:
    felt = play(live, 1, slot)
    (emission,) = live.emitted()
    assert felt.outcome is Outcome.FIRED
    assert (felt.level_left_vpp, felt.level_right_vpp) == levels_vpp
    assert (felt.token, felt.device_us) == (emission.token, emission.start_us)
    for volts, level_vpp in zip((emission.left_v, emission.right_v), levels_vpp, strict=True):
        assert np.abs(volts - BURST * level_vpp / 2).max() < 0.01
        assert np.abs(volts).max() <= level_vpp / 2


def test_a_blank_is_fired_like_any_other_burst_and_emits_zeros(live: Rig) -> None:
    felt = play(live, 1, slot=3)
    (emission,) = live.emitted()
    assert (felt.outcome, felt.level_left_vpp, felt.level_right_vpp) == (Outcome.FIRED, 0, 0)
    assert not emission.left_v.any()
    assert not emission.right_v.any()


def test_the_host_interval_holds_the_onset(live: Rig) -> None:
    before_s = live.clock.now_s()
    felt = play(live, 1)
    assert before_s <= felt.host_before_s <= felt.host_after_s <= live.clock.now_s()
    assert felt.uncertainty_s >= (felt.host_after_s - felt.host_before_s) / 2


# --- states


READY: dict[str, Callable[[Rig], object]] = {
    "idle": lambda rig: None,
    "loaded": lambda rig: rig.device.load(0, BURST, SILENCE),
    "live": lambda rig: rig.device.enable(),
    "armed": lambda rig: rig.device.arm(1, 0, time_to_live_s=0.1),
    "playing": lambda rig: rig.device.fire(1),
}
LEGAL = {
    "idle": {"load", "levels"},
    "loaded": {"load", "levels", "enable"},
    "live": {"load", "levels", "enable", "arm"},
    "armed": {"fire"},
    "playing": set[str](),
    "safe": {"load", "levels", "enable"},
}
REASON = {
    "idle": Refusal.NOTHING_LOADED,
    "loaded": Refusal.NOT_ENABLED,
    "live": Refusal.NOT_ARMED,
    "armed": Refusal.ALREADY_ARMED,
    "playing": Refusal.BUSY,
    "safe": Refusal.SAFE_STATE,
}
STEPS: dict[str, Callable[[BurstDevice], object]] = {
    "load": lambda device: device.load(0, BURST, SILENCE),
    "levels": lambda device: device.set_levels(10.0, 10.0),
    "enable": lambda device: device.enable(),
    "arm": lambda device: device.arm(2, 0, time_to_live_s=0.1),
    "fire": lambda device: device.fire(1),
}


def bring(rig: Rig, state: str) -> None:
    for name, prepare in READY.items():
        prepare(rig)
        if name == state or (state, name) == ("safe", "live"):
            break
    if state == "safe":
        rig.device.stop()


@pytest.mark.parametrize("state", LEGAL)
@pytest.mark.parametrize("step", STEPS)
def test_each_state_takes_its_own_steps_and_refuses_the_rest_with_its_reason(
    rig: Rig, state: str, step: str
) -> None:
    bring(rig, state)
    if step in LEGAL[state]:
        STEPS[step](rig.device)
    elif (state, step) != ("playing", "fire"):
        assert code_of(lambda: STEPS[step](rig.device)) is REASON[state]


def test_after_its_burst_the_device_is_live_again(live: Rig) -> None:
    for token in (1, 2, 3):
        assert play(live, token).outcome is Outcome.FIRED
        live.clock.wait(0.1)
    assert [emission.token for emission in live.emitted()] == [1, 2, 3]


# --- refusals


def changed(index: int, value: float) -> FloatArray:
    samples = BURST.copy()
    samples[index] = value
    return samples


BAD_STEPS: list[tuple[Refusal, Callable[[BurstDevice], object]]] = [
    (Refusal.BAD_SLOT, lambda d: d.load(8, BURST, SILENCE)),
    (Refusal.WAVEFORM_EMPTY, lambda d: d.load(0, BURST[:0], BURST[:0])),
    (Refusal.WAVEFORM_TOO_LONG, lambda d: d.load(0, np.zeros(65537), np.zeros(65537))),
    (Refusal.LENGTHS_DIFFER, lambda d: d.load(0, BURST, SILENCE[1:])),
    (Refusal.OUT_OF_RANGE, lambda d: d.load(0, SILENCE, changed(20, 1.01))),
    (Refusal.EDGES_NOT_ZERO, lambda d: d.load(0, changed(0, 0.01), SILENCE)),
    (Refusal.EDGES_NOT_ZERO, lambda d: d.load(0, SILENCE, changed(-1, -0.01))),
    (Refusal.DC, lambda d: d.load(0, np.abs(BURST), SILENCE)),
    (Refusal.BAD_LEVEL, lambda d: d.set_levels(-1.0, 10.0)),
    (Refusal.BAD_LEVEL, lambda d: d.set_levels(10.0, float("nan"))),
    (Refusal.CEILING, lambda d: d.set_levels(200.001, 0.0)),
    (Refusal.CEILING, lambda d: d.set_levels(0.0, 200.001)),
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


@pytest.mark.parametrize(("code", "call"), BAD_STEPS)
def test_a_refused_step_says_why_and_changes_nothing(
    live: Rig, code: Refusal, call: Callable[[BurstDevice], object]
) -> None:
    first = play(live, 1)
    live.clock.wait(0.1)
    assert code_of(lambda: call(live.device)) is code
    assert live.device.query(1).device_us == first.device_us
    play(live, 2)
    one, two = live.emitted()
    assert np.array_equal(one.left_v, two.left_v)
    assert np.array_equal(one.right_v, two.right_v)


def test_the_ceiling_holds_for_the_product_of_peak_and_level(live: Rig) -> None:
    live.device.load(5, 0.5 * BURST, SILENCE)
    live.device.set_levels(400.0, 200.0)
    with pytest.raises(LimitExceeded) as refused:
        live.device.arm(1, 0, time_to_live_s=0.1)
    assert refused.value.code is Refusal.CEILING
    assert play(live, 1, slot=5).level_left_vpp == 400.0
    assert np.ptp(live.emitted()[0].left_v) <= 200.0


def test_the_ceiling_itself_is_played(live: Rig) -> None:
    live.device.set_levels(200.0, 200.0)
    play(live, 1, slot=2)
    assert np.ptp(live.emitted()[0].right_v) == 200.0


# --- exactly once


def test_the_same_token_again_gives_the_same_record_and_no_other_burst(live: Rig) -> None:
    felt = play(live, 1)
    for wait_s in (0.0, 0.001, 0.5, 5.0):
        live.clock.wait(wait_s)
        again = live.device.fire(1)
        assert again.outcome is Outcome.FIRED
        assert (again.device_us, again.level_left_vpp) == (felt.device_us, felt.level_left_vpp)
        assert live.device.query(1).device_us == felt.device_us
    assert len(live.emitted()) == 1


def test_a_late_fire_cannot_fire(live: Rig) -> None:
    live.device.arm(1, 0, time_to_live_s=0.2)
    live.clock.wait(0.21)
    for _ in range(2):
        assert code_of(lambda: live.device.fire(1)) is Refusal.EXPIRED
    assert live.device.query(1).outcome is Outcome.NOT_FIRED
    assert live.emitted() == ()


def test_an_armed_token_has_no_outcome_yet(live: Rig) -> None:
    live.device.arm(1, 0, time_to_live_s=0.2)
    assert live.device.query(1).outcome is Outcome.INDETERMINATE
    assert live.device.fire(1).outcome is Outcome.FIRED


@pytest.mark.parametrize("armed_before", [True, False])
def test_a_disarmed_token_is_not_fired_for_good(live: Rig, *, armed_before: bool) -> None:
    if armed_before:
        live.device.arm(1, 0, time_to_live_s=0.2)
    live.device.disarm(1)
    assert live.device.query(1).outcome is Outcome.NOT_FIRED
    with pytest.raises(RefusedError):
        live.device.fire(1)
    assert code_of(lambda: live.device.arm(1, 0, time_to_live_s=0.2)) is Refusal.TOKEN_SPENT
    assert live.emitted() == ()


def test_disarming_a_fired_token_leaves_its_record(live: Rig) -> None:
    felt = play(live, 1)
    live.device.disarm(1)
    assert live.device.query(1).device_us == felt.device_us


def test_another_token_than_the_armed_one_does_not_fire(live: Rig) -> None:
    live.device.arm(1, 0, time_to_live_s=0.2)
    assert code_of(lambda: live.device.fire(2)) is Refusal.WRONG_TOKEN
    assert live.device.fire(1).outcome is Outcome.FIRED


# --- rests


def test_no_burst_is_armed_while_one_plays(live: Rig) -> None:
    play(live, 1)
    assert code_of(lambda: live.device.arm(2, 0, time_to_live_s=0.1)) is Refusal.BUSY


@pytest.mark.parametrize(
    ("slot", "wait_s", "code"), [(0, 0.005, Refusal.LEAST_INTERVAL), (4, 1.5, Refusal.DUTY)]
)
def test_a_burst_too_soon_is_refused_and_stays_armed(
    live: Rig, slot: int, wait_s: float, code: Refusal
) -> None:
    play(live, 1, slot)
    live.clock.wait(wait_s)
    live.device.arm(2, 0, time_to_live_s=2.0)
    assert code_of(lambda: live.device.fire(2)) is code
    live.clock.wait(wait_s + 0.01)
    assert live.device.fire(2).outcome is Outcome.FIRED


# --- safety


def test_a_live_host_may_be_idle_for_as_long_as_it_likes(live: Rig) -> None:
    live.clock.wait(3600.0)
    assert play(live, 1).outcome is Outcome.FIRED


def test_without_a_heartbeat_the_output_goes_to_zero_within_half_a_second(live: Rig) -> None:
    play(live, 1, slot=4)
    live.clock.wait(0.25)
    live.silence()
    live.clock.wait(0.5)
    (cut,) = live.emitted()
    assert cut.cut_us is not None
    assert 0.5 < (cut.cut_us - cut.start_us) * 1e-6 <= 0.75 + 1e-4
    assert not cut.left_v[36_010:].any()
    assert code_of(lambda: live.device.arm(2, 0, time_to_live_s=0.1)) is Refusal.SAFE_STATE


def test_a_stop_cuts_the_burst_and_only_enable_undoes_it(live: Rig) -> None:
    play(live, 1, slot=4)
    live.clock.wait(0.5)
    live.device.stop()
    (cut,) = live.emitted()
    assert not cut.left_v[24_010:].any()
    assert cut.left_v[:23_990].any()
    assert code_of(lambda: live.device.arm(2, 0, time_to_live_s=0.1)) is Refusal.SAFE_STATE
    live.clock.wait(2.0)
    live.device.enable()
    assert play(live, 2).outcome is Outcome.FIRED


def test_a_stop_aborts_what_is_armed(live: Rig) -> None:
    live.device.arm(1, 0, time_to_live_s=10.0)
    live.device.stop()
    assert code_of(lambda: live.device.fire(1)) is Refusal.SAFE_STATE
    assert live.device.query(1).outcome is Outcome.NOT_FIRED
    live.device.enable()
    assert code_of(lambda: live.device.fire(1)) is Refusal.ABORTED
    assert live.emitted() == ()


@pytest.mark.parametrize("state", LEGAL)
def test_stops_are_welcome_in_every_state_any_number_of_times(rig: Rig, state: str) -> None:
    bring(rig, state)
    for _ in range(2):
        rig.device.stop()
        rig.device.stop()
        rig.device.close()
    rig.device.open()
    assert code_of(lambda: rig.device.arm(5, 0, time_to_live_s=0.1)) is Refusal.SAFE_STATE
    rig.device.load(0, BURST, SILENCE)
    rig.device.enable()
    rig.clock.wait(0.1)
    assert play(rig, 5).outcome is Outcome.FIRED


def play_until_refused(rig: Rig, tokens: Iterator[int]) -> None:
    for token in tokens:
        play(rig, token)
        rig.clock.wait(0.1)


def test_a_stop_from_other_threads_is_never_lost(live: Rig) -> None:
    tokens = count(1)
    for _ in range(20):
        threads = [threading.Thread(target=live.device.stop) for _ in range(4)]
        for thread in threads:
            thread.start()
        with pytest.raises(RefusedError):
            play_until_refused(live, tokens)
        for thread in threads:
            thread.join()
        live.device.enable()
        live.clock.wait(0.1)
