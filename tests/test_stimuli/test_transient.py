"""Displacements over time: known values, second methods, causality, limits and refusals."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    Burst,
    ElasticEdge,
    Load,
    PressureRectangle,
    SampledDrive,
    Scene,
    displacement,
)
from stimuli.field.synthesis import synthesis_work, synthesized
from stimuli.field.tail import tail
from tests.test_stimuli import plates
from tests.test_stimuli.plates import PLATE, Edge, W, disc, on, patch

if TYPE_CHECKING:
    from stimuli.arrays import Complex, Real

TAU = 8.264e-7
FIRM = dataclasses.replace(plates.FIRM, lossless=False)
DISC, PATCH = disc(), patch()
HERE, THERE = (0.0, W / 2), (0.07, W / 2)
PLAIN, SMOOTH = plates.CYCLE, plates.HANN
TIMES = np.linspace(0.0, 0.008, 161)


def scene_of(
    edge: Edge = SIMPLY_SUPPORTED,
    load: Load = DISC,
    points: plates.Points = (HERE, THERE),
    tau: float = TAU,
    **more: Any,
) -> Scene:
    return Scene(strip=on(edge, viscous_s=tau), loads=(load,), points_m=points, **more)


def sampled(samples: Any, rate_hz: float, *, held: bool = False) -> SampledDrive:
    return SampledDrive(samples=samples, sample_rate_hz=rate_hz, held=held)


def misfit(found: Real, true: Real) -> float:
    """Return the largest error relative to each pair's peak."""
    return float(np.max(np.max(np.abs(found - true), axis=0) / np.max(np.abs(true), axis=0)))


# --- known values and second methods -------------------------------------------------------------

# time synthesis along two lines at two rates, 6 to 8 digits of the peak; the spring has the
# plate's loss
KNOWN = [
    (ElasticEdge(stiffness_n=178.752842326547 * PLATE.bending_stiffness_n_m, lossless=False), 0.0,
     1.760711e-05, (-1.72317486535442e-07, 5.57509787660388e-08), (1e-7, 1e-7)),
    (CLAMPED, 0.02, 5.766769e-07, (-8.88061820623136e-10, -1.36217266004044e-09), (1e-5, 1e-6)),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("edge", "x_m", "peak_m", "true", "digits"), KNOWN)
def test_a_patch_moves_as_known(
    edge: Edge, x_m: float, peak_m: float, true: tuple[float, ...], digits: tuple[float, ...]
) -> None:
    scene = scene_of(edge, PATCH, ((x_m, W / 2),))
    found = synthesized(scene, SMOOTH, [0.001, 0.002], rtol=1e-10)[:, 0, 0]
    assert np.all(np.abs(found - true) < np.array(digits) * peak_m)


def turned_on(t: Real, carrier: float, one: Complex, two: Complex) -> Real:
    """Return the motion of oscillators with these two poles under sin(carrier t) from t = 0."""
    t = np.maximum(t, 0.0)
    steady = np.exp(1j * carrier * t) / (1j * (1j * carrier - one) * (1j * carrier - two))
    free = [
        carrier * np.exp(a * t) / ((a * a + carrier**2) * (a - b))
        for a, b in ((one, two), (two, one))
    ]
    return np.asarray((steady + free[0] + free[1]).real)


def by_oscillators(load: PressureRectangle, x_m: float, y_m: float, times: Real) -> Real:
    """Return u(t) of a supported strip, repeated every 2 m, as a sum of damped oscillators.

    Each wavenumber along and each mode across is an oscillator, driven by the three sines that
    make up a Hann burst.
    """
    stiffness = PLATE.bending_stiffness_n_m
    mass = ALUMINIUM.density_kg_m3 * PLATE.thickness_m
    s = np.pi * np.arange(1500)[:, np.newaxis]
    q = np.pi / W * np.arange(1, 41)
    square = stiffness * (s**2 + q**2) ** 2 / mass
    damping = square * TAU / 2
    swing = np.sqrt(damping**2 - square + 0j)
    poles = -square / (damping + swing), -damping - swing
    half = load.length_x_m / 2
    along = np.where(s == 0, 0.5, 1.0) * 2 * half * np.sinc(s * half / np.pi)
    across = np.sin(q * load.y_m) * np.sinc(q * load.length_y_m / 2 / np.pi) * load.length_y_m
    shape = along * np.cos(s * (x_m - load.x_m)) * across * np.sin(q * y_m) * 2 / W / mass
    last, found = SMOOTH.duration_s, np.zeros(times.size)
    for carrier_hz, part in ((500.0, 0.5), (750.0, -0.25), (250.0, -0.25)):
        carrier = 2 * np.pi * carrier_hz
        for row, t in enumerate(times):
            motion = turned_on(t, carrier, *poles) - turned_on(t - last, carrier, *poles)
            found[row] += part * np.sum(shape * motion)
    return found


@pytest.mark.slow
def test_oscillators_in_the_wavenumber_domain_agree() -> None:
    load = patch(0.006, 0.012, y_m=0.009, kind=PressureRectangle)
    scene = scene_of(load=load, points=((0.012, 0.011),))
    times = np.array([0.0005, 0.0017, 0.0022, 0.0033, 0.0041, 0.006])
    found = synthesized(scene, SMOOTH, times, rtol=1e-9)[:, 0, 0]
    true = by_oscillators(load, 0.012, 0.011, times)
    assert np.max(np.abs(found - true)) < 1e-6 * np.max(np.abs(true))


@pytest.mark.slow
@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, CLAMPED])
def test_every_bin_solved_gives_the_same(edge: Edge) -> None:
    times = np.linspace(0.0, 0.012, 101)
    lean, full = scene_of(edge), scene_of(edge, skip=False)
    some, every = (synthesized(scene, SMOOTH, times, rtol=1e-3) for scene in (lean, full))
    assert misfit(some, every) < 0.5e-3
    of_lean, of_full = (synthesis_work(scene, SMOOTH, times, rtol=1e-3) for scene in (lean, full))
    assert of_full.frequencies_solved > 1.5 * of_lean.frequencies_solved
    assert not any("follow" in reason or "no energy" in reason for reason in of_full.skipped)


@pytest.mark.slow
@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, CLAMPED])
def test_the_error_falls_with_rtol(edge: Edge) -> None:
    scene = scene_of(edge)
    burst = Burst(frequency_hz=430.0, cycles=3, window="hann")
    true = synthesized(scene, burst, TIMES, rtol=1e-10)
    errors = []
    for rtol in (1e-2, 1e-4, 1e-6, 1e-8):
        errors.append(misfit(synthesized(scene, burst, TIMES, rtol=rtol), true))
        assert errors[-1] < rtol
    assert all(later < 0.1 * earlier for earlier, later in itertools.pairwise(errors))


@pytest.mark.slow
def test_a_burst_with_corners_keeps_rtol_at_its_corners() -> None:
    corner = PLAIN.duration_s + np.array([-1e-5, -1e-6, 0.0, 1e-6, 3e-6, 1e-5, 1e-4])
    times = np.concatenate([[0.0, 1e-6, 3e-6, 1e-5], corner, TIMES])
    true = synthesized(scene_of(), PLAIN, times, rtol=1e-6)
    for rtol in (1e-2, 1e-3, 1e-4):
        assert misfit(synthesized(scene_of(), PLAIN, times, rtol=rtol), true) < rtol


@pytest.mark.slow
def test_corners_without_loss_reach_the_default_accuracy() -> None:
    times = np.concatenate([[0.0, 1e-6, 1e-5], PLAIN.duration_s + np.array([0.0, 1e-6, 1e-5])])
    scene = scene_of(tau=0.0, points=(HERE,))
    true = synthesized(scene, PLAIN, np.append(times, TIMES), rtol=1e-6)
    assert misfit(synthesized(scene, PLAIN, np.append(times, TIMES), rtol=1e-4), true) < 1e-4


# --- causality -----------------------------------------------------------------------------------


@pytest.mark.parametrize("burst", [SMOOTH, PLAIN])
@pytest.mark.parametrize("rtol", [1e-2, 1e-4, 1e-6])
@pytest.mark.slow
def test_nothing_moves_before_the_drive(burst: Burst, rtol: float) -> None:
    times = np.concatenate([np.linspace(-0.008, -1e-6, 50), TIMES])
    size = np.abs(synthesized(scene_of(FIRM), burst, times, rtol=rtol))
    assert np.all(np.max(size[:50], axis=0) < rtol * np.max(size, axis=0))


def test_nothing_moves_before_the_waves_arrive() -> None:
    scene = scene_of(points=((0.5, W / 2),))
    early, later = np.linspace(0.0, 2e-4, 20), np.linspace(2e-4, 0.012, 200)
    size = np.abs(synthesized(scene, SMOOTH, np.concatenate([early, later]), rtol=1e-6))
    assert np.max(size[:20]) < 1e-6 * np.max(size)


def test_constant_loss_is_refused_with_the_viscous_time_that_equals_it() -> None:
    scene = dataclasses.replace(scene_of(), strip=on(CLAMPED, loss=0.02))
    same = 0.02 / (2 * math.pi * SMOOTH.peak_hz())
    with pytest.raises(ValueError, match=f"loss_factor .* viscous_time_s={same:.4g} .*0.02"):
        synthesized(scene, SMOOTH, TIMES, 1e-6)
    with pytest.raises(ValueError, match="not causal"):
        synthesis_work(scene, SMOOTH, TIMES, 1e-6)


# --- laws ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_drives_add_up() -> None:
    rng = np.random.default_rng(3)
    one, two = (np.concatenate([[0.0], rng.uniform(-1, 1, 30), [0.0]]) for _ in range(2))
    u, v, both = (
        synthesized(scene_of(), sampled(s, 8e3), TIMES, rtol=1e-5)
        for s in (one, two, one + 2 * two)
    )
    peak = np.max(np.abs(u), axis=0) + 2 * np.max(np.abs(v), axis=0)
    assert np.all(np.abs(u + 2 * v - both) < 2e-5 * peak)


@pytest.mark.slow
def test_a_later_drive_moves_the_strip_later() -> None:
    samples, times = SMOOTH.samples(16e3), np.linspace(0.0, 0.01, 81)
    now, later = sampled(samples, 16e3), sampled(np.append(np.zeros(40), samples), 16e3)
    u = synthesized(scene_of(FIRM), now, times, rtol=1e-6)
    v = synthesized(scene_of(FIRM), later, times + 40 / 16e3, rtol=1e-6)
    assert misfit(u, v) < 2e-6


@pytest.mark.slow
def test_a_slow_drive_moves_the_strip_as_a_static_load() -> None:
    slow = Burst(frequency_hz=1.0, cycles=1, window="none")
    times = np.linspace(0.05, 0.95, 19)
    static = displacement(scene_of(FIRM, points=(HERE,)), [0.0], rtol=1e-9)[0].real
    found = synthesized(scene_of(FIRM, points=(HERE,)), slow, times, rtol=1e-6)
    signal = np.sin(2 * np.pi * times)[:, np.newaxis, np.newaxis]
    assert misfit(found, static * signal) < 2e-5


@pytest.mark.slow
def test_times_may_come_in_any_order() -> None:
    mixed = np.random.default_rng(5).permutation(TIMES)
    u, v = (synthesized(scene_of(), SMOOTH, times, rtol=1e-6) for times in (TIMES, mixed))
    np.testing.assert_allclose(v[np.argsort(mixed)], u, atol=1e-12 * float(np.max(np.abs(u))))
    assert synthesized(scene_of(), SMOOTH, [], rtol=1e-3).shape == (0, 1, 2)


@pytest.mark.slow
@pytest.mark.parametrize("last", [0.05, 1.0])
def test_long_records_agree_with_short_ones(last: float) -> None:
    times = np.array([0.001, 0.002, 0.003])
    short = synthesized(scene_of(), SMOOTH, np.append(times, 0.004), rtol=1e-5)
    long = synthesized(scene_of(), SMOOTH, np.append(times, last), rtol=1e-5)
    peak = np.max(np.abs(synthesized(scene_of(), SMOOTH, TIMES, rtol=1e-5)), axis=0)
    assert np.all(np.abs(short[:3] - long[:3]) < 2e-5 * peak)


def test_what_arrives_after_the_last_time_does_not_leak_into_it() -> None:
    scene, times = scene_of(points=((1.0, W / 2),)), np.linspace(0.0, 0.004, 41)
    short = synthesized(scene, SMOOTH, times, rtol=1e-4)
    long = synthesized(scene, SMOOTH, np.append(times, 0.04), rtol=1e-7)
    assert abs(long[-1, 0, 0]) > 10 * np.max(np.abs(long[:-1]))
    assert misfit(short, long[:-1]) < 1e-4


def test_the_tail_falls_with_three_quarters_of_a_power_and_is_bounded_by_schwarz() -> None:
    f, limits_hz = np.array([1e3, 4e3, 64e3]), np.array([4e3, 64e3])
    found = tail(SMOOTH, f, np.array([[8.0, 9.0], [4.0, 5.0], [99.0, 1.0]]), limits_hz)
    field_m = np.array([[8.0, 9.0], [4.0, 5.0], [0.5, 1.0]])
    np.testing.assert_allclose(found.field_m, field_m, rtol=1e-14)
    energy = SMOOTH.duration_s * 3 / 32 * np.array([SMOOTH.energy_above(one) for one in f])
    between = [np.sqrt((f[n + 1] - f[n]) * (energy[n] - energy[n + 1])) for n in (0, 1)]
    parts = np.array([*between, np.sqrt(2 * f[2] * energy[2])])[:, np.newaxis] * 2 * field_m
    bound_m = np.cumsum(parts[::-1], axis=0)[::-1]
    np.testing.assert_allclose(found.bound_m, bound_m, rtol=1e-3)


# --- sampled drives ------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_held_staircase_is_that_staircase_sampled_finely() -> None:
    samples = PLAIN.samples(8e3)
    held = sampled(samples, 8e3, held=True)
    fine = sampled(np.repeat(samples, 16), 128e3, held=True)
    u, v = (synthesized(scene_of(), drive, TIMES, rtol=1e-4) for drive in (held, fine))
    assert misfit(u, v) < 2e-4


@pytest.mark.slow
def test_fine_samples_move_the_strip_as_their_burst_does() -> None:
    u = synthesized(scene_of(), SMOOTH, TIMES, rtol=1e-6)
    errors = []
    for rate in (24e3, 48e3, 96e3):
        lines = sampled(SMOOTH.samples(rate), rate)
        errors.append(misfit(synthesized(scene_of(points=(HERE,)), lines, TIMES, 1e-6), u[..., :1]))
    assert errors[2] < 3e-4
    # straight lines: the error falls with the square of the step
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.1)


@pytest.mark.slow
def test_the_staircase_of_a_slow_converter_reaches_the_other_finger() -> None:
    held = sampled(SMOOTH.samples(8e3), 8e3, held=True)
    smooth, steps = (
        np.ptp(synthesized(scene_of(CLAMPED), drive, TIMES, rtol=1e-4)[:, 0], axis=0)
        for drive in (SMOOTH, held)
    )
    assert steps[0] == pytest.approx(smooth[0], rel=0.05)
    assert steps[1] > 10 * smooth[1]


# --- what a burst means at the other finger ------------------------------------------------------

FINDINGS = [
    (PLAIN, SIMPLY_SUPPORTED, 27.8), (PLAIN, FIRM, 31.9), (PLAIN, CLAMPED, 37.5),
    (SMOOTH, SIMPLY_SUPPORTED, 57.0), (SMOOTH, FIRM, 73.5), (SMOOTH, CLAMPED, 86.7),
]  # fmt: skip


@pytest.mark.parametrize(("burst", "edge", "wanted_db"), FINDINGS)
@pytest.mark.slow
def test_corners_of_a_burst_decide_what_arrives_70_mm_away(
    burst: Burst, edge: Edge, wanted_db: float
) -> None:
    """Patch 18 x 6 mm, viscous loss, peak-to-peak at 70 mm below that at the patch's centre."""
    u = synthesized(scene_of(edge, PATCH), burst, np.arange(0.0, 0.012, 1e-5), rtol=1e-3)[:, 0]
    here_m, there_m = np.ptp(u, axis=0)
    assert 20 * np.log10(here_m / there_m) == pytest.approx(wanted_db, abs=0.2)


@pytest.mark.parametrize(
    ("edge", "wanted_db"), [(SIMPLY_SUPPORTED, 68), (FIRM, 101), (CLAMPED, 97)]
)
def test_a_tone_alone_would_stay_at_its_finger(edge: Edge, wanted_db: float) -> None:
    u = np.abs(displacement(scene_of(edge, PATCH), [500.0])[0, 0])
    assert 20 * np.log10(u[0] / u[1]) == pytest.approx(wanted_db, abs=0.5)


# --- what is left out ----------------------------------------------------------------------------


def test_loads_never_driven_are_not_computed() -> None:
    strip, loads = on(SIMPLY_SUPPORTED, viscous_s=TAU), (DISC, PATCH, disc(x_m=0.07))
    every = Scene(strip=strip, loads=loads, points_m=(HERE, THERE))
    some = dataclasses.replace(every, driven=(True, False, True))
    full = dataclasses.replace(some, skip=False)
    lean, careful, all_three = (displacement(one, [300.0, 2500.0]) for one in (some, full, every))
    assert np.all(lean[:, 1] == 0)
    np.testing.assert_allclose(lean, careful, rtol=1e-6)
    np.testing.assert_array_equal(lean[:, ::2], all_three[:, ::2])
    assert some.work([300.0]).pairs_solved < full.work([300.0]).pairs_solved
    assert "1 of 3 loads: never driven" in some.work([300.0]).skipped
    u = synthesized(some, SMOOTH, TIMES[::16], rtol=1e-4)
    assert np.all(u[:, 1] == 0)
    assert np.any(u[:, 0])
    assert "1 of 3 loads: never driven" in synthesis_work(some, SMOOTH, [0.01], 1e-3).skipped


def test_a_scene_that_is_never_driven_does_not_move() -> None:
    still = scene_of(driven=(False,))
    assert np.all(displacement(still, [0.0, 300.0]) == 0)
    assert np.all(synthesized(still, SMOOTH, TIMES[:3], rtol=1e-3) == 0)


def test_work_tells_what_is_left_out_and_why() -> None:
    work = synthesis_work(scene_of(), SMOOTH, [0.01], rtol=1e-4)
    assert work.frequencies_solved < work.bins_asked - work.bins_skipped < work.bins_asked
    assert any("too little left" in reason for reason in work.skipped)
    assert any("smooth above the real axis" in reason for reason in work.skipped)
    finer = synthesis_work(scene_of(), SMOOTH, [0.01], rtol=1e-6)
    assert finer.highest_hz > work.highest_hz
    assert finer.frequencies_solved > work.frequencies_solved


@pytest.mark.slow
def test_bins_between_the_images_of_a_staircase_are_left_out() -> None:
    slow = Burst(frequency_hz=300.0, cycles=6, window="hann")
    held = sampled(slow.samples(96e3), 96e3, held=True)
    scene = scene_of(tau=1e-7, points=(THERE,))
    work = synthesis_work(scene, held, [0.03], rtol=1e-2)
    assert any("no energy there" in reason for reason in work.skipped)
    times = np.linspace(0.0, 0.03, 100)
    fine = synthesized(scene, held, times, rtol=1e-4)
    assert misfit(synthesized(scene, held, times, rtol=1e-2), fine) < 1e-2
