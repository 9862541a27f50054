"""Clocks: a virtual one moves only by waits."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device import Clock, MonotonicClock, VirtualClock


@settings(deadline=None, max_examples=50)
@given(start_s=st.floats(-1e6, 1e6), waits_s=st.lists(st.floats(0.0, 1e4), max_size=20))
def test_a_virtual_clock_shows_its_start_plus_the_waits_and_nothing_else(
    start_s: float, waits_s: list[float]
) -> None:
    clock = VirtualClock(start_s=start_s)
    for wait_s in waits_s:
        before_s = clock.now_s()
        clock.wait(wait_s)
        assert clock.now_s() == clock.now_s() >= before_s
    assert clock.now_s() == pytest.approx(start_s + math.fsum(waits_s), abs=1e-8)


def test_a_monotonic_clock_waits_at_least_what_it_is_told() -> None:
    clock = MonotonicClock()
    before_s = clock.now_s()
    clock.wait(0.002)
    assert clock.now_s() - before_s >= 0.002 - 1e-6


@pytest.mark.parametrize("clock", [VirtualClock(), MonotonicClock()], ids=["virtual", "monotonic"])
@pytest.mark.parametrize("duration_s", [-1e-9, math.nan, math.inf, True, "1"])
def test_a_wait_that_is_no_duration_is_refused(clock: Clock, duration_s: float) -> None:
    with pytest.raises(ValueError, match="duration_s"):
        clock.wait(duration_s)
