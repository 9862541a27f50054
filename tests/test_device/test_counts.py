"""Counts: what is carried to the device never stands for more than what was asked for."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device.core.messages import (
    Arm,
    Levels,
    Load,
    as_waveform,
    check_millivolts,
    check_slot,
    check_token,
    full_scale,
    to_codes,
    to_microseconds,
    to_millivolts,
)
from device.driver import Refusal, Rejected


@settings(deadline=None, max_examples=300)
@given(level_vpp=st.floats(0.0, 4e6))
def test_a_level_is_rounded_toward_zero_to_millivolts(level_vpp: float) -> None:
    level_mvpp = to_millivolts(level_vpp)
    assert level_mvpp - 1e-3 <= level_vpp * 1000 < level_mvpp + 1


@given(level_mvpp=st.integers(0, 10_000_000))
@settings(deadline=None, max_examples=300)
def test_a_level_on_the_grid_stays_what_it_is(level_mvpp: int) -> None:
    assert to_millivolts(level_mvpp / 1000) == level_mvpp


@pytest.mark.parametrize("level_vpp", [-0.001, math.nan, math.inf, 1e308, 4_294_968.0, True, "60"])
def test_what_is_no_level_is_refused(level_vpp: Any) -> None:
    with pytest.raises(Rejected) as refused:
        to_millivolts(level_vpp)
    assert refused.value.code is Refusal.BAD_LEVEL


@settings(deadline=None, max_examples=200)
@given(sample=st.floats(-1.0, 1.0), bits=st.integers(2, 24))
def test_codes_are_odd_and_toward_zero(sample: float, bits: int) -> None:
    (code,) = to_codes(np.array([sample]), bits)
    (mirrored,) = to_codes(np.array([-sample]), bits)
    assert mirrored == -code
    assert abs(code) <= abs(sample) * full_scale(bits) < abs(code) + 1


@pytest.mark.parametrize("bits", [2, 12, 16, 24])
def test_full_scale_is_reached_by_one_and_zero_stays_zero(bits: int) -> None:
    codes = to_codes(np.array([0.0, 1.0, -1.0, -0.0]), bits)
    assert codes.tolist() == [0, full_scale(bits), -full_scale(bits), 0]


@pytest.mark.parametrize("token", [0, -1, 2**64, 1.0, True, "1", None])
def test_what_is_no_token_is_refused(token: Any) -> None:
    with pytest.raises(Rejected) as refused:
        check_token(token)
    assert refused.value.code is Refusal.BAD_TOKEN


@pytest.mark.parametrize("token", [1, 2**64 - 1, np.uint64(2**64 - 1), np.int64(5)])
def test_a_token_comes_back_as_a_plain_integer(token: int) -> None:
    assert type(check_token(token)) is int
    assert check_token(token) == token


@pytest.mark.parametrize("slot", [-1, 8, 0.0, False, "0"])
def test_what_is_no_slot_is_refused(slot: Any) -> None:
    with pytest.raises(Rejected) as refused:
        check_slot(slot)
    assert refused.value.code is Refusal.BAD_SLOT


@pytest.mark.parametrize("level_mvpp", [-1, 2**32, 1.0, True])
def test_millivolts_beyond_the_wire_are_refused(level_mvpp: Any) -> None:
    with pytest.raises(Rejected) as refused:
        check_millivolts(level_mvpp)
    assert refused.value.code is Refusal.BAD_LEVEL


@pytest.mark.parametrize("time_to_live_s", [math.nan, math.inf, True, "1"])
def test_what_is_no_time_to_live_is_refused(time_to_live_s: Any) -> None:
    with pytest.raises(Rejected) as refused:
        to_microseconds(time_to_live_s)
    assert refused.value.code is Refusal.BAD_TIME_TO_LIVE


@pytest.mark.parametrize(
    "samples", [[True, False], ["0"], [[0.0, 0.0]], 0.0, [0j, 0j], [None, None]]
)
def test_what_is_no_row_of_real_numbers_is_refused(samples: Any) -> None:
    with pytest.raises(ValueError, match="right must be a one-dimensional array of real numbers"):
        as_waveform("right", samples)


def test_a_message_that_exists_is_well_formed() -> None:
    silence = np.zeros(2, dtype=np.int32)
    with pytest.raises(Rejected):
        Load(slot=9, left=silence, right=silence)
    with pytest.raises(Rejected):
        Levels(left_mvpp=0, right_mvpp=-1)
    with pytest.raises(Rejected):
        Arm(token=0, slot=0, time_to_live_us=1)
