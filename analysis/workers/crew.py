"""Who computes chunks of work: the process itself, or others of this machine."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections import deque
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager
from multiprocessing.resource_tracker import ensure_running
from typing import TYPE_CHECKING, Any, Final, Protocol, TypeVar

from stimuli.tuned import keep_freed_memory

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from _typeshed import DataclassInstance


_Chunk = TypeVar("_Chunk", bound="DataclassInstance")


_LOOK_S: Final = 1.0
"""So often a worker looks whether its parent is there."""


class StoppedError(Exception):
    """Not all chunks could be computed; those that were are kept."""


class LostError(Exception):
    """A chunk whose process was lost; another may compute it."""


class Crew(Protocol):
    """Who computes chunks."""

    most: int
    """Chunks under way at once: everybody has the next one at hand, and the rest takes no room."""
    news: deque[str]
    """What has to be told of the workers."""

    def submit(self, function: Callable[[_Chunk], object], chunk: _Chunk) -> Future[Any]:
        """Have a chunk computed."""
        ...

    def result(self, future: Future[Any]) -> Any:
        """Return what came of it; LostError if another may try, StoppedError if nobody."""
        ...


class Alone:
    """The process itself."""

    def __init__(self) -> None:
        self.most = 1
        self.news: deque[str] = deque()

    def submit(self, function: Callable[[_Chunk], object], chunk: _Chunk) -> Future[Any]:
        """Compute a chunk; what it raises goes straight to the caller."""
        future: Future[Any] = Future()
        future.set_result(function(chunk))
        return future

    def result(self, future: Future[Any]) -> Any:
        """Return what came of it."""
        return future.result()


class Processes:
    """Processes of this machine: joblib's, of which there are new ones after one was lost."""

    def __init__(self, workers: int) -> None:
        self.most = 2 * workers
        self.news: deque[str] = deque()
        self._workers = workers
        self._executor: Any = None
        self._told: BaseException | None = None

    def submit(self, function: Callable[[_Chunk], object], chunk: _Chunk) -> Future[Any]:
        """Have a chunk computed by the processes that are there, or by new ones."""
        from joblib.externals.loky import get_reusable_executor

        with _ctrl_c_later():
            self._executor = get_reusable_executor(
                max_workers=self._workers,
                initializer=_begin_worker,
                initargs=(os.getpid(),),
                env={"OPENBLAS_NUM_THREADS": "1"},
            )
            future: Future[Any] = self._executor.submit(function, chunk)
        return future

    def result(self, future: Future[Any]) -> Any:
        """Return what came of it."""
        try:
            return future.result()
        except BrokenExecutor as error:
            lost = "worker processes were lost (out of memory?)"
            if error is not self._told:  # all that was under way has the same error
                self._told = error
                self.news.append(f"{lost}; what they had is computed again")
            raise LostError(lost) from error

    def end(self) -> None:
        """Have no process any more, whatever it does."""
        if self._executor is not None:
            with _ctrl_c_later():
                self._executor.shutdown(wait=True, kill_workers=True)


@contextmanager
def processes(workers: int) -> Iterator[Processes]:
    """Have processes, which are left for the next chunks if all goes well, else ended."""
    crew = Processes(workers)
    try:
        yield crew
    except BaseException:
        crew.end()
        raise


@contextmanager
def _ctrl_c_later() -> Iterator[None]:
    """Hold Ctrl-C back, where the system can, also from processes that are begun meanwhile.

    They would tell of it with a traceback each: it reaches them before `_begin_worker` does. So is
    SIGTERM, which stops a search in the same way: loky cannot be stopped while it begins a thread.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    ensure_running()  # beginning this process of Python's would let Ctrl-C through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin_worker(parent: int) -> None:
    keep_freed_memory()
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    for number in (signal.SIGINT, signal.SIGTERM):  # left to the parent, which ends this process
        signal.signal(number, signal.SIG_IGN)


def _end_with(parent: int) -> None:
    """End this process soon after the one it works for was killed, where the system tells that."""
    while os.getppid() == parent:
        time.sleep(_LOOK_S)
    os._exit(1)
