"""The dispersion equation of a strip with any edges, and every root of it.

In the units of `stimuli.strip.waves`; equations (31) to (34) of docs/model.md.
"""

from __future__ import annotations

import cmath
import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from stimuli.strip.waves import Section, cross_waves, outgoing_root, ratio, scaled_sinc

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real


_SPARE: Final = 6
"""Roots sought beyond those asked for: what they hide in the order is no more than a pair."""

_REACH: Final = 1.2
"""How far beyond the roots sought the modes of equation (32) are taken one by one."""

_STEPS: Final = 15
_SETTLED: Final = 1e-13
_NUDGE: Final = 1e-8
_NEAR_PAIR: Final = 1e-6

_PAIR: Final = 0.1
_WIDTHS: Final = (3e-3, 3e-4)
"""Pairs of starting values nearer than this are parted anew, in parabolas of these widths; both
times 1 + |a|, of which 2 pi is the usual distance of two roots."""

_SMALL: Final = 1e-4


def dispersion(section: Section, x: Complex) -> tuple[Complex, Complex]:
    """Return the dispersion function and its derivative, equations (31) and (33).

    It is an entire function of x whose roots are the waves of the strip, and it has no others.

    Parameters
    ----------
    section : Section
        Strip, frequency and symmetry.
    x : ndarray of complex128
        Decays squared, -(p W / 2)^2.

    Returns
    -------
    value, slope : ndarray of complex128, shape of `x`
        Both times exp(i (a + b)) / (1 + c), which keeps them from overflow.

    Examples
    --------
    On simple supports the roots are (n pi / 2)^2 - z and (n pi / 2)^2 + z:

    >>> supported = Section(bending=1.0, compliance=math.inf, symmetric=True)
    >>> value, _ = dispersion(supported, np.array([math.pi**2 / 4 - 1, math.pi**2 / 4 + 1, 5.0]))
    >>> (abs(value) < 1e-15).tolist()
    [True, True, False]
    """
    slack, grip = section.weights
    waves = cross_waves(x, section.bending)
    a, b, apart = waves.a, waves.b, waves.apart
    cos_a, cos_b = _scaled_cosine(a), _scaled_cosine(b)
    sinc_a, sinc_b = scaled_sinc(a), scaled_sinc(b)
    sinc_s = scaled_sinc(waves.total)
    sinc_d = np.exp(2j * b) * scaled_sinc(waves.difference)
    twist = np.where(
        apart,
        (sinc_d - sinc_s) / np.where(apart, 2 * a * b, 1),
        ratio(sinc_a * cos_b - sinc_b * cos_a, np.where(apart, 1, waves.gap)),
    )
    if section.symmetric:
        value = slack * cos_a * cos_b + grip * (sinc_s + sinc_d) / 2
        bend = grip * (twist - sinc_a * sinc_b)
        return value, (bend - slack * (sinc_a * cos_b + cos_a * sinc_b)) / 2
    slope_a, slope_b = _sinc_slope(a, cos_a, sinc_a), _sinc_slope(b, cos_b, sinc_b)
    twist_slope = np.where(
        apart,
        ((sinc_a - cos_a) * cos_b - a**2 * twist) / np.where(apart, 2 * (a * b) ** 2, 1),
        ratio(slope_a * cos_b - slope_b * cos_a, np.where(apart, 1, waves.gap)),
    )
    value = slack * sinc_a * sinc_b + grip * twist
    return value, slack * (slope_a * sinc_b + sinc_a * slope_b) + grip * twist_slope


def _scaled_cosine(angle: Complex) -> Complex:
    """Return exp(i t) cos(t)."""
    turn: Complex = np.exp(2j * angle)
    return (turn + 1) / 2


def _sinc_slope(root: Complex, cosine: Complex, sinc: Complex) -> Complex:
    """Return the derivative of sin(t) / t by t^2."""
    square = root**2
    small = abs(square) < _SMALL
    near = -sinc / 6 * (1 + square / 15)
    return np.where(small, near, (cosine - sinc) / (2 * np.where(small, 1, square)))


def decays_squared(section: Section, count: int) -> Complex:
    """Return the squares x = -(p W / 2)^2 of the first waves, ordered by their p.

    Parameters
    ----------
    section : Section
        Strip, frequency and symmetry; edges that are not simply supported.
    count : int
        How many roots.

    Returns
    -------
    ndarray of complex128, shape (count,)
        Roots of `dispersion`, by increasing Im p, then decreasing Re p; without loss they are
        real or come in exactly conjugate pairs.

    Examples
    --------
    Clamped edges at rest: s + sin(s) = 0 for s = 2 sqrt(x) (Papkovich and Fadle):

    >>> x = decays_squared(Section(bending=0.0, compliance=0.0, symmetric=True), 2)
    >>> s = 2 * np.sqrt(x)
    >>> s.round(6), bool(np.all(abs(s + np.sin(s)) < 1e-13))
    (array([4.212392-2.250729j, 4.212392+2.250729j]), True)
    """
    bending, compliance = (np.array([complex(v)]) for v in (section.bending, section.compliance))
    found = starting_values(bending, compliance, count + _SPARE, symmetric=section.symmetric)
    start = _ordered(found[0])
    roots = _polished(section, start[: count + _SPARE // 2])
    if complex(section.bending).imag == 0 and complex(section.compliance).imag == 0:
        roots = _mirrored(roots)
    return _ordered(roots)[:count]


def _ordered(x: Complex) -> Complex:
    p = outgoing_root(-x)
    return x[np.lexsort((-p.real, p.imag))]


def starting_values(
    bending: Complex, compliance: Complex, count: int, *, symmetric: bool
) -> Complex:
    """Return the roots of the truncated equation (32), as eigenvalues; too many of them.

    Parameters
    ----------
    bending, compliance : ndarray of complex128, shape (n_sections,)
        z and c of `Section`; not simply supported.
    count : int
        How many roots are sought in each section.
    symmetric : bool
        Symmetry of the waves.

    Returns
    -------
    ndarray of complex128, shape (n_sections, n_roots)
        Squares x in no order. The first `count` waves are within 1e-2 of the distance between
        roots, with six more within about 1e-5.

    Examples
    --------
    >>> x = starting_values(np.zeros(1) + 0j, np.zeros(1) + 0j, 2, symmetric=True)
    >>> bool(np.min(abs(2 * np.sqrt(x) - (4.212392 + 2.250729j))) < 1e-3)
    True
    """
    z: NDArray[np.inexact[Any]] = bending
    c: NDArray[np.inexact[Any]] = compliance
    if not (np.any(z.imag) or np.any(c.imag)):
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
    small = abs(z) < _SMALL
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


def _polished(section: Section, x: Complex) -> Complex:
    """Return the roots next to starting values, no two of which find the same one.

    Newton's step with the other values as poles (Ehrlich, Aberth), started a little beside the
    real axis, where a real pair and a complex one do not meet.
    """
    x = _parted(section, x) * (1 + _NUDGE * np.exp(1j * np.arange(len(x))))
    for _ in range(_STEPS):
        value, slope = dispersion(section, x)
        poles = ratio(np.ones((1, 1), dtype=np.complex128), x[:, np.newaxis] - x)
        step = ratio(value, slope - value * np.sum(poles, axis=1))
        x = x - step
        if np.all(abs(step) <= _SETTLED * (abs(x) + abs(section.bending))):
            break
    return _merged(section, x)


def _parted(section: Section, x: Complex) -> Complex:
    """Return starting values whose near pairs are those of the exact function.

    The starting values may part along the real axis where the roots part across it. Newton's
    steps n at two places m + h and m - h give the parabola (x - mean)^2 - square there.
    """
    across = 1 + np.sqrt(abs(x + section.bending))
    first, second = _near_pairs(x, _PAIR * across)
    if not len(first):
        return x
    mean = (x[first] + x[second]) / 2
    half = np.zeros_like(mean)
    for width in _WIDTHS:
        h = width * across[first]
        above, below = (ratio(*dispersion(section, mean + shift)) for shift in (h, -h))
        offset = ratio(2 * h * (h + below), below - above + 2 * h)
        mean, half = mean + h - offset, np.sqrt(offset * (offset - 2 * above))
    x = x.copy()
    x[first], x[second] = mean + half, mean - half
    return x


def _merged(section: Section, x: Complex) -> Complex:
    """Return roots of which near pairs are as certain as they can be.

    Either of a pair is known to the root of the precision only; the mean, where the slope
    vanishes, and the square of the half distance, a value over a curvature, are known to all.
    """
    across = 1 + np.sqrt(abs(x + section.bending))
    first, second = _near_pairs(x, _NEAR_PAIR * across)
    if not len(first):
        return x
    mean, h = (x[first] + x[second]) / 2, _WIDTHS[1] * across[first]
    for _ in range(3):
        curve = (dispersion(section, mean + h)[1] - dispersion(section, mean - h)[1]) / (2 * h)
        mean = mean - dispersion(section, mean)[1] / curve
    value = dispersion(section, mean)[0]
    noise = 4 * np.finfo(np.float64).eps * abs(section.weights[1]) / across[first]
    half = np.sqrt(np.where(abs(value) < noise, 0, -2 * value / curve))
    x = x.copy()
    x[first], x[second] = mean + half, mean - half
    return x


def _near_pairs(
    x: Complex, distance: NDArray[np.floating]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the places of values that are each other's nearest, and nearer than a distance."""
    between = abs(x[:, np.newaxis] - x)
    np.fill_diagonal(between, math.inf)
    partner = np.argmin(between, axis=1)
    place = np.arange(len(x))
    near = (partner[partner] == place) & (place < partner) & (np.min(between, axis=1) < distance)
    return place[near], partner[near]


def _mirrored(x: Complex) -> Complex:
    """Return roots of a real function as such: real, or in exactly conjugate pairs.

    Of a near pair the mean and the square of the half distance are real, whichever it is.
    """
    x = x.copy()
    first, second = _near_pairs(x, _NEAR_PAIR * abs(x))
    mean, half = (x[first] + x[second]).real / 2, (x[first] - x[second]) / 2
    half = np.sqrt((half**2).real.astype(np.complex128))
    x[first], x[second] = mean + half, mean - half
    distance = abs(x[:, np.newaxis] - x.conj())
    partner = np.argmin(distance, axis=1)
    paired = np.min(distance, axis=1) < _NEAR_PAIR * abs(x)
    return np.where(paired, (x + x[partner].conj()) / 2, x)


def exceptional_bending(compliance: float) -> float:
    """Return z where the two slowest symmetric waves coalesce, equation (35).

    Parameters
    ----------
    compliance : float
        c = 2 D / (K W) of the edges, 0 to infinite, without loss.

    Returns
    -------
    float
        z = (k W / 2)^2; 0 for simply supported edges, of which it is the limit.

    Examples
    --------
    It grows as the square root of the stiffness of a soft edge:

    >>> round(exceptional_bending(1e8) / exceptional_bending(1e10), 6)
    10.0
    """
    if math.isinf(compliance):
        return 0.0
    # the first mode alone, with the others as two constants
    z = math.sqrt(math.pi**2 / 2 / (compliance + 0.21727))
    y = 0.0131 * z**2 / (2 * compliance + 0.43454)
    for _ in range(_STEPS):
        step = 1e-6 * z
        here = _coalescence(compliance, y, z)
        by_y = (_coalescence(compliance, y + step, z) - here) / step
        by_z = (_coalescence(compliance, y, z + step) - here) / step
        change = np.linalg.solve(np.column_stack([by_y, by_z]), here)
        y, z = y - float(change[0]), z - float(change[1])
        if abs(change[1]) <= _SETTLED * z:
            break
    return z


def _coalescence(compliance: float, y: float, z: float) -> Real:
    """Return dispersion function and slope at x = (pi / 2)^2 + y, exact for small y and z too."""
    slack, grip = compliance / (1 + compliance), 1 / (1 + compliance)
    x, q = math.pi**2 / 4 + y, math.pi / 2
    a, b = cmath.sqrt(x + z), cmath.sqrt(x - z)
    cos_a, cos_b = -cmath.sin((y + z) / (a + q)), -cmath.sin((y - z) / (b + q))
    sinc_a, sinc_b, sinc_s, sinc_d = (
        cmath.sin(t) / t if t else 1.0 for t in (a, b, a + b, 2 * z / (a + b))
    )
    value = slack * cos_a * cos_b + grip * (sinc_s + sinc_d) / 2
    twist = (sinc_a * cos_b - sinc_b * cos_a) / (2 * z)
    slope = grip * (twist - sinc_a * sinc_b) - slack * (sinc_a * cos_b + cos_a * sinc_b)
    return np.array([value.real, slope.real / 2])
