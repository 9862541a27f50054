"""The gain matrix: what it tells, how it is computed, and that it is sealed once and for all."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiment.study.physics import loads_per_volt, study_gains
from experiment.study.read import paper_study, study_from_text
from experiment.study.study import StudyError
from experiment.study.window import chosen_window
from experiment.terms.gains import (
    OWN_FINGER_ONLY,
    ConditionGains,
    FingerGains,
    gains_from_json,
    significant,
)
from experiment.terms.record import format_value
from experiment.trial.draw import draw_plan
from experiment.trial.plan import PlanError, plan_from_json
from stimuli import MomentDisc, Scene, Strip, WindowChoice, displacement

MEASURED = "measured_displacement_um = {}\nmeasured_at_vpp = 100\nmeasured_at_hz = {}\n"
KNOWN = MEASURED.format(2.6, 300)
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


def discs(left: str = "", right: str = "", more: str = "") -> str:
    return (
        f'[[actuator]]\nside = "left"\nx_mm = -35\ndiameter_mm = 12.8\n{left}'
        f'[[actuator]]\nside = "right"\nx_mm = 35\ndiameter_mm = 12.8\n{right}{more}'
    )


def gains_of(text: str) -> ConditionGains:
    (gains,) = study_gains(study_from_text(text, "s.toml"))
    return gains


@pytest.fixture(scope="module")
def paper() -> ConditionGains:
    (gains,) = study_gains(paper_study())
    return gains


def test_amplitudes_of_two_actuators_add() -> None:
    gains = FingerGains(left=(0.03, 0.001), right=(0.002, 0.02), basis="measured")
    left_um, right_um = gains.amplitudes(100.0, 50.0)
    assert left_um == pytest.approx(3.05)
    assert right_um == pytest.approx(1.2)
    assert gains.amplitudes(0.0, 0.0) == (0.0, 0.0)


@settings(deadline=None, max_examples=200)
@given(value=st.floats(1e-9, 1e9), last_bit=st.integers(-1, 1))
def test_a_rounded_number_has_four_digits_and_hides_the_last_bit(
    value: float, last_bit: int
) -> None:
    shown = format_value(significant(value)).lower().split("e")[0].replace(".", "")
    assert len(shown.strip("0")) <= 4
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
    assert matrix.fingers() == FingerGains(
        left=(0.03, 0.002), right=(0.001, 0.02), basis="predicted", bases=bases
    )
    assert replace(matrix, bases=("measured", "measured", None)).fingers().basis == "measured"
    assert matrix.level_db(1, 0) == pytest.approx(20 * math.log10(1 / 30))
    assert matrix.level_db(0, 2) == pytest.approx(-20.0)


def test_without_one_displacement_the_matrix_of_the_fingers_is_relative() -> None:
    fingers = gains_from_json(
        MATRIX | {"bases": ("measured", None), "per_vpp": ((0.02, 0.1), (0.001, 1.0))}
    ).fingers()
    assert fingers == FingerGains(left=(1.0, 0.1), right=(0.05, 1.0), basis=None)
    assert fingers.peaks_um(100.0, 0.0) is None


def test_another_crosstalk_keeps_what_an_actuator_does_at_its_own_finger() -> None:
    gains = FingerGains(left=(0.03, 0.001), right=(0.002, 0.02), basis="measured")
    other = gains.with_crosstalk(-20.0)
    assert other.left == pytest.approx((0.03, 0.002))
    assert other.right == pytest.approx((0.003, 0.02))
    assert OWN_FINGER_ONLY.with_crosstalk(-200.0).amplitudes(100.0, 0.0)[1] < 1e-7


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"actuators": ("right", "left")}, "actuators must begin with left, right"),
        ({"bases": ("measured",)}, "per_vpp must have a row and a column for each"),
        ({"per_vpp": ((1.0, 0.1),)}, "per_vpp must have a row and a column for each"),
        ({"per_vpp": ((1.0, 0.1), (0.1,))}, "per_vpp must have a row and a column for each"),
        ({"bases": ("guessed", None)}, "bases must be of measured, predicted"),
        ({"per_vpp": ((0.0, 0.1), (0.1, 1.0))}, r"per_vpp\[0\]\[0\] must be a finite number > 0"),
        ({"per_vpp": ((1.0, -0.1), (0.1, 1.0))}, r"per_vpp\[0\]\[1\] must be a finite number >= 0"),
        ({"per_vpp": ((1.0, 0.1), (math.nan, 1.0))}, r"per_vpp\[1\]\[0\] must be a finite number"),
    ],
)
def test_an_impossible_matrix_is_refused_by_name(changed: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        gains_from_json(MATRIX | changed)


def test_the_paper_plate_is_even_and_masks_the_other_finger(paper: ConditionGains) -> None:
    (ll, lr), (rl, rr) = paper.per_vpp
    assert (ll, lr) == (rr, rl)
    assert (paper.actuators, paper.bases) == (("left", "right"), ("measured", "measured"))
    # 2.6 um of amplitude at 100 Vpp and 300 Hz (paper, section III-B): the plate follows its load
    # up to a few hundred hertz, so the burst of 500 Hz moves it by a few per cent more
    assert 1.0 < ll * 100.0 / 2.6 < 1.1
    # the paper's plate with its free ends and a loss factor of 0.01
    assert paper.level_db(1, 0) == pytest.approx(-24.73, abs=0.05)


@pytest.mark.slow
def test_gains_are_proportional_to_what_was_measured() -> None:
    weak, strong = gains_of(discs(MEASURED.format(1.3, 300), KNOWN)), gains_of(discs(KNOWN, KNOWN))
    assert strong.per_vpp[0][0] == pytest.approx(2 * weak.per_vpp[0][0], rel=1e-3)
    assert strong.per_vpp[1][0] == pytest.approx(2 * weak.per_vpp[1][0], rel=1e-3)
    assert strong.level_db(1, 0) == pytest.approx(weak.level_db(1, 0), abs=0.02)
    assert strong.per_vpp[0][1] == weak.per_vpp[0][1]


SLOW = MEASURED.format(2.6, 50)
MOTOR = '[[actuator]]\nside = "{}"\nshape = "motor"\nx_mm = {}\nlength_x_mm = 8\nlength_y_mm = 8\n'
MOTOR += MEASURED.format(5, 300)


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
def test_without_a_displacement_the_level_in_db_is_the_same(paper: ConditionGains) -> None:
    gains = gains_of(discs())
    assert gains.bases == (None, None)
    assert gains.per_vpp[0][0] == gains.per_vpp[1][1] == 1.0
    assert gains.level_db(1, 0) == pytest.approx(paper.level_db(1, 0), abs=0.01)


@pytest.mark.slow
def test_a_windowed_burst_is_played_with_the_same_peak() -> None:
    # the device scales every burst to a peak of 1, and so does the matrix
    text = "[burst]\nfrequency_hz = 100\nwindow = '{}'\n"
    plain, hann = (gains_of(text.format(window)) for window in ("none", "hann"))
    assert hann.per_vpp[0][0] == pytest.approx(plain.per_vpp[0][0], rel=0.05)


@pytest.mark.slow
def test_a_window_quiets_the_other_finger(paper: ConditionGains) -> None:
    assert gains_of("[burst]\nwindow = 'hann'").level_db(1, 0) < paper.level_db(1, 0) - 6


@pytest.mark.slow
def test_a_third_actuator_changes_nothing_for_the_two(paper: ConditionGains) -> None:
    more = '[[actuator]]\nside = "other"\nname = "mid"\nx_mm = 0\ndiameter_mm = 10\n'
    gains = gains_of(discs(KNOWN, KNOWN, more))
    assert gains.actuators == ("left", "right", "mid")
    assert [row[:2] for row in gains.per_vpp[:2]] == [
        pytest.approx(row, rel=1e-3) for row in paper.per_vpp
    ]
    assert gains.bases[2] is None
    assert gains.per_vpp[2][2] == 1.0


@pytest.mark.slow
def test_a_wider_fingertip_feels_at_least_as_much(paper: ConditionGains) -> None:
    wide = gains_of(discs(KNOWN + "finger_diameter_mm = 16\n", KNOWN))
    assert wide.per_vpp[0][0] >= paper.per_vpp[0][0]
    assert wide.per_vpp[0][1] > paper.per_vpp[0][1]
    assert wide.per_vpp[1] == pytest.approx(paper.per_vpp[1], rel=1e-3)


def test_a_displacement_measured_above_the_cutoff_tells_no_load() -> None:
    text = discs(MEASURED.format(2.6, 3000), KNOWN)
    with pytest.raises(
        StudyError, match=r"the left actuator: measured_at_hz must lie below .* got 3000: measure"
    ):
        study_gains(study_from_text(text, "s.toml"))


@pytest.mark.slow
def test_the_chosen_window_is_the_shortest_one_that_is_quiet_enough() -> None:
    study = study_from_text('[burst]\nwindow = "auto"\nwanted_level_db = -35', "s.toml")
    (condition,) = study.conditions
    (gains,) = study_gains(study)
    assert max(gains.level_db(1, 0), gains.level_db(0, 1)) <= -35.0 + 0.05
    assert condition.drive.duration_s >= condition.stated.duration_s == 0.002
    (plain,) = paper_study().conditions
    with pytest.raises(ValueError, match="condition main must have window = auto; got none"):
        chosen_window(study, plain)


def test_a_burst_too_high_for_the_plate_is_refused_in_the_studys_words() -> None:
    text = '[strip]\nwidth_mm = 900\nlength_mm = 2000\nthickness_mm = 0.1\nmaterial = "steel"\n'
    text += 'edge = "clamped"\n' + discs("", "")
    with pytest.raises(StudyError) as caught:
        study_gains(study_from_text(text, "s.toml"))
    assert str(caught.value).endswith(
        "the displacement: a plate of width_mm = 900 and thickness_mm = 0.1 is too wide and thin "
        "for a drive with its peak at 418.736 Hz; take a lower frequency, or a narrower or thicker "
        "plate"
    )


def test_a_drive_that_ends_too_sharply_is_told_what_helps(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Any) -> Any:
        raise ValueError("rtol must be at least 0.1 for this drive and scene, got 0.003")

    monkeypatch.setattr("experiment.study.physics.felt_of", refused)
    with pytest.raises(StudyError, match=r"ends too sharply .* fade the file out") as caught:
        study_gains(paper_study())
    assert "rtol" not in str(caught.value)


@pytest.mark.parametrize(
    ("stated", "tried"), [("", [0.005, 0.02]), ("[strip]\nloss_factor = 0.03\n", [0.03])]
)
def test_a_window_is_chosen_for_every_loss_that_the_plate_may_have(
    stated: str, tried: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    losses = []

    def chosen(strip: Strip, *args: Any, also: list[Strip]) -> Any:
        losses.extend([one.material.loss_factor for one in (strip, *also)])
        return WindowChoice(burst=args[2], level_db=-40.0, extra_s=0.0)

    monkeypatch.setattr("stimuli.shortest_window", chosen)
    # a level of its own, as a choice is kept for the check of the same study
    text = f'{stated}[burst]\nwindow = "auto"\nwanted_level_db = -35.4321'
    study_from_text(text, "s.toml")
    assert losses == tried


@pytest.mark.slow
def test_a_level_that_no_window_reaches_is_refused_in_one_line() -> None:
    text = '[burst]\nfrequency_hz = 2800\ncycles = 19\nwindow = "auto"\nwanted_level_db = -190'
    with pytest.raises(StudyError, match=r"cycles with window \w+$") as caught:
        study_from_text(text, "s.toml")
    told = str(caught.value)
    assert "window = auto: wanted_level_db must be reached" in told
    assert "Burst(" not in told
    assert "\n" not in told


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


@pytest.fixture
def contents(paper: ConditionGains) -> dict[str, Any]:
    """What a sealed plan holds."""
    study = study_from_text("[design]\ntrials_per_side = 2\nboth_trials = 1\n", "s.toml")
    plan = draw_plan(study, participant="01", session="01", seed=1, gains=(paper,))
    read: dict[str, Any] = json.loads(plan.to_json())
    return read


def test_a_plan_keeps_its_matrix_to_the_last_digit(
    contents: dict[str, Any], paper: ConditionGains
) -> None:
    plan = plan_from_json(json.dumps(contents))
    assert plan.gains == (paper,)
    assert plan.gains_of("main") == paper.fingers()
    assert plan.gains_of("unknown") == OWN_FINGER_ONLY


def test_a_changed_matrix_breaks_the_seal(contents: dict[str, Any]) -> None:
    contents["gains"][0]["per_vpp"][0][0] *= 2
    with pytest.raises(PlanError, match="changed after it was sealed"):
        plan_from_json(json.dumps(contents))


def test_a_plan_without_a_matrix_says_so() -> None:
    text = draw_plan(paper_study(), participant="01", session="01", seed=1, gains=()).to_json()
    assert json.loads(text)["gains"] == []
    assert plan_from_json(text).gains == ()


@pytest.mark.parametrize("schema", [1, 2, 4])
def test_a_plan_of_another_schema_is_refused(contents: dict[str, Any], schema: int) -> None:
    assert contents["schema"] == 3
    with pytest.raises(PlanError, match=f"schema must be 3; got {schema}"):
        plan_from_json(json.dumps(contents | {"schema": schema}))


@pytest.mark.slow
def test_the_same_study_has_the_same_matrix_again(paper: ConditionGains) -> None:
    assert study_gains(paper_study()) == (paper,)


def near_the_first_mode(at_hz: float, keys: str = "") -> str:
    """Return a study whose discs were measured there; its plate is not the paper's."""
    sizes = "width_mm = 25.0001\nlength_mm = 200\nthickness_mm = 0.5\nmeasured_cutoff_hz = 2900\n"
    metal = "youngs_modulus_gpa = 67\npoisson_ratio = 0.346\ndensity_kg_m3 = 2700\n"
    known = MEASURED.format(2.0, at_hz)
    return f"[strip]\n{sizes}{metal}{keys}{discs(known, known)}"


# The plate's first mode is at 2891.1 Hz, where its free ends swing; its cut-off is at 2900 Hz. In
# between the centre of a disc does what ends and loss make of it.
@pytest.mark.parametrize(("at_hz", "taken"), [(2888.0, True), (2891.0, True), (2892.0, False)])
def test_a_displacement_is_measured_below_the_first_mode(at_hz: float, *, taken: bool) -> None:
    study = study_from_text(near_the_first_mode(at_hz), "s.toml")
    if taken:
        assert [basis for _, basis in loads_per_volt(study)] == ["measured", "measured"]
        return
    with pytest.raises(
        StudyError, match=r"below the plate's first mode, 2891\.1\d* Hz, .* got 2892"
    ):
        loads_per_volt(study)


def test_the_first_mode_that_is_named_is_the_first_that_is_refused() -> None:
    with pytest.raises(StudyError) as caught:
        loads_per_volt(study_from_text(near_the_first_mode(2895), "s.toml"))
    first_hz = float(str(caught.value).partition("first mode, ")[2].partition(" Hz")[0])
    loads_per_volt(study_from_text(near_the_first_mode(first_hz), "s.toml"))
    with pytest.raises(StudyError):
        loads_per_volt(study_from_text(near_the_first_mode(first_hz + 0.02), "s.toml"))


def test_the_ends_of_a_long_plate_have_their_mode_as_those_of_a_short_one() -> None:
    text = near_the_first_mode(2896.0).replace("length_mm = 200", "length_mm = 10000")
    with pytest.raises(StudyError, match=r"first mode, 2894\.5"):
        loads_per_volt(study_from_text(text, "s.toml"))
