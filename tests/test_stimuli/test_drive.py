"""Drives: exact spectra on and above the real axis, energies, and the check of any drive."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stimuli import (
    ALUMINIUM,
    SIMPLY_SUPPORTED,
    Burst,
    Drive,
    SampledDrive,
    Strip,
    check_burst,
    staircase_energy_above,
)
from stimuli.drive.sums import exponential_sums

if TYPE_CHECKING:
    from numpy.typing import NDArray


laws = settings(deadline=None, max_examples=25)
GAUSS = np.polynomial.legendre.leggauss(24)


def integral(value: Any, edges: NDArray[np.float64], frequency_hz: complex) -> complex:
    """Return int s(t) exp(+i omega t) dt by Gauss's rule between the edges."""
    half = np.diff(edges)[:, np.newaxis] / 2
    t = (edges[:-1, np.newaxis] + half * (GAUSS[0] + 1)).ravel()
    weights = (half * GAUSS[1]).ravel()
    return complex(weights @ (value(t) * np.exp(2j * np.pi * frequency_hz * t)))


def sampled_value(drive: SampledDrive, t: NDArray[np.float64]) -> NDArray[np.float64]:
    place, values = t * drive.sample_rate_hz, np.array(drive.values)
    if drive.held:
        return np.asarray(values[np.floor(place).astype(int)])
    return np.asarray(np.interp(place, np.arange(values.size), values))


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


# --- spectra -------------------------------------------------------------------------------------


@laws
@given(drive=sampled(), frequency=st.floats(-4000, 4000), rise=st.floats(0, 200))
def test_sampled_spectra_are_those_of_the_signal(
    drive: SampledDrive, frequency: float, rise: float
) -> None:
    true = integral(lambda t: sampled_value(drive, t), edges_of(drive), frequency + 1j * rise)
    found = complex(drive.spectrum([frequency + 1j * rise])[0])
    assert abs(found - true) < 1e-14 * drive.duration_s * (1 + abs(frequency) / 1000)


def test_a_staircase_has_no_energy_at_its_sample_rate() -> None:
    drive = SampledDrive(samples=[1.0, 0.5, 0.25], sample_rate_hz=1000.0, held=True)
    assert abs(drive.spectrum(1000.0)) < 1e-18
    with np.errstate(over="raise", invalid="raise"):
        assert np.all(np.isfinite(drive.spectrum(np.array([1e8j, 5.0 + 1e6j]))))


def test_sums_by_two_products_are_the_sums() -> None:
    rng = np.random.default_rng(7)
    coefficients = rng.normal(size=(1234, 3)) + 1j * rng.normal(size=(1234, 3))
    turns = rng.uniform(-1, 1, 57) + 1e-3j * rng.uniform(0, 1, 57)
    direct = np.exp(2j * np.pi * np.outer(turns, np.arange(1234))) @ coefficients
    np.testing.assert_allclose(exponential_sums(coefficients, turns), direct, atol=1e-9)


# --- energies and bands --------------------------------------------------------------------------


@pytest.mark.slow
@laws
@given(drive=sampled(), frequency=st.floats(1, 5000))
def test_energy_above_is_what_parseval_leaves(drive: SampledDrive, frequency: float) -> None:
    edges = edges_of(drive)
    energy = integral(lambda t: sampled_value(drive, t) ** 2, edges, 0.0).real
    lines = np.linspace(0.0, frequency, 200 + int(frequency))
    half = np.diff(lines)[:, np.newaxis] / 2
    nodes = lines[:-1, np.newaxis] + half * (GAUSS[0][:] + 1)
    below = 2 * np.sum(half * GAUSS[1] * np.abs(drive.spectrum(nodes)) ** 2)
    assert drive.energy_above(frequency) == pytest.approx(1 - below / energy, abs=1e-11)


@pytest.mark.parametrize("rate", [8e3, 48e3])
@pytest.mark.parametrize("frequency", [300.0, 1900.0, 8000.0, 50_000.0])
def test_a_held_drive_is_its_own_staircase(rate: float, frequency: float) -> None:
    burst = Burst(frequency_hz=500.0, cycles=2, window="hann")
    drive = SampledDrive(samples=burst.samples(rate), sample_rate_hz=rate, held=True)
    share = drive.energy_above(frequency)
    for samples in (drive.samples(rate), burst.samples(rate)):
        steps = staircase_energy_above(samples, sample_rate_hz=rate, frequency_hz=frequency)
        assert steps == pytest.approx(share, abs=1e-13)


def test_fine_samples_have_the_band_and_the_energies_of_their_burst() -> None:
    burst = Burst(frequency_hz=500.0, cycles=2, window="hann")
    drive = SampledDrive(samples=burst.samples(1e6), sample_rate_hz=1e6)
    assert drive.peak_hz() == pytest.approx(burst.peak_hz(), rel=1e-5)
    assert drive.band_hz() == pytest.approx(burst.band_hz(), rel=1e-5)
    assert drive.energy_above(1900.0) == pytest.approx(burst.energy_above(1900.0), rel=1e-3)
    assert drive.duration_s == burst.duration_s


@pytest.mark.slow
@laws
@given(drive=sampled())
def test_no_frequency_has_more_than_the_peak_and_the_edges_half_its_power(
    drive: SampledDrive,
) -> None:
    peak = abs(complex(drive.spectrum(drive.peak_hz())))
    everywhere = np.abs(drive.spectrum(np.linspace(0, 3000, 3001)))
    assert np.max(everywhere) <= peak * (1 + 1e-9)
    lower, upper = drive.band_hz()
    assert lower <= drive.peak_hz() <= upper
    for edge in (lower, upper):
        if edge > 0:
            half = abs(complex(drive.spectrum(edge))) / peak * math.sqrt(2)
            assert half == pytest.approx(1, abs=1e-7)


# --- the check -----------------------------------------------------------------------------------

PLATE = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=SIMPLY_SUPPORTED)


def test_the_check_takes_any_drive() -> None:
    burst = Burst(frequency_hz=500.0, cycles=1, window="none")
    drive = SampledDrive(samples=burst.samples(8e3), sample_rate_hz=8e3, held=True)
    of_burst, of_drive = (check_burst(d, PLATE, sample_rate_hz=8e3) for d in (burst, drive))
    share = of_burst.staircase_energy_above_cutoff
    assert of_drive.staircase_energy_above_cutoff == pytest.approx(share, abs=1e-13)
    assert of_drive.energy_above_cutoff == pytest.approx(share, abs=1e-13)
    assert not of_drive.fit


def test_both_drives_keep_the_protocol() -> None:
    assert isinstance(Burst(frequency_hz=500.0), Drive)
    assert isinstance(SampledDrive(samples=[0, 1, 0], sample_rate_hz=1e3), Drive)
