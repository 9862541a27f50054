"""A device in this process: the core behind the driver protocol, on any clock."""

import secrets
from collections import deque
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from device._checks import require_real
from device.clock import Clock, resolution_s
from device.core import DeviceCore
from device.driver import Identity
from device.host import HostDriver
from device.limits import Limits
from device.messages import Arm, Levels, Load
from device.output import Emission, OutputStage
from device.states import State
from device.tokens import Exchange, Record

BEAT_US = 100_000
"""Interval of the host's heartbeat."""

DEVICE_LIMITS = Limits(ceiling_vpp=200.0, least_interval_s=0.005)
"""The mock's own limits, unless told otherwise."""

OUTPUT_STAGE = OutputStage()
"""The mock's converter and amplifier, unless told otherwise."""

_STRIDE_US = 4 * BEAT_US
"""One beat in four is given to the core: the others could not change what its watchdog does."""

_Content = TypeVar("_Content")
_Answer = TypeVar("_Answer")


class MockDevice(HostDriver):
    """A `BurstDevice` without hardware that keeps what it really emitted.

    The host's checks and the device's are both made, each with its own limits, as they are over a
    wire. While it is open the host's heart beats every 100 ms, however far the clock jumps, until
    `silence` stops it.

    Parameters
    ----------
    clock : Clock
        The host's clock.
    limits : Limits
        Of the study: what the host refuses to send.
    device_limits : Limits
        Of the device: what it refuses to play.
    output : OutputStage
        Converter and amplifier.
    drift_ppm, offset_s : float
        The device's clock shows host time x (1 + drift_ppm 1e-6) + offset_s, offset_s >= 0.
    rng : numpy.random.Generator or None
        Source of boot ids; None takes the system's.

    Raises
    ------
    ValueError
        `drift_ppm` or `offset_s` is out of range.

    Examples
    --------
    >>> from device.clock import VirtualClock
    >>> sine = np.sin(2 * np.pi * np.arange(97) / 96)
    >>> sine[-1] = 0.0
    >>> device = MockDevice(VirtualClock(), limits=Limits(ceiling_vpp=200.0))
    >>> bits = device.open().bits
    >>> device.load(0, sine, 0 * sine)
    >>> device.enable()
    >>> device.set_levels(130.0, 130.0)
    >>> device.arm(7, 0, time_to_live_s=0.5)
    >>> felt = device.fire(7)
    >>> felt.outcome.value, felt.level_left_vpp, felt.level_right_vpp
    ('fired', 130.0, 0.0)
    >>> device.fire(7) == felt, len(device.emitted)
    (True, 1)
    """

    def __init__(
        self,
        clock: Clock,
        *,
        limits: Limits,
        device_limits: Limits = DEVICE_LIMITS,
        output: OutputStage = OUTPUT_STAGE,
        drift_ppm: float = 0.0,
        offset_s: float = 0.0,
        rng: np.random.Generator | None = None,
    ) -> None:
        require_real("drift_ppm", drift_ppm, least=-1e5, most=1e5)
        require_real("offset_s", offset_s, least=0.0)
        self._bench = _Bench(
            clock,
            limits=device_limits,
            output=output,
            rate=1.0 + drift_ppm * 1e-6,
            offset_s=offset_s,
            rng=rng,
        )
        super().__init__(self._bench, limits=limits, clock=clock)

    @property
    def emitted(self) -> tuple[Emission, ...]:
        """Every burst so far, over all power cycles; the last may still be under way."""
        return self._bench.emitted()

    def silence(self) -> None:
        """Stop the host's heartbeat, as the death of its process would; `open` starts it again."""
        self._bench.silence()

    def reset(self) -> None:
        """Cut the device's power and give it back: new boot id, everything forgotten."""
        self._bench.reset()


class _Bench:
    """The `Link` of the mock: a core, the clock it runs on, and a host's heart."""

    def __init__(
        self,
        clock: Clock,
        *,
        limits: Limits,
        output: OutputStage,
        rate: float,
        offset_s: float,
        rng: np.random.Generator | None,
    ) -> None:
        self._clock = clock
        self._resolution_s = resolution_s(clock)
        self._limits = limits
        self._output = output
        self._rate = rate
        self._offset_s = offset_s
        self._rng = rng
        self._over: list[Emission] = []
        self._stops: deque[float] = deque()
        self._known = State.CLOSED
        self._heart_beats = False
        self._beat_us = 0
        self._core = self._power_up()

    @property
    def state(self) -> State:
        stopped = self._stops and self._known is not State.CLOSED
        return State.SAFE if stopped else self._known

    @property
    def boot_id(self) -> int:
        return self._core.boot_id

    def hello(self) -> Identity:
        self._beat_us = self._attend()
        self._heart_beats = True
        self._known = self._core.state
        return Identity(
            model="tactstrip mock",
            serial_number="mock",
            boot_id=self._core.boot_id,
            protocol_version="1.0",
            sample_rate_hz=self._output.sample_rate_hz,
            bits=self._output.bits,
            channels=2,
            ceiling_vpp=self._limits.ceiling_vpp,
            longest_waveform=self._limits.longest_waveform,
            emulated=True,
        )

    def load(self, message: Load) -> None:
        self._ask(self._core.load, message)

    def set_levels(self, message: Levels) -> None:
        self._ask(self._core.set_levels, message)

    def enable(self) -> None:
        self._ask(lambda now_us, _: self._core.enable(now_us), None)

    def arm(self, message: Arm) -> None:
        self._ask(self._core.arm, message)

    def fire(self, token: int) -> Exchange:
        return self._exchange(self._core.fire, token)

    def disarm(self, token: int) -> None:
        self._ask(self._core.disarm, token)

    def query(self, token: int) -> Exchange:
        return self._exchange(self._core.query, token)

    def stop(self) -> None:
        self._stops.append(self._clock.now_s())

    def hang_up(self) -> None:
        self._attend()
        self._heart_beats = False
        self._known = State.CLOSED

    def emitted(self) -> tuple[Emission, ...]:
        self._attend()
        playing = self._core.playing
        return (*self._over, *(() if playing is None else (playing,)))

    def silence(self) -> None:
        self._attend()
        self._heart_beats = False

    def reset(self) -> None:
        self._core.stop(self._attend())
        self._core = self._power_up()

    def _power_up(self) -> DeviceCore:
        drawn = secrets.randbits(63) if self._rng is None else self._rng.integers(2**63)
        return DeviceCore(
            boot_id=int(drawn), limits=self._limits, output=self._output, sink=self._over.append
        )

    def _exchange(self, call: Callable[[int, int], Record], token: int) -> Exchange:
        before_s = self._clock.now_s()
        record = self._ask(call, token)
        return Exchange(
            record=record,
            boot_id=self._core.boot_id,
            host_before_s=before_s,
            host_after_s=self._clock.now_s(),
            device_us=self._core.now_us,
            resolution_s=self._resolution_s,
            retries=0,
        )

    def _ask(self, call: Callable[[int, _Content], _Answer], content: _Content) -> _Answer:
        """Give a message to the device; its answer, also a refusal, tells the device's state."""
        now_us = self._attend()
        try:
            return call(now_us, content)
        finally:
            self._known = self._core.state

    def _attend(self) -> int:
        """Bring the device up to the present, stops first, and return its time."""
        while self._stops:
            at_us = max(self._device_us(self._stops.popleft()), self._core.now_us)
            self._beat_until(at_us)
            self._core.stop(at_us)
        now_us = self._device_us(self._clock.now_s())
        self._beat_until(now_us)
        self._core.advance(now_us)
        return now_us

    def _beat_until(self, until_us: int) -> None:
        due_us = until_us - (until_us - self._beat_us) % BEAT_US
        while self._heart_beats and self._beat_us < due_us:
            self._beat_us = min(self._beat_us + _STRIDE_US, due_us)
            self._core.beat(self._beat_us)

    def _device_us(self, host_s: float) -> int:
        return round((host_s * self._rate + self._offset_s) * 1e6)
