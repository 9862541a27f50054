"""What the line to a device costs: ping, fire, upload, the heartbeat, and sessions over it."""

from __future__ import annotations

import contextlib
import csv
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from device.clock import MonotonicClock
from device.core.host import HostDriver
from device.core.messages import Ping
from device.limits import Limits
from device.wire.channels import LineSettings, open_channel
from device.wire.link import FrameLink
from tests.plates import PAPER_PLATE

if TYPE_CHECKING:
    from collections.abc import Iterator

REPEATS = 100
IDLE_S = 5.0
BAUD = 115_200
LONG_SAMPLES = 57_601
"""1.2 s at 48 kHz."""
RATES = (BAUD, 1_000_000)
COMMAND = (sys.executable, "-c", "from tactstrip import main; main()")
STUDY = f"""{PAPER_PLATE}
[burst]
window = "hann"
[device]
min_interval_s = 0.01
[design]
foreperiod_s = [0.01, 0.02]
trials_per_side = 20
min_break_s = 0
[simulation]
reaction_time_s = 0.151
reaction_time_spread = 0
"""


@contextlib.contextmanager
def emulator(*options: str) -> Iterator[str]:
    """Run an emulator and give its port."""
    command = [*COMMAND, "emulate", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Times:
    ping_s: float
    fire_s: float
    upload_s: float
    beating: float
    """Share of one processor that an idle host needs for its heartbeat."""


def _times(port: str) -> _Times:
    clock = MonotonicClock()
    link = FrameLink(lambda: open_channel(port, clock), clock)
    device = HostDriver(link, limits=Limits(ceiling_vpp=200.0, min_interval_s=0.005), clock=clock)
    sine = np.sin(2 * np.pi * np.arange(97) / 96)
    sine[-1] = 0.0
    device.open()
    began = time.perf_counter()
    device.load(0, np.stack([sine, sine]))
    upload_s = time.perf_counter() - began
    device.enable()
    device.set_levels([100.0, 100.0])
    pings, fires = [], []
    for token in range(1, REPEATS + 1):
        began = time.perf_counter()
        link.exchange(Ping())
        pings.append(time.perf_counter() - began)
        device.arm(token, 0, time_to_live_s=1.0)
        began = time.perf_counter()
        device.fire(token)
        fires.append(time.perf_counter() - began)
        time.sleep(0.01)
    began_cpu = time.process_time()
    time.sleep(IDLE_S)
    beating = (time.process_time() - began_cpu) / IDLE_S
    device.close()
    return _Times(ping_s=median(pings), fire_s=median(fires), upload_s=upload_s, beating=beating)


def _long_upload_s(port: str, baud: int) -> float:
    """Return how long the upload of a long burst takes."""
    clock, line = MonotonicClock(), LineSettings(baud=baud)
    link = FrameLink(lambda: open_channel(port, clock, line), clock, line=line)
    device = HostDriver(link, limits=Limits(ceiling_vpp=200.0), clock=clock)
    sine = np.sin(2 * np.pi * 600 * np.arange(LONG_SAMPLES) / (LONG_SAMPLES - 1))
    sine[-1] = 0.0
    device.open()
    began = time.perf_counter()
    device.load(0, np.stack([sine, sine]))
    took_s = time.perf_counter() - began
    device.close()
    return took_s


def _long_words(baud: int) -> str:
    with emulator("--pty", "--baud", str(baud)) as port:
        took_s = _long_upload_s(port, baud)
    octets = 2 * 2 * LONG_SAMPLES
    least_s = 10 * octets * 57 / 32 / baud
    return f"{took_s:.1f} and {least_s:.1f} s at {baud}"


def _trial_s(folder: Path, port: str) -> tuple[float, float]:
    """Return seconds per trial of `run`, and those that foreperiod and answer take of them."""
    study = folder / "study.toml"
    study.write_text(STUDY, encoding="utf-8")
    options = ["--participant", "01", "--responder", "simulated", "--out", str(folder / "out")]
    link = ["--driver", "serial", "--port", port, "--seed", "7"]
    subprocess.run(
        [*COMMAND, "run", str(study), *options, *link], check=True, stdout=subprocess.DEVNULL
    )
    table = folder / "out" / "sub-01" / "ses-01" / "trials.csv"
    with table.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    span_s = float(rows[-1]["onset_s"]) - float(rows[0]["onset_s"])
    waits_s = sum(float(row["foreperiod_s"]) + float(row["rt_s"]) for row in rows[1:])
    return span_s / (len(rows) - 1), waits_s / (len(rows) - 1)


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    with emulator("--pty") as port:
        pty = _times(port)
    with emulator("--tcp", "0") as port:
        tcp = _times(port)
    with emulator("--pty", "--baud", str(BAUD)) as port:
        wire = _times(port)
    with tempfile.TemporaryDirectory() as name, emulator("--pty") as port:
        trial_s, waits_s = _trial_s(Path(name), port)
    beating = max(times.beating for times in (pty, tcp, wire))
    rows = [
        f"| {label} | {times.ping_s * 1e3:.2f} ms | {times.fire_s * 1e3:.2f} ms | "
        f"{times.upload_s * 1e3:.0f} ms |"
        for label, times in (("pty", pty), ("TCP", tcp), (f"pty, modelled {BAUD} baud", wire))
    ]
    return "\n".join(
        [
            "## Link",
            "",
            (
                f"The emulator in its own process; medians of {REPEATS}. Upload: one slot of two "
                f"97-sample waveforms. The heartbeat takes {100 * beating:.1f} % of an idle "
                "host's processor."
            ),
            "",
            "| line | ping | fire | upload |",
            "|---|---|---|---|",
            *rows,
            "",
            (
                "Upload of a burst of 1.2 s at 48 kHz to one slot, 7201 DATA, and what the wire "
                f"alone needs, at modelled baud: {'; '.join(map(_long_words, RATES))}."
            ),
            "",
            (
                f"A session of `run` over the pty with a simulated participant: {1 / trial_s:.1f} "
                f"trials per second; of {trial_s * 1e3:.0f} ms per trial {waits_s * 1e3:.0f} ms "
                "are foreperiod and reaction time."
            ),
            "",
        ]
    )
