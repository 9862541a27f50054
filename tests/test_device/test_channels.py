"""Any number of channels: each plays its own waveform at its own level."""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING

import numpy as np
import pytest

from device import (
    Converter,
    Limits,
    MockDevice,
    Outcome,
    OutputStage,
    Played,
    Refusal,
    VirtualClock,
    converter_device,
)
from device.core.host import HostDriver
from device.emulate.amplifier import Adc, Amplifier
from device.monitor.measured import Fault, Planned, Tap, Tolerances
from device.monitor.reported import DeviceMonitor
from tests.test_device.bursts import BURST, play, refusal
from tests.test_device.in_process import InProcess, LoopCard, audio_on
from tests.test_device.loops import DELAY
from tests.test_device.monitors import monitor_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from device.monitor.measured import Measured, Monitor

LIMITS = Limits(ceiling_vpp=200.0, min_interval_s=0.005)
ADC = Adc.parse("tap=amplifier")


class Kept(Converter):
    """What keeps what it played."""

    name, serial_number, sample_rate_hz, bits = "kept", "1", 48_000.0, 16
    full_scale_v, emulated = 100.0, True

    def __init__(self, channels: int, clock: VirtualClock) -> None:
        self.channels = channels
        self.played: list[NDArray[np.float64]] = []
        self._clock = clock

    def connect(self) -> None: ...

    def play(self, volts: NDArray[np.float64]) -> Played:
        self.played.append(volts)
        self._clock.wait(volts.shape[1] / self.sample_rate_hz)
        return Played(outcome=Outcome.FIRED)

    def zero(self) -> None: ...

    def disconnect(self) -> None: ...


def bench(
    kind: str, channels: int
) -> tuple[HostDriver, Callable[[float], None], Callable[[], list[NDArray[np.float64]]]]:
    """Return a device, what lets its time pass, and what it emitted, shape (n_channels, n)."""
    clock, output = VirtualClock(), OutputStage(channels=channels)
    if kind == "mock":
        mock = MockDevice(clock, limits=LIMITS, output=output, adc=ADC)
        return mock, clock.wait, lambda: [burst.volts for burst in mock.emitted]
    if kind == "converter":
        kept = Kept(channels, clock)
        return converter_device(kept, limits=LIMITS, clock=clock), clock.wait, lambda: kept.played
    rig = InProcess(output=output, amplifier=Amplifier(adc=ADC))

    def emitted() -> list[NDArray[np.float64]]:
        rows = [event["peak_v"] for event in rig.truth if event["event"] == "burst"]
        return [np.array(row)[:, np.newaxis] for row in rows]

    return rig.device, rig.wait, emitted


@pytest.mark.parametrize("channels", [1, 3, 16, 64])
@pytest.mark.parametrize("kind", ["mock", "wire", "converter"])
def test_each_channel_plays_its_own_waveform_at_its_own_level(kind: str, channels: int) -> None:
    device, wait, emitted = bench(kind, channels)
    assert device.open().channels == channels
    last = channels - 1
    for slot, driven in enumerate(({0}, {last}, {*range(channels)})):
        rows = [BURST * (channel in driven) for channel in range(channels)]
        device.load(slot, np.stack(rows))
    device.enable()
    levels_vpp = tuple(100.0 + channel for channel in range(channels))
    device.set_levels(levels_vpp)
    for token, driven in enumerate(({0}, {last}, {*range(channels)}), start=1):
        delivery = play(device, token, token - 1)
        expected_vpp = tuple(
            level_vpp if channel in driven else 0.0 for channel, level_vpp in enumerate(levels_vpp)
        )
        assert (delivery.outcome, delivery.levels_vpp) == (Outcome.FIRED, expected_vpp)
        wait(0.1)
        peaks_v = np.abs(emitted()[-1]).max(axis=1)
        assert np.allclose(peaks_v, np.array(expected_vpp) / 2, atol=0.01)
        measured = device.measured(token)
        if kind != "converter":
            assert measured is not None
            assert np.allclose(measured.peaks, 1000 * peaks_v, atol=1)
            assert [bool(alike) for alike in measured.correlations] == [*(peaks_v > 0)]
    assert len(emitted()) == 3


@pytest.mark.parametrize("kind", ["mock", "wire", "converter"])
def test_each_of_sixteen_slots_plays_on_its_own_channel(kind: str) -> None:
    device, wait, emitted = bench(kind, 16)
    device.open()
    for slot in range(16):
        device.load(slot, np.stack([BURST * (channel == slot) for channel in range(16)]))
    device.enable()
    device.set_levels([100.0] * 16)
    for slot in range(16):
        assert play(device, slot + 1, slot).outcome is Outcome.FIRED
        wait(0.1)
        assert emitted()[-1].any(axis=1).tolist() == [channel == slot for channel in range(16)]
    assert len(emitted()) == 16


@pytest.mark.parametrize("channels", [1, 3, 16])
@pytest.mark.parametrize("kind", ["inputs", "device"])
def test_a_monitor_verifies_each_channel_and_reports_a_burst_on_another_one(
    kind: str, channels: int
) -> None:
    measure = measuring(kind, channels)
    for channel in range(channels):
        measured = measure(channel, channel)
        assert (measured.verified, measured.faults, measured.noted) == ("amplifier", (), ())
        assert measured.peaks is not None
        expected_v = [50.0 * (each == channel) for each in range(channels)]
        assert np.allclose(measured.peaks, expected_v, atol=0.5)
        assert measured.correlations is not None
        sounding = [alike is not None for alike in measured.correlations]
        assert sounding == [each == channel for each in range(channels)]
    if channels > 1:
        assert measure(0, channels - 1).faults == (Fault.SWAPPED,)


def measuring(kind: str, channels: int) -> Callable[[int, int], Measured]:
    """Return what plays a slot, each on its own channel, and measures what was planned."""
    card = LoopCard(channels=channels)
    rig = InProcess(output=OutputStage(channels=channels), amplifier=Amplifier(adc=ADC))
    device: HostDriver = audio_on(card) if kind == "inputs" else rig.device
    wait = card.wait if kind == "inputs" else rig.wait
    device.open()
    for slot in range(channels):
        device.load(slot, np.stack([BURST * (channel == slot) for channel in range(channels)]))
    device.enable()
    device.set_levels([100.0] * channels)
    monitor: Monitor = DeviceMonitor(
        device,
        rig.clock,
        tap=Tap.AMPLIFIER,
        per_unit=(1.0,) * channels,
        delay_s=(0.0,) * channels,
        tolerances=Tolerances(),
    )
    if kind == "inputs":
        delay_s = DELAY / 48e3
        monitor = monitor_of(
            device, card.recorder, card, tap=Tap.AMPLIFIER, delay_s=delay_s, tolerances={}
        )
    monitor.open()
    tokens = count(1)

    def measure(planned_channel: int, slot: int) -> Measured:
        token = next(tokens)
        wait(0.3)
        peaks = tuple(50.0 * (channel == planned_channel) for channel in range(channels))
        burst = (50.0,) * channels
        monitor.begin(token, Planned(shape=BURST, sample_rate_hz=48e3, peaks=peaks, burst=burst))
        delivery = play(device, token, slot)
        wait(0.15)
        return monitor.end(delivery)

    return measure


@pytest.mark.parametrize("kind", ["mock", "wire", "converter"])
def test_another_number_of_waveforms_or_levels_is_refused(kind: str) -> None:
    device, _, _ = bench(kind, 3)
    device.open()
    for n in (0, 1, 2, 4):
        waveforms = np.zeros((n, 97))
        assert refusal(lambda: device.load(0, waveforms)) is Refusal.WRONG_CHANNELS  # noqa: B023 - called here
        levels_vpp = [10.0] * n
        assert refusal(lambda: device.set_levels(levels_vpp)) is Refusal.WRONG_CHANNELS  # noqa: B023 - called here


def test_of_a_device_with_more_channels_only_the_first_are_driven() -> None:
    rig = InProcess(output=OutputStage(channels=4), amplifier=Amplifier(adc=ADC))
    device = HostDriver(rig.link, limits=LIMITS, clock=rig.clock, channels=3)
    assert device.open().channels == 3
    device.load(0, np.stack([BURST, 0 * BURST, BURST]))
    device.enable()
    device.set_levels([100.0, 90.0, 80.0])
    assert play(device, 1).levels_vpp == (100.0, 0.0, 80.0)
    rig.wait(0.1)
    (burst,) = (event for event in rig.truth if event["event"] == "burst")
    assert burst["levels_mv"] == [100_000, 0, 80_000, 0]
    device.close()
    assert HostDriver(rig.link, limits=LIMITS, clock=rig.clock, channels=16).open().channels == 4
