"""How long a command takes from a cold start, and where the time of a dry run goes."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from statistics import median

REPEATS = 5
PARTS = ("numpy", "pydantic", "pandas", "matplotlib.figure", "scipy.special", "rich", "click")
COMMAND = [sys.executable, "-c", "from tactstrip import main; main()"]


def _run(*arguments: str, options: tuple[str, ...] = ()) -> tuple[float, str]:
    start = time.perf_counter()
    done = subprocess.run(
        [COMMAND[0], *options, *COMMAND[1:], *arguments],
        check=True,
        capture_output=True,
        text=True,
    )
    return time.perf_counter() - start, done.stderr


def _dry_run_s(*options: str) -> float:
    with tempfile.TemporaryDirectory() as folder:
        return _run("dry-run", "--seed", "7", "--out", f"{folder}/out", *options)[0]


def _imports_s() -> dict[str, float]:
    """Return the cumulative import time of each heavy part within one dry run."""
    with tempfile.TemporaryDirectory() as folder:
        told = _run(
            "dry-run", "--seed", "7", "--out", f"{folder}/out", options=("-X", "importtime")
        )
    times: dict[str, float] = {}
    for line in told[1].splitlines():
        match = re.match(r"import time:\s+\d+ \|\s+(\d+) \|\s+(\S+)$", line)
        if match and match[2] in PARTS:
            times[match[2]] = int(match[1]) * 1e-6
    return times


def section() -> str:
    """Measure and return the section of docs/benchmarks.md."""
    help_s = median(_run("--help")[0] for _ in range(REPEATS))
    figures_s = median(_dry_run_s() for _ in range(REPEATS))
    tables_s = median(_dry_run_s("--participants", "1") for _ in range(REPEATS))
    imports = [f"| import of {name} | {s:.2f} s |" for name, s in _imports_s().items()]
    return "\n".join(
        [
            "## Start",
            "",
            f"Median of {REPEATS} new processes, files in the page cache.",
            "",
            "| what | time |",
            "|---|---|",
            f"| `tactstrip --help` | {help_s:.2f} s |",
            (
                f"| `tactstrip dry-run`: the paper's protocol, five participants, figures "
                f"| {figures_s:.2f} s |"
            ),
            f"| the same with one participant | {tables_s:.2f} s |",
            *imports,
            "",
            (
                "The import times are those of one dry run under `-X importtime`, each with what "
                "it imports itself and what no earlier import had brought."
            ),
            "",
        ]
    )
