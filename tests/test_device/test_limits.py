"""Limits: nothing above a ceiling passes, and what passes begins, ends and averages at zero."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from device import LimitExceeded, Limits, Refusal, Rejected
from device.core.messages import to_codes, to_millivolts
from device.limits import check_ceiling, check_codes, check_rest, check_time_to_live
from tests.test_device.bursts import BURST, SILENCE, changed, refusal

LIMITS = Limits(ceiling_vpp=200.0)


FULL = 32767


def passes(peak: int, level_mvpp: int, limits: Limits) -> bool:
    try:
        check_ceiling((0, peak), (0, level_mvpp), full_scale=FULL, limits=limits)
    except LimitExceeded as refused:
        return refused.code is not Refusal.CEILING
    return True


@settings(deadline=None, max_examples=100)
@given(
    peak=st.integers(0, FULL),
    level_mvpp=st.integers(0, 10**7),
    ceiling_mvpp=st.integers(1, 10**7),
)
@example(peak=FULL, level_mvpp=200_000, ceiling_mvpp=200_000)
@example(peak=FULL, level_mvpp=200_001, ceiling_mvpp=200_000)
def test_a_burst_passes_just_if_its_exact_product_is_within_the_ceiling(
    peak: int, level_mvpp: int, ceiling_mvpp: int
) -> None:
    limits = Limits(ceiling_vpp=ceiling_mvpp / 1000)
    assert limits.ceiling_mvpp == ceiling_mvpp
    within = Fraction(peak, FULL) * level_mvpp <= ceiling_mvpp
    assert passes(peak, level_mvpp, limits) is within


def test_a_level_is_held_against_the_ceiling_rounded_up_and_sent_rounded_down() -> None:
    for level_vpp in (199.9991, 200.0, 200.0009):
        down, up = to_millivolts(level_vpp), to_millivolts(level_vpp, up=True)
        assert down / 1000 <= level_vpp <= up / 1000
        assert up - down == (level_vpp != 200.0)


def check(*channels: NDArray[np.float64]) -> tuple[int, ...]:
    """Convert samples and check their codes, as the host does before it sends them."""
    codes = to_codes(np.stack(channels), 16)
    return check_codes(codes, full_scale=FULL, limits=LIMITS)


def test_the_peaks_come_back_and_silence_has_none() -> None:
    assert check(BURST, SILENCE) == (FULL, 0)
    assert check(-0.25 * BURST, 0.5 * BURST) == (FULL // 4, FULL // 2)
    assert check(BURST, *[SILENCE] * 14, 0.5 * BURST) == (FULL, *[0] * 14, FULL // 2)


REFUSED = [
    (np.zeros(0), Refusal.WAVEFORM_EMPTY),
    (np.zeros(LIMITS.longest_waveform + 1), Refusal.WAVEFORM_TOO_LONG),
    (changed(3, math.nan), Refusal.NOT_FINITE),
    (changed(3, math.inf), Refusal.NOT_FINITE),
    (changed(3, -math.inf), Refusal.NOT_FINITE),
    (changed(24, 1.0 + 1e-15), Refusal.OUT_OF_RANGE),
    (changed(72, -1.5), Refusal.OUT_OF_RANGE),
    (changed(0, 1e-4), Refusal.EDGES_NOT_ZERO),
    (changed(-1, -1e-4), Refusal.EDGES_NOT_ZERO),
    (np.abs(BURST), Refusal.DC),
    (BURST[:73] * np.r_[np.ones(72), 0.0], Refusal.DC),
]


@pytest.mark.parametrize(("samples", "code"), REFUSED)
def test_a_bad_waveform_is_refused_with_its_own_code_on_every_channel(
    samples: NDArray[np.float64], code: Refusal
) -> None:
    channels = [np.zeros(samples.size)] * 3
    for i in range(3):
        waveforms = [*channels[:i], samples, *channels[i + 1 :]]
        assert refusal(lambda: check(*waveforms), Rejected) is code  # noqa: B023 - called here


@settings(deadline=None, max_examples=40)
@given(
    durations_us=st.lists(st.integers(1, 1_000_000), min_size=2, max_size=20),
    max_duty=st.floats(0.01, 1.0),
    min_interval_s=st.floats(0.0, 0.5),
)
@example(durations_us=[1, 1], max_duty=math.nextafter(1.0, 0.0), min_interval_s=0.0)
def test_bursts_as_early_as_allowed_keep_the_duty_over_any_time(
    durations_us: list[int], max_duty: float, min_interval_s: float
) -> None:
    limits = Limits(ceiling_vpp=1.0, max_duty=max_duty, min_interval_s=min_interval_s)
    elapsed_us = 0
    for duration_us in durations_us:
        least_us = duration_us + round(min_interval_s * 1e6)
        earliest_us = max(least_us, -(-duration_us * 10**6 // limits.max_duty_ppm))
        check_rest(since_onset_us=earliest_us, duration_us=duration_us, limits=limits)
        with pytest.raises(LimitExceeded):
            check_rest(since_onset_us=earliest_us - 1, duration_us=duration_us, limits=limits)
        elapsed_us += earliest_us
    # Exact for the whole parts per million in which a device counts; and those are not above what
    # was asked for, except by the last digits of a float.
    assert sum(durations_us) * 10**6 <= limits.max_duty_ppm * elapsed_us
    assert limits.max_duty_ppm <= max_duty * 1e6 + 1e-6


@pytest.mark.parametrize("time_to_live_us", [-1, 0, 10_000_001])
def test_a_time_to_live_outside_its_range_is_refused(time_to_live_us: int) -> None:
    check_time_to_live(1, LIMITS)
    check_time_to_live(10_000_000, LIMITS)
    code = refusal(lambda: check_time_to_live(time_to_live_us, LIMITS), Rejected)
    assert code is Refusal.BAD_TIME_TO_LIVE


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ceiling_vpp", 0.0),
        ("ceiling_vpp", math.nan),
        ("ceiling_vpp", True),
        ("ceiling_vpp", "200"),
        ("min_interval_s", -0.1),
        ("max_duty", 1.1),
        ("longest_waveform", 0),
        ("longest_waveform", 1e3),
        ("longest_waveform", 2**31 + 1),
        ("dc_tolerance", 0.0),
        ("longest_time_to_live_s", 0.0),
        ("slots", 256),
        ("slots", 0),
    ],
)
def test_limits_that_are_none_are_refused_by_name(name: str, value: float) -> None:
    given_limits: dict[str, float] = {"ceiling_vpp": 200.0} | {name: value}
    with pytest.raises(ValueError, match=f"{name} .*{value!r}"):
        Limits(**given_limits)  # type: ignore[arg-type]  # wrong types are the point


def test_what_no_study_says_of_its_limits_is_cautious() -> None:
    assert Limits(ceiling_vpp=200.0) == Limits(
        ceiling_vpp=200.0,
        min_interval_s=0.05,
        max_duty=0.5,
        longest_waveform=2**16,
        dc_tolerance=0.01,
        longest_time_to_live_s=10.0,
    )
    for longest, slots in ((1, 255), (2**31, 1)):
        limits = Limits(ceiling_vpp=200.0, longest_waveform=longest, slots=slots)
        assert (limits.longest_waveform, limits.slots) == (longest, slots)


def test_a_device_counts_its_limits_in_whole_numbers() -> None:
    limits = Limits(ceiling_vpp=64.1, min_interval_s=0.0123, max_duty=0.3, dc_tolerance=0.07)
    assert (limits.ceiling_mvpp, limits.least_interval_us) == (64_100, 12_300)
    assert (limits.max_duty_ppm, limits.dc_tolerance_ppm) == (300_000, 70_000)
    assert limits.longest_time_to_live_us == 10_000_000
    assert Limits(ceiling_vpp=64.0999).ceiling_mvpp == 64_099


def test_a_device_compares_without_rounding() -> None:
    limits = Limits(ceiling_vpp=200.0)
    full = 2**23 - 1
    check_ceiling((full - 1, full), (200_000, 200_000), full_scale=full, limits=limits)
    with pytest.raises(LimitExceeded):
        check_ceiling((0, full - 1), (0, 200_001), full_scale=full, limits=limits)
    most_mvpp = 200_000 * full // (full // 2)
    check_ceiling((full // 2, 0), (most_mvpp, 0), full_scale=full, limits=limits)
    with pytest.raises(LimitExceeded):
        check_ceiling((full // 2, 0), (most_mvpp + 1, 0), full_scale=full, limits=limits)
    codes = np.array([[0, 505, -495, 0], [0] * 4])
    assert check_codes(codes, full_scale=full, limits=limits) == (505, 0)
    codes[0, 1] += 1
    with pytest.raises(LimitExceeded):
        check_codes(codes, full_scale=full, limits=limits)
