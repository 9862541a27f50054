"""The first waves between clamps, from a table: their roots depend on one number only.

Means and squared half distances of pairs of waves that meet only one another are smooth in the
square of the bending, as equation (87) has it for sweeps. Their Chebyshev coefficients hold for
every clamped strip; they are found once.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.strip.roots import section_roots

if TYPE_CHECKING:
    from stimuli.arrays import Complex, Real


_TOP: Final = 5.2 * (math.pi / 2) ** 2
"""Largest bending of the table: at 5.9 first cut-offs of the supported strip the second wave meets
the third."""

_PAIRS: Final = 4
_NODES: Final = 32
"""Of these the last coefficients are rounding: each falls to a quarter of the one before."""

_ROUNDING: Final = 1e-15
"""Part of the largest coefficient below which others are rounding, and would grow off the axis."""

_SLANT: Final = 0.01
"""Largest imaginary part of the bending, over itself: farther from the axis the series grows."""


def clamped_roots(bending: Complex, count: int, *, symmetric: bool) -> Complex | None:
    """Return what `section_roots` does between clamps, in pairs, or None beyond the table.

    Without loss roots are real or exactly conjugate. Shape (n_sections, 8), for a count up to that.

    Examples
    --------
    >>> x = clamped_roots(np.zeros(1) + 0j, 2, symmetric=True)[0, :2]
    >>> s = 2 * np.sqrt(x)
    >>> s.round(6), bool(np.all(abs(s + np.sin(s)) < 1e-13))
    (array([4.212392-2.250729j, 4.212392+2.250729j]), True)
    """
    if count > 2 * _PAIRS or np.any(np.abs(bending) > _TOP):
        return None
    if np.any(np.abs(bending.imag) > _SLANT * np.abs(bending.real)):
        return None
    lossless = not bending.imag.any()
    place = 2 * ((bending.real if lossless else bending) / _TOP) ** 2 - 1
    turns = np.multiply.outer(np.arccos(place), np.arange(_NODES))
    found = np.cos(turns) @ _table(symmetric=symmetric)
    mean, half = found[:, :_PAIRS], np.sqrt(found[:, _PAIRS:].astype(np.complex128))
    return np.stack([mean - half, mean + half], axis=2).reshape(len(bending), -1)


@lru_cache(maxsize=2)
def _table(*, symmetric: bool) -> Real:
    """Return coefficients of means and squared half distances, shape (n_nodes, 2 n_pairs)."""
    odd = 2 * np.arange(_NODES) + 1
    bending = _TOP * np.cos(np.pi * odd / (4 * _NODES)) + 0j
    x = section_roots(bending, np.zeros_like(bending), 2 * _PAIRS, symmetric=symmetric)
    one, two = x[:, ::2], x[:, 1::2]
    values = np.concatenate([(one + two).real / 2, ((one - two) ** 2).real / 4], axis=1)
    turns = np.multiply.outer(np.arange(_NODES), odd) % (4 * _NODES)
    series = np.cos(np.pi * turns / (2 * _NODES))
    series[0] /= 2
    found = 2 / _NODES * series @ values
    return np.where(np.abs(found) < _ROUNDING * np.max(np.abs(found), axis=0), 0.0, found)
