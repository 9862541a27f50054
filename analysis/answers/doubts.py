"""People whose answers a reader should look at: sides swapped, no better than guessing, drifting.

The tests are exact where they decide on a person, so that an honest one is hardly ever named;
docs/benchmarks.md, "Who is named", has how often, and how many of the others are found. Nothing is
left out or turned around because of them.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd
from scipy.special import bdtr, bdtrc, gammaln, ndtr

from analysis.answers.counting import counted
from analysis.answers.drift import drifting, short_p

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from analysis.axis import Axis

    Counts = NDArray[np.int64]


SWAPPED_P: Final = 1e-3
"""Who is right as seldom as this by guessing has the sides swapped; who feels anything is safer."""
GUESSED_P: Final = 0.05
"""What guessing makes more probable than this cannot be told from guessing."""
_FEWER_P: Final = 0.01
"""Who is right as seldom as this by guessing felt something, or answers by another rule."""
FEWEST: Final = 20
"""Fewer stimuli tell of nobody that they only guess."""

SWAPPED: Final = "swapped"
GUESSING: Final = "guessing"
DRIFTING: Final = "drifting"
_MOST_TERMS: Final = 100_000
_SIDES: Final = ("left", "right")


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubt:
    """Who a reader should look at, and why in a sentence.

    `kind` is `SWAPPED` of a participant in all conditions, `GUESSING` in one, or `DRIFTING` in
    sessions that the sentence names.
    """

    kind: str
    words: str
    participant: str = ""
    condition: str = ""

    def __str__(self) -> str:
        return self.words


def doubtful(trials: pd.DataFrame, axis: Axis, alternatives: int = 2) -> Iterator[Doubt]:
    """Say which people a reader should look at, and why, in a sentence each.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.
    axis : Axis
        Of the levels.
    alternatives : int
        Of a forced choice.

    Yields
    ------
    Doubt
        People with swapped sides, people who may only guess, and sessions with a drift.

    Examples
    --------
    >>> from analysis.axis import VOLTS
    >>> trials = pd.DataFrame({"participant": "7", "condition": "main", "session": "01",
    ...     "trial": range(40), "kind": "single", "side": ["left", "right"] * 20,
    ...     "level_vpp": 60.0, "response": ["right", "left"] * 20, "reason": "",
    ...     "none_offered": False})
    >>> print(*doubtful(trials, VOLTS))  # doctest: +ELLIPSIS
    participant 7: the side was right in 0 of 40 left or right answers, fewer than guessing gives
    (p = 7e-12): keys or actuators swapped? Nothing was turned around
    """
    single, blank = counted(trials, "single"), counted(trials, "blank")
    if single.empty:
        return
    yield from _named(_cells(single, "level_vpp"), _cells(blank), alternatives)
    for name, words in drifting(single, axis, alternatives):
        yield Doubt(kind=DRIFTING, words=words, participant=name)


def doubtful_counts(
    table: pd.DataFrame, blanks: pd.DataFrame | None, alternatives: int
) -> Iterator[Doubt]:
    """Say the same of a table of counts, as far as it can be told: such a table has no sides.

    >>> table = pd.DataFrame({"participant": "7", "condition": "main", "level_vpp": [60.0, 90.0],
    ...     "detected": [1, 2], "presented": 30, "none_offered": False})
    >>> print(*doubtful_counts(table, None, 2))  # doctest: +ELLIPSIS
    participant 7: 3 of 60 answers were right, fewer than guessing gives (p = ...
    """
    beside = {} if blanks is None else _as_cells(blanks, "felt")
    yield from _named(_as_cells(table, "detected"), beside, alternatives)


def _as_cells(table: pd.DataFrame, detected: str) -> dict[tuple[str, str], Counts]:
    """Return counts as those of stimuli at one side."""
    cells: dict[tuple[str, str], list[list[int]]] = {}
    for row in table.to_dict("records"):
        k, n = int(row[detected]), int(row["presented"])
        forced = 0 if row.get("none_offered", True) else n
        where = str(row["participant"]), str(row["condition"])
        one = [k, n - k if forced else 0, 0, 0, n, n, k, forced]
        cells.setdefault(where, []).append(one)
    return {where: np.array(rows) for where, rows in cells.items()}


def _named(
    levels: dict[tuple[str, str], Counts], blanks: dict[tuple[str, str], Counts], alternatives: int
) -> Iterator[Doubt]:
    """Name people by their counts at each level, and at none."""
    found = {name: _swapped(name, every, alternatives) for name, every in _people(levels).items()}
    for name, words in found.items():
        if words:
            yield Doubt(kind=SWAPPED, words=words, participant=name)
    several = len({condition for _, condition in levels}) > 1
    for (name, condition), cells in levels.items():
        if found[name] or _told_from_guesses(cells, blanks.get((name, condition)), alternatives):
            continue
        where = f", condition {condition}" if several else ""
        words = _guess_words(cells, blanks.get((name, condition)), alternatives)
        words = f"participant {name}{where}: {words}"
        yield Doubt(kind=GUESSING, words=words, participant=name, condition=condition)


# A cell is a row of counts: answers left and right to stimuli at the left, the same at the right,
# stimuli at the left, all stimuli, those that were felt, and those with "none" not offered.
_AT_LEFT, _ALL, _FELT, _FORCED = 4, 5, 6, 7


def _cells(trials: pd.DataFrame, *more: str) -> dict[tuple[str, str], Counts]:
    """Count the answers of each participant in each condition; a row each level where `more`."""
    side, answer = (trials[name].astype(object) for name in ("side", "response"))
    offered = trials["none_offered"].astype("boolean").fillna(value=False).astype(bool)
    columns = [
        *(side.eq(one) & answer.eq(other) for one, other in itertools.product(_SIDES, repeat=2)),
        *(side.eq("left"), answer.notna(), answer.isin([*_SIDES, "both"]), ~offered),
    ]
    key = [trials[name].astype(object) for name in ("participant", "condition", *more)]
    table = pd.concat(columns, axis=1, keys=range(len(columns))).astype(np.int64)
    counts = table.groupby(key).sum()
    rows: dict[tuple[str, str], list[Counts]] = {}
    for where, row in zip(counts.index, counts.to_numpy(), strict=True):
        rows.setdefault((str(where[0]), str(where[1])), []).append(row)
    return {where: np.array(each) for where, each in rows.items()}


def _people(cells: dict[tuple[str, str], Counts]) -> dict[str, Counts]:
    """Return the counts of each participant, all conditions together."""
    people: dict[str, Counts] = {}
    for (name, _), rows in cells.items():
        people[name] = people.get(name, 0) + rows.sum(axis=0)
    return people


def _swapped(name: str, row: Counts, alternatives: int) -> str:
    sides = _sides(row, alternatives)
    if sides.below >= SWAPPED_P:
        return ""
    return (
        f"participant {name}: {sides.words}, fewer than guessing gives (p = "
        f"{short_p(sides.below)}): keys or actuators swapped? Nothing was turned around"
    )


def _told_from_guesses(cells: Counts, blanks: Counts | None, alternatives: int) -> bool:
    """Tell whether a participant does better than by guessing, at all levels or at one of them.

    True, too, where nobody can know: few stimuli, or none that guesses could be told by.
    """
    together = _p_of_guesses(cells.sum(axis=0), blanks, alternatives)
    if together is None or together < GUESSED_P or cells[:, _ALL].sum() < FEWEST:
        return True
    each = [_p_of_guesses(row, blanks, alternatives) for row in cells]
    return min((p for p in each if p is not None), default=1.0) < GUESSED_P / len(cells)


def _p_of_guesses(row: Counts, blanks: Counts | None, alternatives: int) -> float | None:
    """Return how probable answers as good are in guesses, by their sides and against blanks."""
    sides, tested = _sides(row, alternatives), []
    if sides.tells:
        tested.append(sides.above)
    if blanks is not None:
        felt, of = (np.array([row[i], blanks[0, i]]) for i in (_FELT, _ALL))
        tested.append(hypergeometric_tails(np.stack([felt, of - felt], axis=1))[1])
    return min(1.0, len(tested) * min(tested)) if tested else None


def _guess_words(cells: Counts, blanks: Counts | None, alternatives: int) -> str:
    row, parts = cells.sum(axis=0), []
    sides = _sides(row, alternatives)
    why = "levels too low, the task misunderstood, or an actuator that does not move?"
    if sides.tells:
        parts.append(sides.words)
        if sides.below < _FEWER_P:
            parts.append(f"fewer than by chance, p = {short_p(sides.below)}")
            why = "sides swapped, or the task misunderstood?"
    if blanks is not None:
        parts.append(
            f"something felt in {row[_FELT]} of {row[_ALL]} single stimuli and in "
            f"{blanks[0, _FELT]} of {blanks[0, _ALL]} blanks"
        )
    return f"answers cannot be told from guessing at any level ({', '.join(parts)}): {why}"


@dataclass(frozen=True, slots=True)
class _Sides:
    """Right sides of so many answered; how probable as few, and as many, are in guesses.

    `tells` is false where guesses could not be told: stimuli at one side only, "none" offered.
    """

    right: int
    of: int
    below: float = 1.0
    above: float = 1.0
    tells: bool = True
    sided: bool = False  # whether stimuli were at both sides

    @property
    def words(self) -> str:
        """How often an answer was right."""
        if self.sided:
            return f"the side was right in {self.right} of {self.of} left or right answers"
        return f"{self.right} of {self.of} answers were right"


def _sides(row: Counts, alternatives: int) -> _Sides:
    table = row[:4].reshape(2, 2)
    right, of = int(np.trace(table)), int(table.sum())
    if 0 < row[_AT_LEFT] < row[_ALL]:
        return _Sides(right, of, *hypergeometric_tails(table), sided=True)
    if row[_FORCED] < row[_ALL]:
        return _Sides(right, of, tells=False)
    # At one side only, the answer of a forced choice is right by chance once in so many.
    p = 1 / alternatives
    above = float(bdtrc(right - 1, of, p)) if right else 1.0
    return _Sides(right, of, float(bdtr(right, of, p)), above)


def hypergeometric_tails(table: Counts) -> tuple[float, float]:
    """Return P(at most) and P(at least) as many in the first cell of a 2 x 2 table, its sums given.

    Fisher's exact test, one tail each; of very large tables its normal limit.
    How often a side is answered is given: a person who prefers one is not taken for one who swaps
    them.

    >>> [round(p, 6) for p in hypergeometric_tails(np.array([[0, 5], [5, 0]]))]
    [0.003968, 1.0]
    >>> hypergeometric_tails(np.array([[9, 0], [3, 0]]))
    (1.0, 1.0)
    """
    row, other = (int(one) for one in table.sum(axis=1))
    column = int(table[:, 0].sum())
    least, most, here = max(0, column - other), min(row, column), int(table[0, 0])
    if most - least > _MOST_TERMS:
        total = row + other
        spread = math.sqrt(column * row / total * other / total * (total - column) / (total - 1))
        z = np.array([here + 0.5, here - 0.5]) - column * row / total
        below, above = ndtr(z / spread * [1, -1]).tolist()
        return below, above
    first = np.arange(least, most + 1)
    log = -(
        gammaln(first + 1.0)
        + gammaln(row - first + 1.0)
        + gammaln(column - first + 1.0)
        + gammaln(other - column + first + 1.0)
    )
    shares = np.exp(log - log.max())
    shares /= shares.sum()
    below, above = float(shares[first <= here].sum()), float(shares[first >= here].sum())
    return min(1.0, below), min(1.0, above)
