"""Chunks of work, spread over this process, several of this machine, or a Dask cluster."""

from __future__ import annotations

from contextlib import nullcontext
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar

from analysis.workers.crew import Alone, LostError, StoppedError, processes
from analysis.workers.kept import as_read

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator
    from concurrent.futures import Future
    from contextlib import AbstractContextManager

    from _typeshed import DataclassInstance

    from analysis.workers.crew import Crew
    from analysis.workers.kept import Kept


_Chunk = TypeVar("_Chunk", bound="DataclassInstance")
CHUNK_S: Final = 0.5
"""Processor time of a chunk: long beside the milliseconds of handing it over, little to lose."""
MOST_LOST: Final = 3
"""So often a chunk is computed again after the process that had it was lost; Dask's own number."""
_LOOK_S: Final = 1.0
"""So often a wait looks up, for on Windows nothing else lets Ctrl-C through."""


def spread(
    function: Callable[[_Chunk], object],
    chunks: Iterable[_Chunk],
    *,
    workers: int = 1,
    scheduler: object = None,
    kept: Kept | None = None,
    tell: Callable[[str], object] | None = None,
) -> Generator[tuple[_Chunk, Any], None, None]:
    """Compute chunks wherever there is room, and give their results as they arrive.

    Parameters
    ----------
    function : callable
        A chunk to its result, in numbers, words, lists and dictionaries; defined at the top of a
        module that all workers can import. It must depend on nothing but the chunk: then neither
        the workers nor the order change a number.
    chunks : iterable
        Frozen dataclasses of plain values, of `CHUNK_S` each. They are taken as they are needed.
    workers : int
        Processes on this machine; 1 computes in this one.
    scheduler : str, distributed.Client or distributed cluster, optional
        A Dask cluster to compute on instead: the address of its scheduler, or the object.
    kept : Kept, optional
        An open file. What it holds is not computed again; what is finished is written to it.
    tell : callable, optional
        Told in a line what happens to workers.

    Yields
    ------
    tuple
        A chunk and its result, in any order.

    Raises
    ------
    ValueError
        For a scheduler that is not there, and for workers that could compute other numbers.
    StoppedError
        If workers are lost again and again, or the scheduler is.

    Examples
    --------
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
    with _crew(workers, scheduler) as crew:
        work = _UnderWay(function, crew, kept, tell)
        for chunk in chunks:
            if kept is not None and chunk in kept:
                yield chunk, kept[chunk]
                continue
            work.begin(chunk)
            while len(work) >= crew.most:
                yield from work.finished()
        while work:
            yield from work.finished()
        work.pass_on_news()


class _UnderWay(Generic[_Chunk]):
    """The chunks that a crew has at the moment."""

    def __init__(
        self,
        function: Callable[[_Chunk], object],
        crew: Crew,
        kept: Kept | None,
        tell: Callable[[str], object] | None,
    ) -> None:
        self._function, self._crew, self._kept, self._tell = function, crew, kept, tell
        self._begun: dict[Future[Any], tuple[_Chunk, int]] = {}  # and how often it was lost
        self._done: SimpleQueue[Future[Any]] = SimpleQueue()

    def __len__(self) -> int:
        return len(self._begun)

    def begin(self, chunk: _Chunk, losses: int = 0) -> None:
        """Have a chunk computed."""
        future = self._crew.submit(self._function, chunk)
        self._begun[future] = chunk, losses
        future.add_done_callback(self._done.put)

    def pass_on_news(self) -> None:
        """Tell what the crew has heard meanwhile."""
        while self._tell and self._crew.news:
            self._tell(self._crew.news.popleft())

    def finished(self) -> Iterator[tuple[_Chunk, Any]]:
        """Wait a little for the next result, and keep it; or have what was lost computed again."""
        self.pass_on_news()
        try:
            future = self._done.get(timeout=_LOOK_S)
        except Empty:
            return
        chunk, losses = self._begun.pop(future)
        try:
            result = as_read(self._crew.result(future))
        except LostError as error:
            if losses == MOST_LOST:
                raise StoppedError(f"{error} {losses + 1} times with the same work") from error
            self.begin(chunk, losses + 1)
            return
        if self._kept is not None:
            self._kept[chunk] = result
        yield chunk, result


def _crew(workers: int, scheduler: object) -> AbstractContextManager[Crew]:
    if scheduler is not None:
        from analysis.workers.cluster import cluster

        return cluster(scheduler)
    return nullcontext(Alone()) if workers == 1 else processes(workers)
