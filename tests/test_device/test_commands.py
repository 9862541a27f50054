"""The commands `devices` and `emulate`, in processes of their own."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeAlias

import pytest
from click.testing import CliRunner

from device.clock import MonotonicClock
from device.limits import Limits
from device.wire.serial import identify, serial_device
from tactstrip import main

COMMAND = (sys.executable, "-c", "from tactstrip import main; main()", "emulate")
Start: TypeAlias = Callable[..., tuple[subprocess.Popen[str], str]]


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


@pytest.mark.process
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("options", [["--pty"], ["--tcp", "0", "--generator", "keysight"]])
def test_an_emulator_that_is_told_to_end_ends_well(
    options: list[str], number: signal.Signals, start: Start
) -> None:
    process, port = start(*options)
    assert port.startswith(("/dev/", "socket://127.0.0.1:"))
    os.kill(process.pid, number)
    assert process.wait() == 0


@pytest.mark.process
def test_an_emulator_is_what_its_options_say_and_started_again_the_same(start: Start) -> None:
    changed = (
        "--serial-number=B 7",
        "--ceiling-vpp=120",
        "--sample-rate-hz=96000",
        "--baud=1000000",
    )
    seen = [identify(start(*options)[1]) for options in ((), (), changed)]
    first, again, other = (found[0] for found in seen if found is not None)
    assert first.serial_number == again.serial_number
    assert first.boot_id != again.boot_id
    assert other.emulated
    told = other.serial_number, other.ceiling_vpp, other.sample_rate_hz
    assert told == ("B 7", 120.0, 96_000.0)


@pytest.mark.process
def test_a_truth_file_is_added_to(tmp_path: Path, start: Start) -> None:
    truth = tmp_path / "truth.jsonl"
    for count in (1, 2):
        process, port = start("--truth", str(truth))
        device = serial_device(port, limits=Limits(ceiling_vpp=200.0), clock=MonotonicClock())
        device.open()
        device.close()
        process.terminate()
        assert process.wait() == 0
        events = [json.loads(line) for line in truth.read_text(encoding="utf-8").splitlines()]
        assert [event["event"] for event in events].count("boot") == count


@pytest.mark.process
def test_devices_tells_who_answers_and_that_it_writes(start: Start) -> None:
    _, ours = start("--tcp", "0", "--switch-open")
    _, generator = start("--tcp", "0", "--generator", "keysight")
    nobody = "socket://127.0.0.1:1"
    result = CliRunner().invoke(main, ["devices", ours, generator, nobody])
    assert result.exit_code == 0, result.output
    assert "Each port is written to" in result.stdout.splitlines()[0]
    lines = [line for line in result.stdout.splitlines()[1:] if "  " in line]
    told = dict(line.split("  ", 1) for line in lines if not line.startswith(" "))
    reports = [line.strip() for line in lines if line.startswith(" ")]
    assert reports[0].startswith(
        "tactstrip emulator, 8 slots of 524288 samples together, rest 5 ms"
    )
    assert reports[0].endswith("boot id from the operating system")
    assert reports[1] == "amplifier disabled, safety switch open, over-current none"
    assert "(emulated), ceiling 200 Vpp, 48000 Hz" in told[ours]
    assert told[ours].endswith("--driver serial")
    assert told[generator].startswith("Keysight Technologies,33512B")
    assert told[nobody].startswith("cannot open")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--pty", "--tcp", "0"], "--pty and --tcp exclude each other"),
        (["--generator", "keysight", "--baud", "9600"], "--baud and --generator exclude"),
        (["--generator", "keysight", "--fault", "drop=2"], "drop must be"),
        (["--generator", "keysight", "--amplifier-gain", "nan"], "amplifier_gain must be"),
        (["--amplifier-gain", "2"], "--amplifier-gain and --generator need each other"),
        (["--fault", "drop=2"], "drop must be"),
        (["--fault", "nonsense"], "faults must be of"),
        (["--ceiling-vpp", "-1"], "ceiling_vpp must be"),
        (["--sample-rate-hz", "inf"], "sample_rate_hz must be"),
        (["--sample-rate-hz", "5000000"], "sample_rate_hz must be"),
        (["--fault", "stall=1,stall_s=1e30"], "stall_s must be"),
        (["--serial-number", ""], "serial_number must be"),
        (["--serial-number", "12345678901234567"], "serial_number must be"),
        (["--serial-number", "a,b"], "serial_number must be"),
        (["--serial-number", "1", "--generator", "keysight"], "--serial-number and --generator"),
        (["--baud", "10"], "--baud"),
        (["--truth", "/no/such/folder/truth.jsonl"], "/no/such/folder/truth.jsonl: No such file"),
        (["--tcp", "65536"], "--tcp"),
        (["--adc", "tap=ear"], "adc must be of"),
        (["--adc", "gain=-1"], "gain must be"),
        (["--switch-open", "--generator", "keysight"], "--switch-open and --generator exclude"),
        (["--switch-stdin", "--generator", "keysight"], "--switch-stdin and --generator exclude"),
        (["--over-current-at", "2", "--generator", "keysight"], "--over-current-at and"),
    ],
)
def test_what_cannot_be_emulated_is_one_line_and_exit_2(options: list[str], told: str) -> None:
    result = CliRunner().invoke(main, ["emulate", *options])
    assert result.exit_code == 2
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert told in result.stderr


@pytest.mark.process
def test_a_port_that_is_taken_is_one_line(start: Start) -> None:
    _, port = start("--tcp", "0")
    result = CliRunner().invoke(main, ["emulate", "--tcp", port.rsplit(":", 1)[1]])
    assert result.exit_code == 2
    assert "in use" in result.stderr
