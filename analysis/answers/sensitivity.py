"""What counts alone tell of choices: shares, sensitivity d', criterion and a preference of side."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable


_SLACK = 1e-9
"""Probabilities that differ by less than this fraction are equal but for rounding."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """How many of how many.

    Attributes
    ----------
    count, of : int
        0 <= count <= of.
    p : float or None
        count / of; ``None`` of nothing.

    Examples
    --------
    >>> Share(count=1, of=4).p, Share(count=0, of=0).p
    (0.25, None)
    """

    count: int
    of: int
    p: float | None = field(init=False)

    def __post_init__(self) -> None:
        for name in ("count", "of"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 0:
                raise ValueError(f"{name} must be a whole number of at least 0, got {value!r}")
        if self.count > self.of:
            raise ValueError(f"count must be at most of = {self.of}, got {self.count}")
        object.__setattr__(self, "p", self.count / self.of if self.of else None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """Signal detection: how well two kinds of trials are told apart.

    Attributes
    ----------
    hits, false_alarms : Share
        "Yes" to what is there, and to what is not.
    d_prime, criterion : float or None
        Of a group the unweighted means over `participants`, not values of the pooled counts.
    participants : int
        How many have a d'.
    reason : str
        Why there is no value; else empty.
    """

    hits: Share
    false_alarms: Share
    d_prime: float | None
    criterion: float | None
    participants: int
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SidePreference:
    """Left against right where nothing should prefer one.

    Attributes
    ----------
    left, right : int
        How often it was left and right.
    expected_left : float or None
        Share of left without a preference.
    p : float or None
        Exact two-sided binomial probability; of a group it ignores that participants differ.
    reason : str
        Why there is no probability; else empty.
    """

    left: int
    right: int
    expected_left: float | None
    p: float | None
    reason: str


def detection_sensitivity(hits: Share, false_alarms: Share, reason: str = "") -> Sensitivity:
    """Return d' = z(H) - z(F) and the criterion -(z(H) + z(F)) / 2 of a yes-no task.

    H = (h + 1/2) / (N1 + 1) and F = (f + 1/2) / (N0 + 1), the log-linear correction (M. J. Hautus,
    Behav. Res. Methods 27 (1995) 46-51). Formulas: docs/statistics.md, section 11.

    Of felt single stimuli and felt blank trials; `reason` says why there is no value although
    trials exist.

    Who answers "felt" to everything is not sensitive, only willing:

    >>> found = detection_sensitivity(Share(count=20, of=20), Share(count=20, of=20))
    >>> found.d_prime, found.criterion < 0
    (0.0, True)
    """
    if not hits.of:
        reason = reason or "no single stimulus counts"
    if not false_alarms.of:
        reason = reason or "no blank trial counts"
    return _sensitivity(hits, false_alarms, 1.0, reason)


def spatial_sensitivity(hits: Share, false_alarms: Share) -> Sensitivity:
    """Return d' = (z(H) - z(F)) / sqrt 2 of left against right, and the criterion.

    Of answers "left" among the left or right answers to left stimuli, and to right ones. A
    criterion above 0 prefers "right".

    >>> one = spatial_sensitivity(Share(count=9, of=10), Share(count=1, of=10))
    >>> one.criterion, one.d_prime > 1
    (0.0, True)
    """
    one_sided = not (hits.of and false_alarms.of)
    reason = "no left or right answer to the stimuli of a side" if one_sided else ""
    return _sensitivity(hits, false_alarms, math.sqrt(2), reason)


def _sensitivity(hits: Share, false_alarms: Share, scale: float, reason: str) -> Sensitivity:
    if reason:
        d_prime = criterion = None
    else:
        z_hit, z_false = _z(hits), _z(false_alarms)
        d_prime, criterion = (z_hit - z_false) / scale, 0.0 - (z_hit + z_false) / 2
    return Sensitivity(
        hits=hits,
        false_alarms=false_alarms,
        d_prime=d_prime,
        criterion=criterion,
        participants=0 if reason else 1,
        reason=reason,
    )


def _z(share: Share) -> float:
    """Return the normal quantile of a corrected share; exactly opposite for its complement."""
    from scipy.special import ndtri

    missed = share.of - share.count
    z = float(ndtri((min(share.count, missed) + 0.5) / (share.of + 1)))
    return z if share.count <= missed else -z


def mean_sensitivity(each: tuple[Sensitivity, ...]) -> Sensitivity:
    """Return summed counts and the means over the participants who have a value.

    >>> alike = detection_sensitivity(Share(count=5, of=9), Share(count=1, of=9))
    >>> mean_sensitivity((alike, alike)).d_prime == alike.d_prime
    True
    """
    if not each:
        raise ValueError("each must hold at least one participant, got none")
    d_primes = [one.d_prime for one in each if one.d_prime is not None]
    criteria = [one.criterion for one in each if one.criterion is not None]
    number = len(d_primes)
    return Sensitivity(
        hits=total_share(one.hits for one in each),
        false_alarms=total_share(one.false_alarms for one in each),
        d_prime=math.fsum(d_primes) / number if number else None,
        criterion=math.fsum(criteria) / number if number else None,
        participants=number,
        reason="" if number else min(one.reason for one in each),
    )


def total_share(shares: Iterable[Share]) -> Share:
    """Add up counts.

    >>> total_share([Share(count=1, of=2), Share(count=0, of=2)]).p
    0.25
    """
    every = tuple(shares)
    return Share(count=sum(one.count for one in every), of=sum(one.of for one in every))


def side_preference(
    left: int, right: int, *, odds: tuple[int, int] = (1, 1), of: str
) -> SidePreference:
    """Test left against right.

    `odds` are left to right without a preference; `of` is what is counted, for the reason where
    there is none of it.

    >>> side_preference(9, 1, of="answers").p
    0.021484375
    >>> side_preference(0, 0, of="answers").reason
    'no answers'
    """
    reason = "" if left + right else f"no {of}"
    if not all(odds):
        reason = "stimuli at one side only"
    return SidePreference(
        left=left,
        right=right,
        expected_left=odds[0] / sum(odds) if all(odds) else None,
        p=None if reason else binomial_p(left, right, odds),
        reason=reason,
    )


def binomial_p(left: int, right: int, odds: tuple[int, int] = (1, 1)) -> float:
    """Return the exact two-sided binomial probability of a split.

    The sum of the probabilities of all splits that are not more likely than this one.

    Raises ValueError for counts below 0 and odds that are not above 0.

    >>> binomial_p(5, 5), binomial_p(0, 5)
    (1.0, 0.0625)
    """
    from scipy.special import gammaln

    if min(left, right) < 0 or min(odds) <= 0:
        told = f"got {left} and {right} at odds {odds}"
        raise ValueError(f"left and right must be at least 0, and odds above 0, {told}")
    lefts = np.arange(left + right + 1)
    rights = lefts[::-1]
    log_odds = (math.log(odds[0] / sum(odds)), math.log(odds[1] / sum(odds)))
    ways = gammaln(left + right + 1) - (gammaln(lefts + 1) + gammaln(rights + 1))
    logs = ways + (lefts * log_odds[0] + rights * log_odds[1])
    unlikely = np.exp(logs[logs <= logs[left] + _SLACK])
    # Sorted by fsum's exactness: exchanging the sides gives the same last digit.
    return min(1.0, _tidy(math.fsum(unlikely)))


def _tidy(p: float) -> float:
    """Round off what the logarithms of factorials leave in the last digits."""
    return float(f"{p:.11g}")
