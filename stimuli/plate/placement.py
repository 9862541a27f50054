"""Loads, points and frequencies of a problem: they must lie on the strip, and in their ranges."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.checks import finite_array, instance
from stimuli.load import LOADS, Load
from stimuli.strip.strip import Strip

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from stimuli.arrays import Real

MAX_CUTOFFS: Final = 400.0
"""Highest frequency, in first cut-offs: 20 half waves over the width."""
_MAX_X_M: Final = 1e3
_ROUNDING: Final = 1e-12
_AXES: Final = 2


def check_loads(strip: Strip, loads: Sequence[Load]) -> tuple[Load, ...]:
    """Return loads as a tuple, or refuse them with a ValueError.

    Loads must lie wholly on the strip; they may touch its edges and ends.
    """
    instance("strip", strip, Strip, "a Strip")
    instance("loads", loads, (tuple, list), "a tuple of loads")
    if not loads:
        raise ValueError(f"loads must hold at least one load, got {loads!r}")
    rooms_m = _half_length_m(strip), strip.width_m / 2
    for load in loads:
        instance("loads", load, LOADS, "a tuple of loads")
        centre_m = abs(load.x_m), abs(load.y_m - strip.width_m / 2)
        for room_m, distance_m, half_m in zip(rooms_m, centre_m, load.half_size_m, strict=True):
            if distance_m + half_m > room_m + _ROUNDING * strip.width_m:
                raise ValueError(f"loads must lie wholly on the strip, got {load!r}")
    return tuple(loads)


def check_points(strip: Strip, points_m: ArrayLike) -> Real:
    """Return points as an array (n_points, 2), or refuse them with a ValueError."""
    points = finite_array("points_m", points_m)
    if points.ndim != _AXES or points.shape[1] != _AXES or not points.size:
        raise ValueError(f"points_m must hold at least one pair (x, y), got {points_m!r}")
    x_m, y_m = points.T
    half_length_m = _half_length_m(strip)
    is_on = (np.abs(x_m) <= half_length_m) & (y_m >= 0) & (y_m <= strip.width_m)
    if not is_on.all():
        raise ValueError(
            f"points_m must lie on the strip, abs(x) <= {half_length_m:g} and 0 <= y <= "
            f"{strip.width_m:g}, got {points[~is_on][0].tolist()}"
        )
    return points


def check_frequencies(strip: Strip, frequencies_hz: ArrayLike) -> Real:
    """Return frequencies as an array (n_frequencies,), or refuse them with a ValueError."""
    frequencies = finite_array("frequencies_hz", frequencies_hz)
    max_hz = MAX_CUTOFFS * strip.cutoff_hz()
    is_in_range = (frequencies >= 0) & (frequencies <= max_hz)
    if frequencies.ndim != 1 or not frequencies.size or not is_in_range.all():
        raise ValueError(
            "frequencies_hz must be a one-dimensional array, not empty, of frequencies from 0 to "
            f"{max_hz:.6g} Hz, got {frequencies_hz!r}"
        )
    return frequencies


def _half_length_m(strip: Strip) -> float:
    return _MAX_X_M if strip.length_m is None else strip.length_m / 2
