"""Where time comes from: the machine's monotonic clock, or one that a test or dry run moves."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

from device.checks import require_real


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
        """Return the time; it never goes back.

        Returns
        -------
        float
            In seconds.
        """

    def wait(self, duration_s: float) -> None:
        """Return when a time has passed on this clock.

        Parameters
        ----------
        duration_s : float
            In seconds, 0 or more.
        """


class MonotonicClock:
    """The machine's monotonic clock, of which the steps are below a microsecond on every system.

    Examples
    --------
    >>> clock = MonotonicClock()
    >>> earlier_s = clock.now_s()
    >>> clock.wait(0.0)
    >>> clock.now_s() >= earlier_s
    True
    """

    def now_s(self) -> float:
        """Return the machine's monotonic time.

        Returns
        -------
        float
            In seconds.
        """
        return time.perf_counter()

    def wait(self, duration_s: float) -> None:
        """Sleep.

        Parameters
        ----------
        duration_s : float
            In seconds, 0 or more.

        Raises
        ------
        ValueError
            `duration_s` is negative or not finite.
        """
        require_real("duration_s", duration_s, minimum=0.0)
        time.sleep(duration_s)


class VirtualClock:
    """A clock that advances only when something waits on it, by the duration of the wait.

    Parameters
    ----------
    start_s : float
        The first time that it shows, in seconds.

    Raises
    ------
    ValueError
        `start_s` is not finite.

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
        """Return the start plus all waits so far.

        Returns
        -------
        float
            In seconds.
        """
        return self._now_s

    def wait(self, duration_s: float) -> None:
        """Move the clock on.

        Parameters
        ----------
        duration_s : float
            In seconds, 0 or more.

        Raises
        ------
        ValueError
            `duration_s` is negative or not finite.
        """
        require_real("duration_s", duration_s, minimum=0.0)
        self._now_s += duration_s


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineTime:
    """A moment by the machine's own clocks.

    `up_s` counts the seconds since the machine started, including sleep; it cannot be set. `boot`
    differs from start to start, where the system offers it. `wall_s` counts the seconds since
    1970; a user may set it at any time.
    """

    boot: str | None
    up_s: float
    wall_s: float


_UP_CLOCK: Final = getattr(time, "CLOCK_BOOTTIME", getattr(time, "CLOCK_MONOTONIC", None))
_BOOT: Final = Path("/proc/sys/kernel/random/boot_id")


def uptime_s() -> float:
    """Return the seconds since the machine started, including sleep where the system counts it."""
    return time.monotonic() if _UP_CLOCK is None else time.clock_gettime(_UP_CLOCK)


def boot() -> str | None:
    """Return what identifies this start of the machine; None if nothing does."""
    try:
        return _BOOT.read_text(encoding="ascii").strip()
    except OSError:
        return None


def machine_time() -> MachineTime:
    """Return what the machine's clocks show now."""
    return MachineTime(boot=boot(), up_s=uptime_s(), wall_s=time.time())


STARTS_APART_S: Final = 2.0
"""Two starts of one machine are never so close; its calendar clock may drift so far meanwhile."""
_ROUNDING_S: Final = 1e-3
"""A time that was written down may have been rounded upwards."""


def elapsed_s(earlier: MachineTime, later: MachineTime) -> float | None:
    """Return the seconds between two times; None if the machine restarted between them.

    Only the clock that cannot be set is read for this. Where the system does not number its starts,
    two times belong to one start if both clocks agree on when it was. If the calendar clock was
    set, they do not agree, and the elapsed time is unknown.

    >>> noon = MachineTime(boot="a", up_s=100.0, wall_s=43200.0)
    >>> elapsed_s(noon, MachineTime(boot="a", up_s=160.0, wall_s=42060.0))  # the clock was set back
    60.0
    >>> elapsed_s(noon, MachineTime(boot="b", up_s=160.0, wall_s=43260.0)) is None
    True
    """
    if earlier.boot is None or later.boot is None:
        starts_s = [moment.wall_s - moment.up_s for moment in (earlier, later)]
        same = abs(starts_s[1] - starts_s[0]) < STARTS_APART_S
    else:
        same = earlier.boot == later.boot
    up_s = later.up_s - earlier.up_s
    return max(0.0, up_s) if same and up_s > -_ROUNDING_S else None


CLOCK_TOLERANCE: Final = 1e-4
"""Largest relative drift of a device's clock against the host's that a crystal is trusted with."""
