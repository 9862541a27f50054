"""Fingertips that rest on the plate: laws, and the field solver with their receptances."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from stimuli import (
    CLAMPED,
    MATERIALS,
    SIMPLY_SUPPORTED,
    BondedPatch,
    Burst,
    Fingertip,
    Impedance,
    Layer,
    Load,
    MomentDisc,
    Scene,
    Strip,
    felt,
)
from tests.test_stimuli.modes import (
    oscillators_of,
    peaks_up_to,
    steady_by_receptances,
    steady_motion,
)
from tests.test_stimuli.plates import CYCLE, DISCS, FIRM, HANN, SOFT, TIPS, W, disc, force, on

PLATE = on(FIRM, 0.2, viscous_s=5e-7)


def finger(
    mass_kg: float = 1e-7, stiffness_n_m: float = 0.0, damping: float = 0.0, up_to_hz: float = 5e3
) -> Impedance:
    return Impedance(
        mass_kg=mass_kg, stiffness_n_m=stiffness_n_m, damping_n_s_m=damping, holds_up_to_hz=up_to_hz
    )


FINGER = finger(3e-4, 600.0, 1.5)


def tip(impedance: Impedance, x_m: float, radius_m: float = 0.005, y_m: float = W / 2) -> Fingertip:
    return Fingertip(x_m=x_m, y_m=y_m, radius_m=radius_m, impedance=impedance)


def pair(impedance: Impedance | None) -> tuple[Fingertip, ...]:
    return tuple(dataclasses.replace(tip, impedance=impedance) for tip in TIPS)


def scene_on(strip: Strip, loads: tuple[Load, ...] = DISCS, *points_m: Any) -> Scene:
    return Scene(strip=strip, loads=loads, points_m=points_m or ((-0.035, W / 2), (0.035, W / 2)))


# --- laws ----------------------------------------------------------------------------------------


def test_a_finger_of_next_to_nothing_changes_nothing() -> None:
    scene = scene_on(PLATE)
    for frequency_hz in (0.0, 300.0, 2000.0, 4000.0):
        bare, light, twice = (
            steady_motion(scene, frequency_hz, tips)
            for tips in ((), pair(finger()), pair(finger(2e-7)))
        )
        np.testing.assert_allclose(light, bare, rtol=0, atol=2e-3 * np.abs(bare).max())
        if frequency_hz == 2000.0:  # 0.1 mg on 1.35 kg/m2: the deviation is that of the mass
            assert (twice - bare)[0, 0] == pytest.approx(2 * (light - bare)[0, 0], rel=1e-2)


def test_points_move_as_hard_by_loads_as_loads_by_points_under_fingers() -> None:
    places = (-0.03, 0.005), (0.06, 0.02)
    scene = scene_on(PLATE, tuple(force(*place) for place in places), *places)
    tips = tip(FINGER, 0.0), tip(finger(1e-3, 5e3, 20.0), 0.045)
    for frequency_hz in (0.0, 700.0, 3300.0):
        found = steady_motion(scene, frequency_hz, tips)
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
    found = oscillators_of(scene, 6.0, pair(impedance)).oscillators.poles
    assert np.all(found.real <= 1e-9 * np.abs(found))


def test_a_light_mass_lowers_a_resonance_by_its_part_of_the_kinetic_energy() -> None:
    """What a mass m at a point lowers a resonance by is omega^2 m phi^2 / 2, by two masses."""
    strip, place = on(CLAMPED, 0.12), (0.02, W / 2)
    scene = scene_on(strip, (force(*place),), place)
    bare = oscillators_of(scene, 6.0).oscillators
    first = np.argmin(np.abs(bare.poles))
    omega = abs(bare.poles[first])
    # a mode moves its points by phi, and is driven by phi / (i omega)
    energy = (bare.weights(0)[0, first] * 1j * omega).real
    lowered = []
    for mass_kg in (1e-7, 2e-7):
        found = oscillators_of(scene, 6.0, [tip(finger(mass_kg), *place[:1], 0.0)]).oscillators
        lowered.append((omega - np.min(np.abs(found.poles))) / mass_kg)
    assert 2 * lowered[0] - lowered[1] == pytest.approx(omega * energy / 2, rel=1e-4)
    assert lowered[0] == pytest.approx(omega * energy / 2, rel=1e-2)


# --- by receptances ------------------------------------------------------------------------------

CASES: list[tuple[Strip, tuple[Fingertip, ...]]] = [
    (PLATE, pair(FINGER)),
    (
        on(SIMPLY_SUPPORTED, 0.12, viscous_s=2e-6),
        (tip(finger(1e-3, 2e4, 5.0), -0.035), tip(finger(2e-5, 50.0, 0.2), 0.03)),
    ),
    (on(SOFT, 0.15, viscous_s=1e-6), (tip(FINGER, 0.03, 0.0, 0.009),)),
]


@pytest.mark.parametrize(("strip", "tips"), CASES)
@pytest.mark.parametrize("in_cutoffs", [0.1, 0.7, 1.3])
def test_fingers_couple_the_modes_as_receptances_do(
    strip: Strip, tips: tuple[Fingertip, ...], in_cutoffs: float
) -> None:
    frequency_hz = in_cutoffs * strip.cutoff_hz()
    scene = scene_on(strip, DISCS, (-0.035, W / 2), (0.035, W / 2), (0.032, 0.014))
    exact = steady_by_receptances(scene, tips, frequency_hz)
    few, many = (
        np.abs(steady_motion(scene, frequency_hz, tips, n) - exact).max() for n in (8.0, 14.0)
    )
    # as without fingers: what the upper modes' inertia does just above the cut-off
    assert few < 3e-3 * np.abs(exact).max()
    assert many < 5e-4 * np.abs(exact).max()


def test_a_very_stiff_finger_holds_its_area_still() -> None:
    """At rest a point moves by what the spring is pressed with."""
    place, stiffness_n_m = (0.0, W / 2), 1e8
    scene = scene_on(PLATE, (force(*place), force(0.05, 0.01)), place)
    held, free = (
        np.abs(steady_motion(scene, 0.0, tips)[:, 0])
        for tips in ([tip(finger(1e-7, stiffness_n_m), 0.0, 0.0)], ())
    )
    np.testing.assert_allclose(held * (1 + stiffness_n_m * free[0]), free, rtol=1e-3)
    assert np.all(held < 2e-3 * free)


# --- peaks ---------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, FIRM, CLAMPED], ids=["supported", "firm", "cl"])
@pytest.mark.parametrize("drive", [CYCLE, HANN], ids=["cycle", "hann"])
def test_the_estimate_holds_against_twice_as_many_modes(edge: Any, drive: Burst) -> None:
    rng, strip = np.random.default_rng(3), on(edge, 0.12, loss=0.01)
    loads = [disc(0.0055, x_m=x_m) for x_m in (-0.03, 0.03)]
    for _ in range(4):
        fingers = [finger(*10 ** rng.uniform([-5, 1, -2], [-2.5, 4.5, 1.5])) for _ in loads]
        tips = [tip(z, x_m) for z, x_m in zip(fingers, (-0.03, 0.03), strict=True)]
        cutoffs = 2900.0 / strip.cutoff_hz()
        few, many = (peaks_up_to(n * cutoffs, strip, loads, tips, drive) for n in (8.0, 17.0))
        assert np.all(np.abs(few.peak_m - many.peak_m) <= few.error_m)
        assert np.all(np.diag(few.error_m) < 0.02 * np.diag(few.peak_m))


def test_a_peak_after_the_burst_is_found_where_the_points_looked_at_first_move_least() -> None:
    # on steel, 48 mm away, the point that moves most moves twice as far as those looked at first
    steel = dataclasses.replace(MATERIALS["steel"].material, loss_factor=0.01)
    strip = Strip(width_m=0.018, thickness_m=3e-4, material=steel, edge=CLAMPED, length_m=0.184)
    drive, light = Burst(frequency_hz=500.0, cycles=2, window="none"), finger(2e-4, 500.0, 1.0, 1e3)
    tips = [tip(light, x_m, 0.003, 0.009) for x_m in (-0.04, 0.048)]
    load = MomentDisc(x_m=-0.04, y_m=0.009, radius_m=0.0045)
    points = [Fingertip(x_m=x, y_m=y, radius_m=0.0) for x, y in tips[1].points_m(strip)]
    together, alone = (felt(strip, [load], [*tips, *more], drive)[1:, 0] for more in ([], points))
    assert max(alone[1::7]) < 0.6 * max(alone[1:])
    assert together[0] == pytest.approx(max(alone[1:]), rel=1e-9)


@pytest.mark.parametrize("patched", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_heavy_finger_moves_less_and_a_light_one_as_without(*, patched: bool) -> None:
    strip = on(FIRM, 0.2, loss=0.01)
    layer = Layer(
        thickness_m=2.5e-4, youngs_modulus_pa=62e9, poisson_ratio=0.34, density_kg_m3=7800.0
    )
    patches = tuple(
        BondedPatch(
            x_m=load.x_m,
            y_m=load.y_m,
            length_x_m=0.0128,
            length_y_m=0.0128,
            layers=(layer,),
            is_disc=True,
        )
        for load in DISCS
    )
    strip = dataclasses.replace(strip, patches=patches if patched else ())
    # some 4 um/N of the area beside 10 um/N of the spring
    spring = finger(1e-7, 1e5, 5.0) if patched else finger(0.05, 1e6, 100.0)
    bare, light, heavy = (
        felt(strip, DISCS, pair(z), CYCLE if patched else HANN) for z in (None, finger(), spring)
    )
    np.testing.assert_allclose(light, bare, rtol=5e-3 if patched else 3e-3)
    assert np.all(np.diag(heavy) < (0.9 if patched else 0.3) * np.diag(bare))


def test_a_finger_that_rests_counts_for_every_load_and_below_its_limit_only() -> None:
    strip, upper_hz = on(FIRM, 0.2, loss=0.01), HANN.band_hz()[1]
    bare, loaded = (
        felt(strip, DISCS, (TIPS[0], right), CYCLE) for right in (TIPS[1], pair(FINGER)[1])
    )
    change = np.abs(loaded / bare - 1)
    assert change[1, 0] > 0.01
    assert change[1, 1] > 0.001
    assert change[0, 0] < 0.01
    bare = felt(strip, DISCS, TIPS, HANN)
    for up_to_hz, is_same in ((0.99 * upper_hz, True), (upper_hz, False)):
        tips = pair(finger(3e-4, 600.0, 1.5, up_to_hz))
        assert np.array_equal(felt(strip, DISCS, tips, HANN), bare) is is_same


@pytest.mark.slow
def test_fingers_on_a_long_plate_feel_no_echo_from_far_away() -> None:
    tips, drive = pair(finger(2e-4, 500.0, 1.0)), CYCLE
    part, whole = (felt(on(FIRM, m, loss=0.02), DISCS, tips, drive) for m in (1.7, 0.6))
    np.testing.assert_allclose(part, whole, rtol=3e-3)


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("strip", "tips", "rtol", "pattern"),
    [
        (on(FIRM), pair(FINGER), 5e-3, "^length_m "),
        (on(FIRM, 0.2, loss=0.01), (pair(FINGER)[0],) * 2, 5e-3, "^fingertips "),
        (
            on(FIRM, 0.2, loss=0.01),
            (tip(FINGER, 0.035, y_m=0.004),),
            5e-3,
            r"radius_m .* 0\.004 .*0\.005",
        ),
        (on(FIRM, 0.2, loss=0.01), pair(FINGER), 1e-6, "rtol = 1e-06"),
        (on(FIRM, 3.0, loss=1e-4), (tip(FINGER, -1.3), tip(FINGER, 1.3)), 5e-3, "^length_m .*800"),
    ],
    ids=["endless", "same place", "over an edge", "too exact", "too many modes"],
)
def test_fingers_are_refused_where_they_cannot_press(
    strip: Strip, tips: Any, rtol: float, pattern: str
) -> None:
    with pytest.raises(ValueError, match=pattern):
        felt(strip, DISCS, tips, CYCLE, rtol=rtol)
