"""Information transfer: its value, its bias, its interval, and the table of an analysis."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from analysis.counts.information import information_transfer


def mixture(n_sites: int, guessed: float) -> np.ndarray:
    """Return the shares of answers of somebody who guesses so often among all sites."""
    return np.eye(n_sites) * (1 - guessed) + guessed / n_sites


def neighbours(n_sites: int, reach: float) -> np.ndarray:
    """Return the shares of answers of somebody who confuses sites the more the nearer they are."""
    distance = np.abs(np.subtract.outer(np.arange(n_sites), np.arange(n_sites)))
    shares = np.exp(-distance / reach)
    return np.asarray(shares / shares.sum(axis=1, keepdims=True))


def information_bits(shares: np.ndarray) -> float:
    """Return the information of equally frequent stimuli as a divergence, sum by sum."""
    marginal = shares.mean(axis=0)
    terms = [
        p * math.log2(p / q) for row in shares for p, q in zip(row, marginal, strict=True) if p
    ]
    return math.fsum(terms) / len(shares)


def test_of_many_trials_the_estimate_is_the_information() -> None:
    # Near-threshold and null trials, felt or not: M. Grund et al., J. Neurosci. 42 (2022) 643-656.
    table = np.array([[8007, 8035], [497, 7545]]) * 1000
    expected = information_bits(table / table.sum(axis=1, keepdims=True))
    assert information_transfer(table).bits == pytest.approx(expected, abs=1e-5)
    for shares in (mixture(16, 0.3), neighbours(8, 2.0), mixture(2, 1.0)):
        table = np.rint(shares * 10**9).astype(np.int64)
        estimate = information_transfer(table)
        assert estimate.bits == pytest.approx(information_bits(shares), abs=1e-6)
        assert estimate.low <= information_bits(shares) + 1e-6
        assert estimate.high - estimate.low < 1e-3


@pytest.mark.parametrize(
    ("shares", "trials"),
    [
        (mixture(4, 0.03), 20),
        (mixture(4, 0.3), 20),
        (neighbours(4, 0.5), 20),
        (neighbours(8, 0.5), 20),
        (neighbours(8, 2.0), 20),
        (mixture(8, 0.03), 40),
        (mixture(16, 0.3), 80),
        (neighbours(16, 2.0), 80),
    ],
)
def test_the_bias_is_below_a_twentieth_of_a_bit(shares: np.ndarray, trials: int) -> None:
    rng = np.random.default_rng(20)
    tables = [np.array([rng.multinomial(trials, row) for row in shares]) for _ in range(60)]
    bits = [information_transfer(table).bits for table in tables]
    assert abs(np.mean(bits) - information_bits(shares)) < 0.05


def test_whoever_never_errs_has_an_interval_with_a_width() -> None:
    estimate = information_transfer(np.eye(4, dtype=np.int64) * 10)
    assert estimate.bits == estimate.high == pytest.approx(2.0, abs=0.01)
    assert 1.0 < estimate.low < 1.5
    many = information_transfer(np.eye(4, dtype=np.int64) * 1000)
    assert many.low > 1.98


def test_the_interval_depends_on_the_seed_alone() -> None:
    table = [[9, 3], [2, 10]]
    assert information_transfer(table, seed=3) == information_transfer(table, seed=3)


def test_a_stimulus_without_answers_has_no_information() -> None:
    assert math.isnan(information_transfer([[3, 1], [0, 0]]).bits)


@pytest.mark.parametrize("table", [[1, 2], [[1.5, 2]], [[-1, 2]]])
def test_what_is_no_table_of_counts_is_refused(table: Any) -> None:
    with pytest.raises(ValueError, match="counts"):
        information_transfer(table)
