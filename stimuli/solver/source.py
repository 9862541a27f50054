"""One load in widths: what is asked of the solver for it, and its transform along the strip."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.solver.across import Span, crossing

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Exact, Real


LEAST_RTOL: Final = 1e-12
"""Least relative error that may be asked for."""

_SERIES_TERMS: Final = 12
_SHORTEST: Final = 0.02
"""Half length of a load in widths from which exponentials may be subtracted."""

_SERIES_REACH: Final = 3.0
"""Largest |k R| of the power series."""


def inside_excess(k: Complex, radius: float, distance: Real, *, moment: bool) -> Complex:
    """Return D U of a disc less that of its replacement by a source at its centre, (44), (50).

    Radius and distances r > 0 in widths, k times the width; shape (n_frequencies, n_points), 0 for
    r >= R. Both branches solve (lap +- k^2) w = -1 with w = dw/dr = 0 at r = R.

    Examples
    --------
    Without curvature nor value at the rim, the excess of a pressure is biharmonic inside:

    >>> excess = inside_excess(np.array([1e-3 + 0j]), 1.0, np.array([0.999, 2.0]), moment=False)
    >>> bool(abs(excess[0, 0]) < 1e-12), complex(excess[0, 1])
    (True, 0j)
    """
    value = np.zeros((k.size, distance.size), dtype=np.complex128)
    inside = np.flatnonzero(distance < radius)
    if not inside.size:
        return value
    ratio = distance[inside] / radius
    small = np.abs(k) * radius < _SERIES_REACH
    for method, rows in ((_series, np.flatnonzero(small)), (_closed, np.flatnonzero(~small))):
        if rows.size:
            value[np.ix_(rows, inside)] = method(k[rows], radius, ratio, moment=moment)
    return value


def _series(k: Complex, radius: float, ratio: Real, *, moment: bool) -> Complex:
    """Return the power series in k^4: w = w_0 -+ k^2 w_1 + k^4 w_2 ..., lap w_(j+1) = w_j."""
    terms = _rim_terms(ratio)
    power, first = (k * radius) ** 4, 0 if moment else 1
    scale = radius ** (2 if moment else 4)
    total = np.zeros((k.size, ratio.size), dtype=np.complex128)
    for j in range(_SERIES_TERMS - 2 + first, -1, -2):
        total = total * power[:, np.newaxis] + terms[j]
    return -scale * total


def _rim_terms(ratio: Real) -> Real:
    """Return w_j / R^(2j+2) at r / R, shape (_SERIES_TERMS, n_points)."""
    plain, logged = _rim_polynomials()
    even = ratio ** (2 * np.arange(_SERIES_TERMS + 1)[:, np.newaxis])
    value: Real = plain @ even + (logged @ even) * np.log(ratio)
    return value


@lru_cache(maxsize=1)
def _rim_polynomials() -> tuple[Real, Real]:
    """Return the powers of (r / R)^2 in each w_j, those alone and those times ln(r / R).

    w_0 solves lap w = -1, and all vanish with their slope at the rim.
    """
    alone, times_log = np.zeros((2, _SERIES_TERMS, _SERIES_TERMS + 1))
    powers = 2 * np.arange(_SERIES_TERMS + 1)
    plain, logged = np.zeros((2, _SERIES_TERMS + 1))
    plain[1] = -0.25
    for j in range(_SERIES_TERMS):
        value, slope = plain.sum(), (powers * plain + logged).sum()
        plain[0] -= value
        logged[0] -= slope
        alone[j], times_log[j] = plain, logged
        square = (powers + 2.0) ** 2
        raised_log = logged / square
        raised = (plain - 2 * (powers + 2) * raised_log) / square
        plain, logged = (np.concatenate([[0.0], a[:-1]]) for a in (raised, raised_log))
    return alone, times_log


def _closed(k: Complex, radius: float, ratio: Real, *, moment: bool) -> Complex:
    """Return the same in Bessel functions, for large discs."""
    from scipy.special import hankel1, iv, jv, kv

    z, k2 = (k * radius)[:, np.newaxis], (k * k)[:, np.newaxis]
    zr = z * ratio
    one = -1 + 0.5j * np.pi * z * (hankel1(1, z) * jv(0, zr) - jv(1, z) * hankel1(0, zr))
    two = 1 - z * (kv(1, z) * iv(0, zr) + iv(1, z) * kv(0, zr))
    return -(one + two) / (2 * k2) if moment else (one - two) / (2 * k2 * k2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A load in units of the width, at x = 0.

    Attributes
    ----------
    span : Span
        Where it acts across the strip, one for all points or one for each; a disc is a point at its
        centre, equation (44).
    half_length : float
        Half of its length along the strip, 0 for a point and a disc.
    radius : float
        Radius of a disc, else 0.
    moment : bool
        Whether it is a moment patch, else a force or pressure.
    """

    span: Span
    half_length: float = 0.0
    radius: float = 0.0
    moment: bool = False

    def branch_weights(self, k: Complex) -> tuple[Complex, Complex]:
        """Return what the load makes of plane waves of either branch, equations (42) and (44)."""
        one, two = disc_weights(k, self.radius) if self.radius else (1 + 0 * k, 1 + 0 * k)
        return (-k * k * one, k * k * two) if self.moment else (one, two)

    def along(self, s: Complex, distance: Real) -> Complex:
        """Return the load's factor for waves exp(i s |x|) at a distance from its centre, (43)."""
        c = self.half_length
        if c == 0:
            return np.exp(1j * s * distance)
        turn, inside = 1j * s, distance < c
        if inside.all():
            value = np.expm1(turn * (c - distance)) + np.expm1(turn * (c + distance))
            return np.asarray(value / turn)
        value = np.exp(turn * np.maximum(distance - c, 0.0)) * np.expm1(2 * c * turn)
        if inside.any():
            ways = c - distance[inside], c + distance[inside]
            some = np.broadcast_to(turn, value.shape)[..., inside]
            value[..., inside] = np.expm1(some * ways[0]) + np.expm1(some * ways[1])
        return np.asarray(value / turn)

    def along_fast(self, s: Complex, distance: Real) -> Complex:
        """Return `along` with fewer exponentials, where no s is so small that these cancel.

        Examples
        --------
        >>> source, s = Source(span=Span(centre=0.0), half_length=0.1), np.array([[2 + 1j], [9j]])
        >>> places = np.array([0.0, 0.04, 0.7])
        >>> bool(np.allclose(source.along_fast(s, places), source.along(s, places), rtol=1e-14))
        True
        """
        c = self.half_length
        if c < _SHORTEST:
            return self.along(s, distance)
        turn, inside = 1j * s, distance < c
        half, near = np.exp(turn * c), np.exp(turn * np.abs(distance - c))
        far = near * half * half
        if inside.any():
            far = np.where(inside, near, far)
            beside = inside & (distance > 0)
            if beside.any():
                far[..., beside] = np.exp(turn * (distance[beside] + c))
            near = np.where(inside, 2 - near, near)
        return np.asarray((far - near) / turn)


def disc_weights(k: Complex, radius: float) -> tuple[Complex, Complex]:
    """Return the integrals of plane waves of both branches over a disc, equation (44).

    Examples
    --------
    Long waves see the area only:

    >>> weights = disc_weights(np.array([1e-6 + 0j]), 0.5)
    >>> bool(np.allclose(weights, np.pi / 4))
    True
    """
    from scipy.special import iv, jv

    return 2 * np.pi * radius * jv(1, k * radius) / k, 2 * np.pi * radius * iv(1, k * radius) / k


def transformed(
    s: Complex, k: Complex, hold: Complex, *, source: Source, across: Real, sign: int
) -> tuple[Complex, Real]:
    """Return D U^ of one symmetry along the complex s plane, equations (39) to (42), in widths.

    All arguments broadcast, s as (..., n_s, n_places or 1) and none of it a pole; k not small, for
    (39) cancels as k^-2; hold = 1 / (kappa W). Beside it stands the amount of the terms that are
    summed, for every fourth s: what rounding counts.
    """
    k2 = k * k
    g1, g2 = both = np.sqrt(s * s + np.multiply.outer([-1, 1], k2))
    one, two = source.branch_weights(k)
    first, second = crossing(both, across, source.span, sign).split()
    part1, part2 = one * first.kernel, two * second.kernel
    value: Complex = part1 - part2
    terms: Real = np.abs(part1[..., ::4, :]) + np.abs(part2[..., ::4, :])
    if not np.isinf(hold).all():
        psi1, psi2 = first.shape / first.end, second.shape / second.end
        load1, load2 = one * first.load / first.end, two * second.load / second.end
        grip = 2 * (2 * k2 * hold + 2 * k2 / (g1 + g2) - sign * (second.lag - first.lag))
        psi, load = psi2 - psi1, (load2 - load1) / grip
        value -= psi * load
        lost = np.abs(load1 / grip) + np.abs(load) * (np.abs(first.lag / grip))
        terms += (np.abs(psi1 * load) + np.abs(psi) * lost)[..., ::4, :]
    return value / (2 * k2), terms / np.abs(2 * k2)


_LEAST_SPREAD: Final = 12.0
"""Decay per width of the last known wave against the first: 12.2 at the least, over all edges."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Question:
    """What is asked of one load, in units of the width.

    Attributes
    ----------
    exact_k : ndarray of complex, shape (n_frequencies,)
        Bending wavenumbers times the width, not small; long double counts near a cut-off.
    exact_hold : ndarray of complex, shape (n_frequencies,)
        1 / (kappa W): 0 for clamped, infinite for simply supported edges.
    source : Source
        The load.
    distance, across : ndarray of float64, shape (n_points,)
        |x| from the load's centre and Y of each point.
    rtol : float
        Wanted relative error.
    """

    exact_k: Exact | Complex
    exact_hold: Exact | Complex
    source: Source
    distance: Real
    across: Real
    rtol: float
    k: Complex = field(init=False)
    """Bending wavenumbers in double precision."""

    hold: Complex = field(init=False)
    """1 / (kappa W) in double precision."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "k", self.exact_k.astype(np.complex128))
        object.__setattr__(self, "hold", self.exact_hold.astype(np.complex128))

    def at(self, points: NDArray[np.bool_] | NDArray[np.intp]) -> Question:
        """Return the question for some of its points."""
        span = self.source.span.at(points)
        source = self.source if span is self.source.span else replace(self.source, span=span)
        distance, across = self.distance[points], self.across[points]
        return replace(self, source=source, distance=distance, across=across)

    def each(self) -> Iterator[tuple[Question, NDArray[np.bool_]]]:
        """Return the questions for loads in one place across each, and which points they have."""
        for span, points in self.source.span.each():
            some = np.broadcast_to(points, self.distance.shape)
            yield replace(self.at(some), source=replace(self.source, span=span)), some

    @property
    def lopsided(self) -> NDArray[np.bool_]:
        """Whether antisymmetric waves move each point."""
        return np.asarray((self.source.span.centre != 0) & (self.across != 0))

    @property
    def clearance(self) -> Real:
        """Distance along the strip from the load's end, negative beside it."""
        return self.distance - self.source.half_length - self.source.radius

    @property
    def lossless(self) -> bool:
        """Whether the field is real but for propagating waves."""
        held = self.hold[np.isfinite(self.hold)]
        return not (self.k.imag.any() or held.imag.any())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answered:
    """Values with an estimate of their error, both of shape (n_frequencies, n_points)."""

    value: Complex
    error: Real

    def sizes(self) -> Real:
        """Return what the errors are wanted relative to, of the shape of the values."""
        size = np.abs(self.value)
        return np.asarray(np.maximum(size, 1e-3 * np.max(size, axis=1, keepdims=True)))

    def relative(self) -> Real:
        """Return the greatest error as a part of what it is wanted of, for each frequency."""
        return np.asarray(np.max(self.error / np.maximum(self.sizes(), 1e-300), axis=1))


def far_clearance(rtol: float) -> float:
    """Return the distance from a load in widths beyond which the guided waves are enough.

    Examples
    --------
    >>> round(far_clearance(1e-6), 2)
    1.48
    """
    return (math.log(1 / rtol) + 4) / _LEAST_SPREAD


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ends:
    """The ends of a strip, and where loads and points are between them, in widths.

    Attributes
    ----------
    length : float
        Length of the strip; x = 0 is its middle.
    poisson_ratio : float
        Poisson's ratio.
    load, point : ndarray of float64, shape (n_pairs,)
        Their x.
    direct : ndarray of int, shape (n_pairs,)
        Which of a job's places relative to the load each pair is.
    """

    length: float
    poisson_ratio: float
    load: Real
    point: Real
    direct: NDArray[np.intp]

    def at(self, pairs: NDArray[np.bool_]) -> Ends:
        """Return the ends with some of the pairs."""
        return replace(
            self, load=self.load[pairs], point=self.point[pairs], direct=self.direct[pairs]
        )

    def loads(self, span: Span) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return which of the different loads each pair has, and one pair of each."""
        _, first, which = np.unique(
            self.load + 1j * span.centre, return_index=True, return_inverse=True
        )
        return which, first

    def detours(self, reach: float) -> Real:
        """Return by how much the shortest way over an end is longer than the direct one."""
        most = np.maximum(self.load + reach, self.point)
        least = np.minimum(self.load - reach, self.point)
        values: Real = np.maximum(self.length - 2 * np.maximum(most, -least), 0.0)
        return values
