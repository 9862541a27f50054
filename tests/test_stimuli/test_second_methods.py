"""Second methods for fields of a tone: polynomials, orders across, circles of frequencies."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.polynomial import Legendre, legendre

from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    PointForce,
    PressureRectangle,
    Strip,
    displacement,
)
from stimuli.field.field import solve
from tests.test_stimuli.plates import (
    FIRM,
    PLATE,
    SUPPORTED,
    Edge,
    Points,
    W,
    at,
    bending_wavenumber_rad_m,
    every_edge,
    force,
    on,
    patch,
    scene_of,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

FREE, HELD = SIMPLY_SUPPORTED, CLAMPED


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
    k4, unit = bending_wavenumber_rad_m(strip, frequency_hz) ** 4, np.eye(len(shapes))
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


@every_edge
@pytest.mark.parametrize("frequency_hz", [300.0, 1500.0, 2700.0, 4000.0, 10_000.0, 25_000.0])
def test_a_polynomial_model_gives_the_same(edge: Edge, frequency_hz: float) -> None:
    strip, spring = on(edge, loss=0.01), None if edge is HELD else 0.0
    if isinstance(edge, ElasticEdge):
        strip = dataclasses.replace(strip, edge=dataclasses.replace(edge, lossless=False))
        spring = edge.stiffness_n / strip.bending_stiffness_n_m
    u = at(strip, force(0.0, 0.008), [(0.02, 0.014)], frequency_hz)[0]
    model = polynomial_field(strip, spring, frequency_hz, 0.02, 0.008, 0.014)
    assert abs(u - model) < 2e-8 * abs(u)


def by_orders(strip: Strip, load: PointForce, points_m: Points, frequency_hz: float) -> list[float]:
    """Return what the ends add between simple supports, each order across the strip by itself."""
    assert strip.length_m is not None
    k2, nu = (
        (bending_wavenumber_rad_m(strip, frequency_hz).real * W) ** 2,
        strip.material.poisson_ratio,
    )
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
    matrix = stiffness - (bending_wavenumber_rad_m(strip, frequency_hz) * W) ** 4 * np.kron(
        along[0, 0], cross[0, 0]
    )
    if isinstance(edge, ElasticEdge):
        slopes = polynomials(22, 2.0, held, [-0.5, 0.5])[1]
        spring = edge.stiffness_n * W / (strip.bending_stiffness_n_m * factor)
        matrix = matrix + spring * np.kron(along[0, 0], slopes @ slopes.T)
    strengths = np.linalg.solve(matrix, np.outer(*sides).ravel()).reshape(28, 22)
    other = np.einsum("ij,ip,jp->p", strengths, *seen)
    other *= W**4 / (strip.bending_stiffness_n_m * factor)
    found = at(strip, load, points_m, frequency_hz, 1e-8)
    np.testing.assert_allclose(other, found, rtol=0, atol=3e-4 * np.max(np.abs(found)))


@pytest.mark.parametrize("x_m", [0.0, 0.01, 0.07, 1.0])
def test_an_exceptional_point_leaves_no_trace(x_m: float) -> None:
    exceptional_hz = 3618.11524962338517
    reach = min(0.05, 0.005 / (x_m + 0.05))
    nodes = np.cos(np.pi * (np.arange(24) + 0.5) / 24)
    detuning = np.array([0.0, *(s * 10.0**-n for n in range(3, 16) for s in (1, -1))])
    scene = scene_of(PLATE, force(), (x_m, 0.009))
    around = displacement(scene, exceptional_hz * np.sqrt(1 + reach * nodes), 1e-12)[:, 0, 0]
    series = np.polynomial.chebyshev.chebfit(nodes, around.real, 23)
    smooth = np.polynomial.chebyshev.chebval(((1 + detuning) ** 2 - 1) / reach, series)
    u = displacement(scene, exceptional_hz * (1 + detuning), 1e-11)[:, 0, 0]
    np.testing.assert_allclose(u, smooth, rtol=1e-10)


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


@pytest.mark.slow
def test_complex_frequencies_continue_the_real_ones() -> None:
    scene = scene_of(on(FIRM, 0.05, loss=0.01), force(0.01), (-0.02, 0.01))
    circle = 5.0 * np.exp(2j * np.pi * (np.arange(12) + 0.5) / 12)
    mean = solve(scene, 4000 + 30j + circle, 1e-9).value.mean(axis=0)
    middle = solve(scene, np.array([4000 + 30j]), 1e-9).value
    np.testing.assert_allclose(mean, middle[0], rtol=1e-7)


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
