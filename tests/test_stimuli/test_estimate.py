"""The estimate of the error against the error, every wave found, and borders that do not show."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    ForceRectangle,
    IdealEdge,
    Load,
    MomentDisc,
    MomentRectangle,
    PointForce,
    PressureDisc,
    PressureRectangle,
    Scene,
    Strip,
    displacement,
    response,
)
from stimuli.solver.guided import guided
from stimuli.strip.roots import decays_squared
from stimuli.strip.waves import Section, outgoing_root

W = 0.025
PLATE = Strip(width_m=W, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
FIRM = ElasticEdge(stiffness_n=141.72083994908)
EDGES: list[IdealEdge | ElasticEdge] = [SIMPLY_SUPPORTED, FIRM, CLAMPED]
TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8)


def on(edge: IdealEdge | ElasticEdge, loss: float = 0.0) -> Strip:
    material = dataclasses.replace(ALUMINIUM, loss_factor=loss)
    return dataclasses.replace(PLATE, edge=edge, material=material)


def drawn_scene(rng: np.random.Generator) -> Scene:
    edge = EDGES[rng.integers(3)]
    if edge is FIRM:
        edge = ElasticEdge(stiffness_n=10.0 ** rng.uniform(-4, 8), lossless=rng.random() < 0.5)
    loss = float(rng.choice([0.0, 0.5, 10.0 ** rng.uniform(-4, -0.3)]))
    y = float(rng.choice([W / 2, rng.uniform(0.05, 0.95) * W]))
    room = float(min(y, W - y) * 10.0 ** rng.uniform(-1.5, 0) * 0.999)
    along = W * 10.0 ** rng.uniform(-2, 0.5)
    loads: list[Load] = [PointForce(x_m=0.0, y_m=y)]
    loads += [disc(x_m=0.0, y_m=y, radius_m=room) for disc in (PressureDisc, MomentDisc)]
    loads += [
        rectangle(x_m=0.0, y_m=y, length_x_m=along, length_y_m=2 * room)
        for rectangle in (PressureRectangle, MomentRectangle, ForceRectangle)
    ]
    distances_m = np.array([0.0, 0.3 * rng.random(), 0.3 * 10.0 ** rng.uniform(-3, 0)])
    points = tuple((float(x), float(rng.uniform(0.02, 0.98) * W)) for x in distances_m)
    return Scene(strip=on(edge, loss), loads=(loads[rng.integers(6)],), points_m=points)


def rounding_m(scene: Scene, frequencies_hz: list[float], size_m: float) -> float:
    """Return what rounding alone may leave: 1e-14 of the field, more at low frequencies."""
    supported_hz = on(SIMPLY_SUPPORTED).cutoff_hz()
    k2 = math.pi**2 * min(frequencies_hz) / supported_hz
    assert scene.strip.width_m == W
    return 1e-14 * (1 + 10 / k2) * size_m


@pytest.mark.slow
def test_the_estimate_is_no_less_than_the_error_and_at_most_a_hundred_times_it() -> None:
    rng = np.random.default_rng(21)
    kept, covered, narrow = [], [], []
    for _ in range(150):
        scene, f = drawn_scene(rng), float(10.0 ** rng.uniform(0, math.log10(2e4)))
        true_m = displacement(scene, [f], 1e-12)
        size_m = float(np.max(np.abs(true_m)))
        floor_m = rounding_m(scene, [f], size_m)
        for rtol in TOLERANCES:
            found = response(scene, [f], rtol)
            error_m = np.abs(found.displacement_m - true_m)
            kept.append(error_m <= rtol * np.maximum(np.abs(true_m), 1e-3 * size_m))
            # the reference rounds as well
            covered.append(found.error_m + 1e-12 * np.abs(true_m) + floor_m >= error_m)
            narrow.append(found.error_m <= 100 * np.maximum(error_m, floor_m))
    assert np.all(kept)
    assert np.mean(covered) >= 0.99
    assert np.mean(narrow) >= 0.99


@pytest.mark.slow
def test_so_it_is_between_the_frequencies_that_are_solved() -> None:
    rng = np.random.default_rng(22)
    kept, covered, narrow = [], [], []
    for _ in range(40):
        scene = drawn_scene(rng)
        top_hz = scene.strip.cutoff_hz() * rng.uniform(0.05, 0.9)
        some_hz = np.sort(rng.uniform(0.01, 1.0, 4)) * top_hz
        true_m = np.array([displacement(scene, [f], 1e-12)[0] for f in some_hz])
        size_m = np.max(np.abs(true_m), axis=(1, 2), keepdims=True)
        floor_m = rounding_m(scene, [float(some_hz[0])], float(np.max(size_m)))
        for rtol in TOLERANCES:
            found = response(scene, np.append(some_hz, np.linspace(4.0, top_hz, 60)), rtol)
            if found.work.frequencies_solved >= 64:
                continue
            error_m = np.abs(found.displacement_m[:4] - true_m)
            estimate_m = found.error_m[:4]
            kept.append(error_m <= rtol * np.maximum(np.abs(true_m), 1e-3 * size_m))
            covered.append(estimate_m + 1e-12 * np.abs(true_m) + floor_m >= error_m)
            narrow.append(estimate_m <= 100 * np.maximum(error_m, floor_m))
    assert np.size(kept) > 1000
    assert np.all(kept)
    assert np.mean(covered) >= 0.99
    assert np.mean(narrow) >= 0.99


def test_the_number_of_solved_frequencies_does_not_grow_with_those_asked() -> None:
    scene = Scene(
        strip=PLATE,
        loads=(MomentDisc(x_m=0.0, y_m=W / 2, radius_m=0.0064),),
        points_m=((0.0, W / 2), (0.02, W / 2)),
    )
    for rtol in (1e-2, 1e-6, 1e-12):
        solved = [
            scene.work(np.linspace(4.0, 1500.0, n), rtol).frequencies_solved
            for n in (50, 500, 50_000)
        ]
        assert len(set(solved)) == 1
        assert solved[0] < 20


@pytest.mark.parametrize("sign", [1, -1])
def test_no_wave_is_lost_nor_found_twice(sign: int) -> None:
    rng = np.random.default_rng(23)
    for _ in range(60):
        k = 10.0 ** rng.uniform(-0.7, 1.5) * np.exp(1j * rng.choice([0.0, 0.1, 0.5]))
        hold = rng.choice([0.0, 10.0 ** rng.uniform(-6, 6)]) + 0j
        n = int(k.real / (2 * np.pi)) + 6
        section = Section(bending=complex(k / 2) ** 2, compliance=2 * hold, symmetric=sign > 0)
        other = 2 * outgoing_root(-decays_squared(section, n + 2))
        p = guided(np.array([k]), np.array([hold]), n, sign).p[0]
        apart = np.abs(p[:, np.newaxis] ** 2 - other**2)
        assert np.all(np.min(apart, axis=1) < 1e-9 * (np.abs(p) ** 2 + np.abs(k) ** 2))
        assert len(set(np.argmin(apart, axis=1))) == n
        assert p[-1].imag <= other[n - 1].imag * (1 + 1e-9) + 1e-9


# --- borders -------------------------------------------------------------------------------------


@pytest.mark.parametrize("edge", EDGES, ids=str)
@pytest.mark.parametrize("load", [PointForce, MomentDisc], ids=lambda load: load.__name__)
def test_the_way_a_norm_is_taken_does_not_show(
    edge: IdealEdge | ElasticEdge, load: type[PointForce | MomentDisc]
) -> None:
    border_hz = on(SIMPLY_SUPPORTED).cutoff_hz() / math.pi**2  # k W = 1
    size = {"radius_m": 0.005} if load is MomentDisc else {}
    points = ((0.0, 0.01), (0.004, 0.02), (0.08, 0.012))
    scene = Scene(strip=on(edge), loads=(load(x_m=0.0, y_m=0.011, **size),), points_m=points)
    below, above = displacement(scene, [border_hz * (1 - 1e-10), border_hz * (1 + 1e-10)], 1e-12)
    np.testing.assert_allclose(below, above, rtol=1e-9)


def test_the_way_a_disc_is_taken_does_not_show() -> None:
    radius_m = 0.4 * W
    border_hz = on(SIMPLY_SUPPORTED).cutoff_hz() * (3.0 / (0.4 * math.pi)) ** 2  # k R = 3
    points = ((0.0, 0.0125), (0.004, 0.02), (0.03, 0.012))
    for disc in (PressureDisc, MomentDisc):
        load = disc(x_m=0.0, y_m=W / 2, radius_m=radius_m)
        scene = Scene(strip=on(FIRM, 0.01), loads=(load,), points_m=points)
        two_hz = [border_hz * (1 - 1e-10), border_hz * (1 + 1e-10)]
        below, above = displacement(scene, two_hz, 1e-12)
        np.testing.assert_allclose(below, above, rtol=1e-8)


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_close_waves_are_summed_to_the_tolerance_wherever_they_are_taken_together(
    rtol: float,
) -> None:
    exceptional_hz = PLATE.exceptional_point_hz()
    detuning = np.concatenate([[0.0], 10.0 ** -np.arange(1.0, 13.0), -(10.0 ** -np.arange(2, 13))])
    scene = Scene(
        strip=PLATE,
        loads=(PointForce(x_m=0.0, y_m=0.011),),
        points_m=((0.0, 0.01), (0.02, 0.009), (0.1, 0.012)),
    )
    frequencies_hz = exceptional_hz * (1 + detuning)
    rough, exact = (displacement(scene, frequencies_hz, tol)[:, 0] for tol in (rtol, 1e-12))
    size_m = np.max(np.abs(exact), axis=1, keepdims=True)
    assert np.all(np.abs(rough - exact) <= rtol * np.maximum(np.abs(exact), 1e-3 * size_m))


@pytest.mark.slow
def test_no_scene_leaves_the_range_of_numbers() -> None:
    rng = np.random.default_rng(24)
    for _ in range(120):
        scene = drawn_scene(rng)
        x_m = 10.0 ** rng.uniform(-6, 1, 3) * rng.integers(0, 2, 3)
        points = tuple((float(x), float(W * rng.random())) for x in x_m)
        far = dataclasses.replace(scene, points_m=points, skip=bool(rng.random() < 0.8))
        frequencies_hz = 10.0 ** rng.uniform(-3, 5, 3)
        found = response(far, frequencies_hz, float(10.0 ** rng.uniform(-12, -1)))
        assert np.all(np.isfinite(found.displacement_m))
        assert np.all(np.isfinite(found.error_m))
