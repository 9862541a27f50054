"""Loads: their units and sizes."""

from __future__ import annotations

import pytest

from stimuli import ForceRectangle, Load, PressureDisc, PressureRectangle
from tests.test_stimuli.plates import disc, force, patch

ROUND, OBLONG = (0.0064, 0.0064), (0.005, 0.002)


@pytest.mark.parametrize(
    ("load", "unit", "is_moment", "area_m2", "half_size_m"),
    [
        (force(), "N", False, 1, (0.0, 0.0)),
        (disc(kind=PressureDisc), "Pa", False, 1, ROUND),
        (disc(), "N m/m", True, 1, ROUND),
        (patch(0.01, 0.004, kind=PressureRectangle), "Pa", False, 1, OBLONG),
        (patch(0.01, 0.004), "N m/m", True, 1, OBLONG),
        (patch(0.01, 0.004, kind=ForceRectangle), "N", False, pytest.approx(4e-5), OBLONG),
    ],
)
def test_a_load_tells_its_unit_the_area_of_a_force_and_half_its_size(
    load: Load, unit: str, is_moment: object, area_m2: object, half_size_m: object
) -> None:
    told = (load.unit, load.is_moment, load.area_m2, load.half_size_m)
    assert told == (unit, is_moment, area_m2, half_size_m)
