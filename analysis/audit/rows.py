"""Whether a printed table of least, mean and largest proportions can be true at all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING

from analysis.audit.attainable import attainable, counts_fit
from analysis.audit.printed import HALF_EVEN, HALF_UP, TRUNCATED, Printed, Range

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence


MOST_TRIALS, WIDEST_RANGE, MOST_ROWS = 1_000_000, 1000, 100
READINGS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"rounded": (HALF_UP, HALF_EVEN), "truncated": (TRUNCATED,)}
)
"""Reading: the conventions it allows, any one of which has to explain a whole row."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedRow:
    """A row of a printed table.

    Attributes
    ----------
    label : str
        Its level or name.
    least, mean, largest : Printed
        Over participants; the mean is unweighted.
    trials : tuple of int or None
        Fewest and most stimuli of a participant; ``None`` where nobody knows.
    participants : int or None
        Their number; ``None`` where nobody knows.
    """

    label: str
    least: Printed
    mean: Printed
    largest: Printed
    trials: tuple[int, int] | None = None
    participants: int | None = None

    def __post_init__(self) -> None:
        fewest, most = self.trials or (1, 1)
        if not (1 <= fewest <= most <= MOST_TRIALS and most - fewest <= WIDEST_RANGE):
            allowed = f"from 1 to {MOST_TRIALS}, fewest first and at most {WIDEST_RANGE} apart"
            raise ValueError(f"trials must be {allowed}, got {self.trials}")
        if self.participants is not None and not 1 <= self.participants <= MOST_TRIALS:
            message = f"participants must be from 1 to {MOST_TRIALS}, got {self.participants}"
            raise ValueError(message)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingVerdict:
    """What one reading makes of a row.

    Attributes
    ----------
    reading : str
        A key of `READINGS`.
    reasons : tuple of str
        What is impossible, one sentence each; empty where the row is possible.
    mean_low, mean_high : float or None
        What the mean may be with this least and largest value, before it was shortened; ``None``
        where these two already contradict each other.
    least_trials, largest_trials : tuple of int or None
        The numbers of stimuli that give the least and the largest value; ``None`` without `trials`.
    fitting_means : tuple of str
        Printed means of the table that would be possible in this row.
    """

    reading: str
    reasons: tuple[str, ...]
    mean_low: float | None
    mean_high: float | None
    least_trials: tuple[int, ...] | None
    largest_trials: tuple[int, ...] | None
    fitting_means: tuple[str, ...]

    @property
    def possible(self) -> bool:
        """Whether the row is possible under this reading."""
        return not self.reasons


@dataclass(frozen=True, slots=True, kw_only=True)
class RowAudit:
    """A row and what each reading makes of it.

    Attributes
    ----------
    row : PrintedRow
        As printed.
    verdicts : tuple of ReadingVerdict
        One for each of `READINGS`, every number with the decimals of the most exact one.
    possible_as_shown : tuple of str
        Readings under which it is possible if no zeros were dropped: if 0.9 was kept to one decimal
        even beside 0.45.
    """

    row: PrintedRow
    verdicts: tuple[ReadingVerdict, ...]
    possible_as_shown: tuple[str, ...]

    @property
    def possible(self) -> bool:
        """Whether the row is possible under any reading."""
        return any(verdict.possible for verdict in self.verdicts)


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit:
    """The audit of a table.

    Attributes
    ----------
    decimals : int
        Of its most exact number; zeros at the end of the others count as dropped.
    rows : tuple of RowAudit
        In the order of the table.
    exchange_fits : tuple of str
        Readings under which the means, exchanged among the rows or not, are all possible.
    """

    decimals: int
    rows: tuple[RowAudit, ...]
    exchange_fits: tuple[str, ...]

    @property
    def possible(self) -> bool:
        """Whether every row is possible under some reading."""
        return all(row.possible for row in self.rows)


def audit(rows: Sequence[PrintedRow]) -> Audit:
    """Tell which rows of a table are impossible, and why.

    A row is possible if participants exist whose values give its three numbers: the least at most
    the mean at most the largest; with P participants, one at the least and one at the largest value
    and all others between; with the numbers of stimuli, values that are k / n. With a single n the
    counts of all participants have to add up to the mean as well; with a range of n only the least
    and largest values are held to it. Formulas: docs/statistics.md, section 10.

    Parameters
    ----------
    rows : sequence of PrintedRow
        At least one.

    Returns
    -------
    Audit

    Raises
    ------
    ValueError
        Without a row, or with more than `MOST_ROWS`.

    Examples
    --------
    >>> def row(least, mean, largest):
    ...     texts = {"least": least, "mean": mean, "largest": largest}
    ...     printed = {name: Printed(text=text) for name, text in texts.items()}
    ...     return PrintedRow(label="95", **printed)
    >>> audit([row("0.90", "0.87", "1.00")]).rows[0].verdicts[0].reasons
    ('the mean 0.87 is below the least value 0.90',)
    >>> audit([row("0.90", "0.93", "1.00")]).possible
    True
    """
    if not 1 <= len(rows) <= MOST_ROWS:
        raise ValueError(f"rows must hold from 1 to {MOST_ROWS} rows, got {len(rows)}")
    decimals = max(n.decimals for row in rows for n in (row.least, row.mean, row.largest))
    means = {row.mean.text: row.mean for row in rows}
    audited = tuple(
        RowAudit(
            row=row,
            verdicts=tuple(_verdict(row, one, decimals, means.values()) for one in READINGS),
            possible_as_shown=tuple(r for r in READINGS if not _reasons(row, r, None, row.mean)),
        )
        for row in rows
    )
    exchange = tuple(
        reading
        for place, reading in enumerate(READINGS)
        if _exchange_fits(rows, [found.verdicts[place] for found in audited])
    )
    return Audit(decimals=decimals, rows=audited, exchange_fits=exchange)


def _faults(row: PrintedRow, convention: str, decimals: int | None, mean: Printed) -> Iterator[str]:
    """Yield what is impossible about a row with some mean."""
    least, shown, largest = (
        one.stands_for(convention, decimals) for one in (row.least, mean, row.largest)
    )
    low, high = row.least.text, row.largest.text
    for name, text, one in (("least", low, least), ("largest", high, largest)):
        if row.trials and not _feasible(one, row.trials):
            yield f"no number of stimuli {_told(row.trials)} gives the {name} value {text}"
    means = attainable(least, largest, row.participants)
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
            f"the mean {mean.text} is impossible for {row.participants} participants with least "
            f"{low} and largest {high}: from {float(means.low):.4g} to {float(means.high):.4g}"
        )
    elif row.participants and row.trials and row.trials[0] == row.trials[1]:
        people, n = row.participants, row.trials[0]
        if not counts_fit(least, largest, shown, participants=people, trials=n):
            yield f"no counts of {people} participants with {n} stimuli each have that mean"


@lru_cache(maxsize=1024)
def _feasible(one: Range, trials: tuple[int, int]) -> tuple[int, ...]:
    """Return the numbers of stimuli that give a value of a range."""
    return tuple(n for n in range(trials[0], trials[1] + 1) if one.counts(n))


def _told(trials: tuple[int, int]) -> str:
    return str(trials[0]) if trials[0] == trials[1] else f"from {trials[0]} to {trials[1]}"


def _reasons(row: PrintedRow, reading: str, decimals: int | None, mean: Printed) -> tuple[str, ...]:
    """Return what is impossible about a row with some mean, under the best convention."""
    return min((tuple(_faults(row, one, decimals, mean)) for one in READINGS[reading]), key=len)


def _verdict(
    row: PrintedRow, reading: str, decimals: int, means: Iterable[Printed]
) -> ReadingVerdict:
    least, largest = (
        [value.stands_for(one, decimals) for one in READINGS[reading]]
        for value in (row.least, row.largest)
    )
    found = [
        some
        for one, other in zip(least, largest, strict=True)
        if (some := attainable(one, other, row.participants))
    ]
    numbers = [
        tuple(sorted({n for one in every for n in _feasible(one, row.trials)}))
        if row.trials
        else None
        for every in (least, largest)
    ]
    return ReadingVerdict(
        reading=reading,
        reasons=_reasons(row, reading, decimals, row.mean),
        mean_low=float(min(one.low for one in found)) if found else None,
        mean_high=float(max(one.high for one in found)) if found else None,
        least_trials=numbers[0],
        largest_trials=numbers[1],
        fitting_means=tuple(
            sorted(mean.text for mean in means if not _reasons(row, reading, decimals, mean))
        ),
    )


def _exchange_fits(rows: Sequence[PrintedRow], verdicts: Sequence[ReadingVerdict]) -> bool:
    """Tell whether each row can have a mean of its own, in any order."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import maximum_bipartite_matching

    fits = [[other.mean.text in one.fitting_means for other in rows] for one in verdicts]
    return bool((maximum_bipartite_matching(csr_matrix(fits)) >= 0).all())
