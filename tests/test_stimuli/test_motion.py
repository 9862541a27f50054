"""Plates over time by their modes: resonances, tones, peaks, echoes and slow bursts."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    Burst,
    ElasticEdge,
    Fingertip,
    ForceRectangle,
    Load,
    Material,
    MomentDisc,
    PointForce,
    SampledDrive,
    Strip,
    displacement,
    felt,
    felt_work,
    level_db,
)
from tests.test_stimuli.modes import natural_frequencies_hz, peaks_up_to, steady_motion
from tests.test_stimuli.plates import FIRM, SOFT, Edge, disc, on, scene_of

STEEL = Material(youngs_modulus_pa=200e9, poisson_ratio=0.29, density_kg_m3=7850.0)
GLASS = Material(youngs_modulus_pa=70e9, poisson_ratio=0.22, density_kg_m3=2500.0)


def plate(edge: Any = FIRM, loss: float = 0.01, length_m: float | None = 0.2, **more: Any) -> Strip:
    """The paper's plate, or another."""
    material = dataclasses.replace(more.pop("material", ALUMINIUM), loss_factor=loss)
    sizes = {"width_m": 0.025, "thickness_m": 0.0005} | more
    return Strip(material=material, edge=edge, length_m=length_m, **sizes)


def pair(
    x_m: float = 0.035, y_m: float = 0.0125, radius_m: float = 0.0064, *, shift_m: float = 0.0
) -> tuple[list[Load], list[Fingertip]]:
    """Two of the paper's discs with a finger on each."""
    places = (shift_m - x_m, shift_m + x_m)
    discs: list[Load] = [MomentDisc(x_m=x, y_m=y_m, radius_m=radius_m) for x in places]
    return discs, [Fingertip(x_m=x, y_m=y_m, radius_m=min(0.005, y_m)) for x in places]


def burst(window: Any = "none", frequency_hz: float = 500.0) -> Burst:
    return Burst(frequency_hz=frequency_hz, cycles=1, window=window)


def sampled(drive: Burst, rate_hz: float, *, held: bool = False) -> SampledDrive:
    samples = np.append(drive.samples(rate_hz), 0.0)
    return SampledDrive(samples=samples, sample_rate_hz=rate_hz, held=held)


# --- modes and tones -----------------------------------------------------------------------------


def test_modes_of_a_square_on_two_supports_are_leissas() -> None:
    # A. W. Leissa, J. Sound Vib. 31 (1973) 257, table for two opposite edges supported, two free
    material = dataclasses.replace(ALUMINIUM, poisson_ratio=0.3)
    square = plate(SIMPLY_SUPPORTED, 0.0, 0.1, material=material, width_m=0.1)
    scale = math.sqrt(2700 * square.thickness_m / square.bending_stiffness_n_m) * 0.1**2
    found = 2 * math.pi * scale * natural_frequencies_hz(square, 6, 2000.0)
    assert found == pytest.approx([9.6314, 16.1348, 36.7256, 38.9450, 46.7381, 70.7401], rel=1e-5)


LOSSY_SPRING = ElasticEdge(stiffness_n=60.0, lossless=False)


@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, SOFT, LOSSY_SPRING, CLAMPED], ids=str)
@pytest.mark.parametrize("length_m", [0.3, pytest.param(0.06, marks=pytest.mark.slow)])
def test_modes_move_a_plate_by_a_tone_as_its_field_does(edge: Edge, length_m: float) -> None:
    """At rest, below the cut-off and above it; fast loads are known from their first correction."""
    strip = on(edge, length_m, viscous_s=5e-7)
    loads = (disc(0.005, x_m=-0.01, y_m=0.0115), PointForce(x_m=0.02, y_m=0.01))
    scene = scene_of(strip, loads, (-0.01, 0.0115), (0.02, 0.01), (0.025, 0.014))
    for part, rtol in ((0.0, 1e-5), (0.3, 1e-4), (1.3, 2e-3)):
        frequency_hz = part * strip.cutoff_hz()
        exact = displacement(scene, [frequency_hz], 1e-6)[0]
        found = steady_motion(scene, frequency_hz, multiple=12.0)
        assert np.max(np.abs(found - exact)) < rtol * np.max(np.abs(exact))


# --- oscillators ---------------------------------------------------------------------------------


# --- peaks ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("strip", "window", "expected_db"),
    [
        (plate(FIRM, 0.01), "none", -24.73),
        (plate(SIMPLY_SUPPORTED, 0.01), "tukey", -18.00),
        (plate(SOFT, 0.005), "none", -19.7),
    ],
    ids=["2900 Hz", "supported", "2500 Hz"],
)
def test_levels_on_plates_with_free_ends(strip: Strip, window: str, expected_db: float) -> None:
    peaks_m = felt(strip, *pair(), burst(window))
    assert level_db(peaks_m, own=0, other=1) == pytest.approx(expected_db, abs=0.05)
    assert level_db(peaks_m, own=1, other=0) == pytest.approx(expected_db, abs=0.05)


ACRYLIC = Material(youngs_modulus_pa=3.2e9, poisson_ratio=0.37, density_kg_m3=1180.0)
PLATES = [
    (plate(SIMPLY_SUPPORTED, 0.03, 0.15, material=GLASS), 0.04, 0.0125, burst("hann", 600.0)),
    (plate(SIMPLY_SUPPORTED, 0.005, 0.12, material=STEEL), 0.03, 0.01, burst("none", 400.0)),
    (plate(FIRM, 0.0, None), 0.035, 0.0125, burst()),
    (plate(CLAMPED, 0.02, None), 0.035, 0.0125, burst("tukey")),
    # echoes that add up late: after the time of one way over an end they are 1 dB quieter
    (
        plate(
            SIMPLY_SUPPORTED, 0.005, 0.17322, material=ACRYLIC, width_m=0.02283, thickness_m=7.9e-4
        ),
        0.027,
        0.01142,
        Burst(frequency_hz=608.6, cycles=2, window="tukey"),
    ),
    (plate(CLAMPED, 0.02, 0.13, material=STEEL, width_m=0.02), 0.03, 0.01, burst("hann", 900.0)),
    (plate(LOSSY_SPRING, 0.05, 0.12), 0.04, 0.011, burst("none", 400.0)),
]
"""A plate, where its discs lie, and what drives them; the last two keep spectra busy longest."""


@pytest.mark.slow
@pytest.mark.parametrize(("strip", "x_m", "y_m", "drive"), PLATES[:5])
def test_modes_agree_with_the_spectra(strip: Strip, x_m: float, y_m: float, drive: Burst) -> None:
    loads, tips = pair(x_m, y_m)
    assert felt_work(strip, loads, tips, drive).modes > 10
    assert felt_work(strip, loads, tips, drive, rtol=1e-4).modes == 0
    by_modes, by_spectra = (felt(strip, loads, tips, drive, rtol=rtol) for rtol in (5e-3, 1e-4))
    np.testing.assert_allclose(by_modes, by_spectra, rtol=5e-3)


@pytest.mark.parametrize("place", [0, 1, 5, 6])
def test_the_estimate_holds_against_twice_as_many_modes(place: int) -> None:
    strip, x_m, y_m, drive = PLATES[place]
    few, many = (peaks_up_to(n, strip, *pair(x_m, y_m), drive) for n in (4.0, 9.0))
    assert np.all(np.abs(few.peak_m - many.peak_m) <= 2 * few.error_m)
    assert np.all(many.error_m < 0.02 * many.peak_m)


def test_samples_of_a_burst_do_what_the_burst_does() -> None:
    expected = felt(plate(), *pair(), burst("hann"))
    for held in (False, True):
        drive = sampled(burst("hann"), 200e3, held=held)
        np.testing.assert_allclose(felt(plate(), *pair(), drive), expected, rtol=2e-3)


def test_a_slow_load_moves_the_plate_as_a_static_one() -> None:
    motor = ForceRectangle(x_m=0.01, y_m=0.0125, length_x_m=0.008, length_y_m=0.004)
    tip, slow = (
        Fingertip(x_m=0.01, y_m=0.0125, radius_m=0.0),
        Burst(frequency_hz=5.0, cycles=2, window="hann"),
    )
    static_m = abs(displacement(scene_of(plate(loss=0.0), motor, (0.01, 0.0125)), [0.0])[0, 0, 0])
    # two cycles in a Hann window have their largest value, 0.9, beside the middle
    size = np.abs(slow.samples(1e4)).max()
    assert felt(plate(), [motor], [tip], slow)[0, 0] == pytest.approx(static_m * size, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("window", ["none", "hann", "tukey"])
@pytest.mark.parametrize(("width_m", "length_m"), [(0.008, 0.15), (0.01, 0.1), (0.01, 1.0)])
def test_slow_bursts_move_narrow_plates_as_their_samples_do(
    window: str, width_m: float, length_m: float
) -> None:
    """Of a burst much slower than the cut-off is sought what rings after its corners."""
    strip = plate(CLAMPED, width_m=width_m, length_m=length_m)
    loads, tips = pair(0.012, 0.46 * width_m, 0.002)
    found = felt(strip, loads, tips, burst(window))
    fine = felt(strip, loads, tips, sampled(burst(window), 1e6))
    np.testing.assert_allclose(np.diag(found), np.diag(fine), rtol=2e-3)
    np.testing.assert_allclose(found, fine, atol=2e-3 * np.max(found))
    quiet = felt(strip, *pair(0.045, 0.46 * width_m, 0.002), burst(window))
    assert np.all(quiet > 0)


@pytest.mark.parametrize("frequency_hz", [40.0, 800.0])
def test_the_points_that_are_looked_at_first_may_hardly_move(frequency_hz: float) -> None:
    strip, drive = plate(CLAMPED), burst("tukey", frequency_hz)
    load = disc(0.006)
    points = [Fingertip(x_m=x_m, y_m=0.0125, radius_m=0.0) for x_m in (0.012, 0.0, 0.004)]
    (edge_m, *others_m) = felt(strip, [load], points, drive)[:, 0]
    (area_m,) = felt(strip, [load], [Fingertip(x_m=0.006, y_m=0.0125, radius_m=0.0065)], drive)[0]
    assert edge_m < 0.3 * max(others_m)
    assert area_m == pytest.approx(max(others_m), rel=1e-6)


# --- long plates ---------------------------------------------------------------------------------


def test_a_long_plate_is_as_an_endless_one_and_as_its_middle() -> None:
    endless, long = (felt(plate(SOFT, 0.01, m), *pair(), burst()) for m in (None, 100.0))
    np.testing.assert_allclose(long, endless, rtol=1e-3)
    short, long_work = (felt_work(plate(length_m=m), *pair(), burst()) for m in (0.2, 30.0))
    assert (short.is_whole, short.length_m) == (True, 0.2)
    assert short.modes > 10
    assert short.highest_hz == pytest.approx(23_200.0, rel=1e-2)
    assert not long_work.is_whole
    assert 1.0 < (long_work.length_m or 0.0) < 3.0


def test_beside_one_end_of_a_long_plate_the_other_does_not_count() -> None:
    short, long = (
        felt(plate(SIMPLY_SUPPORTED, 0.01, m), *pair(shift_m=m / 2 - 0.045), burst("tukey"))
        for m in (1.5, 30.0)
    )
    np.testing.assert_allclose(short, long, rtol=1e-3)
    assert abs(long[0, 1] / long[1, 0] - 1) > 0.01


def test_a_plate_without_loss_is_not_waited_for_forever() -> None:
    found = felt(plate(loss=0.0), *pair(), burst())
    lossy = felt(plate(loss=1e-3), *pair(), burst())
    assert np.all(np.isfinite(found))
    np.testing.assert_allclose(np.diag(found), np.diag(lossy), rtol=0.02)
