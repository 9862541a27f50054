"""The strip: published cut-offs, the equations it must satisfy, its limits."""

from __future__ import annotations

import dataclasses
import math
from decimal import Decimal, localcontext
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stimuli import ALUMINIUM, CLAMPED, SIMPLY_SUPPORTED, ElasticEdge, IdealEdge, Material, Strip
from tests.test_stimuli import plates
from tests.test_stimuli.plates import SUPPORTED as PLATE
from tests.test_stimuli.plates import Edge

PI = Decimal("3.14159265358979323846264338327950288419716939937510582")

modes = st.integers(1, 200)
stiffnesses_n = st.floats(-9, 12).map(lambda exponent: 10.0**exponent)
laws = settings(deadline=None, max_examples=60)


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


def lossy(loss: float, viscous_s: float = 0.0) -> Strip:
    return plates.on(SIMPLY_SUPPORTED, loss=loss, viscous_s=viscous_s)


def bending_wavenumber(strip: Strip, frequency_hz: float) -> float:
    inertia = strip.material.density_kg_m3 * strip.thickness_m / strip.bending_stiffness_n_m
    return float(inertia**0.25 * math.sqrt(2 * math.pi * frequency_hz))


# --- cut-offs ------------------------------------------------------------------------------------


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


def test_the_paper_prints_its_cutoff_as_1_9_khz_and_67_mpa_would_give_61_hz() -> None:
    assert round(PLATE.cutoff_hz() / 1e3, 1) == 1.9
    misprint = dataclasses.replace(ALUMINIUM, youngs_modulus_pa=67e6)
    assert round(dataclasses.replace(PLATE, material=misprint).cutoff_hz()) == 61
    assert PLATE.bending_stiffness_n_m == pytest.approx(0.792831252944125608, rel=1e-15)


@laws
@given(strip=strips(), stiffness_n=stiffnesses_n, mode=modes)
def test_a_cutoff_solves_the_edge_equation(strip: Strip, stiffness_n: float, mode: int) -> None:
    held = on(ElasticEdge(stiffness_n=stiffness_n), strip)
    z = bending_wavenumber(held, held.cutoff_hz(mode)) * strip.width_m / 2
    spring = 4 * z * strip.bending_stiffness_n_m / (stiffness_n * strip.width_m)
    hyperbolic = math.tanh(z) if mode % 2 else 1 / math.tanh(z)
    # 2k/kappa + tan + tanh = 0 and 2k/kappa + coth - cot = 0 times the missing cosine and sine
    root = math.cos(z) if mode % 2 else math.sin(z)
    other = math.sin(z) if mode % 2 else -math.cos(z)
    residual = (spring + hyperbolic) * root + other
    assert abs(residual) < 1e-14 * z * (1 + spring)


@laws
@given(strip=strips(), stiffness_n=stiffnesses_n, mode=modes)
def test_every_elastic_edge_lies_between_its_two_limits(
    strip: Strip, stiffness_n: float, mode: int
) -> None:
    elastic_hz = on(ElasticEdge(stiffness_n=stiffness_n), strip).cutoff_hz(mode)
    assert strip.cutoff_hz(mode) <= elastic_hz <= on(CLAMPED, strip).cutoff_hz(mode)
    assert on(CLAMPED, strip).cutoff_hz(mode) < strip.cutoff_hz(mode + 1)


@laws
@given(stiffness_n=st.floats(1e-3, 1e6), factor=st.floats(1.001, 1e3), mode=modes)
def test_a_stiffer_edge_raises_every_cutoff(stiffness_n: float, factor: float, mode: int) -> None:
    soft, stiff = (ElasticEdge(stiffness_n=k) for k in (stiffness_n, factor * stiffness_n))
    assert on(soft).cutoff_hz(mode) < on(stiff).cutoff_hz(mode)


@pytest.mark.parametrize("mode", [1, 2, 7, 200])
def test_springs_reach_both_ideal_edges(mode: int) -> None:
    assert on(ElasticEdge(stiffness_n=0.0)).cutoff_hz(mode) == PLATE.cutoff_hz(mode)
    stiff_hz = on(ElasticEdge(stiffness_n=1e300)).cutoff_hz(mode)
    assert stiff_hz == on(CLAMPED).cutoff_hz(mode)


@laws
@given(strip=strips(), factor=st.floats(0.1, 10.0), mode=modes, edge=st.sampled_from(IdealEdge))
def test_cutoffs_scale_as_thickness_over_squared_width(
    strip: Strip, factor: float, mode: int, edge: IdealEdge
) -> None:
    scaled = dataclasses.replace(
        strip, width_m=factor * strip.width_m, thickness_m=factor * strip.thickness_m, edge=edge
    )
    ratio = scaled.cutoff_hz(mode) / on(edge, strip).cutoff_hz(mode)
    assert ratio == pytest.approx(1 / factor, rel=1e-13)


def test_cutoffs_are_those_of_the_strip_without_loss_and_without_ends() -> None:
    for edge in plates.EDGES:
        assert plates.on(edge, 0.2, loss=0.1, viscous_s=1e-5).cutoff_hz() == on(edge).cutoff_hz()


# --- the edge of a measured cut-off --------------------------------------------------------------


@pytest.mark.parametrize(
    ("cutoff_hz", "stiffness_n"),
    [(2900.0, 141.72083994908), (2500.0, 63.9264884979218), (3146.0, 216.264198092798809)],
)
def test_measured_cutoffs_have_their_known_stiffness(cutoff_hz: float, stiffness_n: float) -> None:
    edge = PLATE.with_cutoff(cutoff_hz).edge
    assert isinstance(edge, ElasticEdge)
    assert edge.lossless
    assert edge.stiffness_n == pytest.approx(stiffness_n, rel=1e-12)


@laws
@given(strip=strips(), place=st.floats(1e-12, 1 - 1e-12))
def test_the_edge_found_has_the_cutoff_asked_for(strip: Strip, place: float) -> None:
    low_hz, high_hz = strip.cutoff_hz(), on(CLAMPED, strip).cutoff_hz()
    wanted_hz = low_hz + place * (high_hz - low_hz)
    assert strip.with_cutoff(wanted_hz).cutoff_hz() == pytest.approx(wanted_hz, rel=1e-13)


def test_every_cutoff_inside_the_range_has_a_finite_edge() -> None:
    low_hz, high_hz = PLATE.cutoff_hz(), on(CLAMPED).cutoff_hz()
    for wanted_hz in (math.nextafter(low_hz, high_hz), math.nextafter(high_hz, low_hz)):
        assert PLATE.with_cutoff(wanted_hz).cutoff_hz() == pytest.approx(wanted_hz, rel=1e-13)


def test_one_cutoff_does_not_tell_a_spring_from_a_wider_clamped_strip() -> None:
    spring = PLATE.with_cutoff(2900.0)
    wider_m = PLATE.width_m * math.sqrt(on(CLAMPED).cutoff_hz() / 2900.0)
    wide = dataclasses.replace(PLATE, width_m=wider_m, edge=CLAMPED)
    assert wide.cutoff_hz() == pytest.approx(spring.cutoff_hz(), rel=1e-13)
    assert abs(wide.cutoff_hz(2) / spring.cutoff_hz(2) - 1) > 0.05


# --- wavenumbers ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("frequency_hz", "symmetry", "place", "wavenumber"),
    [
        # closed forms, 18 digits
        (500.0, "symmetric", 0, 108.129134169299324j),
        (500.0, "symmetric", 1, 141.034834091736404j),
        (500.0, "antisymmetric", 0, 243.034999087438548j),
        (2500.0, "symmetric", 0, 68.5997076229937164 + 0j),
        (2500.0, "symmetric", 1, 190.495810897369000j),
        (2500.0, "antisymmetric", 0, 206.562777961734188j),
    ],
)
def test_the_papers_plate_has_its_known_wavenumbers(
    frequency_hz: float, symmetry: Any, place: int, wavenumber: complex
) -> None:
    p = PLATE.wavenumbers_rad_m(frequency_hz, symmetry=symmetry)[place]
    assert p.real == pytest.approx(wavenumber.real, rel=1e-14, abs=0)
    assert p.imag == pytest.approx(wavenumber.imag, rel=1e-14, abs=0)


@laws
@given(
    strip=strips(),
    cutoffs=st.floats(0.0, 200.0),
    loss=st.sampled_from([0.0, 1e-12, 0.01, 1.0]),
    symmetry=st.sampled_from(["symmetric", "antisymmetric"]),
    n_modes=st.integers(1, 30),
)
def test_wavenumbers_are_outgoing_ordered_and_solve_the_plate_equation(
    strip: Strip, cutoffs: float, loss: float, symmetry: Any, n_modes: int
) -> None:
    strip = dataclasses.replace(
        strip, material=dataclasses.replace(strip.material, loss_factor=loss)
    )
    frequency_hz = cutoffs * strip.cutoff_hz()
    p = strip.wavenumbers_rad_m(frequency_hz, n_modes=n_modes, symmetry=symmetry)
    assert p.shape == (n_modes,)
    assert np.all((p.imag > 0) | ((p.imag == 0) & (p.real > 0)) | (p == 0))
    order = list(zip(p.imag, -p.real, strict=True))
    assert order == sorted(order)
    # (p^2 + q^2)^2 = k^4 for one q of the asked symmetry
    first = 1 if symmetry == "symmetric" else 2
    q = np.pi / strip.width_m * np.arange(first, first + 2 * n_modes, 2)
    k4 = bending_wavenumber(strip, frequency_hz) ** 4 / (1 - 1j * loss)
    residual = np.abs((p[:, np.newaxis] ** 2 + q**2) ** 2 - k4)
    assert np.all(np.min(residual / (abs(k4) + q**4), axis=1) < 1e-12)


@pytest.mark.parametrize("detuning", [1e-3, -1e-3, 1e-9, -1e-9, 1e-14, -1e-14])
def test_wavenumbers_near_a_cutoff_keep_all_the_digits_of_the_inputs(detuning: float) -> None:
    frequency_hz = PLATE.cutoff_hz(3) * (1 + detuning)
    with localcontext(prec=60):
        young, nu = Decimal(67_000_000_000), Decimal(ALUMINIUM.poisson_ratio)
        h, q = Decimal(PLATE.thickness_m), 3 * PI / Decimal(PLATE.width_m)
        stiffness = young * h**3 / (12 * (1 - nu**2))
        k2 = 2 * PI * Decimal(frequency_hz) * (2700 * h / stiffness).sqrt()
        expected = float(abs(k2 - q * q).sqrt())
    p = PLATE.wavenumbers_rad_m(frequency_hz, n_modes=6)
    nearest = p[np.argmin(np.abs(p))] if detuning < 0 else p[1]
    assert abs(nearest) == pytest.approx(expected, rel=4e-15)
    assert (nearest.real > 0) == (detuning > 0)


def test_propagating_waves_come_first_and_the_largest_of_them_before_all() -> None:
    p = PLATE.wavenumbers_rad_m(1.01 * PLATE.cutoff_hz(5), n_modes=5)
    assert np.all(p[:3].imag == 0)
    assert p[0].real > p[1].real > p[2].real > 0
    assert np.all(p[3:].real == 0)
    assert np.all(np.diff(p[2:].imag) > 0)


def test_at_rest_both_branches_decay_with_the_mode_number() -> None:
    p = PLATE.wavenumbers_rad_m(0.0, n_modes=6)
    q = np.pi / PLATE.width_m * np.array([1, 1, 3, 3, 5, 5])
    np.testing.assert_allclose(p, 1j * q, rtol=1e-15)


def test_viscous_loss_is_hysteretic_loss_at_one_frequency() -> None:
    viscous, hysteretic = lossy(0.0, 0.01 / (2 * math.pi * 800.0)), lossy(0.01)
    p = viscous.wavenumbers_rad_m(800.0)
    np.testing.assert_allclose(p, hysteretic.wavenumbers_rad_m(800.0), rtol=1e-15)


def test_a_spring_of_no_stiffness_is_a_simple_support_for_the_wavenumbers_too() -> None:
    p = on(ElasticEdge(stiffness_n=0.0)).wavenumbers_rad_m(500.0)
    np.testing.assert_array_equal(p, PLATE.wavenumbers_rad_m(500.0))


# --- mode shapes ---------------------------------------------------------------------------------


@given(mode=modes)
@laws
def test_mode_shapes_vanish_on_both_edges_and_alternate_in_symmetry(mode: int) -> None:
    y = np.linspace(0.0, PLATE.width_m, 41)
    shape = PLATE.mode_shape(mode, y)
    assert shape[0] == shape[-1] == 0.0
    parity = 1 if mode % 2 else -1
    np.testing.assert_allclose(shape[::-1], parity * shape, atol=1e-12)
    np.testing.assert_allclose(shape, np.sin(mode * np.pi * y / PLATE.width_m), atol=1e-12)
