"""Counts and volts: never more than what was asked for, within the rail of the amplifier."""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from device import Emission, Limits, OutputStage, Refusal, Rejected
from device.core.messages import (
    Arm,
    Levels,
    LoadSlot,
    check_millivolts,
    check_slot,
    check_token,
    full_scale,
    to_codes,
    to_microseconds,
    to_millivolts,
)
from tests.test_device.bursts import BURST, refusal

CEILING = Limits(ceiling_vpp=200.0)
ZEROS = np.zeros((2, 2), dtype=np.int32)


@settings(deadline=None, max_examples=200)
@given(level_vpp=st.floats(0.0, 4e6), on_grid_mvpp=st.integers(0, 10_000_000))
def test_a_level_is_rounded_toward_zero_to_millivolts(level_vpp: float, on_grid_mvpp: int) -> None:
    level_mvpp = to_millivolts(level_vpp)
    assert level_mvpp - 1e-3 <= level_vpp * 1000 < level_mvpp + 1
    assert to_millivolts(on_grid_mvpp / 1000) == on_grid_mvpp


@settings(deadline=None, max_examples=200)
@given(sample=st.floats(-1.0, 1.0), bits=st.integers(2, 24))
@example(sample=1.0, bits=16)
@example(sample=-0.0, bits=2)
def test_codes_are_odd_and_toward_zero_and_reach_full_scale(sample: float, bits: int) -> None:
    ((code,), (mirrored,)) = to_codes([[sample], [-sample]], bits)
    assert mirrored == -code
    assert abs(code) <= abs(sample) * full_scale(bits) < abs(code) + 1


NO_NUMBERS: tuple[tuple[Callable[[Any], object], Refusal, list[Any]], ...] = (
    (to_millivolts, Refusal.BAD_LEVEL, [-0.001, math.nan, math.inf, 1e308, 4_294_968.0, True, "6"]),
    (check_millivolts, Refusal.BAD_LEVEL, [-1, 2**32, 1.0, True]),
    (check_token, Refusal.BAD_TOKEN, [0, -1, 2**64, 1.0, True, "1", None]),
    (check_slot, Refusal.BAD_SLOT, [-1, 256, 0.0, False, "0"]),
    (to_microseconds, Refusal.BAD_TIME_TO_LIVE, [math.nan, math.inf, True, "1"]),
    (lambda slot: LoadSlot(slot=slot, codes=ZEROS), Refusal.BAD_SLOT, [256]),
    (lambda right: Levels(levels_mvpp=(0, right)), Refusal.BAD_LEVEL, [-1]),
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


def render(
    stage: OutputStage, levels_mvpp: tuple[int, int], limits: Limits = CEILING, *, peak: float = 1.0
) -> NDArray[np.float64]:
    codes = to_codes([peak * BURST] * 2, stage.bits)
    return stage.render(codes, levels_mvpp=levels_mvpp, limits=limits)


@given(
    code=st.integers(-(2**23) + 1, 2**23 - 1),
    level_mvpp=st.integers(0, 2**32 - 1),
    rail_v=st.sampled_from([100.0, 3_000.0, 1e6]),
)
def test_a_code_is_scaled_without_rounding_but_at_last(
    code: int, level_mvpp: int, rail_v: float
) -> None:
    stage = OutputStage(bits=24, rail_v=rail_v)
    limits = Limits(ceiling_vpp=4e12)
    volts = stage.render(np.array([[code], [0]]), levels_mvpp=(level_mvpp, 0), limits=limits)
    exact = abs(code) * level_mvpp // Fraction(2000 * rail_v)
    assume(exact <= full_scale(24))  # beyond it, the rail limits the output
    assert abs(volts[0, 0]) == int(exact) * rail_v / full_scale(24)


def test_the_ceiling_itself_is_reached_exactly_and_cannot_be_written_over() -> None:
    volts = render(OutputStage(), (200_000, 200_000))
    assert (volts.max(), volts.min()) == (100.0, -100.0)
    with pytest.raises(ValueError, match="read-only"):
        volts[0, 0] = 1.0


@settings(deadline=None, max_examples=100)
@given(level_mvpp=st.integers(1000, 200_000), bits=st.integers(8, 24))
def test_the_volts_follow_waveform_and_level_within_two_steps_of_the_converter(
    level_mvpp: int, bits: int
) -> None:
    stage = OutputStage(bits=bits)
    volts = render(stage, (level_mvpp, 2 * level_mvpp), Limits(ceiling_vpp=400.0))
    step_v = stage.rail_v / full_scale(bits)
    wanted_v = BURST * level_mvpp / 2000
    assert np.abs(volts[0] - wanted_v).max() <= 2 * step_v
    assert np.all(np.abs(volts[0]) <= np.abs(wanted_v) * (1 + 1e-12) + 1e-12)
    assert np.allclose(volts[0] / step_v, np.rint(volts[0] / step_v), atol=1e-6)
    assert np.all((volts[:, 0] == 0.0) & (volts[:, -1] == 0.0))


def test_beyond_the_rail_the_amplifier_saturates() -> None:
    volts = render(OutputStage(rail_v=60.0), (200_000, 100_000))
    assert (volts[0].max(), volts[0].min()) == (60.0, -60.0)
    assert volts[1].max() == pytest.approx(50.0, abs=0.01)


def emission(n_samples: int) -> Emission:
    return Emission(
        token=1,
        start_us=1000,
        volts=np.array([[1.0], [2.0]]).repeat(n_samples, axis=1),
        levels_vpp=(2.0, 4.0),
        sample_rate_hz=48_000.0,
    )


@settings(deadline=None, max_examples=100)
@given(n_samples=st.integers(1, 500), cut_us=st.integers(1000, 20_000))
def test_a_cut_burst_is_zero_from_the_first_sample_that_begins_at_or_after_the_cut(
    n_samples: int, cut_us: int
) -> None:
    whole = emission(n_samples)
    cut = whole.cut(cut_us)
    begin_us = 1000 + np.arange(n_samples) * 1e6 / 48_000
    before = begin_us < cut_us - 1e-6
    assert np.array_equal(cut.volts, whole.volts * before)
    assert (cut.cut_us, cut.token, cut.start_us) == (cut_us, 1, 1000)
    assert whole.volts.all()


def test_a_burst_lasts_its_samples_and_cannot_be_cut_before_it_began() -> None:
    assert emission(96).duration_us == 2000
    assert emission(97).duration_us == 2021
    with pytest.raises(ValueError, match="at_us"):
        emission(96).cut(999)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("sample_rate_hz", 0.0),
        ("bits", 1),
        ("bits", 25),
        ("bits", 16.0),
        ("rail_v", -1.0),
        ("channels", 0),
        ("channels", 65),
    ],
)
def test_an_output_stage_that_cannot_be_is_refused_by_name(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{field} .*{value!r}"):
        OutputStage(**{field: value})  # type: ignore[arg-type]  # wrong types are the point
