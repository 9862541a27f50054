"""All waves of strips with any edges: known roots, none missed, none twice, and their shapes."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stimuli import CLAMPED, ElasticEdge, Strip
from stimuli.strip.dispersion import dispersion
from stimuli.strip.roots import clamped_roots, decays_squared, section_roots
from stimuli.strip.waves import Section, cross_waves, outgoing_root
from tests.test_stimuli.plates import FIRM, PLATE, SOFT, SUPPORTED, Edge, each_edge, on

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex

FIRST_HZ = SUPPORTED.cutoff_hz()
SYMMETRIES: tuple[Any, Any] = ("symmetric", "antisymmetric")

laws = settings(deadline=None, max_examples=60)


each_symmetry = pytest.mark.parametrize("symmetry", SYMMETRIES)


def held(stiffness_n: float, *, loss: float = 0.0, lossless: bool = True) -> Strip:
    if math.isinf(stiffness_n):
        return on(CLAMPED, loss=loss)
    return on(ElasticEdge(stiffness_n=stiffness_n, lossless=lossless), loss=loss)


@st.composite
def sections(draw: st.DrawFn) -> Section:
    """Draw a strip of any edge but simple supports, frequency to 50 f_1 and loss to 0.5."""
    loss = draw(st.sampled_from([0.0, 1e-6, 0.01, 0.5]) | st.floats(0.0, 0.5))
    cutoffs = draw(st.sampled_from([0.0, 1e-6]) | st.floats(1e-9, 4.0) | st.floats(1e-9, 50.0))
    compliance = draw(st.just(0.0) | st.floats(-6, 6).map(lambda exponent: 10.0**exponent))
    factor = complex(1.0, -loss)
    return Section(
        bending=math.pi**2 / 4 * cutoffs / factor**0.5,
        compliance=compliance * (factor if draw(st.booleans()) else 1.0),
        symmetric=draw(st.booleans()),
    )


def textbook(section: Section, w: Complex) -> Complex:
    """Return the dispersion function by w = sqrt(x) from trigonometric functions as they are."""
    slack, grip = section.weights
    z = section.bending
    a, b = np.sqrt(w * w + z), np.sqrt(w * w - z)
    if section.symmetric:
        rest = (a * np.sin(a) * np.cos(b) - b * np.sin(b) * np.cos(a)) / (2 * z)
        even: Complex = slack * np.cos(a) * np.cos(b) + grip * rest
        return even
    rest = (np.sin(a) / a * np.cos(b) - np.sin(b) / b * np.cos(a)) / (2 * z)
    value: Complex = slack * np.sin(a) / a * np.sin(b) / b + grip * rest
    return value


def roots_to_the_left(section: Section, decay: float) -> float:
    """Count the x with Re sqrt(x) < decay, by the argument of the function around them.

    The function is even in w = sqrt(x), so that half of a rectangle about w = 0 counts each x
    once; above and below it there are no roots.
    """
    height = 1.5 * math.sqrt(abs(section.bending)) + 8 + math.log(1 + decay)
    corners = [decay - 1j * height, decay + 1j * height, -decay + 1j * height]
    turns = 0.0
    for start, end in itertools.pairwise(corners):
        steps = 2000
        while True:
            value = textbook(section, np.linspace(start, end, steps).astype(np.complex128))
            angle = np.angle(value[1:] / value[:-1])
            if np.max(abs(angle)) < 1:
                break
            steps *= 4
        turns += float(np.sum(angle))
    return turns / (2 * math.pi)


# --- known wavenumbers ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("strip", "frequency_hz", "symmetry", "place", "wavenumber"),
    [
        # roots at 24 digits, 17 of them certain
        (on(SOFT), 500, 0, 0, 45.7149521232433317 + 134.250193213292062j),
        (on(SOFT), 500, 1, 0, 50.5806688485074964 + 256.996340829423783j),
        (on(FIRM), 500, 0, 0, 60.2669932638340808 + 141.043590216544196j),
        (on(FIRM), 500, 1, 0, 68.3086264635341736 + 262.599365435832642j),
        (PLATE, 500, 0, 0, 89.3538771994679373 + 168.144709736643209j),
        (PLATE, 500, 1, 0, 110.542057631022669 + 299.838842091982101j),
        (on(SOFT), 2500, 0, 1, 178.572622947938904j),
        (on(SOFT), 2500, 1, 0, 32.3600790704886772 + 254.059796022895989j),
        (on(FIRM), 2500, 0, 0, 73.4287422415495487j),
        (on(FIRM), 2500, 0, 1, 164.887899624663458j),
        (on(FIRM), 2500, 1, 0, 56.9626566930052906 + 259.937234800173560j),
        (PLATE, 2500, 0, 0, 69.1947400289195210 + 158.589040813789420j),
        (PLATE, 2500, 1, 0, 105.440470806924121 + 298.179022697244452j),
    ],
)
def test_the_papers_plate_has_its_known_wavenumbers(
    strip: Strip, frequency_hz: float, symmetry: int, place: int, wavenumber: complex
) -> None:
    p = strip.wavenumbers_rad_m(frequency_hz, symmetry=SYMMETRIES[symmetry])[place]
    assert abs(p - wavenumber) < 2e-14 * abs(wavenumber)


@pytest.mark.parametrize(
    ("bending", "compliance", "symmetric", "place", "wavenumber"),
    [
        # roots of (31) in 40 digits; p W / 2
        (0, 0, True, 0, 1.12536430580093027 + 2.1061961152453303j),
        (0, 0, False, 0, 1.38433914149366077 + 3.74883813888819275j),
        (0, 1e-06, True, 49, -2.87013873672256418 + 77.7358876072091597j),
        (0, 1e6, True, 0, 0.000707106632704920584 + 1.57079648594977521j),
        (1e-08, 0.5, False, 7, -0.877004195155585056 + 12.6055354882530463j),
        (3, 0.001, True, 1, -0.902223358721507985 + 1.99696244857945006j),
        (3 - 1.5j, 1e6, False, 2, -0.124151792677955784 + 6.04101330900392662j),
        (123, 0, True, 0, 10.9628629090701657),
        (123, 0.25, False, 6, 12.6908931065394932j),
        (123, 250000.0, True, 7, 13.249737463137827j),
        (100 - 25j, 0, True, 4, 1.2416408560446628 + 10.1992425078681246j),
        (100 - 25j, 0.01 - 0.005j, False, 20, -1.93197676890492242 + 34.1726416571137056j),
        (40, 5, True, 49, -0.17105187322249179 + 76.9692302678075446j),
    ],
)
def test_roots_agree_with_those_found_in_40_digits(
    bending: complex, compliance: complex, symmetric: object, place: int, wavenumber: complex
) -> None:
    section = Section(bending=bending, compliance=compliance, symmetric=bool(symmetric))
    p = outgoing_root(-decays_squared(section, place + 1))[place]
    assert abs(p - wavenumber) < 4e-15 * abs(wavenumber)


# --- completeness --------------------------------------------------------------------------------


@pytest.mark.slow
@settings(deadline=None, max_examples=150)
@given(section=sections(), count=st.integers(1, 50))
def test_no_root_is_missed_and_none_found_twice(section: Section, count: int) -> None:
    # at rest the function as it stands is 0 / 0, so that a bending of 1e-4 stands for it
    bending = section.bending if abs(section.bending) > 1e-4 else 1e-4
    section = dataclasses.replace(section, bending=bending)
    decays = outgoing_root(-decays_squared(section, count + 4)).imag
    # the first gap between two decays from the count asked for
    gaps = np.flatnonzero(np.diff(decays) > 1e-3 * (1 + decays[1:]))
    place = next((int(gap) for gap in gaps if gap >= count - 1), None)
    if place is None:
        return
    between = (decays[place] + decays[place + 1]) / 2
    assert roots_to_the_left(section, between) == pytest.approx(place + 1, abs=1e-6)


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(section=sections(), count=st.integers(2, 50))
def test_asking_for_more_waves_does_not_change_the_first(section: Section, count: int) -> None:
    x, more = decays_squared(section, count - 1), decays_squared(section, count + 20)
    # near a double root both are known to the square root of the precision only
    distance = np.min(abs(x[:, np.newaxis] - more[: count + 1]), axis=1)
    assert np.all(distance < 1e-6 * (abs(x) + abs(section.bending)))


@pytest.mark.slow
@laws
@given(section=sections(), count=st.integers(1, 30))
def test_the_slope_is_the_derivative_of_the_function(section: Section, count: int) -> None:
    x = decays_squared(section, count) * (1.01 + 0.02j) + 0.1
    step = 1e-5 * (abs(x) + abs(section.bending))
    # the scaling exp(i (a + b)) changes with x and is taken out
    here, above, below = (
        np.exp(1j * (w.a + w.b))
        for w in (cross_waves(x + shift, section.bending) for shift in (0 * step, step, -step))
    )
    rise = dispersion(section, x + step)[0] / above - dispersion(section, x - step)[0] / below
    slope = dispersion(section, x)[1]
    np.testing.assert_allclose(slope, rise / (2 * step) * here, rtol=1e-4, atol=1e-9)


# --- laws of the wavenumbers ---------------------------------------------------------------------


@pytest.mark.slow
@laws
@given(
    exponent=st.floats(-6, 6),
    cutoffs=st.floats(0.0, 50.0),
    loss=st.sampled_from([0.0, 1e-9, 0.02, 0.5]),
    symmetry=st.sampled_from(SYMMETRIES),
    n_modes=st.integers(1, 30),
)
def test_wavenumbers_are_outgoing_and_ordered(
    exponent: float, cutoffs: float, loss: float, symmetry: Any, n_modes: int
) -> None:
    strip = held(100 * 10**exponent, loss=loss)
    p = strip.wavenumbers_rad_m(cutoffs * FIRST_HZ, n_modes=n_modes, symmetry=symmetry)
    assert p.shape == (n_modes,)
    assert np.all((p.imag > 0) | ((p.imag == 0) & (p.real > 0)))
    order = list(zip(p.imag, -p.real, strict=True))
    assert order == sorted(order)
    if loss == 0:
        alone = [v for v in p[:-1] if v.real and v.imag and -v.conjugate() not in p]
        assert not alone


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
@pytest.mark.parametrize("frequency_hz", [0.0, 500.0, 3000.0, 60_000.0])
def test_springs_reach_both_ideal_edges(frequency_hz: float, symmetry: Any) -> None:
    for stiffness_n, ideal in ((1e-30, SUPPORTED), (1e30, PLATE)):
        p = held(stiffness_n).wavenumbers_rad_m(frequency_hz, 12, symmetry)
        exact = ideal.wavenumbers_rad_m(frequency_hz, 12, symmetry)
        np.testing.assert_allclose(p, exact, rtol=1e-12, atol=1e-10)


@each_symmetry
@each_edge
def test_vanishing_loss_leaves_the_branch_of_the_lossless_strip(edge: Edge, symmetry: Any) -> None:
    for frequency_hz in (500.0, 2500.0, 40_000.0):
        exact, hysteretic, viscous = (
            strip.wavenumbers_rad_m(frequency_hz, 12, symmetry)
            for strip in (on(edge), on(edge, loss=1e-13), on(edge, viscous_s=1e-18))
        )
        for lossy in (hysteretic, viscous):
            assert np.all(lossy.imag > 0)
            distance = np.min(abs(lossy - exact[:, np.newaxis]), axis=1)
            assert np.all(distance < 1e-11 * abs(exact))


def test_a_spring_with_the_plates_loss_is_a_lossless_one_scaled_with_it() -> None:
    # both have the real kappa = K / D: only the bending of the plate is complex
    lossy = held(64.0, loss=0.2, lossless=False)
    section = Section(
        bending=math.pi**2 / 4 * (500 / FIRST_HZ) / (1 - 0.2j) ** 0.5,
        compliance=2 * lossy.bending_stiffness_n_m / (64.0 * lossy.width_m),
        symmetric=True,
    )
    expected = outgoing_root(-decays_squared(section, 4)) * 2 / lossy.width_m
    np.testing.assert_allclose(lossy.wavenumbers_rad_m(500.0), expected, rtol=1e-14)
    other = held(64.0, loss=0.2).wavenumbers_rad_m(500.0)
    assert np.all(abs(other / expected - 1) > 1e-4)


# --- exceptional points --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("strip", "frequency_hz", "rel"),
    [(PLATE, 3618.11524962338517, 1e-14), (on(FIRM), 2122.130, 4e-7), (on(SOFT), 1575.804, 4e-7)],
)
def test_exceptional_points_of_the_papers_plate(
    strip: Strip, frequency_hz: float, rel: float
) -> None:
    assert strip.exceptional_point_hz() == pytest.approx(frequency_hz, rel=rel)


def test_both_wavenumbers_meet_at_the_clamped_exceptional_point() -> None:
    p = PLATE.wavenumbers_rad_m(PLATE.exceptional_point_hz(), n_modes=2)
    assert np.mean(p) == pytest.approx(143.015922149638536j, rel=1e-12)
    # either is known to the square root of the precision only
    np.testing.assert_allclose(p, 143.015922149638536j, rtol=1e-7)


@pytest.mark.parametrize("exponent", range(-6, 7))
def test_two_lowest_waves_are_a_pair_below_the_exceptional_point_only(exponent: int) -> None:
    strip = held(100.0 * 10.0**exponent)
    point_hz = strip.exceptional_point_hz()
    assert 0 < point_hz < strip.cutoff_hz()
    below, above = (strip.wavenumbers_rad_m(f * point_hz, 2) for f in (1 - 1e-9, 1 + 1e-9))
    assert below[0] == -below[1].conjugate()
    assert below[0].real > 0
    assert np.all(above.real == 0)
    assert above[0].imag < above[1].imag


def test_soft_springs_lead_to_the_simple_support_without_exceptional_point() -> None:
    assert SUPPORTED.exceptional_point_hz() == 0.0
    soft, softer = (held(k).exceptional_point_hz() for k in (1e-8, 1e-12))
    assert soft / softer == pytest.approx(100.0, rel=1e-6)
    assert softer < 1e-3
    assert held(1e300).exceptional_point_hz() == PLATE.exceptional_point_hz()
    assert held(64.0, loss=0.1).exceptional_point_hz() == held(64.0).exceptional_point_hz()


# --- shapes --------------------------------------------------------------------------------------


def gauss(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return PLATE.width_m * (nodes + 1) / 2, weights / 2


@pytest.mark.parametrize("strip", [SUPPORTED, held(1e-3), on(FIRM), PLATE])
def test_cutoff_shapes_are_orthogonal_with_a_mean_square_of_one_half(strip: Strip) -> None:
    y, weights = gauss(60)
    shapes = np.array([strip.mode_shape(mode, y) for mode in range(1, 9)])
    np.testing.assert_allclose((shapes * weights) @ shapes.T, np.eye(8) / 2, atol=1e-13)


@pytest.mark.parametrize("mode", [1, 2, 3, 40, 10_000])
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
    np.testing.assert_allclose(shape, scale * beam, atol=2e-12 * mode**0.5)
    assert shape[0] == shape[-1] == 0.0
    assert PLATE.mode_shape(mode, 1e-3 / k) > 0


@each_symmetry
@pytest.mark.parametrize("stiffness_n", [1e-4, 64.0, math.inf])
@pytest.mark.parametrize("loss_factor", [0.0, 0.3])
@pytest.mark.parametrize("frequency_hz", [0.0, 500.0, 20_000.0])
def test_wave_shapes_satisfy_plate_and_edge(
    stiffness_n: float, loss_factor: float, frequency_hz: float, symmetry: Any
) -> None:
    strip = held(stiffness_n, loss=loss_factor)
    factor = strip.material.stiffness_factor(frequency_hz)
    k2 = (math.pi / strip.width_m) ** 2 * (frequency_hz / FIRST_HZ) / factor**0.5
    v = np.cos(np.pi * (np.arange(60) + 0.5) / 60)
    for p in strip.wavenumbers_rad_m(frequency_hz, 4, symmetry):
        shape = strip.wave_shape(p, frequency_hz, strip.width_m * (v + 1) / 2, symmetry)
        series = np.polynomial.Chebyshev.fit(v, shape, 50, domain=[-1, 1])
        by_y = 2 / strip.width_m
        second, fourth = (series.deriv(n) * by_y**n for n in (2, 4))
        size = abs(p) ** 4 + abs(k2) ** 2 + by_y**4
        places = np.linspace(-0.9, 0.9, 7)
        rest = fourth(places) - 2 * p**2 * second(places) + (p**4 - k2**2) * series(places)
        assert np.max(abs(rest)) < 1e-6 * size
        slope = series.deriv(1)(-1) * by_y
        if math.isinf(stiffness_n):
            assert abs(slope) < 1e-9 * size**0.25
        else:
            kappa = stiffness_n / (strip.bending_stiffness_n_m * factor)
            assert abs(second(-1) - kappa * slope) < 1e-6 * (size**0.5 + abs(kappa * slope))


@each_symmetry
def test_wave_shapes_have_their_norm_phase_and_symmetry(symmetry: Any) -> None:
    strip = held(64.0, loss=0.1)
    y, weights = gauss(40)
    for p in strip.wavenumbers_rad_m(700.0, 6, symmetry):
        shape = strip.wave_shape(p, 700.0, y, symmetry)
        assert np.sum(weights * abs(shape) ** 2) == pytest.approx(0.5, rel=1e-12)
        parity = 1 if symmetry == "symmetric" else -1
        np.testing.assert_allclose(shape[::-1], parity * shape, atol=1e-13)
        ends = strip.wave_shape(p, 700.0, [0.0, strip.width_m], symmetry)
        np.testing.assert_array_equal(ends, 0)
        step = 1e-6
        u = strip.wave_shape(p, 700.0, [step, 2 * step], symmetry)
        rise = (4 * u[0] - u[1]) / (2 * step) + PLATE.width_m / 2 * (u[1] - 2 * u[0]) / step**2
        assert abs(rise.imag) < 1e-2 * rise.real


def test_a_pair_of_waves_has_conjugate_shapes_and_a_real_wave_a_real_one() -> None:
    y = np.linspace(0, PLATE.width_m, 9)
    first, second = (PLATE.wave_shape(p, 500.0, y) for p in PLATE.wavenumbers_rad_m(500.0, 2))
    np.testing.assert_allclose(first, second.conj(), atol=1e-15)
    assert np.max(abs(first.imag)) > 0.01
    slow = PLATE.wave_shape(PLATE.wavenumbers_rad_m(4000.0)[0], 4000.0, y)
    assert np.all(slow.imag == 0)


def test_at_cutoff_the_shape_of_the_wave_is_that_of_the_mode() -> None:
    y = np.linspace(0, PLATE.width_m, 9)
    for mode in (1, 2, 5):
        symmetry = SYMMETRIES[(mode + 1) % 2]
        wave = PLATE.wave_shape(0, PLATE.cutoff_hz(mode), y, symmetry)
        np.testing.assert_allclose(wave, PLATE.mode_shape(mode, y), atol=1e-12)


def test_on_simple_supports_every_wave_has_the_shape_of_its_mode() -> None:
    y = np.linspace(0, PLATE.width_m, 21)
    for frequency_hz, place, mode in [(500.0, 1, 1), (500.0, 2, 3), (2500.0, 0, 1), (0.0, 0, 1)]:
        p = SUPPORTED.wavenumbers_rad_m(frequency_hz)[place]
        shape = SUPPORTED.wave_shape(p, frequency_hz, y)
        np.testing.assert_allclose(shape, SUPPORTED.mode_shape(mode, y), atol=1e-13)


def test_an_antisymmetric_shape_keeps_its_digits_where_one_wave_across_is_flat() -> None:
    # x = z = a^2 / 2: the second wave across is a straight line; c such that this is a root
    a = 3.8
    compliance = (a / math.tan(a) - 1) / a**2
    strip = held(2 * PLATE.bending_stiffness_n_m / (compliance * PLATE.width_m))
    frequency_hz = a**2 / 2 * 4 / math.pi**2 * FIRST_HZ
    p = 1j * a / math.sqrt(2) / 0.0125
    assert abs(strip.wavenumbers_rad_m(frequency_hz, symmetry="antisymmetric") - p).min() < 1e-9
    y = np.array([0.002, 0.004, 0.021])
    inner = 1 - y / 0.0125
    exact = np.sin(a * inner) / math.sin(a) - inner
    shape = strip.wave_shape(p, frequency_hz, y, "antisymmetric")
    np.testing.assert_allclose(shape / shape[0], exact / exact[0], rtol=1e-12)


@pytest.mark.parametrize("slant", [0.0, 1e-3, -0.01])
@pytest.mark.parametrize("symmetric", [True, False])
def test_roots_between_clamps_from_the_table_are_those_sought_one_by_one(
    *, symmetric: bool, slant: float
) -> None:
    bending: Complex = 12.8 * np.sqrt(np.linspace(0.0, 1.0, 400)).astype(np.complex128)
    bending *= 1 + 1j * slant
    found = clamped_roots(bending, 7, symmetric=symmetric)
    sought = section_roots(bending, np.zeros_like(bending), 8, symmetric=symmetric)
    assert found is not None
    # of a pair the mean and the square of the half distance are what can be known
    for one, other in ((found, sought), (sought, found)):
        size = np.abs(other).reshape(len(bending), 4, 2).max(axis=2)
        means = [(x[:, ::2] + x[:, 1::2]) / 2 for x in (one, other)]
        squares = [((x[:, ::2] - x[:, 1::2]) / 2) ** 2 for x in (one, other)]
        assert np.max(np.abs(means[0] - means[1]) / size) < 1e-13
        assert np.max(np.abs(squares[0] - squares[1]) / size**2) < 1e-13
    if not slant:
        paired = np.sort_complex(found.conj()) == np.sort_complex(found)
        assert np.all(paired)


def test_beyond_the_table_roots_between_clamps_are_sought() -> None:
    for bending, count in ((13.0, 4), (1.0, 9), (1.0 + 0.02j, 4)):
        assert clamped_roots(np.array([bending + 0j]), count, symmetric=True) is None
