"""Displacements over time: other methods, causality, superposition, all kinds of drives."""

from __future__ import annotations

import dataclasses
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
    response,
    transient,
    transient_response,
)
from stimuli.errors import PlateError, Rule
from tests.test_stimuli.plates import CYCLE, DISCS, FIRM, HANN, Edge, W, disc, on, patch
from tests.test_stimuli.scenes import load_of, reference_rows, strip_of
from tests.test_stimuli.sines import SupportedPlate

if TYPE_CHECKING:
    from stimuli.arrays import Complex, Real

TAU_S = 8.264e-7
HERE, THERE = (0.0, W / 2), (0.07, W / 2)
TIMES_S = np.linspace(0.0, 0.008, 161)


def moved(
    edge: Edge = SIMPLY_SUPPORTED,
    load: Load | None = None,
    points_m: tuple[tuple[float, float], ...] = (HERE, THERE),
    *,
    length_m: float | None = 0.2,
    tau_s: float = TAU_S,
) -> Scene:
    """A scene on the paper's plate with viscous loss."""
    strip = on(edge, length_m, viscous_s=tau_s)
    return Scene(strip=strip, loads=(load or disc(),), points_m=points_m)


def click(samples: Any, rate_hz: float, *, held: bool = False) -> SampledDrive:
    return SampledDrive(samples=samples, sample_rate_hz=rate_hz, held=held)


def misfit(value: Real | Complex, expected: Real | Complex) -> float:
    """Return the largest error, relative to the largest displacement."""
    return float(np.max(np.abs(value - expected)) / np.max(np.abs(expected)))


# --- other methods -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "rows",
    [
        pytest.param(slice(1, None, 7), id="some"),
        pytest.param(slice(None), id="all", marks=pytest.mark.slow),
    ],
)
def test_transients_are_those_of_another_solver_within_their_error(rows: slice) -> None:
    errors = []
    for row in reference_rows("transients.json")[rows]:
        points_m = tuple((x, y) for x, y in row["points_m"])
        scene = Scene(strip=strip_of(row), loads=(load_of(row["load"]),), points_m=points_m)
        expected_m = np.transpose(row["value_m"])
        times_s = np.linspace(0.0, row["end_s"], len(expected_m))
        motion = transient_response(scene, Burst(**row["burst"]), times_s)
        difference_m, largest_m = abs(motion.value[:, 0] - expected_m), np.max(abs(expected_m))
        assert np.all(difference_m <= motion.error[:, 0] + 1e-5 * largest_m), row
        errors.append(float(difference_m.max() / largest_m))
    assert np.median(errors) < 2e-4
    assert max(errors) < 3e-3


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


@pytest.mark.slow
def test_oscillators_in_the_wavenumber_domain_agree() -> None:
    load = patch(0.006, 0.012, y_m=0.009, kind=PressureRectangle)
    scene = moved(load=load, points_m=((0.012, 0.011),), length_m=None)
    motion = transient_response(scene, HANN, list(BY_OSCILLATORS))
    difference_m = motion.value[:, 0, 0] - list(BY_OSCILLATORS.values())
    assert np.all(abs(difference_m) <= motion.error[:, 0, 0])
    assert np.max(abs(difference_m)) < 1e-5 * np.max(motion.value)


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("tau_s", [2e-6, pytest.param(0.0, marks=pytest.mark.slow)])
def test_exponentials_of_matrices_agree(tau_s: float, *, held: bool) -> None:
    """Plates of few functions as equations of motion, solved without any frequency."""
    load = patch(0.03, 0.02, x_m=-0.01, y_m=0.012, kind=PressureRectangle)
    points_m = (-0.01, 0.012), (0.02, 0.0125), (0.03, 0.008)
    scene = moved(load=load, points_m=points_m, length_m=0.07, tau_s=tau_s)
    plate = SupportedPlate(scene.strip)
    drive = click(np.append(CYCLE.samples(20e3), 0.0), 20e3, held=held)
    motion = transient_response(scene, drive, np.arange(120) / 20e3)
    expected_m = plate.history(load, drive, points_m, 120)
    assert np.all(abs(motion.value[:, 0] - expected_m) <= motion.error[:, 0])
    assert misfit(motion.value[:, 0], expected_m) < (5e-3 if held else 3e-4)
    tone = response(scene, [700.0])
    assert misfit(tone.value[0, 0], plate.response(load, points_m, 700.0)) < 1e-4


def test_a_long_tone_moves_the_plate_as_its_response() -> None:
    scene = moved(FIRM, tau_s=1e-5)
    (steady_m,) = displacement(scene, [900.0])
    tone = Burst(frequency_hz=900.0, cycles=20, window="none")
    times_s = np.linspace(0.017, 0.022, 41)[:, np.newaxis, np.newaxis]
    expected_m = -np.imag(steady_m * np.exp(-2j * math.pi * 900.0 * times_s))
    motion = transient_response(scene, tone, times_s.ravel())
    assert np.all(abs(motion.value - expected_m) <= motion.error)


# --- causality -----------------------------------------------------------------------------------


@pytest.mark.parametrize("drive", [HANN, CYCLE], ids=["hann", "cycle"])
def test_nothing_moves_before_the_drive(drive: Burst) -> None:
    times_s = [-1.0, -1e-9, 0.0, 1e-3]
    motion_m = transient(moved(FIRM), drive, times_s)
    assert not motion_m[:3].any()
    assert motion_m[3].all()


@pytest.mark.parametrize("length_m", [None, pytest.param(1.2, marks=pytest.mark.slow)])
def test_nothing_moves_beyond_the_error_before_the_waves_arrive(length_m: float | None) -> None:
    """The fastest waves of the band of the drive go 0.5 m in some 2 ms."""
    scene = moved(points_m=(HERE, (0.5, W / 2)), length_m=length_m)
    motion = transient_response(scene, HANN, np.linspace(0.0, 2e-4, 20))
    assert np.all(abs(motion.value[:, 0, 1]) <= motion.error[:, 0, 1])
    assert np.max(abs(motion.value[:, 0, 1])) < 2e-5 * np.max(abs(motion.value[:, 0, 0]))


@pytest.mark.slow
def test_loss_that_modes_exchange_is_part_of_the_error() -> None:
    """Of springs without loss: waves of an endless strip have all of it, modes a part of theirs."""
    near_m = ((0.0, W / 2), (0.035, W / 2))
    drive = Burst(frequency_hz=2000.0, cycles=2, window="hann")
    endless, long = (
        transient_response(moved(FIRM, points_m=near_m, length_m=m, tau_s=5e-6), drive, TIMES_S)
        for m in (None, 1.2)
    )
    difference_m = abs(endless.value - long.value)
    assert np.all(difference_m <= endless.error + long.error)
    assert np.max(difference_m) > 2 * np.max(endless.error)


@pytest.mark.parametrize("length_m", [0.2, pytest.param(None, marks=pytest.mark.slow)])
def test_what_comes_after_the_last_time_does_not_leak_into_it(length_m: float | None) -> None:
    scene = moved(FIRM, length_m=length_m)
    mixed_s = np.random.default_rng(5).permutation(TIMES_S[:81])
    short, long = (
        transient_response(scene, CYCLE, times_s) for times_s in (mixed_s, [*TIMES_S[:81], 0.05])
    )
    order = np.argsort(mixed_s)
    difference_m = abs(short.value[order] - long.value[:81])
    assert np.all(difference_m <= short.error[order] + long.error[:81])


# --- laws ----------------------------------------------------------------------------------------


def test_drives_and_loads_add_up() -> None:
    rng = np.random.default_rng(3)
    first, second = (np.concatenate([[0.0], rng.uniform(-1, 1, 30), [0.0]]) for _ in range(2))
    u, v, both = (
        transient_response(moved(), click(samples, 8e3), TIMES_S)
        for samples in (first, second, first + 2 * second)
    )
    difference_m = abs(u.value + 2 * v.value - both.value)
    assert np.all(difference_m <= u.error + 2 * v.error + both.error)
    assert np.max(difference_m) < 5e-3 * np.max(abs(both.value))
    halves = (patch(0.006, 0.01, x_m=x_m, kind=PressureRectangle) for x_m in (-0.003, 0.003))
    pieces_m = [transient(moved(load=half), HANN, TIMES_S) for half in halves]
    whole_m = transient(moved(load=patch(0.012, 0.01, kind=PressureRectangle)), HANN, TIMES_S)
    assert misfit(np.sum(pieces_m, axis=0), whole_m) < 2e-4


def test_a_slow_drive_moves_the_plate_as_a_static_load() -> None:
    slow, times_s = Burst(frequency_hz=20.0, cycles=2, window="hann"), np.linspace(0.0, 0.12, 61)
    scene = moved(FIRM, points_m=(HERE,))
    static_m = displacement(scene, [0.0])[0].real
    signal = slow.at(times_s)[:, np.newaxis, np.newaxis]
    motion = transient_response(scene, slow, times_s)
    assert np.all(abs(motion.value - static_m * signal) <= motion.error)


def test_load_and_point_may_be_exchanged() -> None:
    first, second = (-0.03, 0.007), (0.02, 0.015)
    area: dict[str, Any] = {"along_m": 0.004, "across_m": 0.003, "kind": PressureRectangle}
    there, back = (
        transient_response(
            moved(FIRM, patch(x_m=source[0], y_m=source[1], **area), (place,)), CYCLE, TIMES_S
        )
        for source, place in ((first, second), (second, first))
    )
    # small areas instead of points: the mean over the area differs from the middle a little
    assert misfit(there.value, back.value) < 3e-3


# --- sampled drives ------------------------------------------------------------------------------


@pytest.mark.parametrize("held", [False, True])
def test_fine_samples_move_the_plate_as_their_burst_does(*, held: bool) -> None:
    expected_m, errors = transient(moved(), HANN, TIMES_S), []
    for rate_hz in (24e3, 96e3):
        drive = click(np.append(HANN.samples(rate_hz), 0.0), rate_hz, held=held)
        late_s = 0.5 / rate_hz if held else 0.0
        errors.append(misfit(transient(moved(), drive, TIMES_S + late_s), expected_m))
    assert errors[1] < (1e-3 if held else 2e-4)
    assert errors[1] < 0.5 * errors[0]


def test_a_held_staircase_is_that_staircase_sampled_finely() -> None:
    samples = CYCLE.samples(8e3)
    coarse, fine = click(samples, 8e3, held=True), click(np.repeat(samples, 16), 128e3, held=True)
    motion_m, expected_m = (transient(moved(), drive, TIMES_S) for drive in (coarse, fine))
    assert misfit(motion_m, expected_m) < 5e-3


# --- what a burst means at the other finger ------------------------------------------------------


@pytest.mark.parametrize(
    ("burst", "edge", "drop_db"),
    [
        (CYCLE, SIMPLY_SUPPORTED, 27.8),
        (CYCLE, FIRM, 31.9),
        (CYCLE, CLAMPED, 37.5),
        (HANN, SIMPLY_SUPPORTED, 57.0),
        (HANN, FIRM, 73.5),
        (HANN, CLAMPED, 86.7),
    ],
)
@pytest.mark.slow
def test_corners_of_a_burst_decide_what_arrives_70_mm_away(
    burst: Burst, edge: Edge, drop_db: float
) -> None:
    """Peak to peak, of a patch of 18 x 6 mm; a tone alone would stay at its finger."""
    scene = moved(dataclasses.replace(FIRM, lossless=False) if edge == FIRM else edge, patch())
    scene = dataclasses.replace(scene, strip=dataclasses.replace(scene.strip, length_m=None))
    motion_m = transient(scene, burst, np.arange(0.0, 0.012, 1e-5))[:, 0]
    here_m, there_m = np.ptp(motion_m, axis=0)
    assert 20 * math.log10(here_m / there_m) == pytest.approx(drop_db, abs=0.2)


# --- refusals ------------------------------------------------------------------------------------


def test_constant_loss_is_refused() -> None:
    scene = dataclasses.replace(moved(), strip=on(CLAMPED, loss=0.02))
    with pytest.raises(ValueError, match=r"^strip .*causal.*loss_factor = 0\.02"):
        transient(scene, HANN, TIMES_S)


def test_a_tolerance_is_kept_or_refused_with_the_one_that_can_be_kept() -> None:
    scene = moved(FIRM, DISCS[0], ((DISCS[0].x_m, W / 2),))
    with pytest.raises(PlateError) as refusal:
        transient_response(scene, HANN, TIMES_S, rtol=1e-9)
    assert refusal.value.rule is Rule.TOLERANCE
    min_rtol = float(refusal.value.values["min_rtol"])
    motion = transient_response(scene, HANN, TIMES_S, rtol=1.001 * min_rtol)
    assert np.max(motion.error) <= 1.001 * min_rtol * np.max(abs(motion.value))
