"""VISA: a generator over HiSLIP, VXI-11, USBTMC and a socket, through pyvisa's pure Python."""

from __future__ import annotations

import gc
import sys
import threading
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest

from device.clock import MonotonicClock
from device.driver import Outcome, installing
from device.emulate.generator import IDENTITY
from device.errors import LinkError, SettingError
from device.scpi.generator import GeneratorDevice, generator_device, identify_generator
from device.scpi.line import ScpiLine
from device.scpi.visa import instrument_lack, open_instrument
from tests.test_device.bursts import play, ready, refusal
from tests.test_device.buses import BUSES, INTERRUPTED, Instrument
from tests.test_device.in_process import LIMITS
from tests.test_device.transcripts import GAIN, WAVE, lines, loading, opening, switching_on, trial

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.process

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
def device(instrument: Instrument, monkeypatch: pytest.MonkeyPatch) -> Iterator[GeneratorDevice]:
    monkeypatch.setattr(ScpiLine.__init__, "__kwdefaults__", {"patience_s": 1.0})
    made = generator_device(
        instrument.name,
        limits=LIMITS,
        clock=MonotonicClock(),
        amplifier_gain=GAIN,
        sample_rate_hz=48_000.0,
    )
    yield made
    made.close()


@pytest.fixture
def live(device: GeneratorDevice, instrument: Instrument) -> GeneratorDevice:
    ready(device, 60.0, burst=WAVE)
    instrument.received = b""
    return device


def outcome(device: GeneratorDevice, token: int, slot: int = 0) -> Outcome:
    time.sleep(RESTED_S)
    return play(device, token, slot).outcome


def test_a_session_byte_for_byte_and_line_feeds_in_a_block_end_nothing(
    device: GeneratorDevice, instrument: Instrument, capsys: pytest.CaptureFixture[str]
) -> None:
    assert identify_generator(instrument.name) == IDENTITY
    instrument.received = b""
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
    live: GeneratorDevice, instrument: Instrument
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


@pytest.mark.parametrize("kind", ["hislip"], indirect=True)
def test_an_interrupted_question_that_is_not_ours_is_told(
    live: GeneratorDevice, instrument: Instrument
) -> None:
    assert outcome(live, 1) is Outcome.FIRED
    instrument._emulator._generator._fail(INTERRUPTED)
    with pytest.raises(SettingError, match="INTERRUPTED"):
        play(live, 2)
    assert len(instrument.events("burst", 1)) == 1


def test_a_bus_that_is_cut_with_the_trigger_leaves_it_open(
    kind: str, live: GeneratorDevice, instrument: Instrument
) -> None:
    def cut(message: bytes) -> None:
        if b"*TRG" in message:
            instrument.holds_back = True
            instrument.drop()

    instrument.on_message = cut
    assert outcome(live, 1) is Outcome.INDETERMINATE
    with pytest.raises(LinkError):
        play(live, 2)
    assert instrument.received.count(b"*TRG") == 1
    assert len(instrument.events("burst", 1)) == 1


def test_a_stop_from_another_thread_waits_for_no_answer(
    live: GeneratorDevice, instrument: Instrument
) -> None:
    long = np.append(np.tile(WAVE[:-1], 6000), 0.0)  # 0.9 s
    live.load(2, long, 0 * long)
    told: list[float] = []

    def stop() -> None:
        time.sleep(0.2)
        began_s = time.monotonic()
        live.stop()
        told.append(time.monotonic() - began_s)

    def stop_later(message: bytes) -> None:
        if message.endswith(b"*TRG\n*OPC?\n"):
            stopper.start()

    stopper = threading.Thread(target=stop)
    instrument.on_message = stop_later
    assert outcome(live, 1, slot=2) is Outcome.INDETERMINATE
    stopper.join()
    assert told[0] < 0.3
    (burst,) = instrument.events("burst", 1)
    assert burst["cut"]
    assert len(instrument.events("off", 1)) == 1
    refusal(lambda: play(live, 2))


@pytest.mark.parametrize(
    ("port", "said"),
    [
        ("visa:nothing", "VI_ERROR_INV_RSRC_NAME"),
        ("visa:TCPIP::127.0.0.1,1::INSTR", "refused"),
        ("visa:TCPIP::a..b::INSTR", "label empty"),
        ("VISA:usb0::0x0957::0x2C07::NONE::INSTR", "No device found"),
        ("USB0::0x0957::0x2C07::MY1::INSTR", "written visa:USB0::0x0957::0x2C07::MY1::INSTR"),
    ],
)
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # pyvisa-py forgets what it cannot connect
def test_what_cannot_be_opened_is_said_in_a_line(port: str, said: str) -> None:
    with pytest.raises(LinkError, match=f"^cannot open {port}: [^\n]*{said}[^\n]*$"):
        open_instrument(port, MonotonicClock())
    gc.collect()


@pytest.mark.parametrize(
    ("module", "what", "port"),
    [
        ("pyvisa", "pyvisa", "visa:TCPIP::h::INSTR"),
        ("pyvisa_py", "pyvisa-py", "visa:TCPIP::h::INSTR"),
        ("usb", "pyusb", "visa:USB0::1::2::3::INSTR"),
    ],
)
def test_what_is_missing_is_said_with_its_remedy(
    module: str, what: str, port: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert instrument_lack(port) is None
    monkeypatch.setitem(sys.modules, module, None)
    assert str(instrument_lack(port)) == f"{what} is missing: {installing('visa')}"


def test_another_library_is_taken_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYVISA_LIBRARY", "@another")
    with pytest.raises(LinkError, match="pyvisa_another"):
        open_instrument("visa:TCPIP::127.0.0.1::INSTR", MonotonicClock())
