"""The guided waves of an endless strip: wavenumbers, shapes and norms, for many frequencies.

Everything is in units of the strip's width W: k W, p W, kappa W, Y = y / W - 1/2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from stimuli.solver.across import faded, shape, shape_integral, slope
from stimuli.strip.dispersion import relation
from stimuli.strip.roots import clamped_roots, section_roots

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Exact, Real
    from stimuli.solver.source import Source


PI: Final = np.longdouble("3.14159265358979323846264338327950288")
_NEAR_CUTOFF: Final = 1e-2
_SPARE: Final = 1
"""Waves sought beyond those asked for: the last may be one of a pair. More would only cost time,
since what their order hides lies where the waves are faint."""

_ROUGH: Final = 1e-9
"""Wanted error from which a table is exact enough: where branches cancel it lacks 2e-13."""

_TABLE_LACK: Final = 5e-13
"""Most that p^2 of the table lacks, times 1 + |p| over the distance of two waves: 4.7e-13 was seen
of 160 000 sections, the first four waves."""

_SETTLED: Final = 1e-14
"""What the faintest wave may lack of its p^2; the others are known better."""

_NORM_NODES: Final = 48
_END: Final = np.array(0.5)
_ARCH: Final = 0.7
_ARCH_SERIES: Final = tuple(1 / math.factorial(n) for n in range(17, 1, -2))
"""|g| up to which (sinh(g) / g - 1) / g^2 is a series in g^2, and its coefficients."""

_LOW: Final = 2.0
"""2 (k W)^2 below which the closed form of the norms loses digits."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Guided:
    """Guided waves of one symmetry, the slowest decay first: arrays (n_frequencies, n_modes)."""

    p: Complex  # wavenumbers times W, outgoing
    g1: Complex  # decay constants across the strip, of both branches
    g2: Complex
    sign: int  # +1 symmetric, -1 antisymmetric
    # between simple supports, 1 or 2: which branch a wave is, all of it; else none
    branch: NDArray[np.int_] | None = None
    lack: float = 0.0  # of every p^2, beyond the rounding of a polished root

    @cached_property
    def weights(self) -> tuple[Complex, Complex]:
        """What of `shape` of either branch a wave is made of."""
        # A sine as the difference of both branches is 0/0 where orders n and m of either branch
        # meet, (n^2 - m^2) f_1 / 2, m = 0 included: so it is told which of them it is.
        if self.branch is None:
            one, two = (shape(g, _END, self.sign) for g in (self.g1, self.g2))
            return -two, one
        one, two = ((self.branch == i).astype(np.complex128) for i in (1, 2))
        return one, two

    def shapes(self, across: Real) -> Complex:
        """Return the shapes at places Y: shape (n_frequencies, n_modes, n_places)."""
        one, two = self._weighted(shape(self._both[..., np.newaxis], across, self.sign))
        return one + two

    def slopes(self, across: Real) -> Complex:
        """Return the derivatives of the shapes by Y."""
        one, two = self._weighted(slope(self._both[..., np.newaxis], across, self.sign))
        return one + two

    def excited(self, k: Complex, source: Source) -> Complex:
        """Return the load's integral over each shape, (n_frequencies, n_modes, n_points or 1)."""
        one, two = source.branch_weights(k)
        far, near = self._weighted(
            shape_integral(self._both[..., np.newaxis], source.span, self.sign)
        )
        return one[..., np.newaxis] * far + two[..., np.newaxis] * near

    @property
    def _both(self) -> Complex:
        """Decay constants of both branches, the first axis."""
        return np.stack([self.g1, self.g2])

    def _weighted(self, parts: Complex) -> tuple[Complex, Complex]:
        """Return what of both branches' parts, the first axis, a wave has."""
        one, two = self.weights
        return one[..., np.newaxis] * parts[0], two[..., np.newaxis] * parts[1]

    def strengths(self, k: Complex, source: Source, n_exact: int | None = None) -> Complex:
        """Return i Phi / N of (47), what a load makes of each wave; as `excited` and `norms`."""
        return self.excited(k, source) * (1j / self.norms(k, n_exact))[..., np.newaxis]

    def moved(
        self, k: Complex, source: Source, across: Real, n_exact: int | None = None
    ) -> Complex:
        """Return i Phi phi / N of (47), each wave at places Y: (n_frequencies, n_modes, n_places).

        Of sines, whose norm is +-2 p k^2, in closed form.
        """
        if self.branch is None:
            return self.strengths(k, source, n_exact) * self.shapes(across)
        first = self.branch == 1
        q = np.where(first, self.g1, self.g2).imag[..., np.newaxis]
        one, two = source.branch_weights(k)
        sine, span = np.cos if self.sign > 0 else np.sin, source.span
        seen = sine(q * across) * sine(q * ((span.low + span.high) / 2))
        if span.length:
            seen *= 2 / q * np.sin(q * ((span.high - span.low) / 2))
        return np.asarray(
            (np.where(first, one, -two) * 0.5j / (self.p * k * k))[..., np.newaxis] * seen
        )

    def at(self, rows: NDArray[np.intp] | slice) -> Guided:
        """Return the waves at some of the frequencies."""
        p, g1, g2 = self.p[rows], self.g1[rows], self.g2[rows]
        branch = None if self.branch is None else self.branch[rows]
        return Guided(p=p, g1=g1, g2=g2, sign=self.sign, branch=branch, lack=self.lack)

    def first(self, count: int) -> Guided:
        """Return the first waves."""
        p, g1, g2 = (a[:, :count] for a in (self.p, self.g1, self.g2))
        branch = None if self.branch is None else self.branch[:, :count]
        return Guided(p=p, g1=g1, g2=g2, sign=self.sign, branch=branch, lack=self.lack)

    def followed(self, k: Complex, n_pairs: int) -> Guided:
        """Return these waves and about those that follow, in pairs like the last two.

        Of simply supported edges p^2 = +-k^2 - q^2 with q in steps of 2 pi, of others nearly so:
        each second difference of p^2 is -8 pi^2.
        """
        if self.branch is not None:
            return self._joined(_supported(k[:, 0], self.p.shape[1] + 2 * n_pairs, self.sign))
        p, before = self.p[:, -2:], self.p[:, -4:-2]
        usual = np.abs(p - before - 2j * np.pi) < np.pi
        z, k2 = p * p, k * k
        step = z - np.where(usual, before, p - 2j * np.pi) ** 2
        ahead = np.arange(1, n_pairs + 1)[:, np.newaxis]
        z = z[:, np.newaxis] + ahead * step[:, np.newaxis] - 4 * np.pi**2 * ahead * (ahead + 1)
        z = z.reshape(k.shape[0], -1)
        more = (_outgoing(z), np.sqrt(z - k2), np.sqrt(z + k2))
        known = (self.p, self.g1, self.g2)
        p, g1, g2 = (np.concatenate(both, axis=1) for both in zip(known, more, strict=True))
        return Guided(p=p, g1=g1, g2=g2, sign=self.sign)

    def _joined(self, longer: Guided) -> Guided:
        """Return these waves and those that a longer list of sines has beyond them."""
        n, names = self.p.shape[1], ("p", "g1", "g2", "branch")
        found: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(longer, name)[:, n:]], axis=1)
            for name in names
        }
        return Guided(sign=self.sign, **found)

    def norms(self, k: Complex, n_exact: int | None = None) -> Complex:
        """Return N = 4 p int (p^2 phi^2 + phi'^2) dY, equation (46): bilinear, no conjugate.

        Of a sine it is +-4 p k^2 int phi^2 dY. The closed form of other shapes cancels as k^-4 and
        is taken where k W > 1, else a sum over nodes for the first `n_exact` waves (all, if it is
        None). `k` broadcasts with the waves.
        """
        if self.branch is not None:
            squares = [_overlap(g, g, self.sign)[0] for g in (self.g1, self.g2)]
            values: Complex = (
                4 * self.p * k * k * np.where(self.branch == 1, squares[0], -squares[1])
            )
            return values
        total = self._closed_norms()
        low = np.flatnonzero(2 * np.abs(np.broadcast_to(k, self.p.shape)[:, 0]) ** 2 < _LOW)
        if low.size:
            total[low, :n_exact] = self._summed_norms(low, n_exact)
        return 4 * self.p * total

    def _closed_norms(self) -> Complex:
        g, square = (self.g1, self.g2), self.p**2
        total = np.zeros_like(self.p)
        for i, j, factor in ((0, 0, 1), (0, 1, 2), (1, 1, 1)):
            value, slopes = _overlap(g[i], g[j], self.sign)
            total += factor * self.weights[i] * self.weights[j] * (square * value + slopes)
        return total

    def _summed_norms(self, rows: NDArray[np.intp], n_modes: int | None) -> Complex:
        nodes, weights = _half_rule()
        p, g1, g2 = (a[rows, :n_modes] for a in (self.p, self.g1, self.g2))
        some, across = Guided(p=p, g1=g1, g2=g2, sign=self.sign), nodes / 2
        value, slopes = p[..., np.newaxis] * some.shapes(across), some.slopes(across)
        return np.asarray((value**2 + slopes**2) @ weights)


@lru_cache(maxsize=1)
def _half_rule() -> tuple[Real, Real]:
    """Return the upper half of Gauss's rule, for what is the same on both sides of the middle."""
    nodes, weights = np.polynomial.legendre.leggauss(_NORM_NODES)
    return nodes[_NORM_NODES // 2 :], weights[_NORM_NODES // 2 :]


def _overlap(gi: Complex, gj: Complex, sign: int) -> tuple[Complex, Complex]:
    """Return int c_i c_j dY and int c_i' c_j' dY over the strip, c being `shape`, equation (75)."""
    # One branch is flat where its g is 0, and the integrals of two sines over it would be a
    # difference divided by g^2: there they are taken from the edge values, or as a series.
    alike: Complex = faded(gi + gj, 1.0) / 2
    if gi is gj:
        other = np.asarray(np.exp(-gi) / 2, dtype=np.complex128)
        if sign > 0:
            return alike + other, gi * gj * (alike - other)
        return _arched(gi, alike - other), alike + other
    other = (np.exp(-gj) - np.exp(-gi)) / (2 * (gi - gj))
    if sign > 0:
        return alike + other, gi * gj * (alike - other)
    gap = gj**2 - gi**2
    flat = 4 * np.abs(gi * gj) < np.abs(gap)
    value = (alike - other) / np.where(flat, 1, gi * gj)
    if flat.any():
        a, b = gi[flat], gj[flat]
        edges = [shape(g, _END, -1) * slope(h, _END, -1) for g, h in ((a, b), (b, a))]
        value[flat] = 2 * (edges[0] - edges[1]) / gap[flat]
    return value, alike + other


def _arched(g: Complex, difference: Complex) -> Complex:
    """Return exp(-g) (sinh(g) / g - 1) / (2 g^2) from the difference (75) of two exponentials."""
    flat = np.abs(g) < _ARCH
    square = np.where(flat, g * g, 1)
    series = np.zeros_like(g)
    for power in _ARCH_SERIES:
        series = series * square + power
    return np.where(flat, np.exp(-g) / 2 * series, difference / np.where(flat, 1, g * g))


def guided(
    k: Exact | Complex, hold: Exact | Complex, n_modes: int, sign: int, rtol: float = 0.0
) -> Guided:
    """Return the guided waves of one symmetry, equation (45); hold is 1 / (kappa W).

    It is 0 for clamped and infinite for simply supported edges, which have closed forms; k W is
    not 0. Near a cut-off p has the relative error of k over the detuning: there the digits of a
    long double count.

    The lowest wave of the clamped strip begins to propagate at k W = 4.730040744862704:

    >>> k = np.array([4.7300407448627, 4.7300407448628]) + 0j
    >>> p = guided(k, np.zeros(2) + 0j, 3, +1).p[:, 0]
    >>> bool(p[0].real == 0 and p[1].imag == 0)
    True
    """
    if np.isinf(hold).all():
        return _supported(k, n_modes, sign)
    rough_k, rough_hold = k.astype(np.complex128), hold.astype(np.complex128)
    bending = (rough_k / 2) ** 2
    x, lack = None, _TABLE_LACK
    if rtol >= _ROUGH and not rough_hold.any():
        x = clamped_roots(bending, n_modes, symmetric=sign > 0)
    if x is None:
        lack = 0.0
        x = section_roots(
            bending,
            2 * rough_hold,
            n_modes,
            symmetric=sign > 0,
            spare=_SPARE,
            settled=_SETTLED,
        )
    z = _sharpened(-4 * x, k, hold, sign)
    p = _outgoing(z)
    order = np.arange(len(p))[:, np.newaxis], _slowest_first(p)[:, :n_modes]
    z, p = z[order], p[order]
    k2 = (rough_k * rough_k)[:, np.newaxis]
    return Guided(p=p, g1=np.sqrt(z - k2), g2=np.sqrt(z + k2), sign=sign, lack=lack)


def near_cutoff(z: Complex | Real, k: Exact | Complex) -> NDArray[np.bool_]:
    """Return where p^2 is a small difference, for which all digits of k are used."""
    return np.asarray(np.abs(z) < _NEAR_CUTOFF * np.abs(k) ** 2)


def _sharpened(z: Complex, k: Exact | Complex, hold: Exact | Complex, sign: int) -> Complex:
    """Return p^2 after one more step with all digits of k, where p^2 is a small difference."""
    # At a cut-off p is the root of a small difference of numbers of the size of k^2, which leaves
    # it half of the digits of a double. One step in long doubles, from a root that is near enough
    # already, brings back what k itself tells.
    near = near_cutoff(z, k[:, np.newaxis])
    rows = near.any(axis=1)
    if not rows.any():
        return z
    exact, some = z[rows].astype(np.clongdouble), near[rows]
    c = 2 * hold[rows, np.newaxis]
    weights, bending = (c / (1 + c), 1 / (1 + c)), (k[rows, np.newaxis] / 2) ** 2
    value, slope = relation(-exact / 4, bending, weights, symmetric=sign > 0)
    step = np.where(some, -4 * value / slope, 0.0)
    if not (k.imag.any() or hold.imag.any()):
        step = step.real + 0j
    z = z.copy()
    z[rows] = (exact - step).astype(np.complex128)
    return z


def supported(k: Exact | Complex, n_orders: int, sign: int) -> Guided:
    """Return the waves of simply supported edges, (9) and (19): all orders, one branch by one."""
    first = 1 if sign > 0 else 2
    exact_q = PI * np.arange(first, first + 2 * n_orders, 2)
    k = k[:, np.newaxis]
    z = np.concatenate([(k - exact_q) * (k + exact_q), -(k * k + exact_q**2)], axis=1)
    z, k, q = z.astype(np.complex128), k.astype(np.complex128), exact_q.astype(np.float64)
    across = np.broadcast_to(1j * np.concatenate([q, q]), z.shape)
    branch = np.broadcast_to(np.repeat(np.array([1, 2]), n_orders), z.shape)
    other = np.sqrt(z + np.where(branch == 1, 1, -1) * k * k)
    g1 = np.concatenate([across[:, :n_orders], other[:, n_orders:]], axis=1)
    g2 = np.concatenate([other[:, :n_orders], across[:, n_orders:]], axis=1)
    return Guided(p=_outgoing(z), g1=g1, g2=g2, sign=sign, branch=branch)


def _supported(k: Exact | Complex, n_modes: int, sign: int) -> Guided:
    """Return the waves of simply supported edges with the slowest decay."""
    found = supported(k, n_modes, sign)
    order = np.arange(len(k))[:, np.newaxis], _slowest_first(found.p)[:, :n_modes]
    names: dict[str, Any] = {
        name: getattr(found, name)[order] for name in ("p", "g1", "g2", "branch")
    }
    return Guided(sign=sign, **names)


def _outgoing(z: Complex) -> Complex:
    """Return the root with Im > 0, or Im = 0 and Re > 0, whatever the sign of a zero."""
    p: Complex = np.sqrt(z)  # Re >= 0
    return np.where(p.imag < 0, -p, p) + 0j


def _slowest_first(p: Complex) -> NDArray[np.intp]:
    # All waves that propagate have Im p = 0: a little of Re p puts the largest first, and the
    # positive one of a pair +-Re p, without changing the order of waves that decay.
    return np.argsort(p.imag - 1e-9 * p.real, axis=1, kind="stable")
