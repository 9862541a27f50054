"""Boards that need more than the usual line: driven with their keys, refused by them without."""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING, Any

import pytest

from device import LinkError, Outcome
from device.wire.serial import identify
from tests.system.boards import board, says
from tests.test_device.bursts import play, ready
from tests.test_device.trials import QUICK, device_at

if TYPE_CHECKING:
    from tests.conftest import Run


def why_not(port: str, **line: Any) -> str:
    """Return why a device cannot be opened."""
    with pytest.raises(LinkError) as error:
        device_at(port, **line).open()
    return str(error.value)


@pytest.mark.parametrize("baud", [9600, 1_000_000])
def test_a_board_of_another_rate_is_driven_at_its_rate_and_refused_at_another(baud: int) -> None:
    with board(baud=baud) as (port, truth):
        assert "device.baud" in why_not(port, open_timeout_s=0.3)
        device = device_at(port, baud=baud)
        ready(device, 100.0, burst=QUICK)
        for token in (1, 2, 3):
            delivery = play(device, token, within_s=5.0)
            assert (delivery.outcome, delivery.retries) == (Outcome.FIRED, 0)
            time.sleep(0.3)  # beats have to get through between
        assert device.health().amplifier_enabled
        device.close()
        events = [json.loads(line) for line in truth.getvalue().splitlines()]
    assert [event["token"] for event in events if event["event"] == "burst"] == [1, 2, 3]
    assert "watchdog" not in {event["event"] for event in events}


def test_a_board_that_starts_when_it_is_opened_is_waited_for_as_long_as_is_set() -> None:
    with board(baud=115_200, boots_for_s=2.0) as (port, _):
        assert "device.open_timeout_s" in why_not(port, open_timeout_s=0.3)
        ready(device := device_at(port, open_timeout_s=5.0), burst=QUICK)
        device.close()


def test_devices_lists_a_board_of_another_rate_by_that_rate(run: Run) -> None:
    with board(baud=9600) as (port, _):
        for options, listed in (([], False), (["--baud", "9600"], True)):
            result = run("devices", port, *options)
            assert result.exit_code == 0, result.output
            assert ("--driver serial" in result.stdout) == listed, result.stdout


@pytest.mark.parametrize(
    ("answer", "parts"),
    [
        (b"tactstrip,lab,7,protocol 1.0\n", ("1.0", "2.0")),
        (b"tactstrip,lab,7,protocol 3.1\n", ("3.1", "2.0")),
        (b"tactstrip,lab,7,protocol 2.7\n", ("2.7",)),
        (b"k\ntactstrip,lab,7,protocol 1.0\n", ("1.0", "2.0")),
        (b"RIGOL TECHNOLOGIES,DG1022\n", ("RIGOL", "DG1022")),
        (b"\x01\n", ("open_timeout_s",)),
        (b"\x01\x02\x03\x04\x05k\n", ("open_timeout_s",)),
    ],
)
def test_what_is_no_device_of_ours_is_refused_with_what_it_says(
    answer: bytes, parts: tuple[str, ...]
) -> None:
    with says(answer) as port:
        error = why_not(port, open_timeout_s=0.3)
        if b"tactstrip" in answer[:9]:
            with pytest.raises(LinkError, match=parts[0]):
                identify(port)
    assert [part for part in parts if part not in error] == []
    assert ("open_timeout_s" in error) == (parts[0] == "open_timeout_s")
