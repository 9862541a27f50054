"""The guided waves of an endless strip: wavenumbers, shapes and norms, for many frequencies.

Everything is in units of the strip's width W: k W, p W, kappa W, Y = y / W - 1/2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.solver.across import shape, shape_integral
from stimuli.strip.dispersion import relation
from stimuli.strip.roots import section_roots

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Exact, Real
    from stimuli.solver.source import Source


PI: Final = np.longdouble("3.14159265358979323846264338327950288")
_NEAR_CUTOFF: Final = 1e-2
_SPARE: Final = 1
"""Waves sought beyond those asked for: the last may be one of a pair. More would only cost time,
since what their order hides lies where the waves are faint."""

_NORM_NODES: Final = 48
_END: Final = np.array(0.5)
_LOW: Final = 2.0
"""2 (k W)^2 below which the closed form of the norms loses digits."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Guided:
    """Guided waves of one symmetry, the slowest decay first: arrays (n_frequencies, n_modes)."""

    p: Complex  # wavenumbers times W, outgoing
    g1: Complex  # decay constants across the strip, of both branches
    g2: Complex
    sign: int  # +1 symmetric, -1 antisymmetric
    _ends: tuple[Complex, Complex] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        ends = tuple(shape(g, _END, self.sign) for g in (self.g1, self.g2))
        object.__setattr__(self, "_ends", ends)

    def shapes(self, across: Real) -> Complex:
        """Return the shapes at places Y: shape (n_frequencies, n_modes, n_places)."""
        g1, g2, end1, end2 = (a[..., np.newaxis] for a in (self.g1, self.g2, *self._ends))
        return end1 * shape(g2, across, self.sign) - end2 * shape(g1, across, self.sign)

    def excited(self, k: Complex, source: Source) -> Complex:
        """Return the load's integral over each shape, shape (n_frequencies, n_modes)."""
        one, two = source.branch_weights(k)
        near = two * shape_integral(self.g2, source.span, self.sign)
        far = one * shape_integral(self.g1, source.span, self.sign)
        end1, end2 = self._ends
        return end1 * near - end2 * far

    def followed(self, k: Complex, n_pairs: int) -> Guided:
        """Return these waves and about those that follow, in pairs like the last two.

        Of simply supported edges p^2 = +-k^2 - q^2 with q in steps of 2 pi, of others nearly so:
        each second difference of p^2 is -8 pi^2.
        """
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

    def norms(self, n_exact: int | None = None) -> Complex:
        """Return N = 4 p int (p^2 phi^2 + phi'^2) dY, equation (46): bilinear, no conjugate.

        The closed form cancels as k^-4 and is taken where k W > 1, else a sum over nodes for the
        first `n_exact` waves (all, if it is None).
        """
        total = self._closed_norms()
        low = np.flatnonzero(np.abs(self.g2[:, 0] ** 2 - self.g1[:, 0] ** 2) < _LOW)
        if low.size:
            total[low, :n_exact] = self._summed_norms(low, n_exact)
        return 4 * self.p * total

    def _closed_norms(self) -> Complex:
        end1, end2 = self._ends
        g, weight = (self.g1, self.g2), (-end2, end1)
        square = self.p**2
        total = np.zeros_like(self.p)
        for i, j, factor in ((0, 0, 1), (0, 1, 2), (1, 1, 1)):
            alike, other = _products(g[i], g[j], same=i == j)
            even, odd = alike + self.sign * other, alike - self.sign * other
            total += factor * weight[i] * weight[j] * (square * even + g[i] * g[j] * odd)
        return total

    def _summed_norms(self, rows: NDArray[np.intp], n_modes: int | None) -> Complex:
        nodes, weights = _half_rule()
        parts = (self.p, self.g1, self.g2, *self._ends)
        p, g1, g2, end1, end2 = (a[rows, :n_modes, np.newaxis] for a in parts)
        across, sign = nodes / 2, self.sign
        value = end1 * shape(g2, across, sign) - end2 * shape(g1, across, sign)
        slope = end1 * g2 * shape(g2, across, -sign) - end2 * g1 * shape(g1, across, -sign)
        return np.asarray(((p * value) ** 2 + slope**2) @ weights)


@lru_cache(maxsize=1)
def _half_rule() -> tuple[Real, Real]:
    """Return the upper half of Gauss's rule, for what is the same on both sides of the middle."""
    nodes, weights = np.polynomial.legendre.leggauss(_NORM_NODES)
    return nodes[_NORM_NODES // 2 :], weights[_NORM_NODES // 2 :]


def _products(gi: Complex, gj: Complex, *, same: bool) -> tuple[Complex, Complex]:
    """Return the two parts of int shape_i shape_j dY over the strip."""
    alike: Complex = -np.expm1(-(gi + gj)) / (2 * (gi + gj))
    if same:
        return alike, np.asarray(np.exp(-gi) / 2)
    other: Complex = (np.exp(-gj) - np.exp(-gi)) / (2 * (gi - gj))
    return alike, other


def guided(k: Exact | Complex, hold: Exact | Complex, n_modes: int, sign: int) -> Guided:
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
    if np.all(np.isinf(hold)):
        return _supported(k, n_modes, sign)
    rough_k, rough_hold = k.astype(np.complex128), hold.astype(np.complex128)
    x = section_roots((rough_k / 2) ** 2, 2 * rough_hold, n_modes, symmetric=sign > 0, spare=_SPARE)
    z = _near_cutoff(-4 * x, k, hold, sign)
    p = _outgoing(z)
    order = _slowest_first(p)[:, :n_modes]
    z, p = (np.take_along_axis(a, order, axis=1) for a in (z, p))
    k2 = (rough_k * rough_k)[:, np.newaxis]
    return Guided(p=p, g1=np.sqrt(z - k2), g2=np.sqrt(z + k2), sign=sign)


def _near_cutoff(z: Complex, k: Exact | Complex, hold: Exact | Complex, sign: int) -> Complex:
    """Return p^2 after one more step with all digits of k, where p^2 is a small difference."""
    # At a cut-off p is the root of a small difference of numbers of the size of k^2, which leaves
    # it half of the digits of a double. One step in long doubles, from a root that is near enough
    # already, brings back what k itself tells.
    near = np.abs(z) < _NEAR_CUTOFF * np.abs(k[:, np.newaxis]) ** 2
    rows = np.any(near, axis=1)
    if not np.any(rows):
        return z
    exact, some = z[rows].astype(np.clongdouble), near[rows]
    c = 2 * hold[rows, np.newaxis]
    weights, bending = (c / (1 + c), 1 / (1 + c)), (k[rows, np.newaxis] / 2) ** 2
    value, slope = relation(-exact / 4, bending, weights, symmetric=sign > 0)
    step = np.where(some, -4 * value / slope, 0.0)
    if not (np.any(k.imag) or np.any(hold.imag)):
        step = step.real + 0j
    z = z.copy()
    z[rows] = (exact - step).astype(np.complex128)
    return z


def _supported(k: Exact | Complex, n_modes: int, sign: int) -> Guided:
    """Return the waves of simply supported edges, equations (9) and (19)."""
    first = 1 if sign > 0 else 2
    exact_q = PI * np.arange(first, first + 2 * n_modes, 2)
    k = k[:, np.newaxis]
    z = np.concatenate([(k - exact_q) * (k + exact_q), -(k * k + exact_q**2)], axis=1)
    z, k, q = z.astype(np.complex128), k.astype(np.complex128), exact_q.astype(np.float64)
    across = np.broadcast_to(1j * np.concatenate([q, q]), z.shape)
    other = np.sqrt(z + np.repeat(np.array([1, -1]), n_modes) * k * k)
    g1 = np.concatenate([across[:, :n_modes], other[:, n_modes:]], axis=1)
    g2 = np.concatenate([other[:, :n_modes], across[:, n_modes:]], axis=1)
    p = _outgoing(z)
    order = _slowest_first(p)[:, :n_modes]
    p, g1, g2 = (np.take_along_axis(a, order, axis=1) for a in (p, g1, g2))
    return Guided(p=p, g1=g1, g2=g2, sign=sign)


def _outgoing(z: Complex) -> Complex:
    """Return the root with Im > 0, or Im = 0 and Re > 0, whatever the sign of a zero."""
    p: Complex = np.sqrt(z)
    p = np.where((p.imag < 0) | ((p.imag == 0) & (p.real < 0)), -p, p)
    return p + 0j


def _slowest_first(p: Complex) -> NDArray[np.intp]:
    # All waves that propagate have Im p = 0: a little of Re p puts the largest first, and the
    # positive one of a pair +-Re p, without changing the order of waves that decay.
    return np.argsort(p.imag - 1e-9 * p.real, axis=1, kind="stable")
