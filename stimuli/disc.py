"""Inside a disc: what its field has over that of the source at its centre that replaces it."""

from __future__ import annotations

from functools import lru_cache
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
