"""Spectra, bands and energies: exact values, two methods against each other, laws, the check."""

from __future__ import annotations

import dataclasses
import itertools
import math
import subprocess
import sys
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from stimuli import Burst, check_burst, staircase_energy_above
from stimuli.drive.windows import WINDOWS, Window, taper, transform
from tests.test_stimuli.plates import PLATE as CLAMPED_PLATE
from tests.test_stimuli.plates import SUPPORTED as PLATE

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

PAPER = Burst(frequency_hz=500.0)
BY_CYCLES = st.integers(1, 20)

windows = st.sampled_from(WINDOWS)
laws = settings(deadline=None, max_examples=40)


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
    window = taper(burst.window, np.minimum(u, 1 - u))
    return u, weights, window * np.sin(2 * np.pi * burst.cycles * u)


# --- the spectrum --------------------------------------------------------------------------------


@bursts(cycles=BY_CYCLES)
def test_the_closed_form_is_the_integral_of_the_burst_on_and_above_the_real_axis(
    window: Window, cycles: int
) -> None:
    burst, slow = burst_of(window, cycles), burst_of(window, cycles, 0.3)
    # carriers, nulls and their neighbours included, and what is next to 0 Hz
    beside = 1 + np.arange(-3, 4) / cycles
    real = np.concatenate([np.linspace(0, 8, 33), beside, [1e-3, 2e-3, -0.642]])
    rises = np.array([1e-9, 1e-3, 0.3, 2.8, 2.95, 6.0])
    above = np.add.outer([0.0, 1e-3, 0.5, *beside[2:4], 3.0, -0.642], 1j * rises / cycles)
    ratios = np.concatenate([real, above.ravel()])
    closed = burst.spectrum(500 * ratios)
    u, weights, signal = signal_of(burst)
    turns = np.exp(2j * np.pi * np.outer(500 * ratios * burst.duration_s, u))
    error = np.abs(closed - burst.duration_s * (turns @ (weights * signal)))
    largest = np.max(np.abs(closed))
    assert np.max(error) < 3e-14 * largest
    assert closed[0] == 0.0  # a sine burst has no mean
    aside = ratios.real != 0
    mirrored = burst.spectrum(-np.conj(500 * ratios[aside]))
    assert np.array_equal(mirrored, np.conj(closed[aside]))
    stretched = slow.spectrum(0.3 * ratios) * 0.3 / 500
    assert np.all(np.abs(stretched - closed) < 1e-12 * largest * (1 + np.abs(ratios)))


@pytest.mark.parametrize("window", WINDOWS)
def test_far_above_the_real_axis_spectra_do_not_overflow(window: Window) -> None:
    burst = burst_of(window, 3)
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        far = burst.spectrum(np.array([500.0 + 1e7j, 1e9 + 1j, 1e6j, 500.0 + 1e4j]))
    assert np.all(np.abs(far) < burst.duration_s)


@pytest.mark.parametrize(
    ("cycles", "carrier_hz", "frequency_hz"),
    [
        *((1, 500.0, 1000 + d) for d in (1e-9, 1e-6, 1e-3)),
        (3, 333.3, float(np.nextafter(1e6 * 333.3 / 3, math.inf))),
    ],
)
def test_values_beside_a_null_keep_their_relative_accuracy(
    cycles: int, carrier_hz: float, frequency_hz: float
) -> None:
    """Of no window |S| = N T |sin(pi y)| / (pi |N^2 - y^2|), y = f T."""
    y = Fraction(frequency_hz) * cycles / Fraction(carrier_hz)
    sine = math.sin(math.pi * float(y - round(y)))
    exact_s = cycles * (cycles / carrier_hz) * abs(sine) / (math.pi * float(y * y - cycles**2))
    found_s = abs(burst_of("none", cycles, carrier_hz).spectrum(frequency_hz))
    assert found_s == pytest.approx(exact_s, rel=1e-13, abs=0.0)


@pytest.mark.parametrize("window", WINDOWS)
def test_shapes_are_kept_and_single_values_are_the_same(window: Window) -> None:
    burst = burst_of(window, 3)
    grid = np.linspace(0, 3000, 12).reshape(3, 4)
    values = burst.spectrum(grid)
    assert values.shape == (3, 4)
    assert values.dtype == np.complex128
    assert burst.spectrum(grid[1, 2]) == values[1, 2]
    assert burst.spectrum([]).shape == (0,)


# --- peak and band -------------------------------------------------------------------------------


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


# --- the energy above a frequency ----------------------------------------------------------------


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


@given(window=windows, cycles=BY_CYCLES, ratio=st.floats(1.5, 3e4))
@laws
def test_tails_differ_by_the_energy_between_them(window: Any, cycles: int, ratio: float) -> None:
    burst = burst_of(window, cycles)
    low_hz, high_hz = 500 * ratio, 500 * ratio * 1.001 + 2 / burst.duration_s
    edges = np.linspace(low_hz, high_hz, 2 + int(4 * (high_hz - low_hz) * burst.duration_s))
    f, steps = gauss(edges)
    density = np.abs(burst.spectrum(f) / burst.duration_s) ** 2 * burst.duration_s
    share = float(steps @ density) / (transform(window, cycles).mean_square / 2)
    between = burst.energy_above(low_hz) - burst.energy_above(high_hz)
    assert between == pytest.approx(share, rel=1e-9, abs=0)


@pytest.mark.parametrize(("window", "power"), [("none", 3), ("hann", 7), ("tukey", 5)])
def test_the_far_tail_falls_with_the_power_of_the_smoothness(window: str, power: int) -> None:
    burst = burst_of(window, 3)
    fall = burst.energy_above(5e7) / burst.energy_above(5e8)
    assert math.log10(fall) == pytest.approx(power, abs=0.01)


def test_the_far_tail_of_the_unwindowed_burst_is_its_leading_term() -> None:
    # |S|^2 = (f0/pi)^2 / (2 f^4) on average: the integral is (f0/pi)^2 / (6 F^3)
    leading = 4 * 500 * (500 / math.pi) ** 2 / (6 * 5e8**3)
    assert PAPER.energy_above(5e8) == pytest.approx(leading, rel=1e-9)
    assert 0.0 <= PAPER.energy_above(0.99e15 / PAPER.duration_s) < 1e-15


@given(
    window=windows,
    cycles=st.integers(1, 40),
    ratios=st.lists(st.floats(0.0, 1e3), min_size=2, max_size=6),
)
@laws
def test_energy_above_falls_from_one(window: Any, cycles: int, ratios: list[float]) -> None:
    burst = burst_of(window, cycles)
    assert burst.energy_above(0.0) == 1.0
    fractions = [burst.energy_above(500 * ratio) for ratio in sorted(ratios)]
    assert all(0.0 < fraction <= 1.0 for fraction in fractions)
    assert all(b <= a + 4e-15 for a, b in itertools.pairwise(fractions))


@bursts(cycles=st.one_of(st.integers(10, 300), st.just(100_000)))
def test_many_cycles_keep_half_of_their_energy_on_each_side(window: Window, cycles: int) -> None:
    burst = burst_of(window, cycles)
    assert burst.energy_above(500.0) == pytest.approx(0.5, abs=1 / cycles)
    assert burst.energy_above(1e-6) == pytest.approx(1.0, abs=1e-14)
    assert burst.energy_above(50.0) >= burst.energy_above(480.0) >= burst.energy_above(499.0)


# --- the staircase -------------------------------------------------------------------------------


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
    "samples",
    [[1.0], [2.0, 1.0], [1.0, 0.5], [-1.0, 0.0, 3.0], [0.0, 1.0, 2.0, 0.0], [0.0, 1.0, 1.0]],
)
def test_steps_from_the_first_sample_and_after_the_last_count(samples: list[float]) -> None:
    for frequency_hz in (100.0, 700.0, 2500.0):
        left = staircase_by_quadrature(np.array(samples), frequency_hz, 1e3)
        share = staircase_energy_above(samples, sample_rate_hz=1e3, frequency_hz=frequency_hz)
        assert share == pytest.approx(left, abs=1e-13)


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


@pytest.mark.parametrize("window", WINDOWS)
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


def test_a_staircase_of_any_frequency_stays_a_fraction() -> None:
    assert staircase_energy(PAPER, 0.0, 48e3) == 1.0
    for frequency_hz in (1e-3, 1.0, 48e3, 96e3, 1e9):
        assert 0.0 <= staircase_energy(PAPER, frequency_hz, 48e3) <= 1.0
    assert staircase_energy(PAPER, 1e-3, 48e3) == pytest.approx(1.0, abs=1e-9)


def test_long_staircases_are_no_burden() -> None:
    long = burst_of("hann", 1000)
    assert long.samples(48e3).size == 96_001
    assert staircase_energy(long, 2900.0, 48e3) == pytest.approx(3.569e-4, rel=1e-3)


# --- the check -----------------------------------------------------------------------------------


def test_the_papers_burst_is_fit_for_the_papers_plate() -> None:
    check = check_burst(PAPER, PLATE.with_cutoff(2900.0))
    assert check.fit
    assert check.reasons == ()
    assert check.cutoff_hz == pytest.approx(2900.0, rel=1e-13)
    assert check.band_hz == pytest.approx((205.634493283, 654.392715417), rel=1e-11)
    assert check.peak_hz == PAPER.peak_hz()
    assert check.energy_above_cutoff == pytest.approx(3.29577379e-4, rel=1e-8)
    assert check.staircase_energy_above_cutoff > check.energy_above_cutoff
    assert (check.sample_rate_hz, check.max_energy_above_cutoff) == (48_000.0, 1e-2)


def test_at_8_khz_its_staircase_alone_makes_it_unfit() -> None:
    check = check_burst(PAPER, PLATE.with_cutoff(2900.0), sample_rate_hz=8000)
    assert not check.fit
    assert check.staircase_energy_above_cutoff == pytest.approx(1.3e-2, rel=0.05)
    (reason,) = check.reasons
    assert "staircase at 8000 Hz" in reason
    assert "0.01" in reason


def test_a_1500_hz_burst_is_unfit_for_the_simply_supported_plate() -> None:
    check = check_burst(burst_of("none", 1, 1500.0), PLATE)
    assert check.energy_above_cutoff == pytest.approx(0.138, abs=5e-4)
    assert not check.fit
    ideal, staircase, band = check.reasons
    assert ideal.startswith("the ideal burst has 0.138")
    assert "staircase" in staircase
    assert "half-power band" in band


def test_a_burst_that_has_just_the_limit_above_the_cut_off_is_fit() -> None:
    share = check_burst(PAPER, PLATE).staircase_energy_above_cutoff
    assert check_burst(PAPER, PLATE, max_energy_above_cutoff=share).fit
    assert not check_burst(PAPER, PLATE, max_energy_above_cutoff=math.nextafter(share, 0.0)).fit


@pytest.mark.parametrize(
    "share", ["energy_above_cutoff", "staircase_energy_above_cutoff", "max_energy_above_cutoff"]
)
def test_no_share_of_an_energy_is_below_none_or_above_all(share: str) -> None:
    check = check_burst(PAPER, PLATE)
    for bad in (-0.01, 1.01):
        with pytest.raises(ValueError, match=f"^{share} must be"):
            dataclasses.replace(check, **{share: bad})  # type: ignore[arg-type]  # one name of many


def test_the_energies_decide_and_a_limit_of_all_lets_everything_pass() -> None:
    fast = burst_of("none", 1, 5000.0)
    assert check_burst(fast, PLATE, max_energy_above_cutoff=1.0).fit
    assert not check_burst(fast, PLATE).fit
    assert not check_burst(PAPER, PLATE, max_energy_above_cutoff=0.0).fit


def test_the_stiffer_the_edge_the_better_the_burst_fits() -> None:
    strips = [PLATE, PLATE.with_cutoff(2500.0), PLATE.with_cutoff(2900.0)]
    strips.append(CLAMPED_PLATE)
    energies = [check_burst(PAPER, strip).energy_above_cutoff for strip in strips]
    assert energies == sorted(energies, reverse=True)


@pytest.mark.process
def test_importing_the_stimuli_needs_nothing_heavy() -> None:
    code = (
        "import sys; from stimuli import *; p = Strip(width_m=.025, thickness_m=5e-4, "
        "material=ALUMINIUM, edge=CLAMPED); check_burst(Burst(frequency_hz=500.0), p); "
        "print(sorted({'scipy', 'matplotlib', 'pandas'} & set(sys.modules)))"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout == "[]\n"
