"""What the journal costs: a line with checksum, hash and fsync beside a bare write and fsync."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path
from statistics import median

from experiment.archive.journal import Journal

LINES = 300
FACTS = {"trial": 12, "attempt": 1, "token": 2**62 + 1}


def _bare_s(folder: Path, *, sync: bool) -> float:
    line = b"x" * 150 + b"\n"
    handle = os.open(folder / "bare", os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    times = []
    for _ in range(LINES):
        start = time.perf_counter()
        os.write(handle, line)
        if sync:
            os.fsync(handle)
        times.append(time.perf_counter() - start)
    os.close(handle)
    return median(times)


def _journal_s(folder: Path, *, sync: bool) -> float:
    times = []
    with Journal(folder / f"journal-{sync}.jsonl", now_s=time.monotonic) as journal:
        for _ in range(LINES):
            start = time.perf_counter()
            journal.append("trial_armed", FACTS, sync=sync)
            times.append(time.perf_counter() - start)
    return median(times)


def section() -> str:
    """Measure and return the section of docs/benchmarks.md."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = [
            f"| {label} | {_bare_s(folder, sync=sync) * 1e6:.0f} us | "
            f"{_journal_s(folder, sync=sync) * 1e6:.0f} us |"
            for label, sync in (("write", False), ("write and fsync", True))
        ]
    return "\n".join(
        [
            "## Journal",
            "",
            f"{LINES} lines (median) of 150 bytes, 225 with the hash, in the temporary folder.",
            "",
            "| | bare file | journal line with checksum and hash |",
            "|---|---|---|",
            *rows,
            "",
        ]
    )
