"""The guided waves of an endless strip: wavenumbers, shapes and norms, for many frequencies.

Everything is in units of the strip's width W: k W, p W, kappa W, Y = y / W - 1/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from stimuli.transverse import shape, shape_integral

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.transform import Source

    Complex = NDArray[np.complex128]
    Exact = NDArray[np.clongdouble]
    Real = NDArray[np.float64]

PI: Final = np.longdouble("3.14159265358979323846264338327950288")
_NEAR_CUTOFF: Final = 1e-2
_POLISHING_STEPS: Final = 5
_NORM_NODES: Final = 48
_LOW: Final = 2.0
"""2 (k W)^2 below which the closed form of the norms loses digits."""

_REAL: Final = 1e-6
"""Relative imaginary part of p^2 below which it is rounding, where there is no loss."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Guided:
    """Guided waves of one symmetry, the slowest decay first.

    Attributes
    ----------
    p : ndarray of complex128, shape (n_frequencies, n_modes)
        Wavenumbers times W, outgoing.
    g1, g2 : ndarray of complex128, shape (n_frequencies, n_modes)
        Decay constants across the strip of both branches.
    sign : int
        +1 symmetric, -1 antisymmetric.
    """

    p: Complex
    g1: Complex
    g2: Complex
    sign: int

    def shapes(self, across: Real) -> Complex:
        """Return the shapes at places Y: shape (n_frequencies, n_modes, n_places)."""
        return self._mixed(
            shape(self.g2[..., np.newaxis], across, self.sign),
            shape(self.g1[..., np.newaxis], across, self.sign),
        )

    def excited(self, k: Complex, source: Source) -> Complex:
        """Return the load's integral over each shape, shape (n_frequencies, n_modes)."""
        one, two = source.branch_weights(k)
        near = two * shape_integral(self.g2, source.span, self.sign)
        far = one * shape_integral(self.g1, source.span, self.sign)
        end1, end2 = self._ends()
        return end1 * near - end2 * far

    def norms(self) -> Complex:
        """Return N = 4 p int (p^2 phi^2 + phi'^2) dY, equation (46): bilinear, no conjugate.

        The closed form cancels as k^-4 and is taken where k W > 1, else a sum over nodes.
        """
        low = np.abs(self.g2[:, 0] ** 2 - self.g1[:, 0] ** 2) < _LOW
        total = self._closed_norms()
        total[low] = self._summed_norms()[low] if np.any(low) else 0.0
        return 4 * self.p * total

    def _closed_norms(self) -> Complex:
        end1, end2 = self._ends()
        g, weight = (self.g1, self.g2), (-end2, end1)
        total = np.zeros_like(self.p)
        for i in (0, 1):
            for j in (0, 1):
                alike, other = _products(g[i], g[j], same=i == j)
                even, odd = alike + self.sign * other, alike - self.sign * other
                total += weight[i] * weight[j] * (self.p**2 * even + g[i] * g[j] * odd)
        return total

    def _summed_norms(self) -> Complex:
        nodes, weights = _half_rule()
        across, g1, g2 = nodes / 2, self.g1[..., np.newaxis], self.g2[..., np.newaxis]
        slope2, slope1 = g2 * shape(g2, across, -self.sign), g1 * shape(g1, across, -self.sign)
        square = (self.p[..., np.newaxis] * self.shapes(across)) ** 2
        return np.asarray((square + self._mixed(slope2, slope1) ** 2) @ weights)

    def _ends(self) -> tuple[Complex, Complex]:
        end = np.array(0.5)
        return shape(self.g1, end, self.sign), shape(self.g2, end, self.sign)

    def _mixed(self, second: Complex, first: Complex) -> Complex:
        end1, end2 = self._ends()
        return end1[..., np.newaxis] * second - end2[..., np.newaxis] * first


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
    """Return the guided waves of one symmetry, equation (45).

    Parameters
    ----------
    k : ndarray of complex, shape (n_frequencies,)
        Bending wavenumber times the width, not 0. Near a cut-off, p has the relative error of k
        divided by the detuning: there the digits of a long double count.
    hold : ndarray of complex, shape (n_frequencies,)
        1 / (kappa W); 0 for clamped, infinite for simply supported edges.
    n_modes : int
        How many waves.
    sign : int
        +1 symmetric, -1 antisymmetric.

    Returns
    -------
    Guided

    Notes
    -----
    Simply supported edges have closed forms. Else a polynomial Galerkin eigenproblem, shifted so
    that it is positive definite, gives every wave of low order at once, and Newton steps on the
    dispersion relation polish them; two waves nearer to each other than its accuracy are left as
    they are (their sum is taken on a circle about both).

    Examples
    --------
    The lowest wave of the clamped strip begins to propagate at k W = 4.730040744862704:

    >>> k = np.array([4.7300407448627, 4.7300407448628]) + 0j
    >>> p = guided(k, np.zeros(2) + 0j, 3, +1).p[:, 0]
    >>> bool(p[0].real == 0 and p[1].imag == 0)
    True
    """
    if np.all(np.isinf(hold)):
        return _supported(k, n_modes, sign)
    rough_k, rough_hold = k.astype(np.complex128), hold.astype(np.complex128)
    z = _polished(_galerkin(rough_k, rough_hold, n_modes, sign), rough_k, rough_hold, sign)
    z = _near_cutoff(z, k, hold, sign)
    p = _outgoing(z)
    order = np.argsort(p.imag - 1e-9 * p.real, axis=1, kind="stable")
    z, p = (np.take_along_axis(a, order, axis=1) for a in (z, p))
    k2 = (rough_k * rough_k)[:, np.newaxis]
    return Guided(p=p, g1=np.sqrt(z - k2), g2=np.sqrt(z + k2), sign=sign)


def _near_cutoff(z: Complex, k: Exact | Complex, hold: Exact | Complex, sign: int) -> Complex:
    """Return p^2 after one more step with all digits of k, where p^2 is a small difference."""
    near = np.abs(z) < _NEAR_CUTOFF * np.abs(k[:, np.newaxis]) ** 2
    rows = np.any(near, axis=1)
    if not np.any(rows):
        return z
    exact, some = z[rows].astype(np.clongdouble), near[rows]
    value, slope = _dispersion(exact, k[rows, np.newaxis], hold[rows, np.newaxis], sign)
    step = np.where(some, value / slope, 0.0)
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
    order = np.argsort(p.imag - 1e-9 * p.real, axis=1, kind="stable")[:, :n_modes]
    p, g1, g2 = (np.take_along_axis(a, order, axis=1) for a in (p, g1, g2))
    return Guided(p=p, g1=g1, g2=g2, sign=sign)


def _outgoing(z: Complex) -> Complex:
    """Return the root with Im > 0, or Im = 0 and Re > 0, whatever the sign of a zero."""
    p: Complex = np.sqrt(z)
    p = np.where((p.imag < 0) | ((p.imag == 0) & (p.real < 0)), -p, p)
    return p + 0j


def _galerkin(k: Complex, hold: Complex, n_modes: int, sign: int) -> Complex:
    """Return p^2 of the waves of slowest decay from the shifted eigenproblem, (n_f, n_modes)."""
    size = int(1.5 * n_modes + 0.3 * np.max(np.abs(k)) + 6)
    bend, slope, mass, turn = _matrices(size, sign)
    clamped = bool(np.all(hold == 0))
    start = 1 if clamped else 0
    half = k / 2
    shift = np.abs(half) ** 2 + (np.pi / 2) ** 2
    scale = np.ones((k.size, size))
    bend = np.broadcast_to(bend, (k.size, size, size)).astype(np.complex128)
    if not clamped:
        spring = turn / (2 * hold)
        scale[:, 0] = 1 / np.sqrt(1 + np.abs(spring))
        bend[:, 0, 0] = bend[:, 0, 0] + spring
    both = (scale[:, :, np.newaxis] * scale[:, np.newaxis, :])[:, start:, start:]
    slope, mass, bend = (both * m[..., start:, start:] for m in (slope, mass, bend))
    sigma = shift[:, np.newaxis, np.newaxis]
    whole = bend + 2 * sigma * slope + (sigma**2 - (half**4)[:, np.newaxis, np.newaxis]) * mass
    damping = np.linalg.solve(whole, 2 * slope + 2 * sigma * mass)
    inertia = np.linalg.solve(whole, mass + 0j)
    n = size - start
    companion = np.zeros((k.size, 2 * n, 2 * n), dtype=np.complex128)
    companion[:, :n, :n], companion[:, :n, n:] = -damping, -inertia
    companion[:, n:, :n] = np.eye(n)
    nu = np.linalg.eigvals(companion)
    zeta = 4 * (shift[:, np.newaxis] + 1 / nu)
    order = np.argsort(_outgoing(zeta).imag, axis=1)[:, :n_modes]
    return np.take_along_axis(zeta, order, axis=1)


@lru_cache(maxsize=64)
def _matrices(size: int, sign: int) -> tuple[Real, Real, Real, float]:
    """Return int v''w'', v'w', v w over -1..1 and v'^2 at both ends of the first, the free one."""
    from numpy.polynomial import Legendre

    nodes, weights = np.polynomial.legendre.leggauss(2 * size + 8)
    free = Legendre([2 / 3, 0, -2 / 3]) if sign > 0 else Legendre([0, 2 / 5, 0, -2 / 5])
    free = free / (8.0 if sign > 0 else 24.0) ** 0.5
    functions = [free]
    for j in range(0 if sign > 0 else 1, 2 * size - 2 + (0 if sign > 0 else 1), 2):
        terms = np.zeros(j + 5)
        terms[[j, j + 2, j + 4]] = 1, -2 * (2 * j + 5) / (2 * j + 7), (2 * j + 3) / (2 * j + 7)
        functions.append(Legendre(terms) / (2 * (2 * j + 3) ** 2 * (2 * j + 5)) ** 0.5)
    grams = []
    for order in (2, 1, 0):
        values = np.array([(v.deriv(order) if order else v)(nodes) for v in functions])
        grams.append((values * weights) @ values.T)
    turn = 2 * float(free.deriv()(1.0)) ** 2
    return grams[0], grams[1], grams[2], turn


def _polished(z: Complex, k: Complex, hold: Complex, sign: int) -> Complex:
    """Return p^2 after Newton steps on the dispersion relation."""
    k, hold = k[:, np.newaxis], hold[:, np.newaxis]
    lossless = not (np.any(k.imag) or np.any(hold.imag))
    real = lossless & (np.abs(z.imag) < _REAL * (1 + np.abs(z)))
    z = np.where(real, z.real + 0j, z)
    apart = np.abs(z[:, :, np.newaxis] - z[:, np.newaxis, :])
    apart += np.where(np.eye(z.shape[1], dtype=bool), np.inf, 0.0)
    reach = 0.1 * np.min(apart, axis=2)
    start = z
    for _ in range(_POLISHING_STEPS):
        value, slope = _dispersion(z, k, hold, sign)
        z = z - value / slope
    z = np.where(np.abs(z - start) <= reach, z, start)
    return np.where(real, z.real + 0j, z)


def _dispersion(z: Any, k: Any, hold: Any, sign: int) -> tuple[Any, Any]:
    """Return (2 k^2/kappa) s1 s2 + g2 s2' s1 - g1 s1' s2 and its slope in z = p^2, equation (45).

    s is cosh(g/2) for symmetric waves and sinh(g/2) / g for antisymmetric ones: entire in z.
    """
    k2 = k * k
    factors = []
    for square in (z - k2, z + k2):
        g = np.sqrt(square)
        plus, minus = 1 + np.exp(-g), -np.expm1(-g)
        if sign > 0:  # s, its slope in z, g s', its slope in z
            values = (plus, minus / (4 * g), g * minus, minus / (2 * g) + plus / 4)
        else:
            s = minus / g
            values = (s, (plus / 2 - s) / (2 * square), plus, minus / (4 * g))
        factors.append(values)
    (s1, ds1, t1, dt1), (s2, ds2, t2, dt2) = factors
    pull = 2 * k2 * hold
    value = pull * s1 * s2 + t2 * s1 - t1 * s2
    slope = pull * (ds1 * s2 + s1 * ds2) + dt2 * s1 + t2 * ds1 - dt1 * s2 - t1 * ds2
    return value, slope
