"""Check whether a printed table of smallest, mean and largest proportions is possible.

A printed number represents an exact range, which depends on how it was rounded. A row is possible
if participants exist whose values give its three numbers. Formulas: docs/statistics.md, section 10.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Final

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

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


def _check_proportion(text: str) -> str:
    if not _PROPORTION.fullmatch(text) or Fraction(text) > 1:
        raise ValueError("a printed proportion must be a number from 0 to 1")
    return text


def _none_if_missing(text: str | None) -> str | None:
    return None if text in ("", "n/a") else text


def _split_range(text: str | None) -> tuple[str, str] | None:
    if text in (None, "", "n/a"):
        return None
    low, dash, high = text.partition("-")
    return low, high if dash else low


def _check_range(ends: tuple[int, int] | None) -> tuple[int, int] | None:
    if ends and not 0 <= ends[1] - ends[0] <= MAX_TRIALS_RANGE:
        raise ValueError(
            f"a range has its smallest number first and is at most {MAX_TRIALS_RANGE} wide"
        )
    return ends


Proportion = Annotated[str, AfterValidator(_check_proportion)]
Number = Annotated[int, Field(ge=1, le=MAX_TRIALS)]


class PrintedRow(BaseModel):
    """A row of a printed table; the mean is unweighted over participants.

    ``n`` is the smallest and the largest number of stimuli of a participant; it and the number of
    ``participants`` may be unknown.

    >>> PrintedRow(label="60", min="0.45", mean="0.86", max="0.9", n="20-40").n
    (20, 40)
    """

    model_config = ConfigDict(frozen=True, extra="forbid", str_strip_whitespace=True)

    label: str = Field(min_length=1, max_length=64)
    min: Proportion
    mean: Proportion
    max: Proportion
    n: Annotated[
        tuple[Number, Number] | None, BeforeValidator(_split_range), AfterValidator(_check_range)
    ] = None
    participants: Annotated[Number | None, BeforeValidator(_none_if_missing)] = None


@dataclass(frozen=True, slots=True)
class Range:
    """All numbers from one to another.

    >>> list(Range(Fraction(1, 4), Fraction(1, 2)).counts(10))
    [3, 4, 5]
    """

    low: Fraction
    high: Fraction

    @property
    def is_empty(self) -> bool:
        """Whether no number is in the range."""
        return self.low > self.high

    def counts(self, trials: int) -> range:
        """Return the k for which k / trials is in the range."""
        return range(math.ceil(self.low * trials), math.floor(self.high * trials) + 1)

    def of_counts(self, trials: int) -> Range:
        """Return the part of the range from the first k / trials to the last."""
        k = self.counts(trials)
        return Range(Fraction(k.start, trials), Fraction(k.stop - 1, trials))


def decimals_of(text: str) -> int:
    """Return the number of digits behind the point.

    >>> decimals_of("0.90"), decimals_of("1")
    (2, 0)
    """
    return len(text.partition(".")[2])


def proportions_of(text: str, convention: str, decimals: int | None = None) -> Range:
    """Return the proportions that are printed so.

    `decimals` are those shown, or more where zeros at the end were dropped.

    >>> truncated = proportions_of("0.9", TRUNCATED, 2)
    >>> truncated.low == Fraction("0.9"), Fraction("0.9099") < truncated.high < Fraction("0.91")
    (True, True)
    """
    step = Fraction(1, 10 ** (decimals_of(text) if decimals is None else decimals))
    low = Fraction(text) - (0 if convention == TRUNCATED else step / 2)
    high = low + step
    is_odd = Fraction(text) / step % 2 == 1
    if convention == HALF_EVEN and is_odd:
        low += _TINY
    if convention != HALF_EVEN or is_odd:
        high -= _TINY
    return Range(max(low, Fraction(0)), min(high, Fraction(1)))


def audit_rows(rows: Sequence[PrintedRow]) -> dict[str, Any]:
    """Return which rows of a table are impossible, and why, as plain values.

    The least value is at most the mean, which is at most the largest. With P participants, one has
    the least and one the largest value, and all others lie between. With numbers of stimuli, values
    are k / n; with a single n the counts of all participants add up to the mean as well.

    Every number has the decimals of the most exact one, unless `possible_as_shown`.
    `exchange_fits` are the readings under which the means, in some order, are all possible.

    >>> def row(**texts):
    ...     return PrintedRow(label="95", **texts)
    >>> audit_rows([row(min="0.90", mean="0.87", max="1.00")])["rows"][0]["readings"][0]["reasons"]
    ['the mean 0.87 is below the least value 0.90']
    >>> audit_rows([row(min="0.90", mean="0.93", max="1.00")])["possible"]
    True
    """
    if not 1 <= len(rows) <= MAX_ROWS:
        raise ValueError(f"rows must hold from 1 to {MAX_ROWS} rows, got {len(rows)}")
    decimals = max(decimals_of(text) for row in rows for text in (row.min, row.mean, row.max))
    means = sorted({row.mean for row in rows})
    audits: list[dict[str, Any]] = []
    for row in rows:
        verdicts = [_verdict(row, reading, decimals, means) for reading in READINGS]
        audits.append(
            {
                **row.model_dump(),
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


def attainable_means(least: Range, largest: Range, participants: int | None) -> Range:
    """Return the range of the mean: all but one at the least value, to all but one at the largest.

    It is empty where the two values contradict each other. One of five at 0.45, none above 0.9:

    >>> least, largest = (Range(Fraction(x), Fraction(x)) for x in ("0.45", "0.9"))
    >>> float(attainable_means(least, largest, 5).high)
    0.81
    """
    if not participants:
        return Range(least.low, largest.high)
    rest = participants - 1
    return Range(
        (rest * least.low + max(least.low, largest.low)) / participants,
        (min(least.high, largest.high) + rest * largest.high) / participants,
    )


def counts_fit(least: Range, largest: Range, mean: Range, participants: int, trials: int) -> bool:
    """Return whether whole counts give all three, where everybody had the same number of stimuli.

    The sums that P counts can have, one of them the least and one the largest, have no gap. The
    mean of two participants with 10 stimuli each is a multiple of 1/20:

    >>> half, whole, mean = (Range(Fraction(x), Fraction(x)) for x in ("0.5", "1", "0.7"))
    >>> counts_fit(half, whole, mean, 2, 10)
    False
    """
    low, high = least.of_counts(trials), largest.of_counts(trials)
    means = attainable_means(low, high, participants)
    if low.is_empty or high.is_empty or means.is_empty:
        return False
    both = Range(max(mean.low, means.low), min(mean.high, means.high))
    return bool(both.counts(participants * trials))


def _faults(row: PrintedRow, convention: str, decimals: int | None, mean: str) -> Iterator[str]:
    """Yield what is impossible about a row with some mean."""
    least, shown, largest = (
        proportions_of(text, convention, decimals) for text in (row.min, mean, row.max)
    )
    low, high, people = row.min, row.max, row.participants
    for name, text, values in (("least", low, least), ("largest", high, largest)):
        if row.n and not _feasible_trials(values, row.n):
            numbers = " to ".join(map(str, dict.fromkeys(row.n)))
            yield f"no number of stimuli ({numbers}) gives the {name} value {text}"
    means = attainable_means(least, largest, people)
    trials = row.n[0] if row.n and row.n[0] == row.n[1] else 0
    if least.low > largest.high:
        yield f"the least value {low} is above the largest {high}"
    elif shown.high < least.low:
        yield f"the mean {mean} is below the least value {low}"
    elif shown.low > largest.high:
        yield f"the mean {mean} is above the largest value {high}"
    elif means.is_empty:
        yield f"one participant has one value, not {low} and {high}"
    elif shown.high < means.low or shown.low > means.high:
        yield (
            f"the mean {mean} is impossible for {people} participants with least {low} and "
            f"largest {high}: from {float(means.low):.4g} to {float(means.high):.4g}"
        )
    elif people and trials and not counts_fit(least, largest, shown, people, trials):
        yield f"no counts of {people} participants with {trials} stimuli each have that mean"


@lru_cache(maxsize=1024)
def _feasible_trials(values: Range, trials: tuple[int, int]) -> tuple[int, ...]:
    """Return the numbers of stimuli that give a value of a range."""
    return tuple(n for n in range(trials[0], trials[1] + 1) if values.counts(n))


def _reasons(row: PrintedRow, reading: str, decimals: int | None, mean: str) -> list[str]:
    """Return what is impossible about a row with some mean, under the best convention."""
    return min((list(_faults(row, name, decimals, mean)) for name in READINGS[reading]), key=len)


def _verdict(row: PrintedRow, reading: str, decimals: int, means: Iterable[str]) -> dict[str, Any]:
    """Return the verdict of one reading on a row; it is possible without a reason against it.

    `mean_low` and `mean_high` bound the exact mean, `least_trials` and `largest_trials` are the
    numbers of stimuli that give the least and the largest value, and `fitting_means` the printed
    means of the table that would be possible in this row.
    """
    ends = [
        [proportions_of(text, convention, decimals) for convention in READINGS[reading]]
        for text in (row.min, row.max)
    ]
    ranges = [attainable_means(a, b, row.participants) for a, b in zip(*ends, strict=True)]
    ranges = [means for means in ranges if not means.is_empty]
    least_trials, largest_trials = (
        sorted({n for values in end for n in _feasible_trials(values, row.n)}) if row.n else None
        for end in ends
    )
    reasons = _reasons(row, reading, decimals, row.mean)
    return {
        "reading": reading,
        "reasons": reasons,
        "mean_low": min((float(means.low) for means in ranges), default=None),
        "mean_high": max((float(means.high) for means in ranges), default=None),
        "least_trials": least_trials,
        "largest_trials": largest_trials,
        "fitting_means": [mean for mean in means if not _reasons(row, reading, decimals, mean)],
        "possible": not reasons,
    }


def _exchange_fits(rows: Sequence[PrintedRow], fitting_means: Sequence[list[str]]) -> bool:
    """Return whether each row can have a mean of its own, in some order."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import maximum_bipartite_matching

    fits = [[row.mean in means for row in rows] for means in fitting_means]
    return bool((maximum_bipartite_matching(csr_matrix(fits)) >= 0).all())
