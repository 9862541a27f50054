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
    MomentDisc,
    PressureDisc,
    SampledDrive,
    Strip,
    causal,
    displacement,
    felt,
    level_db,
    shortest_window,
    transient,
)
from tests.test_stimuli.plates import (
    CYCLE,
    DISCS,
    HANN,
    PLATE,
    SUPPORTED,
    TIPS,
    Edge,
    W,
    disc,
    force,
    on,
    patch,
    scene_of,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

change = dataclasses.replace
TIP = TIPS[1]
SHORT = on(CLAMPED, 0.2)
MEASURED = SUPPORTED.with_cutoff(2900.0)
STRIPS = {"supported": SUPPORTED, "2900 Hz": MEASURED, "clamped": PLATE}
POINTS = tuple(change(tip, radius_m=0.0) for tip in TIPS)
PLACES = tuple((tip.x_m, tip.y_m) for tip in TIPS)


def lossy(strip: Strip, loss: float, viscous_s: float = 0.0) -> Strip:
    material = change(strip.material, loss_factor=loss, viscous_time_s=viscous_s)
    return change(strip, material=material)


def off_db(found: Any, true: Any) -> float:
    return float(np.max(np.abs(20 * np.log10(found / true))))


# --- contact areas -------------------------------------------------------------------------------


def test_points_lie_in_the_disc_centre_first_and_the_same_on_either_side() -> None:
    points = TIP.points_m(PLATE)
    assert points[0] == (0.035, 0.0125)
    offsets = {(round(x - 0.035, 11), round(y - 0.0125, 11)) for x, y in points}
    assert len(offsets) == len(points) == 49
    assert offsets == {(-x, y) for x, y in offsets} == {(x, -y) for x, y in offsets}
    assert max(math.hypot(*offset) for offset in offsets) == pytest.approx(0.005, abs=2e-11)
    every = (point for tip in TIPS for point in tip.points_m(PLATE))
    work = scene_of(PLATE, DISCS, *every).work([500.0])
    # a quarter of the driven finger's points and half of the other's
    assert (work.pairs_asked, work.pairs_solved) == (196, 16 + 28)


def test_a_contact_area_is_cut_off_at_the_edges_and_at_the_ends() -> None:
    points = change(TIP, y_m=0.002).points_m(PLATE)
    assert min(y for _, y in points) > 0
    assert 0 < len(points) < 49
    points = change(TIP, x_m=0.098).points_m(SHORT)
    assert max(x for x, _ in points) == 0.1
    assert {y for x, y in points if x == 0.1} >= {0.0125}
    assert change(TIP, x_m=0.1).points_m(SHORT)[0] == (0.1, 0.0125)
    odd = change(SHORT, length_m=0.1486867644596)
    finger = Fingertip(x_m=0.07434338, y_m=0.0125)
    assert max(x for x, _ in finger.points_m(odd)) == 0.1486867644596 / 2
    assert change(TIP, radius_m=0.0).points_m(PLATE) == ((0.035, 0.0125),)
    tiny = np.array(change(TIP, radius_m=1e-9).points_m(PLATE))
    assert np.max(np.abs(tiny - [0.035, 0.0125])) < 1.01e-9


LOADS: list[Load] = [disc(), patch(0.01, 0.003), force()]
BESIDE = [
    *((0.0, 0.0125), (0.003, 0.0145), (0.002, 0.0085), (0.012, 0.0125), (0.015, 0.0155)),
    *((0.0, 0.022), (0.07, 0.0125), (0.07, 0.0165)),
]


def dense(tip: Fingertip, strip: Strip, rings: int = 12) -> tuple[tuple[float, float], ...]:
    """Points of a dense grid on the contact area."""
    grid = [(tip.x_m, tip.y_m)]
    for ring in range(1, rings + 1):
        for step in range(6 * ring):
            angle, reach = 2 * math.pi * (step + 0.3) / (6 * ring), tip.radius_m * ring / rings
            grid.append((tip.x_m + reach * math.cos(angle), tip.y_m + reach * math.sin(angle)))
    return tuple(point for point in grid if 0 <= point[1] <= strip.width_m)


def greatest(strip: Strip, load: Load, points: Iterable[object], frequency_hz: float) -> float:
    moved_m = displacement(scene_of(strip, load, *points), [frequency_hz], 1e-4)
    return float(np.max(np.abs(moved_m)))


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
NARROW = Strip(
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


def patched(*loads: MomentDisc, strip: Strip = NARROW) -> Strip:
    patches = (
        BondedPatch(
            x_m=load.x_m,
            y_m=load.y_m,
            length_x_m=2 * load.radius_m,
            length_y_m=2 * load.radius_m,
            layers=(GLUED,),
            is_disc=True,
        )
        for load in loads
    )
    return change(strip, patches=tuple(patches))


PAIR, BARE = [small(-0.03), small(0.03)], [tip(-0.03), tip(0.03)]
PRESSING = [tip(x_m, impedance=PRESS) for x_m in (-0.03, 0.03)]
MORE = [*PAIR, small(-0.05), small(0.0), small(0.05)]
SHIFTED = [small(-0.03), small(0.031)]
ALONE: dict[str, tuple[Strip, list[Any], list[Fingertip]]] = {
    "mirror images": (NARROW, PAIR, BARE),
    "five actuators": (NARROW, MORE, [tip(load.x_m) for load in MORE]),
    "fingers": (NARROW, PAIR, PRESSING),
    "patches": (patched(*PAIR), PAIR, BARE),
    "patches, fingers": (patched(*PAIR), PAIR, PRESSING),
    "endless": (change(NARROW, length_m=None), PAIR, BARE),
    "long": (change(NARROW, length_m=3.0), PAIR, BARE),
    "three fingers": (NARROW, PAIR, [*BARE, tip(0.0)]),
    "load beside the image": (change(NARROW, edge=SIMPLY_SUPPORTED), SHIFTED, BARE),
    "larger image": (NARROW, [small(-0.03), small(0.03, radius_m=0.0041)], BARE),
    "image across": (NARROW, [small(-0.03), small(0.03, y_m=0.0094)], BARE),
    "finger beside the image": (NARROW, PAIR, [tip(-0.03), tip(0.031)]),
    "one finger presses": (NARROW, PAIR, [PRESSING[0], BARE[1]]),
    "one finger": (NARROW, PAIR, BARE[:1]),
    "two kinds": (NARROW, [small(-0.03), force(0.03, 0.009)], BARE),
    "one patch": (patched(small(-0.03)), PAIR, BARE),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ALONE)
def test_each_load_is_driven_by_itself(name: str) -> None:
    """Mirror images of loads are computed once, and get what they would get."""
    strip, loads, tips = ALONE[name]
    together = felt(strip, loads, tips, TUKEY)
    single = [felt(strip, [load], tips, TUKEY)[:, 0] for load in loads]
    # a section of a long plate ends elsewhere for another load
    rtol = 2e-4 if strip.length_m == NARROW.length_m else 2e-3
    np.testing.assert_allclose(together, np.stack(single, axis=1), rtol=rtol)
    assert together.shape == (len(tips), len(loads))


@pytest.mark.parametrize("impedance", [None, PRESS])
def test_a_plate_that_is_its_own_image_has_a_symmetric_matrix(impedance: Any) -> None:
    """With too few points looked at first, one of two equal peaks was missed by 0.07 dB."""
    strip = lossy(change(MEASURED, length_m=0.2 if impedance else None), 0.01)
    tips = [change(tip, impedance=impedance) for tip in TIPS]
    peaks_m = felt(strip, DISCS, tips, CYCLE)
    np.testing.assert_allclose(peaks_m, peaks_m[::-1, ::-1], rtol=1e-4)
    if impedance is None:
        np.testing.assert_allclose(peaks_m, peaks_m.T, rtol=1e-10)


@pytest.mark.slow
def test_the_peak_is_linear_in_the_load_and_in_the_drive() -> None:
    # a total force of 1 N, and as much pressure on the same small area
    loads = patch(2e-3, 2e-3, kind=ForceRectangle), disc(1e-3, kind=PressureDisc)
    force_m, pressure_m = felt(MEASURED, loads, TIPS, HANN)[0]
    assert pressure_m / (math.pi * 1e-3**2) == pytest.approx(force_m, rel=0.01)
    samples = np.sin(2 * np.pi * np.arange(33) / 32) * np.hanning(33)
    whole, half = (
        felt(MEASURED, DISCS, POINTS, SampledDrive(samples=s, sample_rate_hz=16000.0))
        for s in (samples, 0.5 * samples)
    )
    np.testing.assert_allclose(half, whole / 2, rtol=1e-6)


def test_a_slow_drive_moves_the_plate_as_a_static_load_does() -> None:
    slow = Burst(frequency_hz=20.0, cycles=1, window="none")
    still_m = abs(displacement(scene_of(MEASURED, DISCS[0], PLACES[0]), [0.0])[0, 0, 0])
    assert felt(MEASURED, DISCS[:1], POINTS[:1], slow)[0, 0] == pytest.approx(still_m, rel=2e-3)


CLICK = SampledDrive(samples=[0.0, 1.0, -0.6, 0.2, 0.0], sample_rate_hz=8000.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "drive", "loss"),
    [
        *((name, drive, loss) for name in STRIPS for drive in (CYCLE, HANN) for loss in (0, 0.01)),
        ("2900 Hz", CLICK, 0.0),
    ],
    ids=str,
)
def test_window_and_step_hold_the_peak_to_a_twentieth_of_a_decibel(
    name: str, drive: Drive, loss: float
) -> None:
    strip = lossy(STRIPS[name], loss)
    peaks_m = felt(strip, DISCS[:1], POINTS, drive)[:, 0]
    scene = scene_of(causal(strip, drive), DISCS[0], *PLACES)
    watched_m = transient(scene, drive, np.arange(0.0, 0.016, 4e-6), 1e-3)[:, 0]
    assert off_db(peaks_m, np.max(np.abs(watched_m), axis=0)) < 0.05


@pytest.mark.slow
def test_a_contact_area_moves_at_least_as_its_centre_and_as_a_point_if_it_is_one() -> None:
    tiny = tuple(change(tip, radius_m=1e-7) for tip in TIPS)
    area_m, point_m, tiny_m = (felt(MEASURED, DISCS, tips, HANN) for tips in (TIPS, POINTS, tiny))
    assert np.all(area_m >= point_m * (1 - 1e-3))
    assert level_db(area_m, own=0, other=1) > level_db(point_m, own=0, other=1)
    np.testing.assert_allclose(tiny_m, point_m, rtol=1e-3)


def test_a_small_load_away_from_the_fingers_middle_is_not_missed() -> None:
    tip, above = Fingertip(x_m=0.0, y_m=W / 2), Fingertip(x_m=0.0033, y_m=0.0147, radius_m=0.0)
    felt_m, most_m = felt(MEASURED, (force(0.0033, 0.0147),), (tip, above), HANN)[:, 0]
    assert 1 <= felt_m / most_m < 1.01


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
@pytest.mark.parametrize("name", STRIPS)
@pytest.mark.parametrize("drive", [CYCLE, HANN], ids=str)
def test_the_causal_loss_gives_the_level_of_the_constant_one(name: str, drive: Burst) -> None:
    strip = lossy(STRIPS[name], 0.01)
    peaks_m = felt(strip, DISCS[:1], POINTS, drive)
    np.testing.assert_array_equal(peaks_m, felt(causal(strip, drive), DISCS[:1], POINTS, drive))
    # Fourier sum: u(t) up to its period, after which it has died away
    period_s = 0.25
    frequencies_hz = (np.arange(5000) + 0.5) / period_s
    tones_m = displacement(scene_of(strip, DISCS[0], *PLACES), frequencies_hz, 1e-4)[:, 0]
    parts = tones_m * drive.spectrum(frequencies_hz)[:, np.newaxis]
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


@pytest.mark.slow
def test_the_edge_and_the_window_decide_the_level() -> None:
    levels = [
        level_db(felt(strip, DISCS, TIPS, burst), own=0, other=1)
        for strip in (SUPPORTED, MEASURED)
        for burst in (CYCLE, HANN)
    ]
    assert levels[1] < levels[0] - 20
    assert levels[3] < levels[2] - 20
    assert levels[2] < levels[0]
    assert levels[3] < levels[1]
    # one cycle of 500 Hz on the paper's plate (first cut-off 2900 Hz), 70 mm, over 1 cm diameter
    assert levels[2] == pytest.approx(-29.0, abs=0.3)


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
    choice = shortest_window(MEASURED, discs, points, CYCLE, wanted_db=-10.0)
    peaks_m = felt(MEASURED, discs, points, choice.burst)
    levels = [level_db(peaks_m, i, j) for i in range(3) for j in range(3) if i != j]
    assert choice.level_db == max(levels) > level_db(peaks_m, 0, 1)
    first, both = (
        shortest_window(MEASURED, DISCS, POINTS, CYCLE, wanted_db=-29.0, also=also)
        for also in ((), (SUPPORTED,))
    )
    of_both = [level_db(felt(s, DISCS, POINTS, both.burst), 0, 1) for s in (MEASURED, SUPPORTED)]
    assert both.burst.duration_s >= first.burst.duration_s
    assert both.level_db == pytest.approx(max(of_both))
    assert len(both.louder) > len(first.louder)


@pytest.mark.slow
def test_a_level_that_no_burst_reaches_is_refused_with_the_best_one() -> None:
    longest = Burst(frequency_hz=2000.0, cycles=20)
    with pytest.raises(ValueError, match=r"^wanted_db .*\b20\b.*-300"):
        shortest_window(MEASURED, DISCS, TIPS, longest, wanted_db=-300.0)
