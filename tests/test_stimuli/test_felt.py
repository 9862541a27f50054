"""What fingertips feel: peaks over contact area and time."""

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
    Drive,
    ElasticEdge,
    Fingertip,
    ForceRectangle,
    Load,
    Material,
    MomentDisc,
    MomentRectangle,
    PointForce,
    PressureDisc,
    SampledDrive,
    Scene,
    Strip,
    causal,
    displacement,
    felt,
    level_db,
)
from stimuli.field.field import solve
from stimuli.field.synthesis import transient

SUPPORTED = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=SIMPLY_SUPPORTED)
HELD = SUPPORTED.with_cutoff(2900.0)
BETWEEN_CLAMPS = dataclasses.replace(SUPPORTED, edge=CLAMPED)
STRIPS = {"supported": SUPPORTED, "2900 Hz": HELD, "clamped": BETWEEN_CLAMPS}

DISCS = tuple(MomentDisc(x_m=x, y_m=0.0125, radius_m=0.0064) for x in (-0.035, 0.035))
TIPS = tuple(Fingertip(x_m=x, y_m=0.0125) for x in (-0.035, 0.035))
POINTS = tuple(dataclasses.replace(tip, radius_m=0.0) for tip in TIPS)
CYCLE = Burst(frequency_hz=500.0, cycles=1, window="none")
HANN = Burst(frequency_hz=500.0, cycles=2, window="hann")


@pytest.mark.slow
def test_equal_actuators_under_the_fingers_give_a_symmetric_matrix() -> None:
    peaks_m = felt(HELD, DISCS, TIPS, CYCLE)
    assert peaks_m.shape == (2, 2)
    np.testing.assert_allclose(peaks_m, peaks_m.T, rtol=1e-10)
    assert peaks_m[0, 0] == pytest.approx(peaks_m[1, 1], rel=1e-10)


def test_a_load_and_a_point_may_be_exchanged() -> None:
    places = ((0.0, 0.009), (0.03, 0.014))
    loads = tuple(PointForce(x_m=x, y_m=y) for x, y in places)
    tips = tuple(Fingertip(x_m=x, y_m=y, radius_m=0.0) for x, y in places)
    peaks_m = felt(HELD, loads, tips, HANN)
    assert peaks_m[0, 1] == pytest.approx(peaks_m[1, 0], rel=1e-3)


@pytest.mark.slow
def test_each_load_is_driven_by_itself() -> None:
    loads: tuple[Load, ...] = (DISCS[0], PointForce(x_m=0.02, y_m=0.01))
    together = felt(HELD, loads, POINTS, HANN)
    alone = [felt(HELD, (load,), POINTS, HANN)[:, 0] for load in loads]
    np.testing.assert_allclose(together, np.stack(alone, axis=1), rtol=2e-3)


def test_the_peak_is_linear_in_the_load() -> None:
    # a total force of 1 N, and as much pressure on the same small area
    area_m2 = math.pi * 1e-3**2
    rectangle = ForceRectangle(x_m=0.0, y_m=0.0125, length_x_m=2e-3, length_y_m=2e-3)
    disc = PressureDisc(x_m=0.0, y_m=0.0125, radius_m=1e-3)
    force_m, pressure_m = felt(HELD, (rectangle, disc), TIPS, HANN)[0]
    assert pressure_m / area_m2 == pytest.approx(force_m, rel=0.01)


@pytest.mark.slow
def test_the_peak_is_linear_in_the_drive() -> None:
    samples = np.sin(2 * np.pi * np.arange(33) / 32) * np.hanning(33)
    one, half = (
        SampledDrive(samples=scale * samples, sample_rate_hz=16000.0) for scale in (1.0, 0.5)
    )
    np.testing.assert_allclose(
        felt(HELD, DISCS, POINTS, half), felt(HELD, DISCS, POINTS, one) / 2, rtol=1e-6
    )


@pytest.mark.slow
def test_a_stiffer_and_as_much_heavier_plate_moves_less_in_proportion() -> None:
    triple = Material(youngs_modulus_pa=3 * 67e9, poisson_ratio=0.346, density_kg_m3=3 * 2700.0)
    strip = dataclasses.replace(BETWEEN_CLAMPS, material=triple)
    plain = felt(BETWEEN_CLAMPS, DISCS, POINTS, HANN)
    np.testing.assert_allclose(felt(strip, DISCS, POINTS, HANN), plain / 3, rtol=1e-6)


def test_a_slow_drive_moves_the_plate_as_a_static_load_does() -> None:
    slow = Burst(frequency_hz=20.0, cycles=1, window="none")
    scene = Scene(strip=HELD, loads=DISCS[:1], points_m=((-0.035, 0.0125),))
    still_m = abs(displacement(scene, [0.0])[0, 0, 0])
    assert felt(HELD, DISCS[:1], POINTS[:1], slow)[0, 0] == pytest.approx(still_m, rel=2e-3)


def watched(strip: Strip, drive: Drive, until_s: float) -> Any:
    """Displacement at the two points over a long time in fine steps, for the first disc."""
    times_s = np.arange(0.0, until_s, 4e-6)
    points_m = tuple((tip.x_m, tip.y_m) for tip in TIPS)
    scene = Scene(strip=causal(strip, drive), loads=DISCS[:1], points_m=points_m)
    return transient(scene, drive, times_s, 1e-3)[:, 0]


@pytest.mark.slow
@pytest.mark.parametrize("name", STRIPS)
@pytest.mark.parametrize("drive", [CYCLE, HANN], ids=str)
@pytest.mark.parametrize("loss", [0.0, 0.01])
def test_window_and_step_hold_the_peak_to_a_twentieth_of_a_decibel(
    name: str, drive: Burst, loss: float
) -> None:
    material = dataclasses.replace(ALUMINIUM, loss_factor=loss)
    strip = dataclasses.replace(STRIPS[name], material=material)
    peaks_m = felt(strip, DISCS[:1], POINTS, drive)[:, 0]
    true_m = np.max(np.abs(watched(strip, drive, 0.016)), axis=0)
    assert np.max(np.abs(20 * np.log10(peaks_m / true_m))) < 0.05


@pytest.mark.slow
def test_a_click_has_its_peak_held_too() -> None:
    click = SampledDrive(samples=[0.0, 1.0, -0.6, 0.2, 0.0], sample_rate_hz=8000.0)
    peaks_m = felt(HELD, DISCS[:1], POINTS, click)[:, 0]
    true_m = np.max(np.abs(watched(HELD, click, 0.012)), axis=0)
    assert np.max(np.abs(20 * np.log10(peaks_m / true_m))) < 0.05


# Known levels 70 mm away in dB, peak-to-peak, for a moment rectangle of 6 x 18 mm (18 across) on
# the paper's plate, with a viscous loss of 0.01 at the supported strip's cut-off in plate and
# spring: one cycle of 500 Hz, and two under Hann's window.
KNOWN_DB = {"supported": (-27.8, -57.0), "2900 Hz": (-31.9, -73.5), "clamped": (-37.5, -86.7)}


@pytest.mark.parametrize("name", STRIPS)
@pytest.mark.parametrize("number", [0, 1])
def test_levels_seventy_millimetres_away_are_the_known_ones(name: str, number: int) -> None:
    viscous = dataclasses.replace(
        ALUMINIUM, viscous_time_s=0.01 / (2 * math.pi * SUPPORTED.cutoff_hz())
    )
    edge = STRIPS[name].edge
    if isinstance(edge, ElasticEdge):
        edge = dataclasses.replace(edge, lossless=False)
    strip = dataclasses.replace(STRIPS[name], material=viscous, edge=edge)
    patch = MomentRectangle(x_m=0.0, y_m=0.0125, length_x_m=0.006, length_y_m=0.018)
    scene = Scene(strip=strip, loads=(patch,), points_m=((0.0, 0.0125), (0.07, 0.0125)))
    moved_m = transient(scene, (CYCLE, HANN)[number], np.arange(0.0, 0.012, 1e-5), 1e-3)[:, 0]
    source_m, far_m = np.ptp(moved_m, axis=0)
    assert 20 * math.log10(far_m / source_m) == pytest.approx(KNOWN_DB[name][number], abs=0.5)


@pytest.mark.slow
def test_a_contact_area_feels_at_least_what_its_centre_does() -> None:
    area_m, point_m = felt(HELD, DISCS, TIPS, HANN), felt(HELD, DISCS, POINTS, HANN)
    assert np.all(area_m >= point_m * (1 - 1e-3))
    assert level_db(area_m, own=0, other=1) > level_db(point_m, own=0, other=1)


@pytest.mark.slow
def test_a_fingertip_of_no_size_is_the_limit_of_small_ones() -> None:
    tiny = tuple(dataclasses.replace(tip, radius_m=1e-7) for tip in TIPS)
    np.testing.assert_allclose(
        felt(HELD, DISCS, tiny, HANN), felt(HELD, DISCS, POINTS, HANN), rtol=1e-3
    )


def test_a_small_load_away_from_the_fingers_middle_is_not_missed() -> None:
    load = PointForce(x_m=0.0033, y_m=0.0147)
    tip, above = Fingertip(x_m=0.0, y_m=0.0125), Fingertip(x_m=0.0033, y_m=0.0147, radius_m=0.0)
    felt_m, most_m = felt(HELD, (load,), (tip, above), HANN)[:, 0]
    assert 1 <= felt_m / most_m < 1.01


@pytest.mark.parametrize("frequency_hz", [500.0, 5000.0])
def test_a_constant_loss_becomes_viscous_where_its_waves_travel(frequency_hz: float) -> None:
    lossy = dataclasses.replace(ALUMINIUM, loss_factor=0.02, viscous_time_s=1e-7)
    strip = dataclasses.replace(HELD, material=lossy)
    found = causal(strip, dataclasses.replace(HANN, frequency_hz=frequency_hz)).material
    at_hz = (
        2900.0
        if frequency_hz < 2900.0
        else dataclasses.replace(HANN, frequency_hz=5000.0).peak_hz()
    )
    assert found.loss_factor == 0
    loss = found.stiffness_factor(at_hz)
    assert loss == pytest.approx(lossy.stiffness_factor(at_hz), rel=1e-10)


def test_what_is_felt_of_a_constant_loss_is_that_of_the_causal_one() -> None:
    strip = dataclasses.replace(HELD, material=dataclasses.replace(ALUMINIUM, loss_factor=0.02))
    viscous = causal(strip, HANN)
    np.testing.assert_array_equal(
        felt(strip, DISCS, POINTS, HANN), felt(viscous, DISCS, POINTS, HANN)
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", STRIPS)
@pytest.mark.parametrize("drive", [CYCLE, HANN], ids=str)
def test_the_causal_loss_gives_the_level_of_the_constant_one(name: str, drive: Burst) -> None:
    lossy = dataclasses.replace(ALUMINIUM, loss_factor=0.01)
    strip = dataclasses.replace(STRIPS[name], material=lossy)
    points_m = tuple((tip.x_m, tip.y_m) for tip in TIPS)
    scene = Scene(strip=strip, loads=DISCS[:1], points_m=points_m)
    # Fourier sum along frequencies with a small imaginary part: u(t) up to its period / 2
    period_s = 0.04
    shift_hz = 12j / (2 * math.pi * period_s)
    frequencies = np.asarray((np.arange(800) + 0.5) / period_s + shift_hz, dtype=np.complex128)
    parts = solve(scene, frequencies, 1e-4).value[:, 0] * drive.spectrum(frequencies)[:, None]
    times_s = np.arange(0.0, 0.01, 1e-5)
    moved_m = np.exp(-2j * np.pi * np.outer(times_s, frequencies)) @ parts * (2 / period_s)
    own_m, far_m = np.max(np.abs(moved_m.real), axis=0)
    level = level_db(felt(strip, DISCS[:1], POINTS, drive), own=0, other=1)
    assert level == pytest.approx(20 * math.log10(far_m / own_m), abs=0.3)


def test_a_causal_strip_is_left_as_it_is() -> None:
    viscous = dataclasses.replace(ALUMINIUM, viscous_time_s=1e-6)
    for strip in (HELD, dataclasses.replace(HELD, material=viscous)):
        assert causal(strip, CYCLE) is strip
