"""Devices in this process, on a virtual clock: every byte of the wire, no waiting.

The link, the faults of a line and the endpoint are those of real processes; only the line itself is
a pair of buffers.
"""

from __future__ import annotations

import io
import json
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from device import Limits, LineSettings, LinkError, OutputStage, VirtualClock
from device.core.converter import ConverterDevice
from device.core.core import DeviceCore
from device.core.host import HostDriver
from device.emulate.emulator import TICK_S, Emulator, Nature, Truth
from device.emulate.faults import Faults, FaultScript
from device.scpi.generator import GeneratorConverter
from device.sound.audio import AudioConverter
from device.sound.recorder import Recorder
from device.wire.channels import BEAT_EVERY_S
from device.wire.endpoint import Endpoint
from device.wire.link import FrameLink
from tests.test_device.bursts import identity, ready
from tests.test_device.loops import FULL_SCALE_V, Line
from tests.test_device.wire import answers

if TYPE_CHECKING:
    from collections.abc import Callable

    from device import Clock, Emission, Refusal
    from device.emulate.generator import EmulatedGenerator
    from device.limits import CodeArray
    from device.sound.player import Frames
    from device.sound.stream import Callback
    from device.wire.channels import Channel

_LEAST_STEP_S: Final = 1e-7

LIMITS = Limits(ceiling_vpp=200.0, min_interval_s=0.01)


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
        script: str = "",
        rng: np.random.Generator | int = 1,
        *,
        clock: VirtualClock | None = None,
        line: LineSettings | None = None,
        limits: Limits | None = None,
        output: OutputStage | None = None,
        **nature: Any,
    ) -> None:
        self.clock = clock or VirtualClock()
        self.faults = Faults(FaultScript.parse(script), np.random.default_rng(rng))
        self.limits = limits or Limits(ceiling_vpp=200.0, min_interval_s=0.005)
        self._buffers, self._truth = Buffers(), io.StringIO()
        nature_of = Nature(limits=self.limits, output=output or OutputStage(), **nature)
        truth = Truth(self._truth)
        self.emulator = Emulator(self._buffers, nature_of, self.faults, truth, self.clock)
        self._beat_due_s = self.clock.now_s()
        self.beating = True
        self.link = FrameLink(self._connect, self.clock, line=line or LineSettings())
        self.device = HostDriver(self.link, limits=self.limits, clock=self.clock)

    @property
    def truth(self) -> list[dict[str, Any]]:
        """What the device really did."""
        return [json.loads(line) for line in self._truth.getvalue().splitlines()]

    def set_faults(self, script: str, *, cut_after: float = float("inf")) -> None:
        """Have other faults happen, and the line cut after so many bytes."""
        self.faults.script = FaultScript.parse(script)
        self.faults._room = cut_after

    def stored(self, slot: int) -> CodeArray:
        """Return the codes of a slot, shape (2, n)."""
        core = self.emulator._endpoint.core
        assert isinstance(core, DeviceCore)
        return core._slots[slot].codes

    def wait(self, duration_s: float) -> None:
        """Let time pass."""
        until_s = self.clock.now_s() + duration_s
        while (left_s := until_s - self.clock.now_s()) > 0.0:
            self._step(left_s)
        self.emulator.turn(0.0)

    def _step(self, at_most_s: float) -> None:
        """Go to what is due next."""
        self.emulator.turn(0.0)
        beat_in_s = self._beat_due_s - self.clock.now_s()
        if beat_in_s <= 0.0:
            self._beat_due_s = self.clock.now_s() + BEAT_EVERY_S
            if self.beating and self._buffers.connected:
                self.link.beat()
            return
        step_s = min(at_most_s, beat_in_s, self.emulator.due_in_s)
        self.clock.wait(max(step_s, _LEAST_STEP_S))

    def _connect(self) -> InProcess:
        self._buffers.connect(connected=True)
        return self

    def write(self, data: bytes) -> None:
        """Send bytes to the device."""
        self._require_line()
        self._buffers.to_device += data

    def read(self, timeout_s: float) -> bytes:
        """Return what reaches the host within a time."""
        self._require_line()
        until_s = self.clock.now_s() + timeout_s
        self.emulator.turn(0.0)
        while not self._buffers.to_host and self._buffers.connected:
            left_s = until_s - self.clock.now_s()
            if left_s <= 0.0:
                break
            self._step(left_s)
            self.emulator.turn(0.0)
        data = bytes(self._buffers.to_host)
        self._buffers.to_host.clear()
        if not data:
            self._require_line()
        return data

    def close(self) -> None:
        """Have the device notice that the host is gone."""
        self._buffers.connect(connected=False)
        self.emulator.turn(0.0)

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
) -> ConverterDevice:
    converter = GeneratorConverter(
        lambda: channel, clock, limits=limits, amplifier_gain=gain, sample_rate_hz=48_000.0
    )
    return ConverterDevice(converter, limits=limits, clock=clock)


class SoundCard(VirtualClock):
    """A sound card without a cable, and the clock by which it takes a buffer at a time."""

    buffer = 64
    latency = 0.02
    active = True
    channels = 2
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
        out = np.full((self.buffer, self.channels), 99, dtype=np.int16)
        timing = SimpleNamespace(currentTime=0.0, outputBufferDacTime=self.latency)
        callback(out, self.buffer, timing, SimpleNamespace(output_underflow=underflow))
        return out


class LoopCard(SoundCard):
    """A sound card whose outputs are led back to its inputs, by a `Line`.

    The next buffer's frames are `put_in`; `word_s` is the latency of its inputs that it tells.
    """

    def __init__(self, *, seed: int = 1, buffer: int = 64, channels: int = 2) -> None:
        super().__init__()
        self.buffer, self.channels = buffer, channels
        self.recorder = recorder_on(self, channels)
        self.line = Line(seed=seed, channels=channels)
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


def recorder_on(clock: Clock, channels: int = 2) -> Recorder:
    """Return what records the first inputs at 48 kHz."""
    return Recorder(clock, 48_000.0, channels=tuple(range(1, channels + 1)))


def audio_on(card: SoundCard, limits: Limits = LIMITS) -> ConverterDevice:
    recorder = card.recorder if isinstance(card, LoopCard) else None
    converter = AudioConverter(
        card.connect,
        card,
        volts_full_scale=FULL_SCALE_V,
        sample_rate_hz=48_000.0,
        card="card",
        recorder=recorder,
        channels=card.channels,
    )
    return ConverterDevice(converter, limits=limits, clock=card)


class RecordedLine:
    """A device at the end of a line that keeps all that a host ever sent; time stands still."""

    BOOT_ID: Final = 5

    def __init__(self) -> None:
        self.over: list[Emission] = []
        limits = Limits(ceiling_vpp=200.0, min_interval_s=0.005)
        self.core = DeviceCore(
            boot_id=self.BOOT_ID, limits=limits, output=OutputStage(), sink=self.over.append
        )
        self.endpoint = Endpoint(self.core, identity(boot_id=self.BOOT_ID))
        self.clock = VirtualClock()
        self.sent: list[bytes] = []
        self.pending = b""
        self.on_write: Callable[[bytes], None] = lambda data: None
        self.on_read: Callable[[bytes], bytes] = lambda data: data
        self.link = FrameLink(lambda: self, self.clock)
        self.device = HostDriver(self.link, limits=limits, clock=self.clock)

    def live(self) -> RecordedLine:
        """Open the device, ready to play at 100 Vpp."""
        ready(self.device, 100.0)
        return self

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        self.on_write(data)
        self.pending += self.answer(data)

    def read(self, timeout_s: float) -> bytes:
        data, self.pending = self.on_read(self.pending), b""
        self.clock.wait(0.0 if data else timeout_s)
        return data

    def close(self) -> None:
        self.endpoint.hang_up(round(self.clock.now_s() * 1e6))

    def answer(self, data: bytes) -> bytes:
        return self.endpoint.receive(round(self.clock.now_s() * 1e6), data)

    def refusals(self, data: bytes) -> list[Refusal | None]:
        """Return why the device refuses each question of these bytes, if it does."""
        return [answer.refusal for answer in answers(self.answer(data))]
