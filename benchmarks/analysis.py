"""What a large analysis costs: time and memory of the command, beside pandas only reading."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from experiment.session.simulate import simulate_study
from experiment.study.files import paper_study
from experiment.study.physics import study_gains

SIZES = (100, 1000)
PANDAS = """
import sys
from pathlib import Path
import pandas as pd
pd.concat([pd.read_csv(table) for table in Path(sys.argv[1]).glob("sub-*/ses-*/trials.csv")])
"""
READ = """
import sys
from analysis import read_trials
read_trials([sys.argv[1]])
"""
PEAK = """
import atexit, re, sys
from pathlib import Path
# of this program alone: getrusage counts what stood here before it
status = Path("/proc/self/status")
peak = re.compile(r"VmHWM:\\s*(\\d+)")
atexit.register(lambda: print(peak.search(status.read_text())[1], file=sys.stderr))
"""
ANALYZE = "import sys; from analysis.commands.analyze import analyze; analyze(sys.argv[1:])"
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Cost:
    """What a process cost: time on the wall and on the processor, largest memory."""

    wall_s: float
    processor_s: float
    peak_mb: float


def _cost(code: str, *arguments: str) -> _Cost:
    """Run code in a process of its own, imports included."""
    pinned = os.environ | dict.fromkeys(THREADS, "1")
    start = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, "-c", PEAK + code, *arguments],
        env=pinned,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        told = process.stderr.read()
        _, status, used = os.wait4(process.pid, 0)
        wall_s = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"exit code {process.returncode} of {code} {arguments}: {told}")
    return _Cost(
        wall_s=wall_s,
        processor_s=used.ru_utime + used.ru_stime,
        peak_mb=int(told.split()[-1]) / 1024,
    )


def _rows(folder: Path, out: str) -> list[str]:
    tasks = {
        "pandas: `read_csv` of every table, `concat`; nothing checked": (PANDAS, str(folder)),
        "`read_trials`: tables and plans read, sealed, typed, checked": (READ, str(folder)),
        "`analyze --no-figures`": (ANALYZE, str(folder), "--out", out, "--no-figures"),
        "`analyze`": (ANALYZE, str(folder), "--out", out),
    }
    sessions = len(list(folder.glob("sub-*/ses-*")))
    rows = []
    for name, task in tasks.items():
        cost = _cost(*task)
        told = f"{cost.wall_s:.1f} s | {cost.processor_s:.1f} s | {cost.peak_mb:.0f} MB"
        rows.append(f"| {sessions} | {name} | {told} |")
    return rows


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    study = paper_study()
    gains = study_gains(study)
    rows = []
    trials = 0
    for sessions in SIZES:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name) / "results"
            for made in simulate_study(study, folder, participants=sessions, seed=1, gains=gains):
                trials = (
                    len((made.path / "trials.csv").read_text(encoding="utf-8").splitlines()) - 1
                )
            rows += _rows(folder, str(Path(name) / "out"))
    return "\n".join(
        [
            "## Large analysis",
            "",
            (
                f"Simulated sessions of the paper's protocol, {trials} trials each, with plan and "
                "journal next to every table; each line is its own process, on one thread. "
                "Memory is the largest resident set."
            ),
            "",
            "| sessions | what | time | processor | memory |",
            "|---|---|---|---|---|",
            *rows,
            "",
        ]
    )
