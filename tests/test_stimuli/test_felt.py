"""What fingertips feel: peaks over contact area and time."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from stimuli import (
    ALUMINIUM,
    Burst,
    Drive,
    Fingertip,
    ForceRectangle,
    PressureDisc,
    SampledDrive,
    Strip,
    causal,
    displacement,
    felt,
    level_db,
    transient,
)
from stimuli.field.field import solve
from tests.test_stimuli.plates import (
    CYCLE,
    DISCS,
    HANN,
    PLATE,
    SUPPORTED,
    TIPS,
    W,
    disc,
    force,
    patch,
    scene_of,
)

change = dataclasses.replace
MEASURED = SUPPORTED.with_cutoff(2900.0)
STRIPS = {"supported": SUPPORTED, "2900 Hz": MEASURED, "clamped": PLATE}
POINTS = tuple(change(tip, radius_m=0.0) for tip in TIPS)
PLACES = tuple((tip.x_m, tip.y_m) for tip in TIPS)


def lossy(strip: Strip, loss: float, viscous_s: float = 0.0) -> Strip:
    return change(strip, material=change(ALUMINIUM, loss_factor=loss, viscous_time_s=viscous_s))


def off_db(found: Any, true: Any) -> float:
    return float(np.max(np.abs(20 * np.log10(found / true))))


@pytest.mark.slow
def test_equal_actuators_under_the_fingers_give_a_symmetric_matrix() -> None:
    peaks_m = felt(MEASURED, DISCS, TIPS, CYCLE)
    assert peaks_m.shape == (2, 2)
    np.testing.assert_allclose(peaks_m, peaks_m.T, rtol=1e-10)
    assert peaks_m[0, 0] == pytest.approx(peaks_m[1, 1], rel=1e-10)


@pytest.mark.slow
def test_each_load_is_driven_by_itself() -> None:
    loads = (DISCS[0], force(0.02, 0.01))
    together = felt(MEASURED, loads, POINTS, HANN)
    alone = [felt(MEASURED, (load,), POINTS, HANN)[:, 0] for load in loads]
    np.testing.assert_allclose(together, np.stack(alone, axis=1), rtol=2e-3)


def test_the_peak_is_linear_in_the_load() -> None:
    # a total force of 1 N, and as much pressure on the same small area
    loads = patch(2e-3, 2e-3, kind=ForceRectangle), disc(1e-3, kind=PressureDisc)
    force_m, pressure_m = felt(MEASURED, loads, TIPS, HANN)[0]
    assert pressure_m / (math.pi * 1e-3**2) == pytest.approx(force_m, rel=0.01)


@pytest.mark.slow
def test_the_peak_is_linear_in_the_drive() -> None:
    samples = np.sin(2 * np.pi * np.arange(33) / 32) * np.hanning(33)
    one, half = (
        felt(MEASURED, DISCS, POINTS, SampledDrive(samples=s, sample_rate_hz=16000.0))
        for s in (samples, 0.5 * samples)
    )
    np.testing.assert_allclose(half, one / 2, rtol=1e-6)


@pytest.mark.slow
def test_a_slow_drive_moves_the_plate_as_a_static_load_does() -> None:
    slow = Burst(frequency_hz=20.0, cycles=1, window="none")
    still_m = abs(displacement(scene_of(MEASURED, DISCS[0], PLACES[0]), [0.0])[0, 0, 0])
    assert felt(MEASURED, DISCS[:1], POINTS[:1], slow)[0, 0] == pytest.approx(still_m, rel=2e-3)


CLICK = SampledDrive(samples=[0.0, 1.0, -0.6, 0.2, 0.0], sample_rate_hz=8000.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "drive", "loss"),
    [
        *((name, drive, loss) for name in STRIPS for drive in (CYCLE, HANN) for loss in (0, 0.01)),
        ("2900 Hz", CLICK, 0.0),
    ],
    ids=str,
)
def test_window_and_step_hold_the_peak_to_a_twentieth_of_a_decibel(
    name: str, drive: Drive, loss: float
) -> None:
    strip = lossy(STRIPS[name], loss)
    peaks_m = felt(strip, DISCS[:1], POINTS, drive)[:, 0]
    scene = scene_of(causal(strip, drive), DISCS[0], *PLACES)
    watched_m = transient(scene, drive, np.arange(0.0, 0.016, 4e-6), 1e-3)[:, 0]
    assert off_db(peaks_m, np.max(np.abs(watched_m), axis=0)) < 0.05


@pytest.mark.slow
def test_a_contact_area_feels_at_least_what_its_centre_does() -> None:
    area_m, point_m = felt(MEASURED, DISCS, TIPS, HANN), felt(MEASURED, DISCS, POINTS, HANN)
    assert np.all(area_m >= point_m * (1 - 1e-3))
    assert level_db(area_m, own=0, other=1) > level_db(point_m, own=0, other=1)


@pytest.mark.slow
def test_a_fingertip_of_no_size_is_the_limit_of_small_ones() -> None:
    tiny = tuple(change(tip, radius_m=1e-7) for tip in TIPS)
    np.testing.assert_allclose(
        felt(MEASURED, DISCS, tiny, HANN), felt(MEASURED, DISCS, POINTS, HANN), rtol=1e-3
    )


def test_a_small_load_away_from_the_fingers_middle_is_not_missed() -> None:
    tip, above = Fingertip(x_m=0.0, y_m=W / 2), Fingertip(x_m=0.0033, y_m=0.0147, radius_m=0.0)
    felt_m, most_m = felt(MEASURED, (force(0.0033, 0.0147),), (tip, above), HANN)[:, 0]
    assert 1 <= felt_m / most_m < 1.01


@pytest.mark.parametrize("frequency_hz", [500.0, 5000.0])
def test_a_constant_loss_becomes_viscous_where_its_waves_travel(frequency_hz: float) -> None:
    strip, drive = lossy(MEASURED, 0.02, 1e-7), change(HANN, frequency_hz=frequency_hz)
    found = causal(strip, drive).material
    at_hz = 2900.0 if frequency_hz < 2900.0 else drive.peak_hz()
    assert found.loss_factor == 0
    loss = strip.material.stiffness_factor(at_hz)
    assert found.stiffness_factor(at_hz) == pytest.approx(loss, rel=1e-10)


@pytest.mark.slow
def test_what_is_felt_of_a_constant_loss_is_that_of_the_causal_one() -> None:
    strip = lossy(MEASURED, 0.02)
    plain, viscous = (felt(one, DISCS, POINTS, HANN) for one in (strip, causal(strip, HANN)))
    np.testing.assert_array_equal(plain, viscous)


@pytest.mark.slow
@pytest.mark.parametrize("name", STRIPS)
@pytest.mark.parametrize("drive", [CYCLE, HANN], ids=str)
def test_the_causal_loss_gives_the_level_of_the_constant_one(name: str, drive: Burst) -> None:
    strip = lossy(STRIPS[name], 0.01)
    scene = scene_of(strip, DISCS[0], *PLACES)
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
    for strip in (MEASURED, lossy(MEASURED, 0.0, 1e-6)):
        assert causal(strip, CYCLE) is strip
