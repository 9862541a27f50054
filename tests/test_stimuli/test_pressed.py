"""Fingertips that rest on the plate: laws, and the contour solver with their receptances."""

from __future__ import annotations

import dataclasses
import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from stimuli import (
    CLAMPED,
    MATERIALS,
    SIMPLY_SUPPORTED,
    BondedPatch,
    Burst,
    ElasticEdge,
    Fingertip,
    Impedance,
    Layer,
    MomentDisc,
    PointForce,
    PressureDisc,
    Scene,
    Strip,
    displacement,
    felt,
)
from stimuli.fingers.dampers import Lossy, Ties, coupled_poles
from stimuli.fingers.fingertip import asked, causal, pressed_of
from stimuli.fingers.impedance import Pressed
from stimuli.fingers.pressed import pressed_motion
from stimuli.motion.motion import motion_of, reference_of
from stimuli.motion.peaks import peaks_of
from tests.test_stimuli.plates import CYCLE, DISCS, FIRM, HANN, SOFT, TIPS, W, on

if TYPE_CHECKING:
    from stimuli.arrays import Complex, Real
    from stimuli.load import Load
    from stimuli.motion.motion import Motion

PLATE = on(FIRM, 0.2, viscous_s=5e-7)


def finger(
    mass_kg: float = 1e-7, stiffness_n_m: float = 0.0, damping: float = 0.0, up_to_hz: float = 5e3
) -> Impedance:
    return Impedance(
        mass_kg=mass_kg,
        stiffness_n_m=stiffness_n_m,
        damping_n_s_m=damping,
        holds_up_to_hz=up_to_hz,
    )


FINGER = finger(3e-4, 600.0, 1.5)


def test_a_peak_after_the_burst_is_found_where_the_points_looked_at_first_move_least() -> None:
    # on steel, 48 mm away, the point that moves most moves twice as far as those looked at first
    steel = dataclasses.replace(MATERIALS["steel"].material, loss_factor=0.01)
    strip = Strip(width_m=0.018, thickness_m=3e-4, material=steel, edge=CLAMPED, length_m=0.184)
    drive, light = Burst(frequency_hz=500.0, cycles=2, window="none"), finger(2e-4, 500.0, 1.0, 1e3)
    tips = [
        Fingertip(x_m=x_m, y_m=0.009, radius_m=0.003, impedance=light) for x_m in (-0.04, 0.048)
    ]
    disc = MomentDisc(x_m=-0.04, y_m=0.009, radius_m=0.0045)
    scene, (_, far), _ = asked(strip, [disc], tips, drive)
    motion = pressed_motion(
        scene, reference_of(scene, drive), 11.2, pressed_of(scene.strip, tips, drive)
    )
    every = [far, *far[:, np.newaxis]]
    together, *alone = peaks_of(motion, every, drive, wait_s=8e-3, with_error=False).peak_m[:, 0]
    assert max(alone[::7]) < 0.6 * max(alone)
    assert together == pytest.approx(max(alone), rel=1e-9)


def pressing(impedance: Impedance, *x_m: float, radius_m: float = 0.005) -> tuple[Pressed, ...]:
    """Fingers on the centre line."""
    areas = [PressureDisc(x_m=x, y_m=W / 2, radius_m=radius_m) for x in x_m]
    return tuple(Pressed(over=area, impedance=impedance) for area in areas)


def scene_on(strip: Strip, loads: tuple[Load, ...] = DISCS, *points_m: Any) -> Scene:
    return Scene(strip=strip, loads=loads, points_m=points_m or ((-0.035, W / 2), (0.035, W / 2)))


def with_fingers(
    scene: Scene, reference_hz: float, multiple: float, pressed: tuple[Pressed, ...] = ()
) -> Motion:
    """Oscillators with fingers, or without any."""
    if not pressed:
        return motion_of(scene, reference_hz, multiple)
    return pressed_motion(scene, reference_hz, multiple, pressed)


def moved(motion: Motion, frequency_hz: float) -> Complex:
    """What the oscillators make of a tone: (n_loads, n_points)."""
    found, s = motion.oscillators, -2j * math.pi * frequency_hz
    n_loads = found.rest_m.shape[0]
    weights = np.stack([found.weights(load) for load in range(n_loads)])
    both = weights / (s - found.poles) + weights.conj() / (s - found.poles.conj())
    return np.asarray(both.sum(axis=-1) / 2 + found.rest_m / (1 + s * motion.viscous_s))


def nodes_of(over: PressureDisc | PointForce, n: int = 8) -> tuple[list[Any], Real]:
    """Places and weights of the mean over a contact area, by Gauss and by equal angles."""
    if isinstance(over, PointForce):
        return [(over.x_m, over.y_m)], np.ones(1)
    gauss, weights = np.polynomial.legendre.leggauss(n)
    reach, angle = over.radius_m * (gauss + 1) / 2, math.pi / n * np.arange(2 * n)
    x = over.x_m + np.outer(reach, np.cos(angle))
    y = over.y_m + np.outer(reach, np.sin(angle))
    share = np.repeat(weights * (gauss + 1) / 2 / (2 * n), 2 * n)
    return list(zip(x.ravel().tolist(), y.ravel().tolist(), strict=True)), share


def by_receptances(scene: Scene, pressed: tuple[Pressed, ...], frequency_hz: float) -> Complex:
    """The same by the contour solver: fingers' pressures as loads, their areas as receivers."""
    if not pressed:
        return np.asarray(displacement(scene, [frequency_hz], 1e-8)[0])
    found = [nodes_of(one.over) for one in pressed]
    n_loads, n_points = len(scene.loads), len(scene.points_m)
    whole = dataclasses.replace(
        scene,
        loads=scene.loads + tuple(one.over for one in pressed),
        points_m=scene.points_m + tuple(node for nodes, _ in found for node in nodes),
    )
    moved_m = displacement(whole, [frequency_hz], 1e-8)[0]
    moved_m[n_loads:] /= np.array([[one.area_m2] for one in pressed])
    starts = n_points + np.cumsum([0] + [len(nodes) for nodes, _ in found[:-1]])
    means = np.stack(
        [
            moved_m[:, start : start + share.size] @ share
            for start, (_, share) in zip(starts, found, strict=True)
        ],
        axis=1,
    )
    omega = 2 * math.pi * frequency_hz
    z = [one.impedance for one in pressed]
    back = np.diag(
        [f.stiffness_n_m - 1j * omega * f.damping_n_s_m - omega**2 * f.mass_kg for f in z]
    )
    # means = bare means - receptance (force of the fingers), force = back means
    force = back @ np.linalg.solve(np.eye(len(z)) + means[n_loads:].T @ back, means[:n_loads].T)
    return np.asarray(moved_m[:n_loads, :n_points] - force.T @ moved_m[n_loads:, :n_points])


# --- laws


def test_a_finger_of_next_to_nothing_changes_nothing() -> None:
    scene = scene_on(PLATE)
    bare, light = (with_fingers(scene, 2900.0, 8.0, pressed) for pressed in ((), _pair(finger())))
    for frequency_hz in (0.0, 300.0, 2000.0, 4000.0):
        one, other = (moved(motion, frequency_hz) for motion in (bare, light))
        np.testing.assert_allclose(other, one, rtol=0, atol=2e-3 * np.abs(one).max())
    # 0.1 mg on 1.35 kg/m2: the deviation is that of the mass
    more = moved(with_fingers(scene, 2900.0, 8.0, _pair(finger(2e-7))), 2000.0)
    ratio = (more - moved(bare, 2000.0)) / (moved(light, 2000.0) - moved(bare, 2000.0))
    assert ratio[0, 0] == pytest.approx(2.0, rel=1e-2)


def _pair(impedance: Impedance) -> tuple[Pressed, ...]:
    return pressing(impedance, -0.035, 0.035)


@pytest.mark.slow
def test_a_very_stiff_finger_holds_its_area_still() -> None:
    area = PressureDisc(x_m=0.0, y_m=W / 2, radius_m=0.005)
    loads = PointForce(x_m=0.0, y_m=W / 2), PointForce(x_m=0.05, y_m=0.01), area
    nodes, share = nodes_of(area)
    scene, stiffness_n_m = scene_on(PLATE, loads, *nodes), 1e8
    stiff = with_fingers(scene, 2900.0, 8.0, pressing(finger(1e-7, stiffness_n_m), 0.0))
    bare = with_fingers(scene, 2900.0, 8.0)
    for frequency_hz in (0.0, 500.0, 3000.0):
        held, free = (moved(one, frequency_hz) @ share for one in (stiff, bare))
        # the area's own receptance and the spring share what would move it
        kept = 1 + stiffness_n_m * free[2] / one_area_m2(0.005)
        np.testing.assert_allclose(held * kept, free, rtol=1e-3)
        assert np.all(np.abs(held) < 2e-3 * np.abs(free))


def one_area_m2(radius_m: float) -> float:
    return math.pi * radius_m**2


def test_points_move_as_hard_by_loads_as_loads_by_points_under_fingers() -> None:
    forces = PointForce(x_m=-0.03, y_m=0.005), PointForce(x_m=0.06, y_m=0.02)
    scene = scene_on(PLATE, forces, *((force.x_m, force.y_m) for force in forces))
    unequal = pressing(FINGER, 0.0) + pressing(finger(1e-3, 5e3, 20.0), 0.045)
    motion = with_fingers(scene, 2900.0, 8.0, unequal)
    for frequency_hz in (0.0, 700.0, 3300.0):
        found = moved(motion, frequency_hz)
        assert abs(found[0, 1] - found[1, 0]) < 1e-5 * np.abs(found).max()


@pytest.mark.parametrize("viscous_s", [0.0, 5e-7, 1e-4])
@pytest.mark.parametrize(
    "impedance",
    [
        FINGER,
        finger(),
        finger(1.0, 1e8, 1e5),
        finger(1e-7, 1e8),
        finger(1e-7, 0.0, 1e5),
        finger(1e-2),
    ],
    ids=str,
)
def test_fingers_only_take_energy(impedance: Impedance, viscous_s: float) -> None:
    scene = scene_on(on(FIRM, 0.12, viscous_s=viscous_s))
    found = with_fingers(scene, 2900.0, 6.0, _pair(impedance)).oscillators.poles
    assert np.all(found.real <= 1e-9 * np.abs(found))


@pytest.mark.parametrize("dampers", [(3.0, 0.1), (0.4, -0.02), (40.0, 25.0), (3e3, 1e3)])
def test_poles_on_dampers_are_those_of_the_whole_matrix(dampers: tuple[float, float]) -> None:
    rng = np.random.default_rng(5)
    squared = np.sort(rng.uniform(1.0, 30.0, 40)) ** 2
    squared[7] = squared[6]  # where modes are alike, and where dampers leave one alone
    grips = rng.normal(size=(2, 40)) / 6
    grips[:, 3] = 0.0
    loss = 1e-3 * np.diag(squared) + (grips.T * dampers) @ grips
    ties = Ties(grips, np.array(dampers))
    found = coupled_poles(squared, Lossy(1e-3 * squared, ties), (np.eye(40), np.eye(40)))
    assert _differs(found, loss, np.diag(squared), rng.normal(size=40)) < 1e-9


@pytest.mark.parametrize("late_s", [0.0, 1e-3, 0.05])
@pytest.mark.parametrize("one_takes_both", [False, True])
def test_poles_on_springs_are_those_of_the_whole_matrices(
    late_s: float, monkeypatch: pytest.MonkeyPatch, *, one_takes_both: bool
) -> None:
    rng = np.random.default_rng(5)
    squared = np.repeat(np.sort(rng.uniform(1.0, 30.0, 20)) ** 2, 2)  # cosines and sines
    lost = 1e-3 * squared * np.repeat(rng.uniform(0.5, 1.0, 20), 2)
    grips = rng.normal(size=(2, 40))
    if one_takes_both:
        grips[1] = 0.0
    ties = Ties(grips, np.array([40.0, 7.0]), (1.0, late_s))
    monkeypatch.setattr(np.linalg, "eig", None)  # what is returned is sought pole by pole
    found = coupled_poles(squared, Lossy(lost, ties), (np.eye(40), np.eye(40)))
    loss, stiff = np.diag(lost) + late_s * ties.every, np.diag(squared) + ties.every
    assert _differs(found, loss, stiff, rng.normal(size=40)) < 1e-9


def _differs(found: tuple[Complex, Complex, Complex], loss: Real, stiff: Real, push: Real) -> float:
    """Return by what part poles move modes differently than their matrices at frequencies."""
    poles, modes, pushes = found
    drives = pushes.T
    parts = []
    for s in (0.3 + 2j, 7j, 31.7j):
        whole = np.linalg.solve(s**2 * np.eye(push.size) + s * loss + stiff, push)
        swings = (drives @ push) / (s - poles), (drives @ push).conj() / (s - poles.conj())
        ours = (modes @ swings[0] + modes.conj() @ swings[1]) / 2
        parts.append(np.abs(ours - whole).max() / np.abs(whole).max())
    return float(max(parts))


@pytest.mark.slow
def test_a_light_mass_lowers_a_resonance_by_its_part_of_the_kinetic_energy() -> None:
    strip = on(CLAMPED, 0.12)
    area = PressureDisc(x_m=0.02, y_m=W / 2, radius_m=0.004)
    nodes, share = nodes_of(area)
    bare = with_fingers(scene_on(strip, DISCS, *nodes), strip.cutoff_hz(), 6.0).oscillators
    first = np.argmin(np.abs(bare.poles))
    omega = abs(bare.poles[first])
    # a mode moves its points by phi, and is driven by the disc's phi / (i omega)
    by_disc = with_fingers(scene_on(strip, (area,), *nodes), strip.cutoff_hz(), 6.0).oscillators
    mean = (by_disc.weights(0)[:, first] @ share * 1j * omega).real / (one_area_m2(0.004))
    # omega^2 is strain energy over kinetic energy, which grows by m phi^2 of a mode of mass 1
    expected = omega * mean / 2
    lowered = []
    for mass_kg in (1e-7, 2e-7):
        pressed = (Pressed(over=area, impedance=finger(mass_kg)),)
        found = with_fingers(scene_on(strip), strip.cutoff_hz(), 6.0, pressed).oscillators
        lowered.append((omega - np.min(np.abs(found.poles))) / mass_kg)
    assert 2 * lowered[0] - lowered[1] == pytest.approx(expected, rel=1e-4)
    assert lowered[0] == pytest.approx(expected, rel=1e-2)


# --- against the contour solver


CASES = [
    (on(FIRM, 0.2, viscous_s=5e-7), _pair(FINGER)),
    (
        on(SIMPLY_SUPPORTED, 0.12, viscous_s=2e-6),
        pressing(finger(1e-3, 2e4, 5.0), -0.035) + pressing(finger(2e-5, 50.0, 0.2), 0.03),
    ),
    (
        on(SOFT, 0.15, viscous_s=1e-6),
        (Pressed(over=PointForce(x_m=0.03, y_m=0.009), impedance=FINGER),),
    ),
]


@pytest.mark.slow
@pytest.mark.parametrize(("strip", "pressed"), CASES)
@pytest.mark.parametrize("in_cutoffs", [0.1, 0.7, 1.3])
def test_fingers_couple_the_modes_as_receptances_do(
    strip: Strip, pressed: tuple[Pressed, ...], in_cutoffs: float
) -> None:
    cutoff_hz = strip.cutoff_hz()
    scene = scene_on(strip, DISCS, (-0.035, W / 2), (0.035, W / 2), (0.032, 0.014))
    exact = by_receptances(scene, pressed, in_cutoffs * cutoff_hz)
    few, many = (
        np.abs(
            moved(with_fingers(scene, cutoff_hz, n, pressed), in_cutoffs * cutoff_hz) - exact
        ).max()
        for n in (8.0, 14.0)
    )
    # as without fingers: what the upper modes' inertia does just above the cut-off
    assert few < 3e-3 * np.abs(exact).max()
    assert many < 5e-4 * np.abs(exact).max()


@pytest.mark.long
def test_fingers_couple_the_modes_of_random_plates_as_receptances_do() -> None:
    rng = np.random.default_rng(12)
    errors: list[float] = []
    bare_errors: list[float] = []
    for _ in range(40):
        edges: Any = [SIMPLY_SUPPORTED, CLAMPED, ElasticEdge(stiffness_n=10 ** rng.uniform(0.5, 3))]
        name = ["aluminium", "steel", "glass", "brass", "pmma"][rng.integers(5)]
        lossy = dataclasses.replace(MATERIALS[name].material, loss_factor=rng.uniform(0.005, 0.05))
        strip = Strip(
            width_m=rng.uniform(0.015, 0.03),
            thickness_m=rng.uniform(2e-4, 1e-3),
            length_m=rng.uniform(0.1, 0.2),
            material=lossy,
            edge=edges[rng.integers(3)],
        )
        strip = causal(strip, CYCLE)
        x_m, y_m = rng.uniform(0.015, 0.04, 2), strip.width_m * rng.uniform(0.45, 0.55, 2)
        pressed = tuple(
            Pressed(
                over=PressureDisc(x_m=x, y_m=y, radius_m=rng.uniform(0.002, 0.0065)),
                impedance=finger(*10 ** rng.uniform([-5, 1, -2], [-2.5, 4.5, 1.5])),
            )
            for x, y in zip(x_m * [-1, 1], y_m, strict=True)
        )
        loads = tuple(MomentDisc(x_m=p.over.x_m, y_m=p.over.y_m, radius_m=0.005) for p in pressed)
        scene = scene_on(strip, loads, *((load.x_m, load.y_m) for load in loads))
        for at_hz in strip.cutoff_hz() * rng.uniform(0.02, 1.5, 3):
            for fingers, found in ((pressed, errors), ((), bare_errors)):
                exact = by_receptances(scene, fingers, at_hz)
                ours = moved(with_fingers(scene, strip.cutoff_hz(), 8.0, fingers), at_hz)
                found.append(np.abs(ours - exact).max() / np.abs(exact).max())
    told = [(np.median(one), np.quantile(one, 0.99), max(one)) for one in (errors, bare_errors)]
    assert told[0][0] < 2 * told[1][0], told
    assert told[0][2] < 3 * told[1][2], told


# --- what is felt


@pytest.mark.slow
@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, FIRM, CLAMPED], ids=["supported", "firm", "cl"])
@pytest.mark.parametrize("drive", [CYCLE, HANN], ids=["cycle", "hann"])
def test_the_estimate_holds_against_twice_as_many_modes(edge: Any, drive: Burst) -> None:
    rng = np.random.default_rng(3)
    strip = causal(on(edge, 0.12, loss=0.01), drive)
    loads = tuple(MomentDisc(x_m=x, y_m=W / 2, radius_m=0.0055) for x in (-0.03, 0.03))
    points = [(load.x_m + a, load.y_m + b) for load in loads for a in (0, 3e-3) for b in (0, 3e-3)]
    scene, groups = scene_on(strip, loads, *points), [np.arange(4), np.arange(4, 8)]
    for _ in range(4):
        fingers = [finger(*10 ** rng.uniform([-5, 1, -2], [-2.5, 4.5, 1.5])) for _ in loads]
        pressed = pressing(fingers[0], -0.03) + pressing(fingers[1], 0.03)
        few, many = (
            peaks_of(with_fingers(scene, 2900.0, n, pressed), groups, drive, wait_s=8e-3)
            for n in (8.0, 17.0)
        )
        assert np.all(np.abs(few.peak_m - many.peak_m) <= few.error_m)
        assert np.all(np.diag(few.error_m) < 0.02 * np.diag(few.peak_m))


def test_a_heavy_finger_feels_less_and_no_finger_what_it_felt() -> None:
    drive, strip = HANN, on(FIRM, 0.2, loss=0.01)
    bare = felt(strip, DISCS, TIPS, drive)
    light, heavy = (
        felt(strip, DISCS, [dataclasses.replace(tip, impedance=impedance) for tip in TIPS], drive)
        for impedance in (finger(), finger(0.05, 1e6, 100.0))
    )
    np.testing.assert_allclose(light, bare, rtol=3e-3)
    assert np.all(np.diag(heavy) < 0.3 * np.diag(bare))


@pytest.mark.slow
def test_fingers_press_on_plates_with_patches_too() -> None:
    layer = Layer(
        thickness_m=2.5e-4, youngs_modulus_pa=62e9, poisson_ratio=0.34, density_kg_m3=7800.0
    )
    patches = tuple(
        BondedPatch(
            x_m=disc.x_m,
            y_m=disc.y_m,
            length_x_m=0.0128,
            length_y_m=0.0128,
            layers=(layer,),
            is_disc=True,
        )
        for disc in DISCS
    )
    strip = dataclasses.replace(on(FIRM, 0.12, loss=0.01), patches=patches)
    bare, light, heavy = (
        felt(strip, DISCS, [dataclasses.replace(tip, impedance=z) for tip in TIPS], CYCLE)
        for z in (None, finger(), finger(1e-7, 1e5, 5.0))
    )
    np.testing.assert_allclose(light, bare, rtol=5e-3)
    # some 4 um/N of the area beside 10 um/N of the spring
    assert np.all(np.diag(heavy) < 0.9 * np.diag(bare))


def test_a_finger_that_rests_counts_for_every_load() -> None:
    strip = on(FIRM, 0.2, loss=0.01)
    rests = dataclasses.replace(TIPS[1], impedance=FINGER)
    bare, loaded = (felt(strip, DISCS, (TIPS[0], tip), CYCLE) for tip in (TIPS[1], rests))
    change = np.abs(loaded / bare - 1)
    assert change[1, 0] > 0.01
    assert change[1, 1] > 0.001
    assert change[0, 0] < 0.01


def test_a_finger_is_left_out_above_its_band() -> None:
    strip, upper_hz = on(FIRM, 0.2, loss=0.01), HANN.band_hz()[1]
    bare = felt(strip, DISCS, TIPS, HANN)
    for up_to_hz, same in ((0.99 * upper_hz, True), (upper_hz, False)):
        resting = finger(3e-4, 600.0, 1.5, up_to_hz)
        tips = [dataclasses.replace(tip, impedance=resting) for tip in TIPS]
        assert np.array_equal(felt(strip, DISCS, tips, HANN), bare) is same


# --- refusals


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ((0.0, 1.0, 1.0), "mass_kg must be a finite number >= 1e-07 and <= 1, got 0.0"),
        ((1e-4, -1.0, 1.0), "stiffness_n_m must be"),
        ((1e-4, 1.0, math.inf), "damping_n_s_m must be"),
    ],
)
def test_an_impedance_out_of_range_is_refused(
    values: tuple[float, float, float], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        finger(*values)


def test_fingers_press_on_plates_with_ends_only() -> None:
    tips = [dataclasses.replace(tip, impedance=FINGER) for tip in TIPS]
    with pytest.raises(ValueError, match="length_m must be a number where fingers press"):
        felt(on(FIRM), DISCS, tips, HANN)


def test_fingers_press_on_places_apart() -> None:
    tips = [dataclasses.replace(TIPS[0], impedance=FINGER)] * 2
    with pytest.raises(ValueError, match="fingertips must press on places apart"):
        felt(on(FIRM, 0.2, loss=0.01), DISCS, tips, HANN)


def test_a_finger_over_an_edge_is_not_pressed() -> None:
    tip = Fingertip(x_m=0.035, y_m=0.004, impedance=FINGER)
    with pytest.raises(ValueError, match=r"wholly on the strip, radius_m at most 0\.004"):
        felt(on(FIRM, 0.2, loss=0.01), DISCS, (tip,), HANN)


def test_a_plate_of_too_many_modes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["stimuli.fingers.pressed"], "MOST_COUPLED", 10)
    with pytest.raises(ValueError, match="at most 10 where fingers press"):
        with_fingers(scene_on(PLATE), 2900.0, 7.9, _pair(FINGER))


def test_fingers_are_refused_where_modes_are_not_enough() -> None:
    tips = [dataclasses.replace(tip, impedance=FINGER) for tip in TIPS]
    short = Burst(frequency_hz=500.0, cycles=1, window="none")
    with pytest.raises(ValueError, match="fingertips must have no impedance where"):
        felt(on(FIRM, 0.2, loss=0.01), DISCS, tips, short, rtol=1e-6)


@pytest.mark.slow
def test_fingers_on_a_long_plate_feel_no_echo_from_far_away(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tips = [dataclasses.replace(tip, impedance=finger(2e-4, 500.0, 1.0)) for tip in TIPS]
    long = on(FIRM, 1.7, loss=0.02)
    part = felt(long, DISCS, tips, CYCLE)
    monkeypatch.setattr(sys.modules["stimuli.fingers.pressed"], "echoless", lambda scene, *_: scene)
    np.testing.assert_allclose(part, felt(long, DISCS, tips, CYCLE), rtol=3e-3)
