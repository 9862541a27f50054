"""What several test files need."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from typing import IO, TYPE_CHECKING, TypeAlias

import pytest
from hypothesis import settings

from experiment.study import study_from_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from experiment.study import Study

    Emulate: TypeAlias = Callable[..., tuple[str, Path, int]]

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile("repeatable")
"""The same examples in every run; ``--hypothesis-profile=explore`` looks for new ones."""

QUICK_BURST = """
[burst]
window = "hann"
"""
"""What it does at the other finger is computed quickest: it ends without a jump."""
EMULATORS = """
import json, os, signal, sys
import numpy as np
from device.clock import MonotonicClock
from device.emulator import Emulator, Nature
from device.faults import Faults, FaultScript
from device.limits import Limits
from device.lines import PtyLine, TcpLine
from device.output import OutputStage
from device.truth import Truth

signal.signal(signal.SIGCHLD, signal.SIG_IGN)
for order in sys.stdin:
    wish = json.loads(order)
    if os.fork():
        continue
    os.setsid()
    nature = Nature(
        limits=Limits(ceiling_vpp=200.0, least_interval_s=wish["least_interval_s"]),
        output=OutputStage(sample_rate_hz=wish["sample_rate_hz"]),
        baud=wish["baud"],
    )
    line = PtyLine() if wish["kind"] == "pty" else TcpLine(0)
    faults = Faults(FaultScript.parse(wish["faults"]), np.random.default_rng(wish["seed"]))
    with open(wish["truth"], "w", encoding="utf-8") as file:
        truth = Truth(file, volts=wish["volts"])
        emulator = Emulator(line, nature, faults, truth, MonotonicClock())
        print(json.dumps([line.name, os.getpid()]), flush=True)
        emulator.run()
    os._exit(0)
"""
"""A process that forks one emulator for each line it reads: starting Python each time is slow."""

SHORT_DESIGN = """
[design]
levels_vpp = [80, 160]
trials_per_side = 2
both_trials = 1
break_every = 3
foreperiod_s = [0.01, 0.02]
"""


@pytest.fixture
def short_study_text() -> str:
    """A study file of five trials in two blocks."""
    return SHORT_DESIGN


@pytest.fixture
def quick_study_text(short_study_text: str) -> str:
    """The same with a burst whose displacements are computed in a moment."""
    return QUICK_BURST + short_study_text


@pytest.fixture
def make_study() -> Callable[[str], Study]:
    """A study from the text of a study file; what the text leaves out is the paper's protocol."""
    return lambda text: study_from_text(text, "study.toml")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add where real hardware is."""
    parser.addoption(
        "--device-url",
        help="port or URL of a real device: tests/test_device_contract.py drives it too. "
        "Its outputs go up to 200 Vpp: nobody may touch the plate.",
    )


@pytest.fixture(scope="session")
def emulator_server() -> Iterator[subprocess.Popen[str]]:
    """A process that starts emulators."""
    command = [sys.executable, "-c", EMULATORS]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as server:
        yield server
        assert server.stdin is not None
        server.stdin.close()


@pytest.fixture
def emulate(emulator_server: subprocess.Popen[str], tmp_path: Path) -> Iterator[Emulate]:
    """Start an emulator behind a "pty" or "tcp" line: its port, truth file and process id."""
    pids: list[int] = []

    def start(
        kind: str,
        *,
        faults: str = "",
        seed: int = 1,
        baud: int | None = None,
        volts: bool = False,
        sample_rate_hz: float = 48_000.0,
        least_interval_s: float = 0.005,
    ) -> tuple[str, Path, int]:
        truth = tmp_path / f"truth-{len(pids)}.jsonl"
        wish = {
            "kind": kind,
            "faults": faults,
            "seed": seed,
            "baud": baud,
            "volts": volts,
            "sample_rate_hz": sample_rate_hz,
            "least_interval_s": least_interval_s,
            "truth": str(truth),
        }
        print(json.dumps(wish), file=_pipe(emulator_server.stdin), flush=True)
        port, pid = json.loads(_pipe(emulator_server.stdout).readline())
        pids.append(pid)
        return port, truth, pid

    yield start
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def _pipe(pipe: IO[str] | None) -> IO[str]:
    assert pipe is not None
    return pipe
