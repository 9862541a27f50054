"""Likelihoods on the grid and their posteriors: brute force, laws, memory, the likeliest."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr, xlogy
from scipy.stats import beta

from analysis import GuessRate, fit_psychometric
from analysis.thresholds.function import (
    LOG_SIGMA,
    MAX_LAPSE,
    REACH,
    SIGMA_FACTOR,
    SIGMA_MEDIAN,
    FunctionName,
    inverse,
    rise,
    slope,
)
from analysis.thresholds.likeliest import likeliest_function
from analysis.thresholds.likelihood import Tables, binned
from tests.test_analysis.shared import QUANTA
from tests.test_analysis.tables import STEP, posterior_of, tables_at

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

U = np.array([0.0, 2.5, 5.0, 7.5, 10.0])
RISING = [5, 9, 20, 28, 30]
tables_of_counts = st.lists(st.integers(0, 30), min_size=5, max_size=5)


def brute_force(
    table: Tables,
    gammas: Floats,
    weights: Floats,
    reach: tuple[float, float] = (-24.0, 34.0),
    widths: tuple[float, float] = LOG_SIGMA,
    lapses: int = 10,
) -> Floats:
    """Return the limits and median of mu by a plain sum over a regular grid."""
    mu = np.linspace(*reach, 801)
    log_sigma = np.linspace(*widths, 41)
    z = (log_sigma - np.log(SIGMA_MEDIAN)) / np.log(SIGMA_FACTOR)
    total = np.zeros(len(mu))
    felt = ndtr((table.x[0] / STEP - mu[:, None, None]) / np.exp(log_sigma)[:, None])
    for gamma, share in zip(gammas, weights, strict=True):
        for lam in (np.arange(lapses) + 0.5) * (0.1 / lapses):
            p = gamma + (1 - gamma - lam) * felt
            k, n = table.detected[0], table.presented[0]
            value = np.exp((xlogy(k, p) + xlogy(n - k, 1 - p)).sum(axis=2) + 60.0)
            total += share * (1 - lam) ** 9 * (value @ np.exp(-z * z / 2))
    total *= np.exp(-np.maximum(np.maximum(-mu, mu - 10.0), 0.0) / 3.0)
    share = np.concatenate([[0.0], np.cumsum(total[1:] + total[:-1])])
    return np.interp([0.025, 0.5, 0.975], share / share[-1], mu)


@pytest.mark.slow
@pytest.mark.parametrize("guess_rate", [0.0, 0.3, 0.5])
@pytest.mark.parametrize(
    "detected",
    [[2, 9, 20, 28, 30], [12, 18, 17, 29, 28], [26, 26, 29, 27, 29], [0, 0, 0, 30, 30], [30] * 5],
)
def test_brute_force_finds_the_same(detected: list[int], guess_rate: float) -> None:
    table = tables_at(U * STEP, detected, 30, guess_rate)
    found = posterior_of(table)
    expected = brute_force(table, np.array([guess_rate]), np.ones(1))
    # Limits outside the levels are told as open.
    assert np.clip(found, 0, 10) == pytest.approx(np.clip(expected, 0, 10), abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("answered", "blanks", "detected", "presented", "top"),
    [
        (6, 40, RISING, 30, 0.4),
        (0.5, 10, RISING, 30, 0.4),
        (1, 300, RISING, 30, 0.4),
        (1, 60, [66, 96, 190, 270, 294], 300, 0.3),  # which contradict the blanks
    ],
)
def test_a_guess_rate_after_blanks_is_integrated_over(
    answered: float, blanks: int, detected: list[int], presented: int, top: float
) -> None:
    guess = GuessRate.after_blanks(answered=answered, blanks=blanks)
    at = (np.arange(40) + 0.5) * top / 40
    weights = beta(*guess.beta or (1, 1)).pdf(at)
    table = tables_at(U * STEP, detected, presented, guess)
    span = ((0.0, 10.0), (0.0, 2.0)) if presented > 30 else ((-24.0, 34.0), LOG_SIGMA)
    expected = brute_force(table, at, weights, *span)
    assert posterior_of(table) == pytest.approx(expected, abs=0.03)


def test_public_data_give_about_what_psignifit_gives() -> None:
    # psignifit 4.3 with gamma = eta = 0, on the axis log10 of quanta: mean and 95 % limits, whose
    # priors are other ones.
    x = np.log10(QUANTA["SH/R1"])
    mean, low, high = (value / np.log(10) for value in (4.866049, 4.750542, 4.962707))
    table = tables_at(x, [0, 3, 12, 26, 35, 35], 35, 0.0)
    assert posterior_of(table) * STEP == pytest.approx([low, mean, high], abs=6e-3)


def test_weak_levels_felt_often_do_not_hide_the_likeliest_function() -> None:
    guess = GuessRate.after_blanks(answered=0, blanks=24)
    levels, detected = [3, 5, 8, 13, 20, 32], [2, 7, 5, 17, 18, 20]
    fit = fit_psychometric(levels, detected, [20] * 6, guess_rate=guess)
    assert fit.deviance == pytest.approx(8.044, abs=0.01)  # a step, were the guess rate 0.2
    assert fit.mle_threshold == pytest.approx(8.23, abs=0.02)


def log_likelihood(table: Tables, mu: Floats, log_sigma: Floats, lapse: Floats) -> Floats:
    """Return it of many functions at the known guess rate, but for a constant."""
    gamma, k, n = table.guesses[0].mean, table.detected[0], table.presented[0]
    z = (table.x[0] / STEP - mu[:, None]) * np.exp(-log_sigma[:, None])
    rest = 1 - gamma - lapse[:, None]
    p, q = gamma + rest * ndtr(z), lapse[:, None] + rest * ndtr(-z)
    return np.asarray((xlogy(k, p) + xlogy(n - k, q)).sum(axis=1))


@pytest.mark.slow
@settings(max_examples=40)
@given(tables_of_counts, st.sampled_from([0.0, 0.5]))
def test_no_corner_or_neighbour_is_likelier(detected: list[int], guess_rate: float) -> None:
    table = tables_at(U * STEP, detected, 30, guess_rate)
    best = likeliest_function(table, 0, table.likelihoods[0].node)
    mu, sigma = np.log10(best["mle_threshold"]) / STEP, best["mle_sigma"] / STEP
    at = np.array([mu, np.log(sigma), best["mle_lapse_rate"]])
    lower = np.array([-REACH, LOG_SIGMA[0], 0.0])
    upper = np.array([10 + REACH, LOG_SIGMA[1], MAX_LAPSE])
    assert ((lower - 1e-9 <= at) & (at <= upper + 1e-9)).all()
    reached = log_likelihood(table, *at[:, None])[0]
    rng = np.random.default_rng(sum(detected))
    for spread in (1e-2, 1.0, 10.0):
        near = at + spread * rng.normal(size=(200, 3)) * [1.0, 0.1, 0.005]
        assert log_likelihood(table, *np.clip(near, lower, upper).T).max() <= reached + 1e-6


@pytest.mark.parametrize("name", ["normal", "logistic", "weibull", "gumbel"])
def test_functions_are_half_at_0_and_as_steep_as_the_normal_one(name: FunctionName) -> None:
    z = np.linspace(-3, 3, 61)
    above, below = rise(name, z)
    assert above + below == pytest.approx(1)
    assert above[30] == pytest.approx(0.5)
    assert slope(name, z)[30] == pytest.approx(1 / np.sqrt(2 * np.pi))
    assert np.gradient(above, z)[1:-1] == pytest.approx(slope(name, z)[1:-1], abs=2e-3)
    assert inverse(name, above) == pytest.approx(z)


def test_counts_at_many_levels_keep_their_sums_and_means() -> None:
    rng = np.random.default_rng(2)
    u = rng.normal(40, 3, 500)
    k, n = rng.integers(0, 2, 500).astype(float), np.ones(500)
    at, detected, presented = binned(u, k, n)
    assert len(at) < 250
    assert detected.sum() == pytest.approx(k.sum())
    assert at @ presented == pytest.approx(u @ n)
    assert at @ detected == pytest.approx(u @ k)


@pytest.mark.slow
def test_an_adaptive_table_has_the_posterior_of_a_sum_over_all_of_its_levels() -> None:
    rng = np.random.default_rng(4)
    x = rng.uniform(0, 10, 240)
    k = rng.random(240) < 0.5 + 0.48 * ndtr((x - 5) / 2)
    table = tables_at(x * STEP, k, np.ones(240), 0.5)
    expected = brute_force(table, np.array([0.5]), np.ones(1))
    assert posterior_of(table) == pytest.approx(expected, abs=0.03)


MEMORY = """
import re, numpy as np
from pathlib import Path
from analysis.thresholds.likelihood import Tables
from analysis.thresholds.difference import difference_of
from analysis.thresholds.fit import fit_many
from analysis.thresholds.group import group_fit
from analysis.thresholds.guess import GuessRate
people, trials = {people}, {trials}
rng = np.random.default_rng(1)
x = np.log10(60) + 0.15 * rng.standard_normal((people, trials))
k = (rng.random(x.shape) < 0.1 + 0.85 / (1 + np.exp(-20 * (x - np.log10(60))))).astype(float)
guess = GuessRate.after_blanks(answered=4, blanks=40)
tables = Tables(levels=10**x, detected=k, presented=np.ones_like(x), guesses=[guess] * people)
assert all(fit.threshold > 0 for fit in fit_many(tables))
assert people == 1 or group_fit(tables).status == "ok"
print(int(re.search("VmHWM: *\\s*([0-9]+)", Path("/proc/self/status").read_text())[1]) // 1024)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is counted in kB there")
@pytest.mark.parametrize(("people", "trials", "most_mb"), [(12, 300, 300), (1, 20_000, 500)])
def test_memory_does_not_grow_with_the_number_of_levels(
    people: int, trials: int, most_mb: int
) -> None:
    code = MEMORY.format(people=people, trials=trials)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) < most_mb


def test_a_billion_trials_of_two_conditions_have_their_difference() -> None:
    from analysis import compare_conditions

    levels, n = [60, 85, 120, 170], np.full((2, 4), 10**9)
    p = 0.02 + 0.96 * ndtr((np.log10(levels) - 2) / 0.1)
    higher = 0.02 + 0.96 * ndtr((np.log10(levels) - 2.1) / 0.1)
    k, more = (np.round(1e9 * np.array([one, one])) for one in (p, higher))
    found = compare_conditions(levels, k, n, more, n, guess_rate=0.02)
    assert found.difference_db == pytest.approx(2.0, abs=0.01)
