"""An emulated amplifier and what is measured behind it: as it is told, over the wire too."""

import io
from typing import Any

import numpy as np
import pytest

from device.clock import VirtualClock
from device.core.host import HostDriver
from device.core.output import OutputStage
from device.core.reports import Health, Measurement
from device.emulate.amplifier import Adc, Amplifier
from device.emulate.emulator import Nature
from device.emulate.faults import Faults, FaultScript
from device.emulate.mock import MockDevice
from device.errors import Refusal
from tests.test_device.bursts import BURST, play, ready, refusal
from tests.test_device.in_process import InProcess
from tests.test_device.trials import LIMITS


def wired(amplifier: Amplifier) -> tuple[HostDriver, InProcess]:
    """Return a device over a wire, live at 100 Vpp, with an amplifier behind it."""
    clock = VirtualClock()
    nature = Nature(limits=LIMITS, output=OutputStage(), amplifier=amplifier)
    faults = Faults(FaultScript(), np.random.default_rng(1))
    rig = InProcess(clock, nature=nature, faults=faults, truth=io.StringIO())
    device = HostDriver(rig.link, limits=LIMITS, clock=clock)
    ready(device, 100.0)
    return device, rig


@pytest.mark.parametrize("tap", ["line", "amplifier", "current", "motion"])
@pytest.mark.parametrize("kind", ["wire", "mock"])
def test_what_is_measured_is_the_burst_by_gain_and_delay(tap: str, kind: str) -> None:
    adc = Adc.parse(f"tap={tap},gain=0.9,delay_us=40")
    if kind == "mock":
        clock = VirtualClock()
        device: HostDriver = MockDevice(clock, limits=LIMITS, adc=adc)
        ready(device, 100.0)
        wait = clock.wait
    else:
        device, rig = wired(Amplifier(adc=adc))
        wait = rig.wait
    play(device, 1)
    assert refusal(lambda: device.measured(1)) is Refusal.BUSY
    wait(0.1)
    found = device.measured(1)
    peak = round(50.0 * 0.9 * 1000 * np.abs(BURST).max())
    unit = {"current": "uA", "motion": "nm"}.get(tap, "mV")
    assert found is not None
    assert abs(found.left - peak) <= 5
    assert found == Measurement(
        token=1,
        tap=tap,
        unit=unit,
        left=found.left,
        onset_offset_us=40,
        onset_uncertainty_us=21,
        correlation_left=10_000,
    )
    assert device.measured(2) is None


@pytest.mark.parametrize("tap", ["line", "amplifier", "current", "motion"])
def test_behind_a_switch_that_nobody_senses_only_the_line_tells_of_a_burst(tap: str) -> None:
    device, rig = wired(Amplifier(switch_open=True, sensed=False, adc=Adc(tap=tap)))
    assert device.health() == Health(amplifier_enabled=True)
    play(device, 1)
    rig.wait(0.1)
    found = device.measured(1)
    assert found is not None
    assert (found.left > 0, found.correlation_left > 0) == ((tap == "line",) * 2)


def test_an_adc_misses_as_many_bursts_as_it_is_told() -> None:
    clock = VirtualClock()
    device = MockDevice(clock, limits=LIMITS, adc=Adc(loss=0.3), rng=np.random.default_rng(1))
    ready(device, 100.0)
    seen = 0
    for token in range(1, 201):
        play(device, token)
        clock.wait(0.1)
        found = device.measured(token)
        assert found is not None
        seen += found.left > 0
    assert 120 <= seen <= 160


def test_noise_of_an_adc_takes_as_much_from_the_correlation_as_its_power() -> None:
    clock = VirtualClock()
    adc = Adc.parse("noise=10000")
    device = MockDevice(clock, limits=LIMITS, adc=adc, rng=np.random.default_rng(2))
    ready(device, 100.0)
    found = []
    for token in range(1, 101):
        play(device, token)
        clock.wait(0.1)
        found.append(device.measured(token))
    correlations = [one.correlation_left for one in found if one is not None]
    signal_v2 = 50.0**2 * np.mean(BURST**2)
    assert np.mean(correlations) == pytest.approx(1e4 / np.sqrt(1 + 10.0**2 / signal_v2), rel=2e-3)
    assert all(one is not None and 0 < one.right < 45_000 for one in found)


def test_a_device_without_an_adc_measures_nothing() -> None:
    device, rig = wired(Amplifier())
    play(device, 1)
    rig.wait(0.1)
    assert device.measured(1) is None


def test_over_current_comes_at_its_time_and_is_told_until_the_output_is_on_again() -> None:
    device, rig = wired(Amplifier(over_current_at_s=1.0))
    rig.wait(0.9)
    assert device.health() == Health(amplifier_enabled=True, switch_closed=True, over_current=False)
    rig.wait(0.3)
    assert device.health() == Health(amplifier_enabled=False, switch_closed=True, over_current=True)
    with pytest.raises(Exception, match="the amplifier reported over-current"):
        play(device, 1)
    device.enable()
    assert device.health().over_current is False
    play(device, 1)


def test_a_mock_forgets_its_switch_with_no_power_cycle() -> None:
    device = MockDevice(VirtualClock(), limits=LIMITS)
    ready(device, 100.0)
    device.sense(Health(switch_closed=False))
    assert refusal(lambda: play(device, 1)) is Refusal.AMPLIFIER_OFF
    device.reset()
    ready(device, 100.0)
    assert refusal(lambda: play(device, 1)) is Refusal.AMPLIFIER_OFF
    device.sense(Health(switch_closed=True))
    play(device, 1)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Adc(gain=-1.0),
        lambda: Adc(loss=1.1),
        lambda: Adc(delay_us=float("nan")),
        lambda: Adc.parse("gain=1,gain=2"),
        lambda: Adc.parse("tap"),
        lambda: Amplifier(over_current_at_s=-1.0),
    ],
)
def test_what_no_amplifier_or_adc_can_be_is_refused(wrong: Any) -> None:
    with pytest.raises(ValueError, match=r"must be"):
        wrong()
