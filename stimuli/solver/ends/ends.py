"""What the two free short ends of a finite strip add to the field, in units of its width.

Each end turns the waves of a load back: those that leave it and those that arrive leave no bending
moment and no shear force there. Between simple supports the guided waves are enough, each order
across the strip by itself; between edges that are held the corners need more, see
`stimuli.solver.ends.reflection`, and next to an end `stimuli.solver.ends.fitted`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.solver.endless import EXTRA_WAVES, n_waves
from stimuli.solver.ends.corners import close_pairs
from stimuli.solver.ends.fitted import fitted
from stimuli.solver.ends.reflection import FINE, Reflection, reflections
from stimuli.solver.guided import Guided, guided
from stimuli.solver.source import LEAST_RTOL, Answered, Ends, Question

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real


_EPS: Final = float(np.finfo(np.float64).eps)
_MOST_WAVES: Final = 48
"""Most waves of one symmetry that decay and are summed; nearer to an end they are not used."""

_STEP: Final = math.pi
"""Least mean increase of the decay from one wave of a symmetry to the next."""

_SPARE: Final = 6.0
_SOFTEST: Final = 1e18
"""1 / (kappa W) that stands for a simple support where the guided waves are not enough."""

_HELD_WAVES: Final = 2
"""Guided waves between held edges beyond those of the endless strip."""

_FINER_WAVES: Final = 4
"""And so many more where the wanted error is small."""

_MOST_SEEN: Final = 24
"""Most of them that come to a point between held edges; nearer to an end fields are fitted."""

_BEHIND: Final = 1
"""Waves that are taken at an end and come from nowhere, at the least."""

_DOUBT: Final = 2.0
"""What the difference from a model with fewer waves is multiplied with."""

_STRONGEST: Final = 30.0
"""Bound of what the ends make of a wave that decays, relative to it."""

_NO_NULL: Final = 0.3
"""Distance from a load in widths below which the field has no nulls."""


_ROWS: Final = 8
"""Frequencies at which the ends are solved at once."""

_POOR: Final = 10.0
"""Estimated part of the wanted error above which the ends are solved again."""

_FINER: Final = 1e-3
"""Part of the wanted error that is asked for then."""


class ResonanceError(ValueError):
    """A strip without loss has no finite field, to the last digit of its frequency."""


def with_ends(
    question: Question, ends: Ends, waves: tuple[Guided, ...], endless: Answered, *, skip: bool
) -> tuple[Answered, int]:
    """Return the field of a finite strip from that of the endless one, in portions.

    Beside it stands at how many frequencies the ends count.
    """
    value, error = endless.value[:, ends.direct], endless.error[:, ends.direct]
    order = np.argsort(np.abs(question.k))
    if skip:
        faint = faintness(question, ends, waves)
        used = np.any(faint > question.rtol, axis=1)
        error[~used] += faint[~used] * np.abs(value[~used])
        order = order[used[order]]
    for rows in np.array_split(order, max(-(-order.size // _ROWS), 1)):
        if not rows.size:
            break
        some = replace(
            question, exact_k=question.exact_k[rows], exact_hold=question.exact_hold[rows]
        )
        part = reflected(some, ends, tuple(one.at(rows) for one in waves))
        value[rows] += part.value
        error[rows] += part.error
        again = _POOR * some.rtol < Answered(value=value[rows], error=part.error).relative()
        if np.any(again) and some.rtol > LEAST_RTOL:
            finer = replace(
                some,
                exact_k=some.exact_k[again],
                exact_hold=some.exact_hold[again],
                rtol=max(some.rtol * _FINER, LEAST_RTOL),
            )
            signs = tuple(one.sign for one in waves)
            better = reflected(finer, ends, end_waves(finer, ends, signs))
            value[rows[again]] += better.value - part.value[again]
            error[rows[again]] += better.error - part.error[again]
    return Answered(value=value, error=error), int(order.size)


def end_waves(question: Question, ends: Ends, signs: tuple[int, ...]) -> tuple[Guided, ...]:
    """Return the guided waves of some symmetries that `faintness` and `reflected` take.

    Parameters
    ----------
    question : Question
        Load, places across, wavenumbers and wanted error; its distances are not used.
    ends : Ends
        The ends, and where the pairs are along the strip.
    signs : tuple of int
        Symmetries about the centre line that are computed.

    Returns
    -------
    tuple of Guided
    """
    if np.all(np.isinf(question.hold)):
        every = _wanted(question, ends)
        wanted = int(np.max(every[every <= _MOST_WAVES], initial=_HELD_WAVES))
    else:
        nearest = float(np.min([np.minimum(*way) for way in _ways(question, ends)]))
        seen = int(min(_digits(question.rtol) / (_STEP * max(nearest, 1e-9)), _MOST_SEEN))
        wanted = max(_HELD_WAVES, seen + 2 + _BEHIND - EXTRA_WAVES)
        wanted += _FINER_WAVES * (question.rtol < FINE)
    count = n_waves(question.k) + wanted
    asked = question.exact_k, question.exact_hold, count
    return tuple(guided(*asked, sign, question.rtol) for sign in signs)


def _digits(rtol: float) -> float:
    """Return the nepers over which a wave is gone that is left out."""
    return math.log(1 / rtol) + _SPARE


def _ways(question: Question, ends: Ends) -> list[tuple[Real, Real]]:
    """Return how far load and point of each pair are from the right and from the left end."""
    half, reach = ends.length / 2, question.source.half_length
    return [(half - side * ends.load - reach, half - side * ends.point) for side in (1, -1)]


def reflected(question: Question, ends: Ends, waves: tuple[Guided, ...]) -> Answered:
    """Return what the ends add to D U / W^2, equations (54) to (58) and (89).

    Parameters
    ----------
    question : Question
        Load, places across, wavenumbers and wanted error; its distances are not used.
    ends : Ends
        The ends, and where the pairs are along the strip.
    waves : tuple of Guided
        Those of `end_waves`.

    Returns
    -------
    Answered
        Shape (n_frequencies, n_pairs).

    Examples
    --------
    A load and a point may be exchanged:

    >>> from stimuli.solver.source import Source
    >>> from stimuli.solver.across import Span
    >>> def at(y0, y, x0, x):
    ...     question = Question(exact_k=np.array([2 + 0j]), exact_hold=np.array([0j]), rtol=1e-8,
    ...                 source=Source(span=Span(centre=y0)), distance=np.array([abs(x - x0)]),
    ...                 across=np.array([y]))
    ...     ends = Ends(length=2.0, poisson_ratio=0.3, load=np.array([x0]), point=np.array([x]),
    ...                 direct=np.array([0]))
    ...     return reflected(question, ends, end_waves(question, ends, (1, -1))).value
    >>> bool(abs(at(0.1, -0.3, 0.2, 0.7) / at(-0.3, 0.1, 0.7, 0.2) - 1) < 1e-6)
    True
    """
    value = np.zeros((question.k.size, question.across.size), dtype=np.complex128)
    error = np.zeros(value.shape)
    counts = {some.sign: _felt(question, ends, some) for some in waves}
    backs = _turning(question, ends, waves, counts)
    for some, moved in ((one, _moved(question, one)) for one in waves):
        by_waves = moved & (some.sign in backs) & (counts[some.sign] > 0)
        if by_waves.any():
            back = backs[some.sign]
            first = some.first(back.scale.shape[1])
            part = _turned_back(question.at(by_waves), ends.at(by_waves), first, back)
            value[:, by_waves] += part.value
            error[:, by_waves] += part.error
        for pairs, part in _fitted(question, ends, some, moved & ~by_waves):
            value[:, pairs] += part.value
            error[:, pairs] += part.error
    return Answered(value=value, error=error)


def _moved(question: Question, waves: Guided) -> NDArray[np.bool_]:
    """Return which pairs waves of a symmetry move."""
    return question.lopsided if waves.sign < 0 else np.ones(question.across.shape, np.bool_)


def _turning(
    question: Question, ends: Ends, waves: tuple[Guided, ...], counts: dict[int, NDArray[np.intp]]
) -> dict[int, Reflection]:
    """Return what an end makes of so many waves, by symmetry; nothing of those not enough."""
    some = tuple(one for one in waves if np.any(counts[one.sign]))
    if not some:
        return {}
    if some[0].branch is not None:
        return {one.sign: _works(question.k, one, ends.poisson_ratio) for one in some}
    count = max(int(np.max(counts[one.sign])) for one in some)
    k, hold, nu = question.k, question.hold, ends.poisson_ratio
    try:
        found = reflections(k, hold, some, nu, rtol=question.rtol, count=count)
    except np.linalg.LinAlgError:  # fields that depend on each other: a least-squares fit bears it
        return {}
    return {one.sign: back for one, back in zip(some, found, strict=True)}


def _fitted(
    question: Question, ends: Ends, waves: Guided, pairs: NDArray[np.bool_]
) -> Iterator[tuple[NDArray[np.bool_], Answered]]:
    """Yield what fields fitted to the ends add, for loads in one place across at a time."""
    if not np.any(pairs):
        return
    if waves.branch is not None:
        question = replace(question, exact_hold=np.full_like(question.exact_hold, _SOFTEST))
        waves = waves.first(n_waves(question.k) + _HELD_WAVES)
    for one, own in question.each():
        some = own & pairs
        if np.any(some):
            yield some, fitted(one.at(pairs[own]), ends.at(some), waves)


def _felt(question: Question, ends: Ends, waves: Guided) -> NDArray[np.intp]:
    """Return how many waves are felt at each point after a way over an end, 0 if too many are.

    The last one is fainter than the slowest on the direct way by all that is wanted: it tells
    what those beyond it would add.
    """
    if waves.branch is not None:
        return np.where(_wanted(question, ends) <= _MOST_WAVES, waves.p.shape[1], 0)
    if close_pairs(waves):
        return np.zeros(question.across.size, dtype=np.intp)
    decay, straight = waves.p.imag[..., np.newaxis], np.abs(ends.load - ends.point)
    slowest = decay[:, :1]
    one = np.concatenate([np.stack(way) for way in _ways(question, ends)])[:, np.newaxis]
    other = one[[1, 0, 3, 2]] - straight  # an end makes any wave of any other
    least = np.min([d * one + s * other for d, s in zip(decay, slowest, strict=True)], axis=(0, 1))
    felt = np.count_nonzero((least < _digits(question.rtol)) & _moved(question, waves), axis=0)
    counts = np.maximum(felt, 1) + 1
    return np.where(counts <= waves.p.shape[1] - _BEHIND, counts, 0)


def faintness(question: Question, ends: Ends, waves: tuple[Guided, ...]) -> Real:
    """Return how much the ends can add to the field as a part of it.

    Section 7 of docs/model.md: 30 exp(-d), d the decay of the slowest wave over the detour.

    Parameters
    ----------
    question : Question
        As for `reflected`, with the distance of each pair.
    ends : Ends
        The ends, and where the pairs are along the strip.
    waves : tuple of Guided
        Those of `end_waves`.

    Returns
    -------
    ndarray of float64, shape (n_frequencies, n_pairs)
        Where waves propagate without loss, at least 30.

    Examples
    --------
    Waves that decay over several widths to either end are not worth the trouble:

    >>> from stimuli.solver.source import Source
    >>> from stimuli.solver.across import Span
    >>> middle, source = np.array([0.0]), Source(span=Span(centre=0.0))
    >>> question = Question(exact_k=np.array([1 + 0j]), exact_hold=np.array([0j]), rtol=1e-6,
    ...                     source=source, distance=middle, across=middle)
    >>> def faint(length):
    ...     ends = Ends(length=length, poisson_ratio=0.3, load=middle, point=middle,
    ...                 direct=np.array([0]))
    ...     return faintness(question, ends, end_waves(question, ends, (1,)))
    >>> bool(faint(1.0) > 0.1), bool(faint(5.0) < 1e-6)
    (True, True)
    """
    detour = ends.detours(question.source.half_length + question.source.radius)
    decay = np.min([some.p.imag[:, 0] for some in waves], axis=0)
    nulls = np.maximum(math.log(1e3) - decay[:, np.newaxis] * question.distance, 0.0)
    nulls[:, question.distance < _NO_NULL] = 0.0
    return np.asarray(_STRONGEST * np.exp(nulls - decay[:, np.newaxis] * detour))


def _wanted(question: Question, ends: Ends) -> NDArray[np.intp]:
    """Return how many waves that decay reach the wanted error of each pair, supported edges."""
    way = ends.length - np.abs(ends.load + ends.point) - question.source.half_length
    count = _digits(question.rtol) / (_STEP * np.maximum(way, 1e-9))
    return np.minimum(count, 1e6).astype(np.intp)


def _turned_back(question: Question, ends: Ends, waves: Guided, back: Reflection) -> Answered:
    """Return the waves that the ends turn back, at the points, of one symmetry."""
    which, first = ends.loads(question.source.span)
    loads, source = ends.load[first], replace(question.source, span=question.source.span.at(first))
    p = waves.p[..., np.newaxis]
    k, scale = question.k[:, np.newaxis], back.scale[..., np.newaxis]
    strength = 1j * waves.excited(k, source) / (back.norms[..., np.newaxis] * scale)
    right, left = (
        (strength * source.along(p, ends.length / 2 + side * loads))[:, np.newaxis]
        for side in (-1, 1)
    )
    turns = 1j * p
    over = np.exp(np.swapaxes(turns, 1, 2) * ends.length)
    towards, away = (
        np.exp(turns * (ends.length / 2 + side * ends.point))[:, np.newaxis] for side in (-1, 1)
    )
    # what is even and what is odd about the middle, side by side
    mirror = np.array([1.0, -1.0])[:, np.newaxis, np.newaxis]
    comes = (right + mirror * left) / 2
    seen = (waves.shapes(question.across) * scale)[:, np.newaxis] * (towards + mirror * away)
    back_over = back.arriving * over
    matrix = back.leaving[:, np.newaxis] + mirror * back_over[:, np.newaxis]
    same = np.broadcast_to(np.eye(p.shape[1], dtype=np.complex128), matrix.shape)
    pushed = back.arriving[:, np.newaxis] @ comes
    both = _solved(matrix, np.concatenate([-pushed, same], axis=3))
    strengths, inverse = both[..., : loads.size], np.abs(both[..., loads.size :])
    terms = strengths[..., which] * seen
    value = terms.sum(axis=(1, 2))
    leaving, arriving = back.coarse
    fewer = leaving.shape[1]
    few_over = (arriving[..., :fewer] * over[..., :fewer])[:, np.newaxis]
    some = _solved(
        leaving[:, np.newaxis] + mirror * few_over,
        -arriving[:, np.newaxis] @ comes[:, :, : arriving.shape[2]],
    )
    rough = (some[..., which] * seen[:, :, :fewer]).sum(axis=(1, 2))
    sizes = np.abs(strengths)
    shaky = _EPS * (np.abs(back.leaving) + np.abs(back_over) * (1 + np.abs(p) * ends.length))
    met = np.abs(comes) + np.abs(np.swapaxes(over, 1, 2))[:, np.newaxis] * sizes
    shaken = inverse @ (shaky[:, np.newaxis] @ sizes + back.error[:, np.newaxis] @ met)
    lost = (shaken[..., which] * np.abs(seen)).sum(axis=(1, 2))
    size = np.abs(terms).sum(axis=(1, 2))
    # beside a resonance without loss what rounding makes of the matrix counts, not the sum's own
    error = _DOUBT * np.abs(value - rough) + 1e2 * _EPS * size + 4 * lost
    return Answered(value=value, error=error)


def _solved(matrix: Complex, pushed: Complex) -> Complex:
    """Return the solutions, or tell that there is none."""
    try:
        return np.linalg.solve(matrix, pushed).astype(np.complex128)
    except np.linalg.LinAlgError as error:
        raise ResonanceError("the ends turn back as much as arrives") from error


def _fewer(count: int) -> int:
    """Return the number of waves of the coarser model: even, not to part a pair."""
    return 2 * max(int(0.375 * count), 1)


def _works(k: Complex, waves: Guided, poisson_ratio: float) -> Reflection:
    """Return the virtual works of leaving and arriving waves on leaving ones, of sines.

    Row n, column m: int (V_m phi_n + i p_n M_m phi_n) dY at an end, equation (55), each row by
    itself to a factor: sines of other orders do no work on each other.
    """
    p = waves.p
    order = np.where(waves.branch == 1, waves.g1, waves.g2).imag
    row, column = p[..., np.newaxis], p[:, np.newaxis]
    same = np.abs(order[..., np.newaxis] - order[:, np.newaxis]) < 1
    bent = -(order[:, np.newaxis] ** 2)
    moment = same * (poisson_ratio * bent - column**2)
    shear = same * (1j * column * ((2 - poisson_ratio) * bent - column**2))
    leaving, arriving = 1j * row * moment - shear, 1j * row * moment + shear
    n = _fewer(p.shape[1])
    return Reflection(
        leaving=leaving,
        arriving=arriving,
        coarse=(leaving[:, :n, :n], arriving[:, :n]),
        error=np.zeros(leaving.shape),
        scale=math.sqrt(2) * (np.ones(order.shape) if waves.sign > 0 else order),
        norms=waves.norms(k[:, np.newaxis]),
    )
