"""Chunks on a Dask cluster; the only module that knows Dask, imported where a scheduler is given.

joblib's own Dask backend would do the same work in the same time. It is not used because it hides
what matters here: which chunks are under way (it takes them from another thread, and has no bound
of its own), which worker was lost, and whether the scheduler was.
"""

from __future__ import annotations

import logging
from collections import deque
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any, Final, TypeVar

from analysis.workers.crew import StoppedError
from analysis.workers.kept import DECIDES, versions
from stimuli.tuned import keep_freed_memory

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from concurrent.futures import Future

    from _typeshed import DataclassInstance

    _Chunk = TypeVar("_Chunk", bound=DataclassInstance)


CONNECT_S: Final = 5
"""So long a scheduler may take to answer at an address where there may be none."""
_STARTED_S: Final = 30
"""So long one may take that was started here: its computer may be busy."""
_UNDER_WAY: Final = 1000
"""Chunks at the scheduler: seconds of work for 500 cores, a megabyte in its memory."""


class Workers:
    """The workers of a Dask cluster, whether they are there already or join later."""

    def __init__(self, client: Any) -> None:
        self.most = _UNDER_WAY
        self.news: deque[str] = deque()
        self._executor = client.get_executor(pure=False)
        self._versions = versions()

    def submit(self, function: Callable[[_Chunk], object], chunk: _Chunk) -> Future[Any]:
        """Have a chunk computed."""
        future: Future[Any] = self._executor.submit(_computed, function, chunk, self._versions)
        return future

    def result(self, future: Future[Any]) -> Any:
        """Return what came of it; Dask itself gives the chunks of a lost worker to others."""
        from distributed import KilledWorker

        try:
            return future.result()
        except KilledWorker as error:
            lost = "workers of the cluster were lost (out of memory?)"
            raise StoppedError(f"{lost} again and again with the same work") from error
        except CancelledError as error:
            raise StoppedError("the connection to the Dask scheduler was lost") from error

    def heard(self, event: tuple[float, dict[str, Any]]) -> None:
        """Tell of a worker that is gone, among all that the scheduler logs."""
        _, what = event
        if what.get("action") == "remove-worker" and what.get("processing-tasks"):
            self.news.append(
                f"worker {what['worker']} was lost; what it had is computed again by others"
            )

    def dismiss(self) -> None:
        """Have nothing computed any more."""
        self._executor.shutdown(wait=False)


def _computed(
    function: Callable[[_Chunk], object], chunk: _Chunk, expected: dict[str, str]
) -> object:
    """Compute a chunk on a worker; one that joined late has not been asked for its versions."""
    from distributed import get_worker

    if (theirs := versions()) != expected:
        _same(f"worker {get_worker().address}", theirs, expected)
    keep_freed_memory()
    return function(chunk)


def _versions_there() -> Callable[[], dict[str, str]]:
    """Return what a worker can be asked that has nothing of ours: this function travels whole."""
    names = DECIDES

    def found() -> dict[str, str]:
        from importlib.metadata import distributions

        there = {one.metadata["Name"]: one.version for one in reversed([*distributions()])}
        return {name: there[name] for name in names if name in there}

    return found


def _same(worker: str, theirs: dict[str, str], ours: dict[str, str]) -> None:
    for name in DECIDES:
        if theirs.get(name) != ours[name]:
            has = f"has {name} {theirs[name]}" if theirs.get(name) else f"lacks {name}"
            raise ValueError(
                f"{worker} {has}, this computer has {ours[name]}: the numbers could differ; "
                "install the same on all workers"
            )


@contextmanager
def cluster(scheduler: Any) -> Iterator[Workers]:
    """Have the workers of a cluster, of which each has our versions."""
    with ExitStack() as stack:
        client = stack.enter_context(connected(scheduler))
        there: dict[str, dict[str, str]] = client.run(_versions_there())
        for address, found in there.items():
            _same(f"worker {address}", found, versions())
        workers = Workers(client)
        if not there:
            workers.news.append("the cluster has no workers yet: waiting for the first")
        client.subscribe_topic("all", workers.heard)
        stack.callback(client.unsubscribe_topic, "all")
        stack.callback(workers.dismiss)
        yield workers


@contextmanager
def connected(scheduler: Any) -> Iterator[Any]:
    """Have a client: the one given, or one of an address or a cluster, which is closed after."""
    try:
        from distributed import Client
    except ImportError as error:
        raise ValueError(
            "--scheduler needs dask.distributed: in the clone of tactstrip: "
            'pip install -e ".[cluster]" -c constraints.txt'
        ) from error
    if isinstance(scheduler, Client):
        yield scheduler
        return

    class OurClient(Client):
        def start(self, **kwargs: Any) -> None:
            try:
                super().start(**kwargs)
            except BaseException:
                self.close()  # later, without its loop, it would wait for 10 s
                raise

    response_timeout_s = CONNECT_S if isinstance(scheduler, str) else _STARTED_S
    with _quiet():
        try:
            client = OurClient(scheduler, timeout=response_timeout_s, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:  # TypeError: tls:// without certificates
            reason = " ".join(str(error).split())
            raise ValueError(
                f"{scheduler}: no Dask scheduler answers there ({reason}); start one with dask "
                "scheduler, or leave it out and take --workers"
            ) from error
        with client:
            yield client


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask's client from logging what is told in one line here."""
    logger = logging.getLogger("distributed.client")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)
