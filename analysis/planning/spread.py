"""Chunks of work on this process, on processes of this computer or on a Dask cluster.

A result depends on its chunk alone: neither the workers nor their order can change a number.
Finished chunks can be kept in a file, from which a computation that was stopped continues.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import threading
import time
from concurrent.futures import BrokenExecutor, CancelledError
from contextlib import contextmanager, suppress
from dataclasses import asdict
from functools import cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from pathlib import Path

    from _typeshed import DataclassInstance

    _Chunk = TypeVar("_Chunk", bound=DataclassInstance)

PACKAGES: Final = ("tactstrip", "numpy", "scipy")
"""Packages that determine the numbers: other versions could give others."""
CHUNK_S: Final = 0.5
"""Processor time of a chunk: much more than its transport takes, and little to lose."""
CONNECT_TIMEOUT_S: Final = 5
_PARENT_INTERVAL_S: Final = 1.0


class StoppedError(Exception):
    """Workers were lost before the work was finished; what is finished is kept."""


@contextmanager
def computing_on(workers: int = 1, scheduler: str | None = None) -> Iterator[None]:
    """Compute chunks on this number of processes, or on the workers of a Dask scheduler."""
    from joblib import parallel_config

    if scheduler is None:
        following = {"initializer": _follow, "initargs": (os.getpid(),)}
        with parallel_config("loky", n_jobs=workers, inner_max_num_threads=1, **following):
            yield
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise ValueError(
            '--scheduler requires dask.distributed: pip install -e ".[cluster]" -c constraints.txt'
        ) from error
    try:
        client = Client(scheduler, timeout=CONNECT_TIMEOUT_S, set_as_default=True)
    except (OSError, ValueError, TypeError) as error:  # TypeError: tls:// without certificates
        reason = " ".join(str(error).split())
        raise ValueError(f"{scheduler}: no Dask scheduler answers ({reason})") from error
    with client, parallel_config(backend="dask"):
        yield


@cache
def versions() -> dict[str, str]:
    """Return the versions of the packages that determine the numbers."""
    return {name: version(name) for name in PACKAGES}


def spread(
    function: Callable[[_Chunk], Any], chunks: Iterable[_Chunk], kept: Kept | None = None
) -> Iterator[tuple[_Chunk, Any]]:
    """Yield chunks with their results, in any order, computed as `computing_on` says.

    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Chunk:
    ...     first: int
    ...     last: int
    >>> def total(chunk):
    ...     return sum(range(chunk.first, chunk.last))
    >>> [result for _, result in spread(total, [Chunk(0, 3), Chunk(3, 5)])]
    [3, 7]
    """
    from joblib import Parallel, delayed

    results = {} if kept is None else kept.results
    missing = []
    for chunk in chunks:
        if (key := key_of(chunk)) in results:
            yield chunk, results[key]
        else:
            missing.append(chunk)
    run = delayed(_run_chunk)
    tasks = (run(function, chunk, versions()) for chunk in missing)
    try:
        for chunk, result in Parallel(return_as="generator_unordered")(tasks):
            if kept is not None:
                kept.add(chunk, result)
            yield chunk, result
    except (BrokenExecutor, CancelledError) as error:  # KilledWorker of Dask is none of them
        raise StoppedError(f"worker processes were lost ({type(error).__name__})") from error
    except Exception as error:
        if type(error).__name__ not in {"KilledWorker", "CommClosedError"}:
            raise
        raise StoppedError(f"workers of the cluster were lost ({error})") from error


def _run_chunk(
    function: Callable[[_Chunk], Any], chunk: _Chunk, expected: dict[str, str]
) -> tuple[_Chunk, Any]:
    if versions() != expected:
        raise ValueError(
            f"a worker has {versions()}, this computer {expected}: install the same versions"
        )
    return chunk, function(chunk)


def _follow(parent: int) -> None:
    """Leave Ctrl-C to the parent process, and end this process soon after it."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_PARENT_INTERVAL_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


class Kept:
    """Results of chunks in a file of JSON lines, from which a stopped computation continues.

    The first line says what is computed, with the versions of `PACKAGES`. Every finished chunk is
    one line; a line that was cut short by a kill is computed again.

    Raises ValueError for a file that holds something else, and does not change it.

    >>> import tempfile
    >>> from dataclasses import dataclass
    >>> from pathlib import Path
    >>> @dataclass(frozen=True)
    ... class Chunk:
    ...     first: int
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "power.jsonl"
    ...     Kept(path, {"seed": 1}).add(Chunk(0), 0.25)
    ...     Kept(path, {"seed": 1}).results[key_of(Chunk(0))]
    0.25
    """

    def __init__(self, path: Path, computed: Mapping[str, object]) -> None:
        self.path = path
        self.results: dict[str, Any] = {}
        head = json.dumps({"schema": 2, "computed": {**computed, **versions()}})
        text = path.read_text("utf-8", "replace") if path.exists() else ""
        first, *lines = text.split("\n")
        if not lines and head.startswith(first):  # empty, or killed within the first line
            path.write_text(f"{head}\n", "utf-8")
        elif first != head:
            raise ValueError(
                f"{path}: must hold results of this computation ({head}; got {first[:200]}); name "
                "another file"
            )
        elif lines[-1]:
            self._append("")
        for line in lines:
            with suppress(ValueError, TypeError):
                key, result = json.loads(line)
                self.results[key] = result

    def add(self, chunk: DataclassInstance, result: object) -> None:
        """Keep the result of a chunk."""
        self.results[key_of(chunk)] = result
        self._append(json.dumps([key_of(chunk), result]))

    def _append(self, line: str) -> None:
        with self.path.open("a", encoding="utf-8") as file:
            file.write(f"{line}\n")


def seed_in(path: Path | None) -> int | None:
    """Return the seed of a file of kept results; None where there is no such file."""
    if path is None or not path.is_file():
        return None
    with suppress(ValueError, TypeError, KeyError), path.open(encoding="utf-8") as file:
        return int(json.loads(file.readline())["computed"]["seed"])
    return None


def key_of(chunk: DataclassInstance) -> str:
    """Return what identifies a chunk: its kind and its values."""
    values = json.dumps([type(chunk).__qualname__, asdict(chunk)], sort_keys=True)
    return hashlib.sha256(values.encode()).hexdigest()[:32]
