"""Clocks: a virtual one moves only by waits; what is said of the device's stays true."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device import Clock, MonotonicClock, VirtualClock
from device.clock import resolution_s
from device.wire.sync import ClockSync, Sample


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
    assert clock.now_s() - before_s >= 0.002 - resolution_s(clock)
    assert resolution_s(clock) > 0.0 == resolution_s(VirtualClock())


@pytest.mark.parametrize("clock", [VirtualClock(), MonotonicClock()], ids=["virtual", "monotonic"])
@pytest.mark.parametrize("duration_s", [-1e-9, math.nan, math.inf, True, "1"])
def test_a_wait_that_is_no_duration_is_refused(clock: Clock, duration_s: float) -> None:
    with pytest.raises(ValueError, match="duration_s"):
        clock.wait(duration_s)


def exchanges(
    rng: np.random.Generator, n_samples: int, *, drift: float, offset_s: float
) -> list[tuple[float, Sample]]:
    """Draw exchanges with the host time at which the device read its clock."""
    host_s, drawn = offset_s + 1.0, []
    for _ in range(n_samples):
        host_s += float(rng.exponential(0.3))
        there_s, back_s = rng.exponential(0.001, size=2) + (rng.random(2) < 0.1) * 0.3
        at_s = host_s + float(there_s)
        after_s = at_s + float(back_s)
        device_s = math.floor((at_s - offset_s) * (1 - drift) * 1e6) / 1e6
        drawn.append((at_s, Sample(before_s=host_s, after_s=after_s, device_s=device_s)))
        host_s = after_s
    return drawn


@settings(max_examples=10)
@given(
    seed=st.integers(0, 2**32 - 1), drift_ppm=st.floats(-99.0, 99.0), offset_s=st.floats(0.0, 1e5)
)
def test_narrowed_times_always_hold_the_true_one(
    seed: int, drift_ppm: float, offset_s: float
) -> None:
    sync, narrower = ClockSync(), 0
    rng = np.random.default_rng(seed)
    for at_s, sample in exchanges(rng, 200, drift=drift_ppm * 1e-6, offset_s=offset_s):
        before_s, after_s = sync.bounds(sample)
        assert before_s - 1e-9 <= at_s <= after_s + 1e-9
        assert sample.before_s <= before_s <= after_s <= sample.after_s
        narrower += after_s - before_s < sample.after_s - sample.before_s
        sync.add(sample)
    assert narrower > 50


def test_before_a_sample_nothing_is_known_and_after_one_its_bounds() -> None:
    sync, sample = ClockSync(tolerance=5e-5), Sample(before_s=5.0, after_s=6.0, device_s=1.0)
    assert sync.bounds(sample) == (5.0, 6.0)
    sync.add(sample)
    later = Sample(before_s=100_004.0, after_s=100_016.0, device_s=100_001.0)
    assert sync.bounds(later) == pytest.approx((100_004.0, 100_011.0), abs=1e-4)


def test_a_clock_that_jumped_is_learned_anew() -> None:
    sync = ClockSync()
    for host_s in map(float, range(100, 110)):
        sync.add(Sample(before_s=host_s, after_s=host_s + 1e-4, device_s=host_s - 100.0))
    jumped = Sample(before_s=111.0, after_s=111.5, device_s=50.25)
    assert sync.bounds(jumped) == (111.0, 111.5)
    sync.add(jumped)
    later = Sample(before_s=112.0, after_s=114.0, device_s=52.25)
    before_s, after_s = sync.bounds(later)
    assert after_s - before_s < 0.6
    assert before_s <= 113.25 <= after_s
