"""The plate over time by its modes, against closed forms, the other solver and finer modes."""

from __future__ import annotations

import dataclasses
import itertools
import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.linalg import expm

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    Burst,
    ElasticEdge,
    Fingertip,
    ForceRectangle,
    Material,
    MomentDisc,
    MomentRectangle,
    PointForce,
    SampledDrive,
    Scene,
    Strip,
    displacement,
    felt,
    felt_work,
    level_db,
    transient,
    transient_work,
)
from stimuli.field.field import at_rest
from stimuli.field.synthesis import synthesized
from stimuli.fingers import fingertip
from stimuli.fingers.fingertip import causal
from stimuli.motion.course import crests
from stimuli.motion.modes import plate_modes
from stimuli.motion.motion import motion_of
from stimuli.motion.oscillators import followed, poles
from stimuli.motion.peaks import peaks_of
from stimuli.motion.section import sections, without_far_ends
from stimuli.motion.standing_waves import strip_waves

if TYPE_CHECKING:
    from stimuli.load import Load
    from stimuli.motion.modes import Modes

# the modules, whose names their functions have
COURSE, MODES, MOTION, PEAKS, PARTS = (
    sys.modules[f"stimuli.motion.{name}"]
    for name in ("course", "modes", "motion", "peaks", "ringing.parts")
)

K_2900, K_2500 = ElasticEdge(stiffness_n=141.72083994908), ElasticEdge(stiffness_n=63.9264884979218)
STEEL = Material(youngs_modulus_pa=200e9, poisson_ratio=0.29, density_kg_m3=7850.0)
GLASS = Material(youngs_modulus_pa=70e9, poisson_ratio=0.22, density_kg_m3=2500.0)


def plate(
    edge: Any = K_2900, loss: float = 0.01, length_m: float | None = 0.2, **more: Any
) -> Strip:
    """The paper's plate, or another."""
    material = dataclasses.replace(more.pop("material", ALUMINIUM), loss_factor=loss)
    sizes = {"width_m": 0.025, "thickness_m": 0.0005} | more
    return Strip(material=material, edge=edge, length_m=length_m, **sizes)


def pair(x_m: float = 0.035, y_m: float = 0.0125) -> tuple[list[Load], list[Fingertip]]:
    """Two of the paper's discs with a finger on each."""
    places = (-x_m, x_m)
    discs: list[Load] = [MomentDisc(x_m=x, y_m=y_m, radius_m=0.0064) for x in places]
    return discs, [Fingertip(x_m=x, y_m=y_m) for x in places]


def burst(window: Any = "none", frequency_hz: float = 500.0) -> Burst:
    return Burst(frequency_hz=frequency_hz, cycles=1, window=window)


def scene_of(strip: Strip, drive: Any, loads: list[Load], n: int = 1) -> Scene:
    """A scene of some points about each load."""
    points = [(load.x_m + 1e-3 * k, load.y_m + 1e-3 * k) for load in loads for k in range(n)]
    return Scene(strip=causal(strip, drive), loads=tuple(loads), points_m=tuple(points))


# --- modes


@pytest.mark.parametrize(
    ("poisson_ratio", "roots"),
    [(0.3, [9.6314, 16.1348, 36.7256, 38.9450, 46.7381, 70.7401])],
)
def test_modes_of_a_square_on_two_supports_are_leissas(
    poisson_ratio: float, roots: list[float]
) -> None:
    # A. W. Leissa, J. Sound Vib. 31 (1973) 257, table for two opposite edges supported, two free
    material = dataclasses.replace(ALUMINIUM, poisson_ratio=poisson_ratio)
    square = plate(SIMPLY_SUPPORTED, 0.0, 0.1, material=material, width_m=0.1)
    scale = math.sqrt(2700 * square.thickness_m / square.bending_stiffness_n_m) * 0.1**2
    found = np.concatenate([m.squared for m in plate_modes(square, 2000.0, centred=False)])
    assert np.sort(np.sqrt(found))[:6] * scale == pytest.approx(roots, rel=1e-5)


@pytest.mark.parametrize("length_m", [0.1, 0.5])
def test_nothing_bends_a_free_end(length_m: float) -> None:
    strip = plate(K_2500, 0.0, length_m)
    nu, y_m, step_m = strip.material.poisson_ratio, np.array([0.006, 0.0125]), 1e-4
    for modes in plate_modes(strip, 12e3, centred=True):

        def moment(x_m: float, modes: Modes = modes) -> Any:
            down, here, up = (
                np.column_stack([np.full_like(y_m, x_m), y_m + d]) for d in (-step_m, 0.0, step_m)
            )
            curved = modes.at(down)[0] + modes.at(up)[0] - 2 * modes.at(here)[0]
            return modes.at(here, laplacian=True)[0] - (1 - nu) * curved / step_m**2

        middle = max(np.abs(moment(part * length_m / 2)).max() for part in (0.0, 0.2, 0.4, 0.6))
        end = np.abs(moment(length_m / 2)).max(axis=0)
        assert np.all(end[: end.size // 2] < 5e-3 * middle)
        assert np.all(end < 0.1 * middle)


def test_springs_raise_frequencies_by_what_they_give() -> None:
    stiffness_n = 60.0
    strips = [
        plate(ElasticEdge(stiffness_n=stiffness_n * factor), 0.0) for factor in (1.0, 0.98, 1.02)
    ]
    for modes, less, more in zip(
        *(plate_modes(strip, 12e3, centred=False) for strip in strips), strict=True
    ):
        springs = (more.squared - less.squared) / 0.04
        np.testing.assert_allclose(
            np.diag(modes.bent), modes.squared - springs, rtol=0, atol=1e-3 * springs.max()
        )


@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, K_2500, CLAMPED])
@pytest.mark.parametrize("length_m", [0.0125, 0.06, 0.7])
def test_frequencies_do_not_depend_on_how_many_functions_there_are(
    edge: Any, length_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    strip = plate(edge, 0.0, length_m)
    few = plate_modes(strip, 15e3, centred=False)
    for name, value in (("_ABOVE", 4.0), ("_RATES", 10), ("_FASTEST", 16.0)):
        monkeypatch.setattr(MODES, name, value)
    for some, others in zip(few, plate_modes(strip, 15e3, centred=False), strict=True):
        assert some.squared.size == others.squared.size
        np.testing.assert_allclose(some.squared, others.squared, rtol=4e-4)


@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, K_2500, CLAMPED])
def test_the_longest_wave_of_an_endless_strip_is_its_cutoff(edge: Any) -> None:
    strip = plate(edge, 0.0, None)
    (waves,) = strip_waves(strip, 20e3, 5.0, centred=True)
    first = np.sqrt(waves.squared[waves.wavenumbers_rad_m == 0]) / (2 * math.pi)
    assert first == pytest.approx(
        [strip.cutoff_hz(mode) for mode in (1, 3)][: first.size], rel=1e-9
    )


def test_points_move_as_hard_by_loads_as_loads_by_points() -> None:
    forces: list[Load] = [PointForce(x_m=-0.03, y_m=0.005), PointForce(x_m=0.06, y_m=0.02)]
    scene = scene_of(plate(), burst(), forces)
    found = motion_of(scene, 2900.0, 8.0).oscillators
    np.testing.assert_allclose(found.rest_m, found.rest_m.T, rtol=1e-4, atol=1e-12)
    np.testing.assert_allclose(
        found.weights(0)[1],
        found.weights(1)[0],
        rtol=1e-9,
        atol=1e-9 * np.abs(found.weights(0)).max(),
    )


# --- oscillators


@pytest.mark.parametrize("viscous_s", [0.0, 1e-4, 0.3])
def test_poles_with_coupled_loss_are_those_of_the_equations(viscous_s: float) -> None:
    rng = np.random.default_rng(1)
    squared, bent = np.array([1.0, 5.0, 9.0]), rng.standard_normal((3, 3))
    bent = bent @ bent.T
    found, modes, drives = poles(squared, bent, viscous_s)
    system = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.diag(squared), -viscous_s * bent]])
    for time_s in (0.0, 0.4, 3.0):
        ours = (modes * np.exp(found * time_s) @ drives).real
        np.testing.assert_allclose(ours, expm(system * time_s)[:3, 3:], atol=1e-12)


def test_an_overdamped_oscillator_creeps_back() -> None:
    found, modes, drives = poles(np.array([1.0]), np.array([1.0]), 3.0)
    assert np.all(found.imag == 0)
    slow, fast = (-3 + math.sqrt(5)) / 2, (-3 - math.sqrt(5)) / 2
    for time_s in (0.1, 2.0):
        exact = (math.exp(slow * time_s) - math.exp(fast * time_s)) / (slow - fast)
        assert (modes * np.exp(found * time_s) @ drives).real.item() == pytest.approx(exact)


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("n_samples", [2, 3, 50, 401])
def test_an_oscillator_follows_lines_and_steps_exactly(n_samples: int, *, held: bool) -> None:
    rng = np.random.default_rng(n_samples)
    samples, step_s = rng.standard_normal(n_samples), 1e-3
    pole, begin = np.array([-20 + 900j]), np.array([0.3 - 0.1j])
    found = followed(pole, samples, step_s, begin, held=held)
    assert found[0, 0] == begin[0]
    slope = 0.0 if held else 1.0
    for n in range(n_samples - 1):
        # s, or s + slope t, as a system that makes its own drive
        whole = np.array([[pole[0], 1, 0], [0, 0, slope], [0, 0, 0]])
        rise = (samples[n + 1] - samples[n]) / step_s
        after = expm(whole * step_s) @ np.array([found[0, n], samples[n], rise])
        assert found[0, n + 1] == pytest.approx(after[0], rel=1e-10)


# --- against the contour solver, and what the issue of finite plates tells


@pytest.mark.parametrize(
    ("strip", "window", "expected_db"),
    [
        (plate(K_2900, 0.01), "none", -24.73),
        (plate(SIMPLY_SUPPORTED, 0.01), "tukey", -18.00),
        (plate(K_2500, 0.005), "none", -19.7),
    ],
    ids=["2900 Hz", "supported", "2500 Hz"],
)
def test_levels_on_plates_with_free_ends(strip: Strip, window: str, expected_db: float) -> None:
    peaks_m = felt(strip, *pair(), burst(window))
    assert level_db(peaks_m, own=0, other=1) == pytest.approx(expected_db, abs=0.05)
    assert level_db(peaks_m, own=1, other=0) == pytest.approx(expected_db, abs=0.05)


PLATES = [
    (plate(SIMPLY_SUPPORTED, 0.03, 0.15, material=GLASS), 0.04, 0.0125, "hann", 600.0),
    (plate(SIMPLY_SUPPORTED, 0.005, 0.12, material=STEEL), 0.03, 0.01, "none", 400.0),
    (plate(K_2900, 0.0, None), 0.035, 0.0125, "none", 500.0),
    (plate(CLAMPED, 0.02, None), 0.035, 0.0125, "tukey", 500.0),
    (plate(CLAMPED, 0.02, 0.13, material=STEEL, width_m=0.02), 0.03, 0.01, "hann", 900.0),
    (plate(ElasticEdge(stiffness_n=60.0, lossless=False), 0.05, 0.12), 0.04, 0.011, "none", 400.0),
]
"""A plate, where its discs lie, and what drives them; the last two keep spectra busy longest."""


@pytest.mark.slow
@pytest.mark.parametrize(("strip", "x_m", "y_m", "window", "frequency_hz"), PLATES[:4])
def test_modes_agree_with_the_spectra(
    strip: Strip,
    x_m: float,
    y_m: float,
    window: str,
    frequency_hz: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    loads, tips = pair(x_m, y_m)
    drive = burst(window, frequency_hz)
    by_modes = felt(strip, loads, tips, drive)
    monkeypatch.setattr(fingertip, "by_modes", lambda *_: None)
    by_spectra = felt(strip, loads, tips, drive, rtol=1e-4)
    np.testing.assert_allclose(by_modes, by_spectra, rtol=5e-3)


@pytest.mark.parametrize("place", [0, 4, 5])
def test_the_estimate_holds_against_twice_as_many_modes(place: int) -> None:
    strip, x_m, y_m, window, frequency_hz = PLATES[place]
    loads, _ = pair(x_m, y_m)
    drive = burst(window, frequency_hz)
    scene = scene_of(strip, drive, loads, 5)
    groups = [np.arange(0, 5), np.arange(5, 10)]
    reference_hz = max(strip.cutoff_hz(), drive.band_hz()[1])
    few, many = (
        peaks_of(motion_of(scene, reference_hz, n), groups, drive, wait_s=5e-3) for n in (4.0, 9.0)
    )
    assert np.all(np.abs(few.peak_m - many.peak_m) <= 2 * few.error_m)
    assert np.all(many.error_m < 0.02 * many.peak_m)


def test_what_comes_round_a_short_period_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    strip = plate(SIMPLY_SUPPORTED, 0.0, None)
    scene, groups = scene_of(strip, burst(), pair()[0]), [np.array([0]), np.array([1])]
    errors = []
    for number, periods in enumerate((8.0, 200.0)):
        monkeypatch.setattr(MOTION, "_PERIODS", periods)
        monkeypatch.setattr(MOTION, "_SPANS", 1.0)
        # another highest frequency, for what was computed is kept
        found = peaks_of(motion_of(scene, 1926.0, 6.0 + number / 10), groups, burst(), wait_s=5e-3)
        errors.append(found.error_m[1, 0] / found.peak_m[1, 0])
    assert errors[0] > 0.05 > 5 * errors[1]


# --- drives


def test_samples_of_a_burst_do_what_the_burst_does() -> None:
    loads, tips = pair()
    fine = SampledDrive(samples=np.append(burst("hann").samples(200e3), 0.0), sample_rate_hz=200e3)
    held = SampledDrive(samples=fine.values, sample_rate_hz=200e3, held=True)
    expected = felt(plate(), loads, tips, burst("hann"))
    for drive in (fine, held):
        np.testing.assert_allclose(felt(plate(), loads, tips, drive), expected, rtol=2e-3)


def test_a_slow_load_moves_the_plate_as_a_static_one() -> None:
    motor: list[Load] = [ForceRectangle(x_m=0.01, y_m=0.0125, length_x_m=0.008, length_y_m=0.004)]
    slow = Burst(frequency_hz=5.0, cycles=2, window="hann")
    scene = scene_of(plate(), slow, motor)
    found = peaks_of(motion_of(scene, 2900.0, 8.0), [np.array([0])], slow, wait_s=1e-3)
    still = motion_of(scene, 2900.0, 8.0).oscillators
    static_m = still.rest_m[0, 0] + (still.weights(0)[0] / -still.poles).sum().real
    # two cycles in a Hann window have their largest value, 0.9, beside the middle
    assert found.peak_m[0, 0] == pytest.approx(static_m * np.abs(slow.samples(1e4)).max(), rel=1e-3)


def test_a_parabola_goes_through_looks_that_are_neighbours() -> None:
    # a wave, of which the looks between its two crests are left out
    looks = np.append(np.arange(3, 10), np.arange(27, 31))
    size = np.abs(np.sin(2 * math.pi * (looks - 0.3) / 32))
    assert crests(size[np.newaxis], looks)[0] == pytest.approx(1.0, abs=1e-4)
    assert crests(size[np.newaxis, 1:], looks[1:])[0] == pytest.approx(1.0, abs=1e-4)
    assert crests(size[np.newaxis, 6:], looks[6:])[0] == size[6:].max()


def test_answers_at_every_few_samples_are_those_at_all() -> None:
    rng = np.random.default_rng(8)
    poles = np.array([-10 - 1e3j, -40 + 1e4j, -900 + 3e4j, -1e3 + 1e5j], dtype=np.complex128)
    samples, start = rng.normal(size=41), np.asarray(poles / 1e5, dtype=np.complex128)
    for held in (False, True):
        every = followed(poles, samples, 1e-5, start, held=held)
        few = followed(poles, samples, 1e-5, start, held=held, every=4)
        np.testing.assert_allclose(few, every[:, ::4], rtol=1e-12)


def test_a_plate_without_loss_is_not_waited_for_forever() -> None:
    loads, _ = pair()
    scene, groups = scene_of(plate(loss=0.0), burst(), loads), [np.array([0]), np.array([1])]
    waits = _waits(lambda: peaks_of(motion_of(scene, 2900.0, 6.0), groups, burst(), wait_s=2e-3))
    assert 1 <= max(waits) <= 8


def _waits(call: Any) -> list[float]:
    """Return how far the stretches went that a call looked at."""
    seen: list[float] = []
    course = PEAKS._course

    def watched(*args: Any) -> Any:
        for found in course(*args):
            seen.append(found[0])
            yield found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PEAKS, "_course", watched)
        call()
    return seen


def test_what_modes_do_not_reach_is_left_to_the_spectra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fingertip, "by_spectra", lambda *_: np.full((2, 1), 7.0))
    with monkeypatch.context() as patch:
        patch.setattr(MOTION, "MOST_WAVES", 50)
        assert np.all(felt(plate(length_m=30.0), *pair(), burst()) == 7.0)
    monkeypatch.setattr(MOTION, "multiples_of", lambda *_: (1.2,))
    assert np.all(felt(plate(), *pair(), burst(), rtol=1e-6) == 7.0)


def test_the_work_of_a_finger_tells_what_was_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    short, long = (felt_work(plate(length_m=x), *pair(), burst()) for x in (0.2, 30.0))
    assert (short.is_whole, short.length_m) == (True, 0.2)
    assert short.modes > 10
    assert short.words == f"{short.modes} modes up to 23.2 kHz"
    assert not long.is_whole
    assert 1.0 < (long.length_m or 0.0) < 3.0
    assert long.words.endswith(" mm of it: no echo from farther away counts")
    monkeypatch.setattr(MOTION, "MOST_WAVES", 10)
    assert felt_work(plate(), *pair(), burst()).words.startswith("spectra, which take minutes")


def test_what_modes_exchange_moves_them_as_their_equations_have_it() -> None:
    rng, n = np.random.default_rng(3), 12
    squared, driven = rng.uniform(1, 100, n) ** 2, rng.normal(size=n)
    shared = rng.normal(size=(n, 2)) * np.array([np.arange(n) % 2, np.arange(n) % 2 == 0]).T
    shared[3] = 0.0  # one that exchanges nothing, beside the odd and the even ones
    damping = np.diag(0.01 * squared) + shared @ shared.T
    omega = 20.0
    expected = np.linalg.solve(np.diag(squared - omega**2) - 1j * omega * damping, driven)
    found, modes, drives = poles(squared, damping, 1.0)
    swings = modes @ (drives @ driven / (-1j * omega - found))
    back = modes.conj() @ (drives.conj() @ driven / (-1j * omega - found.conj()))
    np.testing.assert_allclose((swings + back) / 2, expected, rtol=1e-9)


def test_a_finger_on_the_centre_line_feels_what_both_its_halves_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    half = felt(plate(), *pair(), burst())
    monkeypatch.setattr(fingertip, "_is_even", lambda *_: False)
    np.testing.assert_allclose(felt(plate(), *pair(), burst()), half, rtol=1e-9)


@pytest.mark.slow
def test_slow_bursts_need_fewer_modes_and_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    narrow = plate(CLAMPED, width_m=0.008, length_m=0.15)
    discs = [MomentDisc(x_m=x, y_m=0.004, radius_m=0.003) for x in (-0.02, 0.02)]
    tips = [Fingertip(x_m=x, y_m=0.004, radius_m=0.003) for x in (-0.02, 0.02)]
    few = felt(narrow, discs, tips, burst())
    monkeypatch.setattr(MOTION, "_SLOW", math.inf)
    np.testing.assert_allclose(few, felt(narrow, discs, tips, burst()), rtol=5e-3)


@pytest.mark.parametrize("window", ["none", "hann", "tukey"])
def test_what_rings_after_a_slow_burst_is_found_without_looking_all_the_time(
    monkeypatch: pytest.MonkeyPatch, window: str
) -> None:
    strip, drive = plate(CLAMPED, width_m=0.01, length_m=0.15), burst(window)
    loads = [MomentDisc(x_m=x, y_m=0.005, radius_m=0.003) for x in (-0.01, 0.01)]
    points_m = tuple((x + dx, 0.005) for x in (-0.01, 0.01) for dx in (0.0, 1e-3, 2e-3))
    scene = Scene(strip=causal(strip, drive), loads=tuple(loads), points_m=points_m)
    motion = motion_of(scene, strip.cutoff_hz(), 4.0)
    groups = [np.arange(3), np.arange(3, 6)]
    fast = peaks_of(motion, groups, drive, wait_s=2e-3)
    for module in (COURSE, PARTS):
        monkeypatch.setattr(module, "is_slow", lambda *_: False)
    monkeypatch.setattr(COURSE, "_STEPS", 2048)  # with a step that ends where the burst does
    monkeypatch.setattr(PEAKS, "_NEAR", 0.0)  # at all points all the time
    slow = peaks_of(motion, groups, drive, wait_s=2e-3)
    np.testing.assert_allclose(fast.peak_m, slow.peak_m, rtol=1e-4)
    np.testing.assert_allclose(fast.error_m, slow.error_m, rtol=0.2)  # crests, or looks


@pytest.mark.parametrize("frequency_hz", [40.0, 800.0])
def test_the_points_that_are_looked_at_first_may_hardly_move(frequency_hz: float) -> None:
    strip, drive = plate(CLAMPED, width_m=0.025, length_m=0.2), burst("tukey", frequency_hz)
    disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.006)
    points_m = tuple((x_m, 0.0125) for x_m in (0.012, 0.0, 0.004))
    scene = Scene(strip=causal(strip, drive), loads=(disc,), points_m=points_m)
    motion = motion_of(scene, strip.cutoff_hz(), 5.0)
    together, *alone = (
        peaks_of(motion, [places], drive, wait_s=2e-3).peak_m[0, 0]
        for places in (np.arange(3), *np.arange(3)[:, np.newaxis])
    )
    assert alone[0] < 0.3 * max(alone)
    assert together == pytest.approx(max(alone), rel=1e-6)


# --- long plates


@pytest.mark.parametrize("length_m", [None, 0.12])
@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, K_2500, CLAMPED])
def test_a_very_low_frequency_moves_a_plate_as_at_rest(edge: Any, length_m: float | None) -> None:
    strip = plate(edge, length_m=length_m)
    load = MomentDisc(x_m=-0.03, y_m=0.0115, radius_m=0.005)
    scene = Scene(strip=strip, loads=(load,), points_m=((-0.03, 0.0115), (0.03, 0.009)))
    exact = displacement(scene, [0.0], 1e-9)[0].real
    assert np.max(abs(at_rest(scene, 1e-9) - exact)) < 1e-7 * np.max(abs(exact))


@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, K_2500, CLAMPED])
def test_ends_that_are_far_away_are_not_felt_at_rest(edge: Any) -> None:
    strip = plate(edge, length_m=0.26)
    loads = tuple(MomentDisc(x_m=x, y_m=0.0115, radius_m=0.005) for x in (-0.03, 0.03))
    points_m = ((-0.03, 0.0115), (0.03, 0.009), (0.035, 0.0125))
    scene = Scene(strip=strip, loads=loads, points_m=points_m)
    alike = without_far_ends(scene)
    assert alike.strip.length_m is None
    np.testing.assert_allclose(at_rest(alike, 1e-9), at_rest(scene, 1e-9), rtol=1e-6)
    shorter = dataclasses.replace(scene, strip=plate(edge, length_m=0.2))
    assert without_far_ends(shorter) is shorter


def test_a_long_plate_is_as_an_endless_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fingertip, "by_spectra", lambda *_: np.full((2, 1), 7.0))
    long, endless = (
        felt(plate(K_2500, 0.01, length_m), *pair(), burst()) for length_m in (100.0, None)
    )
    np.testing.assert_allclose(long, endless, rtol=1e-3)


def test_beside_one_end_of_a_long_plate_the_other_does_not_count() -> None:
    drive, found = burst("tukey"), []
    for length_m in (1.5, 30.0):
        loads, tips = pair()
        shift_m = length_m / 2 - 0.045
        near = [dataclasses.replace(load, x_m=load.x_m + shift_m) for load in loads]
        over = [dataclasses.replace(tip, x_m=tip.x_m + shift_m) for tip in tips]
        found.append(felt(plate(SIMPLY_SUPPORTED, 0.01, length_m), near, over, drive))
    short, long = found
    np.testing.assert_allclose(short, long, rtol=1e-3)
    assert abs(long[0, 1] / long[1, 0] - 1) > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("loss_factor", [1e-3, 1e-2])
@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, CLAMPED])
def test_sections_that_agree_leave_no_more_than_they_differ_by(
    edge: Any, loss_factor: float
) -> None:
    loads, _ = pair()
    near = [dataclasses.replace(load, x_m=load.x_m + 49.95) for load in loads]
    scene = scene_of(plate(edge, loss_factor, 100.0), burst(), near)
    groups = [np.array([0]), np.array([1])]
    found = [
        peaks_of(motion_of(one, 6e3, 3.0), groups, burst(), wait_s=0.05).peak_m
        for one in itertools.islice(sections(scene), 9)
    ]
    left = [np.max(np.abs(one / found[-1] - 1)) for one in found[1:-1]]
    apart = [np.max(np.abs(one / less - 1)) for less, one in itertools.pairwise(found[:-1])]
    assert apart[0] > 1e-2 > apart[-1]
    agree = [pair for pair in zip(left, apart, strict=True) if pair[1] < 0.01]
    # modes end elsewhere on each section, which is 3e-4 of the quiet finger
    assert all(here <= 1.1 * there + 4e-4 for here, there in agree)


def test_an_end_that_is_no_round_number_carries_a_finger() -> None:
    strip, finger = plate(length_m=0.1486867644596), Fingertip(x_m=0.07434338, y_m=0.0125)
    assert max(x for x, _ in finger.points_m(strip)) == 0.1486867644596 / 2


def test_a_rectangle_off_the_centre_line_needs_odd_waves_too() -> None:
    centred: list[Load] = [MomentRectangle(x_m=0.0, y_m=0.0125, length_x_m=0.01, length_y_m=0.01)]
    aside = [dataclasses.replace(centred[0], y_m=0.0123)]
    even, both = (
        motion_of(scene_of(plate(), burst(), loads), 2900.0, 6.0).oscillators.poles.size
        for loads in (centred, aside)
    )
    assert both > 1.5 * even


# --- at any times


@pytest.mark.parametrize(("held", "rtol"), [(None, 1e-2), (False, 1e-2), (True, 0.1)])
@pytest.mark.slow
def test_a_field_over_time_by_modes_is_that_of_its_spectrum(
    rtol: float, *, held: bool | None
) -> None:
    smooth = burst("hann")
    drive: Any = smooth
    if held is not None:
        samples = np.append(smooth.samples(20e3), 0.0)
        drive = SampledDrive(samples=samples, sample_rate_hz=20e3, held=held)
    scene = dataclasses.replace(
        scene_of(plate(SIMPLY_SUPPORTED, 0.02), drive, pair()[0]), driven=(True, False)
    )
    times_s = np.random.default_rng(2).uniform(-1e-4, 0.01, 60)
    ours = transient(scene, drive, times_s, rtol=rtol)
    theirs = synthesized(scene, drive, times_s, rtol=1e-4)
    assert transient_work(scene, drive, times_s, rtol=rtol).modes > 10
    assert np.all(np.abs(ours - theirs) <= rtol * np.max(np.abs(theirs), axis=0))
    assert not ours[times_s < 0].any()
    assert not ours[:, 1].any()


@pytest.mark.slow
def test_a_field_over_time_on_a_long_plate_is_that_of_an_endless_one() -> None:
    drive, times_s = burst("hann"), np.linspace(0.0, 0.01, 50)
    scenes = [
        scene_of(plate(SIMPLY_SUPPORTED, 0.02, length_m), drive, pair()[0])
        for length_m in (100.0, None)
    ]
    long, endless = (transient(scene, drive, times_s, rtol=1e-2) for scene in scenes)
    assert transient_work(scenes[0], drive, times_s, rtol=1e-2).modes > 10
    assert np.all(np.abs(long - endless) <= 2e-3 * np.max(np.abs(endless), axis=0))


def test_modes_are_not_taken_where_they_do_not_reach_what_is_wanted() -> None:
    scene = scene_of(plate(SIMPLY_SUPPORTED, 0.02), burst("hann"), pair()[0])
    assert transient_work(scene, burst("hann"), [2e-3], rtol=1e-5).modes == 0
    work = transient_work(scene, burst("hann"), [2e-3], rtol=1e-2)
    assert (
        work.skipped[0] == f"all bins: {work.modes} modes up to {work.highest_hz:.6g} Hz are enough"
    )


@pytest.mark.slow
def test_echoes_that_add_up_late_are_in_the_spectra_too(monkeypatch: pytest.MonkeyPatch) -> None:
    # after the time of one way over an end, at which the spectra stopped, they are 1 dB quieter
    acrylic = Material(youngs_modulus_pa=3.2e9, poisson_ratio=0.37, density_kg_m3=1180.0)
    strip = plate(SIMPLY_SUPPORTED, 0.005, 0.17322, material=acrylic, width_m=0.02283)
    strip = dataclasses.replace(strip, thickness_m=0.00079)
    places, drive = (-0.02595, 0.02841), Burst(frequency_hz=608.6, cycles=2, window="tukey")
    loads = [MomentDisc(x_m=x, y_m=0.01142, radius_m=0.00758) for x in places]
    tips = [Fingertip(x_m=x, y_m=0.01142, radius_m=0.004) for x in places]
    by_modes = felt(strip, loads, tips, drive)
    monkeypatch.setattr(fingertip, "by_modes", lambda *_: None)
    by_spectra = felt(strip, loads, tips, drive, rtol=1e-3)
    np.testing.assert_allclose(by_modes, by_spectra, rtol=2e-3)
    monkeypatch.setattr(sys.modules["stimuli.motion.history"], "_ECHOED", 0)
    assert felt(strip, loads, tips, drive, rtol=1e-3)[1, 0] < 0.95 * by_spectra[1, 0]
