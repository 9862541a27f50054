"""The plate of a study: its loads lie where the study puts its actuators."""

from __future__ import annotations

from dataclasses import replace

from experiment.study.physics import field_strip, fingertips_of, loads_of
from experiment.study.read import paper_study, study_from_text
from stimuli import ALUMINIUM, MomentDisc, MomentRectangle, Scene

BOTH_SHAPES = study_from_text(
    """actuator = [
    {side = "right", shape = "rectangle", x_mm = 30, y_mm = 12, length_x_mm = 6, length_y_mm = 18},
    {side = "left", x_mm = -30, diameter_mm = 25},
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


def test_a_fingertip_rests_above_each_actuator() -> None:
    left, right = fingertips_of(BOTH_SHAPES)
    assert (left.x_m, left.y_m, right.x_m, right.y_m) == (-0.03, 0.0125, 0.03, 0.012)
    assert left.points_m(field_strip(BOTH_SHAPES))[0] == (-0.03, 0.0125)
