"""Which numbers a printed number may stand for: exact ranges, by how it was shortened."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

MAX_DECIMALS: Final = 12
HALF_UP, HALF_EVEN, TRUNCATED = "half up", "half even", "truncated"
CONVENTIONS = (HALF_UP, HALF_EVEN, TRUNCATED)
_PROPORTION = re.compile(rf"0|1|[01]?\.[0-9]{{1,{MAX_DECIMALS}}}", re.ASCII)
_LEAST = Fraction(1, 10**50)
"""Less than what lies between any two values that are compared: those of counts of a million people
with a million stimuli, and of `MAX_DECIMALS`. So far does a range end before an open end."""


@dataclass(frozen=True, slots=True)
class Range:
    """All numbers from one to another.

    >>> tenths = Range(Fraction(1, 4), Fraction(1, 2)).counts(10)
    >>> list(tenths)
    [3, 4, 5]
    """

    low: Fraction
    high: Fraction

    def holds(self, value: Fraction) -> bool:
        """Tell whether a number belongs to it."""
        return self.low <= value <= self.high

    def counts(self, trials: int) -> range:
        """Return the k for which k / trials belongs to it."""
        return range(math.ceil(self.low * trials), math.floor(self.high * trials) + 1)

    def of_counts(self, trials: int) -> Range:
        """Return its part from the first k / trials to the last."""
        every = self.counts(trials)
        return Range(Fraction(every.start, trials), Fraction(every.stop - 1, trials))


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
    def decimals(self) -> int:
        """How many digits stand behind the point."""
        return len(self.text.partition(".")[2])

    def stands_for(self, convention: str, decimals: int | None = None) -> Range:
        """Return the proportions that are printed so under one of `CONVENTIONS`.

        `decimals` are its own, or more where zeros at the end were dropped.

        >>> cut = Printed(text="0.9").stands_for("truncated", 2)
        >>> cut.holds(Fraction("0.9099")), cut.holds(Fraction("0.91"))
        (True, False)
        """
        step = Fraction(1, 10 ** (self.decimals if decimals is None else decimals))
        low = Fraction(self.text) - (0 if convention == TRUNCATED else step / 2)
        high = low + step
        odd = Fraction(self.text) / step % 2 == 1
        if convention == HALF_EVEN and odd:
            low += _LEAST
        if convention != HALF_EVEN or odd:
            high -= _LEAST
        return Range(max(low, Fraction(0)), min(high, Fraction(1)))
