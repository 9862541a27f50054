"""The strip: cut-offs, wavenumbers and shapes of any edge, published values and equations."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    ForceRectangle,
    Load,
    Material,
    PressureDisc,
    PressureRectangle,
    Strip,
)
from tests.test_stimuli import plates
from tests.test_stimuli.plates import (
    FIRM,
    PLATE,
    SOFT,
    SUPPORTED,
    Edge,
    bending_wavenumber_rad_m,
    disc,
    each_edge,
    force,
    patch,
    spring,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex

FIRST_HZ = SUPPORTED.cutoff_hz()
SYMMETRIES: tuple[Any, Any] = ("symmetric", "antisymmetric")

modes = st.integers(1, 100)
stiffnesses_n = st.floats(-9, 12).map(lambda exponent: 10.0**exponent)
laws = settings(deadline=None, max_examples=40)
each_symmetry = pytest.mark.parametrize("symmetry", SYMMETRIES)


@st.composite
def strips(draw: st.DrawFn) -> Strip:
    """Draw any simply supported strip without loss."""
    return Strip(
        width_m=draw(st.floats(1e-3, 1.0)),
        thickness_m=draw(st.floats(1e-5, 1e-2)),
        material=Material(
            youngs_modulus_pa=draw(st.floats(1e6, 1e12)),
            poisson_ratio=draw(st.floats(-0.9, 0.499)),
            density_kg_m3=draw(st.floats(100, 2e4)),
        ),
        edge=SIMPLY_SUPPORTED,
    )


def on(edge: Edge, strip: Strip = PLATE) -> Strip:
    return dataclasses.replace(strip, edge=edge)


def held(stiffness_n: float, *, loss: float = 0.0, lossless: bool = True) -> Strip:
    if math.isinf(stiffness_n):
        return plates.on(CLAMPED, loss=loss)
    return plates.on(ElasticEdge(stiffness_n=stiffness_n, lossless=lossless), loss=loss)


@pytest.mark.parametrize(
    ("stiffness_n", "mode", "cutoff_hz"),
    [
        # exact roots of the transcendental equation, 17 digits
        (0.0, 1, 1926.03136910769444),
        (0.0, 2, 7704.12547643077777),
        (0.0, 3, 17334.2823219692500),
        (63.9264884979218, 1, 2500.0),
        (63.9264884979218, 2, 8367.95750180101033),
        (141.72083994908, 1, 2900.0),
        (141.72083994908, 2, 8942.64392619945605),
        (math.inf, 1, 4366.09694287347153),
        (math.inf, 2, 12035.3143487621432),
        (math.inf, 3, 23594.0282542888702),
    ],
)
def test_the_papers_plate_has_its_known_cutoffs(
    stiffness_n: float, mode: int, cutoff_hz: float
) -> None:
    edge = CLAMPED if math.isinf(stiffness_n) else ElasticEdge(stiffness_n=stiffness_n)
    assert on(edge).cutoff_hz(mode) == pytest.approx(cutoff_hz, rel=1e-13)


@laws
@given(strip=strips(), stiffness_n=stiffnesses_n, mode=modes)
def test_a_cutoff_solves_the_edge_equation(strip: Strip, stiffness_n: float, mode: int) -> None:
    held = on(ElasticEdge(stiffness_n=stiffness_n), strip)
    z = bending_wavenumber_rad_m(held, held.cutoff_hz(mode)).real * strip.width_m / 2
    spring = 4 * z * strip.bending_stiffness_n_m / (stiffness_n * strip.width_m)
    hyperbolic = math.tanh(z) if mode % 2 else 1 / math.tanh(z)
    # 2k/kappa + tan + tanh = 0 and 2k/kappa + coth - cot = 0 times the missing cosine and sine
    root = math.cos(z) if mode % 2 else math.sin(z)
    other = math.sin(z) if mode % 2 else -math.cos(z)
    residual = (spring + hyperbolic) * root + other
    assert abs(residual) < 1e-14 * z * (1 + spring)


@pytest.mark.parametrize("mode", [1, 2, 7, 200])
def test_cutoffs_of_springs_reach_those_of_both_ideal_edges(mode: int) -> None:
    assert on(ElasticEdge(stiffness_n=0.0)).cutoff_hz(mode) == SUPPORTED.cutoff_hz(mode)
    stiff_hz = on(ElasticEdge(stiffness_n=1e300)).cutoff_hz(mode)
    assert stiff_hz == on(CLAMPED).cutoff_hz(mode)


def test_cutoffs_are_those_of_the_strip_without_loss_and_without_ends() -> None:
    for edge in plates.EDGES:
        assert plates.on(edge, 0.2, loss=0.1, viscous_s=1e-5).cutoff_hz() == on(edge).cutoff_hz()


@pytest.mark.parametrize(
    ("cutoff_hz", "stiffness_n"),
    [(2900.0, 141.72083994908), (2500.0, 63.9264884979218), (3146.0, 216.264198092798809)],
)
def test_measured_cutoffs_have_their_known_stiffness(cutoff_hz: float, stiffness_n: float) -> None:
    edge = SUPPORTED.with_cutoff(cutoff_hz).edge
    assert isinstance(edge, ElasticEdge)
    assert edge.lossless
    assert edge.stiffness_n == pytest.approx(stiffness_n, rel=1e-12)


@laws
@given(strip=strips(), place=st.floats(1e-12, 1 - 1e-12))
def test_the_edge_found_has_the_target_cutoff(strip: Strip, place: float) -> None:
    low_hz, high_hz = strip.cutoff_hz(), on(CLAMPED, strip).cutoff_hz()
    target_hz = low_hz + place * (high_hz - low_hz)
    ends_hz = math.nextafter(low_hz, high_hz), math.nextafter(high_hz, low_hz)
    for cutoff_hz in (target_hz, *ends_hz):
        assert strip.with_cutoff(cutoff_hz).cutoff_hz() == pytest.approx(cutoff_hz, rel=1e-13)


# --- wavenumbers ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("strip", "frequency_hz", "symmetry", "place", "wavenumber"),
    [
        # closed forms and roots at 24 digits, 17 of them certain
        (SUPPORTED, 500, 0, 0, 108.129134169299324j),
        (SUPPORTED, 500, 0, 1, 141.034834091736404j),
        (SUPPORTED, 500, 1, 0, 243.034999087438548j),
        (SUPPORTED, 2500, 0, 0, 68.5997076229937164 + 0j),
        (SUPPORTED, 2500, 0, 1, 190.495810897369000j),
        (SUPPORTED, 2500, 1, 0, 206.562777961734188j),
        (plates.on(SOFT), 500, 0, 0, 45.7149521232433317 + 134.250193213292062j),
        (plates.on(SOFT), 500, 1, 0, 50.5806688485074964 + 256.996340829423783j),
        (plates.on(FIRM), 500, 0, 0, 60.2669932638340808 + 141.043590216544196j),
        (plates.on(FIRM), 500, 1, 0, 68.3086264635341736 + 262.599365435832642j),
        (PLATE, 500, 0, 0, 89.3538771994679373 + 168.144709736643209j),
        (PLATE, 500, 1, 0, 110.542057631022669 + 299.838842091982101j),
        (plates.on(SOFT), 2500, 0, 1, 178.572622947938904j),
        (plates.on(SOFT), 2500, 1, 0, 32.3600790704886772 + 254.059796022895989j),
        (plates.on(FIRM), 2500, 0, 0, 73.4287422415495487j),
        (plates.on(FIRM), 2500, 0, 1, 164.887899624663458j),
        (plates.on(FIRM), 2500, 1, 0, 56.9626566930052906 + 259.937234800173560j),
        (PLATE, 2500, 0, 0, 69.1947400289195210 + 158.589040813789420j),
        (PLATE, 2500, 1, 0, 105.440470806924121 + 298.179022697244452j),
    ],
)
def test_the_papers_plate_has_its_known_wavenumbers(
    strip: Strip, frequency_hz: float, symmetry: int, place: int, wavenumber: complex
) -> None:
    p = strip.wavenumbers_rad_m(frequency_hz, symmetry=SYMMETRIES[symmetry])[place]
    assert abs(p - wavenumber) < 1e-11 * abs(wavenumber)


@pytest.mark.parametrize(
    ("bending", "compliance", "symmetric", "place", "wavenumber"),
    [
        # roots of (33) in 40 digits; p W / 2; those far above the bending wavenumber lie close
        (0, 0, True, 0, 1.12536430580093027 + 2.1061961152453303j),
        (0, 0, False, 0, 1.38433914149366077 + 3.74883813888819275j),
        (0, 1e-06, True, 49, -2.87013873672256418 + 77.7358876072091597j),
        (0, 1e6, True, 0, 0.000707106632704920584 + 1.57079648594977521j),
        (1e-08, 0.5, False, 7, -0.877004195155585056 + 12.6055354882530463j),
        (3, 0.001, True, 1, -0.902223358721507985 + 1.99696244857945006j),
        (123, 0, True, 0, 10.9628629090701657),
        (123, 0.25, False, 6, 12.6908931065394932j),
        (123, 250000.0, True, 7, 13.249737463137827j),
        (40, 5, True, 49, -0.17105187322249179 + 76.9692302678075446j),
    ],
)
def test_roots_agree_with_those_found_in_40_digits(
    bending: float, compliance: float, symmetric: object, place: int, wavenumber: complex
) -> None:
    stiffness_n = 2 * PLATE.bending_stiffness_n_m / (compliance * PLATE.width_m or math.nan)
    strip = held(stiffness_n) if compliance else PLATE
    frequency_hz = bending * FIRST_HZ * 4 / math.pi**2
    p = strip.wavenumbers_rad_m(frequency_hz, place + 1, SYMMETRIES[not symmetric])[place]
    assert abs(p * PLATE.width_m / 2 - wavenumber) < 5e-9 * abs(wavenumber)


# --- completeness --------------------------------------------------------------------------------


Waves: TypeAlias = tuple[Strip, float, int]
"""A strip, a frequency in hertz, and the number of a symmetry."""


def first_waves(some: Waves, count: int) -> NDArray[np.complex128]:
    """Return the first wavenumbers times half the width."""
    strip, frequency_hz, symmetry = some
    p = strip.wavenumbers_rad_m(frequency_hz, count, SYMMETRIES[symmetry])
    return np.asarray(p * strip.width_m / 2)


def bending_of(some: Waves) -> complex:
    """Return the square of the bending wavenumber times half the width."""
    return (bending_wavenumber_rad_m(some[0], some[1]) * some[0].width_m / 2) ** 2


def relation(some: Waves, w: Complex) -> Complex:
    """Return the dispersion relation by w = -i p W / 2, as textbooks have it."""
    (strip, frequency_hz, symmetry), z, compliance = some, bending_of(some), 0j
    if isinstance(strip.edge, ElasticEdge):
        factor = strip.material.stiffness_factor(frequency_hz) if strip.edge.lossless else 1.0
        stiffness = strip.bending_stiffness_n_m * factor
        compliance = 2 * stiffness / (strip.edge.stiffness_n * strip.width_m)
    slack, grip = compliance / (1 + abs(compliance)), 1 / (1 + abs(compliance))
    a, b = np.sqrt(w * w + z), np.sqrt(w * w - z)
    if symmetry == 0:
        rest = (a * np.sin(a) * np.cos(b) - b * np.sin(b) * np.cos(a)) / (2 * z)
        return np.asarray(slack * np.cos(a) * np.cos(b) + grip * rest)
    rest = (np.sin(a) / a * np.cos(b) - np.sin(b) / b * np.cos(a)) / (2 * z)
    return np.asarray(slack * np.sin(a) / a * np.sin(b) / b + grip * rest)


@st.composite
def waves(draw: st.DrawFn) -> Waves:
    """Draw any edge but simple supports, a frequency up to 50 cut-offs and a loss up to 0.5."""
    loss = draw(st.sampled_from([0.0, 1e-6, 0.01, 0.5]) | st.floats(0.0, 0.5))
    cutoffs = draw(st.just(1e-4) | st.floats(1e-4, 4.0) | st.floats(1e-4, 50.0))
    grip = draw(st.just(math.inf) | st.floats(-6, 6).map(lambda exponent: 10.0**exponent))
    stiffness_n = 2 * PLATE.bending_stiffness_n_m / PLATE.width_m * grip
    strip = held(stiffness_n, loss=loss, lossless=draw(st.booleans()))
    return strip, cutoffs * FIRST_HZ, draw(st.integers(0, 1))


def roots_to_the_left(some: Waves, decay: float) -> float:
    """Count the waves that decay less, by the argument of the relation around them.

    The relation is even in w, so that half of a rectangle about w = 0 counts each wave once;
    above and below it there are no roots.
    """
    height = 1.5 * math.sqrt(abs(bending_of(some))) + 8 + math.log(1 + decay)
    corners = [decay - 1j * height, decay + 1j * height, -decay + 1j * height]
    turns = 0.0
    for start, end in itertools.pairwise(corners):
        steps = 2000
        while True:
            value = relation(some, np.linspace(start, end, steps).astype(np.complex128))
            angle = np.angle(value[1:] / value[:-1])
            if np.max(abs(angle)) < 1:
                break
            steps *= 4
        turns += float(np.sum(angle))
    return turns / (2 * math.pi)


@pytest.mark.slow
@settings(deadline=None, max_examples=150)
@given(some=waves(), count=st.integers(1, 50))
def test_no_wave_is_missed_and_none_found_twice(some: Waves, count: int) -> None:
    decays = first_waves(some, count + 4).imag
    # the first gap between two decays from the count
    gaps = np.flatnonzero(np.diff(decays) > 1e-3 * (1 + decays[1:]))
    place = next((int(gap) for gap in gaps if gap >= count - 1), None)
    if place is None:
        return
    between = (decays[place] + decays[place + 1]) / 2
    assert roots_to_the_left(some, between) == pytest.approx(place + 1, abs=1e-6)


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(some=waves(), count=st.integers(2, 50))
def test_more_waves_do_not_change_the_first(some: Waves, count: int) -> None:
    x, more = first_waves(some, count - 1) ** 2, first_waves(some, count + 20)[: count + 1] ** 2
    # near a double root both are known to the square root of the precision only
    distance = np.min(abs(x[:, np.newaxis] - more), axis=1)
    assert np.all(distance < 1e-6 * (abs(x) + abs(bending_of(some))))


# --- laws of the wavenumbers ---------------------------------------------------------------------


@each_symmetry
@pytest.mark.parametrize("loss", [0.0, 1e-12, 0.3])
@pytest.mark.parametrize("n_modes", [4, 20])
@pytest.mark.parametrize("cutoffs", [0.0, 1e-3, 0.7, 1 + 1e-9, 4 - 1e-12, 9.0, 37.0, 400.0])
def test_between_simple_supports_wavenumbers_are_outgoing_ordered_and_closed_forms(
    cutoffs: float, n_modes: int, loss: float, symmetry: Any
) -> None:
    """p^2 = k^2 - q^2 and -k^2 - q^2, at cut-offs and beside them too."""
    strip = plates.on(SIMPLY_SUPPORTED, loss=loss)
    frequency_hz = cutoffs * FIRST_HZ
    p = strip.wavenumbers_rad_m(frequency_hz, n_modes=n_modes, symmetry=symmetry)
    assert np.all((p.imag > 0) | ((p.imag == 0) & (p.real >= 0)))
    order = list(zip(p.imag, -p.real, strict=True))
    assert order == sorted(order)
    k2 = bending_wavenumber_rad_m(strip, frequency_hz) ** 2
    q = np.pi / strip.width_m * (np.arange(1, 2 * n_modes + 30, 2) + (symmetry != "symmetric"))
    squares = np.concatenate([k2 - q**2, -k2 - q**2])
    roots = np.sqrt(squares.astype(np.complex128))
    first = squares[np.argsort(np.where(roots.imag < 0, -roots, roots).imag)]
    size = np.abs(first[n_modes])
    # the nearer two roots, the fewer digits: half of them where both are one
    slack = size * min(1e-9 + 1e-13 * size / max(abs(k2), 1e-9 * size), 3e-6)
    assert np.max(np.min(np.abs(p**2 - first[: n_modes + 1, np.newaxis]), axis=0)) < slack
    assert np.max(np.min(np.abs(p**2 - first[: n_modes - 1, np.newaxis]), axis=1)) < slack


@each_symmetry
@pytest.mark.parametrize("mode", [1, 2, 3, 4])
@pytest.mark.parametrize("stiffness_n", [0.01, 141.72083994908, math.inf])
def test_each_mode_propagates_from_its_cutoff_on(
    stiffness_n: float, mode: int, symmetry: Any
) -> None:
    strip = held(stiffness_n)
    cutoff_hz = strip.cutoff_hz(mode)
    below, above = (
        np.sum(strip.wavenumbers_rad_m(f * cutoff_hz, 8, symmetry).imag == 0)
        for f in (1 - 1e-9, 1 + 1e-9)
    )
    own = (mode % 2 == 1) == (symmetry == "symmetric")
    assert above - below == own
    assert above == (mode + (symmetry == "symmetric")) // 2


@each_symmetry
@pytest.mark.parametrize("frequency_hz", [500.0, 3000.0, 60_000.0])
def test_springs_reach_both_ideal_edges(frequency_hz: float, symmetry: Any) -> None:
    """Wavenumbers differ by a part as small as that of the edge, up to any stiffness."""
    for ideal, sign in ((SUPPORTED, 1), (PLATE, -1)):
        squared = ideal.wavenumbers_rad_m(frequency_hz, 8, symmetry) ** 2
        for compliance in (1e-2, 1e-4, 1e-6, 1e-9, 1e-30):
            edge = spring(PLATE, compliance**sign)
            found = on(edge).wavenumbers_rad_m(frequency_hz, 10, symmetry) ** 2
            distance = np.min(np.abs(found - squared[:, np.newaxis]), axis=1)
            assert np.max(distance) < 12 * max(compliance, 1e-9) * np.max(np.abs(squared))


@each_symmetry
@each_edge
def test_vanishing_loss_leaves_the_branch_of_the_lossless_strip(edge: Edge, symmetry: Any) -> None:
    for frequency_hz in (500.0, 2500.0, 40_000.0):
        exact, hysteretic, viscous = (
            strip.wavenumbers_rad_m(frequency_hz, 12, symmetry)
            for strip in (
                plates.on(edge),
                plates.on(edge, loss=1e-13),
                plates.on(edge, viscous_s=1e-18),
            )
        )
        for lossy in (hysteretic, viscous):
            assert np.all(lossy.imag > 0)
            distance = np.min(abs(lossy - exact[:, np.newaxis]), axis=1)
            assert np.all(distance < 1e-9 * abs(exact))


@pytest.mark.parametrize(
    ("strip", "frequency_hz", "rel"),
    [
        (PLATE, 3618.11524962338517, 1e-12),
        (plates.on(FIRM), 2122.130, 4e-7),
        (plates.on(SOFT), 1575.804, 4e-7),
    ],
)
def test_exceptional_points_of_the_papers_plate(
    strip: Strip, frequency_hz: float, rel: float
) -> None:
    assert strip.exceptional_point_hz() == pytest.approx(frequency_hz, rel=rel)


def test_both_wavenumbers_meet_at_the_clamped_exceptional_point() -> None:
    p = PLATE.wavenumbers_rad_m(PLATE.exceptional_point_hz(), n_modes=2)
    assert np.mean(p) == pytest.approx(143.015922149638536j, rel=1e-12)
    # either is known to the square root of the precision only
    np.testing.assert_allclose(p, 143.015922149638536j, rtol=1e-6)


@pytest.mark.parametrize("exponent", range(-6, 7))
def test_two_lowest_waves_are_a_pair_below_the_exceptional_point_only(exponent: int) -> None:
    strip = held(100.0 * 10.0**exponent)
    point_hz = strip.exceptional_point_hz()
    assert 0 < point_hz < strip.cutoff_hz()
    below, above = (strip.wavenumbers_rad_m(f * point_hz, 2) for f in (0.99, 1.01))
    assert below[0] == -below[1].conjugate()
    assert below[0].real > 0
    assert np.all(above.real == 0)
    assert above[0].imag < above[1].imag


# --- shapes --------------------------------------------------------------------------------------


def gauss(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return PLATE.width_m * (nodes + 1) / 2, weights / 2


@pytest.mark.parametrize("strip", [SUPPORTED, held(1e-3), plates.on(FIRM), PLATE])
def test_cutoff_shapes_are_orthogonal_with_a_mean_square_of_one_half(strip: Strip) -> None:
    y, weights = gauss(60)
    shapes = np.array([strip.mode_shape(mode, y) for mode in range(1, 9)])
    np.testing.assert_allclose((shapes * weights) @ shapes.T, np.eye(8) / 2, atol=1e-9)


@pytest.mark.parametrize("mode", [1, 2, 3, 40, 100])
def test_cutoff_shapes_of_clamped_edges_are_those_of_the_clamped_beam(mode: int) -> None:
    y = np.linspace(0, PLATE.width_m, 81)
    k = math.sqrt(PLATE.cutoff_hz(mode) / FIRST_HZ) * math.pi / PLATE.width_m
    # cos, sin and the boundary layers of both edges, each from its own
    sign = 1 if mode % 2 else -1
    layer = np.exp(-k * y) + sign * np.exp(-k * (PLATE.width_m - y))
    half = k * PLATE.width_m / 2
    wave = np.cos(k * y - half) if mode % 2 else np.sin(half - k * y)
    at_edge = math.cos(half) if mode % 2 else math.sin(half)
    beam = layer / (1 + sign * math.exp(-2 * half)) - wave / at_edge
    shape = PLATE.mode_shape(mode, y)
    scale = float(beam @ shape / (beam @ beam))
    np.testing.assert_allclose(shape, scale * beam, atol=1e-8)
    assert np.all(np.abs(shape[[0, -1]]) < 1e-13)
    assert PLATE.mode_shape(mode, 1e-3 / k) > 0


@pytest.mark.parametrize("mode", [1, 2, 3, 8, 41, 100])
def test_mode_shapes_on_simple_supports_are_sines(mode: int) -> None:
    y = np.linspace(0.0, SUPPORTED.width_m, 41)
    shape = SUPPORTED.mode_shape(mode, y)
    assert np.all(np.abs(shape[[0, -1]]) < 1e-13)
    np.testing.assert_allclose(shape, np.sin(mode * np.pi * y / SUPPORTED.width_m), atol=1e-8)


# --- loads ---------------------------------------------------------------------------------------
ROUND, OBLONG = (0.0064, 0.0064), (0.005, 0.002)


@pytest.mark.parametrize(
    ("load", "unit", "is_moment", "area_m2", "half_size_m"),
    [
        (force(), "N", False, 1, (0.0, 0.0)),
        (disc(kind=PressureDisc), "Pa", False, 1, ROUND),
        (disc(), "N m/m", True, 1, ROUND),
        (patch(0.01, 0.004, kind=PressureRectangle), "Pa", False, 1, OBLONG),
        (patch(0.01, 0.004), "N m/m", True, 1, OBLONG),
        (patch(0.01, 0.004, kind=ForceRectangle), "N", False, pytest.approx(4e-5), OBLONG),
    ],
)
def test_a_load_has_a_unit_the_area_of_a_force_and_half_its_size(
    load: Load, unit: str, is_moment: object, area_m2: object, half_size_m: object
) -> None:
    properties = (load.unit, load.is_moment, load.area_m2, load.half_size_m)
    assert properties == (unit, is_moment, area_m2, half_size_m)
