"""Sums of exponentials at many places, of which a spectrum or a course of time is made."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from stimuli.arrays import Complex, Real


_MOST_TERMS: Final = 2_000_000
"""Numbers of the inner products that are held at once."""


def exponential_sums(coefficients: Complex | Real, turns: Complex | Real) -> Complex:
    """Return the sums over k of c_k exp(2 pi i k turns), equation (65).

    With k = j B + b the exponentials are those of the b and of the j alone: n values of k and m
    places need m sqrt(n) exponentials, not m n, and two products of matrices.

    Parameters
    ----------
    coefficients : ndarray of float64 or complex128, shape (n, n_sums)
        Coefficients c_k, k from 0.
    turns : ndarray of float64 or complex128, shape (n_places,)
        Angles in turns, Im >= 0 where they are complex.

    Returns
    -------
    ndarray of complex128, shape (n_places, n_sums)

    Examples
    --------
    A quarter of a turn:

    >>> exponential_sums(np.array([[1.0], [1.0], [1.0]]), np.array([0.25])).round(9)
    array([[0.+1.j]])
    """
    n, n_sums = coefficients.shape
    length = max(1, math.isqrt(n))
    n_blocks = -(-n // length)
    padded = np.zeros((n_blocks * length, n_sums), dtype=coefficients.dtype)
    padded[:n] = coefficients
    # one row for each b, for it the sums of each block
    inner = padded.reshape(n_blocks, length, n_sums).transpose(1, 0, 2).reshape(length, -1)
    values = np.empty((turns.size, n_sums), dtype=np.complex128)
    n_at_once = max(1, _MOST_TERMS // (n_blocks * n_sums + length))
    for start in range(0, turns.size, n_at_once):
        some = turns[start : start + n_at_once, np.newaxis]
        within = np.exp(2j * np.pi * some * np.arange(length)) @ inner
        across = np.exp(2j * np.pi * some * (length * np.arange(n_blocks)))
        blocks = within.reshape(some.shape[0], n_blocks, n_sums)
        values[start : start + n_at_once] = (across[:, np.newaxis, :] @ blocks)[:, 0]
    return values
