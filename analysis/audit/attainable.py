"""Which means go with a printed least and largest value: of proportions, and of whole counts."""

from __future__ import annotations

from fractions import Fraction

from analysis.audit.printed import Range


def attainable(least: Range, largest: Range, participants: int | None) -> Range | None:
    """Return what the mean may be: all but one at the least value, to all but one at the largest.

    `participants` may be ``None`` for any number; so is the mean of a single participant who would
    need two values.

    With one of five at 0.45 and none above 0.9:

    >>> one, other = (Range(low=Fraction(x), high=Fraction(x)) for x in ("0.45", "0.9"))
    >>> float(attainable(one, other, 5).high)
    0.81
    """
    low_end = _larger_low(least, largest)
    high_end = _smaller_high(least, largest)
    if participants is None:
        return Range(
            low=least.low,
            high=largest.high,
            with_low=least.with_low,
            with_high=largest.with_high,
        )
    if participants == 1:
        if not least.meets(largest):
            return None
        (low, with_low), (high, with_high) = low_end, high_end
        return Range(low=low, high=high, with_low=with_low, with_high=with_high)
    others = participants - 1
    return Range(
        low=(others * least.low + low_end[0]) / participants,
        high=(high_end[0] + others * largest.high) / participants,
        with_low=least.with_low and low_end[1],
        with_high=largest.with_high and high_end[1],
    )


def _larger_low(one: Range, other: Range) -> tuple[Fraction, bool]:
    """Return the larger of two lower ends, and whether it belongs to its range."""
    if one.low == other.low:
        return one.low, one.with_low and other.with_low
    return max((one.low, one.with_low), (other.low, other.with_low))


def _smaller_high(one: Range, other: Range) -> tuple[Fraction, bool]:
    if one.high == other.high:
        return one.high, one.with_high and other.with_high
    return min((one.high, one.with_high), (other.high, other.with_high))


def counts_fit(
    least: Range, largest: Range, mean: Range, *, participants: int, trials: int
) -> bool:
    """Tell whether whole counts give all three, where everybody had the same number of stimuli.

    The sums that P counts can have, one of them the least and one the largest, have no gap.

    The mean of two participants with 10 stimuli each is a multiple of 1/20:

    >>> half, whole, mean = (Range(low=Fraction(x), high=Fraction(x)) for x in ("0.5", "1", "0.7"))
    >>> counts_fit(half, whole, mean, participants=2, trials=10)
    False
    """
    some, most = least.counts(trials), largest.counts(trials)
    if not some or not most or some[0] > most[-1]:
        return False
    if participants == 1:
        shared = range(max(some[0], most[0]), min(some[-1], most[-1]) + 1)
        return any(mean.holds(Fraction(k, trials)) for k in shared)
    fewest_sum = (participants - 1) * some[0] + max(most[0], some[0])
    largest_sum = min(some[-1], most[-1]) + (participants - 1) * most[-1]
    sums = mean.counts(trials * participants)
    return bool(sums) and sums[0] <= largest_sum and fewest_sum <= sums[-1]
