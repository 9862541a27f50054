"""A scene: a strip, its loads, and the places at which its displacement is computed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from stimuli.checks import finite_array, instance
from stimuli.load import LOADS, Load
from stimuli.plate.strip import MAX_CUTOFFS, Strip

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from stimuli.arrays import Real

_MAX_X_M: Final = 1e3
_ROUNDING: Final = 1e-12
_NEAR_EDGE: Final = 0.02
"""Of the width: a load near an edge makes a field that no basis here follows."""
_AXES: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A strip with loads and the points at which its displacement is computed.

    Attributes
    ----------
    strip : Strip
        The strip, endless or with two free ends at x = -length_m / 2 and length_m / 2.
    loads : tuple of Load
        At least one load, each driven by itself and wholly on the strip; it may touch edges and
        ends, but its centre lies at least 2 % of the width from the edges.
    points_m : tuple of (float, float)
        At least one point (x, y).

    Raises
    ------
    ValueError
        If there is no load or no point, or one of them is not where it may be.

    Examples
    --------
    >>> from stimuli import ALUMINIUM, CLAMPED, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.01, radius_m=0.0064)
    >>> len(Scene(strip=strip, loads=(disc,), points_m=((0.0, 0.01), (0.07, 0.01))).points_m)
    2
    """

    strip: Strip
    loads: tuple[Load, ...]
    points_m: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "loads", check_loads(self.strip, self.loads))
        points = [tuple(point) for point in _check_points(self.strip, self.points_m).tolist()]
        object.__setattr__(self, "points_m", tuple(points))

    @property
    def points(self) -> Real:
        """The points as an array (n_points, 2)."""
        return np.array(self.points_m)

    def check_frequencies(self, frequencies_hz: ArrayLike) -> Real:
        """Return frequencies as an array (n_frequencies,), or refuse them with a ValueError."""
        frequencies = finite_array("frequencies_hz", frequencies_hz)
        max_hz = MAX_CUTOFFS * self.strip.cutoff_hz()
        is_in_range = (frequencies >= 0) & (frequencies <= max_hz)
        if frequencies.ndim != 1 or not frequencies.size or not is_in_range.all():
            raise ValueError(
                "frequencies_hz must be a one-dimensional array, not empty, of frequencies from 0 "
                f"to {max_hz:.6g} Hz, got {frequencies_hz!r}"
            )
        return frequencies


def check_loads(strip: Strip, loads: Sequence[Load]) -> tuple[Load, ...]:
    """Return loads as a tuple, or refuse them with a ValueError."""
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
        if rooms_m[1] - centre_m[1] < (_NEAR_EDGE - _ROUNDING) * strip.width_m:
            raise ValueError(
                f"loads must have their centres at least {_NEAR_EDGE * strip.width_m:.3g} m from "
                f"the edges, where the strip barely moves, got {load!r}"
            )
    return tuple(loads)


def _check_points(strip: Strip, points_m: ArrayLike) -> Real:
    points = finite_array("points_m", points_m)
    if points.ndim != _AXES or points.shape[1] != _AXES or not points.size:
        raise ValueError(f"points_m must hold at least one pair (x, y), got {points_m!r}")
    x_m, y_m = points.T
    half_length_m = _half_length_m(strip)
    is_on_strip = (np.abs(x_m) <= half_length_m) & (y_m >= 0) & (y_m <= strip.width_m)
    if not is_on_strip.all():
        raise ValueError(
            f"points_m must lie on the strip, abs(x) <= {half_length_m:g} and 0 <= y <= "
            f"{strip.width_m:g}, got {points[~is_on_strip][0].tolist()}"
        )
    return points


def _half_length_m(strip: Strip) -> float:
    return _MAX_X_M if strip.length_m is None else strip.length_m / 2


class Section(NamedTuple):
    """A part of a plate, with loads and points (n_points, 2) from its own middle."""

    strip: Strip
    loads: Sequence[Load]
    points_m: Real


def cut_section(strip: Strip, loads: Sequence[Load], points_m: Real, beyond_m: float) -> Section:
    """Return a plate with ends without what lies far beyond loads, patches and points."""
    places_m = [*points_m[:, 0]]
    for area in (*loads, *strip.patches):
        places_m += [area.x_m - area.half_size_m[0], area.x_m + area.half_size_m[0]]
    half_length_m = _half_length_m(strip)
    low_m, high_m = min(places_m) - beyond_m, max(places_m) + beyond_m
    if low_m <= -half_length_m and high_m >= half_length_m:
        return Section(strip, loads, points_m)
    low_m, high_m = max(low_m, -half_length_m), min(high_m, half_length_m)
    middle_m = (low_m + high_m) / 2
    patches = tuple(replace(patch, x_m=patch.x_m - middle_m) for patch in strip.patches)
    section = replace(strip, length_m=high_m - low_m, patches=patches)
    local_loads = [replace(load, x_m=load.x_m - middle_m) for load in loads]
    return Section(section, local_loads, points_m - (middle_m, 0.0))
