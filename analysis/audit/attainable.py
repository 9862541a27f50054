"""Which means go with a printed least and largest value: of proportions, and of whole counts."""

from __future__ import annotations

from analysis.audit.printed import Range


def attainable(least: Range, largest: Range, participants: int | None) -> Range | None:
    """Return what the mean may be: all but one at the least value, to all but one at the largest.

    `participants` may be ``None`` for any number. Where the two values contradict each other there
    is no mean.

    With one of five at 0.45 and none above 0.9:

    >>> from fractions import Fraction
    >>> one, other = (Range(Fraction(x), Fraction(x)) for x in ("0.45", "0.9"))
    >>> float(attainable(one, other, 5).high)
    0.81
    """
    found = Range(least.low, largest.high)
    if participants:
        others = participants - 1
        found = Range(
            (others * least.low + max(least.low, largest.low)) / participants,
            (min(least.high, largest.high) + others * largest.high) / participants,
        )
    return found if found.low <= found.high else None


def counts_fit(
    least: Range, largest: Range, mean: Range, *, participants: int, trials: int
) -> bool:
    """Tell whether whole counts give all three, where everybody had the same number of stimuli.

    The sums that P counts can have, one of them the least and one the largest, have no gap.

    The mean of two participants with 10 stimuli each is a multiple of 1/20:

    >>> from fractions import Fraction
    >>> half, whole, mean = (Range(Fraction(x), Fraction(x)) for x in ("0.5", "1", "0.7"))
    >>> counts_fit(half, whole, mean, participants=2, trials=10)
    False
    """
    some, most = (one.of_counts(trials) for one in (least, largest))
    means = attainable(some, most, participants)
    if means is None or some.low > some.high or most.low > most.high:
        return False
    both = Range(max(mean.low, means.low), min(mean.high, means.high))
    return bool(both.counts(participants * trials))
