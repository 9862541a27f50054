"""Two-parameter probit fits: published values, laws, and tables that have none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.special import log_ndtr, ndtr

from analysis import probit_mle
from analysis.thresholds.probit import fit_lines, increasing_exists
from tests.test_analysis.shared import FLASH, PAPER, QUANTA, SPEED

# x, detected, presented; mu, sigma and deviance by statsmodels 0.14 and 40-digit arithmetic, which
# agree.
PUBLISHED: list[tuple[Any, list[int], Any, float, float, float]] = [
    (np.log(QUANTA["SH/R1"]), [0, 3, 12, 26, 35, 35], 35,
     4.874159236599045, 0.37444493924413164, 2.7810146983896575),
    (np.log(QUANTA["SS/R1"]), [0, 2, 9, 27, 47, 50], 50,
     4.415424322678962, 0.38695327096225235, 2.366426691834527),
    (np.log(QUANTA["MHP/R1"]), [3, 3, 12, 33, 44, 50], 50,
     4.766049454525097, 0.5261396242499573, 8.139545888880319),
    (FLASH, [0, 0, 0, 2, 2, 2, 2, 3, 4, 18], [3, 3, 5, 13, 10, 20, 14, 11, 5, 20],
     0.9458634718178631, 0.3384550465993306, 6.606213787201392),
    (SPEED, [15, 41, 88, 196, 265, 312, 338], 360,
     8.561165514905884, 4.361884745009525, 9.366203174465305),
    (SPEED, [40, 54, 118, 165, 257, 301, 334], 360,
     8.410582261709207, 5.307713589287506, 10.564642504510195),
]  # fmt: skip
tables = st.lists(st.integers(0, 30), min_size=5, max_size=5)


def rises(detected: list[int], presented: int = 30) -> bool:
    """Whether a table overlaps and its line goes up."""
    k, n, x = np.array([detected], float), np.full((1, 5), float(presented)), np.array([PAPER])
    u = (x - 60) / 140
    exists = bool(increasing_exists(u, k, n)[0] and increasing_exists(-u, k, n)[0])
    return exists and bool(fit_lines(u, k, n).slope[0] > 1e-3)


@pytest.mark.parametrize(("x", "detected", "presented", "mu", "sigma", "deviance"), PUBLISHED)
def test_the_fit_is_that_of_an_independent_implementation(
    x: Any, detected: list[int], presented: Any, mu: float, sigma: float, deviance: float
) -> None:
    fit = probit_mle(x, detected, np.broadcast_to(presented, len(detected)))
    assert (fit.mu, fit.sigma, fit.deviance) == pytest.approx((mu, sigma, deviance), rel=1e-11)


@pytest.mark.slow
@given(tables)
def test_the_score_is_zero_at_the_fit(detected: list[int]) -> None:
    assume(rises(detected))
    fit = probit_mle(PAPER, detected, [30] * 5)
    z = (np.array(PAPER) - fit.mu) / fit.sigma
    log_density = -z * z / 2 - math.log(2 * math.pi) / 2
    felt, missed = (np.exp(log_density - log_ndtr(side)) for side in (z, -z))
    score = np.array(detected) * felt - (30 - np.array(detected)) * missed
    assert score.sum() == pytest.approx(0, abs=1e-9)
    assert (score * z).sum() == pytest.approx(0, abs=1e-9 * (1 + np.abs(z).max()) ** 2)


@pytest.mark.slow
@given(tables, st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
def test_fits_shift_and_scale_with_the_axis(detected: list[int], shift: float, by: float) -> None:
    assume(rises(detected))
    here = probit_mle(PAPER, detected, [30] * 5)
    there = probit_mle(np.array(PAPER) * by + shift, detected, [30] * 5)
    size = by * (abs(here.mu) + here.sigma) + abs(shift)
    assert there.mu == pytest.approx(here.mu * by + shift, abs=1e-8 * size)
    assert there.sigma == pytest.approx(here.sigma * by, rel=1e-7)
    assert there.deviance == pytest.approx(here.deviance, abs=1e-8)


@pytest.mark.slow
@given(tables)
def test_a_mirrored_table_has_the_mirrored_fit(detected: list[int]) -> None:
    assume(rises(detected))
    here = probit_mle(PAPER, detected, [30] * 5)
    there = probit_mle([-x for x in PAPER], [30 - k for k in detected], [30] * 5)
    assert (-there.mu, there.sigma) == pytest.approx((here.mu, here.sigma), rel=1e-9)


@pytest.mark.slow
@given(tables, st.permutations(range(5)))
def test_order_empty_and_split_levels_change_nothing(detected: list[int], order: list[int]) -> None:
    assume(rises(detected))
    here = probit_mle(PAPER, detected, [30] * 5)
    mixed = [(PAPER[i], detected[i], 30) for i in order]
    split = [(x, part, 15) for x, k, _ in mixed for part in (min(k, 15), k - min(k, 15))]
    with_empty = [*split, (1e9, 0, 0)]
    assert probit_mle(*zip(*with_empty, strict=True)) == here


@pytest.mark.slow
def test_many_fits_are_the_single_ones() -> None:
    rng = np.random.default_rng(1)
    u = np.linspace(0, 1, 5)
    k = rng.binomial(30, ndtr((u - 0.4) / 0.3), (200, 5)).astype(float)
    x, n = np.broadcast_to(u, k.shape), np.full(k.shape, 30.0)
    together = fit_lines(x, k, n)
    alone = [fit_lines(x[i : i + 1], k[i : i + 1], n[i : i + 1]) for i in range(200)]
    assert together.slope == pytest.approx([one.slope[0] for one in alone], rel=1e-12)


def test_counts_of_a_billion_give_back_the_function_that_made_them() -> None:
    n = 10**9
    k = np.round(n * ndtr((np.log10(PAPER) - 2) / 0.1))
    fit = probit_mle(np.log10(PAPER), k, [n] * 5)
    assert (fit.mu, fit.sigma) == pytest.approx((2, 0.1), abs=1e-8)


def test_an_axis_that_begins_at_a_million_loses_only_the_digits_of_its_numbers() -> None:
    here, there = (probit_mle([s, s + 1, s + 2], [5, 20, 29], [30] * 3) for s in (0.0, 1e6))
    assert there.mu - 1e6 == pytest.approx(here.mu, abs=1e-9)
    assert there.deviance == pytest.approx(here.deviance, abs=1e-9)


@pytest.mark.parametrize(
    ("levels", "detected", "presented", "said"),
    [
        (PAPER, [30] * 5, [30] * 5, "must overlap"),
        (PAPER, [0] * 5, [30] * 5, "must overlap"),
        (PAPER, [0, 0, 0, 30, 30], [30] * 5, "must overlap"),
        (PAPER, [0, 0, 9, 30, 30], [30] * 5, "must overlap"),
        (PAPER, [15] * 5, [30] * 5, "must rise"),
        (PAPER, [27] * 5, [30] * 5, "must rise"),
        ([0.1, 0.2, 0.3], [26, 27, 26], [30] * 3, "must rise"),
        (list(map(str, PAPER)), [1, 2, 3, 4, 5], [30] * 5, "x must be finite numbers"),
        (PAPER, [29, 24, 15, 6, 1], [30] * 5, "must rise"),
        (PAPER, [30, 30, 15, 0, 0], [30] * 5, "must rise"),
        ([60, 60], [3, 4], [30] * 2, "at least two levels"),
        (PAPER, [1, 2, 3, 4, 5], [30, 0, 0, 0, 0], "at most presented"),
        (PAPER, [1, 0, 0, 0, 0], [30, 0, 0, 0, 0], "at least two levels"),
        (PAPER, [0] * 5, [0] * 5, "at least one stimulus"),
        (PAPER, [31, 0, 0, 0, 0], [30] * 5, "at most presented"),
        (PAPER, [-1, 0, 0, 0, 0], [30] * 5, "whole numbers"),
        (PAPER, [1.5, 0, 0, 0, 0], [30] * 5, "whole numbers"),
        (PAPER, [math.nan, 0, 0, 0, 0], [30] * 5, "whole numbers"),
        (PAPER, [True] * 5, [30] * 5, "whole numbers"),
        ([*PAPER[:4], math.nan], [1, 2, 3, 4, 5], [30] * 5, "x must be finite"),
        ([*PAPER[:4], math.inf], [1, 2, 3, 4, 5], [30] * 5, "x must be finite"),
        (PAPER[:4], [1, 2, 3, 4, 5], [30] * 5, "of one length"),
        ([PAPER], [[1, 2, 3, 4, 5]], [[30] * 5], "of one length"),
    ],
)
def test_tables_without_a_likeliest_increasing_function_are_refused(
    levels: Any, detected: Any, presented: Any, said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        probit_mle(levels, detected, presented)
