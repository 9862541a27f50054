"""Loads: their units and sizes, and what they refuse."""

from __future__ import annotations

import dataclasses
import math
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


@pytest.mark.parametrize("load", ALL, ids=lambda load: type(load).__name__)
@pytest.mark.parametrize("bad", [math.nan, math.inf, True, "0.01", None, 1e4])
def test_a_load_refuses_what_is_no_place_or_size(load: Any, bad: Any) -> None:
    for field in dataclasses.fields(load):
        with pytest.raises(ValueError, match=rf"{field.name} must be a finite number .*got"):
            dataclasses.replace(load, **{field.name: bad})


@pytest.mark.parametrize("load", ALL, ids=lambda load: type(load).__name__)
def test_a_load_refuses_negative_places_across_and_sizes_that_are_none(load: Any) -> None:
    with pytest.raises(ValueError, match="y_m must be a finite number >= 0"):
        dataclasses.replace(load, y_m=-1e-9)
    for field in dataclasses.fields(load):
        if field.name not in ("x_m", "y_m"):
            with pytest.raises(ValueError, match=f"{field.name} must be"):
                dataclasses.replace(load, **{field.name: 0.0})


def test_loads_cannot_be_changed_and_are_equal_by_value() -> None:
    load = PointForce(x_m=0, y_m=0.0125)
    assert type(load.x_m) is float
    assert load == PointForce(x_m=0.0, y_m=0.0125)
    with pytest.raises(dataclasses.FrozenInstanceError):
        load.x_m = 1.0  # type: ignore[misc]  # that this line is wrong is what is tested
