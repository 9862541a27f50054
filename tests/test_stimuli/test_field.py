"""The field: published values, the plate's own laws, two methods, limits and refusals."""

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

if TYPE_CHECKING:
    from numpy.typing import NDArray

W = 0.025
PLATE = Strip(width_m=W, thickness_m=0.0005, material=ALUMINIUM, edge=SIMPLY_SUPPORTED)
SOFT, FIRM = ElasticEdge(stiffness_n=63.9264884979218), ElasticEdge(stiffness_n=141.72083994908)
EDGES: list[IdealEdge | ElasticEdge] = [SIMPLY_SUPPORTED, SOFT, FIRM, CLAMPED]
MIDDLE = PointForce(x_m=0.0, y_m=W / 2)

laws = settings(deadline=None, max_examples=20)
edges = st.sampled_from(EDGES)
across = st.floats(0.02 * W, 0.98 * W)
frequencies = st.one_of(st.just(0.0), st.floats(1.0, 40_000.0))
losses = st.sampled_from([0.0, 0.01, 0.5])


def on(edge: IdealEdge | ElasticEdge, loss: float = 0.0, viscous_time_s: float = 0.0) -> Strip:
    material = dataclasses.replace(ALUMINIUM, loss_factor=loss, viscous_time_s=viscous_time_s)
    return dataclasses.replace(PLATE, edge=edge, material=material)


def at(
    strip: Strip, load: Load, x_m: float, y_m: float, frequency_hz: float, rtol: float = 1e-10
) -> complex:
    scene = Scene(strip=strip, loads=(load,), points_m=((x_m, y_m),))
    return complex(displacement(scene, [frequency_hz], rtol)[0, 0, 0])


def wavenumber(strip: Strip, frequency_hz: float) -> complex:
    inertia = strip.material.density_kg_m3 * strip.thickness_m / strip.bending_stiffness_n_m
    square = 2 * math.pi * frequency_hz * math.sqrt(inertia)
    return complex((square**2 / strip.material.stiffness_factor(frequency_hz)) ** 0.25)


# --- known values --------------------------------------------------------------------------------

THIRD = W / 3
KNOWN: list[tuple[IdealEdge | ElasticEdge, Load, float, float, float, complex]] = [
    # contour integrals checked by modal sums, 11 to 16 digits
    (SIMPLY_SUPPORTED, MIDDLE, 0.02, THIRD, 500, 3.41839995062261560e-6),
    (SIMPLY_SUPPORTED, MIDDLE, 0.0, W / 2, 300, 0.0000135672670270450974),
    (SIMPLY_SUPPORTED, MIDDLE, 0.07, W / 2, 1800, 5.60353703258938617e-6),
    (
        SIMPLY_SUPPORTED,
        MIDDLE,
        0.02,
        THIRD,
        3000,
        -9.10503431765439757e-6 - 2.85083830546442905e-6j,
    ),
    (CLAMPED, MIDDLE, 0.02, THIRD, 500, 2.45835029540878191e-7),
    (FIRM, MIDDLE, 0.02, W / 2, 500, 1.27498980958965968e-6),
    (CLAMPED, MIDDLE, 0.07, W / 2, 300, 3.70695978412616636e-11),
    (
        SIMPLY_SUPPORTED,
        MomentRectangle(x_m=0.0, y_m=W / 2, length_x_m=0.006, length_y_m=0.018),
        0.0,
        W / 2,
        700,
        -0.0000299428005129164796,
    ),
    (
        FIRM,
        MomentRectangle(x_m=0.0, y_m=W / 2, length_x_m=0.006, length_y_m=0.018),
        0.0,
        W / 2,
        700,
        -0.0000204732244928532289,
    ),
    (
        CLAMPED,
        MomentRectangle(x_m=0.0, y_m=W / 2, length_x_m=0.006, length_y_m=0.018),
        0.02,
        THIRD,
        700,
        5.27460321776807840e-7,
    ),
    (
        SOFT,
        MomentRectangle(x_m=0.0, y_m=W / 2, length_x_m=0.010, length_y_m=0.003),
        0.02,
        W / 2,
        700,
        -4.96422864218509787e-7,
    ),
    (
        CLAMPED,
        PressureRectangle(x_m=0.0, y_m=W / 2, length_x_m=0.010, length_y_m=0.010),
        0.0,
        W / 2,
        90,
        4.32387582593649594e-10,
    ),
    (
        SIMPLY_SUPPORTED,
        MomentDisc(x_m=0.0, y_m=W / 2, radius_m=0.0064),
        0.0,
        W / 2,
        300,
        -0.0000368781929448345153,
    ),
    (
        CLAMPED,
        MomentDisc(x_m=0.0, y_m=W / 2, radius_m=0.0064),
        0.02,
        W / 2,
        300,
        4.87718756360166021e-7,
    ),
    (
        FIRM,
        PressureDisc(x_m=0.0, y_m=W / 2, radius_m=0.0064),
        0.015,
        THIRD,
        1000,
        2.85123274538040810e-10,
    ),
    (
        FIRM,
        MomentDisc(x_m=0.0, y_m=W / 2, radius_m=0.010),
        0.07,
        W / 2,
        500,
        1.90256815636891394e-9,
    ),
]


@pytest.mark.parametrize(("edge", "load", "x_m", "y_m", "frequency_hz", "known_m"), KNOWN)
@pytest.mark.parametrize("skip", [True, False])
def test_the_papers_plate_has_its_known_displacements(
    edge: IdealEdge | ElasticEdge,
    load: Load,
    x_m: float,
    y_m: float,
    frequency_hz: float,
    known_m: complex,
    *,
    skip: bool,
) -> None:
    scene = Scene(strip=on(edge), loads=(load,), points_m=((x_m, y_m),), skip=skip)
    for rtol in (1e-3, 1e-6, 1e-10):
        result = displacement(scene, [float(frequency_hz)], rtol)[0, 0, 0]
        assert abs(result - known_m) < rtol * abs(known_m)


def test_one_centimetre_beyond_the_rim_of_the_papers_disc_20_db_are_gone() -> None:
    # Paper, section V: 1 cm is enough for the 20 dB of masking. It is from the rim, not the centre.
    disc = MomentDisc(x_m=0.0, y_m=W / 2, radius_m=0.0064)
    points = ((0.0, W / 2), (0.010, W / 2), (0.0164, W / 2))
    scene = Scene(strip=PLATE.with_cutoff(2900.0), loads=(disc,), points_m=points)
    centre, from_centre, from_rim = np.abs(displacement(scene, [500.0])[0, 0])
    assert 20 * math.log10(from_rim / centre) < -20 < 20 * math.log10(from_centre / centre)


@pytest.mark.parametrize(("edge", "divisor"), [(SIMPLY_SUPPORTED, 384 / 5), (CLAMPED, 384.0)])
def test_a_long_pressure_at_rest_bends_the_strip_like_a_beam(
    edge: IdealEdge, divisor: float
) -> None:
    load = PressureRectangle(x_m=0.0, y_m=W / 2, length_x_m=2.0, length_y_m=W)
    beam_m = W**4 / (divisor * PLATE.bending_stiffness_n_m)
    assert at(on(edge), load, 0.1, W / 2, 0.0) == pytest.approx(beam_m, rel=1e-10)


# --- laws of the plate ---------------------------------------------------------------------------


@laws
@given(edge=edges, y0=across, y=across, x=st.floats(0, 3 * W), f=frequencies, loss=losses)
def test_a_force_and_a_point_may_be_exchanged(
    edge: IdealEdge | ElasticEdge, y0: float, y: float, x: float, f: float, loss: float
) -> None:
    strip = on(edge, loss)
    there = at(strip, PointForce(x_m=0.0, y_m=y0), x, y, f)
    back = at(strip, PointForce(x_m=x, y_m=y), 0.0, y0, f)
    own = at(strip, PointForce(x_m=0.0, y_m=y0), 0.0, y0, f)
    assert abs(there - back) < 1e-10 * max(abs(there), 1e-3 * abs(own))


@laws
@given(edge=edges, y0=across, y=across, x=st.floats(0, 3 * W), f=frequencies, loss=losses)
def test_the_field_is_the_same_to_the_left_and_mirrored_about_the_centre_line(
    edge: IdealEdge | ElasticEdge, y0: float, y: float, x: float, f: float, loss: float
) -> None:
    load = PressureRectangle(x_m=0.0, y_m=y0, length_x_m=0.01, length_y_m=1.9 * min(y0, W - y0))
    mirror = dataclasses.replace(load, y_m=W - y0)
    strip = on(edge, loss)
    scene = Scene(strip=strip, loads=(load, mirror), points_m=((x, y), (-x, y), (x, W - y)))
    u = displacement(scene, [f], 1e-10)[0]
    assert u[0, 0] == u[0, 1]
    largest = np.max(np.abs(u))
    assert abs(u[0, 0] - u[1, 2]) < 1e-10 * max(abs(u[0, 0]), 1e-3 * largest)
    assert abs(u[1, 0] - u[0, 2]) < 1e-10 * max(abs(u[1, 0]), 1e-3 * largest)


@laws
@given(
    edge=st.sampled_from([SIMPLY_SUPPORTED, CLAMPED]),
    factor=st.floats(0.01, 100.0),
    thinner=st.floats(0.1, 10.0),
    y=across,
    f=frequencies,
)
def test_rescaled_strips_have_the_same_dimensionless_field(
    edge: IdealEdge, factor: float, thinner: float, y: float, f: float
) -> None:
    strip = on(edge, 0.01)
    other = dataclasses.replace(strip, width_m=factor * W, thickness_m=thinner * strip.thickness_m)
    field = at(strip, MIDDLE, W, y, f) * strip.bending_stiffness_n_m / W**2
    same_hz = f * other.cutoff_hz() / strip.cutoff_hz()
    load = PointForce(x_m=0.0, y_m=factor * W / 2)
    scaled = at(other, load, factor * W, factor * y, same_hz)
    scaled *= other.bending_stiffness_n_m / (factor * W) ** 2
    assert abs(scaled - field) < 1e-9 * max(abs(field), 1e-6)


@pytest.mark.parametrize("edge", EDGES, ids=str)
def test_the_field_at_rest_is_the_limit_of_slow_vibration(edge: IdealEdge | ElasticEdge) -> None:
    scene = Scene(strip=on(edge), loads=(MIDDLE,), points_m=((0.0, W / 2), (0.01, 0.01)))
    u = displacement(scene, [0.0, 1e-9, 1e-3, 0.03, 20.0, 60.0], 1e-11)[:, 0]
    np.testing.assert_allclose(u[:4], u[:1].repeat(4, axis=0), rtol=1e-9)
    # the first correction is proportional to f^2
    np.testing.assert_allclose((u[5] - u[0]) / (u[4] - u[0]), 9.0, rtol=0.05)
    assert np.all(np.abs(u.imag) < 1e-11 * np.abs(u))


@pytest.mark.parametrize("f", [0.0, 500.0, 3000.0, 20_000.0])
def test_springs_reach_both_ideal_edges(f: float) -> None:
    load = MomentRectangle(x_m=0.0, y_m=0.01, length_x_m=0.006, length_y_m=0.012)
    for x_m in (0.0, 0.05):
        ends = [at(on(edge, 0.01), load, x_m, 0.009, f) for edge in (SIMPLY_SUPPORTED, CLAMPED)]
        stiffnesses_n = [(1e-3, 1e-6, 1e-9), (1e8, 1e11, 1e14)]
        for end, three in zip(ends, stiffnesses_n, strict=True):
            errors = [
                abs(at(on(ElasticEdge(stiffness_n=K), 0.01), load, x_m, 0.009, f) / end - 1)
                for K in three
            ]
            assert errors[0] < 1e-3
            assert errors[1] < 2e-3 * errors[0]
            assert errors[2] < 1e-9


@pytest.mark.parametrize(
    ("edge", "f"), [(SIMPLY_SUPPORTED, 3000.0), (FIRM, 4100.0), (CLAMPED, 6000.0)]
)
def test_above_cutoff_the_input_power_is_carried_away(
    edge: IdealEdge | ElasticEdge, f: float
) -> None:
    strip = on(edge)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    y = W * (nodes + 1) / 2
    far_m, step_m, step_hz = 0.5, 1e-3, 2.0
    points = [(0.0, W / 2), (far_m, W / 2), (far_m + step_m, W / 2)]
    scene = Scene(strip=strip, loads=(MIDDLE,), points_m=(*points, *((far_m, v) for v in y)))
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
    ("edge", "frequency_hz"),
    [(SIMPLY_SUPPORTED, 9000.0), (SOFT, 700.0), (FIRM, 12_000.0), (CLAMPED, 0.0)],
)
@pytest.mark.parametrize(
    ("load", "pressure_pa"),
    [
        (PressureDisc(x_m=0.0, y_m=W / 2, radius_m=0.009), 1.0),
        (PressureRectangle(x_m=0.0, y_m=0.011, length_x_m=0.02, length_y_m=0.018), 1.0),
        (MomentDisc(x_m=0.0, y_m=W / 2, radius_m=0.009), 0.0),
        (MomentRectangle(x_m=0.0, y_m=0.011, length_x_m=0.02, length_y_m=0.018), 0.0),
        (PressureDisc(x_m=0.03, y_m=0.008, radius_m=0.002), 0.0),
    ],
)
def test_the_plate_equation_holds_inside_and_outside_the_load(
    edge: IdealEdge | ElasticEdge, frequency_hz: float, load: Load, pressure_pa: float
) -> None:
    strip, step_m, (x_m, y_m) = on(edge, 0.02), 0.0006, (0.001, 0.0115)
    shifts = step_m * np.arange(-4, 5)
    points = tuple((x_m + a, y_m + b) for a in shifts for b in shifts)
    scene = Scene(strip=strip, loads=(load,), points_m=points)
    u = displacement(scene, [frequency_hz], 1e-12)[0, 0].reshape(9, 9)
    lone = np.eye(9)[4]
    fourth, second = stencil(4) / step_m**4, stencil(2) / step_m**2
    bilaplacian = fourth @ u @ lone + lone @ u @ fourth + 2 * second @ u @ second
    stiffness = strip.bending_stiffness_n_m * strip.material.stiffness_factor(frequency_hz)
    inertia = wavenumber(strip, frequency_hz) ** 4 * u[4, 4]
    scale = max(1.0, abs(stiffness) * float(np.max(np.abs(u))) / W**4)
    slack_pa = 2e-4 * scale + 1e-6 * abs(stiffness * inertia)
    assert abs(stiffness * (bilaplacian - inertia) - pressure_pa) < slack_pa


@pytest.mark.parametrize("edge", EDGES, ids=str)
@pytest.mark.parametrize("frequency_hz", [0.0, 900.0, 9000.0])
def test_the_edges_neither_move_nor_turn_beyond_their_spring(
    edge: IdealEdge | ElasticEdge, frequency_hz: float
) -> None:
    strip, step_m = on(edge), 1e-4
    load = MomentDisc(x_m=0.0, y_m=0.015, radius_m=0.006)
    points = tuple((0.002, step_m * n) for n in range(8))
    u = displacement(Scene(strip=strip, loads=(load,), points_m=points), [frequency_hz], 1e-12)
    series = np.polynomial.polynomial.polyfit(np.arange(8), u[0, 0].real / abs(u[0, 0, 7]), 7)
    slope, curvature = series[1], 2 * series[2]
    assert abs(series[0]) < 1e-9
    if edge is CLAMPED:
        assert abs(slope) < 1e-5
    else:
        stiffness_n = edge.stiffness_n if isinstance(edge, ElasticEdge) else 0.0
        hold = stiffness_n * step_m / strip.bending_stiffness_n_m
        assert curvature == pytest.approx(hold * slope, abs=1e-5)


# --- second methods ------------------------------------------------------------------------------


@pytest.mark.parametrize("frequency_hz", [200.0, 1000.0, 1900.0, 2500.0, 30_000.0])
@pytest.mark.parametrize("loss", [0.0, 0.1])
def test_the_series_of_supported_strips_gives_the_same(frequency_hz: float, loss: float) -> None:
    strip, y0, y, x = on(SIMPLY_SUPPORTED, loss), 0.008, 0.014, 0.004
    k = wavenumber(strip, frequency_hz)
    q = np.pi / W * np.arange(1, 81)
    a, b = np.sqrt(q**2 - k**2 + 0j), np.sqrt(q**2 + k**2 + 0j)
    a = np.where(a.imag > 0, -a, a)  # outgoing
    terms = np.sin(q * y) * np.sin(q * y0) * (np.exp(-a * x) / a - np.exp(-b * x) / b)
    stiffness = strip.bending_stiffness_n_m * strip.material.stiffness_factor(frequency_hz)
    series = terms.sum() / (2 * k**2 * W * stiffness)
    u = at(strip, PointForce(x_m=0.0, y_m=y0), x, y, frequency_hz)
    assert abs(u - series) < 1e-10 * abs(series)


def polynomial_field(
    strip: Strip,
    spring_per_m: float | None,
    frequency_hz: float,
    places: tuple[float, float, float],
) -> complex:
    """Displacement under a point force as a sum over all waves of a polynomial model.

    Nothing of it is shared with the closed forms: Legendre polynomials across the strip, a
    quadratic eigenproblem for p^2, and the residue of each eigenvector.
    """
    x, y0, y = places
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
    companion = np.block([[0 * unit, unit], [k4 * unit - bend, -2 * slope]])
    z, vectors = np.linalg.eig(companion)
    p = np.sqrt(z)
    p = np.where((p.imag < 0) | ((p.imag == 0) & (p.real < 0)), -p, p)
    vectors = vectors[: len(shapes)]
    norms = 4 * p * (z * (vectors * vectors).sum(0) + (vectors * (slope @ vectors)).sum(0))
    here, there = (
        (root @ np.array([v(place / half - 1) for v in shapes])) @ vectors for place in (y0, y)
    )
    stiffness = strip.bending_stiffness_n_m * strip.material.stiffness_factor(frequency_hz)
    return complex((1j * here * there * np.exp(1j * p * x) / norms).sum() / stiffness)


@pytest.mark.parametrize("edge", [SOFT, FIRM, CLAMPED], ids=str)
@pytest.mark.parametrize("frequency_hz", [300.0, 1500.0, 2700.0, 4000.0, 10_000.0, 25_000.0])
def test_a_polynomial_model_gives_the_same(
    edge: IdealEdge | ElasticEdge, frequency_hz: float
) -> None:
    strip, spring = on(edge, 0.01), None
    if isinstance(edge, ElasticEdge):
        strip = dataclasses.replace(strip, edge=dataclasses.replace(edge, lossless=False))
        spring = edge.stiffness_n / strip.bending_stiffness_n_m
    places = (0.02, 0.008, 0.014)
    u = at(strip, PointForce(x_m=0.0, y_m=0.008), 0.02, 0.014, frequency_hz)
    model = polynomial_field(strip, spring, frequency_hz, places)
    assert abs(u - model) < 2e-8 * abs(u)


@pytest.mark.parametrize(
    ("edge", "frequency_hz"),
    [(SIMPLY_SUPPORTED, 800.0), (SOFT, 15_000.0), (FIRM, 800.0), (CLAMPED, 15_000.0)],
)
def test_a_pressed_disc_is_the_sum_of_point_forces(
    edge: IdealEdge | ElasticEdge, frequency_hz: float
) -> None:
    radius_m, strip = 0.005, on(edge, 0.01)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    r, turns = radius_m * (nodes + 1) / 2, 2 * np.pi * np.arange(16) / 16
    forces = tuple(
        PointForce(x_m=a * np.cos(t), y_m=0.011 + a * np.sin(t)) for a in r for t in turns
    )
    points = ((0.012, 0.015), (0.002, 0.021))
    u = displacement(Scene(strip=strip, loads=forces, points_m=points), [frequency_hz], 1e-8)[0]
    area = np.repeat(radius_m / 2 * weights * r * 2 * np.pi / 16, 16)
    disc = PressureDisc(x_m=0.0, y_m=0.011, radius_m=radius_m)
    whole = displacement(Scene(strip=strip, loads=(disc,), points_m=points), [frequency_hz], 1e-10)
    np.testing.assert_allclose(area @ u, whole[0, 0], rtol=1e-5)


@pytest.mark.parametrize("frequency_hz", [0.0, 800.0, 15_000.0])
def test_patches_add_up(frequency_hz: float) -> None:
    strip, points = on(FIRM), ((0.0, 0.011), (0.004, 0.013), (0.03, 0.02))
    parts = tuple(
        MomentRectangle(x_m=x, y_m=y, length_x_m=0.004, length_y_m=0.005)
        for x in (-0.002, 0.002)
        for y in (0.01, 0.015)
    )
    whole = MomentRectangle(x_m=0.0, y_m=0.0125, length_x_m=0.008, length_y_m=0.01)
    scene = Scene(strip=strip, loads=(*parts, whole), points_m=points)
    u = displacement(scene, [frequency_hz], 1e-11)[0]
    np.testing.assert_allclose(u[:4].sum(axis=0), u[4], rtol=1e-9)


@pytest.mark.parametrize("edge", EDGES, ids=str)
def test_tiny_patches_act_like_a_point_force(edge: IdealEdge | ElasticEdge) -> None:
    size_m, place = 1e-6 * W, (0.004, 0.012)
    force = at(on(edge), PointForce(x_m=0.0, y_m=0.01), *place, 700.0)
    square = PressureRectangle(x_m=0.0, y_m=0.01, length_x_m=size_m, length_y_m=size_m)
    disc = PressureDisc(x_m=0.0, y_m=0.01, radius_m=size_m)
    motor = ForceRectangle(x_m=0.0, y_m=0.01, length_x_m=size_m, length_y_m=size_m)
    assert at(on(edge), square, *place, 700.0) / size_m**2 == pytest.approx(force, rel=1e-9)
    assert at(on(edge), disc, *place, 700.0) / (np.pi * size_m**2) == pytest.approx(force, rel=1e-9)
    assert at(on(edge), motor, *place, 700.0) == pytest.approx(force, rel=1e-9)


# --- difficult places ----------------------------------------------------------------------------


@pytest.mark.parametrize("x_m", [0.0, 0.01, 0.07, 1.0])
def test_an_exceptional_point_leaves_no_trace(x_m: float) -> None:
    exceptional_hz = 3618.11524962338517
    reach = min(0.05, 0.005 / (x_m + 0.05))
    nodes = np.cos(np.pi * (np.arange(24) + 0.5) / 24)
    detuning = np.array([0.0, *(s * 10.0**-n for n in range(3, 16) for s in (1, -1))])
    strip = on(CLAMPED)
    scene = Scene(strip=strip, loads=(MIDDLE,), points_m=((x_m, 0.009),))
    around = displacement(scene, exceptional_hz * np.sqrt(1 + reach * nodes), 1e-12)[:, 0, 0]
    series = np.polynomial.chebyshev.chebfit(nodes, around.real, 23)
    smooth = np.polynomial.chebyshev.chebval(((1 + detuning) ** 2 - 1) / reach, series)
    u = displacement(scene, exceptional_hz * (1 + detuning), 1e-11)[:, 0, 0]
    np.testing.assert_allclose(u, smooth, rtol=1e-10)


@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, FIRM, CLAMPED], ids=str)
def test_towards_a_cutoff_the_field_grows_as_the_root_of_the_detuning(
    edge: IdealEdge | ElasticEdge,
) -> None:
    strip = on(edge)
    detuning = 10.0 ** -np.arange(6, 11)
    scene = Scene(strip=strip, loads=(MIDDLE,), points_m=((0.0, W / 2),))
    for side in (1, -1):
        u = displacement(scene, strip.cutoff_hz() * (1 + side * detuning), 1e-8)[:, 0, 0]
        np.testing.assert_allclose(np.abs(u[1:] / u[:-1]), math.sqrt(10), rtol=0.01)


@pytest.mark.skipif(float(np.finfo(np.longdouble).eps) > 1e-18, reason="needs a true long double")
@pytest.mark.parametrize("detuning", [1e-9, -1e-9, 1e-12, -1e-12])
def test_beside_a_cutoff_the_leading_wave_keeps_the_digits_of_the_inputs(detuning: float) -> None:
    frequency_hz = PLATE.cutoff_hz() * (1 + detuning)
    p = PLATE.wavenumbers_rad_m(frequency_hz, n_modes=2)
    nearest = p[np.argmin(np.abs(p))]  # from rational arithmetic
    k = wavenumber(PLATE, frequency_hz)
    leading = 1j / (2 * k**2 * nearest * W * PLATE.bending_stiffness_n_m)
    others = at(PLATE, MIDDLE, 0.0, W / 2, frequency_hz) - leading
    assert abs(others) < (3e-6 if abs(detuning) < 1e-10 else 3e-5) * abs(leading)


@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, FIRM, CLAMPED], ids=str)
@pytest.mark.parametrize("mode", [1, 2, 3])
def test_a_cutoff_without_loss_is_refused_and_one_with_loss_is_not(
    edge: IdealEdge | ElasticEdge, mode: int
) -> None:
    load = PointForce(x_m=0.0, y_m=0.004)
    cutoff_hz = on(edge).cutoff_hz(mode)
    for strip, fits in ((on(edge), False), (on(edge, 1e-9), True)):
        scene = Scene(strip=strip, loads=(load,), points_m=((0.0, 0.01),))
        if fits:
            assert np.all(np.isfinite(displacement(scene, [500.0, cutoff_hz])))
        else:
            with pytest.raises(ValueError, match=rf"cut-off of mode {mode}, got"):
                displacement(scene, [500.0, cutoff_hz])


def test_a_cutoff_of_waves_that_are_not_driven_is_no_obstacle() -> None:
    assert abs(at(PLATE, MIDDLE, 0.0, W / 2, PLATE.cutoff_hz(2))) > 0


@pytest.mark.slow
@pytest.mark.parametrize("loss", [0.0, 0.01, 0.5])
@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, FIRM, CLAMPED], ids=str)
def test_no_place_load_or_frequency_gives_anything_but_numbers(
    edge: IdealEdge | ElasticEdge, loss: float
) -> None:
    strip = on(edge, loss)
    loads = (
        PointForce(x_m=0.0, y_m=0.0),
        PressureDisc(x_m=0.0, y_m=W / 2, radius_m=W / 2),
        MomentDisc(x_m=0.0, y_m=0.01, radius_m=1e-6 * W),
        MomentRectangle(x_m=0.0, y_m=W / 2, length_x_m=0.006, length_y_m=W),
        PressureRectangle(x_m=0.0, y_m=0.01, length_x_m=2.0, length_y_m=1e-6 * W),
    )
    points = tuple((x, y) for x in (0.0, 1e-9, 0.003, 0.07, 10.0) for y in (0.0, 0.01, W / 2, W))
    detuned_hz = strip.cutoff_hz() * (1 + np.array([-1e-6, -1e-12, 1e-12, 1e-6]))
    frequencies_hz = [0.0, 1e-6, 1.0, 500.0, *detuned_hz, 1e4, 1e5]
    result = response(Scene(strip=strip, loads=loads, points_m=points), frequencies_hz, 1e-6)
    assert np.all(np.isfinite(result.displacement_m))
    assert np.all(np.isfinite(result.error_m))
    on_edge = result.displacement_m[:, :, [n for n, (_, y) in enumerate(points) if y in (0, W)]]
    assert np.max(np.abs(on_edge)) < 1e-6 * np.max(np.abs(result.displacement_m))


def test_waves_with_loss_die_out_without_leaving_the_range_of_numbers() -> None:
    u = at(on(CLAMPED, 0.01), MIDDLE, 10.0, W / 2, 500.0)
    assert u == 0
    assert abs(at(on(CLAMPED, 0.001), MIDDLE, 10.0, W / 2, 6000.0)) > 0


# --- loss ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("edge", EDGES, ids=str)
def test_viscous_loss_is_hysteretic_loss_at_one_frequency(edge: IdealEdge | ElasticEdge) -> None:
    tau_s = 0.01 / (2 * math.pi * 800.0)
    load = MomentDisc(x_m=0.0, y_m=0.01, radius_m=0.004)
    u = [at(strip, load, 0.02, 0.01, 800.0) for strip in (on(edge, 0.01), on(edge, 0.0, tau_s))]
    assert abs(u[0] - u[1]) < 1e-10 * abs(u[0])


@pytest.mark.parametrize("edge", EDGES, ids=str)
def test_sweeps_with_viscous_loss_are_what_single_frequencies_are(
    edge: IdealEdge | ElasticEdge,
) -> None:
    strip = on(edge, 0.001, 1e-6)
    scene = Scene(strip=strip, loads=(MIDDLE,), points_m=((0.0, W / 2), (0.02, 0.01)))
    sweep_hz = np.linspace(0.0, 1500.0, 80)
    work = scene.work(sweep_hz, 1e-9)
    assert work.frequencies_solved < 60
    few = [3, 40, 79]
    single = np.array([displacement(scene, [sweep_hz[n]], 1e-12)[0] for n in few])
    np.testing.assert_allclose(displacement(scene, sweep_hz, 1e-9)[few], single, rtol=1e-9)


def test_loss_takes_power_from_the_wave() -> None:
    levels = [abs(at(on(CLAMPED, loss), MIDDLE, 0.3, W / 2, 6000.0)) for loss in (0.0, 0.01, 0.1)]
    assert levels[0] > levels[1] > levels[2]
    for edge in EDGES:
        for f in (300.0, 6000.0):
            assert at(on(edge, 0.01), MIDDLE, 0.0, W / 2, f).imag > 0


# --- tolerance and error estimate ----------------------------------------------------------------


def random_case(rng: np.random.Generator) -> tuple[Scene, float]:
    edge = EDGES[rng.integers(4)]
    if rng.random() < 0.3:
        edge = ElasticEdge(stiffness_n=10.0 ** rng.uniform(-3, 6))
    strip = on(edge, float(rng.choice([0.0, 0.01, 0.5])))
    y = float(rng.choice([W / 2, rng.uniform(0.1 * W, 0.9 * W)]))
    room = float(min(y, W - y) * 10.0 ** rng.uniform(-3, 0) * 0.999)
    size_x_m = W * 10.0 ** rng.uniform(-3, 0.3)
    loads: list[Load] = [
        PointForce(x_m=0.0, y_m=y),
        PressureDisc(x_m=0.0, y_m=y, radius_m=room),
        MomentDisc(x_m=0.0, y_m=y, radius_m=room),
        PressureRectangle(x_m=0.0, y_m=y, length_x_m=size_x_m, length_y_m=2 * room),
        MomentRectangle(x_m=0.0, y_m=y, length_x_m=size_x_m, length_y_m=2 * room),
    ]
    xs = np.where(rng.random(4) < 0.3, 0.0, W * 10.0 ** rng.uniform(-3, 0.7, 4))
    points = tuple(
        (float(a), float(b)) for a, b in zip(xs, rng.uniform(0.02, 0.98, 4) * W, strict=True)
    )
    scene = Scene(strip=strip, loads=(loads[rng.integers(5)],), points_m=points)
    return scene, float(10.0 ** rng.uniform(1.5, 4.7))


@pytest.mark.slow
def test_the_error_keeps_to_the_tolerance_and_to_its_estimate() -> None:
    rng = np.random.default_rng(7)
    cases = [random_case(rng) for _ in range(100)]
    true = [response(scene, [f], 1e-12).displacement_m for scene, f in cases]
    kept, covered, wide, total, count = 0, 0, 0, 0, 0
    for rtol in (1e-2, 1e-4, 1e-6, 1e-8):
        for (scene, f), exact in zip(cases, true, strict=True):
            result = response(scene, [f], rtol)
            error = np.abs(result.displacement_m - exact)
            floor = 1e-3 * np.max(np.abs(exact))
            kept += int(np.sum(error <= rtol * np.maximum(np.abs(exact), floor)))
            # where rounding is all that is left, both values are equally wrong
            clear = error > 1e-12 * np.abs(exact)
            covered += int(np.sum(result.error_m[clear] >= error[clear]))
            wide += int(np.sum(result.error_m[clear] > 100 * error[clear]))
            total, count = total + error.size, count + int(np.sum(clear))
    assert kept == total
    assert covered >= 0.99 * count
    assert wide <= 0.02 * count


def test_the_error_falls_with_the_tolerance() -> None:
    load = MomentDisc(x_m=0.0, y_m=0.011, radius_m=0.006)
    points = ((0.0, 0.012), (0.004, 0.02), (0.02, 0.01))
    scene = Scene(strip=on(FIRM), loads=(load,), points_m=points)
    exact = displacement(scene, [1234.5, 7000.0], 1e-12)
    errors = [
        np.max(np.abs(displacement(scene, [1234.5, 7000.0], 10.0**-n) / exact - 1))
        for n in range(1, 11)
    ]
    assert all(error < 10.0**-n for n, error in enumerate(errors, start=1))
    assert errors[9] < 1e-7 * errors[0]


# --- shapes --------------------------------------------------------------------------------------


def test_results_have_the_shape_of_frequencies_loads_and_points() -> None:
    loads = (MIDDLE, PressureDisc(x_m=0.01, y_m=0.01, radius_m=0.005))
    points = ((0.0, 0.01), (0.02, 0.01), (0.03, 0.02))
    scene = Scene(strip=PLATE, loads=loads, points_m=points)
    result = response(scene, [100.0, 3000.0, 200.0, 100.0])
    assert result.displacement_m.shape == result.error_m.shape == (4, 2, 3)
    assert result.displacement_m.dtype == np.complex128
    np.testing.assert_array_equal(result.displacement_m[0], result.displacement_m[3])
    assert displacement(scene, []).shape == (0, 2, 3)


def test_the_order_of_frequencies_points_and_loads_does_not_matter() -> None:
    loads = (MIDDLE, MomentDisc(x_m=0.01, y_m=0.01, radius_m=0.005))
    points = ((0.0, 0.01), (0.02, 0.01))
    frequencies_hz = [5000.0, 200.0, 9000.0]
    scene = Scene(strip=on(CLAMPED), loads=loads, points_m=points)
    other = Scene(strip=on(CLAMPED), loads=loads[::-1], points_m=points[::-1])
    u = displacement(scene, frequencies_hz, 1e-11)
    np.testing.assert_allclose(
        displacement(other, frequencies_hz[::-1], 1e-11)[::-1, ::-1, ::-1], u, rtol=1e-10
    )
