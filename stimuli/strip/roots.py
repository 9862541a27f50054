"""Every root of the dispersion equation of strips with any edges, for one strip or many at once.

An eigenproblem of the truncated equation gives all low roots to a few digits, so that none is
missed; Newton's steps on the exact one, with the other roots as poles, then keep any two from
meeting. In the units of `stimuli.strip.waves`; equations (32) and (34) of docs/model.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from stimuli.strip.dispersion import relation
from stimuli.strip.waves import Section, outgoing_root, ratio

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real


_SPARE: Final = 6
"""Roots sought beyond those asked for: what they hide in the order is no more than a pair."""

_REACH: Final = 1.2
"""How far beyond the roots sought the modes of equation (32) are taken one by one."""

_STEPS: Final = 15
_SETTLED: Final = 1e-17
"""Square of the last step, as a part of the distance to the next root and of the root: the step
after it would change no digit."""

_NUDGE: Final = 1e-8
_NEAR_PAIR: Final = 1e-6

_PAIR: Final = 0.1
_WIDTHS: Final = (3e-3, 3e-4)
"""Pairs of starting values nearer than this are parted anew, in parabolas of these widths; both
times 1 + |a|, of which 2 pi is the usual distance of two roots."""

_SLIGHT: Final = 0.02
"""Imaginary part of the bending over 1 + |a|, and of the compliance over itself, that starting
values need not know."""

_LITTLE: Final = 1e-4
"""Bending below which its quotient in `_stiffness_below` is taken by the limit at 0."""

_CLAMPED_TOP: Final = 5.2 * (math.pi / 2) ** 2
"""Largest bending of the table between clamps: at 5.9 first cut-offs of the supported strip the
second wave meets the third."""

_CLAMPED_PAIRS: Final = 4
_CLAMPED_NODES: Final = 32
"""Of these the last coefficients are rounding: each falls to a quarter of the one before."""

_ROUNDING: Final = 1e-15
"""Part of the largest coefficient below which others are rounding, and would grow off the axis."""

_SLANT: Final = 0.01
"""Largest imaginary part of the bending, over itself: farther from the axis the series grows."""


def decays_squared(section: Section, count: int) -> Complex:
    """Return the squares x = -(p W / 2)^2 of the first waves, ordered by their p.

    Roots of `dispersion` by increasing Im p, then decreasing Re p, of edges that are not simply
    supported; without loss they are real or come in exactly conjugate pairs.

    Examples
    --------
    Clamped edges at rest: s + sin(s) = 0 for s = 2 sqrt(x) (Papkovich and Fadle):

    >>> x = decays_squared(Section(bending=0.0, compliance=0.0, symmetric=True), 2)
    >>> s = 2 * np.sqrt(x)
    >>> s.round(6), bool(np.all(abs(s + np.sin(s)) < 1e-13))
    (array([4.212392-2.250729j, 4.212392+2.250729j]), True)
    """
    bending, compliance = (np.array([complex(v)]) for v in (section.bending, section.compliance))
    x: Complex = section_roots(bending, compliance, count, symmetric=section.symmetric)[0]
    return x


def section_roots(
    bending: Complex,
    compliance: Complex,
    count: int,
    *,
    symmetric: bool,
    spare: int = _SPARE,
    settled: float = _SETTLED,
) -> Complex:
    """Return what `decays_squared` does for many sections, shape (n_sections, count).

    `spare` roots are sought beyond those, and half of them polished: the poles of the last ones.
    The others are `settled` where the next step would move them by no more than about that part.
    """
    found = starting_values(bending, compliance, count + spare, symmetric=symmetric)
    start = _ordered(found)[:, : count + (spare + 1) // 2]
    sections = _Sections(bending=bending, compliance=compliance, symmetric=symmetric)
    x = _polished(sections, start, count, settled)
    if not (bending.imag.any() or compliance.imag.any()):
        x = _mirrored(x, np.abs(bending)[:, np.newaxis])
    return _ordered(x)[:, :count]


def _ordered(x: Complex) -> Complex:
    p = outgoing_root(-x)
    values: Complex = x[np.arange(len(x))[:, np.newaxis], np.lexsort((-p.real, p.imag), axis=1)]
    return values


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Sections:
    """Sections of one symmetry, and the dispersion function of some of them."""

    bending: Complex
    compliance: Complex
    symmetric: bool

    def grip(self, rows: NDArray[np.intp]) -> Complex:
        """Return 1 / (1 + c), what the fixed slope counts."""
        return np.asarray(1 / (1 + self.compliance[rows]))

    def across(self, x: Complex, rows: NDArray[np.intp]) -> Real:
        """Return 1 + |a|, of which 2 pi is the usual distance of two roots."""
        return np.asarray(1 + np.sqrt(np.abs(x + self.bending[rows])))

    def at(self, x: Complex, rows: NDArray[np.intp]) -> tuple[Complex, Complex]:
        """Return function and slope at an x of each of the rows."""
        c = self.compliance[rows]
        weights = (c / (1 + c), 1 / (1 + c))
        return relation(x, self.bending[rows], weights, symmetric=self.symmetric)


def starting_values(
    bending: Complex, compliance: Complex, count: int, *, symmetric: bool
) -> Complex:
    """Return the roots of the truncated equation (32), as eigenvalues; too many of them.

    Shape (n_sections, n_roots), in no order. The first `count` waves are within 1e-2 of the
    distance between roots, with six more within about 1e-5.

    Examples
    --------
    >>> x = starting_values(np.zeros(1) + 0j, np.zeros(1) + 0j, 2, symmetric=True)
    >>> bool(np.min(abs(2 * np.sqrt(x) - (4.212392 + 2.250729j))) < 1e-3)
    True
    """
    # Each mode of (32) alone has (q^2 - x)^2 = z^2, and the edge couples them by a matrix of rank
    # one: the eigenvalues are all roots at once, of which a search might miss one.
    z: NDArray[np.inexact[Any]] = bending
    c: NDArray[np.inexact[Any]] = compliance
    if np.all(np.abs(z.imag) <= _SLIGHT * (1 + np.sqrt(np.abs(z)))) and np.all(
        np.abs(c.imag) <= _SLIGHT * np.abs(c)
    ):  # loss moves no root farther than the starting values are off
        z, c = z.real, c.real
    widest = complex(bending[np.argmax(abs(bending))])
    q, load = _modes(widest, count, 0.5 if symmetric else 0.0)
    # what the modes leave out is a constant, exact at one place below all poles
    known = 2 * load**2 / ((q**2 + z[:, np.newaxis] + 1) ** 2 - (z * z)[:, np.newaxis])
    rest = _stiffness_below(z, symmetric=symmetric) - np.sum(known, axis=1)
    with np.errstate(divide="ignore"):
        strength = 2 / (c + rest)
    size = len(q)
    matrix = np.zeros((z.size, 2 * size, 2 * size), dtype=strength.dtype)
    place = np.arange(size)
    matrix[:, place, place] = matrix[:, size + place, size + place] = q**2
    matrix[:, place, size + place] = 1
    matrix[:, size:, :size] = -strength[:, np.newaxis, np.newaxis] * np.outer(load, load)
    matrix[:, size + place, place] += (z * z)[:, np.newaxis]
    return np.linalg.eigvals(matrix).astype(np.complex128)


def _stiffness_below(z: NDArray[np.inexact[Any]], *, symmetric: bool) -> NDArray[np.inexact[Any]]:
    """Return the sum of (32) over all modes at x = -z - 1, [b T(b) - T(1)] / (2 z)."""
    b = np.sqrt(2 * z + 1)
    turn, unit = np.tanh(b), math.tanh(1.0)
    if not symmetric:
        turn, unit = 1 / turn, 1 / unit
    small = abs(z) < _LITTLE
    slope = unit + (1 - unit * unit)
    away = (b * turn - unit) / np.where(small, 1, 2 * z)
    return np.where(small, slope / 2, away)


def _modes(bending: complex, count: int, offset: float) -> tuple[Real, Real]:
    """Return q and the root of half the numerator of each term of (32), with its tail (34).

    Modes one by one as far as the roots sought reach, then two that stand for all the others:
    Gauss's rule in 1 / q over the tail, of which the middle node is the constant left out.
    """
    q = (np.arange(1, count + 1) - offset) * math.pi
    square = np.concatenate([q**2, q**2])
    supported = square + np.repeat([-bending, bending], count)
    first = np.argsort(outgoing_root(-supported).imag, kind="stable")[:count]
    last = math.sqrt(np.max(square[first]))
    q = (np.arange(1, 4 + int(_REACH * last / math.pi)) - offset) * math.pi
    nodes, weights = _tail_rule()
    edge = q[-1] + math.pi / 2
    far = edge / nodes[3:]
    return np.append(q, far), np.append(q, far * np.sqrt(weights[3:] * edge / math.pi) / nodes[3:])


@lru_cache(maxsize=1)
def _tail_rule() -> tuple[Real, Real]:
    return np.polynomial.legendre.leggauss(5)


def _polished(sections: _Sections, x: Complex, count: int, settled: float) -> Complex:
    """Return the roots next to starting values, no two of which find the same one.

    Newton's step with the other values as poles (Ehrlich, Aberth), started a little beside the
    real axis, where a real pair and a complex one do not meet.
    """
    x = _parted(sections, x) * (1 + _NUDGE * np.exp(1j * np.arange(x.shape[1])))
    rows, place = np.arange(x.shape[0]), np.arange(x.shape[1])
    for _ in range(_STEPS):
        some = x[rows]
        value, slope = sections.at(some, rows[:, np.newaxis])
        between = some[:, :, np.newaxis] - some[:, np.newaxis, :]
        between[:, place, place] = math.inf
        step = ratio(value, slope - value * ratio(1.0, between).sum(axis=2))
        x[rows] = some - step
        nearest = np.abs(between).min(axis=2)
        bending = np.abs(sections.bending[rows])[:, np.newaxis]
        moved = np.abs(step) ** 2 > settled * nearest * (np.abs(x[rows]) + bending)
        rows = rows[moved[:, :count].any(axis=1)]
        if not rows.size:
            break
    return _merged(sections, x)


def _parted(sections: _Sections, x: Complex) -> Complex:
    """Return starting values whose near pairs are those of the exact function.

    The starting values may part along the real axis where the roots part across it. Newton's
    steps n at two places m + h and m - h give the parabola (x - mean)^2 - square there.
    """
    rows, first, second = _near_pairs(x, _PAIR * sections.across(x, np.arange(len(x))[:, None]))
    if not rows.size:
        return x
    mean = (x[rows, first] + x[rows, second]) / 2
    across, half = sections.across(x[rows, first], rows), np.zeros_like(mean)
    for width in _WIDTHS:
        h = width * across
        above, below = (ratio(*sections.at(mean + shift, rows)) for shift in (h, -h))
        offset = ratio(2 * h * (h + below), below - above + 2 * h)
        mean, half = mean + h - offset, np.sqrt(offset * (offset - 2 * above))
    x = x.copy()
    x[rows, first], x[rows, second] = mean + half, mean - half
    return x


def _merged(sections: _Sections, x: Complex) -> Complex:
    """Return roots of which near pairs are as certain as they can be.

    Either of a pair is known to the root of the precision only; the mean, where the slope
    vanishes, and the square of the half distance, a value over a curvature, are known to all.
    """
    across = sections.across(x, np.arange(len(x))[:, None])
    rows, first, second = _near_pairs(x, _NEAR_PAIR * across)
    if not rows.size:
        return x
    mean, h = (x[rows, first] + x[rows, second]) / 2, _WIDTHS[1] * across[rows, first]
    for _ in range(3):
        curve = (sections.at(mean + h, rows)[1] - sections.at(mean - h, rows)[1]) / (2 * h)
        mean = mean - sections.at(mean, rows)[1] / curve
    value = sections.at(mean, rows)[0]
    noise = 4 * np.finfo(np.float64).eps * np.abs(sections.grip(rows)) / across[rows, first]
    half = np.sqrt(np.where(np.abs(value) < noise, 0, -2 * value / curve))
    x = x.copy()
    x[rows, first], x[rows, second] = mean + half, mean - half
    return x


def _near_pairs(
    x: Complex, distance: Real
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return row and places of values that are each other's nearest, and nearer than a distance."""
    between = np.abs(x[:, :, np.newaxis] - x[:, np.newaxis, :])
    place = np.arange(x.shape[1])
    between[:, place, place] = math.inf
    if not (between < distance[..., np.newaxis]).any():
        none = np.zeros(0, dtype=np.intp)
        return none, none, none
    partner = np.argmin(between, axis=2)
    mutual = np.take_along_axis(partner, partner, axis=1) == place
    near = mutual & (place < partner) & (np.min(between, axis=2) < distance)
    rows, first = np.nonzero(near)
    return rows, first, partner[rows, first]


def _mirrored(x: Complex, bending: Real) -> Complex:
    """Return roots of a real function as such: real, or in exactly conjugate pairs.

    Of a near pair the mean and the square of the half distance are real, whichever it is.
    """
    # Rounding gives real roots imaginary parts, by which a wave that does not decay would grow or
    # decay: without loss the symmetry is exact, and is put back.
    x = x.copy()
    near = _NEAR_PAIR * (np.abs(x) + bending)
    rows, first, second = _near_pairs(x, near)
    one, two = x[rows, first], x[rows, second]
    mean, half = (one + two).real / 2, (one - two) / 2
    half = np.sqrt((half**2).real.astype(np.complex128))
    x[rows, first], x[rows, second] = mean + half, mean - half
    distance = np.abs(x[:, :, np.newaxis] - x.conj()[:, np.newaxis, :])
    partner = np.argmin(distance, axis=2)
    paired = np.min(distance, axis=2) < near
    return np.where(paired, (x + np.take_along_axis(x, partner, axis=1).conj()) / 2, x)


def clamped_roots(bending: Complex, count: int, *, symmetric: bool) -> Complex | None:
    """Return the first roots between clamps from a table, or None beyond it.

    They depend on the bending alone, and means and squared half distances of pairs that meet only
    one another are smooth in its square, (86). Shape (n_sections, 8), pair by pair; without loss
    real or exactly conjugate.

    Examples
    --------
    >>> x = clamped_roots(np.zeros(1) + 0j, 2, symmetric=True)[0, :2]
    >>> s = 2 * np.sqrt(x)
    >>> s.round(6), bool(np.all(abs(s + np.sin(s)) < 1e-13))
    (array([4.212392-2.250729j, 4.212392+2.250729j]), True)
    """
    if count > 2 * _CLAMPED_PAIRS or np.any(np.abs(bending) > _CLAMPED_TOP):
        return None
    if np.any(np.abs(bending.imag) > _SLANT * np.abs(bending.real)):
        return None
    lossless = not bending.imag.any()
    place = 2 * ((bending.real if lossless else bending) / _CLAMPED_TOP) ** 2 - 1
    turns = np.multiply.outer(np.arccos(place), np.arange(_CLAMPED_NODES))
    found = np.cos(turns) @ _clamped_table(symmetric=symmetric)
    mean, half = found[:, :_CLAMPED_PAIRS], np.sqrt(found[:, _CLAMPED_PAIRS:].astype(np.complex128))
    roots = np.stack([mean - half, mean + half], axis=2)
    return np.asarray(roots.reshape(len(bending), -1), dtype=np.complex128)


@lru_cache(maxsize=2)
def _clamped_table(*, symmetric: bool) -> Real:
    """Return coefficients of means and squared half distances, shape (n_nodes, 2 n_pairs)."""
    odd = 2 * np.arange(_CLAMPED_NODES) + 1
    bending = np.asarray(_CLAMPED_TOP * np.cos(np.pi * odd / (4 * _CLAMPED_NODES)), np.complex128)
    x = section_roots(bending, np.zeros_like(bending), 2 * _CLAMPED_PAIRS, symmetric=symmetric)
    one, two = x[:, ::2], x[:, 1::2]
    values = np.concatenate([(one + two).real / 2, ((one - two) ** 2).real / 4], axis=1)
    turns = np.multiply.outer(np.arange(_CLAMPED_NODES), odd) % (4 * _CLAMPED_NODES)
    series = np.cos(np.pi * turns / (2 * _CLAMPED_NODES))
    series[0] /= 2
    found = 2 / _CLAMPED_NODES * series @ values
    return np.where(np.abs(found) < _ROUNDING * np.max(np.abs(found), axis=0), 0.0, found)
