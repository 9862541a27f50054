"""The field: published values, the plate's own laws, two methods, limits."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Legendre

from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    ForceRectangle,
    Load,
    PointForce,
    PressureDisc,
    PressureRectangle,
    Strip,
    displacement,
    response,
)
from stimuli.field.field import at_rest
from tests.test_stimuli.plates import (
    EDGES,
    FIRM,
    PLATE,
    SOFT,
    SUPPORTED,
    Edge,
    W,
    at,
    disc,
    each_edge,
    force,
    on,
    patch,
    scene_of,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

MIDDLE = force()
THIRD = W / 3
FREE, HELD = SIMPLY_SUPPORTED, CLAMPED

laws = settings(deadline=None, max_examples=20)
edges = st.sampled_from([*EDGES, SOFT])
across = st.floats(0.02 * W, 0.98 * W)
frequencies = st.one_of(st.just(0.0), st.floats(1.0, 40_000.0))
losses = st.sampled_from([0.0, 0.01, 0.5])


def wavenumber(strip: Strip, frequency_hz: float) -> complex:
    inertia = strip.material.density_kg_m3 * strip.thickness_m / strip.bending_stiffness_n_m
    square = 2 * math.pi * frequency_hz * math.sqrt(inertia)
    return complex((square**2 / strip.material.stiffness_factor(frequency_hz)) ** 0.25)


# --- known values --------------------------------------------------------------------------------

# contour integrals checked by modal sums, 11 to 16 digits: edge, load, x, y, frequency, metres
KNOWN: list[tuple[Edge, Load, float, float, float, complex]] = [
    (FREE, MIDDLE, 0.02, THIRD, 500, 3.41839995062261560e-6),
    (FREE, MIDDLE, 0.0, W / 2, 300, 0.0000135672670270450974),
    (FREE, MIDDLE, 0.07, W / 2, 1800, 5.60353703258938617e-6),
    (FREE, MIDDLE, 0.02, THIRD, 3000, -9.10503431765439757e-6 - 2.85083830546442905e-6j),
    (HELD, MIDDLE, 0.02, THIRD, 500, 2.45835029540878191e-7),
    (FIRM, MIDDLE, 0.02, W / 2, 500, 1.27498980958965968e-6),
    (HELD, MIDDLE, 0.07, W / 2, 300, 3.70695978412616636e-11),
    (FREE, patch(), 0.0, W / 2, 700, -0.0000299428005129164796),
    (FIRM, patch(), 0.0, W / 2, 700, -0.0000204732244928532289),
    (HELD, patch(), 0.02, THIRD, 700, 5.27460321776807840e-7),
    (SOFT, patch(0.010, 0.003), 0.02, W / 2, 700, -4.96422864218509787e-7),
    (HELD, patch(0.01, 0.01, kind=PressureRectangle), 0.0, W / 2, 90, 4.32387582593649594e-10),
    (FREE, disc(), 0.0, W / 2, 300, -0.0000368781929448345153),
    (HELD, disc(), 0.02, W / 2, 300, 4.87718756360166021e-7),
    (FIRM, disc(kind=PressureDisc), 0.015, THIRD, 1000, 2.85123274538040810e-10),
    (FIRM, disc(0.010), 0.07, W / 2, 500, 1.90256815636891394e-9),
]


@pytest.mark.parametrize(("edge", "load", "x_m", "y_m", "frequency_hz", "known_m"), KNOWN)
@pytest.mark.parametrize("skip", [True, False])
def test_the_papers_plate_has_its_known_displacements(
    edge: Edge,
    load: Load,
    x_m: float,
    y_m: float,
    frequency_hz: float,
    known_m: complex,
    *,
    skip: bool,
) -> None:
    scene = scene_of(on(edge), load, (x_m, y_m), skip=skip)
    for rtol in (1e-3, 1e-6, 1e-10):
        result = displacement(scene, [float(frequency_hz)], rtol)[0, 0, 0]
        assert abs(result - known_m) < rtol * abs(known_m)


@pytest.mark.parametrize(("edge", "divisor"), [(FREE, 384 / 5), (HELD, 384.0)])
def test_a_long_pressure_at_rest_bends_the_strip_like_a_beam(edge: Edge, divisor: float) -> None:
    load = patch(2.0, W, kind=PressureRectangle)
    beam_m = W**4 / (divisor * PLATE.bending_stiffness_n_m)
    assert at(on(edge), load, [(0.1, W / 2)], 0.0)[0] == pytest.approx(beam_m, rel=1e-10)


# --- laws of the plate ---------------------------------------------------------------------------


@pytest.mark.slow
@laws
@given(edge=edges, y0=across, y=across, x=st.floats(0, 3 * W), f=frequencies, loss=losses)
def test_a_force_and_a_point_may_be_exchanged(
    edge: Edge, y0: float, y: float, x: float, f: float, loss: float
) -> None:
    strip = on(edge, loss=loss)
    there, own = at(strip, force(0.0, y0), [(x, y), (0.0, y0)], f)
    back = at(strip, force(x, y), [(0.0, y0)], f)[0]
    assert abs(there - back) < 1e-10 * max(abs(there), 1e-3 * abs(own))


@pytest.mark.slow
@laws
@given(edge=edges, y0=across, y=across, x=st.floats(0, 3 * W), f=frequencies, loss=losses)
def test_the_field_is_the_same_to_the_left_and_mirrored_about_the_centre_line(
    edge: Edge, y0: float, y: float, x: float, f: float, loss: float
) -> None:
    load = patch(0.01, 1.9 * min(y0, W - y0), y_m=y0, kind=PressureRectangle)
    mirror = dataclasses.replace(load, y_m=W - y0)
    scene = scene_of(on(edge, loss=loss), (load, mirror), (x, y), (-x, y), (x, W - y))
    u = displacement(scene, [f], 1e-10)[0]
    assert u[0, 0] == u[0, 1]
    largest = np.max(np.abs(u))
    for one, other in ((u[0, 0], u[1, 2]), (u[1, 0], u[0, 2])):
        assert abs(one - other) < 1e-10 * max(abs(one), 1e-3 * largest)


@pytest.mark.parametrize("edge", [*EDGES, SOFT], ids=str)
def test_the_field_at_rest_is_the_limit_of_slow_vibration(edge: Edge) -> None:
    scene = scene_of(on(edge), MIDDLE, (0.0, W / 2), (0.01, 0.01))
    u = displacement(scene, [0.0, 1e-9, 1e-3, 0.03, 20.0, 60.0], 1e-11)[:, 0]
    np.testing.assert_allclose(u[:4], u[:1].repeat(4, axis=0), rtol=1e-9)
    # the first correction is proportional to f^2
    np.testing.assert_allclose((u[5] - u[0]) / (u[4] - u[0]), 9.0, rtol=0.05)
    assert np.all(np.abs(u.imag) < 1e-11 * np.abs(u))


@pytest.mark.slow
@pytest.mark.parametrize("f", [0.0, 500.0, 3000.0, 20_000.0])
def test_springs_reach_both_ideal_edges(f: float) -> None:
    def moved(edge: Edge) -> NDArray[np.complex128]:
        load = patch(0.006, 0.012, y_m=0.01)
        return at(on(edge, loss=0.01), load, ((0.0, 0.009), (0.05, 0.009)), f)

    for edge, stiffnesses_n in ((FREE, (1e-3, 1e-6, 1e-9)), (HELD, (1e8, 1e11, 1e14))):
        springs = np.array([moved(ElasticEdge(stiffness_n=k)) for k in stiffnesses_n])
        errors = np.abs(springs / moved(edge) - 1)
        assert np.all(errors[0] < 1e-3)
        assert np.all(errors[1] < 2e-3 * errors[0])
        assert np.all(errors[2] < 1e-9)


@pytest.mark.parametrize(("edge", "f"), [(FREE, 3000.0), (FIRM, 4100.0), (HELD, 6000.0)])
def test_above_cutoff_the_input_power_is_carried_away(edge: Edge, f: float) -> None:
    strip = on(edge)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    y = W * (nodes + 1) / 2
    far_m, step_m, step_hz = 0.5, 1e-3, 2.0
    points = [(0.0, W / 2), (far_m, W / 2), (far_m + step_m, W / 2), *((far_m, v) for v in y)]
    scene = scene_of(strip, MIDDLE, *points)
    u = displacement(scene, [f - step_hz, f, f + step_hz], 1e-12)[:, 0]
    omega = 2 * np.pi * f
    power_in = omega / 2 * u[1, 0].imag
    p = np.angle(u[:, 2] / u[:, 1]) / step_m
    group_m_s = 2 * np.pi * 2 * step_hz / (p[2] - p[0])
    areal = strip.material.density_kg_m3 * strip.thickness_m
    energy_j_m = areal * omega**2 / 2 * (np.abs(u[1, 3:]) ** 2 @ weights) * W / 2
    assert power_in == pytest.approx(2 * group_m_s * energy_j_m, rel=1e-5)


NINE_POINTS = {
    2: [-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72],
    4: [7 / 240, -2 / 5, 169 / 60, -122 / 15, 91 / 8],
}


def stencil(order: int) -> NDArray[np.float64]:
    half = np.array(NINE_POINTS[order])
    return np.concatenate([half, half[-2::-1]])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("edge", "frequency_hz"), [(FREE, 9000.0), (SOFT, 700.0), (FIRM, 12_000.0), (HELD, 0.0)]
)
@pytest.mark.parametrize(
    ("load", "pressure_pa"),
    [
        (disc(0.009, kind=PressureDisc), 1.0),
        (patch(0.02, 0.018, y_m=0.011, kind=PressureRectangle), 1.0),
        (disc(0.009), 0.0),
        (patch(0.02, 0.018, y_m=0.011), 0.0),
        (disc(0.002, x_m=0.03, y_m=0.008, kind=PressureDisc), 0.0),
    ],
)
def test_the_plate_equation_holds_inside_and_outside_the_load(
    edge: Edge, frequency_hz: float, load: Load, pressure_pa: float
) -> None:
    strip, step_m, (x_m, y_m) = on(edge, loss=0.02), 0.0006, (0.001, 0.0115)
    shifts = step_m * np.arange(-4, 5)
    points = tuple((x_m + a, y_m + b) for a in shifts for b in shifts)
    u = at(strip, load, points, frequency_hz, 1e-12).reshape(9, 9)
    lone = np.eye(9)[4]
    fourth, second = stencil(4) / step_m**4, stencil(2) / step_m**2
    bilaplacian = fourth @ u @ lone + lone @ u @ fourth + 2 * second @ u @ second
    stiffness = strip.bending_stiffness_n_m * strip.material.stiffness_factor(frequency_hz)
    inertia = wavenumber(strip, frequency_hz) ** 4 * u[4, 4]
    scale = max(1.0, abs(stiffness) * float(np.max(np.abs(u))) / W**4)
    slack_pa = 2e-4 * scale + 1e-6 * abs(stiffness * inertia)
    assert abs(stiffness * (bilaplacian - inertia) - pressure_pa) < slack_pa


@pytest.mark.parametrize("edge", [*EDGES, SOFT], ids=str)
@pytest.mark.parametrize("frequency_hz", [0.0, 900.0, 9000.0])
def test_the_edges_neither_move_nor_turn_beyond_their_spring(
    edge: Edge, frequency_hz: float
) -> None:
    strip, step_m = on(edge), 1e-4
    points = tuple((0.002, step_m * n) for n in range(8))
    u = at(strip, disc(0.006, y_m=0.015), points, frequency_hz, 1e-12)
    series = np.polynomial.polynomial.polyfit(np.arange(8), u.real / abs(u[7]), 7)
    slope, curvature = series[1], 2 * series[2]
    assert abs(series[0]) < 1e-9
    if edge is HELD:
        assert abs(slope) < 1e-5
    else:
        stiffness_n = edge.stiffness_n if isinstance(edge, ElasticEdge) else 0.0
        hold = stiffness_n * step_m / strip.bending_stiffness_n_m
        assert curvature == pytest.approx(hold * slope, abs=1e-5)


# --- second methods ------------------------------------------------------------------------------


def polynomial_field(
    strip: Strip, spring_per_m: float | None, frequency_hz: float, x: float, y0: float, y: float
) -> complex:
    """Displacement under a point force as a sum over all waves of a polynomial model.

    Nothing of it is shared with the closed forms: Legendre polynomials across the strip, a
    quadratic eigenproblem for p^2, and the residue of each eigenvector.
    """
    bubble = Legendre([2 / 3, 0, -2 / 3]) ** (2 if spring_per_m is None else 1)
    shapes = [bubble * Legendre.basis(j) for j in range(24)]
    nodes, weights = np.polynomial.legendre.leggauss(40)
    half = W / 2
    bend, slope, mass = (
        (values * weights) @ values.T * half ** (1 - 2 * order)
        for order in (2, 1, 0)
        for values in [np.array([(v.deriv(order) if order else v)(nodes) for v in shapes])]
    )
    if spring_per_m is not None:
        ends = np.array([[v.deriv()(end) / half for v in shapes] for end in (-1.0, 1.0)])
        bend = bend + spring_per_m * ends.T @ ends
    root = np.linalg.inv(np.linalg.cholesky(mass))
    bend, slope = root @ bend @ root.T, root @ slope @ root.T
    k4, unit = wavenumber(strip, frequency_hz) ** 4, np.eye(len(shapes))
    z, vectors = np.linalg.eig(np.block([[0 * unit, unit], [k4 * unit - bend, -2 * slope]]))
    p = np.sqrt(z)
    p = np.where((p.imag < 0) | ((p.imag == 0) & (p.real < 0)), -p, p)
    vectors = vectors[: len(shapes)]
    norms = 4 * p * (z * (vectors * vectors).sum(0) + (vectors * (slope @ vectors)).sum(0))
    here, there = (
        (root @ np.array([v(place / half - 1) for v in shapes])) @ vectors for place in (y0, y)
    )
    stiffness = strip.bending_stiffness_n_m * strip.material.stiffness_factor(frequency_hz)
    return complex((1j * here * there * np.exp(1j * p * x) / norms).sum() / stiffness)


@pytest.mark.parametrize("edge", [*EDGES, SOFT], ids=str)
@pytest.mark.parametrize("frequency_hz", [300.0, 1500.0, 2700.0, 4000.0, 10_000.0, 25_000.0])
def test_a_polynomial_model_gives_the_same(edge: Edge, frequency_hz: float) -> None:
    strip, spring = on(edge, loss=0.01), None if edge is HELD else 0.0
    if isinstance(edge, ElasticEdge):
        strip = dataclasses.replace(strip, edge=dataclasses.replace(edge, lossless=False))
        spring = edge.stiffness_n / strip.bending_stiffness_n_m
    u = at(strip, force(0.0, 0.008), [(0.02, 0.014)], frequency_hz)[0]
    model = polynomial_field(strip, spring, frequency_hz, 0.02, 0.008, 0.014)
    assert abs(u - model) < 2e-8 * abs(u)


@pytest.mark.parametrize("frequency_hz", [0.0, 800.0, 15_000.0])
def test_patches_add_up(frequency_hz: float) -> None:
    parts = (patch(0.004, 0.005, x_m=x, y_m=y) for x in (-0.002, 0.002) for y in (0.01, 0.015))
    loads = (*parts, patch(0.008, 0.01))
    scene = scene_of(on(FIRM), loads, (0.0, 0.011), (0.004, 0.013), (0.03, 0.02))
    u = displacement(scene, [frequency_hz], 1e-11)[0]
    np.testing.assert_allclose(u[:4].sum(axis=0), u[4], rtol=1e-9)


@pytest.mark.parametrize("edge", [*EDGES, SOFT], ids=str)
def test_tiny_patches_act_like_a_point_force(edge: Edge) -> None:
    size_m = 1e-6 * W
    loads = (
        PointForce(x_m=0.0, y_m=0.01),
        patch(size_m, size_m, y_m=0.01, kind=PressureRectangle),
        disc(size_m, y_m=0.01, kind=PressureDisc),
        patch(size_m, size_m, y_m=0.01, kind=ForceRectangle),
    )
    u = displacement(scene_of(on(edge), loads, (0.004, 0.012)), [700.0], 1e-10)[0, :, 0]
    u /= [1, size_m**2, np.pi * size_m**2, 1]
    np.testing.assert_allclose(u[1:], u[0], rtol=1e-9)


# --- difficult places ----------------------------------------------------------------------------


@pytest.mark.parametrize("x_m", [0.0, 0.01, 0.07, 1.0])
def test_an_exceptional_point_leaves_no_trace(x_m: float) -> None:
    exceptional_hz = 3618.11524962338517
    reach = min(0.05, 0.005 / (x_m + 0.05))
    nodes = np.cos(np.pi * (np.arange(24) + 0.5) / 24)
    detuning = np.array([0.0, *(s * 10.0**-n for n in range(3, 16) for s in (1, -1))])
    scene = scene_of(PLATE, MIDDLE, (x_m, 0.009))
    around = displacement(scene, exceptional_hz * np.sqrt(1 + reach * nodes), 1e-12)[:, 0, 0]
    series = np.polynomial.chebyshev.chebfit(nodes, around.real, 23)
    smooth = np.polynomial.chebyshev.chebval(((1 + detuning) ** 2 - 1) / reach, series)
    u = displacement(scene, exceptional_hz * (1 + detuning), 1e-11)[:, 0, 0]
    np.testing.assert_allclose(u, smooth, rtol=1e-10)


@pytest.mark.skipif(float(np.finfo(np.longdouble).eps) > 1e-18, reason="needs a true long double")
@pytest.mark.parametrize("detuning", [1e-9, -1e-9, 1e-12, -1e-12])
def test_beside_a_cutoff_the_leading_wave_keeps_the_digits_of_the_inputs(detuning: float) -> None:
    frequency_hz = SUPPORTED.cutoff_hz() * (1 + detuning)
    p = SUPPORTED.wavenumbers_rad_m(frequency_hz, n_modes=2)
    nearest = p[np.argmin(np.abs(p))]  # from rational arithmetic
    k = wavenumber(SUPPORTED, frequency_hz)
    leading = 1j / (2 * k**2 * nearest * W * SUPPORTED.bending_stiffness_n_m)
    others = at(SUPPORTED, MIDDLE, [(0.0, W / 2)], frequency_hz)[0] - leading
    assert abs(others) < (3e-6 if abs(detuning) < 1e-10 else 3e-5) * abs(leading)


@each_edge
@pytest.mark.parametrize("length_m", [None, 0.05])
@pytest.mark.parametrize("mode", [1, 2, 3])
def test_a_cutoff_without_loss_is_refused_and_one_with_any_loss_is_not(
    edge: Edge, length_m: float | None, mode: int
) -> None:
    cutoff_hz = on(edge).cutoff_hz(mode)
    bare, lossy = (
        scene_of(on(edge, length_m, loss=loss), force(0.0, 0.004), (0.0, 0.01))
        for loss in (0.0, 1e-12)
    )
    assert np.all(np.isfinite(displacement(lossy, [500.0, cutoff_hz])))
    with pytest.raises(ValueError, match=rf"must not hold a cut-off .* of mode {mode}, got"):
        displacement(bare, [500.0, cutoff_hz])


def test_a_cutoff_of_waves_that_are_not_driven_is_no_obstacle() -> None:
    assert abs(at(SUPPORTED, MIDDLE, [(0.0, W / 2)], SUPPORTED.cutoff_hz(2))[0]) > 0


# --- loss ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("edge", [*EDGES, SOFT], ids=str)
def test_sweeps_with_viscous_loss_are_what_single_frequencies_are(edge: Edge) -> None:
    scene = scene_of(on(edge, loss=0.001, viscous_s=1e-6), MIDDLE, (0.0, W / 2), (0.02, 0.01))
    sweep_hz = np.linspace(0.0, 1500.0, 80)
    work = scene.work(sweep_hz, 1e-9)
    assert work.frequencies_solved < 60
    few = [3, 40, 79]
    single = np.array([displacement(scene, [sweep_hz[n]], 1e-12)[0] for n in few])
    np.testing.assert_allclose(displacement(scene, sweep_hz, 1e-9)[few], single, rtol=1e-9)


def test_loss_takes_power_from_the_wave_and_leaves_the_range_of_numbers_quietly() -> None:
    far = [(0.3, W / 2), (10.0, W / 2)]
    levels = [np.abs(at(on(HELD, loss=one), MIDDLE, far, 6000.0)) for one in (0.0, 0.001, 0.1)]
    assert levels[0][0] > levels[1][0] > levels[2][0]
    assert levels[1][1] > 0
    assert at(on(HELD, loss=0.01), MIDDLE, far, 500.0)[1] == 0
    for edge in EDGES:
        for f in (300.0, 6000.0):
            assert at(on(edge, loss=0.01), MIDDLE, [(0.0, W / 2)], f)[0].imag > 0


# --- shapes --------------------------------------------------------------------------------------


def test_results_have_the_shape_and_the_order_of_frequencies_loads_and_points() -> None:
    loads, points = (
        (MIDDLE, disc(0.005, x_m=0.01, y_m=0.01)),
        ((0.0, 0.01), (0.02, 0.01), (0, 0.02)),
    )
    scene = scene_of(PLATE, loads, *points)
    result = response(scene, [5000.0, 3000.0, 200.0, 5000.0], 1e-11)
    u = result.displacement_m
    assert u.shape == result.error_m.shape == (4, 2, 3)
    assert u.dtype == np.complex128
    np.testing.assert_array_equal(u[0], u[3])
    assert displacement(scene, []).shape == (0, 2, 3)
    turned = displacement(scene_of(PLATE, loads[::-1], *points[::-1]), [200.0, 3000.0], 1e-11)
    np.testing.assert_allclose(turned[:, ::-1, ::-1], u[[2, 1]], rtol=1e-10)


@pytest.mark.parametrize("edge", [*EDGES, SOFT])
@pytest.mark.parametrize("length_m", [None, 0.15])
def test_two_low_frequencies_tell_the_static_field(edge: Edge, length_m: float | None) -> None:
    points_m = (0.0, 0.01), (0.004, 0.02), (0.06, 0.012)
    scene = scene_of(on(edge, length_m), disc(y_m=0.01), *points_m)
    exact = displacement(scene, [0.0], 1e-9)[0].real
    floor = 1e-3 * abs(exact).max()
    found = at_rest(scene, 1e-6)
    assert np.max(abs(found - exact) / np.maximum(abs(exact), floor)) < 2e-6
