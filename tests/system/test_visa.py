"""VISA: a generator over HiSLIP and a socket, through pyvisa's pure Python."""

from __future__ import annotations

import gc
import sys
from typing import TYPE_CHECKING

import pytest

from device import DriverSettings, LinkError, MonotonicClock, Outcome, make_device
from device.scpi.visa import instrument_lack, open_instrument
from tests.test_device.bursts import play, ready
from tests.test_device.buses import BUSES, Instrument
from tests.test_device.generators import GAIN, WAVE, lines, loading, opening, switching_on, trial
from tests.test_device.in_process import LIMITS

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(params=BUSES)
def instrument(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Instrument]:
    bus = Instrument(BUSES[request.param](monkeypatch), gain=GAIN)
    yield bus
    bus.close()


def test_a_session_byte_for_byte_and_line_feeds_in_a_block_end_nothing(
    instrument: Instrument, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = DriverSettings(limits=LIMITS, port=instrument.name, amplifier_gain=GAIN)
    clock = MonotonicClock()
    device = make_device("generator", settings, clock)
    assert ready(device, 60.0, burst=WAVE).emulated
    for token, slot in ((1, 0), (2, 1)):
        clock.wait(0.02)
        assert play(device, token, slot).outcome is Outcome.FIRED
    assert instrument.received == b"".join(
        (
            *(opening(), loading(1, "T3"), loading(2, "T4"), switching_on()),
            *(trial("T3", "T2"), trial("T1", "T4")),
        )
    )
    levels_mv = [burst["levels_mv"] for burst in instrument.events("burst", 2)]
    assert levels_mv == [[60_000, 0], [0, 60_000]]
    device.close()
    assert instrument.received.endswith(lines("OUTP1 OFF", "OUTP2 OFF", "*OPC?"))
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    "port",
    [
        "visa:nothing",
        "visa:TCPIP::127.0.0.1,1::INSTR",
        "visa:TCPIP::a..b::INSTR",
        "VISA:usb0::0x0957::0x2C07::NONE::INSTR",
        "USB0::0x0957::0x2C07::MY1::INSTR",
    ],
)
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # pyvisa-py forgets what it cannot connect
def test_what_cannot_be_opened_is_one_line_with_its_port(port: str) -> None:
    with pytest.raises(LinkError, match=f"^[^\n]*{port}: [^\n]*$"):
        open_instrument(port, MonotonicClock())
    gc.collect()


@pytest.mark.parametrize(
    ("module", "package", "port"),
    [
        ("pyvisa", "pyvisa", "visa:TCPIP::h::INSTR"),
        ("pyvisa_py", "pyvisa-py", "visa:TCPIP::h::INSTR"),
        ("usb", "pyusb", "visa:USB0::1::2::3::INSTR"),
    ],
)
def test_a_missing_package_is_reported_with_its_extra(
    module: str, package: str, port: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert instrument_lack(port) is None
    monkeypatch.setitem(sys.modules, module, None)
    lack = instrument_lack(port)
    assert lack is not None
    assert lack.what == package
    assert "[visa]" in str(lack)
