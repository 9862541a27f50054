"""The plate that a study's stimuli move: its loads, loss, fingers, patches and like discs."""

from __future__ import annotations

from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING

import pytest

from experiment import StudyError, check_study, paper_study, study_gains
from experiment.check.plate import PlatePreview
from experiment.study.physics import (
    field_strip,
    fingertips_of,
    loads_of,
    loads_per_volt,
)
from stimuli import ALUMINIUM, MomentDisc, MomentRectangle, Scene
from tests.plates import study_from_text
from tests.test_experiment.studies import (
    cases,
    discs,
    facts_of,
    measured,
    message_of,
    recorded,
)

if TYPE_CHECKING:
    from experiment import Study

STRIP = (
    "[strip]\nwidth_mm = 30\nlength_mm = 150\nthickness_mm = 0.5\n"
    'material = "steel"\nedge = "clamped"\n'
)
LOSSY = "[strip]\nloss_factor = 0.01\n"
LOAD = """
[finger_load]
mass_g = 0.3
stiffness_n_m = 600.0
damping_n_s_m = 1.5
holds_up_to_hz = 1000.0
source = "our impedance head, 0.5 N"
"""
LOADED, BARE = (
    study_from_text(LOSSY + LOAD, "s.toml"),
    study_from_text(LOSSY, "s.toml"),
)
BOTH_SHAPES = study_from_text(
    """actuator = [
    {site = "right", shape = "rectangle", x_mm = 30, y_mm = 12, length_x_mm = 6, length_y_mm = 18},
    {site = "left", x_mm = -30, diameter_mm = 25},
]""",
    "study.toml",
)


def test_discs_and_rectangles_become_bonded_patches() -> None:
    loads = loads_of(BOTH_SHAPES)
    assert loads == (
        MomentDisc(x_m=-0.03, y_m=0.0125, radius_m=0.0125),
        MomentRectangle(x_m=0.03, y_m=0.012, length_x_m=0.006, length_y_m=0.018),
    )
    # the disc touches both edges, and is still on the strip
    Scene(strip=field_strip(BOTH_SHAPES), loads=loads, points_m=((0.0, 0.0),))


def test_a_plate_keeps_its_length_and_gets_a_loss_where_none_is_stated() -> None:
    strip = field_strip(paper_study(), 0.02)
    assert replace(strip, material=ALUMINIUM) == paper_study().strip
    assert (strip.length_m, strip.material.loss_factor) == (0.2, 0.02)
    for stated in ("loss_factor = 0.003", "viscous_time_us = 2.0", 'length_mm = "endless"'):
        study = study_from_text(f"[strip]\n{stated}\n", "s.toml")
        assert field_strip(study, 0.02) == study.strip


# --- fingers that load the plate ------------------------------------------------------------------


def test_the_two_fingers_load_the_plate_and_no_other_place() -> None:
    third = '[[actuator]]\nname = "third"\nx_mm = 0\ndiameter_mm = 5\n'
    study = study_from_text(discs() + third + LOAD, "s")
    left, right, other = (fingertip.impedance for fingertip in fingertips_of(study))
    assert left is not None
    assert (left, other) == (right, None)
    assert left.mass_kg == pytest.approx(3e-4)
    assert [fingertip.impedance for fingertip in fingertips_of(paper_study())] == [None, None]
    assert recorded(LOADED).finger_load == LOADED.finger_load
    assert LOADED.sha256 != BARE.sha256


@pytest.mark.slow
def test_gains_have_the_load_of_the_fingers_and_micrometres_per_volt_have_not() -> None:
    (loaded,), (bare,), (without,) = (
        study_gains(LOADED),
        study_gains(LOADED, bare=True),
        study_gains(BARE),
    )
    assert bare.per_vpp == without.per_vpp
    assert loaded.level_db(1, 0) < bare.level_db(1, 0) - 5
    assert loaded.per_vpp[0][0] != bare.per_vpp[0][0]
    assert loads_per_volt(LOADED) == loads_per_volt(BARE)


@pytest.mark.slow
def test_the_check_takes_the_worse_level_and_the_micrometres_of_the_plan() -> None:
    (gains,) = check_study(LOADED).gains
    assert gains == study_gains(LOADED)[0]
    facts = facts_of(LOSSY + LOAD)
    displacements = facts["conditions"][0]["displacements"]
    assert (displacements["finger_load"]["mass_g"], displacements["finger_load"]["applied"]) == (
        0.3,
        True,
    )
    assert "finger_load.mass_g" in facts["provenance"]["set_keys"]
    for column, actuator in enumerate(displacements["actuators"]):
        (at,) = actuator["fingers"]
        for row, um in ((column, actuator["peak_um"]), (1 - column, at["peak_um"])):
            assert um == pytest.approx(gains.per_vpp[row][column] * 200, rel=1e-3)
        # the crosstalk is the bare plate's, which is the worse
        worst = max(at["variants"], key=itemgetter("crosstalk_db"))
        assert (worst["finger_load"], worst["loss_factor"]) == (False, None)
        assert at["crosstalk_db"] == study_gains(BARE)[0].level_db(1 - column, column)
    assumed = check_study(study_from_text('[strip]\nedge = "clamped"\n' + LOAD, "s"))
    assert len(assumed.conditions[0].variants) == 4


def test_a_displacement_from_peak_to_peak_is_twice_the_amplitude() -> None:
    peak, whole = (
        study_from_text(LOSSY + discs(keys), "s")
        for keys in (measured(), measured(5.2) + 'measured_as = "peak-to-peak"\n')
    )
    assert loads_per_volt(whole) == loads_per_volt(peak)


def test_a_load_that_does_not_hold_for_a_burst_is_left_out() -> None:
    conditions = '[[condition]]\nname = "low"\nfrequency_hz = 100\n[[condition]]\nname = "main"\n'
    text = LOSSY + LOAD.replace("1000.0", "600.0") + conditions
    facts = facts_of(text)
    assert "600 Hz" in message_of(facts, "omitted_finger_load")
    _, condition = facts["conditions"]
    assert condition["displacements"]["finger_load"]["applied"] is False
    assert study_gains(study_from_text(text, "s"))[1].per_vpp == study_gains(BARE)[0].per_vpp
    assert facts_of(LOSSY)["conditions"][0]["displacements"]["finger_load"] is None


# --- patches that stiffen and load the plate ------------------------------------------------------

OWN_HEAD = measured() + 'measured_by = "own head"\n'
LAYERS = (
    "piezo_thickness_mm = 0.11\npiezo_youngs_modulus_gpa = 63\npiezo_poisson_ratio = 0.31\n"
    "piezo_density_kg_m3 = 7800\n"
)


CARRIER = (
    "carrier_thickness_mm = 0.1\ncarrier_youngs_modulus_gpa = 105\ncarrier_poisson_ratio = 0.35\n"
    "carrier_density_kg_m3 = 8530\n"
)


COUNTS = f"patch_counts = true\n{LAYERS}{CARRIER}"


D31 = "piezo_d31_pm_v = -200\n"


def patched(each: str = OWN_HEAD + COUNTS, head: str = "") -> Study:
    return study_from_text(head + discs(each), "s.toml")


def test_patches_that_count_are_on_the_plate_and_those_that_do_not_are_not() -> None:
    left, right = field_strip(patched()).patches
    assert (left.x_m, right.x_m, left.is_disc) == (-0.035, 0.035, True)
    assert [layer.density_kg_m3 for layer in left.layers] == [8530, 7800]
    assert field_strip(patched(OWN_HEAD)).patches == ()
    assert PlatePreview(patched()).strip == field_strip(patched())


@pytest.mark.slow
def test_a_measured_actuator_keeps_its_micrometres_and_another_level() -> None:
    (bare,), (counted,) = study_gains(patched(OWN_HEAD)), study_gains(patched())
    own = counted.per_vpp[0][0] / bare.per_vpp[0][0]
    assert own == pytest.approx(1, abs=0.05)
    assert counted.level_db(1, 0) == pytest.approx(-25.91, abs=0.1)
    assert bare.level_db(1, 0) == pytest.approx(-24.73, abs=0.05)


@pytest.mark.slow
def test_a_predicted_actuator_moves_the_stiffer_plate_with_its_whole_moment() -> None:
    (bare,) = study_gains(patched(D31 + LAYERS.replace("piezo_density_kg_m3 = 7800\n", "")))
    (counted,) = study_gains(patched(D31 + "patch_counts = true\n" + LAYERS))
    # between a free rim and one that is held fast, for which the stiffness has no say
    assert 1.1 < counted.per_vpp[0][0] / bare.per_vpp[0][0] < 2.2


@pytest.mark.slow
def test_the_check_tells_what_patches_do_and_how_well_it_is_known() -> None:
    (condition,) = facts_of(LOSSY + discs(OWN_HEAD + COUNTS))["conditions"]
    displacements = condition["displacements"]
    assert 0 < displacements["peak_error"] < 0.01
    assert 0 < displacements["actuators"][0]["fingers"][0]["crosstalk_error_db"] < 0.25


@pytest.mark.slow
def test_a_level_that_may_be_above_the_limit_is_unfit() -> None:
    checked = check_study(patched())
    (one,) = checked.conditions
    assert one.peak_errors is not None
    assert one.verdict == "within limits"
    level_db, doubt_db = one.level_db(1, 0), float(one.peak_errors.levels_db[1, 0])
    near = replace(one, masking_threshold_db=-level_db - doubt_db / 2)
    assert near.verdict == "violates a limit"
    assert {warning.code for warning in near.violations} == {"uncertain_crosstalk"}
    assert f"{level_db:.2f} dB" in near.reasons[0]
    past = replace(one, masking_threshold_db=-level_db - 1.1 * doubt_db)
    assert past.verdict == "within limits"
    above = replace(one, masking_threshold_db=-level_db + 0.01)
    assert {warning.code for warning in above.violations} == {"crosstalk_above_limit"}


# --- one of two like discs measured, the other assumed to move as it does -------------------------

FIVE = measured(5) + 'measured_by = "AB"\n'
AS_LEFT = 'assumed_equal_to = "left"\n'


def test_the_other_disc_moves_as_the_measured_one_and_is_not_called_measured() -> None:
    study = study_from_text(STRIP + discs(FIVE, AS_LEFT), "s")
    (left, _), (right, basis) = loads_per_volt(study)
    assert left is not None
    assert right == pytest.approx(left, rel=1e-6)
    assert basis == "predicted"
    assert study_gains(study)[0].bases == ("measured", "predicted")
    actuators = facts_of(STRIP + discs(FIVE, AS_LEFT))["actuators"]
    assert [one["displacement"] for one in actuators] == ["measured", "copied"]
    assert recorded(study) == study
    whole = FIVE + 'measured_as = "peak-to-peak"\n'
    study = study_from_text(STRIP + discs(whole, AS_LEFT), "s")
    assert study.actuators[1].basis == study.actuators[0].basis


@pytest.mark.slow
@pytest.mark.parametrize(("text", "parts"), cases("unusable"))
def test_a_study_that_cannot_be_computed_is_refused_by_its_keys(text: str, parts: str) -> None:
    with pytest.raises(StudyError) as caught:
        facts_of(text)
    assert [part for part in parts.split(" | ") if part not in str(caught.value)] == []
