"""Intervals cover the true values of simulated data as often as they should."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis import group_interval
from benchmarks.calibration import BETWEEN_DB, SCENARIOS, SIGMA, Scenario, ours
from tests.long.test_fuzz import rounds


@pytest.mark.parametrize(
    "scenario", SCENARIOS[:4], ids=lambda s: f"{s.levels_vpp[0]}-{s.guess_rate}"
)
def test_limits_of_thresholds_cover_them(scenario: Scenario) -> None:
    limits = ours(scenario, scenario.counts(rounds(4000)))
    truth = math.log10(scenario.threshold_vpp)
    covered = (limits[:, 0] <= truth) & (truth <= limits[:, 2])
    slack = 4 * math.sqrt(0.05 * 0.95 / len(covered))
    assert 0.91 - slack <= covered.mean() <= 0.99 + slack


@pytest.mark.parametrize("level_vpp", [60.0, 95.0])
def test_intervals_of_groups_cover_their_probability(level_vpp: float) -> None:
    rng = np.random.default_rng(3)
    x = math.log10(level_vpp / 70)
    offsets = BETWEEN_DB / 20 * rng.standard_normal((rounds(20_000), 5))
    p = np.array([[math.erfc(-v / math.sqrt(2)) / 2 for v in row] for row in (x + offsets) / SIGMA])
    truth = math.erfc(-x / math.hypot(SIGMA, BETWEEN_DB / 20) / math.sqrt(2)) / 2
    limits = np.array([group_interval(k, [30] * 5) for k in rng.binomial(30, p)])
    covered = (limits[:, 0] <= truth) & (truth <= limits[:, 1])
    assert covered.mean() >= 0.91 - 4 * math.sqrt(0.05 * 0.95 / len(covered))
