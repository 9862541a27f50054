"""Sweeps: few frequencies solved, the others as exact, in any order, none lost or worse."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest

from stimuli import CLAMPED, SIMPLY_SUPPORTED, PressureDisc, displacement, response
from tests.test_stimuli.plates import (
    FIRM,
    SOFT,
    Edge,
    W,
    alone,
    disc,
    drawn_strip,
    each_edge,
    force,
    on,
    patch,
    scene_of,
    spring,
    within,
)

if TYPE_CHECKING:
    from stimuli import Scene

FREE = SIMPLY_SUPPORTED
PATCH = patch(0.005, 0.015)
POINTS = ((0.0, W / 2), (0.02, 0.0075))
OFF = (force(0.0, 0.008), disc(0.003, x_m=0.01, y_m=0.017, kind=PressureDisc))
LOSSES = [(0.0, 0.0), (0.01, 0.0), (0.0, 1e-6)]
PARTS = {"below": (0.002, 0.95), "across": (0.002, 2.0), "above": (1.2, 3.0)}
BAND_HZ = np.linspace(60.0, 6000.0, 200)


def with_ends(
    edge: Edge, length_m: float = 0.1, loss: float = 0.01, viscous_s: float = 0.0
) -> Scene:
    strip = on(edge, length_m, loss=loss, viscous_s=viscous_s)
    points_m = ((-0.03, 0.009), (0.004, W / 2), (0.035, 0.016))
    return scene_of(strip, (force(0.02, 0.008), patch(x_m=-0.03)), *points_m)


@each_edge
@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize(("loss", "viscous_s"), LOSSES)
def test_a_sweep_is_what_its_frequencies_are_alone(
    edge: Edge, part: str, loss: float, viscous_s: float
) -> None:
    scene = scene_of(on(edge, loss=loss, viscous_s=viscous_s), OFF, *POINTS, (0.1, 0.004))
    sweep_hz, some = np.linspace(*PARTS[part], 160) * scene.strip.cutoff_hz(), [31, 83, 84, 157]
    found, true_m = response(scene, sweep_hz, 1e-6), alone(scene, sweep_hz[some])
    assert found.work.frequencies_solved < 50
    assert within(found.displacement_m[some], true_m, 1e-6, axis=(1, 2))
    error_m = np.abs(found.displacement_m[some] - true_m)
    assert np.all(error_m <= found.error_m[some] + 1e-12 * np.abs(true_m))


@pytest.mark.slow
@each_edge
@pytest.mark.parametrize(("loss", "viscous_s"), [(0.01, 0.0), (0.0, 5e-7)])
def test_so_it_is_between_ends(edge: Edge, loss: float, viscous_s: float) -> None:
    scene, some = with_ends(edge, loss=loss, viscous_s=viscous_s), [7, 83, 121, 199]
    found = response(scene, BAND_HZ, 1e-6)
    assert found.work.frequencies_solved < 45
    true_m = alone(scene, BAND_HZ[some], 1e-9)
    assert within(found.displacement_m[some], true_m, 1e-6, axis=2)
    error_m = np.abs(found.displacement_m[some] - true_m)
    assert np.mean(error_m <= found.error_m[some] + 1e-9 * np.abs(true_m)) > 0.9
    short = scene_of(on(edge, 0.012, nu=0.499), force(0.001), (-0.003, W / 2), (0.006, 0.008))
    top_hz = 0.9 * (1 - 0.499**2) ** 0.5 * short.strip.cutoff_hz()
    sweep_hz, some = np.linspace(0.2 * top_hz, top_hz * 0.999, 60), [3, 31, 59]
    assert short.work(sweep_hz, 1e-6).frequencies_solved < 40
    true_m = alone(short, sweep_hz[some], 1e-8)
    np.testing.assert_allclose(displacement(short, sweep_hz, 1e-6)[some], true_m, rtol=1e-6)


@pytest.mark.parametrize(
    ("edge", "high", "solved"),
    [
        (FREE, 0.8, 3),
        (FREE, 2.0, 4),
        (FREE, 20.0, 5),
        (CLAMPED, 0.8, 4),
        (CLAMPED, 0.98, 5),
        (CLAMPED, 2.0, 7),
    ],
)
def test_errors_lie_below_the_tolerance_and_not_far(edge: Edge, high: float, solved: int) -> None:
    scene = scene_of(on(edge), PATCH, *POINTS)
    sweep_hz = np.linspace(4.0, high * scene.strip.cutoff_hz(), 500)
    found, true_m = response(scene, sweep_hz, 1e-6), alone(scene, sweep_hz[::23])
    error = float(np.max(np.abs(found.displacement_m[::23] / true_m - 1)))
    assert found.work.frequencies_solved == solved
    assert 3e-10 < error < 1e-6


@pytest.mark.parametrize("rtol", [1e-2, 1e-6, 1e-12])
def test_the_number_of_solved_frequencies_hardly_grows_with_those_of_the_sweep(rtol: float) -> None:
    scene = scene_of(on(CLAMPED), disc(), (0.0, W / 2), (0.02, W / 2))
    sweeps_hz = (np.linspace(4.0, 1500.0, n) for n in (50, 500, 50_000))
    (solved,) = {scene.work(sweep_hz, rtol).frequencies_solved for sweep_hz in sweeps_hz}
    assert solved < 20
    if rtol == 1e-6:
        sweeps_hz = (np.linspace(60.0, 6000.0, n) for n in (12, 150, 3000))
        works = [response(with_ends(FREE), sweep_hz).work for sweep_hz in sweeps_hz]
        few, some, many = (work.frequencies_solved for work in works)
        assert few == 12
        assert abs(many - some) < 8


def test_a_frequency_next_to_a_cutoff_is_solved_by_itself() -> None:
    scene = scene_of(on(CLAMPED), PATCH, *POINTS)
    cutoff_hz = scene.strip.cutoff_hz()
    beside_hz = cutoff_hz * np.array([1 - 1e-11, 1 + 1e-11])
    sweep_hz = np.linspace(4.0, 1.5 * cutoff_hz, 100)
    found, bare = (response(scene, hz, 1e-6) for hz in (np.append(beside_hz, sweep_hz), sweep_hz))
    assert found.work.frequencies_solved == bare.work.frequencies_solved + 2
    assert within(found.displacement_m[:2], alone(scene, beside_hz), 1e-6, axis=(1, 2))


@each_edge
@pytest.mark.parametrize("length_m", [None, pytest.param(0.1, marks=pytest.mark.slow)])
def test_frequencies_may_come_in_any_order_all_alike_or_at_rest(
    edge: Edge, length_m: float | None
) -> None:
    scene = with_ends(edge) if length_m else scene_of(on(edge), OFF, *POINTS)
    n, top_hz, axis = (121, 6000.0, 2) if length_m else (40, 3000.0, (1, 2))
    mixed = np.random.default_rng(3).permutation(np.append(np.arange(n), [0, 5, 5]))
    sweep_hz = np.linspace(0.0, top_hz, n)
    in_order = displacement(scene, sweep_hz, 1e-8)
    assert within(displacement(scene, sweep_hz[mixed], 1e-8), in_order[mixed], 2e-8, axis=axis)
    at_rest = displacement(scene, [0.0], 1e-10)
    assert within(in_order[:1], at_rest, 1e-7 if length_m else 1e-8, axis=axis)
    for frequency_hz in (500.0, 0.0):
        alike = displacement(scene, np.full(40, frequency_hz), 1e-8)
        assert within(alike[-1:], displacement(scene, [frequency_hz], 1e-10), 1e-8, axis=axis)


@pytest.mark.slow
@pytest.mark.parametrize("edge", [FREE, SOFT, CLAMPED], ids=str)
def test_nothing_happens_to_a_sweep_where_waves_meet(edge: Edge) -> None:
    rng = np.random.default_rng(71)
    for _ in range(25):
        strip = drawn_strip(rng, edge)
        width_m = strip.width_m
        if edge is SOFT:
            strip = dataclasses.replace(strip, edge=spring(strip, 10 ** rng.uniform(-4, 4)))
        first_hz = dataclasses.replace(strip, edge=FREE).cutoff_hz()
        places = np.array([0.5, 2.0, 2.5, 3.0, 4.5]) * first_hz
        if edge is not FREE:  # which has a cut-off there
            places[-1] = strip.exceptional_point_hz()
            places = np.append(places, [first_hz, 4 * first_hz])
        beside = np.array([0.0, 1e-15, -1e-15, 1e-12, 1e-9, -1e-9, 1e-6])
        special_hz = np.append(
            (places[:, np.newaxis] * (1 + beside)).ravel(),
            strip.cutoff_hz() * (1 + np.array([1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6])),
        )
        load = force(0.0, 0.4 * width_m)
        scene = scene_of(strip, load, (0.0, 0.5 * width_m), (1.5 * width_m, 0.3 * width_m))
        sweep_hz = np.append(special_hz, np.linspace(0.0, 4.5 * first_hz, 60))
        found, true_m = response(scene, sweep_hz, 1e-6), alone(scene, special_hz)
        assert np.all(np.isfinite(found.displacement_m) & np.isfinite(found.error_m))
        assert within(found.displacement_m[: special_hz.size], true_m, 1e-6, axis=(1, 2))


@pytest.mark.slow
def test_the_estimate_covers_the_error_of_a_sweep() -> None:
    rng = np.random.default_rng(31)
    covered: list[bool] = []
    for n in range(12):
        edge = (SIMPLY_SUPPORTED, FIRM, CLAMPED)[n % 3]
        scene = with_ends(edge, 10 ** rng.uniform(-1.1, -0.5), 10 ** rng.uniform(-2.7, -1))
        sweep_hz = np.linspace(rng.choice([60.0, 1000.0]), rng.choice([2500.0, 6000.0]), 150)
        rtol, some = 10 ** rng.uniform(-7, -2), rng.choice(150, 6)
        found = response(scene, sweep_hz, rtol)
        true_m = alone(scene, sweep_hz[some], 1e-2 * rtol)
        assert within(found.displacement_m[some], true_m, rtol, axis=2)
        error_m = np.abs(found.displacement_m[some] - true_m)
        covered += list((error_m <= found.error_m[some] + 1e-2 * rtol * np.abs(true_m)).ravel())
    assert np.mean(covered) > 0.98


@pytest.mark.slow
def test_a_long_plate_is_swept_in_parts() -> None:
    sweep_hz, some = np.linspace(100.0, 20_000.0, 2000), [3, 411, 1203, 1998]
    found = response(with_ends(FREE, 1.5), sweep_hz, 1e-6)
    assert found.work.frequencies_solved < 1000
    true_m = alone(with_ends(FREE, 1.5), sweep_hz[some], 1e-9)
    assert within(found.displacement_m[some], true_m, 1e-6, 2)
