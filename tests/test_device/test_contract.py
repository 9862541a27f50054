"""One contract for every device: whatever passes these tests can stand behind a session.

Each test runs on every implementation that `IMPLEMENTATIONS` lists, with ``--device-command`` on
what a command starts, such as firmware, with ``--device-url`` on real hardware, and with ``--driver
NAME --port P`` on an installed driver of a lab's own. Of the last two nobody can read the bursts:
there the device's own answers stand for them. The device's ceiling and the study's are 200 Vpp, the
least interval is 10 ms, the largest duty a half. Where time is real, no test waits for more than a
few seconds, and what has to happen in time has seconds to happen.
"""

import base64
import json
import math
import shlex
import subprocess
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import count, pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pytest

from device.clock import Clock, MonotonicClock, VirtualClock
from device.core.converter import ConverterDevice, converter_device
from device.core.core import DeviceCore
from device.core.host import HostDriver
from device.core.local import LocalCore
from device.core.messages import (
    Arm,
    Disarm,
    Enable,
    Fire,
    Levels,
    LoadSlot,
    Ping,
    Query,
    to_codes,
    to_microseconds,
    to_millivolts,
)
from device.core.output import Emission, OutputStage
from device.core.states import State
from device.core.tokens import delivery
from device.driver import BurstDevice, Delivery, FloatArray, Identity, Outcome
from device.drivers import DriverSettings, make_device
from device.emulate.generator import EmulatedGenerator
from device.emulate.mock import MockDevice
from device.errors import LimitExceeded, Refusal, RefusedError
from device.scpi.generator import GeneratorDevice
from device.sound.audio import AudioDevice
from device.wire.channels import open_channel
from device.wire.link import FrameLink
from tests.test_device import bursts
from tests.test_device.bursts import BURST, SILENCE, changed, refusal
from tests.test_device.in_process import (
    LIMITS,
    LocalChannel,
    SoundCard,
    audio_on,
    generator_on,
)

Emulate: TypeAlias = Callable[..., tuple[str, Path, int]]
Emitted: TypeAlias = Callable[[], tuple[Emission, ...]]

CHANNELS = ("left_v", "right_v")


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """An implementation with what a test needs around it."""

    device: BurstDevice
    clock: Clock
    silence: Callable[[], None]
    emitted: Emitted | None
    rate_hz: float = 48_000.0
    longest: int = 65_536
    in_real_time: bool = False
    long_s: float = 1.0
    """Duration of a long burst."""
    idle_s: float = 3600.0
    """As long as a host may be idle: where it can be waited for, an hour."""
    time_to_live_s: float = 0.1
    """Long enough for any machine to fire within."""

    def came_out(self, *tokens: int) -> tuple[Emission, ...]:
        """Return all bursts, which are those of `tokens`; nothing where they cannot be read."""
        if self.emitted is None:
            outcomes = [self.device.query(token).outcome for token in tokens]
            assert outcomes == [Outcome.FIRED] * len(tokens)
            return ()
        emissions = self.emitted()
        assert [emission.token for emission in emissions] == list(tokens)
        return emissions if all(emission.left_v.size for emission in emissions) else ()


class BareCore(LocalCore):
    """A core behind the protocol with nothing checked on the way."""

    cannot = ()

    def __init__(self, clock: Clock) -> None:
        self._over: list[Emission] = []
        sink = self._over.append
        super().__init__(
            DeviceCore(boot_id=1, limits=LIMITS, output=OutputStage(), sink=sink), clock
        )

    def silence(self) -> None:
        self._attend()
        self._heart_beats = False

    def emitted(self) -> tuple[Emission, ...]:
        self._attend()
        return (*self._over, *filter(None, [self._core.playing]))

    def open(self) -> Identity:
        return bursts.identity()

    def load(self, slot: int, left: FloatArray, right: FloatArray) -> None:
        self.exchange(LoadSlot(slot=slot, left=to_codes(left, 16), right=to_codes(right, 16)))

    def enable(self) -> None:
        self.exchange(Enable())

    def set_levels(self, left_vpp: float, right_vpp: float) -> None:
        left_mvpp, right_mvpp = to_millivolts(left_vpp), to_millivolts(right_vpp)
        self.exchange(Levels(left_mvpp=left_mvpp, right_mvpp=right_mvpp))

    def arm(self, token: int, slot: int, *, time_to_live_s: float) -> None:
        self.exchange(Arm(token=token, slot=slot, time_to_live_us=to_microseconds(time_to_live_s)))

    def fire(self, token: int) -> Delivery:
        return delivery(self.exchange(Fire(token=token)))

    def disarm(self, token: int) -> None:
        self.exchange(Disarm(token=token))

    def query(self, token: int) -> Delivery:
        return delivery(self.exchange(Query(token=token)))

    def close(self) -> None:
        self.stop()
        self._attend()


def core_rig(_: pytest.FixtureRequest) -> Rig:
    clock = VirtualClock()
    bare = BareCore(clock)
    return Rig(device=bare, clock=clock, silence=bare.silence, emitted=bare.emitted)


def mock_rig(_: pytest.FixtureRequest) -> Rig:
    clock = VirtualClock(start_s=3.0)
    little = replace(LIMITS, memory_samples=100_000)
    mock = MockDevice(clock, limits=LIMITS, device_limits=little, drift_ppm=40.0, offset_s=17.0)
    return Rig(device=mock, clock=clock, silence=mock.silence, emitted=lambda: mock.emitted)


def link_to(port: str) -> FrameLink:
    clock = MonotonicClock()
    return FrameLink(lambda: open_channel(port, clock), clock)


def real_rig(device: BurstDevice, link: FrameLink, emitted: Emitted | None) -> Rig:
    """Return a rig around a device whose time is real."""

    def silence() -> None:
        assert link._heart is not None
        link._heart.end()

    return Rig(
        device=device,
        clock=MonotonicClock(),
        silence=silence,
        emitted=emitted,
        in_real_time=True,
        long_s=1.2,
        idle_s=1.2,
        time_to_live_s=5.0,
    )


def read_truth(truth: Path) -> tuple[Emission, ...]:
    """Return the bursts of a truth file, cut where they were cut."""
    events = [json.loads(line) for line in truth.read_text(encoding="utf-8").splitlines()]
    cuts_us = {e["token"]: round(e["t_s"] * 1e6) for e in events if e["event"] == "cut"}
    bursts = (emission_of(event) for event in events if event["event"] == "burst")
    return tuple(
        burst.cut(cuts_us[burst.token]) if burst.token in cuts_us else burst for burst in bursts
    )


def emission_of(event: dict[str, Any]) -> Emission:
    """Return a burst of a truth file, of no samples where it does not tell them."""
    samples = base64.b64decode(event.get("volts", ""))
    left_v, right_v = np.frombuffer(samples, dtype="<f8").reshape(2, -1)
    return Emission(
        token=event["token"],
        start_us=round(event["t_s"] * 1e6),
        left_v=left_v,
        right_v=right_v,
        level_left_vpp=event["levels_mv"][0] / 1000,
        level_right_vpp=event["levels_mv"][1] / 1000,
        sample_rate_hz=EMULATED_RATE_HZ,
    )


def emulator_rig(kind: str) -> Callable[[pytest.FixtureRequest], Rig]:
    def make(request: pytest.FixtureRequest) -> Rig:
        emulate: Emulate = request.getfixturevalue("emulate")
        port, truth, _ = emulate(
            kind, volts=True, sample_rate_hz=EMULATED_RATE_HZ, least_interval_s=0.01
        )
        return process_rig(port, truth)

    return make


def process_rig(port: str, truth: Path) -> Rig:
    """Return a rig around a device that writes down what it emits."""
    link = link_to(port)

    def emitted() -> tuple[Emission, ...]:
        if link.state is not State.CLOSED:
            link.exchange(Ping())
        return read_truth(truth)

    return real_rig(HostDriver(link, limits=LIMITS, clock=MonotonicClock()), link, emitted)


def command_rig(command: str) -> Callable[[pytest.FixtureRequest], Rig]:
    """Return what starts a command, which ends with the test, and a rig around its device."""

    def make(request: pytest.FixtureRequest) -> Rig:
        truth: Path = request.getfixturevalue("tmp_path") / "truth.jsonl"
        words = shlex.split(command.format(port=0, truth=truth, rate=round(EMULATED_RATE_HZ)))
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)

        def end() -> None:
            process.kill()
            process.communicate()

        request.addfinalizer(end)
        assert process.stdout is not None
        port = process.stdout.readline().strip()
        assert port, f"the first line of {words[0]} must be its port or URL"
        return process_rig(port, truth)

    return make


class FreshTokens(HostDriver):
    """A driver whose tokens 1, 2, ... are ones that its device never saw."""

    def __init__(self, link: FrameLink) -> None:
        super().__init__(link, limits=LIMITS, clock=MonotonicClock())
        self._base = round(MonotonicClock().now_s() * 1e6) * 1000
        self.longest_load = 0

    def load(self, slot: int, left: FloatArray, right: FloatArray) -> None:
        super().load(slot, left, right)
        self.longest_load = max(self.longest_load, len(left))

    def arm(self, token: int, slot: int, *, time_to_live_s: float) -> None:
        super().arm(self._fresh(token), slot, time_to_live_s=time_to_live_s)

    def fire(self, token: int) -> Delivery:
        return self._plain(super().fire(self._fresh(token)))

    def disarm(self, token: int) -> None:
        super().disarm(self._fresh(token))

    def query(self, token: int) -> Delivery:
        return self._plain(super().query(self._fresh(token)))

    def _fresh(self, token: int) -> int:
        return token + self._base if 0 < token < 1000 else token

    def _plain(self, told: Delivery) -> Delivery:
        return replace(told, token=told.token - self._base)


HARDWARE = "--device-url"


def hardware_rig(request: pytest.FixtureRequest) -> Rig:
    link = link_to(request.config.getoption(HARDWARE))
    return real_rig(FreshTokens(link), link, None)


def generator_rig(_: pytest.FixtureRequest) -> Rig:
    clock = VirtualClock(start_s=3.0)
    over: list[Emission] = []
    generator = EmulatedGenerator(over.append)
    device = generator_on(LocalChannel(generator, clock), clock, gain=1 / GENERATOR_LEVEL)
    return Rig(
        device=device,
        clock=clock,
        silence=lambda: None,
        emitted=lambda: tuple(at_actuator(burst) for burst in over),
    )


GENERATOR_LEVEL = 1 / 32
"""Volts of the generator per volt at the actuator: exact in binary, so that volts are too."""


def at_actuator(burst: Emission) -> Emission:
    left_v, right_v = burst.left_v / GENERATOR_LEVEL, burst.right_v / GENERATOR_LEVEL
    return replace(burst, left_v=left_v, right_v=right_v)


def audio_rig(_: pytest.FixtureRequest) -> Rig:
    card = SoundCard(start_s=3.0)
    card.buffer, card.latency = 48, 0.005
    return Rig(device=audio_on(card), clock=card, silence=lambda: None, emitted=None)


class Recorder:
    """A converter that takes as long as its burst."""

    name, serial_number, bits, emulated = "recorder", "1", 16, True
    sample_rate_hz, full_scale_v = 48_000.0, 150.0
    cannot: tuple[str, ...] = ()

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    def connect(self) -> None: ...

    def play(self, left_v: FloatArray, right_v: FloatArray) -> Outcome:
        self._clock.wait(len(left_v) / self.sample_rate_hz)
        return Outcome.FIRED

    def zero(self) -> None: ...

    def disconnect(self) -> None: ...


def converter_rig(_: pytest.FixtureRequest) -> Rig:
    clock = VirtualClock(start_s=3.0)
    device = converter_device(Recorder(clock), limits=LIMITS, clock=clock)
    return Rig(device=device, clock=clock, silence=lambda: None, emitted=None)


BY_HAND = (
    "a driver's own heartbeat is not cut from here: pull its cable, and see the output go to zero"
)


def own_rig(request: pytest.FixtureRequest) -> Rig:
    clock = MonotonicClock()
    settings = DriverSettings(
        limits=LIMITS, port=request.config.getoption("--port"),
        amplifier_gain=20.0, volts_full_scale=150.0,
    )  # fmt: skip
    return Rig(
        device=make_device(request.config.getoption("--driver"), settings, clock),
        clock=clock,
        silence=lambda: pytest.skip(BY_HAND),
        emitted=None,
        in_real_time=True,
        long_s=1.2,
        idle_s=1.2,
        time_to_live_s=5.0,
    )


EMULATED_RATE_HZ = 4000.0
"""Low, so that a long burst has few samples to upload."""

IMPLEMENTATIONS = {
    "core": core_rig,
    "mock": mock_rig,
    "pty": emulator_rig("pty"),
    "tcp": emulator_rig("tcp"),
    "generator": generator_rig,
    "audio": audio_rig,
    "converter": converter_rig,
}
OTHERS = {HARDWARE: hardware_rig, "--driver": own_rig}
"""What runs where the command line has it."""


def commanded(config: pytest.Config) -> dict[str, Callable[[pytest.FixtureRequest], Rig]]:
    """Return the implementations that the command line starts, by name."""
    given = (one.partition("=") for one in config.getoption("--device-command"))
    return {name: command_rig(command) for name, _, command in given}


LANES = {"pty": pytest.mark.process, "tcp": pytest.mark.process}
SLOW = {("audio", "test_the_same_token_again_gives_the_same_record_and_no_other_burst")}
"""Each sample of an hour is played."""
WAITS = "fire returns when the burst is over: it is not known earlier that it came out"
HOSTED = {
    "test_no_burst_is_armed_while_one_plays": WAITS,
    "test_a_stop_cuts_the_burst_and_only_enable_undoes_it": WAITS,
    "test_without_a_heartbeat_the_output_goes_to_zero_within_half_a_second": "it has no watchdog "
    "of its own: the driver says so before a session",
}
"""Which part of the contract a device whose core is in the host cannot keep, and why."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run every test of this file on every implementation."""
    if "implementation" in metafunc.fixturenames:
        names = [*IMPLEMENTATIONS, *commanded(metafunc.config)]
        names += [option for option in OTHERS if metafunc.config.getoption(option)]
        test = metafunc.function.__name__
        slow = {name: pytest.mark.slow for name in names if (name, test) in SLOW}
        lanes = {name: (LANES | slow).get(name, ()) for name in names}
        metafunc.parametrize(
            "implementation", [pytest.param(name, marks=lanes[name]) for name in names]
        )


@pytest.fixture
def rig(implementation: str, request: pytest.FixtureRequest) -> Iterator[Rig]:
    every = IMPLEMENTATIONS | OTHERS | commanded(request.config)
    made = every[implementation](request)
    if isinstance(made.device, GeneratorDevice | AudioDevice | ConverterDevice):
        playing = WAITS if "playing" in request.node.name else None
        if reason := HOSTED.get(request.function.__name__, playing):
            pytest.skip(reason)
    identity = made.device.open()
    longest = min(made.longest, identity.longest_waveform)
    yield replace(made, rate_hz=identity.sample_rate_hz, longest=longest)
    made.device.close()
    if isinstance(made.device, FreshTokens):
        longest_s = made.device.longest_load / identity.sample_rate_hz
        made.clock.wait(2.0 * longest_s + 0.1)


LONG, SHORT = 4, 5
"""Slots of a long and a short burst."""


def load_long(rig: Rig, slot: int = LONG) -> None:
    """Load a burst that is long enough to do something while it plays: to the left."""
    n_periods = round(rig.long_s * rig.rate_hz / 96)
    if n_periods * 96 + 1 > rig.longest:
        pytest.skip("the device holds no burst that is long enough")
    samples = np.append(np.tile(BURST[:-1], n_periods), 0.0)
    rig.device.load(slot, samples, 0 * samples)


@pytest.fixture
def live(rig: Rig) -> Rig:
    """Live at 100 Vpp; slot 0 plays left, 1 right, 2 both, 3 nothing."""
    for slot, pair in enumerate([(1, 0), (0, 1), (1, 1), (0, 0)]):
        rig.device.load(slot, pair[0] * BURST, pair[1] * BURST)
    rig.device.enable()
    rig.device.set_levels(100.0, 100.0)
    return rig


def play(rig: Rig, token: int, slot: int = 0) -> Delivery:
    return bursts.play(rig.device, token, slot, within_s=rig.time_to_live_s)


@pytest.mark.parametrize(
    ("slot", "levels_vpp"), [(0, (100, 0)), (1, (0, 100)), (2, (100, 100)), (3, (0, 0))]
)
def test_a_burst_or_a_blank_comes_out_where_when_and_as_loud_as_it_was_asked_for(
    live: Rig, slot: int, levels_vpp: tuple[float, float]
) -> None:
    before_s = live.clock.now_s()
    felt = play(live, 1, slot)
    assert before_s <= felt.host_before_s <= felt.host_after_s <= live.clock.now_s()
    assert felt.uncertainty_s >= (felt.host_after_s - felt.host_before_s) / 2
    assert felt.outcome is Outcome.FIRED
    assert (felt.level_left_vpp, felt.level_right_vpp) == levels_vpp
    for emission in live.came_out(1):
        assert (felt.token, felt.device_us) == (emission.token, emission.start_us)
        for volts, level_vpp in zip((emission.left_v, emission.right_v), levels_vpp, strict=True):
            assert np.abs(volts - BURST * level_vpp / 2).max() < 0.01
            assert np.abs(volts).max() <= level_vpp / 2


READY: dict[str, Callable[[Rig], object]] = {
    "idle": lambda rig: None,
    "loaded": lambda rig: rig.device.load(0, BURST, SILENCE),
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
    "load": lambda device: device.load(0, BURST, SILENCE),
    "levels": lambda device: device.set_levels(10.0, 10.0),
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


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("step", STEPS)
def test_each_state_takes_its_own_steps_and_refuses_the_rest_with_its_reason(
    rig: Rig, implementation: str, state: str, step: str
) -> None:
    if implementation == HARDWARE and state in {"idle", "loaded"}:
        pytest.skip("a device comes into this state only when it is switched on")
    bring(rig, state)
    legal, reason = STATES[state]
    if step in legal.split():
        STEPS[step](rig.device)
    elif (state, step) != ("playing", "fire"):
        assert refusal(lambda: STEPS[step](rig.device)) is reason


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
    assert refusal(lambda: call(live.device)) is code
    assert live.device.query(1).device_us == first.device_us
    play(live, 2)
    for one, two in pairwise(live.came_out(1, 2)):
        assert all(np.array_equal(getattr(one, side), getattr(two, side)) for side in CHANNELS)


def test_the_ceiling_holds_for_the_product_of_peak_and_level_and_is_itself_played(
    live: Rig,
) -> None:
    live.device.load(5, 0.5 * BURST, SILENCE)
    live.device.set_levels(400.0, 200.0)
    assert refusal(lambda: play(live, 1), LimitExceeded) is Refusal.CEILING
    assert play(live, 1, slot=5).level_left_vpp == 400.0
    live.clock.wait(0.1)
    live.device.set_levels(200.0, 200.0)
    assert play(live, 2, slot=2).level_right_vpp == 200.0
    for half, whole in pairwise(live.came_out(1, 2)):
        assert np.ptp(half.left_v) <= 200.0 == np.ptp(whole.right_v)


def test_the_same_token_again_gives_the_same_record_and_no_other_burst(live: Rig) -> None:
    felt = play(live, 1)
    for wait_s in (0.0, 0.001, 0.5, live.idle_s):
        live.clock.wait(wait_s)
        again = live.device.fire(1)
        assert again.outcome is Outcome.FIRED
        assert (again.device_us, again.level_left_vpp) == (felt.device_us, felt.level_left_vpp)
        live.device.disarm(1)
        assert live.device.query(1).device_us == felt.device_us
    assert play(live, 2).outcome is Outcome.FIRED  # however long its live host was idle
    live.came_out(1, 2)


def test_a_late_fire_cannot_fire(live: Rig) -> None:
    live.device.arm(1, 0, time_to_live_s=0.2)
    live.clock.wait(0.21)
    for _ in range(2):
        assert refusal(lambda: live.device.fire(1)) is Refusal.EXPIRED
    assert live.device.query(1).outcome is Outcome.NOT_FIRED
    live.came_out()


def test_an_armed_token_has_no_outcome_yet_and_no_other_fires_in_its_place(live: Rig) -> None:
    live.device.arm(1, 0, time_to_live_s=live.time_to_live_s)
    assert live.device.query(1).outcome is Outcome.INDETERMINATE
    assert refusal(lambda: live.device.fire(2)) is Refusal.WRONG_TOKEN
    assert live.device.fire(1).outcome is Outcome.FIRED


@pytest.mark.parametrize("armed_before", [True, False])
def test_a_disarmed_token_is_not_fired_for_good(live: Rig, *, armed_before: bool) -> None:
    if armed_before:
        live.device.arm(1, 0, time_to_live_s=live.time_to_live_s)
    live.device.disarm(1)
    assert live.device.query(1).outcome is Outcome.NOT_FIRED
    refusal(lambda: live.device.fire(1))
    assert refusal(lambda: live.device.arm(1, 0, time_to_live_s=0.2)) is Refusal.TOKEN_SPENT
    live.came_out()


def test_no_burst_is_armed_while_one_plays(live: Rig) -> None:
    load_long(live)
    play(live, 1, LONG)
    assert refusal(lambda: live.device.arm(2, 0, time_to_live_s=0.1)) is Refusal.BUSY


@pytest.mark.parametrize(("slot", "code"), [(SHORT, Refusal.LEAST_INTERVAL), (LONG, Refusal.DUTY)])
def test_a_burst_too_soon_is_refused_and_stays_armed(live: Rig, slot: int, code: Refusal) -> None:
    load_long(live)
    live.device.load(SHORT, BURST[::8], SILENCE[::8])
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


def onset_us(felt: Delivery) -> int:
    assert felt.device_us is not None
    return felt.device_us


def test_without_a_heartbeat_the_output_goes_to_zero_within_half_a_second(live: Rig) -> None:
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
        assert not cut.left_v[math.ceil(after_s * live.rate_hz) :].any()
    assert refusal(lambda: live.device.arm(2, 0, time_to_live_s=0.1)) is Refusal.SAFE_STATE


def test_a_stop_cuts_the_burst_and_only_enable_undoes_it(live: Rig) -> None:
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
        assert not cut.left_v[first_zero:].any()
        assert cut.left_v[: first_zero - 10].any()
    assert refusal(lambda: live.device.arm(2, 0, time_to_live_s=0.1)) is Refusal.SAFE_STATE
    live.clock.wait(2.0 * live.long_s)
    live.device.enable()
    assert play(live, 2).outcome is Outcome.FIRED


def test_a_stop_aborts_what_is_armed(live: Rig) -> None:
    live.device.arm(1, 0, time_to_live_s=10.0)
    live.device.stop()
    assert refusal(lambda: live.device.fire(1)) is Refusal.SAFE_STATE
    assert live.device.query(1).outcome is Outcome.NOT_FIRED
    live.device.enable()
    assert refusal(lambda: live.device.fire(1)) is Refusal.ABORTED
    live.came_out()


@pytest.mark.parametrize("state", STATES)
def test_stops_are_welcome_in_every_state_any_number_of_times(rig: Rig, state: str) -> None:
    bring(rig, state)
    for _ in range(2):
        rig.device.stop()
        rig.device.stop()
        rig.device.close()
    rig.device.open()
    assert refusal(lambda: rig.device.arm(5, 0, time_to_live_s=0.1)) is Refusal.SAFE_STATE
    rig.device.load(0, BURST, SILENCE)
    rig.device.enable()
    rig.clock.wait(2.0 * rig.long_s + 0.1 if state == "playing" else 0.1)
    assert play(rig, 5).outcome is Outcome.FIRED


@pytest.mark.slow
def test_a_stop_from_other_threads_is_never_lost(live: Rig) -> None:
    tokens = count(1)

    def play_on() -> None:
        for token in tokens:
            play(live, token)
            live.clock.wait(0.1)

    for _ in range(20):
        threads = [threading.Thread(target=live.device.stop) for _ in range(4)]
        for thread in threads:
            thread.start()
        refusal(play_on)
        for thread in threads:
            thread.join()
        live.device.enable()
        live.clock.wait(0.1)


def test_a_device_says_what_it_is_ready_to_do_and_keeps_to_it(rig: Rig) -> None:
    if not isinstance(rig.device, HostDriver):
        pytest.skip("a driver of a lab's own, or a bare core, tells its limits to nobody")
    told = rig.device.limits()
    assert (told.slots >= 4, told.memory_samples >= 4 * BURST.size) == (True, True)
    assert 1 <= told.max_duty_ppm <= 500_000
    assert 1 <= told.dc_tolerance_ppm <= 10_000
    if told.slots <= 255:
        assert refusal(lambda: rig.device.load(told.slots, BURST, SILENCE)) is Refusal.BAD_SLOT
    assert told == rig.device.limits()


def test_the_amplifier_is_on_with_the_output_and_nothing_is_made_up_of_it(live: Rig) -> None:
    if not isinstance(live.device, HostDriver):
        pytest.skip("a driver of a lab's own, or a bare core, is asked for no health")
    on = live.device.health()
    live.device.stop()
    off = live.device.health()
    assert (on.amplifier_enabled, off.amplifier_enabled) in {(True, False), (None, None)}
    assert on.switch_closed in {True, None}
    assert on.over_current in {False, None}


def test_of_a_burst_that_never_was_nothing_was_measured(live: Rig) -> None:
    if not isinstance(live.device, HostDriver):
        pytest.skip("a driver of a lab's own, or a bare core, measures nothing")
    play(live, 1)
    live.clock.wait(0.1)
    assert live.device.measured(999) is None
    found = live.device.measured(1)
    assert found is None or found.tap in {"line", "amplifier", "current", "motion"}


def test_a_waveform_that_leaves_no_room_is_refused_before_it_travels(rig: Rig) -> None:
    if not isinstance(rig.device, HostDriver):
        pytest.skip("a driver of a lab's own, or a bare core, tells its limits to nobody")
    told = rig.device.limits()
    n_most = min(told.memory_samples, rig.longest)
    if told.memory_samples >= told.slots * rig.longest:
        pytest.skip("all its slots hold the longest waveform")
    silence = np.zeros(n_most)
    codes = []
    for slot in range(told.slots):
        try:
            rig.device.load(slot, silence, silence)
        except LimitExceeded as error:
            codes.append(error.code)
    assert set(codes) == {Refusal.MEMORY_FULL}
