"""Transmitted information: how many bits an answer says about the stimulus."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def transmitted_information(counts: ArrayLike) -> float:
    r"""Return the mutual information of stimulus and answer in bits.

    The plug-in estimate ``sum n_ij / n log2(n n_ij / (n_i n_j))`` of the observed shares, which
    exceeds the true value by about ``(rows - 1) (columns - 1) / (2 n ln 2)`` bits (G. A. Miller,
    "Note on the bias of information estimates", 1955).

    Parameters
    ----------
    counts : array_like of int, shape (S, A)
        How often each of S stimuli was answered by each of A answers.

    Returns
    -------
    float
        From 0 to log2 of the smaller of S and A; NaN if there is no answer at all.

    Raises
    ------
    ValueError
        For anything but a matrix of whole counts of at least 0.

    Examples
    --------
    Two stimuli that are always told apart carry one bit.

    >>> transmitted_information([[10, 0], [0, 10]])
    1.0
    """
    table = np.asarray(counts)
    if np.ndim(table) != np.ndim([[]]) or table.dtype.kind not in "iu" or np.any(table < 0):
        raise ValueError(f"counts must be a matrix of whole numbers of at least 0, got {counts!r}")
    if not table.any():
        return math.nan
    share = table / table.sum()
    independent = share.sum(axis=1, keepdims=True) * share.sum(axis=0)
    cells = share > 0
    return max(0.0, float(np.sum(share[cells] * np.log2(share[cells] / independent[cells]))))
