"""Fingertips: points that stand for a contact area."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stimuli import CLAMPED, SIMPLY_SUPPORTED, Fingertip, Load, MomentDisc, Strip, displacement
from tests.test_stimuli.plates import DISCS, PLATE, TIPS, Edge, disc, force, on, patch, scene_of

if TYPE_CHECKING:
    from collections.abc import Iterable

TIP = TIPS[1]
SHORT = on(CLAMPED, 0.2)
LOADS: list[Load] = [disc(), patch(0.01, 0.003), force()]
PLACES = [
    *((0.0, 0.0125), (0.003, 0.0145), (0.002, 0.0085), (0.012, 0.0125), (0.015, 0.0155)),
    *((0.0, 0.022), (0.07, 0.0125), (0.07, 0.0165)),
]


def test_the_centre_comes_first_and_all_points_lie_in_the_disc() -> None:
    points = np.array(TIP.points_m(PLATE))
    assert points[0].tolist() == [0.035, 0.0125]
    reach_m = np.hypot(points[:, 0] - 0.035, points[:, 1] - 0.0125)
    assert np.max(reach_m) == pytest.approx(0.005, abs=2e-12)


def test_the_points_are_the_same_on_either_side_of_the_centre() -> None:
    points = TIP.points_m(PLATE)
    offsets = {(round(x - 0.035, 11), round(y - 0.0125, 11)) for x, y in points}
    assert len(offsets) == len(points) == 49
    assert offsets == {(-x, y) for x, y in offsets} == {(x, -y) for x, y in offsets}


def test_two_fingers_on_two_discs_repeat_their_pairs() -> None:
    points = (point for tip in TIPS for point in tip.points_m(PLATE))
    work = scene_of(PLATE, DISCS, *points).work([500.0])
    # a quarter of the own finger's points and half of the other's
    assert (work.pairs_asked, work.pairs_solved) == (196, 16 + 28)


def dense(tip: Fingertip, strip: Strip, rings: int = 12) -> tuple[tuple[float, float], ...]:
    """Points of a dense grid on the contact area."""
    grid = [(tip.x_m, tip.y_m)]
    for ring in range(1, rings + 1):
        for step in range(6 * ring):
            angle, reach = 2 * math.pi * (step + 0.3) / (6 * ring), tip.radius_m * ring / rings
            grid.append((tip.x_m + reach * math.cos(angle), tip.y_m + reach * math.sin(angle)))
    return tuple(point for point in grid if 0 <= point[1] <= strip.width_m)


def greatest(strip: Strip, load: Load, points: Iterable[object], frequency_hz: float) -> float:
    moved_m = displacement(scene_of(strip, load, *points), [frequency_hz], 1e-4)
    return float(np.max(np.abs(moved_m)))


@pytest.mark.slow
@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, CLAMPED])
@pytest.mark.parametrize("load", LOADS, ids=lambda load: type(load).__name__)
@pytest.mark.parametrize("place", PLACES, ids=str)
def test_the_points_miss_a_tenth_of_a_decibel_at_most(
    edge: Edge, load: Load, place: tuple[float, float]
) -> None:
    strip = on(edge)
    tip = Fingertip(x_m=place[0], y_m=place[1])
    small = not isinstance(load, MomentDisc) and 0 < math.dist(place, (0.0, 0.0125)) < 0.005
    for frequency_hz in (500.0, 1500.0, 5000.0):
        few = greatest(strip, load, tip.points_m(strip), frequency_hz)
        many = greatest(strip, load, dense(tip, strip), frequency_hz)
        assert 20 * math.log10(many / few) < (0.3 if small else 0.1)


@settings(max_examples=30)
@given(st.floats(0.001, 0.024), st.floats(0.0, 0.012))
def test_wider_fingertips_have_denser_rings(y_m: float, radius_m: float) -> None:
    points = Fingertip(x_m=0.0, y_m=y_m, radius_m=radius_m).points_m(PLATE)
    rings = max(3, math.ceil(15 * radius_m / 0.025 - 1e-9))
    assert len(points) <= 1 + 4 * rings * (rings + 1)
    assert all(0 < y < 0.025 for _, y in points)


def test_a_fingertip_of_no_size_is_a_point() -> None:
    assert dataclasses.replace(TIP, radius_m=0.0).points_m(PLATE) == ((0.035, 0.0125),)
    tiny = np.array(dataclasses.replace(TIP, radius_m=1e-9).points_m(PLATE))
    assert np.max(np.abs(tiny - [0.035, 0.0125])) < 1.01e-9


def test_a_contact_area_is_cut_off_at_the_edges_and_at_the_ends() -> None:
    points = dataclasses.replace(TIP, y_m=0.002).points_m(PLATE)
    assert min(y for _, y in points) > 0
    assert 0 < len(points) < 49
    points = dataclasses.replace(TIP, x_m=0.098).points_m(SHORT)
    assert max(x for x, _ in points) == 0.1
    assert {y for x, y in points if x == 0.1} >= {0.0125}
    assert dataclasses.replace(TIP, x_m=0.1).points_m(SHORT)[0] == (0.1, 0.0125)
