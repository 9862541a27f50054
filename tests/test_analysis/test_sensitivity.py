"""Shares, d', criterion and preferences of side: known values and mirror laws."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from analysis.answers.sensitivity import (
    Share,
    binomial_p,
    detection_sensitivity,
    mean_sensitivity,
    side_preference,
    spatial_sensitivity,
)


def share(count: int, of: int) -> Share:
    return Share(count=count, of=of)


shares = st.integers(1, 60).flatmap(lambda of: st.integers(0, of).map(lambda k: share(k, of)))


@pytest.mark.parametrize(
    ("hits", "false", "d_prime", "criterion"),
    [
        # Participants 1, 2 and 25 of M. Grund et al., J. Neurosci. 42 (2022) 643-656.
        (share(91, 397), share(1, 200), 1.695006918098493, 1.5866813322403461),
        (share(171, 397), share(0, 199), 2.6329619811422074, 1.4905527777727006),
        (share(232, 399), share(67, 199), 0.6243880687566047, 0.10710171866309363),
    ],
)
def test_published_counts(hits: Share, false: Share, d_prime: float, criterion: float) -> None:
    found = detection_sensitivity(hits, false)
    assert (found.d_prime, found.criterion) == pytest.approx((d_prime, criterion), abs=1e-12)


@pytest.mark.slow
@given(shares, shares)
def test_laws_of_sensitivity(hits: Share, others: Share) -> None:
    found = detection_sensitivity(hits, others)
    missed, refused = (share(one.of - one.count, one.of) for one in (hits, others))
    turned = detection_sensitivity(refused, missed)  # who says no for yes turns the criterion only
    assert found.criterion is not None
    assert (turned.d_prime, turned.criterion) == (found.d_prime, -found.criterion)
    narrow = spatial_sensitivity(hits, others)
    assert found.d_prime is not None
    assert narrow.d_prime == pytest.approx(found.d_prime / math.sqrt(2), abs=1e-15)


def test_what_the_data_do_not_tell_has_a_reason_and_no_value() -> None:
    unknown = detection_sensitivity(share(9, 10), share(0, 0))
    assert (unknown.d_prime, unknown.criterion, unknown.participants) == (None, None, 0)
    assert unknown.reason
    forced = detection_sensitivity(share(9, 10), share(10, 10), reason="why")
    assert (forced.d_prime, forced.reason) == (None, "why")
    assert spatial_sensitivity(share(9, 10), share(0, 0)).d_prime is None
    none = side_preference(0, 0, of="answer")
    assert (none.p, bool(none.reason), none.expected_left) == (None, True, 0.5)
    one_sided = side_preference(3, 0, odds=(0, 9), of="answer")
    assert (one_sided.p, one_sided.expected_left, bool(one_sided.reason)) == (None, None, True)


def test_the_group_is_the_mean_of_those_who_have_a_value() -> None:
    none, one, other = (
        detection_sensitivity(share(*hits), share(*false))
        for hits, false in (((5, 10), (0, 0)), ((9, 10), (1, 10)), ((5, 10), (2, 10)))
    )
    found = mean_sensitivity((none, one, other))
    assert one.d_prime is not None
    assert other.d_prime is not None
    assert found.d_prime == (one.d_prime + other.d_prime) / 2
    assert (found.participants, found.hits) == (2, share(19, 30))
    nobody = mean_sensitivity((none, none))
    assert (nobody.d_prime, nobody.reason) == (None, none.reason)
    with pytest.raises(ValueError, match="participant"):
        mean_sensitivity(())


@pytest.mark.slow
@given(st.integers(0, 3000), st.integers(0, 80), st.integers(1, 99), st.integers(1, 9))
def test_the_binomial_p_is_that_of_scipy_and_has_no_side(
    left: int, right: int, a: int, b: int
) -> None:
    p = binomial_p(left, right, (a, b))
    assert p == binomial_p(right, left, (b, a))
    expected = binomtest(left, left + right, a / (a + b)).pvalue if left + right else 1
    assert p == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("count", "of"), [(-1, 2), (3, 2), (True, 2), (1.0, 2), (1, math.inf), (None, 2)]
)
def test_impossible_counts_are_refused(count: Any, of: Any) -> None:
    with pytest.raises(ValueError, match=r"count|of"):
        Share(count=count, of=of)
    for left, right, odds in ((-1, 2, (1, 1)), (1, 2, (0, 1))):
        with pytest.raises(ValueError, match="left"):
            binomial_p(left, right, odds)
