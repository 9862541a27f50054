"""Boards that need more than the usual line: driven with the options, told of without them."""

import fcntl
import json
import time
from typing import Any

import pytest
from click.testing import CliRunner

from device.clock import MonotonicClock
from device.core.host import HostDriver
from device.driver import Outcome
from device.errors import LinkError
from device.wire.channels import LineSettings, SerialChannel
from device.wire.dialogue import too_slow, why_silent
from device.wire.serial import identify, serial_device
from tactstrip import main
from tests.system.boards import board, says
from tests.test_device.bursts import play, ready
from tests.test_device.trials import LIMITS, QUICK

pytestmark = pytest.mark.process


def device_on(port: str, **line: Any) -> HostDriver:
    settings = LineSettings(**line)
    return serial_device(port, limits=LIMITS, clock=MonotonicClock(), line=settings)


def why_not(port: str, **line: Any) -> str:
    """Return why a device cannot be opened."""
    with pytest.raises(LinkError) as error:
        device_on(port, **line).open()
    return str(error.value)


@pytest.mark.parametrize("baud", [9600, 1_000_000])
def test_a_board_of_another_rate_is_driven_at_its_rate(baud: int) -> None:
    with board(baud=baud) as (port, truth):
        device = device_on(port, baud=baud)
        ready(device, 100.0, burst=QUICK)
        for token in (1, 2, 3):
            felt = play(device, token, within_s=5.0)
            assert (felt.outcome, felt.retries) == (Outcome.FIRED, 0)
            time.sleep(0.3)  # beats have to get through between
        assert device.health().amplifier_enabled
        device.close()
        events = [json.loads(line) for line in truth.getvalue().splitlines()]
    assert [event["token"] for event in events if event["event"] == "burst"] == [1, 2, 3]
    assert "watchdog" not in {event["event"] for event in events}


@pytest.mark.parametrize("baud", [9600, 1_000_000])
def test_a_board_of_another_rate_is_asked_for_its_rate(baud: int) -> None:
    with board(baud=baud) as (port, _):
        told = why_not(port, opens_within_s=0.3)
    assert told.startswith("the device did not answer HELLO for 0.3 s")
    assert "where its rate is another than 115200, give device.baud" in told


def test_a_slow_wire_behind_an_adapter_is_called_slow_with_the_rate_that_it_has() -> None:
    with board(baud=9600, hidden=True) as (port, _):
        told = why_not(port)
        assert told.startswith("the line is too slow: a question and its answer took 1")
        assert "at device.baud = 115200 25 ms are allowed" in told
        assert "give device.baud = 9600, or let both ends have 57600 or more" in told
        ready(device := device_on(port, baud=9600), burst=QUICK)
        device.close()


def test_a_wire_that_is_slower_still_is_called_slow_with_its_rate_too() -> None:
    with board(baud=4800, hidden=True) as (port, _):
        told = why_not(port)
    assert "that is a line of about 4800 baud: give device.baud = 4800," in told


@pytest.mark.parametrize("delay_s", [0.016, 0.040])
def test_a_delay_on_a_line_of_the_right_rate_is_not_told_as_its_rate(delay_s: float) -> None:
    with board(baud=115_200, hidden=True, delay_s=delay_s) as (port, _):
        told = why_not(port)
    assert told.startswith("the line is too late: a question and its answer took ")
    delay_ms = int(told.split(" ms of it are a delay that no other rate mends")[0].split()[-1])
    assert 1e3 * delay_s - 3 <= delay_ms <= 1e3 * delay_s + 8
    assert "its latency timer 1 ms" in told
    assert "device.baud =" not in told.partition("are allowed")[2]


def test_a_slow_wire_that_loses_bytes_is_told_of_when_it_fails() -> None:
    with board(baud=9600, hidden=True, script="drop=0.005,corrupt=0.005") as (port, _):
        device = device_on(port)
        with pytest.raises(LinkError) as error:
            ready(device, burst=QUICK)
        device.close()
    assert "the line is too slow" in str(error.value)
    assert "give device.baud = 9600, or let both ends have 57600 or more" in str(error.value)


def test_a_board_that_starts_when_it_is_opened_is_waited_for() -> None:
    with board(baud=115_200, boots_for_s=2.0) as (port, _):
        ready(device := device_on(port, opens_within_s=5.0), burst=QUICK)
        device.close()


@pytest.mark.parametrize(
    ("boots_for_s", "told"),
    [
        (0.4, "it answers now, so that it took longer to start; let device.opens_within_s be more"),
        (5.0, "is it switched on? Where it starts anew whenever its port is opened, let device."),
    ],
)
def test_a_board_that_starts_slowly_is_told_of(boots_for_s: float, told: str) -> None:
    with board(baud=115_200, boots_for_s=boots_for_s) as (port, _):
        assert told in why_not(port, opens_within_s=0.3)


@pytest.mark.parametrize("dtr", [True, False])
def test_the_line_dtr_is_raised_or_kept_low_before_anything_is_sent(
    *, dtr: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    import serial.serialposix as posix

    asked: list[int] = []
    ioctl = fcntl.ioctl

    def noted(descriptor: int, request: int, *more: Any) -> Any:
        if request in {posix.TIOCMBIS, posix.TIOCMBIC} and more == (posix.TIOCM_DTR_str,):
            asked.append(request)
        return ioctl(descriptor, request, *more)

    monkeypatch.setattr(fcntl, "ioctl", noted)
    with says(b"") as port:
        SerialChannel(port, MonotonicClock(), LineSettings(dtr=dtr)).close()
    assert asked == [posix.TIOCMBIS if dtr else posix.TIOCMBIC]


def test_devices_lists_a_board_of_another_rate_by_that_rate() -> None:
    with board(baud=9600) as (port, _):
        for options, listed in (([], False), (["--baud", "9600"], True)):
            result = CliRunner().invoke(main, ["devices", port, *options])
            assert result.exit_code == 0, result.output
            assert (f"{port}  emulator 1" in result.stdout) == listed, result.stdout


def test_a_device_of_protocol_1_is_told_by_name_with_both_versions() -> None:
    with says(b"tactstrip,lab,7,protocol 1.0\n") as port:
        told = why_not(port, opens_within_s=0.3)
        with pytest.raises(LinkError, match="it speaks protocol 1"):
            identify(port)
    assert told == (
        "the device did not answer HELLO for 0.3 s: it speaks protocol 1.0 and this program 2.0; "
        "put firmware of protocol 2 on it"
    )


def test_a_device_that_says_our_protocol_and_answers_no_frame_is_not_called_slow_to_start() -> None:
    with says(b"tactstrip,lab,7,protocol 2.7\n") as port:
        told = why_not(port, opens_within_s=0.3)
    assert "it says that it speaks protocol 2.7, and answers text but no frames" in told
    assert "opens_within_s" not in told


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (b"\x01\n", "is it switched on?"),
        (b"\x01\x02\x03\x04\x05k\n", "is it switched on?"),
        (b"k\ntactstrip,lab,7,protocol 1.0\n", "it speaks protocol 1.0"),
    ],
)
def test_noise_is_not_told_as_an_answer(said: bytes, told: str) -> None:
    with says(said) as port:
        assert told in why_not(port, opens_within_s=0.3)


def test_what_is_no_device_of_ours_is_told_with_what_it_says() -> None:
    with says(b"RIGOL TECHNOLOGIES,DG1022\n") as port:
        told = why_not(port, opens_within_s=0.3)
    assert told.endswith("'RIGOL TECHNOLOGIES,DG1022' answers, which is no device of tactstrip")


@pytest.mark.parametrize(
    ("took_s", "baud", "told"),
    [
        (0.87, 115_200, "about 1200 baud"),
        (0.220, 9600, "about 4800 baud: give device.baud = 4800, or let both ends have 9600"),
        (0.06, 115_200, "have 57600 or more"),
    ],
)
def test_the_rate_that_would_do_follows_from_the_time_taken(
    took_s: float, baud: int, told: str
) -> None:
    line = LineSettings(baud=baud)
    assert told in too_slow(took_s, line.answer_within_s, baud)


def test_a_newer_major_version_is_named_too() -> None:
    told = why_silent("tactstrip,lab,7,protocol 3.1", opens_within_s=2.0, baud=115_200)
    assert told.startswith("it speaks protocol 3.1 and this program 2.0")
