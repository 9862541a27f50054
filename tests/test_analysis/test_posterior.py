"""The posterior of psychometric functions: reference results, brute force, laws."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr, xlogy
from scipy.stats import beta

from analysis import GuessRate
from analysis.thresholds.likelihood import (
    LOWER,
    UPPER,
    Tables,
    fit_lapsing,
    log_likelihood,
    probabilities,
)
from analysis.thresholds.posterior import Nodes, Posterior, posterior
from tests.test_analysis.shared import FLASH, QUANTA, SPEED, counts_at

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

NONE = GuessRate(mean=0.0)
U = np.linspace(0, 1, 5)
tables_of_counts = st.lists(st.integers(0, 30), min_size=5, max_size=5)

# Posterior median and limits of mu, and mean lambda, by a
# trapezoid of 801 x 401 x 41 nodes over the prior (mu, log sigma, lambda). Its step in mu is
# range/320, and its limits are interpolated linearly; with 6401 nodes in mu those of the last table
# move by -0.0018 and +0.0053 to within 1e-4 of ours, those of the others by less.
PUBLISHED: list[tuple[Any, list[int], Any, list[float], float, float]] = [
    (np.log(QUANTA["SH/R1"]), [0, 3, 12, 26, 35, 35], 35,
     [4.75988800752367, 4.865466062692493, 4.9698877942415995], 0.013836108684540426, 6e-4),
    (np.log(QUANTA["SS/R2"]), [0, 0, 6, 22, 47, 50], 50,
     [4.43177428382661, 4.517762580952968, 4.603458074709296], 0.01439130942670251, 6e-4),
    (np.log(QUANTA["MHP/R1"]), [3, 3, 12, 33, 44, 50], 50,
     [4.641662999472325, 4.751012106934825, 4.8579725542861905], 0.016888394156209963, 6e-4),
    (FLASH, [0, 0, 0, 2, 2, 2, 2, 3, 4, 18], [3, 3, 5, 13, 10, 20, 14, 11, 5, 20],
     [0.8153896230494289, 0.9325649613842806, 1.0803267543099715], 0.038800173802995816, 6e-4),
    (SPEED, [15, 41, 88, 196, 265, 312, 338], 360,
     [7.772516939059612, 8.183629072377354, 8.592264515172328], 0.03800174854104451, 6e-3),
    (SPEED, [40, 54, 118, 165, 257, 301, 334], 360,
     [7.841218795070084, 8.271485143804526, 8.628613082194905], 0.015255115919649714, 6e-3),
]  # fmt: skip
# The same data by psignifit 4.3 with gamma = eta = 0: most likely threshold and sigma, mean of the
# threshold and its 95 % limits (both lie about 0.009, half a step of its grid, below the others').
PSIGNIFIT = [
    ("SH/R1", [0, 3, 12, 26, 35, 35], 35, (4.874117690465556, 0.3744785715695196),
     4.866049268539545, (4.750542111039541, 4.962707138924242)),
    ("SS/R2", [0, 0, 6, 22, 47, 50], 50, (4.527336570078458, 0.3338432122071795),
     4.5187609184560396, (4.422783537945373, 4.5956218436693534)),
    ("MHP/R1", [3, 3, 12, 33, 44, 50], 50, (4.766060714856281, 0.5261535164663057),
     4.751689862938804, (4.632073838814405, 4.850549625634922)),
]  # fmt: skip


def on_axis(x: Any, detected: Any, presented: Any) -> tuple[Posterior, float, float]:
    low, width = float(np.min(x)), float(np.ptp(x))
    table = counts_at((np.asarray(x) - low) / width, detected, presented)
    return posterior(table, [NONE]), low, width


def brute_force(table: Tables, gammas: Floats, weights: Floats) -> Floats:
    """Return the limits and median of mu by a plain sum over a regular grid."""
    mu = np.linspace(LOWER[0], UPPER[0], 501)
    log_sigma = np.linspace(LOWER[1], UPPER[1], 81)
    lapse = np.linspace(0.0, 0.1, 11)
    inside = np.ones(81)
    inside[[0, -1]] = 0.5
    felt = ndtr((table.u[0] - mu[:, None, None]) / np.exp(log_sigma)[:, None])
    total = np.zeros(501)
    for gamma, share in zip(gammas, weights, strict=True):
        for place, lam in enumerate(lapse):
            p = gamma + (1 - gamma - lam) * felt
            k, n = table.detected[0], table.presented[0]
            value = np.exp((xlogy(k, p) + xlogy(n - k, 1 - p)).sum(axis=2) + _SCALE)
            edge = 0.5 if place in {0, 10} else 1.0
            total += share * edge * (1 - lam) ** 9 * (value @ inside)
    cumulated = np.concatenate([[0.0], np.cumsum(total[1:] + total[:-1])])
    return np.interp([0.025, 0.5, 0.975], cumulated / cumulated[-1], mu)


_SCALE = 60.0


@pytest.mark.parametrize(("x", "detected", "presented", "limits", "lapse", "within"), PUBLISHED)
def test_the_posterior_is_that_of_an_independent_grid(
    x: Any, detected: list[int], presented: Any, limits: list[float], lapse: float, within: float
) -> None:
    known, low, width = on_axis(x, detected, presented)
    found = low + width * known.mu[0]
    assert found == pytest.approx(limits, abs=within)
    assert found[1] == pytest.approx(limits[1], abs=3e-4)
    assert known.lapse_rate[0] == pytest.approx(lapse, abs=1e-4)


@pytest.mark.parametrize(("name", "detected", "presented", "best", "mean", "limits"), PSIGNIFIT)
def test_psignifit_finds_the_same_within_its_grid(
    name: str,
    detected: list[int],
    presented: int,
    best: tuple[float, float],
    mean: float,
    limits: tuple[float, float],
) -> None:
    known, low, width = on_axis(np.log(QUANTA[name]), detected, presented)
    mu, log_sigma, _ = known.best[0]
    assert (low + width * mu, width * np.exp(log_sigma)) == pytest.approx(best, abs=1e-4)
    found = low + width * known.mu[0]
    assert found[1] == pytest.approx(mean, abs=2e-3)
    assert found[[0, 2]] == pytest.approx(limits, abs=1.1e-2)


@pytest.mark.parametrize("guess_rate", [0.0, 0.3, 0.5])
@pytest.mark.parametrize(
    "detected", [[2, 9, 20, 28, 30], [12, 18, 17, 29, 28], [26, 26, 29, 27, 29]]
)
def test_brute_force_finds_the_same(detected: list[int], guess_rate: float) -> None:
    table = counts_at(U, detected, 30, guess_rate)
    known = posterior(table, [GuessRate(mean=guess_rate)])
    expected = brute_force(table, np.array([guess_rate]), np.ones(1))
    assert known.mu[0] == pytest.approx(expected, abs=2e-3)


@pytest.mark.slow
def test_a_guess_rate_after_blanks_is_integrated_over() -> None:
    guess = GuessRate.after_blanks(answered=6, blanks=40)
    at = np.linspace(0.01, 0.45, 23)
    weights = beta(*guess.beta or (1, 1)).pdf(at)
    table = counts_at(U, [5, 9, 20, 28, 30], 30, guess.mean)
    known = posterior(table, [guess])
    assert known.mu[0] == pytest.approx(brute_force(table, at, weights), abs=3e-3)
    sure = posterior(table, [GuessRate(mean=guess.mean)])
    assert np.ptp(known.mu[0]) > np.ptp(sure.mu[0])


def test_the_points_of_a_guess_rate_have_the_moments_of_its_beta_distribution() -> None:
    for answered, blanks in ((0.0, 20), (3.5, 60), (500.0, 1000), (7.0, 10**6)):
        guess = GuessRate.after_blanks(answered=answered, blanks=blanks)
        at, weight = guess.nodes(5)
        assert guess.beta is not None
        a, b = guess.beta
        for power in range(1, 8):
            moment = np.prod([(a + i) / (a + b + i) for i in range(power)])
            assert at**power @ weight == pytest.approx(moment, rel=1e-9)


def test_a_guess_rate_after_very_many_blanks_is_a_number() -> None:
    guess = GuessRate.after_blanks(answered=1_000_000, blanks=10_000_000)
    table = counts_at(U, [5, 9, 20, 28, 30], 30, guess.mean)
    sure = posterior(table, [GuessRate(mean=guess.mean)])
    assert posterior(table, [guess]).mu[0] == pytest.approx(sure.mu[0], abs=1e-5)


@pytest.mark.slow
@settings(max_examples=25)
@given(tables_of_counts, st.sampled_from([0.0, 1 / 3, 0.5]))
def test_a_finer_grid_finds_the_same(detected: list[int], guess_rate: float) -> None:
    table, guess = counts_at(U, detected, 30, guess_rate), [GuessRate(mean=guess_rate)]
    here = posterior(table, guess)
    finer = posterior(table, guess, Nodes(mu=121, log_sigma=81, lapse=12))
    assert here.mu[0] == pytest.approx(finer.mu[0], abs=4e-3)
    assert here.below[0] == pytest.approx(finer.below[0], abs=2e-3)
    assert here.lapse_rate[0] == pytest.approx(finer.lapse_rate[0], abs=1e-3)


@pytest.mark.slow
def test_many_posteriors_are_the_single_ones() -> None:
    rng = np.random.default_rng(3)
    k = rng.binomial(30, 0.5 + 0.48 * ndtr((U - 0.4) / 0.3), (150, 5)).astype(float)
    many = counts_at(U, k, 30, 0.5)
    together = posterior(many, [GuessRate(mean=0.5)] * 150)
    for i in range(0, 150, 10):
        alone = posterior(many[slice(i, i + 1)], [GuessRate(mean=0.5)])
        assert together.mu[i] == pytest.approx(alone.mu[0], abs=2e-5)
        assert together.best[i] == pytest.approx(alone.best[0], abs=1e-7)


def test_a_place_without_a_stimulus_tells_nothing() -> None:
    padded = counts_at([*U, 0.0, 0.0], [2, 9, 20, 28, 30, 0, 0], [30] * 5 + [0] * 2)
    plain = posterior(counts_at(U, [2, 9, 20, 28, 30], 30), [NONE])
    assert posterior(padded, [NONE]).mu == pytest.approx(plain.mu, abs=1e-12)


def test_billions_of_trials_narrow_the_posterior_down_to_the_truth() -> None:
    n = 1e9
    k = np.round(n * 0.98 * ndtr((U - 0.4) / 0.2))
    known = posterior(counts_at(U, k, n), [NONE])
    assert known.mu[0] == pytest.approx(0.4, abs=1e-4)
    assert 1e-6 < np.ptp(known.mu[0]) < 1e-4
    assert known.best[0] == pytest.approx([0.4, np.log(0.2), 0.02], abs=1e-7)


@pytest.mark.slow
@given(tables_of_counts, st.sampled_from([0.0, 0.5]))
def test_no_corner_or_neighbour_is_likelier(detected: list[int], guess_rate: float) -> None:
    table = counts_at(U, detected, 30, guess_rate)
    best = posterior(table, [GuessRate(mean=guess_rate)]).best
    reached = log_likelihood(table, best)[0]
    rng = np.random.default_rng(sum(detected))
    for spread in (1e-3, 1e-1, 1.0):
        near = best + spread * rng.normal(size=(200, 3)) * [1.0, 1.0, 0.05]
        tried = np.clip(near, LOWER, UPPER)
        repeated = counts_at(U, np.repeat(table.detected, 200, axis=0), 30, guess_rate)
        assert log_likelihood(repeated, tried).max() <= reached + 1e-6


@given(tables_of_counts, st.floats(0, 1), st.floats(-3, 0), st.floats(0, 0.1), st.floats(0, 0.1))
def test_guesses_and_lapses_change_places_in_a_mirrored_table(
    detected: list[int], mu: float, log_sigma: float, lapse: float, guess_rate: float
) -> None:
    here = counts_at(U, detected, 30, guess_rate)
    there = counts_at(1 - U, [30 - k for k in detected], 30, lapse)
    value = log_likelihood(here, np.array([[mu, log_sigma, lapse]]))
    mirrored = log_likelihood(there, np.array([[1 - mu, log_sigma, guess_rate]]))
    assert mirrored == pytest.approx(value, rel=1e-9, abs=1e-9)


def test_detections_and_misses_keep_their_digits_and_add_up_to_counts_at() -> None:
    table = counts_at([0.0, 1.0], [1, 1], 1)
    p, q = probabilities(table, np.array([[0.5, np.log(0.02), 0.0]]))
    assert p + q == pytest.approx(np.ones((1, 2)), abs=1e-15)
    assert p[0, 0] == pytest.approx(q[0, 1], rel=1e-12)
    assert 0 < p[0, 0] < 1e-100


def test_a_fit_stays_within_its_bounds() -> None:
    start = np.array([[0.5, -1.0, 0.05]])
    for detected in ([30] * 5, [0] * 5, [30, 20, 10, 5, 0], [0, 0, 0, 30, 30]):
        fit = fit_lapsing(counts_at(U, detected, 30), start)
        assert ((fit >= LOWER) & (fit <= UPPER)).all()
