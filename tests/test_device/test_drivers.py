"""The drivers by name: made from settings, refused by the one that is missing."""

from typing import Any

import pytest

import device
from device.clock import MonotonicClock, VirtualClock
from device.core.host import HostDriver
from device.drivers import NEEDS, DriverSettings, is_emulated, make_device
from device.emulate.mock import MockDevice
from device.errors import LinkError
from device.limits import Limits
from device.scpi.generator import GeneratorDevice
from device.sound.audio import AudioDevice

LIMITS = Limits(ceiling_vpp=200.0, least_interval_s=0.02)
SETTINGS = {"port": "/no/such/port", "amplifier_gain": 20.0, "volts_full_scale": 110.0}
KINDS = {
    "mock": MockDevice,
    "serial": HostDriver,
    "generator": GeneratorDevice,
    "audio": AudioDevice,
}


def needed(name: str, **others: Any) -> DriverSettings:
    needs: dict[str, Any] = {key: SETTINGS[key] for key in NEEDS[name]}
    return DriverSettings(limits=LIMITS, **needs | others)


@pytest.mark.parametrize("name", NEEDS)
def test_each_driver_is_made_from_what_it_needs(name: str) -> None:
    made = make_device(name, needed(name), MonotonicClock())
    assert type(made) is KINDS[name]


@pytest.mark.parametrize("name", NEEDS)
def test_a_built_in_driver_has_the_first_two_channels(name: str) -> None:
    with pytest.raises(ValueError, match=rf"channels must be \[1, 2\] for the driver {name}, got"):
        make_device(name, needed(name, channels=(3, 4)), MonotonicClock())


@pytest.mark.parametrize(("name", "key"), [(name, key) for name in NEEDS for key in NEEDS[name]])
def test_a_setting_that_is_missing_is_named(name: str, key: str) -> None:
    settings = needed(name, **{key: None})
    with pytest.raises(ValueError, match=f"{key} must be given for the driver {name}, got None"):
        make_device(name, settings, MonotonicClock())


def test_a_driver_that_does_not_exist_is_refused_with_the_list() -> None:
    with pytest.raises(ValueError, match="mock, serial, generator, audio; got 'gpib'"):
        make_device("gpib", DriverSettings(limits=LIMITS), VirtualClock())


def test_the_mock_plays_at_the_rate_it_is_given() -> None:
    settings = DriverSettings(limits=LIMITS, sample_rate_hz=96_000.0)
    mock = device.make_device("mock", settings, VirtualClock())
    assert mock.open().sample_rate_hz == 96_000.0


def test_what_is_emulated_is_told_by_name_or_asked() -> None:
    assert is_emulated("mock", None)
    assert not is_emulated("audio", "card")
    for name in ("serial", "generator"):
        with pytest.raises(LinkError):
            is_emulated(name, "/no/such/port")
