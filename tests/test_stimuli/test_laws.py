"""Laws that every field obeys, whichever solver computes it: edges, lengths, loads, frequencies."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    ForceRectangle,
    Load,
    PressureDisc,
    PressureRectangle,
    Strip,
    displacement,
    displacement_map,
    response,
)
from tests.test_stimuli.plates import (
    DISCS,
    EDGES,
    FIRM,
    PLATE,
    SOFT,
    SUPPORTED,
    Edge,
    W,
    at,
    bending_wavenumber_rad_m,
    disc,
    each_edge,
    every_edge,
    force,
    on,
    patch,
    scene_of,
    within,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray


MIDDLE = force()
FREE, HELD = SIMPLY_SUPPORTED, CLAMPED
LENGTHS_M = [None, pytest.param(0.05, marks=pytest.mark.slow)]
each_length = pytest.mark.parametrize("length_m", LENGTHS_M, ids=["endless", "50 mm"])
laws = settings(deadline=None, max_examples=20)
across = st.floats(0.02 * W, 0.98 * W)
drawn_fields = given(
    edge=st.sampled_from([*EDGES, SOFT]),
    y0=across,
    y=across,
    x=st.floats(0, 3 * W),
    f=st.one_of(st.just(0.0), st.floats(1.0, 40_000.0)),
    loss=st.sampled_from([0.0, 0.01, 0.5]),
)

# --- symmetry ------------------------------------------------------------------------------------


@pytest.mark.slow
@laws
@drawn_fields
def test_a_force_and_a_point_may_be_exchanged(
    edge: Edge, y0: float, y: float, x: float, f: float, loss: float
) -> None:
    strip = on(edge, loss=loss)
    there, own = at(strip, force(0.0, y0), [(x, y), (0.0, y0)], f)
    back = at(strip, force(x, y), [(0.0, y0)], f)[0]
    assert abs(there - back) < 1e-10 * max(abs(there), 1e-3 * abs(own))


@each_edge
@each_length
@pytest.mark.parametrize("frequency_hz", [0.0, 500.0, 5000.0, 30_000.0])
def test_so_it_is_between_ends(edge: Edge, length_m: float | None, frequency_hz: float) -> None:
    places = ((0.019, 0.004), (-0.006, 0.015))
    there, back = (
        at(on(edge, length_m), force(*a), [b], frequency_hz, 1e-8)[0]
        for a, b in (places, places[::-1])
    )
    assert abs(there - back) < 1e-7 * abs(there)


@laws
@drawn_fields
def test_the_field_is_mirrored_about_its_load_and_about_the_centre_line(
    edge: Edge, y0: float, y: float, x: float, f: float, loss: float
) -> None:
    load = patch(0.01, 1.9 * min(y0, W - y0), y_m=y0, kind=PressureRectangle)
    mirror = dataclasses.replace(load, y_m=W - y0)
    scene = scene_of(on(edge, loss=loss), (load, mirror), (x, y), (-x, y), (x, W - y))
    u = displacement(scene, [f], 1e-10)[0]
    assert u[0, 0] == u[0, 1]
    largest = np.max(np.abs(u))
    for value, image in ((u[0, 0], u[1, 2]), (u[1, 0], u[0, 2])):
        assert abs(value - image) < 1e-10 * max(abs(value), 1e-3 * largest)


# --- limits --------------------------------------------------------------------------------------


@every_edge
@pytest.mark.parametrize("length_m", [None, pytest.param(0.15, marks=pytest.mark.slow)])
def test_the_field_at_rest_is_the_limit_of_slow_vibration(
    edge: Edge, length_m: float | None
) -> None:
    scene = scene_of(on(edge, length_m), MIDDLE, (0.0, W / 2), (0.01, 0.01))
    u = displacement(scene, [0.0, 1e-9, 1e-3, 0.03, 20.0, 60.0], 1e-11)[:, 0]
    np.testing.assert_allclose(u[:4], u[:1].repeat(4, axis=0), rtol=1e-9)
    # the first correction is proportional to f^2
    np.testing.assert_allclose((u[5] - u[0]) / (u[4] - u[0]), 9.0, rtol=0.05)
    assert np.all(np.abs(u.imag) < 1e-11 * np.abs(u))


@pytest.mark.parametrize(("edge", "divisor"), [(FREE, 384 / 5), (HELD, 384.0)])
def test_a_long_pressure_at_rest_bends_the_strip_like_a_beam(edge: Edge, divisor: float) -> None:
    load = patch(2.0, W, kind=PressureRectangle)
    beam_m = W**4 / (divisor * PLATE.bending_stiffness_n_m)
    assert at(on(edge), load, [(0.1, W / 2)], 0.0)[0] == pytest.approx(beam_m, rel=1e-10)


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


@each_edge
def test_an_end_far_away_does_not_count(edge: Edge) -> None:
    load = patch(0.005, 0.015)
    near, far, endless = (
        displacement(scene_of(on(edge, m), load, (0.01, 0.01), skip=False), [100.0, 1500.0], 1e-9)
        for m in (0.4, 1.0, None)
    )
    np.testing.assert_allclose(near, endless, rtol=1e-8)
    np.testing.assert_allclose(far, endless, rtol=1e-8)


@pytest.mark.parametrize("frequency_hz", [0.0, 800.0, 15_000.0])
def test_patches_add_up(frequency_hz: float) -> None:
    parts = (patch(0.004, 0.005, x_m=x, y_m=y) for x in (-0.002, 0.002) for y in (0.01, 0.015))
    loads = (*parts, patch(0.008, 0.01))
    scene = scene_of(on(FIRM), loads, (0.0, 0.011), (0.004, 0.013), (0.03, 0.02))
    u = displacement(scene, [frequency_hz], 1e-11)[0]
    np.testing.assert_allclose(u[:4].sum(axis=0), u[4], rtol=1e-9)


@every_edge
def test_tiny_patches_act_like_a_point_force(edge: Edge) -> None:
    size_m = 1e-6 * W
    loads = (
        force(0.0, 0.01),
        patch(size_m, size_m, y_m=0.01, kind=PressureRectangle),
        disc(size_m, y_m=0.01, kind=PressureDisc),
        patch(size_m, size_m, y_m=0.01, kind=ForceRectangle),
    )
    u = displacement(scene_of(on(edge), loads, (0.004, 0.012)), [700.0], 1e-10)[0, :, 0]
    u /= [1, size_m**2, np.pi * size_m**2, 1]
    np.testing.assert_allclose(u[1:], u[0], rtol=1e-9)


# --- scaling and maps ----------------------------------------------------------------------------

LEFT, RIGHT = DISCS
ASIDE = patch(0.006, 0.012, x_m=0.01, y_m=0.009)
ALONG_M, ACROSS_M = 0.005 * np.arange(-20, 21), np.linspace(0.0, W, 11)


@settings(deadline=None, max_examples=10)
@given(
    larger=st.floats(0.2, 5.0),
    thicker=st.floats(0.3, 3.0),
    stiffer=st.floats(0.1, 10.0),
    edge=st.sampled_from(EDGES),
)
def test_a_map_in_widths_depends_on_k_times_the_width_only(
    larger: float, thicker: float, stiffer: float, edge: Edge
) -> None:
    """k^4 = rho h omega^2 / D, so that omega goes with h sqrt(E) / W^2; U D / W^2 is the same."""
    first = on(edge)
    if isinstance(edge, ElasticEdge):
        edge = ElasticEdge(stiffness_n=FIRM.stiffness_n * stiffer * thicker**3 / larger)
    modulus_pa = ALUMINIUM.youngs_modulus_pa * stiffer
    scaled = Strip(
        width_m=W * larger,
        thickness_m=PLATE.thickness_m * thicker,
        material=dataclasses.replace(ALUMINIUM, youngs_modulus_pa=modulus_pa),
        edge=edge,
    )
    wide = disc(0.0064 * larger, y_m=W / 2 * larger)
    x_m, y_m = ALONG_M[15:26], ACROSS_M[2:9]
    one = displacement_map(first, disc(), 1200.0, x_m=x_m, y_m=y_m, rtol=1e-9).displacement_m
    same_hz = 1200.0 * thicker * math.sqrt(stiffer) / larger**2
    places_m = {"x_m": x_m * larger, "y_m": y_m * larger}
    two = displacement_map(scaled, wide, same_hz, **places_m, rtol=1e-9).displacement_m
    factor = scaled.bending_stiffness_n_m / first.bending_stiffness_n_m / larger**2
    assert np.abs(two * factor - one).max() < 1e-8 * np.abs(one).max()


@each_edge
def test_maps_rest_at_the_edges_and_are_mirrored(edge: Edge) -> None:
    loads = (LEFT, RIGHT, ASIDE, dataclasses.replace(ASIDE, y_m=W - ASIDE.y_m))
    found = displacement_map(on(edge), loads, 5000.0, x_m=ALONG_M, y_m=ACROSS_M)
    assert not found.displacement_m[:, :, [0, -1]].any()
    assert np.all(found.displacement_m[:, :, 1:-1] != 0)
    left, right, aside, turned = found.displacement_m
    assert np.array_equal(left, right[::-1])
    assert np.array_equal(left, left[:, ::-1])
    assert np.array_equal(aside, turned[:, ::-1])


# --- equations -----------------------------------------------------------------------------------

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
    inertia = bending_wavenumber_rad_m(strip, frequency_hz) ** 4 * u[4, 4]
    scale = max(1.0, abs(stiffness) * float(np.max(np.abs(u))) / W**4)
    slack_pa = 2e-4 * scale + 1e-6 * abs(stiffness * inertia)
    assert abs(stiffness * (bilaplacian - inertia) - pressure_pa) < slack_pa


@every_edge
@pytest.mark.parametrize("frequency_hz", [0.0, 900.0, 9000.0])
def test_the_edges_neither_move_nor_rotate_beyond_their_spring(
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
    series = polyfit(y / W, u.reshape(n, 7).T, 6)
    terms = [polyfit(x / W, series[j], n - 1) for j in (0, 2)]
    bent = [2 * terms[0][2], 2 * terms[1][0]]
    sheared = [6 * terms[0][3], 2 * terms[1][1]]
    assert abs(bent[0] + nu * bent[1]) < 1e-4 * abs(bent[1])
    assert abs(sheared[0] + (2 - nu) * sheared[1]) < 1e-3 * max(abs(a) for a in sheared)


# --- power and loss ------------------------------------------------------------------------------


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


def test_loss_takes_power_from_the_wave_and_leaves_the_range_of_numbers_quietly() -> None:
    far = [(0.3, W / 2), (10.0, W / 2)]
    levels = [np.abs(at(on(HELD, loss=one), MIDDLE, far, 6000.0)) for one in (0.0, 0.001, 0.1)]
    assert levels[0][0] > levels[1][0] > levels[2][0]
    assert levels[1][1] > 0
    assert at(on(HELD, loss=0.01), MIDDLE, far, 500.0)[1] == 0
    for edge in EDGES:
        for f in (300.0, 6000.0):
            assert at(on(edge, loss=0.01), MIDDLE, [(0.0, W / 2)], f)[0].imag > 0


# --- what is left out ----------------------------------------------------------------------------

FINGERS = ((-0.035, W / 2), (0.035, W / 2))
BESIDE = ((-0.06, 0.0075), (-0.02, 0.0105), (0.03, 0.016), (0.06, W / 2))
"""Off the centre line at three distances, and on it."""
COUNTS = ("frequencies", "pairs", "symmetries", "integrals")


def test_two_discs_and_two_fingers_are_two_distances() -> None:
    work = scene_of(PLATE, DISCS, *FINGERS).work([300.0])
    assert (work.pairs_asked, work.pairs_solved) == (4, 2)
    assert (work.symmetries_asked, work.symmetries_solved) == (4, 1)
    assert (work.integrals_asked, work.integrals_solved) == (8, 1)
    points = ((float(x), float(y)) for x in ALONG_M for y in ACROSS_M)
    work = scene_of(PLATE, DISCS, *points).work([500.0], rtol=1e-4)
    assert work.pairs_solved < work.pairs_asked / 4
    for shift_m, pairs in ((0.0, 2), (0.005, 4)):  # mirror images, and none between ends
        points = ((x_m + shift_m, y_m) for x_m, y_m in ((-0.01, 0.01), (0.01, 0.015)))
        work = scene_of(on(HELD, 0.05), (force(-0.01), force(0.01)), *points).work([1000.0])
        assert work.pairs_solved == pairs
    loads = tuple(disc(0.004, x_m=x_m, y_m=y_m) for x_m, y_m in BESIDE)
    assert scene_of(on(FIRM, 0.2, loss=0.01), loads, *BESIDE).work([3000.0]).symmetries_solved == 7


def test_nothing_is_skipped_where_skip_is_false() -> None:
    sweep_hz = np.linspace(100.0, 1500.0, 200)
    work = scene_of(PLATE, DISCS, *FINGERS, skip=False).work(sweep_hz)
    assert (work.skipped, work.wall_correction) == ((), True)
    for name in COUNTS:
        assert getattr(work, f"{name}_asked") == getattr(work, f"{name}_solved")
    quick = scene_of(SUPPORTED, DISCS, *FINGERS).work(sweep_hz)
    assert (len(quick.skipped), quick.wall_correction) == (5, False)


@pytest.mark.slow
@each_edge
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-10])
@pytest.mark.parametrize("length_m", [None, 0.35])
def test_skipping_changes_the_counts_and_no_result(
    edge: Edge, rtol: float, length_m: float | None
) -> None:
    more: tuple[Load, ...] = (
        force(0.01, 0.006),
        patch(0.01, 0.01, kind=PressureRectangle),
        patch(0.006, 0.009, x_m=-0.02, y_m=0.017),
    )
    loads = DISCS if length_m else (*DISCS, *more)
    quick = scene_of(on(edge, length_m), loads, *FINGERS, (0.0, 0.004), (0.0, 0.021))
    sweep_hz = np.append(np.linspace(0.0, 1500.0, 40), [6000.0, 14000.0])
    if length_m:
        rtol, sweep_hz = max(rtol, 1e-7), sweep_hz[4:24]
    careful = dataclasses.replace(quick, skip=False)
    full, some = (response(scene, sweep_hz, rtol) for scene in (careful, quick))
    for name in (*COUNTS[1:], "reflections" if length_m else "frequencies"):
        assert getattr(some.work, f"{name}_solved") < getattr(full.work, f"{name}_solved")
    assert full.work.reflections_asked == full.work.reflections_solved
    assert (full.work.reflections_solved > 0) == (length_m is not None)
    assert within(some.displacement_m, full.displacement_m, rtol, axis=(1, 2))


@each_edge
@pytest.mark.parametrize("length_m", [None, 0.2])
@pytest.mark.parametrize("across_m", [0.0, 0.006])
def test_loads_in_different_places_across_give_what_each_gives_alone(
    edge: Edge, length_m: float | None, across_m: float
) -> None:
    last = BESIDE[-1] if length_m is None else (0.092, 0.006)  # too near the end for waves alone
    loads = tuple(
        patch(0.005, across_m, x_m=x_m, y_m=y_m) if across_m else disc(0.004, x_m=x_m, y_m=y_m)
        for x_m, y_m in (*BESIDE[:3], last)
    )
    points = (-0.06, 0.0075), (0.03, W / 2), (0.045, 0.005)
    scene = scene_of(on(edge, length_m, loss=0.01), loads, *points)
    found = response(scene, [1700.0], rtol := 1e-5)
    for number, load in enumerate(loads):
        single = response(dataclasses.replace(scene, loads=(load,)), [1700.0], rtol)
        apart = np.abs(found.displacement_m[:, number] - single.displacement_m[:, 0])
        assert np.all(apart <= found.error_m[:, number] + single.error_m[:, 0])
        assert within(found.displacement_m[:, number], single.displacement_m[:, 0], rtol)


@pytest.mark.parametrize("length_m", [None, 0.2])
def test_loads_never_driven_are_not_computed_and_do_not_move(length_m: float | None) -> None:
    loads = (disc(), patch(), disc(x_m=0.07))
    strip = on(FREE, length_m, viscous_s=8e-7)
    every = scene_of(strip, loads, (0.0, W / 2), (0.07, W / 2))
    some = dataclasses.replace(every, driven=(True, False, True))
    full = dataclasses.replace(some, skip=False)
    lean, careful, all_three = (displacement(one, [300.0, 2500.0]) for one in (some, full, every))
    assert np.all(lean[:, 1] == 0)
    np.testing.assert_allclose(lean, careful, rtol=1e-6)
    np.testing.assert_array_equal(lean[:, ::2], all_three[:, ::2])
    works = [scene.work([300.0]) for scene in (some, full, every)]
    assert works[0].pairs_solved < works[1].pairs_solved
    still = dataclasses.replace(every, driven=(False,) * 3)
    assert not displacement(still, [0.0, 300.0]).any()


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
    with pytest.raises(ValueError, match=rf"cut-off.* mode {mode}\b"):
        displacement(bare, [500.0, cutoff_hz])
