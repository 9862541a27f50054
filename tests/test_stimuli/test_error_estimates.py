"""The estimate of the error lies above the error, and no place is without a finite field."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

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
    MomentDisc,
    MomentRectangle,
    PressureDisc,
    PressureRectangle,
    Scene,
    Strip,
    displacement,
    response,
)
from tests.reference.exact import exact
from tests.test_stimuli.meetings import (
    DETUNINGS,
    check_estimates_at_meetings,
    finite_response,
    loads_on,
    points_on,
)
from tests.test_stimuli.plates import (
    EDGES,
    FIRM,
    PLATE,
    SUPPORTED,
    W,
    disc,
    drawn_strip,
    force,
    on,
    patch,
    scene_of,
    spring,
    within,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli import Response
    from stimuli.arrays import Complex

FREE, HELD = SIMPLY_SUPPORTED, CLAMPED

TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8)


def drawn_scene(rng: np.random.Generator) -> Scene:
    edge = EDGES[rng.integers(3)]
    if edge is FIRM:
        edge = ElasticEdge(stiffness_n=10.0 ** rng.uniform(-4, 8), lossless=rng.random() < 0.5)
    loss = float(rng.choice([0.0, 0.5, 10.0 ** rng.uniform(-4, -0.3)]))
    y = float(rng.choice([W / 2, rng.uniform(0.05, 0.95) * W]))
    room = float(min(y, W - y) * 10.0 ** rng.uniform(-1.5, 0) * 0.999)
    along = W * 10.0 ** rng.uniform(-2, 0.5)
    loads: list[Load] = [force(0.0, y)]
    loads += [disc(room, y_m=y, kind=kind) for kind in (PressureDisc, MomentDisc)]
    kinds = (PressureRectangle, MomentRectangle, ForceRectangle)
    loads += [patch(along, 2 * room, y_m=y, kind=kind) for kind in kinds]
    distances_m = np.array([0.0, 0.3 * rng.random(), 0.3 * 10.0 ** rng.uniform(-3, 0)])
    points = ((float(x), float(rng.uniform(0.02, 0.98) * W)) for x in distances_m)
    return scene_of(on(edge, loss=loss), loads[rng.integers(6)], *points)


class Tally:
    """How often the error keeps to the tolerance and to its estimate."""

    def __init__(self) -> None:
        self.kept: list[bool] = []
        self.covered: list[NDArray[np.bool_]] = []
        self.narrow: list[NDArray[np.bool_]] = []

    def add(self, found: Response, true_m: Complex, rtol: float, least_hz: float) -> None:
        """Compare, all but what rounding alone may leave: more of it at low frequencies."""
        size_m = np.max(np.abs(true_m), axis=(1, 2), keepdims=True)
        k2 = math.pi**2 * least_hz / SUPPORTED.cutoff_hz()
        floor_m = 1e-14 * (1 + 10 / k2) * np.max(size_m)
        rows = slice(len(true_m))
        error_m = np.abs(found.displacement_m[rows] - true_m)
        self.kept.append(within(found.displacement_m[rows], true_m, rtol, axis=(1, 2)))
        # the reference rounds as well
        estimate_m = found.error_m[rows]
        self.covered.append(estimate_m + 1e-12 * np.abs(true_m) + floor_m >= error_m)
        self.narrow.append(estimate_m <= 100 * np.maximum(error_m, floor_m))

    def check(self) -> None:
        """The estimate is no less than the error and at most a hundred times it."""
        assert all(self.kept)
        assert np.mean(self.covered) >= 0.99
        assert np.mean(self.narrow) >= 0.99


@pytest.mark.slow
def test_the_estimate_is_no_less_than_the_error_and_at_most_a_hundred_times_it() -> None:
    rng, tally = np.random.default_rng(21), Tally()
    for _ in range(150):
        scene, f = drawn_scene(rng), float(10.0 ** rng.uniform(0, math.log10(2e4)))
        true_m = displacement(scene, [f], 1e-12)
        for rtol in TOLERANCES:
            tally.add(response(scene, [f], rtol), true_m, rtol, f)
    tally.check()


@pytest.mark.slow
def test_so_it_is_between_the_frequencies_that_are_solved() -> None:
    rng, tally = np.random.default_rng(22), Tally()
    for _ in range(40):
        scene = drawn_scene(rng)
        top_hz = scene.strip.cutoff_hz() * rng.uniform(0.05, 0.9)
        some_hz = np.sort(rng.uniform(0.01, 1.0, 4)) * top_hz
        true_m = np.array([displacement(scene, [f], 1e-12)[0] for f in some_hz])
        for rtol in TOLERANCES:
            found = response(scene, np.append(some_hz, np.linspace(4.0, top_hz, 60)), rtol)
            if found.work.frequencies_solved < 64:
                tally.add(found, true_m, rtol, float(some_hz[0]))
    assert np.size(tally.covered) > 1000
    tally.check()


@pytest.mark.slow
@pytest.mark.parametrize("to_clamped", [0.3, 0.9, 0.97, 0.99999])
@pytest.mark.parametrize("nu", [-0.2, 0.0, 1e-12, 1e-6, 0.02, 0.0355, 0.499999])
def test_powers_that_meet_in_a_corner_leave_a_finite_field(nu: float, to_clamped: float) -> None:
    # at 0 and towards 0.5 a clamp and a spring share powers; at 0.0355 two of a clamp's meet
    clamped = on(HELD, 0.2, nu=nu)
    least = dataclasses.replace(clamped, edge=FREE).cutoff_hz()
    cutoff_hz = least + (clamped.cutoff_hz() - least) * to_clamped
    strip = clamped.with_cutoff(cutoff_hz)
    load = disc(0.006, x_m=-0.035)
    scene = scene_of(strip, load, (0.0, 0.0125), (0.035, 0.0125))
    for part in (1.001, 1.125, 2.0):
        by_waves, tight = (response(scene, [strip.cutoff_hz(2) * part], r) for r in (1e-6, 1e-10))
        true_m = tight.displacement_m
        assert np.all(by_waves.error_m < 1e-4 * np.max(np.abs(true_m)))
        apart_m = np.abs(by_waves.displacement_m - true_m)
        assert np.all(apart_m <= by_waves.error_m + tight.error_m)


@pytest.mark.slow
def test_the_estimate_covers_the_error_of_random_plates_with_ends() -> None:
    """Of any material, size, edge and length."""
    rng, ratios = np.random.default_rng(12), []
    for number in range(24):
        width_m = float(rng.uniform(0.01, 0.04))
        length_m = float(width_m * rng.uniform(2, 12))
        material = dataclasses.replace(
            ALUMINIUM,
            youngs_modulus_pa=float(rng.uniform(3e9, 2.1e11)),
            poisson_ratio=float(rng.uniform(0, 0.499)),
            loss_factor=float(rng.choice([0, 0.002, 0.01, 0.05])),
        )
        thickness_m = float(rng.uniform(0.0003, 0.002))
        strip = Strip(width_m=width_m, thickness_m=thickness_m, material=material, edge=HELD)
        if number % 4:
            strip = dataclasses.replace(strip, edge=spring(strip, 10 ** rng.uniform(-1, 4)))
        strip = dataclasses.replace(strip, length_m=length_m)
        load, *points_m = (
            (float(rng.uniform(-0.4, 0.4) * length_m), float(rng.uniform(0.2, 0.8) * width_m))
            for _ in range(4)
        )
        frequency_hz = float(strip.cutoff_hz() * 10 ** rng.uniform(-1, 1))
        scene, rtol = scene_of(strip, force(*load), *points_m), 10 ** rng.uniform(-9, -3)
        rough, fine = (response(scene, [frequency_hz], r) for r in (rtol, 1e-11))
        allowed_m = rough.error_m + fine.error_m
        apart_m = np.abs(rough.displacement_m - fine.displacement_m)
        ratios.append(float(np.max(apart_m / allowed_m)))
        assert within(rough.displacement_m, fine.displacement_m, rtol)
    assert np.count_nonzero(np.array(ratios) > 1) <= 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_on_drawn_plates_the_estimate_lies_above_the_error(seed: int) -> None:
    """Next to a cut-off, many widths away, and under a load of next to no size."""
    rng = np.random.default_rng(seed)
    edge, kind = (HELD, HELD, FREE)[seed // 4], seed % 4
    loss = float(10 ** rng.uniform(-13, -2)) if kind == 1 else 0.0
    strip = drawn_strip(rng, edge, loss=loss)
    width_m, lossless = strip.width_m, dataclasses.replace(strip.material, loss_factor=0.0)
    cutoff_hz = dataclasses.replace(strip, material=lossless).cutoff_hz()
    y_m, place_m = rng.uniform(0.15, 0.85, 2) * width_m
    load, frequency_hz, x_m = force(0.0, y_m), cutoff_hz * rng.uniform(0.05, 5), 3 * width_m
    if kind < 2:
        frequency_hz = cutoff_hz * (1 + rng.choice([-1, 1]) * 10 ** rng.uniform(-13, -8))
    elif kind == 2:
        x_m = width_m * 10 ** rng.uniform(-1, 3)
    else:
        size_m, x_m = width_m * 10 ** rng.uniform(-7, -4), width_m * rng.uniform(0, 1)
        load = patch(size_m, size_m, y_m=y_m, kind=ForceRectangle)
    true_m = complex(exact(strip, load, x_m, place_m, frequency_hz))
    for rtol in (1e-6, 1e-10):
        found = response(scene_of(strip, load, (x_m, place_m)), [frequency_hz], rtol)
        assert abs(found.displacement_m[0, 0, 0] - true_m) <= found.error_m[0, 0, 0]


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_close_waves_are_summed_to_the_tolerance_wherever_they_are_taken_together(
    rtol: float,
) -> None:
    detuning = np.concatenate([[0.0], 10.0 ** -np.arange(1.0, 13.0), -(10.0 ** -np.arange(2, 13))])
    scene = scene_of(PLATE, force(0.0, 0.011), (0.0, 0.01), (0.02, 0.009), (0.1, 0.012))
    frequencies_hz = PLATE.exceptional_point_hz() * (1 + detuning)
    rough, exact = (displacement(scene, frequencies_hz, tol)[:, 0] for tol in (rtol, 1e-12))
    assert within(rough, exact, rtol, axis=1)


MEETINGS = (0.5, 1.0, 2.0, 2.5, 3.0, 4.0, 4.091446734, 4.5, 6.0, 8.0, 12.0)
"""First cut-offs of the supported strip at which a branch is flat, n^2 / 2 and 2 n^2, two orders
meet, (n^2 - m^2) / 2, or a wave is at rest, n^2."""


def is_finite(answer: Response | None) -> bool:
    return answer is None or bool(
        np.all(np.isfinite(answer.displacement_m)) and np.all(np.isfinite(answer.error_m))
    )


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(
    seed=st.integers(0, 2**32),
    edge=st.one_of(st.sampled_from([FREE, HELD]), st.floats(-15, 4)),
    loss=st.sampled_from([0.0, 0.0, 1e-12, 1e-6, 0.02]),
    length=st.sampled_from([None, None, None, 2.7, 6.1]),
    meeting=st.one_of(st.sampled_from(MEETINGS), st.sampled_from(["cut-off", "exceptional"])),
    detuning=st.one_of(st.sampled_from(DETUNINGS), st.floats(-15, -3).map(lambda e: 10**e)),
    y=st.sampled_from([0.41, 0.5]),
    rtol=st.sampled_from([1e-3, 1e-6, 1e-10]),
)
def test_no_strip_gives_nan_at_or_beside_any_meeting(
    seed: int,
    edge: Any,
    loss: float,
    length: float | None,
    meeting: float | str,
    detuning: float,
    y: float,
    rtol: float,
) -> None:
    rng = np.random.default_rng(seed)
    strip = drawn_strip(rng, loss=loss)
    f_hz, width_m = strip.cutoff_hz(), strip.width_m
    edge = spring(strip, 10**edge) if isinstance(edge, float) else edge
    strip = dataclasses.replace(strip, edge=edge)
    if meeting == "cut-off":
        f_hz = strip.cutoff_hz(int(rng.integers(1, 5)))
    elif meeting == "exceptional":
        f_hz = strip.exceptional_point_hz() or f_hz / 2
    else:
        f_hz *= float(meeting)
    strip = dataclasses.replace(strip, length_m=length and length * width_m)
    loads, places = loads_on(width_m, y), points_on(width_m)
    if length:
        loads, places = (loads[rng.integers(6)],), places[:5]
    assert is_finite(finite_response(scene_of(strip, loads, *places), f_hz * (1 + detuning), rtol))


@pytest.mark.slow
def test_the_estimate_is_above_the_error_at_and_beside_a_meeting() -> None:
    check_estimates_at_meetings(seed=34, strips=4)
