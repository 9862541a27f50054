"""A study whose actuators' patches stiffen and load its plate: what is stated, told and refused."""

from __future__ import annotations

import dataclasses
import re
from typing import TYPE_CHECKING

import pytest

from experiment.preview.check import check_study
from experiment.preview.check_report import check_findings
from experiment.preview.plate import plate_of
from experiment.study.physics import (
    bare_strip,
    field_strip,
    loads_per_volt,
    patch_errors,
    study_gains,
)
from experiment.study.read import study_from_text
from experiment.study.sources import study_sources
from experiment.study.study import StudyError
from experiment.trial.draw import draw_plan

if TYPE_CHECKING:
    from experiment.study.study import Study

MEASURED = (
    "measured_displacement_um = 2.6\nmeasured_at_vpp = 100\nmeasured_at_hz = 300\n"
    'measured_by = "own head"\n'
)
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


def study(each: str = MEASURED + COUNTS, head: str = "") -> Study:
    sides = "".join(
        f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ndiameter_mm = 12.8\n{each}'
        for side, x_mm in (("left", -35), ("right", 35))
    )
    return study_from_text(f"{head}{sides}", "s.toml")


def test_patches_that_count_are_on_the_plate_and_those_that_do_not_are_not() -> None:
    left, right = field_strip(study()).patches
    assert (left.x_m, right.x_m, left.is_disc) == (-0.035, 0.035, True)
    assert [layer.density_kg_m3 for layer in left.layers] == [8530, 7800]
    assert bare_strip(study()).patches == ()
    assert field_strip(study(MEASURED)).patches == ()


@pytest.mark.slow
def test_a_measured_actuator_keeps_its_micrometres_and_another_level() -> None:
    (bare,), (counted,) = study_gains(study(MEASURED)), study_gains(study())
    own = counted.per_vpp[0][0] / bare.per_vpp[0][0]
    assert own == pytest.approx(1, abs=0.05)
    assert counted.level_db(1, 0) == pytest.approx(-25.91, abs=0.1)
    assert bare.level_db(1, 0) == pytest.approx(-24.73, abs=0.05)


@pytest.mark.slow
def test_a_predicted_actuator_moves_the_stiffer_plate_with_its_whole_moment() -> None:
    (bare,) = study_gains(study(D31 + LAYERS.replace("piezo_density_kg_m3 = 7800\n", "")))
    (counted,) = study_gains(study(D31 + "patch_counts = true\n" + LAYERS))
    # between a free rim and one that is held fast, for which the stiffness has no say
    assert 1.1 < counted.per_vpp[0][0] / bare.per_vpp[0][0] < 2.2


@pytest.mark.slow
def test_the_check_tells_what_patches_do_and_how_well_it_is_known() -> None:
    lossy = study(head="[strip]\nloss_factor = 0.01\n")
    found = check_findings(check_study(lossy), "s.toml")
    assert "times as stiff and 2.27 times as heavy there, without glue" in found.text
    assert "patches counted: own fingers known within 0." in found.text
    (condition,) = found.facts["conditions"]
    error = condition["displacements"]["patch_error"]
    assert 0 < error["own"] < 0.01
    assert 0 < error["level_db"] < 0.25
    most = re.search(r"levels within [\d.]+ dB: (\S+) dB at most", found.text)
    others = [at["fingers"][0]["level_db"] for at in condition["displacements"]["actuators"]]
    assert most is not None
    assert float(most[1]) == pytest.approx(max(others) + error["level_db"], abs=0.06)
    assert all(one["patch_counts"] for one in found.facts["actuators"])
    told = {one.key: one.origin for one in study_sources(study())}
    counted = next(one for one in study_sources(study()) if one.key.endswith("patch_counts"))
    assert (counted.printed, counted.value, counted.origin) == ("true", True, "yours")
    assert told["actuator[0].carrier_density_kg_m3"] == "yours"


@pytest.mark.slow
def test_plan_and_check_have_the_same_gains() -> None:
    gains = study_gains(study())
    assert draw_plan(study(), participant="01", session="01", seed=1, gains=gains).gains == gains
    assert check_study(study()).gains == gains


def test_the_field_says_that_it_leaves_patches_out() -> None:
    plate = plate_of(study())
    assert plate.strip.patches == ()
    assert (
        "; patch_counts is left out: patches do not stiffen or load the plate here" in plate.remark
    )
    assert "patch" not in plate_of(study(MEASURED)).remark
    bare = [load for load, _ in loads_per_volt(study(MEASURED))]
    assert [load for load, _ in loads_per_volt(study(), bare_strip(study()))] == bare


@pytest.mark.parametrize(
    ("each", "head", "said"),
    [
        (MEASURED + COUNTS, '[strip]\nlength_mm = "endless"\n', "strip.length_mm must be a number"),
        (MEASURED + "patch_counts = true\n", "", "piezo_thickness_mm is missing; patch_counts"),
        (
            MEASURED + COUNTS.replace("piezo_density_kg_m3 = 7800\n", ""),
            "",
            "piezo_density_kg_m3 is missing; patch_counts needs it",
        ),
        (
            MEASURED + COUNTS.replace("carrier_density_kg_m3 = 8530\n", ""),
            "",
            "carrier_density_kg_m3 is missing; carrier_thickness_mm needs it",
        ),
        (D31 + LAYERS, "", "patch_counts = true is missing; piezo_density_kg_m3 needs it"),
        (MEASURED + COUNTS + D31, "", "displacement_um and piezo_d31_pm_v exclude each other"),
        (
            MEASURED + COUNTS.replace("7800", "7.8"),
            "",
            "if these are g/cm3, write piezo_density_kg_m3 = 7800",
        ),
    ],
)
def test_what_a_patch_lacks_is_asked_for_by_its_key(each: str, head: str, said: str) -> None:
    with pytest.raises(StudyError, match=said.replace("[", r"\[")):
        study(each, head)


def test_a_motor_is_no_patch() -> None:
    text = (
        '[[actuator]]\nside = "left"\nx_mm = -35\nshape = "motor"\nlength_x_mm = 10\n'
        f'length_y_mm = 10\n{COUNTS}[[actuator]]\nside = "right"\nx_mm = 35\ndiameter_mm = 12.8\n'
    )
    with pytest.raises(StudyError, match="patch_counts is for patches only; got shape = motor"):
        study_from_text(text, "s.toml")


@pytest.mark.slow
def test_a_patch_whose_displacement_is_not_known_is_named_by_its_keys() -> None:
    wide = (
        "[strip]\nwidth_mm = 60\nthickness_mm = 0.5\nlength_mm = 200\n"
        'material = "brass"\nedge = "clamped"\nloss_factor = 0.01\n'
    )
    small = study_from_text(
        wide
        + "".join(
            f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ndiameter_mm = 1\n{D31}'
            f"patch_counts = true\n{LAYERS}"
            for side, x_mm in (("left", -50), ("right", 50))
        )
        + '[burst]\nfrequency_hz = 300\nwindow = "hann"\ncycles = 2\n',
        "s.toml",
    )
    said = (
        r"what the fingers get of the (left|right) actuator \(diameter_mm = 1\) on the plate with "
        r"its patches is known to [\d.]+% only, 3% is the most; .* patch_counts = false"
    )
    with pytest.raises(StudyError, match=said):
        study_gains(small)


LOAD = (
    "[finger_load]\nmass_g = 0.2\nstiffness_n_m = 1000\ndamping_n_s_m = 2\n"
    'holds_up_to_hz = 2000\nsource = "own head"\n'
)


@pytest.mark.parametrize("load", ["", LOAD])
def test_a_plate_too_long_for_patches_is_named_by_its_keys(load: str) -> None:
    said = "length_mm = 8000 and width_mm = 25 has too many modes .* patch_counts = false"
    for each in (MEASURED + COUNTS, D31 + "patch_counts = true\n" + LAYERS):
        with pytest.raises(StudyError, match=said):
            study_gains(study(each, "[strip]\nlength_mm = 8000\n" + load))


@pytest.mark.slow
def test_the_doubt_is_that_of_the_worst_loss_that_is_tried() -> None:
    (one,) = check_study(study()).conditions
    alone = [patch_errors(study(), one.condition, (loss,)) for loss in (0.005, 0.01, 0.02)]
    worst, levels_db = one.patch_errors, [each.levels_db for each in alone if each is not None]
    assert worst is not None
    assert len(levels_db) == 3
    assert all((worst.levels_db >= each).all() for each in levels_db)
    assert worst.own == max(each.own for each in alone if each is not None)


@pytest.mark.slow
def test_a_level_that_may_be_above_the_limit_is_unfit() -> None:
    checked = check_study(study())
    (one,) = checked.conditions
    assert one.patch_errors is not None
    assert one.verdict == "fit"
    level_db, doubt_db = one.level_db(1, 0), float(one.patch_errors.levels_db[1, 0])
    near = dataclasses.replace(one, masking_limit_db=-level_db - doubt_db / 2)
    assert near.verdict == "unfit"
    assert all("cannot be excluded" in reason for reason in near.reasons)
    assert f"{level_db:.3f} dB re its own finger, known within" in near.reasons[0]
    past = dataclasses.replace(one, masking_limit_db=-level_db - 1.1 * doubt_db)
    assert past.verdict == "fit"
    above = dataclasses.replace(one, masking_limit_db=-level_db + 0.01)
    assert "; the limit is" in above.reasons[0]
