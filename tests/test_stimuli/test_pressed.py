"""Fingertips that rest on the plate: laws, closed forms, and equations of motion solved at once."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from stimuli import (
    CLAMPED,
    MATERIALS,
    SIMPLY_SUPPORTED,
    Burst,
    Fingertip,
    Impedance,
    MomentDisc,
    PointForce,
    PressureRectangle,
    SampledDrive,
    Scene,
    Strip,
    displacement,
    felt,
    fingertip_peaks,
)
from tests.test_stimuli.plates import CYCLE, DISCS, FIRM, HANN, TIPS, W, force, on, patch
from tests.test_stimuli.sines import SupportedPlate

if TYPE_CHECKING:
    from stimuli import Estimate
    from stimuli.arrays import Real

PLATE = on(FIRM, 0.12, loss=0.01)
SLOW = Burst(frequency_hz=100.0, cycles=2, window="hann")


def finger(
    mass_kg: float = 1e-7, stiffness_n_m: float = 0.0, damping: float = 0.0, up_to_hz: float = 5e3
) -> Impedance:
    return Impedance(
        mass_kg=mass_kg, stiffness_n_m=stiffness_n_m, damping_n_s_m=damping, holds_up_to_hz=up_to_hz
    )


FINGER = finger(3e-4, 600.0, 1.5)


def tip(
    impedance: Impedance | None, x_m: float, radius_m: float = 0.005, y_m: float = W / 2
) -> Fingertip:
    return Fingertip(x_m=x_m, y_m=y_m, radius_m=radius_m, impedance=impedance)


def pair(impedance: Impedance | None) -> tuple[Fingertip, ...]:
    return tuple(dataclasses.replace(tip, impedance=impedance) for tip in TIPS)


def assert_equal_within_errors(
    first: Estimate[Real], second: Estimate[Real], relative: float = np.inf
) -> None:
    difference_m = abs(first.value - second.value)
    assert np.all(difference_m <= first.error + second.error)
    assert np.all(difference_m <= relative * first.value)


# --- laws ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("length_m", [0.12, pytest.param(None, marks=pytest.mark.slow)])
def test_a_finger_of_next_to_nothing_changes_nothing(length_m: float | None) -> None:
    """0.1 mg rests on some 100 mg of the plate."""
    strip, tips = dataclasses.replace(PLATE, length_m=length_m), [tip(None, 0.03, 0.0)]
    bare, light = (
        fingertip_peaks(strip, DISCS, [*tips, tip(z, -0.035, 0.0)], CYCLE) for z in (None, finger())
    )
    assert_equal_within_errors(bare, light, relative=5e-3)


def test_a_heavy_mass_holds_the_plate_still() -> None:
    peaks_m = [
        felt(PLATE, [force()], [tip(finger(mass_kg), 0.0, 0.0)], HANN)[0, 0]
        for mass_kg in (1e-7, 0.3, 1.0)
    ]
    assert peaks_m[1] < 0.15 * peaks_m[0]
    # its inertia alone then takes the force
    assert peaks_m[1] / peaks_m[2] == pytest.approx(1.0 / 0.3, rel=0.05)


@pytest.mark.parametrize("length_m", [0.12, pytest.param(None, marks=pytest.mark.slow)])
@pytest.mark.parametrize("stiffness_n_m", [1e3, 1e8])
def test_a_spring_at_rest_takes_its_part_of_the_force(
    stiffness_n_m: float, length_m: float | None
) -> None:
    """A force F moves its place by F / (K + 1 / H), with the receptance H of the plate at rest."""
    strip, place = dataclasses.replace(PLATE, length_m=length_m), (0.01, 0.011)
    scene = Scene(strip=strip, loads=(force(*place),), points_m=(place,))
    receptance_m_n = float(displacement(scene, [0.0])[0, 0, 0].real)
    tips = [tip(finger(1e-7, stiffness_n_m), place[0], 0.0, place[1])]
    peak_m = felt(strip, [force(*place)], tips, SLOW)[0, 0]
    largest_n = np.max(SLOW.samples(1e5))
    assert peak_m * (stiffness_n_m + 1 / receptance_m_n) == pytest.approx(largest_n, rel=3e-3)


@pytest.mark.slow
def test_an_impedance_is_that_of_two_halves_over_the_same_area() -> None:
    half = finger(1.5e-4, 300.0, 0.75)
    whole, halves = (
        fingertip_peaks(PLATE, DISCS, [*tips, tip(None, 0.035, 0.0)], HANN)
        for tips in ([tip(FINGER, -0.03)], [tip(half, -0.03), tip(half, -0.03)])
    )
    np.testing.assert_allclose(halves.value[1:], whole.value, rtol=1e-9)


@pytest.mark.slow
def test_fingers_and_forces_may_be_exchanged() -> None:
    places = (-0.03, 0.005), (0.04, 0.015)
    resting = [tip(FINGER, 0.0), tip(finger(1e-3, 5e3, 20.0), 0.045)]
    tips = [tip(FINGER, x_m, 0.0, y_m) for x_m, y_m in places]
    forces = [PointForce(x_m=x_m, y_m=y_m) for x_m, y_m in places]
    peaks_m = felt(PLATE, forces, [*tips, *resting], CYCLE)
    assert peaks_m[0, 1] == pytest.approx(peaks_m[1, 0], rel=1e-4)


def test_a_plate_that_is_its_own_image_has_a_symmetric_matrix() -> None:
    peaks_m = felt(PLATE, DISCS, pair(FINGER), CYCLE)
    np.testing.assert_allclose(peaks_m, peaks_m[::-1, ::-1], rtol=1e-6)


def test_a_finger_counts_for_every_load_and_below_its_limit_only() -> None:
    bare, loaded = (
        felt(PLATE, DISCS, (TIPS[0], right), CYCLE) for right in (TIPS[1], pair(FINGER)[1])
    )
    change = abs(loaded / bare - 1)
    assert change[1].min() > 1e-3
    bare, upper_hz = felt(PLATE, DISCS, TIPS, HANN), HANN.band_hz()[1]
    for up_to_hz, is_same in ((0.99 * upper_hz, True), (upper_hz, False)):
        tips = pair(dataclasses.replace(FINGER, holds_up_to_hz=up_to_hz))
        assert np.array_equal(felt(PLATE, DISCS, tips, HANN), bare) is is_same


@pytest.mark.slow
def test_fingers_on_a_long_plate_feel_what_those_on_an_endless_strip_feel() -> None:
    endless, long = (
        fingertip_peaks(on(FIRM, length_m, loss=0.02), DISCS, pair(FINGER), CYCLE)
        for length_m in (None, 2.0)
    )
    assert_equal_within_errors(endless, long, relative=3e-3)


# --- equations of motion -------------------------------------------------------------------------

PRESSING: dict[str, list[Fingertip]] = {
    "none": [],
    "light": [tip(finger(2e-5, 50.0, 0.2), 0.0)],
    "two": [tip(FINGER, -0.01, y_m=0.012), tip(FINGER, 0.02, 0.003, 0.013)],
    "damper": [tip(finger(1e-7, 0.0, 20.0), 0.01, y_m=0.014)],
    "heavy": [tip(finger(5e-3, 2e4, 5.0), -0.015)],
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name == "two" else pytest.mark.slow) for name in PRESSING],
)
def test_exponentials_of_matrices_agree(name: str) -> None:
    """Fingertips that are part of the equations of motion, in place of receptances."""
    tips, strip = PRESSING[name], on(SIMPLY_SUPPORTED, 0.07, viscous_s=2e-6)
    load = patch(0.03, 0.02, x_m=-0.01, y_m=0.012, kind=PressureRectangle)
    places_m = (-0.01, 0.012), (0.02, 0.0125), (0.03, 0.008)
    samples = np.append(HANN.samples(100e3), 0.0)
    drive = SampledDrive(samples=samples, sample_rate_hz=100e3)
    motion_m = SupportedPlate(strip, tips).history(load, drive, places_m, 5 * samples.size)
    points = [tip(None, x_m, 0.0, y_m) for x_m, y_m in places_m]
    peaks = fingertip_peaks(strip, [load], [*tips, *points], drive)
    peaks_m, errors_m = (values[len(tips) :, 0] for values in (peaks.value, peaks.error))
    difference_m = abs(peaks_m - abs(motion_m).max(axis=0))
    assert np.all(difference_m <= errors_m)
    assert np.all(difference_m < 1e-3 * peaks_m)


@pytest.mark.slow
def test_the_peak_over_an_area_is_the_largest_at_its_points() -> None:
    # on steel, 48 mm away, the point that moves most moves twice as far as others of the area
    steel = dataclasses.replace(MATERIALS["steel"].material, loss_factor=0.01)
    strip = Strip(width_m=0.018, thickness_m=3e-4, material=steel, edge=CLAMPED, length_m=0.184)
    drive, light = Burst(frequency_hz=500.0, cycles=2, window="none"), finger(2e-4, 500.0, 1.0)
    tips = [tip(light, x_m, 0.003, 0.009) for x_m in (-0.04, 0.048)]
    load = MomentDisc(x_m=-0.04, y_m=0.009, radius_m=0.0045)
    points = [tip(None, x_m, 0.0, y_m) for x_m, y_m in tips[1].points_m(strip)]
    peaks_m = felt(strip, [load], [*tips, *points], drive)[1:, 0]
    assert min(peaks_m[1:]) < 0.6 * max(peaks_m[1:])
    assert peaks_m[0] == pytest.approx(max(peaks_m[1:]), rel=1e-9)


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fingertip", "pattern"),
    [
        (tip(FINGER, 0.035, y_m=0.004), r"radius_m at most 0\.004 .*got 0\.005"),
        (tip(FINGER, 0.058), r"radius_m at most 0\.002 .*got 0\.005"),
    ],
    ids=["over an edge", "over an end"],
)
def test_fingers_are_refused_where_they_cannot_press(fingertip: Fingertip, pattern: str) -> None:
    with pytest.raises(ValueError, match=rf"^fingertips .*{pattern}"):
        felt(PLATE, DISCS, [fingertip], CYCLE)
    without: Any = dataclasses.replace(fingertip, impedance=None)
    assert felt(PLATE, DISCS, [without], CYCLE).all()
