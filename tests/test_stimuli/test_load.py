"""Loads: their units and sizes, and what they refuse."""

from __future__ import annotations

from typing import Any

import pytest

from stimuli import (
    ForceRectangle,
    Load,
    MomentDisc,
    MomentRectangle,
    PointForce,
    PressureDisc,
    PressureRectangle,
)

RECTANGLE: dict[str, Any] = {"x_m": 0.0, "y_m": 0.0125, "length_x_m": 0.01, "length_y_m": 0.004}
DISC: dict[str, Any] = {"x_m": 0.0, "y_m": 0.0125, "radius_m": 0.0064}

ALL: list[Load] = [
    PointForce(x_m=0.0, y_m=0.0125),
    PressureDisc(**DISC),
    MomentDisc(**DISC),
    PressureRectangle(**RECTANGLE),
    MomentRectangle(**RECTANGLE),
    ForceRectangle(**RECTANGLE),
]


def test_every_load_tells_the_unit_of_its_field() -> None:
    units = [load.unit for load in ALL]
    assert units == ["N", "Pa", "N m/m", "Pa", "N m/m", "N"]
    assert [load.is_moment for load in ALL] == [False, False, True, False, True, False]


def test_only_a_force_is_spread_over_its_area() -> None:
    assert [load.area_m2 for load in ALL] == [1, 1, 1, 1, 1, pytest.approx(4e-5, rel=1e-15)]


def test_sizes_are_halved_about_the_centre() -> None:
    sizes = [load.half_size_m for load in ALL]
    disc, rectangle = (0.0064, 0.0064), (0.005, 0.002)
    assert sizes == [(0.0, 0.0), disc, disc, rectangle, rectangle, rectangle]
