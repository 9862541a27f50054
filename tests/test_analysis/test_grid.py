"""Likelihoods on the grid and their posteriors: brute force, laws, many trials, the likeliest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr, xlogy
from scipy.stats import beta

from analysis import GuessRate
from analysis.thresholds.density import Ruler
from analysis.thresholds.fit import PsychometricFit, fit_many
from analysis.thresholds.grid import surfaces
from analysis.thresholds.mle import (
    LOG_SIGMA,
    MOST_LAPSES,
    REACH,
    SIGMA_FACTOR,
    SIGMA_MEDIAN,
    Tables,
    fit_lapsing,
    log_likelihood,
    probabilities,
)
from analysis.thresholds.posterior import Posterior, posterior
from tests.test_analysis.shared import QUANTA, counts_at

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

NONE = GuessRate(mean=0.0)
U = np.array([0.0, 2.5, 5.0, 7.5, 10.0])
RULER = Ruler(low=0.0, high=10.0, step=0.05, tail=3.0)
RISING = [5, 9, 20, 28, 30]
tables_of_counts = st.lists(st.integers(0, 30), min_size=5, max_size=5)


def known(table: Tables, guess: GuessRate = NONE) -> Posterior:
    guesses = [guess] * len(table)
    rulers = [RULER] * len(table)
    found = surfaces(table.u, table.detected, table.presented, rulers=rulers, guesses=guesses)
    return posterior(found, rulers)


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
    found = known(table, GuessRate(mean=guess_rate)).mu[0]
    expected = brute_force(table, np.array([guess_rate]), np.ones(1))
    # Limits outside the levels are told as open.
    assert np.clip(found, 0, 10) == pytest.approx(np.clip(expected, 0, 10), abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("answered", "blanks"), [(6, 40), (0.5, 10), (1, 300)])
def test_a_guess_rate_after_blanks_is_integrated_over(answered: float, blanks: int) -> None:
    guess = GuessRate.after_blanks(answered=answered, blanks=blanks)
    at = (np.arange(40) + 0.5) / 100
    weights = beta(*guess.beta or (1, 1)).pdf(at)
    table = counts_at(U, RISING, 30, guess.mean)
    assert known(table, guess).mu[0] == pytest.approx(brute_force(table, at, weights), abs=0.03)


@pytest.mark.slow
def test_hundreds_of_stimuli_that_contradict_the_blanks_are_believed_as_far_as_they_count() -> None:
    guess = GuessRate.after_blanks(answered=1, blanks=60)
    at = (np.arange(60) + 0.5) / 200
    weights = beta(*guess.beta or (1, 1)).pdf(at)
    table = counts_at(U, [66, 96, 190, 270, 294], 300, guess.mean)
    expected = brute_force(table, at, weights, (0.0, 10.0), (0.0, 2.0))
    assert known(table, guess).mu[0] == pytest.approx(expected, abs=0.03)


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
def test_a_guess_rate_after_very_many_blanks_is_a_number() -> None:
    guess = GuessRate.after_blanks(answered=1_000_000, blanks=10_000_000)
    table = counts_at(U, RISING, 30, guess.mean)
    sure = known(table, GuessRate(mean=guess.mean))
    assert known(table, guess).mu[0] == pytest.approx(sure.mu[0], abs=1e-3)


@pytest.mark.slow
def test_many_posteriors_are_the_single_ones() -> None:
    rng = np.random.default_rng(3)
    k = rng.binomial(30, 0.5 + 0.48 * ndtr((U - 4) / 3), (150, 5)).astype(float)
    many = counts_at(U, k, 30, 0.5)
    guess = GuessRate(mean=0.5)
    together = known(many, guess)
    for i in range(0, 150, 10):
        alone = known(many[slice(i, i + 1)], guess)
        assert together.mu[i] == pytest.approx(alone.mu[0], abs=1e-9)


def test_a_place_without_a_stimulus_tells_nothing() -> None:
    padded = counts_at([*U, 0.0, 0.0], [2, 9, 20, 28, 30, 0, 0], [30] * 5 + [0] * 2)
    plain = known(counts_at(U, [2, 9, 20, 28, 30], 30))
    assert known(padded).mu == pytest.approx(plain.mu, abs=1e-12)


@pytest.mark.slow
def test_billions_of_trials_narrow_the_posterior_down_to_the_truth() -> None:
    n = 1e9
    table = counts_at(U, np.round(n * 0.98 * ndtr((U - 4) / 2)), n)
    found = known(table)
    assert found.mu[0] == pytest.approx(4, abs=1e-3)
    assert 1e-5 < np.ptp(found.mu[0]) < 1e-3
    best = fit_lapsing(table, found.starts[:, 0])
    assert best[0] == pytest.approx([4, np.log(2), 0.02], abs=1e-6)


def test_a_step_between_levels_of_very_many_stimuli_keeps_its_room() -> None:
    # Reference: two million quasi-random functions, weighted by prior and likelihood. The grid that
    # comes first knows lapses to 0.015, these stimuli to 0.0007.
    x = np.log10([40.0, 49.0, 73.0, 95.0])
    ruler, u = Ruler.of(x, "log10"), 20 * x
    counts = np.array([[172.0, 183.0, 19544.0, 19591.0]]), np.full((1, 4), 20000.0)
    found = surfaces(u[None], *counts, rulers=[ruler], guesses=[GuessRate(mean=0.0085)])
    assert posterior(found, [ruler]).mu[0] == pytest.approx([34.668, 35.686, 36.574], abs=0.02)


def test_an_analysis_of_public_data_lies_near_psignifits() -> None:
    # psignifit 4.3 with gamma = eta = 0, on the axis log10 of quanta: mean and 95 % limits, whose
    # priors are other ones.
    x = np.log10(QUANTA["SH/R1"])
    mean, low, high = (value / np.log(10) for value in (4.866049, 4.750542, 4.962707))
    ruler = Ruler.of(x, "log10")
    table = counts_at(x / ruler.step, [0, 3, 12, 26, 35, 35], 35)
    found = surfaces(table.u, table.detected, table.presented, rulers=[ruler], guesses=[NONE])
    mu = posterior(found, [ruler]).mu[0] * ruler.step
    assert mu == pytest.approx([low, mean, high], abs=6e-3)


@pytest.mark.slow
@settings(max_examples=40)
@given(tables_of_counts, st.sampled_from([0.0, 0.5]))
def test_no_corner_or_neighbour_is_likelier(detected: list[int], guess_rate: float) -> None:
    table = counts_at(U, detected, 30, guess_rate)
    best = fit_lapsing(table, known(table, GuessRate(mean=guess_rate)).starts[:, 0])
    reached = log_likelihood(table, best)[0]
    lower, upper = table.bounds()
    rng = np.random.default_rng(sum(detected))
    for spread in (1e-2, 1.0, 10.0):
        near = best + spread * rng.normal(size=(200, 3)) * [1.0, 0.1, 0.005]
        repeated = counts_at(U, np.repeat(table.detected, 200, axis=0), 30, guess_rate)
        tried = log_likelihood(repeated, np.clip(near, lower, upper))
        assert tried.max() <= reached + 1e-6


def test_a_likeliest_function_is_level_though_counts_lie_far_from_it() -> None:
    # Here the observed information is more than twice the expected one.
    u = 20 * np.log10([60.0, 95.0, 130.0, 165.0, 200.0])
    table = counts_at(u, [15, 21, 27, 30, 29], 30, 0.5)
    (best,) = fit_lapsing(
        table, np.array([[40.0946408, np.log(2), 0.0169395307]]), least_gain=1e-13
    )
    for step in 1e-4 * np.diag([1.0, 1.0, 0.1]):
        up, down = (log_likelihood(table, (best + sign * step)[None])[0] for sign in (1, -1))
        assert abs(up - down) < 1e-8


@given(tables_of_counts, st.floats(0, 10), st.floats(-1, 2), st.floats(0, 0.1), st.floats(0, 0.1))
def test_guesses_and_lapses_change_places_in_a_mirrored_table(
    detected: list[int], mu: float, log_sigma: float, lapse: float, guess_rate: float
) -> None:
    here = counts_at(U, detected, 30, guess_rate)
    there = counts_at(10 - U, [30 - k for k in detected], 30, lapse)
    value = log_likelihood(here, np.array([[mu, log_sigma, lapse]]))
    mirrored = log_likelihood(there, np.array([[10 - mu, log_sigma, guess_rate]]))
    assert mirrored == pytest.approx(value, rel=1e-9, abs=1e-9)


def test_detections_and_misses_keep_their_digits_and_add_up() -> None:
    table = counts_at([0.0, 10.0], [1, 1], 1)
    p, q = probabilities(table, np.array([[5.0, np.log(0.2), 0.0]]))
    assert p + q == pytest.approx(np.ones((1, 2)), abs=1e-15)
    assert p[0, 0] == pytest.approx(q[0, 1], rel=1e-12)
    assert 0 < p[0, 0] < 1e-100


def test_a_fit_stays_within_its_bounds() -> None:
    start = np.array([[5.0, 0.0, 0.05]])
    for detected in ([30] * 5, [0] * 5, [30, 20, 10, 5, 0], [0, 0, 0, 30, 30]):
        ((mu, log_sigma, lapse),) = fit_lapsing(counts_at(U, detected, 30), start)
        assert -REACH <= mu <= 10 + REACH
        assert LOG_SIGMA[0] <= log_sigma <= LOG_SIGMA[1]
        assert 0 <= lapse <= MOST_LAPSES


def ruler_of(*x: Any) -> Ruler:
    return Ruler.of(np.array(x), "log10")


def test_levels_closer_than_a_step_and_one_level_alone_have_a_grid() -> None:
    for x in ((2.0, 2.001), (2.0, 2.0)):
        ruler = ruler_of(*x)
        u = np.array([x]) / ruler.step
        (found,) = surfaces(
            u, np.array([[3.0, 9.0]]), np.full((1, 2), 10.0), rulers=[ruler], guesses=[NONE]
        )
        assert (np.diff(found.mu) > 0).all()
        assert np.isfinite(found.values).all()


def told(detected: Sequence[int], presented: int, blanks: tuple[int, int]) -> PsychometricFit:
    levels = np.log10([3.0, 5.0, 8.0, 13.0, 20.0, 32.0])
    guess = GuessRate.after_blanks(answered=blanks[0], blanks=blanks[1])
    shown = np.full((1, len(levels)), float(presented))
    return fit_many(levels[None], np.array([detected], float), shown, guesses=(guess,))[0]


def test_weak_levels_felt_often_do_not_hide_the_likeliest_function() -> None:
    fit = told([2, 7, 5, 17, 18, 20], 20, (0, 24))  # a step, were the guess rate 0.2
    assert fit.deviance == pytest.approx(8.044, abs=0.01)
    assert 10**fit.mle_threshold == pytest.approx(8.23, abs=0.02)


@pytest.mark.slow
def test_no_function_of_a_fine_grid_is_likelier_than_what_is_told_as_likeliest() -> None:
    rng, seen = np.random.default_rng(5), 0
    mu, sigma, lapse = np.meshgrid(
        np.linspace(0.4, 1.6, 60), np.geomspace(0.012, 1.5, 30), np.linspace(0, 0.1, 6)
    )
    levels = np.log10([3.0, 5.0, 8.0, 13.0, 20.0, 32.0])
    felt = ndtr((levels - mu[..., None]) / sigma[..., None])
    for _ in range(60):
        guess, n = rng.choice([0.0, 0.05, 0.2, 0.3]), int(rng.choice([8, 16, 20]))
        true = ndtr((levels - rng.uniform(0.5, 1.4)) / 10 ** rng.uniform(-2, -0.3))
        k = rng.binomial(n, guess + (0.95 - guess) * true)
        blanks = int(rng.binomial(24, guess)), 24
        fit = told(k.tolist(), n, blanks)
        if fit.status not in {"ok", "lapse_at_bound"}:
            continue
        seen += 1
        rate = GuessRate.after_blanks(answered=blanks[0], blanks=24).mean
        p = rate + (1 - rate - lapse[..., None]) * felt
        q = lapse[..., None] + (1 - rate - lapse[..., None]) * (1 - felt)
        of_grid = xlogy(k, np.maximum(p, 1e-300)) + xlogy(n - k, np.maximum(q, 1e-300))
        best = xlogy(k, k / n) + xlogy(n - k, 1 - k / n) - of_grid
        assert fit.deviance <= 2 * best.sum(axis=-1).min() + 1e-9, (k, n, blanks)
    assert seen > 40
