"""Likelihoods on the grid and their posteriors: brute force, laws, many trials, the likeliest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr, xlogy
from scipy.stats import beta

from analysis import GuessRate, fit_psychometric
from analysis.thresholds.mle import (
    LOG_SIGMA,
    MOST_LAPSES,
    REACH,
    SIGMA_FACTOR,
    SIGMA_MEDIAN,
    Tables,
    fit_lapsing,
    log_likelihood,
)
from tests.test_analysis.shared import QUANTA, counts_at
from tests.test_analysis.tables import posterior_of

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
    mu = np.linspace(*reach, 401)
    log_sigma = np.linspace(*widths, 41)
    z = (log_sigma - np.log(SIGMA_MEDIAN)) / np.log(SIGMA_FACTOR)
    total = np.zeros(len(mu))
    felt = ndtr((table.u[0] - mu[:, None, None]) / np.exp(log_sigma)[:, None])
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
    table = counts_at(U, detected, 30, guess_rate)
    found = posterior_of(table, GuessRate(mean=guess_rate)).mu[0]
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
    table = counts_at(U, detected, presented, guess.mean)
    span = ((0.0, 10.0), (0.0, 2.0)) if presented > 30 else ((-24.0, 34.0), LOG_SIGMA)
    expected = brute_force(table, at, weights, *span)
    assert posterior_of(table, guess).mu[0] == pytest.approx(expected, abs=0.03)


def test_public_data_give_about_what_psignifit_gives() -> None:
    # psignifit 4.3 with gamma = eta = 0, on the axis log10 of quanta: mean and 95 % limits, whose
    # priors are other ones.
    x = np.log10(QUANTA["SH/R1"])
    mean, low, high = (value / np.log(10) for value in (4.866049, 4.750542, 4.962707))
    table = counts_at(x * 20, [0, 3, 12, 26, 35, 35], 35)
    assert posterior_of(table, x=x).mu[0] / 20 == pytest.approx([low, mean, high], abs=6e-3)


def test_weak_levels_felt_often_do_not_hide_the_likeliest_function() -> None:
    guess = GuessRate.after_blanks(answered=0, blanks=24)
    levels, detected = [3, 5, 8, 13, 20, 32], [2, 7, 5, 17, 18, 20]
    fit = fit_psychometric(levels, detected, [20] * 6, guess_rate=guess)
    assert fit.deviance == pytest.approx(8.044, abs=0.01)  # a step, were the guess rate 0.2
    assert fit.mle_threshold == pytest.approx(8.23, abs=0.02)


def test_the_nodes_of_a_guess_rate_have_the_moments_of_its_beta_distribution() -> None:
    """Nodes 1.6 standard deviations apart leave 2 exp(-2 pi^2 / 1.6^2), 0.001; closer ones none."""
    for answered, blanks in ((0.0, 20), (3.5, 60), (500.0, 1000), (7.0, 10**6)):
        guess = GuessRate.after_blanks(answered=answered, blanks=blanks)
        assert guess.beta is not None
        a, b = guess.beta
        for stimuli, error in ((0, 2e-3), (3 * blanks, 1e-6)):
            at = np.array(guess.nodes(stimuli))
            weight = np.exp(guess.log_density(at) - guess.log_density(at).max())
            for power in range(1, 8):
                moment = np.prod([(a + i) / (a + b + i) for i in range(power)])
                assert at**power @ weight / weight.sum() == pytest.approx(moment, rel=error)


@pytest.mark.slow
@settings(max_examples=40)
@given(tables_of_counts, st.sampled_from([0.0, 0.5]))
def test_no_corner_or_neighbour_is_likelier(detected: list[int], guess_rate: float) -> None:
    table = counts_at(U, detected, 30, guess_rate)
    best = fit_lapsing(table, posterior_of(table, GuessRate(mean=guess_rate)).starts[:, 0])
    reached = log_likelihood(table, best)[0]
    lower, upper = table.bounds()
    rng = np.random.default_rng(sum(detected))
    for spread in (1e-2, 1.0, 10.0):
        near = best + spread * rng.normal(size=(200, 3)) * [1.0, 0.1, 0.005]
        repeated = counts_at(U, np.repeat(table.detected, 200, axis=0), 30, guess_rate)
        tried = log_likelihood(repeated, np.clip(near, lower, upper))
        assert tried.max() <= reached + 1e-6


def test_a_fit_stays_within_its_bounds() -> None:
    start = np.array([[5.0, 0.0, 0.05]])
    for detected in ([30] * 5, [0] * 5, [30, 20, 10, 5, 0], [0, 0, 0, 30, 30]):
        ((mu, log_sigma, lapse),) = fit_lapsing(counts_at(U, detected, 30), start)
        assert -REACH <= mu <= 10 + REACH
        assert LOG_SIGMA[0] <= log_sigma <= LOG_SIGMA[1]
        assert 0 <= lapse <= MOST_LAPSES
