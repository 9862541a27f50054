"""Psychometric functions: what each table of counts gives, laws, recovery of what is known."""

from __future__ import annotations

import math
from dataclasses import astuple
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from analysis import PsychometricFit, fit_psychometric
from analysis.thresholds.fit import BOUNDED, WITH_THRESHOLD
from benchmarks.calibration import psychometric
from tests.test_analysis.shared import PAPER
from tests.test_analysis.tables import fit_counts

CENTRED = [70.0, 85.0, 100.0, 120.0, 145.0]
GOOD = [2, 14, 22, 28, 29]
tables = st.lists(st.integers(0, 30), min_size=5, max_size=5)
guess_rates = st.sampled_from([0.0, 1 / 3, 0.5])


def fit(detected: Any, x: Any = PAPER, n: int = 30, *, guess: Any = 0.0) -> PsychometricFit:
    return fit_psychometric(x, detected, [n] * len(detected), guess_rate=guess)


def linear(detected: Any, x: Any) -> PsychometricFit:
    n = [30] * len(detected)
    return fit_psychometric(x, detected, n, guess_rate=0.0, x_scale="linear")


def numbers(found: PsychometricFit) -> list[float]:
    _, threshold, limits, *others = astuple(found)
    return [threshold, *limits, *others]


@pytest.mark.parametrize("guess", [0.0, 0.5])
@pytest.mark.parametrize(
    ("detected", "expected"),
    [
        ([30] * 5, "threshold_below_levels"),
        ([0] * 5, "threshold_above_levels"),
        ([29, 24, 15, 6, 1], "decreasing"),
        ([30, 30, 10, 0, 0], "decreasing"),
        ([15] * 5, "flat"),
        ([15, 14, 16, 15, 15], "flat"),
        ([0, 0, 0, 30, 30], "separated"),
        ([0, 0, 9, 30, 30], "separated"),
        ([27, 30, 30, 30, 30], "median_below_levels"),
        ([2, 14, 24, 25, 25], "lapse_at_bound"),
        ([0, 1, 0, 3, 6], "median_above_levels"),
    ],
)
def test_every_table_has_its_status(guess: float, detected: list[int], expected: str) -> None:
    assert fit(detected, guess=guess).status == expected


def test_a_table_with_a_threshold_is_ok() -> None:
    found = fit(GOOD)
    assert found.status == "ok"
    assert all(math.isfinite(value) for value in numbers(found))
    low, high = found.threshold_limits
    assert 80 < low < found.threshold < high < 110
    assert linear([0, 15, 29], [0, 50, 100]).status == "ok"
    step = fit([0, 0, 30, 30, 30])  # which shows where, and not how steeply
    assert step.status == "separated"
    assert 95 < step.threshold_limits[0] < step.threshold < step.threshold_limits[1] < 130
    assert math.isnan(step.sigma + step.mle_sigma)
    for x, k, n in (([60], [3], [5]), ([60, 95], [3, 0], [5, 0]), ([60, 60], [3, 2], [5, 5])):
        assert fit_psychometric(x, k, n, guess_rate=0.0).status == "one_level"


def test_a_forced_choice_is_no_yes_no_task() -> None:
    """By quadrature over the prior: 101.2 V (83.8 to 117.3)."""
    levels, detected = [60, 80, 110, 150, 200], [15, 18, 24, 29, 30]
    forced, free = (fit(detected, levels, guess=guess) for guess in (0.5, 0.0))
    assert forced.threshold == pytest.approx(101.2, abs=0.5)
    assert forced.threshold_limits == pytest.approx((83.8, 117.3), abs=0.5)
    assert free.threshold == pytest.approx(63.8, abs=0.5)
    assert free.threshold_limits[0] == -math.inf


@pytest.mark.parametrize(
    ("detected", "status", "limits"),
    [
        ([30] * 5, "threshold_below_levels", (-math.inf, 60.0)),
        ([0] * 5, "threshold_above_levels", (200.0, math.inf)),
        ([25, 28, 30, 30, 30], "median_below_levels", (-math.inf, 68.0)),
    ],
)
def test_a_threshold_outside_the_levels_is_bounded(
    detected: list[int], status: str, limits: tuple[float, float]
) -> None:
    found = fit(detected, guess=0.5 if status == "median_below_levels" else 0.0)
    assert found.status == status
    assert found.threshold_limits == pytest.approx(limits, abs=0.5)


@pytest.mark.slow
@given(tables, guess_rates)
def test_only_tables_with_a_threshold_have_numbers(detected: list[int], guess: float) -> None:
    found = fit(detected, guess=guess)
    told = [value for value in numbers(found) if not math.isnan(value)]
    assert bool(told) == (found.status in WITH_THRESHOLD + BOUNDED)
    assert math.isfinite(found.threshold) == (found.status in WITH_THRESHOLD)
    for limit in found.threshold_limits:
        assert not PAPER[0] * (1 - 1e-12) > limit > -math.inf
        assert not PAPER[-1] * (1 + 1e-12) < limit < math.inf
    if found.status in WITH_THRESHOLD:
        assert found.threshold_limits[0] < found.threshold < found.threshold_limits[1]
        assert PAPER[0] <= found.threshold <= PAPER[-1]


@pytest.mark.slow
@settings(max_examples=30)
@given(tables, guess_rates, st.floats(0.01, 100))
def test_another_unit_scales_the_threshold(detected: list[int], guess: float, by: float) -> None:
    here, there = (fit(detected, [x * f for x in PAPER], guess=guess) for f in (1, by))
    assert there.status == here.status
    assume(here.status in WITH_THRESHOLD)
    assert there.threshold == pytest.approx(here.threshold * by, rel=1e-6)
    assert there.threshold_limits[0] == pytest.approx(here.threshold_limits[0] * by, rel=1e-6)
    assert there.sigma == pytest.approx(here.sigma, rel=1e-6, nan_ok=True)


@pytest.mark.slow
@given(st.permutations(range(5)), guess_rates)
def test_order_empty_and_split_levels_make_no_difference(order: list[int], guess: float) -> None:
    split = [(PAPER[i], part, 15) for i in order for part in (GOOD[i] // 2, GOOD[i] - GOOD[i] // 2)]
    columns = zip(*[*split, (10.0, 0, 0), (1e6, 0, 0)], strict=True)
    assert fit_psychometric(*columns, guess_rate=guess) == fit(GOOD, guess=guess)


def test_a_billion_trials_a_level_give_back_the_truth() -> None:
    p = psychometric(PAPER, threshold_vpp=100, sigma=0.1, guess_rate=0, lapse_rate=0.01)
    found = fit(np.round(1e9 * p), n=10**9)
    assert found.status == "ok"
    assert found.threshold == pytest.approx(100, abs=0.01)
    assert found.mle_threshold == pytest.approx(100, abs=1e-5)
    assert (found.mle_sigma, found.mle_lapse_rate) == pytest.approx((0.1, 0.01), abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize(("guess", "presented", "within_db"), [(0.0, 30, 0.06), (0.5, 120, 0.08)])
def test_limits_cover_their_threshold(guess: float, presented: int, within_db: float) -> None:
    """With 600 tables the covered share has a standard error of 0.9 %, the mean error 1/24 sd."""
    truth_vpp, studies = 98.0, 600
    p = psychometric(CENTRED, threshold_vpp=truth_vpp, sigma=0.1, guess_rate=guess, lapse_rate=0.02)
    k = np.random.default_rng(6).binomial(presented, p, (studies, 5))
    fits = fit_counts(np.log10(CENTRED), k, presented, guess)
    found = [one for one in fits if one.status in WITH_THRESHOLD]
    assert len(found) > 0.97 * studies
    truth = math.log10(truth_vpp)
    covered = np.mean([low < truth < high for low, high in (f.threshold_limits for f in found)])
    assert covered == pytest.approx(0.95, abs=0.03)
    errors_db = 20 * (np.array([one.threshold for one in found]) - truth)
    assert errors_db.mean() == pytest.approx(0, abs=3 * errors_db.std() / 24 + within_db)


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"x": [0.0, 95, 130]}, "levels_vpp"),
        ({"x": [-5.0, 95, 130]}, "levels_vpp"),
        ({"x": [60, 95, math.nan]}, "levels_vpp"),
        ({"x": [60, 95, math.inf]}, "levels_vpp"),
        ({"x": ["60", "95", "130"]}, "levels_vpp"),
        ({"x": [60, 95]}, "length"),
        ({"n": [10**13] * 3}, "presented"),
        ({"n": [3, 3, math.inf]}, "presented"),
        ({"k": [0] * 3, "n": [0] * 3}, "presented"),
        *(({"k": [k, 2, 3]}, "detected") for k in (4, -1, 0.5, math.nan)),
        *(({"guess": g}, "guess_rate") for g in (-0.1, 0.95, 1.0, math.nan, True, "0.5")),
        ({"x_scale": "ln"}, "x_scale"),
    ],
)
def test_other_tables_rates_and_axes_are_refused(changes: dict[str, Any], name: str) -> None:
    of: dict[str, Any] = {
        "x": [60, 95, 130],
        "k": [1, 2, 3],
        "n": [3] * 3,
        "guess": 0.0,
        "x_scale": "log10",
    }
    of |= changes
    with pytest.raises(ValueError, match=name):
        fit_psychometric(of["x"], of["k"], of["n"], guess_rate=of["guess"], x_scale=of["x_scale"])
