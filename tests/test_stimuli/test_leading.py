"""Sweeps of endless strips: few frequencies solved, the first waves taken at all, none worse."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    ForceRectangle,
    Material,
    PressureDisc,
    Strip,
    displacement,
    response,
)
from stimuli.field.field import solve
from stimuli.solver import leading
from stimuli.solver.across import Span
from stimuli.solver.leading import Grid, grid_nodes, over_frequency
from stimuli.solver.source import Question, Source
from tests.test_stimuli.plates import (
    EDGES,
    FIRM,
    SOFT,
    Edge,
    W,
    disc,
    each_edge,
    force,
    on,
    patch,
    scene_of,
    within,
)

if TYPE_CHECKING:
    from stimuli import Scene
    from stimuli.arrays import Complex, Real
    from stimuli.solver.source import Answered

PATCH = patch(0.005, 0.015)
POINTS = ((0.0, W / 2), (0.02, 0.0075))
OFF = (force(0.0, 0.008), disc(0.003, x_m=0.01, y_m=0.017, kind=PressureDisc))
PARTS = {"below": (0.002, 0.95), "across": (0.002, 2.0), "above": (1.2, 3.0)}
each_part = pytest.mark.parametrize("part", list(PARTS))


def sweep_of(strip: Strip, part: str, count: int = 160) -> Real:
    low, high = PARTS[part]
    return np.linspace(low, high, count) * strip.cutoff_hz()


def alone(scene: Scene, frequencies_hz: Real, rtol: float = 1e-11) -> Complex:
    return np.concatenate([solve(scene, np.array([f + 0j]), rtol).value for f in frequencies_hz])


@each_edge
@each_part
@pytest.mark.parametrize(("loss", "viscous_s"), [(0.0, 0.0), (0.01, 0.0), (0.0, 1e-6)])
def test_a_sweep_is_what_its_frequencies_are_alone(
    edge: Edge, part: str, loss: float, viscous_s: float
) -> None:
    scene = scene_of(on(edge, loss=loss, viscous_s=viscous_s), OFF, *POINTS, (0.1, 0.004))
    asked_hz, some = sweep_of(scene.strip, part), [31, 83, 84, 157]
    found, true_m = response(scene, asked_hz, 1e-6), alone(scene, asked_hz[some])
    assert found.work.frequencies_solved < 50
    assert within(found.displacement_m[some], true_m, 1e-6, axis=(1, 2))
    error_m = np.abs(found.displacement_m[some] - true_m)
    assert np.all(error_m <= found.error_m[some] + 1e-12 * np.abs(true_m))


@pytest.mark.parametrize(
    ("edge", "high", "solved"),
    [
        (SIMPLY_SUPPORTED, 0.8, 3),
        (SIMPLY_SUPPORTED, 2.0, 4),
        (SIMPLY_SUPPORTED, 20.0, 5),
        (CLAMPED, 0.8, 4),
        (CLAMPED, 0.98, 5),
        (CLAMPED, 2.0, 7),
    ],
)
def test_errors_lie_below_what_is_asked_and_not_far(edge: Edge, high: float, solved: int) -> None:
    scene = scene_of(on(edge), PATCH, *POINTS)
    asked_hz = np.linspace(4.0, high * scene.strip.cutoff_hz(), 500)
    found, true_m = response(scene, asked_hz, 1e-6), alone(scene, asked_hz[::23])
    error = float(np.max(np.abs(found.displacement_m[::23] / true_m - 1)))
    assert found.work.frequencies_solved == solved
    assert 3e-10 < error < 1e-6
    assert f"500 frequencies follow from {solved}: without its first waves" in found.work.skipped[0]


def test_far_points_and_many_waves_need_hardly_more_frequencies() -> None:
    strip = on(SIMPLY_SUPPORTED)
    for points in (POINTS, ((0.5, 0.01), (3.0, W / 2))):
        scene = scene_of(strip, OFF, *points)
        asked_hz = np.linspace(4.0, 99 * strip.cutoff_hz(), 300)
        found, some = response(scene, asked_hz, 1e-6), [11, 152, 299]
        assert found.work.frequencies_solved < 120
        assert within(found.displacement_m[some], alone(scene, asked_hz[some]), 1e-6, (1, 2))


def test_a_frequency_next_to_a_cutoff_is_solved_by_itself() -> None:
    scene = scene_of(on(CLAMPED), PATCH, *POINTS)
    cutoff_hz = scene.strip.cutoff_hz()
    beside_hz = cutoff_hz * np.array([1 - 1e-11, 1 + 1e-11])
    found = response(scene, np.append(beside_hz, np.linspace(4.0, 1.5 * cutoff_hz, 100)), 1e-6)
    bare = response(scene, np.linspace(4.0, 1.5 * cutoff_hz, 100), 1e-6)
    assert found.work.frequencies_solved == bare.work.frequencies_solved + 2
    assert within(found.displacement_m[:2], alone(scene, beside_hz), 1e-6, axis=(1, 2))


@each_edge
def test_frequencies_may_come_in_any_order_all_alike_or_at_rest(edge: Edge) -> None:
    scene, rng = scene_of(on(edge), OFF, *POINTS), np.random.default_rng(3)
    asked_hz = np.linspace(0.0, 3000.0, 40)
    mixed = rng.permutation(np.append(np.arange(40), [0, 5, 5]))
    in_order = displacement(scene, asked_hz, 1e-8)
    # not to the last digit: a processor's vectors round their ends in another way than their middle
    np.testing.assert_allclose(displacement(scene, asked_hz[mixed], 1e-8), in_order[mixed], 1e-14)
    at_rest = displacement(scene, [0.0], 1e-10)
    assert within(in_order[:1], at_rest, 1e-8, axis=(1, 2))
    for asked in (500.0, 0.0):
        alike = displacement(scene, np.full(40, asked), 1e-8)
        assert within(alike[-1:], displacement(scene, [asked], 1e-10), 1e-8, axis=(1, 2))
    assert displacement(scene, []).shape == (0, 2, 2)


@pytest.mark.slow
@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, SOFT, CLAMPED], ids=str)
def test_nothing_happens_to_a_sweep_where_waves_meet(edge: Edge) -> None:
    rng = np.random.default_rng(71)
    for _ in range(25):
        material = Material(
            youngs_modulus_pa=float(np.round(10 ** rng.uniform(9.3, 11.6), -6)),
            poisson_ratio=float(np.round(rng.uniform(0, 0.45), 3)),
            density_kg_m3=float(np.round(rng.uniform(900, 9000))),
        )
        width_m = float(np.round(rng.uniform(0.01, 0.06), 4))
        strip = Strip(
            width_m=width_m,
            thickness_m=float(np.round(width_m * rng.uniform(0.005, 0.05), 5)),
            material=material,
            edge=edge,
        )
        if edge is SOFT:
            spring_n = strip.bending_stiffness_n_m / width_m * 10 ** rng.uniform(-4, 4)
            strip = dataclasses.replace(strip, edge=ElasticEdge(stiffness_n=spring_n))
        first_hz = dataclasses.replace(strip, edge=SIMPLY_SUPPORTED).cutoff_hz()
        places = np.array([0.5, 2.0, 2.5, 3.0, 4.5]) * first_hz
        if edge is not SIMPLY_SUPPORTED:  # which has a cut-off there
            places[-1] = strip.exceptional_point_hz()
            places = np.append(places, [first_hz, 4 * first_hz])
        beside = np.array([0.0, 1e-15, -1e-15, 1e-12, 1e-9, -1e-9, 1e-6])
        special_hz = np.append(
            (places[:, np.newaxis] * (1 + beside)).ravel(),
            strip.cutoff_hz() * (1 + np.array([1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6])),
        )
        load = force(0.0, 0.4 * width_m)
        scene = scene_of(strip, load, (0.0, 0.5 * width_m), (1.5 * width_m, 0.3 * width_m))
        asked_hz = np.append(special_hz, np.linspace(0.0, 4.5 * first_hz, 60))
        found, true_m = response(scene, asked_hz, 1e-6), alone(scene, special_hz)
        assert np.all(np.isfinite(found.displacement_m) & np.isfinite(found.error_m))
        assert within(found.displacement_m[: special_hz.size], true_m, 1e-6, axis=(1, 2))


@pytest.mark.slow
def test_the_estimate_covers_the_error_below_and_above_cutoffs() -> None:
    rng, covered, narrow = np.random.default_rng(72), [], []
    for n in range(60):
        edge = EDGES[n % 3]
        if edge is FIRM:
            edge = ElasticEdge(stiffness_n=10.0 ** rng.uniform(-4, 8), lossless=rng.random() < 0.5)
        viscous_s = float(rng.choice([0.0, 0.0, 10 ** rng.uniform(-8, -5)]))
        loss = float(rng.choice([0.0, 0.01, 10 ** rng.uniform(-4, -0.3)]))
        kind: Any = rng.choice(np.array([ForceRectangle, PressureDisc]))
        room = 0.9 * float(rng.uniform(0.001, W / 2))
        load = (
            patch(float(rng.uniform(1e-4, 0.02)), room, kind=kind, y_m=W / 2 - room / 3)
            if kind is ForceRectangle
            else disc(0.9 * room, kind=kind, y_m=float(rng.uniform(room, W - room)))
        )
        points = ((float(rng.uniform(0, 0.2)), float(rng.uniform(0.02, 0.98) * W)), (0.0, W / 2))
        scene = scene_of(on(edge, loss=loss, viscous_s=viscous_s), load, *points)
        high = scene.strip.cutoff_hz() * float(rng.choice([0.7, 0.95, 1.5, 3.0, 6.0]))
        asked_hz = np.linspace(float(rng.choice([0.0, 0.4])) * high, high, 150)
        some, rtol = 1 + rng.choice(149, 5, replace=False), 10 ** rng.uniform(-8, -2)
        found, true_m = response(scene, asked_hz, rtol), alone(scene, asked_hz[some], 1e-3 * rtol)
        error_m = np.abs(found.displacement_m[some] - true_m)
        floor_m = 1e-12 * np.abs(true_m) + 1e-13 * np.max(np.abs(true_m))
        assert within(found.displacement_m[some], true_m, rtol, axis=(1, 2))
        covered.append(error_m <= found.error_m[some] + floor_m)
        narrow.append(found.error_m[some] <= 100 * np.maximum(error_m, floor_m))
    assert np.mean(covered) > 0.99
    assert np.mean(narrow) > 0.9


# --- waves as roots ------------------------------------------------------------------------------


def asked_of(hold: complex, places: Real, count: int, pairs: int = 1) -> tuple[Question, Grid]:
    """A point force between k W = 2 and 5, smooth in k^4."""
    low, high = 2.0**4, 5.0**4
    k = ((low + high) / 2 + (high - low) / 2 * grid_nodes(count)) ** 0.25 + 0j
    source = Source(span=Span(centre=-0.1))
    question = Question(
        exact_k=k,
        exact_hold=np.full(k.size, hold),
        rtol=1e-11,
        source=source,
        distance=np.array([0.0, 0.8]),
        across=np.array([0.2, -0.1]),
    )
    counts = {1: pairs, -1: pairs}
    return question, Grid.over(places, count, counts=counts, ratio=0.03)


@pytest.mark.parametrize("hold", [0.0, 0.3, 0.1 - 0.02j])
def test_the_roots_of_a_quadratic_and_of_a_polynomial_are_the_same_waves(
    hold: complex, monkeypatch: pytest.MonkeyPatch
) -> None:
    question, grid = asked_of(hold, np.linspace(-1, 1, 30), 6)
    one = over_frequency(question, (1,), grid)
    with monkeypatch.context() as patched:
        patched.setattr(leading, "_pairs", leading._block)
        other = over_frequency(question, (1,), grid)
    four = over_frequency(question, (1,), asked_of(hold, np.linspace(-1, 1, 30), 6, pairs=2)[1])
    for found in (other, four):
        assert np.all(np.abs(one.value - found.value) <= one.error + found.error)
        np.testing.assert_allclose(found.value, one.value, rtol=1e-5)


@pytest.mark.parametrize("hold", [0.0, 0.3, math.inf])
def test_at_its_nodes_a_sweep_is_what_was_solved(hold: float) -> None:
    from stimuli.solver.endless import solved

    question, grid = asked_of(hold, grid_nodes(4)[::2], 4)
    k, rigid = question.exact_k[::2], question.exact_hold[::2]
    there: Answered = solved(dataclasses.replace(question, exact_k=k, exact_hold=rigid))
    np.testing.assert_allclose(
        over_frequency(question, (1, -1), grid).value, there.value, rtol=1e-9
    )
