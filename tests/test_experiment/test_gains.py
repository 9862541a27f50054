"""The gain matrix: what it tells, how it is computed, and that it is sealed once and for all."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiment import (
    ConditionGains,
    PlanError,
    StudyError,
    draw_plan,
    paper_study,
    study_gains,
)
from experiment.perception.gains import GAINS, FingerGains, significant, without_crosstalk
from experiment.tasks import SITES
from stimuli import MomentDisc, Scene, displacement
from tests.plates import study_from_text
from tests.test_experiment.studies import discs, measured, recorded_plan

KNOWN = measured()
LAYERS = (
    "piezo_thickness_mm = 0.25\npiezo_youngs_modulus_gpa = 62.1\npiezo_poisson_ratio = 0.34\n"
    "piezo_d31_pm_v = -180\n"
)
MATRIX = {
    "condition": "main",
    "actuators": ("left", "right"),
    "bases": (None, None),
    "per_vpp": ((1.0, 0.1), (0.1, 1.0)),
}


def gains_of(text: str) -> ConditionGains:
    (gains,) = study_gains(study_from_text(text, "s.toml"))
    return gains


@pytest.fixture(scope="module")
def paper() -> ConditionGains:
    (gains,) = study_gains(paper_study())
    return gains


def test_amplitudes_of_two_actuators_add() -> None:
    gains = FingerGains(per_vpp=((0.03, 0.001), (0.002, 0.02)), bases=("measured",) * 2)
    left_um, right_um = gains.amplitudes((100.0, 50.0))
    assert left_um == pytest.approx(3.05)
    assert right_um == pytest.approx(1.2)
    assert gains.amplitudes((0.0, 0.0)) == (0.0, 0.0)


@settings(deadline=None, max_examples=200)
@given(value=st.floats(1e-9, 1e9), last_bit=st.integers(-1, 1))
def test_a_rounded_number_has_four_digits_and_hides_the_last_bit(
    value: float, last_bit: int
) -> None:
    assert float(f"{significant(value):.3e}") == significant(value)
    assert significant(value) == pytest.approx(value, rel=5.1e-4)
    neighbour = math.nextafter(value, math.inf if last_bit > 0 else 0.0) if last_bit else value
    assert abs(significant(neighbour) - significant(value)) <= 1.1e-3 * value
    assert significant(significant(value)) == significant(value)


def test_a_matrix_of_known_displacements_is_in_um_and_takes_the_weaker_basis() -> None:
    matrix = ConditionGains(
        condition="main",
        actuators=("left", "right", "far"),
        bases=("measured", "predicted", None),
        per_vpp=((0.03, 0.002, 0.1), (0.001, 0.02, 0.2), (0.1, 0.1, 1.0)),
    )
    bases = ("measured", "predicted")
    assert matrix.at_fingers(SITES) == FingerGains(
        per_vpp=((0.03, 0.002), (0.001, 0.02)), bases=bases
    )
    assert (
        replace(matrix, bases=("measured", "measured", None)).at_fingers(SITES).basis == "measured"
    )
    assert matrix.level_db(1, 0) == pytest.approx(20 * math.log10(1 / 30))
    assert matrix.level_db(0, 2) == pytest.approx(-20.0)


def test_without_one_displacement_the_matrix_of_the_fingers_is_relative() -> None:
    fingers = GAINS.validate_python(
        MATRIX | {"bases": ("measured", None), "per_vpp": ((0.02, 0.1), (0.001, 1.0))}
    ).at_fingers(SITES)
    assert fingers == FingerGains(per_vpp=((1.0, 0.1), (0.05, 1.0)), bases=(None, None))
    assert fingers.peaks_um((100.0, 0.0)) is None


def test_another_crosstalk_keeps_what_an_actuator_does_at_its_own_finger() -> None:
    gains = FingerGains(per_vpp=((0.03, 0.001), (0.002, 0.02)), bases=("measured",) * 2)
    other = gains.with_crosstalk(-20.0)
    assert other.per_vpp[0] == pytest.approx((0.03, 0.002))
    assert other.per_vpp[1] == pytest.approx((0.003, 0.02))
    assert without_crosstalk(2).with_crosstalk(-200.0).amplitudes((100.0, 0.0))[1] < 1e-7


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"bases": ("measured",)}, "per_vpp"),
        ({"per_vpp": ((1.0, 0.1),)}, "per_vpp"),
        ({"per_vpp": ((1.0, 0.1), (0.1,))}, "per_vpp"),
        ({"bases": ("guessed", None)}, "'measured' or 'predicted'"),
        ({"per_vpp": ((0.0, 0.1), (0.1, 1.0))}, r"per_vpp\[0\]\[0\] .*> 0"),
        ({"per_vpp": ((1.0, -0.1), (0.1, 1.0))}, r"per_vpp\[0\]\[1\] .*>= 0"),
        ({"per_vpp": ((1.0, 0.1), (math.nan, 1.0))}, r"per_vpp\[1\]\[0\]"),
    ],
)
def test_an_impossible_matrix_is_refused_by_name(changed: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        GAINS.validate_python(MATRIX | changed)


def test_the_paper_plate_is_even_and_masks_the_other_finger(paper: ConditionGains) -> None:
    (ll, lr), (rl, rr) = paper.per_vpp
    assert (ll, lr) == (rr, rl)
    assert (paper.actuators, paper.bases) == (("left", "right"), ("measured", "measured"))
    # 2.6 um of amplitude at 100 Vpp and 300 Hz (paper, section III-B): the plate follows its load
    # up to a few hundred hertz, so the burst of 500 Hz moves it by a few per cent more
    assert 1.0 < ll * 100.0 / 2.6 < 1.1
    # the paper's plate with its free ends and a loss factor of 0.01
    assert paper.level_db(1, 0) == pytest.approx(-24.73, abs=0.05)


SLOW = measured(2.6, 50)
MOTOR = '[[actuator]]\nsite = "{}"\nshape = "motor"\nx_mm = {}\nlength_x_mm = 8\nlength_y_mm = 8\n'
MOTOR += measured(5, 300)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "basis", "least_um", "most_um"),
    [
        # far below the cut-off the plate follows the drive: the peak is that of the sine
        (
            discs(SLOW, SLOW) + "[burst]\nfrequency_hz = 50\nwindow = 'hann'",
            "measured",
            2.574,
            2.626,
        ),
        (MOTOR.format("left", -35) + MOTOR.format("right", 35), "measured", 5.0, 5.75),
        # catalogue data are good to a factor of about two; a measured disc does 2.7 um
        (discs(LAYERS, LAYERS), "predicted", 0.5, 10.0),
    ],
    ids=["slow burst", "motor", "layers"],
)
def test_at_100_vpp_an_actuator_does_what_it_is_known_to_do(
    text: str, basis: str, least_um: float, most_um: float
) -> None:
    gains = gains_of(text)
    assert gains.bases == (basis, basis)
    assert least_um < gains.per_vpp[0][0] * 100.0 < most_um


@pytest.mark.slow
def test_the_chosen_window_is_the_shortest_one_that_is_quiet_enough() -> None:
    study = study_from_text('[burst]\nwindow = "auto"\nmax_crosstalk_db = -35', "s.toml")
    (condition,) = study.conditions
    (gains,) = study_gains(study)
    assert max(gains.level_db(1, 0), gains.level_db(0, 1)) <= -35.0 + 0.05
    assert condition.drive.duration_s >= condition.sine.duration_s == 0.002


@pytest.mark.slow
def test_the_field_that_the_measured_value_is_tied_to_is_that_of_the_disc() -> None:
    # an independent way: displacement per unit moment at 300 Hz scales to 2.6 um
    study = paper_study()
    strip = replace(study.strip, length_m=None)
    disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    scene = Scene(strip=strip, loads=(disc,), points_m=((0.0, 0.0125),))
    sine_300, sine_400 = np.abs(displacement(scene, [300.0, 400.0])[:, 0, 0])
    (gains,) = study_gains(study)
    # the spectrum of the burst peaks between the two
    assert gains.per_vpp[0][0] / 0.026 == pytest.approx(sine_400 / sine_300, rel=0.05)


def test_a_plan_keeps_its_matrix_to_the_last_digit(paper: ConditionGains) -> None:
    study = study_from_text("[design]\ntrials_per_side = 2\nboth_trials = 1\n", "s.toml")
    text = draw_plan(study, participant="01", session="01", seed=1, gains=(paper,)).to_json()
    plan = recorded_plan(text)
    assert plan.gains == (paper,)
    assert plan.gains_of("main") == paper.at_fingers(SITES)
    assert plan.gains_of("unknown") == without_crosstalk(2)
    changed = json.loads(text)
    changed["gains"][0]["per_vpp"][0][0] *= 2
    with pytest.raises(PlanError, match="sealed"):
        recorded_plan(json.dumps(changed))


def near_the_first_mode(at_hz: float, keys: str = "") -> str:
    """Return a study whose discs were measured there; its plate is not the paper's."""
    sizes = "width_mm = 25.0001\nlength_mm = 200\nthickness_mm = 0.5\nmeasured_cutoff_hz = 2900\n"
    metal = "youngs_modulus_gpa = 67\npoisson_ratio = 0.346\ndensity_kg_m3 = 2700\n"
    known = measured(2.0, at_hz)
    return f"[strip]\n{sizes}{metal}{keys}{discs(known, known)}"


def test_a_displacement_is_measured_below_the_first_mode_or_cutoff() -> None:
    """The first mode is at 2891.1 Hz, where free ends swing; the cut-off is at 2900 Hz.

    In between the centre of a disc does what ends and loss make of it. The ends of a long plate
    have their mode, too.
    """
    endless = '[strip]\nlength_mm = "endless"\n' + discs(measured(2.0, 9000))
    long = near_the_first_mode(2896.0).replace("length_mm = 200", "length_mm = 10000")
    for text, first_hz in (
        (near_the_first_mode(2892.0), r"2891\.1"),
        (long, r"2894\.5"),
        (endless, "2900"),
        (discs(measured(2.6, 3000), KNOWN), "got 3000"),
    ):
        with pytest.raises(StudyError, match=rf"measured_at_hz.*{first_hz}"):
            gains_of(text)
