"""Where time comes from, and what the device's clock says of the host's.

A clock is the machine's monotonic one, or one that a test or dry run moves. Every answered question
is a sample of the device's clock: it was read somewhere between the question and the answer. The
fastest exchanges say the most.
"""

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
        """Return the machine's monotonic time.

        Returns
        -------
        float
            In seconds.
        """
        return time.monotonic()

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
        require_real("duration_s", duration_s, least=0.0)
        time.sleep(duration_s)


class VirtualClock:
    """A clock that stands still until it is waited on, then jumps by the wait.

    Parameters
    ----------
    start_s : float
        What it shows first, in seconds.

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
        require_real("duration_s", duration_s, least=0.0)
        self._now_s += duration_s


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineTime:
    """A moment by the machine's own clocks.

    `up_s` counts from the machine's start, sleep included, and nobody can set it; `boot` tells one
    start from another, where the system does. `wall_s`, seconds since 1970, may be set at any time.
    """

    boot: str | None
    up_s: float
    wall_s: float


_UP_CLOCK: Final = getattr(time, "CLOCK_BOOTTIME", getattr(time, "CLOCK_MONOTONIC", None))
_BOOT: Final = Path("/proc/sys/kernel/random/boot_id")


def uptime_s() -> float:
    """Return the seconds since the machine's start, where the system can tell sleep included."""
    return time.monotonic() if _UP_CLOCK is None else time.clock_gettime(_UP_CLOCK)


def boot() -> str | None:
    """Return what tells this start of the machine from its others; None where nothing does."""
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
    """Return the seconds between two times; None where the machine was started anew between them.

    Only by the clock that cannot be set. Where the system does not tell its starts apart, they are
    one if both clocks agree on when that was; a calendar clock that was set makes them two: then
    nobody can tell how much time went by.

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


def resolution_s(clock: Clock) -> float:
    """Return the least step of a clock in seconds; a virtual clock is exact.

    >>> resolution_s(VirtualClock())
    0.0
    >>> 0.0 < resolution_s(MonotonicClock()) < 0.1
    True
    """
    return time.get_clock_info("monotonic").resolution if isinstance(clock, MonotonicClock) else 0.0


WINDOW_S: Final = 10.0
"""Of the samples in so long a time, the one with the least round trip is kept for the drift."""

_STEP_S: Final = 1e-6
"""The device's clock counts microseconds that are over."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """One question and answer on both clocks.

    The device read its own clock, `device_s` in whole microseconds that are over, between the two
    readings of the host's.
    """

    before_s: float
    after_s: float
    device_s: float

    @property
    def round_trip_s(self) -> float:
        """Seconds from question to answer."""
        return self.after_s - self.before_s

    @property
    def offset_s(self) -> float:
        """Host clock less device clock, if the device answered half way."""
        return (self.before_s + self.after_s) / 2 - self.device_s


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockEstimate:
    """The device's clock against the host's.

    The offset, host clock less device clock, is for sure within half the least round trip of the
    latest; the drift, seconds that the host's clock gains on the device's each second, is 0 before
    two windows and within its uncertainty if it was constant.
    """

    offset_s: float
    offset_uncertainty_s: float
    drift: float
    drift_uncertainty: float


CLOCK_TOLERANCE = 1e-4
"""Largest relative drift of a device's clock against the host's that a crystal is trusted with."""


# An exchange proves bounds: the device read its clock after the question was sent and before the
# answer was read. Bounds are carried on by the largest drift and intersected, never averaged: a
# mean would be closer as a rule, and wrong now and then, while an onset's interval is a promise
# that the burst began within it.
class ClockSync:
    """Two clocks kept together by the samples of their exchanges.

    Bounds on the offset hold for sure while the clocks drift by less than `tolerance` against each
    other; samples that contradict one another show that they do not, and begin anew.

    A slow exchange is narrowed by a fast one before it:

    >>> sync = ClockSync()
    >>> sync.hear(Sample(before_s=10.0, after_s=10.001, device_s=0.0005))
    >>> slow = Sample(before_s=11.0, after_s=11.5, device_s=1.4)
    >>> [round(bound_s, 4) for bound_s in sync.narrowed(slow)]
    [11.3994, 11.4006]
    >>> sync.narrowed(Sample(before_s=12.0, after_s=12.1, device_s=9.0))
    (12.0, 12.1)
    """

    def __init__(self, tolerance: float = CLOCK_TOLERANCE) -> None:
        self._tolerance = tolerance
        self._bounds_s: tuple[float, float] | None = None
        self._at_s = 0.0
        self._first: Sample | None = None
        self._latest: Sample | None = None
        self._best: Sample | None = None

    def hear(self, sample: Sample) -> None:
        """Learn from an exchange."""
        bounds_s = self._bounds_at(sample)
        own = sample.before_s - sample.device_s - _STEP_S, sample.after_s - sample.device_s
        if bounds_s is None or bounds_s[0] > own[1] or own[0] > bounds_s[1]:
            self._first = self._latest = self._best = None
            self._bounds_s = own
        else:
            self._bounds_s = max(bounds_s[0], own[0]), min(bounds_s[1], own[1])
        self._at_s = sample.device_s
        self._keep(sample)

    def narrowed(self, sample: Sample) -> tuple[float, float]:
        """Return the host times between which the device's clock showed a sample's time.

        Those of the sample itself, narrowed by what is known of the offset; where that contradicts
        the sample, the sample's own.
        """
        own = sample.before_s, sample.after_s
        bounds_s = self._bounds_at(sample)
        if bounds_s is None:
            return own
        before_s = max(own[0], sample.device_s + bounds_s[0])
        after_s = min(own[1], sample.device_s + _STEP_S + bounds_s[1])
        return (before_s, after_s) if before_s <= after_s else own

    @property
    def estimate(self) -> ClockEstimate | None:
        """Offset and drift by the least round trips, None before the first sample."""
        if self._best is None:
            return None
        drift = drift_uncertainty = 0.0
        if self._first is not None:
            apart_s = self._best.device_s - self._first.device_s
            drift = (self._best.offset_s - self._first.offset_s) / apart_s
            round_trips_s = self._best.round_trip_s + self._first.round_trip_s
            drift_uncertainty = round_trips_s / 2 / apart_s
        return ClockEstimate(
            offset_s=self._best.offset_s,
            offset_uncertainty_s=self._best.round_trip_s / 2,
            drift=drift,
            drift_uncertainty=drift_uncertainty if self._first else self._tolerance,
        )

    def _bounds_at(self, sample: Sample) -> tuple[float, float] | None:
        if self._bounds_s is None:
            return None
        moved_s = self._tolerance * abs(sample.device_s - self._at_s)
        return self._bounds_s[0] - moved_s, self._bounds_s[1] + moved_s

    def _keep(self, sample: Sample) -> None:
        """Keep the fastest sample of the first window and of the latest."""
        if self._latest is None or sample.device_s - self._latest.device_s > WINDOW_S:
            if self._first is None and self._best is not None:
                self._first = self._best
            self._latest = self._best = sample
        elif self._best is None or sample.round_trip_s <= self._best.round_trip_s:
            self._best = sample
