"""Laws that every field obeys, whichever method computes it: edges, lengths, loads, frequencies.

Two sides of a law agree within the errors that are told of both: laws test those as well.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    Estimate,
    ForceRectangle,
    Load,
    PressureDisc,
    PressureRectangle,
    Scene,
    Strip,
    displacement,
    displacement_map,
    response,
)
from stimuli.errors import PlateError, Rule
from tests.test_stimuli.plates import (
    DISCS,
    EDGES,
    FIRM,
    PLATE,
    SOFT,
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
)
from tests.test_stimuli.scenes import check_drawn_scene, drawn_strip

if TYPE_CHECKING:
    from stimuli.arrays import Complex

MIDDLE = force()
FREE, HELD = SIMPLY_SUPPORTED, CLAMPED
each_length = pytest.mark.parametrize(
    "length_m", [None, pytest.param(0.05, marks=pytest.mark.slow)], ids=["endless", "50 mm"]
)


def check_alike(one: Estimate[Complex], other: Estimate[Complex], factor: float = 1.0) -> None:
    """Two fields agree within their errors, and those tell something."""
    apart_m = np.abs(one.value - factor * other.value)
    assert np.all(apart_m <= one.error + abs(factor) * other.error)
    assert np.max(one.error) < 0.08 * np.max(np.abs(one.value))


def sums(fields: Estimate[Complex], parts: int) -> tuple[Estimate[Complex], Estimate[Complex]]:
    """Return the sum of the first loads' fields, and the field of the last one."""
    both = ((slice(parts), np.sum), (slice(parts, None), np.sum))
    first, last = (
        Estimate(
            value=add(fields.value[:, some], axis=1),
            error=add(fields.error[:, some], axis=1),
            work=(),
        )
        for some, add in both
    )
    return first, last


@pytest.mark.parametrize("first", range(0, 60, 10))
def test_no_drawn_scene_has_nan_or_a_warning_and_all_are_as_their_mirror_images(first: int) -> None:
    finite = [check_drawn_scene(seed) for seed in range(first, first + 10)]
    assert np.mean(finite) > 0.5


# --- symmetry ------------------------------------------------------------------------------------


@each_edge
@each_length
@pytest.mark.parametrize("frequency_hz", [0.0, 500.0, 5000.0, 30_000.0])
def test_a_force_and_a_point_may_be_exchanged(
    edge: Edge, length_m: float | None, frequency_hz: float
) -> None:
    places = ((0.019, 0.004), (-0.006, 0.015))
    strip = on(edge, length_m, loss=0.01)
    there, back = (at(strip, force(*a), [b], frequency_hz) for a, b in (places, places[::-1]))
    assert abs(there.value - back.value)[0] <= (there.error + back.error)[0]


@each_edge
@each_length
def test_a_disc_moves_the_mean_over_another_as_that_one_moves_its_own(
    edge: Edge, length_m: float | None
) -> None:
    """The mean displacement over an area, by an equal force on another: either way the same."""
    areas = [
        patch(0.006, 0.008, x_m=x_m, y_m=y_m, kind=ForceRectangle)
        for x_m, y_m in ((-0.01, 0.009), (0.012, 0.014))
    ]
    nodes, weights = np.polynomial.legendre.leggauss(6)
    means = []
    for load, area in (areas, areas[::-1]):
        points = [(area.x_m + 0.003 * a, area.y_m + 0.004 * b) for a in nodes for b in nodes]
        means.append(at(on(edge, length_m), load, points, 900.0).value @ np.kron(weights, weights))
    assert means[0] == pytest.approx(means[1], rel=2e-4)


@each_edge
@each_length
def test_maps_rest_at_the_edges_and_are_mirrored(edge: Edge, length_m: float | None) -> None:
    aside = patch(0.006, 0.012, x_m=0.01, y_m=0.009)
    left, right = (disc(0.005, x_m=x_m) for x_m in (-0.015, 0.015))
    loads = (left, right, aside, dataclasses.replace(aside, y_m=W - aside.y_m))
    along_m, across_m = 0.004 * np.arange(-6, 7), np.linspace(0.0, W, 9)
    found = displacement_map(on(edge, length_m), loads, 5000.0, x_m=along_m, y_m=across_m)
    assert found.value.shape == found.error.shape == (4, 13, 9)
    assert not found.value[:, :, [0, -1]].any()
    assert np.all(found.value[:, :, 1:-1] != 0)
    left_m, right_m, aside_m, turned_m = found.value
    slack_m = 2 * np.max(found.error)
    for one_m, image_m in ((left_m, right_m[::-1]), (left_m, left_m[:, ::-1])):
        assert np.max(np.abs(one_m - image_m)) < 1e-6 * np.max(np.abs(one_m))
    assert np.max(np.abs(aside_m - turned_m[:, ::-1])) < slack_m


# --- superposition, scaling ----------------------------------------------------------------------


@each_edge
@each_length
@pytest.mark.parametrize("frequency_hz", [0.0, 800.0, 15_000.0])
def test_four_quarters_of_a_patch_are_the_patch(
    edge: Edge, length_m: float | None, frequency_hz: float
) -> None:
    parts = (patch(0.004, 0.005, x_m=x, y_m=y) for x in (-0.002, 0.002) for y in (0.01, 0.015))
    loads = (*parts, patch(0.008, 0.01))
    scene = scene_of(
        on(edge, length_m, loss=0.02), loads, (0.0, 0.011), (0.006, 0.013), (0.02, 0.02)
    )
    check_alike(*sums(response(scene, [frequency_hz]), 4))


@each_edge
@each_length
def test_a_disc_is_the_limit_of_slices(edge: Edge, length_m: float | None) -> None:
    """Sixteen rectangles with the areas of a disc's slices, seen away from its rim."""
    radius_m, n = 0.006, 16
    ends = radius_m * np.sin(np.pi * (np.arange(n + 1) / n - 0.5))
    antiderivative = ends * np.sqrt(radius_m**2 - ends**2) + radius_m**2 * np.arcsin(
        ends / radius_m
    )
    slices = [
        patch(high - low, area / (high - low), x_m=(low + high) / 2, kind=PressureRectangle)
        for low, high, area in zip(ends, ends[1:], np.diff(antiderivative), strict=False)
    ]
    loads = (*slices, disc(radius_m, kind=PressureDisc))
    points = ((0.0, W / 2), (0.015, W / 2), (0.02, 0.006))
    u = displacement(scene_of(on(edge, length_m, loss=0.01), loads, *points), [1200.0])[0]
    np.testing.assert_allclose(u[:n].sum(axis=0), u[n], rtol=3e-3)


@every_edge
@each_length
def test_small_loads_act_like_a_point_force(edge: Edge, length_m: float | None) -> None:
    size_m = 1e-3 * W
    loads = (
        force(0.0, 0.01),
        patch(size_m, size_m, y_m=0.01, kind=PressureRectangle),
        disc(size_m, y_m=0.01, kind=PressureDisc),
        patch(size_m, size_m, y_m=0.01, kind=ForceRectangle),
    )
    u = displacement(scene_of(on(edge, length_m), loads, (0.009, 0.014)), [700.0])[0, :, 0]
    u /= [1, size_m**2, np.pi * size_m**2, 1]
    np.testing.assert_allclose(u[1:], u[0], rtol=3e-4)


@pytest.mark.parametrize("seed", range(12))
def test_a_field_in_widths_depends_on_k_times_the_width_only(seed: int) -> None:
    """k^4 = rho h omega^2 / D, so that omega goes with sqrt(D / (rho h)) / W^2, and U D / W^2."""
    rng = np.random.default_rng(seed)
    first = dataclasses.replace(drawn_strip(rng), length_m=None if seed % 2 else 0.08)
    first = dataclasses.replace(first, width_m=0.02)
    larger, thicker, stiffer, denser = 10 ** rng.uniform(-0.5, 0.5, 4)
    edge = first.edge
    if isinstance(edge, ElasticEdge):
        stiffness_n = edge.stiffness_n * stiffer * thicker**3 / larger
        edge = dataclasses.replace(edge, stiffness_n=stiffness_n)
    material = dataclasses.replace(
        first.material,
        youngs_modulus_pa=first.material.youngs_modulus_pa * stiffer,
        density_kg_m3=first.material.density_kg_m3 * denser,
    )
    second = Strip(
        width_m=first.width_m * larger,
        thickness_m=first.thickness_m * thicker,
        material=material,
        edge=edge,
        length_m=first.length_m and first.length_m * larger,
    )
    frequency_hz = first.cutoff_hz() * rng.uniform(0.1, 3)
    same_hz = frequency_hz * thicker * math.sqrt(stiffer / denser) / larger**2
    fields = []
    for strip, size, hz in ((first, 1.0, frequency_hz), (second, larger, same_hz)):
        load = disc(0.004 * size, y_m=0.009 * size)
        points = [(x * size, y * size) for x, y in ((0.0, 0.009), (0.013, 0.012), (-0.03, 0.004))]
        fields.append(at(strip, load, points, hz))
    factor = second.bending_stiffness_n_m / first.bending_stiffness_n_m / larger**2
    largest_m = np.max(np.abs(fields[0].value))
    np.testing.assert_allclose(fields[1].value * factor, fields[0].value, atol=1e-6 * largest_m)


# --- limits --------------------------------------------------------------------------------------


@every_edge
@each_length
def test_the_field_at_rest_is_the_limit_of_slow_vibration(
    edge: Edge, length_m: float | None
) -> None:
    scene = scene_of(on(edge, length_m), disc(), (0.0, W / 2), (0.01, 0.01))
    u = displacement(scene, [0.0, 1e-9, 1e-3, 0.03, 60.0, 180.0])[:, 0]
    np.testing.assert_allclose(u[:4], u[:1].repeat(4, axis=0), rtol=3e-6)
    # the first correction is proportional to f^2
    np.testing.assert_allclose((u[5] - u[0]) / (u[4] - u[0]), 9.0, rtol=0.2)
    assert np.all(np.abs(u.imag) < 1e-9 * np.abs(u))


@pytest.mark.parametrize(("edge", "divisor"), [(FREE, 384 / 5), (HELD, 384.0)])
def test_a_long_pressure_at_rest_bends_the_strip_like_a_beam(edge: Edge, divisor: float) -> None:
    load = patch(2.0, W, kind=PressureRectangle)
    beam_m = W**4 / (divisor * PLATE.bending_stiffness_n_m)
    assert at(on(edge), load, [(0.1, W / 2)], 0.0).value[0] == pytest.approx(beam_m, rel=1e-5)


@each_length
@pytest.mark.parametrize("frequency_hz", [0.0, 3000.0])
def test_springs_reach_both_ideal_edges(length_m: float | None, frequency_hz: float) -> None:
    def moved(edge: Edge) -> Estimate[Complex]:
        load, strip = patch(0.006, 0.012, y_m=0.01), on(edge, length_m, loss=0.01)
        return at(strip, load, ((0.0, 0.009), (0.015, 0.009)), frequency_hz)

    for edge, stiffnesses_n in ((FREE, (1e-3, 1e-5, 1e-9)), (HELD, (1e6, 1e8, 1e14))):
        ideal = moved(edge)
        springs = [moved(ElasticEdge(stiffness_n=k)).value for k in stiffnesses_n]
        errors = np.abs(np.array(springs) / ideal.value - 1)
        assert np.all(errors[0] < 1e-2)
        assert np.all(errors[1] < 2e-2 * errors[0] + 1e-6)
        assert np.all(errors[2] < 2e-6)


@every_edge
@pytest.mark.parametrize(
    "frequency_hz", [400.0, *(pytest.param(f, marks=pytest.mark.slow) for f in (0.0, 1500.0))]
)
def test_a_long_plate_by_its_modes_is_an_endless_one_by_its_waves(
    edge: Edge, frequency_hz: float
) -> None:
    """Below the cut-off its ends do not count; with loss they do not above it either."""
    for load in (disc(0.005, y_m=0.011), patch(0.006, 0.012), force(0.0, 0.009)):
        points = ((0.0, 0.011), (0.008, 0.01), (0.03, 0.015))
        bounded, endless = (
            at(on(edge, m, loss=0.01), load, points, frequency_hz) for m in (0.3, None)
        )
        check_alike(bounded, endless)


# --- equations -----------------------------------------------------------------------------------


@every_edge
@each_length
@pytest.mark.parametrize("frequency_hz", [0.0, 900.0, 9000.0])
def test_the_edges_neither_move_nor_rotate_beyond_their_spring(
    edge: Edge, length_m: float | None, frequency_hz: float
) -> None:
    strip, step_m = on(edge, length_m), 2e-4
    points = tuple((0.012, step_m * n) for n in range(9))
    u = at(strip, disc(0.006, x_m=-0.004, y_m=0.015), points, frequency_hz).value
    series = np.polynomial.polynomial.polyfit(np.arange(9), u.real / abs(u[8]), 7)
    slope, curvature = series[1], 2 * series[2]
    assert abs(series[0]) < 1e-8
    if edge is HELD:
        assert abs(slope) < 1e-4
    else:
        stiffness_n = edge.stiffness_n if isinstance(edge, ElasticEdge) else 0.0
        hold = stiffness_n * step_m / strip.bending_stiffness_n_m
        assert curvature == pytest.approx(hold * slope, abs=2e-4)


@each_edge
@each_length
def test_the_plate_equation_holds_outside_the_load(edge: Edge, length_m: float | None) -> None:
    """By differences over 5 mm: D (bilaplacian - k^4) U = 0."""
    strip, frequency_hz, n = on(edge, length_m, loss=0.02), 9000.0, 9
    nodes = np.cos(np.pi * (np.arange(n) + 0.5) / n)
    x0_m, y0_m, reach_m = 0.014, 0.013, 0.004
    points = tuple((x0_m + reach_m * a, y0_m + reach_m * b) for a in nodes for b in nodes)
    u = at(strip, disc(0.004, x_m=0.0), points, frequency_hz).value.reshape(n, n)
    to_series = np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, n - 1))
    series = np.polynomial.chebyshev.cheb2poly

    def derivatives(order: int) -> Any:
        terms = [series(to_series[:, place]) for place in range(n)]
        return np.array([term[order] * math.factorial(order) for term in terms]) / reach_m**order

    zeroth, second, fourth = (derivatives(order) for order in (0, 2, 4))
    bilaplacian = fourth @ u @ zeroth + zeroth @ u @ fourth + 2 * second @ u @ second
    inertia = bending_wavenumber_rad_m(strip, frequency_hz) ** 4 * (zeroth @ u @ zeroth)
    assert abs(bilaplacian - inertia) < 0.02 * abs(inertia)


@each_edge
@pytest.mark.parametrize("frequency_hz", [800.0, 5000.0])
def test_ends_bear_no_moment(edge: Edge, frequency_hz: float) -> None:
    """u_xx + nu u_yy = 0 at an end, from differences over 4 mm."""
    nu, y0_m, n = 0.346, 0.011, 9
    x, y = -0.5e-3 * np.arange(n), 0.5e-3 * np.arange(-3, 4)
    points_m = tuple((0.025 + a, y0_m + b) for a in x for b in y)
    u = at(on(edge, 0.05, loss=0.01), force(0.005, 0.008), points_m, frequency_hz).value
    polyfit = np.polynomial.polynomial.polyfit
    series = polyfit(y / W, u.reshape(n, 7).T, 5)
    bent = 2 * polyfit(x / W, series[0], 6)[2], 2 * series[2, 0]
    assert abs(bent[0] + nu * bent[1]) < 0.04 * abs(bent[1])


# --- power and loss ------------------------------------------------------------------------------


@pytest.mark.parametrize(("edge", "f"), [(FREE, 3000.0), (FIRM, 4100.0), (HELD, 6000.0)])
def test_above_cutoff_the_input_power_is_carried_away(edge: Edge, f: float) -> None:
    """By the waves of either side: their energy per length times the group velocity."""
    strip = on(edge)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    y = W * (nodes + 1) / 2
    far_m, step_m, step_hz = 0.5, 1e-3, 2.0
    points = [(0.0, W / 2), (far_m, W / 2), (far_m + step_m, W / 2), *((far_m, v) for v in y)]
    scene = scene_of(strip, disc(kind=PressureDisc), *points[1:])
    u = displacement(scene, [f - step_hz, f, f + step_hz])[:, 0]
    # power goes in where the pressure moves the disc: the mean over it
    radii_m, angles = 0.0064 * np.sqrt(nodes[:16] * 0 + (np.arange(16) + 0.5) / 16), np.arange(32)
    inside = [
        (r * math.cos(math.pi * a / 16), W / 2 + r * math.sin(math.pi * a / 16))
        for r in radii_m.tolist()
        for a in angles.tolist()
    ]
    mean_m = np.mean(displacement(scene_of(strip, disc(kind=PressureDisc), *inside), [f]))
    omega = 2 * np.pi * f
    power_in = omega / 2 * math.pi * 0.0064**2 * mean_m.imag
    p = np.angle(u[:, 1] / u[:, 0]) / step_m
    group_m_s = 2 * np.pi * 2 * step_hz / (p[2] - p[0])
    areal = strip.material.density_kg_m3 * strip.thickness_m
    energy_j_m = areal * omega**2 / 2 * (np.abs(u[1, 2:]) ** 2 @ weights) * W / 2
    assert power_in == pytest.approx(2 * group_m_s * energy_j_m, rel=1e-3)


@each_edge
@pytest.mark.parametrize("frequency_hz", [5000.0, 9000.0])
def test_without_loss_the_ends_turn_all_power_back(edge: Edge, frequency_hz: float) -> None:
    value, endless = (
        at(on(edge, length_m), force(0.004), [(0.004, W / 2)], frequency_hz).value[0]
        for length_m in (0.05, None)
    )
    assert abs(endless.imag) > 0.1 * abs(endless)
    assert abs(value.imag) < 1e-9 * abs(value)


@each_length
def test_loss_takes_power_at_any_frequency(length_m: float | None) -> None:
    for edge in (*EDGES, SOFT):
        scene = scene_of(on(edge, length_m, loss=0.01), force(), (0.0, W / 2))
        assert np.all(displacement(scene, np.geomspace(30.0, 30_000.0, 12)).imag > 0)


def test_far_waves_fall_with_loss_and_leave_the_range_of_numbers_quietly() -> None:
    far = [(0.3, W / 2), (10.0, W / 2)]
    levels = [np.abs(at(on(HELD, loss=a), MIDDLE, far, 6000.0).value) for a in (0.0, 0.001, 0.1)]
    assert levels[0][0] > levels[1][0] > levels[2][0]
    assert levels[1][1] > 0
    assert at(on(HELD, loss=0.01), MIDDLE, far, 500.0).value[1] == 0


# --- sweeps and several loads --------------------------------------------------------------------


@each_edge
@each_length
@pytest.mark.parametrize("loss", [0.0, 0.01])
def test_a_sweep_is_what_its_frequencies_are_alone(
    edge: Edge, length_m: float | None, loss: float
) -> None:
    """In any order, some twice, at rest too; the basis follows the highest one."""
    strip = on(edge, length_m, loss=loss)
    loads = (force(0.0, 0.008), disc(0.003, x_m=0.01, y_m=0.017, kind=PressureDisc))
    scene = scene_of(strip, loads, (0.0, W / 2), (0.02, 0.0075))
    sweep_hz = [3000.0, 0.0, 700.0, 3000.0, 11_000.0, 1500.0]
    sweep = response(scene, sweep_hz)
    assert sweep.value.shape == sweep.error.shape == (6, 2, 2)
    assert sweep.value.dtype == np.complex128
    np.testing.assert_array_equal(sweep.value[0], sweep.value[3])
    for place in (1, 2, 5):
        single = response(scene, [sweep_hz[place]])
        apart_m = np.abs(sweep.value[place] - single.value[0])
        assert np.all(apart_m <= sweep.error[place] + single.error[0])


@each_edge
@each_length
def test_loads_together_do_what_each_does_alone(edge: Edge, length_m: float | None) -> None:
    loads: tuple[Load, ...] = (
        disc(0.004, x_m=-0.015, y_m=0.0075),
        patch(0.006, 0.009, x_m=0.01, y_m=0.017),
        force(-0.01, 0.006),
        disc(0.004, x_m=0.015, y_m=0.0075),
    )
    scene = scene_of(on(edge, length_m, loss=0.01), loads, (-0.015, 0.0075), (0.01, W / 2))
    together = response(scene, [1700.0])
    for number, load in enumerate(loads):
        single = response(dataclasses.replace(scene, loads=(load,)), [1700.0])
        apart_m = np.abs(together.value[:, number] - single.value[:, 0])
        assert np.all(apart_m <= together.error[:, number] + single.error[:, 0])


def test_work_says_what_is_left_out() -> None:
    """Loads on the centre line excite no odd waves; one in the middle one symmetry of four."""

    def work(strip: Strip, *loads: Load) -> str:
        return response(Scene(strip=strip, loads=loads, points_m=((0.0, 0.01),)), [300.0]).work[0]

    assert "no load excites odd ones" in work(PLATE, *DISCS)
    assert "even and odd waves" in work(PLATE, disc(0.005, y_m=0.01))
    for load, count in ((force(), 1), (force(0.01), 2), (force(0.01, 0.01), 4)):
        assert f"in {count} of 4 symmetries" in work(on(HELD, 0.2), load)


@each_edge
@each_length
@pytest.mark.parametrize("mode", [1, 2, 3])
def test_a_cutoff_without_loss_is_refused_and_one_with_loss_is_not(
    edge: Edge, length_m: float | None, mode: int
) -> None:
    cutoff_hz = on(edge).cutoff_hz(mode)
    bare, lossy = (
        scene_of(on(edge, length_m, loss=loss), force(0.0, 0.004), (0.0, 0.01))
        for loss in (0.0, 1e-6)
    )
    assert np.all(np.isfinite(displacement(lossy, [500.0, cutoff_hz])))
    if length_m is None:  # between ends it is no resonance
        with pytest.raises(PlateError) as refusal:
            displacement(bare, [500.0, cutoff_hz])
        assert refusal.value.rule is Rule.INFINITE
        assert refusal.value.values == {"frequency_hz": cutoff_hz}


@pytest.mark.parametrize("x_m", [0.0, 0.01, 0.07])
@pytest.mark.parametrize("edge", [FIRM, HELD], ids=["elastic", "clamped"])
def test_an_exceptional_point_leaves_no_trace(edge: Edge, x_m: float) -> None:
    """Beside it the field is smooth: a polynomial of f^2."""
    point_hz, reach = on(edge).exceptional_point_hz(), 0.03
    nodes = np.cos(np.pi * (np.arange(12) + 0.5) / 12)
    detuning = np.array([0.0, *(s * 10.0**-n for n in range(3, 16, 2) for s in (1, -1))])
    scene = scene_of(on(edge), disc(), (x_m, 0.009))
    around = displacement(scene, point_hz * np.sqrt(1 + reach * nodes))[:, 0, 0]
    series = np.polynomial.chebyshev.chebfit(nodes, around.real, 11)
    smooth = np.polynomial.chebyshev.chebval(((1 + detuning) ** 2 - 1) / reach, series)
    u = displacement(scene, point_hz * (1 + detuning))[:, 0, 0]
    np.testing.assert_allclose(u, smooth, rtol=1e-5)
