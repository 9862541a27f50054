"""One of two like discs measured, the other assumed to move as it does: told everywhere."""

from __future__ import annotations

import pytest

from experiment.preview.check import check_study
from experiment.preview.check_report import check_findings
from experiment.preview.plate import drive_of
from experiment.study.physics import loads_per_volt, study_gains
from experiment.study.read import study_from_canonical, study_from_text
from experiment.study.sources import study_sources
from experiment.study.study import Study, StudyError

STRIP = (
    "[strip]\nwidth_mm = 30\nlength_mm = 150\nthickness_mm = 0.5\n"
    'material = "steel"\nedge = "clamped"\n'
)
AT = "measured_at_vpp = 100\nmeasured_at_hz = 300\n"
MEASURED = f'measured_displacement_um = 5\n{AT}measured_by = "AB"\n'


def disc(side: str, keys: str, mm: float = 12.8) -> str:
    x_mm = -35 if side == "left" else 35
    return f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ndiameter_mm = {mm}\n{keys}'


def study(left: str, right: str, mm: float = 12.8) -> Study:
    return study_from_text(STRIP + disc("left", left) + disc("right", right, mm), "s")


LIKE_LEFT = study(MEASURED, 'measured_as = "as-left"\n')


def test_the_other_disc_moves_as_the_measured_one() -> None:
    (left, _), (right, basis) = loads_per_volt(LIKE_LEFT)
    assert left is not None
    assert right == pytest.approx(left, rel=1e-6)
    assert basis == "predicted"
    (gains,) = study_gains(LIKE_LEFT)
    assert gains.bases == ("measured", "predicted")


def test_of_a_displacement_from_peak_to_peak_half_is_the_others_peak() -> None:
    left = MEASURED.replace('AB"', 'AB"\nmeasured_as = "peak-to-peak"')
    found = study(left, 'measured_as = "as-left"\n')
    assert found.actuators[1].measured_displacement_um == 2.5
    said = "5 um peak-to-peak (2.5 um peak) at 100 Vpp and 300 Hz"
    both = [one for one in study_sources(found) if one.key.endswith("measured_displacement_um")]
    assert [one.words.split(",")[0] for one in both] == [said, said]


def test_no_output_calls_it_measured() -> None:
    sources = {one.key: one for one in study_sources(LIKE_LEFT)}
    one = sources["actuator[1].measured_displacement_um"]
    peak = "taken as peak (assumed; measured_as says otherwise)"
    told = (
        f"5 um {peak} at 100 Vpp and 300 Hz, not measured: assumed equal to the left actuator's, "
    )
    assert (one.origin, one.words) == ("assumed", f"{told}measured (by: AB; on: not stated)")
    assert sources["actuator[0].measured_displacement_um"].origin == "measured"
    assert "right assumed equal to the left actuator's" in drive_of(LIKE_LEFT).basis
    text = check_findings(check_study(LIKE_LEFT), "s").text
    assert told in text
    assert "um peak, computed from your measurement at 300 Hz; " in text
    assert "um peak, computed from your measurement of the left one at 300 Hz, assumed" in text


def test_its_plan_is_read_again() -> None:
    assert study_from_canonical(LIKE_LEFT.canonical) == LIKE_LEFT


@pytest.mark.parametrize(
    ("left", "right", "mm", "told"),
    [
        ("", 'measured_as = "as-left"\n', 12.8, "measured_displacement_um is missing"),
        (MEASURED, 'measured_as = "as-left"\n', 10.0, "needs actuators of the same shape and size"),
        (MEASURED, 'measured_as = "as-right"\n', 12.8, "measured_displacement_um is missing"),
        (
            MEASURED,
            f'measured_displacement_um = 4\n{AT}measured_as = "as-left"\n',
            12.8,
            "leave out measured_displacement_um, .*, which are the left actuator's",
        ),
        (
            f'measured_displacement_um = 5\n{AT}measured_as = "as-right"\n',
            'measured_as = "as-left"\n',
            12.8,
            "needs what was measured of the right actuator itself",
        ),
    ],
)
def test_it_is_assumed_of_a_measured_disc_of_the_same_size_only(
    left: str, right: str, mm: float, told: str
) -> None:
    with pytest.raises(StudyError, match=told):
        study(left, right, mm)


def test_where_one_of_two_is_measured_the_check_names_the_key() -> None:
    found = check_findings(check_study(study(MEASURED, "")), "s").text
    assert 'measured_as = "as-left" or "as-right" assumes two like actuators to move alike' in found
