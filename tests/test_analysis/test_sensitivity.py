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
def test_saying_no_for_yes_turns_the_criterion_only(hits: Share, false_alarms: Share) -> None:
    found = detection_sensitivity(hits, false_alarms)
    missed, refused = (share(one.of - one.count, one.of) for one in (hits, false_alarms))
    turned = detection_sensitivity(refused, missed)
    assert turned.d_prime == found.d_prime
    assert found.criterion is not None
    assert turned.criterion == -found.criterion


@pytest.mark.slow
@given(shares, shares)
def test_spatial_sensitivity_is_smaller_by_the_root_of_two(hits: Share, others: Share) -> None:
    wide, narrow = detection_sensitivity(hits, others), spatial_sensitivity(hits, others)
    assert wide.d_prime is not None
    assert narrow.d_prime == pytest.approx(wide.d_prime / math.sqrt(2), abs=1e-15)


def test_what_the_data_do_not_tell_is_not_given_but_its_reason() -> None:
    unknown = detection_sensitivity(share(9, 10), share(0, 0))
    assert (unknown.d_prime, unknown.criterion, unknown.participants) == (None, None, 0)
    assert unknown.reason == "no blank trial counts"
    forced = detection_sensitivity(share(9, 10), share(10, 10), reason='"none" was not offered')
    assert (forced.d_prime, forced.reason) == (None, '"none" was not offered')
    assert spatial_sensitivity(share(9, 10), share(0, 0)).d_prime is None


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
    with pytest.raises(ValueError, match="at least one participant"):
        mean_sensitivity(())


@pytest.mark.slow
@given(st.integers(0, 80), st.integers(0, 80), st.integers(1, 9), st.integers(1, 9))
def test_the_binomial_p_is_that_of_scipy(left: int, right: int, a: int, b: int) -> None:
    if left + right == 0:
        assert binomial_p(left, right, (a, b)) == 1
        return
    expected = binomtest(left, left + right, a / (a + b)).pvalue
    assert binomial_p(left, right, (a, b)) == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
@given(st.integers(0, 3000), st.integers(0, 3000), st.integers(1, 99), st.integers(1, 99))
def test_the_binomial_p_has_no_side(left: int, right: int, a: int, b: int) -> None:
    p = binomial_p(left, right, (a, b))
    assert p == binomial_p(right, left, (b, a))
    assert 0 <= p <= 1


def test_a_preference_needs_answers_and_both_sides() -> None:
    none = side_preference(0, 0, of="answer")
    assert (none.p, none.reason, none.expected_left) == (None, "no answer", 0.5)
    one_sided = side_preference(3, 0, odds=(0, 9), of="answer")
    assert (one_sided.p, one_sided.expected_left) == (None, None)
    assert one_sided.reason == "stimuli at one side only"


@pytest.mark.parametrize(
    ("count", "of"), [(-1, 2), (3, 2), (True, 2), (1.0, 2), (1, math.inf), (None, 2)]
)
def test_other_counts_are_refused(count: Any, of: Any) -> None:
    with pytest.raises(ValueError, match="must be"):
        Share(count=count, of=of)


@pytest.mark.parametrize(("left", "right", "odds"), [(-1, 2, (1, 1)), (1, 2, (0, 1))])
def test_other_splits_are_refused(left: int, right: int, odds: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="left and right must"):
        binomial_p(left, right, odds)
