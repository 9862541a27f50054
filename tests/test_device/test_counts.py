"""Counts: what is carried to the device never stands for more than what was asked for."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from device.core.messages import (
    Arm,
    Levels,
    LoadSlot,
    as_waveform,
    check_millivolts,
    check_slot,
    check_token,
    full_scale,
    to_codes,
    to_microseconds,
    to_millivolts,
)
from device.errors import Refusal, Rejected
from tests.test_device.bursts import refusal

ZEROS = np.zeros(2, dtype=np.int32)


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(level_vpp=st.floats(0.0, 4e6))
def test_a_level_is_rounded_toward_zero_to_millivolts(level_vpp: float) -> None:
    level_mvpp = to_millivolts(level_vpp)
    assert level_mvpp - 1e-3 <= level_vpp * 1000 < level_mvpp + 1


@pytest.mark.slow
@given(level_mvpp=st.integers(0, 10_000_000))
@settings(deadline=None, max_examples=300)
def test_a_level_on_the_grid_stays_what_it_is(level_mvpp: int) -> None:
    assert to_millivolts(level_mvpp / 1000) == level_mvpp


@settings(deadline=None, max_examples=200)
@given(sample=st.floats(-1.0, 1.0), bits=st.integers(2, 24))
@example(sample=1.0, bits=16)
@example(sample=-0.0, bits=2)
def test_codes_are_odd_and_toward_zero_and_reach_full_scale(sample: float, bits: int) -> None:
    (code,) = to_codes(np.array([sample]), bits)
    (mirrored,) = to_codes(np.array([-sample]), bits)
    assert mirrored == -code
    assert abs(code) <= abs(sample) * full_scale(bits) < abs(code) + 1


NO_NUMBERS: tuple[tuple[Callable[[Any], object], Refusal, list[Any]], ...] = (
    (to_millivolts, Refusal.BAD_LEVEL, [-0.001, math.nan, math.inf, 1e308, 4_294_968.0, True, "6"]),
    (check_millivolts, Refusal.BAD_LEVEL, [-1, 2**32, 1.0, True]),
    (check_token, Refusal.BAD_TOKEN, [0, -1, 2**64, 1.0, True, "1", None]),
    (check_slot, Refusal.BAD_SLOT, [-1, 256, 0.0, False, "0"]),
    (to_microseconds, Refusal.BAD_TIME_TO_LIVE, [math.nan, math.inf, True, "1"]),
    (lambda slot: LoadSlot(slot=slot, left=ZEROS, right=ZEROS), Refusal.BAD_SLOT, [256]),
    (lambda right: Levels(left_mvpp=0, right_mvpp=right), Refusal.BAD_LEVEL, [-1]),
    (lambda token: Arm(token=token, slot=0, time_to_live_us=1), Refusal.BAD_TOKEN, [0]),
)


@pytest.mark.parametrize(
    ("make", "code", "wrong"),
    [(make, code, wrong) for make, code, values in NO_NUMBERS for wrong in values],
)
def test_what_is_no_level_token_slot_or_time_to_live_is_refused_as_such(
    make: Callable[[Any], object], code: Refusal, wrong: Any
) -> None:
    assert refusal(lambda: make(wrong), Rejected) is code


@pytest.mark.parametrize("token", [1, 2**64 - 1, np.uint64(2**64 - 1), np.int64(5)])
def test_a_token_comes_back_as_a_plain_integer(token: int) -> None:
    assert (type(check_token(token)), check_token(token)) == (int, token)


@pytest.mark.parametrize(
    "samples", [[True, False], ["0"], [[0.0, 0.0]], 0.0, [0j, 0j], [None, None]]
)
def test_what_is_no_row_of_real_numbers_is_refused(samples: Any) -> None:
    with pytest.raises(ValueError, match="right must be a one-dimensional array of real numbers"):
        as_waveform("right", samples)
