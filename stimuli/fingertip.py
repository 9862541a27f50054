"""Where a fingertip touches the plate, and the points that stand for its contact area."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from stimuli.checks import finite, instance
from stimuli.strip import Strip

if TYPE_CHECKING:
    from collections.abc import Iterator

_LEAST_RINGS: Final = 3
_RINGS_PER_WIDTH: Final = 15.0
"""Rings about the centre, per width of the strip: with these the largest displacement over the
points is within 0.1 dB of that over the area, unless a load of a few millimetres lies under it
away from its centre: then within 0.3 dB."""

_POINTS_PER_RING: Final = 8
_DIGITS: Final = 12
"""Places are rounded to a picometre, so that mirrored pairs of loads and points are equal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fingertip:
    """The contact area of a fingertip: a disc, cut off at the edges and ends of the strip.

    Attributes
    ----------
    x_m, y_m : float
        Centre along the strip, and across it from one edge.
    radius_m : float
        Radius, up to 0.1 m; 0 is a point. A fingertip at rest covers about 1 cm2, with some
        dependence on its owner and on how hard it presses.

    Raises
    ------
    ValueError
        If a value is not a finite number in its range.

    Notes
    -----
    The plate moves as if no finger touched it: neither the load nor the damping of the skin is
    in the model. Dzidek et al., J. R. Soc. Interface 14 (2017) 20160935, measured how the area
    of a finger pad on glass grows with force; 5 mm is a round value for light touch, no fit.

    Examples
    --------
    A fingertip of no size is its centre:

    >>> from stimuli import ALUMINIUM, CLAMPED, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> Fingertip(x_m=0.035, y_m=0.0125, radius_m=0.0).points_m(strip)
    ((0.035, 0.0125),)
    >>> len(Fingertip(x_m=0.035, y_m=0.0125).points_m(strip))
    49
    """

    x_m: float
    y_m: float
    radius_m: float = 0.005

    def __post_init__(self) -> None:
        ranges = {"x_m": (-1e3, 1e3), "y_m": (0.0, 1e3), "radius_m": (0.0, 0.1)}
        for name, (least, most) in ranges.items():
            size_m = finite(name, getattr(self, name), least=least, most=most)
            object.__setattr__(self, name, size_m)

    def points_m(self, strip: Strip) -> tuple[tuple[float, float], ...]:
        """Return points that sample the contact area, equation (69).

        Parameters
        ----------
        strip : Strip
            The strip it rests on.

        Returns
        -------
        tuple of (float, float)
            Points (x, y), the centre first, the same on either side of it. They lie on rings;
            those beyond an edge, where the plate does not move, are left out, those beyond an
            end are moved onto it.

        Raises
        ------
        ValueError
            If the fingertip's centre is not on the strip.

        Examples
        --------
        Over an edge only a half is left:

        >>> from stimuli import ALUMINIUM, CLAMPED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
        >>> points = Fingertip(x_m=0.0, y_m=0.0).points_m(strip)
        >>> all(y > 0 for x, y in points[1:])
        True
        """
        instance("strip", strip, Strip, "a Strip")
        end_m = math.inf if strip.length_m is None else strip.length_m / 2
        if self.y_m > strip.width_m or abs(self.x_m) > end_m:
            raise ValueError(
                f"x_m and y_m must lie on the strip, abs(x_m) <= {end_m:g} and "
                f"y_m <= {strip.width_m:g}, got {self!r}"
            )
        found = {(self.x_m, self.y_m): None}
        for along_m, across_m in _rings(self.radius_m, strip.width_m):
            x_m = round(min(max(self.x_m + along_m, -end_m), end_m), _DIGITS)
            y_m = round(self.y_m + across_m, _DIGITS)
            if 0 < y_m < strip.width_m:
                found[x_m, y_m] = None
        return tuple(found)


def _rings(radius_m: float, width_m: float) -> Iterator[tuple[float, float]]:
    """Yield places on rings about 0, exactly the same in each quadrant."""
    rings = max(_LEAST_RINGS, math.ceil(_RINGS_PER_WIDTH * radius_m / width_m - 1e-9))
    for ring in range(1, rings + 1 if radius_m else 1):
        reach_m, quarter = radius_m * ring / rings, _POINTS_PER_RING * ring // 4
        for step in range(quarter):
            angle = math.pi / 2 * step / quarter
            a_m = reach_m * math.cos(angle) if step else reach_m
            b_m = reach_m * math.sin(angle)
            yield from ((a_m, b_m), (-b_m, a_m), (-a_m, -b_m), (b_m, -a_m))
