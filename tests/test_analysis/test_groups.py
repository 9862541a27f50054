"""Groups and differences of conditions: everybody takes part, laws, brute force, coverage."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.special import ndtr

from analysis import compare_conditions, fit_group
from analysis.axis import VOLTS, Axis
from analysis.groups.difference import paired_difference
from analysis.groups.hierarchy import hierarchy, normal_weights
from analysis.groups.tables import DIFFERENCE_COLUMNS, GROUP_COLUMNS, difference_table, group_table
from analysis.thresholds.density import Ruler, kind_prior
from analysis.thresholds.grid import Surface, surfaces
from analysis.thresholds.people import GuessRate, people_of
from analysis.thresholds.table import thresholds_of
from tests.test_analysis.shared import PAPER, felt

CENTRED = [49.0, 57.0, 64.0, 73.0, 91.0]
RISING = [[16, 19, 27, 30, 30], [15, 21, 28, 30, 30], [17, 22, 30, 30, 30], [15, 16, 20, 25, 30]]
N = np.full((4, 5), 30)


def people(
    rng: np.random.Generator, thresholds_db: Any, levels: list[float], guess: float = 0.5
) -> Any:
    """Draw counts of people with sigma about 1.8 dB and 2 % of lapses."""
    x = 20 * np.log10(levels)
    sigma = 1.8 * np.exp(0.3 * rng.standard_normal((len(thresholds_db), 1)))
    z = (x - np.asarray(thresholds_db)[:, None]) / sigma
    return rng.binomial(30, guess + (1 - guess - 0.02) * ndtr(z))


def normal_surface(at: float, width: float) -> Surface:
    """Return a person whose mu is known like a normal value, and whose sigma is not."""
    mu = np.linspace(-30, 40, 1401)
    log_sigma = np.linspace(-1, 2, 9)
    values = np.exp(-0.5 * ((mu - at) / width) ** 2)[:, None] * np.ones(9)
    by_kind = kind_prior()[:, None, None] * values
    return Surface(
        mu=mu, log_sigma=log_sigma, by_kind=by_kind, lapse_rate=0.0, guess_rate=0.0,
        guess_variance=0.0,
        lapse_by_kind=np.zeros((2, 3)), starts=np.array([[at, 0.7, 0.0]]),
    )  # fmt: skip


def test_normal_weights_integrate_what_is_linear_however_narrow_the_normal_is() -> None:
    x = np.sort(np.random.default_rng(1).uniform(-5, 5, 30))
    middle = np.linspace(-4, 4, 7)
    for spread in (1e-8, 0.01, 0.5):
        weights = normal_weights(x, middle, np.full(7, spread))
        assert weights.sum(axis=1) == pytest.approx(np.ones(7))
        if spread < 0.1:
            assert weights @ x == pytest.approx(middle, abs=1e-3)


@pytest.mark.slow
def test_a_group_of_normal_likelihoods_is_that_of_a_sum_over_the_hyperparameters() -> None:
    at, width = np.array([1.0, 4.0, 6.5, 3.0]), np.array([0.5, 1.0, 2.0, 0.7])
    ruler = Ruler(low=0.0, high=10.0, step=0.05, tail=3.0)
    found = hierarchy([normal_surface(*one) for one in zip(at, width, strict=True)], ruler)
    middle, spread = np.linspace(-15, 25, 801), np.linspace(0.05, 25, 500)
    total = np.hypot(width, spread[:, None])
    z = (at[:, None, None] - middle[:, None]) / total.T[:, None]
    density = np.exp((-0.5 * z * z - np.log(total.T)[:, None]).sum(axis=0))
    density *= np.exp(-0.5 * (spread / 6) ** 2)
    density *= np.exp(-np.maximum(np.maximum(-middle, middle - 10), 0) / 3)[:, None]
    for points, axis, margin in (
        (found.of_middle(), middle, density.sum(axis=1)),
        (found.of_spread(), spread, density.sum(axis=0)),
    ):
        share = np.cumsum(margin) / margin.sum()
        assert points == pytest.approx(np.interp([0.025, 0.5, 0.975], share, axis), abs=0.08)


@pytest.mark.slow
def test_kinds_of_lapses_change_nothing_for_one_person_and_something_for_ten() -> None:
    u = np.array([[30.0, 33.0, 36.0, 39.0, 42.0]])
    ruler = Ruler(low=30.0, high=42.0, step=0.05, tail=3.0)
    k, n = np.array([[16.0, 19.0, 25.0, 28.0, 28.0]]), np.full((1, 5), 30.0)
    (one,) = surfaces(u, k, n, rulers=[ruler], guesses=[GuessRate(mean=0.5)])
    alike = replace(one, by_kind=kind_prior()[:, None, None] * one.by_kind.sum(axis=0))
    alone, other = (hierarchy([of], ruler).of_middle() for of in (one, alike))
    assert alone == pytest.approx(other, abs=1e-9)
    ten, others = (hierarchy([of] * 10, ruler).of_middle() for of in (one, alike))
    assert ten[1] < others[1] - 0.05  # ten who miss 2 of 30 high levels each are careless


@pytest.mark.slow
def test_a_difference_of_normal_likelihoods_is_that_of_a_sum_over_the_hyperparameters() -> None:
    a, d, width = np.array([1.0, 4.0, 6.5, 3.0]), np.array([2.0, 1.0, 3.5, 1.5]), 0.6
    ruler = Ruler(low=0.0, high=10.0, step=0.05, tail=3.0)
    of_a, of_b = ([normal_surface(float(at), width) for at in one] for one in (a, a + d))
    found, people = paired_difference(of_a, of_b, ruler)
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
    assert all(math.isnan(one.spread_db) for one in people)
    half = 1.96 * math.sqrt(2) * width
    for one, at in zip(people, d, strict=True):
        assert one.difference_limits_db == pytest.approx((at - half, at + half), abs=0.06)


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


def test_people_on_both_sides_of_the_levels_have_a_group_threshold() -> None:
    both = [[30] * 5, [15, 16, 14, 15, 15], [15, 15, 16, 14, 16], [29, 30, 30, 30, 30]]
    found = fit_group(CENTRED, both, N, guess_rate=0.5)
    assert found.status == "ok"
    assert CENTRED[0] < found.threshold < CENTRED[-1]
    assert found.spread_db > 3


@pytest.mark.slow
def test_people_who_answer_alike_have_little_between_them_and_the_pooled_threshold() -> None:
    k = np.tile([160, 190, 260, 298, 300], (6, 1))
    found = fit_group(PAPER, k, np.full((6, 5), 300), guess_rate=0.5)
    assert found.spread_limits_db[0] < 0.3
    assert found.threshold == pytest.approx(found.people[0].threshold, rel=0.01)


@pytest.mark.slow
def test_blanks_stand_for_a_guess_rate() -> None:
    k = [[2, 9, 22, 28, 30], [4, 12, 20, 29, 30], [3, 7, 25, 30, 30]]
    n = np.full((3, 5), 30)
    found = fit_group(PAPER, k, n, blanks=([2, 4, 3], [60] * 3))
    free = fit_group(PAPER, k, n, guess_rate=0.0)
    assert found.status == "ok"
    assert found.threshold > free.threshold


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "exactly one of guess_rate and blanks"),
        ({"guess_rate": 0.5, "blanks": ([1] * 4, [9] * 4)}, "exactly one of guess_rate and blanks"),
        ({"blanks": ([1], [9])}, "blanks must be two lists of 4"),
        ({"guess_rate": 0.5, "x_scale": "ln"}, "x_scale must be one of"),
    ],
)
def test_other_groups_are_refused(options: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        fit_group(PAPER, RISING, N, **options)


def test_tables_of_another_shape_are_refused() -> None:
    with pytest.raises(ValueError, match=r"the shape \(people, levels\)"):
        fit_group(PAPER[:4], RISING, N, guess_rate=0.5)
    with pytest.raises(ValueError, match="a row for each person"):
        compare_conditions(PAPER, RISING, N, RISING[:3], N[:3], guess_rate=0.5)


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
    others = compare_conditions(PAPER, RISING, N, higher, N, guess_rate=0.5, paired=False)
    assert others.people == ()
    assert np.ptp(others.difference_limits_db) > np.ptp(up.difference_limits_db)


def test_other_levels_shift_a_difference_by_as_much() -> None:
    by = 10 ** (3 / 20)
    same = compare_conditions(
        PAPER, RISING, N, RISING, N, guess_rate=0.5, levels_b_vpp=[v * by for v in PAPER]
    )
    assert same.difference_db == pytest.approx(3, abs=0.05)


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


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3, 8])
def test_an_end_that_everybody_leaves_open_is_open_for_the_group(count: int) -> None:
    """However narrow the other condition is: there the first grid cannot tell."""
    few, shown = np.tile([1, 3, 15, 28, 30], (count, 1)), np.full((count, 5), 30)
    found = compare_conditions(PAPER, few, shown, shown, shown, guess_rate=0.02)
    assert found.status == "at_most"
    assert found.difference_limits_db[0] == -math.inf
    assert {one.status for one in found.people} == {"at_most"}


def test_people_without_a_blank_have_the_assumed_guess_rate() -> None:
    detected = [[0, 2, 14, 29, 30]] * 2
    half, none = (
        fit_group(PAPER, detected, np.full((2, 5), 30), blanks=(np.zeros(2), shown))
        for shown in (np.array([10, 10]), np.zeros(2))
    )
    assert none.threshold == pytest.approx(half.threshold, rel=0.01)


@pytest.mark.slow
def test_who_answers_every_blank_trial_stops_nobody() -> None:
    """No threshold can be told of such a person; the others' stay."""
    detected, shown = [[29, 30, 29, 30, 30], [0, 3, 16, 28, 30]], np.full((2, 5), 30)
    both = fit_group(PAPER, detected, shown, blanks=([4000, 1], [4000, 40]))
    assert both.people[0].status == "flat"
    alone = fit_group(PAPER, detected[1:], shown[1:], blanks=([1], [40]))
    assert both.people[1].threshold == pytest.approx(alone.people[0].threshold, rel=1e-6)
    assert both.threshold == pytest.approx(alone.threshold, rel=0.03)


def test_the_tables_have_a_row_for_each_condition_and_each_pair() -> None:
    trials = pd.concat(
        [person(str(i), k, name) for name in ("a", "b") for i, k in enumerate(RISING[:3])]
    )
    counted = people_of(trials)
    groups = group_table(counted, thresholds_of(counted, seed=0, axis=VOLTS), VOLTS)
    assert tuple(groups.columns) == GROUP_COLUMNS
    assert groups["participants"].tolist() == [3, 3]
    assert groups["printed"].str.contains("mostly from its prior").all()
    differences = difference_table(counted, VOLTS)
    assert tuple(differences.columns) == DIFFERENCE_COLUMNS
    assert differences["participant"].tolist() == ["0", "1", "2", "all"]
    assert differences["difference_db"].iloc[-1] == pytest.approx(0, abs=1e-6)
    assert differences["spread_db"].notna().tolist() == [False, False, False, True]


def test_one_participant_is_no_group() -> None:
    counted = people_of(person("1", RISING[0]))
    assert group_table(counted, thresholds_of(counted, seed=0, axis=VOLTS), VOLTS)[
        "status"
    ].tolist() == ["one_participant"]
    assert difference_table(counted, VOLTS).empty


def test_a_linear_axis_has_groups_and_no_decibels() -> None:
    trials = pd.concat([person(str(i), k, name) for name in "ab" for i, k in enumerate(RISING)])
    axis = Axis(x_scale="linear", unit="cm/s")
    counted = people_of(trials)
    row = group_table(counted, thresholds_of(counted, seed=0, axis=axis), axis).iloc[0]
    assert row["status"] == "ok"
    assert "cm/s" in row["printed"]
    assert difference_table(counted, axis).empty


@pytest.mark.slow
@pytest.mark.parametrize("spread_db", [1.0, 4.0])
def test_limits_of_groups_cover_their_middle(spread_db: float) -> None:
    rng, truth, studies = np.random.default_rng(5), 20 * math.log10(62), 60
    covered = 0
    for _ in range(studies):
        k = people(rng, truth + spread_db * rng.standard_normal(5), CENTRED)
        found = fit_group(CENTRED, k, np.full((5, 5), 30), guess_rate=0.5)
        low, high = found.threshold_limits
        covered += low < 62 < high
    assert covered / studies >= 0.95 - 4 * math.sqrt(0.05 * 0.95 / studies)
