"""What a map of a plate tells of the burst, and long words in its picture."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from experiment.preview.check import check_study
from experiment.preview.field import plate_band, plate_map, plate_motion, with_bursts
from experiment.preview.field_figure import render
from experiment.preview.field_report import field_text, in_lines
from experiment.preview.plate import plate_of
from experiment.study.read import study_from_text

if TYPE_CHECKING:
    from experiment.preview.field import PlateMap

BY = "Dr. Katharina Weissenberger of the Laboratory of Haptics, with a laser, the plate being "
DISCS = "".join(
    f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ndiameter_mm = 12.8\n'
    f"measured_displacement_um = 4\nmeasured_at_vpp = 100\nmeasured_at_hz = 300\n"
    f'measured_by = "{BY}held by clamps on all of its length, without a finger"\n'
    for side, x_mm in (("left", -35), ("right", 35))
)
STEEL = (
    "[strip]\nwidth_mm = 30\nlength_mm = 150\nthickness_mm = 0.5\n"
    f'material = "steel"\nedge = "clamped"\n{DISCS}'
)


def words(field: PlateMap) -> list[str]:
    """Return the texts of a picture, as they stand in its comments, line by line."""
    return re.findall(r"<!-- (.*?) -->", render(field, "svg").decode())


@pytest.mark.slow
def test_a_map_tells_the_level_of_the_burst_by_which_the_check_decides() -> None:
    study = study_from_text(STEEL, "s")
    found = with_bursts(plate_map(plate_of(study), 500.0))
    (condition,) = check_study(study).conditions
    assert found.bursts_db == (condition.level_db(1, 0), condition.level_db(0, 1))
    told = f"burst {found.bursts_db[0]:.1f} dB"
    left, right = field_text(found, "s").splitlines()[-2:]
    assert f"right finger: {told}, tone -86.2 dB; at most" in left
    assert f"left finger: {told}, tone -86.2 dB; at most" in right
    picture = " ".join(words(found))
    assert f"burst, which decides: right finger −{-found.bursts_db[0]:.1f} dB (as in" in picture


@pytest.mark.slow
def test_a_band_and_an_animation_tell_that_level_first() -> None:
    study = study_from_text(STEEL, "s")
    (condition,) = check_study(study).conditions
    first = f"right finger: burst {condition.level_db(1, 0):.1f} dB, "
    band = with_bursts(plate_band(plate_of(study), (100.0, 3000.0), n_frequencies=9))
    assert f"left driven    {first}tone largest" in field_text(band, "s")
    assert f"left driven    {first}shown" in field_text(
        with_bursts(plate_motion(plate_of(study))), "s"
    )


@pytest.mark.slow
def test_of_several_conditions_the_burst_is_that_of_the_first() -> None:
    text = f'{STEEL}[[condition]]\nname = "a"\n[[condition]]\nname = "b"\ncycles = 2\n'
    found = with_bursts(plate_map(plate_of(study_from_text(text, "s")), 400.0))
    assert "burst of a: at the other finger, as check has it, which decides" in field_text(
        found, "s"
    )


def test_a_study_that_cannot_be_checked_has_a_map_all_the_same() -> None:
    text = f"{STEEL}[device]\nsample_rate_hz = 1000\n"
    found = with_bursts(plate_map(plate_of(study_from_text(text, "s")), 500.0))
    assert found.bursts_db == ()
    assert "actuator, of 500 Hz; of the burst: check" in field_text(found, "s")


@pytest.mark.slow
def test_who_measured_at_length_stands_below_a_map_in_several_lines() -> None:
    found = plate_map(plate_of(study_from_text(STEEL, "s")), 500.0)
    short = plate_of(study_from_text(STEEL.replace(BY, ""), "s"))
    basis = found.plate.remark
    for field in (found, replace(found, plate=short)):
        assert field.plate.remark in " ".join(words(field))
    assert in_lines(basis, 9.2, 13.5).count("\n") == 2
