"""The deviance and its bootstrap: uniform under the model, small for what no function gives."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from analysis import GuessRate, PsychometricFit
from analysis.thresholds.fit import fit_many
from analysis.thresholds.goodness import bootstrap_p, deviance_p
from analysis.thresholds.mle import fit_lapsing
from analysis.thresholds.probit import deviance
from benchmarks.calibration import psychometric
from tests.test_analysis.shared import counts_at

LEVELS = [60.0, 85.0, 110.0, 140.0, 200.0]
U = 20 * np.log10(np.array(LEVELS) / 60)


tables = partial(counts_at, U)


@pytest.mark.slow
@pytest.mark.parametrize("guess", [0.0, 0.5])
def test_p_is_uniform_under_the_model(guess: float) -> None:
    """Of 400 values, the share below 0.05, 0.25, 0.5 has a standard error of at most 2.5 %."""
    p = psychometric(LEVELS, threshold_vpp=105, sigma=0.12, guess_rate=guess, lapse_rate=0.02)
    k = np.random.default_rng(1).binomial(30, p, (400, 5)).astype(float)
    drawn = tables(k, 30, guess)
    best = fit_lapsing(drawn, np.tile([5.0, 1.0, 0.02], (400, 1)))
    values = bootstrap_p(drawn, best, seed=2)
    assert ((values > 0) & (values <= 1)).all()
    for share, sd in ((0.05, 0.011), (0.25, 0.022), (0.5, 0.025)):
        assert (values <= share).mean() == pytest.approx(share, abs=3.5 * sd)


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "blanks", "presented"), [(0.09, 32, 16), (0.15, 32, 16)])
def test_a_guess_rate_that_blanks_tell_wrongly_is_no_misfit(
    rate: float, blanks: int, presented: int
) -> None:
    """Of 1000 values, the share below 0.01 has a standard error of 0.3 %, below 0.05 of 0.7 %."""
    rng, levels = np.random.default_rng(8), [0.5, 1.0, 2.0, 4.0, 8.0, 16.0]
    curve = partial(psychometric, levels, sigma=0.2, guess_rate=rate, lapse_rate=0.02)
    p = np.stack([curve(threshold_vpp=10 ** rng.normal(0.4, 0.12)) for _ in range(1000)])
    k, n = rng.binomial(presented, p).astype(float), np.full(p.shape, float(presented))
    alarms = rng.binomial(blanks, rate, 1000)
    guesses = [GuessRate.after_blanks(answered=float(one), blanks=blanks) for one in alarms]
    x = np.tile(np.log10(levels), (1000, 1))
    fits = fit_many(x, k, n, guesses=guesses)
    values = deviance_p(x, k, n, fits=fits, guesses=guesses, x_scale="log10", seed=1)
    values = values[np.isfinite(values)]
    assert (values < 0.01).mean() < 0.01 + 3.5 * 0.003
    assert (values < 0.05).mean() == pytest.approx(0.05, abs=3.5 * 0.007)
    by_mean = [GuessRate(mean=one.mean) for one in guesses]
    fixed = deviance_p(x, k, n, fits=fits, guesses=by_mean, x_scale="log10", seed=1)
    assert np.nanmean(fixed < 0.05) > 1.2 * (values < 0.05).mean()


def test_a_table_that_no_function_gives_has_the_least_p() -> None:
    drawn = tables([2, 25, 6, 28, 29], 30)
    best = fit_lapsing(drawn, np.array([[4.0, 1.0, 0.02]]))
    assert bootstrap_p(drawn, best, seed=1)[0] == pytest.approx(1 / 500)
    assert bootstrap_p(drawn, best, seed=1, replicates=49)[0] == pytest.approx(1 / 50)


def test_neither_order_nor_company_nor_empty_levels_matter() -> None:
    k = np.array([[2.0, 14, 22, 28, 29], [1, 10, 15, 28, 28], [5, 10, 20, 25, 30]])
    x, n = np.tile(np.log10(LEVELS), (3, 1)), np.full((3, 5), 30.0)
    guesses = [GuessRate(mean=0.0)] * 3
    fits = fit_many(x, k, n, guesses=guesses)
    p = partial(deviance_p, guesses=guesses, x_scale="log10")
    values = p(x, k, n, fits=fits, seed=5).tolist()
    assert p(x[::-1], k[::-1], n[::-1], fits=fits[::-1], seed=5).tolist() == values[::-1]
    padded = [np.pad(one, ((0, 0), (0, 2)), constant_values=0.0) for one in (x, k, n)]
    assert p(*padded, fits=fits, seed=5).tolist() == values
    assert p(x, k, n, fits=fits, seed=6).tolist() != values


def test_a_fit_without_a_threshold_has_no_p() -> None:
    x, k = np.log10([LEVELS]), np.full((1, 5), 30.0)
    guesses = [GuessRate(mean=0.0)]
    none = [PsychometricFit(status="threshold_below_levels")]
    assert np.isnan(deviance_p(x, k, k, fits=none, guesses=guesses, x_scale="log10", seed=1)).all()


def test_the_deviance_is_zero_where_the_proportions_are_met_and_ignores_empty_places() -> None:
    k, n = np.array([[0.0, 7, 30, 0]]), np.array([[30.0, 30, 30, 0]])
    p = np.array([[0.0, 7 / 30, 1.0, 0.3]])
    assert deviance(k, n, p, 1 - p)[0] == pytest.approx(0, abs=1e-12)
    assert deviance(k, n, np.full((1, 4), 0.5), np.full((1, 4), 0.5))[0] > 10
