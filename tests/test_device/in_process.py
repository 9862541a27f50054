"""Devices in this process, on a virtual clock: every byte of the wire, no waiting.

The link, the faults of a line and the endpoint are those of real processes; only the line itself is
a pair of buffers.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import IO, TYPE_CHECKING, Final

import numpy as np

from device.clock import VirtualClock
from device.core.core import DeviceCore
from device.core.output import OutputStage
from device.emulate.emulator import TICK_S, Emulator, Nature, Truth
from device.errors import LinkError
from device.limits import Limits
from device.scpi.generator import GeneratorDevice
from device.sound.audio import AudioDevice
from device.sound.recorder import Recorder
from device.wire.channels import BEAT_EVERY_S, USUAL, LineSettings
from device.wire.endpoint import Endpoint
from device.wire.link import FrameLink
from tests.test_device.loops import FULL_SCALE_V, Line

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.core.output import Emission
    from device.driver import Identity
    from device.emulate.faults import Faults
    from device.emulate.generator import EmulatedGenerator
    from device.sound.player import Frames
    from device.sound.stream import Callback
    from device.wire.channels import Channel

_LEAST_STEP_S: Final = 1e-7

LIMITS = Limits(ceiling_vpp=200.0, least_interval_s=0.01)


class Buffers:
    """A line that is two buffers: the emulator's `Line` and, on the other side, a host's bytes."""

    name = "in process"

    def __init__(self) -> None:
        self.connected = False
        self.to_device = bytearray()
        self.to_host = bytearray()

    def connect(self, *, connected: bool) -> None:
        """Begin or end a connection; nothing is left on the line."""
        self.connected = connected
        self.to_device.clear()
        self.to_host.clear()

    def read(self, timeout_s: float) -> bytes | None:
        """Return what has arrived; None while no host is connected."""
        if not self.connected:
            return None
        data = bytes(self.to_device)
        self.to_device.clear()
        return data

    def write(self, data: bytes) -> None:
        """Send bytes, if there is a host."""
        if self.connected:
            self.to_host += data

    def drop(self) -> None:
        self.connect(connected=False)

    def close(self) -> None:
        """Do nothing."""


class InProcess:
    """An emulator and the `link` to it, both on one virtual clock.

    Let time pass by `wait`, which keeps the heart beating while `beating`. The truth file is told
    what the device really did.
    """

    def __init__(
        self,
        clock: VirtualClock,
        *,
        nature: Nature,
        faults: Faults,
        truth: IO[str],
        line: LineSettings = USUAL,
    ) -> None:
        self._clock = clock
        self._buffers = Buffers()
        self.emulator = Emulator(self._buffers, nature, faults, Truth(truth), clock)
        self._beat_due_s = clock.now_s()
        self.beating = True
        self.link = FrameLink(self._connect, clock, line=line)

    def wait(self, duration_s: float) -> None:
        """Let time pass."""
        until_s = self._clock.now_s() + duration_s
        while (left_s := until_s - self._clock.now_s()) > 0.0:
            self._step(left_s)
        self.emulator.turn(0.0)

    def _step(self, at_most_s: float) -> None:
        """Go to what is due next."""
        self.emulator.turn(0.0)
        beat_in_s = self._beat_due_s - self._clock.now_s()
        if beat_in_s <= 0.0:
            self._beat_due_s = self._clock.now_s() + BEAT_EVERY_S
            if self.beating and self._buffers.connected:
                self.link.beat()
            return
        step_s = min(at_most_s, beat_in_s, self.emulator.due_in_s)
        self._clock.wait(max(step_s, _LEAST_STEP_S))

    def _connect(self) -> _Channel:
        self._buffers.connect(connected=True)
        return _Channel(self._buffers, self)

    def read(self, timeout_s: float) -> bytes:
        """Return what reaches the host within a time."""
        until_s = self._clock.now_s() + timeout_s
        self.emulator.turn(0.0)
        while not self._buffers.to_host and self._buffers.connected:
            left_s = until_s - self._clock.now_s()
            if left_s <= 0.0:
                break
            self._step(left_s)
            self.emulator.turn(0.0)
        data = bytes(self._buffers.to_host)
        self._buffers.to_host.clear()
        return data

    def hung_up(self) -> None:
        """Have the device notice that the host is gone."""
        self._buffers.connect(connected=False)
        self.emulator.turn(0.0)


class _Channel:
    """The host's side of one connection."""

    def __init__(self, buffers: Buffers, device: InProcess) -> None:
        self._buffers = buffers
        self._device = device

    def write(self, data: bytes) -> None:
        self._require_line()
        self._buffers.to_device += data

    def read(self, timeout_s: float) -> bytes:
        self._require_line()
        data = self._device.read(timeout_s)
        if not data:
            self._require_line()
        return data

    def close(self) -> None:
        self._device.hung_up()

    def _require_line(self) -> None:
        if not self._buffers.connected:
            raise LinkError("the line is gone")


class LocalChannel:
    """A `Channel` to an emulated generator in this process, on the host's clock."""

    def __init__(self, generator: EmulatedGenerator, clock: Clock) -> None:
        self._generator = generator
        self._clock = clock
        self._answers = b""

    def write(self, data: bytes) -> None:
        self._answers += self._generator.receive(self._now_us(), data)

    def read(self, timeout_s: float) -> bytes:
        """Return what was answered, or wait for one tick at most."""
        if not self._answers:
            self._clock.wait(min(timeout_s, TICK_S))
        answers, self._answers = self._answers + self._generator.due(self._now_us()), b""
        return answers

    def close(self) -> None:
        self._answers = b""

    def _now_us(self) -> int:
        return round(self._clock.now_s() * 1e6)


def generator_on(
    channel: Channel, clock: Clock, *, gain: float, limits: Limits = LIMITS
) -> GeneratorDevice:
    return GeneratorDevice(
        lambda: channel,
        limits=limits,
        clock=clock,
        amplifier_gain=gain,
        sample_rate_hz=48_000.0,
    )


class SoundCard(VirtualClock):
    """A sound card without a cable, and the clock by which it takes a buffer at a time."""

    buffer = 64
    latency = 0.02
    active = True
    callback: Callback | None = None

    def connect(self, callback: Callback) -> SoundCard:
        self.callback, self.active = callback, True
        return self

    def close(self) -> None:
        self.callback, self.active = None, False

    def wait(self, duration_s: float) -> None:
        """Let time pass, a buffer's at a time."""
        until_s = self.now_s() + duration_s
        while self.now_s() < until_s:
            super().wait(min(self.buffer / 48_000.0, until_s - self.now_s()))
            if self.callback is not None and self.active:
                self.take(self.callback)

    def take(self, callback: Callback, *, underflow: bool = False) -> Frames:
        out = np.full((self.buffer, 2), 99, dtype=np.int16)
        timing = SimpleNamespace(currentTime=0.0, outputBufferDacTime=self.latency)
        callback(out, self.buffer, timing, SimpleNamespace(output_underflow=underflow))
        return out


class LoopCard(SoundCard):
    """A sound card whose outputs are led back to its inputs, by a `Line`.

    The next buffer's frames are `put_in`; `word_s` is the latency of its inputs that it tells.
    """

    def __init__(self, *, seed: int = 1) -> None:
        super().__init__()
        self.recorder = Recorder(self, 48_000.0)
        self.line = Line(seed=seed)
        self.put_in = False
        self.word_s = self.buffer / 48e3
        self._due_s = 0.0

    def take(self, callback: Callback, *, underflow: bool = False) -> Frames:
        timing = SimpleNamespace(currentTime=1.0, inputBufferAdcTime=1.0 - self.word_s)
        heard = self.line.heard(self.buffer, ahead=self.buffer)
        status = SimpleNamespace(input_overflow=False, input_underflow=self.put_in)
        self.recorder.take(heard, timing, status)
        self.put_in = False
        out = super().take(callback, underflow=underflow)
        self.line.put(out)
        return out

    def wait(self, duration_s: float) -> None:
        """Let time pass; however it is cut, a buffer is taken when it is due."""
        until_s = self.now_s() + duration_s
        while self._due_s <= until_s:
            VirtualClock.wait(self, max(self._due_s - self.now_s(), 0.0))
            self._due_s += self.buffer / 48_000.0
            if self.callback is not None and self.active:
                self.take(self.callback)
        VirtualClock.wait(self, max(until_s - self.now_s(), 0.0))


def audio_on(card: SoundCard, limits: Limits = LIMITS) -> AudioDevice:
    return AudioDevice(
        card.connect,
        limits=limits,
        clock=card,
        volts_full_scale=FULL_SCALE_V,
        sample_rate_hz=48_000.0,
        name="card",
        recorder=card.recorder if isinstance(card, LoopCard) else None,
    )


def endpoint(
    who: Identity,
    *,
    least_interval_s: float = 0.005,
    sink: Callable[[Emission], None] = lambda burst: None,
) -> Endpoint:
    """Return the device's end of a line, with a core of that identity behind it."""
    core = DeviceCore(
        boot_id=who.boot_id,
        limits=Limits(
            ceiling_vpp=who.ceiling_vpp,
            least_interval_s=least_interval_s,
            longest_waveform=who.longest_waveform,
        ),
        output=OutputStage(sample_rate_hz=who.sample_rate_hz, bits=who.bits),
        sink=sink,
    )
    return Endpoint(core, who)
