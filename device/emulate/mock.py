"""A device in this process: the core behind the driver protocol, on any clock."""

from __future__ import annotations

import secrets
from typing import TYPE_CHECKING, Final

import numpy as np

from device.checks import require_real
from device.core.core import DeviceCore
from device.core.host import HostDriver
from device.core.local import LocalCore
from device.core.messages import Stop
from device.core.output import Emission, OutputStage
from device.core.reports import About, Health, Measurement
from device.driver import Identity
from device.limits import Limits

if TYPE_CHECKING:
    from device.clock import Clock
    from device.emulate.amplifier import Adc

ABOUT: Final = About(firmware="tactstrip mock")
MODEL = "tactstrip mock"
"""What it says it is."""

DEVICE_LIMITS = Limits(ceiling_vpp=200.0, min_interval_s=0.005)
"""Limits of the mock, unless others are given."""

OUTPUT_STAGE = OutputStage()
"""Converter and amplifier of the mock, unless others are given."""


class MockDevice(HostDriver):
    """A `BurstDevice` without hardware that keeps what it really emitted.

    It has the methods of `BurstDevice`, and those below.

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
        Source of boot ids and of what the `adc` misses; None takes the system's.
    adc : Adc or None
        What measures its bursts.

    Raises
    ------
    ValueError
        `drift_ppm` or `offset_s` is out of range.

    Examples
    --------
    >>> from device.clock import VirtualClock
    >>> from device.limits import Limits
    >>> import numpy as np
    >>> sine = np.sin(2 * np.pi * np.arange(97) / 96)
    >>> sine[-1] = 0.0
    >>> device = MockDevice(VirtualClock(), limits=Limits(ceiling_vpp=200.0))
    >>> bits = device.open().bits
    >>> device.load(0, np.stack([sine, 0 * sine]))
    >>> device.enable()
    >>> device.set_levels([130.0, 130.0])
    >>> device.arm(7, 0, time_to_live_s=0.5)
    >>> felt = device.fire(7)
    >>> felt.outcome.value, felt.levels_vpp
    ('fired', (130.0, 0.0))
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
        adc: Adc | None = None,
    ) -> None:
        require_real("drift_ppm", drift_ppm, minimum=-1e5, maximum=1e5)
        require_real("offset_s", offset_s, minimum=0.0)
        self._bench = _Bench(
            clock,
            limits=device_limits,
            output=output,
            rate=1.0 + drift_ppm * 1e-6,
            offset_s=offset_s,
            rng=rng,
            adc=adc,
        )
        super().__init__(self._bench, limits=limits, clock=clock)

    @property
    def emitted(self) -> tuple[Emission, ...]:
        """Every burst so far, over all power cycles; the last may still be under way."""
        return self._bench.emitted()

    def sense(self, sensed: Health) -> None:
        """Have switch and amplifier report something else from now on.

        Parameters
        ----------
        sensed : Health
            What they report, see `device.core.reports.Health`.
        """
        self._bench.sense(sensed)

    def silence(self) -> None:
        """Stop the host's heartbeat, as the death of its process would; `open` starts it again."""
        self._bench.silence()

    def reset(self) -> None:
        """Cut the device's power and give it back: new boot id, everything forgotten."""
        self._bench.reset()


class _Bench(LocalCore):
    """The `Link` of the mock: a core with a clock of its own."""

    def __init__(
        self,
        clock: Clock,
        *,
        limits: Limits,
        output: OutputStage,
        rate: float,
        offset_s: float,
        rng: np.random.Generator | None,
        adc: Adc | None,
    ) -> None:
        self._sensed = Health()
        self._adc = adc
        self._missing = np.random.default_rng(0) if rng is None else rng
        self._limits = limits
        self._output = output
        self._rate = rate
        self._offset_s = offset_s
        self._rng = rng
        self._over: list[Emission] = []
        super().__init__(self._power_up(), clock)
        self._heart_beats = False

    def hello(self) -> Identity:
        self._beat_us = self._advance()
        self._heart_beats = True
        self._state = self._core.state
        return Identity.of_emulator(MODEL, "mock", self.boot_id, self._limits, self._output)

    def hang_up(self) -> None:
        super().hang_up()
        self._heart_beats = False

    def emitted(self) -> tuple[Emission, ...]:
        self._advance()
        playing = self._core.playing
        return (*self._over, *(() if playing is None else (playing,)))

    def sense(self, sensed: Health) -> None:
        self._sensed = sensed
        self._core.sense(self._advance(), sensed)

    def silence(self) -> None:
        self._advance()
        self._heart_beats = False

    def reset(self) -> None:
        self._core.take(self._advance(), Stop())
        self._core = self._power_up()

    def _power_up(self) -> DeviceCore:
        drawn = secrets.randbits(63) if self._rng is None else self._rng.integers(2**63)
        core = DeviceCore(
            boot_id=int(drawn),
            limits=self._limits,
            output=self._output,
            sink=self._over.append,
            measure=self._measure,
            about=ABOUT,
        )
        core.sense(0, self._sensed)
        return core

    def _measure(self, burst: Emission) -> Measurement | None:
        if self._adc is None:
            return None
        connected = self._sensed.switch_closed is not False
        return self._adc.seen(burst, connected=connected, rng=self._missing)

    def _device_us(self, host_s: float) -> int:
        return round((host_s * self._rate + self._offset_s) * 1e6)
