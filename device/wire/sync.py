"""What the exchanges with a device say of its clock against the host's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from device.clock import CLOCK_TOLERANCE

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
    >>> sync.add(Sample(before_s=10.0, after_s=10.001, device_s=0.0005))
    >>> slow = Sample(before_s=11.0, after_s=11.5, device_s=1.4)
    >>> [round(bound_s, 4) for bound_s in sync.bounds(slow)]
    [11.3994, 11.4006]
    >>> sync.bounds(Sample(before_s=12.0, after_s=12.1, device_s=9.0))
    (12.0, 12.1)
    """

    def __init__(self, tolerance: float = CLOCK_TOLERANCE) -> None:
        self._tolerance = tolerance
        self._offset_s: tuple[float, float] | None = None
        self._at_s = 0.0

    def add(self, sample: Sample) -> None:
        """Learn from an exchange."""
        low_s, high_s = (
            sample.before_s - sample.device_s - _STEP_S,
            sample.after_s - sample.device_s,
        )
        offset_s = self._offset_at(sample)
        if offset_s is not None and offset_s[0] <= high_s and low_s <= offset_s[1]:
            low_s, high_s = max(offset_s[0], low_s), min(offset_s[1], high_s)
        self._offset_s = low_s, high_s
        self._at_s = sample.device_s

    def bounds(self, sample: Sample) -> tuple[float, float]:
        """Return the host times between which the device's clock showed a sample's time.

        Those of the sample itself, narrowed by what earlier samples say of the offset; where that
        contradicts the sample, the sample's own.
        """
        offset_s = self._offset_at(sample)
        if offset_s is None:
            return sample.before_s, sample.after_s
        before_s = max(sample.before_s, sample.device_s + offset_s[0])
        after_s = min(sample.after_s, sample.device_s + _STEP_S + offset_s[1])
        return (before_s, after_s) if before_s <= after_s else (sample.before_s, sample.after_s)

    def _offset_at(self, sample: Sample) -> tuple[float, float] | None:
        """Return the bounds on host clock less device clock at the time of a sample."""
        if self._offset_s is None:
            return None
        drift_s = self._tolerance * abs(sample.device_s - self._at_s)
        return self._offset_s[0] - drift_s, self._offset_s[1] + drift_s
