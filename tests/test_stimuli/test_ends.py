"""Free short ends: published values, the plate's own laws, two other methods, limits."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.polynomial import legendre

from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    PointForce,
    PressureRectangle,
    Strip,
    displacement,
    response,
)
from stimuli.field.field import solve
from tests.test_stimuli.plates import (
    DISCS,
    EDGES,
    FIRM,
    SUPPORTED,
    Edge,
    Points,
    W,
    at,
    disc,
    each_edge,
    force,
    on,
    patch,
    scene_of,
    within,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

FINITE = on(CLAMPED, 0.05)


def bending(strip: Strip, frequency_hz: float) -> complex:
    """Return (k W)^4 with the plate's loss."""
    inertia = strip.material.density_kg_m3 * strip.thickness_m * (2 * math.pi * frequency_hz) ** 2
    factor = strip.material.stiffness_factor(frequency_hz)
    return complex(inertia * W**4 / (strip.bending_stiffness_n_m * factor))


# --- known values --------------------------------------------------------------------------------

# Two-dimensional Galerkin models of 20 and of 13 polynomials along x: 12 digits, the last 11:
# edge, patch, x and y of the point, frequency, metres
SMALL, SIDE = patch(0.005, 0.015), patch(x_m=0.035)
KNOWN: list[tuple[Edge, Any, float, float, float, complex]] = [
    (SIMPLY_SUPPORTED, SMALL, 0.0, W / 2, 500, -2.3061331585288091e-05 - 2.3781071148572299e-07j),
    (SIMPLY_SUPPORTED, SMALL, 0.02, 0.0075, 500, -1.9807964221232675e-06 - 2.2596465628158454e-08j),
    (CLAMPED, SMALL, 0.02, 0.0075, 500, 2.9940554851240411e-07 + 2.9637063653468444e-09j),
    (SIMPLY_SUPPORTED, SIDE, 0.035, W / 2, 2600, -5.1185572302677408e-05 - 2.7009407165357262e-05j),
    (SIMPLY_SUPPORTED, SIDE, -0.035, W / 2, 2600, 2.6159621413215560e-05 + 2.4654961487232427e-05j),
]


@pytest.mark.parametrize(("edge", "load", "x_m", "y_m", "frequency_hz", "known"), KNOWN)
def test_known_values_of_finite_strips(
    edge: Edge, load: Any, x_m: float, y_m: float, frequency_hz: float, known: complex
) -> None:
    value = at(on(edge, 0.2, loss=0.01), load, [(x_m, y_m)], frequency_hz)[0]
    assert abs(value - known) < 1e-11 * abs(known)


# --- two other methods ---------------------------------------------------------------------------


def by_orders(strip: Strip, load: PointForce, points_m: Points, frequency_hz: float) -> list[float]:
    """Return what the ends add between simple supports, each order across the strip by itself."""
    assert strip.length_m is not None
    k2, nu = math.sqrt(bending(strip, frequency_hz).real), strip.material.poisson_ratio
    half, x0 = strip.length_m / W / 2, load.x_m / W
    q = np.pi * np.arange(1, 8001)
    decays = [np.conj(np.sqrt(q * q - k2 + 0j)), np.sqrt(q * q + k2 + 0j)]
    moments = [r * r - nu * q * q for r in decays]
    shears = [r**3 - (2 - nu) * q * q * r for r in decays]
    values = [0j for _ in points_m]
    for side in (1, -1):
        matrix = [[0j * q, 0j * q], [0j * q, 0j * q]]
        pushed = [0j * q, 0j * q]
        for i, (decay, moment, shear, sign) in enumerate(
            zip(decays, moments, shears, (1, -1), strict=True)
        ):
            far = side * np.exp(-2 * decay * half)
            matrix[0][i], matrix[1][i] = moment * (1 + far), shear * (1 - far)
            wave = np.exp(-decay * (half - x0)) + side * np.exp(-decay * (half + x0))
            wave = sign * wave / (8 * decay * k2)
            pushed[0], pushed[1] = pushed[0] - wave * moment, pushed[1] + wave * shear
        determinant = matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0]
        one = (pushed[0] * matrix[1][1] - pushed[1] * matrix[0][1]) / determinant
        two = (matrix[0][0] * pushed[1] - matrix[1][0] * pushed[0]) / determinant
        for i, (x_m, y_m) in enumerate(points_m):
            x, shape = x_m / W, 2 * np.sin(q * y_m / W) * np.sin(q * load.y_m / W)
            for strength, decay in ((one, decays[0]), (two, decays[1])):
                seen = np.exp(-decay * (half - x)) + side * np.exp(-decay * (half + x))
                values[i] += complex((shape * strength * seen).sum())
    return [float(v.real) for v in values]


@pytest.mark.slow
@pytest.mark.parametrize("from_end_m", [0.02, 0.003, 0.0004, 0.0])
@pytest.mark.parametrize("frequency_hz", [700.0, 5000.0])
def test_supported_strips_agree_with_a_beam_for_each_order(
    from_end_m: float, frequency_hz: float
) -> None:
    strip, load = on(SIMPLY_SUPPORTED, 0.05), force(0.025 - from_end_m, 0.006)
    points_m = ((0.0, W / 2), (0.024, W / 2), (0.025, 0.009), (-0.025, 0.02))
    endless = at(SUPPORTED, load, points_m, frequency_hz, 1e-11)
    scale = W**2 / strip.bending_stiffness_n_m
    added = scale * np.array(by_orders(strip, load, points_m, frequency_hz))
    found = at(strip, load, points_m, frequency_hz, 1e-8)
    np.testing.assert_allclose(found.real, endless.real + added, rtol=1e-6)


def polynomials(count: int, scale: float, held: str, places: Any) -> list[NDArray[np.float64]]:
    """Return values and two derivatives of Legendre sums that are free, supported or clamped."""
    found: list[list[Any]] = [[], [], []]
    for j in range(count):
        terms = np.zeros(j + 5)
        if held == "free":
            terms[j] = math.sqrt(2 * j + 1)
        elif held == "supported":
            terms[[j, j + 2]] = 1 / (j + 1) ** 1.5, -1 / (j + 1) ** 1.5
        else:
            terms[[j, j + 2, j + 4]] = 1, -2 * (2 * j + 5) / (2 * j + 7), (2 * j + 3) / (2 * j + 7)
            terms /= (2 * j + 3) * math.sqrt(2 * (2 * j + 5))
        for d in range(3):
            series = legendre.legder(terms, d)
            found[d].append(legendre.legval(np.asarray(places) * scale, series) * scale**d)
    return [np.array(rows) for rows in found]


@pytest.mark.slow
@pytest.mark.parametrize("edge", [CLAMPED, FIRM], ids=["clamped", "elastic"])
@pytest.mark.parametrize("frequency_hz", [500.0, 5000.0])
def test_held_strips_agree_with_polynomials_in_both_directions(
    edge: Edge, frequency_hz: float
) -> None:
    strip, half = on(edge, 0.04, loss=0.02), 0.02 / W
    load = patch(0.012, 0.016, x_m=0.004, y_m=0.0105, kind=PressureRectangle)
    points_m = ((0.004, 0.0105), (0.016, 0.01), (0.02, W / 2), (0.0199, 0.003), (-0.02, 0.02))
    x, y = np.array(points_m).T / W
    held = "clamped" if edge is CLAMPED else "supported"
    grams, sides, seen = [], [], []
    for count, reach, kind, centre, size, places in (
        (28, half, "free", 0.004 / W, 0.006 / W, x),
        (22, 0.5, held, 0.0105 / W - 0.5, 0.008 / W, y - 0.5),
    ):
        nodes, weights = legendre.leggauss(count + 8)
        a = polynomials(count, 1 / reach, kind, nodes * reach)
        grams.append(
            {(i, j): (a[i] * weights * reach) @ a[j].T for i in range(3) for j in range(3)}
        )
        nodes, weights = legendre.leggauss(30)
        loaded = polynomials(count, 1 / reach, kind, centre + size * nodes)[0]
        sides.append(loaded @ weights * size)
        seen.append(polynomials(count, 1 / reach, kind, places)[0])
    along, cross = grams
    nu = strip.material.poisson_ratio
    stiffness = np.kron(along[2, 2], cross[0, 0]) + np.kron(along[0, 0], cross[2, 2])
    stiffness += nu * (np.kron(along[2, 0], cross[0, 2]) + np.kron(along[0, 2], cross[2, 0]))
    stiffness += 2 * (1 - nu) * np.kron(along[1, 1], cross[1, 1])
    factor = strip.material.stiffness_factor(frequency_hz)
    matrix = stiffness - bending(strip, frequency_hz) * np.kron(along[0, 0], cross[0, 0])
    if isinstance(edge, ElasticEdge):
        slopes = polynomials(22, 2.0, held, [-0.5, 0.5])[1]
        spring = edge.stiffness_n * W / (strip.bending_stiffness_n_m * factor)
        matrix = matrix + spring * np.kron(along[0, 0], slopes @ slopes.T)
    strengths = np.linalg.solve(matrix, np.outer(*sides).ravel()).reshape(28, 22)
    other = np.einsum("ij,ip,jp->p", strengths, *seen)
    other *= W**4 / (strip.bending_stiffness_n_m * factor)
    found = at(strip, load, points_m, frequency_hz, 1e-8)
    np.testing.assert_allclose(other, found, rtol=0, atol=3e-4 * np.max(np.abs(found)))


# --- laws ----------------------------------------------------------------------------------------


@pytest.mark.slow
@each_edge
@pytest.mark.parametrize("frequency_hz", [0.0, 500.0, 5000.0, 30_000.0])
def test_a_load_and_a_point_may_be_exchanged(edge: Edge, frequency_hz: float) -> None:
    places = ((0.019, 0.004), (-0.006, 0.015))
    there, back = (
        at(on(edge, 0.05), force(*a), [b], frequency_hz, 1e-8)[0] for a, b in (places, places[::-1])
    )
    assert abs(there - back) < 1e-7 * abs(there)


@each_edge
@pytest.mark.slow
def test_mirror_images_are_the_same(edge: Edge) -> None:
    values = []
    for along in (1, -1):
        for across in (1, -1):
            load = disc(x_m=along * 0.01, y_m=W / 2 + across * 0.003)
            point = (along * -0.02, W / 2 - across * 0.008)
            scene = scene_of(on(edge, 0.05), load, point, skip=False)
            values.append(displacement(scene, [2500.0], 1e-6)[0, 0, 0])
    np.testing.assert_allclose(values, values[0], rtol=1e-9)


def test_true_mirror_images_are_computed_once_and_others_are_not() -> None:
    loads = (force(-0.01), force(0.01))
    mirrored = scene_of(FINITE, loads, (-0.01, 0.01), (0.01, 0.015))
    shifted = scene_of(FINITE, loads, (-0.005, 0.01), (0.015, 0.01))
    assert [scene.work([1000.0]).pairs_solved for scene in (mirrored, shifted)] == [2, 4]


@each_edge
@pytest.mark.parametrize("frequency_hz", [5000.0, 9000.0])
def test_without_loss_the_ends_turn_all_power_back(edge: Edge, frequency_hz: float) -> None:
    """One wave propagates; were its reflection not of size 1, the force would do work."""
    value, endless = (
        at(on(edge, length_m), force(0.004), [(0.004, W / 2)], frequency_hz, 1e-9)[0]
        for length_m in (0.05, None)
    )
    assert abs(endless.imag) > 0.1 * abs(endless)
    assert abs(value.imag) < 1e-7 * abs(value)


@pytest.mark.slow
def test_a_wider_plate_of_the_same_shape_bends_alike() -> None:
    wide = dataclasses.replace(FINITE, width_m=2 * W, length_m=0.1)
    small = at(FINITE, force(0.01, 0.01), [(0.02, 0.005)], 4000.0, 1e-8)
    large = at(wide, force(0.02, 0.02), [(0.04, 0.01)], 1000.0, 1e-8)
    np.testing.assert_allclose(large, 4 * small, rtol=1e-7)


@each_edge
@pytest.mark.parametrize("frequency_hz", [800.0, 5000.0])
@pytest.mark.slow
def test_ends_bear_no_moment_and_no_shear(edge: Edge, frequency_hz: float) -> None:
    """From differences over 4 mm: 12 places along x from the end, 7 across."""
    nu, y0_m, n = 0.346, 0.011, 12
    x, y = -0.5e-3 * np.arange(n), 0.5e-3 * np.arange(-3, 4)
    points_m = tuple((0.025 + a, y0_m + b) for a in x for b in y)
    u = at(on(edge, 0.05, loss=0.01), force(0.005, 0.008), points_m, frequency_hz, 1e-11)
    polyfit = np.polynomial.polynomial.polyfit
    across = polyfit(y / W, u.reshape(n, 7).T, 6)
    terms = [polyfit(x / W, across[j], n - 1) for j in (0, 2)]
    bent = [2 * terms[0][2], 2 * terms[1][0]]
    sheared = [6 * terms[0][3], 2 * terms[1][1]]
    assert abs(bent[0] + nu * bent[1]) < 1e-4 * abs(bent[1])
    assert abs(sheared[0] + (2 - nu) * sheared[1]) < 1e-3 * max(abs(a) for a in sheared)


@pytest.mark.slow
@each_edge
def test_the_plate_equation_holds_up_to_the_end(edge: Edge) -> None:
    strip, frequency_hz = on(edge, 0.05, loss=0.01), 5000.0
    steps = 4e-4 * np.arange(-4, 5)
    points_m = tuple((0.0233 + a, 0.012 + b) for a in steps for b in steps)
    u = at(strip, force(-0.01, 0.012), points_m, frequency_hz, 1e-11).reshape(9, 9)
    powers = np.vander(steps / W, increasing=True).T
    fourth, second = (
        np.linalg.solve(powers, weight * np.eye(9)[n]) for n, weight in ((4, 24), (2, 2))
    )
    parts = [fourth @ u[:, 4], 2 * second @ u @ second, u[4] @ fourth]
    residual = sum(parts) - bending(strip, frequency_hz) * u[4, 4]
    assert abs(residual) < 1e-4 * max(abs(part) for part in parts)


# --- limits --------------------------------------------------------------------------------------


@each_edge
def test_an_end_far_away_is_not_felt(edge: Edge) -> None:
    near, far, endless = (
        displacement(scene_of(on(edge, m), SMALL, (0.01, 0.01), skip=False), [100.0, 1500.0], 1e-9)
        for m in (0.4, 1.0, None)
    )
    np.testing.assert_allclose(near, endless, rtol=1e-8)
    np.testing.assert_allclose(far, endless, rtol=1e-8)


@pytest.mark.slow
@each_edge
def test_every_length_is_computed_without_nan_or_warning(edge: Edge) -> None:
    for length_m in (0.01, 0.05, 0.3, 2.0, 10.0):
        end_m = length_m / 2
        points_m = ((0.0, 0.02), (end_m, 0.01), (-end_m, 0.0))
        for loss in (0.0, 0.5):
            scene = scene_of(on(edge, length_m, loss=loss), force(0.3 * end_m, 0.01), *points_m)
            u = displacement(scene, [0.0, 300.0, 6000.0, 50_000.0], 1e-4)[:, 0]
            assert np.all(np.isfinite(u))
            assert np.all(np.abs(u[:, 2]) <= 1e-4 * np.max(np.abs(u), axis=1))


@pytest.mark.slow
def test_springs_reach_both_ideal_edges() -> None:
    load, points_m = force(0.01, 0.01), ((0.025, 0.012), (-0.02, 0.02))
    for stiffness_n, edge in ((1e-9, SIMPLY_SUPPORTED), (1e14, CLAMPED)):
        spring, ideal = (
            at(on(one, 0.05), load, points_m, 3000.0, 1e-8)
            for one in (ElasticEdge(stiffness_n=stiffness_n), edge)
        )
        np.testing.assert_allclose(spring, ideal, rtol=1e-7)


@pytest.mark.slow
def test_a_resonance_without_loss_is_large_but_finite() -> None:
    scene = scene_of(FINITE, force(), (0.0, W / 2))
    found = displacement(scene, np.linspace(4400.0, 7000.0, 27), 1e-6)[:, 0, 0]
    assert np.any((found.real[1:] > 0) != (found.real[:-1] > 0))
    assert np.all(np.isfinite(found))


@pytest.mark.slow
@pytest.mark.parametrize("edge", [FIRM, CLAMPED], ids=["elastic", "clamped"])
@pytest.mark.parametrize("detuning", [1e-12, 1e-9, 1e-6, 1e-4])
def test_an_exceptional_point_does_not_show(edge: Edge, detuning: float) -> None:
    """The field is analytic there: its value is its mean over a circle of frequencies."""
    scene = scene_of(on(edge, 0.06), force(0.01, 0.01), (0.02, 0.015), (0.03, W / 2))
    frequency_hz = scene.strip.exceptional_point_hz() * (1 + detuning)
    around = frequency_hz * (1 + 0.02 * np.exp(2j * np.pi * (np.arange(16) + 0.5) / 16))
    mean = solve(scene, np.where(around.imag < 0, np.conj(around), around), 1e-9).value
    mean = np.where((around.imag < 0)[:, np.newaxis, np.newaxis], np.conj(mean), mean).mean(axis=0)
    value = solve(scene, np.array([frequency_hz + 0j]), 1e-9).value[0]
    np.testing.assert_allclose(value, mean, rtol=1e-7)


# --- frequencies ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("length_m", [0.002, 0.01, 0.03])
@pytest.mark.parametrize("nu", [0.0, 0.346, 0.499])
def test_no_finite_strip_resonates_below_the_bound_of_its_sweep(length_m: float, nu: float) -> None:
    """The sign of the response at the load turns at a resonance; it must not, up to the bound."""
    strip = on(FIRM, length_m, nu=nu)
    bound_hz = strip.cutoff_hz() * math.sqrt(1 - nu**2)
    scene = scene_of(strip, force(0.2 * length_m), (0.2 * length_m, W / 2), skip=False)
    found = displacement(scene, bound_hz * np.array([0.05, 0.5, 0.9, 0.98]), 1e-4)[:, 0, 0].real
    assert np.all(found > 0)
    assert np.all(np.diff(found) > 0)


@pytest.mark.slow
@each_edge
def test_a_sweep_agrees_with_each_frequency_by_itself(edge: Edge) -> None:
    strip = on(edge, 0.012, nu=0.499)
    scene = scene_of(strip, force(0.001), (-0.003, W / 2), (0.006, 0.008))
    top_hz = 0.9 * math.sqrt(1 - 0.499**2) * strip.cutoff_hz()
    sweep_hz, some = np.linspace(0.2 * top_hz, top_hz * 0.999, 60), [3, 31, 59]
    assert scene.work(sweep_hz, 1e-6).frequencies_solved < 40
    alone = solve(scene, sweep_hz[some].astype(np.complex128), 1e-8).value
    np.testing.assert_allclose(displacement(scene, sweep_hz, 1e-6)[some], alone, rtol=1e-6)


@pytest.mark.slow
def test_complex_frequencies_continue_the_real_ones() -> None:
    scene = scene_of(on(FIRM, 0.05, loss=0.01), force(0.01), (-0.02, 0.01))
    circle = 5.0 * np.exp(2j * np.pi * (np.arange(12) + 0.5) / 12)
    mean = solve(scene, 4000 + 30j + circle, 1e-9).value.mean(axis=0)
    middle = solve(scene, np.array([4000 + 30j]), 1e-9).value
    np.testing.assert_allclose(mean, middle[0], rtol=1e-7)


# --- what is left out ----------------------------------------------------------------------------


@pytest.mark.slow
@each_edge
@pytest.mark.parametrize("rtol", [1e-2, 1e-4, 1e-7])
def test_skipping_changes_the_counts_and_no_result(edge: Edge, rtol: float) -> None:
    points_m = ((-0.035, W / 2), (0.035, W / 2), (0.0, 0.004))
    quick = scene_of(on(edge, 0.35), DISCS, *points_m)
    careful, sweep_hz = dataclasses.replace(quick, skip=False), np.linspace(100.0, 1500.0, 24)
    full, some = (response(scene, sweep_hz, rtol) for scene in (careful, quick))
    assert full.work.skipped == ()
    assert full.work.reflections_asked == full.work.reflections_solved == 24 * 6
    assert some.work.reflections_solved < some.work.reflections_asked
    assert "reflections: the ends are too far to be felt" in " / ".join(some.work.skipped)
    assert within(some.displacement_m, full.displacement_m, rtol, axis=(1, 2))


@each_edge
def test_both_sides_of_the_border_of_skipping_agree(edge: Edge) -> None:
    rtol, load, point_m = 1e-5, force(), (0.004, 0.01)
    short_m, long_m = 0.02, 0.5
    for _ in range(30):
        middle_m = math.sqrt(short_m * long_m)
        if scene_of(on(edge, middle_m), load, point_m).work([500.0], rtol).reflections_solved:
            short_m = middle_m
        else:
            long_m = middle_m
    near, far = (at(on(edge, m), load, [point_m], 500.0, rtol)[0] for m in (short_m, long_m))
    assert abs(near - far) < rtol * abs(far)


@pytest.mark.slow
def test_the_estimate_covers_the_error() -> None:
    """On a fixed random sample, loads at least 2.5 mm from the ends."""
    rng = np.random.default_rng(5)
    covered, close = [], []
    for _ in range(30):
        edge = EDGES[::-1][rng.integers(3)]
        length_m = float(10 ** rng.uniform(-1.8, -0.5))
        strip = on(edge, length_m, loss=float(rng.choice([0.0, 0.02])))
        x_m = float(rng.uniform(-1, 1)) * max(length_m / 2 - 0.0025, 0.0)
        load = force(x_m, float(rng.uniform(0.2, 0.8)) * W)
        points_m = ((length_m / 2, 0.009), (float(rng.uniform(-0.5, 0.5)) * length_m, 0.016))
        frequency_hz = [float(10 ** rng.uniform(2, 4.3))]
        rtol = float(10 ** rng.uniform(-6, -2))
        scene = scene_of(strip, load, *points_m)
        rough, fine = (response(scene, frequency_hz, r) for r in (rtol, 1e-10))
        error_m = np.abs(rough.displacement_m - fine.displacement_m)
        covered += list((error_m <= rough.error_m).ravel())
        close.append(within(rough.displacement_m, fine.displacement_m, rtol))
    assert np.mean(covered) >= 0.95
    assert np.mean(close) >= 0.95
