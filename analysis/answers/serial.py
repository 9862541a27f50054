"""Whether a trial depends on the one before it, against the same trials in a random order."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from analysis.answers.information import DRAWS, seeded_by
from analysis.answers.sensitivity import Share

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray


ANSWERS = 6
"""Answers are coded 0 to 5: left, right, both, none, timeout, invalid; stimuli 0 to 3 likewise."""
_LEFT_OR_RIGHT, _FELT, _ANSWERED = 2, 3, 4
_MIRROR = np.array([1, 0, 2, 3, 4, 5])
_MIRRORED = (_MIRROR[:4, None] * ANSWERS + _MIRROR[None, :]).astype(np.int8).ravel()
EFFECTS = ("correct", "felt", "side")


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialEffect:
    """How often something comes again in the next trial.

    Attributes
    ----------
    again : Share
        It, where it was in the previous trial.
    otherwise : Share or None
        It, where it was not in the previous trial; ``None`` where there is no such thing.
    expected : float or None
        The share `again` with the trials of each block in random order.
    p : float or None
        Two-sided permutation probability.
    reason : str
        Why there is no probability; else empty.
    """

    again: Share
    otherwise: Share | None
    expected: float | None
    p: float | None
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialEffects:
    """The three effects."""

    # a correct answer to a single stimulus, by whether the previous trial was answered correctly
    correct: SerialEffect
    # a single stimulus felt, by whether something was felt before; both answered
    felt: SerialEffect
    side: SerialEffect  # the same one of left and right answered again


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Block:
    """Trials between which no break was planned."""

    codes: NDArray[np.int8]  # `ANSWERS` times the stimulus plus the answer: (n,)
    linked: NDArray[np.bool_]  # came directly after the one before it here: (n,)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rearranged:
    """Pairs of one participant or a group, as observed (first) and in `DRAWS` random orders."""

    # for each of `EFFECTS` again yes and no, otherwise yes and no: (1 + DRAWS, 3, 4)
    pairs: NDArray[np.int64]
    # pairs of "again" beyond what the margins of each participant give, summed: (1 + DRAWS, 3)
    excess: NDArray[np.float64]


Canonical = tuple[tuple[bytes, bytes], ...]
"""Codes and links of a participant's blocks, in an order that neither names nor sides decide."""


def canonical(blocks: Iterable[Block]) -> Canonical:
    """Write the blocks of a participant so that neither names nor left and right matter.

    >>> block = Block(codes=np.array([0, 7], np.int8), linked=np.array([False, True]))
    >>> mirrored = Block(codes=np.array([7, 0], np.int8), linked=np.array([False, True]))
    >>> canonical([block]) == canonical([mirrored])
    True
    """
    every = list(blocks)
    plain = sorted((b.codes.tobytes(), b.linked.tobytes()) for b in every)
    mirrored = sorted((_MIRRORED[b.codes].tobytes(), b.linked.tobytes()) for b in every)
    return tuple(min(plain, mirrored))


def rearrange(data: Canonical, seed: int, occurrence: int = 0) -> Rearranged:
    """Count pairs as observed and in random orders of each block's trials.

    A place keeps what it is linked to; the trials, stimulus and answer together, change places.
    Blocks of one length share a set of orders and take them in an order of their own.

    Seed and occurrence are those of `seeded_by`.
    """
    sizes = np.array([len(data), *(len(codes) for codes, _ in data)], dtype="<i8").tobytes()
    rng = seeded_by(sizes + b"".join(codes + linked for codes, linked in data), seed, occurrence)
    blocks = [(np.frombuffer(a, np.int8), np.frombuffer(b, np.bool_)) for a, b in data]
    counts = np.zeros((len(EFFECTS) * 4, 1 + DRAWS), dtype=np.int64)
    for codes, linked in blocks:
        columns = np.append(0, 1 + rng.permutation(DRAWS))
        _add_pairs(counts, codes.astype(np.int16)[_orders(len(codes), seed)], linked, columns)
    pairs = np.ascontiguousarray(counts.T).reshape(-1, len(EFFECTS), 4)
    answers = np.concatenate([codes % ANSWERS for codes, _ in blocks])
    return Rearranged(pairs=pairs, excess=_excess(pairs, _same_by_chance(answers)))


@lru_cache(maxsize=32)
def _orders(size: int, seed: int) -> NDArray[np.int64]:
    """Return the order of before and `DRAWS` random ones, shape (size, 1 + DRAWS)."""
    orders = np.tile(np.arange(size), (1 + DRAWS, 1))
    orders[1:] = seeded_by(size.to_bytes(8, "little"), seed).permuted(orders[1:], axis=1)
    orders = np.ascontiguousarray(orders.T)  # many columns of few rows are summed faster
    orders.flags.writeable = False
    return orders


def _same_by_chance(answers: NDArray[np.int8]) -> float:
    """Return how often two of a participant's left and right answers are the same."""
    left, right = (int(np.count_nonzero(answers == side)) for side in range(_LEFT_OR_RIGHT))
    return (left**2 + right**2) / max(left + right, 1) ** 2


def _add_pairs(
    counts: NDArray[np.int64],
    codes: NDArray[np.int16],
    linked: NDArray[np.bool_],
    columns: NDArray[np.int64],
) -> None:
    """Add the pairs of each effect in each column of codes, the columns in the order told."""
    pairs = (codes[:-1] * np.int16(_MIRRORED.size) + codes[1:])[linked[1:]].astype(np.intp)
    bits = max(len(pairs).bit_length(), 1)
    for marks, words in _packed_counts(bits):
        shifts = bits * np.arange(len(marks), dtype=np.uint64)[:, None]
        told = words[pairs].sum(axis=0)[columns]
        counts[marks] += ((told >> shifts) & np.uint64(2**bits - 1)).astype(np.int64)


@cache
def _packed_counts(bits: int) -> list[tuple[NDArray[np.intp], NDArray[np.uint64]]]:
    """Return what each pair of codes counts for in `Rearranged.pairs`.

    Numbers of so many bits share a word, as many as it holds: a block of up to 64 trials has all of
    its numbers in one. Each word comes with the places of its numbers.
    """
    each = np.arange(_MIRRORED.size)
    before, now = (one.ravel() for one in np.meshgrid(each, each, indexing="ij"))
    (_, answer_before), (stimulus, answer) = (np.divmod(one, ANSWERS) for one in (before, now))
    correct = (each // ANSWERS) == (each % ANSWERS)
    single = stimulus < _LEFT_OR_RIGHT
    answered = (answer < _ANSWERED) & (answer_before < _ANSWERED)
    sided = (answer < _LEFT_OR_RIGHT) & (answer_before < _LEFT_OR_RIGHT)
    effects = (
        (correct[before], correct[now], single),
        (answer_before < _FELT, answer < _FELT, single & answered),
        (np.ones_like(sided), answer == answer_before, sided),
    )
    counted = np.stack([
        both & valid
        for first, second, valid in effects
        for both in (first & second, first & ~second, ~first & second, ~first & ~second)
    ])  # fmt: skip
    held = 64 // bits
    some = np.flatnonzero(counted.any(axis=1))
    return [
        (marks, (counted[marks].T << bits * np.arange(len(marks), dtype=np.uint64)).sum(axis=1))
        for marks in (some[first : first + held] for first in range(0, len(some), held))
    ]


def _excess(pairs: NDArray[np.int64], same_by_chance: float) -> NDArray[np.float64]:
    again, other, yes, no = np.moveaxis(pairs, -1, 0)
    share = (again + yes) / np.maximum(again + other + yes + no, 1)
    share[:, EFFECTS.index("side")] = same_by_chance
    return np.asarray(again - (again + other) * share)


def serial_effects(
    people: Sequence[Canonical], seed: int, *, none_offered: bool
) -> tuple[tuple[SerialEffects, ...], SerialEffects]:
    """Return the effects of each participant and of all together.

    `people` come from `canonical`; their order and names change none of the values. Together the
    pairs are added up, each participant rearranged on their own. Without `none_offered` everything
    was felt.

    Left and right in turn never come again:

    >>> codes = np.array([0, 7] * 10, np.int8)
    >>> block = Block(codes=codes, linked=np.arange(20) > 0)
    >>> (one,), together = serial_effects([canonical([block])], 0, none_offered=False)
    >>> one.side.again.p, one.side.p < 0.01, one.felt.reason, one == together
    (0.0, True, '"none" was not offered', True)
    """
    found: dict[Canonical, SerialEffects] = {}
    pairs = np.zeros((1 + DRAWS, len(EFFECTS), 4), dtype=np.int64)
    excess = np.zeros((1 + DRAWS, len(EFFECTS)))
    seen: Counter[Canonical] = Counter()
    for data in sorted(people):
        one = rearrange(data, seed, seen[data])
        if not seen[data]:
            found[data] = _effects(one, none_offered=none_offered)
        pairs += one.pairs
        excess += one.excess
        seen[data] += 1
    together = _effects(Rearranged(pairs=pairs, excess=excess), none_offered=none_offered)
    return tuple(found[data] for data in people), together


def _effects(found: Rearranged, *, none_offered: bool) -> SerialEffects:
    return SerialEffects(
        correct=_effect(found, "correct"),
        felt=_effect(found, "felt", "" if none_offered else '"none" was not offered'),
        side=_effect(found, "side"),
    )


def _effect(found: Rearranged, name: str, reason: str = "") -> SerialEffect:
    index = EFFECTS.index(name)
    again, other, yes, no = (int(count) for count in found.pairs[0, index])
    first, second = again + other, yes + no
    compared = name != "side"
    if reason:
        again = first = yes = second = 0
    elif not first + second:
        reason = "no two such trials follow each other"
    elif compared and not (first and second):
        reason = "all previous trials were alike"
    elif not compared and not found.pairs[:, index, 1].any():
        reason = "only one side was answered"
    drawn = found.pairs[1:, index].sum(axis=0)
    draws = int(drawn[0] + drawn[1])
    return SerialEffect(
        again=Share(count=again, of=first),
        otherwise=Share(count=yes, of=second) if compared else None,
        expected=int(drawn[0]) / draws if draws and not reason else None,
        p=None if reason else _two_sided(found.excess[:, index]),
        reason=reason,
    )


def _two_sided(excess: NDArray[np.float64]) -> float:
    slack = 1e-9 * (1 + abs(float(excess[0])))
    above = int(np.count_nonzero(excess[1:] >= excess[0] - slack))
    below = int(np.count_nonzero(excess[1:] <= excess[0] + slack))
    return min(1.0, 2 * (1 + min(above, below)) / (1 + DRAWS))
