"""Two-parameter probit fits: published values, laws, and tables that have none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.special import log_ndtr

from analysis import probit_mle
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
]  # fmt: skip # rows of a table
tables = st.lists(st.integers(0, 30), min_size=5, max_size=5)


@pytest.mark.parametrize(("x", "detected", "presented", "mu", "sigma", "deviance"), PUBLISHED)
def test_the_fit_is_that_of_an_independent_implementation(
    x: Any, detected: list[int], presented: Any, mu: float, sigma: float, deviance: float
) -> None:
    fit = probit_mle(x, detected, np.broadcast_to(presented, len(detected)))
    assert (fit.mu, fit.sigma, fit.deviance) == pytest.approx((mu, sigma, deviance), rel=1e-11)


def fit_or_skip(detected: list[int]) -> Any:
    try:
        fit = probit_mle(PAPER, detected, [30] * 5)
    except ValueError:  # no likeliest function, or one that falls
        assume(condition=False)
    assume(fit.sigma < 1e5)
    return fit


@pytest.mark.slow
@given(tables)
def test_the_score_is_zero_at_the_fit(detected: list[int]) -> None:
    fit = fit_or_skip(detected)
    z = (np.array(PAPER) - fit.mu) / fit.sigma
    log_density = -z * z / 2 - math.log(2 * math.pi) / 2
    felt, missed = (np.exp(log_density - log_ndtr(side)) for side in (z, -z))
    score = np.array(detected) * felt - (30 - np.array(detected)) * missed
    assert score.sum() == pytest.approx(0, abs=1e-9)
    assert (score * z).sum() == pytest.approx(0, abs=1e-9 * (1 + np.abs(z).max()) ** 2)


@pytest.mark.slow
@given(tables, st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.permutations(range(5)))
def test_fits_shift_scale_and_mirror_with_the_axis(
    detected: list[int], shift: float, by: float, order: list[int]
) -> None:
    here = fit_or_skip(detected)
    there = probit_mle(np.array(PAPER) * by + shift, detected, [30] * 5)
    size = by * (abs(here.mu) + here.sigma) + abs(shift)
    assert there.mu == pytest.approx(here.mu * by + shift, abs=1e-8 * size)
    assert there.sigma == pytest.approx(here.sigma * by, rel=1e-7)
    assert there.deviance == pytest.approx(here.deviance, abs=1e-8)
    mirrored = probit_mle([-x for x in PAPER], [30 - k for k in detected], [30] * 5)
    assert (-mirrored.mu, mirrored.sigma) == pytest.approx((here.mu, here.sigma), rel=1e-9)
    split = [
        (PAPER[i], part, 15)
        for i in order
        for part in (min(detected[i], 15), max(detected[i] - 15, 0))
    ]
    assert probit_mle(*zip(*split, (1e9, 0, 0), strict=True)) == here


@pytest.mark.parametrize(
    ("levels", "detected", "presented", "name"),
    [
        *((PAPER, k, [30] * 5, "detected") for k in (
            [30] * 5, [0] * 5, [0, 0, 0, 30, 30], [0, 0, 9, 30, 30], [15] * 5, [27] * 5,
            [29, 24, 15, 6, 1], [30, 30, 15, 0, 0], [31, 0, 0, 0, 0], [-1, 0, 0, 0, 0],
            [1.5, 0, 0, 0, 0], [math.nan, 0, 0, 0, 0], [True] * 5,
        )),
        ([0.1, 0.2, 0.3], [26, 27, 26], [30] * 3, "detected"),
        (PAPER, [1, 2, 3, 4, 5], [30, 0, 0, 0, 0], "presented"),
        (PAPER, [1, 0, 0, 0, 0], [30, 0, 0, 0, 0], "two"),
        ([60, 60], [3, 4], [30] * 2, "two"),
        (PAPER, [0] * 5, [0] * 5, "presented"),
        *((x, [1, 2, 3, 4, 5], [30] * 5, "x") for x in (
            [*map(str, PAPER)], [*PAPER[:4], math.nan], [*PAPER[:4], math.inf], PAPER[:4],
        )),
        ([PAPER], [[1, 2, 3, 4, 5]], [[30] * 5], "x"),
    ],
)  # fmt: skip # rows of a table
def test_tables_without_a_likeliest_increasing_function_are_refused(
    levels: Any, detected: Any, presented: Any, name: str
) -> None:
    with pytest.raises(ValueError, match=name):
        probit_mle(levels, detected, presented)
