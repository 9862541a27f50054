"""Groups and differences: everybody takes part, laws, brute force, recovery."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.special import ndtr

from analysis import Axis, compare_conditions, fit_group
from analysis.thresholds.group import MIDDLE, SPREAD
from analysis.thresholds.table import side_thresholds
from tests.test_analysis.shared import PAPER, felt
from tests.test_analysis.tables import (
    difference_of_normals,
    fit_people,
    group_of_normals,
)

CENTRED = [49.0, 57.0, 64.0, 73.0, 91.0]
RISING = [[16, 19, 27, 30, 30], [15, 21, 28, 30, 30], [17, 22, 30, 30, 30], [15, 16, 20, 25, 30]]
N = np.full((4, 5), 30)


@pytest.mark.slow
def test_a_group_of_normal_likelihoods_is_that_of_a_sum_over_the_hyperparameters() -> None:
    at, width = np.array([1.0, 4.0, 6.5, 3.0]), np.array([0.5, 1.0, 2.0, 0.7])
    found = group_of_normals(at.tolist(), width.tolist())
    middle, spread = np.linspace(-15, 25, 801), np.linspace(0.05, 25, 500)
    total = np.hypot(width, spread[:, None])
    z = (at[:, None, None] - middle[:, None]) / total.T[:, None]
    density = np.exp((-0.5 * z * z - np.log(total.T)[:, None]).sum(axis=0))
    density *= np.exp(-0.5 * (spread / 6) ** 2)
    density *= np.exp(-np.maximum(np.maximum(-middle, middle - 10), 0) / 3)[:, None]
    for points, axis, margin in (
        (found.points(MIDDLE), middle, density.sum(axis=1)),
        (found.points(SPREAD), spread, density.sum(axis=0)),
    ):
        share = np.cumsum(margin) / margin.sum()
        assert points == pytest.approx(np.interp([0.025, 0.5, 0.975], share, axis), abs=0.08)


@pytest.mark.slow
def test_a_difference_of_normal_likelihoods_is_that_of_a_sum_over_the_hyperparameters() -> None:
    a, d, width = np.array([1.0, 4.0, 6.5, 3.0]), np.array([2.0, 1.0, 3.5, 1.5]), 0.6
    found = difference_of_normals(a.tolist(), (a + d).tolist(), width)
    shift, spread = np.linspace(-15, 20, 1401), np.linspace(0.02, 25, 800)
    total = np.sqrt(2 * width**2 + spread**2)
    z = (d[:, None, None] - shift[:, None]) / total
    density = np.exp((-0.5 * z * z - np.log(total)).sum(axis=0) - 0.5 * (spread / 6) ** 2)
    density *= np.exp(-0.5 * (shift[:, None] / 12) ** 2)
    for told, axis, margin in (
        ((found.difference_limits_db, found.difference_db), shift, density.sum(axis=1)),
        ((found.spread_limits_db, found.spread_db), spread, density.sum(axis=0)),
    ):
        low, middle, high = np.interp([0.025, 0.5, 0.975], np.cumsum(margin) / margin.sum(), axis)
        assert (*told[0], told[1]) == pytest.approx((low, high, middle), abs=0.06)
    assert all(math.isnan(one.spread_db) for one in found.people)
    half = 1.96 * math.sqrt(2) * width
    for one, at in zip(found.people, d, strict=True):
        assert one.difference_limits_db == pytest.approx((at - half, at + half), abs=0.06)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "apart"), [(2, 0.2), (2, 1.0), (3, 0.1), (3, 1.0), (4, 0.1), (5, 0.2), (12, 1.0)]
)
def test_a_group_and_the_next_person_are_exact_integrals(number: int, apart: float) -> None:
    """M given tau is normal but for its prior: a sum over both, ten times finer."""
    at = 5 + apart * np.linspace(-2, 2, number)
    width = np.full(number, 0.5)
    found = group_of_normals(at.tolist(), width.tolist())
    u = (np.arange(200) + 0.5) / 200
    middle, spread = np.linspace(-25, 35, 1201), 0.05 + 40 * u**2
    total = np.hypot(0.5, spread)
    z = (at[:, None, None] - middle[:, None]) / total
    density = np.exp((-0.5 * z * z - np.log(total)).sum(axis=0) - 0.5 * (spread / 6) ** 2)
    density *= np.exp(-np.maximum(np.maximum(-middle, middle - 10), 0) / 3)[:, None]
    density *= u / (density @ u).sum()
    mu = np.linspace(-40, 50, 361)
    below = [float((density * ndtr((one - middle[:, None]) / spread)).sum()) for one in mu]
    expected = np.interp([0.025, 0.5, 0.975], below, mu)
    points, group = found.next_person_points(), found.points(MIDDLE)
    exact = np.interp([0.025, 0.5, 0.975], np.cumsum(density.sum(axis=1)), middle + 0.025)
    assert group == pytest.approx(exact, abs=0.012 * np.ptp(exact[[0, 2]]))
    assert points == pytest.approx(expected, abs=0.02 * np.ptp(expected[[0, 2]]))
    assert points[0] <= group[0]
    assert group[2] <= points[2]


def test_one_level_has_no_threshold_and_no_difference() -> None:
    k, n = [[20], [24], [15]], [[30]] * 3
    assert fit_group([60.0], k, n, guess_rate=0.0).status == "one_level"
    found = compare_conditions([60.0], k, n, [[9], [12], [7]], n, guess_rate=0.0)
    assert found.status == "one_level"
    assert math.isnan(found.difference_db)
    assert np.isnan(found.difference_limits_db).all()
    assert {one.status for one in found.people} == {"one_level"}
    first = np.array([1, 0, 0, 0, 0])
    two = compare_conditions(PAPER, RISING, N, RISING * first, N * first, guess_rate=0.5)
    assert two.status == "one_level"


def test_sides_that_differ_have_their_own_thresholds() -> None:
    levels = [30.0, 42.0, 59.0, 83.0, 117.0]
    parts = []
    for side, at in (("left", 45.0), ("right", 80.0)):
        k = np.round(30 * ndtr(20 * np.log10(np.array(levels) / at) / 2)).astype(int).tolist()
        people = [felt(k, levels, participant=str(i)) for i in range(5)]
        parts += [one.replace({"left": side}) for one in people]
    trials = pd.concat(parts, ignore_index=True)
    table = side_thresholds(trials).set_index("side")
    assert table["participants"].tolist() == [5, 5]
    assert table["threshold_vpp"].tolist() == pytest.approx([45, 80], rel=0.05)
    high_left, low_right = table["threshold_high_vpp"]["left"], table["threshold_low_vpp"]["right"]
    assert float(high_left) < float(low_right)
    alone = side_thresholds(trials[trials["participant"].eq("0")]).set_index("side")
    assert alone["threshold_vpp"].tolist() == pytest.approx([45, 80], rel=0.08)


def test_everybody_takes_part_in_a_group() -> None:
    alone = fit_group(PAPER, RISING, N, guess_rate=0.5)
    joined = fit_group(PAPER, [*RISING, [30] * 5], np.full((5, 5), 30), guess_rate=0.5)
    assert alone.status == joined.status == "ok"
    assert joined.threshold < alone.threshold
    assert joined.spread_db > alone.spread_db
    assert joined.people[4].status == "threshold_below_levels"
    assert PAPER[0] <= joined.new_person_limits[1] or joined.new_person_limits[1] == math.inf


@pytest.mark.parametrize(
    ("detected", "status"),
    [
        ([[30] * 5] * 3, "threshold_below_levels"),
        ([[0] * 5] * 3, "threshold_above_levels"),
        ([[15, 16, 14, 15, 15]] * 3, "flat"),
        ([[30, 25, 20, 10, 0]] * 3, "decreasing"),
        ([[28, 29, 30, 30, 30], [27, 30, 30, 30, 30], [28, 30, 30, 30, 30]], "median_below_levels"),
    ],
)
def test_a_group_without_a_number_has_a_status(detected: Any, status: str) -> None:
    found = fit_group(PAPER, detected, np.full((3, 5), 30), guess_rate=0.5)
    assert found.status == status
    assert math.isnan(found.threshold)


def test_a_difference_turns_round_with_its_conditions() -> None:
    higher = [
        [15, 15, 18, 28, 30],
        [16, 14, 21, 29, 30],
        [15, 16, 22, 27, 30],
        [14, 15, 17, 20, 28],
    ]
    up = compare_conditions(PAPER, RISING, N, higher, N, guess_rate=0.5)
    down = compare_conditions(PAPER, higher, N, RISING, N, guess_rate=0.5)
    assert up.status == down.status == "ok"
    assert up.difference_db > 1
    assert up.difference_db == pytest.approx(-down.difference_db, abs=0.02)
    assert up.difference_limits_db == pytest.approx(
        [-end for end in down.difference_limits_db[::-1]], abs=0.03
    )
    by = 10 ** (3 / 20)
    same = compare_conditions(
        PAPER, RISING, N, RISING, N, guess_rate=0.5, levels_b=[v * by for v in PAPER]
    )
    assert same.difference_db == pytest.approx(3, abs=0.05)
    others = compare_conditions(PAPER, RISING, N, higher, N, guess_rate=0.5, paired=False)
    assert others.people == ()
    assert np.ptp(others.difference_limits_db) > np.ptp(up.difference_limits_db)


def test_two_conditions_that_tell_only_bounds_have_no_difference() -> None:
    felt_all = np.full((3, 5), 30)
    both = compare_conditions(PAPER, felt_all, felt_all, felt_all, felt_all, guess_rate=0.5)
    assert both.status == "unknown"
    assert both.difference_limits_db == (-math.inf, math.inf)
    missed_all = np.full((3, 5), 15)
    one = compare_conditions(PAPER, RISING[:3], N[:3], felt_all, felt_all, guess_rate=0.5)
    assert one.status == "at_most"
    assert one.difference_limits_db[0] == -math.inf
    assert one.difference_limits_db[1] < 0
    none = compare_conditions(PAPER, RISING[:3], N[:3], missed_all * 0, felt_all, guess_rate=0.0)
    assert none.status == "at_least"


def person(name: str, detected: list[int], condition: str = "main") -> pd.DataFrame:
    return felt(detected, participant=name, condition=condition, missed="right", none_offered=False)


def test_the_tables_have_a_row_for_each_condition_and_each_pair() -> None:
    people = [person(str(i), k, name) for name in "ab" for i, k in enumerate(RISING[:3])]
    found = fit_people(pd.concat(people))
    assert found.groups["participants"].tolist() == [3, 3]
    assert found.differences["participant"].tolist() == ["0", "1", "2", "all"]
    assert found.differences["difference_db"].iloc[-1] == pytest.approx(0, abs=1e-6)
    assert found.differences["spread_db"].notna().tolist() == [False, False, False, True]
    linear = fit_people(pd.concat(people), Axis(x_scale="linear", unit="cm/s"))
    assert linear.groups["status"].iloc[0] == "ok"
    row = found.groups.iloc[0]
    assert row["sigma_low"] < row["sigma"] < row["sigma_high"]
    assert linear.differences.empty  # a linear axis has no decibels
    alone = fit_people(people[0])
    assert alone.groups["status"].tolist() == ["one_participant"]
    assert alone.differences.empty


def test_guess_rates_of_a_group_are_fixed_or_from_blanks() -> None:
    k = [[2, 9, 22, 28, 30], [4, 12, 20, 29, 30], [3, 7, 25, 30, 30]]
    found = fit_group(PAPER, k, N[:3], blanks=([2, 4, 3], [60] * 3))
    assert found.status == "ok"
    assert found.threshold > fit_group(PAPER, k, N[:3], guess_rate=0.0).threshold
    both = [[30] * 5, [15, 16, 14, 15, 15], [15, 15, 16, 14, 16], [29, 30, 30, 30, 30]]
    outside = fit_group(CENTRED, both, N, guess_rate=0.5)  # people on both sides of the levels
    assert outside.status == "ok"
    assert CENTRED[0] < outside.threshold < CENTRED[-1]
    assert outside.spread_db > 3


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({}, "guess_rate"),
        ({"guess_rate": 0.5, "blanks": ([1] * 4, [9] * 4)}, "guess_rate"),
        ({"blanks": ([1], [9])}, "blanks"),
        ({"guess_rate": 0.5, "x_scale": "ln"}, "x_scale"),
        ({"guess_rate": 0.5, "levels": PAPER[:4]}, "shape"),
    ],
)
def test_other_groups_are_refused(options: Any, name: str) -> None:
    levels = options.pop("levels", PAPER)
    with pytest.raises(ValueError, match=name):
        fit_group(levels, RISING, N, **options)
    with pytest.raises(ValueError, match="row"):
        compare_conditions(PAPER, RISING, N, RISING[:3], N[:3], guess_rate=0.5)
