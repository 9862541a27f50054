"""How long something takes: the median of repeats, none of which is asked the same twice."""

from __future__ import annotations

import time
from statistics import median
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Callable

_ENOUGH_S: Final = 1.0


def median_s(run: Callable[[int], object], repeats: int) -> float:
    """Return the median time of `run(number of the repeat)`.

    One more run goes before, untimed. Slow runs are repeated less: the last repeat is the one
    that fills a second.
    """
    times: list[float] = []
    for number in range(repeats + 1):
        start = time.perf_counter()
        run(number)
        times.append(time.perf_counter() - start)
        if number and sum(times[1:]) > _ENOUGH_S:
            break
    return median(times[1:])


def processor_s(run: Callable[[], object], repeats: int = 7) -> float:
    """Return the least processor time of `run`, after one more that is not counted.

    Other programs on the machine change it less than time on the wall.
    """
    times: list[float] = []
    for _ in range(repeats + 1):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return min(times[1:])


def duration(seconds: float) -> str:
    """Return a time in words of three digits."""
    if seconds < 1e-3:
        return f"{seconds * 1e6:.3g} us"
    return f"{seconds * 1e3:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"
