"""What the journal costs: a line with checksum, hash and fsync beside a bare write and fsync."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path
from statistics import median

from experiment.record.entries import TrialArmed
from experiment.record.journal import Journal

LINES = 300
LINE = TrialArmed(trial=12, attempt=1, token=2**62 + 1)


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
            journal.append(LINE, sync=sync)
            times.append(time.perf_counter() - start)
    return median(times)


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bare_us, synced_us = (1e6 * _bare_s(folder, sync=sync) for sync in (False, True))
        line_us, line_synced_us = (1e6 * _journal_s(folder, sync=sync) for sync in (False, True))
    return "\n".join(
        [
            "## Journal",
            "",
            (
                "To write a line of 150 bytes (225 with checksum and hash) in the temporary folder "
                f"takes, median of {LINES}, {bare_us:.0f} us in a bare file and {line_us:.0f} us "
                f"in the journal, with fsync {synced_us:.0f} and {line_synced_us:.0f} us."
            ),
            "",
        ]
    )
