"""Displacements over time: second methods, causality, superposition, corners, echoes."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    Burst,
    Load,
    PressureRectangle,
    SampledDrive,
    Scene,
    displacement,
    transient,
    transient_work,
)
from tests.test_stimuli import plates
from tests.test_stimuli.plates import CYCLE, DISCS, HANN, Edge, W, disc, on, patch

if TYPE_CHECKING:
    from stimuli.arrays import Real

TAU = 8.264e-7
FREE, FIRM = SIMPLY_SUPPORTED, dataclasses.replace(plates.FIRM, lossless=False)
PATCH, HERE, THERE = patch(), (0.0, W / 2), (0.07, W / 2)
TIMES = np.linspace(0.0, 0.008, 161)


def scene_of(
    edge: Edge = FREE,
    load: Load | None = None,
    points: plates.Points = (HERE, THERE),
    tau: float = TAU,
    **more: Any,
) -> Scene:
    return Scene(strip=on(edge, viscous_s=tau), loads=(load or disc(),), points_m=points, **more)


def sampled(samples: Any, rate_hz: float, *, held: bool = False) -> SampledDrive:
    return SampledDrive(samples=samples, sample_rate_hz=rate_hz, held=held)


def misfit(found: Real, true: Real) -> float:
    """Return the largest error relative to each pair's peak."""
    return float(np.max(np.max(np.abs(found - true), axis=0) / np.max(np.abs(true), axis=0)))


# Each wavenumber along a strip that repeats itself every 2 m and each of 40 modes across it as a
# damped oscillator, driven by the three sines that make up a Hann burst: time, metres
BY_OSCILLATORS = {
    0.0005: 6.172925830404e-11,
    0.0017: -3.4574058795935e-10,
    0.0022: 2.6038094979015e-10,
    0.0033: -1.0380302746980e-10,
    0.0041: -2.6678461513908e-12,
    0.0060: -1.2969761364377e-13,
}


def test_oscillators_in_the_wavenumber_domain_agree() -> None:
    load = patch(0.006, 0.012, y_m=0.009, kind=PressureRectangle)
    scene = scene_of(load=load, points=((0.012, 0.011),))
    found = transient(scene, HANN, list(BY_OSCILLATORS), rtol=1e-9)[:, 0, 0]
    true = np.array(list(BY_OSCILLATORS.values()))
    assert np.max(np.abs(found - true)) < 1e-6 * np.max(np.abs(true))


@pytest.mark.slow
@pytest.mark.parametrize("edge", [FREE, CLAMPED])
def test_every_bin_solved_gives_the_same(edge: Edge) -> None:
    times, rtol = np.linspace(0.0, 0.012, 101), 9e-4
    lean, full = scene_of(edge), scene_of(edge, skip=False)
    some, every = (transient(scene, HANN, times, rtol) for scene in (lean, full))
    assert misfit(some, every) < rtol / 2
    works = [transient_work(scene, HANN, times, rtol) for scene in (lean, full)]
    assert works[1].frequencies_solved > 1.5 * works[0].frequencies_solved
    finer = transient_work(lean, HANN, times, 1e-6)
    assert finer.highest_hz > works[0].highest_hz
    assert finer.frequencies_solved > works[0].frequencies_solved
    for work in (*works, finer):
        assert work.bins_asked > work.bins_asked - work.bins_skipped >= 0


@pytest.mark.slow
@pytest.mark.parametrize("edge", [FREE, CLAMPED])
def test_the_error_falls_with_rtol(edge: Edge) -> None:
    scene, burst = scene_of(edge), Burst(frequency_hz=430.0, cycles=3, window="hann")
    true = transient(scene, burst, TIMES, rtol=1e-10)
    errors = []
    for rtol in (1e-2, 1e-4, 1e-6, 1e-8):
        errors.append(misfit(transient(scene, burst, TIMES, rtol=rtol), true))
        assert errors[-1] < rtol
    assert all(later < 0.1 * earlier for earlier, later in itertools.pairwise(errors[1:]))


@pytest.mark.slow
@pytest.mark.parametrize("tau", [TAU, 0.0])
def test_a_burst_with_corners_keeps_rtol_at_its_corners(tau: float) -> None:
    corner = CYCLE.duration_s + np.array([-1e-5, -1e-6, 0.0, 1e-6, 3e-6, 1e-5, 1e-4])
    times = np.concatenate([[0.0, 1e-6, 3e-6, 1e-5], corner, TIMES])
    scene = scene_of(tau=tau, points=(HERE, THERE) if tau else (HERE,))
    true = transient(scene, CYCLE, times, rtol=1e-6)
    for rtol in (1e-2, 1e-3, 1e-4):
        assert misfit(transient(scene, CYCLE, times, rtol=rtol), true) < rtol


# --- causality -----------------------------------------------------------------------------------


@pytest.mark.parametrize("burst", [HANN, CYCLE])
@pytest.mark.parametrize("rtol", [1e-2, 1e-4, 1e-6])
@pytest.mark.slow
def test_nothing_moves_before_the_drive(burst: Burst, rtol: float) -> None:
    times = np.concatenate([np.linspace(-0.008, -1e-6, 50), TIMES])
    size = np.abs(transient(scene_of(FIRM), burst, times, rtol=rtol))
    assert np.all(np.max(size[:50], axis=0) < rtol * np.max(size, axis=0))


def test_nothing_moves_before_the_waves_arrive() -> None:
    scene = scene_of(points=((0.5, W / 2),))
    early, later = np.linspace(0.0, 2e-4, 20), np.linspace(2e-4, 0.012, 200)
    size = np.abs(transient(scene, HANN, np.concatenate([early, later]), rtol=1e-6))
    assert np.max(size[:20]) < 1e-6 * np.max(size)


def test_what_arrives_after_the_last_time_does_not_leak_into_it() -> None:
    scene, times = scene_of(points=((1.0, W / 2),)), np.linspace(0.0, 0.004, 41)
    short = transient(scene, HANN, times, rtol=1e-4)
    long = transient(scene, HANN, np.append(times, 0.04), rtol=1e-7)
    assert abs(long[-1, 0, 0]) > 10 * np.max(np.abs(long[:-1]))
    assert misfit(short, long[:-1]) < 1e-4


def test_constant_loss_is_refused_with_the_viscous_time_that_equals_it() -> None:
    scene = dataclasses.replace(scene_of(), strip=on(CLAMPED, loss=0.02))
    same = 0.02 / (2 * math.pi * HANN.peak_hz())
    for call in (transient, transient_work):
        with pytest.raises(ValueError, match=rf"loss_factor .*={same:.4g}\b.*0\.02"):
            call(scene, HANN, TIMES, 1e-6)


# --- laws ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_drives_add_up() -> None:
    rng = np.random.default_rng(3)
    one, two = (np.concatenate([[0.0], rng.uniform(-1, 1, 30), [0.0]]) for _ in range(2))
    u, v, both = (
        transient(scene_of(), sampled(s, 8e3), TIMES, rtol=1e-5) for s in (one, two, one + 2 * two)
    )
    peak = np.max(np.abs(u), axis=0) + 2 * np.max(np.abs(v), axis=0)
    assert np.all(np.abs(u + 2 * v - both) < 2e-5 * peak)


@pytest.mark.slow
def test_a_slow_drive_moves_the_strip_as_a_static_load() -> None:
    slow, times = Burst(frequency_hz=1.0, cycles=1, window="none"), np.linspace(0.05, 0.95, 19)
    static = displacement(scene_of(FIRM, points=(HERE,)), [0.0], rtol=1e-9)[0].real
    found = transient(scene_of(FIRM, points=(HERE,)), slow, times, rtol=1e-6)
    signal = np.sin(2 * np.pi * times)[:, np.newaxis, np.newaxis]
    assert misfit(found, static * signal) < 2e-5


@pytest.mark.slow
def test_times_may_come_in_any_order_and_go_on_for_long() -> None:
    mixed = np.random.default_rng(5).permutation(TIMES)
    u, v = (transient(scene_of(), HANN, times, rtol=1e-5) for times in (TIMES, mixed))
    np.testing.assert_allclose(v[np.argsort(mixed)], u, atol=1e-12 * float(np.max(np.abs(u))))
    assert transient(scene_of(), HANN, [], rtol=1e-3).shape == (0, 1, 2)
    peak = np.max(np.abs(u), axis=0)
    for last in (0.05, 1.0):
        long = transient(scene_of(), HANN, np.append(TIMES[20:80:20], last), rtol=1e-5)
        assert np.all(np.abs(long[:3] - u[20:80:20]) < 2e-5 * peak)


# --- sampled drives ------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_held_staircase_is_that_staircase_sampled_finely() -> None:
    samples = CYCLE.samples(8e3)
    held = sampled(samples, 8e3, held=True)
    fine = sampled(np.repeat(samples, 16), 128e3, held=True)
    u, v = (transient(scene_of(), drive, TIMES, rtol=1e-4) for drive in (held, fine))
    assert misfit(u, v) < 2e-4
    slow = Burst(frequency_hz=300.0, cycles=6, window="hann")
    held, times = sampled(slow.samples(96e3), 96e3, held=True), np.linspace(0.0, 0.03, 100)
    scene = scene_of(tau=1e-7, points=(THERE,))
    rough, fine_m = (transient(scene, held, times, rtol) for rtol in (1e-2, 1e-4))
    assert misfit(rough, fine_m) < 1e-2


@pytest.mark.slow
def test_fine_samples_move_the_strip_as_their_burst_does() -> None:
    u, errors = transient(scene_of(), HANN, TIMES, rtol=1e-6), []
    for rate in (24e3, 48e3, 96e3):
        lines = sampled(HANN.samples(rate), rate)
        errors.append(misfit(transient(scene_of(points=(HERE,)), lines, TIMES, 1e-6), u[..., :1]))
    assert errors[2] < 3e-4
    # straight lines: the error falls with the square of the step
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.1)


# --- what a burst means at the other finger ------------------------------------------------------


@pytest.mark.parametrize(
    ("burst", "edge", "drop_db"),
    [
        (CYCLE, FREE, 27.8),
        (CYCLE, FIRM, 31.9),
        (CYCLE, CLAMPED, 37.5),
        (HANN, FREE, 57.0),
        (HANN, FIRM, 73.5),
        (HANN, CLAMPED, 86.7),
        (None, FREE, 68.0),
        (None, FIRM, 101.0),
        (None, CLAMPED, 97.0),
    ],
)
@pytest.mark.slow
def test_corners_of_a_burst_decide_what_arrives_70_mm_away(
    burst: Burst | None, edge: Edge, drop_db: float
) -> None:
    """Patch 18 x 6 mm, viscous loss, peak to peak; a tone alone would stay at its finger."""
    if burst is None:
        u = np.abs(displacement(scene_of(edge, PATCH), [500.0])[0])
    else:
        u = transient(scene_of(edge, PATCH), burst, np.arange(0.0, 0.012, 1e-5), 9e-4)[:, 0]
    here_m, there_m = np.ptp(u, axis=0) if burst else u[0]
    found_db = 20 * np.log10(here_m / there_m)
    assert found_db == pytest.approx(drop_db, abs=0.2 if burst else 0.5)


# --- by modes of the plate -----------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("held", "rtol"), [(None, 1e-2), (False, 1e-2), (True, 0.1)])
@pytest.mark.parametrize("length_m", [0.2, 100.0])
def test_modes_move_a_plate_as_its_spectrum_does(
    rtol: float, length_m: float, *, held: bool | None
) -> None:
    drive: Any = Burst(frequency_hz=500.0, cycles=1, window="hann")
    if held is not None:
        drive = sampled(np.append(drive.samples(20e3), 0.0), 20e3, held=held)
    points = tuple((load.x_m, load.y_m) for load in DISCS)
    strip = on(FREE, length_m, viscous_s=0.02 / (2 * math.pi * 1926.0))
    scene = Scene(strip=strip, loads=DISCS, points_m=points, driven=(True, False))
    times_s = np.random.default_rng(2).uniform(-1e-4, 0.01, 60)
    ours, theirs = (transient(scene, drive, times_s, rtol=r) for r in (rtol, 1e-4))
    assert transient_work(scene, drive, times_s, rtol=rtol).modes > 10
    assert transient_work(scene, drive, times_s[:1], rtol=1e-5).modes == 0
    assert np.all(np.abs(ours - theirs) <= rtol * np.max(np.abs(theirs), axis=0))
    assert not ours[times_s < 0].any()
    assert not ours[:, 1].any()
