"""Fingertips: contact areas, peaks over area and time, crosstalk, and the shortest quiet window."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    BondedPatch,
    Burst,
    Drive,
    Fingertip,
    ForceRectangle,
    Impedance,
    Layer,
    Load,
    Material,
    MomentDisc,
    PressureDisc,
    SampledDrive,
    Scene,
    Strip,
    causal,
    displacement,
    felt,
    fingertip_peaks,
    level_db,
    shortest_window,
    transient_response,
)
from stimuli.errors import PlateError, Rule
from tests.test_stimuli.plates import (
    CYCLE,
    DISCS,
    FIRM,
    HANN,
    PLATE,
    SOFT,
    SUPPORTED,
    TIPS,
    Edge,
    W,
    disc,
    force,
    on,
    patch,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from stimuli.drive.windows import Window

change = dataclasses.replace
TIP = TIPS[1]
PAPER = on(FIRM, 0.2, loss=0.01)
MEASURED = SUPPORTED.with_cutoff(2900.0)
POINTS = tuple(change(tip, radius_m=0.0) for tip in TIPS)
PLACES = tuple((tip.x_m, tip.y_m) for tip in TIPS)


def lossy(strip: Strip, loss: float, viscous_s: float = 0.0) -> Strip:
    material = change(strip.material, loss_factor=loss, viscous_time_s=viscous_s)
    return change(strip, material=material)


# --- contact areas -------------------------------------------------------------------------------


def test_points_lie_in_the_disc_centre_first_and_the_same_on_either_side() -> None:
    points = TIP.points_m(PLATE)
    assert points[0] == (0.035, 0.0125)
    offsets = {(round(x - 0.035, 11), round(y - 0.0125, 11)) for x, y in points}
    assert len(offsets) == len(points) == 49
    assert offsets == {(-x, y) for x, y in offsets} == {(x, -y) for x, y in offsets}
    assert max(math.hypot(*offset) for offset in offsets) == pytest.approx(0.005, abs=2e-11)


def test_a_contact_area_is_cut_off_at_the_edges_and_at_the_ends() -> None:
    points = change(TIP, y_m=0.002).points_m(PLATE)
    assert min(y for _, y in points) > 0
    assert 0 < len(points) < 49
    points = change(TIP, x_m=0.098).points_m(PAPER)
    assert max(x for x, _ in points) == 0.1
    assert {y for x, y in points if x == 0.1} >= {0.0125}
    assert change(TIP, x_m=0.1).points_m(PAPER)[0] == (0.1, 0.0125)
    odd = change(PAPER, length_m=0.1486867644596)
    finger = Fingertip(x_m=0.07434338, y_m=0.0125)
    assert max(x for x, _ in finger.points_m(odd)) == 0.1486867644596 / 2
    assert change(TIP, radius_m=0.0).points_m(PLATE) == ((0.035, 0.0125),)
    tiny = np.array(change(TIP, radius_m=1e-9).points_m(PLATE))
    assert np.max(np.abs(tiny - [0.035, 0.0125])) < 1.01e-9


LOADS: list[Load] = [disc(), patch(0.01, 0.003), force()]
BESIDE = [(0.0, 0.0125), (0.003, 0.0145), (0.012, 0.0125), (0.0, 0.022), (0.07, 0.0165)]


def dense(tip: Fingertip, strip: Strip, rings: int = 12) -> tuple[tuple[float, float], ...]:
    """Points of a dense grid on the contact area."""
    grid = [(tip.x_m, tip.y_m)]
    for ring in range(1, rings + 1):
        for step in range(6 * ring):
            angle, reach = 2 * math.pi * (step + 0.3) / (6 * ring), tip.radius_m * ring / rings
            grid.append((tip.x_m + reach * math.cos(angle), tip.y_m + reach * math.sin(angle)))
    return tuple(point for point in grid if 0 <= point[1] <= strip.width_m)


def greatest(strip: Strip, load: Load, points: Iterable[Any], frequency_hz: float) -> float:
    scene = Scene(strip=strip, loads=(load,), points_m=tuple(points))
    return float(np.max(np.abs(displacement(scene, [frequency_hz]))))


@pytest.mark.slow
@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, CLAMPED])
@pytest.mark.parametrize("load", LOADS, ids=lambda load: type(load).__name__)
@pytest.mark.parametrize("place", BESIDE, ids=str)
def test_the_points_miss_a_tenth_of_a_decibel_at_most(
    edge: Edge, load: Load, place: tuple[float, float]
) -> None:
    strip = on(edge)
    tip = Fingertip(x_m=place[0], y_m=place[1])
    small = not isinstance(load, MomentDisc) and 0 < math.dist(place, (0.0, 0.0125)) < 0.005
    for frequency_hz in (500.0, 1500.0, 5000.0):
        few = greatest(strip, load, tip.points_m(strip), frequency_hz)
        many = greatest(strip, load, dense(tip, strip), frequency_hz)
        assert 20 * math.log10(many / few) < (0.3 if small else 0.1)


# --- peaks ---------------------------------------------------------------------------------------

PRESS = Impedance(mass_kg=2e-4, stiffness_n_m=500.0, damping_n_s_m=1.0, holds_up_to_hz=2e3)
GLUED = Layer(thickness_m=0.2e-3, youngs_modulus_pa=62e9, poisson_ratio=0.31, density_kg_m3=7800.0)
TUKEY = Burst(frequency_hz=600.0, cycles=1, window="tukey")
SMALL = Strip(
    width_m=0.022,
    thickness_m=4e-4,
    length_m=0.14,
    material=on(CLAMPED, loss=0.02).material,
    edge=CLAMPED,
)


def small(x_m: float, y_m: float = 0.009, radius_m: float = 0.004) -> MomentDisc:
    return MomentDisc(x_m=x_m, y_m=y_m, radius_m=radius_m)


def tip(x_m: float, y_m: float = 0.009, **more: Any) -> Fingertip:
    return Fingertip(x_m=x_m, y_m=y_m, radius_m=0.003, **more)


def patched(*loads: MomentDisc) -> Strip:
    sizes: dict[str, Any] = {"length_x_m": 0.008, "length_y_m": 0.008, "is_disc": True}
    patches = (BondedPatch(x_m=load.x_m, y_m=load.y_m, layers=(GLUED,), **sizes) for load in loads)
    return change(SMALL, patches=tuple(patches))


PAIR, BARE = [small(-0.03), small(0.03)], [tip(-0.03), tip(0.03)]
PRESSING = [tip(x_m, impedance=PRESS) for x_m in (-0.03, 0.03)]
MORE = [*PAIR, small(-0.05), small(0.0), small(0.05)]
ALONE: dict[str, tuple[Strip, list[Any], list[Fingertip]]] = {
    "five actuators": (SMALL, MORE, [tip(load.x_m) for load in MORE]),
    "fingers": (SMALL, PAIR, PRESSING),
    "patches, fingers": (patched(*PAIR), PAIR, PRESSING),
    "endless": (change(SMALL, length_m=None), PAIR, BARE),
    "load beside the image": (SMALL, [small(-0.03), small(0.031)], BARE),
    "finger beside the image": (SMALL, PAIR, [tip(-0.03), tip(0.031)]),
    "one finger presses": (SMALL, PAIR, [PRESSING[0], BARE[1]]),
    "two kinds": (SMALL, [small(-0.03), force(0.03, 0.009)], BARE),
    "one patch": (patched(small(-0.03)), PAIR, BARE),
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name == "two kinds" else pytest.mark.slow) for name in ALONE],
)
def test_each_load_is_driven_by_itself(name: str) -> None:
    strip, loads, tips = ALONE[name]
    together = fingertip_peaks(strip, loads, tips, TUKEY)
    for number, load in enumerate(loads):
        alone = fingertip_peaks(strip, [load], tips, TUKEY)
        errors_m = together.error[:, number] + alone.error[:, 0]
        assert np.all(abs(together.value[:, number] - alone.value[:, 0]) <= errors_m)
    assert together.value.shape == (len(tips), len(loads))


@pytest.mark.parametrize("length_m", [0.2, pytest.param(None, marks=pytest.mark.slow)])
def test_a_plate_that_is_its_own_image_has_a_symmetric_matrix(length_m: float | None) -> None:
    """Mirror images, and reciprocity: loads and points may be exchanged."""
    peaks_m = felt(change(PAPER, length_m=length_m), DISCS, TIPS, CYCLE)
    np.testing.assert_allclose(peaks_m, peaks_m[::-1, ::-1], rtol=1e-9)
    np.testing.assert_allclose(peaks_m, peaks_m.T, rtol=1e-9)


@pytest.mark.parametrize("glued", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_forces_and_points_may_be_exchanged(*, glued: bool) -> None:
    places = (-0.031, 0.009), (0.02, 0.015)
    forces = [force(*place) for place in places]
    points = [Fingertip(x_m=x_m, y_m=y_m, radius_m=0.0) for x_m, y_m in places]
    peaks_m = felt(patched(small(-0.03)) if glued else SMALL, forces, points, TUKEY)
    assert peaks_m[0, 1] == pytest.approx(peaks_m[1, 0], rel=1e-4)


@pytest.mark.slow
def test_the_peak_is_linear_in_the_load_and_in_the_drive() -> None:
    # a total force of 1 N, and as much pressure on the same small area
    at_m = DISCS[0].x_m
    loads = (
        patch(2e-3, 2e-3, x_m=at_m, kind=ForceRectangle),
        disc(1e-3, x_m=at_m, kind=PressureDisc),
    )
    force_m, pressure_m = felt(PAPER, loads, TIPS, HANN)[0]
    assert pressure_m / (math.pi * 1e-3**2) == pytest.approx(force_m, rel=0.01)
    samples = np.sin(2 * np.pi * np.arange(33) / 32) * np.hanning(33)
    whole_m, half_m = (
        felt(PAPER, DISCS, POINTS, SampledDrive(samples=size * samples, sample_rate_hz=16000.0))
        for size in (1.0, -0.5)
    )
    np.testing.assert_allclose(half_m, whole_m / 2, rtol=1e-6)


def test_a_slow_drive_moves_the_plate_as_a_static_load_does() -> None:
    slow, motor = Burst(frequency_hz=40.0, cycles=2, window="hann"), patch(0.008, 0.004)
    scene = Scene(strip=PAPER, loads=(motor,), points_m=((0.0, W / 2),))
    static_m = abs(displacement(scene, [0.0])[0, 0, 0])
    # two cycles in a Hann window have their largest value, 0.9, beside the middle
    largest = np.max(slow.samples(1e5))
    point = Fingertip(x_m=0.0, y_m=W / 2, radius_m=0.0)
    assert felt(PAPER, [motor], [point], slow)[0, 0] == pytest.approx(static_m * largest, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("window", ["none", "tukey"])
@pytest.mark.parametrize("apart_m", [0.012, 0.06])
@pytest.mark.parametrize(
    ("width_m", "thickness_m", "edge"),
    [(0.005, 0.5e-3, SIMPLY_SUPPORTED), (0.003, 0.2e-3, CLAMPED), (0.003, 0.3e-3, CLAMPED)],
)
def test_what_is_not_followed_of_a_drive_far_below_the_cutoff_is_told(
    width_m: float,
    thickness_m: float,
    edge: Edge,
    apart_m: float,
    window: Window,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sizes = {"width_m": width_m, "thickness_m": thickness_m, "length_m": 0.1}
    strip = change(lossy(PAPER, 0.01), edge=edge, **sizes)
    places_m = [(side * apart_m / 2, width_m / 2) for side in (-1, 1)]
    discs = [MomentDisc(x_m=x_m, y_m=y_m, radius_m=width_m / 4) for x_m, y_m in places_m]
    tips = [Fingertip(x_m=x_m, y_m=y_m, radius_m=width_m / 3) for x_m, y_m in places_m]
    burst = Burst(frequency_hz=250.0, cycles=1, window=window)
    some = fingertip_peaks(strip, discs, tips, burst)
    monkeypatch.setattr("stimuli.plate.transient._SLOW", math.inf)
    every = fingertip_peaks(strip, discs, tips, burst)
    assert (abs(some.value - every.value) <= some.error + every.error).all()
    assert (some.error <= 5e-3 * some.value.max()).all()


CLICK = SampledDrive(samples=[0.0, 1.0, -0.6, 0.2, 0.0], sample_rate_hz=8000.0)


@pytest.mark.parametrize(
    ("strip", "drive"),
    [
        (PAPER, CYCLE),
        *(
            pytest.param(strip, drive, marks=pytest.mark.slow)
            for strip in (PAPER, on(CLAMPED, loss=0.01), change(PAPER, edge=SIMPLY_SUPPORTED))
            for drive in (HANN, CLICK)
        ),
    ],
)
def test_the_peak_is_that_of_the_displacement_over_time(strip: Strip, drive: Drive) -> None:
    peaks = fingertip_peaks(strip, DISCS[:1], POINTS, drive)
    scene = Scene(strip=causal(strip, drive), loads=DISCS[:1], points_m=PLACES)
    motion = transient_response(scene, drive, np.arange(0.0, 0.012, 5e-6))
    difference_m = abs(peaks.value[:, 0] - abs(motion.value[:, 0]).max(axis=0))
    assert np.all(difference_m <= peaks.error[:, 0] + motion.error[:, 0].max(axis=0))
    assert np.all(difference_m < 5e-3 * peaks.value[:, 0])  # 0.05 dB


@pytest.mark.slow
def test_a_contact_area_moves_at_least_as_its_centre_and_as_a_point_if_it_is_one() -> None:
    tiny = tuple(change(tip, radius_m=1e-7) for tip in TIPS)
    area_m, point_m, tiny_m = (felt(PAPER, DISCS, tips, HANN) for tips in (TIPS, POINTS, tiny))
    assert np.all(area_m >= point_m * (1 - 1e-9))
    assert level_db(area_m, own=0, other=1) > level_db(point_m, own=0, other=1)
    np.testing.assert_allclose(tiny_m, point_m, rtol=1e-3)


def test_a_small_load_away_from_the_fingers_middle_is_not_missed() -> None:
    tip, above = Fingertip(x_m=0.0, y_m=W / 2), Fingertip(x_m=0.0033, y_m=0.0147, radius_m=0.0)
    felt_m, most_m = felt(PAPER, (force(0.0033, 0.0147),), (tip, above), HANN)[:, 0]
    assert 1 <= felt_m / most_m < 1.01


@pytest.mark.slow
@pytest.mark.parametrize("edge", [SOFT, CLAMPED])
def test_a_long_plate_is_as_an_endless_strip(edge: Edge) -> None:
    endless, *long = (
        fingertip_peaks(on(edge, length_m, loss=0.01), DISCS, TIPS, CYCLE)
        for length_m in (None, 2.0, 100.0)
    )
    for peaks in long:
        difference_m = abs(peaks.value - endless.value)
        assert np.all(difference_m <= peaks.error + endless.error)
        assert np.all(difference_m < 1e-3 * endless.value)


@pytest.mark.slow
def test_beside_one_end_of_a_long_plate_the_other_does_not_count() -> None:
    peaks_m = []
    for length_m in (1.5, 30.0):
        places_m = [length_m / 2 - 0.045 + x_m for x_m in PLACES[0][:1] + PLACES[1][:1]]
        loads = [disc(x_m=x_m) for x_m in places_m]
        tips = [Fingertip(x_m=x_m, y_m=W / 2) for x_m in places_m]
        peaks_m.append(felt(change(PAPER, length_m=length_m), loads, tips, TUKEY))
    np.testing.assert_allclose(peaks_m[0], peaks_m[1], rtol=1e-3)
    assert abs(peaks_m[1][0, 1] / peaks_m[1][1, 0] - 1) > 0.01


@pytest.mark.slow
def test_a_plate_without_loss_is_not_waited_for_forever() -> None:
    without_m, lossy_m = (felt(lossy(PAPER, loss), DISCS, TIPS, CYCLE) for loss in (0.0, 1e-3))
    np.testing.assert_allclose(np.diag(without_m), np.diag(lossy_m), rtol=0.02)
    assert np.all(np.isfinite(without_m))


# Echoes that add up late: after the time of one way over an end they are 1 dB quieter
def test_echoes_that_add_up_late_are_waited_for() -> None:
    acrylic = Material(
        youngs_modulus_pa=3.2e9, poisson_ratio=0.37, density_kg_m3=1180.0, loss_factor=0.005
    )
    sizes: dict[str, Any] = {"width_m": 0.02283, "thickness_m": 7.9e-4, "length_m": 0.17322}
    strip = Strip(**sizes, material=acrylic, edge=SIMPLY_SUPPORTED)
    load, finger = disc(x_m=-0.027, y_m=0.01142), Fingertip(x_m=0.027, y_m=0.01142, radius_m=0.0)
    drive = Burst(frequency_hz=608.6, cycles=2, window="tukey")
    own = Fingertip(x_m=-0.027, y_m=0.01142, radius_m=0.0)
    peak_m = felt(strip, [load], [own, finger], drive)[1, 0]
    scene = Scene(strip=causal(strip, drive), loads=(load,), points_m=((finger.x_m, finger.y_m),))
    motion = transient_response(scene, drive, np.arange(0.0, 0.03, 1e-5))
    assert peak_m == pytest.approx(abs(motion.value).max(), rel=2e-3)


# --- causal loss ---------------------------------------------------------------------------------


@pytest.mark.parametrize("frequency_hz", [500.0, 5000.0])
def test_a_constant_loss_becomes_viscous_where_its_waves_travel(frequency_hz: float) -> None:
    strip, drive = lossy(MEASURED, 0.02, 1e-7), change(HANN, frequency_hz=frequency_hz)
    found = causal(strip, drive).material
    at_hz = 2900.0 if frequency_hz < 2900.0 else drive.peak_hz()
    assert found.loss_factor == 0
    for same in (MEASURED, lossy(MEASURED, 0.0, 1e-6)):
        assert causal(same, drive) is same
    loss = strip.material.stiffness_factor(at_hz)
    assert found.stiffness_factor(at_hz) == pytest.approx(loss, rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, CLAMPED])
def test_the_causal_loss_gives_the_level_of_the_constant_one(edge: Edge) -> None:
    strip = on(edge, loss=0.01)
    peaks_m = felt(strip, DISCS[:1], POINTS, CYCLE)
    np.testing.assert_array_equal(peaks_m, felt(causal(strip, CYCLE), DISCS[:1], POINTS, CYCLE))
    # Fourier sum: u(t) up to its period, after which it has died away
    period_s = 0.1
    frequencies_hz = (np.arange(2000) + 0.5) / period_s
    scene = Scene(strip=strip, loads=DISCS[:1], points_m=PLACES)
    parts = (
        displacement(scene, frequencies_hz)[:, 0] * CYCLE.spectrum(frequencies_hz)[:, np.newaxis]
    )
    times_s = np.arange(0.0, 0.01, 2e-5)
    moved_m = np.exp(-2j * np.pi * np.outer(times_s, frequencies_hz)) @ parts * (2 / period_s)
    driven_m, far_m = np.max(np.abs(moved_m.real), axis=0)
    level = level_db(peaks_m, own=0, other=1)
    assert level == pytest.approx(20 * math.log10(far_m / driven_m), abs=0.3)


# --- crosstalk and windows -----------------------------------------------------------------------

MATRIX_M = [[2e-6, 1e-7, 5e-7], [2e-7, 3e-6, 6e-7]]
ORDER: list[tuple[int, Any]] = [
    (n, w) for n in (1, 2) for w in ("none", "tukey", "gaussian", "hann")
]


@pytest.mark.parametrize(
    ("own", "other", "load", "expected_db"),
    [
        (0, 1, None, -20.0),
        (1, 0, 2, 20 * math.log10(5 / 6)),
        (0, 1, 2, 20 * math.log10(6 / 5)),
        (1, 1, None, 0.0),
    ],
)
def test_levels_are_ratios_of_peaks(own: int, other: int, load: Any, expected_db: float) -> None:
    assert level_db(MATRIX_M, own, other, load) == pytest.approx(expected_db, abs=1e-12)
    assert level_db([[1e-6], [0.0]], own=0, other=1) == -math.inf


@pytest.mark.parametrize(
    ("edge", "loss", "window", "expected_db"),
    [
        (FIRM, 0.01, "none", -24.73),
        (SIMPLY_SUPPORTED, 0.01, "tukey", -18.00),
        (SOFT, 0.005, "none", -19.72),
    ],
    ids=["2900 Hz", "supported", "2500 Hz"],
)
def test_levels_on_the_papers_plate(
    edge: Edge, loss: float, window: Any, expected_db: float
) -> None:
    peaks = fingertip_peaks(on(edge, 0.2, loss=loss), DISCS, TIPS, change(CYCLE, window=window))
    for own, other in ((0, 1), (1, 0)):
        level = level_db(peaks.value, own=own, other=other)
        assert level == pytest.approx(expected_db, abs=0.02)
    assert np.max(peaks.error / peaks.value) < 6e-3  # 0.05 dB


@pytest.mark.slow
def test_the_edge_and_the_window_decide_the_level() -> None:
    supported, firm = (
        [level_db(felt(strip, DISCS, TIPS, burst), own=0, other=1) for burst in (CYCLE, HANN)]
        for strip in (SUPPORTED, MEASURED)
    )
    assert supported[1] < supported[0] - 20
    assert firm[1] < firm[0] - 20
    assert firm[0] < supported[0]
    assert firm[1] < supported[1]
    # without ends and loss: one cycle of 500 Hz, 70 mm away, over 1 cm diameter
    assert firm[0] == pytest.approx(-29.0, abs=0.3)


def bursts(count: int) -> list[Burst]:
    """Return the first bursts in the order of their duration."""
    return [Burst(frequency_hz=500.0, cycles=n, window=w) for n, w in ORDER[:count]]


@pytest.mark.parametrize(
    ("target_db", "place"), [(-20.0, 0), pytest.param(-65.0, 6, marks=pytest.mark.slow)]
)
def test_the_first_window_that_is_quiet_enough_is_taken(target_db: float, place: int) -> None:
    choice = shortest_window(MEASURED, DISCS, POINTS, CYCLE, wanted_db=target_db)
    *louder, quiet = bursts(place + 1)
    assert choice.burst == quiet
    assert choice.level_db <= target_db
    assert choice.extra_s == pytest.approx(quiet.duration_s - CYCLE.duration_s, abs=1e-12)
    assert [burst for burst, _ in choice.louder] == louder
    for burst, level in choice.louder:
        assert level == pytest.approx(level_db(felt(MEASURED, DISCS, POINTS, burst), 0, 1))
        assert level > target_db


@pytest.mark.slow
def test_the_worst_of_all_fingers_and_plates_counts() -> None:
    points = (*POINTS, Fingertip(x_m=0.055, y_m=W / 2, radius_m=0.0))
    discs = (*DISCS, disc(x_m=0.055))
    choice = shortest_window(PAPER, discs, points, CYCLE, wanted_db=-10.0)
    peaks_m = felt(PAPER, discs, points, choice.burst)
    levels = [level_db(peaks_m, i, j) for i in range(3) for j in range(3) if i != j]
    assert choice.level_db == max(levels) > level_db(peaks_m, 0, 1)
    loose = change(PAPER, edge=SIMPLY_SUPPORTED)
    first, both = (
        shortest_window(PAPER, DISCS, POINTS, CYCLE, wanted_db=-24.0, also=also)
        for also in ((), (loose,))
    )
    of_both = [level_db(felt(s, DISCS, POINTS, both.burst), 0, 1) for s in (PAPER, loose)]
    assert both.burst.duration_s >= first.burst.duration_s
    assert both.level_db == pytest.approx(max(of_both))
    assert len(both.louder) > len(first.louder)


def test_a_level_that_no_burst_reaches_is_refused_with_the_best_one() -> None:
    longest = Burst(frequency_hz=2000.0, cycles=20)
    with pytest.raises(PlateError, match=r"^wanted_db .*\b20\b.*-300") as refusal:
        shortest_window(PAPER, DISCS, POINTS, longest, wanted_db=-300.0)
    assert refusal.value.rule is Rule.LEVEL_NOT_REACHED
    assert float(refusal.value.values["lowest_db"]) > -300.0


# --- refusals ------------------------------------------------------------------------------------


def test_a_tolerance_is_kept_or_refused_with_the_one_that_can_be_kept() -> None:
    with pytest.raises(PlateError) as refusal:
        fingertip_peaks(PAPER, DISCS, POINTS, HANN, rtol=1e-9)
    assert refusal.value.rule is Rule.TOLERANCE
    min_rtol = float(refusal.value.values["min_rtol"])
    peaks = fingertip_peaks(PAPER, DISCS, POINTS, HANN, rtol=1.001 * min_rtol)
    assert np.all(peaks.error <= 1.001 * min_rtol * peaks.value.max(axis=0))
