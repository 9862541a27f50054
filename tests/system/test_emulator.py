"""Emulators in processes of their own: bytes over a pty and TCP, and hosts that die."""

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pytest

from device.clock import MonotonicClock
from device.core.host import HostDriver
from device.driver import Outcome
from device.emulate.emulator import SERIAL_NUMBER
from device.errors import LinkError
from device.wire.channels import Channel, LineSettings, SocketChannel, open_channel
from device.wire.frames import MAKER
from device.wire.link import FrameLink
from device.wire.serial import identify, serial_device
from tests.test_device.bursts import BURST, SILENCE, play, ready
from tests.test_device.trials import LIMITS, QUICK, Trials

Emulate: TypeAlias = Callable[..., tuple[str, Path, int]]
Host: TypeAlias = Callable[[str], subprocess.Popen[str]]

LINES = pytest.mark.parametrize("kind", ["pty", "tcp"])
SOON_S = 20.0
AT_ZERO_WITHIN_S = 0.6
"""From a host's death to zero volts: the watchdog's 500 ms, and 100 ms for a busy machine."""


def link_to(port: str, *, answer_within_s: float = 0.025) -> FrameLink:
    clock = MonotonicClock()
    return FrameLink(lambda: open_channel(port, clock), clock, answer_within_s=answer_within_s)


def driver(link: FrameLink) -> HostDriver:
    return HostDriver(link, limits=LIMITS, clock=MonotonicClock())


def device_at(port: str) -> HostDriver:
    return driver(link_to(port))


def events(truth: Path) -> list[dict[str, Any]]:
    lines = truth.read_text(encoding="utf-8").splitlines(keepends=True)
    return [json.loads(line) for line in lines if line.endswith("\n")]


def wait_for(truth: Path, event: str, nth: int = 1) -> dict[str, Any]:
    """Return the first or nth event of a kind in the truth file, once it is there."""
    give_up_s = time.monotonic() + SOON_S
    while time.monotonic() < give_up_s:
        found = [fact for fact in events(truth) if fact["event"] == event]
        if len(found) >= nth:
            return found[nth - 1]
        time.sleep(0.005)
    pytest.fail(f"no {event!r} in {SOON_S} s: {events(truth)}")


def trials_on(link: FrameLink, seed: int) -> Trials:
    return Trials(link, MonotonicClock(), np.random.default_rng(seed), n_slots=1)


BAD_LINES = {
    "noise": ("drop=0.01,corrupt=0.01", 160),
    "duplicates, delays and stalls": (
        "duplicate=0.1,delay=0.1,delay_s=0.02,stall=0.02,stall_s=0.02",
        90,
    ),
    "resets and lost lines": ("reset=0.01,disconnect=0.01", 90),
}


@pytest.mark.process
@LINES
@pytest.mark.parametrize("name", BAD_LINES)
def test_what_the_host_says_over_a_real_line_is_what_was_emitted(
    emulate: Emulate, kind: str, name: str
) -> None:
    script, n_trials = BAD_LINES[name]
    port, truth, _ = emulate(kind, faults=script)
    trials = trials_on(link_to(port, answer_within_s=0.003), 1)
    for _ in range(n_trials):
        trials.trial()
        time.sleep(0.008)
    trials.device.close()
    counts = trials.check(events(truth))
    print(f"{kind}, {name}: {n_trials} trials, {dict(counts)}")
    if name != "resets and lost lines":
        assert counts["indeterminate"] <= 0.01 * n_trials


@pytest.mark.slow
def test_a_tcp_line_lost_at_any_byte_of_a_trial_leaves_no_trial_wrong(emulate: Emulate) -> None:
    counts: Counter[str] = Counter()
    ready_bytes = bytes_until_ready(emulate)
    for n_bytes in range(1, 200):
        port, truth, _ = emulate("tcp", faults=f"disconnect_at={ready_bytes + n_bytes}")
        trials = trials_on(link_to(port, answer_within_s=1.0), n_bytes)
        trials.trial()
        time.sleep(0.01)
        trials.trial()
        trials.device.close()
        counts += trials.check(events(truth))
    print(f"cut at every byte: {dict(counts)}")
    assert counts["fired"] > counts["lost"] > 0


def bytes_until_ready(emulate: Emulate) -> int:
    """Count what the line carries, both ways, before the first trial."""
    carried = [0]

    class Counting(SocketChannel):
        def write(self, data: bytes) -> None:
            carried[0] += len(data)
            super().write(data)

        def read(self, timeout_s: float) -> bytes:
            data = super().read(timeout_s)
            carried[0] += len(data)
            return data

    port, _, _ = emulate("tcp")
    link = FrameLink(lambda: Counting(port), MonotonicClock(), answer_within_s=1.0)
    trials_on(link, 1)
    until_ready = carried[0]
    link.hang_up()
    return until_ready


HOST = """
import sys, time
import numpy as np
from device.clock import MonotonicClock
from device.limits import Limits
from device.wire.serial import serial_device

burst = np.sin(2 * np.pi * np.arange(25) / 24)
burst[-1] = 0.0
limits = Limits(ceiling_vpp=200.0, least_interval_s=0.005)
device = serial_device(sys.argv[1], limits=limits, clock=MonotonicClock())
device.open()
device.load(0, burst, burst)
device.enable()
device.set_levels(100.0, 100.0)
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
    port, truth, pid = emulate(kind)
    host = host_on(port)
    host.send_signal(signal.SIGSTOP)
    stopped_s = time.monotonic()
    off = wait_for(truth, "off")
    took_s = monotonic_of(truth, off) - stopped_s
    print(f"{kind}: outputs at zero {took_s * 1e3:.0f} ms after the host stood still")
    assert off["cause"] == "watchdog"
    assert wait_for(truth, "watchdog")["t_s"] == off["t_s"]
    assert 0.35 < took_s <= AT_ZERO_WITHIN_S
    assert is_alive(pid)


@LINES
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_emulator_that_is_asked_to_end_puts_its_outputs_at_zero_first(
    emulate: Emulate, host_on: Host, kind: str, number: int
) -> None:
    port, truth, pid = emulate(kind)
    host_on(port)
    os.kill(pid, number)
    assert wait_for(truth, "off")["cause"] == "end"
    give_up_s = time.monotonic() + SOON_S
    while is_alive(pid) and time.monotonic() < give_up_s:
        time.sleep(0.01)
    assert not is_alive(pid)


@LINES
def test_a_port_has_one_host_and_the_second_is_refused(emulate: Emulate, kind: str) -> None:
    port, truth, _ = emulate(kind)
    first, second = device_at(port), device_at(port)
    ready(first, 100.0, burst=QUICK)
    with pytest.raises(LinkError):
        second.open()
    assert play(first, 1, within_s=5.0).outcome is Outcome.FIRED
    first.close()
    ready(second, burst=QUICK)
    second.close()
    assert [fact["token"] for fact in events(truth) if fact["event"] == "burst"] == [1]


def test_a_host_that_does_not_read_cannot_block_the_device(emulate: Emulate, host_on: Host) -> None:
    port, truth, pid = emulate("tcp")
    host_on(port).kill()
    wait_for(truth, "off")
    deaf = SocketChannel(port)
    for _ in range(2000):
        deaf.write(b"\0*IDN?\n" * 100)
    device = device_at(port)
    with pytest.raises(LinkError):
        device.open()
    deaf.close()
    assert is_alive(pid)
    ready(device, burst=QUICK)
    device.close()


def descriptors(pid: int) -> int:
    """Count the descriptors that a process holds."""
    folder = Path(f"/proc/{pid}/fd")
    if not folder.exists():
        pytest.skip("no /proc to count descriptors in")
    return len(list(folder.iterdir()))


class Kept:
    """Opens lines and keeps them, so that none is closed for want of a reference to it."""

    def __init__(self, port: str) -> None:
        self._port = port
        self._opened: list[Channel] = []

    def __call__(self) -> Channel:
        self._opened.append(open_channel(self._port, MonotonicClock()))
        return self._opened[-1]

    def device(self, patience_s: float = 2.0) -> HostDriver:
        line = LineSettings(patience_s=patience_s, opens_within_s=patience_s)
        return driver(FrameLink(self, MonotonicClock(), line=line))


@LINES
def test_a_host_that_comes_and_goes_leaves_no_descriptor_open(emulate: Emulate, kind: str) -> None:
    port, truth, pid = emulate(kind)
    kept = Kept(port)
    device = kept.device()
    before = descriptors(os.getpid())
    for n_hosts in range(1, 4):
        ready(device, burst=QUICK)
        device.close()
        wait_for(truth, "off", n_hosts)
        assert descriptors(os.getpid()) == before
    after_one = descriptors(pid)
    ready(device, burst=QUICK)
    assert descriptors(os.getpid()) > before
    with pytest.raises(LinkError):
        kept.device(patience_s=0.1).open()
    device.close()
    wait_for(truth, "off", 4)
    assert descriptors(os.getpid()) == before
    give_up_s = time.monotonic() + SOON_S
    while descriptors(pid) > after_one and time.monotonic() < give_up_s:
        time.sleep(0.01)  # the second host may be noticed only now
    assert descriptors(pid) <= after_one


@pytest.mark.process
def test_what_does_not_answer_has_no_identity_and_its_port_is_closed_again() -> None:
    ours, theirs = os.openpty()
    name = os.ttyname(theirs)
    os.close(theirs)
    try:
        kept = Kept(name)
        before = descriptors(os.getpid())
        assert identify(name) is None
        readable, _, _ = select.select([ours], [], [], 0.0)
        assert readable == [ours]  # it was asked
        for _ in range(3):
            with pytest.raises(LinkError):
                kept.device(patience_s=0.1).open()
            assert identify(name) is None
        assert descriptors(os.getpid()) == before
    finally:
        os.close(ours)


@LINES
def test_a_device_says_who_it_is_in_plain_text_and_in_frames(emulate: Emulate, kind: str) -> None:
    port, _, _ = emulate(kind)
    terminal = open_channel(port, MonotonicClock())
    terminal.write(b"*IDN?\r\n")
    said, give_up_s = b"", time.monotonic() + SOON_S
    while not said.endswith(b"\n") and time.monotonic() < give_up_s:
        said += terminal.read(0.1)
    terminal.close()
    assert said.decode().split(",")[::2][:2] == [MAKER, SERIAL_NUMBER]
    found = identify(port)
    assert found is not None
    identity, limits, health = found
    assert (identity.model, identity.emulated) == ("emulator", True)
    assert (limits.firmware, health.switch_closed) == ("tactstrip emulator", True)


def test_waiting_costs_an_emulator_little(emulate: Emulate) -> None:
    port, _, pid = emulate("pty")
    device = device_at(port)
    ready(device, burst=QUICK)
    before_s = spent_s(pid)
    time.sleep(2.0)
    assert spent_s(pid) - before_s < 1.0  # it sleeps between its ticks, however busy the machine
    device.close()


def spent_s(pid: int) -> float:
    """Return the processor time of a process."""
    stat = Path(f"/proc/{pid}/stat")
    if not stat.exists():
        pytest.skip("no /proc to read processor times from")
    user, system = stat.read_text().rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def test_a_modelled_baud_rate_takes_its_time(emulate: Emulate) -> None:
    port, _, _ = emulate("pty", baud=115_200)
    device = serial_device(port, limits=LIMITS, clock=MonotonicClock())
    device.open()
    began_s = time.monotonic()
    device.load(0, BURST, SILENCE)
    assert time.monotonic() - began_s >= 2 * BURST.size * 2 * 10 / 115_200  # 16 bits, 10 a byte
    device.close()
