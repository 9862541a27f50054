"""Psychometric functions: what each table of counts gives, laws, recovery of what is known."""

from __future__ import annotations

import math
from dataclasses import astuple
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.special import ndtr

from analysis import GuessRate, PsychometricFit, fit_psychometric
from analysis.axis import VOLTS
from analysis.thresholds.fit import BOUNDED, WITH_THRESHOLD, fit_many
from analysis.thresholds.probit import fit_lines, scale
from analysis.thresholds.table import printed
from benchmarks.calibration import psychometric
from tests.test_analysis.shared import PAPER

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


@pytest.mark.parametrize("k", [0, 3, 5])
def test_one_level_has_no_threshold(k: int) -> None:
    for x, detected, presented in (
        ([60], [k], [5]),
        ([60, 95, 130], [k, 0, 0], [5, 0, 0]),
        ([60, 60], [k, 2], [5, 5]),
    ):
        found = fit_psychometric(x, detected, presented, guess_rate=0.0)
        assert found.status == "one_level"


def test_the_papers_typical_table_does_not_rise_and_lies_at_the_ceiling() -> None:
    detected, n = np.array([[26.0, 26, 29, 27, 29]]), np.full((1, 5), 30.0)
    lines = fit_lines(scale(np.log10([PAPER]), n).u, detected, n)
    assert lines.slope[0] > 0
    root = math.sqrt(lines.flat_deviance[0] - lines.deviance[0])
    assert float(ndtr(-root)) == pytest.approx(0.077, abs=5e-4)
    assert fit([26, 26, 29, 27, 29]).status == "threshold_below_levels"
    assert fit([26, 26, 29, 27, 29], guess=0.5).status == "flat"


def test_a_forced_choice_is_no_yes_no_task() -> None:
    """By quadrature over the prior: 101.2 V (83.8 to 117.3)."""
    levels, detected = [60, 80, 110, 150, 200], [15, 18, 24, 29, 30]
    forced, free = (fit(detected, levels, guess=guess) for guess in (0.5, 0.0))
    assert forced.threshold == pytest.approx(101.2, abs=0.5)
    assert forced.threshold_limits == pytest.approx((83.8, 117.3), abs=0.5)
    assert free.threshold == pytest.approx(63.8, abs=0.5)
    assert free.threshold_limits[0] == -math.inf


def test_a_table_that_rises_in_one_step_tells_where_and_not_how_steeply() -> None:
    found = fit([0, 0, 30, 30, 30])
    assert found.status == "separated"
    low, high = found.threshold_limits
    assert 95 < low < found.threshold < high < 130
    assert math.isnan(found.sigma)
    assert math.isnan(found.mle_sigma)


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


@pytest.mark.parametrize("level", [1, 2, 5, 10, 15, 18])
def test_a_table_that_does_not_rise_below_the_ceiling_is_flat(level: int) -> None:
    assert fit([level] * 5, guess=0.5).status == "flat"


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
@settings(max_examples=30)
@given(tables, st.floats(-1e3, 1e3))
def test_a_linear_axis_may_begin_anywhere(detected: list[int], shift: float) -> None:
    x = np.linspace(-250, 100, 5)
    here, there = linear(detected, x), linear(detected, x + shift)
    assert there.status == here.status
    assume(here.status in WITH_THRESHOLD)
    assert there.threshold - shift == pytest.approx(here.threshold, abs=1e-4)
    assert there.sigma == pytest.approx(here.sigma, rel=1e-6, nan_ok=True)


def test_an_axis_that_begins_at_a_million_gives_the_same_width() -> None:
    here, there = (linear(GOOD, np.arange(5.0) + start) for start in (0, 1e6))
    assert there.threshold - 1e6 == pytest.approx(here.threshold, abs=1e-7)
    assert there.sigma == pytest.approx(here.sigma, rel=1e-7)


def test_volts_in_place_of_their_logarithm_are_another_function_and_no_crash() -> None:
    volts, wrong = linear(GOOD, PAPER), fit(GOOD, np.log10(PAPER))
    assert (volts.status, wrong.status) == ("ok", "ok")
    assert volts.sigma > 20
    assert wrong.threshold < 2.5


@pytest.mark.slow
@given(st.permutations(range(5)), guess_rates)
def test_order_empty_and_split_levels_make_no_difference(order: list[int], guess: float) -> None:
    split = [(PAPER[i], part, 15) for i in order for part in (GOOD[i] // 2, GOOD[i] - GOOD[i] // 2)]
    columns = zip(*[*split, (10.0, 0, 0), (1e6, 0, 0)], strict=True)
    assert fit_psychometric(*columns, guess_rate=guess) == fit(GOOD, guess=guess)


@pytest.mark.slow
def test_many_fits_are_the_single_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analysis.thresholds.fit._AT_ONCE", 25)
    rng = np.random.default_rng(2)
    p = psychometric(PAPER, threshold_vpp=100, sigma=0.1, guess_rate=0.5, lapse_rate=0.02)
    k = rng.binomial(30, p, (60, 5)).astype(float)
    x, n = np.broadcast_to(np.log10(PAPER), k.shape), np.full(k.shape, 30.0)
    together = fit_many(x, k, n, guesses=[GuessRate(mean=0.5)] * 60)
    for one, detected in zip(together, k, strict=True):
        alone = fit(detected, guess=0.5)
        assert one.status == alone.status
        if alone.status in WITH_THRESHOLD:
            assert 10**one.threshold == pytest.approx(alone.threshold, rel=1e-6)
            assert one.deviance == pytest.approx(alone.deviance, abs=1e-8)


def test_a_billion_trials_a_level_give_back_the_truth() -> None:
    p = psychometric(PAPER, threshold_vpp=100, sigma=0.1, guess_rate=0, lapse_rate=0.01)
    found = fit(np.round(1e9 * p), n=10**9)
    assert found.status == "ok"
    assert found.threshold == pytest.approx(100, abs=0.01)
    assert found.mle_threshold == pytest.approx(100, abs=1e-5)
    assert (found.mle_sigma, found.mle_lapse_rate) == pytest.approx((0.1, 0.01), abs=1e-7)


def test_counts_that_no_guess_rate_explains_are_fitted_without_a_warning() -> None:
    found = fit([10**11 * tenth for tenth in (1, 3, 5, 7, 9)], n=10**12, guess=0.5)
    assert 130 < found.threshold_limits[0] < found.threshold < found.threshold_limits[1] < 200


@pytest.mark.slow
@pytest.mark.parametrize(
    ("guess", "presented", "within_db"), [(0.0, 30, 0.06), (0.5, 120, 0.08)], ids=["none", "forced"]
)
def test_limits_cover_their_threshold(guess: float, presented: int, within_db: float) -> None:
    """With 600 tables the covered share has a standard error of 0.9 %, the mean error 1/24 sd."""
    truth_vpp, studies = 98.0, 600
    p = psychometric(CENTRED, threshold_vpp=truth_vpp, sigma=0.1, guess_rate=guess, lapse_rate=0.02)
    k = np.random.default_rng(6).binomial(presented, p, (studies, 5)).astype(float)
    x = np.broadcast_to(np.log10(CENTRED), k.shape)
    guesses = [GuessRate(mean=guess)] * studies
    fits = fit_many(x, k, np.full(k.shape, float(presented)), guesses=guesses)
    found = [one for one in fits if one.status in WITH_THRESHOLD]
    assert len(found) > 0.97 * studies
    truth = math.log10(truth_vpp)
    covered = np.mean([low < truth < high for low, high in (f.threshold_limits for f in found)])
    assert covered == pytest.approx(0.95, abs=0.03)
    errors_db = 20 * (np.array([one.threshold for one in found]) - truth)
    assert errors_db.mean() == pytest.approx(0, abs=3 * errors_db.std() / 24 + within_db)


@pytest.mark.slow
def test_the_error_is_that_of_fishers_information() -> None:
    """Known lambda: the Cramer-Rao bound; the lambda to be found adds little at gamma 0."""
    studies, n, mu, sigma = 1000, 300.0, 2.0, 0.1
    x = np.log10(CENTRED)
    z = (x - mu) / sigma
    p = psychometric(CENTRED, threshold_vpp=100, sigma=sigma, guess_rate=0, lapse_rate=0)
    slopes = np.stack([np.ones(5), z]) * np.exp(-z * z / 2) / math.sqrt(2 * math.pi) / sigma
    information = (slopes * (n / (p * (1 - p)))) @ slopes.T
    bound = math.sqrt(np.linalg.inv(information)[0, 0])
    k = np.random.default_rng(7).binomial(int(n), p, (studies, 5)).astype(float)
    guesses = [GuessRate(mean=0.0)] * studies
    fits = fit_many(np.broadcast_to(x, k.shape), k, np.full(k.shape, n), guesses=guesses)
    error = np.std([one.threshold for one in fits])
    assert error == pytest.approx(bound, rel=0.12)


@pytest.mark.slow
def test_a_guess_rate_that_is_known_less_well_widens_the_limits() -> None:
    few, many = (GuessRate.after_blanks(answered=0.2 * n, blanks=n) for n in (20, 2000))
    limits = [fit([8, 12, 20, 28, 29], guess=guess).threshold_limits for guess in (few, many)]
    spans = [math.log10(high / low) for low, high in limits]
    assert spans[0] > spans[1] * 1.02


@pytest.mark.parametrize(
    ("levels", "detected", "presented", "said"),
    [
        ([0.0, 95, 130], [1, 2, 3], [3] * 3, "levels_vpp must be above 0 on the axis log10"),
        ([-5.0, 95, 130], [1, 2, 3], [3] * 3, "levels_vpp must be above 0 on the axis log10"),
        ([60, 95, math.nan], [1, 2, 3], [3] * 3, "levels_vpp must be finite"),
        ([60, 95, math.inf], [1, 2, 3], [3] * 3, "levels_vpp must be finite"),
        (["60", "95", "130"], [1, 2, 3], [3] * 3, "levels_vpp must be finite numbers"),
        ([60, 95, 130], [1, 2, 3], [10**13] * 3, "presented must be at most 1e"),
        ([60, 95, 130], [4, 2, 3], [3] * 3, "detected must be at most presented"),
        ([60, 95, 130], [-1, 2, 3], [3] * 3, "detected must be whole numbers"),
        ([60, 95, 130], [0.5, 2, 3], [3] * 3, "detected must be whole numbers"),
        ([60, 95, 130], [math.nan, 2, 3], [3] * 3, "detected must be whole numbers"),
        ([60, 95, 130], [1, 2, 3], [3, 3, math.inf], "presented must be whole numbers"),
        ([60, 95, 130], [0, 0, 0], [0] * 3, "presented must hold at least one stimulus"),
        ([60, 95], [1, 2, 3], [3] * 3, "of one length"),
    ],
)
def test_other_tables_are_refused(levels: Any, detected: Any, presented: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        fit_psychometric(levels, detected, presented, guess_rate=0.0)


@pytest.mark.parametrize("guess", [-0.1, 0.95, 1.0, math.nan, math.inf, True, "0.5"])
def test_impossible_guess_rates_are_refused(guess: Any) -> None:
    with pytest.raises(ValueError, match="guess_rate must be"):
        fit(GOOD, guess=guess)


def test_another_axis_is_refused() -> None:
    with pytest.raises(ValueError, match="x_scale must be one of log10, linear"):
        fit_psychometric(PAPER, GOOD, [30] * 5, guess_rate=0.0, x_scale="ln")  # type: ignore[arg-type] # no axis


def test_a_place_without_a_stimulus_does_not_stretch_the_scale() -> None:
    scaled = scale(np.array([[60.0, 95.0, 1e9]]), np.array([[5.0, 5.0, 0.0]]))
    assert (scaled.low[0], scaled.width[0]) == (60.0, 35.0)


@pytest.mark.slow
@pytest.mark.parametrize("guess", [0.02, 0.5])
def test_below_the_levels_is_hardly_ever_said_of_who_is_at_the_lowest(guess: float) -> None:
    rng, levels = np.random.default_rng(8), np.array(PAPER)
    felt = guess + (0.98 - guess) * ndtr(20 * np.log10(levels / 60) / 1.0)
    k = rng.binomial(30, felt, (2000, 5)).astype(float)
    x = np.tile(np.log10(levels), (2000, 1))
    fits = fit_many(x, k, np.full_like(k, 30), guesses=[GuessRate(mean=guess)] * 2000)
    words = [printed(fit, levels, VOLTS) for fit in fits]
    assert "at most" in " ".join(words)
    assert np.mean([word == "< 60 V" for word in words]) <= 0.025
