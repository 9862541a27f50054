"""Values of fields with ten digits and more, and methods that share nothing with the solvers."""

from __future__ import annotations

import dataclasses
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.polynomial import Legendre

from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    Load,
    Material,
    PressureDisc,
    PressureRectangle,
    Strip,
    displacement,
    response,
    transient,
)
from stimuli.field.field import solve
from tests.reference.exact import exact
from tests.test_stimuli.plates import (
    FIRM,
    HANN,
    PLATE,
    SOFT,
    SUPPORTED,
    Edge,
    W,
    at,
    bending_wavenumber_rad_m,
    disc,
    every_edge,
    force,
    on,
    patch,
    scene_of,
    spring,
)

if TYPE_CHECKING:
    from stimuli import Response

FREE, HELD = SIMPLY_SUPPORTED, CLAMPED
MIDDLE, FORCE, THIRD = force(), force(0.0, 0.01), W / 3


def strict(
    strip: Strip,
    load: Load,
    x_m: float,
    y_m: float,
    frequency_hz: float,
    rtol: float = 1e-10,
    *,
    skip: bool = True,
) -> Response:
    with warnings.catch_warnings(), np.errstate(over="raise", divide="raise", invalid="raise"):
        warnings.simplefilter("error")
        return response(scene_of(strip, load, (x_m, y_m), skip=skip), [frequency_hz], rtol)


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


@pytest.mark.parametrize("case", KNOWN)
@pytest.mark.parametrize("skip", [True, False])
def test_the_papers_plate_has_its_known_displacements(case: Any, *, skip: bool) -> None:
    edge, load, x_m, y_m, frequency_hz, known_m = case
    scene = scene_of(on(edge), load, (x_m, y_m), skip=skip)
    for rtol in (1e-3, 1e-6, 1e-10):
        result = displacement(scene, [float(frequency_hz)], rtol)[0, 0, 0]
        assert abs(result - known_m) < rtol * abs(known_m)


# Two-dimensional Galerkin models of 20 and of 13 polynomials along x: 12 digits, the last 11:
# edge, patch, x and y of the point, frequency, metres
SMALL, SIDE = patch(0.005, 0.015), patch(x_m=0.035)
OF_FINITE_STRIPS: list[tuple[Edge, Any, float, float, float, complex]] = [
    (SIMPLY_SUPPORTED, SMALL, 0.0, W / 2, 500, -2.3061331585288091e-05 - 2.3781071148572299e-07j),
    (SIMPLY_SUPPORTED, SMALL, 0.02, 0.0075, 500, -1.9807964221232675e-06 - 2.2596465628158454e-08j),
    (CLAMPED, SMALL, 0.02, 0.0075, 500, 2.9940554851240411e-07 + 2.9637063653468444e-09j),
    (SIMPLY_SUPPORTED, SIDE, 0.035, W / 2, 2600, -5.1185572302677408e-05 - 2.7009407165357262e-05j),
    (SIMPLY_SUPPORTED, SIDE, -0.035, W / 2, 2600, 2.6159621413215560e-05 + 2.4654961487232427e-05j),
]


@pytest.mark.parametrize(("edge", "load", "x_m", "y_m", "frequency_hz", "known"), OF_FINITE_STRIPS)
def test_known_values_of_finite_strips(
    edge: Edge, load: Any, x_m: float, y_m: float, frequency_hz: float, known: complex
) -> None:
    value = at(on(edge, 0.2, loss=0.01), load, [(x_m, y_m)], frequency_hz)[0]
    assert abs(value - known) < 1e-11 * abs(known)


STEEL = Strip(
    width_m=0.02,
    thickness_m=0.0003,
    material=Material(youngs_modulus_pa=2e11, poisson_ratio=0.29, density_kg_m3=7850.0),
    edge=FREE,
)

F1_HZ = STEEL.cutoff_hz()
HALF_HZ = 896.8434934076143
"""f_1 / 2 of the steel strip to the last digit: there p^2 + k^2 rounds to 0 exactly."""
# Residues and integrals in 62-digit arithmetic (tests/reference/exact.py), of the doubles as they are.
AT_MEETINGS: list[tuple[Edge, float | None, float, Load, complex]] = [
    (FREE, None, HALF_HZ, force(0.0, 0.008), 0.000013383171464953033861),
    (FREE, None, 4 * HALF_HZ, disc(0.005, y_m=0.008),
     3.6833555743293389811e-6 - 0.000016502133208074983419j),
    (FREE, None, 9 * HALF_HZ, disc(0.006, y_m=0.008, kind=PressureDisc),
     -1.5685938807682004574e-10 + 8.0965755708646196299e-11j),
    (FREE, None, 6 * F1_HZ, patch(0.005, 0.009, y_m=0.008),
     3.8814808193818823633e-6 - 1.596897146503200222e-6j),
    (FREE, 0.09, HALF_HZ, force(0.0, 0.008), 0.00001338698332957479581),
    (FREE, 0.09, 6 * F1_HZ, patch(0.005, 0.009, y_m=0.008, kind=PressureRectangle),
     -5.4241522476190042981e-11),
    (HELD, None, 2 * F1_HZ, force(0.0, 0.008), 0.00001135519753983808272),
    (HELD, None, 2 * F1_HZ, patch(0.009, 0.009, y_m=0.008, kind=PressureRectangle),
     7.8251211266606120683e-10),
    (HELD, None, 4.091446734 * F1_HZ, disc(0.005, y_m=0.008),
     5.4926707843431572599e-6 - 7.7049229250667392381e-6j),
    (spring(STEEL, 1e-6), None, 4 * HALF_HZ, force(0.0, 0.008),
     -4.4253315881490253395e-6 + 4.9884989581818799423e-6j),
]  # fmt: skip # rows of a table


@pytest.mark.parametrize("case", AT_MEETINGS)
def test_values_at_a_meeting_are_right_to_the_tolerance(
    case: tuple[Edge, float | None, float, Load, complex],
) -> None:
    edge, length_m, f_hz, load, true_m = case
    strip = dataclasses.replace(STEEL, edge=edge, length_m=length_m)
    answer = strict(strip, load, 0.004, 0.009, f_hz)
    error_m = abs(answer.displacement_m[0, 0, 0] - true_m)
    assert error_m < 1e-10 * abs(true_m)
    assert error_m < answer.error_m[0, 0, 0] < 1e-9 * abs(true_m)


RESONANCES: list[tuple[float, float]] = [
    (1855.3717637737934, -1786540.5855058897),
    (1855.3717639591453, -1783.6933425155413),
    (1855.3736191453718, -0.17840305856308455),
    (2102.0117685912232, -6501685.7015048337),
    (2102.011768801214, -6496.5916632397499),
    (2102.0138706027815, -0.64966897905757652),
]


@pytest.mark.parametrize("case", RESONANCES)
def test_beside_a_resonance_without_loss_the_estimate_tells_the_digits_that_are_lost(
    case: tuple[float, float],
) -> None:
    f_hz, true_m = case
    strip = dataclasses.replace(STEEL, length_m=0.09)
    answer = strict(strip, force(0.003, 0.008), 0.02, 0.009, f_hz, 1e-8)
    error_m, estimate_m = abs(answer.displacement_m[0, 0, 0] - true_m), answer.error_m[0, 0, 0]
    assert error_m < estimate_m < 1e4 * max(error_m, 1e-12 * abs(true_m))


SHORT, LONG = on(FREE, 0.01, loss=0.01), on(FREE, 10.0, loss=0.01)
LONG_EPS = float(np.finfo(np.longdouble).eps)


def soft(stiffness_n: float) -> Strip:
    return on(ElasticEdge(stiffness_n=stiffness_n))


# Residues and tanh-sinh-like integrals in 62-digit arithmetic (tests/reference/exact.py), each number
# of the problem taken as the double it is: strip, load, x, y, frequency, metres per unit load.
Values = list[tuple[Strip, Load, float, float, float, complex]]
HARD: Values = [
    (on(HELD), FORCE, 0.01, 0.015, 0.0, 1.6904412068608964242e-6),
    (soft(1e-4), FORCE, 0.01, 0.015, 1e-6, 7.2391972273326210703e-6),
    (soft(1e8), FORCE, 0.0, 0.015, 1e5, 8.497039984380899035e-8 - 7.9273733993805836335e-8j),
    (on(HELD), FORCE, 0.01, 0.015, 3618.11525, 5.4581277488687939328e-6),
    (on(HELD, loss=0.5), FORCE, 0.01, 0.015, 4366.0969428735,
     2.5888117786604936491e-7 + 3.9291263800908521082e-6j),
    (on(HELD, viscous_s=3.2e-5), FORCE, 0.0, 0.015, 500.0,
     3.9089503433567754074e-6 + 3.9686083383083072187e-7j),
    (SUPPORTED, FORCE, 10.0, 0.015, 3000.0, -8.1349364434035836957e-6 - 5.6170414961127034781e-6j),
    (on(HELD), FORCE, 1.0, 0.015, 500.0, 8.9851645770779736739e-79),
    (on(HELD), disc(0.0064, y_m=0.0064), 0.0, 0.0064, 700.0, -8.4751262849790307475e-6),
    (on(HELD), disc(W / 2, kind=PressureDisc), 0.002, 0.02, 700.0, 4.5303113454787106829e-10),
    (on(HELD), patch(0.006, W), 0.0, 0.01, 700.0, -8.0691595450099391246e-6),
    (SUPPORTED, patch(2.5e-8, 2.5e-8, y_m=0.01), 0.0, 0.01, 700.0, -1.816160797659631069e-15),
    (SHORT, patch(), 0.004, 0.015, 500.0, -4.1306146150527622365e-5 - 4.5014899995927912738e-7j),
    (SHORT, patch(), 0.005, 0.015, 2600.0, 4.9621004125186861011e-5 - 3.2650021382847260967e-7j),
    (LONG, patch(), 0.004, 0.015, 2600.0, 3.0409424711759035913e-6 - 2.6368168791971843586e-5j),
]  # fmt: skip # rows of a table
BESIDE_CUTOFF: Values = [
    (SUPPORTED, FORCE, 0.01, 0.015, 1926.031369109,
     -1.5982634424519265753e-5 + 1.3964632583329088172e1j),
    (on(HELD), FORCE, 0.01, 0.015, 4366.096942878,
     -1.4597161205161774087e-5 + 5.2234602199071480351j),
]  # fmt: skip # rows of a table


@pytest.mark.parametrize("case", [*HARD, *BESIDE_CUTOFF])
def test_hard_values_are_right_and_beside_a_cutoff_the_estimate_tells_the_digits_that_are_lost(
    case: tuple[Strip, Load, float, float, float, complex],
) -> None:
    true_m = case[-1]
    found = strict(*case[:-1])
    error_m, estimate_m = abs(found.displacement_m[0, 0, 0] - true_m), found.error_m[0, 0, 0]
    assert error_m < estimate_m
    if case in HARD:
        assert error_m < 1e-10 * abs(true_m)
    else:
        # at a detuning of 1e-12 the field is known to the rounding of a long double over that
        assert estimate_m < 20 * LONG_EPS / 1e-12 * abs(true_m)


@pytest.mark.slow
@pytest.mark.parametrize("part", [1e-3, 1e-4])
@pytest.mark.parametrize("edge", [CLAMPED, SIMPLY_SUPPORTED], ids=["clamped", "supported"])
@pytest.mark.parametrize("touches", [False, True])
def test_the_tolerance_holds_next_to_an_edge(edge: Edge, part: float, *, touches: bool) -> None:
    """Of a force, and of a disc that touches the edge, where sums cancel: against forty digits."""
    y_m = part * W / 2
    load = disc(y_m, y_m=y_m) if touches else force(0.0, y_m)
    true_m = complex(exact(on(edge), load, 0.0, y_m, 700.0))
    for rtol in (1e-1, 1e-2, 1e-4, 1e-6):
        found_m = strict(on(edge), load, 0.0, y_m, 700.0, rtol).displacement_m[0, 0, 0]
        assert abs(found_m - true_m) < rtol * abs(true_m)


@pytest.mark.slow
@pytest.mark.parametrize("from_end_m", [0.0004, 0.0])
def test_loads_at_an_end_have_values_too(from_end_m: float) -> None:
    strip, load = on(FREE, 0.05), force(0.025 - from_end_m, 0.006)
    true_m = complex(exact(strip, load, 0.0, W / 2, 700.0))
    found_m = strict(strip, load, 0.0, W / 2, 700.0, 1e-8).displacement_m[0, 0, 0]
    assert abs(found_m - true_m) < 1e-6 * abs(true_m)


TAU = 8.264e-7
# time synthesis along two lines at two rates, 6 to 8 digits of the peak; the spring has the
# plate's loss
OVER_TIME = [
    (ElasticEdge(stiffness_n=178.752842326547 * PLATE.bending_stiffness_n_m, lossless=False), 0.0,
     1.760711e-05, (-1.72317486535442e-07, 5.57509787660388e-08), (1e-7, 1e-7)),
    (CLAMPED, 0.02, 5.766769e-07, (-8.88061820623136e-10, -1.36217266004044e-09), (1e-5, 1e-6)),
]  # fmt: skip # rows of a table


@pytest.mark.slow
@pytest.mark.parametrize(("edge", "x_m", "peak_m", "true", "digits"), OVER_TIME)
def test_a_patch_moves_as_known(
    edge: Edge, x_m: float, peak_m: float, true: tuple[float, ...], digits: tuple[float, ...]
) -> None:
    scene = scene_of(on(edge, viscous_s=TAU), patch(), (x_m, W / 2))
    found = transient(scene, HANN, [0.001, 0.002], rtol=1e-10)[:, 0, 0]
    assert np.all(np.abs(found - true) < np.array(digits) * peak_m)


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
