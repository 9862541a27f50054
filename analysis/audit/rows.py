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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Ranges:
    """What a row's numbers may stand for under one convention."""

    least: Range
    largest: Range
    attainable: Range | None


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
            verdicts=tuple(
                _verdict(row, reading, decimals, means.values()) for reading in READINGS
            ),
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


def _verdict(
    row: PrintedRow, reading: str, decimals: int, means: Iterable[Printed]
) -> ReadingVerdict:
    found = [_ranges(row, convention, decimals) for convention in READINGS[reading]]
    means_of = [ranges.attainable for ranges in found if ranges.attainable is not None]
    return ReadingVerdict(
        reading=reading,
        reasons=_reasons(row, reading, decimals, row.mean),
        mean_low=float(min(one.low for one in means_of)) if means_of else None,
        mean_high=float(max(one.high for one in means_of)) if means_of else None,
        least_trials=_feasible(row, [ranges.least for ranges in found]),
        largest_trials=_feasible(row, [ranges.largest for ranges in found]),
        fitting_means=tuple(
            sorted(mean.text for mean in means if not _reasons(row, reading, decimals, mean))
        ),
    )


def _reasons(row: PrintedRow, reading: str, decimals: int | None, mean: Printed) -> tuple[str, ...]:
    """Return what is impossible about a row with some mean, under the best convention."""
    return min(
        (tuple(_faults(row, convention, decimals, mean)) for convention in READINGS[reading]),
        key=lambda reasons: len(reasons),  # noqa: PLW0108 - mypy needs the sized type
    )


def _feasible(row: PrintedRow, ranges: Sequence[Range]) -> tuple[int, ...] | None:
    """Return the numbers of stimuli that give a value in one of the ranges."""
    if row.trials is None:
        return None
    numbers = range(row.trials[0], row.trials[1] + 1)
    return tuple(n for n in numbers if any(one.counts(n) for one in ranges))


def _faults(row: PrintedRow, convention: str, decimals: int | None, mean: Printed) -> Iterator[str]:
    """Yield what is impossible about a row with some mean."""
    found = _ranges(row, convention, decimals)
    stands_for = mean.stands_for(convention, _kept(mean, decimals))
    least, largest = row.least.text, row.largest.text
    values = {"least": (least, found.least), "largest": (largest, found.largest)}
    for name, (text, one) in values.items():
        if row.trials is not None and not _ever(one, row.trials):
            yield f"no number of stimuli {_told(row)} gives the {name} value {text}"
    if not found.least.reaches(found.largest):
        yield f"the least value {least} is above the largest {largest}"
    elif not found.least.reaches(stands_for):
        yield f"the mean {mean.text} is below the least value {least}"
    elif not stands_for.reaches(found.largest):
        yield f"the mean {mean.text} is above the largest value {largest}"
    elif found.attainable is None:
        yield f"one participant has one value, not {least} and {largest}"
    elif not stands_for.meets(found.attainable):
        lowest, highest = float(found.attainable.low), float(found.attainable.high)
        yield (
            f"the mean {mean.text} is impossible for {row.participants} participants with least "
            f"{least} and largest {largest}: from {lowest:.4g} to {highest:.4g}"
        )
    elif row.participants and row.trials and row.trials[0] == row.trials[1]:
        people, n = row.participants, row.trials[0]
        if not counts_fit(found.least, found.largest, stands_for, participants=people, trials=n):
            yield f"no counts of {people} participants with {n} stimuli each have that mean"


@lru_cache(maxsize=1024)
def _ever(one: Range, trials: tuple[int, int]) -> bool:
    return any(one.counts(n) for n in range(trials[0], trials[1] + 1))


def _told(row: PrintedRow) -> str:
    if row.trials is None or row.trials[0] == row.trials[1]:
        return str(row.trials[0]) if row.trials else ""
    return f"from {row.trials[0]} to {row.trials[1]}"


def _kept(number: Printed, decimals: int | None) -> int:
    return number.decimals if decimals is None else decimals


def _ranges(row: PrintedRow, convention: str, decimals: int | None) -> _Ranges:
    least = row.least.stands_for(convention, _kept(row.least, decimals))
    largest = row.largest.stands_for(convention, _kept(row.largest, decimals))
    mean = attainable(least, largest, row.participants) if least.reaches(largest) else None
    return _Ranges(least=least, largest=largest, attainable=mean)


def _exchange_fits(rows: Sequence[PrintedRow], verdicts: Sequence[ReadingVerdict]) -> bool:
    """Tell whether each row can have a mean of its own, in any order (bipartite matching)."""
    fits = [
        [place for place, other in enumerate(rows) if other.mean.text in verdict.fitting_means]
        for verdict in verdicts
    ]
    taken: dict[int, int] = {}

    def seat(row: int, tried: set[int]) -> bool:
        for place in fits[row]:
            if place in tried:
                continue
            tried.add(place)
            if place not in taken or seat(taken[place], tried):
                taken[place] = row
                return True
        return False

    return all(seat(row, set()) for row in range(len(rows)))
