"""The drivers by name: made from settings, refused by the one that is missing."""

import os
from typing import Any

import pytest
from click.testing import CliRunner

from device import DriverSettings, Limits, LinkError, MonotonicClock, VirtualClock, make_device
from device.drivers import NEEDS, is_emulated
from device.emulate.lines import PtyLine
from device.wire.channels import SerialChannel
from tactstrip import main

LIMITS = Limits(ceiling_vpp=200.0, min_interval_s=0.02)
SETTINGS = {"port": "/no/such/port", "amplifier_gain": 20.0, "volts_full_scale": 110.0}


def needed(name: str, **others: Any) -> DriverSettings:
    needs: dict[str, Any] = {key: SETTINGS[key] for key in NEEDS[name]}
    return DriverSettings(limits=LIMITS, **needs | others)


@pytest.mark.parametrize("name", NEEDS)
def test_each_driver_is_made_from_what_it_needs_with_the_first_two_channels(name: str) -> None:
    device = make_device(name, needed(name), MonotonicClock())
    assert isinstance(device.cannot, tuple)
    with pytest.raises(ValueError, match=rf"channels .* driver {name}, got \[3, 4\]"):
        make_device(name, needed(name, channels=(3, 4)), MonotonicClock())


def test_a_driver_has_as_many_channels_as_it_is_given_up_to_those_of_its_kind() -> None:
    assert make_device("mock", needed("mock", channels=(1,)), VirtualClock()).open().channels == 1
    sixteen = tuple(range(1, 17))
    mock = make_device("mock", needed("mock", channels=sixteen), VirtualClock())
    assert mock.open().channels == 16
    make_device("generator", needed("generator", channels=(2,)), MonotonicClock())
    with pytest.raises(ValueError, match=r"\[1, 2\] .*generator"):
        make_device("generator", needed("generator", channels=sixteen), MonotonicClock())
    with pytest.raises(ValueError, match=r"channels must be .* 64"):
        make_device("mock", needed("mock", channels=tuple(range(1, 66))), VirtualClock())


@pytest.mark.parametrize(("name", "key"), [(name, key) for name in NEEDS for key in NEEDS[name]])
def test_a_setting_that_is_missing_is_named(name: str, key: str) -> None:
    settings = needed(name, **{key: None})
    with pytest.raises(ValueError, match=f"{key} .*{name}.* None"):
        make_device(name, settings, MonotonicClock())


def test_a_driver_that_does_not_exist_is_refused_with_all_that_do() -> None:
    with pytest.raises(ValueError, match=".*".join([*NEEDS, "gpib"])):
        make_device("gpib", DriverSettings(limits=LIMITS), VirtualClock())


def test_the_mock_plays_at_the_rate_it_is_given() -> None:
    settings = DriverSettings(limits=LIMITS, sample_rate_hz=96_000.0)
    mock = make_device("mock", settings, VirtualClock())
    assert mock.open().sample_rate_hz == 96_000.0


def test_a_driver_is_emulated_by_its_name_or_by_its_answer() -> None:
    assert is_emulated("mock", None)
    assert not is_emulated("audio", "card")
    for name in ("serial", "generator"):
        with pytest.raises(LinkError):
            is_emulated(name, "/no/such/port")


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are of POSIX")
def test_a_port_that_another_program_has_open_is_named() -> None:
    line = PtyLine()
    channel = SerialChannel(line.name, MonotonicClock())
    with pytest.raises(LinkError, match=f"^{line.name} is in use by another program$"):
        SerialChannel(line.name, MonotonicClock())
    channel.close()
    SerialChannel(line.name, MonotonicClock()).close()
    line.close()


WRONG_OPTIONS = [
    (["--pty", "--tcp", "0"], "--tcp"),
    (["--generator", "keysight", "--baud", "9600"], "--baud"),
    (["--generator", "keysight", "--fault", "drop=2"], "drop"),
    (["--generator", "keysight", "--amplifier-gain", "nan"], "amplifier_gain"),
    (["--amplifier-gain", "2"], "--amplifier-gain"),
    (["--fault", "drop=2"], "drop"),
    (["--fault", "nonsense"], "faults"),
    (["--fault", "stall=1,stall_s=1e30"], "stall_s"),
    (["--ceiling-vpp", "-1"], "ceiling_vpp"),
    (["--sample-rate-hz", "inf"], "sample_rate_hz"),
    (["--sample-rate-hz", "5000000"], "sample_rate_hz"),
    (["--serial-number", ""], "serial_number"),
    (["--serial-number", "12345678901234567"], "serial_number"),
    (["--serial-number", "a,b"], "serial_number"),
    (["--serial-number", "1", "--generator", "keysight"], "--serial-number"),
    (["--baud", "10"], "--baud"),
    (["--channels", "65"], "--channels"),
    (["--channels", "3", "--generator", "keysight"], "--channels"),
    (["--truth", "/no/such/folder/truth.jsonl"], "/no/such/folder/truth.jsonl"),
    (["--tcp", "65536"], "--tcp"),
    (["--adc", "tap=ear"], "adc"),
    (["--adc", "gain=-1"], "gain"),
    (["--switch-open", "--generator", "keysight"], "--switch-open"),
    (["--switch-stdin", "--generator", "keysight"], "--switch-stdin"),
    (["--over-current-at", "2", "--generator", "keysight"], "--over-current-at"),
]


@pytest.mark.parametrize(("options", "key"), WRONG_OPTIONS)
def test_what_cannot_be_emulated_is_one_line_with_its_key_and_exit_2(
    options: list[str], key: str
) -> None:
    result = CliRunner().invoke(main, ["emulate", *options])
    assert (result.exit_code, result.stdout) == (2, "")
    assert len(result.stderr.splitlines()) == 1
    assert key in result.stderr
