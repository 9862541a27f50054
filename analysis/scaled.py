"""Levels of many tables, each scaled to run from 0 to 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scaled:
    """Levels of many tables, scaled.

    Attributes
    ----------
    u : ndarray of float64, shape (fits, levels)
        From 0 to 1; where nothing was presented, 0.
    low, width : ndarray of float64, shape (fits,)
        The lowest level and the range of each table.
    """

    u: Floats
    low: Floats
    width: Floats


def scale(x: Floats, presented: Floats) -> Scaled:
    """Scale the levels at which something was presented to run from 0 to 1.

    Examples
    --------
    >>> scale(np.array([[5.0, 7.0, 9.0]]), np.array([[1.0, 1.0, 0.0]])).u.tolist()
    [[0.0, 1.0, 0.0]]
    """
    lowest = np.where(presented > 0, x, np.inf).min(axis=1)
    at = np.where(presented > 0, x, lowest[:, None])
    width = np.ptp(at, axis=1)
    u = (at - lowest[:, None]) / np.where(width > 0, width, 1.0)[:, None]
    return Scaled(u=u, low=lowest, width=width)
