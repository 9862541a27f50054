"""Work on processes and Dask clusters: the same numbers, and nothing computed is lost."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil
import pytest

from analysis.workers.crew import StoppedError
from tests.test_analysis.test_workers import ALONE
from tests.test_analysis.toy import (
    STUDIES,
    Studies,
    begin,
    chunks,
    end_the_process,
    keeping,
    numbers,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[2]
LAST = chunks(STUDIES)[:1]


@contextmanager
def dask(*arguments: str, path: Path = ROOT) -> Iterator[subprocess.Popen[str]]:
    """Start a scheduler or a worker, which is killed in the end."""
    command = [sys.executable, "-m", "dask", *arguments, "--host", "127.0.0.1", "--no-dashboard"]
    environment = os.environ | {"PYTHONPATH": f"{path}{os.pathsep}{ROOT}"}
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=environment, cwd=path
    ) as process:  # where it runs comes first on its path, before PYTHONPATH
        try:
            yield process
        finally:
            process.kill()


@contextmanager
def scheduler() -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Start a scheduler on a port of the system's choice."""
    with dask("scheduler", "--port", "0", "--dashboard-address", ":0") as process:
        assert process.stderr is not None
        at = (re.search(r"Scheduler at: *(tcp://\S+)", line) for line in process.stderr)
        yield next(found[1] for found in at if found), process


def wait_for_workers(address: str, workers: int) -> None:
    """Wait until so many workers have joined: Python with all its imports takes seconds to start.

    A worker killed before it joined had nothing to lose, and no scheduler reports it.
    """
    from distributed import Client

    with Client(address) as client:
        client.wait_for_workers(workers, timeout=60)


def worker(address: str, path: Path = ROOT) -> Any:
    return dask("worker", address, "--no-nanny", "--nthreads", "1", path=path)


def test_two_processes_compute_what_one_does() -> None:
    taken: list[Studies] = []

    def work() -> Iterator[Studies]:
        for chunk in chunks(5, 0.01):
            taken.append(chunk)
            yield chunk

    results = begin(work(), workers=2)
    first = next(results)
    assert len(taken) <= 4
    assert numbers([first, *results]) == ALONE


def test_a_chunk_of_a_lost_process_is_computed_again(tmp_path: Path) -> None:
    news: list[str] = []
    work = chunks(10, 0.01)
    work[3] = replace(work[3], lost_once=str(tmp_path / "lost"))
    assert numbers(begin(work, workers=2, tell=news.append)) == ALONE
    assert len(news) == 1


def test_work_that_ends_every_process_is_given_up() -> None:
    with pytest.raises(StoppedError, match=" 4 "):
        list(begin(LAST, end_the_process, workers=2))


def test_a_worker_killed_in_the_middle_changes_nothing() -> None:
    news: list[str] = []
    with scheduler() as (address, _), worker(address) as killed, worker(address):
        wait_for_workers(address, 2)
        results = begin(chunks(1, 0.05), scheduler=address, tell=news.append)
        found = [next(results) for _ in range(6)]
        killed.kill()
        assert numbers([*found, *results]) == ALONE
    assert [line for line in news if re.match(r"worker tcp://\S+ ", line)]


def test_what_was_computed_outlives_the_scheduler(tmp_path: Path) -> None:
    with keeping(tmp_path / "power.jsonl") as kept:
        with scheduler() as (address, process), worker(address):
            results = begin(chunks(3, 0.05), scheduler=address, kept=kept)
            found = [next(results) for _ in range(6)]
            process.kill()
            with pytest.raises(StoppedError):
                found.extend(results)
        assert len(kept) == len(found)
        assert numbers(begin(chunks(3, 0.05), kept=kept)) == ALONE


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "localhost", "tls://127.0.0.1:9"])
def test_a_scheduler_that_is_not_there_is_reported_in_one_line(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("analysis.workers.cluster.CONNECT_S", 0.5)
    with pytest.raises(ValueError, match=f"^{address}: ") as refused:
        next(begin(chunks(5), scheduler=address))
    assert "\n" not in str(refused.value)


CTRL_C = """
import signal
import sys
from pathlib import Path
from tests.test_analysis.toy import begin, chunks, keeping
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background has it ignored
try:
    with keeping(Path(sys.argv[1])) as kept:
        for _ in begin(chunks(1, 0.1), workers=2, kept=kept):
            print(len(kept), flush=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


def test_ctrl_c_leaves_what_is_finished_and_no_process(tmp_path: Path) -> None:
    command = [sys.executable, "-c", CTRL_C, str(tmp_path / "power.jsonl")]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, cwd=ROOT, start_new_session=True
    ) as process:
        assert process.stdout is not None
        assert [process.stdout.readline() for _ in range(3)] == ["1\n", "2\n", "3\n"]
        children = psutil.Process(process.pid).children(recursive=True)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal sends it, to all of them
        *_, last = process.stdout
    assert last == "interrupted\n"
    assert len(children) >= 2
    assert psutil.wait_procs(children, timeout=30)[1] == []
    with keeping(tmp_path / "power.jsonl") as kept:
        assert len(kept) >= 3
