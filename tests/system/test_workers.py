"""Work on processes and Dask clusters: the same numbers, and nothing computed is lost."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil
import pytest

from analysis.planning.spread import StoppedError, computing_on, spread
from tests.test_analysis.test_spread import (
    ALONE,
    STUDIES,
    chunks,
    draw,
    end_the_process,
    keeping,
    numbers,
    power,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[2]


@contextmanager
def dask(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Start a scheduler or a worker, which is killed in the end."""
    command = [sys.executable, "-m", "dask", *arguments, "--host", "127.0.0.1", "--no-dashboard"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=environment, cwd=ROOT
    ) as process:
        try:
            yield process
        finally:
            process.kill()


@contextmanager
def scheduler() -> Iterator[str]:
    """Start a scheduler on a port of the system's choice."""
    with dask("scheduler", "--port", "0", "--dashboard-address", ":0") as process:
        assert process.stderr is not None
        matches = (re.search(r"Scheduler at: *(tcp://\S+)", line) for line in process.stderr)
        yield next(match[1] for match in matches if match)


def worker(address: str) -> Any:
    return dask("worker", address, "--no-nanny", "--nthreads", "1")


def wait_for_workers(address: str, workers: int) -> None:
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(workers, timeout=60)


def test_processes_and_a_cluster_compute_what_one_process_does(tmp_path: Path) -> None:
    one, two = (power(tmp_path, "--seed", 5, "--workers", number).stdout for number in (1, 2))
    with scheduler() as address, worker(address):
        wait_for_workers(address, 1)
        cluster = power(tmp_path, "--seed", 5, "--scheduler", address)
    assert one == two == cluster.stdout != ""
    assert cluster.stderr == ""


def test_work_that_ends_its_process_is_given_up() -> None:
    with pytest.raises(StoppedError), computing_on(2):
        list(spread(end_the_process, chunks(STUDIES // 2)))


def test_a_worker_killed_in_the_middle_changes_nothing() -> None:
    with scheduler() as address, worker(address) as killed, worker(address):
        wait_for_workers(address, 2)
        with computing_on(scheduler=address):
            results = spread(draw, chunks(1, 0.05))
            pairs = [next(results) for _ in range(6)]
            killed.kill()
            assert numbers([*pairs, *results]) == ALONE


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "localhost", "tls://127.0.0.1:9"])
def test_a_scheduler_that_is_not_there_is_reported_in_one_line(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("analysis.planning.spread.CONNECT_TIMEOUT_S", 0.5)
    with pytest.raises(ValueError, match=f"^{address}: ") as refused, computing_on(1, address):
        pass
    assert "\n" not in str(refused.value)


CTRL_C = """
import signal, sys
from pathlib import Path
from analysis.planning.spread import computing_on, spread
from tests.test_analysis.test_spread import chunks, draw, keeping
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background has it ignored
kept = keeping(Path(sys.argv[1]))
try:
    with computing_on(2):
        for _ in spread(draw, chunks(1, 0.1), kept):
            print(len(kept.results), flush=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_stop_leaves_what_is_finished_and_no_process(number: int, tmp_path: Path) -> None:
    command = [sys.executable, "-c", CTRL_C, str(tmp_path / "power.jsonl")]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        assert [process.stdout.readline() for _ in range(3)] == ["1\n", "2\n", "3\n"]
        children = psutil.Process(process.pid).children(recursive=True)
        if number == signal.SIGKILL:
            process.kill()
        else:
            os.killpg(process.pid, number)  # as a terminal sends it, to all of them
            output, errors = process.communicate()
            assert output.endswith("interrupted\n")
            assert "Traceback" not in errors
    assert len(children) >= 2
    assert psutil.wait_procs(children, timeout=30)[1] == []
    assert len(keeping(tmp_path / "power.jsonl").results) >= 3
