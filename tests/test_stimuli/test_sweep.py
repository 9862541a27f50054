"""Sweeps of finite strips with loss: few frequencies solved, the others as exact, none lost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from stimuli import CLAMPED, SIMPLY_SUPPORTED, displacement, response
from stimuli.field.field import solve
from stimuli.field.rational import swept
from stimuli.solver.source import Answered
from tests.test_stimuli.plates import (
    DISCS,
    FIRM,
    Edge,
    W,
    each_edge,
    force,
    on,
    patch,
    scene_of,
    within,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli import Scene
    from stimuli.arrays import Real

POINTS = ((-0.03, 0.009), (0.004, W / 2), (0.035, 0.016))
BAND_HZ = np.linspace(60.0, 6000.0, 200)
ALL = (slice(None),)


def plate(edge: Edge, length_m: float = 0.1, loss: float = 0.01, viscous_s: float = 0.0) -> Scene:
    strip = on(edge, length_m, loss=loss, viscous_s=viscous_s)
    return scene_of(strip, (force(0.02, 0.008), patch(x_m=-0.03)), *POINTS)


def alone(scene: Scene, frequencies_hz: Real, rtol: float) -> Answered:
    return solve(scene, frequencies_hz.astype(np.complex128), rtol)


@pytest.mark.slow
@each_edge
@pytest.mark.parametrize(("loss", "viscous_s"), [(0.01, 0.0), (0.0, 5e-7)])
def test_a_sweep_is_what_its_frequencies_are_alone(
    edge: Edge, loss: float, viscous_s: float
) -> None:
    scene, some = plate(edge, loss=loss, viscous_s=viscous_s), [7, 83, 121, 199]
    found = response(scene, BAND_HZ, 1e-6)
    assert found.work.frequencies_solved < 45
    true = alone(scene, BAND_HZ[some], 1e-9)
    assert within(found.displacement_m[some], true.value, 1e-6, axis=2)
    error_m = np.abs(found.displacement_m[some] - true.value)
    assert np.mean(error_m <= found.error_m[some] + true.error) > 0.9


def test_what_was_solved_is_told_and_hardly_grows_with_what_is_asked() -> None:
    scene = plate(SIMPLY_SUPPORTED)
    few, many = (response(scene, np.linspace(60.0, 6000.0, n)).work for n in (150, 3000))
    assert abs(many.frequencies_solved - few.frequencies_solved) < 8
    assert f"3000 frequencies follow from {many.frequencies_solved}: " in many.skipped[0]
    assert scene.work(np.linspace(60.0, 6000.0, 150)).frequencies_solved >= few.frequencies_solved


def test_a_few_frequencies_are_solved_by_themselves() -> None:
    work = plate(SIMPLY_SUPPORTED).work(np.linspace(60.0, 6000.0, 12))
    assert work.frequencies_solved == 12
    assert not any("follow from" in told for told in work.skipped)


def test_frequencies_may_come_in_any_order_and_twice_and_from_0() -> None:
    scene, rng = plate(SIMPLY_SUPPORTED), np.random.default_rng(3)
    sorted_hz = np.linspace(0.0, 6000.0, 121)
    mixed = rng.permutation(np.append(np.arange(121), [0, 5, 60, 60]))
    found = displacement(scene, sorted_hz[mixed], 1e-8)
    in_order = displacement(scene, sorted_hz, 1e-8)[mixed]
    assert within(found, in_order, 2e-8, axis=2)
    np.testing.assert_allclose(
        in_order[mixed == 0][:1], displacement(scene, [0.0], 1e-8), rtol=1e-7
    )


def test_a_gap_above_the_lowest_frequencies_is_not_bridged() -> None:
    scene = plate(SIMPLY_SUPPORTED)
    sweep_hz = np.append([0.0, 1.0], np.linspace(3000.0, 6000.0, 150))
    found, low = displacement(scene, sweep_hz, 1e-6), displacement(scene, [0.0, 1.0], 1e-8)
    assert within(found[:2], low, 1e-6, axis=2)


def test_loads_that_are_not_driven_do_not_move() -> None:
    strip = on(SIMPLY_SUPPORTED, 0.2, loss=0.01)
    scene = scene_of(strip, DISCS, *POINTS, driven=(True, False))
    found = displacement(scene, BAND_HZ)
    assert np.all(found[:, 1] == 0)
    assert np.all(found[:, 0] != 0)


@pytest.mark.slow
def test_a_long_plate_is_swept_in_parts() -> None:
    scene = plate(SIMPLY_SUPPORTED, 1.5)
    sweep_hz = np.linspace(100.0, 20_000.0, 2000)
    found, some = response(scene, sweep_hz, 1e-6), [3, 411, 1203, 1998]
    assert found.work.frequencies_solved < 1000
    assert len([told for told in found.work.skipped if "follow from" in told]) > 1
    assert within(found.displacement_m[some], alone(scene, sweep_hz[some], 1e-9).value, 1e-6, 2)


@pytest.mark.slow
def test_the_estimate_covers_the_error_of_a_sweep() -> None:
    rng = np.random.default_rng(31)
    covered: list[bool] = []
    for n in range(12):
        edge = (SIMPLY_SUPPORTED, FIRM, CLAMPED)[n % 3]
        scene = plate(edge, 10 ** rng.uniform(-1.1, -0.5), 10 ** rng.uniform(-2.7, -1))
        sweep_hz = np.linspace(rng.choice([60.0, 1000.0]), rng.choice([2500.0, 6000.0]), 150)
        rtol, some = 10 ** rng.uniform(-7, -2), rng.choice(150, 6)
        found = response(scene, sweep_hz, rtol)
        true = alone(scene, sweep_hz[some], 1e-2 * rtol)
        assert within(found.displacement_m[some], true.value, rtol, axis=2)
        error_m = np.abs(found.displacement_m[some] - true.value)
        covered += list((error_m <= found.error_m[some] + true.error).ravel())
    assert np.mean(covered) > 0.98


# --- quotients -----------------------------------------------------------------------------------

PLACE = np.linspace(0.0, 1.0, 600)
MANY = np.linspace(0.01, 0.99, 30) - 2e-3j


def with_poles(poles: NDArray[np.complexfloating[Any, Any]], noise: float = 0.0) -> Answered:
    parts = 1 / (PLACE[:, np.newaxis, np.newaxis] - poles[:, np.newaxis])
    value = (parts * [[1.0, 2.0]] * np.cos(np.arange(poles.size))[:, np.newaxis]).sum(axis=1)
    rng = np.random.default_rng(4)
    value = value * (1 + noise * rng.normal(size=value.shape))
    return Answered(value=value, error=np.full(value.shape, 1e-9))


@pytest.mark.parametrize(("noise", "solved"), [(0.0, 250), (1e-3, 600)])
def test_a_band_is_halved_and_at_the_worst_solved_at_every_place(noise: float, solved: int) -> None:
    true = with_poles(MANY, noise)
    found, rows = swept(
        PLACE,
        lambda rows: Answered(value=true.value[rows], error=true.error[rows]),
        1e-6,
        first=12,
        least=0,
        groups=ALL,
    )
    assert within(found.value, true.value, 1e-6, axis=1)
    assert np.unique(rows).size == rows.size <= solved
    assert np.all(found.value[rows] == true.value[rows])
    assert np.all(found.error[rows] == true.error[rows])
