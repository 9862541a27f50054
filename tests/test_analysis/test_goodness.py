"""The bootstrap of the deviance: uniform under the model, small for what no function gives."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from analysis import GuessRate, PsychometricFit
from analysis.thresholds.goodness import deviance_p
from benchmarks.calibration import psychometric
from tests.test_analysis.tables import fit_counts

LEVELS = [60.0, 85.0, 110.0, 140.0, 200.0]


@pytest.mark.slow
@pytest.mark.parametrize("guess", [0.0, 0.5])
def test_p_is_uniform_under_the_model(guess: float) -> None:
    """Of 400 values, the share below 0.05, 0.25, 0.5 has a standard error of at most 2.5 %."""
    p = psychometric(LEVELS, threshold_vpp=105, sigma=0.12, guess_rate=guess, lapse_rate=0.02)
    k = np.random.default_rng(1).binomial(30, p, (400, 5)).astype(float)
    x, n, guesses = np.tile(np.log10(LEVELS), (400, 1)), np.full((400, 5), 30.0), [guess] * 400
    rates = [GuessRate(mean=one) for one in guesses]
    fits = fit_counts(x, k, n, guess)
    values = deviance_p(x, k, n, fits=fits, guesses=rates, x_scale="log10", seed=2)
    values = values[np.isfinite(values)]
    assert len(values) > 380
    assert ((values > 0) & (values <= 1)).all()
    for share, sd in ((0.05, 0.011), (0.25, 0.022), (0.5, 0.025)):
        assert (values <= share).mean() == pytest.approx(share, abs=3.5 * sd)


def test_p_of_a_misfit_is_the_least_and_depends_on_the_seed_alone() -> None:
    k = np.array([[2.0, 25, 6, 28, 29], [1, 10, 15, 28, 28], [5, 10, 20, 25, 30]])
    x, n = np.tile(np.log10(LEVELS), (3, 1)), np.full((3, 5), 30.0)
    fits = fit_counts(x, k, n, 0.0)
    p = partial(deviance_p, guesses=[GuessRate(mean=0.0)] * 3, x_scale="log10")
    values = p(x, k, n, fits=fits, seed=5).tolist()
    assert values[0] == pytest.approx(1 / 500)
    assert p(x[::-1], k[::-1], n[::-1], fits=fits[::-1], seed=5).tolist() == values[::-1]
    padded = [np.pad(one, ((0, 0), (0, 2)), constant_values=0.0) for one in (x, k, n)]
    assert p(*padded, fits=fits, seed=5).tolist() == values
    assert p(x, k, n, fits=fits, seed=6).tolist() != values
    none = [PsychometricFit(status="threshold_below_levels")] * 3
    assert np.isnan(p(x, k, n, fits=none, seed=1)).all()
