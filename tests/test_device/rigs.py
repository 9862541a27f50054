"""Devices for the contract: on a virtual clock, behind real lines, and those of a lab."""

from __future__ import annotations

import base64
import json
import os
import signal
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
import pytest

from device import (
    BurstDevice,
    Clock,
    Converter,
    Delivery,
    DriverSettings,
    Emission,
    Health,
    MockDevice,
    MonotonicClock,
    Outcome,
    Played,
    Refusal,
    RefusedError,
    State,
    VirtualClock,
    converter_device,
    make_device,
)
from device.core.host import HostDriver
from device.emulate.generator import EmulatedGenerator
from device.wire.channels import open_channel
from device.wire.link import FrameLink
from tests.test_device.in_process import LIMITS, LocalChannel, SoundCard, audio_on, generator_on
from tests.test_device.wire import message

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from device import Identity
    from device.core.messages import Message
    from device.core.tokens import Exchange, Reply

    MakeRig: TypeAlias = Callable[[pytest.FixtureRequest], "Rig"]
    Rigs: TypeAlias = dict[str, MakeRig]

EMULATED_RATE_HZ: Final = 4000.0
"""Low, so that a long burst has few samples to upload."""
GENERATOR_LEVEL: Final = 1 / 32
"""Volts of the generator per volt at the actuator: exact in binary, so that volts are too."""
IN_REAL_TIME: Final[dict[str, Any]] = {
    "in_real_time": True,
    "long_s": 1.2,
    "idle_s": 1.2,
    "time_to_live_s": 5.0,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """An implementation with what a test needs around it."""

    device: BurstDevice
    clock: Clock
    silence: Callable[[], None]
    emitted: Callable[[], tuple[Emission, ...]] | None
    rate_hz: float = 48_000.0
    longest: int = 65_536
    in_real_time: bool = False
    long_s: float = 1.0
    """Duration of a long burst."""
    idle_s: float = 3600.0
    """As long as a host may be idle: where it can be waited for, an hour."""
    time_to_live_s: float = 0.1
    """Long enough for any machine to fire within."""
    overload: Callable[[], object] | None = None
    """Have the amplifier report an over-current, where one is wired."""
    cut_line: Callable[[], object] | None = None
    """Lose the line without a farewell, where there is one."""
    stood_still: Callable[[], bool] = lambda: False
    """Whether the machine had no time for host or device."""

    def came_out(self, *tokens: int) -> tuple[Emission, ...]:
        """Return all bursts, which are those of `tokens`; nothing where they cannot be read."""
        if self.emitted is None:
            outcomes = [self.device.query(token).outcome for token in tokens]
            assert outcomes == [Outcome.FIRED] * len(tokens)
            return ()
        emissions = self.emitted()
        assert [emission.token for emission in emissions] == list(tokens)
        return emissions if all(emission.volts.size for emission in emissions) else ()


class WatchedLink(FrameLink):
    """A link that notes if the machine stood still: a beat or an answer came much too late.

    Beats are due every 0.1 s, and no local line loses a question: one that is sent again was
    answered late. A device that heard nothing for 0.5 s stops, and a burst of a second may be over
    before the next question, so that a test may fail on a machine without time for its processes.
    """

    late_s = 0.25

    def __init__(self, port: str) -> None:
        clock = MonotonicClock()
        super().__init__(lambda: open_channel(port, clock), clock)
        self.stood_still = self.is_silent = False
        self._beat_s: float | None = None

    def hello(self) -> Identity:
        try:
            return super().hello()
        finally:
            self.stood_still |= self.requests.retries > 0

    def beat(self) -> None:
        super().beat()
        now_s = time.monotonic()
        self.stood_still |= self._beat_s is not None and now_s > self._beat_s + self.late_s
        self._beat_s = now_s

    def silence(self) -> None:
        """End the heartbeat."""
        assert self._heart is not None
        self.is_silent = True
        self._heart.end()

    def cut(self) -> None:
        """Lose the line without a farewell."""
        self._drop()

    def _done(self, message: Message[Reply], boot_id: int | None = None) -> Exchange[Reply]:
        try:
            return super()._done(message, boot_id)
        except RefusedError as error:
            self.stood_still |= error.code is Refusal.WATCHDOG_STOP and not self.is_silent
            raise
        finally:
            self.stood_still |= self.requests.retries > 0

    def _drop(self) -> None:
        super()._drop()
        self._beat_s = None


def mock_rig(_: pytest.FixtureRequest) -> Rig:
    clock = VirtualClock(start_s=3.0)
    little = replace(LIMITS, memory_samples=100_000)
    mock = MockDevice(clock, limits=LIMITS, device_limits=little, drift_ppm=40.0, offset_s=17.0)

    def overload() -> None:
        mock.sense(Health(over_current=True))
        mock.sense(Health(over_current=False))

    return Rig(
        device=mock,
        clock=clock,
        silence=mock.silence,
        emitted=lambda: mock.emitted,
        overload=overload,
    )


def real_rig(
    device: BurstDevice,
    link: WatchedLink,
    emitted: Callable[[], tuple[Emission, ...]] | None,
    **settings: Any,
) -> Rig:
    """Return a rig around a device whose time is real."""
    return Rig(
        device=device,
        clock=MonotonicClock(),
        silence=link.silence,
        emitted=emitted,
        stood_still=lambda: link.stood_still,
        **IN_REAL_TIME,
        **settings,
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
    return Emission(
        token=event["token"],
        start_us=round(event["t_s"] * 1e6),
        volts=np.frombuffer(samples, dtype="<f8").reshape(len(event["levels_mv"]), -1),
        levels_vpp=tuple(level_mv / 1000 for level_mv in event["levels_mv"]),
        sample_rate_hz=EMULATED_RATE_HZ,
    )


def emulator_rig(kind: str, **settings: object) -> MakeRig:
    def make(request: pytest.FixtureRequest) -> Rig:
        emulate = request.getfixturevalue("emulate")
        port, truth, pid = emulate(
            kind, volts=True, sample_rate_hz=EMULATED_RATE_HZ, min_interval_s=0.01, **settings
        )
        return process_rig(
            port, lambda: read_truth(truth), overload=lambda: os.kill(pid, signal.SIGUSR1)
        )

    return make


def process_rig(
    port: str,
    read_bursts: Callable[[], tuple[Emission, ...]],
    *,
    overload: Callable[[], object],
    lose_line: Callable[[], object] = lambda: None,
) -> Rig:
    """Return a rig around a device that writes down what it emits, and how that is read.

    `lose_line` tells a device that its line was cut, where it cannot notice it.
    """
    link = WatchedLink(port)

    def cut_line() -> None:
        link.cut()
        lose_line()

    def emitted() -> tuple[Emission, ...]:
        if link.state is not State.CLOSED:
            link.exchange(message("PING"))
        return read_bursts()

    device = HostDriver(link, limits=LIMITS, clock=MonotonicClock())
    return real_rig(device, link, emitted, overload=overload, cut_line=cut_line)


class FreshTokens(HostDriver):
    """A driver whose tokens 1, 2, ... are ones that its device never saw."""

    def __init__(self, link: FrameLink) -> None:
        super().__init__(link, limits=LIMITS, clock=MonotonicClock())
        self._base = round(MonotonicClock().now_s() * 1e6) * 1000
        self.longest_load = 0

    def load(self, slot: int, samples: NDArray[np.float64]) -> None:
        super().load(slot, samples)
        self.longest_load = max(self.longest_load, samples.shape[1])

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


def hardware_rig(request: pytest.FixtureRequest) -> Rig:
    link = WatchedLink(request.config.getoption("--device-url"))
    return real_rig(FreshTokens(link), link, None)


def generator_rig(_: pytest.FixtureRequest) -> Rig:
    clock, over = VirtualClock(start_s=3.0), list[Emission]()
    generator = EmulatedGenerator(over.append)
    device = generator_on(LocalChannel(generator, clock), clock, gain=1 / GENERATOR_LEVEL)

    def at_actuator(burst: Emission) -> Emission:
        return replace(burst, volts=burst.volts / GENERATOR_LEVEL)

    return Rig(
        device=device,
        clock=clock,
        silence=lambda: None,
        emitted=lambda: tuple(at_actuator(burst) for burst in over),
    )


def audio_rig(_: pytest.FixtureRequest) -> Rig:
    card = SoundCard(start_s=3.0)
    card.buffer, card.latency = 48, 0.005
    return Rig(device=audio_on(card), clock=card, silence=lambda: None, emitted=None)


class Recorder(Converter):
    """A converter that takes as long as its burst."""

    name, serial_number, bits, emulated = "recorder", "1", 16, True
    sample_rate_hz, full_scale_v = 48_000.0, 150.0

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    def connect(self) -> None: ...

    def play(self, volts: NDArray[np.float64]) -> Played:
        self._clock.wait(volts.shape[1] / self.sample_rate_hz)
        return Played(outcome=Outcome.FIRED)

    def zero(self) -> None: ...

    def disconnect(self) -> None: ...


def converter_rig(_: pytest.FixtureRequest) -> Rig:
    clock = VirtualClock(start_s=3.0)
    device = converter_device(Recorder(clock), limits=LIMITS, clock=clock)
    return Rig(device=device, clock=clock, silence=lambda: None, emitted=None)


def own_rig(request: pytest.FixtureRequest) -> Rig:
    clock = MonotonicClock()
    settings = DriverSettings(
        limits=LIMITS,
        port=request.config.getoption("--port"),
        amplifier_gain=20.0,
        volts_full_scale=150.0,
    )
    return Rig(
        device=make_device(request.config.getoption("--driver"), settings, clock),
        clock=clock,
        silence=lambda: pytest.skip("pull the cable, and see the output go to zero"),
        emitted=None,
        **IN_REAL_TIME,
    )


def given_rigs(config: pytest.Config) -> Rigs:
    """Return the rigs that the command line asks for, by name."""
    lab = {"--device-url": hardware_rig, "--driver": own_rig}
    return {option: rig for option, rig in lab.items() if config.getoption(option)}


VIRTUAL: Final[Rigs] = {
    "mock": mock_rig,
    "generator": generator_rig,
    "audio": audio_rig,
    "converter": converter_rig,
}
"""In this process, on a virtual clock."""
EMULATED: Final[Rigs] = {"pty": emulator_rig("pty"), "tcp": emulator_rig("tcp")}
"""In a process, behind a line."""
