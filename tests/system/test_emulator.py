"""Emulators in processes of their own: their options, bytes over a pty and TCP, hosts that die."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest

from device import LinkError, Outcome
from device.wire.serial import identify
from tests.test_device.bursts import play, ready
from tests.test_device.trials import QUICK, device_at

if TYPE_CHECKING:
    from tests.conftest import Run

Emulate: TypeAlias = Callable[..., tuple[str, Path, int]]
Host: TypeAlias = Callable[[str], subprocess.Popen[str]]
Start: TypeAlias = Callable[..., tuple[subprocess.Popen[str], str]]

LINES = pytest.mark.parametrize("kind", ["pty", "tcp"])
SOON_S = 20.0
AT_ZERO_WITHIN_S = 0.6
"""From a host's death to zero volts: the watchdog's 500 ms, and 100 ms for the processes."""
TRIES = 3
"""Measurements of one time: whatever else runs can only lengthen it, so the least counts."""


def events(truth: Path) -> list[dict[str, Any]]:
    lines = truth.read_text(encoding="utf-8").splitlines(keepends=True)
    return [json.loads(line) for line in lines if line.endswith("\n")]


def wait_for(truth: Path, event: str, nth: int = 1) -> dict[str, Any]:
    """Return the first or nth event of a kind in the truth file, once it is there."""
    give_up_s = time.monotonic() + SOON_S
    while time.monotonic() < give_up_s:
        facts = [fact for fact in events(truth) if fact["event"] == event]
        if len(facts) >= nth:
            return facts[nth - 1]
        time.sleep(0.005)
    pytest.fail(f"no {event!r} in {SOON_S} s: {events(truth)}")


HOST = """
import sys, time
import numpy as np
from device import DriverSettings, Limits, MonotonicClock, make_device

burst = np.sin(2 * np.pi * np.arange(25) / 24)
burst[-1] = 0.0
limits = Limits(ceiling_vpp=200.0, min_interval_s=0.005)
settings = DriverSettings(limits=limits, port=sys.argv[1])
device = make_device("serial", settings, MonotonicClock())
device.open()
device.load(0, np.stack([burst, burst]))
device.enable()
device.set_levels([100.0, 100.0])
device.arm(1, 0, time_to_live_s=10.0)
print("armed", flush=True)
time.sleep(600)
"""


@pytest.fixture
def host_on() -> Iterator[Host]:
    """Start a host that arms a token and then does nothing but beat."""
    with ExitStack() as hosts:

        def start(port: str) -> subprocess.Popen[str]:
            command = [sys.executable, "-c", HOST, port]
            process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
            host = hosts.enter_context(process)
            hosts.callback(host.kill)
            assert host.stdout is not None
            assert host.stdout.readline() == "armed\n"
            return host

        yield start


def monotonic_of(truth: Path, fact: dict[str, Any]) -> float:
    """Return when something happened on the machine's clock."""
    return float(wait_for(truth, "boot")["began_s"] + fact["t_s"])


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@LINES
def test_a_killed_host_leaves_a_device_that_survives_with_its_outputs_at_zero(
    emulate: Emulate, host_on: Host, kind: str
) -> None:
    port, truth, pid = emulate(kind)
    host = host_on(port)
    killed_s = time.monotonic()
    host.kill()
    off = wait_for(truth, "off")
    took_s = monotonic_of(truth, off) - killed_s
    print(f"{kind}: outputs at zero {took_s * 1e3:.1f} ms after kill -9")
    assert off["cause"] == "line"
    assert took_s <= AT_ZERO_WITHIN_S
    assert is_alive(pid)
    device = device_at(port)
    ready(device, burst=QUICK)
    assert device.query(1).outcome is Outcome.NOT_FIRED
    device.close()


@LINES
def test_a_host_that_stands_still_is_noticed_by_the_watchdog(
    emulate: Emulate, host_on: Host, kind: str
) -> None:
    times_s: list[float] = []
    while len(times_s) < TRIES and min(times_s, default=math.inf) > AT_ZERO_WITHIN_S:
        port, truth, pid = emulate(kind)
        host = host_on(port)
        host.send_signal(signal.SIGSTOP)
        stopped_s = time.monotonic()
        off = wait_for(truth, "off")
        times_s.append(monotonic_of(truth, off) - stopped_s)
        print(f"{kind}: outputs at zero {times_s[-1] * 1e3:.0f} ms after the host stood still")
        assert off["cause"] == "watchdog"
        assert wait_for(truth, "watchdog")["t_s"] == off["t_s"]
        assert is_alive(pid)
    assert 0.35 < min(times_s) <= AT_ZERO_WITHIN_S


@LINES
def test_a_port_has_one_host_and_the_second_is_refused(emulate: Emulate, kind: str) -> None:
    port, truth, _ = emulate(kind)
    first, second = device_at(port), device_at(port)
    ready(first, 100.0, burst=QUICK)
    with pytest.raises(LinkError, match="is in use by another program" if kind == "pty" else port):
        second.open()
    assert play(first, 1, within_s=5.0).outcome is Outcome.FIRED
    first.close()
    ready(second, burst=QUICK)
    second.close()
    assert [fact["token"] for fact in events(truth) if fact["event"] == "burst"] == [1]


def test_what_does_not_answer_has_no_identity_and_is_left_alone() -> None:
    ours, theirs = os.openpty()
    name = os.ttyname(theirs)
    os.close(theirs)
    assert identify(name) is None
    with pytest.raises(LinkError):
        device_at(name, response_timeout_s=0.1).open()
    assert os.read(ours, 100)  # it was asked
    os.close(ours)


COMMAND = (sys.executable, "-c", "from tactstrip import main; main()", "emulate")


@pytest.fixture
def start() -> Iterator[Start]:
    processes: list[subprocess.Popen[str]] = []

    def started(*options: str) -> tuple[subprocess.Popen[str], str]:
        process = subprocess.Popen([*COMMAND, *options], stdout=subprocess.PIPE, text=True)
        processes.append(process)
        assert process.stdout is not None
        return process, process.stdout.readline().strip()

    yield started
    for process in processes:
        process.kill()
        process.wait()
        assert process.stdout is not None
        process.stdout.close()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("options", [["--pty"], ["--tcp", "0", "--generator", "keysight"]])
def test_an_emulator_that_has_a_signal_to_end_ends_well(
    options: list[str], number: signal.Signals, start: Start
) -> None:
    process, port = start(*options)
    assert port.startswith(("/dev/", "socket://127.0.0.1:"))
    os.kill(process.pid, number)
    assert process.wait() == 0


def test_an_emulator_is_what_its_options_say_and_started_again_the_same(start: Start) -> None:
    changed = (
        "--serial-number=B 7",
        "--ceiling-vpp=120",
        "--sample-rate-hz=96000",
        "--baud=1000000",
    )
    answers = [identify(start(*options)[1]) for options in ((), (), changed)]
    first, again, third = (answer[0] for answer in answers if answer is not None)
    assert first.serial_number == again.serial_number
    assert first.boot_id != again.boot_id
    assert third.emulated
    facts = third.serial_number, third.ceiling_vpp, third.sample_rate_hz
    assert facts == ("B 7", 120.0, 96_000.0)


def test_devices_lists_who_answers_on_each_port(start: Start, run: Run) -> None:
    _, ours = start("--tcp", "0", "--switch-open")
    _, generator = start("--tcp", "0", "--generator", "keysight")
    nobody = "socket://127.0.0.1:1"
    result = run("devices", ours, generator, nobody)
    assert result.exit_code == 0, result.output
    lines = [line for line in result.stdout.splitlines() if "  " in line]
    answers = dict(line.split("  ", 1) for line in lines if not line.startswith(" "))
    assert {"200", "48000"} <= set(answers[ours].split())
    assert answers[ours].endswith("--driver serial")
    assert answers[generator].startswith("Keysight Technologies,33512B")
    assert "Keysight" not in answers[nobody]
    assert len([line for line in lines if line.startswith(" ")]) == 2
