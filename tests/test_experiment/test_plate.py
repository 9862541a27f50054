"""The plate of a study: its loads lie where the study puts its actuators."""

from __future__ import annotations

from typing import TYPE_CHECKING

from experiment.study.physics import field_strip, fingertips_of, loads_of
from stimuli import MomentDisc, MomentRectangle, Scene

if TYPE_CHECKING:
    from collections.abc import Callable

    from experiment.study.study import Study

BOTH_SHAPES = """
[[actuator]]
side = "right"
shape = "rectangle"
x_mm = 30
y_mm = 12
length_x_mm = 6
length_y_mm = 18
[[actuator]]
side = "left"
x_mm = -30
diameter_mm = 25
"""


def test_discs_and_rectangles_become_bonded_patches(make_study: Callable[[str], Study]) -> None:
    assert loads_of(make_study(BOTH_SHAPES)) == (
        MomentDisc(x_m=-0.03, y_m=0.0125, radius_m=0.0125),
        MomentRectangle(x_m=0.03, y_m=0.012, length_x_m=0.006, length_y_m=0.018),
    )


def test_a_patch_that_touches_both_edges_is_still_on_the_strip(
    make_study: Callable[[str], Study],
) -> None:
    study = make_study(BOTH_SHAPES)
    Scene(strip=field_strip(study), loads=loads_of(study), points_m=((0.0, 0.0),))


def test_only_the_length_of_the_strip_is_left_out(make_study: Callable[[str], Study]) -> None:
    study = make_study("")
    assert field_strip(study).cutoff_hz() == study.strip.cutoff_hz()
    assert field_strip(study).length_m is None


def test_a_fingertip_rests_above_each_actuator(make_study: Callable[[str], Study]) -> None:
    study = make_study(BOTH_SHAPES)
    left, right = fingertips_of(study)
    assert (left.x_m, left.y_m, right.x_m, right.y_m) == (-0.03, 0.0125, 0.03, 0.012)
    assert left.points_m(field_strip(study))[0] == (-0.03, 0.0125)
