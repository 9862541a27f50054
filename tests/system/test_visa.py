"""VISA: a generator over HiSLIP and a socket, through pyvisa's pure Python."""

from __future__ import annotations

import gc
import sys
import time
from typing import TYPE_CHECKING

import pytest

from device import (
    BurstDevice,
    DriverSettings,
    LinkError,
    MonotonicClock,
    Outcome,
    make_device,
)
from device.scpi.visa import instrument_lack, open_instrument
from tests.test_device.bursts import play, ready
from tests.test_device.buses import BUSES, Instrument
from tests.test_device.generators import GAIN, WAVE, lines, loading, opening, switching_on, trial
from tests.test_device.in_process import LIMITS

if TYPE_CHECKING:
    from collections.abc import Iterator

RESTED_S = 0.02


@pytest.fixture(params=BUSES)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def instrument(kind: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Instrument]:
    bus = Instrument(BUSES[kind](monkeypatch), gain=GAIN, reports=kind != "socket")
    yield bus
    bus.close()


@pytest.fixture
def device(instrument: Instrument, monkeypatch: pytest.MonkeyPatch) -> Iterator[BurstDevice]:
    monkeypatch.setattr("device.scpi.line.ScpiLine.__init__.__kwdefaults__", {"patience_s": 1.0})
    settings = DriverSettings(limits=LIMITS, port=instrument.name, amplifier_gain=GAIN)
    made = make_device("generator", settings, MonotonicClock())
    yield made
    made.close()


@pytest.fixture
def live(device: BurstDevice, instrument: Instrument) -> BurstDevice:
    ready(device, 60.0, burst=WAVE)
    instrument.received = b""
    return device


def outcome(device: BurstDevice, token: int, slot: int = 0) -> Outcome:
    time.sleep(RESTED_S)
    return play(device, token, slot).outcome


def test_a_session_byte_for_byte_and_line_feeds_in_a_block_end_nothing(
    device: BurstDevice, instrument: Instrument, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ready(device, 60.0, burst=WAVE).emulated
    assert outcome(device, 1) is outcome(device, 2, slot=1) is Outcome.FIRED
    assert instrument.received == b"".join(
        (
            *(opening(), loading(1, "T3"), loading(2, "T4"), switching_on()),
            *(trial("T3", "T2"), trial("T1", "T4")),
        )
    )
    assert [burst["levels_mv"] for burst in instrument.events("burst", 2)] == [
        [60_000, 0],
        [0, 60_000],
    ]
    device.close()
    assert instrument.received.endswith(lines("OUTP1 OFF", "OUTP2 OFF", "*OPC?"))
    assert capsys.readouterr() == ("", "")


def test_a_trigger_whose_answer_is_lost_is_indeterminate_and_never_sent_again(
    live: BurstDevice, instrument: Instrument
) -> None:
    def hold_back(message: bytes) -> None:
        instrument.holds_back |= message.endswith(b"*TRG\n*OPC?\n")

    instrument.on_message = hold_back
    began_s = time.monotonic()
    told = play(live, 1)
    assert told.outcome is Outcome.INDETERMINATE
    assert 1.0 <= time.monotonic() - began_s < 3.0
    assert live.fire(1) == told == live.query(1)
    assert instrument.received.count(b"*TRG") == 1
    instrument.on_message = lambda message: None
    assert outcome(live, 2) is Outcome.FIRED  # though the instrument reports the answer it lost
    assert instrument.received.count(b"*TRG") == 2
    assert len(instrument.events("burst", 2)) == 2


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
