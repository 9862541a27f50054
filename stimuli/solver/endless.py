"""The field of one load in an endless strip at given bending wavenumbers, in units of its width."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.solver.contour import contour
from stimuli.solver.guided import Guided, guided, near_cutoff
from stimuli.solver.source import Answered, Question, far_clearance, inside_excess, transformed

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.solver.contour import Contour
    from stimuli.solver.source import Source


_LEAST_DISTANCE: Final = 1e-8
"""Distances from a disc's centre are kept above this part of its radius: the two logarithms that
cancel there differ by less than rounding."""

EXTRA_WAVES: Final = 6
_FAINTEST: Final = 30.0
"""Nepers over which a wave that comes in from afar dies out before it counts."""

_LEAST_ROOM: Final = 1e-6
_TINY: Final = 0.06
"""Rounding grows as this over the size of a small load in widths."""

_FOLLOWING: Final = 8
"""Pairs of waves beyond the known ones that the estimates of the error look at."""

_CLOSEST: Final = 0.1
"""Relative distance of two waves below which their sum may be taken on a circle about both."""

_CAUTION, _UNSIGNED = 4.0, 0.1
"""What the sum of the errors of all waves and the sum of their amounts are multiplied with."""

_TIGHT: Final = 1e-6
_DOUBLE: Final = 40.0
"""Relative distance below which a pair acts on the error as one double wave, and its factor."""

_CIRCLE: Final = np.exp(2j * np.pi * (np.arange(32) + 0.5) / 32)
_EPS: Final = 6 * float(np.finfo(np.float64).eps)
"""Rounding error of a few operations."""

_CANCELLATION: Final = 6.0
"""Rounding of the waves grows as this times p W / (k W)^2 at low frequencies, where the branches
cancel."""

_EXACT_EPS: Final = float(np.finfo(np.longdouble).eps)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Waves:
    """The known waves of one symmetry, about the next ones, and what the load makes of them."""

    known: Guided  # are summed
    every: Guided  # these and those that follow, for the estimate of the error
    strength: Complex  # i Phi phi / N: (n_frequencies, n_every, n_points)

    @classmethod
    def of(cls, question: Question, sign: int, least: int = 0) -> Waves:
        """Return the waves of a load, no fewer than `least`."""
        count = max(n_waves(question.k), least)
        if np.isinf(question.hold).all():
            every = guided(question.exact_k, question.exact_hold, count + 2 * _FOLLOWING, sign)
            return cls._moved(question, every.first(count), every)
        known = guided(question.exact_k, question.exact_hold, count, sign, question.rtol)
        return cls.driven(question, known)

    @classmethod
    def driven(cls, question: Question, known: Guided) -> Waves:
        """Return what a load makes of waves."""
        return cls._moved(question, known, known.followed(question.k[:, np.newaxis], _FOLLOWING))

    @classmethod
    def _moved(cls, question: Question, known: Guided, every: Guided) -> Waves:
        k, n_known = question.k[:, np.newaxis], known.p.shape[1]
        strength = every.moved(k, question.source, question.across, n_known)
        return cls(known=known, every=every, strength=strength)

    def at(self, rows: slice) -> Waves:
        """Return the waves at some of the frequencies."""
        known, every = self.known.at(rows), self.every.at(rows)
        return Waves(known=known, every=every, strength=self.strength[rows])

    def among(self, points: NDArray[np.bool_]) -> Waves:
        """Return the waves with what the loads of some of the points make of them."""
        return replace(self, strength=self.strength[..., points])

    def terms(self, question: Question) -> Complex:
        """Return each wave at the points, shape (n_frequencies, n_every, n_points)."""
        along = question.source.along(self.every.p[..., np.newaxis], question.distance)
        return self.strength * along

    def incoming(self, question: Question) -> Waves | None:
        """Return the waves that propagate as they come in from afar, with opposite residues."""
        p, reach = self.known.p, float(np.max(question.distance)) + question.source.half_length
        running = (p.real > p.imag) & (p.imag * reach < _FAINTEST)
        if not running.any():
            return None
        some = running.any(axis=0)
        n = p.shape[1]
        strength = np.where(running[..., np.newaxis], -self.strength[:, :n], 0.0)[:, some]
        back = replace(
            self.known,
            p=np.where(running, -p, 1j)[:, some],
            g1=self.known.g1[:, some],
            g2=self.known.g2[:, some],
            branch=None if self.known.branch is None else self.known.branch[:, some],
        )
        return Waves(known=back, every=back, strength=strength)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Sum:
    """The part of one symmetry: its value, the known part of its error, and the rest's amount."""

    value: Complex
    drift: Complex
    error: Real


def solved(question: Question, signs: tuple[int, ...] = (1, -1), *, skip: bool = True) -> Answered:
    """Return D U / W^2 of a load at points, equations (47) to (50).

    Parameters
    ----------
    question : Question
        Load, points, wavenumbers and wanted error.
    signs : tuple of int
        Symmetries about the centre line that are computed: +1 symmetric, -1 antisymmetric.
    skip : bool
        Whether the integral is left out where the guided waves are enough.

    Returns
    -------
    Answered

    Examples
    --------
    A point force and a point of the strip may be exchanged:

    >>> from stimuli.solver.source import Source
    >>> from stimuli.solver.across import Span
    >>> def at(y0, y):
    ...     source = Source(span=Span(centre=y0))
    ...     question = Question(exact_k=np.array([2 + 0j]), exact_hold=np.array([0j]), rtol=1e-10,
    ...                         source=source, distance=np.array([0.4]), across=np.array([y]))
    ...     return solved(question).value
    >>> bool(abs(at(0.1, -0.3) / at(-0.3, 0.1) - 1) < 1e-10)
    True
    """
    return summed(question, [Waves.of(question, sign) for sign in signs], skip=skip)


def summed(question: Question, found: Iterable[Waves], *, skip: bool = True) -> Answered:
    """Return what `solved` does, from the waves of all symmetries."""
    value, drift = np.zeros((2, question.k.size, question.distance.size), dtype=np.complex128)
    error = np.zeros(value.shape)
    far = (question.clearance >= far_clearance(question.rtol)) & skip
    for waves in found:
        moved = question.lopsided if skip and waves.known.sign < 0 else np.ones_like(far)
        for points, method in ((far & moved, _far), (~far & moved, _near)):
            if points.any():
                some = (question, waves)
                if not points.all():
                    some = (question.at(points), waves.among(points))
                part = method(*some)
                value[:, points] += part.value
                drift[:, points] += part.drift
                error[:, points] += part.error
    error += _CAUTION * np.abs(drift.real if question.lossless else drift)
    source = question.source
    if source.radius:
        apart = _clipped(source, np.hypot(question.distance, question.across - source.span.centre))
        excess = inside_excess(question.k, source.radius, apart, moment=source.moment)
        value, error = value + excess, error + 8 * _EPS * np.abs(excess)
    return Answered(value=value, error=error)


def n_waves(k: Complex) -> int:
    """Return how many guided waves of one symmetry are found: all that propagate and some."""
    return int(np.max(k.real) / (2 * np.pi)) + EXTRA_WAVES


def _far(question: Question, waves: Waves) -> _Sum:
    """Return the sum over all known guided waves, equation (47)."""
    every, n = waves.terms(question), waves.known.p.shape[1]
    used = np.ones(waves.known.p.shape, dtype=np.bool_)
    terms = _together(every[:, :n], question, waves.known, used)
    error = _rounding(question, waves.known, terms)
    return _Sum(value=terms.sum(axis=1), drift=every[:, n:].sum(axis=1), error=error)


def _near(question: Question, waves: Waves) -> _Sum:
    """Return the guided waves below a path and the integral along it, (47) and (48)."""
    source, modes = question.source, waves.known
    finest = _finest(source)
    rtol = question.rtol * _room(question) ** 2
    nearest = max(float(np.min(question.distance)) - source.half_length, 0.0)
    path = contour(
        modes.p,
        rtol * math.exp(-float(np.max(np.abs(question.k))) * source.radius),
        finest=finest,
        nearest=0.0 if source.radius else nearest,
        mirrored=question.lossless,
        fall=1 if source.moment else 2,
    )
    every = waves.terms(question)
    alone = every[:, : modes.p.shape[1]]
    below = np.arange(alone.shape[1]) < path.n_below[:, np.newaxis]
    terms = _together(alone, question, modes, below)
    leaked = _leaked(question, path, waves, every=every, terms=terms)
    rest = _integral(question, path, modes.sign)
    terms = np.where(below[..., np.newaxis], terms, 0.0)
    pairs = np.abs(leaked[:, :-1] + leaked[:, 1:])
    amount = np.minimum(pairs[:, ::2].sum(axis=1), pairs[:, 1::2].sum(axis=1))
    error = rest.error + _UNSIGNED * amount + _rounding(question, modes, terms)
    error += _EPS * _TINY / finest * np.abs(rest.value)
    return _Sum(value=terms.sum(axis=1) + rest.value, drift=leaked.sum(axis=1), error=error)


def _finest(source: Source) -> float:
    """Return the least length of a load in widths, 1 of one at a point."""
    sizes = (2 * source.half_length, source.span.length, source.radius, 1.0)
    return min(size for size in sizes if size > 0)


def _room(question: Question) -> float:
    """Return how near to an edge load and points are, 1 for a quarter of the width.

    There sums cancel as its square, and waves of high order count.
    """
    off_centre = np.abs(question.across)
    inner = off_centre[off_centre < 0.5]  # noqa: PLR2004 - the edges are at rest
    off_centre = np.abs(question.source.span.centre)
    nearest = 0.5 - max(float(np.max(inner, initial=0.0)), float(np.max(off_centre)))
    return float(np.clip(4 * nearest, _LEAST_ROOM, 1.0))


def _leaked(
    question: Question, path: Contour, waves: Waves, *, every: Complex, terms: Complex
) -> Complex:
    """Return the error of the path's trapezoidal rule due to each wave, equation (52)."""
    modes = waves.known
    pair = np.abs(np.diff(modes.p, axis=1)) < _TIGHT * np.abs(modes.p[:, 1:])
    if modes.branch is None and pair.any():
        tight = np.zeros(modes.p.shape, dtype=np.bool_)
        tight[:, 1:] = pair
        tight[:, :-1] |= pair
        n = terms.shape[1]
        every[:, :n] = np.where(tight[..., np.newaxis], _DOUBLE * terms, every[:, :n])
    leaked = every * path.leak(waves.every.p)[..., np.newaxis]
    back = waves.incoming(question)
    if back is not None:  # they lie on the other side of the path
        mirrored = back.terms(question) * path.leak(back.every.p)[..., np.newaxis]
        leaked = np.concatenate([leaked, mirrored], axis=1)
    return leaked


def _together(
    alone: Complex, question: Question, modes: Guided, used: NDArray[np.bool_]
) -> Complex:
    """Return the terms with the sum of close pairs in the place of the first of each, (51).

    Between simple supports every wave is known by itself: each is one sine.
    """
    if modes.branch is not None:
        return alone
    close = np.abs(np.diff(modes.p, axis=1)) < _close(question.rtol) * np.abs(modes.p[:, 1:])
    rows, first = np.nonzero(close & used[:, 1:])
    if not rows.size:
        return alone
    p, pairs = modes.p[rows], np.arange(rows.size)
    one, two = p[pairs, first], p[pairs, first + 1]
    centre, apart = (one + two) / 2, np.abs(one - two)
    others = np.concatenate([p, -p], axis=1)
    others[pairs, first] = others[pairs, first + 1] = np.inf
    free = 0.25 * np.min(np.abs(others - centre[:, np.newaxis]), axis=1)
    radius = np.minimum(free[:, np.newaxis], 3 / (question.distance + 1e-9))
    turn = radius[:, np.newaxis] * _CIRCLE[:, np.newaxis]
    s = centre[:, np.newaxis, np.newaxis] + turn
    k, hold = (a[rows, np.newaxis, np.newaxis] for a in (question.k, question.hold))
    kernel, _ = transformed(
        s, k, hold, source=question.source, across=question.across, sign=modes.sign
    )
    ring = 1j * np.mean(kernel * turn * question.source.along(s, question.distance), axis=1)
    merged = radius > 2 * apart[:, np.newaxis]
    terms = alone.copy()
    terms[rows, first] = np.where(merged, ring, terms[rows, first])
    terms[rows, first + 1] = np.where(merged, 0.0, terms[rows, first + 1])
    return terms


def _close(rtol: float) -> float:
    """Return the relative distance of two waves below which rounding shows in their sum."""
    return float(min(_CLOSEST, math.sqrt(1e5 * _EPS / rtol)))


def _rounding(question: Question, modes: Guided, terms: Complex) -> Real:
    """Return the rounding error of the waves."""
    p = modes.p
    k2 = np.abs(question.k[:, np.newaxis]) ** 2
    size = np.abs(p)
    if modes.branch is None:
        apart = np.full(p.shape, np.inf)
        apart[:, 1:] = np.abs(np.diff(p, axis=1))
        apart[:, :-1] = np.minimum(apart[:, :-1], apart[:, 1:])
    else:  # from the other wave of the same order
        apart = k2 / size
    pairing = 1 + size / np.maximum(apart, 1e-12 * size)
    relative = _EPS * (2 * pairing + _CANCELLATION * size / k2)
    relative += _EPS * _TINY / _finest(question.source)
    relative += 4 * _EXACT_EPS * k2 / np.maximum(size, 1e-150) ** 2
    turning = _EPS * pairing * size
    if modes.lack:
        lack = np.where(near_cutoff(size**2, question.k[:, np.newaxis]), 0, modes.lack * pairing)
        relative += lack / np.maximum(size, 1e-150) ** 2
        turning += lack / np.maximum(size, 1e-150)
    turning = turning[..., np.newaxis] * question.distance
    return np.asarray((np.abs(terms) * (relative[..., np.newaxis] + turning)).sum(axis=1))


def _integral(question: Question, path: Contour, sign: int) -> Answered:
    """Return the integral along the path, equation (48)."""
    s = path.s[..., np.newaxis]
    k, hold = (a[:, np.newaxis, np.newaxis] for a in (question.k, question.hold))
    kernel, size = transformed(
        s, k, hold, source=question.source, across=question.across, sign=sign
    )
    logarithm = np.zeros((question.k.size, question.distance.size), dtype=np.complex128)
    cut = np.zeros(logarithm.shape)
    if question.source.radius:
        kernel, logarithm, cut = _without_logarithm(kernel, path, question, sign)
    along = question.source.along_fast(s, question.distance) * path.weight[..., np.newaxis]
    terms = kernel * along
    value = terms.sum(axis=1)
    if path.mirrored:
        value = value.real + 0j
    ends = np.maximum(np.abs(terms[:, -1]), 0.0 if path.mirrored else np.abs(terms[:, 0]))
    lost = 4 * (size * np.abs(along[:, ::4])).sum(axis=1) + np.abs(logarithm)
    return Answered(value=value + logarithm, error=4 * ends + cut + _EPS * lost)


def _without_logarithm(
    kernel: Complex, path: Contour, question: Question, sign: int
) -> tuple[Complex, Complex, Real]:
    """Take the logarithm at a disc's centre out of the kernel, equation (49).

    Returned are the rest, the logarithm, and what the rule errs by on what is taken out: it has no
    pole but a cut from m^ on, met as a wave of the decay m^ would be, (52).
    """
    from scipy.special import kv

    source = question.source
    one, two = source.branch_weights(question.k)
    strength = ((one - two) / (4 * question.k**2))[:, np.newaxis]
    m = path.ceiling[:, np.newaxis]
    root = np.sqrt(path.s**2 + m * m)[..., np.newaxis]
    logarithm = np.zeros((question.k.size, question.distance.size), dtype=np.complex128)
    for part, apart in (
        (1, question.across - source.span.centre),
        (sign, question.across + source.span.centre),
    ):
        spread = np.exp(-root * np.abs(apart)) / (2 * root)
        kernel = kernel - part * strength[..., np.newaxis] * spread
        r = _clipped(source, np.hypot(question.distance, apart))
        logarithm += part * strength * kv(0, m * r) / (2 * np.pi)
    cut = path.leak(np.asarray(1j * m, dtype=np.complex128))
    met = np.abs(strength) * np.abs(cut) * np.exp(-m * question.distance)
    return kernel, logarithm, met


def _clipped(source: Source, apart: Real) -> Real:
    return np.maximum(apart, _LEAST_DISTANCE * source.radius)
