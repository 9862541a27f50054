"""Whether an answer depends on the trial before it, beyond what the stimuli alone give."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.answers.information import DRAWS, seeded_by
from analysis.answers.sensitivity import Share

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    Integers = NDArray[np.int64]
    Truths = NDArray[np.bool_]


ANSWERS: Final = 6
"""Answers are coded 0 to 5: left, right, both, none, timeout, invalid; stimuli 0 to 3 likewise."""
_LEFT, _LEFT_OR_RIGHT, _FELT, _ANSWERED = 0, 2, 3, 4
_MIRROR = np.array([1, 0, 2, 3, 4, 5])
_MIRRORED = (_MIRROR[:4, None] * ANSWERS + _MIRROR[None, :]).astype(np.int8).ravel()
EFFECTS = ("correct", "felt", "side")

# Answers change places within a run of one stimulus. The order of stimuli is no cause of an effect
# then, whatever drew it, and a threshold that drifts moves little within a run. Shorter runs leave
# fewer answers to change places, and less to find an effect by.
RUN: Final = 5
"""Trials of one stimulus among which answers change places, at least; fewer if no more came."""
SPAN: Final = 30
"""Trials of the session that a run reaches over, about; more if it has to."""
FOLLOWING_Z: Final = -3.5
"""Levels that sink after a detected stimulus by as much as this follow from the answers."""
ADAPTIVE: Final = "the levels follow from the answers, as in a staircase"
_AHEAD = (1, 3)
_TELLING_P = 0.05
_BITS = 15
"""Of a number of a run's pairs; runs have at most some 60."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialEffect:
    """How often something comes again in the next trial.

    Attributes
    ----------
    again : Share
        It, where it was in the previous trial.
    otherwise : Share or None
        It, where it was not in the previous trial; ``None`` where there is no such thing.
    expected, expected_otherwise : float or None
        The shares `again` and `otherwise` that the stimuli as they came give: the answers to equal
        stimuli in random order.
    difference : float or None
        A difference of proportions, about 0 without an effect: `again` less `otherwise` within
        people and runs, beyond what the stimuli give; of the side `again` less `expected`.
    p : float or None
        Two-sided permutation probability.
    reason : str
        Why there is no probability; else empty.
    """

    again: Share
    otherwise: Share | None
    expected: float | None
    expected_otherwise: float | None
    difference: float | None
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
class Session:
    """The n trials of a session in their order."""

    codes: NDArray[np.int8]  # `ANSWERS` times the stimulus plus the answer: (n,)
    linked: Truths  # came directly after the one before it here: (n,)
    runs: NDArray[np.int32]  # as `runs` numbers them: (n,)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rearranged:
    """Pairs of one participant or a group, as observed (first) and in `DRAWS` random orders."""

    # for each of `EFFECTS` again yes and no, otherwise yes and no: (1 + DRAWS, 3, 4)
    pairs: Integers
    # numerator and denominator of Mantel and Haenszel's difference over runs: (1 + DRAWS, 3)
    excess: NDArray[np.float64]
    weight: NDArray[np.float64]


Canonical = tuple[tuple[bytes, bytes, bytes], ...]
"""Codes, links and runs of a participant's sessions, in an order not of names or sides."""


def runs(stimuli: Integers, blocks: Integers) -> NDArray[np.int32]:
    """Return for each trial of a session the number of its run, from 0 in the order they begin.

    A run has trials of one stimulus only: those of a block, or of as many blocks as give `RUN`
    of them, cut into pieces of at least `RUN` trials that reach over about `SPAN` or more.

    >>> runs(np.array([7, 4] * 30), np.repeat([1, 2], 30))[[0, 1, 28, 30, 31, 59]].tolist()
    [0, 1, 0, 2, 3, 3]
    >>> runs(np.zeros(64, int), np.ones(64, int))[[0, 31, 32, 63]].tolist()
    [0, 0, 1, 1]
    """
    number = np.zeros(len(stimuli), dtype=np.int64)
    pieces = itertools.chain.from_iterable(
        _pieces(np.flatnonzero(stimuli == one), blocks) for one in np.unique(stimuli)
    )
    for name, places in enumerate(sorted(pieces, key=lambda piece: int(piece[0]))):
        number[places] = name
    return number.astype(np.int32)


def _pieces(places: Integers, blocks: Integers) -> Iterable[Integers]:
    """Cut the places of one stimulus in a session into runs."""
    groups: list[Integers] = []
    fresh = places[:0]
    for own in np.split(places, np.flatnonzero(np.diff(blocks[places])) + 1):
        fresh = np.concatenate([fresh, own])
        if len(fresh) >= RUN:
            groups.append(fresh)
            fresh = places[:0]
    if len(fresh) and groups:
        groups[-1] = np.concatenate([groups[-1], fresh])
    elif len(fresh):
        groups.append(fresh)
    for group in groups:
        reach = int(group[-1] - group[0]) + 1
        yield from np.array_split(group, max(1, min(len(group) // RUN, reach // SPAN)))


def canonical(sessions: Iterable[Session]) -> Canonical:
    """Write the sessions of a participant so that neither names nor left and right matter.

    >>> linked, same = np.array([False, True]), np.array([0, 0], np.int32)
    >>> one = Session(codes=np.array([0, 1], np.int8), linked=linked, runs=same)
    >>> mirrored = Session(codes=np.array([7, 6], np.int8), linked=linked, runs=same)
    >>> canonical([one]) == canonical([mirrored])
    True
    """
    every = [(one.codes, one.linked.tobytes(), one.runs.tobytes()) for one in sessions]
    plain = sorted((codes.tobytes(), *more) for codes, *more in every)
    mirrored = sorted((_MIRRORED[codes].tobytes(), *more) for codes, *more in every)
    return tuple(min(plain, mirrored))


def rearrange(data: Canonical, seed: int, occurrence: int = 0) -> Rearranged:
    """Count pairs as observed and with the answers of each run in random order.

    The stimuli stay as they came. Runs of one length share a set of orders and take them in an
    order of their own. Seed and occurrence are those of `seeded_by`.
    """
    sizes = np.array([len(data), *(len(codes) for codes, *_ in data)], dtype="<i8").tobytes()
    rng = seeded_by(sizes + b"".join(itertools.chain.from_iterable(data)), seed, occurrence)
    found = Rearranged(
        pairs=np.zeros((1 + DRAWS, len(EFFECTS), 4), dtype=np.int64),
        excess=np.zeros((1 + DRAWS, len(EFFECTS))),
        weight=np.zeros((1 + DRAWS, len(EFFECTS))),
    )
    for told, links, numbers in data:
        codes = np.frombuffer(told, np.int8).astype(np.int16)[:, None]
        run, linked = np.frombuffer(numbers, np.int32), np.frombuffer(links, np.bool_)
        drawn = np.tile(codes, 1 + DRAWS)
        for places in _by_run(run):
            if len(np.unique(codes[places])) > 1:
                order = _orders(len(places), seed)[:, rng.permutation(DRAWS)]
                drawn[places, 1:] = codes[places, 0][order]
        _add_pairs(found, drawn, linked, run)
    return found


@lru_cache(maxsize=64)
def _orders(size: int, seed: int) -> Integers:
    """Return random orders of so many answers, shape (size, DRAWS)."""
    rng = seeded_by(size.to_bytes(8, "little"), seed)
    orders = rng.random((size, DRAWS)).argsort(axis=0)
    orders.flags.writeable = False
    return orders


def _by_run(run: NDArray[np.integer]) -> list[Integers]:
    order = np.argsort(run, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(run[order])) + 1)


def _add_pairs(
    found: Rearranged, codes: NDArray[np.int16], linked: Truths, run: NDArray[np.int32]
) -> None:
    """Add the pairs of each effect in each order, and those beyond each run's own shares."""
    rows = np.flatnonzero(linked)
    if not len(rows):
        return
    rows = rows[np.argsort(run[rows], kind="stable")]
    starts = np.flatnonzero(np.diff(run[rows], prepend=-1))
    pairs = (codes[rows - 1] * np.int16(_MIRRORED.size) + codes[rows]).astype(np.intp)
    for index, words in enumerate(_packed_counts()):
        told = np.add.reduceat(words.take(pairs, mode="clip"), starts, axis=0).view(np.int64)
        of, firsts, seconds, again = (told >> _BITS * place & 2**_BITS - 1 for place in range(4))
        share = firsts / np.maximum(of, 1)
        found.excess[:, index] += (again - seconds * share).sum(axis=0)
        found.weight[:, index] += (firsts - firsts * share).sum(axis=0)
        of, firsts, seconds, again = (one.sum(axis=0) for one in (of, firsts, seconds, again))
        other, yes = firsts - again, seconds - again
        no = of - firsts - yes
        if EFFECTS[index] == "side":  # the same side again is right after right, too
            again, other, yes, no = again + no, other + yes, 0 * yes, 0 * no
        found.pairs[:, index] += np.stack([again, other, yes, no], axis=1)


@cache
def _packed_counts() -> list[NDArray[np.uint64]]:
    """Return for each of `EFFECTS` what each pair of codes counts for, four numbers in a word.

    Whether it counts, it was so in the first, in the second, and in both of its trials.
    """
    each = np.arange(_MIRRORED.size)
    before, now = (one.ravel() for one in np.meshgrid(each, each, indexing="ij"))
    (_, answer_before), (stimulus, answer) = (np.divmod(one, ANSWERS) for one in (before, now))
    correct = (each // ANSWERS) == (each % ANSWERS)
    single = stimulus < _LEFT_OR_RIGHT
    answered = (answer < _ANSWERED) & (answer_before < _ANSWERED)
    sided = (answer < _LEFT_OR_RIGHT) & (answer_before < _LEFT_OR_RIGHT)
    effects = (
        (single, correct[before], correct[now]),
        (single & answered, answer_before < _FELT, answer < _FELT),
        (sided, answer_before == _LEFT, answer == _LEFT),
    )
    shifts = _BITS * np.arange(4, dtype=np.uint64)[:, None]
    return [
        (np.stack([valid, valid & one, valid & two, valid & one & two]) << shifts).sum(axis=0)
        for valid, one, two in effects
    ]


def following_z(
    levels: NDArray[np.float64], detected: Truths, run: Integers, linked: Truths
) -> float:
    """Return by how many standard deviations levels rise after a detected stimulus.

    Mantel's test, as of a drift: the sum of detected x (rank of the next level) beyond what each
    run gives, or of the mean rank of the next three, as staircases take turns: the lower one. About
    0 where levels were drawn beforehand, far below it in a staircase.

    All of shape (n,), sessions one after the other: level (nan where no single stimulus came),
    whether it was detected, a number for each run of each session, whether it came directly after
    the one before it.
    """
    return min(
        _mantel_z(
            np.where(np.isnan(levels), np.nan, _ranks_ahead(levels, linked, most)), detected, run
        )
        for most in _AHEAD
    )


def _mantel_z(ahead: NDArray[np.float64], detected: Truths, run: Integers) -> float:
    told = np.flatnonzero(~np.isnan(ahead))
    if not len(told):
        return 0.0
    told = told[np.argsort(run[told], kind="stable")]
    starts = np.flatnonzero(np.diff(run[told], prepend=run[told[0]] - 1))
    sizes = np.diff(starts, append=len(told))
    away, hit = (
        one - np.repeat(np.add.reduceat(one, starts) / sizes, sizes)
        for one in (ahead[told], detected[told].astype(float))
    )
    free = np.maximum(sizes - 1, 1)
    variance = np.add.reduceat(away**2, starts) @ (np.add.reduceat(hit**2, starts) / free)
    return float(away @ hit / math.sqrt(variance)) if variance > 0 else 0.0


def _ranks_ahead(levels: NDArray[np.float64], linked: Truths, most: int) -> NDArray[np.float64]:
    """Return the mean rank of the single stimuli among the next trials; nan without any."""
    single = ~np.isnan(levels)
    ranks = np.unique(levels, return_inverse=True)[1].astype(float)
    total, number = np.zeros((2, len(levels)))
    reached = np.ones(len(levels), dtype=bool)
    for lag in range(1, most + 1):
        reached = reached[: len(levels) - lag] & linked[lag:]
        counts = reached & single[lag:]
        total[: len(counts)] += np.where(counts, ranks[lag:], 0.0)
        number[: len(counts)] += counts
    values: NDArray[np.float64] = np.where(number > 0, total, np.nan) / np.maximum(number, 1)
    return values


def serial_effects(
    people: Sequence[Canonical], seed: int, *, none_offered: bool, adaptive: bool = False
) -> tuple[tuple[SerialEffects, ...], SerialEffects]:
    """Return the effects of each participant and of all together.

    `people` come from `canonical`; their order and names change none of the values. Together the
    pairs are added up, each participant rearranged on their own. Without `none_offered` everything
    was felt. Of `adaptive` levels nothing can be told.

    Left and right in turn never come again:

    >>> codes = np.array([0, 1] * 10, np.int8)
    >>> one = Session(codes=codes, linked=np.arange(20) > 0, runs=np.zeros(20, np.int32))
    >>> (one,), together = serial_effects([canonical([one])], 0, none_offered=False)
    >>> one.side.again.p, one.side.p < 0.01, one.felt.reason, one == together
    (0.0, True, '"none" was not offered', True)
    """
    found: dict[Canonical, SerialEffects] = {}
    pairs = np.zeros((1 + DRAWS, len(EFFECTS), 4), dtype=np.int64)
    excess, weight = np.zeros((2, 1 + DRAWS, len(EFFECTS)))
    seen: Counter[Canonical] = Counter()
    reason = ADAPTIVE if adaptive else ""
    for data in sorted(people):
        one = rearrange(data, seed, seen[data])
        if not seen[data]:
            found[data] = _effects(one, reason, none_offered=none_offered)
        pairs += one.pairs
        excess += one.excess
        weight += one.weight
        seen[data] += 1
    every = Rearranged(pairs=pairs, excess=excess, weight=weight)
    together = _effects(every, reason, none_offered=none_offered)
    return tuple(found[data] for data in people), together


def _effects(found: Rearranged, reason: str, *, none_offered: bool) -> SerialEffects:
    return SerialEffects(
        correct=_effect(found, "correct", reason),
        felt=_effect(found, "felt", reason if none_offered else '"none" was not offered'),
        side=_effect(found, "side", reason),
    )


def _effect(found: Rearranged, name: str, reason: str) -> SerialEffect:
    index = EFFECTS.index(name)
    again, other, yes, no = (int(count) for count in found.pairs[0, index])
    first, second = again + other, yes + no
    compared = name != "side"
    if reason and reason != ADAPTIVE:
        again = first = yes = second = 0
    elif not first + second:
        reason = "no two such trials follow each other"
    elif compared and not (first and second):
        reason = "all previous trials were alike"
    elif not compared and not found.pairs[:, index, 1].any():
        reason = "only one side was answered"
    elif not reason and not _telling(found.excess[1:, index]):
        reason = "too few equal stimuli with different answers"
    share = Share(count=again, of=first)
    expected, expected_otherwise = (None, None) if reason else _expected(found.pairs[1:, index])
    beyond = float(
        (found.excess[0, index] - found.excess[1:, index].mean())
        / (found.weight[:, index].mean() or 1.0)
    )
    if not compared and share.p is not None and expected is not None:
        beyond = share.p - expected
    return SerialEffect(
        again=share,
        otherwise=Share(count=yes, of=second) if compared else None,
        expected=expected,
        expected_otherwise=expected_otherwise if compared else None,
        difference=None if reason else beyond,
        p=None if reason else _two_sided(found.excess[:, index]),
        reason=reason,
    )


def _expected(drawn: Integers) -> tuple[float | None, float | None]:
    """Return the shares `again` and `otherwise` over all orders that were drawn."""
    again, other, yes, no = (int(count) for count in drawn.sum(axis=0))
    return (
        again / (again + other) if again + other else None,
        yes / (yes + no) if yes + no else None,
    )


def _telling(drawn: NDArray[np.float64]) -> bool:
    """Tell whether the rarest of the orders could have had a small probability."""
    ends = (np.append(end, drawn) for end in (drawn.min(), drawn.max()))
    return min(_two_sided(one) for one in ends) < _TELLING_P


def _two_sided(excess: NDArray[np.float64]) -> float:
    slack = 1e-9 * (1 + abs(float(excess[0])))
    above = int(np.count_nonzero(excess[1:] >= excess[0] - slack))
    below = int(np.count_nonzero(excess[1:] <= excess[0] + slack))
    return min(1.0, 2 * (1 + min(above, below)) / (1 + DRAWS))
