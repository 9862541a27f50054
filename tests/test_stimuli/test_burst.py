"""Drives: samples, exact spectra, bands and energies, staircases, and the check of a burst."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

from stimuli import (
    Burst,
    Drive,
    Fingertip,
    MomentDisc,
    SampledDrive,
    check_burst,
    fingertip_peaks,
    staircase_energy_above,
)
from tests.test_stimuli.plates import HANN, SUPPORTED

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

Window: TypeAlias = Literal["none", "hann", "tukey", "gaussian"]
WINDOWS: tuple[Window, ...] = ("none", "hann", "tukey", "gaussian")
PAPER = Burst(frequency_hz=500.0, cycles=1, window="none")
BY_CYCLES = st.integers(1, 20)

windows = st.sampled_from(WINDOWS)
laws = settings(deadline=None, max_examples=40)
each_window = pytest.mark.parametrize("window", WINDOWS)


def taper(window: Window, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the window at places from 0 to 1 of the burst."""
    tapers = {
        "none": np.ones_like(u),
        "hann": np.sin(np.pi * u) ** 2,
        "tukey": np.sin(2 * np.pi * np.minimum(np.minimum(u, 1 - u), 0.25)) ** 2,
        "gaussian": np.exp(-18 * (u - 0.5) ** 2),
    }
    return np.asarray(tapers[window])


def bursts(cycles: st.SearchStrategy[int]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Draw bursts, and take those whose transform has a case of its own each time."""

    def over(law: Callable[..., None]) -> Callable[..., None]:
        drawn = settings(deadline=None, max_examples=12)(given(window=windows, cycles=cycles)(law))
        for window, few in (("none", 1), ("hann", 1), ("tukey", 1), ("tukey", 2), ("gaussian", 1)):
            drawn = example(window=window, cycles=few)(drawn)
        return drawn

    return over


def burst_of(window: Any, cycles: int, frequency_hz: float = 500.0) -> Burst:
    return Burst(frequency_hz=frequency_hz, cycles=cycles, window=window)


def staircase_energy(burst: Burst, frequency_hz: float, rate_hz: float) -> float:
    samples = burst.samples(rate_hz)
    return staircase_energy_above(samples, sample_rate_hz=rate_hz, frequency_hz=frequency_hz)


def gauss(edges: NDArray[np.float64], nodes: int = 24) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return nodes and weights of a Gauss rule on panels."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    half = np.diff(edges)[:, np.newaxis] / 2
    middle = (edges[:-1, np.newaxis] + edges[1:, np.newaxis]) / 2
    return (middle + half * x).ravel(), (half * w).ravel()


def signal_of(burst: Burst) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return places from 0 to 1 in a burst, their weights in an integral, and the burst there."""
    u, weights = gauss(np.linspace(0.0, 1.0, 16 * burst.cycles + 1))
    return u, weights, taper(burst.window, u) * np.sin(2 * np.pi * burst.cycles * u)


# --- samples -------------------------------------------------------------------------------------


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


@given(
    window=windows,
    cycles=st.integers(1, 30),
    frequency_hz=st.floats(1.0, 5e3),
    per_cycle=st.floats(4.0, 300.0),
)
@laws
def test_samples_are_window_times_sine_at_their_times_and_exact_zeros_at_both_ends(
    window: Window, cycles: int, frequency_hz: float, per_cycle: float
) -> None:
    burst, rate_hz = burst_of(window, cycles, frequency_hz), per_cycle * frequency_hz
    samples = burst.samples(rate_hz)
    assert samples.dtype == np.float64
    assert samples[0] == samples[-1] == 0.0
    assert np.all(np.abs(samples) <= 1.0)
    assert not np.any(np.signbit(samples[[0, -1]]))
    times_s = np.arange(samples.size) / rate_hz
    shape = taper(window, times_s / burst.duration_s)
    expected = shape * np.sin(2 * np.pi * frequency_hz * times_s)
    np.testing.assert_allclose(samples[:-1], expected[:-1], atol=1e-12)
    assert times_s[-2] < burst.duration_s * (1 + 1e-12)
    assert times_s[-1] >= burst.duration_s * (1 - 1e-12)


@pytest.mark.parametrize(
    ("frequency_hz", "cycles", "rate_hz", "size"),
    [
        (500.0, 1, 48e3, 97),
        (500.0, 1, 2e3, 5),
        (0.1, 1, 480.0, 4801),
        (0.3, 1, 9.0, 31),
        (441.0, 1, 48e3, 110),
        (500.0, 7, 48e3, 673),
    ],
)
def test_a_burst_has_as_many_samples_as_it_lasts(
    frequency_hz: float, cycles: int, rate_hz: float, size: int
) -> None:
    """Rounding adds none, an end between two samples adds one, and half cycles are exact zeros."""
    for window in WINDOWS:
        samples = burst_of(window, cycles, frequency_hz).samples(rate_hz)
        assert samples.size == size
        half = rate_hz / frequency_hz / 2
        if half == round(half):
            assert not samples[:: round(half)].any()
    plain = burst_of("none", 1, 441.0).samples(48e3)
    assert plain[-2] == pytest.approx(math.sin(2 * math.pi * 441 * 108 / 48e3), abs=1e-12)
    assert PAPER.samples(48_000)[[24, 48, 72]].tolist() == [1.0, 0.0, -1.0]


def test_a_burst_is_one_cycle_without_a_window_by_default() -> None:
    assert Burst(frequency_hz=500) == PAPER
    assert Burst(frequency_hz=250.0, cycles=3, window="hann").duration_s == 0.012


@each_window
@pytest.mark.parametrize("cycles", [1, 2, 5, 40])
def test_the_energy_duration_is_that_of_the_sine_of_equal_peak_and_energy(
    window: Window, cycles: int
) -> None:
    def value(t: float) -> float:
        return float(taper(window, np.array(t)) * math.sin(2 * math.pi * cycles * t))

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


# --- spectra -------------------------------------------------------------------------------------


@bursts(cycles=BY_CYCLES)
def test_the_closed_form_is_the_integral_of_the_burst(window: Window, cycles: int) -> None:
    burst, slow = burst_of(window, cycles), burst_of(window, cycles, 0.3)
    # carriers, nulls and their neighbours included, and what is next to 0 Hz
    beside = 1 + np.arange(-3, 4) / cycles
    ratios = np.concatenate([np.linspace(0, 8, 33), beside, [1e-3, 2e-3, -0.642]])
    closed = burst.spectrum(500 * ratios)
    u, weights, signal = signal_of(burst)
    turns = np.exp(2j * np.pi * np.outer(500 * ratios * burst.duration_s, u))
    error = np.abs(closed - burst.duration_s * (turns @ (weights * signal)))
    largest = np.max(np.abs(closed))
    assert np.max(error) < 3e-14 * largest
    assert closed[0] == 0.0  # a sine burst has no mean
    aside = ratios != 0
    assert np.array_equal(burst.spectrum(-500 * ratios[aside]), np.conj(closed[aside]))
    stretched = slow.spectrum(0.3 * ratios) * 0.3 / 500
    assert np.all(np.abs(stretched - closed) < 1e-12 * largest * (1 + np.abs(ratios)))


@pytest.mark.parametrize(
    ("window", "cycles", "peak_hz", "band_hz"),
    [
        # roots at 30 digits
        ("none", 1, 418.735995091130036, (205.634493282771432, 654.392715416580050)),
        ("none", 2, 480.704552028729732, (372.299832411363069, 594.409686941026371)),
        ("hann", 1, 544.758440309085626, (265.667199702542216, 865.945925474443697)),
        ("hann", 2, 503.164621454637441, (322.722823270187856, 680.900282848505548)),
        ("tukey", 1, 477.842352624629, (234.759311133014, 745.560695396129)),
        ("tukey", 4, 500.527686492572, (428.661701550347, 572.219036285307)),
        ("gaussian", 1, 583.009241914339, (282.4891291742, 942.071645187697)),
        ("gaussian", 4, 499.643386038918, (399.739467646036, 600.056487537958)),
    ],
)
def test_peak_and_half_power_band_have_their_known_values(
    window: str, cycles: int, peak_hz: float, band_hz: tuple[float, float]
) -> None:
    burst = burst_of(window, cycles)
    assert burst.peak_hz() == pytest.approx(peak_hz, rel=1e-12)
    assert burst.band_hz() == pytest.approx(band_hz, rel=1e-12)


@bursts(cycles=st.one_of(st.integers(1, 20), st.just(1000)))
def test_no_frequency_has_more_than_the_peak_and_the_edges_have_half_its_power(
    window: Window, cycles: int
) -> None:
    burst = burst_of(window, cycles)
    peak = np.abs(burst.spectrum(burst.peak_hz()))
    everywhere = np.abs(burst.spectrum(np.linspace(0, 3000, 6001)))
    assert np.max(everywhere) <= peak * (1 + 1e-14)
    edges = np.abs(burst.spectrum(burst.band_hz()))
    np.testing.assert_allclose(edges**2, peak**2 / 2, rtol=1e-11)
    inside = np.abs(burst.spectrum(np.linspace(*burst.band_hz(), 99)))
    assert np.all(inside**2 >= peak**2 / 2 * (1 - 1e-11))


# --- energies ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("window", "cycles", "frequency_hz", "fraction"),
    [
        # quadrature and Parseval's theorem, 12 digits or more
        ("none", 1, 1900.0, 0.00116872261371846007),
        ("none", 1, 2900.0, 0.000329577379006897191),
        ("none", 2, 1900.0, 0.000647965143320257127),
        ("none", 3, 2900.0, 0.000121727146367297456),
        ("hann", 1, 1900.0, 0.0000228003358498448270),
        ("hann", 1, 2900.0, 9.64606253335006000e-7),
        ("hann", 2, 1900.0, 6.78197911512075664e-7),
        ("hann", 3, 2900.0, 3.98704307702041498e-9),
        # whole less the rest in 40-digit arithmetic
        ("none", 1, 15000.0, 2.504250230452145e-6),
        ("none", 20, 6000.0, 1.970897159459235e-6),
        ("hann", 1, 15000.0, 9.598179049383619e-12),
        ("hann", 5, 3500.0, 7.51823798223807e-11),
        ("tukey", 1, 15000.0, 8.19778331056671e-9),
        ("tukey", 2, 4750.0, 1.09293948110386e-8),
        ("tukey", 7, 2500.0, 7.870523288852981e-9),
        ("gaussian", 1, 15000.0, 1.550188650209638e-9),
        ("gaussian", 4, 3000.0, 3.303740024664432e-8),
        ("gaussian", 20, 1500.0, 5.989705636720891e-8),
    ],
)
def test_energy_above_has_its_known_values_however_small(
    window: str, cycles: int, frequency_hz: float, fraction: float
) -> None:
    burst = burst_of(window, cycles)
    assert burst.energy_above(frequency_hz) == pytest.approx(fraction, rel=1e-12, abs=0)


@bursts(cycles=BY_CYCLES)
def test_energy_above_is_what_parseval_leaves_of_the_integrated_spectrum(
    window: Window, cycles: int
) -> None:
    burst = burst_of(window, cycles)
    _, weights, signal = signal_of(burst)
    total = burst.duration_s * float(weights @ signal**2) / 2
    for frequency_hz in (90.0, 500.0, 741.0, 2900.0):
        count = 2 + int(4 * frequency_hz * burst.duration_s)
        f, steps = gauss(np.linspace(0.0, frequency_hz, count))
        below = float(steps @ np.abs(burst.spectrum(f)) ** 2)
        share = burst.energy_above(frequency_hz)
        assert share == pytest.approx(1 - below / total, abs=3e-14)
        for scale in (1e-3, 1e3):
            other = burst_of(window, cycles, 500 * scale).energy_above(frequency_hz * scale)
            assert other == pytest.approx(share, rel=1e-12)


@pytest.mark.parametrize(("window", "power"), [("none", 3), ("hann", 7), ("tukey", 5)])
def test_the_far_tail_falls_with_the_power_of_the_smoothness(window: str, power: int) -> None:
    burst = burst_of(window, 3)
    fall = burst.energy_above(5e7) / burst.energy_above(5e8)
    assert math.log10(fall) == pytest.approx(power, abs=0.01)


# --- staircases ----------------------------------------------------------------------------------


def staircase_by_quadrature(
    samples: NDArray[np.float64], frequency_hz: float, rate_hz: float
) -> float:
    """Whole less the rest: the samples' transform times the hold's sinc."""
    turns = samples.size / rate_hz * frequency_hz
    f, weights = gauss(np.linspace(0.0, frequency_hz, 2 + int(4 * turns)))
    transform = np.exp(2j * np.pi * np.outer(f / rate_hz, np.arange(samples.size))) @ samples
    density = (np.abs(transform) * np.sinc(f / rate_hz) / rate_hz) ** 2
    return float(1 - weights @ density / (np.sum(samples**2) / (2 * rate_hz)))


@pytest.mark.parametrize(
    ("cycles", "frequency_hz", "rate_hz"),
    [
        (1, 1900, 48e3),
        (1, 1900, 8e3),
        (2, 2900, 44.1e3),
        (3, 9000, 6e3),
        pytest.param(20, 2900, 8e3, marks=pytest.mark.slow),
    ],
)
def test_the_staircases_energy_is_what_parseval_leaves_of_its_spectrum(
    cycles: int, frequency_hz: float, rate_hz: float
) -> None:
    for window in WINDOWS:
        burst = burst_of(window, cycles)
        left = staircase_by_quadrature(burst.samples(rate_hz), frequency_hz, rate_hz)
        fraction = staircase_energy(burst, frequency_hz, rate_hz)
        assert fraction == pytest.approx(left, abs=3e-14)


@pytest.mark.parametrize(
    ("window", "cycles", "rate_hz", "fraction"),
    [
        # Si at 30 digits
        ("none", 1, 48e3, 0.0015438361206148),
        ("none", 1, 8e3, 0.0145303962716221),
        ("hann", 1, 48e3, 0.00059358149463985),
        ("hann", 1, 8e3, 0.0203184391995689),
        ("hann", 2, 48e3, 0.00038731725037972),
        ("gaussian", 1, 192e3, 7.3183420279425e-05),
    ],
)
def test_staircases_have_their_known_energy_above_1900_hz(
    window: str, cycles: int, rate_hz: float, fraction: float
) -> None:
    energy = staircase_energy(burst_of(window, cycles), 1900.0, rate_hz)
    assert energy == pytest.approx(fraction, rel=1e-12, abs=0)


@each_window
def test_a_finer_staircase_approaches_the_burst(window: Window) -> None:
    burst = burst_of(window, 2)
    excess = [
        staircase_energy(burst, 2900.0, rate_hz) - burst.energy_above(2900.0)
        for rate_hz in (1e5, 2e5, 4e5)
    ]
    # the images of the hold: (pi f0 / rate)^2 / 3 of the energy
    assert excess[0] / excess[1] == pytest.approx(4.0, rel=0.01)
    assert excess[1] / excess[2] == pytest.approx(4.0, rel=0.01)
    assert excess[2] == pytest.approx((math.pi * 500 / 4e5) ** 2 / 3, rel=0.2)


def test_a_staircase_of_any_frequency_and_length_stays_a_fraction() -> None:
    assert staircase_energy(PAPER, 0.0, 48e3) == 1.0
    for frequency_hz in (1e-3, 1.0, 48e3, 96e3, 1e9):
        assert 0.0 <= staircase_energy(PAPER, frequency_hz, 48e3) <= 1.0
    assert staircase_energy(PAPER, 1e-3, 48e3) == pytest.approx(1.0, abs=1e-9)
    long = burst_of("hann", 1000)
    assert staircase_energy(long, 2900.0, 48e3) == pytest.approx(3.569e-4, rel=1e-3)


# --- any samples ---------------------------------------------------------------------------------

GAUSS = np.polynomial.legendre.leggauss(24)


def integral(value: Any, edges: NDArray[np.float64], frequency_hz: float) -> complex:
    """Return int s(t) exp(+i omega t) dt by Gauss's rule between the edges."""
    half = np.diff(edges)[:, np.newaxis] / 2
    t = (edges[:-1, np.newaxis] + half * (GAUSS[0] + 1)).ravel()
    weights = (half * GAUSS[1]).ravel()
    return complex(weights @ (value(t) * np.exp(2j * np.pi * frequency_hz * t)))


def edges_of(drive: SampledDrive) -> NDArray[np.float64]:
    return np.asarray(
        np.arange(len(drive.values) + int(drive.held), dtype=np.float64) / drive.sample_rate_hz
    )


@st.composite
def sampled(draw: st.DrawFn) -> SampledDrive:
    values = draw(st.lists(st.floats(-1, 1), min_size=1, max_size=12))
    held = draw(st.booleans())
    samples = [0.25, *values] if held else [0.0, *values, 0.125, 0.0]
    return SampledDrive(samples=samples, sample_rate_hz=1000.0, held=held)


@laws
@example(drive=SampledDrive(samples=[0.0, 0.125, 0.0], sample_rate_hz=1e3), frequency=0.0)
@given(drive=sampled(), frequency=st.floats(-4000, 4000))
def test_sampled_spectra_are_those_of_the_signal(drive: SampledDrive, frequency: float) -> None:
    true = integral(drive.at, edges_of(drive), frequency)
    found = complex(drive.spectrum([frequency])[0])
    assert abs(found - true) < 1e-14 * drive.duration_s * (1 + abs(frequency) / 1000)


def test_spectra_of_many_samples_are_their_sums() -> None:
    rng, rate_hz = np.random.default_rng(7), 1000.0
    samples = rng.normal(size=1234)
    drive = SampledDrive(samples=samples, sample_rate_hz=rate_hz, held=True)
    f = rng.uniform(-1000, 1000, 57)
    steps = np.exp(2j * np.pi * np.outer(f / rate_hz, np.arange(1234))) @ samples
    hold = (np.exp(2j * np.pi * f / rate_hz) - 1) / (2j * np.pi * f)
    np.testing.assert_allclose(drive.spectrum(f), steps * hold, atol=1e-12)


def test_a_staircase_has_no_energy_at_its_sample_rate() -> None:
    drive = SampledDrive(samples=[1.0, 0.5, 0.25], sample_rate_hz=1000.0, held=True)
    assert abs(drive.spectrum(1000.0)) < 1e-18


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("rate_hz", [8e3, 44.1e3])
def test_a_burst_at_any_time_is_what_its_samples_are(window: Window, rate_hz: float) -> None:
    burst = burst_of(window, 3)
    samples = burst.samples(rate_hz)
    assert burst.at(np.arange(samples.size) / rate_hz) == pytest.approx(samples, abs=1e-12)


@pytest.mark.parametrize("held", [False, True])
def test_a_drive_is_its_samples_and_nothing_before_and_after(held: object) -> None:
    samples = [0.0, 0.5, -1.0, 0.0]
    drive = SampledDrive(samples=samples, sample_rate_hz=3e3, held=bool(held))
    assert drive.at(np.arange(-1, 6) / 3e3).tolist() == [0.0, *samples, 0.0, 0.0]


@pytest.mark.slow
@laws
@given(drive=sampled(), frequency=st.floats(1, 5000))
def test_energy_above_of_samples_is_what_parseval_leaves(
    drive: SampledDrive, frequency: float
) -> None:
    edges = edges_of(drive)
    energy = integral(lambda t: drive.at(t) ** 2, edges, 0.0).real
    lines = np.linspace(0.0, frequency, 200 + int(frequency))
    half = np.diff(lines)[:, np.newaxis] / 2
    nodes = lines[:-1, np.newaxis] + half * (GAUSS[0][:] + 1)
    below = 2 * np.sum(half * GAUSS[1] * np.abs(drive.spectrum(nodes)) ** 2)
    assert drive.energy_above(frequency) == pytest.approx(1 - below / energy, abs=1e-11)


@pytest.mark.parametrize("rate", [8e3, 48e3])
@pytest.mark.parametrize("frequency", [300.0, 1900.0, 8000.0, 50_000.0])
def test_a_held_drive_is_its_own_staircase(rate: float, frequency: float) -> None:
    burst = HANN
    drive = SampledDrive(samples=burst.samples(rate), sample_rate_hz=rate, held=True)
    share = drive.energy_above(frequency)
    for samples in (drive.samples(rate), burst.samples(rate)):
        steps = staircase_energy_above(samples, sample_rate_hz=rate, frequency_hz=frequency)
        assert steps == pytest.approx(share, abs=1e-13)


# --- the check -----------------------------------------------------------------------------------


def test_the_papers_burst_is_fit_for_the_papers_plate() -> None:
    check = check_burst(PAPER, SUPPORTED.with_cutoff(2900.0))
    assert check.fit
    assert check.reasons == ()
    assert check.cutoff_hz == pytest.approx(2900.0, rel=1e-13)
    assert check.band_hz == pytest.approx((205.634493283, 654.392715417), rel=1e-11)
    assert check.peak_hz == PAPER.peak_hz()
    assert check.energy_above_cutoff == pytest.approx(3.29577379e-4, rel=1e-8)
    assert check.staircase_energy_above_cutoff > check.energy_above_cutoff
    assert (check.sample_rate_hz, check.max_energy_above_cutoff) == (48_000.0, 1e-2)


def test_a_burst_violates_the_limit_by_its_samples_its_energy_or_its_band() -> None:
    coarse = check_burst(PAPER, SUPPORTED.with_cutoff(2900.0), sample_rate_hz=8000)
    assert coarse.staircase_energy_above_cutoff == pytest.approx(1.3e-2, rel=0.05)
    fast = check_burst(burst_of("none", 1, 1500.0), SUPPORTED)
    assert fast.energy_above_cutoff == pytest.approx(0.138, abs=5e-4)
    assert (coarse.fit, len(coarse.reasons)) == (False, 1)
    assert (fast.fit, len(fast.reasons)) == (False, 3)
    assert "8000" in coarse.reasons[0]
    assert "0.01" in coarse.reasons[0]


def test_the_limit_itself_is_within_and_the_energies_decide() -> None:
    share = check_burst(PAPER, SUPPORTED).staircase_energy_above_cutoff
    fast = burst_of("none", 1, 5000.0)
    for burst, limit, is_fit in (
        (PAPER, share, True),
        (PAPER, math.nextafter(share, 0.0), False),
        (PAPER, 0.0, False),
        (fast, 1.0, True),
        (fast, 1e-2, False),
    ):
        assert check_burst(burst, SUPPORTED, max_energy_above_cutoff=limit).fit is is_fit


@pytest.mark.parametrize(
    "share", ["energy_above_cutoff", "staircase_energy_above_cutoff", "max_energy_above_cutoff"]
)
def test_no_share_of_an_energy_is_below_none_or_above_all(share: str) -> None:
    check = check_burst(PAPER, SUPPORTED)
    for bad in (-0.01, 1.01):
        with pytest.raises(ValueError, match=share):
            dataclasses.replace(check, **{share: bad})  # type: ignore[arg-type]  # one name of many


def test_the_check_takes_any_drive() -> None:
    drive = SampledDrive(samples=PAPER.samples(8e3), sample_rate_hz=8e3, held=True)
    of_burst, of_drive = (check_burst(d, SUPPORTED, sample_rate_hz=8e3) for d in (PAPER, drive))
    share = of_burst.staircase_energy_above_cutoff
    assert of_drive.staircase_energy_above_cutoff == pytest.approx(share, abs=1e-13)
    assert of_drive.energy_above_cutoff == pytest.approx(share, abs=1e-13)
    assert not of_drive.fit


def test_both_drives_keep_the_protocol() -> None:
    assert isinstance(Burst(frequency_hz=500.0), Drive)
    assert isinstance(SampledDrive(samples=[0, 1, 0], sample_rate_hz=1e3), Drive)


@pytest.mark.parametrize("held", [False, True])
def test_samples_of_a_burst_move_a_plate_as_the_burst_does(held: object) -> None:
    drive = SampledDrive(samples=HANN.samples(192e3), sample_rate_hz=192e3, held=bool(held))
    plate = dataclasses.replace(SUPPORTED, length_m=0.2)
    disc, finger = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.006), Fingertip(x_m=0.0, y_m=0.0125)
    peak, sampled_peak = (fingertip_peaks(plate, [disc], [finger], one) for one in (HANN, drive))
    difference_m = abs(peak.value - sampled_peak.value)
    assert (difference_m <= peak.error + sampled_peak.error).all()
    assert (difference_m < 1e-3 * peak.value).all()


def test_the_steps_of_a_converter_at_48_khz_leave_crosstalk_as_it_is() -> None:
    burst = Burst(frequency_hz=500.0, cycles=2, window="hann")
    steps = SampledDrive(samples=burst.samples(48e3), sample_rate_hz=48e3, held=True)
    lossy = dataclasses.replace(SUPPORTED.material, loss_factor=0.01)
    plate = dataclasses.replace(SUPPORTED, length_m=0.2, material=lossy).with_cutoff(2900.0)
    disc = MomentDisc(x_m=-0.035, y_m=0.0125, radius_m=0.0064)
    fingers = [Fingertip(x_m=x_m, y_m=0.0125) for x_m in (-0.035, 0.035)]
    smooth, stepped = (fingertip_peaks(plate, [disc], fingers, drive) for drive in (burst, steps))
    assert (abs(stepped.value - smooth.value) < 0.01 * smooth.value).all()
