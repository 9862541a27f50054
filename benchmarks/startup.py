"""How long a command takes from a cold start, and where the time of a dry run goes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

REPEATS = 5
COMMAND = (sys.executable, "-c", "from tactstrip import main; main()")
PHASES = """
import json, sys, time
from pathlib import Path
marks = [("start of Python", time.perf_counter())]
def mark(name):
    marks.append((name, time.perf_counter()))
import analysis.commands.dry_run
mark("import of the command (click)")
from experiment.study.files import paper_study
study = paper_study()
mark("import of numpy and pydantic, the study")
from experiment.check.check import check_study
gains = check_study(study).gains
mark("the check: burst, displacements at the fingers")
from experiment.session.simulate import simulate_study
root = Path(sys.argv[1])
for _ in simulate_study(study, root, participants=5, seed=7, gains=gains):
    pass
mark("five sessions of 155 trials")
from analysis.reading.trials import read_inputs
from analysis.results.analysis import analyse
import pandas
mark("import of pandas")
analysis_ = analyse(read_inputs([root], None), ci="wilson", seed=7, allow_simulated=False)
mark("reading, checking, tables")
import matplotlib.figure
mark("import of matplotlib")
from analysis.results.files import save
save(analysis_, root / "analysis", with_figures=True, read=[])
mark("writing, figure as PNG and SVG")
print(json.dumps([(b[0], b[1] - a[1]) for a, b in zip(marks, marks[1:])]))
"""


def _drop_page_cache() -> bool:
    """Make the system forget the files that it has read, if BENCH_DROP_CACHES=1 asks for it.

    It slows the whole machine down for a while, and only root can do it, on Linux.
    """
    if os.environ.get("BENCH_DROP_CACHES") != "1":
        return False
    switch = Path("/proc/sys/vm/drop_caches")
    if not os.access(switch, os.W_OK):
        return False
    os.sync()
    try:
        switch.write_text("3")
    except OSError:
        return False
    return True


def _seconds(*arguments: str, cold: bool) -> float | None:
    with tempfile.TemporaryDirectory() as folder:
        if cold and not _drop_page_cache():
            return None
        where = [argument.replace("OUT", f"{folder}/out") for argument in arguments]
        start = time.perf_counter()
        subprocess.run([*COMMAND, *where], check=True, capture_output=True)
        return time.perf_counter() - start


def _row(label: str, *arguments: str) -> str:
    warm_s = median(_seconds(*arguments, cold=False) or 0.0 for _ in range(REPEATS))
    cold_s = _seconds(*arguments, cold=True)
    cold = "not measured" if cold_s is None else f"{cold_s:.2f} s"
    return f"| {label} | {cold} | {warm_s:.2f} s |"


def _phases() -> list[tuple[str, float]]:
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", PHASES, folder], check=True, capture_output=True, text=True
        )
    return [(name, seconds) for name, seconds in json.loads(done.stdout)]


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    dry_run = ("dry-run", "--seed", "7", "--out", "OUT")
    return "\n".join(
        [
            "## Start",
            "",
            (
                "New processes: one with the page cache dropped (cold), the median of "
                f"{REPEATS} with it (warm)."
            ),
            "",
            "| what | cold | warm |",
            "|---|---|---|",
            _row("`tactstrip --help`", "--help"),
            _row("`tactstrip dry-run`: the paper's protocol, five participants, figures", *dry_run),
            "",
            "Of a warm dry run, in s: "
            + "; ".join(f"{name} {seconds:.2f}" for name, seconds in _phases())
            + ".",
            "",
        ]
    )
