"""Intervals of proportions, and mutual information: published values, laws, refusals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import betabinom, cauchy, fisher_exact, ttest_1samp

from analysis import group_interval, proportion_ci
from analysis.counts.intervals import equal_rates_p, hypergeometric_tails, mean_limits

# statsmodels 0.14, proportion_confint, methods wilson, jeffreys and beta; and, to four digits,
# Newcombe (1998), Statistics in Medicine 17, 857-872, table I, methods 3 (score) and 5 (exact).
PUBLISHED = [
    ("wilson", 2, 13, 0.04325817835808121, 0.42234631019482544, 1e-13),
    ("wilson", 33, 50, 0.521538260502326, 0.775630507774999, 1e-13),
    ("wilson", 8007, 16042, 0.4913911484363846, 0.5068638511489062, 1e-13),
    ("wilson", 24, 25, 0.805, 0.993, 5e-4),  # of both-finger trials: there is room below 0.96
    ("wilson", 81, 263, 0.2553, 0.3662, 5e-5),
    ("wilson", 15, 148, 0.0624, 0.1605, 5e-5),
    ("wilson", 0, 20, 0.0000, 0.1611, 5e-5),
    ("wilson", 1, 29, 0.0061, 0.1718, 5e-5),
    ("jeffreys", 2, 13, 0.03341157295356806, 0.40900530177481076, 1e-13),
    ("jeffreys", 33, 50, 0.5226459236571399, 0.7794249068986815, 1e-13),
    ("jeffreys", 497, 8042, 0.056694881606322405, 0.06722153971982399, 1e-13),
    ("clopper-pearson", 2, 13, 0.019206671982528477, 0.45447105567655777, 1e-13),
    ("clopper-pearson", 0, 5, 0.0, 0.5218237501049815, 1e-13),
    ("clopper-pearson", 497, 8042, 0.05663520255935584, 0.06728616162900178, 1e-13),
    ("clopper-pearson", 81, 263, 0.2527, 0.3676, 5e-5),
    ("clopper-pearson", 15, 148, 0.0578, 0.1617, 5e-5),
    ("clopper-pearson", 0, 20, 0.0000, 0.1684, 5e-5),
    ("clopper-pearson", 1, 29, 0.0009, 0.1776, 5e-5),
]
METHODS = ("wilson", "jeffreys", "clopper-pearson")
counts = st.integers(1, 400).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))
fast = settings(deadline=None, max_examples=60)


@pytest.mark.parametrize(("method", "k", "n", "low", "high", "to"), PUBLISHED)
def test_the_limits_are_published(
    method: str, k: int, n: int, low: float, high: float, to: float
) -> None:
    assert proportion_ci(k, n, method) == pytest.approx((low, high), abs=to)


@fast
@given(counts)
def test_limits_hold_the_proportion_mirror_and_rise_with_it(kn: tuple[int, int]) -> None:
    k, n = kn
    intervals = {}
    for method in METHODS:
        low, high = intervals[method] = proportion_ci(k, n, method)
        assert 0 <= low <= k / n <= high <= 1
        mirrored_low, mirrored_high = proportion_ci(n - k, n, method)
        assert (1 - mirrored_high, 1 - mirrored_low) == pytest.approx((low, high), abs=1e-12)
        assert (low == 0) == (k == 0)
        assert (high == 1) == (k == n)
        if k < n:
            more = proportion_ci(k + 1, n, method)
            assert low < more[0]
            assert high < more[1] or more[1] == high == 1
        assert proportion_ci(0, 0, method) == (0.0, 1.0)  # nothing is known
    assert intervals["clopper-pearson"][0] <= intervals["jeffreys"][0]
    assert intervals["jeffreys"][1] <= intervals["clopper-pearson"][1]
    for limit in intervals["wilson"]:  # which solves the score equation
        squared = 1.959963984540054**2 * limit * (1 - limit)
        assert n * (k / n - limit) ** 2 == pytest.approx(squared, abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_arrays_give_what_single_numbers_give(method: str) -> None:
    k, n = np.arange(4)[:, None], np.array([3, 30, 300])
    low, high = proportion_ci(k, n, method)
    each = [[proportion_ci(int(a), int(b), method) for b in n] for a in k.ravel()]
    assert np.array_equal(np.stack([low, high], axis=-1), each)


@pytest.mark.parametrize(
    ("method", "expected"),
    [("wilson", 0.953), ("jeffreys", 0.951), ("clopper-pearson", 0.973)],
)
def test_coverage_at_30_trials_is_as_documented(method: str, expected: float) -> None:
    # Mean of the exact coverage over p = .001, .002, ... .999, as docs/statistics.md states it.
    k = np.arange(31)
    low, high = proportion_ci(k, 30, method)
    p = np.linspace(0.001, 0.999, 999)[:, None]
    weights = np.array([math.comb(30, int(i)) for i in k]) * p**k * (1 - p) ** (30 - k)
    coverage = (weights * ((low <= p) & (p <= high))).sum(axis=1).mean()
    assert coverage == pytest.approx(expected, abs=0.0005)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("k", "n"), [([5, 15, 25], [30, 30, 30]), ([30, 30, 29, 30], [30] * 4), ([1, 40], [2, 300])]
)
def test_the_group_interval_is_that_of_a_plain_sum_over_beta_binomials(
    k: list[int], n: list[int]
) -> None:
    m, spread = ((np.arange(nodes) + 0.5) / nodes for nodes in (1500, 300))
    size = 1 / spread**2 - 1
    a, b = m[:, None] * size, (1 - m[:, None]) * size
    log = sum(betabinom.logpmf(hits, shown, a, b) for hits, shown in zip(k, n, strict=True))
    below = np.cumsum(np.exp(log).sum(axis=1))
    expected = np.interp([0.025, 0.975], below / below[-1], m + 0.5 / 1500)
    assert group_interval(k, n) == pytest.approx(expected, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("k", "n"), [([0, 1, 0, 2, 0, 1], [20] * 6), ([0] * 5, [12] * 5), ([20, 0, 1], [20, 25, 30])]
)
def test_the_interval_of_false_alarms_is_that_of_a_plain_sum_with_cauchy_log_odds(
    k: list[int], n: list[int]
) -> None:
    means, tenths = (np.arange(nodes) / nodes + 0.5 / nodes for nodes in (1500, 400))
    weight = np.zeros(len(means))
    for at, m in enumerate(means):
        most = 1 / math.sqrt(m * (1 - m))  # where v is 1
        odds = most * tenths
        size = 1 / (odds**2 * m * (1 - m)) - 1
        log = sum(
            betabinom.logpmf(hits, shown, m * size, (1 - m) * size)
            for hits, shown in zip(k, n, strict=True)
        )
        prior = cauchy.pdf(odds)
        weight[at] = (1 - m) ** 4 * (np.exp(log) * prior).sum() / prior.sum()
    below = np.cumsum(weight)
    expected = np.interp([0.025, 0.975], below / below[-1], means + 0.5 / len(means))
    assert group_interval(k, n, false_alarms=True) == pytest.approx(expected, abs=2e-3)


def test_alike_participants_tell_nearly_as_much_as_their_trials_and_one_has_no_interval() -> None:
    low, high = group_interval([12] * 20, [30] * 20)
    pooled_low, pooled_high = proportion_ci(240, 600)
    assert low < pooled_low
    assert pooled_high < high
    assert high - low < 1.2 * (pooled_high - pooled_low)
    assert all(map(math.isnan, group_interval([15], [30])))


@pytest.mark.parametrize(("k", "exact"), [(0, 0), (30, 1)])
def test_the_group_interval_reaches_0_or_1_where_everybody_does(k: int, exact: int) -> None:
    limits = group_interval([k] * 5, [30] * 5)
    assert limits[exact] == exact
    # Five people who feel everything do not tell that a sixth does.
    assert 0.25 < abs(limits[1 - exact] - exact) < 0.4


@pytest.mark.slow
@fast
@given(st.lists(counts, min_size=2, max_size=8))
def test_the_group_interval_has_no_order_and_holds_the_proportions(cells: list[Any]) -> None:
    k, n = (list(column) for column in zip(*cells, strict=True))
    group = group_interval(k, n)
    assert group == group_interval(k[::-1], n[::-1])
    for p in (sum(k) / sum(n), np.mean(np.array(k) / np.array(n))):
        assert group[0] <= p + 1e-15
        assert p - 1e-15 <= group[1]
    missed = group_interval([b - a for a, b in zip(k, n, strict=True)], n)
    assert missed == pytest.approx((1 - group[1], 1 - group[0]), abs=1e-6)


@pytest.mark.parametrize(
    ("k", "n", "method", "name"),
    [
        (4, 3, "wilson", "detected"),
        (-1, 3, "wilson", "detected"),
        (1.5, 3, "wilson", "detected"),
        (math.nan, 3, "wilson", "detected"),
        (1, math.inf, "wilson", "presented"),
        (True, 3, "wilson", "detected"),
        ("1", 3, "wilson", "detected"),
        (None, 3, "wilson", "detected"),
        ([1, 2], [3, 4, 5], "wilson", "shape"),
        ([1, 9], [3, 3], "wilson", "presented"),
        (1, 2, "wald", "'wald'"),
        ([], [], "", "presented"),
        ([0], [0], "", "presented"),
        ([1, 0], [2, 0], "", "presented"),
        ([[1]], [[2]], "", "presented"),
        ([3, 1], [2, 2], "", "presented"),
    ],
)
def test_impossible_counts_and_methods_are_refused(k: Any, n: Any, method: str, name: str) -> None:
    with pytest.raises(ValueError, match=name):
        proportion_ci(k, n, method) if method else group_interval(k, n)


def test_a_mean_has_limits_by_students_t_unless_all_values_are_equal() -> None:
    values = pd.Series([0.1, 0.1, 0.3, 0.7, 0.2, 0.9])
    limits = mean_limits(values, [pd.Series([*"aabbcc"]), pd.Series([1, 1, 2, 2, np.nan, 2])])
    by_t = ttest_1samp([0.3, 0.7], 0).confidence_interval()
    assert limits.to_numpy()[0].tolist() == pytest.approx([0.1, np.nan, np.nan], nan_ok=True)
    assert limits.to_numpy()[1].tolist() == pytest.approx([0.5, *by_t])
    assert limits["low"].isna().tolist() == [True, False, True, True]


@pytest.mark.parametrize(
    ("table", "rel"),
    [
        ([[3, 9], [8, 2]], 1e-12),
        ([[0, 5], [5, 0]], 1e-12),
        ([[40, 35], [30, 45]], 1e-12),
        ([[6, 0], [9, 0]], 1e-12),
        ([[300_100, 299_900], [199_700, 200_300]], 2e-3),  # the normal distribution's tails
    ],
)
def test_tails_are_those_of_fishers_test(table: list[list[int]], rel: float) -> None:
    counts = np.array(table, dtype=float)
    expected = [fisher_exact(counts, alternative=tail).pvalue for tail in ("less", "greater")]
    margins = counts.sum(), counts[0].sum(), counts[:, 0].sum()
    tails = hypergeometric_tails(*(np.array([n]) for n in (counts[0, 0], *margins)))
    assert np.concatenate(tails) == pytest.approx(expected, rel=rel)


def test_equal_rates_are_tested_within_strata() -> None:
    alone = np.array([[21, 22], [219, 218]])
    assert equal_rates_p([(21, 22)], [(240, 240)]) == pytest.approx(fisher_exact(alone).pvalue)
    hits, shown = [(1, 6), (0, 5), (14, 19)], [(20, 20), (30, 30), (20, 20)]
    rng = np.random.default_rng(1)
    drawn = sum(
        rng.hypergeometric(a + b, of[0] + of[1] - a - b, of[0], 100_000)
        for (a, b), of in zip(hits, shown, strict=True)
    )
    number, times = np.unique(drawn, return_counts=True)
    rare = times[times <= times[number == 15]].sum() / 100_000
    assert equal_rates_p(hits, shown) == pytest.approx(rare, abs=0.001)
    many = np.array([[5000, 5200], [85_000, 84_800]])
    p = equal_rates_p([(5000, 5200)], [(90_000, 90_000)])
    assert p == pytest.approx(fisher_exact(many).pvalue, rel=0.02)
    assert equal_rates_p([(2, 0), (5, 5)], [(4, 0), (5, 5)]) == 1.0  # without information
