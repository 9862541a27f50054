"""Samples of a burst: their number, their ends, their symmetry."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

from stimuli import Burst
from stimuli.drive.windows import WINDOWS, Window

if TYPE_CHECKING:
    from collections.abc import Callable

PAPER = Burst(frequency_hz=500.0, cycles=1, window="none")
"""The paper's burst (section IV-A)."""

windows = st.sampled_from(WINDOWS)
laws = settings(deadline=None, max_examples=80)


@given(
    window=windows,
    cycles=st.integers(1, 30),
    frequency_hz=st.floats(1.0, 5e3),
    per_cycle=st.floats(4.0, 300.0),
)
@laws
def test_every_burst_starts_and_ends_at_exactly_zero_within_unit_amplitude(
    window: Window, cycles: int, frequency_hz: float, per_cycle: float
) -> None:
    burst = Burst(frequency_hz=frequency_hz, cycles=cycles, window=window)
    samples = burst.samples(per_cycle * frequency_hz)
    assert samples.dtype == np.float64
    assert samples[0] == samples[-1] == 0.0
    assert np.all(np.abs(samples) <= 1.0)
    assert not np.any(np.signbit(samples[[0, -1]]))


@given(
    window=windows,
    cycles=st.integers(1, 30),
    per_cycle=st.integers(4, 300),
    frequency_hz=st.floats(1e-3, 1e5),
)
@laws
def test_a_whole_number_of_samples_is_recognised_and_exactly_antisymmetric(
    window: Window, cycles: int, per_cycle: int, frequency_hz: float
) -> None:
    burst = Burst(frequency_hz=frequency_hz, cycles=cycles, window=window)
    samples = burst.samples(per_cycle * frequency_hz)
    assert samples.size == cycles * per_cycle + 1
    np.testing.assert_array_equal(samples, -samples[::-1])


@pytest.mark.slow
@given(
    window=windows,
    cycles=st.integers(1, 12),
    frequency_hz=st.floats(10.0, 2e3),
    rate_hz=st.floats(8e3, 1e5),
)
@laws
def test_samples_are_window_times_sine_at_their_times(
    window: Window, cycles: int, frequency_hz: float, rate_hz: float
) -> None:
    burst = Burst(frequency_hz=frequency_hz, cycles=cycles, window=window)
    samples = burst.samples(rate_hz)
    times_s = np.arange(samples.size) / rate_hz
    u = times_s / burst.duration_s
    shape = {
        "none": np.ones_like(u),
        "hann": 0.5 - 0.5 * np.cos(2 * np.pi * u),
        "tukey": np.where(np.minimum(u, 1 - u) < 0.25, 0.5 - 0.5 * np.cos(4 * np.pi * u), 1.0),
        "gaussian": np.exp(-0.5 * ((u - 0.5) * 6) ** 2),
    }[window]
    expected = shape * np.sin(2 * np.pi * frequency_hz * times_s)
    np.testing.assert_allclose(samples[:-1], expected[:-1], atol=1e-12)
    assert times_s[-2] < burst.duration_s * (1 + 1e-12)
    assert times_s[-1] >= burst.duration_s * (1 - 1e-12)


def test_the_papers_burst_has_97_samples_at_48_khz_and_at_least_five() -> None:
    samples = PAPER.samples(48_000)
    assert samples.size == 97
    assert samples[[24, 48, 72]].tolist() == [1.0, 0.0, -1.0]
    assert PAPER.samples(2000).tolist() == [0.0, 1.0, 0.0, -1.0, 0.0]


@pytest.mark.parametrize("window", WINDOWS)
def test_rounding_adds_no_sample(window: Window) -> None:
    for frequency_hz, rate_hz, size in ((0.1, 480.0, 4801), (0.3, 9.0, 31)):
        burst = Burst(frequency_hz=frequency_hz, cycles=1, window=window)
        assert burst.samples(rate_hz).size == size


def test_a_burst_that_ends_between_samples_gets_one_more_which_is_zero() -> None:
    burst = Burst(frequency_hz=441.0, cycles=1, window="none")
    samples = burst.samples(48_000.0)
    assert samples.size == math.ceil(48_000 / 441) + 1
    assert samples[-2] == pytest.approx(math.sin(2 * math.pi * 441 * 108 / 48_000), abs=1e-12)
    assert samples[-1] == 0.0


def test_every_half_cycle_is_an_exact_zero() -> None:
    samples = Burst(frequency_hz=500.0, cycles=7, window="tukey").samples(48_000.0)
    assert np.all(samples[::48] == 0.0)
    assert np.count_nonzero(samples) == samples.size - 15


def test_a_burst_is_one_cycle_without_a_window_unless_told_otherwise() -> None:
    assert Burst(frequency_hz=500) == PAPER
    assert Burst(frequency_hz=250.0, cycles=3, window="hann").duration_s == 0.012


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("cycles", [1, 2, 5, 40])
def test_the_energy_duration_is_that_of_the_sine_of_equal_peak_and_energy(
    window: Window, cycles: int
) -> None:
    shape: Callable[[float], float] = {
        "none": lambda t: 1.0,
        "hann": lambda t: math.sin(math.pi * t) ** 2,
        "tukey": lambda t: math.sin(2 * math.pi * min(t, 1 - t, 0.25)) ** 2,
        "gaussian": lambda t: math.exp(-18 * (t - 0.5) ** 2),
    }[window]

    def value(t: float) -> float:
        return shape(t) * math.sin(2 * math.pi * cycles * t)

    energy, _ = quad(lambda t: value(t) ** 2, 0, 1, limit=1000, epsabs=1e-11)
    at = np.linspace(0, 1, 40 * cycles + 1)
    near = at[np.argmax([abs(value(t)) for t in at])]
    ends = (max(near - 0.03 / cycles, 0.0), min(near + 0.03 / cycles, 1.0))
    peak = -minimize_scalar(lambda t: -abs(value(t)), bounds=ends, method="bounded").fun
    burst = Burst(frequency_hz=170.0, cycles=cycles, window=window)
    expected_s = 2 * energy / peak**2 * cycles / 170.0
    assert burst.energy_duration_s == pytest.approx(expected_s, rel=5e-5)
    if window == "none":
        assert burst.energy_duration_s == pytest.approx(burst.duration_s, rel=1e-12)
