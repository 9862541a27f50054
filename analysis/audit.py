"""Whether a printed table of smallest, mean and largest proportions is arithmetically possible.

A printed number stands for an exact range, which depends on how it was shortened. A row is possible
if participants exist whose values give its three numbers. Formulas: docs/statistics.md, section 10.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

MAX_DECIMALS: Final = 12
MAX_TRIALS, MAX_TRIALS_RANGE, MAX_ROWS = 1_000_000, 1000, 100
HALF_UP, HALF_EVEN, TRUNCATED = "half up", "half even", "truncated"
READINGS: Final = {"rounded": (HALF_UP, HALF_EVEN), "truncated": (TRUNCATED,)}
"""Reading: the conventions that it allows, any one of which has to explain a whole row."""
_PROPORTION: Final = re.compile(rf"0|1|[01]?\.[0-9]{{1,{MAX_DECIMALS}}}", re.ASCII)
_TINY: Final = Fraction(1, 10**50)
"""Less than what lies between any two values that are compared: those of counts of a million people
with a million stimuli, and of `MAX_DECIMALS`. So far does a range end before an open end."""


@dataclass(frozen=True, slots=True)
class Range:
    """All numbers from one to another.

    >>> list(Range(Fraction(1, 4), Fraction(1, 2)).counts(10))
    [3, 4, 5]
    """

    low: Fraction
    high: Fraction

    def counts(self, trials: int) -> range:
        """Return the k for which k / trials is in the range."""
        return range(math.ceil(self.low * trials), math.floor(self.high * trials) + 1)

    def of_counts(self, trials: int) -> Range:
        """Return the part of the range from the first k / trials to the last."""
        k = self.counts(trials)
        return Range(Fraction(k.start, trials), Fraction(k.stop - 1, trials))


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """A proportion as it was printed, from 0 to 1; ValueError for any other text.

    >>> Printed(text="0.90").decimals, Printed(text="1").decimals
    (2, 0)
    """

    text: str

    def __post_init__(self) -> None:
        if not _PROPORTION.fullmatch(self.text) or Fraction(self.text) > 1:
            raise ValueError(
                f"a printed proportion must be a number from 0 to 1, got {self.text!r}"
            )

    @property
    def decimals(self) -> int:
        """The number of digits behind the point."""
        return len(self.text.partition(".")[2])

    def stands_for(self, convention: str, decimals: int | None = None) -> Range:
        """Return the proportions that are printed so.

        `decimals` are those shown, or more where zeros at the end were dropped.

        >>> truncated = Printed(text="0.9").stands_for(TRUNCATED, 2)
        >>> truncated.low == Fraction("0.9"), Fraction("0.9099") < truncated.high < Fraction("0.91")
        (True, True)
        """
        step = Fraction(1, 10 ** (self.decimals if decimals is None else decimals))
        low = Fraction(self.text) - (0 if convention == TRUNCATED else step / 2)
        high = low + step
        is_odd = Fraction(self.text) / step % 2 == 1
        if convention == HALF_EVEN and is_odd:
            low += _TINY
        if convention != HALF_EVEN or is_odd:
            high -= _TINY
        return Range(max(low, Fraction(0)), min(high, Fraction(1)))


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedRow:
    """A row of a printed table; the mean is unweighted over participants.

    `trials` is the smallest and the largest number of stimuli of a participant; it and the number
    of `participants` may be unknown.
    """

    label: str
    least: Printed
    mean: Printed
    largest: Printed
    trials: tuple[int, int] | None = None
    participants: int | None = None

    def __post_init__(self) -> None:
        low, high = self.trials or (1, 1)
        if not (1 <= low <= high <= MAX_TRIALS and high - low <= MAX_TRIALS_RANGE):
            raise ValueError(
                f"trials must be from 1 to {MAX_TRIALS}, smallest first and at most "
                f"{MAX_TRIALS_RANGE} apart, got {self.trials}"
            )
        if self.participants is not None and not 1 <= self.participants <= MAX_TRIALS:
            raise ValueError(
                f"participants must be from 1 to {MAX_TRIALS}, got {self.participants}"
            )


def audit_rows(rows: Sequence[PrintedRow]) -> dict[str, Any]:
    """Return which rows of a table are impossible, and why, as plain values.

    The least value is at most the mean, which is at most the largest. With P participants, one has
    the least and one the largest value, and all others lie between. With numbers of stimuli, values
    are k / n; with a single n the counts of all participants add up to the mean as well.

    Every number has the decimals of the most exact one, unless `possible_as_shown`.
    `exchange_fits` are the readings under which the means, in some order, are all possible.

    >>> def row(least, mean, largest):
    ...     texts = {"least": least, "mean": mean, "largest": largest}
    ...     printed = {name: Printed(text=text) for name, text in texts.items()}
    ...     return PrintedRow(label="95", **printed)
    >>> audit_rows([row("0.90", "0.87", "1.00")])["rows"][0]["readings"][0]["reasons"]
    ['the mean 0.87 is below the least value 0.90']
    >>> audit_rows([row("0.90", "0.93", "1.00")])["possible"]
    True
    """
    if not 1 <= len(rows) <= MAX_ROWS:
        raise ValueError(f"rows must hold from 1 to {MAX_ROWS} rows, got {len(rows)}")
    decimals = max(n.decimals for row in rows for n in (row.least, row.mean, row.largest))
    means = {row.mean.text: row.mean for row in rows}.values()
    audits: list[dict[str, Any]] = []
    for row in rows:
        verdicts = [_verdict(row, reading, decimals, means) for reading in READINGS]
        audits.append(
            {
                "label": row.label,
                "min": row.least.text,
                "mean": row.mean.text,
                "max": row.largest.text,
                "n": row.trials,
                "participants": row.participants,
                "possible": any(verdict["possible"] for verdict in verdicts),
                "possible_as_shown": [r for r in READINGS if not _reasons(row, r, None, row.mean)],
                "readings": verdicts,
            }
        )
    return {
        "schema": 1,
        "possible": all(audit["possible"] for audit in audits),
        "decimals": decimals,
        "readings": list(READINGS),
        "exchange_fits": [
            reading
            for i, reading in enumerate(READINGS)
            if _exchange_fits(rows, [audit["readings"][i]["fitting_means"] for audit in audits])
        ],
        "rows": audits,
    }


def attainable_means(least: Range, largest: Range, participants: int | None) -> Range | None:
    """Return the range of the mean: all but one at the least value, to all but one at the largest.

    It is None where the two values contradict each other. One of five at 0.45, none above 0.9:

    >>> least, largest = (Range(Fraction(x), Fraction(x)) for x in ("0.45", "0.9"))
    >>> float(attainable_means(least, largest, 5).high)
    0.81
    """
    means = Range(least.low, largest.high)
    if participants:
        rest = participants - 1
        means = Range(
            (rest * least.low + max(least.low, largest.low)) / participants,
            (min(least.high, largest.high) + rest * largest.high) / participants,
        )
    return means if means.low <= means.high else None


def counts_fit(
    least: Range, largest: Range, mean: Range, *, participants: int, trials: int
) -> bool:
    """Return whether whole counts give all three, where everybody had the same number of stimuli.

    The sums that P counts can have, one of them the least and one the largest, have no gap. The
    mean of two participants with 10 stimuli each is a multiple of 1/20:

    >>> half, whole, mean = (Range(Fraction(x), Fraction(x)) for x in ("0.5", "1", "0.7"))
    >>> counts_fit(half, whole, mean, participants=2, trials=10)
    False
    """
    low, high = least.of_counts(trials), largest.of_counts(trials)
    means = attainable_means(low, high, participants)
    if means is None or low.low > low.high or high.low > high.high:
        return False
    both = Range(max(mean.low, means.low), min(mean.high, means.high))
    return bool(both.counts(participants * trials))


def _faults(row: PrintedRow, convention: str, decimals: int | None, mean: Printed) -> Iterator[str]:
    """Yield what is impossible about a row with some mean."""
    least, shown, largest = (
        number.stands_for(convention, decimals) for number in (row.least, mean, row.largest)
    )
    low, high, trials, people = row.least.text, row.largest.text, row.trials, row.participants
    for name, text, values in (("least", low, least), ("largest", high, largest)):
        if trials and not _feasible_trials(values, trials):
            numbers = (
                f"{trials[0]}" if trials[0] == trials[1] else f"from {trials[0]} to {trials[1]}"
            )
            yield f"no number of stimuli {numbers} gives the {name} value {text}"
    means = attainable_means(least, largest, people)
    if least.low > largest.high:
        yield f"the least value {low} is above the largest {high}"
    elif shown.high < least.low:
        yield f"the mean {mean.text} is below the least value {low}"
    elif shown.low > largest.high:
        yield f"the mean {mean.text} is above the largest value {high}"
    elif means is None:
        yield f"one participant has one value, not {low} and {high}"
    elif shown.high < means.low or shown.low > means.high:
        yield (
            f"the mean {mean.text} is impossible for {people} participants with least {low} and "
            f"largest {high}: from {float(means.low):.4g} to {float(means.high):.4g}"
        )
    elif (
        people
        and trials
        and trials[0] == trials[1]
        and not counts_fit(least, largest, shown, participants=people, trials=trials[0])
    ):
        yield f"no counts of {people} participants with {trials[0]} stimuli each have that mean"


@lru_cache(maxsize=1024)
def _feasible_trials(values: Range, trials: tuple[int, int]) -> tuple[int, ...]:
    """Return the numbers of stimuli that give a value of a range."""
    return tuple(n for n in range(trials[0], trials[1] + 1) if values.counts(n))


def _reasons(row: PrintedRow, reading: str, decimals: int | None, mean: Printed) -> list[str]:
    """Return what is impossible about a row with some mean, under the best convention."""
    return min((list(_faults(row, name, decimals, mean)) for name in READINGS[reading]), key=len)


def _verdict(
    row: PrintedRow, reading: str, decimals: int, means: Iterable[Printed]
) -> dict[str, Any]:
    """Return the verdict of one reading on a row; it is possible without a reason against it.

    `mean_low` and `mean_high` bound the exact mean, `least_trials` and `largest_trials` are the
    numbers of stimuli that give the least and the largest value, and `fitting_means` the printed
    means of the table that would be possible in this row.
    """
    ends = [
        [number.stands_for(convention, decimals) for convention in READINGS[reading]]
        for number in (row.least, row.largest)
    ]
    ranges = [attainable_means(a, b, row.participants) for a, b in zip(*ends, strict=True)]
    least_trials, largest_trials = (
        sorted({n for values in end for n in _feasible_trials(values, row.trials)})
        if row.trials
        else None
        for end in ends
    )
    reasons = _reasons(row, reading, decimals, row.mean)
    return {
        "reading": reading,
        "reasons": reasons,
        "mean_low": min((float(means.low) for means in ranges if means), default=None),
        "mean_high": max((float(means.high) for means in ranges if means), default=None),
        "least_trials": least_trials,
        "largest_trials": largest_trials,
        "fitting_means": sorted(
            mean.text for mean in means if not _reasons(row, reading, decimals, mean)
        ),
        "possible": not reasons,
    }


def _exchange_fits(rows: Sequence[PrintedRow], fitting_means: Sequence[list[str]]) -> bool:
    """Return whether each row can have a mean of its own, in some order."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import maximum_bipartite_matching

    fits = [[row.mean.text in means for row in rows] for means in fitting_means]
    return bool((maximum_bipartite_matching(csr_matrix(fits)) >= 0).all())
