"""Which numbers a printed number may stand for: exact ranges, by how it was shortened."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction

MAX_DECIMALS = 12
HALF_UP, HALF_EVEN, TRUNCATED = "half up", "half even", "truncated"
CONVENTIONS = (HALF_UP, HALF_EVEN, TRUNCATED)
_PROPORTION = re.compile(rf"0|1|[01]?\.[0-9]{{1,{MAX_DECIMALS}}}", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """All numbers from one to another, each end included or not.

    >>> half = Range(low=Fraction(0), high=Fraction(1, 2), with_low=True, with_high=False)
    >>> half.holds(Fraction(0)), half.holds(Fraction(1, 2))
    (True, False)
    """

    low: Fraction
    high: Fraction
    with_low: bool = True
    with_high: bool = True

    def holds(self, value: Fraction) -> bool:
        """Tell whether a number belongs to it."""
        above = value > self.low or (self.with_low and value == self.low)
        return above and (value < self.high or (self.with_high and value == self.high))

    def meets(self, other: Range) -> bool:
        """Tell whether a number belongs to both."""
        return self.reaches(other) and other.reaches(self)

    def reaches(self, other: Range) -> bool:
        """Tell whether a number of this range is at most one of the other range."""
        both = self.with_low and other.with_high
        return self.low < other.high or (both and self.low == other.high)

    def counts(self, trials: int) -> range:
        """Return the k for which k / trials belongs to it, none below 0 or above `trials`.

        >>> list(Range(low=Fraction(1, 4), high=Fraction(1, 2), with_high=False).counts(8))
        [2, 3]
        """
        above, missing = divmod(-self.low.numerator * trials, self.low.denominator)
        last, rest = divmod(self.high.numerator * trials, self.high.denominator)
        first = -above + int(not self.with_low and not missing)
        last -= int(not self.with_high and not rest)
        return range(max(first, 0), min(last, trials) + 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """A proportion as it was printed.

    Attributes
    ----------
    text : str
        From 0 to 1 with at most `MAX_DECIMALS` decimals, without an exponent.

    Raises
    ------
    ValueError
        For any other text.

    Examples
    --------
    >>> Printed(text="0.90").decimals, Printed(text="1").decimals
    (2, 0)
    """

    text: str

    def __post_init__(self) -> None:
        if not _PROPORTION.fullmatch(self.text) or Fraction(self.text) > 1:
            message = f"a printed proportion must be a number from 0 to 1, got {self.text!r}"
            raise ValueError(message)

    @property
    def value(self) -> Fraction:
        """The number itself."""
        return Fraction(self.text)

    @property
    def decimals(self) -> int:
        """How many digits stand behind the point."""
        return len(self.text.partition(".")[2])

    def stands_for(self, convention: str, decimals: int) -> Range:
        """Return the proportions that are printed so.

        Parameters
        ----------
        convention : str
            One of `CONVENTIONS`: rounded with halves going up, or to the even digit, or cut off.
        decimals : int
            Digits kept; at least its own, more where zeros at the end were dropped.

        Raises
        ------
        ValueError
            For another convention and for fewer decimals than it has.

        Examples
        --------
        >>> cut = Printed(text="0.9").stands_for("truncated", 2)
        >>> cut.holds(Fraction("0.9099")), cut.holds(Fraction("0.91"))
        (True, False)
        """
        if convention not in CONVENTIONS:
            raise ValueError(f"convention must be one of {CONVENTIONS}, got {convention!r}")
        if decimals < self.decimals:
            raise ValueError(f"decimals must be at least {self.decimals}, got {decimals!r}")
        step = Fraction(1, 10**decimals)
        if convention == TRUNCATED:
            low, high, ends = self.value, self.value + step, (True, False)
        else:
            low, high = self.value - step / 2, self.value + step / 2
            even = self.value / step % 2 == 0
            ends = (True, False) if convention == HALF_UP else (even, even)
        return Range(
            low=max(low, Fraction(0)),
            high=min(high, Fraction(1)),
            with_low=ends[0] or low < 0,
            with_high=ends[1] or high > 1,
        )
