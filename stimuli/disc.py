"""Inside a disc: what its field has over that of the source at its centre that replaces it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Complex = NDArray[np.complex128]
    Real = NDArray[np.float64]

_SERIES_TERMS: Final = 12
_SERIES_REACH: Final = 3.0
"""Largest |k R| of the power series."""


def inside_excess(k: Complex, radius: float, distance: Real, *, moment: bool) -> Complex:
    """Return D U of a disc less that of its replacement by a source at its centre, (44), (50).

    Parameters
    ----------
    k : ndarray of complex128, shape (n_frequencies,)
        Bending wavenumber times the width.
    radius : float
        Radius R in widths.
    distance : ndarray of float64, shape (n_points,)
        Distances r > 0 from the centre in widths.
    moment : bool
        Moment patch or pressure.

    Returns
    -------
    ndarray of complex128, shape (n_frequencies, n_points)
        0 for r >= R. Both branches solve (lap +- k^2) w = -1 with w = dw/dr = 0 at r = R.

    Examples
    --------
    Without curvature nor value at the rim, the excess of a pressure is biharmonic inside:

    >>> excess = inside_excess(np.array([1e-3 + 0j]), 1.0, np.array([0.999, 2.0]), moment=False)
    >>> bool(abs(excess[0, 0]) < 1e-12), complex(excess[0, 1])
    (True, 0j)
    """
    inside = distance < radius
    ratio = np.where(inside, distance / radius, 1.0)
    value = np.zeros((k.size, distance.size), dtype=np.complex128)
    small = np.abs(k) * radius < _SERIES_REACH
    value[small] = _series(k[small], radius, ratio, moment=moment)
    value[~small] = _closed(k[~small], radius, ratio, moment=moment)
    return np.where(inside, value, 0.0)


def _series(k: Complex, radius: float, ratio: Real, *, moment: bool) -> Complex:
    """Return the power series in k^4: w = w_0 -+ k^2 w_1 + k^4 w_2 ..., lap w_(j+1) = w_j."""
    terms = _rim_terms(ratio)
    power, first = (k * radius) ** 4, 0 if moment else 1
    scale = radius ** (2 if moment else 4)
    total = np.zeros((k.size, ratio.size), dtype=np.complex128)
    for j in range(_SERIES_TERMS - 2 + first, -1, -2):
        total = total * power[:, np.newaxis] + terms[j]
    return -scale * total


def _rim_terms(ratio: Real) -> list[Real]:
    """Return w_j / R^(2j+2): w_0 solves lap w = -1, and all vanish with their slope at the rim."""
    log = np.log(ratio)
    plain, logged = np.array([0.0, -0.25]), np.array([0.0, 0.0])
    terms = []
    for _ in range(_SERIES_TERMS):
        powers = 2 * np.arange(plain.size)
        value = plain.sum()
        slope = (powers * plain + logged).sum()
        plain[0] -= value
        logged[0] -= slope
        even = ratio[:, np.newaxis] ** powers
        terms.append((even * (plain + logged * log[:, np.newaxis])).sum(axis=1))
        square = (powers + 2.0) ** 2
        next_logged = logged / square
        next_plain = (plain - 2 * (powers + 2) * next_logged) / square
        plain, logged = (np.concatenate([[0.0], a]) for a in (next_plain, next_logged))
    return terms


def _closed(k: Complex, radius: float, ratio: Real, *, moment: bool) -> Complex:
    """Return the same in Bessel functions, for large discs."""
    from scipy.special import hankel1, iv, jv, kv

    z, k2 = (k * radius)[:, np.newaxis], (k * k)[:, np.newaxis]
    zr = z * ratio
    one = -1 + 0.5j * np.pi * z * (hankel1(1, z) * jv(0, zr) - jv(1, z) * hankel1(0, zr))
    two = 1 - z * (kv(1, z) * iv(0, zr) + iv(1, z) * kv(0, zr))
    return -(one + two) / (2 * k2) if moment else (one - two) / (2 * k2 * k2)
