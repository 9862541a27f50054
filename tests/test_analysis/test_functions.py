"""Functions as they are drawn: bands by another integration, limits, units."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.special import ndtr, xlogy

from analysis import GuessRate
from analysis.thresholds.band import Line, group_bands, group_function, person_function
from tests.test_analysis.tables import fit_people, people_with

LEVELS = np.array([60.0, 80.0, 110.0, 150.0, 200.0])
FELT = [15, 18, 24, 29, 30]
ANY = Line(mu=2.0, sigma=0.1, lapse_rate=0.0, guess_rate=0.5)


def people(*felt: list[int], presented: int = 30, alarms: Any = (), blanks: int = 40) -> Any:
    """Return people of a forced choice, or with false alarms of their own."""
    rows = [
        (f"S{i}", level, k, presented)
        for i, counts in enumerate(felt)
        for level, k in zip(LEVELS, counts, strict=True)
    ]
    table = pd.DataFrame(rows, columns=["participant", "level_vpp", "detected", "presented"])
    rates = [GuessRate.after_blanks(answered=k, blanks=blanks) for k in alarms]
    return people_with(table.assign(condition="main", none_offered=False), rates)


def drawn_bands(counts: Any, at: Any, draws: int) -> Any:
    """Return the band by drawing from the prior and weighting by the likelihood."""
    rng = np.random.default_rng(3)
    x, k, n = 20 * np.log10(counts.levels[0]), counts.detected[0], counts.presented[0]
    mu = rng.uniform(x[0] - 24, x[-1] + 24, draws)
    log_sigma = np.log(2) + np.log(2.5) * rng.uniform(-3.2, 3.2, draws)
    lapse, rate = rng.uniform(0, 0.1, draws), counts.guesses[0]
    a, b = rate.beta or (1, 1)
    gamma = rng.beta(a, b, draws) if rate.beta else np.full(draws, rate.mean)
    outside_db = np.maximum(np.maximum(x[0] - mu, mu - x[-1]), 0)
    weight = np.exp(-outside_db / 3 - ((log_sigma - np.log(2)) / np.log(2.5)) ** 2 / 2)
    weight *= (1 - lapse) ** 9
    z = (x[:, None] - mu) * np.exp(-log_sigma)
    p, q = (low + (1 - gamma - lapse) * ndtr(s) for low, s in ((gamma, z), (lapse, -z)))
    weight *= np.exp((xlogy(k[:, None], p) + xlogy((n - k)[:, None], q)).sum(axis=0) + 60)
    found = []
    for place in at:
        value = gamma + (1 - gamma - lapse) * ndtr((place * 20 - mu) * np.exp(-log_sigma))
        order = np.argsort(value)
        below = np.cumsum(weight[order]) / weight.sum()
        found.append(value[order][np.searchsorted(below, [0.025, 0.975])])
    return np.array(found).T


@pytest.mark.slow
@pytest.mark.parametrize(("felt", "alarms"), [(FELT, ()), ([4, 9, 20, 28, 29], (4,))])
def test_a_band_is_that_of_draws_from_the_prior(felt: list[int], alarms: Any) -> None:
    counts = people(felt, alarms=alarms)
    one = person_function(counts, ANY)
    chosen = [0, 12, 24, 36, -1]
    expected = drawn_bands(counts, np.log10(one.level_vpp[chosen]), 2_000_000)
    assert np.abs(np.stack([one.low, one.high])[:, chosen] - expected).max() < 0.012


def test_a_band_lies_between_guesses_and_lapses_and_knows_no_unit() -> None:
    counts = people(FELT)
    one = person_function(counts, ANY)
    assert ((one.low >= 0.5) & (one.low < one.high) & (one.high <= 1)).all()
    assert (np.diff(one.low) > -1e-3).all()
    other = person_function(replace(counts, levels=counts.levels * 1000), ANY)
    assert np.abs(one.low - other.low).max() < 3e-3
    assert np.abs(one.high - other.high).max() < 3e-3


def test_a_groups_line_is_halfway_at_its_threshold() -> None:
    counts = people(FELT, [16, 20, 27, 30, 30], [14, 17, 19, 26, 29])
    one = group_function(counts)
    at = fit_people(counts).groups["threshold_vpp"].iloc[0]
    assert 10**one.line.mu == pytest.approx(at, rel=1e-9)
    half = one.line.guess_rate + (1 - one.line.guess_rate - one.line.lapse_rate) / 2
    assert float(one.at(np.array(at))) == pytest.approx(half, abs=1e-12)
    drawn = one.at(one.level_vpp)
    assert ((one.low - 0.01 < drawn) & (drawn < one.high + 0.01)).all()


def test_bands_of_levels_are_those_of_the_drawn_function() -> None:
    counts = people(FELT, [16, 20, 27, 30, 30], [14, 17, 19, 26, 29])
    bands, one = group_bands(counts), group_function(counts)
    assert bands["level_vpp"].tolist() == LEVELS.tolist()
    tested = np.isin(one.level_vpp, LEVELS)
    assert bands["p_low"].tolist() == pytest.approx(one.low[tested].tolist())
    assert bands["p_high"].tolist() == pytest.approx(one.high[tested].tolist())
    assert (bands["p_low"] < bands["p_function"]).all()
    assert (bands["p_function"] < bands["p_high"]).all()
    alone = group_bands(people(FELT))
    assert (alone["p_low"] < alone["p_high"]).all()


def test_a_band_of_blocks_of_places_is_that_of_all() -> None:
    rng = np.random.default_rng(0)
    mu, sigma = rng.normal(2, 0.1, 300), rng.uniform(0.05, 0.2, 300)
    drawn = Line(mu=mu, sigma=sigma, lapse_rate=0 * mu, guess_rate=0 * mu)
    x = np.linspace(1.5, 2.5, 601)
    whole = np.quantile(drawn.at(x[:, None]), [0.025, 0.975], axis=1)
    assert np.array_equal(drawn.band(x), whole)


def test_a_groups_band_ends_with_its_lapses_and_begins_with_its_false_alarms() -> None:
    ends = [
        group_function(people(*[felt] * 8, alarms=[1] * 8))
        for felt in ([2, 5, 20, 30, 30], [2, 5, 20, 27, 27])
    ]
    never, often = (float(one.at(np.array([200.0]))[0]) for one in ends)
    assert (never > 0.975, often < 0.94) == (True, True)
    assert ends[1].high[-1] < 0.985 < ends[0].high[-1]
    alarms = [0, 1, 2, 3, 4, 5, 7, 9, 10, 14]
    counts = people(*[[0, 3, 15, 27, 30]] * 10, alarms=alarms)
    more = [[3 * k / 4, k / 2, 0, 0, 0] for k in alarms]
    one = group_function(replace(counts, detected=counts.detected + more))
    half = 1.96 * np.std(np.array(alarms) / 40, ddof=1) / np.sqrt(10)
    assert (one.high[0] - one.low[0]) / 2 == pytest.approx(half, rel=0.2)
    alike = people(*[[3, 5, 15, 27, 30]] * 10, alarms=[4] * 10)
    narrow = group_function(alike)
    # All counts equal: what is left is that 40 blanks and a weak level of each tell it.
    least = 2 * 1.96 * np.sqrt(0.1 * 0.9 / (40 + 30) / 10)
    assert least < narrow.high[0] - narrow.low[0] < one.high[0] - one.low[0]
