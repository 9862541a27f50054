"""Mutual information of stimulus and answer, in bits, and whether it could be chance."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from hashlib import sha256
from typing import TYPE_CHECKING

import numpy as np

from experiment.names import require_whole

if TYPE_CHECKING:
    from numpy.typing import NDArray


DRAWS = 999
"""Random rearrangements behind a permutation p, which is therefore a multiple of 1/1000."""


def seeded_by(data: bytes, seed: int, occurrence: int = 0) -> np.random.Generator:
    """Return a generator for what was observed.

    `occurrence` tells apart observations that are the same by chance, counted from 0.

    Raises ValueError for a seed that is not a whole number of at least 0.

    >>> seeded_by(b"a", 0).random() == seeded_by(b"a", 0).random()
    True
    >>> seeded_by(b"a", 0).random() == seeded_by(b"a", 0, occurrence=1).random()
    False
    """
    require_whole("seed", seed, 0)
    words = np.frombuffer(sha256(data).digest(), dtype=">u4").astype(int).tolist()
    return np.random.default_rng([seed, occurrence, *words])


WORDS = 4
"""Left, right, both, none: of stimuli (rows) and of answers (columns)."""
_MIRROR = (1, 0, 2, 3)
_SLACK = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Information:
    """What an answer tells of the stimulus."""

    trials: int  # with an answer; time-outs and invalid keys are none
    plugin_bits: float | None  # of the observed shares: too large by chance
    # corrected for the number of cells that are not empty; may fall below 0
    miller_madow_bits: float | None
    stimulus_bits: float | None  # entropy of the stimuli, which the information cannot exceed
    p: float | None  # share of chance tables with the same sums that tell at least as much
    reason: str  # why there is no value; else empty


def information(
    tables: NDArray[np.int64], seed: int = 0
) -> tuple[tuple[Information, ...], Information]:
    """Return the information of each participant's table and of their sum.

    Tables are whole counts (P, 4, 4), else a ValueError: stimuli left, right, both, none by the
    same answers. With n trials, the plug-in value is the sum of n_ij/n log2(n n_ij / (n_i n_j));
    Miller and Madow add (rows + columns - cells - 1) / (2 n ln 2) with the numbers of those that
    are not empty (G. A. Miller, 1955). For p each table is drawn anew with its own sums of rows and
    columns, so that what only differs between participants is no information; neither the order of
    the tables nor exchanging left and right changes it. Section 11 of docs/statistics.md.

    Two stimuli that are always told apart carry one bit:

    >>> table = np.zeros((1, 4, 4), dtype=np.int64)
    >>> table[0, [0, 1], [0, 1]] = 10
    >>> (one,), together = information(table)
    >>> one.plugin_bits, one.p, one == together
    (1.0, 0.001, True)
    """
    if tables.shape[1:] != (WORDS, WORDS) or tables.dtype.kind != "i":
        raise ValueError(f"tables must be whole counts of shape (P, 4, 4), got {tables.shape}")
    if np.any(tables < 0):
        raise ValueError("tables must hold counts of at least 0, got one below")
    found: dict[bytes, Information] = {}
    drawn = np.zeros((DRAWS, WORDS, WORDS), dtype=np.int64)
    seen: Counter[bytes] = Counter()
    for table, flipped in _oriented(tables):
        key = table.tobytes()
        chance = _random_tables(table, seed)
        if key not in found:
            found[key] = found[_mirror(table).tobytes()] = _information(table, chance)
        # Another order for each: equal tables must not be drawn alike.
        order = seeded_by(key, seed, 1 + seen[key] * 2 + flipped).permutation(DRAWS)
        drawn += (_mirror(chance) if flipped else chance)[order]
        seen[key] += 1
    each = tuple(found[table.tobytes()] for table in tables)
    return each, _information(tables.sum(axis=0), drawn)


def _information(table: NDArray[np.int64], chance: NDArray[np.int64]) -> Information:
    """Return the information of a table, with tables by chance of shape (DRAWS, 4, 4)."""
    trials = int(table.sum())
    reason = _reason(table)
    if reason:
        return Information(
            trials=trials,
            plugin_bits=None,
            miller_madow_bits=None,
            stimulus_bits=None,
            p=None,
            reason=reason,
        )
    plugin = _bits(table)
    rows, columns, cells = (
        int(np.count_nonzero(part)) for part in (table.sum(axis=1), table.sum(axis=0), table)
    )
    return Information(
        trials=trials,
        plugin_bits=plugin,
        miller_madow_bits=plugin + (rows + columns - cells - 1) / (2 * trials * math.log(2)),
        stimulus_bits=_bits(np.diag(table.sum(axis=1))),
        p=_chance_p(table, chance),
        reason="",
    )


def _reason(table: NDArray[np.int64]) -> str:
    if not table.any():
        return "no trial was answered"
    return "one kind of stimulus only" if np.count_nonzero(table.sum(axis=1)) == 1 else ""


def _bits(table: NDArray[np.int64]) -> float:
    """Return the plug-in information, exact sums: the order of rows and columns cannot show."""
    total = int(table.sum())
    rows, columns = table.sum(axis=1), table.sum(axis=0)
    terms = [
        int(table[i, j]) / total * math.log2(total * int(table[i, j]) / int(rows[i] * columns[j]))
        for i, j in np.argwhere(table)
    ]
    return max(0.0, math.fsum(terms))


def _chance_p(table: NDArray[np.int64], chance: NDArray[np.int64]) -> float:
    """Return the permutation p; with the sums fixed, information grows with sum n_ij log n_ij."""
    counts = np.arange(int(table.sum()) + 1)
    terms = counts * np.log(np.maximum(counts, 1))
    observed, others = (
        np.sort(terms[every].reshape(-1, WORDS**2), axis=1).sum(axis=1) for every in (table, chance)
    )
    return (1 + int(np.count_nonzero(others >= observed * (1 - _SLACK)))) / (DRAWS + 1)


def _mirror(tables: NDArray[np.int64]) -> NDArray[np.int64]:
    """Exchange left and right in one or more tables."""
    return np.ascontiguousarray(tables[..., _MIRROR, :][..., :, _MIRROR])


def _oriented(tables: NDArray[np.int64]) -> list[tuple[NDArray[np.int64], bool]]:
    """Order the tables and write each in the smaller of its two ways, told whether it is flipped.

    All of them mirrored give the same list: of both ways to tell who is flipped, the smaller one.
    """
    ways = []
    for every in (tables, _mirror(tables)):
        pairs = [(table.tobytes(), _mirror(table).tobytes()) for table in every]
        ways.append(sorted((min(pair), pair[1] < pair[0]) for pair in pairs))
    return [(np.frombuffer(raw, tables.dtype).reshape(WORDS, WORDS), f) for raw, f in min(ways)]


def _random_tables(table: NDArray[np.int64], seed: int) -> NDArray[np.int64]:
    """Draw tables with the same sums, shape (DRAWS, 4, 4), cell by cell."""
    rng = seeded_by(table.tobytes(), seed)
    drawn = np.zeros((WORDS, WORDS, DRAWS), dtype=np.int64)  # long rows are added up faster
    left = np.repeat(table.sum(axis=0)[:, None], DRAWS, axis=1)
    rows, columns = np.flatnonzero(table.sum(axis=1)), np.flatnonzero(table.sum(axis=0))
    for row in rows[:-1]:
        wanted = np.full(DRAWS, table[row].sum())
        for column in columns[:-1]:
            others = left[column + 1 :].sum(axis=0)
            cell = rng.hypergeometric(left[column], others, wanted)
            drawn[row, column] = cell
            wanted -= cell
        drawn[row, columns[-1]] = wanted
        left -= drawn[row]
    if rows.size:
        drawn[rows[-1]] = left
    return np.ascontiguousarray(np.moveaxis(drawn, -1, 0))
