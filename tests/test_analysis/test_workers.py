"""Spreading work: the same numbers wherever they are computed, and nothing computed is lost."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from click.testing import CliRunner

from analysis.workers import cluster
from analysis.workers.chunks import spread
from analysis.workers.crew import Alone, StoppedError
from analysis.workers.kept import Kept
from tactstrip import main
from tests.test_analysis.toy import STUDIES, Studies, chunks, draw, end_the_process

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from concurrent.futures import Future

    from click.testing import Result

ROOT = Path(__file__).parents[2]
COMPUTED = {"study_sha256": "5f" * 32, "seed": 7}


def numbers(results: Iterable[tuple[Studies, Any]]) -> list[tuple[int, int, float]]:
    return sorted((chunk.point, study, x) for chunk, result in results for study, x in result)


ALONE = numbers(spread(draw, chunks(STUDIES)))


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


def joined(address: str, workers: int) -> None:
    """Wait until so many workers have joined: Python with all its imports takes seconds to start.

    A worker killed before it joined had nothing to lose, and no scheduler tells of it.
    """
    from distributed import Client

    with Client(address) as client:
        client.wait_for_workers(workers, timeout=60)


def worker(address: str, path: Path = ROOT) -> Any:
    return dask("worker", address, "--no-nanny", "--nthreads", "1", path=path)


@pytest.mark.parametrize("size", [1, 7, STUDIES])
def test_numbers_do_not_depend_on_the_size_of_chunks_or_their_order(size: int) -> None:
    assert numbers(spread(draw, reversed(chunks(size)))) == ALONE


def test_chunks_are_taken_as_they_are_needed() -> None:
    endless = iter(int, 1)
    results = spread(draw, (Studies(0, first, 2) for first in endless))
    assert next(results)[1] == next(results)[1]
    results.close()


def test_news_of_the_last_moment_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    class LastMinute(Alone):
        def result(self, future: Future[Any]) -> Any:
            self.news.append("a worker was lost")
            return super().result(future)

    monkeypatch.setattr("analysis.workers.chunks._crew", lambda *_: nullcontext(LastMinute()))
    told: list[str] = []
    assert len(list(spread(draw, chunks(STUDIES)[:1], tell=told.append))) == len(told) == 1


def test_a_run_that_was_stopped_goes_on_from_its_file(tmp_path: Path) -> None:
    path, computed = tmp_path / "power.jsonl", []

    def watched(chunk: Studies) -> object:
        computed.append(chunk)
        return draw(chunk)

    for stopped_after in (3, 2, None):
        with Kept(path, COMPUTED) as kept:
            results = spread(watched, chunks(10), kept=kept)
            found = [
                result for _, result in zip(range(stopped_after or 100), results, strict=False)
            ]
            results.close()
        path.write_bytes(path.read_bytes() + b'{"chunk": "0a')  # the line at which it was killed
    assert numbers(found) == ALONE
    assert sorted(computed, key=repr) == sorted(chunks(10), key=repr)


def test_a_first_line_cut_short_is_written_anew(tmp_path: Path) -> None:
    path = tmp_path / "power.jsonl"
    with Kept(path, COMPUTED) as kept:
        kept[chunks(10)[0]] = 1.0
    path.write_bytes(path.read_bytes()[:20])
    with Kept(path, COMPUTED) as kept:
        assert chunks(10)[0] not in kept
        kept[chunks(10)[0]] = 2.0
    with Kept(path, COMPUTED) as kept:
        assert kept[chunks(10)[0]] == 2.0


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "holds results of another computation (seed 8, asked for is 7)"),
        ("[design]\n", "this is no file of kept results"),
        ('{"schema": 1}\n', "this is no file of kept results"),
        ("trial,level", "this is no file of kept results"),
    ],
)
def test_a_file_of_something_else_is_refused_and_left_alone(
    content: str | None, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "power.jsonl"
    if content is None:
        with Kept(path, COMPUTED | {"seed": 8}):
            pass
    else:
        path.write_text(content)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=re.escape(f"{path}: {message}; name another file")):
        Kept(path, COMPUTED).__enter__()
    assert path.read_bytes() == before


def test_a_file_of_another_version_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Kept(tmp_path / "power.jsonl", COMPUTED):
        pass
    monkeypatch.setattr("analysis.workers.kept.version", lambda name: "9.9")
    with (
        pytest.raises(ValueError, match=r"another computation \(tactstrip '.*', asked for is '9.9"),
        Kept(tmp_path / "power.jsonl", COMPUTED),
    ):
        pass


@pytest.mark.process
def test_neither_dask_nor_joblib_is_imported_before_it_is_asked_for() -> None:
    code = "import sys, analysis.workers.chunks as w; print({'dask', 'joblib'} & {*sys.modules})"
    printed = subprocess.check_output([sys.executable, "-c", code], text=True, cwd=ROOT)
    assert printed.strip() == "set()"


@pytest.mark.process
def test_two_processes_compute_what_one_does() -> None:
    taken: list[Studies] = []
    results = spread(draw, (taken.append(c) or c for c in chunks(5, 0.01)), workers=2)  # type: ignore[func-returns-value]
    first = next(results)
    assert len(taken) <= 4
    assert numbers([first, *results]) == ALONE


@pytest.mark.process
def test_a_chunk_of_a_lost_process_is_computed_again(tmp_path: Path) -> None:
    told: list[str] = []
    work = chunks(10, 0.01)
    work[3] = replace(work[3], lost_once=str(tmp_path / "lost"))
    assert numbers(spread(draw, work, workers=2, tell=told.append)) == ALONE
    assert told == ["worker processes were lost (out of memory?); what they had is computed again"]


@pytest.mark.process
def test_work_that_ends_every_process_is_given_up() -> None:
    with pytest.raises(StoppedError, match=r"lost \(out of memory\?\) 4 times with the same work"):
        list(spread(end_the_process, chunks(STUDIES)[:1], workers=2))


@pytest.mark.process
@pytest.mark.parametrize("processes", [True, False])
def test_a_local_cluster_computes_what_one_process_does(processes: bool) -> None:  # noqa: FBT001
    from distributed import Client, LocalCluster

    with LocalCluster(
        n_workers=2 if processes else 1,
        threads_per_worker=1 if processes else 2,
        processes=processes,
        dashboard_address=":0",
    ) as local:
        assert numbers(spread(draw, chunks(7), scheduler=local)) == ALONE
        with Client(local) as client:
            assert numbers(spread(draw, chunks(5), scheduler=client)) == ALONE
            assert client.status == "running"


@pytest.mark.process
def test_a_worker_killed_in_the_middle_changes_nothing() -> None:
    told: list[str] = []
    with scheduler() as (address, _), worker(address) as one, worker(address):
        joined(address, 2)
        results = spread(draw, chunks(1, 0.05), scheduler=address, tell=told.append)
        found = [next(results) for _ in range(6)]
        one.kill()
        assert numbers([*found, *results]) == ALONE
    assert [line for line in told if re.match(r"worker tcp://\S+ was lost; ", line)]


@pytest.mark.process
def test_work_that_ends_every_worker_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")  # of the scheduler's
    with scheduler() as (address, _), worker(address):
        given_up = spread(end_the_process, chunks(STUDIES)[:1], scheduler=address)
        with pytest.raises(StoppedError, match="again and again with the same work"):
            list(given_up)


@pytest.mark.process
def test_what_was_computed_outlives_the_scheduler(tmp_path: Path) -> None:
    with Kept(tmp_path / "power.jsonl", COMPUTED) as kept:
        with scheduler() as (address, process), worker(address):
            results = spread(draw, chunks(3, 0.05), scheduler=address, kept=kept)
            found = [next(results) for _ in range(6)]
            process.kill()
            with pytest.raises(StoppedError, match="connection to the Dask scheduler was lost"):
                found.extend(results)
        assert len(kept) == len(found)
        assert numbers(spread(draw, chunks(3, 0.05), kept=kept)) == ALONE


@pytest.mark.process
def test_a_worker_with_another_version_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "tactstrip-9.9.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: tactstrip\nVersion: 9.9\n")
    with scheduler() as (address, _), worker(address) as one:
        assert numbers(spread(draw, chunks(5), scheduler=address)) == ALONE
        one.kill()
        one.wait()
        later = []

        def join(line: str) -> None:
            assert line == "the cluster has no workers yet: waiting for the first"
            process = worker(address, tmp_path)
            process.__enter__()
            later.append(process)

        try:
            with pytest.raises(ValueError, match=r"worker tcp://\S+ has tactstrip 9\.9, this comp"):
                list(spread(draw, chunks(5), scheduler=address, tell=join))
            with pytest.raises(ValueError, match=r"worker tcp://\S+ has tactstrip 9\.9, this comp"):
                list(spread(draw, chunks(5), scheduler=address))
        finally:
            for process in later:
                process.__exit__(None, None, None)


@pytest.mark.process
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "localhost", "tls://127.0.0.1:9"])
def test_a_scheduler_that_is_not_there_is_told_in_one_line(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    with pytest.raises(ValueError, match=f"^{address}: no Dask scheduler answers there") as refused:
        next(spread(draw, chunks(5), scheduler=address))
    assert "\n" not in str(refused.value)


CTRL_C = """
import signal
import sys
from pathlib import Path
from analysis.workers.chunks import spread
from analysis.workers.kept import Kept
from tactstrip import main
from tests.test_analysis.toy import chunks, draw
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background has it ignored
try:
    with Kept(Path(sys.argv[1]), {}) as kept:
        for _ in spread(draw, chunks(1, 0.1), workers=2, kept=kept):
            print(len(kept), flush=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.process
def test_ctrl_c_leaves_what_is_finished_and_no_process(tmp_path: Path) -> None:
    import psutil

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
    with Kept(tmp_path / "power.jsonl", {}) as kept:
        assert len(kept) >= 3


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_search_stopped_while_its_workers_begin_says_one_line(number: signal.Signals) -> None:
    import psutil

    study = ROOT / "docs" / "examples" / "first-study.toml"
    code = "import signal, tactstrip; signal.signal(signal.SIGINT, signal.default_int_handler)"
    asked = ["power", str(study), "--people", "literature", "--workers", "2"]
    command = [sys.executable, "-c", f"{code}; tactstrip.main({asked})"]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, cwd=ROOT, start_new_session=True
    ) as process:
        assert process.stderr is not None
        begun = psutil.Process(process.pid)
        while process.poll() is None and not (workers := _workers(begun)):
            time.sleep(0.01)
        os.killpg(process.pid, number)
        told = process.stderr.read().splitlines()
    told = [line for line in told if "of one core" not in line]
    assert (told, process.returncode) == (["error: interrupted"], 130)
    assert psutil.wait_procs(workers, timeout=30)[1] == []


def _workers(process: Any) -> list[Any]:
    """Return the children that compute, or will in a moment."""
    import psutil

    with suppress(psutil.NoSuchProcess):
        return [one for one in process.children() if "popen_loky" in " ".join(one.cmdline())]
    return []


STUDY = """
[design]
levels_vpp = [80.0]
trials_per_side = 5
both_trials = 0
[simulation]
threshold_vpp = 80.0
threshold_sd_db = 2.0
"""
ASKED = ["--goal", "detection=40%@80V", "--participants", "1", "2"]


def power(folder: Path, *arguments: str) -> Result:
    (folder / "study.toml").write_text(STUDY)
    return CliRunner().invoke(main, ["power", str(folder / "study.toml"), *ASKED, *arguments])


def test_a_pilot_made_elsewhere_is_told_what_it_needs(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "p1.csv").write_text("intensity,key\n1,left\n2,left\n")
    result = power(tmp_path, "--pilot", str(tmp_path / "data"))
    assert (result.exit_code, result.stdout, result.stderr.count("\n")) == (2, "", 1)
    assert "a table made elsewhere needs --columns MAP.toml" in result.stderr


def answer(result: Result) -> str:
    """What power told, but for the time that it predicts after a few measured studies."""
    return re.sub(r".*of one core.*\n", "", result.stdout)


@pytest.mark.slow
def test_power_goes_on_from_its_file_with_its_seed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tmp_path / "power.jsonl"

    def stopped(*arguments: Any, **options: Any) -> Any:
        yield next(spread(*arguments, **options))
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("analysis.workers.chunks.spread", stopped)
        assert power(tmp_path).exit_code == 130
        first = power(tmp_path, "--keep", str(kept), "--seed", "5")
    assert first.exit_code == 4
    assert first.stdout.startswith("Stopped, so this is partial: ")
    assert "participants  trials a side" in first.stdout
    assert first.stderr.endswith(f"error: interrupted; the same command goes on from {kept}\n")
    before = kept.read_bytes()
    again, alone = power(tmp_path, "--keep", str(kept)), power(tmp_path, "--seed", "5")
    assert again.exit_code == alone.exit_code == 0
    assert answer(again) == answer(alone) != ""
    assert kept.read_bytes().startswith(before)
    other = power(tmp_path, "--keep", str(kept), "--seed", "6")
    assert (other.exit_code, other.stderr.count("\n")) == (2, 1)


@pytest.mark.process
def test_power_is_the_same_on_a_cluster(tmp_path: Path) -> None:
    alone = power(tmp_path, "--seed", "5")
    assert alone.exit_code == 0
    assert answer(power(tmp_path, "--seed", "5", "--workers", "2")) == answer(alone)
    with scheduler() as (address, process), worker(address), worker(address):
        found = power(tmp_path, "--seed", "5", "--scheduler", address)
        assert answer(found) == answer(alone)
        process.kill()
        process.wait()
        gone = power(tmp_path, "--scheduler", address)
    assert (gone.exit_code, gone.stdout, gone.stderr.count("\n")) == (2, "", 1)
    both = power(tmp_path, "--workers", "2", "--scheduler", address)
    assert both.exit_code == 2
    assert "--workers is of this computer" in both.stderr
