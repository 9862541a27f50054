"""Where time comes from: the machine's monotonic clock, or a clock that a test or dry run moves."""

import time
from typing import Protocol

from device._checks import require_real


class Clock(Protocol):
    """A clock that can be read and waited on; its zero means nothing.

    Examples
    --------
    >>> def nap(clock: Clock) -> float:
    ...     before_s = clock.now_s()
    ...     clock.wait(0.25)
    ...     return clock.now_s() - before_s
    >>> nap(VirtualClock())
    0.25
    """

    def now_s(self) -> float:
        """Return the time in seconds; it never goes back."""

    def wait(self, duration_s: float) -> None:
        """Return when `duration_s` seconds (0 or more) have passed on this clock."""


class MonotonicClock:
    """The machine's monotonic clock.

    Examples
    --------
    >>> clock = MonotonicClock()
    >>> earlier_s = clock.now_s()
    >>> clock.wait(0.0)
    >>> clock.now_s() >= earlier_s
    True
    """

    def now_s(self) -> float:
        """Return the machine's monotonic time in seconds."""
        return time.monotonic()

    def wait(self, duration_s: float) -> None:
        """Sleep for `duration_s` seconds.

        Raises
        ------
        ValueError
            `duration_s` is negative or not finite.
        """
        require_real("duration_s", duration_s, least=0.0)
        time.sleep(duration_s)


class VirtualClock:
    """A clock that stands still until it is waited on, then jumps by the wait.

    Parameters
    ----------
    start_s : float
        What it shows first, in seconds.

    Examples
    --------
    >>> clock = VirtualClock(start_s=10.0)
    >>> clock.wait(3600.0)
    >>> clock.now_s()
    3610.0
    """

    def __init__(self, start_s: float = 0.0) -> None:
        require_real("start_s", start_s)
        self._now_s = float(start_s)

    def now_s(self) -> float:
        """Return the time in seconds: the start plus all waits so far."""
        return self._now_s

    def wait(self, duration_s: float) -> None:
        """Move the clock on by `duration_s` seconds.

        Raises
        ------
        ValueError
            `duration_s` is negative or not finite.
        """
        require_real("duration_s", duration_s, least=0.0)
        self._now_s += duration_s


def resolution_s(clock: Clock) -> float:
    """Return the least step of a clock in seconds; a virtual clock is exact.

    Examples
    --------
    >>> resolution_s(VirtualClock())
    0.0
    >>> 0.0 < resolution_s(MonotonicClock()) < 0.1
    True
    """
    return time.get_clock_info("monotonic").resolution if isinstance(clock, MonotonicClock) else 0.0
